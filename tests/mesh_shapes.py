"""Small meshes of the kinds that makers bring, about 200 mm large, made from formulas and seeds.

``mesh(name)`` gives ``(vertices (V, 3), faces (F, 3))``, always the same; ``SHAPES`` has them all
with their kind and what each is about; ``of_kind(kind)`` lists the names of one kind.

=========== ========================================================================================
kind        what a fit has to do
=========== ========================================================================================
``disk``    one sheet with one border, no dirt: roofs, shells, caps, panels, faces, scans
``hole``    a sheet with an inner border that is too large to be filled without asking
``dirty``   a disk with a fault of modelling or export: islands, gaps, doubled vertices, holes,
            an offset of the coordinates, triangles apart
``plate``   a closed solid that is a sheet with a thickness: one skin, or the middle, is the target
``tube``    a surface with two borders around an axis
``sphere``  a closed body without a handle
``refused`` what no sheet can follow: the reason has to be true
=========== ========================================================================================

Disks: ``flat-l`` ``saddle-l`` (panels with a corner cut out), ``cap-40`` ``cap-60`` (round rims),
``barrel`` ``pillow`` ``tripod`` ``stage`` ``petal`` (roofs and shells with borders of their own),
``hood`` (a panel of a car), ``face`` (nose, eyes, ragged border), ``scan-dome`` ``scan-saddle``
(noise of 0.3 %), ``terrain``, ``fan`` (a piece of a cone), ``half-pipe`` (long triangles, no inner
vertex), ``triangles-8`` (hardly a mesh).

Holes: ``court`` (a roof around a round court).

Dirty: ``uv-seam`` (vertices doubled along a seam), ``island`` (one stray triangle), ``two-parts``
(a large and a smaller sheet), ``gaps`` (patches apart by 1e-6 of the size), ``soup`` (each triangle
has its own vertices), ``twice`` (each triangle twice), ``t-junctions`` (a finer strip meets a
coarser one), ``turned`` (half the triangles turned over), ``pinholes`` (three small holes),
``far`` (100 sizes from the origin), ``utm`` (map coordinates, 26,000 sizes away).

Plates: ``plate-saddle`` (2 % thick), ``plate-wave`` (10 %), ``plate-dome`` (5 %), ``plate-wedge``
(0.3 to 1.7 times the mean), ``plate-rounded`` (a round rim), ``plate-noisy``,
``plate-pipe`` (a pipe with a wall).

Tubes: ``cylinder``, ``vase``, ``bent-pipe`` (90 degrees), ``lampshade`` (leans, three lobes),
``ragged-tube`` (its rims are not level).

Spheres: ``ball``, ``egg``, ``pin`` (a bowling pin), ``pebble`` (star-shaped, uneven), ``bumpy``,
``banana`` (bent by 200 degrees, not star-shaped), ``head`` (nose and ears).

Refused: ``block`` (half as thick as wide, sharp edges), ``torus`` (a handle), ``moebius``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import trimesh

Array = np.ndarray
Mesh = tuple[Array, Array]
Map = Callable[[Array, Array], Array]
TURN = 2 * np.pi


@dataclass(frozen=True)
class Shape:
    """The kind of a mesh, and how it is made."""

    kind: str
    make: Callable[[], Mesh]


def mesh(name: str) -> Mesh:
    """The mesh called ``name``: copies of its vertices (V, 3) and triangles (F, 3)."""
    vertices, faces = _made(name)
    return vertices.copy(), faces.copy()


def of_kind(kind: str) -> list[str]:
    """The names of all meshes of ``kind``."""
    return [name for name, shape in SHAPES.items() if shape.kind == kind]


@cache
def _made(name: str) -> Mesh:
    vertices, faces = SHAPES[name].make()
    return np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64)


# --- connections -------------------------------------------------------------------------------


def strips(columns: int, rows: int, around: bool = False) -> Array:
    """(F, 3) triangles of a lattice of ``columns`` x ``rows`` vertices, closed along u if asked."""
    index = np.arange(columns * rows).reshape(rows, columns)
    if around:
        index = np.concatenate([index, index[:, :1]], axis=1)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    d, c = index[1:, :-1].ravel(), index[1:, 1:].ravel()
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def sheet(position: Map, columns: int = 31, rows: int = 31) -> Mesh:
    """``position`` (u, v) -> xyz over the square [-1, 1]^2."""
    u, v = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows))
    return position(u, v).reshape(-1, 3), strips(columns, rows)


def disk(position: Map, rings: int = 16) -> Mesh:
    """``position`` (x, y) -> xyz over the unit disk, in rings of six more vertices each."""
    counts = [1, *(6 * k for k in range(1, rings + 1))]
    first = np.cumsum([0, *counts])
    angle = np.concatenate([TURN * np.arange(n) / n for n in counts])
    r = np.repeat(np.arange(rings + 1) / rings, counts)
    faces = []
    for k in range(1, rings + 1):
        inner, outer = counts[k - 1], counts[k]
        for side in range(6):
            for n in range(k):
                out = [first[k] + (side * k + n + m) % outer for m in (0, 1)]
                at = [first[k - 1] + (side * (k - 1) + n + m) % inner for m in (0, 1)]
                faces.append([at[0], out[0], out[1]])
                if n < k - 1:
                    faces.append([at[0], out[1], at[1]])
    return position(r * np.cos(angle), r * np.sin(angle)), np.array(faces)


def ring(position: Map, around: int = 60, along: int = 40) -> Mesh:
    """``position`` (turn in [0, 1), t in [0, 1]) -> xyz: a tube with two borders."""
    u, t = np.meshgrid(np.arange(around) / around, np.linspace(0, 1, along))
    return position(u, t).reshape(-1, 3), strips(around, along, around=True)


def ball(position: Callable[[Array], Array], level: int = 4) -> Mesh:
    """``position`` of unit vectors (V, 3) -> xyz over a divided icosahedron."""
    sphere = trimesh.creation.icosphere(level)
    return position(np.asarray(sphere.vertices)), np.asarray(sphere.faces)


def kept(made: Mesh, keep: Callable[[Array], Array]) -> Mesh:
    """The triangles whose middles ``keep`` chooses, and their vertices."""
    vertices, faces = made
    faces = faces[keep(vertices[faces].mean(axis=1))]
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


def noise(made: Mesh, part: float, seed: int) -> Mesh:
    """Every vertex moved by ``part`` of the diagonal (one standard deviation)."""
    vertices, faces = made
    diagonal = np.linalg.norm(np.ptp(vertices, axis=0))
    random = np.random.default_rng(seed)
    return vertices + random.normal(scale=part * diagonal, size=vertices.shape), faces


def together(*meshes: Mesh) -> Mesh:
    """Several meshes as one, without joining them."""
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, counts, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def normals(made: Mesh) -> Array:
    """(V, 3) unit normals at the vertices."""
    corners = made[0][made[1]]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.zeros_like(made[0])
    for k in range(3):
        np.add.at(sums, made[1][:, k], areas)
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def border(faces: Array) -> Array:
    """(E, 2) the border edges in the direction of their triangles."""
    sides = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    order = np.sort(sides, axis=1)
    _, inverse, uses = np.unique(order, axis=0, return_inverse=True, return_counts=True)
    return sides[uses[inverse.reshape(-1)] == 1]


def plate(made: Mesh, thickness: Array | float, rim: int = 2) -> Mesh:
    """The solid between the surface shifted up and down by half the ``thickness``, closed by a wall
    of ``rim`` strips; its triangles face outwards. ``thickness`` may be a value a vertex.
    """
    vertices, faces = made
    half = np.broadcast_to(np.asarray(thickness) / 2, len(vertices))[:, None] * normals(made)
    count = len(vertices)
    points = [vertices + half, vertices - half]
    solid = [faces, faces[:, ::-1] + count]
    edges = border(faces)
    used = np.unique(edges)
    index = np.searchsorted(used, edges)
    levels = [edges]
    for k in range(1, rim):
        start = sum(len(p) for p in points)
        points.append(vertices[used] + half[used] * (1 - 2 * k / rim))
        levels.append(start + index)
    levels.append(edges + count)
    for upper, lower in pairwise(levels):
        a, b, c, d = upper[:, 0], upper[:, 1], lower[:, 1], lower[:, 0]
        solid += [np.stack([b, a, d], 1), np.stack([b, d, c], 1)]
    return np.concatenate(points), np.concatenate(solid)


def polar(rim: Callable[[Array], Array], height: Map, size: float = 100.0) -> Map:
    """The unit disk stretched to the outline r = ``rim(angle)``, with ``height(x, y)`` over it."""

    def position(x: Array, y: Array) -> Array:
        reach = rim(np.arctan2(y, x))
        x, y = x * reach, y * reach
        return size * np.stack([x, y, height(x, y)], axis=-1)

    return position


# --- the shapes --------------------------------------------------------------------------------


def _saddle(u: Array, v: Array) -> Array:
    return 100 * np.stack([u, v, 0.3 * (u**2 - v**2)], axis=-1)


def _corner_out(points: Array) -> Array:
    return ~((points[:, 0] > 0) & (points[:, 1] > 0))


def _cap(degrees: float) -> Map:
    radius = 100 / math.sin(math.radians(degrees))

    def position(x: Array, y: Array) -> Array:
        r = np.hypot(x, y)
        angle = math.radians(degrees) * r
        s = np.where(r > 0, np.sin(angle) / np.where(r > 0, r, 1), math.radians(degrees))
        return radius * np.stack([x * s, y * s, np.cos(angle)], axis=-1)

    return position


def _barrel(u: Array, v: Array) -> Array:
    """A vault whose eaves swing: 100 degrees of arc, longer at the crown."""
    angle = math.radians(50) * u
    return np.stack(
        [80 * np.sin(angle), 90 * v * (1 + 0.25 * np.cos(np.pi / 2 * u)), 80 * np.cos(angle)], -1
    )


def _pillow(x: Array, y: Array) -> Array:
    return 0.35 * np.cos(1.2 * x) * np.cos(1.2 * y)


def _stage(u: Array, v: Array) -> Array:
    """A shell over a stage: a quarter of an ellipsoid, cut off before its pole, leaning forward."""
    longitude, latitude = math.radians(75) * u, np.radians(10 + 22 * (v + 1))
    r = np.cos(latitude)
    x, y, z = 100 * r * np.sin(longitude), 80 * r * np.cos(longitude), 70 * np.sin(latitude)
    return np.stack([x, y + 0.3 * z, z], axis=-1)


def _hood(u: Array, v: Array) -> Array:
    """A shallow panel with two swellings along it."""
    x, y = 100 * v, 75 * u * (1 - 0.12 * v)
    z = 14 * (1 - u**2) + 10 * (1 - v**2) + 3 * np.exp(-(((np.abs(u) - 0.5) / 0.22) ** 2))
    return np.stack([x, y, z], axis=-1)


def _face(x: Array, y: Array) -> Array:
    """Half an ellipsoid with a nose, two eyes and a chin, in a ragged outline."""
    angle = np.arctan2(y, x)
    ragged = 1 + 0.05 * np.sin(7 * angle) + 0.03 * np.sin(13 * angle + 1)
    x, y = 0.75 * x * ragged, y * ragged

    def bump(a: float, b: float, wide: float, high: float, tall: float) -> Array:
        return tall * np.exp(-(((x - a) / wide) ** 2) - ((y - b) / high) ** 2)

    z = 0.55 * np.sqrt(np.maximum(1.45 - 1.5 * x**2 - y**2, 0.0))
    z = z + bump(0, -0.05, 0.13, 0.25, 0.16) + bump(0, -0.62, 0.2, 0.13, 0.06)
    z = z - bump(-0.3, 0.2, 0.16, 0.1, 0.06) - bump(0.3, 0.2, 0.16, 0.1, 0.06)
    return 100 * np.stack([x, y, z], axis=-1)


def _hills(x: Array, y: Array) -> Array:
    random = np.random.default_rng(21)
    total = np.zeros_like(x)
    for _ in range(7):
        wave, angle, phase = random.uniform(1, 4), random.uniform(0, TURN), random.uniform(0, TURN)
        total += np.sin(wave * (x * np.cos(angle) + y * np.sin(angle)) + phase) / wave
    return 0.12 * total


def _fan(u: Array, v: Array) -> Array:
    angle, r = math.radians(60) * u, 60 + 40 * (v + 1) / 2 * 1.5
    return np.stack([r * np.cos(angle), r * np.sin(angle), 0.8 * r], axis=-1)


def _half_pipe() -> Mesh:
    angle = np.linspace(0, np.pi, 25)
    rows = [np.stack([60 * np.cos(angle), 0 * angle + y, 60 * np.sin(angle)], 1) for y in (0, 200)]
    return np.concatenate(rows), strips(25, 2)


def _court() -> Mesh:
    """A square roof around a round court."""

    def position(u: Array, t: Array) -> Array:
        c, s = np.cos(TURN * u), np.sin(TURN * u)
        outer = 1 / np.maximum(np.abs(c), np.abs(s))
        r = 0.4 + (outer - 0.4) * t
        return 100 * np.stack([r * c, r * s, 0.25 * np.cos(np.pi / 2 * t) * np.ones_like(u)], -1)

    return ring(position, 72, 16)


def _uv_seam() -> Mesh:
    vertices, faces = sheet(_saddle)
    right = vertices[faces].mean(axis=1)[:, 0] > 0
    seam = np.flatnonzero(np.abs(vertices[:, 0]) < 1e-9)
    other = np.arange(len(vertices))
    other[seam] = len(vertices) + np.arange(len(seam))
    return np.concatenate([vertices, vertices[seam]]), np.where(right[:, None], other[faces], faces)


def _gaps() -> Mesh:
    """Sixteen patches of a saddle, each moved by up to 1e-6 of the size."""
    random = np.random.default_rng(2)
    vertices, faces = sheet(_saddle, 33, 33)
    middle = vertices[faces].mean(axis=1)
    patch = (np.floor((middle[:, 0] + 100) / 50) + 4 * np.floor((middle[:, 1] + 100) / 50)).astype(
        int
    )
    parts = []
    for n in range(16):
        used, own = np.unique(faces[patch == n], return_inverse=True)
        moved = vertices[used] + random.uniform(-1e-4, 1e-4, (len(used), 3))
        parts.append((moved, own.reshape(-1, 3)))
    return together(*parts)


def _soup() -> Mesh:
    vertices, faces = sheet(_saddle)
    return vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3)


def _t_junctions() -> Mesh:
    """A coarse and a fine half whose common line has vertices of the fine half alone."""

    def half(side: float) -> Map:
        return lambda u, v: _saddle(side * (u + 1) / 2, v)

    coarse, fine = sheet(half(1.0), 11, 21), sheet(half(-1.0), 21, 41)
    vertices, faces = together(coarse, fine)
    between = (np.abs(vertices[:, 0]) < 1e-9) & (np.arange(len(vertices)) >= len(coarse[0]))
    line = np.flatnonzero(between)[1::2]  # on the straight edges of the coarse half
    vertices[line] = (
        vertices[np.flatnonzero(between)[0:-1:2]] + vertices[np.flatnonzero(between)[2::2]]
    ) / 2
    return vertices, faces


def _turned() -> Mesh:
    vertices, faces = sheet(_saddle)
    faces[::2] = faces[::2, ::-1]
    return vertices, faces


def _pinholes() -> Mesh:
    places = np.array([[-40, 30], [20, -50], [55, 45]])
    return kept(
        sheet(_saddle, 41, 41),
        lambda p: (np.linalg.norm(p[:, None, :2] - places, axis=2) > 9).all(axis=1),
    )


def _rounded_plate() -> Mesh:
    """A dome of 5 % thickness whose rim is half a circle across."""
    thickness = 10.0
    made = disk(polar(lambda a: 0.95 + 0 * a, lambda x, y: -0.25 * (x**2 + y**2)), 18)
    vertices, faces = plate(made, thickness, rim=8)
    count = len(made[0])
    rim = np.arange(2 * count, len(vertices))
    across = np.unique(border(made[1]))
    up = normals(made)[across]
    middle = made[0][across]
    out = middle - middle.mean(axis=0)
    out -= np.einsum("nk,nk->n", out, up)[:, None] * up
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    for k in range(1, 8):
        angle = np.pi / 2 - np.pi * k / 8
        at = rim[(k - 1) * len(across) : k * len(across)]
        vertices[at] = middle + thickness / 2 * (np.sin(angle) * up + np.cos(angle) * out)
    return vertices, faces


def _wedge() -> Mesh:
    made = sheet(lambda u, v: 100 * np.stack([u, v, 0.2 * u * v], axis=-1))
    return plate(made, 8 * (1 + 0.7 * made[0][:, 0] / 100))


def _wave(u: Array, v: Array) -> Array:
    return 100 * np.stack([u, 0.8 * v, 0.15 * np.sin(2.5 * u + 0.5 * v)], axis=-1)


def _pipe_wall() -> Mesh:
    around, along, wall = 60, 30, 6.0

    def at(radius: float) -> Mesh:
        return ring(
            lambda u, t: np.stack(
                [radius * np.cos(TURN * u), radius * np.sin(TURN * u), 150 * t], axis=-1
            ),
            around,
            along,
        )

    outer, inner = at(60.0), at(60.0 - wall)
    vertices, faces = together(outer, (inner[0], inner[1][:, ::-1]))
    count = around * along
    walls = []
    for level, turn in ((0, 1), (count - around, -1)):
        a = level + np.arange(around)
        b = level + np.roll(np.arange(around), -1)
        quads = [np.stack([b, a, a + count], 1), np.stack([b, a + count, b + count], 1)]
        walls += [quad[:, ::turn] for quad in quads]
    return vertices, np.concatenate([faces, *walls])


def _vase(u: Array, t: Array) -> Array:
    r = 55 + 25 * np.sin(2.6 * t + 0.3) - 10 * np.cos(7 * t)
    a = TURN * u
    return np.stack([1.15 * r * np.cos(a), 0.9 * r * np.sin(a), 200 * t], axis=-1)


def _bent_pipe(u: Array, t: Array) -> Array:
    a, b = TURN * u, np.pi / 2 * t
    q = 120 + 32 * np.cos(a)
    return np.stack([q * np.cos(b), -32 * np.sin(a), q * np.sin(b)], axis=-1)


def _lampshade(u: Array, t: Array) -> Array:
    a = TURN * u
    r = 90 * (1 - 0.45 * t) * (1 + 0.12 * np.cos(3 * a))
    return np.stack([r * np.cos(a) + 30 * t, r * np.sin(a), 140 * t], axis=-1)


def _ragged_tube(u: Array, t: Array) -> Array:
    a = TURN * u
    z = 160 * t + (1 - t) * 12 * np.sin(2 * a) + t * (15 * np.cos(a) + 5 * np.sin(5 * a))
    r = 50 + 10 * np.sin(np.pi * t)
    return np.stack([r * np.cos(a), r * np.sin(a), z], axis=-1)


def _pin(p: Array) -> Array:
    z = p[:, 2]
    across = np.sqrt(np.maximum(1 - z**2, 0))
    shape = 0.42 + 0.16 * np.cos(2.4 * (z + 0.45)) - 0.13 * np.exp(-(((z - 0.45) / 0.22) ** 2))
    r = shape * across**0.9 / np.maximum(across, 1e-9)
    return 60 * np.column_stack([p[:, 0] * r, p[:, 1] * r, 2 * z])


def _banana(p: Array) -> Array:
    around = np.arctan2(p[:, 1], p[:, 0])
    latitude = np.arcsin(np.clip(p[:, 2], -1, 1))
    r = 0.42 * np.cos(latitude) ** 0.7
    bend = math.radians(100) * np.sin(latitude)
    q = 1.2 + r * np.cos(around)
    return 60 * np.column_stack([q * np.cos(bend), q * np.sin(bend), -r * np.sin(around)])


def _swollen(*bumps: tuple[tuple[float, float, float], float, float]) -> Callable[[Array], Array]:
    """A ball of radius 80 with bumps, each (direction, width in radians, height)."""

    def position(p: Array) -> Array:
        r = np.ones(len(p))
        for direction, wide, high in bumps:
            towards = np.array(direction) / np.linalg.norm(direction)
            angle = np.arccos(np.clip(p @ towards, -1, 1))
            r += high * np.exp(-((angle / wide) ** 2))
        return 80 * p * r[:, None]

    return position


def _bumpy(p: Array) -> Array:
    x, y, z = p.T
    r = 1 + 0.08 * np.sin(4 * x + 1) * np.cos(3 * y) + 0.06 * np.sin(5 * z) * np.cos(4 * x)
    return 85 * p * r[:, None]


def _head(p: Array) -> Array:
    swollen = _swollen(
        ((0, 1, 0), 0.22, 0.22), ((1, 0, 0), 0.25, 0.12), ((-1, 0, 0), 0.25, 0.12),
        ((0, 0.8, -0.6), 0.4, 0.1),
    )(p)  # fmt: skip
    return swollen * [0.8, 0.95, 1.2]


def _block() -> Mesh:
    made = sheet(lambda u, v: 60 * np.stack([u, v, 0.1 * u * v], axis=-1), 21, 21)
    return plate(made, 60.0, rim=10)


def _moebius() -> Mesh:
    around, across = 60, 7
    t, w = np.meshgrid(TURN * np.arange(around) / around, np.linspace(-1, 1, across))
    r = 70 + 25 * w * np.cos(t / 2)
    points = np.stack([r * np.cos(t), r * np.sin(t), 25 * w * np.sin(t / 2)], -1).reshape(-1, 3)
    index = np.arange(around * across).reshape(across, around)
    index = np.concatenate([index, index[::-1, :1]], axis=1)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    d, c = index[1:, :-1].ravel(), index[1:, 1:].ravel()
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def _moved(x: float, y: float, z: float) -> Callable[[], Mesh]:
    def make() -> Mesh:
        vertices, faces = sheet(_saddle)
        return vertices + np.array([x, y, z]), faces

    return make


def _island() -> Mesh:
    stray = np.array([[0.0, 0.0, 60.0], [3.0, 0.0, 61.0], [0.0, 3.0, 60.0]])
    return together(sheet(_saddle), (stray, np.array([[0, 1, 2]])))


def _two_parts() -> Mesh:
    small = sheet(lambda u, v: 40 * np.stack([u, v, 0.2 * u * v], axis=-1) + [0, 0, 90], 15, 15)
    return together(small, sheet(_saddle))


SHAPES: dict[str, Shape] = {
    "flat-l": Shape(
        "disk",
        lambda: kept(sheet(lambda u, v: 100 * np.stack([u, v, 0 * u], -1), 41, 41), _corner_out),
    ),
    "saddle-l": Shape("disk", lambda: kept(sheet(_saddle, 41, 41), _corner_out)),
    "cap-40": Shape("disk", lambda: disk(_cap(40), 20)),
    "cap-60": Shape("disk", lambda: disk(_cap(60), 20)),
    "barrel": Shape("disk", lambda: sheet(_barrel)),
    "pillow": Shape(
        "disk", lambda: disk(polar(lambda a: 0.95 + 0.12 * np.cos(4 * a), _pillow), 20)
    ),
    "tripod": Shape(
        "disk",
        lambda: disk(
            polar(lambda a: 0.8 + 0.2 * np.cos(3 * a), lambda x, y: -0.45 * (x**2 + y**2)), 20
        ),
    ),
    "stage": Shape("disk", lambda: sheet(_stage, 41, 25)),
    "petal": Shape(
        "disk",
        lambda: disk(
            polar(lambda a: 0.85 + 0.2 * np.cos(2 * a), lambda x, y: 0.35 * x**2 - 0.3 * y**2), 20
        ),
    ),
    "hood": Shape("disk", lambda: sheet(_hood, 41, 41)),
    "face": Shape("disk", lambda: disk(_face, 34)),
    "scan-dome": Shape(
        "disk", lambda: noise(disk(polar(lambda a: 0.9 + 0 * a, _pillow), 30), 0.003, 3)
    ),
    "scan-saddle": Shape(
        "disk",
        lambda: noise(
            disk(
                polar(
                    lambda a: 0.9 + 0.04 * np.sin(9 * a) + 0.03 * np.cos(16 * a),
                    lambda x, y: 0.4 * x * y,
                ),
                30,
            ),
            0.003,
            4,
        ),
    ),
    "terrain": Shape(
        "disk",
        lambda: sheet(lambda u, v: 100 * np.stack([u, 0.7 * v, _hills(u, v)], axis=-1), 61, 43),
    ),
    "fan": Shape("disk", lambda: sheet(_fan, 41, 16)),
    "half-pipe": Shape("disk", _half_pipe),
    "triangles-8": Shape("disk", lambda: sheet(_saddle, 3, 3)),
    "court": Shape("hole", _court),
    "uv-seam": Shape("dirty", _uv_seam),
    "island": Shape("dirty", _island),
    "two-parts": Shape("dirty", _two_parts),
    "gaps": Shape("dirty", _gaps),
    "soup": Shape("dirty", _soup),
    "twice": Shape("dirty", lambda: together(sheet(_saddle), sheet(_saddle))),
    "t-junctions": Shape("dirty", _t_junctions),
    "turned": Shape("dirty", _turned),
    "pinholes": Shape("dirty", _pinholes),
    "far": Shape("dirty", _moved(2e4, 2e4, 0.0)),
    "utm": Shape("dirty", _moved(4.5e5, 5.2e6, 300.0)),
    "plate-saddle": Shape("plate", lambda: plate(sheet(_saddle), 4.0)),
    "plate-wave": Shape("plate", lambda: plate(sheet(_wave, 41, 33), 20.0, rim=4)),
    "plate-dome": Shape("plate", lambda: plate(disk(_cap(40), 20), 10.0)),
    "plate-wedge": Shape("plate", _wedge),
    "plate-rounded": Shape("plate", _rounded_plate),
    "plate-noisy": Shape("plate", lambda: noise(plate(sheet(_saddle), 8.0), 0.0012, 6)),
    "plate-pipe": Shape("plate", _pipe_wall),
    "cylinder": Shape(
        "tube",
        lambda: ring(
            lambda u, t: np.stack([50 * np.cos(TURN * u), 50 * np.sin(TURN * u), 180 * t], -1)
        ),
    ),
    "vase": Shape("tube", lambda: ring(_vase)),
    "bent-pipe": Shape("tube", lambda: ring(_bent_pipe)),
    "lampshade": Shape("tube", lambda: ring(_lampshade)),
    "ragged-tube": Shape("tube", lambda: ring(_ragged_tube)),
    "ball": Shape("sphere", lambda: ball(lambda p: 100 * p)),
    "egg": Shape("sphere", lambda: ball(lambda p: p * [65, 65, 90] * (1 - 0.15 * p[:, 2:]))),
    "pin": Shape("sphere", lambda: ball(_pin)),
    "pebble": Shape(
        "sphere",
        lambda: ball(
            lambda p: (
                _swollen(((1, 0.3, 0.2), 0.7, 0.25), ((-0.5, 1, -0.4), 0.6, 0.2))(p) * [1, 0.8, 0.6]
            )
        ),
    ),
    "bumpy": Shape("sphere", lambda: ball(_bumpy)),
    "banana": Shape("sphere", lambda: ball(_banana)),
    "head": Shape("sphere", lambda: ball(_head)),
    "block": Shape("refused", _block),
    "torus": Shape(
        "refused",
        lambda: (lambda made: (np.asarray(made.vertices), np.asarray(made.faces)))(
            trimesh.creation.torus(70, 25)
        ),
    ),
    "moebius": Shape("refused", _moebius),
}
