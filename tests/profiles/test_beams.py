"""Power belongs to a beam: every shipped pair of machine and material, and what is scaled."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import miurafab as mf
from miurafab.errors import ProfileError
from miurafab.fabrication.beam_findings import beam_findings
from miurafab.profiles import OPERATIONS, load_machine, load_material, shipped_names
from miurafab.profiles.beam import Laser

MACHINES, MATERIALS = shipped_names("firmware_profiles"), shipped_names("materials")
CARD, DIODE = load_material("card-250"), load_machine("grbl-laser-400")
S_WORDS = {
    ("card-250", "diode"): (150, 250, 700, 800),
    ("paper-100", "diode"): (80, 120, 350, 400),
    ("paper-100", "co2"): (190, 190, 218, 235),
    ("polypropylene-04", "co2"): (172, 208, 325, 370),
}
"""S of engrave, score, perforate and cut at S 0 or 100 to 1000: those of the two diode rows and
of the last are the ones that were shipped as fractions of full power.
"""


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("machine", MACHINES)
def test_each_shipped_pair_has_settings_in_watts_or_is_refused_by_name(machine, material):
    profile, stock = load_machine(machine), load_material(material)
    beam = profile.tool.beam
    if beam in ("knife", "pen"):
        entry = stock.on(profile)
        assert [entry.operations[name].power for name in OPERATIONS] == [None] * 4
    elif (material, beam) in S_WORDS:
        entry = stock.on(profile)
        at_1000 = replace(profile, tool=replace(profile.tool, s_max=1000))
        words = [at_1000.power_to_s(entry.operations[name].power) for name in OPERATIONS]
        assert tuple(words) == S_WORDS[material, beam]
        assert entry.meant.lasers[0] <= profile.tool.laser.power <= entry.meant.lasers[1]
    else:
        refused = (
            f"^{material} has no settings for {profile.tool.beam_title}, which {machine} is; it "
            "has some for: .*CO2|diode.*'miurafab calibrate'"
        )
        with pytest.raises(ProfileError, match=refused):
            stock.on(profile)
        return
    assert beam_findings(profile, stock) == []


def test_a_layout_for_a_beam_without_settings_is_refused_before_it_is_made():
    sheet = mf.fit("plane", facets=(2, 2), size=40)
    with pytest.raises(ProfileError, match="no settings for a CO2 laser"):
        mf.sheets(sheet, machine="grbl-co2-k40", material="card-250")


@given(st.floats(0.1, 100.0))
def test_within_one_kind_of_beam_the_energy_per_length_is_kept(power):
    machine = with_laser(Laser("diode", power, 450.0))
    made = CARD.on(machine)
    for name in OPERATIONS:
        own, used = CARD.beams["diode"].operations[name], made.operations[name]
        assert used.energy_j_mm == pytest.approx(own.energy_j_mm)
        assert used.power == min(own.power, power)
        assert machine.power_to_s(used.power) <= machine.tool.s_max
    assert bool(beam_findings(machine, CARD)) == (not 8.0 <= power <= 10.0)
    assert CARD.most_power(machine) == min(1.0, 9.0 / power)


def test_what_is_scaled_is_told_with_its_feeds():
    (weak,) = beam_findings(with_laser(Laser("diode", 4.0, 450.0)), CARD)
    assert (weak.code, weak.severity) == ("scaled", "warning")
    assert "lasers of 5 to 10 W, and grbl-laser-400 has 4 W" in weak.sentence
    assert "(perforate 857, cut 450 mm/min)" in weak.sentence
    (strong,) = beam_findings(with_laser(Laser("diode", 20.0, 450.0)), CARD)
    assert "each operation keeps its power in watts" in strong.sentence


@pytest.mark.parametrize("wavelength", [405.0, 455.0, 499.0])
def test_blue_diodes_are_one_kind(wavelength):
    taken = with_laser(Laser("diode", 10.0, wavelength))
    assert CARD.on(taken).operations == CARD.beams["diode"].operations


@pytest.mark.parametrize("wavelength", [650.0, 808.0, 1064.0])
def test_a_red_or_infrared_diode_is_another_kind(wavelength):
    with pytest.raises(ProfileError, match=f"a diode laser of {wavelength:g} nm"):
        CARD.on(with_laser(Laser("diode", 10.0, wavelength)))


def with_laser(laser):
    return replace(DIODE, tool=replace(DIODE.tool, laser=laser))


@pytest.mark.parametrize(
    ("machine", "refused"),
    [("grbl-co2-k40", True), ("grbl-pen-a4", True), ("grblhal-laser-600", False)],
)
def test_a_job_is_for_the_beam_that_it_was_made_for(tmp_path, machine, refused):
    job = mf.sheets(mf.fit("plane", facets=(2, 2), size=40)).write(tmp_path / "job")
    seen = mf.preview(job.path, machine=machine)
    named = mf.preview(job.path / "sheet-01.nc", machine=machine)
    value = mf.preview(job, machine=machine)
    for preview in (seen, named, value):
        found = [finding for finding in preview.findings if finding.code == "other-beam"]
        assert bool(found) == refused
    if refused:
        assert "was made for a diode laser of 450 nm, 10 W (grbl-laser-400)" in found[0].sentence
        with pytest.raises(mf.errors.MiurafabError, match="S values mean another power"):
            mf.cut(job.path, port="virtual", machine=machine)
    if machine == "grbl-co2-k40":
        with pytest.raises(mf.errors.MiurafabError, match="'force' other-beam overrides this"):
            mf.cut(job.path, port="virtual", machine=machine, force=("power", "material"))
        (done,) = mf.cut(job.path, port="virtual", machine=machine, force="other-beam")
        assert done.name == "sheet-01"
