"""``miurafab check``: recompute every invariant of a pattern from its file alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import argument
from miurafab.errors import DONE, NO

EXAMPLES = ("miurafab check hypar.fold", "miurafab check hypar.fold --json")


def check(
    file: Annotated[Path, argument("FILE", "The pattern, a FOLD file.")],
    /,
    *,
    console: Console = Console(),
) -> int:
    """Recompute every invariant of a pattern from its file.

    Exits with 1 if an invariant does not hold.
    """
    result = miurafab.check(file)
    report = result.report()

    def show() -> None:
        hidden = {"findings", "advice", "iterations"}
        console.facts({key: value for key, value in report.items() if key not in hidden})
        console.findings(result.findings)

    console.answer(report, show)
    return DONE if result.valid else NO
