"""The strokes of the sheets: creases, relief holes, slots, texts and cut lines.

Strokes are made in the plane of the pattern, where a crease is one edge, and then moved with their
patch. A crease within a patch is made as the material says for its kind: mountain (M, and U, not
assigned yet) or valley (V). A seam is folded on the patch that bears its tab, along the base of the
tab, and cut on the other patch; a seam without a tab is cut on both patches. So every crease is
made at most once, and nothing is drawn twice.

Flat edges and joins (F, J) are not drawn. A cut within a patch (C, or a border between two facets)
is cut in full.

Scored paper folds away from its score, so valleys may be scored from the back. The back of a sheet
is the sheet turned over about its vertical axis: x becomes width - x. The back is worked first,
with three registration holes in the margin that locate the sheet after it is turned. Texts may
be engraved there, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from miurafab.fabrication.backs import check_two_sided, turned_over, with_pins
from miurafab.fabrication.kerf import bridged
from miurafab.fabrication.labels import PlacedText
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_outline import OutlinedPatches
from miurafab.fabrication.perforation import MIN_STROKE_MM, perforate, unbroken
from miurafab.fabrication.relief import Holes, circles, relief_holes
from miurafab.fabrication.route.order import HOLE, OUTLINE, StrokeSet
from miurafab.fabrication.slots import Slots, slot_strokes
from miurafab.fabrication.ticks import Ticks, fold_ticks
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Floats, Ints, run_starts
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import OPERATIONS, Material

FOLDED = ("M", "V", "U")
SLIT = ("B", "C")

SLOT, _INNER, _WASTE = 1, 2, 3
"""Ranks among cuts between :data:`HOLE` and :data:`OUTLINE`: slots for tabs, slits in a patch,
rings of waste.
"""

RIM = 1
"""The rank of rim numbers among what is engraved: after the labels."""


@dataclass(frozen=True)
class Blank:
    """A sheet to draw on: its name, size and free margin in mm."""

    name: str
    width: float
    height: float
    margin: float


@dataclass(frozen=True, eq=False)
class Drawn:
    """The unordered strokes of each sheet and of each back (None: nothing on it).

    ``unrelieved`` is the number of vertices without room for their relief hole, ``unbridged`` the
    number of outlines without room for all their bridges, ``unticked`` of ends of folds without
    room for their ticks.
    """

    fronts: list[StrokeSet]
    backs: list[StrokeSet | None]
    unrelieved: int
    unbridged: int
    unticked: int = 0


@dataclass(frozen=True, eq=False)
class RigidTransform:
    """The motions of P patches from the pattern to their sheets: a point p goes to ``matrix``
    (P, 2, 2) p + ``shift`` (P, 2) on sheet number ``sheet`` (P,).
    """

    matrix: Floats
    shift: Floats
    sheet: Ints


def sheet_strokes(
    pattern: CreasePattern,
    outlined: OutlinedPatches,
    texts: Sequence[PlacedText],
    motion: RigidTransform,
    material: Material,
    sheets: Sequence[Blank],
    options: LayoutOptions | None = None,
) -> Drawn:
    """The strokes of each sheet, with backs and holding bridges as ``options`` say.

    ``motion`` moves the patches of all copies of the model, copy by copy; ``texts`` are the texts
    of all copies. Raises :class:`~miurafab.errors.LayoutError` if two-sided work is asked for and
    the material does not score valleys, or if the margin of a sheet with a back has no room for
    registration holes.
    """
    options = options or LayoutOptions()
    if options.two_sided or options.marks == "back":
        check_two_sided(material, sheets, options)
    creases, holes = _creases(pattern, outlined, material)
    outlines, unbridged = _outlines(outlined, options, material.kerf_mm)
    ticks = _ticks(pattern, outlined, options)
    drawn_once = [
        *([] if ticks is None else [_bars(ticks)]),
        *(_made(own, kind, material) for kind, own in creases.items()),
        _relief(pattern, holes, material),
        *([] if outlined.slots is None else [_slots(outlined, outlined.slots, material)]),
        _slits(pattern, outlined),
        outlines,
    ]
    copies = range(0, len(motion.sheet), len(outlined.patches))
    parts = [
        _engraved(texts),
        *(replace(part, patch=part.patch + first) for first in copies for part in drawn_once),
    ]
    count = np.concatenate([part.count for part in parts])
    patch = np.concatenate([part.patch for part in parts])
    points = np.concatenate([part.points for part in parts])
    which = np.repeat(patch, count)
    moved = np.einsum("nij,nj->ni", motion.matrix[which], points) + motion.shift[which]
    operation = np.repeat([part.operation for part in parts], [len(part.count) for part in parts])
    edge = np.concatenate([part.edge for part in parts])
    rank = np.concatenate([part.rank for part in parts])
    steps = np.cumsum([0, *(int(part.group.max(initial=-1)) + 1 for part in parts)])
    group = np.concatenate([part.group + step for part, step in zip(parts, steps, strict=False)])
    behind = np.zeros(len(patch), dtype=bool)
    behind[: len(parts[0].count)] = [t.side == "back" for t in texts for _ in t.strokes]
    if options.marks == "back":
        behind |= (operation == OPERATIONS.index("engrave")) & (edge >= 0)  # ticks
    if options.two_sided:
        scored = operation == OPERATIONS.index("score")
        folds = pattern.edges_assignment.copy()
        # Where two borders are joined, only the seam knows the fold.
        folds[outlined.tabs.edge] = outlined.tabs.seams.fold
        behind[scored] = folds[edge[scored]] == "V"

    side = 2 * motion.sheet[patch] + behind
    by_side = np.argsort(side, kind="stable")
    begin = np.searchsorted(side[by_side], np.arange(2 * len(sheets) + 1))
    first = run_starts(count)

    def taken(number: int, blank: Blank, name: str) -> StrokeSet:
        chosen = by_side[begin[number] : begin[number + 1]]
        own = count[chosen]
        offsets = np.concatenate([[0], np.cumsum(own)])
        toolpath = Toolpath(
            sheet=name,
            width_mm=blank.width,
            height_mm=blank.height,
            points=moved[np.repeat(first[chosen] - offsets[:-1], own) + np.arange(offsets[-1])],
            offsets=offsets,
            operation=operation[chosen],
            patch=patch[chosen],
            edge=edge[chosen],
        )
        return StrokeSet(toolpath, group[chosen], rank[chosen])

    fronts: list[StrokeSet] = []
    backs: list[StrokeSet | None] = []
    for number, blank in enumerate(sheets):
        fronts.append(taken(2 * number, blank, blank.name))
        drawn = turned_over(taken(2 * number + 1, blank, f"{blank.name}-back"))
        backs.append(with_pins(drawn, blank, material) if len(drawn.toolpath) else None)
    return Drawn(fronts, backs, holes.left_out, unbridged, 0 if ticks is None else ticks.left_out)


@dataclass(frozen=True, eq=False)
class _Part:
    """S strokes of one operation in the plane of the pattern."""

    operation: int
    points: Floats
    count: Ints
    patch: Ints
    edge: Ints
    group: Ints
    rank: Ints


def _engraved(texts: Sequence[PlacedText]) -> _Part:
    strokes = [stroke for text in texts for stroke in text.strokes]
    each = np.array([len(text.strokes) for text in texts], dtype=np.int64)
    beside = np.array([text.beside for text in texts], dtype=bool)
    patch = np.repeat(np.array([text.patch for text in texts], dtype=np.int64), each)
    return _Part(
        operation=OPERATIONS.index("engrave"),
        points=np.concatenate([np.empty((0, 2)), *strokes]),
        count=np.array([len(stroke) for stroke in strokes], dtype=np.int64),
        patch=patch,
        edge=np.full(len(strokes), -1),
        group=np.repeat(np.arange(len(texts)), each),
        rank=np.repeat(np.where(beside, RIM, 0), each),
    )


def _ticks(
    pattern: CreasePattern, outlined: OutlinedPatches, options: LayoutOptions
) -> Ticks | None:
    if options.ticks_mm is None:
        return None
    edges, patch = _inner_edges(pattern, outlined, FOLDED)
    return fold_ticks(pattern, outlined.face_patch, edges, patch, options.ticks_mm)


def _bars(ticks: Ticks) -> _Part:
    return _Part(
        operation=OPERATIONS.index("engrave"),
        points=ticks.ends.reshape(-1, 2),
        count=np.full(len(ticks.ends), 2),
        patch=ticks.patch,
        edge=ticks.edge,
        group=ticks.group,
        rank=np.zeros(len(ticks.ends), dtype=np.int64),
    )


@dataclass(frozen=True, eq=False)
class _Creases:
    """N creases of one kind: ``ends`` (N, 2, 2) in mm from the first vertex of ``edge`` (N,) to
    the second, on ``patch`` (N,).
    """

    ends: Floats
    edge: Ints
    patch: Ints


def _creases(
    pattern: CreasePattern, outlined: OutlinedPatches, material: Material
) -> tuple[dict[str, _Creases], Holes]:
    """The creases of each kind, shortened where they meet in a relief hole, and the holes. A
    material without a rule for the folds of tabs makes them like other folds.
    """
    edges, patch = _inner_edges(pattern, outlined, FOLDED)
    valley = pattern.edges_assignment[edges] == "V"
    kind = np.where(valley, "valley", "mountain")
    made = np.array([material.creases[name].mode != "none" for name in kind.tolist()], dtype=bool)
    edges, patch, kind = edges[made], patch[made], kind[made]
    ends = pattern.vertices_coords[pattern.edges_vertices[edges]]

    least = {
        name: 2 * material.perforation_of(name).bridge_mm + material.kerf_mm + MIN_STROKE_MM
        for name in material.creases
    }
    room = np.where(kind == "valley", least["valley"], least["mountain"])
    diameter = material.relief_hole_mm
    holes = relief_holes(pattern, outlined.face_patch, edges, room, diameter)
    holed = np.zeros(len(pattern.vertices_coords), dtype=bool)
    holed[holes.vertex] = True
    way = ends[:, 1] - ends[:, 0]
    way /= np.linalg.norm(way, axis=1)[:, None]
    back = holed[pattern.edges_vertices[edges]] * (diameter / 2)
    ends = ends + np.stack([way * back[:, :1], -way * back[:, 1:]], axis=1)

    tabs = outlined.tabs.take(np.isin(outlined.tabs.seams.fold, FOLDED))
    base = tabs.points[:, :2]
    along = np.diff(pattern.vertices_coords[pattern.edges_vertices[tabs.edge]], axis=1)[:, 0]
    backwards = np.einsum("ni,ni->n", base[:, 1] - base[:, 0], along) < 0
    base = np.where(backwards[:, None, None], base[:, ::-1], base)
    owner = outlined.face_patch[tabs.own_face]
    of_tab = np.full(len(tabs), "tab", dtype="U8")
    if "tab" not in material.creases:
        of_tab = np.where(tabs.seams.fold == "V", "valley", "mountain")
    kind = np.concatenate([kind, of_tab])
    ends, edges = np.concatenate([ends, base]), np.concatenate([edges, tabs.edge])
    patch = np.concatenate([patch, owner])
    found = {
        name: _Creases(ends[kind == name], edges[kind == name], patch[kind == name])
        for name in material.creases
    }
    return found, holes


def _made(creases: _Creases, kind: str, material: Material) -> _Part:
    """The strokes of all creases of one kind."""
    mode = material.creases[kind].mode
    start, end = creases.ends[:, 0], creases.ends[:, 1]
    if mode == "none":
        start, end = start[:0], end[:0]
    draw = perforate if mode == "perforate" else unbroken
    dashes = draw(start, end, material, kind)
    return _Part(
        operation=OPERATIONS.index("perforate" if mode == "none" else mode),
        points=np.stack([dashes.starts, dashes.ends], axis=1).reshape(-1, 2),
        count=np.full(len(dashes), 2),
        patch=creases.patch[dashes.crease],
        edge=creases.edge[dashes.crease],
        group=dashes.crease,
        rank=np.full(len(dashes), _INNER),
    )


def _relief(pattern: CreasePattern, holes: Holes, material: Material) -> _Part:
    diameter = max(material.relief_hole_mm - material.kerf_mm, 0.0)
    points, count = circles(pattern.vertices_coords[holes.vertex], diameter)
    return _Part(
        operation=OPERATIONS.index("cut"),
        points=points,
        count=np.full(len(holes.vertex), count),
        patch=holes.patch,
        edge=holes.edge,
        group=np.arange(len(holes.vertex)),
        rank=np.full(len(holes.vertex), HOLE),
    )


def _slots(outlined: OutlinedPatches, slots: Slots, material: Material) -> _Part:
    points, count = slot_strokes(slots, material.kerf_mm)
    tabs = outlined.tabs.take(slots.tab)
    return _Part(
        operation=OPERATIONS.index("cut"),
        points=points,
        count=np.full(len(tabs), count),
        patch=outlined.face_patch[tabs.mate_face],
        edge=tabs.seams.edges[:, 1],
        group=np.arange(len(tabs)),
        rank=np.full(len(tabs), SLOT),
    )


def _slits(pattern: CreasePattern, outlined: OutlinedPatches) -> _Part:
    edges, patch = _inner_edges(pattern, outlined, SLIT)
    return _Part(
        operation=OPERATIONS.index("cut"),
        points=pattern.vertices_coords[pattern.edges_vertices[edges]].reshape(-1, 2),
        count=np.full(len(edges), 2),
        patch=patch,
        edge=edges,
        group=np.arange(len(edges)),
        rank=np.full(len(edges), _INNER),
    )


def _outlines(outlined: OutlinedPatches, options: LayoutOptions, kerf: float) -> tuple[_Part, int]:
    """All cut lines, and the number of outlines with fewer bridges than asked for."""
    lines, patch, rank, group = [], [], [], []
    rings = unbridged = 0
    for number, outline in enumerate(outlined.patches):
        for place, ring in enumerate(outline.cut_lines):
            closed = np.concatenate([ring, ring[:1]])
            # A gap left between two cuts is longer in the path by half a kerf at each end.
            wanted = 0 if place else options.bridges
            made = bridged(closed, wanted, options.bridge_mm + kerf)
            unbridged += wanted > 0 and len(made) < wanted
            lines += made
            patch += [number] * len(made)
            rank += [_WASTE if place else OUTLINE] * len(made)
            group += [rings] * len(made)
            rings += 1
    part = _Part(
        operation=OPERATIONS.index("cut"),
        points=np.concatenate(lines),
        count=np.array([len(line) for line in lines]),
        patch=np.array(patch),
        edge=np.full(len(lines), -1),
        group=np.array(group),
        rank=np.array(rank),
    )
    return part, unbridged


def _inner_edges(
    pattern: CreasePattern, outlined: OutlinedPatches, assignments: Sequence[str]
) -> tuple[Ints, Ints]:
    """The edges with one of ``assignments`` between two facets of one patch, and that patch."""
    faces = pattern.edges_faces
    patch = np.where(faces >= 0, outlined.face_patch[faces], -1)
    inner = (patch[:, 0] == patch[:, 1]) & np.isin(pattern.edges_assignment, assignments)
    edges = np.flatnonzero(inner)
    return edges, patch[edges, 0]
