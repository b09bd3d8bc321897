"""Bodies: tubes and closed meshes as targets for gores.

A tube is laid flat between its two borders. A closed mesh becomes a tube by a hole round each of
two poles. Of the candidates for the poles the pair whose map asks the least of a sheet is taken.
Where no pair serves, the body is smoothed more, up to a limit. Limbs squeeze the map, which no
smoothing mends: such a body is refused with the figure that says so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from miurafab.errors import TargetError
from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.surfaces.frame import origin_in
from miurafab.surfaces.mesh_repair import SMALL_HOLE, Holes, doubled_areas, even_triangles
from miurafab.surfaces.poles import HOLE, HeatDistance, open_at, pole_candidates
from miurafab.surfaces.preparation import PreparedMesh
from miurafab.surfaces.refine import refine
from miurafab.surfaces.topology import border_loops
from miurafab.surfaces.tube import TubeChart, TubeSurface, tube_chart
from miurafab.surfaces.tube_figures import LIMITS, TubeFigures

STIFFNESSES = (0.0, 1e-2, 1e-1)
"""What is tried, the least first."""

ROOM = 0.01
"""A tube encloses at least this part of its area to the power 3/2: one of the length of 100 radii
does. A sheet with a hole does not."""

FEW = 8
"""The first pair of poles that serves in this many gores or fewer is taken."""

EDGE = 0.03
"""No edge is longer than this part of the root of the area before the mesh is laid flat."""


@dataclass(frozen=True)
class BodyChoice:
    """What a user chooses of a body: the coordinates of two ``poles`` one after the other, the
    radius ``hole`` round each, and the number of ``pieces``. None is automatic.
    """

    poles: tuple[float, ...] | None = None
    hole: float | None = None
    pieces: int | None = None


@dataclass(frozen=True, eq=False)
class Body:
    """A mesh that goes round: ``vertices`` (V, 3), oriented ``faces`` (F, 3), closed or with two
    borders, called ``name`` in messages.
    """

    vertices: Floats
    faces: Ints
    name: str

    @property
    def size(self) -> float:
        """The diagonal of the bounding box."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    @property
    def area(self) -> float:
        return float(doubled_areas(self.vertices, self.faces).sum()) / 2


@dataclass(frozen=True, eq=False)
class Opening:
    """One way to see a body as a tube: its ``chart``, the ``poles`` (2, 3) and the radius of the
    hole round each, and the part of the area that the holes take. A tube has no poles.
    """

    chart: TubeChart
    poles: Floats
    hole: float
    lost: float


def goes_round(mesh: PreparedMesh, holes: Holes) -> bool:
    """Whether a mesh is a body for gores: closed and no plate, or a tube whose smaller border is no
    hole to be filled, and which with a lid on both borders encloses a room.
    """
    if mesh.topology.kind == "sphere":
        return True
    if mesh.topology.kind != "tube" or holes != "small":
        return False
    if mesh.topology.lengths[1] <= SMALL_HOLE * mesh.topology.lengths[0]:
        return False
    area = Body(mesh.vertices, mesh.faces, mesh.name).area
    return abs(_volume(mesh.vertices, mesh.faces)) > ROOM * math.sqrt(area) ** 3


def round_target(
    mesh: PreparedMesh, choice: BodyChoice, place: Mapping[str, Any] | None
) -> TubeSurface:
    """The target on a mesh that goes round, as ``choice`` or the description ``place`` says."""
    body = Body(mesh.vertices, mesh.faces, mesh.name)
    if place is not None:
        surface = described(body, place)
    else:
        origin = origin_in(mesh.reading)
        poles = None if choice.poles is None else np.reshape(choice.poles, (2, 3)) - origin
        surface = body_surface(body, poles=poles, hole=choice.hole, pieces=choice.pieces)
    return replace(
        surface,
        findings=mesh.findings + surface.findings,
        description={**mesh.reading, **surface.description},
    )


