"""One sheet, four drawings: read back by independent readers, they hold the same strokes."""

import dataclasses
import io
import re

import ezdxf
import numpy as np
import pypdf
import pytest
import shapely
from flat_patterns import bed, miura
from problems import regular
from readers import POINT_MM, assert_same, read_dxf, read_hpgl, read_pdf, read_svg, segments
from reportlab.pdfgen.canvas import Canvas
from rings import tube
from scipy.spatial import cKDTree

from miurafab.errors import InputError
from miurafab.fabrication.assembly import assembly_order
from miurafab.fabrication.drawing.assembly_guide import assembly_guide
from miurafab.fabrication.drawing.callouts import Callout, Taken, draw_callouts
from miurafab.fabrication.drawing.dxf import VERSIONS, sheet_dxf
from miurafab.fabrication.drawing.hpgl import POINTS_A_LINE, UNITS_PER_MM, sheet_hpgl
from miurafab.fabrication.drawing.page import INK, tint
from miurafab.fabrication.drawing.page_sizes import PAGES_MM
from miurafab.fabrication.drawing.pdf import sheets_pdf
from miurafab.fabrication.drawing.sheet_pages import _clear_place
from miurafab.fabrication.drawing.svg import sheet_svg
from miurafab.fabrication.drawing.tiles import EDGE_MM, Tiling, tiled_pdf
from miurafab.fabrication.drawing.views import edge_letters
from miurafab.fabrication.options import LayoutOptions, NestingOptions
from miurafab.fabrication.sheets import lay_out
from miurafab.fabrication.toolpath import Toolpath
from miurafab.findings import Finding
from miurafab.profiles import OPERATIONS, load_machine, load_material
from miurafab.profiles.material import Crease

MACHINE, MATERIAL = load_machine("grbl-laser-400"), load_material("card-250")


LETTERS = regular(33, 23).edges_assignment


@pytest.fixture(scope="module")
def layout():
    return lay_out(regular(33, 23), MACHINE, MATERIAL)


@pytest.fixture(scope="module")
def parted():
    """A sheet of several patches on two beds, for what is told of glueing."""
    options = LayoutOptions(max_patch_mm=(80.0, 60.0))
    layout = lay_out(regular(17, 9), bed(150.0, 120.0), MATERIAL, options=options)
    assert len(layout.patches) > 2 < layout.totals.tabs
    return layout


@pytest.mark.parametrize("version", VERSIONS)
def test_dxf(layout, version):
    for toolpath in layout.toolpaths:
        text = sheet_dxf(toolpath, version, LETTERS)
        assert_same(read_dxf(text), toolpath, 1e-3)
        if version == "R2010":
            assert ezdxf.read(io.StringIO(text)).header["$INSUNITS"] == 4


def test_another_version_of_dxf_is_refused(layout):
    with pytest.raises(ValueError, match=r"must be one of .*R12.*R2010.*, not 'R14'"):
        sheet_dxf(layout.toolpaths[0], "R14", LETTERS)


def test_svg(layout):
    for toolpath in layout.toolpaths:
        assert_same(read_svg(sheet_svg(toolpath, LETTERS), toolpath.height_mm), toolpath, 1e-3)


def test_pdf(layout):
    written = sheets_pdf(layout.toolpaths, "test", LETTERS)
    assert b"ASCII85Decode" not in written, "text takes a quarter more room"
    sheets = read_pdf(written)
    assert len(sheets) == len(layout.toolpaths)
    for (size, found), toolpath in zip(sheets, layout.toolpaths, strict=True):
        assert size == pytest.approx((toolpath.width_mm, toolpath.height_mm), abs=1e-3)
        assert_same(found, toolpath, 1e-3)


