"""Rim numbers on the sheet: each row has its number on the waste beside both of its ends.

A number stands upright on the sheet, outside of all patches, of the free margin and of defects. It
stands where its row would go on, as near to the rim as it has room. One without room is left out:
the guide shows all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from miurafab.fabrication.kit.rim import RimEnd, rim_ends
from miurafab.fabrication.kit.rows import crease_lines
from miurafab.fabrication.labels import CLEARANCE_MM, PlacedText
from miurafab.fabrication.lettering import text_width
from miurafab.fabrication.nesting import Ring, turned
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_frame import Patch
from miurafab.fabrication.strokes import Blank, RigidTransform
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern

_HEIGHTS_MM = (3.0, 2.0, 1.5)
"""Heights of a number in mm that are tried, the largest first (as for the labels of tabs)."""
_AWAY_MM = np.arange(0.0, 8.1, 1.0)
"""So far from its first place towards the outside a number is tried, in mm. Farther off nobody
would see to which row it belongs."""
_SAFE_MM = 0.5
"""More clearance to a cut than to a crease, since the cut takes half its kerf."""


@dataclass(frozen=True, eq=False)
class RimTexts:
    """The ``texts`` beside the patches, and the number ``left_out`` for lack of room."""

    texts: tuple[PlacedText, ...] = ()
    left_out: int = 0


def rim_texts(
    pattern: CreasePattern,
    face_patch: Ints,
    patches: Sequence[Patch],
    motion: RigidTransform,
    blanks: Sequence[Blank],
    defects: Sequence[Sequence[Ring]],
    options: LayoutOptions,
) -> RimTexts:
    """The rim numbers of all ``patches`` on the sheets ``blanks`` with their ``defects``, if the
    ``options`` ask for them.
    """
    if not options.rim_numbers:
        return RimTexts()
    lines = crease_lines(pattern)
    count = int(face_patch.max()) + 1
    ends = [rim_ends(pattern, lines, face_patch == number) for number in range(count)]
    outlines = [
        shapely.Polygon(_moved(motion, k, turned(p.outline_mm, -p.rotation_deg) + p.origin_mm))
        for k, p in enumerate(patches)
    ]
    texts: list[PlacedText] = []
    left_out = 0
    for sheet, blank in enumerate(blanks):
        own = np.flatnonzero(motion.sheet == sheet).tolist()
        solid = [outlines[k].buffer(CLEARANCE_MM + _SAFE_MM) for k in own]
        solid += [shapely.Polygon(ring) for ring in defects[sheet]]
        waste = _Waste(blank, solid)
        for number in own:
            for end in ends[number % count]:
                text = waste.placed(number, end, motion)
                left_out += text is None
                texts += [] if text is None else [text]
    return RimTexts(tuple(texts), left_out)


def _moved(motion: RigidTransform, patch: int, points: Floats) -> Floats:
    return np.asarray(points @ motion.matrix[patch].T + motion.shift[patch])


class _Waste:
    """The free room of one sheet, which shrinks with each number placed in it."""

    def __init__(self, blank: Blank, solid: Sequence[shapely.Polygon]) -> None:
        low = blank.margin + CLEARANCE_MM
        self.inside = np.array([low, low, blank.width - low, blank.height - low])
        self.solid = shapely.union_all(solid)
        shapely.prepare(self.solid)
        self.taken: list[Floats] = []

    def placed(self, patch: int, end: RimEnd, motion: RigidTransform) -> PlacedText | None:
        """The number at an ``end`` of a row of ``patch``, None without room."""
        matrix = motion.matrix[patch]
        at, out = _moved(motion, patch, end.at[None])[0], matrix @ end.out
        for height in _HEIGHTS_MM:
            half = np.array([height * text_width(end.name), height]) / 2
            # The box of the number touches the clearance when its middle is so far off.
            first = float((half + CLEARANCE_MM + _SAFE_MM) @ np.abs(out))
            middles = at + (first + _AWAY_MM)[:, None] * out
            boxes = np.concatenate([middles - half, middles + half], axis=1)
            free: Bools = np.asarray((boxes[:, :2] >= self.inside[:2]).all(axis=1))
            free &= (boxes[:, 2:] <= self.inside[2:]).all(axis=1)
            free &= ~shapely.intersects(self.solid, shapely.box(*boxes.T))
            other = np.array(self.taken).reshape(1, -1, 4)
            apart: Bools = np.asarray((boxes[:, None, :2] > other[..., 2:]).any(axis=2))
            apart |= (boxes[:, None, 2:] < other[..., :2]).any(axis=2)
            free &= apart.all(axis=1)
            if free.any():
                k = int(np.argmax(free))
                pad = np.array([-CLEARANCE_MM, -CLEARANCE_MM, CLEARANCE_MM, CLEARANCE_MM])
                self.taken.append(boxes[k] + pad)
                centre = matrix.T @ (middles[k] - motion.shift[patch])
                upright = matrix.T @ np.array([1.0, 0.0])
                return PlacedText(patch, end.name, centre, upright, height, "front", beside=True)
        return None
