"""Mesh targets: a scanned or modelled surface as a smooth map from a rectangle.

The mesh is repaired to one disk (:mod:`~miurafab.surfaces.preparation`) and laid flat. A rectangle
in the layout is the parameter domain, and a smooth spline through the vertices over the rectangle
gives points and normals. A rough mesh (a scan) is smoothed by the spline and laid flat again.
Distances are measured to the triangles, not to the spline.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.errors import TargetError
from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.distances import MeshTrees
from miurafab.surfaces.body import BodyChoice, goes_round, round_target
from miurafab.surfaces.decimation import decimated
from miurafab.surfaces.mesh_files import read_mesh
from miurafab.surfaces.mesh_repair import (
    Holes,
    doubled_areas,
    even_triangles,
    fill_holes,
    side_lengths,
)
from miurafab.surfaces.parameterise import flatten
from miurafab.surfaces.placement import (
    GridPlacement,
    Region,
    covered,
    largest_rectangle,
    placements,
    turned,
)
from miurafab.surfaces.preparation import (
    MeshReading,
    PreparedMesh,
    prepare,
    refuse_other_than_a_disk,
)
from miurafab.surfaces.refine import refine
from miurafab.surfaces.smoothing import Smoothed, smooth
from miurafab.surfaces.spline import continued
from miurafab.surfaces.surface import Domain, normal_to, tangents
from miurafab.surfaces.topology import classify
from miurafab.surfaces.tube import TubeSurface

if TYPE_CHECKING:
    from scipy.interpolate import NdBSpline

    from miurafab.surfaces.outline import WholeMesh

ROUGH = 0.03
"""A mesh is rough if it is this part of its median edge away from the smooth spline."""

MARGIN = 0.12
"""The spline also follows the mesh up to this part of the rectangle's size beyond it."""

LARGE = 80_000
"""A mesh of more triangles is simplified before it is laid flat, to about ``LAID_FLAT``: the spline
has at most 40 x 40 spans."""

LAID_FLAT = 40_000

LONGEST = 0.06
"""Edges are halved down to this part of the root of the area before the mesh is laid flat. The
spline goes through vertices, and over a long triangle it would go where it likes: half a pipe of
24 pairs of triangles was missed by 3.8 % of its diagonal, and is by 0.04 %."""

FEWEST = 4
"""A rectangle with fewer vertices of the mesh is refused."""

SMOOTHER = 0.03
"""The stiffness of the smoother alternative for scans with noise."""

_SPANS = 40
_ROUGH_SPANS = 24


