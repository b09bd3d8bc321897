"""The dry run: what a job would do on a machine, read back from its G-code; no port is opened.

Everything is computed from the ``.nc`` files themselves, not from what made them, so that the
preview of a foreign file is worth as much as that of our own.
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import InputError
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program, parse_program, strokes
from miurafab.grbl.settings import parse_dump
from miurafab.motion.estimate import estimate
from miurafab.motion.parameters import Link, MotionParameters
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fold_format import read_fold
from miurafab.profiles import OPERATIONS, MachineProfile, load_machine
from miurafab.workflow.hazards import has_laser_mode, hazards

ASSUMED_MACHINE = "grbl-laser-400"
"""The machine assumed for a file that names none; the preview says so."""


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
_MACHINE = re.compile(r"^\(machine ([^()]+)\)$", re.MULTILINE)


@dataclass(frozen=True, eq=False)
class SheetPreview:
    """One G-code file, dry-run.

    ``lines`` of the file; ``seconds`` in all and with the beam on; ``cut_mm`` burnt and
    ``travel_mm`` dark; ``bounds_mm`` (x0, y0, x1, y1) of what is burnt, None if nothing is.
    Per move of ``program``: ``layer`` (n,) int64, into :data:`LAYERS`, and ``end_seconds`` (n,)
    float64, when it ends. ``layer_mm`` and ``layer_strokes``: length and number, by layer.
    ``paper_mm`` is the sheet, or the bed where no sheet is known; ``view_mm`` (x0, y0, x1, y1) the
    smallest box that holds the bed, the sheet and every move.
    """

    name: str
    lines: int
    seconds: float
    beam_on_seconds: float
    cut_mm: float
    travel_mm: float
    bounds_mm: tuple[float, float, float, float] | None
    warnings: tuple[str, ...]
    program: Program
    layer: NDArray[np.int64]
    end_seconds: NDArray[np.float64]
    layer_mm: tuple[float, ...]
    layer_strokes: tuple[int, ...]
    paper_mm: tuple[float, float]
    view_mm: tuple[float, float, float, float]

    def figures(self) -> dict[str, Any]:
        """The figures as ``preview --json`` gives them."""
        return {
            "name": self.name,
            "lines": self.lines,
            "seconds": round(self.seconds, 3),
            "beam_on_seconds": round(self.beam_on_seconds, 3),
            "cut_mm": round(self.cut_mm, 3),
            "travel_mm": round(self.travel_mm, 3),
            "bounds_mm": None if self.bounds_mm is None else list(self.bounds_mm),
            "warnings": list(self.warnings),
        }


@dataclass(frozen=True, eq=False)
class Preview:
    """A whole job, dry-run on ``machine``; ``pattern`` is what its sheets fold into, if known.

    ``remarks`` are sentences about the job as a whole.
    """

    name: str
    machine: MachineProfile
    sheets: tuple[SheetPreview, ...]
    pattern: CreasePattern | None
    remarks: tuple[str, ...]

    @property
    def seconds(self) -> float:
        """The time of all sheets, one after another, without changing sheets."""
        return sum(sheet.seconds for sheet in self.sheets)

    def as_dict(self) -> dict[str, Any]:
        """The answer of ``preview --json``."""
        return {
            "job": self.name,
            "machine": self.machine.name,
            "seconds": round(self.seconds, 3),
            "sheets": [sheet.figures() for sheet in self.sheets],
            "remarks": list(self.remarks),
        }


def preview(
    job_path: str | Path,
    *,
    machine: MachineProfile | None = None,
    settings_dump: str | Path | None = None,
) -> Preview:
    """Dry-run a job directory or a single G-code file.

    ``machine`` defaults to the one that the job names (``layout.json``, or the file's
    ``(machine ...)`` comment). ``settings_dump`` is a file with what ``$$`` printed; its rates,
    accelerations, S range and travel then hold instead of the profile's.

    Raises :class:`~miurafab.errors.InputError` for a path that holds no job,
    :class:`~miurafab.errors.GcodeError` for a program that the controller would refuse, by file
    and line, and :class:`~miurafab.errors.ProfileError` for a machine or dump with a fault.
    """
    path = Path(job_path)
    if not path.exists():
        raise InputError(f"{path} does not exist.")
    layout = _read_layout(path / "layout.json") if path.is_dir() else None
    files = _job_files(path, layout)
    jobs = [_read(file) for file in files]
    remarks: list[str] = []
    if machine is None:
        machine = _made_for(path, layout, jobs[0], remarks)
    if settings_dump is not None:
        machine = with_settings(machine, Path(settings_dump))
    bed = (machine.bed.width_mm, machine.bed.height_mm)
    papers = {} if layout is None else layout.papers
    return Preview(
        name=path.resolve().name,
        machine=machine,
        sheets=tuple(
            dry_run(file.stem, job, machine, papers.get(file.stem, bed))
            for file, job in zip(files, jobs, strict=True)
        ),
        pattern=None if layout is None else _pattern(path, layout, remarks),
        remarks=tuple(remarks),
    )


def with_settings(machine: MachineProfile, dump: Path) -> MachineProfile:
    """``machine`` with the rates, accelerations, S range and travel of a ``$$`` dump.

    Raises :class:`~miurafab.errors.ProfileError` for a line that is no setting.
    """
    values = parse_dump(_read(dump).text, dump.name).values
    motion, tool, bed = machine.motion, machine.tool, machine.bed
    width, height = values.get(130, bed.width_mm), values.get(131, bed.height_mm)
    return replace(
        machine,
        motion=replace(
            motion,
            max_rate_mm_min=(
                values.get(110, motion.max_rate_mm_min[0]),
                values.get(111, motion.max_rate_mm_min[1]),
            ),
            acceleration_mm_s2=(
                values.get(120, motion.acceleration_mm_s2[0]),
                values.get(121, motion.acceleration_mm_s2[1]),
            ),
            junction_deviation_mm=values.get(11, motion.junction_deviation_mm),
        ),
        tool=replace(
            tool,
            s_max=round(values.get(30, tool.s_max)),
            s_min=round(values.get(31, tool.s_min)),
        ),
        bed=replace(bed, width_mm=width, height_mm=height),
        settings={**machine.settings, **values},
    )


@dataclass(frozen=True)
class _Layout:
    """What the preview takes from ``layout.json``: ``papers`` are sheet sizes by name."""

    machine: str
    pattern_file: str
    pattern_sha256: str
    papers: dict[str, tuple[float, float]]


def _read_layout(path: Path) -> _Layout | None:
    if not path.is_file():
        return None
    try:
        layout = json.loads(path.read_text(encoding="utf-8"))
        return _Layout(
            machine=str(layout["machine"]),
            pattern_file=str(layout["pattern"]["file"]),
            pattern_sha256=str(layout["pattern"]["sha256"]),
            papers={
                str(sheet["name"]): (float(sheet["width_mm"]), float(sheet["height_mm"]))
                for sheet in layout["sheets"]
            },
        )
    except (ValueError, KeyError, TypeError) as fault:
        raise InputError(
            f"{path} is not a layout that 'miurafab sheets' wrote: {fault!r}; make the job again."
        ) from None


def _job_files(path: Path, layout: _Layout | None) -> list[Path]:
    if not path.is_dir():
        return [path]
    if layout is None:
        files = sorted(path.glob("*.nc"))
    else:
        files = [path / f"{name}.nc" for name in layout.papers]
    if not files:
        raise InputError(f"{path} holds no G-code (*.nc); make it with 'miurafab sheets'.")
    return files


def _read(path: Path) -> Job:
    try:
        return Job(path.name, path.read_bytes().decode("utf-8", "surrogateescape"))
    except OSError as fault:
        raise InputError(f"{path} cannot be read: {fault.strerror}.") from None


def named_machine(job: Job) -> MachineProfile | None:
    """The machine that the job's ``(machine ...)`` comment names, None without one."""
    comment = _MACHINE.search(job.text)
    return None if comment is None else load_machine(comment[1])


