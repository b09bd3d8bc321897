"""The meshes that the tests share are what their kinds say."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from mesh_shapes import SHAPES, border, mesh, of_kind

KINDS = {"disk": (1, 1), "hole": (2, 0), "tube": (2, 0), "sphere": (0, 2), "plate": (0, 2)}
"""The number of borders and the Euler number of each kind."""


@pytest.mark.parametrize("name", [name for name in SHAPES if SHAPES[name].kind in KINDS])
def test_a_mesh_has_the_topology_of_its_kind(name: str) -> None:
    vertices, faces = mesh(name)
    borders, euler = KINDS[SHAPES[name].kind]
    if name == "plate-pipe":
        euler = 0  # its skins are tubes
    edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    assert len(vertices) - len(edges) + len(faces) == euler
    assert len(trimesh.graph.connected_components(border(faces))) == borders
    solid = trimesh.Trimesh(vertices, faces, process=False)
    assert solid.is_winding_consistent
    if not borders:
        assert solid.volume > 0  # the triangles face outwards


def test_there_are_forty_or_more_and_they_are_always_the_same() -> None:
    assert len(SHAPES) >= 40
    for name, shape in SHAPES.items():
        vertices, faces = shape.make()
        assert np.array_equal(mesh(name)[0], vertices)
        assert np.array_equal(mesh(name)[1], faces)
        assert np.isfinite(vertices).all()
    assert {name for kind in ("disk", "hole", "dirty") for name in of_kind(kind)} < set(SHAPES)
