"""Named design problems with known answers, shared by the tests of every room.

``regular()`` is exact by algebra; the others are solved once a session and cached.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import trimesh

from miurafab.geometry.polygons import facet_means
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.fit import FitRequest, FitResult, fit
from miurafab.origami.miura import MiuraCell, regular_miura
from miurafab.origami.unfold import unfold
from miurafab.surfaces.catalogue import make_surface

CELL = MiuraCell(across=12.0, along=10.0, alpha=math.radians(65), theta=math.radians(40))


@cache
def regular(columns: int = 9, rows: int = 7) -> CreasePattern:
    """A regular Miura-ori of ``columns`` x ``rows`` vertices, lengths in mm."""
    return unfold(regular_miura(CELL, columns, rows))


def assert_mountains_and_valleys(pattern: CreasePattern) -> None:
    """A valley raises the facet beyond the crease over the facet before it, a mountain lowers it.

    Facets run counter-clockwise seen from above. Only heights over planes are used, and no angle.
    """
    points, faces = pattern.folded_coords, pattern.faces_vertices
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    near, far = faces[pattern.edges_faces[inner, 0]], faces[pattern.edges_faces[inner, 1]]
    p = points[near]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    beyond = facet_means(points, far) - points[pattern.edges_vertices[inner, 0]]
    height = np.einsum("ek,ek->e", normal, beyond)
    letters, angles = pattern.edges_assignment[inner], pattern.edges_fold_angle[inner]
    assert set(letters) == {"M", "V"}
    assert ((height > 0) == (letters == "V")).all()
    assert ((angles > 0) == (letters == "V")).all()


@cache
def fitted(
    name: str, columns: int = 8, rows: int = 8, flat_foldable: float | None = None
) -> FitResult:
    """A named surface with its default parameters, 200 mm long."""
    surface, parameters = make_surface(name, {})
    request = FitRequest(
        surface=surface,
        facets=(columns, rows),
        size_mm=200.0,
        flat_foldable=flat_foldable,
        target={"surface": name, "parameters": parameters},
    )
    return fit(request)


def saddle_mesh(count: int = 31, size: float = 100.0) -> trimesh.Trimesh:
    """z = 0.4 (x^2 - y^2) over a square, ``count`` vertices a side, turned out of the axes."""
    grid = np.linspace(-1, 1, count)
    x, y = np.meshgrid(grid, grid)
    points = np.stack([x, y, 0.4 * (x**2 - y**2)], axis=-1).reshape(-1, 3) * size
    index = np.arange(count * count).reshape(count, count)
    corners = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    a, b, c, d = (corner.ravel() for corner in corners)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    turn = trimesh.transformations.rotation_matrix(0.3, [1, 2, 3])[:3, :3]
    return trimesh.Trimesh(points @ turn.T, faces)
