"""Decision curves against exact arithmetic, closed forms, published facts and invariances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cases import CUBE, DEFAULT_BOX, EXAMPLE_1, EXAMPLE_2, ONE_LINE, Shape, box_shape, exact, shape, union
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import Box, ExactCurve, plane_point, primitive
from strategies import SEEDS, generators, random_pair, random_pose, random_shape, random_union, reaches

from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element

# no curve of small integers meets the border of this box in a special way
ODD_BOX: Box = ((0.0731584, 9.7172613), (0.0643917, 11.3145927))
SEED_PAIRS = [(p, q) for p in SEEDS for q in SEEDS]
INSIDE = ("inside", "inside")


def curve_of(one: Shape, two: Shape, box: Box = ODD_BOX, pose: np.ndarray | None = None) -> DecisionCurve:
    return decision_curve(one.body("one"), two.body("two"), box=box, transform=pose)


def turned_to(ends: Sequence[Sequence[Any]], expected: Sequence[Sequence[Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Both pairs of ends as floats, the first in the order that fits the second better."""
    found, wanted = (np.array([[float(x) for x in end] for end in pair]) for pair in (ends, expected))
    return (found if np.abs(found - wanted).sum() <= np.abs(found[::-1] - wanted).sum() else found[::-1]), wanted


def check_lines(curve: DecisionCurve) -> None:
    """Every line is (h_1(n), h_2(-n), n.d) of a unit normal, and the segment's ends lie on it."""
    seed = curve.transform[:3, :3] @ curve.movable.seed + curve.transform[:3, 3]
    for segment in curve.segments:
        i, j = segment.parts
        X = curve.movable.parts[i].vertices @ curve.transform[:3, :3].T + curve.transform[:3, 3] - seed
        Y = curve.static.parts[j].vertices - curve.static.seed
        n, d = segment.normal, curve.static.seed - seed
        size = max(np.abs(X).max(), np.abs(Y).max(), np.abs(d).max())
        assert np.linalg.norm(n) == pytest.approx(1, abs=1e-13)
        np.testing.assert_allclose(segment.line, [(X @ n).max(), (-Y @ n).max(), n @ d], atol=1e-12 * size)
        for end in (segment.start, segment.end):
            assert segment.line[:2] @ end == pytest.approx(
                segment.line[2], abs=1e-12 * size * max(1, np.abs(end).max())
            )


def check_convex(one: Shape, two: Shape, box: Box = ODD_BOX, pose: np.ndarray | None = None) -> int:
    """A convex pair's curve equals the exact one; returns the number of its segments."""
    truth, curve = exact(one, two, pose), curve_of(one, two, box, pose)
    expected = [piece for _, piece in truth.pieces(box)]
    assert curve.status == truth.status(box)
    found = {segment.feature: segment for segment in curve.segments}
    assert set(found) == {Feature.from_label(piece.label) for piece in expected}
    assert len(curve.segments) == len(expected)
    for piece in expected:
        segment = found[Feature.from_label(piece.label)]
        ends = [plane_point(piece.start), plane_point(piece.end)]
        np.testing.assert_allclose(*turned_to([segment.start, segment.end], ends), rtol=1e-10, atol=1e-10)
        lines = [np.array([float(x) for x in facet.line]) for facet in piece.facets]
        scaled = [line / np.hypot(*line[:2]) for line in lines]
        np.testing.assert_allclose(segment.line / np.hypot(*segment.line[:2]), scaled[0], rtol=1e-12, atol=1e-12)
        if len(lines) == 1:
            unit = truth.pair.unit * math.sqrt(sum(x * x for x in piece.facets[0].normal))
            size = np.abs(lines[0]).max() / unit
            np.testing.assert_allclose(segment.line, lines[0] / unit, atol=1e-12 * max(1, size))
        assert not segment.snug
        assert segment.parts == (0, 0)
    check_lines(curve)
    corners = truth.pair.corners(box)
    assert len(curve.switching_points) == len(corners)
    assert [point.index for point in curve.switching_points] == list(range(1, len(corners) + 1))
    for rho, label in corners:
        near = min(curve.switching_points, key=lambda point: np.abs(point.rho - np.array(rho, dtype=float)).max())
        np.testing.assert_allclose(near.rho, np.array(rho, dtype=float), rtol=1e-10, atol=1e-10)
        assert near.contact_features == (Feature.from_label(label),)
        assert near.kind == Feature.from_label(label).kind
    return len(expected)


# ------------------------------------------------------------------------------------------------ the oracle itself


@pytest.mark.parametrize("case", ONE_LINE, ids=lambda case: case.name)
def test_oracle_finds_the_one_line_of_each_closed_form(case):
    truth = exact(case.one, case.two)
    (piece,) = truth.pair.pieces
    assert piece.label == case.label
    p, q, r = case.line
    assert all(primitive(facet.line) == primitive((p, q, r)) for facet in piece.facets)
    assert {plane_point(piece.start), plane_point(piece.end)} == {(Fraction(r, p), 0), (0, Fraction(r, q))}
    assert [truth.side((Fraction(r, 2 * p), Fraction(r + k, 2 * q))) for k in (-1, 0, 1)] == [1, 0, -1]


