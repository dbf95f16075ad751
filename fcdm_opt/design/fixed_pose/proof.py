"""Cells of poses as evidence, and their independent checker.

The checker takes nothing from the search but what the evidence says. That the cells fill the limits is counted, as of
other proofs. What each claims is worked out anew: the poses of a cell by the mean
value form in interval arithmetic, from CasADi's derivatives; gaps at fixed poses by the collision library that judges
all claims; facets of Minkowski differences by Qhull. Shared are the meaning of the problem, `worst.domain`, and the
kinds of witnesses, see `gaps.cell_bound`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcdm_opt.design.fixed_pose.cells import Search
from fcdm_opt.design.fixed_pose.gaps import DIRECTED, SHIFTED, TRACKED
from fcdm_opt.design.fixed_pose.scene import BodyGaps
from fcdm_opt.design.fixed_pose.worst import Worst, domain
from fcdm_opt.design.sizes import Sizes
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt.plain import Plain
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Check
from fcdm_opt.proof.checker import filled_box
from fcdm_opt.proof.mean_value import Boxes, PosesOfPieces
from fcdm_opt.tolerances import DEFAULT

HALVINGS = 6  # of a cell whose bound the mean value form, less tight than what made it, does not reach
MOST_POINTS = 20_000  # of a Minkowski difference, above which its facets are not worked out: that counts as not shown
ROUNDS = 1.0 + 2.0**-40  # of sums of floats, relative


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseEvidence(Plain):
    """Cells of poses and why each holds no better pose."""

    boxes: Array  # lower and upper ends of the parameters, (m, 2, k); together they fill a box
    first: Ints  # where the witnesses of each cell begin, (m + 1,); one without any is left out for its amount
    kinds: Ints  # of the w witnesses, as are `shares`, `parts`, (w, 2), and `sizes`, (w, 2): see `cells.Witnesses`
    shares: Array
    parts: Ints
    sizes: Array
    way_first: Ints  # where the directions of each witness begin, (w + 1,)
    ways: Array  # these directions, (d, 3)

    @classmethod
    def of(cls, search: Search) -> PoseEvidence:
        """Return what a search leaves behind."""
        cells = [node for node in search.nodes if not node.halved]
        *mixtures, directions = zip(*(node.witnesses for node in cells), strict=True)
        kinds, shares, parts, sizes = map(np.concatenate, mixtures)
        each = [own for several in directions for own in several]
        return cls(
            boxes=frozen([(node.low, node.high) for node in cells]),
            first=frozen(np.cumsum([0, *map(len, mixtures[0])]), np.int64),
            kinds=frozen(kinds, np.int64),
            shares=frozen(shares),
            parts=frozen(parts, np.int64),
            sizes=frozen(sizes),
            way_first=frozen(np.cumsum([0, *map(len, each)]), np.int64),
            ways=frozen(np.concatenate([np.empty((0, 3)), *each])),
        )


def check_proof(
    problem: Problem,
    sizes: Sizes,
    window: tuple[float, float],
    evidence: PoseEvidence,
    lower_bound: float,
    *,
    amounts: bool,
) -> tuple[Check, ...]:
    """Check that no pose is better than a bound: of how far the worst gap is off the window at any pose.

    Or, with `amounts`, of the weighted amount of a motion that brings all gaps into it. The evidence is taken at its
    word in nothing. The checks are that the limits hold all poses wanted, that the cells fill them, and one for all
    cells: by how much the least sure of them falls short.
    """
    worst = Worst.of(problem, sizes, *window)
    worst.leave_out_permanent()
    scene = worst.scene
    most, amount = (window[1], lower_bound) if amounts else (lower_bound + window[1], np.inf)
    wanted = domain(worst, most, amount)
    flaw = _flaw(scene, evidence, len(wanted))
    if flaw:
        return (Check("proof: cells", False, 1.0, 0.0, flaw),)
    ends, filled = filled_box(evidence.boxes)
    beyond = np.maximum(ends[0] - wanted[:, 0], wanted[:, 1] - ends[1])
    beyond = np.where(wanted[:, 0] > wanted[:, 1], -np.inf, beyond)
    checks = [
        Check("proof: limits", bool((beyond <= 0).all()), float(beyond.max()), 0.0, "hold all poses wanted"),
        Check("proof: cells", filled, float(not filled), 0.0, f"{len(evidence.boxes)} fill the limits"),
    ]
    if filled:
        judge = _PoseExaminer(worst, evidence)
        slack = DEFAULT.touch * scene.size
        margin = judge.margin(evidence.boxes[:, 0], evidence.boxes[:, 1], lower_bound, slack, amounts)
        checks.append(Check("proof: bounds", bool(margin >= -slack), margin, -slack, "of the least sure cell"))
    return tuple(checks)


def _flaw(scene: BodyGaps, own: PoseEvidence, parameters: int) -> str:
    """Return what keeps the witnesses from being looked at, "" if nothing does."""
    sizes, count = scene.sizes, len(own.kinds)
    if own.boxes.shape != (len(own.first) - 1, 2, parameters):
        return "not one set of witnesses for each cell"
    if not (len(own.boxes) and np.isfinite(own.boxes).all() and (own.boxes[:, 0] <= own.boxes[:, 1]).all()):
        return "cells are none"
    if own.sizes.shape != (count, 2) or own.parts.shape != (count, 2) or own.shares.shape != (count,):
        return "witnesses of different numbers"
    for name, last in (("first", count), ("way_first", len(own.ways))):
        steps = getattr(own, name)
        if steps[0] != 0 or (np.diff(steps) < 0).any() or steps[-1] != last:
            return f"{name} is no division"
    if len(own.way_first) != count + 1:
        return "not one set of directions for each witness"
    if not (np.isfinite(own.shares).all() and (own.shares >= 0).all() and np.isfinite(own.ways).all()):
        return "shares or directions are none"
    if sizes.pairs is not None:
        known = {tuple(row) for row in sizes.pairs.tolist()}
        among = all(tuple(row) in known for row in own.sizes.tolist())
    else:
        among = bool(((own.sizes >= sizes.box[:, 0]) & (own.sizes <= sizes.box[:, 1])).all())
    return "" if among else "a witness speaks of sizes that are not among those asked about"


class _PoseExaminer:
    """What the witnesses of cells are worth, worked out anew."""

    def __init__(self, worst: Worst, evidence: PoseEvidence) -> None:
        self.worst, self.scene, self.evidence = worst, worst.scene, evidence
        self.pair = ScaledPair(worst.problem.movable, worst.problem.static)
        self.kinematics = PosesOfPieces(worst.problem)
        k = evidence.boxes.shape[2]
        self.signs = np.array([[1.0 if corner >> c & 1 else -1.0 for c in range(k)] for corner in range(1 << k)])
        bodies = worst.problem.movable, worst.problem.static
        self.points = [[part.vertices - body.seed for part in body.parts] for body in bodies]

    def margin(self, low: Array, high: Array, bound: float, slack: float, amounts: bool) -> float:
        """Return by how much the least sure cell exceeds what it has to; one that falls short is enough."""
        own, least = self.evidence, np.inf
        if not amounts and bound <= self.worst.floor:
            return 0.0  # nothing is claimed but what holds at every pose
        bare = np.diff(own.first) == 0
        nearest = np.maximum(np.maximum(low[bare], -high[bare]), 0.0)  # to rest, of each parameter
        reached = np.linalg.norm(self.worst.problem.weights * nearest, axis=1) * ROUNDS
        if bare.any():
            least = float((reached - bound).min()) if amounts else -np.inf
        asked = 0.0 if amounts else bound
        for row in np.flatnonzero(~bare).tolist():
            if least < -slack:
                break
            least = min(least, self._over(row, low[row], high[row], asked, slack, HALVINGS))
        return least

    def _over(self, row: int, low: Array, high: Array, asked: float, slack: float, halvings: int) -> float:
        """Return what a cell's mixture exceeds what is asked by: over the cell, or its halves, halved again."""
        margin = self._value(row, self._poses(low[None], high[None])[0]) - asked
        if margin >= -slack or not halvings:
            return margin
        lengths = (high - low) * self.worst.problem.weights
        turns = self.worst.problem.motion.turning  # to which the mean value form loses what it loses
        axis, least = int(np.argmax(np.where(turns, lengths, -1.0) if lengths[turns].any() else lengths)), np.inf
        upper, lower = low.copy(), high.copy()
        upper[axis] = lower[axis] = 0.5 * low[axis] + 0.5 * high[axis]
        for a, b in ((low, lower), (upper, high)):
            least = min(least, self._over(row, a, b, asked, slack, halvings - 1))
            if least < -slack:
                break
        return least

    def _poses(self, low: Array, high: Array) -> Array:
        """Return centre, changes and error of each of the twelve numbers of poses over boxes, (n, 12, k + 2)."""
        weights = self.worst.problem.weights
        ends = np.nextafter(low * weights, -np.inf), np.nextafter(high * weights, np.inf)
        with np.errstate(all="ignore"):
            found = self.kinematics.poses(Boxes.between(*ends))
            at, over = (
                [np.hstack([getattr(x, side) for x in own]) for side in ("middle", "radius")]
                for own in (found.centre, found.over)
            )
            T = np.dstack([at[0], found.change.middle, (at[1] + found.change.radius.sum(axis=2)) * ROUNDS])
            wide = ~(T[..., -1] <= over[1])
        T[wide] = 0.0
        T[wide, 0], T[wide, -1] = over[0][wide], over[1][wide]
        return T

    def _value(self, row: int, T: Array) -> float:
        """Return what the mixture of a cell's witnesses is at least, over the cell."""
        own = self.evidence
        total, mixed = 0.0, np.zeros(len(self.signs))
        for w in range(own.first[row], own.first[row + 1]):
            share, rho, parts = float(own.shares[w]), own.sizes[w], own.parts[w]
            if share == 0.0:
                continue
            kind, directions = int(own.kinds[w]), own.ways[own.way_first[w] : own.way_first[w + 1]]
            own_pair = all(0 <= parts[k] < len(self.points[k]) for k in (0, 1))
            valid = kind == DIRECTED or (own_pair and tuple(parts.tolist()) not in self.worst.scene.uncounted)
            if kind == SHIFTED and valid:
                value = self._shifted(parts, rho, T)
            elif kind == TRACKED and valid:
                value = self._tracked(parts, rho, T)
            elif kind == DIRECTED and len(directions) == len(self.points[0]) * len(self.points[1]):
                value = self._directed(directions, rho, T)
            else:
                return -np.inf
            mixed, total = mixed + share * value, total + share
        found = float(mixed.min()) / total if total > 0.0 else -np.inf
        return found if not np.isnan(found) else -np.inf

    def _offsets(self, points: Array, rho: Array, T: Array) -> tuple[Array, Array]:
        """Return the ways d - rho_1 R x over a cell: (n, k + 1, 3) linear parts, (n, 3) errors, in each axis."""
        R, d = T[:9].reshape(3, 3, -1), T[9:]
        linear = d.T[None, :-1] - rho[0] * np.einsum("ijc,nj->nci", R[:, :, :-1], points)
        return linear, d[:, -1] + rho[0] * np.abs(points) @ R[:, :, -1].T

    def _shifted(self, parts: Ints, rho: Array, T: Array) -> Array:
        linear, errors = self._offsets(np.vstack(self.points[0]), rho, T)
        shift = linear[:, 1:].mean(axis=0)
        off = np.linalg.norm(linear[:, 1:] - shift, axis=2).max(axis=0).sum() + np.linalg.norm(errors, axis=1).max()
        R, problem = T[:9, 0].reshape(3, 3), self.worst.problem
        transforms = np.tile(np.eye(4), (len(self.signs), 1, 1))
        transforms[:, :3, :3] = R
        transforms[:, :3, 3] = problem.static.seed - (T[9:, 0] + self.signs @ shift) - R @ problem.movable.seed
        settled = np.ones((len(self.signs), len(self.points[0]), len(self.points[1])), np.bool_)
        settled[:, parts[0], parts[1]] = False
        gaps = self.pair.signed_distances(np.tile(rho, (len(self.signs), 1)), transforms, settled=settled)
        return np.asarray(self.worst.low - gaps - off * ROUNDS)

    def _tracked(self, parts: Ints, rho: Array, T: Array) -> Array:
        from scipy.spatial import ConvexHull, QhullError

        none = np.full(len(self.signs), -np.inf)
        one, two = self.points[0][parts[0]], self.points[1][parts[1]]
        if len(one) * len(two) > MOST_POINTS:
            return none
        linear, errors = self._offsets(one, rho, T)
        points = (-linear[:, None, 0] - rho[1] * two[None]).reshape(-1, 3)
        try:
            hull = ConvexHull(points)
        except QhullError:
            return none
        normals, corners = hull.equations[:, :3], hull.simplices
        if not (hull.equations[:, 3] < 0).all():
            return none
        owners = corners // len(two)
        depth = np.einsum("fi,fvi->fv", normals, points[corners])
        rates = -np.einsum("fi,fvci->fvc", normals, linear[owners][:, :, 1:])
        lost = np.einsum("fi,fvi->fv", np.abs(normals), errors[owners])
        found = (depth[..., None] + rates @ self.signs.T - lost[..., None]).min(axis=(0, 1))
        return np.asarray(self.worst.low + found) if (found > 0).all() else none

    def _directed(self, directions: Array, rho: Array, T: Array) -> Array:
        least = np.full(len(self.signs), np.inf)
        if not (np.linalg.norm(directions, axis=1) <= 1.0 + DEFAULT.tie).all():
            return np.full(len(self.signs), -np.inf)
        for i, one in enumerate(self.points[0]):
            linear, errors = self._offsets(one, rho, T)
            for j, two in enumerate(self.points[1]):
                if (i, j) in self.worst.scene.uncounted:
                    continue
                n = directions[i * len(self.points[1]) + j]
                values = (
                    (linear[:, 0] @ n)[:, None] + (linear[:, 1:] @ n) @ self.signs.T - (errors @ np.abs(n))[:, None]
                )
                least = np.minimum(least, values.min(axis=0) + rho[1] * (two @ n).min())
        return np.asarray(least - self.worst.high)
