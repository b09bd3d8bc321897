"""Repair of a triangle mesh to one oriented sheet without holes, or a refusal that names the fault.

Mesh files are seldom clean disks. Each step takes and returns ``vertices`` (V, 3) in mm and
``faces`` (F, 3), or raises :class:`~miurafab.errors.TargetError` with one sentence that says what
is wrong and what to do.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from miurafab.errors import TargetError
from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.surfaces.topology import Topology, one_sheet, pieces_of, used_alone
from miurafab.surfaces.welding import weld

SMALL_HOLE = 0.15
"""A hole is filled if its border is at most this part of the outer border."""

LEAST_PIECE = 1 / 3
"""A largest piece with less than this part of the area is no answer to what the user gave."""

Holes = Literal["small", "all", "keep"]
"""Which holes are filled: small ones, all, or small ones while large ones stay windows."""


def clean(vertices: Floats, faces: Ints, name: str) -> tuple[Floats, Ints]:
    """Merge equal vertices, drop degenerate triangles and unused vertices."""
    if not len(faces):
        raise TargetError(f"{name} holds no triangles.")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise TargetError(f"{name}: a triangle refers to a vertex that does not exist.")
    if not np.isfinite(vertices[faces]).all():
        used = np.unique(faces)
        bad = int(used[~np.isfinite(vertices[used]).all(axis=1)][0])
        raise TargetError(
            f"{name}: vertex {bad} has a coordinate that is not a finite number (NaN or infinite); "
            "repair the mesh and try again."
        )
    size = float(np.ptp(vertices[faces].reshape(-1, 3), axis=0).max())
    if size == 0:
        raise TargetError(f"{name}: all triangles lie in one point.")
    if not size < 1e100:
        raise TargetError(f"{name}: its coordinates are too large to be lengths ({size:.0e} mm).")
    vertices = np.where(np.isfinite(vertices), vertices, 0.0)
    low = vertices[faces].reshape(-1, 3).min(axis=0)
    keys = np.round(np.clip((vertices - low) / (1e-9 * size), -1e12, 1e12)).astype(np.int64)
    first, merged = _equal_rows(keys)
    # in the order of the file, which neither a turn nor a shift of the mesh changes
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    vertices, faces = vertices[first[order]], rank[merged.reshape(-1)][faces]
    distinct = (np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)
    faces = faces[distinct & (doubled_areas(vertices, faces) > 1e-14 * size**2)]
    if not len(faces):
        raise TargetError(f"{name}: all triangles are degenerate (have no area).")
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


def _equal_rows(keys: Ints) -> tuple[Ints, Ints]:
    """The index of the first of each class of equal rows of ``keys`` (n, 3), and the class (n,)."""
    order = np.lexsort(keys.T)
    new = np.concatenate([[True], (np.diff(keys[order], axis=0) != 0).any(axis=1)])
    merged = np.empty(len(keys), dtype=np.int64)
    merged[order] = np.cumsum(new) - 1
    return order[new], merged


def size_findings(vertices: Floats, name: str) -> tuple[Finding, ...]:
    """A finding where the size of the mesh suggests a unit that is not the millimetre."""
    size = float(np.ptp(vertices, axis=0).max())
    if 1.0 <= size <= 10_000.0:
        return ()
    return (
        Finding(
            "mesh-unit",
            f"{name} is {size:.3g} mm large, since mesh files are read in millimetres; if it is in "
            "another unit, give the size that is meant with `size`.",
            name,
        ),
    )


def mended(vertices: Floats, faces: Ints, name: str) -> tuple[Floats, Ints, tuple[Finding, ...]]:
    """One oriented piece of the mesh, welded and without doubled triangles, and what was done.

    Of several pieces the one of most area is kept. Raises
    :class:`~miurafab.errors.TargetError` where that is not a surface with two sides.
    """
    vertices, faces, welded, widest = weld(vertices, _each_once(faces))
    findings: tuple[Finding, ...] = ()
    if welded:
        findings += (
            Finding(
                "welded",
                f"{name}: borders were welded at {welded} vertices, over gaps of up to "
                f"{widest:.1e} mm.",
                name,
            ),
        )
        faces = _each_once(faces)
    vertices, faces, left_out = _largest_piece(vertices, faces, name)
    vertices, faces = one_sheet(vertices, faces, name)
    return vertices, faces, findings + left_out


def _each_once(faces: Ints) -> Ints:
    """The triangles, of those with the same corners the first."""
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return faces[np.sort(first)]


def _largest_piece(
    vertices: Floats, faces: Ints, name: str
) -> tuple[Floats, Ints, tuple[Finding, ...]]:
    piece = pieces_of(faces)
    area = np.bincount(piece, doubled_areas(vertices, faces)) / 2
    if len(area) == 1:
        return vertices, faces, ()
    largest = int(np.argmax(area))
    share = float(area[largest] / area.sum())
    if share < LEAST_PIECE:
        raise TargetError(
            f"{name} holds {len(area)} separate pieces, and the largest has only "
            f"{100 * share:.2g} % of the area; join them in your mesh program, or keep the one "
            "that is meant."
        )
    kept, triangles = used_alone(vertices, faces[piece == largest])
    rest = len(area) - 1
    sentence = (
        f"{name} holds {len(area)} separate pieces: the largest is the target, and "
        f"{rest} other{'s' if rest > 1 else ''} with {100 * (1 - share):.2g} % of the area "
        f"{'are' if rest > 1 else 'is'} left out."
    )
    return kept, triangles, (Finding("pieces-left-out", sentence, name),)


def fill_holes(
    vertices: Floats, faces: Ints, topology: Topology, name: str, holes: Holes = "small"
) -> tuple[Floats, Ints, tuple[Finding, ...]]:
    """The mesh with its small holes closed, or ``all``, each by a fan around its middle.

    Raises :class:`~miurafab.errors.TargetError` for a hole that is too large to be filled or kept
    unasked.
    """
    outer, *rest = topology.lengths
    large = [length for length in rest if length > SMALL_HOLE * outer]
    if large and holes == "small":
        raise TargetError(
            f"{name} has a hole {large[0] / math.pi:.3g} mm across, too large to be filled unasked "
            f"(it has {len(rest)} in all); `holes` keep cuts the sheet along it, `holes` all fills "
            "it."
        )
    kept = len(large) if holes == "keep" else 0
    for loop in topology.loops[1 + kept :]:
        vertices, faces = _filled(vertices, faces, loop)
    done = []
    if kept:
        done.append(f"{_count(kept, 'large hole')} kept open, and the sheet ends there")
    if filled := len(rest) - kept:
        kind = "hole" if holes == "all" and large else "small hole"
        done.append(f"{_count(filled, kind)} filled")
    if not done:
        return vertices, faces, ()
    sentence = f"{name}: {' and '.join(done)} (`holes` chooses)."
    return vertices, faces, (Finding("filled-holes", sentence, name),)


def _count(number: int, what: str) -> str:
    return f"{number} {what}s were" if number > 1 else f"{number} {what} was"


def _filled(vertices: Floats, faces: Ints, loop: Ints) -> tuple[Floats, Ints]:
    """The mesh with rings of new vertices between the border ``loop`` and its middle.

    The rings lie an edge apart, so that the triangles are no needles.
    """
    border = vertices[loop]
    middle = border.mean(axis=0)
    edge = np.linalg.norm(np.roll(border, -1, axis=0) - border, axis=1).mean()
    across = np.linalg.norm(border - middle, axis=1).mean()
    rings = min(max(round(float(across / edge)), 1), 40)
    at = loop
    for k in range(1, rings):
        new = len(vertices) + np.arange(len(loop))
        vertices = np.concatenate([vertices, border + (middle - border) * (k / rings)])
        # a border runs in the direction of its triangles, so the filling runs against it
        a, b, c, d = at, np.roll(at, -1), np.roll(new, -1), new
        faces = np.concatenate([faces, np.stack([b, a, d], 1), np.stack([b, d, c], 1)])
        at = new
    last = np.full(len(loop), len(vertices))
    vertices = np.concatenate([vertices, middle[None]])
    return vertices, np.concatenate([faces, np.stack([np.roll(at, -1), at, last], axis=1)])


def even_triangles(vertices: Floats, faces: Ints) -> Floats:
    """(T, 3, 3) the same surface with no triangle much larger than most."""
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    extent = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    limit = max(3 * float(np.median(longest)), extent / 80)
    if longest.max() <= limit:
        return corners
    import trimesh

    points, split = trimesh.remesh.subdivide_to_size(vertices, faces, limit, max_iter=24)
    return np.asarray(np.asarray(points, dtype=np.float64)[np.asarray(split)])


def side_lengths(points: Floats, faces: Ints) -> Floats:
    """(F, 3) the lengths of the sides of triangles."""
    corners = points[faces]
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2))


def doubled_areas(points: Floats, faces: Ints) -> Floats:
    """(F,) twice the areas of triangles in space."""
    p = points[faces]
    return np.asarray(np.linalg.norm(vector_product(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1))
