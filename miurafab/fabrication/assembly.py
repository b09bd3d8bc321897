"""The order of gluing: each patch is glued to the rim of the assembly.

A step is reachable if the patch meets the assembly along one unbroken line. Then the seam can be
closed from one end to the other with fingers on both sides, and the assembly stays a disk. A disk
of patches always has a reachable step, whatever the order so far (Danaraj and Klee 1978: every
shelling of a disk can be completed). If the shell has a hole or is closed, the step that closes it
is taken only when no other step is left. Such a patch is glued along its longest line, and its
other lines close the shell at the end. A line all round the patch is glued at once.

Patches of different pieces meet along the seams between pieces, in space. Seen so, a vertex that
was doubled along a seam is one vertex.

The patch with the longest seams is first. The next patch is the reachable patch with the longest
seam to the assembly, so the assembly grows round. A seam on which a piece closes upon itself, as a
ring or a tube does, is glued last: until then both sides can be reached.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from miurafab.fabrication.partition.boundary import Boundary, boundaries
from miurafab.fabrication.partition.pieces import facet_components
from miurafab.fabrication.seams import border_seams, shell_points
from miurafab.fabrication.sheets import Layout
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern


@dataclass(frozen=True)
class GlueStep:
    """``patch`` is glued to the patches ``onto`` (sorted ids) by tabs numbered ``tabs``, along the
    pattern edges ``edges`` of both sides; the first step of each connected component has none of
    these. A step that ``closes`` glues the assembly to itself. A step goes ``all_round`` if the
    whole outline of the patch is glued.
    """

    patch: int
    onto: tuple[int, ...]
    tabs: tuple[int, ...]
    edges: tuple[int, ...] = ()
    closes: bool = False
    all_round: bool = False


def assembly_order(layout: Layout, pattern: CreasePattern) -> tuple[GlueStep, ...]:
    """One step for each patch, in the order of assembly, then the steps that close it."""
    return _Assembly(layout, pattern).steps()


class _Assembly:
    """What is glued so far: the ``assembled`` facets and the ``touched`` vertices.

    ``across`` (E, 2) is the facet beyond each edge, seen from the facet on its left and on its
    right; -1 where nothing is glued. ``mate`` (E,) is the edge that each edge is glued to, the edge
    itself within a piece. ``point`` (V,) numbers the vertices of the shell.
    """

    def __init__(self, layout: Layout, pattern: CreasePattern) -> None:
        self.pattern, self.count = pattern, len(layout.patches)
        faces = len(pattern.faces_vertices)
        self.owner = np.full(faces + 1, -1)
        for patch in layout.patches:
            self.owner[patch.faces] = patch.id
        seams = border_seams(pattern)
        label = facet_components(pattern)[seams.faces]
        within = label[:, 0] == label[:, 1]
        self.rings, between = seams.take(within), seams.take(~within)
        self.mate = np.arange(len(pattern.edges_vertices))
        self.mate[between.edges] = between.edges[:, ::-1]
        self.across = np.where(
            (pattern.edges_assignment == "C")[:, None], -1, pattern.edges_faces[:, ::-1]
        )
        # The only facet of a border edge lies on one of its sides.
        self.across[between.edges] = between.faces[:, ::-1, None]
        self.point = shell_points(pattern, between)
        self.number = {
            edge: tab.number
            for patch in layout.patches
            for tab in patch.tabs
            for edge in (tab.edge, tab.mate_edge)
            if edge is not None
        }
        self.around = boundaries(pattern, self.owner[:-1])
        self.length = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
        self.assembled = np.zeros(faces + 1, dtype=bool)
        self.touched = np.zeros(len(pattern.vertices_coords), dtype=bool)

    def steps(self) -> tuple[GlueStep, ...]:
        seam = self._seam_lengths()
        left = set(range(self.count))
        done: list[int] = []
        steps, closing = [], []
        while left:
            contact = seam[:, done].sum(axis=1) if done else np.zeros(self.count)
            order = np.lexsort((-seam.sum(axis=1), -contact)).tolist()
            order = [patch for patch in order if patch in left]
            best = next((p for p in order if self._reachable(p)), order[0])
            lines = self._lines(best)
            round_ = len(lines) == 1 and len(lines[0]) == sum(
                len(loop.edges) for loop in self.around[best].loops
            )
            steps.append(self._step(best, lines[0] if lines else [], all_round=round_))
            closing += [self._step(best, line, closes=True) for line in lines[1:]]
            done.append(best)
            left.remove(best)
            self.assembled[:-1][self.owner[:-1] == best] = True
            for loop in self.around[best].loops:
                self.touched[self.point[loop.vertices]] = True
        return (*steps, *closing, *self._ring_steps())

    def _seam_lengths(self) -> Floats:
        """(P, P) the length of the seams between two patches."""
        sides = self.owner[self.pattern.edges_faces]
        other = self.owner[self.across]
        seam = np.zeros((self.count, self.count))
        for side in (0, 1):
            joins = (sides[:, side] >= 0) & (other[:, side] >= 0)
            pair = sides[joins, side], other[joins, side]
            np.add.at(seam, pair, self.length[joins])
        np.fill_diagonal(seam, 0.0)
        # Of seams equal up to rounding the first is taken, so that rounding decides nothing.
        return np.asarray(np.round(seam, 6))

    def _beyond(self, patch: int, edges: Ints) -> Ints:
        """The facet beyond each of ``edges`` of the boundary of a patch."""
        faces = self.pattern.edges_faces[edges]
        right = (self.owner[faces[:, 0]] != patch).astype(np.int64)
        return np.asarray(self.across[edges, right])

    def _met(self, patch: int, loop: Boundary) -> Bools:
        """Whether each edge of a loop of ``patch`` meets the assembly."""
        return np.asarray(self.assembled[self._beyond(patch, loop.edges)])

    def _reachable(self, patch: int) -> bool:
        lines = shared = met = 0
        for loop in self.around[patch].loops:
            here = self._met(patch, loop)
            lines += int((here & ~np.roll(here, 1)).sum())
            met += int(here.sum())
            shared += int(self.touched[self.point[loop.vertices]].sum())
        return lines == 1 and shared == met + 1

    def _lines(self, patch: int) -> list[list[int]]:
        """The unbroken lines along which ``patch`` meets the assembly, the longest first."""
        lines = []
        for loop in self.around[patch].loops:
            here = self._met(patch, loop)
            if not here.any():
                continue
            start = 0 if here.all() else int(np.argmin(here))
            edges = np.roll(loop.edges, -start).tolist()
            runs = itertools.groupby(
                zip(edges, np.roll(here, -start).tolist(), strict=True), key=lambda each: each[1]
            )
            lines += [[edge for edge, _ in run] for meets, run in runs if meets]
        return sorted(lines, key=lambda line: -float(self.length[line].sum()))

    def _step(
        self, patch: int, line: list[int], *, closes: bool = False, all_round: bool = False
    ) -> GlueStep:
        edges = np.array(line, dtype=np.int64)
        onto = np.unique(self.owner[self._beyond(patch, edges)])
        both = np.unique(np.concatenate([edges, self.mate[edges]]))
        return self._made(patch, onto, both, closes=closes, all_round=all_round)

    def _made(
        self, patch: int, onto: Ints, edges: Ints, *, closes: bool, all_round: bool = False
    ) -> GlueStep:
        tabs = {self.number[edge] for edge in edges.tolist() if edge in self.number}
        return GlueStep(
            patch,
            tuple(onto.tolist()),
            tuple(sorted(tabs)),
            tuple(edges.tolist()),
            closes=closes,
            all_round=all_round,
        )

    def _ring_steps(self) -> list[GlueStep]:
        """One step for each pair of patches on seams that close a piece upon itself."""
        pairs = np.sort(self.owner[self.rings.faces], axis=1)
        return [
            self._made(
                int(pair[0]),
                pair[1:],
                np.sort(self.rings.edges[(pairs == pair).all(axis=1)].ravel()),
                closes=True,
            )
            for pair in np.unique(pairs, axis=0)
        ]
