"""Sheets: a pattern laid out for a machine and a material, ready to be drawn and posted.

:func:`lay_out` turns a :class:`~miurafab.origami.crease_pattern.CreasePattern` into a
:class:`Layout`: split into patches, turned to their smallest box, nested, lettered, and ordered.
Each patch is moved twice: from the pattern to its own frame, in which its box begins at the
origin, and from there to its sheet. A point p of the pattern lies on the sheet at

    R(placement) (R(patch) (p - origin)) + (x, y).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

import numpy as np
import shapely

from miurafab.display import Shown
from miurafab.fabrication.beam_findings import beam_findings
from miurafab.fabrication.borders import OpenBorder, open_borders
from miurafab.fabrication.caps import capped
from miurafab.fabrication.feasibility import require_foldable, strength_findings
from miurafab.fabrication.kit.jig import Jig, jig_of
from miurafab.fabrication.kit.plan import FoldersKit, folders_kit
from miurafab.fabrication.kit.rim_texts import rim_texts
from miurafab.fabrication.labels import AbsentLabel
from miurafab.fabrication.layout_findings import layout_findings
from miurafab.fabrication.nesting import Nesting, Ring, turned
from miurafab.fabrication.open_ring import opened
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.patch_frame import DIGITS, Patch
from miurafab.fabrication.partition.patch_outline import OutlinedPatches
from miurafab.fabrication.placing import absent_labels, motion_of, texts_of
from miurafab.fabrication.plan import Alternative, plan_patches
from miurafab.fabrication.route.order import StrokeSet, corner_of, order_strokes
from miurafab.fabrication.seams import all_seams
from miurafab.fabrication.slots import require_slots
from miurafab.fabrication.stock import LaidStock, lay_stock
from miurafab.fabrication.strokes import Blank, sheet_strokes
from miurafab.fabrication.tooling import made_by
from miurafab.fabrication.toolpath import Toolpath
from miurafab.fabrication.wording import count
from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import MachineProfile, Material

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Placement:
    """The place of a patch on its sheet: turned about the origin of its frame, then moved."""

    patch: int
    x_mm: float
    y_mm: float
    rotation_deg: float

    def from_patch(self, points: Floats) -> Floats:
        """``points`` (n, 2) of the patch frame, on the sheet."""
        shift = np.array([self.x_mm, self.y_mm])
        return np.asarray(turned(points, self.rotation_deg) + shift)


@dataclass(frozen=True)
class Sheet:
    """A sheet and the patches on it. ``stock`` is the name of its kind, empty for a sheet of the
    bed's size; ``grain`` is the direction of its fibres on the bed (``x``, ``y`` or ``none``), and
    ``defects_mm`` are closed curves on which nothing lies.

    ``back`` is the name of the program for its back, which is made before the front, or None.
    ``travel_mm`` is the length travelled with the beam off. ``card_mm`` are width and height of the
    smallest card with its corner at the bed's, whole mm, from which the patches can be cut.
    """

    name: str
    width_mm: float
    height_mm: float
    placements: tuple[Placement, ...]
    back: str | None = None
    travel_mm: float = 0.0
    stock: str = ""
    grain: str = "none"
    defects_mm: tuple[Ring, ...] = ()
    card_mm: tuple[float, float] | None = None

    @property
    def passes(self) -> tuple[str, ...]:
        """The names of the passes over this sheet, in order."""
        return (self.name,) if self.back is None else (self.back, self.name)


@dataclass(frozen=True)
class Totals:
    """Sums over a layout. ``tabs`` are all tabs, of which ``border_tabs`` stand on open borders.
    ``seam_mm`` is the length of all seams, ``density`` the area of the
    patches over the usable area of the sheets, ``sheets_bound`` the lower bound of the number of
    sheets for these patches, ``seconds`` the estimated time, None until it is estimated.
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
    sheets_bound: int | None = None
    border_tabs: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class Layout(Shown):
    """A pattern on sheets, as ``layout.json`` holds it.

    Parameters
    ----------
    machine, material : str
        The names of the profiles.
    patches : tuple of Patch
        The pieces with their tabs, each in a frame of its own.
    sheets : tuple of Sheet
        The sheets and the places of the patches on them.
    totals : Totals
        Sums over the layout.
    nesting : NestingRecord
        What nested the patches.
    findings : tuple of Finding
        For the assembly: options that could not be honoured, and everything that has no room.
    borders : tuple of OpenBorder
        The borders that the glued shell leaves open.
    absent : tuple of AbsentLabel
        The names and labels that are not engraved, for the guide.
    kit : FoldersKit or None
        The rows to fold and the gauge of their angles; None for a layout without a pattern.
    alternatives : tuple of Alternative
        The ways to divide the pattern that were compared: the chosen one, and those with the fewest
        sheets and the least glue.
    """

    machine: str
    material: str
    patches: tuple[Patch, ...]
    sheets: tuple[Sheet, ...]
    totals: Totals
    findings: tuple[Finding, ...] = ()
    borders: tuple[OpenBorder, ...] = ()
    absent: tuple[AbsentLabel, ...] = ()
    kit: FoldersKit | None = None
    alternatives: tuple[Alternative, ...] = ()

    def _summary(self) -> str:
        totals = self.totals
        return (
            f"{count(totals.patches, 'patch', 'patches')}, {count(totals.tabs, 'tab', 'tabs')}, "
            f"{count(totals.sheets, 'sheet', 'sheets')} of {self.material} for {self.machine}"
        )

    @property
    def untabbed(self) -> tuple[int, ...]:
        """The pattern edges without room for a tab that is wanted."""
        edges = (finding.where for finding in self.findings if finding.code == "untabbed")
        return tuple(edge for where in edges if isinstance(where, tuple) for edge in where)

    @property
    def copies(self) -> int:
        """The number of models."""
        return max((patch.copy for patch in self.patches), default=1)

    @property
    def model(self) -> Self:
        """The same layout with the patches of the first model only."""
        return replace(self, patches=tuple(p for p in self.patches if p.copy == 1))


