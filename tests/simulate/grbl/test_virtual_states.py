"""Holds, doors, alarms, overrides, homing and probing, as the firmware's rules have them."""

from __future__ import annotations

from itertools import pairwise

import pytest
from virtual_player import BANNER, LASER, ask, play, ready

from miurafab.simulate.grbl.controller import VirtualGrbl

LOCK = "[MSG:'$H'|'$X' to unlock]\r\n"


def states(output: str) -> list[str]:
    """The state words of the status reports in ``output``."""
    return [line[1:].partition("|")[0] for line in output.split("\r\n") if line.startswith("<")]


def test_a_hold_brakes_puts_the_laser_out_and_goes_on_where_it_stopped() -> None:
    device = ready(LASER)
    play(device, "G91", "G1X20F3000S500M3", 0.1)
    assert states(play(device, b"!", b"?", 0.5, b"?")) == ["Hold:1", "Hold:0"]
    assert not device.beam_on
    held = device.position
    assert play(device, 1.0) == ""
    assert device.position == held
    assert play(device, b"~", 2.0) == "[MSG:Restoring spindle]\r\n"
    assert device.position == (20, 0, 0)
    x = [(segment.x0, segment.x1) for segment in device.beam_log if not segment.standing]
    assert x[0][0] == 0
    assert x[-1][1] == 20
    assert all(a[1] == pytest.approx(b[0]) for a, b in pairwise(x))


def test_a_hold_while_idle_keeps_lines_waiting() -> None:
    device = ready()
    assert play(device, b"!", "G0X1", b"?") == (
        "<Hold:0|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>\r\n"
    )
    assert play(device, b"~") == "ok\r\n"


def test_the_door_puts_everything_out_and_a_start_brings_it_back() -> None:
    device = ready()
    play(device, "G91", "M3S500", "M8", "G1X10F400", 0.3)
    assert states(play(device, b"\x84", b"?", 1.0, b"?")) == ["Door:2", "Door:0"]
    assert not device.beam_on
    output = play(device, b"~", 0.1, b"?", 4.5, b"?", 1.0, b"?")
    assert states(output) == ["Door:3", "Door:3", "Run"]
    assert "|A:SF" in output


def test_a_door_that_opens_again_while_all_comes_back_puts_everything_out_again() -> None:
    device = ready()
    play(device, "G91", "M3S500", "M8", "G1X10F400", 0.3, b"\x84", 1.0)
    assert states(play(device, b"~", 0.5, b"?", 0.1)) == ["Door:3"]
    assert device.beam_on
    assert play(device, b"\x84", 0.2).startswith("[MSG:Check Door]")
    assert (device.beam_on, device.air_on) == (False, False)
    held = device.position
    play(device, 6.0)
    assert (device.position, device.beam_on) == (held, False)
    assert states(play(device, b"~", 6.0, b"?")) == ["Run"]
    assert (device.beam_on, device.air_on) == (True, True)


def test_after_a_door_a_laser_comes_back_with_the_motion_and_without_a_wait() -> None:
    device = ready(LASER)
    play(device, "G91", "M4S500", "G1X10F400", 0.3, b"\x84", 1.0)
    assert not device.beam_on
    assert states(play(device, b"~", 0.1, b"?")) == ["Run"]
    assert device.beam_on


def test_check_mode_reads_all_and_does_nothing() -> None:
    """The parser goes where the program would; motors, beam, air and clock stay."""
    device = ready({20: 0})
    assert play(device, "$C") == "[MSG:Enabled]\r\nok\r\n"
    lines = ["M3S500", "M8", "G4P5", "G1X3F100", "M0", "G38.2X5F100", "G10L20P1X0", "G1Q"]
    assert play(device, *lines) == "ok\r\n" * (len(lines) - 1) + "error:2\r\n"
    assert (device.beam_on, device.air_on, device.position) == (False, False, (0, 0, 0))
    assert play(device, "M2") == "[MSG:Pgm End]\r\nok\r\n"
    assert play(device, "$C", 0.5) == f"[MSG:Disabled]\r\nok\r\n{BANNER}"
    assert "[G54:5.000,0.000,0.000]" in play(device, "$#")  # where the probe would have ended


