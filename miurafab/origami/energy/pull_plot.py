"""Force against extension as a table and as a plot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from miurafab.origami.energy.pull import PullCurve
from miurafab.origami.plotting import BLUE, GREEN, ORANGE, without_frame

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = (BLUE, ORANGE, GREEN)
HEAD = "step,cycle,way,extension_mm,force_n,work_j,stored_j,dissipated_j"


def pull_table(curve: PullCurve) -> str:
    """The states as CSV; ``way`` is out or back."""
    rows = [
        ",".join([str(step), str(cycle), "out" if out else "back", *map(repr, values)])
        for step, (cycle, out, *values) in enumerate(
            zip(
                curve.cycles.tolist(),
                curve.loading.tolist(),
                curve.extensions.tolist(),
                (curve.forces + 0.0).tolist(),  # no -0.0
                curve.works.tolist(),
                curve.stored.tolist(),
                curve.dissipated.tolist(),
                strict=True,
            )
        )
    ]
    return "\n".join([HEAD, *rows]) + "\n"


def draw_pull(curve: PullCurve, axes: Axes, title: str = "") -> None:
    """Force over extension, a line for each cycle out and back."""
    last = int(curve.cycles[-1])
    for cycle in range(1, last + 1):
        on = curve.cycles == cycle
        colour = _COLOURS[min(cycle, len(_COLOURS)) - 1]
        # later cycles lie on each other, so they are drawn thinner and thinner
        width = 1.0 + 2.4 * (last - cycle) / last
        label = f"cycle {cycle}"
        axes.plot(curve.extensions[on], curve.forces[on], color=colour, lw=width, label=label)
    axes.set_xlabel("extension (mm)")
    axes.set_ylabel("force (N)")
    axes.set_title(title)
    axes.axhline(0.0, color="#999999", lw=0.6)
    if last <= 8:
        axes.legend(frameon=False)
    without_frame(axes)
