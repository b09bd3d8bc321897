"""``miurafab tradeoff``: accuracy against effort over a range of facet counts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.cli.fit import TargetArgument
from miurafab.errors import InputError


def tradeoff(
    target: TargetArgument,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="Write a plot (.png, .svg) or a table (.csv)."),
    ] = None,
    sides: Annotated[
        str | None,
        typer.Option(help="Facets along a side, with commas [default: 8,12,16,24,32,48]."),
    ] = None,
    weights: Annotated[
        str | None,
        typer.Option(help="Weights of effort in the cost, with commas [default: 0.05 to 0.95]."),
    ] = None,
    size: Annotated[str | None, typer.Option(help="Longest side of the folded form.")] = None,
    amplitude: Annotated[
        str | None, typer.Option(help="As for fit [default: automatic, the same for all].")
    ] = None,
    zigzag: Annotated[
        str | None, typer.Option(help="As for fit [default: automatic, the same for all].")
    ] = None,
    flat_foldable: Annotated[
        str | None, typer.Option(help="exact, off, or a limit [default: off].")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Processes here [default: one a processor].")
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option(help="Run on the dask cluster at this address (tcp://HOST:8786)."),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Trade accuracy against effort for a target.

    Fit it with more and more facets and compare distances, area and cost.
    """
    console = Console(as_json, quiet)
    if out is not None:
        miurafab.check_tradeoff_file(out)
    asked: dict[str, Any] = {}
    if sides is not None:
        asked["sides"] = _whole_numbers(sides)
    if weights is not None:
        asked["weights"] = _numbers(weights)
    with console.progress("fitting") as progress:
        found = miurafab.tradeoff(
            target,
            **asked,
            options={
                "size": size,
                "amplitude": amplitude,
                "zigzag": zigzag,
                "flat_foldable": flat_foldable,
            },
            workers=workers or os.cpu_count() or 1,
            cluster=cluster,
            on_progress=progress,
        )
    answer = found.report()
    if out is not None and (found.curves or out.suffix.lower() == ".csv"):
        miurafab.write_tradeoff(found, out, target)
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
        console.line(f"A/A0 tends to {found.area_limit:.4f}")
        table = [(c.weight, c.best_facets, round(c.optimal_facets)) for c in found.curves]
        console.rows(("weight of effort", "cheapest sheet", "cheapest by the law"), table)

    console.answer(answer, show)
    if not found.curves:
        raise typer.Exit(1)


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise InputError(
            f"--weights is '{text}'; write numbers with commas between, such as 0.2,0.5,0.8."
        ) from None


def _whole_numbers(text: str) -> list[int]:
    words = [word.strip() for word in text.split(",")]
    if not all(word.isdigit() for word in words):
        raise InputError(f"--sides is '{text}'; write whole numbers such as 8,16,32.")
    return [int(word) for word in words]
