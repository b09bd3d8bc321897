"""How commands end: defects, Ctrl-C and readers that go away, each in one line and an exit code."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import sentence

import miurafab
from miurafab.cli.ctrl_c import CtrlC
from miurafab.errors import EXIT_CODES, InputError, MiurafabError
from miurafab.version import __version__

COMMANDS = {
    "check": ("miurafab.check", ("check", "x.fold")),
    "fit": ("miurafab.design", ("fit", "hypar", "-o", "x.fold")),
    "fold": ("miurafab.fold", ("fold", "x.fold")),
    "energy": ("miurafab.energy", ("energy", "x.fold")),
    "tradeoff": ("miurafab.tradeoff", ("tradeoff", "hypar")),
    "convert": ("miurafab.convert", ("convert", "x.fold", "x.svg")),
    "sheets": ("miurafab.sheets", ("sheets", "x.fold", "-o", "job")),
    "preview": ("miurafab.preview", ("preview", "job")),
    "cut": ("miurafab.workflow.cut.prepare", ("cut", "job", "--port", "virtual")),
    "calibrate": ("miurafab.calibrate", ("calibrate", "-o", "job")),
    "doctor": ("miurafab.doctor", ("doctor",)),
}
"""The library function of a command, and a call of the command."""


@pytest.fixture(autouse=True)
def state(monkeypatch, tmp_path):
    """Logs go to a folder of the test."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "miurafab"


def failing(error):
    def fail(*arguments, **options):
        raise error

    return fail


@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_defect_is_one_sentence_with_a_log(run, monkeypatch, state, command, as_json):
    name, call = COMMANDS[command]
    monkeypatch.setattr(name, failing(RuntimeError("a\nb")), raising=False)
    done = run(*call, *["--json"] * as_json)
    text = sentence(done, 4)
    (log,) = state.iterdir()
    assert text == (
        "miurafab: This is a defect of miurafab (RuntimeError: a b); please report it with the log "
        f"{log}."
    )
    held = log.read_text()
    assert "Traceback" in held
    assert "in fail" in held
    assert __version__ in held
    assert repr(list(call))[1:-1] in held
    if as_json:
        answer = json.loads(done.stdout)
        assert answer == {
            "error": text.removeprefix("miurafab: "), "kind": "RuntimeError", "log": str(log)
        }  # fmt: skip
    else:
        assert done.stdout == ""


@pytest.mark.parametrize(
    "error", [MemoryError(), RecursionError("deep"), KeyError("x"), AssertionError(), ValueError()]
)
def test_no_exception_of_python_gets_through(run, monkeypatch, state, error):
    monkeypatch.setattr(miurafab, "convert", failing(error), raising=False)
    text = sentence(run("convert", "x.fold", "x.svg"), 4)
    assert type(error).__name__ in text or "not enough memory" in text


def test_a_log_that_cannot_be_written_is_no_second_failure(run, monkeypatch, tmp_path):
    (tmp_path / "state").write_text("in the way of the folder")
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path / "state"))
    monkeypatch.setattr(miurafab, "convert", failing(RuntimeError("x")), raising=False)
    done = run("convert", "x.fold", "x.svg", "--json")
    assert "no log could be written" in sentence(done, 4)
    assert json.loads(done.stdout)["log"] is None


def test_a_defect_of_a_process_is_no_traceback(tmp_path):
    """As a user meets it: with the interpreter's own hooks, at the end of a process."""
    (tmp_path / "sitecustomize.py").write_text(
        "import miurafab\ndef convert(*a, **k): raise RuntimeError('injected')\n"
        "miurafab.convert = convert\n"
    )
    root = Path(miurafab.__file__).parent.parent
    paths = os.pathsep.join((str(tmp_path), str(root)))
    done = subprocess.run(
        [sys.executable, "-m", "miurafab", "convert", "a.fold", "b.svg"],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
    )
    assert "RuntimeError: injected" in sentence(done, 4)


def test_ctrl_c_is_one_line(run, monkeypatch):
    for command in COMMANDS:
        name, call = COMMANDS[command]
        monkeypatch.setattr(name, failing(KeyboardInterrupt()), raising=False)
        assert sentence(run(*call), 130) == "miurafab: Interrupted."
    answer = json.loads(run(*call, "--json").stdout)
    assert answer == {"error": "Interrupted.", "kind": "Interrupted"}


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (PermissionError(13, "Permission denied", "a.svg"), "a.svg: Permission denied."),
        (OSError(28, "No space left on device"), "No space left on device."),
        (OSError("It is gone"), "It is gone."),
        (BrokenPipeError(32, "Broken pipe"), "Broken pipe."),
    ],
)
def test_what_the_system_refuses_is_told_in_its_words(run, monkeypatch, state, error, told):
    monkeypatch.setattr(miurafab, "convert", failing(error), raising=False)
    assert sentence(run("convert", "x.fold", "x.svg"), 2) == f"miurafab: {told}"
    assert not state.exists()


def test_a_terminal_that_goes_away_as_a_failure_is_shown_does_not_hide_it(run, monkeypatch):
    def convert(*arguments, **options):
        try:
            raise InputError("x.fold does not exist.")
        except InputError:
            try:
                raise ValueError
            except ValueError:
                raise OSError(5, "Input/output error") from None

    monkeypatch.setattr(miurafab, "convert", convert, raising=False)
    assert sentence(run("convert", "x.fold", "x.svg"), 2) == "miurafab: x.fold does not exist."


def test_ctrl_c_stays_ignored_where_it_is():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with CtrlC() as ctrl_c:
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
            signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        assert not ctrl_c.came
    finally:
        signal.signal(signal.SIGINT, before)


