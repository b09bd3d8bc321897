"""A small job of each kind of joint, changed in one place as a forger would, sums and all: what is
wrong is named, and nothing else is."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from problems import regular
from sealing import seal

import miurafab as mf
from miurafab.errors import InputError
from miurafab.workflow.check_job import JobCheck

Document = dict[str, Any]
FOLDER = TemporaryDirectory()
KINDS = {
    "glue": {"crease": 108, "label": 37, "tab fold": 24, "outline": 2},
    "slots": {"crease": 108, "label": 37, "tab fold": 9, "slot": 4, "outline": 2},
    "double": {"tab fold": 96, "crease": 84, "label": 80, "outline": 3},
}


@cache
def made(join: str) -> Path:
    """A Miura-ori of 16 facets in pieces that are held by ``join``."""
    folder = Path(FOLDER.name) / join
    mf.sheets(regular(5, 5), max_patch=(30, 60), join=join).write(folder)
    return folder


def forged(join: str, to: Path, change: Callable[[Document], object]) -> JobCheck:
    """The check of a job whose layout has a ``change``."""
    folder = shutil.copytree(made(join), to / "job")
    path = folder / "layout.json"
    layout = json.loads(path.read_text())
    change(layout)
    path.write_text(json.dumps(layout))
    seal(folder)
    return mf.check_job(folder)


def refused(found: JobCheck) -> list[str]:
    return [f"{each.code}: {each.sentence}" for each in found.findings if each.severity != "note"]


@pytest.mark.parametrize("join", KINDS)
def test_a_whole_job_has_each_stroke_traced(join: str, tmp_path: Path) -> None:
    found = forged(join, tmp_path, lambda layout: None)
    assert refused(found) == []
    assert found.valid
    assert found.traced == KINDS[join]
    assert found.report()["traced"] == KINDS[join]


def tab(layout: Document, number: int = 0, patch: int = 0) -> Document:
    found: Document = layout["patches"][patch]["tabs"][number]
    return found


def moved(part: Document, x: float, y: float) -> None:
    part["polygon_mm"] = [[a + x, b + y] for a, b in part["polygon_mm"]]


def scaled(part: Document, factor: float) -> None:
    """Wider across its edge, the base as it is."""
    points = np.array(part["polygon_mm"])
    points[2:, 0] = points[0, 0] + factor * (points[2:, 0] - points[0, 0])
    part["polygon_mm"] = points.tolist()


def corner(part: Document, number: int, by: float) -> None:
    """Move a corner of an outline along x."""
    part["outline_mm"][number][0] += by


def absent(layout: Document) -> None:
    label = {"patch": 0, "text": "P1", "x_mm": 1.0, "y_mm": 1.0, "height_mm": 2.0}
    layout["absent_labels"].append(label | {"rotation_deg": 0.0})


def narrow(part: Document) -> None:
    """A head that is no wider than its neck."""
    part["polygon_mm"][2:] = [[22.9, 5.0], [25.2, 5.5], [25.2, 9.0], [22.9, 9.5]]


def into_other_patch(layout: Document) -> None:
    one, other = layout["patches"]
    one["slots"].append(other["slots"].pop(0))


P1 = "The outline of P1 does not surround its facets and tabs."
NO_SLOT = "Tab a1 has no slot at the edge that it is joined to."
FOREIGN = "The slot for tab {} in P2 is for no tab of its own."
MIRROR = "Tab a1 is not the mirror image of the tab that it is glued to."
ONCE = "The patches of the layout do not hold each facet of the pattern once."
OTHER = "Tab a1 stands on edge {}, of another patch."


def slot(layout: Document) -> Document:
    found: Document = layout["patches"][1]["slots"][0]
    return found


def slot_of_a1() -> Document:
    return slot(json.loads((made("slots") / "layout.json").read_text()))


FORGED: dict[str, tuple[str, Callable[[Document], object], list[str], bool]] = {
    "unplaced": (
        "glue",
        lambda d: d["sheets"][0]["placements"].pop(),
        ["The layout does not place each patch once on a sheet."],
        False,
    ),
    "edge too large": (
        "glue",
        lambda d: tab(d).update(edge=40),
        ["Tab a1 names edge 40, which is not there."],
        False,
    ),
    "edge elsewhere": ("glue", lambda d: tab(d).update(edge=24), [OTHER.format(24)], False),
    "mate too large": (
        "glue",
        lambda d: tab(d).update(mate_edge=40),
        ["Tab a1 names edge 40, which is not there."],
        False,
    ),
    "mate elsewhere": ("glue", lambda d: tab(d).update(mate_edge=20), [OTHER.format(20)], False),
    "facet left out": ("glue", lambda d: d["patches"][0]["faces"].pop(), [ONCE], False),
    "facet twice": ("glue", lambda d: d["patches"][0]["faces"].append(2), [ONCE], False),
    "patch number": (
        "glue",
        lambda d: d["patches"][0].update(id=1),
        ["The patches of the layout are not numbered from 0 in their order."],
        False,
    ),
    "tab off its edge": (
        "glue",
        lambda d: moved(tab(d), 0.0, 2.0),
        [
            "Tab a1 does not stand on its edge.",
            "Tab a1 does not fit the facet that it is glued to.",
            P1,
        ],
        True,
    ),
    "tab too long": (
        "glue",
        lambda d: scaled(tab(d), 2.0),
        ["Tab a1 does not fit the facet that it is glued to.", P1],
        True,
    ),
    "tab of three corners": (
        "glue",
        lambda d: tab(d).update(polygon_mm=tab(d)["polygon_mm"][:3]),
        [P1],
        True,
    ),
    "tab left out": (
        "glue",
        lambda d: d["patches"][0]["tabs"].pop(0),
        ["1 seam edge has no tab, and no finding says so, the first is edge 22.", P1],
        True,
    ),
    "two tabs left out": (
        "glue",
        lambda d: d["patches"][0].update(tabs=d["patches"][0]["tabs"][2:]),
        ["2 seam edges have no tab, and no finding says so, the first is edge 22.", P1],
        True,
    ),
    "tab held otherwise": (
        "glue",
        lambda d: tab(d).update(join="slots"),
        ["Tab a1 is not held as the options of the job say."],
        False,
    ),
    "fold": (
        "glue",
        lambda d: tab(d).update(fold="valley"),
        ["Tab a1 is told to fold valley, and its edge is M."],
        False,
    ),
    "kit": (
        "glue",
        lambda d: d["kit"]["rows"][0].update(median_deg=40.0),
        ["The rows and angles of the folder's kit are not those of the pattern."],
        False,
    ),
    "no kit": ("glue", lambda d: d.pop("kit"), [], False),
    "absent label": (
        "glue",
        absent,
        ["The labels that the layout calls absent are not those without room."],
        False,
    ),
    "outline": ("glue", lambda d: corner(d["patches"][0], 3, 5.0), [P1], True),
    "outline by little": ("glue", lambda d: corner(d["patches"][0], 3, 0.005), [P1], True),
    "place": (
        "glue",
        lambda d: d["sheets"][0]["placements"][0].update(x_mm=57.432),
        [],
        True,
    ),
    "turn": (
        "glue",
        lambda d: d["sheets"][0]["placements"][0].update(rotation_deg=89.9),
        [],
        True,
    ),
    "no slot": ("slots", lambda d: d["patches"][1]["slots"].pop(0), [NO_SLOT], False),
    "slot moved": (
        "slots",
        lambda d: moved(slot(d), 0.001, 0.0),
        ["The slot for tab a1 is not the one that its tab goes through."],
        False,
    ),
    "slot moved by little": (
        "slots",
        lambda d: moved(slot(d), 0.00015, 0.0),
        ["The slot for tab a1 is not the one that its tab goes through."],
        False,
    ),
    "slot of another tab": (
        "slots",
        lambda d: slot(d).update(tab=2),
        [FOREIGN.format("a1"), FOREIGN.format("a2"), NO_SLOT],
        False,
    ),
    "slot of no tab": (
        "slots",
        lambda d: slot(d).update(tab=9),
        [FOREIGN.format("a1"), NO_SLOT],
        False,
    ),
    "slot of no tab with the last label": (
        "slots",
        lambda d: d["patches"][0]["slots"][0].update(tab=9),
        [FOREIGN.format("a4").replace("P2", "P1"), NO_SLOT.replace("a1", "a4")],
        False,
    ),
    "slot of a job without slots": (
        "glue",
        lambda d: d["patches"][1]["slots"].append(slot_of_a1()),
        [FOREIGN.format("a1")],
        False,
    ),
    "no slot, and another that moved": (
        "slots",
        lambda d: (d["patches"][1]["slots"].pop(0), moved(slot(d), 0.001, 0.0)),
        [NO_SLOT, "The slot for tab a2 is not the one that its tab goes through."],
        False,
    ),
    "two slots that moved": (
        "slots",
        lambda d: [moved(each, 0.001, 0.0) for each in d["patches"][1]["slots"][:2]],
        [
            f"The slot for tab {each} is not the one that its tab goes through."
            for each in ("a1", "a2")
        ],
        False,
    ),
    "slot of another label": (
        "slots",
        lambda d: slot(d).update(label="b9"),
        [FOREIGN.format("b9")],
        False,
    ),
    "slot at another edge": ("slots", lambda d: slot(d).update(edge=27), [NO_SLOT], False),
    "slot for another patch": ("slots", lambda d: slot(d).update(mate_patch=1), [NO_SLOT], False),
    "slot in another patch": ("slots", into_other_patch, [NO_SLOT], False),
    "slot of five corners": (
        "slots",
        lambda d: slot(d)["polygon_mm"].append([7.3, 3.0]),
        [NO_SLOT],
        False,
    ),
    "tab of four corners": (
        "slots",
        lambda d: tab(d).update(polygon_mm=tab(d)["polygon_mm"][:4]),
        ["Tab a1 is no tab for a slot: it has not six corners."],
        False,
    ),
    "narrow head": (
        "slots",
        lambda d: narrow(tab(d)),
        ["The slot for tab a1 is not the one that its tab goes through.", P1],
        True,
    ),
    "no mate": (
        "double",
        lambda d: d["patches"][0]["tabs"].pop(0),
        ["Tab a1 has no mate on the other side of its seam.", P1],
        True,
    ),
    "mirror": ("double", lambda d: scaled(tab(d), 0.99), [MIRROR, MIRROR, P1], True),
    "no mate, and another that is no mirror": (
        "double",
        lambda d: (d["patches"][2]["tabs"].pop(0), scaled(tab(d, 1, 1), 0.99)),
        [
            MIRROR.replace("a1", "b2"),
            "Tab b4 has no mate on the other side of its seam.",
            MIRROR.replace("a1", "b2"),
            P1.replace("P1", "P2"),
            P1.replace("P1", "P3"),
        ],
        True,
    ),
    "held by glue": (
        "double",
        lambda d: tab(d).update(join="glue"),
        [
            "Tab a1 is not held as the options of the job say.",
            "Tab a1 is told to fold mountain, and its edge is V.",
        ],
        True,
    ),
}


@pytest.mark.parametrize("name", FORGED)
def test_what_is_wrong_in_a_layout_is_named(name: str, tmp_path: Path) -> None:
    join, change, says, strokes = FORGED[name]
    found = refused(forged(join, tmp_path, change))
    assert [each.removeprefix("layout: ") for each in found if "stroke: " not in each] == says
    assert any(each.startswith("stroke: ") for each in found) is strokes


# The manifest


@pytest.fixture
def job(tmp_path: Path) -> Path:
    return shutil.copytree(made("glue"), tmp_path / "job")


def rewritten(folder: Path, **values: object) -> JobCheck:
    """The check of a job whose manifest says ``values``."""
    path = folder / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | values))
    return mf.check_job(folder)


AGAIN = "since the job was made; make the job again."


def test_a_job_of_another_version_is_no_worse_and_says_so(job: Path) -> None:
    found = rewritten(job, tool="miurafab 0.0.1" + 86 * "x")
    assert found.valid
    (said,) = (each for each in found.findings if each.code == "job-version")
    assert said.sentence.startswith("The job was made by miurafab 0.0.1xx")
    assert said.sentence.endswith(f"and is checked by miurafab {mf.__version__}.")
    assert said.where == "manifest.json"
    with pytest.raises(InputError, match="'tool' is no name and version"):
        rewritten(job, tool="miurafab 0.0.1" + 87 * "x")


def test_a_profile_that_is_not_that_of_the_job_is_named(job: Path) -> None:
    profiles = json.loads((job / "manifest.json").read_text())["profiles"]
    name = "materials/card-250.toml"
    assert refused(rewritten(job, profiles=profiles | {name: 64 * "0"})) == [
        f"edited: {name} has changed {AGAIN}"
    ]
    gone = profiles | {"materials/of-nobody.toml": 64 * "0"}
    assert refused(rewritten(job, profiles=gone)) == [
        f"edited: materials/of-nobody.toml was removed {AGAIN}"
    ]
    with pytest.raises(InputError, match="profiles of the kind 'spindles', which there is not"):
        rewritten(job, profiles=profiles | {"spindles/a.toml": 64 * "0"})


def test_each_way_in_which_a_file_is_not_that_of_the_manifest_has_its_word(job: Path) -> None:
    (job / "sheet-01.svg").unlink()
    (job / "sheet-01.svg").mkdir()
    for name in ("a.NC", "b.plt", "c.hpgl", "d.gcode", "e.txt"):
        (job / name).write_text("M2\n")
    (job / "sheet.fold").write_text((job / "sheet.fold").read_text() + " ")
    found = refused(mf.check_job(job))
    assert sorted(each for each in found if each.startswith("edited: ")) == [
        *(f"edited: {name} was added {AGAIN}" for name in ("a.NC", "b.plt", "c.hpgl", "d.gcode")),
        f"edited: sheet-01.svg is no file any more {AGAIN}",
        f"edited: sheet.fold has changed {AGAIN}",
    ]


def test_a_manifest_that_does_not_name_the_pattern_of_the_layout_is_refused(job: Path) -> None:
    files = json.loads((job / "manifest.json").read_text())["files"]
    del files["sheet.fold"]
    with pytest.raises(InputError, match=r"does not name sheet\.fold, the pattern of the layout"):
        rewritten(job, files=files)


def test_an_option_that_is_none_is_named_with_the_manifest(job: Path) -> None:
    with pytest.raises(InputError, match=r"manifest\.json.*max_patches"):
        rewritten(job, options={"max_patches": "30x60"})


@pytest.mark.parametrize("schema", ["miurafab-job/2", "", None])
def test_another_schema_is_refused_by_its_name(job: Path, schema: str | None) -> None:
    with pytest.raises(InputError, match=r"has the schema .*; this version reads 'miurafab-job/1'"):
        rewritten(job, schema=schema)


def test_an_absent_label_that_runs_to_the_left_is_the_same_by_either_name_of_half_a_turn(
    tmp_path: Path,
) -> None:
    """Rounding decides between 180 and -180 degrees."""
    pattern = regular(5, 5)
    c, s = np.cos(np.radians(75.0)), np.sin(np.radians(75.0))
    flat = pattern.vertices_coords @ np.array([[c, s], [-s, c]])
    turned = replace(pattern, vertices_coords=flat)
    mf.sheets(turned, marks="none", seam_columns=(2,), rotations=(180,)).write(tmp_path / "job")
    layout = json.loads((tmp_path / "job" / "layout.json").read_text())
    assert {abs(each["rotation_deg"]) for each in layout["absent_labels"]} == {180.0}
    assert refused(mf.check_job(tmp_path / "job")) == []
    layout["absent_labels"][0]["rotation_deg"] -= 360.001
    (tmp_path / "job" / "layout.json").write_text(json.dumps(layout))
    seal(tmp_path / "job")
    assert refused(mf.check_job(tmp_path / "job")) == [
        "layout: The labels that the layout calls absent are not those without room."
    ]