@pytest.mark.parametrize(
    ("line", "code"),
    [("$C", 8), ("$$1", 3), ("$I1", 3), ("$N0=G0X1", 8), ("$N0=$J=G91X1F100", 8), ("$RST=1", 3)],
)
def test_what_an_alarm_or_a_slip_of_the_pen_refuses(line: str, code: int) -> None:
    assert ask(ready({22: 1}), line) == f"error:{code}\r\n"


def test_a_startup_line_is_tried_before_it_is_kept() -> None:
    device = ready()
    assert play(device, "$N0=$J=G91X1F600", 2.0, "$N1=G1Q", "$N", 0.1).endswith(
        "ok\r\nerror:2\r\n$N0=$J=G91X1F600\r\n$N1=\r\nok\r\n"
    )
    assert device.position == (1, 0, 0)


def test_a_reset_in_motion_is_an_alarm_and_kills_the_beam_at_once() -> None:
    device = ready(LASER)
    play(device, "G91", "M3", "G1X20F3000S500", 0.2)
    assert device.beam_on
    device.receive(b"\x18")
    device.advance(0.0001)
    assert not device.beam_on
    assert play(device, 1.0) == f"ALARM:3\r\n{BANNER}{LOCK}"
    stopped = device.position
    assert play(device, "G0X1", "$X", b"?").startswith(
        f"error:9\r\n[MSG:Caution: Unlocked]\r\nok\r\n<Idle|MPos:{stopped[0]:.3f},"
    )


def test_a_line_that_waits_for_room_is_answered_before_the_banner() -> None:
    device = ready()
    play(device, "G91", *["G1X1F100"] * 17)
    assert play(device, b"\x18", 1.0) == f"ALARM:3\r\nok\r\n{BANNER}{LOCK}"


def test_soft_limits_stop_in_good_order_and_wait_for_a_reset() -> None:
    device = ready(LASER | {22: 1, 20: 1})
    play(device, "$X", "G1X-50F3000", 0.3)
    output = play(device, "G1X5", 1.5)
    assert output == "ALARM:2\r\n[MSG:Reset to continue]\r\n"
    position = device.position
    assert play(device, b"?", "$X", 0.5) == ""
    assert play(device, b"\x18", 0.5) == f"ok\r\n{BANNER}{LOCK}"
    assert device.position == position
    assert play(device, "$X", "$J=X5F100", "$J=X-1F100").endswith("ok\r\nerror:15\r\nok\r\n")


def test_a_hard_limit_kills_and_blocks_until_reset() -> None:
    device = ready(LASER | {21: 1})
    play(device, "M3S500", "G1X-50F3000", 0.3)
    output = play(device, lambda d: d.press_limit("X"), 1.0)
    assert output == "ALARM:1\r\n[MSG:Reset to continue]\r\n"
    assert not device.beam_on
    assert play(device, b"\x18", 0.5) == f"{BANNER}[MSG:Check Limits]\r\n{LOCK}"
    assert "|Pn:X" in play(device, b"?")
    play(device, lambda d: d.press_limit("X", False))
    assert play(device, "$X", "G0X1", 0.1) == "[MSG:Caution: Unlocked]\r\nok\r\nok\r\n"


def test_a_jog_changes_no_mode_and_locks_gcode_out() -> None:
    device = ready()
    assert play(device, "$J=G91G20X0.1F10", "G0X1", "$$") != ""
    assert states(play(device, b"?")) == ["Jog"]
    output = play(device, b"\x85", 0.5, "$G", b"?")
    assert "G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]" in output
    assert states(output) == ["Idle"]


