"""Derivatives of motions of round parts, against closed forms: they touch along lines, or in many points at once."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq

import fcdm_opt as fo
from fcdm_opt.problem.solution import Sensitivity

X, Y, Z = map(fo.Translation, "xyz")
BORE = 10.0
DRILL = fo.Cylinder(BORE, 30.0, base=(0, 0, -5), facets=16)
PLATE = fo.cut(fo.Box((60, 60, 20), centre=(0, 0, 10)), DRILL, name="plate")


def in_bore(radius: float, centre: tuple[float, float], motion: fo.Motion, **more) -> fo.Problem:
    pin = fo.Cylinder(radius, 40.0, base=(*centre, -10), facets=16, name="pin")
    sizes = [
        fo.Size("bore", "static", faces="bore radius 10", each=-0.5, tolerance=0.05),
        fo.Size("pin", "movable", faces=f"cylinder radius {radius:g}", each=0.5, tolerance=0.05),
    ]
    return fo.Problem(pin, PLATE, motion=motion, sizes=sizes, goal="touch", target=(1, 1), **more)


def to_sphere(centre: np.ndarray, play: float, weights: np.ndarray) -> np.ndarray:
    """The least shift, weighted, of a centre that is to come to `play` off the origin."""

    def off(multiplier: float) -> float:
        return float(np.linalg.norm(centre * weights**2 / (weights**2 - multiplier))) - play

    multiplier = brentq(off, 0.0, weights.min() ** 2 * (1.0 - 1e-12), xtol=1e-15)
    return centre * multiplier / (weights**2 - multiplier)


def differences(asked, at, step: float = 1e-5) -> np.ndarray:
    at = np.array(at, float)
    each = [(asked(at + step * own) - asked(at - step * own)) / (2.0 * step) for own in np.eye(len(at))]
    return np.array(each).T


@pytest.mark.parametrize(
    ("centre", "motion"),
    [
        ((0.0, 0.0), X >> Y),
        pytest.param((0.002, 0.0), X >> Y, marks=pytest.mark.slow),
        pytest.param((0.001, 0.0007), X, marks=pytest.mark.slow),
        ((0.001, 0.0007), X >> Y),
        pytest.param((0.002, 0.0), fo.Translation((0.6, 0.8, 0)), marks=pytest.mark.slow),
    ],
)
def test_derivatives_by_diameters_were_not_told_off_the_middle_or_in_two_directions(centre, motion) -> None:
    """A pin with .0205 of play: along d it goes t with |c + t d| = play; free in the plane, straight away from c."""
    problem = in_bore(10.0, centre, motion).changed(made={"bore": 0.021, "pin": -0.02})
    told, play = fo.solve(problem).sensitivity, 0.0205
    rate = 0.5
    if len(motion.names) == 1:
        line = np.array([1.0, 0.0]) if motion is X else np.array([0.6, 0.8])
        along = np.dot(centre, line)
        rate *= play / np.sqrt(play**2 - np.dot(centre, centre) + along**2)
    assert told.exists
    assert told.sizes == pytest.approx({"bore": rate, "pin": -rate}, rel=1e-6)


@pytest.mark.parametrize(
    ("radius", "centre", "weights"),
    [
        (8.0, (0.5, 0.3), (1.0, 2.0)),
        pytest.param(9.99, (0.002, 0.001), (1.0, 1.3), marks=pytest.mark.slow),
        pytest.param(9.0, (0.3, 0.0), (1.0, 1.2), marks=pytest.mark.slow),
    ],
)
def test_the_motion_of_a_pin_follows_the_curvature_of_its_bore(radius, centre, weights) -> None:
    """The least weighted shift until pin and bore touch: its change takes the play's curvature, 1 / (R - r)."""
    solution = fo.solve(in_bore(radius, centre, X >> Y, weights={"TX": weights[0], "TY": weights[1]}))
    told, each = solution.sensitivity, np.array(weights)
    least = to_sphere(np.array(centre), BORE - radius, each)
    assert [*solution.parameters.values()] == pytest.approx(least, abs=1e-9)  # an amount right to 1e-9 leaves 1e-5 open
    pose = differences(lambda c: to_sphere(c, BORE - radius, each), centre)
    assert told.motion_by_pose[:, [0, 1, 2, 5]] == pytest.approx(np.column_stack([pose, np.zeros((2, 2))]), abs=1e-5)
    assert np.isnan(told.motion_by_pose[:, 3:5]).all()  # tilted, either end of the line of contact comes first
    size = 0.5 * differences(lambda play: to_sphere(np.array(centre), play[0], each), [BORE - radius])[:, 0]
    assert told.motion_by_size["bore"] == pytest.approx(size, abs=1e-5)
    assert told.motion_by_size["pin"] == pytest.approx(-size, abs=1e-5)
    assert told.exists


