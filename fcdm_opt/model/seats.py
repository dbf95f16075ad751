"""What goal "seat" asks of a motion: flush contacts stay aligned, on the whole of the way or at its end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcdm_opt.curve.flush import Flush
from fcdm_opt.curve.region import Piece
from fcdm_opt.curve.tight import TightLine
from fcdm_opt.geometry.arrays import Array, Flags, crossed
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion.motions import Motion
from fcdm_opt.tolerances import DEFAULT


def spins(motion: Motion, movable: Body, static: Body) -> Array:
    """Return the axis about which each parameter turns body 1 at rest, (k, 3): its length is the rate."""
    # rates, not finite turns: a screw along the seeds has no axis where another parameter brings them together
    if motion.shifts:
        return np.zeros((len(motion.parameters), 3))
    rates = motion.kinematics(movable.seed, static.seed).rates(np.zeros(len(motion.parameters)))[1]
    axes = np.array([[W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]] for W in rates]) / 2.0
    return np.where(np.linalg.norm(axes, axis=1)[:, None] > DEFAULT.nominal, axes, 0.0)


def tilts(seats: Sequence[Flush], axes: Array) -> Array:
    """Return how fast each parameter tilts each direction that must stay aligned, at rest, (directions, k)."""
    # the axes, (k, 3), are as of `spins`
    return np.array([axes @ crossed(p, m) for flush in seats for m, p in flush.turns]).reshape(-1, len(axes))


def independent(rows: Array) -> list[int]:
    """Return which rows do not depend on those before them, to `nominal` of the longest."""
    kept: list[int] = []
    basis = np.zeros((0, rows.shape[1]))
    least = DEFAULT.nominal * np.linalg.norm(rows, axis=1).max(initial=0.0)
    for k, row in enumerate(rows):
        rest = row - basis.T @ (basis @ row)
        length = np.linalg.norm(rest)
        if length > least:
            kept.append(k)
            basis = np.vstack([basis, rest / length])
    return kept


def held(seats: Sequence[Flush], motion: Motion, movable: Body, static: Body) -> Flags:
    """Return which parameters must stay zero for nothing to tilt on the whole of a straight way, (k,)."""
    # such a way tilts nothing to first order at rest: its parameters lie in the null space of `tilts`. Where only one
    # mixture of turns does so, and still tilts something further on, nothing may turn at all
    axes = spins(motion, movable, static)
    turning = axes.any(axis=1)
    rates = tilts(seats, axes) if turning.any() else np.zeros((0, len(axes)))
    if not len(rates):
        return np.zeros(len(axes), dtype=bool)
    _, sizes, vectors = np.linalg.svd(rates[:, turning])
    free = vectors[int((sizes > DEFAULT.nominal).sum()) :]
    still = np.zeros(len(axes), dtype=bool)
    still[turning] = np.abs(free).max(axis=0, initial=0.0) <= DEFAULT.nominal
    if len(free) == 1:
        q = np.zeros(len(axes))
        q[turning] = free[0]
        R = motion.transform(q, movable.seed, static.seed)[:3, :3]
        still |= turning & any(abs(m @ R @ p) > DEFAULT.nominal for flush in seats for m, p in flush.turns)
    return still


def flush_of(piece: Piece | TightLine, seats: Sequence[Flush]) -> Flush | None:
    """Return the flush contact that a piece of the curve is, if any; of parallel edges one of their planes."""
    # the facet that the piece names may be that of two edges, whose common normal a motion leaves undefined
    same = [flush for flush in seats if piece.feature in (flush.feature, flush.touching)]
    return max(same, key=lambda flush: float(flush.normal @ piece.normal), default=None)


def untracked(seats: Sequence[Flush], tracked: Sequence[object], target: Array) -> tuple[Flush, ...]:
    """Return the flush contacts that others do not bring to the target pair: one for each plane that is not tracked."""
    # those of them that are tracked are among `tracked`
    own = [flush for flush in seats if flush in tracked]
    kept: list[Flush] = []
    for flush in seats:
        known = [other for other in own + kept if other.whole and other.normal @ flush.normal > 1.0 - DEFAULT.nominal]
        same = any(abs(flush.gap(target) - other.gap(target)) <= DEFAULT.shared * flush.least for other in known)
        if flush not in own and not (flush.whole and same):
            kept.append(flush)
    return tuple(kept)
