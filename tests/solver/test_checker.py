"""The checker of proofs: true proofs pass, planted defects do not, and its bounds hold what is sampled."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from solids import polygon, prism
from strategies import generators, random_pair, random_union, runs

import fcdm_opt as fo
from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.drafting.draft import toml
from fcdm_opt.model.task import Task
from fcdm_opt.problem.evidence import Evidence, Reason
from fcdm_opt.proof import conditions
from fcdm_opt.proof.checker import check_evidence, filled_box
from fcdm_opt.proof.columns import Proof, prove
from fcdm_opt.proof.intervals import Interval, IntervalFunction
from fcdm_opt.proof.mean_value import Pieces, PosesOfPieces

PROBLEMS = Path(__file__).parents[2] / "problems"
BOX = ((0.2, 5.0), (0.2, 5.0))
PAPER = [(name, k) for name in ("example1", "example2") for k in range(4)]


def paper_case(name: str, k: int) -> fo.Problem:
    return fo.load_problems(PROBLEMS / f"{name}.toml")[k]


def proved(problem: fo.Problem, gap: float = 1e-4, most: int = 40_000) -> tuple[fo.Problem, Proof, float]:
    solution = fo.solve(problem)
    upper = solution.amount if solution.status.found else np.inf
    return solution.problem, prove(Task.of(solution.problem), upper, aims=[(gap, most)]), upper


def failed(problem: fo.Problem, evidence: Evidence, bound: float) -> set[str]:
    return {
        check.name.removeprefix("proof: ") for check in check_evidence(problem, evidence, bound) if not check.passed
    }


def changed(evidence: Evidence, **rows: Any) -> Evidence:
    """Evidence with some rows of some arrays replaced: name=(index, value)."""
    made = {}
    for name, (index, value) in rows.items():
        made[name] = np.array(getattr(evidence, name))
        made[name][index] = value
    return replace(evidence, **made)


# ------------------------------------------------------------------------------------------------------- true proofs


@pytest.mark.parametrize(("name", "k"), PAPER)
def test_the_proofs_of_the_papers_cases_pass(name, k):
    problem, proof, upper = proved(paper_case(name, k))
    assert proof.lower_bound >= (1.0 - 1e-4) * upper
    assert failed(problem, proof.evidence, proof.lower_bound) == set()


def random_motion(rng: np.random.Generator) -> fo.Motion:
    def step() -> fo.Motion:
        axis = "xyz"[rng.integers(3)] if rng.random() < 0.5 else tuple(rng.normal(size=3).tolist())
        line = (tuple(rng.normal(size=3).tolist()), tuple(rng.normal(size=3).tolist()))
        made = [
            fo.Translation(axis),
            fo.Translation(axis),
            fo.Rotation(axis),
            fo.Rotation(axis, centre="origin"),
            fo.Rotation(axis, centre=line[0]),
            fo.Screw("seeds", pitch=0.3),
            fo.Screw(line, pitch=-0.5),
        ]
        return made[rng.integers(len(made))]

    return step() if rng.random() < 0.3 else step() >> step()


def random_problem(rng: np.random.Generator, goal: str) -> fo.Problem | None:
    one, two = random_pair(rng, 1000)
    movable = (random_union(rng, 1000, 2) if rng.random() < 0.15 else one).body("one")
    static, motion = two.body("two"), random_motion(rng)
    asked: dict[str, Any] = {"motion": motion, "goal": goal, "box": BOX}
    if rng.random() < 0.3:
        name = motion.parameters[-1].name
        asked["limits"] = {name: (float(-rng.uniform(0.0, 0.2)), float(rng.uniform(0.0, 0.2)))}
    if goal in ("beyond", "at"):
        points = fo.decision_curve(movable, static, box=BOX).switching_points
        if not points:
            return None
        tolerance, letter = tuple(rng.uniform(0.002, 0.02, 2).tolist()), "ABCD"[rng.integers(4)]
        asked |= {"nominal": int(rng.integers(len(points))) + 1, "tolerance": tolerance, "requirement": letter}
        asked["path"] = "free" if rng.random() < 0.3 else "coherent"
    else:
        asked |= {"nominal": (1.0, 1.0), "target": tuple(rng.uniform(0.7, 1.3, 2).tolist())}
        asked["clearance"] = 50.0 * (goal == "clear" and rng.random() < 0.5)
    try:
        return fo.Problem(movable, static, **asked)
    except fo.InputError:
        return None


@runs(24)
@given(generators, st.sampled_from(["beyond", "at", "touch", "clear"]))
def test_the_proofs_of_random_problems_pass(rng, goal):
    problem = random_problem(rng, goal)
    if problem is None:
        return
    task = Task.of(problem)
    if task.meets(task.rest, 1e-9):
        return
    # a made-up upper bound: as far as motions are to be excluded
    proof = prove(task, float(rng.uniform(0.01, 0.1)) * task.size, aims=[(1e-2, 800)])
    assert failed(problem, proof.evidence, proof.lower_bound) == set()


def touching_prisms(**arguments: Any) -> fo.Problem:
    """The paper's first pair, to touch at other scales."""
    problem = paper_case("example1", 2)
    asked = {"nominal": (1.0, 1.0), "target": (0.8, 0.85), "goal": "touch", "motion": problem.motion} | arguments
    return fo.Problem(problem.movable, problem.static, **asked)


