"""Coherent ranges and contact times: closed forms, invariance, the curve's own features at both ends, brute force."""

from __future__ import annotations

import json
import math
from typing import Any

import casadi
import numpy as np
import pytest
from cases import CUBE, box_shape, shape, union
from ordinary import PROBLEMS, problems
from strategies import random_pair, random_pose, random_union
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.along.followed import KINDS
from fcdm_opt.along.march import Others
from fcdm_opt.cli import app
from fcdm_opt.curve.coherence import contact_faults
from fcdm_opt.model.task import Task
from fcdm_opt.show.plots import family_figure
from fcdm_opt.show.tables import print_ranges
from fcdm_opt.show.verdict import range_texts

WIDE = ((0.05, 20.0), (0.05, 20.0))
# tip at x = 1/2 of body 1 before the face x = 1 of a plate 4 wide and high: rho_1 / 2 + rho_2 / 4 = 5/4
TIP = shape([("0.5", 0, 0), ("-0.5", 0, 0), (0, "0.5", 0), (0, "-0.5", 0), (0, 0, "0.5"), (0, 0, "-0.5")], (0, 0, 0))
PLATE = box_shape((1, -2, -2), ("1.5", 2, 2))


def problem(one: Any, two: Any, motion: fo.Motion, nominal: Any, **more: Any) -> fo.Problem:
    target = nominal if not isinstance(nominal, int) else (1.0, 1.0)
    return fo.Problem(one, two, nominal=nominal, target=target, goal="touch", motion=motion, box=WIDE, **more)


def tip(motion: fo.Motion, **more: Any) -> fo.Problem:
    return problem(TIP.body("tip"), PLATE.body("plate"), motion, (1.5, 2.0), **more)


def labels(features: Any) -> list[str]:
    return [feature.label for feature in features]


# --------------------------------------------------------------------------------------------------------- closed forms


def test_a_tip_slides_until_it_reaches_the_edge_of_a_plate():
    found = fo.coherent_range(tip(fo.Translation("y")))
    assert found.low == pytest.approx(-4.0, rel=1e-14)  # rho_2 = 2 makes the plate 8 wide
    assert found.high == pytest.approx(4.0, rel=1e-14)
    assert [event.kind for event in found.events] == ["border", "border"]
    assert not any(event.grazing for event in found.events)
    assert max(event.error for event in found.events) < 1e-12
    assert labels(found.last.features) == ["V1F2(P1V1; P2V1,V3,V5,V7)"]
    assert "V3" in found.last.what
    assert "V7" in found.last.what
    assert "body 2" in found.last.what
    assert [feature.kind for feature in found.last.merged] == ["V1E2"]
    assert [feature.kind for feature in found.last.successors] == ["E1E2"]
    assert found.proved


def between_stops(made: dict[str, float], goal: str = "touch", motion: fo.Motion | None = None) -> fo.Problem:
    """A foot 30 wide on a floor between two stops, each 0.05 off it."""
    foot = fo.Box((30, 20, 6), centre=(0, 0, 3), name="foot")
    stops = [fo.Box((10, 60, 8), centre=(side * 20.05, 0, 4)).vertices for side in (1, -1)]
    base = fo.Body.from_parts([fo.Box((80, 60, 10), centre=(0, 0, -5)).vertices, *stops], name="base")
    at = {"right": (15.05, 0, 4), "left": (-15.05, 0, 4), "floor": (0, 0, 0)}
    sizes = [fo.Size(name, "static", faces={"through": point}, tolerance=0.05) for name, point in at.items()]
    return fo.Problem(foot, base, motion=motion or fo.Translation("x"), goal=goal, sizes=sizes, made=made)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("goal", ["touch", "clear", "seat"])
@pytest.mark.parametrize(
    ("made", "low", "high"),
    [
        ({}, -0.05, 0.05),
        ({"right": 0.04, "left": -0.04}, -0.09, 0.01),  # a stop that grows comes nearer
        ({"floor": 0.02, "right": 0.04}, -0.05, 0.01),  # the floor would lift the foot: as drawn, the stop as made
    ],
)
def test_a_range_is_of_the_sizes_made(made: dict[str, float], low: float, high: float, goal: str):
    asked = between_stops(made, goal)
    found = fo.coherent_range(asked, {"TX": 1.0})
    assert (found.low, found.high) == pytest.approx((low, high), abs=1e-12)
    assert found.proved
    assert type(found).from_dict(found.to_dict(), asked).rho(high) == pytest.approx([1.0, 1.0])
    if "floor" not in made:
        free = fo.contact_times(asked, {"TX": 1.0}).free
        assert free == pytest.approx((low, high), abs=1e-12)


