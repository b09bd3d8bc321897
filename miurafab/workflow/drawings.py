"""The drawing formats of a job, besides the SVG of each sheet and the guide.

============ ============================ ======================================================
format       file                         is for
============ ============================ ======================================================
dxf          sheet-01.dxf                 cutters and CAD: R12, which every program reads
dxf-r2010    sheet-01-r2010.dxf           the same in R2010, with its unit (mm), outlines whole
pdf          sheet-01.pdf                 large printers and cutters: the page is the sheet
hpgl         sheet-01.hpgl                cutting plotters
tiled-a4     sheet-01-a4.pdf              ordinary printers, likewise -a0 to -a6, -letter, -legal,
                                          -tabloid and -200x300mm: pages to be joined,
                                          mountains and valleys in their colours
picture      pattern.svg                  people: the flat pattern with its patches
============ ============================ ======================================================

The libraries that draw are loaded when something is drawn: commands that only read a job, or name
the formats, begin a quarter of a second of processor time earlier.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from miurafab.errors import InputError
from miurafab.fabrication.drawing.page_sizes import PAGES_MM, page_size

if TYPE_CHECKING:
    from miurafab.fabrication.sheets import DrawnLayout
    from miurafab.fabrication.toolpath import Toolpath
    from miurafab.origami.crease_pattern import CreasePattern
    from miurafab.profiles import MachineProfile, Material

PICTURE = "pattern.svg"
GUIDE, GUIDE_PAGE, JIG = "assembly.pdf", "assembly.html", "jig.svg"
Draw = Callable[["Toolpath", NDArray[np.str_], str], bytes]


def _tiled(page: str) -> Draw:
    from miurafab.fabrication.drawing.tiles import Tiling, tiled_pdf

    return lambda path, letters, title: tiled_pdf((path,), letters, title, Tiling(page))


def _dxf(path: Toolpath, letters: NDArray[np.str_], title: str) -> bytes:
    from miurafab.fabrication.drawing.dxf import sheet_dxf

    return sheet_dxf(path, letters=letters).encode("ascii")


def _dxf_r2010(path: Toolpath, letters: NDArray[np.str_], title: str) -> bytes:
    from miurafab.fabrication.drawing.dxf import sheet_dxf

    return sheet_dxf(path, "R2010", letters).encode("utf-8")


def _pdf(path: Toolpath, letters: NDArray[np.str_], title: str) -> bytes:
    from miurafab.fabrication.drawing.pdf import sheets_pdf

    return sheets_pdf((path,), path.sheet, letters)


def _hpgl(path: Toolpath, letters: NDArray[np.str_], title: str) -> bytes:
    from miurafab.fabrication.drawing.hpgl import sheet_hpgl

    return sheet_hpgl(path, letters).encode("ascii")


_SHEETS: Mapping[str, tuple[str, Draw]] = {
    "dxf": (".dxf", _dxf),
    "dxf-r2010": ("-r2010.dxf", _dxf_r2010),
    "pdf": (".pdf", _pdf),
    "hpgl": (".hpgl", _hpgl),
}
_TILED = "tiled-"
FORMATS = (*_SHEETS, *(f"{_TILED}{page}" for page in PAGES_MM), "picture")
_ENDING = re.compile(
    "|".join(re.escape(ending) for ending, _ in _SHEETS.values())
    + rf"|-({'|'.join(PAGES_MM)}|[0-9a-z.]+x[0-9a-z.]+)\.pdf"
)


def is_ending(text: str) -> bool:
    """Whether the names of drawings may have ``text`` behind the name of their sheet."""
    return _ENDING.fullmatch(text) is not None


def read_formats(given: Iterable[str]) -> tuple[str, ...]:
    """The formats named in ``given`` (also comma-separated), without repeats.

    Raises :class:`~miurafab.errors.InputError` naming an unknown format.
    """
    names = [name.strip().lower() for word in given for name in word.split(",")]
    # Every sheet is always drawn as SVG.
    names = list(dict.fromkeys(name for name in names if name != "svg"))
    for name in names:
        if name.startswith(_TILED) and name[len(_TILED) :][:1].isdigit():
            page_size(name.removeprefix(_TILED))
        elif name not in FORMATS:
            near = difflib.get_close_matches(name, FORMATS, 1)
            hint = f"; did you mean '{near[0]}'?" if near else f": there are {', '.join(FORMATS)}."
            raise InputError(f"'{name}' is not a drawing format{hint}")
    return tuple(names)


def drawings(
    layout: DrawnLayout, pattern: CreasePattern, formats: Iterable[str], title: str
) -> Iterable[tuple[str, bytes]]:
    """The name and content of each drawing of ``layout`` in the ``formats`` of
    :func:`read_formats`.
    """
    from miurafab.fabrication.drawing.svg import layout_svg
    from miurafab.fabrication.drawing.views import edge_letters

    letters = edge_letters(layout, pattern)
    for name in formats:
        if name == "picture":
            yield PICTURE, layout_svg(pattern, layout).encode("utf-8")
            continue
        page = name.removeprefix(_TILED)
        ending, draw = _SHEETS.get(name) or (f"-{page}.pdf", _tiled(page))
        for toolpath in layout.passes:
            yield f"{toolpath.sheet}{ending}", draw(toolpath, letters, title)


def guides(
    layout: DrawnLayout, machine: MachineProfile, material: Material, title: str
) -> Iterator[tuple[str, str | bytes]]:
    """The file names and contents of what explains the job with this ``title``: the guide in both
    forms, and the jig if there is one.
    """
    from miurafab.fabrication.drawing.assembly_guide import assembly_guide
    from miurafab.fabrication.drawing.jig_svg import jig_svg

    guide = assembly_guide(layout, layout.pattern, machine, material, title)
    yield GUIDE, guide.pdf
    yield GUIDE_PAGE, guide.page
    if layout.jig is not None:
        yield JIG, jig_svg(layout.jig, title)
