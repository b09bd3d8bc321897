"""The rows of a sheet: the lines of creases that a person folds one after another.

Each facet has a column and a row in the lattice of the tessellation. A crease between two rows of
facets is of a row line, R1 between the first two; a crease between two columns is of a column line,
C1. In a Miura sheet the one family runs nearly straight and changes between mountain and valley at
each crossing. The other family zigzags, and each of its lines is of one kind from rim to rim.

The straighter family is creased first: its lines can be folded over in one go. Within a family the
lines go from rim to rim. So the order is that of :func:`crease_lines`, and each line stands in it
once. Creases of a cap, and of a
pattern without a lattice, are of no line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from miurafab.fabrication.partition.pieces import lattice_cells
from miurafab.fabrication.wording import runs
from miurafab.geometry.arrays import Bools, Floats, Ints, run_starts
from miurafab.origami.crease_pattern import CreasePattern

FAMILIES = ("C", "R")
"""Column lines, and row lines."""
FOLDED = ("M", "V")
DIGITS = 2
"""Decimals of a degree in ``layout.json``; a gauge of paper shows no tenth."""


@dataclass(frozen=True, eq=False)
class CreaseLine:
    """One line of creases, from rim to rim.

    ``family`` is R or C and ``number`` counts from 1. ``edges`` (n,) are the pattern's, in order
    along the line, and ``letters`` their assignments, M or V. ``angles`` (n,) are the sizes of
    their fold angles in radians.
    """

    family: str
    number: int
    edges: Ints
    letters: str
    angles: Floats

    @property
    def name(self) -> str:
        return f"{self.family}{self.number}"

    @property
    def fold(self) -> str:
        """M or V where all creases are of one kind, else MV."""
        return "".join(letter for letter in FOLDED if letter in self.letters)


@dataclass(frozen=True)
class Row:
    """What is told of a line: its name, its fold (M, V or MV), and its fold angles in degrees: the
    median, the least and the greatest over its creases.
    """

    name: str
    fold: str
    median_deg: float
    least_deg: float
    greatest_deg: float


def row_of(line: CreaseLine) -> Row:
    """The summary of a line."""
    found = np.degrees([np.median(line.angles), line.angles.min(), line.angles.max()])
    return Row(line.name, line.fold, *np.round(found, DIGITS).tolist())


def read_row(table: dict[str, Any]) -> Row:
    """A row of ``layout.json``."""
    angles = (float(table[key]) for key in ("median_deg", "least_deg", "greatest_deg"))
    return Row(str(table["name"]), str(table["fold"]), *angles)


def crease_lines(pattern: CreasePattern) -> tuple[CreaseLine, ...]:
    """All lines of ``pattern`` in the order in which they are creased."""
    cells = lattice_cells(pattern)
    if cells is None:
        return ()
    pieces = np.zeros(len(cells), np.int64) if pattern.pieces is None else pattern.pieces
    edges = np.flatnonzero(_folded(pattern) & ~_of_caps(pattern, pieces))
    pair = cells[pattern.edges_faces[edges]]
    step = np.abs(pair[:, 1] - pair[:, 0])
    piece = pieces[pattern.edges_faces[edges, 0]]
    families = []
    for axis, family in enumerate(FAMILIES):
        on = np.flatnonzero((step[:, axis] == 1) & (step[:, 1 - axis] == 0))
        number, along = pair[on, :, axis].max(axis=1), pair[on, 0, 1 - axis]
        order = np.lexsort((along, piece[on], number))
        starts = run_starts(np.unique(number, return_counts=True)[1])
        parts = np.split(edges[on][order], starts[1:]) if len(on) else []
        first = int(cells[:, axis].min())
        at = np.unique(number) - first
        families.append([_line(pattern, family, k, own) for k, own in zip(at, parts, strict=True)])
    families.sort(key=lambda lines: bend_of(pattern, lines))
    return tuple(line for lines in families for line in lines)


def _folded(pattern: CreasePattern) -> Bools:
    """(E,) whether an edge is a crease between two facets."""
    inner = (pattern.edges_faces >= 0).all(axis=1)
    return np.asarray(inner & np.isin(pattern.edges_assignment, FOLDED))


def _of_caps(pattern: CreasePattern, pieces: Ints) -> Bools:
    """(E,) whether an edge is of a cap: a piece of triangles alone, beside pieces of others."""
    corners = (pattern.faces_vertices >= 0).sum(axis=1)
    round_ = np.bincount(pieces[corners > 3], minlength=int(pieces.max()) + 1) == 0
    caps = round_ & ~round_.all()
    return np.asarray(caps[pieces[pattern.edges_faces.max(axis=1)]])


def _line(pattern: CreasePattern, family: str, number: int, edges: Ints) -> CreaseLine:
    letters = "".join(pattern.edges_assignment[edges].tolist())
    return CreaseLine(family, int(number), edges, letters, np.abs(pattern.edges_fold_angle[edges]))


def unnumbered(pattern: CreasePattern, lines: Sequence[CreaseLine]) -> int:
    """The number of creases that are of no line."""
    return int(_folded(pattern).sum()) - sum(len(line.edges) for line in lines)


def bend_of(pattern: CreasePattern, lines: Sequence[CreaseLine]) -> float:
    """The median angle in radians by which ``lines`` turn from a crease to the next, on paper."""
    ends, points = pattern.edges_vertices, pattern.vertices_coords
    turns = [np.empty(0)]
    for line in lines:
        way = points[ends[line.edges, 1]] - points[ends[line.edges, 0]]
        next_to = (ends[line.edges[1:], :, None] == ends[line.edges[:-1], None, :]).any(axis=(1, 2))
        cross = way[:-1, 0] * way[1:, 1] - way[:-1, 1] * way[1:, 0]
        dot = (way[:-1] * way[1:]).sum(axis=1)
        turn = np.arctan2(np.abs(cross), np.abs(dot))
        turns.append(turn[next_to])
    found = np.concatenate(turns)
    return float(np.median(found)) if len(found) else 0.0


def named(names: Sequence[str]) -> str:
    """``C1-C4, C7, R2``: names of lines, runs of them drawn together."""
    families = ([name for name in names if name[0] == family] for family in FAMILIES)
    return ", ".join(runs(own) for own in families if own)


def numbered(numbers: Sequence[int], family: str) -> str:
    """``R1, R3 ... R11``: numbers of a family; those in even steps drawn together."""
    steps = set(np.diff(numbers).tolist())
    if len(numbers) > 3 and len(steps) == 1 and steps != {1}:
        return f"{family}{numbers[0]}, {family}{numbers[1]} ... {family}{numbers[-1]}"
    return named([f"{family}{number}" for number in numbers])
