"""The keys of a FOLD document, read with a sentence where one is not what the format says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats, Ints

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
