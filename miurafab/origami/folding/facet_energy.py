"""The energy with which a motion bends its facets, frame by frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from miurafab.errors import InputError, PatternError
from miurafab.geometry.arrays import Floats
from miurafab.origami.energy.pieces import piece_models
from miurafab.origami.folding.kinematics import FoldingMotion


def facet_energies(motion: FoldingMotion) -> Floats | None:
    """(T,) the bending energy of all facets in each frame of ``motion``, in k_f times the mean
    edge of their piece; creases turn freely (:mod:`miurafab.origami.energy.bar_hinge`).

    None for a pattern that the model cannot take, for its facets are too thin.
    """
    pattern = motion.pattern
    if pattern.folded_coords is None:
        flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
        pattern = replace(pattern, folded_coords=flat)
    try:
        models = piece_models(pattern)
    except (InputError, PatternError):
        return None
    return np.array(
        [
            sum(
                model.energy(points[piece.vertices] / model.unit_mm)
                for piece, model in models
                if model is not None
            )
            for points in motion.frames
        ]
    )
