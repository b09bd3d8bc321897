"""The motion of a pattern by whatever way applies to it, and what is known of it.

1. *Closed form*: tangents of half fold angles keep their ratios. It is the motion if every loop
   closes, as in sheets that are flat-foldable with vertices of degree four. Where a pattern of
   others passes through itself so, the third way is tried.
2. *From the folded form*, if the file holds one: one crease is driven, facets bend. A way that is
   lost before it is nearly flat is taken only if the third fails.
3. *From flat*, by mountains and valleys alone: all creases together. This is for any pattern. If
   facets pass through each other on the way, it is gone again with facets that touch.

That the closed form does not close says nothing about other motions. So of the ways 2 and 3 it is
certified whether all facets can stay flat (:mod:`miurafab.origami.folding.certificate`).
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from miurafab.errors import InputError, PatternError
from miurafab.geometry.arrays import Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cut_open import cut_open
from miurafab.origami.energy.bar_hinge import SOFTNESS
from miurafab.origami.energy.continuation import Progress, named
from miurafab.origami.energy.ruled import is_ruled
from miurafab.origami.folding.angles_csv import contacts
from miurafab.origami.folding.bending import bending_motion
from miurafab.origami.folding.certificate import RigidCertificate, certified
from miurafab.origami.folding.first_order import refuse_locked, waiting_folds
from miurafab.origami.folding.flat_edges import without_flat_edges
from miurafab.origami.folding.kinematics import (
    FoldingMotion,
    first_facets,
    half_tangents,
    place,
    rigid_motion,
    states_between,
)
from miurafab.origami.folding.ramp_motion import (
    MOST_WRONG,
    AstrayError,
    RampVerdict,
    followed_once,
    ramp_motion,
)

SOFTER = 10 * SOFTNESS
"""For a sheet that is held back: sides as soft as those of other simulators, which stretch by some
hundredths on the way."""
FINER = 3
"""The steps to a frame of a way that is gone again, since it was lost."""
MOST_AGAIN = 60_000
"""Vertices times steps of a sheet that is followed more than once; another way of a larger one may
take minutes."""
LEAST_FRAMES = 2
"""A way of fewer frames shows no motion."""


@dataclass(frozen=True, eq=False)
class FoundMotion:
    """A ``motion`` with what is known of it.

    ``mismatch`` is that of the closed form, in mean edges, or None where it says nothing; the
    ``certificate`` is None where the closed form is the motion, and the ``verdict`` where the
    motion does not start from flat.
    """

    motion: FoldingMotion
    mismatch: float | None
    verdict: RampVerdict | None = None
    certificate: RigidCertificate | None = None


def find_motion(
    pattern: CreasePattern, steps: int = 40, on_progress: Progress | None = None
) -> FoundMotion:
    """The motion of ``pattern`` in ``steps`` steps.

    Cuts are opened first, and the parts that they leave are pieces. Flat edges of the drawings of
    others are left out (:mod:`miurafab.origami.folding.flat_edges`). Raises
    :class:`~miurafab.errors.PatternError` for a pattern in which nothing folds, or whose folds do
    not go together.
    """
    pattern = cut_open(pattern)
    first_facets(pattern, place(pattern, np.zeros((1, len(pattern.edges_vertices)))).depth)
    lean = without_flat_edges(pattern)
    if pattern.folded_coords is None:
        refuse_locked(lean.pattern, lean.edges)
    try:
        found = _find(lean.pattern, steps, on_progress)
    except AstrayError as astray:
        raise astray.among(lean.edges) from None
    verdict = found.verdict
    if verdict is not None:
        verdict = replace(
            verdict,
            wrong_edges=lean.edges[verdict.wrong_edges],
            waiting_edges=lean.edges[verdict.waiting_edges],
        )
    return replace(found, motion=lean.lifted(found.motion), verdict=verdict)


def _find(pattern: CreasePattern, steps: int, on_progress: Progress | None) -> FoundMotion:
    mismatch = None
    if _has_closed_form(pattern):
        motion = rigid_motion(pattern, states_between(pattern, steps))
        assert motion.mismatch is not None
        mismatch = float(motion.mismatch.max())
        if motion.is_rigid:
            beside = _past_itself(pattern, steps, mismatch, motion, on_progress)
            return beside or FoundMotion(motion, mismatch)
    bent = _bent(pattern, steps, on_progress)
    if bent is not None and len(bent.frames) == steps + 1:
        motion, certificate = certified(bent)
        return FoundMotion(motion, mismatch, None, certificate)
    try:
        return _from_flat(pattern, steps, mismatch, on_progress)
    except PatternError:
        if bent is None or len(bent.frames) < LEAST_FRAMES:
            raise
        return FoundMotion(bent, mismatch)  # the part of the way next to the folded form


def _from_flat(
    pattern: CreasePattern, steps: int, mismatch: float | None, on_progress: Progress | None
) -> FoundMotion:
    softness, waiting = SOFTNESS, waiting_folds(pattern)
    most = MOST_AGAIN // len(pattern.vertices_coords)
    again = steps <= most
    motion, verdict = _followed(pattern, steps, again, waiting, on_progress)
    if verdict.is_held_back and again:
        progress = named(on_progress, "softer paper")
        soft, its_verdict = ramp_motion(
            pattern, steps, softness=SOFTER, waiting=waiting, on_progress=progress
        )
        if its_verdict.is_better_than(verdict):
            softness, motion, verdict = SOFTER, soft, its_verdict

    @cache
    def with_contact(softness: float) -> tuple[FoldingMotion, RampVerdict] | None:
        """None where it ends before its first frame."""
        with suppress(PatternError):
            return ramp_motion(
                pattern,
                steps,
                touching=True,
                softness=softness,
                waiting=waiting,
                on_progress=named(on_progress, "with contact"),
            )
        return None

    met = None
    if verdict.is_held_back and again and verdict.seed_signs == 1.0:
        # all folds begin as they shall, so that it is what they meet on the way that turns them
        met = with_contact(SOFTNESS)
        if met is not None and met[1].is_better_than(verdict):
            motion, verdict = met
    # beside a curved crease facets bend, so that what flat ones could not do says nothing
    ruled = is_ruled(pattern)
    if not again and (verdict.is_held_back or contacts(motion)):
        verdict = replace(verdict, followed_again=most)
    if _is_sequence(verdict, ruled):
        raise _sequence(verdict)
    if again and contacts(motion):
        # where it ends before its first frame, or the folds go astray, the contacts of the way
        # without it are told
        met = met or with_contact(softness)
        if met is not None and (_waits(met[1], ruled) or met[1].wrong_signs <= MOST_WRONG):
            motion, verdict = met
        if _waits(verdict, ruled):  # without contact such folds pass through the sheet
            raise _sequence(verdict)
    rigid, certificate = certified(motion)
    if not (verdict.touching and contacts(rigid)):  # flat facets may touch where bent ones do not
        motion = rigid
    return FoundMotion(motion, mismatch, verdict, certificate)


def _followed(
    pattern: CreasePattern, steps: int, again: bool, waiting: Ints, on_progress: Progress | None
) -> tuple[FoldingMotion, RampVerdict]:
    """The motion from flat. Where it is lost it is gone ``again`` in finer steps: the number of
    frames that are asked for shall not decide whether a pattern folds.
    """
    finely = named(on_progress, "finer steps")
    follow = partial(ramp_motion, pattern, steps, waiting=waiting)
    try:
        motion, verdict = follow(on_progress=on_progress)
    except PatternError:
        return follow(finer=FINER, on_progress=finely)
    if verdict.complete or not again:
        return motion, verdict
    fine, its_verdict = follow(finer=FINER, on_progress=finely)
    farther = its_verdict.complete or len(fine.frames) > len(motion.frames)
    return (fine, its_verdict) if farther else (motion, verdict)


def _is_sequence(verdict: RampVerdict, ruled: bool) -> bool:
    return verdict.wrong_signs > MOST_WRONG or _waits(verdict, ruled)


def _waits(verdict: RampVerdict, ruled: bool) -> bool:
    return verdict.is_held_back and len(verdict.waiting_edges) > 0 and not ruled


def _past_itself(
    pattern: CreasePattern,
    steps: int,
    mismatch: float,
    motion: FoldingMotion,
    on_progress: Progress | None,
) -> FoundMotion | None:
    """The motion from flat for a pattern of others whose closed form passes through itself.

    Where creases fold independently, as in a strip, there are other ways. None if the closed form
    is free of piercings, and if no other way comes near the fold angles without them.
    """
    own = pattern.grid is not None or pattern.cells is not None
    if own or not contacts(motion):
        return None
    try:
        found = _from_flat(pattern, steps, mismatch, on_progress)
    except PatternError:
        return None
    assert found.verdict is not None
    return None if found.verdict.is_held_back or contacts(found.motion) else found


def _has_closed_form(pattern: CreasePattern) -> bool:
    try:
        half_tangents(pattern)
    except PatternError:  # a vertex to which the law of degree four does not apply
        return False
    return True


def _bent(pattern: CreasePattern, steps: int, on_progress: Progress | None) -> FoldingMotion | None:
    """The motion from the folded form; None without one, or where it is in no balance."""
    if pattern.folded_coords is None:
        return None
    try:
        return bending_motion(pattern, steps, on_progress)
    except (InputError, PatternError):
        return None


def _sequence(verdict: RampVerdict) -> PatternError:
    wrong, waiting = verdict.wrong_edges, verdict.waiting_edges
    how = (
        f"creases stay {math.degrees(verdict.angle_error):.0f} degrees away from their fold angles"
    )
    if len(wrong):
        how = (
            f"{verdict.wrong_signs:.0%} of its folds end on the other side than their letter "
            "tells, the first being edge {wrong}"
        )
    begin = "All of them could begin together"
    if len(waiting):
        begin = (
            f"With flat facets {len(waiting)} of its {verdict.folds} folds cannot begin from flat "
            "if none shall turn to its wrong side, the first being edge {waiting}"
        )
    first = {"wrong": wrong, "waiting": waiting}
    return AstrayError(
        f"The pattern does not fold in one motion: with all creases turning together, {how}. "
        f"{begin}. Either letters are wrong, or its facets have to bend from the start, as in some "
        "twists, or it folds in a sequence, crease after crease, like a crane; fold its steps as "
        "patterns of their own." + followed_once(verdict),
        **{name: int(edges[0]) for name, edges in first.items() if len(edges)},
    )
