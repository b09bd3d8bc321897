"""The calibration sheet: finds the settings of a material on a machine from one small sheet.

It holds these tests, each with its settings engraved beside it:

* *Flaps*, cut on three sides and hinged on dashes: a row for each pair of dash and gap, a column
  for each setting of a laser, or force of a pen or knife. The last column has the settings of the
  material and its hinges along Y, all others along X: they differ as the grain of the sheet does.
* *Score flaps*, hinged on a score, a column for each setting, the last along Y.
* *Squares*, each cut with a setting: use that of the first that falls out.
* Two *kerf gauges* for a laser, a window of width W cut into n strips. With a kerf k the window is
  W + k wide and the strips W - n k together, so when they are pushed to one end the last one ends
  (n + 1/2) k short of the drawn other end; a scale beside the window is ruled by that formula. A
  spot that is not round has one kerf along X and another along Y.
* A *coupon*, a small Miura-ori made with the material as it is.

The sheet is as small as possible, so that an off-cut is enough.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from miurafab.fabrication.blocks import Tree, arranged
from miurafab.fabrication.calibration_ladder import columns, dashes, tried_on
from miurafab.fabrication.lettering import text_strokes, text_width
from miurafab.fabrication.perforation import perforate, unbroken
from miurafab.fabrication.route.order import StrokeSet, order_strokes
from miurafab.fabrication.toolpath import Toolpath
from miurafab.geometry.arrays import Floats
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.miura import MiuraCell, regular_miura
from miurafab.origami.unfold import unfold
from miurafab.profiles import OPERATIONS, MachineProfile, Material
from miurafab.profiles.beam import Operation
from miurafab.profiles.material import Perforation

Points = Floats

SHEET = "sheet-01"
STRIPS = 20
_PITCH = (16.0, 14.0)
_FLAP = (11.0, 9.0)
_SQUARE = 8.0
_HEAD, _SCORES, _FOOT = 9.0, 21.0, 20.0
_RATIO = 2.4
"""The height of the text at the left of a row, in mm."""
_WINDOW = (80.0, 14.0)
_GAUGE = (_WINDOW[0] + 19.0, _WINDOW[1] + 8.0)
_SPACE = 8.0
_BESIDE: tuple[Tree, ...] = (("row", (0, 1)), ("column", (0, 1)))
_BESIDE_GAUGES: tuple[Tree, ...] = (
    ("row", (0, ("column", (2, ("row", (1, 3)))))),
    ("column", (("row", (0, 3)), ("row", (2, 1)))),
)
"""How blocks may lie: in a row or a column, the first that has room is taken. The blocks are the
flaps and squares, the coupon, and the two gauges."""
_COUPON = MiuraCell(across=12.0, along=12.0, alpha=math.radians(68), theta=math.radians(40))
_COUPON_GRID = (7, 5)


@dataclass(frozen=True)
class Cell:
    """One flap: its engraved ``label``, its dashes, their operation, and the axis ``along`` which
    its hinge lies.
    """

    label: str
    perforation: Perforation
    operation: Operation
    along: str = "x"


@dataclass(frozen=True)
class ScoredFlap:
    """One flap on a scored hinge: its engraved ``label``, operation and axis."""

    label: str
    operation: Operation
    along: str = "x"


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
    scores: tuple[ScoredFlap, ...]
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
    """The calibration sheet of ``material`` on ``machine``. Deterministic.

    Raises :class:`~miurafab.errors.ProfileError` for a material without settings for the beam, and
    :class:`~miurafab.errors.LayoutError` for a bed that is too small.
    """
    material = tried_on(material, machine)
    trial = _TrialBlock(machine, material)
    coupon = unfold(regular_miura(_COUPON, *_COUPON_GRID))
    across, along = np.ptp(coupon.vertices_coords, axis=0).tolist()
    lasing = machine.tool.laser is not None
    blocks = [trial.size, (across, along), *([_GAUGE, _GAUGE[::-1]] if lasing else [])]
    corners, size = arranged(blocks, _BESIDE_GAUGES if lasing else _BESIDE, machine)
    trial.draw(corners[0])
    plain, folds = _Pen(), _Pen()
    if lasing:
        _gauge(trial.engraved, plain, corners[2])
        _gauge(trial.engraved, plain, corners[3], turned=True)
    _coupon(folds, plain, coupon, corners[1], material)

    margin = machine.bed.margin_mm
    width, height = size[0] + 2 * margin, size[1] + 2 * margin

    def section(pen: _Pen, **operations: Operation) -> tuple[Toolpath, Material]:
        own = material.worked_with(machine, **operations)
        return pen.toolpath(width, height, margin), own

    made = [section(trial.engraved), (_routed(section(folds)[0], coupon), material)]
    made += [section(pen, perforate=use) for use, pen in trial.burnt]
    made += [section(pen, score=use) for use, pen in trial.scored]
    made.append(section(trial.flaps))
    made += [section(pen, cut=use) for use, pen in trial.tried]
    made.append(section(plain))
    return CalibrationSheet(
        width_mm=width,
        height_mm=height,
        cells=tuple(trial.cells),
        scores=tuple(trial.scores),
        squares=tuple(trial.squares),
        sections=tuple(entry for entry in made if len(entry[0])),
        labels=dict(enumerate(trial.labels)),
        coupon=coupon,
    )


class _TrialBlock:
    """The flaps and squares, drawn while they are numbered: ``labels`` by patch number, and the
    strokes of each setting on a pen of its own.
    """

    def __init__(self, machine: MachineProfile, material: Material) -> None:
        self._material = material
        self._own = material.on(machine).operations
        self._rules = dashes(material)
        self._burns = columns(material, machine, "perforate")
        self._cuts = columns(material, machine, "cut")
        knife = machine.tool.knife
        marks = knife is None or "score" not in knife.leave_out
        self._marks = columns(material, machine, "score") if marks else []
        self._left = 5.0 + _RATIO * max(text_width(_ratio(rule)) for rule in self._rules)
        self._across = max(len(self._burns), len(self._cuts), len(self._marks))
        self.size = (
            self._left + _PITCH[0] * self._across + _FLAP[0],
            _HEAD + _PITCH[1] * len(self._rules) + _SCORES + _FOOT,
        )
        self.labels: list[str] = []
        self.cells: list[Cell] = []
        self.scores: list[ScoredFlap] = []
        self.squares: list[Square] = []
        self.engraved, self.flaps = _Pen(), _Pen()
        self.burnt: list[tuple[Operation, _Pen]] = []
        self.scored: list[tuple[Operation, _Pen]] = []
        self.tried: list[tuple[Operation, _Pen]] = []

    def draw(self, at: Points) -> None:
        top = at[1] + self.size[1]
        for column, (operation, turned) in enumerate(self._columns(self._burns, "perforate")):
            x, pen = self._x(at, column, turned), _Pen()
            self._says(operation, (x + _FLAP[0] / 2, top - 5.0), 3.8)
            for row, rule in enumerate(self._rules):
                label = f"{chr(ord('A') + row)}{'Y' if turned else column + 1}"
                self.cells.append(Cell(label, rule, operation, "y" if turned else "x"))
                low = np.array([x, top - _HEAD - _PITCH[1] * row - _FLAP[1]])
                hinge = self._flap(label, low, turned)
                made = perforate(hinge[:1], hinge[1:], _with(self._material, rule))
                strokes = np.stack([made.starts, made.ends], axis=1)
                pen.add(strokes, "perforate", len(self.labels) - 1)
            self.burnt.append((operation, pen))
        for row, rule in enumerate(self._rules):
            y = top - _HEAD - _PITCH[1] * row - _FLAP[1] / 2
            text = _ratio(rule)
            _write(self.engraved, text, (at[0] + 2.0 + _RATIO * text_width(text) / 2, y), _RATIO)
        low_of_scores = at[1] + _FOOT + 9.5
        for column, (operation, turned) in enumerate(self._columns(self._marks, "score")):
            x, pen = self._x(at, column, turned), _Pen()
            label = f"S{'Y' if turned else column + 1}"
            self.scores.append(ScoredFlap(label, operation, "y" if turned else "x"))
            self._says(operation, (x + _FLAP[0] / 2, low_of_scores - 7.5), 3.8)
            hinge = self._flap(label, np.array([x, low_of_scores]), turned)
            pen.add([hinge], "score", len(self.labels) - 1)
            self.scored.append((operation, pen))
        ring = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * _SQUARE / 2
        for column, operation in enumerate(self._cuts):
            x, pen = self._x(at, column, False) + _FLAP[0] / 2, _Pen()
            label = f"X{column + 1}"
            self.squares.append(Square(label, operation))
            self.labels.append(label)
            pen.add([ring + np.array([x, at[1] + 12.0])], "cut", len(self.labels) - 1)
            _write(self.engraved, label, (x, at[1] + 12.0), 3.0)
            self._says(operation, (x, at[1] + 1.4), 3.8)
            self.tried.append((operation, pen))

    def _columns(self, tried: Sequence[Operation], name: str) -> list[tuple[Operation, bool]]:
        """The operations ``tried``, then the material's own for hinges that are turned."""
        return [*((each, False) for each in tried), *([(self._own[name], True)] if tried else [])]

    def _x(self, at: Points, column: int, turned: bool) -> float:
        return float(at[0]) + self._left + _PITCH[0] * (self._across if turned else column)

    def _says(self, operation: Operation, low: tuple[float, float], rise: float) -> None:
        """What is tried, in two lines: the strength above the feed."""
        _write(self.engraved, _strength(operation), (low[0], low[1] + rise), 2.2)
        _write(self.engraved, f"F{operation.feed_mm_min:g}", low, 2.2)

    def _flap(self, label: str, low: Points, turned: bool) -> Points:
        """Draw a flap whose lower left corner is ``low``; returns the two ends of its hinge."""
        self.labels.append(label)
        wide, high = _FLAP
        around = np.array([(0.0, 0.0), (0.0, high), (wide, high), (wide, 0.0)])
        if turned:
            around = np.roll(around[::-1], 1, axis=0)
        way: Points = low + around
        self.flaps.add([way], "cut", len(self.labels) - 1)
        _write(self.engraved, label, low + np.array([wide, high]) / 2, 3.0)
        return np.stack([way[0], way[-1]])


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


