"""What thick panels of any kind have in common: facets that are too small, and files."""

from __future__ import annotations

import numpy as np

from miurafab.display import Shown
from miurafab.errors import InputError
from miurafab.files import AnyPath
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.crease_pattern import CreasePattern


class MadePanels(Shown):
    """A ``pattern`` of F facets made of panels of ``thickness_mm``; ``limit_mm`` (F,) is the
    thickness at which each facet loses its outline.
    """

    pattern: CreasePattern
    thickness_mm: float
    limit_mm: Floats

    @property
    def too_small(self) -> Ints:
        """(n,) the facets that are too small for the thickness."""
        return np.flatnonzero(~(self.limit_mm > self.thickness_mm))

    def refuse_too_small(self) -> None:
        """Raise :class:`~miurafab.errors.InputError` if a facet is too small."""
        if len(self.too_small):
            raise InputError(
                f"Facet {self.too_small[0]} is too small for panels of {self.thickness_mm:g} mm, "
                "so that it has no outline; enlarge the sheet or choose a smaller `thickness`."
            )

    def save(self, path: AnyPath, *, title: str = "") -> None:
        """Write the panels: outlines to cut, parts to lay out on sheets, or solids.

        Parameters
        ----------
        path : str or os.PathLike
            A ``.dxf`` or ``.svg`` file with outlines, a ``.fold`` file whose pieces are the parts,
            for :func:`sheets`, an ``.stl`` file with the panels flat, or a ``.glb`` file in which
            they move.
        title : str
            The title inside an SVG file. The default is the name of the target.

        Raises
        ------
        InputError
            For another ending, for a folder that does not exist, and for facets that are too small.
        """
        from miurafab.origami.formats.panels import write_panels

        write_panels(self, path, title)
