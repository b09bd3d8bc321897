"""A pattern and its motion in matplotlib axes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.kinematics import FoldingMotion
from miurafab.origami.picture import CREASES, DASHES, azimuth_of, fills, project
from miurafab.origami.seam_lines import SEAM_WORDS, seam_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NAMES = {"M": "mountain", "V": "valley", "F": "flat", "U": "unassigned", "B": "border", "C": "cut"}
_NAMES["J"] = "join"


def draw_flat(pattern: CreasePattern, axes: Axes) -> None:
    """The flat pattern in mm, mountains dash-dotted, valleys dashed, and seams numbered."""
    from matplotlib.collections import LineCollection

    lines = seam_lines(pattern)
    seam = np.zeros(len(pattern.edges_vertices), dtype=bool)
    for line in lines:
        seam[line.edges] = True
    for letter, colour in CREASES.items():
        chosen = pattern.edges_vertices[(pattern.edges_assignment == letter) & ~seam]
        if not len(chosen):
            continue
        dashes: Any = (0, DASHES[letter]) if letter in DASHES else "solid"
        axes.add_collection(
            LineCollection(
                list(pattern.vertices_coords[chosen]),
                colors=colour,
                linewidths=0.9,
                linestyles=dashes,
                label=_NAMES[letter],
            )
        )
    for line in lines:
        ends = pattern.vertices_coords[pattern.edges_vertices[line.edges.ravel()]]
        label = SEAM_WORDS.replace(": ", ":\n") if line.number == 1 else None
        axes.add_collection(
            LineCollection(list(ends), colors=line.colour, linewidths=1.8, label=label)
        )
        for x, y in line.places.tolist():
            axes.annotate(
                str(line.number), (x, y), color="white", fontsize=7, ha="center", va="center",
                bbox={"boxstyle": "circle,pad=0.2", "facecolor": line.colour, "edgecolor": "white"},
            )  # fmt: skip
    axes.autoscale()
    axes.set_aspect("equal")
    axes.set_xlabel("mm")
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def draw_folded(pattern: CreasePattern, axes: Any) -> None:
    """The folded form in mm, in three-dimensional axes."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    assert pattern.folded_coords is not None
    points, faces = pattern.folded_coords, pattern.faces_vertices
    azimuth = azimuth_of(points, faces)
    colours = fills(project(points, faces, azimuth)) / 255.0
    polygons = [points[face[face >= 0]] for face in faces]
    axes.add_collection3d(
        Poly3DCollection(polygons, facecolors=colours, edgecolors=0.7 * colours, linewidths=0.3)
    )
    low, high = points.min(axis=0), points.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(np.maximum(high - low, 1e-9))
    axes.view_init(elev=30, azim=math.degrees(azimuth))
    axes.set_xlabel("mm")


def draw_motion(motion: FoldingMotion, axes: Axes, count: int = 5) -> None:
    """``count`` frames of ``motion`` beside each other, all in one scale."""
    from matplotlib.collections import PolyCollection

    faces = motion.pattern.faces_vertices
    left = 0.0
    ticks = []
    for frame in np.unique(np.linspace(0, len(motion.frames) - 1, count).round()).astype(int):
        view = project(motion.frames[frame], faces)
        places = view.places - view.places.min(axis=0) + [left, 0.0]
        width = float(np.ptp(view.places[:, 0]))
        colours = fills(view)[view.order] / 255.0
        axes.add_collection(
            PolyCollection(
                [places[face[face >= 0]] for face in faces[view.order]],
                facecolors=colours,
                edgecolors=0.7 * colours,
                linewidths=0.3,
            )
        )
        ticks.append((left + width / 2, motion.states[frame]))
        left += width + 0.08 * float(np.ptp(motion.frames[0]))
    axes.autoscale()
    axes.set_aspect("equal")
    axes.set_xticks([at for at, _ in ticks], [_state(state) for _, state in ticks])
    axes.set_xlabel("state: 0 is flat, 1 the folded form")
    axes.set_yticks([])
    for side in ("top", "right", "left", "bottom"):
        axes.spines[side].set_visible(False)


def _state(state: float) -> str:
    return "folded flat" if math.isinf(state) else f"{state:.3g}"
