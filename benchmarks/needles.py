"""Whether any tab of random designs is a needle, and how much glue that costs.

    python benchmarks/needles.py [--designs 200] [--seed 1] [--facets 6,22] [--json FILE]

A design is a sheet over a random zig-zag polyline, in card, cut into blocks of a random number of
rows and columns, so that its seams run both ways; its facets are about as long as --facets says, in
mm, and it has at least 12 tabs. A needle has a base shorter than 2.5 mm or is more
than twice as high as its base; a raised tab is no wider than its base. *Before* is the rule of the
time when tabs could be needles: a base of 2 mm, any height up to that asked for, and raised tabs of
any angle. The area that is lost is that of the needles, so smaller facets lose more. *Allowed* is a
bound on what any tab may keep: on an edge of length L a base is L less the inset at both ends, at
least 2.5 mm, and a tab no wider than its base and twice as high has twice the square of it. The
exit code is 1 if a tab is a needle, or if a design keeps less than 87 % of its glue, and less than
LEAST_OF_ALLOWED of what is allowed.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np

from miurafab.fabrication import tabs as rule
from miurafab.fabrication.tab_choice import choose_tabs
from miurafab.fabrication.tabs import MIN_BASE_MM, SLENDER, TabRegions
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cylinder import cylinder_over_polyline
from miurafab.origami.unfold import unfold
from miurafab.profiles import load_material

LEAST_KEPT = 0.87
LEAST_OF_ALLOWED = 0.9
LEAST_TABS = 12
FACETS_MM = (6.0, 22.0)
"""As in the shipped designs, whose narrowest facets have 6.2 mm."""
FORMER_BASE_MM = 2.0


@dataclass(frozen=True)
class Measured:
    """The tabs of a design, the needles among them and before, the share of the glue area that is
    kept, and a bound on the share that may be.
    """

    tabs: int
    needles: int
    needles_before: int
    kept: float
    allowed: float

    @property
    def enough(self) -> bool:
        """Whether it keeps the area that is asked for, or nearly what is allowed."""
        return self.kept >= min(LEAST_KEPT, LEAST_OF_ALLOWED * self.allowed)


def design(seed: int, facets: tuple[float, float] = FACETS_MM) -> tuple[CreasePattern, np.ndarray]:
    """A random sheet with ``facets`` of about such lengths, and the patch (F,) of each facet."""
    rng = np.random.default_rng(seed)
    rows, columns = int(rng.integers(6, 18)), int(rng.integers(6, 18))
    length = rng.uniform(*facets) * rng.uniform(0.6, 1.4, rows + 1)
    # It bends on, so that the sheet does not come back upon itself.
    turn = np.where(np.arange(rows + 1) % 2, 1.0, -1.0) * rng.uniform(0.5, 1.0, rows + 1)
    steps = length[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    profile = np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])
    step = rng.uniform(*facets)
    push = rng.uniform(0.1, 0.9) * min(step, float(length.min()))
    pattern = unfold(cylinder_over_polyline(profile, step, push, columns))
    assert pattern.grid is not None
    across, along = pattern.grid[0] - 1, pattern.grid[1] - 1
    row, column = np.divmod(np.arange(across * along), across)
    high, wide = int(rng.integers(1, along + 1)), int(rng.integers(1, across + 1))
    block = (row // high) * across + column // wide
    return pattern, np.unique(block, return_inverse=True)[1]


@contextmanager
def former_rule() -> Iterator[None]:
    """Tabs as they were made before."""
    steeper = rule.not_steeper

    def free(points: np.ndarray, count: np.ndarray, angle: np.ndarray) -> tuple:
        raised = angle == math.pi / 2
        return steeper(points, count, np.where(raised, math.pi - 1e-9, angle))

    with (
        mock.patch.object(rule, "MIN_BASE_MM", FORMER_BASE_MM),
        mock.patch.object(rule, "not_slender", lambda points, count: (points, count)),
        mock.patch.object(rule, "not_steeper", free),
    ):
        yield


def needles(tabs: TabRegions) -> int:
    """How many are shorter at the base, or higher, than a tab may be."""
    found = 0
    for k in range(len(tabs)):
        ring = tabs.polygon(k)
        base = float(np.linalg.norm(ring[1] - ring[0]))
        along = (ring[1] - ring[0]) / base
        height = ((ring - ring[0]) @ [-along[1], along[0]]).max()
        found += bool(base < MIN_BASE_MM - 1e-9 or height > SLENDER * base + 1e-9)
    return found


def measured(seed: int, facets: tuple[float, float] = FACETS_MM) -> Measured | None:
    """The design of ``seed``, now and before; None if it has too few tabs to be one."""
    pattern, patch = design(seed, facets)
    material = load_material("card-250")
    now = choose_tabs(pattern, patch, material)[0]
    with former_rule():
        before = choose_tabs(pattern, patch, material)[0]
    if len(before) < LEAST_TABS:
        return None
    kept = float(now.areas.sum() / before.areas.sum())
    lengths = edge_lengths(pattern.vertices_coords, pattern.edges_vertices[before.edge])
    base = lengths - 2 * rule.inset_of(material)
    most = np.minimum(before.areas, SLENDER * np.where(base >= MIN_BASE_MM, base, 0.0) ** 2)
    allowed = float(most.sum() / before.areas.sum())
    return Measured(len(now), needles(now), needles(before), kept, allowed)


def sample(count: int, seed: int, facets: tuple[float, float] = FACETS_MM) -> list[Measured]:
    """The first ``count`` designs from ``seed`` on."""
    made = (measured(number, facets) for number in itertools.count(seed))
    return list(itertools.islice((each for each in made if each is not None), count))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--designs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--facets", default="6,22")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    low, high = map(float, given.facets.split(","))
    found = sample(given.designs, given.seed, (low, high))
    figures = {
        "designs": given.designs,
        "tabs": sum(each.tabs for each in found),
        "needles_before": sum(each.needles_before for each in found),
        "needles": sum(each.needles for each in found),
        "designs_with_needles_before": sum(each.needles_before > 0 for each in found),
        "least_kept": round(min(each.kept for each in found), 4),
        "least_allowed": round(min(each.allowed for each in found), 4),
        "least_of_allowed": round(min(each.kept / each.allowed for each in found), 4),
        "mean_kept": round(float(np.mean([each.kept for each in found])), 4),
    }
    print("\n".join(f"{name:28} {value}" for name, value in figures.items()))
    if given.json is not None:
        given.json.write_text(json.dumps(figures, indent=1) + "\n")
    return 0 if not figures["needles"] and all(each.enough for each in found) else 1


if __name__ == "__main__":
    sys.exit(main())
