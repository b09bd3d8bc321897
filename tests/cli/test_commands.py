"""What every command keeps to: help, JSON alone on standard output, exit codes, one sentence."""

import json
import subprocess
import sys
from importlib.metadata import version

import pytest
from command_line import sentence

from miurafab.cli import app

COMMANDS = sorted(command.name for command in app.registered_commands)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_and_json(run, command):
    done = run(command, "--help")
    assert done.returncode == 0
    assert "--json" in done.stdout
    assert "--quiet" in done.stdout
    summary = done.stdout.splitlines()[2].strip()
    assert summary.endswith((".", ";")) or summary, done.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_an_unknown_option_is_exit_2(run, command):
    done = run(command, "--no-such-option")
    assert done.returncode == 2
    assert "no-such-option" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_version_is_that_of_the_package(run):
    done = run("--version")
    assert (done.returncode, done.stdout) == (0, f"miurafab {version('miurafab')}\n")


@pytest.mark.parametrize("command", ["surfaces", "profiles", "materials"])
def test_lists_are_json(run, command):
    done = run(command, "--json")
    assert done.returncode == 0
    assert done.stderr == ""
    (entries,) = json.loads(done.stdout).values()
    assert all(entry["name"] for entry in entries)


def test_fit_then_check_recomputes_the_same_numbers(run, tmp_path):
    fold, report = tmp_path / "hypar.fold", tmp_path / "report.json"
    fitted = run(
        "fit", "hypar:height=0.4", "--facets", "12x10", "-o", fold, "--report", report, "--json"
    )
    assert fitted.returncode == 0, fitted.stderr
    assert fitted.stderr == ""
    answer = json.loads(fitted.stdout)
    assert answer == json.loads(report.read_text())
    checked = run("check", fold, "--json")
    assert checked.returncode == 0
    again = json.loads(checked.stdout)
    for name in ("facets", "vertices", "self_intersections", "overlaps"):
        assert again[name] == answer[name]
    for name in ("min_edge_mm", "hausdorff_mm", "hausdorff_midsurface_mm", "area_ratio"):
        assert again[name] == pytest.approx(answer[name], rel=1e-9)
    assert answer["facets"] == 120
    for name in ("max_planarity", "max_developability", "max_isometry"):
        assert again[name] <= 1e-10


def test_the_same_fit_gives_the_same_bytes(run, tmp_path):
    for name in ("a.fold", "b.fold"):
        assert run("fit", "sphere", "--facets", "8x8", "-o", tmp_path / name).returncode == 0
    assert (tmp_path / "a.fold").read_bytes() == (tmp_path / "b.fold").read_bytes()


def test_check_says_no_to_a_torn_pattern(run, tmp_path):
    fold = tmp_path / "hypar.fold"
    assert run("fit", "hypar", "--facets", "6x6", "-o", fold).returncode == 0
    document = json.loads(fold.read_text())
    document["vertices_coords"][10][0] += 0.01
    fold.write_text(json.dumps(document))
    done = run("check", fold, "--json")
    assert done.returncode == 1
    assert "isometry" in {finding["code"] for finding in json.loads(done.stdout)["findings"]}


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("fit", "no-such-surface", "-o", "x.fold"), "no-such-surface"),
        (("fit", "hyppar", "-o", "x.fold"), "did you mean 'hypar'"),
        (("fit", "hypar:hight=1", "-o", "x.fold"), "no parameter 'hight'"),
        (("fit", "hypar:height", "-o", "x.fold"), "parameter=value"),
        (("fit", "sphere:width=900deg", "-o", "x.fold"), "must be between"),
        (("fit", "gone.stl", "-o", "x.fold"), "gone.stl does not exist"),
        (("fit", "gone.toml", "-o", "x.fold"), "gone"),
        (("fit", "hypar", "--facets", "20", "-o", "x.fold"), "--facets"),
        (("fit", "hypar", "--facets", "1x9", "-o", "x.fold"), "1x9"),
        (("fit", "hypar", "--size", "20 parsec", "-o", "x.fold"), "parsec"),
        (("fit", "hypar", "--size", "-3mm", "-o", "x.fold"), "--size"),
        (("fit", "hypar", "--flat-foldable", "4", "-o", "x.fold"), "--flat-foldable"),
        (("fit", "hypar", "--facets", "4x4", "-o", "no/such/folder/x.fold"), "no/such/folder"),
        (("check", "gone.fold"), "gone.fold does not exist"),
        (("profiles", "gone"), "'gone' is not a known machine"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_2(run, arguments, named):
    assert named in sentence(run(*arguments, "--quiet"), 2)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "not json",
        "[]",
        "{}",
        '{"vertices_coords": [[0, 0]]}',
        '{"vertices_coords": [[0, "x"]]}',
    ],
)
def test_a_file_that_is_no_pattern(run, tmp_path, content):
    path = tmp_path / "bad.fold"
    path.write_text(content)
    assert "bad.fold" in sentence(run("check", path), 2)


def test_an_error_with_json_is_json_too(run, tmp_path):
    done = run("check", tmp_path / "gone.fold", "--json")
    assert done.returncode == 2
    answer = json.loads(done.stdout)
    assert answer["kind"] == "PatternError"
    assert "gone.fold" in answer["error"]


def test_the_module_runs_as_a_process_and_starts_light():
    """Help must not wait for the scientific libraries."""
    code = (
        "import sys; sys.argv = ['miurafab', '--help']\n"
        "from miurafab.__main__ import main\n"
        "try:\n    main()\n"
        "except SystemExit:\n    assert not {'scipy', 'trimesh', 'shapely'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
    done = subprocess.run(
        [sys.executable, "-m", "miurafab", "check", "gone.fold"], capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "miurafab: gone.fold does not exist.\n"


def test_every_drawing_is_reached_by_sheets_and_goes_with_its_job(run, tmp_path):
    fold, job = tmp_path / "small.fold", tmp_path / "job"
    assert run("fit", "plane", "--facets", "6x6", "--size", "80mm", "-o", fold).returncode == 0
    drawn = "svg,dxf,dxf-r2010,pdf,hpgl,tiled-a4,tiled-a3,tiled-letter,tiled-legal,picture"
    done = run("sheets", fold, "-o", job, "--formats", drawn, "--json")
    assert done.returncode == 0, done.stderr
    sheet = {
        ".nc", ".svg", ".dxf", "-r2010.dxf", ".pdf", ".hpgl",
        "-a4.pdf", "-a3.pdf", "-letter.pdf", "-legal.pdf",
    }  # fmt: skip
    own = {"layout.json", "assembly.pdf", "small.fold", "pattern.svg"}
    assert {path.name for path in job.iterdir()} == own | {f"sheet-01{end}" for end in sheet}
    assert "$INSUNITS" in (job / "sheet-01-r2010.dxf").read_text()
    # A job made anew in the same place leaves nothing of this one behind.
    assert run("sheets", fold, "-o", job, "--json").returncode == 0
    left = {"sheet-01.nc", "sheet-01.svg", *own} - {"pattern.svg"}
    assert {path.name for path in job.iterdir()} == left
    wrong = run("sheets", fold, "-o", job, "--format", "tiled-a5")
    assert wrong.returncode == 2
    assert "did you mean 'tiled-a4'?" in wrong.stderr
    helped = run("sheets", "--help").stdout
    assert all(name in helped for name in drawn.split(",")[1:])
