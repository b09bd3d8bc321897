"""From a target, in any form, to the request of a fit.

A target is text (a surface with parameters such as ``hypar:height=0.5``, a design ``.toml``, a mesh
or an image) or a value (a design, a mesh of trimesh, a function, an array). A design file says the
same as the options of ``miurafab fit``; options override it.
"""

from __future__ import annotations

import difflib
import os
import reprlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from miurafab.display import Shown
from miurafab.errors import OptionError, TargetError
from miurafab.fabrication.options import LayoutOptions
from miurafab.files import Reading
from miurafab.findings import Finding
from miurafab.options import Text, declared, length, read_options, read_value
from miurafab.origami.fitting.request import DEFAULT_SIZE_MM, FitOptions, FitRequest
from miurafab.profiles import Table, find_file, read_toml
from miurafab.surfaces.analytic import GeneralizedCylinder, Revolution
from miurafab.surfaces.catalogue import CATALOGUE, make_surface, parse_target
from miurafab.surfaces.description import described_surface
from miurafab.surfaces.frame import described
from miurafab.surfaces.function import SampledSurface, from_function, from_points
from miurafab.surfaces.height_field import IMAGE_SUFFIXES, from_heights
from miurafab.surfaces.mesh_files import (
    FROM_POINTS,
    MESH_SUFFIXES,
    is_mesh,
    mesh_suffix,
)
from miurafab.surfaces.surface import TargetSurface
from miurafab.workflow.image_targets import PARAMETERS as OF_IMAGE
from miurafab.workflow.image_targets import heights_in, image_named

if TYPE_CHECKING:
    from miurafab.surfaces.mesh import MeshSurface
    from miurafab.surfaces.tube import TubeSurface

Values = Mapping[str, Any]


@dataclass(frozen=True, repr=False)
class Design(Shown):
    """A target and what is asked of its sheet.

    Parameters
    ----------
    request : FitRequest
        The surface and the options of the fit.
    title : str
        What the design is called.
    machine, material : str, optional
        The profiles that a design file names.
    findings : tuple of Finding
        What a person should know of the target.
    layout : LayoutOptions, optional
        What a design file asks of the sheets.
    """

    request: FitRequest
    title: str
    machine: str | None = None
    material: str | None = None
    findings: tuple[Finding, ...] = ()
    layout: LayoutOptions | None = None

    def _summary(self) -> str:
        return f"'{self.title}': {self.request._summary()}"


def design(target: object, /, **options: Any) -> Design:
    """Read a target and the options of its fit, without fitting.

    Parameters
    ----------
    target : str, os.PathLike, Design, trimesh.Trimesh, callable or array
        What :func:`fit` takes.
    **options
        The options of :func:`fit`, and the parameters of the surface.

    Returns
    -------
    Design

    Raises
    ------
    TargetError
        For a target that cannot be read.
    OptionError
        For a name that is neither an option nor a parameter, and for a value that cannot be taken.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.design("hypar", height=0.5, facets=(20, 20), size=250).title
    'hypar'
    """
    given = {name: _plain(value) for name, value in options.items() if value is not None}
    if isinstance(target, FitRequest):
        target = Design(target, "design")
    if isinstance(target, Design):
        return _changed(target, given)
    if isinstance(target, str | os.PathLike):
        return _named(os.fspath(target), given)
    if isinstance(target, Mapping):
        return _from_description(target, given)
    if is_mesh(target):
        from miurafab.workflow.mesh_targets import mesh_in_arrays

        asked, _ = _asked(given, (), "a mesh")
        return _on_mesh(*mesh_in_arrays(target, asked), asked, "mesh")
    if isinstance(target, np.ndarray | list | tuple):
        return _on_array(target, given)
    if callable(target):
        name = getattr(target, "__name__", "function").strip("<>").replace("lambda", "function")
        asked, values = _asked(given, ("domain",), "a function")
        return _on_samples(*from_function(target, **values), asked, name)
    raise TargetError(
        f"{reprlib.repr(target)} cannot be a target; give the name of a surface, a file, a design, "
        "a trimesh mesh, a function of u and v, or an array of heights."
    )


