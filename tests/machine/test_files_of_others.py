"""Files as other programs write them: each is burnt where it says, or refused in a sentence.

The files, and what becomes of each in closed form, are in :mod:`foreign_files`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foreign_files import FILES, Burnt, Refused
from wires import FakeWire

from miurafab.errors import ControllerError, GcodeError
from miurafab.gcode.job import Job
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.workflow.cut import prepare
from miurafab.workflow.cut_options import CutOptions
from miurafab.workflow.cut_sheets import cut_prepared
from miurafab.workflow.dry_run import dry_run, read_gcode

MACHINE = load_machine("grbl-laser-400")
CUT = {name: file for name, file in FILES.items() if isinstance(file, Burnt)}
REFUSED = {name: file for name, file in FILES.items() if isinstance(file, Refused)}
LEAST_TIME, MOST_TIME = 0.985, 1.015
"""The estimate over the time of the simulated firmware, two programs that share no planner loop."""


@pytest.mark.parametrize("name", CUT)
def test_it_is_burnt_where_it_says(name: str, tmp_path: Path) -> None:
    file, path = CUT[name], tmp_path / "foreign.nc"
    path.write_bytes(file.data)
    machine = load_machine(file.machine)
    settings = virtual_settings(machine)
    device = VirtualGrbl(settings, baud=machine.controller.baud, dialect=machine.dialect)
    judged = dry_run("foreign", read_gcode(path), machine, (400.0, 400.0))
    assert {finding.code for finding in judged.findings} - {"m3", "armed"} == file.findings
    assert judged.cut_mm == pytest.approx(file.mm, abs=0.1)
    np.testing.assert_allclose(judged.bounds_mm, file.box, atol=0.02)
    plan = plan_job(read_gcode(path), machine, SendOptions(allow_m3=True))
    result = deliver(replace(plan, at_pause="go on"), FakeWire(device), StopSignals())
    assert file.standing == any(s.standing for s in device.beam_log)
    ends = np.array([((s.x0, s.y0), (s.x1, s.y1)) for s in device.beam_log])
    box = [*ends.min(axis=(0, 1)), *ends.max(axis=(0, 1))]
    np.testing.assert_allclose(box, file.box, atol=0.08)
    if file.timed:
        # The wait for the last status query is the sender's.
        assert result.seconds - 0.25 < judged.seconds * MOST_TIME
        assert result.seconds + 0.05 > judged.seconds * LEAST_TIME


@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_by_line(name: str, tmp_path: Path) -> None:
    file, path = REFUSED[name], tmp_path / "foreign.nc"
    path.write_text(file.text)
    with pytest.raises(GcodeError, match=file.words):
        plan_job(read_gcode(path), load_machine(file.machine), SendOptions(allow_m3=True))


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
