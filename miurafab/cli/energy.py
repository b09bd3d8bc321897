"""``miurafab energy``: how hard a folded sheet resists being unfolded."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption


def energy(
    file: Annotated[Path, typer.Argument(help="The FOLD file of the pattern.")],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="Write a plot (.png, .svg) or a table (.csv)."),
    ] = None,
    material: Annotated[
        str | None,
        typer.Option(
            "--material",
            help="Joules instead of k_f L: a shipped material or a TOML file with a modulus.",
        ),
    ] = None,
    steps: Annotated[int, typer.Option(help="Steps from the folded form to flat.")] = 40,
    crease: Annotated[
        int | None,
        typer.Option(help="The edge that is driven [default: a crease in the middle]."),
    ] = None,
    crease_ratio: Annotated[
        float, typer.Option(help="Stiffness of the creases over that of the facets.")
    ] = 0.0,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Measure the energy on the way from folded to flat.

    The barrier and where it is, the stable states, and the stiffness at the target.
    """
    console = Console(as_json, quiet)
    if out is not None:
        miurafab.check_energy_file(out)
    pattern, _, _ = miurafab.load_pattern(file)
    with console.progress("unfolding") as progress:
        curve = miurafab.energy(
            pattern,
            steps,
            material=material,
            crease=crease,
            crease_ratio=crease_ratio,
            on_progress=progress,
        )
    answer = curve.report()
    if out is not None:
        miurafab.write_energy(curve, out, file.stem)
        answer["file"] = str(out)

    def show() -> None:
        console.facts({key: value for key, value in answer.items() if key != "stable_states"})
        if curve.stable:
            rows = [(state["angle_deg"], state["energy"]) for state in answer["stable_states"]]
            console.rows(("stable at (deg)", f"energy ({answer['energy_unit']})"), rows)
        console.line(curve.verdict())

    console.answer(answer, show)
    if not curve.path.converged:
        raise typer.Exit(1)
