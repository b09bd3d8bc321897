"""All orders of the layers of any pattern that folds flat, by complete search.

One variable stands for each pair of facets that overlap when folded flat: is the first above the
second? An order is a choice of all of them that breaks none of these rules (Bern and Hayes, "The
complexity of flat origami", SODA 1996; Akitaya, Demaine and Ku, "Simple folding is really hard",
2017, name them tacos and tortillas):

- a valley folds the second facet onto the front of the first, a mountain onto its back;
- three facets with a common area are not above each other in a circle;
- taco and tortilla: a facet that a folded crease crosses is not between the crease's two facets;
- two tacos: of two folded creases on one line, with all four facets on one side, either both
  facets of one are between those of the other, or none is;
- a flat crease: a facet that it crosses is above both its facets or below both, and so are the
  facets of a crease on its line, each with the one on its own side.

The rules are clauses, and a satisfiability solver (Glucose 4 of the library python-sat, an extra)
finds the orders one by one until none is left or enough are found.
"""

from __future__ import annotations

import importlib
import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from miurafab.errors import InputError
from miurafab.geometry.arrays import Floats, Ints, places_in_runs, run_starts
from miurafab.geometry.overlaps import crossing, polygons_of
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.flat_folding import ROUGH
from miurafab.origami.folding.layers import FlatFolded, LayerOrder, folded_flat
from miurafab.origami.invariants import corner_ring, interior_vertices, kawasaki_residual

DRAWN_WIDTH = 3e-3
"""The least width, in mean edges, of an overlap in a drawing, and how far a drawing may miss."""

DRAWN_MISS = 0.03
"""By how much the facets of a drawing may miss each other at most, mean edges."""

WIDER = 1.25
"""The least width of an overlap, over what facets miss each other by."""

MOST = 100
"""So many orders are looked for, if not told otherwise."""

MOST_TRIPLES = 5_000_000
"""Threes of facets that lie on each other: 900,000 took 19 s and 0.8 GB; both grow with them."""


@dataclass(frozen=True, eq=False)
class LayerSearch:
    """What a complete search found.

    Attributes
    ----------
    folded : FlatFolded
        The pattern folded flat.
    orders : tuple of LayerOrder
        The orders, in the order in which they were found; none if the pattern cannot fold flat.
    complete : bool
        Whether these are all orders.
    rules : dict of str to int
        How many rules of each kind the search had to keep.
    """

    folded: FlatFolded
    orders: tuple[LayerOrder, ...]
    complete: bool
    rules: dict[str, int]


def search_layer_orders(
    pattern: CreasePattern, most: int = MOST, width: float = DRAWN_WIDTH
) -> LayerSearch:
    """All orders of the layers of ``pattern`` folded flat, or the first ``most`` of them.

    Parameters
    ----------
    pattern : CreasePattern
        Any pattern. Mountains, valleys and unassigned creases fold by 180 degrees, an unassigned
        crease to either side; the other edges stay flat. Facets may overlap in one region each.
    most : int
        The search ends after so many orders.
    width : float
        The least width of an overlap, in mean edges, and the largest loop mismatch.

    Raises
    ------
    PatternError
        For a pattern whose loops do not close when folded flat.
    InputError
        Where the library python-sat is not installed, and for more than :data:`MOST_TRIPLES`.

    Examples
    --------
    >>> import miurafab as mf
    >>> sheet = mf.fit("plane", facets=(4, 4), flat_foldable="exact")
    >>> search = search_layer_orders(sheet.pattern)
    >>> len(search.orders), search.complete
    (1, True)
    """
    letters = pattern.edges_assignment
    turn = np.select([letters == "M", np.isin(letters, ("V", "U"))], [-np.pi, np.pi], 0.0)
    folded = _folded(pattern, turn, width)
    solvers = _solvers()
    rules = _Rules(folded)
    found: list[LayerOrder] = []
    none = np.empty((0, 2), dtype=np.int64)
    pairs = len(folded.shared.pairs)
    # the last clause makes the solver know all pairs before it, also those that no rule ties
    clauses = [*rules.clauses(), [pairs + 1]]
    with solvers.Solver(name="glucose4", bootstrap_with=clauses) as solver:
        more = solver.solve()
        while more and len(found) < most:
            chosen = np.array(solver.get_model()[:pairs], dtype=np.int64)
            found.append(LayerOrder(folded, np.sign(chosen), none))
            solver.add_clause((-chosen).tolist())
            more = bool(pairs) and solver.solve()
    return LayerSearch(folded, tuple(found), not more, rules.counts())


