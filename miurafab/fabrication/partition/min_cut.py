"""The shortest seams between patches that must keep to given rectangles, by minimum cuts.

Each patch has a rectangle (:mod:`~miurafab.fabrication.partition.cover`) and must keep its facets
and its tabs inside. Where the rectangles of two patches A and B overlap, the seam between them is
free. The cost of a split is

    E = Σ over seam edges of their length + P (facets and tabs outside the rectangle of their patch)

with P far larger than any length. For one pair of patches, with everything else fixed, the least E
is a minimum cut. The facets in both rectangles are the nodes, A is the source and B the sink. The
capacity between two neighbouring facets is the cost of their edge as a seam of A and B; it depends
on the direction, because A or B may bear the tab. The cost of a facet towards its fixed neighbours
is its capacity to the source or the sink. Taking all pairs in turn until none improves is the swap
algorithm of Boykov, Veksler and Zabih (2001). A cut after which a patch is not a disk is rejected.

Along a grid many stepped seams are equally short. So each grid line has a price, which differs a
little from line to line, and a seam keeps to one line as long as it can.
"""

from __future__ import annotations

import itertools

import numpy as np

from miurafab.fabrication.partition.cover import excess, rectangle_around
from miurafab.fabrication.partition.fit_box import TOLERANCE
from miurafab.fabrication.partition.region_growing import is_disk
from miurafab.fabrication.seams import all_seams, inner_seams
from miurafab.fabrication.tabs import TabRegions, tab_regions
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.connected import minimum_cut
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

_FLUSH_MM = TOLERANCE / 2
"""An excess that counts as inside; :func:`~.fit_box.best_turn` accepts it, too."""

_UNIT = 1000
"""The cost of the mean edge length."""

_PENALTY = 1_000_000
"""P in the same unit."""

_PRICE = 0.01
"""The relative difference between the dearest and the cheapest grid line."""


