"""Derivatives of the least amount: against differences of solved problems and closed forms, and where none exist."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import casadi
import numpy as np
import pytest
from manifold3d import Manifold
from ordinary import box, problems
from scipy.spatial import HalfspaceIntersection
from scipy.spatial.transform import Rotation as Turn

import fcdm_opt as fo
from fcdm_opt import solver
from fcdm_opt.along.sensitivity import Sensitivity
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.size import Size
from fcdm_opt.motion.motions import Free, Motion, Rotation, Screw, Translation
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem, load_problems
from fcdm_opt.problem.solution import Solution

BOX = ((0.5, 2.5), (0.5, 2.5))
X, Y, Z = (Translation(axis) for axis in "xyz")
SKEW = Translation((1.0, 0.3, 0.2))
STEP = 1e-6  # of differences, relative
NEAR = 1e-5  # of the largest derivative of a kind
solve = partial(solver.solve, effort="quick")  # derivatives ask for no proof

# ------------------------------------------------------------------------------------------------------------- scenes


def planes_body(rng: np.random.Generator, centre: np.ndarray, name: str) -> Body:
    """A simple polytope of eight planes: three faces at each vertex, so that each can be shifted."""
    corners = np.array([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]])
    normals = np.vstack([rng.normal(size=(4, 3)), corners])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    levels = rng.uniform(0.8, 1.3, size=len(normals))
    vertices = HalfspaceIntersection(np.column_stack([normals, -levels]), np.zeros(3)).intersections
    return Body.convex(vertices + centre, seed=centre + 0.1 * rng.normal(size=3), name=name)


def points_body(rng: np.random.Generator, centre: np.ndarray, name: str) -> Body:
    """A hull of twelve points, all faces triangles: so that each vertex can be moved."""
    points = rng.normal(size=(12, 3))
    points *= rng.uniform(0.8, 1.3, size=(12, 1)) / np.linalg.norm(points, axis=1)[:, None]
    return Body.convex(points + centre, seed=centre + 0.1 * rng.normal(size=3), name=name)


def random_problem(number: int, motion: Motion, goal: str, **arguments: Any) -> Problem:
    """Two per cent off a switching point, or off a pair inside a segment; one body of planes, one of points."""
    rng = np.random.default_rng([5, number])
    makers = (planes_body, points_body)[:: 1 if number % 2 else -1]
    while True:
        away = rng.normal(size=3)
        away *= rng.uniform(2.0, 3.5) / np.linalg.norm(away)
        one, two = makers[0](rng, np.zeros(3), "one"), makers[1](rng, away, "two")
        curve = decision_curve(one, two, box=BOX)
        if curve.switching_points:
            break
    nominal: Any = int(rng.integers(len(curve.switching_points))) + 1
    if goal.endswith("inside"):
        segment = max(curve.segments, key=lambda s: float(np.linalg.norm(s.end - s.start)))
        nominal = tuple((segment.start + segment.end) / 2)
    given = {"tolerance": 0.02, "requirement": "ABCD"[number % 4], "length": 1.7, **arguments}
    return Problem(one, two, nominal=nominal, motion=motion, box=BOX, goal=goal.split()[0], **given)


# -------------------------------------------------------------------------------------------------------- differences


def label(key: str, face: tuple[int, ...]) -> str:
    return key + ",".join(f"V{vertex}" for vertex in face)


def is_simple(body: Body) -> bool:
    """Whether it is convex and has three faces at each vertex."""
    return len(body.parts) == 1 and bool((np.bincount(body.parts[0].half_edges[:, 0]) == 3).all())


class Direction:
    """A direction in all data of a problem, and the derivative along it."""

    def __init__(self, problem: Problem, found: Sensitivity, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self.problem, self.found = problem, found
        self.size = problem.size
        self.bodies = [problem.movable, problem.static, *(own.body for own in problem.keep_out)]
        self.keys = ["P1", "P2", *(f"keep-out {own.name!r} " for own in problem.keep_out)]
        self.seeds = [rng.normal(size=3) for _ in self.bodies]
        self.moves = [self._moves(rng, k) for k in range(len(self.bodies))]
        self.shifts = [
            {face: float(rng.normal()) for face in body.faces} if is_simple(body) else {} for body in self.bodies
        ]
        self.tau, self.scales = rng.normal(size=(2, 2)), rng.normal(size=2)
        self.ends = {name: rng.normal(size=2) for name in found.limits}

    def _moves(self, rng: np.random.Generator, k: int) -> np.ndarray:
        """Of vertices whose faces are triangles, where a derivative is given for them."""
        body = self.bodies[k]
        moves = rng.normal(size=body.vertices.shape)
        for face in body.faces:
            if len(face) > 3:
                moves[np.array(face) - 1] = 0.0
        for row in range(len(moves)):
            if np.isnan(self.found.vertices[f"{self.keys[k]}V{row + 1}"]).any():
                moves[row] = 0.0
        return moves

    def body(self, k: int, kind: str, h: float) -> Body:
        body, vertices, seed = self.bodies[k], self.bodies[k].vertices, self.bodies[k].seed
        if kind == "seeds":
            seed = seed + h * self.size * self.seeds[k]
        elif kind == "vertices":
            vertices = vertices + h * self.size * self.moves[k]
        elif self.shifts[k]:
            part = body.parts[0]
            levels = (part.normals * part.vertices[[loop[0] for loop in part.loops]]).sum(axis=1)
            shifts = [self.shifts[k][element.vertices] for element in part.elements["F"]]
            walls = np.column_stack([part.normals, -(levels + h * self.size * np.array(shifts))])
            vertices = HalfspaceIntersection(walls, part.vertices.mean(axis=0)).intersections
        if len(body.parts) == 1:
            return Body.convex(vertices, seed=seed, name=body.name)
        rows = [[element.vertices[0] - 1 for element in part.elements["V"]] for part in body.parts]
        faces = [[vertex - 1 for vertex in face] for face in body.outlines]
        return Body.from_parts(vertices, parts=rows, faces=faces, seed=seed, name=body.name)

    def changed(self, kind: str, h: float) -> Problem:
        asked, same = self.problem, {"length": self.problem.length, "goal": self.problem.goal}
        if kind == "tolerance":
            return asked.changed(tolerance=tuple(map(tuple, asked.tolerance + h * self.tau)), **same)
        explicit = {"requirement": None, "tolerance": None}
        if kind == "target":
            return asked.changed(target=tuple(asked.target + h * self.scales), **explicit, **same)
        if kind == "limits":
            rows = {name: asked.limits[k] + h * self.size * self.ends[name] for k, name in enumerate(self.ends)}
            return asked.changed(limits={name: tuple(row) for name, row in rows.items()}, **same)
        if kind == "clearance":
            return asked.changed(clearance=asked.clearance + h * self.size, **same)
        if kind == "length":
            return asked.changed(length=asked.length * (1.0 + h), goal=asked.goal)
        if kind == "keep_out":
            kept = [replace(own, clearance=own.clearance + h * self.size) for own in asked.keep_out]
            return asked.changed(keep_out=tuple(kept), **same)
        one, two, *others = (self.body(k, kind, h) for k in range(len(self.bodies)))
        kept = [replace(own, body=body) for own, body in zip(asked.keep_out, others, strict=True)]
        if asked.requirement and not isinstance(asked.nominal, int):  # numbers stay as they are
            same |= {"target": tuple(asked.target), **explicit, "snap": 1e-2}
        return asked.changed(movable=one, static=two, keep_out=tuple(kept), **same)

    def derivative(self, kind: str) -> tuple[float, float]:
        """The derivative along the direction by a kind of data, and the largest single one."""
        found, size = self.found, self.size
        pairs: list[tuple[Any, Any]] = []
        if kind == "tolerance":
            pairs = [(found.tolerance, self.tau)]
        elif kind == "target":
            pairs = [(found.target, self.scales)]
        elif kind == "limits":
            pairs = [(size * np.array(found.limits[name]), own) for name, own in self.ends.items()]
        elif kind == "clearance":
            pairs = [(size * found.clearance, 1.0)]
        elif kind == "length":
            pairs = [(self.problem.length * found.length, 1.0)]
        elif kind == "keep_out":
            pairs = [(size * value, 1.0) for value in found.keep_out.values()]
        elif kind == "seeds":
            pairs = [(size * found.seeds[key.strip()], own) for key, own in zip(self.keys, self.seeds, strict=True)]
        elif kind == "vertices":
            pairs = [
                (np.nan_to_num(size * found.vertices[f"{key}V{row + 1}"]), move)
                for key, moves in zip(self.keys, self.moves, strict=True)
                for row, move in enumerate(moves)
            ]
        elif kind == "faces":
            pairs = [
                (size * found.faces[label(key, face)], shift)
                for key, shifts in zip(self.keys, self.shifts, strict=True)
                for face, shift in shifts.items()
            ]
        return sum(float(np.sum(a * b)) for a, b in pairs), max((np.abs(a).max() for a, _ in pairs), default=0.0)


def differs(problem: Problem, *more: str) -> Solution:
    """Compare derivatives with central differences, kind by kind; each must matter."""
    solution = solve(problem)
    found = solution.sensitivity
    assert solution.usable
    assert found.exists, found.reasons
    assert found.residual <= 1e-6
    direction = Direction(problem, found)
    kinds = ["target", "seeds", "vertices", *more]
    kinds += ["tolerance"] if problem.requirement else []
    kinds += ["faces"] if any(direction.shifts) else []
    derivatives = {kind: direction.derivative(kind) for kind in kinds}
    largest = max(size for _, size in derivatives.values())
    for kind, (derivative, size) in derivatives.items():
        ends = [solve(direction.changed(kind, h)) for h in (STEP, -STEP)]
        assert all(end.status.found for end in ends)
        difference = (ends[0].amount - ends[1].amount) / (2.0 * STEP)
        assert difference == pytest.approx(derivative, abs=NEAR * max(size, largest / 10)), kind
        assert size > 0 or kind in ("vertices", "faces"), kind
    return solution


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", ["example1", "example2"])
@pytest.mark.parametrize("case", range(4))
def test_the_papers_cases_change_as_differences_say(name, case):
    differs(list(problems(name).values())[case])


MOTIONS = {
    "1": Translation((1.0, 2.0, 3.0)),
    "2": SKEW >> Rotation("z"),
    "3": X >> Y >> Z,
    "screw": Screw("seeds"),
    "6": Free(),
}
CASES = [
    (2, "1", "beyond"), (4, "1", "at inside"), (0, "1", "touch inside"), (1, "2", "touch inside"), (3, "2", "beyond"),
    (6, "2", "touch"), (5, "3", "at"), (6, "3", "touch"), (9, "screw", "beyond"), (10, "screw", "touch inside"),
    (11, "6", "beyond"), (12, "6", "touch"), (13, "6", "at"), (14, "6", "at inside"),
]  # fmt: skip


@pytest.mark.parametrize(("number", "motion", "goal"), CASES)
def test_random_pairs_change_as_differences_say(number, motion, goal):
    solution = differs(random_problem(number, MOTIONS[motion], goal))
    assert solution.amount > 0


# --------------------------------------------------------------------------------------- what else may hold the motion


@pytest.mark.parametrize(("number", "motion", "goal"), [(1, SKEW >> Rotation("z"), "touch inside"), (3, Free(), "at")])
def test_limits_that_bind_change_the_amount(number, motion, goal):
    free = random_problem(number, motion, goal)
    (name, value), *_ = solve(free).parameters.items()
    limits = {name: (min(0.0, 0.7 * value), max(0.0, 0.7 * value))}
    found = differs(free.changed(limits=limits), "limits", "length").sensitivity
    low, high = found.limits[name]
    assert (high < 0 == low) if value > 0 else (low > 0 == high)  # a wider limit is never worse
    assert all(found.limits[other] == (0, 0) for other in found.limits if other != name)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1.02, (1.0, 1.05)], ids=["one scale", "range"])
def test_a_keep_out_in_the_way_changes_the_amount(scale):
    asked = random_problem(1, X >> Y >> Z, "touch inside")
    rng = np.random.default_rng(3)
    made = asked.movable.scaled(asked.target[0]).moved(solve(asked).transform)
    way = np.cross(asked.static.seed - asked.movable.seed, rng.normal(size=3))
    way /= np.linalg.norm(way)
    points = points_body(rng, np.zeros(3), "post").vertices
    foremost = made.vertices[(made.vertices @ way).argmax()]
    points = points + foremost - points[(points @ way).argmin()] - 0.02 * way
    seed = (
        points.mean(axis=0) + (3.0 if isinstance(scale, tuple) else 0.0) * way
    )  # outside: both ends of the range matter
    post = KeepOut(Body.convex(points, seed=seed, name="post"), scale, clearance=0.03)
    found = differs(asked.changed(keep_out=(post,)), "keep_out").sensitivity
    assert found.keep_out["post"] > 0
    assert np.abs(found.seeds["keep-out 'post'"]).max() > 0


def test_a_clearance_is_a_distance():
    found = differs(random_problem(2, X >> Y >> Z, "clear inside", clearance=0.3), "clearance").sensitivity
    assert found.clearance == pytest.approx(1.0, rel=1e-9)  # straight away from each other


def test_the_largest_displacement_changes_as_differences_say():
    turn = Rotation("z", (3.0, 1.0, 0.0))
    solution = differs(random_problem(8, SKEW >> turn, "beyond", amount="displacement"))
    assert not any(solution.sensitivity.weights.values())


def test_an_amount_of_ones_own_changes_as_differences_say():
    x, y, z = (casadi.SX.sym(name) for name in ("TX", "TY", "TZ"))
    differs(random_problem(7, X >> Y >> Z, "touch", amount=x**2 + 2 * y**2 + 3 * z**2 + x * y))


def test_the_end_of_the_coherent_range_holds_a_motion_and_moves_with_the_data():
    multipliers = differs(random_problem(20, Free(), "at", tolerance=0.08)).sensitivity.multipliers
    assert any("behind the tracked feature" in name and value > 1e-2 for name, value in multipliers.items())


# -------------------------------------------------------------------------------------------------------- closed forms


SLAB = box((-5, -5, -3), (5, 5, -1), "slab")
BLOCK = box((-1, -1, -0.5), (1, 1, 1.5), "block")
TOP, BOTTOM = "V5,V6,V7,V8", "V1,V2,V3,V4"


@pytest.mark.parametrize("motion", [Z, X >> Y >> Z], ids=["one", "three"])
def test_a_block_is_lowered_by_its_gap_on_a_slab(motion):
    """Its lower face is at s_1 + rho_1 (h_1 - s_1) = 0.5 - rho_1, the slab's upper one at rho_2 - 2."""
    found = solve(Problem(BLOCK, SLAB, target=(1.1, 1.05), motion=motion, goal="touch", length=1.0)).sensitivity
    assert found.exists
    np.testing.assert_allclose(found.target, [-1, -1], atol=1e-12)
    assert found.faces["P1" + BOTTOM] == pytest.approx(-1.1, abs=1e-12)
    assert found.faces["P2" + TOP] == pytest.approx(-1.05, abs=1e-12)
    assert sum(map(abs, found.faces.values())) == pytest.approx(2.15, abs=1e-12)
    np.testing.assert_allclose(found.seeds["P1"], [0, 0, -0.1], atol=1e-12)
    np.testing.assert_allclose(found.seeds["P2"], [0, 0, 0.05], atol=1e-12)
    for vertex in range(1, 9):  # a corner of a face that stays flush breaks it
        assert np.isnan(found.vertices[f"P1V{vertex}"]).all() == (vertex < 5)
        assert np.isnan(found.vertices[f"P2V{vertex}"]).all() == (vertex > 4)
    assert sum(found.multipliers.values()) == pytest.approx(1.0, abs=1e-12)


