"""How to fold, for somebody who never folded such a sheet: the sections of the folder's kit.

What is told in words is the same for all sheets, but for their rows. A sheet of 3,600 facets has
the same sections as one of 144: rows are told in ranges, and of many patches the whole is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from miurafab.fabrication.drawing import fold_figures
from miurafab.fabrication.drawing.sections import (
    Block,
    Figure,
    Figures,
    Numbered,
    Prose,
    Section,
    ShortRows,
)
from miurafab.fabrication.drawing.sheet_views import camera, rim_view, shape_view
from miurafab.fabrication.drawing.views import Views
from miurafab.fabrication.kit.plan import FoldersKit, folders_kit
from miurafab.fabrication.kit.rim import rim_ends
from miurafab.fabrication.kit.rows import (
    FAMILIES,
    CreaseLine,
    bend_of,
    crease_lines,
    named,
    numbered,
)
from miurafab.fabrication.kit.states import FoldedStates, folded_states
from miurafab.fabrication.wording import count
from miurafab.geometry.arrays import Bools

NEARLY_STRAIGHT = math.radians(25)
"""A line that turns by less from crease to crease can be folded over in one go (judged)."""
_DRAWN = 9
"""With more patches, the rows are drawn on the whole sheet alone."""
_SLIM = 1.8
"""Patches higher than this, over their width, stand four in a row."""
_FEW_LINES = 48
"""With more lines the sheet takes most of a page."""
_LISTED = 240
"""So many rows are listed one by one, which takes two pages; of more the wedges tell."""
_HOLD = (
    "Lay the sheet before you with its front up, the show side, as in all pictures. A mountain "
    "(red, solid, M) rises towards you; a valley (blue, dashed, V) sinks away from you.",
    "Hold it with both hands at the line: thumbs on top, first two fingers below. For a mountain "
    "push up with the fingers and press both sides down with the thumbs. For a valley press the "
    "line down with the thumbs and lift both sides.",
    "Bend, never pull: a perforated line tears if it is pulled. Do not run a nail along it before "
    "it was bent both ways.",
)
_WRONG = (
    "A row pops the wrong way, a mountain where a valley should be. Do not force the rest. Open "
    "the sheet round it to less than one third, press the crossing from the other side with a "
    "fingertip until it snaps through, then its neighbours, and go on.",
    "The sheet will not close any further. Look for a crossing with two folds each way: one of its "
    "creases is still flat, or goes the wrong way. At each crossing three go one way, one the "
    "other.",
    "A facet bulges. That is allowed on the way, if it springs back. If it stays bent, open the "
    "rows on both sides and crease them once more both ways.",
    "A line begins to tear. Stop, put tape over it on the back, and bend it through the tape.",
)


@dataclass(frozen=True, eq=False)
class KitSections:
    """The sections on folding in the guide with these ``views``."""

    views: Views

    @cached_property
    def lines(self) -> tuple[CreaseLine, ...]:
        return crease_lines(self.views.pattern)

    @cached_property
    def kit(self) -> FoldersKit:
        return self.views.layout.kit or folders_kit(self.views.pattern)

    @cached_property
    def states(self) -> FoldedStates:
        return folded_states(self.views.pattern)

    def sections(self) -> Iterator[Section]:
        """The sections in the order in which they are needed."""
        yield self.holding()
        yield self.creasing()
        yield self.collapsing()
        if self.kit.wedges:
            yield self.gauge()

    def holding(self) -> Section:
        pattern = self.views.pattern
        figures = [
            Figure("Mountain: the crease rises", fold_figures.mountain, 0.5),
            Figure("Valley: the crease sinks", fold_figures.valley, 0.5),
        ]
        vertex = fold_figures.crossing_of(pattern)
        if vertex is not None and self.states.shapes:
            shape = self.states.shapes[0]
            draw = partial(fold_figures.crossing, pattern=pattern, points=shape, vertex=vertex)
            figures.append(Figure("Crossing: three go one way", draw, 0.5))
        copies = self.views.layout.copies
        each = f" Do so with each of the {copies} copies." if copies > 1 else ""
        return Section(
            "folding",
            f"How to hold the sheet, and what the lines mean.{each}",
            (Figures(3, tuple(figures), 34.0), Numbered(_HOLD)),
        )

    def creasing(self) -> Section:
        steps = tuple(self._steps_of_creasing())
        blocks: list[Block] = [Numbered(steps)]
        if self.kit.unnumbered and self.lines:
            says = f"{count(self.kit.unnumbered, 'crease is', 'creases are')} in no row: go by the "
            blocks.append(Prose(f"{says}colours of the picture."))
        blocks.append(self._rims())
        seams = [line.name for line in self.lines if not self._within(line).any()]
        if seams:
            lies = "lies" if len(seams) == 1 else "lie"
            blocks.append(Prose(f"{named(seams)} {lies} on a seam: there only tabs are bent."))
        parts = self._rows_of_patches()
        if parts:
            blocks.append(ShortRows(2, ("patch", "its rows"), parts))
        return Section("rows to crease first", self._order(), tuple(blocks))

    def _order(self) -> str:
        if not self.lines:
            return "Every line once its own way, and once a little the other way."
        return "In this order. The numbers stand on the rim: M up, V down, and both ways."

    def _families(self) -> list[list[CreaseLine]]:
        """The lines of each family, in the order of creasing."""
        order = list(dict.fromkeys(line.family for line in self.lines))
        return [[line for line in self.lines if line.family == family] for family in order]

    def _steps_of_creasing(self) -> Iterator[str]:
        if not self.lines:
            yield (
                "This pattern has no rows: its facets are not in columns and rows. Bend each line "
                "its own way to about a right angle, then once a little the other way. Begin in "
                "the middle of the sheet and go outwards."
            )
        for own in self._families():
            names = numbered(sorted(line.number for line in own), own[0].family)
            straight = bend_of(self.views.pattern, own) < NEARLY_STRAIGHT
            looks = "nearly straight" if straight else "zigzag"
            ways = _ways(own)
            if straight:
                how = (
                    "Fold the sheet over along the whole line, once up and once down, each time to "
                    "about a right angle, and lay it flat again."
                )
            else:
                how = (
                    "A zigzag cannot be folded over in one go. Go along it from rim to rim and "
                    "bend one piece after another its own way to about a right angle, then once a "
                    "little the other way."
                )
            yield f"{names} ({looks}), one line after another. {ways} {how}"
        if any(patch.tabs for patch in self.views.patches):
            yield (
                "Bend each tab along its own fold, mountain or valley by its letter, and let it "
                "stand. So it does not catch in the rows when the sheet moves."
            )
        yield "Now the sheet is limp like cloth, and nothing in it is stiff. Only then go on."

    def _within(self, line: CreaseLine, patch: int | None = None) -> Bools:
        """Whether each crease of a line has one patch on both sides, that of this id if given."""
        beside = self.views.face_patch[self.views.pattern.edges_faces[line.edges]]
        own = beside[:, 0] if patch is None else patch
        return np.asarray((beside[:, 1] == own) & (beside[:, 0] == own))

    def _rims(self) -> Figures:
        """The flat sheet with the numbers of its rows, or each of a few patches."""
        views = self.views
        faces = len(views.face_patch)
        parts: list[tuple[str, Bools]] = [("The sheet with its rows", np.ones(faces, bool))]
        if 1 < len(views.patches) <= _DRAWN:
            parts = [(views.name(p.id), views.face_patch == p.id) for p in views.patches]
        figures = []
        for title, inside in parts:
            corners = views.pattern.faces_vertices[inside]
            wide, tall = np.ptp(views.flat[np.unique(corners[corners >= 0])], axis=0).tolist()
            ends = rim_ends(views.pattern, self.lines, inside)
            draw = partial(rim_view, views=views, ends=ends, inside=inside)
            figures.append(Figure(title, draw, tall / max(wide, 1e-9)))
        slim = np.median([figure.aspect for figure in figures]) > _SLIM
        columns = min(len(parts), 4 if slim else 2)
        alone = 105.0 if len(self.lines) <= _FEW_LINES else 150.0
        return Figures(columns, tuple(figures), alone if columns == 1 else 85.0)

    def _rows_of_patches(self) -> tuple[tuple[str, ...], ...]:
        """Which rows cross which patch, if there are several."""
        views, found = self.views, []
        if len(views.patches) == 1 or not self.lines:
            return ()
        for patch in views.patches:
            own = [line.name for line in self.lines if self._within(line, patch.id).any()]
            found.append((views.name(patch.id), named(own) or "none: only its tabs fold"))
        return tuple(found)

    def collapsing(self) -> Section:
        states = self.states
        pattern, blocks = self.views.pattern, []
        if states.shapes:
            azimuth = camera(pattern, states.shapes[-1])
            figures = []
            for title, shape in zip(states.titles, states.shapes, strict=True):
                inside = np.ones(len(pattern.faces_vertices), dtype=bool)
                if pattern.pieces is not None and shape is not states.shapes[-1]:
                    inside = pattern.pieces == pattern.pieces[self.views.patches[0].faces[0]]
                draw = partial(
                    shape_view, pattern=pattern, shape=shape, azimuth=azimuth, inside=inside
                )
                figures.append(Figure(title, draw, 0.85))
            blocks.append(Figures(max(len(figures), 2), tuple(figures), 70.0))
        shows = ""
        if pattern.pieces_count > 1 and len(states.shapes) > 1:
            name = self.views.name(self.views.patches[0].id)
            shows = f"On the way the piece of {name} is drawn; the others move like it. "
        elif len(self.views.patches) > 1:
            shows = "The pictures show the whole shell; fold each patch as its part of it. "
        said: list[Block] = [
            Prose(f"{shows}{states.how}"),
            Numbered(tuple(self._steps_of_collapse())),
            Prose("If it goes wrong", bold=True),
            Numbered(_WRONG),
        ]
        return Section("collapse", "What to fold first, and how it looks", (*blocks, *said))

    def _steps_of_collapse(self) -> Iterator[str]:
        pleats = [own for own in self._families() if all(line.fold in "MV" for line in own)]
        pleats = [own for own in pleats if any(len(line.fold) == 1 for line in own)]
        if pleats:
            first = pleats[-1]
            a, b = (first * 2)[:2]
            ways = f"{_way(a)}, {_way(b)}" if len(first) > 1 else _way(a)
            crossed = "".join(FAMILIES).replace(first[0].family, "")
            yield (
                f"Begin at one rim with the rows {first[0].family}: {ways}, from rim to rim, until "
                "they stand about a third of the way. Go on with the next ones to the far rim. The "
                "sheet is a fan of shallow pleats."
            )
            yield (
                f"The rows {crossed} now fold where the pleats kink. Press each crossing with a "
                "fingertip, the mountains up from below and the valleys down from above, so that "
                "it snaps. Start at a corner and go row by row."
            )
        else:
            yield (
                "Begin at a corner. Set each crossing with a fingertip, the mountains up from "
                "below and the valleys down from above, so that it snaps. Go row by row until the "
                "whole sheet stands about a third of the way."
            )
        yield (
            "Take the sheet at two opposite rims with flat hands and push together a little, then "
            "at the other two. All rows go together. Stop at one third and at two thirds, compare "
            "with the pictures, and mend what popped the wrong way."
        )
        after = " Check with the gauge, row by row." if self.kit.wedges else ""
        yield (
            f"Close it to the finished form. Paper springs back, so fold each row some 10 degrees "
            f"too far and let go.{after}"
        )

    def gauge(self) -> Section:
        names = [chr(ord("A") + k) for k in range(len(self.kit.wedges))]
        figures = []
        for name, each in zip(names, self.kit.wedges, strict=True):
            opening = math.radians(each.opening_deg)
            draw = partial(fold_figures.wedge, opening=opening, name=name)
            figures.append(
                Figure(
                    f"Wedge {name}: fold by {180 - each.opening_deg:.0f}\N{DEGREE SIGN}",
                    draw,
                    fold_figures.wedge_aspect(opening),
                    (named(each.rows),),
                )
            )
        any_other = Figure("Any other fold angle", fold_figures.protractor, 0.5)
        blocks: list[Block] = [
            Prose(
                "Cut the wedges out along their outlines; print at any scale. Put the tip of the "
                "wedge into the fold, from the side to which it opens. If light shows beside it, "
                "the fold is too open or too tight: it is right when both facets touch the wedge. "
                "The angle of a row is the median over its creases."
            ),
            Figures(3, (*figures, any_other), 42.0),
        ]
        if len(self.kit.rows) <= _LISTED:
            wedge_of = {
                row: name
                for name, each in zip(names, self.kit.wedges, strict=True)
                for row in each.rows
            }
            blocks.append(
                ShortRows(
                    3,
                    ("row", "fold", "wedge", "fold by", "from-to"),
                    tuple(
                        (
                            row.name,
                            "M/V" if row.fold == "MV" else row.fold,
                            wedge_of.get(row.name, "flat"),
                            f"{row.median_deg:.0f}\N{DEGREE SIGN}",
                            f"{row.least_deg:.0f}-{row.greatest_deg:.0f}",
                        )
                        for row in self.kit.rows
                    ),
                )
            )
        return Section("gauge", "Wedges to cut out, one for each fold angle", tuple(blocks))


def _way(line: CreaseLine) -> str:
    return f"push {line.name} up" if line.fold == "M" else f"press {line.name} down"


def _ways(lines: Sequence[CreaseLine]) -> str:
    """Which lines are mountains and which are valleys."""
    family = lines[0].family
    found = []
    for fold, word in (("M", "Mountains"), ("V", "Valleys")):
        numbers = sorted(line.number for line in lines if line.fold == fold)
        if numbers:
            found.append(f"{word}: {numbered(numbers, family)}.")
    both = sorted(line.number for line in lines if line.fold == "MV")
    if both:
        which = "They change" if len(both) == len(lines) else f"{numbered(both, family)} change"
        found.append(f"{which} from mountain to valley at each crossing, so they go both ways.")
    return " ".join(found)