def test_hpgl(layout):
    for toolpath in layout.toolpaths:
        text = sheet_hpgl(toolpath, LETTERS)
        found = read_hpgl(text)
        assert_same(found, toolpath, 0.5 / UNITS_PER_MM + 1e-9)
        assert np.diff(toolpath.offsets).max() > POINTS_A_LINE + 1, "an outline longer than a line"
        assert max(map(len, text.splitlines())) < 500


@pytest.mark.parametrize("page", ["a6", "a4", "letter"])
def test_tiles_joined_by_their_crosses_are_the_sheet(layout, page):
    """Every page is laid onto the sheet by the crosses that it shares with those laid before."""
    toolpath = layout.toolpaths[0]
    letters = edge_letters(layout, regular(33, 23))
    guide = tiled_pdf((toolpath,), letters, "test", Tiling(page=page))
    reader = pypdf.PdfReader(io.BytesIO(guide))
    first, *tiles = reader.pages
    sides = sorted(float(side) * POINT_MM for side in first.mediabox[2:])
    assert sides == pytest.approx(sorted(PAGES_MM[page]), abs=1e-3)
    laid, known, waiting = [], {}, list(tiles)
    while waiting:
        for tile in waiting:
            crosses, pieces = read_tile(tile, reader)
            shared = set(crosses) & set(known)
            if known and not shared:
                continue
            moves = np.array([known[n] - crosses[n] for n in shared] or [np.zeros(2)])
            assert np.abs(moves - moves[0]).max() < 1e-3
            known |= {n: at + moves[0] for n, at in crosses.items()}
            laid.append((tile.extract_text(), moves[0], pieces))
            waiting.remove(tile)
            break
        else:
            raise AssertionError("a page shares no cross with the others")
    origin = next(move for words, move, _ in laid if re.search(r"^A1$", words, re.MULTILINE))
    low = np.tile(toolpath.points.min(axis=0) - EDGE_MM, 2)
    perforate = OPERATIONS.index("perforate")
    pieces = segments(toolpath)
    folds = whole_folds(toolpath, toolpath.operation == perforate)
    solid = [ends for edge, ends in folds if letters[edge] == "M"]
    wanted = np.concatenate([pieces[pieces[:, 0] != perforate][:, 1:], solid]) - low
    drawn = np.concatenate([p + np.tile(move - origin, 2) for _, move, p in laid])
    drawn -= np.tile(Tiling().margin_mm, 4)
    for ends in (wanted, wanted[:, [2, 3, 0, 1]]):
        gap, _ = cKDTree(np.concatenate([drawn, drawn[:, [2, 3, 0, 1]]])).query(ends, p=np.inf)
        assert gap.max() < 1e-3
    # Of a dashed valley both ends are drawn.
    tips = np.array([ends for edge, ends in folds if letters[edge] == "V"]) - low
    gap, _ = cKDTree(drawn.reshape(-1, 2)).query(tips.reshape(-1, 2), p=np.inf)
    assert gap.max() < 1e-3


def whole_folds(toolpath, creases):
    """The pattern edge of each crease among ``creases`` (S,), and both its ends as drawn."""
    found = {}
    for k in np.flatnonzero(creases).tolist():
        key = int(toolpath.patch[k]), int(toolpath.edge[k])
        first = found.get(key, toolpath.starts[k].tolist())[:2]
        found[key] = [*first, *toolpath.ends[k].tolist()]
    return [(edge, ends) for (_, edge), ends in found.items()]


