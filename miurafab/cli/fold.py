"""``miurafab fold``: the folding motion of a pattern, as a file that moves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import miurafab
from miurafab.cli.console import Console
from miurafab.cli.declared import argument, option, takes
from miurafab.errors import DONE, NO, InputError, OptionError
from miurafab.files import new_file
from miurafab.findings import counted
from miurafab.options import File, read_options

if TYPE_CHECKING:
    from miurafab.origami.folding.kinematics import FoldingMotion
    from miurafab.workflow.folding import Folding

EXAMPLES = (
    "miurafab fold hypar.fold -o hypar.gif",
    "miurafab fold hypar.fold -o hypar.html --colour strain",
    "miurafab fold miura.fold --thickness 2mm --panels panels.dxf",
    "miurafab fold miura.fold --thickness 4mm --method bennett",
)


def _own_options() -> type:
    from miurafab.workflow.fold_options import FoldOptions

    return FoldOptions


@takes(_own_options)
def fold(
    file: Annotated[
        Path,
        argument(
            "FILE",
            "The pattern: .fold, or another format with fold angles or mountains and valleys.",
        ),
    ],
    /,
    *,
    out: Annotated[
        Path | None,
        option(File(), "The motion: .fold, .gif, .glb or .html.", "-o", "--out"),
    ] = None,
    csv: Annotated[
        Path | None, option(File(), "Write the fold angle of every crease in every frame.")
    ] = None,
    panels: Annotated[
        Path | None,
        option(
            File(),
            "Write the panels: outlines (.dxf, .svg), parts for `sheets` (.fold), or solids "
            "(.stl, .glb).",
        ),
    ] = None,
    console: Console = Console(),
    **given: str,
) -> int:
    """Fold a pattern and write its motion.

    The closed form is used where it applies. Otherwise the facets bend as little as possible: from
    nearly flat to the folded form of the file, or from flat by mountains and valleys alone. The
    answer says which, and whether the facets could all stay flat.
    """
    from miurafab.workflow.fold_options import ENDINGS, FoldOptions, check_colour

    asked = read_options(FoldOptions, given)
    if out is not None:
        new_file(out, "The motion", ENDINGS)
        check_colour(out, by_strain=asked.colour == "strain")
    if panels is not None:
        from miurafab.origami.formats.panels import PANEL_ENDINGS

        new_file(panels, "The drawing of the panels", PANEL_ENDINGS)
        if asked.thickness_mm is None:
            raise InputError(f"{panels} needs a `thickness` of the panels, such as 3mm.")
    if "method" in given and asked.thickness_mm is None:
        raise OptionError("method", "is for panels; add a `thickness` such as 3mm")
    # panels are of the same reading of the file
    pattern = file if asked.thickness_mm is None else miurafab.load(file)
    with console.progress("folding") as progress:
        folding = miurafab.fold(pattern, asked.steps, timeout=asked.timeout, on_progress=progress)
        thick = made = None
        if asked.thickness_mm is not None:
            from miurafab.workflow.panels import thickness_report

            thick = miurafab.thick_panels(
                pattern, asked.thickness_mm, method=asked.method, on_progress=progress
            )
            made = thickness_report(thick)
        written = None if made is None or made["facets_too_small"] else panels
        if out is not None:
            folding.save(
                out,
                title=file.stem,
                colour=asked.colour,
                thickness_mm=asked.thickness_mm or 0.0,
                on_progress=progress,
            )
        if csv is not None:
            folding.save_angles(csv)
        if thick is not None and written is not None:
            thick.save(written, title=file.stem)
    answer: dict[str, Any] = folding.report()
    for name, path in (("file", out), ("csv", csv), ("panels", written)):
        answer[name] = None if path is None else str(path)
    answer["thickness"] = made
    console.answer(answer, lambda: _show(console, folding, answer))
    if panels is not None and written is None:
        console.note(f"{panels} is not written, since facets are too small for such panels.")
    if made is not None and written is not None and written.suffix.lower() == ".fold":
        first, last = made["parts"][0], made["parts"][-1]
        console.note(
            f"Each part is a patch, {first['patch']} being {first['name']} and {last['patch']} "
            f"{last['name']}. Lay them out: miurafab sheets {written} -o job --material ..."
        )
    return DONE if made is None or made.get("usable", made["folds"]) else NO


def _show(console: Console, folding: Folding, answer: dict[str, Any]) -> None:
    contacts, thick = answer["self_contacts"], answer["thickness"]
    console.facts(_facts(answer))
    console.findings(folding.findings)
    for run in _runs(contacts):
        console.line(_sentence(run, folding.motion))
    if thick is not None and thick["method"] == "bennett":
        _show_plates(console, thick)
    elif thick is not None:
        _show_thickness(console, thick)


def _facts(answer: dict[str, Any]) -> dict[str, Any]:
    """The figures of a motion with names and units for a person."""
    from miurafab.origami.folding.kinematics import CLOSED_FORM

    frames, layers = len(answer["self_contacts"]), answer["layers"]
    by = "by " if answer["method"] == CLOSED_FORM else ""
    facts = {
        "Motion": f"{answer['motion']}, {by}{answer['method']}",
        "Folds rigidly": "yes" if answer["rigid"] else "no",
        "Largest strain": f"{answer['max_strain']:.1e} of a side or diagonal",
    }
    if by:
        facts["Loops close"] = f"within {answer['max_mismatch']:.1e} of the mean edge"
    if "angle_error_deg" in answer:
        facts |= {
            "Fold angles": f"{answer['angle_error_deg']:.1f}° from those asked for, in the mean",
            "Wrong signs": f"{100 * answer['wrong_signs']:.3g} % of the creases",
            "Stable": "in every frame" if answer["stable"] else "not in every frame",
            "Snaps": answer["snaps"],
            "Contact": "springs keep facets apart" if answer["contact"] else "none to keep apart",
        }
        if answer["waiting_edges"]:
            facts["Wait for others"] = counted(len(answer["waiting_edges"]), "crease", "creases")
    facts["Frames"] = answer["frames"]
    if answer["pieces"] > 1:
        facts["Pieces"] = answer["pieces"]
    most = answer["piercings"]
    facts["Passes through itself"] = (
        f"in {counted(frames, 'frame', 'frames')}, up to "
        f"{counted(most, 'pair of facets', 'pairs of facets')}"
        if frames
        else "never"
    )
    if layers is not None:
        pairs = counted(layers["pairs"], "overlapping pair", "overlapping pairs")
        known = "in a known order" if layers["known"] else "without a known order"
        facts["Layers"] = f"{pairs} of facets at the end, {known}"
    named = (("File", "file"), ("Fold angles in", "csv"), ("Panels in", "panels"))
    return facts | {name: answer[key] for name, key in named if answer[key] is not None}


def _runs(contacts: list[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """The contacts in runs of frames that follow each other."""
    runs: list[list[dict[str, Any]]] = []
    for contact in contacts:
        if runs and contact["frame"] == runs[-1][-1]["frame"] + 1:
            runs[-1].append(contact)
        else:
            runs.append([contact])
    return runs


def _sentence(run: list[dict[str, Any]], motion: FoldingMotion) -> str:
    from miurafab.origami.folding.judge_motion import median_fold

    first, last = run[0], run[-1]
    frames, angles = f"frame {first['frame']}", f"{median_fold(motion, first['frame']):.0f}"
    if len(run) > 1:
        frames = f"frames {first['frame']} to {last['frame']}"
        angles += f" to {median_fold(motion, last['frame']):.0f}"
    most = max(len(contact["facets"]) for contact in run)
    a, b = first["facets"][0]
    pairs = "1 pair of facets passes" if most == 1 else f"up to {most} pairs of facets pass"
    where = f"{frames}, median fold angle {angles} degrees"
    return f"{where}: {pairs} through each other, the first being {a} and {b}"


def _show_thickness(console: Console, thick: dict[str, Any]) -> None:
    creases = thick["creases"]
    sides = [crease["closing_side"] for crease in creases]
    console.facts(
        {
            "folds": thick["folds"],
            "least_useful_area": thick["least_useful_area"],
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
            (c["edge"], c["assignment"], c["fold_deg"], c["closing_side"], c["offset_mm"])
            for c in widest
        ],
        title="the creases that are cut back most (--json lists all)",
    )
    if thick["folds"] and not thick["usable"]:
        console.line(
            f"of the smallest panel {thick['least_useful_area']:.0%} is left on one side, too "
            "little to use"
        )
    _show_too_small(console, thick)
    for collision in thick["collisions"][:8]:
        a, b = collision["facets"]
        angle = f"{collision['median_fold_deg']:.3g} degrees"
        console.line(f"at a median fold angle of {angle} panels {a} and {b} collide")


def _show_too_small(console: Console, thick: dict[str, Any]) -> None:
    for facet in thick["facets_too_small"][:8]:
        limit = facet["greatest_thickness_mm"]
        console.line(f"facet {facet['facet']} is too small: it can be {limit:.3g} mm thick")


def _show_plates(console: Console, thick: dict[str, Any]) -> None:
    patches = thick["patches"]
    console.facts(
        {
            "folds": thick["folds"],
            "patches": len(patches),
            "brackets": sum(len(patch["brackets"]) for patch in patches),
            "highest_over_lowest_axis_mm": max(patch["range_mm"] for patch in patches),
            "clear_up_to_deg": min(patch["clear_deg"] for patch in patches),
        },
        title=f"plates {thick['thickness_mm']:g} mm thick on shifted hinges",
    )
    _show_too_small(console, thick)
    for seam in thick["seams"]:
        one, other = seam["between"]
        slits = ", ".join(map(str, seam["slits"]))
        if seam["patch"] is None:
            console.line(
                f"patches {one} and {other}: no hinge joins them; fold both and strap them "
                f"together at edges {slits}, then up to {seam['opens_mm']:.3g} mm apart"
            )
        else:
            hinges = ", ".join(map(str, seam["hinges"])) or "none"
            console.line(
                f"patch {seam['patch']}, blocks {one} and {other}: hinges at edges {hinges}; slit "
                f"along {slits}, which opens up to {seam['opens_mm']:.3g} mm"
            )
    if any(seam["patch"] is None for seam in thick["seams"]):
        console.line("Patches that are strapped together keep the folded form and no longer move.")
    for number, patch in enumerate(patches):
        if patch["collision"] is not None:
            a, b = patch["collision"]
            console.line(
                f"patch {number}: beyond {patch['clear_deg']:.3g} degrees plates {a} and {b} "
                "collide"
            )
