"""Split of a pattern into patches that fit the bed with their tabs.

Each piece of the pattern (:mod:`~miurafab.fabrication.partition.pieces`) is split by itself. A
piece that fits is one patch, with its holes. Otherwise its patches are disks: a grid of facets is
cut into bands and runs (:mod:`~miurafab.fabrication.partition.grid_dp`), and any other mesh is
split by region growing (:mod:`~miurafab.fabrication.partition.region_growing`). The split is then
improved without regard to grid lines (:mod:`~miurafab.fabrication.partition.improve`), unless
patches must keep the directions of the pattern. A flat pattern may overlap itself, but a patch may
not: a patch that does is halved until no patch overlaps itself.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import LayoutError
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.boundary import boundaries, overlapping
from miurafab.fabrication.partition.fit_box import Space, support
from miurafab.fabrication.partition.grid_dp import Block, GridShape, split_grid
from miurafab.fabrication.partition.improve import improved
from miurafab.fabrication.partition.pieces import (
    StandingTabs,
    full_grid,
    hanging_together,
    lattice_cells,
    standing,
)
from miurafab.fabrication.partition.region_growing import grow_patches
from miurafab.fabrication.seams import inner_seams
from miurafab.fabrication.tab_choice import border_tabs, choose_tabs
from miurafab.fabrication.tabs import TabRegions, tab_regions
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import no_polygons, smallest_box
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.piece import Piece
from miurafab.profiles import Material

_MANY = 30_000
"""In grids with more facets only every other angle is tried."""


def split(
    pattern: CreasePattern,
    width: float,
    height: float,
    material: Material,
    options: LayoutOptions | None = None,
    *,
    turns: tuple[int, ...] | None = None,
    improve: bool = True,
) -> Ints:
    """(F,) the patch of each facet, from 0.

    Each patch with its tabs fits ``width`` x ``height`` mm, at any angle or by quarter ``turns``
    only (:class:`~miurafab.fabrication.partition.fit_box.Space`). The first split is improved
    unless ``improve`` is False.
    Tabs stand on the patch that ``options`` name, by default the patch with the lower number.
    Raises :class:`~miurafab.errors.LayoutError` naming the facet if a facet is not a simple polygon
    or does not fit alone, and if ``options`` ask for seams along grid lines that do not exist.
    """
    options = options or LayoutOptions()
    space = Space(width, height, turns)
    check_facets(pattern)
    _check_lines(pattern, options)
    number = np.empty(len(pattern.faces_vertices), dtype=np.int64)
    pieces = hanging_together(pattern)
    for place, piece in enumerate(pieces):
        number[piece.facets] = place
    border = standing(border_tabs(pattern, material, options))
    if options.tabs_on_both_sides:
        whole = border
    else:
        # The seams between pieces bear their tabs on the same side however the pieces are split.
        tight = np.ones(len(pieces), dtype=bool)
        whole = standing(choose_tabs(pattern, number, material, options, tight)[0])
    found = np.empty_like(number)
    count = 0
    for piece in pieces:
        parts = _parts(piece.pattern, options)
        if not parts.any() and _fits_whole(piece, whole.of(piece.facets), space):
            found[piece.facets] = count
        else:
            tabs = border.of(piece.facets)
            own = _split(piece, parts, tabs, space, material, options, improve)
            found[piece.facets] = count + own
        count = int(found[piece.facets].max()) + 1
    return found


def _split(
    piece: Piece,
    part: Ints,
    border: StandingTabs,
    space: Space,
    material: Material,
    options: LayoutOptions,
    improve: bool,
) -> Ints:
    """(n,) the patch of each facet of a ``piece`` that is not whole, from 0.

    No patch reaches from one ``part`` (n,) to another. The ``border`` bears tabs.
    """
    pattern = piece.pattern
    directions = space.directions
    corners = pattern.faces_vertices
    body = support(pattern.vertices_coords[corners], corners >= 0, directions)
    body = _with_tabs(body, border.face, support(border.points, border.present, directions))
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    cells = full_grid(pattern)
    turned = options.tab_side == "upper"
    if turned:
        # Seen from the opposite corner of the grid, the upper patch is the lower patch.
        part = part.max() - part
        cells = None if cells is None else cells[::-1, ::-1]
    both = cells is None or options.tabs_on_both_sides
    if cells is None or both:
        # It is not known yet which patch bears a tab, so every possible tab is counted.
        edges = np.concatenate([inner, inner])
        sides = np.repeat([0, 1], len(inner))
    else:
        place = _places(cells)[pattern.edges_faces[inner]]
        edges, sides = inner, (place[:, 0] < place[:, 1]).astype(np.int64)
    seams = inner_seams(pattern, edges, sides)
    tabs = tab_regions(pattern, seams, material, full_facet=options.full_facet)
    tab_values = support(tabs.points, tabs.present, directions)
    reach = _with_tabs(body, tabs.own_face, tab_values)
    _check_alone(piece, ~space.holds(reach), tabs, space, options)

    depth = _tab_room(pattern, tabs)
    small = space.smaller(depth) if both else space
    found = np.empty(len(corners), dtype=np.int64)
    count = 0
    if cells is None or (both and not small.holds(reach).all()):
        for number in range(int(part.max()) + 1):
            facets = np.flatnonzero(part == number)
            found[facets] = grow_patches(pattern, reach, space, facets)[facets] + count
            count = int(found[facets].max()) + 1
    else:
        if both:
            place = _places(cells)[pattern.edges_faces[edges, sides]]
            own = _places(cells)[tabs.own_face]
            upward = place > own
            tabs, tab_values = tabs.take(upward), tab_values[upward]
        shape = _grid_shape(pattern, cells, body, tabs, tab_values)
        for r0, r1, c0, c1 in _blocks(part[cells]):
            block = cells[r0:r1, c0:c1]
            here = shape.part(r0, r1, c0, c1)
            if len(corners) > _MANY and space.turns is None:
                here = here.with_every(2)
            for a0, a1, b0, b1 in split_grid(here, small):
                found[block[a0:a1, b0:b1]] = count
                count += 1
    if improve and space.turns is None:
        found = improved(
            pattern,
            found,
            part,
            (space.width, space.height),
            border,
            depth,
            material,
            options,
            straight=cells is not None,
        )
    found = _without_overlaps(pattern, found, reach, space)
    return found.max() - found if turned else found


def _check_lines(pattern: CreasePattern, options: LayoutOptions) -> None:
    """Raise a LayoutError for seams along lines of the lattice that do not exist."""
    cells = lattice_cells(pattern)
    for axis, (name, lines) in enumerate(_lines(options)):
        if lines and cells is None:
            raise LayoutError(
                f"A seam along {name} {lines[0]} was asked for, but the facets of this pattern "
                "do not form a grid; leave the seams to the program."
            )
        if lines and cells is not None and lines[-1] > cells[:, axis].max():
            count = int(cells[:, axis].max()) + 1
            raise LayoutError(
                f"A seam along {name} {lines[-1]} was asked for, but a seam must lie between the "
                f"{count} {name}s of facets, at 1 to {count - 1}."
            )


def _lines(options: LayoutOptions) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """The lines of the lattice on which seams are asked for, by column and by row."""
    return ("column", options.seam_columns), ("row", options.seam_rows)


def _parts(piece: CreasePattern, options: LayoutOptions) -> Ints:
    """(n,) the part of each facet, from 0, between the seams that ``options`` ask for."""
    cells = piece.cells
    if cells is None:
        return np.zeros(len(piece.faces_vertices), dtype=np.int64)
    column, row = (
        np.searchsorted(np.array(lines, dtype=np.int64), cells[:, axis], side="right")
        for axis, (_, lines) in enumerate(_lines(options))
    )
    number = row * (len(options.seam_columns) + 1) + column
    return np.asarray(np.unique(number, return_inverse=True)[1], dtype=np.int64)


def _blocks(part: Ints) -> list[Block]:
    """The blocks of a grid in which ``part`` (R, C) is the same, by part."""
    rows = [0, *(np.flatnonzero(np.diff(part[:, 0])) + 1).tolist(), part.shape[0]]
    columns = [0, *(np.flatnonzero(np.diff(part[0])) + 1).tolist(), part.shape[1]]
    blocks = [(*r, *c) for r in itertools.pairwise(rows) for c in itertools.pairwise(columns)]
    return sorted(blocks, key=lambda block: int(part[block[0], block[2]]))


def _with_tabs(
    body: NDArray[np.float32], own_face: Ints, tab_values: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(F, D) the support values of facets with their tabs, which stand on ``own_face`` (N,)."""
    reach = body.copy()
    order = np.argsort(own_face, kind="stable")
    own = own_face[order]
    place = np.arange(len(own)) - np.searchsorted(own, own)
    for turn in range(int(place.max(initial=-1)) + 1):
        # One tab of each facet at a time.
        tab = order[place == turn]
        face = own_face[tab]
        reach[face] = np.maximum(reach[face], tab_values[tab])
    return reach


