"""The oracles of the attack by closed forms, and planted wrong answers that it must report."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from fcdm_opt_benchmarks.attack import asking
from fcdm_opt_benchmarks.attack import run as attack
from fcdm_opt_benchmarks.attack.least import Setting, SolidPair, least, nearest
from fcdm_opt_benchmarks.attack.lines import least_tracked, reached, switching_points
from fcdm_opt_benchmarks.attack.motions import MotionStep, poses, weights
from fcdm_opt_benchmarks.attack.raw_scenes import FAMILIES, raw_names, raw_scene
from fcdm_opt_benchmarks.attack.raw_solids import RawSolid, block, depth_at_most
from fcdm_opt_benchmarks.attack.raw_solids import distance as raw_distance
from fcdm_opt_benchmarks.attack.raw_verdicts import RawReply, raw_verdicts
from fcdm_opt_benchmarks.attack.scenes import KINDS, SEATS, Block, FitScene, drawn, names
from fcdm_opt_benchmarks.attack.separation import ConvexSolid, distance, separations
from fcdm_opt_benchmarks.attack.solids import FITS, Fit, box, circle, prism, walls
from fcdm_opt_benchmarks.attack.verdicts import Reply, failed, verdicts

X, Y, Z = (MotionStep("T", tuple(axis)) for axis in np.eye(3).tolist())
NOWHERE = np.zeros(3)


def setting(movable, static, steps, touch=False, *, clearance=0.0, limits=None, keep_out=(), length=1.0, **more):
    """Bodies as drawn, seeds at the origin."""
    ones = [ConvexSolid.of(piece) for piece in movable]
    pairs = [SolidPair(one, ConvexSolid.of(piece), clearance, True) for one in ones for piece in static]
    pairs += [SolidPair(one, ConvexSolid.of(piece), 0.0, False) for one in ones for piece in keep_out]
    heavy = weights(steps, length)
    allowed = np.array([[-np.inf, np.inf]] * len(heavy)) if limits is None else np.array(limits)
    return Setting(steps, NOWHERE, NOWHERE, tuple(pairs), touch, heavy, allowed, 4.0, **more)


def least_amount(*arguments, **options):
    found = least(setting(*arguments, **options), np.random.default_rng(0))
    return None if found is None else found.amount


# -------------------------------------------------------------------------------------------- separations and distances


@pytest.mark.parametrize(
    ("shift", "apart", "far"),
    [
        ((3, 0, 0), 1.0, 1.0),
        ((1.5, 0.2, 0.1), -0.5, None),
        ((3, 4, 0), 2.0, np.hypot(1, 2)),
        ((3, 4, 5), 3.0, np.sqrt(1 + 4 + 9)),
    ],
)
def test_separation_and_distance_of_two_cubes(shift, apart, far):
    one, two = ConvexSolid.of(box((-1, -1, -1), (1, 1, 1))), ConvexSolid.of(box((-1, -1, -1), (1, 1, 1)))
    found = separations(one, two, np.eye(3)[None], np.array([shift], dtype=float))[0]
    assert found == pytest.approx(apart, abs=1e-14)
    if far is not None:
        assert distance(one.moved(np.eye(3), np.array(shift)), two) == pytest.approx(far, abs=1e-14)


def test_crossed_edges_are_as_far_apart_as_their_heights():
    """Two roofs, ridge over ridge at a right angle: neither face nor corner is nearest."""
    lower = np.array([[x, y, z] for x in (-2, 2) for y, z in ((-1, -1), (1, -1), (0, 0))], dtype=float)
    upper = np.array([[-y, x, 0.25 - z] for x, y, z in lower])
    one, two = ConvexSolid.of(upper), ConvexSolid.of(lower)
    assert distance(one, two) == pytest.approx(0.25, abs=1e-15)
    assert separations(one, two, np.eye(3)[None], np.zeros((1, 3)))[0] == pytest.approx(0.25, abs=1e-14)
    assert separations(one, two, np.eye(3)[None], np.array([[0, 0, -0.5]]))[0] == pytest.approx(-0.25, abs=1e-14)


def test_poses_are_those_of_steps_done_one_after_the_other():
    """A quarter turn about the moved seed (1, 0, 2), after a lift of 2; then a screw about the x axis."""
    steps = (Z, MotionStep("R", (0, 0, 1), "seed"), MotionStep("S", (1, 0, 0), (0, 0, 0), 3.0))
    R, t = poses(steps, [2.0, np.pi / 2, np.pi], np.array([1.0, 0, 0]), NOWHERE)
    assert R[0] @ [2.0, 0, 0] + t[0] == pytest.approx([1 + 3 * np.pi, -1, -2])
    seeds = (MotionStep("S", None, "seed", 0.5),)
    R, t = poses(seeds, [np.pi / 2], np.array([0.0, 0, -1]), np.array([0.0, 0, 4]))
    assert R[0] @ [1.0, 0, 0] + t[0] == pytest.approx([0, 1, np.pi / 4])


# ------------------------------------------------------------------------------------------------ nearest, least shifts


def test_the_nearest_point_is_that_of_all_corners_sides_and_faces():
    rng = np.random.default_rng(5)
    impossible = 0
    for _ in range(200):
        G, h = rng.normal(size=(5, 2)), rng.normal(size=5)
        candidates = [np.zeros(2)] + [g * b / (g @ g) for g, b in zip(G, h, strict=True)]
        candidates += [np.linalg.solve(G[list(two)], h[list(two)]) for two in itertools.combinations(range(5), 2)]
        valid = [np.linalg.norm(x) for x in candidates if (G @ x >= h - 1e-10).all()]
        found = nearest(G, h)
        impossible += not valid
        assert (found is None) == (not valid)
        if valid:
            assert np.linalg.norm(found) == pytest.approx(min(valid), abs=1e-10)
    assert 10 < impossible < 150


CUBE, SLAB = box((-1, -1, -1), (1, 1, 1)), box((-5, -5, -3), (5, 5, -0.9))
SLIT = [box((-5, -5, -5), (-1.25, 5, 5)), box((1.5, -5, -5), (5, 5, 5))]
AWAY = box((2, 3, 4), (6, 6, 6))


@pytest.mark.parametrize(
    ("static", "steps", "touch", "expected"),
    [
        ([SLAB], (Z,), False, 0.1),
        ([SLAB], (X, Z), True, 0.1),
        ([SLAB], (X,), False, 6.0),
        ([AWAY], (X, Y, Z), True, np.sqrt(1 + 4 + 9)),
        ([AWAY], (X, Y), True, None),
        ([AWAY], (X,), False, 0.0),
        (SLIT, (X,), True, 0.25),
        (SLIT, (X, Y, Z), True, 0.25),
        ([SLAB, box((0.8, -5, -5), (5, 5, 5))], (X, Y, Z), False, np.hypot(0.1, 0.2)),
        ([SLAB, box((0.8, -5, -5), (5, 5, 5)), box((-5, -5, -5), (-0.9, 5, 5))], (X, Z), False, 6.0),
        ([box((-1, -5, -5), (5, 5, -1))], (X,), True, 0.0),
    ],
)
def test_least_shifts_of_a_cube(static, steps, touch, expected):
    """Lifted off a slab, out of a corner, over the top of a slit too narrow; "touch" is the border of what overlaps."""
    found = least_amount([CUBE], static, steps, touch)
    assert found == (None if expected is None else pytest.approx(expected, abs=1e-12))


def test_a_shift_keeps_limits_clearance_and_keep_outs():
    assert least_amount([CUBE], [SLAB], (Z,), limits=[(-0.05, 0.05)]) is None
    assert least_amount([CUBE], [SLAB], (Z,), clearance=0.2) == pytest.approx(0.3, abs=1e-12)
    roof = [box((-9, -9, 1.05), (0.5, 9, 2))]
    assert least_amount([CUBE], [SLAB], (X, Z), keep_out=roof) == pytest.approx(np.hypot(1.5, 0.1), abs=1e-12)
    assert least_amount([CUBE], [AWAY], (X, Y, Z), True, displacement=True) == pytest.approx(np.sqrt(14), abs=1e-12)


def test_the_clearance_of_corners_is_their_distance():
    """Shifted along x until the corner of the cube is .5 from the edge of a block .3 above it: .4 to the side."""
    block = box((1.2, -5, 1.3), (5, 5, 3))
    assert least_amount([CUBE], [block], (X,), clearance=0.5) == pytest.approx(0.2, abs=1e-12)


def test_least_shifts_agree_with_a_lattice():
    """Unions of boxes with whole coordinates: the least way out ends on the lattice of their sums."""
    rng = np.random.default_rng(7)
    moved = 0
    for _ in range(25):
        lows = rng.integers(-3, 1, size=(5, 3))
        boxes = [box(low, low + rng.integers(1, 4, size=3)) for low in lows]
        movable, static = boxes[:2], boxes[2:]
        spans = [(q.min(0) - p.max(0), q.max(0) - p.min(0)) for p in movable for q in static]
        axes = [sorted({0.0, *(float(end[k]) for span in spans for end in span)}) for k in range(3)]
        free = [
            np.linalg.norm(x)
            for x in itertools.product(*axes)
            if not any((low < x).all() and (x < high).all() for low, high in spans)
        ]
        expected = min(free)
        moved += expected > 0
        assert least_amount(movable, static, (X, Y, Z)) == pytest.approx(expected, abs=1e-10)
    assert moved > 10


# --------------------------------------------------------------------------------------------------- turns and searches

BAR = box((-2, -0.5, -1), (2, 0.5, 1))
RAILS = [box((-9, 1, -3), (9, 2, 3)), box((-9, -2, -3), (9, -1, 3))]
TURNED = np.arcsin(1 / np.hypot(2, 0.5)) - np.arctan2(0.5, 2)  # 2 sin + .5 cos = 1


def test_a_bar_turns_until_its_corners_meet_the_rails():
    about = (MotionStep("R", (0, 0, 1), (0.0, 0.0, 0.0)),)
    assert least_amount([BAR], RAILS, about, True) == pytest.approx(TURNED, abs=1e-10)
    assert least_amount([BAR], RAILS, about, True, displacement=True) == pytest.approx(
        2 * np.hypot(np.hypot(2, 0.5), 0.0) * np.sin(TURNED / 2), abs=1e-9
    )
    assert least_amount([BAR], RAILS, about, True, limits=[(-0.1, 0.1)]) is None
    crooked = [prism(circle(4, 2.0), -1, 1)]  # a square on its corner must turn by an eighth
    beside = [box((np.sqrt(2), -9, -3), (3, 9, 3)), box((-3, -9, -3), (-np.sqrt(2), 9, 3))]
    assert least_amount(crooked, beside, about) == pytest.approx(np.pi / 4, abs=1e-6)


def test_a_screw_lifts_by_its_pitch():
    rises = (MotionStep("S", (0, 0, 1), (0.0, 0.0, 0.0), 0.5),)
    found = least_amount([prism(circle(8, 1.0), -1, 1)], [SLAB], rises)
    assert found == pytest.approx(np.hypot(0.5, 1.0) * 0.2, abs=1e-9)


def test_a_turn_is_taken_where_it_is_shorter_than_the_shift():
    """A bar between rails, which touches after a small turn, or a slide, or some of both."""
    steps = (Z, MotionStep("R", (0, 0, 1), "seed"))
    assert least_amount([BAR], RAILS, steps, True) == pytest.approx(TURNED, rel=1e-6)
    sideways = (Y, MotionStep("R", (0, 0, 1), "seed"))
    heavy = least_amount([BAR], RAILS, sideways, True, length=10.0)
    light = least_amount([BAR], RAILS, sideways, True, length=1.0)
    assert light < min(0.5, TURNED)
    assert heavy == pytest.approx(min(_slid(angle, 10.0) for angle in np.linspace(0, 0.3, 30001)), rel=1e-5)
    assert light == pytest.approx(min(_slid(angle, 1.0) for angle in np.linspace(0, 0.3, 30001)), rel=1e-5)


def _slid(angle, length):
    return np.hypot(length * angle, 1 - 2 * np.sin(angle) - 0.5 * np.cos(angle))


def test_all_searches_find_the_lift_off_a_slab():
    turn = MotionStep("R", (1, 0, 0), "seed")
    for steps in (
        (turn, Z),
        (Z, turn),
        (MotionStep("S", (0, 0, 1), (0, 0, 0), "free"),),
        (Z, X, turn),
        (MotionStep("F"),),
    ):
        assert least_amount([CUBE], [SLAB], steps, length=2.0) == pytest.approx(0.1, rel=1e-6)


@pytest.mark.slow
def test_rays_find_what_two_turns_can_do():
    """Two turns about one axis are one, shared between both: the amount is less by the root of two."""
    turn = MotionStep("R", (0, 0, 1), (0.0, 0.0, 0.0))
    found = least_amount([BAR], RAILS, (turn, turn), True)
    assert found == pytest.approx(TURNED / np.sqrt(2), rel=1e-3)


# ----------------------------------------------------------------------------------------------------- tracked contacts


@pytest.mark.slow
def test_tracked_points_move_as_their_lines_say():
    """The exact translation against a scan of the tracked point itself, and both ends of it."""
    compared = 0
    for number in range(25):
        scene = drawn(f"tracked:hulls/{5 * number}")
        if scene is None or scene.path != "coherent":
            continue
        own, found = scene.setting, scene.least()
        signs = np.sign(scene.target - scene.tracked.rho)
        grid = np.linspace(-1, 1, 401)[:, None]
        x, real = scene.tracked.real(*own.poses(grid))
        fine = np.abs(grid[reached("beyond", x, scene.target, signs) & real, 0])
        if found is None or found.amount > 0.99:
            assert not fine.size
            continue
        compared += 1
        assert fine.min() == pytest.approx(found.amount, abs=5.1e-3)
    assert compared >= 4


def test_switching_points_are_on_two_lines_and_where_the_bodies_touch():
    rng = np.random.default_rng(3)
    fit = FITS["hulls"](rng)
    s1, s2 = fit.movable[0].mean(axis=0), fit.static[0].mean(axis=0)
    one, two = ConvexSolid.of(fit.movable[0]), ConvexSolid.of(fit.static[0])
    points = switching_points(one, two, s1, s2, (0.5, 4.0))
    assert points
    for point in points:
        scaled = one.scaled(s1, point.rho[0]), two.scaled(s2, point.rho[1])
        assert separations(*scaled, np.eye(3)[None], np.zeros((1, 3)))[0] == pytest.approx(0, abs=1e-9)


# ------------------------------------------------------------------------------------------------------ planted answers


def on_slab(goal="touch", **more):
    """A box on a slab, both 2 % larger about their middles: .01 + .01 to lift."""
    fit = Fit([box((-1, -1, 0), (1, 1, 1))], [box((-2, -2, -1), (2, 2, 0))], 0.0)
    seeds = np.array([0, 0, 0.5]), np.array([0, 0, -0.5])
    scene = FitScene(
        "planted:slab/0", fit, *seeds, (X, Z), "TT", 1.5, np.array([1.02, 1.02]), goal, requirement="A", tolerance=0.02
    )
    return replace(scene, **more)


def answer(scene, at=(0.0, 0.02), **more):
    q = np.array(at)
    amount = scene.setting.amount(q)
    R, t = scene.setting.poses(q)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R[0], t[0]
    given = Reply("SOLVED", q, amount, amount, T, scene.target, scene.target, scene.setting.gap(q))
    return replace(given, **more)


def kinds(scene, given):
    return {kind for kind, _ in verdicts(scene, given, scene.least())}


@pytest.mark.parametrize("goal", ["touch", "clear"])
def test_a_right_answer_is_told_right(goal):
    assert kinds(on_slab(goal), answer(on_slab(goal))) == set()


@pytest.mark.parametrize(
    ("goal", "q", "more", "expected"),
    [
        ("clear", (0.0, 0.021), {"bound": 0.0}, {"not least", "weak bound"}),
        ("clear", (0.0, -2.02), {"bound": 0.02}, {"not least", "weak bound"}),
        ("touch", (0.0, 0.021), {"bound": 0.02}, {"wrong motion", "not least", "weak bound"}),
        ("clear", (0.0, 0.019), {}, {"wrong motion"}),
        ("clear", (0.0, 0.02), {"bound": 0.0201}, {"bound refuted"}),
        ("clear", (0.0, 0.02), {"amount": 0.0199, "bound": 0.0199}, {"wrong amount"}),
        ("clear", (0.0, 0.02), {"target": np.array([1.02, 1.0])}, {"wrong sizes"}),
        ("clear", (0.0, 0.02), {"pair": np.array([1.02, 1.01])}, {"wrong sizes"}),
        ("clear", (0.0, 0.02), {"pair": np.array([1.02, 1.0200051])}, {"wrong sizes"}),
        ("clear", (0.0, 0.02), {"transform": np.eye(4)}, {"wrong pose"}),
        ("clear", (0.0, 0.02), {"transform": None}, {"wrong pose"}),
        ("clear", (0.0, 0.02), {"status": "NOT_VERIFIED"}, {"right motion refused"}),
        ("clear", (0.0, 0.019), {"status": "NOT_VERIFIED"}, {"wrong motion refused"}),
        ("clear", (0.0, 0.02), {"status": "NOT_FOUND", "q": None}, {"not found"}),
        ("clear", (0.0, 0.02), {"status": "INFEASIBLE", "q": None, "bound": np.inf}, {"impossibility refuted"}),
        ("clear", (0.0, 0.02), {"status": "RAISED", "q": None}, {"raised"}),
        ("clear", (0.0, 0.03), {"gap": -0.01, "bound": 0.02}, {"wrong state", "not least", "weak bound"}),
    ],
)
def test_a_planted_wrong_answer_is_reported(goal, q, more, expected):
    scene = on_slab(goal)
    assert kinds(scene, answer(scene, q, **more)) == expected


def test_a_refusal_without_a_goal_of_its_own_is_a_note():
    """What the default goal became is the package's own word: the motion cannot be told right or wrong by it."""
    scene = on_slab(None)
    told = verdicts(scene, answer(scene, status="NOT_VERIFIED"), None)
    assert ("refused, not judged", "") in told
    assert not failed(told)


