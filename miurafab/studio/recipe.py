"""Command lines and a design file that repeat, without the page, what the page has done.

Command lines are quoted for a POSIX shell; Windows differs only where a value contains a blank.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from miurafab.studio.orders import LayoutOrder

PORT = "/dev/ttyUSB0"
"""The port in the command for cutting; readers put their own in its place."""

Value = str | int | bool | list[list[float]]
"""A list is the profile that was drawn."""


def fit_command(target: str, options: Mapping[str, Value], name: str) -> str:
    """``miurafab fit`` with the options of the page; with a drawn profile, of the design file."""
    if "profile" in options:
        return shlex.join(["miurafab", "fit", f"{name}.toml", "-o", f"{name}.fold"])
    return shlex.join(["miurafab", "fit", target, *_words(options), "-o", f"{name}.fold"])


def subject(
    name: str,
    parameters: Mapping[str, str],
    options: Mapping[str, Value],
    labels: Mapping[str, str],
) -> str:
    """What a result is a result of: the target and its options, by their ``labels`` on the page.

    >>> subject("vase", {"neck": "0.4"}, {"facets": "12x12"}, {"facets": "Facets"})
    'vase, neck 0.4 · Facets 12x12'
    """
    words = [", ".join([name, *(f"{key} {value}" for key, value in parameters.items())])]
    for key, value in options.items():
        label = labels.get(key, key)
        words.append(label if value is True else f"{label} {_said(value)}")
    return " · ".join(words)


def _said(value: Value) -> str:
    return f"of {len(value)} points" if isinstance(value, list) else str(value)


def check_command(file: str) -> str:
    """``miurafab check`` for a pattern that was opened."""
    return shlex.join(["miurafab", "check", file])


def sheets_command(file: str, name: str, layout: LayoutOrder, options: Mapping[str, Value]) -> str:
    """``miurafab sheets`` for ``layout``, with its ``options`` as the command line writes them."""
    words = ["miurafab", "sheets", file, "-o", job_name(name)]
    words += ["--machine", layout.machine, "--material", layout.material, *_words(options)]
    words += ["--formats", layout.formats] if layout.formats else []
    return shlex.join(words)


def both(first: str, second: str, *, sound: bool) -> str:
    """Two commands in one line. The second runs only if the first answers yes, where ``sound``."""
    return f"{first} {'&&' if sound else ';'} {second}"


def cut_command(name: str) -> str:
    """``miurafab cut`` for the unpacked job, with :data:`PORT`."""
    return shlex.join(["miurafab", "cut", job_name(name), "--port", PORT])


def job_name(name: str) -> str:
    """The name of the job directory of the pattern ``name``."""
    return f"{name}-job"


def design_text(
    title: str,
    target: Mapping[str, Value],
    options: Mapping[str, Value],
    layout: Mapping[str, Value],
) -> str:
    """A design file (``miurafab fit DESIGN.toml``) that asks for the same."""
    drawn = {name: value for name, value in options.items() if name == "profile"}
    rest = {name: value for name, value in options.items() if name != "profile"}
    parts = ["# Made by miurafab studio.", *_lines({"title": title, **rest})]
    parts += ["", "[target]", *_lines({**target, **drawn})]
    if layout:
        parts += ["", "[layout]", *_lines(layout)]
    return "\n".join(parts) + "\n"


def _lines(values: Mapping[str, Value]) -> list[str]:
    # Texts, numbers and truth values are written in TOML as in JSON, but for surrogate pairs.
    return [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in values.items()]


def _words(options: Mapping[str, Value]) -> list[str]:
    words = []
    for key, value in options.items():
        words.append("--" + key.replace("_", "-"))
        if value is not True:
            words.append(str(value))
    return words
