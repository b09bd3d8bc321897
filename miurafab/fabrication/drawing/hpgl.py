"""Sheets as HPGL, for cutting plotters: absolute moves of a pen or blade, a pen for each layer.

A plotter unit is 0.025 mm (HP-GL reference, "plotter units": 40 per millimetre). The file starts
with ``IN`` and ends with the tool lifted and put away (``PU;SP0``), so that it runs alone. A long
outline is split into several instructions, because the buffers of plotters are limited.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from miurafab.fabrication.drawing.layers import LAYERS, NO_LETTERS, Letters, layers_of
from miurafab.fabrication.toolpath import Toolpath

UNITS_PER_MM = 40
POINTS_A_LINE = 32
"""No more points stand in one instruction, so that it stays under 500 characters: half of the 1 KB
that the buffers of the smallest plotters hold (judged).
"""


def sheet_hpgl(
    toolpath: Toolpath, letters: Letters = NO_LETTERS, setup: Mapping[str, str] | None = None
) -> str:
    """The strokes of one sheet as HPGL text, in their order, rounded to plotter units.

    Each layer has its pen; a plotter with one tool holder ignores the number. ``letters`` (E,) is
    the assignment of each pattern edge, ``setup`` are the instructions for speed and force by
    operation, sent after selecting a pen.
    """
    units = np.rint(toolpath.points * UNITS_PER_MM).astype(np.int64)
    words = [f"{x},{y}" for x, y in units.tolist()]
    offsets = toolpath.offsets.tolist()
    lines = ["IN;PA;"]
    pen = None
    for index, number in enumerate(layers_of(toolpath, letters).tolist()):
        layer = LAYERS[number]
        if layer.pen != pen:
            pen = layer.pen
            lines.append(f"PU;SP{pen};{(setup or {}).get(layer.operation, '')}")
        begin, end = offsets[index], offsets[index + 1]
        first, *others = (
            ",".join(words[at : min(at + POINTS_A_LINE, end)])
            for at in range(begin + 1, end, POINTS_A_LINE)
        )
        lines.append(f"PU{words[begin]};PD{first};")
        lines += [f"PD{more};" for more in others]
    lines.append("PU;PU0,0;SP0;")
    return "\n".join(lines) + "\n"
