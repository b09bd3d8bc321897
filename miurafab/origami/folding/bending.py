"""The motion of a sheet that does not fold rigidly: its facets bend as little as possible.

One crease of the bar-and-hinge model is driven from the folded form towards flat, in static
equilibrium at every step (:mod:`miurafab.origami.energy.path`). In reverse order this is the motion
from nearly flat to the folded form. It does not start at flat, where very many motions meet. In a
pattern of several pieces one crease of each is driven, all to the same states.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.hinges import hinge_angles
from miurafab.origami.energy.path import NEARLY_FLAT, main_crease, path_of, towards, trace
from miurafab.origami.energy.pieces import part_of, piece_models
from miurafab.origami.folding.kinematics import FROM_FOLDED, FoldingMotion
from miurafab.origami.folding.laying import laid_on_each_other


def bending_motion(
    pattern: CreasePattern,
    steps: int = 40,
    on_progress: Callable[[float, str], None] | None = None,
) -> FoldingMotion:
    """The quasi-static motion of ``pattern`` from nearly flat to its folded form.

    ``states`` are tan(rho / 2) over its value in the folded form, with rho the driven fold angle,
    like s in a rigid motion. Of several pieces, that with the least angle goes in equal steps. If
    the solver loses the path, the motion begins where it was lost. Raises what
    :func:`~miurafab.origami.energy.path.folding_path` raises.
    """
    models = piece_models(pattern)
    moving = [(piece, model) for piece, model in models if model is not None]
    angles = [
        float(hinge_angles(model.points, model.creases[[main_crease(model)]])[0])
        for _, model in moving
    ]
    least = min(angles, key=abs)
    states = np.tan(towards(NEARLY_FLAT, steps)(least) / 2) / np.tan(least / 2)

    def goals(angle: float) -> Floats:
        return np.asarray(2 * np.arctan(states * np.tan(angle / 2)))

    paths = []
    for number, (_, model) in enumerate(moving):
        progress = part_of(on_progress, number, len(moving))
        paths.append(path_of(trace(model, None, goals, progress)))
    count = min(len(path.drives) for path in paths)
    assert pattern.folded_coords is not None
    frames = np.repeat(pattern.folded_coords[None], count, axis=0)
    turned = np.zeros((count, len(pattern.edges_vertices)))
    for (piece, model), path in zip(moving, paths, strict=True):
        shapes = path.coords[:count][::-1]
        frames[:, piece.vertices] = shapes
        for frame, points in enumerate(shapes):
            turned[frame, model.creases_edges] = hinge_angles(points, model.creases)
    states = states[:count][::-1]
    frames = laid_on_each_other(pattern, states, frames)
    return FoldingMotion(pattern, states, frames, turned, mismatch=None, method=FROM_FOLDED)
