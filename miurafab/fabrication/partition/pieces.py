"""The pieces of a pattern, each as a pattern of its own for the split.

A piece is what hangs together in the flat pattern. Where pieces lie in the flat pattern means
nothing: they lie apart with air between them, and each is split by itself. Tabs on the seams
between pieces stand on the border of a piece, so they come along with it.

Facets may have places in the lattice of the tessellation. They tell the lines along which a piece
is best cut; facets of a piece without gaps form a grid of rows and columns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from miurafab.fabrication.tabs import TabRegions
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.connected import components
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.piece import Piece, piece_of, pieces_of


@dataclass(frozen=True, eq=False)
class StandingTabs:
    """N tabs on the border of a piece: ``face`` (N,) the facet that bears each, ``points``
    (N, m, 2) its corners in mm, of which those ``present`` (N, m) are real.
    """

    face: Ints
    points: Floats
    present: Bools

    def of(self, facets: Ints) -> StandingTabs:
        """The tabs on ``facets`` (n,), which are numbered in this order."""
        place = np.full(max(int(facets.max()), int(self.face.max(initial=0))) + 1, -1)
        place[facets] = np.arange(len(facets))
        own = place[self.face]
        which = own >= 0
        return StandingTabs(own[which], self.points[which], self.present[which])


def standing(tabs: TabRegions) -> StandingTabs:
    """All of ``tabs``."""
    return StandingTabs(tabs.own_face, tabs.points, tabs.present)


def hanging_together(pattern: CreasePattern) -> list[Piece]:
    """The pieces in the order of their numbers, then of their lowest facets. Their cells are those
    of the lattice of the whole pattern.
    """
    label = facet_components(pattern)
    numbers = label if pattern.pieces is None else pattern.pieces
    first = np.unique(label, return_index=True)[1]
    order = first[np.lexsort((first, numbers[first]))]
    whole = replace(pattern, cells=lattice_cells(pattern))
    if len(order) == 1:
        return list(pieces_of(replace(whole, pieces=None)))
    return [piece_of(whole, np.flatnonzero(label == label[facet])) for facet in order.tolist()]


def facet_components(pattern: CreasePattern) -> Ints:
    """(F,) what hangs together in the flat pattern, numbered by its lowest facet."""
    pairs = pattern.edges_faces[(pattern.edges_faces >= 0).all(axis=1)]
    return components(len(pattern.faces_vertices), *pairs.T)


def lattice_cells(pattern: CreasePattern) -> Ints | None:
    """(F, 2) the column and row of each facet, from 0; None if the facets have no such places."""
    if pattern.cells is not None:
        return np.asarray(pattern.cells - pattern.cells.min(axis=0))
    if pattern.grid is None:
        return None
    columns, rows = pattern.grid
    faces = pattern.faces_vertices
    if len(faces) != (columns - 1) * (rows - 1) or faces.shape[1] != 4:
        return None
    low = faces.min(axis=1)
    cell = np.column_stack([low, low + 1, low + columns, low + columns + 1])
    row, column = np.divmod(low, columns)
    regular = (np.sort(faces, axis=1) == cell).all(axis=1) & (column < columns - 1)
    if not regular.all() or (row >= rows - 1).any() or len(np.unique(low)) != len(faces):
        return None
    return np.column_stack([column, row])


def full_grid(pattern: CreasePattern) -> Ints | None:
    """(R, C) the facet in each cell of a piece whose cells fill a rectangle, each joined to the
    next in its row and column; None for other pieces.
    """
    if pattern.cells is None:
        return None
    place = pattern.cells - pattern.cells.min(axis=0)
    columns, rows = (place.max(axis=0) + 1).tolist()
    number = place[:, 1] * columns + place[:, 0]
    if len(number) != columns * rows or len(np.unique(number)) != len(number):
        return None
    pairs = pattern.edges_faces[(pattern.edges_faces >= 0).all(axis=1)]
    step = np.abs(np.diff(place[pairs], axis=1)[:, 0]).sum(axis=1)
    if (step != 1).any() or len(pairs) != rows * (columns - 1) + (rows - 1) * columns:
        return None
    cells = np.empty(columns * rows, dtype=np.int64)
    cells[number] = np.arange(len(number))
    return cells.reshape(rows, columns)
