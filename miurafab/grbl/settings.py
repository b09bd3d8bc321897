"""The ``$`` settings of a controller: what ``$$`` says, a saved dump, two sets compared.

Names and units are those of GRBL 1.1 (:mod:`miurafab.grbl.codes`); other firmware keeps these
numbers and adds its own, which are carried without a name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from miurafab.errors import ProfileError
from miurafab.grbl.codes import setting_codes
from miurafab.grbl.events import Setting
from miurafab.grbl.replies import parse_reply
from miurafab.profiles import MachineProfile

_LASER_MODE_IS_32 = ("grbl-1.1", "grblhal")


def profile_settings(machine: MachineProfile) -> dict[int, float]:
    """What a job for ``machine`` expects of its controller.

    The profile's own ``settings``, and what its tool implies where the firmware keeps the S
    range in ``$30`` and ``$31`` and laser mode in ``$32`` (GRBL 1.1, grblHAL).
    """
    implied: dict[int, float] = {}
    if machine.dialect in _LASER_MODE_IS_32:
        tool = machine.tool
        implied = {30: tool.s_max, 31: tool.s_min, 32: 1.0 if tool.kind == "laser" else 0.0}
    return implied | machine.settings


def describe(number: int) -> str:
    """``$110 (X maximum rate)``, or the bare number of a setting that GRBL 1.1 does not know."""
    code = setting_codes().get(number)
    return f"${number}" if code is None else f"${number} ({code.name})"


@dataclass(frozen=True, slots=True)
class Difference:
    """One setting that is not what was expected; ``actual`` is None if it was not reported."""

    number: int
    expected: float
    actual: float | None

    def __str__(self) -> str:
        code = setting_codes().get(self.number)
        tail = f" {code.unit}" if code is not None and code.unit else ""
        found = "missing" if self.actual is None else f"{self.actual:g}{tail}"
        return f"{describe(self.number)} is {found} instead of {self.expected:g}{tail}"


@dataclass(frozen=True)
class Settings:
    """What ``$$`` reported: ``texts`` as the controller wrote them, in its order."""

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
        """Where these settings are not as ``expected``, by number.

        Equal means equal as the controller prints it: with three decimals (``report.c``).
        """
        values = self.values
        return tuple(
            Difference(number, want, values.get(number))
            for number, want in sorted(expected.items())
            if number not in values or abs(values[number] - want) > 5e-4
        )

    def dump(self) -> str:
        """The text that ``$$`` would print, one setting a line."""
        return "".join(f"${number}={text}\n" for number, text in self.texts.items())


def parse_dump(text: str, name: str) -> Settings:
    """Read a saved ``$$`` dump; blank lines, comments (``;``) and the final ``ok`` are passed over.

    Raises :class:`~miurafab.errors.ProfileError` naming ``name`` and the line that is no setting.
    """
    texts: dict[int, str] = {}
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), 1):
        code = line.partition(";")[0].strip()
        if code in ("", "ok"):
            continue
        event = parse_reply(code)
        if not isinstance(event, Setting):
            raise ProfileError(
                f"{name}, line {number}: {code!r} is not a setting such as '$110=6000'."
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