@dataclass(frozen=True, eq=False)
class MeshChart:
    """A mesh laid flat.

    ``vertices`` (V, 3) and ``faces`` (F, 3) are the mesh, simplified if it is large and its long
    edges halved, with its holes filled; the first ``known`` of the vertices are the mesh's own, and
    the triangles from ``real`` on fill holes. ``flat`` (V, 2) is the layout; ``rough`` marks a
    noisy scan. ``whole`` are the vertices and triangles of the mesh as it is, for distances.
    ``reading`` is what a description keeps of how the mesh was read, such as its ``origin``.
    """

    vertices: Floats
    faces: Ints
    whole: tuple[Floats, Ints]
    known: int
    real: int
    flat: Floats
    rough: bool
    name: str
    reading: Mapping[str, Any] = field(default_factory=dict)

    @property
    def triangles(self) -> Floats:
        """(T, 3, 3) the triangles of the mesh, without those that fill holes."""
        vertices, faces = self.whole
        return vertices[faces]

    @cached_property
    def bare(self) -> MeshTrees:
        """The mesh as it is, without fillings, for the search of nearest points."""
        return MeshTrees.of(even_triangles(*self.whole))

    @cached_property
    def filled(self) -> MeshTrees:
        """The same with the triangles that fill holes."""
        filling = self.vertices[self.faces[self.real :]]
        return MeshTrees.of(np.concatenate([self.bare.triangles, filling]))

    def surface(self, placement: GridPlacement, stiffness: float = 0.0) -> MeshSurface:
        """The target over ``placement``; the spline is as stiff as the data ask, or ``stiffness``.

        Raises :class:`~miurafab.errors.TargetError` if the rectangle reaches beyond the mesh, or
        holds too few vertices for a spline.
        """
        frame = turned(self.flat, placement.angle)
        domain = placement.domain
        if not covered(frame, self.faces, domain):
            raise TargetError(self._not_covered(frame))
        edge = median_edge(frame, self.faces)
        wide = Domain(
            domain.u0 - MARGIN * domain.width,
            domain.u1 + MARGIN * domain.width,
            domain.v0 - MARGIN * domain.height,
            domain.v1 + MARGIN * domain.height,
        )
        places, points = _within(frame[: self.known], self.vertices[: self.known], wide)
        if len(points) < FEWEST:
            raise TargetError(
                f"{self.name}: only {len(points)} vertices of the mesh lie on the rectangle of the "
                f"sheet, and {FEWEST} are needed; subdivide the triangles of the mesh."
            )
        smoothed = smooth(places, points, wide, spans(wide, edge, _SPANS), stiffness)
        return MeshSurface(smoothed.spline, domain, placement, stiffness, self)

    def _not_covered(self, frame: Floats) -> str:
        best = largest_rectangle(frame, self.faces)
        low, size = frame.min(axis=0), np.ptp(frame, axis=0)
        if best is None:
            return f"{self.name}: no rectangle fits into the mesh at this rotation."
        starts, ends = 100 * (np.array([[best.u0, best.v0], [best.u1, best.v1]]) - low) / size
        (u0, v0), (u1, v1) = np.ceil(starts).astype(int), np.floor(ends).astype(int)
        parts = ",".join(f"{value / 100:.2f}" for value in (u0, u1, v0, v1))
        return (
            f"{self.name}: `region` reaches beyond the mesh; the largest rectangle at this "
            f"rotation is `region` {parts}."
        )


@dataclass(frozen=True, eq=False)
class MeshSurface:
    """A rectangle of a mesh. ``spline`` maps a little more than ``domain`` to space. ``free`` says
    whether the rectangle may be laid elsewhere.
    """

    spline: NdBSpline
    domain: Domain
    placement: GridPlacement
    stiffness: float
    layout: MeshChart = field(repr=False)
    findings: tuple[Finding, ...] = ()
    free: bool = True

    def point(self, uv: Floats) -> Floats:
        """The spline, and beyond its knots its straight continuation."""
        return continued(self.spline, uv)

    def normal(self, uv: Floats) -> Floats:
        return normal_to(*tangents(self, uv))

    def closest_point(self, points: Floats) -> Floats:
        """The points nearest to ``points`` of the mesh and what fills its holes."""
        return self.layout.filled.closest(points)[0]

    def nearest(self, points: Floats) -> Floats:
        return self.layout.bare.closest(points)[0]

    def tiles(self) -> Floats:
        return self.layout.triangles

    def __repr__(self) -> str:
        return f"<MeshSurface {self.layout.name}: {len(self.layout.bare.triangles)} triangles>"

    @property
    def description(self) -> dict[str, Any]:
        """Where the rectangle lies, for :func:`load_mesh` to lay it there again: ``rotate`` in
        degrees, ``rectangle`` and ``stiffness`` in the layout's own unit."""
        d = self.domain
        return {
            "rotate": round(math.degrees(self.placement.angle), 12),
            "rectangle": [d.u0, d.u1, d.v0, d.v1],
            "stiffness": self.stiffness,
            **self.layout.reading,
        }

    @cached_property
    def whole(self) -> WholeMesh | None:
        """All of the mesh inside its outline, None where the layout lies over itself."""
        from miurafab.surfaces.outline import whole_mesh

        with contextlib.suppress(TargetError):
            return whole_mesh(self.layout)
        return None

    def alternatives(self) -> Iterator[tuple[str, MeshSurface]]:
        """Other targets on the same mesh, each with its description.

        First the mesh smoothed more if it is rough, then the grid turned, then smaller parts of
        the rectangle. A rectangle that the user asked for stays where it is. A placement that the
        mesh cannot serve is left out.
        """
        for description, placement, stiffness in self._elsewhere():
            with contextlib.suppress(TargetError):
                yield description, self.layout.surface(placement, stiffness)

    def _elsewhere(self) -> Iterator[tuple[str, GridPlacement, float]]:
        """The description, placement and stiffness of each alternative."""
        if self.layout.rough:
            yield "the mesh smoothed more", self.placement, SMOOTHER
        if not self.free:
            return
        kept = [self.placement.angle]
        for _, other in placements(self.layout.vertices, self.layout.flat, self.layout.faces):
            # angles are the same grid when they differ by a right angle
            apart = [abs((other.angle - angle + math.pi / 4) % (math.pi / 2) - math.pi / 4)
                     for angle in kept]  # fmt: skip
            if min(apart) > math.radians(20) and len(kept) < 3:
                kept.append(other.angle)
                degrees = math.degrees(other.angle - self.placement.angle)
                yield f"the grid turned by {degrees:.0f} degrees", other, 0.0
        for part in (0.85, 0.7, 0.55):
            shrunk = self.placement.shrunk(part)
            yield f"the middle {100 * part:.0f} % of the rectangle", shrunk, 0.0


