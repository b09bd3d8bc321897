"""The lattice of a sheet on all of a disk mesh: cells of its box that meet the region inside its
outline.

Only the sheet inside the outline counts, so nothing is fitted elsewhere: cells that are not kept
have no facets, no vertices and no slide. The lattice is laid at several angles. At the rim the
sheet is held back from retreating, and after the solve it is cut along the outline.

The domain reaches half a cell beyond the box, so that the outline along its sides cuts cells in
half and leaves no slivers, and along v by at least half the zig-zag, so that the lower ends of the
zig-zag reach the outline too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from miurafab.geometry.arrays import Bools, Ints
from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.quads import QuadCharts
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.nominal import Rim
from miurafab.origami.fitting.request import FitOptions
from miurafab.origami.trim import inner_facets, trimmed
from miurafab.surfaces.outline import WholeMesh

ANGLES = (0.0, math.pi / 2, math.pi / 4, 3 * math.pi / 4)
"""The angles of the lattice against the longer side of the layout."""


@dataclass(frozen=True, eq=False)
class OutlinedLattice:
    """The charts of the cells that meet the region inside the outline of ``target``, and the rim
    that their sheet is to reach.

    ``cost`` is the logarithm of how much longer the cells are along one side than along the other,
    times how many cells there are for each that is kept: few and oblong cells follow the target
    less closely.
    """

    target: WholeMesh
    charts: QuadCharts
    rim: Rim
    cost: float

    @classmethod
    def of(
        cls,
        whole: WholeMesh,
        angle: float,
        cells: tuple[int, int],
        zigzag: float,
        piece_of_column: Ints,
    ) -> OutlinedLattice:
        """A lattice of ``cells`` columns and rows over the box of ``whole`` at ``angle`` (radians).

        ``zigzag`` is over the column spacing; ``piece_of_column`` (columns,) parts the charts.
        """
        columns, rows = cells
        low, high = whole.laid(angle).outline.box
        width, height = (high - low).tolist()
        column, row = width / (columns - 1), height / max(rows - 1, 1)
        target = whole.laid(angle, (column / 2, max(row, zigzag * column) / 2))
        kept = _in_one_piece(target.kept(columns, rows, zigzag * column))
        charts = QuadCharts.of_cells(kept, piece_of_column)
        # what hangs over is cut off
        rim = Rim(*target.rim(columns, rows, charts.cells, zigzag * column), overhang=0.0)
        ratio = target.domain.width / columns * rows / target.domain.height
        cost = abs(math.log(ratio)) + math.log(kept.size / kept.sum())
        return cls(target, charts, rim, cost)


def angles_of(rotate: float | None) -> tuple[float, ...]:
    """The angles to try; where ``rotate`` is given, that one and its right angle."""
    return ANGLES if rotate is None else (rotate, rotate + math.pi / 2)


def with_border(
    pattern: CreasePattern, target: WholeMesh, charts: QuadCharts, asked: FitOptions
) -> CreasePattern:
    """``pattern``, the sheet of ``charts``, cut along the outline of ``target``, or its whole
    facets inside where `edge` asks for them, and where the cut leaves an edge under `min_edge`.
    """
    corner = charts.cells[:, None, :] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    near = np.zeros((len(pattern.vertices_coords), 2))
    near[pattern.faces_vertices] = target.domain.at(corner, (asked.columns, asked.rows))
    if asked.edge == "trim":
        cut = trimmed(pattern, target, near)
        assert cut.folded_coords is not None
        size = float(np.ptp(cut.folded_coords, axis=0).max())
        scale = 1.0 if asked.side_mm is None else asked.side_mm / size
        shortest = float(edge_lengths(cut.vertices_coords, cut.edges_vertices).min())
        if asked.min_edge_mm is None or scale * shortest >= asked.min_edge_mm:
            return cut
    whole = inner_facets(pattern, target, near)
    return replace(whole, target=whole.target | {"edge": "whole"})


def _in_one_piece(kept: Bools) -> Bools:
    """The largest part of the cells ``kept`` that hangs together across sides."""
    from scipy.ndimage import label

    parts, count = label(kept)
    if count < 2:
        return kept
    return np.asarray(parts == 1 + np.argmax(np.bincount(parts.ravel())[1:]))
