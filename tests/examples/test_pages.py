"""Every example in print is run: each block of each page, in the order of the page."""

import contextlib
import io
import re
import shutil
import sys
import tomllib

import pytest
from commands import run_line
from pages import PAGES, ROOT, blocks_of, indented_code, matches, prose_of
from tables import TABLES, tables_in, with_tables

import miurafab

BLOCKS = [block for page in PAGES for block in blocks_of(page)]

NOT_RUN = {"README.md": 2, "cluster.md": 4, "fit.md": 1, "studio.md": 3}
"""Blocks that no test can run, by page, and how many: the reason stands in the page."""

LANGUAGES = {"sh", "python", "toml", "usage", "text", "console", "csv", "yaml", "powershell"}


class Page:
    """A page as a reader works through it: one folder, one namespace, block after block.

    Mutable: a block leaves files and names for the next.
    """

    def __init__(self, page, folder):
        self.blocks = blocks_of(page)
        self.folder = folder
        self.names = {}
        self.faults = {}
        for shipped in ("patterns", "materials", "firmware_profiles"):
            shutil.copytree(ROOT / shipped, folder / shipped)

    def run(self, block):
        """Run whatever stands before ``block``, and it; raise what a block raised."""
        for each in self.blocks:
            if each.line <= block.line and each.line not in self.faults:
                try:
                    self._run(each)
                finally:
                    self.faults[each.line] = sys.exception()
        if self.faults[block.line] is not None:
            raise self.faults[block.line]

    def _run(self, block):
        if "not run" in block.directives:
            return
        if "file" in block.directives:
            path = self.folder / block.directives["file"]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
        if block.language == "sh":
            self._run_commands(block)
        elif block.language == "python":
            code = compile("\n" * (block.line - 1) + block.text, block.page, "exec")
            printed = io.StringIO()
            with contextlib.chdir(self.folder), contextlib.redirect_stdout(printed):
                exec(code, self.names)
            _compare(block, printed.getvalue())
        elif block.language == "toml":
            tomllib.loads(block.text)

    def _run_commands(self, block):
        printed = ""
        expected = int(block.directives.get("exit", 0))
        for line in block.text.replace("\\\n", " ").splitlines():
            if line.split("#")[0].strip():
                printed = run_line(line, self.folder, expected)
        _compare(block, printed)


def _compare(block, printed):
    if block.shown is not None:
        assert matches(block.shown, printed), f"shown:\n{block.shown}\nprinted:\n{printed}"


@pytest.fixture(scope="session")
def pages(tmp_path_factory):
    """Pages that are being read, by file."""
    return {page: Page(page, tmp_path_factory.mktemp(page.stem)) for page in PAGES}


@pytest.mark.parametrize("block", BLOCKS, ids=str)
def test_the_block_runs(pages, block):
    pages[block.page].run(block)


def test_what_is_shown_can_differ():
    assert matches("a ... c\n", "a b\nb c  \n")
    assert not matches("a ... c\n", "a b d\n")
    assert not matches("a\n", "a\nb\n")


def test_few_blocks_are_not_run():
    left_out = {}
    for block in BLOCKS:
        assert block.directives.get("not run", "a reason") != ""
        if "not run" in block.directives:
            name = block.page.name
            left_out[name] = left_out.get(name, 0) + 1
    assert left_out == NOT_RUN


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_code_is_fenced_and_its_language_known(page):
    assert indented_code(page) == []
    assert {block.language for block in blocks_of(page)} <= LANGUAGES


def test_the_tables_are_those_of_the_program():
    """Written by ``python tests/examples/tables.py``."""
    texts = [page.read_text(encoding="utf-8") for page in PAGES]
    assert [with_tables(text) for text in texts] == texts
    assert set().union(*map(tables_in, texts)) == set(TABLES)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", prose_of(page)):
        name, _, heading = link.partition("#")
        assert not name.startswith("/")
        if "://" not in name:
            linked = page.parent / name if name else page
            assert linked.is_file(), link
            if heading:
                assert heading in headings_of(linked), link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_files_of_the_checkout_that_are_named_exist(page):
    rooms = "benchmarks|docs|firmware_profiles|materials|miurafab|patterns|tests"
    named = re.findall(rf"`((?:{rooms})/[\w./-]*)", prose_of(page))
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_the_tests_that_contributing_names_exist():
    prose = prose_of(ROOT / "CONTRIBUTING.md")
    tests = "\n".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    for name in re.findall(r"`(test_\w+)`", prose):
        assert f"def {name}(" in tests


def headings_of(page):
    """The anchors of the headings of ``page``."""
    titles = re.findall(r"^#+ (.*)$", prose_of(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def test_the_functions_in_the_table_of_python_exist():
    prose = prose_of(ROOT / "docs" / "python.md")
    named = [name for row in re.findall(r"^\| (`\w+\(.*?) \|", prose, re.MULTILINE)
             for name in re.findall(r"`(\w+)\(", row)]  # fmt: skip
    assert len(named) > 15
    assert [name for name in named if not callable(getattr(miurafab, name, None))] == []
