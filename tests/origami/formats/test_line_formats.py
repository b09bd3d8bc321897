"""SVG, CP, OPX and DXF: written lines are read back, and files of other hands are understood."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from random import Random
from xml.etree import ElementTree

import numpy as np
import pytest
import svgelements
from hypothesis import given
from hypothesis import strategies as st
from problems import fitted, regular

from miurafab.errors import InputError, PatternError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.formats.crease_lines import CreaseLines, lines_of
from miurafab.origami.formats.dxf_entities import parse_dxf
from miurafab.origami.formats.lines import (
    cp_text,
    dxf_text,
    opx_text,
    parse_cp,
    parse_opx,
)
from miurafab.origami.formats.planar_graph import pattern_from_lines
from miurafab.origami.formats.svg import parse_svg, svg_text


def spline_dxf(knots: str, weights: str, points: int = 2) -> str:
    """A SPLINE of degree 1."""
    tags: list[tuple[int, object]] = [(0, "SECTION"), (2, "ENTITIES"), (0, "SPLINE"), (71, 1)]
    tags += [*((40, knot) for knot in knots.split()), *((41, each) for each in weights.split())]
    tags += [pair for at in range(points) for pair in ((10, at), (20, at))]
    return "".join(f"{code}\n{value}\n" for code, value in [*tags, (0, "ENDSEC"), (0, "EOF")])


FORMATS: dict[str, tuple[Callable[[CreaseLines], str], Callable[[str], CreaseLines]]] = {
    "svg": (svg_text, parse_svg),
    "cp": (cp_text, parse_cp),
    "opx": (opx_text, parse_opx),
    "dxf": (dxf_text, parse_dxf),
}


def curved() -> CreasePattern:
    found = fitted("hypar", 8, 8).pattern
    assert found is not None
    return found


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("sheet", [regular, curved])
def test_a_sheet_is_read_back_from_its_lines(name: str, sheet: Callable[[], CreasePattern]) -> None:
    write, parse = FORMATS[name]
    pattern = sheet()
    lines = lines_of(pattern)
    read = parse(write(lines))
    shift = read.ends.reshape(-1, 2).min(axis=0) - lines.ends.reshape(-1, 2).min(axis=0)
    size = np.ptp(lines.ends.reshape(-1, 2), axis=0).max()
    assert np.abs(read.ends - shift - lines.ends).max() < 1e-12 * size
    assert np.array_equal(read.assignment, lines.assignment)
    if name == "svg":
        assert np.abs(read.fold_angle - lines.fold_angle).max() < 1e-14
    else:
        assert np.isnan(read.fold_angle).all()
    again = pattern_from_lines(read)
    assert len(again.faces_vertices) == len(pattern.faces_vertices)
    assert len(again.vertices_coords) == len(pattern.vertices_coords)


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_lines_give_the_same_bytes(name: str) -> None:
    write, _ = FORMATS[name]
    assert write(lines_of(regular())) == write(lines_of(regular()))


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 20))
def test_any_lines_survive_any_format(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    ends = random.uniform(-500, 500, (count, 2, 2))
    letters = random.choice(list("BMVF"), count)
    lines = CreaseLines(ends, letters, random.uniform(-np.pi, np.pi, count))
    for name, (write, parse) in FORMATS.items():
        read = parse(write(lines))
        assert np.array_equal(read.assignment, letters)
        # the drawing's corner may be its origin
        moved = read.ends - read.ends[0, 0] + ends[0, 0]
        assert np.abs(moved - ends).max() < 1e-9, name


# What Origami Simulator asks of a file.


def test_an_svg_has_the_exact_strokes_and_opacities() -> None:
    lines = CreaseLines(
        np.arange(20, dtype=float).reshape(5, 2, 2) ** 1.5,
        np.array(["B", "M", "V", "C", "F"]),
        np.array([0.0, -np.pi / 2, np.pi / 4, 0.0, 0.0]),
    )
    text = svg_text(lines)
    strokes = re.findall(r'stroke="(#[0-9a-f]+)"(?: stroke-opacity="([^"]+)")?', text)
    assert [colour for colour, _ in strokes] == [
        "#000000",
        "#ff0000",
        "#0000ff",
        "#00ff00",
        "#ffff00",
    ]
    assert [float(opacity) for _, opacity in strokes if opacity] == pytest.approx([0.5, 0.25])


def test_the_shortest_line_of_an_svg_has_ten_units_and_the_sheet_its_size() -> None:
    text = svg_text(lines_of(regular()))
    lines = re.findall(r'x1="([^"]+)" y1="([^"]+)" x2="([^"]+)" y2="([^"]+)"', text)
    ends = np.array(lines, dtype=float).reshape(-1, 2, 2)
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).min() >= 10 - 1e-9
    width, height = re.search(r'width="([\d.]+)mm" height="([\d.]+)mm"', text).groups()
    assert [float(width), float(height)] == pytest.approx(
        np.ptp(regular().vertices_coords, axis=0).tolist()
    )


@pytest.mark.parametrize(
    ("name", "letter"), [("lightgray", "F"), ("DarkRed", "M"), ("mediumblue", "V")]
)
def test_any_colour_of_css_may_be_named(name: str, letter: str) -> None:
    line = f'<line x1="0" x2="9" y1="0" y2="9" stroke="{name}"/>'
    read = parse_svg(f'<svg xmlns="http://www.w3.org/2000/svg">{line}</svg>')
    assert read.assignment.tolist() == [letter]


def test_an_svg_of_another_hand() -> None:
    read = parse_svg(
        """<svg xmlns="http://www.w3.org/2000/svg"><style>.v { stroke: blue; opacity: 50% }</style>
        <g transform="translate(10 0) scale(2)" stroke="#F00" stroke-opacity=".25">
          <line x1="0" y1="0" x2="3" y2="4"/>
          <path d="M0,0 l 1,0 0,1 z M5 5 H7 V-2"/></g>
        <polygon points="0,0 4,0 0,4" style="stroke:rgb(0,0,0);fill:none"/>
        <rect x="1" y="2" width="3" height="4" stroke="#0f0"/>
        <polyline class="v" points="0 0 1 1 2 0"/>
        <line x1="0" x2="9" y1="0" y2="0" stroke="#888"/>
        <line x1="0" x2="9" y1="0" y2="0"/>
        <defs><line x1="0" x2="9" y1="0" y2="0" stroke="red"/></defs></svg>"""
    )
    letters = "".join(read.assignment)
    assert letters == "M" + "MMM" + "MM" + "BBB" + "CCCC" + "VV" + "F"
    assert read.ends[0].tolist() == [[10, 0], [16, -8]]
    assert read.ends[4:6].tolist() == [[[20, -10], [24, -10]], [[24, -10], [24, 4]]]
    assert read.fold_angle[0] == pytest.approx(-math.pi / 4)
    assert read.fold_angle[-2] == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<svg><path d='M0 0 Q1 1 k' stroke='red'/></svg>", "lacks a number"),
        ("<svg><path d='M0 0 A1 1 0 2 0 1 1' stroke='red'/></svg>", "flag"),
        ("<svg><line stroke='redish'/></svg>", "not a colour"),
        ("<svg><line stroke='red' x1='a'/></svg>", "x1 is 'a'"),
        ("<svg><g transform='warp(3)'/></svg>", "not a transform"),
        ("<svg><g transform='matrix(3)'/></svg>", "lacks a number"),
        ("<svg><path d='M0 0 L3' stroke='red'/></svg>", "lacks a number"),
        (
            "<svg><path d='4 5 L3 1' stroke='red'/></svg>",
            "'4 5 L3 1' begins with a number",
        ),
        ("<svg><path d='M0 0 B3 1' stroke='red'/></svg>", "holds 'B', which is no command"),
        ("<svg><line stroke='hsl(1, 2%)'/></svg>", r"the stroke 'hsl\(1, 2%\)' is not a colour"),
        ("<svg><line stroke='rgb(1, 2)'/></svg>", r"the stroke 'rgb\(1, 2\)' is not a colour"),
        ("<html/>", "not an SVG"),
        ("<svg", "not an SVG drawing"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><svg/>", "entities"),
    ],
)
def test_what_is_no_crease_pattern_in_svg_is_refused(text: str, words: str) -> None:
    with pytest.raises(PatternError, match=words):
        parse_svg(text)


@pytest.mark.parametrize(
    ("stroke", "letter"),
    [
        ("hsl(0, 100%, 50%)", "M"),
        ("HSLA(240 100% 40% / 1)", "V"),
        ("hsl(120, 100%, 50%)", "C"),
        ("hsl(-120, 100%, 50%)", "V"),
        ("rgb(100%, 0%, 0%)", "M"),
        ("rgba(0, 0, 255, 1)", "V"),
        ("rgb(0, 0, 0)", "B"),
    ],
)
def test_a_colour_of_svg_is_read_however_it_is_written(stroke: str, letter: str) -> None:
    assert parse_svg(f'<svg><line x2="1" stroke="{stroke}"/></svg>').assignment.tolist() == [letter]


@pytest.mark.parametrize(
    "transform",
    [
        "rotate(30)",
        "rotate(-40 3,4)",
        "skewX(20)",
        "skewY(-15)",
        "translate(4) scale(2 -3)",
        "translate(1,2)rotate(30, 5, 6) , skewX(10) scale(.5) matrix(1 2 -3 4 5 6)",
    ],
)
def test_an_svg_transform_moves_as_another_reader_moves(transform: str) -> None:
    line = '<line x1="1" y1="2" x2="7" y2="-3" stroke="red"/>'
    read = parse_svg(f'<svg><g transform="{transform}">{line}</g></svg>')
    matrix = svgelements.Matrix(transform)
    there = [matrix.point_in_matrix_space(point) for point in ((1, 2), (7, -3))]
    np.testing.assert_allclose(read.ends[0], [[p.x, -p.y] for p in there], atol=1e-9)


def test_what_is_no_line_in_a_drawing_draws_nothing() -> None:
    parts = (
        '<circle r="0"/><ellipse rx="3"/><polyline points="1 2"/><path d="M3 4"/><path d=""/>'
        '<path d="M0 0A0 5 0 0 1 3 4"/>'  # an arc without a radius is a line
    )
    drawing = f'<svg stroke="red">{parts}<line x2="5"/></svg>'
    assert parse_svg(drawing).ends.tolist() == [[[0, 0], [3, -4]], [[0, 0], [5, 0]]]


def test_what_an_svg_holds_besides_lines_is_told() -> None:
    square = '<rect width="9" height="9" stroke="black"/><use/><image/><use/>'
    pattern = pattern_from_lines(parse_svg(f"<svg>{square}</svg>"))
    assert [finding.sentence for finding in pattern.told] == [
        "Parts of the drawing are not read: 1 image, 2 use."
    ]


@pytest.mark.parametrize("text", [svg_text, opx_text])
def test_a_title_is_what_it_says_and_no_markup(text: Callable[..., str]) -> None:
    root = ElementTree.fromstring(text(lines_of(regular(2, 2)), "<b> & 'c'"))
    assert [each.text for each in root.iter() if each.text == "<b> & 'c'"] == ["<b> & 'c'"]


def test_cp_and_opx_have_their_y_axis_downwards() -> None:
    lines = CreaseLines(np.array([[[1.0, 2.0], [3.0, 5.0]]]), np.array(["M"]), np.array([np.nan]))
    assert cp_text(lines) == "2 1.0 -2.0 3.0 -5.0\n"
    assert re.search(r'<void property="y1">\s*<double>-5.0</double>', opx_text(lines))


@pytest.mark.parametrize(
    ("parse", "text", "words"),
    [
        (parse_cp, "1 0 0 1\n", "line 1"),
        (parse_cp, "1 0 0 1 1\nx 0 0 0 0\n", "line 2"),
        (parse_cp, "1 0 0 1 1\n\n \n1 0 0 1_0 1\n", "line 4 is '1 0 0 1_0 1', not a type and four"),
        (parse_cp, "1 0 0 \uff11 1\n", "line 1 is"),
        (parse_opx, "<java", "OPX"),
        (parse_dxf, "hello", "not a DXF"),
        (parse_dxf, "0\nSECTION\n2\nENTITIES\nx\nLINE\n", "line 5"),
        (parse_dxf, "0\nSECTION\n2\nENTITIES\n0\nLINE\n10\nabc\n0\nEOF\n", "group 10 is 'abc'"),
        (
            parse_dxf,
            "0\nSECTION\n2\nENTITIES\n0\nLWPOLYLINE\n10\n1\n42\n1\n0\nENDSEC\n0\nEOF\n",
            "without an x or a y",
        ),
        (
            parse_dxf,
            "0\nSECTION\n2\nENTITIES\n0\nSPLINE\n71\n3\n10\n1\n20\n1\n0\nENDSEC\n0\nEOF\n",
            "do not go together",
        ),
        (parse_dxf, spline_dxf("0 0 1 1", "1 1", points=0), "has points to fit and no control"),
        (parse_dxf, spline_dxf("0 1 0 1", "1 1"), "knots that do not rise"),
        (parse_dxf, spline_dxf("0 0 0 0", "1 1"), "knots that do not rise"),
        (parse_dxf, spline_dxf("0 0 1 1", "1 0"), "a weight that is not positive"),
        (parse_dxf, spline_dxf("0 0 1 1", "1"), "2 control points, 4 knots and 1 weights"),
    ],
)
def test_what_cannot_be_read_is_named(
    parse: Callable[[str], CreaseLines], text: str, words: str
) -> None:
    with pytest.raises(PatternError, match=words):
        parse(text)


def test_opx_leaves_out_what_is_zero() -> None:
    read = parse_opx(
        '<java><object class="oripa.DataSet"><void property="lines"><array>'
        '<void index="0"><object class="oripa.OriLineProxy">'
        '<void property="type"><int>3</int></void>'
        '<void property="x1"><double>5.5</double></void></object></void>'
        "</array></void></object></java>"
    )
    assert read.assignment.tolist() == ["V"]
    assert read.ends.tolist() == [[[0, 0], [5.5, 0]]]


def test_dxf_polylines_and_colours_are_read() -> None:
    def tags(*pairs: object) -> str:
        return "".join(f"{pair}\n" for pair in pairs)

    body = tags(0, "SECTION", 2, "ENTITIES")
    body += tags(0, "LWPOLYLINE", 8, "0", 62, 1, 70, 1)
    body += tags(10, 0, 20, 0, 10, 4, 20, 0, 10, 0, 20, 4)
    body += tags(0, "POLYLINE", 8, "valleys", 62, 5, 70, 0, 10, 0, 20, 0)
    body += tags(0, "VERTEX", 8, "valleys", 10, 1, 20, 1, 0, "VERTEX", 8, "x", 10, 2, 20, 3)
    body += tags(0, "SEQEND", 0, "LINE", 8, "CutLine", 10, 1, 20, 2, 11, 3, 21, 4)
    body += tags(0, "CIRCLE", 10, 5, 20, 5, 40, 0, 0, "LWPOLYLINE", 10, 1, 20, 1)  # nothing drawn
    body += tags(0, "ENDSEC", 0, "EOF")
    read = parse_dxf(body)
    assert "".join(read.assignment) == "MMM" + "V" + "B"
    assert read.ends[2].tolist() == [[0, 4], [0, 0]]
    assert read.ends[3].tolist() == [[1, 1], [2, 3]]
    assert read.ends[4].tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_file_is_read_or_refused_in_a_sentence(name: str) -> None:
    write, parse = FORMATS[name]
    whole = write(lines_of(regular(4, 3)))
    random = Random(1)
    read, refused = 0, []
    for _ in range(300):
        text = list(whole)
        for _ in range(random.randint(1, 5)):
            at = random.randrange(len(text))
            text[at : at + random.randint(0, 2)] = random.choice(
                ["", "-", "9", "e9", "<", "n", " "]
            )
        try:
            pattern_from_lines(parse("".join(text)))
            read += 1
        except InputError as fault:
            refused.append(str(fault))
    assert read
    assert refused
    assert all(sentence.endswith(".") for sentence in refused)
