"""Several machines share the sheets of one job: each takes the next sheet when it is free.

Every machine has a session in a process of its own (:mod:`miurafab.machine.job_process`), so that
no machine can disturb another. A machine that fails gets no more sheets; its current sheet can be
resumed there. The other machines cut the remaining sheets.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from miurafab.errors import InputError, JobStopped, MiurafabError
from miurafab.findings import Finding
from miurafab.machine.job_process import session_apart
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import Head, JobPlan
from miurafab.machine.sender import SheetSession
from miurafab.machine.session_process import suspending_signals
from miurafab.machine.signals import StopSignals
from miurafab.workflow.cut import Prepared
from miurafab.workflow.cut_options import CutOptions
from miurafab.workflow.cut_sheets import cut_sheet, head_after
from miurafab.workflow.material_change import WAITS, MaterialChange, turns_over
from miurafab.workflow.sheet_plans import journal_path, plan_sheets, start_findings

_LOOK_S = 0.1


@dataclass(frozen=True)
class Shared:
    """The outcome of ``sheet``: the ``port`` that cut it (empty: no machine was left), whether it
    is ``done``, and why not.
    """

    sheet: str
    port: str
    done: bool
    why: str


def share_sheets(
    prepared: Prepared,
    ports: Sequence[str],
    sheets: Sequence[int] | None,
    options: CutOptions,
    *,
    pause: bool | None = None,
    before_sheet: Callable[[int, str, Callable[[], bool]], bool] | None = None,
    on_start: Callable[[str, Finding], None] | None = None,
    on_progress: Callable[[float, str], None],
) -> tuple[Shared, ...]:
    """Cut the sheets of a job directory on the machines at ``ports``; returns the outcomes in the
    order of the sheets.

    Before each further sheet of a machine, and with ``options.resume`` before each that was not
    begun, ``before_sheet`` waits for fresh material there, in a thread of that machine, and ends
    with False when the function that it gets says that nothing is to be waited for; False (or no
    such function) leaves the sheet to another machine.
    ``on_start`` gets the port and each finding on where a sheet lies and begins there.
    ``on_progress`` gets the fraction done and a note when a sheet is done or has failed. A machine
    that fails is part of the answer. With ``options.resume`` each machine first resumes the sheet
    that it was interrupted at. Raises :class:`~miurafab.errors.InputError` for a job that cannot be
    shared, and :class:`~miurafab.errors.JobStopped` after Ctrl-C, with every machine reset.
    """
    if prepared.directory is None:
        raise InputError(
            f"{prepared.name} is no job directory, so machines cannot share it; make one with "
            "'miurafab sheets'."
        )
    if options.frame:
        raise InputError(
            "A frame is looked at before its sheet is cut, and machines that share sheets do not "
            "wait: first trace it at each with 'miurafab machine frame' and the same `port`."
        )
    for name in ("align", "from_stroke"):
        if getattr(options, name):
            raise InputError(
                f"`{name}` is said of a sheet that lies at one machine; name its `port` alone."
            )
    if turns_over(prepared):
        raise InputError(
            f"{prepared.name} works its sheets from both sides, and each is turned over in one "
            "machine; name one `port`."
        )
    twice = {port for port in ports if ports.count(port) > 1 and port != "virtual"}
    if twice:
        raise InputError(f"The port {min(twice)} is named twice.")
    plans = dict(plan_sheets(prepared, sheets, options))
    with suspending_signals() as signals:
        signals.at_once = False
        material = MaterialChange(prepared, ports, pause, before_sheet, signals)
        work = _Work(prepared, options, plans, ports, signals, material, on_start, on_progress)
        threads = [threading.Thread(target=work.at_machine, args=(port,)) for port in ports]
        for thread in threads:
            thread.start()
        for thread in threads:
            while thread.is_alive():
                thread.join(_LOOK_S)
        if signals.caught is not None:
            raise JobStopped(f"{prepared.name} was stopped by {signals.reason} on every machine.")
    return tuple(
        work.outcome.get(number)
        or Shared(prepared.dry_runs[number - 1].name, "", False, work.left_over)
        for number in plans
    )


class _Work:
    def __init__(
        self,
        prepared: Prepared,
        options: CutOptions,
        plans: dict[int, JobPlan],
        ports: Sequence[str],
        signals: StopSignals,
        material: MaterialChange,
        on_start: Callable[[str, Finding], None] | None,
        on_progress: Callable[[float, str], None],
    ) -> None:
        self.outcome: dict[int, Shared] = {}
        self._prepared = prepared
        self._options = options
        self._plans = plans
        self._signals = signals
        self._material = material
        self._on_start = on_start
        self._on_progress = on_progress
        self._own = {port: _begun_at(prepared, plans, port) for port in ports}
        begun = {number for numbers in self._own.values() for number in numbers}
        self._left = deque(n for n in plans if n not in begun)
        for number in self._left:
            if plans[number].resumption is not None:
                raise InputError(
                    f"{prepared.dry_runs[number - 1].name} was interrupted at a machine that is "
                    "not named now; name its `port` too, or resume it with that port alone."
                )

    @property
    def left_over(self) -> str:
        """Why a sheet was cut by none."""
        return WAITS if self._material.missing else "no machine was left to cut it"

    def at_machine(self, port: str) -> None:
        """Cut sheets at ``port`` until none is left, or the machine has failed."""
        with session_apart(
            self._prepared.machine,
            port,
            self._prepared.name,
            virtual_speed=self._options.virtual_speed,
            signals=self._signals,
        ) as session:
            at: Head | None = None
            done = False
            while self._signals.caught is None:
                try:
                    number = (self._own[port] or self._left).popleft()
                except IndexError:
                    return
                fresh = self._options.resume and self._plans[number].resumption is None
                further = done or (fresh and self._material.asks)
                try:
                    if further and not self._fresh_is_in(number, port, session):
                        self._left.appendleft(number)
                        return
                except MiurafabError as error:
                    self._note(number, port, str(error))
                    return
                self._tell_start(number, port, first=not done)
                plan = self._plans[number]
                plan = replace(plan, at=at if done else plan.at)
                plan = replace(plan, at_pause=self._material.at_pause(port))
                done = True
                why = ""
                try:
                    cut_sheet(self._prepared, number, plan, session)
                except MiurafabError as error:
                    why = str(error)
                self._note(number, port, why)
                if why:
                    return
                at = head_after(self._prepared, number, plan)

    def _fresh_is_in(self, number: int, port: str, session: SheetSession) -> bool:
        with session.waits() as lost:
            is_in = self._material.is_in(number, port, lost)
        session.load()
        return is_in

    def _tell_start(self, number: int, port: str, *, first: bool) -> None:
        """Say where the sheet lies and begins; each machine is told where its head stands once."""
        if self._on_start is not None:
            at = self._options.send.at if first else None
            for finding in start_findings(
                self._prepared, number, self._plans[number].resumption, at
            ):
                self._on_start(port, finding)

    def _note(self, number: int, port: str, why: str) -> None:
        name = self._prepared.dry_runs[number - 1].name
        self.outcome[number] = Shared(name, port, not why, why)
        note = f"{name} at {port} {'failed' if why else 'is done'}"
        self._on_progress(len(self.outcome) / len(self._plans), note)


def _begun_at(prepared: Prepared, plans: dict[int, JobPlan], port: str) -> deque[int]:
    """The interrupted sheets that ``port`` had."""
    begun: deque[int] = deque()
    for number, plan in plans.items():
        path = journal_path(prepared, prepared.jobs[number - 1])
        if plan.resumption is not None and read_journal(path)[-1].port == port:
            begun.append(number)
    return begun