def test_oracle_measures_boxes_as_known():
    truth = exact(CUBE, CUBE.shifted((5, 6, 2)))
    assert truth.distance((1, 1)) == pytest.approx(5, rel=1e-15)  # gaps 3 and 4 in x and y
    assert truth.gap((1, 1)) == pytest.approx(4, rel=1e-15)
    assert truth.gap((3, 4)) == pytest.approx(-1, rel=1e-15)
    assert truth.distance((3, 4)) == 0
    assert exact(CUBE, CUBE.shifted((5, 0, 0))).distance((1, 2)) == pytest.approx(2, rel=1e-15)
    assert truth.crossings(Fraction(5, 2)) == [Fraction(7, 2)]


@pytest.mark.parametrize("example", [EXAMPLE_1, EXAMPLE_2], ids=["example 1", "example 2"])
def test_oracle_meets_the_published_facts_on_the_decimal_coordinates(example):
    pieces = exact(example.one, example.two).pieces(DEFAULT_BOX)
    assert {piece.label for _, piece in pieces} == set(example.labels)
    ends = {plane_point(u) for _, piece in pieces for u in (piece.start, piece.end)}
    for point in example.switching_points:
        assert min(max(abs(float(x) - y) for x, y in zip(end, point, strict=True)) for end in ends) < 5e-8


# ----------------------------------------------------------------------------------------------- the paper's examples


@pytest.mark.parametrize("example", [EXAMPLE_1, EXAMPLE_2], ids=["example 1", "example 2"])
def test_examples_of_the_paper_show_what_is_published(example):
    curve = curve_of(example.one, example.two, DEFAULT_BOX)
    assert curve.status == "contact"
    assert [segment.feature for segment in curve.segments] == [Feature.from_label(label) for label in example.labels]
    assert [segment.index for segment in curve.segments] == list(range(1, len(example.labels) + 1))
    np.testing.assert_allclose(
        [point.rho for point in curve.switching_points], example.switching_points, rtol=0, atol=5e-8
    )
    assert [point.index for point in curve.switching_points] == list(range(1, len(example.switching_points) + 1))
    (branch,) = curve.branches
    assert branch.is_function
    truth = exact(example.one, example.two)
    ends = {plane_point(u) for _, piece in truth.pieces(DEFAULT_BOX) for u in (piece.start, piece.end)}
    for segment in curve.segments:
        for end in (segment.start, segment.end):
            assert min(np.abs(end - np.array(known, dtype=float)).max() for known in ends) < 1e-12
    check_lines(curve)


def test_example_1_as_the_issue_states_it():
    curve = curve_of(EXAMPLE_1.one, EXAMPLE_1.two, DEFAULT_BOX)
    assert curve.segments[0].feature.label == "V1F2(P1V6; P2V2,V3,V5)"
    np.testing.assert_allclose(curve.switching_points[2].rho, [1.273451, 1.214536], atol=5e-7)
    assert [point.kind for point in curve.switching_points] == ["V1E2", "E1V2", "E1V2", "E1V2"]


def test_example_2_as_the_issue_states_it():
    curve = curve_of(EXAMPLE_2.one, EXAMPLE_2.two, DEFAULT_BOX)
    first, second = curve.switching_points
    np.testing.assert_allclose(first.rho, [2.378003, 2.140897], atol=5e-7)
    assert first.contacts.shape == (2, 3)
    assert first.contact_features == tuple(Feature.from_label(label) for label in EXAMPLE_2.labels[:2])
    np.testing.assert_allclose(second.rho, [2.811014, 1.179500], atol=5e-7)
    assert second.contacts.shape == (1, 3)
    assert second.kind == "V1E2"
    assert second.label == "V1E2(P1V4; P2V9,V10)"


def test_contact_points_of_example_2_are_the_scaled_vertices():
    curve = curve_of(EXAMPLE_2.one, EXAMPLE_2.two, DEFAULT_BOX)
    one = curve.movable
    for point, vertices in zip(curve.switching_points, ((5, 4), (4,)), strict=True):
        expected = [one.seed + point.rho[0] * (one.vertices[v - 1] - one.seed) for v in vertices]
        np.testing.assert_allclose(point.contacts, expected, atol=1e-12)


# -------------------------------------------------------------------------------------------- convex pairs at random


@pytest.mark.parametrize("case", ONE_LINE, ids=lambda case: case.name)
def test_one_contact_over_the_whole_box_in_closed_form(case):
    check_convex(case.one, case.two)
    curve = curve_of(case.one, case.two)
    p, q, r = case.line
    x = np.array([0.5, 0.9, 1.3, 1.7])
    np.testing.assert_allclose(curve.rho2(x), (r - p * x) / q, rtol=1e-14)


@settings(max_examples=300)
@given(generators, reaches)
def test_convex_pairs_with_seeds_inside_equal_the_exact_curve(rng, reach):
    check_convex(*random_pair(rng, reach, INSIDE))


@settings(max_examples=400)
@given(generators, reaches, st.sampled_from(SEED_PAIRS))
def test_convex_pairs_with_seeds_anywhere_equal_the_exact_curve(rng, reach, seeds):
    one, two = random_pair(rng, reach, seeds)
    if not exact(one, two).degenerate:
        check_convex(one, two)


@settings(max_examples=60)
@given(generators)
def test_larger_generic_hulls_equal_the_exact_curve(rng):
    one, two = (random_shape(rng, 1000, "inside", 12) for _ in range(2))
    check_convex(one, two.shifted(rng.integers(-3000, 3000, 3).tolist()))


@settings(max_examples=100)
@given(generators)
def test_posed_generic_pairs_equal_the_exact_curve_of_the_pose_as_given(rng):
    one, two = random_pair(rng, 1000, INSIDE)
    check_convex(one, two, pose=random_pose(rng, 500.0))


