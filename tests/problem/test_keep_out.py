"""Keep-outs: further static bodies that the moved part must keep clear of, at one scale or over a range."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import reduce
from itertools import product
from typing import Any

import numpy as np
import pytest
from ordinary import CUBE, FAR, box, corners

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.motion.motions import Motion, Rotation, Translation
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.solver import solve
from fcdm_opt.stages.order import STAGES

X, Y, Z = Translation("x"), Translation("y"), Translation("z")
Point = tuple[float, float, float]


def solved(asked: Problem, *q: float, status: Status = Status.SOLVED, abs: float = 1e-9) -> Solution:
    """The solution, checked: judged, with these parameters."""
    solution = solve(asked)
    assert solution.status is status
    assert solution.usable, solution.certificate
    assert list(solution.parameters.values()) == pytest.approx(list(q), abs=abs)
    assert solution.lower_bound <= solution.amount * (1 + 1e-9)
    return solution


def clear(*keep_out: Any, motion: Motion = X, movable: Body = CUBE, static: Body = FAR, **arguments: Any) -> Problem:
    """Nothing but to keep clear."""
    given = {"target": (1, 1), "goal": "clear", **arguments}
    return Problem(movable, static, motion=motion, keep_out=keep_out, **given)


# --------------------------------------------------------------------------------------------- one keep-out at a scale


def answered(motion: Motion, *keep_out: KeepOut, static: Body, goal: str = "clear") -> Answer:
    """The first stage that settles the task, as the solver goes through them."""
    task = Task.of(Problem(CUBE, static, target=(1, 1), motion=motion, goal=goal, keep_out=keep_out))
    stages = [STAGES[name] for name in ("satisfied", "straight", "one parameter", "ways apart", "nlp")]
    return next(answer for stage in stages if (answer := stage(task)) is not None)


def test_a_body_in_the_way_of_the_shorter_way_out_sends_the_part_the_other_way():
    wall = box((0.5, -1, -1), (5, 1, 1))  # overlaps by 0.5 along x; free at x = -0.5
    post = box((-3, -1, -1), (-1.2, 1, 1), "post")  # but only 0.2 of room there
    free = answered(X >> Y, static=wall)
    assert free.q == pytest.approx([-0.5, 0], abs=1e-9)
    kept = answered(X >> Y, KeepOut(post), static=wall)
    # between wall and post there is no room for the cube: out along y by 2, either way
    assert kept.status is Status.SOLVED
    assert abs(kept.q[1]) == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("clearance", [0.0, 0.25])
def test_a_clearance_to_a_keep_out_is_kept(clearance):
    far = box((8, -1, -1), (10, 1, 1))
    near = box((1.1, -1, -1), (3, 1, 1), "near")
    answer = answered(X, KeepOut(near, clearance=clearance), static=far)
    assert answer.status is (Status.ALREADY_SATISFIED if clearance == 0 else Status.SOLVED)
    assert answer.q == pytest.approx([-max(0.0, clearance - 0.1)], abs=1e-9)


def test_a_clearance_of_edges_is_euclidean():
    """The post stands off by 1 in x and y: its edge and the cube's are sqrt(2) apart, which is to become 2."""
    post = box((2, 2, -1), (3, 3, 1), "post")
    solved(clear(KeepOut(post, clearance=2.0), motion=X), 1 - math.sqrt(3), abs=1e-8)
    away = (math.sqrt(2) - 2) / math.sqrt(2)
    solution = solved(clear(KeepOut(post, clearance=2.0), motion=X >> Y), away, away, abs=1e-7)
    assert solution.keep_out_gaps["post"] == pytest.approx(2.0, abs=1e-9)
    for motion in (X, X >> Y):
        enough = clear(KeepOut(post, clearance=math.sqrt(2)), motion=motion)
        solved(enough, *(0.0 for _ in motion.parameters), status=Status.ALREADY_SATISFIED)


def test_the_scale_of_a_keep_out_counts_about_its_own_seed():
    far = box((8, -1, -1), (10, 1, 1))
    near = box((1.5, -1, -1), (3.5, 1, 1), "near")  # seed at x = 2.5: its face is at 2.5 - scale
    for scale, shift in ((1.0, 0.0), (2.0, -0.5), (1.6, -0.1)):
        answer = answered(X, KeepOut(near, scale), static=far)
        assert answer.q == pytest.approx([shift], abs=1e-9)


