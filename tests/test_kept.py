"""What is kept for other tests: the same answer to the same request, and to no other."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from kept import TESTS, KeptFits, KeptTimes

from miurafab.gcode.interpreter import parse_program
from miurafab.gcode.job import Job
from miurafab.motion.parameters import Link, MotionParameters
from miurafab.origami.fitting.fit import _FitSearch, _SheetAlone
from miurafab.profiles import load_machine
from miurafab.workflow.design import design

HYPAR = design("hypar", facets="2x2", size="20mm").request
ELSEWHERE = TESTS / "origami" / "test_trim.py"


def moves(word="X10", rate=6000.0):
    """A program of one move, and the parameters of a machine."""
    machine = load_machine("grbl-laser-400")
    parameters = MotionParameters.from_profile(machine)
    rates = (rate, *parameters.max_rate_mm_min[1:])
    return parse_program(Job("j", f"G1 {word} F900\n")), replace(parameters, max_rate_mm_min=rates)


MOVE = moves()


class Asked:
    """Fits that are counted, for a test at ``path``; each answers with a number of its own."""

    def __init__(self, folder, path, marked=False, status="converged"):
        self.made, self.status = 0, status
        marker = SimpleNamespace() if marked else None
        test = SimpleNamespace(path=path.resolve(), get_closest_marker={"anew": marker}.get)
        self.fit = KeptFits(folder, lambda: test, self.make)
        self.estimate = KeptTimes(folder, lambda: test, self.time)

    def make(self, request, on_progress, search):
        self.made += 1
        return SimpleNamespace(status=self.status, points=np.full(3, self.made))

    def time(self, *asked):
        self.made += 1
        return np.full(3, self.made)


@pytest.fixture
def asked(tmp_path):
    return Asked(tmp_path, ELSEWHERE)


def test_the_same_request_is_answered_once_with_objects_of_its_own(asked):
    told = []
    asked.fit(HYPAR, None, _FitSearch).points[:] = 7
    second = asked.fit(design("hypar", facets=(2, 2), size=20).request, None, _FitSearch)
    third = asked.fit(HYPAR, lambda *each: told.append(each), _FitSearch)
    second.points[0] = 5
    assert third.points.tolist() == [1, 1, 1]
    assert asked.made == 1
    assert told == [(1.0, "done")]


def test_another_request_is_another_fit(asked):
    others = [
        HYPAR,
        replace(HYPAR, size_mm=20.5),
        replace(HYPAR, fairness=2.0),
        replace(HYPAR, target={}),
        *(design(lambda u, v, k=k: 0.1 * k * u * v, facets="2x2").request for k in (1, 2)),
    ]
    points = [asked.fit(request, None, _FitSearch).points[0] for request in others]
    points.append(asked.fit(HYPAR, None, _SheetAlone).points[0])
    assert points == [1, 2, 3, 4, 5, 6, 7]


def test_what_hangs_on_time_is_made_anew(asked, tmp_path):
    for _ in range(2):
        asked.fit(replace(HYPAR, timeout=60.0), None, _FitSearch)
    assert asked.made == 2
    ended = Asked(tmp_path, ELSEWHERE, status="interrupted")
    assert [ended.fit(HYPAR, None, _FitSearch).points[0] for _ in range(2)] == [1, 2]


@pytest.mark.parametrize(
    ("path", "marked"),
    [
        ("origami/fitting/test_fit.py", False),
        ("origami/fitting/deeper/test_fit.py", False),
        ("motion/test_estimate.py", False),
        ("origami/test_trim.py", True),
    ],
)
def test_tests_of_fits_and_of_motion_and_those_marked_make_theirs(tmp_path, path, marked):
    asked = Asked(tmp_path, TESTS / path, marked)
    assert [asked.fit(HYPAR, None, _FitSearch).points[0] for _ in range(2)] == [1, 2]
    assert [asked.estimate(*MOVE)[0] for _ in range(2)] == [3, 4]


def test_a_program_is_timed_once_for_a_machine_and_a_link(asked):
    told = []
    asked.estimate(*MOVE)[:] = 7
    assert asked.estimate(*moves(), on_share=told.append).tolist() == [1, 1, 1]
    assert told == [1.0]
    others = [moves("X11"), moves(rate=2000.0), (*moves(), Link(latency=0.01)), moves()]
    assert [asked.estimate(*other)[0] for other in others] == [2, 3, 4, 1]
