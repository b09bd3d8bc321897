"""Pattern files: FOLD 1.2 as this house writes it, and any FOLD file that holds a crease pattern.

The key frame is the flat crease pattern; ``file_frames[0]`` inherits it and holds the folded form.
Numbers are written with as many digits as they need to be read back bit for bit, and the same
pattern gives the same bytes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab import __version__
from miurafab.errors import PatternError
from miurafab.origami.crease_pattern import ASSIGNMENTS, CreasePattern

_UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "pt": 25.4 / 72, "um": 1e-3}


def fold_text(pattern: CreasePattern, title: str = "") -> str:
    """``pattern`` as the text of a FOLD 1.2 file, one top-level key a line."""
    keys: dict[str, Any] = {
        "file_spec": 1.2,
        "file_creator": f"miurafab {__version__}",
        "file_title": title,
        "file_classes": ["singleModel"],
        "frame_classes": ["creasePattern"],
        "frame_attributes": ["2D"],
        "frame_unit": "mm",
        "vertices_coords": pattern.vertices_coords.tolist(),
        "edges_vertices": pattern.edges_vertices.tolist(),
        "edges_assignment": pattern.edges_assignment.tolist(),
        "edges_foldAngle": np.degrees(pattern.edges_fold_angle).tolist(),
        "faces_vertices": _polygons(pattern.faces_vertices),
    }
    if pattern.folded_coords is not None:
        keys["file_frames"] = [
            {
                "frame_classes": ["foldedForm"],
                "frame_attributes": ["3D"],
                "frame_parent": 0,
                "frame_inherit": True,
                "frame_unit": "mm",
                "vertices_coords": pattern.folded_coords.tolist(),
            }
        ]
    if pattern.grid is not None:
        keys["miurafab:grid"] = list(pattern.grid)
    if pattern.target:
        keys["miurafab:target"] = pattern.target
        keys["miurafab:scale"] = pattern.scale
    if not title:
        del keys["file_title"]
    lines = (
        f"{json.dumps(key)}: {json.dumps(value, separators=(',', ':'), allow_nan=False)}"
        for key, value in keys.items()
    )
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _polygons(faces: NDArray[np.int64]) -> list[list[int]]:
    if (faces >= 0).all():
        whole: list[list[int]] = faces.tolist()
        return whole
    return [[v for v in face if v >= 0] for face in faces.tolist()]


def write_fold(pattern: CreasePattern, path: Path, title: str = "") -> None:
    """Write ``pattern`` to the FOLD file ``path``."""
    path.write_text(fold_text(pattern, title), encoding="utf-8", newline="\n")


def read_fold(path: Path) -> CreasePattern:
    """The pattern in the FOLD file ``path``.

    Raises :class:`~miurafab.errors.PatternError` naming the file and what is wrong with it.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise PatternError(f"{path} does not exist.") from None
    except OSError as fault:
        raise PatternError(f"{path} cannot be read: {fault.strerror}.") from None
    except UnicodeDecodeError:
        raise PatternError(f"{path} is not a FOLD file: it is not UTF-8 text.") from None
    try:
        document = json.loads(text)
    except json.JSONDecodeError as fault:
        raise PatternError(
            f"{path} is not a FOLD file: line {fault.lineno} is not JSON ({fault.msg})."
        ) from None
    except RecursionError:
        raise PatternError(f"{path} is not a FOLD file: it is nested too deeply.") from None
    try:
        return parse_fold(document)
    except PatternError as fault:
        raise PatternError(f"{path}: {fault}") from None


def parse_fold(document: Any) -> CreasePattern:
    """The pattern in a parsed FOLD document. Raises ``PatternError`` naming the key at fault."""
    if not isinstance(document, dict):
        raise PatternError("A FOLD file holds one JSON object.")
    unit = document.get("frame_unit", "mm")
    factor = _UNITS_MM.get(unit, 1.0) if isinstance(unit, str) else 1.0
    flat = _coordinates(document, "vertices_coords") * factor
    edges = _indices(document, "edges_vertices", 2)
    if flat.shape[1] == 3:
        if np.ptp(flat[:, 2]) > 1e-9 * np.ptp(flat[:, :2]):
            raise PatternError("vertices_coords of the key frame is not a flat crease pattern.")
        flat = flat[:, :2]
    faces = _face_indices(document)
    assignment = _assignments(document, len(edges))
    return CreasePattern(
        vertices_coords=np.ascontiguousarray(flat),
        edges_vertices=edges,
        edges_assignment=assignment,
        edges_fold_angle=_fold_angles(document, assignment),
        faces_vertices=faces,
        folded_coords=_folded(document, len(flat), factor),
        grid=_grid(document, len(flat)),
        scale=_scale(document),
        target=_target(document),
    )


def _array(document: Mapping[str, Any], key: str) -> list[Any]:
    value = document.get(key)
    if not isinstance(value, list) or not value:
        raise PatternError(f"'{key}' is missing or empty.")
    return value


