"""Contact equations in CasADi against exact rationals, numeric kernels, finite differences and the paper's forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache, partial
from itertools import combinations_with_replacement, product
from typing import Any

import casadi
import numpy as np
import pytest
from cases import CUBE
from contact_truth import exact_line, line_of, placed
from hypothesis import given
from oracles import cross, minus
from strategies import generators, random_rotation, runs

from fcdm_opt.curve import kernels
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.model.equations import KINDS, FeaturePoints, contact_line, feature_points, switching_point
from fcdm_opt.motion.motions import Motion, Rotation, Screw, Translation

LINE = ((0.4, -1.2, 0.7), (1.0, 2.0, -0.5))
MOTIONS = {
    "translation along an axis": Translation("-y"),
    "translation along a vector": Translation((1.0, 2.0, -2.0)),
    "rotation about the seed": Rotation("z"),
    "rotation about the origin": Rotation((1.0, -1.0, 0.5), "origin"),
    "rotation about a point": Rotation("-x", (0.3, -2.0, 0.5)),
    "screw of the seeds, fixed pitch": Screw("seeds", 0.3),
    "screw of the seeds, free": Screw("seeds"),
    "screw of the seeds, no pitch": Screw("seeds", 0.0),
    "screw of the seeds, infinite pitch": Screw("seeds", math.inf),
    "screw of a line, fixed pitch": Screw(LINE, -1.5),
    "screw of a line, free": Screw(LINE),
    "screw of a line, infinite pitch": Screw(LINE, -math.inf),
    "translation, then rotation": Translation("z") >> Rotation("z", "origin"),
    "rotation, translation, screw": Rotation("x") >> Translation("y") >> Screw("seeds"),
    "two turns of the seeds' line": Screw("seeds", 0.2) >> Translation("x") >> Screw("seeds"),
}
KIND_PAIRS = list(product(KINDS, KINDS))
PAIR = (1.1, 0.9)  # some scales
OWNED = {F1V2: (1, 1, 1, 0), V1F2: (1, 0, 0, 0), E1E2: (1, 1, 0, 0)}  # which of the four points are body 1's
EVERY_MOTION = pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)


@cache
def scene(number: int) -> tuple[Body, Body]:
    """Two random hulls, some distance apart, seeds off their centres."""
    rng = np.random.default_rng([77, number])
    one, two = rng.normal(size=(8, 3)), rng.normal(size=(7, 3)) + rng.uniform(2.5, 4.0) * random_rotation(rng)[0]
    return Body.convex(one, seed=one.mean(axis=0) + 0.1), Body.convex(two, seed=two.mean(axis=0))


def some_q(motion: Motion, rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-1.2, 1.2, len(motion.parameters))


def transform(motion: Motion, q: Any, one: Body, two: Body) -> np.ndarray:
    return motion.transform(q, one.seed, two.seed)


def seeds_of(one: Body, two: Body) -> np.ndarray:
    return np.concatenate([one.seed, two.seed])


def called(function: Any, *arguments: Any) -> list[np.ndarray]:
    return [np.asarray(out).ravel() for out in map(casadi.DM.full, function(*arguments))]


def unit_row(motion: Motion, q: Any, one: Body, two: Body, feature: FeaturePoints) -> np.ndarray:
    """(n, a, b, c) of a template, normalised."""
    line, normal, _ = called(contact_line(motion, feature.kind), q, seeds_of(one, two), feature.values, PAIR)
    return np.concatenate([normal, line]) / np.linalg.norm(normal)


def tracked(motion: Motion, q: Any, one: Body, two: Body, feature: FeaturePoints) -> np.ndarray:
    """(n, a, b, c) of the kernels; a face's normal points outwards, an edge pair's as the feature's sign says."""
    pose = relative_pose(one, two, transform(motion, q, one, two))
    return kernels.tracked_row(*one.parts[0].packed, *two.parts[0].packed, pose, np.array(feature.site), feature.sign)


def random_site(rng: np.random.Generator, kind: int, one: Body, two: Body) -> tuple[int, int, int]:
    names = {F1V2: "FV", V1F2: "VF", E1E2: "EE"}[kind]
    counts = [len(body.parts[0].elements[name]) for body, name in zip((one, two), names, strict=True)]
    return (kind, int(rng.integers(counts[0])), int(rng.integers(counts[1])))


def any_feature(rng: np.random.Generator, kind: int, one: Body, two: Body) -> FeaturePoints:
    """A pair of elements, whether or not they can touch."""
    return feature_points(one, two, random_site(rng, kind, one, two), (0, 0), rng.normal(size=3), np.eye(3))


