"""For the site: makes the docstrings of the package Markdown that a reader sees no source in."""

import inspect
import pydoc
import re

import griffe

_ROLE = re.compile(r":(?:func|class|meth|mod|data|attr):`~?([\w.]+)`")
"""A reference as Python's own documentation writes it."""


class PlainDocstrings(griffe.Extension):
    """Fills in what ``{options}`` stands for, and makes references links or plain code."""

    def on_instance(self, *, obj, **_):
        """Called by griffe for each object of the package that it has read."""
        if not obj.docstring:
            return
        if "{options}" in obj.docstring.value:
            obj.docstring.value = inspect.getdoc(pydoc.locate(obj.path))
        obj.docstring.value = _ROLE.sub(_link, obj.docstring.value)


def _link(found):
    import miurafab

    name = found[1].rpartition(".")[2]
    return f"[`{name}`][miurafab.{name}]" if name in miurafab.__all__ else f"`{name}`"
