"""What every command keeps to: help, JSON alone on standard output, exit codes, one sentence."""

import json
import re
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import pytest
from command_line import sentence
from cyclopts import CycloptsError

import miurafab.cli
from miurafab.cli import program
from miurafab.cli.program import COMMANDS, app, examples
from miurafab.errors import EXIT_CODES

ROWS = [(name,) for name, command in COMMANDS.items() if command.call is not None]
ROWS += [(name, action) for name, command in COMMANDS.items() for action in command.actions]


def words(row):
    return " ".join(row)


def options_of(row):
    """The options and arguments of a command, as cyclopts sees them."""
    of = app
    for name in row:
        of = of[name]
    return of.assemble_argument_collection()


def test_all_commands_are_in_the_table():
    assert len(ROWS) >= 28
    assert {row[0] for row in ROWS} == {name for name in app if not name.startswith("-")}


@pytest.mark.parametrize("row", ROWS, ids=words)
def test_every_command_has_help_json_and_quiet(run, row):
    done = run(*row, "--help")
    assert done.returncode == 0
    usage, blank, summary = done.stdout.splitlines()[:3]
    assert usage.startswith(f"Usage: miurafab {words(row)}")
    assert blank == ""
    assert re.fullmatch(r"[A-Z].*", summary)
    assert done.stdout.split("\n\n")[1].endswith(".")
    for option in ("--json", "--quiet", "-h, --help"):
        assert f"\n  {option}  " in done.stdout
    assert run(*row, "-h").stdout == done.stdout
    assert done.stderr == ""


@pytest.mark.parametrize("row", ROWS, ids=words)
def test_the_summary_of_every_command_is_one_sentence_of_one_line(row):
    of = app
    for name in row:
        of = of[name]
    summary = of.help.partition("\n\n")[0]
    assert re.fullmatch(r"[A-Z][^.\n]*(\.[^. \n]+)*\.", summary), summary
    assert len(summary) <= 79


@pytest.mark.parametrize("row", ROWS, ids=words)
def test_an_unknown_option_is_exit_2_in_one_sentence(run, row):
    done = run(*row, "--no-such-option")
    assert sentence(done, 2) == f"miurafab: miurafab {words(row)} has no option --no-such-option."
    assert done.stdout == ""
    done = run(*row, "--quite", "--json")
    assert sentence(done, 2).endswith("--quite (did you mean '--quiet'?).")
    answer = json.loads(done.stdout)
    assert answer == {"error": done.stderr.removeprefix("miurafab: ").strip(), "kind": "UsageError"}


@pytest.mark.parametrize("row", ROWS, ids=words)
def test_every_option_has_help_and_says_what_a_value_is(row):
    for entry in options_of(row):
        if entry.parse and not entry.children:
            text = entry.parameter.help
            assert text, entry.name
            assert text.endswith("."), text
            assert re.match(r"[A-Z'|.]", text), text
            assert not re.search(r"\bdefault\b", text), text
            is_flag = bool in (entry.hint, *getattr(entry.hint, "__args__", ()))
            if entry.name.startswith("-") and not is_flag:
                shape = entry.parameter.metavar
                assert re.fullmatch(r"[A-Zxa-z0-9|:;,.@=\[\]]+", shape), entry.name


def test_no_default_is_typed_into_a_help_text():
    for path in Path(miurafab.cli.__file__).parent.glob("*.py"):
        text = path.read_text()
        if path.name != "help.py":
            assert "[default" not in text, path.name


