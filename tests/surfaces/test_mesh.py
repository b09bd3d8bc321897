"""Mesh files: what is refused and in which words, and what a good one becomes."""

from __future__ import annotations

import gzip
import json
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from problems import saddle_mesh

from miurafab.errors import InputError, TargetError
from miurafab.origami.formats.fold import read_fold
from miurafab.surfaces.mesh import MeshChart, load_mesh, mesh_surface
from miurafab.surfaces.placement import ANGLES, Region
from miurafab.surfaces.surface import tangents
from miurafab.workflow.design import design
from miurafab.workflow.patterns import check


def square(count: int = 9, size: float = 100.0) -> tuple[np.ndarray, np.ndarray]:
    grid = np.linspace(0, size, count)
    x, y = np.meshgrid(grid, grid)
    points = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    index = np.arange(count * count).reshape(count, count)
    a, b, c, d = (
        q.ravel() for q in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    )
    return points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def written(path: Path, vertices: np.ndarray, faces: np.ndarray) -> Path:
    """An OFF file, byte by byte, so that nothing is tidied up on the way."""
    lines = [f"OFF\n{len(vertices)} {len(faces)} 0"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices).tolist()]
    lines += [f"3 {a} {b} {c}" for a, b, c in np.asarray(faces).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def nan(v, f):
    v[7, 1] = math.nan
    return v, f


def infinite(v, f):
    v[7, 1] = math.inf
    return v, f


def two_pieces(v, f):
    return np.concatenate([v, v + np.array([0, 0, 50])]), np.concatenate([f, f + len(v)])


def confetti(v, f):
    """Each triangle by itself, with gaps too wide to be welded."""
    v, f = square(16)
    p = v[f]
    p = p.mean(axis=1, keepdims=True) + 0.8 * (p - p.mean(axis=1, keepdims=True))
    return p.reshape(-1, 3), np.arange(3 * len(f)).reshape(-1, 3)


def fin(v, f):
    """A third triangle on an inner edge."""
    return np.concatenate([v, [[50, 50, 30]]]), np.concatenate([f, [[f[40, 0], f[40, 1], len(v)]]])


def twice(v, f):
    return v, np.concatenate([f, f])


def flat_triangles(v, f):
    return v * [1, 0, 0], f


def one_point(v, f):
    return v * 0, f


def large_hole(v, f):
    middle = v[f].mean(axis=1)
    return v, f[np.abs(middle - [50, 50, 0]).max(axis=1) > 25]


def waist_of_nothing(v, f):
    """Two squares that touch in one vertex."""
    middle = v[f].mean(axis=1)
    return v, f[((middle[:, 0] < 50) == (middle[:, 1] < 50))]


def moebius(v, f):
    t, w = np.meshgrid(np.linspace(0, 2 * np.pi, 40, endpoint=False), np.linspace(-1, 1, 5))
    r = 3 + w * np.cos(t / 2)
    points = np.stack([r * np.cos(t), r * np.sin(t), w * np.sin(t / 2)], axis=-1).reshape(-1, 3)
    faces = []
    for j in range(4):
        for i in range(40):
            a, d = j * 40 + i, (j + 1) * 40 + i
            b, c = (a + 1, d + 1) if i < 39 else ((4 - j) * 40, (3 - j) * 40)
            faces += [[a, b, c], [a, c, d]]
    return points, np.array(faces)


def handle(v, f):
    torus = trimesh.creation.torus(30, 10)
    faces = np.asarray(torus.faces)
    return torus.vertices, faces[(faces != 0).all(axis=1)]


def book(v, f):
    """Three pages at a spine; the first two joined at their outer edges, the others above."""
    turn = np.radians([0, 100, 220])
    outer = 50 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    low, high = (np.column_stack([outer, np.full(3, z)]) for z in (0.0, 50.0))
    points = np.concatenate([[[0, 0, 0], [0, 0, 50.0]], low, high])
    pages = [t for k in (2, 3, 4) for t in ([0, k, k + 3], [0, k + 3, 1])]
    return points, np.array([*pages, [2, 3, 6], [2, 6, 5], [1, 6, 7]])


REFUSED = {
    book: "is not a surface: one edge has more than two triangles",
    nan: "vertex .* not a finite number",
    infinite: "vertex .* not a finite number",
    confetti: "450 separate pieces, and the largest has only",
    flat_triangles: "all triangles are degenerate",
    one_point: "all triangles lie in one point",
    large_hole: "has a hole .* mm across, too large",
    moebius: "one side only",
    handle: "has a handle",
}


KEPT = {two_pieces: 0.5, fin: 0.91, twice: 1.0, waist_of_nothing: 0.5}
"""Faults that are mended, and the part of the file's area that is kept, at least."""


@pytest.mark.parametrize("broken", KEPT, ids=lambda b: b.__name__)
def test_parts_beside_the_largest_piece_are_left_out_and_said(broken):
    vertices, faces = broken(*square())
    surface = mesh_surface(vertices, faces, "mesh.off")
    left_out = [f for f in surface.findings if f.code == "pieces-left-out"]
    assert len(left_out) == (0 if broken is twice else 1)
    edges = vertices[faces] - vertices[np.roll(faces, 1, axis=1)]
    whole = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum() / 2
    corners = surface.layout.vertices[surface.layout.faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    share = area.sum() / 2 / whole
    assert share >= (KEPT[broken] if broken is not twice else 0.5) - 1e-9
    if left_out:
        assert f"{100 * (1 - share):.2g} % of the area" in left_out[0].sentence
        assert left_out[0].severity == "warning"


@pytest.mark.parametrize("broken", REFUSED, ids=lambda b: b.__name__)
def test_one_true_sentence_for_each_fault(tmp_path, broken):
    path = written(tmp_path / "mesh.off", *broken(*square()))
    with pytest.raises(TargetError, match=REFUSED[broken]) as refusal:
        load_mesh(path)
    sentence = str(refusal.value)
    assert "mesh.off" in sentence
    assert sentence.endswith(".")
    assert "\n" not in sentence


FILES = {
    "missing.off": (None, "does not exist"),
    "empty.off": (b"", "cannot be read as a mesh|holds no tri"),
    "empty.obj": (b"", "cannot be read as a mesh|holds no tri"),
    "empty.stl": (b"", "cannot be read as a mesh|holds no tri"),
    "empty.ply": (b"", "cannot be read as a mesh|holds no tri"),
    "empty.glb": (b"", "cannot be read as a mesh|holds no tri"),
    "text.off": (b"Dear Sir or Madam,\n", "cannot be read as a mesh|holds no tri"),
    "text.obj": (b"Dear Sir or Madam,\n", "cannot be read as a mesh|holds no tri"),
    "text.stl": (b"Dear Sir or Madam,\n" * 9, "cannot be read as a mesh|holds no tri"),
    "text.ply": (b"Dear Sir or Madam,\n", "cannot be read as a mesh|holds no tri"),
    "text.glb": (b"Dear Sir or Madam,\n", "cannot be read as a mesh|holds no tri"),
    "points.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "is a point cloud and not a surface; make"),
    "wild.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "cannot be read|does not exist"),
    "sheet.dae": (b"<COLLADA/>", "is not a mesh file"),
    "sheet.step.zip": (b"PK", "is not a mesh file"),
    "text.3mf": (b"Dear Sir or Madam,\n", "cannot be read as a mesh"),
    "empty.off.gz": (
        gzip.compress(b""),
        "read as a mesh: its first word is .* and not OFF",
    ),
    "text.off.gz": (b"OFF 0 0 0", "cannot be unpacked: Not a gzipped file"),
    "short.off": (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "ends within face 1 of 1"),
    "wild.off": (b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n", "vertex that does not exist"),
    "glued.off": (b" OFF8 6 12 # a cube\n", "its first word is .OFF8. and not OFF"),
    "counts.off": (b"OFF\n3\n", "does not tell how many vertices and faces"),
    "binary.off": (b"OFF BINARY\n\0\0\0\3", "is a binary OFF file; save it as text"),
    "four.off": (b"C4OFF\n1 0 0\n0 0 0 1\n", "vertices are not in three dimensions"),
    "any.off": (b"nOFF\n2\n3 1 0\n0 0\n1 0\n0 1\n3 0 1 2\n", "not in three dimensions"),
}


@pytest.mark.parametrize("name", FILES)
def test_files_that_hold_no_mesh(tmp_path, name):
    content, words = FILES[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(TargetError, match=words) as refusal:
        load_mesh(tmp_path / name)
    assert "\n" not in str(refusal.value)


def test_a_folder_is_no_mesh(tmp_path):
    (tmp_path / "mesh.stl").mkdir()
    with pytest.raises(TargetError, match="is a folder and not a file"):
        load_mesh(tmp_path / "mesh.stl")


@pytest.mark.parametrize("broken", [nan, large_hole, moebius], ids=lambda b: b.__name__)
def test_the_command_line_refuses_without_a_pattern(run, tmp_path, broken):
    path = written(tmp_path / "mesh.off", *broken(*square()))
    out = tmp_path / "out.fold"
    done = run("fit", path, "-o", out, "--json")
    assert done.returncode == 2
    assert json.loads(done.stdout)["kind"] == "TargetError"
    assert not out.exists()


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "off", "glb"])
def test_every_format_gives_the_same_surface(tmp_path, suffix):
    """STL and GLB hold single precision and STL no connections."""
    mesh = saddle_mesh(15)
    path = tmp_path / f"saddle.{suffix}"
    mesh.export(path)
    surface, sha256 = load_mesh(path)
    assert len(sha256) == 64
    original = mesh_surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    points = surface.point(surface.domain.lattice(9, 9)).reshape(-1, 3)
    gap = np.linalg.norm(original.closest_point(points) - points, axis=1).max()
    assert gap < 0.5


@pytest.mark.parametrize(("scale", "noted"), [(0.002, True), (0.3, False), (1, False), (500, True)])
def test_a_size_that_suggests_another_unit_is_a_remark(tmp_path, scale, noted):
    v, f = square()
    surface, _ = load_mesh(written(tmp_path / "mesh.off", v * scale, f))
    assert bool(surface.findings) == noted
    if noted:
        assert "millimetres" in surface.findings[0].sentence
        assert "`size`" in surface.findings[0].sentence


@pytest.mark.parametrize(
    ("vertices", "faces", "words"),
    [
        (np.eye(3), np.zeros((0, 3), dtype=int), "The mesh holds no triangles"),
        (np.eye(3), [[0, 1, 3]], "a triangle refers to a vertex that does not exist"),
        (np.diag([1, np.nan, 1]), [[0, 1, 2]], "vertex 1 has a coordinate that is not a finite"),
        (1e101 * np.eye(3), [[0, 1, 2]], r"too large to be lengths \(1e\+101 mm\)"),
    ],
)
def test_arrays_that_are_no_mesh(vertices, faces, words):
    """Arrays of Python reach no reader of files, which refuses the like."""
    with pytest.raises(TargetError, match=words):
        mesh_surface(vertices, np.asarray(faces))


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ({"rectangle": [1, 0, 0, 1], "rotate": 0, "stiffness": 0}, "rectangle is damaged"),
        ({"rectangle": [0, 1, 0, 1], "rotate": 0, "stiffness": -1}, "rectangle is damaged"),
        ({"rectangle": [0, 1, 0], "rotate": 0, "stiffness": 0}, "rectangle is damaged"),
    ],
)
def test_a_damaged_note_of_the_rectangle_is_refused(place, words):
    with pytest.raises(TargetError, match=words):
        mesh_surface(*square(), place=place)


