"""The order of gluing: each patch is glued to the rim of the assembly.

A step is reachable if the patch meets the assembly along one unbroken line. Then the seam can be
closed from one end to the other with fingers on both sides, and the assembly stays a disk. A disk
of patches always has a reachable step, whatever the order so far (Danaraj and Klee 1978: every
shelling of a disk can be completed). If the pattern has a hole, the step that closes the ring is
taken only when no other step is left.

The patch with the longest seams is first. The next patch is the reachable patch with the longest
seam to the assembly, so the assembly grows round. A seam between two borders of the pattern, which
closes a ring or a tube, is glued last: until then both sides can be reached.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.fabrication.partition.split import boundaries
from miurafab.fabrication.sheets import Layout
from miurafab.origami.crease_pattern import CreasePattern


@dataclass(frozen=True)
class GlueStep:
    """``patch`` is glued to the patches ``onto`` (sorted ids) by tabs numbered ``tabs``;
    the first step of each connected component has neither. A step that ``closes`` glues the
    assembly to itself; ``patch`` bears the tabs.
    """

    patch: int
    onto: tuple[int, ...]
    tabs: tuple[int, ...]
    closes: bool = False


def assembly_order(layout: Layout, pattern: CreasePattern) -> tuple[GlueStep, ...]:
    """One step for each patch, in the order of assembly, then the steps that close it."""
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
    around = boundaries(pattern, owner)
    assembled = np.zeros(len(pattern.faces_vertices) + 1, dtype=bool)
    touched = np.zeros(len(pattern.vertices_coords), dtype=bool)

    def reachable(patch: int) -> bool:
        edges, corners = around[patch].edges, around[patch].vertices
        # The facet -1, beyond the border of the pattern, is never assembled.
        met = assembled[pattern.edges_faces[edges]].any(axis=1)
        lines = int((met & ~np.roll(met, 1)).sum())
        return lines == 1 and int(touched[corners].sum()) == int(met.sum()) + 1

    left = set(range(count))
    done: list[int] = []
    steps = []
    while left:
        contact = seam[:, done].sum(axis=1) if done else np.zeros(count)
        order = sorted(left, key=lambda p: (-contact[p], -seam[p].sum(), p))
        best = next((p for p in order if reachable(p)), order[0])
        onto = tuple(sorted(p for p in done if seam[best, p] > 0))
        numbers = sorted(n for p in onto for n in tabs.get((min(p, best), max(p, best)), []))
        steps.append(GlueStep(best, onto, tuple(numbers)))
        done.append(best)
        left.remove(best)
        assembled[layout.patches[best].faces] = True
        touched[around[best].vertices] = True
    steps += [
        GlueStep(patch, (mate,), tuple(sorted(numbers)), closes=True)
        for (patch, mate), numbers in sorted(closing.items())
    ]
    return tuple(steps)