def test_what_slides_is_apart_whatever_rounding_of_its_place_says():
    for x, y, z in np.random.default_rng(7).uniform(-100.0, 100.0, (12, 3)).tolist():
        foot, base = fo.Box((30, 20, 6), centre=(x, y, z + 3)), fo.Box((80, 60, 10), centre=(x, y, z - 5))
        found = fo.contact_times(fo.Problem(foot, base, motion=fo.Translation("x"), goal="touch", target=(1, 1)))
        assert [span.state for span in found.spans] == ["apart"]


def test_a_tip_moves_towards_a_plate_until_a_scale_is_zero_and_away_for_ever():
    found = fo.coherent_range(tip(fo.Translation("x")))
    # the point of a line (1/2, 1/4) moved by x nearest to (1.5, 2) is off by -x (1.6, 0.8): rho_1 vanishes first
    assert found.last.kind == "scale"
    assert found.high == pytest.approx(1.5 / 1.6, rel=1e-14)
    assert (found.low, found.first.kind) == (-math.inf, "unbounded")


def test_a_tip_turns_until_its_neighbour_takes_over():
    found = fo.coherent_range(tip(fo.Rotation("z")))
    # the octahedron turned by 45 degrees lies on the plate with an edge
    assert found.high == pytest.approx(math.pi / 4, rel=1e-14)
    assert found.low == pytest.approx(-math.pi / 4, rel=1e-14)
    assert (found.first.kind, found.last.kind) == ("neighbour", "neighbour")
    assert found.last.merged[0].kind == "E1F2"
    assert labels(found.last.successors) == ["V1F2(P1V4; P2V1,V3,V5,V7)"]


