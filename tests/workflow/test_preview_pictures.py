"""The pictures, read back: pixels where strokes are, and an SVG path that is the strokes."""

import io
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from small_jobs import CARD, KNOWN, LASER, dashes, known_toolpath, write_folder, write_nc

from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.posting import post
from miurafab.workflow.dry_run import LAYERS, dry_run
from miurafab.workflow.picture import (
    LEFT,
    PIXELS,
    TOP,
    png_bytes,
    svg_text,
    write_pictures,
)
from miurafab.workflow.preview import preview

SVG = "{http://www.w3.org/2000/svg}"
COLOURS = {layer.name: layer.colour for layer in LAYERS}
PIXELS_A_MM = PIXELS / 400
CORNER = (LEFT * PIXELS / 100, TOP * PIXELS / 100)
"""The pixel of the bed's upper left corner."""


def picture(sheet, machine):
    return Image.open(io.BytesIO(png_bytes(sheet, machine))).convert("RGB")


def pixel(image, x, y):
    """The colour, #rrggbb, at a point in mm of a 400 mm bed."""
    column = int(CORNER[0] + x * PIXELS_A_MM)
    row = int(CORNER[1] + (400 - y) * PIXELS_A_MM)
    return "#{:02x}{:02x}{:02x}".format(*image.getpixel((column, row)))


def known_sheet(tmp_path):
    return preview(write_nc(tmp_path, known_toolpath())).sheets[0]


def test_each_stroke_has_the_colour_of_its_operation(tmp_path):
    image = picture(known_sheet(tmp_path), LASER)
    seen = set()
    for name, points in KNOWN.items():
        if name != "engrave":
            middle = np.mean(points[:2], axis=0)
            assert pixel(image, *middle) == COLOURS[name]
            seen.add(COLOURS[name])
    assert len(seen) == 3
    assert pixel(image, 300, 300) == "#ffffff"


def test_travels_are_dashed_and_gaps_stay_open(tmp_path):
    image = picture(known_sheet(tmp_path), LASER)
    # the way back from (100, 140) to the origin, in steps of a third of a pixel
    along = np.linspace(0.2, 0.6, 1000)[:, None] * np.array([100.0, 140.0])
    grey = np.array([pixel(image, x, y) != "#ffffff" for x, y in along])
    assert 0.4 < grey.mean() < 0.95
    assert (np.diff(grey.astype(int)) == 1).sum() > 10
    dashed = Job("a.nc", "G21 G90\nM4 S9 F99\n" + "".join(
        f"G0 X{x} Y200\nG1 X{x + 2.4}\n" for x in range(100, 200, 4)
    ) + "M5\nM2\n")  # fmt: skip
    row = picture(dry_run("a", dashed, LASER, (400, 400)), LASER)
    burnt = [pixel(row, x, 200) for x in np.arange(109.2, 185, 4)]
    left = [pixel(row, x, 200) for x in np.arange(111.2, 185, 4)]
    assert set(burnt) == {COLOURS["burn"]}
    assert set(left) == {"#ffffff"}


def test_both_pictures_of_every_sheet_are_written_and_the_same_again(tmp_path):
    seen = preview(write_folder(tmp_path / "job"))
    (tmp_path / "out").mkdir()
    files = write_pictures(seen, tmp_path / "out")
    assert [file.name for file in files] == [
        *("sheet-01.png", "sheet-01.svg", "sheet-02.png", "sheet-02.svg")
    ]
    before = [file.read_bytes() for file in files]
    assert [file.read_bytes() for file in write_pictures(seen, tmp_path / "out")] == before
    with Image.open(files[0]) as image:
        assert min(image.size) > 1200


def path_points(data):
    """The (start, end) pairs of an SVG path of M and L."""
    moves, at = [], None
    for letter, x, y in re.findall(r"([ML])([-\d.e]+) ([-\d.e]+)", data):
        to = (float(x), float(y))
        if letter == "L":
            moves.append((at, to))
        at = to
    return np.array(moves).reshape(-1, 2, 2)


@pytest.mark.parametrize("toolpath", [known_toolpath(), dashes(400)], ids=["known", "dashes"])
def test_the_svg_holds_every_move_once(tmp_path, toolpath):
    sheet = preview(write_nc(tmp_path, toolpath)).sheets[0]
    root = ET.fromstring(svg_text(sheet, LASER))
    assert root.tag == f"{SVG}svg"
    found = {path.get("id"): path for path in root.iter(f"{SVG}path") if path.get("id")}
    start, end = sheet.program.start[:, :2], sheet.program.end[:, :2]
    for index, layer in enumerate(LAYERS):
        moves = np.stack([start, end], axis=1)[sheet.layer == index]
        if not len(moves):
            assert layer.name not in found
            continue
        path = found[layer.name]
        assert np.abs(path_points(path.get("d")) - moves).max() <= 1e-3
        assert path.get("stroke") == layer.colour
        assert (path.get("stroke-dasharray") is not None) == (layer.name == "travel")


def test_a_name_cannot_break_the_svg():
    sheet = dry_run("a<b>&", Job("a<b>&.nc", "G0 X1\n"), LASER, (400, 400))
    texts = [text.text for text in ET.fromstring(svg_text(sheet, LASER)).iter(f"{SVG}text")]
    assert texts[0] == "a<b>&.nc"


@pytest.mark.parametrize("text", ["M5\nM2\n", "G0 X5\nM5\n", "M4 S0\nG1 X-50 Y900 F100\nM5\n"])
def test_odd_programs_have_pictures_too(text):
    sheet = dry_run("odd", Job("odd.nc", text), LASER, (400, 400))
    assert picture(sheet, LASER).size[0] > 600
    ET.fromstring(svg_text(sheet, LASER))


def test_a_long_narrow_bed_has_a_picture():
    machine = replace(LASER, bed=replace(LASER.bed, width_mm=3000.0, height_mm=100.0))
    sheet = dry_run("long", Job("long.nc", "M4 S9\nG1 X2900 F100\nM5\n"), machine, (3000, 100))
    width, height = picture(sheet, machine).size
    assert width > 2 * height


@pytest.mark.large
def test_a_hundred_thousand_dashes(tmp_path):
    program = parse_program(post(dashes(100_000), LASER, CARD))
    small = preview(write_nc(tmp_path, dashes(10))).sheets[0]
    sheet = replace(small, program=program, layer=np.where(program.beam_on, 3, 0))
    assert pixel(picture(sheet, LASER), 7, 6) != "#ffffff"
    assert svg_text(sheet, LASER).count("M") > 100_000