@pytest.mark.parametrize("byte", [b"!", b"\x84", b"\x85"])
def test_any_hold_cancels_a_jog_and_forgets_the_rest(byte: bytes) -> None:
    device = ready()
    play(device, "$J=G91X5F300", "$J=G91X5F300", 0.1, byte, 1.0)
    assert 0 < device.position[0] < 1
    play(device, b"~", 0.5)
    assert play(device, "G91", "G0X0", b"?").count("ok") == 2
    assert device.state == "Idle"


@pytest.mark.parametrize(
    ("sent", "shown"),
    [
        (b"\x91", "110,100,100"),
        (b"\x92\x94", "89,100,100"),
        (b"\x93", "101,100,100"),
        (b"\x96", "100,50,100"),
        (b"\x97", "100,25,100"),
        (b"\x9a\x9c", "100,100,111"),
        (b"\x9b", "100,100,90"),
        (b"\x91\x96\x9a\x90\x95\x99", "100,100,100"),
    ],
)
def test_overrides_are_shown_at_once(sent: bytes, shown: str) -> None:
    device = ready()
    play(device, b"?", b"?")
    for byte in sent:
        play(device, bytes([byte]))
    assert f"|Ov:{shown}>" in play(device, b"?")


def test_overrides_keep_their_bounds_and_change_the_speed() -> None:
    device = ready(LASER)
    play(device, "G91", "G1X200F1000", 0.2)
    for _ in range(15):
        play(device, b"\x91")
    assert "FS:2000," in play(device, 0.3, b"?")
    for _ in range(25):
        play(device, b"\x92")
    assert "FS:100," in play(device, 0.3, b"?")
    assert "FS:1000," in play(device, b"\x90", 0.3, b"?")


def test_the_rapid_override_leaves_feeds_alone() -> None:
    device = ready(LASER)
    play(device, "G91", b"\x97", "G0X200", 0.5)
    assert "FS:1500," in play(device, b"?")
    play(device, b"\x18", 1.0, "$X", "G91", b"\x97", "G1X200F3000", 0.5)
    assert "FS:3000," in play(device, b"?")


def test_the_power_override_scales_the_beam() -> None:
    device = ready(LASER)
    play(device, "G91", "M3", "G1X100F1000S400", 0.3, b"\x9a", 0.3)
    assert {round(segment.power, 2) for segment in device.beam_log} == {0.4, 0.44}


def test_a_spindle_stop_works_only_in_a_hold() -> None:
    device = ready()
    play(device, "M3S500", "G91", "G1X10F100", 0.1, b"\x9e", 0.1)
    assert device.beam_on
    play(device, b"!", 1.0)
    assert device.beam_on
    play(device, b"\x9e")
    assert not device.beam_on
    assert play(device, b"\x9e") == "[MSG:Restoring spindle]\r\n"
    assert device.beam_on


def test_coolant_toggles_and_shows() -> None:
    device = ready()
    play(device, b"?", b"?", b"\xa0")
    assert "|Ov:100,100,100|A:F>" in play(device, b"?")
    assert "M8 T0" in ask(device, "$G")


def test_sleep_is_left_by_reset_only() -> None:
    device = ready(LASER)
    assert play(device, "G1F500M3S10", "$SLP", b"~", "G0X1", b"?") == (
        "ok\r\nok\r\n[MSG:Sleeping]\r\n"
        "<Sleep|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>\r\n"
    )
    assert not device.beam_on
    assert play(device, b"\x18", 0.5) == BANNER + LOCK


def test_a_pause_waits_for_a_start() -> None:
    device = ready()
    assert play(device, "G0X0.1", "M0", "G0X0", 0.5) == "ok\r\n"
    assert device.state == "Hold"
    assert play(device, b"~", 0.5) == "ok\r\nok\r\n"


def test_a_program_end_resets_modes_overrides_and_spindle() -> None:
    device = ready()
    play(device, "G91", "G20", "G55", "M3S100", "M8", b"\x91", "G18")
    assert play(device, "M2") == "[MSG:Pgm End]\r\nok\r\n"
    assert "G1 G54 G17 G20 G90 G94 M5 M9 T0 F0 S100]" in ask(device, "$G")
    assert "|Ov:100,100,100>" in play(device, b"?", b"?")


