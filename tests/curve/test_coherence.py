"""Faults of a claimed contact: each kind appears where it is planted, by its exact size, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from cases import CUBE, Shape, box_shape, exact, shape, union
from hypothesis import given
from hypothesis import strategies as st
from oracles import plane_point
from strategies import generators, random_pair, random_pose, random_union, runs

from fcdm_opt.curve.coherence import Fault, Tracked, contact_faults, overlaps_between
from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve, relative_pose
from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.curve.segments import Segment
from fcdm_opt.geometry.bodies import Body

SLACK = 1e-9
BOX = ((0.0731584, 9.7172613), (0.0643917, 11.3145927))
# tip at x = 1/2 of its body, before a plate with its face at x = 1 and its seed 1/4 behind: rho_1 / 2 + rho_2 / 4 = 5/4
TIP = shape([("0.5", 0, 0), ("-0.5", 0, 0), (0, "0.5", 0), (0, "-0.5", 0), (0, 0, "0.5"), (0, 0, "-0.5")], (0, 0, 0))
PLATE = box_shape((1, -2, -2), ("1.5", 2, 2))
CROSSING = box_shape((3, 3, -1), (5, 7, 1))  # with CUBE: rho_1 + rho_2 = 4 in x, rho_1 + 2 rho_2 = 5 in y


def at(one: Body, two: Body, site: tuple[int, int, int], sign: float = 1.0) -> Tracked:
    """A feature of the first parts of two bodies as drawn."""
    return Tracked.at(one, two, relative_pose(one, two, np.eye(4)), (0, 0), site, sign)


def faults(one: Body, two: Body, rho: object, *tracked: Tracked, slack: float = SLACK) -> list[Fault]:
    """Faults of features of the bodies as drawn."""
    return contact_faults(one, two, relative_pose(one, two, np.eye(4)), np.array(rho, dtype=float), tracked, slack)


def face(body: Body, normal: tuple[float, float, float], part: int = 0) -> int:
    return int(np.argmax(body.parts[part].normals @ normal))


def corner(body: Body, point: tuple[float, float, float], part: int = 0) -> int:
    (row,) = np.flatnonzero((body.parts[part].vertices == point).all(axis=1))
    return int(row)


def edge(body: Body, ends: set[tuple[float, float, float]]) -> int:
    part = body.parts[0]
    return next(k for k, row in enumerate(part.edges[:, :2]) if set(map(tuple, part.vertices[row].tolist())) == ends)


def tip_on_plate(row: tuple[float, float, float] = (0.5, 0, 0)) -> tuple[Body, Body, Tracked]:
    one, two = TIP.body(), PLATE.body()
    return one, two, at(one, two, (V1F2, corner(one, row), face(two, (-1, 0, 0))))


def crossing_faces() -> tuple[Body, Body, Tracked, Tracked]:
    one, two = CUBE.body(), CROSSING.body()
    near = corner(two, (3, 3, -1))
    along, across = (at(one, two, (F1V2, face(one, normal), near)) for normal in ((1, 0, 0), (0, 1, 0)))
    return one, two, along, across


# ------------------------------------------------------------------------------------------------------- real contacts


@pytest.mark.parametrize("rho", [(1.5, 2.0), (2.0, 1.0), (2.4, 0.2)])
def test_a_tip_on_a_plate_has_no_fault(rho):
    one, two, tracked = tip_on_plate()
    np.testing.assert_allclose(tracked.line, [0.5, 0.25, 1.25], atol=1e-15)
    np.testing.assert_allclose(tracked.normal, [1, 0, 0], atol=1e-15)
    assert faults(one, two, rho, tracked) == []


def test_two_faces_at_their_switching_point_have_no_fault():
    one, two, along, across = crossing_faces()
    assert faults(one, two, (3, 1), along, across) == []
    assert faults(one, two, (2, 2), along) == []
    assert faults(one, two, (4, 0.5), across) == []


def sited(curve: DecisionCurve, segment: Segment) -> Tracked:
    """The feature of a segment, oriented as the segment is."""
    return oriented(curve.movable, curve.static, curve.pose, segment.parts, segment)


def oriented(one: Body, two: Body, pose: np.ndarray, parts: tuple[int, int], segment: Segment) -> Tracked:
    made = [Tracked.at(one, two, pose, parts, segment.run.whole.site, sign) for sign in (1.0, -1.0)]
    return max(made, key=lambda tracked: float(tracked.normal @ segment.normal))


@runs(30)
@given(generators)
def test_segments_and_switching_points_of_random_hulls_have_no_fault_at_any_pose(rng):
    one, two = (own.body() for own in random_pair(rng, 1000))
    T = random_pose(rng, 500.0)
    curve = decision_curve(one, two, box=BOX, transform=T)
    for segment in curve.segments:
        rho = segment.start + rng.uniform(0.1, 0.9) * (segment.end - segment.start)
        assert contact_faults(one, two, curve.pose, rho, [sited(curve, segment)], 1e-9 * one.size) == []
    for point in curve.switching_points:
        both = [s for s in curve.segments if s.feature in point.features]
        assert contact_faults(one, two, curve.pose, point.rho, [sited(curve, s) for s in both], 1e-8 * one.size) == []


@runs(25)
@given(generators, st.sampled_from([(1, 2), (2, 1), (2, 2)]))
def test_segments_of_random_unions_have_no_fault(rng, counts):
    one, two = (random_union(rng, 1000, k).body() for k in counts)
    two = two.moved(np.block([[np.eye(3), rng.integers(-3000, 3000, (3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]))
    curve = decision_curve(one, two, box=BOX)
    for segment in curve.segments:
        rho = (segment.start + segment.end) / 2
        assert contact_faults(one, two, curve.pose, rho, [sited(curve, segment)], 1e-9 * one.size) == []


# --------------------------------------------------------------------------------------------------------------- apart


@pytest.mark.parametrize("rho_1", [3.25, 3.5, 3.75])
def test_a_line_followed_past_its_switching_point_is_apart_by_the_other_face(rho_1):
    """On rho_1 + rho_2 = 4 the gap in y is 5 - rho_1 - 2 rho_2 = rho_1 - 3."""
    one, two, along, _ = crossing_faces()
    (fault,) = faults(one, two, (rho_1, 4 - rho_1), along)
    assert fault.kind == "apart"
    assert fault.parts == (0, 0)
    assert fault.site[0] in (F1V2, V1F2)
    np.testing.assert_allclose(fault.normal, [0, 1, 0], atol=1e-15)
    assert fault.excess == pytest.approx(rho_1 - 3, rel=1e-12)


def test_lines_of_random_hulls_followed_too_far_are_apart_by_the_exact_gap():
    rng, met = np.random.default_rng(31), 0
    for _ in range(30):
        one, two = random_pair(rng, 1000, ("inside", "inside"))
        truth, curve = exact(one, two), decision_curve(one.body(), two.body(), box=BOX)
        for segment in curve.segments:
            rho = segment.end + rng.uniform(0.2, 0.8) * (segment.end - segment.start)
            gap = truth.gap(rho)
            if rho.min() <= 0 or gap < 1e-6:
                continue
            met += 1
            found = faults(curve.movable, curve.static, rho, sited(curve, segment), slack=1e-8)
            assert [fault.kind for fault in found] == ["apart"]
            assert found[0].excess == pytest.approx(gap, rel=1e-9, abs=1e-9)
    assert met > 30


# --------------------------------------------------------------------------------------------------------- overlapping

# the plate with a bump 1/10 high in front of the tip, or well beside it
BUMP = union(PLATE, box_shape(("0.9", "-0.1", "-0.1"), ("1.2", "0.1", "0.1")), seed=("1.25", 0, 0))
BESIDE = union(PLATE, box_shape(("0.9", "1.5", "1.5"), ("1.2", "1.7", "1.7")), seed=("1.25", 0, 0))


def on_plate_part(two: Shape) -> tuple[Body, Body, Tracked]:
    one, static = TIP.body(), two.body()
    plate = next(k for k, part in enumerate(static.parts) if part.vertices[:, 1].max() == 2)
    assert plate == 0
    return one, static, at(one, static, (V1F2, corner(one, (0.5, 0, 0)), face(static, (-1, 0, 0))))


def test_another_part_in_the_way_overlaps_by_its_depth():
    one, two, tracked = on_plate_part(BUMP)
    assert two.seed.tolist() == [1.25, 0, 0]
    (fault,) = faults(one, two, (2.0, 1.0), tracked)  # the tip reaches x = 1, the bump x = 0.9
    assert (fault.kind, fault.parts) == ("overlapping", (0, 1))
    truth = exact(TIP, BUMP).pairs[0, 1].gap((2, 1))
    assert truth < 0
    assert fault.excess == pytest.approx(-truth, rel=1e-12)


def test_another_part_beside_the_contact_is_no_fault():
    one, two, tracked = on_plate_part(BESIDE)
    assert exact(TIP, BESIDE).pairs[0, 1].side((2, 1)) > 0
    assert faults(one, two, (2.0, 1.0), tracked) == []


def test_the_own_part_pair_is_never_called_overlapping():
    """Its depth shows as vertices beyond the tracked plane, which says which ones."""
    one, two, tracked = tip_on_plate((-0.5, 0, 0))  # the far tip on the face: the near one is a length 2 inside
    assert {fault.kind for fault in faults(one, two, (2.0, 9.0), tracked)} == {"unsupported"}


def test_hidden_pieces_of_random_unions_overlap_by_the_exact_depth():
    """A piece of one pair's boundary that lies in another pair's overlap is no contact."""
    rng, hidden, free = np.random.default_rng(32), 0, 0
    for _ in range(16):
        one, two = random_union(rng, 1000, 2), random_union(rng, 1000, 2).shifted(rng.integers(-1500, 1500, 3).tolist())
        truth, bodies = exact(one, two), (one.body(), two.body())
        for (i, j), pair in truth.pairs.items():
            parts = bodies[0].parts[i], bodies[1].parts[j]
            alone = (Body.convex(part.vertices, seed=body.seed) for part, body in zip(parts, bodies, strict=True))
            own = decision_curve(*alone, box=BOX)
            for segment in own.segments[:2]:
                rho = (segment.start + segment.end) / 2
                assert abs(pair.gap(rho)) < 1e-8
                gaps = {key: other.gap(rho) for key, other in truth.pairs.items() if key != (i, j)}
                expected = {key: -gap for key, gap in gaps.items() if gap < -1e-6}
                found = faults(*bodies, rho, oriented(*bodies, own.pose, (i, j), segment), slack=1e-7)
                assert {fault.kind for fault in found} <= {"overlapping"}
                assert {fault.parts for fault in found} == set(expected)
                for fault in found:
                    assert fault.excess == pytest.approx(expected[fault.parts], rel=1e-9)
                hidden, free = hidden + bool(expected), free + (not expected)
    assert min(hidden, free) > 8


# --------------------------------------------------------------------------------------------------------- unsupported


def test_a_vertex_of_body_1_beyond_the_tracked_plane_is_unsupported():
    one, two, tracked = tip_on_plate((-0.5, 0, 0))
    rho = (2.0, 9.0)  # -rho_1 / 2 + rho_2 / 4 = 5/4: on the line of the wrong tip
    (fault,) = faults(one, two, rho, tracked)
    assert (fault.kind, fault.body, fault.vertex) == ("unsupported", 1, corner(one, (0.5, 0, 0)))
    assert fault.excess == pytest.approx(2.0, rel=1e-12)  # the two tips are 1 apart, doubled
    assert fault.site == tracked.site


def test_a_vertex_of_body_2_beyond_the_tracked_plane_is_unsupported():
    one, two = PLATE.body(), TIP.body()  # the plate moves, its face x = 1 looks at the tip from the right
    wrong = at(one, two, (F1V2, face(one, (-1, 0, 0)), corner(two, (-0.5, 0, 0))))
    rho = (9.0, 2.0)
    found = faults(one, two, rho, wrong)
    assert [(fault.kind, fault.body, fault.vertex) for fault in found] == [("unsupported", 2, corner(two, (0.5, 0, 0)))]
    assert found[0].excess == pytest.approx(2.0, rel=1e-12)


def test_edges_that_cross_inside_both_bodies_are_unsupported_on_both_sides():
    one = CUBE.body()
    two = CUBE.shifted((3, 0, 0)).body()
    i, j = edge(one, {(-1, -1, -1), (-1, 1, -1)}), edge(two, {(4, -1, -1), (4, -1, 1)})
    for sign in (1.0, -1.0):
        tracked = at(one, two, (E1E2, i, j), sign=sign)
        facing = float(tracked.normal[0])
        assert abs(facing) == pytest.approx(1)
        found = faults(one, two, (1.0, 1.0), tracked)
        kinds = [(fault.kind, fault.body) for fault in found]
        if facing > 0:  # x = -1 of body 1 against x = 4 of body 2, from the left: both bodies reach past
            assert kinds.count(("unsupported", 1)) == kinds.count(("unsupported", 2)) == 1
            assert [fault.excess for fault in found if fault.kind == "unsupported"] == pytest.approx([2.0, 2.0])
        else:  # from the right: nothing reaches past, but the bodies are apart by 1 along the other direction
            assert ("unsupported", 1) not in kinds
            assert ("apart", 0) in kinds


# ---------------------------------------------------------------------------------------------------- slack and order


@pytest.mark.parametrize("depth", [1e-3, 1e-6, 1e-9])
def test_faults_appear_just_above_the_slack_and_not_below(depth):
    one, two, along, _ = crossing_faces()
    rho = (3 + depth, 1 - depth)
    assert faults(one, two, rho, along, slack=1.001 * depth) == []
    assert [fault.kind for fault in faults(one, two, rho, along, slack=0.999 * depth)] == ["apart"]


def test_faults_come_worst_first_and_each_has_its_own_key():
    one, two, tracked = on_plate_part(BUMP)
    wrong = at(one, two, (V1F2, corner(one, (-0.5, 0, 0)), face(two, (-1, 0, 0))))
    found = faults(one, two, (2.0, 1.0), tracked, wrong)
    assert {fault.kind for fault in found} == {"overlapping", "unsupported"}
    assert [fault.excess for fault in found] == sorted((fault.excess for fault in found), reverse=True)
    keys = [fault.key for fault in found]
    assert len(set(keys)) == len(keys)
    again = faults(one, two, (2.001, 1.0), tracked, wrong)
    assert [fault.key for fault in again] == keys  # the same faults, of another size
    assert [fault.excess for fault in again] != [fault.excess for fault in found]


def test_a_scale_pair_that_is_not_a_number_is_a_fault():
    one, two, tracked = tip_on_plate()
    assert {fault.kind for fault in faults(one, two, (np.nan, 1.0), tracked)} == {"apart", "unsupported"}


def test_exact_corners_of_the_paper_s_lines_are_faultless_on_their_own_pieces_only():
    """Octahedron above a cube's edge: the exact end of each piece is where its feature gives way."""
    one, two = TIP, CUBE.shifted((3, "0.25", 0))
    truth = exact(one, two)
    curve = decision_curve(one.body(), two.body(), box=BOX)
    for piece in truth.pair.pieces:
        if piece.start[2] == 0 or piece.end[2] == 0:
            continue
        ends = np.array([[float(x) for x in plane_point(u)] for u in (piece.start, piece.end)])
        middle = ends.mean(axis=0)
        segment = curve.locate(middle)
        assert segment is not None
        tracked = sited(curve, segment)
        assert faults(curve.movable, curve.static, middle, tracked) == []
        beyond = ends[1] + 0.25 * (ends[1] - ends[0])
        if beyond.min() > 0:
            assert truth.gap(beyond) > 0
            assert [fault.kind for fault in faults(curve.movable, curve.static, beyond, tracked)] == ["apart"]


