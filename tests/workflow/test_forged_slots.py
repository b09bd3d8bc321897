"""A tab that is changed together with its slot, so that they fit each other: what the joint is
judged by then is whether it holds."""

from __future__ import annotations

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from problems import regular
from sealing import seal
from test_forged_jobs import Document, forged, made, narrow, refused, tab

import miurafab as mf
from miurafab.errors import LayoutError
from miurafab.fabrication.labels import AbsentLabel
from miurafab.fabrication.layout import read_layout
from miurafab.fabrication.nesting import turned
from miurafab.fabrication.partition.patch_outline import OutlinedPatches
from miurafab.fabrication.retrace import _same_labels, patches_on_sheets
from miurafab.fabrication.retrace_joints import NEAR_MM, _lock_faults, held, joint_faults
from miurafab.fabrication.slots import CLEAR_MM
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import load_material

CARD = load_material("card-250")


def outlined_of(document: Document) -> tuple[OutlinedPatches, CreasePattern, tuple[str, ...]]:
    folder = made("slots")
    pattern = mf.load(folder / "sheet.fold")
    layout = read_layout(json.dumps(document), folder / "layout.json")
    outlined, labels, _ = patches_on_sheets(layout, pattern)
    return outlined, pattern, labels


def slots_follow(document: Document) -> None:
    """Put each slot of ``document`` where its tab goes through the facet of its mate."""
    outlined, pattern, labels = outlined_of(document)
    found = held(outlined, pattern, CARD, labels, "slots").slots
    own = {each["label"]: (patch, each) for patch in document["patches"] for each in patch["slots"]}
    for row, corners in zip(found.tab.tolist(), found.corners, strict=True):
        patch, slot = own[labels[row]]
        moved = turned(corners - patch["origin_mm"], patch["rotation_deg"])
        slot["polygon_mm"] = moved.tolist()


def said(to: Path, change: Any) -> list[str]:
    def both(document: Document) -> None:
        change(document)
        slots_follow(document)

    found = refused(forged("slots", to, both))
    return [each.removeprefix("layout: ") for each in found if each.startswith("layout: ")]


P1 = "The outline of P1 does not surround its facets and tabs."
P2 = "The outline of P2 does not surround its facets and tabs."


def along(document: Document, by: float) -> None:
    part = tab(document)
    part["polygon_mm"] = [[x, y + by] for x, y in part["polygon_mm"]]


def test_slots_that_follow_their_tabs_are_those_of_the_layout(tmp_path: Path) -> None:
    assert said(tmp_path, lambda document: None) == []


def test_a_patch_may_be_turned_in_its_own_frame() -> None:
    """Corners in the plane of the pattern are the same whatever the frame of their patch."""
    document = json.loads((made("slots") / "layout.json").read_text())
    before, pattern, labels = outlined_of(document)
    for turn, patch in zip((30.0, -100.0), document["patches"], strict=True):
        parts = [(patch, "outline_mm"), *((each, "polygon_mm") for each in patch["tabs"])]
        for part, key in [*parts, *((each, "polygon_mm") for each in patch["slots"])]:
            part[key] = turned(np.array(part[key]), turn).tolist()
        patch["rotation_deg"] += turn
    after, _, _ = outlined_of(document)
    for one, other in zip(before.patches, after.patches, strict=True):
        assert np.allclose(one.cut_lines[0], other.cut_lines[0], rtol=0, atol=1e-9)
    assert np.allclose(before.tabs.points, after.tabs.points, rtol=0, atol=1e-9)
    assert np.allclose(before.tabs.glued, after.tabs.glued, rtol=0, atol=1e-9)
    layout = read_layout(json.dumps(document), made("slots") / "layout.json")
    found = held(after, pattern, CARD, labels, "slots")
    assert list(joint_faults(layout, pattern, found, labels, "slots")) == []