def _plain(value: Any) -> Any:
    """A number or an array of NumPy as Python's own, for files and messages."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _asked(given: Values, known: Collection[str], what: str) -> tuple[FitOptions, dict[str, Any]]:
    """The options of the fit, read, and the parameters of the target."""
    chosen, values = _split(given, known, what)
    return read_options(FitOptions, chosen), values


def _split(
    given: Values, known: Collection[str], what: str
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The options of the fit and the parameters of the target, which have no name in common."""
    options = declared(FitOptions)
    for name in given:
        if name not in options and name not in known:
            near = difflib.get_close_matches(name, [*known, *options], n=1)
            hint = f"did you mean '{near[0]}'" if near else f"options are {', '.join(options)}"
            if known and not near:
                hint = f"parameters are {', '.join(known)}; {hint}"
            raise OptionError(
                None, f"'{name}' is neither an option of a fit nor a parameter of {what}; {hint}"
            )
    chosen = {name: value for name, value in given.items() if name in options}
    return chosen, {name: value for name, value in given.items() if name not in options}


def _from_description(target: Values, given: Values) -> Design:
    """The target that a pattern file describes (:mod:`miurafab.surfaces.description`)."""
    surface, missing = described_surface(target)
    if surface is None:
        reasons = " ".join(map(str, missing)) or "It is not described."
        raise TargetError(f"The target is not there. {reasons}")
    asked, _ = _asked(given, (), "a described target")
    return Design(FitRequest(**vars(asked), surface=surface, target=dict(target)), "design")


def _changed(design: Design, given: Values) -> Design:
    """``design`` with other options; its surface stays."""
    for name in ("close", "region", "rotate", "poles", "polar_hole", "side", "holes"):
        if name in given:
            raise OptionError(name, "shapes the target; give it to `design`, not to what it made")
    asked, _ = _asked(given, (), "a design")
    fields = {each.field for name, each in declared(FitOptions).items() if name in given}
    changes = {field: getattr(asked, field) for field in fields}
    return replace(design, request=replace(design.request, **changes))


def _named(target: str, given: Values) -> Design:
    """The target of a text: a file by its ending, else a surface with parameters."""
    path = Path(target)
    suffix = path.suffix.lower()
    if suffix == ".toml":
        return _from_file(find_file("patterns", target, error=TargetError), given)
    if mesh_suffix(path):
        asked, _ = _asked(given, (), f"the mesh {path.name}")
        return _from_mesh(path, asked, path.name.partition(".")[0])
    image = image_named(target)
    if image is not None:
        asked, values = _asked(given, tuple(OF_IMAGE), f"the image {image[0].name}")
        return _on_heights(*heights_in(image[0], image[1] | values), asked, image[0].stem)
    if suffix and os.sep in target and target.partition(":")[0] not in CATALOGUE:
        files = ", ".join((".toml", *MESH_SUFFIXES, *IMAGE_SUFFIXES))
        raise TargetError(f"'{target}' cannot be a target: known files are {files}.")
    name, parameters = parse_target(target)
    asked, values = _asked(given, _parameters(name), f"'{name}'")
    return _on_surface(name, parameters | values, asked, name)


def _parameters(name: str) -> tuple[str, ...]:
    entry = CATALOGUE.get(name)
    if entry is None:
        make_surface(name, {})  # says what is known
        return ()
    return entry.keys


def _from_file(path: Path, given: Values) -> Design:
    table = Table(read_toml(path, TargetError), path.name, TargetError)
    title = table.value("title", Text(), path.stem)
    target = table.table("target")
    sheets, machine, material = read_layout_table(table.table("layout", {}), path.parent)
    mesh, image = (
        path.parent / target.value(kind, Text()) if target.has(kind) else None
        for kind in ("mesh", "image")
    )
    of_file = mesh is not None or image is not None
    name = "" if of_file else target.value("surface", Text())
    with Reading(path.name, "a design", TargetError):
        known = tuple(OF_IMAGE) if image is not None else ()
        known = known if of_file else _parameters(name)
    chosen, changed = _split(given, known, f"the target of {path.name}")
    asked = read_options(
        FitOptions,
        table.rest(),
        where=path.name,
        over=chosen,
        besides=("title", "target", "layout"),
    )
    try:
        if mesh is not None:
            design = _from_mesh(mesh, asked, title)
            target.finish()
        elif image is not None:
            heights = heights_in(image, {**target.rest(), **changed})
            design = _on_heights(*heights, asked, title)
        else:
            values = target.rest()
            if isinstance(values.get("profile"), str):
                values["profile"] = str(path.parent / values["profile"])
            design = _on_surface(name, values | changed, asked, title)
    except OptionError as fault:
        where = "" if fault.option in given else path.name
        raise OptionError(fault.option, fault.complaint, where) from None
    except TargetError as fault:
        where = "" if path.name in fault.sentence else f"{path.name}: "
        raise TargetError(f"{where}{fault.sentence}") from None
    return replace(design, machine=machine, material=material, layout=sheets)


