"""A sheet that is folded flat, drawn with its layers apart: each facet by itself, in its level.

The levels of a :class:`~miurafab.origami.folding.layers.LayerOrder` stand above each other along
the normal of the plane. A small part of the spread stands for the thickness of the paper: then each
picture shows the layer that is on top.
"""

from __future__ import annotations

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import facet_areas, facet_normals
from miurafab.origami.folding.kinematics import FoldingMotion
from miurafab.origami.folding.layers import LayerOrder

SPREAD = 0.6
"""The height of the whole stack with its layers apart, over the diagonal of the sheet."""

CLOSED = 0.01
"""The part of the spread at which the layers count as lying on each other."""


def layer_shifts(motion: FoldingMotion, order: LayerOrder | None) -> Floats | None:
    """(F, 3) by how much each facet of the last frame of ``motion`` moves when the layers stand
    apart, mm.

    None where the motion does not end folded flat, and where the layers have no levels.
    """
    if order is None or order.levels is None or not np.isinf(motion.states[-1]):
        return None
    points, faces = motion.frames[-1], motion.pattern.faces_vertices
    front = np.where(order.folded.up, 1.0, -1.0) * facet_areas(points, faces)
    normal = (np.nan_to_num(facet_normals(points, faces)) * front[:, None]).sum(axis=0)
    normal /= np.linalg.norm(normal)
    height = SPREAD * float(np.linalg.norm(np.ptp(points, axis=0)))
    share = order.levels / max(int(order.levels.max()), 1) - 0.5
    return np.asarray(height * share[:, None] * normal)


def split_facets(points: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """``points`` (..., V, 3) once for each corner of ``faces`` (F, k), and the faces over them."""
    real = faces >= 0
    number = np.full(faces.shape, -1, dtype=np.int64)
    number[real] = np.arange(int(real.sum()))
    return points[..., faces[real], :], number
