"""The degenerate list: every case against exact numbers, in status, features, breakpoints, lines, chains and signs."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from cases import exact
from curve_checks import check_convex, curve_of
from degenerate import (
    ASPECTS, DIRECTED, EXACT, FAR_AWAY, FLUSH, FLUSH_CONTACTS, MANY_MEET, MANY_POINTS, NEARLY, NO_OFFSET, ORIENTED, SEEDED,
    SIDED, SIZE_RATIOS, SMALL_NUMBERS, TILTED, UNITS, Case, fewer,
)  # fmt: skip
from oracles import ExactCurve, Pair, Vec, box_lines, dot, plane_point, root

from fcdm_opt.curve.decision_curve import DecisionCurve
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.region import Piece

RIGHT = 1e-13  # lines and settled breakpoints, relative


def check_signs(truth: ExactCurve, curve: DecisionCurve) -> int:
    """The sign of the gap is right on the curve, just off it, far off it and near its corners; counts the places."""
    marks = [(0.3, 0.7), (1.0, 1.0), (4.0, 0.2), (9.0, 11.0), (1e-3, 1e3)]
    pair = truth.pair
    for piece in pair.pieces:
        ends = [end if end[2] else (end[0], end[1], 1) for end in (piece.start, piece.end)]
        (x, y), (u, v) = (plane_point(end) for end in ends)
        marks += [(float(x + t * (u - x)), float(y + t * (v - y))) for t in (Fraction(1, 2), Fraction(1, 64), Fraction(63, 64))]
    marks += [(float(x), float(y)) for x, y in (plane_point(u) for u in pair.region if u[2])]
    near = [
        (x * (1 + t), y * (1 + s))
        for x, y in marks
        if x > 0 < y
        for step in (0.0, 1e-9, 1e-11, 1e-13)
        for t, s in ((step, step), (-step, -step), (step, -step))
    ]
    gaps = np.asarray(curve.gap(near))
    np.testing.assert_array_equal(np.sign(gaps), [truth.side(rho) for rho in near])
    return len(near)


def whole_pieces(curve: DecisionCurve) -> list[Piece]:
    """All pieces of the curve in the whole quadrant."""
    return [run.whole for chain in curve.chains for run in chain]


def is_finite(curve: DecisionCurve) -> bool:
    """Whether no number that users see is nan, or infinite in the box."""
    shown = [x for segment in curve.segments for x in (segment.line, segment.normal, segment.start, segment.end)]
    shown += [x for point in curve.switching_points for x in (point.rho, point.lines, point.contacts)]
    hidden = [x for piece in whole_pieces(curve) for x in (piece.start, piece.end)]
    return all(np.isfinite(x).all() for x in shown) and not any(np.isnan(x).any() for x in hidden)


def condition(lines: Sequence[np.ndarray]) -> float:
    """Of the system of two contact lines, each normalised."""
    return float(np.linalg.cond([line[:2] / np.hypot(*line[:2]) for line in lines]))


def chain_count(pieces: Sequence[tuple[Vec, Vec]]) -> int:
    """Chains that stretches with these ends form; ends at infinity or on an axis join nothing."""
    starts = {start for start, _ in pieces if all(start)}
    joints = sum(end in starts for _, end in pieces)
    return len(pieces) - joints + bool(pieces and joints == len(pieces))


def exact_line(pair: Pair, facet: Any) -> np.ndarray:
    """(a, b, c) in lengths, rounded once."""
    unit = pair.unit * root(dot(facet.normal, facet.normal))
    return np.array([float(x / unit) for x in facet.line])


def check_pieces(pair: Pair, curve: DecisionCurve) -> int:
    """The curve in the whole quadrant: features, lines and breakpoints as far as floats can tell."""
    (path,) = (region.path for region in curve.regions)
    found = {piece.feature: piece for piece in whole_pieces(curve)}
    assert set(found) == {Feature.from_label(piece.label) for piece in pair.pieces}
    assert sum(map(len, curve.chains)) == len(pair.pieces)
    assert len(curve.chains) == chain_count([(piece.start, piece.end) for piece in pair.pieces])
    meeting: dict[Vec, list[np.ndarray]] = {}
    for piece in pair.pieces:
        for end in (piece.start, piece.end):
            meeting.setdefault(end, []).append(exact_line(pair, piece.facets[0]))
    for piece in pair.pieces:
        own = found[Feature.from_label(piece.label)]
        lines = [exact_line(pair, facet) for facet in piece.facets]
        errors = [np.abs(own.line - line).max() / np.abs(line).max() for line in lines]
        assert min(errors) <= RIGHT
        # overlap on the left
        exact_ends = (piece.start, piece.end)
        (x, y), (u, v) = (np.array([float(z) for z in end[:2]]) / (float(end[2]) or 1) for end in exact_ends)
        forward = own.travel @ (np.array([u, v]) - (x, y)) if all(end[2] for end in exact_ends) else None
        if forward is not None and forward < 0:
            exact_ends = exact_ends[::-1]
        elif forward is None and bool(exact_ends[0][2]) != bool(np.isfinite(own.lo)):
            exact_ends = exact_ends[::-1]
        for end, given in zip(exact_ends, (own.start, own.end), strict=True):
            if not end[2]:
                assert not np.isfinite(given).all()
                continue
            wanted = np.array([float(z) for z in plane_point(end)])
            if path == "exact":
                np.testing.assert_allclose(given, wanted, rtol=RIGHT, atol=0)
            else:
                slack = RIGHT * (condition(meeting[end]) if len(meeting[end]) > 1 else 1.0)
                np.testing.assert_allclose(given, wanted, rtol=0, atol=slack * np.abs(wanted).max())
    return len(pair.pieces)


def check(case: Case) -> DecisionCurve:
    """All that is known about a case whose faces are exactly planar."""
    truth, curve = exact(case.one, case.two, case.pose), curve_of(case.one, case.two, case.box, case.pose)
    check_pieces(truth.pair, curve)
    check_convex(case.one, case.two, case.box, case.pose)
    inner = [
        tuple(end if all(dot(line, end) > 0 for line in box_lines(case.box)) else (0, 0, 0) for end in (p.start, p.end))
        for _, p in truth.pieces(case.box)
    ]
    assert len(curve.branches) == chain_count(inner)
    assert check_signs(truth, curve) > 0
    assert is_finite(curve)
    return curve


def each(cases: Sequence[Case]) -> Any:
    return pytest.mark.parametrize("case", fewer(cases), ids=lambda case: case.name)


@each([*ORIENTED, *FLUSH_CONTACTS, *SEEDED, *NO_OFFSET, *DIRECTED])
def test_parallel_flush_and_odd_seeds(case):
    check(case)


@each([*SIZE_RATIOS, *ASPECTS, *FAR_AWAY, *UNITS])
def test_sizes_and_places(case):
    check(case)


@each([*MANY_POINTS, *SIDED, *MANY_MEET, *SMALL_NUMBERS])
def test_points_and_features(case):
    check(case)


@each([case for case in NEARLY if float(case.name.split()[2]) > EXACT])
def test_nearly_parallel(case):
    check(case)
