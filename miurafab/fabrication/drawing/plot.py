"""The strokes of a sheet in matplotlib axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from miurafab.fabrication.toolpath import Toolpath
from miurafab.profiles import OPERATIONS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Apart for colour-blind eyes (after Okabe and Ito, "Color Universal Design", 2008).
_COLOURS = {"engrave": "#cc79a7", "score": "#1a80bf", "perforate": "#009e73", "cut": "#d55e00"}


def draw_toolpath(toolpath: Toolpath, axes: Axes) -> None:
    """The strokes in mm, a colour for each operation, on the outline of the sheet."""
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Rectangle

    size = toolpath.width_mm, toolpath.height_mm
    axes.add_patch(Rectangle((0, 0), *size, fill=False, edgecolor="#9aa4af", linewidth=0.8))
    for code, name in enumerate(OPERATIONS):
        strokes = [toolpath.stroke(i) for i in np.flatnonzero(toolpath.operation == code).tolist()]
        if strokes:
            axes.add_collection(
                LineCollection(strokes, colors=_COLOURS[name], linewidths=0.7, label=name)
            )
    axes.set(xlim=(-0.02 * size[0], 1.02 * size[0]), ylim=(-0.02 * size[1], 1.02 * size[1]))
    axes.set_aspect("equal")
    axes.set_title(toolpath.sheet)
    axes.set_xlabel("mm")
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
