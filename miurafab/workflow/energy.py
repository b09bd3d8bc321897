"""``miurafab energy`` as functions: the energy of a pattern in a material, as a plot or a table."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np

from miurafab.errors import InputError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import Paper, sheet_model
from miurafab.origami.energy.path import EnergyCurve, Progress, energy_curve
from miurafab.profiles import Material, load_material
from miurafab.workflow import plotting

# Colours that colour-blind eyes keep apart (Okabe and Ito, "Color Universal Design", 2008).
CURVE, BARRIER, STABLE = "#0072b2", "#d55e00", "#009e73"


def energy(
    pattern: CreasePattern,
    steps: int = 40,
    *,
    material: Material | str | None = None,
    crease: int | None = None,
    crease_ratio: float = 0.0,
    on_progress: Progress | None = None,
) -> EnergyCurve:
    """The energy of ``pattern`` from its folded form to flat, with barrier and stable states.

    ``material``, a profile or its name, gives joules; without it the unit is k_f times the mean
    edge. ``crease_ratio`` is how stiff creases are, compared with facets; ``crease`` the edge that
    is driven. Raises :class:`~miurafab.errors.InputError` for a material without a modulus, and
    what :func:`~miurafab.origami.energy.path.energy_curve` raises.
    """
    if not 0 <= crease_ratio < math.inf:
        raise InputError(f"`crease_ratio` is {crease_ratio:g}; it must be zero or more.")
    paper = None
    if material is not None:
        material = load_material(material) if isinstance(material, str) else material
        if material.modulus_pa is None:
            raise InputError(
                f"The material '{material.name}' gives no modulus; add a line such as "
                'modulus = "3GPa" to its file, or leave `material` out.'
            )
        paper = Paper(material.thickness_mm, material.modulus_pa)
    model = sheet_model(pattern, paper=paper, crease_ratio=crease_ratio)
    return energy_curve(pattern, steps, crease=crease, model=model, on_progress=on_progress)


def check_writable(path: Path) -> None:
    """Refuse, before any work is done, a file that :func:`write_energy` could not write."""
    plotting.check_writable(path, "the energy")


def write_energy(curve: EnergyCurve, path: str | Path, title: str = "") -> None:
    """Write ``curve`` to ``path``: a plot (.png, .svg) or a table (.csv), by the ending.

    Raises :class:`~miurafab.errors.InputError` for another ending, or where matplotlib is missing.
    """
    plotting.write_result(
        Path(path),
        "the energy",
        lambda: energy_table(curve),
        lambda kind: energy_plot(curve, kind, title),
    )


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
    """The energy over the driven fold angle as a picture, ``kind`` png or svg; the same bytes for
    the same curve.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    unit = curve.path.model.unit_joule or 1.0
    angles = np.abs(np.degrees(curve.path.drives))
    with rc_context({"svg.hashsalt": "miurafab", "font.size": 10}):
        figure = Figure(figsize=(6.4, 4.0), layout="constrained")
        axes = figure.add_subplot()
        axes.plot(angles, curve.path.energies * unit, color=CURVE, lw=1.8, label="equilibrium path")
        if curve.barrier_angle is not None:
            at = abs(math.degrees(curve.barrier_angle))
            label = f"barrier {curve.barrier * unit:.3g} at {at:.1f}°"
            axes.plot([at], [curve.barrier * unit], "^", color=BARRIER, label=label)
        if curve.stable:
            axes.plot(
                [abs(math.degrees(state.angle)) for state in curve.stable],
                [state.energy * unit for state in curve.stable],
                "o",
                color=STABLE,
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
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        picture = io.BytesIO()
        without = {"Date": None} if kind == "svg" else {"Software": None}
        figure.savefig(picture, format=kind, dpi=150, metadata=without)
    return picture.getvalue()
