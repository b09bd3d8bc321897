"""Pattern files by their ending: read in any format that holds a pattern, written in any format.

======= =============================================== ======= ========
ending  holds                                           read    written
======= =============================================== ======= ========
.fold   flat and folded form, fold angles               yes     yes
.svg    flat pattern, fold angles (Origami Simulator)   yes     yes
.dxf    flat pattern, mountains and valleys             yes     yes
.cp     flat pattern, mountains and valleys             yes     yes
.opx    flat pattern, mountains and valleys             yes     yes
.obj    one form as facets; two files make a pattern    a pair  yes
.stl    one form as triangles                           no      yes
.glb    one form as triangles                           no      yes
======= =============================================== ======= ========
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from miurafab.errors import InputError, OptionError, PatternError
from miurafab.files import AnyPath, Reading, as_path, new_file, read_bytes, write_bytes, write_text
from miurafab.options import length, option, read_options
from miurafab.options.documented import described
from miurafab.options.verbs import verb
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.contact import triangulate
from miurafab.origami.folding.layers import known_layer_order
from miurafab.origami.formats.crease_lines import CreaseLines, lines_of
from miurafab.origami.formats.dxf_entities import parse_dxf
from miurafab.origami.formats.fold import read_fold, write_fold
from miurafab.origami.formats.lines import (
    cp_text,
    dxf_text,
    opx_text,
    parse_cp,
    parse_opx,
)
from miurafab.origami.formats.mesh import glb_bytes, obj_text, stl_bytes
from miurafab.origami.formats.obj import pattern_from_obj_pair
from miurafab.origami.formats.planar_graph import pattern_from_lines
from miurafab.origami.formats.svg import parse_svg, svg_text
from miurafab.origami.weld import welded

CURVED: dict[str, Callable[[str, float | None], CreaseLines]] = {
    ".svg": parse_svg,
    ".dxf": parse_dxf,
}
DRAWINGS: dict[str, Callable[[str], CreaseLines]] = {".cp": parse_cp, ".opx": parse_opx}
WITHOUT_ANGLES = (".dxf", ".cp", ".opx")
SOLIDS = (".obj", ".stl", ".glb")
READ = (".fold", *CURVED, *DRAWINGS, ".obj")
WRITTEN = (*READ, ".stl", ".glb")


@dataclass(frozen=True)
class ReadingOptions:
    """The options of reading a pattern from a file."""

    tolerance_mm: float | None = option(
        length(above=True),
        "The largest gap between ends of lines in a drawing that count as one point; in a FOLD or "
        "OBJ file shorter edges vanish, and their ends are one.",
        default_text="1/10000 of the median line of a drawing, more where lines would be lost",
    )
    curve_tolerance_mm: float | None = option(
        length(above=True),
        "How far straight lines may lie from the curved lines of an .svg or .dxf drawing, for "
        "which they stand.",
        default_text="1/1000 of the drawing's longer side",
    )


@verb
def load(path: AnyPath, *, folded: AnyPath | None = None, **options: Any) -> CreasePattern:
    """Read a pattern from a file, in the format of its ending.

    Parameters
    ----------
    path : str or os.PathLike
        A ``.fold``, ``.svg``, ``.dxf``, ``.cp``, ``.opx`` or flat ``.obj`` file.
    folded : str or os.PathLike, optional
        The OBJ file with the folded form of an OBJ ``path``.
    {options}

    Returns
    -------
    CreasePattern
        ``told`` says what was changed, left out or assumed in reading.

    Raises
    ------
    PatternError
        For a file that is missing or holds no pattern.
    InputError
        For another ending, and for options that do not go with it.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.fit("plane", facets=(4, 4)).pattern.save("plane.fold")
    >>> mf.load("plane.fold")
    <CreasePattern 16 facets, 25 vertices, 196.2 x 234 mm flat, with folded form, of plane>
    """
    path = as_path(path, "The pattern file")
    ending = path.suffix.lower()
    if folded is not None and ending != ".obj":
        raise OptionError("folded", f"goes with a flat .obj file, and {path} is none")
    asked = read_options(ReadingOptions, options)
    tolerance, curve_tolerance = asked.tolerance_mm, asked.curve_tolerance_mm
    if curve_tolerance is not None and ending not in CURVED:
        raise OptionError(
            "curve_tolerance", f"is for {' and '.join(CURVED)} drawings, and {path} is none"
        )
    if ending == ".fold":
        found = read_fold(path)
        return found if tolerance is None else welded(found, tolerance)
    if ending == ".obj":
        if folded is None:
            raise InputError(
                f"{path} is one shape; give its folded form (.obj) as `folded` to make a pattern "
                "of the two, or fit it as a surface with 'miurafab fit'."
            )
        return pattern_from_obj_pair(path, as_path(folded, "The folded form"), tolerance)
    if ending in (".stl", ".glb"):
        raise InputError(
            f"{path} holds triangles and no crease pattern; fit it as a surface with "
            "'miurafab fit'."
        )
    if ending not in READ:
        raise InputError(f"{path} does not end in one of {', '.join(READ)}.")
    text = read_bytes(path, PatternError).decode("utf-8", errors="replace")
    with Reading(path, f"a drawing that can be read ({ending})", PatternError):
        if ending in CURVED:
            lines = CURVED[ending](text, curve_tolerance)
        else:
            lines = DRAWINGS[ending](text)
        return pattern_from_lines(lines, tolerance)


described(load, ReadingOptions)


def write_pattern(
    pattern: CreasePattern, path: AnyPath, *, title: str = "", form: str | None = None
) -> Path:
    """Write ``pattern`` to ``path``, in the format of its ending (:meth:`CreasePattern.save`)."""
    path = new_file(path, "The pattern file", WRITTEN)
    form = pattern.chosen_form(form)
    ending = path.suffix.lower()
    if ending == ".fold":
        write_fold(pattern, path, title, order=known_layer_order(pattern))
    elif ending in SOLIDS:
        _write_solid(pattern, path, form)
    else:
        _write_drawing(pattern, path, title)
    return path


def _write_solid(pattern: CreasePattern, path: Path, form: str) -> None:
    if pattern.folded_coords is None or form == "flat":
        points = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    else:
        points = pattern.folded_coords
    triangles, _ = triangulate(pattern.faces_vertices, pattern.vertices_coords)
    if path.suffix.lower() == ".obj":
        text = obj_text(points, pattern.faces_vertices, path.stem)
        write_text(path, text)
    elif path.suffix.lower() == ".stl":
        write_bytes(path, stl_bytes(points, triangles))
    else:
        write_bytes(path, glb_bytes(points, triangles))


def _write_drawing(pattern: CreasePattern, path: Path, title: str) -> None:
    lines, ending = lines_of(pattern), path.suffix.lower()
    if ending == ".svg":
        text = svg_text(lines, title)
    elif ending == ".opx":
        text = opx_text(lines, title)
    else:
        text = cp_text(lines) if ending == ".cp" else dxf_text(lines)
    write_text(path, text)