def sine_of(lines: np.ndarray) -> float:
    """Sine of the angle between two lines."""
    (a, b, _), (d, e, _) = lines
    return float((a * e - b * d) / np.hypot(a, b) / np.hypot(d, e))


# ----------------------------------------------------------------------------------- against exact rational arithmetic


@EVERY_MOTION
def test_contact_lines_equal_the_exact_line_of_the_pose(motion):
    rng = np.random.default_rng(1)
    for number, kind in product(range(4), KINDS):
        one, two = scene(number)
        q = some_q(motion, rng)
        T = transform(motion, q, one, two)
        feature = any_feature(rng, kind, one, two)
        points = [
            placed(one, [point], T)[0] if own else placed(two, [point])[0]
            for own, point in zip(OWNED[kind], feature.points.T, strict=True)
        ]
        p, r, s, t = (arm for _, arm in points)
        spans = {F1V2: (r, p, s, p), V1F2: (s, r, t, r), E1E2: (r, p, t, s)}[kind]
        n = cross(minus(*spans[:2]), minus(*spans[2:]))
        expected = np.array([float(x) for x in (*n, *line_of(n, points[0], points[3]))]) * feature.sign
        length = np.linalg.norm(expected[:3])
        row = unit_row(motion, q, one, two, feature)
        size = max(one.size, two.size, np.abs(expected[3:]).max() / length)
        np.testing.assert_allclose(row, expected / length, rtol=0, atol=1e-12 * size)


@pytest.mark.sampled(13)
@EVERY_MOTION
@pytest.mark.parametrize("kinds", KIND_PAIRS, ids=str)
def test_switching_points_equal_the_exact_meeting_of_two_lines(motion, kinds):
    rng = np.random.default_rng(2)
    one, two = scene(5)
    labels = {F1V2: "FV", V1F2: "VF", E1E2: "EE"}
    tried, compared = 20, 0
    for _ in range(tried):
        q = some_q(motion, rng)
        T = transform(motion, q, one, two)
        sites = [random_site(rng, kind, one, two) for kind in kinds]
        features = [feature_points(one, two, site, (0, 0), rng.normal(size=3), np.eye(3)) for site in sites]
        exact = []
        for kind, *elements in sites:
            named = [body.parts[0].elements[name][k] for body, name, k in zip((one, two), labels[kind], elements,
                                                                              strict=True)]  # fmt: skip
            exact.append(exact_line(one, two, Feature(*named), T))
        (a, b, c), (d, e, f) = exact
        determinant = a * e - b * d
        rho, (sine,) = called(switching_point(motion, kinds), q, seeds_of(one, two), *(x.values for x in features))
        steep = math.hypot(a, b) * math.hypot(d, e)
        if steep == 0 or abs(determinant) < 1e-2 * steep:
            continue
        compared += 1
        expected = [float((c * e - b * f) / determinant), float((a * f - c * d) / determinant)]
        np.testing.assert_allclose(rho, expected, rtol=1e-12 * steep / abs(float(determinant)), atol=1e-12)
        assert abs(sine) == pytest.approx(abs(float(determinant)) / steep, rel=1e-10)
    assert compared >= tried // 2


# ------------------------------------------------------------------------------------------ against the numeric kernels


@runs(60)
@given(generators)
def test_every_facet_row_of_the_kernels_is_a_template_row(rng):
    one, two = scene(int(rng.integers(20)))
    motion = list(MOTIONS.values())[int(rng.integers(len(MOTIONS)))]
    q = some_q(motion, rng)
    pose = relative_pose(one, two, transform(motion, q, one, two))
    rotation = pose[:9].reshape(3, 3)
    sites, rows = kernels.facet_rows(*one.parts[0].packed, *two.parts[0].packed, pose)
    assert set(sites[:, 0]) == set(KINDS)
    compared = 0
    for site, row in zip(sites, rows, strict=True):
        kind, i, j = (int(x) for x in site)
        feature = feature_points(one, two, (kind, i, j), (0, 0), row[:3], rotation)
        lengths = [np.linalg.norm(np.ptp(feature.points[:, cut], axis=1)) for cut in (slice(0, 3), slice(1, 4))]
        if feature.steepness(rotation) < 1e-2 * lengths[0] * lengths[1]:
            continue  # nearly parallel edges: their normal itself is uncertain
        compared += 1
        found = unit_row(motion, q, one, two, feature)
        np.testing.assert_allclose(found, row, rtol=0, atol=1e-12 * max(one.size, two.size, np.abs(row).max()))
    assert compared > 0.7 * len(sites)


