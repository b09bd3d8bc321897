"""Two-point alignment: a sheet that lies elsewhere than in the job is cut where it lies.

The person jogs the head to two marks of the sheet and says where each is in the job and where the
machine stands. Two points give a turn, a shift, and one figure more: their distance, which no turn
or shift changes. If it has changed, a mark was taken for another or the sheet is not the one that
was cut, and nothing is burnt.

A mark that is met within :data:`POINTING_MM` costs more the closer the marks are: over marks d mm
apart it turns the sheet by up to 2 POINTING / d, which moves a point r mm from their middle by
2 POINTING r / d. So marks that are too close together are refused.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from miurafab.errors import InputError, OptionError
from miurafab.findings import Finding
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program
from miurafab.gcode.reading import read_program
from miurafab.gcode.rigid_motion import Point, RigidMotion, moved
from miurafab.machine.resume import Resumption
from miurafab.profiles import MachineProfile
from miurafab.workflow.dry_run import SheetPreview, dry_run

if TYPE_CHECKING:
    from miurafab.workflow.cut import Prepared

Mark = tuple[Point, Point]
"""A mark: its position in the job, and where the head stands over it, mm."""

POINTING_MM = 0.15
"""How well a head is put over a mark by eye: the width of a burnt line."""
FARTHEST_MM = 0.5
"""How far off a point of the sheet may come to lie by that; a tab is glued over more (judged)."""
MOST_MM, MOST_SHARE = 2 * POINTING_MM, 0.002
"""The largest change of the marks' distance: what pointing alone explains, or this share of it if
that is more, as card changes with the air's dampness (judged)."""


@dataclass(frozen=True)
class Aligned:
    """How sheet ``number`` was turned and shifted: ``written`` is its program in the file."""

    number: int
    written: Job
    motion: RigidMotion
    finding: Finding

    def rest(self, resumption: Resumption, machine: MachineProfile) -> Resumption:
        """The rest of the program in the file, turned and shifted."""
        return replace(resumption, job=_moved(resumption.job, machine, self.motion))


def align(prepared: Prepared, sheets: Sequence[int] | None, marks: Sequence[Mark]) -> Prepared:
    """``prepared`` with the one sheet of ``sheets`` where its ``marks`` are; no marks, no change.

    Raises :class:`~miurafab.errors.InputError` for more than one sheet, for marks that cannot be of
    this sheet, and for a program that cannot be turned.
    """
    if not marks:
        return prepared
    number = the_one(prepared.chosen(sheets))
    jobs, dry_runs = list(prepared.jobs), list(prepared.dry_runs)
    jobs[number - 1], dry_runs[number - 1], aligned = lay(
        jobs[number - 1],
        prepared.machine,
        dry_runs[number - 1],
        marks,
        number=number,
        most_power=prepared.most_power,
    )
    return replace(prepared, jobs=tuple(jobs), dry_runs=tuple(dry_runs), aligned=aligned)


def the_one(numbers: Sequence[int]) -> int:
    """The number of the one sheet that marks are of; raises ``InputError`` for several."""
    if len(numbers) != 1:
        raise InputError(
            f"`align` says where one sheet lies, and there are {len(numbers)}; name its `sheet`."
        )
    return numbers[0]


def lay(
    job: Job,
    machine: MachineProfile,
    expected: SheetPreview,
    marks: Sequence[Mark],
    *,
    number: int = 1,
    most_power: float = 1.0,
) -> tuple[Job, SheetPreview, Aligned]:
    """``job`` turned and shifted to where its ``marks`` are, its dry run there, and how;
    ``expected`` is its dry run as it is written. Raises what :func:`align` raises.
    """
    if machine.dialect == "hpgl":
        raise InputError(
            f"{machine.name} speaks hpgl, whose programs are not turned; lay it flush."
        )
    motion, finding = _motion(job.name, expected.program, marks)
    there = _moved(job, machine, motion)
    stem = Path(job.name).stem
    seen = dry_run(stem, there, machine, expected.paper_mm, most_power)
    return there, seen, Aligned(number, job, motion, finding)


def draw(prepared: Prepared) -> Path | None:
    """Write the pictures and the page of the one sheet that is sent, if it was turned, beside its
    job, as :meth:`~miurafab.workflow.preview.Preview.write` does; returns the page.
    """
    aligned = prepared.aligned
    if aligned is None or prepared.folder is None:
        return None
    from miurafab.workflow.preview import Preview  # which lays sheets, too

    seen = Preview(prepared.name, prepared.machine, prepared.dry_runs, None, (aligned.finding,))
    return seen.write(prepared.folder / "aligned")[-1]


def _moved(job: Job, machine: MachineProfile, motion: RigidMotion) -> Job:
    return moved(job, read_program(job, machine), motion, machine.dialect)


def _motion(name: str, program: Program, marks: Sequence[Mark]) -> tuple[RigidMotion, Finding]:
    """The motion that the ``marks`` tell, and what to say of it."""
    if len(marks) != 2:
        raise OptionError(
            "align",
            f"is given {len(marks)} time{'s' * (len(marks) != 1)}; two marks say how a sheet lies",
        )
    (a, p), (b, q) = marks
    drawn, found = math.dist(a, b), math.dist(p, q)
    burnt = program.end[program.beam_on, :2]
    if not len(burnt):
        raise InputError(f"{name} burns nothing, so there is no sheet to align.")
    middle = (np.array(a) + np.array(b)) / 2
    reach = float(np.linalg.norm(burnt - middle, axis=1).max())
    least = 2 * POINTING_MM * reach / FARTHEST_MM
    if drawn < least:
        raise InputError(
            f"The marks of `align` are {drawn:.1f} mm apart, and {name} burns up to {reach:.1f} mm "
            f"from their middle: a mark is met within {POINTING_MM:g} mm at best, which would put "
            f"the far end {_far(reach, drawn)} off; take marks at least {least:.0f} mm apart."
        )
    most = max(MOST_MM, MOST_SHARE * drawn)
    if abs(found - drawn) > most:
        raise InputError(
            f"The marks of `align` are {drawn:.2f} mm apart in the job and {found:.2f} mm on the "
            f"machine, {found - drawn:+.2f} mm ({100 * (found / drawn - 1):+.2f} %); more than "
            f"{most:.2f} mm is no turn and no shift, so look which marks these are and measure "
            "again."
        )
    motion = RigidMotion.between((a, b), (p, q))
    turned = abs(motion.angle) > math.pi / 2
    doubt = " If it does not lie the other way round, the marks are exchanged." if turned else ""
    return motion, Finding(
        "aligned",
        f"{name} is turned by {_signed(math.degrees(motion.angle))} degrees about its origin and "
        f"shifted by X{_signed(motion.dx)} Y{_signed(motion.dy)}; the marks' distance differs by "
        f"{_signed(found - drawn, '+')} mm, of which each mark gets half.{doubt}",
        name,
    )


def _signed(value: float, plus: str = "") -> str:
    """Three decimals without a minus before zero."""
    return f"{round(value, 3) + 0.0:{plus}.3f}"


def _far(reach: float, apart: float) -> str:
    return f"{2 * POINTING_MM * reach / apart:.1f} mm" if apart else "anywhere"