def test_the_part_is_kept_clear_at_its_own_target_scale():
    near = box((1.1, -1, -1), (3, 1, 1), "near")
    solved(clear(near, target=(1.25, 1)), -0.15)
    solved(clear(near, target=(1.25, 1), motion=X >> Y >> Z), -0.15, 0, 0, abs=1e-8)
    solved(clear(near, target=(1.0, 1)), 0.0, status=Status.ALREADY_SATISFIED)


def test_touching_the_partner_beside_a_keep_out():
    partner = box((3, -1, -1), (5, 1, 1))
    bar = box((1.5, -4, -1), (2.0, 0.5, 1), "bar")  # in the way of the straight shift along x by 2
    straight = answered(X >> Y, static=partner, goal="touch")
    assert straight.q == pytest.approx([2, 0], abs=1e-9)
    around = answered(X >> Y, KeepOut(bar), static=partner, goal="touch")
    assert around.status is Status.SOLVED
    assert around.q == pytest.approx([2, 1.5], abs=1e-8)  # its lower side clears the bar's end at 0.5
    assert np.linalg.norm(around.q) == pytest.approx(2.5, abs=1e-8)
    assert "keep-out 'bar' stays apart" in around.active


@pytest.mark.parametrize("motion", [Y, X >> Y, Y >> Z], ids=lambda motion: str(len(motion.parameters)))
def test_a_part_that_touches_already_slides_along_its_partner_out_of_a_keep_out(motion):
    """The block stands against the wall, and a slanted post lies across its lower side: off the wall were shorter."""
    wall = box((1, -9, -9), (2, 9, 9), "wall")
    post = Body.convex(
        [[1, -3, z] for z in (-9, 9)] + [[-2, -3, z] for z in (-9, 9)] + [[1, -0.5, z] for z in (-9, 9)], name="post"
    )  # its slope falls from (1, -0.5) to (-2, -3): the block's lower right corner must not be below -0.5
    asked = Problem(CUBE, wall, target=(1, 1), motion=motion, goal="touch", keep_out=(post,))
    names = [parameter.name for parameter in motion.parameters]
    solution = solved(asked, *(0.5 if name == "TY" else 0.0 for name in names), abs=1e-8)
    assert any("keep-out 'post'" in text for text in solution.active)


# ------------------------------------------------------------------------------------------ one parameter, every stage


def test_along_one_translation_the_nearest_free_place_is_found_and_what_stops_it_named():
    posts = [box((x, -1, -1), (x + 0.5, 1, 1), f"post {x}") for x in (0.75, 3.75, -4.0, 12.0)]
    # free for the cube's middle: beyond 5.25, between 2.25 and 2.75, below -5 and between -2.5 and -0.25
    solution = solved(clear(*posts), -0.25)
    assert solution.stage.startswith("1:")
    assert solution.active == ("keep-out 'post 0.75'",)
    assert dict(solution.modelled) | {"features_kept": 0, "features_total": 0} == {
        "variables": 1, "constraints": 1, "part_pairs_kept": 1, "part_pairs_total": 5,
        "features_kept": 0, "features_total": 0, "keep_outs_kept": 1, "keep_outs_total": 4,
    }  # fmt: skip
    one_way = solved(clear(*posts, limits={"TX": (0, 99)}), 2.25)
    assert one_way.active == ("keep-out 'post 0.75'",)
    beyond = solved(clear(*posts, limits={"TX": (2.5, 2.6)}), 2.5)
    assert beyond.usable
    further = solved(clear(*posts, limits={"TX": (2.8, 99)}), 5.25)
    assert further.active == ("keep-out 'post 3.75'",)


def test_no_free_place_within_the_limits_is_proved():
    post = box((0, -1, -1), (0.5, 1, 1), "post")
    solution = solve(clear(post, limits={"TX": (-0.9, 1.4)}))
    assert solution.status is Status.INFEASIBLE
    assert not solution.usable
    assert solution.keep_out_gaps == {}
    # a clearance can only make it harder
    assert solve(clear(KeepOut(post, clearance=0.1), limits={"TX": (-0.9, 1.4)})).status is Status.INFEASIBLE
    turned = solve(clear(post, motion=Rotation("z"), limits={"RZ": (-0.2, 0.2)}))
    assert turned.status is Status.INFEASIBLE
    assert turned.stage.startswith("2:")