@EVERY_MOTION
@pytest.mark.parametrize("kind", KINDS)
def test_a_tracked_feature_keeps_its_line_and_orientation_along_the_motion(motion, kind):
    rng = np.random.default_rng(3)
    one, two = scene(7)
    feature = any_feature(rng, kind, one, two)
    q = some_q(motion, rng)
    for s in np.linspace(0.0, 1.0, 9):
        row = tracked(motion, s * q, one, two, feature)
        found = unit_row(motion, s * q, one, two, feature)
        if kind != E1E2:
            found *= np.sign(found[:3] @ row[:3])
        np.testing.assert_allclose(found, row, rtol=0, atol=1e-12 * max(one.size, two.size, np.abs(row).max()))


@given(generators)
def test_the_sign_points_the_normal_the_way_asked_for_at_the_pose_asked_for(rng):
    one, two = scene(int(rng.integers(20)))
    R, wanted = random_rotation(rng), rng.normal(size=3)
    for kind in KINDS:
        feature = feature_points(one, two, random_site(rng, kind, one, two), (0, 0), wanted, R)
        at_centre = Rotation("z", "origin")  # any motion: at rest it gives the normal of the bodies as drawn
        turned = one.moved(np.block([[R, np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]]))
        points = feature.points.copy()
        for k, owned in enumerate(OWNED[kind]):
            points[:, k] = R @ points[:, k] if owned else points[:, k]
        values = np.append(points.ravel(order="F"), feature.sign)
        _, normal, _ = called(contact_line(at_centre, kind), [0.0], seeds_of(turned, two), values, PAIR)
        assert normal @ wanted > 0
        assert np.linalg.norm(normal) == pytest.approx(feature.steepness(R), rel=1e-12)


# --------------------------------------------------------------------------------------------------------- derivatives

STENCIL = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}  # central differences of order six
STEP = 1e-2


def differences(function: Callable[[np.ndarray], np.ndarray], q: np.ndarray) -> np.ndarray:
    """Jacobian by central differences: error about STEP^6 / 140 times a seventh derivative, and 1e-14 of rounding."""
    columns = [
        sum(weight * (function(q + k * step) - function(q - k * step)) for k, weight in STENCIL.items()) / STEP
        for step in STEP * np.eye(len(q))
    ]
    return np.column_stack(columns)


@cache
def row_jacobian(motion: Motion, kind: int) -> Any:
    q, seeds, feature = (casadi.SX.sym(name, n) for name, n in (("q", len(motion.parameters)), ("s", 6), ("f", 13)))
    line, normal, _ = contact_line(motion, kind)(q, seeds, feature, PAIR)
    row = casadi.vertcat(normal, line) / casadi.norm_2(normal)
    return casadi.Function("row_jacobian", [q, seeds, feature], [casadi.jacobian(row, q)])


@EVERY_MOTION
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("at_rest", [True, False])
def test_derivatives_of_contact_lines_equal_differences_of_the_kernels(motion, kind, at_rest):
    rng = np.random.default_rng(4)
    one, two = scene(9)
    feature = any_feature(rng, kind, one, two)
    q = np.zeros(len(motion.parameters)) if at_rest else some_q(motion, rng)
    found = row_jacobian(motion, kind)(q, seeds_of(one, two), feature.values).full()
    assert np.isfinite(found).all()

    facing = np.sign(tracked(motion, q, one, two, feature)[:3] @ unit_row(motion, q, one, two, feature)[:3])
    expected = differences(lambda x: facing * tracked(motion, x, one, two, feature), q)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * max(1.0, np.abs(expected).max()))


