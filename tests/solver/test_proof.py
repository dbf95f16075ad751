"""Lower bounds by branch and bound: enclosures hold, excluded cells hold nothing, bounds meet closed forms."""

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.judge.certificate import proof_checks
from fcdm_opt.model.task import Task
from fcdm_opt.motion.instructions import interpreted
from fcdm_opt.problem.evidence import Evidence, Reason
from fcdm_opt.proof.columns import prove
from fcdm_opt.proof.enclosure import Enclosure
from fcdm_opt.proof.exclusion import Exclusion
from fcdm_opt.proof.mean_value import Pieces
from fcdm_opt.show.texts import bound_text
from fcdm_opt.tolerances import DEFAULT

T, R, S = fo.Translation, fo.Rotation, fo.Screw
LINE = ((0.3, -0.2, 0.5), (1.0, 2.0, -0.5))
MOTIONS = {
    "z": T("z"),
    "z, then about z": T("z") >> R("z"),
    "two turns": R("x") >> R("y", "origin"),
    "about a point": T((1.0, 2.0, 0.0)) >> R((0.0, 1.0, 1.0), (0.4, 0.1, -0.3)),
    "screw of the seeds": S(),
    "shifted screw of the seeds": T("x") >> S(pitch=0.3),
    "screw about a line": S(LINE, pitch=-0.2) >> T("y"),
    "three": R("z") >> T("x") >> T("y"),
    "free": fo.Free(),
}
CUBE = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def hull(rng, count=12):
    points = rng.normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * rng.uniform(0.8, 1.2, (count, 1))


def pair(rng, away=(1.6, 2.3)):
    way = rng.normal(size=3)
    way *= rng.uniform(*away) / np.linalg.norm(way)
    return fo.Body.convex(hull(rng), name="one"), fo.Body.convex(hull(rng) + way, name="two")


def random_cells(rng, k, count, size):
    faces = rng.integers(0, 2 * k, count)
    middle, half = rng.uniform(-1, 1, (count, k - 1)), size * rng.uniform(0, 1, (count, k - 1))
    start = rng.uniform(0.0, 1.0, count)
    end = start + size * rng.uniform(0, 1, count)
    return Pieces.of(faces, np.stack([middle - half, middle + half], axis=1), np.column_stack([start, end]))


def inside(rng, cells):
    """Weighted coordinates of a random motion of each cell."""
    s = rng.uniform(cells.low[:, 0], cells.high[:, 0])
    v = rng.uniform(cells.low[:, 1:], cells.high[:, 1:])
    return np.array([s[n] * np.insert(v[n], face >> 1, 1.0 - 2.0 * (face & 1)) for n, face in enumerate(cells.faces)])


@pytest.mark.parametrize("size", [1e-6, 1e-2, 0.3, 2.0])
@pytest.mark.parametrize("name", MOTIONS)
def test_the_pose_of_every_motion_of_a_cell_is_enclosed(name, size):
    rng = np.random.default_rng(len(name))
    one, two = pair(rng)
    motion = MOTIONS[name]
    task = Task.of(fo.Problem(one, two, target=(1.1, 0.9), motion=motion, goal="touch"))
    scene, cells = Exclusion(task), random_cells(rng, len(motion.parameters), 40, size)
    T_ = scene.poses(cells)
    for _ in range(5):
        y = inside(rng, cells)
        for n in range(len(y)):
            pose = task.pose(y[n] / task.weights)
            radius = np.abs(T_[n, :, 1:]).sum(axis=1)
            with np.errstate(invalid="ignore"):
                assert not (np.abs(pose - T_[n, :, 0]) > radius + 1e-14).any()


def test_errors_of_enclosures_fall_with_the_square_of_the_size():
    rng = np.random.default_rng(5)
    one, two = pair(rng)
    for motion in (MOTIONS["screw of the seeds"], MOTIONS["free"], MOTIONS["screw about a line"]):
        scene = Exclusion(Task.of(fo.Problem(one, two, target=(1.0, 1.0), motion=motion, goal="touch")))
        cells, k = random_cells(rng, len(motion.parameters), 20, 1e-2), len(motion.parameters)
        centre = cells.centre
        finer = Pieces(cells.rows, cells.faces, centre + (cells.low - centre) / 10, centre + (cells.high - centre) / 10)
        coarse, fine = (scene.poses(own)[:, :, k + 1].max(axis=1) for own in (cells, finer))
        assert (fine <= coarse / 90).all()


