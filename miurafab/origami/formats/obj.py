"""A pattern from two Wavefront OBJ files: the same mesh lying flat and folded.

Many research codes store their origami in this way. Both files must list vertices and facets in the
same order. The fold angles follow from the folded form; parts that do not touch are pieces. OBJ has
no unit: one unit is read as 1 mm. (Wavefront, Advanced Visualizer manual, appendix B1: the ``v``
and ``f`` statements.)
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from miurafab.errors import PatternError
from miurafab.files import Reading, read_text
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import connected_parts, next_corners, reversed_faces, signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.contact import triangulate
from miurafab.origami.formats.two_forms import with_its_rounding
from miurafab.origami.unfold import with_angles_of_the_folded_form
from miurafab.origami.weld import welded


def pattern_from_obj_pair(
    flat: Path, folded: Path, tolerance: float | None = None
) -> CreasePattern:
    """The pattern whose flat form is in ``flat`` and whose folded form is in ``folded``, without
    edges shorter than ``tolerance`` (mm; None: with all).

    Raises :class:`~miurafab.errors.PatternError` naming the file and what is wrong with it.
    """
    with Reading(flat, "an OBJ file of a flat form", PatternError):
        return _pattern(flat, folded, tolerance)


def _pattern(flat: Path, folded: Path, tolerance: float | None) -> CreasePattern:
    points, faces = _read_obj(flat)
    shape, same = _read_obj(folded)
    if len(points) != len(shape):
        raise PatternError(
            f"{flat} has {len(points)} vertices and {folded} has {len(shape)}; they must be one "
            "mesh in two forms."
        )
    if faces.shape != same.shape or (faces != same).any():
        raise PatternError(f"{flat} and {folded} do not list the same facets in the same order.")
    across = int(np.argmin(np.ptp(points, axis=0)))
    if np.ptp(points[:, across]) > 1e-9 * np.ptp(points):
        raise PatternError(f"{flat} is not flat: its vertices do not lie in one plane x, y or z.")
    # the two axes in the order that is right-handed with the third axis
    plane = np.ascontiguousarray(points[:, [(across + 1) % 3, (across + 2) % 3]])
    triangles, owner = triangulate(faces, plane)
    areas = np.bincount(owner, signed_areas(plane[triangles]), minlength=len(faces))
    if areas.sum() < 0:
        faces = reversed_faces(faces)
    edges = _edges(faces)
    pieces, piece = connected_parts(faces)
    pattern = CreasePattern(
        vertices_coords=plane,
        edges_vertices=edges,
        edges_assignment=np.full(len(edges), "U"),
        edges_fold_angle=np.zeros(len(edges)),
        faces_vertices=faces,
        folded_coords=shape,
        pieces=piece if pieces > 1 else None,
    )
    if tolerance is None:
        pattern = with_its_rounding(pattern, points, shape)
    else:
        pattern = welded(pattern, tolerance)
    return with_angles_of_the_folded_form(pattern)


def _read_obj(path: Path) -> tuple[Floats, Ints]:
    """Vertices (V, 3) and facets (F, k), -1 padded."""
    text = read_text(path, PatternError, "an OBJ file")
    points: list[list[float]] = []
    faces: list[list[int]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split("#")[0].split()
        try:
            if words[:1] == ["v"]:
                x, y, z = (float(word) for word in words[1:4])
                points.append([x, y, z])
            elif words[:1] == ["f"]:
                corners = [int(word.split("/")[0]) for word in words[1:]]
                # counted from 1, or backwards from the last vertex so far
                face = [c - 1 if c > 0 else len(points) + c for c in corners]
                if len(face) < 3 or 0 in corners or min(face) < 0:
                    raise ValueError
                faces.append(face)
        except ValueError:
            raise PatternError(f"{path}, line {number}: '{line.strip()}' cannot be read.") from None
    if not points or not faces:
        raise PatternError(f"{path} holds no {'facets' if points else 'vertices'}.")
    vertices = np.array(points)
    if not np.isfinite(vertices).all():
        raise PatternError(f"{path} holds a coordinate that is not a finite number.")
    if max(map(max, faces)) >= len(points):
        raise PatternError(f"{path}: a facet refers to a vertex that does not exist.")
    width = max(map(len, faces))
    padded = [face + [-1] * (width - len(face)) for face in faces]
    return vertices, np.array(padded, dtype=np.int64)


def _edges(faces: Ints) -> Ints:
    ahead = np.take_along_axis(faces, next_corners(faces), axis=1)
    sides = np.stack([faces, ahead], axis=-1)
    return np.unique(np.sort(sides[faces >= 0], axis=1), axis=0)