def test_the_first_stage_is_exact_whether_or_not_the_motion_comes_near_a_clearance():
    post = box((0.5, -1, -1), (1, 1, 1), "post")
    away = box((-9, -1, -1), (-3, 1, 1), "away")
    solution = solved(clear(post, KeepOut(away, clearance=1.0)), -0.5)
    assert solution.stage.startswith("1:")
    assert solution.lower_bound == solution.amount
    nearer = solved(clear(post, KeepOut(away, clearance=1.75)), 2.0)  # at -0.5 it is 1.5 away
    assert nearer.stage.startswith("1:")
    assert nearer.lower_bound == nearer.amount


def pins() -> tuple[Body, Body]:
    """A bar along x on both sides of its seed, 0.2 wide, and two pins: edges that it meets at +0.4 and -0.6."""
    bar = Body.convex(corners((-3, -0.1, -1), (3, 0.1, 1)), seed=(0, 0, 0), name="bar")
    ridges = []
    for angle, side in ((0.4, 1.0), (-0.6, -1.0)):
        along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        tip = 2.0 * along + side * 0.1 * across
        shape = [tip, tip + side * across + 0.1 * along, tip + side * across - 0.1 * along]
        ridges.append([[*point, z] for point in shape for z in (-2, 2)])
    return bar, Body.from_parts(ridges, seed=(0, 5, 0), name="pins")


def post_at(angle: float, radius: float = -2.0, half: float = 0.05) -> Body:
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    return box((x - half, y - half, -1), (x + half, y + half, 1), f"post {angle}")


def test_turning_passes_by_a_contact_that_a_keep_out_forbids():
    bar, both = pins()
    asked = Problem(bar, both, target=(1, 1), motion=Rotation("z"), goal="touch")
    assert solved(asked, 0.4, abs=1e-12).stage.startswith("2:")
    # a post at the bar's other end, where the bar would touch the nearer pin
    blocked = solved(asked.changed(keep_out=(post_at(0.4),)), -0.6, abs=1e-12)
    assert blocked.stage.startswith("2:")
    assert blocked.lower_bound == pytest.approx(0.6 * blocked.problem.length, rel=1e-6)
    # a post on the way does not matter: the contact itself is asked for, not a path
    solved(asked.changed(keep_out=(post_at(0.2),)), 0.4, abs=1e-12)
    # both pins barred: the other end of the bar meets them from their far side, on a way through them
    both_barred = solve(asked.changed(keep_out=(post_at(0.4), post_at(-0.6))))
    assert both_barred.status is Status.OUTSIDE_FIT
    assert both_barred.amount > 0.6 * both_barred.problem.length


def test_turning_clear_of_a_keep_out_ends_where_the_last_of_both_is_clear():
    bar, both = pins()
    half = 0.05
    for angle, keep_out in ((0.0, (post_at(0.0, half=half),)), (0.03, (post_at(0.03, half=half),))):
        solution = solve(Problem(bar, both, target=(1, 1), motion=Rotation("z"), goal="clear", keep_out=keep_out))
        assert solution.usable
        assert solution.stage.startswith("2:")
        # the bar's side passes a corner of the post: all four tried, both ways
        x, y = -2.0 * np.cos(angle), -2.0 * np.sin(angle)
        spots = np.array([[x + a, y + b] for a in (-half, half) for b in (-half, half)])
        reach, at = np.hypot(*spots.T), np.arctan2(-spots[:, 1], -spots[:, 0])
        ways = at - np.arcsin(0.1 / reach), at + np.arcsin(0.1 / reach)
        least = min(-ways[0].min(), ways[1].max())
        assert solution.amount == pytest.approx(least * solution.problem.length, rel=1e-9)
        assert solution.active == (f"keep-out '{keep_out[0].name}'",)


# ---------------------------------------------------------------------------------------------------- several, unions


def frame(half: float, wall: float = 0.5, name: str = "frame", **seed: Any) -> Body:
    """A square ring about the z axis: four bars, none of which has the seed in it."""
    out = half + wall
    bars = [
        ((-out, -out, -1), (-half, out, 1)), ((half, -out, -1), (out, out, 1)),
        ((-half, -out, -1), (half, -half, 1)), ((-half, half, -1), (half, out, 1)),
    ]  # fmt: skip
    return Body.from_parts([corners(*bar) for bar in bars], name=name, seed=seed.get("seed", (0, 0, 0)))