def test_a_bow_too_thin_for_a_rectangle_is_refused():
    """Three quarters of a ring, a hundredth of its diameter wide."""
    turn = np.linspace(0, 1.5 * np.pi, 91)
    radii = np.array([49.75, 50.25])[:, None]
    points = np.stack([radii * np.cos(turn), radii * np.sin(turn), 0 * radii * turn], axis=-1)
    a = np.arange(90)
    faces = np.concatenate([np.stack([a, a + 92, a + 91], 1), np.stack([a, a + 1, a + 92], 1)])
    for words, where in (
        ("no rectangle fits into the mesh; it is too narrow", {}),
        ("no rectangle fits into the mesh at this 'rotate'", {"rotate": 0.5}),
        ("no rectangle fits into the mesh at this rotation", {"region": Region.read("0,1,0,1")}),
    ):
        with pytest.raises(TargetError, match=words):
            mesh_surface(points.reshape(-1, 3), faces, "bow.stl", **where)


def test_a_rectangle_that_reaches_over_a_ragged_border_is_made_smaller(monkeypatch):
    """As if the border cut all rectangles of the lattice, of every angle, but not smaller ones."""
    whole = mesh_surface(*square(21)).domain
    asked = []

    def ragged(frame, faces, domain):
        asked.append(domain)
        return len(asked) > len(ANGLES)

    monkeypatch.setattr("miurafab.surfaces.mesh.covered", ragged)
    smaller = mesh_surface(*square(21)).domain
    assert smaller.width == pytest.approx(0.95 * whole.width)
    assert smaller.height == pytest.approx(0.95 * whole.height)
    assert len(asked) == len(ANGLES) + 2  # and once more when the surface is made