def test_a_limit_that_is_broken_and_a_keep_out_that_is_met_are_reported():
    scene = on_slab("clear", limits={1: (-1.0, 0.01)})
    assert kinds(scene, answer(scene, bound=0.0)) >= {"wrong motion"}
    roof = Block(box((-1.2, -1.2, 1.02), (1.2, 1.2, 4)), 0.0)  # the box as made is up to 1.01 high
    scene = on_slab("clear", keep_out=(roof,), limits={1: (0.0, 3.0)})
    assert "wrong motion" in kinds(scene, answer(scene))
    assert kinds(scene, answer(scene, (2.22, 0.02))) == set()


def test_a_closed_form_of_a_seat_refutes_what_is_larger():
    scene = on_slab("seat", closed=0.02)
    assert kinds(scene, answer(scene)) == set()
    assert "not least" in kinds(scene, answer(scene, (0.001, 0.02)))
    assert "wrong motion" in kinds(scene, answer(scene, (0.0, 0.0201)))


def test_a_tracked_point_that_ends_elsewhere_is_reported():
    scene = next(
        scene
        for scene in map(drawn, (f"tracked:hulls/{5 * k}" for k in range(60)))
        if scene is not None and scene.least() is not None and scene.least().amount > 1e-3
    )
    found = least_tracked(scene.tracked, scene.setting, scene.goal, scene.target, True)
    assert found is not None
    overlap = {"status": "PAIR_OVERLAPS"}
    assert kinds(scene, answer(scene, found.q, **overlap)) == set()
    assert "wrong motion" in kinds(scene, answer(scene, 0.9 * found.q, **overlap))


