"""Which part pairs a union's curve is worked out from: the curve is that of all pairs, and few of them are kept."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import generators, random_rotation, runs

import fcdm_opt as fo
from fcdm_opt.curve import kernels
from fcdm_opt.curve.envelope import Union
from fcdm_opt.curve.region import pair_region
from fcdm_opt.tolerances import DEFAULT

BOX = ((0.8, 3.0), (0.8, 3.0))
CUBE = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


def chunk(rng: np.random.Generator, corners: int, place: np.ndarray, size: float) -> np.ndarray:
    return place + size * rng.normal(size=(corners, 3))


def heap(rng: np.random.Generator, count: int, aligned: bool) -> fo.Body:
    """Parts about the seed: some hold it, some do not; whole boxes on a grid where aligned, with many ties."""
    if aligned:
        parts = [CUBE * rng.integers(1, 4, 3) + rng.integers(-3, 3, 3) for _ in range(count)]
        return fo.Body.from_parts(parts, seed=rng.integers(-1, 2, 3).astype(float))
    parts = [chunk(rng, 6, rng.normal(size=3), rng.uniform(0.2, 0.8)) for _ in range(count)]
    return fo.Body.from_parts(parts, seed=(0.1, 0.2, 0.3))


def posed(rng: np.random.Generator, aligned: bool) -> np.ndarray:
    T = np.eye(4)
    if aligned:
        T[:3, 3] = rng.integers(-8, 9, 3)
    else:
        T[:3, :3], T[:3, 3] = random_rotation(rng), 4 * rng.normal(size=3)
    return T


def of_all_pairs(movable: fo.Body, static: fo.Body, T: np.ndarray) -> Union:
    """The union of all pairs' regions, in one cell: nothing is left out."""
    regions = [
        pair_region(one, two, T, (i, j)) for i, one in enumerate(movable.parts) for j, two in enumerate(static.parts)
    ]
    cell = [x for low, high in BOX for x in (low * (1 - DEFAULT.rim), high * (1 + DEFAULT.rim))]
    members = np.arange(len(regions))
    shares, shared = np.array([0, len(regions)]), (False,) * len(regions)
    return Union(movable, static, tuple(regions), (), np.array([cell]), members, shares, shared, len(regions))


def whole(movable: fo.Body, static: fo.Body, T: np.ndarray) -> fo.DecisionCurve:
    """The same curve from all part pairs."""
    curve = fo.decision_curve(movable, static, transform=T, box=BOX)
    curve.__dict__["_union"] = of_all_pairs(movable, static, T)
    return curve


@runs(30)
@given(generators, st.sampled_from([(1, 3), (2, 2), (4, 5), (9, 8)]), st.booleans())
def test_the_curve_is_that_of_all_pairs(rng, counts, aligned):
    one, two = (heap(rng, count, aligned) for count in counts)
    T = posed(rng, aligned)
    pruned, full = fo.decision_curve(one, two, transform=T, box=BOX), whole(one, two, T)
    assert pruned.status == full.status
    assert len(pruned.segments) == len(full.segments)
    for own, other in zip(pruned.segments, full.segments, strict=True):
        np.testing.assert_allclose([own.start, own.end], [other.start, other.end], rtol=1e-9, atol=1e-9)
        assert own.feature == other.feature
        assert own.snug == other.snug
    assert [point.index for point in pruned.switching_points] == [point.index for point in full.switching_points]
    for own, other in zip(pruned.switching_points, full.switching_points, strict=True):
        np.testing.assert_allclose(own.rho, other.rho, rtol=1e-9)
    for rho1 in rng.uniform(*BOX[0], 5):
        np.testing.assert_allclose(pruned.crossings(rho1), full.crossings(rho1), rtol=1e-9)


@pytest.mark.slow
def test_some_random_curves_have_segments_in_both_worlds():
    """The comparison above is not of empty curves."""
    rng, seen = np.random.default_rng(3), {True: 0, False: 0}
    for k in range(16):
        aligned = bool(k % 2)
        one, two, T = heap(rng, 4, aligned), heap(rng, 5, aligned), posed(rng, aligned)
        seen[aligned] += len(fo.decision_curve(one, two, transform=T, box=BOX).segments) > 0
    assert min(seen.values()) >= 2


@pytest.mark.slow
def test_of_sixty_by_sixty_parts_less_than_one_in_twenty_is_walked():
    rng = np.random.default_rng(0)
    one, two = (heap(rng, 60, False) for _ in range(2))
    T = posed(rng, False)
    T[:3, 3] *= 8 / np.linalg.norm(T[:3, 3])
    modelled = fo.decision_curve(one, two, transform=T, box=BOX).modelled
    assert modelled["part_pairs_total"] == 3600
    assert modelled["part_pairs_kept"] / 3600 < 0.05


