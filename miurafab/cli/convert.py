"""``miurafab convert``: a pattern from one program's format to another's."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import argument, option, takes
from miurafab.cli.sheets import scale_options
from miurafab.errors import DONE
from miurafab.options import Choice, File

EXAMPLES = (
    "miurafab convert hypar.fold hypar.svg",
    "miurafab convert hypar.fold small.fold --scale 0.5",
    "miurafab convert drawing.svg fine.fold --curve-tolerance 0.05mm",
    "miurafab convert flat.obj sheet.fold --folded folded.obj",
)


def _reading_options() -> type:
    from miurafab.origami.formats.files import ReadingOptions

    return ReadingOptions


@takes(scale_options, _reading_options)
def convert(
    source: Annotated[Path, argument("IN", "A .fold, .svg, .dxf, .cp, .opx or flat .obj file.")],
    target: Annotated[
        Path,
        argument("OUT", "A .fold, .svg, .dxf, .cp, .opx, .obj, .stl or .glb file."),
    ],
    /,
    *,
    folded: Annotated[
        Path | None, option(File(), "The folded form that belongs to a flat .obj file.")
    ] = None,
    form: Annotated[
        str | None,
        option(
            Choice(("flat", "folded")),
            "The form that an .obj, .stl or .glb file shows.",
            default_text="folded where it is known",
        ),
    ] = None,
    console: Console = Console(),
    **given: str,
) -> int:
    """Convert a pattern from one format to another.

    The endings of the files name the formats: FOLD, SVG, DXF, CP, OPX, OBJ, STL and GLB.
    """
    done = miurafab.convert(source, target, folded=folded, form=form, **given)
    for finding in done.findings:
        console.note(finding.sentence)
    report = done.report()
    hidden = {"findings"} if target.suffix.lower() == ".fold" else {"findings", "folded_form"}
    console.answer(
        report, lambda: console.facts({k: v for k, v in report.items() if k not in hidden})
    )
    return DONE
