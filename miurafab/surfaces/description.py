"""Targets as a pattern file describes them (``miurafab:target``), and back.

=============================== ================================================================
keys                            target
=============================== ================================================================
``surface``, ``parameters``     a surface of the catalogue
``mesh``, ``sha256``            a mesh file, named from the folder of the pattern
``vertices``, ``faces``         a mesh that had no file
``samples``, ``span``, ...      a function or a height field (:mod:`~miurafab.surfaces.function`)
=============================== ================================================================
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from miurafab.errors import PatternError, TargetError
from miurafab.files import MOST_MESH_BYTES, Reading, read_bytes
from miurafab.findings import Finding
from miurafab.surfaces.catalogue import make_surface
from miurafab.surfaces.function import sampled_before
from miurafab.surfaces.surface import TargetSurface


def described_surface(
    target: Mapping[str, Any],
) -> tuple[TargetSurface | None, tuple[Finding, ...]]:
    """The surface that ``target`` describes, None without one, and findings on it.

    A pattern without a target comes from another program. A mesh file that was moved or has changed
    since the fit is a finding and no error. Raises :class:`~miurafab.errors.PatternError` for a
    description that is damaged.
    """
    if not target:
        return None, ()
    if "mesh" in target:
        mesh = Path(str(target["mesh"]))
        if not mesh.is_file():
            return None, no_target(f"the target mesh {mesh} is not there")
        content = read_bytes(mesh, TargetError, MOST_MESH_BYTES)
        if hashlib.sha256(content).hexdigest() != target.get("sha256"):
            return None, no_target(f"the target mesh {mesh} has changed since the fit")
        from miurafab.surfaces.mesh import load_mesh  # only now: few patterns have one

        with Reading(mesh.name, "a mesh that can be a target", TargetError):
            return load_mesh(mesh, place=dict(target))[0], ()
    try:
        if "samples" in target:
            return sampled_before(target), ()
        if "vertices" in target:
            from miurafab.surfaces.mesh import mesh_surface

            vertices = np.array(target["vertices"], dtype=np.float64)
            faces = np.array(target["faces"], dtype=np.int64)
            return mesh_surface(vertices, faces, place=dict(target)), ()
    except (TargetError, KeyError, TypeError, ValueError) as fault:
        raise PatternError(f"'miurafab:target' is damaged: {fault}") from None
    parameters = target.get("parameters", {})
    if not isinstance(target.get("surface"), str) or not isinstance(parameters, dict):
        raise PatternError("'miurafab:target' names neither a surface nor a mesh.")
    return make_surface(target["surface"], parameters)[0], ()


def no_target(why: str) -> tuple[Finding, ...]:
    """The finding on a pattern whose target cannot be used."""
    return (Finding("no-target", f"Distances are left out: {why}."),)
