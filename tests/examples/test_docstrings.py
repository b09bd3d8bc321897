"""Every example in a docstring of the package is run."""

import contextlib
import doctest
import importlib
import pkgutil

import pytest

import miurafab

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def _examples():
    finder = doctest.DocTestFinder(exclude_empty=True)
    for module in pkgutil.walk_packages(miurafab.__path__, "miurafab."):
        if module.name != "miurafab.__main__":
            yield from finder.find(importlib.import_module(module.name))
    yield from finder.find(miurafab)


EXAMPLES = sorted((test for test in _examples() if test.examples), key=lambda test: test.name)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_the_example_runs(example, tmp_path):
    told = []
    with contextlib.chdir(tmp_path):
        result = doctest.DocTestRunner(optionflags=FLAGS).run(example, out=told.append)
    assert result.attempted == len(example.examples)
    assert result.failed == 0, "".join(told)
