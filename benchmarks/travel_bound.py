"""A lower bound of the travel over all orders of the strokes.

Strokes of one operation are made in one go. So the travel is at least the way to the first stroke,
plus the way back from the last stroke, plus for each operation the travel of a path through its
strokes. The legs of such a path have these parts, which do not overlap:

- **Balls.** A leg ends at every end of an open stroke. It leaves the ball about that end whose
  radius is half the distance to the nearest place where another stroke can be entered.
- **Disks** about ends that are far from the ends of all other creases, such as where a crease meets
  the outline. A closed tour crosses every circle an even number of times, and at least twice. If
  the strokes cross the circle of radius r

      not at all, two legs or more do;    an odd number of times, one leg or more does,

  so the legs within the disk are at least as long as these numbers integrated over r (Held and
  Karp's 1970 bound in the geometric form of Juenger and Pulleyblank 1993, with circles for moats).

Disks do not overlap each other, and balls with centres outside of the disks are cut to keep clear
of them. The path of an operation is open, so its two ends can spoil two balls or disks; the two
largest are not counted. A closed stroke can be entered at any corner.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.spatial
import shapely
from numpy.typing import NDArray

from miurafab.fabrication.toolpath import Toolpath

LONELY = 4.0
"""An end has a disk if the ends of other creases are this many times farther away than the ends of
other strokes."""


def travel_bound(toolpath: Toolpath) -> float:
    """The lower bound in mm of the travel from the origin through all strokes, operation by
    operation, and back to the origin.
    """
    if not len(toolpath):
        return 0.0
    first, last = toolpath.operation[0], toolpath.operation[-1]
    total = sum(_nearest_to_origin(only(toolpath, each)) for each in (first, last))
    return total + sum(
        path_bound(only(toolpath, each)) for each in np.unique(toolpath.operation).tolist()
    )


def only(toolpath: Toolpath, operation: int) -> Toolpath:
    """The strokes of one operation, an index into :data:`~miurafab.profiles.OPERATIONS`."""
    keep, size = toolpath.operation == operation, np.diff(toolpath.offsets)
    return replace(
        toolpath,
        points=toolpath.points[np.repeat(keep, size)],
        offsets=np.concatenate([[0], np.cumsum(size[keep])]),
        operation=toolpath.operation[keep],
        patch=toolpath.patch[keep],
        edge=toolpath.edge[keep],
    )


def _nearest_to_origin(toolpath: Toolpath) -> float:
    return float(np.hypot(*toolpath.points.T).min())


def path_bound(strokes: Toolpath) -> float:
    """The lower bound in mm of the travel of a path through all ``strokes``, from the end of its
    first stroke to the start of its last.
    """
    if len(strokes) < 2:
        return 0.0
    places, balls = _balls(strokes)
    found = _sum_but_two(balls)
    straight = (np.diff(strokes.offsets) == 2).all() and len(balls) == 2 * len(strokes)
    if places is not None and straight:
        centres, radii = _disks(strokes, balls)
        disks = _travel_within(strokes, places, centres, radii)
        clear = _clear_of(places, balls, centres, radii)
        found = max(found, _sum_but_two(np.concatenate([clear, disks])))
    return found


def _sum_but_two(parts: NDArray[np.float64]) -> float:
    return float(np.sort(parts)[:-2].sum())


def _balls(strokes: Toolpath) -> tuple[scipy.spatial.KDTree | None, NDArray[np.float64]]:
    """The places where strokes may be entered, first of all E ends of the open ones, all starts
    before all others, and half the way (E,) from each end to the nearest place on another stroke.
    """
    owner = np.repeat(np.arange(len(strokes)), np.diff(strokes.offsets))
    closed = (strokes.starts == strokes.ends).all(axis=1)
    opened = np.flatnonzero(~closed)
    corners = np.flatnonzero(closed[owner])
    ends = np.concatenate([strokes.starts[opened], strokes.ends[opened]])
    owners = np.concatenate([opened, opened])
    places = np.concatenate([ends, strokes.points[corners]])
    names = np.concatenate([owners, owner[corners]])
    if not len(ends):
        return None, np.empty(0)
    tree = scipy.spatial.KDTree(places, balanced_tree=False)
    # Of three places at most two are the stroke's own.
    way, near = tree.query(ends, k=min(3, len(places)))
    way = np.where(names[near] == owners[:, None], np.inf, way).min(axis=1)
    return tree, np.where(np.isfinite(way), way, 0.0) / 2


def _disks(
    strokes: Toolpath, balls: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres (D, 2) and radii (D,) of disks that do not overlap, for strokes of two points."""
    count = len(strokes)
    crease = np.column_stack([strokes.patch, strokes.edge])
    fresh = np.append(True, (crease[1:] != crease[:-1]).any(axis=1))
    first, last = np.flatnonzero(fresh), np.flatnonzero(np.append(fresh[1:], True))
    # A crease that is drawn backwards or in parts only has more terminals than two.
    points = np.concatenate([strokes.starts[first], strokes.ends[last]])
    ball = np.concatenate([balls[first], balls[count + last]])
    way, _ = scipy.spatial.KDTree(points).query(points, k=min(2, len(points)))
    radii = np.asarray(way)[:, -1] / 2
    lonely = radii > LONELY * ball
    return points[lonely], radii[lonely]


