"""Decision curves of convex pairs against exact arithmetic, closed forms and published facts."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from cases import CUBE, DEFAULT_BOX, EXAMPLE_1, EXAMPLE_2, ONE_LINE, box_shape, exact, shape
from curve_checks import INSIDE, ODD_BOX, SEED_PAIRS, check_convex, check_lines, curve_of
from hypothesis import given
from hypothesis import strategies as st
from oracles import plane_point, primitive
from strategies import aligned_pair, generators, random_pair, random_pose, random_shape, reaches, runs

from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.bodies import Body

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


@runs(60)
@given(generators, reaches)
def test_convex_pairs_with_seeds_inside_equal_the_exact_curve(rng, reach):
    check_convex(*random_pair(rng, reach, INSIDE))


@runs(80)
@given(generators, reaches, st.sampled_from(SEED_PAIRS))
def test_convex_pairs_with_seeds_anywhere_equal_the_exact_curve(rng, reach, seeds):
    one, two = random_pair(rng, reach, seeds)
    if not exact(one, two).degenerate:
        check_convex(one, two)


@runs(80)
@given(generators, st.sampled_from([2, 4, 1000]), st.sampled_from(SEED_PAIRS))
def test_parts_along_the_axes_equal_the_exact_curve(rng, reach, seeds):
    one, two = aligned_pair(rng, reach, seeds)
    if not exact(one, two).degenerate:
        check_convex(one, two)


@runs(30)
@given(generators)
def test_larger_generic_hulls_equal_the_exact_curve(rng):
    one, two = (random_shape(rng, 1000, "inside", 12) for _ in range(2))
    check_convex(one, two.shifted(rng.integers(-3000, 3000, 3).tolist()))


@runs(25)
@given(generators)
def test_posed_generic_pairs_equal_the_exact_curve_of_the_pose_as_given(rng):
    one, two = random_pair(rng, 1000, INSIDE)
    check_convex(one, two, pose=random_pose(rng, 500.0))


def test_random_pairs_cover_curves_of_many_segments_and_few_have_none():
    rng = np.random.default_rng(5)
    counts = [len(exact(*random_pair(rng, reach, INSIDE)).pieces(ODD_BOX)) for reach in (2, 3, 1000) for _ in range(30)]
    assert max(counts) >= 6
    assert counts.count(0) < 0.2 * len(counts)


@runs(50)
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
