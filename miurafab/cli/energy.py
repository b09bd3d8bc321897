"""``miurafab energy``: how hard a folded sheet resists being unfolded."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import argument, option, takes
from miurafab.errors import DONE, NO
from miurafab.files import new_file
from miurafab.options import File, Text

if TYPE_CHECKING:
    from miurafab.origami.energy.curve import EnergyCurve
    from miurafab.origami.energy.pieces import PieceEnergies

EXAMPLES = (
    "miurafab energy hypar.fold",
    "miurafab energy hypar.fold --material card-250 -o energy.csv",
)


def _own_options() -> type:
    from miurafab.workflow.energy import EnergyOptions

    return EnergyOptions


@takes(_own_options)
def energy(
    file: Annotated[Path, argument("FILE", "The pattern, a FOLD file.")],
    /,
    *,
    out: Annotated[
        Path | None,
        option(File(), "Write a plot (.png, .svg) or a table (.csv).", "-o", "--out"),
    ] = None,
    material: Annotated[
        str | None,
        option(
            Text("NAME"),
            "Give the energy in joules for this material: a shipped name or a TOML file with a "
            "modulus.",
        ),
    ] = None,
    console: Console = Console(),
    **given: Any,
) -> int:
    """Measure the energy on the way from folded to flat.

    Prints the barrier and where it is, the stable states, and the stiffness at the folded form.
    Exits with 1 if the way to flat was lost. Each of several pieces is measured by itself.
    """
    if out is not None:
        from miurafab.origami.plotting import RESULTS

        new_file(out, "The energy", RESULTS)
    with console.progress("unfolding") as progress:
        curve = miurafab.energy(file, material=material, on_progress=progress, **given)
    answer = curve.report()
    if out is not None:
        curve.save(out, title=file.stem)
        answer["file"] = str(out)
    console.answer(answer, lambda: _show(console, curve, answer))
    return DONE if curve.converged else NO


def _show(console: Console, curve: EnergyCurve | PieceEnergies, answer: dict[str, Any]) -> None:
    console.facts({key: answer[key] for key in answer if key not in ("stable_states", "pieces")})
    if "pieces" in answer:
        keys = ("piece", "facets", "rigid", "bistable", "barrier", "barrier_angle_deg", "stiffness")
        rows = [[piece.get(key, "") for key in keys] for piece in answer["pieces"]]
        console.rows([key.replace("_", " ") for key in keys], rows)
    elif answer["stable_states"]:
        rows = [[state["angle_deg"], state["energy"]] for state in answer["stable_states"]]
        console.rows(("stable at (deg)", f"energy ({answer['energy_unit']})"), rows)
    console.line(curve.verdict())
