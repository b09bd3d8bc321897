"""What every driver tells while a job runs and at its end, in each dialect."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from session_walk import JOB, MACHINE
from wires import FakeWire

from miurafab.errors import ControllerError, MachineError
from miurafab.gcode.job import Job
from miurafab.machine import stream_driver
from miurafab.machine.append_log import DurableFile
from miurafab.machine.dialects import virtual_machine
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import plan_job
from miurafab.machine.progress import Progress
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import VirtualTransport
from miurafab.profiles import load_machine
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MARLIN, CUTTER = load_machine("marlin-laser-220"), load_machine("hpgl-cutter-a3")
DASHES = "".join(f"G0 X10 Y{n} S0 F9000\nG1 X30 S200 F1000\n" for n in range(1, 12))
JOBS = {
    "marlin": plan_job(Job("a.nc", f"M5\nG21\nG90\nM4 I S0\n{DASHES}M5 I\nM5\n"), MARLIN),
    "hpgl": plan_job(
        Job(
            "a.plt",
            "IN;PA;PU;SP4;VS3;FS80;"
            + "".join(f"PU400,{400 + 40 * n};PD800,{400 + 40 * n};" for n in range(150))
            + "PU;SP0;\n",
        ),
        CUTTER,
    ),
}


class Keys:
    """Pressed at their times on the clock of a wire."""

    def __init__(self, wire: VirtualTransport | FakeWire, *pressed: tuple[float, str]) -> None:
        self._wire, self._left = wire, list(pressed)

    def pressed(self) -> str:
        if self._left and self._wire.now() >= self._left[0][0]:
            return self._left.pop(0)[1]
        return ""


@pytest.mark.parametrize("dialect", ["marlin", "hpgl"])
def test_the_progress_of_a_machine_that_does_not_report_is_told_five_times_a_second(
    dialect: str,
) -> None:
    plan, seen = JOBS[dialect], list[Progress]()
    wire = VirtualTransport(virtual_machine(plan.machine))
    result = deliver(plan, wire, StopSignals(), on_progress=seen.append)
    assert seen[0].seconds_elapsed < 0.06
    steps = [b.seconds_elapsed - a.seconds_elapsed for a, b in pairwise(seen)]
    assert 0.2 - 1e-9 <= min(steps) <= max(steps) < 0.3
    assert 4 * result.seconds < len(seen) <= 5 * result.seconds + 1
    assert {now.in_flight for now in seen} == {0}
    assert {now.position for now in seen} == {None}


def test_a_hold_of_a_machine_without_one_is_told_while_it_lasts() -> None:
    seen: list[Progress] = []
    wire = VirtualTransport(virtual_machine(MARLIN))
    keys = Keys(wire, (4.0, " "), (6.0, "r"))
    deliver(JOBS["marlin"], wire, StopSignals(), keys=keys, on_progress=seen.append)
    assert {now.state for now in seen} == {"Run", "Hold"}
    (before, *_, after) = [now.seconds_elapsed for now in seen if now.state == "Hold"]
    assert after - before == pytest.approx(2.0, abs=0.3)


def new_wire(*faults: str) -> FakeWire:
    values = virtual_settings(MACHINE)
    return FakeWire(VirtualGrbl(values, baud=115_200, faults=parse_faults(faults)))


def test_the_end_of_a_job_says_how_many_lines_the_machine_acknowledged(tmp_path: Path) -> None:
    journal = tmp_path / "journal"
    deliver(JOB, new_wire(), StopSignals(), journal_path=journal)
    with pytest.raises(ControllerError) as caught:
        deliver(JOB, new_wire("alarm@1s"), StopSignals(), journal_path=journal)
    done, failed = read_journal(journal)
    assert done.why == "15 lines acknowledged"
    sentence = str(caught.value)
    assert failed.why == sentence
    end = "15 lines were acknowledged, and the controller was reset and reports the beam off."
    assert sentence.endswith(f" of {end}")


@pytest.mark.parametrize("real", [True, False])
@pytest.mark.parametrize("held", [True, False])
def test_a_job_that_the_computer_slept_through_is_stopped_unless_it_was_held(
    monkeypatch: pytest.MonkeyPatch, real: bool, held: bool
) -> None:
    wire = new_wire()
    wire.blocks = real
    monkeypatch.setattr(stream_driver, "slept_s", lambda: 7.0 + 600.0 * (wire.now() > 3.0))
    slow = plan_job(Job("slow.nc", "M4 S0\nG1 X30 S500 F300\nM5\n"), MACHINE)
    keys = Keys(wire, *([(2.0, " "), (4.0, "r")] if held else []))
    if held or not real:
        deliver(slow, wire, StopSignals(), keys=keys)
        assert wire.device.position[0] == pytest.approx(30.0)
    else:
        with pytest.raises(MachineError, match=r"slept for 600 s while it sent slow\.nc, .* off"):
            deliver(slow, wire, StopSignals(), keys=keys)
        assert wire.commands.endswith(b"\x18")
        assert not wire.device.beam_on


def test_a_journal_has_a_record_for_each_change_of_the_overrides_and_no_other(
    tmp_path: Path,
) -> None:
    wire, journal = new_wire(), tmp_path / "journal"
    slow = plan_job(Job("slow.nc", "M4 S0\nG1 X30 S500 F300\nM5\n"), MACHINE)
    deliver(slow, wire, StopSignals(), journal_path=journal)
    assert b"overrides" not in journal.read_bytes()
    wire = new_wire()
    keys = Keys(wire, (2.0, "+"), (4.0, "-"))
    deliver(slow, wire, StopSignals(), journal_path=journal, keys=keys)
    assert journal.read_bytes().count(b"overrides") == 2


@pytest.fixture
def full_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that has no room for the end of a record."""
    put: Callable[[DurableFile, bytes], None] = DurableFile._put

    def full(self: DurableFile, data: bytes) -> None:
        if b"lines acknowledged" in data:
            raise OSError(28, "No space left on device")
        put(self, data)

    monkeypatch.setattr(DurableFile, "_put", full)


@pytest.mark.usefixtures("full_at_the_end")
def test_a_record_whose_end_cannot_be_written_is_told_of_a_job_that_is_done(tmp_path: Path) -> None:
    result = deliver(JOB, new_wire(), StopSignals(), journal_path=tmp_path / "journal")
    (finding,) = result.findings
    assert finding.code == "records"
    assert "can no longer be written: No space left" in finding.sentence
