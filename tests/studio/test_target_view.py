"""The target before and after its fit: what the page is sent, judged against the fit itself."""

import base64
import gzip
import io
import json
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mesh_shapes import kept, mesh, sheet
from PIL import Image
from studios import Done, saddle_obj, sentence

import miurafab
from miurafab.errors import TargetError
from miurafab.studio.mends import mends
from miurafab.studio.server import _put_on
from miurafab.studio.session import Bench
from miurafab.studio.target_view import MOST_SHOWN, compared, file_shown, shown, thinned
from miurafab.surfaces.catalogue import CATALOGUE


def unpacked(picture):
    """The arrays of a picture."""
    kinds = {"points": "<f4", "faces": "<u4", "flat": "<f4", "filled": "u1"}
    kinds |= {"deviation": "<f4", "missed": "u1"}
    found = {
        name: np.frombuffer(base64.b64decode(picture[name]), kind)
        for name, kind in kinds.items()
        if name in picture
    }
    shapes = {"points": (-1, 3), "faces": (-1, 3), "flat": (-1, 2)}
    return {name: array.reshape(shapes.get(name, -1)) for name, array in found.items()}


def areas(points, faces):
    a, b, c = points[faces].astype(float).transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def stl(name):
    """A mesh of the collection, or a saddle with a large hole, as a binary STL file."""
    made = trimesh.Trimesh(*(_with_hole() if name == "hole" else mesh(name)), process=False)
    return made.export(file_type="stl")


def _with_hole():
    whole = sheet(lambda u, v: np.stack([100 * u, 100 * v, 20 * u * v], axis=-1))
    return kept(whole, lambda points: np.hypot(points[:, 0], points[:, 1]) > 40)


def heights_png():
    shades = np.add.outer(np.arange(12), np.arange(9)) * 12
    held = io.BytesIO()
    Image.fromarray(shades.astype(np.uint8)).save(held, "PNG")
    return held.getvalue()


@pytest.mark.parametrize("name", list(CATALOGUE))
def test_a_surface_is_shown_where_it_is(name):
    """Each vertex is the surface at its place in the layout."""
    picture = shown(miurafab.design(name, facets=(8, 6)))
    found = unpacked(picture)
    surface = miurafab.design(name).request.surface
    d = surface.domain
    at = surface.point([d.u0, d.v0] + found["flat"].astype(float) * [d.width, d.height])
    size = np.linalg.norm(picture["size"])
    assert np.abs(found["points"] + picture["middle"] - at).max() < 1e-5 * size
    assert (found["flat"].min(), found["flat"].max()) == (0, 1)
    assert picture["facets"] == [8, 6]
    a, b, c = found["points"][found["faces"]].transpose(1, 0, 2)
    places = [d.u0, d.v0] + found["flat"][found["faces"][:, 0]] * [d.width, d.height]
    side = np.einsum("nk,nk->n", np.cross(b - a, c - a), surface.normal(places))
    assert (side > 0).mean() > 0.99  # the front of a triangle is the side of the normal


@pytest.mark.parametrize(("name", "kind"), [("cap-40", "disk"), ("vase", "tube"), ("egg", "tube")])
def test_a_mesh_is_shown_as_it_is_and_as_it_is_laid(tmp_path, name, kind):
    file = tmp_path / f"{name}.stl"
    file.write_bytes(stl(name))
    first = unpacked(file_shown(file))
    laid = shown(miurafab.design(file))
    assert laid["kind"] == kind
    second = unpacked(laid)
    whole, part = (areas(each["points"], each["faces"]).sum() for each in (first, second))
    lost = 0.03 if name == "egg" else 0.0  # two polar holes
    assert part == pytest.approx((1 - lost) * whole, rel=0.01)
    u, v = second["flat"].T
    if kind == "tube":
        assert 0 <= u.min() <= u.max() <= laid["girth"] * (1 + 1e-6)
        assert 0 <= v.min() <= v.max() <= laid["length"] * (1 + 1e-6)
        assert laid["gores"] >= 3
        assert len(laid["poles"]) == (2 if name == "egg" else 0)
    else:
        u0, u1, v0, v1 = laid["rectangle"]
        assert u.min() - 1 < u0 < u1 < u.max() + 1
        assert v.min() - 1 < v0 < v1 < v.max() + 1


