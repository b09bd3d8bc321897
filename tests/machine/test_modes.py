"""A job burns the same place and size whatever modes the controller is in: by its beam log."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from wires import FakeWire

from miurafab.errors import ControllerError, GcodeError, PortError
from miurafab.gcode.job import Job
from miurafab.grbl.connection import Connection
from miurafab.machine.modes import SET
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.progress import StreamResult
from miurafab.machine.sender import deliver
from miurafab.machine.session import Session
from miurafab.machine.signals import StopSignals
from miurafab.machine.trace_box import frame_job
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = load_machine("grbl-laser-400")
SAID = "G21\nG90\nM4 S0\nG0 X10 Y10\nG1 X20 S500 F3000\nM5\n"
UNSAID = SAID.removeprefix("G21\nG90\n")
BLOCKS = ("G20", "G91", "G55", "G18", "G93", "M8", "G20G91", "G20G55", "G91M8", "G93G18")


def controller(*startup: str, offset: str = "G10L2P2X100Y100", **changes: float) -> VirtualGrbl:
    """A controller with startup blocks, an ``offset`` stored, and settings as ``s13=1``."""
    values = virtual_settings(MACHINE) | {int(name[1:]): value for name, value in changes.items()}
    device = VirtualGrbl(values, baud=MACHINE.controller.baud)
    device.advance(0.1)
    for line in ("$X", offset, *(f"$N{n}={block}" for n, block in enumerate(startup))):
        device.receive(line.encode() + b"\n")
        device.advance(0.5)
    assert b"error" not in device.take_output()
    device.power_cycle()
    return device


def cut(device: VirtualGrbl, text: str, **options: object) -> tuple[StreamResult, np.ndarray]:
    """The result, and the burnt box (x0, y0, x1, y1) in mm of the machine."""
    plan = plan_job(Job("job.nc", text), MACHINE, SendOptions(**options))
    result = deliver(plan, FakeWire(device), StopSignals())
    assert not any(segment.standing for segment in device.beam_log)
    ends = np.array([((s.x0, s.y0), (s.x1, s.y1)) for s in device.beam_log]).reshape(-1, 2)
    return result, np.concatenate([ends.min(axis=0), ends.max(axis=0)])


@pytest.mark.parametrize("text", [SAID, UNSAID], ids=["said", "unsaid"])
@pytest.mark.parametrize("block", BLOCKS)
def test_startup_blocks_change_nothing_that_is_burnt(block: str, text: str) -> None:
    result, box = cut(controller(block), text)
    np.testing.assert_allclose(box, [10, 10, 20, 10], atol=0.06)
    (finding,) = result.findings
    assert finding.code == "modes"
    assert f"runs $N0={block} after each reset" in finding.sentence


@pytest.mark.parametrize("block", ["G20", "G91", "G55"])
def test_the_stated_position_is_set_in_known_modes(block: str) -> None:
    """The head stands at 0 of the machine and is said to be at 5, 5 of the job."""
    _, box = cut(controller(block), UNSAID, at=(5.0, 5.0))
    np.testing.assert_allclose(box, [5, 5, 15, 5], atol=0.06)


@pytest.mark.parametrize(
    ("left", "back"),
    [
        ("G1S700F500", "G0F0S0"),
        ("M4S1", "M5S0"),
        ("G91G20G1F9", "G0F0"),
        ("G43.1Z5", "G49"),
        ("G80", "G0"),
    ],
)
def test_what_the_last_program_left_does_not_burn(left: str, back: str) -> None:
    """A controller that was not reset keeps its power; a job that says none is dark."""
    device = controller()
    device.advance(0.1)
    device.receive(left.encode() + b"\n")
    device.advance(1.0)
    device.take_output()
    wire = FakeWire(device)
    dark = "G21\nG90\nM4\nG0 X10 Y10\nG1 X20 F3000\nM5\n"
    deliver(plan_job(Job("job.nc", dark), MACHINE), wire, StopSignals())
    assert wire.commands.startswith(b"$I\n")  # no reset
    assert f"{SET}{back}\n".encode() in wire.commands
    assert device.beam_log == []


def test_both_blocks_are_named_and_what_was_set() -> None:
    result, _ = cut(controller("G20", "M8"), SAID)
    (finding,) = result.findings
    assert finding.sentence == (
        "The controller was in G20 (inches), M8 (air or coolant on) and runs $N0=G20 and $N1=M8 "
        "after each reset; G21G90G17G94G54M9 was sent, so that the job begins in mm, absolute, "
        "with the work offset G54."
    )


def test_what_the_opening_undid_is_told_beside_what_it_left() -> None:
    class Port(FakeWire):
        blocks = True

    plan = plan_job(Job("job.nc", SAID), MACHINE)
    result = deliver(plan, Port(controller("G20")), StopSignals())
    assert [finding.code for finding in result.findings] == ["modes", "restarted"]


def test_overrides_are_told_beside_the_modes() -> None:
    device = controller("G20")

    class Faster:
        keys = "+"

        def pressed(self) -> str:
            keys = self.keys if device.beam_on else ""
            self.keys = "" if keys else self.keys
            return keys

    plan = plan_job(Job("job.nc", SAID.replace("F3000", "F300")), MACHINE)
    result = deliver(plan, FakeWire(device), StopSignals(), keys=Faster())
    assert [finding.code for finding in result.findings] == ["modes", "overrides"]


def test_the_frame_is_traced_in_mm() -> None:
    device = controller("G20G91")
    wire = FakeWire(device)
    deliver(plan_job(frame_job("a", (1, 1, 9, 9), MACHINE), MACHINE), wire, StopSignals())
    assert device.position[:2] == pytest.approx((0, 0))
    assert f"{SET}\n".encode() in wire.commands
    assert wire.commands.index(SET.encode()) < wire.commands.index(b"G0X1.000Y1.000")


@pytest.mark.parametrize("inches", [0, 1])
@pytest.mark.parametrize(("x", "passes"), [(-390, True), (395, False)])
def test_soft_limits_hold_in_whatever_unit_the_controller_reports(
    inches: int, x: float, passes: bool
) -> None:
    """Machine coordinates run from -400 to 0 mm; the job goes from X0 to X20."""
    device = controller(offset=f"G10L2P1X{x}Y-390", s13=inches, s20=1, s22=1, s24=500, s25=3000)
    if passes:
        result, box = cut(device, SAID, home=True)
        assert result.findings == ()
        np.testing.assert_allclose(box, [x + 10, -380, x + 20, -380], atol=0.06)
    else:
        with pytest.raises(ControllerError, match=r"X405\.000 Y-\d+\.\d+ .* past its soft limits"):
            cut(device, SAID, home=True)


@pytest.mark.parametrize("inches", [0, 1])
def test_progress_is_in_mm(inches: int) -> None:
    seen: list[tuple[float, ...]] = []
    device = controller(s13=inches)
    plan = plan_job(Job("job.nc", SAID + "G0 X40\nG1 X300 F3000\n"), MACHINE)
    deliver(
        plan,
        FakeWire(device),
        StopSignals(),
        on_progress=lambda now: seen.append(now.position or (0.0,)),
    )
    assert max(x for x, *_ in seen) == pytest.approx(300, abs=0.1)
    assert all(b - a < 60 for a, b in itertools.pairwise(x for x, *_ in seen))


def test_a_controller_that_knows_no_such_question_is_still_set() -> None:
    """``$N`` and ``$#`` answered by an error: the modes are set all the same."""
    device = controller()

    class Terse(FakeWire):
        def write(self, data: bytes) -> None:
            super().write(data.replace(b"$N\n", b"$Q\n").replace(b"$#\n", b"$Q\n"))

    plan = plan_job(Job("job.nc", UNSAID), MACHINE)
    assert deliver(plan, Terse(device), StopSignals()).findings == ()
    assert device.position[:2] == pytest.approx((20, 10))


