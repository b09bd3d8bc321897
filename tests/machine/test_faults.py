"""Any fault at any moment over any wire: the job is done whole, or ended with the beam dark.

One property over everything that can befall a job, with the kind, the moment and the wire drawn by
Hypothesis. What must hold, whatever happens:

* no byte is lost at the controller by an overrun of its receive buffer, unless it was deaf;
* the job either is done, every stroke burnt once, or raises one sentence of our own;
* when all is over the beam is off, and it never stood still while it burnt;
* where the host could still reach the controller, nothing but a reset is its last command;
* the sender never holds more bytes unanswered than the controller has room for, and every line
  that it takes for acknowledged was answered once, in order, as its journal tells.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from wires import FakeWire

from miurafab.errors import JobStopped, MiurafabError
from miurafab.gcode.job import Job
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import plan_job
from miurafab.machine.progress import Progress
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.faults import KINDS, parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.simulate.grbl.dialect import DIALECTS

MACHINE = load_machine("grbl-laser-400")
STROKES = 25
JOB = Job(
    "job.nc",
    "G21\nG90\nM4 S0\n"
    + "".join(f"G0 X5 Y{n}\nG1 X15 S500 F3000\n" for n in range(STROKES))
    + "M5\nG0 X0 Y0\n",
)
LINES = tuple(JOB.send_lines())
SECONDS = 8.0  # a little longer than the job takes
NO_SHRINKING = (Phase.explicit, Phase.generate)  # it would take minutes, and the faults are short
REALTIME = bytes(DIALECTS["grbl-1.1"].realtime)
PATIENCE = 60.0  # of the controller's time: then somebody presses Ctrl-C

HARMLESS = {"delay=300ms", "delay-reply=300ms", "slow=5ms", "hang=300ms"}
"""Faults that a job gets over: it is late, and whole."""
SPOILS_LINES = {"drop=3", "corrupt=2", "noise=5"}
"""Faults after which the controller may get other lines than were sent, none the wiser."""
UNREACHABLE = {"disconnect", "disconnect=500ms", "hang"}
FAULTS = (
    "drop=3",
    "drop=all",
    "corrupt=2",
    "noise=5",
    "delay=300ms",
    "delay=8s",
    "drop-reply=6",
    "drop-reply=all",
    "corrupt-reply=2",
    "noise-reply=3",
    "delay-reply=300ms",
    "delay-reply=8s",
    "slow=5ms",
    "disconnect",
    "disconnect=500ms",
    "reset",
    "power",
    "alarm",
    "alarm=3",
    "stall",
    "hang=300ms",
    "hang",
)


def test_no_kind_of_fault_is_left_out() -> None:
    assert {fault.partition("=")[0] for fault in FAULTS} == set(KINDS)


class Typed:
    """A keyboard on which ``keys`` are pressed, each at its time on the controller's clock."""

    def __init__(self, device: VirtualGrbl, keys: list[tuple[float, str]]) -> None:
        self._device = device
        self._keys = sorted(keys)

    def pressed(self) -> str:
        keys = ""
        while self._keys and self._device.now >= self._keys[0][0]:
            keys += self._keys.pop(0)[1]
        return keys


