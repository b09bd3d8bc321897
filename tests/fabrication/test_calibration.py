"""The calibration sheet: every label stands for what is burnt beside it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from flat_patterns import bed, card

from miurafab.errors import LayoutError, OptionError, ProfileError
from miurafab.fabrication.calibration import STRIPS, calibration_sheet, gauge_mark
from miurafab.fabrication.calibration_ladder import begun
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.program import strokes
from miurafab.posting.sections import post_sections
from miurafab.profiles import OPERATIONS, load_machine, load_material, shipped_names
from miurafab.profiles.beam import Operation

LASERS = [
    name for name in shipped_names("firmware_profiles") if load_machine(name).tool.kind == "laser"
]
MATERIALS = shipped_names("materials")


def burnt(machine, sheet):
    """(operation, patch, S, F, points) of each stroke, from the G-code alone."""
    job = post_sections(sheet.sections, machine, patch_labels=sheet.labels)
    program = parse_program(job, inline=machine.dialect == "marlin")
    made = strokes(program)
    found = []
    for number, move in enumerate(made.first_move.tolist()):
        context = program.contexts[program.context[move]]
        points = made.points[made.offsets[number] : made.offsets[number + 1], :2]
        power, feed = float(program.power[move]), float(program.feed_mm_min[move])
        found.append((context.operation, context.patch, power, feed, points))
    return found


@pytest.mark.parametrize(
    ("laser", "material"),
    [
        ("grbl-laser-400", "card-250"),
        ("grbl09-laser-300", "paper-100"),
        ("fluidnc-laser-600", "card-250"),
        ("grbl-co2-k40", "polypropylene-04"),
    ],
)
def test_each_stroke_carries_the_power_and_feed_of_its_label(laser, material):
    machine, stock = load_machine(laser), load_material(material)
    sheet = calibration_sheet(machine, stock)
    own = stock.on(machine).operations
    scores = {score.label: score for score in sheet.scores}
    cells = {cell.label: cell for cell in sheet.cells}
    squares = {square.label: square for square in sheet.squares}
    drawn = burnt(machine, sheet)
    assert len(drawn) == sum(
        int(own[OPERATIONS[code]].passes)
        for toolpath, _ in sheet.sections
        for code in toolpath.operation
    )
    tried = dict.fromkeys([*cells, *squares, *scores], 0)
    for operation, patch, power, feed, _ in drawn:
        wanted = own[operation]
        if operation == "perforate" and patch in cells:
            wanted = cells[patch].operation
            tried[patch] += 1
        if operation == "score" and patch in scores:
            wanted = scores[patch].operation
            tried[patch] += 1
        if patch in squares:
            wanted = squares[patch].operation
            tried[patch] += 1
        assert power == machine.power_to_s(wanted.power)
        assert feed == pytest.approx(wanted.feed_mm_min)
    assert all(tried.values())
    strengths = {cell.operation.energy_j_mm for cell in sheet.cells if cell.along == "x"}
    assert len(strengths) > 4


@pytest.mark.parametrize("laser", LASERS)
def test_it_fits_every_shipped_laser_or_says_what_it_needs(laser):
    machine = load_machine(laser)
    material = "paper-100" if machine.tool.beam == "co2" else "card-250"
    sheet = calibration_sheet(machine, load_material(material))
    points, margin = sheet.toolpath.points, machine.bed.margin_mm
    assert (points >= margin - 1e-9).all()
    assert (points <= [sheet.width_mm - margin, sheet.height_mm - margin]).all()
    assert sheet.width_mm <= machine.bed.width_mm
    assert sheet.height_mm <= machine.bed.height_mm


def test_the_dashes_of_a_flap_are_those_of_its_row_and_no_two_flaps_are_alike():
    stock = card()
    sheet = calibration_sheet(bed(400, 400), stock)
    whole = sheet.toolpath
    settings = set()
    for number, cell in enumerate(sheet.cells):
        mine = (whole.patch == number) & (whole.operation == OPERATIONS.index("perforate"))
        inner = np.sort(whole.lengths[mine])[::-1][: mine.sum() - 2]
        np.testing.assert_allclose(inner + stock.kerf_mm, cell.perforation.cut_mm, atol=1e-9)
        settings.add((cell.perforation, cell.operation, cell.along))
        assert cell.operation.power <= 10.0
    assert len(settings) == len(sheet.cells) >= 20


def test_the_settings_of_the_material_itself_are_among_those_tried():
    stock = card(cut=1.23, gap=0.77)
    odd = {"perforate": Operation(4.0, 1.23, passes=2), "cut": Operation(1234.5, 9.87)}
    stock = stock.worked_with(bed(400, 400), **odd)
    sheet = calibration_sheet(bed(400, 400), stock)
    assert odd["perforate"] in [cell.operation for cell in sheet.cells if cell.along == "x"]
    assert odd["cut"] in [square.operation for square in sheet.squares]
    assert stock.perforation in [cell.perforation for cell in sheet.cells]
    assert all(cell.operation.feed_mm_min > 0 for cell in sheet.cells)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("kerf", [0.0, 0.08, 0.15, 0.37])
def test_the_gauges_read_the_kerf_that_is_burnt(kerf, turned):
    sheet = calibration_sheet(bed(400, 400), card())
    path, _ = sheet.sections[-1]
    lines = [path.stroke(n + STRIPS)[:, ::-1] if turned else path.stroke(n) for n in range(STRIPS)]
    window = shapely.box(*shapely.LineString(lines[-1]).bounds)
    low, _, high, _ = window.bounds
    burn = shapely.union_all(
        [shapely.LineString(line).buffer(kerf / 2 + 1e-9, cap_style="square") for line in lines]
    )
    strips = [part for part in window.difference(burn).geoms if part.area > 1]
    assert len(strips) == STRIPS
    widths = [part.bounds[2] - part.bounds[0] for part in strips]
    ends = low - kerf / 2 + sum(widths)
    assert high - ends == pytest.approx(gauge_mark(kerf), abs=1e-6)


def test_the_flaps_of_the_last_column_are_hinged_the_other_way():
    whole = calibration_sheet(bed(400, 400), card()).toolpath
    sheet = calibration_sheet(bed(400, 400), card())
    labels = {label: number for number, label in sheet.labels.items()}
    for entry in (*sheet.cells, *sheet.scores):
        name = "score" if entry in sheet.scores else "perforate"
        mine = (whole.patch == labels[entry.label]) & (whole.operation == OPERATIONS.index(name))
        reach = np.abs(whole.ends[mine] - whole.starts[mine]).max(axis=0)
        across = 0 if entry.along == "y" else 1
        assert reach[across] < 1e-9 < reach[1 - across]
        flap = np.concatenate(
            [
                whole.stroke(k)
                for k in np.flatnonzero(
                    (whole.patch == labels[entry.label])
                    & (whole.operation == OPERATIONS.index("cut"))
                )
            ]
        )
        hinge = flap[[0, -1]]
        at = hinge[0, across]
        assert hinge[1, across] == at
        np.testing.assert_allclose(whole.starts[mine][:, across], at, atol=1e-9)
        assert (flap[:, across] >= at - 1e-9).all()
        assert np.ptp(flap[:, across]) > 8.0
    assert (
        {cell.along for cell in sheet.cells}
        == {score.along for score in sheet.scores}
        == {"x", "y"}
    )


def test_nothing_but_the_sheet_itself_touches_a_caption():
    whole = calibration_sheet(bed(400, 400), card()).toolpath
    lines = [shapely.LineString(whole.stroke(n)) for n in range(len(whole))]
    text = [line for line, code in zip(lines, whole.operation, strict=True) if code == 0]
    other = [line for line, code in zip(lines, whole.operation, strict=True) if code != 0]
    near = shapely.STRtree(other).query(text, predicate="dwithin", distance=0.2)
    assert near.shape[1] == 0


def test_captions_keep_clear_of_cuts_whatever_their_length():
    rule = dataclasses.replace(card().perforation, cut_mm=12.35, gap_mm=10.15)
    sheet = calibration_sheet(bed(600.0, 400.0), dataclasses.replace(card(), perforation=rule))
    path = sheet.toolpath
    kinds = [OPERATIONS[operation] for operation in path.operation]
    lines = [shapely.LineString(path.stroke(k)) for k in range(len(path))]
    cuts = shapely.union_all(
        [line for line, kind in zip(lines, kinds, strict=True) if kind in ("cut", "perforate")]
    )
    captions = [line for line, kind in zip(lines, kinds, strict=True) if kind == "engrave"]
    assert shapely.distance(np.array(captions), cuts).min() > 0.9


def test_a_bed_too_small_and_a_beam_without_settings_are_refused():
    with pytest.raises(LayoutError, match=r"needs 2\d\d mm x \d+ mm or .* is 90 mm x 90 mm"):
        calibration_sheet(bed(100, 100), card())
    with pytest.raises(ProfileError, match="no settings for a knife"):
        calibration_sheet(load_machine("grbl-knife-a3"), card())


def test_what_is_not_made_is_not_on_the_coupon():
    stock = card()
    creases = {**stock.creases, "valley": dataclasses.replace(stock.creases["valley"], mode="none")}
    sheet = calibration_sheet(bed(400, 400), dataclasses.replace(stock, creases=creases))
    made = np.unique(sheet.toolpath.edge[sheet.toolpath.edge >= 0])
    assert set(sheet.coupon.edges_assignment[made]) == {"M"}


def test_settings_to_begin_with_follow_from_a_cut():
    laser, knife = load_machine("grbl-laser-400"), load_machine("grbl-knife-a3")
    watts = laser.tool.laser.power
    for machine, power, feed, words in (
        (laser, 5.0, None, "'feed' is missing"),
        (laser, None, 300.0, "'power' is missing; give that of a cut to begin with, in watts"),
        (laser, watts + 1, 300.0, f"'power' is {watts + 1:g} W; .* has {watts:g} W"),
        (knife, 5.0, 300.0, "'power' is for a laser, and .* is a knife"),
    ):
        with pytest.raises(OptionError, match=words):
            begun(card(), machine, power, feed)
    first = begun(card(), laser, 5.0, 300.0)
    assert first.operations["cut"] == Operation(300.0, 5.0)
    assert first.operations["engrave"] == Operation(900.0, 1.0)
    assert first.most_watts == pytest.approx(min(6.5, watts))
    pressed = begun(card(), knife, None, 300.0)
    assert pressed.beam == "knife"
    assert pressed.operations["score"] == Operation(750.0)


def test_a_tool_that_is_down_where_it_is_lifted_leaves_no_forces_to_try():
    pen = load_machine("grbl-pen-a4")
    pen = dataclasses.replace(pen, tool=dataclasses.replace(pen.tool, s_up=0, s_down=0))
    with pytest.raises(ProfileError, match="lifted at S0 and down at S0, which leaves no forces"):
        calibration_sheet(pen, load_material("card-250"))


def test_what_is_scored_is_scored_on_the_coupon():
    stock = card()
    creases = {
        **stock.creases,
        "valley": dataclasses.replace(stock.creases["valley"], mode="score"),
    }
    sheet = calibration_sheet(bed(400, 400), dataclasses.replace(stock, creases=creases))
    whole = sheet.toolpath
    of_coupon = (whole.operation == OPERATIONS.index("score")) & (whole.edge >= 0)
    scored = np.unique(whole.edge[of_coupon])
    assert set(scored.tolist()) == set(
        np.flatnonzero(sheet.coupon.edges_assignment == "V").tolist()
    )