def test_random_pairs_cover_curves_of_many_segments_and_few_have_none():
    rng = np.random.default_rng(5)
    counts = [len(exact(*random_pair(rng, reach, INSIDE)).pieces(ODD_BOX)) for reach in (2, 3, 1000) for _ in range(30)]
    assert max(counts) >= 6
    assert counts.count(0) < 0.2 * len(counts)


@settings(max_examples=100)
@given(generators, reaches)
def test_both_seeds_inside_give_one_decreasing_function(rng, reach):
    curve = curve_of(*random_pair(rng, reach, INSIDE))
    if curve.status != "contact":
        return
    (branch,) = curve.branches
    assert branch.is_function
    ends = [(*s.start, *s.end) for s in curve.segments]
    for x0, y0, x1, y1 in ends:
        assert x0 < x1
        assert y0 > y1
    assert [s.index for s in curve.segments] == list(range(1, len(ends) + 1))
    for (*_, x, y), (u, v, *_) in pairwise(ends):
        assert (x, y) == pytest.approx((u, v), rel=1e-12)


# --------------------------------------------------------------------------------------- lines, gap, distance, locate


@settings(max_examples=150)
@given(generators, reaches, st.sampled_from(SEED_PAIRS))
def test_crossings_of_vertical_lines_are_exact(rng, reach, seeds):
    one, two = random_pair(rng, reach, seeds)
    truth, curve = exact(one, two), curve_of(one, two)
    if truth.degenerate:
        return
    x = rng.uniform(*ODD_BOX[0], 6)
    for rho1 in x:
        expected = np.array(truth.crossings(rho1, ODD_BOX), dtype=float)
        np.testing.assert_allclose(curve.crossings(rho1), expected, rtol=1e-10)
    least = [float(found[0]) if (found := truth.crossings(rho1, ODD_BOX)) else np.nan for rho1 in x]
    np.testing.assert_allclose(curve.rho2(x), least, rtol=1e-10)
    assert curve.rho2(x.reshape(2, 3)).shape == (2, 3)


def check_gaps(truth: ExactCurve, curve: DecisionCurve, rng: np.random.Generator, size: float) -> None:
    pairs = np.column_stack([rng.uniform(*bounds, 8) for bounds in ODD_BOX])
    gaps = curve.gap(pairs)
    for rho, gap in zip(pairs, gaps, strict=True):
        assert gap == pytest.approx(curve.gap(rho), rel=1e-14, abs=1e-14 * size)
        assert np.sign(gap) == truth.side(rho)
        assert gap == pytest.approx(truth.gap(rho), abs=1e-12 * size)


@settings(max_examples=150)
@given(generators, reaches, st.sampled_from(SEED_PAIRS))
def test_gap_is_the_exact_separation_or_depth_with_the_right_sign(rng, reach, seeds):
    one, two = random_pair(rng, reach, seeds)
    check_gaps(exact(one, two), curve_of(one, two), rng, 100 * reach)


@pytest.mark.parametrize("case", ONE_LINE, ids=lambda case: case.name)
def test_gap_on_a_contact_of_exact_floats_is_zero_within_rounding(case):
    p, q, r = case.line
    curve = curve_of(case.one, case.two)
    assert curve.gap((r / p / 2, r / q / 2)) == pytest.approx(0, abs=4e-15)
    assert curve.gap((r / p / 2, r / q / 2 * (1 + 1e-12))) < 0 < curve.gap((r / p / 2, r / q / 2 * (1 - 1e-12)))


@settings(max_examples=60)
@given(generators, reaches, st.sampled_from(SEED_PAIRS))
def test_distance_is_euclidean_and_never_below_the_gap(rng, reach, seeds):
    one, two = random_pair(rng, reach, seeds)
    truth, curve = exact(one, two), curve_of(one, two)
    for rho in np.column_stack([rng.uniform(0.1, 3, 4), rng.uniform(0.1, 3, 4)]):
        distance = curve.distance(rho)
        assert distance == pytest.approx(truth.distance(rho), abs=1e-8 * reach)
        assert distance >= max(0.0, curve.gap(rho))


def test_distance_of_unions_is_that_of_the_nearest_parts():
    rng = np.random.default_rng(11)
    for _ in range(20):
        one, two = random_union(rng, 3, 2), random_union(rng, 3, 2).shifted((15, 3, 0))
        truth, curve = exact(one, two), curve_of(one, two)
        rho = rng.uniform(0.3, 1.5, 2)
        assert curve.distance(rho) == pytest.approx(truth.distance(rho), abs=1e-8)


@settings(max_examples=50)
@given(generators, reaches)
def test_locate_finds_segments_and_switching_points_and_nothing_off_the_curve(rng, reach):
    curve = curve_of(*random_pair(rng, reach, INSIDE))
    for segment in curve.segments:
        middle = (segment.start + segment.end) / 2
        if np.abs(segment.end - segment.start).max() > 1e-6:
            assert curve.locate(middle).feature == segment.feature
            assert curve.locate(middle * (1 + 1e-6)) is None
    for point in curve.switching_points:
        assert curve.locate(point.rho).index == point.index
        assert curve.locate(point.rho * (1 + 1e-6)) is None


def outside_by(points: np.ndarray, body: Body, part: int, rho: float) -> float:
    """How far points lie outside a scaled part."""
    own = body.scaled(rho).parts[part]
    heights = (points @ own.normals.T) - (own.vertices @ own.normals.T).max(axis=0)
    return float(heights.max())


