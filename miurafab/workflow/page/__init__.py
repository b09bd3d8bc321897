"""The preview as one HTML file: the sheets move by move, the pattern flat and folded in space.

The page is self-contained. Its script and style are inline, and its Content-Security-Policy allows
only their hashes, so that the page cannot load anything from a network.
Coordinates travel as 16-bit fractions of their bounding box (400 mm: 6 µm), in base64.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import InputError, shown
from miurafab.files import write_text
from miurafab.gcode.program import strokes
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import ASSIGNMENTS, CreasePattern
from miurafab.origami.folding.contact import triangulate
from miurafab.origami.folding.layers_apart import CLOSED
from miurafab.version import __version__
from miurafab.workflow.dry_run import LAYERS, SheetPreview, at_work, clock_text, length_text

if TYPE_CHECKING:
    from miurafab.fabrication.mates import SeamTab
    from miurafab.workflow.preview import Preview

SCENE = ("viewer.js", "space.js", "shaders.js", "scene.js")
"""The scripts that draw a sheet in space, in their order; they know nothing of the rest."""

_SCRIPTS = (*SCENE, "sheets.js", "plates.js", "flat.js", "chart.js", "fold.js", "page.js")
_SEAM = "S"
"""What the page calls a border that is glued to another."""
_STEPS = 65535
_HALF_TURN = 16383
"""A fold angle of 180 degrees, on the page."""
_BEGINS_STROKE = np.uint8(128)
"""Added to the layer of the first move of each stroke."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve beside the slider: ``values`` (T,) over ``places`` (T,), by default over the frames.

    ``title`` says what it is, ``top`` is the text at its highest point and ``bottom`` at its end.
    """

    title: str
    values: Floats
    top: str
    places: Floats | None = None
    bottom: str = ""


@dataclass(frozen=True, eq=False)
class Slider:
    """The slider of a motion of T frames.

    Attributes
    ----------
    names : tuple of str
        A name for each frame, or none.
    start : int
        The first frame that is shown.
    fold_angles : (T, E) float64, optional
        Radians, valleys positive.
    strain : (T, F) float64, optional
        Of the facets, None if they stay flat; they have its colours from the start if
        ``show_strain``.
    shifts : (F, 3) float64, optional
        How far the facets of the last frame move when the layers stand apart, mm.
    curve : Curve, optional
        The energy of the facets, or the force.
    word : str
        What the slider does.
    thickness_mm : float
        The thickness with which facets are drawn at first. 0 is paper.
    """

    names: tuple[str, ...] = ()
    start: int = 0
    fold_angles: Floats | None = None
    strain: Floats | None = None
    show_strain: bool = False
    shifts: Floats | None = None
    curve: Curve | None = None
    word: str = "Folding"
    thickness_mm: float = 0.0


def write_page(
    path: Path,
    *,
    title: str,
    preview: Preview | None = None,
    pattern: CreasePattern | None = None,
    motion: Floats | None = None,
    slider: Slider | None = None,
) -> None:
    """Write the page of a ``preview``, of a ``pattern``, or of both, to ``path``.

    ``motion`` (T, V, 3) float64 in mm has the vertices of ``pattern`` in T frames of a folding
    motion; it adds a slider through these frames, with the data of ``slider``. Without a motion the
    page shows the flat and the folded form only. The same input gives the same bytes.
    """
    text = page_text(title, preview, pattern, motion, slider)
    write_text(path, text)


def page_text(
    title: str,
    preview: Preview | None = None,
    pattern: CreasePattern | None = None,
    motion: Floats | None = None,
    slider: Slider | None = None,
) -> str:
    """The text of the page that :func:`write_page` writes."""
    if motion is not None and (pattern is None or not len(motion)):
        raise InputError("A folding motion can be shown with its pattern and at least one frame.")
    files = resources.files(__name__)
    script = "".join(files.joinpath(name).read_text(encoding="utf-8") for name in _SCRIPTS)
    script = f'"use strict";\n(() => {{\n{script}}})();\n'
    style = files.joinpath("page.css").read_text(encoding="utf-8")
    fill = {
        "policy": (
            f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; "
            "base-uri 'none'; form-action 'none'"
        ),
        "title": html.escape(shown(title)) or "Origami",
        "style": style,
        "data": _json(_data(preview, pattern, motion, slider or Slider())),
        "script": script,
    }
    template = files.joinpath("page.html").read_text(encoding="utf-8")
    return re.sub("@([a-z]+)@", lambda found: fill[found[1]], template)


def _hash(text: str) -> str:
    digest = base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
    return f"'sha256-{digest}'"


def _json(data: dict[str, Any]) -> str:
    """JSON that cannot end the element it stands in."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _data(
    preview: Preview | None, pattern: CreasePattern | None, motion: Floats | None, slider: Slider
) -> dict[str, Any]:
    facts = {}
    if preview is not None:
        facts["Sheets"] = f"{len(preview.sheets)}"
        facts["Machine time"] = clock_text(preview.seconds)
        working = sum(sheet.beam_on_seconds for sheet in preview.sheets)
        facts[at_work(preview.machine).capitalize()] = clock_text(working)
        facts["Drawn"] = length_text(sum(sheet.cut_mm for sheet in preview.sheets))
        facts["Travel"] = length_text(sum(sheet.travel_mm for sheet in preview.sheets))
    if pattern is not None:
        facts["Facets"] = f"{len(pattern.faces_vertices):,}"
        folding = np.isin(pattern.edges_assignment, ("M", "V"))
        facts["Creases"] = f"{int(folding.sum()):,}"
    return {
        "machine": None if preview is None else preview.machine.title,
        "facts": facts,
        "findings": [] if preview is None else [str(finding) for finding in preview.findings],
        "layers": [
            {"name": layer.title, "colour": layer.colour, "travel": layer.name == "travel"}
            for layer in LAYERS
        ],
        "sheets": [] if preview is None else [_sheet(preview, sheet) for sheet in preview.sheets],
        "tabs": [] if preview is None else [_tab(tab) for tab in preview.tabs],
        "fold": None if pattern is None else _fold(pattern, motion, slider),
        "made_by": f"Made by miurafab {__version__}",
    }