def test_a_motion_of_ones_own_is_checked_like_the_packages():
    def lifted_and_turned(q: Any) -> Any:
        T = casadi.SX.eye(4)
        T[0, 0] = T[1, 1] = casadi.cos(q[1])
        T[1, 0], T[0, 1], T[2, 3] = casadi.sin(q[1]), -casadi.sin(q[1]), q[0]
        return T

    problem, proof, _ = proved(touching_prisms())
    own = fo.OwnMotion(lifted_and_turned, [("TZ", "translation"), ("RZ", "rotation")])
    assert (proof.evidence.reasons == Reason.APART).any()
    assert failed(problem.changed(motion=own), proof.evidence, proof.lower_bound) == set()


def test_a_whole_turn_is_left_out_only_where_the_limits_hold_its_repetition():
    asked = {"motion": fo.Rotation("z", centre=(0.0, 3.0, 0.0)), "target": (0.5, 0.5)}
    free = touching_prisms(**asked)
    proof = prove(Task.of(free), np.inf, aims=[(1e-4, 2000)])
    outside = proof.evidence.reasons == Reason.OUTSIDE
    assert outside.any()
    assert failed(free, proof.evidence, proof.lower_bound) == set()
    # 4 radians are allowed one way round, and what would repeat them is not
    side = int(proof.evidence.faces[outside][0])
    limits = {"RZ": ((-0.3, 10.0), (-10.0, 0.3))[side]}
    assert failed(free.changed(limits=limits), proof.evidence, proof.lower_bound) == {"OUTSIDE"}


# ---------------------------------------------------------------------------------------------------- planted defects


@pytest.fixture(scope="module")
def known() -> tuple[fo.Problem, Proof, float]:
    """A proof whose cells all say that the tracked contact falls short."""
    return proved(paper_case("example1", 2))


def without(evidence: Evidence, row: int) -> Evidence:
    kept = np.arange(len(evidence.faces)) != row
    rows = np.repeat(kept, np.diff(evidence.first))
    return replace(
        evidence,
        **{name: getattr(evidence, name)[kept] for name in ("faces", "boxes", "stretches", "reasons")},
        first=np.concatenate([[0], np.cumsum(np.diff(evidence.first)[kept])]),
        witnesses=evidence.witnesses[rows],
    )


@pytest.mark.parametrize("row", [0, 7, -1])
def test_a_missing_cell_is_noticed(known, row):
    problem, proof, _ = known
    assert failed(problem, without(proof.evidence, row % len(proof.evidence.faces)), proof.lower_bound) == {"stretches"}


