"""Named surfaces: each what its name says, smooth a little beyond its domain, found again."""

from __future__ import annotations

import math
import re
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from scipy.spatial import cKDTree

from miurafab.errors import TargetError
from miurafab.geometry.distances import MeshTrees
from miurafab.surfaces.catalogue import CATALOGUE, make_surface, parse_target
from miurafab.surfaces.profile_files import read_profile
from miurafab.surfaces.surface import (
    CHORD,
    Domain,
    Swapped,
    curvature_along_u,
    tangents,
    unit,
)
from miurafab.workflow.design import design


@pytest.mark.parametrize("name", list(CATALOGUE))
class TestEverySurface:
    def test_normals_are_unit_and_across_both_tangents(self, name: str) -> None:
        surface, _ = make_surface(name, {})
        uv = surface.domain.lattice(13, 11)
        normal = surface.normal(uv)
        assert np.allclose(np.linalg.norm(normal, axis=-1), 1)
        for tangent in tangents(surface, uv):
            assert np.abs(np.einsum("ijk,ijk->ij", normal, unit(tangent))).max() < 1e-6

    def test_the_nearest_point_of_a_point_off_the_surface_is_its_foot(self, name: str) -> None:
        surface, _ = make_surface(name, {})
        uv = surface.domain.lattice(7, 7)[1:-1, 1:-1]
        foot = surface.point(uv).reshape(-1, 3)
        off = foot + 0.01 * surface.normal(uv).reshape(-1, 3)
        assert np.abs(surface.closest_point(off) - foot).max() < 1e-6

    def test_the_whole_target_ends_at_its_border(self, name: str) -> None:
        """Points all about it, against a fine lattice over its domain."""
        surface, _ = make_surface(name, {})
        fine = surface.point(surface.domain.lattice(801, 801)).reshape(-1, 3)
        size = np.linalg.norm(np.ptp(fine, axis=0))
        d = surface.domain
        wide = Domain(d.u0 - 0.1 * d.width, d.u1 + 0.1 * d.width, d.v0 - 0.1 * d.height, d.v1)
        uv = wide.lattice(12, 12).reshape(-1, 2)
        points = surface.point(uv) + 0.03 * size * surface.normal(uv)
        found = np.linalg.norm(surface.nearest(points) - points, axis=1)
        best = cKDTree(fine).query(points)[0]
        assert (found < best * (1 + 1e-9)).all()
        assert (found**2 > best**2 - (size / 400) ** 2).all()

    def test_tiles_lie_on_the_whole_target(self, name: str) -> None:
        surface, _ = make_surface(name, {})
        tiles = surface.tiles()
        size = np.linalg.norm(np.ptp(tiles.reshape(-1, 3), axis=0))
        for points, sag in ((tiles[::7, 0], 1e-9), (tiles[::7].mean(axis=1), 2 * CHORD)):
            assert np.linalg.norm(surface.nearest(points) - points, axis=1).max() < sag * size
        lattice = surface.point(surface.domain.lattice(7, 7)).reshape(-1, 3)
        gap = MeshTrees.of(tiles).closest(lattice)[0] - lattice
        assert np.linalg.norm(gap, axis=1).max() < 2 * CHORD * size

    def test_it_goes_on_a_little_beyond_its_domain(self, name: str) -> None:
        surface, _ = make_surface(name, {})
        d = surface.domain
        beyond = np.array([[d.u0 - 0.04 * d.width, d.v0 - 0.04 * d.height]])
        assert np.isfinite(surface.point(beyond)).all()

    def test_swapping_keeps_the_points(self, name: str) -> None:
        surface, _ = make_surface(name, {})
        uv = surface.domain.lattice(5, 5)
        assert np.array_equal(Swapped(surface).point(uv[..., ::-1]), surface.point(uv))

    def test_every_default_lies_within_its_range(self, name: str) -> None:
        for parameter in CATALOGUE[name].parameters.values():
            assert parameter.kind.low <= parameter.default <= parameter.kind.high


def gauss(name: str) -> np.ndarray:
    """The sign of the Gaussian curvature along the middle profile of a surface of revolution:
    that of the two principal curvatures, along the profile and around.
    """
    surface, _ = make_surface(name, {})
    u = np.linspace(0.02, 0.98, 49)
    uv = np.stack([u, np.zeros_like(u)], axis=1)
    along = curvature_along_u(surface, uv)
    around = curvature_along_u(Swapped(surface), uv[:, ::-1])
    return -along * around  # the swapped surface has the opposite normal


