"""How every command speaks: a table for people, one JSON object for machines, progress between.

A command builds its answer once, as a plain mapping; :class:`Console` prints it one way or the
other. Progress and remarks go to standard error, so that standard output is the answer alone.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Annotated, Any, Literal

import rich.box
import rich.console
import rich.progress
import rich.table
import typer

from miurafab.errors import spell_options
from miurafab.findings import Finding
from miurafab.workflow.json_text import json_text

JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on standard output, nothing else.")
]
QuietOption = Annotated[bool, typer.Option("--quiet", help="Print no progress and no remarks.")]


def spelled(sentence: str) -> str:
    """``sentence`` with the options that it names as the command line writes them."""
    return spell_options(sentence, lambda name: "--" + name.replace("_", "-"))


class Console:
    """Where one command's answer, remarks and progress go."""

    def __init__(self, as_json: bool = False, quiet: bool = False) -> None:
        self.as_json = as_json
        self.silent = as_json or quiet
        self._out = rich.console.Console(highlight=False, soft_wrap=True)
        self._err = rich.console.Console(stderr=True, highlight=False, soft_wrap=True)

    def answer(self, values: Mapping[str, Any], show: Callable[[], None] | None = None) -> None:
        """Print the answer: ``values`` as JSON, or ``show`` (default: a table of ``values``)."""
        if self.as_json:
            sys.stdout.write(json_text(values) + "\n")
        elif show is not None:
            show()
        else:
            self.facts(values)

    def facts(self, values: Mapping[str, Any], title: str | None = None) -> None:
        """A two-column table of names and values."""
        table = rich.table.Table(
            title=title, box=None, show_header=False, title_justify="left", title_style="bold"
        )
        table.add_column(style="cyan", no_wrap=True)
        table.add_column(overflow="fold")
        for name, value in values.items():
            table.add_row(name.replace("_", " "), readable(value))
        self._out.print(table)

    def rows(
        self, columns: Sequence[str], rows: Sequence[Sequence[Any]], title: str | None = None
    ) -> None:
        """A table with a header; numbers stand to the right."""
        table = rich.table.Table(
            title=title, box=rich.box.SIMPLE_HEAD, title_justify="left", title_style="bold"
        )
        for index, column in enumerate(columns):
            numeric = all(isinstance(row[index], int | float) for row in rows)
            justify: Literal["left", "right"] = "right" if numeric and rows else "left"
            table.add_column(column, justify=justify, overflow="fold")
        for row in rows:
            table.add_row(*(readable(value) for value in row))
        self._out.print(table)

    def line(self, text: str) -> None:
        """One line of the readable answer."""
        self._out.print(text, markup=False)

    def findings(self, findings: Iterable[Finding]) -> None:
        """One line of the readable answer each; a finding that is no note says what it is."""
        for finding in findings:
            weight = "" if finding.severity == "note" else f"{finding.severity} ({finding.code}): "
            self.line(f"{weight}{spelled(finding.sentence)}")

    def remark(self, text: str) -> None:
        """One line on standard error, unless silent."""
        if not self.silent:
            self._err.print(spelled(text), markup=False, style="dim")

    @contextmanager
    def progress(self, label: str) -> Iterator[Callable[[float, str], None]]:
        """A progress bar on standard error; call it with a fraction in 0..1 and a short text."""
        columns = (
            rich.progress.TextColumn("{task.description}"),
            rich.progress.BarColumn(bar_width=28),
            rich.progress.TaskProgressColumn(),
            rich.progress.TextColumn("{task.fields[note]}", style="dim"),
        )
        with rich.progress.Progress(
            *columns, console=self._err, disable=self.silent or not self._err.is_terminal
        ) as bar:
            task = bar.add_task(label, total=1.0, note="")

            def update(fraction: float, note: str = "") -> None:
                bar.update(task, completed=fraction, note=note)

            yield update


def readable(value: Any) -> str:
    """A value as people read it: few digits, yes and no, lists with commas."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "-"
    if isinstance(value, float):
        if value == 0 or 1e-3 <= abs(value) < 1e6:
            return f"{value:,.4g}" if abs(value) < 1000 else f"{value:,.0f}"
        return f"{value:.1e}"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {readable(item)}" for key, item in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(readable(item) for item in value)
    return str(value)
