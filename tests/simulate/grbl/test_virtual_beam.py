"""The beam of the simulated controller: where, how long and how strongly it burns."""

from __future__ import annotations

import pytest
from virtual_player import LASER, RECORDED, play, ready

from miurafab.profiles import load_machine
from miurafab.simulate.beam import BeamSegment, standing_seconds
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings


def burnt(device: VirtualGrbl) -> list[BeamSegment]:
    return [segment for segment in device.beam_log if not segment.standing]


def test_each_dash_is_burnt_where_it_was_drawn() -> None:
    device = ready(LASER)
    play(device, "M4S500", *[f"G0X{x}Y1\nG1X{x + 1}F3000" for x in range(0, 10, 2)], 2.0)
    covered = {round(s.x0, 6) // 2 for s in burnt(device)}
    assert covered == {0, 1, 2, 3, 4}
    for x in range(0, 10, 2):
        dash = [s for s in burnt(device) if x <= s.x0 and s.x1 <= x + 1]
        assert dash[0].x0 == pytest.approx(x)
        assert sum(s.x1 - s.x0 for s in dash) == pytest.approx(1, abs=0.05)
        assert all(s.y0 == s.y1 == 1 for s in dash)
    assert standing_seconds(device.beam_log) == 0


def test_following_power_is_proportional_to_speed() -> None:
    device = ready(LASER)
    play(device, "M4S1000", "G1X20F3000", 2.0)
    for segment in burnt(device):
        speed = (segment.x1 - segment.x0) / (segment.t1 - segment.t0)
        # The power is that of the speed at the segment's end, 10 ms of acceleration at most.
        assert segment.power == pytest.approx(speed / 50, abs=0.07)
    assert max(segment.power for segment in burnt(device)) == 1


def test_constant_power_burns_until_it_is_told() -> None:
    device = ready(LASER)
    play(device, "M3S500", "G1X5F3000", 2.0)
    assert device.beam_on
    assert {segment.power for segment in device.beam_log} == {128 / 255}
    standing = standing_seconds(device.beam_log)
    play(device, 0.5, "M5")
    assert standing_seconds(device.beam_log) == pytest.approx(standing + 0.5, abs=0.05)
    assert not device.beam_on


def test_following_power_is_dark_while_nothing_moves() -> None:
    """The firmware's rule: in laser mode M4 sets the speed 0 at rest (``spindle_set_state`` of
    ``spindle_control.c``). A spindle override in Idle sets the spindle again (``protocol.c``), and
    so does M4 after a G1: both must leave the beam off. M3 burns.
    """
    for spindle in ("M4", "M3"):
        device = ready(LASER)
        play(device, f"{spindle}S500", b"\x9a", 0.5)
        assert device.beam_on is (spindle == "M3")
        play(device, "M5", "G1X1F3000", 0.5, f"{spindle}S500", 0.5)
        assert device.beam_on is (spindle == "M3")
        assert (standing_seconds(device.beam_log) > 0.9) is (spindle == "M3")
        assert spindle == "M3" or device.beam_log == []


def test_power_words_change_in_motion_without_a_stop() -> None:
    device = ready(RECORDED)
    play(device, "M3", *[f"G1X{x}F3000S{100 * x}" for x in range(1, 6)], "M5", 1.0)
    assert standing_seconds(device.beam_log) == pytest.approx(0.025, abs=0.002)
    assert len({segment.power for segment in device.beam_log}) == 5


def test_rapids_are_dark_in_laser_mode_only() -> None:
    for laser in (True, False):
        device = ready(LASER | {32: float(laser)})
        play(device, "M3S500", "G0X2", 1.0, "M5")
        assert bool(burnt(device)) != laser


def test_the_log_ends_now_and_may_be_cleared() -> None:
    device = ready(LASER)
    play(device, "M3S500", "G1X50F3000", 0.3)
    log = device.beam_log
    assert log[-1].t1 == pytest.approx(device.now, abs=1e-6)
    assert log[-1].x1 == pytest.approx(device.position[0], abs=0.02)
    log.clear()
    device.advance(0.1)
    assert device.beam_log[0].t0 == pytest.approx(device.now - 0.1, abs=1e-6)


def test_looking_at_the_log_changes_nothing() -> None:
    looked, alone = ready(LASER), ready(LASER)
    for device in (looked, alone):
        play(device, "M3S500", "G1X5F3000")
    for _ in range(50):
        looked.advance(1 / 64)
        assert looked.beam_log
    alone.advance(50 / 64)
    assert sum(s.t1 - s.t0 for s in looked.beam_log) == pytest.approx(
        sum(s.t1 - s.t0 for s in alone.beam_log)
    )
    assert standing_seconds(looked.beam_log) == pytest.approx(standing_seconds(alone.beam_log))
    assert looked.beam_log[-1] == alone.beam_log[-1]


def test_g28_in_laser_mode_keeps_the_power_of_the_feed_mode() -> None:
    device = ready(LASER)
    play(device, "M3", "G1X2F3000S500", 1.0, "G28", 1.0)
    assert any(s.x1 < s.x0 for s in burnt(device))


def test_the_log_stays_true_when_positions_are_counted_anew() -> None:
    device = ready(LASER | {22: 1, 23: 3, 130: 20, 131: 20, 132: 2, 25: 2000})
    play(device, "$X", "M3", "G1X5F3000S500", 1.0, "$H", 20.0)
    assert device.state == "Idle"
    play(device, "$X", "G1X-10S500", 2.0)
    device.power_cycle()
    assert all(s.x0 == s.x1 or 0 < (s.t1 - s.t0) < 0.1 for s in device.beam_log)
    assert {round(abs(s.x1 - s.x0) / (s.t1 - s.t0)) <= 51 for s in device.beam_log} == {True}


@pytest.mark.parametrize("idle_delay", [25, 255, 0])
def test_what_a_hold_leaves_burning_in_place(idle_delay: int) -> None:
    """The firmware's rule: at rest it waits for $1 before it puts out power that follows the speed
    (``st_go_idle`` and what calls it, ``stepper.c``). The last bit of braking has no power, but a
    bit shorter than one motor step is left out, and then that of the bit before it stands.
    """
    machine = virtual_settings(load_machine("grbl-laser-400"))
    program = b"M4S0F2000\nG1X3.3Y7.7S900\nX9.1Y3.3\nX2Y1\n"
    left = []
    for index in range(40):
        device = VirtualGrbl(machine | {1: idle_delay}, baud=115_200)
        device.receive(program)
        device.advance(0.1 + 0.0171 * index)
        device.receive(b"!")
        device.advance(1.0)
        assert not device.beam_on
        left += [segment for segment in device.beam_log if segment.standing]
    if idle_delay in (0, 255):
        assert left == []
    else:
        assert 10 < len(left) < 30
        assert {round(segment.t1 - segment.t0, 6) for segment in left} == {0.025}
        assert max(segment.power for segment in left) < 0.12
