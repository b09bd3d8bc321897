"""Rigid folding against the closed form of the Miura-ori, and against the sheets' own geometry."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import CELL, fitted, regular

from miurafab.errors import PatternError
from miurafab.geometry.angles import fold_angles
from miurafab.geometry.polygons import facet_normals
from miurafab.origami.folding.kinematics import (
    RIGID,
    FoldingMotion,
    facet_strain,
    half_tangents,
    rigid_motion,
    states_between,
)
from miurafab.origami.folding.laying import laid_on
from miurafab.origami.miura import regular_miura

EXACT = ("plane", "hypar", "sphere", "saddle", "cylinder", "paraboloid")


def rigid_from_flat_to_flat_folded(name: str) -> FoldingMotion:
    pattern = fitted(name, flat_foldable=0.0).pattern
    assert pattern is not None
    return rigid_motion(pattern, states_between(pattern, 12))


@given(theta=st.floats(0.01, 1.56))
def test_a_regular_miura_folds_through_its_closed_form(theta: float) -> None:
    # the zig-zag creases fold by 2 theta, so s = tan(theta) / tan(theta*)
    motion = rigid_motion(regular(), [math.tan(theta) / math.tan(CELL.theta)])
    expected = regular_miura(replace(CELL, theta=theta), 9, 7).vertices
    assert np.abs(laid_on(motion.frames[0], expected) - expected).max() < 1e-11
    assert motion.mismatch is not None
    assert motion.mismatch[0] < 1e-12


@pytest.mark.parametrize("name", EXACT)
def test_exactly_flat_foldable_fits_fold_rigidly(name: str) -> None:
    motion = rigid_from_flat_to_flat_folded(name)
    assert motion.mismatch is not None
    assert motion.mismatch.max() < 1e-9
    assert motion.is_rigid
    assert facet_strain(motion.pattern, motion.frames).max() < 1e-9


@pytest.mark.parametrize("name", ["hypar", "sphere", "saddle"])
def test_developable_fits_do_not(name: str) -> None:
    pattern = fitted(name).pattern
    assert pattern is not None
    motion = rigid_motion(pattern, states_between(pattern, 12))
    assert motion.mismatch is not None
    assert motion.mismatch.max() > 0.1
    assert not motion.is_rigid
    # but flat and in the folded form every loop closes
    closed = motion.mismatch[[0, int(np.flatnonzero(motion.states == 1.0)[0])]]
    assert closed.max() < 1e-9


@pytest.mark.parametrize("name", EXACT)
def test_a_motion_passes_through_flat_the_target_and_flat_folded(name: str) -> None:
    motion = rigid_from_flat_to_flat_folded(name)
    pattern = motion.pattern
    size = np.ptp(pattern.vertices_coords, axis=0).max()
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    assert np.abs(laid_on(motion.frames[0], flat) - flat).max() < 1e-10 * size
    target = motion.frames[int(np.flatnonzero(motion.states == 1.0)[0])]
    assert pattern.folded_coords is not None
    assert np.abs(target - pattern.folded_coords).max() < 1e-10 * size
    last = motion.frames[-1] - motion.frames[-1].mean(axis=0)
    assert np.linalg.svd(last, compute_uv=False)[2] < 1e-8 * size  # a plane


def test_the_frames_have_the_fold_angles_that_the_motion_states() -> None:
    motion = rigid_from_flat_to_flat_folded("sphere")
    pattern = motion.pattern
    inner = (pattern.edges_faces >= 0).all(axis=1)
    for points, angles in zip(motion.frames[:-1], motion.fold_angles[:-1], strict=True):
        normals = facet_normals(points, pattern.faces_vertices)
        left, right = (normals[pattern.edges_faces[inner, side]] for side in (0, 1))
        measured = fold_angles(points, pattern.edges_vertices[inner], left, right)
        assert np.abs(measured - angles[inner]).max() < 1e-9


def test_neighbouring_frames_lie_close() -> None:
    motion = rigid_motion(regular(), states_between(regular(), 40))
    steps = np.linalg.norm(np.diff(motion.frames, axis=0), axis=2).max(axis=1)
    size = np.ptp(regular().vertices_coords, axis=0).max()
    assert steps.max() < 0.1 * size


def test_vertices_are_placed_alike_whatever_other_frames_there_are() -> None:
    alone = rigid_motion(regular(), [0.5]).frames[0]
    among = rigid_motion(regular(), [0.0, 0.5, 1.0, 2.0]).frames[1]
    assert np.abs(laid_on(alone, among) - among).max() < 1e-12


@given(steps=st.integers(1, 60), last=st.floats(0.1, 50) | st.just(math.inf))
def test_states_rise_from_flat_to_the_last(steps: int, last: float) -> None:
    states = states_between(regular(), steps, last)
    assert len(states) == steps + 1
    assert states[0] == 0.0
    assert states[-1] == last
    assert (np.diff(states) > 0).all()
    if last > 1.0 and steps > 1:
        assert 1.0 in states


def test_facets_that_hang_on_nothing_are_refused() -> None:
    pattern = regular()
    cut = np.where(pattern.edges_assignment != "B", "C", "B")
    with pytest.raises(PatternError, match="47 of 48 facets are joined to the rest by no"):
        rigid_motion(replace(pattern, edges_assignment=cut), [1.0])


def test_one_facet_stands_still_and_a_loose_vertex_is_refused() -> None:
    motion = rigid_motion(regular(2, 2), [0.5, 1.0])
    assert motion.is_rigid
    assert np.ptp(motion.frames, axis=0).max() < 1e-12
    pattern = regular(3, 3)
    loose = replace(
        pattern,
        vertices_coords=np.concatenate([pattern.vertices_coords, [[1.0, 1.0]]]),
        folded_coords=None,
        grid=None,
    )
    with pytest.raises(PatternError, match="Vertex 9 of the pattern belongs to no facet"):
        rigid_motion(loose, [1.0])


@pytest.mark.parametrize("name", EXACT)
def test_mountains_and_valleys_alone_tell_the_motion(name: str) -> None:
    pattern = fitted(name, flat_foldable=0.0).pattern
    assert pattern is not None
    flat_folded = np.sign(pattern.edges_fold_angle) * np.pi
    bare = replace(pattern, edges_fold_angle=flat_folded, folded_coords=None)
    known, found = half_tangents(pattern), half_tangents(bare)
    moving = known != 0
    ratio = found[moving] / known[moving]
    assert np.ptp(ratio) < 1e-9 * ratio.mean()
    assert rigid_motion(bare, states_between(bare, 6)).is_rigid


def test_four_creases_of_a_kind_are_refused() -> None:
    pattern = regular()
    mountains = np.where(pattern.edges_assignment == "B", "B", "M")
    angle = np.where(mountains == "M", -np.pi, 0.0)
    with pytest.raises(PatternError, match="three of one kind"):
        rigid_motion(replace(pattern, edges_assignment=mountains, edges_fold_angle=angle), [1.0])
    with pytest.raises(PatternError, match="from 0"):
        rigid_motion(pattern, [-1.0])


def test_rigid_is_said_only_below_the_gate() -> None:
    motion = rigid_motion(regular(), [1.0])
    assert replace(motion, mismatch=np.array([0.9 * RIGID])).is_rigid
    assert not replace(motion, mismatch=np.array([1.1 * RIGID])).is_rigid
    assert not replace(motion, mismatch=None).is_rigid
