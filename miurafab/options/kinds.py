"""How a value of an option is written, checked and shown: lengths, angles, choices and the like.

A kind reads what a person writes (text with a unit, or a plain number in millimetres and degrees)
into the value inside (millimetres, radians), and shows a value inside as a person writes it.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from miurafab.errors import UnitError
from miurafab.units import (
    as_float,
    parse_angle,
    parse_feed,
    parse_length,
    parse_power,
    parse_pressure,
)


def is_truth(value: object) -> bool:
    """Whether ``value`` is yes or no, of Python or of NumPy: neither is taken as 1 or 0."""
    return type(value).__name__ in ("bool", "bool_")


class Kind:
    """How values of an option are written and read; ``unit`` follows a number that is shown."""

    unit = ""

    @property
    def metavar(self) -> str:
        """What stands for a value in help."""
        return "TEXT"

    def read(self, value: object) -> Any:
        """The value inside. Raises ``ValueError`` with the rest of a sentence, ``is 3; ...``."""
        raise NotImplementedError

    def check(self, inside: Any) -> None:
        """Raise ``ValueError`` for a value inside that is out of range."""

    def show(self, inside: Any) -> str:
        """A value inside as a person writes it."""
        return str(inside)

    @property
    def accepts(self) -> str:
        """What is accepted, for help and tables; empty where the metavar says all."""
        return ""


@dataclass(frozen=True)
class Quantity(Kind):
    """A number with or without a unit, from ``low`` to ``high`` (as written, both allowed).

    ``parse`` turns what is written into the value inside, ``factor`` is the value inside of one
    unit as written. ``above`` leaves ``low`` itself out.
    """

    parse: Callable[[str | float], float]
    noun: str
    metavar: str = "NUMBER"
    unit: str = ""
    factor: float = 1.0
    low: float = -math.inf
    high: float = math.inf
    above: bool = False

    def read(self, value: object) -> float:
        truth = is_truth(value)
        if truth or not isinstance(value, str | int | float):
            if truth or not hasattr(value, "__float__"):
                raise ValueError(f"is {value!r}, not {self.noun}")
            value = float(value)
        try:
            inside = self.parse(value)
        except UnitError as fault:
            raise ValueError(f"cannot be read: {str(fault).rstrip('.')}") from None
        self.check(inside)
        return inside

    def check(self, inside: float) -> None:
        written = _written(inside / self.factor)
        too_low = written <= self.low if self.above else written < self.low
        if too_low or written > self.high or not math.isfinite(written):
            raise ValueError(f"is {self.show(inside)}; it must be {self.accepts}")

    def show(self, inside: float) -> str:
        return f"{_written(inside / self.factor):.10g}{self.unit}"

    @property
    def accepts(self) -> str:
        low, high = (f"{limit:g}{self.unit}" for limit in (self.low, self.high))
        if math.isinf(self.low):
            return "a finite number"
        if math.isinf(self.high):
            return f"greater than {low}" if self.above else f"{low} or more"
        between = f"between {low} and {high}"
        return f"greater than {low} and at most {high}" if self.above else between


def _written(value: float) -> float:
    """To nine decimals: a limit in degrees has no exact value in radians. Never to nothing."""
    return round(value, 9) or value


def length(low: float = 0.0, high: float = math.inf, *, above: bool = False) -> Quantity:
    """A length in mm from ``low`` to ``high`` mm; ``above`` leaves ``low`` itself out."""
    return Quantity(parse_length, "a length", "LENGTH", " mm", low=low, high=high, above=above)


def angle(low: float = 0.0, high: float = 360.0, *, above: bool = False) -> Quantity:
    """An angle, written in degrees and radians inside; ``low`` and ``high`` in degrees."""
    return Quantity(parse_angle, "an angle", "ANGLE", " deg", math.pi / 180, low, high, above)


def modulus(low: float = 0.0, high: float = math.inf) -> Quantity:
    """A modulus in pascal, such as ``3GPa``."""
    return Quantity(parse_pressure, "a modulus", "MODULUS", " Pa", low=low, high=high)


def feed(low: float = 1.0, high: float = 1e6) -> Quantity:
    """A feed in mm/min."""
    return Quantity(parse_feed, "a feed", "FEED", " mm/min", low=low, high=high)


def watts(low: float = 0.0, high: float = math.inf) -> Quantity:
    """A power in watts, such as ``8W``."""
    return Quantity(parse_power, "a power", "POWER", " W", low=low, high=high)


def percent(low: float = 0.0, high: float = 100.0) -> Quantity:
    """A share, written in percent and from 0 to 1 inside."""
    return Quantity(_share, "a percentage", "PERCENT", " %", 0.01, low, high)


def number(
    low: float = -math.inf, high: float = math.inf, *, above: bool = False, unit: str = ""
) -> Quantity:
    """A plain number; ``unit`` is only shown."""
    return Quantity(_plain_number, "a number", "NUMBER", unit, low=low, high=high, above=above)


def _plain_number(text: str | float) -> float:
    try:
        return float(text) if isinstance(text, str) else as_float(text)
    except ValueError:
        raise UnitError(f"{text!r} is not a number.") from None


def _share(text: str | float) -> float:
    return _plain_number(text.removesuffix("%") if isinstance(text, str) else text) / 100


@dataclass(frozen=True)
class Whole(Kind):
    """A whole number from ``low`` to ``high``, both allowed."""

    low: int = 0
    high: int = 2**31 - 1
    metavar: str = "N"

    def read(self, value: object) -> int:
        text = value.strip() if isinstance(value, str) else None
        if text is not None and text.lstrip("+-").isascii() and text.lstrip("+-").isdigit():
            value = int(text) if len(text) < 20 else self.high + 1
        elif is_truth(value) or not hasattr(value, "__index__"):
            raise ValueError(f"is {value!r}, not a whole number")
        inside = int(value)
        self.check(inside)
        return inside

    def check(self, inside: int) -> None:
        if not self.low <= inside <= self.high:
            raise ValueError(f"is {inside}; it must be {self.accepts}")

    @property
    def accepts(self) -> str:
        if self.high >= 2**31 - 1:
            return f"{self.low} or more"
        return f"between {self.low} and {self.high}"


@dataclass(frozen=True)
class Choice(Kind):
    """One of ``names``."""

    names: tuple[str, ...]

    @property
    def metavar(self) -> str:
        return "|".join(self.names)

    def read(self, value: object) -> str:
        self.check(value)
        return str(value)

    def check(self, inside: object) -> None:
        if inside not in self.names:
            near = difflib.get_close_matches(str(inside), self.names, n=1, cutoff=0.75)
            hint = f"did you mean '{near[0]}'" if near else f"it must be {self.accepts}"
            raise ValueError(f"is '{inside}'; {hint}")

    @property
    def accepts(self) -> str:
        return f"one of {', '.join(self.names)}"


@dataclass(frozen=True)
class Either(Kind):
    """One of the names of ``choice``, or a value of ``kind``."""

    choice: Choice
    kind: Kind

    @property
    def metavar(self) -> str:
        names = self.choice.names
        return f"{self.kind.metavar}|{names[0] if len(names) == 1 else 'PLACE'}"

    def read(self, value: object) -> Any:
        named = isinstance(value, str) and value[:1].isalpha()
        return self.choice.read(value) if named else self.kind.read(value)

    def check(self, inside: Any) -> None:
        (self.choice if isinstance(inside, str) else self.kind).check(inside)

    def show(self, inside: Any) -> str:
        return inside if isinstance(inside, str) else self.kind.show(inside)

    @property
    def accepts(self) -> str:
        return f"{self.kind.metavar} or {self.choice.accepts}"


@dataclass(frozen=True)
class Flag(Kind):
    """Yes or no."""

    metavar: str = ""

    def read(self, value: object) -> bool:
        if isinstance(value, bool):
            return value
        if value in ("true", "false"):
            return value == "true"
        raise ValueError(f"is {value!r}; it must be true or false")

    def show(self, inside: bool) -> str:
        return "yes" if inside else "no"


@dataclass(frozen=True)
class Text(Kind):
    """A text of one line."""

    metavar: str = "TEXT"

    def read(self, value: object) -> str:
        if not isinstance(value, str) or not value.isprintable():
            raise ValueError(f"is {value!r}, not a text of one line")
        return value


@dataclass(frozen=True)
class File(Kind):
    """The path of a file, taken from the folder of the file that names it."""

    metavar: str = "FILE"

    def read(self, value: object) -> Path:
        try:
            path = Path(value)  # type: ignore[arg-type]  # the TypeError is the answer
        except TypeError:
            raise ValueError(f"is {value!r}, not a path") from None
        if value == "":
            raise ValueError("is empty, not a path")
        return path


@dataclass(frozen=True)
class Pair(Kind):
    """Two values of one ``kind``, with ``separator`` between or as a list.

    ``collect`` makes the value inside, such as a pair with the longer side first.
    """

    kind: Kind
    metavar: str = "A,B"
    example: str = "0,0"
    separator: str = ","
    collect: Callable[[tuple[Any, Any]], tuple[Any, Any]] = tuple

    def read(self, value: object) -> tuple[Any, Any]:
        parts: Any = value
        if isinstance(value, str):
            parts = value.lower().replace("×", "x").split(self.separator)
            parts = [part for part in parts if part.strip()]
        try:
            first, second = parts
        except (TypeError, ValueError):
            raise ValueError(f"is {value!r}; write {self.metavar} such as {self.example}") from None
        return self.collect((_part(self.kind, first, value), _part(self.kind, second, value)))

    def check(self, inside: tuple[Any, Any]) -> None:
        for part in inside:
            _check_part(self, part, inside)

    def show(self, inside: tuple[Any, Any]) -> str:
        return self.separator.join(self.kind.show(part) for part in inside)


@dataclass(frozen=True)
class Several(Kind):
    """Any number of values of one ``kind``, with ``separator`` between or as a list.

    ``collect`` makes the value inside, such as :func:`distinct`.
    """

    kind: Kind
    collect: Callable[[Iterable[Any]], Any] = tuple
    separator: str = ","

    @property
    def metavar(self) -> str:
        return f"{self.kind.metavar}{self.separator}..."

    def read(self, value: object) -> Any:
        parts: Any = list(value) if isinstance(value, Iterable) else [value]
        if isinstance(value, str):
            parts = value.split(self.separator)
        return self.collect(_part(self.kind, part, value) for part in parts)

    @property
    def accepts(self) -> str:
        return f"each {self.kind.accepts}" if self.kind.accepts else ""

    def check(self, inside: Any) -> None:
        for part in inside:
            _check_part(self, part, inside)

    def show(self, inside: Any) -> str:
        return self.separator.join(self.kind.show(part) for part in inside)


def comma_parts(value: object) -> list[Any]:
    """The parts of text with commas between, or of a sequence. Raises ``TypeError`` for else."""
    if isinstance(value, str):
        return [part.strip() for part in value.split(",")]
    if not isinstance(value, Iterable):
        raise TypeError(f"{value!r} is no list")
    return list(value)


def distinct(values: Iterable[Any]) -> tuple[Any, ...]:
    """The values in order, each once."""
    return tuple(sorted(set(values)))


def _check_part(whole: Pair | Several, part: Any, inside: Any) -> None:
    try:
        whole.kind.check(part)
    except ValueError as fault:
        raise ValueError(f"is {whole.show(inside)}, of which a part {fault}") from None


def _part(kind: Kind, part: object, whole: object) -> Any:
    """``part`` of what is written as ``whole``, read by ``kind``."""
    try:
        return kind.read(part.strip() if isinstance(part, str) else part)
    except ValueError as fault:
        shown = f"'{whole}'" if isinstance(whole, str) else whole
        raise ValueError(f"is {shown}, of which a part {fault}") from None


@dataclass(frozen=True)
class Written(Kind):
    """Any other value: ``parse`` reads what is written, ``write`` shows it."""

    parse: Callable[[object], Any]
    write: Callable[[Any], str]
    metavar: str = "TEXT"
    accepted: str = ""

    def read(self, value: object) -> Any:
        return self.parse(value)

    def show(self, inside: Any) -> str:
        return self.write(inside)

    @property
    def accepts(self) -> str:
        return self.accepted
