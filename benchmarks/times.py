"""How long a hypar takes on a laser, a knife and a pen, and what would be quicker.

    python benchmarks/times.py [--facets 12x12] [--size 200mm] [--json FILE]

The table of docs/layout.md, in card. The last row has the dashes of the card in place of the lines
that a pen draws where the material says nothing of a crease. Lifts are the moves to another place
with the beam off or the tool up.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import miurafab as mf
from miurafab.profiles.shipped import shipped_directory
from miurafab.workflow.dry_run import clock_text

MACHINES = ("grbl-laser-400", "grbl-knife-a3", "grbl-pen-a4")
CARD = (shipped_directory("materials") / "card-250.toml").read_text(encoding="utf-8")
DASHED = "".join(
    f'[creases.{kind}]\nmin_end = "0.501mm"\n' for kind in ("mountain", "valley", "tab")
)
"""What the card says already, but for 1 um: a material that says the same says nothing."""


@dataclass(frozen=True)
class Timed:
    """The times of one job in seconds, by ``ways`` too, and how often the tool is lifted."""

    machine: str
    creases: str
    seconds: float
    perforating: float
    lifts: int
    ways: dict[str, float]


def timed(pattern: mf.CreasePattern, machine: str, material: Path | str, creases: str) -> Timed:
    """The times of ``pattern`` on ``machine``."""
    job = mf.sheets(pattern, machine=machine, material=material)
    return Timed(
        machine,
        creases,
        job.seconds,
        job.operation_seconds.get("perforate", 0.0),
        sum(line.startswith("G0 X") for each in job.jobs for line in each.text.splitlines()),
        {way.change: way.seconds for way in job.quicker()},
    )


def rows(facets: str, size: str) -> list[Timed]:
    """The rows of the table."""
    columns, lines = map(int, facets.split("x"))
    pattern = mf.fit("hypar", facets=(columns, lines), size=size).pattern
    made = [timed(pattern, machine, "card-250", "as usual") for machine in MACHINES]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "dashed-card.toml")
        file.write_text(CARD + DASHED, encoding="utf-8")
        return [*made, timed(pattern, MACHINES[-1], file, "dashes")]


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--facets", default="12x12")
    parser.add_argument("--size", default="200mm")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args(argv)
    made = rows(given.facets, given.size)
    print("| machine | creases | time | of it perforating | lifts | quicker |")
    print("| --- | --- | --- | --- | --- | --- |")
    for row in made:
        ways = "; ".join(f"{change} {clock_text(took)}" for change, took in row.ways.items())
        took, dashes = clock_text(row.seconds), clock_text(row.perforating)
        print(f"| `{row.machine}` | {row.creases} | {took} | {dashes} | {row.lifts:,} | {ways} |")
    if given.json is not None:
        given.json.write_text(json.dumps([asdict(row) for row in made], indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
