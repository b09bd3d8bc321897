"""The calibration sheet: finds the settings of a material on a laser from one small sheet.

It holds four tests, each with its settings engraved beside it:

* *Flaps*, cut on three sides and hinged on dashes: a row for each pair of dash and gap, a column
  for each pair of power and feed. Fold them; the flap that folds best gives all four settings.
* *Squares*, each cut with a power and a feed: use the settings of the first that falls out.
* The *kerf gauge*, a window of width W cut into n strips. With a kerf k the window is W + k wide
  and the strips W - n k together, so when they are pushed to the left the last one ends
  (n + 1/2) k short of the drawn right end; a scale above the window is ruled by that formula, and
  kerf is read off it.
* A *coupon*, a small Miura-ori made with the material as it is.

The sheet is as small as possible, so that an off-cut is enough.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from miurafab.errors import LayoutError, ProfileError
from miurafab.fabrication.lettering import text_strokes, text_width
from miurafab.fabrication.perforation import MIN_STROKE_MM, perforate, unbroken
from miurafab.fabrication.route.order import StrokeSet, order_strokes
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.miura import MiuraCell, regular_miura
from miurafab.origami.unfold import unfold
from miurafab.profiles import OPERATIONS, MachineProfile, Material
from miurafab.profiles.material import Operation, Perforation

Points = Floats

SHEET = "sheet-01"
DASHES = ((0.7, 1.3), (1.0, 1.0), (1.4, 1.0), (1.8, 0.8))
"""The rows: dash and gap over the material's, from stiff to soft."""
POWERS = (0.7, 1.0, 1.3)
FEEDS = (1.0, 1.6)
"""The columns: power and feed over the material's, within the limits of both."""
STRIPS = 20
_PITCH = (16.0, 14.0)
_FLAP = (11.0, 9.0)
_SQUARE = 8.0
_HEAD, _FOOT = 9.0, 20.0
_RATIO = 2.4
"""The height of the text at the left of a row, in mm."""
_WINDOW = (80.0, 14.0)
_SPACE = 8.0
_COUPON = MiuraCell(across=12.0, along=12.0, alpha=math.radians(68), theta=math.radians(40))
_COUPON_GRID = (7, 5)


@dataclass(frozen=True)
class Cell:
    """One flap: its engraved ``label``, its dashes, and their operation."""

    label: str
    perforation: Perforation
    operation: Operation


@dataclass(frozen=True)
class Square:
    """One square: its engraved ``label`` and its operation."""

    label: str
    operation: Operation


@dataclass(frozen=True, eq=False)
class CalibrationSheet:
    """The sheet. ``sections`` are made in order, each with its own material; ``labels`` name the
    patch numbers of their strokes. ``coupon`` is the pattern of the Miura-ori.
    """

    width_mm: float
    height_mm: float
    cells: tuple[Cell, ...]
    squares: tuple[Square, ...]
    sections: tuple[tuple[Toolpath, Material], ...]
    labels: dict[int, str]
    coupon: CreasePattern

    @property
    def toolpath(self) -> Toolpath:
        """All strokes in order, for drawings."""
        paths = [toolpath for toolpath, _ in self.sections]
        sizes = np.concatenate([np.diff(path.offsets) for path in paths])
        return replace(
            paths[0],
            points=np.concatenate([path.points for path in paths]),
            offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
            operation=np.concatenate([path.operation for path in paths]),
            patch=np.concatenate([path.patch for path in paths]),
            edge=np.concatenate([path.edge for path in paths]),
        )


