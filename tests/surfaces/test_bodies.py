"""Tubes and closed bodies as targets: maps, poles, gores and refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from mesh_shapes import ball, mesh, ring

from miurafab.errors import OptionError, TargetError
from miurafab.origami.fitting.fit import fit
from miurafab.surfaces.body import Body, body_surface, described
from miurafab.surfaces.description import described_surface
from miurafab.surfaces.poles import HeatDistance, open_at, pole_candidates
from miurafab.surfaces.surface import tangents
from miurafab.surfaces.topology import border_loops
from miurafab.workflow.design import design


def rotation():
    """A rotation about no axis of note."""
    q, r = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


def tube(name):
    vertices, faces = mesh(name)
    return body_surface(Body(vertices, faces, name))


@pytest.fixture(scope="module")
def pipe():
    return tube("bent-pipe")


@pytest.fixture(scope="module")
def banana():
    return tube("banana")


def test_a_tube_closes_with_two_derivatives(pipe):
    d = pipe.domain
    v = np.linspace(d.v0, d.v1, 9)
    for order in range(3):
        both = [
            pipe.spline(np.stack([np.full(9, u), v], axis=1), nu=(order, 0)) for u in (0.0, d.width)
        ]
        assert np.abs(both[0] - both[1]).max() < 1e-8 * np.abs(both[0]).max()
    far = d.lattice(5, 5) + np.array([7 * d.width, 0.0])
    assert np.abs(pipe.point(far) - pipe.point(d.lattice(5, 5))).max() < 1e-9


def test_a_cylinder_has_closed_figures():
    """Girth 2 pi r, length h; K gores ask for tan psi = gain * pi / K."""
    vertices, faces = mesh("cylinder")
    surface = body_surface(Body(vertices, faces, "cylinder"), pieces=7)
    radius = np.linalg.norm(vertices[:, :2], axis=1).max()
    assert surface.domain.width == pytest.approx(2 * math.pi * radius, rel=2e-3)
    assert surface.domain.height == pytest.approx(np.ptp(vertices[:, 2]), rel=1e-6)
    told = surface.figures
    gain = 1.69 / 0.69
    assert math.tan(told.slide) == pytest.approx(gain * math.pi / 7, rel=1e-3)
    assert told.turn == pytest.approx(2 * math.pi, rel=1e-3)
    assert told.across == pytest.approx(1, abs=1e-3)
    assert told.shear < 1e-3


def test_a_bent_pipe_has_closed_figures():
    """Its map is conformal: the speeds of u and v vary alike, as R + r cos a."""

    def place(turn, t):
        angle, bend = 2 * np.pi * turn, np.pi / 2 * t
        out = 20 + 6 * np.cos(angle)
        return np.stack(
            [out * np.cos(bend), out * np.sin(bend), -6 * np.sin(angle) + 0 * t], axis=-1
        )

    surface = body_surface(Body(*ring(place, 48, 40), "pipe"))
    assert surface.figures.across == pytest.approx(26 / 14, rel=0.01)
    assert surface.figures.along == pytest.approx(26 / 14, rel=0.01)
    assert surface.figures.shear < math.radians(1)
    uv = surface.domain.lattice(40, 20)
    points = surface.point(uv)
    ring_distance = np.linalg.norm(points[..., :2], axis=-1) - 20
    assert np.abs(np.hypot(ring_distance, points[..., 2]) - 6).max() < 0.02


@pytest.mark.parametrize("name", ["vase", "bent-pipe", "banana"])
def test_u_v_and_the_outward_normal_are_right_handed(name):
    vertices, faces = mesh(name)
    surface = body_surface(Body(vertices, faces, name))
    d = surface.domain
    uv = d.lattice(13, 9)
    along, across = tangents(surface, uv)
    normal = surface.normal(uv)
    assert np.einsum("ijk,ijk->ij", np.cross(along, across), normal).min() > 0
    # a small step outwards leaves the solid: the enclosed volume of the surface grows
    out = surface.point(uv) + 1e-3 * normal
    level = uv[4]
    middle = surface.point(level).mean(axis=0)
    assert (
        np.linalg.norm(out[4] - middle, axis=1).mean()
        > np.linalg.norm(surface.point(level) - middle, axis=1).mean()
    )


def test_distances_on_a_sphere_are_arcs():
    vertices, faces = ball(lambda p: p, 3)
    distance = HeatDistance(vertices, faces).from_vertex(0)
    arc = np.arccos(np.clip(vertices @ vertices[0], -1, 1))
    assert np.abs(distance - arc).max() < 0.06


def test_the_poles_of_an_egg_are_its_ends():
    vertices, faces = ball(lambda p: p * [30.0, 30.0, 55.0], 3)
    turn = rotation()
    for points in (vertices, vertices @ turn.T):
        first = pole_candidates(points, faces, HeatDistance(points, faces))[0]
        assert sorted(vertices[first, 2].tolist()) == pytest.approx([-55, 55], abs=1)


def test_a_hole_has_a_smooth_border():
    vertices, faces = ball(lambda p: p, 4)
    arc = np.arccos(np.clip(vertices @ vertices[0], -1, 1))
    points, triangles = open_at(vertices, faces, [arc], 0.3)
    loops = border_loops(triangles)
    assert len(loops) == 1
    rim = points[loops[0]]
    off = np.arccos(np.clip(rim @ vertices[0] / np.linalg.norm(rim, axis=1), -1, 1))
    assert off == pytest.approx(0.3, abs=0.006)
    p = points[triangles]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(2 * math.pi * (1 + math.cos(0.3)), rel=5e-3)


def test_a_bent_body_that_is_not_star_shaped_is_served(banana):
    vertices, _ = mesh("banana")
    assert banana.gores <= 8
    assert banana.figures.trouble <= 1
    assert {finding.code for finding in banana.findings} == {"polar-holes"}
    size = np.linalg.norm(np.ptp(vertices, axis=0))
    points = banana.point(banana.domain.lattice(40, 40)).reshape(-1, 3)
    off = np.linalg.norm(points - banana.closest_point(points), axis=1)
    assert off.max() < 2e-3 * size


def test_the_same_body_comes_from_its_description(banana):
    vertices, faces = mesh("banana")
    again = described(Body(vertices, faces, "banana"), banana.description)
    uv = banana.domain.lattice(9, 9)
    assert np.array_equal(again.point(uv), banana.point(uv))
    assert again.domain == banana.domain


@pytest.mark.parametrize("note", [{}, {"poles": [[0, 0, 0]], "hole": 1}, {"poles": "x"}])
def test_a_damaged_description_is_refused(note):
    vertices, faces = mesh("banana")
    with pytest.raises(TargetError, match="damaged"):
        described(Body(vertices, faces, "banana"), note)


def test_a_turned_body_has_the_turned_map():
    vertices, faces = ball(lambda p: p * [30, 33, 55] + 6 * p[:, :1] * p[:, 1:] @ np.eye(2, 3), 3)
    turn = rotation()
    one = body_surface(Body(vertices, faces, "pebble"))
    other = body_surface(Body(vertices @ turn.T, faces, "pebble"))
    uv = one.domain.lattice(9, 9)
    assert other.gores == one.gores
    assert other.domain.u0 == pytest.approx(one.domain.u0, abs=1e-6 * one.domain.width)
    assert np.abs(other.point(uv) - one.point(uv) @ turn.T).max() < 1e-6 * one.domain.height


def test_limbs_are_refused_with_a_figure():
    def ears(p):
        points = p.copy()
        for side in (0.35, -0.35):
            way = np.array([-0.2, side, 0.9]) / np.linalg.norm([-0.2, side, 0.9])
            points = points + 1.6 * np.exp(-(1 - p @ way) / 0.02)[:, None] * way
        return 50 * points

    vertices, faces = ball(ears, 3)
    with pytest.raises(TargetError, match=r"cannot be covered by gores: .* at most.*'poles'"):
        body_surface(Body(vertices, faces, "ears"), poles=50 * np.array([[0, 0, 1.0], [0, 0, -1]]))


def test_roughness_is_smoothed_and_said():
    vertices, faces = mesh("bumpy")
    surface = body_surface(Body(vertices, faces, "bumpy"), stiffness=1e-1)
    sentence = next(f.sentence for f in surface.findings if f.code == "smoothed")
    off = np.linalg.norm(surface.point(surface.layout.flat) - surface.layout.vertices, axis=1)
    assert f"up to {off.max():.3g} mm" in sentence


def test_the_poles_and_the_holes_are_the_users():
    vertices, faces = ball(lambda p: 50 * p, 3)
    poles = np.array([[0.0, 0.0, 60.0], [0.0, 0.0, -60.0]])
    surface = body_surface(Body(vertices, faces, "ball"), poles=poles, hole=20.0)
    # the meridians run from 20 / 50 of a radian off one pole to the other
    assert surface.domain.height == pytest.approx(50 * (math.pi - 0.8), rel=0.01)
    axis = surface.point(surface.domain.lattice(13, 5)[:, :-1]).mean(axis=1)
    assert np.abs(axis[:, :2]).max() < 0.5


@pytest.mark.parametrize("poles", [[[-50, 0, 0], [-49, 0, 0]], [[-50, 0, 0], [-15, 0, 2]]])
def test_holes_that_leave_no_tube_are_refused(poles):
    """Holes of 12 mm on a bar of 4 mm: one in the other, and one that cuts the bar through."""
    bar = trimesh.creation.box((100.0, 4.0, 4.0))
    bar = Body(np.asarray(bar.vertices), np.asarray(bar.faces), "bar")
    with pytest.raises(TargetError, match="bar is closed, and no two holes make a tube of it"):
        body_surface(bar, poles=np.array(poles, dtype=float), hole=12.0)


def test_of_many_gores_the_best_pair_of_poles_is_taken():
    """With 12 gores asked for, no pair is as good as the first with few, so all are compared."""
    made = ball(lambda p: p * [30, 33, 55] + 6 * p[:, :1] * p[:, 1:] @ np.eye(2, 3), 2)
    body = Body(*made, "pebble")
    surface = body_surface(body, pieces=12)
    assert surface.gores == 12
    pairs = pole_candidates(*made, HeatDistance(*made))
    assert len(pairs) > 2
    ranks = []
    for pair in pairs[:2]:
        try:
            ranks.append(body_surface(body, pieces=12, poles=made[0][pair]).figures.rank)
        except TargetError:
            continue
    assert surface.figures.rank <= min(ranks)


def test_a_hole_along_edges_cuts_no_triangle():
    """The octahedron's lower half, by the levels of its corners."""
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]])
    faces = np.concatenate([faces, faces[:, [1, 0, 2]] + [0, 0, 3]])
    points, triangles = open_at(corners, faces, [1 - corners[:, 2]], 1.0)
    assert len(points) == 5
    assert {tuple(sorted(map(tuple, points[t].tolist()))) for t in triangles} == {
        tuple(sorted(map(tuple, corners[t].tolist()))) for t in faces[4:]
    }


