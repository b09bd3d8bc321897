"""The loop closed: four shells, cut by the virtual laser, recovered from its beam log, and glued.

    python benchmarks/closed_loop.py

prints a line for each: the largest distance of a recovered corner from its place in the folded form
of the pattern file. It takes about two minutes.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

import miurafab as mf

ALLOWED_MM = 0.05


def saddle(folder: Path) -> Path:
    """A mesh of z = x^2 - y^2 on 31 x 31 vertices, 100 mm wide."""
    x, y = np.meshgrid(np.linspace(-1, 1, 31), np.linspace(-1, 1, 31))
    points = 50 * np.stack([x, y, 0.4 * (x**2 - y**2)], axis=2).reshape(-1, 3)
    corner = (np.arange(30)[:, None] * 31 + np.arange(30)).ravel()
    quads = np.stack([corner, corner + 1, corner + 32, corner + 31], axis=1)
    mesh = trimesh.Trimesh(points, np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]))
    path = folder / "saddle.stl"
    mesh.export(path)
    return path


def shells(folder: Path) -> dict[str, object]:
    """The sheets by name."""
    return {
        "hypar, 20x20, 280 mm": mf.fit("hypar", height=0.5, facets=(20, 20), size=280),
        "sphere zone, 12x12, 150 mm": mf.fit("sphere", facets=(12, 12), size=150),
        "closed vase, 6 gores, 200 mm": mf.fit(
            "vase", angle=360, close="seam", facets=(10, 24), pieces=6, size=200
        ),
        "mesh saddle, 12x12, 150 mm": mf.fit(saddle(folder), facets=(12, 12), size=150),
    }


def main() -> int:
    """Print the table; 1 if a shell is farther off than allowed."""
    worst = 0.0
    print("| shell | patches | corners | worst mm | target mm | folded form to target mm | s |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for title, sheet in shells(folder).items():
            job = mf.sheets(sheet)
            job.write(folder / "job")
            started = time.process_time()
            found = mf.rebuild(folder / "job")
            seconds = time.process_time() - started
            off = [math.nan if v is None else v for v in (found.target_mm, found.folded_target_mm)]
            print(
                f"| {title} | {job.layout.totals.patches} | {found.measured} of {found.corners} | "
                f"{found.worst_mm:.3f} | {off[0]:.2f} | {off[1]:.2f} | {seconds:.0f} |",
                flush=True,
            )
            worst = max(worst, found.worst_mm)
    return 0 if worst <= ALLOWED_MM else 1


if __name__ == "__main__":
    sys.exit(main())
