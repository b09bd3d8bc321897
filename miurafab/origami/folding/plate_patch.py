"""One mechanism of plates with shifted hinges: plates, brackets, tape, and how far it moves.

The hinge of a crease is a tape along its axis. Where the axis lies in the face of a plate, the tape
is on that face. Elsewhere it is on the edge of a bracket: a strip of the same board that stands on
its edge along the crease, in a notch of its plate, and reaches from the far face of the plate to
the axis. The brackets of the two plates face each other, and the fold opens behind the tape, so
that they never meet. A pin would need knuckles around the axis, which stick out of the faces that
close on each other.

The solids are tested against each other at states from flat to flat-folded. Plates are made smaller
by a clearance all around. What touches is no collision: for the test the plates are thinner, and
the brackets shorter, by a thousandth of the thickness. The tape has no thickness.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.overlaps import shared_areas
from miurafab.geometry.polygons import next_corners
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.bennett import thick_placement
from miurafab.origami.folding.contact import crossing_triangles
from miurafab.origami.folding.kinematics import fold_angles_at, states_between
from miurafab.origami.folding.plate_solids import PlateSolids
from miurafab.origami.folding.thick_panels import corner_moves

CLEARANCE = 0.05
"""How far plates keep from their creases, over the thickness."""

STEPS = 24
"""Steps from flat to flat-folded at which solids are tested."""

BRACKET = (0.28, 0.72)
"""Where along its crease a bracket stands."""

_TAPE = (0.1, 0.9)  # where along its crease a tape lies that is on both faces
_TOUCH = 1e-3  # of the thickness; see above
_MOST = 1e3  # times the thickness; feet that would still fit then always fit


@dataclass(frozen=True, eq=False)
class Bracket:
    """A strip of board in the plate of ``facet``, that holds the axis of ``edge``.

    ``foot`` (4, 2) mm is where it stands, counter-clockwise, its first two corners at the crease;
    it rises over the plate, or hangs under it, from the height ``low`` to ``high``, mm. The strip
    also goes through the plate, to its far face.
    """

    edge: int
    facet: int
    foot: Floats
    low: float
    high: float

    @property
    def length_mm(self) -> float:
        """The length along the crease."""
        return float(np.linalg.norm(self.foot[1] - self.foot[0]))


@dataclass(frozen=True, eq=False)
class PlatePatch:
    """One mechanism of a :class:`~miurafab.origami.folding.plates.ThickPlates`, of F facets.

    Attributes
    ----------
    pattern : CreasePattern
        The patch alone, with E edges; slits are borders.
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

    @property
    def tape_width_mm(self) -> float:
        """The width of the tapes: over the brackets on either side and the gap between them."""
        return 2 * (1 + CLEARANCE) * self.thickness_mm

    @cached_property
    def outlines(self) -> Floats:
        """(F, k, 2) the outline of each plate, mm, with clearance and without notches; corners that
        a facet does not have are its first.
        """
        return _inset(self.pattern, CLEARANCE * self.thickness_mm)

    @cached_property
    def brackets(self) -> tuple[Bracket, ...]:
        """The brackets, crease by crease."""
        pattern, made = self.pattern, []
        for edge in self.edges_inner.tolist():
            for side in (0, 1):
                facet = int(pattern.edges_faces[edge, side])
                bottom = float(self.bottom_mm[facet])
                top, axis = bottom + self.thickness_mm, float(self.axis_mm[edge])
                low, high = (top, axis) if axis >= top else (axis, bottom)
                if high - low <= 2 * _TOUCH * self.thickness_mm or bottom < axis < top:
                    continue
                made.append(Bracket(edge, facet, self._foot(edge, side), low, high))
        return tuple(made)

    @cached_property
    def notched(self) -> tuple[Floats, ...]:
        """The outline (k, 2) of each of F plates, mm, with the notches for its brackets."""
        feet = {(each.facet, each.edge): each.foot for each in self.brackets}
        made = []
        for facet, outline in enumerate(self.outlines):
            points: list[Floats] = []
            for slot in np.flatnonzero(self.pattern.faces_vertices[facet] >= 0).tolist():
                points.append(outline[slot])
                foot = feet.get((facet, int(self.pattern.faces_edges[facet, slot])))
                if foot is not None:
                    points += [foot[0], foot[3], foot[2], foot[1]]
            made.append(np.array(points))
        return tuple(made)

    @property
    def tapes(self) -> tuple[tuple[int, Floats], ...]:
        """The edge and the rectangle (4, 2) mm over its crease of each hinge tape."""
        railed = {each.edge for each in self.brackets}
        made = []
        for edge in self.edges_inner.tolist():
            tail, along, left = self._crease(edge)
            half = left * self.tape_width_mm / 2
            start, end = (tail + share * along for share in (BRACKET if edge in railed else _TAPE))
            made.append((edge, np.stack([start - half, end - half, end + half, start + half])))
        return tuple(made)

    @cached_property
    def limit_mm(self) -> Floats:
        """(F,) the thickness at which each plate loses a side to its clearance, or has no room for
        its brackets, mm.
        """
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
        return np.asarray(np.minimum(lasts.min(axis=1), self._room_mm()))

    def _room_mm(self) -> Floats:
        """(F,) the thickness up to which the feet of brackets are on their plates and apart.

        A plate that is not convex counts as the part of it that is left of all its sides.
        """
        pattern = self.pattern
        limit = np.full(len(self.facets), np.inf)
        own: dict[int, list[int]] = {}
        for each in self.brackets:
            own.setdefault(each.facet, []).append(each.edge)
        for facet, edges in own.items():
            slots = np.flatnonzero(pattern.faces_vertices[facet] >= 0)
            corners = pattern.vertices_coords[pattern.faces_vertices[facet, slots]]
            sides = np.roll(corners, -1, axis=0) - corners
            inward = np.column_stack([-sides[:, 1], sides[:, 0]])
            inward /= np.linalg.norm(inward, axis=1, keepdims=True)
            feet = [(edge, int(pattern.edges_faces[edge, 0] != facet)) for edge in edges]
            # how deep a corner is under each side, less the clearance, is linear in the thickness
            thin, thick = (
                np.einsum("nkd,sd->nks", np.stack([self._foot(*foot, at) for foot in feet]), inward)
                - (corners * inward).sum(axis=1)
                - at * CLEARANCE * self.thickness_mm
                for at in (0.0, 1.0)
            )
            shrinks = thin - thick > _TOUCH * self.thickness_mm
            most = float((thin[shrinks] / (thin - thick)[shrinks]).min(initial=_MOST))
            low, high = 0.0, most
            while self._feet_meet(feet, high) and high - low > _TOUCH * most:
                middle = (low + high) / 2
                low, high = (low, middle) if self._feet_meet(feet, middle) else (middle, high)
            limit[facet] = (high if not self._feet_meet(feet, high) else low) * self.thickness_mm
        return limit

    def _feet_meet(self, feet: list[tuple[int, int]], scale: float) -> bool:
        """Whether two of the ``feet``, each an edge and a side, meet at ``scale`` times the
        thickness.
        """
        corners = np.stack([self._foot(*foot, scale) for foot in feet])
        faces = np.arange(4 * len(feet)).reshape(-1, 4)
        return bool(len(shared_areas(corners, faces, _TOUCH * self.thickness_mm).pairs))

    def _crease(self, edge: int) -> tuple[Floats, Floats, Floats]:
        """The tail, the vector to the head, and the unit normal to the left of ``edge``."""
        tail, head = self.pattern.vertices_coords[self.pattern.edges_vertices[edge]]
        along = head - tail
        return tail, along, np.array([-along[1], along[0]]) / np.linalg.norm(along)

    def _foot(self, edge: int, side: int, scale: float = 1.0) -> Floats:
        """(4, 2) where a bracket of ``edge`` stands in the facet on its ``side``, 0 for left."""
        tail, along, left = self._crease(edge)
        start, end = (tail + share * along for share in (BRACKET if side == 0 else BRACKET[::-1]))
        inward = (left if side == 0 else -left) * self.thickness_mm * scale
        near, far = CLEARANCE * inward, (1 + CLEARANCE) * inward
        return np.stack([start + near, end + near, end + far, start + far])

    def solids(self, less: float = 0.0) -> PlateSolids:
        """The plates and brackets when flat, each smaller by ``less``, mm, where it may touch."""
        real = self.pattern.faces_vertices >= 0
        parts = [
            (
                facet,
                self.outlines[facet][real[facet]],
                float(self.bottom_mm[facet]) + less,
                float(self.bottom_mm[facet]) + self.thickness_mm - less,
            )
            for facet in range(len(real))
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

    def cleared(self) -> PlatePatch:
        """This patch with the part of its motion, from flat on, on which no solids collide."""
        states = states_between(self.pattern, STEPS)
        solids = self.solids(_TOUCH * self.thickness_mm)
        placed = self.placed(solids, states)
        clear, collision = 0, None
        for frame in range(len(states)):
            pairs = crossing_triangles(placed[frame], solids.triangles)
            hit = np.sort(solids.facet[solids.triangles[pairs, 0]], axis=1)
            hit = hit[hit[:, 0] != hit[:, 1]]
            if len(hit):
                collision = (int(self.facets[hit[0, 0]]), int(self.facets[hit[0, 1]]))
                break
            clear = frame
        angles = np.abs(fold_angles_at(self.pattern, states[clear : clear + 1])[0])
        folding = angles[self.edges_inner]
        median = float(np.median(folding[folding > 0])) if (folding > 0).any() else 0.0
        return replace(
            self,
            clear_deg=math.degrees(median),
            clear_state=float(states[clear]),
            collision=collision,
        )


def _inset(pattern: CreasePattern, distance: float) -> Floats:
    """(F, k, 2) the corners of the facets with each side moved inwards by ``distance``."""
    moves = corner_moves(pattern, np.where(pattern.faces_vertices >= 0, 1.0, 0.0))
    corners = pattern.vertices_coords[pattern.faces_vertices] + distance * moves
    first = np.where((pattern.faces_vertices >= 0)[..., None], corners, corners[:, :1])
    return np.asarray(first)
