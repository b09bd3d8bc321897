"""Files as other programs write them: each is burnt where it says, or refused in a sentence.

The expected boxes are what the firmware (GRBL 1.1h) burns; a file of a refusal was refused by it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from wires import FakeWire

from miurafab.errors import ControllerError, GcodeError
from miurafab.gcode.job import Job
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.workflow.cut import prepare
from miurafab.workflow.cut_sheets import CutOptions, cut_prepared
from miurafab.workflow.dry_run import read_gcode

MACHINE = load_machine("grbl-laser-400")
SQUARE = "M4 S0\nG0 X10 Y10\nG1 X50 S500 F3000\nG1 Y50\nG1 X10\nG1 Y10\nM5\n"
LINE = "G21\nG90\nM4 S0\nG0 X10 Y10\nG1 X20 S500 F1000\nM5\n"
BURNT = {
    "lightburn": b"; LightBurn 1.7\n; GRBL device profile\nG00 G17 G40 G21 G54\nG90\nM4\nM8\n"
    b"G0 X10Y10\nG1 X50 S500 F3000\nG1 Y50\nG1 X10\nG1 Y10\nM9\nG1 S0\nM5\nG90\nG0 X0 Y0\nM2\n",
    "lasergrbl raster": b"G90\nM4 S0\nF3000\nG0X10Y10S0\n"
    + b"G1X50S500\nG0Y50S0\nG1X10S400\nM5S0\n",
    "inkscape j-tech": b"M05 S0\nG90\nG21\nG1 F3000\nG1 X10 Y10\nG4 P0\nM03 S255\nG4 P0\n"
    b"G1 F3000.0\nG1 X50 Y10\nG1 X50 Y50\nG1 X10 Y50\nG1 X10 Y10\nG4 P0\nM05 S0\nG1 X0 Y0\n",
    "fusion": b"%\nO1001 (lid)\nG90 G94\nG17\nG21\n" + SQUARE.encode() + b"M30\n%\n",
    "percent alone": b"  %  \n" + SQUARE.encode() + b"%",
    "notepad utf-8": b"\xef\xbb\xbfG21\nG90\n" + SQUARE.encode(),
    "notepad utf-16": ("\ufeffG21\nG90\n" + SQUARE).encode("utf-16-le"),
    "latin-1 comment": b"(K\xe4stchen)\n" + SQUARE.encode(),
    "inches": b"G20\nG90\nM4 S0\nG0 X.393701 Y.393701\nG1 X1.968504 S500 F118\nG1 Y1.968504\nM5\n",
    "lower case, tabs": SQUARE.lower().replace(" ", "\t").replace("\n", "\r\n").encode(),
    "carriage returns": SQUARE.replace("\n", "\r").encode(),
    "block delete": SQUARE.replace("G1 Y50", "/G1 Y50").encode(),
    "arcs": b"M4 S0\nG0 X10 Y30\nG2 X50 Y30 I20 J0 S500 F3000\nG2 X10 Y30 R20\nM5\n",
    "relative": b"G91\nM4 S0\nG0 X10 Y10\nG1 X40 S500 F3000\nG1 Y40\nM5\nG90\n",
}


def wire() -> FakeWire:
    return FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))


@pytest.mark.parametrize("name", BURNT)
def test_it_is_burnt_where_it_says(name: str, tmp_path: Path) -> None:
    path = tmp_path / "foreign.nc"
    path.write_bytes(BURNT[name])
    line = wire()
    plan = plan_job(read_gcode(path), MACHINE, SendOptions(allow_m3=True))
    deliver(plan, line, StopSignals())
    ends = np.array([((s.x0, s.y0), (s.x1, s.y1)) for s in line.device.beam_log]).reshape(-1, 2)
    np.testing.assert_allclose([*ends.min(axis=0), *ends.max(axis=0)], [10, 10, 50, 50], atol=0.06)
    if "j-tech" not in name:  # M3 keeps the beam on where the motion stops
        assert not any(s.standing for s in line.device.beam_log)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("M4 S0\nG0 X10\nG1 X20 S500\nM5\n", r"line 3: .*error:22"),
        ("M4 S0\nG1 X1.2E1 S500 F600\nM5\n", r"line 2: .*error"),
        ("M4 S0\nG1 X F600\nM5\n", r"line 2: .*error"),
        ("M106 S255\nG1 X20 F600\nM107\n", r"line 1: .*M106"),
        ("T2 M6\n" + LINE, r"line 1: .*M6"),
        ("M4 S0\nG2 X20 I5 J5 S500 F600\nM5\n", r"line 2: .*error:33"),
        ("N1 G1 X5 F600*12\n", r"line 1: "),
        ("M4 S0\nG1 A5 S500 F600\nM5\n", r"line 2: "),
        ("M67 E0 Q50\n" + LINE, r"line 1: .*M67"),
        ("o100 call [5]\n" + LINE, r"line 1: "),
        ("M4 S0\nG1 X5 S1200 F600\nM5\n", r"line 2 asks for S1200"),
        ("M3 S500\nG1 X5 F600\nG4 P0.5\nM5\n", r"line 3 waits with the beam on"),
    ],
)
def test_it_is_refused_by_line(text: str, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / "foreign.nc"
    path.write_text(text)
    with pytest.raises(GcodeError, match=complaint):
        plan_job(read_gcode(path), MACHINE, SendOptions(allow_m3=True))


@pytest.mark.parametrize(("build", "passes"), [("V", False), ("VM", True)])
def test_mist_is_refused_by_what_the_controller_was_built_with(build: str, passes: bool) -> None:
    job = Job("foreign.nc", "M4 S0\nM7\nG0 X10\nG1 X20 S500 F1000\nM9\nM5\n")

    class Built(FakeWire):
        def read(self, timeout: float) -> bytes:
            return super().read(timeout).replace(b"[OPT:V,", f"[OPT:{build},".encode())

    line = Built(VirtualGrbl(virtual_settings(MACHINE), baud=MACHINE.controller.baud))
    complaint = r"line 2 switches the air with M7.*'force' program" if not passes else "refused"
    with pytest.raises(ControllerError, match=complaint):
        deliver(plan_job(job, MACHINE), line, StopSignals())
    # The virtual controller is built without it, so it refuses the line itself.
    assert (b"M7\n" in line.commands) is passes


UNKNOWN = "G21\nG90\nM4 S0\nM6\nG0 X10 Y10\nG1 X20 S500 F1000\nM62 P1\nM5\n"


def test_check_mode_asks_the_controller_about_lines_that_nobody_here_knows(tmp_path: Path) -> None:
    path = tmp_path / "foreign.nc"
    path.write_text(UNKNOWN)
    options = CutOptions(send=SendOptions(check_mode=True))
    prepared = prepare(path, machine="grbl-laser-400", unread=options.unread)
    (done,) = cut_prepared(prepared, port="virtual", options=options)
    assert [refusal.line.number for refusal in done.result.errors] == [4, 7]


def test_a_program_that_is_forced_is_sent_until_the_controller_refuses_a_line(
    tmp_path: Path,
) -> None:
    path = tmp_path / "foreign.nc"
    path.write_text(UNKNOWN)
    options = CutOptions(send=SendOptions(force=frozenset({"program"})))
    prepared = prepare(path, machine="grbl-laser-400", unread=options.unread)
    assert [finding.code for finding in prepared.dry_runs[0].findings] == ["program"]
    with pytest.raises(ControllerError, match=r"refused foreign\.nc, line 4 .*beam off"):
        cut_prepared(prepared, port="virtual", options=options)
    with pytest.raises(GcodeError, match=r"line 4: .*M6"):
        prepare(path, machine="grbl-laser-400")
