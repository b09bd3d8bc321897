"""Energy curves as a table and as a plot: of one sheet, or of every piece of a pattern."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from miurafab.origami.energy.curve import EnergyCurve
from miurafab.origami.plotting import BLUE, GREEN, ORANGE, without_frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Pieces = Sequence[tuple[int, EnergyCurve]]
"""The curves of pieces, by the number of the piece."""


def energy_table(curve: EnergyCurve) -> str:
    """The path as CSV: step, driven fold angle in degrees, energy, and torque per radian."""
    return "\n".join([_head(curve), *_rows(curve)]) + "\n"


def pieces_table(curves: Pieces) -> str:
    """The paths as one CSV, the number of the piece before each row."""
    rows = [f"{piece},{row}" for piece, curve in curves for row in _rows(curve)]
    return "\n".join([f"piece,{_head(curves[0][1])}", *rows]) + "\n"


def _head(curve: EnergyCurve) -> str:
    named = "k_f_L" if curve.path.model.unit_joule is None else "J"
    return f"step,angle_deg,energy_{named},torque_{named}_per_rad"


def _rows(curve: EnergyCurve) -> list[str]:
    unit = curve.path.model.unit_joule or 1.0
    columns = (
        np.degrees(curve.path.drives),
        curve.path.energies * unit,
        curve.path.loads * unit + 0.0,  # no -0.0
    )
    return [
        ",".join([str(step), *(repr(float(value)) for value in values)])
        for step, values in enumerate(zip(*columns, strict=True))
    ]


def draw_energy(curve: EnergyCurve, axes: Axes, title: str = "") -> None:
    """The energy over the driven fold angle, with barrier and stable states."""
    unit = curve.path.model.unit_joule or 1.0
    angles = np.abs(np.degrees(curve.path.drives))
    axes.plot(angles, curve.path.energies * unit, color=BLUE, lw=1.8, label="equilibrium path")
    if curve.barrier_angle is not None:
        at = abs(math.degrees(curve.barrier_angle))
        label = f"barrier {curve.barrier * unit:.3g} at {at:.1f}°"
        axes.plot([at], [curve.barrier * unit], "^", color=ORANGE, label=label)
    if curve.stable:
        axes.plot(
            [abs(math.degrees(state.angle)) for state in curve.stable],
            [state.energy * unit for state in curve.stable],
            "o",
            color=GREEN,
            label="stable states",
            clip_on=False,
            zorder=3,
        )
    axes.set_xlim(max(angles), 0)
    if curve.rigid:
        axes.set_ylim(-1, 1)
        axes.set_yticks([0])
        axes.set_title(f"{title}: folds rigidly, without energy".lstrip(": "))
    else:
        axes.set_ylim(bottom=min(0.0, float(curve.path.energies.min()) * unit))
        axes.set_title(title)
        axes.legend(frameon=False)
    _label(axes, curve)


def draw_pieces(curves: Pieces, axes: Axes, title: str = "") -> None:
    """The energy of each piece over its driven fold angle, with its barrier."""
    for piece, curve in curves:
        unit = curve.path.model.unit_joule or 1.0
        angles = np.abs(np.degrees(curve.path.drives))
        (line,) = axes.plot(angles, curve.path.energies * unit, lw=1.4, label=f"piece {piece}")
        if curve.barrier_angle is not None:
            at = abs(math.degrees(curve.barrier_angle))
            axes.plot([at], [curve.barrier * unit], "^", color=line.get_color())
    axes.set_xlim(max(abs(math.degrees(curve.path.drives[0])) for _, curve in curves), 0)
    if all(curve.rigid for _, curve in curves):
        axes.set_ylim(-1, 1)
        axes.set_yticks([0])
        title = f"{title}: all pieces fold rigidly, without energy".lstrip(": ")
    else:
        axes.set_ylim(bottom=0.0)
        axes.legend(frameon=False, fontsize=8, ncols=1 + len(curves) // 13)
    axes.set_title(title)
    _label(axes, curves[0][1])


def _label(axes: Axes, curve: EnergyCurve) -> None:
    axes.set_xlabel("fold angle of the driven crease, from folded to flat (degrees)")
    per = "k$_f$ L" if curve.path.model.unit_joule is None else "J"
    axes.set_ylabel(f"energy ({per})")
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
    without_frame(axes)
