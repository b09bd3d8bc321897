"""Targets given by heights on a grid: a 2-D array, or an image whose grey values are heights.

The heights are smoothed as far as they ask for it (:mod:`~miurafab.surfaces.smoothing`), and the
spline is sampled on a grid that a pattern file can hold. The distance between the heights and that
surface is measured and told.
"""

from __future__ import annotations

import io
import math
import struct
import warnings
from pathlib import Path

import numpy as np

from miurafab.errors import TargetError
from miurafab.files import read_bytes
from miurafab.findings import Finding
from miurafab.geometry.arrays import Floats
from miurafab.surfaces.function import SampledSurface, sample
from miurafab.surfaces.surface import Domain

IMAGE_SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".bmp")

MOST_PIXELS = 40_000_000
"""An image may have so many: 320 MB of heights."""
_MOST = 256
"""Heights to a side beyond which blocks of them are averaged before they are smoothed."""
_SPANS = 40
_TOLD = 1e-3
"""A distance between heights and surface is told from this part of the diagonal on."""
_WHITE_8, _WHITE_16 = 255.0, 65535.0


def from_heights(
    heights: Floats, spacing: float = 1.0
) -> tuple[SampledSurface, tuple[Finding, ...]]:
    """The target z = ``heights[row, column]`` over x = column * spacing, y = row * spacing.

    Parameters
    ----------
    heights : (rows, columns) float64
        Heights in the unit of ``spacing``, at least 4 x 4.
    spacing : float
        The distance between neighbours.

    Returns
    -------
    SampledSurface, tuple of Finding

    Raises
    ------
    TargetError
        For fewer heights, for one that is not finite, and for a spacing that is not positive.
    """
    heights = np.asarray(heights, dtype=np.float64)
    rows, columns = heights.shape
    if min(rows, columns) < 4:
        raise TargetError(
            f"A height map of {columns} x {rows} values is too coarse; give 4 x 4 or more."
        )
    if not np.isfinite(heights).all():
        row, column = np.argwhere(~np.isfinite(heights))[0].tolist()
        raise TargetError(
            f"The height in row {row}, column {column} is not a finite number; fill the gap or "
            "leave that part of the map out."
        )
    if not 0 < spacing < math.inf:
        raise TargetError(f"The spacing is {spacing:g}; it must be greater than 0.")
    steps = math.ceil(rows / _MOST), math.ceil(columns / _MOST)
    coarse = _averaged(heights, *steps)
    y, x = (
        spacing * (step * np.arange(n) + (step - 1) / 2)
        for step, n in zip(steps, coarse.shape, strict=True)
    )
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    domain = Domain(float(x[0]), float(x[-1]), float(y[0]), float(y[-1]))
    points = np.concatenate([places, coarse.reshape(-1, 1)], axis=1)
    spans = tuple(min(max(n // 2, 4), _SPANS) for n in coarse.shape[::-1])
    from miurafab.surfaces.smoothing import smooth

    spline = smooth(places, points, domain, (spans[0], spans[1])).spline
    surface, _ = sample(
        lambda uv: np.concatenate([uv, spline(uv)[..., 2:]], axis=-1), domain, domain
    )
    heights_there = surface.point(places)[:, 2] + surface.origin[2]
    miss = float(np.abs(heights_there - points[:, 2]).max())
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if miss <= _TOLD * size:
        return surface, ()
    return surface, (
        Finding(
            "smoothed",
            f"The height map was smoothed: the surface that is fitted and checked leaves its "
            f"heights by up to {miss:.3g}, which is {100 * miss / size:.2g} % of its size.",
        ),
    )


_IMAGE_FAULTS = (OSError, ValueError, SyntaxError, EOFError, LookupError, TypeError, struct.error)
"""What Pillow raises on damaged images; a broken PNG is a ``SyntaxError``."""


def read_image(path: Path, height: float | None = None) -> Floats:
    """The grey values of an image as heights, its lowest row of pixels first.

    Parameters
    ----------
    path : Path
        A file that Pillow reads. Colours count as their luminance.
    height : float, optional
        How high white is above black. An image of floating-point numbers (mode F) holds the
        heights themselves and takes no ``height``.

    Raises
    ------
    TargetError
        For a file that is no image, and for a ``height`` that is missing or of no use.
    """
    from PIL import Image

    content = read_bytes(path, TargetError)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # its limit is higher
            image = Image.open(io.BytesIO(content))
        with image:
            if image.width * image.height > MOST_PIXELS:
                raise TargetError(
                    f"{path} is an image of {image.width} x {image.height} pixels; scale it to "
                    f"{MOST_PIXELS:,} pixels or fewer."
                )
            mode = image.mode
            shades = np.asarray(image if mode[0] in "IF" else image.convert("L"), dtype=np.float64)
    except (*_IMAGE_FAULTS, Image.DecompressionBombError) as fault:
        reason = " ".join(str(fault).split()).rstrip(".")
        raise TargetError(f"{path} cannot be read as an image: {reason}.") from None
    upright = shades[::-1]
    if mode == "F":
        if height is not None:
            raise TargetError(f"{path} holds heights and not shades; leave 'height' out.")
        return upright
    if height is None:
        raise TargetError(
            f"{path} is an image; say how high white is above black, in the unit of 'spacing' (the "
            "distance between pixels, 1 unless given), such as height=20."
        )
    return upright * (height / (_WHITE_16 if mode[0] == "I" else _WHITE_8))


def pixels_in(path: Path) -> int:
    """How many pixels an image has, as its file says; 0 for a file that is no image."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            return image.width * image.height
    except (*_IMAGE_FAULTS, Image.DecompressionBombError):
        return 0


def _averaged(heights: Floats, down: int, across: int) -> Floats:
    """The means of blocks of ``down`` x ``across``; a rest at the far edges is left out."""
    rows, columns = heights.shape[0] // down, heights.shape[1] // across
    blocks = heights[: rows * down, : columns * across].reshape(rows, down, columns, across)
    means: Floats = blocks.mean(axis=(1, 3))
    return means
