"""One contact by ours and by rivals, against exact enumeration."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import oracles
import pytest

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt_benchmarks.contacts import METHODS, programs, searches
from fcdm_opt_benchmarks.contacts.own import batch, curve, exact, walked
from fcdm_opt_benchmarks.method import ContactAnswer, ContactQuestion, Failure, Method, Pair, Touching
from fcdm_opt_benchmarks.pairs import DrawnPair

QUESTIONS = 4
SHAPES = ("round", "aligned")
BY_NAME = {method.name: method for method in METHODS}
DIGITS = 1e-13
# relative errors that a setting may leave; where it takes few steps, only the side that it errs on is known
BOUNDS = {
    "coal bisection": {"1e-6, to 1e-3": 2e-3, "1e-6, to 1e-6": 1e-4, "1e-6, to 1e-12": 1e-4, "1e-12, to 1e-12": 1e-10},
    "coal distance + Newton": {"1e-6": 1e-6, "1e-9": 1e-9, "1e-12": 1e-10},
    "growth simplex + Newton": {"until it ends": 1e-11},
    "HiGHS, cold": {"1e-4": 1e-3, "1e-7": 1e-6, "1e-10": 1e-9, "1e-10, anew": DIGITS},
    "HiGHS, warm": {"1e-4": 1e-3, "1e-7": 1e-6, "1e-10": 1e-9, "1e-10, anew": DIGITS},
    "Clarabel": {"1e-4": 1e-3, "1e-6": 1e-5, "1e-8": 1e-7, "1e-11": 1e-10},
    "Clarabel (cvxpy)": {"1e-4": 1e-3, "1e-6": 1e-5, "1e-8": 1e-7, "1e-11": 1e-10},
    "CasADi IPOPT": {"1e-4": 1e-3, "1e-8": 1e-6, "1e-12": 1e-10},
    "CasADi clp": {"1e-4": 1e-3, "1e-7": 1e-6, "1e-10": 1e-9},
    "CasADi ipqp": {"1e-8": 1e-6},
    "kernel": {"doubles": DIGITS},
    "decision_curves": {"doubles": DIGITS},
    "decision_curve": {"doubles": DIGITS},
    "exact path": {"rationals": 2.0**-53},  # rounded once
}
LIBRARIES = {"coal": "coal", "HiGHS": "highspy", "Clarabel": "clarabel", "CasADi": "casadi"}


def rows(*names: str) -> list:
    """The methods of these names, or all, as parameters; without their library they are skipped."""
    made = []
    for name in names or BOUNDS:
        needed = ["cvxpy"] if "cvxpy" in name else []
        needed += [LIBRARIES[family] for family in (BY_NAME[name].family,) if family in LIBRARIES]
        missing = [library for library in needed if find_spec(library) is None]
        mark = pytest.mark.skipif(bool(missing), reason=f"not installed: {missing}")
        made.append(pytest.param(name, marks=mark))
    return made


@dataclass(frozen=True)
class Case:
    """A pair, questions about it, and their exact answers."""

    pair: Pair
    questions: tuple[ContactQuestion, ...]
    rho2: tuple[Fraction, ...]
    touching: tuple[Touching, ...]

    def errors(self, answers: list) -> list[float]:
        """Relative errors; fails for anything that is no answer."""
        assert all(isinstance(answer, ContactAnswer) for answer in answers), answers
        return [float(abs(Fraction(own.rho2) / truth - 1)) for own, truth in zip(answers, self.rho2, strict=True)]


@cache
def case(shape: str) -> Case:
    drawn = DrawnPair.of(5, 8, shape, "middling")
    questions = tuple(drawn.contact(k) for k in range(QUESTIONS))
    found = [enumerated(drawn.pair, question) for question in questions]
    return Case(drawn.pair, questions, *(tuple(column) for column in zip(*found, strict=True)))


def enumerated(pair: Pair, question: ContactQuestion) -> tuple[Fraction, Touching]:
    """Return the exact scale of body 2, and what touches there: 0-based vertices."""
    one, two = pair
    whole = oracles.exact_curve(one.vertices, one.seed, two.vertices, two.seed, pose=question.transform).pair
    rho1 = Fraction(question.rho1)
    (piece,) = [
        own
        for own in whole.pieces
        if min(ends := (Fraction(own.start[0], own.start[2]), Fraction(own.end[0], own.end[2]))) < rho1 < max(ends)
    ]
    (rho2, _) = whole.interval(rho1)
    return rho2, (tuple(v - 1 for v in piece.one), tuple(v - 1 for v in piece.two))


def asked(method: Method, label: str, pair: Pair, questions: tuple[ContactQuestion, ...]) -> list:
    answers = method.prepare(pair, method.settings[label])(questions)
    assert len(answers) == len(questions)
    return answers


@pytest.mark.sampled(12)
def test_every_setting_is_bounded_or_a_number_of_steps() -> None:
    assert BOUNDS.keys() == BY_NAME.keys()
    for name, bounds in BOUNDS.items():
        assert all("step" in label for label in BY_NAME[name].settings.keys() - bounds.keys()), name


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("name", rows())
def test_every_setting_is_as_right_as_it_says(name: str, shape: str) -> None:
    own = case(shape)
    for label, bound in BOUNDS[name].items():
        errors = own.errors(asked(BY_NAME[name], label, own.pair, own.questions))
        assert max(errors) <= bound, (label, errors)


@pytest.mark.parametrize("name", rows("coal distance + Newton", "growth simplex + Newton"))
def test_steps_come_from_below_and_nearer(name: str) -> None:
    own = case("round")
    steps = [label for label in BY_NAME[name].settings if "step" in label]
    assert len(steps) == 2
    few, more = ([a.rho2 for a in asked(BY_NAME[name], label, own.pair, own.questions)] for label in steps)
    for one, two, truth in zip(few, more, own.rho2, strict=True):
        assert 0 < one <= two <= float(truth) * (1 + DIGITS)
    assert any(one < float(truth) * (1 - 1e-6) for one, truth in zip(few, own.rho2, strict=True))


@pytest.mark.parametrize("name", ["kernel", "decision_curves", "exact path"])
def test_ours_name_what_touches(name: str) -> None:
    own = case("round")
    (label,) = BY_NAME[name].settings
    assert [a.touching for a in asked(BY_NAME[name], label, own.pair, own.questions)] == list(own.touching)


@pytest.mark.parametrize("name", ["kernel", "exact path"])
def test_ours_name_contacts_in_more_than_a_point(name: str) -> None:
    own = case("aligned")
    assert all(min(map(len, touching)) > 1 for touching in own.touching)
    (label,) = BY_NAME[name].settings
    assert [a.touching for a in asked(BY_NAME[name], label, own.pair, own.questions)] == list(own.touching)


def test_at_a_corner_the_exact_path_names_what_both_segments_share() -> None:
    box = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    pyramid = np.array([[0.0, 0, -1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])  # on its point
    pair = Pair(Body.convex(pyramid, seed=[0.0, 0.0, -0.5]), Body.convex(box, seed=[0.0, 0.0, 0.0]))
    pose = np.eye(4)
    pose[:3, 3] = 1.0, 0.0, 3.0  # the point is over an edge of the box where rho_2 is 1
    (answer,) = exact(pair, None)([ContactQuestion(pose, 3.0)])
    assert answer == ContactAnswer(1.0, ((0,), (5, 7)))


def test_a_batch_names_no_contact_in_more_than_a_point_by_part_of_it() -> None:
    own = case("aligned")
    assert {a.touching for a in asked(BY_NAME["decision_curves"], "doubles", own.pair, own.questions)} == {None}


@pytest.mark.parametrize("name", rows())
def test_nothing_of_a_question_is_left_for_the_next(name: str) -> None:
    own, other = case("round"), case("round").questions[::-1]
    label, bound = list(BOUNDS[name].items())[-1]
    ask = BY_NAME[name].prepare(own.pair, BY_NAME[name].settings[label])
    first, second, single = ask(own.questions), ask(other)[::-1], [ask([question])[0] for question in own.questions]
    for answers in (second, single):
        for one, two in zip(first, answers, strict=True):
            assert abs(one.rho2 - two.rho2) <= 2 * max(bound, DIGITS) * one.rho2


@pytest.mark.parametrize("name", rows())
def test_bodies_that_overlap_at_every_scale_have_no_contact(name: str) -> None:
    own = case("round")
    question = own.questions[0]
    buried = ContactQuestion(question.transform, 50.0)
    for label in BOUNDS[name]:
        answer, after = asked(BY_NAME[name], label, own.pair, (buried, question))
        # an interior point method may leave its tolerance of the 0 that it looks for
        assert isinstance(answer, Failure) or (name.startswith(("Clarabel", "CasADi")) and answer.rho2 < 1e-3), answer
        assert isinstance(after, ContactAnswer)


@pytest.mark.parametrize(
    "name", rows("HiGHS, cold", "HiGHS, warm", "Clarabel", "CasADi IPOPT", "CasADi clp", "CasADi ipqp")
)
def test_a_program_without_solution_fails_with_the_solvers_word(name: str) -> None:
    own = case("round")
    mirrored = ContactQuestion(own.questions[0].transform, -1.0)
    (answer,) = asked(BY_NAME[name], list(BOUNDS[name])[-1], own.pair, (mirrored,))
    assert isinstance(answer, Failure)
    word = answer.reason.rpartition(": ")[2]
    assert len(word) > 3
    assert "conic process failed" not in word
    assert "no scale of body 2" not in answer.reason


@pytest.mark.parametrize("name", rows("Clarabel", "Clarabel (cvxpy)", "CasADi IPOPT"))
def test_an_accuracy_that_is_not_reached_is_a_failure(name: str) -> None:
    own = case("round")
    answers = BY_NAME[name].prepare(own.pair, 1e-30)(own.questions)
    assert [type(answer) for answer in answers] == [Failure] * QUESTIONS


def test_slow_methods_refuse_many_vertices_with_a_reason() -> None:
    small, large = (Pair(*[SimpleNamespace(vertices=np.empty((n, 3)))] * 2) for n in (8, 10_000))
    assert [method.name for method in METHODS if method.refuses(small)] == []
    refused = {method.name: method.refuses(large) for method in METHODS if method.refuses(large)}
    assert refused.keys() == {"CasADi IPOPT", "CasADi ipqp"}
    assert all("vertices" in reason for reason in refused.values())


@pytest.mark.parametrize("prepare", [walked, batch, curve, exact, searches.growth, programs.clarabel])
def test_seeds_outside_are_bad_input(prepare) -> None:
    box = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    pair = Pair(Body.convex(box, seed=[2.0, 0.5, 0.5]), Body.convex(box + 3.0))
    with pytest.raises(InputError, match="seed inside"):
        prepare(pair, None if prepare is not searches.growth else searches.Newton(None))