def test_vertices_may_have_any_numbers() -> None:
    """The first vertex is made a corner of the facet that a tab goes into."""
    folder = made("slots")
    layout = read_layout((folder / "layout.json").read_text(), folder / "layout.json")
    pattern = mf.load(folder / "sheet.fold")
    outlined, labels, _ = patches_on_sheets(layout, pattern)
    assert list(joint_faults(layout, pattern, outlined, labels, "glue"))  # nothing is joined
    for corner in pattern.faces_vertices[outlined.tabs.mate_face].ravel().tolist():
        number = np.arange(len(pattern.vertices_coords))
        number[[0, corner]] = corner, 0
        other = replace(
            pattern,
            vertices_coords=pattern.vertices_coords[number],
            folded_coords=pattern.folded_coords[number],
            edges_vertices=number[pattern.edges_vertices],
            faces_vertices=number[pattern.faces_vertices],
            grid=None,
        )
        outlined, labels, _ = patches_on_sheets(layout, other)
        found = held(outlined, other, CARD, labels, "slots")
        assert list(joint_faults(layout, other, found, labels, "slots")) == []


def test_a_head_that_is_no_wider_than_its_slot_does_not_lock(tmp_path: Path) -> None:
    locks, *others = said(tmp_path, lambda document: narrow(tab(document)))
    assert locks.startswith("Tab a1 does not lock: 5.")
    neck, length, head = map(float, re.findall(r"\d+\.\d\d", locks))
    assert neck <= length
    assert head <= length
    assert set(others) <= {P1, P2}


def test_a_tab_into_any_facet_has_six_corners() -> None:
    """Into the first facet, of number 0, and into the one after it."""
    document = json.loads((made("slots") / "layout.json").read_text())
    outlined, pattern, labels = outlined_of(document)
    for mate, count, wrong in ((0, 4, True), (1, 7, True), (-1, 4, False)):
        faces, counts = outlined.tabs.seams.faces.copy(), outlined.tabs.count.copy()
        faces[1, 1], counts[1] = mate, count
        seams = replace(outlined.tabs.seams, faces=faces)
        changed = replace(outlined, tabs=replace(outlined.tabs, seams=seams, count=counts))
        if wrong:
            with pytest.raises(LayoutError, match="Tab a2 is no tab for a slot: it has not six"):
                held(changed, pattern, CARD, labels, "slots")
        else:
            assert held(changed, pattern, CARD, labels, "slots").slots.tab.tolist() == [0, 2, 3]
        assert held(changed, pattern, CARD, labels, "glue").slots is None


def test_a_tab_at_a_fold_that_lets_nothing_in_is_told() -> None:
    """Facets that are folded by 175 degrees leave no room for a tab between them."""
    document = json.loads((made("slots") / "layout.json").read_text())
    outlined, pattern, labels = outlined_of(document)
    angles = pattern.edges_fold_angle.copy()
    angles[outlined.tabs.edge[2]] = math.radians(-175)
    closed = replace(pattern, edges_fold_angle=angles)
    with pytest.raises(LayoutError, match="Tab a3 cannot be put through a slot in the facet at"):
        held(outlined, closed, CARD, labels, "slots")