class Run:
    """The job over a wire with faults, and what was seen of it."""

    def __init__(
        self,
        faults: list[str],
        latency: float,
        seed: int,
        stop_at: float,
        keys: list[tuple[float, str]] | None = None,
    ) -> None:
        # What a hold leaves standing for $1 is the firmware's (test_virtual_beam.py).
        idle = {1: 255} if keys else {}
        device = VirtualGrbl(
            virtual_settings(MACHINE) | idle, baud=115_200, faults=parse_faults(faults)
        )
        self.error: MiurafabError | None = None
        self.seen: list[Progress] = []

        def before_call(call: int) -> None:
            if device.now >= stop_at:
                signals.caught = "SIGINT"

        signals = StopSignals()
        self.wire = FakeWire(device, latency=latency, seed=seed, before_call=before_call)
        with tempfile.TemporaryDirectory() as folder:
            journal = Path(folder) / "journal"
            try:
                deliver(
                    plan_job(JOB, MACHINE),
                    self.wire,
                    signals,
                    journal_path=journal,
                    on_progress=self.seen.append,
                    keys=Typed(device, keys) if keys else None,
                )
            except MiurafabError as raised:
                self.error = raised
            self.journal = read_journal(journal)[-1]
        self.wire.settle()

    @property
    def begun(self) -> bool:
        return b"G21\n" in self.wire.bytes_written

    @property
    def burnt(self) -> float:
        return sum(abs(s.x1 - s.x0) for s in self.wire.device.beam_log)

    def check(self, faults: list[str]) -> None:
        kinds = {fault.partition("@")[0] for fault in faults}
        device = self.wire.device
        sent = self.wire.bytes_written
        if not kinds & (SPOILS_LINES | {"stall", "corrupt-reply=2", "noise-reply=3"}):
            # Who is deaf loses bytes, and who hears an ok that was never said cannot count.
            assert device.lost_bytes == 0
        if self.error is None:
            assert self.journal.ended == "done"
            assert sent.replace(b"?", b"").count(b"\x18") == 0
            if not kinds & SPOILS_LINES:
                assert self.burnt == pytest.approx(10 * STROKES, abs=0.5)
        else:
            assert str(self.error).endswith(".")
            assert "\n" not in str(self.error)
            stopped = isinstance(self.error, JobStopped)
            assert self.error.exit_code == (130 if stopped else 3)
            assert not kinds <= HARMLESS or stopped
            assert self.journal.ended == ("stopped" if stopped else "failed")
            if self.begun and not kinds & UNREACHABLE:
                assert self.wire.commands.replace(b"$I\n", b"").endswith(b"\x18")
        # Lines went out once each, in order; those taken are the first of them.
        lines = b"".join(line.data + b"\n" for line in LINES)
        job, _, after = sent.partition(b"G21G90G17G94G54\n")[2].partition(b"\x18")
        assert lines.startswith(job.translate(None, REALTIME))
        # After a reset nothing is sent but what proves it where no banner came.
        assert not after.replace(b"$I\n", b"").translate(None, REALTIME)
        assert all(0 <= now.in_flight <= 128 for now in self.seen)
        assert [p.lines_acknowledged for p in self.seen] == sorted(
            p.lines_acknowledged for p in self.seen
        )
        if self.journal.taken:
            assert self.journal.line == LINES[self.journal.taken - 1].number
        assert not device.beam_on
        # A firmware that hangs or is deaf in mid-move still waits its step idle delay ($1).
        hung = any(fault.startswith(("hang", "stall")) for fault in faults)
        assert standing_seconds(device.beam_log) <= (0.026 * len(faults) if hung else 0.0)


dates = st.one_of(
    st.integers(1, 1500).map(str), st.floats(0.05, SECONDS).map(lambda at: f"{at:.4f}s")
)
latencies = st.sampled_from([0.0, 0.002, 0.016])


@pytest.mark.parametrize("fault", FAULTS)
@given(when=dates, latency=latencies, seed=st.integers(0, 1000))
@settings(max_examples=4, phases=NO_SHRINKING)
def test_done_whole_or_ended_dark(fault: str, when: str, latency: float, seed: int) -> None:
    faults = [f"{fault}@{when}"]
    Run(faults, latency, seed, PATIENCE).check(faults)


@given(
    faults=st.lists(st.builds("{}@{}".format, st.sampled_from(FAULTS), dates), max_size=3),
    latency=latencies,
    seed=st.integers(0, 1000),
    stop=st.floats(0.5, 2 * SECONDS),
)
@settings(max_examples=25, phases=NO_SHRINKING)
def test_several_faults_and_an_interrupt(
    faults: list[str], latency: float, seed: int, stop: float
) -> None:
    Run(faults, latency, seed, stop).check(faults)


@given(
    faults=st.lists(st.builds("{}@{}".format, st.sampled_from(FAULTS), dates), max_size=1),
    keys=st.lists(
        st.tuples(
            st.floats(0.1, SECONDS), st.sampled_from([" ", "r", "+", "-", "0", "]", "[", "p"])
        ),
        min_size=1,
        max_size=12,
    ),
    latency=latencies,
    seed=st.integers(0, 1000),
    stop=st.sampled_from([PATIENCE, 6.0]),
)
@settings(max_examples=25, phases=NO_SHRINKING)
def test_any_keys_between_any_replies(
    faults: list[str], keys: list[tuple[float, str]], latency: float, seed: int, stop: float
) -> None:
    Run(faults, latency, seed, stop, [*keys, (2 * SECONDS, "r")]).check(faults)
