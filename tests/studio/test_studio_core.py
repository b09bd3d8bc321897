"""The studio without a socket: every address, what is shown, one thing at a time, bad files."""

import gzip
import html.parser
import io
import json
import re
import tomllib
import zipfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from studios import KEY, Asked, Done, Waiting, request, saddle_obj, sentence

import miurafab
from miurafab.studio.core import PARTS
from miurafab.studio.messages import TYPES


class Tags(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))


def test_the_page_and_its_parts_are_served_under_a_strict_policy(asked):
    for name in ("", *PARTS):
        response = asked.get(name)
        assert response.status == 200
        assert response.body
        headers = response.all_headers
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Cache-Control"] == "no-store"
        assert headers["Referrer-Policy"] == "no-referrer"
        policy = headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self'")
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["Content-Type"] == TYPES[Path(name or "x.html").suffix]


def test_nothing_on_the_page_points_elsewhere(asked):
    for name in ("", *PARTS):
        text = asked.get(name).body.decode()
        text = text.replace("http://www.w3.org/2000/svg", "")
        assert not re.search(r"https?:|//[a-z]+\.|@import|url\(|style=|innerHTML|eval\(", text), (
            name
        )
    for _, attrs in Tags(asked.get().body.decode()).tags:
        assert not any(name.startswith("on") for name in attrs)
        for name in ("src", "href"):
            assert attrs.get(name, PARTS[0]) in PARTS


