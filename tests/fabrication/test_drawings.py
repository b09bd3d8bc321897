"""One sheet, four drawings: read back by independent readers, they hold the same strokes."""

import dataclasses
import io
import re
from itertools import pairwise

import ezdxf
import numpy as np
import pypdf
import pytest
import svgelements
from problems import regular
from rings import tube
from scipy.spatial import cKDTree

from miurafab.errors import InputError
from miurafab.fabrication.assembly import assembly_order
from miurafab.fabrication.drawing.assembly_guide import assembly_guide
from miurafab.fabrication.drawing.dxf import VERSIONS, sheet_dxf
from miurafab.fabrication.drawing.hpgl import UNITS_PER_MM, sheet_hpgl
from miurafab.fabrication.drawing.page import INK, tint
from miurafab.fabrication.drawing.pdf import sheets_pdf
from miurafab.fabrication.drawing.svg import COLOURS, sheet_svg
from miurafab.fabrication.drawing.tiles import PAGES_MM, Tiling, tiled_pdf
from miurafab.fabrication.drawing.views import edge_letters
from miurafab.fabrication.options import LayoutOptions, NestingOptions
from miurafab.fabrication.sheets import lay_out
from miurafab.profiles import OPERATIONS, load_machine, load_material

MACHINE, MATERIAL = load_machine("grbl-laser-400"), load_material("card-250")
POINT_MM = 25.4 / 72


@pytest.fixture(scope="module")
def layout():
    return lay_out(regular(61, 41), MACHINE, MATERIAL)


def segments(toolpath):
    """(n, 5) straight pieces: operation, then both ends."""
    return np.array(
        [
            (operation, *a, *b)
            for index, operation in enumerate(toolpath.operation.tolist())
            for a, b in pairwise(toolpath.stroke(index).tolist())
        ]
    )


def assert_same(found, toolpath, within):
    """The pieces ``found`` are those of ``toolpath``, one to one, whatever their direction."""
    wanted, found = segments(toolpath), np.array(found)
    for operation in range(len(OPERATIONS)):
        ours = wanted[wanted[:, 0] == operation][:, 1:]
        theirs = found[found[:, 0] == operation][:, 1:]
        assert len(ours) == len(theirs)
        if len(ours):
            both = np.concatenate([theirs, theirs[:, [2, 3, 0, 1]]])
            gap, taken = cKDTree(both).query(ours, p=np.inf)
            assert gap.max() <= within
            assert len(set((taken % len(theirs)).tolist())) == len(ours), "drawn twice"


@pytest.mark.parametrize("version", VERSIONS)
def test_dxf(layout, version):
    for toolpath in layout.toolpaths:
        document = ezdxf.read(io.StringIO(sheet_dxf(toolpath, version)))
        assert not document.audit().has_errors
        found = []
        for entity in document.modelspace():
            operation = OPERATIONS.index(entity.dxf.layer)
            if entity.dxftype() == "LINE":
                start, end = entity.dxf.start, entity.dxf.end
                found.append((operation, start.x, start.y, end.x, end.y))
            else:
                points = [tuple(p) for p in entity.get_points("xy")]
                points += points[:1] if entity.closed else []
                found += [(operation, *a, *b) for a, b in pairwise(points)]
        assert_same(found, toolpath, 1e-3)
        if version == "R2010":
            assert document.header["$INSUNITS"] == 4


def test_svg(layout):
    """svgelements converts to pixels at 96 dpi; that it comes back to mm proves the real size."""
    operation_of = {colour.lower(): OPERATIONS.index(name) for name, colour in COLOURS.items()}
    for toolpath in layout.toolpaths:
        document = svgelements.SVG.parse(io.StringIO(sheet_svg(toolpath)))
        found = []
        for path in document.elements(lambda e: isinstance(e, svgelements.Path)):
            operation = operation_of[path.stroke.hexrgb or path.stroke.hex]
            for piece in path:
                if isinstance(piece, svgelements.Line | svgelements.Close) and piece.start:
                    ends = [
                        (p.x * 25.4 / 96, toolpath.height_mm - p.y * 25.4 / 96)
                        for p in (piece.start, piece.end)
                    ]
                    if np.hypot(*np.subtract(*ends)) > 1e-6:
                        found.append((operation, *ends[0], *ends[1]))
        assert_same(found, toolpath, 1e-3)


