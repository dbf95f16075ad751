"""Questions to a decision curve (crossings, gap, distance, locate), its invariances, and bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cases import CUBE, ONE_LINE, Shape, exact
from curve_checks import INSIDE, ODD_BOX, SEED_PAIRS, check_convex, check_gaps, curve_of, turned_to
from hypothesis import given
from hypothesis import strategies as st
from strategies import generators, random_pair, random_pose, random_union, reaches, runs

from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element

# --------------------------------------------------------------------------------------- lines, gap, distance, locate


@runs(75)
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


@runs(75)
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


@runs(30)
@given(generators, reaches, st.sampled_from(SEED_PAIRS))
def test_distance_is_euclidean_and_never_below_the_gap(rng, reach, seeds):
    one, two = random_pair(rng, reach, seeds)
    truth, curve = exact(one, two), curve_of(one, two)
    for rho in np.column_stack([rng.uniform(0.1, 3, 4), rng.uniform(0.1, 3, 4)]):
        distance = curve.distance(rho)
        assert distance == pytest.approx(truth.distance(rho), abs=1e-8 * reach)
        assert distance >= max(0.0, curve.gap(rho))


@pytest.mark.slow
def test_distance_of_unions_is_that_of_the_nearest_parts():
    rng = np.random.default_rng(11)
    for _ in range(20):
        one, two = random_union(rng, 3, 2), random_union(rng, 3, 2).shifted((15, 3, 0))
        truth, curve = exact(one, two), curve_of(one, two)
        rho = rng.uniform(0.3, 1.5, 2)
        assert curve.distance(rho) == pytest.approx(truth.distance(rho), abs=1e-8)


@runs(25)
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


@runs(50)
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


@runs(30)
@given(generators)
def test_swapped_bodies_mirror_the_curve(rng):
    one, two = generic_pairs(rng)
    check_same(curve_of(one, two, ODD_BOX), curve_of(two, one, (ODD_BOX[1], ODD_BOX[0])), swap=True)


@runs(30)
@given(generators)
def test_a_common_rigid_motion_changes_nothing(rng):
    one, two = (own.body() for own in generic_pairs(rng))
    T = random_pose(rng, 500.0)
    check_same(decision_curve(one, two, box=ODD_BOX), decision_curve(one.moved(T), two.moved(T), box=ODD_BOX))


@runs(15)
@given(generators)
def test_the_transform_moves_body_1_as_moving_it_does(rng):
    one, two = (own.body() for own in generic_pairs(rng))
    T = random_pose(rng, 500.0)
    check_same(decision_curve(one, two, box=ODD_BOX, transform=T), decision_curve(one.moved(T), two, box=ODD_BOX))


@runs(30)
@given(generators, st.sampled_from([1e-9, 1e-6, 1e-3, 1e3, 1e6]))
def test_the_unit_of_length_changes_nothing(rng, factor):
    one, two = generic_pairs(rng)
    scaled = [
        Body.from_parts(own.array * factor, parts=own.parts, seed=np.array(own.seed, dtype=float) * factor)
        for own in (one, two)
    ]
    check_same(curve_of(one, two), decision_curve(*scaled, box=ODD_BOX), lengths=factor)


@runs(30)
@given(generators, st.sampled_from([-0.3, 1e-6, 0.02, 0.5]))
def test_moving_body_1_away_along_the_seed_line_scales_the_curve(rng, eps):
    one, two = (own.body() for own in generic_pairs(rng))
    T = np.eye(4)
    T[:3, 3] = -eps * (two.seed - one.seed)
    box = tuple(tuple((1 + eps) * x for x in bounds) for bounds in ODD_BOX)
    first, second = decision_curve(one, two, box=ODD_BOX), decision_curve(one, two, box=box, transform=T)
    check_same(first, second, factor=1 + eps)


@runs(30)
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


@runs(15)
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
