"""The judge on contacts: right motions that it once refused, the wrong ones beside them, and cuts between parts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation as Turn
from solids import box, polygon, prism, solid_of

import fcdm_opt as fo
from fcdm_opt.curve.contact import meetings
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.judge.certificate import verify
from fcdm_opt.motion.motions import Free, Motion, Rotation, Translation
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Certificate, Solution, Status
from fcdm_opt.solver import solve


def failed(certificate: Certificate) -> set[str]:
    return {check.name for check in certificate.failed}


def at_rest(one: Body, two: Body, labels: tuple[str, ...], **changes: Any) -> Solution:
    """Claim that two bodies touch as drawn, by these features."""
    problem = Problem(one, two, target=(1.0, 1.0), motion=Translation("x"), goal="touch")
    made = Solution(
        problem=problem, status=Status.ALREADY_SATISFIED, parameters={"TX": 0.0}, transform=np.eye(4), amount=0.0,
        rho=np.ones(2), features=tuple(map(Feature.from_label, labels)), pair=np.ones(2), pair_gap=0.0,
        pair_state="touching",
    )  # fmt: skip
    return replace(made, **changes)


# ------------------------------------------------------------------------- contacts of which one closes as one opens

LEFT, RIGHT = "F1F2(P1V1,V3,V5,V7; P2V2,V4,V6,V8)", "F1F2(P1V2,V4,V6,V8; P2V9,V11,V13,V15)"
SLOT = Body.from_parts([box((4, -1, -1), (5, 2, 2)), box((6, -1, -1), (7, 2, 2))], seed=[0, 0, 0], name="slot")


def key(left: float, right: float = 6.0) -> Body:
    """A key in the slot; all seeds lie beyond the left wall, so a smaller key leaves the right wall for the left."""
    return Body.convex(box((left, 0, 0), (right, 1, 1)), seed=[0, 0, 0], name="key")


@pytest.mark.parametrize("play", [2e-8, 1e-7, 1e-6, 4e-6, 1e-4])
def test_a_wall_that_closes_as_the_contact_opens_is_no_fault(play: float) -> None:
    """The other wall is nearer than the change of scales at which the contact is looked at, 1e-6 of the size."""
    certificate = verify(at_rest(key(5.0 + play), SLOT, (RIGHT,)))
    assert certificate.passed, certificate.failed
    assert {"apart below", "overlapping above"} <= {check.name for check in certificate.checks}


@pytest.mark.parametrize("depth", [2e-8, 1e-7, 1e-6, 4e-6, 1e-4])
def test_a_wall_that_the_part_is_in_is_one(depth: float) -> None:
    assert {"touching", "pair state", "pair gap"} <= failed(verify(at_rest(key(5.0 - depth), SLOT, (RIGHT,))))


def test_a_fit_without_play_is_judged_wall_by_wall() -> None:
    both = at_rest(key(5.0), SLOT, (LEFT, RIGHT))
    certificate = verify(both)
    assert certificate.passed, certificate.failed
    assert {"contact 2", "apart below", "overlapping above"} <= {check.name for check in certificate.checks}
    for label in (LEFT, RIGHT):  # what touches besides does not open with the one that is claimed
        assert failed(verify(replace(both, features=(Feature.from_label(label),)))) == {"apart below"}


@pytest.mark.parametrize("play", [2e-8, 1e-6, 1e-4])
def test_a_wall_that_is_not_touched_is_no_contact_beside_one_that_is(play: float) -> None:
    assert failed(verify(at_rest(key(5.0 + play), SLOT, (LEFT, RIGHT)))) >= {"contact 1"}
    assert failed(verify(at_rest(key(5.0 + play), SLOT, (LEFT,)))) >= {"contact 1"}


@pytest.mark.parametrize("play", [2e-8, 1e-6, 1e-4])
def test_nearness_is_no_contact(play: float) -> None:
    found = failed(verify(at_rest(key(5.0 + play, 6.0 - play), SLOT, (RIGHT,))))
    assert {"touching", "contact 1", "pair touches"} <= found


def test_a_contact_by_a_corner_alone_is_judged_by_its_own_parts() -> None:
    """A wedge's edge on a block's face, and 3e-7 beside it a wall that comes nearer as the wedge shrinks."""
    wedge = Body.convex([[0, 0, 0], [0, 1, 0], [-1, 0, 1], [-1, 1, 1], [1, 0, 1], [1, 1, 1]], seed=[-9, 0.5, 2],
                        name="wedge")  # fmt: skip
    for gap, passes in ((3e-7, True), (-3e-7, False)):
        wall = box((-2, -1, 0.5), (-1 - gap, 2, 2))
        static = Body.from_parts([box((-1, -1, -1), (1, 2, 0)), wall], seed=[0, 0, -0.5], name="corner")
        certificate = verify(at_rest(wedge, static, ("E1F2(P1V1,V2; P2V5,V6,V7,V8)",)))
        assert certificate.passed == passes, certificate.failed


# --------------------------------------------------------------------------------- faces that rounding cuts in pieces


def common_point(problem: Problem, feature: Feature, solution: Solution) -> float:
    """The least distance, largest coordinate, of a point of one element's hull from one of the other's: a program."""
    one, two = problem.movable, problem.static
    assert solution.rho is not None
    assert solution.transform is not None
    R, t = solution.transform[:3, :3], solution.transform[:3, 3]
    offset = R @ (one.seed - two.seed) + (R @ two.seed + t - two.seed)
    X = solution.rho[0] * (one.vertices[[v - 1 for v in feature.one.vertices]] - one.seed) @ R.T + offset
    Y = solution.rho[1] * (two.vertices[[v - 1 for v in feature.two.vertices]] - two.seed)
    between, k, m = np.hstack([X.T, -Y.T]), len(X), len(Y)
    most = np.full((3, 1), -1.0)
    sums = np.zeros((2, k + m + 1))
    sums[0, :k], sums[1, k:-1] = 1.0, 1.0
    rows = np.vstack([np.hstack([between, most]), np.hstack([-between, most])])
    found = linprog([*np.zeros(k + m), 1.0], rows, np.zeros(6), sums, [1.0, 1.0])
    assert found.status == 0
    return float(found.fun)


@pytest.mark.parametrize("number", [1012598782, *range(2)])
def test_contacts_of_parts_drawn_far_away_share_a_point(number: int) -> None:
    """Quads 1e4 sizes from the origin and turned are two triangles each: a contact lies on one of them."""
    turn, shift = Turn.random(random_state=number).as_matrix(), [16637.23991391, 6591.47749832, -16413.97294585]

    def placed(blocks: list[Any], seed: float, name: str) -> Body:
        own = [np.array(block) @ turn.T + shift for block in blocks]
        return Body.from_parts(own, seed=turn @ [0.0, 0.0, seed] + shift, name=name)

    def ring(inside: float, low: float, high: float) -> list[Any]:
        return [
            box((inside, -4, low), (4, 4, high)),
            box((-4, -4, low), (-inside, 4, high)),
            box((-inside, inside, low), (inside, 4, high)),
            box((-inside, -4, low), (inside, -inside, high)),
        ]

    aside = np.array([0.0017576560305400, 0.0160886031886396, 0.0])
    blocks = [box((-1, -1, -2), (1, 1, 0)) + aside, box((-2, -2, 0), (2, 2, 1)) + aside]
    peg, hole = placed(blocks, -0.3, "peg"), placed([*ring(1.02, -2, 0), *ring(2.02, 0, 1)], -1.0, "hole")
    problem = Problem(peg, hole, target=(1.05, 0.95), motion=Translation("z"), goal="clear")
    solution = solve(problem)
    assert solution.verified, solution.certificate and solution.certificate.failed
    assert solution.features
    for feature in solution.features:
        assert common_point(problem, feature, solution) <= problem.contact_slack, str(feature)


# ------------------------------------------------------------------------------------------- cuts between the parts

SIDES, STEP = 24, 30.0


@cache
def shaft_on_a_step() -> tuple[Body, Body]:
    """A stepped shaft on the step of a bore, radius 10 to 15; cut into parts, its plane goes on inside to radius 30."""
    cuts = [prism(polygon(SIDES, 10.0), -11, 46), prism(polygon(SIDES, 15.0), STEP, 46)]
    bore = solid_of([prism(polygon(SIDES, 30.0), -10, 45)], cuts)
    shaft = solid_of([prism(polygon(SIDES, 9.0), 0, STEP + 1), prism(polygon(SIDES, 14.0), STEP, 55)], [])
    assert bore is not None
    assert shaft is not None
    return shaft.body(), bore.body()


def test_faces_of_parts_that_reach_a_true_face_by_little_are_named_after_it() -> None:
    """Samples on the parts' faces missed the step on some of them, which were then named by their own corners."""
    _, bore = shaft_on_a_step()
    step = {k for k in bore.corners if bore.vertices[k - 1, 2] == STEP}
    assert len(step) == 2 * SIDES
    seen = 0
    for part in bore.parts:
        for k, loop in enumerate(part.loops):
            corners = part.vertices[list(loop)]
            if part.normals[k][2] < 0.5 or not (corners[:, 2] == STEP).all():
                continue
            flat = corners[:, :2]
            sides = np.roll(flat, -1, axis=0) - flat
            share = np.clip(-(flat * sides).sum(axis=1) / (sides**2).sum(axis=1), 0, 1)
            nearest = np.hypot(*(flat + share[:, None] * sides).T).min()
            if nearest < 14.75:  # the rim of the step is nowhere nearer than 14.8 to its axis
                seen += 1
                assert set(part.elements["F"][k].vertices) == step
    assert seen >= SIDES // 2