@settings(max_examples=100)
@given(generators, reaches, st.sampled_from(SEED_PAIRS))
def test_contact_points_belong_to_both_scaled_bodies(rng, reach, seeds):
    curve = curve_of(*random_pair(rng, reach, seeds))
    places = [(segment.start + rng.uniform(0.1, 0.9) * (segment.end - segment.start)) for segment in curve.segments]
    for rho, contacts in [
        *((rho, curve.contact_points(rho)) for rho in places),
        *((point.rho, point.contacts) for point in curve.switching_points),
    ]:
        assert contacts.shape == (1, 3)
        size = 4 * reach * max(1, *rho)
        assert outside_by(contacts, curve.movable, 0, rho[0]) < 1e-11 * size
        assert outside_by(contacts, curve.static, 0, rho[1]) < 1e-11 * size
    assert curve.contact_points((100.0, 100.0)).shape == (0, 3)


@pytest.mark.parametrize(
    ("one", "two", "line"),
    [
        (box_shape((0, -1, -1), (1, 1, 1), (0, 0, 0)), CUBE.shifted((-3, 0, 0)), (0, 3)),  # r2 = 3: r1 grows away
        (CUBE.shifted((-3, 0, 0)), box_shape((0, -1, -1), (1, 1, 1), (0, 0, 0)), (math.inf, 3)),  # r1 = 3
        (box_shape((1, -1, -1), (2, 1, 1), (0, 0, 0)), box_shape((1, -1, -1), (2, 1, 1), (0, 0, 0)), (2, 0)),
    ],
)
def test_chains_that_run_to_infinity_are_located_outside_the_box_too(one, two, line):
    slope, level = line
    curve = curve_of(one, two)
    for x in (2.0, 50.0):
        rho = (level, x) if math.isinf(slope) else (x, slope * x + level)
        assert exact(one, two).touches(rho)
        assert curve.locate(rho).feature.kind == "F1F2"
        assert curve.locate((rho[0] + 0.01, rho[1] - 0.01)) is None


def test_chains_that_only_meet_where_both_scales_vanish_have_no_switching_point():
    both = box_shape((1, -1, -1), (2, 1, 1), (0, 0, 0))
    curve = curve_of(both, both, ((0, 3), (0, 3)))  # overlap where r1 / 2 < r2 < 2 r1
    assert len(curve.segments) == len(curve.branches) == 2
    assert curve.switching_points == ()


def test_bodies_drawn_vertex_on_vertex_touch_so_at_the_switching_point_of_scale_one():
    one = shape([(2, 0, 1), (0, 1, 2), (0, -1, 1), (2, -1, 0)], ("1.15625", "-0.25", "0.9375"))
    two = shape([(2, -1, 0), (-2, 0, -2), (-2, -3, -2), (-2, 0, 2)], ("-1.3125", "-0.6875", "-0.40625"))
    check_convex(one, two)
    curve = curve_of(one, two)
    assert curve.locate((1.0, 1.0)).label == "V1V2(P1V4; P2V1)"  # three lines meet there: E1V2 says too little
    np.testing.assert_allclose(curve.locate((1.0, 1.0)).contacts, [[2, -1, 0]], atol=1e-12)


def test_chain_with_both_ends_on_one_axis_is_listed_once():
    one = shape([(428, 282, -88), (977, 836, -978), (379, -462, -998), (-977, -981, 817), (-905, -300, 551),
                 (155, -558, 630)], (1607, 1245, -1051))  # fmt: skip
    two = shape([(-515, 2087, -1004), (-997, 1972, -2046), (419, 2895, -2182), (459, 2026, -1371)],
                (-1168, 2366, -1612))  # fmt: skip
    assert check_convex(one, two) == 3
    assert check_convex(two, one, (ODD_BOX[1], ODD_BOX[0])) == 3


# --------------------------------------------------------------------------------------------------- unions of parts


def covered(stretches: list[tuple[np.ndarray, np.ndarray, tuple[float, float, float]]]) -> float:
    """Total length of stretches, what several share counted once."""
    lines: dict[tuple[float, ...], list[tuple[float, float]]] = {}
    for start, end, (p, q, r) in stretches:
        sign = 1 if (p, q) > (0, 0) else -1
        scale = sign * math.hypot(p, q)
        key = next((k for k in lines if max(abs(k[i] - v / scale) for i, v in enumerate((p, q, r))) < 1e-9), None)
        key = key or (p / scale, q / scale, r / scale)
        along = sorted(float(np.array([-key[1], key[0]]) @ x) for x in (start, end))
        lines.setdefault(key, []).append((along[0], along[1]))
    total = 0.0
    for spans in lines.values():
        at = -math.inf
        for low, high in sorted(spans):
            total += max(0.0, high - max(low, at))
            at = max(at, high)
    return total