def test_a_ring_keeps_the_part_in_its_middle():
    """Growing the ring opens it: its hole is 2 half scale wide, and the cube, 2 wide, stands off its middle by 0.9."""
    cube = box((-0.1, -1.7, -1), (1.9, 0.3, 1))
    for scale, off in ((1.0, 0.0), (0.9, 0.1), (0.75, 0.4)):
        keep_out = KeepOut(frame(2.0), scale)
        room = 2.0 * scale - 1.0
        shift = (-max(0.0, 0.9 - room), max(0.0, 0.7 - room))
        assert -shift[0] == pytest.approx(off)
        status = Status.SOLVED if off else Status.ALREADY_SATISFIED
        solved(clear(keep_out, movable=cube, motion=X >> Y), *shift, status=status, abs=1e-8)
    spaced = KeepOut(frame(2.0), 0.9, clearance=0.25)
    solution = solved(clear(spaced, movable=cube, motion=X >> Y), -0.35, 0.15, abs=1e-8)
    assert solution.keep_out_gaps == pytest.approx({"frame": 0.25}, abs=1e-8)
    assert solution.active[0].startswith("keep-out 'frame'")
    assert solution.modelled["keep_outs_kept"] == solution.modelled["keep_outs_total"] == 1
    assert solution.modelled["part_pairs_kept"] < solution.modelled["part_pairs_total"] == 5


def test_a_ring_too_tight_lets_nothing_stay_in_it():
    solution = solve(clear(frame(0.9), motion=X, limits={"TX": (-1, 1)}))
    assert solution.status is Status.INFEASIBLE
    out = solve(clear(frame(0.9), motion=Z))
    assert out.usable
    assert abs(out.parameters["TZ"]) == pytest.approx(2.0, abs=1e-12)  # above it or below
    assert out.active == ("keep-out 'frame'",)


def test_keep_outs_far_away_are_never_modelled():
    posts = [box((x, y, -1), (x + 1, y + 1, 1), f"post {x} {y}") for x in range(-20, 21, 5) for y in (-20, 20)]
    near = box((0.75, -3, -3), (1.75, 3, 3), "near")
    solution = solved(clear(near, *(KeepOut(post, (0.9, 1.1), clearance=0.5) for post in posts), motion=X >> Y),
                      -0.25, 0, abs=1e-8)  # fmt: skip
    assert (solution.modelled["keep_outs_kept"], solution.modelled["keep_outs_total"]) == (1, 19)
    alone = solve(clear(near, motion=X >> Y))
    assert alone.amount == solution.amount
    assert alone.parameters == solution.parameters


def test_order_and_grouping_of_keep_outs_change_nothing():
    ring = frame(1.8)
    bars = [Body.convex(part.vertices, seed=(0, 0, 0), name=f"bar {k}") for k, part in enumerate(ring.parts)]
    cube = box((-0.1, -1.7, -1), (1.9, 0.3, 1))
    expected = solved(clear(ring, movable=cube, motion=X >> Y), -0.1, 0.0 if 0.7 < 0.8 else None, abs=1e-8)
    for order in ((0, 1, 2, 3), (3, 1, 0, 2)):
        split = solved(clear(*(bars[k] for k in order), movable=cube, motion=X >> Y), -0.1, 0.0, abs=1e-8)
        assert split.amount == pytest.approx(expected.amount, rel=1e-9)


