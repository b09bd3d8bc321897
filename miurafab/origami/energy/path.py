"""The quasi-static path of a folded sheet: one crease is driven, the rest is in equilibrium.

The crease goes from its angle in the folded form towards flat. At each step the whole sheet is in
static equilibrium (:mod:`miurafab.origami.energy.equilibrium`). The flat state is a branch point,
where very many motions meet, so the path stops a little short of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from miurafab.display import Shown
from miurafab.errors import InputError, PatternError
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import BarHingeModel, sheet_model
from miurafab.origami.energy.continuation import follow
from miurafab.origami.energy.driven import Driven
from miurafab.origami.energy.equilibrium import EquilibriumState
from miurafab.origami.energy.hinges import hinge_angles

Progress = Callable[[float, str], None]

NEARLY_FLAT = math.radians(2.5)
"""The last angle of the driven crease, radians, a little short of flat."""
_HALF_TURN = math.pi - 1e-3
"""Beyond this angle, radians, rounding decides the sign of a crease."""


@dataclass(frozen=True, eq=False, repr=False)
class Path(Shown):
    """n equilibria in a row, the first of them the folded form.

    ``coords`` (n, V, 3) in mm, in the axes of the folded form, with one triangle near the middle
    held still; ``drives`` (n,) the driven fold angle in radians, or the distance in mm;
    ``energies`` (n,) and ``loads`` (n,), the torque or force dE/d drive, in the units of ``model``.
    If ``converged`` is False, the path ends where the solver lost it.
    """

    coords: Floats
    drives: Floats
    energies: Floats
    loads: Floats
    converged: bool
    model: BarHingeModel

    def every(self, count: int) -> Path:
        """The path with one of ``count`` shapes, the first among them."""
        named = ("coords", "drives", "energies", "loads")
        return replace(self, **{name: getattr(self, name)[::count] for name in named})


def folding_path(
    pattern: CreasePattern,
    steps: int = 40,
    *,
    until: float = NEARLY_FLAT,
    crease: int | None = None,
    model: BarHingeModel | None = None,
    on_progress: Progress | None = None,
) -> Path:
    """The quasi-static path of ``pattern`` from its folded form, in steps + 1 shapes.

    The fold angle of one crease goes to +-``until`` radians in equal ``steps``: towards flat, or if
    ``until`` is above the folded angle, further closed. ``crease`` is the driven edge of the
    pattern, by default that of :func:`main_crease`; ``model`` defaults to
    :func:`~miurafab.origami.energy.bar_hinge.sheet_model`. Facets may bend on their shorter
    diagonals; the sheet does not stretch. Raises
    :class:`~miurafab.errors.PatternError` for a pattern without a folded form, and
    :class:`~miurafab.errors.InputError` for an edge that is no crease or is flat.
    """
    model = sheet_model(pattern) if model is None else model
    return path_of(trace(model, crease, towards(until, steps), on_progress))


def pulled_path(
    model: BarHingeModel,
    ends: tuple[int, int],
    strain: float,
    steps: int = 40,
    on_progress: Progress | None = None,
) -> Path:
    """The quasi-static path of a sheet whose vertices ``ends`` are pulled apart.

    At the end their distance has grown by the fraction ``strain``; if negative, they are pushed
    together. ``drives`` are distances in mm, ``loads`` forces in the energy's unit per mean edge.
    """
    driven = Driven(model, np.array(ends, dtype=np.int64))
    distance = driven.value(driven.rest.points)
    drives = np.linspace(distance, distance * (1 + strain), steps + 1)
    states = follow(driven, driven.rest, drives, on_progress)
    path = path_of(Traced(driven, -1, drives, states))
    return replace(path, drives=path.drives * model.unit_mm)


class Traced(NamedTuple):
    """A path as the solver sees it; ``place`` is the index of the driven crease in the model."""

    driven: Driven
    place: int
    drives: Floats
    states: list[EquilibriumState]


def towards(until: float, steps: int) -> Callable[[float], Floats]:
    """From a fold angle to +-``until`` radians, of the same sign, in equal ``steps``."""
    if steps < 1:
        raise InputError(f"`steps` is {steps}; the path needs at least one.")
    return lambda angle: np.linspace(angle, math.copysign(until, angle), steps + 1)


def trace(
    model: BarHingeModel,
    edge: int | None,
    drives: Callable[[float], Floats],
    on_progress: Progress | None = None,
) -> Traced:
    """The path on which the crease at ``edge``, or the main crease, goes through ``drives``.

    ``drives`` gives the fold angles, radians, from the angle in the folded form. Raises what
    :func:`folding_path` raises.
    """
    place = main_crease(model) if edge is None else _place_of(model, edge)
    driven = Driven(model, model.creases[place], model.creases[_guided(model, place)])
    angle = driven.value(driven.rest.points)
    if abs(angle) <= NEARLY_FLAT:
        raise InputError(
            f"The crease at edge {model.creases_edges[place]} is folded by only "
            f"{math.degrees(abs(angle)):.2g} degrees, too little to drive; take another `crease`."
        )
    goals = drives(angle)
    states = follow(driven, driven.rest, goals, on_progress)
    if not states:
        raise PatternError(
            "The folded form is not in equilibrium: its facets are not flat, or it has a crease of "
            "no width; check the pattern."
        )
    return Traced(driven, place, goals, states)


def main_crease(model: BarHingeModel) -> int:
    """The index in ``model.creases`` of the default driven crease, in the largest mechanism.

    Of the creases folded by the median fold angle or more, it is the nearest to the middle. Those
    folded by half a turn are left out, where there are others.
    """
    largest = np.bincount(model.mechanisms).argmax()
    return _main_of(model, np.flatnonzero(model.mechanisms == largest))


def _main_of(model: BarHingeModel, creases: Ints) -> int:
    angles = np.abs(hinge_angles(model.points, model.creases[creases]))
    open_ = angles < _HALF_TURN
    if (angles[open_] > NEARLY_FLAT).any():
        creases, angles = creases[open_], angles[open_]
    middle = model.points[model.creases[creases, :2]].mean(axis=1) - model.points.mean(axis=0)
    away = np.linalg.norm(middle, axis=1)
    return int(creases[np.argmin(np.where(angles >= np.median(angles), away, np.inf))])


def _guided(model: BarHingeModel, place: int) -> list[int]:
    """The main crease of each mechanism but that of the crease at ``place``."""
    own = model.mechanisms[place]
    numbers = np.unique(model.mechanisms).tolist()
    return [
        _main_of(model, np.flatnonzero(model.mechanisms == number))
        for number in numbers
        if number != own
    ]


def _place_of(model: BarHingeModel, edge: int) -> int:
    places = np.flatnonzero(model.creases_edges == edge)
    if not len(places):
        raise InputError(f"Edge {edge} is not a crease between two facets; drive another.")
    return int(places[0])


def path_of(traced: Traced) -> Path:
    """The shapes, energies and loads of a traced path."""
    driven, _, drives, states = traced
    model = driven.model
    turned = np.stack([state.points for state in states])
    return Path(
        coords=turned @ driven.axes.T * model.unit_mm,
        drives=drives[: len(states)],
        energies=np.array([model.energy(points) for points in turned]),
        loads=np.array([driven.load(*pair) for pair in zip(states, drives, strict=False)]),
        converged=len(states) == len(drives),
        model=model,
    )
