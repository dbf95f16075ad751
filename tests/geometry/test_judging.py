"""The judge's kernels and shortcuts: equal to plain numpy, exact where it counts, and blind to no planted defect."""

from __future__ import annotations

import gc
import threading
import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from ordinary import box
from strategies import random_pair, random_pose

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.collision import ScaledPair, _Frame, _gaps, scaled_pair
from fcdm_opt.geometry.judging import FRAME, UNIT
from fcdm_opt.judge.certificate import verify
from fcdm_opt.judge.claimed_contact import Claim, carriers
from fcdm_opt.motion.motions import Translation
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.tolerances import DEFAULT

HERE = np.eye(4)


def scattered(rng: np.random.Generator, parts: int, reach: float) -> Body:
    """A union of small hulls about the origin."""
    return Body.from_parts(
        [rng.normal(size=(8, 3)) + rng.uniform(-reach, reach, 3) for _ in range(parts)], seed=[0, 0, 0]
    )


BLOCK = np.array([[k >> axis & 1 for axis in range(3)] for k in range(8)], dtype=float)
PLACES = ((np.zeros(3), np.array([5.0, 0.0, 0.0])), (np.array([0.0, 3.0, 1.0]), np.array([0.0, -3.0, 2.0])))


def widest_facet(one: Any, two: Any, frame: _Frame) -> float:
    """The largest gap along directions whose extreme points are a face, or an edge of either body."""
    gaps, n = _gaps(one, two, frame)
    first = (frame.offset + frame.scales[0] * one.points @ frame.R.T) @ n.T
    second = frame.scales[1] * two.points @ n.T
    ends = [(first.max(axis=0) - first <= 1e-12).sum(axis=0), (second - second.min(axis=0) <= 1e-12).sum(axis=0)]
    facets = (ends[0] > 2) | (ends[1] > 2) | ((ends[0] == 2) & (ends[1] == 2))
    return float(np.nanmax(gaps[facets]))


def part_pairs(scaled: ScaledPair) -> list[ScaledPair]:
    one, two = map(len, scaled._hulls)
    return [scaled.between(i, j) for i in range(one) for j in range(two)]


