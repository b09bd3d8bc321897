"""How the sheet looks on its way: folded to one third, to two thirds, and done.

A sheet that folds rigidly moves by closed form; the parts are those of its median fold angle. Any
other sheet is bent as little as possible (:mod:`miurafab.origami.folding.bending`); the parts are
those of the crease that is driven. Where neither gives a way, only the last form is known.
"""

from __future__ import annotations

from dataclasses import dataclass

from miurafab.errors import InputError, PatternError
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.bending import bending_motion
from miurafab.origami.folding.kinematics import FoldingMotion, rigid_motion, states_between

MOST_FACETS = 6000
"""Up to so many facets the motion is computed: 3,600 take 2 s of processor time, and the effort
grows faster than their number. Larger sheets are shown done."""

_PARTS = 3


@dataclass(frozen=True, eq=False)
class FoldedStates:
    """The ``shapes`` (V, 3) of a sheet in mm with their ``titles``, and how the sheet moves, in a
    sentence.
    """

    titles: tuple[str, ...]
    shapes: tuple[Floats, ...]
    how: str


def folded_states(pattern: CreasePattern) -> FoldedStates:
    """The states of ``pattern`` that a person is shown, the last one the folded form."""
    final = pattern.folded_coords
    if len(pattern.faces_vertices) > MOST_FACETS and final is not None:
        how = f"With more than {MOST_FACETS:,} facets only the finished form is drawn."
        return FoldedStates(("Done",), (final,), how)
    motion, how = _motion(pattern)
    if motion is None or len(motion.frames) <= _PARTS:
        shapes = (() if final is None else (final,)) if motion is None else (motion.frames[-1],)
        return FoldedStates(("Done",)[: len(shapes)], shapes, how)
    one, two, last = motion.frames[1:]
    return FoldedStates(
        ("One third", "Two thirds", "Done"), (one, two, last if final is None else final), how
    )


def _motion(pattern: CreasePattern) -> tuple[FoldingMotion | None, str]:
    """The motion through the parts, and how the sheet moves."""
    try:
        motion = rigid_motion(pattern, states_between(pattern, _PARTS, 1.0))
    except PatternError:
        return None, "How the sheet moves could not be computed, so no state on the way is drawn."
    if motion.is_rigid:
        return motion, "The facets stay flat all the way: only the creases move."
    bends = "The facets cannot all stay flat on the way: the paper bends a little and springs back."
    if pattern.folded_coords is None:
        return None, f"{bends} No state on the way is drawn."
    try:
        motion = bending_motion(pattern, _PARTS)
    except (InputError, PatternError):
        return None, f"{bends} Its way could not be computed, so only the finished form is drawn."
    if len(motion.frames) <= _PARTS:
        return motion, f"{bends} Its way could not be followed to the end: see the finished form."
    return motion, bends