def test_what_the_last_program_left_does_not_burn_where_the_modes_came_damaged() -> None:
    class Noisy(FakeWire):
        def read(self, timeout: float) -> bytes:
            return super().read(timeout).replace(b"[GC:", b"[GD:")

    device = controller()
    device.advance(0.1)
    device.receive(b"G1M4S700F500\n")
    device.advance(1.0)
    device.take_output()
    deliver(plan_job(Job("job.nc", "G1 X10 F3000\nM5\n"), MACHINE), Noisy(device), StopSignals())
    assert device.beam_log == []


def late(seconds: float) -> FakeWire:
    """A board whose boot loader takes ``seconds`` after its port is opened, deaf meanwhile."""

    class Late(FakeWire):
        def write(self, data: bytes) -> None:
            if self.device.now >= seconds:
                super().write(data)

        def read(self, timeout: float) -> bytes:
            data = super().read(timeout)
            if self.device.now >= seconds:
                said, self.held = self.held + data, b""
                return said
            self.held += data
            return b""

    wire = Late(controller())
    wire.held = b""
    return wire


def test_a_board_that_starts_late_is_waited_for() -> None:
    job = Job("job.nc", UNSAID)
    with pytest.raises(PortError, match=r"Nothing that speaks GRBL .*'wait' is 2\.5 s"):
        deliver(plan_job(job, MACHINE), late(8.0), StopSignals())
    wire = late(8.0)
    deliver(plan_job(job, MACHINE, SendOptions(wait=10.0)), wire, StopSignals())
    assert wire.device.position[:2] == pytest.approx((20, 10))
    slow = replace(MACHINE, controller=replace(MACHINE.controller, wait=10.0))
    deliver(plan_job(job, slow), late(8.0), StopSignals())


NEGATIVE = "G21\nG90\nM4 S0\nG0 X-50 Y-50\nG1 X-10 S500 F3000\nG1 Y-10\nM5\nG0 X0 Y0\n"


def test_a_job_in_the_negative_quadrant_is_placed_by_a_homed_machine() -> None:
    """After homing GRBL stands near 0 of its machine coordinates, which run from -400 to 0."""
    with pytest.raises(GcodeError, match="off the bed"):
        plan_job(Job("job.nc", NEGATIVE), MACHINE)
    device = controller(offset="G10L2P1X0Y0", s22=1, s24=500, s25=3000)
    _, box = cut(device, NEGATIVE, home=True)
    np.testing.assert_allclose(box, [-50, -50, -10, -10], atol=0.06)
    beyond = controller(offset="G10L2P1X-360Y0", s22=1, s24=500, s25=3000)
    with pytest.raises(ControllerError, match=r"X-410\.000 Y-50\.000 in its own .*'force' travel"):
        cut(beyond, NEGATIVE, home=True)
    with pytest.raises(GcodeError, match="off the bed"):  # it fits nowhere
        plan_job(Job("job.nc", NEGATIVE + "G0 X380\n"), MACHINE, SendOptions(home=True))


@pytest.mark.parametrize(
    ("text", "unit"), [("0", 1.0), ("0.000", 1.0), ("1", 25.4), ("1.000", 25.4)]
)
def test_the_unit_of_reports_is_a_number_however_it_is_written(text: str, unit: float) -> None:
    class Written(FakeWire):
        def read(self, timeout: float) -> bytes:
            return super().read(timeout).replace(b"$13=0\r", f"$13={text}\r".encode())

    session = Session(Written(controller()), Connection())
    session.greet()
    session.ask("$$")
    assert session.mm_per_unit == unit
