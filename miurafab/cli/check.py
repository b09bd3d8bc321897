"""``miurafab check``: recompute every invariant of a pattern, or prove a job, from files alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import argument
from miurafab.errors import DONE, NO

EXAMPLES = (
    "miurafab check hypar.fold",
    "miurafab check hypar.fold --json",
    "miurafab check jobs/hypar",
)


def check(
    thing: Annotated[Path, argument("THING", "The pattern, a FOLD file, or a job directory.")],
    /,
    *,
    console: Console = Console(),
) -> int:
    """Recompute every invariant of a pattern, or prove a job, from files alone.

    A job's files are compared with the sums of its manifest, and each burnt stroke is traced back
    to a crease, tab fold, outline, hole or label of the pattern. Exits with 1 if something does not
    hold.
    """
    if thing.is_dir():
        return _check_job(thing, console)
    result = miurafab.check(thing)
    report = result.report()

    def show() -> None:
        hidden = {"findings", "advice", "iterations", "proved"}
        console.facts({key: value for key, value in report.items() if key not in hidden})
        for sentence in result.proved:
            console.line(f"Proved: {sentence}")
        console.findings(result.findings)

    console.answer(report, show)
    return DONE if result.valid else NO


def _check_job(folder: Path, console: Console) -> int:
    result = miurafab.check_job(folder)

    def show() -> None:
        facts: dict[str, object] = {"status": result.report()["status"], "files": result.files}
        facts |= {f"{kind} strokes": number for kind, number in result.traced.items()}
        console.facts(facts)
        console.findings(result.findings)

    console.answer(result.report(), show)
    return DONE if result.valid else NO
