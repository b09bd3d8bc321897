"""From what a user names to what the fit is asked: TARGET, design files, and back from a pattern.

A TARGET is a named surface with parameters (``hypar:height=0.5``), a design file (.toml) or a mesh
file. A design file says the same as the options of ``miurafab fit``, and options override it.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from miurafab.errors import InputError, PatternError, TargetError
from miurafab.fabrication.options import LayoutOptions, read_options
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.fit import FitRequest
from miurafab.origami.fitting.polish import Follow
from miurafab.origami.formats.fold import read_fold, write_fold
from miurafab.profiles import Table, find_file, read_toml
from miurafab.surfaces.analytic import GeneralizedCylinder, Revolution
from miurafab.surfaces.catalogue import make_surface, parse_target
from miurafab.surfaces.mesh import MESH_SUFFIXES, MeshSurface, load_mesh
from miurafab.surfaces.placement import Region
from miurafab.surfaces.surface import TargetSurface
from miurafab.units import parse_angle, parse_length

DEFAULT_FACETS = "20x20"
DEFAULT_SIZE_MM = 200.0
"""The longest side of a named surface's folded form; a mesh keeps the size of its file."""


@dataclass(frozen=True)
class Design:
    """A request with a title, the machine and material that its file names, if any, and remarks on
    the target that the user might want to know. ``layout`` is what the file asks of the sheets.
    """

    request: FitRequest
    title: str
    machine: str | None = None
    material: str | None = None
    remarks: tuple[str, ...] = ()
    layout: LayoutOptions | None = None


def parse_facets(text: str) -> tuple[int, int]:
    """``COLSxROWS`` as two whole numbers. Raises ``InputError``."""
    columns, cross, rows = text.lower().replace("×", "x").partition("x")
    if not cross or not columns.strip().isdigit() or not rows.strip().isdigit():
        raise InputError(f"--facets is '{text}'; write columns x rows, such as 20x20.")
    return int(columns), int(rows)


def parse_flat_foldable(text: str) -> float | None:
    """``exact``, ``off`` or an angle as the limit in radians. Raises ``InputError``."""
    if text == "exact":
        return 0.0
    return None if text == "off" else parse_angle(text)


def design(target: str, **options: str | None) -> Design:
    """What TARGET asks for. ``options`` are those of ``miurafab fit`` in their written form
    (``facets="20x20"``, ``size="250mm"``, ``flat_foldable="exact"``); None leaves one unset.

    Raises :class:`~miurafab.errors.TargetError` or ``InputError`` for whatever cannot be read.
    """
    given: dict[str, str | None] = {key: text for key, text in options.items() if text is not None}
    suffix = Path(target).suffix.lower()
    if suffix == ".toml":
        return _from_file(find_file("patterns", target, error=TargetError), given)
    if suffix in MESH_SUFFIXES:
        mesh, description = _mesh(Path(target), given)
        own_size: dict[str, str | None] = {"size": None}
        request = _request(mesh, description, own_size | given)
        return Design(request, Path(target).stem, remarks=mesh.remarks)
    if suffix and os.sep in target:
        raise TargetError(
            f"'{target}' cannot be a target: known files are .toml, {', '.join(MESH_SUFFIXES)}."
        )
    _only_for_meshes(given)
    name, parameters = parse_target(target)
    surface, values = _named(name, parameters, given)
    return Design(_request(surface, {"surface": name, "parameters": values}, given), name)


CLOSINGS = ("sector", "open", "seam")


def can_close(surface: TargetSurface, parameters: Mapping[str, Any]) -> bool:
    """Whether a named surface goes around an axis, so that its sheet can be closed."""
    arc = isinstance(surface, GeneralizedCylinder)
    arc = arc and "angle" in parameters and "profile" not in parameters
    return arc or isinstance(surface, Revolution)


def _named(
    name: str, parameters: Mapping[str, Any], given: Mapping[str, str | None]
) -> tuple[TargetSurface, dict[str, Any]]:
    """A named surface, turned as far as ``close`` says: the sector of its parameter ``angle``,
    all round with a gap of one facet (``open``), or all round with a seam to glue (``seam``).
    """
    surface, values = make_surface(name, parameters)
    close = given.get("close") or "sector"
    if close not in CLOSINGS:
        raise InputError(f"--close is '{close}'; it must be one of {', '.join(CLOSINGS)}.")
    if close == "sector":
        return surface, values
    if not can_close(surface, values):
        raise InputError(
            f"--close {close} needs a surface of revolution or a circular cylinder, and this "
            f"'{name}' is none."
        )
    _, rows = parse_facets(given.get("facets") or DEFAULT_FACETS)
    if close == "seam" and rows % 2:
        raise InputError(
            f"--close seam needs an even number of rows of facets, and --facets asks for {rows}."
        )
    turn = 360.0 * (rows / (rows + 1) if close == "open" else 1.0)
    return make_surface(name, {**values, "angle": turn})


_OPTIONS = (
    "facets",
    "size",
    "amplitude",
    "zigzag",
    "flat_foldable",
    "min_edge",
    "max_deviation",
    "seed",
    "region",
    "rotate",
    "close",
    "follow",
    "min_angle",
    "max_angle",
    "max_aspect",
    "polish",
)


