"""Meshes as the target of a design: a file, or a mesh of trimesh.

Each function gives the surface, and what names the mesh in a pattern file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from miurafab.errors import TargetError
from miurafab.files import Reading
from miurafab.origami.fitting.request import FitOptions
from miurafab.surfaces.body import BodyChoice
from miurafab.surfaces.function import rounded
from miurafab.surfaces.mesh import MeshSurface, load_mesh, mesh_surface
from miurafab.surfaces.mesh_files import arrays_of
from miurafab.surfaces.preparation import MeshReading
from miurafab.surfaces.tube import TubeSurface

MeshTarget = tuple[MeshSurface | TubeSurface, dict[str, Any]]


def mesh_in_file(path: Path, asked: FitOptions) -> MeshTarget:
    """The mesh in the file ``path``, read as ``asked`` says. Raises ``TargetError``."""
    with Reading(path.name, "a mesh that can be a target", TargetError):
        surface, sha256 = load_mesh(path, **_reading(asked))
    return surface, {"mesh": str(path.resolve()), "sha256": sha256}


def mesh_in_arrays(mesh: object, asked: FitOptions) -> MeshTarget:
    """A ``mesh`` that has ``vertices`` and ``faces``. Raises ``TargetError``."""
    vertices, faces = arrays_of(mesh, "The mesh")
    vertices = rounded(vertices)
    surface = mesh_surface(vertices, faces, **_reading(asked))
    return surface, {"vertices": vertices.tolist(), "faces": faces.tolist(), "name": "mesh"}


def _reading(asked: FitOptions) -> dict[str, Any]:
    return {
        "region": asked.region,
        "rotate": asked.rotate,
        "reading": MeshReading(asked.side, asked.holes),
        "choice": BodyChoice(asked.poles, asked.polar_hole_mm, asked.pieces),
    }
