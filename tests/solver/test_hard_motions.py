"""Motions and optimisers where such methods are known to fail: truth in closed form, or proved by branch and bound."""

from __future__ import annotations

import json
import math
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from cases import box_shape, shape, union

import fcdm_opt as fo
from fcdm_opt import pacing
from fcdm_opt.along.coherent_range import coherent_range
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion.motions import Free, Motion, Rotation, Screw, Translation
from fcdm_opt.motion.own_motion import OwnMotion
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.solver import solve

X, Y, Z = (Translation(axis) for axis in "xyz")
RX, RY, RZ = (Rotation(axis) for axis in "xyz")
Z_AXIS = ((0, 0, 0), (0, 0, 1))
WIDE = ((0.1, 9.0), (0.1, 9.0))
GAP = 1e-4  # relative, of every certificate for one and two parameters
ROOM = 1e-11  # lengths that are no overlap yet: `Tolerances.cut` of bodies of size 2


def box(centre: Any, half: Any, seed: Any = None) -> Body:
    middle, reach = np.array(centre, dtype=float), np.broadcast_to(half, 3)
    return box_shape(middle - reach, middle + reach, centre if seed is None else seed).body()


CUBE = box((0, 0, 0), 0.5)
PLATE = box((1.25, 0, 0), (0.25, 2, 2))  # 1 <= x <= 3/2


def problem(movable: Body = CUBE, static: Body = PLATE, **arguments: Any) -> Problem:
    return Problem(movable, static, **{"target": (1, 1), "motion": X, "goal": "touch", "box": WIDE, **arguments})


def about_z(body: Body, angle: float) -> Body:
    return body.moved(RZ.transform([angle], body.seed, body.seed))


def locked(*names: str) -> dict[str, tuple[float, float]]:
    return dict.fromkeys(names, (0.0, 0.0))


def consistent(solution: Solution) -> Solution:
    """Never a motion that the judge rejects, a bound above the amount, or an impossibility without proof."""
    assert solution.status is not Status.NOT_VERIFIED, solution.certificate.failed
    assert solution.usable == solution.status.found == solution.certificate.passed == bool(solution.parameters)
    if solution.status.found:
        assert np.isfinite([solution.amount, *solution.parameters.values()]).all()
        assert 0 <= solution.lower_bound <= solution.amount
    else:
        assert math.isnan(solution.amount)
        assert solution.transform is None
    json.dumps(solution.to_dict(), allow_nan=False)
    return solution


def solved(asked: Problem, amount: float, *, rel: float = 1e-9, certify: bool = False, **q: float) -> Solution:
    """The solution: judged, of this amount and these parameters; with `certify` and few parameters proved.

    What counts as touching leaves an amount open by `ROOM`.
    """
    solution = consistent(solve(asked, certify=certify))
    assert solution.status in (Status.SOLVED, Status.PAIR_OVERLAPS)
    assert solution.amount == pytest.approx(amount, rel=rel, abs=ROOM)
    assert solution.lower_bound <= amount * (1 + 1e-9) + 1e-15
    if certify and len(asked.weights) <= 2:
        assert solution.gap <= GAP or solution.amount - solution.lower_bound <= ROOM
    for name, value in q.items():
        assert solution.parameters[name] == pytest.approx(value, rel=1e-6, abs=1e-7 * max(1.0, amount))
    return solution


def refused(asked: Problem, *statuses: Status, certify: bool = False) -> Solution:
    solution = consistent(solve(asked, certify=certify))
    assert solution.status in statuses
    return solution


def turn(q: Any) -> Any:
    """A rotation about z through the origin, as a user writes it."""
    import casadi

    T, c, s = casadi.SX.eye(4), casadi.cos(q[0]), casadi.sin(q[0])
    T[0, 0], T[0, 1], T[1, 0], T[1, 1] = c, -s, s, c
    return T


OWN_TURN = OwnMotion(turn, [("RZ", "rotation")])
EVERY_MOTION: dict[str, Motion] = {
    "translation": Translation((1, 2, -1)),
    "rotation": RY,
    "screw": Screw("seeds", 0.3),
    "free screw": Screw(),
    "two translations": X >> Y,
    "translation, then rotation": X >> RZ,
    "three": X >> Y >> RZ,
    "free": Free(),
    "own": OWN_TURN,
    "free, then screw": Free() >> Screw(),
}

# ---------------------------------------------------------------------------------------- requirement already met


@pytest.mark.parametrize("certify", [False, True])
@pytest.mark.parametrize("motion", EVERY_MOTION)
def test_a_requirement_already_met_asks_for_nothing(motion, certify):
    """The plate's face is 1/2 away; at scale 2 the cube's face lies on it."""
    for changes in ({"goal": "clear", "clearance": 0.5}, {"target": (2, 1)}, {"target": (2, 1), "goal": "clear"}):
        solution = consistent(solve(problem(motion=EVERY_MOTION[motion], **changes), certify=certify))
        assert solution.status is Status.ALREADY_SATISFIED
        assert solution.amount == solution.lower_bound == solution.gap == 0
        np.testing.assert_array_equal(solution.transform, np.eye(4))


# ------------------------------------------------------------------------------- translations cannot, a rotation can