def test_functions_of_enclosures_hold():
    rng = np.random.default_rng(0)
    centre, half = rng.uniform(0.3, 4.0, 200), 10.0 ** rng.uniform(-8, 0, 200)
    x = Enclosure.variable(centre, np.minimum(half, centre / 2), 0, 1)
    made = {
        math.sin: x.sin(),
        math.cos: x.cos(),
        math.sqrt: x.sqrt(),
        lambda v: 1.0 / v: x.reciprocal(),
        lambda v: math.sin(math.sqrt(v)) / math.sqrt(v): x.sinc(),
        lambda v: (1 - math.cos(math.sqrt(v))) / v: x.versine(),
        lambda v: (2.0 - v) * v / (v + 1.0): (2.0 - x) * x / (x + 1.0),
    }
    for function, result in made.items():
        for t in (-1.0, -0.4, 0.3, 1.0):
            value = np.array([function(v) for v in centre + t * np.minimum(half, centre / 2)])
            linear = result.data[:, 0] + t * result.data[:, 1]
            assert (np.abs(value - linear) <= result.data[:, 2] + 1e-15).all()
            assert (result.low <= value + 1e-15).all()
            assert (result.high >= value - 1e-15).all()


def test_a_root_and_a_quotient_that_may_meet_zero_say_nothing():
    x = Enclosure.variable(np.array([0.1]), np.array([0.2]), 0, 1)
    assert x.sqrt().high == np.inf
    assert x.reciprocal().high == np.inf


def test_a_casadi_function_is_enclosed_as_it_is_evaluated():
    import casadi

    q = casadi.SX.sym("q", 2)
    function = casadi.Function("f", [q], [casadi.sqrt(1 + q[0] ** 2) * casadi.sin(q[1]) / (2 + casadi.cos(q[0]))])
    rng = np.random.default_rng(3)
    cells = random_cells(rng, 2, 50, 0.2)
    (value,) = interpreted(function, cells.enclosed)
    for _ in range(10):
        exact = np.array([float(function(y)) for y in inside(rng, cells)])
        assert (value.low <= exact).all()
        assert (exact <= value.high).all()


@pytest.mark.sampled(5)
@pytest.mark.parametrize("goal", ["touch", "clear", "beyond", "at"])
@pytest.mark.parametrize("seed", range(3))
def test_no_motion_of_an_excluded_cell_does(goal, seed):
    """Every reason is confirmed, motion by motion, by what the solver accepts motions by."""
    rng = np.random.default_rng(100 + seed)
    one, two = pair(rng, (1.5, 1.8) if goal == "clear" else (1.6, 2.3))
    motion = [T("x") >> R("z"), R("x") >> R("y"), S()][seed]
    arguments = {"target": (1.0, 1.0), "goal": goal}
    if goal in ("beyond", "at"):
        box = ((0.1, 9), (0.1, 9))
        points = fo.decision_curve(one, two, box=box).switching_points
        arguments = {
            "nominal": (len(points) + 1) // 2,
            "tolerance": 0.02,
            "requirement": "ABCD"[seed],
            "box": box,
            "goal": goal,
        }
    if goal == "clear":
        arguments |= {"clearance": 0.2, "limits": {motion.parameters[0].name: (-0.3, 0.4)}}
    task = Task.of(fo.Problem(one, two, motion=motion, **arguments))
    evidence = prove(task, 1.5, aims=[(1e-3, 4000)]).evidence
    assert len(evidence.reasons) > 20
    cells = Pieces.of(evidence.faces, evidence.boxes, evidence.stretches)
    for reason, y in zip(evidence.reasons, inside(rng, cells), strict=True):
        q = y / task.weights
        if reason in (Reason.OUTSIDE, Reason.SHORT, Reason.APART, Reason.MEETS, Reason.NEAR):
            assert not (task.allows(q) and task.meets(q, 0.0, path=False))
        else:
            assert task.path_faults(q, first=True)


