"""``miurafab doctor``: what is installed, which ports exist, what would stop a job."""

from __future__ import annotations

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption


def doctor(as_json: JsonOption = False, quiet: QuietOption = False) -> None:
    """Say what is installed and what would stop a job.

    Sends nothing to any port. Exit 1 if there is anything that would stop a job.
    """
    console = Console(as_json, quiet)
    report = miurafab.examine()

    def show() -> None:
        console.facts(report.versions, "Installed")
        rows = [(port.device, port.description, port.trouble or "free") for port in report.ports]
        if rows:
            console.rows(("port", "what it is", "state"), rows, "Ports")
        for problem in report.problems:
            console.line(f"Would stop a job: {problem}")
        if not report.problems:
            console.line("Nothing found that would stop a job.")

    console.answer(report.answer(), show)
    if report.problems:
        raise typer.Exit(1)
