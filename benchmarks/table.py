"""All benchmarks, one after the other, and one page of what they print: docs/benchmarks.md.

    python benchmarks/table.py                # runs all, under 20 minutes, and writes the page
    python benchmarks/table.py fit rivals     # these, printed; nothing is written

Each is run as its own command says, at a size that takes a minute or two. Those that write pages of
their own (gallery, energy_study, notebooks, pictures) have commands of their own. The page has the
machine, the versions, and for each benchmark its command, its exit code and processor time, and the
whole output, rivals beside us where there are any. A benchmark whose program is not installed
(Chromium, IPOPT) is listed as not run, with the reason.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from shutil import which

from miurafab.files import write_text

FOLDER = Path(__file__).parent
PAGE = FOLDER.parent / "docs" / "benchmarks.md"
LIBRARIES = ("miurafab", "numpy", "scipy", "shapely", "trimesh", "casadi", "cyipopt-wheels")
LONGEST_S = 600


@dataclass(frozen=True)
class Entry:
    """A benchmark: its program, the ``words`` after it, what it ``shows``, and what it ``needs``: a
    program or a module that not every machine has.
    """

    program: str
    words: str
    shows: str
    needs: str = ""

    @property
    def command(self) -> str:
        """As one types it."""
        return f"python benchmarks/{self.program}.py {self.words}".strip()


ENTRIES = (
    Entry("surfaces", "", "the named surfaces: closeness, folds, residuals"),
    Entry("fit", "--largest 10000 --fair 2500", "growth of the fit's time with the facets"),
    Entry(
        "rivals",
        "--facets 400,900,1600 --timeout 300",
        "exact sheets: here, IPOPT, SciPy",
        "casadi",
    ),
    Entry("fair_rival", "--facets 100,400,900", "the fair objective: here and IPOPT", "cyipopt"),
    Entry("flat_foldable", "--facets 400 hypar sphere", "exact flat-foldability and its motion"),
    Entry("meshes", "face hood lampshade", "meshes as makers bring them"),
    Entry("bodies", "pin head", "closed bodies in gores"),
    Entry("from_flat", "", "patterns of others, folded from flat"),
    Entry(
        "layer_orders", "--most 2 hypar:6 saddle:6 sphere:6", "the layer rule and a search", "pysat"
    ),
    Entry("energy", "10 20 30", "the energy path"),
    Entry("force_table", "", "forces in newtons, and on what they depend"),
    Entry("thick_plates", "--cells 4", "plates on shifted hinges"),
    Entry("planning", "band strip hypar", "sheets and glue, before and after the plan"),
    Entry("nesting", "", "how well sheets are filled"),
    Entry("layout", "dashes", "the order of strokes"),
    Entry("needles", "--designs 20", "tabs of random designs"),
    Entry("slots", "--designs 10", "tabs in slots of random designs"),
    Entry("times", "", "times of laser, knife and pen"),
    Entry("closed_loop", "", "shells recovered from the log of the beam"),
    Entry("corruptions", "40", "damaged patterns that are found"),
    Entry("fuzz", "--count 100", "damaged files of every format"),
    Entry("session_hour", "--commands 300", "random actions in one session"),
    Entry("stream", "--seconds 4 --lines 50000", "the wire, beside other senders"),
    Entry("start", "--runs 1", "how soon commands begin their work"),
    Entry("live", "", "the studio's coarse answers"),
    Entry("first_picture", "", "the studio's first picture of a target", "chromium"),
    Entry("abort", "--runs 50", "from a click on Abort to the wire", "chromium"),
    Entry("fold_page", "60x60 30", "the slider of the page of a motion", "chromium"),
)


@dataclass(frozen=True)
class Run:
    """What came of an entry; ``code`` is None where it was not run, and ``text`` says why."""

    entry: Entry
    code: int | None
    seconds: float
    text: str


def run(entry: Entry) -> Run:
    """Run one benchmark in a process of its own."""
    if entry.needs and not (which(entry.needs) or find_spec(entry.needs)):
        return Run(entry, None, 0.0, f"{entry.needs} is not installed")
    before = _processor_seconds()
    words = [sys.executable, str(FOLDER / f"{entry.program}.py"), *entry.words.split()]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            words,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=environment,
            timeout=LONGEST_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Run(entry, None, _processor_seconds() - before, f"no end after {LONGEST_S} s")
    return Run(entry, done.returncode, _processor_seconds() - before, done.stdout)


def _processor_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def page(runs: list[Run]) -> str:
    """The page of the docs."""
    rows = [
        f"| [{made.entry.program}](#{made.entry.program}) | {made.entry.shows} "
        f"| {made.text if made.code is None else made.code} | {made.seconds:.0f} |"
        for made in runs
    ]
    parts = [
        "# Benchmarks\n",
        "Made by `make benchmark` in one run. Times are processor times, unless a line says "
        "otherwise; compare them only with each other. An exit code of 1 says that a benchmark "
        "misses its own limit.\n",
        f"{machine()}\n",
        "\n".join(
            ["| benchmark | shows | exit code | seconds |", "| --- | --- | --- | ---: |", *rows]
        )
        + "\n",
    ]
    for made in runs:
        if made.code is not None:
            text = "\n".join(line.rstrip() for line in made.text.strip("\n").splitlines())
            parts.append(
                f"## {made.entry.program}\n\n`{made.entry.command}`\n\n```console\n{text}\n```\n"
            )
    return "\n".join(parts)


def machine() -> str:
    """The processor, the system and the versions of what is measured."""
    model = platform.processor() or platform.machine()
    cpus = Path("/proc/cpuinfo")
    if cpus.exists():
        names = [line.split(": ")[1] for line in cpus.read_text().splitlines() if ": " in line
                 and line.startswith("model name")]  # fmt: skip
        model = names[0] if names else model
    return (
        f"{model}, {os.cpu_count()} processors, {platform.system()} {platform.release()}, Python "
        f"{platform.python_version()}, {', '.join(filter(None, map(_version, LIBRARIES)))}."
    )


def _version(library: str) -> str:
    try:
        return f"{library} {version(library)}"
    except PackageNotFoundError:
        return ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    asked = parser.parse_args().names
    runs = []
    for entry in ENTRIES:
        if not asked or entry.program in asked:
            made = run(entry)
            runs.append(made)
            print(f"{entry.command}: {made.code} after {made.seconds:.0f} s", flush=True)
            if asked:
                print(made.text)
    if not asked:
        write_text(PAGE, page(runs))


if __name__ == "__main__":
    main()
