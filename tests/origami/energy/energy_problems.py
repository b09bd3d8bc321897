"""Sheets and linkages whose folding energy is known, or known to be ordered."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import BarHingeModel
from miurafab.origami.fitting.constraints import OrigamiConstraints
from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.origami.tessellation import Tessellation
from miurafab.origami.unfold import unfold
from miurafab.surfaces.catalogue import make_surface

SURFACES = {
    "hypar": {},
    "saddle": {},
    "paraboloid": {},
    "bump": {},
    "sphere": {"width": "1rad", "height": "1rad"},
}
"""Doubly curved targets whose fits are flat-foldable to 8e-3 ... 3e-1 radians."""


@cache
def developable(name: str, facets: int) -> CreasePattern:
    """One of ``SURFACES`` fitted, with nothing asked about flat-foldability."""
    surface, _ = make_surface(name, SURFACES[name])
    pattern = fit(FitRequest(surface=surface, facets=(facets, facets), size_mm=200.0)).pattern
    assert pattern is not None
    return pattern


@cache
def nearly_foldable(name: str, worst: float | None, facets: int = 10) -> CreasePattern:
    """One of ``SURFACES`` fitted, and its Kawasaki residuals all scaled so that the largest is
    ``worst`` radians; None leaves them as they are.
    """
    pattern = developable(name, facets)
    if worst is None:
        return pattern
    columns, rows = pattern.grid
    sheet = Tessellation(pattern.folded_coords.reshape(rows, columns, 3))
    length = float(sheet.edge_lengths.mean())
    exact = OrigamiConstraints(sheet.grid, length, flat_foldable=True)
    x = sheet.vertices.ravel()
    inner = (columns - 2) * (rows - 2)
    residuals = exact(x)[0][-inner:]
    kept = residuals * worst / np.abs(residuals).max()

    for _ in range(30):
        c, jacobian = exact(x)
        c[-inner:] -= kept
        if np.abs(c).max() <= 1e-13:
            return unfold(Tessellation(x.reshape(rows, columns, 3)))
        gram = (jacobian @ jacobian.T).toarray()
        step = jacobian.T @ np.linalg.solve(gram + 1e-13 * np.eye(len(c)), c)
        x = x - step * min(1.0, 0.25 * length / np.abs(step).max())
    raise AssertionError(f"no {name} with residuals up to {worst} was found")


def part(pattern: CreasePattern, columns: int, rows: int, first: tuple[int, int]) -> CreasePattern:
    """``columns`` x ``rows`` vertices of a grid, from the vertex ``first`` (column, row) on."""
    all_columns, all_rows = pattern.grid
    points = pattern.folded_coords.reshape(all_rows, all_columns, 3)
    i, j = first
    return unfold(Tessellation(points[j : j + rows, i : i + columns]))


SIDES, RADIUS, HEIGHT, TWIST = 6, 1.0, 1.8, math.radians(20)
APEX = 1.0
"""How far the tips of the two stiff caps stand off."""


def kresling_strains(height, twist):
    """The strains (|d|^2 - L^2) / (2 L) of the two kinds of crease of a Kresling cell, and L."""
    step = 2 * math.pi / SIDES
    first = [
        (math.sqrt(HEIGHT**2 + 2 * RADIUS**2 * (1 - math.cos(TWIST + k * step))), k * step)
        for k in (0, 1)
    ]
    return [
        (height**2 + 2 * RADIUS**2 * (1 - np.cos(twist + more)) - length**2) / (2 * length)
        for length, more in first
    ]


def kresling_other_state() -> tuple[float, float]:
    """The height and twist of the second state in which every crease has its length.

    a^2 - b^2 is 2 R^2 (cos(twist + step) - cos(twist)), so the twists add up to pi - step.
    """
    twist = math.pi - 2 * math.pi / SIDES - TWIST
    length = HEIGHT**2 + 2 * RADIUS**2 * (1 - math.cos(TWIST))
    return math.sqrt(length - 2 * RADIUS**2 * (1 - math.cos(twist))), twist


def kresling(compliance: float) -> BarHingeModel:
    """A Kresling cell between two rigid pyramids: only its 2 n creases stretch, nothing bends.

    Vertices: the lower ring, the upper ring, the lower tip, the upper tip.
    """
    at = np.arange(SIDES) * 2 * math.pi / SIDES
    lower = np.stack([np.cos(at), np.sin(at), 0 * at], axis=1) * RADIUS
    upper = np.stack([np.cos(at + TWIST), np.sin(at + TWIST), 0 * at], axis=1) * RADIUS
    upper[:, 2] = HEIGHT
    tips = np.array([[0, 0, -APEX], [0, 0, HEIGHT + APEX]])
    points = np.concatenate([lower, upper, tips])
    ring = np.arange(SIDES)
    after = (ring + 1) % SIDES
    rigid = []
    for base, tip in ((0, 2 * SIDES), (SIDES, 2 * SIDES + 1)):
        rigid += [*zip(base + ring, base + after, strict=True)]
        rigid += [(base + k, tip) for k in ring]
        rigid += [(base, base + k) for k in range(2, SIDES - 1)]
    soft = [*zip(ring, SIDES + ring, strict=True), *zip(ring, SIDES + after, strict=True)]
    bars = np.array(rigid + soft, dtype=np.int64)
    lengths = np.linalg.norm(points[bars[:, 1]] - points[bars[:, 0]], axis=1)
    tip = np.full(SIDES, 2 * SIDES)
    before = (ring - 1) % SIDES
    return BarHingeModel(
        points=points,
        bars=bars,
        lengths=lengths,
        compliance=np.repeat([0.0, compliance], [len(rigid), len(soft)]),
        hinges=np.stack([ring, tip, before, after], axis=1),
        stiffness=np.zeros(SIDES),
        rest=np.zeros(SIDES),
    )