def test_a_square_in_a_slot_is_freed_by_a_turn_alone():
    """Half-width 4/5, turned by 45 degrees, reaches 1.13 between walls at 1: it must reach 4/5 (cos t + sin t) = 1."""
    slot = union(box_shape((-20, -9, -9), (20, -1, 9)), box_shape((-20, 1, -9), (20, 9, 9)), seed=(0, 0, 0)).body()
    square = about_z(CUBE, math.pi / 4)
    asked = {"target": (1.6, 1), "goal": "clear", "limits": {"TX": (-1, 1)}}
    for motion in (X, X >> Z):
        limits = {"limits": {"TX": (-1, 1)} | ({"TZ": (-1, 1)} if motion is not X else {})}
        refused(problem(square, slot, motion=motion, **asked | limits), Status.INFEASIBLE)
    t = math.pi / 4 - math.asin(1.25**2 - 1) / 2
    for motion in (X >> RZ, X >> RZ >> Z, Free()):
        turned = problem(square, slot, motion=motion, **asked)
        solution = solved(turned, turned.length * t, certify=len(motion.parameters) == 2)
        assert abs(solution.parameters["RZ"]) == pytest.approx(t)


# --------------------------------------------------------------------------------- only beyond the coherent range


@pytest.mark.parametrize("side", [1, -1])
def test_a_motion_beyond_the_coherent_range_is_told_from_none(side):
    """A tip glides down a wall, .1 of its slope 1/200, past a bump of .1; the range ends where the tip meets that."""
    tip = shape([(x, y, z) for x, y, z in np.vstack([np.eye(3), -np.eye(3)]) / 2 + [0, side, 0]], (0, side, 0)).body()
    bump = box_shape(("0.9", "-0.1", "-0.1"), ("1.5", "0.1", "0.1"))
    wall = union(box_shape((1, -4, -4), (2, 4, 4)), bump, seed=("1.5", 0, 0)).body()
    asked = problem(tip, wall, nominal=(2, 1), target=(2.02, 1), goal="at", motion=Translation((-0.01, -2 * side, 0)))
    length = math.hypot(0.01, 2)
    refused(asked, Status.LEFT_COHERENT_RANGE)
    event = coherent_range(asked, [1.0]).last
    assert 0 < event.x < length
    assert event.kind == "overlap"
    solved(asked.changed(path="free"), length, T=length)
    nearer = asked.changed(target=tuple(asked.nominal_pair + 0.99 * event.x / length * np.array([0.02, 0])))
    solved(nearer, 0.99 * event.x)


# ----------------------------------------------------------------------------------------- infeasible at any motion


@cache
def ball() -> Body:
    """Points on the unit sphere about the seed: turned about it no point gets further than 1."""
    points = np.random.default_rng(1).normal(size=(40, 3))
    return Body.convex(points / np.linalg.norm(points, axis=1)[:, None], seed=(0, 0, 0))


@pytest.mark.parametrize("motion", [RZ, Rotation((1, 2, 3)), Screw(((0, 0, 0), (1, 1, 0)), 0.0), RX >> RZ],
                         ids=["z", "slanted", "screw", "two"])  # fmt: skip
@pytest.mark.parametrize(("near", "goal"), [(2.0, "touch"), (0.5, "clear")])
def test_a_ball_turned_about_its_centre_is_proved_infeasible(motion, near, goal):
    """The plate begins at 2, out of reach, or at 1/2, where the ball's inscribed one overlaps it."""
    plate = box((near + 0.25, 0, 0), (0.25, 3, 3))
    normals, corners = ball().parts[0].normals, ball().parts[0].vertices
    assert (np.asarray(normals) @ corners.T).max(axis=1).min() > 0.5
    assert refused(problem(ball(), plate, motion=motion, goal=goal), Status.INFEASIBLE).lower_bound == math.inf


@pytest.mark.slow
@pytest.mark.parametrize("motion", [RX >> RY >> RZ, Free()], ids=["three turns", "free"])
def test_without_a_proof_a_ball_is_not_called_infeasible(motion):
    plate = box((2.25, 0, 0), (0.25, 3, 3))
    names = {parameter.name for parameter in motion.parameters}
    asked = problem(ball(), plate, motion=motion, limits=locked(*({"TX", "TY", "TZ"} & names)))
    solution = refused(asked, Status.INFEASIBLE, Status.NOT_FOUND)
    assert (solution.status is Status.INFEASIBLE) == (solution.lower_bound == math.inf)


# ------------------------------------------------------------------------------------- optimum where features change


@pytest.mark.parametrize("motion", [X >> RZ, X >> Y >> RZ], ids=["two", "three"])
@pytest.mark.parametrize("goal", ["touch", "clear"])
def test_the_optimum_is_a_kink_where_one_vertex_takes_over_from_another(goal, motion):
    """A diamond in a wall at x = 4/5, turns cheap: at 45 degrees it lies flush, 1/5 in; either way on it reaches
    further by 1 a radian, more than turns cost: the weight squared times 45 degrees, .008.
    """  # fmt: skip
    diamond, wall = about_z(box((0, 0, 0), 1), math.pi / 4), box((1.8, 0, 0), (1, 5, 5))
    asked = problem(diamond, wall, goal=goal, motion=motion, weights={"RZ": 0.1})
    solution = solved(asked, math.hypot(0.2, 0.1 * math.pi / 4), TX=-0.2, certify=len(motion.parameters) == 2)
    assert abs(solution.parameters["RZ"]) == pytest.approx(math.pi / 4)


