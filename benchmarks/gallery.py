"""The gallery: named surfaces and shapes of the world about us, fitted, laid out and drawn.

    python benchmarks/gallery.py                # writes docs/gallery.md's tables and pictures
    python benchmarks/gallery.py --front        # writes front.png, for the README
    python benchmarks/gallery.py hypar globe    # these rows, printed; nothing is written
    python benchmarks/gallery.py --designs      # every design of patterns/ with 28x28 facets

Each row is made by the commands that it shows: ``miurafab fit``, then ``miurafab sheets`` for the
README's laser and card. A picture shows the target, the folded shell and the flat pattern. The
second table has the designs of ``patterns/`` as they are, without pictures.

``--designs`` exits with 1 if a design does not converge with every residual at most 1e-12, crosses
itself, overlaps when flat, or has a shorter edge than it asks for.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import kit_pictures
import numpy as np
import page_tables
import resvg_py
from PIL import Image

import miurafab as mf
from miurafab.fabrication.drawing.kit_sections import KitSections
from miurafab.fabrication.drawing.views import Views
from miurafab.fabrication.sheets import lay_out
from miurafab.origami.fitting.fit import fit
from miurafab.origami.picture import azimuth_of, flat_svg, project
from miurafab.profiles import load_machine, load_material
from miurafab.surfaces.description import described_surface
from miurafab.workflow.design import design
from miurafab.workflow.picture import png_bytes

ROOT = Path(__file__).parent.parent
PAGE, PICTURES = ROOT / "docs" / "gallery.md", ROOT / "docs" / "gallery"
RESIDUAL = 1e-12
WIDTH, COLOURS = 330, 256
"""Pixels of a panel, and colours of a picture."""
SURFACE = np.array([166.0, 187.0, 214.0])
"""The colour of a target, 0 to 255."""
LASER = ("--machine", "grbl-laser-400", "--material", "card-250")


@dataclass(frozen=True)
class Entry:
    """A row: its name, and the words after ``miurafab fit``."""

    name: str
    words: str


ENTRIES = (
    *(Entry(name, f"{name} --facets 20x20") for name in (
        "plane", "cylinder", "log-spiral", "sphere", "hypar", "saddle", "paraboloid", "bump",
        "helicoid", "pill", "candlestick", "vase", "hyperboloid", "catenoid", "ellipsoid",
        "revolution", "formula")),
    Entry("globe", "ellipsoid:latitude=85,height=1,angle=360 --close seam --pieces 8 "
          "--facets 24x48"),
    Entry("whole-vase", "vase:angle=360 --close seam --facets 24x24"),
    Entry("lampshade", "lampshade.stl --facets 32x20 --size 200mm"),
    Entry("mask", "face.stl --facets 20x20 --size 200mm"),
    Entry("roof", "hood.stl --facets 20x20 --size 200mm"),
)  # fmt: skip
DESIGNS = tuple(
    Entry(path.stem, f"patterns/{path.name}") for path in sorted((ROOT / "patterns").glob("*.toml"))
)
MESHES = ("lampshade", "face", "hood")
"""Meshes of ``tests/mesh_shapes.py`` that entries fit."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(e.name for e in ENTRIES))
    parser.add_argument("--designs", action="store_true", help="the designs of patterns/ instead")
    parser.add_argument("--front", action="store_true", help="the picture of the README instead")
    asked = parser.parse_args()
    if asked.designs:
        return designs()
    if asked.front:
        (PICTURES / "front.png").write_bytes(front())
        return 0
    rows: page_tables.Rows = []
    for entry in ENTRIES:
        if not asked.names or entry.name in asked.names:
            row, picture = made(entry)
            rows.append(row)
            print(*row, sep=" | ", flush=True)
            if not asked.names:
                PICTURES.mkdir(exist_ok=True)
                (PICTURES / f"{entry.name}.png").write_bytes(picture)
    if not asked.names:
        plain = [design_row(entry) for entry in DESIGNS]
        tables = {
            "shapes": page_tables.markdown(HEAD, rows, 2),
            "designs": page_tables.markdown(DESIGN_HEAD, plain, 1),
        }
        page_tables.write_tables(PAGE, "gallery", tables)
    return 0