def test_a_missing_column_is_noticed(known):
    problem, proof, _ = known
    own = proof.evidence
    less = replace(own, **{name: getattr(own, name)[1:] for name in ("column_faces", "column_boxes", "fronts")})
    assert "directions" in failed(problem, less, proof.lower_bound)


def test_a_front_moved_outwards_is_noticed(known):
    problem, proof, _ = known
    own = proof.evidence
    assert failed(problem, changed(own, fronts=(3, own.fronts[3] * (1 + 1e-9))), proof.lower_bound) == {"stretches"}


def test_a_column_said_to_be_closed_is_noticed(known):
    problem, proof, _ = known
    assert "closed columns" in failed(problem, changed(proof.evidence, fronts=(3, np.inf)), proof.lower_bound)


def test_a_shifted_box_is_noticed(known):
    problem, proof, _ = known
    own = proof.evidence
    row = int(np.flatnonzero(own.boxes[:, 0, 0] > -1.0)[0])
    lower = np.nextafter(own.boxes[row, 0, 0], -1.0)
    assert failed(problem, changed(own, boxes=((row, 0, 0), lower)), proof.lower_bound) == {"stretches"}


@pytest.mark.parametrize("raised", [1e-6, 1e-9, np.inf])
def test_a_raised_bound_is_noticed(known, raised):
    problem, proof, _ = known
    assert failed(problem, proof.evidence, proof.lower_bound * (1.0 + raised)) == {"lower bound"}


@pytest.mark.parametrize("reason", [reason for reason in Reason if reason != Reason.SHORT])
def test_a_reason_that_does_not_hold_is_noticed(known, reason):
    problem, proof, _ = known
    assert failed(problem, changed(proof.evidence, reasons=(5, reason)), proof.lower_bound) == {reason.name}


def test_a_witness_that_does_not_hold_is_noticed(known):
    problem, proof, _ = known
    own = proof.evidence
    for value in (1.0 - own.witnesses[:, 0], *(np.full(len(own.witnesses), x) for x in (2.0, 3.0, 4.0, np.nan))):
        assert failed(problem, changed(own, witnesses=((slice(None), 0), value)), proof.lower_bound) == {"SHORT"}


def test_a_direction_that_does_not_separate_is_noticed():
    problem, proof, _ = proved(touching_prisms())
    own = proof.evidence
    row = own.first[np.flatnonzero(own.reasons == Reason.APART)[0]]
    turned = changed(own, witnesses=((row, 1), -own.witnesses[row, 1]))
    assert failed(problem, turned, proof.lower_bound) == {"APART"}


