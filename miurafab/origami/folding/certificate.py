"""Whether a pattern folds rigidly, for vertices of any degree: by projection onto rigid facets.

From a shape on its way, in which facets may be bent and creases pull, the nearest shape with rigid
facets is looked for: all sides and diagonals have their length in the flat pattern, and no facet is
bent about its diagonals,

    c(x) = 0,   rho_f(x) = 0,

by Gauss and Newton's iteration with steps of least length. Springs of creases count for nothing.
The sheet is rigid there if the residual vanishes and no crease moved far: otherwise the iteration
may have slid to another motion. A pattern folds rigidly if it is rigid in every frame of its way.

Facets that are all triangles are rigid wherever no side stretches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from miurafab.errors import PatternError
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import UNCREASED
from miurafab.origami.energy.bar_hinge import BarHingeModel, flat_model, has_folds
from miurafab.origami.energy.hinges import hinge_angles
from miurafab.origami.energy.ramp import Ramped, raised_diagonal
from miurafab.origami.folding.kinematics import RIGID, FoldingMotion, loop_mismatch, place
from miurafab.origami.folding.laying import laid_on_each_other
from miurafab.origami.piece import pieces_of

EXACT = 1e-14
"""A residual that ends the iteration: changes of length in mean edges, and radians."""
ROUNDS = 12
LEAST_LENGTH = 1e-9
"""The weight of the length of a step: it chooses among the motions that the facets leave free."""
MOVED = np.radians(1.0)
"""A crease that turns farther was on another motion."""


@dataclass(frozen=True)
class RigidCertificate:
    """What the projection found.

    ``rigid`` is whether every frame is rigid. ``state`` is the frame that decides, the first that
    is not rigid or that of the largest residual; ``residual`` the largest change of a length
    in mean edges, or bend of a facet in radians, that is left there; ``moved`` the farthest turn
    of a crease, radians.
    """

    rigid: bool
    state: float
    residual: float
    moved: float


class RigidFacets:
    """The facets of ``model`` (:func:`~miurafab.origami.energy.bar_hinge.flat_model`) as rigid."""

    def __init__(self, model: BarHingeModel) -> None:
        facets = len(model.hinges) - int((model.rest != 0).sum())
        bare = replace(
            model,
            hinges=model.hinges[:facets],
            stiffness=np.ones(facets),
            rest=np.zeros(facets),
            creases=model.hinges,
            compliance=np.ones(len(model.bars)),
        )
        self._free = Ramped(bare)

    def nearest(self, points: Floats) -> tuple[Floats, float]:
        """The shape (V, 3) nearest to ``points`` (V, 3), in the unit of the model, and what is
        left of c and rho_f there.
        """
        free = self._free
        axes = free.axes_at(points)
        turned = points @ axes
        best, least = turned, np.inf
        for _ in range(ROUNDS):
            strain = np.abs(free.model.strains(turned)).max(initial=0.0)
            left = max(strain, np.abs(hinge_angles(turned, free.hinges)).max(initial=0.0))
            if not left < least:
                break
            best, least = turned, float(left)
            if left <= EXACT:
                break
            gradient, matrix = free.gauss_newton(turned, 0.0)
            raised = raised_diagonal(matrix, LEAST_LENGTH)
            turned = turned - free.assembly.vectors(free.factored(raised).solve(gradient))
        return best @ axes.T, least


def certified(motion: FoldingMotion) -> tuple[FoldingMotion, RigidCertificate]:
    """``motion`` with rigid facets where it is rigid, or as it was, and the certificate.

    The frame in the middle is looked at first. The loop mismatch of a rigid motion is measured
    anew, by placing the facets one after the other at the fold angles.
    """
    pattern = motion.pattern
    models = [(p, flat_model(p.pattern)) for p in pieces_of(pattern) if has_folds(p.pattern)]
    rigid = [RigidFacets(model) for _, model in models]
    frames, angles = motion.frames.copy(), motion.fold_angles.copy()
    moving = np.flatnonzero(np.abs(motion.fold_angles).max(axis=1, initial=0.0) > 0)
    if not len(moving):
        raise PatternError("No crease of the pattern moves, so nothing can be said of its facets.")
    middle = moving[len(moving) // 2]
    worst = RigidCertificate(True, float(motion.states[middle]), 0.0, 0.0)
    for frame in [middle, *moving[moving != middle]]:
        residual, moved = 0.0, 0.0
        for (piece, model), facets in zip(models, rigid, strict=True):
            own = piece.vertices
            points, left = facets.nearest(frames[frame, own] / model.unit_mm)
            frames[frame, own] = points * model.unit_mm
            residual = max(residual, left)
            edges = piece.edges[model.creases_edges]
            before = motion.fold_angles[frame, edges]
            turn = hinge_angles(points, model.creases) - before
            turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
            moved = max(moved, float(np.abs(turn).max(initial=0.0)))
            angles[frame, edges] = before + turn
        found = RigidCertificate(
            bool(residual <= RIGID and moved <= MOVED),
            float(motion.states[frame]),
            float(residual),
            moved,
        )
        if not found.rigid:
            return motion, found
        worst = max(worst, found, key=lambda each: each.residual)
    # an edge within a facet does not turn
    angles[:, np.isin(pattern.edges_assignment, UNCREASED)] = 0.0
    mismatch = loop_mismatch(pattern, place(pattern, angles), angles)
    if mismatch.max(initial=0.0) > RIGID:
        return motion, replace(worst, rigid=False, residual=float(mismatch.max()))
    frames = laid_on_each_other(pattern, motion.states, frames)
    return replace(motion, frames=frames, fold_angles=angles, mismatch=mismatch), worst
