"""Every shipped machine makes one pattern: posted, read back to the same strokes, previewed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from problems import regular
from worked import changed

from miurafab.errors import InputError, LayoutError, ProfileError
from miurafab.fabrication.knife import axis_way, tip_way
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.toolpath import Toolpath
from miurafab.gcode.program import strokes
from miurafab.gcode.reading import read_program
from miurafab.machine.dialects import virtual_machine
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.machine.sender import deliver, stream_plan
from miurafab.machine.signals import StopSignals
from miurafab.machine.transport import VirtualTransport
from miurafab.posting import post
from miurafab.profiles import (
    OPERATIONS,
    load_machine,
    load_material,
    shipped_directory,
    shipped_names,
)
from miurafab.workflow.dry_run import dry_run
from miurafab.workflow.job_directory import read_job
from miurafab.workflow.preview import preview
from miurafab.workflow.sheets import sheets

MACHINES = shipped_names("firmware_profiles")
CARD = load_material("card-250")


def stock(machine):
    """A material that has settings for the beam of ``machine``."""
    return load_material("paper-100") if machine.tool.beam == "co2" else CARD


KNIFE = load_machine("grbl-knife-a3")
CUTTER = load_machine("hpgl-cutter-a3")
MARLIN = load_machine("marlin-laser-220")
# A file in micrometres; an HPGL file in plotter units of 25 micrometres.
ROUNDING = {"hpgl": 0.0126}


@pytest.fixture(scope="module")
def pattern():
    return regular(5, 5)


def sheet(pattern, machine) -> Toolpath:
    return lay_out(pattern, machine, stock(machine)).toolpaths[0]


def wanted(path: Toolpath, machine) -> Toolpath:
    """What the tool must do for ``path``: for a knife, what its holder must."""
    knife = machine.tool.knife
    if knife is None:
        return path
    return axis_way(tip_way(path, knife, machine.bed.margin_mm), knife)


def joined(path: Toolpath, digits: int) -> list[tuple[int, np.ndarray]]:
    """Operation and points of the strokes, those that meet in one patch taken together."""
    found: list[tuple[int, int, np.ndarray]] = []
    for index in range(len(path)):
        operation, patch = int(path.operation[index]), int(path.patch[index])
        points = path.stroke(index)
        if found and found[-1][:2] == (operation, patch):
            before = found[-1][2]
            if np.array_equal(np.round(before[-1], digits), np.round(points[0], digits)):
                found[-1] = (operation, patch, np.vstack([before, points[1:]]))
                continue
        found.append((operation, patch, points))
    return [(operation, points) for operation, _, points in found]


@pytest.mark.parametrize("name", MACHINES)
def test_posted_and_read_back_it_is_the_same_strokes(name, pattern) -> None:
    machine = load_machine(name)
    path = sheet(pattern, machine)
    job = post(path, machine, stock(machine))
    made = strokes(read_program(job, machine))
    asked = joined(wanted(path, machine), 3)
    if machine.tool.kind == "knife":  # which is turned between strokes that meet
        target = wanted(path, machine)
        asked = [(int(target.operation[i]), target.stroke(i)) for i in range(len(target))]
    assert len(made) == len(asked)
    tolerance = ROUNDING.get(machine.dialect, 0.00051)
    for index, (operation, points) in enumerate(asked):
        read = made.stroke(index)[:, :2]
        assert made.contexts[made.context[index]].operation == OPERATIONS[operation]
        assert read[0] == pytest.approx(points[0], abs=tolerance)
        assert read[-1] == pytest.approx(points[-1], abs=tolerance)
        # Points closer than the file can tell apart are one point of it.
        nearest = np.linalg.norm(read[:, None] - points[None], axis=2)
        assert nearest.min(axis=0).max() <= 1.5 * tolerance
        assert nearest.min(axis=1).max() <= 1.5 * tolerance


@pytest.mark.parametrize("name", MACHINES)
def test_the_preview_finds_no_hazard(name, pattern) -> None:
    machine = load_machine(name)
    path = sheet(pattern, machine)
    seen = dry_run(
        "sheet-01", post(path, machine, stock(machine)), machine, (path.width_mm, path.height_mm)
    )
    if machine.dialect == "grbl-0.9":  # which has no beam that goes dark by itself
        assert [finding.code for finding in seen.findings] == ["m3"]
    else:
        assert seen.warnings == ()
    assert seen.seconds > seen.beam_on_seconds > 0, (seen.seconds, seen.beam_on_seconds)
    assert seen.cut_mm == pytest.approx(wanted(path, machine).lengths.sum(), rel=2e-3)
    assert seen.travel_mm > 0


@pytest.mark.parametrize(
    "name",
    [
        name
        for name in MACHINES
        if load_machine(name).dialect in ("grbl-1.1", "grblhal")
    ],
)  # fmt: skip
def test_the_virtual_controller_takes_it_whole(name, pattern) -> None:
    machine = load_machine(name)
    job = post(sheet(pattern, machine), machine, stock(machine))
    result = stream_plan(plan_job(job, machine), "virtual")
    assert result.errors == ()
    assert result.lines > 100


@pytest.mark.parametrize("machine", [MARLIN, CUTTER], ids=lambda each: each.name)
def test_what_speaks_otherwise_is_streamed_in_its_own_way(machine, pattern) -> None:
    job = post(sheet(pattern, machine), machine, stock(machine))
    device = virtual_machine(machine)
    result = deliver(plan_job(job, machine), VirtualTransport(device), StopSignals())
    assert result.lines > 20
    assert device.lost_bytes == 0
    with pytest.raises(InputError, match=f"{machine.name} speaks {machine.dialect}, which has no"):
        plan_job(job, machine, SendOptions(check_mode=True))


SQUARE = [(20.0, 20.0), (40.0, 20.0), (40.0, 40.0), (20.0, 40.0), (20.0, 20.0)]
DASHES = [[(50.0, 50.0), (52.0, 50.0)], [(53.0, 50.0), (55.0, 50.0)]]


def strokes_of(*lines: tuple[str, list[tuple[float, float]]]) -> Toolpath:
    return Toolpath(
        sheet="sheet-01",
        width_mm=220.0,
        height_mm=210.0,
        points=np.array([point for _, line in lines for point in line]),
        offsets=np.cumsum([0, *(len(line) for _, line in lines)]),
        operation=np.array([OPERATIONS.index(name) for name, _ in lines]),
        patch=np.zeros(len(lines), dtype=np.int64),
        edge=np.full(len(lines), -1),
    )


def code(job) -> list[str]:
    return [line for line in job.text.splitlines() if not line.startswith("(")]


def test_marlin_says_power_and_feed_in_every_stroke() -> None:
    path = strokes_of(("perforate", DASHES[0]), ("perforate", DASHES[1]), ("cut", SQUARE[:3]))
    assert code(post(path, MARLIN, CARD)) == [
        *["M5", "G21", "G90", "M4 I S0"],
        *["G0 X50 Y50 S0 F9000", "G1 X52 Y50 S178 F1500"],
        *["G0 X53 Y50 S0 F9000", "G1 X55 Y50 S178 F1500"],
        *["G0 X20 Y20 S0 F9000", "G1 X40 Y20 S204 F900", "G1 X40 Y40"],
        *["M5 I", "M5", "G0 X0 Y0 S0 F9000"],
    ]


def test_a_tube_starts_at_its_least_power_and_its_pump_runs() -> None:
    k40 = load_machine("grbl-co2-k40")
    lines = code(post(strokes_of(("engrave", SQUARE)), k40, load_material("paper-100")))
    assert lines[5:7] == ["M4 S0", "M8"]
    assert lines[8] == "G1 X40 Y20 S190 F12000"  # 4 W of 40 are a tenth of the way from 100 to 1000
    assert lines[-4:] == ["M5", "M9", "G0 X0 Y0", "M2"]


def test_a_servo_knife_goes_shallow_for_what_must_only_mark() -> None:
    lines = code(post(strokes_of(("score", DASHES[0]), ("cut", SQUARE)), KNIFE, CARD))
    assert [line for line in lines if line.startswith("M3")] == [
        "M3 S0", "M3 S600", "M3 S0", "M3 S350", "M3 S0", "M3 S600", "M3 S0",
    ]  # fmt: skip


def test_passes_turn_the_blade_from_where_the_pass_before_left_it() -> None:
    twice = changed(CARD, cut={"passes": 2})
    read = strokes(read_program(post(strokes_of(("cut", SQUARE)), KNIFE, twice), KNIFE))
    assert len(read) == 4  # the cut that turns the blade, and the square, both twice
    d = KNIFE.tool.knife.offset_mm
    first, second = read.stroke(2), read.stroke(3)
    assert first[0, :2] == pytest.approx((20 + d, 20))
    # The overcut ends along +X, past the corner, so the second pass comes down so too.
    assert second[0, :2] == pytest.approx((20 + d, 20))
    assert first[-1, :2] == pytest.approx((20.5 + d, 20))


def test_a_knife_cuts_no_score_through_unasked() -> None:
    deep = replace(KNIFE, tool=replace(KNIFE.tool, knife=replace(KNIFE.tool.knife, s_shallow=None)))
    path = strokes_of(("score", DASHES[0]), ("cut", SQUARE))
    with pytest.raises(LayoutError, match=r"strokes to score, .* s_shallow.* leave_out"):
        post(path, deep, CARD)
    without = replace(
        deep, tool=replace(deep.tool, knife=replace(deep.tool.knife, leave_out=("score",)))
    )
    job = post(path, without, CARD)
    assert "(left out score)\n" in job.text
    assert "(operation score)" not in job.text


def test_a_cutter_is_told_speed_and_force_with_each_pen() -> None:
    lines = post(strokes_of(("score", DASHES[0]), ("cut", SQUARE)), CUTTER, CARD).text.splitlines()
    assert lines[0] == "IN;PA;"
    assert [line for line in lines if "SP" in line] == [
        "PU;SP4;VS2;FS120;", "PU;SP2;VS4;FS40;", "PU;SP4;VS2;FS120;", "PU;PU0,0;SP0;",
    ]  # fmt: skip
    with pytest.raises(ProfileError, match="cannot set a laser's power"):
        post(strokes_of(("cut", SQUARE)), replace(CUTTER, tool=MARLIN.tool), CARD)


def test_a_plotter_is_told_its_pen_and_speed_alone() -> None:
    plotter = replace(CUTTER, tool=load_machine("grbl-pen-a4").tool)
    job = post(strokes_of(("cut", SQUARE)), plotter, CARD)
    assert "FS" not in job.text
    read = strokes(read_program(job, plotter))
    assert read.stroke(0)[:, :2] == pytest.approx(np.array(SQUARE))


def test_a_job_for_a_cutter_is_a_directory_like_any_other(tmp_path, pattern) -> None:
    pattern.save(tmp_path / "flat.fold", title="flat")
    made = sheets(tmp_path / "flat.fold", "hpgl-cutter-a3", "card-250").write(tmp_path / "job")
    assert (tmp_path / "job" / "sheet-01.plt").read_text() == made.jobs[0].text
    assert not list((tmp_path / "job").glob("*.nc"))
    assert read_job(tmp_path / "job").jobs[0].text == made.jobs[0].text
    assert preview(tmp_path / "job").sheets[0].warnings == ()
    alone = preview(tmp_path / "job" / "sheet-01.plt")
    assert alone.machine.name == "hpgl-cutter-a3"
    # Made again for another machine, nothing of the first is left behind.
    sheets(tmp_path / "flat.fold", "grbl-laser-400", "card-250").write(tmp_path / "job")
    assert not list((tmp_path / "job").glob("*.plt"))


@pytest.mark.parametrize(
    ("name", "old", "new", "complaint"),
    [
        ("grbl-laser-400", "s_min = 0", 's_min = 0\noffset = "1mm"', "'offset' is not a known key"),
        ("grbl-knife-a3", 'offset = "0.25mm"', "", "'offset' is missing"),
        (
            "grbl-knife-a3",
            'overcut = "0.5mm"',
            'leave_out = ["scores"]',
            "did you mean 'score'",
        ),
        ("grbl-knife-a3", 'overcut = "0.5mm"', "leave_out = 3", "part is '3'"),
        (
            "grbl-knife-a3",
            '"20deg"',
            '"0.5deg"',
            "'corner_angle' is 0.5 deg; it must be",
        ),
    ],
)
def test_a_fault_in_a_knife_is_named(tmp_path, name, old, new, complaint) -> None:
    text = (shipped_directory("firmware_profiles") / f"{name}.toml").read_text()
    assert old in text
    (tmp_path / "mine.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(ProfileError, match=rf"mine\.toml \[tool\]: .*{complaint}"):
        load_machine(tmp_path / "mine.toml")