def _tab_room(pattern: CreasePattern, tabs: TabRegions) -> float:
    """The largest distance in mm that a tab reaches from the facet that bears it."""
    base = pattern.vertices_coords[pattern.edges_vertices[tabs.edge]]
    way = base[:, 1] - base[:, 0]
    way /= np.linalg.norm(way, axis=1)[:, None]
    off = tabs.points - base[:, :1]
    depth = np.abs(off[..., 0] * -way[:, None, 1] + off[..., 1] * way[:, None, 0])
    return float(depth.max(initial=0.0, where=tabs.present))


def check_facets(pattern: CreasePattern) -> None:
    """Raise :class:`~miurafab.errors.LayoutError` unless every facet is a simple polygon,
    counter-clockwise in the flat pattern, and every edge belongs to one.
    """
    if not len(pattern.faces_vertices):
        raise LayoutError("The pattern has no facets; there is nothing to lay out.")
    loose = np.flatnonzero((pattern.edges_faces < 0).all(axis=1))
    if len(loose):
        raise LayoutError(f"Edge {loose[0]} of the pattern belongs to no facet; remove it.")
    bad = no_polygons(pattern.vertices_coords, pattern.faces_vertices)
    if len(bad):
        raise LayoutError(
            f"Facet {bad[0]} is not a simple counter-clockwise polygon in the flat pattern; run a "
            "check on the pattern before laying it out."
        )