def test_what_else_python_drops_is_reported_as_ever(monkeypatch):
    class Thing:
        def __del__(self):
            raise ValueError("dropped")

    reported = []
    monkeypatch.setattr(sys, "unraisablehook", reported.append)
    with CtrlC() as ctrl_c:
        Thing()
    assert [str(each.exc_value) for each in reported] == ["dropped"]
    assert sys.unraisablehook == reported.append
    assert not ctrl_c.came


@pytest.mark.anew
def test_an_interrupted_fit_writes_its_best_sheet(run, monkeypatch, tmp_path):
    """Ctrl-C comes after the first sheet, which is too far from the target."""
    asked = miurafab.fit
    begun = []

    def fit(target, *, on_progress, **others):
        def interrupt(fraction, note):
            if "step" not in note:
                begun.append(note)
            if len(begun) == 2:
                raise KeyboardInterrupt

        return asked(target, on_progress=interrupt, **others)

    monkeypatch.setattr(miurafab, "fit", fit, raising=False)
    limits = ("--facets", "6x6", "--max-deviation", "0.001", "--report", "r.json")
    done = run("fit", "hypar", *limits, "-o", "x.fold", "--json")
    assert done.returncode == 130
    answer = json.loads(done.stdout)
    assert answer["status"] == "interrupted"
    assert answer == json.loads((tmp_path / "r.json").read_text())
    assert json.loads(run("check", "x.fold", "--json").stdout)["facets"] == 36


@pytest.mark.parametrize(
    "command", [("tradeoff", "hypar", "--workers", "1"), ("cut", "hypar", "--port", "virtual")]
)
def test_ctrl_c_in_a_fit_on_the_way_ends_the_command(run, monkeypatch, tmp_path, command):
    """Although the fit has a sheet by then."""
    from miurafab.origami.fitting import fit as solved
    from miurafab.workflow import fit

    asked = solved.fit

    def interrupted(request, on_progress=None):
        return replace(asked(replace(request, facets=(4, 4))), status="interrupted")

    monkeypatch.setattr(solved, "fit", interrupted)
    monkeypatch.setattr(fit, "fit_request", interrupted)
    assert sentence(run(*command), 130) == "miurafab: Interrupted."
    assert not (tmp_path / "jobs").exists()


LOST = {
    "a module that catches everything as it loads": """
import os, signal
try:
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1000):
        pass
except BaseException:
    pass
""",
    "a finaliser": """
import os, signal
class Thing:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):
            pass
Thing()
""",
}


@pytest.mark.skipif(os.name != "posix", reason="signals as a terminal sends them on POSIX")
@pytest.mark.parametrize("where", LOST)
@pytest.mark.parametrize("goes_on", [True, False])
def test_ctrl_c_that_python_or_a_library_drops_ends_the_command(tmp_path, where, goes_on):
    """Although the command goes on, or is about to end with success."""
    (tmp_path / "lost.py").write_text(LOST[where])
    (tmp_path / "sitecustomize.py").write_text(
        "import time, miurafab\n"
        "def doctor(*a, **k):\n"
        "    import lost\n"
        f"    end = time.monotonic() + {30 if goes_on else 0}\n"
        "    while time.monotonic() < end: time.sleep(0.01)\n"
        "import miurafab.cli.program as program\n"
        "program.run = lambda *a: doctor() or 0\n"
    )
    root = Path(miurafab.__file__).parent.parent
    started = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "miurafab", "doctor"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join((str(tmp_path), str(root)))},
        capture_output=True,
        text=True,
    )
    assert time.monotonic() - started < 20
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "miurafab: Interrupted.\n")


@pytest.mark.skipif(os.name != "posix", reason="signals as a terminal sends them on POSIX")
@pytest.mark.parametrize(
    "seconds", [0.3, 3.0, *(pytest.param(s, marks=pytest.mark.large) for s in (1.5, 4.0, 6.0))]
)
def test_ctrl_c_reaches_a_pool_of_processes_and_none_prints(tmp_path, seconds):
    """While modules load, and while the workers fit."""
    with subprocess.Popen(
        [
            sys.executable,
            "-m",
            "miurafab",
            "tradeoff",
            "hypar",
            "--sides",
            "4,6,160",
            "--polish",
            "off",
            "--workers",
            "2",
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        start_new_session=True,
    ) as process:
        time.sleep(seconds)
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert (out, err) == ("", "miurafab: Interrupted.\n")


@pytest.mark.skipif(os.name != "posix", reason="pipes as on POSIX")
@pytest.mark.parametrize("arguments", [("surfaces", "--json"), ("surfaces",), ("fit", "--help")])
def test_a_reader_that_goes_away_is_no_failure(arguments):
    command = [sys.executable, "-m", "miurafab", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_every_exit_code_of_an_error_has_a_meaning():
    def kinds(of):
        return {of}.union(*map(kinds, of.__subclasses__()))

    assert {kind.exit_code for kind in kinds(MiurafabError)} <= set(EXIT_CODES) - {0, 1, 4}


@pytest.mark.parametrize("name", ["two.obj", "tri.obj"])
def test_a_mesh_of_one_or_two_facets_is_no_defect(run, tmp_path, name):
    faces = "f 1 2 3\nf 1 3 4\n" if name == "two.obj" else "f 1 2 3\n"
    (tmp_path / name).write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n" + faces)
    done = run("fit", name, "--facets", "4x4", "-o", "x.fold")
    assert done.returncode in (0, 1, 2)
    assert "Traceback" not in done.stderr
