"""The files that come along are examples, too: each is read by what it is for."""

import numpy as np
import pytest
from pages import ROOT

import miurafab
from miurafab.profiles import load_machine, load_material

DESIGNS = sorted((ROOT / "patterns").glob("*.toml"))
MACHINES = sorted((ROOT / "firmware_profiles").glob("*.toml"))
MATERIALS = sorted((ROOT / "materials").glob("*.toml"))


@pytest.mark.parametrize("path", DESIGNS, ids=lambda path: path.stem)
def test_a_design_is_read_with_its_machine_and_material(path):
    design = miurafab.design(str(path))
    assert design.title
    assert load_machine(design.machine).title
    assert load_material(design.material).title


@pytest.mark.parametrize("path", MACHINES, ids=lambda path: path.stem)
def test_a_machine_is_read_by_name_and_by_path(path):
    assert load_machine(path.stem) == load_machine(str(path))


@pytest.mark.parametrize("path", MATERIALS, ids=lambda path: path.stem)
def test_a_material_is_read_by_name_and_by_path(path):
    assert load_material(path.stem) == load_material(str(path))


def test_the_saddle_is_the_surface_of_its_formula():
    """z = (x² - y²) / 250 mm over a square of 200 mm, 20 x 20 squares of two triangles."""
    content = np.frombuffer((ROOT / "patterns" / "saddle.stl").read_bytes()[84:], dtype=np.uint8)
    triangles = content.reshape(-1, 50)[:, :48].copy().view("<f4").reshape(-1, 4, 3)
    assert triangles.shape[0] == 800
    x, y, z = np.moveaxis(triangles[:, 1:].astype(float), -1, 0)
    np.testing.assert_allclose(z, (x**2 - y**2) / 250, atol=1e-5)
    assert np.array_equal(np.unique(x), np.linspace(-100, 100, 21))
    assert np.array_equal(np.unique(y), np.linspace(-100, 100, 21))