def check_union(one: Shape, two: Shape, rng: np.random.Generator) -> None:
    truth, curve = exact(one, two), curve_of(one, two)
    assert curve.status == truth.status(ODD_BOX)
    for x in rng.uniform(*ODD_BOX[0], 8):
        np.testing.assert_allclose(curve.crossings(x), np.array(truth.crossings(x, ODD_BOX), dtype=float), rtol=1e-10)
    expected = [
        (*(np.array(plane_point(u), dtype=float) for u in (piece.start, piece.end)),
         tuple(float(x) for x in piece.facets[0].line))
        for _, piece in truth.pieces(ODD_BOX)
    ]  # fmt: skip
    found = [(s.start, s.end, tuple(s.line)) for s in curve.segments]
    assert covered(found) == pytest.approx(covered(expected), abs=1e-8)
    assert sum(float(np.linalg.norm(b - a)) for a, b, _ in found) == pytest.approx(covered(found), abs=1e-8)
    check_lines(curve)
    for segment in curve.segments:
        run = segment.end - segment.start
        length = float(np.linalg.norm(run))
        if length < 1e-4:
            continue
        left = np.array([-run[1], run[0]]) / length
        middle = segment.start + rng.uniform(0.4, 0.6) * run
        step = 1e-7 * length
        assert truth.overlaps(middle + step * left)
        assert truth.overlaps(middle - step * left) == segment.snug
    check_gaps(truth, curve, rng, 400)


@settings(max_examples=100)
@given(generators, st.sampled_from([2, 3, 1000]), st.sampled_from([(1, 2), (2, 1), (2, 2), (3, 1), (2, 3)]))
def test_unions_equal_the_exact_curve(rng, reach, counts):
    one, two = (random_union(rng, reach, k) for k in counts)
    two = two.shifted(rng.integers(-3 * reach, 3 * reach, 3, endpoint=True).tolist())
    if not exact(one, two).degenerate:
        check_union(one, two, rng)


@settings(max_examples=100)
@given(generators, st.sampled_from([(1, 2), (2, 1), (2, 2), (3, 1), (2, 3)]))
def test_generic_unions_have_the_exact_segments_and_switching_points(rng, counts):
    one, two = (random_union(rng, 1000, k) for k in counts)
    two = two.shifted(rng.integers(-3000, 3000, 3).tolist())
    expected, curve = exact(one, two).pieces(ODD_BOX), curve_of(one, two)
    assert len(curve.segments) == len(expected)
    meetings: dict[tuple[Fraction, Fraction], list[tuple[tuple[int, int], Feature]]] = {}
    for key, piece in expected:
        ends, feature = [plane_point(piece.start), plane_point(piece.end)], Feature.from_label(piece.label)
        twins = [s for s in curve.segments if (s.parts, s.feature) == (key, feature)]
        assert min(np.abs(np.subtract(*turned_to([s.start, s.end], ends))).max() for s in twins) < 1e-9
        for end in ends:
            meetings.setdefault(end, []).append((key, feature))
    corners = {end: tuple(met) for end, met in meetings.items() if len(met) > 1}
    assert len(curve.switching_points) == len(corners)
    for end, met in corners.items():
        rho = np.array(end, dtype=float)
        near = min(curve.switching_points, key=lambda point: np.abs(point.rho - rho).max())
        np.testing.assert_allclose(near.rho, rho, rtol=1e-9)
        assert set(near.features) == {feature for _, feature in met}
        single = len({key for key, _ in met}) == 1
        assert len(near.contact_features) == len(near.contacts) == (1 if single else 2)
        if not single:
            assert set(near.contact_features) == set(near.features)
            assert near.kind == " & ".join(feature.kind for feature in near.contact_features)


def test_key_that_exactly_fills_its_slot_is_snug():
    key = box_shape((2, -1, -1), (3, 1, 1), (0, 0, 0))  # both drift along x as they grow
    slot = union(box_shape((1, -9, -9), (2, 9, 9)), box_shape((3, -9, -9), (9, 9, 9)), seed=(0, 0, 0))
    curve = curve_of(key, slot)
    assert sorted((s.snug, round(float(s.line[0] / s.line[1]), 12)) for s in curve.segments) == [
        (False, -3.0), (False, round(-2 / 9, 12)), (True, -1.0)
    ]  # fmt: skip
    check_union(key, slot, np.random.default_rng(0))
    np.testing.assert_allclose(curve.crossings(1.0), [2 / 9, 1, 3], rtol=1e-14)
    np.testing.assert_allclose(curve.rho2([1.0, 3.0]), [2 / 9, 2 / 3], rtol=1e-14)
    assert curve.gap((2.0, 2.0)) == pytest.approx(0, abs=1e-14)
    assert curve.gap((2.0, 2.01)) < 0
    assert curve.gap((2.0, 1.99)) < 0
    assert curve.locate((2.0, 2.0)).snug


def test_key_between_two_walls_touches_both_at_once():
    slot = union(box_shape((-9, -9, -9), (-2, 9, 9)), box_shape((2, -9, -9), (9, 9, 9)), seed=(0, 0, 0))
    curve = curve_of(CUBE, slot)
    (segment,) = curve.segments  # two part pairs, one line, overlap on one side
    assert not segment.snug
    check_union(CUBE, slot, np.random.default_rng(0))
    np.testing.assert_allclose(curve.rho2([0.3, 1.0, 4.0]), [0.15, 0.5, 2], rtol=1e-14)
    assert curve.gap((2.0, 1.01)) > 0 > curve.gap((2.0, 0.99))


