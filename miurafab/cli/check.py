"""``miurafab check``: recompute every invariant of a pattern, or prove a job, from files alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import argument, option
from miurafab.errors import DONE, NO, OptionError
from miurafab.options import Flag

EXAMPLES = (
    "miurafab check hypar.fold",
    "miurafab check hypar.fold --json",
    "miurafab check jobs/hypar",
    "miurafab check jobs/hypar --rebuild",
)


def check(
    thing: Annotated[Path, argument("THING", "The pattern, a FOLD file, or a job directory.")],
    /,
    *,
    rebuild: Annotated[
        bool,
        option(
            Flag(),
            "Also run the job in memory, fold and glue what the beam has cut, and say how far that "
            "shell lies from the folded form: farther than the material is thick does not hold.",
        ),
    ] = False,
    console: Console = Console(),
) -> int:
    """Recompute every invariant of a pattern, or prove a job, from files alone.

    A job's files are compared with the sums of its manifest, and each burnt stroke is traced back
    to a crease, tab fold, outline, hole or label of the pattern. Exits with 1 if something does not
    hold.
    """
    if thing.is_dir():
        return _check_job(thing, rebuild, console)
    if rebuild:
        raise OptionError("rebuild", f"is for a job directory; {thing} is a pattern")
    result = miurafab.check(thing)
    report = result.report()

    def show() -> None:
        from miurafab.cli.pattern_report import show_pattern

        show_pattern(console, report, opened=True)
        for sentence in result.proved:
            console.line(f"Proved: {sentence}")
        console.findings(result.findings)

    console.answer(report, show)
    return DONE if result.valid else NO


def _check_job(folder: Path, rebuild: bool, console: Console) -> int:
    result = miurafab.check_job(folder)
    again = miurafab.rebuild(folder) if rebuild else None
    answer = result.report()
    if again is not None:
        answer["rebuilt"] = again.report()

    def show() -> None:
        facts: dict[str, object] = {"status": result.report()["status"], "files": result.files}
        facts |= {f"{kind} strokes": number for kind, number in result.traced.items()}
        console.facts(facts)
        console.findings(result.findings)
        if again is not None:
            to_target = (
                ""
                if again.target_mm is None
                else (
                    f" and {again.target_mm:.3g} mm from the target (the folded form "
                    f"{again.folded_target_mm:.3g} mm)"
                )
            )
            console.line(
                f"Folded and glued from the beam log alone, {again.measured} of {again.corners} "
                f"corners lie at worst {again.worst_mm:.3f} mm from the folded form{to_target}."
            )
            if not again.valid:
                console.line(
                    f"That is more than the material is thick ({again.thickness_mm:.3g} mm): what "
                    "is burnt does not make this shell. Lay the pattern out anew."
                )

    console.answer(answer, show)
    return DONE if result.valid and (again is None or again.valid) else NO