@pytest.mark.sampled(40)
@EVERY_MOTION
@pytest.mark.parametrize("kinds", list(combinations_with_replacement(KINDS, 2)), ids=str)
def test_derivatives_of_switching_points_equal_differences_of_the_kernels(motion, kinds):
    rng = np.random.default_rng(6)
    one, two = scene(11)
    seeds = seeds_of(one, two)
    for at_rest in (True, False):
        q = np.zeros(len(motion.parameters)) if at_rest else some_q(motion, rng)

        def lines(x: np.ndarray, features: list[FeaturePoints]) -> np.ndarray:
            return np.array([tracked(motion, x, one, two, feature)[3:] for feature in features])

        features = [any_feature(rng, kind, one, two) for kind in kinds]
        while abs(sine_of(lines(q, features))) < 0.5:  # else the differences themselves are poor
            features = [any_feature(rng, kind, one, two) for kind in kinds]
        x, s = casadi.SX.sym("x", len(q)), casadi.SX.sym("s", 6)
        f, g = casadi.SX.sym("f", 13), casadi.SX.sym("g", 13)
        rho, sine = switching_point(motion, kinds)(x, s, f, g)
        jacobian = casadi.Function("jacobian", [x, s, f, g], [casadi.jacobian(rho, x), casadi.jacobian(sine, x)])
        found, slope = (m.full() for m in jacobian(q, seeds, *(feature.values for feature in features)))

        def meeting(y: np.ndarray, own: list[FeaturePoints]) -> np.ndarray:
            made = lines(y, own)
            return np.linalg.solve(made[:, :2], made[:, 2])

        expected = differences(partial(meeting, own=features), q)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * max(1.0, np.abs(expected).max()))
        assert np.isfinite(slope).all()


# ------------------------------------------------------------------------------------- the appendix in the paper's form


def dot3(u: Any, v: Any) -> float:
    return float(np.dot(u, v))


def det3(*columns: Any) -> float:
    return float(np.linalg.det(np.column_stack(columns)))


class Appendix:
    """The paper's equations (i) to (v), index slips corrected.

    A face vertex pair is (n, v1, c2): n normal of the face, v1 the touching point of body 1, c2 that of body 2. An
    edge pair is (v11, v12, v21, v22): the ends of both edges. Body 1 and its seed s1 as moved.
    """

    def __init__(self, s1: np.ndarray, s2: np.ndarray) -> None:
        self.s1, self.s2 = s1, s2

    def dots(self, n: Any, v1: Any, c2: Any) -> tuple[float, float, float]:
        """n.(v1 - s1), n.(s1 - s2), n.(c2 - s2): "nas", "nss", "ncs"."""
        return dot3(n, v1 - self.s1), dot3(n, self.s1 - self.s2), dot3(n, c2 - self.s2)

    def dets(self, v11: Any, v12: Any, v21: Any, v22: Any) -> tuple[float, float, float]:
        """det[VV], det[VS], det[A] with columns e1, (v11 - s1 | s1 - s2 | v21 - s2), e2."""
        e1, e2 = v12 - v11, v22 - v21
        return tuple(det3(e1, x, e2) for x in (v11 - self.s1, self.s1 - self.s2, v21 - self.s2))

    def face_vertex(self, pair: Any, rho1: float) -> float:
        nas, nss, ncs = self.dots(*pair)
        return (rho1 * nas + nss) / ncs

    def edge_edge(self, pair: Any, rho1: float) -> float:
        v11, v12, v21, v22 = pair
        e1, e2 = v12 - v11, v22 - v21
        return det3(e1, self.s1 - self.s2 + rho1 * (v11 - self.s1), e2) / det3(e1, v21 - self.s2, e2)

    def between_face_and_edges(self, face: Any, edges: Any) -> tuple[float, float]:
        (nas, nss, ncs), (VV, VS, A) = self.dots(*face), self.dets(*edges)
        rho1 = (ncs * VS - nss * A) / (nas * A - ncs * VV)
        return rho1, self.face_vertex(face, rho1)

    def between_edges(self, edges: Any, others: Any) -> tuple[float, float]:
        (VV, VS, A), (VV_, VS_, A_) = self.dets(*edges), self.dets(*others)
        rho1 = (VS_ * A - VS * A_) / (VV * A_ - VV_ * A)
        return rho1, self.edge_edge(edges, rho1)

    def between_faces(self, face: Any, other: Any) -> tuple[float, float]:
        (nas, nss, ncs), (nas_, nss_, ncs_) = self.dots(*face), self.dots(*other)
        rho1 = (-nss * ncs_ + nss_ * ncs) / (nas * ncs_ - nas_ * ncs)
        return rho1, self.face_vertex(face, rho1)


def appendix_terms(feature: FeaturePoints, T: np.ndarray) -> Any:
    """A feature's vertices in the paper's roles, body 1 moved; normals scaled at will, as every ratio allows."""
    moved = feature.points.T @ T[:3, :3].T + T[:3, 3]
    p, q, r, s = np.where(np.array(OWNED[feature.kind])[:, None] == 1, moved, feature.points.T)
    if feature.kind == F1V2:
        return np.cross(q - p, r - p), p, s
    return (np.cross(r - q, s - q), p, q) if feature.kind == V1F2 else (p, q, r, s)