def test_key_with_play_is_free_in_a_wedge_between_its_walls():
    key = box_shape((2, -1, -1), (3, 1, 1), (0, 0, 0))
    slot = union(box_shape((1, -9, -9), (2, 9, 9)), box_shape((4, -9, -9), (9, 9, 9)), seed=(0, 0, 0))
    curve = curve_of(key, slot)  # free where r2 <= r1 <= 4/3 r2
    check_union(key, slot, np.random.default_rng(1))
    np.testing.assert_allclose(curve.crossings(1.0), [2 / 9, 3 / 4, 1, 3], rtol=1e-14)
    assert len(curve.branches) == len(curve.segments) == 4
    assert not any(segment.snug for segment in curve.segments)
    assert curve.gap((1.15, 1.0)) == pytest.approx(0.3, rel=1e-14)  # 2 r1 - 2 r2, less than 4 r2 - 3 r1 = 0.55
    assert curve.gap((1.2, 1.0)) == pytest.approx(0.4, rel=1e-14)
    assert curve.gap((0.99, 1.0)) < 0
    assert curve.gap((1.34, 1.0)) < 0


def test_part_covered_by_an_unbounded_overlap_adds_no_crossings():
    inner = union(box_shape((1, -1, -1), (5, 1, 1)), box_shape((2, -1, -1), ("2.5", 1, 1)), seed=(4, 0, 0))
    curve = curve_of(CUBE, inner)
    np.testing.assert_allclose(curve.crossings(1.0), [1.0], rtol=1e-15)
    check_union(CUBE, inner, np.random.default_rng(2))


def test_example_2_cut_the_other_way_has_the_same_curve():
    one, two = EXAMPLE_2.one, EXAMPLE_2.two
    other = union(
        box_shape(("-4.33", "-0.306", "-0.6"), ("-0.33", "1.506", "0.6")),
        box_shape(("-4.33", "-1.2", "-0.6"), ("-1.73", "1.506", "0.6")),
        seed=two.seed,
    )
    first, second = (curve_of(one, body, DEFAULT_BOX) for body in (two, other))
    np.testing.assert_allclose([s.start for s in first.segments], [s.start for s in second.segments], rtol=1e-12)
    np.testing.assert_allclose([s.end for s in first.segments], [s.end for s in second.segments], rtol=1e-12)
    x = np.linspace(0.9, 2.9, 41)
    np.testing.assert_allclose(first.rho2(x), second.rho2(x), rtol=1e-12)


def test_convex_body_cut_into_parts_has_the_curve_and_the_labels_of_the_whole():
    corners = [(x, y, z) for x in (-2, 2) for y in (-1, 1) for z in (-1, 1)]
    whole = box_shape((-2, -1, -1), (2, 1, 1))
    rows = [tuple(float(v) for v in x) for x in corners] + [(1.0, y, z) for y in (-1, 1) for z in (-1, 1)]
    split = Body.from_parts(
        rows, parts=[[0, 1, 2, 3, 8, 9, 10, 11], [4, 5, 6, 7, 8, 9, 10, 11]], seed=(0, 0, 0),
        faces=[[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 4, 5], [2, 3, 6, 7], [0, 2, 4, 6], [1, 3, 5, 7]],
    )  # fmt: skip
    rng = np.random.default_rng(4)
    ours = Body.convex(corners, seed=(0, 0, 0))
    assert sorted(split.faces) == sorted(ours.faces)
    for _ in range(20):
        other = random_shape(rng, 1000, "inside")
        other = Shape(tuple(tuple(v / 500 for v in x) for x in other.vertices), tuple(v / 500 for v in other.seed))
        other = other.shifted(rng.integers(-5, 6, 3).tolist())
        # seeds in five-hundredths are no floats: both curves take the same rounded body
        static = other.body()
        first, second = (decision_curve(body, static, box=ODD_BOX) for body in (ours, split))
        x = rng.uniform(0.1, 9, 10)
        np.testing.assert_allclose(first.rho2(x), second.rho2(x), rtol=1e-11)
        kept = [s for s in first.segments if s.feature.one.kind != "E"]
        for segment in kept:
            middle = (segment.start + segment.end) / 2
            assert second.locate(middle).feature == segment.feature
    assert whole.seed == (0, 0, 0)


# ------------------------------------------------------------------------------------------------------- seeds outside


def test_seed_outside_gives_two_chains_in_closed_form():
    one = box_shape((2, -1, -1), (4, 1, 1), (0, 0, 0))  # the box flies away from its seed as it grows
    two = box_shape((5, -1, -1), (7, 1, 1))
    curve = curve_of(one, two)
    assert len(curve.branches) == 2
    lines = sorted((tuple(np.round(s.line, 12)), s.feature.kind) for s in curve.segments)
    assert lines == [((-2.0, 1.0, -6.0), "F1F2"), ((4.0, 1.0, 6.0), "F1F2")]
    np.testing.assert_allclose(curve.crossings(1.0), [2.0], rtol=1e-15)
    np.testing.assert_allclose(curve.crossings(4.0), [2.0], rtol=1e-15)
    assert curve.crossings(2.0).size == 0
    check_convex(one, two)


def test_seeds_outside_both_give_a_closed_polygon_in_closed_form():
    one = box_shape((2, 1, -1), (4, 2, 1), (0, 0, 0))
    two = box_shape((8, 1, -1), (10, 2, 1), (12, 0, 0))  # strips 3 < r1 + r2 < 6 and r2 / 2 < r1 < 2 r2
    curve = curve_of(one, two)
    (branch,) = curve.branches
    assert not branch.is_function
    assert len(curve.segments) == len(curve.switching_points) == 4
    corners = sorted(tuple(np.round(point.rho, 12)) for point in curve.switching_points)
    assert corners == [(1, 2), (2, 1), (2, 4), (4, 2)]
    np.testing.assert_allclose(curve.crossings(2.5), [1.25, 3.5], rtol=1e-15)
    np.testing.assert_allclose(curve.rho2([1.5, 2.5, 3.5, 4.5]), [1.5, 1.25, 1.75, np.nan], rtol=1e-15)
    assert curve.gap((2.5, 2.0)) < 0 < curve.gap((2.5, 1.0))
    check_convex(one, two)
    np.testing.assert_allclose(curve.segments[0].start, curve.segments[-1].end, rtol=1e-14)
    inner = curve_of(one, two, ((2.1, 2.9), (2.1, 2.9)))
    assert (inner.status, len(inner.segments)) == ("overlapping", 0)


