"""Force against extension: two vertices of a sheet are pulled apart and let go, again and again.

In each cycle their distance grows to (1 + strain) times that of the folded form, and then shrinks
until no force is left. Every other vertex is free, as between the two hooks of a testing machine.
The creases yield (:mod:`~miurafab.origami.energy.yielding`), so the sheet comes back a little
longer, and from the second cycle on it takes another way than in the first. Facets that would pass
through each other are held apart (:mod:`~miurafab.origami.energy.held_apart`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.errors import InputError, PatternError
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import Paper, sheet_model
from miurafab.origami.energy.continuation import Progress, Walk, named
from miurafab.origami.energy.held_apart import TouchingDriven, TouchingWalk
from miurafab.origami.energy.pull_cycles import PullCycles
from miurafab.origami.energy.result import EnergyResult
from miurafab.origami.energy.yielding import YieldingDriven
from miurafab.origami.folding.contact import most_meeting, self_intersections
from miurafab.origami.piece import Piece, pieces_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RELEASED = 1e-6
"""A force below this part of the largest is none."""


@dataclass(frozen=True, eq=False, repr=False)
class PullCurve(EnergyResult):
    """Force against extension, in n states.

    Attributes
    ----------
    ends : tuple of int
        The two vertices.
    strain : float
        The largest extension asked for, over the distance in the folded form.
    paper : Paper
        What the sheet is made of.
    distances : array (n,)
        Between the two vertices, mm. The first is that of the folded form.
    forces : array (n,)
        N, positive where the vertices want to come together.
    cycles : array (n,) of int
        The number of the cycle of each state, from 1 on.
    loading : array (n,) of bool
        Whether the state is on the way to the largest extension.
    works, stored, dissipated : arrays (n,)
        Joules since the folded form: the work of the force (by the trapezium rule), what is stored
        in creases and facets, and what yielding creases have dissipated.
    coords : array (n, V, 3)
        The vertices in each state, mm, in the axes of the folded form, with one triangle near the
        middle held still. Pieces that are not pulled stand still.
    slips : array (C,)
        How far the rest angle of each crease of the piece has moved at the end, radians.
    converged : bool
        Whether all cycles were found; otherwise the curve ends where the sheet jumps away.
    piercings : int
        The most pairs of facets that pass through each other in one state.
    touching : bool
        Whether springs hold facets apart.
    """

    ends: tuple[int, int]
    strain: float
    paper: Paper
    distances: Floats
    forces: Floats
    cycles: Ints
    loading: Bools
    works: Floats
    stored: Floats
    dissipated: Floats
    coords: Floats
    slips: Floats
    converged: bool
    piercings: int = 0
    touching: bool = False

    @property
    def extensions(self) -> Floats:
        """(n,) how much longer than in the folded form, mm."""
        return np.asarray(self.distances - self.distances[0])

    def loadings(self) -> list[tuple[Floats, Floats]]:
        """The extensions and forces on the way out, a pair for each cycle."""
        ways = [(self.cycles == cycle) & self.loading for cycle in self._all]
        return [(self.extensions[on], self.forces[on]) for on in ways]

    def changes(self) -> list[float]:
        """The largest difference in force, N, between each way out and the next, where both are."""
        ways, found = self.loadings(), []
        for (before, force), (after, other) in itertools.pairwise(ways):
            order = np.argsort(before)
            gap = np.interp(after, before[order], force[order]) - other
            found.append(float(np.abs(gap).max()))
        return found

    def report(self) -> dict[str, Any]:
        """The curve's numbers, ready for JSON."""
        paper, changes = self.paper, self.changes()
        out = [int(np.flatnonzero((self.cycles == c) & self.loading)[-1]) for c in self._all]
        back = [int(np.flatnonzero(self.cycles == c)[-1]) for c in self._all]
        stiff = math.isinf(paper.yield_angle)
        return {
            "converged": self.converged,
            "pulled": list(self.ends),
            "distance_mm": float(self.distances[0]),
            "strain": self.strain,
            "force_n": float(self.forces[out[0]]),
            "largest_force_n": float(np.abs(self.forces).max()),
            "set_mm": self._set(back[0]),
            "second_cycle_change_n": changes[0] if changes else None,
            "third_cycle_change_n": changes[1] if len(changes) > 1 else None,
            "yielded": float((self.slips != 0).mean()),
            "contact": self.touching,
            "piercings": self.piercings,
            "thickness_mm": paper.thickness_mm,
            "modulus_pa": paper.modulus_pa,
            "crease_length_mm": paper.crease_length_mm,
            "yield_angle_deg": None if stiff else math.degrees(paper.yield_angle),
            "hardening": None if stiff else paper.hardening,
            "cycles": [
                {
                    "cycle": c,
                    "force_n": float(self.forces[top]),
                    "strain": float(self.extensions[top] / self.distances[0]),
                    "set_mm": self._set(end),
                    "work_j": float(self.works[end]),
                    "stored_j": float(self.stored[end]),
                    "dissipated_j": float(self.dissipated[end]),
                }
                for c, top, end in zip(self._all, out, back, strict=True)
            ],
            "curve": {
                "cycle": self.cycles.tolist(),
                "extension_mm": self.extensions.tolist(),
                "force_n": self.forces.tolist(),
            },
        }

    def _set(self, end: int) -> float | None:
        """How much longer it stays, mm; None where the way was lost before it was let go, and where
        the sheet does not come back by itself.
        """
        top = float(np.abs(self.forces).max())
        released = not self.loading[end] and abs(self.forces[end]) <= RELEASED * top
        return float(self.extensions[end]) if released else None

    @property
    def _all(self) -> range:
        return range(1, int(self.cycles[-1]) + 1)

    def verdict(self) -> str:
        """The result in one sentence, and another where facets pass through each other."""
        through = " On the way facets pass through each other, as no paper does."
        return self._said() + through * bool(self.piercings)

    def _said(self) -> str:
        if not self.converged:
            reached = self.extensions[-1] / self.distances[0]
            return (
                f"The way was lost at a strain of {reached:.3g}, where the sheet jumps to another "
                f"shape{', jams' * self.touching} or is stretched out; ask for a smaller `strain`, "
                "or take more `steps`."
            )
        answer = self.report()
        force, left = answer["force_n"], answer["set_mm"]
        pulled = self.strain > 0
        if (force > 0) != pulled:
            return (
                f"At a strain of {self.strain:g} it goes farther by itself, and {abs(force):.3g} N "
                "hold it back."
            )
        way = "pull" if pulled else "push"
        said = f"{abs(force):.3g} N {way} it to a strain of {self.strain:g}"
        if answer["yielded"] and left is not None:
            said += f"; let go, it stays {abs(left):.3g} mm {'longer' if left > 0 else 'shorter'}"
        return said + "."

    def _table(self) -> str:
        from miurafab.origami.energy.pull_plot import pull_table

        return pull_table(self)

    def _draw(self, axes: Axes, title: str) -> None:
        from miurafab.origami.energy.pull_plot import draw_pull

        draw_pull(self, axes, title)

    def _summary(self) -> str:
        force = self.report()["force_n"]
        return f"{force:.3g} N at a strain of {self.strain:g}, {len(self._all)} cycles"

    def _facts(self) -> Mapping[str, object]:
        return {k: v for k, v in self.report().items() if not isinstance(v, list | dict)}


