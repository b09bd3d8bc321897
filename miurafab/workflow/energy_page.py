"""The page of a sheet that is unfolded or pulled, with its energy or its force beside it.

It is the page of ``fold`` with the states of :func:`miurafab.energy`: from nearly flat to the
folded form, or out and back as often as the sheet is pulled.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from miurafab.errors import InputError
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cut_open import cut_open
from miurafab.origami.energy.curve import EnergyCurve
from miurafab.origami.energy.pieces import PieceEnergies
from miurafab.origami.energy.pull import PullCurve
from miurafab.origami.folding.kinematics import facet_strain
from miurafab.origami.quality import crease_angles
from miurafab.workflow.page import Curve, Slider, write_page

_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def write_energy_page(
    result: EnergyCurve | PieceEnergies | PullCurve,
    pattern: CreasePattern,
    path: Path,
    *,
    title: str = "",
) -> None:
    """Write the page of ``result``, which :func:`miurafab.energy` found for ``pattern``.

    Raises :class:`~miurafab.errors.InputError` for the energies of several pieces, and for a sheet
    that was lost on its first step.
    """
    if isinstance(result, PieceEnergies):
        raise InputError(
            f"{path.name} is not written: the page shows one piece, and this pattern has several; "
            "write a plot (.png, .svg) or a table (.csv)."
        )
    pattern = cut_open(pattern)  # as it was unfolded or pulled
    frames, slider = _pulled(result) if isinstance(result, PullCurve) else _unfolded(result)
    slider = replace(
        slider,
        fold_angles=_fold_angles(pattern, frames),
        strain=facet_strain(pattern, frames),
    )
    write_page(path, title=title or pattern.name, pattern=pattern, motion=frames, slider=slider)


def _pulled(result: PullCurve) -> tuple[Floats, Slider]:
    stretch = result.extensions
    names = tuple(
        f"cycle {cycle}, {force:.3g} N at {mm:.3g} mm"
        for cycle, force, mm in zip(
            result.cycles.tolist(), result.forces.tolist(), stretch.tolist(), strict=True
        )
    )
    one, other = result.ends
    return result.coords, Slider(
        names,
        word="Pulling",
        curve=Curve(
            f"Force between vertices {one} and {other}, over how far they are pulled apart",
            result.forces,
            f"{np.abs(result.forces).max():.3g} N",
            places=stretch,
            bottom=f"{stretch[int(np.argmax(np.abs(stretch)))]:.3g} mm",
        ),
    )


def _unfolded(result: EnergyCurve) -> tuple[Floats, Slider]:
    """From the last state of the path, nearly flat, to the folded form."""
    path = result.path
    unit = path.model.unit_joule
    energies = path.energies[::-1] * (unit or 1.0)
    turned = np.degrees(np.abs(path.drives[: len(energies)]))[::-1].tolist()
    most = float(energies.max())
    said = ("in k_f times the mean edge", f"{most:.2g} k_f L")
    if unit is not None:
        said = ("in joules", _joules(most))
    return path.coords[::-1], Slider(
        (*(f"crease {result.crease} at {angle:.3g}°" for angle in turned[:-1]), "the folded form"),
        start=len(turned) - 1,
        curve=Curve(f"Energy of creases and facets, {said[0]}", energies, said[1]),
    )


def _joules(energy: float) -> str:
    """An energy with the unit in which it is a number of usual size."""
    factor, prefix = next((each for each in _PREFIXES if energy >= each[0]), _PREFIXES[-1])
    return f"{energy / factor:.3g} {prefix}J"


def _fold_angles(pattern: CreasePattern, frames: Floats) -> Floats:
    """(T, E) measured in the frames, radians."""
    angles = np.zeros((len(frames), len(pattern.edges_vertices)))
    inner = (pattern.edges_faces >= 0).all(axis=1)
    for frame, points in enumerate(frames):
        angles[frame, inner] = crease_angles(replace(pattern, folded_coords=points))
    return angles
