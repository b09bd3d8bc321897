"""From a target to G-code, proved by reading the written files back with plain code."""

import json
import math
import shutil

import numpy as np
import pytest
from gcode_reader import read_strokes
from problems import regular, saddle_mesh

import miurafab
from miurafab.errors import InputError, LayoutError, ProfileError
from miurafab.profiles import shipped_directory

TARGETS = {"hypar": 8, "sphere": 6, "log-spiral": 8, "saddle.stl": 6}
"""Each with its facets along both sides."""


def turned(points, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return points @ np.array([[c, s], [-s, c]])


def to_pattern(points, placement, patch):
    """The contract of layout.json, backwards: sheet to pattern frame."""
    framed = turned(points - [placement["x_mm"], placement["y_mm"]], -placement["rotation_deg"])
    return turned(framed, -patch["rotation_deg"]) + patch["origin_mm"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The four targets, each fitted and laid out as files."""
    folder = tmp_path_factory.mktemp("made")
    saddle_mesh().export(folder / "saddle.stl")
    jobs = {}
    for target, facets in TARGETS.items():
        mesh = target.endswith(".stl")
        wanted = miurafab.design(
            str(folder / target) if mesh else target,
            facets=(facets, facets),
            size="250mm",
            **({"edge": "rectangle"} if mesh else {}),
        )
        result = miurafab.fit(wanted)
        assert result.status == "converged", result.advice
        name = target.partition(".")[0]
        fold = folder / f"{name}.fold"
        result.pattern.save(fold, title=wanted.title)
        job = folder / f"{name}-job"
        miurafab.sheets(fold, "grbl-laser-400", "card-250").write(job)
        jobs[target] = (fold, job)
    return jobs


@pytest.mark.parametrize("target", TARGETS)
def test_check_passes_from_the_file_alone(made, target):
    audit = miurafab.check(made[target][0])
    assert audit.valid
    measured = audit.measurements
    assert measured.facets == TARGETS[target] ** 2
    assert max(measured.max_planarity, measured.max_developability) <= 1e-10
    assert measured.max_isometry <= 1e-10
    assert (
        measured.hausdorff_relative < 2.0 / TARGETS[target]
    )  # half the corrugation; the spiral is tight


@pytest.mark.parametrize("target", TARGETS)
def test_every_file_ends_dark_and_stays_on_the_bed(made, target):
    _, job = made[target]
    files = sorted(job.glob("sheet-*.nc"))
    assert files
    for file in files:
        strokes, visited, switches = read_strokes(file.read_text())
        assert strokes
        assert visited.min() >= 0
        assert visited.max() <= 400
        assert switches[0] == 5
        assert switches[-1] in (2, 5)
        assert set(switches) <= {2, 4, 5}


@pytest.mark.parametrize("target", TARGETS)
def test_each_crease_and_each_outline_exactly_once(made, target):
    fold, job = made[target]
    document = json.loads(fold.read_text())
    layout = json.loads((job / "layout.json").read_text())
    flat = np.array(document["vertices_coords"])
    edges = np.array(document["edges_vertices"])
    folded = np.flatnonzero(np.isin(document["edges_assignment"], ["M", "V"]))
    tail, head = flat[edges[folded, 0]], flat[edges[folded, 1]]
    length = np.linalg.norm(head - tail, axis=1)
    along = (head - tail) / length[:, None]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    patches = {patch["label"]: patch for patch in layout["patches"]}
    dashes = {edge: [] for edge in range(len(folded))}
    outlines = []
    assert sum(len(sheet["placements"]) for sheet in layout["sheets"]) == len(patches)
    for sheet in layout["sheets"]:
        placed = {p["patch"]: p for p in sheet["placements"]}
        for stroke in read_strokes((job / f"{sheet['name']}.nc").read_text())[0]:
            patch = patches[stroke.patch]
            points = to_pattern(stroke.points, placed[patch["id"]], patch)
            if stroke.operation == "perforate":
                assert len(points) == 2
                off = np.abs(np.einsum("ek,enk->en", normal, points[None] - tail[:, None]))
                at = np.einsum("ek,enk->en", along, points[None] - tail[:, None])
                on = (off.max(axis=1) < 2e-3) & (at.min(axis=1) > 0) & (at.max(axis=1) < length)
                (edge,) = np.flatnonzero(on)
                dashes[edge].append((patch["id"], *sorted(at[edge])))
            elif stroke.operation == "cut":
                outlines.append((patch["id"], stroke.points, placed[patch["id"]]))
    # every crease: one patch, dashes that do not overlap, no gap longer than the rule's
    for edge, found in dashes.items():
        assert len({patch for patch, *_ in found}) == 1, f"crease {folded[edge]}"
        intervals = np.array(sorted((a, b) for _, a, b in found))
        assert (intervals[1:, 0] > intervals[:-1, 1]).all()
        gaps = np.append(intervals[:, 0], length[edge]) - np.append(0.0, intervals[:, 1])
        assert gaps.max() < 0.25 * length[edge] + 1.2
    # every outline: one closed stroke along the outline of the layout
    assert sorted(patch for patch, *_ in outlines) == sorted(p["id"] for p in layout["patches"])
    for number, points, placement in outlines:
        outline = np.array(layout["patches"][number]["outline_mm"])
        shift = np.array([placement["x_mm"], placement["y_mm"]])
        line = turned(outline, placement["rotation_deg"]) + shift
        assert np.allclose(points[0], points[-1])
        assert len(points) == len(line) + 1
        ring = points[:-1]
        start = int(np.argmin(np.linalg.norm(line - ring[0], axis=1)))
        same = np.roll(line, -start, axis=0)
        other = np.roll(same[::-1], 1, axis=0)
        assert min(np.abs(ring - same).max(), np.abs(ring - other).max()) <= 1e-3


@pytest.fixture
def small(tmp_path):
    """A pattern that takes one small sheet."""
    fold = tmp_path / "small.fold"
    regular().save(fold)
    return fold


def test_a_job_made_again_leaves_no_sheet_of_the_last(tmp_path, made, small):
    job = shutil.copytree(made["hypar"][1], tmp_path / "job")
    before = {file.name for file in job.iterdir()}
    miurafab.sheets(small, "grbl-laser-400", "card-250").write(job)
    assert {f.name for f in job.glob("sheet-*")} < before
    assert [f.name for f in job.glob("*.nc")] == ["sheet-01.nc"]


def test_foreign_gcode_in_the_directory_is_not_touched(tmp_path, small):
    (tmp_path / "mine.nc").write_text("G0 X1\n")
    with pytest.raises(InputError, match=r"mine\.nc"):
        miurafab.sheets(small, "grbl-laser-400", "card-250").write(tmp_path)
    assert (tmp_path / "mine.nc").read_text() == "G0 X1\n"
    assert not (tmp_path / "layout.json").exists()


def test_a_bed_smaller_than_a_facet_names_the_facet(tmp_path, made):
    fold, _ = made["hypar"]
    text = (shipped_directory("firmware_profiles") / "grbl-laser-400.toml").read_text()
    small = tmp_path / "small.toml"
    small.write_text(
        text.replace('"400mm"', '"14mm"').replace('\nmargin = "5mm"', '\nmargin = "1mm"')
    )
    with pytest.raises(LayoutError, match="facet"):
        miurafab.sheets(fold, str(small), "card-250").write(tmp_path / "job")


def test_an_own_machine_travels_with_the_job(tmp_path, small):
    text = (shipped_directory("firmware_profiles") / "grbl-laser-400.toml").read_text()
    own = tmp_path / "mine.toml"
    own.write_text(text.replace("Diode laser", "My laser"))
    miurafab.sheets(small, str(own), "card-250").write(tmp_path / "job")
    own.unlink()
    assert miurafab.read_job(tmp_path / "job").machine.title.startswith("My laser")
    with pytest.raises(ProfileError, match="mine"):
        miurafab.sheets(small, "mine", "card-250").write(tmp_path / "other")


def test_an_interrupted_job_is_no_job(tmp_path, made):
    job = shutil.copytree(made["hypar"][1], tmp_path / "job")
    (job / "layout.json").unlink()
    with pytest.raises(InputError, match="no whole job"):
        miurafab.read_job(job)
