"""Readers of drawings by libraries of others: each returns straight pieces (n, 5), the operation by
its number and both ends in mm on the sheet.
"""

import io
import re
from itertools import pairwise

import ezdxf
import numpy as np
import pypdf
import svgelements
from scipy.spatial import cKDTree

from miurafab.fabrication.drawing.hpgl import UNITS_PER_MM
from miurafab.fabrication.drawing.layers import LAYERS
from miurafab.profiles import OPERATIONS

POINT_MM = 25.4 / 72


def segments(toolpath):
    """(n, 5) straight pieces: operation, then both ends."""
    return np.array(
        [
            (operation, *a, *b)
            for index, operation in enumerate(toolpath.operation.tolist())
            for a, b in pairwise(toolpath.stroke(index).tolist())
        ]
    )


def assert_same(found, toolpath, within):
    """The pieces ``found`` are those of ``toolpath``, one to one, whatever their direction."""
    wanted, found = segments(toolpath), np.array(found)
    for operation in range(len(OPERATIONS)):
        ours = wanted[wanted[:, 0] == operation][:, 1:]
        theirs = found[found[:, 0] == operation][:, 1:]
        assert len(ours) == len(theirs)
        if len(ours):
            both = np.concatenate([theirs, theirs[:, [2, 3, 0, 1]]])
            gap, taken = cKDTree(both).query(ours, p=np.inf)
            assert gap.max() <= within
            assert len(set((taken % len(theirs)).tolist())) == len(ours), "drawn twice"


def read_dxf(text):
    """By ezdxf, whose audit must find nothing."""
    document = ezdxf.read(io.StringIO(text))
    assert not document.audit().has_errors
    found = []
    for entity in document.modelspace():
        operation = OPERATIONS.index(entity.dxf.layer.partition("-")[0])
        if entity.dxftype() == "LINE":
            start, end = entity.dxf.start, entity.dxf.end
            found.append((operation, start.x, start.y, end.x, end.y))
        else:
            points = [tuple(p) for p in entity.get_points("xy")]
            points += points[:1] if entity.closed else []
            found += [(operation, *a, *b) for a, b in pairwise(points)]
    return found


def read_svg(text, height):
    """By svgelements, which converts to pixels at 96 dpi: that it comes back to mm proves the real
    size.
    """
    operation_of = {each.colour.lower(): OPERATIONS.index(each.operation) for each in LAYERS}
    document = svgelements.SVG.parse(io.StringIO(text))
    found = []
    for path in document.elements(lambda e: isinstance(e, svgelements.Path)):
        operation = operation_of[path.stroke.hexrgb or path.stroke.hex]
        for piece in path:
            if isinstance(piece, svgelements.Line | svgelements.Close) and piece.start:
                ends = [
                    (p.x * 25.4 / 96, height - p.y * 25.4 / 96) for p in (piece.start, piece.end)
                ]
                if np.hypot(*np.subtract(*ends)) > 1e-6:
                    found.append((operation, *ends[0], *ends[1]))
    return found


def read_pdf(content):
    """By pypdf: of each page its size in mm, and the pieces."""
    reader = pypdf.PdfReader(io.BytesIO(content))
    return [
        (
            (float(page.mediabox.width) * POINT_MM, float(page.mediabox.height) * POINT_MM),
            list(_pdf_segments(page, reader)),
        )
        for page in reader.pages
    ]


def _pdf_segments(page, reader):
    by_colour = {
        tuple(round(int(each.colour[k : k + 2], 16) / 255, 3) for k in (1, 3, 5)): each.operation
        for each in LAYERS
    }
    content = pypdf.generic.ContentStream(page.get_contents(), reader)
    operation, pieces, start, at = None, [], None, None
    for operands, operator in content.operations:
        numbers = [float(o) for o in operands if isinstance(o, int | float)]
        if operator == b"RG":
            operation = OPERATIONS.index(by_colour[tuple(round(n, 3) for n in numbers)])
        elif operator == b"m":
            start = at = numbers
        elif operator == b"l":
            pieces.append((*at, *numbers))
            at = numbers
        elif operator == b"h":
            pieces.append((*at, *start))
            at = start
        elif operator in (b"S", b"s"):
            for piece in pieces:
                yield (operation, *(n * POINT_MM for n in piece))
            pieces = []


def read_hpgl(text):
    """By plain code: pens are layers, units 0.025 mm."""
    assert text.startswith("IN;")
    assert text.rstrip().endswith("SP0;")
    operation_of = {each.pen: OPERATIONS.index(each.operation) for each in LAYERS}
    found, pen, at = [], None, (0, 0)
    for word in re.findall(r"([A-Z]{2})([\d,]*);", text):
        numbers = [int(n) for n in word[1].split(",") if n]
        points = list(zip(numbers[::2], numbers[1::2], strict=False))
        if word[0] == "SP":
            pen = numbers[0]
        elif word[0] == "PD":
            for point in points:
                found.append((operation_of[pen], *at, *point))
                at = point
        elif word[0] == "PU" and points:
            at = points[-1]
    return [(operation, *(n / UNITS_PER_MM for n in rest)) for operation, *rest in found]