def _coordinates(document: Mapping[str, Any], key: str) -> NDArray[np.float64]:
    try:
        points = np.array(_array(document, key), dtype=np.float64)
    except (ValueError, TypeError):
        raise PatternError(f"'{key}' is not a list of points of equal dimension.") from None
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise PatternError(f"'{key}' is not a list of 2D or 3D points.")
    return points


def _indices(document: Mapping[str, Any], key: str, width: int) -> NDArray[np.int64]:
    try:
        found = np.array(_array(document, key))
    except ValueError:
        raise PatternError(f"'{key}' is not a list of {width} vertices each.") from None
    if found.ndim != 2 or found.shape[1] != width or found.dtype.kind not in "iu":
        raise PatternError(f"'{key}' is not a list of {width} whole numbers each.")
    if found.min() < 0:
        raise PatternError(f"'{key}' holds a negative vertex.")
    return found.astype(np.int64)


def _face_indices(document: Mapping[str, Any]) -> NDArray[np.int64]:
    faces = _array(document, "faces_vertices")
    sizes = {len(face) if isinstance(face, list) else 0 for face in faces}
    if min(sizes) < 3:
        raise PatternError("'faces_vertices' holds a facet of fewer than three corners.")
    width = max(sizes)
    if len(sizes) == 1:
        return _indices(document, "faces_vertices", width)
    numbers = all(type(v) is int and v >= 0 for face in faces for v in face)
    if not numbers:
        raise PatternError("'faces_vertices' holds something that is not a vertex number.")
    return np.array([face + [-1] * (width - len(face)) for face in faces], dtype=np.int64)


def _assignments(document: Mapping[str, Any], edges: int) -> NDArray[np.str_]:
    given = document.get("edges_assignment", ["U"] * edges)
    if not isinstance(given, list) or len(given) != edges:
        raise PatternError("'edges_assignment' does not have one letter for each edge.")
    unknown = {str(letter) for letter in given} - set(ASSIGNMENTS)
    if unknown:
        raise PatternError(
            f"'edges_assignment' holds {sorted(unknown)[0]!r}; FOLD knows {', '.join(ASSIGNMENTS)}."
        )
    return np.array(given, dtype="U1")


def _fold_angles(document: Mapping[str, Any], assignment: NDArray[np.str_]) -> NDArray[np.float64]:
    """Given angles in radians; without them a mountain is -pi and a valley pi (flat-folded)."""
    flat_folded = np.select([assignment == "M", assignment == "V"], [-180.0, 180.0], 0.0)
    given = document.get("edges_foldAngle")
    if given is None:
        return np.asarray(np.radians(flat_folded))
    if not isinstance(given, list) or len(given) != len(assignment):
        raise PatternError("'edges_foldAngle' does not have one angle for each edge.")
    try:
        angles = np.array([math.nan if a is None else a for a in given], dtype=np.float64)
    except (ValueError, TypeError):
        raise PatternError("'edges_foldAngle' holds something that is not a number.") from None
    return np.radians(np.where(np.isnan(angles), flat_folded, angles))


def _folded(
    document: Mapping[str, Any], vertices: int, factor: float
) -> NDArray[np.float64] | None:
    frames = document.get("file_frames", [])
    if not isinstance(frames, list):
        raise PatternError("'file_frames' is not a list.")
    for frame in frames:
        if isinstance(frame, dict) and "foldedForm" in (frame.get("frame_classes") or []):
            unit = frame.get("frame_unit")
            own = _UNITS_MM.get(unit, factor) if isinstance(unit, str) else factor
            points: NDArray[np.float64] = _coordinates(frame, "vertices_coords") * own
            if points.shape[1] == 2:
                points = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
            if len(points) != vertices:
                raise PatternError(
                    f"The folded form has {len(points)} vertices and the pattern {vertices}."
                )
            return points
    return None


def _grid(document: Mapping[str, Any], vertices: int) -> tuple[int, int] | None:
    grid = document.get("miurafab:grid")
    if grid is None:
        return None
    if (
        not isinstance(grid, list)
        or len(grid) != 2
        or not all(type(n) is int and n >= 2 for n in grid)
        or grid[0] * grid[1] != vertices
    ):
        raise PatternError(f"'miurafab:grid' is {grid}, which does not give {vertices} vertices.")
    return grid[0], grid[1]


def _scale(document: Mapping[str, Any]) -> float:
    scale = document.get("miurafab:scale", 1.0)
    if isinstance(scale, bool) or not isinstance(scale, int | float) or not 0 < scale < math.inf:
        raise PatternError(f"'miurafab:scale' is {scale!r}, not a positive number.")
    return float(scale)


def _target(document: Mapping[str, Any]) -> dict[str, Any]:
    target = document.get("miurafab:target", {})
    if not isinstance(target, dict):
        raise PatternError("'miurafab:target' is not an object.")
    return target
