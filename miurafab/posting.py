"""The one bridge between the towers: the strokes of a sheet become a job for one machine.

Nearly all lines of such a job look alike: ``G0`` to where a stroke starts, ``G1`` along it. So
the lines are one matrix of bytes, a row a line and a column range a field, filled by looking up
tables of digits; what a field leaves over is zero, and the zeros are struck out at the end.

What the words mean to the controller (gnea/grbl 1.1, doc/markdown/laser_mode.md; gcode.c):

* ``M4 S0`` once arms the laser: in laser mode (``$32=1``) it burns during ``G1`` only, scaled by
  the speed, and is dark in every ``G0`` and whenever motion stops. Each ``M3``, ``M4`` or ``M5``
  stops the motion, so there is none between the strokes.
* GRBL 0.9 has no laser mode: its spindle output stays on in ``G0``. There the beam is switched
  at both ends of each stroke, as a pen is lowered and lifted.
* A servo on the spindle output would be pulled up by laser mode in every ``G0``: pens need
  ``$32=0``. ``G4`` waits until the servo has come to rest.
* ``M2`` waits for the last move, then sets spindle, coolant and modal state to their defaults.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import LayoutError, ProfileError
from miurafab.fabrication.toolpath import Toolpath
from miurafab.gcode.job import Job
from miurafab.profiles import OPERATIONS, MachineProfile, Material

LINE_CHARS = 70
"""The longest line written, comments included."""
NO_PATCH = "-"
"""What ``(patch ...)`` says for strokes that belong to none."""

_GRBL = ("grbl-1.1", "grbl-0.9", "grblhal", "fluidnc")
_LASER_MODE_IS_SETTING_32 = ("grbl-1.1", "grblhal")
_COMMENT = re.compile(r"[ -~]*")
# Ends of comments, and what senders or controllers obey even inside one.
_NOT_IN_COMMENT = frozenset("()!?~;%")
_Bytes = NDArray[np.uint8]


def post(
    toolpath: Toolpath,
    machine: MachineProfile,
    material: Material,
    *,
    patch_labels: Mapping[int, str] | None = None,
) -> Job:
    """The G-code of ``toolpath`` for a GRBL laser or servo pen: mm, absolute, plain ASCII.

    Every stroke starts with a ``G0``; S and F stand where they change; coordinates are rounded to
    0.001 mm. ``(sheet ...)``, ``(operation ...)`` and ``(patch ...)`` stand on lines of their own
    before the strokes they hold for, the patch by its label in ``patch_labels``, else by its
    number. An operation of several passes repeats each run of strokes of one patch, so that
    the sheet cools between two passes over the same place. The job starts and ends dark.

    Raises :class:`~miurafab.errors.LayoutError` for a stroke that leaves the bed, has no length
    at 0.001 mm or is not finite, and for a name that cannot stand in a comment, and
    :class:`~miurafab.errors.ProfileError` for a machine that this cannot write for.
    """
    tool = _tool(machine, material)
    microns = _microns(toolpath, machine)
    runs = _runs(toolpath, [material.operations[name].passes for name in OPERATIONS])
    head = [
        _comment("sheet", toolpath.sheet),
        _comment("machine", machine.name),
        _comment("material", material.name),
        *(f"{word}\n" for word in ("M5", "G21", "G90", "G17", "G94", *tool.begin)),
    ]
    body = _body(runs, *_rows(toolpath, runs, microns, tool), patch_labels or {})
    foot = [f"{word}\n" for word in (*tool.end, "G0 X0 Y0", "M2")]
    return Job(toolpath.sheet, "".join([*head, *body, *foot]))


@dataclass(frozen=True)
class _Tool:
    """How the tool is used.

    ``begin`` and ``end``: the words before and after all strokes. ``down`` (by operation) and
    ``up``: what follows a stroke's ``G0`` and its last ``G1``. ``s`` and ``feed``: the words of
    each operation, ``s`` None where ``down`` sets it.
    """

    begin: tuple[str, ...]
    end: tuple[str, ...]
    down: tuple[str, ...]
    up: str
    s: tuple[int, ...] | None
    feed: tuple[str, ...]


def _tool(machine: MachineProfile, material: Material) -> _Tool:
    """How ``machine`` makes the operations of ``material``."""
    if machine.dialect not in _GRBL:
        raise ProfileError(
            f"{machine.name}: G-code is written for {', '.join(_GRBL)}, not for the dialect "
            f"'{machine.dialect}'; choose another machine."
        )
    if machine.tool.kind not in ("laser", "pen"):
        raise ProfileError(
            f"{machine.name}: G-code is written for a laser or a pen, not for a "
            f"{machine.tool.kind}; choose another machine."
        )
    tool = machine.tool
    operations = [material.operations[name] for name in OPERATIONS]
    feed = tuple(_trimmed(operation.feed_mm_min) for operation in operations)
    air_on, air_off = (("M8",), ("M9",)) if tool.air_assist else ((), ())
    if tool.kind == "pen":
        if machine.settings.get(32, 0) != 0:
            raise ProfileError(
                f'{machine.name}: "$32" = {machine.settings[32]:g} lifts a servo pen in every '
                'travel; write "$32" = 0 under [settings].'
            )
        settle = f"\nG4 P{_trimmed(tool.settle_s)}" if tool.settle_s > 0 else ""
        up, down = f"M3 S{tool.s_up}{settle}", f"\nM3 S{tool.s_down}{settle}"
        return _Tool((up, *air_on), ("M5", *air_off), (down,) * len(feed), "\n" + up, None, feed)
    s = tuple(machine.power_to_s(operation.power) for operation in operations)
    if machine.dialect == "grbl-0.9":
        if tool.beam_mode != "M3":
            raise ProfileError(
                f'{machine.name}: GRBL 0.9 has no M4 for lasers; write beam_mode = "M3" under '
                "[tool] if the beam may burn on wherever the job stops."
            )
        down_by_s = tuple(f"\nM3 S{value}" for value in s)
        return _Tool(air_on, ("M5", *air_off), down_by_s, "\nM5", None, feed)
    if machine.dialect in _LASER_MODE_IS_SETTING_32 and machine.settings.get(32) != 1:
        raise ProfileError(
            f"{machine.name}: without laser mode the beam would burn along every travel; write "
            '"$32" = 1 under [settings].'
        )
    arm = f"{tool.beam_mode} S0"
    return _Tool((arm, *air_on), ("M5", *air_off), ("",) * len(feed), "", s, feed)


@dataclass(frozen=True, eq=False)
class _Runs:
    """Strokes in the order made, cut into runs of one operation, patch and pass.

    ``order`` (T,) stroke indices, passes expanded; ``first`` (R,) where each run starts in it;
    ``operation``, ``patch``, ``number`` (1-based) and ``passes`` (R,).
    """

    order: NDArray[np.int64]
    first: NDArray[np.int64]
    operation: NDArray[np.int64]
    patch: NDArray[np.int64]
    number: NDArray[np.int64]
    passes: NDArray[np.int64]


def _runs(toolpath: Toolpath, passes_of_operation: Sequence[int]) -> _Runs:
    count = len(toolpath)
    change = np.ones(count, dtype=bool)
    change[1:] = (np.diff(toolpath.operation) != 0) | (np.diff(toolpath.patch) != 0)
    first = np.flatnonzero(change)
    size = np.diff(np.append(first, count))
    passes = np.asarray(passes_of_operation, dtype=np.int64)[toolpath.operation[first]]
    # Run r stands passes[r] times in a row; a stroke's index is its run's first plus its place.
    source = np.repeat(np.arange(len(first)), passes)
    number = np.arange(len(source)) - np.repeat(np.cumsum(passes) - passes, passes) + 1
    made = np.cumsum(size[source]) - size[source]
    total = int(size[source].sum())
    order = np.arange(total) + np.repeat(first[source] - made, size[source])
    return _Runs(
        order=order,
        first=made,
        operation=toolpath.operation[first][source],
        patch=toolpath.patch[first][source],
        number=number,
        passes=passes[source],
    )


def _microns(toolpath: Toolpath, machine: MachineProfile) -> NDArray[np.int64]:
    """(N, 2) the points in whole micrometres, all of them on the bed."""
    bed = np.array([machine.bed.width_mm, machine.bed.height_mm])
    micron = np.rint(np.where(np.isfinite(toolpath.points), toolpath.points, -1.0) * 1000.0)
    outside = ((micron < 0) | (micron > np.rint(bed * 1000.0))).any(axis=1)
    if outside.any():
        point = int(np.argmax(outside))
        stroke = int(np.searchsorted(toolpath.offsets, point, side="right")) - 1
        x, y = toolpath.points[point]
        raise LayoutError(
            f"{_named(toolpath, stroke)} reaches X {x:.3f} Y {y:.3f}, which is not on the "
            f"{bed[0]:g} x {bed[1]:g} mm bed of {machine.name}; lay the pattern out for this bed."
        )
    return micron.astype(np.int64)


def _body(
    runs: _Runs, rows: _Bytes, row_of_stroke: NDArray[np.int64], labels: Mapping[int, str]
) -> list[str]:
    """The strokes' lines, a piece a run, with the comments that hold from there on."""
    byte_of_row = np.concatenate([[0], np.cumsum(np.count_nonzero(rows, axis=1))])
    text = rows[rows != 0].tobytes().decode("ascii")
    cuts = [*byte_of_row[row_of_stroke[runs.first]].tolist(), len(text)]
    pieces = []
    operation_said = patch_said = None
    for run, (operation, patch) in enumerate(
        zip(runs.operation.tolist(), runs.patch.tolist(), strict=True)
    ):
        if operation != operation_said:
            pieces.append(_comment("operation", OPERATIONS[operation]))
        if patch != patch_said:
            label = NO_PATCH if patch < 0 else labels.get(patch, str(patch))
            pieces.append(_comment("patch", label))
        if runs.passes[run] > 1:
            pieces.append(_comment("pass", f"{runs.number[run]} of {runs.passes[run]}"))
        pieces.append(text[cuts[run] : cuts[run + 1]])
        operation_said, patch_said = operation, patch
    return pieces


