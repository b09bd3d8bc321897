"""The strokes of a program against those that are wanted: each fault is named, nothing else is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from problems import regular

from miurafab.fabrication.route.order import HOLE, OUTLINE, StrokeSet
from miurafab.fabrication.strokes import RIM, SLOT
from miurafab.fabrication.toolpath import Toolpath
from miurafab.gcode.job import Job
from miurafab.gcode.reading import read_program
from miurafab.profiles import OPERATIONS, MachineProfile, Material, load_machine, load_material
from miurafab.workflow.trace import traced_strokes

LASER, CARD = load_machine("grbl-laser-400"), load_material("card-250")
PATTERN = regular()
CREASE = int(np.flatnonzero(PATTERN.edges_assignment == "M")[0])
FOLD = int(np.flatnonzero(PATTERN.edges_assignment == "V")[0])  # that a tab stands on
SLIT = int(np.flatnonzero(PATTERN.edges_assignment == "B")[0])

Stroke = tuple[str, list[tuple[float, float]], int, int]
"""Operation, points, edge, rank."""


def dash(x: float, y: float = 10.0, edge: int = CREASE) -> Stroke:
    return "perforate", [(x, y), (x + 2, y)], edge, 0


def wanted(strokes: Sequence[Stroke]) -> StrokeSet:
    count = len(strokes)
    table = [(OPERATIONS.index(name), edge, rank) for name, _, edge, rank in strokes]
    operation, edge, rank = np.array(table, dtype=np.int64).reshape(-1, 3).T
    path = Toolpath(
        "sheet-01",
        400.0,
        400.0,
        np.array([p for _, points, _, _ in strokes for p in points], dtype=float).reshape(-1, 2),
        np.cumsum([0, *(len(points) for _, points, _, _ in strokes)]),
        operation,
        np.zeros(count, dtype=np.int64),
        edge,
    )
    return StrokeSet(path, np.arange(count), rank)


def burnt(name: str, points: Sequence[tuple[float, float]], z: float | None = None) -> str:
    """The lines of one stroke, after a comment that names its operation, if any."""
    begin, *others = points
    return (
        (f"(operation {name})\n" if name else "")
        + ("" if z is None else f"G0 Z{z}\n")
        + f"G0 X{begin[0]:g} Y{begin[1]:g}\n"
        + "".join(f"G1 X{x:.4f} Y{y:.4f} S500 F900\n" for x, y in others)
    )


def found(
    strokes: Sequence[Stroke],
    text: str,
    *,
    material: Material = CARD,
    profile: MachineProfile = LASER,
) -> tuple[list[str], Counter[str]]:
    """The sentences on a program that begins with arming the beam, and what it has right."""
    if profile.dialect == "hpgl":
        job = Job("sheet-01.plt", f"IN;{text}SP0;")
    else:
        job = Job("sheet-01.nc", f"M4 S0\n{text}M5\n")
    program = read_program(job, profile)
    traced: Counter[str] = Counter()
    findings = traced_strokes(
        wanted(strokes), PATTERN, np.array([FOLD]), program, profile, material, traced
    )
    listed = list(findings)
    assert {each.code for each in listed} <= {"stroke"}
    assert {each.severity for each in listed} <= {"refusal"}
    assert {each.where for each in listed} <= {"sheet-01"}
    return [each.sentence.removeprefix("sheet-01: ") for each in listed], +traced


def test_each_kind_of_stroke_is_told_by_its_operation_edge_and_rank() -> None:
    square = [(0.0, 0.0), (5.0, 0.0), (5.0, 5.0), (0.0, 0.0)]
    kinds = {
        "crease": ("perforate", CREASE, 0),
        "tab fold": ("perforate", FOLD, 0),
        "outline": ("cut", -1, OUTLINE),
        "hole": ("cut", -1, HOLE),
        "slit": ("cut", SLIT, 2),
        "slot": ("cut", -1, SLOT),
        "label": ("engrave", -1, 0),
        "rim number": ("engrave", -1, RIM),
        "tick": ("engrave", CREASE, 0),
    }
    strokes = [
        (operation, [(x + 10.0 * n, y + 10.0) for x, y in square], edge, rank)
        for n, (operation, edge, rank) in enumerate(kinds.values())
    ]
    text = "".join(burnt(name, points) for name, points, _, _ in strokes)
    assert found(strokes, text) == ([], Counter(dict.fromkeys(kinds, 1)))
    for n, kind in enumerate(kinds):
        rest = "".join(burnt(name, points) for name, points, _, _ in strokes[:n] + strokes[n + 1 :])
        says, traced = found(strokes, rest)
        on = "" if strokes[n][2] < 0 else f" on edge {strokes[n][2]}"
        assert says == [f"the {kind}{on} from X{10 * n:.3f} Y10.000 is not burnt."]
        assert traced == Counter(dict.fromkeys(kinds, 1)) - Counter([kind])


def test_the_edge_of_number_0_is_one_as_any_other() -> None:
    assert PATTERN.edges_assignment[0] == "B"
    tick, slit = ("engrave", [(10.0, 10.0), (12.0, 10.0)], 0, 0), dash(20, edge=0)
    text = burnt("engrave", tick[1])
    assert found([tick], text) == ([], {"tick": 1})
    says, traced = found([tick, slit], text)
    assert says == ["the slit on edge 0 from X20.000 Y10.000 is not burnt."]
    assert traced == {"tick": 1}


def test_a_stroke_may_be_burnt_either_way_and_its_operation_need_not_be_said() -> None:
    strokes = [dash(10), dash(20)]
    way = [strokes[0][1], strokes[1][1][::-1]]
    assert found(strokes, burnt("perforate", way[0]) + burnt("perforate", way[1]))[0] == []
    assert found(strokes, burnt("", way[0]) + burnt("", way[1]))[0] == []


@pytest.mark.parametrize("name", [each for each in OPERATIONS if each != "perforate"])
def test_a_stroke_by_another_operation_is_not_the_one_wanted(name: str) -> None:
    says, traced = found([dash(10)], burnt(name, dash(10)[1]))
    assert says == [
        "line 4 burns a stroke from X10.000 Y10.000 that is not of the pattern, or out of its "
        "place.",
        f"the crease on edge {CREASE} from X10.000 Y10.000 is not burnt.",
    ]
    assert not traced


@pytest.mark.parametrize(
    ("shift", "right"), [(0.0025, True), (-0.0025, True), (0.0035, False), (0.1, False)]
)
def test_a_stroke_out_of_its_place_by_more_than_rounding_is_named(
    shift: float, right: bool
) -> None:
    moved = [(x + shift, y) for x, y in dash(10)[1]]
    says, traced = found([dash(10)], burnt("perforate", moved))
    assert len(says) == (0 if right else 2)
    assert traced["crease"] == right


def pivoting(name: str) -> MachineProfile:
    """A drag knife whose tip is on its axis, and which cuts no corner over again."""
    machine = load_machine(name)
    knife = replace(machine.tool.knife, offset_mm=0.0, overcut_mm=0.0)
    return replace(machine, tool=replace(machine.tool, knife=knife))


KNIFE, CUTTER = pivoting("grbl-knife-a3"), pivoting("hpgl-cutter-a3")


@pytest.mark.parametrize(
    ("profile", "shift", "right"),
    [
        (LASER, 0.004, True),
        (LASER, 0.0041, False),
        (KNIFE, 0.01, True),
        (KNIFE, 0.0101, False),
        (CUTTER, 0.05, True),
        (CUTTER, 0.075, False),
    ],
)
def test_an_end_may_be_out_of_its_place_by_twice_what_the_machine_rounds(
    profile: MachineProfile, shift: float, right: bool
) -> None:
    (a, b), (c, d) = dash(0)[1]
    text = burnt("perforate", [(a + shift, b), (c, d)])
    if profile is CUTTER:
        text = f"PU{(a + shift) * 40:g},{b * 40:g};PD{c * 40:g},{d * 40:g};PU0,0;"
    says, traced = found([dash(0)], text, profile=profile)
    assert len(says) == (0 if right else 2)
    assert traced["crease"] == right


@pytest.mark.parametrize(("z", "right"), [(0.002, True), (-0.002, True), (0.0021, False)])
def test_the_head_may_be_off_its_height_by_what_is_rounded(z: float, right: bool) -> None:
    says, traced = found([dash(10)], burnt("perforate", dash(10)[1], z))
    assert len(says) == (0 if right else 2)
    assert traced["crease"] == right


def test_a_stroke_alone_may_be_burnt_from_its_end() -> None:
    assert found([dash(10)], burnt("perforate", dash(10)[1][::-1])) == ([], {"crease": 1})


@pytest.mark.parametrize(("off", "swivels"), [(0.01, True), (0.012, False)])
def test_a_segment_of_a_knife_ends_near_corners(off: float, swivels: bool) -> None:
    stroke = dash(0, 0.0)
    text = burnt("perforate", stroke[1]) + "M3 S0\n" + burnt("perforate", [(0, 0), (0, off)])
    assert (found([stroke], text, profile=KNIFE)[0] == []) is swivels


SQUARE = [(50.0, 50.0), (60.0, 50.0), (60.0, 60.0), (50.0, 60.0), (50.0, 50.0)]


@pytest.mark.parametrize(
    ("beyond", "says"),
    [
        (0.5, ""),
        (0.51, ""),
        (0.512, "line 12 burns a stroke from X50.000 Y50.000 that is not of the pattern"),
        (0.49, ""),
        (0.488, "the stroke at line 8 goes round and not on by the overcut of 0.5 mm."),
    ],
)
def test_a_closed_cut_of_a_knife_goes_on_by_its_overcut(beyond: float, says: str) -> None:
    overcutting = replace(KNIFE.tool.knife, overcut_mm=0.5)
    profile = replace(KNIFE, tool=replace(KNIFE.tool, knife=overcutting))
    strokes = [dash(10), ("cut", SQUARE, -1, OUTLINE)]
    ways = burnt("perforate", dash(10)[1]) + "M3 S0\n"
    ways += burnt("cut", [*SQUARE, (50 + beyond, 50.0)])
    told, traced = found(strokes, ways, profile=profile)
    assert (told == []) is (says == "")
    assert all(each.startswith(says) for each in told[:1])
    assert traced == {"crease": 1, "outline": 1}


def test_what_a_knife_leaves_out_is_not_wanted() -> None:
    label = ("engrave", [(20.0, 20.0), (25.0, 20.0)], -1, 0)
    text = burnt("perforate", dash(10)[1])
    for left_out, says in ((("engrave",), 0), ((), 1)):
        knife = replace(KNIFE.tool.knife, leave_out=left_out)
        profile = replace(KNIFE, tool=replace(KNIFE.tool, knife=knife))
        assert len(found([label, dash(10)], text, profile=profile)[0]) == says
        assert found([label, dash(10)], text, profile=profile)[1] == {"crease": 1}


def test_a_sheet_without_a_stroke_has_no_cut_that_aligns_the_blade() -> None:
    knife = load_machine("grbl-knife-a3")
    assert found([], "G0 X10 Y10\n", profile=knife) == ([], {})
    says, traced = found([dash(10)], "G0 X10 Y10\n", profile=knife)
    assert [each[:15] for each in says] == ["the aligning cu", "the crease on e"]
    assert not traced


def test_a_knife_turns_round_at_corners_by_segments_of_its_own() -> None:
    for gap, swivels in ((0.015, True), (0.025, False)):
        strokes, swivel = [dash(10), dash(12 + gap)], [(12, 10), (12 + gap, 10)]
        ways = [strokes[0][1], strokes[1][1], swivel]
        text = "".join(f"M3 S0\n{burnt('perforate', way)}" for way in ways)
        assert (found(strokes, text, profile=KNIFE)[0] == []) is swivels
        assert len(found(strokes, text)[0]) == 1  # a laser does not


@pytest.mark.parametrize(
    ("profile", "step", "may"),
    [
        (LASER, 0.002, True),
        (LASER, 0.0021, False),
        (KNIFE, 0.0199, True),
        (KNIFE, 0.0201, False),
    ],
)
def test_what_is_no_longer_than_what_a_machine_loses_may_vanish(
    profile: MachineProfile, step: float, may: bool
) -> None:
    """The short segment comes first: without it, the second begins where it did."""
    points = [(0.0, 10.0), (step, 10.0), (2.0, 10.0)]
    stroke = ("perforate", points, CREASE, 0)
    for first in (0, 1):
        says, traced = found([stroke], burnt("perforate", points[first:]), profile=profile)
        assert (says == []) is (may or not first)
        assert bool(traced) is (may or not first)


def test_a_stroke_that_is_burnt_twice_is_named_once_and_is_not_right() -> None:
    text = burnt("perforate", dash(10)[1])
    says, traced = found([dash(10), dash(20)], 3 * text + burnt("perforate", dash(20)[1]))
    assert says == [f"the crease on edge {CREASE} from X10.000 Y10.000 is burnt too often."]
    assert traced == {"crease": 1}


def test_five_faults_of_a_kind_are_named_and_the_others_counted() -> None:
    strokes = [dash(10.0 * n) for n in range(1, 9)]
    text = "".join(burnt("perforate", [(x, y + 1) for x, y in s[1]]) for s in strokes)
    says, traced = found(strokes, text)
    assert [s.partition(" from ")[0] for s in says] == [
        *(f"line {4 + 3 * n} burns a stroke" for n in range(5)),
        "3 more segments do so.",
        *5 * [f"the crease on edge {CREASE}"],
        "3 more strokes are not burnt.",
    ]
    assert not traced
    says, _ = found(strokes[:5], "".join(text.partition("(operation perforate)\nG0 X60")[:1]))
    assert len(says) == 10


def test_a_sheet_without_a_stroke_and_a_program_that_burns_nothing() -> None:
    assert found([], "G0 X10 Y10\n") == ([], {})
    says, traced = found([], burnt("perforate", dash(10)[1]))
    assert [each[:21] for each in says] == ["line 4 burns a stroke"]
    says, traced = found([dash(10)], "G0 X10 Y10\nG0 X12\n")
    assert [each[-13:] for each in says] == ["is not burnt."]
    assert not traced


def test_each_segment_of_a_stroke_counts() -> None:
    corners = [(10.0, 10.0), (12.0, 10.0), (12.0, 12.0), (10.0, 12.0)]
    outline = ("cut", corners, -1, OUTLINE)
    assert found([outline, dash(30)], burnt("cut", corners[:3]) + burnt("perforate", dash(30)[1]))[
        0
    ] == ["the outline from X10.000 Y10.000 is not burnt."]
    other = [corners[1], corners[2], corners[3], corners[0]]
    says, _ = found([outline], burnt("cut", corners) + burnt("cut", other[2:]))
    assert len(says) == 1
    assert "line 9 burns a stroke from X10.000 Y12.000" in says[0]


def test_a_segment_shorter_than_rounding_may_vanish_and_a_longer_one_may_not() -> None:
    for step, may in ((0.0015, True), (0.003, False)):
        points = [(10.0, 10.0), (12.0, 10.0), (12.0 + step, 10.0), (14.0, 10.0)]
        stroke = ("perforate", points, CREASE, 0)
        assert found([stroke], burnt("perforate", points))[0] == []
        # Without the short one, the third begins where the second does.
        says, _ = found([stroke], burnt("perforate", [points[0], points[1], points[3]]))
        assert (says == []) is may


def test_a_stray_stroke_is_found_however_finely_it_is_cut_up() -> None:
    """Steps of a micrometre, each of which could be the rounding of something."""
    stray = [(50 + n / 1000, 50.0) for n in range(300)]
    says, traced = found([dash(10)], burnt("perforate", dash(10)[1]) + burnt("perforate", stray))
    assert says[0].startswith("line 7 burns a stroke from X50.000 Y50.000 that is not of the")
    assert says[5] == "294 more segments do so."
    assert traced == {"crease": 1}
    on = [(10.5 + n / 1000, 10.0) for n in range(300)]  # on a wanted stroke, burnt once already
    assert found([dash(10)], burnt("perforate", dash(10)[1]) + burnt("perforate", on))[0]


def test_a_dot_at_the_end_of_a_wanted_stroke_is_found() -> None:
    """Nothing but a knife makes a segment of its own there, however short."""
    dot = burnt("perforate", [(10.0, 10.0), (10.0015, 10.0)])
    says, traced = found([dash(10)], burnt("perforate", dash(10)[1]) + dot)
    assert [each.partition(" from ")[0] for each in says] == ["line 7 burns a stroke"]
    assert traced == {"crease": 1}


@pytest.mark.parametrize("gap", [0.05, 0.8])
def test_a_gap_between_two_dashes_that_is_burnt_is_found(gap: float) -> None:
    """Both of its ends are corners of wanted strokes."""
    strokes = [dash(10), dash(12 + gap)]
    text = "".join(burnt("perforate", each[1]) for each in strokes)
    assert found(strokes, text)[0] == []
    says, traced = found(strokes, text + burnt("perforate", [(12, 10), (12 + gap, 10)]))
    assert says == [
        "line 10 burns a stroke from X12.000 Y10.000 that is not of the pattern, or out of its "
        "place."
    ]
    assert traced == {"crease": 2}


def test_each_pass_is_due_at_its_height() -> None:
    operations = CARD.on(LASER).operations
    twice = replace(operations["perforate"], passes=2, z_step_mm=0.5)
    material = CARD.worked_with(LASER, perforate=twice)
    at = {z: burnt("perforate", dash(10)[1], z) for z in (0.0, -0.5, -0.4)}
    assert found([dash(10)], at[0.0] + at[-0.5], material=material) == ([], {"crease": 1})
    crease = f"the crease on edge {CREASE} from X10.000 Y10.000"
    once, _ = found([dash(10)], at[0.0], material=material)
    assert once == [f"{crease} is not burnt."]
    same, _ = found([dash(10)], at[0.0] + at[0.0], material=material)
    assert same == [f"{crease} is not burnt.", f"{crease} is burnt too often."]
    off, traced = found([dash(10)], at[0.0] + at[-0.4], material=material)
    assert [s.split(" from ")[0] for s in off] == [
        "line 9 burns a stroke",
        f"the crease on edge {CREASE}",
    ]
    assert not traced
    level = CARD.worked_with(LASER, perforate=replace(operations["perforate"], passes=3))
    assert found([dash(10)], 3 * burnt("perforate", dash(10)[1]), material=level)[0] == []
    assert len(found([dash(10)], 2 * burnt("perforate", dash(10)[1]), material=level)[0]) == 1
    # The heights of one operation say nothing of another.
    cut = ("cut", [(30.0, 10.0), (35.0, 10.0)], -1, OUTLINE)
    says, _ = found(
        [dash(10), cut], at[0.0] + at[-0.5] + burnt("cut", cut[1], -0.5), material=material
    )
    assert len(says) == 2
