"""The keys of a FOLD document, read with a sentence where one is not what the format says."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import PatternError
from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import ASSIGNMENTS

_UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "pt": 25.4 / 72, "um": 1e-3}


def frames_in(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The key frame and ``file_frames``, each with its inherited keys."""
    listed = document.get("file_frames", [])
    if not isinstance(listed, list) or not all(isinstance(frame, dict) for frame in listed):
        raise PatternError("'file_frames' is not a list of objects.")
    frames: list[Mapping[str, Any]] = [document]
    for number, frame in enumerate(listed, start=1):
        parent = frame.get("frame_parent", 0)
        if not frame.get("frame_inherit"):
            frames.append(frame)
        elif type(parent) is int and 0 <= parent < number:
            frames.append({**frames[parent], **frame})
        else:
            raise PatternError(f"Frame {number} inherits {parent!r}, which is no frame before it.")
    return frames


def classes_of(frame: Mapping[str, Any]) -> list[Any]:
    classes = frame.get("frame_classes")
    return classes if isinstance(classes, list) else []


def unit_mm(frame: Mapping[str, Any], default: float) -> float:
    """The frame's unit in millimetres; ``default`` if it has none, or one that is no length."""
    unit = frame.get("frame_unit")
    return _UNITS_MM.get(unit, default) if isinstance(unit, str) else default


def list_at(document: Mapping[str, Any], key: str) -> list[Any]:
    value = document.get(key)
    if not isinstance(value, list) or not value:
        raise PatternError(f"'{key}' is missing or empty.")
    return value


def points_at(document: Mapping[str, Any], key: str) -> Floats:
    try:
        points = np.array(list_at(document, key), dtype=np.float64)
    except (ValueError, TypeError):
        raise PatternError(f"'{key}' is not a list of points of equal dimension.") from None
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise PatternError(f"'{key}' is not a list of 2D or 3D points.")
    return points


def indices_at(document: Mapping[str, Any], key: str, width: int) -> Ints:
    try:
        indices = np.array(list_at(document, key))
    except ValueError:
        raise PatternError(f"'{key}' is not a list of {width} vertices each.") from None
    if indices.ndim != 2 or indices.shape[1] != width or indices.dtype.kind not in "iu":
        raise PatternError(f"'{key}' is not a list of {width} whole numbers each.")
    if indices.min() < 0:
        raise PatternError(f"'{key}' holds a negative vertex.")
    return indices.astype(np.int64)


def numbers_at(document: Mapping[str, Any], key: str, width: int | None) -> Ints | None:
    """The whole numbers (n,), or (n, ``width``), under ``key``; None where the key is missing."""
    given = document.get(key)
    if given is None:
        return None
    try:
        numbers = np.array(given)
    except ValueError:
        numbers = np.empty(0)
    shaped = numbers.ndim == 1 if width is None else numbers.shape[1:] == (width,)
    if not shaped or numbers.dtype.kind != "i":
        what = "whole numbers" if width is None else f"{width} whole numbers each"
        raise PatternError(f"'{key}' is not a list of {what}.")
    return numbers.astype(np.int64)


_MOST_CORNERS = 20_000_000
"""Of all facets, were each as large as the largest: 160 MB; more where all of them are large."""


def faces_in(document: Mapping[str, Any]) -> Ints:
    faces = list_at(document, "faces_vertices")
    sizes = {len(face) if isinstance(face, list) else 0 for face in faces}
    if min(sizes) < 3:
        raise PatternError("'faces_vertices' holds a facet of fewer than three corners.")
    width = max(sizes)
    if width * len(faces) > max(_MOST_CORNERS, 10 * sum(map(len, faces))):
        raise PatternError(
            f"'faces_vertices' holds a facet of {width} corners, too many beside {len(faces)} "
            "facets; divide it."
        )
    if len(sizes) == 1:
        return indices_at(document, "faces_vertices", width)
    numbers = all(type(v) is int and v >= 0 for face in faces for v in face)
    if not numbers:
        raise PatternError("'faces_vertices' holds something that is not a vertex number.")
    return np.array([face + [-1] * (width - len(face)) for face in faces], dtype=np.int64)


def assignments_in(document: Mapping[str, Any], edges: int) -> NDArray[np.str_]:
    given = document.get("edges_assignment", ["U"] * edges)
    if not isinstance(given, list) or len(given) != edges:
        raise PatternError("'edges_assignment' does not have one letter for each edge.")
    unknown = {str(letter) for letter in given} - set(ASSIGNMENTS)
    if unknown:
        raise PatternError(
            f"'edges_assignment' holds {sorted(unknown)[0]!r}; FOLD knows {', '.join(ASSIGNMENTS)}."
        )
    return np.array(given, dtype="U1")


def fold_angles_in(
    document: Mapping[str, Any], assignment: NDArray[np.str_], missing: float | None = None
) -> Floats:
    """The file's angles in radians. An angle that the file lacks is ``missing``, and without that
    -pi for a mountain, pi for a valley and 0 for others.

    A file lacks them too that gives every mountain and every valley as 0: some programs write the
    flat state of a sheet, and its letters tell what folds.
    """
    flat_folded = np.select([assignment == "M", assignment == "V"], [-180.0, 180.0], 0.0)
    if missing is not None:
        flat_folded[:] = missing
    given = document.get("edges_foldAngle")
    if given is None:
        return np.asarray(np.radians(flat_folded))
    if not isinstance(given, list) or len(given) != len(assignment):
        raise PatternError("'edges_foldAngle' does not have one angle for each edge.")
    try:
        angles = np.array([math.nan if a is None else a for a in given], dtype=np.float64)
    except (ValueError, TypeError):
        raise PatternError("'edges_foldAngle' holds something that is not a number.") from None
    folds = np.isin(assignment, ("M", "V"))
    if not np.nan_to_num(angles[folds]).any():
        angles[folds] = math.nan
    return np.radians(np.where(np.isnan(angles), flat_folded, angles))


def told_without_sizes(
    document: Mapping[str, Any], assignment: NDArray[np.str_], angles: Floats
) -> tuple[Finding, ...]:
    """The finding on a file that gives mountains and valleys as 0 degrees, and none as more; of
    ``angles`` (E,) those are NaN that it lacks (:func:`fold_angles_in`).
    """
    folds = np.isin(assignment, ("M", "V"))
    known = np.isfinite(angles)
    given = [angle is not None for angle in document.get("edges_foldAngle") or [None] * len(folds)]
    if known[folds].any() or not np.array(given)[folds].any():
        return ()
    says = (
        "The file gives no fold an angle but 0 degrees, so no size is known: mountains and valleys "
        "are taken to fold by 180."
    )
    return (Finding("not-proven", says),)


def edges_in(document: Mapping[str, Any]) -> Ints:
    """(E, 2) the edges of the file, or else the sides of its facets, each once."""
    if "edges_vertices" in document or "faces_vertices" not in document:
        return indices_at(document, "edges_vertices", 2)
    faces = faces_in(document)
    size = (faces >= 0).sum(axis=1)
    face, corner = np.nonzero(faces >= 0)
    head = faces[face, (corner + 1) % size[face]]
    pairs = np.sort(np.stack([faces[face, corner], head], axis=1), axis=1)
    return np.unique(pairs, axis=0)
