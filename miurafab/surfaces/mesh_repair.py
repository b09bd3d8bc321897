"""Repair of a triangle mesh to one oriented sheet without holes, or a refusal that names the fault.

Mesh files are seldom clean disks. Each step takes and returns ``vertices`` (V, 3) in mm and
``faces`` (F, 3), or raises :class:`~miurafab.errors.TargetError` with one sentence that says what
is wrong and what to do.
"""

from __future__ import annotations

import math

import numpy as np
import trimesh

from miurafab.errors import TargetError
from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats, Ints
from miurafab.surfaces.parameterise import border_loops

SMALL_HOLE = 0.15
"""A hole is filled if its border is at most this part of the outer border."""


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
    _, first, merged = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    vertices, faces = vertices[first], merged.reshape(-1)[faces]
    distinct = (np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)
    faces = faces[distinct & (doubled_areas(vertices, faces) > 1e-14 * size**2)]
    if not len(faces):
        raise TargetError(f"{name}: all triangles are degenerate (have no area).")
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


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


def oriented_sheet(vertices: Floats, faces: Ints, name: str) -> Ints:
    """The triangles with one orientation; refuses a mesh that is not one sheet with a border."""
    edges, uses = edges_of(faces)
    if (uses > 2).any():
        raise TargetError(
            f"{name} is not a surface: {int((uses > 2).sum())} edges have more than two triangles; "
            "remove the inner walls or duplicate triangles."
        )
    pieces = trimesh.graph.connected_components(edges, nodes=np.arange(len(vertices)))
    if len(pieces) > 1:
        sizes = sorted((len(piece) for piece in pieces), reverse=True)
        raise TargetError(
            f"{name} holds {len(pieces)} separate pieces (the largest of {sizes[0]} and "
            f"{sizes[1]} vertices); keep one and try again."
        )
    border = edges[uses == 1]
    if not len(border):
        raise TargetError(f"{name} is closed; cut it open so that it is a sheet with one border.")
    touching = np.flatnonzero(np.bincount(border.ravel()) > 2)
    if len(touching):
        x, y, z = vertices[touching[0]]
        raise TargetError(
            f"{name}: its border touches itself at ({x:.4g}, {y:.4g}, {z:.4g}); widen it there or "
            "cut it apart."
        )
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    if not mesh.is_winding_consistent:
        trimesh.repair.fix_winding(mesh)
        if not mesh.is_winding_consistent:
            raise TargetError(
                f"{name} has one side only, like a Moebius strip; cut it open across."
            )
    fan = np.asarray(mesh.faces, dtype=np.int64)
    pinched = _pinched(fan, len(vertices))
    if pinched is not None:
        x, y, z = vertices[pinched]
        raise TargetError(
            f"{name} is pinched: parts that share no edge meet at ({x:.4g}, {y:.4g}, {z:.4g}); "
            "separate them there."
        )
    return fan


def _pinched(faces: Ints, count: int) -> int | None:
    """A vertex around which the triangles form more than one fan, if there is any."""
    corners = faces.ravel()
    # corners of neighbouring triangles at a vertex are joined across the common side
    following, previous = np.roll(faces, -1, axis=1).ravel(), np.roll(faces, 1, axis=1).ravel()
    out, back = corners * count + following, corners * count + previous
    order = np.argsort(back)
    place = np.searchsorted(back, out, sorter=order).clip(max=len(back) - 1)
    match = order[place]
    joined = np.flatnonzero(back[match] == out)
    fans = trimesh.graph.connected_component_labels(
        np.stack([joined, match[joined]], axis=1), node_count=len(corners)
    )
    pairs = np.unique(np.stack([corners, fans], axis=1), axis=0)
    several = np.flatnonzero(np.bincount(pairs[:, 0], minlength=count) > 1)
    return int(several[0]) if len(several) else None


def fill_holes(vertices: Floats, faces: Ints, name: str) -> tuple[Floats, Ints, int]:
    """The mesh with each small hole closed by a fan around its middle, and the number of holes."""
    loops = border_loops(faces)
    lengths = [
        float(np.linalg.norm(vertices[np.roll(loop, -1)] - vertices[loop], axis=1).sum())
        for loop in loops
    ]
    order = sorted(range(len(loops)), key=lambda n: -lengths[n])
    for n in order[1:]:
        if lengths[n] > SMALL_HOLE * lengths[order[0]]:
            raise TargetError(
                f"{name} has a hole {lengths[n] / math.pi:.3g} mm across, too large to be filled "
                f"here (it has {len(loops) - 1} in all); fill it in your mesh program, or cut the "
                "mesh to a part without."
            )
        loop = loops[n]
        middle = np.full(len(loop), len(vertices))
        vertices = np.concatenate([vertices, vertices[loop].mean(axis=0, keepdims=True)])
        # a border runs in the direction of its triangles, so the fan runs against it
        faces = np.concatenate([faces, np.stack([np.roll(loop, -1), loop, middle], axis=1)])
    return vertices, faces, len(loops) - 1


def even_triangles(vertices: Floats, faces: Ints) -> Floats:
    """(T, 3, 3) the same surface with no triangle much larger than most."""
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    extent = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    limit = max(3 * float(np.median(longest)), extent / 80)
    if longest.max() <= limit:
        return corners
    points, split = trimesh.remesh.subdivide_to_size(vertices, faces, limit, max_iter=24)
    return np.asarray(np.asarray(points, dtype=np.float64)[np.asarray(split)])


def edges_of(faces: Ints) -> tuple[Ints, Ints]:
    """(E, 2) the edges of a triangle mesh, and (E,) the number of triangles at each."""
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, uses = np.unique(sides, axis=0, return_counts=True)
    return edges, uses


def side_lengths(points: Floats, faces: Ints) -> Floats:
    """(F, 3) the lengths of the sides of triangles."""
    corners = points[faces]
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2))


def doubled_areas(points: Floats, faces: Ints) -> Floats:
    """(F,) twice the areas of triangles in space."""
    p = points[faces]
    return np.asarray(np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1))
