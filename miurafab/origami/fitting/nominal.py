"""Where a sheet belongs on its target: the places of its cells, its rim, and its nearest points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.quads import QuadCharts
from miurafab.surfaces.surface import TargetSurface, gauss_newton, tangents, unit

Follow = Literal["middle", "top", "bottom"]
"""What lies on the target: the means of the facets, or the vertices of the odd or even rows."""


@dataclass(frozen=True, eq=False)
class Rim:
    """The border that the facets ``facets`` (k,) are to reach: ``places`` (k, 3), and the unit
    directions ``outward`` (k, 3) across the border. ``overhang`` weighs a facet beyond its place
    against one that has retreated: 0 where the sheet is trimmed afterwards. ``sides`` (s, 2) are
    the ends of the sides on the border, none where the sheet is trimmed.
    """

    facets: Ints
    places: Floats
    outward: Floats
    overhang: float = 1.0
    sides: Ints = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))

    def with_also(self, other: Rim) -> Rim:
        """Both rims, with the overhang of this one."""
        return Rim(
            np.concatenate([self.facets, other.facets]),
            np.concatenate([self.places, other.places]),
            np.concatenate([self.outward, other.outward]),
            self.overhang,
            np.concatenate([self.sides, other.sides]),
        )


@dataclass(frozen=True, eq=False)
class Nominal:
    """Where the sheet belongs: ``corners`` (F, 4, 3) and ``centres`` (F, 3) of the cells on the
    target, and the parameters of the centres (F, 2).
    """

    corners: Floats
    centres: Floats
    parameters: Floats

    @classmethod
    def of(cls, surface: TargetSurface, charts: QuadCharts, columns: int, rows: int) -> Nominal:
        """The cells of ``charts`` in a lattice of ``columns`` x ``rows`` cells on ``surface``."""
        at, cells = surface.domain.at, (columns, rows)
        corner = charts.cells[:, None, :] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        centres = at(charts.cells + 0.5, cells)
        return cls(surface.point(at(corner, cells)), surface.point(centres), centres)


SIDES = ((0, -1, (0, 3)), (0, 1, (1, 2)), (1, -1, (0, 1)), (1, 1, (3, 2)))
"""The axis, the outward sign and the corners of the four sides of a cell."""


def rim_of_domain(
    surface: TargetSurface,
    charts: QuadCharts,
    nominal: Nominal,
    cells: tuple[int, int],
    axes: tuple[int, ...] = (0, 1),
) -> Rim:
    """The rim of the cells at the border of a lattice of ``cells`` columns and rows, across the
    parameters ``axes``. A side between two facets is no rim.
    """
    half = surface.domain.cell(cells) / 2
    facets, outward, sides = [], [], []
    for axis, sign, corners in SIDES:
        if axis not in axes:
            continue
        end = 0 if sign < 0 else cells[axis] - 1
        inside = charts.on_two_facets(charts.faces_vertices[:, corners])
        chosen = np.flatnonzero((charts.cells[:, axis] == end) & ~inside)
        step = sign * half * np.eye(2)[axis]
        uv = nominal.parameters[chosen]
        facets.append(chosen)
        sides.append(charts.faces_vertices[chosen][:, corners])
        outward.append(unit(surface.point(uv + step) - surface.point(uv - step)))
    together = np.concatenate(facets)
    places = nominal.centres[together]
    return Rim(together, places, np.concatenate(outward), sides=np.concatenate(sides))


def rim_of_repeated(
    surface: TargetSurface,
    charts: QuadCharts,
    nominal: Nominal,
    cells: tuple[int, int],
    axis: int,
    last: int,
) -> Rim:
    """The rim across the parameter ``axis`` of a lattice that repeats itself along it: the cells 0
    along it stand for the side where the parameter is least, and the cells ``last`` for the other.
    """
    step = surface.domain.cell(cells)[axis] / 2 * np.eye(2)[axis]
    place = charts.cells[:, axis]
    facets = np.flatnonzero((place == 0) | (place == last))
    uv = nominal.parameters[facets]
    first = place[facets, None] == 0
    outward = np.where(first, -1, 1) * unit(surface.point(uv + step) - surface.point(uv - step))
    corners = charts.faces_vertices[facets]
    below, above = (corners[:, SIDES[2 * axis + k][2]] for k in (0, 1))
    sides = np.where(first, below, above)
    return Rim(facets, nominal.centres[facets], outward, sides=sides)


def chains_of(charts: QuadCharts, corners: Floats) -> tuple[Ints, Floats]:
    """Three vertices at stride 2 along i or j inside one chart, (n, 3), and the second difference
    (n, 3) of their places on the target, ``corners`` (F, 4, 3).

    Each chain runs along the lower sides of four facets, and along the upper sides at the border.
    """
    chains, places = [], []
    for direction, (first, last) in enumerate((((0, 3), (1, 2)), ((0, 1), (3, 2)))):
        step, side = charts.next_facets(direction), charts.next_facets(1 - direction)
        for near, far, chosen in zip(
            first, last, (np.ones(len(step), dtype=bool), side < 0), strict=True
        ):
            run = [np.flatnonzero(chosen)]
            for _ in range(3):
                ahead = step[run[-1]]
                run = [facets[ahead >= 0] for facets in run] + [ahead[ahead >= 0]]
            start, _, middle, end = run
            ends = ((start, near), (middle, near), (end, far))
            chains.append(np.stack([charts.faces_vertices[f, c] for f, c in ends], axis=1))
            a, b, c = (corners[f, k] for f, k in ends)
            places.append(a - 2 * b + c)
    return np.concatenate(chains), np.concatenate(places)


def feet_of(surface: TargetSurface, points: Floats, start: Floats, steps: int = 2) -> Floats:
    """(n, 2) the parameters near ``start`` whose points are nearest to ``points`` (n, 3).

    Gauss-Newton steps on |S(u, v) - p|^2, each at most a twentieth of the domain.
    """
    d = surface.domain
    cap = np.array([d.width, d.height]) / 20
    uv = start
    for _ in range(steps):
        step = gauss_newton(*tangents(surface, uv), surface.point(uv) - points)[0]
        uv = uv + np.clip(step, -cap, cap)
    return uv