def test_a_seated_block_follows_its_tolerances():
    block = box((-1, -1, -1), (1, 1, 1), "block")
    found = solve(Problem(block, SLAB, tolerance=((0.01, 0.02), (0.03, 0.04)), requirement="B",
                          motion=Z >> Rotation("z") >> Rotation("x"), length=1.0)).sensitivity  # fmt: skip
    assert found.exists, found.reasons
    # lifted by rho_1 + rho_2 - 2 = tau_1 - tau_2: upwards 0.02 - 0.03, so down
    np.testing.assert_allclose(found.tolerance, [[0, -1], [1, 0]], atol=1e-12)
    np.testing.assert_allclose(found.nominal, [-1.02, -0.97], atol=1e-12)
    assert found.limits == dict.fromkeys(("TZ", "RZ", "RX"), (0.0, 0.0))


def test_a_weight_and_a_length_change_the_amount_by_what_they_weigh():
    asked = random_problem(1, SKEW >> Rotation("z"), "touch inside")
    solution = solve(asked)
    q, found = np.array(list(solution.parameters.values())), solution.sensitivity
    np.testing.assert_allclose(list(found.weights.values()), asked.weights * q**2 / solution.amount, rtol=1e-12)
    assert found.length == pytest.approx(asked.weights[1] * q[1] ** 2 / solution.amount, rel=1e-9)
    own = solve(asked.changed(weights={"RZ": 1.7})).sensitivity
    assert own.weights == pytest.approx(found.weights)
    assert own.length == 0


