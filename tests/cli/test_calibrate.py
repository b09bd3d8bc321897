"""``miurafab calibrate`` and ``miurafab materials add``: from a sheet to a material."""

import json
from dataclasses import replace

import pytest
from command_line import sentence

from miurafab.fabrication.beam_findings import beam_findings
from miurafab.profiles import load_machine, load_material, shipped_directory


@pytest.fixture
def sheet(run):
    done = run("calibrate", "--material", "card-250", "-o", "trial", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_sheet_is_a_job_that_can_be_previewed_and_cut(run, sheet, tmp_path):
    seen = run("preview", "trial", "--json")
    assert seen.returncode == 0, seen.stderr
    (figures,) = json.loads(seen.stdout)["sheets"]
    assert figures["warnings"] == []
    assert json.loads(seen.stdout)["findings"] == []
    assert figures["seconds"] == pytest.approx(sheet["seconds"], abs=0.1)
    assert (tmp_path / "trial" / "calibration.pdf").read_bytes().startswith(b"%PDF")
    layout = json.loads((tmp_path / "trial" / "layout.json").read_text())
    assert layout["patches"] == []
    cut = run("cut", "trial", "--dry-run", "--json")
    assert cut.returncode == 0, cut.stderr


def test_what_was_chosen_becomes_a_material(run, sheet, tmp_path):
    cell = next(entry for entry in sheet["cells"] if entry["label"] == "C4")
    square = next(entry for entry in sheet["squares"] if entry["label"] == "X3")
    score = next(entry for entry in sheet["scores"] if entry["label"] == "S4")
    chosen = ("--cell", "c4", "--cut", "X3", "--score", "s4", "--kerf", "0.2mm")
    done = run("materials", "add", "mine", "--from", "trial", *chosen, "--json")
    assert done.returncode == 0, done.stderr
    mine, base = load_material(tmp_path / "mine.toml"), load_material("card-250")
    assert mine.kerf_mm == 0.2
    assert (mine.perforation.cut_mm, mine.perforation.gap_mm) == (cell["cut_mm"], cell["gap_mm"])
    assert list(mine.beams) == ["diode"]
    made, before = mine.beams["diode"].operations, base.beams["diode"].operations
    assert made["perforate"].power == cell["power"]
    assert made["perforate"].feed_mm_min == cell["feed_mm_min"]
    assert made["cut"].power == square["power"]
    assert made["cut"].feed_mm_min == square["feed_mm_min"]
    assert made["score"].power == score["power"] != before["score"].power
    assert made["engrave"] == before["engrave"]
    assert mine.beams["diode"].meant.lasers == (10.0, 10.0)
    assert mine.tabs == base.tabs
    again = run("calibrate", "--material", "mine.toml", "-o", "second")
    assert again.returncode == 0, again.stderr
    assert (tmp_path / "second" / "mine.toml").is_file()
    third = run("materials", "add", "third", "--from", "second", "--cell", "B1", "--quiet")
    assert third.returncode == 0, third.stderr
    assert load_material(tmp_path / "third.toml").kerf_mm == 0.2


def test_what_is_finer_for_one_kind_of_crease_gives_way_to_the_choice(run, tmp_path):
    import miurafab.profiles as profiles

    text = (profiles.shipped_directory("materials") / "card-250.toml").read_text()
    (tmp_path / "own.toml").write_text(text + '\n[creases.valley]\ncut = "2mm"\nfit = "centre"\n')
    run("calibrate", "--material", tmp_path / "own.toml", "-o", "trial")
    run("materials", "add", "mine", "--from", "trial", "--cell", "B2")
    mine = load_material(tmp_path / "mine.toml")
    assert mine.perforation_of("valley") == mine.perforation


def test_wrong_choices_are_one_sentence(run, sheet, tmp_path):
    (tmp_path / "there.toml").write_text("")
    (tmp_path / "empty").mkdir()
    for arguments, named in (
        (("mine", "--from", "trial", "--cell", "Z9"), "there are A1 to"),
        (("mine", "--from", "trial", "--cut", "B1"), "there are X1 to"),
        (("mine", "--from", "trial"), "Nothing was chosen"),
        (("mine", "--from", "empty", "--cell", "A1"), "holds no calibration"),
        (("there", "--from", "trial", "--cell", "A1"), "exists already"),
        (("my card", "--from", "trial", "--cell", "A1"), "cannot name a material"),
        (("mine", "--from", "trial", "--kerf", "3mm"), "between 0 mm and 2 mm"),
        (("mine", "--from", "trial", "--cell", "A1", "--kerf", "0.9mm"), "cannot be drawn"),
    ):
        assert named in sentence(run("materials", "add", *arguments), 2)
        assert not (tmp_path / "mine.toml").exists()


def test_materials_still_lists_and_shows(run):
    listed = json.loads(run("materials", "--json").stdout)
    assert "card-250" in [entry["name"] for entry in listed["materials"]]
    assert json.loads(run("materials", "card-250", "--json").stdout)["name"] == "card-250"
    assert json.loads(run("materials", "--json", "card-250").stdout)["name"] == "card-250"
    assert "not a known material" in sentence(run("materials", "card-25"), 2)


@pytest.mark.parametrize("machine", ["grbl-knife-a3", "grbl-pen-a4", "hpgl-cutter-a3"])
def test_forces_are_tried_chosen_and_kept_for_that_machine_alone(run, tmp_path, machine):
    made = json.loads(run("calibrate", "--machine", machine, "-o", "trial", "--json").stdout)
    forces = {entry["force"] for entry in made["cells"]}
    assert len(forces) == 5
    chosen = ("--cell", "B1", "--cut", "X2", "--score", "S1", "--quiet")
    done = run("materials", "add", "mine", "--from", "trial", *chosen)
    assert done.returncode == 0, done.stderr
    mine, used = load_material(tmp_path / "mine.toml"), load_machine(machine)
    assert list(mine.beams) == [used.tool.beam]
    weakest = min(entry["force"] for entry in made["cells"])
    assert mine.on(used).operations["perforate"].force == weakest < used.tool.s_down
    other = replace(used, name="another")
    assert mine.on(other).operations["perforate"].force is None
    assert [each.code for each in beam_findings(other, mine)] == ["other-forces"]
    assert beam_findings(used, mine) == []


def test_a_beam_without_settings_begins_with_a_power_and_a_feed_of_ones_own(run, tmp_path):
    k40 = ("--machine", "grbl-co2-k40", "--material", "card-250", "-o", "trial")
    assert "no settings for a CO2 laser" in sentence(run("calibrate", *k40), 2)
    assert "--feed is missing" in sentence(run("calibrate", *k40, "--power", "4W"), 2)
    assert "--power is missing" in sentence(run("calibrate", *k40, "--feed", "900"), 2)
    begin = ("--power", "4W", "--feed", "1800mm/min")
    made = json.loads(run("calibrate", *k40, *begin, "--json").stdout)
    assert max(entry["power"] for entry in made["squares"]) == pytest.approx(5.2)
    assert run("preview", "trial").returncode == 0
    run("materials", "add", "mine", "--from", "trial", "--cut", "X1", "--cell", "A1", "--quiet")
    mine = load_material(tmp_path / "mine.toml")
    assert list(mine.beams) == ["co2"]
    assert mine.on(load_machine("grbl-co2-k40")).most_watts == pytest.approx(5.2)
    assert "has some: leave it out" in sentence(run("calibrate", "-o", "x", *begin), 2)


def test_a_blade_that_leaves_scores_out_tries_none(run, tmp_path):
    """Of a card that nobody has cut with a knife, from its feed alone."""
    knife = (shipped_directory("firmware_profiles") / "grbl-knife-a3.toml").read_text()
    (tmp_path / "deep.toml").write_text(knife.replace("s_down", 'leave_out = ["score"]\ns_down'))
    card = (shipped_directory("materials") / "card-250.toml").read_text()
    (tmp_path / "new.toml").write_text(card[: card.index("[beams.knife")])
    deep = ("--machine", "deep.toml", "--material", "new.toml", "-o", "trial")
    assert "--power is for a laser" in sentence(
        run("calibrate", *deep, "--power", "3W", "--feed", "600"), 2
    )
    made = run("calibrate", *deep, "--feed", "600")
    assert made.returncode == 0, made.stderr
    assert "squares" in made.stdout
    assert "scores" not in made.stdout
    add = ("materials", "add", "mine", "--from", "trial")
    assert "'S1' is not on the sheet in trial, which has none" in sentence(
        run(*add, "--score", "S1"), 2
    )
    assert run(*add, "--cell", "A1", "--quiet").returncode == 0
    assert list(load_material(tmp_path / "mine.toml").beams) == ["knife"]


def test_a_diode_without_settings_begins_with_its_wavelength(run, tmp_path):
    foil = ("--machine", "grbl-laser-400", "--material", "polypropylene-04", "-o", "trial")
    assert run("calibrate", *foil, "--power", "3W", "--feed", "600").returncode == 0
    run("materials", "add", "mine", "--from", "trial", "--cut", "X1", "--quiet")
    meant = load_material(tmp_path / "mine.toml").beams["diode"].meant
    assert meant.wavelength == load_machine("grbl-laser-400").tool.laser.wavelength