def _ratio(rule: Perforation) -> str:
    return f"{rule.cut_mm:g}/{rule.gap_mm:g}"


def _strength(operation: Operation) -> str:
    """In watts, or in what presses a pen or knife down: every column has one of them."""
    return f"S{operation.force}" if operation.power is None else f"{operation.power:.3g}W"


def _write(pen: _Pen, text: str, middle: Points | tuple[float, float], height: float) -> None:
    pen.add((stroke * height + np.asarray(middle) for stroke in text_strokes(text)), "engrave")


def gauge_mark(kerf: float) -> float:
    """The distance in mm of the last strip from the drawn right end of the window, at this kerf."""
    return (STRIPS + 0.5) * kerf


def _gauge(engraved: _Pen, cut: _Pen, corner: Points, *, turned: bool = False) -> None:
    """A gauge whose strips are side by side along X, or along Y if it is turned to the left."""
    texts, strips = _Pen(), _Pen()
    _drawn_gauge(texts, strips, "KERF-Y" if turned else "KERF-X")
    for pen, drawn in ((engraved, texts), (cut, strips)):
        for stroke, (operation, _, _) in zip(drawn.strokes, drawn.kinds, strict=True):
            left = np.stack([_GAUGE[1] - stroke[:, 1], stroke[:, 0]], axis=1)
            pen.add([corner + (left if turned else stroke)], OPERATIONS[operation])


def _drawn_gauge(engraved: _Pen, cut: _Pen, name: str) -> None:
    wide, high = _WINDOW
    low = np.array([17.0, 0.0])
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
    _write(engraved, name, (1.1 * text_width(name), low[1] + high / 2), 2.2)


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
