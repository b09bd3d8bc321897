"""Whatever befalls a Marlin or a cutter in memory: the job is done whole, or ends dark and says so.

What must hold: a Marlin makes each line once and in order, since lines are counted and have a
checksum, or is halted; a cutter that knows no checksum draws nothing after it was told to stop.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from miurafab.errors import MachineError
from miurafab.gcode.job import Job
from miurafab.machine.dialects import virtual_machine
from miurafab.machine.faulty import FaultyDevice
from miurafab.machine.planning import plan_job
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import Device, VirtualTransport
from miurafab.machine.virtual_server import load_controller
from miurafab.profiles import MachineProfile, load_machine
from miurafab.simulate.faults import parse_faults
from miurafab.simulate.marlin.controller import VirtualMarlin
from miurafab.simulate.plotter import VirtualPlotter

MARLIN, CUTTER = load_machine("marlin-laser-220"), load_machine("hpgl-cutter-a3")
DASHES = 25
DASHED = Job(
    "dashes.nc",
    "M5\nG21\nG90\nM4 I S0\n"
    + "".join(f"G0 X5 Y{n} S0 F9000\nG1 X15 Y{n} S200 F3000\n" for n in range(DASHES))
    + "M5 I\nM5\nG0 X0 Y0 S0 F9000\n",
)
ROWS = 60
DRAWN = Job(
    "rows.plt",
    "IN;PA;\nPU;SP4;VS20;\n"
    + "".join(f"PU400,{400 + 40 * n};PD600,{400 + 40 * n};\n" for n in range(ROWS))
    + "PU;PU0,0;SP0;\n",
)
SECONDS = 10.0  # about as long as the jobs take
PATIENCE = 60.0  # of the machine's time: then somebody presses Ctrl-C
LATE = ("delay=300ms", "delay-reply=300ms", "slow=5ms", "hang=300ms")
HARMFUL = (
    "drop=3",
    "drop=all",
    "corrupt=2",
    "noise=5",
    "delay=20s",
    "drop-reply=6",
    "drop-reply=all",
    "corrupt-reply=2",
    "noise-reply=3",
    "disconnect",
    "disconnect=500ms",
    "reset",
    "power",
    "hang",
)
dates = st.one_of(
    st.integers(1, 1200).map(str), st.floats(0.05, SECONDS).map(lambda at: f"{at:.4f}s")
)
few = settings(max_examples=5, phases=(Phase.explicit, Phase.generate))


class Wire(VirtualTransport):
    """To a machine at which somebody presses Ctrl-C when it takes far too long."""

    def __init__(self, device: Device) -> None:
        super().__init__(device)
        self.signals = StopSignals()

    def read(self, timeout: float) -> bytes:
        if self.device.now > PATIENCE:
            self.signals.caught = "SIGINT"
        return super().read(timeout)


def sent(job: Job, machine: MachineProfile, device: Device) -> str:
    """What became of ``job``: the error's sentence, or nothing."""
    wire = Wire(device)
    try:
        deliver(plan_job(job, machine), wire, wire.signals)
    except MachineError as error:
        return str(error)
    return ""


def ways(device: Device) -> list[tuple[int, int]]:
    """(X, Y) where each line that was burnt or drawn ends."""
    return [(round(s.x1), round(s.y1)) for s in device.beam_log]


@pytest.mark.parametrize("fault", LATE + HARMFUL)
@given(when=dates)
@few
def test_marlin_makes_each_line_once_or_is_halted(fault: str, when: str) -> None:
    inner = virtual_machine(MARLIN)
    assert isinstance(inner, VirtualMarlin)
    device = FaultyDevice(inner, parse_faults([f"{fault}@{when}"]))
    said = sent(DASHED, MARLIN, device)
    device.advance(60.0)
    assert not inner.beam_on
    assert not any(segment.standing for segment in inner.beam_log)
    whole = [(15, n) for n in range(DASHES)]
    made = ways(inner)
    if said:
        assert fault not in LATE
        assert said.endswith((".", "?"))
        assert made[:-1] == whole[: max(len(made) - 1, 0)]
        assert len(made) <= DASHES
    else:
        assert made == whole


@pytest.mark.parametrize("fault", LATE + HARMFUL)
@given(when=dates)
@few
def test_a_cutter_ends_with_its_tool_up_unless_it_cannot_be_told(fault: str, when: str) -> None:
    inner = virtual_machine(CUTTER)
    assert isinstance(inner, VirtualPlotter)
    device = FaultyDevice(inner, parse_faults([f"{fault}@{when}"]))
    said = sent(DRAWN, CUTTER, device)
    device.advance(120.0)
    whole = [(15, 10 + n) for n in range(ROWS)]
    if fault in LATE:
        assert said == ""
        assert ways(inner) == whole
    if fault in (*LATE, "reset", "power", "drop-reply=6", "noise-reply=3", "corrupt-reply=2"):
        assert not inner.pen_down
    if said:
        assert "lift" in said or "before a line of it was sent" in said
    if fault.startswith("disconnect"):
        assert ways(inner) == whole[: len(inner.beam_log)]


@pytest.mark.parametrize(("job", "machine"), [(DASHED, MARLIN), (DRAWN, CUTTER)])
def test_a_fault_that_never_strikes_changes_nothing(job: Job, machine: MachineProfile) -> None:
    plain, around = virtual_machine(machine), virtual_machine(machine)
    assert sent(job, machine, plain) == ""
    assert sent(job, machine, FaultyDevice(around, parse_faults(["drop@1000000"]))) == ""
    for device in (plain, around):
        device.advance(60.0)
    assert ways(plain) == ways(around)
    assert around.beam_log[-1].t1 == pytest.approx(plain.beam_log[-1].t1, rel=0.02)


@pytest.mark.parametrize("pieces", [1, 7, 400])
def test_how_time_is_cut_into_calls_changes_nothing(pieces: int) -> None:
    def outcome(count: int) -> tuple[bytes, list[tuple[float, ...]]]:
        inner = virtual_machine(MARLIN)
        device = FaultyDevice(inner, parse_faults(["delay-reply=80ms@30", "hang=200ms@0.3s"]))
        device.receive(b"M5\nG21\nM4 I S0\nG1 X20 S99 F3000\nG1 X0 S20 F3000\nM400\nM114\n")
        out = b""
        for _ in range(count):
            device.advance(4.0 / count)
            out += device.take_output()
        return out, [(s.t0, s.t1, s.x1, s.power) for s in inner.beam_log]

    out, log = outcome(pieces)
    expected, burnt = outcome(1)
    assert out == expected
    assert out.count(b"ok\n") == 7
    assert [value for row in log for value in row] == pytest.approx(
        [value for row in burnt for value in row], abs=1e-5
    )


def test_a_marlin_that_hangs_obeys_nothing_until_it_goes_on() -> None:
    device = virtual_machine(MARLIN)
    assert isinstance(device, VirtualMarlin)
    device.receive(b"M4 I S0\nG1 X100 S200 F600\n")
    device.advance(2.0)
    device.freeze(3.0)
    device.receive(b"M112\n")
    device.advance(2.9)
    assert device.beam_on
    assert not device.killed
    device.advance(0.2)
    assert device.killed
    assert not device.beam_on
    device.freeze()
    assert device.next_event_in() is None or device.next_event_in() == math.inf


def test_a_cutter_with_faults_is_not_reset_when_its_port_opens() -> None:
    faults = parse_faults(["reset@1s"])
    assert not load_controller(CUTTER.name, faults).resets_on_open
    assert load_controller(MARLIN.name, faults).resets_on_open
