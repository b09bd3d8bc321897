"""The command line as the tests of every command use it."""

import sys

import pytest
from command_line import Done

from miurafab.__main__ import main


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
