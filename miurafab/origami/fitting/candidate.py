"""A candidate: one exact sheet, measured and scored, with the faults that keep it from being the
answer.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from miurafab.findings import Finding, counted
from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.closeness import Closeness
from miurafab.origami.fitting.inequalities import limits
from miurafab.origami.fitting.nominal import Follow, Nominal
from miurafab.origami.fitting.outlined import with_border
from miurafab.origami.fitting.request import FitRequest
from miurafab.origami.fitting.result import Attempt
from miurafab.origami.fitting.score import GOOD, Score, score
from miurafab.origami.fitting.starts import Start
from miurafab.origami.invariants import DEGENERATE, EXACT, exactness
from miurafab.origami.judge_pattern import unlisted_seams
from miurafab.origami.unfold import unfold_charts
from miurafab.origami.verify import Measurements, measure, with_distances, with_nearness
from miurafab.surfaces.outline import WholeMesh
from miurafab.surfaces.surface import Swapped, TargetSurface

LIMIT_FAULTS = ("min-edge", "max-deviation", "max-distance", "facet-shape", "flat-foldable")
"""The faults that are limits of the user's. Every sheet for the target misses them likewise."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """An exact sheet on ``surface``. ``active_bounds`` counts the limits that hold it back."""

    attempt: Attempt
    surface: TargetSurface
    pattern: CreasePattern
    measurements: Measurements
    score: Score
    faults: tuple[Finding, ...]
    deviation_mm: float
    closeness: Closeness
    polished: bool = False
    active_bounds: Mapping[str, int] = field(default_factory=dict)

    def with_distances(self) -> Measurements:
        """The measurements with the distances to the target."""
        return with_distances(self.measurements, self.pattern, self.surface)

    @property
    def rank(self) -> tuple[int, int, float, float]:
        """Faults of the sheet itself, limits missed, how far those on distances are missed, then
        the score; less is better.
        """
        limits_missed = sum(fault.code in LIMIT_FAULTS for fault in self.faults)
        beyond = max(1.0, self.closeness.factor)
        return len(self.faults) - limits_missed, limits_missed, beyond, self.score.total

    @property
    def good(self) -> bool:
        """Whether the sheet meets everything asked and is as good as asked."""
        return not self.faults and self.score.total <= GOOD


def candidate(
    request: FitRequest, start: Start, x: Floats, iterations: int, polished: bool
) -> Candidate:
    """The sheet of the unknowns ``x``, measured against what ``request`` asks."""
    charts, points = start.unknowns.whole(x)
    pattern = unfold_charts(charts, points, target=request.target | start.layout)
    if isinstance(start.surface, WholeMesh):
        pattern = with_border(pattern, start.surface, charts, request)
    assert pattern.folded_coords is not None
    extent = float(np.ptp(pattern.folded_coords, axis=0).max())
    scale = 1.0 if request.side_mm is None else request.side_mm / extent
    pattern = pattern.scaled(scale)
    # the distances take long; while the search goes on only a limit on them needs them
    limited = request.max_distance_mm is not None
    measured = measure(pattern)
    if limited:
        measured = with_nearness(measured, pattern, unturned(start.surface))
    deviation = deviation_of(start, request.follow, charts, points)
    points_of_rim = start.unknowns.vertices(x)
    solved = start.unknowns.charts
    cells = Nominal.of(start.surface, solved, *start.cells).corners
    crowds = start.pieces > 1 or start.all_round
    marks = score(solved, points_of_rim, cells, start.rim, deviation, crowds)
    closeness = Closeness.of(request, measured, deviation * scale)
    faults = tuple(_faults(request, start, pattern, measured, closeness, scale, x, marks))
    residual = max(measured.max_planarity or 0.0, measured.max_developability or 0.0)
    attempt = Attempt(
        start.way,
        start.rows_along,
        start.corrugation,
        residual,
        iterations,
        " ".join(fault.sentence for fault in faults),
        start.place,
        start.pieces,
        start.steepest,
        marks.total,
    )
    surface = unturned(start.surface)
    return Candidate(
        attempt, surface, pattern, measured, marks, faults, deviation * scale, closeness, polished
    )


def unturned(surface: TargetSurface) -> TargetSurface:
    """The surface whose u and v ``surface`` exchanges, or itself."""
    return surface.surface if isinstance(surface, Swapped) else surface


