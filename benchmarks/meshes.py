"""Meshes of the kinds that makers bring, each fitted with 400 facets and no help.

    python benchmarks/meshes.py [NAME ...] [--facets 20x20] [--edge trim] [--into DIR] [--table]

The meshes are those of ``tests/mesh_shapes.py``. Each answer and its pattern are files in DIR; a
mesh that has an answer is not fitted again, so a run may be ended and taken up. ``--table`` prints
what is there.

A mesh is *answered* by a sheet without faults that covers 95 % of it, or by a sentence that says
why there is none, within 30 s of processor time. Distances, fold angles, area and coverage are
computed again here from the pattern and the triangles of the mesh, by code that shares nothing with
the package: points spread over both surfaces, a tree of them, and the exact distance of each point
from the triangles near it. Coverage is also taken by rays: the part of the points of the mesh whose
normal line meets paper near by. That is 1 to 3 % less, since the border of the paper has teeth.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import trimesh
from scipy.spatial import cKDTree

import miurafab as mf
from miurafab.errors import MiurafabError

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from mesh_shapes import SHAPES, mesh

Array = np.ndarray

SPACING = 1 / 150
"""Points lie this part of the diagonal apart at first, and much closer about the farthest ones. The
largest distances are five times that and more, and are exact for each point."""
NEAR = 12
"""The triangles of so many nearest points are looked at for the exact distance."""
FARTHEST, AROUND = 300, 20
"""Around so many of the farthest points so many more are spread, three times."""
LEAST_COVERAGE, MOST_SECONDS = 0.95, 30.0


def paper(pattern: mf.CreasePattern) -> Array:
    """(T, 3, 3) the folded sheet as triangles, each facet cut as it lies flat."""
    found = []
    for face in pattern.faces_vertices:
        face = face[face >= 0]
        flat, folded = pattern.vertices_coords[face], pattern.folded_coords[face]
        parts = shapely.constrained_delaunay_triangles(shapely.Polygon(flat)).geoms
        for part in parts:
            corners = np.array(part.exterior.coords)[:3]
            which = np.linalg.norm(flat - corners[:, None], axis=2).argmin(axis=1)
            found.append(folded[which])
    return np.array(found)


def areas(triangles: Array) -> Array:
    a, b, c = triangles.transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def divided(triangles: Array) -> Array:
    """The same triangles with long ones cut up, so that points on them are not needlessly many."""
    diagonal = float(np.linalg.norm(np.ptp(triangles.reshape(-1, 3), axis=0)))
    flat = triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
    points, faces = trimesh.remesh.subdivide_to_size(*flat, 4 * SPACING * diagonal, max_iter=20)
    return np.asarray(points[faces])


def spread(triangles: Array, spacing: float) -> tuple[Array, Array]:
    """Points of ``triangles`` no farther than ``spacing`` apart, corners included, and the triangle
    of each."""
    sides = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    parts = np.maximum(np.ceil(sides / spacing).astype(int), 1)
    points, owners = [], []
    for n in np.unique(parts):
        i, j = np.array([(i, j) for i in range(n + 1) for j in range(n + 1 - i)]).T
        weights = np.stack([i, j, n - i - j], axis=1) / n
        chosen = np.flatnonzero(parts == n)
        points.append(np.einsum("wc,tck->twk", weights, triangles[chosen]).reshape(-1, 3))
        owners.append(np.repeat(chosen, len(weights)))
    return np.concatenate(points), np.concatenate(owners)


def farthest(start: Array, end: Array, spacing: float) -> float:
    """The largest distance of a point of the triangles ``start`` from the triangles ``end``.

    Points are spread over ``start``. Around the farthest of them, points are spread ever closer.
    """
    samples, owners = spread(end, spacing)
    tree = cKDTree(samples)

    def distances(points: Array) -> Array:
        near = owners[tree.query(points, k=min(NEAR, len(samples)))[1]].reshape(len(points), -1)
        gaps = [
            np.linalg.norm(trimesh.triangles.closest_point(end[column], points) - points, axis=1)
            for column in near.T
        ]
        return np.min(gaps, axis=0)

    points, holders = spread(start, spacing)
    far = distances(points)
    random = np.random.default_rng(1)
    for radius in (spacing / 2, spacing / 6, spacing / 20):
        best = np.argsort(far)[-FARTHEST:]
        holders = np.repeat(holders[best], AROUND)
        moved = np.repeat(points[best], AROUND, axis=0)
        moved = moved + random.normal(scale=radius, size=moved.shape)
        points = np.concatenate(
            [points[best], trimesh.triangles.closest_point(start[holders], moved)]
        )
        holders = np.concatenate([holders[::AROUND], holders])
        far = distances(points)
    return float(far.max())


def covered(triangles: Array, sheet: Array, spacing: float, reach: float) -> float:
    """The part of the area of ``triangles`` whose normal lines meet ``sheet`` within ``reach``."""
    points, owners = spread(triangles, spacing)
    a, b, c = triangles.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    keep = np.linalg.norm(normal, axis=1)[owners] > 0
    points, owners = points[keep], owners[keep]
    # a little inwards, so that the points on the border count as those beside it
    points = points + 1e-3 * (triangles[owners].mean(axis=1) - points)
    normal = (normal / np.linalg.norm(normal, axis=1, keepdims=True))[owners]
    weight = (areas(triangles) / np.bincount(owners, minlength=len(triangles)).clip(1))[owners]
    p, q, r = sheet.transpose(1, 0, 2)
    hit = np.zeros(len(points), dtype=bool)
    for n, (point, along) in enumerate(zip(points, normal, strict=True)):
        volumes = np.stack(
            [
                np.einsum("k,fk->f", along, np.cross(u - point, v - point))
                for u, v in ((p, q), (q, r), (r, p))
            ]
        )
        through = (volumes >= 0).all(axis=0) | (volumes <= 0).all(axis=0)
        total = volumes.sum(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            spot = (volumes[1] * p.T + volumes[2] * q.T + volumes[0] * r.T) / total
        way = np.abs(along @ (spot.T - point).T)
        hit[n] = bool((through & (way < reach)).any())
    return float(weight[hit].sum() / weight.sum())


def folds(pattern: mf.CreasePattern) -> float:
    """The largest fold angle in degrees, from the normals of the facets on both sides."""
    sides: dict[tuple[int, int], list[Array]] = {}
    for face in pattern.faces_vertices:
        face = face[face >= 0]
        p = pattern.folded_coords[face]
        normal = np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)  # twice the area vector
        for tail, head in zip(face.tolist(), np.roll(face, -1).tolist(), strict=True):
            sides.setdefault((min(tail, head), max(tail, head)), []).append(
                normal / np.linalg.norm(normal)
            )
    pairs = np.array([pair for pair in sides.values() if len(pair) == 2])
    sine = np.linalg.norm(np.cross(pairs[:, 0], pairs[:, 1]), axis=1)
    return float(
        np.degrees(np.arctan2(sine, np.einsum("nk,nk->n", *pairs.transpose(1, 0, 2)))).max()
    )


def brought(name: str, design: mf.Design, origin: Array) -> Array:
    """(T, 3, 3) what the sheet of ``name`` is to follow, relative to ``origin``.

    It is the mesh as it was made; of a plate, the skin that was chosen; of several parts, the one
    of most area.
    """
    vertices, faces = mesh(name)
    if SHAPES[name].kind == "plate":
        return np.asarray(design.request.surface.tiles())
    if any(finding.code == "pieces-left-out" for finding in design.findings):
        parts = trimesh.Trimesh(vertices, faces, process=False).split(only_watertight=False)
        part = max(parts, key=lambda one: one.area)
        vertices, faces = np.asarray(part.vertices), np.asarray(part.faces)
    once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]
    return np.asarray(vertices[faces[once]] - origin)


def again(name: str, design: mf.Design, found: mf.FitResult) -> dict[str, Any]:
    """Everything that is reported of the sheet, computed again, in mm and degrees."""
    pattern = found.pattern
    scale = pattern.scale
    target = brought(name, design, pattern.origin) * scale
    target = divided(target[areas(target) > 0])
    sheet = paper(pattern)
    diagonal = float(np.linalg.norm(np.ptp(target.reshape(-1, 3), axis=0)))
    spacing = SPACING * diagonal
    out, back = farthest(sheet, target, spacing), farthest(target, sheet, spacing)
    return {
        "hausdorff_mm": max(out, back),
        "sheet_to_target_mm": out,
        "target_to_sheet_mm": back,
        "fold_deg": folds(pattern),
        "area": float(areas(sheet).sum() / areas(target).sum()),
        "coverage": covered(target, sheet, 2 * SPACING * diagonal, 1.5 * max(out, back)),
        "diagonal_mm": diagonal,
    }


def answer(name: str, facets: str, edge: str, into: Path) -> dict[str, Any]:
    """What becomes of one mesh."""
    said: dict[str, Any] = {"name": name, "kind": SHAPES[name].kind, "facets": facets, "edge": edge}
    started = time.process_time()
    try:
        design = mf.design(trimesh.Trimesh(*mesh(name), process=False), facets=facets, edge=edge)
        found = mf.fit(design)
    except MiurafabError as fault:
        return said | {
            "status": "refused",
            "why": str(fault),
            "seconds": time.process_time() - started,
        }
    said |= {"seconds": time.process_time() - started, **found.report()}
    said["why"] = found.advice
    said["pieces"] = 0 if found.pattern is None else found.pattern.pieces_count
    if found.pattern is not None:
        found.pattern.save(into / f"{name}.fold")
        said["again"] = again(name, design, found)
    return said


def verdict(said: dict[str, Any]) -> str:
    """``sheet``, ``reason``, or what is wrong."""
    codes = {finding["code"] for finding in said.get("findings", ())}
    if said["status"] != "converged":
        return "reason" if said["why"] and said["seconds"] <= MOST_SECONDS else "slow reason"
    own = said["again"]
    faults = []
    if said["coverage"] < LEAST_COVERAGE:
        faults.append("coverage")
    if own["fold_deg"] > 165 and "steep-folds" not in codes:
        faults.append("fold without finding")
    if own["area"] > 4 and "much-paper" not in codes:
        faults.append("area without finding")
    for key in ("sheet_to_target_mm", "target_to_sheet_mm", "hausdorff_mm"):
        if abs(said[key] - own[key]) > 0.02 * own[key]:
            faults.append(f"{key} {said[key]:.3g} for {own[key]:.3g}")
    return ", ".join(faults) or "sheet"


HEAD = (
    "| mesh | answer | facets | pieces | coverage % (by rays) | over % | mid-surface % "
    "| Hausdorff % (again) | sectors | folds to | area | score | s |"
)


def row(said: dict[str, Any]) -> str:
    """One line of the table; lengths are parts of the target's diagonal."""
    name, found, seconds = said["name"], verdict(said), f"{said['seconds']:.0f}"
    if "again" not in said:
        return f"| {name} | {found}: {said['why']} |" + " |" * 10 + f" {seconds} |"
    own, shape = said["again"], said["quality"]
    part = 100 / own["diagonal_mm"]
    low, high = shape["sector_angle_deg"]
    cells = (
        name,
        found if said["status"] == "converged" else f"{found}: {said['why']}",
        said["facets"],
        said["pieces"],
        f"{100 * said['coverage']:.1f} ({100 * own['coverage']:.1f})",
        f"{100 * said['overhang']:.1f}",
        f"{part * said['deviation_mm']:.2f}",
        f"{part * said['hausdorff_mm']:.2f} ({part * own['hausdorff_mm']:.2f})",
        f"{low:.0f}-{high:.0f}",
        f"{own['fold_deg']:.0f}",
        f"{own['area']:.1f}",
        f"{said['score']['total']:.1f}",
        seconds,
    )
    return f"| {' | '.join(map(str, cells))} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--facets", default="20x20")
    parser.add_argument("--edge", default="trim", choices=("trim", "whole", "rectangle"))
    parser.add_argument("--into", type=Path, default=Path("meshes-answers"), metavar="DIR")
    parser.add_argument("--table", action="store_true", help="print what is there and stop")
    asked = parser.parse_args()
    asked.into.mkdir(parents=True, exist_ok=True)
    answers = []
    print(HEAD, "|---" * 13 + "|", sep="\n")
    for name in asked.names or SHAPES:
        path = asked.into / f"{name}.json"
        if not path.exists():
            if asked.table:
                continue
            said = answer(name, asked.facets, asked.edge, asked.into)
            path.write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
        answers.append(json.loads(path.read_text(encoding="utf-8")))
        print(row(answers[-1]), flush=True)
    good = sum(verdict(said) in ("sheet", "reason") for said in answers)
    print(f"\n{good} of {len(answers)} answered, {sum(a['seconds'] for a in answers):.0f} s")


if __name__ == "__main__":
    main()
