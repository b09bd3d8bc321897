"""Whole jobs over wires that lose, change and delay bytes, at machines that are held, opened, reset
and unplugged; and what must hold at the end of each, whatever happened.

Every job is made from its seed. The bytes that the host sent and the virtual controller are the
witnesses: the job ended in time, the beam is off and never stood, the journal says how it ended. Of
a wire that changes nothing on the way to the controller, the rest burns each stroke that is
missing, and none twice but those that were told.
"""

from __future__ import annotations

import math
import random
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from wires import FakeWire

from miurafab.errors import InputError, MiurafabError, PersonNeeded
from miurafab.gcode.job import Job
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.resume import Resumption, resume
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.faults import KINDS, Fault
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = load_machine("grbl-laser-400")
LONGEST_S = 900.0
"""On the controller's clock: beyond the longest job and every patience."""
ANSWERS = ("drop-reply", "corrupt-reply")
ALL = tuple(KINDS)
Blow = Callable[[VirtualGrbl], None]
BLOWS: tuple[Blow, ...] = (
    lambda device: device.press_button("hold") or device.press_button("hold", False),
    lambda device: device.press_button("start") or device.press_button("start", False),
    lambda device: device.receive(b"\x84"),  # the lid
)


class Endless(AssertionError):
    """A job waited for ever."""


class Person:
    """Resumes what has been held for five seconds."""

    def __init__(self, device: VirtualGrbl) -> None:
        self.device, self.since = device, 0.0

    def pressed(self) -> str:
        if self.device.state not in ("Hold", "Door"):
            self.since = self.device.now
        if self.device.now - self.since < 5.0:
            return ""
        self.since = self.device.now
        return "r"


class Forgetful(FakeWire):
    """Loses some of the answers on the way to the host, and doubles some."""

    loses = doubles = 0.0

    def _post(self, queue: deque[tuple[float, bytes]], data: bytes) -> None:
        if queue is self._to_host and self.loses:
            *lines, rest = data.split(b"ok\r\n")
            told = (self._random.random() for _ in lines)
            answers = [
                b"" if n < self.loses else b"ok\r\n" * (1 + (n > 1 - self.doubles)) for n in told
            ]
            data = b"".join(a + b for a, b in zip(lines, answers, strict=True)) + rest
        super()._post(queue, data)


