"""SVG crease patterns in the form of Origami Simulator and Rabbit Ear.

The stroke colour is the assignment: #000 border, #f00 mountain, #00f valley, #0f0 cut, #ff0 facet
(flat), #f0f hinge (unassigned); the opacity is the fold angle, |angle| = 180 degrees x opacity
(https://origamisimulator.org, "File > Design Tips"). Origami Simulator joins ends within 3 user
units, so the drawing is scaled until its shortest line has at least 10 user units; width, height
and ``viewBox`` keep its size in millimetres. Rabbit Ear's ``data-assignment`` and
``data-foldAngle`` repeat both exactly, and take precedence when read.
"""

from __future__ import annotations

import colorsys
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from html import escape
from xml.etree.ElementTree import Element

import numpy as np

from miurafab.errors import PatternError, shown
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import ASSIGNMENTS
from miurafab.origami.formats.crease_lines import CreaseLines, DrawnLine, straightened
from miurafab.origami.formats.lines import finite_number, xml_root
from miurafab.origami.formats.svg_shapes import NUMBER, shapes, tag_of, value_of
from miurafab.units import parse_length

_STROKES = {
    "B": "#000000", "M": "#ff0000", "V": "#0000ff", "C": "#00ff00", "F": "#ffff00",
    "U": "#ff00ff", "J": "#ffff00",
}  # fmt: skip
_LETTERS = {(0, 0, 0): "B", (255, 0, 0): "M", (0, 0, 255): "V", (0, 255, 0): "C"}
_LETTERS |= {(255, 255, 0): "F", (255, 0, 255): "U"}
_SHORTEST = 10.0
"""User units of the shortest line."""
_BETWEEN = " \t\r\n,"
_UNKNOWN = frozenset({"use", "image", "foreignObject"})
"""Elements that may hold lines, which are not read."""
Matrix = Floats


def svg_text(lines: CreaseLines, title: str = "") -> str:
    """``lines``, whose y points up, as an upright SVG drawing."""
    low, high = lines.ends.reshape(-1, 2).min(axis=0), lines.ends.reshape(-1, 2).max(axis=0)
    lengths = np.linalg.norm(lines.ends[:, 1] - lines.ends[:, 0], axis=1)
    real = lengths[lengths > 1e-6 * lengths.mean()]
    scale = max(1.0, _SHORTEST / float(real.min()))
    width, height = ((high - low) * scale).tolist()
    x = ((lines.ends[..., 0] - low[0]) * scale).tolist()
    y = ((high[1] - lines.ends[..., 1]) * scale).tolist()
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width / scale!r}mm" '
        f'height="{height / scale!r}mm" viewBox="0 0 {width!r} {height!r}">\n'
    ]
    if title:
        parts.append(f"<title>{escape(shown(title), quote=False)}</title>\n")
    parts.append(f'<g fill="none" stroke-width="{0.15 * _SHORTEST!r}" stroke-linecap="round">\n')
    degrees = np.degrees(lines.fold_angle).tolist()
    for letter, angle, (x0, x1), (y0, y1) in zip(
        lines.assignment.tolist(), degrees, x, y, strict=True
    ):
        folds = letter in "MV"
        opacity = f' stroke-opacity="{min(abs(angle) / 180.0, 1.0)!r}"' if folds else ""
        exact = f' data-foldAngle="{angle!r}"' if folds else ""
        parts.append(
            f'<line x1="{x0!r}" y1="{y0!r}" x2="{x1!r}" y2="{y1!r}" stroke="{_STROKES[letter]}"'
            f'{opacity} data-assignment="{letter}"{exact}/>\n'
        )
    parts.append("</g>\n</svg>\n")
    return "".join(parts)


@dataclass(frozen=True)
class _Look:
    """The inherited style of an element: stroke, opacity of the stroke and of the groups around it,
    and the matrix from user units to millimetres.
    """

    stroke: str
    stroke_opacity: float
    group_opacity: float
    matrix: Matrix

    @property
    def opacity(self) -> float:
        return min(self.stroke_opacity * self.group_opacity, 1.0)