def test_a_screw_ends_where_the_turning_does():
    pitch = 0.25
    found = fo.coherent_range(tip(fo.Screw(((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), pitch=pitch)))
    assert found.high == pytest.approx(math.pi / 4, rel=1e-14)
    steep = fo.coherent_range(tip(fo.Screw(((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), pitch=16.0)))
    # rho is the point of cos(t) / 2 rho_1 + rho_2 / 4 = 5/4 nearest to (1.5, 2); the tip leaves where 16 t = 2 rho_2
    assert steep.last.kind == "border"
    rho = steep.rho(steep.high)
    assert 16.0 * steep.high == pytest.approx(2.0 * rho[1], rel=1e-12)
    assert math.cos(steep.high) / 2 * rho[0] + rho[1] / 4 == pytest.approx(1.25, rel=1e-12)


def test_nothing_ends_a_turn_about_the_normal_through_a_tip():
    found = fo.coherent_range(tip(fo.Rotation("x")))
    assert (found.first.kind, found.last.kind) == ("whole turn", "whole turn")
    assert (found.low, found.high) == (-2 * math.pi, 2 * math.pi)


def test_limits_and_what_was_asked_end_a_range():
    limited = tip(fo.Translation("y"), limits={"TY": (-1.0, 2.0)})
    found = fo.coherent_range(limited, [0.5])
    assert (found.low, found.high) == (-2.0, 4.0)
    assert [event.kind for event in found.events] == ["limit", "limit"]
    assert fo.coherent_range(limited, limit=0.75).high == 0.75


def test_the_paths_of_edges_that_graze_are_flagged():
    def swing(q):  # the tip comes back just where it reaches the border at y = 4
        T = casadi.SX.eye(4)
        T[1, 3] = 4.0 - 4.0 * (q[0] - 1.0) ** 2
        return T

    found = fo.coherent_range(tip(fo.OwnMotion(swing, [("s", "translation")], name="swing")))
    assert found.last.grazing
    assert found.last.kind == "border"
    assert abs(found.high - 1.0) <= found.last.error <= 1e-5
    assert found.low == pytest.approx(1.0 - math.sqrt(2.0), rel=1e-13)  # at y = -4


def test_an_edge_that_crosses_an_edge_slides_to_its_end():
    one = shape([(-1, 0, 0), (1, 0, 0), (0, 1, -1), (0, -1, -1)], (0, 0, "-0.5")).body("lower")  # ridge along x on top
    two = shape([(0, -1, 0), (0, 1, 0), (1, 0, 1), (-1, 0, 1)], (0, 0, "0.5")).shifted((0, 0, 1)).body("upper")
    rho = (2.0, 2.0)  # ridges at -1/2 + rho_1 / 2 and 3/2 - rho_2 / 2
    found = fo.coherent_range(problem(one, two, fo.Translation("x") >> fo.Translation("y"), rho), {"TX": 1.0})
    assert found.high == pytest.approx(2.0, rel=1e-14)
    assert found.first.what == "the contact point reaches the vertex V2 of body 1"
    assert [feature.kind for feature in found.features] == ["E1E2"]
    turned = fo.coherent_range(problem(one, two, fo.Rotation("z"), rho))
    assert turned.last.kind == "parallel edges"
    assert turned.high == pytest.approx(math.pi / 2, rel=1e-12)


# ---------------------------------------------------------------------------------------------- flush contacts, unions


def test_a_face_that_slides_on_a_wall_without_a_play_beside_it_was_said_to_end_at_once():
    """Conditions that say nothing along a ray, as of sides that it does not move across, were taken for grazes."""
    wall = fo.Body.convex([(x, y, z) for x in (0, 3) for y in (-9, 9) for z in (-1, 2)])
    cube = fo.Body.convex([(x, y, z) for x in (3, 4) for y in (0, 1) for z in (0, 1)])
    motion = fo.Translation("x") >> fo.Translation("z")
    found = fo.coherent_range(fo.Problem(cube, wall, target=(1.0, 1.0), motion=motion, goal="seat"), {"TZ": 1.0})
    assert (found.low, found.high) == pytest.approx((-2.0, 2.0), abs=1e-12)
    assert found.proved


def test_a_flush_contact_slides_until_it_shares_nothing_and_any_tilt_ends_it():
    lying = problem(CUBE.body(), CUBE.shifted((4, 0, 0)).body(), fo.Translation("y") >> fo.Rotation("z"), (2.0, 2.0))
    found = fo.coherent_range(lying, {"TY": 1.0})
    assert (found.low, found.high) == pytest.approx((-4.0, 4.0), rel=1e-14)
    assert labels(found.features) == ["F1F2(P1V2,V4,V6,V8; P2V1,V3,V5,V7)"]
    tilted = fo.coherent_range(lying, {"RZ": 1.0})
    assert (tilted.low, tilted.high, tilted.last.kind) == (0.0, 0.0, "opens")
    spun = fo.coherent_range(problem(lying.movable, lying.static, fo.Rotation("x"), (2.0, 2.0)))
    assert spun.last.kind == "whole turn"


def test_a_contact_goes_on_over_a_seam():
    halves = union(box_shape((1, -2, -2), ("1.5", 1, 2)), box_shape((1, 1, -2), ("1.5", 2, 2)), seed=(1.25, 0, 0))
    split = problem(TIP.body(), halves.body(), fo.Translation("y"), (1.5, 2.0))
    found = fo.coherent_range(split)
    assert (found.low, found.high) == pytest.approx((-4.0, 4.0), rel=1e-13)
    assert found.last.kind == "border"


def test_a_wall_ends_the_way_before_the_border():
    walled = union(box_shape((1, -4, -2), ("1.5", 4, 2)), box_shape((0, 2, -2), ("1.5", 4, 2)), seed=(1.25, 0, 0))
    found = fo.coherent_range(problem(TIP.body(), walled.body(), fo.Translation("y"), (1.5, 2.0)))
    assert (found.first.kind, found.last.kind) == ("border", "overlap")
    assert found.high == pytest.approx(4.0 - 0.75, rel=1e-13)
    assert found.low == pytest.approx(-8.0, rel=1e-13)
    assert any(feature.kind in ("V1F2", "E1F2") for feature in found.last.merged)


# --------------------------------------------------------------------------------------------------------- the examples


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("number", "name"), [(n, name) for n in (1, 2) for name in "ABCD"])
def test_published_motions_lie_in_the_coherent_range_and_the_features_end_with_it(number, name):
    asked = problems(f"example{number}")[name]
    found = fo.coherent_range(asked, asked.published)
    assert found.low < 0 < 1 < found.high  # the published motion is x = 1
    assert found.proved
    for event, inward in zip(found.events, (1.0, -1.0), strict=True):
        assert event.error <= 1e-12 * abs(event.x)
        if event.kind == "scale":
            continue
        inside, outside = (event.x + side * 1e-4 * abs(event.x) for side in (inward, -inward))
        assert features_at(found, inside) == set(found.features)
        assert features_at(found, outside) != set(found.features)
    assert found.rho(0.0) == pytest.approx(asked.nominal_pair, rel=1e-13)


def features_at(found: fo.CoherentRange, x: float) -> set[fo.Feature]:
    """The features that meet at the tracked pair on the moved bodies' own curve."""
    asked, rho = found.problem, found.rho(x)
    curve = fo.decision_curve(asked.movable, asked.static, box=WIDE, transform=found.transform(x))
    located = curve.locate(rho, 1e-8) if rho.min() > 0 else None
    return set() if located is None else set(getattr(located, "features", None) or (located.feature,))


def test_example_1_moved_along_the_seeds_shrinks_to_nothing_at_the_static_seed():
    asked = problems("example1")["A"]
    offset = float(np.linalg.norm(asked.static.seed - asked.movable.seed))
    sliding = asked.changed(motion=fo.Screw("seeds", pitch=math.inf))
    found = fo.coherent_range(sliding)
    assert found.high == pytest.approx(offset, rel=1e-12)
    assert (found.last.kind, found.first.kind) == ("scale", "unbounded")


# ------------------------------------------------------------------------------------------------- random, brute force

MOTIONS = (
    fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z"),
    fo.Rotation("z"),
    fo.Translation("z") >> fo.Rotation("x", centre="origin"),
    fo.Screw("seeds"),
    fo.Rotation((1.0, 2.0, 3.0)) >> fo.Rotation("y") >> fo.Translation("x"),
    fo.Free(),
    fo.Translation("y") >> fo.Screw("seeds", pitch=300.0),
)


def random_problem(rng: np.random.Generator, unions: bool) -> tuple[fo.Problem, np.ndarray]:
    """A nominal contact of random bodies, and a direction of a random motion."""
    while True:
        if unions:
            one, two = (random_union(rng, 400, int(rng.integers(1, 4))) for _ in range(2))
            two = two.shifted(rng.integers(-800, 800, 3).tolist())
        else:
            one, two = random_pair(rng, 1000)
        movable, static = one.body(), two.body()
        curve = fo.decision_curve(movable, static, box=WIDE)
        if not curve.segments:
            continue
        if curve.switching_points and rng.random() < 0.7:
            nominal: Any = int(rng.integers(len(curve.switching_points))) + 1
        else:
            segment = curve.segments[int(rng.integers(len(curve.segments)))]
            nominal = tuple((segment.start + rng.uniform(0.1, 0.9) * (segment.end - segment.start)).tolist())
        motion = MOTIONS[int(rng.integers(len(MOTIONS)))]
        scale = np.array([1.0 if kind == "rotation" else 1000.0 for _, kind in motion.parameters])
        asked = problem(movable, static, motion, nominal)
        if asked.nominal_contact is not None and len(asked.nominal_features) <= 2:
            return asked, rng.normal(size=len(scale)) * scale


def is_real(task: Task, q: np.ndarray, slack: float) -> bool:
    rho, pose, tracked = task.tracked_contact(q)
    if not (np.isfinite(rho).all() and rho.min() > 0):
        return False
    return not contact_faults(task.movable, task.static, pose, rho, tracked, slack * task.size)


@pytest.mark.slow
@pytest.mark.parametrize(("unions", "count", "seed"), [(False, 12, 5), (True, 5, 6)])
def test_random_rays_agree_with_sampling(unions, count, seed):
    rng, ends = np.random.default_rng(seed), 0
    for _ in range(count):
        asked, direction = random_problem(rng, unions)
        found = fo.coherent_range(asked, direction)
        tracking = asked.changed(goal="at", target=tuple(asked.nominal_pair.tolist()))
        task = Task.of(tracking)
        assert found.proved
        low, high = max(found.low, -10.0), min(found.high, 10.0)
        for x in np.concatenate([np.linspace(low, high, 15)[1:-1], [low * (1 - 1e-5), high * (1 - 1e-5)]]):
            assert is_real(task, x * direction, 1e-9), (found.events, x)
        for event, out in zip(found.events, (-1.0, 1.0), strict=True):
            assert event.kind in KINDS
            if event.kind in ("border", "neighbour", "overlap", "scale", "parallel edges", "parallel lines"):
                ends += 1
                beyond = event.x + out * 1e-4 * max(abs(event.x), 1e-3)
                assert event.grazing or not is_real(task, beyond * direction, 1e-12), event
                assert event.grazing or event.error <= 1e-12 * abs(event.x), event
    assert ends > count


@pytest.mark.sampled(2)
@pytest.mark.parametrize("seed", range(6))
def test_a_common_rigid_motion_a_common_scale_and_the_way_round_change_nothing(seed):
    rng = np.random.default_rng(seed)
    asked, _ = random_problem(rng, seed % 2 == 1)
    asked = asked.changed(motion=fo.Free())
    direction = rng.normal(size=6) * [1000, 1000, 1000, 1, 1, 1]
    found = fo.coherent_range(asked, direction)
    back = fo.coherent_range(asked, -direction)
    assert (back.low, back.high) == pytest.approx((-found.high, -found.low), rel=1e-13)
    assert [event.what for event in back.events] == [event.what for event in reversed(found.events)]
    T = random_pose(rng, 500.0)
    turned = asked.changed(
        movable=asked.movable.moved(T), static=asked.static.moved(T), nominal=tuple(asked.nominal_pair.tolist())
    )
    R = T[:3, :3]
    other = fo.coherent_range(turned, np.concatenate([R @ direction[:3], R @ direction[3:]]))
    assert (other.low, other.high) == pytest.approx((found.low, found.high), rel=1e-8)


# -------------------------------------------------------------------------------------------------------- contact times


def test_contact_times_of_a_cube_that_passes_through_another():
    facing = fo.Problem(
        CUBE.body(), CUBE.shifted((4, 0, 0)).body(), target=(1.0, 0.5), goal="touch", motion=fo.Translation("x")
    )
    times = fo.contact_times(facing)
    assert [span.state for span in times.spans] == ["apart", "overlapping", "apart"]
    assert [touch.x for touch in times.touches] == pytest.approx([2.5, 5.5], rel=1e-13)
    assert times.free is not None
    assert times.free[1] == times.touches[0].x
    assert labels(times.touches[0].features) == ["F1F2(P1V2,V4,V6,V8; P2V1,V3,V5,V7)"]
    assert (times.state(4.0), times.state(6.0), times.state(1e9)) == ("overlapping", "apart", "unknown")
    assert times.proved
    assert fo.contact_times(facing, scale_pair=(3.5, 1.0)).spans[1].state == "overlapping"


def test_contact_times_of_a_keep_out_with_a_clearance_were_refused():
    """A cube passes a post 0.3 beside its way: nearer than 0.5 from where corner and side are that far apart."""
    corners = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    cube, table = fo.Body.convex(corners), fo.Body.convex(9.0 * corners + (0.0, 0.0, -10.0), name="table")
    post = fo.Body.convex(0.5 * corners + (3.5, 1.8, 0.0), name="post")
    asked = fo.Problem(cube, table, target=(1.0, 1.0), goal="clear", motion=fo.Translation("x"))
    for clearance, ends in ((0.5, (1.6, 5.4)), (0.2, ())):
        kept = asked.changed(keep_out=[fo.KeepOut(post, clearance=clearance)])
        spans = fo.contact_times(kept).keep_outs["post"]
        near = [(own.low, own.high) for own in spans if own.state == "overlapping"]
        assert near == ([pytest.approx(ends, abs=1e-6)] if ends else [])
    post = fo.KeepOut(fo.Body.convex(corners * (0.5, 0.2, 0.5) + (1.8, 0.0, 0.0)), clearance=0.1)
    turned = asked.changed(motion=fo.Rotation("z"), keep_out=[post])
    first = fo.contact_times(turned).free[1]  # the side x = 1 comes to 0.1 from the post's corner (1.3, -0.2)
    assert 1.3 * math.cos(first) - 0.2 * math.sin(first) == pytest.approx(1.1, abs=1e-6)


def test_contact_times_of_a_bar_that_turns():
    bar = box_shape((-2, "-0.25", -1), (2, "0.25", 1), seed=(0, 0, 0)).body("bar")
    post = box_shape((1, 1, -1), (3, 3, 1)).body("post")
    times = fo.contact_times(fo.Problem(bar, post, target=(1.0, 1.0), goal="touch", motion=fo.Rotation("z")))
    # the bar's corner (2, 1/4) comes up to the post's side y = 1, and so mirrored, and with the bar's other end
    first = math.asin(1.0 / math.hypot(2.0, 0.25)) - math.atan2(0.25, 2.0)
    ways = sorted(turn + way for turn in (0.0, -math.pi) for way in (first, math.pi / 2 - first))
    assert [touch.x for touch in times.touches] == pytest.approx(ways, rel=1e-12)
    assert [span.state for span in times.spans] == ["apart", "overlapping", "apart", "overlapping", "apart"]
    assert (times.spans[0].low, times.spans[-1].high) == pytest.approx((-math.pi, math.pi))
    assert times.free == pytest.approx((ways[1], ways[2]), rel=1e-12)
    assert all(touch.features and not touch.grazing for touch in times.touches)


@pytest.mark.slow
@pytest.mark.parametrize(("unions", "count"), [(False, 13), (True, 6)])
def test_random_contact_times_agree_with_sampling(unions, count):
    rng, touched = np.random.default_rng(11), 0
    for _ in range(count):
        asked, direction = random_problem(rng, unions)
        pair = rng.uniform(0.5, 1.2, 2) * asked.nominal_pair
        times = fo.contact_times(asked, direction, scale_pair=pair)
        for x in np.linspace(times.spans[0].low, times.spans[-1].high, 30):
            T = asked.motion.transform(x * direction, asked.movable.seed, asked.static.seed)
            gap = float(fo.decision_curve(asked.movable, asked.static, transform=T).gap(pair))
            assert abs(gap) < 1e-7 * asked.size or times.state(x) == ("apart" if gap > 0 else "overlapping")
        for touch in times.touches:
            T = asked.motion.transform(touch.x * direction, asked.movable.seed, asked.static.seed)
            gap = float(fo.decision_curve(asked.movable, asked.static, transform=T).gap(pair))
            assert abs(gap) < 1e-10 * asked.size
            assert touch.features
            touched += 1
    assert touched > count // 2


# -------------------------------------------------------------------------------------------------- input, command line


@pytest.mark.parametrize(
    ("direction", "key"),
    [
        ({"TQ": 1.0}, "direction.TQ"),
        ({}, "direction"),
        ([1.0, 2.0], "direction"),
        ("up", "direction"),
        ([math.nan], "direction"),
    ],
)
def test_what_is_no_direction_is_refused(direction, key):
    with pytest.raises(fo.InputError) as caught:
        fo.coherent_range(tip(fo.Translation("y")), direction)
    assert caught.value.key == key


def test_a_motion_of_two_parameters_needs_a_direction_and_ranges_a_contact():
    with pytest.raises(fo.InputError, match="direction"):
        fo.coherent_range(tip(fo.Translation("y") >> fo.Translation("z")))
    off = fo.Problem(TIP.body(), PLATE.body(), target=(1.0, 1.0), goal="touch", motion=fo.Translation("y"))
    with pytest.raises(fo.InputError, match="not on the decision curve"):
        fo.coherent_range(off)
    with pytest.raises(fo.InputError, match="limits exclude"):
        fo.coherent_range(tip(fo.Translation("y"), limits={"TY": (1.0, 2.0)}))
    with pytest.raises(fo.InputError, match="limit"):
        fo.coherent_range(tip(fo.Translation("y")), limit=-1.0)


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)


