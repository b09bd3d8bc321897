"""``miurafab energy``: how hard a folded sheet resists being unfolded or pulled."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import miurafab
from miurafab.cli.console import Console, readable
from miurafab.cli.declared import argument, option, takes
from miurafab.errors import DONE, NO
from miurafab.files import new_file
from miurafab.findings import counted
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


_OF_CYCLES = {
    "cycle": "cycle",
    "strain": "strain",
    "force_n": "force (N)",
    "set_mm": "longer by (mm)",
    "work_j": "work (J)",
    "dissipated_j": "dissipated (J)",
}
_OF_PIECES = {
    "piece": "piece",
    "facets": "facets",
    "rigid": "rigid",
    "bistable": "bistable",
    "barrier": "barrier",
    "barrier_angle_deg": "at (deg)",
    "energy_unit": "unit",
    "stiffness": "stiffness (per rad²)",
}


def _own_options() -> type:
    from miurafab.workflow.energy_options import EnergyOptions

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
    console.facts(_pulled(answer) if "cycles" in answer else _unfolded(answer))
    if "cycles" in answer:
        _rows(console, answer["cycles"], _OF_CYCLES)
    elif "pieces" in answer:
        _rows(console, answer["pieces"], _OF_PIECES)
    elif answer["stable_states"]:
        rows = [[state["angle_deg"], state["energy"]] for state in answer["stable_states"]]
        console.rows(("stable at (deg)", f"energy ({answer['energy_unit']})"), rows)
    console.line(curve.verdict())


def _unfolded(answer: dict[str, Any]) -> dict[str, Any]:
    """The figures of a curve, or of several pieces, with names and units for a person."""
    facts: dict[str, Any] = {"Converged": answer["converged"]}
    if "barrier" in answer:
        unit, at = answer["energy_unit"], answer["barrier_angle_deg"]
        where = "" if at is None else f" at {at:.1f}°"
        first, last = answer["folded_angle_deg"], answer["last_angle_deg"]
        facts |= {
            "Barrier": f"{readable(answer['barrier'])} {unit}{where}",
            "Bistable": answer["bistable"],
            "Energy when flat": f"{readable(answer['flat_energy'])} {unit}",
            "Highest energy": f"{readable(answer['highest_energy'])} {unit}",
            "Stiffness": f"{readable(answer['stiffness'])} {unit} per rad²",
            "Driven crease": f"{answer['crease']}, from {first:.1f}° to {last:.1f}° in "
            f"{answer['steps']} steps",
        }
    facts["Folds rigidly"] = answer["rigid"]
    return facts | ({"File": answer["file"]} if "file" in answer else {})


def _pulled(answer: dict[str, Any]) -> dict[str, Any]:
    """The figures of a pull with names and units for a person."""
    (one, other), left, through = answer["pulled"], answer["set_mm"], answer["piercings"]
    facts: dict[str, Any] = {
        "Converged": answer["converged"],
        "Pulled": f"vertices {one} and {other}, {answer['distance_mm']:.1f} mm apart, by "
        f"{100 * answer['cycles'][0]['strain']:.3g} %",
        "Force": f"{answer['force_n']:.3g} N, {answer['largest_force_n']:.3g} N at most",
        **({} if left is None else {"Stays longer by": f"{round(left, 6) + 0.0:.3g} mm"}),
        "Creases that yield": f"{100 * answer['yielded']:.3g} %",
        "Facets that cross": counted(through, "pair", "pairs") if through else "none",
        **({"Contact": "springs keep facets apart"} if answer["contact"] else {}),
        "Material": f"{answer['thickness_mm']:.3g} mm thick, modulus "
        f"{answer['modulus_pa'] / 1e9:.3g} GPa, crease length {answer['crease_length_mm']:.3g} mm",
    }
    if answer["yield_angle_deg"] is not None:
        facts["Creases yield"] = f"at {answer['yield_angle_deg']:.3g}°, then with "
        facts["Creases yield"] += f"{100 * answer['hardening']:.3g} % of their stiffness"
    for name, key in (("Second", "second"), ("Third", "third")):
        change = answer[f"{key}_cycle_change_n"]
        if change is not None:
            facts[f"{name} cycle"] = f"{change:.1e} N off the one before"
    return facts | ({"File": answer["file"]} if "file" in answer else {})


def _rows(console: Console, entries: list[dict[str, Any]], columns: dict[str, str]) -> None:
    rows = [[entry.get(key, "") for key in columns] for entry in entries]
    console.rows(list(columns.values()), rows)
