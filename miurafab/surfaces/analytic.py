"""The analytic surfaces, one formula each over a parameter rectangle.

Lengths are in the target's own unit; a fit scales them. Rows run along u. If there is a choice, u
is the direction in which the surface bends less (the fit may exchange u and v).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from miurafab.geometry.arrays import Floats
from miurafab.surfaces.curves import ProfileCurve
from miurafab.surfaces.surface import Domain, ParametricSurface


@dataclass(frozen=True)
class GeneralizedCylinder(ParametricSurface):
    """A profile curve extruded along x. A fit to it needs no solver."""

    profile: ProfileCurve = field(kw_only=True)

    @property
    def closed(self) -> bool:
        """Whether the two ends of the profile meet, so that the surface is a tube."""
        curve = self.profile.position(np.linspace(0.0, 1.0, 9))
        gap, size = np.linalg.norm(curve[-1] - curve[0]), np.linalg.norm(np.ptp(curve, axis=0))
        return bool(gap <= 1e-12 * size)


def cylinder_over(profile: ProfileCurve, length: float) -> GeneralizedCylinder:
    """``profile`` in the (y, z) plane, extruded over ``length`` along x."""

    def position(u: Floats, v: Floats) -> Floats:
        curve = profile.position(v)
        return np.concatenate([np.broadcast_to(u[..., None], (*v.shape, 1)), curve], axis=-1)

    domain = Domain(-length / 2, length / 2, 0.0, 1.0)
    return GeneralizedCylinder(position, domain, profile=profile)


def plane(width: float, depth: float) -> ParametricSurface:
    """A flat rectangle in z = 0."""
    return _graph(width, depth, lambda x, y: np.zeros_like(x))


def hyperbolic_paraboloid(width: float, depth: float, height: float) -> ParametricSurface:
    """z = height * (2x/width) (2y/depth): the ruled form, the corners at +-height."""
    return _graph(width, depth, lambda x, y: height * (2 * x / width) * (2 * y / depth))


def saddle(width: float, depth: float, height: float) -> ParametricSurface:
    """z = height * ((2x/width)^2 - (2y/depth)^2)."""
    return _graph(width, depth, lambda x, y: height * ((2 * x / width) ** 2 - (2 * y / depth) ** 2))


def paraboloid(width: float, depth: float, height: float) -> ParametricSurface:
    """z = -height * ((2x/width)^2 + (2y/depth)^2): a bowl upside down."""
    return _graph(
        width, depth, lambda x, y: -height * ((2 * x / width) ** 2 + (2 * y / depth) ** 2)
    )


def bump(width: float, depth: float, height: float, spread: float) -> ParametricSurface:
    """A Gaussian bump z = height * exp(-(x^2 + y^2) / spread^2)."""
    return _graph(width, depth, lambda x, y: height * np.exp(-(x**2 + y**2) / spread**2))


def sphere_patch(radius: float, width: float, height: float) -> ParametricSurface:
    """The patch of ``width`` radians of longitude by ``height`` of latitude about the +z axis."""

    def position(u: Floats, v: Floats) -> Floats:
        x = np.cos(v) * np.sin(u)
        return radius * np.stack([x, np.sin(v), np.cos(v) * np.cos(u)], axis=-1)

    return ParametricSurface(position, Domain(-width / 2, width / 2, -height / 2, height / 2))


def helicoid(radius: float, inner: float, pitch: float, turns: float) -> ParametricSurface:
    """(r cos t, r sin t, pitch t / 2 pi), r from ``inner`` to ``radius`` along u."""
    swing = 2 * np.pi * turns

    def position(u: Floats, v: Floats) -> Floats:
        return np.stack([u * np.cos(v), u * np.sin(v), pitch * v / (2 * np.pi)], axis=-1)

    return ParametricSurface(position, Domain(inner, radius, -swing / 2, swing / 2))


@dataclass(frozen=True)
class Revolution(ParametricSurface):
    """``profile`` (r, z) turned through ``angle`` about z. One period of a fit gives the sheet."""

    profile: ProfileCurve = field(kw_only=True)

    @property
    def angle(self) -> float:
        """The angle turned through, radians."""
        return self.domain.height

    @property
    def closed(self) -> bool:
        """Whether the two ends meet."""
        return bool(self.angle > 2 * np.pi * (1 - 1e-12))


def revolution(profile: ProfileCurve, angle: float) -> Revolution:
    """``profile`` (r, z) turned through ``angle`` about z; rows run along the profile."""

    def position(u: Floats, v: Floats) -> Floats:
        curve = profile.position(u)
        r, z = curve[..., 0], curve[..., 1]
        return np.stack([r * np.cos(v), r * np.sin(v), z], axis=-1)

    return Revolution(position, Domain(0.0, 1.0, -angle / 2, angle / 2), profile=profile)


def _graph(width: float, depth: float, z: Callable[[Floats, Floats], Floats]) -> ParametricSurface:
    def position(u: Floats, v: Floats) -> Floats:
        return np.stack([u, v, z(u, v)], axis=-1)

    return ParametricSurface(position, Domain(-width / 2, width / 2, -depth / 2, depth / 2))
