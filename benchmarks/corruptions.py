"""Does ``check`` find what was changed in a pattern file, and blame none that is whole?

    python benchmarks/corruptions.py [COUNT]

makes twenty sheets of ten kinds (fitted, trimmed, of several pieces, closed, converted through SVG
and DXF) and writes them in COUNT (default 200) different files. Each is checked whole, and with one
random change: a letter, a fold angle, a facet, a coordinate, the lattice, the scale. A change
is *found* where the command would exit with 1 or 2, and *said* where a finding names it that the
whole file does not get. Where a file has no folded form, some changes make another whole pattern:
those are not made (the corner of a sheet, say, may lie anywhere).
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import miurafab as mf
from miurafab.errors import MiurafabError
from miurafab.findings import refusals

COUNT = 200
KINDS = ("assignment", "angle", "facet", "coordinate", "grid", "scale", "seam")
Document = dict[str, Any]


def saddle(folder: Path) -> Path:
    """A mesh of z = x^2 - y^2 on 25 x 25 vertices, 100 mm wide."""
    x, y = np.meshgrid(np.linspace(-1, 1, 25), np.linspace(-1, 1, 25))
    points = 50 * np.stack([x, y, 0.4 * (x**2 - y**2)], axis=2).reshape(-1, 3)
    corner = (np.arange(24)[:, None] * 25 + np.arange(24)).ravel()
    quads = np.stack([corner, corner + 1, corner + 26, corner + 25], axis=1)
    path = folder / "saddle.stl"
    trimesh.Trimesh(points, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])).export(path)
    return path


def _fit(target: object, **options: Any) -> mf.CreasePattern:
    found = mf.fit(target, **options).pattern
    assert found is not None
    return found


def _converted(pattern: mf.CreasePattern, folder: Path, ending: str) -> mf.CreasePattern:
    pattern.save(folder / f"drawing{ending}")
    return mf.load(folder / f"drawing{ending}")


def makers(folder: Path) -> dict[str, Callable[[tuple[int, int], float], mf.CreasePattern]]:
    """The ten kinds of patterns, each made for a number of facets and a size in mm."""
    mesh = saddle(folder)

    def drawn(ending: str, **options: Any) -> Callable[[tuple[int, int], float], mf.CreasePattern]:
        return lambda facets, size: _converted(
            _fit("hypar", facets=facets, size=size, **options), folder, ending
        )

    return {
        "hypar": lambda facets, size: _fit("hypar", facets=facets, size=size),
        "sphere zone": lambda facets, size: _fit("sphere", facets=facets, size=size),
        "vase": lambda facets, size: _fit("vase", facets=facets, size=size),
        "cylinder, closed": lambda facets, size: _fit(
            "cylinder", facets=facets, size=size, close="seam"
        ),
        "saddle from a mesh, trimmed": lambda facets, size: _fit(mesh, facets=facets, size=size),
        "closed vase in gores": lambda facets, size: _fit(
            "vase", angle=360, close="seam", facets=(4, 4 * facets[1]), pieces=4, size=size
        ),
        "flat-foldable bump": lambda facets, size: _fit(
            "bump", facets=facets, size=size, flat_foldable="exact"
        ),
        "hypar through SVG": drawn(".svg"),
        "flat-foldable hypar through SVG": drawn(".svg", flat_foldable="exact"),
        "flat-foldable hypar through DXF": drawn(".dxf", flat_foldable="exact"),
    }


def corrupted(
    whole: Document, kind: str, random: np.random.Generator
) -> tuple[Document, str] | None:
    """``whole`` with one change of a ``kind`` and what was done; None where it has no such part."""
    file = json.loads(json.dumps(whole))
    return {
        "assignment": _assignment,
        "angle": _angle,
        "facet": _facet,
        "coordinate": _coordinate,
        "grid": _grid,
        "scale": _scale,
        "seam": _seam,
    }[kind](file, random)


def _assignment(file: Document, random: np.random.Generator) -> tuple[Document, str]:
    letters = file["edges_assignment"]
    edge = int(random.integers(len(letters)))
    letter = str(random.choice([each for each in "BMVFUCJ" if each != letters[edge]]))
    done = f"edge {edge} from {letters[edge]} to {letter}"
    letters[edge] = letter
    return file, done


def _angle(file: Document, random: np.random.Generator) -> tuple[Document, str] | None:
    if file.get("miurafab:angles"):
        return None
    angles = file["edges_foldAngle"]
    folding = [n for n, angle in enumerate(angles) if abs(angle) > 0.1]
    if "file_frames" not in file:
        folding = [n for n in folding if n in _about_interior(file)]
    edge = int(random.choice(folding))
    size = float(10 ** random.uniform(-3, 1))
    sign = 1 if angles[edge] > 0 else -1
    angle = [0.0, -angles[edge], angles[edge] - sign * size][int(random.integers(3))]
    done = f"edge {edge} from {angles[edge]:.6g} to {angle:.6g} degrees"
    angles[edge] = angle
    return file, done


def _facet(file: Document, random: np.random.Generator) -> tuple[Document, str]:
    faces = file["faces_vertices"]
    face = int(random.integers(len(faces)))
    way = ("left out", "doubled", "corner moved", "corner left out")[int(random.integers(4))]
    per_face = [key for key in ("miurafab:cells", "miurafab:pieces") if key in file]
    if way == "left out":
        for key in ("faces_vertices", *per_face):
            del file[key][face]
    elif way == "doubled":
        for key in ("faces_vertices", *per_face):
            file[key].append(file[key][face])
    elif way == "corner moved":
        others = [v for v in range(len(file["vertices_coords"])) if v not in faces[face]]
        faces[face][int(random.integers(len(faces[face])))] = int(random.choice(others))
    else:
        del faces[face][int(random.integers(len(faces[face])))]
    return file, f"facet {face} {way}"


def _coordinate(file: Document, random: np.random.Generator) -> tuple[Document, str]:
    frames = [file, *file.get("file_frames", [])]
    frame = frames[int(random.integers(len(frames)))]
    points = frame["vertices_coords"]
    folded = len(frames) > 1
    vertices = sorted(range(len(points)) if folded else _interior(file))
    vertex = int(random.choice(vertices))
    size = float(10 ** random.uniform(-6 if folded else -2, 0.5))
    axis = int(random.integers(len(points[vertex])))
    points[vertex][axis] += size
    return file, f"vertex {vertex} by {size:.2g} mm along axis {axis}"


def _grid(file: Document, random: np.random.Generator) -> tuple[Document, str] | None:
    if "miurafab:grid" in file:
        columns, rows = file["miurafab:grid"]
        changes = [[columns + 1, rows], [columns, rows - 1], [rows, columns]]
        grid = changes[int(random.integers(3 if rows != columns else 2))]
        file["miurafab:grid"] = grid
        return file, f"grid {grid}"
    if "miurafab:cells" not in file:
        return None
    cells = file["miurafab:cells"]
    face, axis = int(random.integers(len(cells))), int(random.integers(2))
    cells[face][axis] += int(random.choice([-3, -2, 2, 3]))
    return file, f"cell of facet {face}"


def _seam(file: Document, random: np.random.Generator) -> tuple[Document, str] | None:
    if not file.get("miurafab:seams"):
        return None
    gone = file["miurafab:seams"].pop(int(random.integers(len(file["miurafab:seams"]))))
    return file, f"seam {gone} left out"


def _scale(file: Document, random: np.random.Generator) -> tuple[Document, str] | None:
    if "file_frames" not in file:
        return None
    factor = float(random.choice([-1, 1]) * 10 ** random.uniform(-1.3, -0.3) + 1)
    which = int(random.integers(0 if "miurafab:scale" in file else 1, 3))
    if which == 0:
        file["miurafab:scale"] *= factor
        return file, f"scale times {factor:.3f}"
    frame = (file, file["file_frames"][0])[which - 1]
    frame["vertices_coords"] = (factor * np.array(frame["vertices_coords"])).tolist()
    return file, f"frame {which - 1} times {factor:.3f}"


def _interior(file: Document) -> set[int]:
    rim = {
        vertex
        for ends, letter in zip(file["edges_vertices"], file["edges_assignment"], strict=True)
        for vertex in ends
        if letter == "B"
    }
    return set(range(len(file["vertices_coords"]))) - rim


def _about_interior(file: Document) -> set[int]:
    inside = _interior(file)
    return {n for n, ends in enumerate(file["edges_vertices"]) if inside & set(ends)}


def verdict(document: Document, path: Path) -> tuple[bool, set[tuple[str, object]]]:
    """Whether ``check`` refuses the file, and what its findings are about."""
    path.write_text(json.dumps(document))
    try:
        found = mf.check(path).findings
    except MiurafabError as fault:
        return True, {("error", str(fault))}
    return bool(refusals(found)), {(each.code, each.where) for each in found}


def wholes(count: int, folder: Path, random: np.random.Generator) -> Iterator[tuple[str, Document]]:
    """``count`` whole pattern files of ten kinds: two sheets of each, in files whose size, order
    and direction of edges and first corners of facets differ.
    """
    kinds = makers(folder)
    sheets = {
        (name, half): make((4 + 2 * half, 6), float(random.uniform(60, 200)))
        for name, make in kinds.items()
        for half in range(min(2, -(-count // len(kinds))))
    }
    for number in range(count):
        name = list(kinds)[number % len(kinds)]
        half = number // len(kinds) % 2
        path = folder / "whole.fold"
        sheets[name, half].scaled(float(random.uniform(0.5, 2))).save(path)
        yield name, rewritten(json.loads(path.read_text()), random)


def rewritten(file: Document, random: np.random.Generator) -> Document:
    """The same pattern in other words."""
    order = random.permutation(len(file["edges_vertices"])).tolist()
    ends = [file["edges_vertices"][edge] for edge in order]
    file["edges_vertices"] = [pair[:: int(random.choice([-1, 1]))] for pair in ends]
    for frame in (file, *file.get("file_frames", [])):
        for key in {"edges_assignment", "edges_foldAngle"} & set(frame):
            frame[key] = [frame[key][edge] for edge in order]
    if "miurafab:seams" in file:
        place = {edge: number for number, edge in enumerate(order)}
        file["miurafab:seams"] = [[place[edge] for edge in pair] for pair in file["miurafab:seams"]]
    turns = random.integers(3, size=len(file["faces_vertices"])).tolist()
    faces = zip(file["faces_vertices"], turns, strict=True)
    file["faces_vertices"] = [face[turn:] + face[:turn] for face, turn in faces]
    return file


def main() -> int:
    """Print what was found and what not; 1 if something was missed or blamed."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    random = np.random.default_rng(14)
    found: Counter[str] = Counter()
    made: Counter[str] = Counter()
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number, (kind_of, whole) in enumerate(wholes(count, folder, random)):
            refused, before = verdict(whole, folder / "check.fold")
            if refused:
                wrong += 1
                print(f"BLAMED: {kind_of}: {before}", flush=True)
            change = None
            for step in range(len(KINDS)):
                kind = KINDS[(number + number // 10 + step) % len(KINDS)]
                change = corrupted(whole, kind, random)
                if change is not None:
                    break
            assert change is not None
            refused, after = verdict(change[0], folder / "check.fold")
            made[kind] += 1
            how = "found" if refused else "said" if after - before else "missed"
            found[f"{kind} {how}"] += 1
            if how != "found":
                print(f"{how}: {kind_of}: {change[1]}: {after - before}", flush=True)
            wrong += how == "missed"
    print(f"{count} whole files; {sum(made.values())} changed ones")
    for kind in KINDS:
        figures = ", ".join(
            f"{found[f'{kind} {how}']} {how}" for how in ("found", "said", "missed")
        )
        print(f"{kind}: {made[kind]} changed, {figures}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
