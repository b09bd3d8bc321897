"""Tubes and closed bodies in gores: how near a sheet comes, and whether its job glues to the shell.

    python benchmarks/bodies.py                    the bodies of ``BODIES``
    python benchmarks/bodies.py pin head           only these
    python benchmarks/bodies.py --glue             each also as a job, read back and glued in memory

The meshes are those of tests/mesh_shapes.py; the globe is the named ellipsoid. Each line is
recomputed from the pattern that the fit returns; the time is that of the fit and its measurements.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

import miurafab as mf
from miurafab.errors import MiurafabError
from miurafab.geometry.angles import angle_between

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from gluing import glued_shell, read_job
from mesh_shapes import mesh

BODIES: dict[str, dict[str, object]] = {
    "globe": {"facets": "24x48", "pieces": 8},
    "pin": {"facets": "32x28", "pieces": 6},
    "bent-pipe": {"facets": "32x28", "pieces": 6},
    "lampshade": {"facets": "32x20", "pieces": 8},
    "vase": {"facets": "32x28", "pieces": 6},
    "banana": {"facets": "40x32"},
    "head": {"facets": "20x20"},
    "pebble": {"facets": "20x20"},
    "egg": {"facets": "20x20"},
    "ball": {"facets": "20x20"},
    "bumpy": {"facets": "20x20"},
    "ragged-tube": {"facets": "20x20"},
}
"""What each is asked for. Without pieces, their number is the fit's choice."""

GLOBE = {"latitude": 85, "height": 1.0, "angle": 360, "close": "seam"}
SIZE = "200mm"


def fitted(name: str, options: dict[str, object]) -> mf.FitResult:
    if name == "globe":
        return mf.fit("ellipsoid", size=SIZE, **GLOBE, **options)
    vertices, faces = mesh(name)
    return mf.fit(trimesh.Trimesh(vertices, faces, process=False), size=SIZE, **options)


def line(name: str, options: dict[str, object], glue: bool) -> str:
    began = time.process_time()
    try:
        sheet = fitted(name, options)
    except MiurafabError as reason:
        return f"| {name} | refused in {time.process_time() - began:.1f} s: {reason} |"
    seconds = time.process_time() - began
    pattern, m = sheet.pattern, sheet.measurements
    if sheet.status != "converged" or pattern is None or m is None or sheet.score is None:
        return f"| {name} | {sheet.status} in {seconds:.1f} s: {sheet.advice} |"
    corners = pattern.folded_coords[pattern.faces_vertices]
    ahead, behind = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    sectors = np.degrees(angle_between(ahead, behind))
    diagonal = float(np.linalg.norm(np.ptp(pattern.folded_coords, axis=0)))
    pieces = 1 if pattern.pieces is None else int(pattern.pieces.max()) + 1
    residual = max(m.max_planarity, m.max_developability, m.max_isometry)
    parts = [
        name, str(pieces), f"{options['facets']}", str(m.facets),
        f"{100 * m.hausdorff_midsurface_mm / diagonal:.2f}", f"{m.coverage:.3f}",
        f"{m.overhang:.3f}", f"{m.self_intersections}", f"{sheet.score.bow_ties}",
        f"{sectors.min():.0f}-{sectors.max():.0f}", f"{residual:.0e}", f"{seconds:.1f}",
    ]  # fmt: skip
    if glue:
        gap, off = as_job(sheet)
        parts.append(f"{gap:.3f} / {off:.3f}")
    return "| " + " | ".join(parts) + " |"


def as_job(sheet: mf.FitResult) -> tuple[float, float]:
    """The widest gap at a seam, and the farthest corner from the shell, mm, of the glued job."""
    with tempfile.TemporaryDirectory() as folder:
        mf.sheets(sheet, machine="grbl-laser-400", material="card-250").write(folder)
        return glued_shell(*read_job(Path(folder)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--glue", action="store_true", help="make a job of each and glue it")
    parser.add_argument("names", nargs="*", help="only these bodies")
    asked = parser.parse_args()
    print(
        "| body | pieces | asked | facets | middle % | coverage | overhang | crossings | bow-ties "
        "| sectors | residual | CPU s |" + (" gap / off, mm |" if asked.glue else "")
    )
    print("|" + "---|" * (13 if asked.glue else 12))
    for name in asked.names or BODIES:
        print(line(name, BODIES[name], asked.glue), flush=True)


if __name__ == "__main__":
    main()