# ----------------------------------------------------------------------------------------------- where there are none


def has_none(problem: Problem, reason: str) -> Sensitivity:
    found = solve(problem).sensitivity
    assert not found.exists
    assert any(reason in own for own in found.reasons), found.reasons
    return found


def test_a_cube_in_the_middle_of_another_may_leave_either_way():
    cube = box((-1, -1, -1), (1, 1, 1), "cube")
    has_none(Problem(cube, cube, target=(1, 1), motion=X, goal="touch"), "another motion is as small")
    has_none(Problem(cube, cube, target=(1, 1.1), motion=X >> Y, goal="clear"), "another motion is as small")
    moved = box((-0.9, -1, -1), (1.1, 1, 1), "cube")
    assert solve(Problem(moved, cube, target=(1, 1), motion=X, goal="touch")).sensitivity.exists


def test_two_contacts_at_once_hold_a_single_parameter_in_more_than_one_way():
    """The cube meets a wall and a post at once: which of the two stops it depends on either."""
    cube, wall = box((-1, -1, -1), (1, 1, 1), "cube"), box((2, -1, -1), (3, 0, 1), "wall")
    post = box((2, 0.5, -1), (3, 1, 1), "post")
    step = Body.from_parts([wall.vertices, post.vertices], seed=(4.0, 0.0, 0.0))
    found = has_none(Problem(cube, step, target=(1, 1.1), motion=X, goal="touch"), "either of several")
    assert np.isnan(found.faces["P2V1,V3,V5,V7"])
    assert found.target[0] == pytest.approx(-1.0)  # of that there is no doubt


