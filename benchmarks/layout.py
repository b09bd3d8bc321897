"""How long a large pattern takes on its way to sheets, and how near the result is to its bounds.

    python benchmarks/layout.py [dashes fan miura] [--facets 100000] [--vpype 2000] [--json FILE]

Both patterns lie on beds of 600 x 400 mm with a margin of 5 mm: a curved fan with facets of about
11 mm and a regular Miura-ori with facets of about 10 mm, in card with tabs of 7 mm.

The bound of the patches is the area of the pattern over that of the usable bed, without tabs. The
bound of the travel between dashes is that of benchmarks/travel_bound.py. Times are processor times,
so that other work on the machine does not count; vpype's are by the clock. With vpype installed,
its linesort is given the dashes of as many sheets as hold --vpype dashes.

``dashes`` is a case for the order alone, a Miura-ori of 1,984 creases with some 20,000 dashes: the
travel between creases against the least matching of their odd ends, and the travel between dashes
against its bound and against vpype, once by the shortest way and once with a price on corners.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from travel_bound import only, path_bound

from miurafab.fabrication import placing, plan, sheets
from miurafab.fabrication.drawing.dxf import sheet_dxf
from miurafab.fabrication.drawing.svg import sheet_svg
from miurafab.fabrication.route.order import StrokeSet, corner_of, order_strokes
from miurafab.fabrication.route.postman import find_route
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.quads import QuadGrid
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import OPERATIONS, load_machine, load_material
from miurafab.profiles.material import Perforation

BED_MM, MARGIN_MM = (600.0, 400.0), 5.0
STAGES = {
    "split": (plan, "patches and tabs"),
    "outline_split": (plan, "patches and tabs"),
    "nest": (plan, "nesting"),
    "place_texts": (placing, "lettering"),
    "sheet_strokes": (sheets, "perforation"),
    "order_strokes": (sheets, "ordering"),
}
LIMITS = {"patches and tabs": 20.0, "perforation": 5.0, "ordering": 5.0, "SVG": 10.0, "DXF": 10.0}


def pattern_of(points: np.ndarray) -> CreasePattern:
    """The pattern of a vertex grid (rows, columns, 2): column lines alternate as a whole, row lines
    from segment to segment, as in a Miura-ori.
    """
    rows, columns = points.shape[:2]
    grid = QuadGrid(columns, rows)
    edges = grid.edges_vertices
    row, column = np.divmod(edges.min(axis=1), columns)
    along = np.abs(edges[:, 1] - edges[:, 0]) == 1
    kinds = np.where((np.where(along, row + column, column) % 2) == 0, "M", "V")
    border = np.where(
        along, (row == 0) | (row == rows - 1), (column == 0) | (column == columns - 1)
    )
    kinds = np.where(border, "B", kinds)
    index = np.arange(rows * columns).reshape(rows, columns)
    corners = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    return CreasePattern(
        vertices_coords=points.reshape(-1, 2),
        edges_vertices=edges,
        edges_assignment=kinds,
        edges_fold_angle=np.select([kinds == "M", kinds == "V"], [-2.0, 2.0], 0.0),
        faces_vertices=np.stack(corners, axis=-1).reshape(-1, 4),
        grid=(columns, rows),
    )


def fan(columns: int, rows: int) -> CreasePattern:
    """Row lines are arcs about one centre, column lines zig-zag across them."""
    cell, radius, skew = 11.0, 2000.0, 0.35
    i, j = np.indices((rows + 1, columns + 1))
    angle = np.pi / 2 + cell / (radius + 0.5 * rows * cell) * (columns / 2 - j - skew * (i % 2))
    away = radius + i * cell
    return pattern_of(np.stack([away * np.cos(angle), away * np.sin(angle)], axis=-1))


def miura(columns: int, rows: int) -> CreasePattern:
    """Parallelograms with sides of 10 mm and an acute angle of 67 degrees."""
    side, acute = 10.0, math.radians(67)
    i, j = np.indices((rows + 1, columns + 1))
    x = j * side + (i % 2) * side * math.cos(acute)
    return pattern_of(np.stack([x, i * side * math.sin(acute)], axis=-1))


PATTERNS = {"fan": fan, "miura": miura}


def measure(name: str, facets: int) -> tuple[dict[str, Any], tuple[Toolpath, ...]]:
    """The times of all stages in seconds, and what came of them."""
    columns = round(math.sqrt(1.6 * facets))
    pattern = PATTERNS[name](columns, round(facets / columns))
    machine = load_machine("fluidnc-laser-600")
    bed = replace(machine.bed, width_mm=BED_MM[0], height_mm=BED_MM[1], margin_mm=MARGIN_MM)
    seconds = {title: 0.0 for _, title in STAGES.values()}
    kept = {stage: getattr(module, stage) for stage, (module, _) in STAGES.items()}
    for stage, (module, title) in STAGES.items():
        setattr(module, stage, _timed(kept[stage], title, seconds))
    try:
        started = time.process_time()
        layout = sheets.lay_out(pattern, replace(machine, bed=bed), load_material("card-250"))
        seconds["all of the layout"] = time.process_time() - started
    finally:
        for stage, function in kept.items():
            setattr(STAGES[stage][0], stage, function)
    for title, draw in (("SVG", sheet_svg), ("DXF", sheet_dxf)):
        started = time.process_time()
        size = sum(len(draw(path)) for path in layout.toolpaths)
        seconds[title] = time.process_time() - started
        print(f"  {title} {size / 1e6:.1f} MB", file=sys.stderr)
    usable = (BED_MM[0] - 2 * MARGIN_MM) * (BED_MM[1] - 2 * MARGIN_MM)
    corners = pattern.vertices_coords[pattern.faces_vertices]
    x, y = corners[..., 0], corners[..., 1]
    area = abs((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum()) / 2
    dashes = [only(path, OPERATIONS.index("perforate")) for path in layout.toolpaths]
    totals = layout.totals
    return {
        "pattern": name,
        "facets": len(pattern.faces_vertices),
        "seconds": seconds,
        "patches": totals.patches,
        "patch_bound": area / usable,
        "sheets": totals.sheets,
        "seam_m": totals.seam_mm / 1000,
        "tabs": totals.tabs,
        "untabbed": len(layout.untabbed),
        "findings": [finding.code for finding in layout.findings],
        "density": totals.density,
        "dashes": sum(len(each) for each in dashes),
        "perforate_travel_m": sum(_legs(each).sum() for each in dashes) / 1000,
        "perforate_bound_m": sum(path_bound(each) for each in dashes) / 1000,
        "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }, layout.toolpaths


def _timed(
    function: Callable[..., Any], title: str, seconds: dict[str, float]
) -> Callable[..., Any]:
    def call(*arguments: Any, **named: Any) -> Any:
        started = time.process_time()
        try:
            return function(*arguments, **named)
        finally:
            seconds[title] += time.process_time() - started

    return call


def order_of_dashes() -> dict[str, Any]:
    """The travel in mm on a case of which other programs' figures are known.

    Of 20,263 dashes the best known order travelled 12,519 mm, 10,053 mm of it in the gaps; of the
    creases themselves, 977.1 mm, which is the optimum.
    """
    i, j = np.indices((33, 33))
    side, acute = 15.76, math.radians(67)
    points = np.stack([j * side + (i % 2) * side * math.cos(acute), i * side * math.sin(acute)], -1)
    pattern = pattern_of(points)
    creases = np.flatnonzero(pattern.edges_assignment != "B")
    a, b = pattern.edges_vertices[creases].T
    odd = np.flatnonzero(np.bincount(np.append(a, b)) % 2)
    route = find_route(a, b, pattern.vertices_coords, pattern.vertices_coords[odd[0]])
    card = load_material("card-250")
    dashes = Perforation(cut_mm=1.1, gap_mm=0.4, end_bridge_mm=0.3, min_end_mm=0.9)
    machine = load_machine("fluidnc-laser-600")
    machine = replace(machine, bed=replace(machine.bed, width_mm=700.0, height_mm=700.0))
    taken: list[StrokeSet] = []
    ordered = sheets.order_strokes
    sheets.order_strokes = lambda strokes, *rest, **more: (
        taken.append(strokes) or ordered(strokes, *rest, **more)
    )
    try:
        sheets.lay_out(pattern, machine, replace(card, perforation=dashes))
    finally:
        sheets.order_strokes = ordered
    perforate = OPERATIONS.index("perforate")
    (whole,) = taken
    chosen = whole.toolpath.operation == perforate
    strokes = StrokeSet(only(whole.toolpath, perforate), whole.group[chosen], whole.rank[chosen])
    found: dict[str, Any] = {
        "creases": len(creases),
        "crease_travel_mm": route.legs_mm,
        "crease_bound_mm": route.bound_mm,
        "dashes": len(strokes.toolpath),
        "bound_mm": path_bound(strokes.toolpath),
    }
    corner = corner_of(machine, card)
    for name, price in (("shortest", 0.0), ("corners", corner)):
        started = time.process_time()
        path = order_strokes(strokes, pattern.edges_vertices, corner_mm=price)
        found[f"{name}_seconds"] = time.process_time() - started
        found[f"{name}_mm"] = _legs(path).sum()
        found["gaps_mm"] = _legs(path)[np.diff(path.edge) == 0].sum()
    found["vpype"] = against_vpype((path,), 0)
    return found


def _legs(path: Toolpath) -> np.ndarray:
    """(S - 1,) the travel from each stroke to the next."""
    return np.linalg.norm(path.starts[1:] - path.ends[:-1], axis=1)


def against_vpype(paths: tuple[Toolpath, ...], least: int) -> dict[str, Any] | None:
    """The travel in mm of the dashes of some sheets, ours and after vpype's linesort; None where
    vpype is not installed.
    """
    vpype = shutil.which("vpype")
    if vpype is None:
        return None
    found = {"dashes": 0, "ours_mm": 0.0, "vpype_mm": 0.0, "vpype_seconds": 0.0, "bound_mm": 0.0}
    for path in paths:
        dashes = only(path, OPERATIONS.index("perforate"))
        with tempfile.TemporaryDirectory() as folder:
            raw, done = Path(folder, "raw.svg"), Path(folder, "sorted.svg")
            raw.write_text(sheet_svg(_shuffled(dashes)), encoding="utf-8")
            started = time.perf_counter()
            command = [vpype, "read", str(raw), "linesort", "write", str(done)]
            subprocess.run(command, check=True, capture_output=True)
            found["vpype_seconds"] += time.perf_counter() - started
            found["vpype_mm"] += _svg_travel(done, path.height_mm)
        found["ours_mm"] += _legs(dashes).sum()
        found["bound_mm"] += path_bound(dashes)
        found["dashes"] += len(dashes)
        if found["dashes"] >= least:
            break
    return found


def _shuffled(path: Toolpath) -> Toolpath:
    """The two-point strokes of ``path`` in no order, so that vpype's is its own."""
    order = np.random.default_rng(0).permutation(len(path))
    return replace(path, points=path.points.reshape(-1, 2, 2)[order].reshape(-1, 2))