def asked(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    return rng.uniform(0.3, 2.0, (count, 2)), np.array([random_pose(rng, 12.0) for _ in range(count)])


# ------------------------------------------------------------------------------------------------------ whole bodies


@pytest.mark.sampled(4)
@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("turned", [True, False])
def test_the_least_separation_is_that_of_every_vertex_on_every_direction(number: int, turned: bool) -> None:
    """Edge pairs that make no facet may be left out: apart, what they show is no more than a wider gap."""
    rng = np.random.default_rng(number)
    scaled = ScaledPair(scattered(rng, 3, 6.0), scattered(rng, 4, 6.0))
    if not turned:  # all edges of one are parallel to edges of the other, all faces to faces
        scaled = ScaledPair(*(Body.from_parts([BLOCK * rng.uniform(0.5, 2, 3) + x for x in at]) for at in PLACES))
    pairs, poses = asked(rng, 12)
    if not turned:
        poses[:, :3, :3], poses[:, :3, 3] = np.eye(3), poses[:, :3, 3] / 3.0
    found = scaled.least_separations(pairs, poses)
    for rho, pose, least in zip(pairs, poses, found, strict=True):
        row = scaled._framed([rho], pose[None])[0]
        frame = _Frame.of(row)
        hulls = [(one, two) for one in scaled._hulls[0] for two in scaled._hulls[1]]
        plain = np.array([np.fmax.reduce(_gaps(*own, frame)[0]) for own in hulls]) * row[UNIT]
        facets = np.array([widest_facet(*own, frame) for own in hulls]) * row[UNIT]
        slack = 1e-13 * row[UNIT]
        each = np.array([own.least_separations([rho], pose[None])[0] for own in part_pairs(scaled)])
        assert np.allclose(np.minimum(each, 0.0), np.minimum(plain, 0.0), rtol=0, atol=slack)
        assert (each <= plain + slack).all()
        assert (each >= facets - slack).all()
        if turned or each.min() <= 0:
            assert abs(least - each.min()) <= slack
        else:  # a pair whose spheres are further apart than the least so far is passed over
            assert each.min() - slack <= least <= scaled.signed_distance(rho, pose) + slack


@pytest.mark.parametrize("tilt", [0.0, 1e-15, 1e-13, 1e-12, 1e-11, 1e-9, 1e-6, 1e-3])
def test_directions_left_out_as_normals_of_faces_are_no_more_than_roundings_off(tilt: float) -> None:
    """Of parts that stand upright nearly all pairs of edges make the normal of a face; a little tilted, another one."""
    rims = [np.array([(np.cos(t), np.sin(t)) for t in 2 * np.pi * np.arange(n) / n + 0.1]) for n in (7, 12)]
    ends = [np.vstack([np.column_stack([rim, np.full(len(rim), z)]) for z in (-1.0, 1.0)]) for rim in rims]
    scaled = ScaledPair(*(Body.convex(points, seed=[0, 0, 0]) for points in ends))
    pose = np.eye(4)
    pose[1:3, 1:3] = [[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]]
    for shift in ([0.3, 0.2, 1.7], [1.4, 0.3, 0.1], [0.2, -0.1, 2.0 + 1e-10], [0.2, -0.1, 2.0 - 1e-10]):
        pose[:3, 3] = shift
        row = scaled._framed([(1.0, 1.0)], pose[None])[0]
        gaps, _ = _gaps(scaled._hulls[0][0], scaled._hulls[1][0], _Frame.of(row))
        (found,) = scaled.least_separations([(1.0, 1.0)], pose[None])
        assert found == pytest.approx(np.nanmax(gaps) * row[UNIT], rel=0, abs=3 * DEFAULT.planarity)


@pytest.mark.parametrize("number", range(10))
def test_part_pairs_passed_over_are_not_the_nearest(number: int) -> None:
    """Spheres and faces leave out part pairs: the least distance stays the least of all."""
    rng = np.random.default_rng(100 + number)
    scaled = ScaledPair(scattered(rng, 4, 8.0), scattered(rng, 3, 8.0))
    pairs, poses = asked(rng, 12)
    found, bounds = scaled.signed_distances(pairs, poses), scaled.lower_bounds(pairs, poses)
    each = np.array(
        [[own.signed_distance(rho, pose) for own in part_pairs(scaled)] for rho, pose in zip(pairs, poses, strict=True)]
    )
    each = each.reshape(-1, 4, 3)
    assert np.array_equal(found, each.min(axis=(1, 2)))
    assert (bounds <= np.maximum(found, 0.0) + 1e-12).all()
    assert (bounds > 0).any()
    settled = np.zeros(each.shape, dtype=np.bool_)
    nearest = each.reshape(len(each), -1).argmin(axis=1)
    settled.reshape(len(each), -1)[np.arange(len(each)), nearest] = True
    rest = np.where(settled, np.inf, each).min(axis=(1, 2))
    assert np.array_equal(scaled.signed_distances(pairs, poses, settled=settled), rest)


def test_many_questions_at_once_are_answered_as_one_by_one() -> None:
    rng = np.random.default_rng(5)
    one, two = (shape.body() for shape in random_pair(rng, 50))
    scaled = ScaledPair(one, two)
    pairs, poses = asked(rng, 30)
    singly = [scaled.signed_distance(rho, pose) for rho, pose in zip(pairs, poses, strict=True)]
    assert np.array_equal(scaled.signed_distances(pairs, poses), singly)
    poses[20:25, :3, :3] = poses[19, :3, :3]  # at one rotation the same edges make facets
    singly = [scaled.least_separations([rho], pose[None])[0] for rho, pose in zip(pairs, poses, strict=True)]
    assert np.array_equal(scaled.least_separations(pairs, poses), singly)
    pairs[3, 0], pairs[7, 1], pairs[11, 0], poses[13, 0, 3], poses[17, 1, 1] = 0.0, -1.0, np.nan, np.inf, np.nan
    for found in (scaled.signed_distances(pairs, poses), scaled.least_separations(pairs, poses)):
        assert np.flatnonzero(np.isnan(found)).tolist() == [3, 7, 11, 13, 17]
    assert scaled._framed(pairs, poses).shape == (30, FRAME)


def test_hulls_are_kept_as_long_as_their_bodies_and_by_each_thread() -> None:
    one, two = (shape.body() for shape in random_pair(np.random.default_rng(6), 50))
    first, found = scaled_pair(one, two), []
    assert scaled_pair(one, two) is first
    assert scaled_pair(two, one) is not first
    thread = threading.Thread(target=lambda bodies: found.append(scaled_pair(*bodies)), args=[(one, two)])
    thread.start()
    thread.join()
    assert found[0] is not first
    kept = weakref.ref(first)
    del first, one, thread
    gc.collect()
    assert kept() is None


# ---------------------------------------------------------------------------------------------------- claimed contacts


def claim_of(label: str, one: Body, two: Body, transform: np.ndarray = HERE) -> Claim:
    return Claim(Feature.from_label(label), carriers(one, two), scaled_pair(one, two), np.ones(2), transform)


CUBE, SHIFTED = box((0, 0, 0), (1, 1, 1), "one"), box((1, 0.25, 0.5), (2, 1.25, 1.5), "two")
FACES = "F1F2(P1V2,V4,V6,V8; P2V1,V3,V5,V7)"


@pytest.mark.parametrize(
    ("shift", "error"),
    [
        ((0, 0, 0), 0.0),
        ((1e-6, 0, 0), 1e-6),  # into body 2
        ((-1e-6, 0, 0), 1e-6),  # away from it
        ((0, 1.25, 0), 0.0),  # the faces share an edge
        ((0, 1.25, 1.5), 0.0),  # a corner
        ((0, 1.5, 0), 0.25),  # nothing
        ((0, 1.25 + 3, 1.5 + 4), 5.0),
    ],
)
def test_faces_in_one_plane_touch_where_they_share_a_point(shift: Any, error: float) -> None:
    pose = np.eye(4)
    pose[:3, 3] = shift
    found = claim_of(FACES, CUBE, SHIFTED, pose).errors(np.ones((1, 2)), pose[None])[0]
    assert abs(found - error) <= 1e-12


def test_faces_that_cross_without_a_common_corner_touch() -> None:
    """A plus of two bars: no corner of either lies in the other."""
    one, two = box((-1, -3, -1), (0, 3, 1), "one"), box((0, -1, -3), (1, 1, 3), "two")
    assert claim_of(FACES, one, two).errors(np.ones((1, 2)), HERE[None])[0] <= 1e-15


def test_a_sharp_corner_is_as_far_away_as_it_is() -> None:
    """The lines of both sides pass near the vertex, the corner itself does not."""
    wedge = Body.convex([[0, 0, 0], [8, 0.5, 0], [8, -0.5, 0], [6, 0, -1]], seed=[5, 0, -0.25], name="wedge")
    tip = Body.convex([[-1, 0, 0], [-1, 0.1, 1], [-0.9, -0.1, 1], [-1.1, -0.1, 1]], seed=[-1, 0, 0.5], name="tip")
    claim = claim_of("F1V2(P1V1,V2,V3; P2V1)", wedge, tip)
    assert abs(claim.errors(np.ones((1, 2)), HERE[None])[0] - 1.0) <= 1e-12


def test_the_line_of_a_claim_is_where_its_error_vanishes() -> None:
    """Faces of boxes at any pose along y, z: a contact wherever 1.5 = rho_1 / 2 + rho_2 / 2 + shift."""
    rng = np.random.default_rng(9)
    claim = claim_of(FACES, CUBE, SHIFTED)
    for _ in range(5):
        pose = np.eye(4)
        pose[:3, 3] = rng.uniform(-0.1, 0.1, 3)
        a, b, c = claim.lines(pose[None])[0]
        assert np.allclose((a, b, c), (0.5, 0.5, 1.0 - pose[0, 3]), rtol=0, atol=1e-15)
        rho = np.array([1.0, (c - a) / b])
        assert claim.errors(rho[None], pose[None])[0] <= 1e-15
        assert abs(claim.errors(rho[None] + [[0, 1e-3]], pose[None])[0] - 0.5e-3) <= 1e-15


# ---------------------------------------------------------------------------------------------------- planted defects


TIP = Body.convex([[0, 0, 0], [1, 0, 2], [-1, 1, 2], [-1, -1, 2]], seed=[0, 0, 1], name="tip")
FLOOR = [[x, y, z] for x in (-9, 9) for y in (-9, 9) for z in (-2, 0)]


def slid(*blocks: Any) -> set[str]:
    """Slide a tip along a floor with blocks on it by 8; both ends are fine."""
    static = Body.from_parts([FLOOR, *blocks], seed=[0, 0, -1], name="static")
    problem = Problem(TIP, static, nominal=(1.0, 1.0), target=(1.0, 1.0), motion=Translation("x"), goal="at")
    made = Solution(
        problem=problem, status=Status.SOLVED, parameters={"TX": 8.0}, amount=8.0, rho=np.ones(2), pair=np.ones(2),
        transform=problem.motion.transform([8.0], TIP.seed, static.seed), pair_gap=0.0, pair_state="touching",
        features=problem.nominal_features,
    )  # fmt: skip
    return {check.name for check in verify(made).failed}


def test_another_part_in_the_way_is_seen_at_every_point_not_only_where_all_pairs_are_asked() -> None:
    """A pin as thin as the distance of two points, wherever it stands: it meets the tip's side, not its vertex."""
    assert slid() == set()
    count = DEFAULT.path_points - 1
    for k in range(4, count - 6):
        x = 8.0 * (k + 0.5) / count
        pin = [[x + dx, dy, dz] for dx in (-0.01, 0.01) for dy in (-0.01, 0.01) for dz in (-1, 0.02)]
        assert slid(pin) == {"path touching"}, k


def test_contact_lost_between_the_points_where_all_pairs_are_asked_is_seen() -> None:
    """The tip slides over a gap between two floors: its claim there is no contact, and coal tells so too."""
    floors = [[[x, y, z] for x in xs for y in (-9, 9) for z in (-2, 0)] for xs in ((-9, 3.9), (4.2, 13))]
    static = Body.from_parts(floors, seed=[0, 0, -1], name="static")
    problem = Problem(TIP, static, nominal=(1.0, 1.0), target=(1.0, 1.0), motion=Translation("x"), goal="at")
    made = Solution(
        problem=problem, status=Status.SOLVED, parameters={"TX": 8.0}, amount=8.0, rho=np.ones(2), pair=np.ones(2),
        transform=problem.motion.transform([8.0], TIP.seed, static.seed), pair_gap=0.0, pair_state="touching",
        features=problem.nominal_features,
    )  # fmt: skip
    assert {"path features", "path touching"} <= {check.name for check in verify(made).failed}


def test_other_parameters_than_the_motions_are_named_and_nothing_breaks() -> None:
    problem = Problem(TIP, Body.from_parts([FLOOR], seed=[0, 0, -1]), nominal=(1.0, 1.0), target=(1.0, 1.0),
                      motion=Translation("x"), goal="at")  # fmt: skip
    made = Solution(
        problem=problem, status=Status.SOLVED, parameters={"TX": 1.0}, amount=1.0, rho=np.ones(2), pair=np.ones(2),
        transform=problem.motion.transform([1.0], TIP.seed, problem.static.seed), pair_gap=0.0, pair_state="touching",
        features=problem.nominal_features,
    )  # fmt: skip
    assert verify(made).passed
    for parameters in ({"TY": 1.0}, {"TX": 1.0, "TY": 0.0}, {"RX": 1.0, "TX": 0.0}):
        assert "parameters" in {check.name for check in verify(replace(made, parameters=parameters)).failed}


@pytest.mark.parametrize("number", range(6))
def test_the_shortcut_for_keep_outs_that_are_far_gives_the_verdict_and_the_distance(number: int) -> None:
    """Against every scale looked at one by one, and the swept body."""
    rng = np.random.default_rng(200 + number)
    part, away = box((-1, -1, -1), (1, 1, 1), "part"), box((80, -1, -1), (90, 1, 1), "away")
    near = rng.normal(size=3)
    posts = [Body.convex(rng.normal(size=(8, 3)) + reach * near / np.linalg.norm(near), name=f"at {reach}")
             for reach in (2.0, 4.0, 8.0, 30.0)]  # fmt: skip
    clearance = rng.uniform(0, 3)
    keep_outs = tuple(KeepOut(post, (0.9, 1.2), clearance=clearance) for post in posts)
    problem = Problem(part, away, target=(1.1, 1.0), motion=Translation("x"), goal="clear", keep_out=keep_outs)
    made = Solution(
        problem=problem, status=Status.ALREADY_SATISFIED, parameters={"TX": 0.0}, amount=0.0, rho=problem.target,
        transform=HERE, pair=problem.target, pair_gap=78.9, pair_state="apart",
    )  # fmt: skip
    checks = {check.name: check for check in verify(made).checks}
    for post in posts:
        scales = np.linspace(0.9, 1.2, 61)
        least = scaled_pair(part, post).signed_distances(
            np.column_stack([np.full(61, 1.1), scales]), np.array([HERE] * 61)
        )
        check = checks[f"keep-out {post.name!r}: clearance"]
        assert check.passed == (check.value >= check.limit)
        if check.value > 0:
            assert check.value <= least.min() + 1e-12
            assert check.value >= least.min() - 0.01
        else:
            assert least.min() <= 1e-9 + abs(check.value)
