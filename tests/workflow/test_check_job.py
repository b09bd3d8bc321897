"""``check`` of a job directory: each fault that is put in is named, and none that is not there."""

from __future__ import annotations

import hashlib
import json
import re
import shutil

import pytest
import shapely
from piece_problems import gores, inside_circle, trimmed, two_pieces

import miurafab as mf
from miurafab.errors import InputError, LayoutError
from miurafab.fabrication.options import LayoutOptions
from miurafab.options import read_options, written_options
from miurafab.profiles import load_material

CASES = {
    "gores": (gores(3, 12, 3), {"border_tabs": "all", "tab_side": "alternate"}),
    "trimmed": (trimmed(), {"max_patch": (90, 60), "bridges": 2, "quantity": 2}),
    "knife": (gores(3, 12, 3), {"machine": "grbl-knife-a3", "join": "slots"}),
    "plotter": (
        inside_circle(two_pieces(5, 5, 2), 0.45),
        {"machine": "grbl-pen-a4", "full_facet": True},
    ),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("jobs") / "gores"
    pattern, options = CASES["gores"]
    mf.sheets(pattern, **options).write(folder)
    return folder


@pytest.fixture
def job(made, tmp_path):
    return shutil.copytree(made, tmp_path / "job")


def sentences(folder, code):
    found = mf.check_job(folder)
    assert not found.valid
    return [f.sentence for f in found.findings if f.code == code]


def edited(folder, name, change):
    """Change a file, and its sum in the manifest, as a forger would."""
    path = folder / name
    path.write_text(change(path.read_text()))
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["files"][name] = hashlib.sha256(path.read_bytes()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize("name", CASES)
def test_each_stroke_of_a_job_is_traced_to_the_pattern(name, tmp_path):
    pattern, options = CASES[name]
    job = mf.sheets(pattern, **options)
    job.write(tmp_path / "job")
    found = mf.check_job(tmp_path / "job")
    assert found.valid, found.findings
    of_layout = sum(found.traced.values()) - found.traced["aligning cut"]  # a knife's, beside it
    assert of_layout == sum(len(each) for each in job.layout.passes)
    copies = options.get("quantity", 1)
    assert found.traced["outline"] == len(job.layout.patches) * max(options.get("bridges", 1), 1)
    assert job.layout.copies == copies
    manifest = json.loads((tmp_path / "job" / "manifest.json").read_text())
    assert manifest["schema"] == "miurafab-job/1"
    assert read_options(LayoutOptions, manifest["options"]) == job.options
    on_disk = {path.name for path in (tmp_path / "job").iterdir()} - {"manifest.json"}
    assert set(manifest["files"]) == on_disk


def test_strokes_of_two_sides_and_several_passes_are_traced(tmp_path):
    shipped = load_material("card-250")
    assert shipped.beams["diode"].operations["cut"].passes == 1
    text = 'title = "Scored"\nthickness = "0.3mm"\nkerf = "0.15mm"\n' + (
        '[perforation]\ncut = "1.2mm"\ngap = "0.8mm"\nend_bridge = "0.6mm"\nmin_end = "0.5mm"\n'
        '[creases]\nrelief_hole = "0.5mm"\n[creases.valley]\nmode = "score"\n'
        '[tabs]\nheight = "7mm"\n'
        '[beams.diode]\nwavelength = 450\nlasers = ["5W", "10W"]\n'
        '[beams.diode.operations.score]\npower = "2.5W"\nfeed = "2400mm/min"\n'
        '[beams.diode.operations.perforate]\npower = "7W"\nfeed = "1500mm/min"\n'
        '[beams.diode.operations.cut]\npower = "8W"\nfeed = "900mm/min"\npasses = 2\n'
        '[beams.diode.operations.engrave]\npower = "1.5W"\nfeed = "3000mm/min"\n'
    )
    (tmp_path / "scored.toml").write_text(text)
    job = mf.sheets(gores(), material=tmp_path / "scored.toml", two_sided=True)
    job.write(tmp_path / "job")
    found = mf.check_job(tmp_path / "job")
    assert found.valid, found.findings
    assert found.traced["hole"] > 3, "relief and registration holes"
    once = re.sub(r"\(pass 2 of 2\)\n(G[01].*\n)+", "", (tmp_path / "job/sheet-01.nc").read_text())
    edited(tmp_path / "job", "sheet-01.nc", lambda _: once)
    found = sentences(tmp_path / "job", "stroke")
    assert sum("is not burnt" in sentence for sentence in found) == 5
    assert "more strokes" in found[-1]


def test_changed_missing_and_foreign_files_are_named(job):
    with (job / "sheet-01.nc").open("a") as file:
        file.write("(more)\n")
    (job / "sheet-01.svg").unlink()
    (job / "other.nc").write_text("M2\n")
    (job / "sheet-01.journal").write_text("")
    again = "since the job was made; make the job again."
    assert sentences(job, "edited") == [
        f"sheet-01.nc has changed {again}",
        f"sheet-01.svg was removed {again}",
        f"other.nc was added {again}",
    ]
    # The quick part before a cut has the same words.
    assert [found.sentence for found in mf.read_job(job).edits] == sentences(job, "edited")[:1]


LINE = re.compile(r"G0 X(\S+) Y(\S+)\nG1 X(\S+) Y(\S+)( S\d+)?( F\d+)?\n")


def dash(text):
    """The middle one of the absolute dashes of a program."""
    start = text.index("(operation perforate)")
    found = list(LINE.finditer(text, start))
    return found[len(found) // 2]


def test_a_stroke_that_is_moved_left_out_doubled_or_added_is_named(job):
    before = (job / "sheet-01.nc").read_text()
    at = dash(before)

    def moved(text):
        x, y = float(at[1]) + 0.1, float(at[3]) + 0.1
        line = at[0].replace(f"X{at[1]} ", f"X{x:.3f} ").replace(f"X{at[3]} ", f"X{y:.3f} ")
        return text[: at.start()] + line + text[at.end() :]

    edited(job, "sheet-01.nc", moved)
    line = before[: at.start()].count("\n") + 2
    found = sentences(job, "stroke")
    assert any(f"line {line} burns a stroke" in s for s in found)
    assert any("is not burnt" in s for s in found)
    edited(job, "sheet-01.nc", lambda _: before[: at.start()] + before[at.end() :])
    (found,) = sentences(job, "stroke")
    assert "is not burnt" in found
    edited(job, "sheet-01.nc", lambda _: before[: at.end()] + at[0] + before[at.end() :])
    (found,) = sentences(job, "stroke")
    assert "is burnt too often" in found
    label = "(operation engrave)\nG0 X300 Y300\nG1 X303 Y300 S150 F3000\n"
    edited(job, "sheet-01.nc", lambda _: before.replace("M5\nG0 X0 Y0", f"{label}M5\nG0 X0 Y0"))
    (found,) = sentences(job, "stroke")
    assert "X300.000 Y300.000" in found
    beyond = "(operation cut)\nG0 X400 Y399\nG1 X400.01 Y399 S800 F900\n"
    edited(job, "sheet-01.nc", lambda _: before.replace("M5\nG0 X0 Y0", f"{beyond}M5\nG0 X0 Y0"))
    assert sentences(job, "bounds")


def test_a_layout_that_is_not_of_the_pattern_is_named(job):
    before = (job / "layout.json").read_text()

    def with_(change):
        layout = json.loads(before)
        change(layout)
        edited(job, "layout.json", lambda _: json.dumps(layout))
        return sentences(job, "layout")

    def shifted(layout):
        tab = layout["patches"][0]["tabs"][0]
        tab["polygon_mm"] = [[x + 0.1, y] for x, y in tab["polygon_mm"]]

    assert with_(shifted) == ["The outline of P1 does not surround its facets and tabs."]
    assert "edge 9999" in with_(lambda layout: layout["patches"][0]["tabs"][0].update(edge=9999))[0]
    assert "each facet" in with_(lambda layout: layout["patches"][0]["faces"].pop())[0]
    for points in (
        lambda tab: tab[:1] * len(tab),
        lambda tab: tab[:1] + tab[:1] + tab[2:],
        lambda tab: tab[:2],
    ):

        def changed(layout, points=points):
            tab = layout["patches"][0]["tabs"][0]
            tab["polygon_mm"] = points(tab["polygon_mm"])

        assert "has no base" in with_(changed)[0]
    far = json.loads(before)
    far["patches"][0]["tabs"][0]["polygon_mm"][0][0] = 1e308
    edited(job, "layout.json", lambda _: json.dumps(far))
    with pytest.raises(LayoutError, match="a coordinate over"):
        mf.check_job(job)
    (bare,) = with_(lambda layout: layout["patches"][0]["tabs"].clear())[:1]
    assert "outline of P1" in bare or "no tab" in bare


def test_a_directory_without_a_job_or_a_manifest_is_refused(job, tmp_path):
    with pytest.raises(InputError, match=r"layout\.json is missing"):
        mf.check_job(tmp_path)
    (job / "manifest.json").write_text('{"schema": "miurafab-job/2"}')
    with pytest.raises(InputError, match="miurafab-job/2"):
        mf.check_job(job)
    (job / "manifest.json").unlink()
    with pytest.raises(InputError, match=r"manifest\.json does not exist"):
        mf.check_job(job)


KNIVES = {"hpgl-cutter-a3": "sheet-01.plt", "grbl-knife-a3": "sheet-01.nc"}


@pytest.fixture(scope="module", params=KNIVES)
def knife_job(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("knives") / request.param
    mf.sheets(trimmed(), machine=request.param).write(folder)
    return folder, KNIVES[request.param]


def knife_dash(text):
    """A straight cut of a knife: its lines, with the points of its two ends."""
    hpgl = re.compile(r"PU(\d+),(\d+);PD(\d+),(\d+);\n")
    gcode = re.compile(r"G0 X(\S+) Y(\S+)\nM3 S\d+\nG4 P\S+\nG1 X(\S+) Y(\S+)\nM3 S\d+\nG4 P\S+\n")
    found = list((hpgl if text.startswith("IN") else gcode).finditer(text))
    return found[len(found) // 2]


def test_the_tip_of_a_knife_is_traced_from_the_way_of_its_axis(knife_job, tmp_path):
    made, name = knife_job
    whole = mf.check_job(made)
    assert whole.valid, whole.findings
    assert whole.traced["aligning cut"] == 1
    assert whole.traced["outline"] == 1
    assert whole.traced["crease"] > 300
    job = shutil.copytree(made, tmp_path / "job")
    before = (job / name).read_text()
    at = knife_dash(before)
    step = 4 if name.endswith("plt") else 0.1

    def moved(text):
        line = at[0]
        for x in (at[1], at[3]):
            line = re.sub(
                rf"(?<![\d.]){re.escape(x)}(?![\d.])", f"{float(x) + step:g}", line, count=1
            )
        return text[: at.start()] + line + text[at.end() :]

    edited(job, name, moved)
    found = sentences(job, "stroke")
    assert any("burns a stroke" in each for each in found)
    assert any("is not burnt" in each for each in found)
    edited(job, name, lambda _: before[: at.start()] + before[at.end() :])
    assert any("is not burnt" in each for each in sentences(job, "stroke"))
    edited(job, name, lambda _: before[: at.end()] + at[0] + before[at.end() :])
    assert any("is burnt too often" in each for each in sentences(job, "stroke"))


def test_an_outline_without_its_overcut_is_named(tmp_path):
    job = mf.sheets(trimmed(), machine="grbl-knife-a3").write(tmp_path / "job").path
    lines = (job / "sheet-01.nc").read_text().splitlines(keepends=True)
    last = max(n for n, line in enumerate(lines) if line.startswith("G1"))
    short = "".join(lines[: last - 1] + lines[last + 1 :])  # the outline comes last
    edited(job, "sheet-01.nc", lambda _: short)
    left = short.splitlines()
    travel = max(n for n, line in enumerate(left[: last - 1]) if line.startswith("G0"))
    first = next(n for n in range(travel, last) if left[n].startswith("G1")) + 1
    assert sentences(job, "stroke") == [
        f"sheet-01: the stroke at line {first} goes round and not on by the overcut of 0.5 mm."
    ]
    (found,) = (each for each in mf.check_job(job).findings if each.code == "stroke")
    assert found.where == "sheet-01"


def test_a_window_of_a_file_without_facets_stays_open_and_is_cut_out(tmp_path):
    """hole.fold of the shared cases: a frame of four facets round a window whose edges are B."""
    square = [[0, 0], [3, 0], [3, 3], [0, 3]]
    inner = [[1, 1], [2, 1], [2, 2], [1, 2]]
    ring = [[k, (k + 1) % 4] for k in range(4)]
    file = tmp_path / "hole.fold"
    document = {
        "file_spec": 1.1,
        "vertices_coords": square + inner,
        "edges_vertices": ring + [[a + 4, b + 4] for a, b in ring] + [[k, k + 4] for k in range(4)],
        "edges_assignment": [*"BBBBBBBBMVMV"],
    }
    file.write_text(json.dumps(document))
    job = mf.sheets(file, scale=40)
    (patch,) = job.layout.patches
    assert not patch.tabs
    assert sorted(len(corners) for corners in job.pattern.faces_vertices.tolist()) == [4] * 4
    # The cut line keeps half a kerf outside the frame, and half a kerf inside the window.
    (window,) = patch.waste_mm
    for line, side in ((patch.outline_mm, 120.15), (window, 39.85)):
        assert shapely.Polygon(line).area == pytest.approx(side**2, abs=0.01)
    assert [round(each.length_mm, 9) for each in job.layout.borders] == [480.0, 160.0]
    job.write(tmp_path / "job")
    found = mf.check_job(tmp_path / "job")
    assert found.traced["outline"] == 2
    assert [each.code for each in found.findings if each.severity == "refusal"] == []
    layout = json.loads((tmp_path / "job" / "layout.json").read_text())
    layout["patches"][0]["waste_mm"][0][0][0] += 1.0
    edited(tmp_path / "job", "layout.json", lambda _: json.dumps(layout))
    assert sentences(tmp_path / "job", "layout") == [
        f"The outline of {patch.label} does not surround its facets and tabs."
    ]


def test_what_is_not_proven_is_said(tmp_path):
    mf.calibrate(tmp_path / "job")
    found = mf.check_job(tmp_path / "job")
    assert [f.sentence for f in found.findings if f.code == "not-proven"] == [
        "The strokes of a calibration sheet are not traced: no pattern stands behind them."
    ]
    assert found.traced == {}


def test_options_are_written_as_they_are_read():
    options = LayoutOptions(
        gap_mm=3.5, max_patch_mm=(200.0, 100.0), seam_rows=(2, 5), full_facet=True,
        offcuts_mm=((80.0, 40.0), (60.0, 30.0)), tab_angle=1.0, border_tabs=(1,),
    )  # fmt: skip
    again = read_options(LayoutOptions, json.loads(json.dumps(written_options(options))))
    assert again.tab_angle == pytest.approx(options.tab_angle, rel=1e-9)
    assert written_options(again) == written_options(options)
    assert written_options(LayoutOptions()) == {}
