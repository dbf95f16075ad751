"""The judge: published motions pass, and every planted error fails the check that is meant to catch it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from cases import ONE_LINE, OneLine
from contact_truth import exact_gap, exact_meeting
from ordinary import box, problems

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.judge.certificate import verify
from fcdm_opt.motion.motions import Rotation, Translation
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Certificate, Solution, Status
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

NOMINAL = {  # published features of SW3 and SW1
    "example1": ("F1V2(P1V1,V3,V4,V6; P2V2)", "E1E2(P1V1,V4; P2V1,V2)"),
    "example2": ("V1F2(P1V5; P2V4,V5,V10,V11)", "V1F2(P1V4; P2V3,V4,V9,V10)"),
}
CASES = [(file, case) for file in NOMINAL for case in "ABCD"]


def stated(problem: Problem, gap: float) -> str:
    limit = DEFAULT.touch * problem.static.size
    return "touching" if abs(gap) <= limit else "apart" if gap > 0 else "overlapping"


def claimed(problem: Problem, q: Any, labels: tuple[str, ...], rho: Any = None, **changes: Any) -> Solution:
    """A solution with these parameters, everything else worked out in rationals."""
    names = [parameter.name for parameter in problem.motion.parameters]
    transform = problem.motion.transform(q, problem.movable.seed, problem.static.seed)
    features = tuple(map(Feature.from_label, labels))
    gap = exact_gap(problem, transform)
    state = stated(problem, gap)
    overlaps = state == "overlapping"
    made = Solution(
        problem=problem, status=Status.PAIR_OVERLAPS if overlaps else Status.SOLVED,
        parameters=dict(zip(names, map(float, q), strict=True)), transform=transform,
        amount=float(np.linalg.norm(problem.weights * q)),
        rho=np.array(exact_meeting(problem, features, transform) if rho is None else rho, dtype=np.float64),
        features=features, pair=problem.target, pair_gap=gap, pair_state=state,
    )  # fmt: skip
    return replace(made, **changes)


@cache
def published(file: str, case: str) -> Solution:
    problem = problems(file)[case]
    assert problem.published is not None
    return claimed(problem, problem.published, NOMINAL[file])


def failed(certificate: Certificate) -> set[str]:
    return {check.name for check in certificate.failed}


def tell(certificate: Certificate) -> str:
    return "\n".join(map(str, certificate.failed))


# ------------------------------------------------------------------------------------------- published motions hold


@pytest.mark.parametrize(("file", "case"), CASES)
def test_published_motions_satisfy_their_requirements(file: str, case: str) -> None:
    certificate = verify(published(file, case))
    assert certificate.passed, tell(certificate)
    assert len(certificate.checks) >= 20


# --------------------------------------------------------------------------------- planted errors, in all eight cases


def shifted(solution: Solution, sign: float) -> Solution:
    """Move body 1 by 1e-6 of the size along the first contact normal: sign 1 into body 2, -1 away."""
    problem, transform = solution.problem, np.array(solution.transform)
    feature = solution.features[0]
    body, element = (problem.static, feature.two) if feature.two.kind == "F" else (problem.movable, feature.one)
    corners = body.vertices[[label - 1 for label in element.vertices]]
    n = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    n *= np.sign(n @ (corners[0] - body.seed)) / np.linalg.norm(n)
    n = -n if body is problem.static else transform[:3, :3] @ n
    transform[:3, 3] += sign * 1e-6 * problem.static.size * n
    return replace(solution, transform=transform)


def renamed_vertex(solution: Solution, step: int) -> Solution:
    """Claim a neighbour of the true contact vertex."""
    feature, *rest = solution.features
    field, body = ("one", solution.problem.movable) if feature.one.kind == "V" else ("two", solution.problem.static)
    (vertex,) = getattr(feature, field).vertices
    edges = [element.vertices for part in body.parts for element in part.elements["E"] if element.kind == "E"]
    near = sorted({label for edge in edges if vertex in edge for label in edge} - {vertex})
    return replace(solution, features=(replace(feature, **{field: Element("V", (near[step],))}), *rest))


def retargeted(solution: Solution, relative: float) -> Solution:
    """Ask for a target that lies further out than the tracked point, in both scales."""
    problem, rho = solution.problem, solution.rho
    assert rho is not None
    target = tuple(rho * (1 + relative * problem.signs))
    other = problem.changed(requirement=None, tolerance=None, target=target, goal="beyond")
    return claimed(other, list(solution.parameters.values()), tuple(map(str, solution.features)))


def turned_once_more(solution: Solution) -> Solution:
    """Add a full turn: the pose at the end is the same, on the way the features come apart."""
    problem = solution.problem
    other = problem.changed(motion=problem.motion >> Rotation("z", "origin"), published=None)
    return claimed(other, [*solution.parameters.values(), 2 * np.pi], tuple(map(str, solution.features)))


def limited(solution: Solution) -> Solution:
    name, value = next(iter(solution.parameters.items()))
    reach = abs(value) * (1 - 1e-6)
    return replace(solution, problem=solution.problem.changed(limits={name: (-reach, reach)}))


def other_state(solution: Solution, step: int) -> Solution:
    states = ["apart", "touching", "overlapping"]
    return replace(solution, pair_state=states[(states.index(solution.pair_state) + step) % 3])


def other_status(solution: Solution) -> Solution:
    swap = {Status.SOLVED: Status.PAIR_OVERLAPS, Status.PAIR_OVERLAPS: Status.SOLVED}
    return replace(solution, status=swap[solution.status])


def other_parameter(solution: Solution) -> Solution:
    (name, value), *rest = solution.parameters.items()
    return replace(solution, parameters={name: value * (1 + 1e-3), **dict(rest)})


def size(solution: Solution) -> float:
    return solution.problem.static.size


# name -> (how to spoil a good solution, checks that must fail, whether no other may)
PLANTED: dict[str, tuple[Callable[[Solution], Solution], set[str], bool]] = {
    "pose shifted into body 2": (lambda s: shifted(s, 1), {"transform of parameters", "touching", "contact 1"}, False),
    "pose shifted away": (lambda s: shifted(s, -1), {"transform of parameters", "contact 1"}, False),
    "first neighbour vertex": (lambda s: renamed_vertex(s, 0), {"contact 1", "nominal features"}, False),
    "last neighbour vertex": (lambda s: renamed_vertex(s, -1), {"contact 1", "nominal features"}, False),
    "one feature dropped": (lambda s: replace(s, features=s.features[:1]), {"nominal features"}, False),
    "no features": (lambda s: replace(s, features=()), {"features", "nominal features"}, True),
    "requirement off by 1e-6": (lambda s: retargeted(s, 1e-6), {"requirement"}, True),
    "incoherent ray": (turned_once_more, {"path features", "path touching"}, True),
    "wrong pair state": (lambda s: other_state(s, 1), {"pair state"}, True),
    "other wrong pair state": (lambda s: other_state(s, 2), {"pair state"}, True),
    "unknown pair state": (lambda s: replace(s, pair_state="unknown"), {"pair state"}, True),
    "pair gap too large": (lambda s: replace(s, pair_gap=abs(s.pair_gap) + size(s) * 1e-1), {"pair gap"}, True),
    "pair gap of wrong sign": (lambda s: replace(s, pair_gap=-s.pair_gap), {"pair gap"}, True),
    "wrong status": (other_status, {"status"}, True),
    "already satisfied, yet moved": (lambda s: replace(s, status=Status.ALREADY_SATISFIED), {"status"}, True),
    "amount too small": (lambda s: replace(s, amount=s.amount * (1 - 1e-6)), {"amount"}, True),
    "lower bound above the amount": (lambda s: replace(s, lower_bound=s.amount * (1 + 1e-6)), {"lower bound"}, True),
    "limit violated": (limited, {"limits"}, True),
    "parameter of another pose": (other_parameter, {"transform of parameters", "amount"}, False),
    "transform grown": (lambda s: replace(s, transform=s.transform * np.diag([1 + 1e-6] * 3 + [1])),
                        {"rigid transform"}, False),
    "mirrored": (lambda s: replace(s, transform=s.transform @ np.diag([1, 1, -1, 1])), {"rigid transform"}, False),
    "tracked pair off the curve": (lambda s: replace(s, rho=s.rho * (1 + 1e-6)), {"touching", "contact 1"}, False),
    "pair of other parts": (lambda s: replace(s, pair=s.pair * (1 + 1e-6)), {"target pair"}, True),
    "nan in rho": (lambda s: replace(s, rho=np.array([np.nan, 1])), {"finite numbers"}, True),
    "nan in transform": (lambda s: replace(s, transform=s.transform * np.nan), {"finite numbers"}, True),
    "nan amount": (lambda s: replace(s, amount=float("nan")), {"finite numbers"}, True),
    "nan gap": (lambda s: replace(s, pair_gap=float("nan")), {"finite numbers"}, True),
    "nan parameter": (lambda s: replace(s, parameters=dict.fromkeys(s.parameters, float("nan"))),
                      {"finite numbers"}, True),
    "no parameters": (lambda s: replace(s, parameters={}), {"motion found"}, True),
    "no motion": (lambda s: Solution(problem=s.problem, status=Status.NOT_FOUND, pair=s.pair), {"motion found"}, True),
}  # fmt: skip


@pytest.mark.sampled(131)
@pytest.mark.parametrize("error", PLANTED)
@pytest.mark.parametrize(("file", "case"), CASES)
def test_planted_errors_fail_the_check_that_is_meant_for_them(file: str, case: str, error: str) -> None:
    spoil, expected, alone = PLANTED[error]
    certificate = verify(spoil(published(file, case)))
    assert not certificate.passed
    assert expected <= failed(certificate), tell(certificate)
    assert not alone or expected == failed(certificate), tell(certificate)


@pytest.mark.parametrize(("file", "case"), CASES)
def test_a_requirement_met_exactly_passes(file: str, case: str) -> None:
    certificate = verify(retargeted(published(file, case), 0.0))
    assert certificate.passed, tell(certificate)


@pytest.mark.parametrize(("file", "case"), CASES)
def test_the_demanded_state_of_the_pair_is_checked(file: str, case: str) -> None:
    solution = published(file, case)
    q, labels = list(solution.parameters.values()), NOMINAL[file]
    touching = claimed(solution.problem.changed(pair="touch"), q, labels)
    assert failed(verify(touching)) == {"pair touches"}
    apart = claimed(solution.problem.changed(pair="clear"), q, labels)
    assert failed(verify(apart)) == (set() if solution.pair_state == "apart" else {"clearance"})
    wide = claimed(solution.problem.changed(pair="clear", clearance=0.5 * size(solution)), q, labels)
    assert failed(verify(wide)) == {"clearance"}


def test_a_rejected_solution_is_not_usable_and_an_accepted_one_is() -> None:
    good = published("example1", "B")
    assert good.with_certificate(verify(good), 0.0).usable
    bad = replace(good, amount=0.0)
    judged = bad.with_certificate(verify(bad), 0.0)
    assert judged.status is Status.NOT_VERIFIED
    assert not judged.usable
    assert "amount" in failed(verify(judged))  # judged again, the same faults are found


# ----------------------------------------------------------------------------------------------- scenes in closed form


def test_a_ray_through_a_bump_is_incoherent() -> None:
    """A tip slides along a floor; halfway stands a block. Both ends are fine."""
    tip = Body.convex([[0, 0, 0], [1, 0, 2], [-1, 1, 2], [-1, -1, 2]], seed=[0, 0, 1], name="tip")
    floor = [[x, y, z] for x in (-9, 9) for y in (-9, 9) for z in (-2, 0)]
    block = [[x, y, z] for x in (3, 5) for y in (-1, 1) for z in (-1, 1)]
    bodies = {name: Body.from_parts(parts, seed=[0, 0, -1], name=name)
              for name, parts in (("floor", [floor]), ("bump", [floor, block]))}  # fmt: skip
    outcome = {}
    for name, static in bodies.items():
        problem = Problem(tip, static, nominal=(1.0, 1.0), target=(1.0, 1.0), motion=Translation("x"), goal="at")
        assert problem.nominal_contact.feature.kind == "V1F2"
        label = problem.nominal_contact.feature.label
        transform = problem.motion.transform([8.0], tip.seed, static.seed)
        solution = Solution(
            problem=problem, status=Status.SOLVED, parameters={"TX": 8.0}, transform=transform, amount=8.0,
            rho=np.ones(2), features=(Feature.from_label(label),), pair=np.ones(2), pair_gap=0.0, pair_state="touching",
        )  # fmt: skip
        outcome[name] = failed(verify(solution))
    assert outcome == {"floor": set(), "bump": {"path touching"}}


def flush(gap: float, clearance: float, **changes: Any) -> Solution:
    """Two unit boxes, face to face after a move of 1 - gap, asked to keep a clearance."""
    one, two = box((-2, 0, 0), (-1, 1, 1)), box((0, 0.25, 0.25), (1, 1.25, 1.25))
    goal = "clear" if clearance else "touch"
    problem = Problem(one, two, target=(1.0, 1.0), motion=Translation("x"), goal=goal, clearance=clearance)
    transform = problem.motion.transform([1 - gap], one.seed, two.seed)
    made = Solution(
        problem=problem, status=Status.SOLVED, parameters={"TX": 1 - gap}, transform=transform, amount=1 - gap,
        rho=np.ones(2), features=() if clearance else (Feature.from_label("F1F2(P1V2,V4,V6,V8; P2V1,V3,V5,V7)"),),
        pair=np.ones(2), pair_gap=gap, pair_state="apart" if clearance else "touching",
    )  # fmt: skip
    return replace(made, **changes)


def test_face_on_face_touches() -> None:
    certificate = verify(flush(0.0, 0.0))
    assert certificate.passed, tell(certificate)
    assert {"touching", "contact 1"} <= failed(verify(flush(1e-6, 0.0)))
    assert {"touching", "contact 1"} <= failed(verify(flush(-1e-6, 0.0)))
    other = Feature.from_label("F1F2(P1V1,V3,V5,V7; P2V1,V3,V5,V7)")
    assert "contact 1" in failed(verify(flush(0.0, 0.0, features=(other,))))
    diagonal = Feature.from_label("E1F2(P1V2,V8; P2V1,V3,V5,V7)")  # in the contact, but no edge
    assert "contact 1" in failed(verify(flush(0.0, 0.0, features=(diagonal,))))


def test_a_clearance_is_kept_to_the_letter() -> None:
    certificate = verify(flush(0.125, 0.125))
    assert certificate.passed, tell(certificate)
    assert failed(verify(flush(0.125 - 1e-6, 0.125))) == {"clearance"}


@pytest.mark.parametrize("label", ["F1F2(P1V1,V3,V5,V7; P2V2,V4,V6,V8)", "F1F2(P1V2,V4,V6,V8; P2V9,V11,V13,V15)"])
def test_a_snug_key_opens_and_closes_at_each_of_its_walls(label: str) -> None:
    """Both seeds lie beyond the left wall, so a larger key leaves one wall and enters the other."""
    key = box((5, 0, 0), (6, 1, 1), seed=(0, 0, 0), name="key")
    walls = [[[x, y, z] for z in (-1, 2) for y in (-1, 2) for x in xs] for xs in ((4, 5), (6, 7))]
    slot = Body.from_parts(walls, seed=[0, 0, 0], name="slot")
    problem = Problem(key, slot, target=(1.0, 1.0), motion=Translation("x"), goal="touch")
    labels = ("F1F2(P1V1,V3,V5,V7; P2V2,V4,V6,V8)", "F1F2(P1V2,V4,V6,V8; P2V9,V11,V13,V15)")
    both = Solution(
        problem=problem, status=Status.ALREADY_SATISFIED, parameters={"TX": 0.0}, transform=np.eye(4), amount=0.0,
        rho=np.ones(2), features=tuple(map(Feature.from_label, labels)), pair=np.ones(2), pair_gap=0.0,
        pair_state="touching",
    )  # fmt: skip
    certificate = verify(both)
    assert certificate.passed, tell(certificate)
    assert {"apart below", "overlapping above"} <= {check.name for check in certificate.checks}
    alone = verify(replace(both, features=(Feature.from_label(label),)))  # with one wall there is no free side
    assert failed(alone) == {"apart below"}


@pytest.mark.parametrize("case", ONE_LINE, ids=lambda case: case.name)
def test_degenerate_contacts_are_judged(case: OneLine) -> None:
    """Parallel edges, vertex on vertex: where one contact is not enough to name a normal, and coal loses its way."""
    one, two = case.one.body("one"), case.two.body("two")
    p, q, r = case.line
    target = (r / (p + q),) * 2
    problem = Problem(one, two, target=target, motion=Translation("z"), goal="touch")
    solution = Solution(
        problem=problem, status=Status.ALREADY_SATISFIED, parameters={"TZ": 0.0}, transform=np.eye(4), amount=0.0,
        rho=problem.target, features=(Feature.from_label(case.label),), pair=problem.target, pair_gap=0.0,
        pair_state="touching",
    )  # fmt: skip
    certificate = verify(solution)
    assert certificate.passed, tell(certificate)
    for sign in (1, -1):
        away = np.array(solution.transform)
        away[:3, 3] = sign * 1e-6 * two.size * (two.seed - one.seed) / np.linalg.norm(two.seed - one.seed)
        assert {"touching", "contact 1"} <= failed(verify(replace(solution, transform=away)))


# ----------------------------------------------------------------------------------------------------------- keep-outs

PART = box((-1, -1, -1), (1, 1, 1), name="part")
AWAY = box((80, -1, -1), (90, 1, 1), name="away")


def left_at(x: float, *keep_out: KeepOut, target: tuple[float, float] = (1.0, 1.0)) -> Solution:
    """The part moved by x, in a scene that such a motion was never checked against."""
    problem = Problem(PART, AWAY, target=target, motion=Translation("x"), goal="clear")
    gap = 80 - target[0] - x + 5 * (1 - target[1])
    made = Solution(
        problem=problem, status=Status.SOLVED, parameters={"TX": x}, amount=abs(x), rho=problem.target,
        transform=problem.motion.transform([x], PART.seed, AWAY.seed), pair=problem.target, pair_gap=gap,
        pair_state="apart",
    )  # fmt: skip
    assert verify(made).passed, tell(verify(made))
    return replace(made, problem=problem.changed(keep_out=keep_out))


POST = box((2, -1, -1), (4, 1, 1), name="post")  # seed at x = 3


@pytest.mark.parametrize(("scale", "clearance"), [(1.0, 0.0), (1.0, 0.25), (1.5, 0.0), ((0.5, 1.5), 0.25)])
def test_a_clearance_to_a_keep_out_is_judged_to_the_letter(scale: Any, clearance: float) -> None:
    keep_out = KeepOut(POST, scale, clearance=clearance)
    limit = 3 - np.max(scale) - 1.0 - clearance
    name = "keep-out 'post': clearance"
    for x, passed in ((limit - 1e-6, True), (limit, True), (limit + 1e-6, False), (limit + 1.0, False)):
        certificate = verify(left_at(x, keep_out))
        assert failed(certificate) == (set() if passed else {name})
        (check,) = (check for check in certificate.checks if check.name == name)
        assert check.value == pytest.approx(limit + clearance - x, abs=1e-12)
        assert check.limit == pytest.approx(clearance, abs=1e-8)


def test_the_part_is_judged_at_its_own_scale_against_keep_outs() -> None:
    assert verify(left_at(0.0, KeepOut(POST))).passed
    assert failed(verify(left_at(0.0, KeepOut(POST), target=(2.0 + 1e-6, 1.0)))) == {"keep-out 'post': clearance"}


def test_a_keep_out_inside_the_part_is_an_overlap() -> None:
    pin = box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1), name="pin")
    around = box((-3, -3, -3), (3, 3, 3), name="around")
    certificate = verify(left_at(0.0, KeepOut(pin), KeepOut(around), KeepOut(POST)))
    assert failed(certificate) == {"keep-out 'pin': clearance", "keep-out 'around': clearance"}


@pytest.mark.parametrize("width", [1.0, 0.02])
def test_a_keep_out_that_passes_between_the_ends_of_its_range_is_seen(width: float) -> None:
    """Grown about the origin from x = 4 to 8 the post meets the part on its way, however thin it is."""
    slab = box((4, -1, -1), (4 + width, 1, 1), seed=(-3.0, 0.0, 0.0), name="slab")
    x = 7.6  # the part lies at 6.6 <= x <= 8.6
    low, high = (6.6 + 3) / (7 + width) * (1 - 1e-3), (8.6 + 3) / 7 * (1 + 1e-3)
    for end in (low, high):
        assert verify(left_at(x, KeepOut(slab, end))).passed
    assert failed(verify(left_at(x, KeepOut(slab, (low, high))))) == {"keep-out 'slab': clearance"}
    assert verify(left_at(high * 7 - 2 + width * high, KeepOut(slab, (low, high)))).passed


def test_a_thin_part_between_the_scales_looked_at_is_seen() -> None:
    thin = box((-0.05, -1, -1), (0.05, 1, 1), name="thin")
    slab = box((4, -1, -1), (4.02, 1, 1), seed=(0.0, 0.0, 0.0), name="slab")
    count = DEFAULT.scale_points
    middle = 4 * (1 + 1.5 / (count - 1))  # between the slab's places at the second and the third scale
    problem = Problem(thin, AWAY, target=(1, 1), motion=Translation("x"), goal="clear",
                      keep_out=(KeepOut(slab, (1.0, 2.0)),))  # fmt: skip
    made = Solution(
        problem=problem, status=Status.SOLVED, parameters={"TX": middle}, amount=middle, rho=problem.target,
        transform=problem.motion.transform([middle], thin.seed, AWAY.seed), pair=problem.target,
        pair_gap=79.95 - middle, pair_state="apart",
    )  # fmt: skip
    assert failed(verify(made)) == {"keep-out 'slab': clearance"}
    for scale in np.linspace(1.0, 2.0, count):
        at_one = replace(made, problem=problem.changed(keep_out=(KeepOut(slab, scale),)))
        assert verify(at_one).passed


def test_one_keep_out_of_several_is_enough_to_reject() -> None:
    posts = [KeepOut(POST, name=f"post {k}", clearance=c) for k, c in enumerate((0.0, 0.5, 1.0 + 1e-6, 0.9))]
    solution = left_at(0.0, *posts)
    judged = solution.with_certificate(verify(solution), {})
    assert failed(verify(solution)) == {"keep-out 'post 2': clearance"}
    assert judged.status is Status.NOT_VERIFIED
    assert judged.keep_out_gaps == pytest.approx({f"post {k}": 1.0 for k in range(4)})


def test_a_vertex_on_a_vertex_is_judged_along_all_its_lines() -> None:
    """Gradients (1, -0.9) along -x and (-1, 1) along y: scales changed along either slide the edges past each other."""
    one = box((-1, -3, 0), (1, -1, 1), seed=(0, 0, 0), name="one")
    two = box((-3, -1, 0.5), (-0.9, 1, 3), seed=(0, 0, 0), name="two")
    problem = Problem(one, two, target=(1.0, 1.0), motion=Translation("x") >> Translation("y"), goal="touch")
    x, y = 0.1, 0.0
    transform = problem.motion.transform([x, y], one.seed, two.seed)
    made = Solution(
        problem=problem, status=Status.SOLVED, parameters={"TX": x, "TY": y}, transform=transform,
        amount=float(np.hypot(x, y)), rho=np.ones(2), pair=np.ones(2), pair_gap=0.0, pair_state="touching",
        features=(Feature.from_label("E1E2(P1V3,V7; P2V2,V6)"),),
    )  # fmt: skip
    certificate = verify(made)
    assert certificate.passed, tell(certificate)
    away = replace(made, transform=problem.motion.transform([x + 1e-6, y], one.seed, two.seed))
    assert {"touching", "contact 1"} <= failed(verify(away))


@pytest.mark.parametrize(("rise", "aside"), [(1e-12, 1e-10), (1e-9, 1e-9), (3e-9, 3e-9)])
def test_ridges_parallel_but_for_the_last_digits_touch_whatever_their_cross_product_is(
    rise: float, aside: float
) -> None:
    """Their cross product leads across where they differ upwards as much as sideways, which no gap is seen along."""
    ridge = [[-1, 0, 1], [1, 0, 1], *([x, y, 3] for x in (-1, 1) for y in (-1, 1))]
    other = [[-0.3, 0, 0], [0.3, aside, rise], *([x, y, -2] for x in (-0.3, 0.3) for y in (-1, 1))]
    bodies = Body.convex(np.array(ridge, float)), Body.convex(np.array(other, float))
    solution = solve(Problem(*bodies, nominal="drawn", target=(1.0, 1.0), goal="touch", motion=Translation("z")))
    assert solution.status is Status.SOLVED, tell(verify(solution))
    assert abs(solution.parameters["TZ"] + 1.0) <= 1e-8
