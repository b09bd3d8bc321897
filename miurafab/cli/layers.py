"""``miurafab layers``: which facet lies on which when a pattern is folded flat."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import argument, option, takes
from miurafab.errors import DONE, NO
from miurafab.files import new_file
from miurafab.options import File

if TYPE_CHECKING:
    from miurafab.workflow.layers import Layers

EXAMPLES = (
    "miurafab layers miura.fold -o layers.fold",
    "miurafab layers miura.fold --orders 10",
)


def _own_options() -> type:
    from miurafab.workflow.layers import LayerOptions

    return LayerOptions


@takes(_own_options)
def layers(
    file: Annotated[Path, argument("FILE", "The pattern: .fold, .svg, .dxf, .cp or .opx.")],
    /,
    *,
    out: Annotated[
        Path | None,
        option(File(), "Write the pattern folded flat, with faceOrders (.fold).", "-o", "--out"),
    ] = None,
    console: Console = Console(),
    **given: str,
) -> int:
    """Find the order of the layers of a pattern that is folded flat.

    A sheet that folds rigidly has its order in closed form. For any other pattern all orders are
    searched. Exits with 1 if the layers have no order.
    """
    if out is not None:
        new_file(out, "The pattern folded flat", (".fold",))
    found = miurafab.layers(file, **given)
    answer: dict[str, Any] = found.report()
    if out is not None and found.exists:
        found.save(out, title=file.stem)
        answer["file"] = str(out)
    console.answer(answer, lambda: _show(console, found, answer))
    return DONE if found.exists else NO


def _show(console: Console, found: Layers, answer: dict[str, Any]) -> None:
    console.facts(_facts(answer))
    console.findings(found.findings)


def _facts(answer: dict[str, Any]) -> dict[str, Any]:
    """The figures of an order with names for a person."""
    facts: dict[str, Any] = {
        "Layers have an order": "yes" if answer["exists"] else "no",
        "Found by": answer["method"],
    }
    if answer["orders"] is not None:
        more = "all there are" if answer["complete"] else "there may be more"
        facts["Orders"] = f"{answer['orders']:,} ({more})"
    if answer["agrees"] is not None:
        facts["Closed form agrees"] = "yes" if answer["agrees"] else "no"
    if "pairs" in answer:
        facts["Overlapping pairs"] = answer["pairs"]
        facts["Undecided pairs"] = answer["undecided"]
        facts["Levels"] = answer["levels"]
        facts["Folded flat"] = f"to {answer['flat_mismatch']:.1e} of the mean edge"
    if answer.get("file"):
        facts["File"] = answer["file"]
    return facts
