"""Mesh files: which endings are known, and the triangles in each.

STL, OBJ, GLB and most PLY files are read by trimesh. It reads no PLY of triangle strips, no OFF
whose faces run over several lines, and 3MF only with further libraries; these are read in
:mod:`~miurafab.surfaces.mesh_formats`. STEP files need the library cascadio (OpenCASCADE), which
meshes their faces. Any of them may be compressed (``.stl.gz``).
"""

from __future__ import annotations

import gzip
import hashlib
import importlib
import io
import logging
import sys
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from miurafab.errors import TargetError
from miurafab.files import MOST_MESH_BYTES, read_bytes, write_draft
from miurafab.geometry.arrays import Floats, Ints
from miurafab.surfaces.mesh_formats import read_3mf, read_off, read_ply_strips

STEP_SUFFIXES = (".step", ".stp")
MESH_SUFFIXES = (".stl", ".obj", ".ply", ".off", ".glb", ".3mf", *STEP_SUFFIXES)
PACKED = ".gz"
"""The ending of a compressed file, after that of its content."""

FROM_POINTS = (
    "make a triangle mesh of it (MeshLab, CloudCompare and Open3D do) or a height map on a regular "
    "grid, and fit that."
)

LARGEST = 1 << 30
"""A compressed file may unpack to this many bytes."""

LARGEST_MM = 1e15
"""No coordinate is farther from the origin: the squares of squares of lengths stay finite."""

FLATNESS = 2e-4
"""STEP faces are meshed to this part of the model's size, after a first coarse mesh."""
_COARSE_MM, _ANGLE = 1.0, 0.1


def mesh_suffix(path: Path) -> str:
    """The ending of ``path`` that says its format, without ``.gz``; empty for no mesh file."""
    name = path.name.lower().removesuffix(PACKED)
    suffix = Path(name).suffix
    return suffix if suffix in MESH_SUFFIXES else ""


def read_mesh(path: Path) -> tuple[Floats, Ints, str]:
    """The vertices (V, 3) in mm, the triangles (F, 3) and the SHA-256 of the mesh file ``path``.

    Raises :class:`~miurafab.errors.TargetError` with one sentence for a file that is missing,
    unreadable, of another format, or holds no triangles.
    """
    suffix = mesh_suffix(path)
    if not suffix:
        known = ", ".join(MESH_SUFFIXES)
        raise TargetError(f"{path} is not a mesh file; known are {known}, each also with .gz.")
    content = read_bytes(path, TargetError, MOST_MESH_BYTES)
    sha256 = hashlib.sha256(content).hexdigest()
    if path.suffix.lower() == PACKED:
        content = _unpacked(content, path)
    try:
        vertices, faces = _checked(*_triangles(content, suffix, str(path)))
    except TargetError:
        raise
    except Exception as fault:  # noqa: BLE001 - readers raise whatever their parser does
        reason = " ".join(str(fault).split()) or type(fault).__name__
        raise TargetError(f"{path} cannot be read as a mesh: {reason.rstrip('.')}.") from None
    return vertices, faces, sha256


def _checked(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """The mesh, if its arrays are such. Raises ``ValueError``."""
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise ValueError("its vertices do not have three coordinates")
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError("its facets are not triangles")
    if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
        raise ValueError("a facet refers to a vertex that does not exist")
    used = np.unique(faces) if faces.size else np.arange(len(vertices))
    wild = used[~(np.abs(vertices[used]) < LARGEST_MM).all(axis=1)]
    if len(wild):
        raise ValueError(
            f"vertex {wild[0]} has a coordinate that is not a finite number below 1e15 mm"
        )
    return vertices, faces


def is_mesh(value: object) -> bool:
    """Whether ``value`` comes from trimesh: a mesh, a scene or a point cloud."""
    trimesh = sys.modules.get("trimesh")  # whoever holds its mesh has imported it
    return trimesh is not None and isinstance(value, trimesh.parent.Geometry)


def arrays_of(mesh: object, name: str) -> tuple[Floats, Ints]:
    """The vertices (V, 3) and triangles (F, 3) of a mesh of trimesh, called ``name`` in messages.

    Raises :class:`~miurafab.errors.TargetError` for a point cloud and for a scene.
    """
    import trimesh

    if isinstance(mesh, trimesh.PointCloud):
        raise TargetError(f"{name} is a point cloud and not a surface; {FROM_POINTS}")
    if not isinstance(mesh, trimesh.Trimesh):
        raise TargetError(f"{name} holds no triangle mesh.")
    return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)


def _triangles(content: bytes, suffix: str, name: str) -> tuple[Floats, Ints]:
    if suffix == ".off":
        return read_off(content)
    if suffix == ".3mf":
        return read_3mf(content)
    if suffix in STEP_SUFFIXES:
        return _from_step(content, name)
    if suffix == ".ply":
        strips = read_ply_strips(content)
        if strips is not None:
            return strips
    return _by_trimesh(content, suffix[1:], name)


def _by_trimesh(content: bytes, kind: str, name: str) -> tuple[Floats, Ints]:
    import trimesh

    with _silent():
        mesh: object = trimesh.load_mesh(io.BytesIO(content), file_type=kind, process=False)
        if not len(getattr(mesh, "faces", ())):  # load_mesh drops the points of a point cloud
            mesh = trimesh.load(io.BytesIO(content), file_type=kind, process=False)
    return arrays_of(mesh, name)


@contextmanager
def _silent() -> Iterator[None]:
    """trimesh logs tracebacks of what it then reads in another way; here it does not."""
    log = logging.getLogger("trimesh.util")
    before = log.disabled
    log.disabled = True
    try:
        yield
    finally:
        log.disabled = before


def _unpacked(content: bytes, path: Path) -> bytes:
    try:
        with gzip.open(io.BytesIO(content)) as packed:
            plain = packed.read(LARGEST + 1)
    except (OSError, EOFError, zlib.error) as fault:
        reason = " ".join(str(fault).split()).rstrip(".")
        raise TargetError(f"{path} cannot be unpacked: {reason}.") from None
    if len(plain) > LARGEST:
        raise TargetError(f"{path} unpacks to more than {LARGEST >> 30} GB; simplify the mesh.")
    return plain


def _from_step(content: bytes, name: str) -> tuple[Floats, Ints]:
    """The faces of a STEP file, meshed. The meshes are in metres, as GLB files are."""
    try:
        cascadio = importlib.import_module("cascadio")
    except ImportError:
        raise TargetError(
            f"{name} is a STEP file, which needs the library cascadio: install it by "
            "'pip install miurafab[step]', or export a mesh from your CAD program."
        ) from None
    with tempfile.TemporaryDirectory() as folder:
        step, glb = Path(folder) / "in.step", Path(folder) / "out.glb"
        write_draft(step, content)
        vertices, faces = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
        flatness = _COARSE_MM
        for _ in range(2):
            cascadio.step_to_glb(str(step), str(glb), flatness, _ANGLE)
            vertices, faces = _by_trimesh(glb.read_bytes(), "glb", name)
            vertices = vertices * 1000.0
            flatness = FLATNESS * float(np.ptp(vertices, axis=0).max())
    return vertices, faces
