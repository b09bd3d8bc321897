"""How an option is declared: once, as a field of the frozen dataclass that uses it.

A declaration says how a value is written (its :class:`Kind`: unit, range, choices), what it means
(``help``), where it belongs (``group``) and what holds if nobody gives it. Everything that a person
sees of an option is made from its declaration: the command line, design and material files, the
form of the page, the tables in docs and the messages.

Outside, an option has the name of its field without its unit (``_mm``, ``_mm_min``, ``_s``), and
is written in millimetres and degrees. Inside, the field holds millimetres, radians or whatever
the kind says.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar, get_type_hints

from miurafab.errors import OptionError, UnitError
from miurafab.units import parse_angle, parse_feed, parse_length, parse_pressure

_KEY = "miurafab.option"
_UNIT = re.compile(r"_(mm|mm2|mm_min|mm_s2|s|pa)$")


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
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            if not hasattr(value, "__float__"):
                raise ValueError(f"is {value!r}, not {self.noun}")
            value = float(value)
        try:
            inside = self.parse(value)
        except UnitError as fault:
            raise ValueError(f"cannot be read: {str(fault).rstrip('.')}") from None
        self.check(inside)
        return inside

    def check(self, inside: float) -> None:
        written = inside / self.factor
        written = round(written, 9)  # a limit in degrees has no exact value in radians
        too_low = written <= self.low if self.above else written < self.low
        if too_low or written > self.high or not math.isfinite(written):
            raise ValueError(f"is {self.show(inside)}; it must be {self.accepts}")

    def show(self, inside: float) -> str:
        return f"{round(inside / self.factor, 9):.10g}{self.unit}"

    @property
    def accepts(self) -> str:
        low, high = (f"{limit:g}{self.unit}" for limit in (self.low, self.high))
        if math.isinf(self.low):
            return "a finite number"
        if math.isinf(self.high):
            return f"greater than {low}" if self.above else f"{low} or more"
        return (
            f"greater than {low} and at most {high}" if self.above else f"between {low} and {high}"
        )


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
        return float(text)
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
        elif isinstance(value, bool) or not hasattr(value, "__index__"):
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
            path = Path(value)  # type: ignore[arg-type]
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
    """Any number of values of one ``kind``, with commas between or as a list.

    ``collect`` makes the value inside, such as :func:`distinct`.
    """

    kind: Kind
    collect: Callable[[Iterable[Any]], Any] = tuple

    @property
    def metavar(self) -> str:
        return f"{self.kind.metavar},..."

    def read(self, value: object) -> Any:
        if isinstance(value, str):
            parts: list[object] = [*value.split(",")]
        else:
            parts = list(value) if isinstance(value, Iterable) else [value]
        return self.collect(_part(self.kind, part, value) for part in parts)

    @property
    def accepts(self) -> str:
        return f"each {self.kind.accepts}" if self.kind.accepts else ""

    def check(self, inside: Any) -> None:
        for part in inside:
            _check_part(self, part, inside)

    def show(self, inside: Any) -> str:
        return ",".join(self.kind.show(part) for part in inside)


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


@dataclass(frozen=True)
class Declared:
    """One option as everybody who shows or reads it sees it.

    ``name`` is its name outside, ``field`` that of the dataclass field. ``default`` is the value
    inside if nobody gives it; ``default_text`` how that is written, empty for none. ``page`` is
    where the form of the page has it: ``first``, under ``more``, or not at all (empty).
    """

    name: str
    field: str
    kind: Kind
    help: str
    group: str
    default: Any
    default_text: str
    page: str

    @property
    def label(self) -> str:
        """What its field on the page is called."""
        return self.name.replace("_", " ").capitalize()


REQUIRED: Any = dataclasses.MISSING


def option(
    kind: Kind,
    help: str,
    default: Any = None,
    *,
    group: str = "",
    default_text: str | None = None,
    page: Literal["first", "more", ""] = "",
) -> Any:
    """Declare an option as a field of a frozen dataclass.

    Parameters
    ----------
    kind : Kind
        How a value is written: :func:`length`, :func:`angle`, :class:`Choice` and others.
    help : str
        What it means, as one sentence.
    default : any
        The value inside if nobody gives it; None for an option that may be absent, REQUIRED for
        one that may not.
    group : str
        The heading under which help shows it.
    default_text : str, optional
        What holds where ``default`` is None, such as ``the material's``.
    page : str
        Where the form of the page has it: ``first``, under ``more``, or not at all (empty).
    """
    shown = default_text
    if shown is None:
        absent = default in (None, REQUIRED, (), frozenset()) or default is False
        shown = "" if absent else kind.show(default)
    metadata = {_KEY: (kind, help, group, shown, page)}
    return dataclasses.field(default=default, metadata=metadata)


def outside(field: str) -> str:
    """The name of a field outside."""
    return _UNIT.sub("", field)


def declared(cls: type) -> Mapping[str, Declared]:
    """The options of ``cls`` and of the dataclasses that it is made of, by their names outside."""
    return {each.name: each for each in _declarations(cls)}


def _declarations(cls: type) -> Iterator[Declared]:
    hints = get_type_hints(cls)
    for entry in fields(cls):
        if _KEY in entry.metadata:
            kind, text, group, shown, page = entry.metadata[_KEY]
            name = outside(entry.name)
            yield Declared(name, entry.name, kind, text, group, entry.default, shown, page)
        elif isinstance(hints[entry.name], type) and is_dataclass(hints[entry.name]):
            yield from _declarations(hints[entry.name])


T = TypeVar("T")


def read_options(
    cls: type[T],
    given: Mapping[str, object],
    *,
    where: str = "",
    folder: Path = Path(),
    over: Mapping[str, object] | None = None,
    base: T | None = None,
) -> T:
    """The options ``given`` as a value of ``cls``; None leaves an option as it is by default.

    Parameters
    ----------
    cls : type
        A frozen dataclass whose fields are declared by :func:`option`, or are such dataclasses.
    given : mapping
        Values as a person writes them, by the names outside: text with a unit, or plain numbers in
        millimetres and degrees.
    where : str
        The file or table of ``given``, for messages.
    folder : Path
        Where the files that ``given`` names are looked for.
    over : mapping, optional
        Values that win over those ``given``, such as those of the command line over a file's.
    base : instance of cls, optional
        What holds for options that are not given, in place of the defaults.

    Raises
    ------
    OptionError
        For a name that is no option, and for a value that cannot be taken; it names the option.
    """
    over = {name: value for name, value in (over or {}).items() if value is not None}

    def place(name: str | None) -> str:
        return "" if name in over else where

    known = declared(cls)
    for name in (*given, *over):
        if name not in known:
            noun = "a known key" if place(name) else "an option"
            complaint = f"'{name}' is not {noun}; {_nearest(name, known)}"
            raise OptionError(None, complaint, place(name))
    inside: dict[str, Any] = {}
    for name, value in {**given, **over}.items():
        if value is None:
            continue
        kind = known[name].kind
        try:
            inside[name] = kind.read(value)
        except ValueError as fault:
            raise OptionError(name, str(fault), place(name)) from None
        if isinstance(kind, File) and name not in over:
            inside[name] = folder / inside[name]
    try:
        return _made(cls, inside, base)
    except OptionError as fault:
        raise OptionError(fault.option, fault.complaint, place(fault.option)) from None


def _made(cls: type[T], inside: Mapping[str, Any], base: T | None = None) -> T:
    """A value of ``cls`` of the values ``inside``, by the names outside, and of ``base``."""
    hints = get_type_hints(cls)
    values: dict[str, Any] = {}
    for entry in fields(cls):  # type: ignore[arg-type]
        if _KEY in entry.metadata:
            name = outside(entry.name)
            if name in inside:
                values[entry.name] = inside[name]
            elif base is None and entry.default is REQUIRED:
                raise OptionError(name, "is missing")
        elif isinstance(hints[entry.name], type) and is_dataclass(hints[entry.name]):
            values[entry.name] = _made(hints[entry.name], inside)
    return cls(**(values if base is None else vars(base) | values))


def check_options(value: Any) -> None:
    """Raise :class:`~miurafab.errors.OptionError` for a field of ``value`` that is out of range."""
    for entry in fields(value):
        inside = getattr(value, entry.name)
        if _KEY in entry.metadata and inside is not None:
            kind: Kind = entry.metadata[_KEY][0]
            try:
                kind.check(inside)
            except ValueError as fault:
                raise OptionError(outside(entry.name), str(fault)) from None


def _nearest(name: str, known: Sequence[str] | Mapping[str, object]) -> str:
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"did you mean '{near[0]}'" if near else f"there are {', '.join(sorted(known))}"
