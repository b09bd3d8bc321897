"""Rulings beside curved creases: the lines along which the paper there bends.

At a vertex where two folds meet, not quite in line, rigid facets cannot fold. The paper beside a
curved crease bends, and is straight along rulings. Of a plane curve that folds by one angle all
along, the rulings are perpendicular to the crease (D. Fuchs and S. Tabachnikov, More on
paperfolding, American Mathematical Monthly 106, 1999). So from each corner of the crease a ruling
runs to either side, in the middle of the angle there, up to the next line. Such a corner, with two
folds and two rulings, folds exactly (it meets Kawasaki's condition).

A ruling that comes to a curve ends at the nearer corner of that curve, so that the paper between
two curves is ruled from corner to corner. Where the crease is hollow rulings may meet; then the
shorter one stays.
"""

from __future__ import annotations

import math

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern

BEND = math.radians(60.0)
"""The largest turn of a curved crease at one of its corners; at a larger one the crease is kinked.
"""

_CLOSE = 0.25
"""An end of a ruling this near to a corner, as a part of the line that it starts from, is there."""


def rulings(pattern: CreasePattern, curved: Bools) -> Floats:
    """(n, 2, 2) the rulings of ``pattern`` beside its ``curved`` edges (E,), mm."""
    folds = np.isin(pattern.edges_assignment, ("M", "V"))
    found: list[Floats] = []
    seen: set[tuple[int, int]] = set()
    for face, edges in zip(pattern.faces_vertices, pattern.faces_edges, strict=True):
        corners = face[face >= 0]
        sides = edges[: len(corners)]
        if len(corners) > 3 and (curved & folds)[sides].any():
            found += _of_facet(pattern.vertices_coords, corners, curved[sides], folds[sides], seen)
    return np.array(found).reshape(-1, 2, 2)


def _of_facet(
    points: Floats, corners: Ints, curved: Bools, folds: Bools, seen: set[tuple[int, int]]
) -> list[Floats]:
    """The rulings of the facet of ``corners`` (k,) whose sides from corner to corner are ``curved``
    and ``folds`` (k,); ``seen`` holds the pairs of vertices that are joined already.
    """
    p = points[corners]
    count = len(p)
    along = np.roll(p, -1, axis=0) - p
    length = np.linalg.norm(along, axis=1)
    unit = along / length[:, None]
    before = np.roll(unit, 1, axis=0)
    turn = np.abs(np.arctan2(_cross(before, unit), (before * unit).sum(axis=1)))
    both = folds & np.roll(folds, 1)
    bent = both & (curved | np.roll(curved, 1)) & (turn < BEND)
    rays = []
    for corner in np.flatnonzero(bent).tolist():
        tangent = before[corner] + unit[corner]
        inward = np.array([-tangent[1], tangent[0]]) / np.linalg.norm(tangent)
        step = min(length[corner], length[corner - 1])
        hit = _first_hit(p, along, curved, corner, inward, _CLOSE * step)
        if hit is not None:
            end, at = hit
            rays.append((float(np.linalg.norm(end - p[corner])), corner, at, end))
    kept: list[Floats] = []
    for _, corner, at, end in sorted(rays, key=lambda ray: ray[:2]):
        one = int(corners[corner])
        if at >= 0:
            pair = (min(one, int(corners[at])), max(one, int(corners[at])))
            apart = abs(at - corner) not in (0, 1, count - 1)
            if not apart or pair in seen:
                continue
        ray = np.stack([p[corner], end])
        sides = np.stack([p, np.roll(p, -1, axis=0)], axis=1)
        others = np.concatenate([sides, np.array(kept).reshape(-1, 2, 2)])
        if _crossed(ray, others).any():
            continue
        if at >= 0:
            seen.add(pair)
        kept.append(ray)
    return kept


def _first_hit(
    p: Floats, along: Floats, curved: Bools, corner: int, inward: Floats, close: float
) -> tuple[Floats, int] | None:
    """Where the ray from ``corner`` first meets another side, and the corner there, -1 for none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = p - p[corner]
        turn = _cross(np.broadcast_to(inward, along.shape), along)
        far = _cross(offset, along) / turn
        place = _cross(offset, np.broadcast_to(inward, along.shape)) / turn
    own = np.zeros(len(p), dtype=bool)
    own[[corner, corner - 1]] = True
    meets = ~own & (far > 0) & (place >= 0) & (place <= 1)
    if not meets.any():
        return None
    side = int(np.argmin(np.where(meets, far, np.inf)))
    nearer = side if place[side] < 0.5 else (side + 1) % len(p)
    end = p[corner] + far[side] * inward
    if curved[side] or float(np.linalg.norm(p[nearer] - end)) <= close:
        return p[nearer], nearer
    return end, -1


def _crossed(ray: Floats, others: Floats) -> Bools:
    """(n,) whether the ``ray`` (2, 2) crosses each of ``others`` (n, 2, 2) between their ends."""
    a, b = ray
    c, d = others[:, 0], others[:, 1]
    scale = 1e-9 * float(np.linalg.norm(b - a)) * np.linalg.norm(d - c, axis=1)
    one, other = _cross(b - a, c - a), _cross(b - a, d - a)
    first, second = _cross(d - c, a - c), _cross(d - c, b - c)
    return np.asarray(
        (np.minimum(one, other) < -scale)
        & (np.maximum(one, other) > scale)
        & (np.minimum(first, second) < -scale)
        & (np.maximum(first, second) > scale)
    )


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