def least_shift(ones: Any, twos: Any, others: Any, axes: list[int], goal: str) -> float | None:
    """Least translation after which unions of boxes touch or are clear, and the first is clear of others.

    Each pair overlaps in an open box of shifts; where none does, and for "touch" one is touched, is a union of closed
    boxes: its point nearest to 0 has each coordinate 0 or a side's.
    """
    rest = [axis for axis in range(3) if axis not in axes]

    def pairs(bodies: Any) -> list[tuple[np.ndarray, np.ndarray]]:
        sides = [(bottom - high, top - low) for (low, high), (bottom, top) in product(ones, bodies)]
        return [(low[axes], high[axes]) for low, high in sides if all(low[k] < 0 < high[k] for k in rest)]

    partner, blocked = pairs(twos), pairs([*twos, *others])
    places = [sorted({0.0, *(side[k] for sides in blocked for side in sides)}) for k in range(len(axes))]
    shifts = np.array(list(product(*places)))
    good = np.ones(len(shifts), dtype=bool)
    for low, high in blocked:
        good &= ~((low < shifts) & (shifts < high)).all(axis=1)
    if goal == "touch":
        good &= np.any([((low <= shifts) & (shifts <= high)).all(axis=1) for low, high in partner], axis=0)
    return min(np.linalg.norm(shifts[good], axis=1).tolist(), default=None)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("goal", ["touch", "clear"])
@pytest.mark.parametrize("axes", ["x", "xy", "xyz"])
def test_among_boxes_the_shift_is_the_least_there_is(axes, goal):
    """Against all candidates, in closed form; what stage 4 finds is a local search, so a few may be larger."""
    rng = np.random.default_rng([4, len(axes), len(goal)])
    motion: Motion = reduce(lambda one, two: one >> two, (Translation(axis) for axis in axes))
    found = larger = 0
    trials = 20 if axes == "x" else 10
    for _ in range(trials):
        scales = rng.choice([0.75, 1.0, 1.5], 4)
        seeds = rng.integers(-2, 3, (4, 3)) + rng.uniform(0.1, 0.4, (4, 3))
        lows = seeds + rng.integers(-3, 1, (4, 3)) + 0.25  # some with the seed in them, some without
        highs = lows + rng.integers(2, 5, (4, 3))
        bodies = [
            box(low, high, f"b{k}", seed) for k, (low, high, seed) in enumerate(zip(lows, highs, seeds, strict=True))
        ]
        made = [
            tuple(s + r * (side - s) for side in (a, b)) for s, r, a, b in zip(seeds, scales, lows, highs, strict=True)
        ]
        others = [KeepOut(body, float(scale)) for body, scale in zip(bodies[2:], scales[2:], strict=True)]
        least = least_shift(made[:1], made[1:2], made[2:], ["xyz".index(axis) for axis in axes], goal)
        asked = Problem(*bodies[:2], target=scales[:2], motion=motion, goal=goal, keep_out=others)
        solution = solve(asked)
        if least is None:
            assert solution.status in (Status.INFEASIBLE, Status.NOT_FOUND)
            continue
        found += 1
        assert solution.usable, (solution.status, solution.certificate)
        assert solution.lower_bound <= least * (1 + 1e-9) + 1e-12
        assert solution.amount >= least * (1 - 1e-8) - 1e-10
        larger += solution.amount > least * (1 + 1e-7) + 1e-9
        assert axes != "x" or not larger
    assert found > trials / 4
    assert larger <= found / 10


# ----------------------------------------------------------------------------------------------------- scale ranges


def polytope(rng: np.random.Generator, seed: np.ndarray, name: str = "body") -> Body:
    return Body.convex(rng.normal(size=(10, 3)), seed=seed, name=name)


@pytest.mark.parametrize("away", [0.0, 3.0])
@pytest.mark.parametrize("number", range(4))
def test_a_range_is_the_hull_of_both_ends(number: int, away: float):
    """Every point at every scale lies in it, and the distance from it is the least over the scales."""
    rng = np.random.default_rng([7, number])
    body = polytope(rng, np.array([away, 0.2, 0.1]))
    low, high = 0.7, 1.6
    ((part, scale),) = KeepOut(body, (low, high)).obstacles
    levels = (part.normals * part.vertices[[loop[0] for loop in part.loops]]).sum(axis=1)
    inside = []
    for r in rng.uniform(low, high, 200):
        weights = rng.dirichlet(np.ones(len(body.vertices)))
        point = body.seed + r / scale * (weights @ body.vertices - body.seed)
        inside.append((part.normals @ point - levels).max())
    assert max(inside) <= 1e-12
    ends = np.vstack([body.seed + r / scale * (body.parts[0].vertices - body.seed) for r in (low, high)])
    off = np.linalg.norm(part.vertices[:, None] - ends[None], axis=2).min(axis=1)
    assert off.max() <= 1e-12
    movable = polytope(rng, np.zeros(3))
    T = np.eye(4)
    T[:3, 3] = 6.0 * rng.normal(size=3)
    # jointly convex in point and scale, the distance is a convex function of the scale: three finer and finer grids
    pair, (a, b) = ScaledPair(movable, body), (low, high)
    for _ in range(4):
        grid = np.linspace(a, b, 21)
        gaps = [pair.signed_distance((1.0, r), T) for r in grid]
        k = int(np.argmin(gaps))
        a, b = grid[max(k - 1, 0)], grid[min(k + 1, 20)]
    swept = ScaledPair(movable, replace(body, parts=(part,)))
    assert min(gaps) > 0
    assert swept.signed_distance((1.0, scale), T) == pytest.approx(min(gaps), rel=1e-6)