def test_nothing_to_do_is_one_sided_unless_there_is_room():
    cube, far = box((-1, -1, -1), (1, 1, 1), "cube"), box((2, -1, -1), (4, 1, 1), "far")
    asked = Problem(cube, far, target=(1, 1), motion=X, goal="clear")
    found = solve(asked).sensitivity
    assert found.exists
    assert not found.target.any()
    has_none(asked.changed(clearance=1.0), "one-sided")
    has_none(asked.changed(target=(2.0, 1.0), goal="touch"), "one-sided")


def test_without_a_motion_there_is_nothing_to_differentiate():
    cube, far = box((-1, -1, -1), (1, 1, 1), "cube"), box((2, -1, -1), (4, 1, 1), "far")
    found = has_none(Problem(cube, far, target=(1, 1), motion=Y, goal="touch"), "no motion")
    assert np.isnan(found.target).all()


def test_one_sided_derivatives_by_faces_were_told_where_another_motion_is_as_small():
    """A crate of half sides 1 at scale 0.9 turns either way until an edge is on the floor: 0.9 (cos + sin) = 1."""
    crate, floor = box((-1, -1, 0), (1, 1, 2), "crate"), box((-5, -5, -1), (5, 5, 0), "floor")
    asked = {"target": (0.9, 1.0), "goal": "touch", "motion": Rotation("x"), "length": 2.0}
    back, bottom = (Size(name, "movable", faces=name, tolerance=0.02) for name in ("+y", "-z"))
    found = has_none(Problem(crate, floor, sizes=[back, bottom], made={}, **asked), "another motion is as small")
    turn = np.pi / 4.0 - np.arccos(1.0 / (0.9 * np.sqrt(2.0)))
    rate = 2.0 * np.cos(turn) / (np.cos(turn) - np.sin(turn))  # of the depth of the bottom, for either motion
    assert found.sizes["-z"] == pytest.approx(-rate, abs=1e-6)
    assert np.isnan(found.sizes["+y"])  # growing it shortens one motion alone
    told = {key: x for key, x in found.faces.items() if key.startswith("P1")}
    planes = dict(zip(told, crate.face_planes[0], strict=True))
    for key, x in told.items():
        assert np.isnan(x) == (abs(planes[key][1]) > 0.5)


