"""The error, alarm and setting codes of GRBL, read from the tables beside this module.

Numbers, units and stock values are those of GRBL 1.1h (``report.h``, ``settings.h``,
``defaults.h``); the texts are miurafab's own.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files


@dataclass(frozen=True, slots=True)
class Code:
    """An error or an alarm: its ``number``, its short ``name``, and its meaning as ``text``."""

    number: int
    name: str
    text: str


@dataclass(frozen=True, slots=True)
class SettingCode:
    """A ``$`` setting: its ``unit`` (empty for plain numbers), the ``decimals`` that the firmware
    prints, and its default value ``stock``.
    """

    number: int
    name: str
    unit: str
    decimals: int
    stock: float


@cache
def error_codes() -> Mapping[int, Code]:
    """The ``error:`` codes by number."""
    return _codes("errors")


@cache
def alarm_codes() -> Mapping[int, Code]:
    """The ``ALARM:`` codes by number."""
    return _codes("alarms")


@cache
def setting_codes() -> Mapping[int, SettingCode]:
    """The ``$`` settings by number, in the order in which ``$$`` lists them."""
    return {
        int(row["number"]): SettingCode(
            int(row["number"]), row["name"], row["unit"], int(row["decimals"]), float(row["stock"])
        )
        for row in _rows("settings")
    }


def _codes(table: str) -> dict[int, Code]:
    codes = (Code(int(row["code"]), row["name"], row["text"]) for row in _rows(table))
    return {code.number: code for code in codes}


def _rows(table: str) -> Iterator[dict[str, str]]:
    text = files("miurafab.grbl").joinpath("codes", f"{table}.csv").read_text(encoding="utf-8")
    return iter(csv.DictReader(text.splitlines()))
