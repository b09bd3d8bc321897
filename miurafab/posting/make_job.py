"""From the strokes of a sheet to the file of one machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from miurafab.errors import ProfileError
from miurafab.fabrication.drawing.hpgl import sheet_hpgl
from miurafab.fabrication.knife import axis_way, tip_way
from miurafab.fabrication.toolpath import Toolpath
from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.geometry.arrays import Ints
from miurafab.motion.estimate import estimate
from miurafab.motion.parameters import Link, MotionParameters
from miurafab.posting.absolute_moves import hops
from miurafab.posting.between import Between, heights_of
from miurafab.posting.dialects import depth, made_by_knife, words_of
from miurafab.posting.relative_moves import apart, chains
from miurafab.posting.strokes import Points, Runs, points_of, repeated, runs_of, without_lifts
from miurafab.posting.text import ByteRows, comment
from miurafab.profiles import OPERATIONS, MachineProfile, Material

NO_PATCH = "-"
"""The text of ``(patch ...)`` for strokes that belong to no patch."""
_WORTH_IT = 0.98
"""Relative moves are chosen where they take less than this share of the time."""
_BITS_A_BYTE = 10  # a start and a stop bit (8N1)


def post(
    toolpath: Toolpath,
    machine: MachineProfile,
    material: Material,
    *,
    patch_labels: Mapping[int, str] | None = None,
) -> Job:
    """The file of ``toolpath`` for ``machine``: G-code, or HPGL for a cutter.

    G-code is in mm, plain ASCII, coordinates rounded to 0.001 mm. Places are absolute; only where
    the wire is too slow for the dashes, by the estimate, are gaps written as relative ``G1 S0``.
    ``(sheet ...)``, ``(operation ...)`` and ``(patch ...)`` stand on lines of their own before the
    strokes they hold for, the patch by its label in ``patch_labels``, else by its number. An
    operation of several passes repeats each run of strokes of one patch, so that the sheet cools
    between two passes over the same place. Between two runs, with the beam off, the head goes to
    the height of the next and the air is switched; after the last it goes back to Z0. The job
    starts and ends dark. A knife's strokes are those of its holder
    (:mod:`miurafab.fabrication.knife`). A pen stays down between strokes that meet.

    Raises :class:`~miurafab.errors.LayoutError` for a stroke that leaves the bed, has no length
    at 0.001 mm or is not finite, for a name that cannot stand in a comment and for what a knife
    cannot make, and :class:`~miurafab.errors.ProfileError` for a machine that this cannot write
    for.
    """
    points_of(toolpath, machine)  # names strokes as the layout numbers them
    knife = machine.tool.knife
    left_out: tuple[str, ...] = ()
    if knife is not None:
        left_out = made_by_knife(toolpath, knife, machine)
        toolpath = tip_way(without_operations(toolpath, left_out), knife, machine.bed.margin_mm)
    if machine.tool.kind == "pen":
        toolpath = without_lifts(toolpath)
    operations = material.on(machine).operations
    runs = runs_of(toolpath, [operations[name].passes for name in OPERATIONS])
    heights = heights_of(runs, machine, material)
    made = repeated(toolpath, runs)
    if knife is not None:
        made = axis_way(made, knife)
    if machine.dialect == "hpgl":
        return _hpgl(made, machine, material)
    points = points_of(made, machine)
    words = words_of(machine, material)
    head = [
        comment("sheet", toolpath.sheet),
        comment("machine", machine.name),
        comment("material", material.name),
        *(comment("left out", name) for name in left_out),
        *(f"{word}\n" for word in words.begin),
    ]
    labels = patch_labels or {}

    between = Between(runs, heights, operations, words)

    def job(lines: tuple[ByteRows, Ints], *modes: str) -> Job:
        foot = [f"{word}\n" for word in (*modes, *between.back, *words.end)]
        body = _body(runs, *lines, labels, between.lines("".join(f"{mode} " for mode in modes)))
        return Job(toolpath.sheet, "".join([*head, *body, *foot]))

    absolute = hops(points, words)
    if words.chains and _wire_is_short(points, runs, absolute[0], machine, material):
        hopping, chained = job(absolute), job(chains(points, words, runs.first), "G90")
        quicker = _seconds(chained, machine) < _WORTH_IT * _seconds(hopping, machine)
        return chained if quicker else hopping
    return job(absolute)


def without_operations(toolpath: Toolpath, names: Sequence[str]) -> Toolpath:
    """``toolpath`` without the strokes of the operations ``names``."""
    if not names:
        return toolpath
    keep = ~np.isin(toolpath.operation, [OPERATIONS.index(name) for name in names])
    size = np.diff(toolpath.offsets)
    return replace(
        toolpath,
        points=toolpath.points[np.repeat(keep, size)],
        offsets=np.concatenate([[0], np.cumsum(size[keep])]).astype(np.int64),
        operation=toolpath.operation[keep],
        patch=toolpath.patch[keep],
        edge=toolpath.edge[keep],
    )


def _hpgl(made: Toolpath, machine: MachineProfile, material: Material) -> Job:
    if machine.tool.kind == "laser":
        raise ProfileError(
            f"{machine.name}: HPGL moves a pen or a knife and cannot set a laser's power; choose "
            "another machine."
        )
    points_of(made, machine)
    setup = {}
    for name, operation in material.on(machine).operations.items():
        # VS is in cm/s (HP-GL reference, "velocity select").
        speed = max(1, round(operation.feed_mm_min / 600.0))
        pressed = machine.tool.kind == "knife" or operation.force is not None
        force = f"FS{depth(machine, name, operation)};" if pressed else ""
        setup[name] = f"VS{speed};{force}"
    return Job(made.sheet, sheet_hpgl(made, setup=setup))


def _wire_is_short(
    points: Points, runs: Runs, rows: ByteRows, machine: MachineProfile, material: Material
) -> bool:
    """Whether the wire delays absolute moves so much that shorter lines may pay.

    A bound that needs no planner: how much longer the lines of each chain take on the wire than
    its motion does at full speed, summed, against all motion at full speed.
    """
    if not len(points.first):
        return False
    # Blanks are stripped before sending.
    sent = np.count_nonzero((rows != 0) & (rows != ord(" ")), axis=1)
    wire = sent * _BITS_A_BYTE / machine.controller.baud
    rapid = max(machine.motion.max_rate_mm_min)
    operations = material.on(machine).operations
    feeds = np.array([operations[name].feed_mm_min for name in OPERATIONS])
    feed = np.repeat(feeds[points.operation], np.diff(np.append(points.first, len(points.xy))))
    step = np.linalg.norm(np.diff(points.xy, axis=0, prepend=points.xy[:1]), axis=1) / 1000.0
    motion = step / np.where(points.starts, rapid, feed) * 60.0
    total = float(motion.sum())
    at = points.first[apart(points, runs.first)]
    motion[at] = wire[at] = 0.0
    wait = np.add.reduceat(wire, at) - np.add.reduceat(motion, at)
    return float(wait[wait > 0].sum()) > (1.0 - _WORTH_IT) * total


def _seconds(job: Job, machine: MachineProfile) -> float:
    link = Link.from_profile(machine)
    return estimate(parse_program(job), MotionParameters.from_profile(machine), link).seconds


def _body(
    runs: Runs,
    rows: ByteRows,
    row_of_stroke: Ints,
    labels: Mapping[int, str],
    between: Sequence[str],
) -> list[str]:
    """The lines of the strokes, a piece for each run, each with its comments and with what stands
    ``between`` it and the run before.
    """
    byte_of_row = np.concatenate([[0], np.cumsum(np.count_nonzero(rows, axis=1))])
    text = rows[rows != 0].tobytes().decode("ascii")
    cuts = [*byte_of_row[row_of_stroke[runs.first]].tolist(), len(text)]
    pieces = []
    operation_said = patch_said = None
    for run, (operation, patch) in enumerate(
        zip(runs.operation.tolist(), runs.patch.tolist(), strict=True)
    ):
        pieces.append(between[run])
        if operation != operation_said:
            pieces.append(comment("operation", OPERATIONS[operation]))
        if patch != patch_said:
            label = NO_PATCH if patch < 0 else labels.get(patch, str(patch))
            pieces.append(comment("patch", label))
        if runs.passes[run] > 1:
            pieces.append(comment("pass", f"{runs.number[run]} of {runs.passes[run]}"))
        pieces.append(text[cuts[run] : cuts[run + 1]])
        operation_said, patch_said = operation, patch
    return pieces
