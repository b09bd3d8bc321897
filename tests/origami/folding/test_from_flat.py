"""Patterns that fold from flat by mountains and valleys alone, against what is known of them."""

from __future__ import annotations

import math
from dataclasses import replace

import named_patterns
import numpy as np
import pytest
from problems import regular
from scipy import sparse

from miurafab.errors import PatternError
from miurafab.geometry.polygons import edge_lengths
from miurafab.geometry.sparse import Factor
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.energy.bar_hinge import flat_model
from miurafab.origami.energy.equilibrium import TOLERANCE
from miurafab.origami.energy.hinges import hinge_angles
from miurafab.origami.energy.ramp import Ramped, descend
from miurafab.origami.energy.seed import linear_seed
from miurafab.origami.folding.angles_csv import contacts
from miurafab.origami.folding.certificate import RigidCertificate, certified
from miurafab.origami.folding.from_flat import fold_from_flat, ramp_parts
from miurafab.origami.folding.judge_motion import median_fold, motion_findings
from miurafab.origami.folding.kinematics import (
    CLOSED_FORM,
    FROM_FLAT,
    facet_strain,
    rigid_motion,
)
from miurafab.origami.folding.motion import FoundMotion, find_motion
from miurafab.origami.folding.ramp_motion import ramp_motion
from miurafab.origami.folding.ramp_walk import FIRMER, RampWalk
from miurafab.origami.formats.fold_frames import frame_titles

RIGID = {
    "waterbomb base": named_patterns.waterbomb_base,
    "bird base": named_patterns.bird_base,
    "Yoshimura": lambda: named_patterns.yoshimura(4, 4),
    "Kresling": lambda: named_patterns.kresling(4, 3),
    "waterbombs": lambda: named_patterns.waterbombs(3, 2),
    "Resch": lambda: named_patterns.resch(3, 2),
}


@pytest.mark.parametrize("name", RIGID)
def test_a_known_pattern_folds_with_flat_facets(name: str) -> None:
    pattern = RIGID[name]()
    found = find_motion(pattern, 10)
    motion, verdict, certificate = found.motion, found.verdict, found.certificate
    assert motion.method == FROM_FLAT
    assert motion.is_rigid
    assert verdict is not None
    assert certificate is not None
    assert certificate.rigid
    assert certificate.residual <= 1e-12
    assert verdict.complete
    assert not len(verdict.wrong_edges)
    assert verdict.seed_signs == 1.0
    assert not verdict.unstable.any()
    assert motion_findings(found, ()) == ()
    assert facet_strain(pattern, motion.frames).max() <= 1e-12
    assert motion.mismatch is not None
    assert motion.mismatch.max() <= 1e-11  # the facets placed one by one at the fold angles
    # flat at first, then farther at every step
    assert np.ptp(motion.frames[0, :, 2]) <= 1e-9
    assert (np.diff(np.abs(motion.fold_angles).mean(axis=1)) > 0).all()


def test_a_waterbomb_base_folds_as_spherical_trigonometry_says() -> None:
    """With q = sin(rho_M / 2), cos rho_V = 2 (1 - q^2) / (1 + q^2) - 1: M -60, V 78.46 degrees."""
    pattern = named_patterns.waterbomb_base()
    motion = find_motion(pattern, 12).motion
    mountains = motion.fold_angles[1:, pattern.edges_assignment == "M"]
    valleys = motion.fold_angles[1:, pattern.edges_assignment == "V"]
    assert mountains == pytest.approx(mountains[:, :1].repeat(2, 1), abs=1e-9)
    q2 = np.sin(mountains[:, :1] / 2) ** 2
    wanted = np.arccos(2 * (1 - q2) / (1 + q2) - 1)
    assert valleys == pytest.approx(wanted.repeat(4, 1), abs=1e-9)
    q2 = math.sin(math.radians(30)) ** 2
    assert math.degrees(math.acos(2 * (1 - q2) / (1 + q2) - 1)) == pytest.approx(78.463, abs=1e-3)


