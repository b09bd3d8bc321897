"""``miurafab convert``: a pattern from one program's format to another's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.units import parse_length


def convert(
    source: Annotated[
        Path, typer.Argument(metavar="IN", help="A .fold .svg .dxf .cp .opx or flat .obj file.")
    ],
    target: Annotated[
        Path,
        typer.Argument(metavar="OUT", help="A .fold .svg .dxf .cp .opx .obj .stl or .glb file."),
    ],
    folded: Annotated[
        Path | None, typer.Option(help="The folded form that goes with a flat .obj file.")
    ] = None,
    form: Annotated[
        str | None,
        typer.Option(
            help="What an .obj, .stl or .glb shows: flat or folded [default: folded if known]."
        ),
    ] = None,
    tolerance: Annotated[
        str | None,
        typer.Option(
            help="How near the ends of lines in a drawing count as met "
            "[default: a ten-thousandth of the median line]."
        ),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Convert a pattern between FOLD and other formats.

    SVG, DXF, CP, OPX, OBJ, STL and GLB.
    """
    console = Console(as_json, quiet)
    near = None if tolerance is None else parse_length(tolerance)
    done = miurafab.convert(source, target, folded=folded, form=form, tolerance=near)
    for remark in done.remarks:
        console.remark(remark)
    report = done.report()
    console.answer(
        report, lambda: console.facts({k: v for k, v in report.items() if k != "remarks"})
    )
