"""The simulated Marlin controller: its answers, its queue and its beam, by Marlin's own rules."""

from __future__ import annotations

import pytest

from miurafab.marlin.connection import framed
from miurafab.motion.parameters import MotionParameters
from miurafab.profiles import load_machine
from miurafab.simulate.beam import standing_seconds
from miurafab.simulate.marlin.controller import QUEUE, VirtualMarlin

PARAMETERS = MotionParameters.from_profile(load_machine("marlin-laser-220"))


def ready(*, emergency_parser: bool = True) -> VirtualMarlin:
    device = VirtualMarlin(PARAMETERS, emergency_parser=emergency_parser)
    assert device.take_output() == b"start\n"
    return device


def said(device: VirtualMarlin, data: bytes, seconds: float = 0.5) -> list[str]:
    device.receive(data)
    device.advance(seconds)
    return device.take_output().decode().splitlines()


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b"N2 M5*" + b"16" + b"\n", "checksum mismatch"),
        (b"N2 M5\n", "No Checksum with line number"),
        (framed(3, b"M5"), "Line Number is not Last Line Number+1"),
        (framed(1, b"M5"), "Line Number is not Last Line Number+1"),
    ],
)
def test_a_damaged_lost_or_repeated_line_is_asked_for_again(line: bytes, why: str) -> None:
    """``queue.cpp``: an error with the last good line, ``Resend``, and an ``ok``."""
    device = ready()
    assert said(device, framed(0, b"M110N0") + framed(1, b"M5")) == ["ok", "ok"]
    assert said(device, line) == [f"Error:{why}, Last Line: 1", "Resend: 2", "ok"]
    assert said(device, framed(2, b"M5")) == ["ok"]


def test_ok_is_withheld_while_a_command_waits_and_busy_is_said_every_two_seconds() -> None:
    device = ready()
    assert said(device, b"G4 S5\n", 4.9) == ["echo:busy: processing"] * 2
    assert said(device, b"", 0.2) == ["ok"]


def test_the_queue_holds_four_commands_behind_the_current_one() -> None:
    """``BUFSIZE``: further lines wait in the receive ring, and nothing is lost."""
    device = ready()
    assert said(device, b"G4 S1\n" + b"M5\n" * (QUEUE + 3), 0.9) == []
    assert said(device, b"", 0.2) == ["ok"] * (QUEUE + 4)
    assert device.lost_bytes == 0


def test_the_power_goes_with_the_moves_and_rests_dark() -> None:
    """``M3-M5.cpp``: after ``M4 I`` the S of a G1 is burnt in motion only; G0 is dark."""
    device = ready()
    said(device, b"M4 I S0\nG1 X10 S100 F1200\nG0 X20\nG1 X30 S200\n", 5.0)
    assert not device.beam_on
    assert standing_seconds(device.beam_log) == 0.0
    spans = [(round(s.x0), round(s.x1), round(s.power * 255)) for s in device.beam_log]
    assert spans == [(0, 10, 100), (20, 30, 200)]


def test_without_inline_power_the_beam_burns_where_it_stands() -> None:
    device = ready()
    said(device, b"M3 S100\n", 1.0)
    assert device.beam_on
    said(device, b"M5\n")
    assert not device.beam_on
    assert standing_seconds(device.beam_log) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("emergency_parser", [True, False])
def test_a_halt_is_at_once_with_the_emergency_parser_and_else_in_turn(
    emergency_parser: bool,
) -> None:
    """``e_parser.cpp`` reads M112 in the receive interrupt; else it waits for room in the queue."""
    device = ready(emergency_parser=emergency_parser)
    said(device, b"M3 S100\nG4 S10\n" + b"M5\n" * (QUEUE + 1) + b"M112\n")
    assert device.killed is emergency_parser
    assert device.beam_on is not emergency_parser
    device.advance(11.0)
    device.take_output()
    assert device.killed
    assert not device.beam_on
    assert said(device, b"M115\n") == []
    device.power_cycle()
    assert said(device, b"M5\n") == ["start", "ok"]


def test_a_quick_stop_ends_the_motion_and_leaves_the_controller_to_its_user() -> None:
    """``M410`` (``M410.cpp``): what was planned is dropped, and the place is that of the stop."""
    device = ready()
    said(device, b"G1 X100 F1200\n", 1.0)
    said(device, b"M410\n")
    assert not device.killed
    (place,) = [line for line in said(device, b"M114\n") if line.startswith("X:")]
    x = float(place.partition(" ")[0].removeprefix("X:"))
    assert 10 < x < 40
    device.advance(10.0)
    assert said(device, b"M114\n")[0] == place


@pytest.mark.parametrize(("percent", "seconds"), [(50, 2.0), (200, 0.5)])
def test_the_feed_goes_with_its_override(percent: int, seconds: float) -> None:
    device = ready()
    said(device, b"M220 S%d\nM4 I\nG1 X20 F1200 S100\n" % percent, 9.0)
    burnt = device.beam_log[-1].t1 - device.beam_log[0].t0
    assert burnt == pytest.approx(seconds, rel=0.1)


@pytest.mark.parametrize("line", [b"G999", b"X5", b"G1 X5 G0", b"G1 X1 X2", b"M999"])
def test_what_it_does_not_know_is_said_and_answered(line: bytes) -> None:
    code = line.replace(b" ", b"").decode()
    assert said(ready(), line + b"\n") == [f'echo:Unknown command: "{code}"', "ok"]


def test_bytes_beyond_the_receive_ring_are_lost() -> None:
    """``RX_BUFFER_SIZE``: while a command waits, 128 bytes behind it find room."""
    device = VirtualMarlin(PARAMETERS, baud=115_200)
    sent = b"G4 S1\n" + b"M5\n" * 100
    said(device, sent, 0.5)
    assert device.lost_bytes == len(sent) - len(b"G4 S1\n") - 128


def test_a_line_is_cut_off_where_the_line_buffer_ends() -> None:
    """``MAX_CMD_SIZE`` is 96 with the end: the comment and the second word beyond it are lost."""
    device = ready()
    assert said(device, b"G1 X2" + b" " * 90 + b"Y7 F6000\nM114\n", 3.0)[1].startswith(
        "X:2.00 Y:0.00"
    )
