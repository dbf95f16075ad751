"""What must not change the curve: common motions, the order of bodies and vertices, units, places, idle points.

Where a change leaves the numbers exact (swaps, new orders, powers of two, integer shifts, quarter turns) both curves
are right to `RIGHT`, of degenerate pairs too. Where it rounds the vertices by r (half a unit in the last place of each
number that is added up), a contact line may move by r and by the turn of its normal, r over the width w of the
feature, times the arm S: by r (1 + S / w). A breakpoint moves by that relative to (a, b), times the condition number
of its two lines.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cases import Shape, exact
from curve_checks import INSIDE, ODD_BOX, SEED_PAIRS
from degenerate import RIGHT, condition, is_seen
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import generators, random_pair, random_pose, reaches

from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.region import Piece
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt_benchmarks.stability.contacts.scenes import orientations

UNIT = 2.0**-53
ROUNDINGS = 64  # of a vertex, its seed, d, both bodies, both curves: 2 to 4 each, rounded up
Naming = Callable[[Feature], Feature]
EVERY_PAIR = (generators, reaches, st.sampled_from(SEED_PAIRS))


def same_name(feature: Feature) -> Feature:
    return feature


def swapped(feature: Feature) -> Feature:
    return Feature(feature.two, feature.one)


def renamed(one: dict[int, int], two: dict[int, int]) -> Naming:
    """Labels of both bodies mapped."""

    def name(feature: Feature) -> Feature:
        elements = zip((feature.one, feature.two), (one, two), strict=True)
        return Feature(*(Element(e.kind, tuple(labels[v] for v in e.vertices)) for e, labels in elements))

    return name


def pieces_of(curve: DecisionCurve) -> list[Piece]:
    return [run.whole for chain in curve.chains for run in chain if is_seen(run.whole)]


def reach_of(curve: DecisionCurve) -> float:
    """Arms of all vertices and the offset: the lengths that a contact line adds up."""
    arms = [np.abs(body.vertices - body.seed).max() for body in (curve.movable, curve.static)]
    return float(max(*arms, np.abs(curve.pose[9:]).max()))


def width_of(curve: DecisionCurve, piece: Piece) -> float:
    """The least width of what fixes a piece's direction: of a face, or of two edges against each other."""
    one, two = piece.contact.one, piece.contact.two
    X, Y = curve.movable.parts[0].vertices[list(one)], curve.static.parts[0].vertices[list(two)]
    if len(X) == len(Y) == 2:
        e, f = curve.transform[:3, :3] @ (X[1] - X[0]), Y[1] - Y[0]
        return float(np.linalg.norm(np.cross(e, f)) / (np.linalg.norm(e) + np.linalg.norm(f)))
    face = X if len(X) > 2 else Y
    return float(np.linalg.svd(face - face.mean(axis=0), compute_uv=False)[1])


