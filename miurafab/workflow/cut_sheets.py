"""Cutting: the sheets of a prepared job, one after another, to one machine.

Every sheet is checked before the port is opened for the first. The journal and the transcript of
each go beside it, and by its journal a sheet that was interrupted goes on.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any

from miurafab.display import Shown
from miurafab.errors import InputError, OptionError, PersonNeeded
from miurafab.files import AnyPath
from miurafab.findings import Finding
from miurafab.machine.job_process import session_apart
from miurafab.machine.keys import Keys
from miurafab.machine.planning import Head, JobPlan, feeds_itself, head_at, plan_job
from miurafab.machine.progress import StreamResult
from miurafab.machine.sender import SheetSession, session_here
from miurafab.machine.trace_box import frame_job
from miurafab.machine.transport import VIRTUAL, require_port
from miurafab.options import (
    Several,
    Text,
    Whole,
    declared,
    read_options,
    read_value,
)
from miurafab.options.documented import described
from miurafab.options.verbs import verb
from miurafab.profiles import MachineProfile
from miurafab.workflow.alignment import align
from miurafab.workflow.cut import Prepared, prepare
from miurafab.workflow.cut_options import DEFAULT_OPTIONS, CutOptions
from miurafab.workflow.material_change import at_pause, is_attended, needs_person, wanted
from miurafab.workflow.sheet_plans import (
    beside,
    journal_path,
    plan_sheets,
    start_findings,
    what_is_sent,
)
from miurafab.workflow.timeline import SheetProgress, placed


@dataclass(frozen=True, repr=False)
class CutSheet(Shown):
    """One sheet that was cut.

    Attributes
    ----------
    name : str
        The name of the sheet.
    lines : int
        The lines of its G-code that were sent.
    cut_mm, travel_mm : float
        The length of the burnt strokes and of the dark moves in them.
    estimated_s : float
        The time that the dry run gave before the cut.
    result : StreamResult
        What the sender says after the cut.
    findings : tuple of Finding
        What did not stop the job. The codes ``resumed``, ``from-stroke``, ``aligned`` and ``head``
        say where the sheet went on, began and lay.
    """

    name: str
    lines: int
    cut_mm: float
    travel_mm: float
    estimated_s: float
    result: StreamResult
    findings: tuple[Finding, ...]

    def _summary(self) -> str:
        return f"{self.name}: {self.lines} lines in {self.result.seconds:.1f} s"


@verb
def cut(
    job: object,
    port: str | None = None,
    *,
    machine: MachineProfile | AnyPath | None = None,
    material: AnyPath | None = None,
    out: AnyPath | None = None,
    sheets: Sequence[int] | None = None,
    pause: bool | None = None,
    keys: Keys | None = None,
    before_sheet: Callable[[int, int], None] | None = None,
    after_frame: Callable[[int], None] | None = None,
    on_start: Callable[[Finding], None] | None = None,
    on_progress: Callable[[SheetProgress], None] | None = None,
    **options: Any,
) -> tuple[CutSheet, ...]:
    """Cut a job on a machine, or on the virtual one, making whatever is missing on the way.

    Parameters
    ----------
    job : SheetJob, JobDirectory, CreasePattern, FitResult, str or os.PathLike, or a target
        A job directory, a G-code file, a pattern, a design, a target of :func:`fit`, or the values
        of all of these. What is not on disk yet is written to ``out`` first.
    port : str
        A serial device, a pyserial URL (``socket://host:port``), or ``virtual``, the controller in
        memory.
    machine : MachineProfile, str or os.PathLike, optional
        The default is the machine that the job names, then grbl-laser-400.
    material : str or os.PathLike, optional
        The default is the material that the design names, then card-250.
    out : str or os.PathLike, optional
        The job directory to make, ``jobs/NAME`` by default. Journal and transcript go there.
    sheets : sequence of int, optional
        The numbers of the sheets to cut, from 1. The default is all.
    pause : bool, optional
        Whether a person puts in fresh material before each further sheet, and looks at each frame.
        The default is yes, but for the virtual machine and, for material, a machine that feeds
        itself (``roll_fed``).
    keys : Keys, optional
        Keys of a person that hold, resume or stop the job.
    before_sheet : callable, optional
        Called with the number of the sheet and how many there are, before each further sheet that
        a person must put in: it returns when the material is there.
    after_frame : callable, optional
        Called with the number of the sheet whose frame was traced: it returns when the sheet may
        be cut.
    on_start : callable, optional
        Called with a finding, before the port is opened, on where a sheet lies, where it begins or
        goes on, and what of it is burnt twice or left out.
    on_progress : callable, optional
        Called with a :class:`SheetProgress`.
    {options}
    **options
        The options of :func:`fit`, for a target or a design.

    Returns
    -------
    tuple of CutSheet
        One for each sheet that was cut.

    Raises
    ------
    InputError
        For whatever cannot be read or made, and for a job that the checks refuse.
    PortError
        If the port cannot be opened, or goes away.
    MachineError
        If the controller fails, or the job is stopped. The beam is off then.
    PersonNeeded
        If a further sheet needs fresh material and ``before_sheet`` is not given, and after a frame
        for which ``after_frame`` is not.

    Examples
    --------
    >>> import miurafab as mf
    >>> job = mf.sheets(mf.fit("hypar", facets=(4, 4), size=60)).write("jobs/small")
    >>> len(mf.cut(job, port="virtual"))
    1
    """
    own = {name: options.pop(name) for name in declared(CutOptions) if name in options}
    asked = read_options(CutOptions, own)
    if port is None:
        for name in difflib.get_close_matches("port", options, n=1):
            raise OptionError(None, f"'{name}' is not an option; did you mean 'port'")
        raise OptionError("port", "is missing; name the machine's, or 'virtual', which needs none")
    port = read_value("port", Text(), port)
    require_port(port)
    chosen = None if sheets is None else read_value("sheets", Several(Whole(1)), sheets)
    prepared = prepare(
        job, machine=machine, material=material, out=out, options=options, unread=asked.unread
    )
    return cut_prepared(
        prepared,
        port=port,
        sheets=chosen,
        options=asked,
        pause=pause,
        keys=keys,
        before_sheet=before_sheet,
        after_frame=after_frame,
        on_start=on_start,
        on_progress=on_progress,
    )


described(cut, CutOptions)


def cut_prepared(
    prepared: Prepared,
    *,
    port: str,
    sheets: Sequence[int] | None = None,
    options: CutOptions = DEFAULT_OPTIONS,
    pause: bool | None = None,
    keys: Keys | None = None,
    before_sheet: Callable[[int, int], None] | None = None,
    after_frame: Callable[[int], None] | None = None,
    on_start: Callable[[Finding], None] | None = None,
    on_progress: Callable[[SheetProgress], None] | None = None,
) -> tuple[CutSheet, ...]:
    """Stream the sheets of ``prepared`` (or those numbered in ``sheets``, from 1) to ``port``.

    Every sheet is checked before the first is started. The other arguments are those of
    :func:`cut`. One session with the machine holds from the first frame to the last sheet, for a
    real port in a process of its own (:func:`~miurafab.machine.job_process.session_apart`). Raises
    what :func:`~miurafab.machine.sender.stream_plan` raises.
    """
    done: list[CutSheet] = []
    burnt = None
    prepared = align(prepared, sheets, options.align)
    plans = plan_sheets(prepared, sheets, options)
    at = plans[0][1].at
    waits = needs_person(prepared, port, pause)
    with _session(prepared, port, options, keys) as session:
        for number, plan in plans:
            further = bool(done) or (options.resume and plan.resumption is None)
            name = prepared.jobs[number - 1].name
            fed = pause is None and feeds_itself(prepared.machine, plan.back)
            if further and waits and not fed:
                if before_sheet is not None:
                    with session.waits():
                        before_sheet(number, len(prepared.jobs))
                elif done:
                    raise PersonNeeded(
                        f"Before {name}, {wanted(prepared, number, burnt)}; nobody is here to do "
                        f"so. Then go on with `sheet` {number}. Done: "
                        f"{', '.join(sheet.name for sheet in done)}."
                    )
            if done:
                session.load()
            burnt = number
            placed_at = None if done else options.send.at
            notes = start_findings(prepared, number, plan.resumption, placed_at)
            if on_start is not None:
                for each in notes:
                    on_start(each)
            plan = replace(plan.with_head_at(at), at_pause=at_pause(waits, keys))
            if options.frame:
                head = replace(options, send=replace(options.send, at=at), align=())
                session.frame(frame_plan(prepared, number, head))
                if after_frame is not None:
                    with session.waits():
                        after_frame(number)
                elif is_attended(port, pause):
                    raise PersonNeeded(
                        f"The frame of {prepared.jobs[number - 1].name} is traced, and nobody is "
                        "here to look at it. Cut without `frame`, or say that nobody is to be "
                        "waited for (`pause`)."
                    )
            # A frame has homed the machine.
            home = plan.options.home and not options.frame
            sent = replace(plan, options=replace(plan.options, home=home))
            done.append(
                cut_sheet(prepared, number, sent, session, notes=notes, on_progress=on_progress)
            )
            at = head_after(prepared, number, plan)
    return tuple(done)


def cut_sheet(
    prepared: Prepared,
    number: int,
    plan: JobPlan,
    session: SheetSession,
    *,
    notes: tuple[Finding, ...] = (),
    on_progress: Callable[[SheetProgress], None] | None = None,
) -> CutSheet:
    """Send the ``plan`` of sheet ``number``, with its journal and transcript beside the job.

    ``notes`` are the findings on where it begins and lies.
    """
    job, expected = prepared.jobs[number - 1], prepared.dry_runs[number - 1]
    result = session.cut(
        plan,
        journal_path=journal_path(prepared, job),
        transcript_path=beside(prepared, job, ".transcript"),
        on_progress=placed(
            on_progress, number, expected, prepared.machine.controller.planner_blocks
        ),
    )
    sent = what_is_sent(prepared, number, plan.resumption)
    return CutSheet(
        sent.name,
        result.lines,
        sent.cut_mm,
        sent.travel_mm,
        sent.seconds,
        result,
        (
            *(found for found in expected.findings if found.severity != "refusal"),
            *result.findings,
            *notes,
        ),
    )


def head_after(prepared: Prepared, number: int, plan: JobPlan) -> Head | None:
    """The position of the head after the ``plan`` of sheet ``number``, if it was stated before; for
    a machine that homes before each sheet, where it stands then.
    """
    program = prepared.dry_runs[number - 1].program
    if plan.at is None or plan.options.home or not len(program):
        return plan.at
    x, y, _ = program.end[-1].tolist()
    return x, y


def _session(
    prepared: Prepared, port: str, options: CutOptions, keys: Keys | None
) -> AbstractContextManager[SheetSession]:
    """A session at ``port``: the controller in memory needs no process of its own."""
    begin = session_here if port == VIRTUAL else session_apart
    speed = options.virtual_speed
    return begin(prepared.machine, port, prepared.name, keys=keys, virtual_speed=speed)


def frame(
    prepared: Prepared, number: int, *, port: str, options: CutOptions = DEFAULT_OPTIONS
) -> StreamResult:
    """Trace the box around what sheet ``number`` (from 1) burns, beam off or as a pointer."""
    with _session(prepared, port, options, None) as session:
        return session.frame(frame_plan(prepared, number, options))


def frame_plan(
    prepared: Prepared,
    number: int,
    options: CutOptions = DEFAULT_OPTIONS,
    back_to: tuple[float, float] | None = None,
) -> JobPlan:
    """The job of :func:`frame`, that goes ``back_to`` a place, or to where the head is put."""
    prepared = align(prepared, prepared.chosen([number]), options.align)
    bounds = prepared.dry_runs[number - 1].bounds_mm
    name = prepared.jobs[number - 1].name
    if bounds is None:
        raise InputError(f"{name} burns nothing, so there is no frame to trace.")
    box = frame_job(
        name,
        bounds,
        prepared.machine,
        pointer=options.pointer,
        back_to=back_to or head_at(options.send.at or (0.0, 0.0), bounds, name),
    )
    start = replace(options.send, check_mode=False, allow_m3=False)
    return plan_job(box, prepared.machine, start, box=bounds)
