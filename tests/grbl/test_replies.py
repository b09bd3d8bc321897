"""Replies parsed: each form, its near misses, and the transcripts' own forms."""

from __future__ import annotations

from dataclasses import asdict, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from miurafab.grbl.events import (
    Alarm,
    Banner,
    Error,
    Event,
    Feedback,
    Modes,
    Ok,
    Options,
    Parameter,
    Setting,
    StartupBlock,
    StatusReport,
    Unknown,
    Version,
)
from miurafab.grbl.replies import parse_reply

FULL = StatusReport(
    state="Hold",
    substate=1,
    work_position=(1.5, -2.0, 0.0),
    planner_free=15,
    rx_free=128,
    line_number=99,
    feed=500.0,
    speed=8000.0,
    pins="XY",
    work_offset=(10.0, 0.0, 0.0),
    overrides=(120, 100, 90),
    accessories="SFM",
)


@pytest.mark.parametrize(
    ("text", "event"),
    [
        ("ok", Ok()),
        ("ok \t", Ok()),
        ("error:20", Error(20, "20")),
        ("error: Bad number format", Error(None, "Bad number format")),
        ("error: limit of X \t", Error(None, "limit of X")),
        ("ALARM:3", Alarm(3, "3")),
        ("Grbl 1.1h ['$' for help]", Banner("Grbl", "1.1h")),
        ("GrblHAL 1.1f ['$' or '$HELP' for help]", Banner("GrblHAL", "1.1f")),
        ("Grbl 3.7 [FluidNC v3.7.4 (wifi) '$' for help]", Banner("Grbl", "3.7")),
        ("[MSG:Caution: Unlocked]", Feedback("Caution: Unlocked")),
        ("[VER:1.1h.20190830:my laser]", Version("1.1h.20190830", "my laser")),
        ("[VER:1.1h.20190830:beam: 5 W]", Version("1.1h.20190830", "beam: 5 W")),
        ("[OPT:V,15,128]", Options("V", 15, 128)),
        ("[OPT:VL]", Options("VL", None, None)),
        ("[OPT:VNMSL,35,1024,3,0]", Options("VNMSL", 35, 1024)),
        ("[OPT:V,15,128,A]", Options("V", 15, 128)),
        ("[0.9j.20160303:mine]", Version("0.9j.20160303", "mine")),
        ("[GC:G0 G54 M5 F0 S0]", Modes(("G0", "G54", "M5", "F0", "S0"))),
        ("[G0 G54 G21 M0 F0.]", Modes(("G0", "G54", "G21", "M0", "F0."))),
        ("[G54:1.000,2.000,0.000]", Parameter("G54", (1.0, 2.0, 0.0))),
        ("[TLO:0.000]", Parameter("TLO", (0.0,))),
        ("$N0=G54", StartupBlock(0, "G54")),
        ("$N1=", StartupBlock(1, "")),
        ("$110=6000.000", Setting(110, "6000.000")),
        ("$0=10 (step pulse, usec)", Setting(0, "10")),
        (
            "<Sleep|MPos:0.000,0.000,0.000|FS:0,0>",
            StatusReport("Sleep", machine_position=(0.0, 0.0, 0.0), feed=0.0, speed=0.0),
        ),
        (
            "<Hold:1|WPos:1.500,-2.000,0.000|Bf:15,128|Ln:99|FS:500,8000|Pn:XY"
            "|WCO:10.000,0.000,0.000|Ov:120,100,90|A:SFM>",
            FULL,
        ),
        (
            "<Run,MPos:1.000,0.000,0.000,WPos:0.000,0.000,0.000>",
            StatusReport("Run", machine_position=(1.0, 0.0, 0.0), work_position=(0.0, 0.0, 0.0)),
        ),
        ("<Idle|MPos:1,2|F:300|New:1>", StatusReport("Idle", machine_position=(1, 2), feed=300)),
        ("<Idle|MPos:1,2|Pn:X:Y>", StatusReport("Idle", machine_position=(1, 2), pins="X:Y")),
    ],
)
def test_each_form(text: str, event: Event) -> None:
    assert parse_reply(text) == event


@pytest.mark.parametrize(
    "text",
    [
        "",
        "ook",
        " ok",
        "okok",
        "OK",
        "xok",
        "error",
        "<Idle|MPos:1,2,x|FS:0,0>",
        "<Idle|MPos:1,2,3",
        "<Idle|FS>",
        "<Idle|MPos:0,0,0|noise>",
        "<|MPos:0,0,0>",
        "<Idle|MPos:1,nan,2>",
        "<Idle|FS:1>",
        "<Idle|Bf:15>",
        "[OPT:V,a,b]",
        "[XYZ:1]",
        "$=1",
        "Grbl",
        "[GC:]",
        "[GC:T0 F0]",
        "[G54:1.000,nan]",
        "[G54:1.000,,2.000]",
        "[PRB:0.500,0.000,0.000:1]",
        "$N=G54",
        ">G54:ok",
    ],
)
def test_near_misses_and_lines_without_use_are_unknown(text: str) -> None:
    assert parse_reply(text) == Unknown(text)


@given(st.text())
@settings(max_examples=300)
def test_parsing_never_raises(text: str) -> None:
    assert isinstance(parse_reply(text), Event)


@pytest.mark.parametrize(
    ("fields", "on", "off"),
    [
        ("FS:0,0", False, True),
        ("FS:0,1", True, False),
        ("FS:0,0.001", True, False),
        ("FS:500,0", False, True),
        ("FS:500,0,8000", False, True),  # grblHAL tells the speed that it measures, too
        ("FS:0,0|A:FM", False, True),
        ("FS:0,0|A:SF", True, False),
        ("FS:0,0|A:C", True, False),
        ("F:0|A:S", True, False),
        ("F:500", False, False),
    ],
)
def test_the_beam_is_on_or_off_only_where_that_is_said(fields: str, on: bool, off: bool) -> None:
    report = parse_reply(f"<Idle|MPos:0,0,0|{fields}>")
    assert isinstance(report, StatusReport)
    assert (report.beam_on, report.beam_off) == (on, off)


def test_a_field_that_a_report_has_not_is_none() -> None:
    report = parse_reply("<Idle|New:1>")
    assert isinstance(report, StatusReport)
    values = asdict(report)
    assert values.pop("state") == "Idle"
    assert set(values.values()) == {None}


def test_a_report_in_inches_is_scaled_in_its_positions_alone() -> None:
    report = StatusReport("Run", machine_position=(1.0, -2.0), feed=3.0)
    inches = replace(report, machine_position=(25.4, -50.8))
    assert report.scaled(25.4) == inches
    assert replace(FULL, machine_position=None).scaled(2.0) == replace(
        FULL, work_position=(3.0, -4.0, 0.0), work_offset=(20.0, 0.0, 0.0)
    )


@pytest.mark.parametrize("lost", [">", "<"])
def test_a_long_report_that_lost_its_end_is_read_at_once(lost: str) -> None:
    """The time doubled with each comma: a report that ran into the next hung the sender."""
    whole = "<Idle" + "|MPos:0.000,1.5,-2" * 100 + ">"
    assert isinstance(parse_reply(whole), StatusReport)
    assert parse_reply(whole.replace(lost, "")) == Unknown(whole.replace(lost, ""))
