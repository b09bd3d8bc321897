"""What is too small to fold or too weak to hold is told, and nothing else is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, facet_polygons, miura, triangles

from miurafab.errors import LayoutError
from miurafab.fabrication.feasibility import (
    HELD_MM,
    PLATE,
    facet_widths,
    require_foldable,
    strength_findings,
)
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.sheets import lay_out
from miurafab.profiles import load_material

CARD = card()


def told(pattern, material=CARD, **options):
    findings = strength_findings(pattern, material, LayoutOptions(**options))
    assert all(finding.severity == "warning" for finding in findings)
    return {finding.code: finding for finding in findings}


def with_dashes(**changes):
    return dataclasses.replace(CARD, perforation=dataclasses.replace(CARD.perforation, **changes))


def test_the_width_of_a_parallelogram_is_its_lesser_height():
    """Of a parallelogram with sides a > b and angle s: b sin(s)."""
    pattern = miura(4, 3, a=12.0, b=7.0, sector=1.1)
    widths = facet_widths(pattern.vertices_coords, pattern.faces_vertices)
    np.testing.assert_allclose(widths, 7.0 * np.sin(1.1))


def test_the_width_is_that_of_the_narrowest_strip_in_any_direction():
    """Against a search over directions, for triangles."""
    pattern = triangles(3, 4, 60.0)
    widths = facet_widths(pattern.vertices_coords, pattern.faces_vertices)
    angles = np.linspace(0.0, np.pi, 20_001)
    across = np.stack([np.cos(angles), np.sin(angles)])
    for width, corners in zip(widths, facet_polygons(pattern), strict=True):
        extent = np.ptp(shapely.get_coordinates(corners) @ across, axis=0).min()
        assert width <= extent + 1e-9
        assert width == pytest.approx(extent, rel=1e-3)


def test_a_facet_with_fewer_corners_than_others_has_its_own_width():
    points = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0], [3.0, 7.0]])
    faces = np.array([[0, 1, 2, 3], [3, 2, 4, -1]])
    np.testing.assert_allclose(facet_widths(points, faces), [4.0, 3.0])


@pytest.mark.parametrize(
    ("side", "thickness", "small"),
    [
        (1.01 * HELD_MM, 0.3, False),
        (0.99 * HELD_MM, 0.3, True),
        (9.9, 3.0, True),
        (1.01 * PLATE * 3.0, 3.0, False),
    ],
)
def test_facets_are_measured_against_thickness_and_hands(side, thickness, small):
    pattern = miura(3, 3, side, side, np.pi / 2)
    material = dataclasses.replace(CARD, thickness_mm=thickness)
    found = told(pattern, material)
    assert ("small-facets" in found) == small
    if small:
        assert found["small-facets"].where == tuple(range(9))
        assert f"narrowest has {side:.2g} mm" in found["small-facets"].sentence


def test_a_facet_narrower_than_the_sheet_is_thick_is_refused():
    tiny = miura(2, 2, 0.29, 0.4, np.pi / 2)
    with pytest.raises(LayoutError, match=r"Facet 0 is 0\.29 mm wide, and test-card is 0\.3 mm"):
        lay_out(tiny, bed(400, 400), CARD)
    require_foldable(miura(2, 2, 0.31, 0.4, np.pi / 2), CARD)


@pytest.mark.parametrize(("degrees", "sharp"), [(14.0, True), (15.0, False)])
def test_dashes_of_a_sharp_corner_run_into_each_other(degrees, sharp):
    """The bridge is 0.6 mm and the kerf 0.15 mm: they meet below 2 asin(0.125) = 14.4 degrees."""
    pattern = miura(3, 3, 60.0, 60.0, np.radians(degrees))
    found = told(pattern)
    assert ("sharp-corners" in found) == sharp
    if sharp:
        # Of the 9 facets the inner one has two sharp corners between creases; the corner of a
        # facet at a border counts where both its sides are creases.
        inner = np.isin(pattern.edges_assignment, ["M", "V"])[pattern.faces_edges].sum(axis=1) == 4
        assert set(np.flatnonzero(inner)) <= set(found["sharp-corners"].where)
        assert "sharper than 14 degrees" in found["sharp-corners"].sentence
    assert "sharp-corners" not in told(pattern, dataclasses.replace(CARD, kerf_mm=0.0))


def test_creases_of_one_dash_are_told():
    pattern = miura(3, 3, 20.0, 20.0, np.pi / 2)
    creases = tuple(np.flatnonzero(np.isin(pattern.edges_assignment, ["M", "V"])).tolist())
    alone = told(pattern, with_dashes(end_bridge_mm=8.0, min_end_mm=2.0))["single-dash"]
    assert alone.where == creases
    assert "the longest on 20 mm" in alone.sentence
    assert "single-dash" not in told(pattern, with_dashes(end_bridge_mm=6.0))


def test_creases_that_are_burnt_by_half_the_usual_share_are_told():
    """u = 20 - 2 b is burnt by 60 %, so a crease is below half of 60 % for b > 5, nearly."""
    pattern = miura(3, 3, 20.0, 20.0, np.pi / 2)
    assert "stiff-creases" in told(pattern, with_dashes(end_bridge_mm=6.0))
    assert "stiff-creases" not in told(pattern, with_dashes(end_bridge_mm=4.0))
    scored = {kind: dataclasses.replace(made, mode="score") for kind, made in CARD.creases.items()}
    material = dataclasses.replace(with_dashes(end_bridge_mm=6.0), creases=scored)
    assert "stiff-creases" not in told(pattern, material)


@pytest.mark.parametrize(
    ("dashes", "options", "named"),
    [
        ({"gap_mm": 0.1}, {}, "gap 0.1 mm"),
        ({"end_bridge_mm": 0.2}, {}, "end_bridge 0.2 mm"),
        ({}, {"bridges": 2, "bridge_mm": 0.25}, "`bridge` 0.25 mm"),
        ({"gap_mm": 0.31}, {"bridges": 2, "bridge_mm": 0.31}, None),
        ({"end_bridge_mm": 0.2, "start_end": "cut"}, {}, None),
    ],
)
def test_bridges_thinner_than_the_sheet_are_told(dashes, options, named):
    found = told(miura(3, 3), with_dashes(**dashes), **options)
    assert ("thin-bridges" in found) == (named is not None)
    if named is not None:
        assert named in found["thin-bridges"].sentence
        assert "narrower than 0.3 mm" in found["thin-bridges"].sentence


def test_a_layout_tells_them_and_tabs_without_room():
    """With an inset of 20 mm no facet of 15 mm takes glue: every seam edge is bare, and told."""
    material = with_dashes(gap_mm=0.1)
    pattern = miura(40, 4, 15.0, 15.0)
    layout = lay_out(pattern, bed(400, 400), material, options=LayoutOptions(tab_inset_mm=20.0))
    codes = [finding.code for finding in layout.findings]
    assert "thin-bridges" in codes
    assert layout.totals.tabs == 0 < layout.totals.seam_mm
    (bare,) = (finding for finding in layout.findings if finding.code == "untabbed")
    lengths = np.linalg.norm(
        np.diff(pattern.vertices_coords[pattern.edges_vertices[list(bare.where)]], axis=1), axis=2
    )
    assert lengths.sum() == pytest.approx(layout.totals.seam_mm)


@pytest.mark.parametrize("name", ["card-250", "paper-100", "polypropylene-04"])
def test_the_shipped_materials_hold_at_the_facets_of_the_shipped_designs(name):
    """The smallest are those of the pill, 6.2 mm wide with creases of 4.9 mm."""
    assert told(miura(4, 4, 4.9 / np.sin(0.9), 6.2 / np.sin(0.9), 0.9), load_material(name)) == {}