FIGURES = ("facets, pieces", "off, mm", "folds", "paper", "sheets", "glue", "laser")
HEAD = ("shape", "target, shell, flat pattern", *FIGURES)
DESIGN_HEAD = ("design", *FIGURES)


def made(entry: Entry) -> tuple[tuple[str, ...], bytes]:
    """The row of one entry, and its picture as a PNG."""
    shown = f"![{entry.name}](gallery/{entry.name}.png)"
    with _workplace(entry):
        row = (_named(entry), shown, *figures(entry))
        return row, side_by_side(panels(mf.load("fitted.fold")))


def design_row(entry: Entry) -> tuple[str, ...]:
    """The row of a design, which has no picture."""
    with _workplace(entry):
        return (_named(entry), *figures(entry))


def _named(entry: Entry) -> str:
    return f"**{entry.name}**<br>`fit {entry.words}`"


@contextlib.contextmanager
def _workplace(entry: Entry) -> Iterator[None]:
    """A new working directory with the files that the entry fits."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("patterns").symlink_to(ROOT / "patterns")
        write_meshes(entry)
        yield


def figures(entry: Entry) -> tuple[str, ...]:
    """The :data:`FIGURES` of the entry, whose pattern is then in ``fitted.fold``."""
    report = answer(["fit", *shlex.split(entry.words), "-o", "fitted.fold"])
    job = answer(["sheets", "fitted.fold", "-o", "job", *LASER])["totals"]
    quality = report["quality"]
    folds = [round(angle) for angle in quality["fold_angle_deg"]]
    minutes, seconds = divmod(round(job["seconds"]), 60)
    return (
        f"{report['facets']:,}, {report['pieces']}",
        f"{report['hausdorff_midsurface_mm']:.2f}",
        f"{folds[0]}, {folds[2]}",
        f"{quality['area_ratio']:.1f}",
        f"{job['sheets']}",
        f"{job['seam_mm'] / 1000:.2f} m",
        f"{minutes}:{seconds:02d}",
    )


def write_meshes(entry: Entry) -> None:
    """Write the mesh that the entry fits into the working directory."""
    for name in MESHES:
        if entry.words.startswith(f"{name}.stl"):
            sys.path.insert(0, str(ROOT / "tests"))
            import trimesh
            from mesh_shapes import mesh

            vertices, faces = mesh(name)
            trimesh.Trimesh(vertices, faces, process=False).export(f"{name}.stl")


def answer(words: list[str]) -> dict[str, Any]:
    """The JSON that the command prints."""
    command = [sys.executable, "-m", "miurafab", *words, "--json", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{shlex.join(words)} ends with {done.returncode}: {done.stderr}")
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def panels(pattern: mf.CreasePattern) -> tuple[Image.Image, ...]:
    """The target, the folded shell and the flat pattern."""
    assert pattern.folded_coords is not None
    surface, _ = described_surface(pattern.target)
    assert surface is not None
    tiles = surface.tiles() * pattern.scale
    folded, faces = pattern.folded_coords, pattern.faces_vertices
    azimuth = azimuth_of(folded, faces)
    corners = np.arange(3 * len(tiles)).reshape(-1, 3)
    drawn = (
        polygons(tiles.reshape(-1, 3), corners, azimuth, tiles=True),
        polygons(folded, faces, azimuth),
        flat_svg(pattern, WIDTH),
    )
    return tuple(
        Image.open(io.BytesIO(resvg_py.svg_to_bytes(svg_string=svg, width=WIDTH))) for svg in drawn
    )


def side_by_side(images: Sequence[Image.Image]) -> bytes:
    """The ``images`` as one PNG."""
    high = max(image.height for image in images)
    whole = Image.new("RGB", (sum(image.width for image in images), high), "white")
    at = 0
    for image in images:
        whole.paste(image, (at, (high - image.height) // 2))
        at += image.width
    content = io.BytesIO()
    few = whole.quantize(COLOURS, dither=Image.Dither.NONE)
    few.save(content, "PNG", optimize=True)
    return content.getvalue()


def front() -> bytes:
    """The way of the README's hypar: target, sheet, a figure of its guide, and the shell."""
    machine, material = load_machine("grbl-laser-400"), load_material("card-250")
    pattern = mf.fit("hypar", height=0.5, facets=(20, 20), size=220).pattern
    smooth, shell, _ = panels(pattern)
    with tempfile.TemporaryDirectory() as folder:
        mf.sheets(pattern, machine=machine, material=material).write(f"{folder}/job")
        shown = mf.preview(f"{folder}/job")
        sheet = Image.open(io.BytesIO(png_bytes(shown.sheets[0], machine))).convert("RGB")
    sheet.thumbnail((4 * WIDTH, int(1.25 * WIDTH)), Image.Resampling.LANCZOS)
    views = Views(lay_out(pattern, machine, material), pattern)
    figures = next(
        kit_pictures.figures_of(section)
        for section in KitSections(views).sections()
        if section.title.startswith("collapse")
    )
    guide = Image.open(io.BytesIO(kit_pictures.png(figures[1:2])))
    guide.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
    return side_by_side((smooth, sheet, guide.convert("RGB"), shell))