def _svg_travel(file: Path, height: float) -> float:
    """The travel from the first stroke of an SVG to the last, in the order of the file."""
    from svgelements import SVG, Shape
    from svgelements import Path as Way

    ends = []
    for shape in SVG.parse(str(file), ppi=25.4).elements():
        if isinstance(shape, Shape):
            way = abs(Way(shape))
            first, last = way.first_point, way.current_point
            ends.append(((first.x, height - first.y), (last.x, height - last.y)))
    places = np.array(ends)
    return float(np.linalg.norm(places[1:, 0] - places[:-1, 1], axis=1).sum())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "patterns", nargs="*", default=["dashes", *PATTERNS], metavar="dashes|fan|miura"
    )
    parser.add_argument("--facets", type=int, default=100_000)
    parser.add_argument("--vpype", type=int, default=2000, help="dashes given to vpype, about")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = []
    for name in options.patterns:
        if name == "dashes":
            rows.append(order_of_dashes())
            _show_order(rows[-1])
            continue
        row, paths = measure(name, options.facets)
        row["vpype"] = against_vpype(paths, options.vpype)
        rows.append(row)
        _show(row)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")


def _show_order(row: dict[str, Any]) -> None:
    print(
        f"order of {row['creases']:,} creases: {row['crease_travel_mm']:.1f} mm of travel, "
        f"{row['crease_travel_mm'] / row['crease_bound_mm']:.4f} times the least matching\n"
        f"order of {row['dashes']:,} dashes: bound {row['bound_mm']:.0f} mm, "
        f"{row['gaps_mm']:.0f} mm of it gaps"
    )
    ways = [("shortest way", "shortest"), ("corners priced", "corners")]
    for title, name in ways:
        beyond = row[f"{name}_mm"] - row["gaps_mm"]
        print(
            f"  {title:20s}{row[f'{name}_mm']:9.0f} mm  {row[f'{name}_mm'] / row['bound_mm']:.3f} "
            f"times the bound, {beyond:.0f} mm besides the gaps (best known elsewhere: 2466), "
            f"{row[f'{name}_seconds']:.2f} s"
        )
    other = row["vpype"]
    if other is None:
        print("  vpype is not installed: no comparison")
    else:
        print(
            f"  {'vpype linesort':20s}{other['vpype_mm']:9.0f} mm  "
            f"{other['vpype_mm'] / row['bound_mm']:.3f} times the bound, "
            f"{other['vpype_mm'] - row['gaps_mm']:.0f} mm besides the gaps, "
            f"{other['vpype_seconds']:.1f} s by the clock"
        )


