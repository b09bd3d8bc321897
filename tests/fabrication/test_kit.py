"""The folder's kit against the pattern: rows, letters, angles, wedges."""

from __future__ import annotations

import dataclasses
import html
import io
import json
import math
import re
from collections.abc import Iterator

import kit_pictures
import numpy as np
import pypdf
import pytest
import shapely
from problems import fitted, regular
from rings import revolved

from miurafab.errors import OptionError
from miurafab.fabrication.caps import capped
from miurafab.fabrication.drawing.assembly_guide import AssemblyGuide, assembly_guide
from miurafab.fabrication.drawing.glue_sections import GlueSections
from miurafab.fabrication.drawing.glue_view import GlueView
from miurafab.fabrication.drawing.kit_sections import KitSections
from miurafab.fabrication.drawing.sections import Figures, Numbered, Prose, Section
from miurafab.fabrication.drawing.views import Views
from miurafab.fabrication.kit.gauge import FLAT_DEG, MOST, STEP_DEG, wedges
from miurafab.fabrication.kit.jig import jig_of, lower_side
from miurafab.fabrication.kit.plan import folders_kit, kit_table, read_kit
from miurafab.fabrication.kit.rim import rim_ends
from miurafab.fabrication.kit.rows import Row, bend_of, crease_lines, named, numbered
from miurafab.fabrication.kit.states import folded_states
from miurafab.fabrication.labels import CLEARANCE_MM
from miurafab.fabrication.options import LayoutOptions, NestingOptions
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.toolpath import Toolpath
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.contact import triangulate
from miurafab.origami.unfold import with_angles_of_the_folded_form
from miurafab.profiles import load_machine, load_material
from miurafab.workflow.check_job import check_job
from miurafab.workflow.sheets import sheets

MACHINE, MATERIAL = load_machine("grbl-laser-400"), load_material("card-250")


