"""Force against extension: two vertices of a sheet are pulled apart and let go, again and again.

In each cycle their distance grows to (1 + strain) times that of the folded form, and then shrinks
until no force is left. Every other vertex is free, as between the two hooks of a testing machine.
The creases yield (:mod:`~miurafab.origami.energy.yielding`), so the sheet comes back a little
longer, and from the second cycle on it takes another way than in the first.
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
from miurafab.origami.energy.bar_hinge import BarHingeModel, Paper, sheet_model
from miurafab.origami.energy.continuation import Known, Progress, Walk, without_load
from miurafab.origami.energy.result import EnergyResult
from miurafab.origami.energy.yielding import YieldingDriven
from miurafab.origami.folding.contact import most_meeting
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
        The most pairs of facets that pass through each other in a state of the first way out.
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
                "shape or is stretched out; ask for a smaller `strain`, or take more `steps`."
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
    bending = len(model.hinges) - (len(model.creases) if paper.crease_length_mm else 0)
    yields = np.full(len(model.hinges), math.inf)
    yields[bending:] = paper.yield_angle
    driven = YieldingDriven(
        model, np.array(pair, dtype=np.int64), yields=yields, hardening=paper.hardening
    )
    pulled = _Pulled(driven, strain, steps, cycles, on_progress)
    converged = pulled.run()
    curve = _curve(pulled, pair, paper, converged, driven.slips[bending:])
    way_out = curve.coords[curve.loading & (curve.cycles == 1)]
    return replace(curve, piercings=most_meeting(pattern, way_out))


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


class _Pulled:
    """The cycles of one sheet as they are walked; ``rows`` hold what each state was."""

    def __init__(
        self,
        driven: YieldingDriven,
        strain: float,
        steps: int,
        cycles: int,
        on_progress: Progress | None,
    ) -> None:
        self.driven, self.strain, self.on_progress = driven, strain, on_progress
        self.first = driven.value(driven.model.points)
        self.drives = self.first * (1 + strain * np.linspace(0, 1, steps + 1))
        self.outward = math.copysign(1.0, strain)
        self.count = cycles
        self.walk = Walk(driven, driven.rest)
        self.rows: list[tuple[float, ...]] = []
        self.shapes: list[Floats] = []

    def run(self) -> bool:
        """Whether all cycles were walked to their end."""
        return all(self._out(c) and self._back(c) for c in range(1, self.count + 1))

    def _out(self, cycle: int) -> bool:
        start = -math.inf if cycle == 1 else self.outward * self.walk.last.drive
        if cycle > 1:
            self.walk.turn()
            self._note(cycle, True)
        for drive in self.drives[self.outward * self.drives > start]:
            if not self.walk.to(float(drive)):
                return False
            self._note(cycle, True)
        return True

    def _back(self, cycle: int) -> bool:
        """Back until there is no force left."""
        self.walk.turn()
        step = abs(self.drives[-1] - self.drives[-2])
        while self.outward * self._load() > 0:
            drive = self.walk.last.drive - self.outward * step
            met = self.walk.towards(drive)
            if not met.converged:
                if not self.walk.to(drive):
                    return False
            elif self.outward * self.driven.load(met.state, drive) > 0:
                self.walk.take(Known(drive, met.state))
            else:
                known = [*self.walk.known, Known(drive, met.state)]
                self.walk.take(without_load(self.driven, known, len(known) - 2))
                self._note(cycle, False)
                break
            self._note(cycle, False)
        return True

    def _load(self) -> float:
        return self.driven.load(self.walk.last.state, self.walk.last.drive)

    def _note(self, cycle: int, loading: bool) -> None:
        drive, state = self.walk.last
        lost = sum(self.driven.spent)
        load, stored = self._load(), self.driven.stored(state)
        self.rows.append((cycle, loading, drive, load, stored, lost))
        self.shapes.append(state.points)
        if self.on_progress is not None:
            share = (cycle - 1 + 0.5 * (not loading)) / self.count
            self.on_progress(share, f"cycle {cycle} of {self.count}")


def _curve(
    pulled: _Pulled, ends: tuple[int, int], paper: Paper, converged: bool, slips: Floats
) -> PullCurve:
    model: BarHingeModel = pulled.driven.model
    if not pulled.rows:
        raise PatternError(
            "The folded form is not in equilibrium: its facets are not flat, or it has a crease of "
            "no width; check the pattern."
        )
    assert model.unit_joule is not None
    cycle, loading, drive, load, stored, lost = np.array(pulled.rows, dtype=float).T
    work = np.concatenate([[0.0], np.cumsum(np.diff(drive) * (load[1:] + load[:-1]) / 2)])
    joule = model.unit_joule
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
        coords=np.stack(pulled.shapes) @ pulled.driven.axes.T * model.unit_mm,
        slips=slips,
        converged=converged,
    )
