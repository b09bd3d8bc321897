"""The bar-and-hinge model of paper: edges that keep their length, and folds that resist bending.

Each facet is split into triangles on its short diagonals. The energy of a shape x is

    E(x) = sum over hinges 1/2 k (rho - rho_0)^2 + sum over bars c^2 / (2 delta),
    c = (|d|^2 - L^2) / (2 L)

over fold angles rho and bar vectors d. A bar of compliance delta = 0 does not stretch. Hinges are
the diagonals (and edges of letters F and J), with stiffness k = k_f l and flat at rest, and the
creases, with stiffness k = k_c l and at rest in the folded form. With k_c = 0, the default and the
reading of Dudte et al., Nature Materials 15 (2016), only bent facets cost energy. The unit of
length is the pattern's mean edge L and the unit of energy is k_f L, unless a material gives

    k of a diagonal = 0.55 D (l / t)^(1/3),   D = E t^3 / (12 (1 - nu^2))
    k of a crease   = share D l / L*

with the share of the crease's length that is left uncut, and the length scale L* of a crease: a
strip of paper of this length is as stiff as the crease at its end (E. T. Filipov, K. Liu, T. Tachi,
M. Schenk and G. H. Paulino, Bar and hinge models for scalable analysis of origami, Int. J. Solids
Struct. 124 (2017); L* is that of F. Lechenault, B. Thiria and M. Adda-Bedia, Mechanical response of
a creased sheet, Phys. Rev. Lett. 112 (2014)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats, Ints, vector_product
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import UNCREASED, CreasePattern
from miurafab.origami.energy.hinges import hinge_angles
from miurafab.origami.energy.ruled import loose_diagonals, plumpness, rulings_among
from miurafab.origami.energy.triangles import split_facets
from miurafab.origami.invariants import interior_vertices

POISSON_RATIO = 0.3
"""For a material that gives only its modulus; D changes by 4 % between 0.25 and 0.35."""
DEGENERATE = 1e-9
"""In mean edges; the pattern is refused for a shorter edge or a lower triangle."""
CREASE_RATIO = 0.01
"""k_c / k_f of a flat sheet that folds: creases turn, and facets hardly bend."""
SOFTNESS = 0.1
"""The compliance of a bar over its length, in k_f, so that a sheet does not lock on its way from
flat: 1 / (1000 k_c). Ten times softer is too soft, a hundred times stiffer locks."""
FACET_BENDING = 0.55
"""C_B of Filipov et al. 2017, for quads whose sides do not stretch."""


@dataclass(frozen=True, eq=False)
class BarHingeModel:
    """A sheet of V vertices, in the unit of length ``unit_mm`` and of energy ``unit_joule``.

    ``points`` (V, 3) are the folded form. ``bars`` (B, 2) have rest ``lengths`` (B,) and
    ``compliance`` (B,); ``hinges`` (H, 4) of vertices u, v, a, b have ``stiffness`` (H,) and
    ``rest`` angles (H,). ``creases`` (C, 4) are the hinges, with stiffness or without, on the
    pattern's edges ``creases_edges`` (C,) that have a facet on both sides and fold (not F or J).
    Creases of different ``mechanisms`` (C,) fold independently of each other, since no stiffness
    and no chain of interior vertices joins them.
    ``unit_joule`` is None without a material. ``triangles`` (T, 3) are the parts of the facets.
    ``ruled`` (R,) are the hinges about which facets have to bend, beside a curved crease.
    """

    points: Floats
    bars: Ints
    lengths: Floats
    compliance: Floats
    hinges: Ints
    stiffness: Floats
    rest: Floats
    creases: Ints = field(default_factory=lambda: np.empty((0, 4), dtype=np.int64))
    creases_edges: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    mechanisms: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    unit_mm: float = 1.0
    unit_joule: float | None = None
    triangles: Ints = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    ruled: Ints = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def strains(self, points: Floats) -> Floats:
        """(B,) c = (|d|^2 - L^2) / (2 L) of each bar at ``points`` (V, 3)."""
        return self.strains_of(self.bar_vectors(points))

    def bar_vectors(self, points: Floats) -> Floats:
        """(B, 3) from the first to the second end of each bar."""
        first, second = (points.take(ends, axis=0) for ends in self.bars.T)
        return np.asarray(second - first)

    def strains_of(self, d: Floats) -> Floats:
        """(B,) the strains of bars that are the vectors ``d`` (B, 3)."""
        return np.asarray((np.einsum("bk,bk->b", d, d) - self.lengths**2) / (2 * self.lengths))

    def stretched(self, points: Floats) -> Floats:
        """(B,) the relative change of each bar's length at ``points`` (V, 3).

        Changes of bars shorter than a hundredth of the unit are relative to that.
        """
        changed = np.linalg.norm(self.bar_vectors(points), axis=1) - self.lengths
        return np.asarray(changed / np.maximum(self.lengths, 0.01))

    def energy(self, points: Floats) -> float:
        """The energy at ``points`` (V, 3); bars of compliance 0 add nothing."""
        bend = hinge_angles(points, self.hinges) - self.rest
        return 0.5 * float((self.stiffness * bend**2).sum()) + self.stretching(points)

    def stretching(self, points: Floats) -> float:
        """The part of the energy that is in the bars."""
        soft = self.compliance > 0
        strain = self.strains(points)[soft]
        return 0.5 * float((strain**2 / self.compliance[soft]).sum())


@dataclass(frozen=True)
class Paper:
    """The material of a sheet: ``thickness_mm`` and Young's ``modulus_pa``.

    Creases have the length scale ``crease_length_mm``; without it they turn freely. They yield at
    ``yield_angle`` radians from rest, and then have the part ``hardening`` of their stiffness left
    (:mod:`~miurafab.origami.energy.yielding`).
    """

    thickness_mm: float
    modulus_pa: float
    crease_length_mm: float | None = None
    yield_angle: float = math.inf
    hardening: float = 0.1

    @property
    def bending_stiffness(self) -> float:
        """D = E t^3 / (12 (1 - nu^2)) in joules."""
        thickness = self.thickness_mm * 1e-3
        return self.modulus_pa * thickness**3 / (12 * (1 - POISSON_RATIO**2))


def sheet_model(
    pattern: CreasePattern,
    *,
    paper: Paper | None = None,
    crease_ratio: float = 0.0,
    uncut: Floats | float = 1.0,
    unit_mm: float | None = None,
) -> BarHingeModel:
    """The bars and hinges of ``pattern``, at rest in its folded form.

    ``crease_ratio`` is k_c / k_f, or with ``paper`` the stiffness of a crease over that of a
    diagonal of its length. Where ``paper`` has a crease length, that decides, with the share
    ``uncut`` of each edge (E,) or of all. ``unit_mm`` is the unit of length, by default the mean
    edge. Raises
    :class:`~miurafab.errors.PatternError` for a pattern without a folded form or without a crease,
    and for one of several pieces.
    """
    if pattern.folded_coords is None:
        raise PatternError(
            "The pattern has no folded form, so the energy of folding it is not defined; fit it, "
            "or convert it with its folded mesh as `folded`."
        )
    if pattern.pieces_count > 1:
        raise PatternError(
            f"The pattern has {pattern.pieces_count} pieces; the energy is that of one of them."
        )
    mean = float(edge_lengths(pattern.folded_coords, pattern.edges_vertices).mean())
    unit = mean if unit_mm is None else unit_mm
    points = pattern.folded_coords / unit
    triangles, split = split_facets(points, pattern.faces_vertices)
    joined = (pattern.edges_faces >= 0).all(axis=1) & (pattern.edges_assignment != "C")
    inner = np.flatnonzero(joined)
    across = _hinges(triangles, pattern.edges_vertices[inner])
    flat = np.isin(pattern.edges_assignment[inner], UNCREASED)
    if flat.all():
        raise PatternError("The pattern has no crease between two facets, so nothing folds.")
    diagonals = _hinges(triangles, split)
    _refuse_degenerate(points, pattern.edges_vertices, np.concatenate([diagonals, across]))
    creases = across[~flat]
    bending = np.concatenate([diagonals, across[flat]])
    springs = crease_ratio > 0 or (paper is not None and paper.crease_length_mm is not None)
    hinges, rest = bending, np.zeros(len(bending))
    if springs:
        hinges = np.concatenate([bending, creases])
        rest = np.concatenate([rest, hinge_angles(points, creases)])
    lengths = edge_lengths(points, hinges[:, :2])
    stiffness, unit_joule = lengths, None
    if paper is not None:
        slender = float(np.cbrt(unit / paper.thickness_mm))
        unit_joule = FACET_BENDING * paper.bending_stiffness * slender
        stiffness = np.cbrt(lengths)
    weights = np.full(len(hinges), crease_ratio)
    weights[: len(bending)] = 1.0
    stiffness = weights * stiffness
    if paper is not None and paper.crease_length_mm is not None:
        assert unit_joule is not None
        scale = paper.bending_stiffness * unit / paper.crease_length_mm / unit_joule
        share = np.broadcast_to(uncut, len(pattern.edges_vertices))[inner[~flat]]
        stiffness[len(bending) :] = share * scale * lengths[len(bending) :]
    bars = np.concatenate([pattern.edges_vertices, diagonals[:, :2]])
    return BarHingeModel(
        points=points,
        bars=bars,
        lengths=edge_lengths(points, bars),
        compliance=np.zeros(len(bars)),
        hinges=hinges,
        stiffness=stiffness,
        rest=rest,
        creases=creases,
        creases_edges=inner[~flat],
        mechanisms=(
            np.zeros(len(creases), dtype=np.int64) if springs else _mechanisms(pattern, creases)
        ),
        unit_mm=unit,
        unit_joule=unit_joule,
        triangles=triangles,
    )


def has_folds(pattern: CreasePattern) -> bool:
    """Whether a mountain or valley of ``pattern`` lies between two facets."""
    inner = (pattern.edges_faces >= 0).all(axis=1)
    return bool((inner & np.isin(pattern.edges_assignment, ("M", "V"))).any())


def flat_model(
    pattern: CreasePattern, *, crease_ratio: float = CREASE_RATIO, softness: float = SOFTNESS
) -> BarHingeModel:
    """The bars and hinges of ``pattern`` in its flat form, which its creases want to leave.

    The rest of a crease is its fold angle; a crease of letter U has no stiffness, and an edge of
    letter F or J that of a facet. ``crease_ratio`` is k_c / k_f, and a bar of rest length L has the
    compliance ``softness`` L. ``hinges`` are first those that bend facets, then the creases with
    stiffness. The unit of length is the mean edge. Raises
    :class:`~miurafab.errors.PatternError` for a pattern without a mountain or valley between two
    facets, and for one of several pieces.
    """
    if pattern.pieces_count > 1:
        raise PatternError(f"The pattern has {pattern.pieces_count} pieces; fold one of them.")
    unit = float(edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean())
    points = np.pad(pattern.vertices_coords, ((0, 0), (0, 1))) / unit
    triangles, split = split_facets(points, pattern.faces_vertices)
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    letter = pattern.edges_assignment[inner]
    across = _hinges(triangles, pattern.edges_vertices[inner])
    diagonals = _hinges(triangles, split)
    _refuse_degenerate(points, pattern.edges_vertices, np.concatenate([diagonals, across]))
    flat = np.isin(letter, UNCREASED)
    bending = np.concatenate([diagonals, across[flat]])
    sprung = np.isin(letter, ("M", "V"))
    if not sprung.any():
        raise PatternError("The pattern has no mountain or valley between two facets.")
    hinges = np.concatenate([bending, across[sprung]])
    weights = np.concatenate([np.ones(len(bending)), np.full(int(sprung.sum()), crease_ratio)])
    ruled = len(diagonals) + np.flatnonzero(rulings_among(pattern, inner[flat]))
    if len(ruled):
        ruled = np.concatenate([loose_diagonals(pattern, split), ruled])
    weights[ruled] = crease_ratio
    goals = pattern.edges_fold_angle[inner[sprung]]
    bars = np.concatenate([pattern.edges_vertices, diagonals[:, :2]])
    lengths = edge_lengths(points, bars)
    return BarHingeModel(
        points=points,
        bars=bars,
        lengths=lengths,
        compliance=softness * lengths * (plumpness(points, triangles, bars) if len(ruled) else 1.0),
        hinges=hinges,
        stiffness=weights * edge_lengths(points, hinges[:, :2]),
        rest=np.concatenate([np.zeros(len(bending)), goals]),
        creases=across[~flat],
        creases_edges=inner[~flat],
        mechanisms=np.zeros(int((~flat).sum()), dtype=np.int64),
        unit_mm=unit,
        triangles=triangles,
        ruled=ruled,
    )


def _refuse_degenerate(points: Floats, edges: Ints, hinges: Ints) -> None:
    short = np.flatnonzero(edge_lengths(points, edges) < DEGENERATE)
    if len(short):
        raise PatternError(
            f"Edge {short[0]} has no length, so its facets cannot bend about it; convert the file "
            "with a `tolerance` that joins its two ends."
        )
    base = points[hinges[:, 1]] - points[hinges[:, 0]]
    for wing in (2, 3):
        out = points[hinges[:, wing]] - points[hinges[:, 0]]
        area = np.linalg.norm(vector_product(base, out), axis=1)
        thin = np.flatnonzero(area < DEGENERATE * np.linalg.norm(base, axis=1))
        if len(thin):
            raise PatternError(
                f"A facet at vertex {hinges[thin[0], wing]} has no width; convert the file with a "
                "`tolerance` that joins the vertex to the line beside it."
            )


def _hinges(triangles: Ints, edges: Ints) -> Ints:
    """(n, 4) the hinge u, v, a, b of each of ``edges`` (n, 2): its ends, and the third corners of
    the triangles on its left and on its right.
    """
    tails, heads, thirds = (np.roll(triangles, -turn, axis=1).ravel() for turn in range(3))
    count = int(triangles.max()) + 1
    key = tails * count + heads
    order = np.argsort(key)
    sides = []
    for u, v in (edges.T, edges[:, ::-1].T):
        sides.append(thirds[order[np.searchsorted(key, u * count + v, sorter=order)]])
    return np.concatenate([edges, np.stack(sides, axis=1)], axis=1)


def _mechanisms(pattern: CreasePattern, creases: Ints) -> Ints:
    """(C,) the mechanism of each crease: creases with a common interior vertex fold together."""
    inside = np.zeros(len(pattern.vertices_coords), dtype=bool)
    inside[interior_vertices(pattern)] = True
    crease, end = np.nonzero(inside[creases[:, :2]])
    vertex = len(creases) + creases[crease, end]
    label = components(len(creases) + len(inside), crease, vertex)
    return np.unique(label[: len(creases)], return_inverse=True)[1].astype(np.int64)