# ------------------------------------------------------------------------------------------ two optima of equal amount


@pytest.mark.parametrize("motion", [RZ, RY, X >> RZ, RZ >> Y], ids=["z", "y", "x, z", "z, y"])
def test_of_two_optima_of_equal_amount_one_is_chosen_and_always_the_same(motion):
    """The cube at 1.6 swings its edge to x = 1 either way: 4/5 (cos t + sin t) = 1."""
    t = math.asin(1.25**2 - 1) / 2
    turned = next(name for name, kind in motion.parameters if kind == "rotation")
    limits = {name: (0.0, 0.0) for name, _ in motion.parameters if name != turned}
    asked = problem(target=(1.6, 1), motion=motion, limits=limits)
    first = solved(asked, asked.length * t)
    assert abs(first.parameters[turned]) == pytest.approx(t)
    again = solve(asked.changed())
    assert again.to_dict() | {"seconds": None} == first.to_dict() | {"seconds": None}
    for sign in (1, -1):
        half = asked.changed(limits=limits | {turned: tuple(sorted((-0.05 * sign, sign)))})
        solved(half, asked.length * t, certify=True, **{turned: sign * t})


# --------------------------------------------------------------------------------------------------- rotation by pi


@pytest.mark.parametrize(
    ("motion", "sign"), [(RZ, -1), (Rotation("-z"), 1), (Rotation("z", "origin"), -1), (Screw(Z_AXIS, 0.0), -1),
                         (Screw(((0, 0, 7), (0, 0, -3)), 0.0), 1), (OWN_TURN, -1)]
)  # fmt: skip
def test_a_lever_is_swung_onto_its_stop_by_half_a_turn(motion, sign):
    """It points along -x and its face comes down flush on the stop, which reaches to that face."""
    lever = box_shape((-3, "-0.2", "-0.5"), (0, "0.2", "0.5"), (0, 0, 0)).body()
    stop = box_shape((1, -4, -2), (3, "-0.2", 2)).body()
    name = motion.parameters[0].name
    asked = problem(lever, stop, motion=motion, limits={name: tuple(sorted((0.0, 3.5 * sign)))})
    solution = solved(asked, asked.length * math.pi, certify=True, **{name: sign * math.pi})
    np.testing.assert_allclose(solution.transform, np.diag([-1, -1, 1, 1]), atol=1e-9)


# ----------------------------------------------------------------------------------- screws without and with only pitch


def hulls(seed: int = 5) -> tuple[Body, Body]:
    rng = np.random.default_rng(seed)
    one = rng.normal(size=(8, 3))
    return Body.convex(one, seed=one.mean(axis=0)), Body.convex(rng.normal(size=(8, 3)) + np.array([2.5, 1, 0.3]))


@pytest.mark.parametrize("goal", ["touch", "clear", "at", "beyond"])
@pytest.mark.parametrize("pitch", [0.0, math.inf, -math.inf])
def test_a_screw_at_the_ends_of_its_pitch_is_a_rotation_or_a_translation(goal, pitch):
    one, two = hulls()
    point, direction = (0.3, -0.2, 0.1), (1.0, 0.5, 0.2)
    sign = math.copysign(1.0, pitch)
    plain = Rotation(direction, point) if pitch == 0 else Translation(tuple(sign * x for x in direction))
    asked = {"target": None, "nominal": 2, "tolerance": 0.02, "requirement": "A", "goal": goal}
    if goal == "at":
        contact = problem(one, two, motion=X).curve.segments[1]
        asked = {"nominal": tuple((contact.start + contact.end) / 2), "goal": goal, "target": None, "tolerance": 0.02,
                 "requirement": "D"}  # fmt: skip
    screwed, other = (
        consistent(solve(problem(one, two, motion=motion, **asked), certify=True))
        for motion in (Screw((point, direction), pitch), plain)
    )
    assert screwed.status is other.status
    if other.status.found:
        assert screwed.amount == pytest.approx(other.amount, rel=1e-9)
        np.testing.assert_allclose(screwed.transform, other.transform, atol=1e-8)
        assert max(screwed.gap, other.gap) <= GAP


# ------------------------------------------------------------------------------------------------- seeds that coincide


