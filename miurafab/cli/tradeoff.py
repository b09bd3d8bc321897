"""``miurafab tradeoff``: accuracy against effort over a range of facet counts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import TargetArgument, option, takes
from miurafab.cli.fit import fit_options
from miurafab.errors import DONE, NO
from miurafab.files import new_file
from miurafab.options import File

EXAMPLES = (
    "miurafab tradeoff hypar --sides 4,6,8",
    "miurafab tradeoff saddle.stl --sides 4,5,6 --polish off -o tradeoff.csv",
)


def _own_options() -> type:
    from miurafab.workflow.tradeoff_options import TradeoffOptions

    return TradeoffOptions


@takes(_own_options, fit_options, without=("facets",))
def tradeoff(
    target: TargetArgument,
    /,
    *,
    out: Annotated[
        Path | None, option(File(), "Write a plot (.png, .svg) or a table (.csv).", "-o", "--out")
    ] = None,
    console: Console = Console(),
    **given: str,
) -> int:
    """Trade accuracy against effort for a target.

    Fits the target with more and more facets and compares distances, area and cost. Exits with 1
    if fewer than three sheets were found.
    """
    if out is not None:
        from miurafab.origami.plotting import RESULTS

        new_file(out, "The trade-off", RESULTS)
    given.setdefault("workers", str(os.cpu_count() or 1))
    with console.progress("fitting") as progress:
        found = miurafab.tradeoff(target, on_progress=progress, **given)
    answer = found.report()
    if out is not None and (found.curves or out.suffix.lower() == ".csv"):
        found.save(out, title=str(target))
        answer["file"] = str(out)

    def show() -> None:
        rows = [
            (s.columns * s.rows, f"{s.columns}x{s.rows}", s.status, s.hausdorff_mm,
             100 * s.hausdorff_relative if s.hausdorff_relative is not None else None, s.area_ratio)
            for s in found.samples
        ]  # fmt: skip
        head = ("facets", "grid", "status", "Hausdorff mm", "% of diagonal", "A/A0")
        console.rows(head, rows)
        if found.coefficient is None or found.law_error is None:
            console.line("Fewer than three sheets were found: there is no law to fit.")
            return
        console.line(
            f"distance = {100 * found.coefficient:.3g} % of the diagonal / n (n facets a side), to "
            f"{100 * found.law_error:.0f} %; left free, the power of n is {found.exponent:.3f}"
        )
        console.line(
            f"A/A0 tends to {found.area_limit:.4f} as 1 / n; left free, to "
            f"{found.area_free_limit:.4f} with the power {found.area_power:.2f} of n"
        )
        if found.midsurface_exponent is not None:
            power = f"{found.midsurface_exponent:.2f}"
            console.line(f"the distance of the mid-surface falls with the power {power} of n")
        table = [(c.weight, c.best_facets, round(c.optimal_facets)) for c in found.curves]
        console.rows(("weight of effort", "cheapest sheet", "cheapest by the law"), table)

    console.answer(answer, show)
    return DONE if found.curves else NO