def test_a_motion_that_nothing_holds_is_told():
    """Twice the least motion: a claim that no constraint balances."""
    solution = solve(Problem(BLOCK, SLAB, target=(1.1, 1.05), motion=Z, goal="touch"))
    larger = replace(solution, parameters={"TZ": 2.0 * solution.parameters["TZ"]})
    assert any("does not hold" in reason for reason in larger.sensitivity.reasons)
    assert any("not the least" in reason for reason in larger.sensitivity.reasons)


# -------------------------------------------------------------------------------------------------------- plain data


def test_it_is_worked_out_once_and_survives_plain_data_and_pickle():
    solution = solve(Problem(BLOCK, SLAB, target=(1.1, 1.05), motion=Z, goal="touch"))
    assert solution.to_dict()["sensitivity"] is None
    found = solution.sensitivity
    assert solution.sensitivity is found
    assert solution.to_dict()["sensitivity"] is None  # whatever was read before
    data = json.loads(json.dumps(solution.to_dict(sensitivity=True), allow_nan=False))
    assert Solution.from_dict(data).to_dict()["sensitivity"] == found.to_dict() == data["sensitivity"]
    assert pickle.loads(pickle.dumps(solution)).sensitivity.to_dict() == found.to_dict()
    assert np.isnan(Solution.from_dict(data).sensitivity.vertices["P1V1"]).all()
    with pytest.raises(InputError, match="target"):
        Sensitivity.from_dict({key: value for key, value in data["sensitivity"].items() if key != "target"})


