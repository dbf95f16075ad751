"""Decision curves of unions of convex parts against exact arithmetic and closed forms."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from cases import CUBE, DEFAULT_BOX, EXAMPLE_2, Shape, box_shape, exact, union
from curve_checks import ODD_BOX, check_gaps, check_lines, curve_of, turned_to
from hypothesis import given
from hypothesis import strategies as st
from oracles import plane_point
from strategies import aligned_union, generators, random_shape, random_union, runs

from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.bodies import Body

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


@runs(25)
@given(generators, st.sampled_from([2, 3, 1000]), st.sampled_from([(1, 2), (2, 1), (2, 2), (3, 1), (2, 3)]))
def test_unions_equal_the_exact_curve(rng, reach, counts):
    one, two = (random_union(rng, reach, k) for k in counts)
    two = two.shifted(rng.integers(-3 * reach, 3 * reach, 3, endpoint=True).tolist())
    if not exact(one, two).degenerate:
        check_union(one, two, rng)


@runs(25)
@given(generators, st.sampled_from([(1, 2), (2, 1), (2, 2), (3, 1)]))
def test_unions_along_the_axes_equal_the_exact_curve(rng, counts):
    one, two = (aligned_union(rng, 4, k) for k in counts)
    two = two.shifted(rng.integers(-9, 9, 3, endpoint=True).tolist())
    if not exact(one, two).degenerate:
        check_union(one, two, rng)


@runs(50)
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