def body_surface(
    body: Body,
    *,
    poles: Floats | None = None,
    hole: float | None = None,
    pieces: int | None = None,
    stiffness: float | None = None,
) -> TubeSurface:
    """The target on ``body``, in ``pieces`` gores or the fewest that serve.

    ``poles`` (2, 3) are points near to which the holes are cut, with the radius ``hole``.
    ``stiffness`` is that of the spline; without it the least that serves is found.

    Raises :class:`~miurafab.errors.TargetError` where the map of the body is too distorted.
    """
    whole = even_triangles(body.vertices, body.faces)
    body = replace(body, faces=_outwards(body.vertices, body.faces))
    closed = not _has_border(body.faces)
    openings = _closed(body, poles, hole) if closed else _tube(body)
    ladder = STIFFNESSES if stiffness is None else (stiffness,)
    hopeful: list[tuple[float, Opening]] = []
    least: TubeFigures | None = None
    for stiff in ladder:
        best: tuple[Opening, TubeSurface] | None = None
        tried: list[tuple[float, Opening]] = []
        for opening in openings:
            surface = opening.chart.surface(whole, stiff, pieces)
            told = surface.figures
            tried.append((told.trouble, opening))
            least = told if least is None or told.trouble < least.trouble else least
            if told.trouble > 1 and stiffness is None:
                continue
            if best is None or told.rank < best[1].figures.rank:
                best = opening, surface
            if told.gores <= FEW:
                break
        if best is not None:
            return _finished(body, stiff, *best)
        hopeful = hopeful or sorted(tried, key=lambda one: one[0])[:2]
        openings = iter([opening for _, opening in hopeful])
    if least is None:
        raise TargetError(
            f"{body.name} is closed, and no two holes make a tube of it; choose their places by "
            "`poles` and their radius by `polar_hole`, or cut the mesh open."
        )
    raise TargetError(_refusal(body.name, least, closed))


def _tube(body: Body) -> Iterator[Opening]:
    vertices, faces = refine(body.vertices, body.faces, EDGE * math.sqrt(body.area))
    yield Opening(_chart(vertices, faces), np.zeros((0, 3)), 0.0, 0.0)


def _closed(body: Body, poles: Floats | None, hole: float | None) -> Iterator[Opening]:
    area = body.area
    radius = HOLE * math.sqrt(area) if hole is None else hole
    vertices, faces = refine(body.vertices, body.faces, EDGE * math.sqrt(area))
    distance = HeatDistance(vertices, faces)
    if poles is None:
        pairs = pole_candidates(vertices, faces, distance)
    else:
        pairs = np.linalg.norm(vertices - poles[:, None], axis=2).argmin(axis=1)[None, :]
    for pair in pairs:
        away = [distance.from_vertex(int(pole)) for pole in pair]
        if away[0][pair[1]] <= 2 * radius:
            continue
        part, triangles = open_at(vertices, faces, away, radius)
        if len(triangles) and _is_tube(part, triangles):
            lost = 1 - float(doubled_areas(part, triangles).sum()) / 2 / area
            yield Opening(_chart(part, triangles), vertices[pair], radius, lost)


def _chart(vertices: Floats, faces: Ints) -> TubeChart:
    """The chart with more of the area in its lower half."""
    loops = border_loops(faces)
    chart = tube_chart(vertices, faces, loops[0], loops[1])
    weight = np.repeat(doubled_areas(vertices, faces), 3)
    mean = float(weight @ chart.flat[faces.ravel(), 1] / weight.sum())
    return chart if mean <= chart.length / 2 else chart.upside_down()


def _finished(body: Body, stiffness: float, opening: Opening, surface: TubeSurface) -> TubeSurface:
    findings: list[Finding] = []
    name = body.name
    if len(opening.poles):
        places = " and ".join(f"({x:.4g}, {y:.4g}, {z:.4g})" for x, y, z in opening.poles)
        findings.append(
            Finding(
                "polar-holes",
                f"{name} is closed: the sheet leaves holes of {opening.hole:.3g} mm in radius at "
                f"{places}, {100 * opening.lost:.1f} % of the area in all; glue a polygon over "
                "each, or move them by `poles` and `polar_hole`.",
                name,
            )
        )
    away = np.linalg.norm(surface.point(opening.chart.flat) - opening.chart.vertices, axis=1)
    if stiffness:
        findings.append(
            Finding(
                "smoothed",
                f"{name} was smoothed so that a sheet can follow it: the surface is up to "
                f"{away.max():.3g} mm from it, {math.sqrt(float((away**2).mean())):.3g} mm in the "
                "root mean square.",
                name,
            )
        )
    return replace(
        surface,
        findings=tuple(findings),
        description={
            "stiffness": stiffness,
            "gores": surface.gores,
            "poles": opening.poles.tolist(),
            "hole": opening.hole,
        },
    )