def random_job(dice: random.Random) -> Job:
    """Strokes of 4 mm, each at a place of its own, with pauses (M0) and dwells between them."""
    between = ("M0", "M0", "G4 P0.3", "M8", "M8\nM0", "M0\nM0", "M5\nM0\nM4", "G4 P1\nM0")
    lines = ["G21", "G90", "M4 S0"]
    for n in range(dice.randint(4, 40)):
        if dice.random() < 0.25:
            lines.append(dice.choice(between))
        x, y = 6 * (n % 10) + 6, 3 * (n // 10) + 3
        lines += [f"G0 X{x} Y{y}", f"G1 X{x + 4} S500 F{dice.choice((600, 1500, 3000))}"]
    end = dice.choice(("M0\nM5", "M5", "M5\nM0", "M5\nG0 X0 Y0"))
    return Job("random.nc", "\n".join([*lines, end, ""]))


def random_faults(dice: random.Random, kinds: Sequence[str]) -> list[Fault]:
    """Up to four of ``kinds`` at random moments of the job."""
    found = []
    for _ in range(dice.randint(1, 4)):
        kind = dice.choice(kinds)
        value = {
            "bytes": float(dice.randint(1, 12)),
            "s": dice.choice((dice.uniform(0.01, 0.3), dice.uniform(0.3, 4.0), math.inf)),
            "code": float(dice.choice((1, 2, 3, 9))),
            "": 0.0,
        }[KINDS[kind].unit]
        if kind in ("delay", "delay-reply", "slow", "stall"):
            value = dice.uniform(0.01, 0.3 if kind == "slow" else 2.5)
        found.append(Fault(kind, value, at_s=dice.uniform(0.3, 15.0)))
    return found


class Trial:
    """One job of a ``seed``, with faults of ``kinds`` and ``blows``; mutable."""

    def __init__(
        self, seed: int, journal: Path, kinds: Sequence[str], blows: Sequence[Blow] = ()
    ) -> None:
        self.seed, self.journal = seed, journal
        dice = random.Random(seed)
        self.job = random_job(dice)
        steps = dice.choice((80.0, 80.0, 250.0, 4.0, 2.0))
        self.settings = virtual_settings(MACHINE) | {
            10: dice.choice((0, 1, 2, 3)),
            13: dice.choice((0, 0, 1)),
            21: dice.choice((0, 1)),
            100: steps,
            101: steps,
        }
        self.faults = random_faults(dice, kinds)
        self.blows = [
            (dice.uniform(0.3, 15.0), dice.choice(blows))
            for _ in range(dice.randint(0, 3) if blows else 0)
        ]
        self.at_pause = dice.choice(("go on", "stop", "wait"))
        self.latency = dice.choice((0.0, 0.0, 0.004, 0.03))
        self.loses, self.doubles = dice.choice(((0.0, 0.0), (0.02, 0.0), (0.1, 0.0), (0.02, 0.01)))
        self.unchanged = set(kinds) <= {"drop-reply", "corrupt-reply", "delay-reply", "slow"}
        self.burnt: Counter[tuple[int, int]] = Counter()

    def run(self) -> str:
        """The whole trial; in a word, how the first sending ended."""
        self._send(self.faults, self.blows, None)
        how = "done" if self.error is None else type(self.error).__name__
        first = self.error
        while self.error is not None and self.unchanged:
            rest = self._rest()
            if rest is None:
                break
            before = Counter(self.burnt)
            self._send((), (), rest)
            assert self.error is None, (self.seed, self.error)
            self._assert_told(before, rest)
        if self.unchanged:
            assert all(self.burnt[place] for place in self._places()), (self.seed, how, first)
        return how

    def _rest(self) -> Resumption | None:
        try:
            return resume(self.job, MACHINE, read_journal(self.journal))
        except InputError as why:
            if "nothing is left" not in str(why):
                raise
            return None

    def _assert_told(self, before: Counter[tuple[int, int]], rest: Resumption) -> None:
        twice = [n for n, place in enumerate(self._places()) if before[place] < self.burnt[place]]
        twice = [n for n in twice if before[self._places()[n]]]
        assert set(twice) <= set(range(rest.stroke, rest.new_stroke)), (self.seed, twice, rest)

    def _places(self) -> list[tuple[int, int]]:
        count = self.job.text.count("G1 X")
        return [(n % 10, n // 10) for n in range(count)]

    def _send(
        self,
        faults: Sequence[Fault],
        blows: Sequence[tuple[float, Blow]],
        rest: Resumption | None,
    ) -> None:
        device = VirtualGrbl(self.settings, baud=MACHINE.controller.baud, faults=faults)
        wire = Forgetful(device, latency=self.latency, seed=self.seed)
        due = sorted(blows, key=lambda pair: pair[0])

        def look(call: int) -> None:
            if faults and wire.written and b"M4S0" in wire.written[-1][1]:
                wire.loses, wire.doubles = self.loses, self.doubles
            if device.now > LONGEST_S:
                raise Endless(f"seed {self.seed}: it waits for ever, in {device.state}")
            while due and device.now > due[0][0]:
                due.pop(0)[1](device)

        wire.before_call = look
        at_pause = self.at_pause if rest is None else "go on"
        plan = plan_job(self.job, MACHINE, SendOptions(at=(0.0, 0.0)), resumption=rest)
        keys = Person(device) if at_pause == "wait" else None
        self.error: MiurafabError | None = None
        try:
            deliver(
                replace(plan, at_pause=at_pause),
                wire,
                StopSignals(),
                journal_path=self.journal,
                keys=keys,
            )
        except MiurafabError as ended:
            self.error = ended
        wire.before_call = lambda call: None
        self._assert_dark(wire, bool(faults))

    def _assert_dark(self, wire: FakeWire, faulty: bool) -> None:
        run, error, device = read_journal(self.journal)[-1], self.error, wire.device
        if error is None:
            assert run.ended == "done", self.seed
        else:
            assert error.exit_code == (5 if isinstance(error, PersonNeeded) else 3), self.seed
            assert (run.ended, run.why) == ("failed", error.sentence), (self.seed, run, error)
        wire.settle(60.0)
        assert not device.beam_on, (self.seed, str(error))
        kinds = {fault.kind for fault in self.faults} if faulty else set()
        # A firmware that stops in mid-move may wait its step idle delay ($1) with the beam on: in a
        # hang, and where a hold, of somebody or before the reset, ends between two steps.
        holds = len(self.blows) + (error is not None) if faulty else 0
        stops = bool(kinds & {"hang", "stall"}) + holds
        most = 0.026 * stops
        assert standing_seconds(device.beam_log) <= most, (self.seed, str(error))
        lengths: Counter[tuple[int, int]] = Counter()
        for each in device.beam_log:
            place = (math.floor((min(each.x0, each.x1) - 5) / 6), round((each.y0 - 3) / 3))
            lengths[place] += abs(each.x1 - each.x0)
        self.burnt += Counter(place for place, length in lengths.items() if length > 0.3)
