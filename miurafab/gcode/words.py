"""A line split into words, and the table of GRBL's G and M words."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache

from miurafab.gcode import block_errors
from miurafab.gcode.block_errors import BlockError, Reason
from miurafab.gcode.numbers import read_single, single, whole_byte
from miurafab.units import DECIMAL

_NUMBER = rf"[-+]?{DECIMAL}"
_WORD = re.compile(rf"([A-Z])({_NUMBER})", re.ASCII)
_LINE = re.compile(rf"(?:[A-Z]{_NUMBER})*+", re.ASCII)


def split_words(line: str) -> Iterator[tuple[str, str]]:
    """Yield the (letter, number) pairs of ``line``, which has no comments, blanks or lower case.

    Raises :class:`BlockError` at the first character that is not part of a word, after the words
    before it.
    """
    if _LINE.fullmatch(line):
        yield from _WORD.findall(line)
        return
    end = 0
    while (match := _WORD.match(line, end)) is not None:
        yield match[1], match[2]
        end = match.end()
    bad = line[end]
    if "A" <= bad <= "Z":
        raise BlockError(block_errors.NUMBER_EXPECTED, bad)
    raise BlockError(block_errors.LETTER_EXPECTED, repr(bad))


class Group(IntEnum):
    """The modal groups (NIST RS274/NGC, table 4): a line may hold one word of each."""

    NON_MODAL = 0
    MOTION = 1
    PLANE = 2
    DISTANCE = 3
    ARC_DISTANCE = 4
    FEED_MODE = 5
    UNITS = 6
    CUTTER = 7
    TOOL_LENGTH = 8
    OFFSET = 9
    PATH = 10
    STOP = 11
    SPINDLE = 12
    COOLANT = 13


class Claim(IntEnum):
    """The purpose for which a command claims the axis words."""

    NONE = 0
    NON_MODAL = 1
    MOTION = 2
    TOOL_LENGTH = 3


@dataclass(frozen=True, slots=True)
class GcodeCommand:
    """A G or M word: it sets ``slot`` to ``value`` (without a slot it has no effect); its claim."""

    group: Group
    slot: str = ""
    value: int = 0
    claim: Claim = Claim.NONE


DWELL, SET_OFFSET, GO_G28, GO_G30, MACHINE, SHIFT = 4, 10, 28, 30, 53, 92
STORE_G28, STORE_G30, UNSHIFT = 281, 301, 921
SEEK, LINEAR, CLOCKWISE, COUNTERCLOCKWISE, NO_MOTION = 0, 1, 2, 3, 80
PROBES = (140, 141, 142, 143)
"""G38.2 to G38.5 as motion modes."""
FLOOD, MIST = 1, 2


def _g_table() -> dict[tuple[int, int], GcodeCommand]:
    table = {
        (10, 0): GcodeCommand(Group.NON_MODAL, "action", SET_OFFSET, Claim.NON_MODAL),
        (28, 0): GcodeCommand(Group.NON_MODAL, "action", GO_G28, Claim.NON_MODAL),
        (30, 0): GcodeCommand(Group.NON_MODAL, "action", GO_G30, Claim.NON_MODAL),
        (92, 0): GcodeCommand(Group.NON_MODAL, "action", SHIFT, Claim.NON_MODAL),
        (28, 10): GcodeCommand(Group.NON_MODAL, "action", STORE_G28),
        (30, 10): GcodeCommand(Group.NON_MODAL, "action", STORE_G30),
        (92, 10): GcodeCommand(Group.NON_MODAL, "action", UNSHIFT),
        (4, 0): GcodeCommand(Group.NON_MODAL, "action", DWELL),
        (53, 0): GcodeCommand(Group.NON_MODAL, "action", MACHINE),
        (80, 0): GcodeCommand(Group.MOTION, "motion", NO_MOTION),
        (91, 10): GcodeCommand(Group.ARC_DISTANCE),
        (40, 0): GcodeCommand(Group.CUTTER),
        (61, 0): GcodeCommand(Group.PATH),
        (43, 10): GcodeCommand(Group.TOOL_LENGTH, "tool_length", 1, Claim.TOOL_LENGTH),
    }
    for number in (SEEK, LINEAR, CLOCKWISE, COUNTERCLOCKWISE):
        table[number, 0] = GcodeCommand(Group.MOTION, "motion", number, Claim.MOTION)
    for index, probe in enumerate(PROBES):
        table[38, 20 + 10 * index] = GcodeCommand(Group.MOTION, "motion", probe, Claim.MOTION)
    for slot, group, first, count in (
        ("plane", Group.PLANE, 17, 3),
        ("distance", Group.DISTANCE, 90, 2),
        ("offset", Group.OFFSET, 54, 6),
    ):
        for index in range(count):
            table[first + index, 0] = GcodeCommand(group, slot, index)
    for slot, group, last in (("inverse_time", Group.FEED_MODE, 94), ("inches", Group.UNITS, 21)):
        for value in range(2):
            table[last - value, 0] = GcodeCommand(group, slot, value)
    return table


_G = _g_table()
_M = {
    0: GcodeCommand(Group.STOP, "stop", 1),
    1: GcodeCommand(Group.STOP),
    2: GcodeCommand(Group.STOP, "stop", 2),
    30: GcodeCommand(Group.STOP, "stop", 30),
    3: GcodeCommand(Group.SPINDLE, "spindle", 3),
    4: GcodeCommand(Group.SPINDLE, "spindle", 4),
    5: GcodeCommand(Group.SPINDLE, "spindle", 0),
    7: GcodeCommand(Group.COOLANT, "coolant", MIST),
    8: GcodeCommand(Group.COOLANT, "coolant", FLOOD),
    9: GcodeCommand(Group.COOLANT, "coolant", 0),
}
_CLAIMING = {0, 1, 2, 3, 38, 43, 49}
"""G words that claim the axis words with any decimals."""
_POINTED = {28, 30, 38, 43, 61, 90, 91, 92}
"""G words with decimals in use; other decimals are unknown words instead of bad fractions."""


@lru_cache(maxsize=4096)
def look_up(letter: str, number: str, mist: bool) -> tuple[GcodeCommand | Reason, bool]:
    """The command of a word, or the reason why there is none; and whether it claims the axis words.

    M7 exists only in firmware compiled with ``mist``.
    """
    whole, hundredths = whole_and_hundredths(number)
    if letter == "M":
        if hundredths:
            return block_errors.NOT_WHOLE, False
        known = _M.get(whole) if mist or whole != 7 else None
        return known or block_errors.UNSUPPORTED, False
    if whole == 49:
        return GcodeCommand(Group.TOOL_LENGTH, "tool_length", 0, Claim.TOOL_LENGTH), True
    command = _G.get((whole, hundredths))
    if command is not None:
        return command, command.claim is not Claim.NONE
    pointless = (whole, 0) in _G and whole not in _POINTED
    reason = block_errors.NOT_WHOLE if pointless else block_errors.UNSUPPORTED
    return reason, whole in _CLAIMING


@lru_cache(maxsize=4096)
def whole_and_hundredths(number: str) -> tuple[int, int]:
    """The ``number`` of a G or M word: one byte, and the fraction in hundredths, in single
    precision (``gcode.c``).

    >>> whole_and_hundredths("+091.10")
    (91, 10)
    """
    value = read_single(number)
    whole = whole_byte(value)
    return whole, _round_half_away(single(100.0 * single(value - whole))) & 0xFFFF


def _round_half_away(value: float) -> int:
    magnitude = int(min(abs(value), 2.0**32) + 0.5)
    return -magnitude if value < 0 else magnitude
