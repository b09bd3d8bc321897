"""The plan: patches, sheets and glue in one objective.

A pattern can be divided into few patches, or into patches that share sheets. The plan with the
least

    J = λ (sheets) + (length of the seams) + (λ / 4) Σ_i max(0, 0.35 - a_i / ā) / 0.35

is made, in mm of seam. λ, the worth of a sheet, is 1.5 times the long side of the bed: two more
sheets for 3.9 m of glue are not worth it, one sheet for 0.2 m is. The last term keeps slivers away:
a_i is the area of a patch that is cut off its piece, ā the mean of these.

The split into the fewest patches is always compared. If it needs no more sheets than its area lets
expect, nothing is searched. Otherwise other splits (:mod:`~miurafab.fabrication.plan_splits`) are
nested by the first pass of the nester, in the order of the least J that they can have, and left
out where that is no better than the best J so far. Then small patches of the two best are
dissolved. Only the winner is nested by all passes; and so is the first split, as far as it can
still win. Thus no plan has a larger J than the first split.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting import Nesting, Problem, first_nesting, nest, nest_within, price
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.partition.fit_box import Space
from miurafab.fabrication.partition.patch_frame import (
    FramedPatches,
    Patch,
    copied,
    framed_patches,
    sheet_space,
)
from miurafab.fabrication.partition.patch_outline import outline_split, patch_space
from miurafab.fabrication.partition.pieces import facet_components
from miurafab.fabrication.partition.split import split
from miurafab.fabrication.plan_splits import (
    dissolved,
    equal_blocks,
    patch_areas,
    smaller_rooms,
    tighter_rooms,
)
from miurafab.fabrication.seams import border_seams
from miurafab.fabrication.stock import LaidStock
from miurafab.geometry.arrays import Floats, Ints
from miurafab.geometry.polygons import edge_lengths, filled, signed_areas
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import Material

_SHEET = 1.5
"""The worth of a sheet in long sides of the bed (hypar of 600 mm: 1 sheet for 124 mm of glue is
taken, 2 sheets for 3.9 m are not; a band takes 3 sheets for 117 mm)."""

_PREFERENCE = {None: 1.0, "sheets": 4.0, "glue": 0.25}
"""What the worth of a sheet is multiplied by."""

_SLIVER = 0.35
"""A patch with less than this part of the mean area is a sliver."""

_FULL, _ONE = 0.85, 0.95
"""Sheets are rarely filled more than this, and one sheet not more (measured on ten jobs: where a
split needs no more sheets than this lets expect, no search found fewer)."""

MANY = 20
"""Of more patches no other splits are compared: they fill their sheets well, and each split of a
pattern so large takes long."""

LARGE = 5_000
"""Tighter rooms are tried for patterns of at most so many facets, which are split in 0.5 s."""

_TRIES = 36
"""So many ways to dissolve a patch are nested."""


@dataclass(frozen=True)
class Alternative:
    """A way to divide the pattern that was compared: ``smallest`` is the area of the smallest
    patch that is cut off its piece over their mean, 1 where there is none.
    """

    sheets: int
    patches: int
    seam_mm: float
    smallest: float
    chosen: bool


@dataclass(frozen=True, eq=False)
class Plan:
    """The patches in their frames, those of all copies, and their places on the sheets."""

    framed: FramedPatches
    patches: tuple[Patch, ...]
    nesting: Nesting
    alternatives: tuple[Alternative, ...]


@dataclass(frozen=True, eq=False)
class _NestedSplit:
    """A split, nested: ``rest_mm`` is J without its sheets."""

    face_patch: Ints
    framed: FramedPatches
    patches: tuple[Patch, ...]
    problem: Problem
    nesting: Nesting
    rest_mm: float

    @property
    def price(self) -> float:
        return price(self.nesting.slots, self.problem.stock)


def worth_of_sheet(stock: LaidStock, options: LayoutOptions) -> float:
    """λ, the length of seams in mm that a sheet is worth."""
    sheet = sheet_space(stock)
    return _SHEET * max(sheet.width, sheet.height) * _PREFERENCE[options.prefer]


def plan_patches(
    pattern: CreasePattern,
    stock: LaidStock,
    material: Material,
    options: LayoutOptions,
) -> Plan:
    """The pattern divided and nested with the least J that was found.

    Raises :class:`~miurafab.errors.LayoutError` as
    :func:`~miurafab.fabrication.partition.split.split` and
    :func:`~miurafab.fabrication.nesting.nest`.
    """
    return _Planner(pattern, stock, material, options).plan()


def fits_on(
    pattern: CreasePattern,
    stock: LaidStock,
    material: Material,
    options: LayoutOptions,
    sheets: int,
) -> bool:
    """Whether a split of ``pattern`` takes at most so many ``sheets`` in the first pass of the
    nester, whatever its glue.

    Raises :class:`~miurafab.errors.LayoutError` as :func:`plan_patches`.
    """
    return _Planner(pattern, stock, material, options).fits_on(sheets)


class _Planner:
    """What all splits of one pattern share."""

    def __init__(
        self, pattern: CreasePattern, stock: LaidStock, material: Material, options: LayoutOptions
    ) -> None:
        self.pattern, self.stock, self.material, self.options = pattern, stock, material, options
        self.sheet = sheet_space(stock)
        self.room = patch_space(self.sheet, material, options)
        self.worth = worth_of_sheet(stock, options)
        self.copies = options.nesting.quantity
        corners = pattern.vertices_coords[filled(pattern.faces_vertices)]
        self.areas = np.abs(signed_areas(corners))
        self.fill = self.copies * self.areas.sum() / (self.sheet.width * self.sheet.height)
        single = self.fill <= _ONE and len(stock.kinds.kinds) == 1
        self.goal = (
            1.0 if single else stock.kinds.least_price(self.copies * self.areas.sum() / _FULL)
        )
        self.piece = facet_components(pattern)
        self.lengths = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
        self.joins = float(self.lengths[border_seams(pattern).edges[:, 0]].sum())

    def fits_on(self, sheets: int) -> bool:
        usual = self.split(self.room, self.options)
        few = usual.max() < MANY
        others = self.candidates(usual, True) if few else []
        return any(self.takes(each, sheets) for each in (usual, *(each for each, _ in others)))

    def takes(self, face_patch: Ints, sheets: int) -> bool:
        """Whether the first pass puts the patches of a split on so many sheets."""
        problem = self.framed(face_patch)[2]
        if problem.bound > sheets:
            return False
        most = float(sheets) if len(self.stock.kinds.kinds) == 1 else math.inf
        nesting = first_nesting(problem, most)
        return nesting is not None and nesting.sheets <= sheets

    def plan(self) -> Plan:
        usual = self.split(self.room, self.options, improve=True)
        if usual.max() >= MANY:
            framed, patches, problem = self.framed(usual)
            trial = _NestedSplit(
                usual, framed, patches, problem, nest(problem), self.rest_mm(usual)
            )
            return self.made(trial, [trial])
        today = self.trial(usual)
        trials = [today, *self.search(today)]
        best = min(trials, key=self.worse)
        final = replace(best, nesting=nest(best.problem, known=best.nesting))
        if best is not today:
            most = (self.worse(final) - today.rest_mm) / self.worth * (1 - 1e-9)
            again = nest_within(today.problem, most)
            if again is not None:
                final = replace(today, nesting=again)
                trials[0] = final
        return self.made(final, [final if trial is best else trial for trial in trials])

    def search(self, today: _NestedSplit) -> list[_NestedSplit]:
        """Other splits, nested by the first pass, that may be better than ``today``."""
        wasteful = today.price > self.goal + 1e-9
        if not wasteful and self.slivers_mm(today.face_patch) == 0:
            return []
        trials = [today]
        rooms: dict[int, Space] = {}
        for face_patch, room in sorted(
            self.candidates(today.face_patch, wasteful), key=lambda each: self.rest_mm(each[0])
        ):
            trial = self.promising(face_patch, min(map(self.worse, trials)))
            if trial is not None:
                trials.append(trial)
                rooms[id(trial)] = room
        best = min(trials, key=self.worse)
        if id(best) in rooms:
            smoother = self.split(rooms[id(best)], self.options, improve=True)
            trial = self.promising(smoother, self.worse(best))
            trials += [] if trial is None else [trial]
        for trial in sorted(trials, key=self.worse)[:2] if wasteful else []:
            trials += self.dissolve(trial)
        return trials[1:]

    def candidates(self, usual: Ints, wasteful: bool) -> Iterator[tuple[Ints, Space]]:
        """Splits that differ, each with the room of its patches. Where no sheet is wasted, these
        are only splits into more equal patches.
        """
        seen = {self.key(usual)}
        count = int(usual.max()) + 1
        few = math.ceil(self.fill / self.copies)
        most = 2 * count if wasteful else count
        height = self.material.tabs.height_mm
        ways = [
            (self.room, options)
            for options in equal_blocks(self.pattern, self.room, height, self.options, few, most)
        ]
        if wasteful:
            rooms = smaller_rooms(self.room, self.options.gap_mm)
            ways += [(room, self.options) for room in rooms]
        if self.slivers_mm(usual) > 0 and len(self.areas) <= LARGE:
            ways += [(room, self.options) for room in tighter_rooms(self.room)]
        for room, options in ways:
            try:
                found = self.split(room, options)
            except LayoutError:
                continue  # A facet with its tabs is larger than this room.
            if self.key(found) not in seen:
                seen.add(self.key(found))
                yield found, room

    def dissolve(self, trial: _NestedSplit) -> list[_NestedSplit]:
        """``trial`` with small patches cut up, one after the other, as long as J falls."""
        found: list[_NestedSplit] = []
        tries = 0
        while trial.price > self.goal + 1e-9:
            areas = patch_areas(self.areas, trial.face_patch)
            cut = [
                each
                for patch in np.argsort(areas, kind="stable")[:3].tolist()
                for each in dissolved(self.pattern, trial.face_patch, patch)
            ]
            for face_patch in sorted(cut, key=self.rest_mm):
                tries += 1
                better = self.promising(face_patch, self.worse(trial), within=True)
                if better is not None:
                    found.append(better)
                    trial = better
                    break
                if tries == _TRIES:
                    return found
            else:
                return found
        return found

    def promising(
        self, face_patch: Ints, least: float, *, within: bool = False
    ) -> _NestedSplit | None:
        """The split nested by the first pass; None if J cannot be below ``least``, or, with
        ``within``, is not.
        """
        rest = self.rest_mm(face_patch)
        if rest + self.worth * self.goal >= least:
            return None
        most = (least - rest) / self.worth * (1 - 1e-9)
        try:
            framed, patches, problem = self.framed(face_patch)
            if max(problem.least_price, self.goal) > most:
                return None
            nesting = first_nesting(problem, most if within else math.inf)
        except LayoutError:
            return None  # The stock does not suffice, or a tab on another side is too wide for it.
        if nesting is None:
            return None
        return _NestedSplit(face_patch, framed, patches, problem, nesting, rest)

    def trial(self, face_patch: Ints) -> _NestedSplit:
        framed, patches, problem = self.framed(face_patch)
        nesting = first_nesting(problem)
        assert nesting is not None
        return _NestedSplit(face_patch, framed, patches, problem, nesting, self.rest_mm(face_patch))

    def split(self, room: Space, options: LayoutOptions, *, improve: bool = False) -> Ints:
        return split(
            self.pattern,
            room.width,
            room.height,
            self.material,
            options,
            turns=room.turns,
            improve=improve,
        )

    def framed(self, face_patch: Ints) -> tuple[FramedPatches, tuple[Patch, ...], Problem]:
        """The patches of a split, those of all copies, and the problem of nesting them."""
        outlined = outline_split(self.pattern, face_patch, self.room, self.material, self.options)
        framed = framed_patches(self.pattern, outlined, self.sheet)
        patches = copied(framed.patches, self.copies)
        outlines = tuple(patch.outline_mm for patch in patches)
        labels = tuple(patch.label for patch in patches)
        return framed, patches, Problem(outlines, labels, self.stock.kinds)

    def worse(self, trial: _NestedSplit) -> float:
        """J of a split."""
        return self.worth * trial.price + trial.rest_mm

    def rest_mm(self, face_patch: Ints) -> float:
        """J of a split without its sheets."""
        return self.seam_mm(face_patch) + self.slivers_mm(face_patch)

    def seam_mm(self, face_patch: Ints) -> float:
        """The length of all seams of a split, those between pieces, too."""
        pair = self.pattern.edges_faces
        seam = (pair >= 0).all(axis=1) & (face_patch[pair[:, 0]] != face_patch[pair[:, 1]])
        seam &= self.pattern.edges_assignment != "C"
        return self.copies * (float(self.lengths[seam].sum()) + self.joins)

    def shares(self, face_patch: Ints) -> Floats:
        """The areas of the patches that are cut off their pieces, over their mean."""
        areas = patch_areas(self.areas, face_patch)
        first = np.unique(face_patch, return_index=True)[1]
        piece = self.piece[first]
        cut = areas[np.bincount(piece)[piece] > 1]
        return cut / cut.mean() if len(cut) else np.ones(1)

    def slivers_mm(self, face_patch: Ints) -> float:
        small = np.maximum(0.0, _SLIVER - self.shares(face_patch)) / _SLIVER
        return self.copies * self.worth / 4 * float(small.sum())

    def key(self, face_patch: Ints) -> tuple[int, float, float]:
        """What equal splits have in common."""
        smallest = float(self.shares(face_patch).min())
        return int(face_patch.max()), round(self.seam_mm(face_patch), 3), round(smallest, 6)

    def made(self, final: _NestedSplit, trials: list[_NestedSplit]) -> Plan:
        """The plan, with the alternatives that have fewer sheets or less glue."""
        rows = {
            each.nesting.sheets: each
            for each in sorted(trials, key=lambda each: -self.seam_mm(each.face_patch))
        }
        rows[final.nesting.sheets] = final
        kept, shortest = [], math.inf
        for each in (rows[sheets] for sheets in sorted(rows)):
            glue = self.seam_mm(each.face_patch)
            if glue < shortest - 1e-6 or each is final:
                kept.append(each)
                shortest = min(shortest, glue)
        at = kept.index(final)
        shown = [kept[k] for k in sorted({0, at, len(kept) - 1})]
        alternatives = tuple(
            Alternative(
                each.nesting.sheets,
                len(each.patches),
                round(self.seam_mm(each.face_patch), 3),
                round(float(self.shares(each.face_patch).min()), 4),
                each is final,
            )
            for each in shown
        )
        return Plan(final.framed, final.patches, final.nesting, alternatives)
