"""The dialects of the simulated controller, as a sender sees them."""

from __future__ import annotations

import pytest

from miurafab.grbl.events import (
    Alarm,
    Banner,
    Error,
    Ok,
    Options,
    Setting,
    StatusReport,
    Version,
)
from miurafab.grbl.replies import parse_reply
from miurafab.simulate.grbl.controller import VirtualGrbl
from miurafab.simulate.grbl.dialect import DIALECTS

NAMES = tuple(DIALECTS)


def ready(dialect: str, settings: dict[int, float] | None = None) -> VirtualGrbl:
    device = VirtualGrbl(settings or {30: 1000, 31: 0}, baud=115_200, dialect=dialect)
    device.advance(0.2)
    return device


def said(device: VirtualGrbl, data: bytes, seconds: float = 0.5) -> list[str]:
    device.take_output()
    device.receive(data)
    device.advance(seconds)
    return device.take_output().decode().splitlines()


@pytest.mark.parametrize(
    ("dialect", "firmware", "version"),
    [
        ("grbl-1.1", "Grbl", "1.1h"),
        ("grbl-0.9", "Grbl", "0.9j"),
        ("grblhal", "GrblHAL", "1.1f"),
        ("fluidnc", "Grbl", "3.7"),
    ],
)
def test_the_banner_is_its_own(dialect: str, firmware: str, version: str) -> None:
    device = VirtualGrbl(dialect=dialect)
    blank, banner = device.take_output().decode().splitlines()
    assert blank == ""
    assert parse_reply(banner) == Banner(firmware, version)


def test_what_0_9_says_is_in_words_and_commas() -> None:
    device = ready("grbl-0.9")
    assert said(device, b"?") == ["<Idle,MPos:0.000,0.000,0.000,WPos:0.000,0.000,0.000>"]
    said(device, b"$10=15\n")
    report = parse_reply(said(device, b"?")[0])
    assert isinstance(report, StatusReport)
    assert report.work_position == (0.0, 0.0, 0.0)
    assert said(device, b"?")[0].endswith(",Buf:0,RX:0>")
    assert said(device, b"G99\n") == ["error: Unsupported command"]
    assert said(device, b"G1X5\n") == ["error: Undefined feed rate"]
    assert said(device, b"G2X5F100\n") == ["error: Invalid gcode ID:35"]
    assert parse_reply("error: Undefined feed rate") == Error(None, "Undefined feed rate")
    assert said(device, b"$G\n")[0] == "[G0 G54 G17 G21 G90 G94 M0 M5 M9 T0 F0. S0.]"
    assert said(device, b"$I\n") == ["[0.9j.20160303:]", "ok"]
    listed = said(device, b"$$\n")
    assert listed[0] == "$0=10 (step pulse, usec)"
    assert "$3=0 (dir port invert mask:00000000)" in listed
    assert "$121=10.000 (y accel, mm/sec^2)" in listed
    assert {30, 31, 32}.isdisjoint(
        event.number for line in listed if isinstance(event := parse_reply(line), Setting)
    )
    assert said(device, b"$32=1\n") == ["error: Invalid statement"]
    device.receive(b"G1X50F500\n")
    device.advance(0.5)
    assert said(device, b"\x18", 1.5)[0] == "ALARM: Abort during cycle"
    assert parse_reply("ALARM: Hard limit") == Alarm(None, "Hard limit")


@pytest.mark.parametrize("mask", range(16))
def test_a_report_of_0_9_holds_what_setting_10_asks_for(mask: int) -> None:
    device = ready("grbl-0.9")
    said(device, b"$10=%d\n" % mask)
    fields = ["MPos:0.000,0.000,0.000", "WPos:0.000,0.000,0.000", "Buf:0", "RX:0"]
    asked = [field for bit, field in enumerate(fields) if mask >> bit & 1]
    assert said(device, b"?") == [f"<{','.join(['Idle', *asked])}>"]


