"""The judgement of a job: on each limit nothing is found, one step beyond it the finding is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from miurafab.gcode.job import Job
from miurafab.machine.judge_job import judge_job, longest_line
from miurafab.profiles import MachineProfile, load_machine

LASER, PEN = load_machine("grbl-laser-400"), load_machine("grbl-pen-a4")
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
        (DARK, STROKE + "M5\n", ["laser-mode"]),
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
