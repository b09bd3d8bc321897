"""Mesh targets: a scanned or modelled surface as a smooth map from a rectangle.

The mesh must be one disk. It is laid flat, the largest rectangle within the layout becomes the
parameter domain, and a smooth tensor spline through the mesh over that rectangle gives points and
normals. Distances are measured to the mesh itself, not to the spline.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.interpolate import NdBSpline, make_lsq_spline

from miurafab.errors import TargetError
from miurafab.geometry.distances import closest_on_mesh
from miurafab.surfaces.parameterise import flatten, largest_rectangle, locate
from miurafab.surfaces.surface import Domain, Floats, tangents, unit

MESH_SUFFIXES = (".stl", ".obj", ".ply", ".off", ".glb")
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class MeshSurface:
    """A rectangle of a mesh. ``spline`` maps the domain to space; ``triangles`` (T, 3, 3)."""

    spline: NdBSpline
    domain: Domain
    triangles: Floats

    def point(self, uv: Floats) -> Floats:
        """Within the domain the spline, outside it the spline continued straight on."""
        d = self.domain
        low, high = np.array([d.u0, d.v0]), np.array([d.u1, d.v1])
        inside = np.clip(uv, low, high)
        beyond = uv - inside
        points: Floats = self.spline(inside)
        if beyond.any():
            points = points + beyond[..., :1] * self.spline(inside, nu=(1, 0))
            points = points + beyond[..., 1:] * self.spline(inside, nu=(0, 1))
        return points

    def normal(self, uv: Floats) -> Floats:
        along, across = tangents(self, uv)
        return unit(np.cross(along, across))

    def closest_point(self, points: Floats) -> Floats:
        return closest_on_mesh(points, self.triangles)


def load_mesh(path: Path) -> tuple[MeshSurface, str]:
    """The mesh file as a target, and the SHA-256 of the file.

    Raises :class:`~miurafab.errors.TargetError` with one sentence for a file that is missing,
    unreadable, empty, holds numbers that are not finite, several pieces, a closed or non-manifold
    surface, or holes.
    """
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise TargetError(f"{path} is not a mesh file; known are {', '.join(MESH_SUFFIXES)}.")
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise TargetError(f"{path} does not exist.") from None
    except OSError as fault:
        raise TargetError(f"{path} cannot be read: {fault.strerror}.") from None
    try:
        with path.open("rb") as stream:
            mesh = trimesh.load_mesh(stream, file_type=path.suffix[1:].lower())
    except Exception as fault:  # noqa: BLE001 - trimesh's readers raise whatever their parser does
        raise TargetError(f"{path} cannot be read as a mesh: {fault}.") from None
    if not isinstance(mesh, trimesh.Trimesh):
        raise TargetError(f"{path} holds no triangle mesh.")
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    vertices, faces = _clean(vertices, faces, path.name)
    return mesh_surface(vertices, faces, path.name), hashlib.sha256(content).hexdigest()


def _clean(vertices: Floats, faces: Ints, name: str) -> tuple[Floats, Ints]:
    """Merge equal vertices, drop degenerate triangles and unused vertices."""
    if not len(faces):
        raise TargetError(f"{name} holds no triangles.")
    if not np.isfinite(vertices[faces]).all():
        bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
        raise TargetError(
            f"{name}: vertex {bad} has a coordinate that is not a finite number (NaN or infinite); "
            "repair the mesh and try again."
        )
    size = float(np.ptp(vertices[faces].reshape(-1, 3), axis=0).max())
    if size == 0:
        raise TargetError(f"{name}: all triangles lie in one point.")
    keys = np.round(vertices / (1e-9 * size)).astype(np.int64)
    _, first, merged = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    vertices, faces = vertices[first], merged.reshape(-1)[faces]
    corners = vertices[faces]
    doubled = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    distinct = (np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)
    faces = faces[distinct & (doubled > 1e-14 * size**2)]
    if not len(faces):
        raise TargetError(f"{name}: all triangles are degenerate (have no area).")
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


def _check_disk(vertices: Floats, faces: Ints, name: str) -> None:
    """Refuse whatever is not one disk, by its true fault."""
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, uses = np.unique(sides, axis=0, return_counts=True)
    if (uses > 2).any():
        raise TargetError(
            f"{name} is not a surface: {int((uses > 2).sum())} edges have more than two triangles; "
            "remove the inner walls or duplicate triangles."
        )
    pieces = trimesh.graph.connected_components(edges, nodes=np.arange(len(vertices)))
    if len(pieces) > 1:
        raise TargetError(f"{name} holds {len(pieces)} separate pieces; keep one and try again.")
    border = edges[uses == 1]
    if not len(border):
        raise TargetError(f"{name} is closed; cut it open so that it is a sheet with one border.")
    if (np.bincount(border.ravel()) > 2).any():
        raise TargetError(f"{name}: its border touches itself in a vertex; widen it there.")
    loops = len(trimesh.graph.connected_components(border))
    if loops > 1:
        raise TargetError(
            f"{name} has {loops - 1} hole{'s' if loops > 2 else ''}; fill them in your mesh "
            "program, or cut the mesh to a part without."
        )
    if len(vertices) - len(edges) + len(faces) != 1:
        raise TargetError(f"{name} has a handle; it cannot be laid flat. Cut it open.")


def mesh_surface(vertices: Floats, faces: Ints, name: str = "The mesh") -> MeshSurface:
    """A target from the arrays of a triangle mesh, ``vertices`` (V, 3) and ``faces`` (F, 3).

    Raises :class:`~miurafab.errors.TargetError` if it is not one oriented disk.
    """
    _check_disk(vertices, faces, name)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    if not mesh.is_winding_consistent:
        trimesh.repair.fix_winding(mesh)
        faces = np.asarray(mesh.faces, dtype=np.int64)
    flat = flatten(vertices, faces)
    angle, (x0, x1, y0, y1) = largest_rectangle(flat, faces)
    c, s = np.cos(angle), np.sin(angle)
    flat = flat @ np.array([[c, s], [-s, c]])
    domain = Domain(x0, x1, y0, y1)
    spline = _fit_spline(vertices, faces, flat, domain)
    return MeshSurface(spline, domain, _even_triangles(vertices, faces))


def _even_triangles(vertices: Floats, faces: Ints) -> Floats:
    """(T, 3, 3) the same surface with no triangle much larger than most."""
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    extent = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    limit = max(3 * float(np.median(longest)), extent / 80)
    if longest.max() <= limit:
        return corners
    points, split = trimesh.remesh.subdivide_to_size(vertices, faces, limit, max_iter=24)
    fine: Floats = np.asarray(points, dtype=np.float64)[np.asarray(split)]
    return fine


def _fit_spline(vertices: Floats, faces: Ints, flat: Floats, domain: Domain) -> NdBSpline:
    """The least-squares bicubic spline through the mesh over ``domain``.

    Knots stand about one and a half mesh edges apart, so that the spline follows the shape and
    irons out the facets; samples are twice as dense as knots.
    """
    sides = flat[faces] - flat[np.roll(faces, 1, axis=1)]
    edge = float(np.median(np.linalg.norm(sides, axis=2)))
    spans = [int(np.clip(length / (1.5 * edge), 3, 60)) for length in (domain.width, domain.height)]
    counts = [max(2 * (span + 3), 24) for span in spans]
    lattice = domain.lattice(*counts).reshape(-1, 2)
    centre = np.array([(domain.u0 + domain.u1) / 2, (domain.v0 + domain.v1) / 2])
    triangle, weights = locate(flat, faces, centre + (lattice - centre) * (1 - 2e-6))
    if (triangle < 0).any():
        raise TargetError(
            "The rectangle laid into the mesh reaches into a gap of it; remesh it more evenly."
        )
    samples = np.einsum("nc,nck->nk", weights, vertices[faces[triangle]])
    grid = samples.reshape(counts[1], counts[0], 3).transpose(1, 0, 2)
    knots = [
        np.concatenate([[low] * 3, np.linspace(low, high, span + 1), [high] * 3])
        for span, low, high in (
            (spans[0], domain.u0, domain.u1),
            (spans[1], domain.v0, domain.v1),
        )
    ]
    u = np.linspace(domain.u0, domain.u1, counts[0])
    v = np.linspace(domain.v0, domain.v1, counts[1])
    along = make_lsq_spline(u, grid, knots[0]).c
    both = make_lsq_spline(v, along.transpose(1, 0, 2), knots[1]).c.transpose(1, 0, 2)
    return NdBSpline((knots[0], knots[1]), both, 3, extrapolate=True)
