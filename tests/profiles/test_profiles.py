"""Every shipped profile is a test case; every fault in one is named by file and key."""

import re

import pytest

from miurafab.errors import ProfileError
from miurafab.profiles import load_machine, load_material, shipped_directory, shipped_names


@pytest.mark.parametrize("name", shipped_names("firmware_profiles"))
def test_shipped_machines_load(name):
    machine = load_machine(name)
    assert machine.name == name
    if machine.tool.laser is not None:
        full = machine.tool.laser.power
        assert machine.power_to_s(full) == machine.power_to_s(2 * full) == machine.tool.s_max
        assert machine.power_to_s(0.0) == 0


@pytest.mark.parametrize("name", shipped_names("materials"))
def test_shipped_materials_load(name):
    material = load_material(name)
    for entry in material.beams.values():
        strengths = [each.power for each in entry.operations.values()]
        if entry.most_watts is None:
            assert strengths == [None] * 4
        else:
            assert max(strengths) <= entry.most_watts <= entry.meant.lasers[1]


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
        ("[bed]", "z = 3\n[bed]", r"'z' must be a table \[z\], not 3"),
        (
            'margin = "5mm"',
            'margin = "300mm"',
            r"'bed' has a margin that leaves nothing",
        ),
        ('beam = "diode"', "", r"\[tool\]: 'beam' is missing: .*one kind of beam, in watts"),
        ('power = "10W"', "", r"\[tool\]: 'power' is missing: .*label"),
        ("wavelength = 450", "", r"\[tool\]: 'wavelength' is missing"),
        ('beam = "diode"', 'beam = "CO2"', r"\[tool\]: 'beam' is 'CO2'"),
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
    ("machine", "old", "new", "named"),
    [
        (
            "hpgl-cutter-a3",
            "[bed]",
            '[z]\ntravel = "5mm"\nmax_rate = "500mm/min"\nacceleration = 20\n[bed]',
            "'z' is for G-code; HPGL lifts its tool without a height",
        ),
        (
            "marlin-laser-220",
            "[tool]",
            '[tool]\nair_word = "M7"',
            "'tool' has the air_word M7; Mar",
        ),
        (
            "grbl-knife-a3",
            "[tool]",
            "[tool]\ns_shallow = 9999",
            "'s_shallow' is 9999, which exceed",
        ),
    ],
)
def test_what_a_machine_of_its_kind_cannot_have_is_named(tmp_path, machine, old, new, named):
    text = (shipped_directory("firmware_profiles") / f"{machine}.toml").read_text()
    key = new.partition(" = ")[0].split()[-1]
    kept = [line for line in text.splitlines() if not line.startswith(f"{key} ")]
    (tmp_path / "mine.toml").write_text("\n".join(kept).replace(old, new, 1))
    with pytest.raises(ProfileError, match=re.escape(named)):
        load_machine(tmp_path / "mine.toml")


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('"8W"', '"9.5W"', r"\[cut\]: 'power' is 9.5 W; max_power allows 9 W at most"),
        ('power = "8W"', "", r"\[cut\]: 'power' is missing"),
        ("wavelength = 450 # nm", "", r"\[diode\]: 'wavelength' is missing"),
        ('lasers = ["5W", "10W"]', "", r"\[diode\]: 'lasers' is missing"),
        ("[beams.pen.", "[beams.penn.", r"\[beams\]: 'penn' is not a known key"),
        (
            "[beams.pen.operations.cut]",
            '[beams.pen.operations.cut]\npower = "1W"',
            "is for a laser",
        ),
        ("[beams.pen.operations.cut]", "[beams.pen.operations.cut]\nforce = 9", "forces_of"),
        (
            "[beams.diode.operations.score]",
            "[beams.diode.operations.scoer]",
            r"'score' is missing.*'scoer'",
        ),
        ("[beams.diode.operations.cut]", "[operations.cut]", "'operations' has no beam.*watts"),
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