@EVERY_MOTION
def test_contact_lines_are_the_appendix_equations_i_and_ii(motion):
    rng = np.random.default_rng(8)
    one, two = scene(13)
    for kind in KINDS * 3:
        q = some_q(motion, rng)
        T = transform(motion, q, one, two)
        paper = Appendix(T[:3, :3] @ one.seed + T[:3, 3], two.seed)
        feature = any_feature(rng, kind, one, two)
        (a, b, c), *_ = called(contact_line(motion, kind), q, seeds_of(one, two), feature.values, PAIR)
        form = paper.edge_edge if kind == E1E2 else paper.face_vertex
        for rho1 in (0.3, 1.0, 2.7):
            expected = form(appendix_terms(feature, T), rho1)
            assert (c - a * rho1) / b == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.sampled(50)
@EVERY_MOTION
@pytest.mark.parametrize("kinds", KIND_PAIRS, ids=str)
def test_switching_points_are_the_appendix_equations_iii_to_v(motion, kinds):
    rng = np.random.default_rng(10)
    one, two = scene(15)
    checked = 0
    while checked < 3:
        q = some_q(motion, rng)
        T = transform(motion, q, one, two)
        paper = Appendix(T[:3, :3] @ one.seed + T[:3, 3], two.seed)
        features = [any_feature(rng, kind, one, two) for kind in kinds]
        rho, (sine,) = called(switching_point(motion, kinds), q, seeds_of(one, two), *(f.values for f in features))
        terms = [appendix_terms(feature, T) for feature in features]
        lines = [paper.dets(*t) if len(t) == 4 else paper.dots(*t) for t in terms]
        if not abs(sine) > 0.05 or min(abs(line[2]) / np.linalg.norm(line) for line in lines) < 0.05:
            continue  # the paper's forms divide by b and by the determinant
        checked += 1
        edges = [kind == E1E2 for kind in kinds]
        if edges == [False, True]:
            expected = paper.between_face_and_edges(*terms)
        elif edges == [True, False]:
            expected = paper.between_face_and_edges(*terms[::-1])
        else:
            expected = (paper.between_edges if all(edges) else paper.between_faces)(*terms)
        np.testing.assert_allclose(rho, expected, rtol=1e-9, atol=1e-9)


# ---------------------------------------------------------------------------------------------- lines that are parallel


def faces_and_corners(shift: tuple[float, float, float]) -> tuple[Body, Body, dict[str, FeaturePoints]]:
    """Two cubes of half-width 1; the features of their x, y and z faces: lines rho_1 + rho_2 = shift."""
    one, two = CUBE.body("one"), CUBE.shifted(shift).body("two")
    part, other = one.parts[0], two.parts[0]
    made = {}
    for axis, name in enumerate("xyz"):
        face = int(np.argmax(part.normals[:, axis]))
        corner = int(np.argmin(other.vertices @ [1.0, 1.0, 1.0]))
        made[name] = feature_points(one, two, (F1V2, face, corner), (0, 0), np.eye(3)[axis], np.eye(3))
    return one, two, made


def test_parallel_lines_have_sine_zero_and_no_finite_point():
    one, two, features = faces_and_corners((4.0, 5.0, 6.0))
    motion = Translation("x")
    function = switching_point(motion, (F1V2, F1V2))
    for first, second in product("xyz", "xyz"):
        rho, (sine,) = called(function, [0.25], seeds_of(one, two), features[first].values, features[second].values)
        assert sine == 0
        assert not np.isfinite(rho).any()


