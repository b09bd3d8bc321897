"""Split of a pattern into patches: disks of facets that fit the bed with their tabs.

A pattern that fits is one patch. Otherwise a grid of facets is cut into bands and runs
(:mod:`~miurafab.fabrication.partition.grid_dp`), and any other mesh is split by region growing
(:mod:`~miurafab.fabrication.partition.region_growing`). The split is then improved without regard
to grid lines (:mod:`~miurafab.fabrication.partition.improve`), unless patches must keep the
directions of the pattern. A flat pattern may overlap itself, but a patch may not: a patch that does
is halved until no patch overlaps itself.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from miurafab.errors import LayoutError
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.fit_box import Space, box_of, support
from miurafab.fabrication.partition.grid_dp import Block, GridShape, split_grid
from miurafab.fabrication.partition.improve import improved
from miurafab.fabrication.partition.region_growing import grow_patches, is_disk
from miurafab.fabrication.seams import inner_seams
from miurafab.fabrication.tabs import TabRegions, choose_tabs, ring_tabs, tab_regions
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.polygons import signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

_MANY = 30_000
"""In grids with more facets only every other angle is tried."""


@dataclass(frozen=True, eq=False)
class Boundary:
    """The closed boundary of a patch, counter-clockwise: ``vertices`` and ``edges`` (n,) int64 of
    the pattern; edge i follows vertex i.
    """

    vertices: Ints
    edges: Ints


def split(
    pattern: CreasePattern,
    width: float,
    height: float,
    material: Material,
    options: LayoutOptions | None = None,
    *,
    turns: tuple[int, ...] | None = None,
) -> Ints:
    """(F,) the patch of each facet, from 0.

    Each patch with its tabs fits ``width`` x ``height`` mm, at any angle or by quarter ``turns``
    only (:class:`~miurafab.fabrication.partition.fit_box.Space`).
    Tabs stand on the patch that ``options`` name, by default the patch with the lower number.
    Raises :class:`~miurafab.errors.LayoutError` naming the facet if a facet is not a simple polygon
    or does not fit alone, and if ``options`` ask for seams along grid lines that do not exist.
    """
    options = options or LayoutOptions()
    space = Space(width, height, turns)
    check_facets(pattern)
    cells = _cells(pattern)
    blocks = _blocks(cells, options)
    faces = len(pattern.faces_vertices)
    if len(blocks) == 1 and _fits_whole(pattern, space, material, options):
        return np.zeros(faces, dtype=np.int64)
    directions = space.directions
    corners = pattern.faces_vertices
    body = support(pattern.vertices_coords[corners], corners >= 0, directions)
    ring = ring_tabs(pattern, material, options)
    body = _with_tabs(body, ring, support(ring.points, ring.present, directions))
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    turned = options.tab_side == "upper"
    if turned and cells is not None:
        # Seen from the opposite corner of the grid, the upper patch is the lower patch.
        cells = cells[::-1, ::-1]
        rows, columns = cells.shape
        blocks = [(rows - r1, rows - r0, columns - c1, columns - c0) for r0, r1, c0, c1 in blocks]
    both = cells is None or options.tab_side == "alternate"
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
    reach = _with_tabs(body, tabs, tab_values)
    _check_alone(pattern, ~space.holds(reach), tabs, space, options)

    depth = _tab_room(pattern, tabs)
    small = space.smaller(depth) if both else space
    part = np.zeros(faces, dtype=np.int64)
    if cells is not None:
        blocks.sort()
        for number, (r0, r1, c0, c1) in enumerate(blocks):
            part[cells[r0:r1, c0:c1]] = number
    found = np.empty(faces, dtype=np.int64)
    count = 0
    if cells is None or (both and not small.holds(reach).all()):
        for number in range(len(blocks)):
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
        for r0, r1, c0, c1 in blocks:
            block = cells[r0:r1, c0:c1]
            here = shape.part(r0, r1, c0, c1)
            if faces > _MANY and turns is None:
                here = here.with_every(2)
            for a0, a1, b0, b1 in split_grid(here, small):
                found[block[a0:a1, b0:b1]] = count
                count += 1
    if turns is None:
        found = improved(
            pattern,
            found,
            part,
            (width, height),
            ring,
            depth,
            material,
            options,
            straight=cells is not None,
        )
    found = _without_overlaps(pattern, found, reach, space)
    return found.max() - found if turned else found


def _blocks(cells: Ints | None, options: LayoutOptions) -> list[Block]:
    """The blocks of the grid between the seams that ``options`` ask for."""
    wanted = {"row": options.seam_rows, "column": options.seam_columns}
    if cells is None:
        for name, lines in wanted.items():
            if lines:
                raise LayoutError(
                    f"A seam along {name} {lines[0]} was asked for, but the facets of this pattern "
                    "do not form a grid; leave the seams to the program."
                )
        return [(0, 0, 0, 0)]
    for (name, lines), count in zip(wanted.items(), cells.shape, strict=True):
        if lines and lines[-1] >= count:
            raise LayoutError(
                f"A seam along {name} {lines[-1]} was asked for, but a seam must lie between the "
                f"{count} {name}s of facets, at 1 to {count - 1}."
            )
    ends = [
        list(itertools.pairwise([0, *lines, count]))
        for lines, count in zip(wanted.values(), cells.shape, strict=True)
    ]
    return [(r0, r1, c0, c1) for r0, r1 in ends[0] for c0, c1 in ends[1]]


def _with_tabs(
    body: NDArray[np.float32], tabs: TabRegions, tab_values: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(F, D) the support values of facets with their tabs."""
    reach = body.copy()
    order = np.argsort(tabs.own_face, kind="stable")
    own = tabs.own_face[order]
    place = np.arange(len(own)) - np.searchsorted(own, own)
    for turn in range(int(place.max(initial=-1)) + 1):
        # One tab of each facet at a time.
        tab = order[place == turn]
        face = tabs.own_face[tab]
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


