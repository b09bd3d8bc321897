"""The faults of a simulator as values, and their notation.

A fault is written ``KIND@WHEN`` or ``KIND=VALUE@WHEN``::

    drop@1200            the 1200th byte that the sender sends is lost
    corrupt=3@2.5s       3 bytes arrive changed, from 2.5 s after the sender's first byte
    disconnect=2s@1200   the cable comes out, and is in again 2 s later

WHEN is a number (just before the sender sends that byte, counted from 1) or a time with its unit,
``s`` or ``ms``, on the controller's clock since the sender's first byte. VALUE is a number of bytes
or ``all``, a time, or the number of an alarm; see :data:`KINDS`. Each fault strikes once. The same
faults give the same bytes, because noise has a fixed seed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType

from miurafab.errors import InputError


@dataclass(frozen=True, slots=True)
class FaultKind:
    """A kind of fault: the ``unit`` of its value ("bytes", "s", "code" or "": none), and its
    default value ``stock`` (None: no default).
    """

    unit: str
    stock: float | None


_FOR_GOOD = math.inf
KINDS = MappingProxyType(
    {
        "drop": FaultKind("bytes", 1),  # bytes from the sender are lost
        "drop-reply": FaultKind("bytes", 1),  # bytes to the sender are lost
        "corrupt": FaultKind("bytes", 1),  # bytes from the sender arrive with one bit changed
        "corrupt-reply": FaultKind("bytes", 1),  # bytes to the sender arrive with one bit changed
        "noise": FaultKind("bytes", 8),  # random bytes reach the controller
        "noise-reply": FaultKind("bytes", 8),  # random bytes reach the sender
        "delay": FaultKind("s", None),  # what the sender sends is delayed for that long
        "delay-reply": FaultKind("s", None),  # what the controller says is delayed for that long
        "slow": FaultKind("s", None),  # from now on every byte takes that longer, both ways
        "disconnect": FaultKind("s", _FOR_GOOD),  # the cable comes out, for that long or for good
        "reset": FaultKind("", None),  # the controller's reset button is pressed
        "power": FaultKind("", None),  # the controller loses power for a moment
        "alarm": FaultKind("code", 1),  # the controller stops with that ALARM; 1 is a hard limit
        "stall": FaultKind("s", 0.1),  # an EEPROM write: the controller is deaf for that long
        "hang": FaultKind("s", _FOR_GOOD),  # the controller hangs, for that long or for good
    }
)
"""All kinds of faults."""

_FORM = re.compile(r"(?P<kind>[a-z-]+)(?:=(?P<value>[^@=]+))?@(?P<when>[^@=]+)")
_TIME = re.compile(r"(\d+(?:\.\d+)?|\.\d+)(ms|s)")
_COUNT = re.compile(r"[1-9]\d*")
_ALARMS = range(1, 10)


@dataclass(frozen=True, slots=True)
class Fault:
    """``kind`` strikes at the ``at_byte``-th byte of the sender, or ``at_s`` after its first byte.

    ``value`` is in the unit of the kind: bytes, seconds or an alarm's number. ``math.inf`` means
    all bytes, or forever; 0 means that the kind has no value.
    """

    kind: str
    value: float
    at_byte: int | None = None
    at_s: float | None = None


def parse_fault(text: str) -> Fault:
    """Read a fault from ``text``; the docstring of the module describes the notation.

    Raises :class:`~miurafab.errors.InputError`, naming the part that cannot be read.
    """
    match = _FORM.fullmatch(text.strip())
    if match is None:
        raise InputError(
            f"The fault '{text}' is not KIND@WHEN or KIND=VALUE@WHEN, such as 'drop@1200' (a byte) "
            "or 'disconnect=2s@3s' (times)."
        )
    kind = KINDS.get(match["kind"])
    if kind is None:
        raise InputError(
            f"The fault '{text}' is of no known kind; the kinds are {', '.join(KINDS)}."
        )
    value = _value(text, match["kind"], kind, match["value"])
    when = match["when"]
    if _COUNT.fullmatch(when):
        return Fault(match["kind"], value, at_byte=int(when))
    seconds = _seconds(when)
    if seconds is None:
        raise InputError(
            f"The fault '{text}' strikes at '{when}', which is neither the number of a byte (1200) "
            "nor a time (3s, 250ms)."
        )
    return Fault(match["kind"], value, at_s=seconds)


def parse_faults(texts: Iterable[str]) -> tuple[Fault, ...]:
    """Read the faults ``texts``, in their order; see :func:`parse_fault`."""
    return tuple(parse_fault(text) for text in texts)


def _value(text: str, name: str, kind: FaultKind, written: str | None) -> float:
    if written is None:
        if kind.unit and kind.stock is None:
            raise InputError(f"The fault '{text}' needs a time, such as '{name}=50ms@3s'.")
        return kind.stock or 0.0
    if kind.unit == "bytes":
        if written == "all" and not name.startswith("noise"):
            return math.inf
        if _COUNT.fullmatch(written):
            return float(written)
        raise InputError(f"The fault '{text}' has '{written}' for a number of bytes.")
    if kind.unit == "code":
        if _COUNT.fullmatch(written) and int(written) in _ALARMS:
            return float(written)
        raise InputError(f"The fault '{text}' has '{written}' for the number of an alarm, 1 to 9.")
    if kind.unit == "s":
        seconds = _seconds(written)
        if seconds is not None and seconds > 0:
            return seconds
        raise InputError(f"The fault '{text}' has '{written}' for a time such as 2s or 50ms.")
    raise InputError(f"The fault '{text}' has a value, and '{name}' takes none.")


def _seconds(text: str) -> float | None:
    match = _TIME.fullmatch(text)
    return None if match is None else float(match[1]) * (1e-3 if match[2] == "ms" else 1.0)
