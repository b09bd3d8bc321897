"""Every shipped profile is a test case; every fault in one is named by file and key."""

import re

import pytest

from miurafab.errors import ProfileError
from miurafab.profiles import load_machine, load_material, shipped_directory, shipped_names


@pytest.mark.parametrize("name", shipped_names("firmware_profiles"))
def test_shipped_machines_load(name):
    machine = load_machine(name)
    assert machine.name == name
    assert machine.power_to_s(1.0) == machine.tool.s_max
    assert machine.power_to_s(0.0) == 0


@pytest.mark.parametrize("name", shipped_names("materials"))
def test_shipped_materials_load(name):
    material = load_material(name)
    assert all(op.power <= material.max_power for op in material.operations.values())


MACHINE = (shipped_directory("firmware_profiles") / "grbl-laser-400.toml").read_text()
MATERIAL = (shipped_directory("materials") / "card-250.toml").read_text()


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        (
            'width = "400mm"',
            'widht = "400mm"',
            r"\[bed\]: 'widht' is not.*did you mean 'width'",
        ),
        ('width = "400mm"', "", r"\[bed\]: 'width' is missing"),
        ('width = "400mm"', 'width = "400"\ncolour = "red"', r"'colour' is not a known key"),
        ('width = "400mm"', 'width = "400km"', r"'width' cannot be read.*'km'"),
        (
            'width = "400mm"',
            'width = "40000mm"',
            r"'width' is 40000 mm; it must be between 10 mm",
        ),
        ('width = "400mm"', 'width = "nan"', r"'width' cannot be read"),
        (
            'margin = "5mm"',
            'margin = "300mm"',
            r"'bed' has a margin that leaves nothing",
        ),
        ("s_max = 1000", "s_max = 1000.5", r"'s_max' is 1000.5, not a whole number"),
        ('"$30" = 1000', '"30" = 1000', r"'30' is not a setting"),
        ('"$30" = 1000', '"$30" = "full"', r"'\$30' is 'full', not a number"),
        ('dialect = "grbl-1.1"', 'dialect = "grbl"', r"'dialect' is 'grbl'; it must be one of"),
        ("[motion]", "[motion", r"is not valid TOML"),
    ],
)
def test_a_fault_in_a_machine_is_named(tmp_path, old, new, named):
    assert old in MACHINE
    path = tmp_path / "mine.toml"
    path.write_text(MACHINE.replace(old, new))
    with pytest.raises(ProfileError, match=r"mine\.toml") as fault:
        load_machine(path)
    assert re.search(named, str(fault.value)), str(fault.value)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("power = 0.8", "power = 0.95", r"\[cut\]: 'power' is 0.95; max_power allows 0.9 at most"),
        ("[operations.score]", "[operations.scoer]", r"'score' is missing.*'scoer'"),
        ('gap = "0.8mm"', 'gap = "0mm"', r"'gap' is 0 mm"),
    ],
)
def test_a_fault_in_a_material_is_named(tmp_path, old, new, named):
    assert old in MATERIAL
    path = tmp_path / "mine.toml"
    path.write_text(MATERIAL.replace(old, new))
    with pytest.raises(ProfileError, match=r"mine\.toml") as fault:
        load_material(path)
    assert re.search(named, str(fault.value)), str(fault.value)


def test_an_unknown_name_says_what_there_is():
    with pytest.raises(ProfileError, match="did you mean 'card-250'"):
        load_material("card-205")
    with pytest.raises(ProfileError, match=r"nowhere/x\.toml does not exist"):
        load_machine("nowhere/x.toml")