def test_a_miura_ori_comes_to_its_closed_form_without_using_it() -> None:
    """tan(rho_straight / 2) = cos(alpha) tan(rho_zigzag / 2) at every vertex and in every frame."""
    pattern = named_patterns.miura(4)
    assert find_motion(pattern, 6).motion.method == CLOSED_FORM
    motion, verdict = ramp_motion(pattern, 6)
    motion, certificate = certified(motion)
    assert certificate.rigid
    assert not verdict.unstable.any()
    inner = (pattern.edges_faces >= 0).all(axis=1)
    across = np.abs(np.ptp(pattern.vertices_coords[pattern.edges_vertices], axis=1)[:, 0]) < 1e-9
    half = np.tan(np.abs(motion.fold_angles[1:]) / 2)
    straight, zigzag = half[:, inner & across], half[:, inner & ~across]
    assert zigzag == pytest.approx(zigzag[:, :1].repeat(zigzag.shape[1], 1), abs=1e-9)
    wanted = math.cos(math.radians(65)) * zigzag[:, :1]
    assert straight == pytest.approx(wanted.repeat(straight.shape[1], 1), abs=1e-9)


def test_a_vertex_that_is_not_flat_foldable_folds_rigidly_all_the_same() -> None:
    """One vertex of degree four always does; its closed form is not that of flat-foldable ones."""
    tips = [(math.cos(turn), math.sin(turn)) for turn in np.radians([0, 70, 150, 230])]
    lines = named_patterns.border(*tips)
    letters = ("V", "V", "M", "V")
    lines += [((0.0, 0.0), tip, letter, 60.0) for tip, letter in zip(tips, letters, strict=True)]
    found = find_motion(named_patterns.drawn(lines), 8)
    assert found.mismatch is not None
    assert found.mismatch > 1e-3
    assert found.motion.is_rigid
    assert found.certificate is not None
    assert found.certificate.residual <= 1e-12


def test_a_square_twist_bends_and_says_where() -> None:
    found = find_motion(named_patterns.square_twist(), 10)
    assert not found.motion.is_rigid
    assert found.certificate is not None
    assert not found.certificate.rigid
    assert found.verdict is not None
    assert not len(found.verdict.wrong_edges)
    assert found.verdict.complete
    assert "bent-facets" in {finding.code for finding in motion_findings(found, ())}


def test_a_hexagon_twist_folds_where_its_facets_hold_each_other_off() -> None:
    """Without contact its way ended at 36 % of the fold angles."""
    found = find_motion(named_patterns.hexagon_twist(30.0), 5)
    assert found.verdict is not None
    assert (found.verdict.complete, found.verdict.touching) == (True, True)
    assert not len(found.verdict.wrong_edges)


@pytest.mark.parametrize(
    ("turn", "why"),
    [(45.0, "every fold can start to the side"), (60.0, "6 of its 18 folds cannot")],
)
def test_what_is_lost_before_its_first_position_is_told(turn, why, monkeypatch) -> None:
    """It had left flat, and the program said that it could not be brought out of the plane."""
    monkeypatch.setattr(RampWalk, "reach", lambda *_: False)
    with pytest.raises(PatternError, match=f"first position, at 18% of its fold angles.*{why}"):
        find_motion(named_patterns.hexagon_twist(turn), 5)


def test_a_sheet_that_is_held_back_is_folded_with_softer_sides() -> None:
    """A windmill base folds only by stretching on the way: its square drives its creases apart."""
    pattern = named_patterns.windmill()
    assert ramp_motion(pattern, 10)[1].is_held_back
    found = find_motion(pattern, 10)
    assert found.verdict is not None
    assert not found.verdict.is_held_back
    assert not len(found.verdict.wrong_edges)
    assert math.degrees(found.verdict.angle_error) < 10
    assert found.mismatch is not None
    assert found.mismatch > 0.1
    assert not found.motion.is_rigid
    assert found.verdict.strain.max() > 0.02
    assert "stretched" in {finding.code for finding in motion_findings(found, ())}