def test_closed_polygon_cut_by_the_box_falls_into_branches():
    one, two = box_shape((2, 1, -1), (4, 2, 1), (0, 0, 0)), box_shape((8, 1, -1), (10, 2, 1), (12, 0, 0))
    box = ((1.25, 3.75), (1.25, 3.75))
    check_convex(one, two, box)
    assert len(curve_of(one, two, box).branches) == 4


def test_parts_that_fly_apart_never_meet():
    one = box_shape((2, -1, -1), (4, 1, 1), (0, 0, 0))
    two = box_shape((-5, -1, -1), (-3, 1, 1), (-1, 0, 0))
    curve = curve_of(one, two)
    assert (curve.status, curve.segments, curve.branches, curve.switching_points) == ("apart", (), (), ())
    assert np.isnan(curve.rho2([1.0, 2.0])).all()
    assert curve.gap((1.0, 1.0)) == pytest.approx(5, rel=1e-15)
    assert curve.locate((1.0, 1.0)) is None


def test_common_seed_inside_both_overlaps_at_every_scale():
    curve = curve_of(CUBE, CUBE)
    assert (curve.status, curve.segments) == ("overlapping", ())
    assert curve.gap((1.0, 1.0)) == pytest.approx(-2, rel=1e-15)
    assert np.isnan(curve.rho2(1.0)).all()


def test_common_seed_in_the_seam_touches_at_every_scale_and_has_no_curve():
    one, two = box_shape((0, -1, -1), (1, 1, 1), (0, 0, 0)), box_shape((-1, -1, -1), (0, 1, 1), (0, 0, 0))
    assert exact(one, two).degenerate
    curve = curve_of(one, two)
    assert (curve.status, curve.segments) == ("apart", ())
    assert curve.gap((1.3, 2.7)) == pytest.approx(0, abs=1e-15)


# ----------------------------------------------------------------------------------------------- boxes in closed form


@given(generators)
def test_axis_aligned_boxes_in_closed_form(rng):
    p, q = rng.uniform(0.2, 2, (2, 3))
    d = rng.uniform(-5, 5, 3)
    one, two = (
        Body.convex([s * half + centre for s in np.array(list(np.ndindex(2, 2, 2))) * 2 - 1], seed=centre)
        for half, centre in ((p, np.zeros(3)), (q, d))
    )
    curve = decision_curve(one, two, box=ODD_BOX)
    x = rng.uniform(*ODD_BOX[0], 20)
    least = ((np.abs(d) - np.outer(x, p)) / q).max(axis=1)
    least[(least < ODD_BOX[1][0]) | (least > ODD_BOX[1][1])] = np.nan
    np.testing.assert_allclose(curve.rho2(x), least, rtol=1e-12)
    r = rng.uniform(0.1, 5, 2)
    gaps = np.abs(d) - r[0] * p - r[1] * q
    assert curve.gap(r) == pytest.approx(gaps.max(), abs=1e-13)
    if gaps.max() > 0:
        assert curve.distance(r) == pytest.approx(np.linalg.norm(np.maximum(gaps, 0)), rel=1e-9)


def test_curve_through_corners_of_the_scale_box():
    one, two = CUBE, CUBE.shifted((4, 0, 0))
    (segment,) = curve_of(one, two, ((1, 3), (1, 3))).segments
    np.testing.assert_allclose([segment.start, segment.end], [[1, 3], [3, 1]], rtol=1e-15)
    outside, inside = curve_of(one, two, ((1, 2), (1, 2))), curve_of(one, two, ((2, 3), (2, 3)))
    assert (outside.status, outside.segments) == ("apart", ())
    assert (inside.status, inside.segments) == ("overlapping", ())


# -------------------------------------------------------------------------------------------------------- invariances


def check_same(
    first: DecisionCurve, second: DecisionCurve, *, factor: float = 1.0, lengths: float = 1.0, swap: bool = False,
    rename: tuple[dict[int, int], dict[int, int]] | None = None, tolerance: float = 1e-10,
) -> None:  # fmt: skip
    """`second` is `first` with scale pairs times `factor`, lengths times `lengths`, bodies swapped or renumbered."""

    def mapped(segment):
        elements = [segment.feature.one, segment.feature.two]
        if rename:
            elements = [
                Element(e.kind, tuple(names[v] for v in e.vertices)) for e, names in zip(elements, rename, strict=True)
            ]
        ends = np.array([segment.start, segment.end]) * factor
        line = segment.line * lengths * np.array([1, 1, factor])
        if swap:
            elements, ends, line = elements[::-1], ends[:, ::-1], line[[1, 0, 2]]
        parts = segment.parts[::-1] if swap else segment.parts
        return Feature(*elements), ends, line, parts, segment.snug

    assert second.status == first.status
    assert len(second.segments) == len(first.segments)
    assert len(second.switching_points) == len(first.switching_points)
    rest = list(second.segments)
    for segment in first.segments:
        feature, ends, line, parts, snug = mapped(segment)
        twin = min(rest, key=lambda s: np.abs(np.subtract(*turned_to([s.start, s.end], ends))).max())
        rest.remove(twin)
        assert (twin.feature, twin.parts, twin.snug) == (feature, parts, snug)
        np.testing.assert_allclose(*turned_to([twin.start, twin.end], ends), rtol=tolerance, atol=tolerance)
        size = np.abs(line).max()
        np.testing.assert_allclose(twin.line, line, rtol=0, atol=tolerance * size)


