"""Drawings made to hang a reader, or to have it ask for all memory: each ends in one sentence."""

from __future__ import annotations

import json
import math
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

import miurafab as mf
from miurafab.errors import PatternError
from miurafab.origami.formats.dxf_entities import parse_dxf
from miurafab.origami.formats.svg import parse_svg

SQUARE = '<rect width="100" height="100" stroke="black"/>'
LINE = '<line x2="1" y2="1" stroke="red"/>'
LONGEST_S = 6.0
"""Of processor time; each took 20 s and more, or for ever."""


def svg(body: str, more: str = "") -> str:
    return f"<svg {more}>{body}</svg>"


def path(course: str) -> str:
    return svg(f'{SQUARE}<path d="{course}" stroke="red"/>')


def dxf(*tags: tuple[int, object]) -> str:
    pairs = [(0, "SECTION"), (2, "ENTITIES"), *tags, (0, "ENDSEC"), (0, "EOF")]
    return "".join(f"{code}\n{value}\n" for code, value in pairs)


def spline(degree: int, count: int) -> str:
    knots = [*[0] * (degree + 1), *range(1, count - degree), *[count - degree] * (degree + 1)]
    points = [(code, f(at)) for at in range(count) for code, f in ((10, float), (20, math.sin))]
    return dxf((0, "SPLINE"), (71, degree), *((40, knot) for knot in knots), *points)


CIRCLES = "".join(
    f'<circle cx="50" cy="50" r="{40 + i * 1e-3}" stroke="red"/>' for i in range(5000)
)
FAR = r"a coordinate that is not a number or is beyond 1e9"
NO_NUMBER = "not a finite number"


@pytest.mark.parametrize(
    ("ending", "text", "sentence"),
    [
        ("svg", svg(f"<style>{'a' * 300_000}</style>{LINE}"), "enclose no facet"),
        ("svg", svg(f'<g transform="{"a" * 200_000}"/>'), "no line"),
        ("svg", svg(f'<g transform="{"translate (1 " * 50_000}"/>'), "no line"),
        ("svg", svg(LINE.replace('"1"', f'"1{" " * 200_000}x"', 1)), "x2 is '1 .*', not a number"),
        ("svg", svg(LINE, f'viewBox="0 0 1 1" width="1{" " * 200_000}x mm"'), "is not a length"),
        ("svg", svg(SQUARE + CIRCLES), "more than 100000 straight lines"),
        ("svg", svg(f'{SQUARE}<circle r="1e308" stroke="red"/>'), FAR),
        ("svg", svg(f'<g transform="scale(1e308)">{SQUARE}<circle r="9" stroke="red"/></g>'), FAR),
        ("svg", svg(f'<g transform="rotate(1e999)">{SQUARE}</g>'), NO_NUMBER),
        ("svg", svg(SQUARE.replace("black", "hsl(1e999,1,1)")), NO_NUMBER),
        ("svg", path("L 50 50"), "path 'L 50 50' does not begin with an M"),
        ("svg", path("Q 50 50 100 100"), "does not begin with an M"),
        ("svg", path("M0 0 A 1e308 1e308 0 0 1 100 100"), FAR),
        ("svg", path("M0 0 A 1e-308 1e308 45 0 1 100 100"), FAR),
        ("svg", path("M0 0 A 1 1 1e999 0 1 100 100"), NO_NUMBER),
        ("svg", path("M0 0 C 1e308 1e308 -1e308 -1e308 100 100"), FAR),
        ("dxf", dxf((0, "CIRCLE"), (40, "1e308")), FAR),
        ("dxf", dxf((0, "ELLIPSE"), (11, "1e308"), (40, "1e308"), (42, "1e308")), FAR),
        ("dxf", dxf((0, "LWPOLYLINE"), (10, "-1e308"), (20, 0), (42, 1), (10, 9), (20, 5)), FAR),
        ("dxf", spline(5000, 5001), "of degree 5000; 25 is the highest"),
        ("dxf", spline(3, 20_000), "more than 10000 straight lines"),
    ],
)  # fmt: skip
def test_it_ends_soon_and_in_a_sentence(
    ending: str, text: str, sentence: str, tmp_path: Path
) -> None:
    file = tmp_path / f"a.{ending}"
    file.write_text(text)
    begun = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(PatternError, match=sentence) as refused:
            mf.load(file)
    assert time.process_time() - begun < LONGEST_S
    assert "\n" not in refused.value.sentence


def test_one_huge_facet_beside_many_small_ones_is_refused(tmp_path: Path) -> None:
    """Facets are rows of one array: this file of 1 MB would be one of 3 GB."""
    count = 20_000
    at = np.linspace(0, 2 * np.pi, count, endpoint=False)
    ring = np.stack([np.cos(at), np.sin(at)], axis=1)
    after = np.roll(np.arange(count), -1)
    quads = np.stack([np.arange(count), np.arange(count) + count, after + count, after], axis=1)
    document = {
        "vertices_coords": np.concatenate([ring, 2 * ring]).tolist(),
        "faces_vertices": [list(range(count)), *quads.tolist()],
        "edges_vertices": np.concatenate([quads[:, [0, 3]], quads[:, :2], quads[:, 1:3]]).tolist(),
    }
    file = tmp_path / "a.fold"
    file.write_text(json.dumps(document))
    with pytest.raises(PatternError, match="a facet of 20000 corners, too many beside 20001"):
        mf.load(file)


def test_an_almost_straight_arc_does_not_make_the_drawing_large() -> None:
    """The default tolerance of the curves is by the box of what is drawn, not of whole circles."""
    circle = '<circle cx="50" cy="50" r="20" stroke="red"/>'
    wide = parse_svg(path("M0 0 A 1e6 1e6 0 0 1 100 0").replace("</svg>", f"{circle}</svg>"))
    assert wide.curve_tolerance == pytest.approx(0.1, rel=1e-3)
    assert np.isin(wide.curve, 1).sum() > 20
    flat = dxf((0, "LWPOLYLINE"), (10, 0), (20, 0), (42, "1e-12"), (10, 100), (20, 0))
    np.testing.assert_array_equal(parse_dxf(flat).ends, [[[0, 0], [100, 0]]])
