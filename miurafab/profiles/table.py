"""A TOML table that is read strictly: what is not asked for is refused by name.

A reader takes all keys that a class declares (:meth:`Table.options`), or each key with its kind.
:meth:`Table.finish` then refuses the keys that nobody took. So a typo is an error that names the
file, the key and the nearest key that exists, never a line ignored in silence.
"""

from __future__ import annotations

import difflib
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from miurafab.errors import InputError, OptionError, ProfileError, UnitError
from miurafab.files import MOST_TEXT_BYTES, Reading, read_bytes
from miurafab.options import Kind, read_options
from miurafab.units import parse_length

_REQUIRED: Any = object()
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
T = TypeVar("T")


def read_toml(path: Path, error: type[InputError] = ProfileError) -> dict[str, Any]:
    """The parsed TOML file at ``path``; raises ``error`` if it is missing or not TOML."""
    content = read_bytes(path, error, MOST_TEXT_BYTES)
    with Reading(path, "valid TOML", error):
        return tomllib.loads(content.decode("utf-8"))


def toml_text(values: Mapping[str, Any], heads: tuple[str, ...] = ()) -> str:
    """``values`` as TOML: what stands by itself first, then the tables below."""
    lines = [
        f"{_toml_key(key)} = {json.dumps(value, ensure_ascii=False)}\n"
        for key, value in values.items()
        if not isinstance(value, dict)
    ]
    head = f"[{'.'.join(heads)}]\n" if heads and lines else ""
    parts = [head + "".join(lines)] if lines else []
    for key, value in values.items():
        if isinstance(value, dict):
            parts.append(toml_text(value, (*heads, key)))
    return "\n".join(part for part in parts if part)


def _toml_key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else json.dumps(key)


class Table:
    """One table of a TOML file, with its place for messages.

    ``where`` is how the table is called in messages, e.g. ``paper.toml [perforation]``;
    ``error`` is the class raised for every fault.
    """

    def __init__(
        self, values: dict[str, Any], where: str, error: type[InputError] = ProfileError
    ) -> None:
        self.where = where
        self._values = values
        self._asked: list[str] = []
        self._error = error

    def fault(self, key: str, complaint: str) -> InputError:
        """The error to raise about ``key``: ``complaint`` is the rest of the sentence."""
        end = "" if complaint.endswith("?") else "."
        return self._error(f"{self.where}: '{key}' {complaint}{end}")

    def _take(self, key: str, default: Any) -> Any:
        self._asked.append(key)
        if key in self._values:
            return self._values[key]
        if default is _REQUIRED:
            near = difflib.get_close_matches(key, self._values, n=1)
            hint = f"; is it misspelt as '{near[0]}'?" if near else ""
            raise self.fault(key, f"is missing{hint}")
        return default

    def has(self, key: str) -> bool:
        """Whether the file gives ``key``."""
        return key in self._values

    def value(self, key: str, kind: Kind, default: Any = _REQUIRED) -> Any:
        """A value of ``kind``."""
        value = self._take(key, default)
        if key not in self._values:
            return value
        try:
            return kind.read(value)
        except ValueError as fault:
            raise self.fault(key, str(fault)) from None

    def options(self, cls: type[T], base: T | None = None) -> T:
        """All that is left as the options that ``cls`` declares; ``base`` holds the defaults."""
        try:
            asked = tuple(self._asked)
            return read_options(cls, self.rest(), where=self.where, base=base, besides=asked)
        except OptionError as fault:
            raise self._error(fault.sentence) from None

    def table(self, key: str, default: dict[str, Any] = _REQUIRED) -> Table:
        """The table below ``key``; the caller finishes it too."""
        value = self._take(key, default)
        if not isinstance(value, dict):
            raise self.fault(key, f"must be a table [{key}], not {value!r}")
        return Table(value, f"{self.where} [{key}]", self._error)

    def tables(self, key: str) -> list[Table]:
        """The tables of an array ``[[key]]``, none if it is not there; the caller finishes each."""
        values = self._take(key, [])
        if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
            raise self.fault(key, f"must be tables [[{key}]], not {values!r}")
        return [
            Table(value, f"{self.where} [[{key}]] {number}", self._error)
            for number, value in enumerate(values, start=1)
        ]

    def points(self, key: str) -> tuple[tuple[float, float], ...]:
        """A list of points, each a list of two lengths in mm."""
        values = self._take(key, _REQUIRED)
        try:
            return tuple((parse_length(x), parse_length(y)) for x, y in values)
        except (TypeError, ValueError, UnitError):
            raise self.fault(
                key, f"is {values!r}; write points such as [[0, 0], [50, 0], [0, 30]]"
            ) from None

    def rest(self) -> dict[str, Any]:
        """Whatever is left, taken as it stands (for free-form tables)."""
        left = {k: v for k, v in self._values.items() if k not in self._asked}
        self._asked.extend(left)
        return left

    def finish(self, known: Sequence[str] = ()) -> None:
        """Refuse every key that nobody took, by name, with the nearest one that exists.

        ``known`` are keys that the caller would have taken had they been there.
        """
        keys = {*self._asked, *known}
        for key in self._values:
            if key not in self._asked:
                near = difflib.get_close_matches(key, keys, n=1)
                hint = (
                    f"did you mean '{near[0]}'"
                    if near
                    else f"known keys are {', '.join(sorted(keys))}"
                )
                raise self.fault(key, f"is not a known key; {hint}")