@pytest.fixture(scope="module")
def sheet():
    """Six gores of a bent pipe."""
    vertices, faces = mesh("bent-pipe")
    return fit(design(trimesh.Trimesh(vertices, faces, process=False), facets=(24, 12)).request)


def test_gores_of_a_bent_pipe_close_and_fold(sheet):
    measured = sheet.measurements
    assert sheet.status == "converged"
    assert sheet.score.bow_ties == measured.self_intersections == measured.overlaps == 0
    assert max(measured.max_planarity, measured.max_developability) < 1e-12
    assert measured.max_isometry < 1e-12
    assert 100 * sheet.deviation_mm < np.linalg.norm(np.ptp(mesh("bent-pipe")[0], axis=0))
    # closed all round: as many seams as gores, each as long as the pipe
    pattern = sheet.pattern
    gores = len(np.unique(pattern.pieces))
    assert len(pattern.seams) == 12 * gores
    ends = pattern.folded_coords[pattern.edges_vertices[pattern.seams]]
    same = np.abs(ends[:, 0] - ends[:, 1]).max(axis=(1, 2))
    turned = np.abs(ends[:, 0] - ends[:, 1, ::-1]).max(axis=(1, 2))
    assert np.minimum(same, turned).max() < 1e-9


def test_a_pattern_of_gores_finds_its_target_again(sheet):
    target = sheet.pattern.target
    surface, findings = described_surface(target)
    assert not findings
    assert surface.gores == target["gores"]
    middle = sheet.pattern.folded_coords.mean(axis=0)
    assert np.isfinite(surface.nearest(middle[None])).all()


def test_a_tube_takes_no_pole_of_a_named_surface():
    with pytest.raises(OptionError, match="mesh targets"):
        design("hypar", poles="0,0,-1,0,0,1")
    with pytest.raises(OptionError, match="six numbers"):
        design("hypar", poles="0,0,1")