@pytest.mark.slow
@pytest.mark.parametrize(("goal", "requirement"), [("seat", "A"), ("seat", "D"), ("touch", "B")])
def test_contacts_name_the_solids_own_corners(goal: str, requirement: str) -> None:
    shaft, bore = shaft_on_a_step()
    problem = Problem(shaft, bore, requirement=requirement, tolerance=0.02, motion=Translation("z"), goal=goal)
    solution = solve(problem)
    assert solution.usable, solution.certificate and solution.certificate.failed
    assert solution.transform is not None
    pose = problem.curve.pose.copy()
    R, moved = solution.transform[:3, :3], solution.transform[:3, 3]
    pose[:9], pose[9:] = R.ravel(), bore.seed - R @ shaft.seed - moved
    met = meetings(shaft, bore, pose, solution.pair, problem.contact_slack)
    assert len(met) >= SIDES // 2
    for feature in (*solution.features, *(meeting.contact.feature for meeting in met)):
        for body, own in ((shaft, feature.one), (bore, feature.two)):
            places = body.vertices[[v - 1 for v in own.vertices]]
            assert (places[:, 2] == STEP).all()
            assert np.hypot(*places.T[:2]).max() < 15.1
    (feature,) = solution.features
    inner = sorted(set(range(1, len(bore.vertices) + 1)) - set(bore.corners))
    cut = next(
        Element("F", tuple(sorted(bore_row(bore, part.vertices[v]) for v in loop)))
        for part in bore.parts
        for loop in part.loops
        if (part.vertices[list(loop)][:, 2] == STEP).all() and len(loop) > 2
    )
    for other in (Element("V", (inner[0],)), cut, Element("E", (inner[0], min(bore.corners)))):
        certificate = verify(replace(solution, features=(replace(feature, two=other),)))
        assert "own elements" in failed(certificate)


