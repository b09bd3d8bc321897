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
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar, get_type_hints

from miurafab.errors import OptionError
from miurafab.options.kinds import (
    Choice,
    Either,
    File,
    Flag,
    Kind,
    Pair,
    Quantity,
    Several,
    Text,
    Whole,
    Written,
    angle,
    distinct,
    feed,
    length,
    modulus,
    number,
    percent,
    watts,
)

__all__ = [
    "REQUIRED",
    "Choice",
    "Declared",
    "Either",
    "File",
    "Flag",
    "Kind",
    "Pair",
    "Quantity",
    "Several",
    "Text",
    "Whole",
    "Written",
    "angle",
    "check_options",
    "declared",
    "distinct",
    "feed",
    "length",
    "modulus",
    "number",
    "option",
    "outside",
    "percent",
    "read_options",
    "read_value",
    "watts",
    "written_options",
]

_KEY = "miurafab.option"
_UNIT = re.compile(r"_(mm|mm2|mm_min|mm_s2|s|pa)$")


@dataclass(frozen=True)
class Declared:
    """One option as everybody who shows or reads it sees it.

    ``name`` is its name outside, ``field`` that of the dataclass field. ``default`` is the value
    inside if nobody gives it; ``default_text`` how that is written, empty for none. ``page`` is
    where the form of the page has it: ``first``, under ``more``, among those for a ``mesh``, or not
    at all (empty).
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
    page: Literal["first", "more", "mesh", ""] = "",
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
        Where the form of the page has it: ``first``, under ``more``, among those for a ``mesh``,
        or not at all (empty).
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
    besides: Iterable[str] = (),
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
    besides : iterable of str, optional
        Further names that the table may hold, for the near miss in messages.

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
            complaint = f"'{name}' is not {noun}; {nearest(name, [*known, *besides])}"
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
    # No bound of T says that it is a dataclass.
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


def written_options(value: Any) -> dict[str, Any]:
    """The options of ``value`` that are not the defaults, as :func:`read_options` takes them."""
    found: dict[str, Any] = {}
    for entry in fields(value):
        inside = getattr(value, entry.name)
        if _KEY not in entry.metadata:
            found |= written_options(inside) if is_dataclass(inside) else {}
        elif inside != entry.default:
            kind: Kind = entry.metadata[_KEY][0]
            found[outside(entry.name)] = inside if isinstance(inside, bool) else kind.show(inside)
    return found


def read_value(name: str, kind: Kind, value: object) -> Any:
    """One ``value`` of the option ``name``. Raises :class:`~miurafab.errors.OptionError`.

    >>> read_value("steps", Whole(2, 1000), 40)
    40
    """
    try:
        return kind.read(value)
    except ValueError as fault:
        raise OptionError(name, str(fault)) from None


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


def nearest(name: str, known: Sequence[str]) -> str:
    """The hint for ``name`` that is not ``known``: the near miss, or all there are."""
    near = difflib.get_close_matches(name, known, n=1)
    return f"did you mean '{near[0]}'" if near else f"there are {', '.join(sorted(known))}"
