"""``miurafab fold``: the folding motion of a pattern, as a file that moves."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import miurafab
from miurafab.cli.console import Console, JsonOption, QuietOption
from miurafab.units import parse_length


def fold(
    file: Annotated[
        Path, typer.Argument(help="The pattern: .fold, or another format with fold angles or M/V.")
    ],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="The motion: .fold .gif .glb or .html.")
    ] = None,
    steps: Annotated[int, typer.Option(help="How many steps the motion has.")] = 40,
    csv: Annotated[
        Path | None, typer.Option(help="Write the fold angle of every crease in every frame.")
    ] = None,
    colour: Annotated[
        str, typer.Option(help="What the facets are coloured by: side or strain.")
    ] = "side",
    thickness: Annotated[
        str | None,
        typer.Option(help="Also say how panels of this thickness have to be made; exit 1 if none."),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Fold a pattern and write its motion.

    Rigidly where it can be, else by bending its facets as little as possible.
    """
    console = Console(as_json, quiet)
    if colour not in ("side", "strain"):
        raise typer.BadParameter(f"'{colour}' is neither side nor strain.", param_hint="--colour")
    if out is not None:
        miurafab.check_motion_file(out)
    panel_mm = None if thickness is None else parse_length(thickness)
    pattern = miurafab.read_pattern(file)
    with console.progress("folding") as progress:
        folding = miurafab.fold(pattern, steps, progress)
        if out is not None:
            miurafab.write_motion(
                folding, out, file.stem, by_strain=colour == "strain", on_progress=progress
            )
        if csv is not None:
            miurafab.write_angles(folding, csv)
        panels = None if panel_mm is None else miurafab.thick_panels(pattern, panel_mm, progress)
    answer: dict[str, Any] = folding.report()
    answer |= {"file": None if out is None else str(out), "csv": None if csv is None else str(csv)}
    answer["thickness"] = None if panels is None else miurafab.thickness_report(panels)
    if not folding.motion.is_rigid:
        console.remark(
            f"The sheet does not fold rigidly (its facets would miss each other by up to "
            f"{folding.mismatch:.2g} mean edges), so its facets bend: from nearly flat to the "
            "folded form."
        )
    console.answer(answer, lambda: _show(console, answer))
    if panels is not None and not panels.folds:
        raise typer.Exit(1)


def _show(console: Console, answer: dict[str, Any]) -> None:
    contacts, thick = answer["self_contacts"], answer["thickness"]
    hidden = ("states", "self_contacts", "thickness")
    facts = {key: value for key, value in answer.items() if key not in hidden and value is not None}
    facts["self_contacts"] = f"in {len(contacts)} frames" if contacts else "none"
    console.facts(facts)
    for run in _runs(contacts):
        console.line(_of_run(run))
    if thick is not None:
        _show_thickness(console, thick)


def _runs(contacts: list[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """The contacts in runs of frames that follow each other."""
    runs: list[list[dict[str, Any]]] = []
    for contact in contacts:
        if runs and contact["frame"] == runs[-1][-1]["frame"] + 1:
            runs[-1].append(contact)
        else:
            runs.append([contact])
    return runs


def _of_run(run: list[dict[str, Any]]) -> str:
    first, last = run[0], run[-1]
    frames, states = f"frame {first['frame']}", f"s = {first['state']:.4g}"
    if len(run) > 1:
        frames = f"frames {first['frame']} to {last['frame']}"
        states += f" to {last['state']:.4g}"
    most = max(len(contact["facets"]) for contact in run)
    one, other = first["facets"][0]
    pairs = "1 pair of facets passes" if most == 1 else f"up to {most} pairs of facets pass"
    return f"{frames}, {states}: {pairs} through each other, the first being {one} and {other}"


def _show_thickness(console: Console, thick: dict[str, Any]) -> None:
    creases = thick["creases"]
    sides = [crease["hinge_side"] for crease in creases]
    console.facts(
        {
            "folds": thick["folds"],
            "least_scale": thick["least_scale"],
            "greatest_thickness_mm": thick["greatest_thickness_mm"],
            "close_on_top": sides.count("top"),
            "close_on_bottom": sides.count("bottom"),
            "max_offset_mm": thick["max_offset_mm"],
            "facets_too_small": len(thick["facets_too_small"]),
            "collisions": len(thick["collisions"]),
        },
        title=f"panels {thick['thickness_mm']:g} mm thick",
    )
    widest = sorted(creases, key=lambda crease: -crease["offset_mm"])[:8]
    console.rows(
        ("edge", "assignment", "fold deg", "cut back on", "by mm"),
        [
            (c["edge"], c["assignment"], c["fold_deg"], c["hinge_side"], c["offset_mm"])
            for c in widest
        ],
        title="the creases that are cut back most (all of them with --json)",
    )
    for facet in thick["facets_too_small"][:8]:
        limit = facet["greatest_thickness_mm"]
        console.line(f"facet {facet['facet']} is too small: it can be {limit:.3g} mm thick")
    for collision in thick["collisions"][:8]:
        one, other = collision["facets"]
        console.line(f"at s = {collision['state']:.3g} panels {one} and {other} collide")