@dataclass(frozen=True, eq=False, repr=False)
class DrawnLayout(Layout):
    """A layout with its strokes, as :func:`lay_out` makes it.

    Parameters
    ----------
    pattern : CreasePattern
        The pattern whose facets and edges the layout names, opened where that was asked.
    toolpaths : tuple of Toolpath
        The strokes of each sheet, in the order of ``sheets``.
    backs : tuple of Toolpath
        The strokes of each back that is worked on.
    jig : Jig or None
        The ribs that carry the folded shell, if they were asked for.
    """

    pattern: CreasePattern = field(kw_only=True)
    toolpaths: tuple[Toolpath, ...] = field(kw_only=True)
    backs: tuple[Toolpath, ...] = ()
    jig: Jig | None = None

    def plot(self) -> list[Axes]:
        """Draw what is made of each sheet with matplotlib: cuts, creases and scores in mm.

        Returns
        -------
        list of matplotlib Axes
            One for each pass of each sheet.
        """
        from miurafab.fabrication.drawing.plot import draw_toolpath
        from miurafab.origami.plotting import shown_row

        axes = shown_row((4.6 * len(self.passes) + 1.2, 4.6), len(self.passes))
        for each, toolpath in zip(axes, self.passes, strict=True):
            draw_toolpath(toolpath, each)
        return axes

    @property
    def passes(self) -> tuple[Toolpath, ...]:
        """All toolpaths in order, the back of a sheet before its front."""
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
) -> DrawnLayout:
    """The pattern laid out on sheets of the machine's bed, as ``options`` say; deterministic.

    Raises :class:`~miurafab.errors.LayoutError` if a facet does not fit the bed, is not a simple
    polygon or is narrower than the sheet is thick, if the dashes of the material cannot be drawn,
    if the stock does not suffice, or if the pattern or the material lacks what an option asks for.
    """
    options = options or LayoutOptions()
    pattern = capped(opened(pattern, options), options)
    jig = jig_of(pattern, options.jig_mm)
    material = worked(material, machine, options)
    if options.join == "slots":
        require_slots(material)
    stock = lay_stock(options, machine.bed, material.grain)
    plan = plan_patches(pattern, stock, material, options)
    require_foldable(pattern, material)
    framed, patches, nesting = plan.framed, plan.patches, plan.nesting
    outlined = framed.outlined
    both_sides = options.two_sided or options.marks == "back"
    sheets, placements = _sheets(nesting, patches, stock, both_sides)
    motion = motion_of(patches, placements, np.array([slot.sheet for slot in nesting.slots]))
    lettering = texts_of(pattern, outlined, framed.labels, patches, motion, options)
    blanks = [Blank(each.name, each.width_mm, each.height_mm, stock.margin_mm) for each in sheets]
    defects = [sheet.defects_mm for sheet in sheets]
    rim = rim_texts(pattern, outlined.face_patch, patches, motion, blanks, defects, options)
    texts = (*lettering.texts, *rim.texts)
    drawn = sheet_strokes(pattern, outlined, texts, motion, material, blanks, options)
    ways, corner = pattern.edges_vertices, corner_of(machine, material)
    spread = options.spread_heat

    def ordered(strokes: StrokeSet) -> Toolpath:
        return order_strokes(strokes, ways, spread_heat=spread, corner_mm=corner)

    toolpaths = tuple(ordered(each) for each in drawn.fronts)
    backs = [None if each is None else ordered(each) for each in drawn.backs]
    sheets = tuple(_with_passes(*made) for made in zip(sheets, toolpaths, backs, strict=True))
    behind = tuple(back for back in backs if back is not None)
    usable = sum(stock.kinds.kinds[kind].area for kind in _kinds(nesting))
    return DrawnLayout(
        machine=machine.name,
        material=material.name,
        patches=patches,
        sheets=sheets,
        totals=_totals(pattern, outlined, patches, nesting, toolpaths + behind, usable),
        findings=(
            *pattern.told,
            *beam_findings(machine, material),
            *strength_findings(pattern, material, options),
            *layout_findings(pattern, framed, nesting, lettering, rim, drawn, material, options),
        ),
        borders=open_borders(pattern),
        absent=absent_labels(lettering, patches),
        kit=folders_kit(pattern),
        alternatives=plan.alternatives,
        toolpaths=toolpaths,
        backs=behind,
        jig=jig,
        pattern=pattern,
    )