def test_seeds_that_coincide_as_drawn_are_refused_by_name():
    for motion in (Screw(), Screw(pitch=0.5), X >> Screw(), Free() >> Screw(pitch=0.0)):
        with pytest.raises(InputError, match=r"Screw\.axis"):
            problem(CUBE, box((2, 0, 0), 0.5, seed=(0, 0, 0)), motion=motion)
    assert problem(CUBE, box((2, 0, 0), 0.5, seed=(0, 0, 0)), motion=Screw(Z_AXIS)).weights.size == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "there"),
    [(X >> Screw(), "anywhere"), (X >> Screw(pitch=0.3), "just there"), (X >> Screw(pitch=0.3), "beside"),
     (Rotation("z", (0.5, 0, 0)) >> Screw(), "anywhere"), (Free() >> Screw(pitch=0.0), "just there")],
)  # fmt: skip
def test_seeds_brought_together_by_an_earlier_step_are_no_error(motion, there):
    """TX = 1, or half a turn, takes seed to seed, up to rounding; there the screw's parameters are no motion at all.

    Turns, shifts and rates at rest were taken from finite motions, which may end just there.
    """
    first = motion.parameters[0].name
    at = 1.0 if first == "TX" else math.pi
    limits = {"anywhere": {}, "just there": {first: (at, at)}, "beside": {first: (at - 1e-12, at + 1e-12)}}[there]
    soon = {"effort": "quick"} | ({"time": 0.5} if there == "just there" else {})  # no motion is found there
    static = box_shape((2, "-2.5", "-0.7"), (3, "0.6", "0.5"), seed=(1, 0, 0)).body()
    for goal, target in (("touch", (1, 1)), ("clear", (4.5, 1)))[: 1 if there == "beside" else 2]:  # it takes long
        asked = problem(CUBE, static, motion=motion, goal=goal, target=target, limits=limits)
        solution = solve(asked, **soon)
        if (
            there == "just there" and solution.status is Status.NOT_VERIFIED
        ):  # seeds apart by rounding: no axis to judge
            assert not solution.usable
        else:
            consistent(solution)
        assert solution.usable or there != "anywhere"
    seat = problem(box((-3, 0, 0), 0.5, seed=(0, 0, 0)), box((-1, 0, 0), (0.5, 3, 3), seed=(1, 0, 0)), motion=motion,
                   nominal=(1, 1.4), goal="seat", target=(1.02, 1.4), limits=limits)  # fmt: skip
    consistent(solve(seat, **soon))


# --------------------------------------------------------------------------------------------------------- tolerances
#
# Half-widths 1, 1 and 1, 2, offset (4, 5): after a shift (x, y) the lines are rho_1 + rho_2 = 4 - x and
# rho_1 + 2 rho_2 = 5 - y, which cross at (3 - 2 x + y, 1 + x - y).


def crossing(**arguments: Any) -> Problem:
    one, two = box((0, 0, 0), 1), box((4, 5, 0), (1, 2, 1))
    return problem(one, two, **{"nominal": (3, 1), "target": None, "motion": X >> Y, "goal": "at", **arguments})


SIGNS = {"A": (1, 1), "B": (1, -1), "C": (-1, 1), "D": (-1, -1)}


@pytest.mark.parametrize("letter", "ABCD")
@pytest.mark.parametrize("tau", [0.0, 1e-12, 0.5, 0.99, 1.0])
def test_tolerances_from_nothing_to_everything(letter, tau):
    """At scale 0, which 100 % allow whatever the requirement, there is no body: refused, with the key."""
    if tau == 1.0:
        with pytest.raises(InputError, match="tolerance"):
            crossing(tolerance=tau, requirement=letter)
        return
    off = tau * np.array([3.0, 1.0]) * SIGNS[letter]
    x, y = -(off[0] + off[1]), -(off[0] + 2 * off[1])
    solution = consistent(solve(crossing(tolerance=tau, requirement=letter), certify=tau > 1e-9))
    assert solution.status.found
    assert solution.amount == pytest.approx(math.hypot(x, y), rel=1e-9, abs=1e-11)
    assert list(solution.parameters.values()) == pytest.approx([x, y], rel=1e-9, abs=1e-11)
    assert solution.status is not Status.ALREADY_SATISFIED or tau <= 1e-12
    assert solution.status is Status.ALREADY_SATISFIED or tau > 0


# ------------------------------------------------------------------------------------------------ both signs of axes


def mirrored(body: Body, axis: int) -> Body:
    flip = np.where(np.arange(3) == axis, -1.0, 1.0)
    return Body.from_parts([part.vertices * flip for part in body.parts], seed=body.seed * flip)


@pytest.mark.sampled(7)
@pytest.mark.parametrize("goal", ["touch", "clear", "at"])
@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("step", [Translation, Rotation])
def test_mirrored_problems_and_axes_have_mirrored_motions(step, axis, goal):
    """A mirror keeps turns about its own normal and shifts along others, and reverses the rest."""
    one, two = hulls(9)
    nominal = problem(one, two).curve.segments[1]
    middle = tuple((nominal.start + nominal.end) / 2)
    asked = problem(one, two, motion=step(axis), goal=goal, nominal=middle, target=tuple(1.01 * np.array(middle)))
    base = consistent(solve(asked))
    reverse = consistent(solve(asked.changed(motion=step(f"-{axis}"))))
    assert reverse.status is base.status
    if base.status.found:
        (q,) = base.parameters.values()
        assert list(reverse.parameters.values()) == pytest.approx([-q], rel=1e-9, abs=1e-12)
    for k in range(3):
        other = consistent(solve(asked.changed(movable=mirrored(one, k), static=mirrored(two, k))))
        assert other.status is base.status
        if base.status.found:
            own = "xyz"[k] == axis
            sign = -1.0 if own == (step is Translation) else 1.0
            assert list(other.parameters.values()) == pytest.approx([sign * q], rel=1e-8, abs=1e-10)


# ------------------------------------------------------------------------------ optimisers: the wrong one of many roots

TURN_5 = 2 * math.atan(5)  # 2.7468; the next of tan(t/2) = 5 that IPOPT ends at is 27.8795