def _made_for(path: Path, layout: _Layout | None, job: Job, remarks: list[str]) -> MachineProfile:
    """The machine that the job was made for, or the assumed one, which is then remarked upon.

    A job directory may hold a profile of the user's own.
    """
    if layout is not None:
        own = path / f"{layout.machine}.toml"
        return load_machine(own if own.is_file() else layout.machine)
    named = named_machine(job)
    if named is not None:
        return named
    remarks.append(
        f"No machine is named, so times and limits hold for {ASSUMED_MACHINE}; give --machine or "
        "--settings for another."
    )
    return load_machine(ASSUMED_MACHINE)


def _pattern(path: Path, layout: _Layout, remarks: list[str]) -> CreasePattern | None:
    """The pattern that the sheets fold into, if its file is where the layout says, unchanged."""
    for folder in (path, Path()):
        file = folder / layout.pattern_file
        if file.is_file():
            if hashlib.sha256(file.read_bytes()).hexdigest() == layout.pattern_sha256:
                return read_fold(file)
            remarks.append(f"{file} has changed since the sheets were made, so it is not shown.")
            return None
    remarks.append(f"The pattern {layout.pattern_file} is not there, so its fold is not shown.")
    return None


def dry_run(
    name: str, job: Job, machine: MachineProfile, paper_mm: tuple[float, float]
) -> SheetPreview:
    program = parse_program(job, laser=has_laser_mode(machine))
    controller = machine.controller
    link = Link(baud=controller.baud, rx_bytes=controller.rx_bytes)
    times = estimate(program, MotionParameters.from_profile(machine), link)
    burning = program.beam_on
    layer = np.where(burning, _layers(program), _TRAVEL)
    lengths = program.lengths
    burnt = strokes(program)
    bed = (machine.bed.width_mm, machine.bed.height_mm)
    stroke_layer = layer[burnt.first_move]
    return SheetPreview(
        name=name,
        lines=len(job.lines),
        seconds=times.seconds,
        beam_on_seconds=times.beam_on_seconds,
        cut_mm=float(lengths[burning].sum()),
        travel_mm=float(lengths[~burning].sum()),
        bounds_mm=_box(burnt.points) if len(burnt) else None,
        warnings=hazards(job, program, machine),
        program=program,
        layer=layer,
        end_seconds=times.end,
        layer_mm=tuple(np.bincount(layer, lengths, len(LAYERS)).tolist()),
        layer_strokes=tuple(np.bincount(stroke_layer, minlength=len(LAYERS)).tolist()),
        paper_mm=paper_mm,
        view_mm=_box(np.vstack([program.start[:1, :2], program.end[:, :2], (0, 0), bed, paper_mm])),
    )


def _layers(program: Program) -> NDArray[np.int64]:
    """(n,) the layer of each move by the operation that its comments name."""
    place = {layer.name: at for at, layer in enumerate(LAYERS) if layer.name in OPERATIONS}
    of_context = [place.get(context.operation, _OTHER) for context in program.contexts]
    return np.array(of_context, dtype=np.int64)[program.context]


def _box(points: NDArray[np.float64]) -> tuple[float, float, float, float]:
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
