"""FOLD 1.2 files: written in one form, and read from any program that stores a crease pattern.

The key frame is the flat crease pattern; ``file_frames[0]`` inherits it and holds the folded form.
Where the order of the layers is known, a frame folded flat with ``faceOrders`` follows. The frames
of a folding motion come last. In files of other programs the flat pattern may be in any
frame, facets may run clockwise or be missing, and fold angles may have to come from the folded form
(FOLD 1.2, https://github.com/edemaine/fold/blob/main/doc/spec.md).

A pattern of several pieces has the keys ``miurafab:pieces`` (the piece of each facet) and
``miurafab:seams`` (pairs of border edges that meet in the folded form). Without the first, the
parts of the pattern that do not touch are its pieces. ``miurafab:cells`` has the column and row of
each facet where they do not fill the grid of ``miurafab:grid``. ``miurafab:unfolded`` is the
residual to which a flat pattern fits that was computed from a folded form alone; it is believed
where that computation gives the same flat pattern.
``miurafab:angles`` is ``assumed`` where no fold angle is known and each fold is given as 180
degrees.

Numbers have as many digits as are needed to read them back bit for bit. The same pattern gives the
same bytes.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from miurafab.errors import PatternError
from miurafab.files import Reading, parse_json, read_text, write_text
from miurafab.findings import Finding
from miurafab.geometry.arrays import Ints
from miurafab.geometry.polygons import (
    connected_parts,
)
from miurafab.origami.crease_pattern import CreasePattern, restricted
from miurafab.origami.flattening import ROUGHEST
from miurafab.origami.folding.kinematics import FoldingMotion
from miurafab.origami.folding.layers import LayerOrder
from miurafab.origami.formats.crease_lines import CreaseLines
from miurafab.origami.formats.fold_frames import written_frames
from miurafab.origami.formats.fold_keys import (
    assignments_in,
    classes_of,
    edges_in,
    faces_in,
    fold_angles_in,
    frames_in,
    numbers_at,
    points_at,
    told_without_sizes,
    unit_mm,
)
from miurafab.origami.formats.fold_states import (
    FurtherFrame,
    flat_frame,
    folded_alone,
    folded_form,
    folded_frame,
    further_frames,
    origin_of,
)
from miurafab.origami.formats.folded_only import (
    is_unfolded,
    told_of_unfolding,
    unfolded_pattern,
)
from miurafab.origami.formats.planar_graph import (
    are_lines,
    enclosed_facets,
    oriented,
    pattern_from_lines,
)
from miurafab.origami.formats.target_frame import (
    exact_frames,
    in_own_frame,
    scale_in,
    target_in,
    target_kept,
    target_seal,
)
from miurafab.origami.formats.two_forms import with_its_own_form, with_its_rounding
from miurafab.origami.unfold import with_angles_of_the_folded_form
from miurafab.version import __version__

ASSUMED = "assumed"


def fold_text(
    pattern: CreasePattern,
    title: str = "",
    motion: FoldingMotion | None = None,
    order: LayerOrder | None = None,
) -> str:
    """``pattern`` as the text of a FOLD 1.2 file, one top-level key in each line.

    The pattern folded flat, with the ``order`` of its layers, and the frames of a ``motion`` follow
    the folded form. Each inherits the flat pattern and has its own coordinates and fold angles. A
    motion that ends folded flat has the order in its last frame.
    """
    keys: dict[str, Any] = {
        "file_spec": 1.2,
        "file_creator": f"miurafab {__version__}",
        "file_title": title,
        "file_classes": ["singleModel"],
        "frame_classes": ["creasePattern"],
        "frame_attributes": ["2D"],
        "frame_unit": "mm",
        "vertices_coords": pattern.vertices_coords.tolist(),
        "edges_vertices": pattern.edges_vertices.tolist(),
        "edges_assignment": pattern.edges_assignment.tolist(),
        "edges_foldAngle": np.degrees(pattern.edges_fold_angle).tolist(),
        "faces_vertices": _polygons(pattern.faces_vertices),
    }
    frames = written_frames(pattern, motion, order)
    if motion is not None:
        keys["file_classes"].append("animation")
    if frames:
        keys["file_frames"] = frames
    if pattern.grid is not None:
        keys["miurafab:grid"] = list(pattern.grid)
    for name, numbers in (
        ("cells", pattern.cells),
        ("pieces", pattern.pieces),
        ("seams", pattern.seams),
    ):
        if numbers is not None:
            keys[f"miurafab:{name}"] = numbers.tolist()
    if pattern.unfolded is not None:
        keys["miurafab:unfolded"] = pattern.unfolded
    if pattern.angles_assumed:
        keys["miurafab:angles"] = ASSUMED
    if pattern.target:
        keys["miurafab:target"] = pattern.target
        keys["miurafab:scale"] = pattern.scale
        keys["miurafab:target_sha256"] = target_seal(pattern.target, pattern.scale)
    if not title:
        del keys["file_title"]
    lines = (
        f"{json.dumps(key)}: {json.dumps(value, separators=(',', ':'), allow_nan=False)}"
        for key, value in keys.items()
    )
    return in_own_frame("{\n" + ",\n".join(lines) + "\n}\n", pattern)


def _polygons(faces: Ints) -> list[list[int]]:
    if (faces >= 0).all():
        whole: list[list[int]] = faces.tolist()
        return whole
    return [[v for v in face if v >= 0] for face in faces.tolist()]


def write_fold(
    pattern: CreasePattern,
    path: Path,
    title: str = "",
    motion: FoldingMotion | None = None,
    order: LayerOrder | None = None,
) -> None:
    """Write ``pattern`` to the FOLD file ``path``, with what is given of a ``motion`` and of the
    ``order`` of its layers.

    A mesh file that is its target is named from the folder of ``path``, so that both can move
    together.
    """
    write_text(path, fold_text(seen_from(pattern, path.parent), title, motion, order))


def seen_from(pattern: CreasePattern, folder: Path) -> CreasePattern:
    """``pattern`` with the mesh that is its target, if any, named from ``folder``."""
    mesh = pattern.target.get("mesh")
    if mesh is None:
        return pattern
    relative = Path(os.path.relpath(mesh, folder.resolve())).as_posix()
    return replace(pattern, target={**pattern.target, "mesh": relative})


def read_fold(path: Path) -> CreasePattern:
    """The pattern in the FOLD file ``path``; a mesh file that is its target by its whole path.

    Raises :class:`~miurafab.errors.PatternError` naming the file and what is wrong with it.
    """
    text = read_text(path, PatternError, "a FOLD file")
    with Reading(path, "a FOLD file", PatternError):
        document = parse_json(text)
        pattern = parse_fold(exact_frames(document, text) if type(document) is dict else document)
    mesh = pattern.target.get("mesh")
    if not isinstance(mesh, str):
        return pattern
    whole = os.path.realpath(path.parent / mesh)  # Path.resolve raises for a ring of links
    return replace(pattern, target={**pattern.target, "mesh": whole})


def read_further_frames(path: Path) -> tuple[FurtherFrame, ...]:
    """The frames of class foldedForm in the FOLD file ``path`` beside its folded form.

    Raises :class:`~miurafab.errors.PatternError` as :func:`read_fold` does.
    """
    text = read_text(path, PatternError, "a FOLD file")
    with Reading(path, "a FOLD file", PatternError):
        document = parse_json(text)
        return further_frames(exact_frames(document, text) if type(document) is dict else document)


def parse_fold(document: Any) -> CreasePattern:
    """The pattern in a parsed FOLD document. Raises ``PatternError`` naming the key at fault."""
    if not isinstance(document, dict):
        raise PatternError("A FOLD file holds one JSON object.")
    frames = frames_in(document)
    alone = folded_alone(frames)
    if alone is not None:
        return unfolded_pattern(alone, unit_mm(alone, 1.0))
    place, key = flat_frame(frames)
    factor = unit_mm(key, 1.0)
    flat = np.ascontiguousarray(points_at(key, "vertices_coords")[:, :2] * factor)
    edges = edges_in(key)
    assignment = assignments_in(key, len(edges))
    own = fold_angles_in(key, assignment, np.nan)
    unsized = told_without_sizes(key, assignment, own)
    given = "faces_vertices" in key
    if not given and len(frames) == 1 and are_lines(flat, edges, assignment):
        drawn = pattern_from_lines(CreaseLines(flat[edges], assignment, own))
        return replace(drawn, told=(*drawn.told, *unsized))
    faces = faces_in(key) if given else enclosed_facets(flat, edges, assignment)
    if faces.max() >= len(flat):  # before something is made as large as that number
        raise PatternError("'faces_vertices' refers to a vertex that does not exist.")
    others = frames[:place] + frames[place + 1 :]
    unfolded = _unfolded(document)
    pattern = CreasePattern(
        vertices_coords=flat,
        edges_vertices=edges,
        edges_assignment=assignment,
        edges_fold_angle=fold_angles_in(key, assignment),
        faces_vertices=faces,
        folded_coords=folded_form(others, key, len(flat), factor, origin_of(document)),
        grid=_grid(document, len(flat)),
        pieces=_pieces(document, faces),
        seams=numbers_at(document, "miurafab:seams", 2),
        cells=numbers_at(document, "miurafab:cells", 2),
        scale=scale_in(document),
        target=target_in(document),
        target_kept=target_kept(document),
        angles_assumed=document.get("miurafab:angles") == ASSUMED,
        unfolded=unfolded,
        told=() if unfolded is None else (told_of_unfolding(unfolded),),
    )
    pattern = replace(pattern, faces_vertices=oriented(flat, faces))
    pattern.edges_faces  # noqa: B018 - facets that do not fit their edges are a fault of the file
    foreign = not any(name.startswith("miurafab:") for name in document)
    if pattern.unfolded is not None and not is_unfolded(pattern):
        pattern = replace(pattern, unfolded=None, told=())
    if pattern.folded_coords is not None:
        chosen = folded_frame(others, key)
        assert chosen is not None
        pattern = with_its_rounding(
            with_its_own_form(pattern) if foreign else pattern,
            points_at(frames[place], "vertices_coords"),
            points_at(chosen, "vertices_coords"),
        )
    if pattern.folded_coords is not None:
        pattern = with_angles_of_the_folded_form(pattern, np.isfinite(own))
    elif unsized:
        pattern = replace(pattern, angles_assumed=True, told=(*pattern.told, *unsized))
    further = sum("foldedForm" in classes_of(frame) for frame in frames) > 1
    return pattern if further else _without_loose_vertices(pattern)


def _without_loose_vertices(pattern: CreasePattern) -> CreasePattern:
    """``pattern`` without the vertices of no facet, and without the edges that end there."""
    faces = pattern.faces_vertices
    used = np.zeros(len(pattern.vertices_coords), dtype=bool)
    used[faces[faces >= 0]] = True
    if used.all() or pattern.grid is not None or pattern.seams is not None:
        return pattern
    kept = used[pattern.edges_vertices].all(axis=1)
    loose, edges = int((~used).sum()), int((~kept).sum())
    says = (
        f"{loose} {'vertex' if loose == 1 else 'vertices'} of no facet, with {edges} "
        f"{'edge' if edges == 1 else 'edges'} there, {'is' if loose == 1 else 'are'} left out, the "
        f"first being vertex {int(np.argmin(used))}."
    )
    return restricted(
        pattern,
        np.flatnonzero(used),
        np.flatnonzero(kept),
        faces,
        told=(*pattern.told, Finding("lost-lines", says)),
    )


def _grid(document: Mapping[str, Any], vertices: int) -> tuple[int, int] | None:
    grid = document.get("miurafab:grid")
    if grid is None:
        return None
    if (
        not isinstance(grid, list)
        or len(grid) != 2
        or not all(type(n) is int and n >= 2 for n in grid)
        or grid[0] * grid[1] != vertices
    ):
        raise PatternError(f"'miurafab:grid' is {grid}, which does not give {vertices} vertices.")
    return grid[0], grid[1]


def _unfolded(document: Mapping[str, Any]) -> float | None:
    residual = document.get("miurafab:unfolded")
    if residual is None:
        return None
    if isinstance(residual, bool) or not isinstance(residual, int | float):
        raise PatternError("'miurafab:unfolded' is not a number.")
    if not 0 <= residual <= ROUGHEST:
        raise PatternError(f"'miurafab:unfolded' is {residual}; it is from 0 to {ROUGHEST}.")
    return float(residual)


def _pieces(document: Mapping[str, Any], faces: Ints) -> Ints | None:
    """The file's pieces, or else the parts of the pattern that do not touch; None for one."""
    given = numbers_at(document, "miurafab:pieces", None)
    if given is not None:
        return given
    count, part = connected_parts(faces)
    return part if count > 1 else None