def trimmed(pattern: CreasePattern, keep: np.ndarray) -> CreasePattern:
    """``pattern`` with the facets ``keep`` alone and its cells told facet by facet."""
    columns = pattern.grid[0] - 1
    number = np.arange(len(pattern.faces_vertices))
    cells = np.stack([number % columns + 4, number // columns + 7], axis=1)
    beside = np.where(pattern.edges_faces >= 0, keep[pattern.edges_faces], False)
    letters = np.where(beside.all(axis=1), pattern.edges_assignment, "B")
    used = beside.any(axis=1)
    return CreasePattern(
        pattern.vertices_coords,
        pattern.edges_vertices[used],
        letters[used],
        np.where(letters == "B", 0.0, pattern.edges_fold_angle)[used],
        pattern.faces_vertices[keep],
        cells=cells[keep],
    )


def test_each_row_of_the_grid_stands_once_in_the_order_and_each_crease_in_one_row():
    pattern = regular(9, 7)
    rows = [row.name for row in folders_kit(pattern).rows]
    assert sorted(rows) == sorted([f"C{n}" for n in range(1, 8)] + [f"R{n}" for n in range(1, 6)])
    edges = np.concatenate([line.edges for line in crease_lines(pattern)])
    creases = np.flatnonzero(np.isin(pattern.edges_assignment, ("M", "V")))
    assert sorted(edges.tolist()) == creases.tolist()


def test_a_row_lies_on_its_grid_line_and_tells_mountain_from_valley():
    pattern = regular(9, 7)
    row, column = np.divmod(pattern.edges_vertices, 9)
    for line in crease_lines(pattern):
        at = row if line.family == "R" else column
        assert (at[line.edges] == line.number).all()
        other = column if line.family == "R" else row
        assert (np.diff(other[line.edges].mean(axis=1)) == 1).all()
        assert line.letters == "".join(pattern.edges_assignment[line.edges])
        assert (pattern.edges_fold_angle[line.edges] > 0).tolist() == [
            letter == "V" for letter in line.letters
        ]


def test_lines_that_can_be_folded_over_in_one_go_come_first():
    """In a regular Miura-ori these are straight, and the others turn by 180 - 2 alpha degrees."""
    lines = crease_lines(regular(9, 7))
    first = [line for line in lines if line.family == lines[0].family]
    then = lines[len(first) :]
    pattern = regular(9, 7)
    assert bend_of(pattern, first) == pytest.approx(0, abs=1e-9)
    assert bend_of(pattern, then) == pytest.approx(math.pi - 2 * math.radians(65))
    assert {line.fold for line in first} == {"MV"}
    assert {line.fold for line in then} == {"M", "V"}


def test_rows_of_a_trimmed_sheet_count_from_its_rim_and_skip_what_is_not_there():
    whole = regular(9, 7)
    keep = np.ones(48, dtype=bool)
    keep[[0, 7, 19, 20, 40]] = False
    pattern = trimmed(whole, keep)
    lines = crease_lines(pattern)
    assert {line.name for line in lines} == {line.name for line in crease_lines(whole)}
    creases = np.isin(pattern.edges_assignment, ("M", "V"))
    assert sum(len(line.edges) for line in lines) == creases.sum()
    assert folders_kit(pattern).unnumbered == 0


def test_creases_of_a_pattern_without_a_lattice_are_counted_and_in_no_row():
    pattern = dataclasses.replace(regular(9, 7), grid=None)
    kit = folders_kit(pattern)
    assert kit.rows == ()
    assert kit.wedges == ()
    assert kit.unnumbered == np.isin(pattern.edges_assignment, ("M", "V")).sum()


def test_the_angles_of_a_row_are_those_of_its_creases():
    pattern = regular(9, 7)
    kit = folders_kit(pattern)
    assert read_kit(kit_table(kit)) == kit
    for line, row in zip(crease_lines(pattern), kit.rows, strict=True):
        sizes = np.degrees(np.abs(pattern.edges_fold_angle[line.edges]))
        told = (row.median_deg, row.least_deg, row.greatest_deg)
        found = (np.median(sizes), sizes.min(), sizes.max())
        assert np.abs(np.array(told) - found).max() <= 0.005 + 1e-9


@pytest.mark.parametrize("seed", range(8))
def test_each_row_has_one_wedge_within_half_a_step(seed):
    rng = np.random.default_rng(seed)
    spread = rng.uniform(1.0, 120.0)
    medians = np.clip(rng.normal(110.0, spread, 60), 1.0, 180.0).round(2).tolist()
    rows = [Row(f"R{k}", "M", angle, angle, angle) for k, angle in enumerate(medians, start=1)]
    made = wedges(rows)
    assert len(made) <= MOST
    names = [name for wedge in made for name in wedge.rows]
    assert sorted(names) == sorted(row.name for row in rows if row.median_deg <= FLAT_DEG)
    step, angles = STEP_DEG, {row.name: row.median_deg for row in rows}
    groups = [[180 - angles[name] for name in wedge.rows] for wedge in made]
    while max(max(group) - min(group) for group in groups) > step:
        step *= 2
    assert step <= 40
    for wedge, group in zip(made, groups, strict=True):
        off = [abs(wedge.opening_deg - opening) for opening in group]
        assert max(off) <= step / 2 + 0.05


def test_names_of_rows_are_drawn_together():
    assert named(["R3", "C1", "R1", "R2", "C7"]) == "C1, C7, R1-R3"
    assert numbered([1, 3, 5, 7], "R") == "R1, R3 ... R7"
    assert numbered([1, 2, 3, 4], "R") == "R1-R4"
    assert numbered([2, 5, 6], "C") == "C2, C5-C6"


def guide_of(pattern: CreasePattern, options: LayoutOptions | None = None) -> AssemblyGuide:
    layout = lay_out(pattern, MACHINE, MATERIAL, options=options)
    return assembly_guide(layout, pattern, MACHINE, MATERIAL, "Kit")


def words_of(page: str) -> str:
    """The text of a page of HTML outside of its pictures, one space between words."""
    page = re.sub(r"<style>.*?</style>|<svg.*?</svg>", " ", page, flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", page)).split())


def text_of(pdf: bytes) -> tuple[str, int]:
    """The text of a PDF, one space between words, and its number of pages."""
    pages = pypdf.PdfReader(io.BytesIO(pdf)).pages
    return " ".join(" ".join(page.extract_text() for page in pages).split()), len(pages)


@pytest.mark.parametrize("limit", [None, (120.0, 90.0)])
def test_paper_and_tablet_say_the_same(limit):
    pattern = regular(17, 13)
    layout = lay_out(pattern, MACHINE, MATERIAL, options=LayoutOptions(max_patch_mm=limit))
    views = Views(layout, pattern)
    guide = assembly_guide(layout, pattern, MACHINE, MATERIAL, "Kit")
    assert guide == assembly_guide(layout, pattern, MACHINE, MATERIAL, "Kit")
    paper, tablet = text_of(guide.pdf)[0], words_of(guide.page)
    sections = [*KitSections(views).sections(), *GlueSections(views).sections()]
    titles = ["folding", "rows to crease first", "collapse", "gauge"]
    assert [section.title for section in sections] == titles + ["glueing"] * (limit is not None)
    said = [words for section in sections for words in spoken(section)]
    assert len(said) > 20
    for words in said:
        assert words in paper
        assert words in tablet
    assert all(sheet.name[1:] in tablet for sheet in layout.sheets)
    assert guide.page.count("<svg") == 2 + len(layout.sheets) + sum(
        len(block.figures)
        for section in sections
        for block in section.blocks
        if isinstance(block, Figures)
    )


def spoken(section: Section) -> Iterator[str]:
    """All that a section says in words."""
    yield section.subtitle
    for block in section.blocks:
        if isinstance(block, Prose):
            yield block.words
        elif isinstance(block, Numbered):
            yield from block.lines
        elif isinstance(block, Figures):
            for figure in block.figures:
                yield figure.title
                yield from figure.lines


def test_the_page_needs_no_network_and_fits_a_narrow_screen():
    page = guide_of(regular(9, 7)).page
    assert 'content="width=device-width, initial-scale=1"' in page
    assert set(re.findall(r"""(?:src|href|url)\s*[=(]\s*["']?(.)""", page)) == {"#"}
    assert "<script" not in page
    assert set(re.findall(r"https?://[^\"' ]+", page)) == {"http://www.w3.org/2000/svg"}
    ids = re.findall(r'id="(s\d+)"', page)
    assert re.findall(r'href="#(s\d+)"', page) == ids


def test_rows_end_on_the_rim_of_each_patch():
    pattern = regular(17, 13)
    layout = lay_out(pattern, MACHINE, MATERIAL, options=LayoutOptions(max_patch_mm=(120.0, 90.0)))
    lines = crease_lines(pattern)
    for patch in layout.patches:
        inside = np.zeros(len(pattern.faces_vertices), dtype=bool)
        inside[patch.faces] = True
        beside = np.where(pattern.edges_faces >= 0, inside[pattern.edges_faces], False)
        rim = np.unique(pattern.edges_vertices[beside.sum(axis=1) == 1])
        ends = rim_ends(pattern, lines, inside)
        crossing = [line for line in lines if beside[line.edges].all(axis=1).any()]
        assert [end.name for end in ends] == [line.name for line in crossing for _ in range(2)]
        for end in ends:
            off = np.linalg.norm(pattern.vertices_coords[rim] - end.at, axis=1)
            assert off.min() == 0
            own = next(line for line in lines if line.name == end.name)
            points = pattern.vertices_coords[pattern.edges_vertices[own.edges]]
            inner = points[beside[own.edges].all(axis=1)].reshape(-1, 2)
            assert ((inner - end.at) @ end.out).max() <= 1e-9


def test_the_states_are_of_the_angles_that_they_are_called_after():
    """A regular Miura-ori moves rigidly, so its median fold angle can be told in advance."""
    pattern = regular(9, 7)
    states = folded_states(pattern)
    assert states.titles == ("One third", "Two thirds", "Done")
    folded = np.flatnonzero(np.isin(pattern.edges_assignment, ("M", "V")))
    median = np.median(np.abs(pattern.edges_fold_angle[folded]))
    for part, shape in zip((1 / 3, 2 / 3, 1.0), states.shapes, strict=True):
        angle = np.median([_opening(pattern, shape, edge) for edge in folded.tolist()])
        assert math.pi - angle == pytest.approx(part * median, abs=1e-6)


def _opening(pattern: CreasePattern, shape: np.ndarray, edge: int) -> float:
    """The angle between the two facets at an edge, from coordinates alone."""
    a, b = shape[pattern.edges_vertices[edge]]
    way = (b - a) / np.linalg.norm(b - a)
    sides = []
    for face in pattern.edges_faces[edge].tolist():
        to = shape[pattern.faces_vertices[face]].mean(axis=0) - a
        to -= (to @ way) * way
        sides.append(to / np.linalg.norm(to))
    return math.acos(float(np.clip(sides[0] @ sides[1], -1, 1)))


def test_a_sheet_that_cannot_be_moved_is_shown_done_with_a_sentence():
    """Two facets that share no crease with the others: no motion, and no guess of one."""
    pattern = regular(4, 3)
    letters = pattern.edges_assignment.copy()
    letters[(pattern.edges_faces >= 0).all(axis=1)] = "C"
    loose = dataclasses.replace(
        pattern, edges_assignment=letters, edges_fold_angle=np.zeros(len(letters))
    )
    states = folded_states(loose)
    assert states.titles == ("Done",)
    assert states.shapes[0] is pattern.folded_coords
    assert "could not be computed" in states.how


def test_of_many_facets_the_finished_form_alone_is_shown(monkeypatch):
    monkeypatch.setattr("miurafab.fabrication.kit.states.MOST_FACETS", 40)
    pattern = regular(9, 7)
    states = folded_states(pattern)
    assert states.titles == ("Done",)
    assert states.shapes[0] is pattern.folded_coords
    assert states.how == "With more than 40 facets only the finished form is drawn."


def test_many_rows_have_wedges_and_no_table_of_all(monkeypatch):
    table = "from-to"
    assert table in words_of(guide_of(regular(9, 7)).page)
    monkeypatch.setattr("miurafab.fabrication.drawing.kit_sections._LISTED", 3)
    page = words_of(guide_of(regular(9, 7)).page)
    assert table not in page
    assert "Wedge A: fold by" in page


def test_a_tab_lies_in_the_plane_of_the_facet_over_it():
    pattern = regular(17, 13)
    layout = lay_out(pattern, MACHINE, MATERIAL, options=LayoutOptions(max_patch_mm=(120.0, 90.0)))
    view = GlueView(Views(layout, pattern))
    tabs = [(patch, tab) for patch in layout.patches for tab in patch.tabs]
    assert tabs
    for patch, tab in tabs:
        face, outline = view.glued(patch, tab)
        assert layout.patches[tab.mate_patch].faces.tolist().count(face) == 1
        corners = pattern.folded_coords[pattern.faces_vertices[face]]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        normal /= np.linalg.norm(normal)
        assert np.abs((outline - corners[0]) @ normal).max() < 1e-6
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            inward = np.cross(normal, b - a)
            assert ((outline - a) @ inward).min() > -1e-3 * np.linalg.norm(inward)


@pytest.mark.parametrize("rows", [30, pytest.param(60, marks=pytest.mark.large)])
def test_a_large_sheet_has_the_sections_of_a_small_one(rows):
    """Bounds on pages and bytes: 3,600 facets are a week of folding, and no flood of paper."""
    large, small = (guide_of(regular(n, n)) for n in (rows + 1, 9))
    text, pages = text_of(large.pdf)
    assert pages <= 16
    assert len(large.pdf) < 2_000_000 * rows / 60
    assert len(large.page) < 8_000_000 * rows / 60
    for title in ("Folding", "Rows to crease first", "Collapse", "Gauge"):
        assert title in words_of(large.page)
        assert title in words_of(small.page)
    mountains, valleys = f"R1, R3 ... R{rows - 1}", f"R2, R4 ... R{rows - 2}"
    assert f"Mountains: {mountains}. Valleys: {valleys}." in text


def test_rim_numbers_stand_on_the_waste_beside_their_rows():
    pattern = regular(9, 7)
    options = LayoutOptions(
        rim_numbers=True, max_patch_mm=(60.0, 60.0), nesting=NestingOptions(quantity=2)
    )
    without = dataclasses.replace(options, rim_numbers=False)
    bare = lay_out(pattern, MACHINE, MATERIAL, options=without)
    layout = lay_out(pattern, MACHINE, MATERIAL, options=options)
    count = 0
    for sheet, path, before in zip(layout.sheets, layout.toolpaths, bare.toolpaths, strict=True):
        solid = shapely.union_all(
            [
                shapely.Polygon(placed.from_patch(layout.patches[placed.patch].outline_mm))
                for placed in sheet.placements
            ]
        )
        known = {points_of(before, k) for k in range(len(before))}
        added = [path.stroke(k) for k in range(len(path)) if points_of(path, k) not in known]
        assert len(path) - len(added) == len(before)
        assert min(shapely.LineString(a).distance(solid) for a in added) >= CLEARANCE_MM
        places = np.concatenate(added)
        margin = MACHINE.bed.margin_mm
        assert places.min() >= margin
        assert (places.max(axis=0) <= [sheet.width_mm - margin, sheet.height_mm - margin]).all()
        count += len(added)
    assert count > 40


def points_of(path: Toolpath, stroke: int) -> frozenset[tuple[float, float]]:
    """The points of a stroke, whichever way it is made."""
    return frozenset(map(tuple, path.stroke(stroke).round(6).tolist()))


def test_a_check_of_a_job_knows_rim_numbers_and_the_rows(tmp_path):
    pattern = regular(9, 7)
    sheets(pattern, rim_numbers=True).write(tmp_path / "job")
    proof = check_job(tmp_path / "job")
    assert proof.valid
    assert proof.traced["rim number"] > 20
    layout = tmp_path / "job" / "layout.json"
    document = json.loads(layout.read_text())
    assert document["kit"]["rows"][0]["name"] == "C1"
    document["kit"]["rows"][0]["median_deg"] += 1.0
    layout.write_text(json.dumps(document))
    said = [finding.sentence for finding in check_job(tmp_path / "job").findings]
    assert "The rows and angles of the folder's kit are not those of the pattern." in said


def test_the_pictures_in_print_are_made_by_the_command_and_small():
    """The command draws any pattern; those on the page are all that are there."""
    made = dict(kit_pictures.pictures("hypar", regular(9, 7)))
    assert set(made) == {f"hypar-{name}.png" for name in ("folding", "rows", "collapse", "gauge")}
    assert all(content.startswith(b"\x89PNG") for content in made.values())
    page = (kit_pictures.FOLDER.parent / "folding-kit.md").read_text()
    shown = re.findall(r"\(folding-kit/([a-z-]+\.png)\)", page)
    there = {path.name: path.stat().st_size for path in kit_pictures.FOLDER.iterdir()}
    assert set(shown) == set(there)
    assert max(there.values()) <= 150_000


@pytest.mark.parametrize("name", ["hypar", "sphere"])
def test_the_ribs_of_a_jig_touch_the_shell_and_reach_nowhere_into_it(name):
    """Against points of the folded form itself, sampled at random over its facets."""
    pattern = fitted(name, 6, 6).pattern
    jig = jig_of(pattern, 3.0)
    rng = np.random.default_rng(15)
    triangles, _ = triangulate(pattern.faces_vertices, pattern.vertices_coords)
    for rib in jig.ribs:
        axis = "UV".index(rib.name[0])
        at, lowest = lower_side(jig.shell[triangles], axis, rib.place_mm)
        body = shapely.Polygon(rib.outline)
        assert body.is_valid
        assert body.bounds[1] == 0
        above = np.flatnonzero(rib.outline[:, 1] > 0)
        heights = np.interp(rib.outline[above, 0], at, lowest) - rib.outline[above, 1]
        assert heights.min() > -0.05
        assert heights.min() < 1.0
        weights = rng.dirichlet([1, 1, 1], len(triangles))
        points = np.einsum("tk,tkd->td", weights, jig.shell[triangles])
        near = points[np.abs(points[:, 1 - axis] - rib.place_mm) < 0.05]
        assert not any(body.buffer(-0.3).contains(shapely.Point(p[axis], p[2])) for p in near)
    slots = [np.ptp(rib.outline[:, 1]) for rib in jig.ribs]
    assert min(slots) >= 20.0


def test_the_ribs_of_a_jig_go_into_each_other():
    """A slot in each of two ribs that cross, and together they are as high as both are there."""
    jig = jig_of(fitted("hypar", 6, 6).pattern, 3.0)
    bodies = {rib.name: (rib, shapely.Polygon(rib.outline)) for rib in jig.ribs}
    for u in "123":
        for v in "123":
            (along, one), (across, other) = bodies[f"U{u}"], bodies[f"V{v}"]
            here, there = (
                body.intersection(shapely.LineString([(place, -1), (place, 500)])).bounds
                for body, place in ((one, across.place_mm), (other, along.place_mm))
            )
            assert here[1] == 0
            assert there[1] == pytest.approx(here[3])


def test_ribs_that_do_not_meet_have_no_slot_for_each_other():
    """A notch from the far rim: in the middle the shell ends at 0.4 of its length."""
    pattern = regular(9, 7)
    x, y = (pattern.vertices_coords / np.ptp(pattern.vertices_coords, axis=0)).T
    x, y = x - x.min() - 0.5, y - y.min()
    shell = 200 * np.column_stack([x, y * (0.4 + 1.2 * np.abs(x)), 0.1 * x * x])
    jig = jig_of(dataclasses.replace(pattern, folded_coords=shell), 3.0)
    floor = shapely.LineString([(-500, 0.01), (500, 0.01)])
    reach = {rib.name: (rib.outline[:, 0].min(), rib.outline[:, 0].max()) for rib in jig.ribs}
    along, across = ([rib for rib in jig.ribs if rib.name[0] == family] for family in "UV")
    counts = []
    for rib in across:
        parts = shapely.Polygon(rib.outline).intersection(floor)
        counts.append(shapely.get_num_geometries(parts) - 1)
        assert counts[-1] == sum(
            reach[other.name][0] < rib.place_mm < reach[other.name][1]
            and reach[rib.name][0] < other.place_mm < reach[rib.name][1]
            for other in along
        )
    assert 0 < min(counts) < max(counts) < 3


def test_a_shell_that_closes_round_has_no_jig():
    pattern = dataclasses.replace(regular(9, 7), folded_coords=None)
    with pytest.raises(OptionError, match="needs a folded form"):
        jig_of(pattern, 3.0)
    assert jig_of(pattern, None) is None
    turn = np.linspace(0, 2 * np.pi, 9, endpoint=False)
    angle = np.tile(turn, 7)
    round_ = np.stack(
        [50 * np.cos(angle), 50 * np.sin(angle), np.repeat(np.arange(7.0) * 10, 9)], axis=1
    )
    with pytest.raises(OptionError, match="closes round"):
        jig_of(dataclasses.replace(pattern, folded_coords=round_), 3.0)


def test_a_jig_is_a_file_of_the_job_and_goes_with_it(tmp_path):
    pattern = regular(9, 7)
    job = tmp_path / "job"
    sheets(pattern, jig="3mm").write(job)
    drawing = (job / "jig.svg").read_text()
    assert re.findall(r'width="([\d.]+)mm"', drawing)
    assert drawing.count("Z") == 6
    assert "jig.svg" in json.loads((job / "manifest.json").read_text())["files"]
    assert "Ribs of 3 mm board" in text_of((job / "assembly.pdf").read_bytes())[0]
    assert check_job(job).valid
    sheets(pattern).write(job)
    assert not (job / "jig.svg").exists()


def test_creases_of_caps_are_in_no_row_and_the_guide_is_made():
    """A cap is a fan of triangles, which cannot bend: its way is found by its creases alone."""
    ring = revolved("12x4", "120mm")
    pattern = capped(ring, LayoutOptions(caps="all"))
    kit = folders_kit(pattern)
    assert kit.rows == folders_kit(ring).rows
    folded = [int(np.isin(each.edges_assignment, ("M", "V")).sum()) for each in (ring, pattern)]
    of_caps = folded[1] - folded[0]
    assert kit.unnumbered == of_caps
    assert of_caps >= 4
    layout = lay_out(pattern, MACHINE, MATERIAL)
    text, _ = text_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "Kit").pdf)
    assert f"{of_caps} creases are in no row" in text


def test_a_fan_of_triangles_which_has_no_diagonal_to_bend_has_states():
    turn = np.arange(6) * np.pi / 3
    rim = np.stack([np.cos(turn), np.sin(turn)], axis=1) * 50.0
    around = np.stack([np.arange(1, 7), np.roll(np.arange(1, 7), -1)], axis=1)
    spokes = np.stack([np.zeros(6, dtype=int), np.arange(1, 7)], axis=1)
    height = np.array([0.0, 12.0, -9.0, 14.0, -12.0, 9.0, -14.0])
    fan = CreasePattern(
        np.concatenate([[[0.0, 0.0]], rim]),
        np.concatenate([spokes, around]),
        np.array(["M"] * 6 + ["B"] * 6),
        np.array([-1.0] * 6 + [0.0] * 6),
        np.column_stack([np.zeros(6, dtype=int), around]),
        folded_coords=np.column_stack([np.concatenate([[[0.0, 0.0]], rim]), height]),
    )
    states = folded_states(with_angles_of_the_folded_form(fan))
    assert states.titles[-1] == "Done"
    assert np.abs(states.shapes[-1] - fan.folded_coords).max() < 1e-9
