"""The first shape of a flat sheet that starts to fold: heights over the plane, by linear algebra.

Near flat a fold angle is linear in the heights z of the vertices, rho = g.z, and lengths do not
change to first order. The seed lets every crease come as near to its rest angle as it can,

    z = argmin sum l_c (g_c.z - rho_c)^2 + w sum l_f (g_f.z)^2,

over creases c and the hinges f that bend facets. At a vertex whose letters can fold all creases
follow. So the creases whose sign the seed does not reproduce tell of a wrong letter, or of a
pattern that folds one crease after the other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from miurafab.geometry.arrays import Bools, Floats
from miurafab.geometry.sparse import factor_symmetric
from miurafab.origami.energy.bar_hinge import BarHingeModel
from miurafab.origami.energy.hinges import hinge_gradients

FACET_WEIGHT = 10.0
"""w: how much less facets shall bend than creases miss their rest angle."""
RIGID_MOTION = 1e-9
"""A stiffness against heights as such, which leaves out the motions of the plane."""


class LinearSeed(NamedTuple):
    """``heights`` (V,) for the whole rest angles, and the creases that ``follow`` their sign (n,),
    in the order of the hinges with a rest angle.
    """

    heights: Floats
    follow: Bools


def linear_seed(model: BarHingeModel) -> LinearSeed:
    """The seed of ``model``, whose points are flat and whose creases rest at their fold angles."""
    _, gradient = hinge_gradients(model.points, model.hinges)
    creases = model.rest != 0
    base = model.points[model.hinges[:, :2]]
    weight = np.linalg.norm(base[:, 1] - base[:, 0], axis=1)
    weight = np.where(creases, weight, FACET_WEIGHT * weight)
    count = len(model.points)
    rows = np.repeat(np.arange(len(gradient)), 4)
    entries = (gradient[:, :, 2].ravel(), (rows, model.hinges.ravel()))
    lean = sparse.coo_array(entries, shape=(len(gradient), count)).tocsc()
    normal = (lean.T * weight) @ lean
    # beside facets without width the entries are so large that a smaller one is lost in rounding
    least = RIGID_MOTION + float(np.finfo(np.float64).eps * normal.diagonal().max())
    normal = normal + least * sparse.eye_array(count)
    factor = factor_symmetric(sparse.csc_array(normal))
    heights = factor.solve(lean.T @ (weight * model.rest))
    turned = np.asarray(lean @ heights)
    return LinearSeed(heights, (turned * model.rest)[creases] > 0)
