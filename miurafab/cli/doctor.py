"""``miurafab doctor``: what is installed, which ports exist, what would stop a job."""

from __future__ import annotations

import miurafab
from miurafab.cli.console import Console
from miurafab.errors import DONE, NO

EXAMPLES = ("miurafab doctor",)


def doctor(*, console: Console = Console()) -> int:
    """Try what is installed, and say what would stop a job and what mends it.

    Loads each library, draws a plot, looks for a browser and at the permissions of the ports. Sends
    nothing to any port. Exits with 1 if anything would stop a job.
    """
    report = miurafab.doctor()

    def show() -> None:
        console.facts(report.versions, "Installed")
        rows = [(port.device, port.description, port.trouble or "free") for port in report.ports]
        if rows:
            console.rows(("port", "what it is", "state"), rows, "Ports")
        for problem in report.problems:
            console.line(f"Would stop a job: {problem}")
        for note in report.notes:
            console.line(f"Note: {note}")
        if not report.problems:
            console.line("Nothing found that would stop a job.")

    console.answer(report.answer(), show)
    return NO if report.problems else DONE