def test_nothing_was_said_to_end_the_contact_of_a_plug_on_its_seat():
    """Along z it lasts at other sizes alone, (1 + .8 z, 1 + .4 z), until 1.2 + .48 z, a wall, is at 1 + .8 z."""
    corners = 2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1.0
    floor = corners * [3, 3, 0.5] - [0, 0, 1.5]
    walls = [corners * [0.9, 3, 0.75] + [side * 2.1, 0, -0.25] for side in (-1, 1)]
    plug, seat = fo.Body.convex(corners), fo.Body.from_parts([floor, *walls], name="seat", seed=(0, 0, -1.5))
    asked = {"target": (1, 1), "goal": "seat"}
    across = fo.coherent_range(fo.Problem(plug, seat, motion=fo.Translation("z"), **asked))
    assert (across.low, across.high) == pytest.approx((-1.25, 0.625))
    head, down, up = range_texts(across)
    least = "while both scales change, as little as keeps it (at unchanged sizes the parts come apart or overlap)"
    assert least in head
    assert down == "backwards: move 1.25 along -z; there, a size would be zero, and no other contact ends it before"
    assert up.startswith("forwards: move 0.625 along +z; beyond, ")
    along = fo.coherent_range(fo.Problem(plug, seat, motion=fo.Translation("x"), **asked))
    assert (along.low, along.high) == pytest.approx((-0.2, 0.2))
    assert "sizes" not in range_texts(along)[0]