def calibration_sheet(machine: MachineProfile, material: Material) -> CalibrationSheet:
    """The calibration sheet of ``material`` on ``machine``, a laser. Deterministic.

    Raises :class:`~miurafab.errors.ProfileError` for a machine that is no laser, and
    :class:`~miurafab.errors.LayoutError` for a bed that is too small.
    """
    if machine.tool.kind != "laser":
        raise ProfileError(
            f"{machine.name}: a {machine.tool.kind} has no power to calibrate; choose a laser."
        )
    fastest = min(machine.motion.max_rate_mm_min)
    rules = _dashes(material)
    burns = _settings(material, "perforate", fastest)
    cuts = _settings(material, "cut", fastest)
    coupon = unfold(regular_miura(_COUPON, *_COUPON_GRID))
    left = 5.0 + _RATIO * max(text_width(_ratio(rule)) for rule in rules)
    trial = _trial_size(left, len(rules), max(len(burns), len(cuts)))
    gauge = (_WINDOW[0] + 14.0, _WINDOW[1] + 8.0)
    fold = (np.ptp(coupon.vertices_coords[:, 0]), np.ptp(coupon.vertices_coords[:, 1]))
    corners, size = _arranged([trial, gauge, (float(fold[0]), float(fold[1]))], machine)

    margin = machine.bed.margin_mm
    width, height = size[0] + 2 * margin, size[1] + 2 * margin
    cells: list[Cell] = []
    squares: list[Square] = []
    engraved, flaps, plain = _Pen(), _Pen(), _Pen()
    burnt = [_Pen() for _ in burns]
    tried = [_Pen() for _ in cuts]
    at = corners[0]
    for column, operation in enumerate(burns):
        x = at[0] + left + _PITCH[0] * column
        top = at[1] + trial[1]
        _write(engraved, _percent(operation), (x + _FLAP[0] / 2, top - 1.2), 2.2)
        _write(engraved, _feed(operation), (x + _FLAP[0] / 2, top - 5.0), 2.2)
        for row, rule in enumerate(rules):
            corner = np.array([x, top - _HEAD - _PITCH[1] * row - _FLAP[1]])
            cell = Cell(f"{chr(ord('A') + row)}{column + 1}", rule, operation)
            patch = len(cells)
            cells.append(cell)
            hinge = corner + np.array([[0.0, 0.0], [_FLAP[0], 0.0]])
            dashes = perforate(hinge[:1], hinge[1:], _with(material, rule))
            burnt[column].add(np.stack([dashes.starts, dashes.ends], axis=1), "perforate", patch)
            way = corner + np.array([(0.0, 0.0), (0.0, _FLAP[1]), _FLAP, (_FLAP[0], 0.0)])
            flaps.add([way], "cut", patch)
            _write(engraved, cell.label, corner + np.array(_FLAP) / 2, 3.0)
    for row, rule in enumerate(rules):
        y = at[1] + trial[1] - _HEAD - _PITCH[1] * row - _FLAP[1] / 2
        text = _ratio(rule)
        _write(engraved, text, (at[0] + 2.0 + _RATIO * text_width(text) / 2, y), _RATIO)
    for column, operation in enumerate(cuts):
        x = at[0] + left + _PITCH[0] * column + _FLAP[0] / 2
        square = Square(f"X{column + 1}", operation)
        patch = len(cells) + len(squares)
        squares.append(square)
        ring = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * _SQUARE / 2
        tried[column].add([ring + np.array([x, at[1] + 12.0])], "cut", patch)
        _write(engraved, square.label, (x, at[1] + 12.0), 3.0)
        _write(engraved, _percent(operation), (x, at[1] + 5.2), 2.2)
        _write(engraved, _feed(operation), (x, at[1] + 1.4), 2.2)
    _gauge(engraved, plain, corners[1])
    folds = _Pen()
    _coupon(folds, plain, coupon, corners[2], material)

    def section(pen: _Pen, **operations: Operation) -> tuple[Toolpath, Material]:
        own = replace(material, operations={**material.operations, **operations})
        return pen.toolpath(width, height, margin), own

    made = [section(engraved), (_routed(section(folds)[0], coupon), material)]
    made += [section(pen, perforate=use) for pen, use in zip(burnt, burns, strict=True)]
    made.append(section(flaps))
    made += [section(pen, cut=use) for pen, use in zip(tried, cuts, strict=True)]
    made.append(section(plain))
    labels = [*(cell.label for cell in cells), *(square.label for square in squares)]
    return CalibrationSheet(
        width_mm=width,
        height_mm=height,
        cells=tuple(cells),
        squares=tuple(squares),
        sections=tuple(entry for entry in made if len(entry[0])),
        labels=dict(enumerate(labels)),
        coupon=coupon,
    )


