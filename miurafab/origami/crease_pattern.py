"""The crease pattern: one mesh with two shapes, flat paper and folded form.

Arrays carry their FOLD names. A crease is an edge with an assignment (B border, M mountain,
V valley, F flat, U unassigned, C cut, J join) and a fold angle, positive for a valley, measured
from flat (FOLD 1.2, https://github.com/edemaine/fold).

A pattern may have several pieces. They lie apart in the flat pattern and meet along seams in the
folded form. The vertices of a seam are doubled: each piece has its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from miurafab.display import Shown
from miurafab.errors import OptionError, PatternError
from miurafab.files import AnyPath
from miurafab.findings import Finding
from miurafab.geometry.arrays import Bools, Floats, Ints
from miurafab.options import Choice, read_value
from miurafab.surfaces.frame import origin_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LARGEST_MM = 1e9
"""No coordinate is farther from the origin: squares of areas stay finite."""

ASSIGNMENTS = ("B", "M", "V", "F", "U", "C", "J")

UNCREASED = ("F", "J")
"""The letters of edges that do not fold: the facets beside them move as one."""


@dataclass(frozen=True, eq=False, repr=False)
class CreasePattern(Shown):
    """A crease pattern of V vertices, E edges and F facets.

    Parameters
    ----------
    vertices_coords : (V, 2) float64
        The flat pattern, mm.
    edges_vertices : (E, 2) int64
        The two ends of each edge.
    edges_assignment : (E,) str
        One letter for each edge: B border, M mountain, V valley, F flat, U unassigned, C cut,
        J join.
    edges_fold_angle : (E,) float64
        Radians from flat, positive for a valley.
    faces_vertices : (F, k) int64
        The corners of each facet, counter-clockwise in the flat pattern. A facet with fewer than
        k corners is filled up with -1.
    folded_coords : (V, 3) float64, optional
        The folded form, mm. None where only the flat pattern is known.
    grid : (int, int), optional
        Columns and rows of vertices, where the vertices form a grid in row-major order.
    pieces : (F,) int64, optional
        The piece of each facet, numbered from 0. None for one piece.
    seams : (S, 2) int64, optional
        The pairs of border edges that meet in the folded form. None for no seam.
    cells : (F, 2) int64, optional
        The column and row of each facet in the lattice of the tessellation.
    scale : float
        The folded form lies on ``scale`` times the target, relative to :attr:`origin`.
    target : dict
        The surface and its parameters (:mod:`miurafab.surfaces.description`).
    target_kept : bool, optional
        Whether target and scale are those that the file of the pattern was written with. None
        where the file does not tell.
    angles_assumed : bool
        Whether the fold angles are not known, and taken as 180 degrees.
    unfolded : float, optional
        The residual to which the flat pattern fits, where it was computed from the folded form of a
        file that has no flat one (:mod:`miurafab.origami.flattening`).
    rounded : float, optional
        The residual that the rounding of a file of few digits leaves between its two forms
        (:mod:`miurafab.origami.formats.two_forms`).
    told : tuple of Finding
        What the reader of its file changed, left out or assumed.

    Raises
    ------
    PatternError
        For arrays that do not fit together, and for coordinates that are not finite.
    """

    vertices_coords: Floats
    edges_vertices: Ints
    edges_assignment: NDArray[np.str_]
    edges_fold_angle: Floats
    faces_vertices: Ints
    folded_coords: Floats | None = None
    grid: tuple[int, int] | None = None
    pieces: Ints | None = None
    seams: Ints | None = None
    cells: Ints | None = None
    scale: float = 1.0
    target: dict[str, Any] = field(default_factory=dict)
    target_kept: bool | None = True
    angles_assumed: bool = False
    unfolded: float | None = None
    rounded: float | None = None
    told: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        vertices, edges = len(self.vertices_coords), len(self.edges_vertices)
        if not (np.abs(self.vertices_coords) < LARGEST_MM).all():
            raise PatternError(
                "The flat pattern holds a coordinate that is not a finite number below 1e9 mm."
            )
        if self.folded_coords is not None:
            if self.folded_coords.shape != (vertices, 3):
                raise PatternError("The folded form does not have one 3D point for each vertex.")
            if not (np.abs(self.folded_coords) < LARGEST_MM).all():
                raise PatternError(
                    "The folded form holds a coordinate that is not a finite number below 1e9 mm."
                )
        if len(self.edges_assignment) != edges or len(self.edges_fold_angle) != edges:
            raise PatternError("The pattern does not have one assignment and angle for each edge.")
        wrong = ~(np.abs(self.edges_fold_angle) <= 2 * np.pi)
        if wrong.any():
            edge, angle = int(np.argmax(wrong)), np.degrees(self.edges_fold_angle[np.argmax(wrong)])
            why = "more than a full turn" if np.isfinite(angle) else "not a finite number"
            raise PatternError(f"The fold angle of edge {edge} is {why}.")
        for name, indices in (
            ("edges_vertices", self.edges_vertices),
            ("faces_vertices", self.faces_vertices),
        ):
            if indices.size and (indices.max() >= vertices or indices.min() < -1):
                raise PatternError(f"{name} refers to a vertex that does not exist.")
        if self.grid is not None and self.grid[0] * self.grid[1] != vertices:
            raise PatternError(f"The grid {self.grid} does not have {vertices} vertices.")
        if self.cells is not None and self.cells.shape != (len(self.faces_vertices), 2):
            raise PatternError("The cells do not have one column and row for each facet.")
        if self.pieces is not None:
            _check_pieces(self.pieces, self.faces_vertices, vertices)
        if self.seams is not None:
            _check_seams(self.seams, self.edges_assignment)

    @property
    def origin(self) -> Floats:
        """(3,) where the origin of ``folded_coords`` lies in the frame of ``scale`` times the
        target, mm: zeros but for a target that lies far from its own origin
        (:mod:`miurafab.surfaces.frame`).
        """
        return np.asarray(self.scale * origin_in(self.target))

    @property
    def pieces_count(self) -> int:
        """The number of pieces."""
        return 1 if self.pieces is None else int(self.pieces.max(initial=0)) + 1

    @property
    def name(self) -> str:
        """What the target is called, empty for none."""
        target = self.target
        if "mesh" in target:
            return Path(str(target["mesh"])).stem
        return str(target.get("surface", target.get("name", "")))

    def scaled(self, factor: float) -> CreasePattern:
        """The same pattern, ``factor`` times as large flat and folded."""
        folded = self.folded_coords
        return replace(
            self,
            vertices_coords=factor * self.vertices_coords,
            folded_coords=None if folded is None else factor * folded,
            scale=factor * self.scale,
        )

    def chosen_form(self, form: str | None) -> str:
        """``flat`` or ``folded``; None is folded where there is a folded form.

        Raises :class:`~miurafab.errors.OptionError`.
        """
        there = self.folded_coords is not None
        if form is None:
            return "folded" if there else "flat"
        if read_value("form", Choice(("flat", "folded")), form) == "folded" and not there:
            raise OptionError("form", "is folded, and the pattern has no folded form; leave it out")
        return form

    def save(self, path: AnyPath, *, title: str = "", form: str | None = None) -> None:
        """Write the pattern to ``path``, in the format of its ending.

        Parameters
        ----------
        path : str or os.PathLike
            A ``.fold``, ``.svg``, ``.dxf``, ``.cp``, ``.opx``, ``.obj``, ``.stl`` or ``.glb`` file.
        title : str
            The title inside the file. The default is the name of the target.
        form : {"folded", "flat"}, optional
            What an ``.obj``, ``.stl`` or ``.glb`` shows. The default is the folded form where there
            is one.

        Raises
        ------
        InputError
            For another ending, and for a folder that does not exist.
        """
        from miurafab.origami.formats.files import write_pattern

        write_pattern(self, path, title=title or self.name, form=form)

    def plot(self, form: str | None = None, ax: Axes | None = None) -> Axes:
        """Draw the pattern with matplotlib.

        Parameters
        ----------
        form : {"folded", "flat"}, optional
            The default is the folded form where there is one.
        ax : matplotlib Axes, optional
            Where to draw; three-dimensional axes for the folded form. The default is a new figure.

        Returns
        -------
        matplotlib Axes
            ``.figure.savefig("pattern.png")`` writes it to a file.
        """
        from miurafab.origami.pattern_plot import draw_flat, draw_folded
        from miurafab.origami.plotting import shown

        if self.chosen_form(form) == "folded":
            axes = shown((6.4, 5.0), ax, projection="3d")
            draw_folded(self, axes)
        else:
            axes = shown((6.4, 5.0), ax)
            draw_flat(self, axes)
        return axes

    def _summary(self) -> str:
        width, height = np.ptp(self.vertices_coords, axis=0).tolist()
        form = "with folded form" if self.folded_coords is not None else "without folded form"
        of = f", of {self.name}" if self.name else ""
        pieces = f" in {self.pieces_count} pieces" if self.pieces_count > 1 else ""
        return (
            f"{len(self.faces_vertices)} facets{pieces}, {len(self.vertices_coords)} vertices, "
            f"{width:.4g} x {height:.4g} mm flat, {form}{of}"
        )

    def _picture(self) -> str:
        from miurafab.origami.picture import MOST_FACETS, pattern_svg

        return pattern_svg(self) if len(self.faces_vertices) <= MOST_FACETS else ""

    def _facts(self) -> Mapping[str, object]:
        width, height = np.ptp(self.vertices_coords, axis=0).tolist()
        letters = self.edges_assignment
        return {
            "facets": len(self.faces_vertices),
            "pieces": self.pieces_count,
            "vertices": len(self.vertices_coords),
            "mountains": int((letters == "M").sum()),
            "valleys": int((letters == "V").sum()),
            "flat size": f"{width:.4g} x {height:.4g} mm",
            "target": self.name or "none",
        }

    @property
    def edges_creased(self) -> Bools:
        """(E,) whether an edge lies between two facets and folds, or may fold (letters M, V, U)."""
        inner = (self.edges_faces >= 0).all(axis=1)
        return np.asarray(inner & np.isin(self.edges_assignment, ("M", "V", "U")))

    @cached_property
    def faces_edges(self) -> Ints:
        """(F, k) index of the edge from each face corner to the next, -1 where there is none."""
        return self._faces_edges_and_edges_faces[0]

    @cached_property
    def edges_faces(self) -> Ints:
        """(E, 2) the faces left and right of each edge in its own direction, -1 for none."""
        return self._faces_edges_and_edges_faces[1]

    @cached_property
    def seam_vertices(self) -> Ints:
        """(S, 2, 2) the pairs of vertices that meet at the two ends of each seam.

        Facets run counter-clockwise seen from one side of the sheet. So two facets run along their
        seam in opposite directions, and the end of one edge meets the start of the other.

        Raises :class:`~miurafab.errors.PatternError` for a seam edge that is no border.
        """
        seams = np.empty((0, 2), dtype=np.int64) if self.seams is None else self.seams
        owners = self.edges_faces[seams] >= 0
        inner = np.flatnonzero((owners.sum(axis=2) != 1).any(axis=1))
        if len(inner):
            one, other = seams[inner[0]].tolist()
            raise PatternError(f"The seam of edges {one} and {other} does not join two borders.")
        along = owners[:, :, :1]
        ends = np.where(along, self.edges_vertices[seams], self.edges_vertices[seams][:, :, ::-1])
        return np.stack([ends[:, 0], ends[:, 1, ::-1]], axis=2)

    @cached_property
    def _faces_edges_and_edges_faces(self) -> tuple[Ints, Ints]:
        faces, k = self.faces_vertices.shape
        count = (self.faces_vertices >= 0).sum(axis=1)
        slot = np.broadcast_to(np.arange(k), (faces, k))
        following = np.where(slot + 1 < count[:, None], slot + 1, 0)
        tail = self.faces_vertices
        head = np.take_along_axis(self.faces_vertices, following, axis=1)
        vertices = len(self.vertices_coords)
        key = np.minimum(tail, head) * vertices + np.maximum(tail, head)
        ends = np.sort(self.edges_vertices, axis=1)
        edge_keys = ends[:, 0] * vertices + ends[:, 1]
        order = np.argsort(edge_keys)
        place = np.searchsorted(edge_keys, key, sorter=order).clip(max=max(len(order) - 1, 0))
        found = order[place]
        real = tail >= 0
        if np.any(real & (edge_keys[found] != key)):
            lone = int(np.argmax((real & (edge_keys[found] != key)).any(axis=1)))
            raise PatternError(f"A side of facet {lone} is not among edges_vertices.")
        faces_edges = np.where(real, found, -1)
        edges_faces = np.full((len(self.edges_vertices), 2), -1, dtype=np.int64)
        face, corner = np.nonzero(real)
        edge = faces_edges[face, corner]
        right = (self.edges_vertices[edge, 0] != tail[face, corner]).astype(np.int64)
        _, first, which = np.unique(edge * 2 + right, return_index=True, return_inverse=True)
        if len(first) != len(edge):
            order = first[which.reshape(-1)]
            again = int(np.argmax(order != np.arange(len(edge))))
            raise PatternError(
                f"Facets {face[order[again]]} and {face[again]} lie on the same side of "
                f"edge {edge[again]}."
            )
        edges_faces[edge, right] = face
        return faces_edges, edges_faces


def restricted(
    pattern: CreasePattern, vertices: Ints, edges: Ints, faces: Ints, **others: Any
) -> CreasePattern:
    """``pattern`` with these ``vertices`` and ``edges`` alone, by their numbers in ascending order,
    and with ``faces`` (F, k), whose corners have the old numbers. ``others`` are further fields.
    """
    number = np.full(len(pattern.vertices_coords) + 1, -1, dtype=np.int64)  # the last maps -1
    number[vertices] = np.arange(len(vertices))
    folded = pattern.folded_coords
    return replace(
        pattern,
        vertices_coords=pattern.vertices_coords[vertices],
        edges_vertices=number[pattern.edges_vertices[edges]],
        edges_assignment=pattern.edges_assignment[edges],
        edges_fold_angle=pattern.edges_fold_angle[edges],
        faces_vertices=number[faces],
        folded_coords=None if folded is None else folded[vertices],
        **others,
    )


def _check_pieces(pieces: Ints, faces: Ints, vertices: int) -> None:
    if pieces.shape != (len(faces),):
        raise PatternError("The pieces do not have one number for each facet.")
    numbers = np.unique(pieces)
    if not np.array_equal(numbers, np.arange(len(numbers))):
        raise PatternError("The pieces are not numbered from 0 without a gap.")
    real = faces >= 0
    owner = np.full(vertices, -1, dtype=np.int64)
    each = np.broadcast_to(pieces[:, None], faces.shape)[real]
    owner[faces[real]] = each
    shared = np.flatnonzero(owner[faces[real]] != each)
    if len(shared):
        raise PatternError(
            f"Vertex {faces[real][shared[0]]} belongs to facets of two pieces; each piece needs a "
            "vertex of its own."
        )


def _check_seams(seams: Ints, assignment: NDArray[np.str_]) -> None:
    if seams.ndim != 2 or seams.shape[1] != 2:
        raise PatternError("The seams are not a list of two edges each.")
    if seams.size and (seams.min() < 0 or seams.max() >= len(assignment)):
        raise PatternError("A seam refers to an edge that does not exist.")
    edges, uses = np.unique(seams, return_counts=True)
    if (uses > 1).any():
        raise PatternError(f"Edge {edges[uses > 1][0]} is in two seams; an edge has one mate.")
    inner = edges[assignment[edges] != "B"]
    if len(inner):
        raise PatternError(f"Edge {inner[0]} is in a seam and is no border (B).")
