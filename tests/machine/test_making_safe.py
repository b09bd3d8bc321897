"""What comes while a machine is being made safe ends nothing half done."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from session_walk import JOB, MACHINE
from wires import FakeWire

from miurafab.errors import ControllerError, JobStopped
from miurafab.gcode.job import Job
from miurafab.grbl.streamer import LineRefused
from miurafab.machine.journal import read_journal
from miurafab.machine.known_controller import PortSetup
from miurafab.machine.machine_session import MachineSession
from miurafab.machine.planning import JobPlan, SendOptions, plan_job
from miurafab.machine.progress import Progress
from miurafab.machine.resume import Resumption
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings


def new_wire() -> FakeWire:
    return FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200))


def caught_at_the_reset(wire: FakeWire) -> StopSignals:
    """Ctrl-C, pressed as soon as a reset is on the wire."""
    signals = StopSignals()

    def press(call: int) -> None:
        if b"\x18" in wire.commands:
            signals.caught = "SIGINT"

    wire.before_call = press
    return signals


def refused() -> JobPlan:
    job = Job("bad.nc", "M4 S500\nG1 X10 F600\nG99\nG1 X20\nM5\n")
    return plan_job(job, MACHINE, SendOptions(force=frozenset({"program"})))


def fail(now: Progress) -> None:
    if now.lines_acknowledged > 5:
        raise ZeroDivisionError("mine")


@pytest.mark.parametrize(
    ("plan", "on_progress", "error"),
    [(refused(), None, LineRefused), (JOB, fail, ZeroDivisionError)],
    ids=["the controller", "the program"],
)
def test_a_signal_while_a_failed_job_is_made_safe_changes_nothing(
    plan: JobPlan, on_progress: Callable[[Progress], None] | None, error: type[Exception]
) -> None:
    """The one reset is confirmed, and what went wrong is what is told."""
    wire = new_wire()
    signals = caught_at_the_reset(wire)
    with pytest.raises(error, match=r"mine|reports the beam off"):
        deliver(plan, wire, signals, on_progress=on_progress)
    assert signals.caught
    assert wire.bytes_written.count(b"\x18") == 1
    assert wire.bytes_written.endswith(b"?")
    wire.settle()
    assert not wire.device.beam_on
    assert wire.closed


def test_a_signal_while_a_session_is_left_changes_nothing() -> None:
    wire = new_wire()
    session = MachineSession(wire, caught_at_the_reset(wire), PortSetup.of(MACHINE))
    session.say("G1 X50 F600")
    assert session.look().state == "Run"
    assert session.close()
    assert wire.closed
    assert wire.bytes_written.count(b"\x18") == 1


def test_a_stop_that_a_signal_ends_half_done_is_done_again_at_the_end() -> None:
    wire = new_wire()
    session = MachineSession(wire, caught_at_the_reset(wire), PortSetup.of(MACHINE))
    assert session.open().state == "Idle"
    with pytest.raises(KeyboardInterrupt):
        session.abort()
    assert session.close()
    assert wire.bytes_written.count(b"\x18") == 2


def test_a_stop_needs_no_greeting() -> None:
    wire = new_wire()
    assert MachineSession(wire, StopSignals(), PortSetup.of(MACHINE)).abort()
    assert wire.commands == b"\x18"


class Pressed:
    """A keyboard."""

    keys = ""

    def pressed(self) -> str:
        keys, self.keys = self.keys, ""
        return keys


def test_keys_are_heeded_again_after_a_stop_and_none_of_those_pressed_meanwhile() -> None:
    wire, keys = new_wire(), Pressed()
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    session.open()

    def press(call: int) -> None:
        keys.keys = " "

    wire.before_call = press
    assert session.abort()
    wire.before_call = lambda call: None
    sent = len(wire.commands)
    session.watch(0.2)
    assert wire.commands[sent:].replace(b"$#\n", b"").replace(b"$G\n", b"") == b""
    keys.keys = "+"
    session.watch(0.2)
    assert wire.commands.endswith(b"\x91")


def test_a_key_in_a_job_is_its_drivers_however_early_it_is_looked_at() -> None:
    """A session acts on keys by itself while no job runs: it would not know that the job ended."""
    wire, keys = new_wire(), Pressed()
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE), keys)
    write = wire.write

    def pressing(data: bytes) -> None:
        write(data)
        if data == b"?" and wire.device.beam_log:
            keys.keys = "q"

    wire.write = pressing  # type: ignore[method-assign]
    with pytest.raises(JobStopped, match=r"^rows\.nc was stopped at the keyboard; "):
        session.cut(JOB)
    assert wire.commands.endswith(b"!\x18")


def test_a_session_that_was_left_is_left_once() -> None:
    wire = new_wire()
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    session.say("G1 X50 F600")
    assert session.close()
    sent = wire.bytes_written
    assert session.close()
    assert wire.bytes_written == sent


def test_a_job_of_which_nothing_was_sent_leaves_the_sheet_fresh() -> None:
    values = virtual_settings(MACHINE) | {32: 0}
    wire = FakeWire(VirtualGrbl(values, baud=115_200))
    session = MachineSession(wire, StopSignals(), PortSetup.of(MACHINE))
    with pytest.raises(ControllerError, match="laser mode"):
        session.cut(JOB)
    assert session.state.loaded is None


# The record that lets a job go on


def test_a_job_that_is_only_read_leaves_no_journal(tmp_path: Path) -> None:
    plan = plan_job(JOB.job, MACHINE, SendOptions(check_mode=True))
    path = tmp_path / "journal"
    assert deliver(plan, new_wire(), StopSignals(), journal_path=path).lines == 15
    assert not path.exists()


@pytest.mark.parametrize("chosen", [False, True])
def test_a_journal_tells_a_chosen_beginning_from_the_rest_of_a_job(
    tmp_path: Path, chosen: bool
) -> None:
    rest = Resumption(JOB.job, JOB.sha256, 7, 2, 2, 6, chosen)
    path = tmp_path / "journal"
    deliver(replace(JOB, resumption=rest), new_wire(), StopSignals(), journal_path=path)
    (run,) = read_journal(path)
    assert (run.from_line, run.chosen) == (7, chosen)
