"""A folding motion as an animated GIF, drawn facet by facet from the back to the front.

The sheet is seen from one fixed direction in parallel projection. Facets are sorted by the depth of
their middle and painted over each other (the painter's algorithm), shaded by two lights, on a
canvas twice as large that is then averaged down. All frames share one palette.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from miurafab.origami.folding.kinematics import FoldingMotion

Floats = NDArray[np.float64]

WIDTH, HEIGHT = 640, 480
_FINE = 2  # canvas pixels for one pixel of the picture, along each axis
_YAW, _PITCH = -0.6, 0.62
_MARGIN, _BAR = 26, 4
_PAGE, _RULE, _DONE, _MARK = (244, 245, 247), (213, 218, 224), (11, 107, 203), (29, 35, 41)
_FRONT, _BACK = np.array([242.0, 230.0, 207.0]), np.array([157.0, 181.0, 161.0])
_KEY, _FILL = np.array([-0.45, 0.6, 0.66]), np.array([0.7, -0.15, 0.5])
_MILLISECONDS, _HOLD = 60, 700

# Control points of a ramp from blue over pale to red, dark at neither end, for strains.
_RAMP = np.array([[69, 117, 180], [171, 217, 233], [255, 255, 191], [253, 174, 97], [215, 48, 39]])


def write_gif(
    path: Path,
    motion: FoldingMotion,
    strain: Floats | None = None,
    on_progress: Callable[[float, str], None] | None = None,
) -> None:
    """Write ``motion`` to ``path``: there and back, with a rest at either end and at the target.

    Facets are coloured by side, or by ``strain`` (T, F), from blue for none to red for the most.
    """
    images = []
    for frame in range(len(motion.frames)):
        images.append(picture(motion, frame, strain))
        if on_progress is not None:
            on_progress((frame + 1) / len(motion.frames), f"frame {frame + 1}")
    palette = _palette(images)
    shown = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    count = len(shown)
    durations = [_MILLISECONDS] * count
    for rest in {0, count - 1, target_frame(motion)}:
        durations[rest] = _HOLD
    order = [*range(count), *range(count - 2, 0, -1)]
    shown[0].save(
        path,
        save_all=True,
        append_images=[shown[frame] for frame in order[1:]],
        duration=[durations[frame] for frame in order],
        loop=0,
        optimize=False,
    )


def picture(motion: FoldingMotion, frame: int, strain: Floats | None = None) -> Image.Image:
    """One ``frame`` of ``motion`` as a picture of :data:`WIDTH` x :data:`HEIGHT` pixels."""
    right, up, out = _axes()
    centre, scale = _camera(motion)
    points = motion.frames[frame]
    faces = motion.pattern.faces_vertices
    whole = np.where(faces >= 0, faces, faces[:, :1])
    corners = points[whole]
    spokes = corners - corners[:, :1]
    normal = np.cross(spokes, np.roll(spokes, -1, axis=1)).sum(axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    front = normal @ out > 0
    facing = np.where(front[:, None], normal, -normal) @ np.stack([right, up, out], axis=1)
    key = np.maximum(facing @ (_KEY / np.linalg.norm(_KEY)), 0.0)
    fill = np.maximum(facing @ (_FILL / np.linalg.norm(_FILL)), 0.0)
    shade = 0.5 + 0.42 * key + 0.14 * fill
    base = np.where(front[:, None], _FRONT, _BACK) if strain is None else _ramp(strain, frame)
    if strain is not None:
        shade = 0.8 + 0.2 * key  # colours that mean a number stay near what they are
    fills = np.clip(base * shade[:, None], 0, 255).astype(np.uint8)
    lines = np.clip(base * (shade - 0.28)[:, None], 0, 255).astype(np.uint8)
    flat = np.stack([(points - centre) @ right, -((points - centre) @ up)], axis=1) * scale
    flat = (flat + np.array([WIDTH / 2, (HEIGHT - _BAR) / 2])) * _FINE
    image = Image.new("RGB", (WIDTH * _FINE, HEIGHT * _FINE), _PAGE)
    draw = ImageDraw.Draw(image)
    order = np.argsort((corners.mean(axis=1) @ out), kind="stable")
    places = flat[whole]
    for polygon, colour, line in zip(
        places[order].reshape(len(order), -1).tolist(),
        map(tuple, fills[order].tolist()),
        map(tuple, lines[order].tolist()),
        strict=True,
    ):
        draw.polygon(polygon, fill=colour, outline=line)
    _bar(draw, motion, frame)
    return image.resize((WIDTH, HEIGHT), Image.Resampling.BOX)


def target_frame(motion: FoldingMotion) -> int:
    """The frame nearest to the folded form."""
    return int(np.argmin(np.abs(np.where(np.isfinite(motion.states), motion.states, 1e9) - 1.0)))


def _axes() -> tuple[Floats, Floats, Floats]:
    """The screen's right, up and out of it, in space; z is up in space."""
    cy, sy, cp, sp = math.cos(_YAW), math.sin(_YAW), math.cos(_PITCH), math.sin(_PITCH)
    return (
        np.array([cy, sy, 0.0]),
        np.array([-sy * sp, cy * sp, cp]),
        np.array([sy * cp, -cy * cp, sp]),
    )


def _camera(motion: FoldingMotion) -> tuple[Floats, float]:
    """The middle of what is seen and the pixels a millimetre at which all frames fit."""
    right, up, _ = _axes()
    across, upward = motion.frames @ right, motion.frames @ up
    spans = np.ptp(across), np.ptp(upward)
    scale = min((WIDTH - 2 * _MARGIN) / spans[0], (HEIGHT - 2 * _MARGIN - 6 * _BAR) / spans[1])
    middle = (across.max() + across.min()) / 2 * right + (upward.max() + upward.min()) / 2 * up
    return middle, float(scale)


def _ramp(strain: Floats, frame: int) -> Floats:
    """(F, 3) colours of the strains of one frame, red being the most of all frames."""
    most = float(strain.max())
    at = strain[frame] / most * (len(_RAMP) - 1) if most > 0 else np.zeros(strain.shape[1])
    steps = np.arange(len(_RAMP))
    return np.stack([np.interp(at, steps, _RAMP[:, c]) for c in range(3)], axis=1)


def _bar(draw: ImageDraw.ImageDraw, motion: FoldingMotion, frame: int) -> None:
    """How far the motion has come, with a mark where the folded form is."""
    last = max(len(motion.frames) - 1, 1)
    left, right = _MARGIN * _FINE, (WIDTH - _MARGIN) * _FINE
    top = (HEIGHT - _MARGIN) * _FINE
    low = top + _BAR * _FINE
    draw.rounded_rectangle((left, top, right, low), radius=_BAR, fill=_RULE)
    at = left + (right - left) * frame / last
    draw.rounded_rectangle((left, top, max(at, left + 2 * _BAR), low), radius=_BAR, fill=_DONE)
    mark = left + (right - left) * target_frame(motion) / last
    draw.rectangle((mark - 2, top - 2 * _BAR, mark + 2, low + 2 * _BAR), fill=_MARK)


def _palette(images: list[Image.Image]) -> Image.Image:
    """One palette of 256 colours for all ``images``, from an even sample of them."""
    sample = images[:: max(1, len(images) // 8)]
    strip = Image.new("RGB", (WIDTH // 2, HEIGHT // 2 * len(sample)))
    for row, image in enumerate(sample):
        half = image.resize((WIDTH // 2, HEIGHT // 2), Image.Resampling.NEAREST)
        strip.paste(half, (0, row * HEIGHT // 2))
    return strip.quantize(colors=256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
