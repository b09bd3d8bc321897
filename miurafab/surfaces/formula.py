"""Targets given by a formula: z of x and y, or x, y and z of u and v.

A formula is parsed here and never run as Python, so a formula of a file or of a browser can do
nothing but compute:

    sum     = product, then any number of: + or -, product
    product = signed, then any number of: * or /, signed
    signed  = any number of + and -, then power
    power   = atom, then perhaps ^ (or **) and a signed, which so binds to the right
    atom    = number | name | name ( sum , ... ) | ( sum )

Names are the variables, ``pi`` and ``e``, and the functions below. Angles in a formula are in
radians, as in mathematics. ``log`` is the natural logarithm.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import numpy as np

from miurafab.errors import TargetError, UnitError
from miurafab.surfaces.function import SampledSurface, from_function
from miurafab.units import as_float

LONGEST = 500
"""Characters of a formula."""
DEEPEST = 40
"""Brackets, signs and powers within one another."""

CONSTANTS = {"pi": math.pi, "e": math.e}
FUNCTIONS: Mapping[str, tuple[int, Callable[..., Any]]] = {
    **{
        name: (1, getattr(np, name))
        for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "sqrt", "exp", "log", "abs")
    },
    "asin": (1, np.arcsin),
    "acos": (1, np.arccos),
    "atan": (1, np.arctan),
    "atan2": (2, np.arctan2),
    "hypot": (2, np.hypot),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
}
"""The functions with the number of their arguments."""

DEFAULT = "0.3*sin(2*x)*cos(y)"
"""The formula of z where none is given."""

_TOKEN = re.compile(r"\s*(?:((?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*)|(\*\*|\S))")

Values = Mapping[str, Any]
_Node = Callable[[Values], Any]


@dataclass(frozen=True)
class Formula:
    """A formula that was read. ``names`` are the variables in it; call it with their values."""

    text: str
    names: frozenset[str]
    compute: Callable[[Values], Any]

    def __call__(self, values: Values) -> Any:
        """The value for ``values`` of the variables, numbers or arrays of one shape."""
        with np.errstate(all="ignore"):
            return self.compute(values)


def read_formula(text: str, variables: tuple[str, ...] = ()) -> Formula:
    """The formula ``text`` of some of the ``variables``.

    Parameters
    ----------
    text : str
        The formula, at most ``LONGEST`` characters.
    variables : tuple of str
        The names that may stand in it, besides the constants and functions.

    Raises
    ------
    TargetError
        For a text that is no formula, with the place of the fault.

    Examples
    --------
    >>> float(read_formula("2*x^2 - y", ("x", "y"))({"x": 3.0, "y": 1.0}))
    17.0
    """
    if len(text) > LONGEST:
        raise TargetError(f"A formula has at most {LONGEST} characters; this one has {len(text)}.")
    reader = _Reader(text, variables)
    node = reader.sum()
    if reader.at < len(reader.tokens):
        reader.refuse()
    return Formula(text, frozenset(reader.used), node)


def computed(value: str | float) -> float:
    """A number, or a formula without variables such as ``2*pi``. Raises ``UnitError``."""
    if not isinstance(value, str):
        return as_float(value)
    try:
        return float(read_formula(value)({}))
    except TargetError as fault:
        raise UnitError(fault.sentence) from None


def formula_surface(
    domain: tuple[float, float, float, float],
    x: str | None = None,
    y: str | None = None,
    z: str | None = None,
) -> SampledSurface:
    """The surface of the formulas over ``domain`` (u0, u1, v0, v1).

    With ``z`` alone it is the height over x = u and y = v; with all three, a point of u and v.
    Raises :class:`~miurafab.errors.TargetError`.
    """
    if x is None and y is None:
        height = _of("z", DEFAULT if z is None else z, ("x", "y"))

        def function(u: Any, v: Any) -> Any:
            return height({"x": u, "y": v}) + 0 * u

    else:
        given = {"x": x, "y": y, "z": z}
        missing = [name for name, text in given.items() if text is None]
        if missing:
            raise TargetError(
                f"The formula of {missing[0]} is missing; give z of x and y alone, or x, y and z "
                "of u and v."
            )
        parts = [_of(name, str(text), ("u", "v")) for name, text in given.items()]

        def function(u: Any, v: Any) -> Any:
            return tuple(part({"u": u, "v": v}) + 0 * u for part in parts)

    surface, findings = from_function(function, domain)
    return replace(surface, findings=findings)


def _of(name: str, text: str, variables: tuple[str, ...]) -> Formula:
    left, equals, right = text.partition("=")
    if equals and left.strip() == name:
        raise TargetError(f"The formula of {name} begins with '{name}='; write {right.strip()!r}.")
    try:
        return read_formula(text, variables)
    except TargetError as fault:
        raise TargetError(f"The formula of {name} cannot be read: {fault.sentence}") from None


class _Reader:
    """Reads one text from left to right; mutable. ``used`` are the variables that were met."""

    def __init__(self, text: str, variables: tuple[str, ...]) -> None:
        self.text, self.variables = text, variables
        self.tokens = list(_TOKEN.finditer(text.rstrip()))
        self.at, self.depth = 0, 0
        self.used: set[str] = set()

    def sum(self) -> _Node:
        node = self.product()
        while (sign := self.take("+", "-")) is not None:
            node = _both(np.add if sign == "+" else np.subtract, node, self.product())
        return node

    def product(self) -> _Node:
        node = self.signed()
        while (sign := self.take("*", "/")) is not None:
            node = _both(np.multiply if sign == "*" else np.divide, node, self.signed())
        return node

    def signed(self) -> _Node:
        turned = False
        while (sign := self.take("+", "-")) is not None:
            turned ^= sign == "-"
        node = self.power()
        return (lambda values: -node(values)) if turned else node

    def power(self) -> _Node:
        base = self.atom()
        if self.take("^", "**") is None:
            return base
        self.deeper()
        node = _both(np.float_power, base, self.signed())
        self.depth -= 1
        return node

    def atom(self) -> _Node:
        number, name, mark = self.next()
        if number is not None:
            value = float(number)
            return lambda _: value
        if name is not None:
            return self.named(name)
        if mark != "(":
            self.at -= 1
            self.refuse()
        self.deeper()
        node = self.sum()
        self.close()
        return node

    def named(self, name: str) -> _Node:
        if name in FUNCTIONS:
            return self.function(name)
        if name in self.variables:
            self.used.add(name)
            return lambda values: values[name]
        if name in CONSTANTS:
            value = CONSTANTS[name]
            return lambda _: value
        known = ", ".join((*self.variables, *CONSTANTS, *FUNCTIONS))
        raise TargetError(f"'{name[:40]}' is not known in a formula; there are {known}.")

    def function(self, name: str) -> _Node:
        count, compute = FUNCTIONS[name]
        if self.take("(") is None:
            raise TargetError(f"'{name}' is a function; write what it is of in brackets.")
        self.deeper()
        given = [self.sum()]
        while self.take(",") is not None:
            given.append(self.sum())
        self.close()
        if len(given) != count:
            raise TargetError(f"'{name}' takes {count} value{'s' if count > 1 else ''}.")
        if count == 1:
            only = given[0]
            return lambda values: compute(only(values))
        return _both(compute, *given)

    def deeper(self) -> None:
        self.depth += 1
        if self.depth > DEEPEST:
            raise TargetError(f"It is nested more than {DEEPEST} deep.")

    def close(self) -> None:
        if self.take(")") is None:
            self.refuse("a bracket is not closed")
        self.depth -= 1

    def take(self, *marks: str) -> str | None:
        """The next token, if it is one of ``marks``."""
        if self.at < len(self.tokens) and self.tokens[self.at][3] in marks:
            self.at += 1
            return str(self.tokens[self.at - 1][3])
        return None

    def next(self) -> tuple[str | None, str | None, str | None]:
        if self.at == len(self.tokens):
            self.refuse()
        number, name, mark = self.tokens[self.at].groups()
        self.at += 1
        return number, name, mark

    def refuse(self, why: str = "") -> NoReturn:
        """Raise for the token at hand."""
        if self.at == len(self.tokens):
            raise TargetError(f"'{self.text}' ends too early{f': {why}' if why else ''}.")
        token = self.tokens[self.at]
        what = token[0].strip()
        hint = "; write * between factors" if token[3] is None or what == "(" else ""
        place = token.end() - len(what) + 1
        raise TargetError(
            f"'{what}' cannot stand at place {place} of '{self.text}'{why and f': {why}'}{hint}."
        )


def _both(compute: Callable[..., Any], first: _Node, second: _Node) -> _Node:
    return lambda values: compute(first(values), second(values))