@pytest.mark.parametrize(
    ("target", "options"),
    [("hypar", {}), ("vase", {}), ("cap-40", {}), ("cap-40", {"region": "0.4,0.6,0.3,0.7"})],
)
def test_colours_are_what_the_fit_reports(tmp_path, target, options):
    """The greatest deviation and the share that is covered, against the audit of the same sheet."""
    if target not in CATALOGUE:
        file = tmp_path / f"{target}.stl"
        file.write_bytes(stl(target))
        target = file
    wanted = miurafab.design(target, facets=(10, 10), **options)
    result = miurafab.fit(wanted)
    assert result.pattern is not None
    told = compared(result.pattern, wanted.request.surface)
    found = unpacked(told)
    report = result.report()
    assert told["most"] == pytest.approx(report["hausdorff_midsurface_mm"], rel=0.02)
    assert np.abs(found["deviation"]).max() <= told["most"] * (1 + 1e-6)
    area = areas(found["points"], found["faces"])
    covered = 1 - area[found["missed"] == 1].sum() / area.sum()
    assert covered == pytest.approx(report["coverage"], abs=0.03)
    if options:
        assert covered < 0.5


def test_the_colour_of_a_place_is_on_the_side_of_the_sheet():
    """A sheet that is moved along the normal of a plane has that deviation everywhere."""
    wanted = miurafab.design("plane", facets=(6, 6))
    pattern = miurafab.fit(wanted).pattern
    lifted = replace(pattern, folded_coords=pattern.folded_coords + np.array([0, 0, 3.0]))
    found = unpacked(compared(lifted, wanted.request.surface))
    assert np.abs(found["deviation"] - 3.0).max() < 1e-4


def test_a_large_mesh_is_shown_by_fewer_triangles():
    ball = trimesh.creation.icosphere(subdivisions=7)  # 327,680 triangles
    vertices, faces = thinned(np.asarray(ball.vertices), np.asarray(ball.faces), MOST_SHOWN)
    assert MOST_SHOWN / 3 < len(faces) < 1.5 * MOST_SHOWN
    assert np.abs(np.linalg.norm(vertices, axis=1) - 1).max() < 1e-9
    assert areas(vertices, faces).sum() == pytest.approx(4 * math.pi, rel=0.03)


@pytest.mark.parametrize(
    ("name", "options", "offered"),
    [
        ("hole", {}, ["keep", "all"]),
        ("cap-40", {"region": "0,1,0,1"}, [None]),
        ("cap-40", {"region": "0,1,0,1", "rotate": "30"}, [None]),
        ("torus", {}, []),
    ],
)
def test_each_button_mends_what_was_refused(tmp_path, name, options, offered):
    file = tmp_path / f"{name}.stl"
    file.write_bytes(stl(name))
    with pytest.raises(TargetError) as fault:
        miurafab.design(file, **options)
    found = mends(fault.value.sentence)
    assert len(found) == len(offered)
    for mend, value in zip(found, offered, strict=True):
        assert value in (None, mend["value"])
        miurafab.design(file, **options | {mend["option"]: mend["value"]})  # not refused any more


def test_a_sentence_without_a_remedy_has_no_button():
    assert mends("Ask for more `facets` or `pieces`, or lower `amplitude`; `holes` chooses.") == []


def test_a_surface_is_answered_at_once_and_a_refusal_in_words(asked):
    said = asked.post("target", {"target": {"surface": "hypar"}, "options": {}}).json()
    assert said["more"] is None
    assert said["picture"]["kind"] == "map"
    said = asked.post(
        "target", {"target": {"surface": "formula", "parameters": {"z": "x*"}}}
    ).json()
    assert said["refused"] == "The formula of z cannot be read: 'x*' ends too early."
    assert said["mends"] == []
    said = asked.post("target", {"target": {"source": "7"}}).json()
    assert said["refused"] == "That file is gone; choose it again."
    assert asked.orders == []
    assert asked.get("target/1").json() == {"gone": True}
    assert asked.get("target/x").json() == {"gone": True}


def test_a_mesh_is_answered_in_two_steps_and_only_the_newest(asked):
    source = asked.upload("saddle.obj", saddle_obj()).json()["source"]
    order = {"target": {"source": source}, "options": {"side": "inner", "facets": "9x9"}}
    first = asked.post("target", order).json()
    assert first["picture"]["kind"] == "file"
    assert asked.get(f"target/{first['more']}").json() == {"wait": True}
    running = asked.orders[0]
    assert (running.order.do, running.order.options) == (
        "place",
        {"side": "inner", "facets": "9x9"},
    )
    second = asked.post("target", order).json()
    assert running.stopped
    assert asked.get(f"target/{first['more']}").json() == {"gone": True}
    asked.orders[1].coming = [{"placed": {"kind": "disk", "findings": []}}, {"done": True}]
    for _ in range(2):
        told = asked.get(f"target/{second['more']}").json()
        assert told == {"kind": "disk", "findings": []}
    asked.post("target", {"target": {"surface": "hypar"}})
    assert asked.get(f"target/{second['more']}").json() == {"gone": True}


