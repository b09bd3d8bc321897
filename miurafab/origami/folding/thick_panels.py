"""Thick panels: the distance by which each panel is trimmed so that the sheet still folds.

The creases stay the axes of the motion, in the middle of a panel of thickness t, so the motion is
that of thin paper (T. Tachi, "Rigid-foldable thick origami", Origami 5 (2011), tapered panels). Two
panels that fold by rho about their crease meet in the plane that bisects their angle. The surface
on the closing side, the top for a valley and the bottom for a mountain, is therefore trimmed back
from the crease by

    d = (t / 2) tan(rho / 2)

and the other surface reaches the crease. A panel of two plies with a film between them as the hinge
has one ply trimmed by d. A crease that is folded flat can have no thickness: d grows without bound.

With k = tan(rho / 2) at a side that closes and k = 0 at a side that opens, the corner p between two
sides with inward unit normals m and n moves to p + (t / 2) w, where m.w = k_m and n.w = k_n.
Corners move in proportion to t, which gives the thickness up to which each side keeps a length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import InputError
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import filled, next_corners, previous_corners, signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.angles_csv import ON_EACH_OTHER
from miurafab.origami.folding.contact import crossing_triangles, triangulate
from miurafab.origami.folding.kinematics import first_facets, fold_angles_at, place, rigid_motion
from miurafab.origami.folding.made_panels import MadePanels

SIDES = ("top", "bottom")
LEAST_USEFUL = 0.25
"""A panel of which less is left on one side cannot be used."""

STATES = (0.05, 0.35, 0.7, 0.999)
"""The states at which solids are tested, as parts of the median fold angle. At flat and in the
folded form panels touch along their sides.
"""


@dataclass(frozen=True, eq=False, repr=False)
class ThickPanels(MadePanels):
    """A pattern made of thick panels, which folds from flat to its folded form.

    Attributes
    ----------
    pattern : CreasePattern
        The pattern of the panels, with E edges and F facets.
    thickness_mm : float
        The thickness of the panels.
    closing_side : (E,) str
        Where the panels close and are cut back: "top" for valleys, "bottom" for mountains, "" on
        borders and flat creases. The hinge is in the middle of the thickness.
    offset_mm : (E,) float64
        The distance from the crease to the surface of the panels on the closing side, infinite for
        a crease folded by 180 degrees.
    limit_mm : (F,) float64
        The thickness up to which each facet keeps all its sides.
    collisions : tuple of (float, int, int)
        State, facet and facet where trimmed panels still pass through each other.
    """

    pattern: CreasePattern
    thickness_mm: float
    closing_side: NDArray[np.str_]
    offset_mm: Floats
    limit_mm: Floats
    collisions: tuple[tuple[float, int, int], ...]

    @property
    def least_scale(self) -> float:
        """The least factor by which the sheet must be enlarged for the thickness; infinite if a
        crease is folded flat.
        """
        least = float(self.limit_mm.min())
        return self.thickness_mm / least if least > 0 else np.inf

    @property
    def folds(self) -> bool:
        """Whether the sheet folds with this thickness."""
        return not len(self.too_small) and not self.collisions

    @cached_property
    def plies(self) -> Floats:
        """(2, F, k, 2) the outlines of the panels on the top and on the bottom, mm. Corners that a
        facet does not have are its first.

        A ply from the middle to the surface that is cut to such an outline, with upright sides,
        stays within its panel.
        """
        faces, made = self.pattern.faces_vertices, []
        for sign in (1.0, -1.0):
            moves = corner_moves(self.pattern, _closing(self.pattern, self._angles * sign))
            corners = self.pattern.vertices_coords[faces] + self.thickness_mm / 2 * moves
            made.append(np.where((faces >= 0)[..., None], corners, corners[:, :1]))
        return np.stack(made)

    @property
    def useful(self) -> Floats:
        """(F,) the part of each facet that is left on its smaller side; 0 where it is too small."""
        whole = signed_areas(self.pattern.vertices_coords[filled(self.pattern.faces_vertices)])
        with np.errstate(invalid="ignore"):  # a side at a crease of 180 degrees goes to infinity
            left = np.stack([signed_areas(ply) for ply in self.plies]).min(axis=0)
        return np.where(self.limit_mm > self.thickness_mm, left / whole, 0.0)

    @property
    def usable(self) -> bool:
        """Whether the sheet folds and :data:`LEAST_USEFUL` is left of each panel."""
        return self.folds and bool((self.useful >= LEAST_USEFUL).all())

    def solids(self) -> tuple[Floats, Ints, Ints]:
        """The panels when flat: points (n, 3) in mm, triangles (m, 3) over them with normals that
        point outwards, and the facet (n,) with which each point moves.

        Points on a hinge come once for each panel. Raises :class:`~miurafab.errors.InputError` if a
        facet is too small.
        """
        self.refuse_too_small()
        solids = _Solids.of(self.pattern, self.thickness_mm)
        hinge = np.pad(self.pattern.vertices_coords, ((0, 0), (0, 1)))
        points = np.concatenate([hinge, solids.corners])[solids.triangles].reshape(-1, 3)
        keys = np.column_stack([np.repeat(solids.triangle_facet, 3), solids.triangles.reshape(-1)])
        _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        return points[first], number.reshape(-1, 3), keys[first, 0]

    @property
    def _angles(self) -> Floats:
        """(E,) the fold angles of the creases, and 0 of borders."""
        inner = (self.pattern.edges_faces >= 0).all(axis=1)
        return np.where(inner, self.pattern.edges_fold_angle, 0.0)


def thick_panels(
    pattern: CreasePattern,
    thickness_mm: float,
    on_progress: Callable[[float, str], None] | None = None,
) -> ThickPanels:
    """The panels of ``pattern`` at ``thickness_mm``, and whether they fold to the folded form.

    Raises :class:`~miurafab.errors.InputError` for a thickness that is not positive, or a sheet
    that does not fold rigidly and so cannot be made of panels.
    """
    if not 0 < thickness_mm < np.inf:
        raise InputError(f"`thickness` is {thickness_mm:g} mm; it must be greater than zero.")
    motion = rigid_motion(pattern, [0.25, 0.5, 1.0])
    if not motion.is_rigid:
        assert motion.mismatch is not None
        raise InputError(
            "Thick panels cannot bend, and this sheet does not fold rigidly: on the way its facets "
            f"miss each other by up to {motion.mismatch.max():.2g} mean edges; fit it with "
            "`flat_foldable` exact."
        )
    angle = np.where((pattern.edges_faces >= 0).all(axis=1), pattern.edges_fold_angle, 0.0)
    flat_folded = np.abs(angle) > ON_EACH_OTHER
    reach = np.where(flat_folded, np.inf, np.tan(np.abs(angle) / 2))
    side = np.where(angle > 0, SIDES[0], np.where(angle < 0, SIDES[1], ""))
    limit = facet_limits(pattern, angle)
    collisions: tuple[tuple[float, int, int], ...] = ()
    if (limit > thickness_mm).all():
        collisions = _collisions(pattern, thickness_mm, on_progress)
    return ThickPanels(pattern, thickness_mm, side, reach * thickness_mm / 2, limit, collisions)


def facet_limits(pattern: CreasePattern, angle: Floats) -> Floats:
    """(F,) the thickness, mm, at which each facet loses a side when folded by ``angle`` (E,).

    Infinite for a facet without a closing side, 0 for a facet with a crease folded by 180 degrees.
    """
    limits = np.full(len(pattern.faces_vertices), np.inf)
    for sign in (1.0, -1.0):
        closing = _closing(pattern, angle * sign)
        shut = np.isinf(closing).any(axis=1)
        moves = corner_moves(pattern, np.where(np.isinf(closing), 0.0, closing))
        along, length = _sides(pattern)
        shrink = np.einsum("fkd,fkd->fk", moves - _next(pattern.faces_vertices, moves), along)
        with np.errstate(divide="ignore", invalid="ignore"):
            lasts = np.where((shrink > 1e-12) & (length > 0), 2 * length / shrink, np.inf)
        limits = np.minimum(limits, np.where(shut, 0.0, lasts.min(axis=1)))
    return limits


def _collisions(
    pattern: CreasePattern,
    thickness: float,
    on_progress: Callable[[float, str], None] | None,
) -> tuple[tuple[float, int, int], ...]:
    """The states and pairs of facets where trimmed panels, as solids, pass through each other."""
    folding = np.abs(pattern.edges_fold_angle[pattern.edges_fold_angle != 0])
    middling = float(np.median(folding))
    states = np.tan(np.array(STATES) * middling / 2) / np.tan(middling / 2)
    collisions: list[tuple[float, int, int]] = []
    solids = _Solids.of(pattern, thickness)
    placement = place(pattern, fold_angles_at(pattern, states))
    owner_of_vertex = first_facets(pattern, placement.depth)
    for frame, state in enumerate(states):
        if on_progress is not None:
            on_progress(frame / len(states), "panels")
        turn, shift = placement.turn[frame], placement.shift[frame]
        hinge = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
        points = np.concatenate([hinge, solids.corners])
        facet = np.concatenate([owner_of_vertex, solids.corner_facet])
        placed = np.einsum("nij,nj->ni", turn[facet], points) + shift[facet]
        pairs = crossing_triangles(placed, solids.triangles)
        panels = np.sort(solids.triangle_facet[pairs], axis=1)
        panels = np.unique(panels[panels[:, 0] != panels[:, 1]], axis=0)
        if pattern.pieces is not None:  # each piece folds by itself
            panels = panels[pattern.pieces[panels[:, 0]] == pattern.pieces[panels[:, 1]]]
        collisions.extend((float(state), int(a), int(b)) for a, b in panels)
    return tuple(collisions)


@dataclass(frozen=True, eq=False)
class _Solids:
    """All panels as one mesh: ``corners`` (C, 3) of their tops and bottoms over the flat pattern,
    and ``triangles`` (n, 3) over the vertices of the pattern (the hinges) and then the corners.
    """

    corners: Floats
    corner_facet: Ints
    triangles: Ints
    triangle_facet: Ints

    @classmethod
    def of(cls, pattern: CreasePattern, thickness: float) -> _Solids:
        faces = pattern.faces_vertices
        facet, slot = np.nonzero(faces >= 0)
        vertices, count = len(pattern.vertices_coords), len(facet)
        number = np.full(faces.shape, -1, dtype=np.int64)
        number[facet, slot] = np.arange(count)
        hinge, beside = faces[facet, slot], _next(faces, faces)[facet, slot]
        corners, triangles, owners = [], [], []
        for at, sign in enumerate((1.0, -1.0)):
            moves = corner_moves(pattern, _closing(pattern, pattern.edges_fold_angle * sign))
            flat = (pattern.vertices_coords[faces] + thickness / 2 * moves)[facet, slot]
            corners.append(np.pad(flat, ((0, 0), (0, 1)), constant_values=sign * thickness / 2))
            shift = vertices + at * count
            cap, owner = triangulate(number, flat)
            corner = number[facet, slot] + shift
            after = _next(faces, number)[facet, slot] + shift
            walls = ((hinge, beside, after), (hinge, after, corner))
            made = [cap + shift, *(np.stack(wall, axis=1) for wall in walls)]
            triangles += made if sign > 0 else [each[:, ::-1] for each in made]
            owners += [owner, facet, facet]
        return cls(
            np.concatenate(corners),
            np.tile(facet, 2),
            np.concatenate(triangles),
            np.concatenate(owners),
        )


def _closing(pattern: CreasePattern, angle: Floats) -> Floats:
    """(F, k) tan(rho / 2) of each closing side, where ``angle`` (E,) is positive; else 0."""
    flat_folded = angle > ON_EACH_OTHER
    reach = np.where(flat_folded, np.inf, np.tan(np.clip(angle, 0.0, ON_EACH_OTHER) / 2))
    return np.where(pattern.faces_edges >= 0, reach[pattern.faces_edges], 0.0)


def _next(faces: Ints, values: NDArray[Any]) -> NDArray[Any]:
    """``values`` (F, k, ...) at the next corner of each of ``faces`` (F, k)."""
    return values[np.arange(len(values))[:, None], next_corners(faces)]


def _sides(pattern: CreasePattern) -> tuple[Floats, Floats]:
    """(F, k, 2) unit directions from each corner to the next, and their lengths (F, k)."""
    here = pattern.vertices_coords[pattern.faces_vertices]
    side = _next(pattern.faces_vertices, here) - here
    length = np.where(pattern.faces_vertices >= 0, np.linalg.norm(side, axis=2), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(length[..., None] > 0, side / length[..., None], 0.0)
    return along, length


def corner_moves(pattern: CreasePattern, closing: Floats) -> Floats:
    """(F, k, 2) the move of each corner that moves the sides inwards by ``closing`` (F, k)."""
    along, _ = _sides(pattern)
    before = previous_corners(pattern.faces_vertices)
    row = np.arange(len(along))[:, None]
    # u and v point in and out, m and n are their left normals: w = (k_m v - k_n u) / (u x v)
    u, v, k_in, k_out = along[row, before], along, closing[row, before], closing
    turn = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        moves = (k_in[..., None] * v - k_out[..., None] * u) / turn[..., None]
    return np.where((pattern.faces_vertices >= 0)[..., None], moves, 0.0)
