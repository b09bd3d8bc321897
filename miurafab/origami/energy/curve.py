"""The energy of a folded sheet on its way to flat, with barrier and stable states.

The torque on the driven crease is the slope of the energy, dE/d rho. Its zeros are the stable
states and the barriers; regula falsi finds them between the steps of the path
(:mod:`miurafab.origami.energy.path`). A path of few steps is followed in shorter ones, since in a
long step the sheet may go over a barrier, or jump to another shape, unseen.

The energy of a sheet that folds rigidly is zero along the path. The less flat-foldable a sheet is,
the higher is the barrier that keeps its folded form (Dudte et al., Nature Materials 15 (2016)).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import BarHingeModel, sheet_model
from miurafab.origami.energy.continuation import LONGEST, Known, between, without_load
from miurafab.origami.energy.equilibrium import solve
from miurafab.origami.energy.path import (
    NEARLY_FLAT,
    Path,
    Progress,
    Traced,
    path_of,
    towards,
    trace,
)
from miurafab.origami.energy.result import EnergyResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NOISE = 1e-15
"""Energies up to this, in the model's unit, are rounding; the sheet then folds rigidly."""
FINE = 24
"""The fewest steps in which a path is followed, however few of its shapes are asked for."""
SMALL_TURN = 1e-3
"""Radians to either side of the folded form, for the difference quotient of its stiffness."""


@dataclass(frozen=True)
class StableState:
    """A local minimum of the energy along the path: the driven fold ``angle`` in radians."""

    angle: float
    energy: float


@dataclass(frozen=True, eq=False, repr=False)
class EnergyCurve(EnergyResult):
    """The energy along ``path``, with its barrier and stable states.

    Attributes
    ----------
    path : Path
        The states between folded and flat. Its ``model`` sets the unit of all energies.
    crease : int
        The driven edge of the pattern.
    barrier : float
        The highest maximum of the energy between the folded form and flat, 0 without a maximum.
    barrier_angle : float or None
        The fold angle of the driven crease at the barrier, radians; None without a barrier.
    stable : tuple of StableState
        The local minima from the folded form to flat, empty for a rigid sheet.
    rigid : bool
        Whether the sheet folds without bending, so that it prefers no state.
    flat_energy : float
        The energy of the flat sheet.
    stiffness : float
        The second derivative of the energy by the driven angle in the folded form, per radian
        squared.
    """

    path: Path
    crease: int
    barrier: float
    barrier_angle: float | None
    stable: tuple[StableState, ...]
    rigid: bool
    flat_energy: float
    stiffness: float

    @property
    def converged(self) -> bool:
        """Whether the way to flat was found."""
        return self.path.converged

    @property
    def bistable(self) -> bool:
        """Whether a barrier lies between two stable states."""
        return self.barrier > 0 and len(self.stable) > 1

    def _table(self) -> str:
        from miurafab.origami.energy.plot import energy_table

        return energy_table(self)

    def _draw(self, axes: Axes, title: str) -> None:
        from miurafab.origami.energy.plot import draw_energy

        draw_energy(self, axes, title)

    def _summary(self) -> str:
        said = "rigid" if self.rigid else "bistable" if self.bistable else "one stable state"
        unit = self.path.model.unit_joule
        barrier = f"{self.barrier * (unit or 1.0):.3g} {'k_f L' if unit is None else 'J'}"
        return f"{said}, barrier {barrier}, {len(self.path.drives)} steps"

    def _facts(self) -> Mapping[str, object]:
        report = self.report()
        return {key: report[key] for key in report if not isinstance(report[key], list)}

    def verdict(self) -> str:
        """The result in one sentence."""
        if not self.converged:
            reached = math.degrees(abs(self.path.drives[-1]))
            return (
                f"The path was lost at {reached:.1f} degrees, where the sheet jumps to another "
                "shape; take more `steps`, or drive another `crease`."
            )
        if self.rigid:
            return "It folds rigidly: no energy is stored on the way to flat."
        if self.bistable:
            return "It is bistable: a barrier on the way to flat holds the folded form."
        return "It is not bistable: there is no barrier on the way to flat."

    def report(self) -> dict[str, Any]:
        """The curve's numbers, ready for JSON; energies in joules if a material was given."""
        model = self.path.model
        unit = 1.0 if model.unit_joule is None else model.unit_joule
        angle = self.barrier_angle
        return {
            "converged": self.converged,
            "barrier": self.barrier * unit,
            "barrier_angle_deg": None if angle is None else math.degrees(angle),
            "bistable": self.bistable,
            "rigid": self.rigid,
            "stable_states": [
                {"angle_deg": math.degrees(state.angle), "energy": state.energy * unit}
                for state in self.stable
            ],
            "stiffness": self.stiffness * unit,
            "flat_energy": self.flat_energy * unit,
            "highest_energy": float(self.path.energies.max()) * unit,
            "energy_unit": "k_f L" if model.unit_joule is None else "J",
            "crease": self.crease,
            "folded_angle_deg": math.degrees(self.path.drives[0]),
            "last_angle_deg": math.degrees(self.path.drives[-1]),
            "steps": len(self.path.drives) - 1,
        }