def read_tile(page, reader):
    """The crosses of a tile by number, and its straight pieces (n, 4), in mm on the page."""
    content = pypdf.generic.ContentStream(page.get_contents(), reader)
    move, stack, lines, at, words = np.zeros(2), [], [], None, {}
    text_at = np.zeros(2)
    for operands, operator in content.operations:
        numbers = [float(o) for o in operands if isinstance(o, int | float)]
        if operator == b"q":
            stack.append(move)
        elif operator == b"Q":
            move = stack.pop()
        elif operator == b"cm":
            assert numbers[:4] == [1, 0, 0, 1], "true to scale"
            move = move + numbers[4:]
        elif operator in (b"m", b"l"):
            point = move + numbers
            if operator == b"l":
                lines.append((*at, *point))
            at = point
        elif operator == b"Tm":
            text_at = move + numbers[4:]
        elif operator == b"Tj" and str(operands[0]).isdigit():
            words[int(operands[0])] = text_at * POINT_MM
    lines = np.array(lines) * POINT_MM
    middle = (lines[:, :2] + lines[:, 2:]) / 2
    size = np.abs(lines[:, :2] - lines[:, 2:])
    flat = (np.abs(size - [8.0, 0.0]) < 1e-3).all(axis=1)
    crosses = {}
    for number, place in words.items():
        off = np.linalg.norm(middle[flat] - (place - [1.2, 2.2]), axis=1)
        assert off.min() < 1e-2
        crosses[number] = middle[flat][off.argmin()]
    return crosses, lines


def test_tiles_begin_where_the_drawing_does():
    """What fits one page is on one page, wherever it lies on its sheet."""
    path = lay_out(regular(9, 9), MACHINE, MATERIAL).toolpaths[0]
    moved = dataclasses.replace(path, points=path.points + np.array([150.0, 250.0]))
    letters = regular(9, 9).edges_assignment
    for each in (path, moved):
        reader = pypdf.PdfReader(io.BytesIO(tiled_pdf((each,), letters, "one", Tiling())))
        assert len(reader.pages) == 2


def test_blank_tiles_are_not_printed():
    pattern = regular(9, 9)
    layout = lay_out(pattern, MACHINE, MATERIAL)
    tiled = tiled_pdf(layout.toolpaths, edge_letters(layout, pattern), "one", Tiling())
    pages = pages_of(tiled)
    assert "on 1 page, 1 column by 1 row" in pages[0]
    assert len(pages) == 2


def test_a_tile_without_strokes_is_pale_in_the_overview():
    ends = np.array([[0, 0], [9, 9], [200, 200], [209, 209]], dtype=float)
    path = Toolpath("one", 400.0, 400.0, ends, np.array([0, 2, 4]), *np.zeros((3, 2), int))
    tiles = tiled_pdf((path,), np.array(["B"]), "t", Tiling("150x150mm"))
    pages = pages_of(tiles)
    assert "on 2 pages, 2 columns by 2 rows" in pages[0]
    assert len(pages) == 3
    content = pypdf.PdfReader(io.BytesIO(tiles)).pages[0].get_contents().get_data()
    assert len(re.findall(rb" re f\*?\s", content)) == 2


def test_no_page_is_a_sliver_and_none_repeats_its_neighbours():
    """A drawing just larger than a page is on two halves; a stroke in a strip alone asks for no
    page of its own."""
    letters = np.array(["B"])
    across = np.array([[0.0, 0.0], [200.0, 0.0], [0.0, 30.0], [200.0, 30.0]])
    path = Toolpath("one", 400.0, 400.0, across, np.array([0, 2, 4]), *np.zeros((3, 2), int))
    guide = pypdf.PdfReader(io.BytesIO(tiled_pdf((path,), letters, "t", Tiling("150x60mm"))))
    frames = [frame_of(page, guide) for page in guide.pages[1:]]
    # 200 mm and 2 mm at each end, on two pages with a strip of 10 mm in common.
    assert frames == [pytest.approx((107.0, 34.0), abs=1e-3)] * 2
    # Three strokes, one of which lies in the middle strip: its half belongs to a page already.
    ends = np.array([[0, 0], [30, 0], [0, 200], [1, 200], [105, 0], [106, 0]], dtype=float)
    offsets = np.array([0, 2, 4, 6])
    path = Toolpath("one", 400.0, 400.0, ends, offsets, *np.zeros((3, 3), int))
    tiles = tiled_pdf((path,), letters, "t", Tiling("150x150mm"))
    assert len(pages_of(tiles)) - 1 == 2


