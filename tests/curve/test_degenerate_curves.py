"""The degenerate list: every case against exact numbers, in status, features, breakpoints, lines, chains and signs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from cases import CUBE, TETRAHEDRON, exact
from curve_checks import ODD_BOX, check_convex, curve_of
from degenerate import (
    ASPECTS,
    BLOCK,
    CLOSED,
    DIRECTED,
    FAR_AWAY,
    FAR_TILTED,
    FLUSH_CONTACTS,
    MANY_MEET,
    MANY_POINTS,
    NEARLY,
    NO_OFFSET,
    ORIENTED,
    RIGHT,
    SEEDED,
    SIDED,
    SIZE_RATIOS,
    SLAB,
    SLIVER,
    SMALL_NUMBERS,
    TILTED,
    UNITS,
    Case,
    condition,
    fewer,
    is_seen,
    prism_points,
    pyramid_points,
    ring,
    seeded,
)  # fmt: skip
from oracles import (
    ExactCurve,
    Facet,
    Pair,
    Piece,
    Vec,
    box_lines,
    clipped,
    common,
    dot,
    feature_label,
    minus,
    plane_point,
    root,
)  # fmt: skip

from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.exact import exact_curve as exact_rational
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.references.proofs import judged, proves
from fcdm_opt_benchmarks.stability.contacts.scenes import TILT

NEAR = DEFAULT.planarity
BAND = (5e-13, 5e-11)  # turns of unit cubes that may be read as flush or not


class Group(NamedTuple):
    """Consecutive exact pieces of one contact, as `planarity` reads it."""

    feature: Feature
    pieces: tuple[Piece, ...]

    @property
    def ends(self) -> tuple[Vec, Vec]:
        return self.pieces[0].start, self.pieces[-1].end


def near_supports(pair: Pair, facet: Facet) -> list[frozenset[int]]:
    """Rows of either part that a direction supports, heights within `planarity` of the part's size taken as equal."""
    found = []
    directions = facet.normal, minus((0, 0, 0), facet.normal)
    for own, seed, n in zip((pair.one, pair.two), pair.seeds, directions, strict=True):
        size = max(abs(z - s) for v in own.vertices.values() for z, s in zip(v, seed, strict=True))
        top, slack = own.support(n)[0], NEAR * size * float(root(dot(n, n)))
        found.append(frozenset(row for row, v in own.vertices.items() if top - dot(n, v) <= slack))
    return found


def is_flush(pair: Pair, piece: Piece) -> bool:
    """Whether `planarity` makes more of a contact than exact numbers do."""
    return any(near_supports(pair, facet) != [facet.one, facet.two] for facet in piece.facets)


def feature_at(pair: Pair, u: Vec, flush: bool) -> Feature:
    """What touches at a homogeneous point of the curve: exactly, or all within `planarity` of it."""
    if not flush:
        return Feature.from_label(feature_label(*common([f for f in pair.facets if f.value(u) == 0])))
    x, y, w = (abs(z) for z in u)
    rows = [set(own.vertices) for own in (pair.one, pair.two)]
    for facet in pair.facets:
        a, b, c = (abs(z) for z in facet.line)
        if abs(facet.value(u)) <= NEAR * (a * x + b * y + c * w):
            for left, near in zip(rows, near_supports(pair, facet), strict=True):
                left &= near
    one, two = (tuple(sorted(row + 1 for row in left)) for left in rows)
    return Feature.from_label(feature_label(one, two))


def exact_chains(pair: Pair) -> list[list[Piece]]:
    """Chains of the curve in the whole quadrant, overlap on the left."""
    chains: list[list[Piece]] = []
    for piece in pair.pieces:
        if chains and chains[-1][-1].end == piece.start and all(piece.start):
            chains[-1].append(piece)
        else:
            chains.append([piece])
    if len(chains) > 1 and chains[-1][-1].end == chains[0][0].start and all(chains[0][0].start):
        chains[0] = chains.pop() + chains[0]
    return chains