def _folded(pattern: CreasePattern, turn: Floats, width: float) -> FlatFolded:
    """``pattern`` folded flat by the angles ``turn`` (E,).

    In a large drawing the rounding of its digits adds up along loops of facets. So where each
    vertex meets Kawasaki's condition as a drawing does, facets may miss each other by more than
    ``width``, and overlaps count that are wider than what they miss.
    """
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    inner, ring = interior_vertices(pattern), corner_ring(pattern, flat)
    off = kawasaki_residual(ring, inner, turn != 0) if len(inner) else np.zeros(1)
    if off.max() > ROUGH:
        return folded_flat(pattern, turn, width, width)
    folded = folded_flat(pattern, turn, width, DRAWN_MISS)
    if folded.mismatch <= width:
        return folded
    return folded_flat(pattern, turn, WIDER * folded.mismatch, DRAWN_MISS)


def broken_rules(order: LayerOrder) -> int:
    """How many clauses of the rules an order breaks; it needs no solver."""
    rules = _Rules(order.folded)
    signs = np.concatenate([[0], order.above])
    return sum(
        int((~(np.sign(block) * signs[np.abs(block)] > 0).any(axis=1)).sum())
        for block in rules.blocks
    )


def _solvers() -> Any:
    """The module of the solvers, which is an extra."""
    try:
        return importlib.import_module("pysat.solvers")
    except ImportError:
        raise InputError(
            "The search for layer orders needs the library python-sat: install it by "
            "'pip install miurafab[layers]'."
        ) from None