def test_pdf(layout):
    reader = pypdf.PdfReader(io.BytesIO(sheets_pdf(layout.toolpaths, "test")))
    assert len(reader.pages) == len(layout.toolpaths)
    for page, toolpath in zip(reader.pages, layout.toolpaths, strict=True):
        width, height = float(page.mediabox.width), float(page.mediabox.height)
        assert width * POINT_MM == pytest.approx(toolpath.width_mm, abs=1e-3)
        assert height * POINT_MM == pytest.approx(toolpath.height_mm, abs=1e-3)
        assert_same(list(_pdf_segments(page, reader)), toolpath, 1e-3)


def _pdf_segments(page, reader):
    by_colour = {
        tuple(round(int(value[k : k + 2], 16) / 255, 3) for k in (1, 3, 5)): name
        for name, value in COLOURS.items()
    }
    content = pypdf.generic.ContentStream(page.get_contents(), reader)
    operation, pieces, start, at = None, [], None, None
    for operands, operator in content.operations:
        numbers = [float(o) for o in operands if isinstance(o, int | float)]
        if operator == b"RG":
            operation = OPERATIONS.index(by_colour[tuple(round(n, 3) for n in numbers)])
        elif operator == b"m":
            start = at = numbers
        elif operator == b"l":
            pieces.append((*at, *numbers))
            at = numbers
        elif operator == b"h":
            pieces.append((*at, *start))
            at = start
        elif operator in (b"S", b"s"):
            for piece in pieces:
                yield (operation, *(n * POINT_MM for n in piece))
            pieces = []


def test_hpgl(layout):
    for toolpath in layout.toolpaths:
        text = sheet_hpgl(toolpath)
        assert text.startswith("IN;")
        assert text.rstrip().endswith("SP0;")
        found, pen, at = [], None, (0, 0)
        for word in re.findall(r"([A-Z]{2})([\d,]*);", text):
            numbers = [int(n) for n in word[1].split(",") if n]
            points = list(zip(numbers[::2], numbers[1::2], strict=False))
            if word[0] == "SP":
                pen = numbers[0]
            elif word[0] == "PD":
                for point in points:
                    found.append((pen - 1, *at, *point))
                    at = point
            elif word[0] == "PU" and points:
                at = points[-1]
        found = [(o, *(n / UNITS_PER_MM for n in rest)) for o, *rest in found]
        assert_same(found, toolpath, 0.5 / UNITS_PER_MM + 1e-9)


@pytest.mark.parametrize("page", PAGES_MM)
def test_tiles_joined_by_their_crosses_are_the_sheet(layout, page):
    """Every page is laid onto the sheet by the crosses that it shares with those laid before."""
    toolpath = layout.toolpaths[0]
    letters = edge_letters(layout, regular(61, 41))
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
    wanted = segments(toolpath)[:, 1:]
    drawn = np.concatenate([p + np.tile(move - origin, 2) for _, move, p in laid])
    drawn -= np.tile(Tiling().margin_mm, 4)
    for ends in (wanted, wanted[:, [2, 3, 0, 1]]):
        gap, _ = cKDTree(np.concatenate([drawn, drawn[:, [2, 3, 0, 1]]])).query(ends, p=np.inf)
        assert gap.max() < 1e-3


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


def test_blank_tiles_are_not_printed():
    pattern = regular(9, 9)
    layout = lay_out(pattern, MACHINE, MATERIAL)
    tiled = tiled_pdf(layout.toolpaths, edge_letters(layout, pattern), "one", Tiling())
    pages = pages_of(tiled)
    assert "on 1 page," in pages[0]
    assert len(pages) == 2


def test_a_page_that_cannot_be_is_refused(layout):
    letters = edge_letters(layout, regular(61, 41))
    with pytest.raises(InputError, match="'a9'"):
        tiled_pdf(layout.toolpaths, letters, "test", Tiling(page="a9"))
    with pytest.raises(InputError, match="no room"):
        tiled_pdf(layout.toolpaths, letters, "test", Tiling(margin_mm=120))


