"""The named targets with their parameters, ranges and defaults.

``hypar:height=0.5`` and the ``[target]`` table of a design file both use this catalogue.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from miurafab.errors import TargetError
from miurafab.options import Quantity, angle, number
from miurafab.surfaces import analytic, curves
from miurafab.surfaces.formula import DEFAULT, computed, formula_surface
from miurafab.surfaces.surface import TargetSurface


@dataclass(frozen=True)
class SurfaceParameter:
    """One parameter of a named surface.

    ``kind`` says how it is written; ``default`` is as written, angles in degrees and lengths in the
    target's own unit.
    """

    kind: Quantity
    default: float
    meaning: str

    @property
    def default_text(self) -> str:
        """The default with its unit, as in ``hypar:height=0.5``."""
        return f"{self.default:g}{self.kind.unit.strip()}"


@dataclass(frozen=True)
class NamedSurface:
    """One entry of the catalogue. ``profile_axes`` names the axes of the curve that a design file
    may give it, or is None where the surface takes none. ``formulas`` are the names of the formulas
    that it takes, each with its meaning.
    """

    name: str
    summary: str
    parameters: Mapping[str, SurfaceParameter]
    make: Callable[..., TargetSurface]
    profile_axes: str | None = None
    formulas: Mapping[str, str] = field(default_factory=dict)

    @property
    def keys(self) -> tuple[str, ...]:
        """The names of all that may be given."""
        profile = () if self.profile_axes is None else ("profile",)
        return (*self.formulas, *self.parameters, *profile)


def _length(default: float, meaning: str, low: float = 1e-6) -> SurfaceParameter:
    return SurfaceParameter(number(low, 1e6), default, meaning)


def _angle(default: float, meaning: str, high: float) -> SurfaceParameter:
    return SurfaceParameter(angle(0.1, high), default, meaning)


def _signed(default: float, meaning: str) -> SurfaceParameter:
    return SurfaceParameter(number(-1e6, 1e6), default, meaning)


def _end(default: float, meaning: str) -> SurfaceParameter:
    kind = Quantity(computed, "a number or a formula such as 2*pi", low=-1e6, high=1e6)
    return SurfaceParameter(kind, default, meaning)


_TURN = {"angle": _angle(120, "angle turned through", 360)}
_SIDES = {"width": _length(2.0, "side along x"), "depth": _length(2.0, "side along y")}
_VASE = ((0.55, 0.0), (0.8, 0.5), (0.72, 1.1), (0.5, 1.6), (0.58, 2.0))


def _arc_cylinder(radius: float, angle: float, length: float, profile: Any = None) -> TargetSurface:
    curve = curves.arc(radius, angle) if profile is None else curves.spline(profile)
    return analytic.cylinder_over(curve, length)


def _log_spiral(start: float, growth: float, turns: float, length: float) -> TargetSurface:
    return analytic.cylinder_over(curves.log_spiral(start, growth, turns), length)


def _formula(u0: float, u1: float, v0: float, v1: float, **formulas: str) -> TargetSurface:
    return formula_surface((u0, u1, v0, v1), **formulas)


def _turned(name: str, profile: curves.ProfileCurve, angle: float) -> TargetSurface:
    least = float(profile.evenly(400)[:, 0].min())
    if least <= 0:
        raise TargetError(
            f"The profile of '{name}' reaches r = {least:.3g}; it must keep off its axis (r > 0)."
        )
    return analytic.revolution(profile, angle)


def _revolution(angle: float, profile: Any = None) -> TargetSurface:
    return _turned("revolution", curves.spline(_VASE if profile is None else profile), angle)


def _revolving(
    name: str, curve: Callable[..., curves.ProfileCurve]
) -> Callable[..., TargetSurface]:
    """How to make the revolution of a ``curve``, which takes all parameters but ``angle``."""

    def make(angle: float, **shape: float) -> TargetSurface:
        return _turned(name, curve(**shape), angle)

    return make


_ENTRIES = (
    NamedSurface("plane", "a flat rectangle: the regular Miura-ori", _SIDES, analytic.plane),
    NamedSurface(
        "cylinder",
        "a profile curve extruded; by default a circular arc",
        {
            "radius": _length(1.0, "radius of the arc"),
            "angle": _angle(120, "angle of the arc", 360),
            "length": _length(1.5, "length of the extrusion"),
        },
        _arc_cylinder,
        "y, z",
    ),
    NamedSurface(
        "log-spiral",
        "a logarithmic spiral extruded",
        {
            "start": _length(0.25, "radius at the inner end"),
            "growth": SurfaceParameter(number(1e-3, 2), 0.18, "r grows by exp(growth) a radian"),
            "turns": SurfaceParameter(number(0.05, 10), 1.25, "number of turns"),
            "length": _length(1.5, "length of the extrusion"),
        },
        _log_spiral,
    ),
    NamedSurface(
        "sphere",
        "a patch of longitude by latitude of a sphere",
        {
            "radius": _length(1.0, "radius of the sphere"),
            "width": _angle(80, "longitude covered", 350),
            "height": _angle(80, "latitude covered", 170),
        },
        analytic.sphere_patch,
    ),
    NamedSurface(
        "hypar",
        "a hyperbolic paraboloid z = height x y, ruled along x and y",
        {**_SIDES, "height": _signed(0.5, "height of the corners over the centre")},
        analytic.hyperbolic_paraboloid,
    ),
    NamedSurface(
        "saddle",
        "a hyperbolic paraboloid z = height (x^2 - y^2)",
        {**_SIDES, "height": _signed(0.4, "height of the middles of the sides")},
        analytic.saddle,
    ),
    NamedSurface(
        "paraboloid",
        "a bowl z = -height (x^2 + y^2)",
        {**_SIDES, "height": _signed(0.3, "drop at the middles of the sides")},
        analytic.paraboloid,
    ),
    NamedSurface(
        "bump",
        "a Gaussian bump on a plane",
        {
            **_SIDES,
            "height": _signed(0.4, "height of the bump"),
            "spread": _length(0.7, "radius at which it falls to 1/e"),
        },
        analytic.bump,
    ),
    NamedSurface(
        "helicoid",
        "a spiral ramp",
        {
            "radius": _length(1.0, "outer radius"),
            "inner": _signed(-1.0, "inner radius; negative reaches across the axis"),
            "pitch": _length(3.0, "rise in one turn"),
            "turns": SurfaceParameter(number(0.02, 20), 0.5, "number of turns"),
        },
        analytic.helicoid,
    ),
    NamedSurface(
        "pill",
        "a cylindrical waist with spherical caps, turned about z",
        {
            "radius": _length(1.0, "radius of waist and caps"),
            "waist": _length(1.2, "length of the waist"),
            "caps": _angle(60, "latitude that each cap reaches", 85),
            **_TURN,
        },
        _revolving("pill", lambda radius, waist, caps: curves.capped(radius, waist, radius, caps)),
    ),
    NamedSurface(
        "candlestick",
        "a cylindrical waist with flaring ends of negative curvature, turned about z",
        {
            "radius": _length(0.6, "radius of the waist"),
            "waist": _length(1.0, "length of the waist"),
            "flare": _length(0.8, "radius of the arcs of the ends"),
            "caps": _angle(60, "angle through which each end bends outwards", 85),
            **_TURN,
        },
        _revolving(
            "candlestick",
            lambda radius, waist, flare, caps: curves.capped(radius, waist, -flare, caps),
        ),
    ),
    NamedSurface(
        "vase",
        "a belly of positive and a neck of negative curvature, turned about z",
        {
            "belly": _length(0.9, "largest radius"),
            "neck": _length(0.5, "smallest radius"),
            "height": _length(2.2, "height"),
            **_TURN,
        },
        _revolving("vase", curves.vase),
    ),
    NamedSurface(
        "hyperboloid",
        "a hyperboloid of one sheet about z",
        {
            "waist": _length(0.7, "radius at the waist"),
            "spread": _length(0.9, "height over the waist at which r is 1.41 times the waist"),
            "height": _length(2.0, "height"),
            **_TURN,
        },
        _revolving("hyperboloid", curves.hyperbola),
    ),
    NamedSurface(
        "catenoid",
        "the minimal surface of revolution, about z",
        {"waist": _length(0.8, "radius at the waist"), "height": _length(1.6, "height"), **_TURN},
        _revolving("catenoid", curves.catenary),
    ),
    NamedSurface(
        "ellipsoid",
        "an ellipsoid of revolution between two latitudes, about z",
        {
            "radius": _length(1.0, "half axis across z"),
            "height": _length(1.0, "half axis along z; equal to the radius for a sphere"),
            "latitude": _angle(60, "parametric latitude reached on both sides", 85),
            **_TURN,
        },
        _revolving("ellipsoid", curves.ellipse),
    ),
    NamedSurface(
        "revolution",
        "a profile curve turned about the z axis; by default a vase",
        _TURN,
        _revolution,
        "r, z",
    ),
    NamedSurface(
        "formula",
        f"a formula: z of x and y, or x, y and z of u and v; by default z={DEFAULT}",
        {
            "u0": _end(-1.0, "start of u, or of x"),
            "u1": _end(1.0, "end of u, or of x"),
            "v0": _end(-1.0, "start of v, or of y"),
            "v1": _end(1.0, "end of v, or of y"),
        },
        _formula,
        formulas={
            "z": "height over x and y, such as 0.4*(x^2-y^2); with x and y, of u and v",
            "x": "of u and v, such as cos(u); empty for a height",
            "y": "of u and v, such as sin(u); empty for a height",
        },
    ),
)

CATALOGUE: Mapping[str, NamedSurface] = {entry.name: entry for entry in _ENTRIES}


def make_surface(name: str, given: Mapping[str, Any]) -> tuple[TargetSurface, dict[str, Any]]:
    """The named surface and its complete parameters as written, angles in degrees.

    ``given`` maps parameter names to numbers or texts with a unit, a bare angle in degrees;
    ``profile`` is a list of points, or the path of a file of them. What is left out has its
    default. Raises :class:`~miurafab.errors.TargetError` naming the surface or parameter and what
    is accepted.
    """
    entry = CATALOGUE.get(name)
    if entry is None:
        near = difflib.get_close_matches(name, CATALOGUE, n=1)
        hint = f"did you mean '{near[0]}'" if near else f"there are {', '.join(CATALOGUE)}"
        raise TargetError(f"'{name}' is not a known surface; {hint}, or give a .toml or mesh file.")
    written: dict[str, Any] = {key: p.default for key, p in entry.parameters.items()}
    for key, text in given.items():
        if key == "profile" and entry.profile_axes is not None:
            from miurafab.surfaces.profile_files import read_profile

            written["profile"] = read_profile(Path(text)) if isinstance(text, str) else text
            continue
        if key in entry.formulas:
            written[key] = str(text)
            continue
        if key not in entry.parameters:
            known = ", ".join(entry.keys)
            raise TargetError(f"The surface '{name}' has no parameter '{key}'; it has {known}.")
        kind = entry.parameters[key].kind
        try:
            # Rounded, so that a pattern file holds 80 and not 80.00000000000001 degrees.
            written[key] = round(kind.read(text) / kind.factor, 12)
        except ValueError as fault:
            raise TargetError(f"The parameter '{key}' of '{name}' {fault}.") from None
    if entry.formulas and not entry.formulas.keys() & written.keys():
        written["z"] = DEFAULT
    inside = {key: written[key] * p.kind.factor for key, p in entry.parameters.items()}
    surface = entry.make(**written | inside)
    if name == "helicoid" and written["inner"] >= written["radius"]:
        raise TargetError("The helicoid's 'inner' must be smaller than its 'radius'.")
    return surface, written


def parse_target(text: str) -> tuple[str, dict[str, str]]:
    """``name:key=value,key=value`` as a name and its parameters. Raises ``TargetError``."""
    name, _, rest = text.partition(":")
    parameters = {}
    for part in filter(None, _parted(rest)):
        key, equals, value = part.partition("=")
        if not equals or not value.strip():
            raise TargetError(f"'{part}' in '{text}' is not of the form parameter=value.")
        parameters[key.strip()] = value.strip()
    return name.strip(), parameters


def _parted(text: str) -> list[str]:
    """``text`` parted at the commas that stand in no brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter == "(") - (letter == ")")
        if letter == "," and depth <= 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts
