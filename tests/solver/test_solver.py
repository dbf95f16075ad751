"""The solver on random bodies: invariances, rivals that share nothing with it, repeatability, refusals."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from contact_truth import exact_gap, exact_meeting
from ordinary import PROBLEMS, problems
from strategies import random_pose

from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.errors import InputError, UnsolvedError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt.motion.motions import Motion, Rotation, Screw, Step, Translation
from fcdm_opt.problem.problem import Problem, load_problems
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.solver import solve

BOX = ((0.5, 2.5), (0.5, 2.5))
MOTIONS: dict[str, Motion] = {
    "translation": Translation((1.0, 1.0, 0.5)),
    "rotation about the seed": Rotation("y"),
    "rotation about a point": Rotation((1.0, 1.0, 1.0), (0.5, -0.3, 0.2)),
    "screw of the seeds": Screw("seeds", 0.5),
    "free screw": Screw("seeds"),
    "two translations": Translation("x") >> Translation("y"),
    "translation, then rotation": Translation("x") >> Rotation("z", (0.1, 0.2, -0.3)),
    "rotation, then translation": Rotation("x") >> Translation("z"),
}
LETTERS = "ABCD"


def random_body(rng: np.random.Generator, parts: int, centre: np.ndarray) -> Body:
    """Union of overlapping random hulls; the seed lies in the first."""
    points = [centre + rng.normal(size=(int(rng.integers(5, 10)), 3)) + (k > 0) * 0.8 * rng.normal(size=3)
              for k in range(parts)]  # fmt: skip
    return Body.from_parts(points, seed=points[0].mean(axis=0))


@cache
def scene(number: int, counts: tuple[int, int]) -> tuple[Body, Body]:
    """Two bodies whose curve in the box has a switching point between point contacts."""
    rng = np.random.default_rng([number, *counts])
    while True:
        away = rng.normal(size=3)
        one = random_body(rng, counts[0], np.zeros(3))
        two = random_body(rng, counts[1], away / np.linalg.norm(away) * rng.uniform(2.0, 4.0))
        if decision_curve(one, two, box=BOX).switching_points:
            return one, two


def tolerance_problem(number: int, counts: tuple[int, int], motion: Motion, goal: str, **arguments: Any) -> Problem:
    """A tolerance of two per cent at a switching point or inside a segment; the number chooses which, and the case."""
    one, two = scene(number, counts)
    rng = np.random.default_rng([9, number])
    curve = decision_curve(one, two, box=BOX)
    nominal: Any = int(rng.integers(len(curve.switching_points))) + 1
    if goal in ("touch", "clear", "at inside"):
        segment = max(curve.segments, key=lambda s: float(np.linalg.norm(s.end - s.start)))
        nominal = tuple((segment.start + segment.end) / 2)
    return Problem(one, two, nominal=nominal, tolerance=0.02, requirement=LETTERS[number % 4], motion=motion, box=BOX,
                   goal=goal.split()[0], length=1.7, **arguments)  # fmt: skip


TASKS = [
    (number, counts, name, goal)
    for number, (counts, name, goal) in enumerate(
        (counts, name, goal)
        for goal in ("touch", "clear", "beyond", "at inside")
        for name in MOTIONS
        for counts in ((1, 1), (2, 1) if goal in ("touch", "beyond") else (1, 2))
    )
]


@cache
def task(number: int) -> Problem:
    _, counts, name, goal = TASKS[number]
    return tolerance_problem(number, counts, MOTIONS[name], goal)


@cache
def answer(number: int) -> Solution:
    return solve(task(number))


EVERY_TASK = pytest.mark.parametrize("number", range(len(TASKS)), ids=lambda k: "-".join(map(str, TASKS[k])))
SOME_TASKS = pytest.mark.parametrize("number", range(0, len(TASKS), 3), ids=lambda k: "-".join(map(str, TASKS[k])))


def remade(problem: Problem, change: Callable[[Body, int], Body], **arguments: Any) -> Problem:
    """The same question about changed bodies; the nominal pair stays what it was."""
    bodies = {"movable": change(problem.movable, 0), "static": change(problem.static, 1)}
    return problem.changed(**{"nominal": tuple(problem.nominal_pair), **bodies, **arguments})


def numbers(solution: Solution) -> np.ndarray:
    return np.array(list(solution.parameters.values()))


def agree(one: Solution, two: Solution, factor: float = 1.0) -> None:
    """Same status, and amounts in the ratio given."""
    assert two.status is one.status
    assert two.pair_state == one.pair_state
    if one.status.found:
        assert two.amount == pytest.approx(factor * one.amount, rel=1e-7, abs=1e-9 * factor)


# ------------------------------------------------------------------------------------------------- every single answer


@pytest.mark.sampled(5)
@EVERY_TASK
def test_every_answer_is_judged_and_bounded(number):
    solution = answer(number)
    assert solution.status is not Status.NOT_VERIFIED, solution.certificate.failed
    assert not solution.lower_bound > solution.amount
    assert solution.lower_bound >= 0
    if solution.status.found:
        assert solution.usable
        assert solution.amount == pytest.approx(float(np.linalg.norm(task(number).weights * numbers(solution))))
        gap = exact_gap(task(number), solution.transform)
        state = "touching" if abs(gap) < 1e-9 * task(number).static.size else "apart" if gap > 0 else "overlapping"
        assert solution.pair_state == state
    assert set(solution.seconds) == {"build", "solve", "prove", "verify"}
    assert min(solution.seconds.values()) >= 0


@pytest.mark.slow
def test_most_tasks_have_an_answer_of_every_kind_of_goal():
    found = [(TASKS[number][3], answer(number).status.found) for number in range(len(TASKS))]
    for goal in ("touch", "clear", "beyond", "at inside"):
        assert sum(own == goal and usable for own, usable in found) >= 8


# --------------------------------------------------------------------------------------------------------- invariances


def scaled_motion(motion: Motion, factor: float) -> Motion:
    steps = []
    for step in motion.steps:
        if isinstance(step, Rotation) and not isinstance(step.centre, str):
            step = Rotation(step.axis, tuple(factor * x for x in step.centre))
        elif isinstance(step, Screw) and not isinstance(step.pitch, str):
            step = Screw(step.axis, factor * step.pitch)
        steps.append(step)
    return sequence(steps)


def sequence(steps: list[Step]) -> Motion:
    made: Motion = steps[0]
    for step in steps[1:]:
        made = made >> step
    return made


@pytest.mark.sampled(11)
@SOME_TASKS
@pytest.mark.parametrize("factor", [1e-3, 0.1, 1e3])
def test_the_unit_of_length_scales_amounts_and_lengths_only(number, factor):
    def grown(body: Body, _: int) -> Body:
        return Body.from_parts([factor * part.vertices for part in body.parts], seed=factor * body.seed)

    original = answer(number)
    motion = scaled_motion(task(number).motion, factor)
    other = solve(remade(task(number), grown, motion=motion, length=1.7 * factor))
    agree(original, other, factor)
    if original.status.found:
        kinds = np.array([factor if kind == "translation" else 1.0 for _, kind in motion.parameters])
        slack = 1e-4 * original.amount + 1e-9
        np.testing.assert_allclose(numbers(other) / kinds, numbers(original), rtol=0, atol=slack)


def moved_motion(motion: Motion, T: np.ndarray) -> Motion:
    axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}

    def turned(axis: Any) -> tuple[float, ...]:
        return tuple(T[:3, :3] @ axes.get(axis, axis) if isinstance(axis, str) else T[:3, :3] @ axis)

    steps: list[Step] = []
    for step in motion.steps:
        if isinstance(step, Translation):
            steps.append(Translation(turned(step.axis)))
        elif isinstance(step, Rotation):
            centre = step.centre if isinstance(step.centre, str) else tuple(T[:3, :3] @ step.centre + T[:3, 3])
            steps.append(Rotation(turned(step.axis), centre))
        else:
            steps.append(step)  # along the line of the seeds, which moves with them
    return sequence(steps)


@pytest.mark.sampled(9)
@SOME_TASKS
def test_a_common_rigid_motion_changes_no_amount(number):
    T = random_pose(np.random.default_rng([41, number]), 3.0)
    asked = remade(task(number), lambda body, _: body.moved(T), motion=moved_motion(task(number).motion, T))
    other = solve(asked)
    agree(answer(number), other)
    if other.status.found:
        np.testing.assert_allclose(numbers(other), numbers(answer(number)), rtol=0, atol=1e-4 * other.amount + 1e-9)


@pytest.mark.sampled(9)
@SOME_TASKS
def test_the_order_of_parts_and_vertices_changes_no_amount(number):
    rng = np.random.default_rng([42, number])

    def shuffled(body: Body, _: int) -> Body:
        points = [rng.permutation(part.vertices) for part in body.parts]
        return Body.from_parts(points[::-1], seed=body.seed)

    agree(answer(number), solve(remade(task(number), shuffled)))


def plain(solution: Solution) -> str:
    return json.dumps(solution.to_dict() | {"seconds": None}, allow_nan=False)


@pytest.mark.sampled(25)
@EVERY_TASK
def test_the_same_question_gets_the_same_answer_bit_for_bit(number):
    assert plain(solve(task(number))) == plain(answer(number))


def test_a_fresh_process_gives_the_same_answer_bit_for_bit():
    code = (
        "import json, sys\n"
        "from fcdm_opt.problem.problem import load_problems\n"
        "from fcdm_opt.solver import solve\n"
        "answers = [solve(p).to_dict() | {'seconds': None} for f in sys.argv[1:] for p in load_problems(f)]\n"
        "print(json.dumps(answers))\n"
    )
    files = [str(PROBLEMS / f"{name}.toml") for name in ("example1", "example2_touch")]
    output = subprocess.run([sys.executable, "-c", code, *files], capture_output=True, text=True, check=True).stdout
    # here other problems were solved before, and these in another order: caches must not show
    problems = [problem for file in files for problem in load_problems(file)]
    ours = [solve(problem).to_dict() | {"seconds": None} for problem in reversed(problems)]
    assert json.loads(output) == ours[::-1]


# --------------------------------------------------------------------- body 1 moved along the seeds' line, closed form


@pytest.mark.parametrize("eps", [-0.1, -1e-3, 1e-5, 0.02, 0.3])
@pytest.mark.parametrize("counts", [(1, 1), (1, 2), (2, 2)])
@pytest.mark.parametrize("where", ["switching point", "segment"])
def test_the_whole_curve_scales_as_body_1_moves_off_along_the_seed_line(eps, counts, where):
    """A shift by -eps d multiplies the curve by 1 + eps: "at" is met by exactly |eps d|, of unions too."""
    one, two = scene(0, counts)
    d = two.seed - one.seed
    curve = decision_curve(one, two, box=BOX)
    segment = max(curve.segments, key=lambda s: float(np.linalg.norm(s.end - s.start)))
    rho = curve.switching_points[0].rho if where == "switching point" else (segment.start + segment.end) / 2
    asked = Problem(one, two, nominal=tuple(rho), target=tuple((1 + eps) * rho), goal="at", box=BOX,
                    motion=Translation(tuple(d)))  # fmt: skip
    solution = solve(asked)
    assert solution.usable
    length = float(np.linalg.norm(d))
    assert solution.amount == pytest.approx(abs(eps) * length, rel=1e-8)
    assert solution.parameters["T"] == pytest.approx(-eps * length, rel=1e-8)
    touching = solve(asked.changed(goal="touch"))
    assert touching.usable
    assert touching.amount <= abs(eps) * length * (1 + 1e-9)
    if counts == (1, 1) and eps < 0:  # apart at rest: the first contact on the way
        assert touching.parameters["T"] == pytest.approx(-eps * length, rel=1e-9)


# -------------------------------------------------------------------------------- rivals: dense polar search with coal

ANGLES = 48
SHARES = (0.999, 0.99, 0.95, 0.85, 0.7, 0.5, 0.25, 0.1)


def rays(problem: Problem) -> np.ndarray:
    """Directions in the parameters per unit of amount, all round."""
    if len(problem.weights) == 1:
        return np.array([[1.0], [-1.0]]) / problem.weights
    turn = 2 * math.pi * np.arange(ANGLES) / ANGLES
    return np.column_stack([np.cos(turn), np.sin(turn)]) / problem.weights


def smaller_motions(problem: Problem, amount: float) -> Iterator[np.ndarray]:
    for direction in rays(problem):
        for share in SHARES:
            yield share * amount * direction


def pose_of(problem: Problem, q: np.ndarray) -> np.ndarray:
    return problem.motion.transform(q, problem.movable.seed, problem.static.seed)


RIVAL_TASKS = [number for number, (*_, goal) in enumerate(TASKS) if goal in ("touch", "clear")]
TRACKED_TASKS = [number for number, (*_, goal) in enumerate(TASKS) if goal == "beyond"]


@pytest.mark.sampled(13)
@pytest.mark.parametrize("number", RIVAL_TASKS, ids=lambda k: "-".join(map(str, TASKS[k])))
def test_no_smaller_motion_lies_on_the_other_side_of_contact(number):
    """Where coal sees the pair on the other side than at rest, the contact lies on the way: nearer than our answer."""
    problem, solution = task(number), answer(number)
    if solution.status is Status.ALREADY_SATISFIED:
        assert exact_gap(problem, np.eye(4)) >= 0
        return
    judge = ScaledPair(problem.movable, problem.static)
    side = np.sign(judge.signed_distance(problem.target, np.eye(4)))
    amount = solution.amount if solution.status.found else problem.length
    for q in smaller_motions(problem, amount):
        assert judge.signed_distance(problem.target, pose_of(problem, q)) * side > 0, (q, problem.weights * q)


def tracked_pair(problem: Problem, T: np.ndarray) -> np.ndarray:
    return np.array([float(x) for x in exact_meeting(problem, problem.nominal_contact.features, T)])


@pytest.mark.sampled(3)
@pytest.mark.parametrize("number", TRACKED_TASKS, ids=lambda k: "-".join(map(str, TASKS[k])))
def test_no_smaller_motion_takes_the_tracked_point_beyond_its_target(number):
    problem, solution = task(number), answer(number)
    judge = ScaledPair(problem.movable, problem.static)

    def real(q: np.ndarray) -> bool:
        rho, T = tracked_pair(problem, pose_of(problem, q)), pose_of(problem, q)
        return bool(rho.min() > 0) and abs(judge.signed_distance(rho, T)) < 1e-8

    amount = solution.amount if solution.status.found else 0.3 * problem.length
    for q in smaller_motions(problem, amount):
        rho = tracked_pair(problem, pose_of(problem, q))
        if ((rho - problem.target) * problem.signs >= 0).all():
            assert not all(real(s * q) for s in np.linspace(1, 0.05, 6)), (q, solution.amount)


FAR = {  # convex pairs, seeds at the mean vertex: switching point, requirement, tolerance, motion, parameter that does
    "A by a turn about z": (
        [(1, 3, -1), (-1, -3, -2), (2, -3, -3), (4, 4, 4), (1, -4, -3)],
        [(0, 4, -4), (-1, 6, -7), (0, 2, -2), (3, 1, 0), (7, 0, 1)], 1, "A", 0.002, Rotation("z"), 0.3,
    ),
    "B by a turn about x": (
        [(-4, -3, -1), (0, 3, 0), (4, -2, -4), (-3, -2, 4), (-2, -2, 4)],
        [(-2, 2, 5), (-6, 8, 3), (-8, 9, 3), (-2, 1, 8), (-7, 1, 4)], 1, "B", 0.02, Rotation("x"), -0.5,
    ),
    "D by a screw": (
        [(-1, -3, -1), (-1, -4, -4), (0, 2, 0), (-2, 2, 1), (-4, 3, 3)],
        [(8, 3, -6), (3, 7, -3), (6, 2, -7), (3, 0, -2), (5, 4, -3)], 1, "D", 0.02, Screw("seeds", 0.5), 0.697,
    ),
    "B by a screw along z": (
        [(-2, 1, -2), (-3, -3, 2), (-4, 2, -2), (2, -2, -3), (3, -4, 1)],
        [(-4, -2, -3), (-1, -9, 0), (-4, -8, -2), (-7, -7, -2), (-4, -7, -5)], 1, "B", 0.002,
        Screw(((0, 0, 0), (0, 0, 1)), 1.0), 0.4911,
    ),
    "A by a screw along z": (
        [(-4, 2, -3), (3, 4, 3), (1, -3, 1), (-1, -3, 0), (-1, -4, 0)],
        [(-8, 2, -7), (-5, 0, -3), (-6, -4, -4), (-4, 3, -9), (-8, 1, -4)], 1, "A", 0.002,
        Screw(((0, 0, 0), (0, 0, 1)), 1.0), -0.296,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", FAR)
def test_a_motion_is_found_that_lies_well_beyond_the_size_of_the_tolerance(case):
    """One parameter: the motion given meets everything in exact arithmetic, so some motion no larger must be found."""
    first, second, nominal, letter, tau, motion, q = FAR[case]
    one, two = (Body.convex(rows, seed=np.mean(rows, axis=0)) for rows in (first, second))
    problem = Problem(
        one, two, nominal=nominal, tolerance=tau, requirement=letter, motion=motion, goal="beyond", box=BOX
    )
    for s in np.linspace(0, 1, 33):
        T = pose_of(problem, np.array([s * q]))
        rho = tracked_pair(problem, T)
        assert abs(exact_gap(problem, T, rho)) < 1e-9
    assert ((rho - problem.target) * problem.signs > 0).all()
    solution = solve(problem)
    assert solution.usable, solution.status
    assert solution.amount <= abs(q) * problem.weights[0]


FAR_TOUCH = {  # convex pairs, seeds at the mean vertex: motion, parameters after which the pair is on the other side
    "lift and turn": (
        [(2, -1, -2), (1, -1, 1), (-1, 0, 0), (-1, -2, 1)], [(-4, -1, 3), (-5, -1, -1), (-2, -1, 1), (-2, 1, -1)],
        Translation("z") >> Rotation("z", "origin"), (-0.258, -0.8356),
    ),
    "lift and turn, at first sight by many turns": (
        [(0, -2, -1), (-1, 0, -1), (1, -1, -2), (0, -1, 0)], [(-1, 3, -4), (-5, 2, -2), (-4, 3, -1), (-1, 1, -2)],
        Translation("z") >> Rotation("z", "origin"), (-1.0, -2.618),
    ),
    "two turns": (
        [(2, 0, 2), (2, 1, 1), (-1, -1, -1), (2, 0, 1)], [(5, 0, 1), (5, -2, 3), (1, -3, 0), (5, -3, 3)],
        Rotation("x") >> Rotation("z"), (-0.6822, 0.889),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", FAR_TOUCH)
def test_a_touch_far_from_rest_is_no_larger_than_one_that_is_known(case):
    first, second, motion, q = FAR_TOUCH[case]
    one, two = (Body.convex(rows, seed=np.mean(rows, axis=0)) for rows in (first, second))
    problem = Problem(one, two, target=(1, 1), motion=motion, goal="touch")
    sides = [np.sign(exact_gap(problem, pose_of(problem, np.array(own)))) for own in ((0.0, 0.0), q)]
    assert sides[0] * sides[1] < 0  # so it touches somewhere on the way
    solution = solve(problem)
    assert solution.usable
    assert solution.amount <= float(np.linalg.norm(problem.weights * q))


# ---------------------------------------------------------------------------------------------- anything may be asked


def odd_problem(rng: np.random.Generator) -> Problem | None:
    """Small integer bodies, parallel faces and edges everywhere, any goal, state, path and motion; None if refused."""
    try:
        bodies = [
            Body.convex(rng.integers(-2, 3, (6, 3)).astype(float) + shift, seed=shift + rng.integers(-1, 2, 3) / 2)
            for shift in (np.zeros(3), rng.integers(-4, 5, 3).astype(float))
        ]
        goal = str(rng.choice(["beyond", "at", "touch", "clear"]))
        pair = str(rng.choice(["any", "any", "clear", "touch"]))
        clear = "clear" in (goal, pair) and "touch" not in (goal, pair)
        nominal: Any = int(rng.integers(1, 4)) if goal in ("beyond", "at") else "drawn"
        limits = {}
        motion = list(MOTIONS.values())[int(rng.integers(len(MOTIONS)))]
        if rng.random() < 0.3:
            limits = {motion.parameters[0].name: tuple(sorted(rng.uniform(-1, 1, 2)))}
        return Problem(*bodies, nominal=nominal, tolerance=float(rng.choice([0, 1e-9, 0.02, 0.5])), box=BOX,
                       requirement=LETTERS[int(rng.integers(4))], motion=motion, goal=goal, pair=pair,
                       clearance=float(rng.choice([0, 0.1])) if clear else 0.0, limits=limits,
                       path=str(rng.choice(["coherent", "free"])))  # fmt: skip
    except InputError:
        return None


@pytest.mark.slow
def test_whatever_is_asked_gets_a_status_and_no_exception():
    rng, asked, statuses = np.random.default_rng(51), 0, set()
    while asked < 16:
        problem = odd_problem(rng)
        if problem is None:
            continue
        asked += 1
        solution = solve(problem)
        statuses.add(solution.status)
        assert not solution.lower_bound > solution.amount
        json.dumps(solution.to_dict(), allow_nan=False)
    assert {Status.SOLVED, Status.ALREADY_SATISFIED} <= statuses
    assert len(statuses) >= 3


def test_no_answer_of_an_odd_question_is_rejected_by_the_judge():
    rng, asked, rejected = np.random.default_rng(52), 0, []
    while asked < 32:
        problem = odd_problem(rng)
        if problem is None:
            continue
        asked += 1
        solution = solve(problem)
        if solution.status is Status.NOT_VERIFIED:
            rejected.append((asked, problem.goal, [check.name for check in solution.certificate.failed]))
    assert rejected == []


def test_a_switching_point_at_the_end_of_a_flush_segment_gets_an_answer_that_the_judge_accepts():
    """Edge on edge, then an edge flush on a face: after any turn only one vertex of that edge is the contact."""
    rows = ([(2, 0, -2), (0, -2, 2), (4, -3, 0), (-1, -2, -1), (-2, 2, -2)],
            [(-3, 3, 1), (-5, -2, 0), (-7, 3, -4), (-2, -1, 2), (-6, 1, -4)])  # fmt: skip
    one, two = (Body.convex(own, seed=np.mean(own, axis=0)) for own in rows)
    problem = Problem(one, two, nominal=2, tolerance=0.002, requirement="D", goal="beyond", box=BOX,
                      motion=Screw(((0, 0, 0), (0, 0, 1)), 1.0))  # fmt: skip
    assert [feature.kind for feature in problem.nominal_contact.features] == ["E1E2", "F1E2"]
    assert solve(problem).status is not Status.NOT_VERIFIED


# ----------------------------------------------------------------------------------------------- arguments of solve()


def example(name: str = "B") -> Problem:
    return problems("example1")[name]


@pytest.mark.parametrize("model", ["x", "", None, "AUTO", 1])
def test_unknown_models_are_refused_with_those_that_are_known(model):
    with pytest.raises(InputError, match="model") as caught:
        solve(example(), model=model)
    assert "auto" in caught.value.allowed


@pytest.mark.parametrize("problem", [None, "example1.toml", 3, {"nominal": 1}, []])
def test_what_is_no_problem_is_refused(problem):
    with pytest.raises(InputError, match="Problem"):
        solve(problem)


def test_a_proof_is_had_where_it_is_asked_for():
    assert solve(example()).evidence is None
    proved = solve(example(), certify=True)
    assert proved.usable
    assert 0 <= proved.gap <= 1e-4
    assert proved.evidence is not None


@pytest.mark.parametrize("certify", ["yes", None, 1, 0.0])
def test_what_is_no_truth_value_is_refused(certify):
    with pytest.raises(InputError, match="certify"):
        solve(example(), certify=certify)


def test_options_are_keywords():
    with pytest.raises(TypeError):
        solve(example(), "auto")


def test_throw_raises_with_the_solution_where_nothing_usable_was_found():
    narrow = example().changed(limits={"TZ": (0, 1e-3), "RZ": (0, 1e-3)})
    quiet = solve(narrow)
    assert not quiet.usable
    with pytest.raises(UnsolvedError) as caught:
        solve(narrow, throw=True)
    assert isinstance(caught.value.solution, Solution)
    assert plain(caught.value.solution) == plain(quiet)
    assert str(caught.value).endswith(quiet.status.value)


def test_throw_returns_what_is_usable():
    assert plain(solve(example(), throw=True)) == plain(solve(example()))


@pytest.mark.parametrize("number", [0, 8, 17, 33, 40], ids=lambda k: "-".join(map(str, TASKS[k])))
def test_the_nonlinear_program_alone_agrees_with_the_stages(number):
    staged, forced = answer(number), solve(task(number), model="nlp")
    assert forced.stage.startswith("4")
    if staged.status.found:
        assert forced.status.found
        assert forced.amount == pytest.approx(staged.amount, rel=1e-6, abs=1e-9)


def test_solving_changes_nothing_in_the_problem():
    problem = example()
    before = json.dumps(problem.to_dict())
    solution = solve(problem)
    assert json.dumps(problem.to_dict()) == before
    assert solution.problem is problem
    assert replace(solution).to_dict() == solution.to_dict()


def test_a_turn_that_flush_contacts_do_not_take_makes_the_least_motion_no_larger():
    """Where the keyway's faces must stay flush, starts with the turn led to another valley."""
    (asked,) = [p for p in problems("keyway").values() if (p.goal, p.requirement) == ("beyond", "C")]
    without = solve(asked)
    within = solve(asked.changed(motion=asked.motion >> Rotation("z"), published=None))
    assert without.usable
    assert within.amount == pytest.approx(without.amount, rel=1e-9)
