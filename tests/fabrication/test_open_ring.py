"""Closed rings opened at a line of one's choice: the same sheet, cut elsewhere."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from flat_patterns import bed, card, miura, without_grid
from rings import revolved, tube
from scipy.spatial.transform import Rotation
from test_any_layout import assert_sheets, assert_strokes, assert_tabs

import miurafab
from miurafab.errors import LayoutError
from miurafab.fabrication.open_ring import open_ring, opened
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.seams import border_seams
from miurafab.fabrication.sheets import lay_out
from miurafab.geometry.quads import QuadGrid
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cylinder import cylinder_over_polyline
from miurafab.origami.formats.fold import read_fold, write_fold
from miurafab.origami.invariants import EXACT
from miurafab.origami.unfold import unfold
from miurafab.origami.verify import audit
from miurafab.workflow.cut import prepare
from miurafab.workflow.job_directory import read_job
from miurafab.workflow.manifest import read_manifest
from miurafab.workflow.sheets import sheets


@cache
def irregular_tube(columns=6):
    """A closed tube over a star of ten unequal corners, no two lines of which are alike."""
    rng = np.random.default_rng(5)
    turn = 2 * np.pi * (np.arange(10) + rng.uniform(-0.1, 0.1, 10)) / 10
    radius = np.where(np.arange(10) % 2, 42.0, 24.0) + rng.uniform(-2, 2, 10)
    corners = radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    return unfold(cylinder_over_polyline(corners[np.arange(-1, 12) % 10], 15.0, 4.0, columns))


def across(pattern):
    """The same ring closed along its columns: the grid, and the paper, seen from their side."""
    columns, rows = pattern.grid
    old = np.arange(rows * columns).reshape(rows, columns).T.ravel()
    new = np.argsort(old)
    grid = QuadGrid(rows, columns)
    ends = np.sort(new[pattern.edges_vertices], axis=1)
    place = {tuple(pair): k for k, pair in enumerate(ends.tolist())}
    order = [place[tuple(pair)] for pair in grid.edges_vertices.tolist()]
    corner = new[pattern.faces_vertices]
    faces = corner[np.argsort(corner.min(axis=1))]
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    return CreasePattern(
        vertices_coords=pattern.vertices_coords[old] @ quarter,
        edges_vertices=grid.edges_vertices,
        edges_assignment=pattern.edges_assignment[order],
        edges_fold_angle=pattern.edges_fold_angle[order],
        faces_vertices=faces,
        folded_coords=pattern.folded_coords[old],
        grid=(rows, columns),
    )


def shuffled(pattern):
    """The same pattern with facets, edges, ends and corners in another order."""
    rng = np.random.default_rng(1)
    edges = rng.permutation(len(pattern.edges_vertices))
    return replace(
        pattern,
        edges_vertices=pattern.edges_vertices[edges][:, ::-1],
        edges_assignment=pattern.edges_assignment[edges],
        edges_fold_angle=pattern.edges_fold_angle[edges],
        faces_vertices=np.roll(rng.permutation(pattern.faces_vertices), 1, axis=1),
    )


def torus(columns=8, rows=6):
    """A lattice of parallelograms that closes both ways; its folded form is bent, not folded."""
    pattern = miura(columns, rows)
    i, j = np.divmod(np.arange(len(pattern.vertices_coords)), columns + 1)
    v, u = 2 * np.pi * (i % rows) / rows, 2 * np.pi * (j % columns) / columns
    r = 60.0 + 20.0 * np.cos(v)
    return replace(
        pattern, folded_coords=np.stack([r * np.cos(u), r * np.sin(u), 20.0 * np.sin(v)], axis=-1)
    )


RINGS = {
    "ring": (lambda: revolved("6x16", "220mm"), 0),
    "tube": (tube, 0),
    "irregular tube": (irregular_tube, 0),
    "tube along its columns": (lambda: across(irregular_tube()), 1),
    "ring of fifty rows": (lambda: revolved("8x50", "600mm"), 0),
}


@cache
def ring_of(name):
    """The pattern of that name, and the axis along which it closes."""
    make, axis = RINGS[name]
    return make(), axis


@pytest.fixture(scope="module", params=RINGS)
def ring(request):
    return ring_of(request.param)


def lines_of(pattern, axis):
    """The edges on each row (0) or column (1) of vertices, in the order of the grid."""
    columns, rows = pattern.grid
    count = rows * (columns - 1)
    along = np.arange(count).reshape(rows, columns - 1)
    beside = np.arange(count, len(pattern.edges_vertices)).reshape(rows - 1, columns)
    return along if axis == 0 else beside.T


def count_of(pattern, axis):
    """How many rows or columns of facets it has."""
    return pattern.grid[1 - axis] - 1


def some_lines(pattern, axis):
    count = count_of(pattern, axis)
    return sorted({1, 2, count // 2, count - 1})


def facets_in_space(pattern):
    """The facets as sets of points in space, in an order that says nothing of their numbers, and
    what brings the pattern's facets into it.
    """
    corners = np.round(pattern.folded_coords[pattern.faces_vertices], 6) + 0.0
    middle = np.round(corners.mean(axis=1), 4) + 0.0
    order = np.lexsort(middle.T)
    return pattern.folded_coords[pattern.faces_vertices][order], order


def spans(points, faces):
    """(F, 4, 4) all distances within each facet."""
    corners = points[faces]
    return np.linalg.norm(corners[:, :, None] - corners[:, None], axis=-1)


def assert_same_pattern(one, other):
    assert one.grid == other.grid
    size = float(np.ptp(one.vertices_coords, axis=0).max())
    np.testing.assert_allclose(one.vertices_coords, other.vertices_coords, atol=1e-12 * size)
    np.testing.assert_allclose(one.folded_coords, other.folded_coords, atol=1e-12 * size)
    np.testing.assert_array_equal(one.edges_vertices, other.edges_vertices)
    np.testing.assert_array_equal(one.edges_assignment, other.edges_assignment)
    np.testing.assert_allclose(one.edges_fold_angle, other.edges_fold_angle, atol=1e-11)
    np.testing.assert_array_equal(one.faces_vertices, other.faces_vertices)
    assert (one.scale, one.target) == (other.scale, other.target)


def test_opened_and_opened_back_it_is_what_it_was(ring):
    pattern, axis = ring
    # Opened once all stands in the order and the place of every opened pattern.
    for line in some_lines(pattern, axis):
        there = open_ring(pattern, axis, line)
        back = open_ring(there, axis, count_of(pattern, axis) - line)
        if axis == 0:
            assert_same_pattern(back, pattern)
        again = open_ring(back, axis, line)
        assert_same_pattern(again, there)


def test_opened_twice_it_is_opened_once_at_the_sum(ring):
    pattern, axis = ring
    count = count_of(pattern, axis)
    first, second = 2, count - 3
    once = open_ring(pattern, axis, count - 1)
    assert_same_pattern(open_ring(open_ring(pattern, axis, first), axis, second), once)


def test_a_ring_opened_a_period_farther_is_laid_out_alike():
    """All periods of a revolved ring are the same, so the flat pattern is, too."""
    pattern, _ = ring_of("ring")
    for line in range(2, count_of(pattern, 0), 2):
        there = open_ring(pattern, 0, line)
        np.testing.assert_allclose(there.vertices_coords, pattern.vertices_coords, atol=1e-9)
        np.testing.assert_array_equal(there.edges_assignment, pattern.edges_assignment)
        np.testing.assert_allclose(there.edges_fold_angle, pattern.edges_fold_angle, atol=1e-9)


def test_it_is_the_same_sheet_in_space_and_every_facet_keeps_its_shape(ring):
    pattern, axis = ring
    before, order = facets_in_space(pattern)
    flat = spans(pattern.vertices_coords, pattern.faces_vertices)[order]
    size = float(np.ptp(pattern.folded_coords))
    for line in some_lines(pattern, axis):
        there = open_ring(pattern, axis, line)
        after, order = facets_in_space(there)
        np.testing.assert_allclose(after, before, atol=1e-12 * size)
        now = spans(there.vertices_coords, there.faces_vertices)[order]
        np.testing.assert_allclose(now, flat, atol=1e-12 * size)
        x, y = np.moveaxis(there.vertices_coords[there.faces_vertices], -1, 0)
        doubled = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
        assert (doubled > 0).all(), "counter-clockwise"


def test_every_invariant_holds_at_the_joint(ring):
    pattern, axis = ring
    before = audit(pattern).measurements
    for line in some_lines(pattern, axis):
        found = audit(open_ring(pattern, axis, line))
        assert found.valid, found.findings
        measured = found.measurements
        assert measured.max_planarity <= EXACT
        assert measured.max_developability <= EXACT
        assert measured.max_isometry <= EXACT
        assert measured.vertices == before.vertices
        assert measured.min_edge_mm == pytest.approx(before.min_edge_mm, rel=1e-12)


def test_seam_and_line_change_places(ring):
    pattern, axis = ring
    seams, lines = border_seams(pattern), lines_of(pattern, axis)
    for line in some_lines(pattern, axis):
        there = open_ring(pattern, axis, line)
        joint = lines[count_of(pattern, axis) - line]
        np.testing.assert_array_equal(there.edges_assignment[joint], seams.fold)
        np.testing.assert_array_equal(border_seams(there).edges, lines[[0, -1]].T)
        letters = pattern.edges_assignment[lines[line]]
        np.testing.assert_array_equal(border_seams(there).fold, letters)
        assert (there.edges_assignment[lines[[0, -1]]] == "B").all()
        assert (there.edges_fold_angle[lines[[0, -1]]] == 0.0).all()
        # Where the fold of every crease is known, it is what it was.
        inner = (there.edges_faces >= 0).all(axis=1)
        folds = np.sort(there.edges_fold_angle[inner & (there.edges_assignment != "B")])
        closed = np.sort(fold_angles_of_the_closed_sheet(pattern, axis, line))
        np.testing.assert_allclose(folds, closed, atol=1e-11)


def fold_angles_of_the_closed_sheet(pattern, axis, line):
    """The fold angles of ``pattern`` with the one of its seam for those on ``line``: the seam's
    from the two facets on it in space.
    """
    kept = pattern.edges_assignment != "B"
    kept[lines_of(pattern, axis)[line]] = False
    seams = border_seams(pattern)
    corners = pattern.folded_coords[pattern.faces_vertices[seams.faces]]
    one, other = corners[..., 2, :] - corners[..., 0, :], corners[..., 3, :] - corners[..., 1, :]
    normal = np.cross(one, other)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    cosine = np.einsum("sk,sk->s", normal[:, 0], normal[:, 1])
    sine = np.linalg.norm(np.cross(normal[:, 0], normal[:, 1]), axis=1)
    angle = np.arctan2(sine, cosine) * np.where(seams.fold == "V", 1.0, -1.0)
    return np.concatenate([pattern.edges_fold_angle[kept], angle])


def test_the_order_in_the_file_does_not_matter(ring):
    pattern, axis = ring
    wanted, found = open_ring(pattern, axis, 3), open_ring(shuffled(pattern), axis, 3)
    assert_same_pattern(
        replace(found, faces_vertices=np.sort(found.faces_vertices, axis=1)),
        replace(wanted, faces_vertices=np.sort(wanted.faces_vertices, axis=1)),
    )


def test_a_pattern_that_closes_both_ways_is_opened_both_ways():
    pattern = torus()
    both = opened(pattern, LayoutOptions(open_row=2, open_column=4))
    columns, rows = pattern.grid
    folded = pattern.folded_coords.reshape(rows, columns, 3)[:-1, :-1]
    moved = np.roll(np.roll(folded, -2, axis=0), -4, axis=1)
    np.testing.assert_allclose(both.folded_coords.reshape(rows, columns, 3)[:-1, :-1], moved)
    # A lattice, moved by any even number of its rows, is the same lattice.
    np.testing.assert_allclose(both.vertices_coords, pattern.vertices_coords, atol=1e-12)
    seams = {tuple(pair) for pair in border_seams(both).edges.tolist()}
    for axis in (0, 1):
        assert {tuple(pair) for pair in lines_of(both, axis)[[0, -1]].T.tolist()} <= seams


def mismatched():
    """A tube whose last row has the right lengths and turns the other way in the flat pattern."""
    pattern = irregular_tube()
    columns, rows = pattern.grid
    flat = pattern.vertices_coords.reshape(rows, columns, 2).copy()
    start, end = complex(*flat[-1, 0]), complex(*flat[-1, -1])
    way = (end - start) / abs(end - start)
    turned = start + way * np.conj((flat[-1] @ [1, 1j] - start) / way)
    flat[-1] = np.stack([turned.real, turned.imag], axis=-1)
    return replace(pattern, vertices_coords=flat.reshape(-1, 2))


@pytest.mark.parametrize(
    ("make", "axis", "line", "why"),
    [
        pytest.param(
            lambda: replace(without_grid(tube()), folded_coords=tube().folded_coords),
            0, 3, "the facets of this pattern do not form a grid.", id="no grid",
        ),
        pytest.param(
            lambda: replace(tube(), faces_vertices=tube().faces_vertices[1:]),
            0, 3, "the facets of this pattern do not form a grid.", id="a facet is missing",
        ),
        pytest.param(
            lambda: replace(tube(), folded_coords=None), 0, 3,
            "where it closes is seen in the folded form, which is missing.", id="flat alone",
        ),
        pytest.param(
            lambda: revolved("6x16", "220mm", close="open"), 0, 3,
            "its first and last row do not come together in the folded form.", id="no ring",
        ),
        pytest.param(
            tube, 1, 3,
            "its first and last column do not come together in the folded form; it closes along "
            "its rows.", id="the other way",
        ),
        pytest.param(tube, 0, 12, "with 12 rows it may be 1 to 11.", id="beyond"),
        pytest.param(tube, 0, 0, "with 12 rows it may be 1 to 11.", id="where it is open"),
    ],
)  # fmt: skip
def test_what_cannot_be_opened_is_refused_in_a_sentence(make, axis, line, why):
    pattern = make()
    name = ("row", "column")[axis]
    with pytest.raises(LayoutError) as refusal:
        open_ring(pattern, axis, line)
    assert str(refusal.value) == f"The ring cannot be opened after {name} {line}: {why}"


def test_ends_that_are_not_congruent_are_refused_by_how_far_they_are_apart():
    pattern = mismatched()
    columns, rows = pattern.grid
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1))).reshape(rows, columns, 3)
    first, last = flat[0] - flat[0].mean(axis=0), flat[-1] - flat[-1].mean(axis=0)
    # The best turn, by another program; a far point on the axis keeps it in the plane.
    upright = np.array([[0.0, 0.0, 1e6]])
    turn, _ = Rotation.align_vectors(np.vstack([first, upright]), np.vstack([last, upright]))
    apart = np.linalg.norm(turn.apply(last) - first, axis=1).max()
    assert apart > 10.0
    with pytest.raises(LayoutError, match=f"its two ends differ by up to {apart:.3g} mm"):
        open_ring(pattern, 0, 3)


@pytest.mark.parametrize("size", [(1200.0, 900.0), (260.0, 200.0)], ids=["whole", "patches"])
@pytest.mark.parametrize("side", ["lower", "alternate"])
@pytest.mark.parametrize("name", ["ring", "tube", "irregular tube", "tube along its columns"])
def test_every_crease_of_an_opened_ring_is_made_once_and_every_tab_glued(name, size, side):
    pattern, axis = ring_of(name)
    machine, material = bed(*size), card()
    line = 3
    options = LayoutOptions(
        tab_side=side, **{("open_row", "open_column")[axis]: line}, seam_rows=(2,)
    )
    layout = lay_out(pattern, machine, material, options=options)
    there = layout.pattern
    assert_same_pattern(there, open_ring(pattern, axis, line))
    assert_tabs(there, layout)
    assert_strokes(there, material, options, layout)
    assert_sheets(machine, options, layout)
    seam = {frozenset(pair) for pair in lines_of(there, axis)[[0, -1]].T.tolist()}
    tabs = [tab for patch in layout.patches for tab in patch.tabs]
    assert {frozenset((t.edge, t.mate_edge)) for t in tabs if t.edge != t.mate_edge} == seam


def test_without_the_option_the_pattern_is_the_one_given():
    pattern = tube()
    assert lay_out(pattern, bed(400.0, 300.0), card()).pattern is pattern


def test_the_job_holds_the_pattern_that_its_layout_names(tmp_path):
    source = tmp_path / "tube.fold"
    write_fold(tube(), source, "A tube")
    text = source.read_bytes()
    for folder in (tmp_path / "job", tmp_path):
        made = sheets(source, open_row=5).write(folder)
        document = json.loads((folder / "layout.json").read_text())
        file = folder / document["pattern"]["file"]
        assert file.name == "tube-opened.fold"
        assert hashlib.sha256(file.read_bytes()).hexdigest() == document["pattern"]["sha256"]
        assert source.read_bytes() == text
        assert_same_pattern(read_fold(file), open_ring(tube(), 0, 5))
        assert audit(read_fold(file)).valid
        faces = sorted(face for patch in document["patches"] for face in patch["faces"])
        assert faces == list(range(len(read_fold(file).faces_vertices)))
        assert_tabs(read_fold(file), read_job(folder).layout)
        shown = miurafab.preview(folder)
        assert_same_pattern(shown.pattern, made.layout.pattern)
        assert not any("not there" in finding.sentence for finding in shown.findings)
    first, second = (tmp_path / "job" / "layout.json", tmp_path / "layout.json")
    assert first.read_bytes() == second.read_bytes()


def test_a_design_says_where_its_ring_is_opened(tmp_path):
    file = tmp_path / "waist.toml"
    file.write_text(
        'facets = "4x8"\nsize = "140mm"\nclose = "seam"\n'
        '[target]\nsurface = "cylinder"\n'
        "[layout]\nopen_row = 3\n"
    )
    prepared = prepare(str(file), out=tmp_path / "job")
    document = json.loads((tmp_path / "job" / "layout.json").read_text())
    assert document["pattern"]["file"] == "waist-opened.fold"
    fitted = read_fold(tmp_path / "job" / "waist.fold")
    laid_out = read_fold(tmp_path / "job" / "waist-opened.fold")
    assert_same_pattern(laid_out, open_ring(fitted, 0, 3))
    assert_tabs(laid_out, prepared.directory.layout)
    # Both are files of the job, put in place with it; another job may take its place.
    assert {"waist.fold", "waist-opened.fold"} <= set(read_manifest(tmp_path / "job").files)
    assert miurafab.check_job(tmp_path / "job").valid
    file.write_text(file.read_text().replace("140mm", "150mm"))
    prepare(str(file), out=tmp_path / "job")
    assert miurafab.check_job(tmp_path / "job").valid


def test_the_seams_of_a_ring_that_is_opened_are_those_of_its_new_ends():
    pattern = tube()
    closed = replace(pattern, seams=border_seams(pattern).edges)
    made = open_ring(closed, 0, 5)
    assert np.array_equal(made.seams, border_seams(replace(made, seams=None)).edges)
    assert len(made.seams) == len(closed.seams)


def test_edges_that_are_not_those_of_a_grid_are_told():
    """One side is a diagonal: as many edges as a grid has, and not the same."""
    pattern = tube()
    ends = pattern.edges_vertices.copy()
    ends[0] = pattern.faces_vertices[0, [0, 2]]
    with pytest.raises(LayoutError, match="the facets of this pattern do not form a grid"):
        open_ring(replace(pattern, edges_vertices=ends), 0, 5)