# ---------------------------------------------------------------------------------------------------------- the harness


def test_a_scene_is_drawn_from_its_name_alone():
    for name in ("fit:lid/3", "seat:comb/2", "tracked:hulls/1", "no play:peg/5"):
        one, two = drawn(name), drawn(name)
        assert one.describe() == two.describe()
        assert np.array_equal(np.vstack(one.fit.movable), np.vstack(two.fit.movable))
        assert np.array_equal(one.setting.pairs[-1].two.points, two.setting.pairs[-1].two.points)


def test_a_run_holds_every_family_and_the_full_one_1500_scenes():
    quick, full = list(names(True, attack.QUICK)), list(names(False, attack.ROUNDS))
    assert len(set(full)) == len(full) >= 1500
    expected = {f"fit:{family}" for family in FITS} | {f"seat:{family}" for family in SEATS}
    for chosen in (quick, full):
        families = {name.split("/")[0] for name in chosen}
        assert expected | {"tracked:hulls", "no play:peg"} == families
        assert {name.split(":")[0] for name in chosen} == set(KINDS)


def test_a_wrong_answer_ends_the_run_with_3_and_its_name(monkeypatch, capsys):
    """The package's own answer to an easy scene is right; with a larger motion planted in it, it is reported."""
    name = next(name for name in names(True, 9) if name.startswith("fit:slab") and drawn(name).label == "T")
    ask = asking.asked

    def planted(scene):
        given = ask(scene)
        return replace(given, pair=given.pair * 1.001)

    assert attack.replayed(name, 1) == 0
    monkeypatch.setattr(asking, "asked", planted)
    assert attack.replayed(name, 1) == 3
    lines = attack.run([name])
    assert failed(lines[0].told)
    assert name in attack.report(lines, 0.0)
    assert "wrong sizes" in capsys.readouterr().out