def test_a_closed_mesh_takes_no_region():
    ball = trimesh.creation.icosphere(1, 50.0)
    with pytest.raises(TargetError, match=r"ball\.stl is closed .* leave them out"):
        mesh_surface(np.asarray(ball.vertices), np.asarray(ball.faces), "ball.stl", rotate=0.0)


def test_dirt_is_cleaned_away():
    """Doubled vertices, triangles without area, unused vertices, triangles turned over."""
    v, f = square()
    v = np.concatenate([v, v[:20], [[1e6, 0, 0]]])
    f = np.concatenate([f, [[3, 3, 4], [0, 1, 2]]])
    f[10] = f[10][::-1]
    f[5] = np.where(f[5] < 20, f[5] + 81, f[5])
    surface = mesh_surface(v, f)
    assert surface.domain.width * surface.domain.height == pytest.approx(1e4, rel=0.1)


def test_small_holes_are_filled_and_said():
    v, f = square(21)
    middle = v[f].mean(axis=1)
    surface = mesh_surface(v, f[np.abs(middle - [50, 50, 0]).max(axis=1) > 5])
    assert "1 small hole was filled" in surface.findings[0].sentence
    point = surface.point(np.array([0.0, 0.0]))
    assert abs(point[2]) < 1e-6
    # distances are to the mesh as it is, hole and all; the sheet follows what fills it
    middle = np.array([[50.0, 50.0, 0.0]])
    assert np.linalg.norm(surface.nearest(middle) - middle) > 4
    assert np.linalg.norm(surface.closest_point(middle) - middle) < 1e-9