def test_the_command_prints_both_ends_and_gives_them_as_json():
    result = run("range", PROBLEMS / "example2.toml", "--case", "B", "--direction", "TY=1")
    assert result.exit_code == 0
    assert "move 0.4316 along -y; beyond, its " in result.stdout
    (file,) = json.loads(run("range", PROBLEMS / "example2.toml", "--json").stdout)["files"]
    assert [case["name"] for case in file["cases"]] == ["A", "B", "C", "D"]
    own = fo.coherent_range(problems("example2")["A"], problems("example2")["A"].published)
    assert file["cases"][0]["high"] == own.high
    assert file["cases"][0]["contact_times"]["spans"]


def test_the_command_refuses_what_it_cannot_read():
    bad = run("range", PROBLEMS / "example2.toml", "--case", "B", "--direction", "TY:1")
    assert (bad.exit_code, "--direction" in bad.stderr) == (2, True)
    other = run("range", PROBLEMS / "example2.toml", "--case", "B", "--direction", "TX=1")
    assert (other.exit_code, "TY" in other.stderr) == (2, True)


def test_parts_drawn_with_play_were_refused_in_words_of_decision_curves():
    """They have no contact to be followed; when they touch is told."""
    boxes = run("range", PROBLEMS / "boxes.toml", "--case", "close the gap")
    assert boxes.exit_code == 0
    assert "as drawn the parts are 0.5 apart" in boxes.stdout
    assert "apart up to TX 0.5, overlapping up to TX 2, apart beyond" in boxes.stdout
    assert "- at TX 0.5, its right face (facing +x) lies on the left face (facing -x) of plate" in boxes.stdout


