"""The audit: every invariant of a pattern, recomputed from the pattern alone.

:func:`measure` gives the numbers under the names of the fit report; :func:`audit` adds findings,
which say what is wrong and where. The pattern stays unchanged.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from miurafab.display import Shown
from miurafab.findings import Finding, findings_json, refusals
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami import invariants
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.contact import overlaps, self_intersections, triangulate
from miurafab.origami.nearness import nearness
from miurafab.surfaces.surface import TargetSurface, tangents

EXACT = 1e-10
"""The residual up to which planarity, developability and isometry count as exact."""

DEGENERATE = invariants.DEGENERATE


@dataclass(frozen=True, repr=False)
class Measurements(Shown):
    """The numbers of the fit report; None without the folded form or the target that they need.

    :mod:`~miurafab.origami.invariants` defines the residuals.

    Attributes
    ----------
    facets, vertices : int
        The numbers of facets and vertices.
    min_edge_mm : float
        The shortest edge.
    overlaps : int
        The pairs of facets that overlap in the flat pattern.
    max_planarity, max_developability, max_flat_foldability, max_isometry : float or None
        The largest residuals: angles in radians, the isometry relative to the length of the edge.
    self_intersections : int or None
        The pairs of facets that pass through each other in the folded form.
    sheet_to_target_mm, target_to_sheet_mm : float or None
        The largest distance of a point of the sheet from the whole target, and the reverse.
    hausdorff_mm : float or None
        The larger of the two.
    hausdorff_relative : float or None
        The same distance over the diagonal of the box around the folded form.
    hausdorff_midsurface_mm : float or None
        The largest distance of a facet mean from the target, mm.
    area_ratio : float or None
        The area of the paper over the area of the target.
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
    sheet_to_target_mm: float | None = None
    target_to_sheet_mm: float | None = None
    hausdorff_mm: float | None = None
    hausdorff_relative: float | None = None
    hausdorff_midsurface_mm: float | None = None
    area_ratio: float | None = None