def test_every_control_has_a_name_and_every_name_is_there(asked):
    tags = Tags(asked.get().body.decode()).tags
    labelled = {attrs.get("for") for tag, attrs in tags if tag == "label"}
    for tag, attrs in tags:
        if tag in ("input", "select", "progress"):
            inside = attrs.get("type") == "checkbox"  # stands within its label
            assert inside or "aria-label" in attrs or attrs["id"] in labelled, attrs
        if tag == "iframe":
            assert attrs["sandbox"] == "allow-scripts"
            assert attrs["title"]
        if tag == "img":
            assert attrs["alt"]
    ids = [attrs["id"] for _, attrs in tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    scripts = "".join(asked.get(name).body.decode() for name in PARTS if name.endswith(".js"))
    assert set(re.findall(r'byId\("([^"]+)"\)', scripts)) <= set(ids)


def test_the_catalogue_is_what_the_commands_list(tmp_path):
    told = Asked(tmp_path, first={"surface": "vase", "parameters": {"neck": "0.4"}})
    found = told.get("catalogue").json()
    assert found["first"] == {"surface": "vase", "parameters": {"neck": "0.4"}}
    named = {surface["name"]: surface for surface in found["surfaces"]}
    assert {"plane", "hypar", "vase"} <= set(named)
    angle = next(p for p in named["vase"]["parameters"] if p["key"] == "angle")
    assert (angle["default"], angle["unit"], angle["high"]) == ("120", "deg", 360.0)
    assert named["vase"]["turned"]
    assert named["cylinder"]["turned"]
    assert not named["hypar"]["turned"]
    assert "grbl-laser-400" in {machine["name"] for machine in found["machines"]}
    assert found["material"] in {material["name"] for material in found["materials"]}


def test_a_fit_is_followed_and_ends_in_an_error(asked):
    assert asked.state()["task"] is None
    assert asked.fit("hypar", "6x6", min_edge="2mm").status == 200
    running = asked.orders[0]
    assert (running.order.do, running.order.target) == ("fit", "hypar")
    assert running.order.options == {"facets": "6x6", "min_edge": "2mm"}
    running.coming = [{"progress": 0.5, "note": "folding"}, {"progress": 0.2, "note": "again"}]
    task = asked.state()["task"]
    assert (task["running"], task["fraction"], task["note"]) == (True, 0.5, "again")
    assert "already" in sentence(asked.fit())
    assert "already" in sentence(asked.post("open", {"source": "1"}))
    assert len(asked.orders) == 1
    running.coming = [{"error": "It is too steep."}]
    task = asked.state()["task"]
    assert (task["running"], task["error"]) == (False, "It is too steep.")
    assert running.stopped
    assert not running.order.folder.exists()
    assert asked.fit().status == 200


def test_what_is_cancelled_is_stopped_and_leaves_what_was_there(done):
    done.fit()
    before = done.state()["pattern"]
    done.running = Waiting
    done.fit("hypar")
    running = done.orders[-1]
    assert done.post("cancel", {}).json()["task"]["cancelled"]
    assert running.stopped
    assert not running.order.folder.exists()
    assert done.state()["pattern"] == before
    assert done.get(before["files"]["fold"]).status == 200
    assert done.post("cancel", {}).status == 200  # there is nothing to cancel any more


def test_a_pattern_stays_when_only_its_folding_is_cancelled(asked):
    asked.fit("hypar")
    running = asked.orders[0]
    (running.order.folder / "hypar.fold").write_text("{}")
    report = {"status": "converged", "advice": "", "facets": 4, "vertices": 9}
    files = {"fold": "hypar.fold"}
    running.coming = [{"part": "pattern", "report": report, "findings": [], "files": files}]
    assert asked.state()["pattern"]["folding"]
    pattern = asked.post("cancel", {}).json()["pattern"]
    assert (pattern["folding"], pattern["still"]) == (False, "The folding was not computed.")
    assert asked.get(pattern["files"]["fold"]).status == 200


def test_from_a_surface_to_sheets(done):
    assert done.fit("hypar", "6x6", size="220mm").status == 200
    state = done.state()
    assert state["task"]["error"] == ""
    pattern = state["pattern"]
    assert pattern["status"] == "converged"
    assert pattern["headline"].endswith(".")
    assert pattern["command"] == "miurafab fit hypar --facets 6x6 --size 220mm -o hypar.fold"
    lines = {line["name"]: line for line in pattern["lines"]}
    assert lines["Flat facets"]["mark"] == lines["Folds from flat paper"]["mark"] == "good"
    assert lines["Facets"]["value"] == "36"
    fold = done.get(f"{pattern['files']['fold']}?save")
    assert fold.all_headers["Content-Disposition"].endswith("hypar.fold")
    assert json.loads(fold.body.read_bytes())["frame_classes"]
    page = done.get(pattern["files"]["page"])
    assert "sandbox allow-scripts" in page.all_headers["Content-Security-Policy"]
    assert b'"name":"Motion"' in page.body.read_bytes()
    assert b"<svg" in done.get(pattern["files"]["picture"]).body.read_bytes()

    options = {"gap": "3mm", "two_sided": False}
    wanted = {"machine": "grbl-laser-400", "material": "card-250", "options": options}
    assert done.post("sheets", wanted).status == 200
    job = done.state()["job"]
    lines = {line["name"]: line["value"] for line in job["lines"]}
    assert lines["Sheets"] == lines["Patches"] == "1"
    assert re.fullmatch(r"\d+:\d\d", lines["Machine time"])
    assert job["cut"] == "miurafab cut hypar-job --port /dev/ttyUSB0"
    assert job["command"] == (
        f"{pattern['command']} && miurafab sheets hypar.fold -o hypar-job "
        "--machine grbl-laser-400 --material card-250 --gap 3mm"
    )
    archive = zipfile.ZipFile(io.BytesIO(done.get(job["files"]["zip"]).body.read_bytes()))
    names = {"layout.json", "manifest.json", "assembly.pdf", "assembly.html", "hypar.fold"}
    names |= {"sheet-01.nc", "sheet-01.svg"}
    assert set(archive.namelist()) == {f"hypar-job/{name}" for name in names}
    assert done.get(job["files"]["guide"]).body.read_bytes().startswith(b"%PDF")
    assert b"sheet-01" in done.get(job["files"]["page"]).body.read_bytes()
    (picture,) = job["pictures"]
    assert b"perforate" in done.get(picture).body.read_bytes()

    design = done.get("design.toml")
    assert 'filename="hypar.toml"' in design.all_headers["Content-Disposition"]
    written = tomllib.loads(design.body.decode())
    assert written["target"] == {"surface": "hypar"}
    assert written["layout"] == {
        "machine": "grbl-laser-400", "material": "card-250", "gap": "3mm"
    }  # fmt: skip

    assert done.fit("plane").status == 200  # a new pattern takes the place of all of this
    state = done.state()
    assert state["job"] is None
    assert sentence(done.get(pattern["files"]["fold"]), 404)
    assert sentence(done.get(job["files"]["zip"]), 404)
    assert "layout" not in tomllib.loads(done.get("design.toml").body.decode())


def test_a_fit_that_misses_a_limit_says_so(done):
    assert done.fit("plane", "4x4", min_edge="900mm").status == 200
    pattern = done.state()["pattern"]
    assert pattern["status"] == "infeasible"
    assert pattern["headline"] == "A sheet was found, but it is not valid."
    assert "900 mm asked for" in pattern["advice"]
    done.post("sheets", {"machine": "grbl-laser-400", "material": "card-250"})
    job = done.state()["job"]
    assert job["doubts"][0] == f"{pattern['headline']} {pattern['advice']}"
    assert " -o plane.fold ; miurafab sheets" in job["command"]  # fit answers no


def test_where_no_sheet_was_found_there_is_nothing_to_lay_out(asked):
    asked.fit()
    report = miurafab.fit("hypar", facets="4x4", polish="off", timeout="0.000001").report()
    asked.orders[0].coming = [
        {"part": "pattern", "report": report, "findings": [], "files": {}},
        {"done": True},
    ]
    pattern = asked.state()["pattern"]
    assert pattern["headline"] == "No sheet was found."
    assert "ended the search before an exact sheet was found" in pattern["advice"]
    assert not pattern["folding"]
    wanted = {"machine": "grbl-laser-400", "material": "card-250"}
    assert "no pattern" in sentence(asked.post("sheets", wanted))


def test_a_layout_needs_a_pattern_and_says_why_it_cannot_be(done):
    wanted = {"machine": "grbl-laser-400", "material": "card-250"}
    assert "no pattern" in sentence(done.post("sheets", wanted))
    done.fit("plane", "2x2", size="5m")
    assert done.post("sheets", wanted).status == 200
    state = done.state()
    assert state["job"] is None
    assert state["task"]["error"].endswith(".")


def test_a_mesh_is_fitted_and_its_name_is_all_that_is_said_of_it(done):
    content = saddle_obj()
    given_file = done.upload("..%2FMy%20square.OBJ", content)
    assert given_file.status == 200
    assert given_file.json()["sources"] == [{"id": "1", "kind": "mesh", "name": "My-square.obj"}]
    target = {"source": given_file.json()["source"]}
    assert done.post("fit", {"target": target, "options": {"facets": "4x4"}}).status == 200
    state = done.state()
    assert state["task"]["error"] == ""
    pattern = state["pattern"]
    assert pattern["command"] == "miurafab fit My-square.obj --facets 4x4 -o My-square.fold"
    fold = json.loads(done.get(pattern["files"]["fold"]).body.read_bytes())
    assert fold["miurafab:target"]["mesh"] == "My-square.obj"
    assert tomllib.loads(done.get("design.toml").body.decode())["target"] == {
        "mesh": "My-square.obj"
    }


def test_a_pattern_is_opened_and_laid_out(tmp_path):
    first, second = (Asked(tmp_path / name, Done) for name in "ab" if not (tmp_path / name).mkdir())
    first.fit("plane", "6x4")
    fold = first.get(first.state()["pattern"]["files"]["fold"]).body.read_bytes()
    source = second.upload("plane%20one.fold", fold).json()["source"]
    assert second.post("open", {"source": source}).status == 200
    pattern = second.state()["pattern"]
    assert pattern["headline"] == "This pattern is sound."
    assert pattern["command"] == "miurafab check plane-one.fold"
    assert second.get(pattern["files"]["fold"]).body.read_bytes() == fold
    assert sentence(second.get("design.toml"), 404)
    second.post("sheets", {"machine": "grbl-laser-400", "material": "paper-100"})
    assert "plane-one.fold -o plane-one-job" in second.state()["job"]["command"]


def test_a_pattern_of_the_browser_reads_no_other_file(done, tmp_path):
    """Its target may be called a mesh anywhere on this computer; nobody looks there."""
    done.fit("plane", "4x4")
    fold = json.loads(done.get(done.state()["pattern"]["files"]["fold"]).body.read_bytes())
    secret = tmp_path / "secret.stl"
    secret.write_bytes(b"not to be read")
    secret.chmod(0)
    fold["miurafab:target"] = {"mesh": str(secret), "sha256": "0" * 64}
    source = done.upload("x.fold", json.dumps(fold).encode()).json()["source"]
    done.post("open", {"source": source})
    pattern = done.state()["pattern"]
    assert pattern["findings"][0]["sentence"] == (
        "Distances are left out: its target is a mesh, which is not in the file."
    )
    assert "secret" not in json.dumps(done.state())


@pytest.mark.parametrize(
    "name", ["x.nc", "x", "", "x.stl.exe", "%00.py", "x.gz", "x.exe.gz", "x.fold.gz"]
)
def test_other_files_are_not_taken(asked, name):
    assert "known files are" in sentence(asked.upload(name, b"content"))
    assert asked.state()["sources"] == []


def test_a_compressed_mesh_is_one(asked):
    asked.upload("My Saddle.OBJ.gz", gzip.compress(saddle_obj()))
    (source,) = asked.state()["sources"]
    assert (source["kind"], source["name"]) == ("mesh", "My-Saddle.obj.gz")


def test_an_empty_file_is_none(asked):
    assert "empty" in sentence(asked.upload("x.stl", b""))


@pytest.mark.parametrize(
    "content", [b"\x00" * 90, b"{}", b"solid x\nendsolid x\n", b"[1]", b"\xff"]
)
@pytest.mark.parametrize("name", ["x.fold", "x.stl", "x.obj", "x.glb"])
def test_a_broken_file_is_a_sentence(done, name, content):
    given_file = done.upload(name, content).json()
    if given_file["kind"] == "pattern":
        done.post("open", {"source": given_file["source"]})
    else:
        done.post("fit", {"target": {"source": given_file["source"]}})
    state = done.state()
    assert state["pattern"] is None
    assert state["task"]["error"].endswith(".")
    assert state["task"]["error"].startswith(name)


def test_the_oldest_file_goes(asked):
    for number in range(12):
        assert asked.upload(f"{number}.stl", b"x").status == 200
    kept = asked.state()["sources"]
    assert [source["name"] for source in kept] == [f"{n}.stl" for n in range(4, 12)]
    assert sentence(asked.post("fit", {"target": {"source": "1"}}))
    folders = list(asked.studio.bench._folder.iterdir())
    assert len(folders) == len(kept)


@settings(max_examples=40)
@given(st.text(), st.binary(max_size=60))
def test_no_address_and_no_body_break_it(tmp_path_factory, route, body):
    asked = Asked(tmp_path_factory.mktemp("studio"))
    for method in ("GET", "POST"):
        answer = asked.studio.handle(request(method, route, body))
        assert answer.status in (200, 400, 404)
        assert not asked.orders
    for path in (f"files/1/{route}", f"files/{route}/hypar.fold", f"../{route}", f"{route}.js"):
        assert sentence(asked.get(path.replace("?", "")), 404)


def test_nothing_but_what_was_put_down_is_found(done, tmp_path):
    (tmp_path / "1").mkdir(exist_ok=True)
    (tmp_path / "1" / "secret").write_text("x")
    done.studio.bench._numbers = 1
    done.fit()
    fold = done.state()["pattern"]["files"]["fold"]
    folder = fold.rsplit("/", 1)[0]
    for path in (
        "files/1/secret",
        f"{folder}/../1/secret",
        f"{folder}/..%2f1%2fsecret",
        f"{folder}/%2e%2e/1/secret",
        "files//etc/passwd",
        f"{fold}/",
        f"{KEY}/{fold}",
    ):
        assert sentence(done.get(path), 404)  # fmt: skip
    assert done.get(fold).status == 200