def energy_curve(
    pattern: CreasePattern,
    steps: int = 40,
    *,
    crease: int | None = None,
    model: BarHingeModel | None = None,
    on_progress: Progress | None = None,
) -> EnergyCurve:
    """The energy of ``pattern`` from its folded form to nearly flat, with barrier and stable
    states; arguments, errors and path as for
    :func:`~miurafab.origami.energy.path.folding_path`. Barrier and states are those of a path of
    at least :data:`FINE` steps, of which the curve has every so manyth.
    """
    model = sheet_model(pattern) if model is None else model
    finer = math.ceil(FINE / max(steps, 1))
    traced = trace(model, crease, towards(NEARLY_FLAT, finer * steps), on_progress)
    path = path_of(traced)
    flat = np.column_stack([pattern.vertices_coords, np.zeros(len(pattern.vertices_coords))])
    flat_energy = model.energy(flat / model.unit_mm)
    rigid = bool(path.energies.max() <= NOISE)
    maxima, minima = ([], []) if rigid else _stationary(traced, path)
    ends = []
    towards_flat = -math.copysign(1.0, path.drives[0])
    if not rigid and path.converged and path.loads[-1] * towards_flat < 0:
        ends = [StableState(0.0, flat_energy)]
    at_rest = float(path.energies[0]) if path.energies[0] > NOISE else 0.0
    folded = [] if rigid else [StableState(float(path.drives[0]), at_rest)]
    top = max(maxima, key=lambda state: state.energy, default=None)
    return EnergyCurve(
        path=path.every(finer),
        crease=int(model.creases_edges[traced.place]),
        barrier=0.0 if top is None else top.energy,
        barrier_angle=None if top is None else top.angle,
        stable=(*folded, *minima, *ends),
        rigid=rigid,
        flat_energy=flat_energy,
        stiffness=_stiffness(traced),
    )


def _stationary(traced: Traced, path: Path) -> tuple[list[StableState], list[StableState]]:
    """The maxima and minima of the energy strictly between the first and the last state."""
    maxima: list[StableState] = []
    minima: list[StableState] = []
    turns = np.flatnonzero(path.loads[1:-1] * path.loads[2:] < 0) + 1
    for k in turns:
        first = max(0, min(int(k) + 1 - LONGEST // 2, len(path.drives) - LONGEST))
        near = slice(first, first + LONGEST)
        known = [
            Known(float(drive), state)
            for drive, state in zip(path.drives[near], traced.states[near], strict=True)
        ]
        rising = path.loads[k] * (traced.drives[k + 1] - traced.drives[k]) > 0
        states = maxima if rising else minima
        left, right = known[int(k) - first : int(k) - first + 2]
        found = without_load(traced.driven, left, right, between(traced.driven, known))
        states.append(StableState(found.drive, traced.driven.model.energy(found.state.points)))
    return maxima, minima


def _stiffness(traced: Traced) -> float:
    """d load / d drive at the first state, by a central difference."""
    driven, _, drives, states = traced
    loads, factored = [], None
    for turn in (-SMALL_TURN, SMALL_TURN):
        drive = float(drives[0]) + turn
        solution = solve(driven, states[0], drive, factored)
        factored = solution.factored
        loads.append(driven.load(solution.state, drive) if solution.converged else math.nan)
    return (loads[1] - loads[0]) / (2 * SMALL_TURN)