def check_same(
    first: DecisionCurve,
    second: DecisionCurve,
    *,
    name: Naming = same_name,
    lengths: float = 1.0,
    swap: bool = False,
    rounding: float = 0.0,
) -> None:
    """`second` is `first` renamed, in other units, perhaps mirrored, after vertices moved by at most `rounding`."""
    before = pieces_of(first)
    after = {piece.feature: piece for piece in pieces_of(second)}
    slack = {}
    for piece in before:
        loose = rounding * (1 + reach_of(first) / width_of(first, piece)) if rounding else 0.0
        slack[piece.feature] = 2 * RIGHT * np.abs(piece.line).max() + loose
    reach = {f: s / np.hypot(*p.line[:2]) for p in before for f, s in slack.items() if f == p.feature}
    if rounding:  # nothing shorter than what rounding moves
        assume(all(np.abs(p.end - p.start).max() > 1e3 * reach[p.feature] for p in before))
    assert set(after) == {name(piece.feature) for piece in before}
    counts = [sorted(sum(is_seen(run.whole) for run in c) for c in curve.chains) for curve in (first, second)]
    assert counts[0] == counts[1]
    assert second.status == first.status
    order = [1, 0, 2] if swap else [0, 1, 2]
    for chain in first.chains:
        pieces = [run.whole for run in chain if is_seen(run.whole)]
        for k, piece in enumerate(pieces):
            twin = after[name(piece.feature)]
            np.testing.assert_allclose(twin.line / lengths, piece.line[order], rtol=0, atol=slack[piece.feature])
            ends = [(piece.start, pieces[k - 1]), (piece.end, pieces[(k + 1) % len(pieces)])]
            found = [twin.end, twin.start] if swap else [twin.start, twin.end]
            for (rho, beside), given_end in zip(ends, found, strict=True):
                if not np.isfinite(rho).all():
                    assert not np.isfinite(given_end).all()
                    continue
                other = beside.line if rho.all() else np.array([1.0, 0.0] if not rho[0] else [0.0, 1.0])
                moved = reach[piece.feature] + (reach[beside.feature] if rho.all() else 0.0)
                near = (1 + np.abs(rho).max()) * moved * condition(piece.line, other)
                np.testing.assert_allclose(given_end, rho[order[:2]], rtol=0, atol=near)
    check_listed(first, second, name)


def check_listed(first: DecisionCurve, second: DecisionCurve, name: Naming) -> None:
    """The same switching points in the box, with the same contacts."""
    contacts = [
        Counter(frozenset(map(own, point.contact_features)) for point in curve.switching_points)
        for curve, own in ((first, name), (second, same_name))
    ]
    assert contacts[0] == contacts[1]
    assert len(first.segments) == len(second.segments)
    assert len(first.branches) == len(second.branches)


def check_gaps(
    rng: np.random.Generator, first: DecisionCurve, second: DecisionCurve, *, lengths: float = 1.0, swap: bool = False,
    rounding: float = 0.0,
) -> None:  # fmt: skip
    """Gaps of the two are equal where they are right to 1e-13 of what they add up; signs are where that tells them."""
    rho = np.column_stack([rng.uniform(*bounds, 12) for bounds in ODD_BOX])
    gaps, others = first.gap(rho), second.gap(rho[:, ::-1] if swap else rho) / lengths
    slack = (RIGHT * reach_of(first) + rounding) * 20 * 12
    np.testing.assert_allclose(others, gaps, rtol=0, atol=slack)
    told = np.abs(gaps) > slack
    np.testing.assert_array_equal(np.sign(others[told]), np.sign(gaps[told]))


def bodies(*shapes: Shape) -> tuple[Body, ...]:
    return tuple(own.body() for own in shapes)


def changed(own: Shape, rows: Callable[[np.ndarray], Any]) -> Body:
    """A body whose vertices and seed went through a function of (n, 3) arrays."""
    return Body.convex(rows(own.array), seed=rows(np.array([own.seed], dtype=float))[0])


def rounding_of(shapes: Sequence[Shape], far: float = 0.0) -> float:
    """What rounding moves a vertex by, given the largest number that it is added to."""
    return ROUNDINGS * UNIT * (max(np.abs(own.array).max() for own in shapes) + far)


# --------------------------------------------------------------------------- exact changes, of degenerate pairs as well


@settings(max_examples=40)
@given(*EVERY_PAIR)
def test_swapped_bodies_mirror_the_curve(rng, reach, seeds):
    one, two = bodies(*random_pair(rng, reach, seeds))
    first = decision_curve(one, two, box=ODD_BOX)
    second = decision_curve(two, one, box=ODD_BOX[::-1])
    check_same(first, second, name=swapped, swap=True)
    check_gaps(rng, first, second, swap=True)


