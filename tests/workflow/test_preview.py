"""The dry run against lengths known beforehand, and every warning by a job that earns it."""

import json
import re
import socket
from dataclasses import replace

import numpy as np
import pytest
import serial
from problems import regular
from small_jobs import KNOWN, LASER, dashes, known_toolpath, write_folder, write_nc

import miurafab
from miurafab.errors import GcodeError, InputError, ProfileError
from miurafab.gcode.job import Job
from miurafab.profiles import load_machine
from miurafab.workflow import picture
from miurafab.workflow.cut import prepare
from miurafab.workflow.dry_run import LAYERS, clock_text, dry_run, length_text
from miurafab.workflow.preview import preview

BED = (400.0, 400.0)


def run(text, machine=LASER):
    return dry_run("job", Job("job.nc", text), machine, BED)


def test_figures_of_a_known_sheet(tmp_path):
    path = write_nc(tmp_path, known_toolpath())
    sheet = preview(path).sheets[0]
    assert sheet.name == "sheet-01"
    assert sheet.lines == len(path.read_text().splitlines())
    assert sheet.cut_mm == pytest.approx(5 + 30 + 40 + 100)
    assert sheet.travel_mm == pytest.approx(known_toolpath().travel_mm)
    assert sheet.bounds_mm == (3.0, 4.0, 130.0, 140.0)
    assert sheet.warnings == ()
    by_layer = {layer.name: mm for layer, mm in zip(LAYERS, sheet.layer_mm, strict=True)}
    assert by_layer.pop("travel") == pytest.approx(sheet.travel_mm)
    assert by_layer == pytest.approx(
        {"engrave": 5, "score": 30, "perforate": 40, "cut": 100, "burn": 0}
    )
    assert sheet.layer_strokes == (0, 1, 1, 1, 1, 0)
    # never faster than its feeds, and every move ends no sooner than the one before
    slowest = 60 * (5 / 3000 + 30 / 2400 + 40 / 1500 + 100 / 900)
    assert slowest <= sheet.beam_on_seconds < 1.2 * slowest
    assert sheet.beam_on_seconds < sheet.seconds
    assert (np.diff(sheet.end_seconds) >= 0).all()
    assert sheet.end_seconds[-1] == pytest.approx(sheet.seconds)


def test_many_dashes_add_up(tmp_path):
    toolpath = dashes(500)
    sheet = preview(write_nc(tmp_path, toolpath)).sheets[0]
    assert sheet.cut_mm == pytest.approx(toolpath.lengths.sum(), abs=500 * 1e-3)
    assert sheet.travel_mm == pytest.approx(toolpath.travel_mm, abs=500 * 1e-3)
    assert (
        sheet.layer_strokes[LAYERS.index(next(x for x in LAYERS if x.name == "perforate"))] == 500
    )


CLEAN = "(operation cut)\nM5\nG21\nG90\nM4 S0\nG0 X10 Y10\nG1 X20 S500 F900\nM5\nM2\n"


@pytest.mark.parametrize(
    ("before", "after", "warning"),
    [
        ("X20", "X400.01", r"line 7 moves to X400\.01 Y10, off the bed .*\(400 x 400 mm\)"),
        ("X20", "X400.0008", r"line 7 moves to X400\.0008 Y10, off the bed"),
        ("X10 Y10", "X10 Y-2", r"line 6 \(the first of 2\) moves to X10 Y-2, off the bed"),
        ("S500", "S1001", r"line 7 asks for S1001, more than the 1000 that is full power"),
        ("F900", "F6001", r"line 7 asks for F6001, above the largest rate"),
        ("M4", "M3", r"line 5 arms the laser with M3, which keeps the beam on"),
        ("M4", "m3", r"line 5 arms the laser with M3, which keeps the beam on"),
        ("M4", "M03.0", r"line 5 arms the laser with M3, which keeps the beam on"),
        ("M4", "M (x)/+0 3", r"line 5 arms the laser with M3, which keeps the beam on"),
        ("M5\nM2", "", r"ends with M4 in force"),
        ("G1 X20 S500", "M3\nG1 X20 S500", r"line 7 arms the laser with M3"),
        ("(operation cut)", "(stop!)", r"line 1 holds '!' in a comment"),
        ("(operation cut)", "; größer", r"line 1 holds 'ö' in a comment"),
        ("S500", "S0", r"job\.nc burns nothing"),
        ("F900", "F900." + "0" * 80, r"line 7 has \d+ characters .* controller's 79"),
    ],
)
def test_each_finding_is_earned(before, after, warning):
    assert run(CLEAN).warnings == ()
    assert before in CLEAN
    found = run(CLEAN.replace(before, after)).warnings
    assert [text for text in found if re.search(warning, text)] == list(found)
    assert len(found) == 1


def test_the_last_half_micron_of_the_bed_is_the_bed():
    assert run(CLEAN.replace("X20", "X400.0004")).findings == ()
    assert run(CLEAN.replace("X10 Y10", "X10 Y-0.0004")).findings == ()
    assert [f.code for f in run(CLEAN.replace("X10 Y10", "X10 Y-0.0006")).findings] == ["bounds"]


