"""A person at a machine: one session, the sheets to cut, and what may be asked of them when.

An :class:`Operator` stands between a terminal (or lines of words) and the process that holds the
port. It keeps to the rules of the bench: one action at a time; a sheet is started by two deliberate
steps, the second right after the first; and no sheet is started on material that another has burnt.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from miurafab.errors import InputError, MiurafabError, PersonNeeded
from miurafab.gcode.program import strokes
from miurafab.machine.known_controller import MachineState
from miurafab.machine.planning import feeds_itself, put_in
from miurafab.machine.progress import Progress, StreamResult
from miurafab.machine.session_process import Heard, Outcome, SessionProcess
from miurafab.machine.sleeping import SleepWatch, slept_s
from miurafab.machine.transport import VIRTUAL
from miurafab.workflow.cut import Prepared
from miurafab.workflow.cut_options import CutOptions
from miurafab.workflow.cut_sheets import frame_plan
from miurafab.workflow.dry_run import clock_text
from miurafab.workflow.sheet_plans import beside, journal_path, plan_sheets
from miurafab.workflow.timeline import SheetProgress, Timeline

STEPS = (0.1, 1.0, 10.0, 50.0)
"""The steps of a jog key in mm."""
_MOST_SAID = 200
_DONE = {
    "home": "Homed.",
    "unlock": "Unlocked.",
    "set_origin": "The origin is where the head stands.",
    "frame": "The frame was traced.",
    "load": "The sheet is in.",
}


@dataclass(frozen=True)
class Burn:
    """What a start burns, for a person to read first.

    ``sheet`` in a word or two; its ``strokes`` and ``seconds``; ``bounds_mm`` the box around them
    in the coordinates of the job, None without strokes; ``material``, empty for a plain file;
    ``power`` the most of it, as a fraction of full power, ``watts`` the
    same for a laser whose power is known.
    """

    sheet: str
    strokes: int
    seconds: float
    bounds_mm: tuple[float, float, float, float] | None
    material: str
    power: float
    watts: float | None

    def __str__(self) -> str:
        box = self.bounds_mm
        where = "" if box is None else f", X {box[0]:g} to {box[2]:g} Y {box[1]:g} to {box[3]:g} mm"
        return f"{self.sheet}: {self.strokes} strokes, about {clock_text(self.seconds)}{where}"


class Operator:
    """Orders to one session, and what came of them; mutable.

    ``busy`` is the action under way, empty for none. ``number`` is the sheet that is next, from 1.
    ``said`` are lines for a person; ``failures`` what ended the actions that failed. ``asleep``
    tells how long the computer has slept.
    """

    def __init__(
        self,
        process: SessionProcess,
        prepared: Prepared | None,
        options: CutOptions,
        asleep: Callable[[], float] = slept_s,
    ) -> None:
        self.prepared = prepared
        self.number = 1
        self.busy = "open"
        self.armed = False
        self.progress: SheetProgress | None = None
        self.said: deque[str] = deque(maxlen=_MOST_SAID)
        self.failures: deque[MiurafabError] = deque(maxlen=_MOST_SAID)
        self._process, self._options = process, options
        self._timeline: Timeline | None = None
        self._has_origin = False
        self._sleep = SleepWatch(asleep)
        self._burns: dict[int, Burn] = {}
        process.order("open", wait=options.send.wait, reset=options.send.reset)

    @property
    def state(self) -> MachineState | None:
        """The last state of the machine that was told."""
        return self._process.state

    @property
    def over(self) -> bool:
        """Whether the session has ended."""
        return self._process.over

    @property
    def held(self) -> bool:
        """Whether the machine stands in a hold."""
        return self.state is not None and self.state.state.startswith(("Hold", "Door"))

    @property
    def count(self) -> int:
        """The number of sheets."""
        return 0 if self.prepared is None else len(self.prepared.jobs)

    @property
    def wants_material(self) -> str:
        """What a person has to do to the material before the next sheet is started, if anything."""
        if self.prepared is None or self.state is None or self.state.loaded is None:
            return ""
        back = self.prepared.back_of(self.number)
        if self.state.port == VIRTUAL or feeds_itself(self.prepared.machine, back):
            return ""
        return put_in(self.state.loaded.sha256, back)

    # What came

    def take(self) -> bool:
        """Take one message of the session, waiting a moment; whether there was any."""
        message = self._process.poll()
        if isinstance(message, Heard):
            self.said.append(message.text)
        elif isinstance(message, Progress):
            self._place(message)
        elif isinstance(message, Outcome):
            self._end(message)
        self._watch_origin()
        self._watch_for_sleep()
        return message is not None

    def _watch_origin(self) -> None:
        """Say that an origin is gone: a reset ends G92, and a job would begin elsewhere."""
        has_origin = self.state is not None and any(self.state.shift)
        if self._has_origin and not has_origin and self.busy != "set_origin":
            self.said.append("The origin that was set (G92) is forgotten; set it again.")
        self._has_origin = has_origin

    def _watch_for_sleep(self) -> None:
        """Disarm what was armed before the computer slept: the two steps belong together."""
        if slept := self._sleep.slept():
            tail = " Arm the sheet anew." if self.armed else ""
            self.said.append(f"This computer slept for {slept:.0f} s.{tail}")
            self.armed = False

    def _place(self, now: Progress) -> None:
        if self._timeline is not None:
            self.progress = self._timeline.place(self.number, now)

    def _end(self, outcome: Outcome) -> None:
        if outcome.action == self.busy:
            self.busy, self._timeline, self.progress = "", None, None
        if outcome.error is not None:
            self.failures.append(outcome.error)
            return
        result = outcome.value
        if outcome.action == "open" and isinstance(result, MachineState):
            self.said.append(f"{result.firmware} at {result.port}.")
        elif isinstance(result, StreamResult) and outcome.action == "cut":
            self.said.append(
                f"{self.sheet} is done: {result.lines} lines in {clock_text(result.seconds)}."
            )
            self.said += [finding.sentence for finding in result.findings]
            if self.number < self.count:
                self.number += 1
                self.said.append(f"The next is {self.sheet}.")
        elif outcome.action in _DONE:
            self.said.append(_DONE[outcome.action])

    # What is asked

    def do(self, action: str, **options: object) -> None:
        """Have an action of the session carried out; raises ``InputError`` while one is under way.

        Whatever is asked disarms.
        """
        self.armed = False
        self._require_idle()
        self._process.order(action, **options)
        self.busy = action

    def _require_idle(self) -> None:
        if self.busy:
            raise InputError(f"Wait for the end of '{self.busy.replace('_', ' ')}', or stop it.")

    def nudge(self, dx: float, dy: float) -> None:
        """One press of a jog key; nothing while an action is under way."""
        self.armed = False
        if not self.busy:
            self._process.order("nudge", dx=dx, dy=dy)

    def press(self, keys: str) -> None:
        """Pass on keys that act at once: hold, resume, stop, overrides."""
        self.armed = False
        self._process.press(keys)

    def load(self) -> None:
        """Somebody has put in fresh material, or turned the sheet over; raises ``InputError`` while
        an action is under way, which would burn on it.
        """
        self.do("load")

    # The sheets

    @property
    def sheet(self) -> str:
        """The next sheet in a word or two."""
        name = self._job().jobs[self.number - 1].name
        return name if self.count == 1 else f"{name} (sheet {self.number} of {self.count})"

    def put_on(self, prepared: Prepared) -> None:
        """Take another job in place of that before; raises ``InputError`` for one that cannot be
        cut, and while an action is under way.
        """
        prepared.chosen(None)
        self._require_idle()
        self.armed = False
        self.prepared, self.number, self._burns = prepared, 1, {}

    def burn(self) -> Burn:
        """What will burn. A screen asks at each drawing, so it is found once a sheet."""
        if self.number not in self._burns:
            self._burns[self.number] = self._burn()
        return self._burns[self.number]

    def describe(self) -> str:
        """:meth:`burn` in words."""
        return str(self.burn())

    def _burn(self) -> Burn:
        job = self._job()
        expected, tool = job.dry_runs[self.number - 1], job.machine.tool
        burning = expected.program.power[expected.program.beam_on]
        power = float(burning.max()) / tool.s_max if len(burning) else 0.0
        return Burn(
            self.sheet,
            len(strokes(expected.program)),
            expected.seconds,
            expected.bounds_mm,
            "" if job.directory is None else job.directory.layout.material,
            power,
            None if tool.laser is None else power * tool.laser.power,
        )

    def choose(self, number: int) -> None:
        """Make ``number`` the next sheet, if there is such a one and no action is under way."""
        self.armed = False
        self._require_idle()
        if not 1 <= number <= len(self._job().jobs):
            raise InputError(f"{self._job().name} has no sheet {number}.")
        self.number = number

    def frame(self) -> None:
        """Trace the box around the next sheet, and come back."""
        state = self.state
        here = None if state is None or state.position is None else state.position[:2]
        back = None if here is None else (here[0], here[1])
        plan = frame_plan(self._job(), self.number, self._options, back_to=back)
        self.do("frame", plan=plan)

    def arm(self) -> None:
        """The first step of a start; raises where the sheet may not be started now."""
        self._job()
        state = self.state
        if self.busy or state is None or not state.idle:
            word = self.busy or ("" if state is None else state.state)
            raise InputError(f"The machine must be idle before a job is armed; it is in '{word}'.")
        if self.wants_material:
            raise PersonNeeded(
                f"{state.loaded} has burnt on the sheet in the machine; {self.wants_material} and "
                "say so first"
            )
        self.armed = True
        self.said.append(f"Armed. To burn: {self.describe()}.")

    def start(self) -> None:
        """The second step: burn the next sheet; raises ``InputError`` if nothing is armed."""
        if not self.armed:
            raise InputError("Nothing is armed; arm the sheet first, then start it.")
        job, number = self._job(), self.number
        ((_, plan),) = plan_sheets(job, [number], self._options)
        sheet = job.jobs[number - 1]
        self.do(
            "cut",
            plan=replace(plan, at_pause="wait"),
            journal_path=journal_path(job, sheet),
            transcript_path=beside(job, sheet, ".transcript"),
        )
        blocks = job.machine.controller.planner_blocks
        self._timeline = Timeline(job.dry_runs[number - 1], blocks)

    def _job(self) -> Prepared:
        if self.prepared is None:
            raise InputError("No job was named; open the session with one to frame and cut it.")
        return self.prepared

    # The end

    def close(self) -> str:
        """End the session, the machine dark; returns how that ended where it did not end well.

        What still runs is stopped by a reset at once.
        """
        if self.busy:
            self._process.stop()
        self._process.close()
        if self._process.death == "ended with code 0":
            return ""
        return f"The process that held the port {self._process.death}; {self._process.make_safe()}."
