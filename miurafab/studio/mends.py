"""From a refusal to the buttons that mend it.

A sentence names an option in backquotes and a value beside it ("`holes` keep cuts the sheet along
it"). Where the option has a field on the page and takes that value, the page offers it as a button.
Poles have no value in a sentence: they are picked on the target.
"""

from __future__ import annotations

import re
from typing import Any

from miurafab.studio.form import FIT

_NAMED = re.compile(r"`(\w+)`(?: as)? ([^\s;`]+)")


def mends(sentence: str) -> list[dict[str, Any]]:
    """The options with the values that ``sentence`` names, in its order.

    >>> mends("`holes` keep cuts the sheet along it, `holes` all fills it.")
    [{'option': 'holes', 'value': 'keep'}, {'option': 'holes', 'value': 'all'}]
    """
    found: list[dict[str, Any]] = []
    for name, word in _NAMED.findall(sentence):
        value = word.rstrip(".,")
        if name in FIT and _taken(name, value):
            found.append({"option": name, "value": value})
    if "`poles`" in sentence:
        found.append({"option": "poles", "value": None})
    return found


def _taken(name: str, value: str) -> bool:
    try:
        FIT[name].kind.read(value)
    except ValueError:
        return False
    return True
