"""What a path costs, in factorisations and solutions, which are the same everywhere."""

from collections import Counter

import numpy as np
import pytest
from problems import fitted

from miurafab.origami.energy import equilibrium
from miurafab.origami.energy.assembly import Assembly, Touch
from miurafab.origami.energy.continuation import LONGEST, Known, Walk
from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.energy.driven import Driven
from miurafab.origami.energy.equilibrium import Balance, EquilibriumState
from miurafab.origami.energy.path import folding_path


def test_a_path_of_40_steps_takes_few_factors_all_of_them_by_cholesky(monkeypatch):
    """With a cubic prediction and K factored where 0.2 was left it took 25 factors, 281 steps."""
    calls = Counter()
    for name in ("factor", "step"):
        kept = getattr(Balance, name)

        def counting(*given, name=name, kept=kept, **how):
            calls[name] += 1
            return kept(*given, **how)

        monkeypatch.setattr(Balance, name, counting)

    def pivoted(*given, **how):
        raise AssertionError("a stable state was factored twice")

    monkeypatch.setattr(equilibrium, "factor_symmetric", pivoted)
    curve = energy_curve(fitted("hypar", columns=20, rows=20).pattern, 40)
    assert curve.converged
    assert calls["factor"] <= 16
    assert calls["step"] <= 225


def test_an_impatient_path_has_the_same_energies(monkeypatch):
    pattern = fitted("hypar", columns=8, rows=8).pattern
    path = folding_path(pattern, 12)
    monkeypatch.setattr(equilibrium, "PATIENCE", 0.0)  # K is new for each step
    newton = folding_path(pattern, 12)
    assert path.energies == pytest.approx(newton.energies, rel=1e-9, abs=1e-18)


@pytest.mark.parametrize("degree", [1, 2, 4, 7])
def test_the_prediction_finds_the_degree_of_a_path_by_itself(degree):
    """A polynomial of low degree is predicted to rounding, through no more states than it needs."""
    model = folding_path(fitted("hypar", columns=4, rows=4).pattern, 1).model
    driven = Driven(model, model.creases[0])
    rng = np.random.default_rng(degree)
    terms = rng.normal(size=(degree + 1, len(model.points), 3))

    def at(s):
        points = sum(term * s**power for power, term in enumerate(terms))
        return EquilibriumState(points, np.zeros(len(model.bars)), 0.0)

    walk = Walk(driven, driven.rest)
    for s in np.linspace(0.0, 1.0, LONGEST):
        walk.take(Known(float(s), at(s)))
    predicted = walk._predicted(1.125).points
    assert predicted == pytest.approx(at(1.125).points, abs=1e-10)


def test_the_matrix_is_the_sum_of_its_blocks_in_the_order_of_elimination():
    """Against a dense sum, block by block; held coordinates are left out, zeros are stored."""
    rng = np.random.default_rng(7)
    stencils = tuple(
        np.stack([rng.permutation(30)[:size] for _ in range(count)])
        for size, count in ((4, 25), (2, 40), (3, 1))
    )
    blocks = [rng.normal(size=(*s.shape, s.shape[1], 3, 3)) for s in stencils]
    blocks[1][:5] = 0.0
    assembly = Assembly(30, stencils, np.array([4, 11, 23]))
    dense = np.zeros((90, 90))
    stored = np.zeros((90, 90), dtype=bool)
    for group, given in zip(stencils, blocks, strict=True):
        for vertices, block in zip(group, given, strict=True):
            at = (vertices[:, None] * 3 + np.arange(3)).ravel()
            dense[np.ix_(at, at)] += block.swapaxes(1, 2).reshape(len(at), len(at))
            stored[np.ix_(at, at)] = True
    matrix = assembly.matrix(blocks)
    inner = np.ix_(assembly.free, assembly.free)
    assert matrix.shape == (84, 84)
    assert matrix.toarray() == pytest.approx(dense[inner], abs=1e-14)
    assert matrix.nnz == stored[inner].sum()
    assert matrix.has_sorted_indices
    loose, soon = (np.stack([rng.permutation(30)[:4] for _ in range(k)]) for k in (6, 9))
    pushes = rng.normal(size=(6, 4, 4, 3, 3))
    held = assembly.matrix(blocks, Touch(loose, np.empty((6, 4, 3)), pushes, soon))
    met = stored.copy()
    for vertices in np.concatenate([loose, soon]):
        at = (vertices[:, None] * 3 + np.arange(3)).ravel()
        met[np.ix_(at, at)] = True
    pushed = dense.copy()
    for vertices, block in zip(loose, pushes, strict=True):
        at = (vertices[:, None] * 3 + np.arange(3)).ravel()
        pushed[np.ix_(at, at)] += block.swapaxes(1, 2).reshape(12, 12)
    assert held.toarray() == pytest.approx(pushed[inner], abs=1e-14)
    assert held.nnz == met[inner].sum() > matrix.nnz
    again = assembly.matrix(
        blocks, Touch(soon, np.empty((9, 4, 3)), np.zeros((9, 4, 4, 3, 3)), soon)
    )
    assert again.toarray() == pytest.approx(dense[inner], abs=1e-14)
    assert np.array_equal(again.indices, held.indices)
