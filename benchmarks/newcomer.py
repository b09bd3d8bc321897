"""A newcomer's way: a new clone, `make demo`, then each command of README, tutorial and how-tos.

    python benchmarks/newcomer.py                  # all, some ten minutes: writes docs/newcomer.md
    python benchmarks/newcomer.py --only tutorial  # the commands of this page, printed
    python benchmarks/newcomer.py --log walk.txt   # and what the terminal showed

The last commit is cloned into a new folder, where README's own commands make the environment. Each
command then runs in a terminal of 100 columns, in that folder, one after the other, as printed. The
rules by which it departs from print are those of ``tests/examples/commands.py``: the virtual
machine stands in for each port, and a server is stopped when it has said where it serves. The
Python of a page is run as one program.

A row has the command, its seconds, those of the processor, the longest time in which the terminal
got no byte, and the files that it wrote. If a command ends with another code than the page
promises, or prints something else, that is told at the end, and nothing is written. Beside these
tables is one of what the new environment takes on the disk, library by library.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import select
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from page_tables import markdown, write_tables

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "examples"))

from commands import PORT, SERVES, interrupt  # noqa: E402
from pages import Block, blocks_of, matches  # noqa: E402
from table import machine  # noqa: E402

PAGE = ROOT / "docs" / "newcomer.md"
WALKED = {
    path.stem.lower(): path
    for path in (
        ROOT / "README.md",
        ROOT / "docs" / "tutorial.md",
        *sorted((ROOT / "docs" / "how-to").glob("*.md")),
    )
    if any(block.language in ("sh", "python") for block in blocks_of(path))
}
"""The pages, by the name of their table."""

LEFT_OUT = {"make test": "the tests, see `.ci/run`"}
"""Commands that are not walked, and why."""

SIZED = """
import importlib.metadata, json
print(json.dumps({
    each.name: sum(path.stat().st_size for path in map(each.locate_file, each.files or ())
                   if path.is_file())
    for each in importlib.metadata.distributions()
}))
"""
"""Prints the bytes of each library of the Python that runs it."""

NOT_THE_READERS = (".venv", ".git", "__pycache__")
"""Folders in which a reader looks for nothing."""

SMALL_MB = 1.0
"""Libraries below this are one row together."""

HEAD = ("command", "seconds", "processor", "silent", "wrote")
_ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


@dataclass(frozen=True)
class Step:
    """One ``command`` in print, or all Python of a page (``program``), and what is promised of it:
    the exit ``code`` and, if it is shown, the text.
    """

    command: str
    program: str | None = None
    code: int = 0
    shown: str | None = None
    why_not: str | None = None


@dataclass(frozen=True)
class Ran:
    """What a terminal told of one process."""

    code: int
    text: str
    seconds: float
    processor: float
    silent: float


def steps_of(page: Path) -> list[Step]:
    """What ``page`` tells a reader to run, in order."""
    found: list[Step] = []
    python: list[Block] = []
    for block in blocks_of(page):
        why_not = block.directives.get("not run")
        if block.language == "python":
            python.append(block)
        elif block.language == "sh":
            lines = block.text.replace("\\\n", " ").splitlines()
            commands = [plain for line in lines if (plain := _without_comment(line))]
            for command in commands:
                found.append(
                    Step(
                        command,
                        code=int(block.directives.get("exit", 0)),
                        shown=block.shown if command == commands[-1] else None,
                        why_not=why_not or LEFT_OUT.get(command),
                    )
                )
    if python:
        shown = "".join(block.shown or "" for block in python)
        program = "\n".join(block.text for block in python)
        found.append(Step("the Python of this page", program, shown=shown or None))
    return found


def _without_comment(line: str) -> str:
    return re.sub(r"\s+#.*$", "", line).strip()


def files_of(page: Path) -> Iterator[tuple[str, str]]:
    """The files that a reader of ``page`` writes by hand: name and text."""
    for block in blocks_of(page):
        if "file" in block.directives:
            yield block.directives["file"], block.text


def in_terminal(
    words: list[str], folder: Path, environment: dict[str, str], *, serves: bool
) -> Ran:
    """Run ``words`` in a terminal of 100 columns and read what it shows.

    A process that ``serves`` is interrupted, as by Ctrl-C, after its first line.
    """
    ours, theirs = os.openpty()
    size = {"COLUMNS": "100", "LINES": "40", "TERM": "xterm"}
    started = last = time.monotonic()
    child = subprocess.Popen(
        words,
        cwd=folder,
        env={**environment, **size},
        stdin=subprocess.DEVNULL,
        stdout=theirs,
        stderr=theirs,
        start_new_session=True,
    )
    os.close(theirs)
    text, silent = b"", 0.0
    while True:
        select.select([ours], [], [])
        try:
            more = os.read(ours, 1 << 16)
        except OSError:  # the other side is closed
            more = b""
        now = time.monotonic()
        silent, last = max(silent, now - last), now
        if not more:
            break
        text += more
        if serves and b"\n" in text:
            child.send_signal(signal.SIGINT)
            serves = False
    os.close(ours)
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return Ran(
        child.returncode,
        _ESCAPES.sub("", text.decode(errors="replace")).replace("\r\n", "\n"),
        time.monotonic() - started,
        used.ru_utime + used.ru_stime,
        silent,
    )


class Walk:
    """One clone, in which command after command is run; mutable: they leave files for the next."""

    def __init__(self, folder: Path, log: Path | None) -> None:
        self.folder = folder / "miurafab"
        self.home = folder / "configuration"
        self.log = log
        self.faults: list[str] = []
        own = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        beside = f"{self.folder / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}"
        self.environment = {**own, "PATH": beside, "XDG_CONFIG_HOME": str(self.home)}

    def clone(self) -> None:
        """Clone the last commit of this checkout."""
        words = ["git", "clone", "--quiet", str(ROOT), str(self.folder)]
        subprocess.run(words, check=True)

    def sizes(self) -> str:
        """A table of what the libraries of the new environment take."""
        words = [str(self.folder / ".venv" / "bin" / "python"), "-c", SIZED]
        told = subprocess.run(
            words, capture_output=True, text=True, check=True, env=self.environment
        )
        sizes = {name: size / 1e6 for name, size in json.loads(told.stdout).items()}
        large = sorted((size, name) for name, size in sizes.items() if size >= SMALL_MB)
        rows = [(f"`{name}`", f"{size:.0f}") for size, name in reversed(large)]
        rest = [size for size in sizes.values() if size < SMALL_MB]
        rows.append((f"{len(rest)} others", f"{sum(rest):.0f}"))
        rows.append(("all", f"{sum(sizes.values()):.0f}"))
        return markdown(("library", "MB"), rows)

    def page(self, page: Path) -> list[tuple[str, ...]]:
        """The rows of all that ``page`` tells a reader to run."""
        for name, text in files_of(page):
            (self.folder / name).write_text(text, encoding="utf-8")
        return [self.step(step) for step in steps_of(page)]

    def step(self, step: Step) -> tuple[str, ...]:
        """Run ``step`` and give its row; what is not as promised is one of the ``faults``."""
        name = f"`{step.command}`" if step.program is None else step.command
        if step.why_not:
            return name, "", "", "", f"not run: {step.why_not}"
        words, serves = self._words(step)
        before = self._files()
        ran = in_terminal(words, self.folder, self.environment, serves=serves)
        print(f"{ran.seconds:7.1f} s {step.command}", flush=True)
        if self.log:
            with self.log.open("a", encoding="utf-8") as kept:
                kept.write(f"$ {step.command}\n{ran.text}\n")
        promised = {0, 130} if serves else {step.code}
        if ran.code not in promised:
            self.faults.append(f"{step.command} ended with {ran.code}:\n{ran.text}")
        if step.shown is not None and not matches(f"...{step.shown}", ran.text):
            self.faults.append(f"{step.command} printed:\n{ran.text}\nand not:\n{step.shown}")
        figures = (f"{value:.1f}" for value in (ran.seconds, ran.processor, ran.silent))
        return name, *figures, self._wrote(before)

    def _words(self, step: Step) -> tuple[list[str], bool]:
        if step.program is not None:
            program = self.folder.parent / "program.py"
            program.write_text(step.program, encoding="utf-8")
            return ["python", str(program)], False
        words = ["virtual" if PORT.match(word) else word for word in shlex.split(step.command)]
        if "--resume" in words:
            interrupt(self.folder / words[words.index("cut") + 1])
        serves = words[0] == "miurafab" and words[1] in SERVES
        if words[:2] == ["miurafab", "studio"]:
            words.append("--no-browser")
        return words, serves

    def _files(self) -> dict[str, tuple[int, int]]:
        """Every file that a command may have written, by its name for the reader."""
        found = {}
        for root, title in ((self.folder, ""), (self.home, "configuration/")):
            for folder, folders, names in os.walk(root):
                folders[:] = [name for name in folders if name not in NOT_THE_READERS]
                for name in names:
                    path = Path(folder, name)
                    told = path.stat()
                    written = path.relative_to(root).as_posix()
                    found[title + written] = (told.st_mtime_ns, told.st_size)
        return found

    def _wrote(self, before: dict[str, tuple[int, int]]) -> str:
        """What is new or changed, a folder with the number of its files."""
        new = [name for name, told in self._files().items() if before.get(name) != told]
        folders: dict[str, list[str]] = {}
        for name in sorted(new):
            folders.setdefault(name.rpartition("/")[0], []).append(name)
        whole = folders.pop("", [])
        for folder, names in folders.items():
            whole.append(names[0] if len(names) == 1 else f"{folder}/")
        return ", ".join(
            f"`{name}`" + (f" ({len(folders[name[:-1]])} files)" if name.endswith("/") else "")
            for name in sorted(whole)
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=WALKED, help="this page, printed and not written")
    parser.add_argument("--log", type=Path, help="write what the terminal showed to this file")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        walk = Walk(Path(name), asked.log)
        walk.clone()
        if asked.only not in (None, "readme"):
            walk.step(Step("make demo"))
        tables = {"machine": f"{machine()}\n"}
        tables |= {
            title: markdown(HEAD, walk.page(page))
            for title, page in WALKED.items()
            if asked.only in (None, title)
        }
        tables["libraries"] = walk.sizes()
        if not walk.faults:
            write_tables(PAGE if asked.only is None else None, "newcomer", tables)
    if walk.faults:
        sys.exit("\n".join(walk.faults))


if __name__ == "__main__":
    main()