def slightly(seed: np.ndarray, k: int, step: float) -> np.ndarray:
    """A small shift along an axis, or a small turn about it through a point."""
    T = np.eye(4)
    if k < 3:
        T[k, 3] = step
        return T
    T[:3, :3] = Turn.from_rotvec(step * np.eye(3)[k - 3]).as_matrix()
    T[:3, 3] = seed - T[:3, :3] @ seed
    return T


def motion_found(problem: Problem) -> np.ndarray:
    return np.array(list(solve(problem).parameters.values()))


def differences(problem: Problem, changed: Any, step: float = 1e-4) -> np.ndarray:
    """Central differences of the motion, solved anew; with the length that the problem has."""
    ends = (motion_found(changed(sign * step).changed(length=problem.length)) for sign in (1.0, -1.0))
    return (next(ends) - next(ends)) / (2.0 * step)


MOVED: list[tuple[str, Motion]] = [
    ("touch", Translation("x") >> Translation("y") >> Translation("z")),
    ("clear", Translation("x") >> Rotation("z")),
    ("touch", Free()),
    ("beyond", Translation("z") >> Rotation("z", centre="origin")),
]


@pytest.mark.slow
@pytest.mark.parametrize(("goal", "motion"), MOVED, ids=lambda own: own if isinstance(own, str) else "".join(own.names))
def test_the_motion_changes_with_the_pose_as_differences_of_exact_solves_say(goal: str, motion: Motion) -> None:
    """Of hulls in general position, with fewer contacts than parameters: that takes the constraints' curvature."""
    if goal == "beyond":
        problem = load_problems("problems/example1.toml")[1]
    else:
        rng = np.random.default_rng(3)
        one, two = (Body.convex(rng.normal(size=(10, 3)) + centre) for centre in ([0, 0, 0], [4, 0.3, 0.2]))
        target = (1.02, 0.98) if goal == "touch" else (1.7, 1.8)
        problem = Problem(one, two, target=target, goal=goal, motion=motion)
    told, body = solve(problem).sensitivity.motion_by_pose, problem.request["movable"]
    for k in range(6):
        found = differences(problem, lambda h, k=k: problem.changed(movable=body.moved(slightly(body.seed, k, h))))
        assert told[:, k] == pytest.approx(found, abs=1e-5 * (1.0 + np.abs(found).max()))


