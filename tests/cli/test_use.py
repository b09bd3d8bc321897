"""``miurafab use``: own defaults and own profiles, by name."""

from __future__ import annotations

import dataclasses
import json
import shutil

import pytest
from command_line import sentence

import miurafab
from miurafab.profiles import shipped_directory
from miurafab.profiles.beam import Laser
from miurafab.profiles.own import OwnDefaults, configuration_folder, own_defaults
from miurafab.simulate.grbl.controller import virtual_settings

BEAM = ("--beam", "diode", "--power", "10W", "--wavelength", "450")


@pytest.fixture(autouse=True)
def configuration(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "own"))
    return tmp_path / "own" / "miurafab"


def test_without_a_file_there_are_none_and_the_usual_profiles_hold(configuration):
    assert configuration_folder() == configuration
    assert own_defaults() == OwnDefaults()


def test_they_hold_where_none_is_named(run, tmp_path, configuration):
    done = run("use", "grbl-co2-k40", "paper-100", "virtual", "--json")
    assert json.loads(done.stdout)["port"] == "virtual"
    run("fit", "plane", "--facets", "4x4", "--size", "40mm", "-o", "p.fold")
    run("sheets", "p.fold", "-o", "job")
    layout = json.loads((tmp_path / "job" / "layout.json").read_text())
    assert (layout["machine"], layout["material"]) == ("grbl-co2-k40", "paper-100")
    done = run("cut", "job", "--json")
    assert json.loads(done.stdout)["port"] == "virtual"
    assert json.loads(run("use", "--forget", "--json").stdout)["machine"] is None
    assert "'miurafab use' names it once" in sentence(run("cut", "job"), 2)


def test_a_machine_alone_leaves_the_rest(run):
    run("use", "grbl-co2-k40", "paper-100", "virtual")
    run("use", "grbl-laser-400")
    assert own_defaults() == OwnDefaults("grbl-laser-400", "paper-100", "virtual")


def test_a_pair_without_settings_is_not_taken(run):
    says = sentence(run("use", "grbl-co2-k40", "card-250"), 2)
    assert "card-250 has no settings for a CO2 laser, which grbl-co2-k40 is" in says
    assert own_defaults() == OwnDefaults()


def test_what_is_not_known_is_not_taken(run):
    assert "did you mean 'grbl-laser-400'" in sentence(run("use", "grbl-laser-40"), 2)
    assert "is not a known material" in sentence(run("use", "grbl-laser-400", "cheese"), 2)
    assert own_defaults() == OwnDefaults()


def test_own_profiles_are_known_by_their_names_and_travel_with_the_job(
    run, tmp_path, configuration
):
    (configuration / "machines").mkdir(parents=True)
    own = configuration / "machines" / "my-laser.toml"
    shutil.copy(shipped_directory("firmware_profiles") / "marlin-laser-220.toml", own)
    assert miurafab.load_machine("my-laser").bed.width_mm == 220
    assert "my-laser" in miurafab.list_machines()
    assert "my-laser" in run("profiles").stdout
    run("use", "my-laser")
    run("fit", "plane", "--facets", "4x4", "--size", "40mm", "-o", "p.fold")
    run("sheets", "p.fold", "-o", "job")
    assert (tmp_path / "job" / "my-laser.toml").read_bytes() == own.read_bytes()


def test_a_file_with_a_typing_error_is_told(run, configuration):
    configuration.mkdir(parents=True)
    (configuration / "defaults.toml").write_text('machin = "grbl-laser-400"\n')
    assert "'machin'" in sentence(run("use"), 2)


def test_a_file_is_found_from_any_folder(run, tmp_path):
    (tmp_path / "my.toml").write_bytes(
        (shipped_directory("firmware_profiles") / "grbl-co2-k40.toml").read_bytes()
    )
    run("use", "my.toml")
    assert own_defaults().machine == str(tmp_path / "my.toml")


def test_a_machine_of_ones_own_is_made_from_its_board(run, tmp_path, configuration):
    """The virtual board is set up as the profile says that it is made like."""
    done = run("profiles", "add", "mine", "--port", "virtual", *BEAM, "--json")
    made = json.loads(done.stdout)
    assert made["file"] == str(configuration / "machines" / "mine.toml")
    own = miurafab.load_machine("mine")
    like = miurafab.load_machine("grbl-laser-400")
    assert (own.bed, own.motion) == (like.bed, like.motion)
    assert own.settings[32] == 1
    assert own.tool.laser == Laser("diode", 10.0, 450.0)
    assert "exists already" in sentence(run("profiles", "add", "mine", "--port", "virtual"), 2)
    assert run("use", "mine").returncode == 0
    assert miurafab.profiles.read_machine(None) == own


def test_a_dump_makes_the_same_machine(run, tmp_path):
    values = virtual_settings(miurafab.load_machine("grbl-laser-400"))
    text = "".join(f"${number}={value:.3f}\n" for number, value in values.items())
    (tmp_path / "saved.txt").write_text(text)
    run("profiles", "add", "one", "--port", "virtual", *BEAM)
    titled = ("--title", "one, like grbl-laser-400")
    run("profiles", "add", "two", "--settings", "saved.txt", *titled, *BEAM)
    one, two = (miurafab.load_machine(name) for name in ("one", "two"))
    assert dataclasses.replace(two, name="one") == one


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("my laser", "--port", "virtual"), "'my laser' cannot name a machine"),
        (("mine",), "Give the --port of the board, or a file of its --settings"),
        (("mine", "--settings", "gone.txt", *BEAM), "gone.txt"),
        (
            ("mine", "--port", "virtual"),
            "Give the --beam of the laser, diode or co2, and the --power",
        ),
        (("mine", "--port", "virtual", *BEAM[:4]), "Give the --wavelength of the diode"),
        (("mine", "--port", "virtual", *BEAM[:2], "--power", "4kW"), "--power is 4000 W"),
        (("mine", "--port", "virtual", "--like", "grbl-pen-a4", *BEAM), "--beam is for a laser"),
    ],
)
def test_what_makes_no_machine_is_told(run, configuration, arguments, complaint):
    assert complaint in sentence(run("profiles", "add", *arguments), 2)
    assert not (configuration / "machines" / "mine.toml").exists()
