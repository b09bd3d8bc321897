"""All of a disk mesh as a target: the outline, the cells that meet it, its rim, nearest points."""

from __future__ import annotations

import numpy as np
import pytest

from miurafab.errors import TargetError
from miurafab.geometry.arrays import Floats, Ints
from miurafab.surfaces.mesh import MeshChart, lay_out
from miurafab.surfaces.outline import STIFFER, WholeMesh, whole_mesh
from miurafab.surfaces.placement import turned
from miurafab.surfaces.surface import tangents


def squares(kept: list[list[int]], step: int = 4) -> tuple[Floats, Ints]:
    """The unit squares ``kept`` of a plane, each with ``step`` x ``step`` x 2 triangles."""
    n = step
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    cells = np.array([(n * i + a, n * j + b) for i, j in kept for a in range(n) for b in range(n)])
    corners = (cells[:, None] + corner).reshape(-1, 2)
    points, index = np.unique(corners, axis=0, return_inverse=True)
    quads = index.reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int64)
    return np.pad(points / n, ((0, 0), (0, 1))), faces


@pytest.fixture(scope="module")
def panel() -> WholeMesh:
    """An L of three unit squares."""
    whole = whole_mesh(lay_out(*squares([[0, 0], [1, 0], [0, 1]]), "L")[0])
    return whole.laid(0.0, (0.1, 0.1))


def test_the_outline_is_that_of_the_mesh(panel: WholeMesh) -> None:
    assert panel.outline.area == pytest.approx(3.0, rel=1e-6)
    inside = panel.outline.contains(panel.domain.lattice(201, 201).reshape(-1, 2))
    box = panel.domain.width * panel.domain.height
    assert inside.mean() * box == pytest.approx(3.0, rel=0.02)


def test_cells_are_kept_where_they_meet_the_mesh(panel: WholeMesh) -> None:
    columns, rows = 14, 12
    kept = panel.kept(columns, rows)
    u, v = panel.lines(columns, rows)
    fine_u = np.linspace(u[0], u[-1], 14 * 40 + 1)[:-1] + 1e-4
    fine_v = np.linspace(v[0], v[-1], 12 * 40 + 1)[:-1] + 1e-4
    fine = np.stack(np.meshgrid(fine_u, fine_v), axis=-1)
    inside = panel.outline.contains(fine.reshape(-1, 2)).reshape(12, 40, 14, 40)
    part = inside.mean(axis=(1, 3))
    assert kept[part > 0.06].all()
    assert not kept[part == 0].any()


def test_the_rim_reaches_outwards_along_the_mesh(panel: WholeMesh) -> None:
    row, column = np.nonzero(panel.kept(14, 12))
    cells = np.stack([column, row], axis=1)
    cut, places, outward = panel.rim(14, 12, cells)
    assert 0 < len(cut) < len(cells)
    assert np.linalg.norm(outward, axis=1) == pytest.approx(1.0)
    assert np.abs(outward[:, 2]).max() < 1e-6  # the mesh is flat
    feet = panel.feet(places)
    moved = panel.feet(places + 0.01 * outward)
    closer = panel.outline.signed_distance(moved) - panel.outline.signed_distance(feet)
    assert np.median(closer) == pytest.approx(-0.01, rel=1e-2)
    assert closer.max() < 0


def test_nearest_points_are_found_again(panel: WholeMesh) -> None:
    random = np.random.default_rng(3)
    lattice = panel.domain.lattice(25, 25).reshape(-1, 2)
    uv = lattice[panel.outline.contains(lattice)]
    off = random.uniform(-0.05, 0.05, (len(uv), 1))
    assert panel.feet(panel.point(uv) + off * panel.normal(uv)) == pytest.approx(uv, abs=1e-8)


def test_closest_points_go_on_beyond_the_outline(panel: WholeMesh) -> None:
    inside, beyond = np.array([[0.3, 0.4, 0.2]]), np.array([[1.5, 1.06, 0.1], [-0.05, 0.5, 0.3]])
    assert panel.closest_point(inside) == pytest.approx(np.array([[0.3, 0.4, 0.0]]), abs=1e-9)
    below = beyond * np.array([1.0, 1.0, 0.0])
    assert panel.closest_point(beyond) == pytest.approx(below, abs=1e-6)


def test_turning_the_layout_turns_the_outline(panel: WholeMesh) -> None:
    other = panel.laid(np.pi / 2, (0.1, 0.1))
    assert other.domain.width == pytest.approx(panel.domain.height)
    assert other.outline.area == pytest.approx(panel.outline.area)
    uv = panel.domain.lattice(7, 5).reshape(-1, 2)
    assert other.point(turned(uv, np.pi / 2)) == pytest.approx(panel.point(uv), abs=1e-12)
    assert other.normal(turned(uv, np.pi / 2)) == pytest.approx(panel.normal(uv), abs=1e-12)
    one, two = panel.laid(0.3), panel.laid(0.3).laid(0.7).laid(0.3)
    assert two.point(uv) == pytest.approx(one.point(uv), abs=1e-12)
    assert two.outline.loops[0] == pytest.approx(one.outline.loops[0], abs=1e-12)


def test_the_tangents_are_the_differences_of_the_points(panel: WholeMesh) -> None:
    target = panel.laid(0.4)
    uv = target.domain.lattice(6, 6).reshape(-1, 2)
    for tangent, expected in zip(target.tangents(uv), tangents(target, uv), strict=True):
        assert tangent == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("even", [0, 2, 9])
def test_the_spline_is_as_stiff_as_it_takes_to_be_even_beyond_the_outline(
    even: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And no stiffer than the stiffest that is tried."""
    seen: list[float] = []

    def judged(target: WholeMesh) -> bool:
        seen.append(target.stiffness)
        return len(seen) > even

    monkeypatch.setattr("miurafab.surfaces.outline._even_beyond", judged)
    chart = lay_out(*squares([[0, 0]]), "square")[0]
    tried = [0.0, *STIFFER]
    assert whole_mesh(chart).stiffness == tried[min(even, len(tried) - 1)]
    assert seen == tried[: even + 1]
    stiff = whole_mesh(chart, 1.0)
    assert stiff.stiffness == 1.0


def test_a_layout_that_lies_over_itself_is_refused() -> None:
    turn = np.linspace(0, 2.4 * np.pi, 60)
    inner, outer = (r * np.stack([np.cos(turn), np.sin(turn)], axis=1) for r in (1.0, 2.0))
    flat = np.concatenate([inner, outer])
    i = np.arange(59)
    faces = np.concatenate(
        [np.stack([i, i + 60, i + 61], axis=1), np.stack([i, i + 61, i + 1], axis=1)]
    )
    vertices = np.column_stack([flat, np.tile(0.5 * turn, 2)])
    chart = MeshChart(
        vertices, faces, (vertices, faces), len(vertices), len(faces), flat, False, "ramp.obj"
    )
    with pytest.raises(TargetError, match=r"ramp\.obj: its outline crosses itself"):
        whole_mesh(chart)