def test_the_motion_changes_with_sizes_as_differences_of_exact_solves_say() -> None:
    """A block above a slab goes down by their gap, 1 less what its foot and the slab's top come out larger by."""
    block = Body.convex([*product((-1, 1), (-1, 1), (2, 4))], seed=(0, 0, 3), name="block")
    slab = Body.convex([*product((-3, 3), (-3, 3), (-1, 1))], seed=(0, 0, 0), name="slab")
    sizes = (
        Size("foot", "movable", faces="-z", tolerance=0.1),
        Size("top", "static", faces="+z", tolerance=0.1),
        Size("shrink", "movable", scale="z", tolerance=0.1),
    )
    made = {"foot": 0.01, "top": 0.02, "shrink": 0.03}
    problem = Problem(block, slab, sizes=sizes, made=made, goal="touch", motion=Translation("x") >> Translation("z"))
    told = solve(problem).sensitivity
    expected = {"foot": 1.0, "top": 1.0, "shrink": 1.0}  # the foot is 1 below the seed
    for name, rate in expected.items():
        assert told.motion_by_size[name] == pytest.approx([0.0, rate], abs=1e-9)
        found = differences(problem, lambda h, name=name: problem.changed(made={**made, name: made[name] + h}))
        assert found == pytest.approx([0.0, rate], abs=1e-6)
    assert told.motion_by_pose[1, :3] == pytest.approx([0.0, 0.0, -1.0])
    assert np.isnan(told.motion_by_pose[:, 3]).all()  # tilted, another edge of the foot comes first to either side
    again = Sensitivity.from_dict(json.loads(json.dumps(told.to_dict())))
    assert again.motion_by_size["top"].tolist() == told.motion_by_size["top"].tolist()
    earlier = {key: value for key, value in told.to_dict().items() if not key.startswith("motion")}
    assert Sensitivity.from_dict(earlier).motion_by_pose.shape == (2, 6)


@pytest.mark.parametrize(("turn", "shift"), [(0.0, 0.0), (33.3, 300.0)])
def test_a_wall_in_single_precision_was_told_as_the_outer_face_of_its_plate(turn: float, shift: float) -> None:
    """A hexagonal peg, parallel to the wall of its hole but for digits: a cut of the plate goes on in the wall's plane.

    Both parts larger by 2 % about their seeds: what either wall is moved outwards, or into the hole, counts 1.02 times.
    """
    hexagon, plate = (Manifold.cylinder(height, radius, radius, 6) for height, radius in ((30, 9.8), (40, 10)))
    plate = Manifold.cube([60, 60, 20], True).translate([0, 0, 10]) - plate.translate([0, 0, -5])
    solids = (hexagon + Manifold.cube([40, 40, 8], True).translate([0, 0, 34]), plate)
    bodies, middle = [], np.array([shift, 0.5 * shift, 0.0])
    for solid, height in zip(solids, (27.0, 10.0), strict=True):
        mesh = solid.rotate([0.0, 0.0, turn]).translate(middle.tolist()).to_mesh()
        points = np.asarray(mesh.vert_properties, np.float32)[:, :3].astype(float)
        bodies.append(Body.from_mesh(points, np.asarray(mesh.tri_verts), seed=middle + height * np.eye(3)[2]))
    at = np.radians(turn + 210.0)
    motion, limits = Translation((np.cos(at), np.sin(at), 0.0)), {"T": (0.0, 1.0)}
    solution = solve(Problem(*bodies, tolerance=0.02, requirement="A", goal="touch", motion=motion, limits=limits))
    assert solution.amount == pytest.approx(1.02 * 0.2 * np.cos(np.pi / 6), rel=3e-4)
    counted = {name: value for name, value in solution.sensitivity.faces.items() if abs(value) > 1e-5}
    assert [*counted.values()] == pytest.approx([-1.02, -1.02], rel=1e-5)
    for name, body, radius in zip(counted, bodies, (9.8, 10.0), strict=True):
        corners = body.vertices[[int(label) - 1 for label in name[2:].replace("V", "").split(",")]]
        heights = (corners - middle) @ [np.cos(at), np.sin(at), 0.0]
        assert heights == pytest.approx(np.full(4, radius * np.cos(np.pi / 6)), abs=1e-4)


def test_a_corner_was_taken_for_a_vertex_that_was_put_onto_it() -> None:
    """A block held in a corner of three walls, of which one is a size: the motion has a derivative by it, too."""
    block = fo.Box((40, 30, 20), centre=(20, 15, 10))
    walls = fo.Box((10, 70, 30), centre=(-5, 25, 5)), fo.Box((80, 10, 30), centre=(30, -5, 5))
    fixture = fo.joined(fo.Box((80, 70, 10), centre=(30, 25, -5)), *walls)
    sizes = [
        fo.Size("length", "movable", faces=["-x"], each=1.0),
        fo.Size("wall", "static", faces=[{"through": (0, 20, 10)}], each=1.0),
    ]
    shifts = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
    made = {"length": 0.08, "wall": 0.02}
    asked = fo.Problem(block, fixture, sizes=sizes, made=made, goal="seat", contacts="all", motion=shifts)
    found = fo.solve(asked)
    for own in found.sensitivity.motion_by_size.values():
        assert own == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    assert fo.whatif(found, made={"length": -0.02, "wall": -0.03}).predicted_amount == pytest.approx(0.05, rel=1e-9)


