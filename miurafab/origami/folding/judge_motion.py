"""What a person should know of a motion: whether facets bend, stretch or meet, and how it ends."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from miurafab.findings import Finding
from miurafab.origami.folding.angles_csv import Contact
from miurafab.origami.folding.certificate import RigidCertificate
from miurafab.origami.folding.kinematics import FROM_FLAT, RIGID, FoldingMotion
from miurafab.origami.folding.motion import FoundMotion
from miurafab.origami.folding.ramp_motion import HELD_BACK, RampVerdict, followed_once

STRETCH = 1e-4
"""Paper tears at a few hundredths; below this nobody sees that a side stretches."""
DRAWN = 1e-4
"""A residual up to this may come from the rounding of a drawing."""


def motion_findings(found: FoundMotion, contacts: Sequence[Contact]) -> tuple[Finding, ...]:
    """The findings of a motion and of the frames in which it meets itself."""
    return (*found.motion.pattern.told, *_findings(found, contacts))


def median_fold(motion: FoldingMotion, frame: int) -> float:
    """The median of the fold angles in a frame, degrees: of the mountains and valleys, or without
    any of the other creases that turn.
    """
    folds = np.isin(motion.pattern.edges_assignment, ["M", "V"])
    if not folds.any():
        folds = (motion.fold_angles != 0).any(axis=0)
    return float(np.degrees(np.median(np.abs(motion.fold_angles[frame, folds]))))


def _findings(found: FoundMotion, contacts: Sequence[Contact]) -> Iterator[Finding]:
    motion, verdict = found.motion, found.verdict
    if found.certificate is not None and not found.certificate.rigid:
        yield _bends(found.certificate, motion)
    if verdict is not None:
        yield from _of_ramp(verdict, float(motion.states[-1]))
    if contacts:
        frames = f"{len(contacts)} of {len(motion.frames)} positions"
        yield Finding("contacts", f"On the way facets pass through each other in {frames}.")


def _bends(certificate: RigidCertificate, motion: FoldingMotion) -> Finding:
    if motion.method == FROM_FLAT:
        where = f"at {certificate.state:.0%} of its fold angles"
    else:
        frame = int(np.argmin(np.abs(motion.states - certificate.state)))
        where = f"where its median fold angle is {median_fold(motion, frame):.0f} degrees,"
    if certificate.residual <= RIGID:  # flat facets, but perhaps on another motion
        turn = math.degrees(certificate.moved)
        return Finding(
            "bent-facets",
            f"It is not shown that the sheet folds rigidly: {where} its facets bend, and in the "
            f"nearest shape with flat facets a crease is turned by {turn:.2g} degrees more.",
        )
    left = certificate.residual
    rounding = "; so little may be the rounding of the drawing" if left <= DRAWN else ""
    return Finding(
        "bent-facets",
        f"The sheet does not fold rigidly, so its facets bend: {where} no shape with flat facets "
        f"is near: sides stay off by up to {100 * left:.2g} % of the mean edge, or facets "
        f"bent by up to {math.degrees(left):.2g} degrees{rounding}.",
    )


def _of_ramp(verdict: RampVerdict, last: float) -> Iterator[Finding]:
    if not verdict.complete:
        why = "no balance was found"
        if verdict.touching:
            why += " in which no facet passes through another"
        yield Finding(
            "way-lost", f"The motion ends at {last:.0%} of the fold angles: beyond, {why}."
        )
    if verdict.followed_again is not None:
        yield Finding("followed-once", followed_once(verdict).strip())
    if len(verdict.wrong_edges):
        yield Finding(
            "wrong-signs",
            f"{verdict.wrong_signs:.1%} of the folds end on the other side than their letter "
            f"tells, the first being edge {verdict.wrong_edges[0]}.",
            tuple(verdict.wrong_edges.tolist()),
        )
    if verdict.strain.max() > STRETCH:
        yield Finding(
            "stretched",
            f"On the way a side changes its length by up to {100 * verdict.strain.max():.2g} %: "
            "paper that does not stretch would lock.",
        )
    if verdict.unstable.any():
        frames = f"{int((verdict.unstable > 0).sum())} of {len(verdict.unstable)} positions"
        yield Finding("unstable", f"In {frames} the sheet is not stable and would snap away.")
    if verdict.angle_error > HELD_BACK:
        yield Finding(
            "held-back",
            f"Creases stay {math.degrees(verdict.angle_error):.0f} degrees away, in the mean, from "
            "the fold angles asked for: these do not go together.",
        )


def target_frame(motion: FoldingMotion) -> int:
    """The frame nearest to the folded form."""
    return int(np.argmin(np.abs(np.where(np.isfinite(motion.states), motion.states, 1e9) - 1.0)))
