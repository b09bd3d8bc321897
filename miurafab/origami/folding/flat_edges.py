"""A pattern of another program without its flat edges: what they part is one facet.

Drawings hold lines that nobody folds (letters F and J): auxiliary lines, and creases of another
state. A sheet moves as if they were not there. With them, a vertex in the middle of a facet adds
bars that say the same twice, and a format that leaves such lines out would give another answer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import signed_areas
from miurafab.origami.crease_pattern import UNCREASED, CreasePattern, restricted
from miurafab.origami.energy.ruled import rulings_among
from miurafab.origami.energy.triangles import facet_triangles
from miurafab.origami.folding.kinematics import FoldingMotion


@dataclass(frozen=True, eq=False)
class Dissolved:
    """The ``pattern`` of the ``vertices`` (v,) and ``edges`` (e,) that are left of the ``whole``.

    The vertices ``inside`` (n,) of facets are left out; they lie in the triangles ``corners``
    (n, 3) of the pattern, at the barycentric coordinates ``places`` (n, 3).
    """

    whole: CreasePattern
    pattern: CreasePattern
    vertices: Ints
    edges: Ints
    inside: Ints
    corners: Ints
    places: Floats

    def lifted(self, motion: FoldingMotion) -> FoldingMotion:
        """``motion`` of the pattern, as one of the whole; flat edges stay flat."""
        if self.pattern is self.whole:
            return motion
        count = len(motion.frames)
        flat = np.pad(self.whole.vertices_coords, ((0, 0), (0, 1)))
        frames = np.repeat(flat[None], count, axis=0)
        frames[:, self.vertices] = motion.frames
        frames[:, self.inside] = np.einsum(
            "nc,tnck->tnk", self.places, motion.frames[:, self.corners]
        )
        angles = np.zeros((count, len(self.whole.edges_vertices)))
        angles[:, self.edges] = motion.fold_angles
        return replace(motion, pattern=self.whole, frames=frames, fold_angles=angles)


def without_flat_edges(pattern: CreasePattern) -> Dissolved:
    """``pattern`` with facets joined over edges of letters F and J where they make one polygon.

    A fitted sheet keeps its facets, as does a part in which a crease ends inside the joined facet.
    """
    vertices, edges = (np.arange(len(a)) for a in (pattern.vertices_coords, pattern.edges_vertices))
    none = np.empty(0, dtype=np.int64)
    corners, places = none.reshape(0, 3), np.empty((0, 3))
    same = Dissolved(pattern, pattern, vertices, edges, none, corners, places)
    if pattern.grid is not None or pattern.cells is not None:
        return same
    flat = _flat_edges(pattern)
    part = components(len(pattern.faces_vertices), *pattern.edges_faces[flat].T)
    one, other = pattern.edges_faces[(pattern.edges_faces >= 0).all(axis=1) & ~flat].T
    ending = part[one[part[one] == part[other]]]  # a crease ends in the middle of the part
    owners = np.split(np.argsort(part, kind="stable"), np.cumsum(np.bincount(part))[:-1])
    loops = {}
    for number in np.setdiff1d(np.flatnonzero(np.bincount(part) > 1), ending).tolist():
        loop = _loop(pattern.faces_vertices[owners[number]])
        if loop is not None:
            loops[number] = loop
    if not loops:
        return same
    return _dissolved(pattern, flat, part, loops)


def _flat_edges(pattern: CreasePattern) -> Bools:
    """(E,) whether an edge between two facets is not folded, by its letter and its angle, and is no
    ruling, about which the paper beside a curved crease bends.
    """
    inner = (pattern.edges_faces >= 0).all(axis=1)
    flat = inner & np.isin(pattern.edges_assignment, UNCREASED) & (pattern.edges_fold_angle == 0)
    flat[np.flatnonzero(flat)] = ~rulings_among(pattern, np.flatnonzero(flat))
    return np.asarray(flat)


def _loop(faces: Ints) -> list[int] | None:
    """The corners around ``faces`` (n, k); None if they make no polygon."""
    following: dict[int, int] = {}
    sides = set()
    for face in faces.tolist():
        corners = [v for v in face if v >= 0]
        sides |= set(zip(corners, corners[1:] + corners[:1], strict=True))
    outer = [side for side in sides if side[::-1] not in sides]
    for tail, head in outer:
        if tail in following:
            return None  # the facets touch themselves in a corner
        following[tail] = head
    start = outer[0][0]
    loop, at = [start], following[start]
    while at != start:
        loop.append(at)
        at = following[at]
    return loop if len(loop) == len(outer) else None  # else there is a hole


def _dissolved(
    pattern: CreasePattern, flat: Bools, part: Ints, loops: dict[int, list[int]]
) -> Dissolved:
    first = np.unique(part, return_index=True)[1]
    joined = np.isin(part, list(loops))
    kept = np.sort(np.concatenate([np.flatnonzero(~joined), first[list(loops)]]))
    polygons = [
        loops[p] if p in loops else [v for v in face if v >= 0]
        for p, face in zip(part[kept].tolist(), pattern.faces_vertices[kept].tolist(), strict=True)
    ]
    width = max(map(len, polygons))
    faces = np.array([polygon + [-1] * (width - len(polygon)) for polygon in polygons])
    vertices = np.unique(faces[faces >= 0])
    gone = flat & joined[pattern.edges_faces[:, 0]]
    edges = np.flatnonzero(~gone)
    pieces, seams = pattern.pieces, pattern.seams
    place = np.cumsum(~gone) - 1
    lean = restricted(
        pattern,
        vertices,
        edges,
        faces,
        pieces=None if pieces is None else pieces[kept],
        seams=None if seams is None else place[seams],
    )
    inside = np.setdiff1d(pattern.edges_vertices, vertices)
    real = pattern.faces_vertices >= 0
    facet_of = np.full(part.max() + 1, -1)
    facet_of[part[kept]] = np.arange(len(kept))
    owner = np.full(len(pattern.vertices_coords), -1)
    owner[pattern.faces_vertices[real]] = np.repeat(facet_of[part], real.sum(axis=1))
    corners, places = _places(lean, pattern.vertices_coords[inside], owner[inside])
    return Dissolved(pattern, lean, vertices, edges, inside, corners, places)


def _places(pattern: CreasePattern, points: Floats, facet: Ints) -> tuple[Ints, Floats]:
    """The triangle (n, 3) of the ``facet`` (n,) of ``pattern`` around each of ``points`` (n, 2),
    of any for -1, and their barycentric coordinates (n, 3) in it.
    """
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    triangles, owner = facet_triangles(flat, pattern.faces_vertices)
    order = np.argsort(owner, kind="stable")
    ends = np.cumsum(np.bincount(owner, minlength=len(pattern.faces_vertices)))
    around, places = np.empty((len(points), 3), dtype=np.int64), np.empty((len(points), 3))
    for number in np.unique(facet).tolist():
        first = ends[number - 1] if number > 0 else 0
        own = triangles if number < 0 else triangles[order[first : ends[number]]]
        here = np.flatnonzero(facet == number)
        around[here], places[here] = _places_in(pattern.vertices_coords[own], own, points[here])
    return around, places


def _places_in(corners: Floats, triangles: Ints, points: Floats) -> tuple[Ints, Floats]:
    """The ``triangles`` (T, 3) with ``corners`` (T, 3, 2) around ``points``, and their places."""
    area = signed_areas(corners)
    shares = np.empty((len(points), len(triangles), 3))
    for corner in range(3):
        sub = np.repeat(corners[None], len(points), axis=0)
        sub[:, :, corner] = points[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            part = signed_areas(sub.reshape(-1, 3, 2)).reshape(shares.shape[:2])
            shares[..., corner] = part / area
    best = np.argmax(np.nan_to_num(shares, nan=-np.inf).min(axis=2), axis=1)
    return triangles[best], shares[np.arange(len(points)), best]
