"""Profile curves: the plane curves of cylinders and of surfaces of revolution.

A curve is a map from a parameter in [0, 1] to the plane, and is smooth a little beyond both ends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from miurafab.errors import TargetError
from miurafab.geometry.arrays import Floats


@dataclass(frozen=True)
class ProfileCurve:
    """A plane curve; ``position`` maps parameters (...) in [0, 1] to points (..., 2)."""

    position: Callable[[Floats], Floats]

    def evenly(self, count: int, start: float = 0.0, stop: float = 1.0) -> Floats:
        """``count`` points equally spaced by arc length from ``start`` to ``stop``, (count, 2)."""
        dense = np.linspace(start, stop, max(2000, 20 * count))
        points = self.position(dense)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        at = np.interp(np.linspace(0.0, along[-1], count), along, dense)
        return self.position(at)


def arc(radius: float, angle: float) -> ProfileCurve:
    """A circular arc, symmetric about the second axis and bulging towards it."""

    def position(t: Floats) -> Floats:
        phi = (t - 0.5) * angle
        return np.stack([radius * np.sin(phi), radius * (np.cos(phi) - 1.0)], axis=-1)

    return ProfileCurve(position)


def log_spiral(start: float, growth: float, turns: float) -> ProfileCurve:
    """r = start * exp(growth * phi) over ``turns`` turns, at constant speed."""
    swing = 2 * np.pi * turns
    rate = np.expm1(growth * swing)

    def position(t: Floats) -> Floats:
        phi = np.log1p(np.maximum(t * rate, -0.5)) / growth
        radius = start * np.exp(growth * phi)
        return np.stack([radius * np.cos(phi), radius * np.sin(phi)], axis=-1)

    return ProfileCurve(position)


def capped(radius: float, waist: float, reach: float, angle: float) -> ProfileCurve:
    """A straight waist (r, z) of length ``waist`` at ``radius``, bent at both ends by arcs.

    The arcs have the radius |``reach``| and turn through ``angle``: towards the axis for positive
    ``reach``, away from it for negative. The speed is constant.
    """
    half, bend = waist / 2, abs(reach) * angle

    def position(t: Floats) -> Floats:
        along = (2 * t - 1) * (half + bend)
        phi = np.maximum(np.abs(along) - half, 0.0) / abs(reach)
        r = radius - reach * (1 - np.cos(phi))
        z = np.minimum(np.abs(along), half) + abs(reach) * np.sin(phi)
        return np.stack([r, np.sign(along) * z], axis=-1)

    return ProfileCurve(position)


def vase(belly: float, neck: float, height: float) -> ProfileCurve:
    """A cosine wave (r, z) from below the ``belly`` over the ``neck`` to a small flare."""
    start, stop = -0.35 * np.pi, 1.25 * np.pi

    def position(t: Floats) -> Floats:
        r = (belly + neck) / 2 + (belly - neck) / 2 * np.cos(start + (stop - start) * t)
        return np.stack([r, height * t], axis=-1)

    return ProfileCurve(position)


def hyperbola(waist: float, spread: float, height: float) -> ProfileCurve:
    """r = waist sqrt(1 + (z / spread)^2) over ``height``."""

    def position(t: Floats) -> Floats:
        z = (t - 0.5) * height
        return np.stack([waist * np.hypot(1.0, z / spread), z], axis=-1)

    return ProfileCurve(position)


def catenary(waist: float, height: float) -> ProfileCurve:
    """r = waist cosh(z / waist) over ``height``, at constant speed."""
    end = np.sinh(height / 2 / waist)

    def position(t: Floats) -> Floats:
        along = (2 * t - 1) * end
        return waist * np.stack([np.hypot(1.0, along), np.arcsinh(along)], axis=-1)

    return ProfileCurve(position)


def ellipse(radius: float, height: float, latitude: float) -> ProfileCurve:
    """The ellipse (r, z) of half axes ``radius`` and ``height`` up to +-``latitude``."""

    def position(t: Floats) -> Floats:
        phi = (2 * t - 1) * latitude
        return np.stack([radius * np.cos(phi), height * np.sin(phi)], axis=-1)

    return ProfileCurve(position)


def spline(points: Sequence[Sequence[float]]) -> ProfileCurve:
    """The cubic spline through ``points`` (n, 2), parameterised by chord length.

    Raises :class:`~miurafab.errors.TargetError` for fewer than two points, or two equal ones.
    """
    try:
        given = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise TargetError("A profile must be a list of [x, y] points.") from None
    if given.ndim != 2 or given.shape[1] != 2 or len(given) < 2:
        raise TargetError("A profile must be a list of two or more [x, y] points.")
    if not np.isfinite(given).all():
        raise TargetError("A profile point is not a finite number.")
    chords = np.linalg.norm(np.diff(given, axis=0), axis=1)
    if (chords == 0).any():
        where = int(np.argmin(chords))
        raise TargetError(f"The profile points {where} and {where + 1} are the same point.")
    along = np.concatenate([[0.0], np.cumsum(chords)]) / chords.sum()
    if not (np.diff(along) > 0).all():
        raise TargetError("The points of the profile are too far apart, or too near each other.")
    from scipy.interpolate import CubicSpline

    through = CubicSpline(along, given)

    def position(t: Floats) -> Floats:
        return np.asarray(through(t))

    return ProfileCurve(position)