def _sheet(preview: Preview, sheet: SheetPreview) -> dict[str, Any]:
    program = sheet.program
    track = np.concatenate([program.start[:1, :2], program.end[:, :2]])
    box, packed = _packed(track if len(track) else np.zeros((1, 2)))
    bed = preview.machine.bed
    layers = sheet.layer.astype(np.uint8)
    layers[strokes(program).first_move] |= _BEGINS_STROKE
    return {
        "name": sheet.name,
        **sheet.figures(),
        "bounds": sheet.bounds_mm,
        "warnings": sheet.warnings,
        "paper": sheet.paper_mm,
        "bed": (bed.width_mm, bed.height_mm, bed.margin_mm),
        "view": sheet.view_mm,
        "lengths": [round(length, 3) for length in sheet.layer_mm],
        "box": box,
        "points": packed,
        "layers": _base64(layers, np.uint8),
        "ends": _base64(sheet.end_seconds, np.float32),
    }


def _tab(tab: SeamTab) -> dict[str, Any]:
    """A tab and its mate, in mm to 1 µm."""
    mate = tab.mate_mm
    return {
        "number": tab.number,
        "label": tab.label,
        "patch": tab.patch,
        "sheet": tab.sheet,
        "polygon": tab.polygon_mm.round(3).ravel().tolist(),
        "matePatch": tab.mate_patch,
        "mateSheet": tab.mate_sheet,
        "mate": None if mate is None else mate.round(3).ravel().tolist(),
    }


