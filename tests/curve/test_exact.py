"""The exact curve against enumeration in integers, closed forms, and a check of its own proofs."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from cases import CUBE, EXAMPLE_1, EXAMPLE_2, OCTAHEDRON, ONE_LINE, Shape, box_shape, shape
from flint import fmpq
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import Pair, common, feature_label, primitive
from oracles import exact_curve as enumerated
from strategies import SEEDS, generators, random_pair, random_pose

from fcdm_opt.curve.exact import ExactCorner, ExactCurve, ExactPiece, exact_curve
from fcdm_opt.curve.exact.program import Basis, Program
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt_benchmarks.references.proofs import Verdict, judged, proves

SEED_PAIRS = [(p, q) for p in SEEDS for q in SEEDS]


def part(own: Shape) -> ConvexPart:
    return own.body().parts[0]


def truth(one: Shape, two: Shape, pose: np.ndarray | None = None) -> Pair:
    """The oracle's pair, from the floats that the package gets."""
    seeds = [np.array(own.seed, dtype=float) for own in (one, two)]
    return enumerated(one.array, seeds[0], two.array, seeds[1], pose=pose).pair


def whole(vector) -> tuple[int, ...]:
    return tuple(int(x) for x in vector)


def label(found: ExactPiece | ExactCorner) -> str:
    return feature_label(*(tuple(v + 1 for v in own) for own in found.touching))


def check(one: Shape, two: Shape, pose: np.ndarray | None = None) -> ExactCurve:
    """Status, pieces, lines, corners and chains equal the enumerated ones."""
    curve, pair = exact_curve(part(one), part(two), pose), truth(one, two, pose)
    assert curve.status == ("bounded" if pair.pieces else "full" if pair.region else "empty")
    pieces = {(whole(piece.exact_start), whole(piece.exact_end)): piece for piece in curve.pieces}
    assert len(pieces) == len(curve.pieces) == len(pair.pieces)
    for expected in pair.pieces:
        piece = pieces[expected.start, expected.end]
        assert label(piece) == expected.label
        (facet,) = (facet for facet in expected.facets if facet.normal == whole(piece.exact_normal))
        assert tuple(Fraction(int(x.p), int(x.q)) * pair.unit for x in piece.exact_line) == facet.line
        assert piece.tight == (tuple(sorted(facet.one)), tuple(sorted(facet.two)))
    ends = [{piece.start, piece.end} for piece in pair.pieces]
    assert {(whole(corner.point), label(corner)) for chain in curve.chains for corner in chain.corners} == {
        (u, feature_label(*common([facet for facet in pair.facets if facet.value(u) == 0])))
        for u in pair.region
        if all(u) and sum(u in both for both in ends) == 2
    }
    for chain in curve.chains:
        followed = [*pairwise(chain.pieces), (chain.pieces[-1], chain.pieces[0])]
        for (before, after), corner in zip(followed, chain.corners, strict=False):
            assert before.exact_end == corner.point == after.exact_start
        assert len(chain.corners) == len(chain.pieces) - (not chain.closed)
        if not chain.closed:
            assert not all(chain.pieces[0].exact_start)
            assert not all(chain.pieces[-1].exact_end)
    return curve


def check_sides(one: Shape, two: Shape, points: list, pose: np.ndarray | None = None) -> list[int]:
    """Sides are the enumerated ones, and their proofs hold."""
    P, Q, pair = part(one), part(two), truth(one, two, pose)
    curve = exact_curve(P, Q, pose)
    sides = []
    for rho in points:
        verdict = judged(curve, rho)
        exact = [Fraction(int(x.p), int(x.q)) if isinstance(x, fmpq) else Fraction(float(x)) for x in rho]
        assert verdict.side == curve.side(rho) == pair.side(exact)
        assert proves(P, Q, pose, rho, verdict)
        if curve.status == "bounded":
            assert np.sign(curve.separation(rho)) == verdict.side
        sides.append(verdict.side)
    return sides


def exact_rho(corner: ExactCorner) -> tuple[fmpq, fmpq]:
    """Return the scale pair of a corner as rationals."""
    x, y, w = corner.point
    return fmpq(x, w), fmpq(y, w)


def marked(curve: ExactCurve) -> list:
    """Scale pairs on the curve, and 1e-13 to either side of them."""
    points = []
    for piece in curve.pieces:
        x, y, w = (p + q for p, q in zip(piece.exact_start, piece.exact_end, strict=True))
        if w:
            points += [(fmpq(x, w) * (1 + fmpq(k, 10**13)), fmpq(y, w) * (1 + fmpq(k, 10**13))) for k in (-1, 0, 1)]
    return points + [exact_rho(corner) for chain in curve.chains for corner in chain.corners]


# ------------------------------------------------------------------------------------------------------- closed forms


