"""From the pattern to the sheets: the motion of each patch, and the texts upright after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from miurafab.fabrication.labels import AbsentLabel, Lettering, place_texts, sides_of
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_frame import DIGITS, Patch
from miurafab.fabrication.partition.patch_outline import OutlinedPatches
from miurafab.fabrication.strokes import RigidTransform
from miurafab.geometry.arrays import Ints
from miurafab.origami.crease_pattern import CreasePattern

if TYPE_CHECKING:
    from miurafab.fabrication.sheets import Placement


def motion_of(
    patches: Sequence[Patch], placements: Sequence[Placement], sheets: Ints
) -> RigidTransform:
    """The motion of each patch from the pattern to its sheet, of number ``sheets`` (P,)."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    moved = np.array(
        [
            placement.from_patch(patch.from_pattern(corners + np.array(patch.origin_mm)))
            for patch, placement in zip(patches, placements, strict=True)
        ]
    )
    matrix = np.stack([moved[:, 1] - moved[:, 0], moved[:, 2] - moved[:, 0]], axis=2)
    origins = np.array([patch.origin_mm for patch in patches])
    shift = moved[:, 0] - np.einsum("nij,nj->ni", matrix, origins)
    return RigidTransform(matrix, shift, sheets)


def texts_of(
    pattern: CreasePattern,
    outlined: OutlinedPatches,
    labels: Sequence[str],
    patches: Sequence[Patch],
    motion: RigidTransform,
    options: LayoutOptions,
) -> Lettering:
    """The texts of all copies, upright on their sheets; ``labels`` (N) are those of the tabs."""
    sides = sides_of(options)
    count, tabs = len(outlined.patches), outlined.lettered
    turns = np.arctan2(motion.matrix[:, 1, 0], motion.matrix[:, 0, 0])
    texts, absent, left_out, unmarked = [], [], 0, 0
    for first in range(0, len(patches), count):
        names = [patch.label for patch in patches[first : first + count]]
        own = turns[first : first + count]
        found = place_texts(pattern, outlined.face_patch, names, tabs, labels, own, sides)
        texts += [replace(text, patch=text.patch + first) for text in found.texts]
        absent += [replace(text, patch=text.patch + first) for text in found.absent]
        left_out += found.left_out
        unmarked += found.unmarked
    return Lettering(texts, absent, left_out, unmarked)


def absent_labels(lettering: Lettering, patches: Sequence[Patch]) -> tuple[AbsentLabel, ...]:
    """The absent texts of ``lettering`` in the frames of their ``patches``, in order."""
    found = []
    for text in lettering.absent:
        patch = patches[text.patch]
        (x, y), ahead = patch.from_pattern(np.stack([text.centre, text.centre + text.along]))
        angle = float(np.degrees(np.arctan2(ahead[1] - y, ahead[0] - x)))
        place = (round(float(value), DIGITS) for value in (x, y, angle, text.height))
        found.append(AbsentLabel(text.patch, text.text, *place))
    return tuple(sorted(found, key=lambda each: (each.patch, each.text, each.x_mm, each.y_mm)))
