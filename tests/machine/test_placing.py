"""Where a job lies (``at`` a place of what is burnt) and where it begins (``from_stroke``)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from dashes import STROKES, burnt, dashes
from wires import FakeWire

from miurafab.errors import InputError, JobStopped, OptionError
from miurafab.gcode.job import Job
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import PLACES, SendOptions, plan_job
from miurafab.machine.resume import from_stroke, resume
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.options import read_options
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.workflow.cut import prepare
from miurafab.workflow.cut_options import CutOptions
from miurafab.workflow.cut_sheets import cut_prepared, frame_plan
from miurafab.workflow.sheet_plans import plan_sheets, rehearsed

MACHINE = load_machine("grbl-laser-400")
BOX = "G21 G90\nM4 S0\nG0 X-60 Y-50\nG1 X-20 S500 F1500\nY-20\nX-60\nY-50\nM5\nG0 X-70 Y-60\n"
"""A file in the negative quadrant: it burns 40 x 30 mm."""


def new_wire(*, homing=False):
    settings = virtual_settings(MACHINE) | ({22: 1.0} if homing else {})
    return FakeWire(VirtualGrbl(settings, baud=115_200))


@pytest.fixture
def box(tmp_path):
    path = tmp_path / "box.nc"
    path.write_text(BOX, newline="\n")
    return prepare(str(path))


def burnt_box(device):
    """x0, y0, x1, y1 of the beam log, in the machine's coordinates: the head begins at 0,0."""
    ends = np.array([(s.x0, s.y0, s.x1, s.y1) for s in device.beam_log]).reshape(-1, 2)
    return (*ends.min(axis=0), *ends.max(axis=0))


@pytest.mark.parametrize("place", PLACES)
def test_the_box_lies_where_the_head_stands(box, place):
    right, back = PLACES[place]
    ((_, plan),) = plan_sheets(box, None, CutOptions(send=SendOptions(at=place)))
    wire = new_wire()
    deliver(plan, wire, StopSignals())
    expected = (-40 * right, -30 * back, 40 * (1 - right), 30 * (1 - back))
    assert burnt_box(wire.device) == pytest.approx(expected, abs=0.02)


def test_a_place_is_the_same_as_its_coordinates(box):
    named, numbered = (
        plan_sheets(box, None, CutOptions(send=SendOptions(at=at, force=frozenset({"bounds"}))))
        for at in ("front-left", (-60.0, -50.0))
    )
    assert named[0][1].at == numbered[0][1].at == (-60.0, -50.0)


def test_a_place_frees_the_origin_but_not_the_size_of_the_bed(box):
    with pytest.raises(InputError, match="off the bed"):
        plan_sheets(box, None, CutOptions(send=SendOptions(at=(0.0, 0.0))))
    wide = replace(
        box.machine, bed=replace(box.machine.bed, width_mm=49.0)
    )  # the way to X-70 is 50 mm
    with pytest.raises(InputError, match="off the bed"):
        plan_job(box.jobs[0], wide, SendOptions(at="centre"))
    with pytest.raises(InputError, match="burns nothing, so it has no centre"):
        plan_job(Job("dark.nc", "G0 X5\n"), MACHINE, SendOptions(at="centre"))


def test_the_dry_run_says_how_far_the_head_goes(box):
    options = CutOptions(send=SendOptions(at="front-left"))
    _, status, notes = rehearsed(box, None, options)
    assert status == "ready"
    assert [str(note) for note in notes] == [
        "The head stands at X-60.000 Y-50.000 of box; from there it goes 10.0 mm to the left, "
        "40.0 mm to the right, 10.0 mm to the front and 30.0 mm to the back."
    ]
    assert rehearsed(box, None, CutOptions())[1] == "refused"


def test_the_frame_begins_and_ends_where_the_head_stands(box):
    plan = frame_plan(box, 1, CutOptions(send=SendOptions(at="centre")))
    assert plan.at == (-40.0, -35.0)
    assert plan.job.text.endswith("G0 X-40.000 Y-35.000\n")


def test_further_sheets_lie_in_the_frame_of_the_first(box):
    job = replace(box, jobs=2 * box.jobs, dry_runs=2 * box.dry_runs)
    cut_prepared(job, port="virtual", options=CutOptions(send=SendOptions(at="front-left")))
    said = (box.folder / "box.transcript").read_text()
    assert "G92X-70.000Y-60.000" in said  # where the first sheet left the head
    with pytest.raises(OptionError, match="did you mean 'centre'"):
        read_options(CutOptions, {"at": "center"})


@pytest.mark.parametrize("style", ["absolute", "relative"])
@pytest.mark.parametrize("number", [2, 42, 199])
def test_a_job_begins_at_the_stroke_that_was_asked_for(style, number):
    job = dashes(style)
    rest = from_stroke(job, MACHINE, number)
    plan = plan_job(job, MACHINE, resumption=rest)
    wire = new_wire()
    deliver(plan, wire, StopSignals())
    assert burnt(job, [wire.device.beam_log]) == dict.fromkeys(range(number - 1, STROKES), 1)
    assert rest.finding.code == "from-stroke"
    left = f"strokes 1 to {number - 1} are" if number > 2 else "stroke 1 is"
    assert f"begins at stroke {number} of 200" in str(rest.finding)
    assert f"{left} left out" in str(rest.finding)


