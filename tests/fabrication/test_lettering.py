"""Single-line letters, and where they are engraved."""

from __future__ import annotations

from collections import Counter

import flat_patterns
import numpy as np
import pytest
import shapely
from flat_patterns import bed, card, miura, triangles, zigzag

from miurafab.errors import LayoutError
from miurafab.fabrication.labels import CLEARANCE_MM, Sides, place_texts
from miurafab.fabrication.lettering import text_strokes, text_width
from miurafab.fabrication.partition.patch_outline import outline_patches
from miurafab.fabrication.seam_names import LETTERS, tab_labels
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.tab_choice import choose_tabs
from miurafab.origami.crease_pattern import CreasePattern

FRONT = Sides("front", "front", "front")
ALPHABET = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ-./%" + LETTERS


def test_every_letter_is_within_its_box_and_unlike_every_other():
    seen = {}
    for letter in ALPHABET:
        strokes = text_strokes(letter)
        points = np.concatenate(strokes)
        assert np.abs(points[:, 0]).max() <= text_width(letter) / 2 + 1e-9
        assert np.abs(points[:, 1]).max() <= 0.5 + 1e-9
        assert all(len(stroke) >= 2 for stroke in strokes)
        shape = shapely.MultiLineString([stroke.tolist() for stroke in strokes]).normalize()
        if letter not in "0O":
            assert shape.wkt not in seen, f"{letter} looks like {seen[shape.wkt]}"
            seen[shape.wkt] = letter


def test_a_text_is_its_letters_side_by_side():
    width = text_width("AB")
    points = np.concatenate(text_strokes("AB"))
    assert np.ptp(points[:, 0]) == pytest.approx(width)
    assert width == pytest.approx((4 + 2 + 4) / 6)


def test_a_character_that_cannot_be_engraved_is_named():
    with pytest.raises(LayoutError, match="'ä'"):
        text_strokes("Pä")


@pytest.mark.parametrize(
    "pattern",
    [
        pytest.param(miura(20, 20, 14.0, 14.0), id="miura"),
        pytest.param(zigzag(18, 16, 16.0), id="acute"),
        pytest.param(flat_patterns.fan(24, 20, cell=14.0, radius=250.0), id="fan"),
        pytest.param(triangles(3, 12, 400.0), id="triangles"),
    ],
)
def test_no_text_touches_a_crease_a_cut_or_another_text(pattern):
    outlined = outline_patches(pattern, 190.0, 140.0, card())
    names = [f"P{k}" for k in range(len(outlined.patches))]
    labels = tab_labels(pattern, outlined.face_patch, outlined.tabs)
    turns = np.linspace(-1.5, 1.5, len(names))
    lettering = place_texts(
        pattern, outlined.face_patch, names, outlined.tabs, labels, turns, FRONT
    )
    texts, left_out = lettering.texts, lettering.left_out
    assert len(texts) + left_out == len(names) + 2 * len(labels)
    assert len(texts) > 0.8 * (len(names) + 2 * len(labels))
    creases = shapely.STRtree(shapely.linestrings(pattern.vertices_coords[pattern.edges_vertices]))
    for patch, piece in enumerate(outlined.patches):
        own = [text for text in texts if text.patch == patch]
        shapes = [shapely.MultiLineString([s.tolist() for s in text.strokes]) for text in own]
        outline = shapely.Polygon(piece.rings[0], piece.rings[1:])
        for shape in shapes:
            assert outline.contains(shape)
            assert outline.exterior.distance(shape) >= CLEARANCE_MM - 1e-6
            assert not len(creases.query(shape, predicate="dwithin", distance=CLEARANCE_MM - 1e-6))
        for k, shape in enumerate(shapes):
            assert not any(shape.convex_hull.intersects(other) for other in shapes[:k])
        for text in own:
            # Neither mirrored nor stretched, and read from left to right once the patch is turned,
            # or upwards if within 10 degrees of upright.
            drawn = np.concatenate(text.strokes)
            unit = np.concatenate(text_strokes(text.text))
            frame = np.linalg.lstsq(unit - unit.mean(axis=0), drawn - drawn.mean(axis=0))[0]
            along, across = frame
            np.testing.assert_allclose(across, [-along[1], along[0]], atol=1e-9)
            tilted = turns[patch] - np.radians(10.0)
            assert along @ np.array([np.cos(tilted), -np.sin(tilted)]) > -1e-6
    folds = dict(zip(labels, outlined.tabs.seams.fold.tolist(), strict=True))
    marked = {f"{label}{fold}" for label, fold in folds.items()}
    found = Counter(text.text for text in texts if text.text not in names)
    # Each label stands on its tab with the letter of its fold, and bare on the facet under it.
    assert set(found) <= marked | set(labels)
    bare = sum(found[label] == 2 for label in labels)
    assert bare == lettering.unmarked < 0.1 * len(labels)
    assert all(times == 1 for text, times in found.items() if text in marked)


def test_a_number_stands_on_both_sides_of_its_seam():
    layout = lay_out(miura(8, 3, 30.0, 30.0), bed(150.0, 120.0), card())
    assert "unlettered" not in {finding.code for finding in layout.findings}
    tabs = sum(len(patch.tabs) for patch in layout.patches)
    assert sorted(tab.number for patch in layout.patches for tab in patch.tabs) == list(
        range(1, tabs + 1)
    )


def test_a_patch_whose_facets_are_all_glued_upon_is_named_beside_its_tabs():
    pattern = miura(9, 3, 24.0, 24.0)
    face_patch = np.repeat([0, 0, 1], 9)
    tabs, _, _ = choose_tabs(pattern, face_patch, card())
    labels, turns = tab_labels(pattern, face_patch, tabs), np.zeros(2)
    lettering = place_texts(pattern, face_patch, ["P1", "P2"], tabs, labels, turns, FRONT)
    assert lettering.left_out == 0
    (name,) = [text for text in lettering.texts if text.text == "P2"]
    shape = shapely.MultiLineString([stroke.tolist() for stroke in name.strokes])
    for tab in range(len(tabs)):
        assert shape.distance(shapely.Polygon(tabs.polygon(tab))) >= CLEARANCE_MM - 1e-6


def test_texts_that_find_no_room_are_counted():
    layout = lay_out(miura(60, 50, 2.5, 2.5), bed(100.0, 90.0), card(tab=1.5))
    (finding,) = [each for each in layout.findings if each.code == "unlettered"]
    assert int(finding.sentence.split()[0].replace(",", "")) > 0


def test_a_facet_with_a_shallow_bay_has_a_place_for_a_name_of_more_corners_than_its_own() -> None:
    """Its convex part has six, and the layout ended with a ValueError."""
    points, ring = np.array([[4.0, 24], [11, 34], [43, 29], [53, 41], [9, 48]]), np.arange(5)
    sheet = CreasePattern(
        points, np.column_stack([ring, (ring + 1) % 5]), np.full(5, "B"), np.zeros(5), ring[None]
    )
    made = lay_out(sheet, bed(400, 300), card())
    assert made.totals.patches == 1
