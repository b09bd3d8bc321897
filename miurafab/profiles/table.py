"""A TOML table that is read strictly: what is not asked for is refused by name.

A reader takes each key with the range it may have; :meth:`Table.finish` then refuses whatever
key nobody took. So a typo is an error that names the file, the key and the nearest key that
exists, never a silently ignored line.
"""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from miurafab.errors import InputError, ProfileError, UnitError
from miurafab.units import parse_angle, parse_feed, parse_length, parse_pressure

_REQUIRED: Any = object()
_DEGREES = " deg"


def read_toml(path: Path, error: type[InputError] = ProfileError) -> dict[str, Any]:
    """The parsed TOML file at ``path``; raises ``error`` if it is missing or not TOML."""
    try:
        with path.open("rb") as stream:
            return tomllib.load(stream)
    except FileNotFoundError:
        raise error(f"{path} does not exist.") from None
    except OSError as fault:
        raise error(f"{path} cannot be read: {fault.strerror}.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as fault:
        raise error(f"{path} is not valid TOML: {fault}.") from None


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
        return self._error(f"{self.where}: '{key}' {complaint}.")

    def _take(self, key: str, default: Any) -> Any:
        self._asked.append(key)
        if key in self._values:
            return self._values[key]
        if default is _REQUIRED:
            near = difflib.get_close_matches(key, self._values, n=1)
            hint = f" (is '{near[0]}' a slip of the pen?)" if near else ""
            raise self.fault(key, f"is missing{hint}")
        return default

    def has(self, key: str) -> bool:
        """Whether the file gives ``key``."""
        return key in self._values

    def text(self, key: str, default: str = _REQUIRED) -> str:
        """A string."""
        value = self._take(key, default)
        if not isinstance(value, str):
            raise self.fault(key, f"must be a text in quotes, not {value!r}")
        return value

    def choice(self, key: str, choices: Sequence[str], default: str = _REQUIRED) -> str:
        """One of the strings ``choices``."""
        value = self._take(key, default)
        if value not in choices:
            raise self.fault(key, f"is {value!r}; it must be one of {', '.join(choices)}")
        return str(value)

    def choices(
        self, key: str, choices: Sequence[str], default: Sequence[str] = _REQUIRED
    ) -> tuple[str, ...]:
        """A list of some of the strings ``choices``."""
        values = self._take(key, default)
        if not isinstance(values, list | tuple):
            raise self.fault(key, f"must be a list, not {values!r}")
        for value in values:
            if value not in choices:
                raise self.fault(key, f"holds {value!r}; it may hold {', '.join(choices)}")
        return tuple(values)

    def flag(self, key: str, default: bool = _REQUIRED) -> bool:
        """A boolean."""
        value = self._take(key, default)
        if not isinstance(value, bool):
            raise self.fault(key, f"must be true or false, not {value!r}")
        return value

    def whole(self, key: str, default: int = _REQUIRED, *, low: int, high: int) -> int:
        """A whole number within ``low`` and ``high``, both allowed."""
        value = self._take(key, default)
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.fault(key, f"must be a whole number, not {value!r}")
        if not low <= value <= high:
            raise self.fault(key, f"is {value}; it must lie between {low} and {high}")
        return value

    def number(self, key: str, default: float = _REQUIRED, *, low: float, high: float) -> float:
        """A plain number within ``low`` and ``high``, both allowed."""
        return self._quantity(key, default, _plain_number, low, high, "")

    def length(self, key: str, default: float = _REQUIRED, *, low: float, high: float) -> float:
        """A length in mm (``"3mm"``, ``"0.5in"``, ``3``) within ``low`` and ``high``."""
        return self._quantity(key, default, parse_length, low, high, " mm")

    def angle(self, key: str, default: float = _REQUIRED, *, low: float, high: float) -> float:
        """An angle in radians (``"10deg"``, ``10``) within ``low`` and ``high``, radians too."""
        if default is not _REQUIRED and not self.has(key):
            self._asked.append(key)
            return default
        return self._quantity(key, default, parse_angle, low, high, _DEGREES)

    def feed(self, key: str, default: float = _REQUIRED, *, low: float, high: float) -> float:
        """A feed in mm/min (``"1200mm/min"``) within ``low`` and ``high``."""
        return self._quantity(key, default, parse_feed, low, high, " mm/min")

    def modulus(self, key: str, default: float = _REQUIRED, *, low: float, high: float) -> float:
        """A modulus in pascal (``"3GPa"``) within ``low`` and ``high``."""
        return self._quantity(key, default, parse_pressure, low, high, " Pa")

    def _quantity(
        self,
        key: str,
        default: float,
        parse: Callable[[str | float], float],
        low: float,
        high: float,
        unit: str,
    ) -> float:
        value = self._take(key, default)
        if not isinstance(value, str | int | float):
            raise self.fault(key, f"is {value!r}, not a quantity")
        try:
            quantity = parse(value)
        except UnitError as fault:
            raise self.fault(key, f"cannot be read: {str(fault).rstrip('.')}") from None
        if not low <= quantity <= high:
            shown = [quantity, low, high]
            if unit == _DEGREES:
                shown = [math.degrees(each) for each in shown]
            raise self.fault(
                key, f"is {shown[0]:g}{unit}; it must lie between {shown[1]:g} and {shown[2]:g}"
            )
        return quantity

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

    def scalar(self, key: str) -> str:
        """A text or a plain number, in its written form, for a parser further on."""
        value = self._take(key, _REQUIRED)
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            raise self.fault(key, f"is {value!r}, not a text or a number")
        return str(value)

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


def _plain_number(value: str | float) -> float:
    if isinstance(value, str | bool):
        raise UnitError(f"{value!r} is not a plain number.")
    return float(value)
