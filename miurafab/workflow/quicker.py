"""What would make a job quicker, measured: the same creases made in another way.

On the sheet with the most perforation the creases around the middle, up to :data:`SAMPLE` strokes,
are made as they are and in each other way, ordered, posted and timed like the sheet itself. The
share of time that the other way saves holds for all perforation of the job.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from miurafab.fabrication.perforation import MIN_STROKE_MM, perforate
from miurafab.fabrication.route.order import StrokeSet, corner_of, order_strokes
from miurafab.fabrication.sheets import DrawnLayout
from miurafab.fabrication.tooling import made_by
from miurafab.fabrication.toolpath import Toolpath
from miurafab.gcode.reading import read_program
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.motion.estimate import estimate
from miurafab.motion.parameters import Link, MotionParameters
from miurafab.posting import post
from miurafab.profiles import OPERATIONS, MachineProfile, Material
from miurafab.profiles.material import Crease, Perforation

if TYPE_CHECKING:
    from miurafab.workflow.sheet_job import SheetJob

SAMPLE = 1000
"""So many strokes are timed at most (a third of a second)."""
_WORTH = 0.05
"""A way that saves a smaller share of the time of the job is not told (judged)."""
_PERFORATE, _SCORE = OPERATIONS.index("perforate"), OPERATIONS.index("score")


@dataclass(frozen=True)
class QuickerWay:
    """A change that would make a job quicker.

    Attributes
    ----------
    change : str
        What to change, in words.
    seconds : float
        The time that the job would then take.
    """

    change: str
    seconds: float


def quicker_ways(job: SheetJob) -> tuple[QuickerWay, ...]:
    """The ways that save a twentieth of the time of ``job`` or more, the quickest first."""
    perforated = sum(sheet.operation_seconds.get("perforate", 0.0) for sheet in job.dry_runs)
    if perforated < _WORTH * job.seconds:
        return ()
    sample = _sample(job.layout)
    usual = _seconds(sample, job, 1.0, np.zeros(len(sample.edge), dtype=bool))
    ways = []
    for change, longer, scored in _ways(sample, job.material, job.machine):
        share = _seconds(sample, job, longer, scored) / usual
        ways.append(QuickerWay(change, round(job.seconds - perforated * (1.0 - share), 1)))
    worth = [way for way in ways if way.seconds <= (1.0 - _WORTH) * job.seconds]
    return tuple(sorted(worth, key=lambda way: way.seconds))


@dataclass(frozen=True, eq=False)
class _Sample:
    """N creases on the sheet of ``path``: their drawn ``ends`` (N, 2, 2) from the first vertex to
    the second of their pattern ``edge`` (N,), their ``patch`` (N,), and whether each is a
    ``valley`` (N,).
    """

    path: Toolpath
    ends: Floats
    edge: Ints
    patch: Ints
    valley: Bools


def _ways(
    sample: _Sample, material: Material, machine: MachineProfile
) -> Iterator[tuple[str, float, Bools]]:
    """Each other way in words, how much longer its dashes are, and which creases are scored."""
    knife, none = machine.tool.knife, np.zeros(len(sample.edge), dtype=bool)
    if machine.tool.kind == "pen":
        yield "valleys as lines, too (mode = 'score')", 1.0, ~none
        return
    if knife is None or (knife.s_shallow is not None and "score" not in knife.leave_out):
        if 0 < sample.valley.sum() < len(sample.valley):
            yield "valleys scored (mode = 'score')", 1.0, sample.valley
        yield "all creases scored (mode = 'score')", 1.0, ~none
    yield f"dashes of {2 * material.perforation.cut_mm:g} mm (cut)", 2.0, none


def _sample(layout: DrawnLayout) -> _Sample:
    """Whole creases around the middle of those on the sheet with the most perforation."""
    path = max(layout.passes, key=lambda each: each.length_of("perforate"))
    strokes = np.flatnonzero(path.operation == _PERFORATE)
    change = np.ones(len(strokes), dtype=bool)
    change[1:] = (np.diff(path.edge[strokes]) != 0) | (np.diff(path.patch[strokes]) != 0)
    first = np.flatnonzero(change)
    count = np.diff(np.append(first, len(strokes)))
    begin, end = strokes[first], strokes[first + count - 1]
    ends = np.stack([path.starts[begin], path.ends[end]], axis=1)
    middle = ends.mean(axis=1)
    near = np.argsort(np.linalg.norm(middle - middle.mean(axis=0), axis=1), kind="stable")
    taken = np.sort(near[np.cumsum(count[near]) <= max(SAMPLE, int(count[near[0]]))])
    edge, patch, ends = path.edge[begin[taken]], path.patch[begin[taken]], ends[taken]
    tail = _on_sheet(layout, path, edge, patch)
    away = np.linalg.norm(ends - tail[:, None], axis=2)
    ends = np.where((away[:, 0] > away[:, 1])[:, None, None], ends[:, ::-1], ends)
    from miurafab.fabrication.drawing.views import edge_letters

    letters = edge_letters(layout, layout.pattern)
    return _Sample(path, ends, edge, patch, letters[edge] == "V")


def _on_sheet(layout: DrawnLayout, path: Toolpath, edge: Ints, patch: Ints) -> Floats:
    """(N, 2) the first vertex of each ``edge`` of ``patch``, on the sheet of ``path``."""
    sheet = next(each for each in layout.sheets if path.sheet in each.passes)
    points = layout.pattern.vertices_coords[layout.pattern.edges_vertices[edge, 0]].copy()
    for placed in sheet.placements:
        own = patch == placed.patch
        if own.any():
            points[own] = placed.from_patch(layout.patches[placed.patch].from_pattern(points[own]))
    turned = path.sheet == sheet.back
    return np.asarray(points * [-1.0, 1.0] + [sheet.width_mm, 0.0] if turned else points)


def _seconds(sample: _Sample, job: SheetJob, longer: float, scored: Bools) -> float:
    """The time of the sample with dashes ``longer`` times as long, those ``scored`` as lines."""
    material = made_by(job.material, job.machine)
    starts, ends = [sample.ends[scored, 0]], [sample.ends[scored, 1]]
    crease, operation = [np.flatnonzero(scored)], [np.full(int(scored.sum()), _SCORE)]
    for kind, chosen in (("mountain", ~sample.valley), ("valley", sample.valley)):
        own = np.flatnonzero(chosen & ~scored)
        rule = _drawn(material.perforation_of(kind), longer, material.kerf_mm)
        drawn = replace(material, kerf_mm=0.0, creases={kind: Crease("perforate", rule)})
        dashes = perforate(sample.ends[own, 0], sample.ends[own, 1], drawn, kind)
        starts.append(dashes.starts)
        ends.append(dashes.ends)
        crease.append(own[dashes.crease])
        operation.append(np.full(len(dashes), _PERFORATE))
    group = np.concatenate(crease)
    points = np.stack([np.concatenate(starts), np.concatenate(ends)], axis=1).reshape(-1, 2)
    path = Toolpath(
        sheet=sample.path.sheet,
        width_mm=sample.path.width_mm,
        height_mm=sample.path.height_mm,
        points=points,
        offsets=2 * np.arange(len(group) + 1),
        operation=np.concatenate(operation),
        patch=sample.patch[group],
        edge=sample.edge[group],
    )
    ordered = order_strokes(
        StrokeSet(path, group, np.ones(len(group), dtype=np.int64)),
        job.pattern.edges_vertices,
        corner_mm=corner_of(job.machine, job.material),
    )
    program = read_program(post(ordered, job.machine, job.material), job.machine)
    link = Link.from_profile(job.machine)
    return estimate(program, MotionParameters.from_profile(job.machine), link).seconds


def _drawn(rule: Perforation, longer: float, kerf: float) -> Perforation:
    """``rule`` for strokes as they are drawn, between the ends of a crease as drawn."""
    least = MIN_STROKE_MM
    return Perforation(
        cut_mm=max(longer * rule.cut_mm - kerf, least),
        gap_mm=rule.gap_mm + kerf,
        end_bridge_mm=0.0,
        min_end_mm=max(rule.min_end_mm - kerf, least),
        fit=rule.fit,
    )
