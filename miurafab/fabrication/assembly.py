"""The order in which patches are glued: always onto what is already one piece.

The first patch is the one with the longest seams. Each next one is the patch that shares the
longest seam with what is assembled, so that the assembly grows round and holes are closed before
they are ringed in, while fingers still reach the inner side. A seam between two borders of the
pattern, which makes a ring or a tube of the sheet, is closed when everything else is glued: until
then it is reached from both sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.fabrication.sheets import Layout
from miurafab.origami.crease_pattern import CreasePattern


@dataclass(frozen=True)
class GlueStep:
    """``patch`` is glued onto ``onto`` (patch ids, sorted) by the tabs of these numbers; the first
    step of each connected piece has neither. A step that ``closes`` glues what is assembled to
    itself, ``patch`` being the one that bears the tabs.
    """

    patch: int
    onto: tuple[int, ...]
    tabs: tuple[int, ...]
    closes: bool = False


def assembly_order(layout: Layout, pattern: CreasePattern) -> tuple[GlueStep, ...]:
    """One step for each patch, in the order of assembly, then those that close it."""
    count = len(layout.patches)
    owner = np.full(len(pattern.faces_vertices), -1)
    for patch in layout.patches:
        owner[patch.faces] = patch.id
    inner = (pattern.edges_faces >= 0).all(axis=1)
    sides = owner[pattern.edges_faces[inner]]
    ends = pattern.vertices_coords[pattern.edges_vertices[inner]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    seam = np.zeros((count, count))
    np.add.at(seam, (sides[:, 0], sides[:, 1]), length)
    seam = seam + seam.T
    np.fill_diagonal(seam, 0.0)

    tabs: dict[tuple[int, int], list[int]] = {}
    closing: dict[tuple[int, int], list[int]] = {}
    for patch in layout.patches:
        for tab in patch.tabs:
            if tab.edge != tab.mate_edge:
                closing.setdefault((patch.id, tab.mate_patch), []).append(tab.number)
                continue
            low, high = sorted((patch.id, tab.mate_patch))
            tabs.setdefault((low, high), []).append(tab.number)
    left = set(range(count))
    done: list[int] = []
    steps = []
    while left:
        contact = seam[:, done].sum(axis=1) if done else np.zeros(count)
        best = max(left, key=lambda p: (contact[p], seam[p].sum(), -p))
        onto = tuple(sorted(p for p in done if seam[best, p] > 0))
        numbers = sorted(n for p in onto for n in tabs.get((min(p, best), max(p, best)), []))
        steps.append(GlueStep(best, onto, tuple(numbers)))
        done.append(best)
        left.remove(best)
    steps += [
        GlueStep(patch, (mate,), tuple(sorted(numbers)), closes=True)
        for (patch, mate), numbers in sorted(closing.items())
    ]
    return tuple(steps)