@cache
def wedge() -> tuple[Body, Body]:
    """A lever whose tip is 1 from the origin, and a wall along the line through (-1, 0) of slope 5.

    The tip at (cos t, sin t) is on that line where tan(t/2) = 5, and at t = pi; it is in the wall between these.
    """
    lever = shape([(1, 0, 0), ("-0.1", "0.1", "-0.1"), ("-0.1", "-0.1", "-0.1"), ("-0.1", 0, "0.1")], (0, 0, 0)).body()
    along, across = np.array([1, 5, 0]) / math.sqrt(26), np.array([-5, 1, 0]) / math.sqrt(26)
    corners = [(-1, 0, 0) + a * along + b * across + (0, 0, c) for a in (-3, 3) for b in (0, 2) for c in (-1, 1)]
    return lever, Body.convex(corners)


def levers(motion: Motion, **limits: tuple[float, float]) -> Problem:
    return problem(*wedge(), motion=motion, limits=limits, length=1.0)


@pytest.mark.sampled(7)
@pytest.mark.parametrize("model", ["auto", "nlp", "branch and bound"])
@pytest.mark.parametrize("limits", [{}, {"RZ": (-40, 40)}, {"RZ": (0, 40)}], ids=str)
@pytest.mark.parametrize("motion", [RZ, OWN_TURN], ids=["rotation", "own"])
def test_the_nearest_of_all_roots_is_found(motion, limits, model):
    solution = consistent(solve(levers(motion, **limits), model=model))
    assert solution.parameters["RZ"] == pytest.approx(TURN_5, rel=1e-9)
    assert consistent(solve(levers(motion, **limits), certify=True)).gap <= GAP


def test_the_nearest_root_by_other_motions():
    solved(levers(Rotation("-z")), TURN_5, **{"R-Z": -TURN_5}, certify=True)
    solved(levers(Screw(Z_AXIS, 0.0)), TURN_5, screw_angle=TURN_5, certify=True)
    solved(levers(RZ >> X, TX=(0, 0)), TURN_5, RZ=TURN_5, certify=True)
    solved(levers(Free(), **locked("TX", "TY", "TZ", "RX", "RY"), RZ=(-40, 40)), TURN_5, RZ=TURN_5)


@pytest.mark.parametrize(
    ("limits", "root"),
    [((3.2, 40), TURN_5 + 2 * math.pi), ((20, 40), TURN_5 + 6 * math.pi), ((27, 40), TURN_5 + 8 * math.pi),
     ((-40, -3.2), TURN_5 - 2 * math.pi), ((-40, -20), -7 * math.pi)],
)  # fmt: skip
def test_a_root_more_than_a_turn_from_rest_was_called_impossible(limits, root):
    """Where limits exclude rest a whole turn was looked at from rest, not from where the limits begin."""
    assert solved(levers(RZ, RZ=limits), abs(root), RZ=root).lower_bound > 0
    solved(levers(RZ, RZ=limits), abs(root), RZ=root, certify=True)


def test_limits_between_the_roots_leave_nothing():
    refused(levers(RZ, RZ=(-3.1, 2.7)), Status.INFEASIBLE)
    refused(levers(RZ, RZ=(3.2, 9.0)), Status.INFEASIBLE)


# ------------------------------------------------------------------------------- optimisers: stationary where it starts

TURN_9 = math.acos(0.9)  # cos t = 9/10


@cache
def claw() -> tuple[Body, Body]:
    """A tip at x = 1 that points to the pivot, before a thin wall at 9/10: at rest turns do not change their gap."""
    tip = shape([(1, 0, 0), ("1.3", "0.1", "0.1"), ("1.3", "-0.1", "0.1"), ("1.3", 0, "-0.1")], (0, 0, 0)).body()
    return tip, box((0.85, 0, 0), (0.05, 2, 2))


@cache
def tooth() -> tuple[Body, Body]:
    """An edge at x = 1, in a wall that begins at 9/10."""
    tip = shape([(x, y, z) for x, y in ((1, 0), ("0.5", "0.1"), ("0.5", "-0.1")) for z in ("-0.2", "0.2")], (0, 0, 0))
    return tip.body(), box((1.4, 0, 0), (0.5, 2, 2))