def _clear_of(
    places: scipy.spatial.KDTree,
    balls: NDArray[np.float64],
    centres: NDArray[np.float64],
    radii: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The radii ``balls`` (E,) about the first E ``places``, cut to what keeps clear of the
    disks.
    """
    room = balls.copy()
    disk, end = _near(places, centres, radii + balls.max(initial=0.0))
    way = np.linalg.norm(places.data[end] - centres[disk], axis=1)
    np.minimum.at(room, end, way - radii[disk])
    return np.maximum(room, 0.0)


def _near(
    places: scipy.spatial.KDTree, centres: NDArray[np.float64], reach: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The pairs (N,) of a centre and a place within ``reach`` (D,) of it."""
    found = places.query_ball_point(centres, reach)
    disk = np.repeat(np.arange(len(centres)), [len(each) for each in found])
    return disk, np.array([place for each in found for place in each], dtype=np.int64)


def _travel_within(
    strokes: Toolpath,
    places: scipy.spatial.KDTree,
    centres: NDArray[np.float64],
    radii: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(D,) what the legs of a closed tour through the ``strokes`` have in each disk at least;
    ``places`` are their starts and then their ends.
    """
    # A line that meets a disk has its ends no farther from it than it is long.
    _, end = _near(places, centres, radii + strokes.lengths.max(initial=0.0))
    close = np.unique(end % len(strokes))
    both = strokes.points.reshape(-1, 2, 2)[close]
    lines = np.asarray(shapely.linestrings(both), dtype=object)
    middles = np.asarray(shapely.points(centres), dtype=object)
    disk, line = shapely.STRtree(lines).query(middles, predicate="dwithin", distance=radii)
    start, end = np.linalg.norm(both[line] - centres[disk, None], axis=2).T
    near, far = np.minimum(start, end), np.maximum(start, end)
    foot = np.minimum(shapely.distance(middles[disk], lines[line]), near)
    # How often a circle is crossed changes by 2 at the foot of a line, by -1 at each of its ends.
    count = len(centres)
    which = np.concatenate([disk, disk, disk, np.arange(count), np.arange(count)])
    radius = np.concatenate([foot, near, far, np.zeros(count), radii])
    change = np.repeat([2, -1, -1, 0, 0], [len(disk)] * 3 + [count] * 2)
    order = np.lexsort((radius, which))
    which, change = which[order], change[order]
    radius = np.minimum(radius[order], radii[which])
    # Every line brings as much as it takes, but those that reach out of their disk.
    crossed = np.cumsum(change) - (np.cumsum(change) - change)[np.searchsorted(which, which)]
    legs = np.where(crossed == 0, 2, crossed % 2)
    width = np.append(np.diff(radius), 0.0)
    width[np.append(which[1:] != which[:-1], True)] = 0.0
    within: NDArray[np.float64] = np.bincount(which, legs * width, minlength=count).astype(float)
    return within
