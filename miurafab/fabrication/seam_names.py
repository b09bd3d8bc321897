"""The labels of tabs: a letter for each seam, and a number along it, as ``a1`` to ``a9``.

A seam is one unbroken line along which two patches meet, or a patch meets itself. The tabs on it
are counted along the outline of the patch with the lower number, on whichever side they stand. So
neighbours on a seam have neighbouring labels, and a label without room on the sheet follows from
those beside it. Both tabs of a pair that is glued to each other have one label. The tabs of a patch
on one line of an open border are counted in the same way.

Seams have small letters, so that they are neither M nor V, which follow the label of a tab, nor the
P of a patch. Letters that look like a digit or a capital at their size are left out. After z comes
aa.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from miurafab.fabrication.partition.boundary import boundaries
from miurafab.fabrication.seams import all_seams
from miurafab.fabrication.tabs import TabRegions
from miurafab.geometry.arrays import Ints
from miurafab.origami.crease_pattern import CreasePattern

LETTERS = "abcdefhknrstuwxz"


def tab_labels(pattern: CreasePattern, face_patch: Ints, tabs: TabRegions) -> tuple[str, ...]:
    """The label of each of N ``tabs``; ``face_patch`` (F,) is the patch of each facet."""
    tabs_of: dict[int, list[int]] = {}
    for tab, edge in enumerate(tabs.edge.tolist()):
        tabs_of.setdefault(edge, []).append(tab)
    beyond = int(face_patch.max(initial=0)) + 1  # open borders come after all neighbours
    mates: dict[tuple[int, int], tuple[int, int]] = {}
    seams = all_seams(pattern, face_patch)
    for (one, other), (own, mate) in zip(
        seams.edges.tolist(), face_patch[seams.faces].tolist(), strict=True
    ):
        mates[own, one], mates[mate, other] = (mate, other), (own, one)
    letters, labels = _letters(), [""] * len(tabs)
    for patch, around in enumerate(boundaries(pattern, face_patch)):
        lines = []
        for loop in around.loops:
            edges = loop.edges.tolist()
            across = [mates.get((patch, edge), (beyond, edge))[0] for edge in edges]
            lines += [(mate, line) for mate, line in _lines(edges, across) if mate >= patch]
        for mate, line in sorted(lines, key=lambda each: each[0]):
            pairs = ((edge, mates.get((patch, edge), (mate, edge))[1]) for edge in line)
            # A patch that meets itself has both sides of the seam; the first of them counts.
            met = dict.fromkeys(tuple(sorted(set(pair))) for pair in pairs)
            found = [[tab for edge in pair for tab in tabs_of.get(edge, ())] for pair in met]
            standing = [own for own in found if own and not labels[own[0]]]
            letter = next(letters) if standing else ""
            for number, own in enumerate(standing, start=1):
                for tab in own:
                    labels[tab] = f"{letter}{number}"
    return tuple(labels)


def _lines(edges: list[int], across: list[int]) -> list[tuple[int, list[int]]]:
    """The runs of ``edges`` of a loop with one neighbour, of ``across``, with this neighbour."""
    start = next((k for k in range(len(edges)) if across[k] != across[k - 1]), 0)
    turned = zip(edges[start:] + edges[:start], across[start:] + across[:start], strict=True)
    runs = itertools.groupby(turned, key=lambda each: each[1])
    return [(mate, [edge for edge, _ in run]) for mate, run in runs]


def _letters() -> Iterator[str]:
    """a, b, ... z, aa, ab, ..."""
    lengths = itertools.count(1)
    rows = itertools.chain.from_iterable(itertools.product(LETTERS, repeat=n) for n in lengths)
    return map("".join, rows)