@pytest.mark.sampled(17)
@pytest.mark.parametrize(
    ("pair", "goal", "motion", "model"),
    [(*asked, motion, model)
     for k, asked in enumerate([(claw, "touch"), (claw, "at"), (tooth, "touch"), (tooth, "clear")])
     for j, motion in enumerate([RZ, Rotation("-z"), OWN_TURN, RX >> RZ, RZ >> Y])
     for model in ("auto", ("nlp", "branch and bound")[(j + k // 2) % 2])],
)  # fmt: skip
def test_a_gap_that_is_stationary_at_rest_is_closed(pair, goal, motion, model):
    asked = {"nominal": (0.9, 1)} if goal == "at" else {}
    problem_ = problem(*pair(), motion=motion, goal=goal, length=1.0, limits=locked("TY") if motion.parameters[-1].name
                       == "TY" else {}, **asked)  # fmt: skip
    solution = consistent(solve(problem_, model=model))
    assert solution.amount == pytest.approx(TURN_9, rel=1e-6)
    if model == "auto":
        assert consistent(solve(problem_, certify=True)).gap <= GAP


@pytest.mark.slow
@pytest.mark.parametrize("motion", [RX >> RY >> RZ, Free()], ids=["three turns", "free"])
@pytest.mark.parametrize("goal", ["touch", "clear"])
def test_where_no_turn_gains_anything_at_rest_the_descent_went_far_astray(goal, motion):
    """The tooth was turned by 1.04 radians, or by .69 about y, where .45 about z will do."""
    limits = locked(*(name for name, kind in motion.parameters if kind == "translation"))
    solution = consistent(solve(problem(*tooth(), motion=motion, goal=goal, length=1.0, limits=limits)))
    assert solution.amount <= TURN_9 * (1 + 1e-9)


# --------------------------------------------------------------------- optimisers: dependent gradients, almost feasible


@pytest.mark.sampled(8)
@pytest.mark.parametrize("motion", [X >> Y >> Z, Free(), X >> Y >> Z >> RX >> RY >> RZ], ids=["three", "free", "six"])
@pytest.mark.parametrize("off", [1.0, 1e-3, 1e-6, 1e-7, 1e-8])
def test_a_corner_is_brought_to_a_corner_however_near(motion, off):
    """Three faces each meet there; the way is the distance of the corners, in whose direction a turn gains nothing."""
    solution = solved(problem(CUBE, box((1 + off,) * 3, 0.5), motion=motion), math.sqrt(3) * off)
    np.testing.assert_allclose(solution.transform[:3, 3], off, rtol=1e-6, atol=ROOM)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("off", "turning"),
    [(1e-3, (Free(), X >> Y >> Z >> RX >> RY >> RZ)), (1e-6, (Free(),)), (1e-8, (X >> Y >> Z >> RX >> RY >> RZ,))],
)
def test_corners_in_each_other_come_apart(off, turning):
    """By the overlap along one axis; with turns by less, each vertex being at its own lever."""
    static = box((1 - off,) * 3, 0.5)
    solved(problem(CUBE, static, motion=X >> Y, goal="clear"), off, certify=True)
    solved(problem(CUBE, static, motion=X >> Y >> Z), off)
    turned = solved(problem(CUBE, static, motion=X >> RZ), off * math.sqrt(3) / 2, rel=off + 1e-7)
    assert turned.amount < off
    for motion in turning:
        assert consistent(solve(problem(CUBE, static, motion=motion))).amount <= off + ROOM


OCTAHEDRON = [(x, y, z) for row in np.vstack([np.eye(3), -np.eye(3)]) / 2 for x, y, z in [row]]


@pytest.mark.parametrize("goal", ["at", "touch", "clear"])
@pytest.mark.parametrize("letter", "AD")
@pytest.mark.parametrize("tau", [0.02, 1e-7])
def test_tips_that_meet_have_eight_lines_in_one(goal, letter, tau):
    one, two = shape(OCTAHEDRON, (0, 0, 0)), shape(OCTAHEDRON, (0, 0, 0)).shifted((1, 0, 0))
    asked = problem(one.body(), two.body(), nominal=(1, 1), target=None, tolerance=tau, requirement=letter, goal=goal)
    if (goal, letter) == ("clear", "D"):
        assert solve(asked).status is Status.ALREADY_SATISFIED
    else:
        solved(asked, tau, rel=1e-7, TX=-tau if letter == "A" else tau)
    for motion in (X >> Y >> Z, X >> RZ):  # "at" by these: one facet's line is modelled, and the judge asks for tips
        other = solve(asked.changed(motion=motion))
        assert other.usable == (other.status.found and other.certificate.passed)
        assert not other.status.found or 0 <= other.lower_bound <= other.amount <= tau * (1 + 1e-7)


# ---------------------------------------------------------------------------- optimisers: infeasible by next to nothing

LITTLE = 5e-8  # what HiGHS lets pass


@pytest.mark.parametrize("certify", [False, True])
@pytest.mark.parametrize("off", [-LITTLE, LITTLE])
def test_limits_that_miss_by_next_to_nothing(off, certify):
    """1/2 along x; or x + t / sqrt 2 = 1/2, where x ends at .3."""
    one = problem(limits={"TX": (-1, 0.5 + off)})
    two, three = (
        problem(motion=motion, limits={"TX": (-1, 0.3), "T": (-1, (0.2 + off) * math.sqrt(2))})
        for motion in (X >> Translation((1, 1, 0)), X >> Translation((1, 1, 0)) >> Y)
    )
    turned = problem(motion=X >> RZ, limits={"TX": (-1, 0.5 + off), "RZ": (0, 0)})
    for asked, amount in ((one, 0.5), (two, math.hypot(0.3, 0.2 * math.sqrt(2))), (turned, 0.5)):
        if off > 0:
            solved(asked, amount, certify=certify)
        else:
            refused(asked, Status.INFEASIBLE, certify=certify)
    assert consistent(solve(three)).status is (Status.SOLVED if off > 0 else Status.INFEASIBLE)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("certify", [False, True])
@pytest.mark.parametrize("motion", [Y, X >> Y, Y >> Z, Y >> RZ], ids=["y", "x, y", "y, z", "y, turn"])
@pytest.mark.parametrize("off", [-LITTLE, LITTLE])
def test_keep_outs_that_leave_a_slot_too_narrow_by_next_to_nothing(off, motion, certify):
    """The block fills y < 2, the slot, 1 wide but for `off`, is about y = 3; the cube is 1."""
    block = box((0, 0, 0), (9, 2, 9))
    below, above = box((0, 2.2 - off / 2, 0), (9, 0.3, 9)), box((0, 4 + off / 2, 0), (9, 0.5, 9))
    names = [parameter.name for parameter in motion.parameters]
    limits = {"TY": (-0.1, 4.0), "TX": (-2, 2), "TZ": (-2, 2), "RZ": (-0.3, 0.3)}
    asked = problem(CUBE, block, goal="clear", motion=motion, limits={name: limits[name] for name in names},
                    keep_out=[KeepOut(below, name="below"), KeepOut(above, name="above")])  # fmt: skip
    if off > 0:
        solved(asked, 3 - off / 2, certify=certify, TY=3.0)
    else:
        refused(asked, Status.INFEASIBLE, certify=certify)


# --------------------------------------------------------------------------- optimisers: a quadratic program, to 1e-12


@cache
def slanted() -> Body:
    """Its face is x + y = 2: 1 from the cube's edge (1/2, 1/2) in x or in y."""
    along, across = np.array([1, -1, 0]) / math.sqrt(2), np.array([1, 1, 0]) / math.sqrt(2)
    return Body.convex([(1.5, 0.5, 0) + a * along + b * across + (0, 0, c) for a in (-5, 5) for b in (0, 2)
                        for c in (-1, 1)])  # fmt: skip


@pytest.mark.parametrize(
    ("limits", "x"),
    [({}, 2 / 3), ({"TX": (0, 9)}, 2 / 3), ({"TX": (-9, 2 / 3)}, 2 / 3), ({"TX": (2 / 3, 9)}, 2 / 3),
     ({"TX": (-9, 0.6)}, 0.6), ({"TX": (0.75, 9)}, 0.75), ({"TY": (-9, 0)}, 1), ({"TX": (1, 9)}, 1)],
)  # fmt: skip
@pytest.mark.parametrize("model", ["auto", "translations"])
def test_weighted_translations_onto_a_slant_are_exact(limits, x, model):
    """Least 2 x^2 + 4 y^2 (P = diag(2, 4) through the weights) with x + y = 1: y = x / 2 unless a limit binds."""
    asked = problem(CUBE, slanted(), motion=X >> Y, weights={"TX": math.sqrt(2), "TY": 2.0}, limits=limits)
    solution = consistent(solve(asked, model=model))
    assert list(solution.parameters.values()) == pytest.approx([x, 1 - x], rel=1e-12, abs=1e-12)
    assert solution.amount == pytest.approx(math.sqrt(2 * x * x + 4 * (1 - x) ** 2), rel=1e-12)
    assert solution.gap <= 1e-12


@pytest.mark.parametrize("limits", [{}, {"TX": (0, 9)}, {"TX": (0, 9), "TY": (0, 9)}], ids=str)
def test_the_program_that_clarabel_solved_to_3e_5(limits):
    """x^2 + 2 y^2 - 2 x with x + y = 1, x >= 0: (1, 0), where y >= 0 is tight and costs nothing."""
    import casadi

    x, y = casadi.SX.sym("TX"), casadi.SX.sym("TY")
    asked = problem(CUBE, slanted(), motion=X >> Y, amount=x * x + 2 * y * y - 2 * x + 2, limits=limits)
    solution = consistent(solve(asked, certify=True))
    assert list(solution.parameters.values()) == pytest.approx([1, 0], abs=1e-9)
    assert solution.amount == pytest.approx(1, rel=1e-12)
    assert solution.gap <= GAP


# -------------------------------------------------------------------------------------- optimisers: Rodrigues at zero


def cross_matrix(v: Any) -> np.ndarray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]], dtype=float)