@pytest.mark.parametrize(
    ("name", "signs"),
    [
        ("pill", {0, 1}),
        ("candlestick", {0, -1}),
        ("vase", {1, -1}),
        ("hyperboloid", {-1}),
        ("catenoid", {-1}),
        ("ellipsoid", {1}),
    ],
)
def test_curvature_has_the_signs_of_the_name(name: str, signs: set[int]) -> None:
    curvature = gauss(name)
    size = np.abs(curvature).max()
    found = np.where(np.abs(curvature) < 1e-6 * size, 0, np.sign(curvature))
    interior = np.abs(np.diff(found, prepend=found[0])) + np.abs(np.diff(found, append=found[-1]))
    assert {int(s) for s in found[interior == 0]} == signs


def test_a_sphere_has_its_curvature() -> None:
    surface, _ = make_surface("sphere", {"radius": 2.0})
    uv = surface.domain.lattice(5, 5)
    assert np.allclose(np.linalg.norm(surface.point(uv), axis=-1), 2.0)
    meridian = curvature_along_u(Swapped(surface), uv[..., ::-1])
    assert np.allclose(np.abs(meridian), 0.5, rtol=1e-5)


def test_a_drawn_profile_is_turned_as_drawn() -> None:
    points = [[0.5, 0.0], [0.8, 0.5], [0.6, 1.0]]
    surface, values = make_surface("revolution", {"profile": points, "angle": "90deg"})
    assert math.isclose(values["angle"], 90)
    ends = surface.point(np.array([[0.0, 0.0], [1.0, 0.0]]))
    assert np.allclose(ends[:, [0, 2]], [points[0], points[-1]])


@pytest.mark.parametrize(
    ("name", "given", "word"),
    [
        ("hipar", {}, "hypar"),
        ("hypar", {"hight": "1"}, "hight"),
        ("sphere", {"width": "400deg"}, "between"),
        ("pill", {"waist": "wide"}, "not a number"),
        ("revolution", {"profile": [[-1, 0], [1, 1]]}, "axis"),
        ("revolution", {"profile": [[1, 0], [1, 0]]}, "same point"),
        ("helicoid", {"inner": "2"}, "inner"),
    ],
)
def test_a_mistake_is_named(name: str, given: dict[str, object], word: str) -> None:
    with pytest.raises(TargetError, match=word):
        make_surface(name, given)


def test_a_target_is_parsed_into_name_and_parameters() -> None:
    assert parse_target("hypar:height=0.5, width=3") == ("hypar", {"height": "0.5", "width": "3"})
    with pytest.raises(TargetError, match="parameter=value"):
        parse_target("hypar:height")


def test_all_round_a_revolution_there_is_no_border_along_the_profile() -> None:
    """Points over the two sides of the domain that are one line in space."""
    surface, _ = make_surface("vase", {"angle": 360})
    turns = np.linspace(-0.02, 0.02, 9) + surface.domain.v1
    uv = np.stack([np.full(9, 0.4), turns], axis=1)
    foot = surface.point(uv)
    off = foot + 0.1 * surface.normal(uv)
    assert np.abs(surface.nearest(off) - foot).max() < 1e-9


def test_a_profile_is_read_from_a_list_and_from_a_drawing(tmp_path: Path) -> None:
    """The drawing has a shorter line beside the profile."""
    points = [[40.0, 0.0], [60.0, 40.0], [50.0, 90.0], [65.0, 130.0]]
    (tmp_path / "goblet.csv").write_text("r, z\n40, 0\n60;40\n50 90 # the neck\n\n65,\t130\n")
    drawing = ezdxf.new()
    drawing.modelspace().add_line((0, 0), (0, 20))
    drawing.modelspace().add_lwpolyline(points)
    drawing.saveas(tmp_path / "goblet.dxf")
    (tmp_path / "goblet.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg"><defs><path d="M0 0 900 0"/></defs>'
        '<line x2="20"/><polyline points="40,0 60,-40 50,-90 65,-130"/></svg>'
    )
    given = make_surface("revolution", {"profile": points})[0]
    for name in ("goblet.csv", "goblet.dxf", "goblet.svg"):
        request = design(f"revolution:profile={tmp_path / name}").request
        assert request.target["parameters"]["profile"] == points
        uv = given.domain.lattice(5, 5)
        assert np.array_equal(request.surface.point(uv), given.point(uv))
    (tmp_path / "goblet.toml").write_text(
        '[target]\nsurface = "revolution"\nprofile = "goblet.csv"\n'
    )
    assert design(tmp_path / "goblet.toml").request.target["parameters"]["profile"] == points


