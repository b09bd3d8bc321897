"""An energy curve as a table and as a plot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from miurafab.origami.energy.path import EnergyCurve
from miurafab.origami.plotting import BLUE, GREEN, ORANGE, picture_bytes, without_frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = (6.4, 4.0)


def energy_table(curve: EnergyCurve) -> str:
    """The path as CSV: step, driven fold angle in degrees, energy, and torque per radian."""
    unit = curve.path.model.unit_joule
    named = "k_f_L" if unit is None else "J"
    columns = (
        np.degrees(curve.path.drives),
        curve.path.energies * (unit or 1.0),
        curve.path.loads * (unit or 1.0) + 0.0,  # no -0.0
    )
    lines = [f"step,angle_deg,energy_{named},torque_{named}_per_rad"]
    for step, values in enumerate(zip(*columns, strict=True)):
        lines.append(",".join([str(step), *(repr(float(value)) for value in values)]))
    return "\n".join(lines) + "\n"


def energy_plot(curve: EnergyCurve, kind: str, title: str) -> bytes:
    """The plot as a picture, ``kind`` png or svg; the same bytes for the same curve."""
    return picture_bytes(lambda axes: draw_energy(curve, axes[0], title), kind, SIZE)


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
    axes.set_xlabel("fold angle of the driven crease, from folded to flat (degrees)")
    per = "k$_f$ L" if curve.path.model.unit_joule is None else "J"
    axes.set_ylabel(f"energy ({per})")
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
    without_frame(axes)
