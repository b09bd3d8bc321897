"""The audit: every invariant of a pattern recomputed from the file alone, and what it means.

:func:`measure` gives the numbers under the names of the fit report; :func:`audit` adds coded
findings. A finding says what is wrong and where; it mends nothing.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.geometry.distances import closest_on_mesh
from miurafab.origami import invariants
from miurafab.origami.collisions import overlaps, self_intersections, triangulate
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.surfaces.surface import TargetSurface, tangents

Floats = NDArray[np.float64]

EXACT = 1e-10
"""The residual up to which planarity, developability and isometry count as exact."""

DEGENERATE = 1e-6
"""An edge shorter than this part of the mean edge cannot be creased."""


@dataclass(frozen=True)
class Measurements:
    """The numbers of the fit report; None where they need a folded form or a target not there.

    Angles in radians, lengths in mm; the docstrings of :mod:`~miurafab.origami.invariants` define
    each. ``hausdorff_mm`` is the greater of the farthest sheet point from the target and the
    farthest target point from the sheet; ``hausdorff_midsurface_mm`` the farthest facet mean from
    the target; ``area_ratio`` the paper's area over the target's.
    """

    facets: int
    vertices: int
    min_edge_mm: float
    overlaps: int
    max_planarity: float | None = None
    max_developability: float | None = None
    max_flat_foldability: float | None = None
    max_isometry: float | None = None
    self_intersections: int | None = None
    hausdorff_mm: float | None = None
    hausdorff_relative: float | None = None
    hausdorff_midsurface_mm: float | None = None
    area_ratio: float | None = None


@dataclass(frozen=True)
class AuditFinding:
    """One fault: a stable ``code``, a sentence, and the ``where`` (facets, vertices or edges)."""

    code: str
    message: str
    where: tuple[int, ...] = ()


@dataclass(frozen=True)
class Audit:
    """What an audit found; ``valid`` when nothing is wrong."""

    measurements: Measurements
    findings: tuple[AuditFinding, ...]
    seconds: float

    @property
    def valid(self) -> bool:
        return not self.findings

    def report(self) -> dict[str, Any]:
        """The report of ``miurafab check``, under the names of the fit report."""
        numbers = {f.name: getattr(self.measurements, f.name) for f in fields(self.measurements)}
        return {
            "status": "converged" if self.valid else "invalid",
            "advice": " ".join(finding.message for finding in self.findings),
            **numbers,
            "iterations": None,
            "seconds": self.seconds,
            "findings": [
                {"code": f.code, "message": f.message, "where": list(f.where)}
                for f in self.findings
            ],
        }


def audit(pattern: CreasePattern, surface: TargetSurface | None = None) -> Audit:
    """Measure ``pattern`` against its invariants and, if given, against its target ``surface``.

    ``surface`` is the target in its own frame; the pattern's ``scale`` is applied to it.
    """
    started = time.perf_counter()
    measured = measure(pattern, surface)
    findings = tuple(_findings(pattern, measured))
    return Audit(measured, findings, time.perf_counter() - started)


def measure(pattern: CreasePattern, surface: TargetSurface | None = None) -> Measurements:
    """The numbers alone."""
    facets, vertices = len(pattern.faces_vertices), len(pattern.vertices_coords)
    folded = pattern.folded_coords
    flat_edges = invariants.edge_lengths(pattern, pattern.vertices_coords)
    covered = len(overlaps(pattern))
    if folded is None:
        return Measurements(facets, vertices, float(flat_edges.min()), covered)
    ring = invariants.corner_ring(pattern, folded)
    inner = invariants.interior_vertices(pattern)
    distances = {} if surface is None else _distances(pattern, surface)
    shortest = min(flat_edges.min(), invariants.edge_lengths(pattern, folded).min())
    measured = Measurements(
        facets,
        vertices,
        float(shortest),
        covered,
        max_planarity=float(invariants.facet_planarity(pattern, folded).max()),
        max_developability=_largest(invariants.angle_surplus(ring, inner)) if len(inner) else 0.0,
        max_flat_foldability=(
            _largest(invariants.kawasaki_residual(ring, inner)) if len(inner) else 0.0
        ),
        max_isometry=float(invariants.isometry(pattern).max()),
        self_intersections=len(self_intersections(pattern)),
    )
    return replace(measured, **distances)


def _largest(values: Floats) -> float:
    return float(np.abs(values).max())


def _distances(pattern: CreasePattern, surface: TargetSurface) -> dict[str, Any]:
    """Distances sheet to target both ways, in mm, and the area ratio."""
    assert pattern.folded_coords is not None
    scale, folded = pattern.scale, pattern.folded_coords
    triangles, _ = triangulate(pattern.faces_vertices)
    corners = folded[triangles]
    sheet = np.concatenate([folded, _within(corners)])
    middle = _facet_means(pattern)

    def to_target(points: Floats) -> float:
        gap = surface.closest_point(points / scale) * scale - points
        return float(np.linalg.norm(gap, axis=1).max())

    count = int(np.clip(2 * np.sqrt(len(pattern.faces_vertices)), 40, 400))
    lattice = surface.domain.lattice(count, count)
    target = surface.point(lattice).reshape(-1, 3) * scale
    back = np.linalg.norm(closest_on_mesh(target, corners) - target, axis=1).max()
    hausdorff = max(to_target(sheet), float(back))
    diagonal = float(np.linalg.norm(folded.max(axis=0) - folded.min(axis=0)))
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    paper = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    return {
        "hausdorff_mm": hausdorff,
        "hausdorff_relative": hausdorff / diagonal,
        "hausdorff_midsurface_mm": to_target(middle),
        "area_ratio": paper / (surface_area(surface) * scale**2),
    }


def surface_area(surface: TargetSurface, samples: int = 200) -> float:
    """The area of the target over its domain by the midpoint rule, in its own unit squared."""
    d = surface.domain
    u = d.u0 + (np.arange(samples) + 0.5) * d.width / samples
    v = d.v0 + (np.arange(samples) + 0.5) * d.height / samples
    along, across = tangents(surface, np.stack(np.meshgrid(u, v), axis=-1))
    density = np.linalg.norm(np.cross(along, across), axis=-1)
    return float(density.mean() * d.width * d.height)


def _within(corners: Floats) -> Floats:
    """Points inside triangles (T, 3, 3): the centroid and the middles of the sides."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.concatenate([(a + b + c) / 3, (a + b) / 2, (b + c) / 2, (c + a) / 2])