def bore_row(body: Body, point: np.ndarray) -> int:
    """The label of a vertex."""
    return int(np.flatnonzero((body.vertices == point).all(axis=1))[0]) + 1


# ---------------------------------------------------------------------------------- walls that stand against each other


def frame(bottom: float) -> Body:
    """Four walls of height 1 about a square hole of width 2; two of them end at the sides of the others."""
    walls = [((1, -3), (3, 3)), ((-3, -3), (-1, 3)), ((-1, 1), (1, 3)), ((-1, -3), (1, -1))]
    parts = [box((*low, bottom), (*high, bottom + 1)) for low, high in walls]
    return Body.from_parts(parts, seed=(0, 0, bottom + 0.5), name="frame")


def test_a_side_of_a_wall_that_another_wall_covers_is_no_face_of_the_solid() -> None:
    """The frame's inner sides end at the corners of its hole; what stands against the other walls is inside."""
    body, looked = frame(0), 0
    bottom, top = body.faces[:2]
    for part in body.parts[:2]:
        for k, (a, b) in enumerate(part.edges[:, :2].tolist()):
            span = part.elements.spans.get(("E", k))
            if span is None or not np.ptp(part.vertices[[a, b], 1]) > 5.0:
                continue  # the long edges beside the hole: true where the hole is, inside top or bottom elsewhere
            named = {element.vertices for element in span.elements if element.kind == "F"}
            assert named == {top if part.vertices[a, 2] > 0.5 else bottom}
            looked += 1
    assert looked == 4


@pytest.mark.sampled(3)
@pytest.mark.parametrize("requirement", "AD")
@pytest.mark.parametrize("motion", [Translation("z"), Translation("z") >> Rotation("x"), Free()])
def test_a_frame_on_its_copy_touches_with_one_face(motion: Motion, requirement: str) -> None:
    """Parts that meet along the edge of a wall inside the face were said to touch with the wall's covered side."""
    sign = {"A": 1.0, "D": -1.0}[requirement]
    problem = Problem(frame(1), frame(0), tolerance=0.02, requirement=requirement, motion=motion, goal="touch")
    solution = solve(problem, effort="quick")
    assert solution.usable, solution.certificate
    assert solution.amount <= 0.02 * (1.0 + 1e-9)  # both half as much higher about their middles: a lift does
    if motion == Translation("z"):
        assert solution.parameters["TZ"] == pytest.approx(sign * 0.02)
        assert [feature.kind for feature in solution.features] == ["F1F2"]


@pytest.mark.parametrize("label", ["F1F2(P1V1,V3,V5,V7; P2V2,V4,V6,V8)", "F1F2(P1V1,V2,V5,V6; P2V2,V4,V6,V8)"])
def test_a_face_that_stands_aslant_does_not_lie_on_another(label: str) -> None:
    """A crate tilted onto its edge: faces at the edge, 6 and 84 degrees off, passed for ones that lie on the floor."""
    crate = fo.Body.convex([*product((-1, 1), (-1, 1), (0, 2))])
    floor = fo.Body.convex([*product((-5, 5), (-5, 5), (-1, 0))])
    motion = fo.Rotation("x") >> fo.Translation("z")
    found = fo.solve(fo.Problem(crate, floor, target=(1, 1), goal="touch", motion=motion, limits={"RX": (0.1, 0.5)}))
    assert found.usable
    claimed = {**found.to_dict(), "features": [label]}
    assert not fo.verify(fo.Solution.from_dict(claimed)).passed