def test_a_way_with_contact_that_is_lost_at_once_leaves_the_way_without_it(monkeypatch) -> None:
    """It is not refused: facets pass through each other, and that is told."""

    def lost(pattern, steps, *, touching=False, **more):
        if touching:
            raise PatternError("no balance was found")
        return ramp_motion(pattern, steps, **more)

    monkeypatch.setattr("miurafab.origami.folding.motion.ramp_motion", lost)
    found = find_motion(named_patterns.yoshimura(8, 8), 6)
    assert found.verdict is not None
    assert not found.verdict.touching
    assert contacts(found.motion)


def test_a_pleated_hypar_leaves_the_plane_by_stretching_a_little() -> None:
    """No paper folds it exactly (Demaine et al., 2011); alternating triangles come near."""
    found = find_motion(named_patterns.pleated_hypar(), 8)
    assert found.verdict is not None
    assert found.verdict.complete
    assert not len(found.verdict.wrong_edges)
    assert not found.verdict.unstable.any()
    assert 1e-3 < found.verdict.strain.max() < 1e-2
    # its facets are triangles, whose sides are all that can stretch
    stretched = facet_strain(found.motion.pattern, found.motion.frames).max(axis=1)
    assert found.verdict.strain == pytest.approx(stretched)
    assert not found.motion.is_rigid
    last = found.motion.frames[-1]
    size = np.linalg.norm(np.ptp(last, axis=0))
    assert np.linalg.svd(last - last.mean(axis=0))[1][2] > 0.05 * size  # a saddle in space
    codes = {finding.code for finding in motion_findings(found, ())}
    assert {"bent-facets", "stretched"} <= codes


def inverted(pattern: CreasePattern, edge: int) -> CreasePattern:
    letter, angle = pattern.edges_assignment.copy(), pattern.edges_fold_angle.copy()
    letter[edge] = "M" if letter[edge] == "V" else "V"
    angle[edge] *= -1
    return replace(pattern, edges_assignment=letter, edges_fold_angle=angle)


