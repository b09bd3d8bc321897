"""A sheet cut along the outline of its target, so that it ends where the target ends.

A trimmed sheet is as foldable as the whole one: trimming only takes paper away. A chord in a planar
facet stays straight when it unfolds. The vertices inside the trimmed sheet are inside the whole
sheet, with the same sectors; every motion of the whole sheet is one of its part, and a part of a
flat sheet without overlaps has none.

Each new vertex has the same affine coordinates in the folded and in the flat facet, so facets stay
planar and the sheet isometric to the last digits. What cannot be made is dropped: facets under
``SLIVER`` of the median area, parts that hang on creases under ``CREASE`` of the mean edge, and
facets that touch the rest in a point only.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.geometry.connected import components
from miurafab.geometry.polygons import edge_lengths, facet_areas, facet_means, next_corners
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.trim_cuts import EdgeCuts, bend, edge_cuts, meeting_vertices
from miurafab.origami.unfold import with_angles_of_the_folded_form
from miurafab.surfaces.outline import WholeMesh

SLIVER = 0.12
"""The least area of a trimmed facet, as a part of the median facet."""
CREASE = 0.25
"""The shortest crease that holds a part of the sheet, as a part of the mean edge."""

Polygon = tuple[list[int], list[int]]
"""The corners of a facet, and the edge of the whole sheet of the side after each corner, or -1."""


def trimmed(pattern: CreasePattern, target: WholeMesh, near: Floats) -> CreasePattern:
    """``pattern``, a whole sheet with its folded form, cut along the outline of ``target``.

    ``near`` (V, 2) are parameters near the place of each vertex: where two parts of a target lie
    side by side, the nearest point alone does not tell to which one a vertex belongs.
    """
    cutter = _Cutter(pattern, target, edge_cuts(pattern, target, near))
    polygons: list[Polygon] = []
    owner: list[int] = []
    for facet in range(len(pattern.faces_vertices)):
        parts = cutter.parts(facet)
        polygons += parts
        owner += [facet] * len(parts)
    faces, parents = _filled([p[0] for p in polygons]), _filled([p[1] for p in polygons])
    return _assembled(pattern, cutter.tables(), faces, parents, np.array(owner, dtype=np.int64))


def inner_facets(pattern: CreasePattern, target: WholeMesh, near: Floats) -> CreasePattern:
    """The whole facets of ``pattern`` whose means are inside the outline of ``target``; ``near`` is
    that of :func:`trimmed`.
    """
    assert pattern.folded_coords is not None
    means = facet_means(pattern.folded_coords, pattern.faces_vertices) / pattern.scale
    feet = target.feet(means, near[pattern.faces_vertices].mean(axis=1))
    owners = np.flatnonzero(target.outline.signed_distance(feet) > 0)
    tables = pattern.vertices_coords, pattern.folded_coords, meeting_vertices(pattern)
    faces, parents = pattern.faces_vertices[owners], pattern.faces_edges[owners]
    return _assembled(pattern, tables, faces, parents, owners)


def _assembled(
    pattern: CreasePattern,
    tables: tuple[Floats, Floats, Ints],
    faces: Ints,
    parents: Ints,
    owners: Ints,
) -> CreasePattern:
    """The pattern of those of ``faces`` (F, k) that can be made and hang together.

    ``tables`` are the vertices flat and folded, and the points in space at which they lie. The
    facets are parts of the facets ``owners`` (F,), their sides of the edges ``parents`` (F, k).
    """
    flat, folded, meeting = tables
    area = facet_areas(folded, faces)
    whole = facet_areas(folded, pattern.faces_vertices)
    kept = np.flatnonzero(area >= SLIVER * np.median(whole))
    mean = float(edge_lengths(folded, pattern.edges_vertices).mean())
    while True:
        sides = _Sides.of(faces[kept], parents[kept], meeting)
        part = sides.linked(edge_lengths(folded, sides.ends) >= CREASE * mean)
        largest = part == np.bincount(part, area[kept]).argmax()
        if largest.all():
            loose = sides.pinched(faces[kept], area[kept])
            if not len(loose):
                break
            largest[loose] = False
        kept = kept[largest]
    return _pattern(pattern, flat, folded, faces[kept], owners[kept], sides)


@dataclass(eq=False)
class _Cutter:
    """Cuts facets, and numbers the new vertices as it goes; new ones follow those of ``pattern``.

    A new vertex is an affine combination of three vertices: ``bases`` and ``weights``. ``lines``
    say which vertices at seams are one point.
    """

    pattern: CreasePattern
    target: WholeMesh
    cuts: EdgeCuts
    bases: list[tuple[int, int, int]] = field(default_factory=list)
    weights: list[tuple[float, float, float]] = field(default_factory=list)
    numbers: dict[tuple[int, int, float], int] = field(default_factory=dict)

    def parts(self, facet: int) -> list[Polygon]:
        """What is left of ``facet``."""
        pattern = self.pattern
        corners = [v for v in pattern.faces_vertices[facet].tolist() if v >= 0]
        edges = pattern.faces_edges[facet].tolist()
        nodes: list[int] = []
        states: list[bool] = []
        parents: list[int] = []
        for slot, tail in enumerate(corners):
            head = corners[(slot + 1) % len(corners)]
            breaks, inside = self.cuts.walk(edges[slot], tail, head)
            nodes += [tail, *(self._on_edge(tail, head, at) for at in breaks)]
            states += inside
            parents += [edges[slot]] * len(inside)
        if all(states):
            return [(nodes, parents)]
        if not any(states):
            return []
        arcs = _arcs(states)
        if len(arcs) > 1 and not self._middle_inside(corners):
            groups = [[arc] for arc in arcs]
        else:
            groups = [arcs]
        polygons = [self._polygon(corners, nodes, parents, group) for group in groups]
        return [polygon for polygon in polygons if len(polygon[0]) >= 3]

    def _middle_inside(self, corners: list[int]) -> bool:
        middle = self._points(corners).mean(axis=0, keepdims=True)
        foot = self.target.feet(middle, self._near(corners)[None])
        return bool(self.target.outline.signed_distance(foot)[0] > 0)

    def _near(self, corners: list[int]) -> Floats:
        """(2,) the parameters in the middle of a facet."""
        return np.asarray(self.cuts.feet[corners].mean(axis=0))

    def _polygon(
        self, corners: list[int], nodes: list[int], parents: list[int], arcs: list[list[int]]
    ) -> Polygon:
        """The facet inside ``arcs``, each the numbers of its intervals; cuts join their ends. A cut
        from a place on an edge to another one on that edge is a part of the edge.
        """
        polygon: list[int] = []
        sides: list[int] = []
        for n, arc in enumerate(arcs):
            polygon += [nodes[i] for i in arc]
            sides += [parents[i] for i in arc]
            leaves, enters = (arc[-1] + 1) % len(nodes), arcs[(n + 1) % len(arcs)][0]
            bends = self._bends(corners, nodes[leaves], nodes[enters])
            polygon += [nodes[leaves], *bends]
            skipped = {
                parents[(leaves + i) % len(nodes)] for i in range((enters - leaves) % len(nodes))
            }
            along = skipped.pop() if len(skipped) == 1 and not bends else -1
            sides += [along] * (1 + len(bends))
        return polygon, sides

    def _bends(self, corners: list[int], leaves: int, enters: int) -> list[int]:
        points = self._points(corners)
        length = float(np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).mean())
        start, end = self._folded(leaves), self._folded(enters)
        found = bend(points, start, end, length, self.target, self._near(corners))
        return [self._in_facet(corners[:3], points[:3], point) for point in found]

    def _points(self, corners: list[int]) -> Floats:
        assert self.pattern.folded_coords is not None
        return np.asarray(self.pattern.folded_coords[corners] / self.pattern.scale)

    def _folded(self, vertex: int) -> Floats:
        """(3,) a vertex of the facet's border on the target's scale."""
        new = vertex - len(self.pattern.vertices_coords)
        if new < 0:
            return np.asarray(self._points([vertex])[0])
        return np.asarray(np.array(self.weights[new]) @ self._points(list(self.bases[new])))

    def _on_edge(self, tail: int, head: int, at: float) -> int:
        """The new vertex at the part ``at`` of the line between two vertices."""
        meeting = self.cuts.meeting
        low, high = (tail, head) if meeting[tail] < meeting[head] else (head, tail)
        if (low, high, at) not in self.numbers:
            self.numbers[low, high, at] = self._new((low, high, low), (1 - at, at, 0.0))
        return self.numbers[low, high, at]

    def _in_facet(self, base: list[int], corners: Floats, point: Floats) -> int:
        """The new vertex at ``point``, in the plane of the three ``corners`` (3, 3)."""
        a, b = corners[1] - corners[0], corners[2] - corners[0]
        s, t = np.linalg.lstsq(np.stack([a, b], axis=1), point - corners[0], rcond=None)[0].tolist()
        return self._new((base[0], base[1], base[2]), (1 - s - t, s, t))

    def _new(self, base: tuple[int, int, int], weights: tuple[float, float, float]) -> int:
        self.bases.append(base)
        self.weights.append(weights)
        return len(self.pattern.vertices_coords) + len(self.bases) - 1

    def tables(self) -> tuple[Floats, Floats, Ints]:
        """All vertices flat (N, 2) and folded (N, 3), and the number (N,) of the point in space at
        which each lies.
        """
        flat, folded = self.pattern.vertices_coords, self.pattern.folded_coords
        assert folded is not None
        base = np.array(self.bases, dtype=np.int64).reshape(-1, 3)
        weight = np.array(self.weights).reshape(-1, 3, 1)
        meeting = self.cuts.meeting
        first: dict[tuple[int, int, float], int] = {}
        point = np.concatenate([meeting, len(flat) + np.arange(len(base))])
        for (low, high, at), number in self.numbers.items():
            point[number] = first.setdefault((meeting[low], meeting[high], at), number)
        return (
            np.concatenate([flat, (flat[base] * weight).sum(axis=1)]),
            np.concatenate([folded, (folded[base] * weight).sum(axis=1)]),
            point,
        )


def _arcs(states: list[bool]) -> list[list[int]]:
    """The runs of True in a cycle of states that are not all True, each as a list of places."""
    start = states.index(False)
    arcs: list[list[int]] = []
    before = False
    for n in range(1, len(states) + 1):
        place = (start + n) % len(states)
        if states[place]:
            if not before:
                arcs.append([])
            arcs[-1].append(place)
        before = states[place]
    return arcs


def _filled(rows: list[list[int]]) -> Ints:
    """(n, k) the rows, filled up with -1."""
    table = np.full((len(rows), max(4, *(len(row) for row in rows))), -1, dtype=np.int64)
    for n, row in enumerate(rows):
        table[n, : len(row)] = row
    return table


@dataclass(frozen=True, eq=False)
class _Sides:
    """The edges ``ends`` (E, 2) of polygons, the edge of the whole sheet ``parent`` (E,) of each or
    -1, its ``facets`` (E, 2), the second -1 at a border, and the pairs (S, 2) that meet at seams.
    """

    ends: Ints
    parent: Ints
    facets: Ints
    seams: Ints

    @classmethod
    def of(cls, faces: Ints, parents: Ints, meeting: Ints) -> _Sides:
        real = faces >= 0
        heads = np.take_along_axis(faces, next_corners(faces), axis=1)
        pairs = np.sort(np.stack([faces[real], heads[real]], axis=1), axis=1)
        ends, first, edge = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
        facet = np.nonzero(real)[0]
        facets = np.full((len(ends), 2), -1, dtype=np.int64)
        edge = edge.reshape(-1)
        facets[edge, 0] = facet
        second = np.ones(len(facet), dtype=bool)
        second[first] = False
        facets[edge[first], 0] = facet[first]
        facets[edge[second], 1] = facet[second]
        parent = np.full(len(ends), -1, dtype=np.int64)
        np.maximum.at(parent, edge, parents[real])
        border = np.flatnonzero((facets[:, 1] < 0) & (parent >= 0))
        points, point = np.unique(
            np.sort(meeting[ends[border]], axis=1), axis=0, return_inverse=True
        )
        order = np.argsort(point.reshape(-1), kind="stable")
        count = np.bincount(point.reshape(-1), minlength=len(points))
        start = np.cumsum(count) - count
        two = start[count == 2]
        seams = np.stack([border[order[two]], border[order[two + 1]]], axis=1)
        return cls(ends, parent, facets, seams)

    def linked(self, long: Bools) -> Ints:
        """(F,) the part of each facet: over edges that are ``long`` (E,), facets share a crease or
        meet at a seam.
        """
        inner = self.facets[long & (self.facets[:, 1] >= 0)]
        seams = self.facets[self.seams[long[self.seams[:, 0]]], 0]
        return components(int(self.facets.max()) + 1, *np.concatenate([inner, seams]).T)

    def pieces(self) -> Ints:
        """(F,) the piece of each facet: facets that share creases."""
        inner = self.facets[self.facets[:, 1] >= 0]
        return components(int(self.facets.max()) + 1, *inner.T)

    def pinched(self, faces: Ints, area: Floats) -> Ints:
        """The smallest facet at each vertex around which facets form more than one fan.

        Around a vertex, one fan of n facets has n - 1 creases, or n where it is whole.
        """
        count = int(faces.max()) + 1
        around = np.bincount(faces[faces >= 0], minlength=count)
        inner = self.ends[self.facets[:, 1] >= 0]
        creases = np.bincount(inner.ravel(), minlength=count)
        several = np.flatnonzero(around - creases > 1)
        having = [np.flatnonzero((faces == vertex).any(axis=1)) for vertex in several.tolist()]
        return np.array([at[area[at].argmin()] for at in having], dtype=np.int64)


def _pattern(
    pattern: CreasePattern,
    flat: Floats,
    folded: Floats,
    faces: Ints,
    owners: Ints,
    sides: _Sides,
) -> CreasePattern:
    """The pattern of the facets ``faces`` (F, k), which are parts of the facets ``owners`` (F,)."""
    used, numbers = np.unique(np.append(faces, -1), return_inverse=True)
    numbers = numbers.reshape(-1)[:-1].reshape(faces.shape) - 1
    width = int((numbers >= 0).sum(axis=1).max())
    place = np.full(int(used.max()) + 1, -1, dtype=np.int64)
    place[used[1:]] = np.arange(len(used) - 1)
    inner = sides.facets[:, 1] >= 0
    pieces = sides.pieces()
    corner = flat[used[1:]]
    kept = inner & (sides.parent >= 0)
    letters = np.where(kept, pattern.edges_assignment[sides.parent], np.where(inner, "U", "B"))
    trimmed = replace(
        pattern,
        vertices_coords=corner - corner.min(axis=0),
        edges_vertices=place[sides.ends],
        edges_assignment=letters,
        edges_fold_angle=np.where(kept, pattern.edges_fold_angle[sides.parent], 0.0),
        faces_vertices=numbers[:, :width],
        folded_coords=folded[used[1:]],
        grid=None,
        pieces=pieces if pieces.any() else None,
        seams=sides.seams if len(sides.seams) else None,
        cells=None if pattern.cells is None else pattern.cells[owners],
    )
    new = inner & ~kept
    if not new.any():
        return trimmed
    # The outline runs along a crease and back: the crease stays, in parts that had no letter.
    measured = with_angles_of_the_folded_form(trimmed)
    return replace(
        trimmed,
        edges_assignment=np.where(new, measured.edges_assignment, letters),
        edges_fold_angle=np.where(new, measured.edges_fold_angle, trimmed.edges_fold_angle),
    )
