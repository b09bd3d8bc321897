"""FOLD files that hold a folded form and no flat pattern: the sheet is unfolded.

Facets are turned so that neighbours show the same side, and then so that most of the file's
mountains and valleys are what the folded form says. Letters and fold angles are those of the folded
form; where a crease is folded flat, by 180 degrees, the form does not tell its sign, and the letter
of the file, its angle, or the order of the two facets does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import PatternError
from miurafab.findings import Finding
from miurafab.geometry.angles import fold_angles
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import facet_normals, filled, reversed_faces, signed_areas
from miurafab.origami import invariants
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.flattening import flattened, one_sided
from miurafab.origami.formats.fold_keys import (
    assignments_in,
    classes_of,
    edges_in,
    faces_in,
    fold_angles_in,
    numbers_at,
    points_at,
)
from miurafab.origami.judge_creases import measured_folds

SAME = 1e-9
"""Flat patterns that are the same but for rounding differ by as much, in mean edges."""

_TURNED_OVER = math.radians(170)
"""A fold beyond this angle may be of either sign by the rounding of a file."""


def is_folded(frame: Mapping[str, Any]) -> bool:
    """Whether a plane ``frame`` is folded flat: of class foldedForm, or of none and with an order
    of layers, and both sides of it show.
    """
    classes = classes_of(frame)
    told = "foldedForm" in classes or (not classes and bool(frame.get("faceOrders")))
    if not told or "faces_vertices" not in frame:
        return False
    sheet = _Sheet.of(frame)
    areas = signed_areas(sheet.points[:, :2][filled(sheet.faces)])
    return bool((areas > 0).any() and (areas < 0).any())


class _Sheet:
    """The keys of a frame: ``points`` (V, 3), ``faces`` that show one side, edges with letters and
    angles, radians, NaN where there is none.
    """

    def __init__(
        self, points: Floats, edges: Ints, letters: NDArray[np.str_], angles: Floats, faces: Ints
    ) -> None:
        self.points, self.edges, self.letters = points, edges, letters
        self.angles, self.faces = angles, faces

    @classmethod
    def of(cls, frame: Mapping[str, Any], factor: float = 1.0) -> _Sheet:
        """The sheet of ``frame``, whose unit is ``factor`` mm."""
        with np.errstate(over="ignore"):
            points = points_at(frame, "vertices_coords") * factor
        if not np.isfinite(points).all():
            raise PatternError("'vertices_coords' holds a coordinate that is not a finite number.")
        points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
        if "faces_vertices" not in frame:
            raise PatternError(
                "The file holds a folded form without 'faces_vertices', and in space lines alone "
                "do not tell the facets; add them, or the flat pattern."
            )
        faces = faces_in(frame)
        if faces.max() >= len(points):
            raise PatternError("'faces_vertices' refers to a vertex that does not exist.")
        edges = edges_in(frame)
        if edges.max() >= len(points):
            raise PatternError("'edges_vertices' refers to a vertex that does not exist.")
        letters = assignments_in(frame, len(edges))
        angles = fold_angles_in(frame, letters, np.nan)
        cut = np.isin(letters, ("B", "C"))
        return cls(points, edges, letters, angles, one_sided(faces, edges, cut, len(points)))


def unfolded_pattern(frame: Mapping[str, Any], factor: float) -> CreasePattern:
    """The pattern of a sheet of which ``frame`` holds the folded form; ``factor`` is its unit, mm.

    Raises :class:`~miurafab.errors.PatternError` for what does not lie flat without stretching.
    """
    sheet = _Sheet.of(frame, factor)
    pattern = CreasePattern(
        vertices_coords=np.zeros((len(sheet.points), 2)),
        edges_vertices=sheet.edges,
        edges_assignment=sheet.letters,
        edges_fold_angle=np.zeros(len(sheet.edges)),
        faces_vertices=sheet.faces,
        folded_coords=sheet.points,
    )
    signs = _signs(frame, sheet, pattern.edges_faces)
    if _is_seen_from_below(pattern, signs):
        pattern = replace(pattern, faces_vertices=reversed_faces(pattern.faces_vertices))
    laid = flattened(pattern)
    return _with_folds(laid, signs, sheet)


def is_unfolded(pattern: CreasePattern) -> bool:
    """Whether the flat pattern of ``pattern`` is what its folded form gives when it is unfolded."""
    if pattern.folded_coords is None:
        return False
    try:
        laid = flattened(pattern)
    except PatternError:
        return False
    if laid.faces_vertices.shape != pattern.faces_vertices.shape:
        return False
    flat = np.column_stack([laid.vertices_coords, np.zeros(len(laid.vertices_coords))])
    return invariants.residuals(replace(pattern, folded_coords=flat)).worst <= SAME


def told_of_unfolding(residual: float, more: str = "") -> Finding:
    """What is told of a flat pattern that is computed from the folded form alone."""
    return Finding(
        "unfolded",
        "The flat pattern is unfolded by miurafab from the folded form that the file holds: sides, "
        f"diagonals and angles of the two fit within {residual:.1g} mean edges.{more}",
    )


def _signs(frame: Mapping[str, Any], sheet: _Sheet, beside: Ints) -> Ints:
    """(E,) 1 for a valley, -1 for a mountain and 0 where the file does not tell; ``beside`` (E, 2)
    are the facets at the edges, -1 for none.
    """
    signs = np.select([sheet.letters == "V", sheet.letters == "M"], [1, -1], 0)
    free = signs == 0
    signs[free] = np.sign(np.nan_to_num(sheet.angles[free])).astype(np.int64)
    orders = numbers_at(frame, "faceOrders", 3)
    if orders is None or not len(orders):
        return np.asarray(signs)
    # a facet that lies on the front of its neighbour is folded over as a valley
    above = {(f, g): s for f, g, s in orders.tolist()}
    for edge in np.flatnonzero(signs == 0).tolist():
        one, other = beside[edge].tolist()
        if one >= 0 and other >= 0:
            side = above.get((one, other), 0) or above.get((other, one), 0)
            signs[edge] = side
    return np.asarray(signs)


def _is_seen_from_below(pattern: CreasePattern, signs: Ints) -> bool:
    """Whether most folds of the folded form have another sign than the file tells."""
    points = pattern.folded_coords
    assert points is not None
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    normals = facet_normals(points, pattern.faces_vertices)
    left, right = (normals[pattern.edges_faces[inner, side]] for side in (0, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        angle = fold_angles(points, pattern.edges_vertices[inner], left, right)
        told = (np.abs(angle) < _TURNED_OVER) & (np.abs(angle) > invariants.EXACT)
    return float((np.sign(angle) * signs[inner])[told].sum()) < 0


def _with_folds(laid: CreasePattern, signs: Ints, sheet: _Sheet) -> CreasePattern:
    """``laid`` with the letters and angles of its folded form, and what is told of them."""
    folds = measured_folds(laid, invariants.residuals(laid))
    count = len(signs)
    sign = np.zeros(len(laid.edges_vertices), dtype=np.int64)
    sign[:count] = signs
    given = np.full(len(sign), np.nan)
    given[:count] = sheet.angles
    inner = (laid.edges_faces >= 0).all(axis=1)
    moving = inner & ~np.isin(laid.edges_assignment, ("C", "J"))
    flat = moving & folds.known & (np.abs(folds.angle) <= folds.within)
    by_form = moving & folds.signed & ~flat
    by_file = moving & ~flat & ~by_form & (sign != 0)
    angle = np.zeros(len(sign))
    angle[by_form] = folds.angle[by_form]
    angle[by_file] = sign[by_file] * np.abs(folds.angle[by_file])
    letter = laid.edges_assignment.copy()
    letter[moving] = "U"
    letter[flat] = "F"
    letter[moving & (angle > 0)] = "V"
    letter[moving & (angle < 0)] = "M"
    letter[~inner] = "B"
    pattern = replace(laid, edges_assignment=letter, edges_fold_angle=angle)
    more = _differences(by_form & (sign * angle < 0), moving & _differs(given, angle, folds.within))
    assert laid.unfolded is not None
    told = (*laid.told, told_of_unfolding(laid.unfolded, more))
    return replace(pattern, told=told)


def _differs(given: Floats, angle: Floats, within: Floats) -> Bools:
    with np.errstate(invalid="ignore"):
        return np.asarray((given != 0) & (np.abs(given - angle) > np.maximum(within, 1e-3)))


def _differences(letters: Bools, angles: Bools) -> str:
    """A sentence on the letters and angles of the file that are not those of its folded form."""
    parts = []
    if letters.any():
        parts.append(f"{int(letters.sum())} letters (first edge {int(np.argmax(letters))})")
    if angles.any():
        parts.append(f"{int(angles.sum())} fold angles (first edge {int(np.argmax(angles))})")
    if not parts:
        return ""
    return f" Of the file, {' and '.join(parts)} are not those of its folded form, which are taken."
