"""Tests are the same every time: Hypothesis draws the same examples, and Ctrl-C or the closing of a
terminal ends programs even where the tests were started to outlive theirs, or in the background.

The program is imported before numpy, so that the tests have one thread of OpenBLAS, as it has.
"""

import gc
import signal
import sys

import pytest
from command_line import Done
from hypothesis import HealthCheck, settings
from kept import KeptFits, KeptTimes
from running_order import place

from miurafab.__main__ import main

gc.disable()  # until all tests are collected: there is little garbage among them

settings.register_profile(
    "same-every-time",
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("same-every-time")

if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


RUNNING = pytest.StashKey()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item):
    item.config.stash[RUNNING] = item


@pytest.fixture(autouse=True, scope="session")
def kept(request, tmp_path_factory):
    """Several workers keep fits and estimates for each other; a process alone makes all anew."""
    if hasattr(request.config, "workerinput"):
        from miurafab.origami.fitting import fit  # only here: these load much
        from miurafab.posting import make_job
        from miurafab.workflow import dry_run, quicker

        folder = tmp_path_factory.getbasetemp().parent / "kept"
        folder.mkdir(exist_ok=True)
        stash = request.config.stash
        fit._fitted = KeptFits(folder, lambda: stash[RUNNING], fit._fitted)
        for module in (make_job, dry_run, quicker):
            module.estimate = KeptTimes(folder, lambda: stash[RUNNING], module.estimate)


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: place(item.path))


def pytest_collection_finish():
    """Modules and tests live to the end: to look at them at each collection of garbage took a
    twelfth of the processor time. A fortieth still went into collections; there are fewer now.
    """
    gc.freeze()
    gc.set_threshold(10_000)
    gc.enable()


@pytest.fixture(autouse=True, scope="session")
def no_own_defaults(tmp_path_factory):
    """No configuration of the person who runs the tests."""
    folder = tmp_path_factory.mktemp("configuration")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CONFIG_HOME", str(folder))
        yield


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    """The command line within this process, in an empty folder."""

    def call(*arguments):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["miurafab", *map(str, arguments)])
        with pytest.raises(SystemExit) as exited:
            main()
        return Done(exited.value.code or 0, *capsys.readouterr())

    return call
