"""The notebooks of the docs run, and print what is kept in them."""

import nbformat
import notebooks
import pytest

PATHS = sorted(notebooks.FOLDER.glob("*.ipynb"))


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_it_prints_what_is_kept(path):
    kept = nbformat.read(path, as_version=4)
    assert notebooks.printed(notebooks.run(path)) == notebooks.printed(kept)
    assert any(notebooks.printed(kept))


def test_there_are_three_and_the_pages_name_them():
    page = (notebooks.FOLDER.parent / "python.md").read_text(encoding="utf-8")
    assert len(PATHS) == 3
    for path in PATHS:
        assert f"](notebooks/{path.name})" in page