def test_the_picture_shows_the_family_and_the_events(tmp_path):
    result = run("range", PROBLEMS / "example2.toml", "--case", "C", "--out", tmp_path)
    assert result.exit_code == 0
    assert (tmp_path / "example2-C-range.png").exists()
    text = (tmp_path / "example2-C-range.svg").read_text()
    for words in ("at rest", "track of the tracked point", "leaves the box", "there, a size would be zero"):
        assert words in text
    found = fo.coherent_range(problems("example2")["C"])
    axes = family_figure(found).axes[0]
    assert len(axes.collections) == 1  # the swept area


def test_the_picture_of_a_range_of_sizes_by_name_went_to_three_times_their_size():
    """A block on its table, .02 higher: z lifts it as the sizes grow; drawn is to twice that, on no box of scales."""
    block, table = fo.Box((10, 10, 10), centre=(0, 0, 5)), fo.Box((40, 40, 10), centre=(0, 0, -5))
    height = fo.Size("height", "static", faces=["+z"], tolerance=0.05)
    asked = fo.Problem(block, table, sizes=[height], made={"height": 0.02}, goal="seat", motion=fo.Translation("z"))
    left, right = family_figure(fo.coherent_range(asked, {"TZ": 0.02})).axes
    assert np.abs(right.lines[0].get_xdata()).max() == pytest.approx(2.0)
    assert max(np.ptp(left.get_xlim()), np.ptp(left.get_ylim())) < 0.2


