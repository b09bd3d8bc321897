"""Drawn profiles: the curve of a surface of revolution or of a cylinder, from a file.

A ``.csv`` or ``.txt`` file has one point a line, two numbers: r and z of a revolution, y and z of a
cylinder. A ``.dxf`` drawing has the profile as its longest curve in the plane: a polyline, a spline
or an arc, flattened to a thousandth of its size. The file of a pattern holds the points.
"""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
from ezdxf import path as curves
from ezdxf.filemanagement import read
from ezdxf.lldxf.const import DXFError

from miurafab.errors import TargetError
from miurafab.files import read_bytes, read_text
from miurafab.geometry.arrays import Floats

PROFILE_SUFFIXES = (".csv", ".txt", ".dxf")

_DRAWN = "LWPOLYLINE POLYLINE SPLINE ARC ELLIPSE LINE"
_FLAT = 1e-3
_SEPARATORS = re.compile(r"[,;\s]+")


def read_profile(path: Path) -> list[list[float]]:
    """The points of the profile in the file ``path``, in its own unit.

    Raises :class:`~miurafab.errors.TargetError` for a file that is missing, of another kind, or
    holds no profile.
    """
    suffix = path.suffix.lower()
    if suffix not in PROFILE_SUFFIXES:
        known = ", ".join(PROFILE_SUFFIXES)
        raise TargetError(f"The profile {path} is not a file of points; known are {known}.")
    if suffix == ".dxf":
        return _longest_curve(path)
    points: list[list[float]] = []
    text = read_text(path, TargetError, "a list of points")
    for number, line in enumerate(text.splitlines(), 1):
        words = _SEPARATORS.split(line.partition("#")[0].strip())
        if words == [""]:
            continue
        try:
            x, y = (float(word) for word in words)
        except ValueError:
            if not points and not any(map(_is_number, words)):
                continue  # the names of the columns
            raise TargetError(
                f"{path}, line {number} is '{line.strip()}'; a profile has two numbers a line."
            ) from None
        points.append([x, y])
    return points


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _longest_curve(path: Path) -> list[list[float]]:
    content = read_bytes(path, TargetError)
    try:
        drawing = read(io.StringIO(content.decode("utf-8", "replace").replace("\r\n", "\n")))
    except (DXFError, OSError, ValueError) as fault:
        reason = " ".join(str(fault).split()).rstrip(".")
        raise TargetError(f"{path} cannot be read as a DXF drawing: {reason}.") from None
    found: list[Floats] = []
    for entity in drawing.modelspace().query(_DRAWN):
        curve = curves.make_path(entity)
        ends = np.array([[p.x, p.y] for p in curve.control_vertices()])
        flat = _FLAT * max(float(np.ptp(ends, axis=0).max()), 1e-12)
        points = np.array([[p.x, p.y] for p in curve.flattening(flat)])
        apart = np.linalg.norm(np.diff(points, axis=0), axis=1) > 0
        found.append(points[np.concatenate([[True], apart])])
    if not found:
        raise TargetError(f"{path} holds no polyline, spline or arc to be a profile.")
    longest = max(found, key=lambda p: float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum()))
    points_list: list[list[float]] = longest.tolist()
    return points_list
