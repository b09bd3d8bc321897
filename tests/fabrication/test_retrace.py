"""The strokes that are made again from a layout and its pattern are those that were laid out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flat_patterns import bed, card, triangles
from piece_problems import inside_circle, two_pieces
from problems import regular

from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.retrace import retraced
from miurafab.fabrication.route.order import corner_of, order_strokes
from miurafab.fabrication.sheets import lay_out, worked
from miurafab.options import read_options
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, load_machine, load_material
from miurafab.profiles.material import Crease

BED, CARD = bed(180.0, 130.0), card()
KNIFE = load_machine("grbl-knife-a3")
SCORED = replace(CARD, creases=CARD.creases | {"valley": Crease("score")}, relief_hole_mm=0.5)
SMALL = {"max_patch": (30, 60)}


def small() -> CreasePattern:
    return regular(5, 5)


def two_trimmed() -> CreasePattern:
    return inside_circle(two_pieces(5, 5, 2), 0.45)


LAYOUTS: dict[str, tuple[Callable[[], CreasePattern], MachineProfile, dict[str, Any]]] = {
    "whole": (small, BED, {}),
    "glue": (small, BED, SMALL | {"tab_side": "alternate", "ticks": 2}),
    "slots": (small, BED, SMALL | {"join": "slots"}),
    "double": (small, BED, SMALL | {"join": "double"}),
    "turned": (small, BED, SMALL | {"rotations": (30,), "marks": "tabs"}),
    "margin": (small, BED, SMALL | {"margin": 20, "rim_numbers": True}),
    "no margin": (small, BED, {"margin": 0, "rim_numbers": True}),
    "backs": (small, bed(90.0, 90.0), SMALL | {"marks": "back", "two_sided": True, "quantity": 2}),
    "tabs": (small, BED, SMALL | {"tab_height": 3, "tab_inset": 1, "tab_angle": 60}),
    "copies": (small, BED, SMALL | {"quantity": 2, "bridges": 2}),
    "border": (lambda: two_pieces(5, 5, 2), bed(400.0, 400.0), {"border_tabs": "all"}),
    "trimmed": (two_trimmed, KNIFE, {"full_facet": True}),
    "triangles": (lambda: triangles(1, 4, 100.0, hole=True), BED, {"max_patch": (100, 80)}),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_strokes_of_a_layout_are_made_again_from_its_pattern(name: str) -> None:
    make, machine, chosen = LAYOUTS[name]
    material = load_material("card-250") if machine is KNIFE else CARD
    material = SCORED if "two_sided" in chosen else material
    options = read_options(LayoutOptions, chosen)
    layout = lay_out(make(), machine, material, options=options)
    passes, faults = retraced(layout, layout.pattern, machine, material, options)
    assert faults == []
    edges = layout.pattern.edges_vertices
    corner = corner_of(machine, worked(material, machine, options))
    for strokes, meant in zip(passes, layout.passes, strict=True):
        found = order_strokes(strokes, edges, corner_mm=corner)
        assert found.sheet == meant.sheet
        assert (found.width_mm, found.height_mm) == (meant.width_mm, meant.height_mm)
        for part in ("offsets", "operation", "patch", "edge"):
            np.testing.assert_array_equal(getattr(found, part), getattr(meant, part))
        np.testing.assert_allclose(found.points, meant.points, atol=1e-6)
