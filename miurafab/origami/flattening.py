"""A sheet of facets of any shape laid flat from its folded form alone.

Facets are laid beside each other over a tree that grows breadth-first from one of them. A facet
keeps its shape and comes to lie along its side to the one before. Where the sheet is developable
the other creases close as well; what rounding leaves open there is spread evenly over all sides and
diagonals by least squares (Gauss and Newton).

A sheet that closes on itself, or that has a hole, may not close when flat. The creases off the tree
form paths between the loops of its border; along the paths that do not close the sheet is opened.
What has an interior vertex whose angles do not add up to 360 degrees does not lie flat at all.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from miurafab.errors import PatternError
from miurafab.findings import Finding
from miurafab.geometry.arrays import Bools, Floats, Ints, nearest_to_means, vector_product
from miurafab.geometry.connected import components, shortest_ways
from miurafab.geometry.evening import evened
from miurafab.geometry.polygons import (
    connected_parts,
    edge_lengths,
    facet_areas,
    facet_normals,
    filled,
    next_corners,
    reversed_faces,
    sides_and_diagonals,
    smallest_box,
)
from miurafab.origami import invariants
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cut_open import cut_open
from miurafab.origami.piece import shelved

ROUGHEST = 1e-3
"""The largest residual that the digits of a file may explain; more is a fault of the shape."""

_GAP = 1e-2
"""In mean edges: a crease whose two sides lie farther apart when flat does not close."""
_ROUNDS = 4


def one_sided(faces: Ints, edges: Ints, cut: Bools, vertices: int) -> Ints:
    """``faces`` (F, k) turned so that neighbours show the same side, the first of each part as it
    is. ``cut`` (E,) tells which of ``edges`` (E, 2) join nothing.

    Raises :class:`~miurafab.errors.PatternError` for an edge of three facets, and for a sheet that
    closes on itself with a twist.
    """
    face, slot = np.nonzero(faces >= 0)
    tail = faces[face, slot]
    head = np.take_along_axis(faces, next_corners(faces), axis=1)[face, slot]
    key = np.minimum(tail, head) * vertices + np.maximum(tail, head)
    keys = edges.min(axis=1) * vertices + edges.max(axis=1)
    order = np.lexsort((face, key))
    key, face, forward = key[order], face[order], (tail < head)[order]
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    sizes = np.diff(np.append(starts, len(key)))
    if (sizes > 2).any():
        at = starts[np.argmax(sizes > 2)]
        one, other = divmod(int(key[at]), vertices)
        raise PatternError(
            f"{sizes.max()} facets meet at the edge of vertices {one} and {other}; a sheet of "
            "paper has two there at most. Give each sheet vertices of its own."
        )
    pair = starts[(sizes == 2) & ~np.isin(key[starts], keys[cut])]
    one, other = face[pair], face[pair + 1]
    against = forward[pair] == forward[pair + 1]  # both facets run along the edge the same way
    count = len(faces)
    # a facet and its reverse are two nodes; an edge joins those that show the same side
    here = np.concatenate([one, one + count])
    there = np.concatenate(
        [np.where(against, other + count, other), np.where(against, other, other + count)]
    )
    label = components(2 * count, here, there)
    twisted = np.flatnonzero(label[:count] == label[count:])
    if len(twisted):
        raise PatternError(
            f"The sheet of facet {twisted[0]} closes on itself with a twist, so it has one side "
            "alone and does not lie flat; cut it across (letter C) where it shall be glued."
        )
    part = components(count, one, other)
    first = np.full(int(part.max()) + 1, count, dtype=np.int64)
    np.minimum.at(first, part, np.arange(count))
    turned = label[:count] != label[first[part]]
    return np.where(turned[:, None], reversed_faces(faces), faces)


def flattened(pattern: CreasePattern) -> CreasePattern:
    """``pattern``, whose folded form is known, with its flat form computed from that.

    Facets run the same way round over each part of the sheet (:func:`one_sided`). The flat
    coordinates that ``pattern`` has count for nothing. Cuts (C), and the seams at which a sheet
    that closes on itself has to be opened, get vertices on either side. ``unfolded`` is the largest
    residual that is left.

    Raises :class:`~miurafab.errors.PatternError` for a sheet that is not developable, naming the
    worst place and how far it is off there.
    """
    opened = cut_open(pattern)
    assert opened.folded_coords is not None
    _refuse_bent(opened)
    corners, used = _laid(opened)
    gap = _gaps(opened, corners)
    loose = _paths(opened, used) & (gap > _GAP)
    if loose.any():
        letters = np.where(loose, "C", opened.edges_assignment)
        told = (*opened.told, _told_of_seams(int(loose.sum())))
        opened = replace(cut_open(replace(opened, edges_assignment=letters)), told=told)
        corners, used = _laid(opened)
    elif (gap > _GAP).any():
        raise _not_flat(opened)
    count, part = connected_parts(opened.faces_vertices)
    flat = _evened(opened, _met(opened, corners))
    opened = replace(
        opened,
        vertices_coords=_upright(flat, opened, part),
        pieces=part if count > 1 else None,
    )
    left = invariants.residuals(opened).worst
    if left > ROUGHEST:
        raise _not_flat(opened)
    return replace(opened, unfolded=left)


def _told_of_seams(count: int) -> Finding:
    """What is told of a sheet that is opened where it closes on itself."""
    edges = "one edge" if count == 1 else f"{count} edges"
    says = f"The sheet closes on itself, so it is opened at {edges} to lie flat."
    return Finding("opened", says)


def _refuse_bent(pattern: CreasePattern) -> None:
    """Refuse facets that are not flat, and interior vertices that are not developable."""
    points = pattern.folded_coords
    assert points is not None
    if not (facet_areas(points, pattern.faces_vertices) > 0).all():
        lone = int(np.argmin(facet_areas(points, pattern.faces_vertices)))
        raise PatternError(
            f"Facet {lone} has no area in the folded form, so its shape does not tell how it lies "
            "when flat; take it out, or give a flat pattern."
        )
    bent = invariants.facet_planarity(pattern, points)
    if bent.max() > ROUGHEST:
        worst = int(bent.argmax())
        raise PatternError(
            f"Facet {worst} is not flat in the folded form: its corners are up to "
            f"{bent[worst]:.2g} mean edges off their plane, so the sheet cannot be unfolded "
            "without stretching; divide it into triangles if it bends."
        )
    inner = invariants.interior_vertices(pattern)
    if not len(inner):
        return
    off = invariants.angle_defect(invariants.corner_ring(pattern, points), inner)
    if np.abs(off).max() > ROUGHEST:
        worst = int(np.abs(off).argmax())
        many = int((np.abs(off) > ROUGHEST).sum())
        raise PatternError(
            f"The folded form is not developable at {many} of {len(inner)} interior vertices: the "
            f"angles at vertex {inner[worst]} add up to {360 - math.degrees(off[worst]):.6g} "
            "degrees and not to 360. Cut it open (letter C) along edges from there to the border, "
            "or fit it as a surface."
        )


def _laid(pattern: CreasePattern) -> tuple[Floats, Bools]:
    """(F, k, 2) the corners of the facets, each laid flat beside the one before over a tree, and
    (E,) whether the tree uses each edge.
    """
    faces, points = pattern.faces_vertices, pattern.folded_coords
    assert points is not None
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    pair = pattern.edges_faces[inner]
    count = len(faces)
    corners = _in_their_planes(points, faces)
    used = np.zeros(len(pattern.edges_vertices), dtype=bool)
    part = components(count, *pair.T)
    roots = nearest_to_means(points[filled(faces)].mean(axis=1), part)
    # two facets with several edges in common are joined by the first of them
    hops, before, link = shortest_ways(count, pair[:, 0], pair[:, 1], np.ones(len(pair)), roots)
    for facet in np.argsort(hops, kind="stable")[len(roots) :].tolist():
        parent = int(before[facet])
        edge = int(inner[link[facet]])
        used[edge] = True
        ends = pattern.edges_vertices[edge]
        goal = np.array([corners[parent][np.argmax(faces[parent] == v)] for v in ends])
        have = np.array([corners[facet][np.argmax(faces[facet] == v)] for v in ends])
        corners[facet] = _brought(corners[facet], have, goal)
    return corners, used


def _in_their_planes(points: Floats, faces: Ints) -> Floats:
    """(F, k, 2) the corners of each facet in its own plane, seen from where its normal points."""
    normal = facet_normals(points, faces)
    places = points[filled(faces)]
    spokes = places - places[:, :1]
    far = np.linalg.norm(spokes, axis=2).argmax(axis=1)
    x = spokes[np.arange(len(faces)), far]
    x = x - np.einsum("fk,fk->f", x, normal)[:, None] * normal
    x /= np.linalg.norm(x, axis=1)[:, None]
    y = vector_product(normal, x)
    return np.stack([np.einsum("fck,fk->fc", spokes, axis) for axis in (x, y)], axis=-1)


def _brought(corners: Floats, have: Floats, goal: Floats) -> Floats:
    """``corners`` (k, 2) moved rigidly so that the side ``have`` (2, 2) comes to lie on ``goal``,
    the middles and the directions together.
    """
    (x, y), (u, v) = have[1] - have[0], goal[1] - goal[0]
    angle = math.atan2(x * v - y * u, x * u + y * v)
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    return np.asarray((corners - have.mean(axis=0)) @ turn + goal.mean(axis=0))


def _gaps(pattern: CreasePattern, corners: Floats) -> Floats:
    """(E,) how far each edge of a facet lies from that of the other, in mean edges."""
    assert pattern.folded_coords is not None
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    gap = np.zeros(len(pattern.edges_vertices))
    for end in (0, 1):
        vertex = pattern.edges_vertices[inner, end]
        places = []
        for side in (0, 1):
            facet = pattern.edges_faces[inner, side]
            slot = (pattern.faces_vertices[facet] == vertex[:, None]).argmax(axis=1)
            places.append(corners[facet, slot])
        gap[inner] = np.maximum(gap[inner], np.linalg.norm(places[0] - places[1], axis=1))
    return gap / float(edge_lengths(pattern.folded_coords, pattern.edges_vertices).mean())


def _paths(pattern: CreasePattern, used: Bools) -> Bools:
    """(E,) the creases off the tree on paths between loops of the border.

    A loop of the border is one node. Creases that end at an interior vertex of no other crease are
    taken away until none does.
    """
    inner = (pattern.edges_faces >= 0).all(axis=1)
    ends = pattern.edges_vertices
    rim = ends[~inner]
    node = components(len(pattern.vertices_coords), *rim.T)
    free = np.ones(int(node.max()) + 1, dtype=bool)
    free[node[rim.ravel()]] = False
    left = np.flatnonzero(inner & ~used)
    while True:
        at = node[ends[left]]
        degree = np.bincount(at.ravel(), minlength=len(free))
        dangling = ((degree == 1) & free)[at].any(axis=1)
        if not dangling.any():
            break
        left = left[~dangling]
    found = np.zeros(len(ends), dtype=bool)
    found[left] = True
    return found


def _met(pattern: CreasePattern, corners: Floats) -> Floats:
    """(V, 2) the vertices, each in the mean of its corners."""
    real = pattern.faces_vertices >= 0
    vertex = pattern.faces_vertices[real]
    sums = np.zeros((len(pattern.vertices_coords), 2))
    np.add.at(sums, vertex, corners[real])
    return np.asarray(sums / np.maximum(np.bincount(vertex, minlength=len(sums)), 1)[:, None])


def _evened(pattern: CreasePattern, flat: Floats) -> Floats:
    """``flat`` (V, 2) moved until sides and diagonals have, by least squares, their lengths in the
    folded form.
    """
    assert pattern.folded_coords is not None
    pairs = np.concatenate([ends for _, ends in sides_and_diagonals(pattern.faces_vertices)])
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    goal = edge_lengths(pattern.folded_coords, pairs)
    pairs, goal = pairs[goal > 0], goal[goal > 0]
    best, least = flat, np.inf
    for _ in range(_ROUNDS):
        found = np.linalg.norm(flat[pairs[:, 1]] - flat[pairs[:, 0]], axis=1)
        worst = float(np.abs(goal - found).max())
        if not worst < least or not found.all():
            break
        best, least = flat, worst
        flat = evened(flat, pairs, goal)
    return best


def _upright(flat: Floats, pattern: CreasePattern, part: Ints) -> Floats:
    """``flat`` (V, 2) with each part in its smallest box, the parts side by side in the first
    quadrant.
    """
    faces = pattern.faces_vertices
    owner = np.zeros(len(flat), dtype=np.int64)
    face, slot = np.nonzero(faces >= 0)
    owner[faces[face, slot]] = part[face]
    places = np.zeros_like(flat)
    sizes = []
    for number in range(int(part.max()) + 1):
        own = np.unique(faces[face, slot][part[face] == number])
        angle, _ = smallest_box(flat[own])
        c, s = math.cos(angle), math.sin(angle)
        turned = flat[own] @ np.array([[c, -s], [s, c]])
        places[own] = turned - turned.min(axis=0)
        sizes.append(np.ptp(turned, axis=0))
    gap = float(edge_lengths(flat, pattern.edges_vertices).mean())
    return np.asarray(places + shelved(np.array(sizes), gap)[owner])


def _not_flat(pattern: CreasePattern) -> PatternError:
    return PatternError(
        "The folded form does not lie flat: its vertices are developable, and yet its facets do "
        "not close when they are laid beside each other. Cut it open (letter C) where it closes on "
        "itself."
    )
