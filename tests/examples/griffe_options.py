"""For the site: what ``{options}`` stands for in a docstring, filled in by the running package."""

import inspect
import pydoc

import griffe


class OptionsInDocstrings(griffe.Extension):
    """Takes the docstring of a function with options from the running package."""

    def on_instance(self, *, obj, **_):
        """Called by griffe for each object of the package that it has read."""
        if obj.docstring and "{options}" in obj.docstring.value:
            obj.docstring.value = inspect.getdoc(pydoc.locate(obj.path))
