"""Many decision curves of one pair of bodies, in arrays: one compiled loop over the poses, no Python per pose."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fcdm_opt.curve import kernels
from fcdm_opt.curve.decision_curve import DEFAULT_BOX, DecisionCurve, checked_bodies, checked_box
from fcdm_opt.curve.segments import Box, Segment
from fcdm_opt.errors import InputError, known_arguments
from fcdm_opt.geometry.arrays import Array, Ints, frozen, numbers
from fcdm_opt.geometry.bodies import Body, in_full, rigid_transform
from fcdm_opt.tolerances import DEFAULT

STATUSES = ("apart", "contact", "overlapping")
LEAST_SHARE = 2000  # poses a thread gets at least: fewer are not worth starting one


@dataclass(frozen=True, eq=False)
class DecisionCurves:
    """The decision curves of two bodies at many poses of body 1; build them with `decision_curves`.

    The segments of curve k are the rows `offsets[k]` to `offsets[k + 1]` of the arrays below, numbered as those of
    `decision_curve` are.

    Attributes
    ----------
    movable, static : Body
    transforms : (N, 4, 4) array
    box : pair of intervals
    status : (N,) array of str
        "contact", or "apart" or "overlapping" in the whole box.
    counts : (N,) int array
        Segments inside the box.
    offsets : (N + 1,) int array
    vertices : (M, 2, 2) array
        Start and end of every segment inside the box, overlap on the left.
    features : (M, 3) int array
        What touches: kind (0 face of body 1 and vertex of body 2, 1 vertex and face, 2 edge and edge) and the 0-based
        indices of the elements in their parts; of a contact in more than a point, one of the facets that it lies on.
        `curves[k].segments` name them.
    parts : (M, 2) int array
        The part pair, 0-based.
    lines : (M, 3) array
        Contact lines (a, b, c), lengths, unit normal.
    normals : (M, 3) array
        Unit directions from body 1 to body 2, world frame.
    settled : (N,) bool array
        Where rational arithmetic settled the curve, or part of it; elsewhere the floats proved themselves.
    tied : (N,) bool array
        Where signs tie, as of aligned parts, and floats are right to rounding: what touches may be more than `features`
        tell.
    """

    movable: Body
    static: Body
    transforms: Array
    box: Box
    status: NDArray[np.str_]
    counts: Ints
    offsets: Ints
    vertices: Array
    features: Ints
    parts: Ints
    lines: Array
    normals: Array
    settled: NDArray[np.bool_]
    tied: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.counts)

    def __getitem__(self, k: int) -> DecisionCurve:
        """Return one curve as an object of its own."""
        return DecisionCurve(self.movable, self.static, frozen(self.transforms[k]), self.box)


@known_arguments
def decision_curves(
    movable: Body,
    static: Body,
    transforms: ArrayLike,
    *,
    box: Sequence[Sequence[float]] = DEFAULT_BOX,
    threads: int | None = 1,
) -> DecisionCurves:
    """Return the decision curves of two bodies at many poses of body 1.

    Parameters
    ----------
    movable, static : Body
        Body 1 and body 2, as drawn. Two convex bodies take one compiled loop; unions, and poses that need rational
        arithmetic, are worked out one by one.
    transforms : (N, 4, 4) array
        Rigid pose changes of body 1 with its seed, world frame.
    box : ((lo, hi), (lo, hi))
        Range of rho_1 and rho_2 that is listed.
    threads : int or None
        Threads that share the loop; None: one a core.

    Raises
    ------
    InputError
        For an empty or reversed box, and for a transform that is not rigid, with its index.
    """
    checked_bodies(movable, static)
    limits = checked_box(box)
    poses = _poses(transforms)
    if threads is None:
        threads = os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or threads < 1:
        raise InputError("threads are a positive number, or None", key="threads", found=threads)
    total = len(poses)
    convex = len(movable.parts) == len(static.parts) == 1
    if convex:
        states, ties, counts, sites, rows, vertices = _walked(movable, static, poses, limits, int(threads))
        settled, tied = states == kernels.UNDECIDED, ties > 0
    else:
        states, counts = np.zeros(total, np.int64), np.zeros(total, np.int64)
        settled, tied = np.zeros(total, bool), np.zeros(total, bool)
        sites, rows, vertices = np.empty((0, 3), np.int64), np.empty((0, 6)), np.empty((0, 2, 2))
    status = np.array(STATUSES)[np.where(counts > 0, 1, np.where(states == kernels.OVERLAPPING, 2, 0))]
    parts = np.zeros((len(sites), 2), np.int64)
    single = np.flatnonzero(settled) if convex else np.arange(total)
    if single.size:
        extra: list[Segment] = []
        for k in single.tolist():
            curve = DecisionCurve(movable, static, poses[k], limits)
            extra += curve.segments
            counts[k], status[k], settled[k] = len(curve.segments), curve.status, curve.paths["exact"] > 0
            tied[k] = any(region.is_tied for region in curve.regions)
        rest = ~np.isin(np.arange(total), single).repeat(counts)
        sites = _spliced(rest, sites, [segment.run.pieces[0].site for segment in extra])
        parts = _spliced(rest, parts, [segment.parts for segment in extra])
        rows = _spliced(rest, rows, [np.concatenate([segment.normal, segment.line]) for segment in extra])
        vertices = _spliced(rest, vertices, [(segment.start, segment.end) for segment in extra])
    offsets = np.concatenate([[0], np.cumsum(counts)])
    arrays = (counts, offsets, vertices, sites, parts, rows[:, 3:], rows[:, :3], settled, tied)
    for array in (status, *arrays):
        array.flags.writeable = False
    return DecisionCurves(movable, static, poses, limits, status, *arrays)


def _poses(transforms: ArrayLike) -> Array:
    poses = np.ascontiguousarray(in_full(transforms, numbers(transforms, "transforms")))
    if not poses.size:
        poses = poses.reshape(0, 4, 4)
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise InputError("transforms are an (N, 4, 4) array", key="transforms", found=f"shape {poses.shape}")
    x, y, z = np.ascontiguousarray(poses[:, :3].transpose(1, 2, 0))
    with np.errstate(over="ignore", invalid="ignore"):
        third = x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]
        off = [(x[:3] * x[:3]).sum(axis=0) - 1.0, (y[:3] * y[:3]).sum(axis=0) - 1.0, (x[:3] * y[:3]).sum(axis=0)]
        off += [z[k] - third[k] for k in range(3)]
        sure = np.abs(off).max(axis=0) <= DEFAULT.rigid / 4.0
    sure &= (poses[:, 3] == [0.0, 0.0, 0.0, 1.0]).all(axis=1) & np.isfinite(x[3] + y[3] + z[3])
    for k in np.flatnonzero(~sure).tolist():
        rigid_transform(poses[k], key=f"transforms[{k}]")
    poses.flags.writeable = False
    return poses


def _walked(
    movable: Body, static: Body, poses: Array, box: Box, threads: int
) -> tuple[Ints, Ints, Ints, Ints, Array, Array]:
    packed = (*movable.parts[0].packed, *static.parts[0].packed)
    seeds, limits = np.array([movable.seed, static.seed]), np.array(box).ravel()
    shares = np.array_split(poses, max(1, min(threads, len(poses) // LEAST_SHARE)))

    def work(share: Array) -> tuple[Ints, Ints, Ints, Ints, Array, Array]:
        return kernels.walk_many(*packed, share, seeds, limits, DEFAULT.planarity, DEFAULT.point, DEFAULT.sign)

    if len(shares) == 1:
        return work(shares[0])
    with ThreadPoolExecutor(len(shares)) as pool:
        done = list(pool.map(work, shares))
    states, ties, counts, sites, rows, vertices = (np.concatenate([share[k] for share in done]) for k in range(6))
    return states, ties, counts, sites, rows, vertices


def _spliced(rest: NDArray[np.bool_], listed: NDArray, others: list) -> NDArray:
    """Return the rows `listed` where `rest` holds and `others` elsewhere, each in order."""
    merged = np.empty((len(rest), *listed.shape[1:]), listed.dtype)
    merged[rest] = listed
    if others:
        merged[~rest] = others
    return merged