def _facet_means(pattern: CreasePattern) -> Floats:
    assert pattern.folded_coords is not None
    real = pattern.faces_vertices >= 0
    corners = np.where(real[..., None], pattern.folded_coords[pattern.faces_vertices], 0.0)
    means: Floats = corners.sum(axis=1) / real.sum(axis=1)[:, None]
    return means


def _findings(pattern: CreasePattern, measured: Measurements) -> list[AuditFinding]:
    found = []
    edges = invariants.edge_lengths(pattern, pattern.vertices_coords)
    short = np.flatnonzero(edges < DEGENERATE * edges.mean())
    if len(short):
        found.append(
            AuditFinding(
                "degenerate-edge",
                f"{len(short)} edges are shorter than a millionth of the mean edge, the first "
                f"being edge {short[0]} ({edges[short[0]]:.1e} mm): they cannot be made. "
                "Fit again with --min-edge.",
                tuple(short.tolist()),
            )
        )
    if measured.overlaps:
        pairs = overlaps(pattern)
        found.append(
            AuditFinding(
                "overlap",
                f"{len(pairs)} pairs of facets overlap in the flat pattern, the first being facets "
                f"{pairs[0][0]} and {pairs[0][1]}: it cannot be cut from one sheet.",
                tuple(np.unique(pairs).tolist()),
            )
        )
    if pattern.folded_coords is None:
        return found
    exact = (
        ("planarity", measured.max_planarity, "The facets are not planar"),
        ("developability", measured.max_developability, "The vertices are not developable"),
        ("isometry", measured.max_isometry, "Flat and folded form differ in size"),
    )
    for code, value, complaint in exact:
        if value is None or not value <= EXACT:
            found.append(AuditFinding(code, f"{complaint}: {value:.1e} is over {EXACT:.0e}."))
    if measured.self_intersections:
        pairs = self_intersections(pattern)
        found.append(
            AuditFinding(
                "self-intersection",
                f"{len(pairs)} pairs of facets pass through each other in the folded form, the "
                f"first being facets {pairs[0][0]} and {pairs[0][1]}.",
                tuple(np.unique(pairs).tolist()),
            )
        )
    return found