def _fits_whole(piece: Piece, tabs: StandingTabs, space: Space) -> bool:
    """Whether a piece with ``tabs`` on its border fits and can be one patch."""
    pattern = piece.pattern
    points = np.concatenate([pattern.vertices_coords, tabs.points[tabs.present]])
    if space.turn(points) is None:
        return False
    around = boundaries(pattern, np.zeros(len(piece.facets), dtype=np.int64))
    return not overlapping(pattern, around)


def _places(cells: Ints) -> Ints:
    """(F,) the position of each facet in the flattened ``cells``."""
    place = np.empty(cells.size, dtype=np.int64)
    place[cells.ravel()] = np.arange(cells.size)
    return place


def _grid_shape(
    pattern: CreasePattern,
    cells: Ints,
    body: NDArray[np.float32],
    tabs: TabRegions,
    tab_values: NDArray[np.float32],
) -> GridShape:
    """The grid with its support values; ``tabs`` stand on the lower of two facets."""
    rows, columns = cells.shape
    place = _places(cells)
    own = place[tabs.own_face]
    upward = place[tabs.mate_face] != own + 1 if columns > 1 else np.ones(len(own), dtype=bool)
    ends = pattern.vertices_coords[pattern.edges_vertices[tabs.edge]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)

    def standing(which: Bools) -> tuple[NDArray[np.float32], Floats]:
        values = np.full((cells.size, body.shape[1]), -np.inf, dtype=np.float32)
        values[own[which]] = tab_values[which]
        sides = np.zeros(cells.size)
        sides[own[which]] = length[which]
        return by_column(values), sides.reshape(rows, columns).T.copy()

    def by_column(values: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.ascontiguousarray(values.reshape(rows, columns, -1).swapaxes(0, 1))

    right, right_mm = standing(~upward)
    top, top_mm = standing(upward)
    return GridShape(by_column(body[cells.ravel()]), right, top, right_mm, top_mm)


def _check_alone(
    piece: Piece, doubtful: Bools, tabs: TabRegions, space: Space, options: LayoutOptions
) -> None:
    """Raise a LayoutError for the first ``doubtful`` (n,) facet that fits at no angle."""
    pattern = piece.pattern
    for face in np.flatnonzero(doubtful).tolist():
        corners = pattern.faces_vertices[face]
        facet = pattern.vertices_coords[corners[corners >= 0]]
        standing = np.flatnonzero(tabs.own_face == face)
        points = np.concatenate([facet, *(tabs.polygon(i) for i in standing)])
        if space.turn(points) is not None:
            continue
        with_tabs = "" if space.turn(facet) is None else " with its tabs"
        shape = points if with_tabs else facet
        if space.turns is None:
            short, long = np.sort(smallest_box(shape)[1]).tolist()
        else:
            long, short = np.ptp(shape, axis=0).tolist()
        along, choice = "", ""
        room = f"the usable bed of {space.width:.1f} mm x {space.height:.1f} mm"
        remedy = "take a larger bed"
        if options.max_patch_mm is not None:
            room = "a patch of {:g} mm x {:g} mm".format(*options.max_patch_mm)
            remedy = "allow larger patches"
        if space.turns is not None:
            along, choice = " along the pattern's axes", ", write grain = 'none'"
        raise LayoutError(
            f"Facet {piece.facets[face]} measures {long:.1f} mm x {short:.1f} mm{along}{with_tabs} "
            f"and does not fit {room}; make the pattern smaller, use more facets{choice}, or "
            f"{remedy}."
        )


def _without_overlaps(
    pattern: CreasePattern, face_patch: Ints, reach: NDArray[np.float32], space: Space
) -> Ints:
    """The split with every patch that overlaps itself halved until none does, ids from 0."""
    while True:
        bad = overlapping(pattern, boundaries(pattern, face_patch))
        if not bad:
            return face_patch
        # Ids are spread to make room for the parts, so that the order of patches stays.
        face_patch = face_patch * len(face_patch)
        for patch in bad:
            faces = np.flatnonzero(face_patch == patch * len(face_patch))
            half = (len(faces) + 1) // 2
            parts = grow_patches(pattern, reach, space, faces, half)
            face_patch[faces] += parts[faces]
        face_patch = np.unique(face_patch, return_inverse=True)[1].astype(np.int64)
