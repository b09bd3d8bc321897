"""Looking at a machine and moving it, with the controller in memory."""

from __future__ import annotations

from pathlib import Path

import pytest
from wires import FakeWire

from miurafab.errors import ControllerError, InputError, PortError, ProfileError
from miurafab.grbl.settings import Settings
from miurafab.machine import actions
from miurafab.machine.transport import open_port
from miurafab.profiles import load_machine
from miurafab.simulate.grbl.controller import VirtualGrbl, virtual_settings

LASER = virtual_settings(load_machine("grbl-laser-400"))


def test_info_says_what_the_controller_is() -> None:
    info = actions.machine_info("virtual", settings=LASER)
    assert (info.firmware, info.version) == ("Grbl", "1.1h")
    assert (info.planner_blocks, info.rx_bytes) == (15, 128)
    assert (info.state, info.beam_off) == ("Idle", True)
    assert info.position == info.machine_position == (0.0, 0.0, 0.0)


def test_settings_are_read_whole() -> None:
    found = actions.read_settings("virtual", settings=LASER)
    assert found.differences(LASER) == ()
    assert len(found.texts) == 34


def test_a_backup_restores_only_what_differs(tmp_path: Path) -> None:
    saved = tmp_path / "laser.txt"
    saved.write_text(actions.read_settings("virtual", settings=LASER).dump())
    wanted = actions.read_dump(saved)
    changed = actions.write_settings("virtual", wanted)
    stock = actions.read_settings("virtual").texts
    assert changed == {n: text for n, text in wanted.texts.items() if stock[n] != text}
    assert actions.write_settings("virtual", wanted, settings=LASER) == {}


def test_homing_is_written_before_the_soft_limits_that_need_it() -> None:
    changed = actions.write_settings("virtual", Settings({20: "1", 22: "1"}))
    assert changed == {20: "1", 22: "1"}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [({0: "2"}, r"refused '\$0=2': error:6"), ({300: "1"}, r"refused '\$300=1': error:3")],
)
def test_a_refused_setting_is_named(text: dict[int, str], sentence: str) -> None:
    with pytest.raises(ControllerError, match=sentence):
        actions.write_settings("virtual", Settings(text))


def test_a_setting_that_does_not_stick_is_named() -> None:
    """The controller answers ok and keeps one byte of it; the one beside it is written."""
    with pytest.raises(ControllerError, match=r"Not every setting was taken: \$0 .*is 44.*300"):
        actions.write_settings("virtual", Settings({0: "300", 30: "500"}))


def test_a_missing_backup_is_named(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match=r"gone\.txt does not exist"):
        actions.read_dump(tmp_path / "gone.txt")


def test_a_jog_moves_and_waits() -> None:
    report = actions.jog("virtual", x=12.5, y=-3, feed_mm_min=3000, settings=LASER)
    assert report.state == "Idle"
    assert report.machine_position == (12.5, -3.0, 0.0)
    report = actions.jog("virtual", x=12.5, absolute=True, settings=LASER)
    assert report.machine_position == (12.5, 0.0, 0.0)


def test_a_jog_needs_a_distance() -> None:
    with pytest.raises(InputError, match="distance"):
        actions.jog("virtual")


def test_homing_that_is_off_is_told() -> None:
    with pytest.raises(ControllerError, match=r"refused '\$H': error:5"):
        actions.home("virtual", settings=LASER)


def test_homing_and_unlocking() -> None:
    homing = LASER | {22: 1, 24: 500, 25: 3000}
    locked = actions.machine_info("virtual", settings=homing)
    assert locked.state == "Alarm"
    with pytest.raises(ControllerError, match=r"is locked .* so '\$J=G21G91X1.000F1000' was not"):
        actions.jog("virtual", x=1, settings=homing)
    assert actions.unlock("virtual", settings=homing).state == "Idle"
    assert actions.home("virtual", settings=homing).state == "Idle"


@pytest.mark.parametrize(
    ("port", "sentence"),
    [
        ("/dev/no-such-port", "/dev/no-such-port does not exist; .*'virtual' needs no machine"),
        ("socket://127.0.0.1:1", "Nothing listens at socket://127.0.0.1:1"),
        ("socket://x", "The port socket://x cannot be opened"),
        ("teapot://x", "The port teapot://x cannot be opened"),
    ],
)
def test_a_port_that_cannot_be_opened_says_why(port: str, sentence: str) -> None:
    with pytest.raises(PortError, match=sentence):
        open_port(port, 115_200)


@pytest.mark.parametrize("resets", [True, False])
def test_a_board_that_its_port_resets_is_told(
    resets: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And what a command did holds for the next one where it does not: unlock, then jog."""
    device = VirtualGrbl({22: 1, 24: 500, 25: 3000})
    device.advance(0.1)
    device.take_output()

    class Board(FakeWire):
        blocks = True

        def close(self) -> None:
            if resets:
                device.power_cycle()

    if resets:
        device.power_cycle()
    monkeypatch.setattr(actions, "open_port", lambda *line: Board(device))
    told: list[int] = []
    state = actions.unlock("p", on_restart=lambda: told.append(1)).state
    assert state == "Idle"
    if resets:
        with pytest.raises(ControllerError, match="locked after an alarm or before homing"):
            actions.jog("p", x=3.0, on_restart=lambda: told.append(1))
    else:
        assert actions.jog("p", x=3.0, on_restart=lambda: told.append(1)).state == "Idle"
        assert device.position[0] == pytest.approx(3.0)
    assert told == ([1, 1] if resets else [])
