"""Fitting: from a target to a tessellation that lies on it and folds from one flat sheet.

A fit is a short list of attempts in a fixed order, each a seed and a projection; the first that
meets everything asked is the answer. The order:

1. on a surface of revolution, one period solved and turned about the axis;
2. straight from the seed, with several stretches along and across the rows, each in both directions
   of the rows, the one along which the normal turns less first;
3. the same bent step by step from flat to the full target, carrying the solution along;
4. the seeds shaken a little at random, by the request's ``seed``.

On a mesh the sheet may then lie elsewhere: the scan smoothed more, the grid turned, and as the last
resort a smaller part of the rectangle, each with the seeds and some of the bends. The advice says
where it lies.

Exact flat-foldability is appended to a developable solution. Whatever happens, the result says what
was tried and, if nothing served, what to change.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import InputError
from miurafab.origami.audit import DEGENERATE, EXACT, Measurements, measure
from miurafab.origami.constraints import OrigamiConstraints, flat_foldability
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cylinder import cylinder_on
from miurafab.origami.seed import Corrugation, seed
from miurafab.origami.solver import Projection, project
from miurafab.origami.strip import solve_strip
from miurafab.origami.tessellation import Tessellation
from miurafab.origami.unfold import unfold
from miurafab.surfaces.analytic import GeneralizedCylinder, Revolution
from miurafab.surfaces.mesh import MeshSurface
from miurafab.surfaces.surface import Bent, Swapped, TargetSurface, tangents

Floats = NDArray[np.float64]

STRETCHES = ((1.3, 1.3), (1.15, 1.6), (1.6, 1.3), (1.3, 1.6), (2.0, 1.3), (2.6, 1.3), (1.15, 2.0))
"""The stretches along and across the rows that are tried in turn. Strong curvature along the rows
wants more of the first, strong twist less of the first and more of the second.
"""
BENDS_ELSEWHERE = 4
"""How many of those stretches are bent step by step where a sheet is laid elsewhere on a mesh."""
BEND_STEPS = 12
STEP_CAP = 0.25
"""The farthest that a coordinate moves in one step, in mean edge lengths."""
FAR = 0.02
"""A mid-surface farther from the target than this part of the diagonal makes the search go on."""
SHAKE = 0.03
"""The standard deviation of a random attempt's coordinates, in mean edge lengths."""


