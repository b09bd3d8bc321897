"""Heights of the head and air between two runs of strokes: posted, checked, timed and proven."""

from __future__ import annotations

from dataclasses import replace

import pytest
from test_posting import CARD, CUT, DASH, LASER, PERFORATE, SQUARE, toolpath, with_tool
from worked import changed

import miurafab as mf
from miurafab.errors import InputError, ProfileError
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.program import strokes
from miurafab.gcode.reading import read_program
from miurafab.grbl.settings import Settings
from miurafab.machine.judge_job import judge_job, leaves_air_on
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.preflight import check_travel
from miurafab.machine.resume import from_stroke
from miurafab.motion.estimate import estimate
from miurafab.motion.parameters import Link, MotionParameters
from miurafab.posting import post
from miurafab.posting.sections import post_sections
from miurafab.profiles import MachineProfile, Material, load_machine
from miurafab.profiles.machine import ZAxis
from miurafab.profiles.shipped import find_file

TALL = replace(LASER, z=ZAxis(10.0, 500.0, 20.0))
OLD = replace(with_tool(TALL, beam_mode="M3"), dialect="grbl-0.9", settings={})
PEN = replace(with_tool(TALL, kind="pen", s_down=90, s_up=30, beam_mode="M3"), settings={32: 0.0})
MARLIN = replace(load_machine("marlin-laser-220"), z=TALL.z)
CHAINED = replace(TALL, controller=replace(TALL.controller, baud=9600))
MACHINES = {
    "grbl-1.1": TALL,
    "grbl-0.9": OLD,
    "grblhal": replace(TALL, dialect="grblhal"),
    "fluidnc": replace(TALL, dialect="fluidnc"),
    "pen": PEN,
    "marlin": MARLIN,
    "chained": CHAINED,
}


def deep(material: Material = CARD, **cut: object) -> Material:
    """``material`` whose cuts are made so."""
    return changed(material, cut=cut)


def heights(machine: MachineProfile, job: Job) -> list[tuple[float, float]]:
    """The highest and the lowest Z of each stroke."""
    table = strokes(read_program(job, machine))
    zs = (table.stroke(n)[:, 2] for n in range(len(table)))
    return [(float(z.max()), float(z.min())) for z in zs]


@pytest.mark.parametrize("machine", MACHINES.values(), ids=MACHINES)
def test_each_pass_is_made_lower_with_the_beam_off_between(machine: MachineProfile) -> None:
    dashes = [[(5 + 0.5 * n, 5.0), (5.3 + 0.5 * n, 5.0)] for n in range(60)]
    path = toolpath([DASH, *dashes, SQUARE], [PERFORATE] * 61 + [CUT])
    job = post(path, machine, deep(passes=3, z_step_mm=0.25, focus_mm=0.5))
    program = read_program(job, machine)
    climbs = program.start[:, 2] != program.end[:, 2]
    assert not program.beam_on[climbs].any()
    assert (program.start[climbs, :2] == program.end[climbs, :2]).all()
    assert program.end[climbs, 2].tolist() == [0.5, 0.25, 0.0]
    assert heights(machine, job) == [(0.0, 0.0)] * 61 + [(0.5, 0.5), (0.25, 0.25), (0.0, 0.0)]
    assert judge_job(job, machine).program is not None


def test_the_words_are_g0_z_and_the_head_goes_back() -> None:
    job = post(toolpath([DASH], [CUT]), TALL, deep(passes=2, z_step_mm=0.3))
    assert [line for line in job.text.splitlines() if line[0] != "("] == [
        *["M5", "G21", "G90", "G17", "G94", "M4 S0", "G0 X1 Y2.25", "G1 X3 Y2.25 S800 F900"],
        *["G0 Z-0.3", "G0 X1 Y2.25", "G1 X3 Y2.25", "G0 Z0", "M5", "G0 X0 Y0", "M2"],
    ]


def test_without_heights_no_byte_changes() -> None:
    path = toolpath([DASH, SQUARE], [PERFORATE, CUT])
    plain = post(path, LASER, deep(passes=3)).text
    assert "Z" not in plain
    assert post(path, TALL, deep(passes=3)).text == plain


@pytest.mark.parametrize("machine", ["grbl-laser-400", "grbl-pen-a4", "hpgl-cutter-a3"])
def test_a_machine_without_z_refuses_heights(machine: str) -> None:
    with pytest.raises(ProfileError, match=f"{machine} has no Z axis; leave them out"):
        post(toolpath([[(50, 50), (60, 50)]]), load_machine(machine), deep(focus_mm=1))
    assert post(toolpath([DASH], [PERFORATE]), LASER, deep(focus_mm=1)).text  # nothing is cut
    with pytest.raises(ProfileError, match=r"over 10\.2 mm in Z, and grbl-laser-400 has 10 mm"):
        post(toolpath([DASH]), TALL, deep(passes=35, z_step_mm=0.3))


