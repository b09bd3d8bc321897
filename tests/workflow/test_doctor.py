"""``doctor`` tries what a job needs, and each problem names the command that mends it."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import tomllib
import webbrowser
from pathlib import Path
from types import SimpleNamespace

import pytest
from packaging.requirements import Requirement

import miurafab as mf
from miurafab.workflow import doctor as doctor_module
from miurafab.workflow import ports as ports_module
from miurafab.workflow.libraries import library_problems

PIP = f"{shlex.quote(sys.executable)} -m pip install"
REQUIRED = ["numpy>=2.1", "resvg_py>=0.4", "casadi>=3.6; extra == 'bench'"]
VERSIONS = {"numpy": "2.4.6", "resvg_py": "0.4"}


@pytest.fixture
def installed(monkeypatch):
    def version(name):
        if name not in VERSIONS:
            raise importlib.metadata.PackageNotFoundError(name)
        return VERSIONS[name]

    def requires(name):
        if name != "miurafab":
            version(name)
        return [*REQUIRED]

    monkeypatch.setattr(importlib.metadata, "requires", requires)
    monkeypatch.setattr(importlib.metadata, "version", version)
    return monkeypatch


def test_every_needed_package_has_its_version(installed):
    found = mf.doctor()
    packages = {key: found.versions[key] for key in list(found.versions)[2:]}
    assert packages == VERSIONS
    assert not any("installed" in problem for problem in found.problems)


def test_a_missing_package_stops_a_job(installed, run):
    installed.delitem(VERSIONS, "resvg_py")
    found = mf.doctor()
    assert found.versions["resvg_py"] == "missing"
    assert f"resvg_py is not installed; run {PIP} resvg_py." in found.problems
    done = run("doctor")
    assert done.returncode == 1
    assert "Would stop a job: resvg_py is not installed" in done.stdout


def test_a_source_tree_is_named_as_one(monkeypatch):
    def absent(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "requires", absent)
    checkout = Path(mf.__file__).parents[1]
    told = f"miurafab runs from its source and is not installed; run {PIP} {checkout}."
    assert told in mf.doctor().problems
    assert library_problems(ImportError("No module named 'numpy'")) == (told,)
    assert library_problems(ValueError("ours")) == ()


def test_a_library_that_is_too_old_or_does_not_load_stops_a_job(installed):
    installed.setitem(VERSIONS, "numpy", "2.0.9")
    assert f"numpy is 2.0.9; run {PIP} --upgrade 'numpy>=2.1'." in mf.doctor().problems
    installed.setitem(VERSIONS, "numpy", "2.4.6")
    load = importlib.import_module

    def broken(name):
        if name == "resvg_py":
            raise ImportError("libc.so.7:\n cannot open shared object file")
        return load(name)

    installed.setattr(importlib, "import_module", broken)
    assert mf.doctor().problems == (
        "resvg_py does not load (libc.so.7: cannot open shared object file); run "
        f"{PIP} --force-reinstall resvg_py.",
    )
    installed.setattr(importlib.util, "find_spec", lambda name: None)
    (problem,) = mf.doctor().problems
    assert f"run uv pip install --python {sys.executable} --force-reinstall resvg_py" in problem


def test_each_extra_is_told_with_its_command(installed):
    notes = mf.doctor().notes
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    assert doctor_module.EXTRAS.keys() == extras.keys() - {"bench", "dev"}
    for extra, (name, purpose) in doctor_module.EXTRAS.items():
        assert name in [Requirement(line).name for line in extras[extra]]
        command = f"{PIP} 'miurafab[{extra}]'"
        assert f"{name}, for {purpose}, is not installed: {command}" in notes


def test_a_plot_that_cannot_be_drawn_is_a_problem(installed):
    def fails(*args, **kwargs):
        raise OSError("no fonts")

    installed.setattr("matplotlib.figure.Figure.savefig", fails)
    assert any("No plot is drawn (no fonts); run" in each for each in mf.doctor().problems)


def test_a_computer_without_a_browser_is_told_what_to_do(installed):
    def none():
        raise webbrowser.Error("could not locate runnable browser")

    installed.setattr(webbrowser, "get", none)
    assert any("the variable BROWSER" in note for note in mf.doctor().notes)
    installed.setattr(webbrowser, "get", lambda: None)
    assert not any("browser" in note for note in mf.doctor().notes)


@pytest.mark.parametrize("listed", [True, False])
def test_a_port_that_may_not_be_opened_names_its_group(installed, tmp_path, listed):
    device = tmp_path / "ttyUSB0"
    device.touch()
    installed.setattr(ports_module, "list_ports", lambda: [(str(device), "CH340")])
    installed.setattr(os, "access", lambda path, mode: path != device)
    installed.setattr(Path, "group", lambda self: "uucp")
    installed.setattr(ports_module.getpass, "getuser", lambda: "ada")
    installed.setattr(ports_module, "_members", lambda group: ["ada"] if listed else ["bob"])
    (port,) = mf.doctor().ports
    way = (
        "you are in its group uucp from your next login on: log out and in again"
        if listed
        else "join its group: sudo usermod -aG uucp ada, then log in again"
    )
    assert port.trouble == f"you may not open it; {way}"
    assert f"{device}: you may not open it; {way}." in mf.doctor().problems


@pytest.mark.parametrize("fault", [KeyError("uid not found"), OSError("No username set")])
def test_a_user_or_a_group_without_a_name_is_one_of_a_container(installed, tmp_path, fault):
    device = tmp_path / "ttyUSB0"
    device.touch()

    def nameless(*_):
        raise fault

    installed.setattr(ports_module, "list_ports", lambda: [(str(device), "CH340")])
    installed.setattr(os, "access", lambda path, mode: path != device)
    installed.setattr(ports_module.getpass, "getuser", nameless)
    installed.setattr(Path, "group", lambda self: "dialout")
    way = "you may not open it; it needs its group: run the container with --group-add"
    assert [port.trouble for port in mf.doctor().ports] == [f"{way} dialout"]
    installed.setattr(Path, "group", lambda self: {}[self])
    assert [port.trouble for port in mf.doctor().ports] == [f"{way} {device.stat().st_gid}"]
    installed.setattr(os, "access", lambda path, mode: False)
    assert any("sudo chown -R $(id -u) " in problem for problem in mf.doctor().problems)


@pytest.mark.skipif(os.name != "posix", reason="groups of POSIX")
def test_before_a_port_is_plugged_in_its_group_is_told(installed, run):
    import grp

    groups = {"dialout": SimpleNamespace(gr_mem=[], gr_gid=-7)}
    installed.setattr(ports_module, "list_ports", list)
    installed.setattr(ports_module.sys, "platform", "linux")
    installed.setattr(ports_module.getpass, "getuser", lambda: "ada")
    installed.setattr(ports_module.os, "geteuid", lambda: 1000, raising=False)
    installed.setattr(grp, "getgrnam", lambda name: groups[name])
    wanted = "to open it, join its group: sudo usermod -aG dialout ada, then log in again."
    assert any(note.endswith(wanted) for note in mf.doctor().notes)
    groups["dialout"].gr_gid = os.getegid()
    assert any(note.endswith("a cable that carries data.") for note in mf.doctor().notes)
    groups.clear()
    shown = run("doctor").stdout
    assert "Ports" not in shown
    assert "with a cable that carries data." in " ".join(shown.split())
    installed.setattr(ports_module.sys, "platform", "darwin")
    assert any(note.endswith("the driver of its maker.") for note in mf.doctor().notes)


def test_a_full_disk_and_profiles_that_do_not_load_are_problems(installed, tmp_path):
    for kind, name in (("machines", "mine"), ("materials", "own")):
        folder = tmp_path / "miurafab" / kind
        folder.mkdir(parents=True)
        (folder / f"{name}.toml").write_text("title = 3\n")
    installed.setenv("XDG_CONFIG_HOME", str(tmp_path))
    installed.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=3_999_999))
    machine, material, disk = mf.doctor().problems
    assert machine.startswith("mine.toml")
    assert material.startswith("own.toml")
    assert disk.startswith("Only 3 MB are free on this disk; a job needs ")


def test_profiles_that_cannot_be_written_are_a_problem(installed, tmp_path):
    installed.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    assert mf.doctor().problems == ()
    installed.setattr(os, "access", lambda path, mode: path != tmp_path)
    (problem,) = mf.doctor().problems
    assert "run sudo chown -R " in problem
    assert f" {tmp_path}, or name another folder in XDG_CONFIG_HOME." in problem
    (tmp_path / "config").write_text("")
    (problem,) = mf.doctor().problems
    assert f"run mv {tmp_path / 'config'} {tmp_path / 'config'}.old." in problem


@pytest.mark.parametrize("name", ["cyclopts", "numpy"])
def test_a_library_without_which_the_program_does_not_start_is_named(tmp_path, name):
    """By ``doctor`` as by any command, with no word of a defect."""
    (tmp_path / f"{name}.py").write_text("raise ImportError('broken')")
    paths = os.pathsep.join([str(tmp_path), str(Path(mf.__file__).parents[1])])
    done = subprocess.run(
        [sys.executable, "-m", "miurafab", "doctor"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": paths, "XDG_STATE_HOME": str(tmp_path / "state")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    told = f"{name} does not load (broken); run {PIP} --force-reinstall {name}."
    assert done.stderr == f"miurafab: {told}\n"
    assert not (tmp_path / "state").exists()
