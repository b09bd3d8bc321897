"""CP, OPX and DXF: crease patterns as lines with a type and without a fold angle.

ORIPA's type numbers are 0 auxiliary, 1 border or cut, 2 mountain, 3 valley, and its y axis points
down (ORIPA, ``OriLine.java`` and ``ExporterDXF``, which reverses y). A CP file has
``type x0 y0 x1 y1`` in each line; an OPX file has the same as a Java bean in XML. DXF is written as
R12 (AC1009) with LINE entities on the layers CutLine, MountainLine, ValleyLine and AuxLine, in the
colours from which ORIPA reads the types: green, red, blue.

None of the three formats stores fold angles: mountains and valleys are read as folded flat.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

import numpy as np

from miurafab.errors import PatternError, shown
from miurafab.origami.formats.crease_lines import CreaseLines

_TYPE_OF_LETTER = {"B": 1, "C": 1, "M": 2, "V": 3, "F": 0, "U": 0, "J": 0}
_LETTER_OF_TYPE = {0: "F", 1: "B", 2: "M", 3: "V"}
_LAYERS = {0: ("AuxLine", 8), 1: ("CutLine", 3), 2: ("MountainLine", 1), 3: ("ValleyLine", 5)}


def cp_text(lines: CreaseLines) -> str:
    """``lines`` as a CP file; y downwards, mm."""
    return "".join(f"{kind} {x0!r} {y0!r} {x1!r} {y1!r}\n" for kind, x0, y0, x1, y1 in _down(lines))


def parse_cp(text: str) -> CreaseLines:
    """The lines of a CP file. Raises ``PatternError`` naming the line that cannot be read."""
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        try:
            kind, (x0, y0, x1, y1) = _plain_int(words[0]), map(_plain_float, words[1:])
        except ValueError:
            raise PatternError(
                f"line {number} is '{line.strip()[:60]}', not a type and four coordinates."
            ) from None
        # Orihime adds types above 3 for further auxiliary lines
        rows.append((_LETTER_OF_TYPE.get(kind, "F"), x0, -y0, x1, -y1))
    return _lines(rows)


def _plain_int(word: str) -> int:
    """A whole number in ASCII digits alone: Python knows more, such as 1_0."""
    if not word.isascii() or not word.isdigit() or len(word) > 9:
        raise ValueError
    return int(word)


def _plain_float(word: str) -> float:
    if not word.isascii() or "_" in word:
        raise ValueError
    return float(word)


def opx_text(lines: CreaseLines, title: str = "") -> str:
    """``lines`` as an OPX file of ORIPA."""
    java = ElementTree.Element("java", {"version": "1.8.0", "class": "java.beans.XMLDecoder"})
    data = ElementTree.SubElement(java, "object", {"class": "oripa.DataSet"})
    rows = list(_down(lines))
    size = max((abs(value) for row in rows for value in row[1:]), default=0.0)
    _property(data, "mainVersion", "int", "1")
    _property(data, "subVersion", "int", "1")
    _property(data, "paperSize", "double", repr(size))
    array = ElementTree.SubElement(
        ElementTree.SubElement(data, "void", {"property": "lines"}),
        "array",
        {"class": "oripa.OriLineProxy", "length": str(len(rows))},
    )
    for index, (kind, *ends) in enumerate(rows):
        place = ElementTree.SubElement(array, "void", {"index": str(index)})
        line = ElementTree.SubElement(place, "object", {"class": "oripa.OriLineProxy"})
        _property(line, "type", "int", str(kind))
        for name, value in zip(("x0", "y0", "x1", "y1"), ends, strict=True):
            _property(line, name, "double", repr(value))
    if title:
        _property(data, "title", "string", shown(title))
    ElementTree.indent(java, " ")
    head = '<?xml version="1.0" encoding="UTF-8"?>\n'
    return head + ElementTree.tostring(java, encoding="unicode") + "\n"


def _property(parent: ElementTree.Element, name: str, kind: str, value: str) -> None:
    holder = ElementTree.SubElement(parent, "void", {"property": name})
    ElementTree.SubElement(holder, kind).text = value


def parse_opx(text: str) -> CreaseLines:
    """The lines of an OPX file. Raises ``PatternError`` saying what cannot be read."""
    rows = []
    for line in xml_root(text, "an OPX file").iter("object"):
        if line.get("class") != "oripa.OriLineProxy":
            continue
        # Java omits zeros
        values = {"type": 0.0, "x0": 0.0, "y0": 0.0, "x1": 0.0, "y1": 0.0}
        for void in line.findall("void"):
            name = void.get("property")
            if name in values and len(void):
                values[name] = finite_number(void[0].text or "", f"'{name}' of a line")
        letter = _LETTER_OF_TYPE.get(int(values["type"]), "F")
        rows.append((letter, values["x0"], -values["y0"], values["x1"], -values["y1"]))
    return _lines(rows)


def xml_root(text: str, what: str) -> ElementTree.Element:
    """The root of the XML ``text``; refuses entities, which can grow without bound.

    Raises ``PatternError`` saying that it is not ``what``.
    """
    if "<!ENTITY" in text:
        raise PatternError(f"it is not {what}: it declares XML entities.")
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as fault:
        raise PatternError(f"it is not {what}: {fault}.") from None


def dxf_text(lines: CreaseLines) -> str:
    """``lines`` as an R12 DXF file in millimetres, y upwards."""
    parts = ["0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n"]
    parts.append(f"0\nSECTION\n2\nTABLES\n0\nTABLE\n2\nLAYER\n70\n{len(_LAYERS)}\n")
    for name, colour in _LAYERS.values():
        parts.append(f"0\nLAYER\n2\n{name}\n70\n0\n62\n{colour}\n6\nCONTINUOUS\n")
    parts.append("0\nENDTAB\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n")
    kinds = (_TYPE_OF_LETTER[letter] for letter in lines.assignment.tolist())
    for kind, ((x0, y0), (x1, y1)) in zip(kinds, lines.ends.tolist(), strict=True):
        name, colour = _LAYERS[kind]
        parts.append(
            f"0\nLINE\n8\n{name}\n62\n{colour}\n"
            f"10\n{x0!r}\n20\n{y0!r}\n30\n0.0\n11\n{x1!r}\n21\n{y1!r}\n31\n0.0\n"
        )
    parts.append("0\nENDSEC\n0\nEOF\n")
    return "".join(parts)


def finite_number(text: str, what: str) -> float:
    """The finite number in ``text``. Raises ``PatternError`` naming ``what`` it is."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PatternError(f"{what} is '{text.strip()[:40]}', not a finite number.")
    return value


def _down(lines: CreaseLines) -> Iterator[tuple[int, float, float, float, float]]:
    """Type and coordinates of each line, y downwards."""
    for letter, ((x0, y0), (x1, y1)) in zip(
        lines.assignment.tolist(), lines.ends.tolist(), strict=True
    ):
        # 0.0 - y, since -y would give -0.0
        yield _TYPE_OF_LETTER[letter], x0, 0.0 - y0, x1, 0.0 - y1


def _lines(rows: list[tuple[str, float, float, float, float]]) -> CreaseLines:
    ends = np.array([row[1:] for row in rows], dtype=np.float64).reshape(-1, 2, 2)
    return CreaseLines(
        ends, np.array([row[0] for row in rows], dtype="U1"), np.full(len(rows), np.nan)
    )
