"""The signature and the docstring of a function that takes declared options as keywords."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Collection
from typing import Any

from miurafab.options import declared


def described(function: Callable[..., Any], *classes: type, without: Collection[str] = ()) -> None:
    """Put the options of ``classes``, which ``function`` takes as keywords, into its signature and,
    for ``{options}``, into its docstring; all but those named by ``without``.

    A parameter of ``function`` with the name of an option keeps its place, and gets the default of
    the option.
    """
    entries = [
        entry for cls in classes for name, entry in declared(cls).items() if name not in without
    ]
    lines = []
    for entry in entries:
        unit = f" in {entry.kind.unit.strip()}" if entry.kind.unit else ""
        lines.append(f"{entry.name} : {entry.kind.metavar}{unit}, optional")
        default = f" The default is {entry.default_text}." if entry.default_text else ""
        lines += textwrap.wrap(
            entry.help + default, 92, initial_indent=" " * 4, subsequent_indent=" " * 4
        )
    text = inspect.cleandoc(function.__doc__ or "")
    function.__doc__ = text.replace("{options}", "\n".join(lines))
    signature = inspect.signature(function)
    defaults = {entry.name: entry.default for entry in entries}
    own = [
        each.replace(default=defaults.pop(each.name, each.default))
        for each in signature.parameters.values()
    ]
    keywords = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default)
        for name, default in defaults.items()
    ]
    last = own.pop() if own[-1].kind is inspect.Parameter.VAR_KEYWORD else None
    everything = [*own, *keywords, *([] if last is None else [last])]
    setattr(function, "__signature__", signature.replace(parameters=everything))  # noqa: B010
