"""``miurafab energy``: how hard a folded sheet resists being unfolded or pulled."""

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
    from miurafab.origami.energy.pull import PullCurve

EXAMPLES = (
    "miurafab energy hypar.fold",
    "miurafab energy hypar.fold --material card-250 -o energy.csv",
    "miurafab energy hypar.fold --pull corners --strain 0.2 -o pull.html",
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
        option(
            File(), "Write a plot (.png, .svg), a table (.csv) or a page (.html).", "-o", "--out"
        ),
    ] = None,
    material: Annotated[
        str | None,
        option(
            Text("NAME"),
            "Give the energy in joules for this material: a shipped name or a TOML file with a "
            "modulus. With --pull it is the usual material, if none is named.",
        ),
    ] = None,
    console: Console = Console(),
    **given: Any,
) -> int:
    """Measure the energy on the way from folded to flat, or the force of a pull.

    Prints the barrier and where it is, the stable states, and the stiffness at the folded form.
    Exits with 1 if the way to flat was lost. Each of several pieces is measured by itself. With
    --pull it prints the force in newtons at the largest extension of each cycle, and how much
    longer the sheet stays when it is let go.
    """
    if out is not None:
        from miurafab.origami.plotting import RESULTS

        new_file(out, "The energy", (*RESULTS, ".html"))
    # a page shows the sheet too, and both are of one reading of the file
    shown = miurafab.load(file) if out is not None and out.suffix.lower() == ".html" else None
    thing = file if shown is None else shown
    with console.progress("pulling" if "pull" in given else "unfolding") as progress:
        curve = miurafab.energy(thing, material=material, on_progress=progress, **given)
    answer = curve.report()
    if out is not None:
        if shown is not None:
            from miurafab.workflow.energy_page import write_energy_page

            write_energy_page(curve, shown, out, title=file.stem)
        else:
            curve.save(out, title=file.stem)
        answer["file"] = str(out)
    console.answer(answer, lambda: _show(console, curve, answer))
    return DONE if curve.converged else NO


def _show(
    console: Console, curve: EnergyCurve | PieceEnergies | PullCurve, answer: dict[str, Any]
) -> None:
    hidden = ("stable_states", "pieces", "cycles", "curve", "pulled")
    console.facts({key: answer[key] for key in answer if key not in hidden})
    if "cycles" in answer:
        _rows(console, answer["cycles"], "cycle strain force_n set_mm work_j dissipated_j")
    elif "pieces" in answer:
        keys = "piece facets rigid bistable barrier barrier_angle_deg stiffness"
        _rows(console, answer["pieces"], keys)
    elif answer["stable_states"]:
        rows = [[state["angle_deg"], state["energy"]] for state in answer["stable_states"]]
        console.rows(("stable at (deg)", f"energy ({answer['energy_unit']})"), rows)
    console.line(curve.verdict())


def _rows(console: Console, entries: list[dict[str, Any]], keys: str) -> None:
    rows = [[entry.get(key, "") for key in keys.split()] for entry in entries]
    console.rows([key.replace("_", " ") for key in keys.split()], rows)
