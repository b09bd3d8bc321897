"""The energy of bent facets along a motion, against the path that the motion was taken from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from problems import fitted, regular

from miurafab.origami.energy.path import folding_path
from miurafab.origami.folding.bending import bending_motion
from miurafab.origami.folding.facet_energy import facet_energies
from miurafab.origami.folding.kinematics import rigid_motion


def test_a_rigid_motion_takes_no_energy() -> None:
    energies = facet_energies(rigid_motion(regular(), [0.2, 1.0, 3.0]))
    assert energies is not None
    assert np.abs(energies).max() < 1e-20


def test_flat_facets_take_no_energy_without_a_folded_form_either() -> None:
    flat = replace(regular(), folded_coords=None)
    energies = facet_energies(rigid_motion(flat, [0.2, 1.0]))
    assert energies is not None
    assert np.abs(energies).max() < 1e-20


def test_a_bending_motion_has_the_energy_of_its_path() -> None:
    pattern = fitted("hypar", 6, 6).pattern
    assert pattern is not None
    energies = facet_energies(bending_motion(pattern, 6))
    assert energies is not None
    assert energies[-1] < 1e-15
    # the ends of both are the folded form and the same angle near flat
    path = folding_path(pattern, 6)
    assert energies[0] == pytest.approx(path.energies[-1], rel=1e-6)
    assert energies.max() > 100 * energies[-1]
