"""The requests of the Machine tab: read strictly, and carried out by the desk.

============ =============================================================================
``machine/`` asks for
============ =============================================================================
connect      a session with ``machine`` at ``port``, both from the lists; answers with control
take         control
leave        the end of the session, dark
job          the job of the last layout, or the one that the command line named
do           an action by its name: home, unlock, set_origin, go_to_origin, frame, fresh
jog          a press of a jog key: ``x``, ``y`` (-1, 0, 1) times ``step``, one of the list
key          hold, resume, and the overrides: act at once
sheet        the sheet that is next
say          a line for the controller
arm, start   the two steps of a start; the second repeats the ``code`` of the first
disarm       nothing but that
abort        a reset, from any page
============ =============================================================================

All but ``connect``, ``take`` and ``abort`` carry the ``control`` that the page got.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from miurafab.errors import InputError
from miurafab.profiles import known_names
from miurafab.studio.desk import Desk
from miurafab.studio.orders import listed, read_order, text_of
from miurafab.workflow.at_machine import STEPS, Operator

KEYS = {
    "hold": " ",
    "resume": "r",
    "feed+": "+",
    "feed-": "-",
    "feed100": "0",
    "power+": "]",
    "power-": "[",
    "power100": "p",
}
"""The keys of a session that the page presses, by their names."""
ACTIONS: dict[str, Callable[[Operator], None]] = {
    "home": lambda operator: operator.do("home"),
    "unlock": lambda operator: operator.do("unlock"),
    "set_origin": lambda operator: operator.do("set_origin"),
    "go_to_origin": lambda operator: operator.do("go_to_origin"),
    "frame": lambda operator: operator.frame(),
    "fresh": lambda operator: operator.load(),
}
"""The actions of :class:`~miurafab.workflow.at_machine.Operator` that have a button."""


def carry_out(desk: Desk, route: str, body: bytes, put_on: Callable[[], None]) -> dict[str, Any]:
    """Do what the request ``route`` asks for; the answer besides the state.

    ``put_on`` puts the job on the desk. Raises :class:`~miurafab.errors.MiurafabError` for what is
    refused.
    """
    if route == "abort":
        desk.abort()
        return {}
    order = read_order(body, ("control", *_WORDS.get(route, ())))
    if route == "connect":
        machine = listed("machine", order.get("machine"), known_names("firmware_profiles"))
        return {"control": desk.connect(text_of("port", order.get("port")), machine)}
    if route == "take":
        return {"control": desk.take_over()}
    desk.require_control(text_of("control", order.get("control", "")))
    if route == "leave":
        desk.leave()
    elif route == "job":
        put_on()
    elif route == "arm":
        desk.arm()
    elif route == "start":
        desk.start(text_of("code", order.get("code")))
    else:
        desk.do(_work(route, order))
    return {}


_WORDS = {
    "connect": ("port", "machine"),
    "do": ("action",),
    "jog": ("x", "y", "step"),
    "key": ("key",),
    "sheet": ("number",),
    "say": ("text",),
    "start": ("code",),
}
"""What else a request may hold."""
ROUTES = (*_WORDS, "take", "leave", "job", "arm", "disarm", "abort")


def _work(route: str, order: dict[str, Any]) -> Callable[[Operator], None]:
    """What the operator has to do."""
    if route == "do":
        return ACTIONS[listed("action", order.get("action"), list(ACTIONS))]
    if route == "key":
        key = KEYS[listed("key", order.get("key"), list(KEYS))]
        return lambda operator: operator.press(key)
    if route == "jog":
        ways = [order.get("x"), order.get("y")]
        known = order.get("step") in STEPS and all(way in (-1, 0, 1) for way in ways)
        if not known or not any(ways):
            raise InputError("The page asked for a jog that the pad does not have; reload it.")
        dx, dy = (float(way or 0) * float(order["step"]) for way in ways)
        return lambda operator: operator.nudge(dx, dy)
    if route == "sheet":
        number = order.get("number")
        if type(number) is not int:
            raise InputError("The page asked for a sheet without a number; reload it.")
        return lambda operator: operator.choose(number)
    if route == "say":
        text = text_of("text", order.get("text"))

        def say(operator: Operator) -> None:
            operator.said.append(f"> {text}")
            operator.do("say", text=text)

        return say
    return _disarm


def _disarm(operator: Operator) -> None:
    operator.armed = False