def test_homing_finds_the_switches_and_takes_its_time() -> None:
    device = ready({22: 1, 25: 1000, 130: 40, 131: 20, 132: 10, 120: 100, 121: 100, 122: 100})
    assert play(device, b"?").startswith("<Alarm|")
    device.receive(b"$H\n")
    began = device.now
    device.advance(3.0)
    assert device.state == "Home"
    while device.state == "Home":
        device.advance(0.01)
    # Half of each travel at 1000 mm/min, and per cycle 1 mm to locate at 25 mm/min.
    assert 8 < device.now - began < 12
    device.advance(0.1)
    assert device.take_output() == b"ok\r\n"
    assert device.position == (-1, -1, -1)
    assert play(device, "G0X-5", 2.0, "$H", 10.0).count("ok") == 2
    assert device.position == (-1, -1, -1)


def test_homing_towards_the_other_end_counts_from_there() -> None:
    device = ready({22: 1, 23: 3, 25: 1000, 130: 40, 131: 20, 132: 2})
    play(device, "$H", 30.0)
    assert device.position == (-39, -19, -1)


@pytest.mark.parametrize(
    ("device", "act", "alarm"),
    [
        ({"homing_switches": False}, None, 9),
        ({}, lambda d: d.press_limit("Z"), 8),
        ({}, lambda d: d.receive(b"\x18"), 6),
        ({}, lambda d: d.receive(b"\x84"), 7),
    ],
)
def test_homing_that_fails_says_why(device: dict[str, bool], act: object, alarm: int) -> None:
    virtual = ready({22: 1, 25: 1000, 130: 4, 131: 4, 132: 4}, **device)
    virtual.receive(b"$H\n")
    virtual.advance(0.1)
    if callable(act):
        act(virtual)
    output = play(virtual, 10.0)
    assert output.startswith(f"ALARM:{alarm}\r\n")
    assert output.endswith(BANNER + LOCK)


def probe(device: VirtualGrbl) -> None:
    device.touch_probe()


def test_a_probe_stops_where_it_touches() -> None:
    device = ready()
    output = play(device, "G91", "G38.2X5F300", 0.3, probe, 1.0)
    assert output.startswith("ok\r\n[PRB:0.")
    assert output.endswith(":1]\r\nok\r\n")
    assert "|Pn:P" in play(device, b"?")


@pytest.mark.parametrize(
    ("line", "before", "output"),
    [
        ("G38.2X0.1F300", False, "ALARM:5\r\n[PRB:0.000,0.000,0.000:0]\r\nok\r\n"),
        ("G38.3X0.1F300", False, "[PRB:0.100,0.000,0.000:0]\r\nok\r\n"),
        ("G38.2X0.1F300", True, "ALARM:4\r\nok\r\n"),
        ("G38.4X0.1F300", False, "ALARM:4\r\nok\r\n"),
        ("G38.5X0.1F300", True, "[PRB:0.100,0.000,0.000:0]\r\nok\r\n"),
    ],
)
def test_a_probe_that_fails_says_how(line: str, before: bool, output: str) -> None:
    device = ready()
    if before:
        device.touch_probe()
    assert play(device, line, 1.5) == output


def test_buttons_are_the_realtime_commands() -> None:
    device = ready()
    play(device, lambda d: d.press_button("hold"))
    assert "|Pn:H" in play(device, b"?")
    assert device.state == "Hold"
    play(device, lambda d: d.press_button("hold", False), lambda d: d.press_button("start"))
    assert device.state == "Idle"
    assert play(device, lambda d: d.press_button("reset"), 0.1) == BANNER


def test_an_unhomed_machine_may_use_its_whole_bed() -> None:
    device = ready(LASER | {110: 60000, 120: 5000, 130: 40, 21: 1})
    assert "|Pn:" not in play(device, "G0X39", 2.0, b"?", "G0X-39", 2.0, b"?")


