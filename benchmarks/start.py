"""The processor time in which each command starts.

    python benchmarks/start.py [--runs 5] [COMMAND ...]

Each row is the median processor time (user and system) of so many processes, in seconds. "help" is
its page of help; "start" ends with the first thing that it cannot find, when all is loaded that its
work begins with; "smallest" is a small job from beginning to end.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

START = {
    "fit": "fit gone.toml -o x.fold",
    "check": "check gone.fold",
    "fold": "fold gone.fold",
    "layers": "layers gone.fold",
    "energy": "energy gone.fold",
    "tradeoff": "tradeoff gone.toml",
    "convert": "convert gone.fold x.svg",
    "sheets": "sheets gone.fold -o x",
    "preview": "preview gone",
    "cut": "cut gone --port virtual",
    "surfaces": "surfaces gone",
    "machine status": "machine status --port gone",
    "profiles": "profiles show gone",
    "materials": "materials gone",
    "use": "use --machine gone",
}
SMALLEST = {
    "fit": "fit hypar --facets 4x4 -o small.fold",
    "check": "check h.fold",
    "fold": "fold h.fold --steps 2",
    "layers": "layers h.fold",
    "energy": "energy h.fold --steps 2",
    "convert": "convert h.fold x.svg",
    "sheets": "sheets h.fold -o y",
    "preview": "preview job",
    "doctor": "doctor",
    "surfaces": "surfaces",
    "profiles": "profiles",
}
MADE = ("fit plane --facets 4x4 --size 60mm -o h.fold", "sheets h.fold -o job")
COMMANDS = (*START, "calibrate", "studio", "virtual", "completion", "doctor")


def processor_time(words: str, folder: Path) -> float:
    """The processor time, seconds, of ``miurafab`` with these ``words`` in ``folder``."""
    before = os.times()
    subprocess.run(
        [sys.executable, "-P", "-m", "miurafab", *words.split()], cwd=folder, capture_output=True
    )
    after = os.times()
    return (
        after.children_user - before.children_user + after.children_system - before.children_system
    )


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("commands", nargs="*", default=COMMANDS)
    parser.add_argument("--runs", type=int, default=5)
    given = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        for words in MADE:
            processor_time(words, folder)

        def median(words: str | None) -> str:
            if words is None:
                return "-"
            times = [processor_time(words, folder) for _ in range(given.runs)]
            return f"{statistics.median(times):.2f}"

        print("| command | help | start | smallest |\n| --- | --- | --- | --- |")
        for name in given.commands:
            cells = (median(f"{name} --help"), median(START.get(name)), median(SMALLEST.get(name)))
            print(f"| {name} | {' | '.join(cells)} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
