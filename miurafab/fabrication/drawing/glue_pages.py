"""The last pages of the guide: how to fold, and the steps of gluing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from reportlab.lib.colors import Color
from reportlab.lib.units import mm

from miurafab.fabrication.assembly import GlueStep, assembly_order
from miurafab.fabrication.drawing.instructions import (
    draw_instructions,
    glueing,
    height_of_instructions,
)
from miurafab.fabrication.drawing.page import (
    BOTTOM,
    HEIGHT,
    INK,
    MARGIN,
    ROOM,
    Box,
    Page,
    heading,
    line_above,
    tabs_called,
    text,
    wrapped,
)
from miurafab.fabrication.drawing.svg_canvas import Pen
from miurafab.fabrication.drawing.views import Views
from miurafab.fabrication.sheets import Layout

_STEP = (ROOM - 12) / 3
"""The width of one step of gluing."""

_TALL = 52.0
"""The height of the picture of a step that is shown in space."""


@dataclass(frozen=True, eq=False)
class GluePages:
    """The pages on folding and gluing in the guide with this ``title``."""

    views: Views
    title: str

    @property
    def layout(self) -> Layout:
        return self.views.layout

    @property
    def in_space(self) -> bool:
        """Whether the steps are shown in space: pieces meet there and not in the flat pattern."""
        return self.views.pattern.pieces_count > 1 and self.views.pattern.folded_coords is not None

    def pages(self) -> Iterator[Page]:
        """Functions that draw one page each."""
        steps = assembly_order(self.layout.model, self.views.pattern)
        top, notes = HEIGHT - MARGIN - 19, self.notes()
        height = 20.0 + (_TALL if self.in_space else min(_STEP * self.views.aspect, 40.0))
        totals = self.layout.totals
        glue = glueing(totals.tabs - totals.border_tabs, self.views.pattern.pieces_count)
        copies = self.layout.copies
        each = f", each of the {copies} copies" if copies > 1 else ""
        taken = height_of_instructions(notes, glue)
        alone = len(self.views.patches) == 1 and not any(step.closes for step in steps)
        shown = [] if alone else list(enumerate(steps))
        first = 3 * int((top - taken - BOTTOM) // height)
        later = 3 * int((top - BOTTOM) // height)

        def draw(canvas: Pen, part: list[tuple[int, GlueStep]], y: float) -> None:
            for place, (number, step) in enumerate(part):
                row, column = divmod(place, 3)
                box = (MARGIN + column * (_STEP + 6), y - row * height, _STEP, height)
                before = {earlier.patch for earlier in steps[:number]}
                self.step(canvas, number, step, before, box)

        def front(canvas: Pen) -> None:
            words = (
                ("folding and glueing", f"Fold first, then glue{each}") if glue else ("folding", "")
            )
            heading(canvas, f"{self.title}: {words[0]}", words[1])
            draw_instructions(canvas, top, notes, glue)
            draw(canvas, shown[:first], top - taken)

        yield front
        for start in range(first, len(shown), later):

            def more(
                canvas: Pen, part: list[tuple[int, GlueStep]] = shown[start : start + later]
            ) -> None:
                heading(canvas, f"{self.title}: glueing", f"In this order{each}, continued")
                draw(canvas, part, top)

            yield more

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

    def step(
        self,
        canvas: Pen,
        number: int,
        step: GlueStep,
        before: set[int],
        box: Box,
    ) -> None:
        """One step of gluing, from the top of ``box`` down."""
        x, top, width, height = box
        line_above(canvas, x, top, width)
        canvas.setFillColor(INK)
        canvas.circle((x + 3.2) * mm, (top - 5.6) * mm, 3.2 * mm, stroke=0, fill=1)
        text(
            canvas, x + 3.2, top - 6.7, str(number + 1), 8.5, bold=True,
            colour=Color(1, 1, 1), align="middle",
        )  # fmt: skip
        label = self.views.name(step.patch)
        if step.closes:
            title = f"Close {label} to {self.views.name(step.onto[0])}"
            if step.onto[0] == step.patch:
                title = "Close the ring"
        elif step.onto:
            title = f"{label} onto {', '.join(self.views.name(mate) for mate in step.onto)}"
        else:
            title = f"Begin with {label}"
        text(canvas, x + 8.5, top - 6.8, title, 9.5, bold=True)
        words = (
            tabs_called([self.views.labels[n] for n in step.tabs]).capitalize() if step.tabs else ""
        )
        if step.onto and not step.tabs:
            words = "No tabs: use tape on the seam"
        if step.all_round:
            words += ", all round"
        if self.in_space and (step.closes or step.all_round):
            words += ", from outside"
        lines = wrapped(words, width - 8.5, 8)
        text(canvas, x + 8.5, top - 11, lines[0], 8)
        if len(lines) > 1:
            text(canvas, x + 8.5, top - 14.2, lines[1] + (" ..." if len(lines) > 2 else ""), 8)
            top -= 3.2
        tall = height - 20
        if self.in_space:
            room = (x, top - 14 - tall, width, tall)
            self.views.step(canvas, room, step.patch, before, step.edges)
            return
        shown = (step.patch, *(step.onto if step.closes else ()))
        tall = min(tall, width * self.views.aspect)
        self.views.map(
            canvas,
            (x, top - 14 - tall, width, tall),
            shown=shown,
            done=before - {step.patch},
            seams=np.array(step.edges, dtype=np.int64),
        )
