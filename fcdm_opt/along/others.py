"""Part pairs that are not the tracked contact: over which step along a ray none of them comes to overlap."""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np

from fcdm_opt.along import conditions as forms
from fcdm_opt.along.conditions import Conditions, Ray, RayStretch, TrackedPair
from fcdm_opt.along.expansions import is_tied, safe_steps
from fcdm_opt.curve import kernels
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.tolerances import DEFAULT

TIED = 6  # directions looked at where several separate a part pair alike
SAMPLES = (0.31, 0.73, 1.37)  # of the natural step, where what vanishes identically does too


class PairBound(NamedTuple):
    """How far a part pair surely does not overlap, and what ends that: a condition and its expansion, if any does."""

    step: float
    parts: tuple[int, int] | None = None
    expansion: Array | None = None
    condition: Conditions | None = None


class Others:
    """All part pairs of two bodies along a ray; what vanishes identically is told over x up to `within`."""

    def __init__(self, movable: Body, static: Body, ray: Ray, within: float) -> None:
        self._bodies, self._ray, self._within = (movable, static), ray, within
        self._tie = DEFAULT.tie * max(movable.size, static.size)
        self._pairs = [(i, j) for i in range(len(movable.parts)) for j in range(len(static.parts))]
        self._tracked: set[tuple[int, int]] = set()
        self._samples: list[RayStretch] = []
        (c1, r1), (c2, r2) = _balls(movable), _balls(static)
        i, j = np.array(self._pairs).T
        self._spheres = c1[i], c2[j], np.column_stack([r1[i], r2[j]])

    def beside(self, pair: TrackedPair, parts: set[tuple[int, int]]) -> Others:
        """Return those without the part pairs that are tracked, which give the scale pair."""
        made = copy(self)
        made._tracked = parts
        made._samples = [self._ray.stretch(share * self._within, 0.0, pair) for share in SAMPLES]
        return made

    def vanishing(self, conditions: Conditions) -> Array:
        """Return which conditions are zero all along: those that the tracked pair keeps by itself, and alignments."""
        zero = np.ones(len(conditions.rows), dtype=bool)
        for sample in self._samples:
            zero &= is_tied(sample.expanded(conditions))
        return zero

    def bound(self, at: RayStretch, step: float) -> PairBound:
        """Return how far none overlaps but those tracked, at most a given step.

        Spheres about the parts settle most pairs; of the others the direction that separates them best at x does, as
        long as it still separates: where they come to touch, steps close in on that as fast as Newton's.
        """
        best = PairBound(step)
        if len(self._tracked) == len(self._pairs) or step <= 0:
            return best
        rho, (v, w, radii) = at.rho, self._spheres
        ways = at.d[0] + rho[1] * w - rho[0] * v @ at.R[0].T
        ways /= np.maximum(np.linalg.norm(ways, axis=1), np.finfo(float).tiny)[:, None]
        steps = safe_steps(at.expanded(Conditions.of(forms.ALONG, v=v, w=w, m=ways, radii=radii)), at.span)
        for k in np.argsort(steps):
            if steps[k] >= best.step:
                break
            if self._pairs[k] not in self._tracked:
                bound = self._pair_bound(self._pairs[k], at)
                best = bound if bound.step < best.step else best
        return best

    def _pair_bound(self, parts: tuple[int, int], at: RayStretch) -> PairBound:
        """Return the furthest that one of the directions proves which separate a part pair best at x."""
        ways = self._ways(parts, at)
        conditions = Conditions.joined(ways)
        expanded = at.expanded(conditions)
        tied = is_tied(expanded)
        if tied.any():
            tied[tied] = self.vanishing(conditions.chosen(tied))
        steps = np.where(tied, np.inf, safe_steps(expanded, at.span))
        best, start = PairBound(-1.0), 0
        for way in ways:
            worst = start + int(np.argmin(steps[start : start + len(way.rows)]))
            start += len(way.rows)
            if min(steps[worst], at.span) > best.step:
                known = tied[worst]
                best = PairBound(
                    float(min(steps[worst], at.span)),
                    parts,
                    None if known else expanded[worst],
                    None if known else conditions.chosen([worst]),
                )
        return best

    def _ways(self, parts: tuple[int, int], at: RayStretch) -> list[Conditions]:
        """Return the conditions that a part pair is apart along the directions that separate it best at x.

        A direction of a face turns with it; that of two edges is held, as it is the best one there to first order. A
        pair that touches in a tracked feature's plane goes on to do so: its normal counts too.
        """
        one, two = (body.parts[k] for body, k in zip(self._bodies, parts, strict=True))
        X, Y = one.vertices - one.seed, two.vertices - two.seed
        pose = np.concatenate([at.R[0].ravel(), at.d[0]])
        sites, rows = kernels.facet_rows(*one.packed, *two.packed, pose)
        separations = rows[:, 5] - rows[:, 3:5] @ at.rho
        best, ways = float(separations.max()), []
        for k in np.flatnonzero(separations >= best - self._tie)[:TIED]:
            (kind, i, j), n = sites[k].tolist(), rows[k, :3]
            if kind == kernels.F1V2:
                ways.append(Conditions.of(forms.ALONG_TURNED, v=X[one.loops[i][0]], w=Y, m=one.normals[i]))
            elif kind == kernels.V1F2:
                ways.append(Conditions.of(forms.ALONG, v=X, w=Y[two.loops[j][0]], m=-two.normals[j]))
            else:
                ways.append(Conditions.of(forms.ALONG, v=X, w=Y[np.argmin(Y @ n)], m=n))
        if best <= self._tie:
            v, w = np.repeat(X, len(Y), axis=0), np.tile(Y, (len(X), 1))
            ways += [Conditions.of(forms.NORMAL, k, v=v, w=w) for k in range(len(at.tracked.lines))]
        return ways


def _balls(body: Body) -> tuple[Array, Array]:
    """Return centres, relative to the seed, and radii of balls about a body's parts."""
    local = [part.vertices - part.seed for part in body.parts]
    centres = np.array([(points.min(axis=0) + points.max(axis=0)) / 2 for points in local])
    radii = [np.linalg.norm(points - centre, axis=1).max() for points, centre in zip(local, centres, strict=True)]
    return centres, np.array(radii)
