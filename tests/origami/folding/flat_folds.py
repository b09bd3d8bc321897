"""Small patterns that fold flat, whose orders of layers are known by counting."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from miurafab.origami.crease_pattern import CreasePattern


def pattern_of(
    points: Sequence[Sequence[float]],
    faces: Sequence[Sequence[int]],
    letters: dict[tuple[int, int], str],
    angle: float = np.pi,
) -> CreasePattern:
    """The pattern of ``faces`` with the creases ``letters`` (first) and borders elsewhere."""
    sides = {tuple(sorted((f[i - 1], f[i]))) for f in faces for i in range(len(f))}
    borders = sorted(sides - set(letters))
    marks = np.array([*letters.values(), *["B"] * len(borders)])
    width = max(map(len, faces))
    return CreasePattern(
        vertices_coords=np.array(points, float),
        edges_vertices=np.array([*letters, *borders]),
        edges_assignment=marks,
        edges_fold_angle=np.select([marks == "V", marks == "M"], [angle, -angle], 0.0),
        faces_vertices=np.array([[*f, *[-1] * (width - len(f))] for f in faces]),
    )


def strip(
    letters: str, widths: Sequence[float] | None = None, angle: float = np.pi
) -> CreasePattern:
    """A strip of stamps with creases of these ``letters`` between them."""
    stamps = len(letters) + 1
    x = np.concatenate([[0.0], np.cumsum(widths or [1.0] * stamps)])
    points = [[each, y] for each in x.tolist() for y in (0.0, 1.0)]
    faces = [[2 * n, 2 * n + 2, 2 * n + 3, 2 * n + 1] for n in range(stamps)]
    creases = {(2 * n + 2, 2 * n + 3): letter for n, letter in enumerate(letters)}
    return pattern_of(points, faces, creases, angle)


def grid(columns: int, rows: int) -> CreasePattern:
    """A map of equal squares with unassigned creases."""
    wide = columns + 1
    points = [[c, r] for r in range(rows + 1) for c in range(wide)]
    faces = [
        [r * wide + c, r * wide + c + 1, (r + 1) * wide + c + 1, (r + 1) * wide + c]
        for r in range(rows)
        for c in range(columns)
    ]
    upright = {
        (r * wide + c, (r + 1) * wide + c): "U" for r in range(rows) for c in range(1, columns)
    }
    level = {(r * wide + c, r * wide + c + 1): "U" for r in range(1, rows) for c in range(columns)}
    return pattern_of(points, faces, upright | level)


def flaps(reach: float) -> CreasePattern:
    """A square with a rectangular flap on each side, which folds over it by ``reach`` sides."""
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    out = [[0, -1], [1, 0], [0, 1], [-1, 0]]
    points, faces, creases = list(square), [[0, 1, 2, 3]], {}
    for side, (dx, dy) in enumerate(out):
        a, b = side, (side + 1) % 4
        first = len(points)
        for corner in (a, b):
            x, y = square[corner]
            points.append([x + reach * dx, y + reach * dy])
        faces.append([first, first + 1, b, a])
        creases[min(a, b), max(a, b)] = "V"
    return pattern_of(points, faces, creases)
