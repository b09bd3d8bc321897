"""The parts of the guide that are told twice: on pages of paper, and on a page for a tablet.

A section has a title and blocks: prose, numbered steps, figures, and columns of short rows. The
printed guide (:mod:`~miurafab.fabrication.drawing.flow`) and the page
(:mod:`~miurafab.fabrication.drawing.tablet_page`) are two renderings of the same sections.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from miurafab.fabrication.drawing.page import Box
from miurafab.fabrication.drawing.svg_canvas import Pen


@dataclass(frozen=True)
class Prose:
    """A paragraph."""

    words: str
    bold: bool = False


@dataclass(frozen=True)
class Numbered:
    """Steps, numbered from 1."""

    lines: tuple[str, ...]


@dataclass(frozen=True)
class Figure:
    """A picture with a ``title`` and ``lines`` of text. ``draw`` fills a box whose height is
    ``aspect`` times its width. ``number`` is that of a step.
    """

    title: str
    draw: Callable[[Pen, Box], object]
    aspect: float
    lines: tuple[str, ...] = ()
    number: int | None = None


@dataclass(frozen=True)
class Figures:
    """Figures side by side in so many ``columns``, none higher than ``tallest`` mm on paper."""

    columns: int
    figures: tuple[Figure, ...]
    tallest: float = 90.0


@dataclass(frozen=True)
class ShortRows:
    """Short rows of text under a ``head``, in ``columns`` side by side."""

    columns: int
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


Block = Prose | Numbered | Figures | ShortRows


@dataclass(frozen=True)
class Section:
    """A part of the guide."""

    title: str
    subtitle: str
    blocks: tuple[Block, ...]
