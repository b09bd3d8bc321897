"""A reader of G-code of its own: it knows G0, G1, M-words and comments, and nothing of the package,
so that the writer and the package's reader cannot be wrong in the same way.
"""

import re
from dataclasses import dataclass

import numpy as np

WORD = re.compile(r"([A-Z])(-?\d+\.?\d*|-?\.\d+)")


@dataclass
class Stroke:
    operation: str
    patch: str
    points: np.ndarray


def read_strokes(text):
    """Strokes of a program, every point ever visited, and the last words that switch the beam."""
    strokes, visited, switches = [], [(0.0, 0.0)], []
    at, motion, power, armed = (0.0, 0.0), 0, 0.0, False
    operation = patch = None
    open_stroke = None
    for line in text.splitlines():
        assert len(line) <= 70
        assert line.isascii()
        comment = re.fullmatch(r"\((\w+) (.*)\)", line)
        if comment:
            open_stroke = None
            operation = comment[2] if comment[1] == "operation" else operation
            patch = comment[2] if comment[1] == "patch" else patch
            continue
        words = WORD.findall(line)
        assert "".join(f"{a}{b}" for a, b in words) == line.replace(" ", ""), line
        target = dict(zip("XY", at, strict=True))
        for letter, number in words:
            value = float(number)
            if letter == "G" and value in (0, 1):
                motion = int(value)
            elif letter == "M" and value in (2, 3, 4, 5):
                armed = value in (3, 4)
                switches.append(int(value))
            elif letter == "S":
                power = value
            elif letter in "XY":
                target[letter] = value
        to = (target["X"], target["Y"])
        if to == at:
            continue
        visited.append(to)
        if motion == 1 and armed and power > 0:
            if open_stroke is None:
                open_stroke = Stroke(operation, patch, [at])
                strokes.append(open_stroke)
            open_stroke.points.append(to)
        else:
            open_stroke = None
        at = to
    for stroke in strokes:
        stroke.points = np.array(stroke.points)
    return strokes, np.array(visited), switches