def test_free_and_its_derivatives_are_finite_and_right_at_the_identity():
    """R = 1 + [t]x + [t]x^2 / 2 + ...: first derivatives [e_i]x, second ([e_i]x [e_j]x + [e_j]x [e_i]x) / 2."""
    import casadi

    q = casadi.SX.sym("q", 6)
    R = Free().symbolic(q, np.zeros(3), np.ones(3))[:3, :3]
    made = [R.reshape((9, 1))]
    for _ in range(2):
        made.append(casadi.jacobian(made[-1], q).reshape((-1, 1)))
    function = casadi.Function("derivatives", [q], made)
    unit = [cross_matrix(e) for e in np.eye(3)]
    value, first, second = (
        np.array(out).reshape((3, 3, *[6] * order), order="F") for order, out in enumerate(function(0))
    )
    np.testing.assert_array_equal(value, np.eye(3))
    np.testing.assert_array_equal(first[:, :, :3], 0)
    for i, j in product(range(3), repeat=2):
        np.testing.assert_allclose(first[:, :, 3 + i], unit[i], atol=1e-16)
        np.testing.assert_allclose(second[:, :, 3 + i, 3 + j], (unit[i] @ unit[j] + unit[j] @ unit[i]) / 2, atol=1e-15)
    rng = np.random.default_rng(4)
    for size in (5e-324, 1e-200, 1e-160, 1e-8, 1e-3, 1 - 1e-9, 1 + 1e-9, math.pi, 2 * math.pi, 1e3):
        at = np.append(rng.normal(size=3), size * np.array([0.6, 0.0, -0.8]))
        assert all(np.isfinite(np.array(out)).all() for out in function(at))
        T, rates = Free().kinematics(np.zeros(3), np.ones(3)).rates(at)
        assert np.isfinite(rates).all()
        np.testing.assert_allclose(T, Free().transform(at, np.zeros(3), np.ones(3)), atol=1e-14)
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-14)
        plain = Rotation((0.6, 0.0, -0.8)).transform([size], np.zeros(3), np.ones(3))
        np.testing.assert_allclose(T[:3, :3], plain[:3, :3], atol=1e-12)


