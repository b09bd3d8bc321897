"""OBJ, STL and GLB: a sheet as a mesh of its facets, for renderers, printers and other programs.

OBJ keeps facets as polygons; STL and GLB hold triangles. GLB (glTF 2.0 in one binary file, Khronos
Group, sections 3 and 4) is in metres with y up. It contains each triangle twice, once for each side
of the paper, in two colours. It has no normals, so that a viewer must use flat shading. A folding
motion has one morph target for each frame, at even intervals. Between two frames a viewer blends,
which only approximates the motion.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.version import __version__

FRONT, BACK = (0.90, 0.81, 0.62), (0.21, 0.40, 0.55)
"""The colours of the two sides of the paper, linear RGB in 0..1."""
_FLOAT, _UINT = 5126, 5125  # glTF component types
_ARRAY, _INDEX = 34962, 34963  # glTF buffer targets


def obj_text(points: Floats, faces: Ints, title: str = "") -> str:
    """The facets (F, k), -1 padded, at ``points`` (V, 3), mm, as a Wavefront OBJ file."""
    head = f"# {' '.join(title.split())}, written by miurafab {__version__}; millimetres\n"
    vertices = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
    polygons = "".join(
        "f " + " ".join(str(v + 1) for v in face if v >= 0) + "\n" for face in faces.tolist()
    )
    return head + vertices + polygons


def stl_bytes(points: Floats, triangles: Ints) -> bytes:
    """The ``triangles`` (n, 3) of ``points`` (V, 3), mm, as a binary STL file."""
    corners = points[triangles]
    normal = vector_product(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    record = np.dtype([("facet", "<f4", (4, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(triangles), dtype=record)
    rows["facet"][:, 0] = normal / np.where(length > 0, length, 1.0)
    rows["facet"][:, 1:] = corners
    head = f"miurafab {__version__}, millimetres".encode("ascii").ljust(80)
    return head + struct.pack("<I", len(triangles)) + rows.tobytes()


def glb_bytes(
    points: Floats,
    triangles: Ints,
    frames: Floats | None = None,
    seconds: float = 6.0,
) -> bytes:
    """The ``triangles`` (n, 3) of ``points`` (V, 3), mm, as a GLB file.

    ``frames`` (T, V, 3), mm, add an animation of ``seconds`` through them.
    """
    base = _gltf_axes(points)
    binary = _Binary()
    position = binary.add(base, _ARRAY, _FLOAT, "VEC3")
    sides = [
        binary.add(turned.astype("<u4").ravel(), _INDEX, _UINT, "SCALAR")
        for turned in (triangles, triangles[:, ::-1])
    ]
    mesh: dict[str, Any] = {
        "primitives": [
            {"attributes": {"POSITION": position}, "indices": indices, "material": side}
            for side, indices in enumerate(sides)
        ]
    }
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"miurafab {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "sheet"}],
        "meshes": [mesh],
        "materials": [_material("front", FRONT), _material("back", BACK)],
    }
    if frames is not None:
        count = len(frames)
        times = np.linspace(0.0, seconds, count) if count > 1 else np.zeros(1)
        shares = np.eye(count, dtype="<f4").ravel()
        targets = [
            {"POSITION": binary.add(_gltf_axes(frame) - base, _ARRAY, _FLOAT, "VEC3")}
            for frame in frames
        ]
        for primitive in mesh["primitives"]:
            primitive["targets"] = targets
        mesh["weights"] = [1.0] + [0.0] * (count - 1)
        document["animations"] = [
            {
                "name": "folding",
                "samplers": [
                    {
                        "input": binary.add(times.astype("<f4"), None, _FLOAT, "SCALAR"),
                        "output": binary.add(shares, None, _FLOAT, "SCALAR"),
                        "interpolation": "LINEAR",
                    }
                ],
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
            }
        ]
    document |= binary.tables()
    text = json.dumps(document, separators=(",", ":")).encode("ascii")
    return _chunks(text, binary.data)


def _gltf_axes(points: Floats) -> NDArray[np.float32]:
    """Millimetres with z up to metres with y up."""
    turned = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1) / 1000.0
    return np.ascontiguousarray(turned, dtype="<f4")


def _material(name: str, colour: tuple[float, float, float]) -> dict[str, Any]:
    rough = {"baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.85}
    return {"name": name, "pbrMetallicRoughness": rough}


class _Binary:
    """The binary chunk, which grows, with a view and an accessor for each array in it."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, array: NDArray[Any], target: int | None, component: int, kind: str) -> int:
        """Append ``array`` and return the index of its accessor."""
        content = array.tobytes()
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content)}
        if target is not None:
            view["target"] = target
        self.views.append(view)
        self.data += content + b"\0" * (-len(content) % 4)
        rows = array.reshape(len(array), -1)
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": component,
                "count": len(array),
                "type": kind,
                "min": rows.min(axis=0).tolist(),
                "max": rows.max(axis=0).tolist(),
            }
        )
        return len(self.accessors) - 1

    def tables(self) -> dict[str, Any]:
        return {
            "buffers": [{"byteLength": len(self.data)}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        }


def _chunks(text: bytes, binary: bytes | bytearray) -> bytes:
    """A GLB container: header, JSON chunk padded with spaces, binary chunk padded with zeros."""
    text += b" " * (-len(text) % 4)
    binary = bytes(binary) + b"\0" * (-len(binary) % 4)
    total = 12 + 8 + len(text) + 8 + len(binary)
    head = struct.pack("<4sII", b"glTF", 2, total)
    json_chunk = struct.pack("<I4s", len(text), b"JSON") + text
    return head + json_chunk + struct.pack("<I4s", len(binary), b"BIN\0") + binary