def frame_of(page, reader):
    """Width and height of the frame around a tile, mm: the last rectangle of its page."""
    content = pypdf.generic.ContentStream(page.get_contents(), reader)
    *_, last = (operands for operands, operator in content.operations if operator == b"re")
    return tuple(float(side) * POINT_MM for side in last[2:])


@pytest.mark.parametrize("name", ["dxf", "dxf-r2010"])
def test_drawings_say_that_they_are_in_mm(layout, name):
    version = {"dxf": "R12", "dxf-r2010": "R2010"}[name]
    text = sheet_dxf(layout.toolpaths[0], version)
    assert ezdxf.read(io.StringIO(text)).header["$INSUNITS"] == 4
    assert re.search(r"\$INSUNITS\n *70\n *4\n", text)


def test_a_page_that_cannot_be_is_refused(layout):
    letters = edge_letters(layout, regular(33, 23))
    with pytest.raises(InputError, match="'a9'"):
        tiled_pdf(layout.toolpaths, letters, "test", Tiling(page="a9"))
    for measure in ("20x300mm", "200x", "200x300x400"):
        with pytest.raises(InputError, match=r"nor a measure .* such as 200x300mm"):
            tiled_pdf(layout.toolpaths, letters, "test", Tiling(page=measure))
    with pytest.raises(InputError, match="no room"):
        tiled_pdf(layout.toolpaths, letters, "test", Tiling(margin_mm=120))


def pages_of(guide):
    return [page.extract_text() for page in pypdf.PdfReader(io.BytesIO(guide)).pages]


def labels_in(text):
    """All labels of tabs that a text names, runs of them written out."""
    found = []
    for words in re.findall(r"^Tabs? ([a-z0-9, -]+)$", text, re.MULTILINE):
        for run in words.split(","):
            first, _, last = run.strip().partition("-")
            letter = first.rstrip("0123456789")
            ends = (int(label.removeprefix(letter)) for label in (first, last or first))
            low, high = ends
            found += [f"{letter}{number}" for number in range(low, high + 1)]
    return sorted(found)


def labels_of(layout):
    return sorted({tab.label for patch in layout.patches for tab in patch.tabs})


def test_the_guide_names_every_patch_and_tab(parted):
    layout, pattern = parted, regular(17, 9)
    pages = pages_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "Test").pdf)
    overview = pages[0]
    for patch in layout.patches:
        # The rim of white about a name is a text, too.
        assert len(re.findall(rf"^{patch.label}$", overview, re.MULTILINE)) == 2
    assert MATERIAL.title in overview
    assert MACHINE.title in overview
    for sheet in layout.sheets:
        text = next(page for page in pages if page.startswith(f"Test: {sheet.name}"))
        for placed in sheet.placements:
            assert layout.patches[placed.patch].label in text
    last = pages[len(layout.sheets) + 1 :]
    assert last[0].startswith("Test: folding")
    # Each tab is glued in one step.
    labels = sorted(label for page in last for label in labels_in(page))
    assert labels == labels_of(layout)
    assert len(labels) == layout.totals.tabs
    assert all(f"{k} of {len(pages)}" in page for k, page in enumerate(pages, start=1))


def test_the_guide_to_a_ring_closes_it_last():
    pattern = tube()
    layout = lay_out(pattern, MACHINE, MATERIAL)
    *_, last = pages_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "Tube").pdf)
    steps = re.findall(r"^(Begin with P1|Close the ring)$", last, re.MULTILINE)
    assert steps == ["Begin with P1", "Close the ring"]
    assert labels_in(last) == labels_of(layout)


def test_the_guide_to_one_patch_says_nothing_of_glue():
    pattern = regular(9, 9)
    layout = lay_out(pattern, MACHINE, MATERIAL)
    pages = pages_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "One").pdf)
    assert not any(re.search("glue|tab", page, re.IGNORECASE) for page in pages[2:])


