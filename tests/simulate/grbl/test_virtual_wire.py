"""Buffers, lines, EEPROM, settings and outside events of the simulated controller."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from virtual_player import BANNER, LASER, ask, play, ready

from miurafab.errors import ProfileError
from miurafab.gcode.numbers import single
from miurafab.grbl.codes import alarm_codes, error_codes, setting_codes
from miurafab.grbl.settings import Settings, parse_dump, profile_settings
from miurafab.profiles import load_machine, shipped_names
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings
from miurafab.simulate.grbl.report import number


def test_the_banner_is_in_the_output_at_power_up() -> None:
    assert VirtualGrbl().take_output().decode() == BANNER


def test_bytes_take_their_time_both_ways() -> None:
    device = ready()
    device.receive(b"\n")
    byte = 10 / 115_200
    device.advance(0.9 * byte)
    assert device.next_event_in() == pytest.approx(0.1 * byte, abs=1e-6)
    device.advance(0.3 * byte)
    assert device.take_output() == b""
    device.advance(5 * byte)
    assert device.take_output() == b"ok\r\n"
    assert device.next_event_in() is None


def test_without_a_baud_rate_only_the_processor_takes_time() -> None:
    device = VirtualGrbl()
    device.take_output()
    device.receive(b"$G\n")
    assert device.take_output() == b""
    device.advance(0.01)
    assert device.take_output().endswith(b"ok\r\n")


def test_what_finds_the_receive_ring_full_is_lost() -> None:
    device = ready()
    play(device, b"!")
    device.receive(b"G0X1\n" * 40)
    device.advance(0.1)
    assert device.lost_bytes == 200 - 128
    assert play(device, b"~", 1.0).count("ok") == 128 // 5


def test_realtime_bytes_need_no_room() -> None:
    device = ready()
    play(device, b"!")
    device.receive(b"G0X1\n" * 40)
    device.advance(0.1)
    assert play(device, b"?").startswith("<Hold:0|")
    assert play(device, b"\x18", 0.2) == BANNER


def test_planner_full_means_no_answer() -> None:
    device = ready()
    assert play(device, "G91", *["G1X0.2F60"] * 17).count("ok") == 17
    assert "Bf:0," in play(ready({10: 3}), "G91", *["G1X0.2F60"] * 17, b"?")


@pytest.mark.parametrize(
    ("sent", "answers"),
    [
        (b"\n\r\n", "ok\r\n" * 3),
        (b"G1" + b"0" * 77 + b"X\n", "error:11\r\n"),
        (b"G" + b" " * 90 + b"0(" + b"x" * 90 + b")X1\n", "ok\r\n"),
        (b"G0" + b"0" * 77 + b"\n", "ok\r\n"),
        (b"g0x1(unclosed\nG0X0\n", "ok\r\n" * 2),
        (b"G0 /X1\n", "ok\r\n"),
        (b"%\n", "error:1\r\n"),
        (b"G0\x80\x86\xffX1\n", "ok\r\n"),
        (b"(careful?)\n", "<Idle|MPos:0.000,0.000,0.000|FS:0,0|WCO:0.000,0.000,0.000>\r\nok\r\n"),
    ],
)
def test_lines_are_read_as_the_firmware_reads_them(sent: bytes, answers: str) -> None:
    device = ready()
    for index in range(0, len(sent), 100):
        device.receive(sent[index : index + 100])
        device.advance(0.02)
    assert device.take_output().decode() == answers


def test_an_eeprom_write_is_deaf_to_what_comes_meanwhile() -> None:
    device = ready()
    device.receive(b"G10L2P1X1.234Y5.678\n" + b"G0X1\n" * 20)
    device.advance(1.0)
    assert 20 < device.lost_bytes < 110
    assert device.take_output().count(b"\r\n") < 21
    calm = ready()
    assert ask(calm, "G10L2P1X1.234Y5.678") == "ok\r\n"
    assert play(calm, *["G0X1"] * 20).count("ok") == 20
    assert calm.lost_bytes == 0


def test_writing_what_is_there_takes_no_time() -> None:
    device = ready()
    device.receive(b"$110=500\n" + b"G0\n" * 20)
    device.advance(0.2)
    assert device.lost_bytes == 0


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("$", "[HLP:$$ $# $G $I $N $x=val $Nx=line $J=line $SLP $C $X $H ~ ! ? ctrl-x]\r\nok\r\n"),
        ("$N", "$N0=\r\n$N1=\r\nok\r\n"),
        ("$N0=G1X1", "error:22\r\n"),
        ("$N=G0", "error:2\r\n"),
        ("$N0", "error:3\r\n"),
        ("$20=1", "error:10\r\n"),
        ("$0=2", "error:6\r\n"),
        ("$0=258", "error:6\r\n"),
        ("$10=-1", "error:4\r\n"),
        ("$103=1", "error:3\r\n"),
        ("$256=1", "error:3\r\n"),
        ("$-1=1", "error:3\r\n"),
        ("$100=1=2", "error:3\r\n"),
        ("$100=x", "error:2\r\n"),
        ("$RST=", "error:3\r\n"),
        ("$RST=x", "error:3\r\n"),
        ("$SLEEP", "error:3\r\n"),
        ("$#1", "error:3\r\n"),
        ("$J", "error:3\r\n"),
        ("$J=", "error:22\r\n"),
        ("$H", "error:5\r\n"),
        ("$=1", "error:2\r\n"),
    ],
)
def test_commands_answer_as_the_firmware_does(line: str, answer: str) -> None:
    assert ask(ready(), line) == answer


def test_settings_are_kept_in_the_firmwares_types() -> None:
    device = ready()
    play(device, "$1=300", "$4=7", "$11=0.0123456", "$120=1234.5678", "$110=100000000")
    listed = ask(device, "$$")
    for line in ("$1=44", "$4=1", "$11=0.012", "$120=1234.568", "$110=2147483.648"):
        assert f"{line}\r\n" in listed
    assert device.settings[110] == 1e8
    play(device, "$22=1", "$20=1", "$22=0")
    assert device.settings[20] == 0


def test_stored_things_survive_power_and_go_with_a_restore() -> None:
    device = ready()
    for line in ("$N0=G20", "$I=my laser", "G10L2P3X1", "G28.1", "$120=77"):
        assert ask(device, line) == "ok\r\n"
    device.power_cycle()
    assert play(device, 0.1) == f"{BANNER}>G20:ok\r\n"
    assert ask(device, "$I").startswith("[VER:1.1h.20190830:MYLASER]\r\n")
    assert "[G56:25.400,0.000,0.000]" in ask(device, "$#")
    assert device.settings[120] == 77
    assert play(device, "$RST=#", 0.3).startswith("[MSG:Restoring defaults]\r\nok\r\n" + BANNER)
    assert "[G56:0.000,0.000,0.000]" in ask(device, "$#")
    play(device, "$RST=$", 0.3)
    assert device.settings[120] == 10
    assert play(device, "$RST=*", 0.5).endswith(BANNER)
    assert ask(device, "$N") == "$N0=\r\n$N1=\r\nok\r\n"


def test_a_damaged_stored_line_is_reported_and_mended_once() -> None:
    device = ready()
    # The firmware does not check the number: line 2 ends in the place of the build note.
    assert ask(device, "$N2=G0X1Y2Z3F500S10") == "ok\r\n"
    stored = device._machine.settings
    stored.memory[768 + 80] ^= 1
    assert play(device, b"\x18", 0.5) == f"{BANNER}>:error:7\r\n"
    assert play(device, b"\x18", 0.5) == BANNER


def test_inches_are_reported_with_their_decimals() -> None:
    device = ready()
    play(device, "G0X25.4F1000", 5.0, "$13=1")
    assert play(device, b"?") == (
        "<Idle|MPos:1.0000,0.0000,0.0000|FS:0.0,0|WCO:0.0000,0.0000,0.0000>\r\n"
    )
    assert "F39.4 S0]" in ask(device, "$G")


def test_fields_come_round_at_their_intervals() -> None:
    device = ready(LASER)
    reports = play(device, *[b"?"] * 22).split("\r\n")[:-1]
    assert [i for i, line in enumerate(reports) if "|WCO:" in line] == [0, 10, 20]
    assert [i for i, line in enumerate(reports) if "|Ov:" in line] == [1, 11, 21]
    play(device, "G91", "G1X300F1000")
    reports = play(device, *[b"?"] * 62).split("\r\n")[:-1]
    waits = [i for i, line in enumerate(reports) if "|WCO:" in line]
    assert waits[1] - waits[0] == 30
    shown = [i for i, line in enumerate(reports) if "|Ov:" in line]
    assert shown[1] - shown[0] in (20, 21)


@given(st.floats(-1e7, 1e7, width=32), st.integers(0, 4))
def test_numbers_are_printed_to_their_decimals(value: float, decimals: int) -> None:
    text = number(value, decimals)
    if abs(value) * 10**decimals < 2**31:
        assert float(text) == pytest.approx(value, rel=1e-6, abs=0.5001 * 10**-decimals)
    assert ("." in text) == (decimals > 0)


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [
        (0.0005, 3, "0.001"),
        (-0.0004, 3, "-0.000"),
        (single(1.2345), 3, "1.235"),
        (float("nan"), 3, "2147483.648"),
        (float("inf"), 0, "2147483648"),
        (999.9996, 3, "1000.000"),
    ],
)
def test_numbers_are_rounded_as_the_firmware_rounds(value: float, decimals: int, text: str) -> None:
    assert number(value, decimals) == text


def test_a_settings_dump_is_taken_over() -> None:
    source = ready({110: 7000, 32: 1, 100: 80})
    device = VirtualGrbl(parse_dump(ask(source, "$$"), "dump").values)
    assert device.settings == source.settings
    assert device.take_output().decode() == BANNER


def test_an_unknown_setting_is_refused_by_number() -> None:
    with pytest.raises(ProfileError, match=r"\$77 is not a setting of GRBL 1\.1"):
        VirtualGrbl({77: 1})


@pytest.mark.parametrize("name", shipped_names("firmware_profiles"))
def test_the_virtual_machine_of_a_profile_passes_the_profiles_own_check(name: str) -> None:
    machine = load_machine(name)
    texts = {
        number: f"{value:.{setting_codes()[number].decimals}f}"
        for number, value in virtual_settings(machine).items()
        if number in setting_codes()
    }
    known = {n: v for n, v in profile_settings(machine).items() if n in setting_codes()}
    assert Settings(texts).differences(known) == ()


def test_power_off_in_motion_forgets_position_and_alarm() -> None:
    device = ready(LASER)
    play(device, "M3", "G1X10F3000S500", 0.1)
    device.power_cycle()
    assert not device.beam_on
    assert play(device, 0.1) == BANNER
    assert device.position == (0, 0, 0)


def test_a_frozen_controller_answers_nothing_and_runs_dry() -> None:
    device = ready(LASER)
    play(device, "G91", "M4", *["G1X5F3000S500"] * 3)
    device.freeze()
    assert play(device, b"?", "G0X1", b"\x18", 1.0) == ""
    assert not device.beam_on
    device.power_cycle()
    assert play(device, 0.1) == BANNER


def test_every_code_has_its_words() -> None:
    assert set(error_codes()) == {*range(1, 18), *range(20, 39)}
    assert set(alarm_codes()) == set(range(1, 11))
    assert set(setting_codes()) == set(VirtualGrbl().settings)
    for code in (*error_codes().values(), *alarm_codes().values()):
        assert code.name
        assert code.text