def generic_pairs(rng: np.random.Generator) -> tuple[Shape, Shape]:
    """Two generic bodies of one or two parts each."""
    one, two = (random_union(rng, 1000, int(rng.integers(1, 3))) for _ in range(2))
    return one, two.shifted(rng.integers(-4000, 4000, 3).tolist())


@settings(max_examples=60)
@given(generators)
def test_swapped_bodies_mirror_the_curve(rng):
    one, two = generic_pairs(rng)
    check_same(curve_of(one, two, ODD_BOX), curve_of(two, one, (ODD_BOX[1], ODD_BOX[0])), swap=True)


@settings(max_examples=60)
@given(generators)
def test_a_common_rigid_motion_changes_nothing(rng):
    one, two = (own.body() for own in generic_pairs(rng))
    T = random_pose(rng, 500.0)
    check_same(decision_curve(one, two, box=ODD_BOX), decision_curve(one.moved(T), two.moved(T), box=ODD_BOX))


@settings(max_examples=30)
@given(generators)
def test_the_transform_moves_body_1_as_moving_it_does(rng):
    one, two = (own.body() for own in generic_pairs(rng))
    T = random_pose(rng, 500.0)
    check_same(decision_curve(one, two, box=ODD_BOX, transform=T), decision_curve(one.moved(T), two, box=ODD_BOX))


@settings(max_examples=60)
@given(generators, st.sampled_from([1e-9, 1e-6, 1e-3, 1e3, 1e6]))
def test_the_unit_of_length_changes_nothing(rng, factor):
    one, two = generic_pairs(rng)
    scaled = [
        Body.from_parts(own.array * factor, parts=own.parts, seed=np.array(own.seed, dtype=float) * factor)
        for own in (one, two)
    ]
    check_same(curve_of(one, two), decision_curve(*scaled, box=ODD_BOX), lengths=factor)


@settings(max_examples=60)
@given(generators, st.sampled_from([-0.3, 1e-6, 0.02, 0.5]))
def test_moving_body_1_away_along_the_seed_line_scales_the_curve(rng, eps):
    one, two = (own.body() for own in generic_pairs(rng))
    T = np.eye(4)
    T[:3, 3] = -eps * (two.seed - one.seed)
    box = tuple(tuple((1 + eps) * x for x in bounds) for bounds in ODD_BOX)
    first, second = decision_curve(one, two, box=ODD_BOX), decision_curve(one, two, box=box, transform=T)
    check_same(first, second, factor=1 + eps)


@settings(max_examples=60)
@given(generators)
def test_permuted_vertices_map_the_labels(rng):
    one, two = generic_pairs(rng)
    made, names = [], []
    for own in (one, two):
        order = rng.permutation(len(own.vertices))
        place = {int(old): new for new, old in enumerate(order)}
        parts = [[place[row] for row in part] for part in own.parts]
        made.append(Body.from_parts(own.array[order], parts=parts, seed=np.array(own.seed, dtype=float)))
        names.append({old + 1: new + 1 for old, new in place.items()})
    check_same(curve_of(one, two), decision_curve(*made, box=ODD_BOX), rename=(names[0], names[1]))


@settings(max_examples=30)
@given(generators)
def test_far_origin_changes_nothing(rng):
    one, two = random_pair(rng, 3, INSIDE)
    check_convex(one.shifted((10**6, -(10**6), 10**6)), two.shifted((10**6, -(10**6), 10**6)))


# ----------------------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize(
    "box",
    [
        ((3, 1), (1, 3)),
        ((1, 1), (1, 3)),
        ((-1, 1), (1, 3)),
        ((1, math.nan), (1, 3)),
        ((1, math.inf), (1, 3)),
        (1, 3),
        None,
    ],
)
def test_boxes_must_be_two_ranges(box):
    with pytest.raises(InputError, match="box"):
        curve_of(CUBE, CUBE.shifted((4, 0, 0)), box)


@pytest.mark.parametrize("transform", [np.eye(3), 2 * np.eye(4), np.full((4, 4), np.nan)])
def test_transforms_must_be_rigid(transform):
    with pytest.raises(InputError):
        curve_of(CUBE, CUBE.shifted((4, 0, 0)), pose=transform)


def test_bodies_must_be_bodies():
    with pytest.raises(InputError, match="static"):
        decision_curve(CUBE.body(), CUBE.array)


@pytest.mark.parametrize("rho", [(1,), (1, 2, 3), (1, math.nan), 3.0])
def test_scale_pairs_must_be_two_finite_numbers(rho):
    curve = curve_of(CUBE, CUBE.shifted((4, 0, 0)))
    with pytest.raises(InputError, match="scale pair"):
        curve.locate(rho)
    with pytest.raises(InputError, match="scale pair"):
        curve.distance(rho)