def test_the_guide_says_what_could_not_be_had():
    pattern = regular(9, 9)
    layout = lay_out(pattern, MACHINE, MATERIAL)
    findings = (
        Finding("untabbed", "2 seam edges bear no tab: use tape there.", (3, 7)),
        Finding("unlettered", "5 names and numbers found no room. Lay out with `quantity`."),
    )
    layout = dataclasses.replace(layout, findings=findings)
    assert layout.untabbed == (3, 7)
    text = "\n".join(pages_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "Test").pdf))
    assert "2 seam edges bear no tab: use tape there." in text
    assert "5 names and numbers found no room. Lay out with 'quantity'." in text


def test_the_guide_tells_how_both_sides_are_made():
    pattern = regular(9, 9)
    creases = {"mountain": Crease(), "valley": Crease("score"), "tab": Crease()}
    material = dataclasses.replace(MATERIAL, creases=creases)
    layout = lay_out(pattern, MACHINE, material, options=LayoutOptions(two_sided=True))
    pages = pages_of(assembly_guide(layout, pattern, MACHINE, material, "Both").pdf)
    assert "valley: scored" in pages[0]
    near, far = MACHINE.bed.margin_mm / 2, layout.sheets[0].width_mm - MACHINE.bed.margin_mm / 2
    words = pages[1].replace("\n", " ")
    assert f"holes lie at X{near:.1f} Y{near:.1f}, X{near:.1f} Y" in words
    assert f"and X{far:.1f} Y{near:.1f}; then run sheet-01." in words
    scored = sum(back.length_of("score") for back in layout.backs) / 1000
    assert scored > 0
    assert f"{scored:.2f} m scored" in words


def test_the_guide_to_a_pattern_without_a_folded_form_shows_the_seams_on_the_flat_one(parted):
    """A drawing of others may have none: each step of glueing is a map of the flat sheet."""
    pattern = dataclasses.replace(regular(17, 9), folded_coords=None)
    pages = pages_of(assembly_guide(parted, pattern, MACHINE, MATERIAL, "Test").pdf)
    glue = "\n".join(pages[len(parted.sheets) + 1 :])
    assert labels_in(glue) == labels_of(parted)
    assert "Begin with" in glue
    assert "Below each step is its seam, larger" not in glue


def test_the_guide_to_patches_without_tabs_tells_where_tape_goes():
    pattern = regular(17, 9)
    options = LayoutOptions(max_patch_mm=(120.0, 90.0), tab_inset_mm=20.0)
    layout = lay_out(pattern, MACHINE, MATERIAL, options=options)
    assert layout.totals.tabs == 0
    text = "\n".join(pages_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "Bare").pdf))
    assert text.count("No tabs: use tape on the seam") == len(layout.patches) - 1
    assert "Where tab a7 goes" not in text


def test_the_guide_tells_the_fibres_of_each_sheet_and_which_back_is_its_own(tmp_path):
    (tmp_path / "stock.toml").write_text(
        "[[sheets]]\nname = 'card'\nwidth = 90\nheight = 80\nquantity = 9\ngrain = 'y'\n"
        "[[sheets.defects]]\nx = 0\ny = 0\nwidth = 12\nheight = 3\n"
    )
    creases = {"mountain": Crease(), "valley": Crease("score"), "tab": Crease()}
    material = dataclasses.replace(MATERIAL, creases=creases)
    options = LayoutOptions(
        two_sided=True,
        nesting=NestingOptions(stock=tmp_path / "stock.toml"),
    )
    pattern = miura(6, 5)
    layout = lay_out(pattern, MACHINE, material, options=options)
    assert len(layout.backs) == len(layout.sheets) > 1
    pages = pages_of(assembly_guide(layout, pattern, MACHINE, material, "Both").pdf)
    for sheet in layout.sheets:
        assert sheet.defects_mm
        page = next(page for page in pages if page.startswith(f"Both: {sheet.name}"))
        assert f"from 'card', fibres along the bed's {sheet.grain}" in page.replace("\n", " ")
        assert f"First run {sheet.back}. Turn the sheet over" in page.replace("\n", " ")


