"""What a person at a machine is told, without a machine."""

from __future__ import annotations

from dataclasses import replace

import pytest

from miurafab.errors import PersonNeeded
from miurafab.gcode.job import Job
from miurafab.machine.known_controller import Burnt, MachineState
from miurafab.workflow import at_machine
from miurafab.workflow.at_machine import Operator
from miurafab.workflow.cut import prepare
from miurafab.workflow.cut_options import CutOptions

HERE = MachineState("port", "Grbl 1.1h", "Idle", (0.0, 0.0), (30.0, 20.0), (30.0, 20.0), (), ())


class Held:
    """The process that holds the port, as far as an operator asks it."""

    state = HERE

    def order(self, action, **options):
        pass

    def poll(self):
        return None


def test_an_origin_that_a_reset_forgot_is_told_once():
    process = Held()
    operator = Operator(process, None, CutOptions())
    process.state = replace(HERE, shift=(30.0, 20.0, 0.0))
    operator.take()
    assert list(operator.said) == []
    process.state = replace(HERE, shift=(0.0, 0.0, 0.0))
    operator.take()
    operator.take()
    assert list(operator.said) == ["The origin that was set (G92) is forgotten; set it again."]


def test_an_origin_that_is_moved_is_not_forgotten():
    """At the machine's own zero it is no shift."""
    process = Held()
    operator = Operator(process, None, CutOptions())
    process.state = replace(HERE, shift=(30.0, 20.0, 0.0))
    operator.take()
    operator.busy = ""
    operator.do("set_origin")
    process.state = replace(HERE, shift=(0.0, 0.0, 0.0))
    operator.take()
    assert list(operator.said) == []


def test_a_sheet_that_was_armed_before_the_computer_slept_is_not_started(tmp_path):
    """In a terminal as in the studio."""
    job, slept = tmp_path / "line.nc", [0.0]
    job.write_text("M4 S0\nG0 X5\nG1 X15 S500 F3000\nM5\n")
    operator = Operator(Held(), prepare(job), CutOptions(), lambda: slept[0])
    operator.busy = ""
    for after, armed in ((0.9, True), (600.9, False)):
        operator.arm()
        slept[0] = after
        operator.take()
        assert operator.armed is armed
    assert operator.said[-1] == "This computer slept for 600 s. Arm the sheet anew."


@pytest.mark.parametrize(
    ("burnt", "what"),
    [
        (-1, "put in fresh material"),
        (0, "turn the sheet over, left to right"),
        (1, "put in the sheet whose back is burnt, turned over left to right"),
    ],
)
def test_a_sheet_that_has_burnt_is_turned_over_or_changed(tmp_path, burnt, what):
    """A back of the same name in another job is another one."""
    job = tmp_path / "line.nc"
    job.write_text("M4 S0\nG0 X5\nG1 X15 S500 F3000\nM5\n")
    process, prepared = Held(), prepare(job)
    backs = [Job("line-back.nc", f"G0 X{x}\n") for x in (5, 6)]
    operator = Operator(process, prepared, CutOptions())
    loaded = Burnt("line-back.nc", backs[burnt].sha256)
    operator.busy, process.state = "", replace(HERE, loaded=loaded)
    if burnt >= 0:
        operator.prepared = replace(
            prepared, jobs=(backs[0], *prepared.jobs), dry_runs=prepared.dry_runs * 2
        )
        operator.choose(2)
    with pytest.raises(PersonNeeded, match=f"line-back.nc has burnt on .*; {what}.* say so"):
        operator.arm()
    assert not operator.armed
    assert operator.wants_material.startswith(what)
    machine = operator.prepared.machine
    bed = replace(machine.bed, roll_fed=True)
    operator.prepared = replace(operator.prepared, machine=replace(machine, bed=bed))
    assert bool(operator.wants_material) == (burnt >= 0)  # no machine does that itself


def test_what_will_burn_is_found_once_a_sheet(tmp_path, monkeypatch):
    """A screen asks for it ten times a second, and a raster has a million moves."""
    job = tmp_path / "line.nc"
    job.write_text("M4 S0\nG0 X5\nG1 X15 S500 F3000\nM5\n")
    operator = Operator(Held(), prepare(job), CutOptions())
    asked = []
    real = at_machine.strokes
    monkeypatch.setattr(at_machine, "strokes", lambda one: asked.append(one) or real(one))
    told = {operator.describe() for _ in range(3)}
    assert len(told) == len(asked) == 1
    assert told.pop().startswith("line.nc: 1 strokes, about 0:0")
