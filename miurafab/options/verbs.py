"""A verb that is called with arguments that it does not have answers in a sentence.

Python's own answer is a ``TypeError``. :func:`verb` checks the arguments against the signature
first.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from miurafab.errors import InputError, OptionError
from miurafab.options import nearest

P = ParamSpec("P")
R = TypeVar("R")


def verb(function: Callable[P, R]) -> Callable[P, R]:
    """``function``, which raises :class:`~miurafab.errors.InputError` for a call that does not fit
    its signature: a name that it does not have, a value too many, a value that is missing.
    """

    @functools.wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            signature.bind(*args, **kwargs)
        except TypeError as fault:
            raise _sentence(function.__name__, signature, kwargs, fault) from None
        return function(*args, **kwargs)

    signature = inspect.signature(function)
    return called


def _sentence(
    name: str, signature: inspect.Signature, kwargs: dict[str, object], fault: TypeError
) -> InputError:
    parameters = signature.parameters.values()
    named = [each.name for each in parameters if each.kind is not each.POSITIONAL_ONLY]
    unknown = [word for word in kwargs if word not in named]
    if unknown and all(each.kind is not each.VAR_KEYWORD for each in parameters):
        return OptionError(None, f"'{unknown[0]}' is not an option; {nearest(unknown[0], named)}")
    free = [each.name for each in parameters if each.kind < each.KEYWORD_ONLY]
    values = " and ".join(free) or "nothing"
    return InputError(f"{name}() takes {values} without a name, and the rest by name: {fault}.")
