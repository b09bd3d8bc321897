"""What is drawn on the pieces: creases as dashes, texts, and cut lines, on the sheet they lie on.

Everything is made in the pattern's plane, where a crease is one edge, and then moved with its
piece. A crease within a piece is perforated there. A seam is perforated on the piece that bears
its tab, along the tab's base, and cut on the other one; a seam without a tab is cut on both. So
every crease is perforated once or not at all, and nothing is drawn twice.

Mountains, valleys and creases not yet assigned (M, V, U) are perforated; flat edges and joins
(F, J) are left alone; a cut within a piece (C, or a border between two facets) is cut in full.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from miurafab.fabrication.labels import Text
from miurafab.fabrication.ordering import Strokes
from miurafab.fabrication.perforation import perforate
from miurafab.fabrication.pieces import Pieces
from miurafab.fabrication.toolpath import Toolpath
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import OPERATIONS, Material

FOLDED = ("M", "V", "U")
SLIT = ("B", "C")

_INNER, _WASTE, _OUTER = 0, 1, 2
"""Ranks among cuts: slits within a piece, rings around waste, outlines."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Where the P patches go: q = ``matrix`` (P, 2, 2) p + ``shift`` (P, 2) for a point p of the
    pattern, and the number of the ``sheet`` (P,).
    """

    matrix: NDArray[np.float64]
    shift: NDArray[np.float64]
    sheet: NDArray[np.int64]


def sheet_strokes(
    pattern: CreasePattern,
    pieces: Pieces,
    texts: Sequence[Text],
    motion: Motion,
    material: Material,
    sheets: Sequence[tuple[str, float, float]],
) -> list[Strokes]:
    """The strokes of each sheet, in no order yet; ``sheets`` are names, widths and heights."""
    parts = [
        _engraved(texts),
        _perforated(pattern, pieces, material),
        _slits(pattern, pieces),
        _outlines(pieces),
    ]
    count = np.concatenate([part.count for part in parts])
    patch = np.concatenate([part.patch for part in parts])
    points = np.concatenate([part.points for part in parts])
    which = np.repeat(patch, count)
    moved = np.einsum("nij,nj->ni", motion.matrix[which], points) + motion.shift[which]
    operation = np.repeat([part.operation for part in parts], [len(part.count) for part in parts])
    edge = np.concatenate([part.edge for part in parts])
    rank = np.concatenate([part.rank for part in parts])
    group = np.concatenate([part.group for part in parts])
    found = []
    for number, (name, width, height) in enumerate(sheets):
        here = motion.sheet[patch] == number
        toolpath = Toolpath(
            sheet=name,
            width_mm=width,
            height_mm=height,
            points=moved[np.repeat(here, count)],
            offsets=np.concatenate([[0], np.cumsum(count[here])]),
            operation=operation[here],
            patch=patch[here],
            edge=edge[here],
        )
        found.append(Strokes(toolpath, group[here], rank[here]))
    return found


@dataclass(frozen=True, eq=False)
class _Part:
    """S strokes of one operation in the pattern's plane."""

    operation: int
    points: NDArray[np.float64]
    count: NDArray[np.int64]
    patch: NDArray[np.int64]
    edge: NDArray[np.int64]
    group: NDArray[np.int64]
    rank: NDArray[np.int64]


def _engraved(texts: Sequence[Text]) -> _Part:
    strokes = [stroke for text in texts for stroke in text.strokes]
    each = np.array([len(text.strokes) for text in texts], dtype=np.int64)
    patch = np.repeat(np.array([text.patch for text in texts], dtype=np.int64), each)
    return _Part(
        operation=OPERATIONS.index("engrave"),
        points=np.concatenate([np.empty((0, 2)), *strokes]),
        count=np.array([len(stroke) for stroke in strokes], dtype=np.int64),
        patch=patch,
        edge=np.full(len(strokes), -1),
        group=np.repeat(np.arange(len(texts)), each),
        rank=np.zeros(len(strokes), dtype=np.int64),
    )


def _perforated(pattern: CreasePattern, pieces: Pieces, material: Material) -> _Part:
    edges, patch = _inner_edges(pattern, pieces, FOLDED)
    ends = pattern.vertices_coords[pattern.edges_vertices[edges]]
    tabs = pieces.tabs.take(np.isin(pattern.edges_assignment[pieces.tabs.edge], FOLDED))
    base = tabs.points[:, :2]
    way = np.diff(pattern.vertices_coords[pattern.edges_vertices[tabs.edge]], axis=1)[:, 0]
    backwards = np.einsum("ni,ni->n", base[:, 1] - base[:, 0], way) < 0
    base = np.where(backwards[:, None, None], base[:, ::-1], base)
    ends = np.concatenate([ends, base])
    edges = np.concatenate([edges, tabs.edge])
    patch = np.concatenate([patch, pieces.face_patch[tabs.own_face]])
    dashes = perforate(ends[:, 0], ends[:, 1], material)
    return _Part(
        operation=OPERATIONS.index("perforate"),
        points=np.stack([dashes.starts, dashes.ends], axis=1).reshape(-1, 2),
        count=np.full(len(dashes), 2),
        patch=patch[dashes.crease],
        edge=edges[dashes.crease],
        group=dashes.crease,
        rank=np.zeros(len(dashes), dtype=np.int64),
    )


def _slits(pattern: CreasePattern, pieces: Pieces) -> _Part:
    edges, patch = _inner_edges(pattern, pieces, SLIT)
    return _Part(
        operation=OPERATIONS.index("cut"),
        points=pattern.vertices_coords[pattern.edges_vertices[edges]].reshape(-1, 2),
        count=np.full(len(edges), 2),
        patch=patch,
        edge=edges,
        group=np.arange(len(edges)),
        rank=np.full(len(edges), _INNER),
    )


def _outlines(pieces: Pieces) -> _Part:
    rings, patch, rank = [], [], []
    for number, piece in enumerate(pieces.pieces):
        for place, ring in enumerate(piece.cut_lines):
            rings.append(np.concatenate([ring, ring[:1]]))
            patch.append(number)
            rank.append(_WASTE if place else _OUTER)
    return _Part(
        operation=OPERATIONS.index("cut"),
        points=np.concatenate(rings),
        count=np.array([len(ring) for ring in rings]),
        patch=np.array(patch),
        edge=np.full(len(rings), -1),
        group=np.arange(len(rings)),
        rank=np.array(rank),
    )


def _inner_edges(
    pattern: CreasePattern, pieces: Pieces, assignments: Sequence[str]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The edges between two facets of one patch that are so assigned, and that patch."""
    faces = pattern.edges_faces
    patch = np.where(faces >= 0, pieces.face_patch[faces], -1)
    inner = (patch[:, 0] == patch[:, 1]) & np.isin(pattern.edges_assignment, assignments)
    edges = np.flatnonzero(inner)
    return edges, patch[edges, 0]
