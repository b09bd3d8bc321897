"""What a value shows of itself: one line at a prompt, a picture and a small table in a notebook."""

from __future__ import annotations

import html
import reprlib
from collections.abc import Mapping
from dataclasses import MISSING, Field, is_dataclass
from typing import Any

LONGEST = 160
"""Characters of a line at a prompt."""


class Shown:
    """A mixin for public values. A dataclass that has it is declared with ``repr=False``.

    A class gives what it has: a ``_summary``, a ``_picture``, ``_facts``.
    """

    __slots__ = ()

    def _summary(self) -> str:
        """The value in a few words; by default its fields that are not as they are by default."""
        declared: Mapping[str, Field[Any]] = getattr(self, "__dataclass_fields__", {})
        return ", ".join(
            f"{field.name}={_short(getattr(self, field.name))}"
            for field in declared.values()
            if not _is_default(field, getattr(self, field.name))
        )

    def _picture(self) -> str:
        """The value as SVG; empty for none."""
        return ""

    def _facts(self) -> Mapping[str, object]:
        """The rows of the table."""
        return {}

    def __repr__(self) -> str:
        name, summary = type(self).__name__, self._summary()
        line = f"<{name} {summary}>" if summary else f"<{name}>"
        return line if len(line) <= LONGEST else f"{line[: LONGEST - 4]}...>"

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> dict[str, str]:
        """What a notebook shows (IPython's display protocol)."""
        shown = {"text/plain": repr(self)}
        picture, facts = self._picture(), self._facts()
        if picture:
            picture = picture[picture.index("<svg") :]
            shown["image/svg+xml"] = picture
        if picture or facts:
            shown["text/html"] = f'<div style="max-width:720px">{picture}{_table(facts)}</div>'
        return shown


def number_text(value: object) -> str:
    """A value of a table: four digits of a number are enough to read."""
    if isinstance(value, float):
        return f"{value:.4g}"
    return "-" if value is None else str(value)


def _table(facts: Mapping[str, object]) -> str:
    rows = (
        f"<tr><th style='text-align:left'>{html.escape(name.replace('_', ' '))}</th>"
        f"<td style='text-align:left'>{html.escape(number_text(value))}</td></tr>"
        for name, value in facts.items()
    )
    return f"<table>{''.join(rows)}</table>" if facts else ""


def _short(value: object) -> str:
    """A value in a line: arrays by their shape, nested values by their name."""
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and shape:
        return f"array{shape}"
    if is_dataclass(value):
        return type(value).__name__
    if isinstance(value, tuple | list | dict) and len(value) > 2:
        return f"{len(value)} {'entries' if isinstance(value, dict) else 'values'}"
    if isinstance(value, float):
        return f"{value:.6g}"
    return reprlib.repr(value)


def _is_default(field: Field[Any], value: object) -> bool:
    default = field.default
    if default is MISSING and field.default_factory is not MISSING:
        default = field.default_factory()
    try:
        return default is not MISSING and bool(default == value)
    except ValueError:  # an array
        return False
