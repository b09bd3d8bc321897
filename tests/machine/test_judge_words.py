"""The judgement of words: each spelling that a controller obeys is found in its line."""

from __future__ import annotations

import pytest

from miurafab.gcode.job import Job
from miurafab.machine.judge_words import (
    air_after,
    armed_at_the_end,
    characters,
    constant_beam,
    dwells_under_m3,
    in_line,
    leaves_air_on,
    line_of_mist,
    names_other_places,
    outputs,
    relative_moves,
)
from miurafab.profiles import load_machine

LASER, PEN = load_machine("grbl-laser-400"), load_machine("grbl-pen-a4")


def job(text: str) -> Job:
    return Job("a.nc", text)


def test_a_line_is_named_with_how_many_more_there_are() -> None:
    assert in_line("a.nc", 5) == in_line("a.nc", 5, 1) == "a.nc, line 5"
    assert in_line("a.nc", 5, 2) == "a.nc, line 5 (the first of 2)"
    assert in_line("a.nc", 5, 1234) == "a.nc, line 5 (the first of 1,234)"


@pytest.mark.parametrize(
    "line",
    [
        "M3",
        "m3",
        "M03 S5",
        "M 3",
        "M+3",
        "M\t0(tool)03S5",
        "X1M3.0",
        "/M3",
        "S5 M3",
        "M3G1",
        "M 3.5",
    ],
)
def test_m3_is_found_however_it_is_written(line: str) -> None:
    (found,) = constant_beam(job(f"G21\n(M3) M5\n{line}\nM3\n"), LASER)
    assert (found.code, found.where) == ("m3", "a.nc:3")
    assert list(constant_beam(job(line), PEN)) == []


@pytest.mark.parametrize(
    "line", ["M30", "M4", "M33", "M13", "M259", "M-3", "(M3)", ";M3", "M3.0.1", "M3 !", "M(3)5", ""]
)
def test_what_is_no_m3_is_none(line: str) -> None:
    assert list(constant_beam(job(f"{line}\n"), LASER)) == []


@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_a_line_ends_in_each_of_three_ways(end: str) -> None:
    text = end.join(["G21", "(G91)", "g 91", "G91", ""])
    (found,) = relative_moves(job(text))
    assert (found.code, found.where) == ("relative", "a.nc:3")
    (found,) = relative_moves(job(f"G21{end}G0{end}X1 G091"))  # the last line has no end
    assert found.where == "a.nc:3"
    (found,) = relative_moves(job(f"{end}G91"))
    assert found.where == "a.nc:2"
    (found,) = relative_moves(job("G91"))
    assert found.where == "a.nc:1"


@pytest.mark.parametrize("line", ["G+91", "G 9(b)1", "G91.0", "/g09/1 (c)", "G1G91"])
def test_g91_is_found_as_the_firmware_reads_it(line: str) -> None:
    (found,) = relative_moves(job(f"G90\n{line}\n"))
    assert found.where == "a.nc:2"


@pytest.mark.parametrize(
    ("line", "named"),
    [
        *((f"{sign}{n}", True) for sign in ("G", "g+", "G 0") for n in (10, 28.1, 53, 59.2, 92)),
        *(("G30", True), ("G38.2", True), ("G43.1", True), ("G9 1", True), ("G58", True)),
        *(("G1X28", False), ("G90", False), ("G17G21", False), ("(G92)", False), ("G60", False)),
    ],
)
def test_words_that_name_other_places_than_those_of_the_job(line: str, named: bool) -> None:
    assert names_other_places(job(f"G0X5\n{line}\n")) is named


@pytest.mark.parametrize(
    "line", ["G91.1", "G-91", "G347", "G91.01", "G910", "G90", "(G91)", "G1 X9 Y1"]
)
def test_what_is_no_g91_is_none(line: str) -> None:
    assert list(relative_moves(job(line))) == []


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("M3 S5\n", "M3"),
        ("M5\nM04\n", "M4"),
        ("M3\nM4 (M5)\n", "M4"),
        ("M3 M5\nX1\n", None),
        ("M5 M3\n;M5\n", "M3"),
        ("m4\nm5\n", None),
        ("M4\nM2\n", None),
        ("M4\nM30\n", None),
        ("M4\nM20\nM50\n", "M4"),
        ("M4\nM5 !\n", "M4"),  # the line cannot be sent
        ("M+4.\n", "M4"),
        ("M4.5\n", "M4"),
        ("G0\n", None),
    ],
)
def test_the_last_word_decides_whether_the_beam_is_armed(text: str, word: str | None) -> None:
    said = [(each.code, each.where, each.sentence) for each in armed_at_the_end(job(text))]
    sentence = f"a.nc ends with {word} in force; end it with M5."
    assert said == ([] if word is None else [("armed", "a.nc", sentence)])