def test_a_wrong_letter_shows_as_the_sheet_leaves_the_plane() -> None:
    pattern = named_patterns.miura(4)
    assert linear_seed(flat_model(pattern)).follow.all()
    inner = np.flatnonzero((pattern.edges_faces >= 0).all(axis=1))
    edge = int(inner[len(inner) // 2 - 3])
    wrong = inverted(pattern, edge)
    follow = linear_seed(flat_model(wrong)).follow
    assert inner[~follow].tolist() == [edge]
    with pytest.raises(PatternError, match=r"does not fold in one motion.* [0-9]+% of its folds"):
        find_motion(wrong, 8)


def test_a_frame_is_a_minimum_by_finite_differences() -> None:
    """Every direction that keeps all lengths raises the energy of the bird base."""
    pattern = named_patterns.bird_base()
    path = fold_from_flat(pattern, ramp_parts(pattern, 6))
    frame, model = path.frames[3], path.model
    assert frame.stiff
    stiffness = model.stiffness * np.where(model.rest == 0, FIRMER, 1.0)

    def lagrangian(x: np.ndarray, forces: np.ndarray) -> float:
        points = x.reshape(-1, 3)
        turned = hinge_angles(points, model.hinges) - frame.part * model.rest
        return float(0.5 * stiffness @ turned**2 + forces @ model.strains(points))

    size = frame.points.size
    x, h, unit = frame.points.ravel(), 1e-4, np.eye(size)

    def slope(of, x: np.ndarray) -> np.ndarray:
        return np.array([(of(x + h * e) - of(x - h * e)) / (2 * h) for e in unit])

    none = np.zeros(len(model.bars))
    lengths = np.array(
        [
            (model.strains((x + h * e).reshape(-1, 3)) - model.strains((x - h * e).reshape(-1, 3)))
            / (2 * h)
            for e in unit
        ]
    ).T
    forces = np.linalg.lstsq(lengths.T, -slope(lambda y: lagrangian(y, none), x), rcond=None)[0]
    assert np.abs(slope(lambda y: lagrangian(y, forces), x)).max() <= 1e-6
    hessian = np.array(
        [
            slope(
                lambda y, e=e: (
                    (lagrangian(y + h * e, forces) - lagrangian(y - h * e, forces)) / (2 * h)
                ),
                x,
            )
            for e in unit
        ]
    )
    _, values, rows = np.linalg.svd(lengths)
    free = rows[int((values > 1e-6).sum()) :]
    inside = np.linalg.eigvalsh(free @ (hessian + hessian.T) @ free.T / 2)
    assert (np.abs(inside[:6]) <= 1e-4).all()  # rigid motions of the whole
    assert inside[6] > 1e-3


def test_pieces_fold_each_by_itself() -> None:
    lines = []
    for shift in (0.0, 5.0):
        for one, other, letter, angle in two_squares():
            lines.append(((one[0] + shift, one[1]), (other[0] + shift, other[1]), letter, angle))
    pattern = named_patterns.drawn(lines)
    motion, verdict = ramp_motion(pattern, 5)
    assert pattern.pieces_count == 2
    folds = np.isin(pattern.edges_assignment, ("M", "V"))
    assert np.degrees(motion.fold_angles[-1, folds]) == pytest.approx([162.0, 162.0], abs=1e-6)
    flat = edge_lengths(pattern.vertices_coords, pattern.edges_vertices)
    assert edge_lengths(motion.frames[-1], pattern.edges_vertices) == pytest.approx(flat)
    assert verdict.wrong_signs == 0


def two_squares() -> list[named_patterns.Line]:
    sides = named_patterns.border(
        (0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (0, 1)
    )
    return [*sides, ((1.0, 0.0), (1.0, 1.0), "V", 180.0)]


@pytest.mark.large
@pytest.mark.parametrize("facets", [20, 30])
def test_large_miuras_fold_from_flat(facets: int) -> None:
    motion, verdict = ramp_motion(named_patterns.miura(facets), 20)
    motion, certificate = certified(motion)
    assert certificate.rigid
    assert certificate.residual <= 1e-12
    assert not verdict.unstable.any()
    assert not len(verdict.wrong_edges)


def test_free_creases_have_a_median_fold_angle_too() -> None:
    motion = find_motion(named_patterns.waterbomb_base(), 4).motion
    free = np.full(len(motion.pattern.edges_assignment), "U")
    freed = replace(motion, pattern=replace(motion.pattern, edges_assignment=free))
    assert median_fold(motion, 0) == median_fold(freed, 0) == 0
    assert median_fold(freed, 4) == pytest.approx(median_fold(motion, 4))


def test_the_verdict_of_a_way_from_flat_is_told_by_its_figures() -> None:
    motion, good = ramp_motion(named_patterns.waterbomb_base(), 3)
    assert motion_findings(FoundMotion(motion, None, good), ()) == ()
    frames = len(motion.frames)
    bad = replace(
        good,
        complete=False,
        touching=True,
        wrong_edges=np.array([5, 7]),
        wrong_signs=0.25,
        unstable=np.where(np.arange(frames) > 1, 2, 0),
        strain=np.full(frames, 3e-3),
        angle_error=math.radians(60),
    )
    short = replace(motion, states=np.linspace(0.0, 0.5, frames))
    told = {each.code: each for each in motion_findings(FoundMotion(short, None, bad), ())}
    assert {code: finding.sentence for code, finding in told.items()} == {
        "way-lost": "The motion ends at 50% of the fold angles: beyond, no balance was found in "
        "which no facet passes through another.",
        "wrong-signs": "25.0% of the folds end on the other side than their letter tells, the "
        "first being edge 5.",
        "stretched": "On the way a side changes its length by up to 0.3 %: paper that does not "
        "stretch would lock.",
        "unstable": f"In {frames - 2} of {frames} positions the sheet is not stable and would snap "
        "away.",
        "held-back": "Creases stay 60 degrees away, in the mean, from the fold angles asked for: "
        "these do not go together.",
    }
    assert told["wrong-signs"].where == (5, 7)
    free = replace(bad, touching=False)
    (lost, *_) = motion_findings(FoundMotion(short, None, free), ())
    assert lost.sentence.endswith("beyond, no balance was found.")
    # its facets bend, although a shape with flat facets is near, with other fold angles
    near = RigidCertificate(False, float(motion.states[1]), 0.0, math.radians(3.0))
    (bent,) = motion_findings(FoundMotion(motion, None, None, near), ())
    assert bent.code == "bent-facets"
    assert "a crease is turned by 3 degrees more" in bent.sentence


def test_what_does_not_fold_has_no_motion_to_certify() -> None:
    motion, _ = ramp_motion(named_patterns.waterbomb_base(), 2)
    still = replace(motion, fold_angles=np.zeros_like(motion.fold_angles))
    with pytest.raises(PatternError, match="No crease of the pattern moves"):
        certified(still)


def test_frames_whose_loops_do_not_close_are_no_rigid_motion(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The projection is not believed: the facets are placed anew at its fold angles."""
    motion, _ = ramp_motion(named_patterns.waterbomb_base(), 2)
    assert certified(motion)[1].rigid
    monkeypatch.setattr(
        "miurafab.origami.folding.certificate.loop_mismatch", lambda *given: np.array([0.0, 1e-3])
    )
    same, told = certified(motion)
    assert same is motion
    assert (told.rigid, told.residual) == (False, 1e-3)


def test_frames_that_are_all_folded_flat_are_called_so() -> None:
    motion = rigid_motion(regular(), [math.inf])
    assert frame_titles(motion) == ["folded flat"]
    titles = frame_titles(rigid_motion(regular(), [0.0, 1.0, math.inf]))
    assert (titles[0], titles[2]) == ("flat", "folded flat")
    assert titles[1].startswith("edge ")


def test_the_way_from_flat_tells_how_far_it_is() -> None:
    told: list[tuple[float, str]] = []
    pattern = named_patterns.waterbomb_base()
    parts = ramp_parts(pattern, 3)
    fold_from_flat(pattern, parts, on_progress=lambda *each: told.append(each))
    done = [each for each in told if "round" not in each[1]]
    assert done == [(k / 3, f"step {k} of 3") for k in (1, 2, 3)]
    # and within each step, the first of which is a descent
    assert told[:3] == [(0.0, f"step 1 of 3, round {k}") for k in (1, 2, 3)]
    assert [part for part, _ in told] == sorted(part for part, _ in told)
    assert {(2 / 3, "step 3 of 3, round 1"), (1 / 3, "step 2 of 3, round 1")} <= set(told)


def test_a_balance_is_found_where_rounding_lets_no_force_fall_further() -> None:
    """A strip that is a hundredth as wide as its neighbours has forces of 1e-9 from rounding."""
    ends = (0.0, 1.0, 2.0, 2.01, 3.0)
    lines = named_patterns.border((0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (0.0, 1.0))
    lines += [
        ((x, 0.0), (x, 1.0), letter, 90.0) for x, letter in zip(ends[1:4], "VMV", strict=True)
    ]
    thin = Ramped(flat_model(named_patterns.drawn(lines)))
    assert 1e-10 < thin.tolerance < 1e-6
    plain = Ramped(flat_model(named_patterns.drawn([*lines[:5], *lines[6:]])))
    assert plain.tolerance == TOLERANCE


def test_a_descent_goes_on_where_rounding_leaves_no_matrix_definite(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It raises mu until one is."""
    model = flat_model(named_patterns.flat_only(regular(4, 4)))
    ramped = Ramped(model)
    definite, refused = Ramped.definite, []

    def unwilling(self: Ramped, matrix: sparse.csc_array) -> Factor:
        if len(refused) < 6:
            refused.append(matrix)
            raise RuntimeError("the matrix is not positive definite")
        return definite(self, matrix)

    monkeypatch.setattr(Ramped, "definite", unwilling)
    raised = model.points + [[0.0, 0.0, 1e-2]] * (np.arange(len(model.points)) % 2)[:, None]
    ended = descend(ramped, raised, 0.1, 1e-6, 200)
    assert len(refused) == 6
    assert ended.force <= 1e-6