def test_the_figures_are_those_of_what_is_sent(tmp_path):
    path = tmp_path / "a.nc"
    path.write_text(dashes("absolute").text)
    prepared, options = prepare(str(path)), CutOptions(from_stroke=151)
    seen, _, _ = rehearsed(prepared, None, options)
    (done,) = cut_prepared(prepared, port="virtual", options=options)
    assert prepared.dry_runs[0].cut_mm == pytest.approx(400)  # 200 strokes of 2 mm
    assert seen.dry_runs[0].cut_mm == done.cut_mm == pytest.approx(100)
    assert done.result.seconds == pytest.approx(done.estimated_s, abs=1)
    assert done.estimated_s < prepared.dry_runs[0].seconds / 2


def test_strokes_that_meet_are_parted_at_the_stroke_that_was_asked_for():
    text = "\n" * 6 + "G90 G21\nM4 S0\nG0 X5 Y5\n(operation score)\nG1 X10 S300 F900\n"
    text += "(operation cut)\nG1 X20 S900 F600\nM5\nG0 X0 Y0\n"
    rest = from_stroke(Job("two.nc", text), MACHINE, 2)
    wire = new_wire()
    deliver(plan_job(Job("two.nc", text), MACHINE, resumption=rest), wire, StopSignals())
    moving = [each for each in wire.device.beam_log if not each.standing]
    assert min(each.x0 for each in moving) == pytest.approx(10, abs=0.02)
    assert max(each.power for each in moving) == pytest.approx(0.9, abs=0.01)


def test_a_stroke_that_a_job_does_not_have_is_refused(tmp_path):
    job = dashes("absolute")
    with pytest.raises(OptionError, match=r"is 201; absolute\.nc has 200 strokes"):
        from_stroke(job, MACHINE, 201)
    assert from_stroke(job, MACHINE, 1) is None
    path = tmp_path / "a.nc"
    path.write_text(job.text)
    both = CutOptions(send=SendOptions(at=(0.0, 0.0)), resume=True, from_stroke=3)
    with pytest.raises(OptionError, match="for 'resume'; ask for one"):
        plan_sheets(prepare(str(path)), None, both)
    short = Job("short.nc", "M4 S9\nG1 X5 F900\nG0 X9\nG1 X20\nM5\n")
    with pytest.raises(OptionError, match="begins in line 4, before which there is no room"):
        from_stroke(short, MACHINE, 2)
    with pytest.raises(InputError, match=r"speaks marlin, so a\.nc cannot begin in its middle"):
        from_stroke(Job("a.nc", "G0 X1\n"), load_machine("marlin-laser-220"), 2)


def test_what_was_left_out_stays_left_out_when_the_job_is_resumed(tmp_path):
    job = dashes("absolute")
    rest = from_stroke(job, MACHINE, 100)
    journal = tmp_path / "a.journal"
    deliver(
        plan_job(job, MACHINE, resumption=rest), new_wire(), StopSignals(), journal_path=journal
    )
    (run,) = read_journal(journal)
    assert (run.chosen, run.from_line, run.sha256) == (True, rest.line, job.sha256)
    begun = replace(run, taken=9, line=rest.line + 2, ended=None)
    assert resume(job, MACHINE, [begun]).stroke == 99


@pytest.mark.parametrize("how", ["done", "stopped", "M9 in the file"])
def test_the_air_is_shut_on_each_way_out(how):
    """A soft reset shuts it (``mc_reset``), and M9 where the file leaves it on."""
    text = "G21 G90\nM4 S0\nM8\nG0 X5 Y5\nG1 X50 S300 F600\n" + "G1 X5\nG1 X50\n" * 4 + "M5\n"
    job = Job("air.nc", text + ("M9\n" if how == "M9 in the file" else ""))
    blew = []

    def before_call(call):
        blew.append(wire.device.air_on)
        if how == "stopped" and wire.device.now > 5:
            wire.before_call = lambda call: None
            raise KeyboardInterrupt

    wire = FakeWire(VirtualGrbl(virtual_settings(MACHINE), baud=115_200), before_call=before_call)
    plan = plan_job(job, MACHINE)
    if how == "stopped":
        with pytest.raises(JobStopped):
            deliver(plan, wire, StopSignals())
    else:
        deliver(plan, wire, StopSignals())
    assert any(blew)
    assert not wire.device.air_on
    sent = b"".join(data for _, data in wire.written)
    after = sent.rpartition(b"M5\n")[2] if how != "stopped" else sent
    assert (b"M9" in after, b"\x18" in after) == (how != "stopped", how == "stopped")