def expected_chains(pair: Pair) -> list[list[Group]]:
    """The same chains, one group a contact, slivers left out."""
    made = []
    for chain in exact_chains(pair):
        named = [(feature_at(pair, middle(piece), is_flush(pair, piece)), piece) for piece in chain]
        groups = [Group(key, tuple(p for _, p in own)) for key, own in groupby(named, key=lambda found: found[0])]
        if len(groups) > 1 and groups[0].feature == groups[-1].feature:  # a closed one that starts within a group
            groups[0] = Group(groups[0].feature, groups.pop().pieces + groups[0].pieces)
        made.append([group for group in groups if is_long(*group.ends)])
    return made


def is_long(start: Vec, end: Vec) -> bool:
    """Whether floats can tell the ends of a stretch apart."""
    if not (start[2] and end[2]):
        return True
    (x, y), (u, v) = plane_point(start), plane_point(end)
    return abs(x - u) + abs(y - v) > SLIVER * (x + y)


def meets(u: Vec, v: Vec) -> bool:
    """Whether two stretches follow each other, perhaps with a sliver between them."""
    return all(u) and all(v) and not is_long(u, v)


def middle(piece: Piece) -> Vec:
    """A point inside a piece: the middle, or not far off where one end is at infinity."""
    (x, y, w), (p, q, v) = piece.start, piece.end
    if not (w and v):
        return x + p, y + q, w + v
    return x * v + p * w, y * v + q * w, 2 * w * v


def check_signs(truth: ExactCurve, curve: DecisionCurve) -> None:
    """The sign of the gap is right on the curve, just off it, far off it and near its corners."""
    pair = truth.pair
    marks = [(0.3, 0.7), (1.0, 1.0), (4.0, 0.2), (9.0, 11.0), (1e-3, 1e3)]
    exact_marks = [middle(piece) for piece in pair.pieces] + [u for u in pair.region if all(u)]
    marks += [(float(x), float(y)) for x, y in map(plane_point, exact_marks)]
    near = [
        (x * (1 + t), y * (1 + s))
        for x, y in marks
        for step in (0.0, 1e-9, 1e-11, 1e-13)
        for t, s in {(step, step), (-step, -step), (step, -step)}
    ]
    np.testing.assert_array_equal(np.sign(curve.gap(near)), [truth.side(rho) for rho in near])


MOST_CONTACTS = 50  # a hull of many vertices takes a twentieth of a second for each; evenly along the curve