@pytest.mark.parametrize("slope", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
def test_nearly_parallel_lines_have_a_sine_as_small_as_their_angle(slope):
    one, two, features = faces_and_corners((4.0, 5.0, 6.0))
    points = features["y"].points.copy()
    points[1, 3] += slope  # the corner of body 2 lower: rho_1 + (1 - slope) rho_2 = 5, exactly so for rounded numbers
    values = np.append(points.ravel(order="F"), features["y"].sign)
    q, function = [0.25], switching_point(Translation("x"), (F1V2, F1V2))
    rho, (sine,) = called(function, q, seeds_of(one, two), features["x"].values, values)
    rest = points[1, 3] - two.seed[1]  # -(1 - slope)
    assert abs(sine) == pytest.approx(abs(rest + 1.0) / math.hypot(1, rest) / math.sqrt(2), rel=1e-9)
    assert np.isfinite(rho).all()
    exact = (5.0 - 3.75) / (-rest - 1.0)
    assert rho[1] == pytest.approx(exact, rel=1e-9)


def test_parallel_edges_have_no_line_and_no_finite_point():
    one, two = CUBE.body("one"), CUBE.shifted((4, 4, 4)).body("two")
    edges = [next(k for k, e in enumerate(b.parts[0].elements["E"]) if e == Element("E", (1, 5))) for b in (one, two)]
    feature = feature_points(one, two, (E1E2, edges[0], edges[1]), (0, 0), np.array([1.0, 0.0, 0.0]), np.eye(3))
    line, normal, _ = called(contact_line(Translation("x"), E1E2), [0.5], seeds_of(one, two), feature.values, PAIR)
    assert not line.any()
    assert not normal.any()
    _, _, features = faces_and_corners((4.0, 4.0, 4.0))
    rho, (sine,) = called(
        switching_point(Translation("x"), (E1E2, F1V2)),
        [0.5],
        seeds_of(one, two),
        feature.values,
        features["x"].values,
    )
    assert not abs(sine) > 0
    assert not np.isfinite(rho).any()


@runs(200)
@given(generators)
def test_a_switching_point_is_finite_exactly_where_its_sine_is_not_zero(rng):
    corners = rng.integers(-2, 3, (2, 3, 4)).astype(float)
    seeds = rng.integers(-2, 3, 6).astype(float)
    kinds = tuple(int(k) for k in rng.choice(KINDS, 2))
    values = [np.append(points.ravel(order="F"), rng.choice([-1.0, 1.0])) for points in corners]
    rho, (sine,) = called(switching_point(Translation("x") >> Rotation("z"), kinds), [0.0, 0.0], seeds, *values)
    assert np.isfinite(rho).all() == bool(abs(sine) > 0)


# ------------------------------------------------------------------------------------------------ one template for all


@EVERY_MOTION
def test_one_compiled_template_serves_every_feature_of_a_kind(motion):
    rng = np.random.default_rng(12)
    for kind in KINDS:
        function = contact_line(motion, kind)
        lines = set()
        for number in range(3):
            one, two = scene(number)
            feature = any_feature(rng, kind, one, two)
            lines.add(tuple(unit_row(motion, some_q(motion, rng), one, two, feature)))
            assert contact_line(motion, kind) is function
        assert len(lines) == 3
    assert all(switching_point(motion, kinds) is switching_point(motion, kinds) for kinds in KIND_PAIRS)


def test_equal_motions_share_a_template_and_different_ones_do_not():
    first, second = (Translation("z") >> Rotation("z", "origin") for _ in range(2))
    assert first is not second
    assert contact_line(first, E1E2) is contact_line(second, E1E2)
    assert switching_point(first, (F1V2, E1E2)) is switching_point(second, (F1V2, E1E2))
    others = [Translation("z") >> Rotation("z"), Rotation("z", "origin") >> Translation("z"), Translation("z")]
    made = [contact_line(motion, E1E2) for motion in (first, *others)]
    assert len({id(function) for function in made}) == 4


def test_templates_name_their_inputs_and_outputs():
    line, point = contact_line(Translation("x"), F1V2), switching_point(Translation("x"), (F1V2, V1F2))
    assert line.name_in() == ["q", "seeds", "feature", "rho"]
    assert line.name_out() == ["line", "normal", "gap"]
    assert point.name_in() == ["q", "seeds", "feature_1", "feature_2"]
    assert point.name_out() == ["rho", "sine"]


@pytest.mark.parametrize("corners", [3, 4, 5, 9, 12])
def test_a_face_is_represented_by_three_of_its_corners_that_span_much_of_it(corners):
    around = 2 * math.pi * np.arange(corners) / corners
    rim = np.column_stack([np.cos(around), np.sin(around), np.zeros(corners)])
    one, two = Body.convex([*rim, (0, 0, 1.0)]), CUBE.shifted((0, 0, -4)).body("two")
    face = int(np.argmin(one.parts[0].normals[:, 2]))
    feature = feature_points(one, two, (F1V2, face, 0), (0, 0), np.array([0, 0, -1.0]), np.eye(3))
    best = 2 * 3 * math.sqrt(3) / 4  # no triangle in a circle is larger
    assert feature.steepness(np.eye(3)) > 0.7 * best
    assert feature.values.shape == (13,)
    with pytest.raises(ValueError, match="read-only"):
        feature.points[0, 0] = 1.0