@settings(max_examples=40)
@given(*EVERY_PAIR)
def test_the_order_of_vertices_only_renames(rng, reach, seeds):
    shapes = random_pair(rng, reach, seeds)
    made, names = [], []
    for own in shapes:
        order = rng.permutation(len(own.vertices))
        made.append(changed(own, lambda rows, order=order: rows[order] if len(rows) > 1 else rows))
        names.append({int(old) + 1: new + 1 for new, old in enumerate(order)})
    first, second = decision_curve(*bodies(*shapes), box=ODD_BOX), decision_curve(*made, box=ODD_BOX)
    check_same(first, second, name=renamed(*names))
    check_gaps(rng, first, second)


@settings(max_examples=30)
@given(*EVERY_PAIR, st.integers(-20, 20))
def test_units_that_are_powers_of_two_change_nothing(rng, reach, seeds, power):
    shapes, factor = random_pair(rng, reach, seeds), 2.0**power
    first = decision_curve(*bodies(*shapes), box=ODD_BOX)
    second = decision_curve(*(changed(own, lambda rows: rows * factor) for own in shapes), box=ODD_BOX)
    check_same(first, second, lengths=factor)
    check_gaps(rng, first, second, lengths=factor)
    assert first.paths == second.paths


@settings(max_examples=30)
@given(*EVERY_PAIR, st.tuples(*[st.integers(-1, 1)] * 3))
def test_places_a_million_away_change_nothing(rng, reach, seeds, direction):
    shapes, shift = random_pair(rng, reach, seeds), 2.0**20 * np.array(direction)
    first = decision_curve(*bodies(*shapes), box=ODD_BOX)
    second = decision_curve(*(changed(own, lambda rows: rows + shift) for own in shapes), box=ODD_BOX)
    check_same(first, second)
    check_gaps(rng, first, second)


@settings(max_examples=30)
@given(*EVERY_PAIR, st.sampled_from(orientations()))
def test_common_quarter_turns_change_nothing(rng, reach, seeds, turn):
    one, two = bodies(*random_pair(rng, reach, seeds))
    T = turn.copy()
    T[:3, 3] = rng.integers(-9, 9, 3)
    first = decision_curve(one, two, box=ODD_BOX)
    check_same(first, decision_curve(one.moved(T), two.moved(T), box=ODD_BOX))
    check_gaps(rng, first, decision_curve(one.moved(T), two.moved(T), box=ODD_BOX))


@settings(max_examples=30)
@given(*EVERY_PAIR, st.sampled_from(orientations()))
def test_quarter_turns_by_the_transform_are_those_of_the_body(rng, reach, seeds, turn):
    one, two = bodies(*random_pair(rng, reach, seeds))
    T = turn.copy()
    T[:3, 3] = rng.integers(-2 * reach, 2 * reach, 3)
    first = decision_curve(one, two, box=ODD_BOX, transform=T)
    second = decision_curve(one.moved(T), two, box=ODD_BOX)
    check_same(first, second)
    check_gaps(rng, first, second)


@settings(max_examples=30)
@given(*EVERY_PAIR)
def test_repeated_and_inner_points_change_nothing(rng, reach, seeds):
    """Points that repeat a vertex or lie between vertices, before, among and after them; the first of equals counts."""
    shapes = random_pair(rng, reach, seeds)
    made, names = [], []
    for own in shapes:
        rows = own.array
        first, second = rows[rng.integers(len(rows), size=(2, 6))]
        inner = first * 0.25 + second * 0.75  # on edges, on faces, inside, or a vertex again
        idle = np.vstack([inner[np.abs(inner[:, None] - rows).max(axis=2).min(axis=1) > 0], rows.mean(axis=0)[None]])
        count = len(idle) // 2
        points = np.vstack([idle[:count], rows, rows[rng.permutation(len(rows))], idle[count:]])
        made.append(Body.convex(points, seed=np.array(own.seed, dtype=float)))
        names.append({k + 1: count + k + 1 for k in range(len(rows))})
    first_curve, second_curve = decision_curve(*bodies(*shapes), box=ODD_BOX), decision_curve(*made, box=ODD_BOX)
    check_same(first_curve, second_curve, name=renamed(*names))
    check_gaps(rng, first_curve, second_curve)


