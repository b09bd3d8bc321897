"""The energy of a pattern of several pieces: each folds by itself and has a curve of its own.

All curves have one unit: the mean edge of the whole pattern stands for L. A piece without a crease,
such as a cap of one facet, has no curve.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.errors import InputError
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import UNCREASED, CreasePattern
from miurafab.origami.energy.bar_hinge import BarHingeModel, Paper, sheet_model
from miurafab.origami.energy.curve import EnergyCurve, energy_curve
from miurafab.origami.energy.path import Progress
from miurafab.origami.energy.result import EnergyResult
from miurafab.origami.piece import Piece, pieces_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class PieceEnergies(EnergyResult):
    """The energy curves of the pieces of a pattern.

    Attributes
    ----------
    curves : tuple of (EnergyCurve or None)
        The curve of each piece, None for a piece without a crease. Edges are numbered as in the
        whole pattern.
    facets : tuple of int
        The number of facets of each piece.
    """

    curves: tuple[EnergyCurve | None, ...]
    facets: tuple[int, ...]

    @property
    def moving(self) -> tuple[tuple[int, EnergyCurve], ...]:
        """The pieces that have a curve, by number."""
        return tuple((n, curve) for n, curve in enumerate(self.curves) if curve is not None)

    @property
    def converged(self) -> bool:
        """Whether the way to flat was found for every piece."""
        return all(curve.converged for _, curve in self.moving)

    @property
    def rigid(self) -> bool:
        """Whether every piece folds without bending."""
        return all(curve.rigid for _, curve in self.moving)

    def _table(self) -> str:
        from miurafab.origami.energy.plot import pieces_table

        return pieces_table(self.moving)

    def _draw(self, axes: Axes, title: str) -> None:
        from miurafab.origami.energy.plot import draw_pieces

        draw_pieces(self.moving, axes, title)

    def _summary(self) -> str:
        return f"{len(self.curves)} pieces, {self.verdict()}"

    def _facts(self) -> Mapping[str, object]:
        return {
            f"piece {n}": "no crease" if curve is None else curve._summary()
            for n, curve in enumerate(self.curves)
        }

    def verdict(self) -> str:
        """The result in one sentence."""
        lost = [f"Piece {n}: {curve.verdict()}" for n, curve in self.moving if not curve.converged]
        if lost:
            return lost[0]
        if self.rigid:
            return "All pieces fold rigidly: no energy is stored on the way to flat."
        stable = sum(curve.bistable for _, curve in self.moving)
        return f"{stable} of {len(self.curves)} pieces {'is' if stable == 1 else 'are'} bistable."

    def report(self) -> dict[str, Any]:
        """The curves' numbers, ready for JSON: one object for each piece."""
        return {
            "converged": self.converged,
            "rigid": self.rigid,
            "pieces": [
                {
                    "piece": number,
                    "facets": facets,
                    **({"creases": 0} if curve is None else curve.report()),
                }
                for number, (curve, facets) in enumerate(zip(self.curves, self.facets, strict=True))
            ],
        }


def piece_models(
    pattern: CreasePattern, *, paper: Paper | None = None, crease_ratio: float = 0.0
) -> list[tuple[Piece, BarHingeModel | None]]:
    """The pieces of ``pattern`` with their models; None for a piece without a crease.

    The models number edges as ``pattern`` does. Arguments and errors are those of
    :func:`~miurafab.origami.energy.bar_hinge.sheet_model`, which also refuses a pattern none of
    whose pieces has a crease.
    """
    pieces = pieces_of(pattern)
    creased = [_has_crease(piece.pattern) for piece in pieces]
    if pattern.folded_coords is None or not any(creased):
        sheet_model(replace(pattern, pieces=None))
    assert pattern.folded_coords is not None
    unit = float(edge_lengths(pattern.folded_coords, pattern.edges_vertices).mean())
    found: list[tuple[Piece, BarHingeModel | None]] = []
    for piece, folds in zip(pieces, creased, strict=True):
        if not folds:
            found.append((piece, None))
            continue
        model = sheet_model(piece.pattern, paper=paper, crease_ratio=crease_ratio, unit_mm=unit)
        found.append((piece, replace(model, creases_edges=piece.edges[model.creases_edges])))
    return found


def energies_of_pieces(
    pattern: CreasePattern,
    steps: int = 40,
    *,
    crease: int | None = None,
    paper: Paper | None = None,
    crease_ratio: float = 0.0,
    on_progress: Progress | None = None,
) -> PieceEnergies:
    """The energy curve of each piece of ``pattern``.

    ``crease`` is the edge that is driven in its own piece; in the other pieces it is the main
    crease. Raises what :func:`~miurafab.origami.energy.curve.energy_curve` raises.
    """
    models = piece_models(pattern, paper=paper, crease_ratio=crease_ratio)
    if crease is not None and not any(
        model is not None and crease in model.creases_edges for _, model in models
    ):
        raise InputError(f"Edge {crease} is not a crease between two facets; drive another.")
    curves: list[EnergyCurve | None] = []
    for number, (piece, model) in enumerate(models):
        if model is None:
            curves.append(None)
            continue
        own = crease if crease is not None and crease in model.creases_edges else None
        progress = part_of(on_progress, number, len(models))
        curves.append(
            energy_curve(piece.pattern, steps, crease=own, model=model, on_progress=progress)
        )
    return PieceEnergies(tuple(curves), tuple(len(piece.facets) for piece, _ in models))


def part_of(on_progress: Progress | None, number: int, count: int) -> Progress | None:
    """The progress of the ``number``-th of ``count`` equal parts of a work."""
    if on_progress is None or count == 1:
        return on_progress
    return lambda part, note: on_progress((number + part) / count, f"piece {number}, {note}")


def _has_crease(pattern: CreasePattern) -> bool:
    inner = (pattern.edges_faces >= 0).all(axis=1)
    return bool((inner & ~np.isin(pattern.edges_assignment, UNCREASED)).any())