def test_the_checks_know_the_travel_of_z() -> None:
    job = Job("a.nc", "G21 G90\nM4 S0\nG0 Z-11\nG0 X5\nG1 X9 S9 F900\nG0 Z0\nM5\n")
    assert not judge_job(job, LASER).findings  # its profile knows no Z
    (found,) = judge_job(job, TALL).findings
    assert str(found).startswith("a.nc, line 3 is the farthest of moves over 11 mm in Z")
    with pytest.raises(InputError, match="over 11 mm in Z"):
        plan_job(job, TALL, SendOptions(at="front-left"))
    limits = Settings({20: "1", 130: "400", 131: "400", 132: "10"})
    low = tuple(check_travel(parse_program(job), limits, (-400.0, -400.0, 0.0)))
    assert "to X-400.000 Y-400.000 Z-11.000 in its own" in str(low[0])
    unlimited = Settings({132: "10"})
    assert not tuple(check_travel(parse_program(job), unlimited, (-9.0, 0.0, 0.0), homed=True))


def test_the_time_is_that_of_the_z_axis() -> None:
    program = parse_program(Job("a.nc", "G21 G90\nG0 Z-10\n"))
    seconds = estimate(program, MotionParameters.from_profile(TALL), Link()).seconds
    rate, acceleration, way = 500 / 60, 20, 10
    assert seconds == pytest.approx(way / rate + rate / acceleration, abs=0.05)


def test_a_job_that_begins_in_a_later_pass_is_at_its_height() -> None:
    job = post(toolpath([SQUARE]), TALL, deep(passes=3, z_step_mm=0.25))
    rest = from_stroke(job, TALL, 3)
    assert rest is not None
    assert heights(TALL, rest.job) == [(-0.5, -0.5)]


def test_the_proof_of_a_job_includes_its_heights(tmp_path) -> None:
    machine = tmp_path / "tall.toml"
    text = find_file("firmware_profiles", "grbl-laser-400").read_text()
    machine.write_text(text + '[z]\ntravel = "30mm"\nmax_rate = "500mm/min"\nacceleration = 20\n')
    card = tmp_path / "card.toml"
    text = find_file("materials", "card-250").read_text()
    head, after = text.split("[beams.diode.operations.cut]\n")
    own = 'passes = 2\nz_step = "0.2mm"\nfocus = "0.1mm"\n'
    card.write_text(f"{head}[beams.diode.operations.cut]\n{own}{after}")
    sheet = mf.fit("plane", facets=(2, 2), size=40)
    mf.sheets(sheet, machine=machine, material=card).write(tmp_path / "job")
    found = mf.check_job(tmp_path / "job")
    assert found.valid
    sheet = tmp_path / "job" / "sheet-01.nc"
    assert "G0 Z-0.1\n" in sheet.read_text()
    forged = sheet.read_text().replace("G0 Z-0.1\n", "G0 Z0.1\n")
    sheet.write_text(forged)
    assert {"is not burnt", "is burnt too often"} <= {
        words
        for finding in mf.check_job(tmp_path / "job").findings
        for words in ("is not burnt", "is burnt too often")
        if words in str(finding)
    }


@pytest.mark.parametrize("word", ["M8", "M7"])
def test_air_is_blown_for_the_operations_that_want_it(word: str) -> None:
    machine = with_tool(LASER, air_assist=True, air_word=word)
    quiet = deep(air=False)
    code = post(toolpath([DASH, SQUARE, DASH], [PERFORATE, CUT, PERFORATE]), machine, quiet).text
    said = [
        line for line in code.splitlines() if line in (word, "M9") or line[:4] in ("(ope", "M5")
    ]
    assert said == [
        *["M5", word, "(operation perforate)", "M9", "(operation cut)", word],
        *["(operation perforate)", "M5", "M9"],
    ]
    alone = post(toolpath([SQUARE]), machine, quiet).text
    assert word not in alone.splitlines()
    assert not leaves_air_on(Job("a.nc", code))


def test_sections_hand_the_air_on() -> None:
    machine = with_tool(LASER, air_assist=True)
    made = [
        (toolpath([DASH], [CUT]), CARD),
        (toolpath([SQUARE], [CUT]), CARD),
        (toolpath([DASH], [CUT]), deep(air=False)),
        (toolpath([SQUARE], [CUT]), CARD),
    ]
    code = post_sections(made, machine).text.splitlines()
    assert [line for line in code if line in ("M8", "M9")] == ["M8", "M9", "M8", "M9"]