@pytest.mark.parametrize("suffix", ["dxf", "svg"])
def test_an_arc_of_a_drawing_is_flattened_to_a_thousandth_of_its_size(
    tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"arc.{suffix}"
    if suffix == "dxf":
        drawing = ezdxf.new()
        drawing.modelspace().add_arc((50, 0), 30, 90, 270)
        drawing.saveas(path)
    else:
        path.write_text('<svg><path d="M 50 -30 A 30 30 0 0 0 50 30"/></svg>')
    points = np.array(read_profile(path))
    assert np.ptp(points, axis=0) == pytest.approx([30, 60], rel=1e-3)
    middle = (points[1:] + points[:-1]) / 2
    assert np.abs(np.hypot(points[:, 0] - 50, points[:, 1]) - 30).max() < 0.02
    assert np.abs(np.hypot(middle[:, 0] - 50, middle[:, 1]) - 30).max() < 2e-3 * 60


def test_curves_and_closed_parts_of_a_drawing_are_drawn_as_svg_says(tmp_path: Path) -> None:
    """A parabola of one control point, and a line from where the part before it was closed."""
    path = tmp_path / "profile.svg"
    path.write_text('<svg><path d="M 10 0 Q 30 -20 10 -40"/></svg>')
    points = np.array(read_profile(path))
    assert np.abs(points[:, 0] - (10 + points[:, 1] * (40 - points[:, 1]) / 40)).max() < 1e-9
    assert points[[0, -1]].tolist() == [[10, 0], [10, 40]]
    path.write_text('<svg><path d="M 10 0 h 5 v -5 Z L 90 -80"/></svg>')
    assert read_profile(path) == [[10, 0], [90, 80]]
    path.write_text('<svg><polygon points="10,0 50,0 50,-50"/></svg>')
    assert read_profile(path) == [[10, 0], [50, 0], [50, 50], [10, 0]]


def test_a_curve_of_too_many_points_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("miurafab.surfaces.profile_files.MOST_POINTS", 3)
    (tmp_path / "p.svg").write_text('<svg><polyline points="1,0 2,1 3,0 4,1"/></svg>')
    with pytest.raises(TargetError, match="holds a curve of more than 3 points"):
        read_profile(tmp_path / "p.svg")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("p.csv", "1,2\n3,x\n", "line 2 is '3,x'; a profile has two numbers a line"),
        ("p.csv", "1,2,3\n", "line 1 is '1,2,3'"),
        ("p.csv", "", "two or more"),
        ("p.dxf", "Dear Sir or Madam", "cannot be read as a DXF drawing"),
        ("p.png", "", "not a file of points; known are .csv, .txt, .dxf, .svg"),
        ("p.svg", "<svg><path", "cannot be read as an SVG drawing"),
        ("p.svg", "<svg><path d='M 1 x'/></svg>", "cannot be read as an SVG drawing"),
        ("p.svg", "<svg/>", "holds no polyline, spline or arc"),
        ("p.svg", "<svg><path d='M1 1 M2 2'/></svg>", "holds no polyline, spline or arc"),
        ("p.svg", "<!DOCTYPE svg [<!ENTITY a 'b'>]><svg/>", "it declares XML entities"),
        ("p.csv", "1,0\n1,1e10\n1.0000001,1e10\n", "too far apart, or too near each other"),
        (
            "p.svg",
            "<svg><g id='a' transform='scale(2)'><path d='M1 1 2 2'/></g></svg>",
            "'a' is moved by",
        ),
    ],
)
def test_a_file_without_a_profile_is_refused(
    tmp_path: Path, name: str, content: str, words: str
) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(TargetError, match=re.escape(words)):
        make_surface("revolution", {"profile": str(tmp_path / name)})
