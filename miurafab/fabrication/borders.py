"""The open borders of a shell: what is left when all seams are glued.

The border edges that no seam joins form chains in the shell, where the doubled vertices of a seam
are one point. A sheet has one chain, its rim. A tube has two, and so has a body of gores whose
poles are left open. The chains are numbered from 1, the longest first.

A tab may stand on an open border, to fix the shell to a base or a frame. It has no facet to which
it is glued, so its room is what the flat pattern leaves free: over a border edge of length L, in
the frame of the edge with y away from the paper, it is the set of points with

    0 <= y <= height,    p.n >= inset  on both sides,

where n is normal to the line that halves the angle between the edge and its neighbour, if that
angle, measured outside of the paper, is below 180 degrees. So tabs on two neighbours never meet.
No angle at the base exceeds that of the material.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.options import Chosen
from miurafab.fabrication.seams import Seams, border_seams, shell_points
from miurafab.fabrication.tabs import (
    TabRegions,
    clip_convex,
    edge_axes,
    inset_of,
    not_slender,
    not_steeper,
    with_base,
)
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material


@dataclass(frozen=True)
class OpenBorder:
    """One open border: its ``number``, the pattern ``edges`` in it, its length, and the largest
    distance of two of its points in the folded form, both in mm; None if the form is unknown.
    """

    number: int
    edges: tuple[int, ...]
    length_mm: float
    across_mm: float | None

    @property
    def size(self) -> str:
        """Its length and width in words."""
        across = "" if self.across_mm is None else f", {self.across_mm:.1f} mm across"
        return f"{self.length_mm:.1f} mm long{across}"


def is_loose(pattern: CreasePattern) -> bool:
    """Whether ``pattern`` is of several facets of which none is joined to another; they make no
    shell.
    """
    joined = bool((pattern.edges_faces >= 0).all(axis=1).any())
    return pattern.pieces_count > 1 and not joined and not len(border_seams(pattern).edges)


def open_borders(pattern: CreasePattern) -> tuple[OpenBorder, ...]:
    """The open borders of the shell, the longest first; none of loose parts."""
    seams = border_seams(pattern)
    edges = _open_edges(pattern, seams)
    if not len(edges) or is_loose(pattern):
        return ()
    ends = shell_points(pattern, seams)[pattern.edges_vertices[edges]]
    chain = components(int(ends.max()) + 1, *ends.T)[ends[:, 0]]
    length = edge_lengths(pattern.vertices_coords, pattern.edges_vertices[edges])
    chains = [np.flatnonzero(chain == number) for number in np.unique(chain)]
    # Of borders equal up to rounding the one with the lowest edge is first.
    chains.sort(key=lambda own: (-round(float(length[own].sum()), 6), int(edges[own[0]])))
    return tuple(
        OpenBorder(
            number,
            tuple(edges[own].tolist()),
            float(length[own].sum()),
            _across(pattern, edges[own]),
        )
        for number, own in enumerate(chains, start=1)
    )


def chosen(pattern: CreasePattern, which: Chosen, option: str) -> tuple[OpenBorder, ...]:
    """The open borders that the ``option`` names by ``which``.

    Raises :class:`~miurafab.errors.LayoutError` for a border that is not there.
    """
    borders = open_borders(pattern) if which else ()
    if which == "all":
        return borders
    for number in which:
        if number > len(borders):
            there = f"has {len(borders)}" if borders else "has none"
            raise LayoutError(
                f"`{option}` names open border {number}, but the shell {there}; give all, or "
                "numbers of the report on the layout."
            )
    return tuple(borders[number - 1] for number in which)


def chosen_edges(pattern: CreasePattern, which: Chosen) -> Ints:
    """The pattern edges of the open borders that bear tabs."""
    borders = chosen(pattern, which, "border_tabs")
    return np.array(sorted(e for border in borders for e in border.edges), dtype=np.int64)


def open_tabs(pattern: CreasePattern, edges: Ints, material: Material) -> TabRegions:
    """The tabs on the open border ``edges`` (S,), glued to nothing: their mates are -1."""
    count, nothing = len(edges), np.full(len(edges), -1)
    faces = pattern.edges_faces[edges].max(axis=1)
    seams = Seams(
        np.column_stack([edges, nothing]), np.column_stack([faces, nothing]), np.full(count, "U")
    )
    length = edge_lengths(pattern.vertices_coords, pattern.edges_vertices[edges])
    low, height = np.zeros(count), np.full(count, material.tabs.height_mm)
    x, y = (
        np.stack([low, length, length, low], axis=1),
        np.stack([low, low, height, height], axis=1),
    )
    points, sides = np.stack([x, y], axis=2), np.full(count, 4)
    half, inset = _room_beside(pattern, edges), inset_of(material)
    for end, way in ((0, 1.0), (1, -1.0)):
        normal = np.column_stack([way * np.sin(half[:, end]), -np.cos(half[:, end])])
        limit = inset + end * length * normal[:, 0]
        points, sides = clip_convex(points, sides, normal, limit)
        sides = with_base(points, sides)
    points, sides = not_steeper(points, sides, np.full(count, material.tabs.max_angle))
    points, sides = not_slender(points, sides)
    _, last, frame = edge_axes(pattern, edges, faces)
    placed = last[:, None] - np.einsum("nij,nki->nkj", frame, points)
    return TabRegions(seams, placed, placed, sides)


def _room_beside(pattern: CreasePattern, edges: Ints) -> Floats:
    """(S, 2) half the angle outside of the paper, at most a right angle, at the end and at the
    start of each of the border ``edges`` (S,), as its facet has it on its left.
    """
    corners = pattern.faces_vertices
    real = corners >= 0
    count = real.sum(axis=1)[:, None]
    slot = np.arange(corners.shape[1])
    points = pattern.vertices_coords[corners]
    ahead = np.take_along_axis(points, ((slot + 1) % count)[..., None], axis=1) - points
    behind = np.take_along_axis(points, ((slot - 1) % count)[..., None], axis=1) - points
    cross = ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0]
    angle = np.arctan2(cross, (ahead * behind).sum(axis=2)) % (2 * math.pi)
    taken = np.zeros(len(pattern.vertices_coords))
    np.add.at(taken, corners[real], angle[real])
    half = np.clip(math.pi - taken / 2, 0.0, math.pi / 2)
    ends = pattern.edges_vertices[edges]
    forward = (pattern.edges_faces[edges, 0] >= 0)[:, None]
    return np.asarray(half[np.where(forward, ends[:, ::-1], ends)])


def _open_edges(pattern: CreasePattern, seams: Seams) -> Ints:
    border: Bools = (pattern.edges_faces >= 0).sum(axis=1) == 1
    border[seams.edges.ravel()] = False
    return np.flatnonzero(border)


def _across(pattern: CreasePattern, edges: Ints) -> float | None:
    if pattern.folded_coords is None:
        return None
    points = pattern.folded_coords[np.unique(pattern.edges_vertices[edges])]
    from scipy.spatial.distance import pdist

    return float(pdist(points).max())
