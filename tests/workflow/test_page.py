"""The page, taken apart: what it may load, what it holds, and (with a browser) that it draws."""

import base64
import hashlib
import html.parser
import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from piece_problems import gores
from PIL import Image
from problems import regular
from small_jobs import LASER, dashes, write_folder, write_nc

from miurafab.errors import InputError
from miurafab.findings import Finding
from miurafab.gcode.job import Job
from miurafab.gcode.program import strokes
from miurafab.geometry.polygons import edge_lengths
from miurafab.workflow.dry_run import LAYERS, dry_run
from miurafab.workflow.page import Slider, page_text, write_page
from miurafab.workflow.preview import Preview, preview


class Parts(html.parser.HTMLParser):
    """Every tag with its attributes, and the text inside styles and scripts."""

    def __init__(self, text):
        super().__init__()
        self.tags = []
        self.inside = []
        self.open = False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag in ("style", "script"):
            self.inside.append([tag, dict(attrs), ""])
            self.open = True

    def handle_endtag(self, _tag):
        self.open = False

    def handle_data(self, data):
        if self.open:
            self.inside[-1][2] += data


def data_of(text):
    return json.loads(next(t for tag, a, t in Parts(text).inside if a.get("id") == "data"))


def unpack(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def points(packed, box):
    low, size = np.split(np.array(box), 2)
    return low + unpack(packed, "<u2").reshape(-1, len(low)) / 65535 * size


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    return preview(write_folder(tmp_path_factory.mktemp("page") / "job", regular()))


def test_the_policy_names_its_script_and_style_and_allows_nothing_else(job):
    parts = Parts(page_text("job", job, job.pattern))
    policy = next(
        attrs["content"] for tag, attrs in parts.tags if attrs.get("http-equiv") is not None
    )
    (style,) = (text for tag, _, text in parts.inside if tag == "style")
    (script,) = (text for tag, attrs, text in parts.inside if tag == "script" and "id" not in attrs)
    digest = {
        name: base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        for name, text in (("style", style), ("script", script))
    }
    assert policy == (
        f"default-src 'none'; script-src 'sha256-{digest['script']}'; "
        f"style-src 'sha256-{digest['style']}'; base-uri 'none'; form-action 'none'"
    )


def test_nothing_on_the_page_points_elsewhere(job):
    text = page_text("job", job, job.pattern)
    assert not re.search(
        r"https?:|//[a-z]+\.|@import|url\(|fetch\(|XMLHttp|WebSocket|import\(", text
    )
    for tag, attrs in Parts(text).tags:
        assert tag not in {"link", "img", "iframe", "object", "embed", "base", "form"}
        assert not {"src", "href", "style"} & set(attrs)
        assert not any(name.startswith("on") for name in attrs)


def test_a_page_of_something_without_a_name_has_a_heading():
    text = page_text("", None, regular())
    assert "<title>Origami</title>" in text
    assert '<h1 id="title">Origami</h1>' in text


def test_every_control_has_a_name(job):
    text = page_text("job", job, job.pattern)
    parts = Parts(text)
    labelled = {attrs.get("for") for tag, attrs in parts.tags if tag == "label"}
    for tag, attrs in parts.tags:
        if tag in ("input", "select", "canvas"):
            assert "aria-label" in attrs or attrs["id"] in labelled, attrs
    ids = [attrs["id"] for _, attrs in parts.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    wanted = set(re.findall(r'byId\("([^"]+)"\)', text))
    assert wanted <= set(ids)


def test_the_sheets_are_the_moves(job):
    data = data_of(page_text("job", job, job.pattern))
    assert [sheet["name"] for sheet in data["sheets"]] == ["sheet-01", "sheet-02"]
    for sheet, shown in zip(job.sheets, data["sheets"], strict=True):
        track = points(shown["points"], shown["box"])
        size = max(shown["box"][2:])
        assert np.abs(track[:-1] - sheet.program.start[:, :2]).max() <= size / 65535
        assert np.abs(track[1:] - sheet.program.end[:, :2]).max() <= size / 65535
        assert np.array_equal(unpack(shown["layers"], "u1") & 127, sheet.layer)
        assert np.allclose(unpack(shown["ends"], "<f4"), sheet.end_seconds, rtol=1e-6)
        begins = np.flatnonzero(unpack(shown["layers"], "u1") & 128)
        assert begins.tolist() == strokes(sheet.program).first_move.tolist()
        assert shown["paper"] == [380.0, 300.0]
        assert shown["bed"] == [400.0, 400.0, 5.0]
        assert shown["lines"] == sheet.lines
    assert len(data["layers"]) == len(LAYERS) <= 8, "the shader has room for eight kinds"


def test_the_forms_are_the_pattern(job):
    pattern = job.pattern
    fold = data_of(page_text("job", job, pattern))["fold"]
    assert [form["name"] for form in fold["forms"]] == ["Flat", "Folded"]
    flat, folded = (points(form["points"], form["box"]) for form in fold["forms"])
    size = max(fold["forms"][0]["box"][3:])
    assert np.abs(flat[:, :2] - pattern.vertices_coords).max() <= size / 65535
    assert np.abs(folded - pattern.folded_coords).max() <= size / 65535
    edges = unpack(fold["edges"], "<u4").reshape(-1, 2)
    assert np.array_equal(edges, pattern.edges_vertices)
    corners = pattern.vertices_coords[unpack(fold["triangles"], "<u4").reshape(-1, 3)]
    sides = np.diff(corners, axis=1)
    assert (sides[:, 0, 0] * sides[:, 1, 1] > sides[:, 0, 1] * sides[:, 1, 0]).all()
    assert len(corners) == 2 * len(pattern.faces_vertices)
    letters = np.array(fold["assignments"])[unpack(fold["kinds"], "u1")]
    assert np.array_equal(letters, pattern.edges_assignment)
    ends = pattern.vertices_coords[pattern.edges_vertices]
    assert sum(fold["lengths"]) == pytest.approx(
        np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum(), abs=1e-2
    )


def test_nothing_between_flat_and_folded_unless_it_is_given():
    pattern = regular()
    assert [f["frames"] for f in data_of(page_text("a", None, pattern))["fold"]["forms"]] == [1, 1]
    flat_only = replace(pattern, folded_coords=None)
    assert len(data_of(page_text("a", None, flat_only))["fold"]["forms"]) == 1
    frames = np.stack([pattern.folded_coords * k for k in (0.5, 0.75, 1.0)])
    motion = data_of(page_text("a", None, pattern, frames))["fold"]["forms"][2]
    assert (motion["name"], motion["frames"]) == ("Motion", 3)
    read = points(motion["points"], motion["box"]).reshape(frames.shape)
    assert np.abs(read - frames).max() <= max(motion["box"][3:]) / 65535
    facets, edges = len(pattern.faces_vertices), len(pattern.edges_vertices)
    angles = np.linspace(-np.pi, np.pi, 3 * edges).reshape(3, edges)
    told = Slider(("flat", "half", "folded"), 2, angles, np.full((3, facets), 0.1))
    fold = data_of(page_text("a", None, pattern, frames, told))["fold"]
    assert (fold["names"], fold["start"]) == (["flat", "half", "folded"], 2)
    assert (fold["strain"]["most"], fold["rigid"]) == (0.1, False)
    assert set(unpack(fold["strain"]["values"], "<u2")) == {65535}
    shown = unpack(fold["forms"][2]["angles"], "<i2").reshape(3, edges) / 16383 * np.pi
    assert np.abs(shown - angles).max() <= 0.5 / 16383 * np.pi * 1.0001
    owners = unpack(fold["owners"], "<u4")
    corners = unpack(fold["triangles"], "<u4").reshape(-1, 3)
    for owner, corner in zip(owners, corners, strict=True):
        assert set(corner) < set(pattern.faces_vertices[owner])
    assert fold["forms"][0]["angles"] is None
    with pytest.raises(InputError, match="folding motion"):
        page_text("a", None, None, frames)


@pytest.mark.parametrize("name", ["</script><b>", "<!--", "a&b", '"x"', "@data@"])
def test_no_name_breaks_out_of_its_place(name):
    sheet = dry_run(name, Job(name, "(sheet x)\nG0 X1\n"), LASER, (400, 400))
    text = page_text(
        name, Preview(name, LASER, (sheet,), None, (Finding("pattern-missing", name),))
    )
    assert data_of(text)["sheets"][0]["name"] == name
    assert data_of(text)["findings"] == [name]
    tags = [tag for tag, _ in Parts(text).tags]
    assert tags.count("script") == 2
    assert "b" not in tags


def test_same_input_same_bytes(job, tmp_path):
    write_page(tmp_path / "a.html", title="job", preview=job, pattern=job.pattern)
    write_page(tmp_path / "b.html", title="job", preview=job, pattern=job.pattern)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    assert b"\r" not in (tmp_path / "a.html").read_bytes()


def test_a_move_costs_a_dozen_bytes(tmp_path):
    seen = preview(write_nc(tmp_path, dashes(2000)))
    empty = Preview(seen.name, seen.machine, (), None, ())
    size = len(page_text("a", seen)) - len(page_text("a", empty))
    assert size < 13 * len(seen.sheets[0].program) + 1500


@pytest.mark.skipif(shutil.which("node") is None, reason="no node to read the script")
def test_the_script_is_sound_javascript(job, tmp_path):
    parts = Parts(page_text("job", job, job.pattern))
    (script,) = (text for tag, attrs, text in parts.inside if tag == "script" and "id" not in attrs)
    (tmp_path / "page.js").write_text(script)
    subprocess.run(["node", "--check", tmp_path / "page.js"], check=True, timeout=60)


CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.mark.skipif(CHROMIUM is None, reason="no browser to open the page in")
def test_a_browser_draws_both_views(job, tmp_path):
    write_page(tmp_path / "page.html", title="job", preview=job, pattern=job.pattern)
    shot = tmp_path / "page.png"
    command = [
        *(CHROMIUM, "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"),
        *("--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-sync"),
        *("--disable-background-networking", "--disable-component-update", "--hide-scrollbars"),
        *("--window-size=1500,1100", f"--user-data-dir={tmp_path / 'profile'}"),
        *("--virtual-time-budget=3000", (tmp_path / "page.html").as_uri()),
    ]
    picture = [*command[:-1], f"--screenshot={shot}", command[-1]]
    subprocess.run(picture, check=True, timeout=120, capture_output=True)
    colours = {
        "#{:02x}{:02x}{:02x}".format(*colour)
        for _, colour in Image.open(shot).convert("RGB").getcolors(1 << 24)
    }
    assert {layer.colour for layer in LAYERS[2:5]} <= colours
    page = [*command[:-1], "--dump-dom", command[-1]]
    dom = subprocess.run(page, check=True, timeout=120, capture_output=True, text=True).stdout
    assert 'data-ready="sheets fold"' in dom
    assert "data-fault" not in dom
    assert "0:1" in dom.split('id="clock"')[1][:60]
    assert "stroke 4 of 4" in dom.split('id="clock"')[1][:90]


def test_seams_are_a_kind_of_their_own_with_the_length_of_one_side():
    pattern = gores()
    fold = data_of(page_text("gores", None, pattern))["fold"]
    letters = np.array(fold["assignments"])[unpack(fold["kinds"], "u1")]
    assert set(np.flatnonzero(letters == "S")) == set(pattern.seams.ravel())
    rest = letters != "S"
    assert (letters[rest] == pattern.edges_assignment[rest]).all()
    seam = edge_lengths(pattern.vertices_coords, pattern.edges_vertices[pattern.seams[:, 0]])
    assert fold["lengths"][fold["assignments"].index("S")] == pytest.approx(seam.sum(), abs=1e-3)