def on_slab(**arguments):
    """A cube of side 2 at a height over a slab, as a problem of reaching the slab."""
    cube = fo.Body.convex(CUBE + np.array([0, 0, 3.0]), seed="box", name="cube")
    slab = fo.Body.convex(CUBE * [9, 9, 1], seed="box", name="slab")
    return fo.Problem(cube, slab, target=(1.0, 1.0), goal="touch", **arguments)


@pytest.mark.parametrize(
    ("motion", "amount"),
    [
        (T("z"), 1.0),
        (T("z") >> T("x"), 1.0),
        (T((0.0, 3.0, 4.0)) >> T("x"), 1.25),
        (T("z") >> R("z"), 1.0),
        (S(((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), pitch=0.5), 2.0 * math.hypot(0.5, math.sqrt(3.0))),
    ],
)
def test_closed_forms_over_a_slab(motion, amount):
    solution = fo.solve(on_slab(motion=motion), certify=True)
    assert solution.usable
    assert solution.amount == pytest.approx(amount, rel=1e-9)
    assert amount * (1 - 1.001e-4) <= solution.lower_bound <= amount * (1 + 1e-12)


def test_a_lever_reaches_the_slab_by_the_arc_of_its_corner():
    """Turned about an edge line at a distance, the corner comes down on a circle: h = r sin(angle)."""
    arm = fo.Body.convex(CUBE * [4.0, 0.5, 0.01] + [4.0, 0.0, 3.0], seed="box", name="arm")
    slab = fo.Body.convex(CUBE * [20.0, 9.0, 1.0], seed="box", name="slab")
    hinge = R("y", (0.0, 0.0, 2.99))
    problem = fo.Problem(arm, slab, target=(1.0, 1.0), goal="touch", motion=hinge, length=1.0)
    solution = fo.solve(problem, certify=True)
    assert solution.amount == pytest.approx(math.asin(1.99 / 8.0), rel=1e-9)
    assert solution.gap <= 1.001e-4


def test_nothing_reaches_is_proved():
    """A turn about its own centre takes no ball-like body to a slab further away than its reach."""
    rng = np.random.default_rng(4)
    ball = fo.Body.convex(hull(rng, 30) / 2 + [0, 0, 4.0], seed=(0, 0, 4.0), name="ball")
    slab = fo.Body.convex(CUBE * [9, 9, 1], seed="box", name="slab")
    for motion in (R("x") >> R("y"), R("x")):
        solution = fo.solve(fo.Problem(ball, slab, target=(1.0, 1.0), goal="touch", motion=motion), certify=True)
        assert solution.status.name == "INFEASIBLE"
        assert solution.lower_bound == math.inf


@pytest.mark.sampled(4)
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 5, 6, 7, 9])
def test_branch_and_bound_alone_finds_the_same_least_motion(seed):
    rng = np.random.default_rng(seed)
    one, two = pair(rng)
    motion = [T("x") >> R("z"), T("y") >> T("z"), S(), R("z", "origin") >> T("x"), T("x")][seed % 5]
    problem = fo.Problem(one, two, target=(1.0, 1.0), goal=("touch", "clear")[seed % 2], motion=motion)
    ours, alone = fo.solve(problem), fo.solve(problem, model="branch and bound")
    assert ours.status.found == alone.status.found
    if ours.status.found:
        assert alone.amount == pytest.approx(ours.amount, rel=1e-7, abs=1e-12)
        assert alone.usable


@pytest.mark.parametrize("amount", ["displacement", "own"])
def test_other_amounts_are_bounded_too(amount):
    import casadi

    rng = np.random.default_rng(12)
    one, two = pair(rng, (1.5, 1.6))
    motion = T("x") >> R("z")
    own = casadi.SX.sym("TX") ** 2 + 0.3 * casadi.SX.sym("RZ") ** 2
    problem = fo.Problem(
        one, two, target=(1.0, 1.0), goal="clear", motion=motion, amount=own if amount == "own" else amount
    )
    solution = fo.solve(problem, certify=True)
    assert solution.usable
    assert 0 <= solution.gap <= 1.001e-4


