"""The reply parser: a line from the controller becomes an event.

Parsing never raises. A line must match a form as a whole; any other line (``o\\x80k``, half a
status report) becomes :class:`~miurafab.grbl.events.Unknown`, so noise never passes for an ``ok``.

The forms are those of GRBL 1.1 (``report.c``); grblHAL and FluidNC keep and extend them. The
comma-separated status report of GRBL 0.9 (``<Idle,MPos:...,WPos:...>``) is read too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from miurafab.grbl.events import (
    Alarm,
    Banner,
    Error,
    Event,
    Feedback,
    Modes,
    Ok,
    Options,
    Parameter,
    Setting,
    StartupBlock,
    StatusReport,
    Unknown,
    Version,
)

_BANNER = re.compile(r"(grbl\w*) (\S+) \[.*\]", re.IGNORECASE)
_ANSWER = re.compile(r"(error|ALARM): ?(.+)")
_STATUS = re.compile(r"<([A-Z][A-Za-z]*)(?::(\d+))?((?:[|,][^<>]*)?)>")
_BEFORE_NAME = re.compile(r",(?=[A-Za-z])")  # in ``,MPos:1,2,3,WPos:4,5,6`` of GRBL 0.9
_BRACKET = re.compile(r"\[(\w[\w.]*):(.*)\]")
_MODES = re.compile(r"\[(?:GC:)?([GM]\d[\dGMTFS. -]*)\]")
_PARAMETER = re.compile(r"\[(G5[4-9](?:\.[1-3])?|G28|G30|G92|TLO):(-?[\d.]+(?:,-?[\d.]+)*)\]")
_STARTUP = re.compile(r"\$N(\d)=(.*)")
_SETTING = re.compile(r"\$(\d+)=([^()]*?)(?: *\(.*\))?")


def parse_reply(text: str) -> Event:
    """The event of a line, which has no line end; never raises. Blanks at its end say nothing."""
    text = text.rstrip(" \t")
    if text == "ok":
        return Ok()
    for form, read in _FORMS:
        match = form.fullmatch(text)
        if match is not None:
            try:
                return read(match) or Unknown(text)
            except ValueError:
                return Unknown(text)
    return Unknown(text)


def _answer(match: re.Match[str]) -> Event:
    kind, text = match[1], match[2]
    code = int(text) if text.isdigit() else None
    return Error(code, text) if kind == "error" else Alarm(code, text)


def _status(match: re.Match[str]) -> Event | None:
    state, substate, body = match[1], match[2], match[3]
    fields: dict[str, Any] = {}
    for part in body.split("|") if "|" in body else _BEFORE_NAME.split(body):
        name, colon, value = part.partition(":")
        if part and not colon:
            return None
        reader = _FIELDS.get(name)
        if reader is not None:
            fields.update(reader(value))
    return StatusReport(state, None if substate is None else int(substate), **fields)


def _numbers(value: str) -> tuple[float, ...]:
    numbers = tuple(float(item) for item in value.split(","))
    if not all(map(math.isfinite, numbers)):
        raise ValueError(value)
    return numbers


def _whole(value: str) -> tuple[int, ...]:
    return tuple(int(item) for item in value.split(","))


def _feed_and_speed(value: str) -> dict[str, Any]:
    feed, speed = _numbers(value)[:2]
    return {"feed": feed, "speed": speed}


def _buffers(value: str) -> dict[str, Any]:
    planner_free, rx_free = _whole(value)
    return {"planner_free": planner_free, "rx_free": rx_free}


_FIELDS: dict[str, Callable[[str], dict[str, Any]]] = {
    "MPos": lambda value: {"machine_position": _numbers(value)},
    "WPos": lambda value: {"work_position": _numbers(value)},
    "WCO": lambda value: {"work_offset": _numbers(value)},
    "Bf": _buffers,
    "Ln": lambda value: {"line_number": int(value)},
    "FS": _feed_and_speed,
    "F": lambda value: {"feed": _numbers(value)[0]},
    "Pn": lambda value: {"pins": value},
    "Ov": lambda value: {"overrides": _whole(value)},
    "A": lambda value: {"accessories": value},
}


def _bracket(match: re.Match[str]) -> Event | None:
    tag, body = match[1], match[2]
    if tag == "MSG":
        return Feedback(body)
    if tag == "VER":
        version, _, text = body.partition(":")
        return Version(version, text)
    if tag == "OPT":
        flags, *numbers = body.split(",")
        planner_blocks, rx_bytes, *_ = [*map(int, numbers[:2]), None, None]
        return Options(flags, planner_blocks, rx_bytes)
    return Version(tag, body) if tag[0].isdigit() else None  # GRBL 0.9: [0.9j.20160303:]


_FORMS: tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], Event | None]], ...] = (
    (_STATUS, _status),
    (_ANSWER, _answer),
    (_PARAMETER, lambda match: Parameter(match[1], _numbers(match[2]))),
    (_MODES, lambda match: Modes(tuple(match[1].split()))),
    (_BRACKET, _bracket),
    (_STARTUP, lambda match: StartupBlock(int(match[1]), match[2])),
    (_SETTING, lambda match: Setting(int(match[1]), match[2])),
    (_BANNER, lambda match: Banner(match[1], match[2])),
)