@dataclass
class _Pen:
    """Strokes in the order drawn."""

    strokes: list[Points] = field(default_factory=list)
    kinds: list[tuple[int, int, int]] = field(default_factory=list)

    def add(
        self, strokes: Iterable[Points], operation: str, patch: int = -1, edge: int = -1
    ) -> None:
        for stroke in strokes:
            self.strokes.append(np.asarray(stroke, dtype=np.float64))
            self.kinds.append((OPERATIONS.index(operation), patch, edge))

    def toolpath(self, width: float, height: float, margin: float) -> Toolpath:
        sizes = [len(stroke) for stroke in self.strokes]
        kinds = np.array(self.kinds, dtype=np.int64).reshape(-1, 3)
        return Toolpath(
            sheet=SHEET,
            width_mm=width,
            height_mm=height,
            points=np.concatenate([np.empty((0, 2)), *self.strokes]) + margin,
            offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
            operation=kinds[:, 0],
            patch=kinds[:, 1],
            edge=kinds[:, 2],
        )


def _with(material: Material, rule: Perforation) -> Material:
    """``material`` with the dashes ``rule`` on every crease."""
    creases = {kind: replace(made, perforation=rule) for kind, made in material.creases.items()}
    return replace(material, perforation=rule, creases=creases)


def _dashes(material: Material) -> list[Perforation]:
    usual = material.perforation
    least = material.kerf_mm + MIN_STROKE_MM
    found: dict[tuple[float, float], Perforation] = {}
    for dash, gap in DASHES:
        cut = max(_scaled(usual.cut_mm, dash), math.ceil(least * 20 - 1e-9) / 20)
        left = max(_scaled(usual.gap_mm, gap), 0.05)
        rule = replace(usual, cut_mm=cut, gap_mm=left, min_end_mm=min(usual.min_end_mm, cut))
        found.setdefault((cut, left), rule)
    return list(found.values())


def _scaled(length: float, factor: float) -> float:
    """A length times ``factor``, rounded to 0.05 mm; unchanged if the factor is 1."""
    return length if factor == 1.0 else round(round(length * factor * 20) / 20, 2)


def _settings(material: Material, name: str, fastest: float) -> list[Operation]:
    """The columns of one operation, by energy per mm, the least first."""
    usual = material.operations[name]
    powers = dict.fromkeys(
        min(usual.power if factor == 1.0 else round(usual.power * factor, 2), material.max_power)
        for factor in POWERS
    )
    feeds = dict.fromkeys(
        min(
            usual.feed_mm_min if factor == 1.0 else float(f"{usual.feed_mm_min * factor:.3g}"),
            fastest,
        )
        for factor in FEEDS
    )
    found = [replace(usual, power=power, feed_mm_min=feed) for power in powers for feed in feeds]
    return sorted(found, key=lambda each: (each.power / each.feed_mm_min, each.power))


def _trial_size(left: float, rows: int, columns: int) -> tuple[float, float]:
    wide = left + _PITCH[0] * (columns - 1) + _FLAP[0]
    return wide, _HEAD + _PITCH[1] * rows + _FOOT


def _arranged(
    blocks: Sequence[tuple[float, float]], machine: MachineProfile
) -> tuple[list[Points], tuple[float, float]]:
    """The lower left corners of the blocks, and their total size: the first block on the left and
    the others to its right if there is room, or all above each other.
    """
    (wide, high), (wide_1, high_1), (wide_2, high_2) = blocks
    right = wide + _SPACE
    beside = (right + max(wide_1, wide_2), max(high, high_1 + _SPACE + high_2))
    above = (max(wide, wide_1, wide_2), high + high_1 + high_2 + 2 * _SPACE)
    bed = machine.bed
    room = (bed.width_mm - 2 * bed.margin_mm, bed.height_mm - 2 * bed.margin_mm)
    if beside[0] <= room[0] and beside[1] <= room[1]:
        low = beside[1] - high_1 - _SPACE - high_2
        places = [(0.0, beside[1] - high), (right, beside[1] - high_1), (right, low)]
        return [np.array(place) for place in places], beside
    if above[0] <= room[0] and above[1] <= room[1]:
        places = [(0.0, above[1] - high), (0.0, high_2 + _SPACE), (0.0, 0.0)]
        return [np.array(place) for place in places], above
    raise LayoutError(
        f"The calibration sheet needs {beside[0]:.0f} mm x {beside[1]:.0f} mm or {above[0]:.0f} mm "
        f"x {above[1]:.0f} mm, and the usable bed of {machine.name} is {room[0]:g} mm x "
        f"{room[1]:g} mm; choose another machine, or a smaller margin in its profile."
    )


