"""Sheets of plates that are slit: one mechanism with fewer loops, so that more heights are free.

A sheet without plates as a whole is parted into even blocks of columns and rows of facets. In a
tree of the blocks each keeps two hinges to the next, the two creases at one vertex of their seam;
the other creases of the seams are slits. The vertex that keeps its four hinges is a Bennett linkage
and ties the motions of the two blocks to each other, so that the sheet moves as one mechanism. A
slit vertex closes no loop, and asks nothing of the heights.

Where no slits help, blocks of up to six by six facets are made as mechanisms of their own, whole or
slit. Nothing joins these: axes in common would close the loops that cannot be closed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cut_open import cut_open
from miurafab.origami.folding.bennett import thick_placement
from miurafab.origami.folding.kinematics import states_between

_COUNTS = ((2, 1), (1, 2), (2, 2), (3, 1), (1, 3), (3, 2), (2, 3), (3, 3))
"""Into how many columns and rows of blocks a sheet is slit, one after another."""

_STATES = 12  # in which the width of slits is looked at


@dataclass(frozen=True)
class PlateSeam:
    """What is between two blocks of plates.

    Attributes
    ----------
    blocks : (int, int)
        The two blocks: of a slit patch, numbered row by row, or two loose patches.
    hinges : tuple of int
        The edges of the whole pattern that keep their hinges; none between loose patches.
    slits : tuple of int
        The edges that have none.
    opens_mm : float or None
        How far the edges of two plates come from each other along the slits, at half their
        thickness: in the motion, or of loose patches in the folded form, each laid where it fits
        the thin sheet best.
    patch : int or None
        The patch that is slit; None between loose patches.
    """

    blocks: tuple[int, int]
    hinges: tuple[int, ...]
    slits: tuple[int, ...]
    opens_mm: float | None = None
    patch: int | None = None


def facet_cells(pattern: CreasePattern) -> Ints | None:
    """(F, 2) the column and row of each facet; None where they are not known."""
    if pattern.cells is not None:
        return pattern.cells
    if pattern.grid is None:
        return None
    columns, rows = (count - 1 for count in pattern.grid)
    number = np.arange(columns * rows)
    return np.column_stack([number % columns, number // columns])


def blocks_of(cells: Ints, columns: int, rows: int) -> Ints:
    """(F,) the block of each facet at ``cells`` (F, 2), in even blocks row by row."""
    across, up = (_block(cells[:, axis], count) for axis, count in ((0, columns), (1, rows)))
    _, number = np.unique(up * columns + across, return_inverse=True)
    return np.asarray(number).reshape(-1)


def blocks_up_to(cells: Ints, side: int) -> Ints:
    """(F,) the block of each facet at ``cells`` (F, 2), in blocks of up to ``side`` facets."""
    columns, rows = (math.ceil((int(np.ptp(cells[:, axis])) + 1) / side) for axis in (0, 1))
    return blocks_of(cells, columns, rows)


def slit_sheets(
    pattern: CreasePattern, cells: Ints
) -> Iterator[tuple[CreasePattern, Ints, tuple[PlateSeam, ...]]]:
    """``pattern`` slit in several ways, each with the number (n,) of every edge in the whole
    pattern, and its seams; fewest blocks first.
    """
    size = np.ptp(cells, axis=0) + 1
    for columns, rows in _COUNTS:
        if (size < 2 * np.array([columns, rows])).any():
            continue
        block = blocks_of(cells, columns, rows)
        shared = seams_between(pattern, block)
        vertices = [_seam_vertices(pattern, seam.slits) for seam in shared]
        for place in (0, 1):  # at the end of each seam, in its middle
            joined = _tree(shared, vertices, place)
            seams = tuple(
                replace(seam, hinges=kept, slits=tuple(e for e in seam.slits if e not in kept))
                for seam, kept in zip(shared, joined, strict=True)
            )
            cut = np.array([edge for seam in seams for edge in seam.slits], dtype=np.int64)
            letters = pattern.edges_assignment.copy()
            letters[cut] = "C"
            opened = cut_open(replace(pattern, edges_assignment=letters))
            if opened.pieces_count == 1:
                edges = np.concatenate([np.arange(len(letters)), np.sort(cut)])
                yield opened, edges, seams


def seams_between(pattern: CreasePattern, block: Ints) -> tuple[PlateSeam, ...]:
    """The seams between the blocks of facets ``block`` (F,), as yet without hinges."""
    inner = (pattern.edges_faces >= 0).all(axis=1)
    sides = np.sort(block[pattern.edges_faces], axis=1)
    apart = np.flatnonzero(inner & (sides[:, 0] != sides[:, 1]))
    found: dict[tuple[int, int], list[int]] = {}
    for edge, (one, other) in zip(apart.tolist(), sides[apart].tolist(), strict=True):
        found.setdefault((one, other), []).append(edge)
    return tuple(PlateSeam(pair, (), tuple(edges)) for pair, edges in sorted(found.items()))


def opened_by(
    pattern: CreasePattern, slit: CreasePattern, axis: Floats, middle: Floats, seam: PlateSeam
) -> float:
    """How far the plates on the sides of the slits of ``seam`` come from each other, mm.

    ``axis`` are the heights of the axes of ``slit``, and ``middle`` (F,) of the middles of its
    plates, mm.
    """
    edges = list(seam.slits)
    if not edges:
        return 0.0
    placement = thick_placement(slit, axis, states_between(slit, _STATES))
    ends = pattern.vertices_coords[pattern.edges_vertices[edges]].reshape(-1, 2)
    left, right = np.repeat(pattern.edges_faces[edges], 2, axis=0).T
    places = []
    for facet in (left, right):
        points = np.column_stack([ends, middle[facet]])
        moved = np.einsum("tnij,nj->tni", placement.turn[:, facet], points)
        places.append(moved + placement.shift[:, facet])
    return float(np.linalg.norm(places[0] - places[1], axis=2).max())


def _block(index: Ints, blocks: int) -> Ints:
    """(F,) the number of the block of each of ``index`` (F,), in ``blocks`` even blocks."""
    first = int(index.min())
    return (index - first) * blocks // (int(index.max()) - first + 1)


def _seam_vertices(pattern: CreasePattern, edges: tuple[int, ...]) -> list[tuple[int, int]]:
    """The pairs of ``edges`` of a seam that meet in a vertex, from the border inwards."""
    ends = pattern.edges_vertices[list(edges)]
    borders = np.unique(pattern.edges_vertices[(pattern.edges_faces < 0).any(axis=1)])
    pairs: dict[int, list[int]] = {}
    for edge, two in zip(edges, ends.tolist(), strict=True):
        for vertex in two:
            pairs.setdefault(vertex, []).append(edge)
    places = pattern.vertices_coords[list(pairs)]
    rim = [place for place, v in zip(places, pairs, strict=True) if v in borders]
    start = rim[0] if rim else places[0]
    meeting = [
        (float(np.linalg.norm(place - start)), (own[0], own[1]))
        for place, own in zip(places, pairs.values(), strict=True)
        if len(own) == 2
    ]
    return [pair for _, pair in sorted(meeting)]


def _tree(
    seams: tuple[PlateSeam, ...], vertices: list[list[tuple[int, int]]], place: int
) -> list[tuple[int, ...]]:
    """The edges that each of ``seams`` keeps as hinges, so that the blocks make a tree."""
    group: dict[int, int] = {}
    kept: list[tuple[int, ...]] = []
    for seam, pairs in zip(seams, vertices, strict=True):
        one, other = (group.setdefault(block, block) for block in seam.blocks)
        if one == other or not pairs:
            kept.append(())
            continue
        kept.append(pairs[(len(pairs) - 1) // 2 if place else 0])
        group.update({block: one for block, of in group.items() if of == other})
    return kept
