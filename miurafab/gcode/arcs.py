"""Arcs divided into chords, as the controller divides them.

An arc of angle phi and radius r becomes n chords that stay within the tolerance t of the arc. A
chord of angle a leaves the arc by the sagitta r (1 - cos(a/2)). With the sagitta equal to t, half a
chord has the length sqrt(t (2 r - t)), so n = floor(phi r / 2 / sqrt(t (2 r - t)))
(``motion_control.c``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from miurafab.gcode.numbers import to_unsigned

_FULL_TURN_WITHIN = 5e-7
"""rad; an arc that ends this near its start is a full circle (``config.h``)."""


def centre_from_radius(
    x: float, y: float, radius: float, clockwise: bool
) -> tuple[float, float] | None:
    """The centre, relative to the start, of the arc to (``x``, ``y``); None if ``radius`` is too
    small.

    The centre lies on the perpendicular bisector of the chord of length d, at the distance
    h = sqrt(r^2 - d^2/4): centre = (x, y)/2 + h (-y, x)/d for a counterclockwise arc of less
    than half a turn. A negative radius selects the longer arc. For d = 0 the centre is NaN, as in
    the firmware.
    """
    chord_sqr = x * x + y * y
    height_sqr = 4.0 * radius * radius - chord_sqr
    if height_sqr < 0.0:
        return None
    side = math.sqrt(height_sqr / chord_sqr) if chord_sqr else math.nan
    if clockwise != (radius < 0.0):
        side = -side
    return 0.5 * (x - y * side), 0.5 * (y + x * side)


def arc_chords(
    start: Sequence[float],
    end: Sequence[float],
    centre: Sequence[float],
    radius: float,
    plane: tuple[int, int, int],
    clockwise: bool,
    tolerance: float,
) -> tuple[int, list[list[float]]]:
    """The number of chords of the arc, and their end points in order; the last is ``end``.

    An arc too short for a chord has the count 0 and becomes the straight line to ``end``.
    ``centre`` is relative to ``start``; ``plane`` holds the two axes of the arc and the axis of the
    helix; ``tolerance`` in mm.
    """
    first, second, normal = plane
    x0, y0 = start[first] + centre[first], start[second] + centre[second]
    rx, ry = -centre[first], -centre[second]
    tx, ty = end[first] - x0, end[second] - y0
    angle = math.atan2(rx * ty - ry * tx, rx * tx + ry * ty)
    if clockwise and angle >= -_FULL_TURN_WITHIN:
        angle -= 2.0 * math.pi
    elif not clockwise and angle <= _FULL_TURN_WITHIN:
        angle += 2.0 * math.pi
    count = chord_count(angle, radius, tolerance)
    climb = (end[normal] - start[normal]) / max(count, 1)
    ends = []
    for index in range(1, count):
        turn = angle * index / count
        cosine, sine = math.cos(turn), math.sin(turn)
        point = list(end)
        point[first] = x0 + rx * cosine - ry * sine
        point[second] = y0 + rx * sine + ry * cosine
        point[normal] = start[normal] + climb * index
        ends.append(point)
    ends.append(list(end))
    return count, ends


def chord_count(angle: float, radius: float, tolerance: float) -> int:
    """The number of chords of an arc of ``angle`` (rad); 0 stands for a single line."""
    half_chord_sqr = tolerance * (2.0 * radius - tolerance)
    if not half_chord_sqr > 0.0:
        return 0
    return to_unsigned(abs(0.5 * angle * radius) / math.sqrt(half_chord_sqr)) & 0xFFFF