def _ratio(rule: Perforation) -> str:
    return f"{rule.cut_mm:g}/{rule.gap_mm:g}"


def _percent(operation: Operation) -> str:
    return f"{100 * operation.power:g}%"


def _feed(operation: Operation) -> str:
    return f"F{operation.feed_mm_min:g}"


def _write(pen: _Pen, text: str, middle: Points | tuple[float, float], height: float) -> None:
    pen.add((stroke * height + np.asarray(middle) for stroke in text_strokes(text)), "engrave")


def gauge_mark(kerf: float) -> float:
    """The distance in mm of the last strip from the drawn right end of the window, at this kerf."""
    return (STRIPS + 0.5) * kerf


def _gauge(engraved: _Pen, cut: _Pen, corner: Points) -> None:
    wide, high = _WINDOW
    low = corner + np.array([12.0, 0.0])
    for strip in range(1, STRIPS):
        x = low[0] + wide * strip / STRIPS
        ends = np.array([[x, low[1]], [x, low[1] + high]])
        cut.add([ends if strip % 2 else ends[::-1]], "cut")
    ring = np.array([[0, 0], [wide, 0], [wide, high], [0, high], [0, 0]], dtype=np.float64)
    cut.add([ring + low], "cut")
    top = low[1] + high + 1.0
    for twentieth in range(11):
        kerf = twentieth / 20
        x = low[0] + wide - gauge_mark(kerf)
        tall = 2.4 if twentieth % 2 == 0 else 1.4
        engraved.add([np.array([[x, top], [x, top + tall]])], "engrave")
        if twentieth % 4 == 0:
            _write(engraved, f"{kerf:g}".removeprefix("0") or "0", (x, top + 4.4), 1.8)
    _write(engraved, "KERF", (corner[0] + 5.0, low[1] + high / 2), 2.4)


def _routed(folds: Toolpath, coupon: CreasePattern) -> Toolpath:
    """The strokes of the coupon, ordered for little travel."""
    nowhere = np.zeros(len(folds), dtype=np.int64)
    return order_strokes(StrokeSet(folds, folds.edge, nowhere), coupon.edges_vertices)


def _coupon(
    folds: _Pen, cut: _Pen, coupon: CreasePattern, corner: Points, material: Material
) -> None:
    places = coupon.vertices_coords - coupon.vertices_coords.min(axis=0) + corner
    codes = {"M": "mountain", "V": "valley"}
    ends = places[coupon.edges_vertices]
    made = []
    for letter, kind in codes.items():
        mode = material.creases[kind].mode
        if mode == "none":
            continue
        chosen = np.flatnonzero(coupon.edges_assignment == letter)
        draw = perforate if mode == "perforate" else unbroken
        dashes = draw(ends[chosen, 0], ends[chosen, 1], material, kind)
        made += [
            (OPERATIONS.index(mode), mode, np.array([start, end]), int(chosen[crease]))
            for start, end, crease in zip(dashes.starts, dashes.ends, dashes.crease, strict=True)
        ]
    for _, mode, stroke, edge in sorted(made, key=lambda entry: (entry[0], entry[3])):
        folds.add([stroke], mode, edge=edge)
    assert coupon.grid is not None
    columns, rows = coupon.grid
    index = np.arange(columns * rows).reshape(rows, columns)
    ring = np.concatenate([index[0], index[1:, -1], index[-1, -2::-1], index[-2::-1, 0]])
    cut.add([places[ring]], "cut")
