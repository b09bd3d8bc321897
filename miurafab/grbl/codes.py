"""What the numbers of GRBL mean, in words, read from the tables beside this module.

The numbers, units and stock values are those of GRBL 1.1h (``report.h``, ``settings.h``,
``defaults.h`` of the firmware); the words are ours.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files


@dataclass(frozen=True, slots=True)
class Code:
    """An error or an alarm: its ``number``, a ``name`` of a few words, and what it says."""

    number: int
    name: str
    text: str


@dataclass(frozen=True, slots=True)
class SettingCode:
    """A ``$`` setting: ``unit`` is empty for plain numbers, ``decimals`` are what the firmware
    prints, ``stock`` is the value that it is born with.
    """

    number: int
    name: str
    unit: str
    decimals: int
    stock: float


@cache
def error_codes() -> Mapping[int, Code]:
    """The ``error:`` codes by number."""
    return {
        int(row["code"]): Code(int(row["code"]), row["name"], row["text"])
        for row in _rows("errors")
    }


@cache
def alarm_codes() -> Mapping[int, Code]:
    """The ``ALARM:`` codes by number."""
    return {
        int(row["code"]): Code(int(row["code"]), row["name"], row["text"])
        for row in _rows("alarms")
    }


@cache
def setting_codes() -> Mapping[int, SettingCode]:
    """The ``$`` settings by number, in the order in which ``$$`` lists them."""
    return {
        int(row["number"]): SettingCode(
            int(row["number"]), row["name"], row["unit"], int(row["decimals"]), float(row["stock"])
        )
        for row in _rows("settings")
    }


def _rows(table: str) -> Iterator[dict[str, str]]:
    text = files("miurafab.grbl").joinpath("codes", f"{table}.csv").read_text(encoding="utf-8")
    return iter(csv.DictReader(text.splitlines()))
