"""Development: quads in charts laid flat without stretching, each piece by itself.

The heading of each facet follows from that of its neighbour and the corner angles at their common
side, over a tree of facets that grows breadth-first from the middle of each piece. The vertices
follow by adding up sides over the same tree. Both are sums of lengths and angles of the folded
form, so that rounding adds up and is not amplified. (Placing each row from the positions of the
row before amplifies rounding, by 1e8 on a spiral of 20 rows.)

A piece around a hole, or one that closes on itself, may not close when flat. It is opened along the
creases between two loops of its border. The creases that the tree does not use, with each loop
taken as one point, form a tree of their own; the path in it between two loops is the cut. Creases
of the cut whose two sides come to lie apart are opened, the others stay. The tree of facets crosses
the line where the lattice closes only where it must, so that a ring opens there.

The last sides carry the rounding of all angles before them: on a cylinder of 10,000 facets their
lengths are wrong by 5e-12. Where it is over ``EXACT``, one step of least squares over all sides and
diagonals spreads it evenly: 3e-14 with 10,000 facets, 1e-13 with 100,000.

Sides are numbered h = 4 * facet + k, from corner k to the next corner of the facet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from miurafab.geometry.angles import angle_between
from miurafab.geometry.arrays import Bools, Floats, Ints, nearest_to_means
from miurafab.geometry.connected import components, shortest_ways
from miurafab.geometry.evening import evened
from miurafab.geometry.polygons import reflex_corners
from miurafab.geometry.quads import QuadCharts

CLOSES = 1e-9
"""In mean sides: the two sides of a cut that lie nearer than this when flat are one crease."""

EXACT = 1e-12
"""In mean sides: differences of lengths up to this are left as they are."""
ROUNDING = 1e-6
"""In mean sides: larger differences of lengths are faults of the sheet, and stay where they are."""

_PAIRS = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]])
_CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
_MIDDLES = np.array([[1, 0], [2, 1], [1, 2], [0, 1]])


@dataclass(frozen=True, eq=False)
class Development:
    """The facets of charts laid flat; each piece has a position and a heading of its own.

    Parameters
    ----------
    places : (W, 2) float64
        The flat vertices, ordered by piece, row and column.
    vertices : (W,) int64
        The vertex of the charts that each flat vertex is; two or more on seams.
    faces_vertices : (F, 4) int64
        The corners of each facet among the flat vertices.
    pieces : (F,) int64
        The piece of each facet: a chart, or a part of a chart that hangs together by creases.
    """

    places: Floats
    vertices: Ints
    faces_vertices: Ints
    pieces: Ints


def develop(charts: QuadCharts, points: Floats) -> Development:
    """The facets of ``charts`` at ``points`` (V, 3), laid flat piece by piece."""
    creases = creases_of(charts)
    tree = _tree(charts, creases)
    cut = _cut(charts, creases, tree.used)
    corners = _corners(charts, creases[~cut])
    headings, lengths = _headings(points[charts.faces_vertices], tree)
    places = _places(corners, headings, lengths, tree)
    apart = cut.copy()
    apart[cut] = _gaps(places, corners, creases[cut]) > CLOSES * lengths.mean()
    if (apart != cut).any():
        corners = _corners(charts, creases[~apart])
        places = _places(corners, headings, lengths, tree)
    places = _evened(places, corners, points[charts.faces_vertices])
    at = np.empty((len(places), 2), dtype=np.int64)
    at[corners] = charts.cells[:, None, :] + _CORNERS
    piece, vertices = np.empty((2, len(places)), dtype=np.int64)
    piece[corners] = tree.pieces[:, None]
    vertices[corners] = charts.faces_vertices
    order = np.lexsort((at[:, 0], at[:, 1], piece))
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    return Development(places[order], vertices[order], number[corners], tree.pieces)


def creases_of(charts: QuadCharts) -> Ints:
    """(P, 2) the pairs of sides that join two facets of one chart."""
    tails = charts.faces_vertices.ravel()
    heads = np.roll(charts.faces_vertices, -1, axis=1).ravel()
    key = np.minimum(tails, heads) * charts.vertices_count + np.maximum(tails, heads)
    chart = np.repeat(charts.pieces, 4)
    order = np.lexsort((chart, key))
    pairs = np.flatnonzero((np.diff(key[order]) == 0) & (np.diff(chart[order]) == 0))
    creases = np.stack([order[pairs], order[pairs + 1]], axis=1)
    if (np.diff(pairs) == 1).any() or (tails[creases[:, 0]] == tails[creases[:, 1]]).any():
        raise ValueError("two facets of one chart lie on the same side of an edge")
    facets = np.sort(creases // 4, axis=1)
    if len(np.unique(facets, axis=0)) < len(facets):
        raise ValueError("two facets of one chart have two sides in common")
    return creases


def _after(sides: Ints) -> Ints:
    """The next side of the facet of each of ``sides``."""
    return np.where(sides % 4 == 3, sides - 3, sides + 1)


def _corners(charts: QuadCharts, joined: Ints) -> Ints:
    """(F, 4) the flat vertex of each corner: the corners at each of the ``joined`` creases meet."""
    a, b = joined.T
    one, other = np.concatenate([a, _after(a)]), np.concatenate([_after(b), b])
    vertex = components(charts.faces_vertices.size, one, other)
    return vertex.reshape(-1, 4)


@dataclass(frozen=True, eq=False)
class _Tree:
    """The facets in trees that grow from the middle of each piece.

    ``pieces`` (F,) is the piece of each facet, ``roots`` the first facet of each piece, and
    ``used`` (P,) whether a tree uses each crease. ``steps`` are the sides (n, 2) through which the
    facets of each next level are reached: the side of the parent and the side of the facet.
    """

    pieces: Ints
    roots: Ints
    used: Bools
    steps: tuple[Ints, ...]


def _tree(charts: QuadCharts, creases: Ints) -> _Tree:
    count = len(charts.cells)
    facets = creases // 4
    part = components(count, *facets.T)
    _, piece = np.unique(np.stack([charts.pieces, part], axis=1), axis=0, return_inverse=True)
    pieces = piece.reshape(count).astype(np.int64)
    roots = nearest_to_means(charts.cells, pieces)
    middles = (2 * charts.cells[:, None, :] + _MIDDLES).reshape(-1, 2)
    closing = (middles[creases[:, 0]] != middles[creases[:, 1]]).any(axis=1)
    weight = np.where(closing, float(count), 1.0)
    distance, before, link = shortest_ways(count, facets[:, 0], facets[:, 1], weight, roots)
    child = np.flatnonzero(distance > 0)
    child = child[np.argsort(distance[child], kind="stable")]
    used = np.zeros(len(creases), dtype=bool)
    used[link[child]] = True
    own = creases[link[child]]
    sides = np.where((own[:, :1] // 4 == before[child, None]), own, own[:, ::-1])
    levels = np.flatnonzero(np.diff(distance[child]) > 0) + 1
    return _Tree(pieces, roots, used, tuple(np.split(sides, levels)) if len(sides) else ())


def _cut(charts: QuadCharts, creases: Ints, used: Bools) -> Bools:
    """(P,) the creases on the paths between loops of the border; none where a piece has one loop.

    What is off the tree of facets, and ends at a vertex inside, is taken away until nothing does.
    """
    corners = _corners(charts, creases).ravel()
    outer = np.ones(len(corners), dtype=bool)
    outer[creases] = False
    border = np.flatnonzero(outer)
    loose = corners[border], corners[_after(border)]
    node = components(int(corners.max()) + 1, *loose)
    inside = np.ones(int(node.max()) + 1, dtype=bool)
    inside[node[loose[0]]] = False
    ends = node[np.stack([corners[creases[:, 0]], corners[_after(creases[:, 0])]], axis=1)]
    left = np.flatnonzero(~used)
    while True:
        degree = np.bincount(ends[left].ravel(), minlength=len(inside))
        dangling = ((degree == 1) & inside)[ends[left]].any(axis=1)
        if not dangling.any():
            break
        left = left[~dangling]
    cut = np.zeros(len(creases), dtype=bool)
    cut[left] = True
    return cut


def _headings(corners: Floats, tree: _Tree) -> tuple[Floats, Floats]:
    """(F, 4) the headings of all sides of quads with ``corners`` (F, 4, 3), and their lengths.

    A side heads further left than the side before by the turn at their corner, and to the right
    where the quad is not convex. The facet beyond a side runs along that side in the opposite
    direction.
    """
    sides = np.roll(corners, -1, axis=1) - corners
    turns = angle_between(np.roll(sides, 1, axis=1), sides)
    faces = np.arange(4 * len(corners)).reshape(-1, 4)
    turns[reflex_corners(corners.reshape(-1, 3), faces)] *= -1.0
    turns[:, 0] = 0.0
    within = np.cumsum(turns, axis=1)
    first = np.zeros(len(corners))
    for step in tree.steps:
        parent, child = step.T
        turn = within.ravel()[parent] + np.pi - within.ravel()[child]
        # without whole turns, which would grow from facet to facet
        first[child // 4] = first[parent // 4] + turn - 2 * np.pi * np.rint(turn / (2 * np.pi))
    return first[:, None] + within, np.linalg.norm(sides, axis=2)


def _places(corners: Ints, headings: Floats, lengths: Floats, tree: _Tree) -> Floats:
    """(W, 2) the places of the flat vertices ``corners`` (F, 4), each by the first facet at it."""
    along = (lengths[..., None] * np.stack([np.cos(headings), np.sin(headings)], axis=-1)).reshape(
        -1, 2
    )
    at = corners.ravel()
    places = np.zeros((int(at.max()) + 1, 2))
    known = np.zeros(len(places), dtype=bool)
    known[corners[tree.roots, 0]] = True
    second = 4 * tree.roots
    places[at[_after(second)]] = along[second]
    known[at[_after(second)]] = True
    for base in (second, *(step[:, 1] for step in tree.steps)):
        third = _after(_after(base))
        last = _after(third)
        for new, from_, by in (
            (at[third], at[_after(base)], along[_after(base)]),
            (at[last], at[base], -along[last]),
        ):
            fresh = ~known[new]
            places[new[fresh]] = places[from_[fresh]] + by[fresh]
            known[new] = True
    return places


def _evened(places: Floats, corners: Ints, quads: Floats) -> Floats:
    """``places`` (W, 2) moved until sides and diagonals have their lengths in ``quads`` (F, 4, 3).

    One Gauss-Newton step: with unit vectors u along all pairs and r what they lack in length, the
    moves d solve J'J d = J'r, where a row of J is u at one end and -u at the other.
    """
    ends = corners[:, _PAIRS].reshape(-1, 2)
    lengths = np.linalg.norm(np.diff(quads[:, _PAIRS], axis=2)[:, :, 0], axis=2).ravel()
    found = np.linalg.norm(np.diff(places[ends], axis=1)[:, 0], axis=1)
    worst = float(np.abs(lengths - found).max() / lengths.mean())
    if not EXACT < worst <= ROUNDING or not found.all():
        return places
    return evened(places, ends, lengths)


def _gaps(places: Floats, corners: Ints, creases: Ints) -> Floats:
    """(n,) how far the two sides of each of ``creases`` lie apart when flat."""
    at = corners.ravel()
    a, b = creases.T
    ends = (places[at[a]] - places[at[_after(b)]], places[at[_after(a)]] - places[at[b]])
    return np.asarray(np.linalg.norm(ends, axis=2).max(axis=0))
