"""The options of a fit: values or text, bare angles in degrees, whoever writes them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from problems import saddle_mesh

from miurafab.errors import InputError, OptionError
from miurafab.surfaces.catalogue import make_surface
from miurafab.workflow.design import design
from miurafab.workflow.fit import fit


def test_a_request_is_a_design():
    request = design("hypar", facets="4x4").request
    assert vars(design(request).request) == vars(request)
    assert (design(request, size="25cm").request.size_mm, design(request).title) == (250, "design")


@pytest.mark.parametrize(
    ("target", "options", "why"),
    [
        ("hypar", {"qqq": 1}, r"surface 'hypar'|'hypar'; parameters are .*; options are facets"),
        ("cloud/points.xyz", {}, r"'cloud/points\.xyz' cannot be a target: known files are \.toml"),
        ({}, {}, "The target is not there"),
        (np.zeros((3, 3, 4)), {}, r"shape \(3, 3, 4\); heights have the shape"),
        (design("sphere"), {"close": "open"}, "'close' shapes the target; give it to 'design'"),
    ],
)
def test_what_is_no_target_or_comes_too_late_is_refused(target, options, why):
    with pytest.raises(InputError, match=why):
        design(target, **options)


def test_a_grid_of_points_is_a_surface():
    x, y = np.meshgrid(np.linspace(0, 30, 5), np.linspace(0, 20, 4))
    made = design(np.stack([x, y, 0.01 * x * y], axis=-1), facets="4x4")
    assert made.title == "points"
    near = made.request.surface.closest_point(np.array([[15.0, 10.0, 1.5], [30.0, 20.0, 6.0]]))
    assert near == pytest.approx(np.array([[15.0, 10.0, 1.5], [30.0, 20.0, 6.0]]), abs=1e-6)


def test_a_design_file_names_a_mesh_beside_it_and_nothing_that_a_mesh_has_not(tmp_path):
    saddle_mesh(9).export(tmp_path / "saddle.stl")
    file = tmp_path / "own.toml"
    file.write_text('facets = "4x4"\n[target]\nmesh = "saddle.stl"\n')
    made = design(str(file))
    assert (made.request.facets, made.request.target["mesh"][-10:]) == ((4, 4), "saddle.stl")
    file.write_text('[target]\nmesh = "saddle.stl"\nheight = 3\n')
    with pytest.raises(InputError, match=r"own\.toml.*height"):
        design(str(file))
    file.write_text('[target]\nmesh = "gone.stl"\n')
    with pytest.raises(InputError, match=r"gone\.stl does not exist"):
        design(str(file))


def test_values_and_text_ask_for_the_same():
    values = design("hypar", facets=(8, 6), size=250, amplitude=0.5, seed=np.int64(3))
    text = design("hypar", facets="8x6", size="25cm", amplitude="0.5", seed="3")
    for name in ("facets", "size_mm", "amplitude", "seed", "target"):
        assert getattr(values.request, name) == getattr(text.request, name)


@pytest.mark.parametrize("forty", [40, 40.0, "40", "40deg", f"{math.radians(40)}rad"])
def test_a_bare_angle_is_degrees(forty, tmp_path):
    assert design("hypar", min_angle=forty).request.min_angle == pytest.approx(math.radians(40))
    written = forty if isinstance(forty, int | float) else f'"{forty}"'
    file = tmp_path / "sphere.toml"
    file.write_text(
        f'min_angle = {written}\n[target]\nsurface = "sphere"\nwidth = {written}\n'
        f"[layout]\ntab_angle = {written}\n"
    )
    made = design(str(file))
    assert made.request.min_angle == pytest.approx(math.radians(40))
    assert made.request.target["parameters"]["width"] == pytest.approx(40)
    assert made.layout.tab_angle == pytest.approx(math.radians(40))


def test_the_grid_on_a_mesh_is_turned_by_degrees(tmp_path):
    file = tmp_path / "saddle.stl"
    saddle_mesh(15).export(file)
    plain, turned = (
        design(str(file), rotate=angle, facets=(6, 6)).request.surface for angle in (0, 30)
    )
    angle = turned.placement.angle - plain.placement.angle
    assert math.degrees(angle) == pytest.approx(30)
    assert turned.description["rotate"] == pytest.approx(30)


def test_parameters_come_back_from_a_file_as_they_were():
    surface, written = make_surface("sphere", {"width": "1.2rad", "height": 77.7})
    again, same = make_surface("sphere", written)
    assert same == written
    uv = surface.domain.lattice(5, 5)
    assert np.array_equal(surface.point(uv), again.point(uv))


@pytest.mark.parametrize("bare", [0.016, 1, "0.016", " 4 "])
def test_a_limit_on_flat_foldability_needs_its_unit(bare):
    with pytest.raises(OptionError, match=r"without a unit; write .*rad, as the paper does") as no:
        design("hypar", flat_foldable=bare)
    assert no.value.option == "flat_foldable"


def test_a_limit_on_flat_foldability_with_its_unit():
    for text, inside in (("0.016rad", 0.016), ("0.9deg", math.radians(0.9)), ("exact", 0.0)):
        assert design("hypar", flat_foldable=text).request.flat_foldable == pytest.approx(inside)
    assert design("hypar", flat_foldable="off").request.flat_foldable is None
    with pytest.raises(InputError, match=r"is 229\.183 deg; it must be exact, off, or an angle"):
        design("hypar", flat_foldable="4rad")


def test_a_fault_of_a_file_names_the_file_and_one_of_the_caller_does_not(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('size = "-3mm"\n[target]\nsurface = "hypar"\n')
    with pytest.raises(OptionError, match=r"^mine\.toml: 'size' is -3 mm"):
        design(str(file))
    with pytest.raises(OptionError, match=r"^'size' is -4 mm"):
        design(str(file), size=-4)
    assert design(str(file), size=100).request.size_mm == 100
    for key, near in (("titel", "title"), ("[layout]\nmachin", "machine")):
        file.write_text(f'[target]\nsurface = "hypar"\n{key} = "x"\n' if "[" in key else
                        f'{key} = "x"\n[target]\nsurface = "hypar"\n')  # fmt: skip
        with pytest.raises(OptionError, match=f"is not a known key; did you mean '{near}'"):
            design(str(file))
    file.write_text('sizee = "3mm"\n[target]\nsurface = "hypar"\n')
    with pytest.raises(OptionError, match=r"^mine\.toml: 'sizee' is not a known key; .* 'size'"):
        design(str(file))


def test_more_facets_than_asked_for_are_told():
    """Each of four pieces has two columns at least: 6 x 8 facets; none were told before."""
    sheet = fit("ellipsoid", close="seam", pieces=4, facets=(6, 4), polish="off")
    (found,) = [each for each in sheet.findings if each.code == "more-facets"]
    assert sheet.measurements.facets == 48
    assert "`facets` asks for 24 facets and the sheet has 48" in found.sentence
    assert "more-facets" not in {
        each.code for each in fit("plane", facets=(4, 4), polish="off").findings
    }