def test_paper_examples_are_certified():
    for name in ("example1", "example2"):
        for problem in fo.load_problems(f"problems/{name}.toml"):
            solution = fo.solve(problem, certify=True)
            assert solution.usable
            assert solution.gap <= 1.0001e-4
            checks = fo.verify(solution, proof=True).checks
            assert all(check.passed for check in checks)
            assert {"proof: directions", "proof: stretches", "proof: lower bound"} <= {check.name for check in checks}


def test_evidence_survives_plain_data():
    problem = fo.load_problems("problems/example2.toml")[0]
    evidence = fo.solve(problem, certify=True).evidence
    again = Evidence.from_dict(evidence.to_dict())
    for name in ("faces", "boxes", "stretches", "reasons", "first", "witnesses", "fronts", "column_boxes", "limits"):
        assert np.array_equal(getattr(evidence, name), getattr(again, name))
    with pytest.raises(fo.InputError):
        Evidence.from_dict({"faces": 1})


def test_excluded_cells_fill_what_lies_before_the_fronts():
    task = Task.of(fo.load_problems("problems/example2.toml")[0])
    proof = prove(task, 0.045, aims=[(1e-3, 20_000)])
    e = proof.evidence
    for face, box, front in zip(e.column_faces, e.column_boxes, e.fronts, strict=True):
        over = (e.faces == face) & (e.boxes[:, 0] <= box[0]).all(axis=1) & (e.boxes[:, 1] >= box[1]).all(axis=1)
        reached = 0.0
        for start, end in sorted(e.stretches[over].tolist()):
            assert start <= reached
            reached = max(reached, end)
        assert reached >= front or np.isinf(front)
    assert DEFAULT.path_points == 33


def test_a_turn_beyond_half_a_revolution_counts_where_limits_leave_no_smaller_one():
    rod = fo.Body.convex(CUBE * [0.5, 0.1, 0.1] + np.array([1.5, 0.0, 0.0]), seed="box", name="rod")
    post = fo.Body.convex(CUBE * [0.2, 0.5, 0.1] + np.array([0.0, -1.5, 0.0]), seed="box", name="post")
    turn = R("z", "origin")
    problem = fo.Problem(rod, post, target=(1.0, 1.0), goal="touch", motion=turn, limits={"RZ": (-0.3, 10.0)})
    solution = fo.solve(problem, certify=True)
    assert solution.parameters["RZ"] == pytest.approx(1.5 * math.pi - math.asin(0.2 / 2) - 0.1, abs=0.3)
    assert prove(Task.of(problem), math.inf, aims=[(1e-4, 5000)]).lower_bound <= solution.amount


@pytest.mark.parametrize("offset", [0.0, 50.0])
def test_a_motion_of_ones_own_is_certified_like_the_same_of_ours(offset):
    import casadi

    def turned_and_lifted(q):
        c, s = casadi.cos(q[1]), casadi.sin(q[1])
        T = casadi.SX.eye(4)
        T[0, 0], T[0, 1], T[1, 0], T[1, 1], T[2, 3] = c, -s, s, c, q[0]
        return T

    rng = np.random.default_rng(2)
    way = np.array([offset, 0.0, 0.0])
    one = fo.Body.convex(hull(rng) + way + np.array([2.0, 0, 0]), name="one")
    two = fo.Body.convex(hull(rng) + way + np.array([2.2, 1.7, 0.0]), name="two")
    own = fo.OwnMotion(turned_and_lifted, [("TZ", "translation"), ("RZ", "rotation")])
    found = [
        fo.solve(fo.Problem(one, two, target=(1.05, 1.0), goal="clear", motion=motion, length=1.0), certify=True)
        for motion in (own, T("z") >> R("z", "origin"))
    ]
    assert all(solution.usable and solution.gap <= 1.001e-4 for solution in found)
    assert found[0].amount == pytest.approx(found[1].amount, rel=1e-6)


def test_a_displacement_that_is_a_weighted_amount_in_other_words_is_certified_without_evidence():
    solution = fo.solve(on_slab(motion=T("x") >> T("z"), amount="displacement"), certify=True)
    assert solution.gap <= 1.001e-4
    assert solution.evidence is None
    assert fo.verify(solution, proof=True).passed