def _rows(
    toolpath: Toolpath, runs: _Runs, microns: NDArray[np.int64], tool: _Tool
) -> tuple[_Bytes, NDArray[np.int64]]:
    """The lines as a byte matrix, zeros to be struck out, and the row at which each stroke of
    ``runs.order`` starts. A point equal to the one before it in its stroke is no move.
    """
    order = runs.order
    size = np.diff(toolpath.offsets)[order]
    begin = np.cumsum(size) - size
    source = np.arange(int(size.sum())) + np.repeat(toolpath.offsets[:-1][order] - begin, size)
    stroke = np.repeat(np.arange(len(order)), size)
    starts = np.zeros(len(source), dtype=bool)
    starts[begin[size > 0]] = True
    xy = microns[source]
    moves = np.ones(len(source), dtype=bool)
    moves[1:] = (xy[1:] != xy[:-1]).any(axis=1)
    keep = starts | moves
    kept = np.bincount(stroke[keep], minlength=len(order))
    if kept.min(initial=2) < 2:
        raise LayoutError(
            f"{_named(toolpath, int(order[np.argmin(kept >= 2)]))} is shorter than 0.001 mm "
            "and cannot be made; remove it from the layout."
        )
    xy, starts, stroke = xy[keep], starts[keep], stroke[keep]
    first = np.cumsum(kept) - kept

    operation = toolpath.operation[order]
    suffix = np.zeros(len(xy), dtype=np.int64)
    words, word_of_stroke = _modal_words(tool, operation)
    suffix[first + 1] = word_of_stroke
    suffixes = _table(words)
    down = np.zeros(len(xy), dtype=np.int64)
    down[first] = operation + 1
    last = np.zeros(len(xy), dtype=np.int64)
    last[first + kept - 1] = 1
    rows = np.concatenate(
        [
            _table(["G1 X", "G0 X"])[starts.astype(np.int64)],
            _number(xy[:, 0]),
            _table([" Y"])[np.zeros(len(xy), dtype=np.int64)],
            _number(xy[:, 1]),
            suffixes[suffix],
            _table(["", *tool.down])[down],
            _table(["", tool.up])[last],
            np.full((len(xy), 1), ord("\n"), dtype=np.uint8),
        ],
        axis=1,
    )
    return rows, first


