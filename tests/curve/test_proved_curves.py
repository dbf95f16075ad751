"""What the float walk proves, against rational arithmetic where floats are weakest; and curves that were once wrong."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from oracles import plane_point
from strategies import SEEDS, generators, random_pair, random_pose, random_rotation, runs

import fcdm_opt as fo
from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Contact
from fcdm_opt.curve.exact import ExactCurve, ExactPiece, exact_curve
from fcdm_opt.curve.region import Piece, Region, pair_region
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.tolerances import DEFAULT

TILT = np.array([[2, -1, 2], [2, 2, -1], [-1, 2, 2]]) / 3
UNIT_BOX = np.array(list(np.ndindex(2, 2, 2)), dtype=float)


def region(one: Body, two: Body, T: np.ndarray | None = None) -> Region:
    return fo.decision_curve(one, two, transform=T).regions[0]


def element(part: ConvexPart, vertices: tuple[int, ...]) -> frozenset[int]:
    """A vertex, an edge, or all corners of the face that the exact vertices lie on."""
    own = set(vertices)
    if len(own) == 1 or (len(own) == 2 and any(own == {a, b} for a, b, _, _ in part.edges.tolist())):
        return frozenset(own)
    return frozenset(max(part.loops, key=lambda loop: len(own.intersection(loop))))


def label_of(region: Region, piece: ExactPiece) -> tuple[frozenset[int], frozenset[int]]:
    one, two = piece.touching
    return element(region.one, one), element(region.two, two)


def is_seen(piece: ExactPiece) -> bool:
    """Whether a piece is long in floats and neither along a scale of zero nor at infinity; ends are homogeneous."""
    ends = [
        [float(Fraction(int(x), int(max(map(abs, end))))) for x in end] for end in (piece.exact_start, piece.exact_end)
    ]
    return np.abs(np.subtract(*ends)).max() > 1e-9 and all(max(pair) > 1e-9 for pair in zip(*ends, strict=True))


def is_part(region: Region, own: ExactPiece, piece: Piece) -> bool:
    """Whether pieces lie on one line, and what touches along one of them is part of what does along the other."""
    one, two = label_of(region, own)
    line, other = piece.line / np.abs(piece.line).max(), own.line / np.abs(own.line).max()
    nested = [a <= b or b <= a for a, b in ((one, set(piece.contact.one)), (two, set(piece.contact.two)))]
    return all(nested) and np.abs(line - other).max() < 1e-12


def exact_labels(region: Region) -> list[list[tuple[frozenset[int], frozenset[int]]]]:
    """What touches along each exact piece, chain by chain; one entry for the triangles of a face not drawn planar."""
    chains = []
    for chain in region.exact.chains:
        labels = [label_of(region, piece) for piece in chain.pieces]
        chains.append([label for k, label in enumerate(labels) if k == 0 or label != labels[k - 1]])
    return chains


def walked_labels(region: Region) -> list[list[tuple[frozenset[int], frozenset[int]]]]:
    def label(contact: Contact) -> tuple[frozenset[int], frozenset[int]]:
        return frozenset(contact.one), frozenset(contact.two)

    return [[label(piece.contact) for piece in chain] for chain in region.chains]


# --------------------------------------------------------------------------------------------- what the walk proves


@runs(80)
@given(generators)
def test_whatever_the_walk_proves_near_ties_is_exact(rng):
    """Integer pairs full of ties, stirred by 1e-17 to 1e-9 of their size, posed or not."""
    reach = int(rng.choice([2, 3, 1000]))
    one, two = random_pair(rng, reach, (SEEDS[rng.integers(4)], SEEDS[rng.integers(4)]))
    stir = reach * 10.0 ** rng.uniform(-17, -9)
    bodies = [
        Body.convex(own.array + stir * rng.normal(size=own.array.shape), seed=np.array(own.seed, dtype=float))
        for own in (one, two)
    ]
    made = region(*bodies, random_pose(rng, reach) if rng.random() < 0.5 else None)
    if made.path == "exact" or made.status == "empty":
        return
    if made.is_tied:  # lines that are one but for rounding are one; what lies along a scale of zero may be left out
        seen = [piece for piece in made.exact.pieces if is_seen(piece)]
        assert all(any(is_part(made, own, piece) for piece in made.pieces) for own in seen)
        assert all(any(is_part(made, own, piece) for own in seen) for piece in made.pieces)
        return
    assert sorted(map(str, map(sorted_labels, walked_labels(made)))) == sorted(
        map(str, map(sorted_labels, exact_labels(made)))
    )
    for piece, exact in zip(made.pieces, made.exact.pieces, strict=False):
        if len(made.pieces) == len(made.exact.pieces) and len(made.chains) == 1:
            np.testing.assert_allclose(piece.line, exact.line, rtol=0, atol=1e-13 * np.abs(exact.line).max())


def sorted_labels(chain: list[tuple[frozenset[int], frozenset[int]]]) -> list[tuple[list[int], list[int]]]:
    return [(sorted(one), sorted(two)) for one, two in chain]


@runs(50)
@given(generators)
def test_emptiness_proved_in_floats_is_exact(rng):
    one, two = random_pair(rng, 10, ("outside", "outside"))
    made = region(one.body(), two.body())
    if made.path == "float" and made.status == "empty":
        assert made.exact.status == "empty"
        assert made.exact.side((1.0, 1.0)) == made.sides(np.array([[1.0, 1.0]]))[0] == 1


def test_most_parts_that_never_meet_are_proved_so_in_floats():
    rng = np.random.default_rng(4)
    empty = [
        made
        for _ in range(100)
        if (made := region(*(s.body() for s in random_pair(rng, 1000, ("outside", "outside"))))).status == "empty"
    ]
    assert len(empty) > 20
    assert sum(made.path == "float" for made in empty) > 0.8 * len(empty)


def test_generic_pairs_need_no_rational_numbers():
    rng = np.random.default_rng(2)
    one, two = (Body.convex(rng.normal(size=(12, 3))) for _ in range(2))
    poses = np.array([random_pose(rng, 6.0) for _ in range(300)])
    curves = fo.decision_curves(one, two, poses)
    seeds_apart = np.linalg.norm(poses[:, :3, 3], axis=1) > 1
    assert curves.settled[seeds_apart].mean() < 0.01


# ------------------------------------------------------------------------------------------------ once wrong numbers


@pytest.mark.parametrize("thickness", [1e-2, 1e-4, 1e-6, 1e-9])
def test_signs_of_the_gap_of_thin_tilted_parts_were_wrong(thickness):
    """All directions are nearly one: a, b, c are as small as the thickness, their errors as those of the sizes."""
    P = np.array([[-4, -3, 1], [5, -3, -1], [-3, 4, -1], [3, 3, 1]]) * [1, 1, thickness] @ TILT.T
    Q = np.array([[-5, -2, -1], [4, -3, 1], [-2, 5, 1], [2, 3, -1]]) * [1, 1, thickness] @ TILT.T
    shift = np.array([0.31, 1.23, 0.303]) - TILT[:, 2] * (TILT[:, 2] @ [0.31, 1.23, 0.303]) + 4 * thickness * TILT[:, 2]
    curve = fo.decision_curve(Body.convex(P, seed=(0, 0, 0)), Body.convex(Q + shift, seed=shift))
    exact = curve.regions[0].exact
    probes = [
        corner.rho * (1 + sign * opening)
        for chain in exact.chains
        for corner in chain.corners
        for opening, sign in product((0, 1e-9, 1e-11, 1e-13, 1e-15), (1, -1))
        if np.isfinite(corner.rho).all() and corner.rho.min() > 1e-6
    ]
    assert len(probes) >= 10
    np.testing.assert_array_equal(np.sign(curve.gap(probes)), [exact.side(rho.tolist()) for rho in probes])


@pytest.mark.parametrize("half", [1e-3, 1e-6, 1e-9])
def test_switching_points_on_short_edges_lost_their_digits(half):
    P = np.array([[0, -half, 1], [0, half, 1], [-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1.2]]) @ TILT.T
    Q = np.array([[0.1, 0.2, -1], [1, 0.3, 0.5], [-1, 0.4, 0.7], [0.2, -1, 0.6], [0.1, 1.0, 0.9]]) @ TILT.T
    d = 1.3 * (0.6 * P[0] + 0.4 * P[1]) - 1.1 * Q[0]
    curve = fo.decision_curve(Body.convex(P, seed=(0, 0, 0)), Body.convex(Q + d, seed=d))
    exact = [corner for chain in curve.regions[0].exact.chains for corner in chain.corners]
    assert len(curve.switching_points) >= 2
    for point in curve.switching_points:
        nearest = min(exact, key=lambda corner: np.abs(corner.rho - point.rho).max())
        np.testing.assert_allclose(point.rho, nearest.rho, rtol=1e-12)


def test_an_offset_that_cancels_twice_was_walked_with_no_digit_right():
    rng = np.random.default_rng(3)
    R, s1 = random_rotation(rng), np.array([1.1, 0.3, 0.7])
    s2 = R @ s1
    rest = -kernels.relative_pose(np.block([[R, np.zeros((3, 1))], [np.eye(4)[3:]]]), s1, s2)[9:]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, -rest  # d is what even twice the precision leaves
    one, two = (Body.convex(rng.normal(size=(9, 3)) + s, seed=s) for s in (s1, s2))
    made = region(one, two, T)
    assert made.path == "exact"


@pytest.mark.slow
def test_unions_of_many_boxes_took_half_a_minute():
    """Most pairs of parts are found to be off the curve without being settled one by one."""

    def floor(count: int, shift: tuple[float, float, float]) -> Body:
        parts = [UNIT_BOX + np.add((i, j, 0), shift) for i in range(count) for j in range(count)]
        return Body.from_parts(parts, seed=np.array([count / 2, count / 2, 0.5]) + shift)

    curve = fo.decision_curve(floor(7, (0, 0, 0)), floor(7, (0.3, 0.2, 3)), box=((1.0, 9.0), (1.0, 9.0)))
    (segment,) = curve.segments
    np.testing.assert_allclose(segment.line / segment.line[0], [1, 1, 6], rtol=1e-14)
    assert sum(curve.paths.values()) <= 7**4 / 20


def test_the_face_that_exact_numbers_name_is_kept_beside_one_almost_in_its_plane():
    """A roof whose two sides differ by 1e-9: a vertex on one of them is on no other."""
    roof = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, -1, 1e-9], [0, 1, 1e-9], [0, 0, -1]])
    tip = np.array([[0.5, 0.1, 2], [0, 0, 3], [1, 0, 3], [0.5, 1, 3.2]])
    curve = fo.decision_curve(Body.convex(tip), Body.convex(roof, seed=(0, 0, -0.4)))
    labels = {frozenset(s.feature.two.vertices) for s in curve.segments if s.feature.two.kind == "F"}
    assert labels <= {frozenset({2, 3, 5, 6}), frozenset({1, 4, 5, 6})}
    exact: ExactCurve = exact_curve(curve.movable.parts[0], curve.static.parts[0], curve.transform)
    assert exact.status == "bounded"


# -------------------------------------------------------------------------------------------------- boxes and batches


@runs(30)
@given(generators)
def test_one_pose_and_many_agree_where_the_box_ends_on_a_switching_point(rng):
    one, two = random_pair(rng, 1000, ("inside", "inside"))
    bodies = one.body(), two.body()
    points = [point.rho for point in fo.decision_curve(*bodies, box=((0, 50), (0, 50))).switching_points[:3]]
    for x, y in points:
        above = np.nextafter(x, np.inf), np.nextafter(y, np.inf)
        for box in (
            ((x, x + 1), (y / 2, y + 1)),
            ((above[0], x + 1), (0.1, 9)),
            ((x / 2, x), (y / 2, y)),
            ((x, above[0]), (0, 60)),
            ((0, x), (above[1], 70)),
        ):
            curve, curves = fo.decision_curve(*bodies, box=box), fo.decision_curves(*bodies, [np.eye(4)], box=box)
            assert (len(curve.segments), curve.status) == (curves.counts[0], curves.status[0])
            ends = np.array([(s.start, s.end) for s in curve.segments]).reshape(-1, 2, 2)
            np.testing.assert_array_equal(curves.vertices, ends)


def test_no_poses_at_all_are_no_error():
    one, two = Body.convex(UNIT_BOX), Body.convex(UNIT_BOX + 3)
    for none in ([], np.zeros((0, 4, 4))):
        assert len(fo.decision_curves(one, two, none)) == 0


def test_the_region_of_a_pair_stands_alone():
    one, two = (Body.convex(UNIT_BOX * 2 - 1 + shift).parts[0] for shift in (0, 4))
    T = np.eye(4)
    made = pair_region(one, two, T)
    assert made.status == "bounded"
    assert made.exact.pieces[0].exact_line[2] == 4 * made.exact.pieces[0].exact_line[0]
    assert plane_point((2, 2, 1)) == (2, 2)
    np.testing.assert_array_equal(made.sides(np.array([[1, 1], [2, 2], [3, 3]])), [1, 0, -1])
    assert DEFAULT.sign < 1e-12
