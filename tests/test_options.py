"""Options declared once: read from text and numbers, checked, shown, and refused by name."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from miurafab.errors import OptionError, spell_options
from miurafab.options import (
    Choice,
    Flag,
    Whole,
    angle,
    check_options,
    declared,
    length,
    number,
    option,
    read_options,
)


@dataclass(frozen=True)
class Inner:
    tilt: float | None = option(angle(0, 90), "How far it leans.")


@dataclass(frozen=True)
class Outer:
    gap_mm: float = option(length(0, 100), "Kept free.", default=2.0, group="Room")
    count: int = option(Whole(1, 12), "How many.", default=3)
    side: str = option(Choice(("left", "right")), "Where.", default="left")
    whole: bool = option(Flag(), "All of it.", default=False)
    inner: Inner = field(default_factory=Inner)
    scale: float = option(number(), "How large.", default=1.0)

    def __post_init__(self) -> None:
        check_options(self)


def test_text_and_numbers_are_read_in_mm_and_degrees():
    given = {"gap": "0.5in", "count": "4", "side": "right", "tilt": 30, "whole": True}
    assert read_options(Outer, given) == Outer(12.7, 4, "right", True, Inner(math.radians(30)))
    assert read_options(Outer, {"gap": 3, "tilt": "0.5rad"}) == Outer(3.0, inner=Inner(0.5))
    assert read_options(Outer, {"gap": None}) == Outer()
    assert read_options(Outer, {"gap": np.float32(2.5), "scale": np.int16(-3)}) == Outer(
        2.5, scale=-3.0
    )


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"gap": -1}, r"'gap' is -1 mm; it must be between 0 mm and 100 mm\."),
        ({"gap": "3 parsec"}, "'gap' cannot be read: '3 parsec' is not a length"),
        ({"gap": []}, r"'gap' is \[\], not a length"),
        ({"tilt": 91}, "'tilt' is 91 deg; it must be between 0 deg and 90 deg"),
        ({"count": 2.5}, "'count' is 2.5, not a whole number"),
        ({"count": "1e3"}, "'count' is '1e3', not a whole number"),
        ({"side": "rigth"}, "'side' is 'rigth'; did you mean 'right'"),
        ({"whole": "maybe"}, "'whole' is 'maybe'; it must be true or false"),
        ({"gpa": 1}, "'gpa' is not an option; did you mean 'gap'"),
        ({"scale": math.inf}, "'scale' is inf; it must be a finite number"),
        ({"gap": np.True_}, "'gap' is .*True.*, not a length"),
    ],
)
def test_what_cannot_be_taken_is_refused_by_name(given, words):
    with pytest.raises(OptionError, match=words):
        read_options(Outer, given)


def test_a_limit_in_degrees_is_allowed_itself():
    assert read_options(Outer, {"tilt": "90deg"}).inner.tilt == pytest.approx(math.pi / 2)


def test_a_value_made_in_python_is_checked_by_the_same_range():
    with pytest.raises(OptionError, match="'gap' is -3 mm; it must be between 0 mm and 100 mm"):
        Outer(gap_mm=-3.0)


def test_a_message_names_the_option_as_its_reader_writes_it():
    with pytest.raises(OptionError) as caught:
        read_options(Outer, {"gap": -1}, where="job.toml")
    assert str(caught.value).startswith("job.toml: 'gap' is -1 mm")
    spelled = spell_options(caught.value.sentence, lambda name: f"--{name}")
    assert spelled.startswith("job.toml: 'gap' is -1 mm")
    with pytest.raises(OptionError) as caught:
        read_options(Outer, {"gap": -1})
    assert spell_options(caught.value.sentence, lambda name: f"--{name}").startswith("--gap is -1")


def test_a_declaration_tells_all_that_is_shown():
    options = declared(Outer)
    assert list(options) == ["gap", "count", "side", "whole", "tilt", "scale"]
    gap = options["gap"]
    assert (gap.default, gap.default_text, gap.group, gap.field) == (2.0, "2 mm", "Room", "gap_mm")
    assert options["whole"].default_text == ""
    assert options["side"].kind.metavar == "left|right"
