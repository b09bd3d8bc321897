"""The starts of a fit: a seed of the corrugation on the target, and the unknowns that it has.

A start is one choice of the direction of the rows, the stretches, the pieces and, on a mesh, the
place of the sheet. It is cheap: it holds the seed and the slide that the seed asks for, which says
beforehand whether a sheet will come of it. The starts of a request are put in the order in which
they are tried:

1. the slide asked for stays under ``GENTLE``, then under ``STEEP``, and only then above;
2. the whole target before a part of it;
3. the direction along which the normal turns less;
4. the stretches in their order.

A surface of revolution repeats itself, and only the part that repeats is solved: two rows of a
ring, or one gore. Any other body that goes round is solved as a whole, in gores.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.cylinder import cylinder_on
from miurafab.origami.fitting.nominal import Follow, Nominal, Rim, rim_of_domain, rim_of_repeated
from miurafab.origami.fitting.outlined import OutlinedLattice, angles_of
from miurafab.origami.fitting.reduction import Unknowns, about_z
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.seed import STEEPEST, Corrugation, seed
from miurafab.surfaces.analytic import GeneralizedCylinder, Revolution, revolution
from miurafab.surfaces.mesh import MeshSurface
from miurafab.surfaces.surface import Swapped, TargetSurface
from miurafab.surfaces.tube import TubeSurface

STRETCHES = ((1.3, 1.3), (1.6, 1.3), (1.15, 1.6), (1.3, 1.6), (2.0, 1.3))
"""The stretches along and across the rows. Strong curvature along the rows needs more stretch along
them; strong twist needs less along and more across.
"""
SHALLOW = (1.05, 1.17)
"""The stretches tried first where the distance of the whole sheet has a limit: a corrugation of
0.6 by 0.6, just high enough for folds of 60 degrees."""
GENTLE = math.radians(50)
STEEP = math.radians(66)
"""A slide under ``GENTLE`` gave a clean sheet on every target that was tried, one over ``STEEP`` on
few."""
CLIP_OF_PIECES = math.radians(45)
"""The clip of the slide for several pieces: columns that two pieces share are means, and a steep
slide makes bow-ties of the facets beside them."""
LEAST_COLUMNS = 4
"""The least columns of facets in a gore of a body."""
ELSEWHERE = 2
"""How many of the stretches are tried at each other place of a mesh."""
SHAKE = 0.03
"""The standard deviation of the random moves of a coordinate, in mean edge lengths."""


@dataclass(frozen=True, eq=False)
class Start:
    """A seed ``x`` (n,) of the ``unknowns`` of a sheet on ``surface``.

    ``cells`` are the columns and rows of the lattice over the domain. ``steepest`` is the largest
    slide asked for, radians. ``way`` is ``sheet``, ``ring`` or ``gores``; ``place`` and ``layout``
    say where on a mesh the sheet lies, if not on the first placement.
    """

    way: str
    surface: TargetSurface
    rows_along: str
    corrugation: Corrugation
    cells: tuple[int, int]
    unknowns: Unknowns
    x: Floats
    steepest: float
    rim: Rim
    pieces: int = 1
    place: str = ""
    layout: dict[str, Any] = field(default_factory=dict)

    def describe(self) -> str:
        parts = [self.way, f"rows along {self.rows_along}"]
        if self.pieces > 1:
            parts.append(f"{self.pieces} pieces")
        return ", ".join([*parts, self.place] if self.place else parts)

    def shaken(self, number: int) -> Start:
        """The start with every coordinate moved a little at random, by the seed ``number``."""
        random = np.random.default_rng(number)
        moves = random.normal(scale=SHAKE * self.unknowns.length, size=self.x.shape)
        return replace(self, x=self.x + moves)

    @property
    def all_round(self) -> bool:
        """Whether the sheet goes all round an axis."""
        surface = self.surface
        return isinstance(surface, Revolution) and surface.closed

    @property
    def order(self) -> tuple[int, bool]:
        """How steep the slide is, in three classes, and whether it is a part of the target."""
        steep = 0 if self.steepest < GENTLE else 1 if self.steepest < STEEP else 2
        return steep, bool(self.place)


def starts_for(request: FitRequest, pieces: int) -> list[Start]:
    """The starts of ``request`` on its whole target with so many pieces, the likeliest first."""
    surface = request.surface
    level = LEVELS[request.follow]
    corrugations = corrugations_of(request)
    made: list[Start] = []
    if isinstance(surface, TubeSurface):
        made = [round_body(surface, request, c, pieces, level) for c in corrugations]
        return sorted(made, key=lambda start: start.order)
    if isinstance(surface, Revolution):
        made += [ring(surface, request, c, pieces, level) for c in corrugations]
        if pieces > 2:
            made = [gores(surface, request, c, pieces, -level) for c in corrugations]
        if surface.closed:
            return sorted(made, key=lambda start: start.order)
    made += outlines(request, corrugations, pieces, level) or _rectangles(request, surface, pieces)
    return sorted(made, key=lambda start: start.order)


def starts_elsewhere(request: FitRequest, pieces: int) -> list[Start]:
    """The starts on parts of a mesh, where the whole of it gives no clean sheet."""
    surface = request.surface
    if not isinstance(surface, MeshSurface):
        return []
    made = []
    if trims(request):
        place = "a rectangle of the mesh"
        made = [replace(start, place=place) for start in _rectangles(request, surface, pieces)]
    for place, laid in surface.alternatives():
        made += [
            replace(start, place=place, layout=laid.description)
            for start in _rectangles(request, laid, pieces, ELSEWHERE)
        ]
    return sorted(made, key=lambda start: start.order)


def _rectangles(
    request: FitRequest, surface: TargetSurface, pieces: int, most: int | None = None
) -> list[Start]:
    """Sheets over all of the domain, with the rows in both directions."""
    level = LEVELS[request.follow]
    return [
        sheet(turned, name, request, corrugation, pieces, level if name == "u" else -level)
        for turned, name in _oriented(surface)
        for corrugation in corrugations_of(request)[:most]
    ]


def trims(request: FitRequest) -> bool:
    """Whether the sheet takes the outline of a mesh for its border."""
    mesh = isinstance(request.surface, MeshSurface)
    return mesh and request.edge != "rectangle" and request.region is None


def outlines(
    request: FitRequest, corrugations: list[Corrugation], pieces: int, level: float
) -> list[Start]:
    """All of a mesh inside its outline at several angles, those of most and squarest cells first;
    none where that is not asked for, and where the outline crosses itself when the mesh lies flat.
    """
    surface = request.surface
    if not trims(request) or not isinstance(surface, MeshSurface) or surface.whole is None:
        return []
    cells = request.columns, request.rows
    clip = STEEPEST if pieces == 1 else CLIP_OF_PIECES
    made = []
    for angle, c in itertools.product(angles_of(request.rotate), corrugations):
        parts = piece_of_column(request, pieces)
        lattice = OutlinedLattice.of(surface.whole, angle, cells, c.zigzag, parts)
        charts, target, rim = lattice.charts, lattice.target, lattice.rim
        if len(np.unique(charts.pieces)) < pieces:
            continue
        grown = seed(target, charts, *cells, c, clip=clip, level=level)
        unknowns = Unknowns.all_of(charts, _mean_edge(charts, grown.vertices))
        x, steepest = grown.vertices.ravel(), grown.steepest
        layout = {"edge": request.edge}
        start = Start(
            "outline", target, "u", c, cells, unknowns, x, steepest, rim, pieces, layout=layout
        )
        made.append((lattice.cost, start))
    return [start for _, start in sorted(made, key=lambda pair: pair[0])]


LEVELS: dict[Follow, float] = {"middle": 0.0, "top": -0.5, "bottom": 0.5}
"""How far the seed is lifted off the target, in parts of the height of the corrugation."""


def direct(request: FitRequest) -> Iterator[Start]:
    """The closed forms on a generalized cylinder; their seed is exact."""
    surface = request.surface
    assert isinstance(surface, GeneralizedCylinder)
    cells = request.columns, request.rows
    charts = QuadCharts.of_cells(np.ones((cells[1], cells[0]), dtype=bool))
    rim = rim_of_domain(surface, charts, Nominal.of(surface, charts, *cells), cells)
    for c in corrugations_of(request):
        level = LEVELS[request.follow]
        made = cylinder_on(surface, cells[0] + 1, cells[1] + 1, c.amplitude, c.zigzag, level)
        unknowns = Unknowns.all_of(charts, float(made.edge_lengths.mean()))
        x = made.vertices.ravel()
        yield Start("direct", surface, "u", c, cells, unknowns, x, 0.0, rim)


def sheet(
    surface: TargetSurface,
    rows_along: str,
    request: FitRequest,
    corrugation: Corrugation,
    pieces: int,
    level: float,
) -> Start:
    """A sheet over the whole domain of ``surface``, cut into ``pieces`` along columns."""
    cells = request.columns, request.rows
    charts = QuadCharts.of_cells(
        np.ones((cells[1], cells[0]), dtype=bool), piece_of_column(request, pieces)
    )
    clip = STEEPEST if pieces == 1 else CLIP_OF_PIECES
    made = seed(surface, charts, *cells, corrugation, clip=clip, level=level)
    unknowns = Unknowns.all_of(charts, _mean_edge(charts, made.vertices))
    nominal = Nominal.of(surface, charts, *cells)
    rim = rim_of_domain(surface, charts, nominal, cells)
    x = made.vertices.ravel()
    return Start(
        "sheet", surface, rows_along, corrugation, cells, unknowns, x, made.steepest, rim, pieces
    )


def ring(
    surface: Revolution, request: FitRequest, corrugation: Corrugation, bands: int, level: float
) -> Start:
    """Rows along the profile, repeated about the axis, cut into ``bands`` along columns."""
    cells = columns, rows = request.columns, request.rows
    beta = surface.angle / rows
    bands_of_columns = piece_of_column(request, bands)
    one = QuadCharts.of_cells(np.ones((1, columns), dtype=bool), bands_of_columns)
    clip = STEEPEST if bands == 1 else CLIP_OF_PIECES
    sector = revolution(surface.profile, beta)
    made = seed(sector, one, columns, 1, corrugation, clip=clip, level=level)
    length = _mean_edge(one, made.vertices)
    unknowns = Unknowns.ring(bands_of_columns, rows, length, 2 * beta)
    nominal = Nominal.of(surface, unknowns.charts, *cells)
    rim = rim_of_domain(surface, unknowns.charts, nominal, cells, axes=(0,))
    if not surface.closed:
        rim = rim.with_also(
            rim_of_repeated(surface, unknowns.charts, nominal, cells, 1, (rows - 1) % 2)
        )
    x = (made.vertices @ about_z((beta - surface.angle) / 2).T).ravel()
    return Start("ring", surface, "u", corrugation, cells, unknowns, x, made.steepest, rim, bands)


def gores(
    surface: Revolution, request: FitRequest, corrugation: Corrugation, count: int, level: float
) -> Start:
    """Rows around the axis, and gores that meet along meridians. The columns of the request run
    along the profile, its rows around.
    """
    around, along = max(2, 2 * round(request.rows / count / 2)), request.columns
    turn = surface.angle / count
    one = QuadCharts.of_cells(np.ones((along, around), dtype=bool))
    sector = Swapped(revolution(surface.profile, turn))
    made = seed(sector, one, around, along, corrugation, level=level)
    length = _mean_edge(one, made.vertices)
    unknowns = Unknowns.gore(around, along, count, length, turn)
    points = made.vertices @ about_z((turn - surface.angle) / 2).T
    grid = points.reshape(along + 1, around + 1, 3)
    grid[:, 0] = (grid[:, 0] + grid[:, around] @ about_z(-turn).T) / 2
    cells = count * around, along
    swapped = Swapped(surface)
    nominal = Nominal.of(swapped, unknowns.charts, *cells)
    rim = rim_of_domain(swapped, unknowns.charts, nominal, cells, axes=(1,))
    if not surface.closed:
        rim = rim.with_also(
            rim_of_repeated(swapped, unknowns.charts, nominal, cells, 0, around - 1)
        )
    x = grid[:, :around].ravel()
    return Start("gores", swapped, "v", corrugation, cells, unknowns, x, made.steepest, rim, count)


def round_body(
    surface: TubeSurface, request: FitRequest, corrugation: Corrugation, count: int, level: float
) -> Start:
    """Rows round a tube or a closed body, and gores that meet along columns. The columns of the
    request run round it, at least four to a gore.
    """
    columns = count * max(LEAST_COLUMNS, 2 * round(request.columns / count / 2))
    cells = columns, request.rows
    charts = QuadCharts.of_cells(
        np.ones((request.rows, columns), dtype=bool),
        np.arange(columns, dtype=np.int64) * count // columns,
        closed=True,
    )
    made = seed(surface, charts, *cells, corrugation, clip=CLIP_OF_PIECES, level=level)
    unknowns = Unknowns.all_of(charts, _mean_edge(charts, made.vertices))
    nominal = Nominal.of(surface, charts, *cells)
    rim = rim_of_domain(surface, charts, nominal, cells, axes=(1,))
    x = made.vertices.ravel()
    return Start("gores", surface, "u", corrugation, cells, unknowns, x, made.steepest, rim, count)


def piece_of_column(request: FitRequest, pieces: int) -> Ints:
    """(columns,) the piece of each column: cut where asked, or into pieces of about equal width."""
    if request.cut_columns is not None:
        return np.searchsorted(request.cut_columns, np.arange(request.columns), side="right")
    return np.arange(request.columns, dtype=np.int64) * pieces // request.columns


def corrugations_of(request: FitRequest) -> list[Corrugation]:
    """The corrugations to try: those of ``STRETCHES``, with what the request fixes."""
    if request.amplitude is not None and request.zigzag is not None:
        return [Corrugation(request.amplitude, request.zigzag)]
    corrugations = []
    near = request.max_distance_mm is not None
    for along, across in (SHALLOW, *STRETCHES) if near else STRETCHES:
        usual = Corrugation.from_stretches(along, across)
        amplitude = usual.amplitude if request.amplitude is None else request.amplitude
        if request.zigzag is not None:
            corrugations.append(Corrugation(amplitude, request.zigzag))
        else:
            stretch = float(np.hypot(1.0, amplitude))
            corrugations.append(Corrugation.from_stretches(along, stretch))
    return list(dict.fromkeys(corrugations))


def _oriented(surface: TargetSurface) -> list[tuple[TargetSurface, str]]:
    """Both directions of the rows; first the direction along which the normal turns less."""
    both: list[tuple[TargetSurface, str]] = [(surface, "u"), (Swapped(surface), "v")]
    return sorted(both, key=lambda pair: _turning(pair[0]))


def _turning(surface: TargetSurface) -> float:
    """The mean angle through which the normal turns along the u-lines, radians."""
    normals = surface.normal(surface.domain.lattice(17, 9))
    cosine = np.einsum("ijk,ijk->ij", normals[:, 1:], normals[:, :-1])
    return float(np.arccos(np.clip(cosine, -1, 1)).sum(axis=1).mean())


def _mean_edge(charts: QuadCharts, points: Floats) -> float:
    return float(edge_lengths(points, charts.edges_vertices).mean())


__all__ = ["Start", "starts_for"]
