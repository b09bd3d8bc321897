"""List the faults that tests should see: for each, which lines of a module to write otherwise.

    .venv/tools/bin/python .ci/mutations.py MODULE.py ... > faults.json

The faults are those of mutmut, taken as a library: its own run copies each function, and so leaves
out properties and the tables of modules. Added are faults that matter at a machine: a statement
left out, a condition turned round or dropped, an entry missing in a table. Sentences and what is
written only for the checker of types stay as they are. It runs with the programs of
``locks/tools.txt``; ``.ci/mutants.py`` runs the tests.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import libcst as cst
from libcst.metadata import MetadataWrapper, ParentNodeProvider, PositionProvider
from mutmut.mutation.file_mutation import MutationVisitor
from mutmut.mutation.mutators import mutation_operators, operator_arg_removal, operator_string
from mutmut.mutation.pragma_handling import IgnoredCode


def word(node: cst.SimpleString) -> Iterator[cst.SimpleString]:
    """Another word for one that the program compares or looks up."""
    if node.quote in ("'", '"') and not node.prefix and " " not in node.value and node.raw_value:
        yield node.with_changes(value=f"{node.quote}XX{node.value[1:]}")


def left_out(node: cst.Expr | cst.Raise) -> Iterator[cst.Pass]:
    """No call of a function whose value nobody takes, and no refusal."""
    if isinstance(node, cst.Raise) or isinstance(node.value, cst.Call):
        yield cst.Pass()


def turned(node: cst.If | cst.While) -> Iterator[cst.If | cst.While]:
    """The other way for the same condition."""
    if not isinstance(node.test, cst.UnaryOperation | cst.Comparison):
        inner = node.test.with_changes(lpar=[cst.LeftParen()], rpar=[cst.RightParen()])
        yield node.with_changes(test=cst.UnaryOperation(cst.Not(), inner))


def alone(node: cst.BooleanOperation) -> Iterator[cst.BaseExpression]:
    """One of two conditions alone."""
    for side in (node.left, node.right):
        yield side.with_changes(lpar=node.lpar or side.lpar, rpar=node.rpar or side.rpar)


def without_one(node: cst.Dict | cst.Set) -> Iterator[cst.Dict | cst.Set]:
    """The table without one of its entries."""
    for i in range(len(node.elements)):
        rest = [*node.elements[:i], *node.elements[i + 1 :]]
        if rest or isinstance(node, cst.Dict):
            yield node.with_changes(elements=rest)


def without_argument(node: cst.Call) -> Iterator[cst.Call]:
    """A call without an argument for which a default may stand."""
    plain = [i for i, each in enumerate(node.args) if not each.keyword and not each.star]
    for i, argument in enumerate(node.args):
        if len(node.args) > 1 and (argument.keyword or plain[-1:] == [i]):
            yield node.with_changes(args=[*node.args[:i], *node.args[i + 1 :]])


OPERATORS = [
    *(
        (kind, operator)
        for kind, operator in mutation_operators
        if operator not in (operator_string, operator_arg_removal)
    ),
    (cst.SimpleString, word),
    (cst.Call, without_argument),
    (cst.Expr, left_out),
    (cst.Raise, left_out),
    (cst.If, turned),
    (cst.While, turned),
    (cst.BooleanOperation, alone),
    (cst.Dict, without_one),
    (cst.Set, without_one),
]


class Faults(MutationVisitor):
    """The faults of one module, inside properties and other decorated functions too."""

    METADATA_DEPENDENCIES = (*MutationVisitor.METADATA_DEPENDENCIES, ParentNodeProvider)

    def __init__(self) -> None:
        super().__init__(OPERATORS, IgnoredCode(set(), set(), set()))

    def _skip_node_and_children(self, node: cst.CSTNode) -> bool:
        if isinstance(node, cst.FunctionDef):
            return False
        if isinstance(node, cst.If) and cst.Module([]).code_for_node(node.test) == "TYPE_CHECKING":
            return True
        if isinstance(node, cst.Import | cst.ImportFrom):
            return True
        return super()._skip_node_and_children(node)

    def around(self, node: cst.CSTNode) -> Iterator[cst.CSTNode]:
        """``node``, and what it stands in, from within; the module is left out."""
        while not isinstance(node, cst.Module):
            yield node
            node = self.get_metadata(ParentNodeProvider, node)

    def place(self, node: cst.CSTNode) -> tuple[str, int, int]:
        """The function or class around ``node``, and the lines of its statement."""
        around = list(self.around(node))
        names = [
            each.name.value
            for each in around[1:]
            if isinstance(each, cst.FunctionDef | cst.ClassDef)
        ]
        statements = [each for each in around if isinstance(each, cst.SimpleStatementLine)]
        span = self.get_metadata(PositionProvider, [*statements, node][0])
        last = span.start.line if isinstance(node, cst.If | cst.While) else span.end.line
        return ".".join(reversed(names)), span.start.line, last


def mutations(path: str) -> Iterator[dict[str, object]]:
    """The faults of the module at ``path``, each once."""
    wrapper = MetadataWrapper(cst.parse_module(Path(path).read_text(encoding="utf-8")))
    module, faults = wrapper.module, Faults()
    texts = {statement: module.code_for_node(statement) for statement in module.body}
    before, line = {}, sum(module.code_for_node(each).count("\n") for each in module.header)
    for statement, text in texts.items():
        before[statement] = line
        line += text.count("\n")
    seen = set(texts.values())
    with faults.resolve(wrapper):
        module.visit(faults)
        for fault in faults.mutations:
            (*_, statement) = faults.around(fault.original_node)
            changed = statement.deep_replace(fault.original_node, fault.mutated_node)
            code = module.code_for_node(changed)
            if code in seen or not _compiles(code):
                continue
            seen.add(code)
            old, new = texts[statement].splitlines(), code.splitlines()
            head = _common(old, new)
            tail = _common(old[head:][::-1], new[head:][::-1])
            was = "\n".join(old[head : len(old) - tail])
            becomes = "\n".join(new[head : len(new) - tail])
            if _meant(was) == _meant(becomes):
                continue
            within, first, last = faults.place(fault.original_node)
            yield {
                "module": path,
                "within": within,
                "statement": [first, last],
                "lines": [before[statement] + head, before[statement] + len(old) - tail],
                "was": was,
                "becomes": becomes,
            }


def _meant(text: str) -> str:
    """``text`` without what changes nothing: numpy takes any negative number for the size that it
    works out, and the ``strict=True`` of a zip guards against other faults.
    """
    text = re.sub(r",\s*(strict=\w+)?\s*(?=\)|$)", "", text)
    return re.sub(r"reshape\(-\d", "reshape(-1", text)


def _compiles(code: str) -> bool:
    try:
        compile(code, "", "exec")
    except SyntaxError:
        return False
    return True


def _common(one: list[str], other: list[str]) -> int:
    """How many lines both begin with."""
    alike = 0
    for a, b in zip(one, other, strict=False):
        if a != b:
            break
        alike += 1
    return alike


if __name__ == "__main__":
    json.dump([each for path in sys.argv[1:] for each in mutations(path)], sys.stdout, indent=1)