def boundaries(pattern: CreasePattern, face_patch: Ints) -> list[Boundary]:
    """The boundary of each patch of ``face_patch`` (F,), by patch id, from its lowest edge on."""
    face, corner = np.nonzero(pattern.faces_vertices >= 0)
    edge = pattern.faces_edges[face, corner]
    tail = pattern.faces_vertices[face, corner]
    sides = pattern.edges_faces[edge]
    other = np.where(sides[:, 0] == face, sides[:, 1], sides[:, 0])
    patch = face_patch[face]
    border = np.flatnonzero((other < 0) | (face_patch[other] != patch))
    border = border[np.lexsort((edge[border], patch[border]))]
    patch, edge, tail = patch[border], edge[border], tail[border]
    head = pattern.edges_vertices[edge].sum(axis=1) - tail
    vertices = len(pattern.vertices_coords)
    keys = patch * vertices + tail
    order = np.argsort(keys)
    following = order[np.searchsorted(keys, patch * vertices + head, sorter=order)].tolist()
    found = []
    starts = np.searchsorted(patch, np.arange(int(face_patch.max(initial=-1)) + 1))
    for start in starts.tolist():
        steps = [start]
        while following[steps[-1]] != start:
            steps.append(following[steps[-1]])
        found.append(Boundary(tail[steps], edge[steps]))
    return found


def check_facets(pattern: CreasePattern) -> None:
    """Raise :class:`~miurafab.errors.LayoutError` unless every facet is a simple polygon,
    counter-clockwise in the flat pattern, and every edge belongs to one.
    """
    if not len(pattern.faces_vertices):
        raise LayoutError("The pattern has no facets; there is nothing to lay out.")
    loose = np.flatnonzero((pattern.edges_faces < 0).all(axis=1))
    if len(loose):
        raise LayoutError(f"Edge {loose[0]} of the pattern belongs to no facet; remove it.")
    real = pattern.faces_vertices >= 0
    count = real.sum(axis=1)
    for corners in np.unique(count):
        faces = np.flatnonzero(count == corners)
        points = pattern.vertices_coords[pattern.faces_vertices[faces, :corners]]
        bad = signed_areas(points) <= 0
        if corners >= 3:
            bad |= ~shapely.is_valid(shapely.polygons(points))
        if bad.any():
            raise LayoutError(
                f"Facet {faces[bad][0]} is not a simple counter-clockwise polygon in the flat "
                "pattern; run a check on the pattern before laying it out."
            )


