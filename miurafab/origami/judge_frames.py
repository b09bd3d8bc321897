"""Whether the further frames of a file are states of its sheet.

Each edge must be as long as in the flat pattern. A frame that orders its facets must be the sheet
folded flat, each piece in its place up to a rigid motion, and each pair of facets that overlap must
have the order that the closed form (:mod:`~miurafab.origami.folding.layers`) gives.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from miurafab.findings import Finding, counted
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.layers import LayerOrder, known_layer_order
from miurafab.origami.folding.laying import laid_on
from miurafab.origami.formats.fold_states import FurtherFrame
from miurafab.origami.piece import pieces_of

STRETCH = 1e-6
"""The largest difference in length or place, in mean edges, that the digits of a file explain."""


def judge_frames(pattern: CreasePattern, frames: Sequence[FurtherFrame]) -> Iterator[Finding]:
    """The faults of ``frames``, and what cannot be judged of them."""
    flat = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    apart = [
        np.abs(edge_lengths(frame.points, pattern.edges_vertices) - flat) / flat.mean()
        for frame in frames
    ]
    for code, ordered in (("stretched", False), ("frame", True)):
        own = [n for n, frame in enumerate(frames) if (frame.orders is not None) == ordered]
        stretched = {frames[n].number: apart[n] for n in own if not (apart[n] <= STRETCH).all()}
        if stretched:
            yield _stretched(code, stretched, len(own))
    for frame, off in zip(frames, apart, strict=True):
        if frame.orders is not None and (off <= STRETCH).all():
            yield from _judge_layers(pattern, frame, frame.orders)


def _stretched(code: str, apart: Mapping[int, Floats], count: int) -> Finding:
    """The finding on those of ``count`` frames that stretch the sheet. By the number of each,
    ``apart`` (E,) is how much longer or shorter its edges are, in mean edges.
    """
    worst = max(apart, key=lambda number: float(apart[number].max()))
    edges = np.flatnonzero(~(apart[worst] <= STRETCH))
    which, them = f"Frame {worst} is no state of the sheet", "frame"
    if len(apart) > 1:
        which = (
            f"{len(apart)} of {count} frames are no states of the sheet, and frame {worst} is the "
            "worst"
        )
        them = "frames"
    return Finding(
        code,
        f"{which}: {counted(len(edges), 'of its edges is', 'of its edges are')} up to "
        f"{apart[worst].max():.1e} mean edges longer or shorter than in the flat pattern; write "
        f"the file anew, or take the {them} out.",
        tuple(edges.tolist()),
    )


def _judge_layers(pattern: CreasePattern, frame: FurtherFrame, orders: Ints) -> Iterator[Finding]:
    order = known_layer_order(pattern)
    if order is None:
        yield Finding(
            "not-proven",
            f"Frame {frame.number} orders its facets; the sheet has no order in closed form, so "
            "that this one is not judged.",
        )
        return
    off = _apart(pattern, frame.points, order)
    if not off <= STRETCH:
        yield Finding(
            "frame",
            f"Frame {frame.number} orders its facets and is not the sheet folded flat: vertices "
            f"are up to {off:.2g} mean edges off; write the file anew, or take the frame out.",
        )
    wrong = _signs(orders) ^ _signs(order.face_orders())
    if wrong:
        pairs = {pair[:2] for pair in wrong}
        one, other = min(pairs)
        yield Finding(
            "frame",
            f"Frame {frame.number} has another order of layers than the sheet for "
            + counted(len(pairs), "pair of facets", "pairs of facets")
            + f", the first being {one} and {other}; write the file anew, or take the frame out.",
            tuple(sorted({facet for pair in pairs for facet in pair})),
        )


def _signs(orders: Ints) -> set[tuple[int, int, int]]:
    """The triples of ``orders`` that say something."""
    return {(f, g, s) for f, g, s in orders.tolist() if s}


def _apart(pattern: CreasePattern, points: Floats, order: LayerOrder) -> float:
    """How far ``points`` (V, 3) are from the sheet folded flat, in mean edges, each piece moved to
    it as a rigid body, which may turn it over.
    """
    there = np.column_stack([order.folded.vertices, np.zeros(len(points))])
    mean = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    sides = (points, points * [1.0, -1.0, -1.0])  # what lies in a plane is moved within it
    off = [
        min(
            np.linalg.norm(laid_on(side[own], there[own]) - there[own], axis=1).max()
            for side in sides
        )
        for own in (piece.vertices for piece in pieces_of(pattern))
    ]
    return float(max(off)) / mean
