"""The energy along the folding path, against closed forms, laws and other formulations."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from energy_problems import (
    APEX,
    HEIGHT,
    SIDES,
    SURFACES,
    TWIST,
    kresling,
    kresling_other_state,
    kresling_strains,
    nearly_foldable,
    part,
)
from matplotlib.figure import Figure
from piece_problems import two_pieces
from problems import CELL, fitted, regular
from scipy.optimize import minimize_scalar

from miurafab.errors import InputError, PatternError
from miurafab.geometry.angles import sector_angles
from miurafab.geometry.quads import QuadGrid
from miurafab.origami.energy.bar_hinge import Paper, flat_model, sheet_model
from miurafab.origami.energy.continuation import follow
from miurafab.origami.energy.curve import energy_curve
from miurafab.origami.energy.driven import Driven
from miurafab.origami.energy.equilibrium import EquilibriumState, solve
from miurafab.origami.energy.hinges import hinge_angles, hinge_derivatives, hinge_gradients
from miurafab.origami.energy.path import (
    NEARLY_FLAT,
    folding_path,
    pulled_path,
)
from miurafab.origami.energy.pieces import PieceEnergies
from miurafab.origami.energy.plot import draw_pieces
from miurafab.origami.energy.ramp import REACH, nearing


def angles_along(path):
    """(n, C) the fold angles of all creases in each state of a path."""
    model = path.model
    return np.array([hinge_angles(x / model.unit_mm, model.creases) for x in path.coords])


def middle_crease(model, away=0):
    """A crease of the sheet, the ``away``-th nearest to its middle."""
    middle = model.points[model.creases[:, :2]].mean(axis=1) - model.points.mean(axis=0)
    order = np.argsort(np.linalg.norm(middle, axis=1), kind="stable")
    return int(model.creases_edges[order[away]])


# the regular Miura-ori: everything is known


@pytest.mark.parametrize(
    ("columns", "rows"), [(9, 7), (21, 21), pytest.param(61, 61, marks=pytest.mark.large)]
)
def test_a_miura_ori_folds_without_energy(columns, rows):
    pattern = regular(columns, rows)
    for until in (NEARLY_FLAT, math.radians(170)):
        path = folding_path(pattern, 10, until=until)
        assert path.converged
        assert path.energies.max() <= 1e-15
        assert np.abs(path.loads).max() <= 1e-9
    curve = energy_curve(pattern, 10)
    assert curve.rigid
    assert not curve.bistable
    assert (curve.barrier, curve.barrier_angle, curve.stable) == (0.0, None, ())
    assert abs(curve.stiffness) <= 1e-8


def test_the_two_creases_of_a_miura_ori_turn_together():
    """tan(straight / 2) = cos(alpha) tan(zigzag / 2) in every state, down to nearly flat."""
    path = folding_path(regular(), 20)
    along_rows = path.model.creases_edges < 8 * 7
    half = np.tan(np.abs(angles_along(path)) / 2)
    zigzag, straight = half[:, along_rows], half[:, ~along_rows]
    assert np.ptp(zigzag, axis=1).max() <= 1e-9
    assert straight == pytest.approx(math.cos(CELL.alpha) * zigzag[:, :1].repeat(42, 1), abs=1e-9)


@pytest.mark.parametrize("degrees", [20, 60, 80, 120])
def test_poisson_ratio_of_a_miura_ori(degrees):
    """nu = -cot^2(alpha) / cos^2(gamma), the zig-zag creases folded by 2 gamma."""
    pattern = regular()
    model = sheet_model(pattern)
    driven = Driven(model, model.creases[np.flatnonzero(model.creases_edges < 8 * 7)[0]])
    start = driven.value(driven.rest.points)
    goal = math.copysign(math.radians(degrees), start)
    drives = np.concatenate([np.linspace(start, goal, 9)[:-1], goal + np.array([-1, 0, 1]) * 1e-3])
    coords = np.array([s.points for s in follow(driven, driven.rest, drives)[-3:]])
    grid = coords.reshape(3, 7, 9, 3)
    along = np.linalg.norm(grid[:, 2, 6] - grid[:, 2, 2], axis=1)
    across = np.linalg.norm(grid[:, 6, 4] - grid[:, 2, 4], axis=1)
    measured = -math.log(along[2] / along[0]) / math.log(across[2] / across[0])
    gamma = math.radians(degrees) / 2
    wanted = -1 / (math.tan(CELL.alpha) * math.cos(gamma)) ** 2
    assert measured == pytest.approx(wanted, rel=1e-5)


def test_elastic_creases_store_what_the_closed_form_says():
    """On its rigid path a Miura-ori with elastic creases has E = sum 1/2 k_c l (rho - rho_0)^2."""
    pattern = regular(5, 5)
    model = sheet_model(pattern, crease_ratio=0.3)
    path = folding_path(pattern, 8, model=model)
    angles = angles_along(folding_path(pattern, 8))
    ends = model.points[model.creases[:, :2]]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    # bending facets save energy, unless they are very stiff
    rigid = 0.5 * 0.3 * (lengths * (angles - angles[0]) ** 2).sum(axis=1)
    assert path.energies[0] <= 1e-20
    assert (path.energies <= rigid + 1e-12).all()
    facets = np.arange(len(model.hinges)) < len(model.hinges) - len(model.creases)
    stiff = replace(model, stiffness=np.where(facets, 1e4, 1) * model.stiffness)
    path = folding_path(pattern, 8, model=stiff)
    assert path.energies[1:] == pytest.approx(rigid[1:], rel=1e-3)


# laws that hold for every sheet


def test_torque_is_the_slope_of_the_energy():
    """The trapezoid rule on the torque misses the energy by O(h^2): a quarter at half the step."""
    pattern = nearly_foldable("hypar", None)
    misses = []
    for steps in (40, 80, 160):
        path = folding_path(pattern, steps)
        work = np.sum((path.loads[1:] + path.loads[:-1]) / 2 * np.diff(path.drives))
        misses.append(abs(work - path.energies[-1]) / path.energies.max())
    assert misses[0] <= 2.5e-2
    assert misses[2] <= 2e-3
    assert misses[0] / misses[1] == pytest.approx(4, rel=0.1)
    assert misses[1] / misses[2] == pytest.approx(4, rel=0.1)


def test_one_step_solves_the_saddle_system():
    """The residual falls by itself along the Newton step: dF.step = -F, by finite differences."""
    model = sheet_model(nearly_foldable("hypar", None), crease_ratio=0.1)
    random = np.random.default_rng(3)
    for stencil in (model.creases[40], np.array([3, 90])):
        driven = Driven(model, stencil)
        rest = driven.rest
        state = EquilibriumState(
            rest.points + random.normal(scale=1e-3, size=rest.points.shape),
            random.normal(scale=1e-2, size=rest.forces.shape),
            0.02,
        )
        target = driven.value(rest.points) - 0.01
        residual = driven.residual(state, target)
        step = driven.step(driven.factor(state, target), residual)
        h = 1e-5
        there = driven.residual(state.plus(step, h), target)
        back = driven.residual(state.plus(step, -h), target)
        for ahead, behind, here in zip(there, back, residual, strict=True):
            slope = (ahead - behind) / (2 * h)
            assert np.abs(slope + here).max() <= 1e-5 * driven.size(residual)


def test_states_are_in_equilibrium_and_inextensible():
    path = folding_path(nearly_foldable("sphere", None), 20)
    model = path.model
    for x in path.coords:
        assert np.abs(model.strains(x / model.unit_mm)).max() <= 1e-11
    assert path.coords[0] == pytest.approx(model.points * model.unit_mm, abs=1e-9)


def test_stiffness_is_the_curvature_of_the_energy():
    pattern = nearly_foldable("saddle", None)
    curve = energy_curve(pattern, 20)
    fine = folding_path(pattern, 4, until=abs(curve.path.drives[0]) - 0.004)
    h = fine.drives[1] - fine.drives[0]
    # E = k h^2 / 2 + O(h^3): take the cubic term out with twice the step
    once, twice = fine.energies[1] * 2 / h**2, fine.energies[2] * 2 / (2 * h) ** 2
    assert curve.stiffness == pytest.approx(2 * once - twice, rel=1e-4)


# other formulations of the same problem


def penalty_energy(model, penalty, points):
    """E + penalty / 2 |c|^2 at ``points``, with dense gradient (3V,) and Hessian, term by term."""
    count = 3 * len(points)
    angle, gradient, hessian = hinge_derivatives(points, model.hinges)
    energy, slope, curvature = 0.0, np.zeros(count), np.zeros((count, count))
    for h, hinge in enumerate(model.hinges):
        place = (hinge[:, None] * 3 + np.arange(3)).ravel()
        g, k = gradient[h].ravel(), model.stiffness[h]
        energy += 0.5 * k * angle[h] ** 2
        slope[place] += k * angle[h] * g
        curvature[np.ix_(place, place)] += k * (
            np.outer(g, g) + angle[h] * hessian[h].reshape(12, 12)
        )
    for (first, second), length in zip(model.bars, model.lengths, strict=True):
        d = points[second] - points[first]
        c = (d @ d - length**2) / (2 * length)
        place = np.concatenate([first * 3 + np.arange(3), second * 3 + np.arange(3)])
        g = np.concatenate([-d, d]) / length
        energy += 0.5 * penalty * c**2
        slope[place] += penalty * c * g
        eye = np.kron(np.array([[1, -1], [-1, 1]]), np.eye(3)) / length
        curvature[np.ix_(place, place)] += penalty * (np.outer(g, g) + c * eye)
    return energy, slope, curvature


def minimum_by_penalty(model, penalty, stencil, drive, points):
    """The least penalty energy with the fold angle at ``stencil`` held at ``drive``: a dense Newton
    iteration with one multiplier, rigid motions left to the pseudo-inverse.
    """
    place = (stencil[:, None] * 3 + np.arange(3)).ravel()
    mu, count = 0.0, points.size
    for _ in range(60):
        energy, slope, curvature = penalty_energy(model, penalty, points)
        angle, gradient, hessian = hinge_derivatives(points, stencil[None])
        g = np.zeros(count)
        g[place] = gradient[0].ravel()
        force, miss = slope + mu * g, angle[0] - drive
        if max(np.abs(force).max(), abs(miss)) <= 1e-9:
            return energy, points
        curvature[np.ix_(place, place)] += mu * hessian[0].reshape(12, 12)
        system = np.block([[curvature, g[:, None]], [g[None], np.zeros((1, 1))]])
        step = np.linalg.lstsq(system, -np.append(force, miss), rcond=1e-13)[0]
        points = points + step[:-1].reshape(-1, 3)
        mu += step[-1]
    raise AssertionError("the penalty formulation did not converge")


def test_the_penalty_formulation_gives_the_same_energy():
    """Springs of 1e6 by a dense minimisation, and bars of compliance 1e-6 by the mixed one."""
    pattern = part(nearly_foldable("hypar", None), 5, 5, (1, 1))
    model = sheet_model(pattern)
    soft = replace(model, compliance=np.full(len(model.bars), 1e-6))
    path = folding_path(pattern, 24, model=soft)
    curve = energy_curve(pattern, 24, model=soft)
    stencil = model.creases[list(model.creases_edges).index(curve.crease)]
    highest = int(path.energies.argmax())
    points = model.points
    for state in range(highest + 1):
        energy, points = minimum_by_penalty(model, 1e6, stencil, path.drives[state], points)
        assert energy == pytest.approx(path.energies[state], rel=1e-6, abs=1e-15)
    assert path.energies[highest] > 1e-10
    stiff = folding_path(pattern, 24).energies[highest]
    assert stiff == pytest.approx(energy, rel=1e-2)
    assert stiff > energy


# where the barrier does not depend on how it is reached


def nearly_flat(pattern, model, place):
    """The flat sheet raised a little: heights w whose linear fold angles are closest to a small
    fraction of those of the folded form, the facets kept flat.
    """
    flat = np.column_stack([pattern.vertices_coords, np.zeros(len(pattern.vertices_coords))])
    flat /= model.unit_mm
    wanted = hinge_angles(model.points, model.creases)
    small = NEARLY_FLAT / abs(wanted[place])
    rows, targets = [], []
    for hinges, angles, weight in ((model.creases, wanted * small, 1.0), (model.hinges, 0.0, 1e2)):
        gradient = hinge_gradients(flat, hinges)[1][:, :, 2]
        row = np.zeros((len(hinges), len(flat)))
        np.put_along_axis(row, hinges, gradient, axis=1)
        rows.append(weight * row)
        targets.append(weight * np.broadcast_to(angles, len(hinges)))
    heights = np.linalg.lstsq(np.concatenate(rows), np.concatenate(targets), rcond=1e-12)[0]
    flat[:, 2] = heights
    return flat


def test_the_barrier_is_the_same_from_flat():
    pattern = nearly_foldable("hypar", None)
    forth = energy_curve(pattern, 40)
    model = forth.path.model
    place = list(model.creases_edges).index(forth.crease)
    driven = Driven(model, model.creases[place])
    drives = forth.path.drives[::-1]
    raised = EquilibriumState(
        nearly_flat(pattern, model, place) @ driven.axes, np.zeros(len(model.bars)), 0.0
    )
    states = follow(driven, raised, drives)
    assert len(states) == len(drives)
    energies = np.array([model.energy(state.points) for state in states])
    assert energies == pytest.approx(forth.path.energies[::-1], rel=1e-6, abs=1e-15)
    assert energies.max() == pytest.approx(forth.path.energies.max(), rel=1e-9)
    # the last state is the folded form, found from the flat side
    lengths = np.linalg.norm(states[-1].points[:, None] - states[-1].points[None], axis=2)
    wanted = np.linalg.norm(model.points[:, None] - model.points[None], axis=2)
    assert lengths == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("name", ["hypar", "saddle", "sphere"])
def test_the_barrier_does_not_depend_on_the_driven_crease(name):
    pattern = nearly_foldable(name, None)
    model = sheet_model(pattern)
    curves = [energy_curve(pattern, 30, crease=middle_crease(model, away)) for away in (0, 7, 30)]
    assert len({curve.crease for curve in curves}) == 3
    assert all(curve.bistable for curve in curves)
    barriers = [curve.barrier for curve in curves]
    assert barriers[1:] == pytest.approx(barriers[:1] * 2, rel=1e-8)


# linkages with known answers


def test_a_kresling_cell_is_bistable_as_in_closed_form():
    compliance = 1e-3
    model = kresling(compliance)
    tips = np.array([2 * SIDES, 2 * SIDES + 1])
    driven = Driven(model, tips)
    other, other_twist = kresling_other_state()

    def closed_form(height):
        def of_twist(twist):
            return SIDES / (2 * compliance) * sum(c**2 for c in kresling_strains(height, twist))

        bounds = (TWIST - 0.2, other_twist + 0.2)
        return minimize_scalar(of_twist, bounds=bounds, options={"xatol": 1e-10}).fun

    heights = np.linspace(HEIGHT, other, 31)
    states = follow(driven, driven.rest, heights + 2 * APEX)
    energies = np.array([model.energy(state.points) for state in states])
    assert energies == pytest.approx([closed_form(h) for h in heights], rel=1e-9, abs=1e-12)
    assert energies[0] == pytest.approx(0, abs=1e-20)
    assert energies[-1] == pytest.approx(0, abs=1e-20)
    # two states without load and one barrier between them
    loads = np.array([-state.mu for state in states])
    assert loads[[0, -1]] == pytest.approx(0, abs=1e-6)
    assert (np.diff(np.sign(loads[1:-1])) != 0).sum() == 1
    assert energies.max() > 19


@pytest.mark.parametrize(("columns", "ratio"), [(4, 0.0), (5, 1e-4)])
def test_the_barrier_does_not_depend_on_the_number_of_steps(columns, ratio):
    """In few long steps the sheet is over its barrier after the first, at 99 of 131 degrees; where
    there is none, it jumps to another shape in the last.
    """
    pattern = nearly_foldable("hypar", None, columns)
    model = sheet_model(pattern, crease_ratio=ratio)
    finely = energy_curve(pattern, 40, model=model)
    assert finely.bistable == (ratio == 0)
    for steps in (1, 2, 3, 5, 23):
        found = energy_curve(pattern, steps, model=model)
        assert len(found.stable) == len(finely.stable)
        assert found.barrier == pytest.approx(finely.barrier, rel=1e-6)
        drives = np.linspace(finely.path.drives[0], finely.path.drives[-1], steps + 1)
        np.testing.assert_allclose(found.path.drives, drives, rtol=1e-12)
        assert len(found.path.coords) == steps + 1
        assert found.path.loads[-1] == pytest.approx(finely.path.loads[-1], rel=1e-6)


def test_a_single_vertex_of_degree_four_is_a_spherical_linkage():
    """Four rigid sectors: no energy, and the crease opposite follows by spherical cosines,
    cos a0 cos a3 - sin a0 sin a3 cos rho0 = cos a1 cos a2 - sin a1 sin a2 cos rho2.
    """
    pattern = part(nearly_foldable("hypar", None), 3, 3, (1, 1))
    grid = QuadGrid(3, 3)
    a = sector_angles(pattern.folded_coords, grid.interior_vertices, grid.interior_neighbours)[0]
    assert abs(a[0] + a[2] - math.pi) > 4e-3
    path = folding_path(pattern, 30)
    assert path.converged
    assert path.energies.max() <= 1e-15
    ring = [tuple(sorted((4, int(v)))) for v in grid.interior_neighbours[0]]
    ends = [tuple(sorted(pair)) for pair in path.model.creases[:, :2].tolist()]
    cosine = np.cos(angles_along(path)[:, [ends.index(pair) for pair in ring]])
    across = math.cos(a[0]) * math.cos(a[3]) - math.sin(a[0]) * math.sin(a[3]) * cosine[:, 0]
    beyond = math.cos(a[1]) * math.cos(a[2]) - math.sin(a[1]) * math.sin(a[2]) * cosine[:, 2]
    assert across == pytest.approx(beyond, abs=1e-9)


# the finding: flat-foldability decides


@pytest.mark.parametrize("name", SURFACES)
def test_the_barrier_falls_with_the_flat_foldability_residual(name):
    curves = [
        energy_curve(nearly_foldable(name, worst), 20) for worst in (None, 4e-3, 1e-3, 1e-4, 0.0)
    ]
    barriers = [curve.barrier for curve in curves]
    assert all(curve.path.converged for curve in curves)
    assert all(high > low for high, low in itertools.pairwise(barriers))
    assert all(curve.bistable for curve in curves[:-1])
    assert curves[-1].rigid
    assert (
        curves[-1].path.energies.max()
        <= 1e-9 * energy_curve(nearly_foldable("hypar", None), 24).barrier
    )


def test_exact_fits_fold_rigidly():
    worst = energy_curve(fitted("hypar").pattern, 24).barrier
    exact = energy_curve(fitted("hypar", flat_foldable=0.0).pattern, 24)
    assert exact.rigid
    assert exact.path.energies.max() <= 1e-12 * worst


def test_the_sheet_with_the_larger_residual_pulls_harder():
    """Opposite corners drawn apart to a strain of 0.2; the work of the force is the energy."""
    loads = []
    for worst in (None, 1.6e-2):
        pattern = nearly_foldable("hypar", worst)
        model = sheet_model(pattern)
        path = pulled_path(model, (0, len(model.points) - 1), 0.2, 60)
        assert path.converged
        assert path.drives[-1] == pytest.approx(1.2 * path.drives[0])
        ends = path.coords[:, -1] - path.coords[:, 0]
        assert np.linalg.norm(ends, axis=1) == pytest.approx(path.drives, rel=1e-10)
        step = np.diff(path.drives) / model.unit_mm
        work = np.concatenate([[0.0], np.cumsum((path.loads[1:] + path.loads[:-1]) / 2 * step)])
        assert work == pytest.approx(path.energies, abs=2e-3 * path.energies.max())
        loads.append(path.loads)
    assert (loads[0][1:] > loads[1][1:]).all()


# units and what is refused


def test_joules_grow_with_the_modulus_and_the_thickness():
    """K = 0.55 D (l / t)^(1/3), so every energy is proportional to E t^(8/3)."""
    pattern = nearly_foldable("hypar", None)
    reports = [
        energy_curve(pattern, 12, model=sheet_model(pattern, paper=Paper(t, modulus))).report()
        for t, modulus in ((0.3, 3e9), (0.3, 6e9), (0.6, 3e9))
    ]
    assert all(report["energy_unit"] == "J" for report in reports)
    for key in ("barrier", "stiffness", "highest_energy"):
        base = reports[0][key]
        assert reports[1][key] == pytest.approx(2 * base, rel=1e-9)
        assert reports[2][key] == pytest.approx(2 ** (8 / 3) * base, rel=1e-9)
    # one hinge by hand: 0.55 E t^3 / 12 / (1 - nu^2) (l / t)^(1/3)
    model = sheet_model(pattern, paper=Paper(0.3, 3e9))
    u, v = model.points[model.hinges[0, :2]] * model.unit_mm
    length = np.linalg.norm(v - u)
    by_hand = 0.55 * 3e9 * (0.3e-3) ** 3 / 12 / (1 - 0.3**2) * (length / 0.3) ** (1 / 3)
    assert model.stiffness[0] * model.unit_joule == pytest.approx(by_hand, rel=1e-12)


def test_facets_bend_on_the_shorter_diagonal():
    pattern = fitted("sphere").pattern
    model = sheet_model(pattern)
    faces = pattern.faces_vertices
    p = model.points[faces]
    both = np.linalg.norm([p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]], axis=2)
    ends = model.points[model.hinges[:, :2]]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) == pytest.approx(both.min(axis=0))
    assert hinge_angles(model.points, model.hinges) == pytest.approx(0, abs=1e-9)
    signed = pattern.edges_fold_angle[model.creases_edges]
    assert hinge_angles(model.points, model.creases) == pytest.approx(signed, abs=1e-9)


def test_a_quad_that_is_not_convex_bends_on_its_inner_diagonal():
    points = np.array([[0, 0], [4, 0], [1, 1], [0, 4], [-4, 0.0]])
    folded = np.column_stack([points, np.where(points[:, 0] < 0, 1.0, 0.0)])
    pattern = replace(
        part(nearly_foldable("hypar", None), 3, 3, (1, 1)),
        vertices_coords=points,
        folded_coords=folded,
        edges_vertices=np.array([[0, 1], [1, 2], [2, 3], [3, 0], [3, 4], [4, 0]]),
        edges_assignment=np.array(["B", "B", "B", "V", "B", "B"]),
        edges_fold_angle=np.array([0, 0, 0, 1, 0, 0.0]),
        faces_vertices=np.array([[0, 1, 2, 3], [0, 3, 4, -1]]),
        grid=None,
    )
    model = sheet_model(pattern)
    assert model.hinges[:, :2].tolist() == [[0, 2]]
    assert model.creases.tolist() == [[3, 0, 4, 2]] or model.creases[0, 2:].tolist() == [2, 4]


def test_edges_assigned_flat_bend_like_facets():
    pattern = regular(5, 5)
    assignment = pattern.edges_assignment.copy()
    inner = np.flatnonzero(assignment != "B")
    assignment[inner[0]] = "F"
    model = sheet_model(replace(pattern, edges_assignment=assignment))
    assert inner[0] not in model.creases_edges
    assert len(model.hinges) == len(pattern.faces_vertices) + 1


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"folded_coords": None}, "no folded form"),
        ({"edges_assignment": np.full(12, "F")}, "no crease between two facets"),
    ],
)
def test_patterns_without_an_energy_are_refused(change, sentence):
    pattern = replace(regular(3, 3), **change)
    with pytest.raises(PatternError, match=sentence):
        energy_curve(pattern)


def test_creases_that_are_not_folded_cannot_be_driven():
    pattern = regular(3, 3)
    flat = replace(pattern, folded_coords=np.pad(pattern.vertices_coords, ((0, 0), (0, 1))))
    with pytest.raises(InputError, match="is folded by only 0 degrees, too little to drive"):
        folding_path(flat)


def test_what_has_no_flat_model_is_refused():
    with pytest.raises(PatternError, match="has 2 pieces; fold one of them"):
        flat_model(two_pieces())
    with pytest.raises(PatternError, match="no mountain or valley between two facets"):
        flat_model(replace(regular(3, 3), edges_assignment=np.full(12, "F")))


def curve_of(pattern):
    return energy_curve(pattern, 12)


def test_the_verdicts_of_curves_and_of_pieces():
    rigid, snap = curve_of(regular(5, 5)), curve_of(nearly_foldable("hypar", None))
    lost = replace(snap, path=replace(snap.path, converged=False))
    soft = replace(snap, barrier=0.0, barrier_angle=None, stable=snap.stable[:1])
    assert rigid.verdict().startswith("It folds rigidly")
    assert snap.verdict().startswith("It is bistable")
    assert soft.verdict() == "It is not bistable: there is no barrier on the way to flat."
    end = math.degrees(abs(snap.path.drives[-1]))
    assert lost.verdict().startswith(f"The path was lost at {end:.1f} degrees")
    for curves, words in (
        ((rigid, None, rigid), "All pieces fold rigidly: no energy is stored on the way to flat."),
        ((snap, soft, None), "1 of 3 pieces is bistable."),
        ((snap, lost), f"Piece 1: {lost.verdict()}"),
    ):
        both = PieceEnergies(curves, (4,) * len(curves))
        assert both.verdict() == words
        assert repr(both) == f"<PieceEnergies {len(curves)} pieces, {words}>"


@pytest.mark.parametrize("rigid", [True, False])
def test_the_plot_of_pieces_marks_each_barrier(rigid):
    soft = curve_of(regular(5, 5))
    axes = Figure().add_subplot()
    if rigid:
        draw_pieces([(0, soft), (2, soft)], axes, "two")
        assert axes.get_title() == "two: all pieces fold rigidly, without energy"
        assert axes.get_ylim() == (-1, 1)
        assert len(axes.lines) == 2
    else:
        snap = curve_of(nearly_foldable("hypar", None))
        draw_pieces([(0, soft), (1, snap)], axes, "two")
        (marker,) = (line for line in axes.lines if line.get_marker() == "^")
        assert marker.get_ydata() == [snap.barrier]
        assert [text.get_text() for text in axes.get_legend().texts] == ["piece 0", "piece 1"]


def test_degenerate_patterns_are_refused_by_name():
    pattern = regular(3, 3)
    collapsed = pattern.folded_coords.copy()
    collapsed[1] = collapsed[0]
    with pytest.raises(PatternError, match="Edge 0 has no length"):
        sheet_model(replace(pattern, folded_coords=collapsed))
    thin = pattern.folded_coords.copy()
    thin[0] = 2 * thin[1] - thin[2]
    thin[1] = (thin[0] + thin[4]) / 2
    thin[3] = thin[0] + 0.25 * (thin[4] - thin[0])
    with pytest.raises(PatternError, match="no width"):
        sheet_model(replace(pattern, folded_coords=thin))


def test_creases_that_cannot_be_driven_are_refused():
    pattern = regular(5, 5)
    border = int(np.flatnonzero(pattern.edges_assignment == "B")[0])
    with pytest.raises(InputError, match=f"Edge {border} is not a crease"):
        folding_path(pattern, crease=border)
    with pytest.raises(InputError, match="'steps' is 0"):
        folding_path(pattern, 0)


def test_a_path_that_cannot_be_followed_is_a_result():
    """Two rigid facets cannot be pulled farther apart than they are long."""
    pattern = part(nearly_foldable("hypar", None), 3, 3, (1, 1))
    path = pulled_path(sheet_model(pattern), (0, 8), 5.0, 10)
    assert not path.converged
    assert 1 <= len(path.drives) < 11
    assert len(path.coords) == len(path.energies) == len(path.loads) == len(path.drives)


def test_a_shape_that_is_no_number_is_no_solution():
    model = sheet_model(regular(3, 3))
    driven = Driven(model, np.array([0, 8]))
    lost = driven.rest._replace(points=np.full_like(driven.rest.points, np.nan))
    with np.errstate(invalid="ignore"):
        assert not solve(driven, lost, 1.0).converged


def test_a_motion_that_turns_a_sheet_inside_out_comes_as_near_as_can_be():
    points = np.random.default_rng(1).normal(size=(20, 3))
    assert nearing(points, points + np.arange(3)) == pytest.approx(0.0, abs=1e-12)
    assert nearing(points, 0.9 * points) == pytest.approx(0.1 * REACH)
    assert nearing(points, -points) == np.inf


def test_failure_of_one_solve_is_a_result():
    model = sheet_model(regular(3, 3))
    driven = Driven(model, np.array([0, 8]))
    assert not solve(driven, driven.rest, 1e3).converged
