"""OBJ, STL and GLB are read back, by our own eyes and by trimesh."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np
import pytest
import trimesh
from problems import regular

from miurafab.origami.folding.contact import triangulate
from miurafab.origami.folding.kinematics import rigid_motion, states_between
from miurafab.origami.formats.mesh import glb_bytes, obj_text, stl_bytes

PATTERN = regular()
TRIANGLES = triangulate(PATTERN.faces_vertices, PATTERN.vertices_coords)[0]
assert PATTERN.folded_coords is not None
FOLDED = PATTERN.folded_coords
AREA = float(
    np.linalg.norm(
        np.cross(
            FOLDED[TRIANGLES[:, 1]] - FOLDED[TRIANGLES[:, 0]],
            FOLDED[TRIANGLES[:, 2]] - FOLDED[TRIANGLES[:, 0]],
        ),
        axis=1,
    ).sum()
    / 2
)


class Glb:
    """A GLB file taken apart by the letter of the specification."""

    def __init__(self, content: bytes) -> None:
        magic, version, total = struct.unpack_from("<4sII", content)
        assert (magic, version, total) == (b"glTF", 2, len(content))
        length, kind = struct.unpack_from("<I4s", content, 12)
        assert kind == b"JSON"
        assert length % 4 == 0
        self.json: dict[str, Any] = json.loads(content[20 : 20 + length])
        size, kind = struct.unpack_from("<I4s", content, 20 + length)
        assert kind == b"BIN\0"
        assert 28 + length + size == total
        self.binary = content[28 + length :]
        assert self.json["buffers"][0]["byteLength"] <= size

    def array(self, accessor: int) -> np.ndarray:
        about = self.json["accessors"][accessor]
        view = self.json["bufferViews"][about["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        kind = {5126: "<f4", 5125: "<u4"}[about["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3}[about["type"]]
        part = self.binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        read = np.frombuffer(part, dtype=kind).reshape(-1, width)
        assert len(read) == about["count"]
        assert read.min(axis=0).tolist() == about["min"]
        assert read.max(axis=0).tolist() == about["max"]
        return read


def in_mm(points: np.ndarray) -> np.ndarray:
    """From metres with y up to millimetres with z up."""
    return np.stack([points[:, 0], -points[:, 2], points[:, 1]], axis=1) * 1000


def test_a_glb_holds_the_sheet_from_both_sides() -> None:
    glb = Glb(glb_bytes(FOLDED, TRIANGLES))
    front, back = glb.json["meshes"][0]["primitives"]
    points = in_mm(glb.array(front["attributes"]["POSITION"]))
    assert np.abs(points - FOLDED).max() < 1e-5
    assert np.array_equal(glb.array(front["indices"]).reshape(-1, 3), TRIANGLES)
    assert np.array_equal(glb.array(back["indices"]).reshape(-1, 3), TRIANGLES[:, ::-1])
    assert "animations" not in glb.json


def test_every_frame_of_a_glb_is_a_shape_of_the_motion() -> None:
    motion = rigid_motion(PATTERN, states_between(PATTERN, 12))
    glb = Glb(glb_bytes(motion.frames[0], TRIANGLES, motion.frames))
    (animation,) = glb.json["animations"]
    (sampler,) = animation["samplers"]
    assert animation["channels"] == [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]
    times = glb.array(sampler["input"])[:, 0]
    weights = glb.array(sampler["output"]).reshape(len(times), -1)
    assert len(times) == 13
    assert (np.diff(times) > 0).all()
    for primitive in glb.json["meshes"][0]["primitives"]:
        base = glb.array(primitive["attributes"]["POSITION"])
        targets = np.stack([glb.array(target["POSITION"]) for target in primitive["targets"]])
        assert len(targets) == len(glb.json["meshes"][0]["weights"]) == weights.shape[1]
        for frame, share in zip(motion.frames, weights, strict=True):
            shape = base + np.einsum("t,tvk->vk", share, targets)
            assert np.abs(in_mm(shape) - frame).max() < 1e-4


def test_trimesh_reads_all_three() -> None:
    obj = trimesh.load(
        io.StringIO(obj_text(FOLDED, PATTERN.faces_vertices)), file_type="obj", process=False
    )
    stl = trimesh.load(io.BytesIO(stl_bytes(FOLDED, TRIANGLES)), file_type="stl")
    assert obj.area == pytest.approx(AREA)
    assert stl.area == pytest.approx(AREA, rel=1e-6)
    assert np.abs(obj.vertices - FOLDED).max() == 0
    scene = trimesh.load(io.BytesIO(glb_bytes(FOLDED, TRIANGLES)), file_type="glb")
    area = sum(part.area for part in scene.geometry.values())
    assert area * 1e6 == pytest.approx(2 * AREA, rel=1e-5)


def test_the_same_sheet_gives_the_same_bytes() -> None:
    assert glb_bytes(FOLDED, TRIANGLES) == glb_bytes(FOLDED.copy(), TRIANGLES.copy())
    assert stl_bytes(FOLDED, TRIANGLES) == stl_bytes(FOLDED.copy(), TRIANGLES.copy())
