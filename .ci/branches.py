"""Judge the report of ``make coverage``: how many branches of the package the tests take.

    python .ci/branches.py REPORT

``REPORT`` is what ``coverage json`` writes. Prints a row for each room, then one for each module
under the limit and one for the package; exits 1 if the package is under it. A branch is a jump from
a line that can go on at two. Statements are not mixed in: they would lift the share.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path

LIMIT = 95  # percent of the branches of the package


def row(name: str, taken: int, branches: int) -> str:
    """The share is rounded down: 94.99 does not look like 95."""
    return f"{name:<40} {taken:>6} of {branches:>5}  {10000 * taken // branches / 100:6.2f} %"


def main() -> int:
    files = json.loads(Path(sys.argv[1]).read_text())["files"]
    taken: Counter[str] = Counter()
    branches: Counter[str] = Counter()
    below = []
    for name, each in sorted(files.items()):
        summary = each["summary"]
        here = summary["covered_branches"], summary["num_branches"]
        parts = Path(name).parts
        room = Path(parts[parts.index("miurafab") + 1]).stem
        for key in (room, "the package"):
            taken[key] += here[0]
            branches[key] += here[1]
        if 100 * here[0] < LIMIT * here[1]:
            below.append(row(name, *here))
    whole = taken.pop("the package"), branches.pop("the package")
    rooms = [row(room, taken[room], branches[room]) for room in sorted(branches) if branches[room]]
    print(*rooms, "", *below, "", row("the package", *whole), sep="\n")
    return int(100 * whole[0] < LIMIT * whole[1])


if __name__ == "__main__":
    sys.exit(main())