@np.errstate(over="ignore", invalid="ignore")
def parse_svg(text: str, curve_tolerance: float | None = None) -> CreaseLines:
    """The lines of an SVG drawing, in millimetres if it has a size, else 1 unit = 1 mm.

    Curves become straight lines within ``curve_tolerance``, mm
    (:func:`~miurafab.origami.formats.crease_lines.straightened`). Lines without a stroke are left
    out. A drawing whose folds are all opaque, and that gives no angle, tells no fold angles.
    """
    root = xml_root(text, "an SVG drawing")
    if tag_of(root) != "svg":
        raise PatternError("it is not an SVG drawing.")
    rules = _style_rules(root)
    drawn: list[DrawnLine] = []
    left_out: dict[str, int] = {}
    sized = False
    for element, look in _walk(root, _Look("none", 1.0, 1.0, _millimetres(root)), rules):
        tag = tag_of(element)
        if tag in _UNKNOWN:
            left_out[tag] = left_out.get(tag, 0) + 1
        letter = _assignment(element, look)
        if letter is None:
            continue
        angle = _fold_angle(element, look, letter)
        sized |= element.get("data-foldAngle") is not None or (letter in "MV" and look.opacity < 1)
        upwards = look.matrix * np.array([[1.0], [-1.0]])
        drawn += [DrawnLine(shape.moved(upwards), letter, angle) for shape in shapes(element)]
    if not sized:
        drawn = [replace(line, angle=math.nan) if line.letter in "MV" else line for line in drawn]
    return straightened(drawn, curve_tolerance, left_out)


def _walk(
    element: Element, look: _Look, rules: dict[str, dict[str, str]]
) -> Iterator[tuple[Element, _Look]]:
    """Every drawn element with its look; definitions are not drawn."""
    if tag_of(element) in ("defs", "symbol", "clipPath", "mask", "pattern", "marker", "style"):
        return
    style: dict[str, str] = dict(rules.get(tag_of(element), {}))
    for name in (element.get("class") or "").split():
        style |= rules.get("." + name, {})
    style |= _declarations(element.get("style") or "")

    def styled(name: str) -> str | None:
        return style.get(name, element.get(name))

    hidden = styled("display") == "none" or styled("visibility") == "hidden"
    look = _Look(
        "none" if hidden else (styled("stroke") or look.stroke).strip().lower(),
        _opacity(styled("stroke-opacity"), look.stroke_opacity),
        look.group_opacity * _opacity(styled("opacity"), 1.0),
        _composed(look.matrix, _transform(element.get("transform") or "")),
    )
    yield element, look
    for child in element:
        yield from _walk(child, look, rules)


def _opacity(text: str | None, default: float) -> float:
    if text is None:
        return default
    return value_of(text.strip().rstrip("%"), "an opacity") / (100 if "%" in text else 1)


def _style_rules(root: Element) -> dict[str, dict[str, str]]:
    """Declarations of the style sheets by their selector, a tag or a ``.class``."""
    rules: dict[str, dict[str, str]] = {}
    for element in root.iter():
        if tag_of(element) == "style":
            for rule in (element.text or "").split("}"):
                selectors, _, body = rule.rpartition("{")
                for selector in selectors.rpartition("{")[2].split(","):
                    rules.setdefault(selector.strip(), {}).update(_declarations(body))
    return rules


def _declarations(text: str) -> dict[str, str]:
    pairs = (part.split(":", 1) for part in text.split(";") if ":" in part)
    return {name.strip(): value.strip() for name, value in pairs}


def _assignment(element: Element, look: _Look) -> str | None:
    letter = (element.get("data-assignment") or "").upper()
    if letter in ASSIGNMENTS:
        return letter
    colour = _colour(look.stroke)
    if colour is None or look.opacity == 0.0:
        return None
    near = min(
        _LETTERS, key=lambda known: sum((a - b) ** 2 for a, b in zip(known, colour, strict=True))
    )
    return _LETTERS[near]


