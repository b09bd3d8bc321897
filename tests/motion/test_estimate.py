"""The time estimate against the real firmware's times, and against what must always hold."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_planner import machine

from miurafab.errors import ProfileError
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.motion.estimate import Estimate, estimate
from miurafab.motion.parameters import Link, MotionParameters
from miurafab.motion.segments import Segment, SegmentGenerator
from miurafab.profiles import load_machine, shipped_names

DATA = Path(__file__).parent.parent / "data" / "grbl"
MEASURED = json.loads((DATA / "measured.json").read_text(encoding="ascii"))["jobs"]


def time(text: str, link: Link | None = None, **changes: object) -> Estimate:
    return estimate(parse_program(Job("j", text)), machine(**changes), link)


@pytest.mark.parametrize(
    ("name", "within"),
    [("A_g0hop.nc", 0.01), ("B_g0hop.nc", 0.01), ("A_m3m5.nc", 0.01), ("S.nc", 0.01)],
)
def test_recorded_jobs_are_timed_as_the_firmware_ran_them(name: str, within: float) -> None:
    found = time((DATA / name).read_text(encoding="ascii"))
    assert found.seconds == pytest.approx(MEASURED[name]["seconds"], rel=within)
    assert found.beam_on_seconds == pytest.approx(MEASURED[name]["laser_on_seconds"], rel=within)


def test_a_constant_beam_is_switched_where_the_head_stands() -> None:
    """A G1 without way waits for the motion before it, and sets the power."""
    text = "M3 S500\nG1 X5 F600\nG1 X5 S0\nG1 X25\nM5\n"
    assert time(text).beam_on_seconds == pytest.approx(0.5, abs=0.05)
    assert time(text.replace("G1 X5 S0\n", "")).beam_on_seconds == pytest.approx(2.5, abs=0.05)


def test_one_move_takes_its_trapezoid() -> None:
    assert time("G1 X100 F6000").seconds == pytest.approx(1.1, rel=1e-3)


@pytest.mark.parametrize(
    "text",
    [
        "G1 X9999999 Y5 F100",
        "G1 X100000 F0.1\nG1 X0\nG1 X1",
        "G1 X30000 F60\nG1 X0",
        "G0 X1 Y1\nG2 X10 Y0 R100000000 F100",
        "G4 P1000000",
        f"G4 P{'9' * 40}",
    ],
)
def test_a_slip_of_the_decimal_point_costs_no_more_than_another_move(
    text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor does a move of days: 10 ms segments of it would be billions."""
    segments = []
    following = SegmentGenerator.next

    def counted(generator: SegmentGenerator) -> Segment | None:
        segments.append(following(generator))
        assert len(segments) < 1000
        return segments[-1]

    monkeypatch.setattr(SegmentGenerator, "next", counted)
    seconds = time(text).seconds
    if text.startswith("G1 X9"):
        assert seconds == pytest.approx(9999999 / 100 * 60, rel=1e-3)
    elif text.startswith("G1 X30000"):
        assert seconds == pytest.approx(60_000, rel=1e-3)
        assert len(segments) > 10


@pytest.mark.parametrize("laser", [0, 1])
def test_a_long_move_is_timed_as_by_short_segments(
    laser: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where lines arrive while it holds its speed, and where the beam follows the speed."""
    text = "M4 S500\nG1 X400 F600\nY2 F500\nX0\n" + "".join(f"X{x} F900\n" for x in range(1, 60))
    quick = time(text, laser=bool(laser))
    monkeypatch.setattr("miurafab.motion.segments._LONG_HOLD", math.inf)
    slow = time(text, laser=bool(laser))
    assert quick.seconds == pytest.approx(slow.seconds, rel=2e-4)
    assert quick.beam_on_seconds == pytest.approx(slow.beam_on_seconds, rel=2e-4)
    np.testing.assert_allclose(quick.end, slow.end, atol=0.02)


def test_a_dwell_is_rounded_up_to_50_ms() -> None:
    moved = time("G0 X10").seconds
    assert time("G0 X10\nG4 P0.51").seconds == pytest.approx(moved + 0.025 + 0.55, abs=0.005)
    assert time("G4 P0.1").seconds == pytest.approx(0.1)


def test_constant_power_burns_on_while_the_motors_are_held() -> None:
    text = "M3 S9\n" + "".join(f"G1 X{x} F3000\nM5\nM3\n" for x in range(1, 11))
    free, held = time(text, idle_lock=None), time(text)
    assert held.seconds - free.seconds == pytest.approx(9 * 0.025, abs=0.005)
    assert held.beam_on_seconds - free.beam_on_seconds == pytest.approx(10 * 0.025, abs=0.005)


def test_a_slow_wire_starves_the_planner() -> None:
    text = "".join(f"G1 X{x / 10:.1f} F6000\n" for x in range(1, 400))
    assert time(text, Link(baud=9600)).seconds > 1.5 * time(text).seconds


def test_a_fast_processor_with_a_longer_look_ahead_is_faster() -> None:
    text = "".join(f"G1 X{x / 10:.1f} F6000\n" for x in range(1, 400))
    link = Link(baud=1_000_000)
    slow = time(text, link).seconds
    quick = time(text, link, slow_processor=False).seconds
    far = time(text, link, slow_processor=False, planner_blocks=100).seconds
    assert slow > 1.1 * quick
    assert quick > 1.2 * far


@pytest.mark.parametrize("text", ["", "(nothing)", "M5\nM9", "G1 F600"])
def test_a_program_without_motion_takes_no_time(text: str) -> None:
    found = time(text)
    assert found.seconds == found.beam_on_seconds == 0
    assert found.start.shape == (0,)


lines = st.lists(
    st.sampled_from(
        [f"{g} X{x} Y{y} F3000" for g in ("G0", "G1") for x in (0, 1, 1.005, 7) for y in (0, 0.3)]
        + ["M3 S5", "M4 S9", "M5", "G4 P0.05", "S3", "M8", "G92 X0", "G91 G2 X3 Y1 R5 F2000", "G90"]
    ),
    max_size=40,
)


@given(lines)
def test_moves_follow_one_another_and_the_beam_is_on_no_longer_than_it_lasts(
    program: list[str],
) -> None:
    parsed = parse_program(Job("j", "\n".join(["G1 F600", *program])))
    found = estimate(parsed, machine())
    assert len(found.start) == len(found.end) == len(parsed)
    assert (found.end >= found.start).all()
    assert (found.start[1:] >= found.end[:-1] - 1e-9).all()
    assert (np.diff(found.end) >= -1e-9).all()
    if len(parsed):
        assert found.start[0] >= 0
        assert found.seconds >= found.end[-1] - 1e-9
    again = estimate(parsed, machine())
    assert again.seconds == found.seconds


def test_parameters_come_from_settings_or_a_profile() -> None:
    for name in shipped_names("firmware_profiles"):
        profile = load_machine(name)
        parameters = MotionParameters.from_profile(profile)
        assert parameters.max_rate_mm_min[0] == profile.settings.get(
            110, profile.motion.max_rate_mm_min[0]
        )
    with pytest.raises(ProfileError, match=r"The settings lack \$11;"):
        MotionParameters.from_settings({1: 25.0})
