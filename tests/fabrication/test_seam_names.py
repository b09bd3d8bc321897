"""The labels of tabs: a letter for each unbroken line between two patches, a number along it."""

from __future__ import annotations

from itertools import pairwise

import flat_patterns
import pytest
from flat_patterns import bed, card, miura
from piece_problems import gores
from rings import revolved, tube

from miurafab.fabrication.options import TAB_SIDES, LayoutOptions
from miurafab.fabrication.seam_names import LETTERS
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.wording import in_order, runs

CASES = {
    "miura": (lambda: miura(16, 14, 14.0, 14.0), bed(200.0, 150.0), {}),
    "fan": (lambda: flat_patterns.fan(18, 14, cell=14.0, radius=250.0), bed(260.0, 200.0), {}),
    "tube": (tube, bed(400.0, 400.0), {}),
    "ring": (lambda: revolved("4x8", "140mm"), bed(400.0, 400.0), {}),
    "gores": (gores, bed(400.0, 400.0), {"border_tabs": "all"}),
}


@pytest.mark.parametrize("side", TAB_SIDES)
@pytest.mark.parametrize("name", CASES)
def test_a_letter_is_a_line_and_a_number_a_place_on_it(name, side):
    make, machine, options = CASES[name]
    pattern = make()
    layout = lay_out(pattern, machine, card(), options=LayoutOptions(tab_side=side, **options))
    seams: dict[str, dict[int, tuple]] = {}
    for patch in layout.patches:
        for tab in patch.tabs:
            letter, number = tab.label.rstrip("0123456789"), tab.label.lstrip(LETTERS)
            assert int(number) not in seams.setdefault(letter, {})
            seams[letter][int(number)] = (patch.id, tab)
    assert sorted(seams) == sorted(LETTERS[: len(seams)])
    ends = pattern.edges_vertices
    for line in seams.values():
        assert sorted(line) == list(range(1, len(line) + 1))
        pairs = {frozenset((own, tab.mate_patch)) for own, tab in line.values()}
        assert len(pairs) == 1
        for number, following in pairwise(sorted(line)):
            sides = [
                {v for edge in {tab.edge, tab.mate_edge} - {None} for v in ends[edge].tolist()}
                for _, tab in (line[number], line[following])
            ]
            # Neighbours stand on edges that meet, or have edges without room for a tab between.
            assert sides[0] & sides[1] or layout.untabbed


def test_labels_are_sorted_and_joined_as_people_count():
    labels = ["a10", "a9", "aa1", "b2", "a1", "z3", "a2", "a11"]
    assert in_order(labels) == ["a1", "a2", "a9", "a10", "a11", "b2", "z3", "aa1"]
    assert runs(labels) == "a1-a2, a9-a11, b2, z3, aa1"
