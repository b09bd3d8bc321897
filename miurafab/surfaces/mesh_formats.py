"""Readers of three mesh formats: OFF, PLY of triangle strips, and 3MF.

Each takes the bytes of a file and returns vertices (V, 3) in mm and triangles (F, 3). Polygons
become fans of triangles. A reader raises ``ValueError`` with the rest of the sentence "the file
cannot be read as a mesh: ..."; files with no unit are in millimetres.

- OFF: http://www.geomview.org/docs/html/OFF.html. The end of a line means nothing, except that
  colours may follow a face on its line.
- PLY: Greg Turk, "The PLY Polygon File Format" (1994). Strips are an element ``tristrips`` whose
  lists join several strips by -1, as in the scans of Cyberware.
- 3MF: core specification 1.3, sections 3 and 4, https://github.com/3MFConsortium/spec_core, and the
  paths of the production extension.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any
from xml.etree import ElementTree

import numpy as np

from miurafab.errors import shown
from miurafab.geometry.arrays import Floats, Ints

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_PlyElements = list[tuple[str, int, list[list[str]]]]
"""Name, count and properties of each element."""

_3MF_UNITS_MM = {
    "micron": 1e-3, "millimeter": 1.0, "centimeter": 10.0, "inch": 25.4, "foot": 304.8,
    "meter": 1000.0,
}  # fmt: skip
_3MF_ITEM = "{*}build/{*}item"
_3MF_DEPTH = 16
_3MF_LARGEST = 1 << 30
_3MF_OBJECTS = 10_000
_3MF_TRIANGLES = 20_000_000


def read_off(content: bytes) -> tuple[Floats, Ints]:
    """An OFF file in text, with faces of any number of corners over any number of lines."""
    lines = [line.split(b"#")[0].split() for line in content.splitlines()]
    lines = [line for line in lines if line]
    if not lines or not lines[0][0].upper().endswith(b"OFF"):
        begin = lines[0][0][:20].decode("ascii", "replace") if lines else ""
        raise ValueError(f"its first word is '{shown(begin)}' and not OFF")
    word, first = lines[0][0], lines[0][1:]
    head = word.upper()[:-3]
    if b"BINARY" in first:
        raise ValueError("it is a binary OFF file; save it as text")
    lines = [first, *lines[1:]] if first else lines[1:]
    if b"4" in head or word.endswith(b"nOFF"):
        raise ValueError("its vertices are not in three dimensions")
    counts, rest = _off_counts(lines)
    if len(counts) < 2:
        raise ValueError("it does not tell how many vertices and faces it has")
    vertices, faces = counts[:2]
    if min(vertices, faces) < 0:
        raise ValueError(f"it tells of {vertices} vertices and {faces} faces")
    width = 3 + 3 * (b"N" in head) + 4 * (b"C" in head.replace(b"ST", b"")) + 2 * (b"ST" in head)
    if len(rest) >= vertices + faces and all(len(line) >= 3 for line in rest[:vertices]):
        points = np.array([line[:3] for line in rest[:vertices]], dtype=np.float64)
        by_line = rest[vertices : vertices + faces]
        if all(len(line) > int(line[0]) for line in by_line):
            polygons = [line[1 : 1 + int(line[0])] for line in by_line]
            return points.reshape(-1, 3), _fans(polygons)
    tokens = [token for line in rest for token in line]
    points = np.array(tokens[: vertices * width], dtype=np.float64).reshape(vertices, width)[:, :3]
    polygons, at = [], vertices * width
    for _ in range(faces):
        corners = int(tokens[at])
        if corners < 1:  # or it would be read again, as often as there are faces
            raise ValueError(f"face {len(polygons) + 1} has {corners} corners")
        polygons.append(tokens[at + 1 : at + 1 + corners])
        if len(polygons[-1]) < corners:
            raise ValueError(f"it ends within face {len(polygons)} of {faces}")
        at += 1 + corners
    return points, _fans(polygons)


def _off_counts(lines: list[list[bytes]]) -> tuple[list[int], list[list[bytes]]]:
    """The counts of vertices, faces and edges, over any number of lines, and the lines after them.

    Some programs leave out the third, of edges: then a line of coordinates follows on the second.
    """
    counts: list[int] = []
    for at, line in enumerate(lines):
        if len(counts) == 2 and len(line) > 1:
            return counts, lines[at:]
        own = 3 - len(counts)
        counts += [int(token) for token in line[:own]]
        if len(counts) == 3:
            return counts, [line[own:], *lines[at + 1 :]] if line[own:] else lines[at + 1 :]
    return counts, []


def _fans(polygons: list[list[bytes]]) -> Ints:
    sizes = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    parts = []
    for size in np.unique(sizes[sizes >= 3]).tolist():
        same = np.array([p for p in polygons if len(p) == size], dtype=np.int64)
        for k in range(1, size - 1):
            parts.append(same[:, [0, k, k + 1]])
    return np.concatenate(parts) if parts else np.zeros((0, 3), dtype=np.int64)


def read_ply_strips(content: bytes) -> tuple[Floats, Ints] | None:
    """A PLY file whose triangles are strips; None for one without."""
    end = content.find(b"end_header")
    if end < 0 or b"tristrips" not in content[:end]:
        return None
    header = content[:end].decode("ascii", "replace").splitlines()
    body = content[content.index(b"\n", end) + 1 :]
    kind = ""
    elements: _PlyElements = []
    for line in header:
        words = line.split()
        if words[:1] == ["format"]:
            kind = words[1]
        elif words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
            if elements[-1][1] > len(body):
                raise ValueError(f"it is too short for {words[2]} of '{words[1]}'")
        elif words[:1] == ["property"] and elements:
            elements[-1][2].append(words[1:])
    strips = [kinds for name, _, kinds in elements if name == "tristrips"]
    if not strips:  # a comment named them
        return None
    named = [words[-1] for words in strips[0] if words[0] == "list"]
    if not named:
        raise ValueError("its element 'tristrips' has no list")
    values = _ply_ascii(elements, body) if kind == "ascii" else _ply_binary(elements, body, kind)
    vertex = values["vertex"]
    points = np.stack([np.asarray(vertex[axis], dtype=np.float64) for axis in "xyz"], axis=1)
    lists = values["tristrips"][named[0]]
    made = [_strip_triangles(np.asarray(strip, dtype=np.int64)) for strip in lists]
    return points, np.vstack([np.zeros((0, 3), dtype=np.int64), *made])


def _strip_triangles(strip: Ints) -> Ints:
    """The triangles of strips that -1 keeps apart; every other one is turned over."""
    if len(strip) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    place = np.arange(len(strip))
    start = np.maximum.accumulate(np.where(strip < 0, place + 1, 0))
    three = np.stack([strip[:-2], strip[1:-1], strip[2:]], axis=1)
    odd = (place[:-2] - start[:-2]) % 2 == 1
    three = np.where(odd[:, None], three[:, ::-1], three)
    return three[(three >= 0).all(axis=1)]


def _ply_ascii(elements: _PlyElements, body: bytes) -> dict[str, dict[str, Any]]:
    tokens, at = body.split(), 0
    values: dict[str, dict[str, Any]] = {}
    for name, count, properties in elements:
        columns: dict[str, list[Any]] = {words[-1]: [] for words in properties}
        for _ in range(count):
            for words in properties:
                if words[0] == "list":
                    length = int(tokens[at])
                    if length < 0:
                        raise ValueError(f"a list in it has {length} entries")
                    columns[words[-1]].append([int(t) for t in tokens[at + 1 : at + 1 + length]])
                    at += 1 + length
                else:
                    columns[words[-1]].append(float(tokens[at]))
                    at += 1
        values[name] = columns
    return values


def _ply_binary(elements: _PlyElements, body: bytes, kind: str) -> dict[str, dict[str, Any]]:
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}[kind]
    values: dict[str, dict[str, Any]] = {}
    at = 0
    for name, count, properties in elements:
        if all(words[0] != "list" for words in properties):
            dtype = np.dtype([(words[-1], order + _PLY_TYPES[words[0]]) for words in properties])
            table = np.frombuffer(body, dtype, count, at)
            at += table.nbytes
            values[name] = {words[-1]: table[words[-1]] for words in properties}
            continue
        columns: dict[str, list[Any]] = {words[-1]: [] for words in properties}
        for _ in range(count):
            for words in properties:
                length = 1
                if words[0] == "list":
                    size = np.frombuffer(body, order + _PLY_TYPES[words[1]], 1, at)
                    length, at = int(size[0]), at + size.nbytes
                    if length < 0:
                        raise ValueError(f"a list in it has {length} entries")
                item = np.frombuffer(body, order + _PLY_TYPES[words[-2]], length, at)
                at += item.nbytes
                columns[words[-1]].append(item if words[0] == "list" else item[0])
        values[name] = columns
    return values


def read_3mf(content: bytes) -> tuple[Floats, Ints]:
    """All meshes that a 3MF package builds, each at its place, in millimetres."""
    package = zipfile.ZipFile(io.BytesIO(content))
    if sum(entry.file_size for entry in package.infolist()) > _3MF_LARGEST:
        raise ValueError(f"it unpacks to more than {_3MF_LARGEST >> 30} GB; simplify the mesh")
    models = {
        "/" + name.lstrip("/"): ElementTree.fromstring(package.read(name))
        for name in package.namelist()
        if name.lower().endswith(".model")
    }
    roots = [path for path, model in models.items() if model.find(_3MF_ITEM) is not None]
    if not roots:
        raise ValueError("it builds no object")
    root = roots[0]
    objects: dict[tuple[str, str], _PackedObject] = {}
    for path, model in models.items():
        for found in model.iterfind("{*}resources/{*}object"):
            number = found.get("id", "")
            if objects.setdefault((path, number), _PackedObject(found)).element is not found:
                raise ValueError(f"two of its objects are called '{shown(number)}'")
    parts: list[tuple[Floats, Ints]] = []
    triangles = 0
    for part in _placed(objects, root, models[root].iterfind(_3MF_ITEM), np.eye(4, 3), 0):
        parts.append(part)
        triangles += len(part[1])
        if len(parts) > _3MF_OBJECTS:
            raise ValueError(f"it builds more than {_3MF_OBJECTS:,} objects")
        if triangles > _3MF_TRIANGLES:
            raise ValueError(f"it builds more than {_3MF_TRIANGLES:,} triangles; simplify the mesh")
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    unit = models[root].get("unit", "millimeter")
    points = np.concatenate([vertices for vertices, _ in parts]) * _3MF_UNITS_MM[unit]
    return points, np.concatenate(
        [faces + start for (_, faces), start in zip(parts, starts, strict=False)]
    )


class _PackedObject:
    """An object of a 3MF package, whose mesh is read once, however often it is built."""

    def __init__(self, element: ElementTree.Element) -> None:
        self.element = element

    @cached_property
    def mesh(self) -> tuple[Floats, Ints]:
        """Its own vertices and triangles, none of an object that has components alone."""
        corners = self.element.iterfind("{*}mesh/{*}vertices/{*}vertex")
        points = np.array([[v.get(axis) for axis in "xyz"] for v in corners], dtype=np.float64)
        triangles = self.element.iterfind("{*}mesh/{*}triangles/{*}triangle")
        faces = np.array(
            [[t.get(corner) for corner in ("v1", "v2", "v3")] for t in triangles], dtype=np.int64
        )
        return points.reshape(-1, 3), faces.reshape(-1, 3)

    def components(self) -> Iterator[ElementTree.Element]:
        """The references to the objects that it consists of."""
        return self.element.iterfind("{*}components/{*}component")


def _placed(
    objects: Mapping[tuple[str, str], _PackedObject],
    path: str,
    references: Iterable[ElementTree.Element],
    place: Floats,
    depth: int,
) -> Iterator[tuple[Floats, Ints]]:
    """The meshes of the objects that ``references`` of the model file ``path`` name, and of their
    components, under the transform ``place`` (4, 3); empty for one that has components alone.
    """
    if depth > _3MF_DEPTH:
        raise ValueError("its components are nested too deeply")
    for part in references:
        there, number = _path_of(part, path), part.get("objectid", "")
        if (there, number) not in objects:  # each would take time, and count as no object
            raise ValueError(f"it refers to object '{shown(number)}', which it does not hold")
        found = objects[there, number]
        inner = _transform(part)
        both = np.concatenate([inner[:3] @ place[:3], inner[3:] @ place[:3] + place[3]])
        points, faces = found.mesh
        yield points @ both[:3] + both[3], faces
        yield from _placed(objects, there, found.components(), both, depth + 1)


def _path_of(part: ElementTree.Element, path: str) -> str:
    """The model file of a component; the production extension may name another."""
    return next((value for key, value in part.items() if key.endswith("}path")), path)


def _transform(part: ElementTree.Element) -> Floats:
    """(4, 3) the transform of row vectors; the identity for none."""
    text = part.get("transform")
    if text is None:
        return np.eye(4, 3)
    return np.array(text.split(), dtype=np.float64).reshape(4, 3)
