"""A job of 200 strokes, each at a place of its own, and what of them was burnt how often."""

from __future__ import annotations

from collections import Counter

from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.program import strokes
from miurafab.simulate.beam import BeamSegment

STROKES = 200


def dashes(style: str) -> Job:
    """200 strokes of 2 mm in rows of 20, each at a place of its own."""
    lines = ["G21", "G90", "M4 S0", "M8"]
    x0, y0 = 0.0, 0.0
    for n in range(STROKES):
        x, y = 5 + 3 * (n % 20), 5 + n // 20
        if style == "absolute":
            lines += [f"G0 X{x} Y{y}", f"G1 X{x + 2} S500 F3000"]
        else:
            dx, dy = x - x0, y - y0
            words = "G91 G1 F3000 " if n == 0 else ""
            lines += [f"{words}X{dx:g} Y{dy:g} S0", "X2 S500"]
        x0, y0 = x + 2, y
    return Job(f"{style}.nc", "\n".join([*lines, "M5", "G90", "G0 X0 Y0", ""]))


def burnt(job: Job, logs: list[list[BeamSegment]]) -> Counter[int]:
    """How often each stroke of ``job`` was burnt in full length; 1000 more: in part."""
    table = strokes(parse_program(job))
    place = {}
    for index in range(len(table)):
        (x0, y0), (x1, _) = table.stroke(index)[0][:2], table.stroke(index)[-1][:2]
        place[index] = (x0, x1, y0)
    counts: Counter[int] = Counter()
    for log in logs:
        seen: dict[int, list[tuple[float, float]]] = {}
        for segment in (segment for segment in log if not segment.standing):
            left, right = sorted((segment.x0, segment.x1))
            row, column = round(segment.y0) - 5, int((left + 0.02 - 5) // 3)
            seen.setdefault(20 * row + column, []).append((left, right))
        for index, pieces in seen.items():
            x0, x1, _ = place[index]
            length = sum(right - left for left, right in pieces)
            assert min(left for left, _ in pieces) >= x0 - 0.02
            assert max(right for _, right in pieces) <= x1 + 0.02
            whole = length >= (x1 - x0) - 0.03
            counts[index] += 1 if whole else 0
            if not whole:
                counts[1000 + index] += 1
    return counts