def test_derivatives_by_faces_are_of_faces_as_drawn_and_read_back_the_same() -> None:
    """A pin of 9.95 in a bore of 10: pieces where bodies are exact had keys of their own, not twice the same ones."""
    pin = fo.Cylinder(4.975, 20.0, base=(0.0, 0.0, 0.0), name="pin")
    block = fo.cut(fo.Box((30.0, 30.0, 20.0), centre=(0.0, 0.0, 10.0)), fo.Cylinder(5.0, 22.0, base=(0.0, 0.0, -1.0)))
    sizes = [fo.Size("pin", "movable", faces="cylinder radius 4.975", each=0.5, tolerance=0.02)]
    problem = fo.Problem(pin, block, sizes=sizes, made={"pin": 0.01}, goal="touch", motion=fo.Translation("x"))
    solution = fo.solve(problem)
    assert solution.amount == pytest.approx(0.02, abs=1e-9)
    assert len(solution.sensitivity.faces) == len(pin.faces) + len(block.faces)
    again = Solution.from_dict(json.loads(json.dumps(solution.to_dict(sensitivity=True))))
    assert again.derivatives is not None
    assert fo.verify(again).passed


@pytest.mark.slow
def test_parts_of_a_stepped_shaft_far_from_its_housing_were_held_against_it():
    """A journal of play c whose bore is off by (x, y) goes after it by hypot(x, y) - c: no more holds it than that."""
    shaft = fo.joined(fo.Cylinder(10, 30), fo.Cylinder(6, 25, base=(0, 0, -25)), name="shaft")
    bores = fo.Cylinder(10.05, 60), fo.Cylinder(6.02, 80, base=(0, 0, -70))
    house = fo.cut(fo.Box((50, 50, 60), centre=(0, 0, -10)), *bores, name="house")
    sizes = [fo.Size(own, "static", faces="bore radius 6.02", along=own, tolerance=0.03) for own in "xy"]
    sizes += [fo.Size("journal", "movable", faces="cylinder radius 6", each=0.5, tolerance=0.02)]
    motion = fo.Translation("x") >> fo.Translation("y")
    found = fo.solve(fo.Problem(shaft, house, sizes=sizes, made={"x": 0.03, "y": 0.024}, goal="clear", motion=motion))
    away = np.hypot(0.03, 0.024)
    assert found.amount == pytest.approx(away - 0.02, abs=1e-9)
    by_hand = {"x": 0.03 / away, "y": 0.024 / away, "journal": 0.5}
    assert found.sensitivity.sizes == pytest.approx(by_hand, abs=1e-6)


@pytest.mark.slow
def test_a_flange_that_lies_flat_was_said_to_change_the_amount_by_1e33():
    """What no shift in its plane changes but for rounding holds nothing, however small the slopes are."""
    facets = {"facets": 24}
    cover = fo.joined(fo.Cylinder(52, 8, **facets), fo.Cylinder(30.99, 6.5, base=(0, 0, -6), **facets))
    cover = fo.cut(cover, fo.Cylinder(3.3, 12, base=(42, 0, -1), **facets), name="cover")
    bored = fo.cut(fo.Box((120, 120, 30), centre=(0, 0, -15)), fo.Cylinder(31, 22, base=(0, 0, -20), **facets))
    housing = fo.joined(bored, fo.Cylinder(3, 24, base=(42, 0, -10), **facets), name="housing")
    hole = fo.Size("hole x", "movable", faces="bore radius 3.3", along="x", tolerance=0.35)
    motion = fo.Translation("x") >> fo.Translation("y")
    problem = fo.Problem(cover, housing, sizes=[hole], made={"hole x": 0.305}, goal="clear", motion=motion)
    found = fo.solve(problem).sensitivity
    assert found.sizes["hole x"] == pytest.approx(1.0, abs=1e-9)
    told = [*found.faces.values(), found.clearance, *found.target]
    assert np.nanmax(np.abs(told), initial=0.0) < 2.0
