"""Measured pieces, folded along their creases and glued along their seams, in memory.

A facet f that lies at p on its sheet stands at R_f p + t_f in space. Over a crease, the rotations
of its two facets differ by the fold:

    R_b = R_a Rot(e, -rho) Z,    e the measured crease along facet a, rho its fold angle,

Z the turn of the one sheet to the other where the crease is a seam between two patches. Every
crease is measured, so there are more equations than facets. The rotations start along a tree and
are then evened out over all creases, as the paper does; so are the corners (sparse least squares).
Measured errors of a hundredth of a millimetre do not add up from facet to facet.

Pieces have only their seams in common. They are laid on each other one by one, along all seams to
what stands already.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order
from scipy.sparse.linalg import lsqr
from scipy.spatial.transform import Rotation

from miurafab.fabrication.recover import RecoveredCorners
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import next_corners
from miurafab.origami.crease_pattern import CreasePattern

_ROUNDS = 3
"""Rounds of evening out; the second changes angles by less than 1e-8."""


def glued_shell(pattern: CreasePattern, face_patch: Ints, corners: RecoveredCorners) -> Floats:
    """(V, 3) where the vertices of ``pattern`` are in the shell that is folded and glued from the
    measured ``corners``; NaN for a vertex that was not measured.
    """
    place = np.full((int(face_patch.max()) + 1, len(pattern.vertices_coords), 2), np.nan)
    place[corners.patch, corners.vertex] = corners.place
    pieces = pattern.pieces
    pieces = np.zeros(len(face_patch), dtype=np.int64) if pieces is None else pieces
    shell = np.full((len(pattern.vertices_coords), 3), np.nan)
    for piece in range(int(pieces.max()) + 1):
        own = np.flatnonzero(pieces == piece)
        vertices, points = _folded(pattern, own, place, face_patch)
        shell[vertices] = points
    return shell if pieces.max() == 0 else _joined(pattern, pieces, shell)


def laid_on(source: Floats, target: Floats) -> tuple[Floats, Floats]:
    """The rotation and shift that bring ``source`` (n, 3) nearest to ``target`` (Kabsch 1976)."""
    middle, to = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((source - middle).T @ (target - to))
    turn = (u * [1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return np.asarray(turn.T), np.asarray(to - middle @ turn)


def _folded(
    pattern: CreasePattern, own: Ints, place: Floats, face_patch: Ints
) -> tuple[Ints, Floats]:
    """The vertices of the facets ``own`` that measured edges join, and where they are in the folded
    piece.
    """
    a, b, relative = _hinges(pattern, own, place, face_patch)
    turns = _rotations(len(own), a, b, relative)
    faces = pattern.faces_vertices[own]
    heads = np.take_along_axis(faces, next_corners(faces), axis=1)
    part = components(len(own), a, b)
    joined = part == np.bincount(part).argmax()  # how the others stand to these is not known
    facet, slot = np.nonzero((faces >= 0) & joined[:, None])
    tail, head = faces[facet, slot], heads[facet, slot]
    chart = place[face_patch[own[facet]]]
    number = np.arange(len(facet))
    step = chart[number, head] - chart[number, tail]
    known = np.isfinite(step).all(axis=1)
    step = np.pad(step[known], ((0, 0), (0, 1)))
    wanted = turns[facet[known]].apply(step)
    vertices, ends = np.unique(np.stack([tail[known], head[known]]), return_inverse=True)
    ends = ends.reshape(2, -1)
    row = np.arange(len(wanted))
    one = np.ones(len(row))
    system = sparse.csr_array(
        (np.r_[one, -one], (np.r_[row, row], np.r_[ends[1], ends[0]])),
        shape=(len(row), len(vertices)),
    )
    points = [lsqr(system, wanted[:, axis], atol=1e-13, btol=1e-13)[0] for axis in range(3)]
    return vertices, np.stack(points, axis=1)


def _hinges(
    pattern: CreasePattern, own: Ints, place: Floats, face_patch: Ints
) -> tuple[Ints, Ints, Rotation]:
    """The pairs a, b of facets (their numbers in ``own``) that share a measured edge, and R_b over
    R_a.
    """
    number = np.full(len(face_patch), -1)
    number[own] = np.arange(len(own))
    beside = pattern.edges_faces
    inner = (beside >= 0).all(axis=1) & ~np.isin(pattern.edges_assignment, ("B", "C"))
    edge = np.flatnonzero(inner & (number[beside[:, 0]] >= 0))
    left, right = beside[edge].T
    tail, head = pattern.edges_vertices[edge].T
    step, other = (
        place[face_patch[each], head] - place[face_patch[each], tail] for each in (left, right)
    )
    known = np.isfinite(step).all(axis=1) & np.isfinite(other).all(axis=1)
    edge, left, right, step, other = (x[known] for x in (edge, left, right, step, other))
    axis = np.pad(step / np.linalg.norm(step, axis=1)[:, None], ((0, 0), (0, 1)))
    # A facet beyond the left side of its edge folds up, towards the viewer, in a valley.
    fold = Rotation.from_rotvec(axis * -pattern.edges_fold_angle[edge][:, None])
    turn = np.arctan2(step[:, 1], step[:, 0]) - np.arctan2(other[:, 1], other[:, 0])
    turn[face_patch[left] == face_patch[right]] = 0.0
    flat = Rotation.from_rotvec(turn[:, None] * np.array([0.0, 0.0, 1.0]))
    return number[left], number[right], fold * flat


def _rotations(count: int, a: Ints, b: Ints, relative: Rotation) -> Rotation:
    """The rotation of each of ``count`` facets, evened out over all hinges."""
    quaternion = relative.as_quat()
    graph = sparse.coo_array((np.ones(len(a)), (a, b)), shape=(count, count))
    order, before = breadth_first_order(graph, 0, directed=False)
    hinge = {(i, j): n for n, (i, j) in enumerate(zip(a.tolist(), b.tolist(), strict=True))}
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    for facet in order[1:].tolist():
        last = int(before[facet])
        forth = (last, facet) in hinge
        step = Rotation.from_quat(quaternion[hinge[(last, facet) if forth else (facet, last)]])
        turns[facet] = (Rotation.from_quat(turns[last]) * (step if forth else step.inv())).as_quat()
    found = Rotation.from_quat(turns)
    row = np.arange(len(a))
    one = np.ones(len(a))
    system = sparse.csr_array(
        (np.r_[one, -one], (np.r_[row, row], np.r_[b, a])), shape=(len(a), count)
    )
    for _ in range(_ROUNDS):
        off = (found[a] * relative * found[b].inv()).as_rotvec()
        change = [lsqr(system, off[:, axis], atol=1e-13, btol=1e-13)[0] for axis in range(3)]
        found = Rotation.from_rotvec(np.stack(change, axis=1)) * found
    return found


def _joined(pattern: CreasePattern, pieces: Ints, shell: Floats) -> Floats:
    """The pieces of ``shell`` laid on each other along their seams."""
    piece = np.empty(len(shell), dtype=np.int64)
    real = pattern.faces_vertices >= 0
    piece[pattern.faces_vertices[real]] = np.repeat(pieces, real.sum(axis=1))
    one, other = pattern.seam_vertices.reshape(-1, 2).T
    one, other = np.r_[one, other], np.r_[other, one]
    measured = np.isfinite(shell[one]).all(axis=1) & np.isfinite(shell[other]).all(axis=1)
    between = measured & (piece[one] != piece[other])
    one, other = one[between], other[between]
    stands = {0}
    while len(stands) <= int(pieces.max()):
        ready = np.isin(piece[other], list(stands)) & ~np.isin(piece[one], list(stands))
        if not ready.any():
            shell[~np.isin(piece, list(stands))] = np.nan
            break
        counts = np.bincount(piece[one[ready]])
        following = int(counts.argmax())
        meet = ready & (piece[one] == following)
        turn, shift = laid_on(shell[one[meet]], shell[other[meet]])
        shell[piece == following] = shell[piece == following] @ turn.T + shift
        stands.add(following)
    return shell