def read_layout_table(
    layout: Table, folder: Path, over: Values | None = None
) -> tuple[LayoutOptions, str | None, str | None]:
    """The ``[layout]`` of a design file in ``folder``: the options, with those ``over`` the file's,
    and the names of the machine and the material.
    """
    machine, material = (
        layout.value(key, Text()) if layout.has(key) else None for key in ("machine", "material")
    )
    options = read_options(
        LayoutOptions,
        layout.rest(),
        where=layout.where,
        folder=folder,
        over=over,
        besides=("machine", "material"),
    )
    return options, machine, material


def _from_mesh(path: Path, asked: FitOptions, title: str) -> Design:
    from miurafab.workflow.mesh_targets import mesh_in_file  # only now: few targets are meshes

    return _on_mesh(*mesh_in_file(path, asked), asked, title)


def _on_mesh(
    surface: MeshSurface | TubeSurface, description: dict[str, Any], asked: FitOptions, title: str
) -> Design:
    request = FitRequest(
        **vars(asked), surface=surface, target={**description, **surface.description}
    )
    return Design(request, title, findings=surface.findings)


def _on_array(target: Any, given: Values) -> Design:
    """Heights (rows, columns) or points (rows, columns, 3); a list of points is refused."""
    try:
        array = np.asarray(target, dtype=np.float64)
    except (TypeError, ValueError):
        raise TargetError("The target is an array that does not hold numbers alone.") from None
    if array.ndim == 2 and array.shape[1] == 3:
        raise TargetError(f"The target is a point cloud and not a surface; {FROM_POINTS}")
    if array.ndim == 3 and array.shape[2] == 3:
        asked, _ = _asked(given, (), "a grid of points")
        return _on_samples(from_points(array), (), asked, "points")
    if array.ndim != 2:
        raise TargetError(
            f"The target is an array of shape {array.shape}; heights have the shape (rows, "
            "columns), a grid of points (rows, columns, 3)."
        )
    asked, values = _asked(given, ("spacing",), "a height map")
    spacing = read_value("spacing", length(above=True), values.get("spacing", 1.0))
    return _on_heights(array, spacing, asked, "heights")


def _on_heights(heights: Any, spacing: float, asked: FitOptions, title: str) -> Design:
    return _on_samples(*from_heights(heights, spacing), asked, title)


def _on_samples(
    surface: SampledSurface, findings: tuple[Finding, ...], asked: FitOptions, title: str
) -> Design:
    _not_for(title, asked)
    _closed(surface, {}, title, asked)
    target = {"name": title, **surface.description}
    return Design(_request(surface, target, asked), title, findings=findings)


def _on_surface(name: str, parameters: Values, asked: FitOptions, title: str) -> Design:
    _not_for(name, asked)
    surface, values = _closed(*make_surface(name, parameters), name, asked)
    target: dict[str, Any] = {"surface": name, "parameters": values}
    findings: tuple[Finding, ...] = ()
    if isinstance(surface, SampledSurface):
        target |= described(surface.origin)
        findings = surface.findings
    return Design(_request(surface, target, asked), title, findings=findings)


def _request(surface: TargetSurface, target: dict[str, Any], asked: FitOptions) -> FitRequest:
    """The request for a surface that has no size of its own."""
    size = DEFAULT_SIZE_MM if asked.size_mm is None else asked.size_mm
    return FitRequest(**vars(replace(asked, size_mm=size)), surface=surface, target=target)


def _not_for(name: str, asked: FitOptions) -> None:
    given = {
        "region": asked.region,
        "rotate": asked.rotate,
        "poles": asked.poles,
        "polar_hole": asked.polar_hole_mm,
    }
    for option, value in given.items():
        if value is not None:
            raise OptionError(option, f"is for mesh targets, and '{name}' is none")


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
