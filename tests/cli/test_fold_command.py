"""miurafab fold and miurafab convert: what they print, what they write, how they exit."""

import json

import pytest
from command_line import sentence
from PIL import Image
from problems import fitted, regular

from miurafab.origami.folding import thick_panels as thickness


@pytest.fixture
def rigid(tmp_path):
    regular(6, 5).save(tmp_path / "rigid.fold")
    return tmp_path / "rigid.fold"


@pytest.fixture
def stiff(tmp_path):
    fitted("hypar", 8, 8).pattern.save(tmp_path / "stiff.fold")
    return tmp_path / "stiff.fold"


@pytest.mark.parametrize("ending", ["fold", "gif", "glb", "html"])
def test_a_motion_is_written_by_its_ending(run, rigid, tmp_path, ending):
    out = tmp_path / f"motion.{ending}"
    done = run("fold", rigid, "-o", out, "--steps", "6", "--csv", tmp_path / "a.csv", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    answer = json.loads(done.stdout)
    assert answer["file"] == str(out)
    assert out.stat().st_size > 1000
    assert (tmp_path / "a.csv").read_text().startswith("edge,tail,head,assignment,s=0,")
    assert answer["motion"] == "rigid"
    assert answer["rigid"] is True
    assert answer["frames"] == 7
    assert answer["states"][0] == 0.0
    assert answer["states"][-1] is None  # folded flat
    assert answer["self_contacts"] == []
    assert answer["max_mismatch"] < 1e-9


def test_a_sheet_that_bends_says_so(run, stiff, tmp_path):
    done = run("fold", stiff, "-o", tmp_path / "a.html", "--steps", "6", "--colour", "strain")
    assert done.returncode == 0
    assert "does not fold rigidly" in done.stdout
    assert "where its median fold angle is " in done.stdout
    assert "s = " not in done.stdout
    assert "bending" in done.stdout
    quiet = run("fold", stiff, "--steps", "6", "--quiet")
    assert quiet.stderr == ""


def test_a_picture_that_moves_shows_the_strain(run, stiff, tmp_path):
    seen = []
    for colour in ("side", "strain"):
        done = run("fold", stiff, "-o", "a.gif", "--steps", "2", "--colour", colour)
        assert done.returncode == 0, done.stderr
        with Image.open(tmp_path / "a.gif") as picture:
            colours = picture.convert("RGB").getcolors(1 << 20)
            seen.append((picture.n_frames, {colour for _, colour in colours}))
    (frames, plain), (same, strained) = seen
    assert frames == same
    assert len(strained - plain) > 10


def test_plates_that_are_strapped_or_meet_are_told(run, tmp_path):
    sheet = fitted("hypar", 8, 8, 0.0).pattern
    sheet.save(tmp_path / "sheet.fold")
    thick = ("--steps", "4", "--thickness", "12mm", "--method", "bennett")
    done = run("fold", "sheet.fold", *thick)
    assert "patches 0 and 1: no hinge joins them; fold both and strap them together" in done.stdout
    assert "strapped together keep the folded form and no longer move." in done.stdout
    assert "patch 2: beyond 172 degrees plates 40 and 48 collide" in done.stdout


def test_panels_that_meet_are_told(run, rigid, monkeypatch):
    """They are cut back so that none does; here too little is."""
    closing = thickness._closing
    monkeypatch.setattr(thickness, "_closing", lambda pattern, angle: 0.9 * closing(pattern, angle))
    done = run("fold", rigid, "--steps", "4", "--thickness", "1mm")
    assert done.returncode == 1
    assert "panels 0 and 1 collide" in done.stdout
    assert "at a median fold angle of " in done.stdout


@pytest.mark.parametrize("ending", ["fold", "glb"])
def test_colours_by_strain_are_refused_where_there_are_none(run, stiff, tmp_path, ending):
    out = tmp_path / f"a.{ending}"
    done = run("fold", stiff, "-o", out, "--steps", "6", "--colour", "strain")
    assert "--colour is for a .gif or .html file" in sentence(done, 2)
    assert not out.exists()


def test_the_page_begins_with_the_thickness_of_the_panels(run, rigid, tmp_path):
    done = run("fold", rigid, "-o", tmp_path / "a.html", "--steps", "6", "--thickness", "2mm")
    assert done.returncode == 0
    assert '"thickness":2.0}' in (tmp_path / "a.html").read_text()


def test_frames_in_which_paper_meets_paper_are_told_in_runs(run, tmp_path):
    tube = tmp_path / "tube.fold"
    made = run("fit", "cylinder", "--close", "seam", "--facets", "6x12", "-o", tube)
    assert made.returncode == 0
    contacts = json.loads(run("fold", tube, "--steps", "12", "--json").stdout)["self_contacts"]
    frames = [contact["frame"] for contact in contacts]
    assert frames == list(range(frames[0], frames[0] + len(frames)))
    assert min(contact["state"] for contact in contacts) > 1.0  # the tube closes at 1
    shown = run("fold", tube, "--steps", "12").stdout
    lines = [line for line in shown.splitlines() if line.startswith("frame")]
    assert [line.split(",")[0] for line in lines] == [f"frames {frames[0]} to {frames[-1]}"]
    assert "median fold angle " in lines[0]
    assert f"the first being {' and '.join(map(str, contacts[0]['facets'][0]))}" in lines[0]
    (line,) = [x for x in run("fold", tube, "--steps", "4").stdout.splitlines() if x[:5] == "frame"]
    assert line.startswith("frame 3, median fold angle 135 degrees: up to 6 pairs of facets pass ")


def test_thickness_decides_the_exit_code(run, rigid):
    thin = run("fold", rigid, "--steps", "4", "--thickness", "1mm", "--json")
    assert thin.returncode == 0
    assert json.loads(thin.stdout)["thickness"]["folds"] is True
    thick = run("fold", rigid, "--steps", "4", "--thickness", "2in")
    assert thick.returncode == 1
    assert "is too small" in thick.stdout


def test_panels_are_written_and_little_use_is_told(run, rigid, tmp_path):
    out = tmp_path / "panels.dxf"
    done = run("fold", rigid, "--steps", "4", "--thickness", "1mm", "--panels", out, "--json")
    assert done.returncode == 0
    assert json.loads(done.stdout)["thickness"]["least_useful_area"] > 0.5
    assert "TopPly" in out.read_text()
    limit = json.loads(done.stdout)["thickness"]["greatest_thickness_mm"]
    nearly = run("fold", rigid, "--steps", "4", "--thickness", f"{0.98 * limit}mm")
    assert nearly.returncode == 1
    assert "too little to use" in nearly.stdout
    gone = tmp_path / "none.dxf"
    none = run("fold", rigid, "--steps", "4", "--thickness", "2in", "--panels", gone)
    assert none.returncode == 1
    assert "none.dxf is not written" in none.stderr
    assert not gone.exists()
    assert json.loads(done.stdout)["panels"] == str(out)
    assert "add a --thickness" in sentence(run("fold", rigid, "--method", "bennett"), 2)
    plates = run("fold", rigid, "--steps", "4", "--thickness", "1mm", "--method", "bennett")
    assert plates.returncode == 0
    assert "clear up to deg" in plates.stdout
    parts = tmp_path / "parts.fold"
    plates = run("fold", rigid, "--steps", "4", "--thickness", "1mm", "--panels", parts)
    assert f"P1 being t0 and P40 b19. Lay them out: miurafab sheets {parts}" in plates.stderr
    assert len(json.loads(parts.read_text())["faces_vertices"]) == 40
    assert "thickness" in sentence(run("fold", rigid, "--panels", out), 2)
    assert "panels.doc" in sentence(run("fold", rigid, "--panels", tmp_path / "panels.doc"), 2)


def test_what_cannot_be_folded_is_one_sentence(run, rigid, stiff, tmp_path):
    assert "a.mp4" in sentence(run("fold", rigid, "-o", tmp_path / "a.mp4"), 2)
    assert "none.fold" in sentence(run("fold", tmp_path / "none.fold"), 2)
    motion = tmp_path / "motion.fold"
    stiff_panels = run("fold", stiff, "--thickness", "1mm", "-o", motion)
    assert "does not fold rigidly" in sentence(stiff_panels, 2)
    assert not motion.exists()
    assert run("fold", rigid, "--colour", "mood").returncode == 2


def test_convert_tells_what_was_lost(run, rigid, tmp_path):
    done = run("convert", rigid, tmp_path / "a.cp", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    answer = json.loads(done.stdout)
    assert answer["facets"] == 20
    assert [finding["sentence"] for finding in answer["findings"]] == [
        "a.cp does not hold the folded form.",
        "a.cp tells mountains from valleys and no fold angles.",
    ]
    done = run("convert", tmp_path / "a.cp", tmp_path / "b.fold", "--tolerance", "0.1mm")
    assert done.returncode == 0
    assert "folded flat" in done.stderr


def test_what_cannot_be_converted_is_one_sentence(run, rigid, tmp_path):
    assert "a.doc" in sentence(run("convert", rigid, tmp_path / "a.doc"), 2)
    assert "tolerance" in run("convert", "--help").stdout
    assert "'x'" in sentence(run("convert", rigid, tmp_path / "a.cp", "--tolerance", "x"), 2)
