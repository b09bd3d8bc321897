"""How help looks: a title a group, one row an option, no boxes, as wide as the terminal."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

from rich.text import Text

if TYPE_CHECKING:
    from cyclopts.help import HelpEntry, HelpPanel
    from rich.console import Console, ConsoleOptions

NAME_SHARE, MOST_FOR_NAMES = 0.35, 30
"""The widest column of names, in parts of the width and in characters; a longer name has a line of
its own."""
GAP = 4
"""The spaces before a name and between a name and its meaning, together."""


class HelpFormatter:
    """What cyclopts calls for each part of a page of help."""

    def __call__(self, console: Console, options: ConsoleOptions, panel: HelpPanel) -> None:
        """Print one group of options or commands."""
        if not panel.entries:
            return
        names = [_names(entry) for entry in panel.entries]
        room = min(MOST_FOR_NAMES, int(NAME_SHARE * console.width))
        column = max((len(name) for name in names if len(name) <= room), default=room)
        page = Text()
        page.append(str(panel.title), "bold")
        for name, entry in zip(names, panel.entries, strict=True):
            page.append("\n  ")
            page.append(name, "cyan")
            lines = textwrap.wrap(
                _meaning(entry), console.width - column - GAP, break_on_hyphens=False
            )
            if lines and len(name) <= column:
                page.append(" " * (column - len(name) + 2) + lines.pop(0))
            for line in lines:
                page.append("\n" + " " * (column + GAP) + line)
        page.append("\n")
        console.print(page, soft_wrap=True)

    def render_usage(self, console: Console, options: ConsoleOptions, usage: Any) -> None:
        """Print the usage line."""
        console.print(Text(f"Usage: {str(usage).strip()}\n"), soft_wrap=True)

    def render_description(self, console: Console, options: ConsoleOptions, text: Any) -> None:
        """Print what the command does."""
        for paragraph in _filled(text).split("\n\n"):
            console.print(
                Text(textwrap.fill(paragraph, console.width, break_on_hyphens=False) + "\n"),
                soft_wrap=True,
            )


def _names(entry: HelpEntry) -> str:
    if entry.positional_label:
        return entry.positional_label
    names = ", ".join((*entry.positive_shorts, *entry.positive_names, *entry.negative_names))
    return f"{names} {entry.metavar}" if entry.metavar else names


def _meaning(entry: HelpEntry) -> str:
    text = _filled(entry.description)
    if entry.default not in (None, "", "()", "False"):
        text += f" [default: {entry.default}]"
    return f"{text} [required]" if entry.required else text


def _filled(text: Any) -> str:
    """The paragraphs of a text of cyclopts, each on one line: the terminal's width breaks them."""
    plain = getattr(getattr(text, "primary_renderable", None), "plain", "")
    return "\n\n".join(" ".join(part.split()) for part in plain.split("\n\n")).strip()