def described(body: Body, place: Mapping[str, Any]) -> TubeSurface:
    """The target that ``place`` describes, a :attr:`TubeSurface.description`, on the same body."""
    try:
        poles = np.array(place["poles"], dtype=np.float64).reshape(-1, 3)
        hole, stiffness, gores = (
            float(place["hole"]),
            float(place["stiffness"]),
            int(place["gores"]),
        )
    except (KeyError, TypeError, ValueError):
        raise TargetError(f"{body.name}: the pattern's note of the body is damaged.") from None
    return body_surface(
        body,
        poles=poles if len(poles) else None,
        hole=hole if len(poles) else None,
        pieces=gores,
        stiffness=stiffness,
    )


def _refusal(name: str, told: TubeFigures, closed: bool) -> str:
    worst = told.worst
    value, limit = float(getattr(told, worst)), LIMITS[worst]
    words = {
        "across": f"its girth is {value:.0f} times as wide at one side as at the other",
        "along": f"its meridians are {value:.0f} times as long in one place as in another",
        "shear": f"the lines round it and along it are {math.degrees(value):.0f} degrees oblique",
        "turn": f"it bends in and out round one level by {math.degrees(value):.0f} degrees in all",
        "rough": f"the map leaves it by {100 * value:.1f} % of its size",
        "turned_over": f"{value:.0f} triangles of the map are turned over",
        "slide": f"{told.gores} gores ask for a slide of {math.degrees(value):.0f} degrees",
    }
    most = {
        "shear": f"{math.degrees(limit):.0f} degrees",
        "turn": f"{math.degrees(limit):.0f} degrees",
        "slide": f"{math.degrees(limit):.0f} degrees",
        "rough": f"{100 * limit:.0f} %",
        "turned_over": "none",
    }.get(worst, f"{limit:.0f}")
    way = (
        "choose `poles` on the limbs and a `polar_hole` that takes one off, or cut the limbs off."
        if closed
        else "cut off what stands out, or cut the mesh open along a line between its borders."
    )
    return f"{name} cannot be covered by gores: {words[worst]} ({most} at most); {way}"


def _outwards(vertices: Floats, faces: Ints) -> Ints:
    """The triangles turned so that they face outwards."""
    return faces[:, ::-1] if _volume(vertices, faces) < 0 else faces


def _volume(vertices: Floats, faces: Ints) -> float:
    """The volume that the triangles enclose with a lid on each border, positive where they face
    outwards."""
    corners = vertices[faces]
    if _has_border(faces):
        lids = []
        for loop in border_loops(faces):
            rim = vertices[loop]
            middle = np.broadcast_to(rim.mean(axis=0), rim.shape)
            # a border runs in the direction of its triangles, so the lid runs against it
            lids.append(np.stack([np.roll(rim, -1, axis=0), rim, middle], axis=1))
        corners = np.concatenate([corners, *lids])
    corners = corners - vertices.mean(axis=0)
    return (
        float(np.einsum("fk,fk->", corners[:, 0], vector_product(corners[:, 1], corners[:, 2]))) / 6
    )


def _has_border(faces: Ints) -> bool:
    return bool((_uses(faces) == 1).any())


def _uses(faces: Ints) -> Ints:
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.asarray(np.unique(sides, axis=0, return_counts=True)[1])


def _is_tube(vertices: Floats, faces: Ints) -> bool:
    uses = _uses(faces)
    return (
        len(vertices) - len(uses) + len(faces) == 0
        and bool((uses == 1).any())
        and len(border_loops(faces)) == 2
    )