def pull(
    pattern: CreasePattern,
    paper: Paper,
    ends: tuple[int, int] | None = None,
    *,
    strain: float = 0.2,
    cycles: int = 3,
    steps: int = 40,
    uncut: Floats | float = 1.0,
    on_progress: Progress | None = None,
) -> PullCurve:
    """Pull the vertices ``ends`` of ``pattern`` apart by ``strain``, and let go, in ``cycles``.

    Without ``ends`` they are the first and the last vertex of a grid. The way out has equal
    ``steps``. ``uncut`` is the share of each edge (E,) that is left uncut, or of all. A negative
    strain pushes together. Of several pieces the one with both vertices is pulled, alone. Raises
    :class:`~miurafab.errors.PatternError` as
    :func:`~miurafab.origami.energy.bar_hinge.sheet_model` does and without ``ends`` for a pattern
    without a grid, and :class:`~miurafab.errors.InputError` for vertices that cannot be pulled.

    ``paper`` has a crease length. Where facets pass through each other the sheet is pulled again
    with springs that hold them apart; not if they meet in the folded form already.
    """
    if pattern.pieces_count > 1:
        piece, pair = _piece_of(pattern, ends)
        mine = np.searchsorted(piece.vertices, pair)
        shares = np.broadcast_to(uncut, len(pattern.edges_vertices))[piece.edges]
        curve = pull(
            piece.pattern,
            paper,
            (int(mine[0]), int(mine[1])),
            strain=strain,
            cycles=cycles,
            steps=steps,
            uncut=shares,
            on_progress=on_progress,
        )
        assert pattern.folded_coords is not None
        coords = np.repeat(pattern.folded_coords[None], len(curve.coords), axis=0)
        coords[:, piece.vertices] = curve.coords
        return replace(curve, ends=pair, coords=coords)
    model = sheet_model(pattern, paper=paper, uncut=uncut)
    pair = _pair(pattern, ends)
    yields = np.full(len(model.hinges), math.inf)
    yields[-len(model.creases) :] = paper.yield_angle
    stencil = np.array(pair, dtype=np.int64)
    driven = YieldingDriven(model, stencil, yields=yields, hardening=paper.hardening)
    free = PullCycles(driven, Walk(driven, driven.rest), strain, steps, cycles, on_progress)
    curve = _walked(pattern, paper, pair, free)
    if not curve.piercings or len(self_intersections(pattern)):
        return curve
    apart = TouchingDriven(
        model, stencil, yields=yields, hardening=paper.hardening, edges=pattern.edges_vertices
    )
    with_contact = named(on_progress, "with contact")
    held = PullCycles(apart, TouchingWalk(apart, apart.rest), strain, steps, cycles, with_contact)
    return replace(_walked(pattern, paper, pair, held), touching=True)


