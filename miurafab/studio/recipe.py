"""The same again without the page: the command lines, and the design file, for what was done.

Command lines are quoted as a POSIX shell reads them; Windows differs only where a value holds a
blank.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping

PORT = "/dev/ttyUSB0"
"""The port in the command that is to be pasted: it is for the reader to change."""

Value = str | int | bool


def fit_command(target: str, options: Mapping[str, Value], name: str) -> str:
    """``miurafab fit`` for what the page was asked."""
    return shlex.join(["miurafab", "fit", target, *_words(options), "-o", f"{name}.fold"])


def check_command(file: str) -> str:
    """``miurafab check`` for a pattern that was opened."""
    return shlex.join(["miurafab", "check", file])


def sheets_command(
    file: str, name: str, machine: str, material: str, options: Mapping[str, Value]
) -> str:
    """``miurafab sheets`` for what the page was asked."""
    words = ["miurafab", "sheets", file, "-o", job_name(name)]
    words += ["--machine", machine, "--material", material, *_words(options)]
    return shlex.join(words)


def both(first: str, second: str, *, sound: bool) -> str:
    """One line for two commands; the second runs even if the first answers no and not ``sound``."""
    return f"{first} {'&&' if sound else ';'} {second}"


def cut_command(name: str) -> str:
    """What cuts the job once it is unpacked; the port is to be replaced."""
    return shlex.join(["miurafab", "cut", job_name(name), "--port", PORT])


def job_name(name: str) -> str:
    """What the job directory of the pattern ``name`` is called."""
    return f"{name}-job"


def design_text(
    title: str,
    target: Mapping[str, str],
    options: Mapping[str, Value],
    layout: Mapping[str, Value],
) -> str:
    """A design file (``miurafab fit DESIGN.toml``) that asks for the same."""
    parts = ["# Made by miurafab studio.", *_lines({"title": title, **options})]
    parts += ["", "[target]", *_lines(target)]
    if layout:
        parts += ["", "[layout]", *_lines(layout)]
    return "\n".join(parts) + "\n"


def _lines(values: Mapping[str, Value]) -> list[str]:
    # JSON's texts, numbers and truth values are TOML's, once nothing but ASCII is left
    return [f"{key} = {json.dumps(value)}" for key, value in values.items()]


def _words(options: Mapping[str, Value]) -> list[str]:
    words = []
    for key, value in options.items():
        words.append("--" + key.replace("_", "-"))
        if value is not True:
            words.append(str(value))
    return words