@pytest.mark.parametrize("case", ONE_LINE, ids=lambda case: case.name)
def test_one_line_of_each_closed_form(case):
    (piece,) = check(case.one, case.two).pieces
    p, q, r = case.line
    a, b, c = piece.exact_line
    assert (a * q, a * r) == (b * p, c * p)
    assert label(piece) == case.label
    np.testing.assert_array_equal([piece.start, piece.end], [[0, r / q], [r / p, 0]])


@pytest.mark.parametrize(
    ("example", "points"),
    # the first point of example 2 is where the curves of its two part pairs cross, a corner of neither
    [(EXAMPLE_1, EXAMPLE_1.switching_points), (EXAMPLE_2, EXAMPLE_2.switching_points[1:])],
    ids=["example 1", "example 2"],
)
def test_examples_of_the_paper(example, points):
    one = example.one.body().parts[0]
    curves = {two: exact_curve(one, two) for two in example.two.body().parts}
    corners = [corner.rho for curve in curves.values() for chain in curve.chains for corner in chain.corners]
    for point in points:
        assert min(np.abs(np.array(point) - corner).max() for corner in corners) < 5e-8
    for two, curve in curves.items():
        assert curve.status == "bounded"
        for rho in marked(curve):
            assert proves(one, two, None, rho, judged(curve, rho))


def test_seeds_that_coincide_inside_meet_at_every_scale():
    curve = check(CUBE, OCTAHEDRON)
    assert (curve.status, curve.chains) == ("full", ())
    assert curve.separation((1, 1)) == -math.inf
    assert check_sides(CUBE, OCTAHEDRON, [(1, 1), (1e-9, 5), (7, 1e9)]) == [-1, -1, -1]


def test_seeds_that_coincide_outside_make_lines_through_the_origin():
    one, two = box_shape((1, -1, -1), (2, 1, 1), (0, 0, 0)), box_shape((3, -1, -1), (5, 1, 1), (0, 0, 0))
    curve = check(one, two)
    assert {tuple(piece.exact_line) for piece in curve.pieces} == {(2, -3, 0), (-1, 5, 0)}
    assert check_sides(one, two, [(1, 1), (3, 2), (2, 1), (5, 1), (6, 1)]) == [1, 0, -1, 0, 1]


