"""Irregular bin packing, with packingsolver: searches as long as it may.

Sheets in a given quantity cost next to nothing, so that they are used up first. All sheets must
allow the same rotations, because the solver asks for those of an outline.
"""

from __future__ import annotations

from typing import Any

from packingsolver import irregular

from miurafab.errors import LayoutError
from miurafab.fabrication.nesting.problem import (
    Problem,
    Report,
    Slot,
    grown,
    renumbered,
)

_GIVEN = 1e-3
"""What a mm² of a sheet in given quantity costs against one of which there are as many."""


def packingsolver_engine(problem: Problem, report: Report) -> bool:
    """Every better layout that the solver finds; ends by itself where none can be better."""
    builder = irregular.InstanceBuilder()
    kinds, gap = problem.stock.kinds, problem.stock.gap
    rotations = kinds[0].rotations
    if any(kind.rotations != rotations for kind in kinds):
        raise LayoutError(
            "packingsolver cannot nest on sheets whose grain runs in different ways; use the "
            "engine raster, or leave some sheets out of the stock."
        )
    one = len(kinds) == 1
    objective = irregular.Objective
    builder.set_objective(objective.BinPacking if one else objective.VariableSizedBinPacking)
    for kind in kinds:
        count = len(problem.outlines)
        number = builder.add_bin_type(
            irregular.build_rectangle(0.0, kind.width + gap, 0.0, kind.height + gap),
            cost=kind.width * kind.height * (1.0 if kind.quantity is None else _GIVEN),
            copies=count if kind.quantity is None else min(kind.quantity, count),
        )
        for ring in kind.defects:
            corners = [(x + gap / 2, y + gap / 2) for x, y in ring]
            shape = irregular.ShapeWithHoles(irregular.build_shape(corners))
            builder.add_defect(number, -1, shape)
    for outline in problem.outlines:
        corners = [(float(x), float(y)) for x, y in grown(outline, gap).tolist()]
        builder.add_item_type(
            irregular.build_shape(corners),
            allowed_rotations=[(float(turn), float(turn), False) for turn in rotations],
            copies=1,
        )
    parameters = irregular.OptimizeParameters()
    parameters.time_limit = problem.seconds
    parameters.verbosity_level = 0
    parameters.messages_to_stdout = False

    def tell(output: Any) -> None:
        if output.solution.full() and output.solution.feasible():
            report(_slots(output.solution, gap))

    parameters.new_solution_callback = tell
    output = irregular.optimize(builder.build(), parameters)
    tell(output)
    return bool(output.is_proven_optimal())


def _slots(solution: Any, gap: float) -> list[Slot]:
    found: dict[int, Slot] = {}
    sheet = 0
    for position in range(solution.number_of_different_bins()):
        packed = solution.bin(position)
        for _ in range(packed.copies):
            for item in packed.items:
                corner = item.bl_corner
                found[item.item_type_id] = Slot(
                    sheet,
                    packed.bin_type_id,
                    corner.x - gap / 2,
                    corner.y - gap / 2,
                    round(item.angle) % 360,
                )
            sheet += 1
    return renumbered([found[number] for number in sorted(found)])
