"""Results as plots: one home of matplotlib, which is loaded only when a plot is drawn.

A ``draw`` function puts a result into axes. :func:`shown` gives it axes of ``pyplot`` for a person
at a prompt or in a notebook, :func:`picture_bytes` axes of its own for a file.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from miurafab.files import AnyPath, new_file, write_bytes, write_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PLOTS = (".png", ".svg")
RESULTS = (*PLOTS, ".csv")
"""What a result is written as, by the ending."""

# Colours that colour-blind eyes keep apart (Okabe and Ito, "Color Universal Design", 2008).
BLUE, ORANGE, GREEN = "#0072b2", "#d55e00", "#009e73"


def shown(size: tuple[float, float], ax: Axes | None = None, **how: Any) -> Axes:
    """``ax``, or axes of a new pyplot figure of ``size`` inches."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    axes: Axes = pyplot.figure(figsize=size, layout="constrained").add_subplot(**how)
    return axes


def shown_row(size: tuple[float, float], count: int) -> list[Axes]:
    """The axes of a new pyplot figure of ``size`` inches, side by side."""
    from matplotlib import pyplot

    figure = pyplot.figure(figsize=size, layout="constrained")
    return list(figure.subplots(1, count, squeeze=False)[0])


def picture_bytes(
    draw: Callable[[list[Axes]], None],
    kind: str,
    size: tuple[float, float],
    *,
    count: int = 1,
    font_size: int = 10,
) -> bytes:
    """What ``draw`` draws, as the content of a ``kind`` png or svg; the same bytes every time."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context({"svg.hashsalt": "miurafab", "font.size": font_size}):
        figure = Figure(figsize=size, layout="constrained")
        draw(list(figure.subplots(1, count, squeeze=False)[0]))
        picture = io.BytesIO()
        without = {"Date": None} if kind == "svg" else {"Software": None}
        figure.savefig(picture, format=kind, dpi=150, metadata=without)
    return picture.getvalue()


def write_result(
    path: AnyPath, what: str, table: Callable[[], str], plot: Callable[[str], bytes]
) -> None:
    """Write the ``table`` to a .csv, or the ``plot`` of the kind that the ending names.

    Raises :class:`~miurafab.errors.InputError` for another ending.
    """
    file = new_file(path, what, RESULTS)
    if file.suffix.lower() == ".csv":
        write_text(file, table())
    else:
        write_bytes(file, plot(file.suffix.lower().removeprefix(".")))


def without_frame(*axes: Axes) -> None:
    """Only the left and the lower side of the frame."""
    for each in axes:
        for side in ("top", "right"):
            each.spines[side].set_visible(False)
