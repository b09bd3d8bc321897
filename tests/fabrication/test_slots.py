"""Tabs in slots and double tabs: what is drawn goes together, over random designs."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import replace

import needles
import numpy as np
import pytest
import shapely
import slots
from flat_patterns import bed, card, miura
from piece_problems import gores
from problems import regular

import miurafab as mf
from miurafab.errors import LayoutError, OptionError
from miurafab.fabrication.assembly import assembly_order
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_outline import outline_patches
from miurafab.fabrication.seams import all_seams, seam_angles
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.slots import CLEAR_MM, LOOSE_MM, slot_strip, slot_strokes, slots_of
from miurafab.fabrication.tab_choice import choose_tabs
from miurafab.fabrication.tabs import MIN_BASE_MM, SLENDER
from miurafab.profiles import OPERATIONS, load_material

SLOTS = LayoutOptions(join="slots")
DOUBLE = LayoutOptions(join="double")


def facet(pattern, face):
    corners = pattern.faces_vertices[face]
    return shapely.Polygon(pattern.vertices_coords[corners[corners >= 0]])


def extent(shape, along):
    return float(np.ptp(shapely.get_coordinates(shape) @ along))


def sideways(line, far):
    """A strip as wide as ``line`` is long and more, on its left, as deep as ``far``."""
    along = np.diff(line, axis=0)[0] / np.linalg.norm(np.diff(line, axis=0))
    across = far * np.array([-along[1], along[0]])
    ends = line + 100 * np.array([[-1], [1]]) * along
    return shapely.Polygon([*ends, *(ends[::-1] + across)])


def proven(pattern, face_patch, material, options=SLOTS):
    """The tabs of a design with slots, every one of which is proven; and its bare edges."""
    tabs, _, bare = choose_tabs(pattern, face_patch, material, options)
    made = slots_of(pattern, tabs, material)
    assert made.tab.tolist() == np.flatnonzero(tabs.mate_face >= 0).tolist()
    strip, thick = slot_strip(material), material.thickness_mm
    angles = seam_angles(pattern, tabs.seams)
    shapes = [shapely.Polygon(c) for c in made.corners]
    laid = [shapely.Polygon(tabs.glued[k, :6]) for k in made.tab]
    for k, (tab, slot, shape) in enumerate(zip(made.tab, shapes, laid, strict=True)):
        mate = int(tabs.mate_face[tab])
        ends = pattern.vertices_coords[pattern.edges_vertices[tabs.seams.edges[tab, 1]]]
        seam, whole = shapely.LineString(ends), facet(pattern, mate)
        # Slot and tab lie inside the facet; the slot clear of all its sides, none is crossed.
        assert slot.covered_by(whole.buffer(-CLEAR_MM + 1e-6))
        assert shape.covered_by(whole.buffer(1e-6))
        assert slot.distance(seam) == pytest.approx(strip, abs=1e-6)
        # Its width lets the sheet through at the angle that the two facets leave.
        wedge = min(math.pi - angles[tab], math.pi / 2)
        assert wedge >= math.radians(30) - 1e-9
        passes = thick * (1 + math.cos(wedge)) / math.sin(wedge)
        width = np.linalg.norm(made.corners[k, 3] - made.corners[k, 0])
        assert width == pytest.approx(passes + LOOSE_MM, abs=1e-9)
        # The neck fits, the head does not, and is curled to ten thicknesses at most to go through.
        along = made.corners[k, 1] - made.corners[k, 0]
        length = np.linalg.norm(along)
        along /= length
        behind = sideways(made.corners[k, [3, 2]], 100.0)
        neck, head = extent(shape.intersection(slot), along), extent(shape & behind, along)
        assert length - 0.2 - 1e-6 <= neck <= length - 0.19
        assert 0.5 - 1e-6 <= head - length <= 1.0 + 1e-6
        curl = 10 * thick
        assert 2 * curl * math.sin(head / (2 * curl)) <= length + 0.05 * (head - length)
        # The tab is no needle.
        base = np.linalg.norm(tabs.points[tab, 1] - tabs.points[tab, 0])
        high = extent(shape, np.array([-along[1], along[0]]))
        assert base >= MIN_BASE_MM - 1e-9
        assert high <= min(SLENDER * base, material.tabs.height_mm) + 1e-9
    for a, b in itertools.combinations(range(len(shapes)), 2):
        if tabs.mate_face[made.tab[a]] == tabs.mate_face[made.tab[b]]:
            assert shapes[a].distance(laid[b]) >= CLEAR_MM - 1e-6
            assert shapes[b].distance(laid[a]) >= CLEAR_MM - 1e-6
    # What is burnt is the slot: a kerf wide about its path.
    points, count = slot_strokes(made, material.kerf_mm)
    for path, slot in zip(points.reshape(len(shapes), count, 2), shapes, strict=True):
        burnt = shapely.LineString(path).buffer(
            material.kerf_mm / 2, cap_style="square", join_style="mitre"
        )
        assert burnt.covered_by(slot.buffer(1e-6))
        hull = shapely.Polygon(burnt.exterior)
        assert hull.symmetric_difference(slot).area < 1e-6 * slot.area + 1e-9
    # No seam is forgotten.
    seams = all_seams(pattern, face_patch).edges
    held = {frozenset(pair) for pair in tabs.seams.edges.tolist()}
    for pair in seams.tolist():
        assert (frozenset(pair) in held) != bool(set(pair) & set(bare.tolist()))
    return tabs, bare


def designs(facets, count):
    seeds = itertools.count(1)
    made = (needles.design(seed, facets) for seed in seeds)
    return itertools.islice(((p, patch) for p, patch in made if patch.max() > 1), count)


@pytest.mark.parametrize("material", ["card-250", "polypropylene-04"])
def test_slots_of_random_designs_take_their_tabs(material):
    held = bare = 0
    for pattern, patch in designs((12.0, 26.0), 6):
        tabs, without = proven(pattern, patch, load_material(material))
        held, bare = held + len(tabs), bare + len(without)
    assert held > 3 * bare


def test_the_benchmark_counts_what_is_held():
    made = slots.measured((18.0, 30.0), "card-250", 4, 1)
    assert made.edges == made.held + made.bare
    assert made.held > 0.6 * made.edges


@pytest.mark.large
@pytest.mark.parametrize("facets", [(6.0, 16.0), (12.0, 26.0)])
def test_slots_of_many_random_designs_take_their_tabs(facets):
    for pattern, patch in designs(facets, 100):
        proven(pattern, patch, load_material("card-250"))


def test_borders_that_are_joined_have_slots_and_tabs_alternate():
    pattern = gores()
    options = replace(SLOTS, tab_side="alternate")
    made = outline_patches(pattern, 400.0, 400.0, card(), options)
    tabs, bare = proven(pattern, made.face_patch, card(), options)
    assert len(tabs) > 4 * len(bare) > 0


def test_where_facets_leave_no_room_there_is_no_tab():
    """Facets that are folded onto each other take no tab; others the wider a slot, the more."""
    pattern, patch = needles.design(3, (18.0, 26.0))
    widths = []
    for degrees in (20, 90, 120, 149, 151):
        folded = np.sign(pattern.edges_fold_angle) * math.radians(degrees)
        made = replace(pattern, edges_fold_angle=folded)
        corners = slots_of(made, choose_tabs(made, patch, card(), SLOTS)[0], card()).corners
        sides = np.linalg.norm(corners[:, 3] - corners[:, 0], axis=1)
        widths.append(float(sides.max(initial=0.0)))
    assert widths[0] == pytest.approx(widths[1], abs=1e-12)
    assert widths[1] < widths[2] < widths[3] < 1.3
    assert widths[4] == 0.0


@pytest.fixture(scope="module")
def slotted():
    options = LayoutOptions(join="slots", ticks_mm=2.0, max_patch_mm=(100.0, 80.0))
    hole = replace(card(), relief_hole_mm=0.5)
    return lay_out(miura(14, 12), bed(300.0, 300.0), hole, options=options)


def test_slots_are_clear_of_all_else_and_cut_before_outlines(slotted):
    number = {name: k for k, name in enumerate(OPERATIONS)}
    seen = 0
    for sheet, path in zip(slotted.sheets, slotted.toolpaths, strict=True):
        lines = [shapely.LineString(path.stroke(k)) for k in range(len(path))]
        cut = path.operation == number["cut"]
        for placed in sheet.placements:
            patch = slotted.patches[placed.patch]
            own = np.flatnonzero(path.patch == patch.id)
            outline = max(own[cut[own]].tolist())
            for slot in patch.slots:
                shape = shapely.Polygon(placed.from_patch(slot.polygon_mm))
                inside = [k for k in own.tolist() if shape.covers(lines[k])]
                assert len(inside) == 1
                assert cut[inside[0]]
                assert inside[0] < outline
                assert path.edge[inside[0]] == slot.edge
                others = [lines[k] for k in own.tolist() if k != inside[0]]
                assert min(shape.distance(line) for line in others) > 0.49
                seen += 1
    assert seen == sum(len(patch.tabs) for patch in slotted.patches) > 10


def test_a_slot_is_named_with_its_tab_and_its_mate(slotted):
    tabs = {tab.number: (patch, tab) for patch in slotted.patches for tab in patch.tabs}
    for patch in slotted.patches:
        for slot in patch.slots:
            owner, tab = tabs.pop(slot.tab)
            assert (tab.join, tab.label, tab.mate_patch) == ("slots", slot.label, patch.id)
            assert (owner.id, tab.mate_edge) == (slot.mate_patch, slot.edge)
    assert not tabs


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slots") / "job"
    mf.sheets(regular(), join="slots", max_patch=(60, 60)).write(folder)
    return folder


def test_a_written_slot_is_proven_by_its_tab(written):
    found = mf.check_job(written)
    layout = json.loads((written / "layout.json").read_text())
    count = sum(len(patch["slots"]) for patch in layout["patches"])
    assert found.valid
    assert found.traced["slot"] == count == sum(len(patch["tabs"]) for patch in layout["patches"])
    text = (written / "layout.json").read_text()
    patch = next(patch for patch in layout["patches"] if patch["slots"])
    for change, says in (
        (lambda slot: slot["polygon_mm"].reverse(), "is not the one that its tab goes through"),
        (lambda slot: slot.update(edge=0), "has no slot at the edge that it is joined to"),
        (lambda slot: slot.update(tab=999), "is for no tab of its own"),
        (lambda slot: slot.update(label="x9"), "is for no tab of its own"),
    ):
        kept = json.dumps(patch["slots"][0])
        change(patch["slots"][0])
        (written / "layout.json").write_text(json.dumps(layout))
        said = [f.sentence for f in mf.check_job(written).findings if f.code == "layout"]
        assert any(says in sentence for sentence in said)
        patch["slots"][0] = json.loads(kept)
    (written / "layout.json").write_text(text)


def test_a_job_of_one_patch_has_no_slots_and_is_whole(tmp_path):
    for name, options in (("bare", {}), ("based", {"border_tabs": "all"})):
        mf.sheets(regular(), join="slots", **options).write(tmp_path / name)
        found = mf.check_job(tmp_path / name)
        assert found.valid, found.findings
        assert "slot" not in found.traced


def test_a_slot_that_is_not_cut_is_named(written):
    program = written / "sheet-01.nc"
    text = program.read_text()
    lines = text.splitlines(keepends=True)
    cut = next(k for k, line in enumerate(lines) if "operation cut" in line)
    # The first cut is a slot: a closed path of four sides.
    first = next(k for k in range(cut, len(lines)) if lines[k].startswith("G1"))
    program.write_text("".join(lines[: first - 1] + lines[first + 4 :]))
    said = [f.sentence for f in mf.check_job(written).findings if f.code == "stroke"]
    program.write_text(text)
    assert any("the slot on edge" in sentence and "not burnt" in sentence for sentence in said)


def test_the_shell_is_closed_again_from_what_was_burnt(written):
    found = mf.rebuild(written)
    assert found.measured == found.corners
    assert found.worst_mm < 0.03


def test_what_makes_no_sense_is_refused():
    with pytest.raises(LayoutError, match=r"0\.12 mm thick, too limp for tabs in slots"):
        mf.sheets(regular(), material="paper-100", join="slots")
    with pytest.raises(OptionError, match="makes tabs as large as the facet"):
        LayoutOptions(join="slots", full_facet=True)


def test_the_guide_says_how_a_tab_goes_in(tmp_path, written):
    page = (written / "assembly.html").read_text()
    for words in ("through the slot", "It is not glued.", "into the slots of P", "Slots for tab"):
        assert words in page
    mf.sheets(regular(), join="double", max_patch=(60, 60)).write(tmp_path)
    page = (tmp_path / "assembly.html").read_text()
    for words in ("front to front", "onto those of P"):
        assert words in page


def in_space(pattern, edge, face, flat, fold):
    """Points (n, 2) beside ``edge`` of ``face`` in the folded form, turned about the edge by
    ``fold`` from the plane of the facet, towards its back."""
    ends = pattern.edges_vertices[edge]
    corners = pattern.faces_vertices[face]
    at, to = pattern.vertices_coords[ends], pattern.folded_coords[ends]
    along = (at[1] - at[0]) / np.linalg.norm(at[1] - at[0])
    way = (to[1] - to[0]) / np.linalg.norm(to[1] - to[0])
    across = np.array([-along[1], along[0]])
    across *= -np.sign((pattern.vertices_coords[corners].mean(axis=0) - at[0]) @ across)
    space = pattern.folded_coords[corners]
    normal = np.cross(space[1] - space[0], space[2] - space[1])
    normal /= np.linalg.norm(normal)
    out = space.mean(axis=0) - to[0]
    out -= (out @ way) * way
    out /= -np.linalg.norm(out)
    down = math.cos(fold) * out - math.sin(fold) * normal
    local = flat - at[0]
    return to[0] + np.outer(local @ along, way) + np.outer(local @ across, down)


@pytest.mark.parametrize("make", [regular, gores])
def test_double_tabs_meet_behind_the_shell(make):
    """Each is folded back by half of what the two facets leave there; so both lie as one."""
    pattern = make()
    size = 60.0 if pattern.pieces is None else 400.0
    outlined = outline_patches(pattern, size, size, card(), DOUBLE)
    tabs, patch = outlined.tabs, outlined.face_patch
    assert len(tabs) > 20
    signed = seam_angles(pattern, tabs.seams)
    letters = {tuple(p): f for p, f in zip(*_folds(pattern, patch), strict=True)}
    where = {(e, f): k for k, (e, f) in enumerate(zip(tabs.edge, tabs.own_face, strict=True))}
    for k in range(len(tabs)):
        mate = where[int(tabs.seams.edges[k, 1]), int(tabs.mate_face[k])]
        fold = letters[tuple(sorted(tabs.seams.edges[k]))]
        turn = math.pi / 2 + {"M": -1, "V": 1}.get(fold, 0) * signed[k] / -2
        shapes = [
            in_space(pattern, tabs.edge[j], tabs.own_face[j], tabs.polygon(j), turn)
            for j in (k, mate)
        ]
        near = np.linalg.norm(shapes[0][:, None] - shapes[1][None], axis=2).min(axis=1)
        assert near.max() < 2e-3
        assert outlined.tabs.seams.fold[k] == "M"


def _folds(pattern, patch):
    seams = all_seams(pattern, patch)
    return np.sort(seams.edges, axis=1).tolist(), seams.fold.tolist()


def test_double_tabs_have_one_label_and_make_whole_jobs(tmp_path):
    job = mf.sheets(gores(), join="double")
    labels = [tab.label for patch in job.layout.patches for tab in patch.tabs]
    assert len(labels) == 2 * len(set(labels)) == 48
    for step in assembly_order(job.layout, job.pattern):
        assert bool(step.tabs) == bool(step.edges)
    job.write(tmp_path)
    found = mf.check_job(tmp_path)
    assert found.valid, found.findings
    text = (tmp_path / "layout.json").read_text()
    layout = json.loads(text)
    corners = layout["patches"][0]["tabs"][0]["polygon_mm"]
    corners[-1] = np.mean([corners[-1], corners[1]], axis=0).tolist()
    (tmp_path / "layout.json").write_text(json.dumps(layout))
    said = [f.sentence for f in mf.check_job(tmp_path).findings if f.code == "layout"]
    assert any("is not the mirror image" in sentence for sentence in said)
