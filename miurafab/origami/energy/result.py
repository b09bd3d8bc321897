"""What energy curves have in common: they are drawn, saved and shown in the same way."""

from __future__ import annotations

from typing import TYPE_CHECKING

from miurafab.display import Shown
from miurafab.files import AnyPath
from miurafab.origami.plotting import picture_bytes, shown, write_result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = (6.4, 4.0)
"""The size of a plot in inches."""


class EnergyResult(Shown):
    """One curve or several, with a table and a drawing."""

    def _table(self) -> str:
        """The CSV of the result."""
        raise NotImplementedError

    def _draw(self, axes: Axes, title: str) -> None:
        """Draw the result into ``axes``."""
        raise NotImplementedError

    def _bytes(self, kind: str, title: str) -> bytes:
        """The plot as a picture, ``kind`` png or svg; the same bytes for the same result."""
        return picture_bytes(lambda axes: self._draw(axes[0], title), kind, SIZE)

    def save(self, path: AnyPath, *, title: str = "") -> None:
        """Write a plot (``.png``, ``.svg``) or a table (``.csv``), by the ending of ``path``.

        Raises
        ------
        InputError
            For another ending, and for a folder that does not exist.
        """
        write_result(path, "The energy", self._table, lambda kind: self._bytes(kind, title))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the energy over the driven fold angle with matplotlib.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw. The default is a new figure.

        Returns
        -------
        matplotlib Axes
        """
        axes = shown(SIZE, ax)
        self._draw(axes, "")
        return axes

    def _picture(self) -> str:
        return self._bytes("svg", "").decode("utf-8")
