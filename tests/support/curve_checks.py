"""Checks of a computed decision curve against the exact one, shared by the tests of the curve."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from cases import Shape, exact
from oracles import Box, ExactCurve, plane_point
from strategies import SEEDS

from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.features import Feature

# no curve of small integers meets the border of this box in a special way
ODD_BOX: Box = ((0.0731584, 9.7172613), (0.0643917, 11.3145927))
SEED_PAIRS = [(p, q) for p in SEEDS for q in SEEDS]
INSIDE = ("inside", "inside")


def curve_of(one: Shape, two: Shape, box: Box = ODD_BOX, pose: np.ndarray | None = None) -> DecisionCurve:
    return decision_curve(one.body("one"), two.body("two"), box=box, transform=pose)


def turned_to(ends: Sequence[Sequence[Any]], expected: Sequence[Sequence[Any]]) -> tuple[np.ndarray, np.ndarray]:
    """Both pairs of ends as floats, the first in the order that fits the second better."""
    found, wanted = (np.array([[float(x) for x in end] for end in pair]) for pair in (ends, expected))
    return (found if np.abs(found - wanted).sum() <= np.abs(found[::-1] - wanted).sum() else found[::-1]), wanted


def check_lines(curve: DecisionCurve) -> None:
    """Every line is (h_1(n), h_2(-n), n.d) of a unit normal, and the segment's ends lie on it."""
    seed = curve.transform[:3, :3] @ curve.movable.seed + curve.transform[:3, 3]
    for segment in curve.segments:
        i, j = segment.parts
        X = curve.movable.parts[i].vertices @ curve.transform[:3, :3].T + curve.transform[:3, 3] - seed
        Y = curve.static.parts[j].vertices - curve.static.seed
        n, d = segment.normal, curve.static.seed - seed
        size = max(np.abs(X).max(), np.abs(Y).max(), np.abs(d).max())
        assert np.linalg.norm(n) == pytest.approx(1, abs=1e-13)
        np.testing.assert_allclose(segment.line, [(X @ n).max(), (-Y @ n).max(), n @ d], atol=1e-12 * size)
        for end in (segment.start, segment.end):
            assert segment.line[:2] @ end == pytest.approx(
                segment.line[2], abs=1e-12 * size * max(1, np.abs(end).max())
            )


def check_convex(one: Shape, two: Shape, box: Box = ODD_BOX, pose: np.ndarray | None = None) -> int:
    """A convex pair's curve equals the exact one; returns the number of its segments."""
    truth, curve = exact(one, two, pose), curve_of(one, two, box, pose)
    expected = [piece for _, piece in truth.pieces(box)]
    assert curve.status == truth.status(box)
    found = {segment.feature: segment for segment in curve.segments}
    assert set(found) == {Feature.from_label(piece.label) for piece in expected}
    assert len(curve.segments) == len(expected)
    for piece in expected:
        segment = found[Feature.from_label(piece.label)]
        ends = [plane_point(piece.start), plane_point(piece.end)]
        np.testing.assert_allclose(*turned_to([segment.start, segment.end], ends), rtol=1e-10, atol=1e-10)
        lines = [np.array([float(x) for x in facet.line]) for facet in piece.facets]
        scaled = [line / np.hypot(*line[:2]) for line in lines]
        np.testing.assert_allclose(segment.line / np.hypot(*segment.line[:2]), scaled[0], rtol=1e-12, atol=1e-12)
        if len(lines) == 1:
            unit = truth.pair.unit * math.sqrt(sum(x * x for x in piece.facets[0].normal))
            size = np.abs(lines[0]).max() / unit
            np.testing.assert_allclose(segment.line, lines[0] / unit, atol=1e-12 * max(1, size))
        assert not segment.snug
        assert segment.parts == (0, 0)
    check_lines(curve)
    corners = truth.pair.corners(box)
    assert len(curve.switching_points) == len(corners)
    assert [point.index for point in curve.switching_points] == list(range(1, len(corners) + 1))
    for rho, label in corners:
        near = min(curve.switching_points, key=lambda point: np.abs(point.rho - np.array(rho, dtype=float)).max())
        np.testing.assert_allclose(near.rho, np.array(rho, dtype=float), rtol=1e-10, atol=1e-10)
        assert near.contact_features == (Feature.from_label(label),)
        assert near.kind == Feature.from_label(label).kind
    return len(expected)


def check_gaps(truth: ExactCurve, curve: DecisionCurve, rng: np.random.Generator, size: float) -> None:
    pairs = np.column_stack([rng.uniform(*bounds, 8) for bounds in ODD_BOX])
    gaps = curve.gap(pairs)
    for rho, gap in zip(pairs, gaps, strict=True):
        assert gap == pytest.approx(curve.gap(rho), rel=1e-14, abs=1e-14 * size)
        assert np.sign(gap) == truth.side(rho)
        if gap > 0 and len(curve.movable.parts) * len(curve.static.parts) > 1:  # spheres may show that it is more
            assert truth.gap(rho) - 1e-12 * size <= gap <= truth.distance(rho) + 1e-12 * size
        else:
            assert gap == pytest.approx(truth.gap(rho), abs=1e-12 * size)
