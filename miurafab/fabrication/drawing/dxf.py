"""Sheets as DXF, for cutters and CAD programs: real segments, one layer per operation, in mm.

Every program reads R12. It is written line by line, so a hundred thousand dashes need no memory.
R2010 also states its unit, mm (``$INSUNITS`` = 4), and keeps outlines whole as light-weight
polylines. The y axis points up, as on the sheet. Only this module imports ezdxf.
"""

from __future__ import annotations

import io

import numpy as np

from miurafab.fabrication.toolpath import Toolpath
from miurafab.profiles import OPERATIONS

VERSIONS = ("R12", "R2010")

_DECIMALS = 4

# AutoCAD colour indices nearest to the colours of the SVG layers.
_COLOUR_INDEX = {"engrave": 7, "score": 3, "perforate": 5, "cut": 1}


def sheet_dxf(toolpath: Toolpath, version: str = "R12") -> str:
    """The strokes of one sheet in DXF ``version`` (one of :data:`VERSIONS`), in their order.

    R12 has a LINE for every segment; R2010 a LINE for a stroke of one segment and an LWPOLYLINE for
    other strokes. Layers are named after the operations.
    """
    if version == "R12":
        return _r12(toolpath)
    if version == "R2010":
        return _r2010(toolpath)
    raise ValueError(f"version must be one of {VERSIONS}, not {version!r}")


def _r12(toolpath: Toolpath) -> str:
    within = np.ones(max(len(toolpath.points) - 1, 0), dtype=bool)
    within[toolpath.offsets[1:-1] - 1] = False
    stroke = np.searchsorted(toolpath.offsets, np.flatnonzero(within), side="right") - 1
    points = np.round(toolpath.points, _DECIMALS)
    lines = np.concatenate([points[:-1][within], points[1:][within]], axis=1).tolist()
    heads = [f"0\nLINE\n8\n{name}\n62\n{_COLOUR_INDEX[name]}\n" for name in OPERATIONS]
    from ezdxf.addons.r12writer import r12writer

    stream = io.StringIO()
    with r12writer(stream):
        # The writer's add_line takes three times as long.
        stream.writelines(
            f"{heads[operation]}10\n{x0}\n20\n{y0}\n11\n{x1}\n21\n{y1}\n"
            for (x0, y0, x1, y1), operation in zip(
                lines, toolpath.operation[stroke].tolist(), strict=True
            )
        )
    return stream.getvalue()


def _r2010(toolpath: Toolpath) -> str:
    from ezdxf import units
    from ezdxf.filemanagement import new

    document = new("R2010", units=units.MM)
    for name in OPERATIONS:
        document.layers.add(name, color=_COLOUR_INDEX[name])
    space = document.modelspace()
    for index, operation in enumerate(toolpath.operation.tolist()):
        points = toolpath.stroke(index).tolist()
        attributes = {"layer": OPERATIONS[operation]}
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
