"""What the Machine tab says: every English text of it that is not in the page itself.

Sentences on a job, a setting or a refused line are those of the rooms below, as the command line
prints them. Here are the states of a machine in plain words, each with the next step, and the
refusals of the tab itself.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from miurafab.errors import spell_options
from miurafab.grbl.events import Alarm
from miurafab.grbl.streamer import alarm_words
from miurafab.machine.known_controller import MachineState
from miurafab.machine.owner import Owner
from miurafab.workflow.dry_run import clock_text

ENDED = "The session ended by itself."
FAILED = "The session of the studio failed; look at the machine."
NO_ANSWER = "The session does not answer; press Abort, and look at the machine."
OVER = "The session has ended; connect again."
VOID = "It was aborted before it was begun."
NO_SESSION = "No machine is connected; choose a port and press Connect."
ONE_SESSION = "A machine is connected already; disconnect it first."
NO_CONTROL = (
    "Another page controls the machine, or this one did before it was loaded anew; press 'Take "
    "over' to control it here. Abort works on every page."
)
NOT_ARMED = "Nothing is armed, or something else was done since; read what burns and arm it again."
NO_PORT = "That port is not in the list; look again which there are."
NO_JOB = "There is no job yet; lay a pattern out first, on the tab Layout."
PRACTICE = "practice machine, nothing burns"
LAPSED = "The arming has lapsed; arm the sheet again."
CONNECTING = "Connecting"
SET_HERE = ", set here"
OWN_PORT = "the port of 'miurafab use'"


@dataclass(frozen=True)
class StateWords:
    """A state in plain words: a ``title``, what it means and the next step in ``advice``, and how
    it looks: ``calm``, ``busy``, ``held`` or ``alarm``.
    """

    title: str
    advice: str = ""
    look: str = "calm"


_STATES = {
    "Idle": StateWords("Ready"),
    "Run": StateWords("Moving", "Stay beside the machine.", "busy"),
    "Jog": StateWords("Jogging", "", "busy"),
    "Home": StateWords(
        "Homing", "The controller says nothing until it has found its switches.", "busy"
    ),
    "Hold": StateWords(
        "Held", "The beam is off and the position is kept. Resume goes on; Abort ends it.", "held"
    ),
    "Hold:1": StateWords("Braking", "It comes to rest.", "held"),
    "Door": StateWords("Lid open", "Shut the lid; then press Resume or Abort.", "held"),
    "Door:0": StateWords("Lid shut again", "Resume goes on; Abort ends it.", "held"),
    "Door:2": StateWords("Lid open, braking", "It comes to rest.", "held"),
    "Door:3": StateWords("Going on", "", "busy"),
    "Check": StateWords("Check mode", "The controller reads lines and moves nothing.", "held"),
    "Sleep": StateWords("Asleep", "Abort wakes it by a reset; then home or unlock it.", "held"),
    "Alarm": StateWords("Alarm", "", "alarm"),
}
_OPENING = StateWords(CONNECTING, "The controller is greeted and asked for its settings.", "busy")
_STALE = StateWords("No answer", "", "alarm")

_RESET_FIRST = (1, 2)
"""After these GRBL takes nothing but a reset (``protocol.c``, ``[MSG:Reset to continue]``)."""
_KEEPS_PLACE = (2, 4, 5)
"""After these the position is still right."""
_ALARM = re.compile(r"ALARM:(\d+)")


def alarm_of(line: str) -> int | None:
    """The number of the alarm that a line of the controller tells, if it tells one."""
    found = _ALARM.match(line)
    return int(found[1]) if found else None


def state_words(
    word: str,
    *,
    silent_s: float,
    alarm: int | None,
    homes: bool,
    waits: str,
    homing: bool,
    material_wanted: str,
) -> StateWords:
    """The words for the state ``word`` of a status report, empty before the first.

    ``silent_s`` seconds nothing was heard; ``alarm`` is the last alarm's number; ``homes`` says
    that the machine has switches to home to; ``waits`` what a program waits for; ``homing`` that
    the controller was told to home, and is silent until it has; ``material_wanted`` what
    somebody does before the next sheet, if anything.
    """
    name = word.partition(":")[0]
    if homing:
        return _STATES["Home"]
    if silent_s > STALE_S and name:
        return StateWords(
            _STALE.title,
            f"Nothing was heard for {silent_s:.0f} s, so what stands here is old. Look at the "
            "machine, its power and its cable; if it burns, switch it off there.",
            _STALE.look,
        )
    if not name:
        return _OPENING
    if waits:
        return StateWords("Waiting for you", f"The program is {waits}. Press Resume.", "held")
    if name == "Idle" and material_wanted:
        return StateWords(
            "Waiting for you",
            "A sheet that is burnt lies in the machine. "
            f"{material_wanted[0].upper()}{material_wanted[1:]}; then press 'The sheet is in'.",
            "held",
        )
    if name == "Alarm":
        return StateWords("Alarm", _alarm_advice(alarm, homes), "alarm")
    return _STATES.get(word) or _STATES.get(name) or StateWords(name)


STALE_S = 2.0
"""A session asks for the state ten times a second; after so long a silence it is not known."""


def _alarm_advice(alarm: int | None, homes: bool) -> str:
    if alarm is None:
        what = "The controller is locked, as after its start or a reset in motion."
    else:
        text = alarm_words(Alarm(alarm, ""))
        what = f"{text[0].upper()}{text[1:]}."
    reset = (
        " Look at the machine and free what is stuck; Abort resets the controller; then"
        if alarm in _RESET_FIRST
        else " Look at the machine; then"
    )
    if alarm in _KEEPS_PLACE:
        return f"{what}{reset} press Unlock: the position is still right."
    if homes:
        return f"{what}{reset} press Home."
    return (
        f"{what}{reset} press Unlock (this machine has no homing), jog to the place of the origin "
        "and set it again."
    )


_LABELS = {
    "home": "'Home'",
    "at": "'Set origin here'",
    "force": "the option force of 'miurafab cut'",
    "sheet": "'Sheet'",
    "resume": "the option resume of 'miurafab cut'",
    "port": "'Port'",
    "machine": "'Machine'",
}


def spelled(text: str) -> str:
    """``text`` with options called as the tab calls them."""
    return spell_options(text, lambda name: _LABELS.get(name, f"'{name}'"))


def plain(sentence: str) -> str:
    """``sentence`` so, with its full stop."""
    text = spelled(sentence)
    return text if not text or text[-1] in ".!?" else f"{text}."


def power_words(power: float, watts: float | None) -> str:
    """The largest power of a sheet, in percent and in watts."""
    percent = f"{100 * power:.0f} % of full power"
    return percent if watts is None else f"{percent}, {watts:.1f} W"


def box_words(box: tuple[float, float, float, float] | None) -> str:
    """The box around what burns."""
    if box is None:
        return "nothing"
    return f"X {box[0]:g} to {box[2]:g} mm, Y {box[1]:g} to {box[3]:g} mm from the origin"


def place_words(place: tuple[float, ...] | None) -> str:
    """A place in mm."""
    return "not told" if place is None else f"X {place[0]:.2f}  Y {place[1]:.2f}"


def beam_words(state: MachineState) -> str:
    """What the controller says of its beam."""
    return "on" if state.beam_on else "off" if state.beam_off else "not told"


def stroke_words(stroke: int, strokes: int, seconds_left: float) -> str:
    """How far a sheet has come."""
    return f"stroke {stroke} of {strokes}, {clock_text(seconds_left)} left"


def settings_verdict(differ: int, *, told: bool) -> str:
    """The settings in a few words."""
    if not told:
        return "not told yet"
    return f"{differ} not as the profile says" if differ else "as the profile says"


def port_words(description: str) -> str:
    """What the system says of a port; pyserial writes ``n/a`` where it says nothing."""
    return "serial port" if description in ("", "n/a") else description


def held_words(owner: Owner) -> str:
    """Who has a port."""
    return f"held by {owner}"
