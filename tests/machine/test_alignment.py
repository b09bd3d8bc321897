"""A sheet that was moved is cut where it lies, by the beam log of the virtual controller."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from wires import FakeWire

import miurafab
from miurafab.errors import InputError, OptionError
from miurafab.gcode.program import strokes
from miurafab.gcode.rigid_motion import RigidMotion
from miurafab.machine.journal import read_journal
from miurafab.machine.planning import SendOptions
from miurafab.machine.sender import deliver
from miurafab.machine.signals import StopSignals
from miurafab.options import read_options
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.workflow.alignment import align, draw
from miurafab.workflow.cut import prepare
from miurafab.workflow.cut_options import CutOptions
from miurafab.workflow.cut_sheets import cut_prepared, frame
from miurafab.workflow.sheet_plans import plan_sheets

JOB = """G21 G90
M4 S0
G0 X3 Y4
G1 X6 Y8 S150 F3000
G0 X20 Y50
G1 X50 S250 F2400
G0 X60
G1 Y90 S700 F1500
G0 X100 Y100
G1 X130 S800 F900
Y140
X100
G2 X110 Y130 I10 J0
M5
G0 X0 Y0
"""
MARKS = ((20.0, 50.0), (130.0, 140.0))


def marks_of(motion, stretch=1.0):
    """The marks where ``motion`` brings them, farther apart by ``stretch``."""
    middle = np.mean(MARKS, axis=0)
    found = motion.of((np.array(MARKS) - middle) * stretch + middle)
    return tuple((place, tuple(where)) for place, where in zip(MARKS, found.tolist(), strict=True))


def moved_by(angle, dx, dy):
    return RigidMotion(math.cos(angle), math.sin(angle), dx, dy)


@pytest.fixture
def prepared(tmp_path):
    path = tmp_path / "sheet-01.nc"
    path.write_text(JOB, newline="\n")
    return prepare(str(path))


def distance(point, line):
    """The distance of ``point`` from a polyline, mm."""
    begin, way = line[:-1], np.diff(line, axis=0)
    along = np.clip(((point - begin) * way).sum(axis=1) / (way**2).sum(axis=1), 0, 1)
    return np.linalg.norm(begin + along[:, None] * way - point, axis=1).min()


def burnt_by(prepared, options):
    """The ends of what the virtual controller burns, (n, 4) in mm."""
    ((_, plan),) = plan_sheets(prepared, None, options)
    fine = virtual_settings(prepared.machine) | {100: 2000.0, 101: 2000.0}  # steps a mm
    wire = FakeWire(VirtualGrbl(fine, baud=115_200))
    deliver(plan, wire, StopSignals())
    log = [each for each in wire.device.beam_log if not each.standing]
    return np.array([(each.x0, each.y0, each.x1, each.y1) for each in log])


def test_random_motions_burn_the_strokes_where_the_sheet_lies(prepared):
    rng = np.random.default_rng(5)
    table = strokes(prepared.dry_runs[0].program)
    lines = [table.stroke(n)[:, :2] for n in range(len(table))]
    for _ in range(2):
        motion = moved_by(rng.uniform(-0.4, 0.4), *rng.uniform(60, 120, 2))
        there = align(prepared, None, marks_of(motion))
        log = burnt_by(there, CutOptions())
        wanted = [motion.of(line) for line in lines]
        for corner in np.vstack([line[[0, -1]] for line in wanted]):
            # Coming to rest, the beam goes dark a hundredth before the end (M4).
            assert np.linalg.norm(log.reshape(-1, 2) - corner, axis=1).min() < 0.02
        for x, y in log.reshape(-1, 2):
            assert min(distance((x, y), line) for line in wanted) < 0.001


def test_the_frame_and_the_checks_are_those_of_the_moved_sheet(prepared, tmp_path):
    options = CutOptions(align=marks_of(moved_by(math.pi / 2, 300, 50)))
    there = align(prepared, None, options.align)
    x0, y0, x1, y1 = prepared.dry_runs[0].bounds_mm
    assert there.dry_runs[0].bounds_mm == (300 - y1, 50 + x0, 300 - y0, 50 + x1)
    assert frame(prepared, 1, port="virtual", options=options).lines > 0
    off = align(prepared, None, marks_of(moved_by(0.0, 300, 0)))
    with pytest.raises(InputError, match="off the bed"):
        plan_sheets(off, None, CutOptions())


def test_a_sheet_that_was_moved_while_interrupted_goes_on(prepared, tmp_path):
    """The journal is of the file, so the rest is cut where the sheet lies now."""
    cut_prepared(prepared, port="virtual")
    journal = next(tmp_path.glob("*.journal"))
    journal.write_text(
        journal.read_text().partition('{"taken"')[0] + '{"taken": 11, "line": 11, "seconds": 1}\n'
    )
    motion = moved_by(0.1, 90, 20)
    options = CutOptions(send=SendOptions(at=(0.0, 0.0)), resume=True, align=marks_of(motion))
    (done,) = cut_prepared(prepared, port="virtual", options=options)
    assert {"aligned", "resumed"} <= {found.code for found in done.findings}
    assert {run.sha256 for run in read_journal(journal)} == {prepared.jobs[0].sha256}


def test_the_picture_is_that_of_the_moved_sheet(prepared, tmp_path):
    assert draw(prepared) is None
    page = draw(align(prepared, None, marks_of(moved_by(math.pi / 2, 300, 50))))
    assert page == tmp_path / "aligned" / "preview.html"
    # X and Y of the box, 3 to 130 and 4 to 150, have changed places.
    picture = (tmp_path / "aligned" / "sheet-01.svg").read_text()
    assert "X 150.0 to 296.0 mm" in picture
    assert "turned by 90.000 degrees" in page.read_text()


def test_the_preview_shows_a_moved_sheet_as_the_cut_would(prepared, tmp_path):
    marks = marks_of(moved_by(math.pi / 2, 300, 50))
    there = align(prepared, None, marks)
    words = ";".join(f"{a[0]},{a[1]}={b[0]},{b[1]}" for a, b in marks)
    for given in (marks, words):
        seen = miurafab.preview(tmp_path / "sheet-01.nc", align=given)
        assert seen.sheets[0].bounds_mm == there.dry_runs[0].bounds_mm
        assert seen.findings[-1] == there.aligned.finding
    plain = miurafab.preview(tmp_path / "sheet-01.nc").sheets[0]
    assert plain.bounds_mm == prepared.dry_runs[0].bounds_mm
    with pytest.raises(InputError, match="has no sheet 2; it has 1"):
        miurafab.preview(tmp_path / "sheet-01.nc", sheet=2)


def test_no_minus_stands_before_zero(prepared):
    marks = [((20.0, 20.0), (19.9999, 20.0)), ((120.0, 120.0), (119.9998, 120.0))]
    finding = str(align(prepared, None, marks).aligned.finding)
    assert "-0.000" not in finding
    assert "+0.000 mm" in finding


def test_marks_that_are_no_turn_and_no_shift_are_refused(prepared):
    still = moved_by(0.0, 0.0, 0.0)
    with pytest.raises(InputError, match=r"142\.13 mm apart in the job and 143\.13 mm.*\+0\.70 %"):
        align(prepared, None, marks_of(still, 1 + 1 / math.dist(*MARKS)))
    most = 0.3 / math.dist(*MARKS)
    assert align(prepared, None, marks_of(still, 1 + 0.99 * most)) is not prepared
    with pytest.raises(InputError, match=r"more than 0\.30 mm"):
        align(prepared, None, marks_of(still, 1 + 1.01 * most))
    close = tuple(((x, 50.0), (x, 50.0)) for x in (60.0, 90.0))
    with pytest.raises(InputError, match=r"30\.0 mm apart.*at least 64 mm apart"):
        align(prepared, None, close)
    with pytest.raises(InputError, match="is given 1 time; two marks"):
        align(prepared, None, marks_of(still)[:1])


def test_what_cannot_be_turned_or_has_no_stroke_is_refused(prepared, tmp_path):
    marks = marks_of(moved_by(0.0, 1.0, 1.0))
    plotter = replace(prepared, machine=miurafab.load_machine("hpgl-cutter-a3"))
    with pytest.raises(InputError, match="hpgl-cutter-a3 speaks hpgl, whose programs are not turn"):
        align(plotter, None, marks)
    (tmp_path / "dark.nc").write_text("G21 G90\nG0 X5 Y5\n")
    with pytest.raises(InputError, match=r"dark\.nc burns nothing, so there is no sheet to align"):
        align(prepare(str(tmp_path / "dark.nc")), None, marks)


def test_marks_that_may_be_exchanged_are_doubted(prepared):
    still = marks_of(moved_by(0.0, 0.0, 0.0))
    assert "exchanged" not in str(align(prepared, None, still).aligned.finding)
    crossed = ((still[0][0], still[1][1]), (still[1][0], still[0][1]))
    found = str(align(prepared, None, crossed).aligned.finding)
    assert "turned by" in found
    assert "the marks are exchanged" in found


def test_one_sheet_lies_at_one_place(prepared):
    job = replace(prepared, jobs=2 * prepared.jobs, dry_runs=2 * prepared.dry_runs)
    with pytest.raises(InputError, match="there are 2; name its 'sheet'"):
        align(job, None, marks_of(moved_by(0.0, 1, 1)))
    second = align(job, [2], marks_of(moved_by(0.0, 1, 2)))
    assert second.jobs[0] == job.jobs[0]
    assert second.jobs[1] != job.jobs[1]
    plans = dict(plan_sheets(second, None, CutOptions()))
    assert plans[1].job == job.jobs[0]
    assert plans[2].job == second.jobs[1]


def test_the_words_of_the_command_line_and_of_python_are_one_declaration():
    text = read_options(CutOptions, {"align": "20,50=21,52;130,140 = 131,142"})
    values = read_options(CutOptions, {"align": [((20, 50), (21, 52)), ((130, 140), (131, 142))]})
    assert text == values
    with pytest.raises(OptionError, match=r"X,Y=X2,Y2 such as 10,10=12\.3,9\.8"):
        read_options(CutOptions, {"align": "20,50"})
    with pytest.raises(OptionError, match="'align' says where the sheet lies"):
        read_options(CutOptions, {"align": "20,50=21,52", "at": "front-left"})


def test_no_motion_sends_the_bytes_of_the_file(prepared):
    same = align(prepared, None, marks_of(moved_by(0.0, 0.0, 0.0)))
    assert same.jobs == prepared.jobs