@pytest.mark.parametrize(("right", "told"), [(0.01, (np.nan, np.nan)), (0.0, (2**0.5, 0.0))])
def test_a_tie_of_two_flanks_under_a_ball_was_a_derivative_of_one_of_them(right, told) -> None:
    """A flank of 90 degrees that is d higher lifts it by sqrt(2) d, as long as the other one is no higher."""
    made = {"left": 0.01, "right": right}
    ball = fo.Sphere(5.0, centre=(0, 0, 5 * 2**0.5), name="ball")
    flanks = [[(x, s * y, z) for x in (-10, 10) for y, z in ((0, 0), (20, 20), (20, -5), (0, -5))] for s in (1, -1)]
    groove = fo.Body.from_parts([np.array(own, float) for own in flanks], seed=(0, 0, -2), name="groove")
    sizes = [
        fo.Size(name, "static", faces={"through": (0, y, 5)}, tolerance=0.1)
        for name, y in zip(made, (5, -5), strict=True)
    ]
    found = fo.solve(fo.Problem(ball, groove, motion=Z, goal="touch", sizes=sizes, made=made))
    assert found.amount == pytest.approx(0.01 * 2**0.5, rel=1e-6)
    assert found.sensitivity.exists == (right == 0.0)
    assert tuple(found.sensitivity.sizes.values()) == pytest.approx(told, abs=1e-9, nan_ok=True)


@pytest.mark.slow
def test_a_pin_turned_about_the_normal_of_its_line_of_contact_was_told_of_one_point_of_the_line() -> None:
    """Twisted, either end of the line of contact comes first: "-3.26" for TY, by the height of a corner of facets."""
    holes, pins = (
        [fo.Cylinder(r, 20.0, base=(x, 0, z), facets=16) for r, x in own]
        for own, z in (([(4.0, -20.0), (4.0, 20.0)], -10.0), ([(3.9, -20.15), (3.92, 20.015)], -4.0))
    )
    base, block = fo.cut(fo.Box((64, 30, 10)), *holes), fo.Box((64, 30, 20), centre=(0, 0, 15.1))
    problem = fo.Problem(fo.joined(block, *pins), base, motion=X >> Y, goal="clear", target=(1, 1))
    told = fo.solve(problem).sensitivity.motion_by_pose
    assert np.isnan(told[:, 3:5]).all()
    assert told[:, :2] == pytest.approx(np.diag([-1.0, -1.0 / 3.0]), abs=1e-6)  # .05 to go, play .1


@pytest.mark.slow
def test_the_motion_of_a_ball_in_its_socket_follows_both_curvatures() -> None:
    """As the pin, in three directions; turned about its middle, a ball stays what it is."""
    socket = fo.cut(fo.Box((40, 40, 40)), fo.Sphere(10.0), name="socket")
    centre, weights = np.array([0.4, 0.2, 0.3]), np.array([1.0, 1.5, 2.0])
    problem = fo.Problem(
        fo.Sphere(9.0, centre=centre, name="ball"), socket, motion=X >> Y >> Z, goal="touch", target=(1, 1),
        weights=dict(zip(("TX", "TY", "TZ"), weights, strict=True)),
        sizes=[fo.Size("ball", "movable", faces="sphere radius 9", each=0.5, tolerance=0.05)],
    )  # fmt: skip
    told = fo.solve(problem).sensitivity
    pose = differences(lambda c: to_sphere(c, 1.0, weights), centre)
    assert told.motion_by_pose == pytest.approx(np.column_stack([pose, np.zeros((3, 3))]), abs=1e-4)
    size = -0.5 * differences(lambda play: to_sphere(centre, play[0], weights), [1.0])[:, 0]
    assert told.motion_by_size["ball"] == pytest.approx(size, abs=1e-4)