def turned_follow(follow: Follow, rows_along: str) -> Follow:
    """With u and v swapped the normal turns round, and top and bottom change places."""
    turned: dict[Follow, Follow] = {"middle": "middle", "top": "bottom", "bottom": "top"}
    return follow if rows_along == "u" else turned[follow]


def deviation_of(start: Start, follow: Follow, charts: QuadCharts, points: Floats) -> float:
    """The largest distance from the target of the surface that follows it.

    Besides its points it is measured between neighbours and between each four points, so that a few
    points on the target do not count as a close sheet. The neighbours of a facet are those over
    creases, those of an upper or lower vertex lie along its row.
    """
    side = turned_follow(follow, start.rows_along)
    if side == "middle":
        middle = points[charts.faces_vertices].mean(axis=1)
        pairs = charts.neighbouring_facets
        samples = np.concatenate([middle, middle[pairs].mean(axis=1)])
    else:
        level = 1 if side == "top" else 0
        edges = charts.edges_vertices
        row = charts.lattice[:, 1]
        edges = edges[(row[edges] % 2 == level).all(axis=1)]
        chosen = points[row % 2 == level]
        samples = np.concatenate([chosen, points[edges].mean(axis=1)])
    closest = unturned(start.surface).closest_point(samples)
    return float(np.linalg.norm(samples - closest, axis=1).max())


def _faults(
    request: FitRequest,
    start: Start,
    pattern: CreasePattern,
    measured: Measurements,
    closeness: Closeness,
    scale: float,
    x: Floats,
    marks: Score,
) -> Iterator[Finding]:
    """The faults of this sheet, each with advice."""
    residual = max(
        measured.max_planarity or 0.0,
        measured.max_developability or 0.0,
        measured.max_isometry or 0.0,
    )
    if residual > exactness(pattern):
        sentence = f"A residual of {residual:.1e} is left; ask for fewer `facets`."
        yield Finding("residual", sentence)
    if measured.self_intersections:
        yield Finding(
            "self-intersection",
            counted(measured.self_intersections, "pair of facets passes", "pairs of facets pass")
            + " through each other; ask for more `facets` or `pieces`, lower `zigzag` or "
            "`amplitude`, or take a smaller part of the target.",
        )
    if measured.overlaps:
        pairs = counted(measured.overlaps, "pair of facets overlaps", "pairs of facets overlap")
        yield Finding("overlap", f"{pairs} in the flat pattern; lower `zigzag`.")
    if marks.bow_ties:
        yield Finding(
            "bow-tie",
            counted(
                marks.bow_ties, "facet is folded over itself", "facets are folded over themselves"
            )
            + "; ask for more `facets` or `pieces`.",
        )
    unlisted = len(unlisted_seams(pattern))
    if unlisted:
        yield Finding(
            "seam",
            counted(unlisted, "pair of border edges meets", "pairs of border edges meet")
            + " in the folded form without a seam; ask for other `facets` or `pieces`.",
        )
    mean = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    least = request.min_edge_mm or DEGENERATE * mean
    if measured.min_edge_mm < least:
        yield Finding(
            "min-edge",
            f"The shortest edge is {measured.min_edge_mm:.3g} mm, under the {least:.3g} mm asked "
            "for; ask for fewer `facets` or a larger `size`.",
        )
    yield from closeness.faults(request.follow)
    # the shortest edge and Kawasaki's residual are measured from the pattern
    asked = replace(request, min_edge_mm=None, flat_foldable=None)
    shape = limits(asked, start.unknowns, scale)
    if shape.any:
        broken = shape(start.unknowns.vertices(x).ravel())[0] < -1e-9
        for kind, number in shape.count(broken).items():
            if number:
                yield Finding(
                    "facet-shape",
                    f"{number} facet corners or sides break the {kind} limit; loosen it, or ask "
                    "for other `facets`, `amplitude` or `zigzag`.",
                )
    tolerance = request.flat_foldable
    if tolerance is not None and (measured.max_flat_foldability or 0.0) > max(tolerance, EXACT):
        reached = f"{measured.max_flat_foldability:.1e} rad"
        yield Finding("flat-foldable", f"The sheet is flat-foldable only to {reached}.")
