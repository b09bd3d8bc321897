"""The figures of a report as lines for a person, each with what it means.

A line has a name, a value, a remark and a mark: ``good``, ``bad``, or none for a matter of taste.
A residual within rounding is shown as "exact"; the report itself has every digit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from miurafab.origami.invariants import EXACT
from miurafab.workflow.dry_run import clock_text, length_text

HEADLINES = {
    "converged": "The sheet fits and folds from flat paper.",
    "infeasible": "A sheet was found, but it is not valid.",
    "stalled": "No sheet was found.",
    "interrupted": "The search was interrupted; this is the best sheet up to then.",
    "invalid": "This pattern has faults.",
}


@dataclass(frozen=True)
class ReportLine:
    """One figure in words."""

    name: str
    value: str
    remark: str = ""
    mark: str = ""


def headline(status: str, *, opened: bool = False) -> str:
    """One sentence on the whole pattern."""
    if opened and status == "converged":
        return "This pattern is sound."
    return HEADLINES.get(status, status)


def pattern_lines(report: Mapping[str, Any], *, whole: bool = False) -> list[dict[str, str]]:
    """The lines of a fit report or of a check; figures that were not measured are left out.

    ``whole`` adds what helps to choose between sheets: coverage, angles, shapes and limits.
    """
    lines = [*_shape(report), *_exactness(report), *_clashes(report)]
    if report.get("min_edge_mm") is not None:
        lines.append(ReportLine("Shortest edge", _mm(report["min_edge_mm"])))
    if report.get("area_ratio") is not None:
        lines.append(ReportLine("Paper", f"{report['area_ratio']:.2f} times the target's area"))
    if report.get("facets") is not None:
        vertices = report.get("vertices") or 0
        lines.append(ReportLine("Facets", f"{report['facets']:,}", f"{vertices:,} vertices"))
    if (report.get("pieces") or 1) > 1:
        seam = report.get("seam_mm") or 0.0
        seams = f"{length_text(seam)} of seams" if seam else "without seams"
        lines.append(ReportLine("Pieces", f"{report['pieces']:,}", seams))
    if whole:
        lines += _quality(report)
    if report.get("seconds") is not None:
        lines.append(ReportLine("Computed in", f"{report['seconds']:.1f} s"))
    return [asdict(line) for line in lines]


def _quality(report: Mapping[str, Any]) -> list[ReportLine]:
    lines, quality = [], report.get("quality") or {}
    if report.get("coverage") is not None:
        lines.append(ReportLine("Covers", f"{100 * report['coverage']:.1f} % of the target"))
    if quality.get("edge_mm") is not None:
        lines.append(ReportLine("Median edge", _mm(quality["edge_mm"][1])))
    if quality.get("sector_angle_deg") is not None:
        least, most = quality["sector_angle_deg"]
        lines.append(ReportLine("Sector angles", f"{least:.1f}° to {most:.1f}°"))
    if quality.get("fold_angle_deg") is not None:
        median, _, most = quality["fold_angle_deg"]
        lines.append(ReportLine("Fold angles", f"up to {most:.0f}°", f"median {median:.0f}°"))
    if quality.get("facet_aspect") is not None:
        ratio = f"up to {quality['facet_aspect']:.2f} times as long as wide"
        lines.append(ReportLine("Facet shapes", ratio))
    if report.get("barrier") is not None:
        lines.append(ReportLine("Energy barrier", f"{report['barrier']:.3g} k_f L"))
    if report.get("active_bounds"):
        bounds = report["active_bounds"].items()
        held = "; ".join(f"limit of {name}, {count} times" for name, count in bounds)
        lines.append(ReportLine("Held back by", held))
    return lines


def _shape(report: Mapping[str, Any]) -> list[ReportLine]:
    lines = []
    middle, whole = report.get("hausdorff_midsurface_mm"), report.get("hausdorff_mm")
    if middle is not None:
        lines.append(ReportLine("Off the target", f"{_mm(middle)} at most", "the sheet's middle"))
    if whole is not None:
        part = report.get("hausdorff_relative")
        of_it = "" if part is None else f", {100 * part:.1f} % of the size"
        lines.append(
            ReportLine("With its folds", f"{_mm(whole)} at most", f"tips and grooves{of_it}")
        )
    return lines


def _exactness(report: Mapping[str, Any]) -> list[ReportLine]:
    names = {
        "max_planarity": ("Flat facets", ""),
        "max_developability": ("Folds from flat paper", " rad"),
        "max_isometry": ("Same lengths flat and folded", ""),
    }
    lines = []
    for key, (name, unit) in names.items():
        value = report.get(key)
        if value is not None:
            exact = value <= EXACT
            text = "exact" if exact else f"off by {value:.1g}{unit}"
            lines.append(ReportLine(name, text, f"{value:.0e}" if exact else "", _mark(exact)))
    kawasaki = report.get("max_flat_foldability")
    if kawasaki is not None:
        if kawasaki <= EXACT:
            lines.append(ReportLine("Folds flat", "exactly", "it also packs flat", "good"))
        else:
            off = f"{math.degrees(kawasaki):.2g}° off at the worst vertex"
            lines.append(ReportLine("Folds flat", "no", off))
    return lines


def _clashes(report: Mapping[str, Any]) -> list[ReportLine]:
    names = {"self_intersections": "Crossings when folded", "overlaps": "Overlaps when flat"}
    return [
        ReportLine(
            name, "none" if not report[key] else f"{report[key]:,}", mark=_mark(not report[key])
        )
        for key, name in names.items()
        if report.get(key) is not None
    ]


def layout_lines(totals: Mapping[str, Any]) -> list[dict[str, str]]:
    """The lines of a layout's totals."""
    density = f"{100 * totals['density']:.0f} % of their area used"
    lines = [ReportLine("Sheets", f"{totals['sheets']:,}", density)]
    if totals.get("seconds") is not None:
        lines.append(ReportLine("Machine time", clock_text(totals["seconds"]), "estimated"))
    lines += [
        ReportLine("Patches", f"{totals['patches']:,}"),
    ]
    on_seams = totals["tabs"] - totals["border_tabs"]
    if totals["patches"] > 1 or on_seams:
        lines.append(ReportLine("Seams", length_text(totals["seam_mm"]), f"{on_seams:,} tabs"))
    if totals["border_tabs"]:
        lines.append(ReportLine("On open borders", f"{totals['border_tabs']:,} tabs"))
    lines += [
        ReportLine("Cut", length_text(totals["cut_mm"])),
        ReportLine("Creases", length_text(totals["perforated_mm"]), "perforated or scored"),
        ReportLine("Travel", length_text(totals["travel_mm"]), "with the tool off"),
    ]
    return [asdict(line) for line in lines]


def _mm(value: float) -> str:
    return f"{value:.3g} mm" if value >= 1e-4 else "less than 0.0001 mm"


def _mark(good: bool) -> str:
    return "good" if good else "bad"
