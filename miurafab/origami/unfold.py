"""Unfolding: a developable tessellation laid flat without stretching, with its fold angles.

The heading of each facet follows from that of its neighbour and the corner angles at their common
side, first up the middle column and then along each row. The vertices follow by adding up sides.
Both are sums of lengths and angles of the folded form, so that rounding adds up and is not
amplified. (Placing each row from the positions of the row before amplifies rounding, by 1e8 on a
spiral of 20 rows.) The flat pattern is isometric as far as the sheet is developable and planar;
verification measures that independently.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from miurafab.geometry.angles import angle_between, fold_angles
from miurafab.geometry.arrays import Bools, Floats
from miurafab.geometry.polygons import facet_normals
from miurafab.geometry.quads import QuadGrid
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.tessellation import Tessellation

FLAT_ANGLE = 1e-9
"""Radians; an edge with a smaller fold angle is flat and not folded."""


def unfold(
    tessellation: Tessellation, *, scale: float = 1.0, target: dict[str, Any] | None = None
) -> CreasePattern:
    """The crease pattern of ``tessellation``, with rows along x, in the first quadrant."""
    grid = tessellation.grid
    flat = turned_upright(_develop(tessellation.points))
    folded = tessellation.vertices
    edges = grid.edges_vertices
    angle = grid_fold_angles(folded, grid)
    border = _border(grid)
    assignment = np.where(angle > FLAT_ANGLE, "V", np.where(angle < -FLAT_ANGLE, "M", "F"))
    return CreasePattern(
        vertices_coords=flat.reshape(-1, 2),
        edges_vertices=edges,
        edges_assignment=np.where(border, "B", assignment),
        edges_fold_angle=np.where(border, 0.0, angle),
        faces_vertices=grid.faces_vertices,
        folded_coords=folded,
        grid=(grid.columns, grid.rows),
        scale=scale,
        target=target or {},
    )


def with_angles_of_the_folded_form(pattern: CreasePattern) -> CreasePattern:
    """``pattern`` with its fold angles measured in its folded form, for facets of any shape.

    The sign makes a mountain or valley; borders, cuts and joins stay. The fold angle at a crease or
    facet without extent is 0.
    """
    assert pattern.folded_coords is not None
    normals = facet_normals(pattern.folded_coords, pattern.faces_vertices)
    inner = (pattern.edges_faces >= 0).all(axis=1)
    left, right = (normals[pattern.edges_faces[inner, side]] for side in (0, 1))
    angle = np.zeros(len(pattern.edges_vertices))
    with np.errstate(invalid="ignore", divide="ignore"):
        turned = fold_angles(pattern.folded_coords, pattern.edges_vertices[inner], left, right)
    angle[inner] = np.nan_to_num(turned)
    letter = np.where(angle > FLAT_ANGLE, "V", np.where(angle < -FLAT_ANGLE, "M", "F"))
    folds = inner & ~np.isin(pattern.edges_assignment, ("B", "C", "J"))
    kept = np.where(~inner & (pattern.edges_assignment != "C"), "B", pattern.edges_assignment)
    return replace(
        pattern,
        edges_assignment=np.where(folds, letter, kept),
        edges_fold_angle=np.where(folds, angle, 0.0),
    )


def grid_fold_angles(points: Floats, grid: QuadGrid) -> Floats:
    """(E,) signed fold angles of ``points`` (V, 3) in the order of the grid's edges; borders 0."""
    normals = facet_normals(points, grid.faces_vertices).reshape(grid.rows - 1, grid.columns - 1, 3)
    along = np.zeros((grid.rows, grid.columns - 1))
    across = np.zeros((grid.rows - 1, grid.columns))
    v = grid.vertices
    edges = np.stack([v[1:-1, :-1].ravel(), v[1:-1, 1:].ravel()], axis=1)
    # on the left of an edge along +i lies the facet of larger j, along +j that of smaller i
    along[1:-1] = fold_angles(
        points, edges, normals[1:].reshape(-1, 3), normals[:-1].reshape(-1, 3)
    ).reshape(along[1:-1].shape)
    edges = np.stack([v[:-1, 1:-1].ravel(), v[1:, 1:-1].ravel()], axis=1)
    across[:, 1:-1] = fold_angles(
        points, edges, normals[:, :-1].reshape(-1, 3), normals[:, 1:].reshape(-1, 3)
    ).reshape(across[:, 1:-1].shape)
    return np.concatenate([along.ravel(), across.ravel()])


def _border(grid: QuadGrid) -> Bools:
    along = np.zeros((grid.rows, grid.columns - 1), dtype=bool)
    across = np.zeros((grid.rows - 1, grid.columns), dtype=bool)
    along[[0, -1]] = True
    across[:, [0, -1]] = True
    return np.concatenate([along.ravel(), across.ravel()])


def _develop(points: Floats) -> Floats:
    """(rows, columns, 2) flat positions of ``points`` (rows, columns, 3)."""
    right = points[:, 1:] - points[:, :-1]
    up = points[1:] - points[:-1]
    # corner angles of each facet: lower left, lower right, upper left
    left_corner = angle_between(right[:-1], up[:, :-1])
    right_corner = angle_between(-right[:-1], up[:, 1:])
    upper_corner = angle_between(right[1:], -up[:, :-1])

    # the heading of each facet's lower side: up the middle column, then along each row in both
    # directions, so that rounding adds up over half a row
    middle = (points.shape[1] - 1) // 2
    rising = left_corner[:, middle] + upper_corner[:, middle] - np.pi
    first = np.concatenate([[0.0], np.cumsum(rising[:-1])])
    turning = np.pi - right_corner[:, :-1] - left_corner[:, 1:]
    turned = np.concatenate([np.zeros((len(first), 1)), np.cumsum(turning, axis=1)], axis=1)
    heading = first[:, None] + turned - turned[:, [middle]]
    last_row = heading[-1] + left_corner[-1] + upper_corner[-1] - np.pi
    along = np.linalg.norm(right, axis=2)[..., None] * _unit(np.vstack([heading, last_row]))
    upward = heading[:, middle] + left_corner[:, middle]
    across = np.linalg.norm(up[:, middle], axis=1)[:, None] * _unit(upward)
    start = np.concatenate([np.zeros((1, 2)), np.cumsum(across, axis=0)])
    steps = np.concatenate([np.zeros((len(start), 1, 2)), np.cumsum(along, axis=1)], axis=1)
    return np.asarray(start[:, None, :] + steps - steps[:, [middle]])


def _unit(angle: Floats) -> Floats:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def turned_upright(flat: Floats) -> Floats:
    """``flat`` with its mean row direction along x, its bounding box in the first quadrant."""
    heading = flat[:, -1] - flat[:, 0]
    mean = heading.sum(axis=0)
    c, s = mean / np.linalg.norm(mean)
    turned = flat @ np.array([[c, -s], [s, c]])
    return np.asarray(turned - turned.reshape(-1, 2).min(axis=0))