@pytest.mark.slow
def test_the_motion_of_a_roller_that_also_turns_about_another_axis() -> None:
    """A roller is shifted along y, then turned about the origin, until it touches a bore about (0, 0)."""
    centre, length = np.array([4.0, 1.0]), 5.0

    def least(at: np.ndarray) -> np.ndarray:
        """Turned by a, it touches where (6 + R (x - 6, y + t))^2 = (10 - r)^2; of these the least t^2 + (5 a)^2."""
        away, room = at[0] - 6.0, BORE - at[2]

        def shifted(a: float) -> tuple[float, float]:
            under = np.sqrt(36.0 * np.sin(a) ** 2 - away**2 - 36.0 - 12.0 * away * np.cos(a) + room**2)
            slope = 6.0 * np.cos(a) + (36.0 * np.sin(a) * np.cos(a) + 6.0 * away * np.sin(a)) / under
            return 6.0 * np.sin(a) + under - at[1], slope

        def slope(a: float) -> float:
            t, rate = shifted(a)
            return t * rate + length**2 * a

        a = brentq(slope, -0.6, 0.0, xtol=1e-15)
        return np.array([shifted(a)[0], a])

    motion = Y >> fo.Rotation("z", centre=(6.0, 0.0, 0.0))
    solution = fo.solve(in_bore(4.0, tuple(centre), motion, length=length))
    assert [*solution.parameters.values()] == pytest.approx(least(np.append(centre, 4.0)), abs=1e-9)
    pose = differences(least, np.append(centre, 4.0))
    told = solution.sensitivity
    assert told.motion_by_pose[:, :2] == pytest.approx(pose[:, :2], abs=1e-6)
    assert told.motion_by_pose[:, 5] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert told.motion_by_size["pin"] == pytest.approx(0.5 * pose[:, 2], abs=1e-6)


def box(low, high, name="box") -> fo.Body:
    return fo.Body.convex([*product(*zip(low, high, strict=True))], name=name)


def test_a_box_in_a_corner_of_which_one_wall_is_two() -> None:
    """Overlapping two walls in one plane and a third: what moves both has a derivative, what moves one has none."""
    walls = [box((-2, 1, 0), (0, 4, 4)), box((-2, 6, 0), (0, 10, 4)), box((1, -2, 0), (10, 0, 4))]
    corner = fo.Body.from_parts([own.vertices for own in walls], name="corner")
    block = box((-0.3, -0.4, 1), (8, 8, 3), "block")
    near = [{"through": (0, 2, 2)}, {"through": (0, 8, 2)}]
    sizes = [
        fo.Size("both", "static", faces=near, each=1.0, tolerance=0.1),
        fo.Size("one", "static", faces=near[:1], tolerance=0.1),
        fo.Size("third", "static", faces={"through": (5, 0, 2)}, tolerance=0.1),
        fo.Size("block", "movable", faces="-x", tolerance=0.1),
    ]
    problem = fo.Problem(block, corner, motion=X >> Y, sizes=sizes, goal="clear", target=(1, 1))
    solution = fo.solve(problem)
    assert solution.amount == pytest.approx(0.5)
    told = solution.sensitivity
    assert np.isnan(told.sizes.pop("one"))
    assert np.isnan(told.motion_by_size["one"]).all()
    assert told.sizes == pytest.approx({"both": 0.6, "third": 0.8, "block": 0.6})
    assert told.motion_by_size["both"] == pytest.approx([1.0, 0.0])


