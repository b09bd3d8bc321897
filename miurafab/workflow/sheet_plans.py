"""The plans of the sheets that will be cut: which, in what order, and where each goes on.

Beside each sheet lies its journal. With ``resume`` the journals tell which sheets are done, which
goes on, and which were never begun.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from miurafab.errors import GcodeError, InputError
from miurafab.gcode.job import Job
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import JobPlan, plan_job
from miurafab.machine.preflight import raise_findings, require_known
from miurafab.machine.resume import resume
from miurafab.workflow.cut import Prepared

if TYPE_CHECKING:
    from miurafab.workflow.cut_sheets import CutOptions


def chosen_sheets(prepared: Prepared, sheets: Sequence[int] | None) -> list[int]:
    """The numbers of the ``sheets`` (None: all); raises ``InputError`` for one that is missing."""
    if prepared.refused:
        why = " ".join(finding.sentence for finding in prepared.refused)
        raise InputError(f"{prepared.name} cannot be cut: {why}")
    chosen = list(sheets) if sheets else list(range(1, len(prepared.jobs) + 1))
    for number in chosen:
        if not 1 <= number <= len(prepared.jobs):
            raise InputError(f"{prepared.name} has no sheet {number}; it has {len(prepared.jobs)}.")
    return chosen


def plan_sheets(
    prepared: Prepared, sheets: Sequence[int] | None, options: CutOptions
) -> list[tuple[int, JobPlan]]:
    """The plans of the ``sheets`` (None: all), each checked by itself.

    With ``options.resume`` finished sheets are left out and interrupted sheets are resumed. Raises
    :class:`~miurafab.errors.InputError` for a sheet that cannot be sent.
    """
    chosen = chosen_sheets(prepared, sheets)
    require_known(options.send.force)
    edits = raise_findings(prepared.edits, options.send.force, GcodeError)
    plans: list[tuple[int, JobPlan]] = []
    begun = False
    for number in chosen:
        job = prepared.jobs[number - 1]
        resumption = None
        if options.resume:
            path = journal_path(prepared, job)
            runs = read_journal(path) if path is not None and path.exists() else []
            begun = begun or bool(runs)
            if runs and runs[-1].ended == "done":
                continue
            if runs:
                resumption = resume(job, prepared.machine, runs)
        plan = plan_job(
            job,
            prepared.machine,
            options.send,
            resumption=resumption,
            most_power=prepared.most_power,
            judged=prepared.dry_runs[number - 1].judged,
        )
        plans.append((number, replace(plan, forced=edits + plan.forced)))
    if options.resume and not (begun and plans):
        raise InputError(
            f"No sheet of {prepared.name} was interrupted, by the journals beside it; leave "
            "`resume` out to cut."
        )
    return plans


def can_go_on(prepared: Prepared) -> bool:
    """Whether a sheet was begun and not ended, and its journal can be resumed."""
    for job in prepared.jobs:
        path = journal_path(prepared, job)
        runs = read_journal(path) if path is not None and path.is_file() else []
        if runs and runs[-1].ended != "done" and runs[-1].line:
            try:
                resume(job, prepared.machine, runs)
            except InputError:
                continue
            return True
    return False


def journal_path(prepared: Prepared, job: Job) -> Path | None:
    """Where the journal of ``job`` is."""
    return beside(prepared, job, ".journal")


def beside(prepared: Prepared, job: Job, suffix: str) -> Path | None:
    """The file of ``job`` with ``suffix``; None if the job has no folder."""
    if prepared.folder is None:
        return None
    return prepared.folder / f"{Path(job.name).stem}{suffix}"
