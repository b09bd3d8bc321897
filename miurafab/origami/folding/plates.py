"""A sheet of plates of one thickness with shifted hinges: whole, slit, or in loose patches.

Where the whole sheet has no plates (:mod:`miurafab.origami.folding.bennett`), it is slit, and where
that does not help it is made in patches (:mod:`miurafab.origami.folding.slits`). The pieces of a
pattern are made one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from miurafab.errors import InputError, PatternError
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import facet_means
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.bennett import (
    BennettHeights,
    bennett_heights,
    thick_placement,
)
from miurafab.origami.folding.kinematics import fold_angles_at, place
from miurafab.origami.folding.made_panels import MadePanels
from miurafab.origami.folding.plate_patch import PlatePatch
from miurafab.origami.folding.slits import (
    PlateSeam,
    blocks_up_to,
    facet_cells,
    opened_by,
    seams_between,
    slit_sheets,
)
from miurafab.origami.piece import Piece, piece_of, pieces_of

WHOLE = 400
"""A sheet of more facets is made in loose patches at once."""

PATCHES = (6, 5, 4)
"""The sides of loose patches, in facets, that are tried one after another."""

Progress = Callable[[float, str], None]


@dataclass(frozen=True, eq=False, repr=False)
class ThickPlates(MadePanels):
    """A pattern made of plates of one thickness with shifted hinges.

    Attributes
    ----------
    pattern : CreasePattern
        The whole pattern.
    thickness_mm : float
        The thickness of the plates.
    patches : tuple of PlatePatch
        The mechanisms that it is made of; one where the whole sheet, slit or not, has plates.
    seams : tuple of PlateSeam
        Where the sheet is slit, or parted into loose patches.
    """

    pattern: CreasePattern
    thickness_mm: float
    patches: tuple[PlatePatch, ...]
    seams: tuple[PlateSeam, ...] = ()

    @property
    def folds(self) -> bool:
        """Whether each patch has all its plates and reaches its folded form without a collision."""
        return not len(self.too_small) and all(patch.clear_state >= 1.0 for patch in self.patches)

    @property
    def limit_mm(self) -> Floats:  # type: ignore[override]
        """(F,) the thickness at which each plate has no outline, or no room for its brackets."""
        limits = np.full(len(self.pattern.faces_vertices), np.inf)
        for patch in self.patches:
            limits[patch.facets] = patch.limit_mm
        return limits

    def _summary(self) -> str:
        count = len(self.patches)
        clear = min(patch.clear_deg for patch in self.patches)
        made = "one mechanism" if count == 1 else f"{count} patches"
        slit = " with slits" if any(seam.hinges for seam in self.seams) else ""
        return f"{self.thickness_mm:g} mm plates in {made}{slit}, clear up to {clear:.3g} degrees"


def thick_plates(
    pattern: CreasePattern,
    thickness_mm: float,
    on_progress: Progress | None = None,
) -> ThickPlates:
    """``pattern`` made of plates of ``thickness_mm`` with shifted hinges.

    Raises :class:`~miurafab.errors.InputError` for a thickness that is not positive, and
    :class:`~miurafab.errors.PatternError` for a sheet that is not exactly flat-foldable, and for
    one of which some patch has no plates.
    """
    if not 0 < thickness_mm < np.inf:
        raise InputError(f"`thickness` is {thickness_mm:g} mm; it must be greater than zero.")
    tell = on_progress or (lambda fraction, note: None)
    patches: list[PlatePatch] = []
    seams: list[PlateSeam] = []
    pieces = pieces_of(pattern)
    for number, piece in enumerate(pieces):
        tell(number / len(pieces), f"piece {number + 1} of {len(pieces)}")
        made, between = _mechanisms(piece.pattern, thickness_mm)
        seams += [_renumbered(seam, piece, len(patches)) for seam in between]
        patches += [_of_whole(patch, piece) for patch in made]
    return ThickPlates(pattern, thickness_mm, tuple(patches), tuple(seams))


def _mechanisms(
    pattern: CreasePattern, thickness: float
) -> tuple[list[PlatePatch], list[PlateSeam]]:
    """The patches that one piece is made of, and its seams."""
    cells, facets = facet_cells(pattern), len(pattern.faces_vertices)
    found = _mechanism(pattern, thickness) if facets <= WHOLE else None
    if found is not None:
        return [found[0]], list(found[1])
    if cells is None:
        raise PatternError(
            "No plates of one thickness fit on shifted hinges for the whole sheet, and it has no "
            "grid of facets by which it could be slit or made in patches; use tapered panels."
        )
    pattern = replace(pattern, grid=None, cells=cells)  # which parts keep
    for side in PATCHES:
        block = blocks_up_to(cells, side)
        patches: list[PlatePatch] = []
        seams = list(seams_between(pattern, block))
        for number in range(int(block.max()) + 1):
            part = piece_of(pattern, np.flatnonzero(block == number))
            found = _mechanism(part.pattern, thickness)
            if found is None:
                break
            patches.append(_of_whole(found[0], part))
            seams += [_renumbered(seam, part, number) for seam in found[1]]
        else:
            return patches, list(_apart(pattern, patches, seams))
    raise PatternError(
        "No plates of one thickness fit on shifted hinges, neither for the whole sheet, slit or "
        f"not, nor for patches of {PATCHES[-1]} x {PATCHES[-1]} facets; use tapered panels."
    )


def _mechanism(
    pattern: CreasePattern, thickness: float
) -> tuple[PlatePatch, tuple[PlateSeam, ...]] | None:
    """``pattern`` as one patch, whole or slit, and the seams of its slits."""
    cells, facets = facet_cells(pattern), np.arange(len(pattern.faces_vertices))
    whole = bennett_heights(pattern)
    if whole.exists:
        return _patch(whole, facets, np.arange(len(pattern.edges_vertices)), thickness), ()
    for slit, edges, seams in slit_sheets(pattern, cells) if cells is not None else ():
        heights = bennett_heights(slit)
        if heights.exists:
            patch = _patch(heights, facets, edges, thickness)
            if patch.clear_state >= 1.0:
                return patch, _measured(pattern, patch, seams)
    return None


def _patch(heights: BennettHeights, facets: Ints, edges: Ints, thickness: float) -> PlatePatch:
    scale = thickness / heights.thickness
    axis, bottom = heights.axis * scale, heights.bottom * scale
    return PlatePatch(heights.pattern, facets, edges, axis, bottom, thickness).cleared()


def _measured(
    pattern: CreasePattern, patch: PlatePatch, seams: tuple[PlateSeam, ...]
) -> tuple[PlateSeam, ...]:
    """``seams`` with how far their slits open in the motion of ``patch``."""
    middle = patch.bottom_mm + patch.thickness_mm / 2
    widths = [opened_by(pattern, patch.pattern, patch.axis_mm, middle, seam) for seam in seams]
    return tuple(
        replace(seam, opens_mm=width, patch=0) for seam, width in zip(seams, widths, strict=True)
    )


def _apart(
    pattern: CreasePattern, patches: list[PlatePatch], seams: list[PlateSeam]
) -> Iterator[PlateSeam]:
    """``seams``, those between loose patches with the width that a joint bridges in the folded
    form. There each patch lies where the middles of its plates are nearest to the thin sheet.
    """
    folded = np.ones(1)
    thin = place(pattern, fold_angles_at(pattern, folded))
    turn, shift = thin.turn[0], np.zeros((len(pattern.faces_vertices), 3))
    height = np.zeros(len(shift))
    for patch in patches:
        mine, plates = patch.facets, thick_placement(patch.pattern, patch.axis_mm, folded)
        height[mine] = patch.bottom_mm + patch.thickness_mm / 2
        # plates turn as the facets do, but for one turn of the patch as a whole
        whole = turn[mine[0]] @ plates.turn[0, 0].T
        shift[mine] = plates.shift[0] @ whole.T
        flat = facet_means(pattern.vertices_coords, pattern.faces_vertices[mine])
        flat = np.column_stack([flat, np.zeros(len(mine))])
        level = np.column_stack([flat[:, :2], height[mine]])
        wanted = np.einsum("nij,nj->ni", turn[mine], flat) + thin.shift[0, mine]
        placed = np.einsum("nij,nj->ni", turn[mine], level) + shift[mine]
        shift[mine] += (wanted - placed).mean(axis=0)
    for seam in seams:
        if seam.patch is not None:
            yield seam
            continue
        edges = list(seam.slits)
        ends = pattern.vertices_coords[pattern.edges_vertices[edges]].reshape(-1, 2)
        places = []
        for facet in np.repeat(pattern.edges_faces[edges], 2, axis=0).T:
            points = np.column_stack([ends, height[facet]])
            places.append(np.einsum("nij,nj->ni", turn[facet], points) + shift[facet])
        yield replace(
            seam, opens_mm=float(np.linalg.norm(places[0] - places[1], axis=1).max(initial=0.0))
        )


def _of_whole(patch: PlatePatch, piece: Piece) -> PlatePatch:
    """``patch`` of a piece with the facets and edges of the whole pattern."""
    hit = patch.collision
    return replace(
        patch,
        facets=piece.facets[patch.facets],
        edges=piece.edges[patch.edges],
        collision=None if hit is None else (int(piece.facets[hit[0]]), int(piece.facets[hit[1]])),
    )


def _renumbered(seam: PlateSeam, piece: Piece, first: int) -> PlateSeam:
    """``seam`` of a piece with the edges of the whole pattern, and patches from ``first`` on."""
    one, other = seam.blocks
    return replace(
        seam,
        blocks=seam.blocks if seam.patch is not None else (one + first, other + first),
        hinges=tuple(piece.edges[list(seam.hinges)].tolist()),
        slits=tuple(piece.edges[list(seam.slits)].tolist()),
        patch=None if seam.patch is None else seam.patch + first,
    )
