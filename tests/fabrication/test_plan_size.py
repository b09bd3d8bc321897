"""The largest size on so many sheets: closed form for one, bisected for more."""

from __future__ import annotations

import numpy as np
import pytest
from flat_patterns import bed, card, fan, fits_turned, grid, miura
from rings import revolved

import miurafab as mf
from miurafab.errors import LayoutError, OptionError
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.fit_box import Space, best_turn, scale_to_fit
from miurafab.fabrication.plan_advice import advised_size
from miurafab.fabrication.plan_size import Sizing
from miurafab.fabrication.sheets import lay_out
from miurafab.profiles import load_machine, load_material


@pytest.mark.parametrize("seed", range(30))
def test_the_largest_scale_is_exact(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(int(rng.integers(3, 15)), 2)) * rng.uniform(5.0, 90.0, 2)
    width, height = rng.uniform(50.0, 600.0, 2)
    scale = scale_to_fit(points, Space(width, height))
    assert best_turn(scale * (1 - 1e-6) * points, width, height) is not None
    assert best_turn(scale * 1.0001 * points, width, height) is None
    assert fits_turned(scale * points, width, height)


def test_patterns_that_keep_their_directions_are_scaled_as_they_lie():
    points = np.array([[0.0, 0.0], [40.0, 0.0], [40.0, 10.0]])
    assert scale_to_fit(points, Space(100.0, 50.0, (0,))) == 2.5
    assert scale_to_fit(points, Space(100.0, 50.0, (1,))) == 1.25
    assert scale_to_fit(points, Space(100.0, 50.0, (0, 1))) == 2.5


@pytest.mark.parametrize("pattern", [miura(9, 7), fan(9, 8, radius=120.0)])
def test_a_pattern_of_the_largest_size_is_one_patch_and_a_larger_one_is_not(pattern):
    machine = bed(310.0, 210.0)
    scale = Sizing(pattern, machine, card(), LayoutOptions()).largest_scale()

    def patches(size):
        return lay_out(pattern.scaled(size), machine, card()).totals.patches

    assert patches(scale) == 1
    assert patches(scale * 1.0001) > 1


def test_tabs_of_a_ring_do_not_grow_with_it():
    ring, machine = revolved("4x8", "140mm"), bed(210.0, 210.0)
    scale = Sizing(ring, machine, card(), LayoutOptions()).largest_scale()
    bare = scale_to_fit(ring.vertices_coords, Space(200.0, 200.0))
    assert 0.8 * bare < scale < bare
    assert lay_out(ring.scaled(scale), machine, card()).totals.patches == 1
    assert lay_out(ring.scaled(1.001 * scale), machine, card()).totals.patches > 1


def test_two_sheets_hold_what_was_promised():
    pattern, machine = miura(5, 4), bed(210.0, 150.0)
    one, two = (
        Sizing(pattern, machine, card(), LayoutOptions(), sheets).largest_scale()
        for sheets in (1, 2)
    )
    assert 1.1 * one < two < np.sqrt(2 / 0.6) * one
    assert lay_out(pattern.scaled(two), machine, card()).totals.sheets == 2


def test_a_flat_pattern_that_overlaps_itself_has_no_size():
    i, j = np.indices((2, 41))
    angle, radius = j * 2.2 * np.pi / 40, 40.0 + 20.0 * i
    pattern = grid(np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1)[::-1])
    with pytest.raises(LayoutError, match="At no size can the shell be cut from 1 sheet; take"):
        Sizing(pattern, bed(310.0, 210.0), card(), LayoutOptions()).largest_scale()


def test_a_fit_as_large_as_the_bed_is_one_patch_to_the_edge():
    fitted = mf.fit("hypar", facets=(4, 4), size="bed", machine="grbl-laser-400")
    job = mf.sheets(fitted, machine="grbl-laser-400").layout
    assert (job.totals.patches, job.totals.sheets) == (1, 1)
    larger = mf.sheets(fitted.pattern.scaled(1.0005), machine="grbl-laser-400").layout
    assert larger.totals.patches > 1


def test_what_a_size_in_mm_has_no_use_for_is_refused():
    with pytest.raises(OptionError, match="'sheets' is for a 'size' that the bed decides"):
        mf.fit("hypar", facets=(4, 4), sheets=2)
    with pytest.raises(OptionError, match="'machine' is for a 'size'"):
        mf.fit("hypar", facets=(4, 4), size=200, machine="grbl-laser-400")


def test_a_size_that_pays_is_told():
    pattern, machine, options = miura(9, 7), bed(310.0, 210.0), LayoutOptions()
    scale = Sizing(pattern, machine, card(), options).largest_scale()

    def told(size):
        scaled = pattern.scaled(size)
        layout = lay_out(scaled, machine, card())
        return advised_size(scaled, layout, machine, card(), options)

    whole = told(1.03 * scale)
    assert (whole.sheets, whole.seam_mm) == (1, 0.0)
    assert whole.scale == pytest.approx(1 / 1.03)
    assert told(0.8 * scale).scale == pytest.approx(1 / 0.8)
    assert told(0.999 * scale) is None


@pytest.mark.large
def test_a_hypar_of_600_mm_takes_seven_sheets_and_a_little_less_takes_four():
    pattern = mf.fit("hypar", facets=(40, 40), size=600, polish="off").pattern
    machine, material = load_machine("grbl-laser-400"), load_material("card-250")
    layout = lay_out(pattern, machine, material)
    assert layout.totals.sheets <= 7
    assert layout.totals.seam_mm <= 3700
    told = advised_size(pattern, layout, machine, material, LayoutOptions())
    assert (told.sheets, told.scale >= 0.85, told.seam_mm <= 1600) == (4, True, True)