def codes(text, machine=LASER):
    return [finding.code for finding in run(text, machine).findings]


def test_a_dwell_under_a_constant_beam_burns_in_place():
    text = CLEAN.replace("M4", "M3").replace("F900\n", "F900\nG4 P0.5\nG4P1\n")
    assert "line 8 (the first of 2) waits with the beam on at S500" in " ".join(run(text).warnings)
    assert "dwell" not in codes(text.replace("M3", "M4"))
    dark = text.replace("G4 P0.5\nG4P1\n", "M5\nG4 P0.5\n")
    assert "dwell" not in codes(dark)


def test_marlin_without_inline_mode_burns_in_a_dwell_under_m3():
    text = "M3 S100\nG4 P500\nG1 X10 S100 F600\nG4 S1\nM5\n"
    marlin = load_machine("marlin-laser-220")
    assert "dwell" in codes(text, marlin)
    assert "line 2 (the first of 2) waits with the beam on at S100" in run(text, marlin).warnings[1]
    assert "dwell" in codes("M3 S100\nG4.0 P500\nM5\n", marlin)
    for dark in (text.replace("M3", "M4 I"), text.replace("S100", "S0"), text.replace("M3", "M5")):
        assert "dwell" not in codes(dark, marlin)
    assert "dwell" not in codes("M3 S100\nG4 P0.5\nM5\n")  # laser mode is dark under G0


def test_m2_disarms_and_g40_is_no_dwell():
    assert run(CLEAN.replace("M5\nM2", "M2")).warnings == ()
    assert run(CLEAN.replace("M4 S0", "M4 S0\nG40")).warnings == ()


def test_laser_mode_off_is_a_hazard_for_lasers_only():
    off = replace(LASER, settings={**LASER.settings, 32: 0.0})
    assert codes(CLEAN, off) == ["m3", "laser-mode"]  # M4 is as M3 there
    assert codes(CLEAN.replace("M4", "M3"), LASER) == ["m3"]
    pen = replace(off, tool=replace(off.tool, kind="pen"))
    assert run(CLEAN.replace("M4", "M3"), pen).warnings == ()


def test_what_no_comment_names_is_shown_as_other():
    sheet = run(CLEAN.replace("(operation cut)", "(operation travel)"))
    assert sheet.layer_mm[-1] == pytest.approx(10)


def test_a_program_the_controller_would_refuse_is_an_error():
    with pytest.raises(GcodeError, match=r"job\.nc, line 7"):
        run(CLEAN.replace("F900", ""))
    with pytest.raises(GcodeError, match=r"job\.nc, line 7.*feed hold"):
        run(CLEAN.replace("F900", "F900!"))


def test_a_dump_wins_over_the_profile(tmp_path):
    path = write_nc(tmp_path, known_toolpath())
    dump = tmp_path / "mine.txt"
    dump.write_text(
        "$30=300\n$110=1200.000\n$111=1200.000\n$120=20.000\n$121=20.000\n$131=120\nok\n"
    )
    seen = preview(path, settings=dump)
    assert seen.machine.tool.s_max == 300
    assert seen.machine.motion.max_rate_mm_min == (1200.0, 1200.0)
    assert seen.machine.bed.height_mm == 120
    assert seen.sheets[0].seconds > 2 * preview(path).sheets[0].seconds
    warnings = " ".join(seen.sheets[0].warnings)
    assert "off the bed of grbl-laser-400 (400 x 120 mm)" in warnings
    assert "more than the 300 that is full power" in warnings
    dump.write_text("hello\n")
    with pytest.raises(ProfileError, match=r"mine\.txt"):
        preview(path, settings=dump)
    with pytest.raises(InputError, match=r"none\.txt"):
        preview(path, settings=tmp_path / "none.txt")


def test_the_machine_is_the_one_that_the_job_names(tmp_path):
    path = write_nc(tmp_path, known_toolpath())
    assert preview(path).findings == ()
    path.write_text(path.read_text().replace("(machine grbl-laser-400)\n", ""))
    seen = preview(path)
    assert seen.machine == LASER
    assert seen.findings[0].code == "assumed-machine"
    assert "No machine is named" in seen.findings[0].sentence
    path.write_text("(machine mine)\n" + path.read_text())
    with pytest.raises(ProfileError, match="mine"):
        preview(path)
    profiles = miurafab.profiles.shipped_directory("firmware_profiles")
    own = (profiles / "grbl-laser-400.toml").read_text().replace("Diode laser", "My laser")
    (tmp_path / "mine.toml").write_text(own)
    assert preview(path).machine.title.startswith("My laser")
    assert preview(path, machine=LASER).machine == LASER


