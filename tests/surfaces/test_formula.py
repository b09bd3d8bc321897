"""Formulas as targets: what they compute, what they refuse, and that they are never run."""

import contextlib
import math
import operator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

import miurafab as mf
from miurafab.errors import OptionError, TargetError
from miurafab.origami.formats.fold import read_fold
from miurafab.surfaces.catalogue import make_surface, parse_target
from miurafab.surfaces.description import described_surface
from miurafab.surfaces.formula import LONGEST, computed, read_formula

X, Y = np.array([0.3, 1.7, -0.4]), np.array([2.0, 0.25, 1.0])
LEAVES = st.sampled_from(
    [("x", X), ("y", Y), ("pi", math.pi), ("2", 2.0), (".5", 0.5), ("1e-3", 1e-3), ("3.", 3.0)]
)
BINARY = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": np.divide}


def _joined(parts):
    """A text without needless brackets whose value is known from those of its parts."""
    (first, a), sign, (second, b) = parts
    return f"({first}){sign}({second})", BINARY[sign](a, b)


TREES = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(sorted(BINARY)), inner).map(_joined),
        inner.map(lambda part: (f"-({part[0]})", -part[1])),
        inner.map(lambda part: (f" cos( {part[0]} )", np.cos(part[1]))),
        st.tuples(inner, inner).map(
            lambda two: (f"hypot({two[0][0]},{two[1][0]})", np.hypot(two[0][1], two[1][1]))
        ),
    ),
    max_leaves=12,
)


@given(TREES)
def test_a_formula_means_what_its_parts_mean(tree):
    text, value = tree
    if len(text) <= LONGEST:
        with np.errstate(all="ignore"):
            found = read_formula(text, ("x", "y"))({"x": X, "y": Y})
        np.testing.assert_allclose(found, value, rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1-2-3", -4), ("8/4/2", 1), ("2+3*4", 14), ("2^3^2", 512), ("2**3", 8), ("-2^2", -4),
        ("2^-1", 0.5), ("--3", 3), ("2*-3", -6), ("(-2)^3", -8), ("sqrt(16)*e", 4 * math.e),
        ("atan2(1, -1)", 3 * math.pi / 4), ("min(abs(-3), 2)", 2), ("max(1,2)-log(e)", 1),
        ("asin(1)+acos(1)+atan(1)", 0.75 * math.pi), ("1e2+1E-1", 100.1),
    ],
)  # fmt: skip
def test_signs_and_powers_bind_as_in_mathematics(text, value):
    assert computed(text) == pytest.approx(value, rel=1e-14)


def test_a_whole_number_of_more_digits_than_a_float_has_is_infinite():
    """A design file with 400 digits ended with an OverflowError."""
    assert computed(10**400) == math.inf


@pytest.mark.parametrize(
    ("formula", "told"),
    [
        ("z=2x", "'x' cannot stand at place 2 of '2x'; write \\* between factors"),
        ("z=(x", "ends too early: a bracket is not closed"),
        ("z=x)", "'\\)' cannot stand at place 2"),
        ("z=x+", "ends too early"),
        ("z=sin*2", "'sin' is a function"),
        ("z=sin(x,y)", "takes 1 value"),
        ("z=hypot(x)", "takes 2 values"),
        ("z=__import__('os').system('id')", "'__import__' is not known"),
        ("z=x.__class__", "'\\.' cannot stand at place 2"),
        ("z=u", "'u' is not known in a formula; there are x, y"),
        ("x=u,y=v,z=x", "'x' is not known in a formula; there are u, v"),
        ("z=" + "(" * 60 + "x" + ")" * 60, "nested more than 40 deep"),
        ("z=" + "2^" * 60 + "x", "nested more than 40 deep"),
        ("z=x" + "+x" * LONGEST, "at most 500 characters"),
        ("x=u,y=v", "The formula of z is missing"),
        ("z=1/x", "no finite value at u = 0"),
        ("z=1e300*x", "a value beyond 1e.100 .*; scale it down"),
        ("x=u,y=u,z=u", "no tangent plane"),
        ("z=z=x*y", "begins with 'z='; write 'x.y'"),
        ("z=x,u0=1", "each start under its end"),
        ("z=x,u1=2*x", "'x' is not known"),
        ("z=x,w=2", "no parameter 'w'; it has z, x, y, u0"),
    ],
)
def test_what_is_no_formula_is_refused_with_the_place(formula, told):
    with pytest.raises(TargetError, match=told):
        make_surface(*parse_target(f"formula:{formula}"))


