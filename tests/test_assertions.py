"""No assertion of the tests is of a kind that cannot fail."""

import ast
from pathlib import Path

import pytest

TESTS = sorted(Path(__file__).parent.rglob("*.py"))

NUMBERS = {"abs", "argmax", "argmin", "max", "mean", "min", "norm", "sum", "approx"}
"""Functions that give a number: asserted alone, it only says that the number is not 0."""


def empty_assertions(code):
    """What cannot fail, or hardly, among the assertions of ``code``: (line, why)."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Assert):
            test = node.test
            if isinstance(test, ast.Constant | ast.Tuple | ast.Dict | ast.JoinedStr):
                yield node.lineno, "a constant"
            elif isinstance(test, ast.BoolOp) and isinstance(test.op, ast.Or):
                names = [each.id for each in ast.walk(test) if isinstance(each, ast.Name)]
                for side in test.values:
                    if isinstance(side, ast.Constant) or names.count(getattr(side, "id", "")) > 1:
                        yield node.lineno, "'or' with a value that is true by itself"
            elif isinstance(test, ast.Call):
                name = getattr(test.func, "attr", getattr(test.func, "id", ""))
                if name in NUMBERS:
                    yield node.lineno, "a number that is compared with nothing"


@pytest.mark.parametrize("path", TESTS, ids=lambda path: path.stem)
def test_every_assertion_can_fail(path):
    assert list(empty_assertions(path.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    "code",
    [
        "assert lengths.min(initial=1.0)",
        "assert summary.endswith('.') or summary",
        "assert (found, 'is found')",
        "assert 'text'",
    ],
)
def test_the_check_finds_each_kind(code):
    assert len(list(empty_assertions(code))) == 1
    assert list(empty_assertions("assert found.min() > 0 and found.size")) == []
