"""Where names and labels are engraved, recomputed from the files of a job alone.

The front is the show side. A tab goes behind the facet that it is glued to: its own front, and the
back of that facet under it, are hidden.
"""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pypdf
import pytest
import shapely
from gcode_reader import read_strokes
from problems import regular

import miurafab as mf
from miurafab.errors import LayoutError
from miurafab.fabrication.lettering import text_strokes
from miurafab.profiles.shipped import shipped_directory

SCORED = (shipped_directory("materials") / "card-250.toml").read_text() + (
    '\n[creases.valley]\nmode = "score"\n'
)
JOBS = {
    "front": {},
    "back": {"ticks": 1},
    "tabs": {},
    "tabs of two sides": {"marks": "tabs", "two_sided": True},
    "none": {},
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("marks")
    (folder / "scored.toml").write_text(SCORED)
    for name, options in JOBS.items():
        job = mf.sheets(
            regular(7, 5),
            material=folder / "scored.toml",
            **{"marks": name, "max_patch": (60, 50), **options},
        )
        job.write(folder / name)
    return folder


def turned(points, degrees):
    a = math.radians(degrees)
    return np.asarray(points) @ np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]])


def engraved(folder):
    """The engraved strokes of each program, seen from the front of its sheet."""
    found = {}
    for sheet in json.loads((folder / "layout.json").read_text())["sheets"]:
        for name in filter(None, (sheet["back"], sheet["name"])):
            strokes = read_strokes((folder / f"{name}.nc").read_text())[0]
            lines = [np.array(s.points) for s in strokes if s.operation == "engrave"]
            if name == sheet["back"]:
                lines = [line * [-1.0, 1.0] + [sheet["width_mm"], 0.0] for line in lines]
            found[name] = lines
    return found


def tabs_and_strips(folder):
    """The tabs on each sheet, and where they lie under the facets that they are glued to."""
    layout = json.loads((folder / "layout.json").read_text())
    patches = {patch["id"]: patch for patch in layout["patches"]}
    placed = {p["patch"]: (s["name"], p) for s in layout["sheets"] for p in s["placements"]}

    def on_sheet(patch, points):
        name, place = placed[patch]
        moved = turned(
            np.asarray(points) - patches[patch]["origin_mm"], patches[patch]["rotation_deg"]
        )
        at = turned(moved, place["rotation_deg"]) + np.array([place["x_mm"], place["y_mm"]])
        return name, shapely.Polygon(at)

    tabs, strips = [], []
    for patch in patches.values():
        for tab in patch["tabs"]:
            assert tab["edge"] == tab["mate_edge"], "a seam within the pattern"
            flat = turned(tab["polygon_mm"], -patch["rotation_deg"]) + patch["origin_mm"]
            tabs.append(on_sheet(patch["id"], flat))
            strips.append(on_sheet(tab["mate_patch"], flat))
    return tabs, strips


def inside(lines, name, places):
    shapes = [shape.buffer(0.01) for sheet, shape in places if sheet == name]
    return [any(shape.covers(shapely.LineString(line)) for shape in shapes) for line in lines]


@pytest.mark.parametrize("name", JOBS)
def test_every_stroke_is_traced_and_the_show_side_is_clean(made, name):
    found = mf.check_job(made / name)
    assert found.valid, found.findings
    lines = engraved(made / name)
    tabs, strips = tabs_and_strips(made / name)
    assert len(tabs) == 4
    shown = [
        line
        for sheet, drawn in lines.items()
        if not sheet.endswith("-back")
        for line, hidden in zip(drawn, inside(drawn, sheet, tabs), strict=True)
        if not hidden
    ]
    behind = [line for sheet, drawn in lines.items() if sheet.endswith("-back") for line in drawn]
    assert bool(shown) == (name == "front")
    assert bool(behind) == (name in ("back", "tabs of two sides"))
    engraving = found.traced["label"] + found.traced["tick"]
    assert engraving == sum(map(len, lines.values()))
    assert bool(found.traced["tick"]) == ("ticks" in JOBS[name])
    if name == "tabs of two sides":
        for sheet, drawn in lines.items():
            if sheet.endswith("-back"):
                assert all(inside(drawn, sheet.removesuffix("-back"), strips))
    assert bool(lines["sheet-01"]) == (name in ("front", "tabs", "tabs of two sides"))


def test_what_is_engraved_on_the_back_reads_from_there(made):
    """The strokes of the program, as the back lies on the bed, are letters and no mirror images."""
    for name in ("front", "back"):
        (file,) = (made / name).glob("sheet-01-back.nc" if name == "back" else "sheet-01.nc")
        strokes = read_strokes(file.read_text())[0]
        lines = [
            np.array(s.points) for s in strokes if s.operation == "engrave" and s.patch == "P1"
        ]
        letter = text_strokes("P")[0]
        (stem,) = {
            k for k, line in enumerate(lines) if len(line) == len(letter) and _alike(line, letter)
        }
        one = text_strokes("P1")[1]
        assert _alike(lines[stem + 1], one)


def _alike(line, letter):
    """Whether ``line`` is ``letter``, scaled, and turned so that it reads rightwards or upwards."""
    if line.shape != letter.shape:
        return False
    there, here = (points[:, 0] + 1j * points[:, 1] for points in (line, letter))
    there, here = there - there.mean(), here - here.mean()
    factor = np.vdot(here, there) / np.vdot(here, here)
    reads = math.radians(-80.1) < np.angle(factor) < math.radians(100.1)
    return reads and np.abs(there - factor * here).max() < 0.01


def test_labels_that_are_not_engraved_are_listed_and_shown_in_the_guide(made):
    words = {}
    for name in ("front", "none"):
        layout = json.loads((made / name / "layout.json").read_text())
        words[name] = sorted(label["text"] for label in layout["absent_labels"])
        tabs = [tab for patch in layout["patches"] for tab in patch["tabs"]]
    letters = {"mountain": "M", "valley": "V"}
    every = [f"{tab['label']}{letters[tab['fold']]}" for tab in tabs]
    every += [tab["label"] for tab in tabs] + ["P1", "P2"]
    assert words == {"front": [], "none": sorted(every)}
    text = "\n".join(
        page.extract_text() for page in pypdf.PdfReader(made / "none/assembly.pdf").pages
    )
    assert len(re.findall(r"^[a-z]\d+[MV]?$", text, re.MULTILINE)) > 0


def test_a_layout_that_lists_other_labels_is_named(made, tmp_path):
    layout = made / "none" / "layout.json"
    before = layout.read_text()
    document = json.loads(before)
    document["absent_labels"].pop()
    layout.write_text(json.dumps(document))
    sentences = [finding.sentence for finding in mf.check_job(made / "none").findings]
    layout.write_text(before)
    assert any("absent" in sentence for sentence in sentences)


def test_marks_on_the_back_leave_the_shell_as_it_was(made):
    found = mf.rebuild(made / "back")
    assert found.measured == found.corners
    assert found.worst_mm < 0.05


def test_a_back_needs_room_for_its_holes():
    with pytest.raises(LayoutError, match="margin of 3 mm"):
        mf.sheets(regular(5, 5), marks="back", margin=1)