def test_a_keep_out_was_clear_again_before_the_step_that_ended_at_its_clearance() -> None:
    """A pad 2 aside of a post is nearer than that until it is 2 beyond: from 0 to -(15 + 2 + 5 + 2)."""
    base, pad, post = (
        fo.Box(size, centre=middle, name=name)
        for size, middle, name in (
            ((100, 40, 10), (0, 0, -5), "base"), ((15, 10, 8), (22.5, 0, 4), "pad"),
            ((5, 10, 20), (10.5, 0, 10), "post"),
        )
    )  # fmt: skip
    asked = fo.Problem(
        pad, base, motion=fo.Translation("x"), target=(1, 1), goal="clear", keep_out=[fo.KeepOut(post, clearance=2.0)]
    )
    (near,) = (span for span in fo.contact_times(asked, {"TX": 1.0}).keep_outs["post"] if span.state == "overlapping")
    assert (near.low, near.high) == pytest.approx((-24.0, 0.0), abs=1e-9)


def test_how_far_was_looked_is_told_where_limits_end_it():
    """ "apart" was told of a post beyond the limits, and no word of these."""
    cube, post = fo.Box((1, 1, 1), name="cube"), fo.Box((1, 1, 1), centre=(3, 0, 0), name="post")
    asked = fo.Problem(cube, post, target=(1, 1), goal="touch", motion=fo.Translation("x"), limits={"TX": (-1, 1.5)})
    told = fo.contact_times(asked)
    assert (told.searched, str(told)) == (
        (-1.0, 1.5), "x times TX 1: apart\nlooked at from x = -1 to x = 1.5, no further",
    )  # fmt: skip
    assert fo.contact_times(asked, limit=0.25).searched == (-0.25, 0.25)


def test_plain_data_of_ranges_come_back_with_what_was_asked():
    """Without it they said "not the plain data of a ContactTimes; found 'problem'"."""
    cube, post = fo.Box((1, 1, 1), name="cube"), fo.Box((1, 1, 1), centre=(1, 0, 0), name="post")
    asked = fo.Problem(cube, post, target=(1.1, 1), goal="touch", motion=fo.Translation("x") >> fo.Translation("y"))
    joined = fo.Assembly([post, cube], [("cube", "post")], motions={"cube": asked.motion})
    found = [
        *((ask(asked, {"TY": 1.0}), asked) for ask in (fo.contact_times, fo.coherent_range)),
        *((ask(joined, {"cube.TY": 1.0}), joined) for ask in (fo.contact_times, fo.coherent_range)),
    ]
    for result, question in found:
        kind, data = type(result), json.loads(json.dumps(result.to_dict()))
        again = kind.from_dict(data, question)
        assert again.to_dict() == data
        assert str(again) == str(result)
        with pytest.raises(fo.InputError, match=rf"without what was asked.*allowed: {kind.__name__}.from_dict\(data, "):
            kind.from_dict(data)
    assert found[1][0].rho(0.1) == pytest.approx(type(found[1][0]).from_dict(found[1][0].to_dict(), asked).rho(0.1))
    stuck = fo.conflicts(asked.changed(limits={"TX": (0, 0), "TY": (0, 0)}, target=(1.1, 1)))
    with pytest.raises(fo.InputError, match="a Conflicts are without its problem, and cannot be read back; allowed: "):
        type(stuck).from_dict(stuck.to_dict())


@pytest.mark.slow
def test_pairs_of_parts_that_turn_beside_each_other_were_looked_at_in_every_step(monkeypatch) -> None:
    """A plate on two pins, the first in a hole, the second in a slot .02 wider to either side: 74 s.

    50 from the first pin, the second is touched at a sine of .02 / 50. Directions that divide parts go on to do so.
    """
    hole, *ends = (fo.Cylinder(5.02, 14, base=(x, 0, -2), facets=16) for x in (-25, 22, 28))
    slot = fo.joined(fo.Box((6, 10.04, 14), centre=(25, 0, 5)), *ends)
    plate = fo.cut(fo.Box((90, 40, 10), centre=(0, 0, 5)), hole, slot, name="plate")
    pins = fo.joined(*(fo.Cylinder(5, 12, base=(x, 0, -0.5), facets=16) for x in (-25, 25)), name="pins")
    asked = fo.Problem(plate, pins, motion=fo.Rotation("z", (-25, 0, 0)), target=(1, 1), goal="touch")
    counts = {"bound": 0, "_separating_conditions": 0}
    for name, method in ((name, getattr(Others, name)) for name in counts):

        def counted(self: Others, *given: Any, name: str = name, method: Any = method) -> Any:
            counts[name] += 1
            return method(self, *given)

        monkeypatch.setattr(Others, name, counted)
    times = fo.contact_times(asked, {"RZ": 1.0}, limit=0.1)
    assert [touch.x for touch in times.touches] == pytest.approx([-math.asin(4e-4), math.asin(4e-4)], abs=1e-12)
    assert 0 < counts["_separating_conditions"] < 0.5 * len(plate.parts) * counts["bound"]