@pytest.mark.parametrize(
    ("text", "opened"),
    [
        ("M7\n", True),
        ("M5\nm 08\n", True),
        ("M8\nM9\n", False),
        ("M9 M8\n", True),
        ("M8\n(M9)\n", True),
        ("M8\nM2\n", False),
        ("M8\nM30\n", False),
        ("M8\nM3\nM20\nM80\n", True),
        ("M8.0\n", True),
        ("M8.1\n", False),
        ("", False),
    ],
)
def test_the_last_word_decides_whether_the_air_is_open(text: str, opened: bool) -> None:
    assert leaves_air_on(job(text)) is opened


@pytest.mark.parametrize(
    ("line", "before", "after"),
    [
        (b"M8G1X5", False, True),
        (b"M07", False, True),
        (b"M9", True, False),
        (b"M2", True, False),
        (b"M30", True, False),
        (b"M8M9", False, False),
        (b"G1X5", True, True),
        (b"G1X5", False, False),
        (b"M80", False, False),
    ],
)
def test_the_air_after_a_line(line: bytes, before: bool, after: bool) -> None:
    assert air_after(line, before) is after


@pytest.mark.parametrize(
    ("text", "line", "shown"),
    [
        ("(a)\nG0 (b ?)\n(!)\n", 2, "'?'"),
        ("(a ~)", 1, "'~'"),
        ("G0\n;k\u00e4stchen", 2, "'\u00e4'"),
        ("G0\r\n(\x18)", 2, "'\\x18'"),
    ],
)
def test_a_byte_that_a_controller_obeys_in_a_comment_is_shown(
    text: str, line: int, shown: str
) -> None:
    (found,) = characters(job(text))
    assert (found.code, found.where) == ("characters", f"a.nc:{line}")
    assert f"line {line} holds {shown} in a comment" in found.sentence
    assert list(characters(job("(a)\n;b\x7f\n"))) == []


@pytest.mark.parametrize("line", ["M62 P1", "m 63P1", "M64P0", "M65 P0"])
def test_each_word_for_an_output_is_found(line: str) -> None:
    (found,) = outputs(job(f"G0\n{line}\n"))
    assert (found.code, found.where) == ("outputs", "a.nc:2")
    assert list(outputs(job("M6\nM66\n(M62)\nM61\n"))) == []


@pytest.mark.parametrize(
    ("text", "line"),
    [("M8\nm07\nM7\n", 2), ("M7.0", 1), ("M7.1\nM70\n(M7)\nM77", None), ("M8", None)],
)
def test_the_first_mist_is_found(text: str, line: int | None) -> None:
    assert line_of_mist(job(text)) == line


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("M3 S5\nG4 P1\n", [(2, 5.0)]),
        ("S5\n(a)\nM3\nG4 P1\n", [(4, 5.0)]),
        ("M3 S5\nM5\nG4 P1\n", []),
        ("M3 S5\nM4 I\nG4 P1\nM30\nG4 P1\n", []),
        ("M4 I S5\nG4 P1\nm 04 s5\nG4 P1\n", [(4, 5.0)]),
        ("M3 S0\nG4 P1\nS0.5\nG4 P1\n", [(4, 0.5)]),
        ("M3 S5\nG4 S2\nG04 P1\n", [(2, 5.0), (3, 5.0)]),  # the S of a dwell are seconds
        ("M3 S5\nG4 P0\nG4 S0.0\nG4 P-00.\nG4 P0.1\n", [(5, 5.0)]),
        ("M3 S5\nG40\nG4.1\nX4\n", []),
        ("S5\nG4 P1\nM3\n", []),
        ("S5\nG4 P1\n", []),
        ("M3\nG4 P1\n", []),
        ("M3 S+5\nG 4.0 P1\nN7 M 0\nX1 M0\n", [(2, 5.0), (3, 5.0)]),
    ],
)
def test_a_dwell_after_m3_burns_by_the_words_alone(
    text: str, found: list[tuple[int, float]]
) -> None:
    assert dwells_under_m3(job(text)) == found
