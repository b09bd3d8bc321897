"""Any fault at any moment over any wire: the job is done whole, or ended with the beam dark.

One property over everything that can befall a job, with the moment and the wire drawn by
Hypothesis. What must hold, whatever happens:

* no byte is lost at the controller (its receive buffer is never overrun);
* the job either is done, every stroke burnt once, or raises one sentence of our own;
* when all is over the beam is off, and it never stood still while it burnt;
* where the host could still reach the controller, nothing but a reset is its last command.
"""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wires import FakeWire

from miurafab.errors import JobStopped, MiurafabError
from miurafab.gcode.job import Job
from miurafab.grbl.settings import virtual_settings
from miurafab.grbl.virtual import VirtualGrbl, standing_seconds
from miurafab.machine.planning import plan_job
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine

MACHINE = load_machine("grbl-laser-400")
STROKES = 25
JOB = Job(
    "job.nc",
    "G21\nG90\nM4 S0\n"
    + "".join(f"G0 X5 Y{n}\nG1 X15 S500 F3000\n" for n in range(STROKES))
    + "M5\nG0 X0 Y0\n",
)
SECONDS = 8.0  # a little longer than the job takes


def interrupt(wire: FakeWire) -> None:
    raise KeyboardInterrupt


def reset_button(wire: FakeWire) -> None:
    wire.device.press_button("reset")
    wire.device.press_button("reset", False)


def limit_switch(wire: FakeWire) -> None:
    wire.device.press_limit("X")


def power_failure(wire: FakeWire) -> None:
    wire.device.power_cycle()


def hang(wire: FakeWire) -> None:
    wire.device.freeze()


def deafness(wire: FakeWire) -> None:
    wire.deaf_at = wire.device.now


def cable_out(wire: FakeWire) -> None:
    wire.cut_at = wire.device.now


def lost_answer(wire: FakeWire) -> None:
    wire.swallow_ok = True


def noise(wire: FakeWire) -> None:
    wire.injections.append((wire.device.now, b"\xfe\x81ok?\r\n"))


def false_answers(wire: FakeWire) -> None:
    wire.injections.append((wire.device.now, b"ok\r\n" * 40))


def nothing(wire: FakeWire) -> None:
    pass


HARMLESS = {nothing}
UNREACHABLE = {cable_out, hang}
FAULTS = (
    interrupt,
    reset_button,
    limit_switch,
    power_failure,
    hang,
    deafness,
    cable_out,
    lost_answer,
    noise,
    false_answers,
    nothing,
)


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
@given(
    when=st.floats(0.05, SECONDS),
    latency=st.sampled_from([0.0, 0.002, 0.016]),
    seed=st.integers(0, 1000),
)
@settings(max_examples=12)
def test_done_whole_or_ended_dark(fault, when: float, latency: float, seed: int) -> None:
    device = VirtualGrbl(virtual_settings(MACHINE) | {21: 1}, baud=115_200)
    struck: list[float] = []

    def strike(call: int) -> None:
        if device.now >= when and not struck:
            struck.append(device.now)
            fault(wire)

    wire = FakeWire(device, latency=latency, seed=seed, before_call=strike)
    error: MiurafabError | None = None
    try:
        result = deliver(plan_job(JOB, MACHINE), wire, StopSignals())
    except MiurafabError as raised:
        error = raised
    # Who hears an ok that was never said cannot count.
    assert device.lost_bytes == 0 or fault is false_answers
    wire.settle()
    burnt = sum(abs(segment.x1 - segment.x0) for segment in device.beam_log)
    if error is None:
        assert result.lines == 5 + 2 * STROKES
        assert burnt == pytest.approx(10 * STROKES, abs=0.5)
    else:
        assert struck
        assert fault not in HARMLESS
        assert str(error).endswith(".")
        assert burnt <= 10 * STROKES + 0.5
        if fault is interrupt:
            assert isinstance(error, JobStopped)
        if fault not in UNREACHABLE and b"G21\n" in wire.bytes_written:
            assert wire.commands.endswith(b"\x18")
            assert device.beam_log == [] or device.beam_log[-1].t1 <= wire.written[-1][0] + 0.05
    assert not device.beam_on
    # A firmware that hangs in mid-move still waits its step idle delay ($1) with the beam on.
    assert standing_seconds(device.beam_log) <= (0.026 if fault is hang else 0.0)