def test_a_range_was_told_once_more_for_each_case_of_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    asked = [tip(fo.Translation("x"), name=name) for name in "ABC"]
    print_ranges([(fo.coherent_range(own), fo.contact_times(own)) for own in asked])
    told = capsys.readouterr().out
    assert told.count("along TX") == 1
    assert "B: range as of A" in told
    assert "C: range as of A" in told


def test_what_ends_a_contact_without_any_motion_was_said_twice_to_be_there():
    """A slab on a floor at the lower limit of TX: "backwards: staying there; there, the limit of TX"."""
    slab, floor = (2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1.0 for _ in range(2))
    asked = {"target": (1, 1), "goal": "touch", "motion": fo.Translation("x"), "limits": {"TX": (0.0, 0.5)}}
    movable, static = fo.Body.convex(slab + np.array([0, 0, 2])), fo.Body.convex(floor * [9, 9, 1], name="floor")
    problem = fo.Problem(movable, static, **asked)
    found = fo.coherent_range(problem)
    assert (found.low, found.high) == (0.0, 0.5)
    assert range_texts(found)[1:] == [
        "backwards: no motion at all: the limit of TX", "forwards: move 0.5 along +x; there, the limit of TX",
    ]  # fmt: skip


def test_a_contact_in_a_plane_through_both_seeds_ended_nowhere_and_broke_off_beside_other_parts():
    """A block 2 wide on a floor 6 wide, both seeds in the plane of contact: |TX| < 3 + 1, before a wall 3 - 1.

    No size changes what touches there: there is no decision curve, and the two numbers of its line are 0.
    """
    block = fo.Box((2, 2, 1), centre=(0, 0, 0.5), name="block").with_seed((0, 0, 0))
    floor, wall = fo.Box((6, 6, 1), centre=(0, 0, -0.5)), fo.Box((1, 6, 2), centre=(3.5, 0, 0))
    for base, high in ((floor.with_seed((0, 0, 0)), 4.0), (fo.joined(floor, wall).with_seed((2, 1, 0)), 2.0)):
        joined = fo.Assembly(
            {"base": base, "block": block}, [("block", "base")], motions={"block": fo.Translation("x")}
        )
        alone = fo.Problem(block, base, target=(1, 1), goal="touch", motion=fo.Translation("x"))
        for asked, direction in ((joined, {"block.TX": 1.0}), (alone, None)):
            found = fo.coherent_range(asked, direction)
            assert (found.low, found.high) == pytest.approx((-4.0, high), abs=1e-12)
        lifted = fo.coherent_range(alone.changed(motion=fo.Translation("z")))
        assert (lifted.low, lifted.high, lifted.last.kind) == (0.0, 0.0, "opens")
    turned = fo.coherent_range(alone.changed(motion=fo.Rotation("z")))  # its corners, at a radius of root 2, stay clear
    assert turned.last.kind == "whole turn"


def test_a_bar_in_a_slot_was_said_to_overlap_beyond_its_play_where_it_is_clear_once_more_after_half_a_turn(capsys):
    """A bar 1 wide between walls 1.1 apart and 4 long: their corners, at (2, .55), are on its side at

    .55 cos a - 2 sin a = .5, and at 180 deg less that.
    """
    walls = [fo.Box((4, 1, 1), centre=(0, y, 0)) for y in (-1.05, 1.05)]
    bar, slot = fo.Box((10, 1, 1), name="bar"), fo.joined(*walls, name="slot")
    asked = fo.Problem(bar, slot, target=(1, 1), goal="touch", motion=fo.Rotation("z"), name="turn", unit="mm")
    free = math.degrees(math.atan2(0.55, 2.0) - math.asin(0.5 / math.hypot(0.55, 2.0)))
    print_ranges([(None, fo.contact_times(asked))])
    told = " ".join(capsys.readouterr().out.split())
    ends = [f"{x:.4g} deg" for x in (free - 180.0, -free, free, 180.0 - free)]
    spans = "apart up to RZ {}, overlapping up to RZ {}, apart up to RZ {}, overlapping up to RZ {}, apart beyond"
    assert spans.format(*ends) in told
    assert [told.count(f"at RZ {end}, ") for end in ends] == [1, 1, 1, 1]
