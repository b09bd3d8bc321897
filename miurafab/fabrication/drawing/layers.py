"""The layers of the drawings for machines: an operation each, its mountains and its valleys apart.

So a program can make mountains from one side and valleys from the other, or each with its own
settings. The colours are entries of LightBurn's palette, so each becomes a layer there. Valleys are
drawn two and a half times as wide as mountains: in a grey print, too, they can be told apart. The
dashes of both are those of the material, as real segments: importers ignore a dashed line style
and would cut through.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Ints
from miurafab.profiles import OPERATIONS

Letters = NDArray[np.str_]
"""(E,) the assignment of each edge of the pattern; empty where there is no pattern."""
NO_LETTERS: Letters = np.empty(0, dtype=np.str_)
HAIRLINE_MM = 0.1


@dataclass(frozen=True)
class DrawnLayer:
    """One layer: its ``name``, an ``operation`` with the ``fold`` of its creases (M, V, or empty
    for everything else), a ``colour`` #rrggbb, the nearest ``index`` of AutoCAD's colours, and the
    ``pen`` of a plotter with several.
    """

    operation: str
    fold: str
    colour: str
    index: int
    pen: int

    @property
    def name(self) -> str:
        """``cut``, ``perforate-mountain``."""
        return self.operation + {"M": "-mountain", "V": "-valley", "": ""}[self.fold]

    @property
    def line_mm(self) -> float:
        """The width of its lines."""
        return 2.5 * HAIRLINE_MM if self.fold == "V" else HAIRLINE_MM


LAYERS = (
    DrawnLayer("engrave", "", "#000000", 7, 1),
    DrawnLayer("score", "", "#00A000", 92, 2),
    DrawnLayer("score", "M", "#00E000", 3, 2),
    DrawnLayer("score", "V", "#00E0E0", 4, 5),
    DrawnLayer("perforate", "", "#0000A0", 172, 3),
    DrawnLayer("perforate", "M", "#0000FF", 5, 3),
    DrawnLayer("perforate", "V", "#FF00FF", 6, 6),
    DrawnLayer("cut", "M", "#FF8000", 30, 7),
    DrawnLayer("cut", "V", "#A00000", 12, 8),
    DrawnLayer("cut", "", "#FF0000", 1, 4),
)
"""All layers in the order of making. Creases that are cut but for their ends come before outlines,
and creases that are neither mountain nor valley are with their operation.
"""


def layers_of(toolpath: Toolpath, letters: Letters) -> Ints:
    """(S,) the layer of each stroke, an index into :data:`LAYERS`."""
    crease = (toolpath.edge >= 0) & (np.diff(toolpath.offsets) == 2) & (len(letters) > 0)
    crease &= toolpath.operation != OPERATIONS.index("engrave")
    fold = np.full(len(toolpath), " ")
    fold[crease] = letters[toolpath.edge[crease]]
    fold[~np.isin(fold, ["M", "V"])] = ""
    number = {(layer.operation, layer.fold): k for k, layer in enumerate(LAYERS)}
    pairs = zip(toolpath.operation.tolist(), fold.tolist(), strict=True)
    return np.array([number[OPERATIONS[code], each] for code, each in pairs], dtype=np.int64)
