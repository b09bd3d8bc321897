"""The strategies of a fit: direction of the rows, strength of the corrugation, start of the solver.

A strategy is one way from the target to an exact sheet: a start (a closed form, a seed on the
target, one period of a revolution, or continuation), the projection onto the constraints, then
flat-foldability if asked for, then polishing where a limit needs it. It ends in a candidate with
its faults, or, without an exact sheet, in a record of the attempt.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from miurafab.findings import Finding
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cylinder import cylinder_on
from miurafab.origami.fitting.closeness import Closeness
from miurafab.origami.fitting.constraints import flat_foldability
from miurafab.origami.fitting.continuation import COARSEST, STEP_CAP, bend, refine, shaken, solve
from miurafab.origami.fitting.inequalities import Bounds, limits
from miurafab.origami.fitting.polish import Follow, followers, polish
from miurafab.origami.fitting.reduction import Unknowns, about_z
from miurafab.origami.fitting.request import Attempt, FitRequest
from miurafab.origami.fitting.seed import Corrugation, seed
from miurafab.origami.fitting.solver import Projection, project
from miurafab.origami.tessellation import Tessellation
from miurafab.origami.unfold import unfold
from miurafab.origami.verify import DEGENERATE, EXACT, Measurements, measure
from miurafab.surfaces.analytic import GeneralizedCylinder, Revolution, revolution
from miurafab.surfaces.mesh import MeshSurface
from miurafab.surfaces.surface import Swapped, TargetSurface

STRETCHES = ((1.3, 1.3), (1.15, 1.6), (1.6, 1.3), (1.3, 1.6), (2.0, 1.3), (2.6, 1.3), (1.15, 2.0))
"""The stretches along and across the rows, in the order in which they are tried. Strong curvature
along the rows needs more stretch along them; strong twist needs less along and more across.
"""
MESH_BENDS = 3
SEEDS_ELSEWHERE = 4
BENDS_ELSEWHERE = 2
"""How many of the stretches are tried on meshes: bends on the first placement, seeds and bends on
the others. Enough to find most sheets, and few enough for an answer within a minute.
"""
FAR = 0.02
"""The search goes on while the mid-surface is farther from the target than this part of the
diagonal of the sheet."""
SCALINGS = 4
"""The most rounds of polishing, each at the scale that the last round left."""
BOUND_MARGIN = 2e-3
"""Polishing tightens the limits by this part, since the scale of the sheet still changes."""
KEPT_EDGE = 0.4
"""Polishing keeps every edge above this part of the shortest edge before it, unless `min_edge` is
given."""
LEVELS: Mapping[Follow, float] = {"middle": 0.0, "top": -0.5, "bottom": 0.5}
"""How far the seed is lifted off the target, in parts of the height of the corrugation."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """An exact sheet, measured, with the ``faults`` that keep it from being the answer."""

    attempt: Attempt
    pattern: CreasePattern
    measurements: Measurements
    faults: tuple[Finding, ...]
    deviation_mm: float
    polished: bool = False
    active_bounds: Mapping[str, int] = field(default_factory=dict)

    @property
    def settles(self) -> bool:
        """Whether the only faults of this sheet are limits. Other strategies for the same target
        will not meet them either.
        """
        m = self.measurements
        inexact = max(m.max_planarity or 0.0, m.max_developability or 0.0, m.max_isometry or 0.0)
        return not (m.self_intersections or m.overlaps or self.rank[1] or inexact > EXACT)

    @property
    def rank(self) -> tuple[int, bool]:
        """The number of faults, then whether the sheet is far from the target; less is better."""
        assert self.pattern.folded_coords is not None
        extent = np.ptp(self.pattern.folded_coords, axis=0)
        off = min(self.measurements.hausdorff_midsurface_mm or 0.0, self.deviation_mm)
        return len(self.faults), bool(off > FAR * np.linalg.norm(extent))


@dataclass(frozen=True)
class Strategy:
    """One way to a sheet on ``surface``, whose rows run along the request's u or v.

    ``way`` is ``direct``, ``strip``, ``seed``, ``bent``, ``refined`` or ``shaken``. ``place`` and
    ``layout`` say where on a mesh the sheet lies, if not on the first placement. ``ring`` says that
    the sheet goes all round an axis and has to stay closed.
    """

    way: str
    surface: TargetSurface
    rows_along: str
    corrugation: Corrugation
    place: str = ""
    layout: dict[str, Any] = field(default_factory=dict)
    ring: bool = False

    def describe(self) -> str:
        how = {
            "direct": "direct construction",
            "strip": "one period of the revolution",
            "seed": "seed",
            "bent": "bending step by step",
            "refined": "from coarse to fine",
            "shaken": "seed shaken",
        }
        place = f", {self.place}" if self.place else ""
        return f"{how[self.way]}, rows along {self.rows_along}{place}"

    def run(self, request: FitRequest) -> Candidate | Attempt:
        """The sheet of this strategy, or the record of the attempt if there is none."""
        unknowns, solution = self._developable(request)
        iterations = solution.iterations
        off = solution.converged and _worst_kawasaki(unknowns.sheet(solution.x)) > EXACT
        if request.exactly_flat_foldable and off:
            if unknowns.turn is not None and not self.ring:
                # an open sheet has more freedom than its repeated period
                whole = unknowns.sheet(solution.x)
                solution = replace(solution, x=whole.vertices.ravel())
                unknowns = Unknowns(unknowns.columns, unknowns.rows, unknowns.length)
            solution = solve(unknowns, solution.x, flat_foldable=True)
            iterations += solution.iterations
        if not solution.converged:
            return self._attempt(solution.residual, iterations, solution.reason)
        plain = self._candidate(request, unknowns, solution, iterations)
        asked = request.flat_foldable is not None or plain.rank != (0, False)
        if request.polish == "off" or (request.polish == "auto" and not asked):
            return plain
        if request.is_tube:
            return plain  # polishing would open the seam
        if plain.measurements.overlaps:
            return plain  # polishing does not mend an overlap
        closer = self._polished(request, unknowns, solution, plain)
        if (closer.rank, closer.deviation_mm) < (plain.rank, plain.deviation_mm):
            return closer
        return plain

    def _follow(self, request: FitRequest) -> Follow:
        """The side that follows the target; with u and v swapped, top and bottom change places."""
        turned: dict[Follow, Follow] = {"middle": "middle", "top": "bottom", "bottom": "top"}
        return request.follow if self.rows_along == "u" else turned[request.follow]

    def _developable(self, request: FitRequest) -> tuple[Unknowns, Projection]:
        """The developable sheet of this strategy, before flat-foldability and polishing."""
        columns, rows = request.columns + 1, request.rows + 1
        level = LEVELS[self._follow(request)]
        if self.way == "direct":
            assert isinstance(self.surface, GeneralizedCylinder)
            c = self.corrugation
            sheet = cylinder_on(self.surface, columns, rows, c.amplitude, c.zigzag, level)
            no_bounds = np.zeros(0, dtype=bool)
            unknowns = Unknowns(columns, rows, float(sheet.edge_lengths.mean()))
            return unknowns, Projection(sheet.vertices.ravel(), 0.0, 0, True, "exact", no_bounds)
        if self.way == "bent":
            return bend(self.surface, columns, rows, self.corrugation, level)
        if self.way == "refined":
            return refine(self.surface, columns, rows, self.corrugation, level)
        if self.way == "strip":
            assert isinstance(self.surface, Revolution)
            unknowns, start = _period(self.surface, columns, rows, self.corrugation, level)
        else:
            start, _ = seed(self.surface, columns, rows, self.corrugation, level)
            if self.way == "shaken":
                start = shaken(start, request.seed)
            unknowns = Unknowns(columns, rows, float(start.edge_lengths.mean()))
        return unknowns, solve(unknowns, start.vertices.ravel(), flat_foldable=False)

    def _polished(
        self, request: FitRequest, unknowns: Unknowns, solution: Projection, plain: Candidate
    ) -> Candidate:
        """The sheet ``solution``, projected into the limits and polished; ``plain`` if that fails.

        Limits in mm depend on the scale, and the scale on the sheet: so the rounds are repeated.
        """
        constraints = unknowns.constraints(request.exactly_flat_foldable)
        best, first, least = plain, solution, request.min_edge_mm
        for _ in range(SCALINGS):
            asked = replace(request, min_edge_mm=least)
            on_grid = limits(asked, unknowns, best.pattern.scale, BOUND_MARGIN)
            bounds = unknowns.on_unknowns(on_grid) if on_grid.any else None
            iterations = best.attempt.iterations
            if bounds is not None:
                solution = project(
                    constraints,
                    solution.x,
                    unknowns.places,
                    inequalities=bounds,
                    cap=STEP_CAP * unknowns.length,
                )
                iterations += solution.iterations
                if not solution.converged:
                    break
            better = polish(
                solution,
                self.surface,
                unknowns,
                constraints,
                follow=self._follow(request),
                bounds=bounds,
            )
            solution = better.projection
            best = replace(
                self._candidate(request, unknowns, solution, iterations + better.rounds),
                polished=True,
                active_bounds=on_grid.count(solution.active) if bounds is not None else {},
            )
            shortest = KEPT_EDGE * plain.measurements.min_edge_mm
            if least is None and best.measurements.min_edge_mm < shortest:
                best, solution, least = plain, first, shortest
            elif bounds is None or not best.faults:
                break
        return best

    def _candidate(
        self, request: FitRequest, unknowns: Unknowns, solution: Projection, iterations: int
    ) -> Candidate:
        sheet = unknowns.sheet(solution.x)
        extent = float(np.ptp(sheet.vertices, axis=0).max())
        scale = 1.0 if request.size_mm is None else request.size_mm / extent
        pattern = unfold(sheet.scaled(scale), scale=scale, target=request.target | self.layout)
        measured = measure(pattern, self.surface)
        deviation = _deviation(sheet, self.surface, self._follow(request)) * scale
        unmeasured = replace(
            limits(request, Unknowns(unknowns.columns, unknowns.rows, unknowns.length), scale),
            min_edge=None,
            kawasaki=None,
        )
        faults = tuple(_faults(request, pattern, measured, deviation, unmeasured, sheet))
        residual = max(measured.max_planarity or 0.0, measured.max_developability or 0.0)
        attempt = self._attempt(residual, iterations, " ".join(fault.sentence for fault in faults))
        return Candidate(attempt, pattern, measured, faults, deviation)

    def _attempt(self, residual: float, iterations: int, reason: str) -> Attempt:
        """The record of this strategy."""
        way, rows, corrugation = self.way, self.rows_along, self.corrugation
        return Attempt(way, rows, corrugation, residual, iterations, reason, self.place)


def strategies_for(request: FitRequest) -> Iterator[Strategy]:
    """The strategies in the order in which they are tried, the likeliest first."""
    corrugations = _corrugations(request)
    if isinstance(request.surface, GeneralizedCylinder):
        for corrugation in corrugations:
            yield Strategy("direct", request.surface, "u", corrugation)
        return
    if isinstance(request.surface, MeshSurface):
        yield from _on_mesh(request.surface, corrugations)
        return
    oriented = _oriented(request.surface)
    if isinstance(request.surface, Revolution):
        for corrugation in corrugations:
            yield Strategy("strip", request.surface, "u", corrugation, ring=request.surface.closed)
        if request.surface.closed:
            return  # any other strategy would open the seam
    fine = min(request.columns, request.rows) >= COARSEST
    for way in ("seed", "bent", *(("refined",) if fine else ()), "shaken"):
        for corrugation in corrugations:
            for surface, name in oriented:
                yield Strategy(way, surface, name, corrugation)


def _oriented(surface: TargetSurface) -> list[tuple[TargetSurface, str]]:
    """Both directions of the rows; first the direction along which the normal turns less."""
    both: list[tuple[TargetSurface, str]] = [(surface, "u"), (Swapped(surface), "v")]
    return sorted(both, key=lambda pair: _turning(pair[0]))


def _on_mesh(surface: MeshSurface, corrugations: list[Corrugation]) -> Iterator[Strategy]:
    """Seeds and bends on the first placement, then on the others, which are computed on demand."""
    seeds, bends = len(corrugations), MESH_BENDS
    for place, laid in itertools.chain([("", surface)], surface.alternatives()):
        oriented = _oriented(laid)
        layout = laid.description if place else {}
        for way, some in (("seed", seeds), ("bent", bends)):
            for corrugation in corrugations[:some]:
                for turned, name in oriented:
                    yield Strategy(way, turned, name, corrugation, place, layout)
        seeds, bends = SEEDS_ELSEWHERE, BENDS_ELSEWHERE


def _corrugations(request: FitRequest) -> list[Corrugation]:
    if request.amplitude is not None and request.zigzag is not None:
        return [Corrugation(request.amplitude, request.zigzag)]
    corrugations = []
    for along, across in STRETCHES:
        usual = Corrugation.from_stretches(along, across)
        amplitude = usual.amplitude if request.amplitude is None else request.amplitude
        if request.zigzag is not None:
            corrugations.append(Corrugation(amplitude, request.zigzag))
        else:
            stretch = float(np.hypot(1.0, amplitude))
            corrugations.append(Corrugation.from_stretches(along, stretch))
    return list(dict.fromkeys(corrugations))


def _turning(surface: TargetSurface) -> float:
    """The mean angle through which the normal turns along the u-lines, radians."""
    normals = surface.normal(surface.domain.lattice(17, 9))
    cosine = np.einsum("ijk,ijk->ij", normals[:, 1:], normals[:, :-1])
    return float(np.arccos(np.clip(cosine, -1, 1)).sum(axis=1).mean())


def _period(
    surface: Revolution, columns: int, rows: int, corrugation: Corrugation, level: float
) -> tuple[Unknowns, Tessellation]:
    """One period of the pattern on ``surface``, where its sector starts."""
    beta = surface.angle / (rows - 1)
    start, _ = seed(revolution(surface.profile, beta), columns, 2, corrugation, level)
    unknowns = Unknowns(columns, rows, float(start.edge_lengths.mean()), 2 * beta)
    return unknowns, Tessellation(start.points @ about_z((beta - surface.angle) / 2).T)


def _worst_kawasaki(sheet: Tessellation) -> float:
    return float(np.abs(flat_foldability(sheet.vertices, sheet.grid)).max(initial=0.0))


def _deviation(sheet: Tessellation, surface: TargetSurface, follow: Follow) -> float:
    """The largest distance from the target of the surface that follows it.

    Besides its points it is measured between neighbours and between each four points, so that a few
    points on the target do not count as a close sheet.
    """
    points = (followers(sheet.grid, follow) @ sheet.vertices).reshape(
        -1, sheet.grid.columns - (follow == "middle"), 3
    )
    between = (points[:, 1:] + points[:, :-1]) / 2
    rows = (points[1:] + points[:-1]) / 2
    centres = (between[1:] + between[:-1]) / 2
    samples = np.concatenate([part.reshape(-1, 3) for part in (points, between, rows, centres)])
    return float(np.linalg.norm(samples - surface.closest_point(samples), axis=1).max())


def _faults(
    request: FitRequest,
    pattern: CreasePattern,
    measured: Measurements,
    deviation: float,
    unmeasured: Bounds,
    sheet: Tessellation,
) -> Iterator[Finding]:
    """The faults of this sheet, each with advice; ``unmeasured`` are the limits that
    ``measured`` does not contain.
    """
    residual = max(
        measured.max_planarity or 0.0,
        measured.max_developability or 0.0,
        measured.max_isometry or 0.0,
    )
    if residual > EXACT:
        sentence = f"A residual of {residual:.1e} is left; ask for fewer `facets`."
        yield Finding("residual", sentence)
    if measured.self_intersections:
        yield Finding(
            "self-intersection",
            f"{measured.self_intersections} pairs of facets pass through each other; ask for more "
            "`facets`, lower `zigzag` or `amplitude`, or take a smaller part of the target.",
        )
    if measured.overlaps:
        pairs = f"{measured.overlaps} pairs of facets"
        yield Finding("overlap", f"{pairs} overlap in the flat pattern; lower `zigzag`.")
    mean = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    least = request.min_edge_mm or DEGENERATE * mean
    if measured.min_edge_mm < least:
        yield Finding(
            "min-edge",
            f"The shortest edge is {measured.min_edge_mm:.3g} mm, under the {least:.3g} mm asked "
            "for; ask for fewer `facets` or a larger `size`.",
        )
    yield from Closeness.of(request, measured, deviation).faults(request.follow)
    if unmeasured.any:
        broken = unmeasured(sheet.vertices.ravel())[0] < -1e-9
        for kind, number in unmeasured.count(broken).items():
            if number:
                yield Finding(
                    "facet-shape",
                    f"{number} facet corners or sides break the {kind} limit; loosen it, or ask "
                    "for other `facets`, `amplitude` or `zigzag`.",
                )
    asked = request.flat_foldable
    if asked is not None and (measured.max_flat_foldability or 0.0) > max(asked, EXACT):
        reached = f"{measured.max_flat_foldability:.1e} rad"
        yield Finding("flat-foldable", f"The sheet is flat-foldable only to {reached}.")
