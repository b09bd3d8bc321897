"""The audit: every invariant of a pattern, recomputed from the pattern alone.

:func:`measure` gives the numbers under the names of the fit report; :func:`audit` adds findings,
which say what is wrong and where. The pattern stays unchanged.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from miurafab.display import Shown
from miurafab.findings import Finding, findings_json, refusals
from miurafab.geometry.arrays import Floats
from miurafab.geometry.polygons import edge_lengths, facet_areas
from miurafab.origami.coverage import coverage
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.judge_pattern import (
    Evidence,
    gather,
    judge,
    judge_quality,
    proved,
)
from miurafab.origami.nearness import nearness
from miurafab.origami.quality import Quality, quality
from miurafab.surfaces.surface import TargetSurface


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
    coverage : float or None
        The share of the target's area that the sheet covers (:mod:`miurafab.origami.coverage`).
    overhang : float or None
        The share of the sheet that reaches beyond the border of the target.
    area_ratio : float or None
        The area of the paper over the area of the target that lies under it.
    pieces : int
        The number of flat pieces.
    seam_mm : float
        The length of all seams between pieces.
    quality : Quality or None
        Fold angles, sector angles, edges and proportions of the facets.
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
    coverage: float | None = None
    overhang: float | None = None
    area_ratio: float | None = None
    pieces: int = 1
    seam_mm: float = 0.0
    quality: Quality | None = None

    @classmethod
    def report(cls, measured: Measurements | None) -> dict[str, Any]:
        """The fields under the names of the fit report, each None where nothing was measured."""
        numbers = {f.name: getattr(measured, f.name, None) for f in fields(cls)}
        if measured is not None and measured.quality is not None:
            numbers["quality"] = measured.quality.as_json(measured.area_ratio)
        return numbers


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
    proved : tuple of str
        What was proved, in sentences; a finding ``not-proven`` says what was not.
    """

    measurements: Measurements
    findings: tuple[Finding, ...]
    seconds: float
    proved: tuple[str, ...] = ()

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
        return {
            "status": "converged" if self.valid else "invalid",
            "advice": " ".join(finding.sentence for finding in refusals(self.findings)),
            **Measurements.report(self.measurements),
            "iterations": None,
            "seconds": self.seconds,
            "proved": list(self.proved),
            "findings": findings_json(self.findings),
        }


def audit(pattern: CreasePattern, surface: TargetSurface | None = None) -> Audit:
    """Measure ``pattern`` against its invariants and, if given, against its target ``surface``.

    ``surface`` is the target in its own frame; the pattern's ``scale`` is applied to it.
    """
    started = time.perf_counter()
    evidence = gather(pattern)
    measured = _measured(pattern, surface, evidence)
    findings = (*judge(pattern, evidence), *judge_quality(measured, fitted=bool(pattern.target)))
    seconds = time.perf_counter() - started
    return Audit(measured, findings, seconds, proved(pattern, evidence, findings))


def measure(pattern: CreasePattern, surface: TargetSurface | None = None) -> Measurements:
    """The numbers alone."""
    return _measured(pattern, surface, gather(pattern))


def _measured(
    pattern: CreasePattern, surface: TargetSurface | None, evidence: Evidence
) -> Measurements:
    flat_edges = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    seams = pattern.seams
    measured = Measurements(
        len(pattern.faces_vertices),
        len(pattern.vertices_coords),
        float(flat_edges.min()),
        len(evidence.overlaps),
        pieces=pattern.pieces_count,
        seam_mm=0.0 if seams is None else float(flat_edges[seams[:, 0]].sum()),
    )
    found, folded = evidence.residuals, pattern.folded_coords
    if found is None or folded is None:
        return measured
    shortest = min(flat_edges.min(), edge_lengths(folded, pattern.edges_vertices).min())
    measured = replace(
        measured,
        min_edge_mm=float(shortest),
        max_planarity=float(found.planarity.max()),
        max_developability=float(found.developability.max(initial=0.0)),
        max_flat_foldability=float(found.flat_foldability.max(initial=0.0)),
        max_isometry=float(found.isometry.max()),
        self_intersections=len(evidence.crossings),
        quality=quality(pattern),
    )
    return measured if surface is None else with_distances(measured, pattern, surface)


def with_nearness(
    measured: Measurements,
    pattern: CreasePattern,
    surface: TargetSurface,
    tiles: Floats | None = None,
) -> Measurements:
    """``measured`` with the distances both ways between ``pattern`` and ``surface``, in mm.

    ``tiles`` are those of the surface, where they are at hand.
    """
    found = nearness(pattern, surface, surface.tiles() if tiles is None else tiles)
    return replace(
        measured,
        sheet_to_target_mm=found.sheet_to_target,
        target_to_sheet_mm=found.target_to_sheet,
        hausdorff_mm=found.hausdorff,
        hausdorff_relative=found.hausdorff / found.diagonal,
        hausdorff_midsurface_mm=found.means_to_target,
    )


def with_distances(
    measured: Measurements, pattern: CreasePattern, surface: TargetSurface
) -> Measurements:
    """``measured`` with the distances both ways between ``pattern`` and ``surface``, in mm, the
    shares of both that lie on each other, and the area ratio.
    """
    assert pattern.folded_coords is not None
    tiles = surface.tiles()
    if measured.hausdorff_mm is None:
        measured = with_nearness(measured, pattern, surface, tiles)
    cover = coverage(pattern, tiles)
    paper = float(facet_areas(pattern.folded_coords, pattern.faces_vertices).sum())
    return replace(
        measured,
        coverage=cover.covered,
        overhang=cover.overhang,
        area_ratio=paper / (cover.area * pattern.scale**2),
    )