def _colour(text: str) -> tuple[int, int, int] | None:
    if re.fullmatch(r"#[0-9a-f]{3}", text):
        text = "#" + "".join(digit * 2 for digit in text[1:])
    if re.fullmatch(r"#[0-9a-f]{6}", text):
        red, green, blue = (int(text[at : at + 2], 16) for at in (1, 3, 5))
        return red, green, blue
    match = re.fullmatch(r"rgba?\(([^)]*)\)", text)
    if match:
        numbers = NUMBER.findall(match[1])
        if len(numbers) >= 3:
            full = 2.55 if "%" in match[1] else 1.0
            red, green, blue = (round(finite_number(n, "a colour") * full) for n in numbers[:3])
            return red, green, blue
    match = re.fullmatch(r"hsla?\(([^)]*)\)", text)
    if match and len(numbers := NUMBER.findall(match[1])) >= 3:
        hue, full, light = (finite_number(number, "a colour") for number in numbers[:3])
        parts = colorsys.hls_to_rgb(hue / 360 % 1, light / 100, full / 100)
        red, green, blue = (round(255 * part) for part in parts)
        return red, green, blue
    if text in ("none", "", "transparent"):
        return None
    from PIL import ImageColor  # only now: few drawings name colours

    if text in ImageColor.colormap:
        return _colour(str(ImageColor.colormap[text]))
    raise PatternError(f"the stroke '{text[:40]}' is not a colour; write it as #rrggbb.")


def _fold_angle(element: Element, look: _Look, letter: str) -> float:
    angle = element.get("data-foldAngle")
    if angle is not None:
        return math.radians(value_of(angle, "data-foldAngle"))
    if letter in "MV":
        return math.copysign(math.pi * look.opacity, 1.0 if letter == "V" else -1.0)
    return 0.0


def _millimetres(root: Element) -> Matrix:
    """(2, 3) from user units to millimetres, by width, height and viewBox, else one to one."""
    box = [float(text) for text in NUMBER.findall(root.get("viewBox") or "")]
    width = root.get("width") or ""
    if len(box) == 4 and box[2] > 0 and re.search(r"(mm|cm|in|m)\s*$", width):
        scale = parse_length(width) / box[2]
        return np.array([[scale, 0.0, -box[0] * scale], [0.0, scale, -box[1] * scale]])
    return np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def _transform(text: str) -> Matrix:
    """(2, 3) of an SVG transform list."""
    whole = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    for part in text.split(")")[:-1]:
        name, _, inside = part.rpartition("(")
        name = name.strip(_BETWEEN)
        n = [finite_number(number, f"'{name[:40]}'") for number in NUMBER.findall(inside)]
        try:
            whole = _composed(whole, _one_transform(name, n))
        except IndexError:
            raise PatternError(f"the transform '{name}' lacks a number.") from None
    return whole


def _one_transform(name: str, n: list[float]) -> Matrix:
    if name == "matrix":
        return np.array([[n[0], n[2], n[4]], [n[1], n[3], n[5]]])
    if name == "translate":
        return np.array([[1.0, 0.0, n[0]], [0.0, 1.0, n[1] if len(n) > 1 else 0.0]])
    if name == "scale":
        return np.array([[n[0], 0.0, 0.0], [0.0, n[1] if len(n) > 1 else n[0], 0.0]])
    if name in ("skewX", "skewY"):
        slope = math.tan(math.radians(n[0]))
        x, y = (slope, 0.0) if name == "skewX" else (0.0, slope)
        return np.array([[1.0, x, 0.0], [y, 1.0, 0.0]])
    if name == "rotate":
        c, s = math.cos(math.radians(n[0])), math.sin(math.radians(n[0]))
        x, y = (n[1], n[2]) if len(n) > 1 else (0.0, 0.0)
        return np.array([[c, -s, x - c * x + s * y], [s, c, y - s * x - c * y]])
    raise PatternError(f"'{name[:40]}' is not a transform of SVG.")


def _composed(outer: Matrix, inner: Matrix) -> Matrix:
    with np.errstate(invalid="ignore", over="ignore"):
        linear = outer[:, :2] @ inner[:, :2]
        shift = outer[:, :2] @ inner[:, 2] + outer[:, 2]
    return np.concatenate([linear, shift[:, None]], axis=1)