# ----------------------------------------------------------------------------------------- changes that round, generic


def generic(rng: np.random.Generator, seeds: tuple[str, str] = INSIDE) -> tuple[Shape, Shape]:
    one, two = random_pair(rng, 1000, seeds)
    return one, two.shifted(rng.integers(-999, 999, 3).tolist())


SEEDS_OFF_THE_SURFACE = st.sampled_from([(p, q) for p in ("inside", "outside") for q in ("inside", "outside")])


@settings(max_examples=30)
@given(generators, SEEDS_OFF_THE_SURFACE)
def test_common_motions_move_nothing_but_by_rounding(rng, seeds):
    shapes, T = generic(rng, seeds), random_pose(rng, 500.0)
    one, two = bodies(*shapes)
    first, second = decision_curve(one, two, box=ODD_BOX), decision_curve(one.moved(T), two.moved(T), box=ODD_BOX)
    rounding = rounding_of(shapes, 500.0)
    check_same(first, second, rounding=rounding)
    check_gaps(rng, first, second, rounding=rounding)


@settings(max_examples=30)
@given(generators, SEEDS_OFF_THE_SURFACE)
def test_the_transform_moves_body_1_as_moving_it_does(rng, seeds):
    shapes, T = generic(rng, seeds), random_pose(rng, 500.0)
    one, two = bodies(*shapes)
    first = decision_curve(one, two, box=ODD_BOX, transform=T)
    second = decision_curve(one.moved(T), two, box=ODD_BOX)
    rounding = rounding_of(shapes, 500.0)
    check_same(first, second, rounding=rounding)
    check_gaps(rng, first, second, rounding=rounding)


@settings(max_examples=20)
@given(generators)
def test_the_transform_is_read_in_the_moved_frame(rng):
    """T before a common motion G is G T G^-1 after it."""
    shapes, T, G = generic(rng), random_pose(rng, 500.0), random_pose(rng, 500.0)
    one, two = bodies(*shapes)
    back = np.eye(4)
    back[:3, :3], back[:3, 3] = G[:3, :3].T, -G[:3, :3].T @ G[:3, 3]
    first = decision_curve(one, two, box=ODD_BOX, transform=T)
    second = decision_curve(one.moved(G), two.moved(G), box=ODD_BOX, transform=G @ T @ back)
    rounding = 4 * rounding_of(shapes, 1000.0)  # G is orthogonal to a few roundings only
    check_same(first, second, rounding=rounding)
    check_gaps(rng, first, second, rounding=rounding)


@settings(max_examples=30)
@given(generators, SEEDS_OFF_THE_SURFACE, st.integers(-6, 6))
def test_units_change_nothing_but_by_rounding(rng, seeds, power):
    shapes, factor = generic(rng, seeds), 10.0**power
    first = decision_curve(*bodies(*shapes), box=ODD_BOX)
    second = decision_curve(*(changed(own, lambda rows: rows * factor) for own in shapes), box=ODD_BOX)
    check_same(first, second, lengths=factor, rounding=rounding_of(shapes))
    check_gaps(rng, first, second, lengths=factor, rounding=rounding_of(shapes))


@settings(max_examples=30)
@given(generators, SEEDS_OFF_THE_SURFACE)
def test_far_places_change_what_they_round(rng, seeds):
    shapes, shift = generic(rng, seeds), 1e6 * rng.uniform(-1, 1, 3)
    first = decision_curve(*bodies(*shapes), box=ODD_BOX)
    second = decision_curve(*(changed(own, lambda rows: rows + shift) for own in shapes), box=ODD_BOX)
    check_same(first, second, rounding=rounding_of(shapes, 1e6))
    check_gaps(rng, first, second, rounding=rounding_of(shapes, 1e6))