@pytest.mark.parametrize("at", [0.001, 0.015, 0.03])
def test_a_main_program_that_hangs_goes_on_where_it_was(at: float) -> None:
    """What is on its way to the port is still said."""
    whole = play(ready(), "$$", 2.0)
    device = ready()
    device.receive(b"$$\n")
    device.advance(at)
    device.freeze(0.5)
    device.advance(0.4)
    begun = device.take_output().decode()
    assert whole.startswith(begun)
    assert begun.endswith("ok\r\n") == (at == 0.03)
    assert begun + play(device, 2.0) == whole


@pytest.mark.parametrize(
    ("settings", "line", "state"),
    [({22: 1}, "", "Alarm"), ({20: 0}, "$C", "Check"), ({}, "$SLP", "Sleep")],
)
def test_a_hold_or_a_door_changes_nothing_where_nothing_moves(
    settings: dict[int, float], line: str, state: str
) -> None:
    device = ready(settings)
    play(device, line, 0.5)
    assert states(play(device, b"!", 0.2, b"?", b"\x84", 0.2, b"?")) == [state, state]


def test_a_locked_controller_may_sleep_and_is_locked_again() -> None:
    device = ready({22: 1})
    assert states(play(device, "$SLP", 0.5, b"?")) == ["Sleep"]
    output = play(device, b"\x18", 0.5, b"?")
    assert output.startswith(BANNER + LOCK)
    assert states(output) == ["Alarm"]


def test_the_power_is_changed_in_a_hold_of_a_spindle_that_turns_on() -> None:
    device = ready()
    play(device, "G91", "M3S500", "G1X10F100", 0.3, b"!", 0.5)
    assert "|FS:0,550|" in play(device, b"\x9a", 0.1, b"?")
    assert (device.state, device.beam_on) == ("Hold", True)


def test_one_axis_is_not_homed_and_switches_are_found_without_going_back() -> None:
    device = ready({22: 1})
    assert play(device, "$HX") == "error:3\r\n"
    device = ready({22: 1, 25: 1000, 27: 0, 130: 4, 131: 4, 132: 4})
    assert states(play(device, "$H", 20.0, b"?")) == ["Idle"]
    assert device.position == (0, 0, 0)


@pytest.mark.parametrize(
    "lines",
    [
        ["G4P2"],
        ["G1X-50F100", "G38.2X-60F100"],  # before the probe
        ["G38.2X-60F100"],
        ["G1X-10F100", "G1X-900"],  # in the hold before the alarm of a soft limit
    ],
)
def test_a_reset_ends_whatever_is_waited_for(lines: list[str]) -> None:
    device = ready({20: 1, 22: 1, 25: 1000, 27: 1, 130: 200, 131: 4, 132: 4})
    play(device, "$H", 60.0, "G91", *lines, 0.01)
    output = play(device, b"\x18", 3.0, b"?")
    moved = len(lines) > 1 or lines[0] != "G4P2"
    assert ("ALARM:3" in output) == moved
    assert states(output) == (["Alarm"] if moved else ["Idle"])
    at = device.position
    play(device, 2.0)
    assert device.position == at


def test_a_feed_that_is_cut_in_mid_move_brakes_over_the_moves_that_follow() -> None:
    """They are entered faster than they may be made; nowhere it brakes harder than it can."""
    device = ready({110: 6000, 111: 6000, 120: 100, 121: 100, 11: 1})
    play(device, "G91")
    device.receive(b"G1X1F6000\n" * 12)
    play(device, 0.2, *[b"\x92", 0.002] * 9)
    places = [device.position[0]]
    while device.state == "Run":
        device.advance(0.05)
        places.append(device.position[0])
    assert device.position == pytest.approx((12, 0, 0), abs=1e-3)
    speeds = [(b - a) / 0.05 for a, b in pairwise(places)]
    assert max(speeds) > 25
    assert max(abs(b - a) for a, b in pairwise(speeds)) < 100 * 0.05 + 0.5