def polygons(points: np.ndarray, faces: np.ndarray, azimuth: float, tiles: bool = False) -> str:
    """Facets as an SVG, or the tiles of a smooth surface in one colour without edges."""
    view = project(points, faces, azimuth)
    low, size = view.places.min(axis=0), np.ptp(view.places, axis=0)
    scale = (WIDTH - 16) / max(size)
    places = (view.places - low) * scale + (8 + (WIDTH - 16 - scale * size[0]) / 2, 0)
    places[:, 1] = 8 + scale * size[1] - places[:, 1]
    shade = view.shade[:, None]
    base = np.where(view.front[:, None], (242.0, 230.0, 207.0), (157.0, 181.0, 161.0))
    colours = np.clip((SURFACE if tiles else base) * shade, 0, 255).astype(np.uint8)
    parts = []
    for face in view.order.tolist():
        corners = places[faces[face][faces[face] >= 0]]
        data = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners.tolist())
        fill = bytes(colours[face]).hex()
        line = fill if tiles else bytes((colours[face] * 0.7).astype(np.uint8)).hex()
        parts.append(f'<polygon points="{data}" fill="#{fill}" stroke="#{line}"/>')
    height = scale * size[1] + 16
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.1f}" '
        f'width="{WIDTH}" height="{height:.0f}"><rect width="100%" height="100%" fill="#fff"/>'
        f'<g stroke-width="0.5" stroke-linejoin="round">{"".join(parts)}</g></svg>'
    )


def designs() -> int:
    """Fit the designs of patterns/ with 28x28 facets, and print how well each fits."""
    print(
        f"{'design':<14} {'status':<11} {'facets':>6} {'planar':>8} {'develop':>8} {'isometry':>8} "
        f"{'flatfold':>8} {'min edge':>8} {'mid dev':>8} {'cross':>5} {'over':>4} {'tries':>5} "
        f"{'seconds':>7}"
    )
    failed = []
    started = time.perf_counter()
    for path in sorted((ROOT / "patterns").glob("*.toml")):
        result = fit(design(str(path), facets="28x28").request)
        m = result.measurements
        if m is None or result.pattern is None:
            print(f"{path.stem:<14} {result.status:<11} {result.advice}")
            failed.append(path.stem)
            continue
        worst = max(m.max_planarity or 0, m.max_developability or 0, m.max_isometry or 0)
        print(
            f"{path.stem:<14} {result.status:<11} {m.facets:>6} {m.max_planarity:>8.0e} "
            f"{m.max_developability:>8.0e} {m.max_isometry:>8.0e} {m.max_flat_foldability:>8.0e} "
            f"{m.min_edge_mm:>8.2f} {m.hausdorff_midsurface_mm:>8.2f} {m.self_intersections:>5} "
            f"{m.overlaps:>4} {len(result.attempts):>5} {result.seconds:>7.2f}"
        )
        if result.status != "converged" or worst > RESIDUAL:
            failed.append(path.stem)
    print(f"{time.perf_counter() - started:.1f} s together")
    if failed:
        print(f"not as asked: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
