"""Drawn pairs are what they are said to be; references are the oracle's; planted errors are measured and found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from cases import CUBE, OCTAHEDRON, exact
from curve_checks import ODD_BOX
from oracles import exact_curve as oracle
from oracles import plane_point
from strategies import random_pair

import fcdm_opt.curve.exact
from fcdm_opt import Body, decision_curves
from fcdm_opt.curve.batch import DecisionCurves
from fcdm_opt.errors import FcdmError, InputError
from fcdm_opt_benchmarks.method import ContactAnswer, ContactQuestion, CurveAnswer, CurveQuestion, Pair, Touching
from fcdm_opt_benchmarks.pairs import SEPARATIONS, SHAPES, DrawnPair, why_not
from fcdm_opt_benchmarks.references import (
    ExactStretches,
    contact_error,
    curve_error,
    exact_contact,
    exact_curve_in_box,
    feature_faults,
    touching_right,
)

IDENTITY = np.eye(4)


def fraction(x: Any) -> Fraction:
    return Fraction(int(x.p), int(x.q))


# --------------------------------------------------------------------------------------------------------- drawn pairs


@pytest.mark.parametrize("separation", SEPARATIONS)
@pytest.mark.parametrize("shape", SHAPES)
def test_drawn_pairs_lie_as_far_apart_as_asked(shape: str, separation: str) -> None:
    drawn = DrawnPair.of(1, 8, shape, separation)
    low, high, unit = SEPARATIONS[separation]
    for k in range(3):
        question = drawn.contact(k)
        movable, static = drawn.pair
        pair = oracle(movable.vertices, movable.seed, static.vertices, static.seed, pose=question.transform).pair
        diagonal = float(max(Fraction(f.line[2], f.line[0] + f.line[1]) for f in pair.facets))
        assert low - 1e-9 <= diagonal <= high + 1e-9
        found = pair.interval(question.rho1)
        assert found is not None
        assert found[0] > 0  # body 2 has a least scale that touches
        assert pair.side((unit * 0.8, unit * 0.8)) > 0 > pair.side((unit * 3.0, unit * 3.0))  # the curve is in the box


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("vertices", [8, 20, 100])
def test_drawn_hulls_have_their_vertices(shape: str, vertices: int) -> None:
    drawn = DrawnPair.of(2, vertices, shape)
    assert [len(body.parts[0].vertices) for body in drawn.pair] == [vertices, vertices]
    poses = drawn.transforms(50)
    assert len(np.unique(poses.reshape(50, -1), axis=0)) == 50
    again = DrawnPair.of(2, vertices, shape)
    assert (again.curve(7).transform == poses[7]).all()
    assert again.contact(7).rho1 == drawn.contact(7).rho1
    assert drawn.curve(7).transform is not drawn.curve(7).transform  # made anew for each who asks


def test_aligned_hulls_stay_parallel() -> None:
    """Every side of one box, turned, is parallel to one of the other, in integers; so is every edge."""
    drawn = DrawnPair.of(3, 8, "aligned")
    for k in range(20):
        R = drawn.curve(k).transform[:3, :3]
        assert (np.sort(np.abs(R), axis=1) == [0, 0, 1]).all()
        shift = drawn.curve(k).transform[:3, 3] * 2.0**32
        assert (shift == np.round(shift)).all()


def test_shapes_that_cannot_be() -> None:
    assert why_not(10, "aligned") == "8 to 1000 vertices, a multiple of 4"
    assert why_not(9, "prism") == "8 to 10000 vertices, a multiple of 2"
    assert "shapes are round" in str(why_not(8, "star"))
    with pytest.raises(InputError, match="8 to 1000 vertices"):
        DrawnPair.of(1, 10_000, "aligned")
    with pytest.raises(InputError, match=r"separation.*near, middling, far"):
        DrawnPair.of(1, 8, "round", "close")


# ---------------------------------------------------------------------------------------------------------- references


def bodies(one: Any, two: Any) -> Pair:
    return Pair(one.body("one"), two.body("two"))


@pytest.mark.parametrize("reach", [2, 3, 1000])
def test_references_are_the_oracles(reach: int) -> None:
    rng = np.random.default_rng([reach, 8])
    compared = 0
    for _ in range(12):
        one, two = random_pair(rng, reach)
        truth = exact(one, two)
        if (np.array(one.seed, float) == np.array(two.seed, float)).all() or len(truth.pair.pieces) == 0:
            continue
        curve = exact_curve_in_box(bodies(one, two), CurveQuestion(IDENTITY, np.array(ODD_BOX)))
        pieces = sorted((piece for _, piece in truth.pieces(ODD_BOX)), key=lambda piece: min(ends(piece)))
        names = tuple((below(piece.one), below(piece.two)) for piece in pieces)
        assert curve.touching == names
        assert [sorted(map(rational, pair)) for pair in pairwise(curve.points)] == [
            sorted(ends(piece)) for piece in pieces
        ]
        rho1 = float(rng.uniform(0.05, 0.9)) * float(curve.whole[-1].end[0])
        found = exact_contact(bodies(one, two), ContactQuestion(IDENTITY, rho1))
        interval = truth.pair.interval(rho1)
        assert interval is not None
        assert fraction(found.rho2) == interval[0]
        (piece,) = [p for p in truth.pair.pieces if min(ends(p))[0] <= Fraction(rho1) <= max(ends(p))[0]]
        assert found.touching == (below(piece.one), below(piece.two))
        compared += 1
    assert compared >= 8


def below(labels: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(k - 1 for k in labels)


def ends(piece: Any) -> list[tuple[Fraction, Fraction]]:
    return [plane_point(piece.start), plane_point(piece.end)]


def rational(point: Any) -> tuple[Fraction, Fraction]:
    return fraction(point[0]), fraction(point[1])


def test_a_corner_is_named_by_what_touches_there() -> None:
    """Cube and octahedron: at scales 1 and 2 a corner meets an edge, at 2 and 1 an edge meets a corner."""
    pair = bodies(CUBE, OCTAHEDRON.shifted((4, 2, 1)))
    assert exact_contact(pair, ContactQuestion(IDENTITY, 1.0)).touching == ((7,), (1, 3))
    assert exact_contact(pair, ContactQuestion(IDENTITY, 2.0)).touching == ((3, 7), (1,))
    assert len(exact_contact(pair, ContactQuestion(IDENTITY, 1.5)).touching[0]) == 2  # edge and edge in between


def test_no_reference_without_a_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = DrawnPair.of(5, 8)
    own, made = fcdm_opt.curve.exact.exact_curve, drawn.curve(1).transform
    monkeypatch.setattr(fcdm_opt.curve.exact, "exact_curve", lambda one, two, transform: own(one, two, made))
    exact_curve_in_box(drawn.pair, drawn.curve(1))
    with pytest.raises(FcdmError, match="not proved"):
        exact_curve_in_box(drawn.pair, drawn.curve(0))
    with pytest.raises(FcdmError, match="not proved"):
        exact_contact(drawn.pair, drawn.contact(0))


def test_references_need_the_seeds_inside() -> None:
    drawn = DrawnPair.of(5, 8)
    movable, static = drawn.pair
    pair = Pair(Body.convex(movable.vertices, seed=(5.0, 0, 0), name="off"), static)
    with pytest.raises(InputError, match="both seeds inside"):
        exact_curve_in_box(pair, drawn.curve(0))


# -------------------------------------------------------------------------------------------------------------- errors


@cache
def long_curve() -> ExactStretches:
    """A curve of many pieces."""
    drawn = DrawnPair.of(6, 100, "long")
    references = [exact_curve_in_box(drawn.pair, drawn.curve(k)) for k in range(8)]
    return max(references, key=lambda reference: len(reference.stretches))


def answer(rows: Any, touching: tuple[Touching, ...] | None = None) -> CurveAnswer:
    return CurveAnswer(np.array(rows, dtype=np.float64).reshape(-1, 2), touching)


def test_the_rounded_reference_has_no_error() -> None:
    truth = long_curve()
    assert len(truth.stretches) > 4
    assert curve_error(answer(truth.rounded), truth) == 0.0
    assert touching_right(answer(truth.rounded, truth.touching), truth) is True
    assert touching_right(answer(truth.rounded), truth) is None
    thirds = (truth.rounded[:-1] + 2 * truth.rounded[1:]) / 3
    rows = np.insert(truth.rounded, range(1, len(truth.rounded)), thirds, axis=0)
    assert 0 < curve_error(answer(rows), truth) < 1e-15  # more points on the same lines


@pytest.mark.parametrize("off", [1e-3, 1e-9, -1e-13])
@pytest.mark.parametrize("place", [0, 2, -1])
def test_a_moved_breakpoint_is_as_wrong_as_it_is_moved(off: float, place: int) -> None:
    truth = long_curve()
    rows = truth.rounded.copy()
    rows[place] *= 1 + off
    assert curve_error(answer(rows), truth) == pytest.approx(abs(off), rel=1e-2)


def test_what_is_missing_counts() -> None:
    truth = long_curve()
    rows = truth.rounded
    for missing in (rows[1:], rows[:-1], rows[2:], rows[:2], rows[:1], rows[:0]):
        assert curve_error(answer(missing), truth) > 1e-3
    middle = np.delete(rows, 2, axis=0)
    assert 1e-9 < curve_error(answer(middle), truth) < 1e-1  # a chord instead of a corner
    assert curve_error(answer([rows[0], [np.nan, 1.0]]), truth) == np.inf
    assert curve_error(answer([rows[0], [-1.0, 1.0]]), truth) == np.inf


def test_errors_are_the_largest_over_all_rays() -> None:
    """Beside thousands of rays, met in another way."""
    truth = long_curve()
    rng = np.random.default_rng(3)
    rows = truth.rounded * (1 + 1e-4 * rng.normal(size=(len(truth.rounded), 1)))
    rows[[0, -1]] = truth.rounded[[0, -1]]
    lines = np.array([stretch.piece.line for stretch in truth.whole])
    angles = np.linspace(*(np.arctan2(*rows[k]) for k in (0, -1)), 20_001)[1:-1]
    rays = np.column_stack([np.sin(angles), np.cos(angles)])
    reaches = (lines[:, 2] / (rays @ lines[:, :2].T)).max(axis=1)
    slopes = np.arctan2(rows[:, 0], rows[:, 1])
    k = np.searchsorted(slopes, angles) - 1
    p, q = rows[k], rows[k + 1]
    met = np.linalg.solve(np.stack([rays, p - q], axis=2), p[:, :, None])[:, 0, 0]
    assert curve_error(answer(rows), truth) == pytest.approx(np.abs(met / reaches - 1).max(), rel=1e-3)


def test_a_contact_one_digit_off() -> None:
    drawn = DrawnPair.of(5, 8)
    truth = exact_contact(drawn.pair, drawn.contact(0))
    nearest = float(fraction(truth.rho2))
    assert contact_error(ContactAnswer(nearest), truth) == 0.0
    assert 0 < contact_error(ContactAnswer(np.nextafter(nearest, 9.0)), truth) < 4.5e-16
    assert contact_error(ContactAnswer(nearest * (1 - 1e-9)), truth) == pytest.approx(1e-9, rel=1e-6)
    assert contact_error(ContactAnswer(np.nan), truth) == np.inf
    one, two = truth.touching
    assert touching_right(ContactAnswer(nearest, (one, two)), truth) is True
    assert touching_right(ContactAnswer(nearest, (one, (*two, 99))), truth) is False


def test_wrong_names_are_told() -> None:
    truth = long_curve()
    names = truth.touching
    for wrong in (names[1:] + names[:1], (names[1], *names[1:]), names[:-1]):
        assert touching_right(answer(truth.rounded, wrong), truth) is False
    cut = np.delete(truth.rounded, 2, axis=0)
    assert touching_right(answer(cut, names[:2] + names[3:]), truth) is False  # one left out


# ------------------------------------------------------------------------------------------------------------- batches


@pytest.mark.parametrize("shape", SHAPES)
def test_batches_are_right(shape: str) -> None:
    drawn = DrawnPair.of(7, 12, shape)
    transforms = drawn.transforms(60)
    curves = decision_curves(*drawn.pair, transforms, box=drawn.box)
    assert feature_faults(drawn.pair, transforms, curves) == []
    assert curves.counts.sum() >= 60


@pytest.mark.slow
def test_one_wrong_feature_in_hundreds_of_curves_is_found() -> None:
    drawn = DrawnPair.of(8, 8)
    transforms = drawn.transforms(400)
    curves = decision_curves(*drawn.pair, transforms, box=drawn.box)
    features = curves.features.copy()
    row = int(curves.offsets[240])
    kind, i, j = features[row]
    features[row] = kind, (i + 1) % 4, j
    (fault,) = feature_faults(drawn.pair, transforms, replace(curves, features=features))
    assert (fault.pose, fault.segment, fault.what) == (240, row, "feature")


def shifted(curves: DecisionCurves, name: str, factor: float) -> DecisionCurves:
    array = getattr(curves, name).copy()
    array[3] *= factor
    return replace(curves, **{name: array})


def without_one(curves: DecisionCurves) -> DecisionCurves:
    counts = curves.counts.copy()
    k = int(np.argmax(counts))
    counts[k] -= 1
    rest = np.delete(np.arange(len(curves.lines)), curves.offsets[k])
    rows = {name: getattr(curves, name)[rest] for name in ("vertices", "features", "parts", "lines", "normals")}
    return replace(curves, counts=counts, offsets=np.concatenate([[0], np.cumsum(counts)]), **rows)


PLANTED: dict[str, tuple[Callable[[DecisionCurves], DecisionCurves], str]] = {
    "line": (lambda curves: shifted(curves, "lines", 1 + 1e-10), "line"),
    "normal": (lambda curves: shifted(curves, "normals", 1 + 1e-10), "normal"),
    "ends": (lambda curves: shifted(curves, "vertices", 1 + 1e-10), "ends"),
    "missing": (without_one, "number of segments"),
    "status": (lambda curves: replace(curves, status=np.full(len(curves), "apart")), "status"),
    "poses": (lambda curves: replace(curves, counts=curves.counts[1:]), "poses"),
}


@pytest.mark.parametrize("planted", PLANTED)
def test_planted_faults_are_found(planted: str) -> None:
    drawn = DrawnPair.of(9, 12, "long")
    transforms = drawn.transforms(10)
    change, what = PLANTED[planted]
    curves = decision_curves(*drawn.pair, transforms, box=drawn.box)
    faults = feature_faults(drawn.pair, transforms, change(curves))
    assert {fault.what for fault in faults} == {what}
    assert len(faults) == (10 if planted == "status" else 1)


def test_a_box_without_a_curve() -> None:
    drawn = DrawnPair.of(9, 12)
    transforms = drawn.transforms(4)
    for box, status in ((((0.01, 0.1), (0.01, 0.1)), "apart"), (((20.0, 30.0), (20.0, 30.0)), "overlapping")):
        curves = decision_curves(*drawn.pair, transforms, box=box)
        assert set(curves.status) == {status}
        assert feature_faults(drawn.pair, transforms, curves) == []
        other = replace(curves, status=np.full(4, "contact"))
        assert [fault.what for fault in feature_faults(drawn.pair, transforms, other)] == ["status"] * 4
