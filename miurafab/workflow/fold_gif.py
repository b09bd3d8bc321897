"""A folding motion as an animated GIF, drawn facet by facet from the back to the front.

The sheet is seen from one fixed direction (:func:`~miurafab.origami.picture.project`) and drawn on
a canvas twice as large, which is then averaged down. All frames share one palette.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from miurafab.files import write_bytes
from miurafab.geometry.arrays import Floats, Ints
from miurafab.origami.folding.judge_motion import target_frame
from miurafab.origami.folding.kinematics import FoldingMotion
from miurafab.origami.folding.layers_apart import CLOSED, split_facets
from miurafab.origami.picture import BACK, FRONT, axes, project

WIDTH, HEIGHT = 640, 480
_FINE = 2  # canvas pixels for one pixel of the picture, along each axis
_AZIMUTH, _ELEVATION = -0.6 - math.pi / 2, 0.62
_MARGIN, _BAR = 26, 4
_PAGE, _RULE, _DONE, _MARK = (244, 245, 247), (213, 218, 224), (11, 107, 203), (29, 35, 41)
_MILLISECONDS, _HOLD = 60, 700
_PARTING = 9  # pictures in which the layers part

# Control points of a ramp from blue over pale to red, dark at neither end, for strains.
_RAMP = np.array([[69, 117, 180], [171, 217, 233], [255, 255, 191], [253, 174, 97], [215, 48, 39]])


def write_gif(
    path: Path,
    motion: FoldingMotion,
    strain: Floats | None = None,
    on_progress: Callable[[float, str], None] | None = None,
    shifts: Floats | None = None,
) -> None:
    """Write ``motion`` to ``path``: there and back, with a rest at either end and at the target.

    Facets are coloured by side, or by ``strain`` (T, F), from blue for none to red for the most.
    With ``shifts`` (F, 3) the layers of the last frame then part by so much, mm.
    """
    images = []
    parts = [CLOSED] if shifts is None else [CLOSED, *np.linspace(0.0, 1.0, _PARTING)[1:].tolist()]
    last = len(motion.frames) - 1
    steps = [(frame, 0.0) for frame in range(last)] + [(last, part) for part in parts]
    for count, (frame, part) in enumerate(steps, start=1):
        images.append(picture(motion, frame, strain, shifts, part))
        if on_progress is not None:
            on_progress(count / len(steps), f"frame {count}")
    palette = _palette(images)
    shown = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    count = len(shown)
    durations = [_MILLISECONDS] * count
    for rest in {0, last, count - 1, target_frame(motion)}:
        durations[rest] = _HOLD
    order = [*range(count), *range(count - 2, 0, -1)]
    content = io.BytesIO()
    shown[0].save(
        content,
        format="GIF",
        save_all=True,
        append_images=[shown[frame] for frame in order[1:]],
        duration=[durations[frame] for frame in order],
        loop=0,
        optimize=False,
    )
    write_bytes(path, content.getvalue())


def picture(
    motion: FoldingMotion,
    frame: int,
    strain: Floats | None = None,
    shifts: Floats | None = None,
    part: float = 0.0,
) -> Image.Image:
    """One ``frame`` of ``motion`` as a picture of :data:`WIDTH` x :data:`HEIGHT` pixels, with
    ``part`` of the ``shifts`` (F, 3) of its layers.
    """
    centre, scale = _camera(motion, shifts)
    points, faces = motion.frames[frame], motion.pattern.faces_vertices
    if shifts is not None and part > 0:
        points, faces = _apart(points, faces, part * shifts)
    view = project(points, faces, _AZIMUTH, _ELEVATION)
    if strain is None:
        base, shade = np.where(view.front[:, None], FRONT, BACK), view.shade
    else:  # colours that mean a number stay near what they are
        base, shade = _ramp(strain, frame), 0.8 + 0.2 * view.key
    colours = np.clip(base * shade[:, None], 0, 255).astype(np.uint8)
    lines = np.clip(base * (shade - 0.28)[:, None], 0, 255).astype(np.uint8)
    flat = (view.places - centre) * [scale, -scale]
    flat = (flat + np.array([WIDTH / 2, (HEIGHT - _BAR) / 2])) * _FINE
    image = Image.new("RGB", (WIDTH * _FINE, HEIGHT * _FINE), _PAGE)
    draw = ImageDraw.Draw(image)
    places = flat[np.where(faces >= 0, faces, faces[:, :1])]
    for polygon, colour, line in zip(
        places[view.order].reshape(len(faces), -1).tolist(),
        map(tuple, colours[view.order].tolist()),
        map(tuple, lines[view.order].tolist()),
        strict=True,
    ):
        draw.polygon(polygon, fill=colour, outline=line)
    _bar(draw, motion, frame)
    return image.resize((WIDTH, HEIGHT), Image.Resampling.BOX)


def _apart(points: Floats, faces: Ints, shifts: Floats) -> tuple[Floats, Ints]:
    """Each of ``faces`` (F, k) with corners of its own, moved by ``shifts`` (F, 3)."""
    alone, numbered = split_facets(points, faces)
    return alone + np.repeat(shifts, (faces >= 0).sum(axis=1), axis=0), numbered


def _camera(motion: FoldingMotion, shifts: Floats | None) -> tuple[Floats, float]:
    """The middle of what is seen, on the screen, and the pixels a millimetre at which all frames
    fit.
    """
    seen = motion.frames.reshape(-1, 3)
    if shifts is not None:
        apart, _ = _apart(motion.frames[-1], motion.pattern.faces_vertices, shifts)
        seen = np.concatenate([seen, apart])
    seen = seen @ axes(_AZIMUTH, _ELEVATION)[:2].T
    low, high = seen.min(axis=0), seen.max(axis=0)
    room = np.array([WIDTH - 2 * _MARGIN, HEIGHT - 2 * _MARGIN - 6 * _BAR])
    return (low + high) / 2, float((room / (high - low)).min())


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
