"""Settings: dumps read and written, differences in words, what a profile implies."""

from __future__ import annotations

import re

import pytest

from miurafab.errors import ProfileError
from miurafab.grbl.connection import Connection
from miurafab.grbl.settings import Settings, describe, parse_dump, profile_settings
from miurafab.profiles import load_machine

DUMP = "$0=10\n$32=1\n$110=6000.000\n$120=1000.000\n$132=200.000\n$70=text\n"


def test_a_dump_survives_reading_and_writing() -> None:
    settings = parse_dump(DUMP, "dump")
    assert settings.dump() == DUMP
    assert settings.values == {0: 10, 32: 1, 110: 6000, 120: 1000, 132: 200}


def test_a_dump_may_hold_the_final_ok_and_comments() -> None:
    assert parse_dump("; mine\r\n$30=1000\r\n\r\nok\r\n", "x").values == {30: 1000}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("$30=1\nhello\n", "my.txt, line 2: 'hello' is not a setting"),
        ("$30=1\n$110=-2e9\n", "my.txt, line 2: $110 is -2e+09, more than a controller has"),
        ("", "my.txt holds no"),
    ],
)
def test_a_bad_dump_is_named(text: str, sentence: str) -> None:
    with pytest.raises(ProfileError, match=re.escape(sentence)):
        parse_dump(text, "my.txt")


def test_settings_are_taken_from_what_the_controller_said() -> None:
    connection = Connection()
    connection.receive_data(b"$0=10\r\n$11=0.010\r\nok\r\n")
    assert Settings.from_events(connection.events()).texts == {0: "10", 11: "0.010"}


def test_differences_say_what_differs_in_words() -> None:
    settings = parse_dump("$32=0\n$110=500.000\n", "x")
    found = settings.differences({110: 6000.0, 32: 1.0, 130: 400.0})
    assert [str(item) for item in found] == [
        "$32 (laser mode) is 0 instead of 1",
        "$110 (X maximum rate) is 500 mm/min instead of 6000 mm/min",
        "$130 (X travel) is missing instead of 400 mm",
    ]


def test_equality_is_that_of_three_printed_decimals() -> None:
    settings = parse_dump("$11=0.010\n", "x")
    assert settings.differences({11: 0.0104}) == ()
    assert len(settings.differences({11: 0.011})) == 1


def test_an_unknown_number_goes_without_a_name() -> None:
    assert describe(376) == "$376"


def test_a_laser_implies_laser_mode() -> None:
    assert profile_settings(load_machine("grbl-laser-400"))[32] == 1