def test_power_is_told_for_lasers_alone():
    pattern = regular(9, 9)
    pen = load_machine("grbl-pen-a4")
    for machine, powered in ((MACHINE, True), (pen, False)):
        layout = lay_out(pattern, machine, MATERIAL)
        text = pages_of(assembly_guide(layout, pattern, machine, MATERIAL, "One").pdf)[0]
        feed = f"{MATERIAL.on(machine).operations['cut'].feed_mm_min:g} mm/min"
        assert (f"8 W (80%), {feed}" in text) == powered
        assert feed in text


def test_the_name_of_a_patch_does_not_hide_what_is_engraved():
    strokes = np.array([[0.0, 0.0], [2.0, 1.0]])
    places = np.array([[0.0, 0.0], [-30.0, 0.0], [0.0, 8.0], [0.0, 12.0]])
    assert _clear_place(places, strokes, "P1", 16.0).tolist() == [0.0, 8.0]
    assert _clear_place(places[:1], strokes, "P1", 16.0).tolist() == [0.0, 0.0]
    assert _clear_place(places, np.empty((0, 2)), "P1", 16.0).tolist() == [0.0, 0.0]


def test_copies_have_one_guide():
    pattern = tube()
    options = LayoutOptions(max_patch_mm=(120.0, 60.0), nesting=NestingOptions(quantity=2))
    layout = lay_out(pattern, MACHINE, MATERIAL, options=options)
    pages = pages_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "Two").pdf)
    assert "2 copies" in pages[0]
    glue = "\n".join(page for page in pages if re.search("^Glueing|: glueing", page, re.MULTILINE))
    assert labels_in(glue) == labels_of(layout)
    assert layout.totals.tabs == 2 * len(labels_in(glue))
    for patch in layout.patches:
        assert any(patch.label in page for page in pages)


@pytest.mark.parametrize("number", range(60))
def test_patches_side_by_side_have_colours_that_differ(number):
    """And dark type stands out on all of them (WCAG 2.2: contrast of 7 at least)."""

    def light(colour):
        parts = [
            c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
            for c in (colour.red, colour.green, colour.blue)
        ]
        return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]

    assert (light(tint(number)) + 0.05) / (light(INK) + 0.05) > 7
    for other in range(number + 1, number + 4):
        one, another = tint(number), tint(other)
        apart = np.subtract(one.rgb(), another.rgb())
        assert np.abs(apart).max() > 0.1


def test_each_patch_is_glued_onto_what_is_assembled(parted):
    layout, steps = parted, assembly_order(parted, regular(17, 9))
    assert sorted(step.patch for step in steps) == list(range(len(layout.patches)))
    done = set()
    for step in steps:
        assert set(step.onto) <= done
        assert bool(step.onto) == bool(done), "a regular sheet is one piece"
        done.add(step.patch)
    numbers = sorted(n for step in steps for n in step.tabs)
    assert numbers == sorted(tab.number for patch in layout.patches for tab in patch.tabs)


def test_labels_on_leader_lines_cover_neither_each_other_nor_the_patch():
    patch = np.array([[50.0, 50.0], [110.0, 50.0], [110.0, 60.0], [50.0, 60.0]])
    labels = [Callout(f"a{k}M", 52.0 + 2.0 * k, 51.0, 0.0, 0.0) for k in range(28)]
    taken = Taken()
    draw_callouts(Canvas(io.BytesIO()), labels, [patch], taken)
    boxes = shapely.box(*np.array(taken.boxes).T)
    assert len(boxes) == len(labels)
    assert not any(boxes[k].intersects(boxes[k + 1 :]).any() for k in range(len(boxes)))
    assert not shapely.intersects(shapely.Polygon(patch), boxes).any()
