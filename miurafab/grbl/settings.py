"""The ``$`` settings of a controller: reading ``$$`` or a saved dump, and comparing two sets.

Names and units are those of GRBL 1.1 (:mod:`miurafab.grbl.codes`). Other firmware keeps these
numbers and adds its own, which have no name here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from miurafab.errors import ProfileError
from miurafab.gcode.job import Job
from miurafab.grbl.codes import setting_codes
from miurafab.grbl.events import Setting
from miurafab.grbl.replies import parse_reply
from miurafab.profiles import MachineProfile

_LASER_MODE_IS_32 = ("grbl-1.1", "grblhal")


def profile_settings(machine: MachineProfile) -> dict[int, float]:
    """The settings that a job for ``machine`` expects of the controller.

    These are the profile's ``settings`` and, for firmware with the S range in ``$30`` and ``$31``
    and laser mode in ``$32`` (GRBL 1.1, grblHAL), the values that the tool implies.
    """
    implied: dict[int, float] = {}
    if machine.dialect in _LASER_MODE_IS_32:
        tool = machine.tool
        implied = {30: tool.s_max, 31: tool.s_min, 32: 1.0 if tool.kind == "laser" else 0.0}
    return implied | machine.settings


def describe(number: int) -> str:
    """``$110 (X maximum rate)``, or the number alone if GRBL 1.1 has no such setting."""
    code = setting_codes().get(number)
    return f"${number}" if code is None else f"${number} ({code.name})"


@dataclass(frozen=True, slots=True)
class Difference:
    """A setting that differs from the expected value; ``actual`` is None if it was not reported."""

    number: int
    expected: float
    actual: float | None

    def __str__(self) -> str:
        code = setting_codes().get(self.number)
        tail = f" {code.unit}" if code is not None and code.unit else ""
        actual = "missing" if self.actual is None else f"{self.actual:g}{tail}"
        return f"{describe(self.number)} is {actual} instead of {self.expected:g}{tail}"


@dataclass(frozen=True)
class Settings:
    """The answer to ``$$``: ``texts`` as the controller wrote them, in its order."""

    texts: Mapping[int, str]

    @classmethod
    def from_events(cls, events: Iterable[object]) -> Settings:
        """The settings among the answers to ``$$``."""
        return cls({event.number: event.text for event in events if isinstance(event, Setting)})

    @property
    def values(self) -> dict[int, float]:
        """The settings that are finite numbers."""
        numbers = {number: _number(text) for number, text in self.texts.items()}
        return {number: value for number, value in numbers.items() if value is not None}

    def differences(self, expected: Mapping[int, float]) -> tuple[Difference, ...]:
        """The settings that differ from ``expected``, by number.

        Values are compared as the controller prints them, with three decimals (``report.c``).
        """
        values = self.values
        return tuple(
            Difference(number, value, values.get(number))
            for number, value in sorted(expected.items())
            if number not in values or abs(values[number] - value) > 5e-4
        )

    def dump(self) -> str:
        """The text that ``$$`` would print, one setting a line."""
        return "".join(f"${number}={text}\n" for number, text in self.texts.items())


_MOST = 1e9
"""No setting of a controller is larger; a damaged dump may hold any number."""


def parse_dump(text: str, name: str) -> Settings:
    """Read a saved ``$$`` dump without its blank lines, comments (``;``) and final ``ok``.

    Raises :class:`~miurafab.errors.ProfileError`, naming ``name`` and the line, for a line that is
    no setting.
    """
    texts: dict[int, str] = {}
    for number, line in enumerate(Job(name, text).iter_lines(), 1):
        code = line.partition(";")[0].strip()
        if code in ("", "ok"):
            continue
        event = parse_reply(code)
        if not isinstance(event, Setting):
            raise ProfileError(
                f"{name}, line {number}: {code!r} is not a setting such as '$110=6000'."
            )
        value = _number(event.text)
        if value is not None and abs(value) > _MOST:
            raise ProfileError(
                f"{name}, line {number}: ${event.number} is {value:g}, more than a controller has."
            )
        texts[event.number] = event.text
    if not texts:
        raise ProfileError(f"{name} holds no setting; save what the controller answers to $$.")
    return Settings(texts)


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
