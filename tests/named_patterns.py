"""Crease patterns with known names, drawn line by line: flat, with mountains and valleys alone.

Lengths are in mm. ``A`` is half a turn, the angle of a crease that no other angle is known for.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.crease_lines import CreaseLines
from miurafab.origami.formats.planar_graph import pattern_from_lines
from miurafab.origami.miura import MiuraCell, regular_miura
from miurafab.origami.unfold import unfold

A = 180.0

Line = tuple[tuple[float, float], tuple[float, float], str, float]


def drawn(lines: list[Line], size: float = 10.0) -> CreasePattern:
    """The pattern of ``lines``: two ends, a letter, and the size of the fold angle in degrees."""
    sign = {"M": -1.0, "V": 1.0}
    return pattern_from_lines(
        CreaseLines(
            size * np.array([line[:2] for line in lines], dtype=np.float64),
            np.array([line[2] for line in lines]),
            np.radians([sign.get(line[2], 0.0) * line[3] for line in lines]),
        )
    )


def border(*corners: tuple[float, float]) -> list[Line]:
    return [(corners[i - 1], corners[i], "B", 0.0) for i in range(len(corners))]


def flat_only(pattern: CreasePattern) -> CreasePattern:
    """``pattern`` as a file of mountains and valleys alone tells it."""
    angle = np.select(
        [pattern.edges_assignment == "M", pattern.edges_assignment == "V"], [-np.pi, np.pi], 0.0
    )
    return replace(
        pattern,
        folded_coords=None,
        edges_fold_angle=angle,
        target={},
        scale=1.0,
        grid=None,
        cells=None,
        angles_assumed=True,
    )


@cache
def miura(facets: int) -> CreasePattern:
    cell = MiuraCell(across=12.0, along=10.0, alpha=math.radians(65), theta=math.radians(40))
    return flat_only(unfold(regular_miura(cell, facets + 1, facets + 1)))


def waterbomb_base(angle: float = A) -> CreasePattern:
    """One vertex of degree six: two mountains in a line, and four valleys."""
    corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
    folds: list[Line] = [((0.0, 0.0), corner, "V", angle) for corner in corners]
    folds += [((0.0, 0.0), (x, 0.0), "M", angle) for x in (-1.0, 1.0)]
    return drawn(border(*corners) + folds)


def bird_base() -> CreasePattern:
    """Four rabbit ears around the middle; the diagonals stop at a right angle."""
    corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
    lines = border(*corners)
    inward = math.sqrt(2.0) - 1.0  # of the middle of an ear from the side
    for k in range(4):
        one, other = corners[k], corners[(k + 1) % 4]
        middle = ((one[0] + other[0]) / 2, (one[1] + other[1]) / 2)
        ear = (middle[0] * (1 - inward), middle[1] * (1 - inward))
        lines += [((0.0, 0.0), one, "M", 90.0), ((0.0, 0.0), ear, "V", A), (ear, middle, "M", A)]
        lines += [(ear, one, "V", A), (ear, other, "V", A)]
    return drawn(lines)


def square_twist(lean: float = -15.0, far: float = 1.6) -> CreasePattern:
    """A square that turns, with four pleats; its facets have to bend on the way."""
    half = math.sqrt(0.5)
    turns = [math.radians(90.0 * k + lean) for k in (-1, 0, 1, 2)]
    square = [(half * math.cos(turn), half * math.sin(turn)) for turn in turns]
    lines = border((-far, -far), (far, -far), (far, far), (-far, far))
    ways = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
    for k, way in enumerate(ways):
        for at, letter in ((square[k], "M"), (square[(k + 1) % 4], "V")):
            end = tuple(w * far if w else c for w, c in zip(way, at, strict=True))
            lines.append((at, (end[0], end[1]), letter, A))
        lines.append((square[k], square[(k + 1) % 4], "V", A))
    return drawn(lines)


def hexagon_twist(turn: float = 45.0, far: float = 3.0) -> CreasePattern:
    """A hexagon that turns, with six pleats, which leave its sides by ``turn`` degrees."""
    corners = [(math.cos(math.radians(at)), math.sin(math.radians(at))) for at in range(0, 360, 60)]
    lines, rim = [], []
    for k, (x, y) in enumerate(corners):
        after = corners[(k + 1) % 6]
        way = math.atan2(after[1] - y, after[0] - x) - math.radians(turn)
        step = (far * math.cos(way), far * math.sin(way))
        ends = [(a + step[0], b + step[1]) for a, b in ((x, y), after)]
        lines += [((x, y), after, "V", A), ((x, y), ends[0], "M", A), (after, ends[1], "V", A)]
        rim += ends
    return drawn([*border(*rim), *lines])


def windmill() -> CreasePattern:
    """The windmill base: its square in the middle keeps it from folding with flat facets."""
    lines = border((-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0))
    turns = [(1.0, 0.0, 0.0, 1.0), (0.0, -1.0, 1.0, 0.0), (-1.0, 0.0, 0.0, -1.0), (0, 1.0, -1.0, 0)]
    for a, b, c, d in turns:
        at, far, side, following = (
            (a * x + b * y, c * x + d * y) for x, y in ((1, 1), (2, 2), (2, 0), (1, -1))
        )
        lines += [(at, far, "V", A), (at, following, "V", A), (at, side, "M", A)]
    return drawn(lines)


def yoshimura(columns: int = 8, rows: int = 8, angle: float = 72.0) -> CreasePattern:
    """Diamonds: valleys along the rows, mountains across."""
    lines: list[Line] = []

    def at(i: int, j: int) -> tuple[float, float]:
        return (min(max(i + 0.5 * (j % 2), 0.0), columns), 0.5 * j)

    for j in range(rows + 1):
        side = j in (0, rows)
        lines.append(((0.0, 0.5 * j), (float(columns), 0.5 * j), "B" if side else "V", angle))
    for j in range(rows):
        for i in range(columns + 1):
            for step in (-1, 0) if j % 2 == 0 else (0, 1):
                if 0 <= i + step <= columns and at(i, j) != at(i + step, j + 1):
                    lines.append((at(i, j), at(i + step, j + 1), "M", angle))
    lines += border((0.0, 0.0), (columns, 0.0), (columns, 0.5 * rows), (0.0, 0.5 * rows))
    return drawn(lines)


def kresling(columns: int = 8, rows: int = 4, angle: float = 72.0) -> CreasePattern:
    """Storeys of parallelograms, each with a valley across."""
    lean = 0.4

    def at(i: int, j: int) -> tuple[float, float]:
        return (i + lean * j, 0.9 * j)

    lines: list[Line] = []
    for j in range(rows + 1):
        for i in range(columns):
            lines.append((at(i, j), at(i + 1, j), "M" if 0 < j < rows else "B", angle))
    for j in range(rows):
        for i in range(columns + 1):
            lines.append((at(i, j), at(i, j + 1), "M" if 0 < i < columns else "B", angle))
        lines += [(at(i, j), at(i + 1, j + 1), "V", angle) for i in range(columns)]
    return drawn(lines)


def waterbombs(columns: int = 5, rows: int = 4, angle: float = A) -> CreasePattern:
    """Columns of waterbomb bases, each column half a base lower than the one before."""
    lines: list[Line] = []
    width, height = 2.0 * columns, 2.0 * rows
    lines += [((2.0 * i, 0.0), (2.0 * i, height), "M", angle) for i in range(1, columns)]
    lines += [((0.0, float(j)), (width, float(j)), "M", angle) for j in range(1, 2 * rows)]
    for i in range(columns):
        x = 2.0 * i
        for j in range(2 * rows):
            up = (i + j) % 2 == 0  # the middle of a base lies at the upper end of this row
            far, near = (float(j), float(j + 1)) if up else (float(j + 1), float(j))
            lines += [((x, far), (x + 1, near), "V", angle)]
            lines += [((x + 2, far), (x + 1, near), "V", angle)]
    return drawn(lines + border((0.0, 0.0), (width, 0.0), (width, height), (0.0, height)))


def resch(columns: int = 5, rows: int = 5, part: float = 1.0) -> CreasePattern:
    """Resch's triangles: between the small ones, the large ones sink into the sheet as stars."""
    lines: list[Line] = []

    def ray(middle: tuple[float, float], far: float, degrees: float) -> tuple[float, float]:
        turn = math.radians(degrees)
        return (middle[0] + far * math.cos(turn), middle[1] + far * math.sin(turn))

    for i in range(columns):
        for j in range(rows):
            middle = (1.5 * i, math.sqrt(3) * (j + 0.5 * (i % 2)))
            for k in (0, 120, 240):
                tip = ray(middle, 2 / math.sqrt(3), 90.0 + k)
                lines.append((middle, tip, "V", part * 180.0))
                lines.append((middle, ray(middle, 1 / math.sqrt(3), 30.0 + k), "M", part * 60.0))
                for side in (30.0, 150.0):
                    half = ray(middle, 1 / math.sqrt(3), side + k)
                    lines.append((tip, half, "M", part * 90.0))
    return drawn(lines)


