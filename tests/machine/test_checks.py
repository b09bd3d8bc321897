"""Every pre-flight check fires by its name, is overridden by that name, and by no other."""

from __future__ import annotations

import pytest
from wires import BANNER, FakeWire

from miurafab.errors import GcodeError, MiurafabError
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.machine.grbl_driver import WAS_RESET
from miurafab.machine.planning import JobPlan, SendOptions, passed_checks, plan_job
from miurafab.machine.preflight import CHECKS
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

MACHINE = load_machine("grbl-laser-400")
OUTLINE = "(operation cut)\nG0 X10 Y10\nG1 X60 S500 F3000\nY60\nX10\nY{}\n"
SOFT_LIMITS = {20: 1, 22: 1, 24: 500, 25: 3000}

JOBS = {
    "m3": "M3 S500\nG1 X5 F600\nM5\n",
    "program": "M4 S500\nG1 X5 F600\nG99\nM5\n",
    "bounds": "G0 X401\n",
    "islands": "M4 S0\n" + OUTLINE.format(10) + "G0 X20 Y20\nG1 X30\nM5\n",
    "outlines": "M4 S0\n" + OUTLINE.format(11) + "M5\n",
    "dwell": "M4\nM3 S500\nG1 X5 F600\nG4 P0.1\nM5\n",
    "power": "M4 S1001\nG1 X5 F600\nM5\n",
    "material": "M4 S900\nG1 X5 F600\nM5\n",
}
CONTROLLERS = {
    "idle": {22: 1, 24: 500, 25: 3000},
    "beam": {},
    "laser-mode": {32: 0},
    "s-range": {31: 3},
    "settings": {120: 1},
    "travel": SOFT_LIMITS,
}


# Of job directories, files of other machines, and a second job of one session: tests/workflow,
# tests/profiles/test_beams.py, tests/machine/test_session.py
HERE = [check for check in CHECKS if check not in ("edited", "other-beam", "position")]


def test_every_check_is_tried_here() -> None:
    assert JOBS.keys() | CONTROLLERS.keys() == set(HERE)


def attempt(name: str, force: frozenset[str]) -> FakeWire:
    """Send the job that ``name`` refuses, to the controller that it refuses."""
    changes = CONTROLLERS.get(name, {})
    device = VirtualGrbl(virtual_settings(MACHINE) | changes, baud=MACHINE.controller.baud)
    if name == "beam":
        device.receive(b"M3S500\nG1F600\n")  # somebody armed it
        device.advance(0.1)
    if name == "travel":
        device.receive(b"$H\n")
        device.advance(600.0)
    heard = device.take_output() if name in ("beam", "travel") else b""
    wire = FakeWire(device)
    if name == "beam":
        assert heard.startswith(BANNER)
        wire.lies = [(0.0, BANNER)]
    plan = plan_job(
        Job("job.nc", JOBS.get(name, "G0 X5 Y5\n")),
        MACHINE,
        SendOptions(force=force, allow_m3=name == "dwell"),
        most_power=0.5 if name == "material" else 1.0,
    )
    deliver(plan, wire, StopSignals())
    return wire


@pytest.mark.parametrize("name", HERE)
def test_a_check_fires_and_only_its_own_name_overrides_it(name: str) -> None:
    for force in (frozenset(), frozenset(CHECKS) - {name}):
        with pytest.raises(MiurafabError) as caught:
            attempt(name, force)
        # A beam that is on goes out before anybody reads that.
        told = str(caught.value).replace(f"; 0 of 1 lines were acknowledged, and {WAS_RESET}", "")
        assert told.endswith(f" ('force' {name} overrides this check).")
        assert (told != str(caught.value)) == (name == "beam")
        assert caught.value.exit_code == (2 if name in JOBS else 3)
    if name in ("idle", "program", "travel"):
        with pytest.raises(MiurafabError, match=r"locked|refused|ALARM|into Alarm") as caught:
            attempt(name, frozenset({name}))  # what the controller says to it then
        assert "'force'" not in str(caught.value)
    else:
        assert attempt(name, frozenset({name})).device.state == "Idle"


def test_to_force_one_check_forces_no_other() -> None:
    job = Job("job.nc", "M4 S1001\nG1 X401 F600\nM5\n")

    def plan(job: Job, force: frozenset[str]) -> JobPlan:
        return plan_job(job, MACHINE, SendOptions(force=force))

    with pytest.raises(MiurafabError, match="'force' bounds"):
        plan(job, frozenset())
    with pytest.raises(MiurafabError, match="'force' power"):
        plan(job, frozenset({"bounds"}))
    with pytest.raises(MiurafabError, match="'force' bounds"):
        plan(job, frozenset({"power"}))
    codes = [finding.code for finding in plan(job, frozenset({"bounds", "power"})).forced]
    assert codes == ["bounds", "power"]


@pytest.mark.parametrize("text", ["G1 X2 F9 !\n", "G1 X2 é F9\n", f"G1 X2 F9.{80 * '0'}\n"])
@pytest.mark.parametrize("check_mode", [False, True])
def test_a_line_that_cannot_be_sent_is_refused_whatever_is_forced(
    text: str, check_mode: bool
) -> None:
    options = SendOptions(force=frozenset(CHECKS), check_mode=check_mode)
    with pytest.raises(GcodeError, match=r"job\.nc, line 2") as caught:
        plan_job(Job("job.nc", "G0 X1\n" + text), MACHINE, options)
    assert "overrides" not in str(caught.value)


def test_what_could_not_be_read_is_not_said_to_fit_the_bed() -> None:
    """Though the place of the head is known."""
    options = SendOptions(at="front-left", check_mode=True)
    assert passed_checks(options, MACHINE, None) == {"m3", "program"}
    small = parse_program(Job("line.nc", "G21 G90\nM4 S0\nG1 X5 S10 F600\n"))
    assert passed_checks(options, MACHINE, small) == {"m3", "program", "bounds"}