def test_the_walls_leave_the_hole_they_are_asked_for():
    peg = box((-0.9, -0.9, 0), (0.9, 0.9, 1))
    assert least_amount([peg], walls(1.0, 2.0, 0, 1), (X, Y), True) == pytest.approx(0.1)


# ----------------------------------------------------------------------------------------------------------- raw solids


def raw_kinds(name, **reply):
    scene = raw_scene(name)
    answer = {"status": "SOLVED", "usable": True, "amount": scene.least, "bound": scene.least, **reply}
    answer = {"low": answer["amount"], "high": answer["amount"], **answer}
    return {kind for kind, _ in raw_verdicts(scene, RawReply(**answer))}


def shifted(x):
    T = np.eye(4)
    T[:3, 3] = x
    return {"movable": T}


def along_z(scene):
    return scene.steps["movable"][0].axis == (0.0, 0.0, 1.0)


DEEP = next(name for name in raw_names(60) if "deep" in name and raw_scene(name).least > 1 and along_z(raw_scene(name)))


def test_two_blocks_overlap_by_their_depth_and_are_apart_by_their_distance():
    one, two = (RawSolid.of(block((0, 0, low), (1, 1, low + 1)), (0, 0, 0)) for low in (0.0, 0.9))
    assert not depth_at_most(one, two, 0.01)
    assert depth_at_most(one, two.moved(shifted((0, 0, 0.1 - 1e-9))["movable"]), 1e-8)
    assert raw_distance(one, two.moved(shifted((0, 0, 0.35))["movable"]), 5.0) == pytest.approx(0.25)