def is_finite(curve: DecisionCurve) -> bool:
    """Whether no number that users see is nan, or infinite in the box."""
    shown = [x for segment in curve.segments for x in (segment.line, segment.normal, segment.start, segment.end)]
    shown += [x for point in curve.switching_points for x in (point.rho, point.lines)]
    shown += [point.contacts for point in curve.switching_points[:: 1 + len(curve.switching_points) // MOST_CONTACTS]]
    hidden = [x for chain in curve.chains for run in chain for x in (run.whole.start, run.whole.end)]
    return all(np.isfinite(x).all() for x in shown) and not any(np.isnan(x).any() for x in hidden)


def exact_lines(pair: Pair, piece: Piece) -> list[np.ndarray]:
    """(a, b, c) in lengths, rounded once, of every direction that the piece belongs to."""
    units = [pair.unit * root(dot(facet.normal, facet.normal)) for facet in piece.facets]
    return [np.array([float(x / unit) for x in f.line]) for f, unit in zip(piece.facets, units, strict=True)]


def as_read(curve: DecisionCurve, group: Group) -> Feature:
    """A group's contact; where signs tie, edges that cross within `planarity` of a corner of both touch there."""
    (region,), one, two = curve.regions, group.feature.one, group.feature.two
    if not region.is_tied or (one.kind, two.kind) != ("E", "E"):
        return group.feature
    rho = [float(x) for x in plane_point(middle(group.pieces[0]))]
    bodies = zip((curve.movable, curve.static), rho, (one, two), (curve.transform, np.eye(4)), strict=True)
    p, q = (b.placed_vertices(x, T)[np.array(own.vertices) - 1] for b, x, own, T in bodies)
    across, lengths = np.cross(p[1] - p[0], q[1] - q[0]), np.linalg.norm(p[1] - p[0]) * np.linalg.norm(q[1] - q[0])
    apart = np.linalg.norm(p[:, None] - q, axis=2)
    i, j = np.unravel_index(apart.argmin(), apart.shape)
    near = apart[i, j] <= NEAR * max(curve.movable.size * rho[0], curve.static.size * rho[1])
    if not near or np.linalg.norm(across) <= NEAR * lengths:  # or along each other
        return group.feature
    return Feature.from_label(feature_label((one.vertices[i],), (two.vertices[j],)))


def check_chains(pair: Pair, curve: DecisionCurve) -> list[list[Group]]:
    """The curve in the whole quadrant: features, lines and breakpoints."""
    expected = [[group._replace(feature=as_read(curve, group)) for group in chain] for chain in expected_chains(pair)]
    (path,) = (region.path for region in curve.regions)
    found = [[run.whole for run in chain if is_seen(run.whole)] for chain in curve.chains]
    runs = {piece.feature: piece for chain in found for piece in chain}
    assert set(runs) == {group.feature for chain in expected for group in chain}
    assert sorted(map(len, found)) == sorted(map(len, expected))
    for chain in expected:
        for k, group in enumerate(chain):
            piece = runs[group.feature]
            lines = [line for own in group.pieces for line in exact_lines(pair, own)]
            assert min(np.abs(piece.line - line).max() / np.abs(line).max() for line in lines) <= RIGHT
            others = chain[k - 1].pieces[-1], chain[(k + 1) % len(chain)].pieces[0]
            neighbours = [exact_lines(pair, other)[0] for other in others]
            ends = zip(group.ends, (piece.start, piece.end), (lines[0], lines[-1]), neighbours, strict=True)
            for end, found, own, beside in ends:
                if not end[2]:
                    assert not np.isfinite(found).all()
                    continue
                wanted = np.array([float(x) for x in plane_point(end)])
                other = beside if all(end) else (1, 0) if not end[0] else (0, 1)
                slack = RIGHT * wanted.max() * (1 if path == "exact" else condition(own, other))
                np.testing.assert_allclose(found, wanted, rtol=0, atol=slack)
    return expected


def check_listed(pair: Pair, chains: list[list[Group]], curve: DecisionCurve) -> None:
    """What is listed in the box: segments, branches, switching points with their contact features."""
    lines = box_lines(curve.box)
    inside = {group.feature: bool(in_box(group.pieces, lines)) for chain in chains for group in chain}
    assert {segment.feature for segment in curve.segments} == {feature for feature, shown in inside.items() if shown}
    corners = []
    for chain in chains:
        for before, after in pairwise([*chain, chain[0]]):
            u, v = before.ends[1], after.ends[0]
            if meets(u, v) and all(dot(line, u) > 0 for line in lines):
                flush = u != v or is_flush(pair, before.pieces[-1]) or is_flush(pair, after.pieces[0])
                corners.append((u, feature_at(pair, u, flush)))
    assert len(curve.switching_points) == len(corners)
    for end, feature in corners:
        rho = np.array([float(x) for x in plane_point(end)])
        nearest = min(curve.switching_points, key=lambda point: np.abs(point.rho - rho).max())
        assert nearest.contact_features == (feature,)
    closed = bool(chains) and all(chains[0][0].ends[0]) and len(corners) == len(chains[0]) == len(curve.segments)
    assert len(curve.branches) == len(curve.segments) - len(corners) + closed
    assert [segment.index for segment in curve.segments] == list(range(1, len(curve.segments) + 1))


def in_box(pieces: Sequence[Piece], lines: Sequence[Vec]) -> list[Piece]:
    """The pieces of which more than a point lies in the box."""
    shown = []
    for piece in pieces:
        ends = [piece.start, piece.end]
        for line in lines:
            ends = clipped(ends, line)
        shown += [piece] if len(ends) == 2 else []
    return shown


def check(case: Case) -> DecisionCurve:
    """All that exact numbers say of a case."""
    truth, curve = exact(case.one, case.two, case.pose), curve_of(case.one, case.two, case.box, case.pose)
    chains = check_chains(truth.pair, curve)
    check_listed(truth.pair, chains, curve)
    assert curve.status == truth.status(case.box)
    if all(group.feature.label == piece.label for chain in chains for group in chain for piece in group.pieces):
        check_convex(case.one, case.two, case.box, case.pose)
    check_signs(truth, curve)
    assert is_finite(curve)
    return curve


def angle_of(case: Case) -> float:
    """How far a cube of `NEARLY` is turned."""
    return float(case.name.split()[1])


def each(cases: Sequence[Case]) -> Any:
    return pytest.mark.parametrize("case", fewer(cases), ids=lambda case: case.name)


@pytest.mark.sampled(28)
@each([*ORIENTED, *FLUSH_CONTACTS, *SEEDED, *NO_OFFSET, *DIRECTED, *CLOSED])
def test_parallel_flush_and_odd_seeds(case):
    check(case)


@pytest.mark.sampled(29)
@each([*SIZE_RATIOS, *ASPECTS, *FAR_AWAY, *UNITS])
def test_sizes_and_places(case):
    check(case)


@pytest.mark.sampled(29)
@each([*MANY_POINTS, *SIDED, *TILTED, *MANY_MEET, *SMALL_NUMBERS])
def test_points_and_features(case):
    check(case)


def is_named(case: Case) -> bool:
    """Whether exact numbers tell what touches: not where faces share a strip that is no wider than `planarity`."""
    return angle_of(case) > BAND[1] or (angle_of(case) < BAND[0] and not case.name.startswith("edge"))


@pytest.mark.sampled(29)
@each([case for case in NEARLY if is_named(case)])
def test_nearly_parallel(case):
    check(case)


@each([*(case for case in NEARLY if not is_named(case)), *FAR_TILTED])
def test_flush_or_not_the_curve_is_right(case):
    """Where faces are about as far from parallel or planar as `planarity`, any labels will do."""
    truth, curve = exact(case.one, case.two, case.pose), curve_of(case.one, case.two, case.box, case.pose)
    chains = exact_chains(truth.pair)
    assert len(curve.chains) == len(chains)
    assert curve.status == truth.status(case.box)
    for x in np.geomspace(*case.box[0], 9):
        np.testing.assert_allclose(curve.crossings(x), [float(y) for y in truth.crossings(x, case.box)], rtol=RIGHT)
    for piece in in_box(truth.pair.pieces, box_lines(case.box)):
        rho = [float(x) for x in plane_point(middle(piece))]
        assert curve.locate(rho, RIGHT) is not None
    for branch in curve.branches:
        for before, after in pairwise(branch.segments):
            np.testing.assert_allclose(before.end, after.start, rtol=RIGHT)
    check_signs(truth, curve)
    assert is_finite(curve)


# ------------------------------------------------------------------------------------- curves at the border of the box


@pytest.mark.parametrize(
    ("shift", "box", "status"),
    [
        ((2, 0, 0), ((1, 3), (1, 3)), "overlapping"),  # rho_1 + rho_2 = 2 meets the lower corner
        ((2, 2, 2), ((1, 3), (1, 3)), "overlapping"),
        ((6, 0, 0), ((1, 3), (1, 3)), "apart"),  # and 6 the upper one
        ((6, 6, 0), ((1, 3), (1, 3)), "apart"),
        ((2, 0, 0), ((1.25, 3), (0.75, 3)), "overlapping"),
        ((6, 0, 0), ((0.5, 2.5), (0.5, 3.5)), "apart"),
    ],
)
def test_a_curve_through_a_corner_of_the_box_only(shift, box, status):
    curve = curve_of(CUBE, CUBE.shifted(shift), box)
    assert (curve.status, curve.segments, curve.branches, curve.switching_points) == (status, (), (), ())
    (x0, x1), (y0, y1) = box
    corner = (x0, y0) if status == "overlapping" else (x1, y1)
    assert curve.gap(corner) == 0
    assert curve.locate(corner) is not None
    np.testing.assert_allclose(curve.crossings(corner[0]), [corner[1]], rtol=1e-15)


def test_a_curve_along_a_side_of_the_box():
    """Body 2 with its seed on the face that is touched: rho_1 = 2 whatever rho_2."""
    two = seeded(CUBE, (-1, 0, 0)).shifted((3, 0, 0))
    for low, high, shown in [(2, 3, 1), (1, 2, 1), (1, 1.5, 0), (2.5, 3, 0)]:
        curve = curve_of(CUBE, two, ((low, high), (1, 3)))
        assert len(curve.segments) == len(curve.branches) == shown
        for segment in curve.segments:
            np.testing.assert_array_equal(np.sort([segment.start, segment.end], axis=0), [[2, 1], [2, 3]])
        assert curve.status == ("contact" if shown else "apart" if high < 2 else "overlapping")


@pytest.mark.parametrize(
    ("box", "segments"),
    [
        (((1, 3), (0.25, 3)), 1), (((0.5, 1), (1, 3)), 1), (((1, 2), (1, 2)), 0), (((0.5, 1), (0.5, 1)), 0),
        (((0.5, 1), (0.5, 1.1)), 1), (((0.5, 1.5), (0.5, 1.5)), 2),
    ],
)  # fmt: skip
def test_a_switching_point_on_the_border_of_the_box(box, segments):
    """Lines rho_1 + 3 rho_2 = 4 and 2 rho_1 + rho_2 = 3 of the boxes meet in (1, 1)."""
    curve = curve_of(SLAB, BLOCK.shifted((4, 3, 0)), box)
    assert len(curve.segments) == segments
    assert [point.rho.tolist() for point in curve.switching_points] == [[1, 1]]
    assert curve.gap((1, 1)) == 0
    assert is_finite(curve)


# --------------------------------------------------------------------------------------------- many sides and vertices


STEPS = (-1e-9, -1e-11, -1e-13, 0.0, 1e-13, 1e-11, 1e-9)


def check_proved(one: Body, two: Body, steps: Sequence[float] = STEPS, most: int | None = None) -> DecisionCurve:
    """Both seeds inside: one chain from axis to axis, proved on, above and below it by the vertices alone."""
    curve = decision_curve(one, two, box=ODD_BOX)
    (chain,), (P,), (Q,) = curve.chains, one.parts, two.parts
    truth = exact_rational(P, Q)
    pieces = [run.whole for run in chain]
    assert (pieces[0].start[0], pieces[-1].end[1]) == (0, 0)
    for before, after in pairwise(pieces):
        np.testing.assert_allclose(before.end, after.start, rtol=RIGHT, atol=0)
    places = [(piece.start + piece.end) / 2 for piece in pieces] + [piece.end for piece in pieces[:-1]]
    for rho in places[:most]:
        sides = []
        for step in steps:
            near = rho * (1 + step)
            verdict = judged(truth, near.tolist())
            assert proves(P, Q, None, near.tolist(), verdict)
            assert np.sign(curve.gap(near)) == verdict.side
            sides.append(verdict.side)
        assert (sides[0], sides[-1]) == (1, -1)
    assert curve.gap((0.01, 0.01)) > 0 > curve.gap((50.0, 50.0))
    assert is_finite(curve)
    return curve


SIDES = fewer([3, 4, 5, 8, 30, 101, 360])
# A thousand sides take rational numbers for a minute: they are in the stability map's full form.
POSED = [
    pytest.param(sides, pose, id=f"{name}-{sides}")
    for name, pose in (("straight", np.eye(4)), ("tilted", TILT))
    for sides in SIDES
]


@pytest.mark.sampled(4)
@pytest.mark.parametrize(("sides", "pose"), POSED)
def test_prisms_and_pyramids_of_many_sides_on_each_other(sides, pose):
    """Caps at heights 1, seeds at 0 and -1/2: closed forms whatever the number of sides."""
    rows, cone = prism_points(sides), pyramid_points(sides)
    up, down = np.array([0, 0, 3.5]), np.array([1, 1, -1])
    top, base = set(range(sides + 1, 2 * sides + 1)), set(range(1, sides + 1))
    for first, second, seeds, line, kind, touching in [
        (rows, rows + up, (0.0, 3.5), (1, 1, 3.5), "F1F2", (top, base)),
        (cone, rows + up, (-0.5, 3.5), (1.5, 1, 4), "V1F2", ({sides + 1}, base)),
        (cone * down, cone + up, (0.5, 3.0), (0.5, 0.5, 2.5), "F1F2", (base, base)),
    ]:
        shapes = zip((first, second), seeds, strict=True)
        one, two = (Body.convex(x @ pose[:3, :3].T, seed=pose[:3, :3] @ (0, 0, z)) for x, z in shapes)
        curve = decision_curve(one, two, box=ODD_BOX)
        (segment,) = curve.segments
        assert segment.feature.kind == kind
        assert (set(segment.feature.one.vertices), set(segment.feature.two.vertices)) == touching
        np.testing.assert_allclose(segment.line, line, rtol=0, atol=4e-15 * max(line))
        assert curve.switching_points == ()


@pytest.mark.parametrize(("sides", "pose"), POSED)
def test_prisms_of_many_sides_beside_each_other(sides, pose):
    """Side k of a prism has its normal at (2 k + 1) pi / sides, and the height cos(pi / sides)."""
    rows, d = prism_points(sides), np.array([2.5, 0.75, 0.25])
    one, two = (Body.convex((rows + z) @ pose[:3, :3].T, seed=pose[:3, :3] @ z) for z in (np.zeros(3), d))
    curve = check_proved(one, two)
    angles, corners = (2 * np.arange(sides) + 1) * np.pi / sides, ring(sides)
    outward = np.column_stack([np.cos(angles), np.sin(angles)])
    for x in (0.5, 1.0, 2.0):
        # the scale of body 2 up to which a side of one, or the other, separates
        of_one = (outward @ d[:2] - x * np.cos(np.pi / sides)) / (-outward @ corners.T).max(axis=1)
        of_two = (-outward @ d[:2] - x * (-outward @ corners.T).max(axis=1)) / np.cos(np.pi / sides)
        np.testing.assert_allclose(curve.rho2(x), max(of_one.max(), of_two.max()), rtol=RIGHT)


def cloud(seed: int, count: int) -> np.ndarray:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1)[:, None]


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), fewer([(4, 4), (1000, 4), (300, 300)]))
def test_hulls_of_few_and_many_vertices(first, second):
    one, two = (TETRAHEDRON.array if count == 4 else cloud(count, count) for count in (first, second))
    check_proved(Body.convex(one), Body.convex(two + np.array([2.5, 1, 0.5])))


@pytest.mark.slow
def test_a_hull_of_tens_of_thousands_of_vertices():
    """All but a ball about its seed: its distance from a vertex is that of the centre, less the radius.

    Facets turn by about t = (4 pi / N)^(1/2) from one to the next, so that the hull stays within t^2 of the ball, and
    the largest separation over facet directions within t^2 times the distance of the distance.
    """
    count = 30_000 if len(fewer(range(2))) == 2 else 2_000
    seed = np.array([4.0, 4.0, 4.5])
    one, two = TETRAHEDRON.body(), Body.convex(cloud(2, count) + seed, seed=seed)
    curve = check_proved(one, two, steps=(-1e-11, 1e-11), most=1)
    assert len(two.parts[0].vertices) == count
    for rho in ((1.0, 1.0), (2.0, 1.5), (0.5, 3.0)):
        distance = np.linalg.norm(seed - rho[0]) - rho[1]
        assert curve.gap(rho) == pytest.approx(distance, abs=(distance + rho[1]) * 10 * 4 * np.pi / count)
