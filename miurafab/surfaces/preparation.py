"""From the triangles of a file to one oriented piece whose kind is known.

The steps are: coordinates relative to an origin near the mesh, equal vertices merged, borders
welded, the largest piece kept, and the skin of a thin plate taken for the plate. Each says in a
finding what it did.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from miurafab.errors import TargetError
from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.surfaces.frame import described, origin_for, origin_in
from miurafab.surfaces.mesh_repair import Holes, clean, mended, size_findings
from miurafab.surfaces.plates import Side, judge_plate
from miurafab.surfaces.topology import Topology, classify


@dataclass(frozen=True)
class MeshReading:
    """How a mesh is read: which ``side`` of a plate is meant, and which ``holes`` are filled."""

    side: Side = "outer"
    holes: Holes = "small"

    @classmethod
    def before(cls, place: Mapping[str, Any]) -> MeshReading:
        """How the mesh of a description was read."""
        return cls(place.get("side", "outer"), place.get("holes", "small"))


@dataclass(frozen=True, eq=False)
class PreparedMesh:
    """One oriented piece: ``vertices`` (V, 3) relative to the origin, ``faces`` (F, 3).

    ``topology`` says its kind. ``why_no_plate`` is why a closed mesh is no plate, ``reading`` what
    a description keeps of how it was read.
    """

    vertices: Floats
    faces: Ints
    topology: Topology
    name: str
    findings: tuple[Finding, ...] = ()
    why_no_plate: str = ""
    reading: Mapping[str, Any] = field(default_factory=dict)


def prepare(
    vertices: Floats,
    faces: Ints,
    name: str,
    reading: MeshReading | None = None,
    place: Mapping[str, Any] | None = None,
) -> PreparedMesh:
    """The mesh ``vertices`` (V, 3), ``faces`` (F, 3), called ``name`` in messages, as one piece.

    ``place`` is a description of the same mesh, which gives its origin again. Raises
    :class:`~miurafab.errors.TargetError` with one sentence where there is no such piece.
    """
    reading = reading or MeshReading()
    vertices, faces = clean(vertices, faces, name)
    try:
        origin = origin_for(vertices) if place is None else origin_in(place)
    except (TypeError, ValueError) as fault:
        raise TargetError(f"{name}: the pattern's note of the mesh is damaged: {fault}.") from None
    vertices = vertices - origin
    findings = size_findings(vertices, name)
    vertices, faces, done = mended(vertices, faces, name)
    findings += done
    topology = classify(vertices, faces)
    kept = described(origin)
    if reading.holes != "small":
        kept["holes"] = reading.holes
    why_no_plate = ""
    if not topology.loops:
        faces = _outwards(vertices, faces)
        plate = judge_plate(vertices, faces)
        why_no_plate = plate.why_not
        if not why_no_plate:
            kept["side"] = reading.side
            vertices, faces = plate.sheet(vertices, faces, reading.side, name)
            topology = classify(vertices, faces)
            sides = {"outer": "outer skin", "inner": "inner skin", "middle": "middle"}
            findings += (
                Finding(
                    "plate",
                    f"{name} is a plate {plate.thickness:.3g} mm thick; the target is its "
                    f"{sides[reading.side]} (`side` chooses).",
                    name,
                ),
            )
    return PreparedMesh(vertices, faces, topology, name, findings, why_no_plate, kept)


def refuse_other_than_a_disk(mesh: PreparedMesh) -> None:
    """Raise :class:`~miurafab.errors.TargetError` for a kind that no sheet with one border is."""
    name, kind = mesh.name, mesh.topology.kind
    thick = f" and is no thin plate ({mesh.why_no_plate})" if mesh.why_no_plate else ""
    if kind == "handles":
        raise TargetError(
            f"{name} has a handle, as a ring and a cup have,{thick} and so has neither one border "
            "nor two poles; cut it through at the handle, or to the part that is meant."
        )
    if not mesh.topology.loops:
        raise TargetError(
            f"{name} is closed{thick}, and `region` and `rotate` are for meshes that lie flat; "
            "leave them out, and it is covered all round."
        )


def _outwards(vertices: Floats, faces: Ints) -> Ints:
    """The triangles of a closed mesh turned so that they face outwards."""
    p = vertices[faces] - vertices.mean(axis=0)
    volume = np.einsum("fk,fk->", p[:, 0], vector_product(p[:, 1], p[:, 2]))
    return faces[:, ::-1] if volume < 0 else faces