def _piece_of(
    pattern: CreasePattern, ends: tuple[int, int] | None
) -> tuple[Piece, tuple[int, int]]:
    """The piece that has both vertices, and these."""
    pieces = pieces_of(pattern)
    if ends is None:
        largest = max(pieces, key=lambda piece: len(piece.facets))
        points = pattern.vertices_coords[largest.vertices]
        far = largest.vertices[np.argmax(np.linalg.norm(points - points[0], axis=1))]
        raise PatternError(
            f"The pattern has {len(pieces)} pieces, and one of them is pulled: name two of its "
            f"vertices as `pull`, such as {largest.vertices[0]},{far}."
        )
    pair = _pair(pattern, ends)
    one, other = (
        next(n for n, piece in enumerate(pieces) if vertex in piece.vertices) for vertex in pair
    )
    if one != other:
        raise PatternError(
            f"`pull` is {ends[0]},{ends[1]}, a vertex of piece {one} and one of piece {other}: "
            "pieces are pulled one at a time, as they are before they are joined; name two "
            "vertices of one."
        )
    return pieces[one], pair


def _pair(pattern: CreasePattern, ends: tuple[int, int] | None) -> tuple[int, int]:
    if ends is None:
        if pattern.grid is None:
            raise PatternError(
                "The pattern is no full grid, so it has no corners to `pull`; name two vertices, "
                "such as 0,120."
            )
        return 0, pattern.grid[0] * pattern.grid[1] - 1
    count = len(pattern.vertices_coords)
    if ends[0] == ends[1] or max(ends) >= count:
        raise InputError(
            f"`pull` is {ends[0]},{ends[1]}; it takes two different vertices of 0 to {count - 1}."
        )
    edge = (np.sort(pattern.edges_vertices, axis=1) == sorted(ends)).all(axis=1).any()
    facet = any({*ends} <= set(face.tolist()) for face in pattern.faces_vertices)
    if edge or facet:
        raise InputError(
            f"`pull` is {ends[0]},{ends[1]}, two corners of one facet, which does not stretch; "
            "take two vertices farther apart."
        )
    return ends


def _walked(
    pattern: CreasePattern, paper: Paper, ends: tuple[int, int], pulled: PullCycles
) -> PullCurve:
    """The curve of ``pulled``, whose cycles are walked here."""
    converged = pulled.run()
    driven = pulled.driven
    model = driven.model
    if not pulled.rows:
        raise PatternError(
            "The folded form is not in equilibrium: its facets are not flat, or it has a crease of "
            "no width; check the pattern."
        )
    assert model.unit_joule is not None
    cycle, loading, drive, load, stored, lost = np.array(pulled.rows, dtype=float).T
    work = np.concatenate([[0.0], np.cumsum(np.diff(drive) * (load[1:] + load[:-1]) / 2)])
    joule = model.unit_joule
    coords = np.stack(pulled.shapes) @ driven.axes.T * model.unit_mm
    return PullCurve(
        ends=ends,
        strain=pulled.strain,
        paper=paper,
        distances=drive * model.unit_mm,
        forces=load * joule / (model.unit_mm * 1e-3),
        cycles=cycle.astype(np.int64),
        loading=loading.astype(bool),
        works=work * joule,
        stored=stored * joule,
        dissipated=lost * joule,
        coords=coords,
        slips=driven.slips[-len(model.creases) :],
        converged=converged,
        piercings=most_meeting(pattern, coords),
    )
