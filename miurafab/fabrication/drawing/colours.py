"""The colours of patches, the same in every drawing.

In OKLCH (Ottosson 2020, "A perceptual color space for image processing"), their hues are spaced by
the golden section, so that neighbouring numbers differ, and their lightness is nearly equal.
"""

from __future__ import annotations

import math

RGB = tuple[float, float, float]
"""Red, green and blue of sRGB, from 0 to 1."""

_GOLDEN = 0.61803398875


def patch_colour(number: int, strength: float = 1.0) -> RGB:
    """The colour of patch ``number``; a ``strength`` below 1 is closer to white."""
    hue = 2 * math.pi * ((0.12 + number * _GOLDEN) % 1.0)
    lightness = 1.0 - strength * (0.17 + 0.03 * (number % 3))
    return _srgb(lightness, 0.095 * strength, hue)


def hex_of(colour: RGB) -> str:
    """``#rrggbb``."""
    return "#" + "".join(f"{round(255 * part):02x}" for part in colour)


def _srgb(lightness: float, chroma: float, hue: float) -> RGB:
    a, b = chroma * math.cos(hue), chroma * math.sin(hue)
    long = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3
    middle = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3
    short = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3
    return (
        _transferred(4.0767416621 * long - 3.3077115913 * middle + 0.2309699292 * short),
        _transferred(-1.2684380046 * long + 2.6097574011 * middle - 0.3413193965 * short),
        _transferred(-0.0041960863 * long - 0.7034186147 * middle + 1.7076147010 * short),
    )


def _transferred(linear: float) -> float:
    """A linear part of light as sRGB codes it (IEC 61966-2-1); no colour of a patch is so dark that
    the code is a multiple of the light.
    """
    return min(1.055 * math.pow(linear, 1 / 2.4) - 0.055, 1.0)