# ------------------------------------------------------------------------------------------------- along a whole shift


@pytest.mark.parametrize(("low", "high", "expected"), [(5, 6, 0.5), (1.5, 2, 0.125), (9.5, 11, 0.925), (20, 21, None)])
def test_what_a_shift_runs_into_on_its_way_is_found(low, high, expected):
    """A cube slides by 10 over a floor, through a post from `low` to `high` that it overlaps from low - 1 to high."""
    cube = box_shape((0, 0, 0), (1, 1, 1)).body("cube")
    floor = union(box_shape((-1, -1, -1), (30, 2, 0)), box_shape((low, 0, 0), (high, 1, 3)), seed=(0, 0, -0.5)).body(
        "floor"
    )
    slid = np.eye(4)
    slid[0, 3] = 10.0
    sizes = np.ones(2)
    ends = tuple((relative_pose(cube, floor, transform), sizes) for transform in (np.eye(4), slid))
    found = overlaps_between(cube, floor, ends, {(0, 0)}, SLACK)
    assert found == ([] if expected is None else [pytest.approx(expected, abs=1e-8)])
    slid[2, 3] = 1e-3
    lifted = ends[0], (relative_pose(cube, floor, slid), sizes)
    assert overlaps_between(cube, floor, lifted, {(0, 0)}, SLACK) is None
