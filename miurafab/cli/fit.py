"""``miurafab fit``: fit a tessellation to a target, write the pattern and the report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import (
    MachineOption,
    MaterialOption,
    TargetArgument,
    option,
    split,
    takes,
)
from miurafab.cli.ending import spelled
from miurafab.errors import DONE, INTERRUPTED, NO, OptionError
from miurafab.files import new_file, write_text
from miurafab.options import File, Flag
from miurafab.workflow.json_text import json_text

EXAMPLES = (
    "miurafab fit hypar:height=0.5 -o hypar.fold",
    "miurafab fit sphere --facets 12x12 --size 150mm -o sphere.fold",
    "miurafab fit hypar --facets 8x8 --size bed --machine grbl-pen-a4 -o h.fold",
    "miurafab fit hypar --min-edge 4mm --max-deviation 2mm -o coarsest.fold",
    "miurafab fit hypar --facets 6x6 --barrier 1e-4 -o snaps.fold",
)

RigidOption = Annotated[bool, option(Flag(), "The same as --flat-foldable exact.")]


def fit_options() -> type:
    """The class that declares the options of a fit."""
    from miurafab.origami.fitting.request import FitOptions

    return FitOptions


def bed_options() -> type:
    """The class that declares what a size by the bed depends on."""
    from miurafab.workflow.bed_options import BedOptions

    return BedOptions


@takes(fit_options, bed_options)
def fit(
    target: TargetArgument,
    /,
    *,
    out: Annotated[Path, option(File(), "The FOLD file to write.", "-o", "--out")],
    report: Annotated[
        Path | None, option(File(), "Also write the report to this JSON file.")
    ] = None,
    rigid: RigidOption = False,
    machine: MachineOption = None,
    material: MaterialOption = None,
    console: Console = Console(),
    **given: str,
) -> int:
    """Fit a generalized Miura-ori to a target surface.

    Exits with 1 if no sheet meets what you ask for; the answer then says what to change, and the
    nearest sheet is written to NAME.rejected.fold. Ctrl-C ends the search: the best sheet up to
    then is written. With --size bed the shell is as large as the sheets of the machine allow.
    """
    if out.suffix.lower() != ".fold":
        raise OptionError("out", f"is {out}; a fit writes a FOLD file, whose name ends in .fold")
    new_file(out, "The pattern file", (".fold",))
    if rigid:
        given["flat_foldable"] = "exact"
    of_bed, given = split(given, bed_options())
    asked = miurafab.design(target, **given)
    for finding in asked.findings:
        console.note(finding.sentence)
    with console.progress("fitting") as progress:
        result = miurafab.fit(
            asked, machine=machine, material=material, on_progress=progress, **of_bed
        )
    answer = spelled(result.report())
    if result.pattern is not None:
        file = out if result.is_valid else out.with_suffix(".rejected.fold")
        result.pattern.save(file, title=asked.title)
        answer["file"] = str(file)
    if report is not None:
        write_text(report, json_text(answer) + "\n")
    console.answer(answer, lambda: _show(console, answer))
    for finding in result.findings:
        if finding not in asked.findings and finding.sentence not in result.advice:
            console.note(finding.sentence)
    if result.pattern is not None and not result.is_valid:
        console.note(f"The sheet is not valid: it is in {file}, and {out} is as it was.")
    elif result.status == "interrupted":
        console.note(f"Interrupted: {out} is the best sheet up to then.")
        return INTERRUPTED
    return DONE if result.status == "converged" else NO


def _show(console: Console, answer: dict[str, Any]) -> None:
    from miurafab.cli.pattern_report import show_pattern  # no fit that fails at once waits for it

    show_pattern(console, answer)