def _fits_whole(
    pattern: CreasePattern, space: Space, material: Material, options: LayoutOptions
) -> bool:
    faces = np.arange(len(pattern.faces_vertices))
    used = np.unique(pattern.faces_vertices[pattern.faces_vertices >= 0])
    tabs, _, _ = choose_tabs(pattern, np.zeros_like(faces), material, options)
    points = np.concatenate([pattern.vertices_coords[used], tabs.points[tabs.present]])
    if space.turn(points) is None:
        return False
    return is_disk(pattern, faces) and not len(_overlapping(pattern, np.zeros_like(faces)))


def _cells(pattern: CreasePattern) -> Ints | None:
    """(R, C) the facet in each cell of the grid, or None if the facets are not those of a grid."""
    if pattern.grid is None:
        return None
    columns, rows = pattern.grid
    faces = pattern.faces_vertices
    if len(faces) != (columns - 1) * (rows - 1) or faces.shape[1] != 4:
        return None
    low = faces.min(axis=1)
    cell = np.column_stack([low, low + 1, low + columns, low + columns + 1])
    row, column = np.divmod(low, columns)
    regular = (np.sort(faces, axis=1) == cell).all(axis=1) & (column < columns - 1)
    if not regular.all() or (row >= rows - 1).any() or len(np.unique(low)) != len(faces):
        return None
    cells = np.empty((rows - 1, columns - 1), dtype=np.int64)
    cells[row, column] = np.arange(len(faces))
    return cells


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
    pattern: CreasePattern, doubtful: Bools, tabs: TabRegions, space: Space, options: LayoutOptions
) -> None:
    """Raise a LayoutError for the first ``doubtful`` (F,) facet that fits at no angle."""
    for face in np.flatnonzero(doubtful).tolist():
        corners = pattern.faces_vertices[face]
        facet = pattern.vertices_coords[corners[corners >= 0]]
        standing = np.flatnonzero(tabs.own_face == face)
        points = np.concatenate([facet, *(tabs.polygon(i) for i in standing)])
        if space.turn(points) is not None:
            continue
        with_tabs = "" if space.turn(facet) is None else " with its tabs"
        shape = points if with_tabs else facet
        long, short = box_of(shape) if space.turns is None else np.ptp(shape, axis=0).tolist()
        along, choice = "", ""
        room = f"the usable bed of {space.width:.1f} mm x {space.height:.1f} mm"
        remedy = "take a larger bed"
        if options.max_patch_mm is not None:
            room = "a patch of {:g} mm x {:g} mm".format(*options.max_patch_mm)
            remedy = "allow larger patches"
        if space.turns is not None:
            along, choice = " along the pattern's axes", ", write grain = 'none'"
        raise LayoutError(
            f"Facet {face} measures {long:.1f} mm x {short:.1f} mm{along}{with_tabs} and does not "
            f"fit {room}; make the pattern smaller, use more facets{choice}, or {remedy}."
        )


def _overlapping(pattern: CreasePattern, face_patch: Ints) -> list[int]:
    """The patches whose boundary crosses or touches itself in the plane.

    Facets are counter-clockwise, so a patch is an immersed disk. It overlaps itself only if its
    boundary is not a simple closed curve.
    """
    rings = [pattern.vertices_coords[b.vertices] for b in boundaries(pattern, face_patch)]
    valid = shapely.is_valid(np.array([shapely.Polygon(ring) for ring in rings]))
    return np.flatnonzero(~valid).tolist()


def _without_overlaps(
    pattern: CreasePattern, face_patch: Ints, reach: NDArray[np.float32], space: Space
) -> Ints:
    """The split with every patch that overlaps itself halved until none does, ids from 0."""
    while True:
        bad = _overlapping(pattern, face_patch)
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
