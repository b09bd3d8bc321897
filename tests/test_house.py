"""The rules of CONTRIBUTING that the syntax of the code shows."""

from __future__ import annotations

import ast
import importlib
import re
import re._parser as regular  # the parser of `re`: only it tells what a repeat is
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from running_order import FIRST, place

ROOT = Path(__file__).parent.parent
MODULES = sorted((ROOT / "miurafab").rglob("*.py"))
PROTOCOL_ROOMS = ("gcode", "motion", "wire", "grbl", "marlin", "plotter", "simulate")
HOMES = {
    "serial": ("miurafab/machine/transport.py",),
    "svgwrite": ("miurafab/fabrication/drawing/svg.py",),
    "trimesh": ("miurafab/surfaces/", "miurafab/origami/formats/mesh.py"),
    "shapely": ("miurafab/geometry/", "miurafab/fabrication/"),
    "cyclopts": ("miurafab/cli/",),
    "reportlab": ("miurafab/fabrication/drawing/",),
}
"""Each library is imported only below its paths."""
MOST_LINES = 400
FLAG = re.compile(r"(?<![\w-])--[a-z]{2,}")
WRITE_COMMANDS = (
    "errors.py",
    "studio/recipe.py",
    "fabrication/drawing/calibration_guide.py",
    "workflow/doctor.py",
    "workflow/libraries.py",
    "workflow/ports.py",
)
"""Below ``cli``, these spell options for it, or write whole command lines for a person to type."""

ONE_SYSTEM = {
    "fcntl",
    "termios",
    "tty",
    "pty",
    "pwd",
    "grp",
    "resource",
    "msvcrt",
    "winreg",
    "winsound",
}
"""Modules that only POSIX has, and that only Windows has (docs.python.org, library)."""


def name(module: Path) -> str:
    return module.relative_to(ROOT).as_posix()


@cache
def tree(module: Path) -> ast.Module:
    return ast.parse(module.read_text(encoding="utf-8"))


@pytest.fixture(autouse=True, scope="module")
def _no_trees_are_left() -> Iterator[None]:
    """Each collection of garbage would look at all their nodes to the end of the run."""
    yield
    tree.cache_clear()


@cache
def imported(module: Path) -> set[str]:
    """The top-level packages that ``module`` imports, in functions too."""
    packages = set()
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.Import):
            packages |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            packages.add((node.module or "").partition(".")[0])
    return packages


def test_a_class_name_is_used_once() -> None:
    places = defaultdict(list)
    for module in MODULES:
        for node in ast.walk(tree(module)):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{name(module)}:{node.lineno}")
    assert {text: where for text, where in places.items() if len(where) > 1} == {}


def test_every_module_opens_with_its_idea_and_is_short() -> None:
    assert [name(module) for module in MODULES if not ast.get_docstring(tree(module))] == []
    lines = {name(module): len(module.read_text().splitlines()) for module in MODULES}
    assert {module: count for module, count in lines.items() if count > MOST_LINES} == {}


@pytest.mark.parametrize("library", HOMES)
def test_a_library_has_one_home(library: str) -> None:
    users = [name(module) for module in MODULES if library in imported(module)]
    assert users
    assert [user for user in users if not user.startswith(HOMES[library])] == []


def test_an_exception_from_the_types_has_its_reason_beside_it() -> None:
    """Behind it on the line, or on the line before."""
    bare = []
    for module in MODULES:
        lines = module.read_text(encoding="utf-8").splitlines()
        for before, line in zip(["", *lines], lines, strict=False):
            words = line.partition("# type: ignore[")[2]
            if words and "#" not in words and not before.strip().startswith(("#", "@")):
                bare.append(f"{name(module)}: {line.strip()}")
    assert bare == []


def test_the_usual_baud_rate_stands_once() -> None:
    users = [
        name(module) for module in MODULES if re.search("115_?200\\b(?! baud)", module.read_text())
    ]
    assert users == ["miurafab/profiles/machine.py"]


def test_modules_of_one_system_are_imported_where_it_is_known() -> None:
    """Inside a function or under a look at the system: elsewhere the import itself would fail."""
    tests = [path for path in (ROOT / "tests").rglob("*.py") if "node_modules" not in path.parts]
    assert len(tests) > 100
    named = re.compile(rf"^(?:import|from) .*\b(?:{'|'.join(ONE_SYSTEM)})\b", re.MULTILINE)
    some = [path for path in tests if named.search(path.read_text(encoding="utf-8"))]
    assert named.search("import os, fcntl")
    bare = [
        f"{name(module)}: {word}"
        for module in (*MODULES, *some)
        for node in tree(module).body
        if isinstance(node, ast.Import | ast.ImportFrom)
        for word in _imports(node)
        if word in ONE_SYSTEM
    ]
    assert bare == []


def _imports(node: ast.Import | ast.ImportFrom) -> list[str]:
    if isinstance(node, ast.ImportFrom):
        return [(node.module or "").partition(".")[0]]
    return [alias.name.partition(".")[0] for alias in node.names]


