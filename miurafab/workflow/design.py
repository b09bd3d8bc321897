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
from typing import Any

from miurafab.errors import OptionError, PatternError, TargetError
from miurafab.fabrication.options import LayoutOptions
from miurafab.findings import Finding
from miurafab.options import read_options
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.fitting.request import DEFAULT_SIZE_MM, FitOptions, FitRequest
from miurafab.origami.formats.fold import read_fold, write_fold
from miurafab.profiles import Table, find_file, read_toml
from miurafab.surfaces.analytic import GeneralizedCylinder, Revolution
from miurafab.surfaces.catalogue import make_surface, parse_target
from miurafab.surfaces.mesh import MESH_SUFFIXES, load_mesh
from miurafab.surfaces.surface import TargetSurface


@dataclass(frozen=True)
class Design:
    """A request with a title, the machine and material that its file names, if any, and findings
    on the target. ``layout`` is what the file asks of the sheets.
    """

    request: FitRequest
    title: str
    machine: str | None = None
    material: str | None = None
    findings: tuple[Finding, ...] = ()
    layout: LayoutOptions | None = None


def design(target: str, **options: object) -> Design:
    """What TARGET asks for.

    ``options`` are those of ``miurafab fit``, as values (``facets=(20, 20)``, ``size=250``,
    ``rotate=30``; millimetres and degrees) or as text (``size="10in"``); None leaves one unset.

    Raises :class:`~miurafab.errors.TargetError` or ``InputError`` for whatever cannot be read.
    """
    suffix = Path(target).suffix.lower()
    if suffix == ".toml":
        return _from_file(find_file("patterns", target, error=TargetError), options)
    asked = read_options(FitOptions, options)
    if suffix in MESH_SUFFIXES:
        return _on_mesh(Path(target), asked, Path(target).stem)
    if suffix and os.sep in target:
        raise TargetError(
            f"'{target}' cannot be a target: known files are .toml, {', '.join(MESH_SUFFIXES)}."
        )
    name, parameters = parse_target(target)
    return _on_surface(name, parameters, asked, name)


def _from_file(path: Path, options: Mapping[str, object]) -> Design:
    table = Table(read_toml(path, TargetError), path.name, TargetError)
    title = table.text("title", path.stem)
    target = table.table("target")
    layout = table.table("layout", {})
    machine = layout.text("machine") if layout.has("machine") else None
    material = layout.text("material") if layout.has("material") else None
    sheets = read_options(
        LayoutOptions,
        layout.rest(),
        where=layout.where,
        folder=path.parent,
        besides=("machine", "material"),
    )
    asked = read_options(
        FitOptions,
        table.rest(),
        where=path.name,
        over=options,
        besides=("title", "target", "layout"),
    )
    try:
        if target.has("mesh"):
            design = _on_mesh(path.parent / target.text("mesh"), asked, title)
            target.finish()
        else:
            design = _on_surface(target.text("surface"), target.rest(), asked, title)
    except OptionError as fault:
        where = "" if options.get(fault.option or "") is not None else path.name
        raise OptionError(fault.option, fault.complaint, where) from None
    return replace(design, machine=machine, material=material, layout=sheets)


def _on_mesh(path: Path, asked: FitOptions, title: str) -> Design:
    surface, sha256 = load_mesh(path, region=asked.region, rotate=asked.rotate)
    target = {"mesh": str(path.resolve()), "sha256": sha256, **surface.description}
    request = FitRequest(**vars(asked), surface=surface, target=target)
    return Design(request, title, findings=surface.findings)


def _on_surface(name: str, parameters: Mapping[str, Any], asked: FitOptions, title: str) -> Design:
    for option in ("region", "rotate"):
        if getattr(asked, option) is not None:
            raise OptionError(option, "is for mesh targets; a named surface has parameters")
    surface, values = _closed(*make_surface(name, parameters), name, asked)
    target = {"surface": name, "parameters": values}
    size = DEFAULT_SIZE_MM if asked.size_mm is None else asked.size_mm
    request = FitRequest(**vars(replace(asked, size_mm=size)), surface=surface, target=target)
    return Design(request, title)


def can_close(surface: TargetSurface, parameters: Mapping[str, Any]) -> bool:
    """Whether a named surface goes around an axis, so that its sheet can be closed."""
    arc = isinstance(surface, GeneralizedCylinder)
    arc = arc and "angle" in parameters and "profile" not in parameters
    return arc or isinstance(surface, Revolution)


def _closed(
    surface: TargetSurface, values: dict[str, Any], name: str, asked: FitOptions
) -> tuple[TargetSurface, dict[str, Any]]:
    """A named surface, turned as far as ``close`` says: the sector of its parameter ``angle``,
    all round with a gap of one facet (``open``), or all round with a seam to glue (``seam``).
    """
    if asked.close == "sector":
        return surface, values
    if not can_close(surface, values):
        raise OptionError(
            "close",
            f"is {asked.close}, which needs a surface of revolution or a circular cylinder; "
            f"'{name}' is neither",
        )
    if asked.close == "seam" and asked.rows % 2:
        raise OptionError(
            "close",
            f"is seam, which needs an even number of rows of facets; `facets` asks for "
            f"{asked.rows}",
        )
    rows = asked.rows
    turn = 360.0 * (rows / (rows + 1) if asked.close == "open" else 1.0)
    return make_surface(name, {**values, "angle": turn})


def save_pattern(pattern: CreasePattern, path: Path, title: str = "") -> None:
    """Write a FOLD file; a mesh target is named relative to it, so that both can move together."""
    target = dict(pattern.target)
    if "mesh" in target:
        target["mesh"] = Path(os.path.relpath(target["mesh"], path.resolve().parent)).as_posix()
    write_fold(replace(pattern, target=target), path, title)


def load_pattern(path: Path) -> tuple[CreasePattern, TargetSurface | None, tuple[Finding, ...]]:
    """The pattern in a FOLD file, its target (None without one), and findings on the target.

    A pattern without a target comes from another program. A mesh that was moved or has changed
    since the fit is a finding and no error.
    """
    pattern = read_fold(path)
    target = pattern.target
    if not target:
        return pattern, None, ()
    if "mesh" in target:
        mesh = path.parent / str(target["mesh"])
        if not mesh.is_file():
            return pattern, None, no_target(f"the target mesh {mesh} is not there")
        if hashlib.sha256(mesh.read_bytes()).hexdigest() != target.get("sha256"):
            return pattern, None, no_target(f"the target mesh {mesh} has changed since the fit")
        return pattern, load_mesh(mesh, place=target)[0], ()
    parameters = target.get("parameters", {})
    if not isinstance(target.get("surface"), str) or not isinstance(parameters, dict):
        raise PatternError(f"{path}: 'miurafab:target' names neither a surface nor a mesh.")
    surface, _ = make_surface(target["surface"], parameters)
    return pattern, surface, ()


def no_target(why: str) -> tuple[Finding, ...]:
    """The finding on a pattern whose target cannot be used."""
    return (Finding("no-target", f"Distances are left out: {why}."),)
