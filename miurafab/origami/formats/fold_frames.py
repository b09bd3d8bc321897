"""The frames of a FOLD file beside its flat pattern: folded, folded flat, and of a motion.

Each inherits the flat pattern, its key frame, and has its own coordinates.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.kinematics import FoldingMotion
from miurafab.origami.folding.layers import LayerOrder


def written_frames(
    pattern: CreasePattern, motion: FoldingMotion | None, order: LayerOrder | None
) -> list[dict[str, Any]]:
    """The frames of ``pattern``: its folded form, and the frames of a ``motion``.

    The ``order`` of the layers stands in the last frame of a motion that ends folded flat. Without
    a motion a frame that is folded flat holds it.
    """
    frames = []
    if pattern.folded_coords is not None:
        frames.append(_folded(pattern.folded_coords))
    if motion is None:
        if order is not None:
            frames.append(
                {
                    "frame_title": "folded flat",
                    **_folded(order.folded.vertices),
                    "frame_attributes": ["2D"],
                    "edges_foldAngle": np.degrees(order.folded.fold_angles).tolist(),
                    "faceOrders": order.face_orders().tolist(),
                }
            )
        return frames
    for title, state, points, angles in zip(
        frame_titles(motion),
        motion.states.tolist(),
        motion.frames,
        motion.fold_angles,
        strict=True,
    ):
        frames.append(
            {
                "frame_title": title,
                **_folded(points),
                "edges_foldAngle": np.degrees(angles).tolist(),
            }
        )
        if order is not None and math.isinf(state):
            frames[-1]["faceOrders"] = order.face_orders().tolist()
    return frames


def frame_titles(motion: FoldingMotion) -> list[str]:
    """The frames of ``motion`` by the fold angle of the crease that folds farthest before all is
    folded flat, such as ``edge 7 folded by 45.2 degrees``.
    """
    angles = np.degrees(motion.fold_angles)
    open_ = np.isfinite(motion.states)
    if not open_.any():
        return ["folded flat"] * len(angles)
    edge = int(np.abs(angles[open_]).max(axis=0).argmax())
    titles = []
    for state, angle in zip(motion.states.tolist(), np.abs(angles[:, edge]).tolist(), strict=True):
        if math.isinf(state):
            titles.append("folded flat")
        elif state == 0.0:
            titles.append("flat")
        else:
            titles.append(f"edge {edge} folded by {angle:.4g} degrees")
    return titles


def _folded(points: Floats) -> dict[str, Any]:
    return {
        "frame_classes": ["foldedForm"],
        "frame_attributes": ["3D"],
        "frame_parent": 0,
        "frame_inherit": True,
        "frame_unit": "mm",
        "vertices_coords": points.tolist(),
    }
