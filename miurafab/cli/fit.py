"""``miurafab fit``: fit a tessellation to a target, write the pattern and the report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.findings import findings_json
from miurafab.workflow.json_text import json_text

TargetArgument = Annotated[
    str,
    typer.Argument(help="A named surface (hypar:height=0.5), a design .toml, or a mesh file."),
]


def fit(
    target: TargetArgument,
    out: Annotated[Path, typer.Option("-o", "--out", help="The FOLD file to write.")],
    facets: Annotated[
        str | None,
        typer.Option(
            help="Facets as COLUMNSxROWS [default: 20x20; with both --max-deviation and "
            "--min-edge, the coarsest sheet that meets them]."
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(
            help="Longest side of the folded bounding box "
            "[default: 200mm; a mesh keeps its file's size]."
        ),
    ] = None,
    amplitude: Annotated[
        str | None,
        typer.Option(help="Height of the corrugation over the row spacing [default: automatic]."),
    ] = None,
    zigzag: Annotated[
        str | None, typer.Option(help="Zig-zag over the column spacing [default: automatic].")
    ] = None,
    min_edge: Annotated[str | None, typer.Option(help="The shortest edge allowed.")] = None,
    max_deviation: Annotated[
        str | None, typer.Option(help="The farthest the mid-surface may lie from the target.")
    ] = None,
    flat_foldable: Annotated[
        str | None, typer.Option(help="exact, off, or a limit on |pi - a1 - a3| [default: off].")
    ] = None,
    rigid: Annotated[
        bool, typer.Option("--rigid", help="The same as --flat-foldable exact.")
    ] = False,
    region: Annotated[
        str | None,
        typer.Option(
            help="For meshes: the part to cover, u0,u1,v0,v1 of the layout, as fractions or "
            "lengths [default: automatic]."
        ),
    ] = None,
    rotate: Annotated[
        str | None, typer.Option(help="For meshes: turn the grid by this angle.")
    ] = None,
    seed: Annotated[
        str | None, typer.Option(help="Seed of the random attempts [default: 0].")
    ] = None,
    close: Annotated[
        str | None,
        typer.Option(
            help="For surfaces of revolution and the circular cylinder: sector (of the angle "
            "given), open (all round but one facet), or seam (all round, to be glued) "
            "[default: sector]."
        ),
    ] = None,
    follow: Annotated[
        str | None,
        typer.Option(help="What lies on the target: middle, top or bottom [default: middle]."),
    ] = None,
    min_angle: Annotated[str | None, typer.Option(help="The least sector angle allowed.")] = None,
    max_angle: Annotated[
        str | None, typer.Option(help="The greatest sector angle allowed.")
    ] = None,
    max_aspect: Annotated[
        str | None, typer.Option(help="The greatest ratio of two sides of a facet.")
    ] = None,
    polish: Annotated[
        str | None,
        typer.Option(
            help="Bring the sheet as close to the target as it goes: on, off, or auto (where a "
            "limit is not met or flat-foldability is asked for) [default: auto]."
        ),
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="Also write the report to this JSON file.")
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Fit a generalized Miura-ori to a target surface."""
    console = Console(as_json, quiet)
    wanted = miurafab.design(
        target,
        facets=facets,
        size=size,
        amplitude=amplitude,
        zigzag=zigzag,
        min_edge=min_edge,
        max_deviation=max_deviation,
        flat_foldable="exact" if rigid else flat_foldable,
        seed=seed,
        region=region,
        rotate=rotate,
        close=close,
        follow=follow,
        min_angle=min_angle,
        max_angle=max_angle,
        max_aspect=max_aspect,
        polish=polish,
    )
    for finding in wanted.findings:
        console.remark(finding.sentence)
    with console.progress("fitting") as progress:
        result = miurafab.fit(wanted.request, progress)
    answer = result.report()
    answer["findings"] = findings_json((*wanted.findings, *result.findings))
    if result.pattern is not None:
        miurafab.save_pattern(result.pattern, out, wanted.title)
        answer["file"] = str(out)
    if report is not None:
        report.write_text(json_text(answer) + "\n", encoding="utf-8", newline="\n")
    shown = {
        key: value
        for key, value in answer.items()
        if key not in ("attempts", "findings") and value != ""
    }
    console.answer(answer, lambda: console.facts(shown))
    if result.status != "converged":
        raise typer.Exit(1)