@pytest.fixture(scope="module")
def bordered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A job of one patch whose border has a tab at each edge."""
    folder = tmp_path_factory.mktemp("bordered") / "job"
    mf.sheets(regular(4, 4), border_tabs="all").write(folder)
    return folder


@pytest.mark.parametrize(
    ("by", "says"),
    [
        (0.0, []),
        (5e-5, []),  # rounding
        (2e-3, ["Tab a4 does not stand on its edge.", "Tab a4 lies over the facet that bears it."]),
        (-2e-3, ["Tab a4 does not stand on its edge."]),
    ],
)
def test_a_tab_of_the_border_lies_beside_its_facet(
    bordered: Path, tmp_path: Path, by: float, says: list[str]
) -> None:
    job = shutil.copytree(bordered, tmp_path / "job")
    layout = json.loads((job / "layout.json").read_text())
    assert tab(layout, 3)["mate_edge"] is None
    tab(layout, 3)["polygon_mm"] = [[x - by, y] for x, y in tab(layout, 3)["polygon_mm"]]
    (job / "layout.json").write_text(json.dumps(layout))
    seal(job)
    found = mf.check_job(job)
    said = [each.sentence for each in found.findings if each.code == "layout"]
    assert [each for each in said if not each.startswith("The outline")] == says
    if not by:
        assert found.traced == {"crease": 66, "tab fold": 66, "label": 48, "outline": 1}


@pytest.mark.parametrize("join", ["slots", "double"])
def test_a_tab_of_the_border_is_glued_whatever_holds_the_seams(join: str, tmp_path: Path) -> None:
    mf.sheets(regular(4, 4), border_tabs="all", join=join).write(tmp_path)
    assert refused(mf.check_job(tmp_path)) == []
    layout = json.loads((tmp_path / "layout.json").read_text())
    assert {each["join"] for each in layout["patches"][0]["tabs"]} == {"glue"}


@pytest.mark.parametrize(
    ("away", "in_the_way"),
    [
        (CLEAR_MM - 2 * NEAR_MM, True),
        (CLEAR_MM - 0.5 * NEAR_MM, False),
        (CLEAR_MM + 0.5 * NEAR_MM, False),
        (0.0, True),
    ],
)
def test_a_slot_keeps_clear_of_other_tabs_on_its_facet(away: float, in_the_way: bool) -> None:
    """Tab a2 is laid on the facet of tab a1, ``away`` from the long side of its slot."""
    document = json.loads((made("slots") / "layout.json").read_text())
    outlined, pattern, labels = outlined_of(document)
    found = held(outlined, pattern, CARD, labels, "slots")
    faces, glued = found.tabs.seams.faces.copy(), found.tabs.glued.copy()
    faces[1, 1] = faces[0, 1]
    a, _, c, d = found.slots.corners[0]
    out = (d - a) / np.linalg.norm(d - a)
    glued[1, :4] = [d + away * out, c + away * out, c + (away + 3) * out, d + (away + 3) * out]
    glued[1, 4:] = glued[1, 3]
    seams = replace(found.tabs.seams, faces=faces)
    laid = replace(found, tabs=replace(found.tabs, seams=seams, glued=glued))
    layout = read_layout(json.dumps(document), made("slots") / "layout.json")
    said = list(joint_faults(layout, pattern, laid, labels, "slots"))
    assert ("The slot for tab a1 lies in the way of tab a2." in said) is in_the_way


@pytest.mark.parametrize(
    ("letter", "folds", "right"),
    [("F", "flat", True), ("F", "valley", False), ("U", "unassigned", True), ("V", "valley", True)],
)
def test_a_tab_on_an_edge_within_the_sheet_folds_as_the_edge_does(
    letter: str, folds: str, right: bool
) -> None:
    document = json.loads((made("slots") / "layout.json").read_text())
    tab(document)["fold"] = folds
    outlined, pattern, labels = outlined_of(document)
    pattern.edges_assignment[tab(document)["edge"]] = letter
    layout = read_layout(json.dumps(document), made("slots") / "layout.json")
    found = held(outlined, pattern, CARD, labels, "slots")
    said = [
        each for each in joint_faults(layout, pattern, found, labels, "slots") if "fold" in each
    ]
    told = f"Tab a1 is told to fold {folds}, and its edge is {letter}."
    assert said == ([] if right else [told])


def test_a_slot_keeps_clear_of_the_sides_of_its_facet(tmp_path: Path) -> None:
    found = said(tmp_path, lambda document: along(document, 1.5))
    assert found[0] == "The slot for tab a1 lies within 1 mm of a side of its facet."


def arrow(neck: float, head: float) -> shapely.Polygon:
    """A tab through :data:`SLOT` upwards: ``neck`` mm wide in it and ``head`` mm behind it."""
    return shapely.union(
        shapely.box(5 - neck / 2, -3.0, 5 + neck / 2, 0.6),
        shapely.box(5 - head / 2, 0.6, 5 + head / 2, 4.0),
    )


@pytest.mark.parametrize(
    ("neck", "head", "locks"),
    [
        (9.8, 11.0, True),
        (10.0, 11.0, True),
        (10.0 + 0.9 * NEAR_MM, 11.0, True),
        (10.0 + 1.1 * NEAR_MM, 11.0, False),
        (9.8, 10.0, False),
        (9.8, 10.0 + 0.9 * NEAR_MM, False),
        (9.8, 10.0 + 1.1 * NEAR_MM, True),
        (9.8, 9.8, False),
    ],
)
@pytest.mark.parametrize("turn", [0.0, 90.0, 33.0])
def test_a_neck_fits_its_slot_and_a_head_is_wider(
    neck: float, head: float, locks: bool, turn: float
) -> None:
    def placed(shape: shapely.Polygon) -> shapely.Polygon:
        return shapely.transform(shape, lambda points: turned(points, turn) + np.array([40.0, 7.0]))

    # The corners of a slot begin at its front: along it, then away from the seam.
    slot = placed(shapely.Polygon([(0, 0), (10, 0), (10, 0.5), (0, 0.5)]))
    found = list(_lock_faults(slot, placed(arrow(neck, head)), "a1"))
    assert found == (
        [] if locks else [f"Tab a1 does not lock: {neck:.2f}, 10.00 and {head:.2f} mm wide."]
    )


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("low", [0.0, 0.35])
def test_a_neck_is_as_wide_as_its_widest_part_in_the_slot(side: int, low: float) -> None:
    """A bump of 0.1 mm beside a neck of 9 mm reaches 2 mm out, near either side of the slot."""
    slot = shapely.Polygon([(0, 0), (10, 0), (10, 0.5), (0, 0.5)])
    x = 5 + side * 5
    bump = shapely.box(x - 2, low, x + 2, low + 0.1)
    assert list(_lock_faults(slot, shapely.union(arrow(9.0, 13.0), bump), "a1")) == [
        "Tab a1 does not lock: 11.50, 10.00 and 13.00 mm wide."
    ]


def test_a_tab_that_ends_in_its_slot_has_no_head() -> None:
    slot = shapely.Polygon([(0, 0), (10, 0), (10, 0.5), (0, 0.5)])
    assert list(_lock_faults(slot, shapely.box(1.0, -3.0, 9.0, 0.4), "b2")) == [
        "Tab b2 does not lock: 8.00, 10.00 and 0.00 mm wide."
    ]


def absent(**changes: Any) -> AbsentLabel:
    label = AbsentLabel(patch=1, text="a1", x_mm=3.0, y_mm=4.0, rotation_deg=0.0, height_mm=2.0)
    return replace(label, **changes)


@pytest.mark.parametrize(
    ("changes", "same"),
    [
        ({}, True),
        ({"x_mm": 3.0 + 0.9 * NEAR_MM}, True),
        ({"x_mm": 3.0 + 1.1 * NEAR_MM}, False),
        ({"y_mm": 4.0 - 1.1 * NEAR_MM}, False),
        ({"height_mm": 2.1}, False),
        ({"rotation_deg": 90.0}, False),
        ({"patch": 0}, False),
        ({"text": "a2"}, False),
    ],
)
def test_an_absent_label_is_told_by_its_place_and_text(changes: Any, same: bool) -> None:
    assert _same_labels((absent(**changes),), (absent(),)) is same
    assert _same_labels((absent(), absent(**changes)), (absent(), absent())) is same
    assert not _same_labels((absent(),), ())


def test_absent_labels_that_are_turned_alike_are_the_same() -> None:
    one = absent(rotation_deg=30.0)
    assert _same_labels((one,), (absent(rotation_deg=390.0),))
    assert not _same_labels((one,), (absent(rotation_deg=-30.0),))