def test_generic_pairs_are_rarely_too_near_to_degenerate():
    """The share that `check_same` assumes away: pieces a thousand times as long as what the largest rounding moves."""
    rng, left = np.random.default_rng(0), 0
    for _ in range(60):
        shapes = generic(rng)
        curve = decision_curve(*bodies(*shapes), box=ODD_BOX)
        loose = [
            1e3 * rounding_of(shapes, 1e6) * (1 + reach_of(curve) / width_of(curve, p)) / np.hypot(*p.line[:2])
            for p in pieces_of(curve)
        ]
        left += all(np.abs(p.end - p.start).max() > x for p, x in zip(pieces_of(curve), loose, strict=True))
    assert left > 50


# -------------------------------------------------------------------------------------- changes that round, degenerate


@settings(max_examples=30)
@given(generators, st.sampled_from([1, 2, 3]), st.sampled_from(["motion", "transform", "unit", "place"]))
def test_degenerate_pairs_stay_where_they_are(rng, reach, change):
    """Both seeds inside: one falling curve; labels may differ where vertices meet, the curve may not."""
    shapes = random_pair(rng, reach, INSIDE)
    one, two = bodies(*shapes)
    T, pose, far = random_pose(rng, 2.0), None, 2.0
    assume(exact(*shapes).pair.pieces)
    if change == "motion":
        moved = one.moved(T), two.moved(T)
    elif change == "transform":
        one, pose = one.moved(T), T
        moved, far = (bodies(shapes[0])[0], two), 4.0
    elif change == "unit":
        moved = tuple(changed(own, lambda rows: rows * 1e-3 / 1e-6) for own in shapes)
    else:
        shift, far = rng.uniform(-100, 100, 3), 100.0
        moved = tuple(changed(own, lambda rows: rows + shift) for own in shapes)
    first, second = decision_curve(one, two, box=ODD_BOX), decision_curve(*moved, box=ODD_BOX, transform=pose)
    if change == "transform":
        assume(first.chains)
    assert len(first.chains) == len(second.chains) <= 1
    lengths = 1e3 if change == "unit" else 1.0
    rounding = rounding_of(shapes, far)
    check_gaps(rng, first, second, lengths=lengths, rounding=rounding * 20)
    for curve in (first, second):
        for before, after in pairwise(pieces_of(curve)):
            np.testing.assert_allclose(before.end, after.start, rtol=1e-12, atol=1e-12)
    x = np.geomspace(0.1, 9.0, 9)
    steep = max((abs(p.line[0] / p.line[1]) if p.line[1] else np.inf for p in pieces_of(first)), default=0.0)
    np.testing.assert_allclose(second.rho2(x), first.rho2(x), atol=1e3 * rounding * (1 + steep), rtol=1e-12)


@pytest.mark.parametrize("factor", [1e-6, 1e-3, 1e3, 1e6])
def test_flush_contacts_stay_flush_in_other_units_and_places(factor):
    """Aligned boxes keep their labels although neither their vertices nor their offset are exact."""
    low, high = np.array([-0.1, -0.2, -0.3]), np.array([0.1, 0.2, 0.3])
    corners = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)])
    for offset, kind in [((0.7, 0, 0), "F1F2"), ((0.7, 0.9, 0), "F1F2"), ((0.7, 0.05, 0.1), "F1F2")]:
        for shift in (np.zeros(3), np.array([0.7, -0.3, 0.1]), np.array([1e6, 1e6, -1e6]) * 0.1):
            one, two = corners + shift, corners + shift + offset
            curve = decision_curve(
                Body.convex(one * factor, seed=shift * factor),
                Body.convex(two * factor, seed=(shift + offset) * factor),
                box=ODD_BOX,
            )
            assert {segment.feature.kind for segment in curve.segments} == {kind}
            assert len(curve.segments) == 1
