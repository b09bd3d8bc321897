"""Thick panels as a function: how they are made, and what is told of them.

Tapered panels keep the hinges in the middle of the thickness and are cut back on one side of each
crease. Plates keep their outlines, and their hinges are shifted onto brackets (Bennett linkages).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from miurafab.options import Choice, length, read_value
from miurafab.options.verbs import verb
from miurafab.origami.folding.plate_patch import PlatePatch
from miurafab.origami.folding.plates import ThickPlates, thick_plates
from miurafab.origami.folding.thick_panels import ThickPanels
from miurafab.origami.folding.thick_panels import thick_panels as make_panels
from miurafab.origami.formats.panel_parts import panel_parts
from miurafab.workflow.fold_options import METHODS
from miurafab.workflow.patterns import PatternLike, consistent_pattern

"""How panels make room for their thickness."""


@verb
def thick_panels(
    pattern: PatternLike,
    thickness: float,
    *,
    method: str = "tapered",
    on_progress: Callable[[float, str], None] | None = None,
) -> ThickPanels | ThickPlates:
    """Compute how panels have to be made so that they fold as a pattern does.

    Parameters
    ----------
    pattern : CreasePattern, FitResult, str or os.PathLike
        A pattern that folds rigidly, or a file that :func:`load` reads.
    thickness : float
        The thickness of the panels, mm.
    method : {"tapered", "bennett"}
        Panels that are cut back beside their creases, or plates of one thickness on shifted hinges,
        for sheets that are exactly flat-foldable.
    on_progress : callable, optional
        Called with a fraction in 0..1 and a short text.

    Returns
    -------
    ThickPanels or ThickPlates
        ``.save("panels.dxf")`` writes what is cut or printed.

    Raises
    ------
    InputError
        For a sheet that does not fold rigidly.
    PatternError
        For plates on shifted hinges that no heights of the hinges allow.
    OptionError
        For a thickness that is not positive, and for another method.

    Examples
    --------
    >>> import miurafab as mf
    >>> sheet = mf.fit("plane", facets=(4, 4), flat_foldable="exact")
    >>> mf.thick_panels(sheet, "0.5mm").thickness_mm
    0.5
    >>> mf.thick_panels(sheet, "4mm", method="bennett")
    <ThickPlates 4 mm plates in one mechanism, clear up to 180 degrees>
    """
    panel_mm = read_value("thickness", length(above=True), thickness)
    chosen = read_value("method", Choice(METHODS), method)
    found = consistent_pattern(pattern)
    if chosen == "bennett":
        return thick_plates(found, panel_mm, on_progress)
    return make_panels(found, panel_mm, on_progress)


def thickness_report(panels: ThickPanels | ThickPlates) -> dict[str, Any]:
    """The part of the JSON answer of ``fold`` about thick panels."""
    if isinstance(panels, ThickPlates):
        return {
            "method": "bennett",
            "thickness_mm": panels.thickness_mm,
            "folds": panels.folds,
            "facets_too_small": _too_small(panels),
            "patches": [_patch_report(patch) for patch in panels.patches],
            "seams": [
                {
                    "patch": seam.patch,
                    "between": list(seam.blocks),
                    "hinges": list(seam.hinges),
                    "slits": list(seam.slits),
                    "opens_mm": seam.opens_mm,
                }
                for seam in panels.seams
            ],
            "parts": _parts(panels),
        }
    pattern = panels.pattern
    creases = np.flatnonzero(panels.closing_side != "")
    finite = panels.offset_mm[creases][np.isfinite(panels.offset_mm[creases])]
    useful = panels.useful
    folding = np.abs(pattern.edges_fold_angle[pattern.edges_fold_angle != 0])
    median = float(np.median(folding)) if len(folding) else 0.0
    return {
        "method": "tapered",
        "thickness_mm": panels.thickness_mm,
        "folds": panels.folds,
        "usable": panels.usable,
        "least_useful_area": float(useful.min()),
        "mean_useful_area": float(useful.mean()),
        "least_scale": panels.least_scale,
        "greatest_thickness_mm": float(panels.limit_mm.min()),
        "max_offset_mm": float(finite.max(initial=0.0)),
        "facets_too_small": _too_small(panels),
        "collisions": [
            {
                "state": state,
                "median_fold_deg": math.degrees(2 * math.atan(state * math.tan(median / 2))),
                "facets": [one, other],
            }
            for state, one, other in panels.collisions
        ],
        "creases": [
            {
                "edge": int(edge),
                "assignment": str(pattern.edges_assignment[edge]),
                "fold_deg": math.degrees(pattern.edges_fold_angle[edge]),
                "closing_side": str(panels.closing_side[edge]),
                "hinge": "middle",
                "offset_mm": float(panels.offset_mm[edge]),
            }
            for edge in creases
        ],
        "parts": _parts(panels),
    }


def _too_small(panels: ThickPanels | ThickPlates) -> list[dict[str, Any]]:
    return [
        {"facet": int(facet), "greatest_thickness_mm": float(panels.limit_mm[facet])}
        for facet in panels.too_small
    ]


def _parts(panels: ThickPanels | ThickPlates) -> list[dict[str, Any]]:
    """The parts in the order in which they are the patches of a layout; none where facets are too
    small.
    """
    if len(panels.too_small):
        return []
    return [
        {"patch": f"P{number}", "name": part.name, "facet": part.facet, "edge": part.edge}
        for number, part in enumerate(panel_parts(panels), 1)
    ]


def _patch_report(patch: PlatePatch) -> dict[str, Any]:
    tape = {edge: float(np.linalg.norm(line[1] - line[0])) for edge, line in patch.tapes}
    return {
        "range_mm": patch.range_mm,
        "tape_width_mm": patch.tape_width_mm,
        "clear_deg": patch.clear_deg,
        "clear_state": patch.clear_state,
        "collision": None if patch.collision is None else list(patch.collision),
        "facets": [
            {"facet": int(facet), "bottom_mm": float(bottom)}
            for facet, bottom in zip(patch.facets, patch.bottom_mm, strict=True)
        ],
        "creases": [
            {
                "edge": int(patch.edges[edge]),
                "assignment": str(patch.pattern.edges_assignment[edge]),
                "axis_mm": float(patch.axis_mm[edge]),
                "tape_mm": tape[edge],
            }
            for edge in patch.edges_inner.tolist()
        ],
        "brackets": [
            {
                "edge": int(patch.edges[each.edge]),
                "facet": int(patch.facets[each.facet]),
                "low_mm": each.low,
                "high_mm": each.high,
            }
            for each in patch.brackets
        ],
    }
