"""Sheets as DXF, for cutters and CAD programs: real segments, on the layers of drawings, in mm.

Every program reads R12. It is written line by line, so a hundred thousand dashes need no memory.
R2010 keeps outlines whole as light-weight polylines. Both state their unit, mm (``$INSUNITS`` = 4,
``$MEASUREMENT`` = 1): those words came after R12, whose readers skip words that they do not know
(AutoCAD DXF reference, "HEADER section"), and most programs look for them in any file. The y axis
points up, as on the sheet. Only this module imports ezdxf.
"""

from __future__ import annotations

import io

import numpy as np

from miurafab.fabrication.drawing.layers import LAYERS, NO_LETTERS, Letters, layers_of
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Ints

VERSIONS = ("R12", "R2010")

_DECIMALS = 4
_R12_HEADER = "".join(
    f"{line}\n"
    for line in (
        *("0", "SECTION", "2", "HEADER", "9", "$ACADVER", "1", "AC1009"),
        *("9", "$INSUNITS", "70", "4", "9", "$MEASUREMENT", "70", "1", "0", "ENDSEC"),
    )
)
"""Version and unit."""


def sheet_dxf(toolpath: Toolpath, version: str = "R12", letters: Letters = NO_LETTERS) -> str:
    """The strokes of one sheet in DXF ``version`` (one of :data:`VERSIONS`), in their order.

    R12 has a LINE for every segment; R2010 a LINE for a stroke of one segment and an LWPOLYLINE for
    other strokes. ``letters`` (E,) is the assignment of each pattern edge.
    """
    if version == "R12":
        return _r12(toolpath, layers_of(toolpath, letters))
    if version == "R2010":
        return _r2010(toolpath, layers_of(toolpath, letters))
    raise ValueError(f"version must be one of {VERSIONS}, not {version!r}")


def _r12(toolpath: Toolpath, layer: Ints) -> str:
    within = np.ones(max(len(toolpath.points) - 1, 0), dtype=bool)
    within[toolpath.offsets[1:-1] - 1] = False
    stroke = np.searchsorted(toolpath.offsets, np.flatnonzero(within), side="right") - 1
    points = np.round(toolpath.points, _DECIMALS)
    lines = np.concatenate([points[:-1][within], points[1:][within]], axis=1).tolist()
    heads = [f"0\nLINE\n8\n{kind.name}\n62\n{kind.index}\n" for kind in LAYERS]
    from ezdxf.addons.r12writer import r12writer

    stream = io.StringIO()
    stream.write(_R12_HEADER)
    with r12writer(stream):
        # The writer's add_line takes three times as long.
        stream.writelines(
            f"{heads[number]}10\n{x0}\n20\n{y0}\n11\n{x1}\n21\n{y1}\n"
            for (x0, y0, x1, y1), number in zip(lines, layer[stroke].tolist(), strict=True)
        )
    return stream.getvalue()


def _r2010(toolpath: Toolpath, layer: Ints) -> str:
    from ezdxf import units
    from ezdxf.filemanagement import new

    document = new("R2010", units=units.MM)
    for number in np.unique(layer).tolist():
        kind = LAYERS[number]
        # In hundredths of a mm, of the widths that the format knows.
        weight = 25 if kind.fold == "V" else 9
        document.layers.add(kind.name, color=kind.index, lineweight=weight)
    space = document.modelspace()
    for index, number in enumerate(layer.tolist()):
        points = toolpath.stroke(index).tolist()
        attributes = {"layer": LAYERS[number].name}
        if len(points) == 2:
            space.add_line(points[0], points[1], dxfattribs=attributes)
        else:
            closed = points[0] == points[-1]
            space.add_lwpolyline(
                points[:-1] if closed else points, close=closed, dxfattribs=attributes
            )
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue()