def test_the_face_of_a_finger_on_a_bar_had_no_derivative_of_the_motion() -> None:
    """It turns by -t about P until its face, 4 + pad below P, is on the bar: R sin(t' + phi) = 4 + pad + 7 + bar.

    R and phi of P seen from the bar, t' = -t. The contact is within the face, at none of its corners.
    """
    bar = fo.Cylinder(7.0, 30.0, base=(0, 0, -15), name="bar")
    finger = fo.Box((90, 6, 12), centre=(-15, 19, 0), name="finger")
    sizes = [
        fo.Size("bar", "static", faces="cylinder radius 7", each=1.0, tolerance=0.1),
        fo.Size("pad", "movable", faces="-y", tolerance=0.05),
    ]
    problem = fo.Problem(
        finger, bar, motion=fo.Rotation("z", (-60, 20, 0)), goal="touch", sizes=sizes, made={"bar": 0.05, "pad": 0.05}
    )
    solution = fo.solve(problem)
    far, high = np.hypot(60.0, 20.0), 11.1
    assert solution.parameters["RZ"] == pytest.approx(np.arcsin(high / far) - np.arctan2(20.0, 60.0), abs=1e-9)
    found, rate = solution.sensitivity, 1.0 / np.sqrt(far**2 - high**2)
    assert found.motion_by_size["pad"] == pytest.approx([rate], abs=1e-9)
    assert found.motion_by_size["bar"] == pytest.approx([rate], abs=1e-9)
    assert found.motion_by_pose[0, 1] == pytest.approx(-rate, abs=1e-9)  # higher by 1, it turns further
    assert np.isnan(found.motion_by_pose[0]).tolist() == [False] * 3 + [True, False, False]
    (why,) = found.motion_reasons
    assert why.startswith("no derivative by turned about x: other contacts")
    assert Sensitivity.from_dict(json.loads(json.dumps(found.to_dict()))).motion_reasons == (why,)


@pytest.mark.parametrize("ends", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["square", "round"])
def test_the_width_of_a_slot_beside_a_hole_had_no_derivative(ends: bool) -> None:
    """Two pins, .005 aside, in a hole and in a slot .02 narrower than the hole: half of the width that it changes.

    Its walls are touched within, at none of their corners.
    """
    hole, *turns = (fo.Cylinder(5.02, 14, base=(x, 0, -2), facets=16) for x in (-25, 22, 28))
    slot = fo.joined(fo.Box((6 if ends else 16, 10.04, 14), centre=(25, 0, 5)), *turns[: 2 * ends])
    plate = fo.cut(fo.Box((90, 40, 10), centre=(0, 0, 5)), hole, slot, name="plate")
    pins = fo.joined(*(fo.Cylinder(5, 20, base=(x, 0.005, -3), facets=16) for x in (-25, 25)), name="pins")
    walls = [{"through": (25, y, 5)} for y in (5.02, -5.02)] + [f"bore radius 5.02 no. {k}" for k in (2, 3) if ends]
    sizes = [fo.Size("slot", "static", faces=walls, each=-0.5, tolerance=0.03)]
    problem = fo.Problem(pins, plate, motion=X >> Y, goal="touch", sizes=sizes, made={"slot": -0.02}, target=(1, 1))
    solution = fo.solve(problem)
    assert [*solution.parameters.values()] == pytest.approx([0.0, 0.005], abs=1e-9)
    found = solution.sensitivity
    assert found.motion_by_size["slot"] == pytest.approx([0.0, 0.5], abs=1e-6)
    assert "\n  by slot: " in str(found)
    assert "\n  of the motion no derivative by turned about x" in str(found)


@pytest.mark.parametrize("motion", [X >> Y, pytest.param(X >> fo.Rotation("y"), marks=pytest.mark.slow)])
@pytest.mark.slow
def test_a_peg_turned_about_its_own_axis_had_no_derivative_of_the_motion(motion) -> None:
    """Turned so it is the same solid, whatever holds the motion."""
    asked = in_bore(9.0, (0.7, 0.2), motion).changed(goal="clear", clearance=0.5)
    found = fo.solve(asked)
    assert found.amount > 0.1
    assert (found.sensitivity.motion_by_pose[:, 5] == 0.0).all()
    assert "turned about z" not in " ".join(found.sensitivity.motion_reasons)
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(0.05), -np.sin(0.05)], [np.sin(0.05), np.cos(0.05)]]
    seed = asked.movable.seed
    turn[:3, 3] = seed - turn[:3, :3] @ seed
    turned = fo.solve(asked.changed(movable=asked.movable.moved(turn)))
    assert turned.amount == pytest.approx(found.amount, rel=1e-9)