def _with_passes(sheet: Sheet, front: Toolpath, back: Toolpath | None) -> Sheet:
    made = [front] if back is None else [back, front]
    return replace(
        sheet,
        back=None if back is None else back.sheet,
        travel_mm=round(sum(each.travel_mm for each in made), 3),
    )


def worked(material: Material, machine: MachineProfile, options: LayoutOptions) -> Material:
    """``material`` with the tabs of ``options``, as the tool of ``machine`` makes it.

    Raises :class:`~miurafab.errors.ProfileError` where it has no settings for the beam.
    """
    material.on(machine)
    rule = material.tabs
    if options.tab_height_mm is not None:
        rule = replace(rule, height_mm=options.tab_height_mm)
    if options.tab_inset_mm is not None:
        rule = replace(rule, inset_mm=options.tab_inset_mm)
    if options.tab_angle is not None:
        rule = replace(rule, max_angle=options.tab_angle)
    return made_by(replace(material, tabs=rule), machine)


def _kinds(nesting: Nesting) -> list[int]:
    """The kind of each sheet."""
    kind = {slot.sheet: slot.kind for slot in nesting.slots}
    return [kind[number] for number in range(len(kind))]


def _sheets(
    nesting: Nesting, patches: tuple[Patch, ...], stock: LaidStock, both_sides: bool
) -> tuple[tuple[Sheet, ...], list[Placement]]:
    """The sheets with their patches, and the placement of each patch. A sheet that is turned over
    is as large as the card, if it may be of any size: its registration holes lie on the card.
    """
    placements = [
        Placement(
            patch=patch.id,
            x_mm=round(slot.x_mm + stock.margin_mm, DIGITS),
            y_mm=round(slot.y_mm + stock.margin_mm, DIGITS),
            rotation_deg=float(slot.rotation_deg),
        )
        for patch, slot in zip(patches, nesting.slots, strict=True)
    ]
    kinds = _kinds(nesting)
    on_sheet: list[list[Placement]] = [[] for _ in kinds]
    far = np.zeros((len(kinds), 2))
    for patch, placement, slot in zip(patches, placements, nesting.slots, strict=True):
        on_sheet[slot.sheet].append(placement)
        outline = placement.from_patch(patch.outline_mm)
        far[slot.sheet] = np.maximum(far[slot.sheet], outline.max(axis=0))
    sheets = []
    for number, (kind, placed) in enumerate(zip(kinds, on_sheet, strict=True)):
        cut_from = stock.sheets[kind]
        whole = (cut_from.width_mm, cut_from.height_mm)
        card = np.minimum(np.ceil(far[number] + stock.margin_mm - 1e-6), whole).tolist()
        width, height = card if both_sides and not cut_from.name else whole
        sheets.append(
            Sheet(
                f"sheet-{number + 1:02d}",
                width,
                height,
                tuple(placed),
                stock=cut_from.name,
                grain=stock.fibres[kind],
                defects_mm=cut_from.defects_mm,
                card_mm=(card[0], card[1]),
            )
        )
    return tuple(sheets), placements


def _totals(
    pattern: CreasePattern,
    outlined: OutlinedPatches,
    patches: tuple[Patch, ...],
    nesting: Nesting,
    toolpaths: tuple[Toolpath, ...],
    usable: float,
) -> Totals:
    seams = all_seams(pattern, outlined.face_patch).edges[:, 0]
    ends = pattern.vertices_coords[pattern.edges_vertices[seams]]
    area = sum(shapely.Polygon(patch.outline_mm).area for patch in patches)
    copies = len(patches) // len(outlined.patches)
    return Totals(
        patches=len(patches),
        sheets=nesting.sheets,
        seam_mm=float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()) * copies,
        tabs=len(outlined.tabs) * copies,
        density=float(area / usable),
        cut_mm=sum(toolpath.length_of("cut") for toolpath in toolpaths),
        perforated_mm=sum(toolpath.length_of("perforate") for toolpath in toolpaths),
        travel_mm=sum(toolpath.travel_mm for toolpath in toolpaths),
        sheets_bound=nesting.bound,
        border_tabs=int((outlined.tabs.mate_face < 0).sum()) * copies,
    )
