"""The plans of the sheets that will be cut: which, in what order, and where each goes on.

Beside each sheet lies its journal. With ``resume`` the journals tell which sheets are done, which
goes on, and which were never begun.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from miurafab.errors import GcodeError, InputError, OptionError
from miurafab.findings import Finding
from miurafab.gcode.job import Job
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import Head, JobPlan, head_at, passed_checks, plan_job
from miurafab.machine.preflight import raise_findings, require_known
from miurafab.machine.resume import Resumption, from_stroke, resume
from miurafab.workflow.alignment import align
from miurafab.workflow.cut import Prepared
from miurafab.workflow.dry_run import SheetPreview, dry_run, readiness

if TYPE_CHECKING:
    from miurafab.workflow.cut_options import CutOptions


def plan_sheets(
    prepared: Prepared, sheets: Sequence[int] | None, options: CutOptions
) -> list[tuple[int, JobPlan]]:
    """The plans of the ``sheets`` (None: all), each checked by itself.

    With ``options.resume`` finished sheets are left out and interrupted sheets are resumed; with
    ``options.from_stroke`` the first begins there. Raises
    :class:`~miurafab.errors.InputError` for a sheet that cannot be sent.
    """
    require_known(options.send.force)
    starts = _starts(prepared, sheets, options)
    edits = raise_findings(prepared.findings, options.send.force, GcodeError)
    plans: list[tuple[int, JobPlan]] = []
    for number, resumption in starts:
        expected = prepared.dry_runs[number - 1]
        plan = plan_job(
            prepared.jobs[number - 1],
            prepared.machine,
            options.send,
            resumption=resumption,
            most_power=prepared.most_power,
            judged=expected.judged,
            box=expected.bounds_mm,
            sha256=prepared.sha256_of(number),
        )
        back = prepared.back_of(number)
        plans.append((number, replace(plan, forced=edits + plan.forced, back=back)))
    return plans


def _starts(
    prepared: Prepared, sheets: Sequence[int] | None, options: CutOptions
) -> list[tuple[int, Resumption | None]]:
    """Which of the ``sheets`` are sent, and the rest of each that does not begin at its first line;
    see :func:`plan_sheets`.
    """
    if options.resume and options.from_stroke is not None:
        raise OptionError(
            "from_stroke",
            "says where to begin, and the journal says that for `resume`; ask for one",
        )
    starts: list[tuple[int, Resumption | None]] = []
    begun = False
    for number in prepared.chosen(sheets):
        aligned, written = prepared.aligned, prepared.written(number)
        resumption: Resumption | None = None
        if options.from_stroke is not None and not starts:
            resumption = from_stroke(written, prepared.machine, options.from_stroke)
        if options.resume:
            path = journal_path(prepared, prepared.jobs[number - 1])
            runs = read_journal(path) if path.exists() else []
            begun = begun or bool(runs)
            if runs and runs[-1].ended == "done":
                continue
            if runs:
                resumption = resume(written, prepared.machine, runs)
        if resumption is not None and aligned is not None and aligned.number == number:
            resumption = aligned.rest(resumption, prepared.machine)
        starts.append((number, resumption))
    if options.resume and not (begun and starts):
        raise InputError(
            f"No sheet of {prepared.name} was interrupted, by the journals beside it; leave "
            "`resume` out to cut."
        )
    return starts


def start_findings(
    prepared: Prepared, number: int, resumption: Resumption | None, at: Head | str | None
) -> tuple[Finding, ...]:
    """Where sheet ``number`` lies and begins, if the head is put ``at`` a place of it."""
    found: list[Finding] = []
    expected = prepared.dry_runs[number - 1]
    if prepared.aligned is not None and prepared.aligned.number == number:
        found.append(prepared.aligned.finding)
    if isinstance(at, str) and expected.bounds_mm is not None:
        head = head_at(at, expected.bounds_mm, expected.name)
        ends = expected.program.end[:, :2]
        (left, front), (right, back) = head - ends.min(axis=0), ends.max(axis=0) - head
        found.append(
            Finding(
                "head",
                f"The head stands at X{head[0]:.3f} Y{head[1]:.3f} of {expected.name}; from there "
                f"it goes {max(0.0, left):.1f} mm to the left, {max(0.0, right):.1f} mm to the "
                f"right, {max(0.0, front):.1f} mm to the front and {max(0.0, back):.1f} mm to the "
                "back.",
                expected.name,
            )
        )
    if resumption is not None:
        found.append(resumption.finding)
    return tuple(found)


def what_is_sent(prepared: Prepared, number: int, resumption: Resumption | None) -> SheetPreview:
    """The dry run of sheet ``number``, or of the rest of it."""
    whole = prepared.dry_runs[number - 1]
    if resumption is None:
        return whole
    return dry_run(
        whole.name, resumption.job, prepared.machine, whole.paper_mm, prepared.most_power
    )


def rehearsed(
    prepared: Prepared, sheets: Sequence[int] | None, options: CutOptions
) -> tuple[Prepared, str, tuple[Finding, ...]]:
    """``prepared`` as :func:`~miurafab.workflow.cut_sheets.cut_prepared` would send it, its
    ``dry_runs`` those of what is sent, ``ready`` or ``refused``, and where each sheet would lie and
    begin; no refusal raises.
    """
    prepared = align(prepared, sheets, options.align)
    dry_runs, notes = list[SheetPreview](), list[Finding]()
    for number, resumption in _starts(prepared, sheets, options):
        at = None if dry_runs else options.send.at
        notes += start_findings(prepared, number, resumption, at)
        dry_runs.append(what_is_sent(prepared, number, resumption))
    prepared = replace(prepared, dry_runs=tuple(dry_runs))
    send, machine = options.send, prepared.machine
    ready = readiness(prepared.findings, send.force) == "ready" and all(
        readiness(each.findings, send.force | passed_checks(send, machine, each.program)) == "ready"
        for each in prepared.dry_runs
    )
    return prepared, "ready" if ready else "refused", tuple(notes)


def can_go_on(prepared: Prepared) -> bool:
    """Whether a sheet was begun and not ended, and its journal can be resumed."""
    for job in prepared.jobs:
        path = journal_path(prepared, job)
        runs = read_journal(path) if path.is_file() else []
        if runs and runs[-1].ended != "done" and runs[-1].line:
            try:
                resume(job, prepared.machine, runs)
            except InputError:
                continue
            return True
    return False


def journal_path(prepared: Prepared, job: Job) -> Path:
    """Where the journal of ``job`` is."""
    return beside(prepared, job, ".journal")


def beside(prepared: Prepared, job: Job, suffix: str) -> Path:
    """The file of ``job`` with ``suffix``, in the folder of a job that is not refused."""
    assert prepared.folder is not None
    return prepared.folder / f"{Path(job.name).stem}{suffix}"
