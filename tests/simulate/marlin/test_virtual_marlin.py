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