def test_a_right_answer_to_a_raw_scene_is_told_right():
    assert raw_kinds(DEEP, poses=shifted((0, 0, raw_scene(DEEP).least))) == set()


@pytest.mark.parametrize(
    ("reply", "expected"),
    [
        ({"poses": {}}, {"wrong motion"}),
        ({"amount": 9.0}, {"not least"}),
        ({"amount": 9.0, "low": 0.5}, set()),
        ({"amount": 0.1, "bound": 0.0}, {"wrong amount"}),
        ({"bound": 9.0}, {"bound refuted"}),
        ({"status": "NOT_VERIFIED", "usable": False}, {"right motion refused"}),
        ({"status": "INFEASIBLE", "usable": False}, {"impossibility refuted"}),
        ({"status": "OUTSIDE_FIT", "usable": False}, {"not found"}),
        ({"status": "RAISED", "usable": False}, {"raised"}),
    ],
)
def test_a_planted_wrong_answer_to_a_raw_scene_is_reported(reply, expected):
    assert raw_kinds(DEEP, **{"poses": shifted((0, 0, raw_scene(DEEP).least)), **reply}) == expected


def test_a_motion_where_none_is_to_be_used_is_reported():
    name = next(name for name in raw_names(30) if "drawn out" in name and "movable" in raw_scene(name).parts)
    assert raw_kinds(name, amount=3.0, poses=shifted((0, 0, 5))) >= {"wrong motion"}
    assert raw_kinds(name, status="OUTSIDE_FIT", usable=False) == set()


def test_what_a_mesh_leaves_open_and_is_said_to_is_no_wrong_amount():
    name = next(own for own in raw_names(9) if "round" in own and raw_scene(own).least)
    assert raw_kinds(name, amount=9.0, low=np.nan) == {"left open by the mesh"}


def test_a_raw_scene_is_drawn_from_its_name_alone():
    full = raw_names(attack.RAW * attack.ROUNDS)
    assert len(set(full)) == len(full) >= 1500
    assert {name.split(":")[1].split("/")[0] for name in full} == set(FAMILIES)
    for name in raw_names(2):
        one, two = raw_scene(name), raw_scene(name)
        assert one.describe() == two.describe()
        assert all(np.array_equal(own.vertices, two.made[part].vertices) for part, own in one.made.items())
