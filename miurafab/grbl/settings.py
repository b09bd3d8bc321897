"""The ``$`` settings of a controller: their names and units, a dump read, two sets compared.

Numbers, names and units are those of GRBL 1.1 (``settings.h``, ``doc/csv/setting_codes_en_US.csv``
of the firmware); other firmware keeps them and adds its own, which are carried without a name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from miurafab.errors import ProfileError
from miurafab.grbl.events import Setting
from miurafab.grbl.replies import parse_reply


@dataclass(frozen=True, slots=True)
class Meaning:
    """What one setting is: a ``name`` for messages and its ``unit`` (empty for plain numbers)."""

    name: str
    unit: str = ""


def _axes(name: str, unit: str, first: int) -> dict[int, Meaning]:
    return {first + i: Meaning(f"{axis} {name}", unit) for i, axis in enumerate("XYZ")}


MEANINGS: Mapping[int, Meaning] = {
    0: Meaning("step pulse", "µs"),
    1: Meaning("step idle delay", "ms"),
    2: Meaning("step pulse invert mask"),
    3: Meaning("step direction invert mask"),
    4: Meaning("step enable invert"),
    5: Meaning("limit pins invert"),
    6: Meaning("probe pin invert"),
    10: Meaning("status report mask"),
    11: Meaning("junction deviation", "mm"),
    12: Meaning("arc tolerance", "mm"),
    13: Meaning("report in inches"),
    20: Meaning("soft limits"),
    21: Meaning("hard limits"),
    22: Meaning("homing cycle"),
    23: Meaning("homing direction invert mask"),
    24: Meaning("homing locate feed", "mm/min"),
    25: Meaning("homing search feed", "mm/min"),
    26: Meaning("homing switch debounce", "ms"),
    27: Meaning("homing pull-off", "mm"),
    30: Meaning("largest S value"),
    31: Meaning("smallest S value"),
    32: Meaning("laser mode"),
    **_axes("steps", "steps/mm", 100),
    **_axes("maximum rate", "mm/min", 110),
    **_axes("acceleration", "mm/s²", 120),
    **_axes("travel", "mm", 130),
}


def describe(number: int) -> str:
    """``$110 (X maximum rate)``, or the bare number of a setting that GRBL 1.1 does not know."""
    meaning = MEANINGS.get(number)
    return f"${number}" if meaning is None else f"${number} ({meaning.name})"


@dataclass(frozen=True, slots=True)
class Difference:
    """One setting that is not what was expected; ``actual`` is None if it was not reported."""

    number: int
    expected: float
    actual: float | None

    def __str__(self) -> str:
        unit = MEANINGS[self.number].unit if self.number in MEANINGS else ""
        tail = f" {unit}" if unit else ""
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
