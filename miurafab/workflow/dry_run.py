"""The dry run of one G-code file: what it would do on a machine, move by move, and for how long.

All figures come from the text alone, so they hold for a foreign file as well as for our own.
"""

from __future__ import annotations

import codecs
from collections.abc import Callable, Iterable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.display import Shown
from miurafab.errors import GcodeError, InputError
from miurafab.files import read_bytes
from miurafab.findings import Finding, findings_json, refusals
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program, ProgramBuilder, strokes
from miurafab.gcode.reading import read_program
from miurafab.geometry.arrays import Floats
from miurafab.machine.judge_job import JudgedJob, judge_job, judge_program
from miurafab.motion.estimate import estimate
from miurafab.motion.parameters import Link, MotionParameters
from miurafab.profiles import OPERATIONS, MachineProfile


@dataclass(frozen=True)
class Layer:
    """One kind of move in a picture: its ``name`` in the file, a ``title``, ``colour`` #rrggbb."""

    name: str
    title: str
    colour: str


# Apart for colour-blind eyes too (after Okabe and Ito, "Color Universal Design", 2008).
_COLOURS = {"engrave": "#cc79a7", "score": "#1a80bf", "perforate": "#009e73", "cut": "#d55e00"}
LAYERS = (
    Layer("travel", "Travel", "#9aa4af"),
    *(Layer(name, name.capitalize(), _COLOURS[name]) for name in OPERATIONS),
    Layer("burn", "Other", "#b58900"),
)
"""The kinds of move: travels first, then the operations, then what no comment names."""
_TRAVEL, _OTHER = 0, len(LAYERS) - 1


@dataclass(frozen=True, eq=False, repr=False)
class SheetPreview(Shown):
    """One G-code file, dry-run.

    Attributes
    ----------
    name : str
        The name of the sheet.
    lines : int
        The lines of the file.
    seconds, beam_on_seconds : float
        The time in all, and the time with the beam on.
    cut_mm, travel_mm : float
        The length of the burnt strokes and of the dark moves.
    bounds_mm : (x0, y0, x1, y1) or None
        The box around the burnt strokes, None without strokes.
    findings : tuple of Finding
        What :func:`~miurafab.machine.judge_job.judge_job` says of the file.
    program : Program
        The n moves of the file.
    layer : (n,) int8
        The layer of each move, an index into :data:`LAYERS`.
    end_seconds : (n,) float64
        When each move ends.
    layer_mm, layer_strokes : tuple
        The length and the number of the strokes of each layer.
    operation_seconds : mapping of str to float
        The time of each operation with the moves between its strokes, in the order of the file;
        ``""`` for what the comments of the file give to none.
    paper_mm : (float, float)
        Width and height of the sheet, or of the bed where no sheet is known.
    view_mm : (x0, y0, x1, y1)
        The smallest box that holds the bed, the sheet and every move.
    """

    name: str
    lines: int
    seconds: float
    beam_on_seconds: float
    cut_mm: float
    travel_mm: float
    bounds_mm: tuple[float, float, float, float] | None
    findings: tuple[Finding, ...]
    program: Program
    layer: NDArray[np.int8]
    end_seconds: Floats
    layer_mm: tuple[float, ...]
    layer_strokes: tuple[int, ...]
    operation_seconds: Mapping[str, float]
    paper_mm: tuple[float, float]
    view_mm: tuple[float, float, float, float]

    @property
    def warnings(self) -> tuple[str, ...]:
        """The sentences of the findings."""
        return tuple(map(str, self.findings))

    @property
    def judged(self) -> JudgedJob | None:
        """What :func:`~miurafab.machine.planning.plan_job` would read again; None: unreadable."""
        if any(finding.code == "program" for finding in self.findings):
            return None
        return JudgedJob(len(self.program.line_number), self.program, self.findings)

    def _summary(self) -> str:
        return (
            f"{self.name}: {self.lines} lines, {clock_text(self.seconds)}, "
            f"{length_text(self.cut_mm)} burnt"
        )

    def _facts(self) -> Mapping[str, object]:
        facts = self.figures()
        return {key: value for key, value in facts.items() if not isinstance(value, list)}

    def figures(self) -> dict[str, Any]:
        """The figures in the JSON answer of ``preview``."""
        return {
            "name": self.name,
            "lines": self.lines,
            "seconds": round(self.seconds, 3),
            "beam_on_seconds": round(self.beam_on_seconds, 3),
            "operation_seconds": {
                name or "other": round(each, 3) for name, each in self.operation_seconds.items()
            },
            "cut_mm": round(self.cut_mm, 3),
            "travel_mm": round(self.travel_mm, 3),
            "bounds_mm": None if self.bounds_mm is None else list(self.bounds_mm),
            "warnings": list(self.warnings),
            "findings": findings_json(self.findings),
        }