def _fold(pattern: CreasePattern, motion: Floats | None, slider: Slider) -> dict[str, Any]:
    letters = pattern.edges_assignment.copy()
    if pattern.seams is not None:
        letters[pattern.seams] = _SEAM
    assignments = [letter for letter in (*ASSIGNMENTS, _SEAM) if np.any(letters == letter)]
    kinds = np.array([assignments.index(letter) for letter in letters.tolist()])
    ends = pattern.vertices_coords[pattern.edges_vertices]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    lengths[letters == _SEAM] /= 2  # each seam has two sides
    triangles, owners = triangulate(pattern.faces_vertices, pattern.vertices_coords)
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    forms = [_form("Flat", flat[None], flat=True)]
    if pattern.folded_coords is not None:
        forms.append(_form("Folded", pattern.folded_coords[None], pattern.edges_fold_angle[None]))
    if motion is not None:
        forms.append(_form("Motion", motion, slider.fold_angles))
    return {
        "assignments": assignments,
        "lengths": np.bincount(kinds, lengths, len(assignments)).round(3).tolist(),
        "kinds": _base64(kinds, np.uint8),
        "edges": _base64(pattern.edges_vertices, np.uint32),
        "triangles": _base64(triangles, np.uint32),
        "owners": _base64(owners, np.uint32),
        "forms": forms,
        "first": len(forms) - 1,
        "names": slider.names,
        "start": slider.start,
        "word": slider.word,
        "rigid": motion is not None and slider.strain is None,
        "strain": _strain(slider),
        "layers": _layers(slider),
        "curve": _curve(slider),
        "thickness": slider.thickness_mm,
    }


def _strain(slider: Slider) -> dict[str, Any] | None:
    """Strains in 65535ths of the greatest."""
    if slider.strain is None:
        return None
    most = float(slider.strain.max())
    values = np.rint(slider.strain / (most or 1.0) * _STEPS)
    return {"most": most, "shown": slider.show_strain, "values": _base64(values, np.uint16)}


def _curve(slider: Slider) -> dict[str, Any] | None:
    curve = slider.curve
    if curve is None:
        return None

    def short(numbers: Floats) -> list[float]:
        return [float(f"{number:.5g}") for number in numbers.tolist()]

    return {
        "title": curve.title,
        "top": curve.top,
        "bottom": curve.bottom,
        "values": short(curve.values),
        "places": None if curve.places is None else short(curve.places),
    }


def _layers(slider: Slider) -> dict[str, Any] | None:
    """How far each facet moves along one direction when the layers stand apart."""
    if slider.shifts is None:
        return None
    farthest = slider.shifts[int(np.argmax(np.abs(slider.shifts).sum(axis=1)))]
    along = farthest / (np.linalg.norm(farthest) or 1.0)
    shifts = slider.shifts @ along
    return {
        "closed": CLOSED,
        "along": along.round(6).tolist(),
        "shifts": _base64(shifts, np.float32),
        "height": float(np.ptp(shifts)),
        "levels": len(np.unique(shifts.round(6))),
    }


def _form(
    name: str, frames: Floats, angles: Floats | None = None, *, flat: bool = False
) -> dict[str, Any]:
    box, packed = _packed(frames.reshape(-1, 3))
    turned = None if angles is None else np.rint(angles / np.pi * _HALF_TURN)
    return {
        "name": name,
        "flat": flat,
        "frames": len(frames),
        "box": box,
        "points": packed,
        "angles": None if turned is None else _base64(turned, np.int16),
    }


def _packed(points: Floats) -> tuple[list[float], str]:
    """Points (n, d) as a box [low..., size...] and 16-bit fractions of it."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    steps = np.rint((points - low) / np.where(size > 0, size, 1.0) * _STEPS)
    return [*low.round(6).tolist(), *size.round(6).tolist()], _base64(steps, np.uint16)


def _base64(array: NDArray[Any], kind: type[np.generic]) -> str:
    little = np.ascontiguousarray(array, dtype=np.dtype(kind).newbyteorder("<"))
    return base64.b64encode(little.tobytes()).decode("ascii")