@pytest.mark.slow
def test_a_floor_on_a_floor_is_one_segment_of_few_pairs():
    """Every tile of one lies on tiles of the other: thousands of contacts at once, one line."""

    def floor(z: float, shift: float) -> fo.Body:
        tiles = [np.add(CUBE, (i + shift, j, z)) for i in range(6) for j in range(6)]
        return fo.Body.from_parts(tiles, seed=(3 + shift, 3, z + 0.5))

    curve = fo.decision_curve(floor(0, 0), floor(2, 0.3), box=((1.0, 2.8), (1.0, 2.8)))
    (segment,) = curve.segments
    np.testing.assert_allclose(segment.line / segment.line[0], [1, 1, 4])
    assert segment.configuration == "F-F"
    assert curve.modelled["part_pairs_kept"] < 0.05 * curve.modelled["part_pairs_total"]


@pytest.mark.slow
def test_bounds_of_pairs_never_exceed_their_distance():
    rng = np.random.default_rng(1)
    for _ in range(10):
        one, two, T = heap(rng, 5, False), heap(rng, 6, False), posed(rng, False)
        curve = fo.decision_curve(one, two, transform=T)
        rho = rng.uniform(0.5, 2, 2)
        bounds = kernels.pair_bounds(*one.packed, *two.packed, curve.pose, rho)
        for i, p in enumerate(one.parts):
            for j, q in enumerate(two.parts):
                alone = fo.Body.convex(p.vertices, seed=one.seed), fo.Body.convex(q.vertices, seed=two.seed)
                distance = fo.decision_curve(*alone, transform=T).distance(rho)
                assert bounds[i, j] <= distance + 1e-12


@pytest.mark.slow
def test_the_gap_of_many_parts_is_that_of_the_nearest_pair():
    rng = np.random.default_rng(2)
    for _ in range(10):
        one, two, T = heap(rng, 4, False), heap(rng, 5, False), posed(rng, False)
        curve = fo.decision_curve(one, two, transform=T)
        pairs = rng.uniform(0.5, 3, (20, 2))
        gaps = curve.gap(pairs)
        parts = [[fo.Body.convex(part.vertices, seed=body.seed) for part in body.parts] for body in (one, two)]
        alone = np.min([fo.decision_curve(p, q, transform=T).gap(pairs) for p in parts[0] for q in parts[1]], axis=0)
        np.testing.assert_allclose(gaps[alone <= 0], alone[alone <= 0], rtol=1e-12, atol=1e-12)
        assert (gaps[alone > 0] >= alone[alone > 0] - 1e-12).all()
        for rho, gap in zip(pairs[alone > 0][:4], gaps[alone > 0], strict=False):
            assert gap <= curve.distance(rho) + 1e-12


@pytest.mark.slow
def test_the_nearest_point_is_on_the_curve_and_none_is_nearer():
    rng, found = np.random.default_rng(4), 0
    for _ in range(10):
        one, two, T = heap(rng, 4, False), heap(rng, 5, False), posed(rng, False)
        curve = fo.decision_curve(one, two, transform=T, box=BOX)
        rho = rng.uniform(0.8, 3, 2)
        near = curve.nearest(rho)
        samples = [s.start + t * (s.end - s.start) for s in curve.segments for t in np.linspace(0, 1, 20)]
        if not samples:
            continue
        found += 1
        assert abs(curve.gap(near)) < 1e-9
        assert np.linalg.norm(near - rho) <= min(np.linalg.norm(p - rho) for p in samples) + 1e-12
    assert found >= 5


def test_a_curve_that_is_nowhere_has_no_nearest_point():
    cube = fo.Body.convex(CUBE)
    far = fo.Body.from_parts([CUBE + 1000, CUBE + 1002])
    assert np.isnan(fo.decision_curve(far, cube).nearest((1, 1))).all()


@pytest.mark.parametrize("kept", [1.0, 1.5])
def test_deviations_widen_the_gap_to_bounds(kept):
    parts = [CUBE, np.add(CUBE, (1, 0, 0))]
    one = fo.Body.from_parts(parts, seed=(1, 0.5, 0.5), deviation=(0.01, 0.02))
    two = fo.Body.convex(np.add(CUBE, (0, 0, 3)))
    low, high = fo.decision_curve(one, two).gap_bounds((kept, 1.0))
    gap = 3.0 - 0.5 - 0.5 * kept
    assert low == pytest.approx(gap - 0.02 * kept)
    assert high == pytest.approx(gap + 0.01 * kept)


def test_the_wall_whose_lower_face_misses_the_seed_by_rounding():
    """The overlap's border ran 1e15 beyond the box, and what was left of it was dropped as a point."""
    wall = np.array([(x, y, z) for x in (2.17284635, 9) for y in (1e-15, 9) for z in (-9, 9)])
    curve = fo.decision_curve(
        fo.Body.convex(2 * CUBE - 1, seed=(0, 0, 0)), fo.Body.convex(wall, seed=(2.17284635, 0, 0))
    )
    assert curve.status == "contact"
    (segment,) = curve.segments
    np.testing.assert_allclose([segment.start[0], segment.end[0]], 2.17284635)