def test_with_the_seed_inside_the_largest_scale_has_all():
    part, scale = KeepOut(CUBE, (0.5, 1.5)).obstacles[0]
    assert part is CUBE.parts[0]
    assert scale == 1.5
    assert KeepOut(CUBE, (1.2, 1.2)).obstacles[0][1] == 1.2


def test_between_both_ends_of_a_range_there_is_no_room():
    """At scale 1 the post is at 4 <= x <= 5, at scale 2 at 8 to 10: the cube fits between, where the post passes."""
    post = box((4, -1, -1), (5, 1, 1), "post", seed=(0, 0, 0))
    cube = box((5.5, -1, -1), (7.5, 1, 1))
    for end in (1.0, 2.0):
        solved(clear(KeepOut(post, end), movable=cube), 0.0, status=Status.ALREADY_SATISFIED)
    solution = solved(clear(KeepOut(post, (1.0, 2.0)), movable=cube), -3.5)
    assert solution.keep_out_gaps == pytest.approx({"post": 0.0}, abs=1e-12)
    solved(clear(KeepOut(post, (1.0, 2.0), clearance=0.5), movable=cube, motion=X >> Y, limits={"TY": (-1, 1)}),
           -4.0, 0.0, abs=1e-8)  # fmt: skip
    # sideways: at x = 7.5 the post passes with half a width of up to 7.5 / 4
    solved(clear(KeepOut(post, (1.0, 2.0)), movable=cube, motion=Y, limits={"TY": (0, 9)}), 1 + 7.5 / 4, abs=1e-9)


def test_a_ring_over_a_range_is_as_tight_as_at_its_least_scale():
    cube = box((-0.1, -1, -1), (1.9, 1, 1))
    solution = solved(clear(KeepOut(frame(2.0), (0.9, 1.2)), movable=cube), -0.1)
    assert solution.keep_out_gaps == pytest.approx({"frame": 0.0}, abs=1e-12)
    solved(clear(KeepOut(frame(2.0), (0.9, 1.2), clearance=0.05), movable=cube, motion=X >> Y), -0.15, 0, abs=1e-8)


# ---------------------------------------------------------------------------------------------------- tracked contacts


def test_a_tracked_tip_slides_on_its_floor_to_keep_clear():
    """The tip, made larger, is lifted by what it reaches below its seed; the wall beside it wants it moved."""
    tip = Body.convex([[0, 0, 0], [1, 1, 2], [1, -1, 2], [-1, 1, 2], [-1, -1, 2]], seed=(0, 0, 1), name="tip")
    floor = box((-9, -9, -2), (9, 9, 0), "floor", seed=(0, 0, -1))
    wall = box((0.9, -9, 0.5), (3, 9, 9), "wall")
    asked = Problem(tip, floor, nominal=(1, 1), target=(1.1, 1), motion=X >> Z, goal="at", keep_out=(wall,))
    # its widest place at the target scale is 1.1, on a level with the wall
    solution = solved(asked, -0.2, 0.1, abs=1e-8)
    assert "keep-out 'wall' stays apart" in solution.active
    assert solution.modelled["keep_outs_kept"] == 1
    solved(asked.changed(keep_out=(KeepOut(wall, clearance=0.05),)), -0.25, 0.1, abs=1e-8)
    solved(asked.changed(keep_out=(box((2, -9, 0.5), (3, 9, 9)),)), 0.0, 0.1, abs=1e-8)
    stuck = solve(asked.changed(limits={"TX": (-0.1, 0.1)}))
    assert not stuck.status.found


# ------------------------------------------------------------------------------------------------------- what is asked