def load_mesh(
    path: Path,
    *,
    region: Region | None = None,
    rotate: float | None = None,
    reading: MeshReading | None = None,
    place: Mapping[str, Any] | None = None,
    choice: BodyChoice | None = None,
) -> tuple[MeshSurface | TubeSurface, str]:
    """The mesh file as a target, and the SHA-256 of the file.

    ``rotate`` turns the grid against the longer axis of the layout (radians), ``region`` is laid in
    the turned layout; without both the rectangle is chosen. ``reading`` says how the mesh is read.
    ``place`` is a :attr:`MeshSurface.description` to be laid out again.

    Raises :class:`~miurafab.errors.TargetError` with one sentence for a file that is missing,
    unreadable, empty, holds numbers that are not finite, a closed or non-manifold surface, large
    holes, or no such region.
    """
    vertices, faces, sha256 = read_mesh(path)
    surface = mesh_surface(
        vertices,
        faces,
        path.name,
        region=region,
        rotate=rotate,
        reading=reading,
        place=place,
        choice=choice,
    )
    return surface, sha256


def mesh_surface(
    vertices: Floats,
    faces: Ints,
    name: str = "The mesh",
    *,
    region: Region | None = None,
    rotate: float | None = None,
    reading: MeshReading | None = None,
    place: Mapping[str, Any] | None = None,
    choice: BodyChoice | None = None,
) -> MeshSurface | TubeSurface:
    """A target from the arrays of a triangle mesh, ``vertices`` (V, 3) and ``faces`` (F, 3).

    The other arguments are those of :func:`load_mesh`. Raises
    :class:`~miurafab.errors.TargetError` for a mesh that neither lies flat nor goes round.
    """
    if place is not None:
        reading = MeshReading.before(place)
    mesh = prepare(vertices, faces, name, reading, place)
    holes = "small" if reading is None else reading.holes
    if region is None and rotate is None and goes_round(mesh, holes):
        return round_target(mesh, choice or BodyChoice(), place)
    layout, findings = _laid(mesh, holes)
    if place is not None:
        placement, stiffness = _placed_before(place, name)
        surface = layout.surface(placement, stiffness)
    else:
        surface = layout.surface(_placement(layout, region, rotate))
    free = place is None and region is None and rotate is None
    return replace(surface, findings=findings, free=free)