@dataclass(frozen=True)
class FitRequest:
    """What is asked. ``columns`` x ``rows`` facets on ``surface``.

    ``size_mm`` is the longest side of the folded bounding box, None for the target's own size;
    ``amplitude`` and ``zigzag`` the corrugation (height over row spacing, zig-zag over column
    spacing), None for automatic; ``flat_foldable`` the largest allowed |pi - a1 - a3| in radians, 0
    for exact, None for off; ``min_edge_mm`` and ``max_deviation_mm`` (of the mid-surface) are
    limits; ``seed`` decides the random attempts. ``target`` describes the surface in the file.
    """

    surface: TargetSurface
    columns: int
    rows: int
    size_mm: float | None = None
    amplitude: float | None = None
    zigzag: float | None = None
    flat_foldable: float | None = None
    min_edge_mm: float | None = None
    max_deviation_mm: float | None = None
    seed: int = 0
    target: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.columns < 2 or self.rows < 2:
            raise InputError(
                f"A sheet of {self.columns}x{self.rows} facets cannot fold; ask for 2x2 or more."
            )
        for name in ("size_mm", "amplitude", "zigzag", "min_edge_mm", "max_deviation_mm"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                option = "--" + name.removesuffix("_mm").replace("_", "-")
                raise InputError(f"{option} is {value:g}; it must be greater than zero.")
        if self.flat_foldable is not None and not 0 <= self.flat_foldable < np.pi:
            raise InputError(
                f"--flat-foldable is {self.flat_foldable:g}; it must be exact, off, or an angle "
                "from 0 to pi."
            )


@dataclass(frozen=True)
class Attempt:
    """One attempt: the way (``direct``, ``strip``, ``seed``, ``bent``, ``shaken``), the row
    direction, the corrugation, the residual it ended with, why it was not enough (empty if it
    was), and on a mesh where else the sheet was laid.
    """

    way: str
    rows_along: str
    corrugation: Corrugation
    residual: float
    iterations: int
    fault: str
    place: str = ""


@dataclass(frozen=True, eq=False)
class FitResult:
    """The outcome. ``status`` is ``converged``, ``infeasible`` (an exact sheet, but a limit is not
    met) or ``stalled`` (no exact sheet was found); ``pattern`` is the best sheet there is, or None.
    """

    status: str
    advice: str
    pattern: CreasePattern | None
    measurements: Measurements | None
    attempts: tuple[Attempt, ...]
    iterations: int
    seconds: float

    def report(self) -> dict[str, Any]:
        """The fit report, ready for JSON."""
        numbers = {f.name: getattr(self.measurements, f.name, None) for f in fields(Measurements)}
        return {
            "status": self.status,
            "advice": self.advice,
            **numbers,
            "iterations": self.iterations,
            "seconds": self.seconds,
            "attempts": [
                {
                    "way": a.way,
                    "rows_along": a.rows_along,
                    "amplitude": a.corrugation.amplitude,
                    "zigzag": a.corrugation.zigzag,
                    "residual": a.residual,
                    "iterations": a.iterations,
                    "fault": a.fault,
                    "place": a.place,
                }
                for a in self.attempts
            ],
        }


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A tessellation that some attempt produced, in the target's own unit."""

    attempt: Attempt
    pattern: CreasePattern
    measurements: Measurements
    faults: tuple[str, ...]

    @property
    def rank(self) -> tuple[int, bool]:
        """The smaller the better: the number of faults, then whether it strays from the target."""
        assert self.pattern.folded_coords is not None
        extent = np.ptp(self.pattern.folded_coords, axis=0)
        stray = (self.measurements.hausdorff_midsurface_mm or 0.0) > FAR * np.linalg.norm(extent)
        return len(self.faults), bool(stray)


def fit(request: FitRequest, on_progress: Callable[[float, str], None] | None = None) -> FitResult:
    """The tessellation asked for; ``on_progress`` gets a fraction and a word on what is tried.

    Non-convergence is a result with advice. Raises :class:`~miurafab.errors.InputError` only for a
    request that makes no sense.
    """
    started = time.perf_counter()
    attempts: list[Attempt] = []
    best: _Candidate | None = None
    for number, plan in enumerate(_plans(request)):
        if on_progress is not None:
            # how many attempts it takes is not known; most sheets need one or two
            on_progress(1 - 0.9**number, plan.describe())
        outcome = plan.run(request)
        if isinstance(outcome, Attempt):
            attempts.append(outcome)
            continue
        attempts.append(outcome.attempt)
        if best is None or outcome.rank < best.rank:
            best = outcome
        if outcome.rank == (0, False):
            break
    if on_progress is not None:
        on_progress(1.0, "done")
    iterations = sum(a.iterations for a in attempts)
    seconds = time.perf_counter() - started
    if best is None:
        advice = _advice_when_stalled(attempts)
        return FitResult("stalled", advice, None, None, tuple(attempts), iterations, seconds)
    status = "infeasible" if best.faults else "converged"
    place = best.attempt.place
    remarks = [f"On the whole rectangle no sheet was found; this one has {place}."] if place else []
    if best.rank[1]:
        remarks.append("The mid-surface lies far from the target; ask for more --facets.")
    return FitResult(
        status,
        " ".join((*best.faults, *remarks)),
        best.pattern,
        best.measurements,
        tuple(attempts),
        iterations,
        seconds,
    )


def _advice_when_stalled(attempts: list[Attempt]) -> str:
    residual = min(a.residual for a in attempts)
    return (
        f"No exact sheet was found in {len(attempts)} attempts (best residual {residual:.1e}): "
        "the target bends too much for one sheet of this pattern. Ask for more --facets, raise "
        "--zigzag and --amplitude, drop --flat-foldable, or take a smaller part of the target."
    )


@dataclass(frozen=True)
class _Plan:
    way: str
    surface: TargetSurface
    rows_along: str
    corrugation: Corrugation
    place: str = ""
    layout: dict[str, Any] = field(default_factory=dict)

    def describe(self) -> str:
        how = {
            "direct": "direct construction",
            "strip": "one period of the revolution",
            "seed": "seed",
            "bent": "bending step by step",
            "shaken": "seed shaken",
        }
        place = f", {self.place}" if self.place else ""
        return f"{how[self.way]}, rows along {self.rows_along}{place}"

    def run(self, request: FitRequest) -> _Candidate | Attempt:
        if self.way == "direct":
            assert isinstance(self.surface, GeneralizedCylinder)
            sheet = cylinder_on(
                self.surface,
                request.columns + 1,
                request.rows + 1,
                self.corrugation.amplitude,
                self.corrugation.zigzag,
            )
            return self._candidate(request, sheet, 0)
        columns, rows = request.columns + 1, request.rows + 1
        if self.way == "strip":
            assert isinstance(self.surface, Revolution)
            solution = solve_strip(self.surface, columns, rows, self.corrugation)
        elif self.way == "bent":
            solution = _bend(self.surface, columns, rows, self.corrugation)
        else:
            start, _ = seed(self.surface, columns, rows, self.corrugation)
            if self.way == "shaken":
                start = _shaken(start, request.seed)
            solution = _solve(start, flat_foldable=False)
        iterations = solution.iterations
        sheet = Tessellation(solution.x.reshape(rows, columns, 3))
        if solution.converged and request.flat_foldable is not None:
            worst = _worst_kawasaki(sheet)
            if worst > max(request.flat_foldable, EXACT):
                solution = _solve(sheet, flat_foldable=True)
                iterations += solution.iterations
                sheet = Tessellation(solution.x.reshape(rows, columns, 3))
        if not solution.converged:
            return Attempt(
                self.way,
                self.rows_along,
                self.corrugation,
                solution.residual,
                iterations,
                solution.reason,
                self.place,
            )
        return self._candidate(request, sheet, iterations)

    def _candidate(self, request: FitRequest, sheet: Tessellation, iterations: int) -> _Candidate:
        extent = float(np.ptp(sheet.vertices, axis=0).max())
        scale = 1.0 if request.size_mm is None else request.size_mm / extent
        pattern = unfold(sheet.scaled(scale), scale=scale, target=request.target | self.layout)
        measured = measure(pattern, self.surface)
        faults = tuple(_faults(request, pattern, measured))
        attempt = Attempt(
            self.way,
            self.rows_along,
            self.corrugation,
            max(measured.max_planarity or 0.0, measured.max_developability or 0.0),
            iterations,
            " ".join(faults),
            self.place,
        )
        return _Candidate(attempt, pattern, measured, faults)


def _plans(request: FitRequest) -> Iterator[_Plan]:
    corrugations = _corrugations(request)
    if isinstance(request.surface, GeneralizedCylinder):
        for corrugation in corrugations:
            yield _Plan("direct", request.surface, "u", corrugation)
        return
    oriented = [(request.surface, "u"), (Swapped(request.surface), "v")]
    oriented.sort(key=lambda pair: _turning(pair[0]))
    if isinstance(request.surface, Revolution):
        for corrugation in corrugations:
            yield _Plan("strip", request.surface, "u", corrugation)
    for way in ("seed", "bent", "shaken"):
        for corrugation in corrugations:
            for surface, name in oriented:
                yield _Plan(way, surface, name, corrugation)
    if isinstance(request.surface, MeshSurface):
        yield from _elsewhere(request.surface, corrugations)


def _elsewhere(surface: MeshSurface, corrugations: list[Corrugation]) -> Iterator[_Plan]:
    """The same ways with the sheet laid elsewhere on the mesh; each layout is made when needed."""
    for place, other in surface.alternatives():
        oriented: list[tuple[TargetSurface, str]] = [(other, "u"), (Swapped(other), "v")]
        oriented.sort(key=lambda pair: _turning(pair[0]))
        for way, some in (("seed", corrugations), ("bent", corrugations[:BENDS_ELSEWHERE])):
            for corrugation in some:
                for turned, name in oriented:
                    yield _Plan(way, turned, name, corrugation, place, other.description)


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


def _solve(start: Tessellation, flat_foldable: bool) -> Projection:
    length = float(start.edge_lengths.mean())
    constraints = OrigamiConstraints(start.grid, length, flat_foldable)
    return project(constraints, start.vertices.ravel(), constraints.places, cap=STEP_CAP * length)


def _bend(surface: TargetSurface, columns: int, rows: int, corrugation: Corrugation) -> Projection:
    """From the flat sheet to the full target in equal steps; each starts from the last solution,
    carried along in the target's own frame (tangents and normal at each vertex).
    """
    uv = surface.domain.lattice(columns, rows)
    bends = np.linspace(0.0, 1.0, BEND_STEPS + 1)
    solution = _solve(seed(Bent(surface, 0.0), columns, rows, corrugation)[0], False)
    iterations = solution.iterations
    for before, after in itertools.pairwise(bends):
        offset = solution.x.reshape(rows, columns, 3) - Bent(surface, before).point(uv)
        local = np.linalg.solve(_frame(Bent(surface, before), uv), offset[..., None])
        carried = Bent(surface, after).point(uv)
        carried = carried + (_frame(Bent(surface, after), uv) @ local)[..., 0]
        solution = _solve(Tessellation(carried), False)
        iterations += solution.iterations
        if not solution.converged:
            break
    return Projection(
        solution.x,
        solution.residual,
        iterations,
        solution.converged,
        solution.reason,
        solution.active,
    )


def _frame(surface: TargetSurface, uv: Floats) -> Floats:
    along, across = tangents(surface, uv)
    return np.stack([along, across, surface.normal(uv)], axis=-1)


def _shaken(start: Tessellation, seed_number: int) -> Tessellation:
    random = np.random.default_rng(seed_number)
    amount = SHAKE * float(start.edge_lengths.mean())
    return Tessellation(start.points + random.normal(scale=amount, size=start.points.shape))


def _worst_kawasaki(sheet: Tessellation) -> float:
    return float(np.abs(flat_foldability(sheet.vertices, sheet.grid)).max(initial=0.0))


def _faults(request: FitRequest, pattern: CreasePattern, measured: Measurements) -> Iterator[str]:
    """What keeps this sheet from being the answer, one sentence of advice each."""
    residual = max(
        measured.max_planarity or 0.0,
        measured.max_developability or 0.0,
        measured.max_isometry or 0.0,
    )
    if residual > EXACT:
        yield f"A residual of {residual:.1e} is left; ask for fewer --facets."
    if measured.self_intersections:
        yield (
            f"{measured.self_intersections} pairs of facets pass through each other; ask for more "
            "--facets, lower --zigzag or --amplitude, or take a smaller part of the target."
        )
    if measured.overlaps:
        yield f"{measured.overlaps} pairs of facets overlap in the flat pattern; lower --zigzag."
    mean = float(
        np.linalg.norm(
            np.diff(pattern.vertices_coords[pattern.edges_vertices], axis=1), axis=2
        ).mean()
    )
    wanted = request.min_edge_mm or DEGENERATE * mean
    if measured.min_edge_mm < wanted:
        yield (
            f"The shortest edge is {measured.min_edge_mm:.3g} mm, under the {wanted:.3g} mm asked "
            "for; ask for fewer --facets or a larger --size."
        )
    deviation = measured.hausdorff_midsurface_mm
    if request.max_deviation_mm is not None and (deviation or 0.0) > request.max_deviation_mm:
        yield (
            f"The mid-surface lies up to {deviation:.3g} mm from the target, over the "
            f"{request.max_deviation_mm:.3g} mm allowed; ask for more --facets."
        )
    asked = request.flat_foldable
    if asked is not None and (measured.max_flat_foldability or 0.0) > max(asked, EXACT):
        yield f"The sheet is flat-foldable only to {measured.max_flat_foldability:.1e} rad."