def pleated_hypar(rings: int = 8, angle: float = 60.0) -> CreasePattern:
    """Squares in each other, alternately mountain and valley, with facets that bend freely."""
    lines: list[Line] = []
    for k in range(rings, 0, -1):
        corners = [(-k, -k), (k, -k), (k, k), (-k, k)]
        letter = "MV"[k % 2]
        for at, other in zip(corners, corners[1:] + corners[:1], strict=True):
            lines.append((at, other, "B" if k == rings else letter, angle))
            inner = (at[0] * (k - 1) / k, at[1] * (k - 1) / k)
            if k > 1:
                lines.append((inner, at, "VM"[k % 2], angle))
                next_inner = (other[0] * (k - 1) / k, other[1] * (k - 1) / k)
                across = (next_inner, at) if k % 2 else (inner, other)
                lines.append((*across, "U", 0.0))
    lines.append(((-1.0, -1.0), (1.0, 1.0), "U", 0.0))
    return drawn(lines)


def roll(count: int = 8, angle: float = 100.0, shrinking: float = 1.0) -> CreasePattern:
    """A strip that rolls up into itself, each facet ``shrinking`` times as long as the last."""
    places = [0.0]
    for k in range(count):
        places.append(places[-1] + shrinking**k)
    lines = border((0.0, 0.0), (places[-1], 0.0), (places[-1], 1.0), (0.0, 1.0))
    lines += [((x, 0.0), (x, 1.0), "V", angle) for x in places[1:-1]]
    return drawn(lines)
