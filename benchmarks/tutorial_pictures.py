"""The pictures of docs/tutorial.md: a mesh, its sheet, what is cut, and how it is folded.

    python benchmarks/tutorial_pictures.py    # writes docs/tutorial/*.png

They are made from the pattern that the commands of the tutorial fit and lay out.
"""

from __future__ import annotations

import argparse
import io
import tempfile
from collections.abc import Iterator
from pathlib import Path

import gallery
import kit_pictures
from PIL import Image

import miurafab as mf
from miurafab.fabrication.drawing.kit_sections import KitSections
from miurafab.fabrication.drawing.views import Views
from miurafab.fabrication.sheets import lay_out
from miurafab.profiles import load_machine, load_material
from miurafab.workflow.picture import png_bytes

FOLDER = Path(__file__).parent.parent / "docs" / "tutorial"
MESH = Path(__file__).parent.parent / "patterns" / "saddle.stl"
FACETS, SIZE_MM = (12, 12), 180.0
"""As the tutorial's first command has them."""
SHEET_WIDTH = 700
"""Pixels."""


def pictures(pattern: mf.CreasePattern) -> Iterator[tuple[str, bytes]]:
    """The file names and PNG bytes of all pictures."""
    target, shell, flat = gallery.panels(pattern)
    yield "target.png", gallery.side_by_side([target])
    yield "fitted.png", gallery.side_by_side([shell, flat])
    machine, material = load_machine("grbl-laser-400"), load_material("card-250")
    with tempfile.TemporaryDirectory() as folder:
        mf.sheets(pattern, machine=machine, material=material).write(f"{folder}/job")
        shown = mf.preview(f"{folder}/job")
        sheet = Image.open(io.BytesIO(png_bytes(shown.sheets[0], machine))).convert("RGB")
    sheet.thumbnail((SHEET_WIDTH, SHEET_WIDTH), Image.Resampling.LANCZOS)
    yield "sheet.png", gallery.side_by_side([sheet])
    views = Views(lay_out(pattern, machine, material), pattern)
    for section in KitSections(views).sections():
        if section.title.startswith("collapse"):
            yield "folding.png", kit_pictures.png(kit_pictures.figures_of(section)[:3])


def fitted() -> mf.CreasePattern:
    """The pattern of the tutorial."""
    pattern = mf.fit(MESH, facets=FACETS, size=SIZE_MM).pattern
    assert pattern is not None
    return pattern


def main() -> None:
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    FOLDER.mkdir(exist_ok=True)
    for file, content in pictures(fitted()):
        (FOLDER / file).write_bytes(content)
        print(f"{file}: {len(content) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