def test_a_large_mesh_is_read_by_the_process(asked, monkeypatch):
    monkeypatch.setattr("miurafab.studio.first_sight.AT_ONCE", 100)
    source = asked.upload("saddle.obj", saddle_obj()).json()["source"]
    first = asked.post("target", {"target": {"source": source}, "options": {}}).json()
    assert first["picture"] is None
    running, address = asked.orders[0], f"target/{first['more']}"
    assert running.order.file.read_bytes() == saddle_obj()
    told = Done(running.order).coming
    assert told[0]["shown"]["kind"] == "file"
    assert told[1]["placed"]["kind"] == "disk"
    running.coming = told[:1]
    assert asked.get(address).json() == {"wait": True, "picture": told[0]["shown"]}
    assert asked.get(address).json() == {"wait": True}
    running.coming = told
    assert asked.get(address).json()["kind"] == "disk"


@pytest.mark.parametrize("name", ["dem.png", "saddle.obj.gz", "box.3mf"])
def test_a_file_that_may_unpack_to_much_is_left_to_the_process(asked, name, monkeypatch):
    """Of an image the pixels count, as its first bytes tell; of a packed mesh nothing is read."""
    content = {"dem.png": heights_png(), "saddle.obj.gz": gzip.compress(saddle_obj())}.get(name)
    monkeypatch.setattr("miurafab.studio.first_sight.PIXELS", 100)
    source = asked.upload(name, content or b"PK").json()["source"]
    first = asked.post("target", {"target": {"source": source}, "options": {}}).json()
    assert first["picture"] is None
    assert [each.order.do for each in asked.orders] == ["place"]


def test_the_command_line_names_an_image_or_a_profile(tmp_path):
    """What the page starts with has the height of the image, and the points of the profile."""
    bench = Bench(tmp_path, None)
    (tmp_path / "dem.png").write_bytes(heights_png())
    (tmp_path / "cup.csv").write_text("r,z\n0.5,0\n0.8,1\n")
    image = _put_on(bench, f"{tmp_path / 'dem.png'}:height=4")
    assert image == {"source": "1", "parameters": {"height": "4"}}
    assert bench.sources["1"].kind == "image"
    drawn = _put_on(bench, f"revolution:profile={tmp_path / 'cup.csv'},angle=90")
    assert drawn["profile"] == [[0.5, 0.0], [0.8, 1.0]]
    assert drawn["parameters"] == {"angle": "90"}
    formula = _put_on(bench, "formula:z=min(x,y)")
    assert formula == {"surface": "formula", "parameters": {"z": "min(x,y)"}}
    with pytest.raises(TargetError, match="height=20"):
        _put_on(bench, str(tmp_path / "dem.png"))


@given(
    st.sampled_from([*CATALOGUE, "source"]),
    st.dictionaries(
        st.sampled_from(["z", "x", "u0", "angle", "height", "width"]),
        st.sampled_from(
            ["", "1", "-1", "2*pi", "x*y", "1/0", "x^99", "80deg", "nan", "(" * 99, "é"]
        ),
        max_size=3,
    ),
    st.none() | st.lists(st.lists(st.floats() | st.integers(), max_size=3), max_size=4),
    st.dictionaries(
        st.sampled_from(
            ["close", "side", "holes", "poles", "pieces", "region", "rotate", "facets"]
        ),
        st.sampled_from(["", "seam", "all", "1,2,3,4,5,6", "3", "0.1,0.9,0.1,0.9", "1e9", "8x8"]),
        max_size=3,
    ),
)
@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_whatever_is_asked_has_a_picture_or_one_sentence(asked, name, parameters, profile, options):
    target = {"source": "1"} if name == "source" else {"surface": name}
    target |= {"parameters": parameters} | ({} if profile is None else {"profile": profile})
    response = asked.post("target", {"target": target, "options": options})
    assert response.status == 200
    said = response.json()
    if "refused" in said:
        assert said["refused"].endswith(".")
        assert "`" not in said["refused"]
    else:
        assert np.isfinite(unpacked(said["picture"])["points"]).all()


