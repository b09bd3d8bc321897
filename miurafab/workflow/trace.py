"""The strokes of a program, compared with those that the pattern asks for.

Both are cut into segments. Each burnt segment must be a segment of a wanted stroke, made by the
operation of its kind and within :data:`NEAR_MM`, and each of these must be burnt exactly once in
each pass, at the height of that pass. A drag knife's segments are those of its tip
(:mod:`miurafab.fabrication.knife_tip`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from miurafab.fabrication.knife import with_aligning_cut
from miurafab.fabrication.knife_tip import overcuts, tip_moves
from miurafab.fabrication.route.order import HOLE, StrokeSet
from miurafab.fabrication.strokes import RIM, SLIT, SLOT
from miurafab.fabrication.toolpath import Toolpath
from miurafab.findings import Finding, counted
from miurafab.gcode.program import Program
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.nearest import tree_of
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.posting.dialects import made_by_knife
from miurafab.posting.make_job import without_operations
from miurafab.profiles import OPERATIONS, Knife, MachineProfile, Material
from miurafab.profiles.beam import Operation

NEAR_MM = 0.002
"""G-code is rounded to 0.001 mm, and relative moves add up to as much again."""
KNIFE_MM = 0.005
"""In a swivel the tip is pushed back by 0.001 mm, at a turn below ``corner_angle`` by 0.004 mm."""
HPGL_MM = 0.03
"""Plotters count in steps of 0.025 mm."""
SHORTEST_MM = 0.002
"""A shorter segment of a wanted stroke may vanish in the rounding of a program."""

KINDS = (
    "crease",
    "tab fold",
    "outline",
    "hole",
    "slit",
    "slot",
    "label",
    "rim number",
    "tick",
    "aligning cut",
)
_NAMED = 5
"""So many faults of one kind are named on a sheet; the others are counted."""


@dataclass(frozen=True, eq=False)
class _Segments:
    """N segments: ``ends`` (N, 4) in mm, the ``operation`` (N,), -1 where it is not said, and the
    ``stroke`` (N,) or move that each is of. Those longer than ``shortest`` are sure: no rounding
    and no swivel of a knife makes or loses them.
    """

    ends: Floats
    operation: Ints
    stroke: Ints
    shortest: float

    @property
    def sure(self) -> Bools:
        lengths = np.linalg.norm(self.ends[:, 2:] - self.ends[:, :2], axis=1)
        return np.asarray(lengths > self.shortest)


def traced_strokes(
    strokes: StrokeSet,
    pattern: CreasePattern,
    tab_edges: Ints,
    program: Program,
    machine: MachineProfile,
    material: Material,
    traced: Counter[str],
) -> Iterator[Finding]:
    """What of ``program`` is not what ``strokes`` ask for; ``traced`` counts the strokes of each
    kind that are right.
    """
    path, kinds = strokes.toolpath, _kinds(strokes, pattern, tab_edges)
    knife = machine.tool.knife
    near = HPGL_MM if machine.dialect == "hpgl" else NEAR_MM if knife is None else KNIFE_MM
    shortest = SHORTEST_MM if knife is None else 4 * near
    burnt = _burnt(program, 0.0 if knife is None else shortest)
    if knife is not None:
        path, kinds = _made_by_knife(path, kinds, knife, machine)
        burnt, faults = _of_tip(burnt, program, knife, 2 * near, path.sheet)
        yield from faults
    operations = material.on(machine).operations
    wanted = _wanted(path, shortest)
    yield from _compared(path, kinds, wanted, burnt, program, near, operations, traced)


def _made_by_knife(
    path: Toolpath, kinds: Ints, knife: Knife, machine: MachineProfile
) -> tuple[Toolpath, Ints]:
    """The strokes that the ``knife`` makes, with the cut that aligns it, and their kinds."""
    left_out = made_by_knife(path, knife, machine)
    kinds = kinds[~np.isin(path.operation, [OPERATIONS.index(name) for name in left_out])]
    path = without_operations(path, left_out)
    if knife.offset_mm == 0.0 or not len(path):
        return path, kinds
    aligned = with_aligning_cut(path, knife.offset_mm, machine.bed.margin_mm)
    return aligned, np.concatenate([[KINDS.index("aligning cut")], kinds])


def _of_tip(
    axis: _Segments, program: Program, knife: Knife, near: float, sheet: str
) -> tuple[_Segments, list[Finding]]:
    """The segments of the tip of the ``knife``, without overcuts, and what is wrong with these."""
    ends, stroke = tip_moves(axis.ends[:, :2], axis.ends[:, 2:], knife.offset_mm)
    beyond, short = overcuts(ends, stroke, knife.overcut_mm, near)
    faults = []
    for each in short.tolist():
        line = int(program.line[axis.stroke[np.argmax(stroke == each)]])
        says = f"goes round and not on by the overcut of {knife.overcut_mm:g} mm."
        faults.append(Finding("stroke", f"{sheet}: the stroke at line {line} {says}", sheet))
    own = ~beyond
    return (
        _Segments(ends[own], axis.operation[own], axis.stroke[own], axis.shortest),
        faults,
    )


def _compared(
    path: Toolpath,
    kinds: Ints,
    wanted: _Segments,
    burnt: _Segments,
    program: Program,
    near: float,
    operations: Mapping[str, Operation],
    traced: Counter[str],
) -> Iterator[Finding]:
    count = len(wanted.ends)
    # A segment may be burnt either way.
    both = np.concatenate([wanted.ends, wanted.ends[:, [2, 3, 0, 1]]])
    away, found = tree_of(both).query(burnt.ends)
    found = np.asarray(found) % max(count, 1)
    told = np.flatnonzero(away <= near * 2)
    as_told = burnt.operation[told]
    right = np.zeros(len(burnt.ends), dtype=bool)
    heights, passes = _heights(operations)
    off = np.abs(heights[wanted.operation[found[told]]] - program.end[burnt.stroke[told], 2:])
    right[told] = (as_told < 0) | (as_told == wanted.operation[found[told]])
    right[told] &= off.min(axis=1) <= near
    level = np.zeros(len(right), dtype=np.int64)
    level[told] = off.argmin(axis=1)
    # A knife turns round at the corners of strokes, and nowhere else.
    corners = tree_of(wanted.ends.reshape(-1, 2))
    off_corners = np.asarray(corners.query(burnt.ends.reshape(-1, 2))[0]).reshape(-1, 2)
    stray = ~right & (burnt.sure | (off_corners > near * 2).any(axis=1))
    for at in np.flatnonzero(stray)[:_NAMED].tolist():
        line = int(program.line[burnt.stroke[at]])
        x, y = burnt.ends[at, :2].tolist()
        yield Finding(
            "stroke",
            f"{path.sheet}: line {line} burns a stroke from X{x:.3f} Y{y:.3f} that is not of the "
            "pattern, or out of its place.",
            path.sheet,
        )
    if stray.sum() > _NAMED:
        others = counted(int(stray.sum()) - _NAMED, "more segment does", "more segments do")
        yield Finding("stroke", f"{path.sheet}: {others} so.", path.sheet)
    due = passes[wanted.operation]
    place = found[right] * passes.shape[1] + level[right]
    times = np.bincount(place, minlength=due.size).reshape(due.shape)
    less, more = (times < due).any(axis=1), (times > due).any(axis=1)
    for wrong, words in ((less, "not burnt"), (more, "burnt too often")):
        faulty = np.unique(wanted.stroke[wrong & wanted.sure])
        for stroke in faulty[:_NAMED].tolist():
            x, y = path.starts[stroke].tolist()
            edge = f" on edge {path.edge[stroke]}" if path.edge[stroke] >= 0 else ""
            yield Finding(
                "stroke",
                f"{path.sheet}: the {KINDS[kinds[stroke]]}{edge} from X{x:.3f} Y{y:.3f} is "
                f"{words}.",
                path.sheet,
            )
        if len(faulty) > _NAMED:
            others = counted(len(faulty) - _NAMED, "more stroke is", "more strokes are")
            yield Finding("stroke", f"{path.sheet}: {others} {words}.", path.sheet)
    right_kinds = np.delete(kinds, wanted.stroke[(less | more) & wanted.sure])
    traced.update(KINDS[kind] for kind in right_kinds.tolist())


def _heights(operations: Mapping[str, Operation]) -> tuple[Floats, Ints]:
    """(operations, h) the heights of the head in each operation, filled up with infinity, and how
    often each stroke is due at each.
    """
    found = [np.unique(operations[name].heights_mm, return_counts=True) for name in OPERATIONS]
    most = max(len(levels) for levels, _ in found)
    heights, due = np.full((len(found), most), np.inf), np.zeros((len(found), most), np.int64)
    for row, (levels, counts) in enumerate(found):
        heights[row, : len(levels)], due[row, : len(levels)] = levels, counts
    return heights, due


def _wanted(path: Toolpath, shortest: float) -> _Segments:
    stroke = np.repeat(np.arange(len(path)), np.diff(path.offsets))
    inner = stroke[1:] == stroke[:-1]
    ends = np.concatenate([path.points[:-1], path.points[1:]], axis=1)[inner]
    stroke = stroke[1:][inner]
    return _Segments(ends, path.operation[stroke], stroke, shortest)


def _burnt(program: Program, shortest: float) -> _Segments:
    burns = np.flatnonzero(program.beam_on)
    ends = np.concatenate([program.start[burns, :2], program.end[burns, :2]], axis=1)
    of_context = np.array(
        [
            OPERATIONS.index(c.operation) if c.operation in OPERATIONS else -1
            for c in program.contexts
        ]
    )
    return _Segments(ends, of_context[program.context[burns]], burns, shortest)


def _kinds(strokes: StrokeSet, pattern: CreasePattern, tab_edges: Ints) -> Ints:
    """(S,) the kind of each stroke, an index of :data:`KINDS`."""
    path = strokes.toolpath
    cut = path.operation == OPERATIONS.index("cut")
    engraved = path.operation == OPERATIONS.index("engrave")
    crease, tab_fold, outline, hole, slit, slot, label, rim, tick = range(9)
    return np.select(
        [
            engraved & (strokes.rank == RIM),
            engraved & (path.edge >= 0),
            engraved,
            cut & (strokes.rank == HOLE),
            cut & (strokes.rank == SLOT),
            path.edge < 0,
            np.isin(path.edge, tab_edges),
            np.isin(pattern.edges_assignment[path.edge], SLIT),
        ],
        [rim, tick, label, hole, slot, outline, tab_fold, slit],
        crease,
    )
