"""The order of assembly: every step is reached from the rim."""

from __future__ import annotations

import flat_patterns
import numpy as np
import pytest
from flat_patterns import bed, card, miura, triangles, without_grid

from miurafab.fabrication.assembly import assembly_order
from miurafab.fabrication.partition.region_growing import is_disk
from miurafab.fabrication.sheets import lay_out

FAN = flat_patterns.fan(24, 20, radius=150.0)
CASES = {
    "miura": (miura(12, 10), (70.0, 60.0)),
    "fan": (FAN, (130.0, 100.0)),
    "fan without grid": (without_grid(FAN), (130.0, 100.0)),
    "triangles": (triangles(3, 8, 260.0), (130.0, 105.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_assembled_stays_a_disk(name):
    pattern, size = CASES[name]
    layout = lay_out(pattern, bed(*size), card())
    steps = assembly_order(layout, pattern)
    assert len(steps) == len(layout.patches) > 6
    faces = np.empty(0, dtype=np.int64)
    for step in steps:
        faces = np.concatenate([faces, layout.patches[step.patch].faces])
        assert is_disk(pattern, faces), "a patch is glued in from two sides"


def test_a_ring_is_closed_by_its_last_patches_alone():
    pattern = triangles(4, 14, 490.0, hole=True)
    layout = lay_out(pattern, bed(210.0, 175.0), card())
    steps = assembly_order(layout, pattern)
    faces = np.empty(0, dtype=np.int64)
    whole = []
    for step in steps:
        faces = np.concatenate([faces, layout.patches[step.patch].faces])
        whole.append(is_disk(pattern, faces))
    first = whole.index(False)
    # Once closed it stays a ring; nothing that could still be glued to a disk is left over.
    assert not any(whole[first:])
    done = np.concatenate([layout.patches[step.patch].faces for step in steps[:first]])
    for step in steps[first:]:
        assert not is_disk(pattern, np.concatenate([done, layout.patches[step.patch].faces]))
