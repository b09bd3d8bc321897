"""What the Machine tab shows, as values for JSON: of the state, the job, the settings, a sheet."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from miurafab.gcode.program import strokes
from miurafab.grbl.settings import Settings, describe, profile_settings
from miurafab.machine.known_controller import MachineState
from miurafab.machine.preflight import check_settings
from miurafab.profiles import MachineProfile
from miurafab.studio.machine_words import (
    SET_HERE,
    beam_words,
    box_words,
    place_words,
    plain,
    power_words,
    settings_verdict,
    stroke_words,
)
from miurafab.workflow.at_machine import Operator
from miurafab.workflow.dry_run import LAYERS, SheetPreview, clock_text

_HOMING = 22
_MOST_POINTS = 200_000
"""A sheet of more points is drawn in part: 2 MB go to the page."""


def state_table(state: MachineState) -> dict[str, Any]:
    """The state of the machine."""
    return {
        "state": state.state,
        "firmware": state.firmware,
        "beam_on": state.beam_on,
        "loaded": state.loaded is not None,
        "work": _place(state.position),
        "facts": {
            "beam": beam_words(state),
            "work": place_words(state.position),
            "at": place_words(state.machine_position),
            "offset": place_words(state.work_offset)
            + (SET_HERE if any(abs(value) > 5e-4 for value in state.shift[:2]) else ""),
            "loaded": f"burnt by {state.loaded}" if state.loaded else "fresh",
            "feed-percent": f"{state.overrides.feed} %",
            "power-percent": f"{state.overrides.power} %",
            "desk-firmware": state.firmware,
        },
        "homes": bool(state.settings.values.get(_HOMING)),
    }


def _place(place: tuple[float, ...] | None) -> list[float] | None:
    return None if place is None else [round(value, 3) for value in place[:3]]


def progress_table(operator: Operator) -> dict[str, Any]:
    """What is being done, and how far it has come."""
    progress = operator.progress
    table: dict[str, Any] = {
        "busy": operator.busy,
        "sheet": operator.number,
        "sheets": [] if operator.prepared is None else [j.name for j in operator.prepared.jobs],
        "next": operator.describe() if operator.prepared is not None else "",
        "progress": None,
        "waits": "",
        "material_wanted": operator.wants_material,
    }
    if progress is not None:
        told = progress.stream.state
        table["waits"] = told.partition(":")[0] if told.startswith("waiting") else ""
        table["progress"] = {
            "stroke": progress.stroke,
            "share": progress.share,
            "words": stroke_words(progress.stroke, progress.strokes, progress.seconds_left),
        }
    return table


def burn_table(operator: Operator) -> list[list[str]]:
    """What the armed sheet burns, as names and values."""
    burn, state = operator.burn(), operator.state
    assert operator.prepared is not None
    port = "" if state is None else state.port
    return [
        ["Job", operator.prepared.name],
        ["Sheet", burn.sheet],
        ["Material", burn.material or "not known: a plain file"],
        ["Most power", power_words(burn.power, burn.watts)],
        ["Bounds", box_words(burn.bounds_mm)],
        ["Origin", place_words(None if state is None else state.work_offset) + " of the machine"],
        ["Strokes, time", f"{burn.strokes}, about {clock_text(burn.seconds)}"],
        ["Machine, port", f"{operator.prepared.machine.title}, {port}"],
    ]


def settings_table(machine: MachineProfile, settings: Settings) -> dict[str, Any]:
    """The settings that a job relies on: what the profile wants, what the controller has; those
    that differ first. ``refused`` is the sentence with which a job would be refused.
    """
    wanted = profile_settings(machine)
    differ = {each.number for each in settings.differences(wanted)} if settings.texts else set()
    in_order = sorted(wanted.items(), key=lambda pair: (pair[0] not in differ, pair[0]))
    findings = check_settings(machine, settings) if settings.texts else ()
    return {
        "verdict": settings_verdict(len(differ), told=bool(settings.texts)),
        "differ": len(differ),
        "refused": " ".join(plain(finding.sentence) for finding in findings),
        "rows": [
            {
                "name": describe(number),
                "here": settings.texts.get(number, "missing"),
                "wanted": f"{value:g}",
                "same": number not in differ,
            }
            for number, value in in_order
            if settings.texts
        ],
    }


def sheet_drawing(sheet: SheetPreview) -> dict[str, Any]:
    """The strokes of a sheet in the order in which they are burnt, as flat lists of X and Y in
    hundredths of a millimetre.
    """
    burnt = strokes(sheet.program)
    count = len(burnt)
    while count and int(burnt.offsets[count]) > _MOST_POINTS:
        count //= 2
    points = (100 * burnt.points[:, :2]).round().astype(int)
    return {
        "name": sheet.name,
        "paper": list(sheet.paper_mm),
        "view": list(sheet.view_mm),
        "bounds": None if sheet.bounds_mm is None else list(sheet.bounds_mm),
        "strokes": [
            points[burnt.offsets[at] : burnt.offsets[at + 1]].ravel().tolist()
            for at in range(count)
        ],
        "layers": sheet.layer[burnt.first_move[:count]].tolist(),
        "all": len(burnt),
        "kinds": [asdict(layer) for layer in LAYERS],
    }