def _show(row: dict[str, Any]) -> None:
    print(f"{row['pattern']}, {row['facets']:,} facets, {row['megabytes']:.0f} MB at most")
    for title, seconds in row["seconds"].items():
        limit = f"   (limit {LIMITS[title]:.0f} s)" if title in LIMITS else ""
        print(f"  {title:20s}{seconds:9.2f} s{limit}")
    bound = row["patch_bound"]
    print(
        f"  {row['patches']} patches, {row['patches'] / math.ceil(bound):.3f} times the bound of "
        f"{math.ceil(bound)}; {row['sheets']} sheets, {row['density']:.0%} of them used\n"
        f"  {row['seam_m']:.1f} m of seams, {row['tabs']:,} tabs, {row['untabbed']} seam edges "
        f"without; findings: {', '.join(row['findings']) or 'none'}\n"
        f"  {row['dashes']:,} dashes, {row['perforate_travel_m']:.2f} m of travel between them, "
        f"{row['perforate_travel_m'] / row['perforate_bound_m']:.4f} times the bound"
    )
    other = row["vpype"]
    if other is None:
        print("  vpype is not installed: no comparison")
    else:
        print(
            f"  {other['dashes']:,} of the dashes: {other['ours_mm']:.0f} mm of travel, vpype "
            f"linesort {other['vpype_mm']:.0f} mm in {other['vpype_seconds']:.1f} s, bound "
            f"{other['bound_mm']:.0f} mm"
        )


if __name__ == "__main__":
    main()
