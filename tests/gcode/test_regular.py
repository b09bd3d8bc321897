"""The array reader and the word parser agree on every line."""

from __future__ import annotations

import dataclasses
import random
import tracemalloc

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from miurafab.errors import GcodeError
from miurafab.gcode import interpreter
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.gcode.program import Program
from miurafab.gcode.regular import LEAST_RUN, read_lines

NUMBERS = st.one_of(
    st.integers(-999999, 999999).map(lambda n: f"{n / 1000:g}"),
    st.decimals(-400, 400, places=3).map(str),
    st.sampled_from(["0", "-0", "+1.5", ".25", "-.5", "7.", "007.10", "123456789.123456"]),
)
POSITIVE = st.one_of(st.integers(1, 9000).map(str), st.sampled_from(["600.5", "0250", ".5"]))
REGULAR = st.builds(
    lambda parts, blank, end: blank.join(parts) + end,
    st.tuples(
        st.sampled_from(["", "G0", "G1", "G00", "G01", "G1.0"]),
        st.builds("X{}".format, NUMBERS),
        st.one_of(st.just(""), st.builds("Y{}".format, NUMBERS)),
        st.one_of(st.just(""), st.builds("S{}".format, POSITIVE)),
        st.one_of(st.just(""), st.builds("F{}".format, POSITIVE)),
    ),
    st.sampled_from(["", " ", "\t"]),
    st.sampled_from(["\n", "\n", "\n", "\r\n", "\n\n", "\r"]),
)
OTHER = st.sampled_from(
    [
        "(operation cut)\n", "M3\n", "M4 S100\n", "M5\n", "G91\n", "G90\n", "G20\n", "G21\n",
        "S5\n", "G92 X1\n", "G92.1\n", "G54\n", "G4 P.1\n", "g1 x4\n", "N7 G1 X2\n", "G0\n",
        "G1 X2 (inline) Y3\n", "; note\n", "/G0 X1\n", "G2 X1 Y1 R40\n", "G1 X5 F300 S2\n",
        "G93\n", "G94\n", "G80\n", "F500\n", "G53 G0 X1\n", "\t \n", "G0 Z1\n",
    ]
)  # fmt: skip
FAULTY = st.sampled_from(
    [
        "X\n", "G1X1X2\n", "X1.2.3\n", "X1-2\n", "1X2\n", "G2X1\n", "G7\n", "F-1X1\n", "S-2X1\n",
        "X--1\n", "X1!\n", "Xé\n", "G0G1X1\n", "X1234567890123456\n", "Y1 E5\n", "G0.5X1\n",
    ]
)  # fmt: skip


def both(text: str, **options: bool) -> tuple[Program | str, Program | str]:
    """What is read with arrays, and with the word parser alone; or the refusals."""
    read: list[Program | str] = []
    for least in (2, 1 << 60):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(interpreter, "LEAST_RUN", least)
            patch.setattr(interpreter, "_CHUNK", 200)
            try:
                read.append(parse_program(Job("job.nc", text), **options))
            except GcodeError as refused:
                read.append(str(refused))
    return read[0], read[1]


def same(one: Program | str, other: Program | str) -> None:
    if isinstance(one, str) or isinstance(other, str):
        assert one == other
        return
    for field in dataclasses.fields(Program):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype, field.name
            assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f"), field.name
        else:
            assert a == b, field.name


@settings(derandomize=True, deadline=None, max_examples=300)
@given(
    st.lists(st.one_of(REGULAR, REGULAR, REGULAR, OTHER), min_size=1, max_size=40),
    st.lists(FAULTY, max_size=1),
    st.booleans(),
)
@example(["G1 X1 F9\n", "X2\n", "M3 S5\n", "X2\n", "X2 S6\n", "X3\n"], [], True)
def test_arrays_and_the_word_parser_read_the_same(
    lines: list[str], fault: list[str], laser: bool
) -> None:
    text = "".join(["G1 F100 X0.5\n", *lines, *fault, *lines[:3]])
    same(*both(text, laser=laser))


@pytest.mark.parametrize("text", ["", "\n", "G1X1F5", "\n\nG0X1\nX2\nX3", "G0X1\rX2\rX3\r"])
def test_every_way_to_end_a_file_is_read(text: str) -> None:
    same(*both(text))


@pytest.mark.parametrize(
    ("text", "inline"),
    [
        ("G1X1\nX2\nX3\n", False),  # no feed
        ("G80\nX1\nX2\nX3\n", False),
        ("G2X2R1F9\nX4\nX6\nX8\n", False),  # bare words repeat the arc
        ("G1X1F9\nG1X2\nX3\nX4\n", True),  # for Marlin they repeat nothing
    ],
)
def test_a_run_that_means_another_thing_is_refused_as_by_words(text: str, inline: bool) -> None:
    one, other = both(text, inline=inline)
    assert isinstance(one, str)
    assert one == other


def test_each_decimal_is_the_double_nearest_to_it() -> None:
    chance = random.Random(3)
    texts = [
        f"{chance.choice('+- ').strip()}{chance.randrange(10 ** chance.randint(1, 9))}"
        f".{chance.randrange(10**6):0{chance.randint(1, 6)}d}"
        for _ in range(20_000)
    ]
    values = read_lines("".join(f"X{text}\n" for text in texts)).values[1]
    assert values.tolist() == [float(text) for text in texts]


def long_job(lines: int) -> str:
    rows = ["M4 S0 F3000"]
    for n in range(lines // 2):
        x, y = 10 + 1.5 * (n % 180), 10 + 0.5 * (n // 180 % 500)
        rows += [f"G0 X{x:g} Y{y:g}", f"G1 X{x + 0.9:g} S500"]
    return "\n".join([*rows, "M5", ""])


def read_peak(lines: int) -> int:
    job = Job("long.nc", long_job(lines))
    tracemalloc.start()
    parse_program(job)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def test_a_long_job_is_read_into_less_than_a_hundred_bytes_a_line() -> None:
    assert LEAST_RUN < 1000
    short, long = read_peak(20_000), read_peak(60_000)
    assert (long - short) / 40_000 < 100.0