class _Rules:
    """The rules as clauses: arrays (n, w) of literals, p for pair p - 1 with the first above."""

    def __init__(self, folded: FlatFolded) -> None:
        self.folded = folded
        pattern, self.shared = folded.pattern, folded.shared
        inner = (pattern.edges_faces >= 0).all(axis=1)
        joined = inner & ~np.isin(pattern.edges_assignment, ("B", "C"))
        self.edges = np.flatnonzero(joined)
        self.folds = np.isin(pattern.edges_assignment, ("M", "V", "U"))
        self.shapes = polygons_of(folded.corners, pattern.faces_vertices)
        left = pattern.edges_faces[:, 0]
        flat = pattern.vertices_coords[pattern.edges_vertices]
        self.ends = np.zeros((len(left), 2, 2))
        for end in (0, 1):
            at = folded.placement.points(flat[self.edges, end], left[self.edges])
            self.ends[self.edges, end] = at[0, :, :2]
        face = np.where(folded.up[pattern.edges_faces], 1, -1)
        self.side = face * [1, -1]  # 1 where a facet lies left of its edge in the plane
        self.blocks: list[Ints] = []
        self._counts: dict[str, int] = {}
        self._letters()
        self._circles()
        self._crossed()
        self._on_one_line()

    def clauses(self) -> list[list[int]]:
        return [clause for block in self.blocks for clause in block.tolist()]

    def counts(self) -> dict[str, int]:
        return self._counts

    def _add(self, kind: str, rules: int, *blocks: Ints) -> None:
        self._counts[kind] = self._counts.get(kind, 0) + rules
        self.blocks.extend(block for block in blocks if len(block))

    def _above(self, one: Ints, other: Ints) -> Ints:
        """(n,) the literals of "one above other"; 0 where the two do not overlap."""
        place = self.shared.place_of(one, other) + 1
        return np.where(one < other, place, -place)

    def _letters(self) -> None:
        pattern = self.folded.pattern
        letters = pattern.edges_assignment[self.edges]
        edges = self.edges[np.isin(letters, ("M", "V"))]
        left, right = pattern.edges_faces[edges].T
        valley = np.where(pattern.edges_assignment[edges] == "V", 1, -1)
        front = np.where(self.folded.up[left], 1, -1)
        literals = self._above(right, left) * valley * front
        units = literals[literals != 0][:, None]
        self._add("letters", len(units), units)

    def _circles(self) -> None:
        if self.shared.has_more_triples(MOST_TRIPLES):
            raise InputError(
                f"Folded flat, {len(self.shapes)} facets lie on each other in "
                f"{len(self.shared.pairs):,} pairs and more than {MOST_TRIPLES:,} triples, the "
                "most with which orders of layers are searched: search in a part of the pattern."
            )
        a, b, c = self.shared.triples(self.shapes, self.folded.width).T
        ab, bc, ca = self._above(a, b), self._above(b, c), self._above(c, a)
        circle = np.column_stack([ab, bc, ca])
        self._add("triples", len(circle), circle, -circle)

    def _alike(self, kind: str, one: Ints, other: Ints) -> None:
        """Both literals of each pair are true, or none is; pairs that do not overlap have none."""
        there = (one != 0) & (other != 0)
        one, other = one[there], other[there]
        self._add(kind, len(one), np.column_stack([one, -other]), np.column_stack([-one, other]))

    def _crossed(self) -> None:
        """Facets that a crease crosses."""
        a, b = self.folded.pattern.edges_faces[self.edges].T
        crease, facet = self._beside(a)
        kept = (self.shared.place_of(b[crease], facet) >= 0) & (facet != b[crease])
        crease, facet = crease[kept], facet[kept]
        kept = crossing(self.ends[self.edges[crease]], self.shapes, facet, self.folded.width)
        crease, facet = crease[kept], facet[kept]
        self._alike("tortillas", self._above(a[crease], facet), self._above(b[crease], facet))

    def _beside(self, facets: Ints) -> tuple[Ints, Ints]:
        """For each of ``facets`` (n,), its number in 0..n and each facet that overlaps it."""
        both = np.concatenate([self.shared.pairs, self.shared.pairs[:, ::-1]])
        both = both[np.argsort(both[:, 0], kind="stable")]
        counts = np.bincount(both[:, 0], minlength=len(self.shapes))
        each = counts[facets]
        at = np.repeat(run_starts(counts)[facets], each) + places_in_runs(each)
        return np.repeat(np.arange(len(facets)), each), both[at, 1]

    def _on_one_line(self) -> None:
        """Two creases of which a part lies on the same part of a line."""
        one, other = self._meeting_creases()
        faces = self.folded.pattern.edges_faces
        along = self.ends[:, 1] - self.ends[:, 0]
        alike = np.sign(np.einsum("ni,ni->n", along[one], along[other])).astype(np.int64)
        here, there = self.side[one], self.side[other] * alike[:, None]
        folds, others = self.folds[one], self.folds[other]
        tacos = folds & others & (here[:, 0] == there[:, 0])
        (a, b), (c, d) = faces[one[tacos]].T, faces[other[tacos]].T
        four = [self._above(p, q) for p, q in ((a, c), (b, c), (a, d), (b, d))]
        literals = np.stack(four, axis=1)
        literals = literals[(literals != 0).all(axis=1)]
        odd = [s for s in itertools.product((1, -1), repeat=4) if np.prod(s) < 0]
        self._add("tacos", len(literals), *(literals * signs for signs in np.array(odd)))
        for first, second, bent, near, far in (
            (one, other, folds & ~others, here, there),
            (other, one, others & ~folds, there, here),
        ):
            a, b = faces[first[bent]].T
            own = (far[bent] == near[bent][:, :1]).argmax(axis=1)
            c = faces[second[bent], own]
            self._alike("tortillas", self._above(a, c), self._above(b, c))
        flat = ~folds & ~others
        a, b = faces[one[flat]].T
        own = (there[flat] == here[flat][:, :1]).argmax(axis=1)
        row = np.flatnonzero(flat)
        c, d = faces[other[row], own], faces[other[row], 1 - own]
        self._alike("flat creases", self._above(a, c), self._above(b, d))

    def _meeting_creases(self) -> tuple[Ints, Ints]:
        """(n,), (n,) the pairs of creases, of facets that overlap, that share part of a line."""
        sides = self.folded.pattern.faces_edges
        first, second = self.shared.pairs.T
        k = sides.shape[1]
        one = np.repeat(sides[first], k, axis=1).reshape(-1)
        other = np.tile(sides[second], (1, k)).reshape(-1)
        crease = np.zeros(len(self.side) + 1, dtype=bool)
        crease[self.edges] = True
        kept = crease[one] & crease[other] & (one != other)
        low, high = np.minimum(one, other)[kept], np.maximum(one, other)[kept]
        one, other = np.unique(np.column_stack([low, high]), axis=0).T
        start = self.ends[one, 0]
        along = self.ends[one, 1] - start
        length = np.linalg.norm(along, axis=1)
        along = along / length[:, None]
        gap = self.ends[other] - start[:, None]
        away = np.abs(gap[..., 0] * along[:, None, 1] - gap[..., 1] * along[:, None, 0])
        reach: Floats = np.einsum("nei,ni->ne", gap, along)
        shared = np.minimum(reach.max(axis=1), length) - np.maximum(reach.min(axis=1), 0.0)
        kept = (away.max(axis=1) <= self.folded.width) & (shared > self.folded.width)
        return one[kept], other[kept]
