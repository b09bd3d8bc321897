"""Sheets: a pattern laid out for a machine and a material, ready to be drawn and posted.

:func:`lay_out` is the one way from a :class:`~miurafab.origami.crease_pattern.CreasePattern` to a
:class:`Layout`: split into pieces, turned to their smallest box, nested, lettered, and ordered.
Each piece is moved twice: from the pattern to its own frame, in which its box begins at the
origin, and from there to its sheet. A point p of the pattern lies on the sheet at

    R(placement) (R(patch) (p - origin)) + (x, y).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from miurafab.errors import LayoutError
from miurafab.fabrication.boxes import best_turn
from miurafab.fabrication.labels import place_texts
from miurafab.fabrication.nesting import Problem, SheetKind, Slot, Stock, nest, turned
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.ordering import Strokes, corner_of, order_strokes
from miurafab.fabrication.pieces import Piece, Pieces, make_pieces
from miurafab.fabrication.seams import all_seams
from miurafab.fabrication.strokes import Blank, Motion, sheet_strokes
from miurafab.fabrication.tabs import FOLDS, Tab
from miurafab.fabrication.toolpath import Toolpath
from miurafab.fabrication.travel import travel_bound
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, Material

_DIGITS = 6
"""Decimals of mm that a layout keeps, so that what is written is what was computed."""


@dataclass(frozen=True, eq=False)
class Patch:
    """One piece, in its own frame. ``faces`` (n,) int64 index the pattern's facets.

    ``outline_mm`` (m, 2) is the cut line with tabs, kerf included, counter-clockwise, and
    ``waste_mm`` further closed cut lines inside it, around enclosed waste; there rarely are any.
    A point p of the pattern is R(``rotation_deg``) (p - ``origin_mm``) in this frame.
    """

    id: int
    label: str
    faces: NDArray[np.int64]
    outline_mm: NDArray[np.float64]
    waste_mm: tuple[NDArray[np.float64], ...]
    origin_mm: tuple[float, float]
    rotation_deg: float
    tabs: tuple[Tab, ...]

    def from_pattern(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """``points`` (n, 2) of the pattern in the patch frame."""
        return turned(points - self.origin_mm, self.rotation_deg)


@dataclass(frozen=True)
class Placement:
    """Where a patch lies on its sheet: turned about the origin of its frame, then moved."""

    patch: int
    x_mm: float
    y_mm: float
    rotation_deg: float

    def from_patch(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """``points`` (n, 2) of the patch frame on the sheet."""
        shift = np.array([self.x_mm, self.y_mm])
        moved: NDArray[np.float64] = turned(points, self.rotation_deg) + shift
        return moved


@dataclass(frozen=True)
class Sheet:
    """A sheet as large as the machine's bed, or an off-cut, and what lies on it.

    ``back`` is the name of what is made on its back before its front, or None. ``travel_mm`` is
    what is moved with the beam off, and ``travel_bound_mm`` what no order could do with less than.
    """

    name: str
    width_mm: float
    height_mm: float
    placements: tuple[Placement, ...]
    back: str | None = None
    travel_mm: float = 0.0
    travel_bound_mm: float = 0.0

    @property
    def passes(self) -> tuple[str, ...]:
        """The names of what is made of this sheet, in turn."""
        return (self.name,) if self.back is None else (self.back, self.name)


@dataclass(frozen=True)
class Totals:
    """Sums over a layout. ``seam_mm`` is the length of all seams, ``density`` the area of the
    patches over that of the usable beds; ``seconds`` is None until somebody estimates it.
    """

    patches: int
    sheets: int
    seam_mm: float
    tabs: int
    density: float
    cut_mm: float
    perforated_mm: float
    travel_mm: float
    seconds: float | None = None


@dataclass(frozen=True, eq=False)
class Layout:
    """A pattern on sheets. ``toolpaths`` holds one for each sheet and ``backs`` one for each back
    that is worked on; both are empty if the layout was read from a file.

    ``untabbed`` are the pattern edges of seams on which no tab could stand, ``unlettered`` is how
    many names and numbers found no room, and ``remarks`` are sentences on what else could not be
    had; all are for the assembly.
    """

    machine: str
    material: str
    patches: tuple[Patch, ...]
    sheets: tuple[Sheet, ...]
    totals: Totals
    untabbed: tuple[int, ...] = ()
    unlettered: int = 0
    remarks: tuple[str, ...] = ()
    toolpaths: tuple[Toolpath, ...] = ()
    backs: tuple[Toolpath, ...] = ()

    @property
    def passes(self) -> tuple[Toolpath, ...]:
        """All toolpaths in turn, the back of a sheet before its front."""
        behind = {back.sheet: back for back in self.backs}
        return tuple(
            each
            for sheet, front in zip(self.sheets, self.toolpaths, strict=True)
            for each in ([] if sheet.back is None else [behind[sheet.back]]) + [front]
        )


def lay_out(
    pattern: CreasePattern,
    machine: MachineProfile,
    material: Material,
    *,
    options: LayoutOptions | None = None,
) -> Layout:
    """The pattern laid out on sheets of the machine's bed as ``options`` want it.

    Deterministic. Raises :class:`~miurafab.errors.LayoutError` if a facet does not fit the bed, or
    is not a simple polygon, or the material's dashes cannot be drawn, or an option asks for what
    the pattern or the material does not have.
    """
    options = options or LayoutOptions()
    material = _with_own_tabs(material, options)
    bed = machine.bed
    width, height = bed.width_mm - 2 * bed.margin_mm, bed.height_mm - 2 * bed.margin_mm
    pieces = make_pieces(pattern, width, height, material, options)
    numbers = _numbers(pieces)
    patches = tuple(
        _patch(pattern, number, piece, pieces, numbers, (width, height))
        for number, piece in enumerate(pieces.pieces)
    )
    offcuts = [_on_bed(size, machine) for size in options.offcuts_mm]
    quarters = (0, 90, 180, 270)
    kinds = [
        *(SheetKind(x - 2 * bed.margin_mm, y - 2 * bed.margin_mm, quarters, 1) for x, y in offcuts),
        SheetKind(width, height, quarters),
    ]
    nesting = nest(
        Problem(
            tuple(patch.outline_mm for patch in patches),
            tuple(patch.label for patch in patches),
            Stock(tuple(kinds), options.gap_mm),
            30.0,
        )
    )
    slots = nesting.slots
    placements = [
        Placement(
            patch=patch.id,
            x_mm=round(slot.x_mm + bed.margin_mm, _DIGITS),
            y_mm=round(slot.y_mm + bed.margin_mm, _DIGITS),
            rotation_deg=float(slot.rotation_deg),
        )
        for patch, slot in zip(patches, slots, strict=True)
    ]
    sheets = _sheets(placements, slots, [*offcuts, (bed.width_mm, bed.height_mm)])
    usable = sum(
        (each.width_mm - 2 * bed.margin_mm) * (each.height_mm - 2 * bed.margin_mm)
        for each in sheets
    )
    motion = _motion(patches, placements, slots)
    turns = np.arctan2(motion.matrix[:, 1, 0], motion.matrix[:, 0, 0])
    names = [patch.label for patch in patches]
    lettering = place_texts(pattern, pieces.face_patch, names, pieces.tabs, numbers, turns)
    drawn = sheet_strokes(
        pattern,
        pieces,
        lettering.texts,
        motion,
        material,
        [Blank(each.name, each.width_mm, each.height_mm, bed.margin_mm) for each in sheets],
        options,
    )
    ways, corner = pattern.edges_vertices, corner_of(machine, material)
    spread = options.spread_heat

    def ordered(strokes: Strokes) -> Toolpath:
        return order_strokes(strokes, ways, spread_heat=spread, corner_mm=corner)

    toolpaths = tuple(ordered(each) for each in drawn.fronts)
    backs = [None if each is None else ordered(each) for each in drawn.backs]
    sheets = tuple(_with_passes(*made) for made in zip(sheets, toolpaths, backs, strict=True))
    behind = tuple(back for back in backs if back is not None)
    return Layout(
        machine=machine.name,
        material=material.name,
        patches=patches,
        sheets=sheets,
        totals=_totals(pattern, pieces, patches, sheets, toolpaths + behind, usable),
        untabbed=tuple(pieces.untabbed.tolist()),
        unlettered=lettering.left_out,
        remarks=_remarks(pieces, numbers, lettering.unmarked, drawn.unrelieved, material),
        toolpaths=toolpaths,
        backs=behind,
    )


def _with_passes(sheet: Sheet, front: Toolpath, back: Toolpath | None) -> Sheet:
    made = [front] if back is None else [back, front]
    return replace(
        sheet,
        back=None if back is None else back.sheet,
        travel_mm=round(sum(each.travel_mm for each in made), 3),
        travel_bound_mm=round(sum(travel_bound(each) for each in made), 3),
    )


def _with_own_tabs(material: Material, options: LayoutOptions) -> Material:
    rule = material.tabs
    if options.tab_height_mm is not None:
        rule = replace(rule, height_mm=options.tab_height_mm)
    if options.tab_inset_mm is not None:
        rule = replace(rule, inset_mm=options.tab_inset_mm)
    if options.tab_angle is not None:
        rule = replace(rule, max_angle=options.tab_angle)
    return replace(material, tabs=rule)


def _remarks(
    pieces: Pieces,
    numbers: NDArray[np.int64],
    unmarked: int,
    unrelieved: int,
    material: Material,
) -> tuple[str, ...]:
    found = []
    weak = numbers[pieces.tabs.areas < material.tabs.min_area_mm2]
    if len(weak):
        shown = ", ".join(str(number) for number in np.sort(weak)[:8].tolist())
        more = f" and {len(weak) - 8} more" if len(weak) > 8 else ""
        found.append(
            f"{len(weak)} of {len(numbers)} tabs have less than {material.tabs.min_area_mm2:g} mm2 "
            f"of glue: number {shown}{more}."
        )
    if unmarked:
        found.append(f"{unmarked} tabs have no room for the letter of their fold.")
    if unrelieved:
        found.append(f"At {unrelieved} vertices a crease is too short for a relief hole.")
    return tuple(found)


def _numbers(pieces: Pieces) -> NDArray[np.int64]:
    """The number of each tab, from 1, patch by patch along the outline."""
    numbers = np.empty(len(pieces.tabs), dtype=np.int64)
    order = np.concatenate([piece.tabs for piece in pieces.pieces])
    numbers[order] = np.arange(1, len(order) + 1)
    return numbers


def _patch(
    pattern: CreasePattern,
    number: int,
    piece: Piece,
    pieces: Pieces,
    numbers: NDArray[np.int64],
    size: tuple[float, float],
) -> Patch:
    line = piece.cut_lines[0]
    angle = best_turn(line, *size)
    if angle is None:
        raise LayoutError(f"Patch {number} with its tabs does not fit the bed at any angle.")
    rotation = round(-math.degrees(angle), 9)
    low = turned(line, rotation).min(axis=0)
    origin = np.round(turned(low, -rotation), _DIGITS)

    def framed(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.round(turned(points - origin, rotation), _DIGITS)

    tabs = pieces.tabs
    return Patch(
        id=number,
        label=f"P{number + 1}",
        faces=piece.faces,
        outline_mm=framed(line),
        waste_mm=tuple(framed(ring) for ring in piece.cut_lines[1:]),
        origin_mm=(float(origin[0]), float(origin[1])),
        rotation_deg=rotation,
        tabs=tuple(
            Tab(
                number=int(numbers[tab]),
                edge=int(tabs.edge[tab]),
                mate_edge=int(tabs.seams.edges[tab, 1]),
                mate_patch=int(pieces.face_patch[tabs.mate_face[tab]]),
                polygon_mm=framed(tabs.polygon(tab)),
                fold=FOLDS.get(str(tabs.seams.fold[tab]), "flat"),
            )
            for tab in piece.tabs.tolist()
        ),
    )


def _sheets(
    placements: list[Placement], slots: Sequence[Slot], sizes: list[tuple[float, float]]
) -> tuple[Sheet, ...]:
    """The sheets; ``sizes`` are those of the off-cuts, and last that of a whole sheet."""
    count = max(slot.sheet for slot in slots) + 1
    on_sheet: list[list[Placement]] = [[] for _ in range(count)]
    size = [sizes[-1]] * count
    for placement, slot in zip(placements, slots, strict=True):
        on_sheet[slot.sheet].append(placement)
        size[slot.sheet] = sizes[slot.kind]
    return tuple(
        Sheet(f"sheet-{number:02d}", *size[number - 1], tuple(placed))
        for number, placed in enumerate(on_sheet, start=1)
    )


def _on_bed(size: tuple[float, float], machine: MachineProfile) -> tuple[float, float]:
    """The width and height of what the bed takes of an off-cut, laid along its longer side."""
    bed = machine.bed
    long, short = size
    width, height = (long, short) if bed.width_mm >= bed.height_mm else (short, long)
    width, height = min(width, bed.width_mm), min(height, bed.height_mm)
    if min(width, height) <= 2 * bed.margin_mm:
        raise LayoutError(
            f"An off-cut of {long:g} mm x {short:g} mm leaves nothing within margins of "
            f"{bed.margin_mm:g} mm; leave it out."
        )
    return width, height


def _motion(
    patches: tuple[Patch, ...], placements: list[Placement], slots: Sequence[Slot]
) -> Motion:
    """The way of each patch from the pattern to its sheet, in one step."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    moved = np.array(
        [
            placement.from_patch(patch.from_pattern(corners + np.array(patch.origin_mm)))
            for patch, placement in zip(patches, placements, strict=True)
        ]
    )
    matrix = np.stack([moved[:, 1] - moved[:, 0], moved[:, 2] - moved[:, 0]], axis=2)
    origins = np.array([patch.origin_mm for patch in patches])
    shift = moved[:, 0] - np.einsum("nij,nj->ni", matrix, origins)
    return Motion(matrix, shift, np.array([slot.sheet for slot in slots]))


def _totals(
    pattern: CreasePattern,
    pieces: Pieces,
    patches: tuple[Patch, ...],
    sheets: tuple[Sheet, ...],
    toolpaths: tuple[Toolpath, ...],
    usable: float,
) -> Totals:
    seams = all_seams(pattern, pieces.face_patch).edges[:, 0]
    ends = pattern.vertices_coords[pattern.edges_vertices[seams]]
    area = sum(shapely.Polygon(patch.outline_mm).area for patch in patches)
    return Totals(
        patches=len(patches),
        sheets=len(sheets),
        seam_mm=float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()),
        tabs=len(pieces.tabs),
        density=float(area / usable),
        cut_mm=sum(toolpath.length_of("cut") for toolpath in toolpaths),
        perforated_mm=sum(toolpath.length_of("perforate") for toolpath in toolpaths),
        travel_mm=sum(toolpath.travel_mm for toolpath in toolpaths),
    )
