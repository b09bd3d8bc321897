"""A target as the page shows it before and after a fit: triangles, and where each lies when flat.

The triangles are those of the layout that the fit uses: a lattice over the domain of a named
surface or a formula, the chart of a mesh that lies flat, the chart of a body that is covered by
gores. ``flat`` says where each vertex lies in that layout, so that the page can show the part that
is covered, the seams and the grid of facets while a hand moves them, without asking again.

A mesh is shown in two steps. Its triangles as they are in the file come at once; what the fit makes
of it comes after.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import miurafab
from miurafab.findings import findings_json
from miurafab.geometry.arrays import Bools, Floats, Ints, vector_product
from miurafab.geometry.distances import MeshTrees
from miurafab.geometry.nearest import tree_of
from miurafab.geometry.polygons import facet_means
from miurafab.origami.coverage import uncovered
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.nearness import uncut
from miurafab.studio.mends import mends
from miurafab.surfaces.mesh import MeshSurface
from miurafab.surfaces.mesh_files import read_mesh
from miurafab.surfaces.surface import TargetSurface
from miurafab.surfaces.tube import TubeSurface
from miurafab.workflow.design import Design

LATTICE = 72
"""Cells to a side of a surface that is a map; 10,000 triangles."""
MOST_SHOWN = 60_000
"""A mesh of more triangles is shown by fewer."""
_NEAR = 6
"""Facets over whose deviations the colour of a place is a mean."""

SHAPING = (
    *("close", "facets", "poles", "polar_hole", "side", "holes", "pieces", "profile"),
    *("region", "rotate"),
)
"""What decides what the target is and how it is parted. The page knows the layout, and so gives
``region`` and ``rotate`` only where it wants to know what fits."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What is seen of a target: ``vertices`` (V, 3) and ``faces`` (F, 3), the place ``flat`` (V, 2)
    of each vertex in the layout, and which triangles fill holes, ``filled`` (F,).

    ``facts`` are the ``kind`` of layout and what belongs to it.
    """

    vertices: Floats
    faces: Ints
    flat: Floats
    filled: Bools
    facts: Mapping[str, Any]

    def picture(self) -> dict[str, Any]:
        """The arrays as the page reads them; coordinates are relative to the middle."""
        middle = (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2
        return {
            "points": _packed(self.vertices - middle, np.float32),
            "faces": _packed(self.faces, np.uint32),
            "flat": _packed(self.flat, np.float32),
            "filled": _packed(self.filled, np.uint8),
            "middle": middle.tolist(),
            "size": np.ptp(self.vertices, axis=0).tolist(),
            **self.facts,
        }


def seen(surface: TargetSurface) -> Seen:
    """What is seen of ``surface``, in its own unit and frame."""
    if isinstance(surface, MeshSurface):
        chart = surface.layout
        filled = np.arange(len(chart.faces)) >= chart.real
        d = surface.domain
        facts = {
            "kind": "disk",
            "rectangle": [d.u0, d.u1, d.v0, d.v1],
            "angle": math.degrees(surface.placement.angle),
            "whole": surface.whole is not None,
        }
        return Seen(chart.vertices, chart.faces, chart.flat, filled, facts)
    if isinstance(surface, TubeSurface):
        tube = surface.layout
        facts = {
            "kind": "tube",
            "girth": tube.girth,
            "length": tube.length,
            "start": surface.domain.u0,
            "gores": surface.gores,
            "poles": surface.description.get("poles", []),
            "hole": surface.description.get("hole", 0.0),
        }
        none = np.zeros(len(tube.faces), dtype=bool)
        return Seen(tube.vertices, tube.faces, tube.flat, none, facts)
    d = surface.domain
    lattice = d.lattice(LATTICE + 1, LATTICE + 1)
    places = (lattice - [d.u0, d.v0]) / [d.width, d.height]
    at = np.arange((LATTICE + 1) ** 2).reshape(LATTICE + 1, LATTICE + 1)
    a, b, c, e = (q.ravel() for q in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, e], axis=1)])
    return Seen(
        surface.point(lattice).reshape(-1, 3),
        faces,
        places.reshape(-1, 2),
        np.zeros(len(faces), dtype=bool),
        {"kind": "map"},
    )


def shown(design: Design) -> dict[str, Any]:
    """The picture of the target of ``design``, and what a person should know of it."""
    request = design.request
    return {
        **seen(request.surface).picture(),
        "facets": [request.columns, request.rows],
        "pieces": request.pieces,
        "findings": findings_json(design.findings),
    }


def file_shown(path: Path) -> dict[str, Any]:
    """The triangles of a mesh file as they are, before anything is made of them.

    Raises :class:`~miurafab.errors.TargetError` for a file that cannot be read.
    """
    vertices, faces, _ = read_mesh(path)
    triangles = len(faces)
    vertices, faces = thinned(vertices, faces, MOST_SHOWN)
    none = np.zeros(len(faces), dtype=bool)
    flat = np.zeros((len(vertices), 2))
    return Seen(vertices, faces, flat, none, {"kind": "file", "triangles": triangles}).picture()


def placed(target: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """What a fit would make of a file: its picture, or why there is none and what mends it."""
    shaping = {name: options[name] for name in SHAPING if name in options}
    try:
        return shown(miurafab.design(target, **shaping))
    except miurafab.MiurafabError as fault:
        return {"refused": fault.sentence, "mends": mends(fault.sentence)}


def compared(pattern: CreasePattern, surface: TargetSurface) -> dict[str, Any]:
    """The target after a fit: at each vertex how far the middle of the sheet lies from it, mm, and
    of each triangle whether the sheet leaves it uncovered.

    The deviation of a facet is the signed distance of its mean from the target, positive on the
    side of its normal. That of a place is the mean over the facets near by, weighted by nearness.
    """
    assert pattern.folded_coords is not None
    found = seen(surface)
    facets = pattern.faces_vertices[uncut(pattern)]
    means = facet_means(pattern.folded_coords / pattern.scale, facets)
    corners = found.vertices[found.faces]
    feet, triangle = surface.nearest(means), MeshTrees.of(corners).closest(means)[1]
    a, b, c = corners[triangle].transpose(1, 0, 2)
    side = np.sign(np.einsum("nk,nk->n", means - feet, vector_product(b - a, c - a)))
    deviation = side * np.linalg.norm(means - feet, axis=1) * pattern.scale
    near = min(_NEAR, len(means))
    apart, nearest = tree_of(feet).query(found.vertices, k=range(1, near + 1))
    weight = 1 / np.maximum(apart, 1e-9 * float(np.ptp(means, axis=0).max())) ** 2
    there = (weight * deviation[nearest]).sum(axis=1) / weight.sum(axis=1)
    missed = uncovered(pattern, surface.tiles(), corners.mean(axis=1))
    where = {"edge": pattern.target.get("edge", "")}
    if "rectangle" in pattern.target:
        where |= {"angle": pattern.target["rotate"], "rectangle": pattern.target["rectangle"]}
    return {
        **found.picture(),
        **where,
        "scale": pattern.scale,
        "deviation": _packed(there, np.float32),
        "missed": _packed(missed, np.uint8),
        "most": float(np.abs(deviation).max()),
    }


def thinned(vertices: Floats, faces: Ints, most: int) -> tuple[Floats, Ints]:
    """The mesh with at most about ``most`` triangles, for the eye alone: vertices in one cell of a
    lattice become one.
    """
    if len(faces) <= most:
        return vertices, faces
    corners = vertices[faces]
    sides = vector_product(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # a lattice of cells of side h cuts an area A into about A / h^2 vertices, twice as many faces
    step = math.sqrt(2 * float(np.linalg.norm(sides, axis=1).sum()) / 2 / most)
    low = vertices.min(axis=0)
    cells = np.floor((vertices - low) / max(step, 1e-300)).astype(np.int64)
    span = cells.max(axis=0) + 1
    key = (cells[:, 0] * span[1] + cells[:, 1]) * span[2] + cells[:, 2]
    _, first, of = np.unique(key, return_index=True, return_inverse=True)
    faces = of.reshape(-1)[faces]
    distinct = (np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)
    return vertices[first], np.unique(faces[distinct], axis=0)


def _packed(array: NDArray[Any], kind: type[np.generic]) -> str:
    little = np.ascontiguousarray(array, dtype=np.dtype(kind).newbyteorder("<"))
    return base64.b64encode(little.tobytes()).decode("ascii")