def pages_of(guide):
    return [page.extract_text() for page in pypdf.PdfReader(io.BytesIO(guide)).pages]


def numbers_in(text):
    """All numbers that a text names, runs of them written out."""
    found = []
    for words in re.findall(r"^Tabs? ([\d, -]+)$", text, re.MULTILINE):
        for run in words.split(","):
            first, _, last = run.strip().partition("-")
            found += range(int(first), int(last or first) + 1)
    return found


def test_the_guide_names_every_patch_and_tab(layout):
    pattern = regular(61, 41)
    guide = assembly_guide(layout, pattern, MACHINE, MATERIAL, "Test")
    assert guide == assembly_guide(layout, pattern, MACHINE, MATERIAL, "Test")
    pages = pages_of(guide)
    overview = pages[0]
    for patch in layout.patches:
        # The rim of white about a name is a text, too.
        assert re.search(rf"^{patch.label}{patch.label}$", overview, re.MULTILINE)
    assert MATERIAL.title in overview
    assert MACHINE.title in overview
    for sheet in layout.sheets:
        text = next(page for page in pages if page.startswith(f"Test: {sheet.name}"))
        for placed in sheet.placements:
            assert layout.patches[placed.patch].label in text
    last = pages[len(layout.sheets) + 1 :]
    assert last[0].startswith("Test: folding and glueing")
    # Each tab is glued in one step.
    numbers = sorted(n for page in last for n in numbers_in(page))
    assert numbers == list(range(1, layout.totals.tabs + 1))
    assert all(f"{k} of {len(pages)}" in page for k, page in enumerate(pages, start=1))


def test_the_guide_to_a_ring_closes_it_last():
    pattern = tube()
    layout = lay_out(pattern, MACHINE, MATERIAL)
    *_, last = pages_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "Tube"))
    steps = re.findall(r"^(Begin with P1|Close the ring)$", last, re.MULTILINE)
    assert steps == ["Begin with P1", "Close the ring"]
    assert numbers_in(last) == list(range(1, layout.totals.tabs + 1))


def test_the_guide_to_one_patch_says_nothing_of_glue():
    pattern = regular(9, 9)
    layout = lay_out(pattern, MACHINE, MATERIAL)
    pages = pages_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "One"))
    assert len(pages) == 3
    assert not any(re.search("glue", page, re.IGNORECASE) for page in pages[2:])


def test_the_guide_says_what_could_not_be_had():
    pattern = regular(61, 41)
    layout = lay_out(pattern, MACHINE, MATERIAL)
    layout = dataclasses.replace(layout, untabbed=(3, 7), unlettered=5, remarks=("Mind the gap.",))
    text = "\n".join(pages_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "Test")))
    assert "2 seam edges bear no tab: use tape there." in text
    assert "5 names and numbers found no room" in text
    assert "Mind the gap." in text


def test_copies_have_one_guide():
    pattern = tube()
    options = LayoutOptions(max_patch_mm=(120.0, 60.0), nesting=NestingOptions(quantity=2))
    layout = lay_out(pattern, MACHINE, MATERIAL, options=options)
    pages = pages_of(assembly_guide(layout, pattern, MACHINE, MATERIAL, "Two"))
    assert "2 copies" in pages[0]
    glue = "\n".join(page for page in pages if re.match("Two: .*glueing", page))
    tabs = layout.totals.tabs
    assert sorted(numbers_in(glue)) == list(
        range(1, max(tab.number for patch in layout.patches for tab in patch.tabs) + 1)
    )
    assert tabs in (max(numbers_in(glue)), 2 * max(numbers_in(glue)))
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


def test_each_patch_is_glued_onto_what_is_assembled(layout):
    steps = assembly_order(layout, regular(61, 41))
    assert sorted(step.patch for step in steps) == list(range(len(layout.patches)))
    done = set()
    for step in steps:
        assert set(step.onto) <= done
        assert bool(step.onto) == bool(done), "a regular sheet is one piece"
        done.add(step.patch)
    numbers = sorted(n for step in steps for n in step.tabs)
    assert numbers == sorted(tab.number for patch in layout.patches for tab in patch.tabs)
