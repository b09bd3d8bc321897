"""Splits that a plan compares: besides the largest patches that fit, patches that share a sheet.

The fewest patches are rarely the patches that nest best. A patch as large as the bed needs a sheet
of its own, while patches of half or a third of the bed lie side by side. So the pattern is also
split for smaller rooms, 1/k of the bed along one side or half of it along both, and a grid is cut
into equal blocks. A small patch can be dissolved: cut into parts that go into the gaps of other
sheets. Its parts fit wherever it fitted, since the tab on the new seam lies within it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.fit_box import Space, support
from miurafab.fabrication.partition.pieces import full_grid, lattice_cells
from miurafab.fabrication.partition.region_growing import is_disk
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import facet_means, principal_axes
from miurafab.origami.crease_pattern import CreasePattern

_SHARES = (2, 3, 4)
"""Rooms of 1/k of a side. For k of 6 and 8 the glue grows about as k and no plan won (measured)."""

_TIGHT = (0.975, 0.95, 0.9, 0.85)
"""Rooms of these shares of the sides are tried against slivers: the patches become more equal, and
on the hypar of 600 mm and the demonstration their number and glue stay the same down to 0.85."""

_GRIDS = 4
"""So many divisions into equal blocks are tried, those with the fewest blocks."""

_PARTS = (2, 3, 4)
"""A patch is dissolved into so many parts."""


def smaller_rooms(room: Space, gap: float) -> list[Space]:
    """The rooms of which several lie side by side in ``room`` with ``gap`` mm between."""

    def share(side: float, k: int) -> float:
        return (side - (k - 1) * gap) / k

    width, height = room.width, room.height
    sizes = [(width, share(height, k)) for k in _SHARES]
    sizes += [(share(width, k), height) for k in _SHARES]
    sizes.append((share(width, 2), share(height, 2)))
    found: dict[tuple[float, ...], Space] = {}
    for size in sizes:
        if min(size) > 0:
            key = size if room.turns is not None else tuple(sorted(size))
            found.setdefault(key, Space(*size, room.turns))
    return list(found.values())


def tighter_rooms(room: Space) -> list[Space]:
    """Rooms a little smaller than ``room``, along both sides and along one, in which as many
    patches may be more equal.
    """
    width, height, turns = room.width, room.height, room.turns
    found = []
    for share in _TIGHT:
        found += [Space(share * width, share * height, turns), Space(width, share * height, turns)]
        if turns is not None:
            found.append(Space(share * width, height, turns))
    return found


def equal_blocks(
    pattern: CreasePattern, room: Space, depth: float, options: LayoutOptions, few: int, most: int
) -> list[LayoutOptions]:
    """``options`` with seams that cut a grid into equal blocks, ``few`` to ``most`` of them, each
    of which fits ``room`` less ``depth`` mm for tabs; the fewest blocks first.
    """
    if options.seam_rows or options.seam_columns:
        return []
    cells = full_grid(replace(pattern, cells=lattice_cells(pattern)))
    if cells is None:
        return []
    rows, columns = cells.shape
    corners = pattern.faces_vertices[cells.ravel()]
    body = support(pattern.vertices_coords[corners], corners >= 0, room.directions)
    values = body.reshape(rows, columns, -1)
    tight = room.smaller(depth)
    sizes = [
        (across, along)
        for across in range(1, min(rows, most) + 1)
        for along in range(1, min(columns, most // across) + 1)
        if across * along >= max(few, 2)
    ]
    found: list[LayoutOptions] = []
    for across, along in sorted(sizes, key=lambda size: (size[0] * size[1], size)):
        if len(found) == _GRIDS:
            break
        row, column = _equal(rows, across), _equal(columns, along)
        blocks = np.maximum.reduceat(np.maximum.reduceat(values, row, axis=0), column, axis=1)
        if tight.holds(blocks).all():
            found.append(
                replace(
                    options,
                    seam_rows=tuple(row[1:].tolist()),
                    seam_columns=tuple(column[1:].tolist()),
                )
            )
    return found


def _equal(lines: int, parts: int) -> Ints:
    """(parts,) the first of ``lines`` in each of so many equal parts."""
    return np.arange(parts) * lines // parts


def dissolved(pattern: CreasePattern, face_patch: Ints, patch: int) -> Iterator[Ints]:
    """Splits (F,) like ``face_patch``, with ``patch`` cut into 2, 3 or 4 disks along the rows or
    the columns of its facets, or across and along it where it has none.
    """
    facets = np.flatnonzero(face_patch == patch)
    cells = lattice_cells(pattern)
    if cells is None:
        middle = facet_means(pattern.vertices_coords, pattern.faces_vertices[facets])
        ranks = ((middle - middle.mean(axis=0)) @ principal_axes(middle)).argsort(0).argsort(0)
    else:
        ranks = np.column_stack(
            [np.unique(cells[facets, axis], return_inverse=True)[1] for axis in (0, 1)]
        )
    for axis in (0, 1):
        count = int(ranks[:, axis].max()) + 1
        for parts in _PARTS:
            if parts > count:
                continue
            place = ranks[:, axis] * parts // count
            if all(is_disk(pattern, facets[place == part]) for part in range(parts)):
                # The parts take the place of the patch, so that the order of the others stays.
                found = face_patch + np.where(face_patch > patch, parts - 1, 0)
                found[facets] += place
                yield found


def patch_areas(face_areas: Floats, face_patch: Ints) -> Floats:
    """(P,) the area of each patch of ``face_patch`` (F,), in mm²."""
    return np.asarray(np.bincount(face_patch, face_areas), dtype=np.float64)