def test_a_job_directory_with_its_pattern(tmp_path):
    pattern = regular()
    seen = preview(write_folder(tmp_path / "job", pattern))
    assert seen.name == "job"
    assert [sheet.name for sheet in seen.sheets] == ["sheet-01", "sheet-02"]
    assert seen.sheets[0].paper_mm == (380.0, 300.0)
    assert seen.seconds == pytest.approx(2 * seen.sheets[0].seconds)
    assert seen.findings == ()
    assert seen.pattern is not None
    assert np.array_equal(seen.pattern.vertices_coords, pattern.vertices_coords)
    answer = json.loads(json.dumps(seen.as_dict()))
    assert answer["machine"] == "grbl-laser-400"
    assert set(answer["sheets"][1]) >= {
        *("lines", "seconds", "beam_on_seconds", "cut_mm", "travel_mm", "bounds_mm", "warnings")
    }


def test_a_pattern_that_is_not_the_same_is_not_shown(tmp_path):
    folder = write_folder(tmp_path / "job", regular())
    fold = folder / "shape.fold"
    fold.write_text(fold.read_text() + "\n")
    seen = preview(folder)
    assert seen.pattern is None
    assert "has changed" in seen.findings[0].sentence
    fold.unlink()
    assert "is not there" in preview(folder).findings[0].sentence


def test_a_folder_of_plain_gcode_is_a_job_too(tmp_path):
    for name in ("b", "a"):
        write_nc(tmp_path, known_toolpath(name))
    seen = preview(tmp_path)
    assert [sheet.name for sheet in seen.sheets] == ["a", "b"]
    assert seen.sheets[0].paper_mm == BED


@pytest.mark.parametrize("text", ["{", "[]", '{"machine": 3}', '{"schema": "other"}'])
def test_a_broken_layout_is_named(tmp_path, text):
    folder = write_folder(tmp_path / "job")
    (folder / "layout.json").write_text(text)
    with pytest.raises(InputError, match=r"layout\.json is not a layout"):
        preview(folder)


def test_what_is_no_job_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"nothing does not exist"):
        preview(tmp_path / "nothing")
    with pytest.raises(InputError, match=r"holds no G-code"):
        preview(tmp_path)
    folder = write_folder(tmp_path / "job")
    (folder / "sheet-02.nc").unlink()
    with pytest.raises(InputError, match=r"sheet-02\.nc does not exist"):
        preview(folder)


def test_a_job_that_was_made_is_timed_as_a_board_is_set_and_told_while_it_is_drawn(tmp_path):
    job = miurafab.sheets(regular(3, 3)).write(tmp_path / "job")
    dump = tmp_path / "board.txt"
    dump.write_text("$110=600\n$111=600\n")
    usual, slow = miurafab.preview(job), miurafab.preview(job, settings=dump)
    assert slow.seconds > 2 * usual.seconds
    told = []
    *pictures, page = slow.write(tmp_path / "seen", on_progress=lambda *now: told.append(now))
    assert page.name == "preview.html"
    assert [each.suffix for each in pictures] == [".png", ".svg"]
    assert told[0] == (0.0, "pictures")


def test_a_picture_of_megabytes_is_left_out_of_a_notebook(tmp_path, monkeypatch):
    job = miurafab.sheets(regular(3, 3)).write(tmp_path / "job")
    assert "image/svg+xml" in job._repr_mimebundle_()
    monkeypatch.setattr(picture, "_MOST_MOVES", 3)
    assert "image/svg+xml" not in job._repr_mimebundle_()


def test_no_port_is_opened(tmp_path, monkeypatch):
    def refuse(*_args, **_kwargs):
        raise AssertionError("a port was opened")

    monkeypatch.setattr(serial, "Serial", refuse)
    monkeypatch.setattr(serial, "serial_for_url", refuse)
    monkeypatch.setattr(socket, "socket", refuse)
    assert preview(write_folder(tmp_path / "job")).sheets


def test_progress_is_told(tmp_path):
    told = []
    preview(
        write_folder(tmp_path / "job"), on_progress=lambda part, note: told.append((part, note))
    )
    assert told == [(0.0, "sheet-01.nc"), (0.5, "sheet-02.nc")]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0:00"), (59.4, "0:59"), (59.6, "1:00"), (3599.6, "1:00:00"), (7325, "2:02:05")],
)
def test_clock_text(seconds, text):
    assert clock_text(seconds) == text


@pytest.mark.parametrize(
    ("mm", "text"), [(0, "0.0 mm"), (12.34, "12.3 mm"), (123.4, "123 mm"), (1234.5, "1.23 m")]
)
def test_length_text(mm, text):
    assert length_text(mm) == text


def test_known_lengths_are_what_the_tests_say():
    lengths = {name: sum(np.hypot(*np.diff(points, axis=0).T)) for name, points in KNOWN.items()}
    assert lengths == {"engrave": 5, "score": 30, "perforate": 40, "cut": 100}


def test_the_timing_of_a_program_tells_its_share(tmp_path):
    lines = "".join(f"G1 X{n % 200 + 1} Y{n % 7} F3000\n" for n in range(3000))
    (tmp_path / "long.nc").write_text(f"M4 S0\nS500\n{lines}M5\n")
    told = []
    prepare(tmp_path / "long.nc", on_progress=lambda share, note: told.append((share, note)))
    shares = [share for share, _ in told]
    assert shares == sorted(shares)
    assert shares[0] < 0.1
    assert 0.6 < shares[-1] <= 1
    assert {note for _, note in told} == {"timing long.nc"}