def dome(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A cap of 60 degrees of a sphere of radius 100."""
    v, f = square(count, 2.0)
    x, y = (v[:, :2] - 1).T * math.radians(60) / math.sqrt(2)
    r = np.hypot(x, y)
    s = np.sinc(r / np.pi)
    return 100 * np.stack([x * s, y * s, np.cos(r)], axis=1), f


def test_the_surface_lies_on_the_mesh_and_is_laid_out_evenly():
    v, f = dome(41)
    surface = mesh_surface(v, f)
    uv = surface.domain.lattice(31, 31)
    assert np.abs(np.linalg.norm(surface.point(uv), axis=-1) - 100).max() < 0.05
    outward = np.einsum("ijk,ijk->ij", surface.normal(uv), surface.point(uv) / 100)
    assert np.abs(outward).min() > 0.999
    along, across = tangents(surface, uv)
    for speed in (np.linalg.norm(along, axis=-1), np.linalg.norm(across, axis=-1)):
        assert speed.min() > 0.8
        assert speed.max() < 1.25


def test_noise_is_ironed_out():
    """The spline lies nearer to the true sphere than the scan does, and its normals are smooth."""
    v, f = dome(61)
    random = np.random.default_rng(5)
    scan = v + random.normal(scale=0.5, size=v.shape)
    surface = mesh_surface(scan, f)
    points = surface.point(surface.domain.lattice(31, 31))
    error = np.linalg.norm(points, axis=-1) - 100
    assert np.sqrt((error**2).mean()) < 0.15
    normal = surface.normal(surface.domain.lattice(31, 31))
    tilt = np.abs(np.einsum("ijk,ijk->ij", normal, points / 100))
    assert math.degrees(math.acos(np.quantile(tilt, 0.02))) < 4


def test_a_scan_that_folds_over_itself_when_projected():
    """More than half a sphere: no projection is one-to-one."""
    t, w = np.meshgrid(np.linspace(-2.2, 2.2, 60), np.linspace(-1, 1, 40))
    points = np.stack([np.cos(t), np.sin(t), w], axis=-1).reshape(-1, 3) * 50
    index = np.arange(60 * 40).reshape(40, 60)
    a, b, c, d = (
        q.ravel() for q in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    )
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    surface = mesh_surface(points, faces)
    sides = sorted((surface.domain.width, surface.domain.height))
    assert sides[0] == pytest.approx(100, rel=0.05)
    assert sides[1] == pytest.approx(220, rel=0.05)


def laid() -> MeshChart:
    v, f = square(21)
    return mesh_surface(v * [1, 0.5, 1], f).layout


def test_region_in_fractions_and_in_lengths_are_the_same(tmp_path):
    v, f = square(21)
    path = written(tmp_path / "mesh.off", v * [1, 0.5, 1], f)
    for text in ("0.2,0.8,0.1,0.5", "20,80,5,25", "2cm,8cm,5mm,2.5cm"):
        domain = load_mesh(path, region=Region.read(text))[0].domain
        assert domain.width == pytest.approx(60)
        assert domain.height == pytest.approx(20)


def test_rotate_turns_the_grid(tmp_path):
    v, f = square(41)
    path = written(tmp_path / "mesh.off", v, f)
    straight, _ = load_mesh(path, rotate=0.0)
    turned, _ = load_mesh(path, rotate=math.radians(45))
    assert straight.domain.width == pytest.approx(100, rel=0.03)
    assert turned.domain.width * turned.domain.height == pytest.approx(5000, rel=0.1)


@pytest.mark.parametrize("text", ["", "1,2,3", "a,b,c,d", "0.9,0.1,0,1", "0,1,-1,1", "0,1,0,nan"])
def test_regions_that_are_none(text):
    with pytest.raises(ValueError, match=f"is '{text}'; "):
        Region.read(text)


def test_a_region_beyond_the_mesh_names_one_that_is_not(tmp_path):
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    rings = [np.zeros((1, 2))]
    rings += [r * np.stack([np.cos(angle), np.sin(angle)], 1) for r in range(1, 11)]
    points = np.concatenate(rings)
    from scipy.spatial import Delaunay

    path = written(
        tmp_path / "disc.off", np.pad(points, ((0, 0), (0, 1))), Delaunay(points).simplices
    )
    with pytest.raises(TargetError, match="'region' reaches beyond") as refusal:
        load_mesh(path, region=Region.read("0,1,0,1"))
    words = str(refusal.value).split("'region' ")[-1].rstrip(".")
    load_mesh(path, region=Region.read(words))


def test_region_and_rotate_are_for_meshes():
    for option, value in (("region", "0,1,0,1"), ("rotate", 30)):
        with pytest.raises(InputError, match=f"'{option}' is for mesh targets"):
            design("hypar", **{option: value})


def test_a_mesh_is_fitted_checked_and_laid_out_again_from_its_file(run, tmp_path):
    path = tmp_path / "saddle.ply"
    saddle_mesh(21).export(path)
    out = tmp_path / "saddle.fold"
    placed = ("--region", "0.3,0.7,0.3,0.7", "--rotate", "10deg")
    result = run("fit", path, "-o", out, "--facets", "12x12", "--json", *placed)
    assert result.returncode == 0, result
    report = json.loads(result.stdout)
    pattern = read_fold(out)
    assert check(pattern).valid
    assert pattern.target["rotate"] == pytest.approx(10)
    checked = run("check", out, "--json")
    assert checked.returncode == 0
    again = json.loads(checked.stdout)
    for name in ("hausdorff_mm", "hausdorff_midsurface_mm", "area_ratio"):
        assert again[name] == pytest.approx(report[name], rel=1e-9)