@pytest.mark.slow
@pytest.mark.parametrize("goal", ["beyond", "touch", "clear"])
def test_a_forged_proof_beyond_a_motion_that_does_is_noticed(goal):
    problem = paper_case("example1", 2)
    if goal != "beyond":
        problem = touching_prisms(goal=goal, target=(0.8, 0.85) if goal == "touch" else (1.6, 1.6))
    problem, proof, upper = proved(problem)
    assert failed(problem, proof.evidence, proof.lower_bound) == set()
    own, count = proof.evidence, 2 * len(problem.weights)
    boxes = np.stack([-np.ones((count, 1)), np.ones((count, 1))], axis=1)
    for row in range(0, len(own.faces), 1 + len(own.faces) // 5):  # one true reason for everything up to the motion
        rows = slice(own.first[row], own.first[row + 1])
        forged = Evidence(
            limits=own.limits,
            faces=np.arange(count),
            boxes=boxes,
            stretches=np.tile([0.0, 1.01 * upper], (count, 1)),
            reasons=np.full(count, own.reasons[row]),
            first=np.arange(count + 1) * (rows.stop - rows.start),
            witnesses=np.tile(own.witnesses[rows], (count, 1)),
            column_faces=np.arange(count),
            column_boxes=boxes,
            fronts=np.full(count, 1.01 * upper),
        )
        assert failed(problem, forged, 1.001 * upper) == {Reason(own.reasons[row]).name}


def test_a_lost_contact_closes_no_column_where_paths_are_free():
    rng = np.random.default_rng(11)
    for _ in range(60):
        problem = random_problem(rng, "beyond")
        if problem is None or problem.path == "free":
            continue
        proof = prove(Task.of(problem), 0.2 * problem.size, aims=[(1e-2, 400)])
        lost = np.isin(proof.evidence.reasons, [Reason.LOOSE, Reason.LEFT]).any()
        if lost and np.isinf(proof.evidence.fronts).any():
            break
    else:
        pytest.fail("no proof with a column that is closed")
    assert failed(problem, proof.evidence, proof.lower_bound) == set()
    assert "closed columns" in failed(problem.changed(path="free"), proof.evidence, proof.lower_bound)


def test_what_is_no_proof_of_this_problem_is_refused(known):
    problem, proof, _ = known
    one = fo.Problem(
        problem.movable, problem.static, nominal=3, tolerance=0.02, requirement="C", motion=fo.Screw(pitch=0.0)
    )
    assert failed(one, proof.evidence, 0.0) == {"proof well-formed"}
    assert failed(problem.changed(amount="displacement"), proof.evidence, 0.0) == {"proof well-formed"}
    for rows in ({"faces": (0, 4)}, {"boxes": (0, 2.0)}, {"stretches": (0, np.nan)}, {"first": (1, 7)}):
        assert failed(problem, changed(proof.evidence, **rows), 0.0) == {"proof well-formed"}


# --------------------------------------------------------------------------------------------------- proofs read again


def turned_and_shifted(degrees: float, axis: tuple[float, float, float], shift: tuple[float, float, float]) -> Any:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(np.radians(degrees) * np.array(axis) / np.linalg.norm(axis)).as_matrix()
    T[:3, 3] = shift
    return T


def key_in_socket(degrees: float, shift: tuple[float, float, float]) -> fo.Problem:
    """A hexagonal key of 4.9 across corners, turned and shifted in a socket of 5: it is to get clear of its walls."""
    inner, outer = polygon(6, 5.0), polygon(6, 8.0)
    walls = [prism(np.array([*inner[[k - 1, k]], *outer[[k, k - 1]]]), 0.0, 4.0) for k in range(6)]
    socket = fo.Body.from_parts(walls, seed=(0.0, 0.0, 2.0), name="socket")
    key = fo.Body.convex(prism(polygon(6, 4.9), 1.0, 6.0), name="key")
    motion = fo.Translation("x") >> fo.Translation("y") >> fo.Rotation("z")
    moved = key.moved(turned_and_shifted(degrees, (0.0, 0.0, 1.0), shift))
    return fo.Problem(moved, socket, target=(1.0, 1.0), goal="clear", motion=motion, length=10.0)


def moved_together(problem: fo.Problem, T: Any, **arguments: Any) -> fo.Problem:
    return fo.Problem(problem.movable.moved(T), problem.static.moved(T), **arguments)


ODD = turned_and_shifted(37.3, (1.0, -2.0, 0.7), (0.13, -0.29, 0.71))
TURNED = {
    "key at 3": lambda: key_in_socket(3.0, (0.05, 0.02, 0.5)),
    "key at 2.5": lambda: key_in_socket(2.5, (0.1, 0.0, 0.0)),
    "key shifted": lambda: key_in_socket(0.0, (0.3, 0.1, 0.0)),
    "touch": lambda: moved_together(
        paper_case("example1", 2), ODD, target=(0.8, 0.85), goal="touch", motion=fo.Translation("z") >> fo.Rotation("x")
    ),
    "clear": lambda: moved_together(
        paper_case("example2", 0), ODD, target=(2.4, 2.1), goal="clear", motion=fo.Translation("y") >> fo.Rotation("z")
    ),
    "beyond": lambda: moved_together(
        paper_case("example1", 2), ODD, nominal=3, tolerance=0.02, requirement="C",
        motion=fo.Translation("z") >> fo.Rotation("z"),
    ),
    "seat": lambda: moved_together(
        next(own for own in fo.load_problems(PROBLEMS / "lid.toml") if own.name.startswith("A flush")),
        ODD, target=(1.01, 1.01), goal="seat", motion=fo.Translation("z") >> fo.Rotation("x"),
    ),
}  # fmt: skip


@cache
def certified(case: str) -> fo.Solution:
    solution = fo.solve(TURNED[case](), certify=True)
    assert solution.evidence is not None
    return solution


def in_tables(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{toml(key)} = {in_tables(own)}" for key, own in value.items()) + " }"
    return f"[{', '.join(map(in_tables, value))}]" if isinstance(value, list) else toml(value)


def written_to_a_file(problem: fo.Problem, path: Path) -> fo.Problem:
    path.write_text("\n".join(f"{key} = {in_tables(value)}" for key, value in problem.to_dict().items()))
    return fo.load_problems(path)[0]


@pytest.mark.parametrize("case", TURNED)
def test_a_proof_of_moved_bodies_holds_when_it_is_read(case, tmp_path):
    """Their hulls are made anew then, and number their edges and faces in another order."""
    solution = certified(case)
    read = fo.Solution.from_dict(json.loads(json.dumps(solution.to_dict())))
    of_file = replace(read, problem=written_to_a_file(solution.problem, tmp_path / "problem.toml"))
    for own in (solution, read, of_file):
        assert fo.verify(own, proof=True).failed == ()


def test_proofs_that_name_edges_by_number_are_read():
    """Versions before named the edge that stays inside a part by its number in the hull, and left the rest 0."""
    solution = certified("key at 3")
    own, problem = solution.evidence, solution.problem
    witnesses, parts = np.array(own.witnesses), (problem.active[0].parts, problem.active[1].parts)
    rows = own.first[:-1][own.reasons == Reason.MEETS]
    rows = rows[witnesses[rows, 2] < 3]
    assert len(rows) > 100
    for i, j, body, origin, end, row in np.column_stack([witnesses[rows][:, [0, 1, 2, 3, -1]], rows]).astype(int):
        ends = parts[body - 1][(i, j)[body - 1]].edges[:, :2].tolist()
        witnesses[row, 3], witnesses[row, -1] = ends.index([origin, end - 1]), 0.0
    assert failed(problem, replace(own, witnesses=witnesses), solution.lower_bound) == set()
    for column, value in ((3, 1.0), (3, 1000.0), (3, 0.5), (-1, 1.0), (-1, 1000.0)):
        forged = changed(own, witnesses=((rows, column), own.witnesses[rows, column] + value))
        assert failed(problem, forged, solution.lower_bound) == {"MEETS"}


# ------------------------------------------------------------------------------------------------------------ bounds

FUNCTIONS = [
    lambda x, y: x * y - x / (y + 3.0),
    lambda x, y: casadi.sin(3.0 * x) * casadi.cos(x - 5.0 * y),
    lambda x, y: casadi.sqrt(x * x + 0.5) + casadi.exp(-y) ** 2,
    lambda x, y: casadi.atan2(x, y) + casadi.fmin(x, y),
    lambda x, y: casadi.if_else(casadi.logic_and(x > 0.1, y < 0.2), x**3, casadi.fabs(y)),
    lambda x, y: casadi.tanh(x) + casadi.asin(x / 3.0) + casadi.acos(y / 3.0) + casadi.log(y + 2.0),
    lambda x, y: casadi.tan(x / 3.0) + casadi.cosh(y) - casadi.floor(2.0 * x) + casadi.sign(y) * (y + 4.0) ** 1.5,
    lambda x, y: casadi.fmax(x, -y) ** -2 + casadi.if_else(casadi.logic_or(x < 0, y != 0), casadi.sinh(x), 1.0),
]


@runs(150)
@given(generators, st.sampled_from(FUNCTIONS))
def test_values_lie_within_intervals(rng, function):
    symbols = casadi.SX.sym("x"), casadi.SX.sym("y")
    exact = casadi.Function("f", symbols, [function(*symbols)])
    middle, radius = rng.uniform(-1.5, 1.5, (2, 20)), 10.0 ** rng.uniform(-17, 0, (2, 20))
    inputs = [[Interval(middle[k], radius[k])] for k in (0, 1)]
    with np.errstate(all="ignore"):
        ((found,),), _ = IntervalFunction(exact)(*inputs)
    low, high = np.broadcast_to(found.low, 20), np.broadcast_to(found.high, 20)
    for share in rng.uniform(-1.0, 1.0, (50, 2, 1)):
        values = np.ravel(exact(*[row[None] for row in middle + share * radius]).full())
        rounding = 1e-15 * np.maximum(np.abs(values), 1.0)
        known = np.isfinite(low) & np.isfinite(high) & np.isfinite(values)
        assert ((low - rounding <= values) & (values <= high + rounding))[known].all()


@runs(30)
@given(generators, st.sampled_from([F1V2, V1F2, E1E2]))
def test_bounds_over_cells_hold_what_is_sampled(rng, kind):
    """By transforms in plain floats, with `Free` among the motions."""
    motion = fo.Free() if rng.random() < 0.3 else random_motion(rng) >> fo.Rotation("y")
    problem = touching_prisms(motion=motion)
    k, n = len(problem.weights), 6
    centre = np.column_stack([rng.uniform(0.25, 0.5, n), rng.uniform(-0.8, 0.8, (n, k - 1))])
    half = 10.0 ** rng.uniform(-4, -0.7, (n, 1)) * np.ones(k)
    pieces = Pieces(np.arange(n), rng.integers(0, 2 * k, n), centre - half, centre + half)
    u, w, x, y = rng.normal(size=(4, 3))
    vectors = [Interval(float(value)) for value in np.concatenate([u, w, x, y])]
    with np.errstate(all="ignore"):
        (low,), (high,) = PosesOfPieces(problem).poses(pieces).bounds(conditions.separation(kind), vectors)
    for row in range(n):
        for share in rng.uniform(0.0, 1.0, (20, k)):
            s, *t = pieces.low[row] + share * (pieces.high[row] - pieces.low[row])
            v = np.insert(t, pieces.faces[row] >> 1, 1.0 - 2.0 * (pieces.faces[row] & 1))
            T = problem.motion.transform(s * v / problem.weights, problem.movable.seed, problem.static.seed)
            R = T[:3, :3]
            normal = {F1V2: R @ u, V1F2: u, E1E2: np.cross(R @ u, w)}[kind]
            moved = R @ problem.movable.seed + T[:3, 3]
            value = normal @ (problem.static.seed - moved + y - R @ x)
            assert not value < low[row, 0] - 1e-12
            assert not value > high[row, 0] + 1e-12
    small = half[:, 0] < 1e-2  # over larger cells of some motions nothing is known
    assert (high[small, 0] - low[small, 0] < 1e3 * half[small, 0]).all()


TIP = fo.Body.convex([(0, 0, 0), (1, 1, 2), (1, -1, 2), (-1, 1, 2), (-1, -1, 2)], seed=(0, 0, 1))
TABLE = fo.Body.convex(list(product((-3, 3), (-3, 3), (-1, 0))))


def raised(amount: Callable[[Any, Any], Any], goal: str) -> fo.Problem:
    """A tip stands 0.075 in a table."""
    x, z = casadi.SX.sym("TX"), casadi.SX.sym("TZ")
    motion = fo.Translation("x") >> fo.Translation("z")
    return fo.Problem(TIP, TABLE, motion=motion, goal=goal, tolerance=0.05, requirement="A", amount=amount(x, z))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("amount", "goal", "least"),
    [
        (lambda x, z: 100.0 * z**2 + x**2, "touch", 0.5625),
        (lambda x, z: casadi.fmax(casadi.fabs(z), 3.0 * casadi.fabs(x)), "clear", 0.075),
        (lambda x, z: casadi.sqrt(z**2 + x**2 + 0.01), "at", 0.125),
    ],
)
def test_bounds_of_own_amounts_are_shown_and_no_higher_ones(amount, goal, least):
    problem = raised(amount, goal)
    solution = fo.solve(problem, certify=True)
    evidence, bound = solution.evidence, solution.lower_bound
    assert solution.amount == pytest.approx(least, rel=1e-6)
    assert bound >= (1.0 - 1.1e-4) * least
    assert Reason.BEYOND in evidence.reasons
    assert failed(problem, evidence, bound) == set()
    assert failed(problem, evidence, 1.001 * bound) & {"COSTLY", "BEYOND"}
    rows = np.flatnonzero(~np.isin(evidence.reasons, [Reason.COSTLY, Reason.BEYOND]))
    assert "COSTLY" in failed(problem, changed(evidence, reasons=(rows[0], Reason.COSTLY)), bound)
    assert failed(raised(lambda x, z: 1e-3 * amount(x, z), goal), evidence, bound) & {"COSTLY", "BEYOND"}
    assert "BEYOND" in failed(problem.changed(amount="weighted"), evidence, bound)