@dataclass(frozen=True, repr=False)
class Audit(Shown):
    """The result of an audit.

    Parameters
    ----------
    measurements : Measurements
        Residuals and distances.
    findings : tuple of Finding
        What is wrong, each ``where`` being the indices of facets, vertices or edges; a note where
        the distances are left out.
    seconds : float
        The time that the audit took.
    """

    measurements: Measurements
    findings: tuple[Finding, ...]
    seconds: float

    @property
    def valid(self) -> bool:
        """Whether nothing is wrong."""
        return not refusals(self.findings)

    def _summary(self) -> str:
        if self.valid:
            return f"valid: {self.measurements.facets} facets"
        return f"invalid: {', '.join(finding.code for finding in refusals(self.findings))}"

    def _facts(self) -> Mapping[str, object]:
        return {"valid": self.valid, **vars(self.measurements)}

    def report(self) -> dict[str, Any]:
        """The report of ``miurafab check``, under the names of the fit report."""
        numbers = {f.name: getattr(self.measurements, f.name) for f in fields(self.measurements)}
        return {
            "status": "converged" if self.valid else "invalid",
            "advice": " ".join(finding.sentence for finding in refusals(self.findings)),
            **numbers,
            "iterations": None,
            "seconds": self.seconds,
            "findings": findings_json(self.findings),
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
    flat_edges = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    covered = len(overlaps(pattern))
    if folded is None:
        return Measurements(facets, vertices, float(flat_edges.min()), covered)
    ring = invariants.corner_ring(pattern, folded)
    inner = invariants.interior_vertices(pattern)
    shortest = min(flat_edges.min(), edge_lengths(folded, pattern.edges_vertices).min())
    measured = Measurements(
        facets,
        vertices,
        float(shortest),
        covered,
        max_planarity=float(invariants.facet_planarity(pattern, folded).max()),
        max_developability=_largest(invariants.angle_defect(ring, inner)) if len(inner) else 0.0,
        max_flat_foldability=(
            _largest(invariants.kawasaki_residual(ring, inner)) if len(inner) else 0.0
        ),
        max_isometry=float(invariants.isometry(pattern).max()),
        self_intersections=len(self_intersections(pattern)),
    )
    return measured if surface is None else with_distances(measured, pattern, surface)


def _largest(values: Floats) -> float:
    return float(np.abs(values).max())


def with_distances(
    measured: Measurements, pattern: CreasePattern, surface: TargetSurface
) -> Measurements:
    """``measured`` with the distances both ways between ``pattern`` and ``surface``, in mm, and the
    area ratio.
    """
    assert pattern.folded_coords is not None
    found = nearness(pattern, surface)
    a, b, c = pattern.folded_coords[triangulate(pattern.faces_vertices)[0]].transpose(1, 0, 2)
    paper = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    return replace(
        measured,
        sheet_to_target_mm=found.sheet_to_target,
        target_to_sheet_mm=found.target_to_sheet,
        hausdorff_mm=found.hausdorff,
        hausdorff_relative=found.hausdorff / found.diagonal,
        hausdorff_midsurface_mm=found.means_to_target,
        area_ratio=paper / (surface_area(surface) * pattern.scale**2),
    )


def surface_area(surface: TargetSurface, samples: int = 200) -> float:
    """The area of the target over its domain by the midpoint rule, in its own unit squared."""
    d = surface.domain
    u = d.u0 + (np.arange(samples) + 0.5) * d.width / samples
    v = d.v0 + (np.arange(samples) + 0.5) * d.height / samples
    along, across = tangents(surface, np.stack(np.meshgrid(u, v), axis=-1))
    density = np.linalg.norm(np.cross(along, across), axis=-1)
    return float(density.mean() * d.width * d.height)


def _findings(pattern: CreasePattern, measured: Measurements) -> list[Finding]:
    found = []
    edges = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    short = np.flatnonzero(edges < DEGENERATE * edges.mean())
    if len(short):
        found.append(
            Finding(
                "degenerate-edge",
                f"{_these(short, 'edge')} shorter than a millionth of the mean edge (down to "
                f"{edges[short].min():.1e} mm): they cannot be creased or cut, so the sheet cannot "
                "be made. Fit again with `min_edge`.",
                tuple(short.tolist()),
            )
        )
    if measured.overlaps:
        found.append(_overlap(pattern))
    gaps = invariants.seam_gaps(pattern)
    open_seams = np.flatnonzero(~(gaps <= EXACT))
    if len(open_seams):
        found.append(
            Finding(
                "seam",
                f"{_these(open_seams, 'seam')} not closed: the two edges differ by up to "
                f"{gaps[open_seams].max():.1e} mean edges in length or in place.",
                tuple(open_seams.tolist()),
            )
        )
    if pattern.folded_coords is None:
        return found
    found += _inexact(pattern, pattern.folded_coords)
    if measured.self_intersections:
        pairs = self_intersections(pattern)
        found.append(
            Finding(
                "self-intersection",
                f"{len(pairs)} pairs of facets pass through or lie on each other in the folded "
                f"form, the first being facets {pairs[0][0]} and {pairs[0][1]}.",
                tuple(np.unique(pairs).tolist()),
            )
        )
    return found


def _overlap(pattern: CreasePattern) -> Finding:
    pairs = overlaps(pattern)
    within = pairs
    if pattern.pieces is not None:
        within = pairs[pattern.pieces[pairs[:, 0]] == pattern.pieces[pairs[:, 1]]]
    (one, other), *_ = pairs if not len(within) else within
    if len(within):
        sentence = (
            f"{len(within)} pairs of facets overlap in the flat pattern, the first being facets "
            f"{one} and {other}: it cannot be cut from one piece."
        )
    else:
        sentence = (
            f"Pieces lie on each other in the flat pattern ({len(pairs)} pairs of facets, the "
            f"first being {one} and {other}): they have to lie apart."
        )
    return Finding("overlap", sentence, tuple(np.unique(pairs).tolist()))


def _inexact(pattern: CreasePattern, folded: Floats) -> list[Finding]:
    """Where planarity, developability and isometry are over ``EXACT``."""
    inner = invariants.interior_vertices(pattern)
    facets = np.arange(len(pattern.faces_vertices))
    ring = invariants.corner_ring(pattern, folded)
    defect = invariants.angle_defect(ring, inner) if len(inner) else np.empty(0)
    checks = (
        ("planarity", "planar", "facet", facets, invariants.facet_planarity(pattern, folded)),
        ("developability", "developable", "vertex", inner, np.abs(defect)),
        ("isometry", "the same flat and folded", "facet", facets, invariants.isometry(pattern)),
    )
    found = []
    for code, virtue, noun, names, values in checks:
        over = ~(values <= EXACT)
        if over.any():
            where = names[over]
            found.append(
                Finding(
                    code,
                    f"{_these(where, noun)} not {virtue}: up to {values.max():.1e}, over "
                    f"{EXACT:.0e}.",
                    tuple(where.tolist()),
                )
            )
    return found


def _these(numbers: Ints, noun: str) -> str:
    """``Edge 7 is`` or ``12 edges (3, 4, 5, 6, 7, ...) are``."""
    if len(numbers) == 1:
        return f"{noun.capitalize()} {numbers[0]} is"
    shown = ", ".join(str(n) for n in numbers[:5]) + (", ..." if len(numbers) > 5 else "")
    several = "vertices" if noun == "vertex" else noun + "s"
    return f"{len(numbers)} {several} ({shown}) are"
