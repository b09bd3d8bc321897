"""The strokes that are made again from a layout and its pattern are those that were laid out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from flat_patterns import bed, card, triangles
from piece_problems import inside_circle, two_pieces
from problems import regular

from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_frame import Patch
from miurafab.fabrication.retrace import retraced
from miurafab.fabrication.route.order import corner_of, order_strokes
from miurafab.fabrication.sheets import DrawnLayout, lay_out, worked
from miurafab.options import read_options
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, load_machine, load_material
from miurafab.profiles.material import Crease, Material

BED, LARGE, CARD = bed(180.0, 130.0), bed(400.0, 400.0), card()
KNIFE = load_machine("grbl-knife-a3")
SCORED = replace(CARD, creases=CARD.creases | {"valley": Crease("score")}, relief_hole_mm=0.5)
SMALL = {"max_patch": (30, 60)}


def small() -> CreasePattern:
    return regular(5, 5)


def slanted() -> CreasePattern:
    c, s = np.cos(0.35), np.sin(0.35)
    return replace(small(), vertices_coords=small().vertices_coords @ [[c, s], [-s, c]])


def two_trimmed() -> CreasePattern:
    return inside_circle(two_pieces(5, 5, 2), 0.45)


def mate_first() -> CreasePattern:
    """Two pieces, of which an edge that a tab is glued to is that of number 0."""
    pattern = two_pieces(5, 5, 2)
    assert pattern.seams is not None
    order = np.argsort(np.arange(len(pattern.edges_vertices)) != pattern.seams[0, 1], kind="stable")
    return replace(
        pattern,
        edges_vertices=pattern.edges_vertices[order],
        edges_assignment=pattern.edges_assignment[order],
        edges_fold_angle=pattern.edges_fold_angle[order],
        seams=np.argsort(order)[pattern.seams],
    )


LAYOUTS: dict[str, tuple[Callable[[], CreasePattern], MachineProfile, dict[str, Any]]] = {
    "whole": (small, BED, {}),
    "glue": (small, BED, SMALL | {"tab_side": "alternate", "ticks": 2}),
    "slots": (small, BED, SMALL | {"join": "slots"}),
    "double": (small, BED, SMALL | {"join": "double"}),
    "turned": (slanted, BED, SMALL | {"rotations": (30,), "marks": "tabs"}),
    "bare": (small, BED, SMALL | {"tab_inset": 3.5}),
    "unmarked": (small, BED, SMALL | {"marks": "none"}),
    "margin": (small, BED, SMALL | {"margin": 20, "rim_numbers": True}),
    "no margin": (small, BED, {"margin": 0, "rim_numbers": True}),
    "backs": (small, bed(90.0, 90.0), SMALL | {"marks": "back", "two_sided": True, "quantity": 2}),
    "tabs": (small, BED, SMALL | {"tab_height": 3, "tab_inset": 1, "tab_angle": 60}),
    "copies": (small, BED, SMALL | {"quantity": 2, "bridges": 2}),
    "border": (lambda: two_pieces(5, 5, 2), LARGE, {"border_tabs": "all"}),
    "mate": (mate_first, LARGE, {}),
    "pieces": (lambda: two_pieces(5, 5, 2), LARGE, {"two_sided": True}),
    "trimmed": (two_trimmed, KNIFE, {"full_facet": True}),
    "triangles": (lambda: triangles(1, 4, 100.0, hole=True), BED, {"max_patch": (100, 80)}),
}


Case = tuple[MachineProfile, Material, LayoutOptions, DrawnLayout]


@cache
def laid_out(name: str) -> Case:
    make, machine, chosen = LAYOUTS[name]
    material = load_material("card-250") if machine is KNIFE else CARD
    material = SCORED if "two_sided" in chosen else material
    options = read_options(LayoutOptions, chosen)
    return machine, material, options, lay_out(make(), machine, material, options=options)


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_strokes_of_a_layout_are_made_again_from_its_pattern(name: str) -> None:
    machine, material, options, layout = laid_out(name)
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


# What is wrong


def faults_of(name: str, **values: Any) -> list[str]:
    """What does not fit of a layout with other ``values``."""
    machine, material, options, layout = laid_out(name)
    forged = replace(layout, **values)
    return retraced(forged, layout.pattern, machine, material, options)[1]


def patches_with(name: str, tab: int, **values: Any) -> tuple[Patch, ...]:
    """The patches of a layout, a tab of the first with other ``values``."""
    first, *others = laid_out(name)[3].patches
    tabs = list(first.tabs)
    tabs[tab] = replace(tabs[tab], **values)
    return (replace(first, tabs=tuple(tabs)), *others)


@pytest.mark.parametrize("part", ["x_mm", "y_mm", "rotation_deg", "height_mm"])
def test_absent_labels_are_those_without_room_within_rounding(part: str) -> None:
    first, *others = laid_out("unmarked")[3].absent
    for by, fits in ((1e-6, True), (0.01, False), (-0.01, False)):
        moved = replace(first, **{part: getattr(first, part) + by})
        faults = faults_of("unmarked", absent=(moved, *others))
        says = "The labels that the layout calls absent are not those without room."
        assert faults == ([] if fits else [says])


@pytest.mark.parametrize("findings", [False, True])
def test_seams_without_a_tab_are_those_of_which_a_finding_says_so(findings: bool) -> None:
    told = laid_out("bare")[3].findings
    first = [replace(each, where=each.where[:1]) for each in told if each.code == "untabbed"]
    says = "{} no tab, and no finding says so, the first is edge {}."
    assert faults_of("bare", findings=tuple(first) if findings else ()) == [
        says.format("3 seam edges have", 9) if findings else says.format("4 seam edges have", 8)
    ]


def test_a_seam_between_pieces_is_named_by_its_first_edge() -> None:
    layout = laid_out("pieces")[3]
    bare = tuple(replace(patch, tabs=()) for patch in layout.patches)
    assert layout.pattern.seams is not None
    (one, other), *_ = layout.pattern.seams.tolist()
    assert one != other
    says, _ = faults_of("pieces", patches=bare)
    assert says == f"4 seam edges have no tab, and no finding says so, the first is edge {one}."


def test_a_border_tab_lies_beside_its_facet() -> None:
    tab = laid_out("border")[3].patches[0].tabs[0]
    base, step = tab.polygon_mm[0], np.diff(tab.polygon_mm[:2], axis=0)[0]
    along = step / np.linalg.norm(step)
    away = tab.polygon_mm - base
    over = base + 2 * (away @ along)[:, None] * along - away
    patches = patches_with("border", 0, polygon_mm=over)
    assert faults_of("border", patches=patches) == [
        f"Tab {tab.label} lies over the facet that bears it.",
        "The labels that the layout calls absent are not those without room.",
        "The outline of P1 does not surround its facets and tabs.",
    ]
    within = 3e-5 * np.array([along[1], -along[0]])
    for rounding in (within, -within):
        patches = patches_with("border", 0, polygon_mm=tab.polygon_mm + rounding)
        assert faults_of("border", patches=patches) == []


def test_an_outline_with_a_spike_is_none() -> None:
    """It surrounds the same area, and is burnt."""
    first, *others = laid_out("whole")[3].patches
    corner = first.outline_mm[:1]
    spiked = np.concatenate([corner, corner + 1.0, first.outline_mm])
    patches = (replace(first, outline_mm=spiked), *others)
    says = ["The outline of P1 does not surround its facets and tabs."]
    assert faults_of("whole", patches=patches) == says


@pytest.mark.parametrize("part", ["mate_edge", "mate_patch"])
def test_a_tab_with_half_a_mate_has_none(part: str) -> None:
    assert faults_of("glue", patches=patches_with("glue", 0, **{part: None})) == [
        "1 seam edge has no tab, and no finding says so, the first is edge 21.",
        "The labels that the layout calls absent are not those without room.",
    ]
