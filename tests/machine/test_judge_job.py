"""The judgement of a job: on each limit nothing is found, one step beyond it the finding is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from miurafab.gcode.job import Job
from miurafab.machine.judge_job import coordinate, judge_job, longest_line
from miurafab.profiles import MachineProfile, load_machine
from miurafab.profiles.machine import ZAxis

LASER, PEN = load_machine("grbl-laser-400"), load_machine("grbl-pen-a4")
MARLIN, HAL = load_machine("marlin-laser-220"), load_machine("grblhal-laser-600")
OLD, PLOTTER = load_machine("grbl09-laser-300"), load_machine("hpgl-cutter-a3")
Z = replace(LASER, z=ZAxis(travel_mm=5.0, max_rate_mm_min=300.0, acceleration_mm_s2=100.0))
UNEVEN = replace(LASER, motion=replace(LASER.motion, max_rate_y_mm_min=3000.0))
DARK = replace(LASER, settings={**LASER.settings, 32: 0.0})
STROKE = "M4 S500\nG1 X10 F600\n"


def codes(text: str, machine: MachineProfile, most_power: float = 1.0) -> list[str]:
    judged = judge_job(Job("a.nc", text), machine, most_power=most_power)
    return sorted(finding.code for finding in judged.findings)


@pytest.mark.parametrize(
    ("machine", "text", "found"),
    [
        (LASER, STROKE + "M5\n", []),
        (LASER, STROKE, ["armed"]),
        (LASER, "G0 X10\n", ["nothing-burnt"]),
        (LASER, "M4 S1000\nG1 X10 F600\nM5\n", []),
        (LASER, "M4 S1001\nG1 X10 F600\nM5\n", ["power"]),
        (LASER, "M4 S5\nG1 X400 Y400 F600\nM5\n", []),
        (LASER, "M4 S5\nG1 X400.1 F600\nM5\n", ["bounds"]),
        (LASER, "M4 S5\nG1 Y-0.1 F600\nM5\n", ["bounds"]),
        (LASER, "M4 S5\nG1 X10 F6000\nM5\n", []),
        (LASER, "M4 S5\nG1 X10 F6001\nM5\n", ["rate"]),
        (LASER, STROKE + "G4 P1\nM5\n", []),  # dark at rest under M4
        (LASER, "M3 S500\nG1 X10 F600\nG4 P1\nM5\n", ["dwell", "m3"]),
        (LASER, "M3 S500\nG1 X10 F600\nG4 P0\nM5\n", ["m3"]),
        (LASER, "M3 S500\nG1 X10 F600\nM5\nG4 P1\n", ["m3"]),
        (LASER, STROKE + "M5\nM0\n", ["pauses"]),
        (LASER, STROKE + "M8\nM5\n", ["air"]),
        (PEN, "M3 S500\nG1 X10 F600\nG4 P1\nM5\n", []),  # a pen that is down stays down
        (DARK, STROKE + "M5\n", ["laser-mode", "m3"]),
        # Without laser mode M4 is as M3, and neither a dwell nor a pause puts it out.
        (OLD, STROKE + "G4 P1\nM5\n", ["dwell", "m3"]),
        (OLD, STROKE + "M0\nM5\n", ["dwell", "m3", "pauses"]),
        (OLD, STROKE + "M5\nM0\n", ["m3", "pauses"]),
        (OLD, STROKE + "S0\nM0\nM5\n", ["m3", "pauses"]),
        (OLD, "M3 S500\nG1 X10 F600\nG0 X20\nM0\nM5\n", ["dwell", "m3", "pauses"]),
        (LASER, "M3 S500\nG1 X10 F600\nM0\nM5\n", ["m3", "pauses"]),
        (MARLIN, "M3 S50\nM0 S5\nM5\n", ["dwell", "m3", "nothing-burnt", "pauses"]),
        (MARLIN, "M3 I\nG1 X9 S50 F600\nM0\nM5\n", ["dwell", "m3", "pauses"]),
    ],
)
def test_what_is_found_on_a_limit_and_beyond_it(
    machine: MachineProfile, text: str, found: list[str]
) -> None:
    assert codes(text, machine) == found


@pytest.mark.parametrize(("power", "found"), [(900, []), (901, ["material"])])
def test_the_most_that_the_material_takes(power: int, found: list[str]) -> None:
    assert codes(f"M4 S{power}\nG1 X10 F600\nM5\n", LASER, most_power=0.9) == found


def test_a_line_fits_to_the_byte() -> None:
    limit = longest_line(LASER)
    fits = "G1X10F600S" + "500".rjust(limit - 10, "0")
    assert len(fits) == limit
    assert codes(f"M4\n{fits}\nM5\n", LASER) == []
    assert codes(f"M4\n{fits.replace('S', 'S0')}\nM5\n", LASER) == ["lines"]


@pytest.mark.parametrize(
    ("machine", "text", "found"),
    [
        (LASER, "M4 S5\nG1 X10 F6000.5\nM5\n", []),  # a feed is rounded to a whole number
        (LASER, "M4 S5\nG1 X10 F6000.6\nM5\n", ["rate"]),
        (LASER, "M4 S5\nG1 X10 Y10 F8000\nM5\n", []),  # 5657 mm/min along each axis
        (LASER, "M4 S5\nG1 X10 Y10 F8500\nM5\n", ["rate"]),
        (UNEVEN, "M4 S5\nG1 X10 F6000\nM5\n", []),
        (UNEVEN, "M4 S5\nG1 Y10 F3001\nM5\n", ["rate"]),
        (LASER, "M4 S5\nG1 X10 F600\nG1 X20 S0 F7000\nM5\n", []),  # without the beam
        (LASER, "M4 S1000.1\nG1 X10 F600\nM5\n", ["power"]),
        (Z, "M4 S5\nG1 X10 F600\nG0 Z3\nG0 Z-2\nM5\n", []),
        (Z, "M4 S5\nG1 X10 F600\nG0 Z-5.001\nM5\n", ["bounds"]),
        (Z, "M4 S5\nG1 Z-3 F9000\nM5\n", []),  # the rates are those of X and Y
        (Z, "M4\nM5\n", ["nothing-burnt"]),
        (LASER, "M4 S5\nG1 X10 F600\nG0 Z-500\nM5\n", []),
        (LASER, "G4 P1\n" + STROKE + "M5\n", []),  # before anything burns
        (LASER, "M3 S500\nG1 X10 F600\nG0 X20\nG4 P1\nM5\n", ["m3"]),  # dark after a travel
        (LASER, "M3 S500\nG1 X10 F600\nX20\nM4\nG4 P1\nM5\n", ["m3"]),
        (LASER, "M3 S500\nG1 X10 F600\nS0\nG4 P1\nM5\n", ["m3"]),
        (LASER, "M3 S500\nG1 X10 F600\nS0\nG1 X20\nS0.5\nG4 P1\nM5\n", ["dwell", "m3"]),
        (MARLIN, "M3 S50\nG4 P1\nM5\n", ["dwell", "m3", "nothing-burnt"]),  # not inline
        (LASER, "M3 S50\nG4 P1\nM5\n", ["m3", "nothing-burnt"]),
        (LASER, "M3 S500\nG1 X10 F600\nM4\nX20\nG4 P1\nM5\n", ["m3"]),
        (LASER, "M4 S500\nG1 X10 F600\nM3\nX20\nG4 P1\nM5\n", ["dwell", "m3"]),
        (LASER, "M4 S5\nG0 X100\nG1 X110 Y10 F8000\nM5\n", []),  # wherever it is
        (LASER, "M4 S5\nG1 X0.5 F6001\nM5\n", ["rate"]),  # however short
        (OLD, STROKE + "M5\n", ["m3"]),  # has no laser mode that could be off
        (PLOTTER, "IN;PU0,0;PD" + 500 * "400,0,400,400," + "0,0;\n", []),  # a line of 6500
        (PEN, "M3 S500\nG1 X10 F600\n", []),
        (PEN, STROKE, []),
    ],
)
def test_each_rule_keeps_to_what_it_is_about(
    machine: MachineProfile, text: str, found: list[str]
) -> None:
    assert codes(text, machine) == found


ALL_ROUND = "G0 X10 Y10\nG1 X60 S500 F3000\nY60\nX10\nY{}\n"
AWAY = ALL_ROUND.replace("10", "110").replace("60", "160").format(110)
INSIDE = "G0 X20 Y20\nG1 X30\nG0 Y25\nG1 X20\nM5\n"
NAMED = "M4 S0\n(operation cut)\n" + ALL_ROUND
M3 = (
    "arms the laser with M3, which keeps the beam on, standing still, if the link to the machine "
    "is lost; use M4, or allow M3 explicitly and stay beside the machine."
)
WAITS = "waits with the beam on at S{}, which burns a hole or starts a fire; switch it off (M5) "
WAITS += "first."


@pytest.mark.parametrize(
    ("machine", "text", "found"),
    [
        (LASER, STROKE, ["armed a.nc: a.nc ends with M4 in force; end it with M5."]),
        (LASER, "G0 X10\n", ["nothing-burnt a.nc: a.nc burns nothing."]),
        (
            LASER,
            STROKE + "M8\nM5\n",
            ["air a.nc: a.nc ends with the air on; M9 is sent after it."],
        ),
        (
            LASER,
            "M4 S1001\nG1 X10 F600\nX20 S1002\nX30 S5\nM5\n",
            [
                "power a.nc:2: a.nc, line 2 (the first of 2) asks for S1001, more than the 1000 "
                "that is full power on grbl-laser-400."
            ],
        ),
        (
            PEN,
            "M3 S500\nG1 X10 F600\nX301\n",
            [
                "bounds a.nc:3: a.nc, line 3 moves to X301 Y0, off the bed of grbl-pen-a4 (300 x "
                "210 mm)."
            ],
        ),
        (
            LASER,
            STROKE + "G1 X-2.5\nX-3 Y500.12345\nM5\n",
            [
                "bounds a.nc:3: a.nc, line 3 (the first of 2) moves to X-2.5 Y0, off the bed of "
                "grbl-laser-400 (400 x 400 mm)."
            ],
        ),
        (
            Z,
            STROKE + "G0 Z-1\nX20 Z-6.25\nZ0\nM5\n",
            [
                "bounds a.nc:4: a.nc, line 4 is the farthest of moves over 6.25 mm in Z, more than "
                "the travel of grbl-laser-400 (5 mm)."
            ],
        ),
        (
            LASER,
            "M4 S5\nG1 X10 F600\nX20 F7000\nX0 F8000\nM5\n",
            [
                "rate a.nc:3: a.nc, line 3 (the first of 2) asks for F7000, above the largest rate "
                "of grbl-laser-400, which will hold."
            ],
        ),
        (
            LASER,
            "M3 S500\nG1 X10 F600\nX20 S300\nG4 P1\nS200\nG4 P2\nM5\n",
            [
                f"m3 a.nc:1: a.nc, line 1 {M3}",
                f"dwell a.nc:4: a.nc, line 4 (the first of 2) {WAITS.format(300)}",
            ],
        ),
        (
            MARLIN,
            "M3 S50\nG4 P1\nG1 X5 F600 S20\nG4 P1\nM5\n",
            [
                f"m3 a.nc:1: a.nc, line 1 {M3}",
                f"dwell a.nc:2: a.nc, line 2 (the first of 2) {WAITS.format(50)}",
            ],
        ),
        (
            LASER,
            STROKE + "M0\nM5\nM0\n",
            [
                "pauses a.nc:3: a.nc, line 3 (the first of 2) waits for a person (M0); the key r "
                "goes on."
            ],
        ),
        (
            LASER,
            "(a)\n(b !)\nG91\n" + STROKE + "M5\nG91 (?)\n",
            [
                "characters a.nc:2: a.nc, line 2 holds '!' in a comment: other senders pass it on, "
                "and the controller would obey it.",
                "relative a.nc:3: a.nc, line 3 begins relative moves (G91); they are posted where "
                "the wire is too slow for absolute moves.",
            ],
        ),
        (
            HAL,
            "G21\nM62 P1\nM65 P1\n" + STROKE + "M5\n",
            [
                "outputs a.nc:2: a.nc, line 2 switches an output (M62 to M65): if the beam hangs "
                "on it, no check here sees that beam."
            ],
        ),
        (
            DARK,
            STROKE + "M5\n",
            [
                "m3 a.nc:1: a.nc, line 1 arms the laser with M4, which is as M3 without laser "
                "mode: it keeps the beam on, standing still, if the link to the machine is lost; "
                "allow M3 explicitly and stay beside the machine.",
                "laser-mode grbl-laser-400: Laser mode is off on grbl-laser-400 ($32=0): the beam "
                "would burn along every travel; set $32=1."
            ],
        ),
        (
            LASER,
            "M4 S0\n" + ALL_ROUND.format(10) + INSIDE,
            [
                "loose a.nc:8: a.nc, line 8 burns inside the closed stroke of line 3; if that "
                "stroke cuts through, the piece lies loose by then."
            ],
        ),
        (
            LASER,
            NAMED.format(10) + INSIDE,
            [
                "islands a.nc:9: a.nc, line 9 burns inside the outline that is cut through from "
                "line 4 on: that piece lies loose by then and may catch fire; cut outlines last."
            ],
        ),
        (
            LASER,
            NAMED.format(10) + AWAY + "G0 X120 Y120\nG1 X130\n" + INSIDE,
            [
                "islands a.nc:16: a.nc, line 16 burns inside the outline that is cut through from "
                "line 4 on: that piece lies loose by then and may catch fire; cut outlines last."
            ],
        ),
        (
            LASER,
            NAMED.format(11) + ALL_ROUND.replace("10", "110").replace("60", "160").format(112)
            + "M5\n",
            [
                "outlines a.nc:7: a.nc, line 7 ends the outline begun in line 4, 1.00 mm from "
                "where that began: the piece would hang on by a thread; close it."
            ],
        ),
        (
            LASER,
            STROKE + f"G1X5F600S{69 * '0'}5\nG1X6F600S{70 * '0'}5 (b)\nG1X7F600S{71 * '0'}5\nM5\n",
            [
                "lines a.nc:4: a.nc, line 4 (the first of 2) has 80 characters without comments "
                "and blanks, more than the controller's 79; split the line."
            ],
        ),
    ],
)  # fmt: skip
def test_a_finding_says_what_it_measured_and_where(
    machine: MachineProfile, text: str, found: list[str]
) -> None:
    judged = judge_job(Job("a.nc", text), machine)
    assert [f"{each.code} {each.where}: {each.sentence}" for each in judged.findings] == found
    assert judged.program is not None
    assert judged.lines == len(judged.program.line_number)


def test_the_power_that_a_material_takes_is_a_part_of_the_range_of_the_machine() -> None:
    """From S100 to S1000 the half is S550; half an S word is rounding."""
    machine = replace(LASER, tool=replace(LASER.tool, s_min=100))
    for power, found in (("550.5", []), ("550.6", ["material"])):
        assert codes(f"M4 S{power}\nG1 X10 F600\nM5\n", machine, most_power=0.5) == found
    judged = judge_job(Job("a.nc", "M4 S900\nG1 X1 F600\nM5\n"), machine, most_power=0.5)
    assert [each.sentence for each in judged.findings] == [
        "a.nc, line 2 asks for S900, more than the S550 that the material takes (its max_power)."
    ]
    assert codes("M3 S900\nG1 X10 F600\nM5\n", PEN, most_power=0.5) == []


@pytest.mark.parametrize(
    ("text", "lines", "found"),
    [
        ("G99\n\n(b)\nM5 ( ! )\n", 2, ["program a.nc: a.nc, line 1: G99"]),
        ("G99\nM5\nX5!\n", 2, ["lines a.nc: a.nc, line 3: '!' is", "program a.nc: a.nc, line 1"]),
        (
            f"M3 S5\nG1 X5 F600\nG99\nG1{78 * '0'}\nM5\n",
            3,
            [
                "lines a.nc: a.nc, line 4: 80 characters without",
                "m3 a.nc:1: a.nc, line 1 arms",
                "program a.nc: a.nc, line 3: G99",
            ],
        ),
    ],
)  # fmt: skip
def test_a_job_that_cannot_be_read_is_judged_by_its_lines(
    text: str, lines: int, found: list[str]
) -> None:
    judged = judge_job(Job("a.nc", text), LASER)
    assert (judged.lines, judged.program) == (lines, None)
    said = [f"{each.code} {each.where}: {each.sentence}" for each in judged.findings]
    assert [each[: len(begin)] for each, begin in zip(said, found, strict=True)] == found


def test_a_line_for_marlin_leaves_room_for_its_number_and_checksum() -> None:
    """``N99999999*255`` are 13 characters of the 95."""
    assert longest_line(MARLIN) == 82
    assert longest_line(LASER) == 79


def test_a_coordinate_is_told_apart_from_a_limit() -> None:
    shown = {
        400.0: "400",
        400.1: "400.1",
        -0.00001: "0",
        -0.5: "-0.5",
        0.12346: "0.1235",
        1e3: "1000",
    }
    assert {value: coordinate(value) for value in shown} == shown


@pytest.mark.parametrize(
    ("arms", "codes"),
    [
        ("M4 I S0", []),
        ("M4 S0 I", []),
        ("M4 S9", ["m3", "laser-mode"]),
        ("M4 I\nm 04", ["m3", "laser-mode"]),
        ("M3 S9", ["m3", "laser-mode"]),
        ("M3 I S9", ["m3"]),
    ],
)
def test_without_its_inline_mode_marlin_burns_along_travels(arms: str, codes: list[str]) -> None:
    text = f"M5\nG0 X1 F3000\n{arms}\nG1 X2 S9 F600\nG0 X4 S0 F3000\nG1 X5 S9 F600\nM5 I\nM5\n"
    found = judge_job(Job("a.nc", text), MARLIN).findings
    assert [each.code for each in found] == codes
    assert not any(each.code == "m3" for each in judge_job(Job("a.nc", "M4 S9\n"), HAL).findings)
    each_off = text.replace("G0 X4", "M5\nG0 X4").replace("G1 X5", f"{arms}\nG1 X5")
    found = judge_job(Job("a.nc", each_off), MARLIN).findings
    assert [each.code for each in found] == codes[:1]