def _placement(layout: MeshChart, region: Region | None, rotate: float | None) -> GridPlacement:
    if region is not None:
        angle = rotate or 0.0
        return GridPlacement(angle, region.domain(turned(layout.flat, angle)))
    if rotate is not None:
        domain = largest_rectangle(turned(layout.flat, rotate), layout.faces)
        if domain is None:
            raise TargetError(f"{layout.name}: no rectangle fits into the mesh at this `rotate`.")
        return GridPlacement(rotate, domain)
    candidates = placements(layout.vertices, layout.flat, layout.faces)
    # a rectangle of lattice points may reach a little over a ragged border
    for part in (1.0, 0.95, 0.9):
        for _, candidate in candidates:
            shrunk = candidate.shrunk(part)
            if covered(turned(layout.flat, shrunk.angle), layout.faces, shrunk.domain):
                return shrunk
    raise TargetError(f"{layout.name}: no rectangle fits into the mesh; it is too narrow.")


def _placed_before(place: Mapping[str, Any], name: str) -> tuple[GridPlacement, float]:
    try:
        u0, u1, v0, v1 = (float(value) for value in place["rectangle"])
        angle, stiffness = math.radians(place["rotate"]), float(place["stiffness"])
    except (KeyError, TypeError, ValueError):
        raise TargetError(f"{name}: the pattern's note of the rectangle is damaged.") from None
    if not (u0 < u1 and v0 < v1 and math.isfinite(angle) and 0 <= stiffness < math.inf):
        raise TargetError(f"{name}: the pattern's note of the rectangle is damaged.")
    return GridPlacement(angle, Domain(u0, u1, v0, v1)), stiffness


def lay_out(vertices: Floats, faces: Ints, name: str) -> tuple[MeshChart, tuple[Finding, ...]]:
    """The mesh laid flat, and findings on it. Raises ``TargetError`` if it is not one disk."""
    return _laid(prepare(vertices, faces, name), "small")


def _laid(mesh: PreparedMesh, holes: Holes) -> tuple[MeshChart, tuple[Finding, ...]]:
    """The chart of a mesh, and findings on it."""
    refuse_other_than_a_disk(mesh)
    name = mesh.name
    whole = mesh.vertices, mesh.faces
    topology = mesh.topology
    vertices, faces = decimated(*whole, LAID_FLAT) if len(mesh.faces) > LARGE else whole
    area = float(doubled_areas(vertices, faces).sum()) / 2
    vertices, faces = refine(vertices, faces, LONGEST * math.sqrt(area))
    if len(faces) != len(mesh.faces):
        topology = classify(vertices, faces)
    known, real = len(vertices), len(faces)
    vertices, faces, filled = fill_holes(vertices, faces, topology, name, holes)
    findings = mesh.findings + filled
    flat = flatten(vertices, faces)
    smoothed = _smoothed(vertices[:known], flat[:known], faces)
    edge = float(np.median(side_lengths(vertices, faces[:real])))
    rough = smoothed.roughness > ROUGH * edge
    if rough:
        even = np.asarray(smoothed.spline(flat), dtype=np.float64)
        if doubled_areas(even, faces).min() > 1e-6 * np.median(doubled_areas(even, faces)):
            flat = flatten(even, faces)
    chart = MeshChart(vertices, faces, whole, known, real, flat, rough, name, mesh.reading)
    return chart, findings


def _smoothed(points: Floats, flat: Floats, faces: Ints) -> Smoothed:
    low, high = flat.min(axis=0), flat.max(axis=0)
    domain = Domain(low[0], high[0], low[1], high[1])
    faces = faces[(faces < len(flat)).all(axis=1)]
    return smooth(flat, points, domain, spans(domain, median_edge(flat, faces), _ROUGH_SPANS))


def spans(domain: Domain, edge: float, most: int) -> tuple[int, int]:
    """Knots stand about one and a half edges apart, with at most ``most`` spans to a side."""
    step = max(1.5 * edge, max(domain.width, domain.height) / most)
    return max(math.ceil(domain.width / step), 4), max(math.ceil(domain.height / step), 4)


def _within(places: Floats, points: Floats, domain: Domain) -> tuple[Floats, Floats]:
    low, high = np.array([domain.u0, domain.v0]), np.array([domain.u1, domain.v1])
    inside = ((places >= low) & (places <= high)).all(axis=1)
    return places[inside], points[inside]


def median_edge(points: Floats, faces: Ints) -> float:
    return float(np.median(side_lengths(points, faces)))