def test_a_keep_out_takes_a_name_and_its_body_with_it():
    plain = KeepOut(CUBE)
    assert (plain.name, plain.ends, plain.clearance) == ("box", (1.0, 1.0), 0.0)
    assert plain.body is CUBE
    named = KeepOut(CUBE, (0.9, 1.1), clearance=0.2, name="rib")
    assert (named.name, named.body.name, named.ends) == ("rib", "rib", (0.9, 1.1))
    assert named.body.vertices.tobytes() == CUBE.vertices.tobytes()


@pytest.mark.parametrize(
    ("arguments", "key", "found"),
    [
        ({"body": "cube"}, "KeepOut.body", "str"),
        ({"scale": 0.0}, "KeepOut.scale", "0.0"),
        ({"scale": True}, "KeepOut.scale", "True"),
        ({"scale": "1"}, "KeepOut.scale", "'1'"),
        ({"scale": (1.1, 0.9)}, "KeepOut.scale", "(1.1, 0.9)"),
        ({"scale": (0.0, 0.9)}, "KeepOut.scale", "0.0"),
        ({"scale": (1.0, 1.1, 1.2)}, "KeepOut.scale", "1.2"),
        ({"scale": math.nan}, "KeepOut.scale", "nan"),
        ({"scale": (1.0, math.inf)}, "KeepOut.scale", "inf"),
        ({"clearance": -0.1}, "KeepOut.clearance", "-0.1"),
        ({"clearance": math.nan}, "KeepOut.clearance", "nan"),
        ({"name": ""}, "KeepOut.name", "''"),
        ({"name": 3}, "KeepOut.name", "3"),
    ],
)
def test_a_wrong_keep_out_is_refused(arguments: dict, key: str, found: str):
    with pytest.raises(InputError) as caught:
        KeepOut(**{"body": CUBE, **arguments})
    assert caught.value.key == key
    assert found in str(caught.value)
    assert "allowed: " in str(caught.value)


def test_plain_data_gives_the_same_scene_bit_for_bit():
    ring = frame(2.0 / 3.0, seed=(0.1, 0.2, 0.3))
    first = clear(KeepOut(ring, (1 / 3, 7 / 9), clearance=1 / 7, name="ring"), box((3, 3, 3), (4, 4, 4), "post"))
    text = json.dumps(first.to_dict(), allow_nan=False)
    second = Problem.from_dict(json.loads(text))
    assert json.dumps(second.to_dict(), allow_nan=False) == text
    for one, two in zip(first.keep_out, second.keep_out, strict=True):
        assert (one.name, one.scale, one.clearance) == (two.name, two.scale, two.clearance)
        for (part, scale), (again, same) in zip(one.obstacles, two.obstacles, strict=True):
            assert scale == same
            assert part.vertices.tobytes() == again.vertices.tobytes()
    solution = solve(first)
    rebuilt = Solution.from_dict(json.loads(json.dumps(solution.to_dict(), allow_nan=False)))
    assert rebuilt.keep_out_gaps == solution.keep_out_gaps
    assert set(rebuilt.keep_out_gaps) == {"ring", "post"}
    fewer = first.changed(keep_out=first.keep_out[1:])
    assert [keep_out.name for keep_out in fewer.keep_out] == ["post"]


@pytest.mark.parametrize("contacts", [None, "all"])
def test_a_corner_passes_a_corner_nearer_than_any_face(contacts):
    """Square posts a clearance apart, corner to corner: the least way is aslant, shorter than along either's faces."""
    off, clearance = 0.1, 0.3
    block = box((-1, -1, 0), (1, 1, 1), "block", seed=(0, 0, 0.5))
    floor = box((-9, -9, -1), (9, 9, 0), "floor", seed=(0, 0, -0.5))
    post = box((1 + off, 1 + off, 0.2), (3, 3, 3), "post")
    asked = Problem(
        block, floor, nominal="drawn", target=(1.0, 1.0), motion=X >> Y, goal="seat", contacts=contacts,
        keep_out=(KeepOut(post, clearance=clearance),),
    )  # fmt: skip
    solution = solve(asked)
    least = clearance - math.sqrt(2.0) * off
    assert solution.usable
    assert solution.amount == pytest.approx(least, rel=1e-9)
    assert solution.lower_bound == pytest.approx(least, rel=1e-9)