def test_a_closed_polygon_is_one_chain():
    # both parts far from their own seeds: only scales near 1 bring them together
    one, two = box_shape((10, -1, -1), (12, 1, 1), (0, 0, 0)), box_shape((-1, 10, -2), (2, 12, 2), (0, 22, 0))
    found = [check(one.shifted(shift), two) for shift in ((0, 0, 0), (-11, 11, 0))]
    closed = [chain for curve in found for chain in curve.chains if chain.closed]
    assert closed
    for chain in closed:
        x, y = np.array([corner.rho for corner in chain.corners]).T
        assert (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() > 0  # counter-clockwise: overlap on the left


def test_an_empty_region_is_excluded_by_one_direction():
    one, two = box_shape((-3, -1, -1), (-1, 1, 1), (0, 0, 0)), box_shape((1, -1, -1), (3, 1, 1), (0, 0, 0))
    curve = check(one, two.shifted((5, 0, 0)))
    assert (curve.status, curve.chains) == ("empty", ())
    (x, y, z), (P, Q) = whole(curve.proof), (one, two)
    assert max(x * p[0] + y * p[1] + z * p[2] for p in P.vertices) < 0
    assert min(x * q[0] + y * q[1] + z * q[2] for q in Q.vertices) > 0
    assert x * 5 > 0
    assert check_sides(one, two.shifted((5, 0, 0)), [(1, 1), (1e-6, 1e6)]) == [1, 1]


@pytest.mark.parametrize(
    ("offset", "points", "sides"),
    [
        ((0, 0, 0), [(1, 1), (1e-3, 50)], [0, 0]),  # top of one on the bottom of two, whatever the scales
        ((9, 0, 0), [(1, 1), (4, 5), (6, 3), (5, 6)], [1, 0, 0, 0]),  # likewise, once they are large enough
        ((0, 0, 1), [(1, 1)], [1]),
    ],
)
def test_parts_that_touch_but_never_overlap(offset, points, sides):
    one, two = box_shape((-1, -1, -2), (1, 1, 0), (0, 0, 0)), box_shape((-1, -1, 0), (1, 1, 2), (0, 0, 0))
    assert check(one, two.shifted(offset)).status == "empty"
    assert check_sides(one, two.shifted(offset), points) == sides


def test_parts_that_touch_at_one_scale_ratio_only():
    # edges that cross the common seed plane from either side, seen as a ray and a point of the polygon
    low = shape([(1, -1, 0), (1, 1, 0), (1, 0, -1), (2, 0, -1)], (0, 0, 0))
    high = shape([(2, 0, 0), (3, 0, 1), (3, 1, 1), (2, 1, 1)], (0, 0, 0))
    assert check(low, high).status == "empty"
    assert check_sides(low, high, [(2, 1), (1, 1), (4, 2), (4, 2.0000001), (3, 1)]) == [0, 1, 0, 1, 1]


# ----------------------------------------------------------------------------------------------- against enumeration


@pytest.mark.sampled(6)
@pytest.mark.parametrize("seeds", SEED_PAIRS, ids="-".join)
@settings(max_examples=4)
@given(rng=generators, reach=st.sampled_from([1, 2, 3, 1000]))
def test_random_pairs_equal_the_enumeration(seeds, rng, reach):
    one, two = random_pair(rng, reach, seeds)
    curve = check(one, two)
    check_sides(one, two, [*rng.uniform(0.05, 10, (3, 2)).tolist(), *marked(curve)[:8]])


@settings(max_examples=20)
@given(rng=generators, reach=st.sampled_from([1, 3, 1000]), seeds=st.sampled_from(SEED_PAIRS))
def test_posed_pairs_equal_the_enumeration(rng, reach, seeds):
    one, two = random_pair(rng, reach, seeds)
    pose = random_pose(rng, reach)
    curve = check(one, two, pose)
    check_sides(one, two, marked(curve)[:8], pose)


@settings(max_examples=20)
@given(rng=generators, reach=st.sampled_from([1, 3, 1000]), seeds=st.sampled_from(SEED_PAIRS))
def test_pairs_with_one_seed_equal_the_enumeration(rng, reach, seeds):
    one, two = random_pair(rng, reach, seeds)
    check(one, two.shifted([p - q for p, q in zip(one.seed, two.seed, strict=True)]))


@settings(max_examples=30)
@given(rng=generators, powers=st.tuples(*[st.integers(-27, 27)] * 2))
def test_sizes_far_apart_equal_the_enumeration(rng, powers):
    one, two = random_pair(rng, 3)
    sized = [
        replace(
            own,
            vertices=tuple(tuple(x * Fraction(2) ** k for x in row) for row in own.vertices),
            seed=tuple(x * Fraction(2) ** k for x in own.seed),
        )
        for own, k in zip((one, two), powers, strict=True)
    ]
    curve = check(*sized)
    check_sides(*sized, marked(curve)[:6])


# ------------------------------------------------------------------------------------------------- floats and proofs


def test_float_views_are_rounded_once():
    curve = check(EXAMPLE_1.one, EXAMPLE_1.two)
    for piece in curve.pieces:
        n = [Fraction(int(x)) for x in piece.exact_normal]
        line = [Fraction(int(x.p), int(x.q)) for x in piece.exact_line]
        square = sum(x * x for x in n)
        for value, exact in zip([*piece.normal, *piece.line], [*n, *line], strict=True):
            low, high = (Fraction(float(np.nextafter(abs(value), to))) for to in (0, np.inf))
            assert low**2 < exact**2 / square < high**2 or value == exact == 0
        x, y, w = whole(piece.exact_end)
        assert piece.end.tolist() == [float(Fraction(x, w)), float(Fraction(y, w))]


def test_far_ends_are_directions():
    one, two = box_shape((1, -1, -1), (2, 1, 1), (0, 0, 0)), box_shape((3, -1, -1), (5, 1, 1), (0, 0, 0))
    for piece in exact_curve(part(one), part(two)).pieces:
        assert piece.starts_far != piece.ends_far
        far = piece.start if piece.starts_far else piece.end
        a, b, _ = piece.line
        assert np.hypot(*far) == pytest.approx(1, rel=1e-15)
        assert a * far[0] + b * far[1] == pytest.approx(0, abs=1e-15)


def test_a_wrong_verdict_is_refused():
    P, Q = part(CUBE), part(CUBE.shifted((4, 0, 0)))
    curve = exact_curve(P, Q)
    apart, touching, inside = (judged(curve, rho) for rho in ((1, 2), (2, 2), (2, 3)))
    assert [verdict.side for verdict in (apart, touching, inside)] == [1, 0, -1]
    for rho, wrong in [
        ((2, 2), apart), ((2, 3), apart), ((2, 3), touching), ((1, 2), touching), ((2, 2), inside), ((1, 2), inside),
        ((2, 2), replace(touching, side=-1, direction=None)), ((1, 2), Verdict(1, None, {}, {})),
        ((2, 2), replace(touching, one={k: 2 * w for k, w in touching.one.items()})),
        ((2, 2), replace(touching, one={k + 1: w for k, w in touching.one.items() if k < 7})),
    ]:  # fmt: skip
        assert not proves(P, Q, None, rho, wrong)


@pytest.mark.parametrize("rho", [(0, 1), (1, -1), (math.nan, 1), (1, math.inf), (1,), "ab"])
def test_scale_pairs_that_are_none(rho):
    with pytest.raises(InputError, match="rho"):
        exact_curve(part(CUBE), part(CUBE.shifted((4, 0, 0)))).side(rho)


# ---------------------------------------------------------------------------------------------- larger and harder hulls


def cloud(rng: np.random.Generator, count: int, middle=(0, 0, 0), stretch=(1, 1, 1)) -> ConvexPart:
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    return Body.convex(points * stretch + middle).parts[0]


def check_proofs(one: ConvexPart, two: ConvexPart, pose: np.ndarray | None) -> ExactCurve:
    """Each piece's middle touches, and so do the corners; beside them the parts are apart, or overlap; all proved."""
    curve = exact_curve(one, two, pose)
    assert curve.status == "bounded"
    sides = []
    for rho in marked(curve):
        verdict = judged(curve, rho)
        assert proves(one, two, pose, rho, verdict)
        sides.append(verdict.side)
    assert sides.count(0) == len(curve.pieces) + sum(len(chain.corners) for chain in curve.chains)
    assert {-1, 1} < set(sides)
    return curve


@pytest.mark.parametrize(
    ("middle", "stretch"),
    [
        ((3, 1, 0.5), (1, 1, 1)),
        ((3, 1, 0.5), (1, 1e-4, 1e-8)),
        ((3e6, 1e6, 5e5), (1, 1, 1)),
        ((3e-7, 1e-7, 0), (1e-8, 1e-8, 1e-8)),
    ],
    ids=["round", "needle", "far", "small"],
)
def test_proofs_of_a_hundred_vertices(middle, stretch):
    rng = np.random.default_rng(11)
    check_proofs(cloud(rng, 100), cloud(rng, 100, middle, stretch), random_pose(rng))


def prism(sides: int, place=(0, 0, 0)) -> ConvexPart:
    angle = 2 * np.pi * np.arange(sides) / sides
    x, y, flat = np.cos(angle), np.sin(angle), np.zeros(sides)
    vertices = np.vstack([np.column_stack([x, y, flat]), np.column_stack([x, y, flat + 1])])
    return Body.convex(vertices + np.array(place), seed=np.add(place, (0, 0, 0.5))).parts[0]


@pytest.mark.parametrize("sides", [3, 100, 500])
def test_prisms_cap_to_cap_touch_by_their_caps(sides):
    one, two = prism(sides), prism(sides, (0, 0, 4))
    (piece,) = exact_curve(one, two).pieces
    assert piece.line.tolist() == [0.5, 0.5, 4]
    top, bottom = (set(np.flatnonzero(own.vertices[:, 2] == z).tolist()) for own, z in ((one, 1), (two, 4)))
    assert tuple(map(set, piece.touching)) == (top, bottom)


@pytest.mark.parametrize("place", [(0, 0, 4), (4, 0, 0)], ids=["cap to cap", "side to side"])
def test_work_on_aligned_prisms_grows_with_their_size_only(place, monkeypatch):
    # half of all vertices or more are tight there: a pivot for each, with a look at all the others, would be quadratic
    work = Counter()

    def count(owner, name):
        method = getattr(owner, name)

        def counted(*args):
            work[name] += 1
            return method(*args)

        monkeypatch.setattr(owner, name, counted)

    for owner, name in ((Program, "column"), (Program, "values"), (Basis, "pivoted")):
        count(owner, name)  # integers of one column, one pass through all columns' floats, one pivot
    found = []
    for sides in (50, 800):
        work.clear()
        exact_curve(prism(sides), prism(sides, place))
        found.append(dict(work))
    few, many = found
    assert few["column"] > 0 < many["column"] < 1.5 * 16 * few["column"]
    assert 0 < many["values"] < 3 * few["values"]
    assert 0 < many["pivoted"] < 3 * few["pivoted"]


def test_ten_thousand_vertices_finish():
    rng = np.random.default_rng(5)
    one, two = cloud(rng, 10_000), cloud(rng, 10_000, (3, 1, 0.5))
    curve = exact_curve(one, two, random_pose(rng))
    (chain,) = curve.chains
    X, Y = np.array([piece.normal for piece in chain.pieces]), np.array([piece.line for piece in chain.pieces])
    assert len(chain.pieces) > 3
    np.testing.assert_allclose((X**2).sum(axis=1), 1, rtol=1e-15)
    for rho in (exact_rho(chain.corners[0]), exact_rho(chain.corners[-1])):
        assert curve.side(rho) == 0
    assert (Y[:, :2] > 0.9).all()
    assert primitive(whole(chain.corners[0].point)) == whole(chain.corners[0].point)
