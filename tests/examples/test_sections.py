"""The docstring of each public name has its sections, and each section names what there is."""

from __future__ import annotations

import dataclasses
import inspect
import re

import pytest

import miurafab as mf

PUBLIC = [name for name in mf.__all__ if callable(getattr(mf, name))]
FUNCTIONS = [name for name in PUBLIC if inspect.isfunction(getattr(mf, name))]
RECORDS = [name for name in PUBLIC if dataclasses.is_dataclass(getattr(mf, name))]


def _entries(text, heading):
    """The names that a section documents, from lines such as ``x, y : float``."""
    found = re.search(rf"^{heading}\n-+\n(.*?)(?=^\w+\n-+$|\Z)", text, re.MULTILINE | re.DOTALL)
    lines = re.findall(r"^(\w[\w, ]*) : \S", found[1], re.MULTILINE) if found else []
    return {name for line in lines for name in line.split(", ")}


@pytest.mark.parametrize("name", PUBLIC)
def test_it_begins_with_a_sentence(name):
    assert getattr(mf, name).__doc__
    paragraph = inspect.getdoc(getattr(mf, name)).split("\n\n")[0]
    assert paragraph[0].isupper()
    assert paragraph.endswith((".", "::")), paragraph


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_has_every_parameter_and_an_example(name):
    text = inspect.getdoc(getattr(mf, name))
    parameters = inspect.signature(getattr(mf, name)).parameters.values()
    named = {each.name for each in parameters if each.kind is not each.VAR_KEYWORD}
    assert named <= _entries(text, "Parameters")
    assert "\nReturns\n-------\n" in text
    assert "\nExamples\n--------\n>>> import miurafab as mf" in text


@pytest.mark.parametrize("name", RECORDS)
def test_a_class_has_every_attribute(name):
    kind = getattr(mf, name)
    documented = set()
    for each in kind.__mro__:
        text = inspect.cleandoc(each.__doc__ or "")
        documented |= _entries(text, "Parameters") | _entries(text, "Attributes")
    # An option is a field with its help and unit beside it.
    fields = {each.name for each in dataclasses.fields(kind) if not each.metadata}
    assert {each for each in fields if not each.startswith("_")} <= documented