def test_an_amount_that_falls_further_out_is_not_bounded_by_what_it_is_nearby():
    """At 1e6 it is a hundredth of what it is where the parts come apart."""
    z = casadi.SX.sym("TZ")
    asked = raised(lambda *_: z**2, "clear").changed(motion=fo.Translation("z"), amount=z**2 / (1.0 + 1e-9 * z**6))
    solution = fo.solve(asked, certify=True)
    assert (solution.evidence, solution.lower_bound) == (None, 0.0)
    within = fo.solve(asked.changed(limits={"TZ": (-1, 1)}), certify=True)
    assert within.lower_bound == pytest.approx(0.075**2, rel=2e-4)
    assert failed(within.problem, within.evidence, within.lower_bound) == set()


def test_boxes_fill_what_they_span_unless_one_is_moved_left_out_or_doubled():
    """Halved at random, with a parameter that is fixed: along it all boxes are one point."""
    rng, boxes = np.random.default_rng(2), [np.array([[-1.0, 0.0, 3.0], [2.0, 0.5, 3.0]])]
    for axis in rng.integers(0, 2, 30).tolist():
        low, high = boxes.pop(int(rng.integers(len(boxes))))
        middle = 0.5 * low[axis] + 0.5 * high[axis]
        one, two = np.array([low, high]), np.array([low, high])
        one[1, axis] = two[0, axis] = middle
        boxes += [one, two]
    made = np.array(boxes)
    ends, filled = filled_box(made)
    assert filled
    assert ends.tolist() == [[-1.0, 0.0, 3.0], [2.0, 0.5, 3.0]]
    moved = made.copy()
    moved[7, 1, 0] += 1e-9
    for wrong in (moved, np.delete(made, 7, axis=0), np.concatenate([made, made[7:8]])):
        assert not filled_box(wrong)[1]


@pytest.mark.parametrize(
    ("file", "case", "amount"),
    [
        ("lid", "B flush on the rim", 0.08),
        ("bracket", "A flush above the ribs", 0.12),
        ("bracket", "D flush beside the rib", math.hypot(15 * 0.99 - 14 + math.sqrt(0.5**2 - 0.44**2), 0.12)),
    ],
)
def test_flush_contacts_that_hold_a_turn_had_a_bound_without_evidence(file: str, case: str, amount: float) -> None:
    """What a flush contact does not hold is a parameter or two: cells of these are looked at."""
    problem = next(own for own in fo.load_problems(PROBLEMS / f"{file}.toml") if own.name == case)
    solution = fo.solve(problem)
    assert solution.lower_bound == pytest.approx(amount, rel=1e-6)
    assert fo.verify(solution, proof=True).passed
    kept = fo.solve(problem, certify=True)
    assert kept.evidence is not None
    assert amount * (1.0 - 1e-4) <= kept.lower_bound <= amount * (1.0 + 1e-9)
    assert fo.verify(kept, proof=True).passed
    assert "lower bound" in failed(kept.problem, kept.evidence, 1.001 * amount)
