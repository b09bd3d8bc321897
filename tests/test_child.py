"""Nothing from the working directory is run: not by the command, and not by a process it starts."""

import multiprocessing
import os
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest

from miurafab.child import safe_path
from miurafab.errors import PortError
from miurafab.gcode.job import Job
from miurafab.machine.job_process import stream_apart
from miurafab.machine.planning import SendOptions, plan_job
from miurafab.profiles import load_machine
from miurafab.studio.work import Order
from miurafab.studio.worker import Process

PLANTED = {
    *(name for name in sys.stdlib_module_names if name not in sys.builtin_module_names),
    *("miurafab", "numpy", "scipy", "shapely", "serial", "trimesh", "sitecustomize"),
}


@pytest.fixture
def trap(tmp_path, monkeypatch):
    """The working directory, with a module of every name, and the file in which they say so."""
    said = tmp_path / "said.txt"
    folder = tmp_path / "downloads"
    folder.mkdir()
    for name in PLANTED:
        code = f"open({str(said)!r}, 'a').write({name!r}); raise SystemExit('planted')"
        (folder / f"{name}.py").write_text(code)
    monkeypatch.chdir(folder)
    # what the process has when its working directory is searched, as in a notebook
    monkeypatch.setattr(sys, "path", ["", str(folder), *sys.path])
    return said


def test_the_trap_works(trap):
    subprocess.run([sys.executable, "-c", "import colorsys"], capture_output=True)
    assert trap.read_text() == "colorsys"


def test_the_worker_of_the_studio(trap, tmp_path):
    """Its file is missing, which it can only say when it has loaded everything."""
    worker = Process(Order("open", tmp_path, "gone", file=tmp_path / "gone.fold"))
    end = time.monotonic() + 120
    news = []
    while not any("error" in each for each in news) and time.monotonic() < end:
        news += worker.news()
        time.sleep(0.01)
    worker.stop()
    assert [each["error"] for each in news if "error" in each] == [
        f"{tmp_path / 'gone.fold'} does not exist."
    ]
    assert not trap.exists()


def test_the_process_that_sends_a_job(trap):
    machine = load_machine("grbl-laser-400")
    plan = plan_job(
        Job("short.nc", "M4 S0\nG1 X15 S500 F3000\nM5\n"),
        machine,
        SendOptions(force=frozenset({"beam"})),
    )
    with pytest.raises(PortError, match="/dev/gone does not exist"):
        stream_apart(plan, "/dev/gone")
    assert not trap.exists()


def test_the_processes_of_a_pool(trap):
    """As ``tradeoff`` starts them."""
    sys.path[:2] = []  # they are given the path of this process
    context = multiprocessing.get_context("spawn")
    with safe_path(), ProcessPoolExecutor(1, mp_context=context) as pool:
        running = pool.submit(abs, -2)
    assert running.result() == 2
    assert not trap.exists()


def test_what_the_environment_said_before_it_says_again(monkeypatch):
    for before in ("0", None):
        monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
        if before is not None:
            monkeypatch.setenv("PYTHONSAFEPATH", before)
        with pytest.raises(KeyError), safe_path():
            raise KeyError(os.environ["PYTHONSAFEPATH"])
        assert os.environ.get("PYTHONSAFEPATH") == before


def test_the_command_itself(trap):
    command = Path(sys.executable).with_name("miurafab")
    done = subprocess.run([command, "materials"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "card-250" in done.stdout
    assert not trap.exists()
