"""The blocks that the controller takes, and those that it refuses with which number, in its order.

``test_virtual_transcripts.py`` holds the recorded answers of the real firmware; these cases follow
from its rules.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.gcode.block_errors import BlockError
from miurafab.gcode.execution import execute
from miurafab.gcode.numbers import read_single, single, to_unsigned, whole_byte
from miurafab.gcode.parser import Block, ModalState, parse_block
from miurafab.gcode.words import split_words


@dataclass(frozen=True)
class StockRules:
    laser: bool = False
    arc_tolerance: float = 0.002
    mist: bool = False
    single_precision: bool = True


def at_zero(_index: int) -> tuple[float, float, float]:
    return (0.0, 0.0, 0.0)


def parse(line: str, state: ModalState, *, jog: bool = False) -> Block | BlockError:
    """The block, or why there is none."""
    try:
        return parse_block(line, state, at_zero, StockRules(), jog=jog)
    except BlockError as fault:
        return fault


def answer(line: str, *before: str, jog: bool = False) -> int:
    """The ``error:`` number for ``line``, 0 if it is taken, after the lines ``before``."""
    state, rules = ModalState(), StockRules()
    for earlier in before:
        for _ in execute(parse_block(earlier, state, at_zero, rules), state, rules):
            pass
    parsed = parse(line, state, jog=jog)
    return parsed.code if isinstance(parsed, BlockError) else 0


REFUSALS = """
    G1X1 22|G1X1F0 22|X1 0|G0X1I1 36|G2X1Y1I0.5R1F1 36|G2X0Y0I1F1 0|G2X9Y9I1F1 33|G2X9R1F1 34
    G2X0Y0R1F1 33|G2Z1I1F1 32|G2F1 26|G18G2X1K1F1 33|G3X2I1F1 0|G2 22|G17G18 21|M3M5 21|M0M2 21
    G0G0 24|G0G28 24|G43.1G0Z1 24|G43.1Z1G0 24|G0G28.1X1 0|G28.5 20|G0G28.5 20|G92.2 20|G80X1 31
    G80G92X1 31|G53G2X1I1F1 30|G53X1 0|G4 28|G4P1 0|G4P-1 4|G4P1X1 0|G10 26|G10X1 28|G10P1X1 20
    G10L2X1 0|G10L2P7X1 29|G10L2P1RX1 2|G10L2P1R1X1 20|G10L20P1R1X1 36|G10L3P1X1 20|G10L2P0 26
    G43.1 37|G43.1X1 37|G43.1X1Z1 37|G43.2Z1 20|G43Z1 20|G49 0|G49.1 0|G49X1 0|G40 0|G41 20|G61.1 20
    G64 20|G90.1 20|G91.1 0|G91.5 20|G20.5 23|G4.1 23|G10.1 23|G0.1 23|G53.1 23|G54.1 23|G59.1 23
    G60 20|G256 23|G284 20|G-1 20|G-0X1 0|M3.5 23|M-3 23|M260 23|M6 20|M7 20|M8 0|M48 20|S-0 0|T-1 4
    T255 0|T255.9 38|T256 38|N-1 4|N10000000 0|N10000001 27|XX1 2|G0X1X2 25|S1S1 25|F1F1 25|%  1|G 2
    1 1|G0= 1|G0X. 2|G0X+.5 0|G0X+-1 2|G1X1F1E2 20|G38.2Z1F1 0|G38.2Z0F1 33|G38.2F1 26|G38.6Z1F1 20
    G38Z1F1 20|G93G1X1F1 0|G93G1X1 22|G93G0X1 0|G99G0X 20|X1.2.3G99 1|D1 20|G92 26|G92X1 0|G92.1X1 0
"""


@pytest.mark.parametrize(
    "case", [c.split() for c in REFUSALS.replace("\n", "|").split("|") if c.strip()]
)
def test_lines_are_answered_as_the_firmware_would(case: list[str]) -> None:
    line, code = case
    assert answer(line) == int(code)


JOGS = """
    X1F1 0|X1 22|X1F0 22|G91X1F1 0|G20X1F1 0|G53X1F1 0|F1 0|G0X1F1 16|G1X1F1 16|M3X1F1 16|G18X1F1 16
    G92X0F1 16|G28X0F1 16|G90G91X1F1 21|X1F1S1 36|X1F1T1 36|N1X1F1 0|X1F1I1 36|G2X1F1 35|G4P1X1F1 16
"""


@pytest.mark.parametrize(
    "case", [c.split() for c in JOGS.replace("\n", "|").split("|") if c.strip()]
)
def test_jogs_are_answered_as_the_firmware_would(case: list[str]) -> None:
    line, code = case
    assert answer(line, jog=True) == int(code)


def test_modes_last_and_feeds_are_forgotten_by_inverse_time() -> None:
    assert answer("X2", "G1X1F100") == 0
    assert answer("X2", "G93G1X1F100") == 22
    assert answer("G94X2", "G93G1X1F100") == 22
    assert answer("X2", "G80") == 31
    assert answer("G92X0", "G80") == 31


def snapshot(state: ModalState) -> dict[str, object]:
    return {name: repr(getattr(state, name)) for name in ModalState.__slots__}


COMMANDS = "G0 G1 G2 G3 G10 G28 G38.2 G43.1 G80 G92 G93 G20 G91 G18 G54 M3 M4 M2 M8"
VALUES = "X1 Y-2 Z3 X1.25 I1 J1 R2 P1 L2 L20 F100 S5 T3 N7"
words = st.sampled_from(COMMANDS.split(" ") + VALUES.split(" "))


@given(st.lists(words, max_size=6), st.lists(words, max_size=6))
def test_parsing_leaves_the_state_alone(first: list[str], second: list[str]) -> None:
    state, rules = ModalState(), StockRules()
    for line in ("".join(first), "".join(second)):
        before = snapshot(state)
        block = parse(line, state)
        assert snapshot(state) == before
        if isinstance(block, BlockError):
            assert block.code in range(1, 39)
            assert str(block)
        else:
            for _ in execute(block, state, rules):
                pass


@given(st.text(max_size=30))
def test_any_line_is_a_block_or_a_fault(line: str) -> None:
    parsed = parse(line.upper(), ModalState())
    assert isinstance(parsed, Block) or parsed.code in range(1, 39)


@given(st.decimals(min_value=-9999, max_value=9999, places=3))
def test_numbers_are_read_to_single_precision(number: object) -> None:
    value = float(str(number))
    assert read_single(str(number)) == pytest.approx(single(value), rel=3e-7)


def test_numbers_keep_eight_digits_and_overflow_as_the_firmware_does() -> None:
    assert read_single("123456789012") == single(123456780000.0)
    assert read_single("000000001.5") == 0.0
    assert read_single("-.5") == -0.5
    assert read_single("-" + "9" * 60) == -math.inf
    assert single(1e39) == math.inf
    assert whole_byte(256.0) == 0
    assert whole_byte(-1.0) == 255
    assert to_unsigned(float("nan")) == to_unsigned(2.0**32) == 0


@pytest.mark.parametrize("number", ["9" * 4000, "9" * 4000 + ".", "." + "9" * 4000])
def test_a_number_of_thousands_of_digits_is_read_at_once(number: str) -> None:
    """A pattern with two ways to read digits took minutes before it refused what follows them."""
    words = split_words(f"X{number}Y{number}%")
    assert [next(words), next(words)] == [("X", number), ("Y", number)]
    with pytest.raises(BlockError):
        next(words)
