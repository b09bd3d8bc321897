"""Put a fault into a process: into a function that is there, or into a module that is loaded.

Most faults stand in the body of a function. Its code is exchanged in the function that others have
imported, so that nothing is loaded anew. A fault elsewhere (a constant, a default, a decorator), or
in a function that ran as modules were loaded, needs its module loaded with it.
"""

from __future__ import annotations

import ast
import gc
import importlib
import importlib.abc
import importlib.machinery
import types
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
Place = tuple[str, int, str]


def name_of(path: str) -> str:
    """The name by which the module at ``path`` is loaded."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def faulty(fault: dict) -> str:
    """The text of the module with ``fault``."""
    lines = (ROOT / fault["module"]).read_text(encoding="utf-8").splitlines()
    first, last = fault["lines"]
    lines[first:last] = fault["becomes"].split("\n") if fault["becomes"] else []
    return "\n".join(lines) + "\n"


class Faulty(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Loads one module from ``source`` instead of from its file."""

    def __init__(self, path: str, source: str) -> None:
        self.name = name_of(path)
        self.path, self.source = ROOT / path, source

    def find_spec(self, name, path=None, target=None):
        if name != self.name:
            return None
        packages = [str(self.path.parent)] if self.path.name == "__init__.py" else None
        spec = importlib.machinery.ModuleSpec(name, self, origin=str(self.path))
        spec.submodule_search_locations, spec.has_location = packages, True
        return spec

    def exec_module(self, module: types.ModuleType) -> None:
        exec(compile(self.source, self.path, "exec"), module.__dict__)


class Held(importlib.abc.MetaPathFinder):
    """Loads none of ``modules``, nor what needs one of them."""

    def __init__(self, modules: list[str]) -> None:
        self.names = {name_of(path) for path in modules}

    def find_spec(self, name, path=None, target=None):
        if name in self.names:
            raise RuntimeError(name)


def exchange(fault: dict) -> tuple[types.CodeType, types.CodeType] | None:
    """The code of the function that has ``fault`` in its body, without and with it; None for other
    faults.
    """
    path = ROOT / fault["module"]
    texts = path.read_text(encoding="utf-8"), faulty(fault)
    trees = [ast.parse(text) for text in texts]
    functions = [list(_functions(tree)) for tree in trees]
    bodies = [[ast.dump(ast.Module(each.body, [])) for each in some] for some in functions]
    for each in (each for some in functions for each in some):
        each.body = []
    if ast.dump(trees[0]) != ast.dump(trees[1]) or bodies[0] == bodies[1]:
        return None
    number = next(i for i, (one, other) in enumerate(zip(*bodies, strict=True)) if one != other)
    was, becomes = (
        _code(compile(text, path, "exec"), some[number])
        for text, some in zip(texts, functions, strict=True)
    )
    return (was, becomes) if was.co_freevars == becomes.co_freevars else None


def place_of(code: types.CodeType) -> Place:
    """What names the function of ``code``: the path of its module, its first line and its name."""
    return code.co_filename, code.co_firstlineno, code.co_name


def lines_of(code: types.CodeType) -> set[int]:
    """The lines of ``code`` and of what is in it."""
    return {line for each in _within(code) for _, _, line in each.co_lines() if line is not None}


def loaded(modules: set[str]) -> dict[Place, list[types.FunctionType]]:
    """The functions of ``modules`` in this process by their places."""
    for path in modules:
        importlib.import_module(name_of(path))
    paths = {str(ROOT / path) for path in modules}
    gc.unfreeze()
    found = defaultdict(list)
    for each in gc.get_objects():
        if isinstance(each, types.FunctionType) and each.__code__.co_filename in paths:
            found[place_of(each.__code__)].append(each)
    gc.freeze()
    return dict(found)


def _functions(node: ast.AST) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """The functions in ``node`` that are in no other."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            yield child
        else:
            yield from _functions(child)


def _code(module: types.CodeType, function: ast.FunctionDef) -> types.CodeType:
    """The code of ``function`` in that of its ``module``."""
    line = min(each.lineno for each in (function, *function.decorator_list))
    named = function.name, line
    return next(c for c in _within(module) if (c.co_name, c.co_firstlineno) == named)


def _within(code: types.CodeType) -> list[types.CodeType]:
    """``code`` and all codes in it."""
    found = [code]
    for each in found:
        found += [inner for inner in each.co_consts if isinstance(inner, types.CodeType)]
    return found
