"""How many seam edges of random designs are held by a tab in a slot, by the size of the facets.

    python benchmarks/slots.py [--designs 40] [--seed 1] [--json FILE]

The designs are those of needles.py. An edge is bare where neither patch has room for a tab with a
head and its slot. The exit code is 1 if fewer edges of the largest facets are held than 70 %.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from needles import design

from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.seams import all_seams
from miurafab.fabrication.tab_choice import choose_tabs
from miurafab.profiles import load_material

FACETS_MM = ((6.0, 12.0), (12.0, 18.0), (18.0, 30.0))
MATERIALS = ("card-250", "polypropylene-04")
LEAST_HELD = 0.7


@dataclass(frozen=True)
class SlotCount:
    """The seam edges of designs with facets of such lengths, and those that a tab holds."""

    material: str
    facets_mm: tuple[float, float]
    edges: int
    held: int
    bare: int


def measured(facets: tuple[float, float], material: str, designs: int, seed: int) -> SlotCount:
    """The first ``designs`` with more than one patch from ``seed`` on."""
    made = (design(number, facets) for number in itertools.count(seed))
    chosen = itertools.islice((each for each in made if each[1].max() > 0), designs)
    edges = held = bare = 0
    for pattern, patch in chosen:
        options = LayoutOptions(join="slots")
        tabs, _, without = choose_tabs(pattern, patch, load_material(material), options)
        edges += len(all_seams(pattern, patch))
        held, bare = held + len(tabs), bare + len(without)
    return SlotCount(material, facets, edges, held, bare)


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--designs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args(argv)
    rows = [
        measured(facets, material, given.designs, given.seed)
        for material in MATERIALS
        for facets in FACETS_MM
    ]
    print("| material | facets mm | seam edges | held | share |")
    print("| --- | --- | --- | --- | --- |")
    for row in rows:
        size = "{:g} to {:g}".format(*row.facets_mm)
        share = f"{row.held / row.edges:.0%}"
        print(f"| {row.material} | {size} | {row.edges:,} | {row.held:,} | {share} |")
    if given.json is not None:
        given.json.write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n")
    return 1 if any(row.held < LEAST_HELD * row.edges for row in rows[2::3]) else 0


if __name__ == "__main__":
    sys.exit(main())
