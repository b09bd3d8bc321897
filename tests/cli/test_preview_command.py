"""``miurafab preview``: what it prints, what it writes, and what it says to bad input."""

import json
from pathlib import Path

import pytest
from command_line import sentence

DATA = Path(__file__).parent.parent / "data" / "gcode"

GCODE = """(machine grbl-laser-400)
(operation cut)
M5
G21 G90
M4 S0
G0 X10 Y10
G1 X110 S500 F1200
M5
M2
"""


@pytest.fixture
def file(tmp_path):
    (tmp_path / "plate.nc").write_text(GCODE)
    return "plate.nc"


def test_a_file_in_figures_and_pictures(run, file, tmp_path):
    done = run("preview", file, "--json")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    answer = json.loads(done.stdout)
    (sheet,) = answer["sheets"]
    assert sheet["name"] == "plate"
    assert sheet["lines"] == 9
    assert sheet["cut_mm"] == 100
    assert sheet["travel_mm"] == pytest.approx(200**0.5, abs=1e-3)
    assert sheet["bounds_mm"] == [10, 10, 110, 10]
    assert 5.0 < sheet["beam_on_seconds"] < 5.2 < sheet["seconds"] < 6
    assert sheet["warnings"] == []
    assert answer["status"] == "ready"
    assert answer["machine"] == "grbl-laser-400"
    assert sorted(path.name for path in (tmp_path / "plate-preview").iterdir()) == [
        *("plate.png", "plate.svg", "preview.html")
    ]
    assert all((tmp_path / name).is_file() for name in answer["files"])


def test_people_get_a_table_and_every_warning(run, file, tmp_path):
    (tmp_path / file).write_text(GCODE.replace("X110", "X410").replace("M4", "M3"))
    done = run("preview", file, "-o", "seen")
    assert done.returncode == 1
    assert "400 mm" in done.stdout
    assert "refusal (bounds): plate.nc, line 7 moves to X410 Y10, off the bed" in done.stdout
    assert "refusal (m3): plate.nc, line 5 arms the laser with M3" in done.stdout
    assert (tmp_path / "seen" / "preview.html").is_file()


@pytest.mark.parametrize(
    ("name", "codes"), [("edge.nc", ["bounds"]), ("bad.nc", ["bounds", "power"])]
)
def test_a_preview_and_a_dry_run_judge_in_the_same_words(run, name, codes):
    where = (str(DATA / name), "--machine", "grbl-laser-400")
    done = run("preview", *where, "-o", "seen", "--json")
    assert done.returncode == 1
    preview = json.loads(done.stdout)
    seen = preview["sheets"][0]
    told = run("cut", *where, "--dry-run", "--json")
    assert told.returncode == 1
    answer = json.loads(told.stdout)
    assert answer["status"] == preview["status"] == "refused"
    assert answer["findings"] == seen["findings"]
    assert [finding["code"] for finding in seen["findings"]] == codes
    assert {finding["severity"] for finding in seen["findings"]} == {"refusal"}
    assert [finding["sentence"] for finding in seen["findings"]] == seen["warnings"]
    # the pre-flight of a real cut, which refuses with the first of them
    refused = sentence(run("cut", *where, "--port", "virtual", "--quiet"), 2)
    first = seen["findings"][0]["sentence"].rstrip(".")
    assert refused == f"miurafab: {first} (--force {codes[0]} overrides this check)."
    # and the words that people read
    shown = run("preview", *where, "-o", "seen").stdout + run("cut", *where, "--dry-run").stdout
    for finding in seen["findings"]:
        assert shown.count(f"refusal ({finding['code']}): {finding['sentence']}") == 2
    forced = [word for code in codes for word in ("--force", code)]
    assert (
        json.loads(run("cut", *where, "--dry-run", *forced, "--json").stdout)["status"] == "ready"
    )


def test_a_file_that_burns_nothing_has_no_bounds(run, tmp_path):
    (tmp_path / "dark.nc").write_text("G21 G90\nG0 X10 Y10\nM2\n")
    done = run("preview", "dark.nc", "--machine", "grbl-laser-400")
    assert done.returncode == 0
    (row,) = [line.split() for line in done.stdout.splitlines() if line.split()[:1] == ["dark"]]
    assert row[-1] == "-"


def test_what_cannot_be_forced_says_so(run, file):
    for code, words in (
        ("lines", "cannot be forced"),
        ("rate", "is a warning and stops nothing"),
        ("everything", "is not a check that can be forced; program, m3, bounds"),
    ):
        for arguments in (("--dry-run",), ("--port", "virtual")):
            refused = run("cut", file, *arguments, "--force", code, "--quiet")
            assert words in sentence(refused, 2)


def test_a_dump_says_how_fast_the_machine_is(run, file, tmp_path):
    (tmp_path / "dump.txt").write_text("$110=600\n$120=10\nok\n")
    slow = json.loads(run("preview", file, "--settings", "dump.txt", "--json").stdout)
    assert slow["sheets"][0]["seconds"] > 10
    assert any("largest rate" in text for text in slow["sheets"][0]["warnings"])


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("gone.nc",), "gone.nc does not exist"),
        (("a.fold",), "make a job with 'miurafab sheets a.fold -o JOB', then preview JOB"),
        (("empty",), "empty holds no G-code"),
        (("bad.nc",), "bad.nc, line 2"),
        (("good.nc", "--machine", "gone"), "'gone'"),
        (("good.nc", "--settings", "gone.txt"), "gone.txt does not exist"),
        (("good.nc", "--settings", "bad.nc"), "bad.nc"),
    ],
)
def test_bad_input_is_one_sentence(run, tmp_path, arguments, named):
    (tmp_path / "good.nc").write_text(GCODE)
    (tmp_path / "bad.nc").write_text("G21\nG1 X5!\n")
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.fold").write_text("{}")
    assert named in sentence(run("preview", *arguments, "--quiet"), 2)
    answer = json.loads(run("preview", *arguments, "--json").stdout)
    assert named in answer["error"]