def test_only_the_command_line_names_its_flags() -> None:
    named = [
        f"{name(module)}:{number}: {line.strip()}"
        for module in MODULES
        if not name(module).startswith("miurafab/cli/")
        and not name(module).endswith(WRITE_COMMANDS)
        for number, line in enumerate(module.read_text(encoding="utf-8").splitlines(), 1)
        if FLAG.search(line)
    ]
    assert named == []


def test_digits_are_read_in_one_way() -> None:
    """A pattern that takes the same digits in several ways takes minutes for thousands of them."""
    several = re.compile(r"\\d[+*]\\\.\?\\d[+*](?!\+)")
    assert several.search(r"(?:\d+\.?\d*|\.\d+)")
    assert [name(module) for module in MODULES if several.search(module.read_text("utf-8"))] == []


@cache
def called(module: Path) -> dict[str, list[ast.Call]]:
    """The calls in ``module`` by the dotted name of what is called."""
    calls = defaultdict(list)
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.Call):
            calls[ast.unparse(node.func)].append(node)
    return calls


def test_only_the_command_line_prints() -> None:
    printing = [name(module) for module in MODULES if "print" in called(module)]
    assert [text for text in printing if not text.startswith("miurafab/cli/")] == []


def test_randomness_comes_from_a_seeded_generator() -> None:
    for module in MODULES:
        for function, calls in called(module).items():
            if function.endswith(("default_rng", "random.Random")):
                assert all(call.args for call in calls), name(module)
            elif "default_rng(" not in function:
                shared = ("np.random.", *(["random."] if "random" in imported(module) else []))
                assert not function.startswith(shared), f"{name(module)}: {function}"


def test_protocol_tests_wait_for_no_clock() -> None:
    tests = [path for room in PROTOCOL_ROOMS for path in (ROOT / "tests" / room).rglob("*.py")]
    assert len(tests) > 20
    assert [name(path) for path in tests if imported(path) & {"time", "asyncio", "threading"}] == []


def test_modules_that_tests_share_have_names_of_their_own():
    """All folders of tests are on one path: of two modules of a name one would hide the other."""
    files = [*(ROOT / "tests").rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py")]
    names = sorted(path.stem for path in files if path.stem != "conftest")
    assert names == sorted(set(names))


UNAMBIGUOUS = {
    r"\[(G5[4-9](?:\.[1-3])?|G28|G30|G92|TLO):(-?[\d.]+(?:,-?[\d.]+)*)\]",  # no comma in a number
}
"""Regular expressions with a repeat within a repeat that can read no text in two ways."""


def _held_by(value: object) -> list[object]:
    return list(vars(value).values()) if hasattr(value, "__dict__") else []


def _repeats_within_repeats(tree: Any, within: bool = False) -> bool:
    for operation, found in tree:
        kind = str(operation)
        if kind in ("MAX_REPEAT", "MIN_REPEAT"):
            often = found[1] > 20
            if (often and within) or _repeats_within_repeats(found[2], within or often):
                return True
        parts = found[1] if kind == "BRANCH" else [found[3]] if kind == "SUBPATTERN" else []
        if any(_repeats_within_repeats(part, within) for part in parts):
            return True
    return False


def test_no_regular_expression_takes_a_time_without_end():
    """A status report without its end was read in a time that doubled with each comma.

    Forms that a call puts together are taken from the module that holds them, or its objects.
    """
    forms: set[str | bytes] = set()
    for module in MODULES:
        written = [call.args[0] for call in called(module).get("re.compile", [])]
        forms |= {form.value for form in written if isinstance(form, ast.Constant)}
        if not all(isinstance(form, ast.Constant) for form in written):
            values = vars(importlib.import_module(".".join(module.relative_to(ROOT).parts)[:-3]))
            held = [each for value in values.values() for each in (value, *_held_by(value))]
            made = {each.pattern for each in held if isinstance(each, re.Pattern)}
            assert made or name(module) == "miurafab/studio/session.py"  # a folder's name, escaped
            forms |= made
    assert len(forms) > 60
    texts = {form.decode("latin-1") if isinstance(form, bytes) else form for form in forms}
    for known in UNAMBIGUOUS:
        assert any(known in text for text in texts)
        texts = {text.replace(known, "") for text in texts}
    assert not {text for text in texts if _repeats_within_repeats(regular.parse(text))}
    assert _repeats_within_repeats(regular.parse("(?:[|,][^|<>]*)*"))


def test_what_begins_first_is_there(request):
    """A file that is renamed keeps its place in the order of the run."""
    assert len(set(FIRST)) == len(FIRST)
    assert [name for name in FIRST if not (ROOT / "tests" / name).is_file()] == []
    assert [place(ROOT / "tests" / name) for name in FIRST] == list(range(len(FIRST)))
    options = request.config.getini("addopts")
    assert options[options.index("--dist") :][:3] == [
        "--dist",
        "loadfile",
        "--no-loadscope-reorder",
    ]
    places = [place(item.path) for item in request.session.items]
    assert places == sorted(places)
