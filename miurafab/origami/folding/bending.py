"""The motion of a sheet that does not fold rigidly: its facets bend as little as possible.

One crease of the bar-and-hinge model is driven from the folded form towards flat, in static
equilibrium at every step (:mod:`miurafab.origami.energy.path`). In reverse order this is the motion
from nearly flat to the folded form. It does not start at flat, where very many motions meet.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.hinges import hinge_angles
from miurafab.origami.energy.path import folding_path
from miurafab.origami.folding.kinematics import FoldingMotion, laid_on_each_other


def bending_motion(
    pattern: CreasePattern,
    steps: int = 40,
    on_progress: Callable[[float, str], None] | None = None,
) -> FoldingMotion:
    """The quasi-static motion of ``pattern`` from nearly flat to its folded form.

    ``states`` are tan(rho / 2) over its value in the folded form, with rho the driven fold angle,
    like s in a rigid motion. If the solver loses the path, the motion begins where it was lost.
    Raises what :func:`~miurafab.origami.energy.path.folding_path` raises.
    """
    path = folding_path(pattern, steps, on_progress=on_progress)
    model = path.model
    half = np.tan(path.drives[::-1] / 2)
    states = half / half[-1]
    frames = laid_on_each_other(pattern, states, path.coords[::-1])
    angles = np.zeros((len(frames), len(pattern.edges_vertices)))
    for frame, points in enumerate(frames):
        angles[frame, model.creases_edges] = hinge_angles(points, model.creases)
    return FoldingMotion(pattern, states, frames, angles, mismatch=None)