@pytest.mark.parametrize("motion", EVERY_MOTION)
def test_every_motion_has_finite_first_and_second_derivatives_at_zero(motion):
    import casadi

    own = EVERY_MOTION[motion]
    q = casadi.SX.sym("q", len(own.parameters))
    T = own.symbolic(q, np.array([0.1, 0.2, 0.3]), np.array([1.0, -1.0, 0.5])).reshape((16, 1))
    first = casadi.jacobian(T, q)
    function = casadi.Function("derivatives", [q], [T, first, casadi.jacobian(first.reshape((-1, 1)), q)])
    value, *others = (np.array(out) for out in function(0))
    np.testing.assert_array_equal(value.reshape(4, 4, order="F"), np.eye(4))
    assert all(np.isfinite(out).all() for out in others)


# --------------------------------------------------------------------------------------------------- a seeded sweep

PARTS = {
    "box": np.array(list(product((-1.0, 1.0), repeat=3))),
    "slab": np.array(list(product((-1.0, 1.0), (-1.0, 1.0), (-0.01, 0.01)))),
    "prism": np.array([(x, y, z) for x, y in ((-1, -1), (1, -1), (-1, 1)) for z in (-1.0, 1.0)]),
    "tip": np.vstack([np.eye(3), -np.eye(3)]),
    "wedge": np.array([(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, 0, 1), (1, 0, 1)], dtype=float),
}
GOALS = ("touch", "clear", "at", "beyond", "seat")
SWEPT = 60


def degenerate(rng: np.random.Generator, number: int) -> Problem | None:
    """Two aligned CAD-like bodies on a common grid, flush in one coordinate or two; None where the question is bad."""
    ratio = float(rng.choice([1e-3, 0.1, 1.0, 1.0, 10.0, 1e3]))
    origin = float(rng.choice([0.0, 0.0, 1e4]))
    one, two = (PARTS[str(rng.choice(list(PARTS)))] for _ in range(2))
    away = rng.choice([-2.5, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0], 3) * np.maximum(1.0, ratio) / 2
    seeds = [place + scale * rng.choice([0.0, 0.0, 0.5, 1.5], 3)
             for place, scale in ((np.full(3, origin), 1.0), (origin + away, ratio))]  # fmt: skip
    bodies = [Body.convex(one + origin, seed=seeds[0]), Body.convex(ratio * two + origin + away, seed=seeds[1])]
    goal, motion = GOALS[number % len(GOALS)], list(EVERY_MOTION.values())[number // len(GOALS) % len(EVERY_MOTION)]
    nominal: Any = int(rng.integers(1, 3)) if goal == "beyond" else "drawn"
    name = motion.parameters[0].name
    try:
        if goal in ("at", "seat"):
            segments = problem(*bodies, motion=X).curve.segments
            if not segments:
                return None
            own = segments[int(rng.integers(len(segments)))]
            nominal = tuple((own.start + own.end) / 2)
        return problem(*bodies, nominal=nominal, motion=motion, goal=goal, target=None,
                       tolerance=float(rng.choice([1e-6, 0.02, 0.3])), requirement=str(rng.choice(list("ABCD"))),
                       path=str(rng.choice(["coherent", "free"])),
                       limits={name: (-0.5, 0.5)} if rng.random() < 0.3 else {})  # fmt: skip
    except InputError:
        return None


@cache
def swept() -> list[Problem]:
    rng, found, number = np.random.default_rng(77), [], 0
    while len(found) < SWEPT:
        asked = degenerate(rng, number)
        number += 1
        if asked is not None:
            found.append(asked)
    return found


@pytest.mark.sampled(6)
@pytest.mark.parametrize("number", range(1, SWEPT, 2))
def test_degenerate_problems_get_an_answer_that_stands(number):
    asked = swept()[number]
    few = len(asked.weights) <= 2
    solution = consistent(solve(asked, certify=few))
    stays_flush = asked.goal == "at" and any(feature.is_flush for feature in asked.nominal_features)
    if few and solution.status.found and not stays_flush:  # that a contact stays flush is not in the bound yet
        assert solution.gap <= GAP or solution.amount - solution.lower_bound <= ROOM


def test_most_degenerate_problems_are_questions_of_every_kind():
    problems = swept()
    assert {asked.goal for asked in problems} == set(GOALS)
    assert len({asked.motion for asked in problems}) == len(EVERY_MOTION)


def test_time_that_ran_out_while_another_motion_was_looked_for_left_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether one stays in the fit was asked when there was no time to: the motion found before is the answer."""

    def over(_: fo.Solution) -> bool:
        raise pacing.TimeOverError

    monkeypatch.setattr("fcdm_opt.solver.outside_fit", over)
    beam, table = fo.Box((4, 1, 1), centre=(0, 0, 0.4)), fo.Box((4, 4, 1), centre=(0, 0, -0.5))
    motion = fo.Rotation("y") >> fo.Translation("z")
    found = fo.solve(fo.Problem(beam, table, motion=motion, goal="clear", target=(1, 1)), time=60.0)
    assert found.parameters["TZ"] == pytest.approx(0.1)
