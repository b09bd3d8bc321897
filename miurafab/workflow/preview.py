"""The preview of a job: each of its G-code files dry-run on one machine; no port is opened."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from miurafab.errors import InputError
from miurafab.findings import Finding, findings_json
from miurafab.gcode.job import Job
from miurafab.grbl.settings import parse_dump
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, load_machine
from miurafab.workflow.dry_run import SheetPreview, dry_run, read_gcode
from miurafab.workflow.job_files import job_machine, job_material

ASSUMED_MACHINE = "grbl-laser-400"
"""The machine assumed for a G-code file that names none; the preview says so."""
_ASSUMED_CUTTER = "hpgl-cutter-a3"
_MACHINE = re.compile(r"^\(machine ([^()]+)\)$", re.MULTILINE)


@dataclass(frozen=True, eq=False)
class Preview:
    """A whole job, dry-run on ``machine``; ``pattern`` is what its sheets fold into, if known.

    ``findings`` are about the job as a whole; each sheet has its own.
    """

    name: str
    machine: MachineProfile
    sheets: tuple[SheetPreview, ...]
    pattern: CreasePattern | None
    findings: tuple[Finding, ...]

    @property
    def seconds(self) -> float:
        """The time of all sheets, one after another, without changing sheets."""
        return sum(sheet.seconds for sheet in self.sheets)

    def as_dict(self) -> dict[str, Any]:
        """The JSON answer of ``preview``."""
        return {
            "job": self.name,
            "machine": self.machine.name,
            "seconds": round(self.seconds, 3),
            "sheets": [sheet.figures() for sheet in self.sheets],
            "findings": findings_json(self.findings),
        }


def preview(
    job_path: str | Path,
    *,
    machine: MachineProfile | None = None,
    settings_dump: str | Path | None = None,
    on_progress: Callable[[float, str], None] | None = None,
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
    if path.suffix.lower() == ".fold":
        raise InputError(
            f"{path} is a pattern and no job; make a job with 'miurafab sheets {path} -o JOB', "
            "then preview JOB."
        )
    layout = _read_layout(path / "layout.json") if path.is_dir() else None
    files = _job_files(path, layout)
    jobs = [read_gcode(file) for file in files]
    findings: list[Finding] = []
    if machine is None:
        machine = _made_for(path, layout, jobs[0], findings)
    if settings_dump is not None:
        machine = with_settings(machine, Path(settings_dump))
    bed = (machine.bed.width_mm, machine.bed.height_mm)
    papers = {} if layout is None else layout.papers
    most_power = 1.0 if layout is None else job_material(layout.material, path).max_power
    sheets = []
    for number, (file, job) in enumerate(zip(files, jobs, strict=True)):
        if on_progress is not None:
            on_progress(number / len(files), file.name)
        sheets.append(dry_run(file.stem, job, machine, papers.get(file.stem, bed), most_power))
    return Preview(
        name=path.resolve().name,
        machine=machine,
        sheets=tuple(sheets),
        pattern=None if layout is None else _pattern(path, layout, findings),
        findings=tuple(findings),
    )


def with_settings(machine: MachineProfile, dump: Path) -> MachineProfile:
    """``machine`` with the rates, accelerations, S range and travel of a ``$$`` dump.

    Raises :class:`~miurafab.errors.ProfileError` for a line that is no setting.
    """
    values = parse_dump(read_gcode(dump).text, dump.name).values
    motion, tool, bed = machine.motion, machine.tool, machine.bed
    width, height = values.get(130, bed.width_mm), values.get(131, bed.height_mm)
    return replace(
        machine,
        motion=replace(
            motion,
            max_rate_x_mm_min=values.get(110, motion.max_rate_x_mm_min),
            max_rate_y_mm_min=values.get(111, motion.max_rate_y_mm_min),
            acceleration_x_mm_s2=values.get(120, motion.acceleration_x_mm_s2),
            acceleration_y_mm_s2=values.get(121, motion.acceleration_y_mm_s2),
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
    material: str
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
            material=str(layout["material"]),
            pattern_file=str(layout["pattern"]["file"]),
            pattern_sha256=str(layout["pattern"]["sha256"]),
            papers={
                str(name): (float(sheet["width_mm"]), float(sheet["height_mm"]))
                for sheet in layout["sheets"]
                for name in (sheet.get("back"), sheet["name"])
                if name
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
        suffix = job_machine(layout.machine, path).job_suffix
        files = [path / f"{name}{suffix}" for name in layout.papers]
    if not files:
        raise InputError(f"{path} holds no G-code (*.nc); make it with 'miurafab sheets'.")
    return files


def named_machine(job: Job, folder: Path | None = None) -> MachineProfile | None:
    """The machine that the job's ``(machine ...)`` comment names, None without one.

    A profile of that name in ``folder`` is a user's own, and comes before the shipped ones.
    """
    comment = _MACHINE.search(job.text)
    return None if comment is None else job_machine(comment[1], folder)


def _made_for(
    path: Path, layout: _Layout | None, job: Job, findings: list[Finding]
) -> MachineProfile:
    """The machine that the job was made for, or the assumed machine and a note."""
    folder = path if path.is_dir() else path.parent
    if layout is not None:
        return job_machine(layout.machine, folder)
    named = named_machine(job, folder)
    if named is not None:
        return named
    assumed = assumed_machine(path)
    findings.append(
        Finding(
            "assumed-machine",
            f"No machine is named, so times and limits hold for {assumed.name}; give `machine` or "
            "`settings` for another.",
            path.name,
        )
    )
    return assumed


def assumed_machine(path: Path) -> MachineProfile:
    """The machine assumed for a file that names none: a cutter for HPGL, else a common laser."""
    return load_machine(_ASSUMED_CUTTER if path.suffix.lower() == ".plt" else ASSUMED_MACHINE)


def _pattern(path: Path, layout: _Layout, findings: list[Finding]) -> CreasePattern | None:
    """The pattern that the sheets fold into, if its file is where the layout says, unchanged."""
    for folder in (path, Path()):
        file = folder / layout.pattern_file
        if file.is_file():
            if hashlib.sha256(file.read_bytes()).hexdigest() == layout.pattern_sha256:
                from miurafab.origami.formats.fold import read_fold  # slow to load, seldom needed

                return read_fold(file)
            says = f"{file} has changed since the sheets were made, so it is not shown."
            findings.append(Finding("pattern-changed", says, str(file)))
            return None
    says = f"The pattern {layout.pattern_file} is not there, so its fold is not shown."
    findings.append(Finding("pattern-missing", says, layout.pattern_file))
    return None
