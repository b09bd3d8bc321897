"""The rim numbers: where each row ends on the rim of a patch, and its number can stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from miurafab.fabrication.kit.rows import CreaseLine
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern


@dataclass(frozen=True, eq=False)
class RimEnd:
    """An end of the row called ``name``: its place ``at`` (2,) in the flat pattern in mm, and the
    unit direction ``out`` (2,) in which the row would go on.
    """

    name: str
    at: Floats
    out: Floats


def rim_ends(
    pattern: CreasePattern, lines: Sequence[CreaseLine], inside: Bools
) -> tuple[RimEnd, ...]:
    """Both ends of each of ``lines`` on the part of the sheet whose facets are ``inside`` (F,)."""
    found = []
    points = pattern.vertices_coords
    for line in lines:
        own = line.edges[inside[pattern.edges_faces[line.edges]].all(axis=1)]
        if not len(own):
            continue
        for edge, following in ((own[0], own[1:2]), (own[-1], own[-2:-1])):
            last, before = _outer_first(pattern, edge, following, at_end=edge is own[-1])
            way = points[last] - points[before]
            found.append(RimEnd(line.name, points[last], way / np.linalg.norm(way)))
    return tuple(found)


def _outer_first(
    pattern: CreasePattern, edge: int, following: Ints, *, at_end: bool
) -> tuple[int, int]:
    """The two vertices of an ``edge`` at the end of a row, that on the rim first."""
    a, b = pattern.edges_vertices[edge].tolist()
    inner = set(pattern.edges_vertices[following].ravel().tolist())
    if a in inner:
        return b, a
    if b in inner:
        return a, b
    return (b, a) if at_end else (a, b)
