"""How a command in print is run. The rules by which a test departs from what is printed stand here
and nowhere else.
"""

import contextlib
import io
import os
import re
import runpy
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from unittest import mock

import pytest
from pages import ROOT

from miurafab.__main__ import main

PORT = re.compile(r"^(/dev/tty\w+|COM\d+|PORT|A|B)$")
"""Ports in print: the virtual machine stands in for each."""

SERVES = {"studio", "virtual"}
"""Commands that serve until Ctrl-C: started, and stopped when they have said where they serve."""

LONG = re.compile(r"^python (benchmarks/\w+\.py)( |$)")
"""Benchmarks take minutes: the test asks for their help, which shows that they start."""

TARGETS = re.compile(r"^make (\w[\w-]*)")
"""``make`` is run by ``.ci/run``: the test asks whether the Makefile has the target."""


def run_line(line, folder, expected=0):
    """Run one line of a ``sh`` block in ``folder``; what it printed, errors and progress first."""
    if long := LONG.match(line):
        return _help_of(ROOT / long[1])
    if target := TARGETS.match(line):
        return _process(["make", "--dry-run", "--directory", ROOT, target[1]], folder)
    words = shlex.split(line, comments=True)
    if words[0] != "miurafab":
        return _process(words, folder)
    arguments = ["virtual" if PORT.match(word) else word for word in words[1:]]
    if arguments[0] in SERVES:
        return _serve(arguments, folder)
    if "--resume" in arguments:
        interrupt(folder / arguments[1])
    return _command(arguments, folder, expected)


def interrupt(job):
    """Leave of the last run of each journal its first half, as a pulled cable would: the job can be
    resumed.
    """
    for journal in job.glob("*.journal"):
        lines = journal.read_text().splitlines(keepends=True)
        (*_, begun) = (at for at, line in enumerate(lines) if '"schema"' in line)
        journal.write_text("".join(lines[: (begun + len(lines)) // 2]))


def _command(arguments, folder, expected):
    """``miurafab`` within this process, where its libraries are loaded already."""
    shown, told = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stdout(shown),
        contextlib.redirect_stderr(told),
        mock.patch.object(sys, "argv", ["miurafab", *arguments]),
        mock.patch.dict(os.environ, XDG_CONFIG_HOME=str(folder / "configuration")),
        mock.patch.object(sys, "stdin", io.StringIO()),
    ):
        try:
            main()
        except SystemExit as exited:
            code = exited.code or 0
    assert code == expected, f"exit code {code}\n{shown.getvalue()}{told.getvalue()}"
    return told.getvalue() + shown.getvalue()


def _help_of(script):
    """What a benchmark says to ``--help``, within this process."""
    shown = io.StringIO()
    with (
        contextlib.redirect_stdout(shown),
        mock.patch.object(sys, "argv", [str(script), "--help"]),
        mock.patch.object(sys, "path", [str(script.parent), *sys.path]),
        pytest.raises(SystemExit) as exited,
    ):
        runpy.run_path(str(script), run_name="__main__")
    assert not exited.value.code
    assert shown.getvalue().startswith("usage: ")
    return shown.getvalue()


def _process(words, folder):
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, env=_environment())
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stderr + done.stdout


def _serve(arguments, folder):
    """Start a command that serves, read the line that says where, and stop it as Ctrl-C does."""
    if arguments[0] == "studio" and "--no-browser" not in arguments:
        arguments = [*arguments, "--no-browser"]
    words = [sys.executable, "-m", "miurafab", *arguments]
    with subprocess.Popen(
        words,
        cwd=folder,
        env=_environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as server:
        said = server.stdout.readline()
        server.send_signal(signal.SIGINT)
        rest, told = server.communicate(timeout=30)
    assert said.strip(), told
    assert "Traceback" not in told
    assert server.returncode in (0, 130), told
    return said + rest


def _environment():
    """The programs beside this Python come first, and the package under test is found."""
    here = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": here, "PYTHONPATH": str(ROOT)}