@pytest.mark.parametrize("width", [60, 80, 120])
def test_help_is_as_wide_as_the_terminal(run, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    for arguments in ((), ("fit",), ("sheets",), ("cut",), ("machine",)):
        lines = run(*arguments, "--help").stdout.partition("Examples:")[0].splitlines()
        assert max(map(len, lines)) <= width
        if arguments not in ((), ("machine",)):
            assert max(map(len, lines)) > 0.8 * width


def test_bare_miurafab_is_its_help_with_the_exit_codes(run):
    done = run()
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == run("--help").stdout == run("-h").stdout
    for command in COMMANDS:
        assert f"\n  {command} " in done.stdout
    for code, meaning in EXIT_CODES.items():
        assert f"{code}  {meaning}\n" in done.stdout
    headings = re.findall(r"^([A-Z]\w+)$", done.stdout, re.MULTILINE)
    assert headings == ["Design", "Make", "Machines", "More", "General"]


def test_the_examples_name_commands_and_options_that_exist():
    for example in examples():
        program, *arguments = example.rpartition(" | ")[2].split()
        assert program == "miurafab"
        assert len(example) <= 76
        app.parse_args(arguments, exit_on_error=False, print_error=False)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("fitt",), "has no command 'fitt' (did you mean 'fit'?)."),
        (("machine", "hom"), "miurafab machine has no command 'hom' (did you mean 'home'?)."),
        (("--verbose",), "has no option '--verbose'"),
        (("fit", "hypar"), "miurafab fit needs -o FILE: The FOLD file to write."),
        (("fit", "-o", "x.fold"), "miurafab fit needs TARGET"),
        (("fit", "hypar", "-o"), "-o needs a value, FILE."),
        (("fit", "hypar", "much", "-o", "x.fold"), "takes no further argument 'much'."),
        (("fit", "hypar", "-o", "x.fold", "--facet", "3"), "(did you mean '--facets'?)."),
        (("fit", "hypar", "-o", "x.stl"), "--out is x.stl; a fit writes a FOLD file"),
        (("fit", "hypar", "-o", "-"), "--out is -; a fit writes a FOLD file"),
        (("energy", "x.fold", "--steps", "many"), "--steps is 'many', not a whole number."),
        (("cut", "job", "--pointer", "50", "--port", "virtual"), "between 0 % and 5 %"),
        (("cut", "job", "--pointer", "3", "--port", "virtual"), "ask for the --frame as well"),
        (("cut", "job.nc", "--facets", "8x8", "--port", "virtual"), "--facets is for a target"),
        (("completion", "tcsh"), "SHELL is 'tcsh'; it must be one of bash, zsh"),
        (("fit", "hypar", "-o", "x.fold", "--polish", "maybe"), "one of on, off."),
        (("fit", "hypar", "-o", "x.fold", "--close", "seem"), "--close is 'seem'; did you mean"),
        (("fit", "hypar", "-o="), "--out is empty, not a path."),
        (("cut", "job", "--dry-run=maybe"), "--dry-run is 'maybe'; it must be true or false."),
        (("cut", "job", "--no-pause=2"), "--no-pause is '2'; it must be true or false."),
    ],
)
def test_a_mistake_in_the_command_line_is_one_sentence(run, arguments, named):
    assert named in sentence(run(*arguments), 2)


def test_what_only_the_parser_knows_is_told_in_its_words(run, monkeypatch):
    def refuse(*arguments, **how):
        raise CycloptsError(msg="It is too long.")

    monkeypatch.setattr(program, "app", SimpleNamespace(parse_args=refuse))
    assert sentence(run("check", "x.fold"), 2) == "miurafab: miurafab: It is too long."


@pytest.mark.parametrize(
    ("shell", "check"),
    [
        ("bash", ["bash", "-n"]),
        ("zsh", ["zsh", "-n"]),
        ("fish", ["fish", "--no-execute"]),
        ("powershell", None),
    ],
)
def test_completion_knows_commands_and_options(run, tmp_path, shell, check):
    script = run("completion", shell).stdout
    for word in (
        "miurafab",
        "tradeoff",
        "calibrate",
        "min-edge",
        "check-mode",
        "baud",
        "alternate",
    ):
        assert word in script
    assert json.loads(run("completion", shell, "--json").stdout)["script"] + "\n" == script
    if check is not None and shutil.which(check[0]):
        (tmp_path / "script").write_text(script)
        subprocess.run([*check, tmp_path / "script"], check=True)


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


@pytest.mark.anew
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
        (("check", "a.fold", "--rebuild"), "--rebuild is for a job directory; a.fold is a pattern"),
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
        "except SystemExit:\n"
        "    assert not {'numpy', 'scipy', 'trimesh', 'shapely'} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
    done = subprocess.run(
        [sys.executable, "-m", "miurafab", "check", "gone.fold"], capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "miurafab: gone.fold does not exist.\n"


def test_slow_libraries_are_loaded_when_they_are_needed():
    """Each takes a tenth of a second or more, and most commands need none of them."""
    code = (
        "import sys, miurafab as mf\n"
        "mf.fit, mf.check, mf.sheets, mf.preview, mf.cut, mf.fold, mf.convert\n"
        "slow = {'trimesh', 'ezdxf', 'scipy.interpolate', 'scipy.optimize', 'matplotlib'}\n"
        "print(slow & set(sys.modules))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("set()\n", "")


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
    own = {
        "layout.json",
        "manifest.json",
        "assembly.pdf",
        "assembly.html",
        "small.fold",
        "pattern.svg",
    }
    assert {path.name for path in job.iterdir()} == own | {f"sheet-01{end}" for end in sheet}
    assert "$INSUNITS" in (job / "sheet-01-r2010.dxf").read_text()
    # A job made anew in the same place leaves nothing of this one behind.
    assert run("sheets", fold, "-o", job, "--json").returncode == 0
    left = {"sheet-01.nc", "sheet-01.svg", *own} - {"pattern.svg"}
    assert {path.name for path in job.iterdir()} == left
    wrong = run("sheets", fold, "-o", job, "--format", "tiled-leter")
    assert wrong.returncode == 2
    assert "did you mean 'tiled-letter'?" in wrong.stderr
    helped = run("sheets", "--help").stdout
    told = ("dxf", "dxf-r2010", "pdf", "hpgl", "picture", "a0 to a6", "letter", "legal")
    assert all(name in helped for name in told)