@given(st.text(max_size=60))
def test_any_text_is_a_formula_or_is_refused(text):
    with contextlib.suppress(TargetError):  # anything else is a fault
        read_formula(text, ("x",))


def test_a_formula_is_the_surface_that_it_says():
    height, _ = make_surface("formula", {"z": "0.4*(x^2-y^2)"})
    saddle, _ = make_surface("saddle", {"height": 0.4})
    uv = saddle.domain.lattice(9, 9)
    assert np.abs(height.point(uv) - saddle.point(uv)).max() < 1e-5
    point, values = make_surface(
        "formula", {"x": "cos(u)", "y": "sin(u)", "z": "v", "u0": 0, "u1": "pi/2"}
    )
    radius = np.linalg.norm(point.point(point.domain.lattice(9, 9))[..., :2], axis=-1)
    assert np.abs(radius - 1).max() < 1e-5
    assert values["u1"] == pytest.approx(math.pi / 2, abs=1e-11)


def test_brackets_keep_their_commas():
    found = parse_target("formula:z=min(x, max(y, 0)),u1=hypot(1,1)")
    assert found == ("formula", {"z": "min(x, max(y, 0))", "u1": "hypot(1,1)"})


def test_the_file_keeps_the_formula_and_a_check_knows_it(tmp_path):
    """Also one far from the origin, whose sheet is relative to a point near it."""
    result = mf.fit("formula:z=0.3*x*y+1e6", facets=(6, 6), size=100)
    assert result.status == "converged"
    file = tmp_path / "far.fold"
    result.pattern.save(file)
    pattern = read_fold(file)
    assert pattern.target["parameters"]["z"] == "0.3*x*y+1e6"
    assert pattern.origin[2] != 0
    assert described_surface(pattern.target)[0].origin[2] == 1e6
    assert mf.check(file).report()["hausdorff_mm"] == pytest.approx(
        result.report()["hausdorff_mm"], rel=1e-6
    )


def test_a_formula_that_turns_too_fast_is_told():
    findings = mf.design("formula", z="sin(60*x)").findings
    assert [finding.code for finding in findings] == ["sampling"]


def test_an_image_is_named_with_its_parameters(tmp_path):
    """On the command line, as options, and in a design file: one surface."""
    shades = np.add.outer(np.arange(8), np.arange(6)) * 20
    file = tmp_path / "dem.png"
    Image.fromarray(shades.astype(np.uint8)).save(file)
    text = mf.design(f"{file}:height=20mm,spacing=0.5").request
    given = mf.design(file, height=20, spacing=0.5).request
    toml = tmp_path / "hills.toml"
    toml.write_text('[target]\nimage = "dem.png"\nheight = 20\nspacing = "0.5mm"\n')
    written = mf.design(toml, height=20).request
    assert text.target["samples"] == given.target["samples"] == written.target["samples"]
    assert np.ptp(np.array(text.target["samples"])[..., 0]) == pytest.approx(2.5)
    with pytest.raises(TargetError, match="no parameter 'high'"):
        mf.design(f"{file}:high=20")
    with pytest.raises(TargetError, match="such as height=20"):
        mf.design(file)
    with pytest.raises(OptionError, match="spacing"):
        mf.design(f"{file}:height=3,spacing=0")
