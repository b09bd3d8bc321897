"""Force against extension, against closed forms and balances of energy."""

import itertools
import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.figure import Figure
from piece_problems import two_pieces
from problems import regular

from miurafab.errors import InputError, PatternError
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.cut_open import cut_open
from miurafab.origami.energy import pull as pulling
from miurafab.origami.energy.bar_hinge import Paper, sheet_model
from miurafab.origami.energy.held_apart import CLOSING, TouchingDriven
from miurafab.origami.energy.hinges import hinge_angles
from miurafab.origami.energy.pull import pull
from miurafab.origami.energy.pull_plot import draw_pull
from miurafab.origami.energy.triangles import facet_triangles
from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.origami.folding.contact import meeting_facets, most_meeting, self_intersections
from miurafab.origami.folding.kinematics import rigid_motion
from miurafab.origami.piece import pieces_of
from miurafab.surfaces.catalogue import make_surface

PAPER = Paper(0.2, 3e9, crease_length_mm=50.0, yield_angle=0.3, hardening=0.1)


@cache
def hypar():
    """A hypar of 6 x 6 facets, which does not fold rigidly."""
    surface = make_surface("hypar", {"height": 0.5})[0]
    return fit(FitRequest(surface=surface, facets=(6, 6), size_mm=80.0)).pattern


def kite(fold, width, length):
    """Two triangles on one crease; only the crease turns when their tips are pulled."""
    half, middle = fold / 2, length / 2
    out, up = width * math.cos(half), width * math.sin(half)
    return CreasePattern(
        vertices_coords=np.array([[0, -middle], [0, middle], [-width, 0], [width, 0]]),
        edges_vertices=np.array([[0, 1], [1, 2], [2, 0], [0, 3], [3, 1]]),
        edges_assignment=np.array(["V", "B", "B", "B", "B"]),
        edges_fold_angle=np.array([fold, 0, 0, 0, 0]),
        faces_vertices=np.array([[0, 1, 2], [1, 0, 3]]),
        folded_coords=np.array([[0, -middle, 0], [0, middle, 0], [-out, 0, up], [out, 0, up]]),
    )


def returned(angles, rest, yield_angle, hardening):
    """The torque over k after each of ``angles``: the return map, written out for one crease."""
    slip, torques = 0.0, []
    more = hardening / (1 - hardening)
    for angle in angles:
        s = angle - rest - slip - more * slip
        if abs(s) > yield_angle:
            slip += (1 - hardening) * math.copysign(abs(s) - yield_angle, s)
        torques.append(angle - rest - slip)
    return np.array(torques)


