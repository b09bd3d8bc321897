"""Creases that yield: rate-independent plasticity with linear kinematic hardening.

A crease of stiffness k is folded by e = rho - rho_0 beyond its first rest angle rho_0. It has
slipped by p: so far has its rest angle moved. Stored is

    W(e, p) = k/2 (e - p)^2 + k/2 H p^2,   H = h / (1 - h),

and the slip p moves only while the torque on it reaches k theta_y:

    -dW/dp = k s,   s = e - p - H p,   |s| <= theta_y.

From the slip p_n of the last state, the next is the minimum of W + k theta_y |p - p_n| over p (one
step of backward Euler):

    p = p_n + (1 - h) over,   over = sign(s_n) max(0, |s_n| - theta_y),   s_n = e - p_n - H p_n,

with torque dW/de = k (e - p) and slope k, or h k where it slips. So h is the part of the stiffness
that is left, and k theta_y |p - p_n| is dissipated, which is exact for a crease that turns one way
within the step. Of each step the work of the load is what is stored and dissipated more.

The law is the standard one (J. C. Simo and T. J. R. Hughes, Computational Inelasticity, 1998,
chapter 1). It knows no time: creases that relax or creep are not described.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.origami.energy.driven import Driven
from miurafab.origami.energy.equilibrium import EquilibriumState
from miurafab.origami.energy.hinges import hinge_angles


@dataclass(frozen=True, eq=False)
class YieldingDriven(Driven):
    """A driven model without guides, whose hinges yield at ``yields`` (H,), infinite for elastic.

    It remembers: ``slips`` (H,) are those of the last state on the path, and change with
    :meth:`arrive`.
    """

    yields: Floats = field(kw_only=True)
    hardening: float = field(kw_only=True)

    @cached_property
    def slips(self) -> Floats:
        """(H,) radians, 0 at first."""
        return np.zeros(len(self.model.hinges))

    @property
    def _more(self) -> float:
        """H."""
        return self.hardening / (1 - self.hardening)

    @cached_property
    def stiffest(self) -> float:
        """The stiffness of the stiffest hinge, at least 1."""
        return float(self.model.stiffness.max(initial=1.0))

    def moments(self, angle: Floats, target: float) -> tuple[Floats, Floats]:
        """The moments (H,) at fold angles ``angle`` (H,), and their slopes."""
        k, over = self.model.stiffness, self._over(angle)
        slip = self.slips + (1 - self.hardening) * over
        slope = np.where(over != 0, self.hardening * k, k)
        return k * (angle - self.model.rest - slip), slope

    def _over(self, angle: Floats) -> Floats:
        """(H,) how far each hinge is beyond its yield angle."""
        s = angle - self.model.rest - (1 + self._more) * self.slips
        return np.asarray(np.sign(s) * np.maximum(np.abs(s) - self.yields, 0.0))

    @cached_property
    def spent(self) -> list[float]:
        """What each step on the path has dissipated, in the unit of the model."""
        return []

    def arrive(self, state: EquilibriumState) -> None:
        """Let the hinges slip to their angles at ``state``."""
        angle = hinge_angles(state.points, self.model.hinges)
        slip = (1 - self.hardening) * self._over(angle)
        yielded = np.flatnonzero(slip)
        lost = self.model.stiffness[yielded] * self.yields[yielded] * np.abs(slip[yielded])
        self.slips[:] += slip
        self.spent.append(float(lost.sum()))

    def stored(self, state: EquilibriumState) -> float:
        """The energy at the last accepted ``state``."""
        model, slip = self.model, self.slips
        bent = hinge_angles(state.points, model.hinges) - model.rest - slip
        bending = 0.5 * float((model.stiffness * (bent**2 + self._more * slip**2)).sum())
        return bending + model.stretching(state.points)