def test_0_9_has_no_jog_no_overrides_no_laser_mode_and_no_sleep() -> None:
    device = ready("grbl-0.9", {30: 1000, 31: 0, 32: 0})
    assert said(device, b"$J=X5F100\n") == ["error: Bad number format"]
    assert said(device, b"$SLP\n") == ["error: Bad number format"]
    # What is an override for others is one more byte of the line here.
    assert said(device, b"G0\x91X1\n") == ["error: Expected command letter"]
    device = ready("grbl-0.9", {30: 1000, 31: 0, 32: 0})
    said(device, b"M4S500\n")
    assert device.beam_on  # no laser mode: it burns where it stands
    assert said(device, b"@?", 1.0)[-1].startswith("<Door,")


@pytest.mark.parametrize("dialect", NAMES)
def test_the_receive_buffer_has_its_size(dialect: str) -> None:
    device = ready(dialect)
    said(device, b"!")
    device.receive(b"G0X1\n" * 300)
    device.advance(1.0)
    assert device.lost_bytes == 1500 - DIALECTS[dialect].rx_bytes


@pytest.mark.parametrize("dialect", NAMES)
def test_a_line_may_be_as_long_as_it_says(dialect: str) -> None:
    chars = DIALECTS[dialect].line_chars
    device = ready(dialect)
    fits = b"G0X1." + b"0" * (chars - 5)
    answers = [said(device, fits + b"\n"), said(device, fits + b"0\n")]
    assert answers[0] == ["ok"]
    kinds = [type(parse_reply(answer[-1])) for answer in answers]
    assert kinds == [Ok, Error]


@pytest.mark.parametrize("dialect", NAMES)
def test_the_planner_has_its_size(dialect: str) -> None:
    device = ready(dialect)
    blocks = DIALECTS[dialect].planner_blocks
    device.receive(b"G91\n")
    device.advance(0.1)
    device.take_output()
    answered = 0
    for _ in range(blocks + 10):
        device.receive(b"G1X0.4F30\n")
        device.advance(0.02)
        answered += device.take_output().count(b"ok")
    # The line that finds the planner full waits; one move is in the stepper's hands meanwhile.
    assert answered in (blocks, blocks + 1)


def test_grblhal_knows_more_bytes_and_tells_its_sizes() -> None:
    device = ready("grblhal")
    assert said(device, b"\x80")[0].startswith("<Idle|")
    assert said(device, b"\x87")[0].startswith("<Idle|")
    info = [parse_reply(line) for line in said(device, b"$I\n")]
    assert info[0] == Version("1.1f.20240417", "")
    assert info[1] == Options("VNMSL", 35, 1024)
    assert said(device, b"\xff\x8f?")[0].startswith("<Idle|")  # dropped, as by GRBL 1.1
    device.receive(b"G1X20F500\n")
    device.advance(0.5)
    assert said(device, b"\x82?", 1.0)[-1].startswith("<Hold:")
    said(device, b"\x81", 0.2)
    assert device.state == "Run"


@pytest.mark.parametrize("dialect", NAMES)
def test_only_an_eeprom_makes_deaf(dialect: str) -> None:
    device = ready(dialect)
    device.receive(b"G10L2P1X1.234Y5.678\n" + b"G0X1\n" * 15)
    device.advance(1.0)
    assert (device.lost_bytes > 0) == dialect.startswith("grbl-")


def test_fluidnc_keeps_its_settings_elsewhere() -> None:
    device = ready("fluidnc", {30: 1000, 31: 0, 32: 1})
    assert said(device, b"$$\n") == ["$10=1", "ok"]
    info = [parse_reply(line) for line in said(device, b"$I\n")]
    assert info[:2] == [Version("3.7 FluidNC v3.7.8", ""), Options("PHSW", None, None)]
    assert said(device, b"$G\n")[0].startswith("[GC:G0 G54 ")
    said(device, b"M4S500\n")
    assert not device.beam_on  # laser mode, as its config.yaml says
