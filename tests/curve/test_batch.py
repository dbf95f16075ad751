"""Many curves at once equal the same curves one by one, and the numbers of the exact oracle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from cases import CUBE, EXAMPLE_2, OCTAHEDRON, Shape, exact
from curve_checks import INSIDE, ODD_BOX, SEED_PAIRS
from degenerate import BLOCK, SLAB, fewer, prism
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import generators, random_pair, random_pose, random_union, reaches

import fcdm_opt as fo
from fcdm_opt.curve import kernels
from fcdm_opt.curve.batch import LEAST_SHARE
from fcdm_opt.curve.decision_curve import DEFAULT_BOX
from fcdm_opt.errors import InputError
from fcdm_opt_benchmarks.stability.contacts.scenes import orientations, turned

MANY = fewer(range(60))
ARRAYS = ("transforms", "status", "counts", "offsets", "vertices", "features", "parts", "lines", "normals", "settled")


def poses_of(rng: np.random.Generator, count: int, reach: float) -> np.ndarray:
    return np.array([random_pose(rng, reach) for _ in range(count)])


def sites_of(curve: fo.DecisionCurve) -> list[tuple[int, int, int]]:
    return [segment.run.pieces[0].site for segment in curve.segments]


def check_batch(movable: fo.Body, static: fo.Body, poses: np.ndarray, box: Any = ODD_BOX) -> fo.DecisionCurves:
    """Pose by pose the batch says what a single curve says."""
    batch = fo.decision_curves(movable, static, poses, box=box)
    assert len(batch) == len(poses) == len(batch.status) == len(batch.settled)
    np.testing.assert_array_equal(batch.offsets, np.concatenate([[0], np.cumsum(batch.counts)]))
    for key in ("vertices", "features", "parts", "lines", "normals"):
        assert len(getattr(batch, key)) == batch.counts.sum()
    for k, pose in enumerate(poses):
        curve = fo.decision_curve(movable, static, transform=pose, box=box)
        rows = slice(batch.offsets[k], batch.offsets[k + 1])
        assert batch.status[k] == curve.status
        assert batch.counts[k] == len(curve.segments)
        assert batch.settled[k] == (curve.paths["exact"] > 0)
        assert batch.tied[k] == any(region.is_tied for region in curve.regions)
        np.testing.assert_array_equal(batch.features[rows], np.reshape(sites_of(curve), (-1, 3)))
        np.testing.assert_array_equal(batch.parts[rows], np.reshape([s.parts for s in curve.segments], (-1, 2)))
        for found, wanted in [
            (batch.vertices[rows], [(s.start, s.end) for s in curve.segments]),
            (batch.lines[rows], [s.line for s in curve.segments]),
            (batch.normals[rows], [s.normal for s in curve.segments]),
        ]:
            expected = np.reshape(wanted, found.shape)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * np.abs(expected).max(initial=1.0))
        single = batch[k]
        assert [segment.feature for segment in single.segments] == [segment.feature for segment in curve.segments]
        np.testing.assert_array_equal(single.transform, pose)
        assert single.box == curve.box
    return batch


# ------------------------------------------------------------------------------------------------- equal to single ones


@settings(max_examples=20)
@given(generators, reaches, st.sampled_from(SEED_PAIRS))
def test_random_poses_of_convex_pairs(rng, reach, seeds):
    one, two = random_pair(rng, reach, seeds)
    check_batch(one.body(), two.body(), poses_of(rng, 8, reach))


@settings(max_examples=10)
@given(generators, reaches)
def test_random_poses_of_unions(rng, reach):
    one, two = random_union(rng, reach, 2), random_union(rng, reach, 2).shifted((3 * reach, 0, 0))
    batch = check_batch(one.body(), two.body(), poses_of(rng, 4, reach))
    if len(batch.parts):
        assert batch.parts.min() >= 0
        assert batch.parts.max() <= 1


def test_the_paper_s_second_example_turned():
    poses = np.array([turned(2, angle) for angle in np.linspace(-0.2, 0.2, 9)])
    batch = check_batch(EXAMPLE_2.one.body(), EXAMPLE_2.two.body(), poses, DEFAULT_BOX)
    assert set(batch.parts[:, 1]) == {0, 1}


@pytest.mark.parametrize("offset", [(8, 0, 0), (0, 6, 10), (4, 3, 5)], ids=["face", "edge", "vertex"])
def test_aligned_boxes_need_no_rationals(offset):
    batch = check_batch(SLAB.body(), BLOCK.shifted(offset).body(), np.array(orientations()))
    assert batch.tied.all()
    assert not batch.settled.any()
    assert (batch.status == "contact").all()


def test_generic_poses_prove_themselves():
    rng = np.random.default_rng(3)
    one, two = random_pair(rng, 1000, INSIDE)
    batch = check_batch(one.body(), two.shifted((5000, 0, 0)).body(), poses_of(rng, len(MANY), 1000.0))
    assert not (batch.settled | batch.tied).any()


def test_degenerate_poses_among_generic_ones_keep_their_place():
    rng = np.random.default_rng(4)
    poses = poses_of(rng, 12, 1.0)
    poses[[0, 5, 6, 11]] = np.eye(4)
    poses[[5, 11], 0, 3] = 4.0  # seeds at one point
    batch = check_batch(CUBE.body(), CUBE.shifted((4, 0, 0)).body(), poses)
    assert batch.tied[[0, 6]].all()
    assert batch.settled[[5, 11]].all()
    assert not (batch.settled | batch.tied).all()
    assert batch.counts[[5, 11]].tolist() == [0, 0]
    for k in (0, 6):  # rho_1 + rho_2 = 4
        np.testing.assert_allclose(batch.lines[batch.offsets[k] : batch.offsets[k + 1]], [[1, 1, 4]], rtol=1e-15)


def test_poses_apart_touching_and_overlapping_in_the_box():
    """Cubes at 2 r1 + 2 r2 sides: in a box of scales from 1 to 3 they are apart beyond 6 and overlap below 2."""
    places = np.array([-3.0, 0.0, 1.0, 1.5, 3.0, 5.5, 6.5, 100.0])  # of body 2, along x
    poses = np.tile(np.eye(4), (len(places), 1, 1))
    poses[:, 0, 3] = 4.0 - places
    poses[:, 1, 3] = 0.25
    batch = check_batch(CUBE.body(), CUBE.shifted((4, 0, 0)).body(), poses, ((1, 3), (1, 3)))
    assert batch.status.tolist() == ["contact", *["overlapping"] * 3, "contact", "contact", "apart", "apart"]
    assert batch.counts.tolist() == [1, 0, 0, 0, 1, 1, 0, 0]


def test_generic_poses_apart_and_overlapping():
    rng = np.random.default_rng(5)
    one, two = OCTAHEDRON.body(), OCTAHEDRON.body()
    poses = poses_of(rng, 40, 0.2)
    poses[20:, :3, 3] += 60.0
    batch = check_batch(one, two, poses, ((0.8, 3.0), (0.8, 3.0)))
    assert set(batch.status[:20]) == {"overlapping"}
    assert set(batch.status[20:]) == {"apart"}
    assert len(batch.vertices) == 0


@pytest.mark.parametrize("box", [((0.8, 3), (0.8, 3)), ((1.5, 1.6), (0.1, 50)), ((0, 100), (0, 100)), ODD_BOX])
def test_boxes_clip_as_single_curves_do(box):
    rng = np.random.default_rng(6)
    one, two = random_pair(rng, 1000, INSIDE)
    batch = check_batch(one.body(), two.shifted((2500, 1000, 0)).body(), poses_of(rng, 12, 500.0), box)
    (x0, x1), (y0, y1) = box
    ends = batch.vertices.reshape(-1, 2)
    assert ((ends >= np.array([x0, y0]) * (1 - 1e-14)) & (ends <= np.array([x1, y1]) * (1 + 1e-14))).all()


def test_curves_equal_the_oracle():
    rng = np.random.default_rng(7)
    one, two = random_pair(rng, 1000, INSIDE)
    poses = poses_of(rng, 10, 1000.0)
    two = two.shifted((4000, 0, 0))
    batch = fo.decision_curves(one.body(), two.body(), poses, box=ODD_BOX)
    for k, pose in enumerate(poses):
        truth = exact(one, two, pose)
        pieces = truth.pieces(ODD_BOX)
        assert batch.status[k] == truth.status(ODD_BOX)
        assert batch.counts[k] == len(pieces)
        found = batch.vertices[batch.offsets[k] : batch.offsets[k + 1]].reshape(-1)
        wanted = [float(x) / float(end[2]) for _, piece in pieces for end in (piece.start, piece.end) for x in end[:2]]
        np.testing.assert_allclose(np.sort(found), np.sort(wanted), rtol=1e-11)


# ------------------------------------------------------------------------------------------------------ many, few, none


def same_arrays(first: fo.DecisionCurves, second: fo.DecisionCurves) -> bool:
    return all(np.array_equal(getattr(first, key), getattr(second, key)) for key in ARRAYS)


def threaded(one: Shape, two: Shape, poses: np.ndarray) -> None:
    alone = fo.decision_curves(one.body(), two.body(), poses, box=ODD_BOX)
    for threads in (2, 3):
        assert same_arrays(alone, fo.decision_curves(one.body(), two.body(), poses, box=ODD_BOX, threads=threads))


def test_threads_change_nothing(monkeypatch):
    """Also where poses that need rationals lie in every share, and where the shares are not equally long."""
    monkeypatch.setattr("fcdm_opt.curve.batch.LEAST_SHARE", 5)
    rng = np.random.default_rng(8)
    poses = poses_of(rng, 31, 1.0)
    poses[::7] = np.eye(4)
    threaded(CUBE, CUBE.shifted((4, 0, 0)), poses)
    threaded(*random_pair(rng, 1000, ("outside", "vertex")), poses)


def test_threads_of_full_shares_change_nothing():
    rng = np.random.default_rng(9)
    some = poses_of(rng, 50, 1.0)
    total = 50 if not hasattr(kernels.walk_many, "signatures") else 3 * LEAST_SHARE + 1
    threaded(OCTAHEDRON, prism(5).shifted((3, 1, 0.5)), some[rng.integers(0, 50, total)])


def test_no_pose_gives_empty_arrays():
    for one, two in [(CUBE, OCTAHEDRON), (EXAMPLE_2.one, EXAMPLE_2.two)]:
        batch = fo.decision_curves(one.body(), two.body(), np.empty((0, 4, 4)))
        assert len(batch) == 0
        assert batch.offsets.tolist() == [0]
        assert [getattr(batch, key).shape for key in ("vertices", "features", "parts", "lines", "normals")] == [
            (0, 2, 2), (0, 3), (0, 2), (0, 3), (0, 3)
        ]  # fmt: skip
        with pytest.raises(IndexError):
            batch[0]


def test_curves_are_numbered_from_either_end():
    rng = np.random.default_rng(10)
    poses = poses_of(rng, 3, 1.0)
    batch = fo.decision_curves(CUBE.body(), OCTAHEDRON.shifted((5, 1, 0)).body(), poses)
    np.testing.assert_array_equal(batch[-1].transform, poses[2])
    with pytest.raises(IndexError):
        batch[3]


def test_results_and_input_are_apart():
    """Changing the poses afterwards changes no result, and results cannot be written to."""
    rng = np.random.default_rng(11)
    poses = poses_of(rng, 3, 1.0)
    kept = poses.copy()
    batch = fo.decision_curves(CUBE.body(), OCTAHEDRON.shifted((5, 1, 0)).body(), poses)
    assert poses.flags.writeable
    poses[:] = 0
    np.testing.assert_array_equal(batch.transforms, kept)
    for key in ARRAYS:
        assert not getattr(batch, key).flags.writeable


@pytest.mark.parametrize("change", [lambda p: p.astype(np.float32), lambda p: p.tolist(), np.asfortranarray,
                                    lambda p: np.repeat(p, 2, axis=0)[::2]])  # fmt: skip
def test_poses_come_in_any_array(change):
    poses = np.array(orientations())
    bodies = SLAB.body(), OCTAHEDRON.shifted((6, 1, 0.5)).body()
    assert same_arrays(fo.decision_curves(*bodies, poses), fo.decision_curves(*bodies, change(poses)))


# ----------------------------------------------------------------------------------------------------------- bad input

BAD = {
    "nan": lambda T: T.__setitem__((0, 1), math.nan),
    "nan in the shift": lambda T: T.__setitem__((1, 3), math.nan),
    "infinite": lambda T: T.__setitem__((2, 3), math.inf),
    "twice as large": lambda T: T.__imul__(2.0),
    "sheared": lambda T: T.__setitem__((0, 1), T[0, 1] + 1e-5),
    "a mirror": lambda T: T.__setitem__((slice(3), 0), -T[:3, 0]),
    "zero": lambda T: T.__imul__(0.0),
    "a projection": lambda T: T.__setitem__((3, 0), 0.1),
}


@pytest.mark.parametrize("index", [0, 3, 6])
@pytest.mark.parametrize("name", BAD)
def test_bad_transforms_are_named_by_their_index(name, index):
    poses = poses_of(np.random.default_rng(12), 7, 1.0)
    BAD[name](poses[index])
    for one, two in [(CUBE, OCTAHEDRON), (EXAMPLE_2.one, EXAMPLE_2.two)]:
        with pytest.raises(InputError, match=rf"transforms\[{index}\]"):
            fo.decision_curves(one.body(), two.body(), poses)


@pytest.mark.parametrize("poses", [np.eye(4), np.zeros((2, 3, 4)), np.zeros((2, 4, 3)), np.zeros(16), 1.0, "ab", None,
                                   np.zeros((1, 2, 4, 4)), [[1, 2], [3]], np.eye(4)[None] * 1j], ids=str)  # fmt: skip
def test_transforms_are_n_matrices(poses):
    with pytest.raises(InputError, match="transforms"):
        fo.decision_curves(CUBE.body(), OCTAHEDRON.body(), poses)


@pytest.mark.parametrize("threads", [0, -1, 1.5, True, "2"])
def test_threads_are_a_positive_number(threads):
    with pytest.raises(InputError, match="threads"):
        fo.decision_curves(CUBE.body(), OCTAHEDRON.body(), np.eye(4)[None], threads=threads)


def test_threads_may_be_as_many_as_there_are_cores():
    curves = fo.decision_curves(CUBE.body(), OCTAHEDRON.shifted((6, 1, 2)).body(), np.eye(4)[None], threads=None)
    assert curves.status.tolist() == ["contact"]


@pytest.mark.parametrize("box", [((3, 1), (1, 3)), ((1, 1), (1, 3)), ((1, math.nan), (1, 3)), (1, 3)])
def test_boxes_are_two_ranges(box):
    with pytest.raises(InputError, match="box"):
        fo.decision_curves(CUBE.body(), OCTAHEDRON.body(), np.eye(4)[None], box=box)


def test_bodies_are_bodies():
    with pytest.raises(InputError, match="movable"):
        fo.decision_curves(CUBE.array, OCTAHEDRON.body(), np.eye(4)[None])