@pytest.mark.parametrize("hardening", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("strain", [0.3, -0.4])
def test_one_crease_pulls_as_in_closed_form(hardening, strain):
    """d = 2 w cos(rho / 2), so F = (d tau) / (d d / d rho), with tau of the return map."""
    fold, width, length = math.radians(100), 30.0, 40.0
    paper = replace(PAPER, hardening=hardening)
    curve = pull(kite(fold, width, length), paper, (2, 3), strain=strain, steps=25, uncut=0.4)
    assert curve.converged
    sign = math.copysign(1.0, curve.forces[-2])
    rho = 2 * np.arccos(curve.distances / (2 * width))
    k = 0.4 * paper.bending_stiffness * length / paper.crease_length_mm  # J per radian
    torque = k * returned(rho, fold, paper.yield_angle, hardening)
    force = torque / (-width * 1e-3 * np.sin(rho / 2))
    assert curve.forces == pytest.approx(force, abs=1e-7 * np.abs(force).max())
    assert sign == math.copysign(1.0, strain)
    assert curve.dissipated[-1] > 0


@pytest.mark.parametrize("unit", [1.0, 3.0])
def test_a_stiff_miura_ori_pulls_as_its_rigid_motion_does(unit):
    """F = d/dd of the sum of k (rho - rho_0)^2 / 2 along the motion, if facets hardly bend."""
    pattern = regular(5, 5).scaled(unit)
    paper = Paper(0.2, 3e9, crease_length_mm=1e7)
    curve = pull(pattern, paper, strain=0.05, cycles=1, steps=8)
    states = np.linspace(1.0, 0.5, 2001)
    motion = rigid_motion(pattern, states)
    apart = np.linalg.norm(motion.frames[:, -1] - motion.frames[:, 0], axis=1)
    inner = (pattern.edges_faces >= 0).all(axis=1)
    ends = pattern.vertices_coords[pattern.edges_vertices[inner]]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    k = paper.bending_stiffness * lengths / paper.crease_length_mm
    turned = motion.fold_angles[:, inner] - motion.fold_angles[0, inner]
    energy = 0.5 * (k * turned**2).sum(axis=1)
    force = np.gradient(energy, apart * 1e-3)
    out = curve.loading
    expected = np.interp(curve.distances[out], apart, force)
    assert curve.forces[out] == pytest.approx(expected, abs=2e-3 * expected.max())


def test_an_elastic_cycle_gives_its_energy_back():
    curve = pull(hypar(), replace(PAPER, yield_angle=math.inf), cycles=2, steps=10)
    assert curve.converged
    most = curve.stored.max()
    ends = [int(np.flatnonzero(curve.cycles == cycle)[-1]) for cycle in (1, 2)]
    assert np.abs(curve.stored[ends]).max() <= 1e-12 * most
    assert np.abs(curve.extensions[ends]).max() <= 1e-6 * curve.distances[0]
    assert np.abs(curve.dissipated).max() == 0
    assert curve.changes()[0] <= 1e-9 * np.abs(curve.forces).max()
    assert not curve.slips.any()


def test_work_is_what_is_stored_and_dissipated_to_second_order():
    curves = [pull(hypar(), PAPER, strain=0.25, steps=steps) for steps in (10, 20, 40)]
    assert_work_is_energy_to_second_order(curves, 2e-3)


def assert_work_is_energy_to_second_order(curves, finest):
    """Each of ``curves`` has twice the steps of the one before; the last is off by ``finest``."""
    errors = []
    for curve in curves:
        assert curve.converged
        balance = curve.stored + curve.dissipated
        errors.append(np.abs(curve.works - balance).max() / balance.max())
    assert errors[-1] <= finest
    for coarse, fine in itertools.pairwise(errors):
        assert coarse >= 3 * fine


def test_the_first_cycle_differs_and_later_ones_repeat():
    curve = pull(hypar(), PAPER, strain=0.25, steps=20)
    top = np.abs(curve.forces).max()
    first, later = curve.changes()
    assert first >= 0.05 * top
    assert later <= 1e-3 * top
    report = curve.report()
    assert report["set_mm"] > 0.01 * curve.distances[0]
    assert report["cycles"][2]["set_mm"] == pytest.approx(report["cycles"][1]["set_mm"], abs=1e-6)
    assert (np.diff(curve.dissipated) >= 0).all()
    released = [int(np.flatnonzero(curve.cycles == cycle)[-1]) for cycle in (1, 2, 3)]
    assert np.abs(curve.forces[released]).max() <= 1e-8 * top


def test_the_force_grows_with_the_cube_of_a_sheet_scaled_alike():
    """F L / D is a number of the shape: twice all lengths, thickness too, is eight times D."""
    one = pull(hypar(), PAPER, cycles=1, steps=8)
    twice = replace(PAPER, thickness_mm=0.4, crease_length_mm=100.0)
    other = pull(hypar().scaled(2.0), twice, cycles=1, steps=8)
    assert other.forces == pytest.approx(4 * one.forces, rel=1e-6, abs=1e-9)
    assert other.stored == pytest.approx(8 * one.stored, rel=1e-6, abs=1e-12)


def test_the_verdict_tells_pull_from_push():
    pushed = pull(hypar(), PAPER, strain=-0.1, steps=6, cycles=1)
    force = pushed.report()["force_n"]
    assert force < 0
    assert pushed.report()["strain"] == -0.1
    assert pushed.verdict().startswith(f"{-force:.3g} N push it to a strain of -0.1")
    pulled = pull(hypar(), PAPER, strain=0.25, steps=6, cycles=1)
    assert f"it stays {pulled.report()['set_mm']:.3g} mm longer" in pulled.verdict()


@cache
def closing(steps):
    """Pushed together at the middles of two sides, the hypar would close through itself."""
    return pull(hypar(), PAPER, (3, 45), strain=-0.5, steps=steps, cycles=1)


def walked_through(monkeypatch):
    """As it is pulled without contact."""
    with monkeypatch.context() as patch:
        patch.setattr(pulling, "self_intersections", lambda pattern: [0])
        return pull(hypar(), PAPER, (3, 45), strain=-0.5, steps=10, cycles=1)


def piercings(pattern, curve):
    """The pairs of facets that meet, in the worst state."""
    flat = np.pad(pattern.vertices_coords, ((0, 0), (0, 1)))
    split = facet_triangles(flat, pattern.faces_vertices)
    return max(len(meeting_facets(pattern, points, split)) for points in curve.coords)


def test_facets_are_held_apart_where_they_would_pass_through_each_other(monkeypatch):
    through, apart = walked_through(monkeypatch), closing(10)
    assert through.piercings == piercings(hypar(), through) > 0
    assert not through.touching
    assert apart.touching
    assert apart.converged
    assert apart.piercings == piercings(hypar(), apart) == 0
    assert apart.report()["contact"]
    assert apart.forces.min() < 1.02 * through.forces.min() < 0
    assert apart.forces[:5] == pytest.approx(through.forces[:5], rel=1e-6)


def test_work_is_what_is_stored_and_dissipated_with_contact_and_yielding():
    curves = [closing(steps) for steps in (10, 20, 40)]
    assert all(curve.touching and curve.slips.any() for curve in curves)
    assert_work_is_energy_to_second_order(curves, 2e-4)


def test_an_elastic_cycle_gives_its_energy_back_with_contact():
    elastic = replace(PAPER, yield_angle=math.inf)
    curve = pull(hypar(), elastic, (6, 42), strain=-0.5, steps=12, cycles=2)
    assert curve.touching
    assert curve.converged
    assert curve.piercings == 0
    ends = [int(np.flatnonzero(curve.cycles == cycle)[-1]) for cycle in (1, 2)]
    assert np.abs(curve.stored[ends]).max() <= 1e-12 * curve.stored.max()
    assert curve.changes()[0] <= 1e-9 * np.abs(curve.forces).max()


def test_the_forces_of_what_is_held_apart_are_the_slopes_of_what_is_stored():
    """Facets, creases that are nearly closed, and what touches."""
    curve = closing(20)
    model = sheet_model(hypar(), paper=replace(PAPER, yield_angle=math.inf))
    driven = TouchingDriven(
        model,
        np.array([3, 45]),
        yields=np.full(len(model.hinges), math.inf),
        hardening=0.1,
        edges=hypar().edges_vertices,
    )
    points = curve.coords[np.argmin(curve.extensions)] / model.unit_mm @ driven.axes
    state = driven.rest._replace(points=points)
    driven.arrive(state)
    assert len(driven.contacts.sprung.touching(points)[0]) > 0
    nearly_closed = np.abs(hinge_angles(points, model.hinges)) > np.pi - CLOSING
    assert nearly_closed.any()
    force = driven.residual(state, driven.value(points)).force
    random = np.random.default_rng(3)
    for _ in range(4):
        move = random.normal(size=points.shape)
        move.ravel()[np.setdiff1d(np.arange(points.size), driven.assembly.free)] = 0
        step = 1e-6 * move
        ends = [driven.stored(state._replace(points=points + sign * step)) for sign in (1, -1)]
        along = float(force @ move.ravel()[driven.assembly.free])
        assert (ends[0] - ends[1]) / 2e-6 == pytest.approx(along, rel=1e-5)


def test_facets_that_pass_through_each_other_are_told(monkeypatch):
    """Of a folded form in which facets meet already, nothing is held apart."""
    pushed = walked_through(monkeypatch)
    assert pushed.report()["piercings"] == pushed.piercings > 0
    through = " On the way facets pass through each other, as no paper does."
    assert pushed.verdict().endswith(through)
    pulled = pull(hypar(), PAPER, strain=0.1, steps=3, cycles=1)
    assert pulled.piercings == 0
    assert not pulled.touching
    assert through not in pulled.verdict()


def test_what_touches_in_the_folded_form_holds_nothing_up():
    """Both sides of a cut lie on each other there: "the way was lost at a strain of 0"."""
    whole = regular(5, 5)
    letters = whole.edges_assignment.copy()
    letters[21] = "C"  # from the border inwards
    curve = pull(
        cut_open(replace(whole, edges_assignment=letters)),
        PAPER,
        (0, 24),
        strain=-0.3,
        steps=2,
        cycles=1,
    )
    assert curve.touching
    assert curve.converged
    assert curve.extensions.min() == pytest.approx(-0.3 * curve.distances[0])
    assert curve.piercings == 1  # the facets beside the cut


def test_a_sheet_that_jams_is_lost_there():
    jammed = replace(closing(10), converged=False)
    assert "another shape, jams or is stretched out" in jammed.verdict()


def test_layers_that_lie_on_each_other_pass_through_nothing():
    """Of a sheet folded flat it was told that "facets pass through each other on the way"."""
    closed = kite(math.pi, 30.0, 40.0)
    assert self_intersections(closed).tolist() == [[0, 1]]
    assert most_meeting(closed, closed.folded_coords[None]) == 0


def test_creases_that_keep_their_rest_leave_no_set():
    pulled = pull(hypar(), PAPER, strain=0.25, steps=6, cycles=1)
    stiff = replace(pulled, slips=np.zeros_like(pulled.slips))
    assert stiff.verdict() == f"{pulled.report()['force_n']:.3g} N pull it to a strain of 0.25."


def test_the_plot_names_few_cycles_and_draws_many():
    one = pull(hypar(), PAPER, strain=0.1, steps=4, cycles=1)
    for count in (3, 9):
        many = replace(
            one,
            **{
                name: np.concatenate([getattr(one, name)] * count)
                for name in ("distances", "forces", "loading", "works", "stored", "dissipated")
            },
            cycles=np.repeat(np.arange(count) + 1, len(one.cycles)),
        )
        axes = Figure().add_subplot()
        draw_pull(many, axes, "hypar")
        assert len(axes.lines) == count + 1
        assert (axes.get_legend() is None) == (count > 8)


def test_a_sheet_that_is_pulled_over_its_barrier_is_held_back():
    """Its creases are so soft that the bistable sheet goes on to flat by itself."""
    surface = make_surface("hypar", {"height": 1.0})[0]
    pattern = fit(FitRequest(surface=surface, facets=(8, 8), size_mm=200.0)).pattern
    soft = Paper(0.3, 2.5e9, crease_length_mm=1e6, yield_angle=0.3, hardening=0.1)
    curve = pull(pattern, soft, strain=0.5, steps=20, cycles=1)
    report = curve.report()
    assert curve.converged
    assert report["yielded"] > 0
    assert report["force_n"] < 0
    assert report["set_mm"] is None
    assert "goes farther by itself" in curve.verdict()


def test_what_cannot_be_pulled_is_said():
    for ends, part in (((0, 0), "two different"), ((0, 99), "0 to 48"), ((0, 8), "one facet")):
        with pytest.raises(InputError, match=part):
            pull(hypar(), PAPER, ends)
    with pytest.raises(PatternError, match="no corners"):
        pull(replace(hypar(), grid=None), PAPER)
    lost = pull(hypar(), PAPER, strain=3.0, steps=6, cycles=1)
    assert not lost.converged
    assert "smaller `strain`" in lost.verdict()
    reached = lost.report()["cycles"][0]["strain"]
    assert 0 < reached < 3
    assert lost.report()["set_mm"] is None


def test_of_several_pieces_the_one_with_both_vertices_is_pulled():
    pattern = two_pieces(7, 5, 3)
    one, other = pieces_of(pattern)
    ends = int(other.vertices[0]), int(other.vertices[-1])
    share = np.linspace(0.2, 1.0, len(pattern.edges_vertices))
    whole = pull(pattern, PAPER, ends, strain=0.1, steps=4, cycles=1, uncut=share)
    last = len(other.vertices) - 1
    alone = pull(
        other.pattern, PAPER, (0, last), strain=0.1, steps=4, cycles=1, uncut=share[other.edges]
    )
    assert whole.ends == ends
    assert np.array_equal(whole.forces, alone.forces)
    assert whole.forces.max() > 0
    assert np.array_equal(whole.coords[:, other.vertices], alone.coords)
    assert np.ptp(whole.coords[:, one.vertices], axis=0).max() == 0
    with pytest.raises(
        PatternError, match=r"2 pieces.*name two of its vertices .* such as (\d+),"
    ) as no:
        pull(pattern, PAPER)
    named = tuple(map(int, re.search(r"such as (\d+),(\d+)", str(no.value)).groups()))
    assert pull(pattern, PAPER, named, strain=0.05, steps=2, cycles=1).converged
    with pytest.raises(PatternError, match="vertex of piece 0 and one of piece 1"):
        pull(pattern, PAPER, (int(one.vertices[0]), ends[1]))
