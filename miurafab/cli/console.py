"""How every command speaks: a table for people, one JSON object for machines, progress between.

A command builds its answer once, as a plain mapping; :class:`Console` prints it one way or the
other. Progress and notes go to standard error, so that standard output is the answer alone.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import rich.box
import rich.console
import rich.table
from cyclopts import Parameter
from rich.text import Text

from miurafab.cli.declared import EVERY_COMMAND
from miurafab.cli.ending import spelled
from miurafab.findings import Finding
from miurafab.workflow.json_text import json_text


@Parameter(name="*")
@dataclass(frozen=True)
class Console:
    """Where one command's answer, notes and progress go; its fields are options of every command.

    ``wants_json`` prints the answer as JSON, ``is_quiet`` leaves out progress and notes.
    """

    wants_json: Annotated[
        bool,
        Parameter(
            name="--json",
            help="Print one JSON object on standard output, nothing else.",
            group=EVERY_COMMAND,
        ),
    ] = False
    is_quiet: Annotated[
        bool, Parameter(name="--quiet", help="Print no progress and no notes.", group=EVERY_COMMAND)
    ] = False

    @property
    def is_silent(self) -> bool:
        """Whether standard error is for failures alone."""
        return self.wants_json or self.is_quiet

    def answer(self, values: Mapping[str, Any], show: Callable[[], None] | None = None) -> None:
        """Print the answer: ``values`` as JSON, or ``show`` (default: a table of ``values``)."""
        if self.wants_json:
            sys.stdout.write(json_text(spelled(values)) + "\n")
        elif show is not None:
            show()
        else:
            self.facts(values)

    def announce(self, address: str, **more: str) -> None:
        """Print, at once, the ``address`` that another program waits for, in JSON with ``more``."""
        line = json_text({"address": address, **more}) if self.wants_json else address
        sys.stdout.write(line + "\n")
        sys.stdout.flush()

    def facts(self, values: Mapping[str, Any], title: str | None = None) -> None:
        """A two-column table of names and values."""
        table = rich.table.Table(
            title=title and Text(title),
            box=None,
            show_header=False,
            title_justify="left",
            title_style="bold",
        )
        table.add_column(style="cyan", no_wrap=True)
        table.add_column(overflow="fold")
        for name, value in values.items():
            table.add_row(name.replace("_", " "), _cell(value))
        Screen().print(table)

    def rows(
        self, columns: Sequence[str], rows: Sequence[Sequence[Any]], title: str | None = None
    ) -> None:
        """A table with a header; numbers stand to the right."""
        table = rich.table.Table(
            title=title and Text(title),
            box=rich.box.SIMPLE_HEAD,
            title_justify="left",
            title_style="bold",
        )
        for index, column in enumerate(columns):
            numeric = all(isinstance(row[index], int | float) for row in rows)
            justify: Literal["left", "right"] = "right" if numeric and rows else "left"
            table.add_column(column, justify=justify, overflow="fold")
        for row in rows:
            table.add_row(*(_cell(value) for value in row))
        Screen().print(table)

    def line(self, text: str) -> None:
        """One line of the readable answer."""
        Screen().print(spelled(text), markup=False)

    def findings(self, findings: Iterable[Finding]) -> None:
        """One line of the readable answer each; a finding that is no note says what it is."""
        for finding in findings:
            weight = "" if finding.severity == "note" else f"{finding.severity} ({finding.code}): "
            self.line(f"{weight}{finding.sentence}")

    def note(self, text: str) -> None:
        """One line on standard error, unless silent."""
        if not self.is_silent:
            Screen(stderr=True).print(spelled(text), markup=False, style="dim")

    @contextmanager
    def progress(self, label: str) -> Iterator[Callable[[float, str], None]]:
        """A progress bar on standard error; call it with a fraction in 0..1 and a short text."""
        import rich.progress  # only now: no page of help waits for it

        columns = (
            rich.progress.TextColumn("{task.description}"),
            rich.progress.BarColumn(bar_width=28),
            rich.progress.TaskProgressColumn(),
            rich.progress.TextColumn("{task.fields[note]}", style="dim"),
        )
        screen = Screen(stderr=True)
        with rich.progress.Progress(
            *columns, console=screen, disable=self.is_silent or not screen.is_terminal
        ) as bar:
            task = bar.add_task(label, total=1.0, note="")

            def update(fraction: float, note: str = "") -> None:
                bar.update(task, completed=fraction, note=note)

            yield update


def _cell(value: Any) -> Text:
    return Text(readable(spelled(value)))  # as text: a name may hold [brackets]


class Screen(rich.console.Console):
    """A console that hands on that nobody reads it; rich alone would end the process with 1."""

    def __init__(self, *, stderr: bool = False) -> None:
        super().__init__(stderr=stderr, highlight=False, soft_wrap=True)

    def on_broken_pipe(self) -> None:
        """Raise the ``BrokenPipeError`` that is being handled."""
        raise


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
