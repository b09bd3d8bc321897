"""``miurafab check``: recompute every invariant of a pattern from its file alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.findings import findings_json


def check(
    file: Annotated[Path, typer.Argument(help="The FOLD file.")],
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Recompute every invariant of a pattern from its file.

    Exit 1 if one fails.
    """
    console = Console(as_json, quiet)
    pattern, surface, findings = miurafab.load_pattern(file)
    result = miurafab.check(pattern, surface)
    findings += result.findings
    report = result.report() | {"findings": findings_json(findings)}

    def show() -> None:
        hidden = {"findings", "advice", "iterations"}
        console.facts({key: value for key, value in report.items() if key not in hidden})
        console.findings(findings)

    console.answer(report, show)
    if not result.valid:
        raise typer.Exit(1)