def test_a_design_is_shown_as_what_it_names(asked, tmp_path):
    (tmp_path / "cap.stl").write_bytes(stl("cap-40"))
    for text, kind in (('surface = "vase"', "map"), ('mesh = "cap.stl"', "file")):
        file = tmp_path / f"{kind}.toml"
        file.write_text(f"[target]\n{text}\n")
        source = asked.studio.bench.add_own(file, "design").id
        said = asked.post("target", {"target": {"source": source}, "options": {}}).json()
        assert said["picture"]["kind"] == kind
        assert (said["more"] is None) == (kind == "map")


def test_a_refused_mesh_has_its_buttons_in_the_words_of_the_page(done):
    source = done.upload("hole.stl", stl("hole")).json()["source"]
    first = done.post("target", {"target": {"source": source}, "options": {}}).json()
    told = done.get(f"target/{first['more']}").json()
    assert told["refused"].startswith("hole.stl has a hole")
    assert "'Holes' keep cuts the sheet along it" in told["refused"]
    assert [mend["value"] for mend in told["mends"]] == ["keep", "all"]
    order = {"target": {"source": source}, "options": {"holes": "keep"}}
    told = done.get(f"target/{done.post('target', order).json()['more']}").json()
    assert told["kind"] == "disk"
    assert "kept open" in told["findings"][0]["sentence"]


def test_an_image_is_a_target_with_its_parameters(done):
    source = done.upload("dem.png", heights_png()).json()["source"]
    target = {"source": source, "parameters": {"height": "4", "spacing": "2mm"}}
    said = done.post("target", {"target": target, "options": {}}).json()
    assert said["picture"]["kind"] == "map"
    assert said["picture"]["size"][0] == pytest.approx(16)
    missing = done.post("target", {"target": {"source": source}, "options": {}}).json()
    assert "such as height=20" in missing["refused"]
    done.post("fit", {"target": target, "options": {"facets": "4x4"}})
    pattern = done.state()["pattern"]
    command = "miurafab fit dem.png:height=4,spacing=2mm --facets 4x4 -o dem.fold"
    assert pattern["command"] == command
    design = tomllib.loads(done.get("design.toml").body.decode())
    assert design["target"] == {"image": "dem.png", "height": "4", "spacing": "2mm"}
    mesh_source = done.upload("saddle.obj", saddle_obj()).json()["source"]
    wrong = {"target": {"source": mesh_source, "parameters": {"height": "4"}}, "options": {}}
    assert "image" in sentence(done.post("fit", wrong))


def test_a_drawn_profile_is_fitted_and_kept_in_the_design(done, tmp_path):
    points = [[0.6, 0], [0.9, 0.7], [0.5, 1.4]]
    target = {"surface": "revolution", "parameters": {"angle": "100"}, "profile": points}
    picture = done.post("target", {"target": target, "options": {}}).json()["picture"]
    drawn = unpacked(picture)["points"][:, 2] + picture["middle"][2]
    assert (drawn.min(), drawn.max()) == pytest.approx((0, 1.4), abs=1e-6)
    done.post("fit", {"target": target, "options": {"facets": "4x4"}})
    pattern = done.state()["pattern"]
    assert pattern["command"] == "miurafab fit revolution.toml -o revolution.fold"
    assert pattern["form"]["target"] == target
    assert pattern["subject"] == "revolution, angle 100 · Facets 4x4 · profile of 3 points"
    file = tmp_path / "revolution.toml"
    file.write_bytes(done.get("design.toml").body)
    again = miurafab.fit(file).pattern
    again.save(tmp_path / "again.fold", title="revolution")
    fold = done.get(pattern["files"]["fold"]).body
    assert fold.read_bytes() == (tmp_path / "again.fold").read_bytes()
    compared_file = done.get(pattern["files"]["target"])
    assert compared_file.content_type.startswith("application/json")
    assert json.loads(compared_file.body.read_bytes())["kind"] == "map"


@pytest.mark.parametrize(
    "profile", ["x.csv", [[1, 0]], [[1, 0], [1, "2"]], [[1, 0], [True, 1]], [[1, 0], [1, 2, 3]],
                [[1, 0], [1e300, 1]], [[1, 0]] * 201, {"1": 2}],
)  # fmt: skip
def test_a_profile_is_numbers(asked, profile):
    target = {"surface": "revolution", "profile": profile}
    assert "profile" in sentence(asked.post("fit", {"target": target, "options": {}}))


def test_no_other_surface_takes_a_profile(asked):
    target = {"surface": "hypar", "profile": [[1, 0], [1, 1]]}
    assert "profile" in sentence(asked.post("fit", {"target": target, "options": {}}))
