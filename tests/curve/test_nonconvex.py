"""Diagrams of bodies made from meshes of solids that are not convex, against their undecomposed surfaces."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from diagram_checks import BAND, SolidPair, Tally, check_drawing, compare_with_meshes, random_solid_pair
from mesh_truth import ScaledMeshes, winding_number
from solids import FAMILIES, box, is_closed, random_solid, solid_of
from strategies import PLAIN

from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.curve.segments import Branch

SEED = 41
PAIRS = 3 if PLAIN else 5
SCALE_PAIRS = 50


@cache
def tally() -> Tally:
    """All comparisons, made once for the tests that read them."""
    found = Tally()
    for number in range(PAIRS):
        rng = np.random.default_rng([SEED, number])
        pair = random_solid_pair(rng, number)
        curves = [
            decision_curve(one, two, transform=pair.transform)
            for one, two in ((pair.movable.body(), pair.static.body()), (pair.movable.union(), pair.static.union()))
        ]
        found.add(compare_with_meshes(pair, curves[0], rng, SCALE_PAIRS, curves[1:]))
        found.add(check_drawing(pair, curves[0], rng))
    return found


@pytest.mark.slow
def test_diagrams_agree_with_the_undecomposed_meshes():
    found = tally()
    assert not found.wrong, "\n".join(found.wrong)
    assert found.counts["scale pairs"] == PAIRS * SCALE_PAIRS
    assert found.counts["overlapping"] > 0.2 * PAIRS * SCALE_PAIRS
    assert found.counts["apart"] > 0.2 * PAIRS * SCALE_PAIRS
    for skipped in ("in the band", "beside the curve's corners", "coal disagrees with itself"):
        assert found.share(skipped, "scale pairs") < 0.02, skipped


@pytest.mark.slow
def test_gap_never_exceeds_the_distance_of_the_meshes():
    assert tally().worst["gap over distance, less 1"] < BAND


def test_segments_gaps_and_crossings_agree():
    found = tally()
    assert found.counts["segments"] >= PAIRS
    assert found.worst["gap on a segment, relative"] < 1e-12
    assert found.share("short segments", "middles") < 0.05
    assert found.share("short stretches", "stretches") < 0.05
    assert found.share("verticals along the curve", "verticals") < 0.05


def test_solid_inside_another_overlaps_though_their_surfaces_do_not_meet():
    inner, outer = solid_of([box((-1, -1, -1), (1, 1, 1))], []), solid_of([box((-5, -5, -5), (5, 5, 5))], [])
    for one, two, shift in ((inner, outer, (0, 0, 0)), (outer, inner, (2, 1, 0))):
        pose = np.eye(4)
        pose[:3, 3] = shift
        meshes, curve = ScaledMeshes(one, two, pose), decision_curve(one.body(), two.body(), transform=pose)
        assert meshes.verdict(np.ones(2)).distance > 1
        assert meshes.verdict(np.ones(2)).overlap
        assert curve.gap((1, 1)) < 0
        assert curve.status == "overlapping"


def test_solid_in_a_cavity_is_apart_until_it_fills_it():
    inner = solid_of([box((-1, -1, -1), (1, 1, 1))], [])
    hollow = solid_of([box((-5, -5, -5), (5, 5, 5))], [box((-2, -2, -2), (2, 2, 2))])
    curve = decision_curve(inner.body(), hollow.body())
    meshes = ScaledMeshes(inner, hollow, np.eye(4))
    (segment,) = curve.segments  # rho_1 = 2 rho_2, one line for all six walls; overlap on its left
    np.testing.assert_allclose([segment.start, segment.end], [(3, 1.5), (1.6, 0.8)], rtol=1e-12)
    for rho, apart in (((1.0, 1.0), True), ((1.99, 1.0), True), ((2.01, 1.0), False), ((3.0, 0.8), False)):
        assert (curve.gap(rho) > 0) == apart
        assert meshes.verdict(np.array(rho)).overlap != apart


@pytest.mark.sampled(4)
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("family", FAMILIES)
def test_parts_of_a_random_solid_fill_its_surface(family, turned):
    """What the comparison rests on: a point is in the surface, by winding number, where it is in a part."""
    rng = np.random.default_rng([SEED, list(FAMILIES).index(family), turned])
    seen = set()
    for _ in range(2):
        solid = random_solid(rng, family, turned)
        assert is_closed(solid.triangles)
        parts = solid.union().parts
        for point in rng.uniform(solid.vertices.min(axis=0), solid.vertices.max(axis=0), (25, 3)):
            depths = [((p.normals @ point) - (p.vertices @ p.normals.T).max(axis=0)).max() for p in parts]
            inside = winding_number(point, solid.vertices, solid.triangles) > 0.5
            assert inside == (min(depths) < 0)
            seen.add(inside)
    assert seen == {False, True}


def cube_over_a_step() -> SolidPair:
    """The cube comes down on the lower step, or grows against the higher one: two segments."""
    cube = solid_of([box((-1, -1, -1), (1, 1, 1))], [])
    step = solid_of([box((-3, -3, -1), (3, 3, 0)), box((1, -3, -1), (3, 3, 3))], [])
    pose = np.eye(4)
    pose[:3, 3] = (-1.5, 0, 3.25)
    return SolidPair("a cube over a step", cube, replace(step, seed=np.array([0.0, 0.0, -0.5])), pose)


def test_comparison_rejects_a_body_without_one_of_its_parts():
    pair = cube_over_a_step()
    for parts, wrong in ((pair.static.parts, False), (pair.static.parts[1:], True)):
        static = replace(pair.static, parts=parts).union()
        curve = decision_curve(pair.movable.union(), static, transform=pair.transform)
        assert bool(compare_with_meshes(pair, curve, np.random.default_rng(SEED)).wrong) == wrong


def test_checks_reject_a_drawing_without_one_of_its_segments():
    pair = cube_over_a_step()
    curve = decision_curve(pair.movable.union(), pair.static.union(), transform=pair.transform)
    (branch,) = curve.branches
    assert len(branch.segments) == 2
    assert not check_drawing(pair, curve, np.random.default_rng(SEED)).wrong
    curve.__dict__["_listed"] = (Branch(branch.segments[1:]),), curve.switching_points
    assert check_drawing(pair, curve, np.random.default_rng(SEED)).wrong
