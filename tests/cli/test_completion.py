"""What a shell makes of the script of ``miurafab completion``, with Tab pressed in a terminal."""

import contextlib
import os
import re
import select
import shutil
import subprocess
import time

import pytest

termios = pytest.importorskip("termios")  # a terminal of Unix

SHELLS = {
    "bash": (["bash", "--norc", "--noprofile"], "script", "source ./script"),
    "zsh": (
        ["zsh", "-f"],
        "_miurafab",
        "fpath=($PWD $fpath); autoload -U compinit; compinit -u -D",
    ),
    "fish": (["fish"], "fish/completions/miurafab.fish", ""),
}
"""How a shell starts, the file that the help names for the script, and what reads it."""

LONGEST_S = 60


class Terminal:
    """A shell in a terminal; mutable: it is typed into."""

    def __init__(self, words, folder):
        self.ours, theirs = os.openpty()
        termios.tcsetwinsize(theirs, (40, 200))
        paths = f"{folder}{os.pathsep}{os.environ['PATH']}"
        kept = {"PATH": paths, "TERM": "dumb", "LANG": "C.UTF-8"}
        homes = {"HOME": str(folder), "XDG_CONFIG_HOME": str(folder)}
        self.shell = subprocess.Popen(
            words,
            cwd=folder,
            env={**kept, **homes, "PS1": "$ "},
            preexec_fn=lambda: os.login_tty(theirs),  # fish wants a terminal that controls it
        )
        os.close(theirs)
        self.screen = ""

    def typed(self, text, wanted):
        """What is shown after ``text`` was typed, up to the ``wanted`` pattern."""
        self.screen = ""
        os.write(self.ours, text.encode())
        until = time.monotonic() + LONGEST_S
        while not re.search(wanted, self.screen):
            ready, _, _ = select.select([self.ours], [], [], max(0.0, until - time.monotonic()))
            assert ready, f"{wanted} is not in {self.screen!r}"
            self.screen += os.read(self.ours, 1 << 16).decode(errors="replace")
        return self.screen

    def close(self):
        with contextlib.suppress(OSError):
            os.close(self.ours)  # a shell whose terminal is gone ends
        self.shell.kill()
        self.shell.wait()


@pytest.fixture(params=SHELLS)
def terminal(request, run, tmp_path):
    """A shell that has read its script; ``echo`` in two parts tells that it is ready."""
    words, name, reads = SHELLS[request.param]
    if shutil.which(words[0]) is None:
        pytest.skip(f"{words[0]} is not installed")
    script = tmp_path / name
    script.parent.mkdir(parents=True, exist_ok=True)
    script.write_text(run("completion", request.param).stdout)
    (tmp_path / "miurafab").touch(0o755)  # fish completes only what is there
    (tmp_path / "hypar.fold").touch()
    opened = Terminal(words, tmp_path)
    try:
        opened.typed(f"{reads}\necho rea'dy'\n", "ready")
        yield opened
    finally:
        opened.close()


def test_tab_completes_commands_actions_options_choices_and_files(terminal):
    for begun, whole in (
        ("miurafab trade", "off "),
        ("miurafab machine unl", "ock "),
        ("miurafab fit --fac", "ets "),
        ("miurafab completion z", "sh "),
        ("miurafab check hyp", r"ar\.fold"),
        ("miurafab fit hyp", r"ar\.fold"),
        ("miurafab cut hyp", r"ar\.fold"),
    ):
        terminal.typed(f"{begun}\t", f"{begun}(\x1b\\S*)*{whole}")
        terminal.typed("\x15", "")  # Ctrl-U empties the line