def dry_run(
    name: str,
    job: Job,
    machine: MachineProfile,
    paper_mm: tuple[float, float],
    most_power: float = 1.0,
    *,
    unread: bool = False,
    on_share: Callable[[float], None] | None = None,
) -> SheetPreview:
    """Read ``job`` back, time it on ``machine`` and judge it.

    ``paper_mm`` is the size of its sheet; ``most_power`` the most that the material takes, as a
    fraction of full power. ``on_share`` gets the share that is timed.

    Raises :class:`~miurafab.errors.GcodeError`, naming the line, for a program that the
    controller would refuse. With ``unread`` that is the finding ``program``, and the preview holds
    no move.
    """
    judged: JudgedJob | None = None
    try:
        program = read_program(job, machine)
    except GcodeError:
        if not unread:
            raise
        judged, program = judge_job(job, machine), ProgramBuilder(job.name).program()
    findings = (
        tuple(judge_program(job, program, machine, most_power=most_power))
        if judged is None
        else judged.findings
    )
    parameters, link = MotionParameters.from_profile(machine), Link.from_profile(machine)
    times = estimate(program, parameters, link, on_share)
    burning = program.beam_on
    layer = np.where(burning, _layers(program), np.int8(_TRAVEL))
    lengths = program.lengths
    burnt = strokes(program)
    bed = (machine.bed.width_mm, machine.bed.height_mm)
    stroke_layer = layer[burnt.first_move]
    return SheetPreview(
        name=name,
        lines=job.line_count,
        seconds=times.seconds,
        beam_on_seconds=times.beam_on_seconds,
        cut_mm=float(lengths[burning].sum()),
        travel_mm=float(lengths[~burning].sum()),
        bounds_mm=_box(burnt.points) if len(burnt) else None,
        findings=findings,
        program=program,
        layer=layer,
        end_seconds=times.end,
        layer_mm=tuple(np.bincount(layer, lengths, len(LAYERS)).tolist()),
        layer_strokes=tuple(np.bincount(stroke_layer, minlength=len(LAYERS)).tolist()),
        operation_seconds=_by_operation(program, times.end),
        paper_mm=paper_mm,
        view_mm=_box(np.vstack([program.start[:1, :2], program.end[:, :2], (0, 0), bed, paper_mm])),
    )


def readiness(findings: Iterable[Finding], forced: AbstractSet[str] = frozenset()) -> str:
    """``ready``, or ``refused`` for a refusal whose code is not ``forced``."""
    stops = any(finding.code not in forced for finding in refusals(findings))
    return "refused" if stops else "ready"


def read_gcode(path: Path) -> Job:
    """A G-code file as a job, whatever bytes it holds: parsing and sending check it.

    A file is UTF-8 or UTF-16 by its byte order mark, else UTF-8; one that is neither is Latin-1,
    in which every byte is a character.
    """
    data = read_bytes(path, InputError)
    utf_16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        return Job(path.name, data.decode("utf-16" if utf_16 else "utf-8-sig"))
    except UnicodeDecodeError:
        return Job(path.name, data.decode("latin-1"))


def _layers(program: Program) -> NDArray[np.int8]:
    """(n,) the layer of each move by the operation that its comments name."""
    place = {layer.name: at for at, layer in enumerate(LAYERS) if layer.name in OPERATIONS}
    of_context = [place.get(context.operation, _OTHER) for context in program.contexts]
    return np.array(of_context, dtype=np.int8)[program.context]


def _by_operation(program: Program, end: Floats) -> dict[str, float]:
    """The time of each operation that the comments name."""
    took = np.bincount(program.context, np.diff(end, prepend=0.0), len(program.contexts))
    found: dict[str, float] = {}
    for context, seconds in zip(program.contexts, took.tolist(), strict=True):
        name = context.operation if context.operation in OPERATIONS else ""
        found[name] = found.get(name, 0.0) + seconds
    return {name: seconds for name, seconds in found.items() if seconds > 0}


def at_work(machine: MachineProfile) -> str:
    """What the tool is while it makes a stroke: ``beam on``, ``pen down``, ``knife down``."""
    kind = machine.tool.kind
    return "beam on" if kind == "laser" else f"{kind} down"


def _box(points: Floats) -> tuple[float, float, float, float]:
    (x0, y0), (x1, y1) = points[:, :2].min(axis=0).round(3), points[:, :2].max(axis=0).round(3)
    return float(x0), float(y0), float(x1), float(y1)


def clock_text(seconds: float) -> str:
    """A time as h:mm:ss or m:ss."""
    minutes, second = divmod(round(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02d}:{second:02d}" if hours else f"{minute}:{second:02d}"


def length_text(mm: float) -> str:
    """A length in mm, or in m from one metre up."""
    if mm >= 1000:
        return f"{mm / 1000:.2f} m"
    return f"{mm:.0f} mm" if mm >= 100 else f"{mm:.1f} mm"
