"""HPGL read back: the plotter's moves, and what is refused."""

from __future__ import annotations

import pytest

from miurafab.errors import GcodeError
from miurafab.gcode.hpgl_reader import parse_hpgl
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.program import strokes


def read(text: str):
    return parse_hpgl(Job("job.plt", text))


def test_moves_pens_speed_and_force() -> None:
    program = read("IN;PA;\nPU;SP4;VS5;FS80;\nPU400,800;PD800,800,800,400;\nPU;PU0,0;SP0;\n")
    assert program.end.tolist() == [[10, 20, 0], [20, 20, 0], [20, 10, 0], [0, 0, 0]]
    assert program.power.tolist() == [0, 80, 80, 0]
    assert program.feed_mm_min.tolist() == [0, 3000, 3000, 0]
    assert program.line.tolist() == [3, 3, 3, 4]
    burnt = strokes(program)
    assert burnt.stroke(0)[:, :2].tolist() == [[10, 20], [20, 20], [20, 10]]
    assert burnt.contexts[burnt.context[0]].operation == "cut"
    assert program.line_bytes.sum() == len("IN;PA;\nPU;SP4;VS5;FS80;\n") + len(
        "PU400,800;PD800,800,800,400;\nPU;PU0,0;SP0;\n"
    )


@pytest.mark.parametrize(
    "text",
    [
        "PU40,80;PD80,80;PD80,40;",
        "PU40,80PD80,80,80,40",
        "pu 40 80 ; pd 80 80 80 40 ;",
        "PU;PA40,80;PD;PA80,80;PA80,40;",
        "PU40,80;PR;PD40,0;PD0,-40;PA;",
        "PU40,80;PD80.0,80,80,40.;IN;",
        "IN;\n\n \nPU40,80;PD40,80;PD80,80,80,80,80,40;PD80,40;",
    ],
)
def test_the_ways_to_say_one_stroke(text: str) -> None:
    assert strokes(read(text)).points[:, :2].tolist() == [[1, 2], [2, 2], [2, 1]]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("PU1,2;\nPD3;", r"job\.plt, line 2: PD has 1 coordinates"),
        ("IN;\nAA10,10,90;", "line 2: AA is an HPGL instruction that is not read"),
        ("G0 X1 Y2", "line 1: 'G0 X1 Y2' is not HPGL"),
        (f"IN;\n\nPD{'9' * 400},1;", r"line 3: a number of PD is too large\."),
    ],
)
def test_what_is_not_read_is_refused_by_line(text: str, complaint: str) -> None:
    with pytest.raises(GcodeError, match=complaint):
        read(text)


def test_an_empty_file_draws_nothing() -> None:
    assert len(read("")) == 0
    assert len(read("IN;SP1;PU;")) == 0


def test_marlins_inline_words_are_read_where_the_machine_is_one() -> None:
    job = Job("job.nc", "M5\nM4 I S0\nG0 X1 S0 F6000\nG1 X2 S100 F600\nM5 I\nM5\n")
    program = parse_program(job, inline=True)
    assert program.power.tolist() == [0, 100]
    assert program.feed_mm_min.tolist() == [0, 600]
    with pytest.raises(GcodeError, match="I has no readable number"):
        parse_program(job)
    with pytest.raises(GcodeError, match="error:36"):
        parse_program(Job("job.nc", "M3 I2 S0"), inline=True)


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("X5", r"line 3: 'X5' begins with no command, and Marlin repeats none by itself\."),
        ("X5 F60\nX6", "line 3: 'X5F60' begins with no command"),
        ("G0 X1 M5", "line 3: 'G0X1M5' holds two commands, and Marlin reads one a line"),
        ("M5 G0", "line 3: 'M5G0' holds two commands"),
        ("G10 X1", "line 3: G10 is not a command that a job for Marlin may hold; those are G0, G1"),
    ],
)
def test_what_marlin_would_not_run_is_refused_by_line(line: str, complaint: str) -> None:
    with pytest.raises(GcodeError, match=complaint):
        parse_program(Job("job.nc", f"M4 I S0\nG1 X2 F600 S5\n{line}\n"), inline=True)


def test_marlin_waits_milliseconds_by_p_and_seconds_by_s() -> None:
    program = parse_program(Job("job.nc", "G4 P500\nG04 S2\nG4 S1 P250\n"), inline=True)
    assert program.event_seconds.tolist() == [0.5, 2.0, 1.25]