@pytest.mark.parametrize("seconds", [None, 60.0])
@pytest.mark.parametrize("motion", [T("z"), T("x") >> T("z"), T((0.1, 0.2, 0.9))])
def test_a_closed_form_with_evidence_was_told_as_less_than_exact(motion: Any, seconds: float | None) -> None:
    """Evidence ended a ten thousandth short of what was known, and the bound with it; in a report, with a time, too."""
    solution = fo.solve(on_slab(motion=motion), certify=True, seconds=seconds)
    assert solution.evidence is not None
    assert 0.0 <= solution.gap <= 1e-9
    assert bound_text(solution).endswith("exact")
    assert fo.verify(solution, proof=True).passed
    assert not fo.verify(replace(solution, lower_bound=solution.amount * (1.0 + 1e-6)), proof=True).passed


def _block(centre: float) -> fo.Box:
    return fo.Box((10, 10, 10), centre=(centre, 0, 0))


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("goal", "start", "motion", "limits"),
    [
        ("touch", -10, fo.Translation("x"), {"TX": (-3, 3)}),  # 10 apart
        ("touch", -10, fo.Translation("z"), {}),  # it passes by
        ("touch", -10, fo.Translation("x") >> fo.Translation("z"), {"TX": (-3, 3), "TZ": (-1, 1)}),
        ("clear", 1, fo.Translation("x"), {"TX": (-0.5, 0.5)}),  # 1 deep
        ("clear", 1, fo.Translation("x") >> fo.Rotation("z"), {"TX": (-0.5, 0.5), "RZ": (-0.01, 0.01)}),
    ],
)
def test_what_is_impossible_carries_evidence_that_is_checked(
    goal: str, start: float, motion: fo.Motion, limits: dict[str, tuple[float, float]]
) -> None:
    """Blocks of 10 at 10 and elsewhere: shifts alone left "impossible (proved)" without evidence."""
    problem = fo.Problem(_block(start), _block(10), target=(1, 1), goal=goal, motion=motion, limits=limits)
    denied = fo.solve(problem, certify=True)
    assert denied.status is fo.Status.INFEASIBLE
    assert fo.verify(denied, proof=True).passed
    assert not fo.verify(denied).passed  # of a motion, which there is none of
    wider = dict.fromkeys(motion.names, (-20.0, 20.0))
    possible = problem.changed(movable=_block(0 if goal == "touch" else 1), limits=wider)
    assert not fo.verify(replace(denied, problem=possible), proof=True).passed


def boxes(rng: np.random.Generator, count: int, low: tuple[float, ...], high: tuple[float, ...]) -> Any:
    """Boxes that overlap one, with whole ends, (count, 2, 3)."""
    corners = rng.integers(-3, 3, (count - 1, 3))
    others = [(np.minimum(own, 0), np.maximum(own + rng.integers(2, 7, 3), 1)) for own in corners]
    return np.array([(low, high), *others], float)


@pytest.mark.parametrize("seed", range(4))
def test_the_judge_could_not_follow_what_keeps_unions_of_boxes_apart(seed: int) -> None:
    """Least is a shift at a corner of what each two boxes forbid: all of these are looked at for the truth."""
    rng = np.random.default_rng(seed)
    one, two = boxes(rng, 3, (-1, -1, -1), (2, 2, 2)), boxes(rng, 5, (-2, -1, -2), (3, 2, 1))
    bodies = (fo.Body.from_parts([[*itertools.product(*own.T)] for own in all_of], seed="box") for all_of in (one, two))
    motion = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
    solution = fo.solve(fo.Problem(*bodies, motion=motion, target=(1, 1), goal="clear"), certify=True)

    low, high = (np.array([b[k] - a[1 - k] for a in one for b in two]) for k in (0, 1))
    ends = [np.unique([0.0, *low[:, k], *high[:, k]]) for k in range(3)]
    free = [q for q in itertools.product(*ends) if not ((q > low) & (q < high)).all(axis=1).any()]
    truth = min(math.hypot(*q) for q in free)
    assert solution.amount == pytest.approx(truth, rel=1e-9)
    certificate = fo.verify(solution, proof=True)
    assert certificate.passed, certificate
    for bound in (1.001 * truth, math.inf):
        (shown,) = proof_checks(replace(solution, lower_bound=bound, evidence=None))[:1]
        assert not shown.passed
