"""The pictures of docs/folding-kit.md, and how large the guide is.

    python benchmarks/kit_pictures.py            # writes docs/folding-kit/*.png
    python benchmarks/kit_pictures.py sizes      # prints pages, bytes and processor time

The pictures are figures of the guide, as it draws them. ``sizes`` fits hypars of growing numbers
of facets.
"""

from __future__ import annotations

import argparse
import io
import time
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

import pypdf
import resvg_py
from PIL import Image
from reportlab.lib.colors import white
from reportlab.lib.units import mm

import miurafab as mf
from miurafab.fabrication.drawing.assembly_guide import assembly_guide
from miurafab.fabrication.drawing.glue_sections import GlueSections
from miurafab.fabrication.drawing.kit_sections import KitSections
from miurafab.fabrication.drawing.page import text
from miurafab.fabrication.drawing.sections import Figure, Figures, Section
from miurafab.fabrication.drawing.svg_canvas import SvgCanvas
from miurafab.fabrication.drawing.views import Views
from miurafab.fabrication.sheets import lay_out
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.profiles import load_machine, load_material

FOLDER = Path(__file__).parent.parent / "docs" / "folding-kit"
WIDE_MM, GAP_MM, HEAD_MM = 60.0, 6.0, 7.0
SHOWN = (
    "hypar-collapse.png",
    "hypar-gauge.png",
    "saddle-rows.png",
    "vase-collapse.png",
    "vase-glueing.png",
)
"""The pictures on the page."""
PIXELS = 1000
"""Pixels of the width of a picture."""
SIZES = (12, 20, 40, 60)


def designs() -> Iterator[tuple[str, CreasePattern]]:
    """The patterns in the pictures."""
    yield "hypar", mf.fit("hypar", height=0.5, facets=(12, 12), size=270).pattern
    yield "vase", mf.fit("vase", close="seam", facets=(24, 12), size=150).pattern
    saddle = Path(__file__).parent.parent / "patterns" / "saddle.stl"
    yield "saddle", mf.fit(saddle, facets=(12, 12), size=200).pattern


def pictures(name: str, pattern: CreasePattern) -> Iterator[tuple[str, bytes]]:
    """The file names and PNG bytes of the pictures of one pattern."""
    machine, material = load_machine("grbl-laser-400"), load_material("card-250")
    views = Views(lay_out(pattern, machine, material), pattern)
    sections = [*KitSections(views).sections(), *GlueSections(views).sections()]
    for section in sections:
        own = figures_of(section)
        if section.title == "glueing":
            own = own[1:]
        if own:
            yield f"{name}-{section.title.split()[0]}.png", png(own[:3])


def figures_of(section: Section) -> list[Figure]:
    return [
        figure for block in section.blocks if isinstance(block, Figures) for figure in block.figures
    ]


def png(figures: Sequence[Figure]) -> bytes:
    """The ``figures`` side by side, each under its title, in few colours."""
    canvas = SvgCanvas()
    tall = min(max(figure.aspect for figure in figures), 1.3) * WIDE_MM
    width = len(figures) * (WIDE_MM + GAP_MM) + GAP_MM
    height = tall + HEAD_MM + 2 * GAP_MM
    canvas.setFillColor(white)
    canvas.rect(0, 0, width * mm, height * mm, stroke=0, fill=1)
    for place, figure in enumerate(figures):
        x = GAP_MM + place * (WIDE_MM + GAP_MM)
        text(canvas, x, height - GAP_MM - 3, figure.title, 9, bold=True)
        figure.draw(canvas, (x, GAP_MM, WIDE_MM, tall))
    matplotlib = find_spec("matplotlib")
    assert matplotlib is not None
    assert matplotlib.origin is not None
    fonts = Path(matplotlib.origin).parent / "mpl-data" / "fonts" / "ttf"
    made = resvg_py.svg_to_bytes(
        svg_string=canvas.text(0, 0, width, height, "figures"),
        width=PIXELS,
        skip_system_fonts=True,
        font_files=[str(fonts / "DejaVuSans.ttf"), str(fonts / "DejaVuSans-Bold.ttf")],
        sans_serif_family="DejaVu Sans",
    )
    stream = io.BytesIO()
    image = Image.open(io.BytesIO(made)).convert("RGB")
    image.quantize(64, dither=Image.Dither.NONE).save(stream, "png", optimize=True)
    return stream.getvalue()


def sizes() -> Iterator[str]:
    """A line for each number of facets: pages, bytes of both forms, processor time."""
    machine, material = load_machine("grbl-laser-400"), load_material("card-250")
    for number in SIZES:
        pattern = mf.fit("hypar", height=0.5, facets=(number, number), size=400).pattern
        layout = lay_out(pattern, machine, material)
        started = time.process_time()
        guide = assembly_guide(layout, pattern, machine, material, "hypar")
        seconds = time.process_time() - started
        pages = len(pypdf.PdfReader(io.BytesIO(guide.pdf)).pages)
        yield (
            f"| {number * number:,} | {len(layout.patches)} | {pages} | "
            f"{len(guide.pdf) / 1e6:.1f} | {len(guide.page) / 1e6:.1f} | {seconds:.1f} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", nargs="?", choices=("pictures", "sizes"), default="pictures")
    if parser.parse_args().what == "sizes":
        for line in sizes():
            print(line, flush=True)
        return
    FOLDER.mkdir(exist_ok=True)
    for name, pattern in designs():
        for file, content in pictures(name, pattern):
            if file not in SHOWN:
                continue
            (FOLDER / file).write_bytes(content)
            print(f"{file}: {len(content) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
