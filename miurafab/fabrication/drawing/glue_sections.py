"""How to glue: the section with a picture in space for each step."""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np

from miurafab.fabrication.assembly import GlueStep, assembly_order
from miurafab.fabrication.drawing import fold_figures
from miurafab.fabrication.drawing.glue_view import GlueView
from miurafab.fabrication.drawing.page import Box, tabs_called
from miurafab.fabrication.drawing.sections import Block, Figure, Figures, Numbered, Prose, Section
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.fabrication.drawing.views import Views
from miurafab.fabrication.sheets import Layout

_FEW = 6
"""With more steps their pictures are smaller."""
_MOST_DRAWN = 60_000
"""The facets of all pictures in space together; with more, each step is a map of the flat sheet."""

_LABEL = (
    "Each tab has a label, the letter of its seam and a number, and the way its own fold goes: M "
    "for mountain, V for valley."
)
_HOW = {
    "glue": ("It goes under the facet with the same label, edge to edge with the line.",),
    "slots": (
        "It is not glued. Lay it over the front of the facet with the same label and put its head "
        "through the slot there: curl the head a little, or let one shoulder in first and then the "
        "other.",
        "Pull it through from behind until both shoulders are out and the edges meet. Its head "
        "lies flat behind the facet. To open the seam again, curl the head and push it back.",
    ),
    "double": (
        "It is glued to the tab with the same label on the other patch, front to front. Fold both "
        "behind the shell, so that they stand there as one fin, and hold them with a clip until "
        "the glue has set.",
    ),
}
_PATCHES = {
    "glue": "Patches are glued best half way unfolded, while the seam is nearly flat. Press until "
    "it holds, then take the next tab.",
    "slots": "Tabs go in best half way unfolded, while the seam is nearly flat. Begin at one end "
    "of the seam and take one tab after the other.",
    "double": "Patches are glued best half way unfolded. Begin at one end of the seam and take one "
    "pair of tabs after the other.",
}
_PIECES = {
    "glue": "Pieces meet as they are folded: give each its shape first, then glue the seam from "
    "one end to the other. The last seams are closed from outside, as on a paper globe.",
    "slots": "Pieces meet as they are folded: give each its shape first, then close the seam from "
    "one end to the other. Heads go in from outside, so the last seams are closed like the first.",
    "double": "Pieces meet as they are folded: give each its shape first, then glue the seam from "
    "one end to the other. Tabs stand inside, so leave for last a seam that can be reached.",
}
_SHOWN = {
    "glue": "the tabs are yellow, drawn as if the paper over them were clear.",
    "slots": "the tabs are yellow, drawn as if the paper over their heads were clear, with the "
    "slots across them.",
    "double": "the tabs are yellow, standing behind the seam, drawn as if the paper before them "
    "were clear.",
}
_FIGURES = {
    "glue": ("Where tab a7 goes: under the facet a7", fold_figures.tab, 0.3),
    "slots": ("Where tab a7 goes: through the slot a7", fold_figures.slotted_tab, 0.3),
    "double": ("Where tab a7 goes: onto the other tab a7", fold_figures.double_tab, 0.3),
}


def glueing(tabs: int, pieces: int, join: str = "glue") -> tuple[str, ...]:
    """How to join ``tabs`` of a shell of several ``pieces``; nothing without tabs."""
    if not tabs:
        return ()
    return (_LABEL, *_HOW[join], (_PIECES if pieces > 1 else _PATCHES)[join])


class GlueSections:
    """The sections on glueing in the guide with these ``views``."""

    def __init__(self, views: Views) -> None:
        self.views = views

    @property
    def layout(self) -> Layout:
        return self.views.layout

    def sections(self) -> tuple[Section, ...]:
        """The section on glueing, if anything is glued, and what else must be said."""
        totals, copies = self.layout.totals, self.layout.copies
        pieces, join = self.views.pattern.pieces_count, self.views.join
        lines = glueing(totals.tabs - totals.border_tabs, pieces, join)
        steps = self.steps
        alone = len(self.views.patches) == 1 and not any(step.closes for step in steps)
        notes = tuple(Prose(note, bold=True) for note in self.notes())
        if alone or not (lines or steps):
            words = "What the layout says of it"
            return (Section("what to know", words, notes),) if notes else ()
        each = f", each of the {copies} copies" if copies > 1 else ""
        blocks: list[Block] = []
        if lines:
            tab = Figure(*_FIGURES[join])
            blocks += [Figures(2, (tab,), 18.0), Numbered(lines)]
        blocks += notes
        if self.in_space:
            blocks.append(Prose(f"Below each step is its seam, larger: {_SHOWN[join]}"))
        columns = 2 if len(steps) <= _FEW else 3
        figures = tuple(self._figure(number, step) for number, step in enumerate(steps))
        blocks.append(Figures(columns, figures, 66.0 if columns == 2 else 48.0))
        name = "joining" if join == "slots" else "glueing"
        return (Section(name, f"In this order{each}", tuple(blocks)),)

    @cached_property
    def steps(self) -> tuple[GlueStep, ...]:
        return assembly_order(self.layout.model, self.views.pattern)

    @cached_property
    def in_space(self) -> bool:
        """Whether the steps are shown in space."""
        if self.views.pattern.folded_coords is None:
            return False
        sizes = [len(patch.faces) for patch in self.views.patches]
        steps = self.steps
        order = np.cumsum([0 if step.closes else sizes[step.patch] for step in steps])
        return bool(order.sum() <= _MOST_DRAWN)

    @cached_property
    def _space(self) -> GlueView:
        return GlueView(self.views)

    def notes(self) -> list[str]:
        """What follows the gluing, and the findings that matter for the assembly."""
        rims = ((self.views.standing(border), border) for border in self.layout.borders)
        fixed = [
            f"At last fold {tabs_called(tabs)}, which stand on open border {border.number} "
            f"({border.size}), inwards or outwards, and glue them to the base or frame."
            for tabs, border in rims
            if tabs
        ]
        return fixed + [str(finding) for finding in self.layout.findings]

    def _figure(self, number: int, step: GlueStep) -> Figure:
        """One step: its title, its tabs, its picture."""
        name, label = self.views.name, self.views.name(step.patch)
        if step.closes:
            ring = step.onto[0] == step.patch
            title = "Close the ring" if ring else f"Close {label} to {name(step.onto[0])}"
        elif step.onto:
            title = f"{label} onto {', '.join(name(mate) for mate in step.onto)}"
        else:
            title = f"Begin with {label}"
        labels = [self.views.labels[number] for number in step.tabs]
        words = tabs_called(labels).capitalize() if labels else ""
        if step.onto and not step.tabs:
            words = "No tabs: use tape on the seam"
        if step.all_round:
            words += ", all round"
        if self.views.pattern.pieces_count > 1 and (step.closes or step.all_round):
            words += ", from outside"
        before = {earlier.patch for earlier in self.steps[:number]}
        lines = (words,) if words else ()
        if self.in_space:
            draw = partial(self._space.step, step=step, done=before)
            return Figure(title, draw, 0.78, lines, number + 1)
        flat = partial(self._on_map, step=step, done=before)
        return Figure(title, flat, min(self.views.aspect, 1.0), lines, number + 1)

    def _on_map(self, canvas: Pen, box: Box, step: GlueStep, done: set[int]) -> None:
        self.views.map(
            canvas,
            box,
            shown=(step.patch, *(step.onto if step.closes else ())),
            done=done - {step.patch},
            seams=np.array(step.edges, dtype=np.int64),
        )
