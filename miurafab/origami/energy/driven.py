"""A sheet with one driven quantity: the fold angle of a crease, or a distance.

Parts of a sheet that hang on one crease, or on one facet, fold independently of the driven one. A
guide moves each of them: a stiff hinge at one of its creases, whose rest angle r follows the driven
angle s by the law of rigid folding, tan(r / 2) / tan(s / 2) constant. It holds without energy what
nothing else holds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.energy.equilibrium import Balance, Drive, EquilibriumState
from miurafab.origami.energy.hinges import hinge_angles, hinge_derivatives

GUIDE = 100.0
"""The stiffness of a guide. A facet on one crease leaves it at rest to 1e-13; two halves of a hypar
that share one facet turn it by 1e-6, the torque of a half over this stiffness."""


@dataclass(frozen=True, eq=False)
class Driven(Balance):
    """A model with one driven quantity: the fold angle of the hinge ``stencil`` (4,), or the
    distance between the two vertices of ``stencil`` (2,).

    ``guided`` (m, 4) are hinges that go with the driven fold angle.
    """

    stencil: Ints
    guided: Ints = field(default_factory=lambda: np.empty((0, 4), dtype=np.int64))

    def value(self, points: Floats) -> float:
        """The driven quantity at ``points`` (V, 3)."""
        if len(self.stencil) == 4:
            return float(hinge_angles(points, self.stencil[None])[0])
        return float(np.linalg.norm(points[self.stencil[1]] - points[self.stencil[0]]))

    def load(self, state: EquilibriumState, target: float) -> float:
        """dE / d target: what drives the driven quantity, and the guides with it."""
        turned = hinge_angles(state.points, self.guided) - self._guides(target)
        step = 1e-6
        rate = (self._guides(target + step) - self._guides(target - step)) / (2 * step)
        return -state.mu - GUIDE * float(turned @ rate)

    @property
    def drive_stencil(self) -> Ints:
        """The vertices of the driven quantity."""
        return self.stencil

    @cached_property
    def hinges(self) -> Ints:
        """The hinges of the model, then the guides."""
        return np.concatenate([self.model.hinges, self.guided])

    def moments(self, angle: Floats, target: float) -> tuple[Floats, Floats]:
        """The moments and slopes of hinges and guides."""
        rest = np.concatenate([self.model.rest, self._guides(target)])
        return self._stiffness * (angle - rest), self._stiffness

    def drive(self, points: Floats, target: float) -> Drive:
        """The driven fold angle or distance."""
        if len(self.stencil) == 4:
            angle, gradients, hessians = hinge_derivatives(points, self.stencil[None])
            return Drive(float(angle[0]), gradients[0], hessians[0].swapaxes(1, 2))
        apart = points[self.stencil[1]] - points[self.stencil[0]]
        distance = float(np.linalg.norm(apart))
        along = apart / distance
        across = (np.eye(3) - np.outer(along, along)) / distance
        signs = np.array([[1.0, -1.0], [-1.0, 1.0]])
        return Drive(distance, np.stack([-along, along]), signs[:, :, None, None] * across)

    def _guides(self, target: float) -> Floats:
        """(m,) the rest angles of the guided hinges, with the driven angle at ``target``."""
        if not len(self.guided):
            return np.empty(0)
        return np.asarray(2 * np.arctan(self._ratios * math.tan(target / 2)))

    @cached_property
    def _ratios(self) -> Floats:
        """(m,) tan(r / 2) / tan(s / 2) in the folded form."""
        half = np.tan(hinge_angles(self.model.points, self.guided) / 2)
        return np.asarray(half / math.tan(self.value(self.model.points) / 2))

    @cached_property
    def _stiffness(self) -> Floats:
        return np.concatenate([self.model.stiffness, np.full(len(self.guided), GUIDE)])
