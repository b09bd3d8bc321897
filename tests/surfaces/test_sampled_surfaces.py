"""Targets from functions, grids of points and heights, against the formulas they are made from."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from miurafab.errors import PatternError, TargetError
from miurafab.surfaces.description import described_surface
from miurafab.surfaces.function import SampledSurface, from_function, from_points
from miurafab.surfaces.height_field import from_heights, read_image
from miurafab.surfaces.mesh import load_mesh


def bump(x, y):
    return 0.4 * np.exp(-(x**2 + y**2))


WAYS = {
    "tuple of arrays": lambda u, v: (u, v, bump(u, v)),
    "stacked at the end": lambda u, v: np.stack([u, v, bump(u, v)], axis=-1),
    "stacked at the front": lambda u, v: np.stack([u, v, bump(u, v)]),
    "a height": bump,
    "a height of numbers": lambda u, v: 0.4 * math.exp(-(u * u + v * v)),
    "a list, one point at a time": lambda u, v: [u, v, 0.4 * math.exp(-(u * u + v * v))],
    "branches": lambda u, v: (u, v, bump(u, v)) if u < 9 else (u, v, 0),
    "wrong with arrays": lambda u, v: (u, v, bump(np.linalg.norm([u, v]), 0.0)),
}


@pytest.mark.parametrize("way", WAYS)
def test_every_way_to_write_a_function_gives_the_same_surface(way):
    surface, findings = from_function(WAYS[way])
    assert findings == ()
    uv = surface.domain.lattice(23, 19)
    wanted = np.stack([uv[..., 0], uv[..., 1], bump(uv[..., 0], uv[..., 1])], axis=-1)
    assert np.abs(surface.point(uv) - wanted).max() < 3e-5


def test_the_normal_and_the_nearest_point_are_those_of_the_formula():
    surface, _ = from_function(lambda u, v: (np.sin(u), v, np.cos(u)), (-1, 1, 0, 2))
    uv = surface.domain.lattice(7, 5).reshape(-1, 2)
    normal = np.stack([np.sin(uv[:, 0]), 0 * uv[:, 0], np.cos(uv[:, 0])], axis=1)
    assert np.abs(surface.normal(uv) - normal).max() < 1e-4
    off = surface.point(uv) + 0.1 * normal
    assert np.abs(surface.closest_point(off) - surface.point(uv)).max() < 1e-4


@settings(max_examples=20, deadline=None)
@given(st.floats(0.5, 3.0), st.floats(0.1, 0.5))
def test_the_file_gives_the_same_surface_again(turns, height):
    surface, _ = from_function(lambda u, v: height * np.sin(turns * u) * v)
    again, findings = described_surface(json.loads(json.dumps(surface.description)))
    assert findings == ()
    assert isinstance(again, SampledSurface)
    uv = surface.domain.lattice(9, 9)
    np.testing.assert_array_equal(again.point(uv), surface.point(uv))


def test_a_function_is_left_alone_where_it_has_no_values():
    surface, _ = from_function(lambda u, v: math.sqrt(2 - u * u - v * v), (-1, 0.999, -1, 0.999))
    assert surface.span == surface.domain


def test_a_function_that_turns_too_fast_says_so():
    _, (finding,) = from_function(lambda u, v: 0.1 * np.sin(60 * u))
    assert finding.code == "sampling"
    assert "turns faster than" in finding.sentence
    assert finding.severity == "warning"


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda u: u, "takes 1 positional argument"),
        (lambda u, v: None, "returns None"),
        (lambda u, v: (u, v), "must return a point"),
        (lambda u, v: 1 / (u + 1), "ZeroDivisionError"),
        (lambda u, v: (u, u, u), "no tangent plane"),
        (lambda u, v: "abc", "returns 'abc'"),
        (lambda u, v: 1j * u, "must return a point"),
        (lambda u, v: np.nan, "no finite value"),
    ],
)
def test_a_function_that_is_no_surface_is_refused(function, words):
    with pytest.raises(TargetError, match=words):
        from_function(function)


@pytest.mark.parametrize("domain", [3, "abc", (0, 1), (1, 0, 0, 1), (0, math.inf, 0, 1), None])
def test_a_domain_that_is_none_is_refused(domain):
    with pytest.raises(TargetError, match="The domain is"):
        from_function(bump, domain)


def test_a_grid_of_points_is_met_in_its_points():
    y, x = np.mgrid[0:6, 0:9].astype(float)
    points = np.stack([x, y, np.sin(x / 3)], axis=-1)
    surface = from_points(points)
    at = np.stack([x, y], axis=-1)
    assert np.abs(surface.point(at) - points).max() < 1e-7


def test_heights_are_met_and_noise_is_smoothed_and_told():
    x, y = np.meshgrid(np.linspace(-1, 1, 60), np.linspace(-1, 1, 50))
    heights = 20 * bump(x, y)
    surface, findings = from_heights(heights, spacing=2.0)
    assert findings == ()
    at = np.array([[2.0 * 31, 2.0 * 17], [2.0 * 5, 2.0 * 44]])
    assert np.abs(surface.point(at)[:, 2] - heights[[17, 44], [31, 5]]).max() < 0.02
    rough = heights + np.random.default_rng(1).normal(0, 1.0, heights.shape)
    _, (finding,) = from_heights(rough, spacing=2.0)
    assert finding.code == "smoothed"
    assert "was smoothed" in finding.sentence


def test_an_image_of_too_many_pixels_is_not_unpacked(tmp_path: Path):
    """A file of 40 kB that would become 3 GB of heights."""
    file = tmp_path / "bomb.png"
    Image.new("1", (16_000, 10_000)).save(file)
    with pytest.raises(TargetError, match="16000 x 10000 pixels; scale it to 40,000,000"):
        read_image(file, 1.0)


def test_an_image_is_heights_with_its_lowest_row_first(tmp_path: Path):
    shades = np.zeros((40, 30), dtype=np.uint8)
    shades[0] = 255
    Image.fromarray(shades).save(tmp_path / "a.png")
    heights = read_image(tmp_path / "a.png", height=20)
    assert heights.shape == (40, 30)
    assert (heights[-1] == 20).all()
    assert (heights[:-1] == 0).all()
    Image.fromarray(shades.astype(np.float32) / 10).save(tmp_path / "b.tif")
    assert read_image(tmp_path / "b.tif").max() == pytest.approx(25.5)
    with pytest.raises(TargetError, match="holds heights"):
        read_image(tmp_path / "b.tif", height=3)
    with pytest.raises(TargetError, match="say how high white is"):
        read_image(tmp_path / "a.png")
    (tmp_path / "c.png").write_text("no image")
    with pytest.raises(TargetError, match="cannot be read as an image"):
        read_image(tmp_path / "c.png", 3)


@pytest.mark.parametrize(
    ("heights", "spacing", "words"),
    [
        (np.zeros((3, 9)), 1.0, "too coarse"),
        (np.full((9, 9), np.nan), 1.0, "row 0, column 0 is not a finite"),
        (np.zeros((9, 9)), 0.0, "must be greater than 0"),
    ],
)
def test_heights_that_are_no_surface_are_refused(heights, spacing, words):
    with pytest.raises(TargetError, match=words):
        from_heights(heights, spacing)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.zeros((3, 9, 3)), "A grid of 9 x 3 points is too coarse; give 4 x 4 or more"),
        (
            np.where(np.arange(75).reshape(5, 5, 3) == 34, np.inf, 0),
            "row 2, column 1 .* not finite",
        ),
    ],
)
def test_points_that_are_no_surface_are_refused(points, words):
    with pytest.raises(TargetError, match=words):
        from_points(points)


def test_a_function_that_ends_between_the_probes_is_refused_there():
    def function(u, v):
        return np.where((u > 0.26) & (u < 0.4), np.nan, u * v)

    with pytest.raises(TargetError, match=r"no finite value at u = 0\.\d+, v = "):
        from_function(function, (0, 1, 0, 1))


def test_a_target_that_cannot_be_used_is_told_and_a_damaged_one_refused(tmp_path: Path):
    mesh = tmp_path / "mesh.off"
    mesh.write_text("OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    for path, words in ((mesh, "has changed since the fit"), (tmp_path / "a.off", "is not there")):
        surface, (finding,) = described_surface({"mesh": str(path), "sha256": "0"})
        assert surface is None
        assert finding.sentence == f"Distances are left out: the target mesh {path} {words}."
    for target in ({"surface": 3}, {"surface": "hypar", "parameters": [1]}, {"no": 1}):
        with pytest.raises(PatternError, match="names neither a surface nor a mesh"):
            described_surface(target)


def test_a_point_cloud_is_refused_with_a_way_out(tmp_path: Path):
    file = tmp_path / "cloud.ply"
    trimesh.PointCloud(np.random.default_rng(0).random((50, 3))).export(file)
    with pytest.raises(TargetError, match="point cloud and not a surface; make a triangle mesh"):
        load_mesh(file)


@pytest.mark.parametrize(
    "target",
    [
        {"samples": 3},
        {"samples": [[1]], "span": 1, "domain": 2},
        {"samples": [[[0, 0, 0]] * 4] * 3, "span": [0, 1, 0, 1], "domain": [0, 1, 0, 1]},
        {"vertices": [[0]]},
    ],
)
def test_a_damaged_description_is_refused(target):
    with pytest.raises(PatternError, match="damaged"):
        described_surface(target)


@pytest.mark.parametrize("place", [(0.0, 0.0, 3e6), (4e5, 5e6, 300.0)])
def test_points_and_heights_far_from_the_origin_give_the_same_surface(place):
    x, y = np.meshgrid(np.linspace(-1, 1, 20), np.linspace(-1, 1, 16))
    points = np.stack([x, y, bump(x, y)], axis=-1)
    here, there = from_points(points), from_points(points + place)
    if place[0]:
        there_by_heights, here_by_heights = there, here
    else:
        here_by_heights, _ = from_heights(points[..., 2], 0.1)
        there_by_heights, findings = from_heights(points[..., 2] + place[2], 0.1)
        assert findings == ()
    uv = here.domain.lattice(11, 13)
    assert np.abs(there.point(uv) + there.origin - place - here.point(uv)).max() < 5e-8
    uv = here_by_heights.domain.lattice(11, 13)
    shifted = there_by_heights.point(uv) + there_by_heights.origin - place
    assert np.abs(shifted - here_by_heights.point(uv)).max() < 1e-6
    again, _ = described_surface(json.loads(json.dumps(there.description)))
    assert np.array_equal(again.point(uv), there.point(uv))
    assert np.array_equal(again.origin, there.origin)
    assert np.abs(again.point(uv)).max() < 10
