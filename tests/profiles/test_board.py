"""What a board tells of its machine is the same in a preview and in a file of one's own."""

from __future__ import annotations

from dataclasses import replace

import pytest

import miurafab as mf
from miurafab.profiles import load_machine
from miurafab.profiles.beam import Laser
from miurafab.profiles.board import PLACES, with_settings
from miurafab.profiles.machine import ZAxis

LASER = load_machine("grbl-laser-400")
TALL = replace(LASER, z=ZAxis(10.0, 500.0, 20.0))
BEAM = {"beam": "diode", "power": 5, "wavelength": 455}
TOLD = {number: 100.0 + number for number in PLACES} | {11: 0.02, 31: 2.0, 32: 1.0}


def test_every_place_is_set_once_and_where_it_belongs():
    told = with_settings(TALL, TOLD)
    for number, place in PLACES.items():
        assert getattr(getattr(told, place.part), place.field) == TOLD[number]
    assert with_settings(LASER, TOLD).z is None
    assert with_settings(LASER, {}) == LASER


@pytest.mark.parametrize("tall", [False, True])
def test_a_file_of_ones_own_says_the_same(tmp_path, monkeypatch, tall):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    like = tmp_path / "like.toml"
    text = mf.profiles.find_profile("firmware_profiles", "grbl-laser-400").read_text()
    z = '[z]\ntravel = "10mm"\nmax_rate = "500mm/min"\nacceleration = 20\n'
    like.write_text(text + z * tall)
    dump = tmp_path / "board.txt"
    dump.write_text("".join(f"${number}={value:g}\n" for number, value in TOLD.items()))
    _, made = mf.add_machine("mine", settings=dump, like=like, **BEAM)
    wanted = with_settings(TALL if tall else LASER, TOLD)
    for part in ("bed", "motion", "z"):
        assert getattr(made, part) == getattr(wanted, part)
    assert made.tool.laser == Laser("diode", 5.0, 455.0)
    assert (made.tool.s_max, made.tool.s_min) == (wanted.tool.s_max, wanted.tool.s_min) == (130, 2)


def test_a_laser_without_laser_mode_is_one_that_cut_asks_to_set(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    dump = tmp_path / "board.txt"
    dump.write_text("$32=0\n$130=300\n")
    _, made = mf.add_machine("mine", settings=dump, like="grbl-laser-400", **BEAM)
    assert made.settings[32] == 1
    assert made.bed.width_mm == 300


def test_what_makes_no_machine_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    dump = tmp_path / "board.txt"
    dump.write_text("$130=0\n")
    pen = {"settings": dump, "like": "grbl-pen-a4"}
    with pytest.raises(mf.OptionError, match="'beam' is for a laser, and this machine has a pen"):
        mf.add_machine("mine", **pen, beam="diode")
    with pytest.raises(mf.ProfileError, match="width"):
        mf.add_machine("mine", **pen)
    assert list(tmp_path.rglob("*.toml")) == []


def test_the_practice_machine_of_a_profile_tells_what_the_profile_says(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    _, made = mf.add_machine("practice", port="virtual", like="grblhal-laser-600", **BEAM)
    like = load_machine("grblhal-laser-600")
    assert (made.bed.width_mm, made.motion) == (like.bed.width_mm, like.motion)
