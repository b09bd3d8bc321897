"""A sheet of plates of one thickness with shifted hinges: patches, brackets, solids, collisions.

Where the whole sheet has no plates (:mod:`miurafab.origami.folding.bennett`), it is parted into
patches of up to six by six facets, each of which folds by itself. An axis that stands off its plate
is held by brackets: pieces of the same board that stand on the plate along the crease, one on
either side, beside each other.

The solids of a patch are tested against each other at states from flat to flat-folded. Plates are
made smaller by a clearance all around. What touches is no collision: for the test the plates are
thinner, and the brackets shorter, by a thousandth of the thickness.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from miurafab.display import Shown
from miurafab.errors import InputError, PatternError
from miurafab.files import AnyPath
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import next_corners
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.bennett import BennettHeights, bennett_heights, thick_placement
from miurafab.origami.folding.contact import self_intersections, triangulate
from miurafab.origami.folding.kinematics import fold_angles_at, states_between
from miurafab.origami.folding.thick_panels import corner_moves
from miurafab.origami.piece import piece_of

CLEARANCE = 0.05
"""How far plates keep from their creases, over the thickness."""

WHOLE = 400
"""A sheet of more facets is parted into patches at once."""

PATCHES = (6, 5, 4)
"""The sides of patches, in facets, that are tried one after another."""

STEPS = 24
"""Steps from flat to flat-folded at which solids are tested."""

_TOUCH = 1e-3  # of the thickness; see above
_BRACKET = ((0.28, 0.49), (0.51, 0.72))  # along the crease: of its left facet, of its right


@dataclass(frozen=True, eq=False)
class Bracket:
    """A piece of board on the plate of ``facet``, that holds the axis of ``edge``.

    ``foot`` (4, 2) mm is where it stands, its first two corners at the crease; it reaches from the
    height ``low`` to ``high``, mm.
    """

    edge: int
    facet: int
    foot: Floats
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class PlatePatch:
    """One patch of a :class:`ThickPlates`: F facets that fold as one mechanism.

    Attributes
    ----------
    pattern : CreasePattern
        The patch alone, with E edges.
    facets, edges : (n,) int64
        The numbers of its facets and edges in the whole pattern.
    axis_mm : (E,) float64
        The height of the axis of each crease over the plane of the sheet.
    bottom_mm : (F,) float64
        The height of the bottom of each plate.
    thickness_mm : float
        The thickness of the plates.
    clear_deg : float
        The fold angle of the median crease up to which no solids collide from flat on, degrees;
        180 for the whole motion.
    clear_state : float
        The state s at that angle.
    collision : (int, int) or None
        The facets, as numbered in the whole pattern, that collide first.
    """

    pattern: CreasePattern
    facets: Ints
    edges: Ints
    axis_mm: Floats
    bottom_mm: Floats
    thickness_mm: float
    clear_deg: float = 0.0
    clear_state: float = 0.0
    collision: tuple[int, int] | None = None

    @property
    def range_mm(self) -> float:
        """The distance of the highest axis from the lowest."""
        return float(np.ptp(self.axis_mm[self.edges_inner])) if len(self.edges_inner) else 0.0

    @property
    def edges_inner(self) -> Ints:
        """(n,) the creases of the patch, by their numbers in it."""
        return np.flatnonzero((self.pattern.edges_faces >= 0).all(axis=1))

    @cached_property
    def outlines(self) -> Floats:
        """(F, k, 2) the outline of each plate, mm, with clearance; corners that a facet does not
        have are its first.
        """
        return _inset(self.pattern, CLEARANCE * self.thickness_mm)

    @property
    def limit_mm(self) -> Floats:
        """(F,) the thickness at which each plate loses a side to its clearance, mm."""
        faces = self.pattern.faces_vertices
        row, after = np.arange(len(faces))[:, None], next_corners(faces)
        corners = self.pattern.vertices_coords[faces]
        whole, left = (each[row, after] - each for each in (corners, self.outlines))
        length = np.linalg.norm(whole, axis=2)
        real = (faces >= 0) & (length > 0)
        kept = np.divide(
            (whole * left).sum(axis=2), length**2, where=real, out=np.ones_like(length)
        )
        shrinks = real & (kept < 1)
        lasts = np.divide(
            self.thickness_mm, 1 - kept, where=shrinks, out=np.full_like(kept, np.inf)
        )
        return np.asarray(lasts.min(axis=1))

    @cached_property
    def brackets(self) -> tuple[Bracket, ...]:
        """The brackets, crease by crease."""
        pattern, made = self.pattern, []
        for edge in self.edges_inner.tolist():
            tail, head = pattern.vertices_coords[pattern.edges_vertices[edge]]
            along = head - tail
            left = np.array([-along[1], along[0]]) / np.linalg.norm(along)
            for side, inward in ((0, left), (1, -left)):
                facet = int(pattern.edges_faces[edge, side])
                bottom = float(self.bottom_mm[facet])
                top, axis = bottom + self.thickness_mm, float(self.axis_mm[edge])
                low, high = (top, axis) if axis >= top else (axis, bottom)
                if high - low <= 2 * _TOUCH * self.thickness_mm or bottom < axis < top:
                    continue
                near = CLEARANCE * self.thickness_mm * inward
                far = near + self.thickness_mm * inward
                start, end = (tail + share * along for share in _BRACKET[side])
                foot = np.stack([start + near, end + near, end + far, start + far])
                made.append(Bracket(edge, facet, foot if side == 0 else foot[::-1], low, high))
        return tuple(made)

    def solids(self, less: float = 0.0) -> PlateSolids:
        """The plates and brackets when flat, each smaller by ``less``, mm, where it may touch."""
        faces = self.pattern.faces_vertices
        real = faces >= 0
        parts = [
            (
                facet,
                self.outlines[facet][real[facet]],
                float(self.bottom_mm[facet]) + less,
                float(self.bottom_mm[facet]) + self.thickness_mm - less,
            )
            for facet in range(len(faces))
        ]
        for each in self.brackets:
            upright = each.low >= float(self.bottom_mm[each.facet])
            low, high = (each.low, each.high - less) if upright else (each.low + less, each.high)
            parts.append((each.facet, each.foot, low, high))
        return PlateSolids.of(parts)

    def placed(self, solids: PlateSolids, states: Floats) -> Floats:
        """(T, n, 3) the corners of ``solids`` at ``states`` (T,)."""
        placement = thick_placement(self.pattern, self.axis_mm, states)
        moved = np.einsum("tnij,nj->tni", placement.turn[:, solids.facet], solids.corners)
        return np.asarray(moved + placement.shift[:, solids.facet])


@dataclass(frozen=True, eq=False)
class PlateSolids:
    """Prisms as one mesh: ``corners`` (n, 3) mm, the facet (n,) that each belongs to, and
    ``triangles`` (m, 3), whose normals point outwards.
    """

    corners: Floats
    facet: Ints
    triangles: Ints

    @classmethod
    def of(cls, parts: list[tuple[int, Floats, float, float]]) -> PlateSolids:
        """From facets, outlines (k, 2) counter-clockwise, and the heights of bottom and top."""
        corners, owner, triangles, count = [], [], [], 0
        for facet, outline, low, high in parts:
            k = len(outline)
            corners += [np.pad(outline, ((0, 0), (0, 1)), constant_values=z) for z in (low, high)]
            owner.append(np.full(2 * k, facet))
            cap, _ = triangulate(np.arange(k)[None], outline)
            here = np.arange(k)
            after = (here + 1) % k
            walls = [
                np.stack([here, after, after + k], axis=1),
                np.stack([here, after + k, here + k], axis=1),
            ]
            triangles += [count + each for each in (cap[:, ::-1], cap + k, *walls)]
            count += 2 * k
        return cls(np.concatenate(corners), np.concatenate(owner), np.concatenate(triangles))


@dataclass(frozen=True, eq=False, repr=False)
class ThickPlates(Shown):
    """A pattern made of plates of one thickness with shifted hinges.

    Attributes
    ----------
    pattern : CreasePattern
        The whole pattern.
    thickness_mm : float
        The thickness of the plates.
    patches : tuple of PlatePatch
        The mechanisms that it is made of; one where the whole sheet has plates.
    """

    pattern: CreasePattern
    thickness_mm: float
    patches: tuple[PlatePatch, ...]

    @property
    def folds(self) -> bool:
        """Whether each patch has all its plates and reaches its folded form without a collision."""
        return not self.too_small and all(patch.clear_state >= 1.0 for patch in self.patches)

    @property
    def too_small(self) -> tuple[tuple[int, float], ...]:
        """The facets of which no plate is left, and from which thickness on, mm."""
        return tuple(
            (int(facet), float(limit))
            for patch in self.patches
            for facet, limit in zip(patch.facets, patch.limit_mm, strict=True)
            if limit <= self.thickness_mm
        )

    def save(self, path: AnyPath, *, title: str = "") -> None:
        """Write the panels: outlines to cut, or solids.

        Parameters
        ----------
        path : str or os.PathLike
            A ``.dxf`` or ``.svg`` file with outlines, an ``.stl`` file with the panels flat, or a
            ``.glb`` file in which they move.
        title : str
            The title inside an SVG file. The default is the name of the target.

        Raises
        ------
        InputError
            For another ending, for a folder that does not exist, and for facets that are too small.
        """
        from miurafab.origami.formats.panels import write_panels

        if self.too_small:
            raise InputError(
                f"Facet {self.too_small[0][0]} is too small for {self.thickness_mm:g} mm plates, "
                "so it has no outline; enlarge the sheet or choose a smaller `thickness`."
            )
        write_panels(self, path, title)

    def _summary(self) -> str:
        count = len(self.patches)
        clear = min(patch.clear_deg for patch in self.patches)
        made = "one mechanism" if count == 1 else f"{count} patches"
        return f"{self.thickness_mm:g} mm plates in {made}, clear up to {clear:.3g} degrees"


def thick_plates(
    pattern: CreasePattern,
    thickness_mm: float,
    on_progress: Callable[[float, str], None] | None = None,
) -> ThickPlates:
    """``pattern`` made of plates of ``thickness_mm`` with shifted hinges.

    Raises :class:`~miurafab.errors.InputError` for a thickness that is not positive, and
    :class:`~miurafab.errors.PatternError` for a sheet that is not exactly flat-foldable, and for
    one of which some patch has no plates.
    """
    if not 0 < thickness_mm < np.inf:
        raise InputError(f"`thickness` is {thickness_mm:g} mm; it must be greater than zero.")
    found = _parted(pattern)
    made = []
    for number, (facets, edges, heights) in enumerate(found):
        if on_progress is not None:
            on_progress(number / len(found), f"patch {number + 1} of {len(found)}")
        scale = thickness_mm / heights.thickness
        patch = PlatePatch(
            heights.pattern,
            facets,
            edges,
            heights.axis * scale,
            heights.bottom * scale,
            thickness_mm,
        )
        made.append(_cleared(patch))
    return ThickPlates(pattern, thickness_mm, tuple(made))


def _parted(pattern: CreasePattern) -> list[tuple[Ints, Ints, BennettHeights]]:
    """The facets, edges and heights of the fewest patches that have plates."""
    everything = np.arange(len(pattern.faces_vertices)), np.arange(len(pattern.edges_vertices))
    one = pattern.pieces_count == 1
    if one and len(everything[0]) <= WHOLE:
        whole = bennett_heights(pattern)
        if whole.exists:
            return [(*everything, whole)]
    cells = _cells(pattern)
    for side in PATCHES if cells is not None else ():
        assert cells is not None
        blocks = [_block(cells[:, axis], side) for axis in (0, 1)]
        own = np.zeros(len(cells), dtype=np.int64) if pattern.pieces is None else pattern.pieces
        _, number = np.unique(np.column_stack([own, *blocks]), axis=0, return_inverse=True)
        number = number.reshape(-1)
        found = []
        for patch in range(int(number.max()) + 1):
            piece = piece_of(pattern, np.flatnonzero(number == patch))
            heights = bennett_heights(piece.pattern)
            if not heights.exists:
                break
            found.append((piece.facets, piece.edges, heights))
        else:
            return found
    raise PatternError(
        "No plates of one thickness fit on shifted hinges, neither for the whole sheet nor for "
        f"patches of {PATCHES[-1]} x {PATCHES[-1]} facets; use tapered panels."
    )


def _cells(pattern: CreasePattern) -> Ints | None:
    """(F, 2) the column and row of each facet; None where they are not known."""
    if pattern.cells is not None:
        return pattern.cells
    if pattern.grid is None:
        return None
    columns, rows = (count - 1 for count in pattern.grid)
    number = np.arange(columns * rows)
    return np.column_stack([number % columns, number // columns])


def _block(index: Ints, side: int) -> Ints:
    """(F,) the number of the block of each of ``index`` (F,), in even blocks of up to ``side``."""
    first = int(index.min())
    count = int(index.max()) - first + 1
    blocks = math.ceil(count / side)
    return (index - first) * blocks // count


def _cleared(patch: PlatePatch) -> PlatePatch:
    """``patch`` with the part of its motion, from flat on, on which no solids collide."""
    states = states_between(patch.pattern, STEPS)
    solids = patch.solids(_TOUCH * patch.thickness_mm)
    placed = patch.placed(solids, states)
    clear, collision = 0, None
    for frame in range(len(states)):
        pairs = self_intersections(_as_pattern(solids, placed[frame]))
        hit = np.sort(solids.facet[solids.triangles[pairs, 0]], axis=1)
        hit = hit[hit[:, 0] != hit[:, 1]]
        if len(hit):
            collision = (int(patch.facets[hit[0, 0]]), int(patch.facets[hit[0, 1]]))
            break
        clear = frame
    angles = np.abs(fold_angles_at(patch.pattern, states[clear : clear + 1])[0])
    folding = angles[(patch.pattern.edges_faces >= 0).all(axis=1)]
    median = float(np.median(folding[folding > 0])) if (folding > 0).any() else 0.0
    return replace(
        patch,
        clear_deg=math.degrees(median),
        clear_state=float(states[clear]),
        collision=collision,
    )


def _as_pattern(solids: PlateSolids, placed: Floats) -> CreasePattern:
    """The triangles of ``solids`` as facets that are folded to ``placed`` (n, 3)."""
    return CreasePattern(
        vertices_coords=np.zeros((len(placed), 2)),
        edges_vertices=np.empty((0, 2), dtype=np.int64),
        edges_assignment=np.empty(0, dtype="U1"),
        edges_fold_angle=np.empty(0),
        faces_vertices=solids.triangles,
        folded_coords=placed,
    )


def _inset(pattern: CreasePattern, distance: float) -> Floats:
    """(F, k, 2) the corners of the facets with each side moved inwards by ``distance``."""
    moves = corner_moves(pattern, np.where(pattern.faces_vertices >= 0, 1.0, 0.0))
    corners = pattern.vertices_coords[pattern.faces_vertices] + distance * moves
    first = np.where((pattern.faces_vertices >= 0)[..., None], corners, corners[:, :1])
    return np.asarray(first)
