"""What the driver of GRBL takes for silence, for a loss and for a pause, and what for none."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from session_walk import MACHINE
from wires import FakeWire

from miurafab.errors import ControllerError
from miurafab.gcode.job import Job
from miurafab.machine.planning import plan_job
from miurafab.machine.progress import Progress
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings


def new_wire(*faults: str, latency: float = 0.0) -> FakeWire:
    values = virtual_settings(MACHINE)
    device = VirtualGrbl(values, baud=115_200, faults=parse_faults(faults))
    return FakeWire(device, latency=latency, seed=1)


def dawdling(
    wire: FakeWire, seconds: float, when: Callable[[Progress], bool]
) -> Callable[[Progress], None]:
    """Takes ``seconds`` to show the first progress that is so, as a terminal does at Ctrl-S."""
    left = [seconds]

    def show(now: Progress) -> None:
        if left and when(now):
            wire.device.advance(left.pop())

    return show


def test_who_dawdles_while_the_controller_dwells_loses_no_answer() -> None:
    """It idles while it dwells; what the program misses meanwhile is no loss."""
    wire = new_wire()
    job = Job("dwell.nc", "M4 S0\nG1 X20 S500 F3000\nG4 P1\nG1 X30\nM5\n")
    show = dawdling(wire, 9.0, lambda now: now.state == "Idle" and now.in_flight > 0)
    assert deliver(plan_job(job, MACHINE), wire, StopSignals(), on_progress=show).seconds > 9
    assert sum(abs(s.x1 - s.x0) for s in wire.device.beam_log) == pytest.approx(30, abs=0.2)
    assert b"\x18" not in wire.commands


def test_who_dawdles_until_a_dwell_begins_loses_no_answer() -> None:
    """The last answer came long before, as the moves before the dwell are slow."""
    wire = new_wire()
    job = Job("dwell.nc", "M4 S0\nG1 X20 S500 F120\nG4 P2\nG1 X30 F3000\nM5\n")
    show = dawdling(wire, 9.0, lambda now: now.seconds_elapsed > 1)
    result = deliver(plan_job(job, MACHINE), wire, StopSignals(), on_progress=show)
    assert 10 < result.seconds < 15
    assert b"\x18" not in wire.commands


def test_who_dawdles_hears_no_silence_of_a_slow_line() -> None:
    wire = new_wire(latency=0.5)
    job = Job("slow.nc", "M4 S0\nG1 X20 S500 F60\nM5\n")
    show = dawdling(wire, 9.0, lambda now: now.seconds_elapsed > 5)
    assert deliver(plan_job(job, MACHINE), wire, StopSignals(), on_progress=show).lines == 3
    assert b"\x18" not in wire.commands


@pytest.mark.parametrize("latency", [0.0, 0.05])
def test_a_silent_controller_is_reset_within_the_patience(latency: float) -> None:
    wire = new_wire("drop-reply=all@2s", latency=latency)
    job = Job("slow.nc", "M4 S0\nG1 X20 S500 F60\nM5\n")
    with pytest.raises(ControllerError, match=r"said nothing for 3 s"):
        deliver(plan_job(job, MACHINE), wire, StopSignals())
    (reset, *_) = [at for at, data in wire.written if b"\x18" in data]
    assert 4.8 <= reset <= 5.4


def test_a_lost_answer_is_told_before_the_progress_is_shown() -> None:
    wire = new_wire("drop-reply=4@1500ms")
    moves = "".join(f"G1 X{20 + n % 2}\n" for n in range(60))
    job = Job("lost.nc", f"M4 S500 F3000\n{moves}M5\n")
    shown: list[Progress] = []
    with pytest.raises(ControllerError, match=r"idle but has not answered line \d+ of lost"):
        deliver(plan_job(job, MACHINE), wire, StopSignals(), on_progress=shown.append)
    moved = max(now.seconds_elapsed for now in shown if now.state == "Run")
    idle = [now.seconds_elapsed - moved for now in shown if now.seconds_elapsed > moved]
    assert 2.9 <= idle[-1] - idle[0] <= 3.0
    (told, *_) = [at for at, data in wire.written if b"\x18" in data]
    asked = [at for at, data in wire.written if data == b"?" and at < told]
    assert 0.0 <= told - asked[-1] < 0.1
