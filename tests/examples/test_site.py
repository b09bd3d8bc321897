"""The site of the docs is built without a warning, and loads nothing from elsewhere."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pages import ROOT

PARTS = ("zensical.toml", "docs", "miurafab", "tests/examples/griffe_docstrings.py")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    for part in PARTS:
        there = folder / part
        there.parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, there, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / part, there)
    built = subprocess.run(
        [Path(sys.executable).parent / "zensical", "build", "--strict"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    said = built.stdout + built.stderr
    assert built.returncode == 0, said
    told = {line for line in said.splitlines() if not line.startswith("Build ")}
    assert told == {"No issues found"}
    return (folder / "site").resolve()


def test_every_page_is_on_the_site(site):
    pages = {path.relative_to(ROOT / "docs") for path in (ROOT / "docs").rglob("*.md")}
    assert {page.with_suffix(".html") for page in pages} | {Path("404.html")} == {
        path.relative_to(site) for path in site.rglob("*.html")
    }


def test_every_page_can_be_reached(site):
    reached, coming = set(), [site / "index.html"]
    while coming:
        page = coming.pop()
        if page not in reached:
            reached.add(page)
            links = re.findall(r'href="?([^\s"#>:]+\.html)', page.read_text(encoding="utf-8"))
            coming += [(page.parent / link).resolve() for link in links]
    assert {page.relative_to(site) for page in reached} | {Path("404.html")} == {
        path.relative_to(site) for path in site.rglob("*.html")
    }


def test_nothing_is_loaded_from_elsewhere(site):
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        loaded = re.findall(
            r"<(?:script|img|link|iframe)[^>]*(?:src|href)=\"?(https?:[^\s\">]+)", text
        )
        assert loaded == [], page


def test_the_reference_has_the_options_of_each_function(site):
    text = (site / "reference" / "api.html").read_text(encoding="utf-8")
    assert "{options}" not in text
    assert 'id="miurafab.fit"' in text
    assert "max_deviation" in text


def test_the_reference_shows_no_source_of_docstrings(site):
    """A role as ``:func:`` stood in the text of the page."""
    text = (site / "reference" / "api.html").read_text(encoding="utf-8")
    assert re.findall(r":(?:func|class|meth|mod|data|attr):.{30}", text) == []
    assert 'href="#miurafab.list_machines"><code>list_machines</code>' in text


def test_the_bar_of_a_choice_has_no_escape_on_the_page(site):
    """In backticks Markdown's readers differ: this one showed ``sector\\|open``."""
    text = (site / "fit.html").read_text(encoding="utf-8")
    assert "sector|open|seam" in text.replace("&#124;", "|")
    assert not re.search(r"<code>[^<]*\\\|", text)
