"""The post, held against an independent reader: the file read back is the toolpath that went in."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from worked import changed

from miurafab.errors import LayoutError, ProfileError
from miurafab.fabrication.toolpath import Toolpath
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.program import strokes
from miurafab.gcode.reading import read_program
from miurafab.posting import LINE_CHARS, NO_PATCH, post
from miurafab.profiles import OPERATIONS, MachineProfile, Material, load_machine, load_material

LASER = load_machine("grbl-laser-400")
CARD = load_material("card-250")
CUT = OPERATIONS.index("cut")
PERFORATE = OPERATIONS.index("perforate")


def toolpath(
    polylines: Sequence[Sequence[tuple[float, float]]],
    operation: Sequence[int] | None = None,
    patch: Sequence[int] | None = None,
    sheet: str = "sheet-01",
) -> Toolpath:
    count = len(polylines)
    return Toolpath(
        sheet=sheet,
        width_mm=400.0,
        height_mm=400.0,
        points=np.array([p for line in polylines for p in line], dtype=float).reshape(-1, 2),
        offsets=np.cumsum([0, *map(len, polylines)], dtype=np.int64),
        operation=np.array([CUT] * count if operation is None else operation, dtype=np.int64),
        patch=np.array([0] * count if patch is None else patch, dtype=np.int64),
        edge=np.full(count, -1, dtype=np.int64),
    )


def with_tool(machine: MachineProfile, **changes: object) -> MachineProfile:
    return replace(machine, tool=replace(machine.tool, **changes))


def with_passes(material: Material, **passes: int) -> Material:
    return changed(material, **{name: {"passes": count} for name, count in passes.items()})


SQUARE = [(10.0, 10.0), (20.0, 10.0), (20.0, 20.5), (10.0, 10.0)]
HOOK = [(10.0, 10.0), (20.0, 10.0), (20.0, 20.5)]
DASH = [(1.0005, 2.25), (3.0, 2.25)]

coordinate = st.integers(0, 4_000_000).map(lambda tenth: tenth / 10_000.0)


def apart(line: list[tuple[float, float]]) -> bool:
    return all(max(abs(a[0] - b[0]), abs(a[1] - b[1])) > 2e-3 for a, b in itertools.pairwise(line))


@st.composite
def toolpaths(draw: st.DrawFn) -> Toolpath:
    """Random strokes; some start where the one before ended."""
    polylines: list[list[tuple[float, float]]] = []
    for _ in range(draw(st.integers(0, 12))):
        line = draw(
            st.lists(st.tuples(coordinate, coordinate), min_size=2, max_size=4).filter(apart)
        )
        if polylines and draw(st.booleans()) and apart([polylines[-1][-1], line[1]]):
            line[0] = polylines[-1][-1]
        polylines.append(line)
    count = len(polylines)
    each = {"min_size": count, "max_size": count}
    operation = draw(st.lists(st.integers(0, 3), **each))
    patch = draw(st.lists(st.integers(-1, 2), **each))
    return toolpath(polylines, operation, patch)


def test_small_job_is_written_as_the_controller_likes_it() -> None:
    path = toolpath([DASH, [(3.8, 2.25), (4.0, 2.0)], SQUARE], [PERFORATE, PERFORATE, CUT], [3] * 3)
    assert post(path, LASER, CARD, patch_labels={3: "A4"}).text.splitlines() == [
        "(sheet sheet-01)",
        "(machine grbl-laser-400)",
        "(material card-250)",
        "M5",
        "G21",
        "G90",
        "G17",
        "G94",
        "M4 S0",
        "(operation perforate)",
        "(patch A4)",
        "G0 X1 Y2.25",
        "G1 X3 Y2.25 S700 F1500",
        "G0 X3.8 Y2.25",
        "G1 X4 Y2",
        "(operation cut)",
        "G0 X10 Y10",
        "G1 X20 Y10 S800 F900",
        "G1 X20 Y20.5",
        "G1 X10 Y10",
        "M5",
        "G0 X0 Y0",
        "M2",
    ]


def joined(path: Toolpath) -> Toolpath:
    """``path`` as the reader tells strokes apart: those that meet in one operation and patch are
    one stroke.
    """
    meets = (
        (np.rint(path.ends[:-1] * 1000) == np.rint(path.starts[1:] * 1000)).all(axis=1)
        & (np.diff(path.operation) == 0)
        & (np.diff(path.patch) == 0)
    )
    first = np.flatnonzero(np.concatenate([np.ones(min(len(path), 1), dtype=bool), ~meets]))
    polylines: list[list[tuple[float, float]]] = []
    for index in range(len(path)):
        points = [(float(x), float(y)) for x, y in path.stroke(index)]
        if index in first:
            polylines.append(points)
        else:
            polylines[-1] += points[1:]
    return toolpath(polylines, list(path.operation[first]), list(path.patch[first]))


@given(toolpaths().map(joined))
@settings(max_examples=150)
def test_read_back_it_is_the_same_strokes_in_order(path: Toolpath) -> None:
    labels = {0: "A1", 1: "B 2"}
    read = strokes(parse_program(post(path, LASER, CARD, patch_labels=labels)))
    assert len(read) == len(path)
    assert np.array_equal(read.offsets, path.offsets)
    assert np.abs(read.points[:, :2] - path.points).max(initial=0.0) <= 1e-3
    assert not read.points[:, 2].any()
    for index in range(len(path)):
        context = read.contexts[read.context[index]]
        patch = int(path.patch[index])
        assert context.sheet == "sheet-01"
        assert context.operation == OPERATIONS[path.operation[index]]
        assert context.patch == (NO_PATCH if patch < 0 else labels.get(patch, str(patch)))


@given(toolpaths())
@settings(max_examples=100)
def test_strokes_that_meet_are_burnt_once_each(path: Toolpath) -> None:
    program = parse_program(post(path, LASER, CARD))
    burnt = np.stack([program.start, program.end], axis=1)[program.beam_on][:, :, :2]
    inner = np.ones(len(path.points), dtype=bool)
    inner[path.offsets[1:] - 1] = False
    asked = np.stack([path.points[inner], path.points[np.flatnonzero(inner) + 1]], axis=1)
    assert burnt.shape == asked.shape
    assert np.abs(burnt - asked).max(initial=0.0) <= 1e-3


@given(toolpaths().map(joined))
@settings(max_examples=100)
def test_power_and_feed_are_those_of_the_operation(path: Toolpath) -> None:
    program = parse_program(post(path, LASER, CARD))
    read = strokes(program)
    for index in range(len(path)):
        operation = CARD.on(LASER).operations[OPERATIONS[path.operation[index]]]
        moves = slice(read.first_move[index], read.last_move[index] + 1)
        assert (program.power[moves] == round(100 * operation.power)).all()
        assert (program.feed_mm_min[moves] == operation.feed_mm_min).all()


@given(toolpaths())
@settings(max_examples=100)
def test_every_line_is_short_plain_and_needed(path: Toolpath) -> None:
    text = post(path, LASER, CARD).text
    assert text.endswith("\n")
    assert text.isascii()
    lines = text.splitlines()
    assert max(map(len, lines)) <= LINE_CHARS
    assert [*post(path, LASER, CARD).send_lines()]
    assert re.search(r"-", re.sub(r"\(.*\)", "", text)) is None
    for number in re.findall(r"[XYSF]([^ \n]+)", re.sub(r"\(.*\)", "", text)):
        assert re.fullmatch(r"(0|[1-9]\d*)(\.\d{0,2}[1-9])?", number)
    spoken = [word for line in lines for word in re.findall(r"[SF]\d+", line)][1:]
    for letter in "SF":
        said = [word for word in spoken if word[0] == letter]
        assert all(a != b for a, b in itertools.pairwise(said))


@given(toolpaths())
@settings(max_examples=100)
def test_starts_and_ends_dark_and_arms_once(path: Toolpath) -> None:
    code = [line for line in post(path, LASER, CARD).text.splitlines() if line[0] != "("]
    assert code[0] == "M5"
    assert code[-3:] == ["M5", "G0 X0 Y0", "M2"]
    assert [line for line in code if line.startswith(("M3", "M4"))] == ["M4 S0"]


def test_passes_repeat_each_run_of_a_patch() -> None:
    path = toolpath([DASH, HOOK, DASH, HOOK], [PERFORATE, CUT, CUT, CUT], [0, 0, 0, 1])
    job = post(path, LASER, with_passes(CARD, cut=3))
    read = strokes(parse_program(job))
    made = [tuple(read.stroke(index)[0, :2]) for index in range(len(read))]
    dash, hook = (1.0, 2.25), (10.0, 10.0)
    assert made == [dash] + [hook, dash] * 3 + [hook] * 3
    assert job.text.count("(pass 2 of 3)\n") == 2


def test_same_input_same_bytes() -> None:
    path = toolpath([DASH, SQUARE])
    assert post(path, LASER, CARD) == post(path, LASER, CARD)


def test_an_empty_sheet_is_a_job_that_burns_nothing() -> None:
    assert len(strokes(parse_program(post(toolpath([]), LASER, CARD)))) == 0


def test_points_that_coincide_at_a_micrometre_are_one() -> None:
    path = toolpath([[(1.0, 1.0), (1.0001, 1.0), (2.0, 1.0), (2.0, 1.0003)]])
    assert post(path, LASER, CARD).text.count("G1 ") == 1


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("value", [-0.001, 400.001, np.nan, np.inf, -np.inf])
def test_a_stroke_off_the_bed_is_named(axis: int, value: float) -> None:
    point = [5.0, 5.0]
    point[axis] = value
    path = toolpath([DASH, [(1.0, 1.0), (point[0], point[1])]], [PERFORATE, CUT], [0, 7])
    with pytest.raises(LayoutError, match=r"Stroke 2 of sheet-01 \(cut, patch 7\).*400 x 400 mm"):
        post(path, LASER, CARD)


def test_the_very_edge_of_the_bed_is_on_it() -> None:
    edge = [(0.0, 0.0), (400.0, 0.0), (400.0, 400.0), (-0.0004, 400.0004)]
    assert "-" not in post(toolpath([edge]), LASER, CARD).text.split("M4")[1]


@pytest.mark.parametrize("line", [[(1.0, 1.0)], [(1.0, 1.0), (1.0002, 1.0)], []])
def test_a_stroke_without_length_is_named(line: list[tuple[float, float]]) -> None:
    with pytest.raises(LayoutError, match=r"Stroke 2 of sheet-01 .* is shorter"):
        post(toolpath([DASH, line, SQUARE]), LASER, CARD)


@pytest.mark.parametrize("label", ["stop!", "a (b)", "wie groß", "line\nG0 X9", "what?", "x" * 65])
def test_a_label_that_could_reach_the_controller_is_refused(label: str) -> None:
    with pytest.raises(LayoutError, match="patch name"):
        post(toolpath([DASH]), LASER, CARD, patch_labels={0: label})


def test_air_assist_runs_from_the_first_to_the_last_stroke() -> None:
    code = post(toolpath([DASH]), with_tool(LASER, air_assist=True), CARD).text.splitlines()
    assert code[code.index("M4 S0") + 1] == "M8"
    assert code[-4:] == ["M5", "M9", "G0 X0 Y0", "M2"]


def test_m3_only_where_the_profile_says_so() -> None:
    assert "M3" not in post(toolpath([DASH]), LASER, CARD).text
    constant = post(toolpath([DASH]), with_tool(LASER, beam_mode="M3"), CARD).text
    assert "M3 S0\n" in constant
    assert "M4" not in constant


def test_a_pen_is_lowered_and_lifted_at_each_stroke() -> None:
    pen = replace(
        with_tool(LASER, kind="pen", s_down=90, s_up=30, settle_s=0.15, beam_mode="M3"),
        settings={32: 0.0},
    )
    code = post(toolpath([DASH, SQUARE]), pen, CARD).text.splitlines()
    assert [line for line in code[3:] if line[0] != "("] == [
        *["M5", "G21", "G90", "G17", "G94", "M3 S30", "G4 P0.15"],
        *["G0 X1 Y2.25", "M3 S90", "G4 P0.15", "G1 X3 Y2.25 F900", "M3 S30", "G4 P0.15"],
        *["G0 X10 Y10", "M3 S90", "G4 P0.15", "G1 X20 Y10", "G1 X20 Y20.5", "G1 X10 Y10"],
        *["M3 S30", "G4 P0.15", "M5", "G0 X0 Y0", "M2"],
    ]


@given(toolpaths())
@settings(max_examples=40)
def test_a_pen_stays_down_where_strokes_meet(path: Toolpath) -> None:
    pen = replace(
        with_tool(LASER, kind="pen", s_down=90, s_up=30, settle_s=0.15, beam_mode="M3"),
        settings={32: 0.0},
    )
    job = post(path, pen, CARD)
    assert job.text.splitlines().count("M3 S90") == len(joined(path))
    program = read_program(job, pen)
    drawn = np.stack([program.start, program.end], axis=1)[program.beam_on][:, :, :2]
    inner = np.ones(len(path.points), dtype=bool)
    inner[path.offsets[1:] - 1] = False
    asked = np.stack([path.points[inner], path.points[np.flatnonzero(inner) + 1]], axis=1)
    assert drawn.shape == asked.shape
    assert np.abs(drawn - asked).max(initial=0.0) <= 1e-3


def test_a_firmware_without_laser_mode_switches_at_each_stroke() -> None:
    old = replace(with_tool(LASER, beam_mode="M3"), dialect="grbl-0.9", settings={})
    code = post(toolpath([DASH, SQUARE], [PERFORATE, CUT]), old, CARD).text.splitlines()
    assert [line for line in code[8:] if line[0] != "("] == [
        *["G0 X1 Y2.25", "M3 S700", "G1 X3 Y2.25 F1500", "M5"],
        *["G0 X10 Y10", "M3 S800", "G1 X20 Y10 F900", "G1 X20 Y20.5", "G1 X10 Y10", "M5"],
        *["M5", "G0 X0 Y0", "M2"],
    ]


@pytest.mark.parametrize(
    ("machine", "complaint"),
    [
        (replace(LASER, dialect="hpgl"), "cannot set a laser's power"),
        (replace(with_tool(LASER, kind="pen"), dialect="marlin", settings={}), "not for a pen"),
        (replace(LASER, settings={}), r'write "\$32" = 1'),
        (with_tool(LASER, kind="pen"), r'write "\$32" = 0'),
        (replace(LASER, dialect="grbl-0.9"), 'write beam_mode = "M3"'),
    ],
)
def test_a_machine_that_cannot_be_written_for_is_refused(
    machine: MachineProfile, complaint: str
) -> None:
    with pytest.raises(ProfileError, match=complaint):
        post(toolpath([DASH]), machine, CARD)


@pytest.mark.large
def test_two_hundred_thousand_dashes() -> None:
    generator = np.random.default_rng(7)
    start = generator.uniform(0, 390, (200_000, 2))
    points = np.stack([start, start + generator.uniform(0.1, 9, start.shape)], axis=1)
    path = replace(
        toolpath([DASH]),
        points=points.reshape(-1, 2),
        offsets=np.arange(0, 400_001, 2),
        operation=np.full(200_000, PERFORATE),
        patch=np.arange(200_000) // 1000,
        edge=np.zeros(200_000, dtype=np.int64),
    )
    read = strokes(parse_program(post(path, LASER, CARD)))
    assert np.array_equal(read.offsets, path.offsets)
    assert np.abs(read.points[:, :2] - path.points).max() <= 1e-3
