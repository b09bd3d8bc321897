"""From the pattern to the sheets: the motion of each patch, and the texts upright after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from miurafab.fabrication.labels import Lettering, place_texts
from miurafab.fabrication.partition.patch_frame import Patch
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
) -> Lettering:
    """The texts of all copies, upright on their sheets; ``labels`` (N) are those of the tabs."""
    count = len(outlined.patches)
    turns = np.arctan2(motion.matrix[:, 1, 0], motion.matrix[:, 0, 0])
    texts, left_out, unmarked = [], 0, 0
    for first in range(0, len(patches), count):
        names = [patch.label for patch in patches[first : first + count]]
        own = turns[first : first + count]
        found = place_texts(pattern, outlined.face_patch, names, outlined.tabs, labels, own)
        texts += [replace(text, patch=text.patch + first) for text in found.texts]
        left_out += found.left_out
        unmarked += found.unmarked
    return Lettering(texts, left_out, unmarked)
