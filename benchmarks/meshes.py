"""Thirty meshes of disk topology, each fitted with 400 facets and no help: how many come out?

    python benchmarks/meshes.py [NAME ...] [--facets 20x20] [--json FILE] [--save DIR]

A mesh counts as fitted when every residual is <= 1e-10, the mid-surface stays within 2 % of the
diagonal, and no facets pass through each other. The meshes are bumps, saddles, shells and pieces of
tori, evenly and unevenly triangulated, cut to squares, discs and other outlines, without noise and
with the noise of a scanner. They are made from formulas and a seed: nothing is stored.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import Delaunay, cKDTree

from miurafab.errors import TargetError
from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.origami.fitting.request import FACETS
from miurafab.surfaces.mesh import mesh_surface

Array = np.ndarray
Formula = Callable[[Array, Array], Array]


def graph(height: Callable[[Array, Array], Array]) -> Formula:
    return lambda x, y: np.stack([x, y, height(x, y)], axis=-1)


def sphere(radius: float, stretch: tuple[float, float, float] = (1, 1, 1)) -> Formula:
    """Azimuthal equidistant about the top: the outline of the plane becomes that of the cap."""

    def position(x: Array, y: Array) -> Array:
        r = np.hypot(x, y)
        s = np.where(r > 0, np.sin(r) / np.where(r > 0, r, 1), 1.0)
        return radius * np.stack([x * s, y * s, np.cos(r)], axis=-1) * stretch

    return position


def torus(big: float, small: float, at: float) -> Formula:
    """x along the big circle, y around the small one from the angle ``at`` (0 outside)."""

    def position(x: Array, y: Array) -> Array:
        r = big + small * np.cos(y + at)
        return np.stack([r * np.cos(x), r * np.sin(x), small * np.sin(y + at)], axis=-1)

    return position


def revolution(radius: Callable[[Array], Array]) -> Formula:
    return lambda x, y: np.stack([radius(y) * np.cos(x), radius(y) * np.sin(x), y + 0 * x], axis=-1)


def helicoid(x: Array, y: Array) -> Array:
    return np.stack([x * np.cos(y), x * np.sin(y), 0.7 * y], axis=-1)


def enneper(x: Array, y: Array) -> Array:
    return np.stack([x - x**3 / 3 + x * y**2, y - y**3 / 3 + y * x**2, x**2 - y**2], axis=-1)


def twisted(x: Array, y: Array) -> Array:
    return np.stack([x, y * np.cos(0.6 * x), y * np.sin(0.6 * x)], axis=-1)


def peaks(x: Array, y: Array) -> Array:
    return (
        3 * (1 - x) ** 2 * np.exp(-(x**2) - (y + 1) ** 2)
        - 10 * (x / 5 - x**3 - y**5) * np.exp(-(x**2) - y**2)
        - np.exp(-((x + 1) ** 2) - y**2) / 3
    )


def waves(seed: int, size: float) -> Callable[[Array, Array], Array]:
    """A sum of six random plane waves, one to two across the square [-1, 1]^2."""
    random = np.random.default_rng(seed)
    k = random.uniform(0.5, 2.5, 6)
    at, phase = random.uniform(0, 2 * np.pi, (2, 6))
    height = size * random.normal(size=6) / k
    return lambda x, y: sum(
        h * np.sin(n * (x * np.cos(a) + y * np.sin(a)) + p)
        for h, n, a, p in zip(height, k, at, phase, strict=True)
    )


def square(x: Array, y: Array) -> Array:
    return np.maximum(np.abs(x), np.abs(y))


def disc(x: Array, y: Array) -> Array:
    return np.hypot(x, y)


def drop(x: Array, y: Array) -> Array:
    """A rounded triangle."""
    angle, r = np.arctan2(y, x), np.hypot(x, y)
    return r * (1 + 0.18 * np.cos(3 * angle))


def corner(x: Array, y: Array) -> Array:
    """A square with one quarter of it cut short: an L."""
    return np.where((x > 0.15) & (y > 0.15), 2.0, np.maximum(np.abs(x), np.abs(y)))


def lattice(
    position: Formula,
    half: tuple[float, float],
    count: int,
    outline: Formula = square,
    skew: bool = False,
) -> tuple[Array, Array]:
    """An even triangulation of |x| <= half[0], |y| <= half[1] within ``outline`` <= 1."""
    aspect = half[1] / half[0]
    across = max(int(count * aspect), 4)
    x, y = np.meshgrid(np.linspace(-1, 1, count), np.linspace(-1, 1, across))
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (
        q.ravel() for q in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    )
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    x, y = x.ravel(), y.ravel()
    faces = faces[(outline(x, y)[faces] <= 1 + 1e-9).all(axis=1)]
    if skew:
        x, y = x + 0.35 * y, y
    return compact(position(half[0] * x, half[1] * y), faces)


def scattered(
    position: Formula, half: tuple[float, float], count: int, outline: Formula, seed: int
) -> tuple[Array, Array]:
    """Random points within ``outline`` <= 1, spread by a few rounds of relaxation, and its rim."""
    random = np.random.default_rng(seed)
    pool = random.uniform(-1, 1, (40 * count, 2))
    pool = pool[outline(*pool.T) < 0.97]
    centres = pool[:count]
    for _ in range(6):
        nearest = cKDTree(centres).query(pool)[1]
        total = np.bincount(nearest, minlength=len(centres))
        sums = np.stack(
            [np.bincount(nearest, pool[:, k], minlength=len(centres)) for k in (0, 1)], axis=1
        )
        centres = np.where(total[:, None] > 0, sums / np.maximum(total, 1)[:, None], centres)
    angle = np.linspace(0, 2 * np.pi, int(3.3 * np.sqrt(count)), endpoint=False)
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for _ in range(40):
        rim = rim / np.maximum(outline(*rim.T), 1e-9)[:, None] ** 0.5
    points = np.concatenate([centres, rim])
    faces = Delaunay(points).simplices
    middle = points[faces].mean(axis=1)
    faces = faces[outline(*middle.T) < 0.999]
    a, b, c = (points[faces[:, n]] for n in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces = np.where((area < 0)[:, None], faces[:, ::-1], faces)[np.abs(area) > 1e-6]
    x, y = points.T
    return compact(position(half[0] * x, half[1] * y), faces)


def compact(points: Array, faces: Array) -> tuple[Array, Array]:
    used, faces = np.unique(faces, return_inverse=True)
    return points[used], faces.reshape(-1, 3)


def noisy(mesh: tuple[Array, Array], part: float, seed: int) -> tuple[Array, Array]:
    """Every vertex moved at random by ``part`` of the diagonal (one standard deviation)."""
    points, faces = mesh
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    random = np.random.default_rng(seed)
    return points + random.normal(scale=part * diagonal, size=points.shape), faces


def placed(mesh: tuple[Array, Array], seed: int) -> tuple[Array, Array]:
    """Turned and shifted at random, 200 long."""
    points, faces = mesh
    random = np.random.default_rng(seed)
    turn = trimesh.transformations.random_rotation_matrix(random.random(3))[:3, :3]
    points = (points - points.mean(axis=0)) @ turn.T
    return points * (200 / np.ptp(points, axis=0).max()) + random.normal(size=3), faces


def _meshes() -> Iterator[tuple[str, tuple[Array, Array]]]:
    def gauss(x: Array, y: Array) -> Array:
        return np.exp(-3 * (x**2 + y**2))

    def two(x: Array, y: Array) -> Array:
        return np.exp(-6 * ((x - 0.4) ** 2 + y**2)) - np.exp(-6 * ((x + 0.4) ** 2 + y**2))

    pi = np.pi
    yield "bump", lattice(graph(lambda x, y: 0.5 * gauss(x, y)), (1, 1), 40)
    yield "bump-steep", lattice(graph(lambda x, y: 0.9 * gauss(x, y)), (1, 1), 60)
    yield "bump-disc", scattered(graph(lambda x, y: 0.6 * gauss(x, y)), (1, 1), 900, disc, 1)
    yield "bump-noisy", noisy(lattice(graph(lambda x, y: 0.5 * gauss(x, y)), (1, 1), 70), 2e-3, 2)
    yield "bumps-two", lattice(graph(lambda x, y: 0.4 * two(x, y)), (1, 1), 50)
    yield "peaks", lattice(graph(lambda x, y: 0.08 * peaks(3 * x, 3 * y)), (1, 1), 60)
    yield (
        "egg-box",
        lattice(graph(lambda x, y: 0.12 * np.cos(1.5 * pi * x) * np.cos(1.5 * pi * y)), (1, 1), 60),
    )
    yield "waves", scattered(graph(waves(3, 0.25)), (1, 1), 1500, square, 3)
    yield "waves-noisy", noisy(scattered(graph(waves(4, 0.25)), (1, 1), 2500, drop, 4), 2e-3, 4)
    yield "saddle", lattice(graph(lambda x, y: 0.4 * (x**2 - y**2)), (1, 1), 30)
    yield "saddle-steep", lattice(graph(lambda x, y: 0.8 * (x**2 - y**2)), (1, 1), 40)
    yield "saddle-disc", scattered(graph(lambda x, y: 0.5 * x * y), (1, 1), 600, disc, 5)
    yield (
        "saddle-noisy",
        noisy(lattice(graph(lambda x, y: 0.5 * (x**2 - y**2)), (1, 1), 60, skew=True), 3e-3, 6),
    )
    yield "saddle-monkey", lattice(graph(lambda x, y: 0.4 * (x**3 - 3 * x * y**2)), (1, 1), 50)
    yield "enneper", lattice(enneper, (0.7, 0.7), 40)
    yield "twisted", lattice(twisted, (1.5, 0.7), 50)
    yield "helicoid", lattice(helicoid, (0.8, 1.5), 30)
    yield "cap", scattered(sphere(1), (0.8, 0.8), 1200, disc, 7)
    yield "cap-deep", scattered(sphere(1), (1.2, 1.2), 1500, disc, 8)
    yield "cap-noisy", noisy(scattered(sphere(1), (0.9, 0.9), 4000, disc, 9), 2e-3, 9)
    yield "cap-ellipsoid", scattered(sphere(1, (1.5, 1, 0.7)), (1, 1), 1500, drop, 10)
    yield "vault", lattice(revolution(lambda y: 1 - 0.25 * y**2), (1.2, 1), 50)
    yield "waist", lattice(revolution(lambda y: 0.7 * np.cosh(y / 0.9)), (1.1, 0.8), 50)
    yield "shell-corner", lattice(graph(lambda x, y: -0.3 * (x**2 + y**2)), (1, 1), 50, corner)
    yield "torus-outer", lattice(torus(1, 0.45, 0.0), (0.9, 1.1), 50)
    yield "torus-inner", lattice(torus(1, 0.45, pi), (0.9, 1.1), 50)
    yield "torus-top", lattice(torus(1, 0.45, pi / 2), (0.9, 0.9), 50)
    yield "torus-both", lattice(torus(1, 0.4, pi / 2), (1.3, 1.3), 70)
    yield "torus-noisy", noisy(lattice(torus(1, 0.5, pi / 2), (0.8, 0.9), 70), 2e-3, 11)
    yield (
        "vase-noisy",
        noisy(lattice(revolution(lambda y: 0.8 + 0.2 * np.sin(2.2 * y)), (1, 1.1), 70), 1.5e-3, 12),
    )


def meshes() -> dict[str, tuple[Array, Array]]:
    """The thirty meshes by name, each (vertices (V, 3), faces (F, 3))."""
    return {name: placed(mesh, n) for n, (name, mesh) in enumerate(_meshes())}


def trial(name: str, mesh: tuple[Array, Array], facets: tuple[int, int]) -> dict[str, Any]:
    """One mesh fitted; ``fitted`` says whether it counts, ``why`` why not."""
    started = time.perf_counter()
    answer: dict[str, Any] = {"name": name, "triangles": len(mesh[1]), "fitted": False}
    try:
        surface = mesh_surface(*mesh, name)
    except TargetError as refusal:
        return answer | {"why": str(refusal), "seconds": time.perf_counter() - started}
    result = fit(FitRequest(surface=surface, facets=facets))
    answer |= {
        "status": result.status,
        "attempts": len(result.attempts),
        "place": result.attempts[-1].place,
        "why": result.advice,
    }
    if result.pattern is not None and result.measurements is not None:
        found = result.measurements
        diagonal = float(np.linalg.norm(np.ptp(mesh[0], axis=0)))
        residual = max(found.max_planarity, found.max_developability, found.max_isometry)
        deviation = found.hausdorff_midsurface_mm / diagonal
        answer |= {
            "residual": residual,
            "deviation": deviation,
            "self_intersections": found.self_intersections,
            "overlaps": found.overlaps,
            "area_ratio": found.area_ratio,
            "fitted": bool(
                residual <= 1e-10
                and deviation <= 0.02
                and not found.self_intersections
                and not found.overlaps
            ),
        }
    return answer | {"seconds": time.perf_counter() - started}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--facets", default="20x20")
    parser.add_argument("--json", type=Path, help="also write the answers here")
    parser.add_argument("--save", type=Path, help="write the meshes as .ply files here and stop")
    asked = parser.parse_args()
    chosen = {
        name: mesh for name, mesh in meshes().items() if not asked.names or name in asked.names
    }
    if asked.save is not None:
        asked.save.mkdir(parents=True, exist_ok=True)
        for name, (vertices, faces) in chosen.items():
            trimesh.Trimesh(vertices, faces, process=False).export(asked.save / f"{name}.ply")
        return
    print(f"{'mesh':14} {'fitted':6} {'residual':>9} {'deviation':>9} {'tries':>5} {'s':>6}  how")
    answers = []
    for name, mesh in chosen.items():
        a = trial(name, mesh, FACETS.read(asked.facets))
        answers.append(a)
        print(
            f"{name:14} {'yes' if a['fitted'] else 'no':6} {a.get('residual', np.nan):9.1e} "
            f"{100 * a.get('deviation', np.nan):8.2f}% {a.get('attempts', 0):5} "
            f"{a['seconds']:6.1f}  {a['why']}",
            flush=True,
        )
    fitted = sum(a["fitted"] for a in answers)
    print(f"{fitted} of {len(answers)} fitted, {sum(a['seconds'] for a in answers):.0f} s")
    if asked.json is not None:
        asked.json.write_text(json.dumps(answers, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
