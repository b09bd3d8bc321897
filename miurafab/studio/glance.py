"""What is seen while a hand drags a slider: a coarse fit and its figures, in a few hundredths of a
second.

The sheet is that of :func:`~miurafab.origami.fitting.fit.coarse`: exact, but not polished. It has
the facets that were asked for, up to :data:`MOST`; of more it has so many in the same proportion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import miurafab
from miurafab.errors import LayoutError
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.plan_size import Sizing
from miurafab.findings import findings_json
from miurafab.options import read_options
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.fit import coarse
from miurafab.origami.fitting.request import BED, DEFAULT_SIZE_MM, FitRequest
from miurafab.origami.fitting.result import FitResult
from miurafab.origami.formats.fold import read_fold
from miurafab.profiles import MachineProfile, Material, read_machine, read_material
from miurafab.studio.bed_words import at_once, planned
from miurafab.surfaces.mesh_files import mesh_suffix
from miurafab.workflow.design import Design
from miurafab.workflow.report_text import headline, pattern_lines
from miurafab.workflow.scaling import ScaleOptions, scaled, size_of

MOST = 400
"""The facets of a coarse fit: 20 x 20 take 0.03 to 0.2 s on the built-in surfaces."""
_SHAPING = ("close", "region", "rotate", "poles", "polar_hole", "side", "holes", "pieces")
"""The options that decide how a mesh is read."""
_DRAWN = 0.01
"""The unit of the coordinates that the page draws, mm."""

Progress = Callable[[float, str], None]


class Glances:
    """Answers one question after another; keeps the last mesh as it was read. Mutable."""

    def __init__(self) -> None:
        self._read: tuple[object, Design | None] = (None, None)
        self._held: tuple[str, CreasePattern | None] = ("", None)

    def answer(self, asked: Mapping[str, Any], on_progress: Progress) -> dict[str, Any]:
        """What ``asked`` asks for, by its ``do``:

        - ``coarse``: the coarse fit of ``target`` with ``options``;
        - ``scale``: the pattern in ``file``, whose fit gave ``report``, at another ``size``;
        - ``plan``: the sheets that the pattern in ``file`` needs.

        ``layout`` has ``machine``, ``material`` and ``options``, or is None.

        Raises :class:`~miurafab.errors.MiurafabError` for what cannot be read.
        """
        if asked["do"] == "plan":
            return {"bed": _bed(self._pattern(asked["file"]), asked["layout"], planned)}
        if asked["do"] == "scale":
            return self._scaled(asked)
        return self._coarse(asked, on_progress)

    def _pattern(self, file: str) -> CreasePattern:
        if self._held[0] != file:
            self._held = file, read_fold(Path(file))
        assert self._held[1] is not None
        return self._held[1]

    def _scaled(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """A sheet is linear in its size, unless a limit in mm was asked for: so are its figures."""
        before = self._pattern(asked["file"])
        pattern = scaled(before, read_options(ScaleOptions, {"size": asked["size"]}))
        factor = size_of(pattern) / size_of(before)
        report = {
            name: value * factor if name.endswith("_mm") and value is not None else value
            for name, value in asked["report"].items()
        }
        return {
            "way": "scaled",
            "status": report["status"],
            "headline": headline(report["status"]),
            "advice": "",
            "lines": pattern_lines(report | {"seconds": None}),
            "findings": [],
            **_seen(pattern, asked["layout"]),
        }

    def _coarse(self, asked: Mapping[str, Any], on_progress: Progress) -> dict[str, Any]:
        wanted = self._design(asked["target"], asked["options"])
        request = _few(wanted.request)
        result = _sized(request, asked["layout"], on_progress)
        # the distance of the middle is that of the fit itself; nothing else was measured
        measured = {"hausdorff_midsurface_mm": result.deviation_mm, "seconds": None}
        told: dict[str, Any] = {
            "way": "coarse",
            "status": result.status,
            "headline": headline(result.status),
            "advice": result.advice,
            "lines": pattern_lines(result.report() | measured),
            "findings": findings_json(wanted.findings),
            "facets": [request.columns, request.rows],
            "fewer": request.facets != wanted.request.facets,
            "bed": None,
            "picture": None,
        }
        pattern = result.pattern
        if pattern is None or pattern.folded_coords is None or result.score is None:
            return told
        best = next(each for each in result.attempts if each.score == result.score.total)
        return told | {
            "amplitude": round(best.corrugation.amplitude, 3),
            **_seen(pattern, asked["layout"]),
        }

    def _design(self, target: str, options: Mapping[str, Any]) -> Design:
        if not mesh_suffix(Path(target)):
            return miurafab.design(target, **options)
        shaping = {name: options[name] for name in _SHAPING if name in options}
        key = target, tuple(shaping.items())
        if self._read[0] != key:
            self._read = key, miurafab.design(target, **shaping)
        read = self._read[1]
        rest = {n: value for n, value in options.items() if n not in shaping or n == "pieces"}
        return miurafab.design(read, **rest)


def _few(request: FitRequest) -> FitRequest:
    """``request`` with at most :data:`MOST` facets."""
    columns, rows = request.columns, request.rows
    if columns * rows <= MOST:
        return replace(request, facets=(columns, rows), barrier=None)
    share = math.sqrt(MOST / (columns * rows))
    few = max(2, int(share * columns)), max(2, 2 * int(share * rows / 2))
    return replace(request, facets=few, barrier=None, cut_columns=None)


def _sized(
    request: FitRequest, layout: Mapping[str, Any] | None, on_progress: Progress
) -> FitResult:
    """The coarse fit; where the bed decides the size, at the size of the closed form."""
    if request.size_mm != BED or layout is None:
        return coarse(replace(request, size_mm=request.side_mm), on_progress)
    first = coarse(replace(request, size_mm=DEFAULT_SIZE_MM), on_progress)
    if first.pattern is None:
        return first
    size = DEFAULT_SIZE_MM * Sizing(first.pattern, *_stock(layout)).bound()
    return coarse(replace(request, size_mm=math.floor(100 * size) / 100), on_progress)


def _stock(layout: Mapping[str, Any]) -> tuple[MachineProfile, Material, LayoutOptions]:
    return (
        read_machine(layout["machine"]),
        read_material(layout["material"]),
        read_options(LayoutOptions, layout["options"]),
    )


def _seen(pattern: CreasePattern, layout: Mapping[str, Any] | None) -> dict[str, Any]:
    """How large a pattern is, its picture, and what it needs of the bed."""
    folded = pattern.folded_coords
    assert folded is not None
    return {
        "box_mm": [round(side, 1) for side in np.ptp(folded, axis=0).tolist()],
        "bed": _bed(pattern, layout, at_once),
        "picture": picture(pattern),
    }


def _bed(
    pattern: CreasePattern, layout: Mapping[str, Any] | None, words: Callable[..., dict[str, Any]]
) -> dict[str, Any] | None:
    """What the pattern needs of the bed; None where it is not known what is cut from what."""
    if layout is None:
        return None
    try:
        return words(pattern, *_stock(layout))
    except LayoutError as fault:
        return {"title": "No place on the bed", "remark": fault.sentence, "mark": "more"}


def picture(pattern: CreasePattern) -> dict[str, Any]:
    """The folded form for the page to draw: ``points`` (3 V,) in hundredths of a millimetre about
    the middle of the form, ``faces`` as lists of vertices.
    """
    folded = pattern.folded_coords
    assert folded is not None
    middle = (folded.min(axis=0) + folded.max(axis=0)) / 2
    points = ((folded - middle) / _DRAWN).round().astype(int)
    faces = [[at for at in face if at >= 0] for face in pattern.faces_vertices.tolist()]
    return {"points": points.ravel().tolist(), "faces": faces}