def test_a_peg_with_its_seed_off_its_axis_moves_as_it_turns() -> None:
    """Turned by t about a seed .2 beside its axis, it goes .2 t along x, and is shifted back by as much."""
    peg = fo.Cylinder(8.0, 40.0, base=(0.5, 0.0, -10.0), facets=16, name="pin").with_seed(np.array([0.5, -0.2, 10.0]))
    found = fo.solve(fo.Problem(peg, PLATE, motion=X, goal="touch", target=(1, 1)))
    assert found.sensitivity.motion_by_pose[0, 5] == pytest.approx(0.2, abs=1e-6)


@pytest.mark.parametrize("more", [{}, pytest.param({"facets": 24}, marks=pytest.mark.slow)])
def test_a_flat_of_a_bore_that_goes_on_as_a_cut_had_no_share_in_the_amount(more: dict[str, int]) -> None:
    """Flats .05 apart as drawn: amount = clearance - .05 - wall + side, with slopes -1 and 1; that by the bore was -0.

    The convex part behind the flat ends at the rim of the hub: its corners there went with those nearest to them.
    """
    bore, shaft = (
        fo.cut(fo.Cylinder(radius, 20, **more), fo.Box((8, 30, 60), centre=(flat + 4, 0, 0)), name="D")
        for radius, flat in ((4.05, 3.05), (4.0, 3.0))
    )
    square = fo.Box((6.1, 4, 60)), fo.Box((6, 3.9, 20), centre=(0, 0, 10))
    for pocket, movable in ((bore, shaft), square):
        hub = fo.cut(fo.Cylinder(12, 10, base=(0, 0, 5), **more), pocket, name="hub")
        sizes = [
            fo.Size("wall", "movable", faces=[{"through": [3.05, 0, 10]}], each=-1.0, tolerance=0.1),
            fo.Size("side", "static", faces=[{"through": [3, 0, 10]}], tolerance=0.1),
        ]
        made, motion = {"wall": -0.02, "side": 0.02}, fo.Translation("x")
        asked = fo.Problem(hub, movable, sizes=sizes, made=made, goal="clear", clearance=0.025, motion=motion)
        found = fo.solve(asked)
        assert found.amount == pytest.approx(0.015, abs=1e-9)
        assert found.sensitivity.sizes == pytest.approx({"wall": -1.0, "side": 1.0}, abs=1e-9)
        changed = fo.whatif(found, made={"wall": -0.019, "side": 0.02})
        assert [changed.predicted_amount, changed.after.amount] == pytest.approx([0.014, 0.014], abs=1e-9)


def test_a_round_cover_on_its_base_had_no_derivative_by_the_place_of_a_tab() -> None:
    """As the tab goes so does the cover, by .01 less than what they have of play; points of the rims only slide."""
    tab, base = (fo.Box((20, 8, 8), centre=(0, 0, 4)), fo.Cylinder(20, 10, base=(0, 0, -10)))
    cover = fo.cut(fo.Cylinder(20, 8, base=(0, 0, 0)), fo.Box((22, 8.3, 18), centre=(0, 0, 4)), name="cover")
    sides = [{"through": (0, 4, 4)}, {"through": (0, -4, 4)}]
    place = fo.Size("place", "static", faces=sides, along="y", tolerance=0.3)
    asked = {"goal": "clear", "motion": X >> Y, "limits": {"TX": (-0.5, 0.5), "TY": (-0.5, 0.5)}}
    solution = fo.solve(
        fo.Problem(cover, fo.joined(base, tab, name="base"), sizes=[place], made={"place": 0.2}, **asked)
    )
    told = solution.sensitivity
    assert solution.usable
    assert solution.amount == pytest.approx(0.05, rel=1e-9)
    assert told.sizes == {"place": pytest.approx(1.0, rel=1e-9)}
    assert told.motion_by_size["place"] == pytest.approx([0.0, 1.0], abs=1e-9)
