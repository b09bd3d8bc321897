"""Every example of ``--help`` is run, and pages name only commands and options that exist."""

import re
import shutil

import pytest
from commands import run_line
from pages import PAGES, ROOT, prose_of

from miurafab.cli.program import COMMANDS, app, examples

PREPARED = [
    "miurafab fit hypar --facets 6x6 -o hypar.fold",
    "miurafab fit hypar --facets 6x6 --rigid -o miura.fold",
    "miurafab convert hypar.fold flat.obj --form flat",
    "miurafab convert hypar.fold folded.obj --form folded",
    "miurafab sheets hypar.fold -o jobs/hypar",
    "miurafab calibrate -o trial",
    "miurafab machine backup saved.txt --port virtual",
]
"""What makes the files that the examples name."""

DRAWING = (
    '<svg><rect width="90" height="60" stroke="#000"/>'
    '<path d="M0 30 Q 45 60 90 30" stroke="#f00" stroke-opacity="0.3"/></svg>'
)
"""A drawing with a curved crease."""

NO_SWITCHES = "miurafab machine home"
"""The virtual machine has no homing switches: it refuses, exit code 3."""

OF_OTHERS = {
    *("--best", "--no-package-lock", "--round", "--glue", "--largest", "--live"),
    *("--nworkers", "--nthreads", "--rm"),
}
"""Options of other programs, and of benchmarks, that pages name."""


@pytest.fixture(scope="session")
def prepared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("help") / "files"
    folder.mkdir()
    shutil.copy(ROOT / "patterns" / "saddle.stl", folder)
    (folder / "drawing.svg").write_text(DRAWING)
    for line in PREPARED:
        run_line(line, folder)
    return folder


@pytest.mark.parametrize("example", sorted(set(examples())))
def test_the_example_runs(prepared, tmp_path, example):
    folder = shutil.copytree(prepared, tmp_path / "files")
    assert run_line(example, folder, 3 if example.startswith(NO_SWITCHES) else 0)


def _options():
    for name, command in COMMANDS.items():
        parts = [app[name]] if command.call else []
        for part in [*parts, *(app[name][action] for action in command.actions)]:
            collection = part.assemble_argument_collection(default_parameter=app.default_parameter)
            for argument in collection:
                yield from argument.names


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_page_names_commands_and_options_that_exist(page):
    known = {*_options(), "--help", "--version", *OF_OTHERS}
    for code in re.findall(r"`([^`]+)`", prose_of(page)):
        named = set(re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", code))
        if script := re.match(r"python (benchmarks/\w+\.py)", code):
            text = (ROOT / script[1]).read_text(encoding="utf-8")
            assert {option for option in named if f'"{option}"' not in text} == set(), code
            continue
        assert named <= known, code
        if named := re.match(r"miurafab (\w+)", code):
            assert named[1] in COMMANDS, code