def _modal_words(tool: _Tool, operation: NDArray[np.int64]) -> tuple[list[str], NDArray[np.int64]]:
    """The S and F words for each pair (operation before, operation now), and each stroke's index
    among them. Row 0 of the pairs is "nothing before".
    """
    count = len(tool.feed)
    words = []
    for before in range(-1, count):
        for now in range(count):
            text = ""
            if tool.s is not None and (before < 0 or tool.s[before] != tool.s[now]):
                text += f" S{tool.s[now]}"
            if before < 0 or tool.feed[before] != tool.feed[now]:
                text += f" F{tool.feed[now]}"
            words.append(text)
    # Index 0 stands for "no words", so the pairs start at 1.
    before_each = np.concatenate([[-1], operation[:-1]]) if len(operation) else operation
    return ["", *words], 1 + (before_each + 1) * count + operation


def _table(texts: Sequence[str]) -> _Bytes:
    """(len(texts), width) ASCII, short rows filled with zeros."""
    padded = np.array([text.encode("ascii") for text in texts], dtype=np.bytes_)
    return padded.view(np.uint8).reshape(len(texts), -1)


# A bed is at most 20 m, so five digits before the point are enough.
_WHOLE = _table([str(value) for value in range(20_001)])
_THOUSANDTHS = _table([f".{value:03d}".rstrip(".0") for value in range(1000)])


def _number(microns: NDArray[np.int64]) -> _Bytes:
    """(n, width) micrometres written in mm, without trailing zeros."""
    whole, rest = np.divmod(microns, 1000)
    return np.concatenate([_WHOLE[whole], _THOUSANDTHS[rest]], axis=1)


def _trimmed(value: float) -> str:
    return f"{value:.3f}".rstrip("0").rstrip(".")


def _comment(key: str, value: str) -> str:
    line = f"({key} {value})"
    if not _COMMENT.fullmatch(value) or _NOT_IN_COMMENT.intersection(value):
        raise LayoutError(
            f"The {key} name {value!r} cannot stand in G-code; use ASCII without "
            f"{' '.join(sorted(_NOT_IN_COMMENT))}."
        )
    if len(line) > LINE_CHARS:
        raise LayoutError(
            f"The {key} name {value!r} is too long for G-code; use at most "
            f"{LINE_CHARS - len(key) - 3} characters."
        )
    return line + "\n"


def _named(toolpath: Toolpath, stroke: int) -> str:
    patch = int(toolpath.patch[stroke])
    where = "" if patch < 0 else f", patch {patch}"
    operation = OPERATIONS[int(toolpath.operation[stroke])]
    return f"Stroke {stroke + 1} of {toolpath.sheet} ({operation}{where})"
