"""From one program's pattern file to another's: what each format holds, and what is lost.

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
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from miurafab.errors import InputError, PatternError
from miurafab.files import read_bytes
from miurafab.origami.crease_pattern import ASSIGNMENTS, CreasePattern
from miurafab.origami.folding.contact import triangulate
from miurafab.origami.formats.fold import read_fold
from miurafab.origami.formats.lines import (
    cp_text,
    dxf_text,
    opx_text,
    parse_cp,
    parse_dxf,
    parse_opx,
)
from miurafab.origami.formats.mesh import glb_bytes, obj_text, stl_bytes
from miurafab.origami.formats.obj import pattern_from_obj_pair
from miurafab.origami.formats.planar_graph import CreaseLines, lines_of, pattern_from_lines
from miurafab.origami.formats.svg import parse_svg, svg_text
from miurafab.workflow.design import save_pattern

DRAWINGS: dict[str, Callable[[str], CreaseLines]] = {
    ".svg": parse_svg,
    ".dxf": parse_dxf,
    ".cp": parse_cp,
    ".opx": parse_opx,
}
READ = (".fold", *DRAWINGS, ".obj")
WRITTEN = (*READ, ".stl", ".glb")
_WITHOUT_ANGLES = (".dxf", ".cp", ".opx")


@dataclass(frozen=True, eq=False)
class Conversion:
    """A ``pattern`` that was read from ``source`` and written to ``target``; ``remarks`` are
    sentences on what was lost.
    """

    source: Path
    target: Path
    pattern: CreasePattern
    remarks: tuple[str, ...]

    def report(self) -> dict[str, Any]:
        """The JSON answer of ``convert``."""
        letters = self.pattern.edges_assignment
        return {
            "file": str(self.target),
            "facets": len(self.pattern.faces_vertices),
            "vertices": len(self.pattern.vertices_coords),
            "edges": {
                letter: int((letters == letter).sum())
                for letter in ASSIGNMENTS
                if (letters == letter).any()
            },
            "folded_form": self.pattern.folded_coords is not None,
            "remarks": list(self.remarks),
        }


def convert(
    source: str | Path,
    target: str | Path,
    *,
    folded: str | Path | None = None,
    form: str | None = None,
    tolerance: float | None = None,
) -> Conversion:
    """Read the pattern in ``source`` and write it to ``target``, in the formats of their endings.

    ``folded`` is the OBJ file with the folded form of an OBJ ``source``. ``form``, "flat" or
    "folded", is what is written where only one fits, by default folded if there is one.
    ``tolerance``, mm, is how near the ends of lines count as met in a drawing.

    Raises :class:`~miurafab.errors.InputError` for endings and options that do not go together,
    :class:`~miurafab.errors.PatternError` for files that cannot be read.
    """
    source, target = Path(source), Path(target)
    ending = target.suffix.lower()
    if ending not in WRITTEN:
        raise InputError(f"{target} does not end in one of {', '.join(WRITTEN)}.")
    if form not in (None, "flat", "folded"):
        raise InputError(f"`form` is '{form}'; it is flat or folded.")
    pattern = read_pattern(source, folded=folded, tolerance=tolerance)
    remarks = [] if source.suffix.lower() == ".fold" else _said_nothing_of(source, pattern)
    if ending in (".obj", ".stl", ".glb"):
        _write_solid(pattern, target, form)
        remarks.append(f"{target.name} holds a shape and no creases.")
    elif ending == ".fold":
        save_pattern(_with_mesh_beside(pattern, source), target, source.stem)
    else:
        _write_drawing(pattern, target, source.stem)
        if pattern.folded_coords is not None:
            remarks.append(f"{target.name} does not hold the folded form.")
        if ending in _WITHOUT_ANGLES:
            remarks.append(f"{target.name} tells mountains from valleys and no fold angles.")
    return Conversion(source, target, pattern, tuple(remarks))


def read_pattern(
    path: Path, *, folded: str | Path | None = None, tolerance: float | None = None
) -> CreasePattern:
    """The pattern in ``path``, in any format that holds one; arguments as for :func:`convert`."""
    ending = path.suffix.lower()
    if folded is not None and ending != ".obj":
        raise InputError(f"`folded` goes with a flat .obj file, and {path} is none.")
    if ending == ".fold":
        return read_fold(path)
    if ending == ".obj":
        if folded is None:
            raise InputError(
                f"{path} is one shape; give its folded form (.obj) as `folded` to make a "
                "pattern of the two, or fit it as a surface with 'miurafab fit'."
            )
        return pattern_from_obj_pair(path, Path(folded))
    if ending in (".stl", ".glb"):
        raise InputError(
            f"{path} holds triangles and no crease pattern; fit it as a surface with "
            "'miurafab fit'."
        )
    if ending not in DRAWINGS:
        raise InputError(f"{path} does not end in one of {', '.join(READ)}.")
    text = read_bytes(path, PatternError).decode("utf-8", errors="replace")
    try:
        return pattern_from_lines(DRAWINGS[ending](text), tolerance)
    except InputError as fault:
        raise PatternError(f"{path}: {fault}") from None


def _said_nothing_of(source: Path, pattern: CreasePattern) -> list[str]:
    """What the pattern had to be given that its file does not tell."""
    if source.suffix.lower() in _WITHOUT_ANGLES and (np.abs(pattern.edges_fold_angle) > 0).any():
        return [f"{source.name} tells no fold angles: its creases are taken as folded flat."]
    return []


def _with_mesh_beside(pattern: CreasePattern, source: Path) -> CreasePattern:
    """``pattern`` with the mesh of its target named from here and not from ``source``."""
    if "mesh" not in pattern.target:
        return pattern
    mesh = (source.parent / str(pattern.target["mesh"])).resolve()
    return replace(pattern, target={**pattern.target, "mesh": str(mesh)})


def _write_solid(pattern: CreasePattern, path: Path, form: str | None) -> None:
    if form == "folded" and pattern.folded_coords is None:
        raise InputError("The pattern has no folded form to write; leave `form` out.")
    if pattern.folded_coords is None or form == "flat":
        points = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    else:
        points = pattern.folded_coords
    triangles, _ = triangulate(pattern.faces_vertices, pattern.vertices_coords)
    if path.suffix.lower() == ".obj":
        text = obj_text(points, pattern.faces_vertices, path.stem)
        path.write_text(text, encoding="utf-8", newline="\n")
    elif path.suffix.lower() == ".stl":
        path.write_bytes(stl_bytes(points, triangles))
    else:
        path.write_bytes(glb_bytes(points, triangles))


def _write_drawing(pattern: CreasePattern, path: Path, title: str) -> None:
    lines, ending = lines_of(pattern), path.suffix.lower()
    if ending == ".svg":
        text = svg_text(lines, title)
    elif ending == ".opx":
        text = opx_text(lines, title)
    else:
        text = cp_text(lines) if ending == ".cp" else dxf_text(lines)
    path.write_text(text, encoding="utf-8", newline="\n")
