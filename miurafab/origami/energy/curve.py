"""The energy of a folded sheet on its way to flat, with barrier and stable states.

The torque on the driven crease is the slope of the energy, dE/d rho. Its zeros are the stable
states and the barriers; regula falsi finds them between the steps of the path
(:mod:`miurafab.origami.energy.path`). A step is halved where it is longer than a sixteenth of the
path, and where the energies at its ends and the torques there do not fit together without a turn
between them, as where the energy rises from the folded form and falls again in the first step.

The energy of a sheet that folds rigidly is zero along the path. The less flat-foldable a sheet is,
the higher is the barrier that keeps its folded form (Dudte et al., Nature Materials 15 (2016)).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import BarHingeModel, sheet_model
from miurafab.origami.energy.continuation import LONGEST, Known, follow, without_load
from miurafab.origami.energy.driven import Driven
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
LONGEST_STEP = 1.0 / 16.0
"""Of the whole path: the longest step between states at which the energy is looked at."""
LEAST_ENERGY = 1e-9
"""Of the largest energy: between states below it, turns are not looked for."""
MOST_HALVINGS = 6
"""How often a step is halved to find a turn of the energy in it."""
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
    :func:`~miurafab.origami.energy.path.folding_path`.
    """
    model = sheet_model(pattern) if model is None else model
    traced = trace(model, crease, towards(NEARLY_FLAT, steps), on_progress)
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
        path=path,
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
    points = _filled(traced, path)
    loads = np.array([point.load for point in points])
    turns = np.flatnonzero(loads[1:-1] * loads[2:] < 0) + 1
    for k in turns.tolist():
        first = max(0, min(k + 1 - LONGEST // 2, len(points) - LONGEST))
        known = [point.known for point in points[first : first + LONGEST]]
        rising = loads[k] * (points[k + 1].known.drive - points[k].known.drive) > 0
        states = maxima if rising else minima
        found = without_load(traced.driven, known, k - first)
        states.append(StableState(found.drive, traced.driven.model.energy(found.state.points)))
    return maxima, minima


class _Point(NamedTuple):
    """A state on the path, with its energy and its load, the slope of the energy by the drive."""

    known: Known
    energy: float
    load: float


def _filled(traced: Traced, path: Path) -> list[_Point]:
    """The states of the path, and more between two of them if the energy may turn there unseen."""
    drives = path.drives.tolist()
    known = [Known(*each) for each in zip(drives, traced.states, strict=True)]
    energies, loads = path.energies.tolist(), path.loads.tolist()
    loads[0] = 0.0  # the folded form is at rest, but for rounding
    points = [_Point(*each) for each in zip(known, energies, loads, strict=True)]
    fill = _Fill(
        traced.driven,
        LONGEST_STEP * abs(drives[-1] - drives[0]),
        max(NOISE, LEAST_ENERGY * float(path.energies.max())),
    )
    filled = points[:1]
    for point in points[1:]:
        filled += [*fill.between(filled[-1], point, MOST_HALVINGS), point]
    return filled


class _Fill(NamedTuple):
    """What fills a path: no step is to be longer than ``longest``, and none may hide a turn between
    energies of which one is above ``least``.
    """

    driven: Driven
    longest: float
    least: float

    def between(self, left: _Point, right: _Point, halvings: int) -> list[_Point]:
        """States between two, the step halved up to so many times."""
        drives = np.array([left.known.drive, (left.known.drive + right.known.drive) / 2])
        if not halvings or not (
            2 * abs(drives[1] - drives[0]) > self.longest
            or (max(left.energy, right.energy) > self.least and _hides_turn(left, right))
        ):
            return []
        way = follow(self.driven, left.known.state, drives)
        if len(way) < len(drives):
            return []
        middle, drive = way[-1], float(drives[1])
        load = self.driven.load(middle, drive)
        point = _Point(Known(drive, middle), self.driven.model.energy(middle.points), load)
        before = self.between(left, point, halvings - 1)
        return [*before, point, *self.between(point, right, halvings - 1)]


def _hides_turn(left: _Point, right: _Point) -> bool:
    """Whether the energy may turn between two states though the sign of the load does not tell.

    Of the cubic with their energies and loads it is certain that it does not turn if no load is
    more than three times the mean slope, and of its sign (F. N. Fritsch and R. E. Carlson, Monotone
    piecewise cubic interpolation, SIAM J. Numer. Anal. 17 (1980)).
    """
    if left.load * right.load < 0:
        return False
    slope = (right.energy - left.energy) / (right.known.drive - left.known.drive)
    return any(load * slope < 0 or abs(load) > 3 * abs(slope) for load in (left.load, right.load))


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