class Recut:
    """A split under improvement: the ``patch`` (F,) of each facet, the ``rectangles`` (K, 3) of the
    patches.

    ``room`` (F, c, 2) has the corners of each facet and of its tabs on the border. ``alternate``:
    a tab may stand on either side of a seam, not only on the lower patch. Facets in different parts
    (``part`` (F,)) are never joined.
    """

    def __init__(
        self,
        pattern: CreasePattern,
        patch: Ints,
        rectangles: Floats,
        size: tuple[float, float],
        room: Floats,
        part: Ints,
        material: Material,
        *,
        full_facet: bool,
        alternate: bool,
    ) -> None:
        self.pattern, self.patch, self.rectangles = pattern, patch.copy(), rectangles.copy()
        self.size, self.room, self.part = size, room, part
        self.material, self.full_facet, self.alternate = material, full_facet, alternate
        faces = np.arange(len(patch))[:, None]
        edges = pattern.faces_edges
        pair = pattern.edges_faces[edges]
        self.side = np.where(pair[..., 0] == faces, 1, 0)
        other = np.take_along_axis(pair, self.side[..., None], axis=2)[..., 0]
        self.across = np.where(edges >= 0, other, -1)
        ends = pattern.vertices_coords[pattern.edges_vertices]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        self.cost = np.maximum(np.rint(_UNIT * length * _prices(pattern) / length.mean()), 1.0)
        self._hold()
        self._make_tabs()

    def _hold(self) -> None:
        """Find the facets that each rectangle holds."""
        centres = self.room.mean(axis=1)
        radius = np.linalg.norm(self.room - centres[:, None], axis=2).max(axis=1)
        self.held = []
        for rectangle in self.rectangles:
            middle = excess(centres[:, None], rectangle, *self.size)
            close = np.flatnonzero(middle <= 0)
            inside = middle[close] <= -radius[close]
            doubtful = close[~inside]
            inside[~inside] = excess(self.room[doubtful], rectangle, *self.size) <= _FLUSH_MM
            self.held.append(close[inside])

    def _make_tabs(self) -> None:
        """Make the tabs on both sides of all edges that may become seams."""
        pattern = self.pattern
        times = np.bincount(np.concatenate(self.held), minlength=len(self.patch))
        pair = pattern.edges_faces
        inner = (pair >= 0).all(axis=1) & (pattern.edges_assignment != "C")
        loose = (times[pair] != 1).any(axis=1) | (self.patch[pair[:, 0]] != self.patch[pair[:, 1]])
        edges = np.flatnonzero(inner & loose)
        both = np.concatenate([edges, edges])
        sides = np.repeat([0, 1], len(edges))
        self.tabs: TabRegions = tab_regions(
            pattern, inner_seams(pattern, both, sides), self.material, full_facet=self.full_facet
        )
        self.tab = np.full((len(pattern.edges_vertices), 2), -1)
        self.tab[both, sides] = np.arange(len(both))
        weak = self.tabs.glue < self.material.tabs.min_area_mm2
        self.weak = weak
        # Missing corners repeat the first corner.
        points, present = self.tabs.points, self.tabs.present
        self.tab_points = np.where(present[..., None], points, points[:, :1])
        self.tab_points[~present.any(axis=1)] = np.nan

    def _outside(self, tab: Ints, patch: Ints) -> Bools:
        """Whether each tab (-1: none) reaches out of the rectangle of ``patch``; same shapes."""
        found = np.zeros(tab.shape, dtype=bool)
        real = np.flatnonzero((tab >= 0).ravel() & (patch >= 0).ravel())
        which, where = tab.ravel()[real], patch.ravel()[real]
        over = excess(self.tab_points[which], self.rectangles[where], *self.size)
        found.ravel()[real] = over > _FLUSH_MM
        return found

    def _seam_cost(self, facet: Ints, mine: Ints, theirs: Ints) -> Floats:
        """(n, k) the cost of the sides of ``facet`` (n,) if it is in patch ``mine`` (n,) and its
        neighbours are in ``theirs`` (n, k), -1 for none.
        """
        edges, side = self.pattern.faces_edges[facet], self.side[facet]
        seam = (self.across[facet] >= 0) & (theirs != mine[:, None])
        lower = mine[:, None] < theirs
        own, other = self.tab[edges, side], self.tab[edges, 1 - side]
        bears = seam & (lower | self.alternate | (self.weak[other] & (other >= 0)))
        taken = seam & (~lower | self.alternate | (self.weak[own] & (own >= 0)))
        out = self._outside(np.where(bears, own, -1), np.where(bears, mine[:, None], -1))
        out |= self._outside(np.where(taken, other, -1), np.where(taken, theirs, -1))
        return np.where(seam, self.cost[edges] + _PENALTY * out, 0.0)

    def faults(self) -> int:
        """The number of facets and tabs outside the rectangle of their patch."""
        held = np.zeros(len(self.patch), dtype=bool)
        for patch, facets in enumerate(self.held):
            held[facets] |= self.patch[facets] == patch
        seam = np.flatnonzero((self.across >= 0).any(axis=1))
        near = self.across[seam]
        theirs = np.where(near >= 0, self.patch[near], -1)
        rim = (near >= 0) & (theirs != self.patch[seam, None])
        seam, theirs = seam[rim.any(axis=1)], theirs[rim.any(axis=1)]
        cost = self._seam_cost(seam, self.patch[seam], theirs)
        return int((~held).sum()) + int((cost >= _PENALTY).sum())

    def refit(self) -> None:
        """Refit each rectangle to its patch with its tabs."""
        near = np.where(self.across >= 0, self.patch[self.across], -1)
        real = self.pattern.faces_edges >= 0
        rim = (real & (near != self.patch[:, None])).any(axis=1)
        seams = all_seams(self.pattern, self.patch)
        seams = seams.take(seams.edges[:, 0] == seams.edges[:, 1])
        lower = self.patch[seams.faces[:, 0]] < self.patch[seams.faces[:, 1]]
        if self.alternate:
            seams = seams.joined(seams.swapped(np.ones(len(seams), dtype=bool)))
        else:
            seams = seams.swapped(~lower)
        edges = seams.edges[:, 0]
        side = np.where(self.pattern.edges_faces[edges, 0] == seams.faces[:, 1], 0, 1)
        tab = self.tab[edges, side]
        points = np.concatenate(
            [self.room[rim].reshape(-1, 2), self.tab_points[tab].reshape(-1, 2)]
        )
        owner = np.concatenate(
            [
                np.repeat(self.patch[rim], self.room.shape[1]),
                np.repeat(self.patch[seams.faces[:, 0]], self.tab_points.shape[1]),
            ]
        )
        owner = np.where(np.isnan(points[:, 0]), len(self.rectangles), owner)
        order = np.argsort(owner, kind="stable")
        ends = np.searchsorted(owner[order], np.arange(len(self.rectangles) + 1)).tolist()
        for patch, (start, end) in enumerate(itertools.pairwise(ends)):
            if end > start:
                self.rectangles[patch] = rectangle_around(points[order[start:end]], *self.size)
        self._hold()
        self._make_tabs()

    @property
    def seam_cost(self) -> float:
        """The cost of all seams, in thousandths of the mean edge length."""
        pair = self.pattern.edges_faces
        seam = (pair >= 0).all(axis=1) & (self.patch[pair[:, 0]] != self.patch[pair[:, 1]])
        return float(self.cost[seam].sum())

    def run(self, rounds: int) -> None:
        """Recut all pairs of neighbouring patches, at most ``rounds`` times."""
        fresh = np.ones(len(self.rectangles), dtype=bool)
        for _ in range(rounds):
            pairs = self._pairs()
            pairs = pairs[fresh[pairs].any(axis=1)]
            fresh[:] = False
            for one, other in pairs.tolist():
                if self._swap(one, other):
                    fresh[[one, other]] = True
            if not fresh.any():
                return

    def _pairs(self) -> Ints:
        """(P, 2) pairs of neighbouring patches, the lower number first."""
        pair = self.pattern.edges_faces[(self.pattern.edges_faces >= 0).all(axis=1)]
        pair = pair[self.part[pair[:, 0]] == self.part[pair[:, 1]]]
        sides = np.sort(self.patch[pair], axis=1)
        return np.unique(sides[sides[:, 0] != sides[:, 1]], axis=0)

    def _swap(self, one: int, other: int) -> bool:
        """Recut the seam between two patches; whether it changed."""
        zone = np.intersect1d(self.held[one], self.held[other], assume_unique=True)
        zone = zone[(self.patch[zone] == one) | (self.patch[zone] == other)]
        if not len(zone):
            return False
        zone = zone[self.part[zone] == self.part[zone[0]]] if self._mixed(zone) else zone
        nodes = len(zone)
        place = np.full(len(self.patch), -1)
        place[zone] = np.arange(nodes)
        near = self.across[zone]
        to = np.where(near >= 0, place[near], -1)
        within = to >= 0
        theirs = np.where(near >= 0, self.patch[near], -1)
        fixed = np.where(within, -1, theirs)
        a, b = np.full(nodes, one), np.full(nodes, other)
        if_a = np.where(fixed >= 0, self._seam_cost(zone, a, fixed), 0.0).sum(axis=1)
        if_b = np.where(fixed >= 0, self._seam_cost(zone, b, fixed), 0.0).sum(axis=1)
        apart = self._seam_cost(zone, a, np.where(within, other, -1))
        row, column = np.nonzero(within)
        source, sink = nodes, nodes + 1
        tail = np.concatenate([row, np.full(nodes, source), np.arange(nodes)])
        head = np.concatenate([to[row, column], np.arange(nodes), np.full(nodes, sink)])
        cost = np.concatenate([apart[row, column], if_b, if_a])
        least, is_a = minimum_cut(nodes + 2, tail, head, cost.astype(np.int32), source, sink)
        before = self.patch[zone]
        in_a = before == one
        cut = in_a[row] & ~in_a[to[row, column]]
        was = if_a[in_a].sum() + if_b[~in_a].sum() + apart[row, column][cut].sum()
        if least >= was:
            return False
        sound = [self._is_disk(patch) for patch in (one, other)]
        self.patch[zone] = np.where(is_a[:nodes], one, other)
        if any(was and not self._is_disk(p) for p, was in zip((one, other), sound, strict=True)):
            self.patch[zone] = before
            return False
        return True

    def _is_disk(self, patch: int) -> bool:
        facets = np.flatnonzero(self.patch == patch)
        return not len(facets) or is_disk(self.pattern, facets)

    def misshapen(self) -> list[int]:
        """The patches that are not disks."""
        return [patch for patch in np.unique(self.patch).tolist() if not self._is_disk(patch)]

    def _mixed(self, zone: Ints) -> bool:
        return bool((self.part[zone] != self.part[zone[0]]).any())


def _prices(pattern: CreasePattern) -> Floats:
    """(E,) the price of a mm of each edge as a seam, 1 or a little more where the lattice is known:
    a seam keeps to one line of it.
    """
    if pattern.cells is None:
        return np.ones(len(pattern.edges_vertices))
    column, row = pattern.cells[pattern.edges_faces].transpose(2, 0, 1)
    line = np.where(column[:, 0] != column[:, 1], column.max(axis=1), row.max(axis=1))
    return np.asarray(1.0 + _PRICE * ((line * 0.6180339887498949) % 1.0))