def _from_file(path: Path, given: Mapping[str, str | None]) -> Design:
    table = Table(read_toml(path, TargetError), path.name, TargetError)
    title = table.text("title", path.stem)
    written = {key: table.scalar(key) for key in _OPTIONS if table.has(key)}
    target = table.table("target")
    layout = table.table("layout", {})
    machine = layout.text("machine") if layout.has("machine") else None
    material = layout.text("material") if layout.has("material") else None
    options = read_options(layout, path.parent)
    layout.finish()
    table.finish(known=_OPTIONS)
    defaults: dict[str, str | None] = {}
    surface: TargetSurface
    remarks: tuple[str, ...] = ()
    if target.has("mesh"):
        mesh, description = _mesh(path.parent / target.text("mesh"), written | dict(given))
        surface, remarks = mesh, mesh.remarks
        target.finish()
        defaults["size"] = None
    else:
        _only_for_meshes(written | dict(given))
        name = target.text("surface")
        surface, values = _named(name, target.rest(), defaults | written | dict(given))
        description = {"surface": name, "parameters": values}
    try:
        request = _request(surface, description, defaults | written | dict(given))
    except InputError as fault:
        raise TargetError(f"{path.name}: {fault}") from None
    return Design(request, title, machine, material, remarks, options)


def _mesh(path: Path, given: Mapping[str, str | None]) -> tuple[MeshSurface, dict[str, Any]]:
    region, rotate = given.get("region"), given.get("rotate")
    surface, sha256 = load_mesh(
        path,
        region=None if region is None else Region.parse(region),
        rotate=None if rotate is None else parse_angle(rotate),
    )
    return surface, {"mesh": str(path.resolve()), "sha256": sha256, **surface.description}


def _only_for_meshes(given: Mapping[str, str | None]) -> None:
    for key in ("region", "rotate"):
        if given.get(key) is not None:
            raise InputError(f"--{key} is for mesh targets; a named surface has parameters.")


def _request(
    surface: TargetSurface, description: dict[str, Any], given: Mapping[str, str | None]
) -> FitRequest:
    unknown = set(given) - set(_OPTIONS)
    if unknown:
        raise InputError(f"'{sorted(unknown)[0]}' is not an option of a fit.")
    columns, rows = parse_facets(given.get("facets") or DEFAULT_FACETS)
    size = given["size"] if "size" in given else str(DEFAULT_SIZE_MM)
    return FitRequest(
        surface=surface,
        columns=columns,
        rows=rows,
        size_mm=None if size is None else parse_length(size),
        amplitude=_number("amplitude", given),
        zigzag=_number("zigzag", given),
        flat_foldable=parse_flat_foldable(given.get("flat_foldable") or "off"),
        min_edge_mm=_length("min_edge", given),
        max_deviation_mm=_length("max_deviation", given),
        seed=_whole("seed", given),
        target=description,
        follow=cast(Follow, given.get("follow") or "middle"),
        min_angle=_angle("min_angle", given),
        max_angle=_angle("max_angle", given),
        max_aspect=_number("max_aspect", given),
        polish=given.get("polish") or "auto",
        search=all(given.get(key) for key in ("min_edge", "max_deviation"))
        and not given.get("facets"),
    )


def _number(key: str, given: Mapping[str, str | None]) -> float | None:
    text = given.get(key)
    if text is None:
        return None
    try:
        return float(text)
    except ValueError:
        raise InputError(f"--{key} is '{text}', not a number.") from None


def _whole(key: str, given: Mapping[str, str | None]) -> int:
    text = given.get(key) or "0"
    if not text.isdigit():
        raise InputError(f"--{key} is '{text}', not a whole number from 0 up.")
    return int(text)


def _angle(key: str, given: Mapping[str, str | None]) -> float | None:
    text = given.get(key)
    return None if text is None else parse_angle(text)


def _length(key: str, given: Mapping[str, str | None]) -> float | None:
    text = given.get(key)
    return None if text is None else parse_length(text)


def save_pattern(pattern: CreasePattern, path: Path, title: str = "") -> None:
    """Write a FOLD file; a mesh target is named relative to it, so that both can move together."""
    target = dict(pattern.target)
    if "mesh" in target:
        target["mesh"] = Path(os.path.relpath(target["mesh"], path.resolve().parent)).as_posix()
    write_fold(replace(pattern, target=target), path, title)


def load_pattern(path: Path) -> tuple[CreasePattern, TargetSurface | None, str | None]:
    """The pattern in a FOLD file, its target, and why the target is not there if it is not.

    A pattern without a target is a pattern from another program; a mesh that has moved away or
    changed since is a remark and not an error.
    """
    pattern = read_fold(path)
    target = pattern.target
    if not target:
        return pattern, None, None
    if "mesh" in target:
        mesh = path.parent / str(target["mesh"])
        if not mesh.is_file():
            return pattern, None, f"the target mesh {mesh} is not there"
        if hashlib.sha256(mesh.read_bytes()).hexdigest() != target.get("sha256"):
            return pattern, None, f"the target mesh {mesh} has changed since the fit"
        return pattern, load_mesh(mesh, place=target)[0], None
    parameters = target.get("parameters", {})
    if not isinstance(target.get("surface"), str) or not isinstance(parameters, dict):
        raise PatternError(f"{path}: 'miurafab:target' names neither a surface nor a mesh.")
    surface, _ = make_surface(target["surface"], parameters)
    return pattern, surface, None
