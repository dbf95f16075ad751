"""The judge: verifies a solution from the problem and the claimed numbers alone.

It shares no equation and no kernel with the solver. Distances come from a collision library, confirmed by explicit
vertices (`fcdm_opt.geometry.collision`); contacts and their lines from claimed vertices that are scaled and moved one
by one (`fcdm_opt.tolerance.claim`). Shared are what a problem means (nominal contact, target, motion conventions) and
the bodies' faces and labels; that the nominal contact is one is checked too.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt.tolerance.claim import Claim
from fcdm_opt.tolerance.keep_out import KeepOut
from fcdm_opt.tolerance.problem import MOST_TURNED, TRACKING
from fcdm_opt.tolerance.solution import Certificate, Check, Solution, Status, kept_clear
from fcdm_opt.tolerances import DEFAULT, Tolerances


def verify(solution: Solution, tolerances: Tolerances = DEFAULT) -> Certificate:
    """Judge a solution.

    Parameters
    ----------
    solution : Solution
        Taken at its word in nothing: every claim is recomputed from `solution.problem` and the parameters.
    tolerances : Tolerances
        Limits of the checks.

    Returns
    -------
    Certificate
        All checks with value and limit. Without a motion, or with numbers that are not finite, the one check that
        says so.
    """
    if not solution.status.found or solution.rho is None or solution.transform is None or not solution.parameters:
        return Certificate((Check("motion found", False, float("nan"), 0.0, solution.status.name),))
    finite = _well_formed(solution)
    if not finite.passed:
        return Certificate((finite,))
    with np.errstate(all="ignore"):  # what cannot be computed is nan or infinite, and passes no check
        judge = _Judge(solution, tolerances)
        stages = (judge.motion, judge.requirement, judge.contact, judge.sides, judge.path, judge.seats)
        return Certificate((finite, *(check for stage in (*stages, judge.pair, judge.scene) for check in stage())))


def _well_formed(solution: Solution) -> Check:
    """Check that every claim is of finite numbers in its shape, and every feature a feature."""
    claims: tuple[tuple[Any, tuple[int, ...]], ...] = (
        (solution.rho, (2,)),
        (solution.transform, (4, 4)),
        (solution.pair, (2,)),
        *((x, ()) for x in (solution.pair_gap, solution.amount, solution.lower_bound, *solution.parameters.values())),
    )
    wrong = sum(not isinstance(feature, Feature) for feature in solution.features)
    for claim, shape in claims:
        try:
            numbers = np.asarray(claim, dtype=np.float64)
            wrong += int(numbers.shape != shape or not np.isfinite(numbers).all())
        except (TypeError, ValueError):
            wrong += 1
    return _at_most("finite numbers", wrong, 0, "claims that are not finite numbers of their shape")


def _at_most(name: str, value: float, limit: float, note: str = "") -> Check:
    """Return a check that passes where value <= limit; nan never does."""
    return Check(name, bool(value <= limit), float(value), float(limit), note)


def _at_least(name: str, value: float, limit: float, note: str = "") -> Check:
    return Check(name, bool(value >= limit), float(value), float(limit), note)


def _named(feature: Feature | None) -> Any:
    """Return a name of the feature that does not depend on the order in which its vertices are listed."""
    return feature and tuple((element.kind, frozenset(element.vertices)) for element in (feature.one, feature.two))


def _across(gradients: Array) -> Array:
    """Return the direction that rises most along the gradient it rises least along: between two of them."""
    units = gradients / np.linalg.norm(gradients, axis=1)[:, None]
    between = (units[:, None] + units[None]).reshape(-1, 2)
    between = between / np.maximum(np.linalg.norm(between, axis=1), np.finfo(float).tiny)[:, None]
    best: Array = between[(units @ between.T).min(axis=0).argmax()]
    return best


def _or_inf(values: Any) -> Array:
    """Return values with infinity for nan, which no check passes."""
    return np.where(np.isnan(values), np.inf, values)


class _Judge:
    """One solution under examination; each stage returns its checks."""

    def __init__(self, solution: Solution, tolerances: Tolerances) -> None:
        assert solution.rho is not None
        assert solution.transform is not None
        self.solution, self.problem, self.tolerances = solution, solution.problem, tolerances
        self.rho, self.transform = np.asarray(solution.rho), np.asarray(solution.transform)
        self.q = np.array(list(solution.parameters.values()), dtype=np.float64)
        self.size = self.problem.size
        self.limit = self.problem.contact_slack
        self.scaled = ScaledPair(self.problem.movable, self.problem.static)
        self.claims = [
            Claim(feature, self.problem.movable, self.problem.static, self.scaled, self.rho, self.transform)
            for feature in solution.features
        ]

    # ------------------------------------------------------------------------------------------------------ stages

    def motion(self) -> list[Check]:
        """Check that transform, parameters, limits and amount agree with each other."""
        T, problem, solution = self.transform, self.problem, self.solution
        R = T[:3, :3]
        skew = max(np.abs(R @ R.T - np.eye(3)).max(), np.abs(T[3] - [0, 0, 0, 1]).max(), 1 - np.linalg.det(R))
        names = [parameter.name for parameter in problem.motion.parameters]
        if list(solution.parameters) != names:
            return [_at_most("parameters", float("nan"), 0, f"the motion has {', '.join(names)}")]
        vertices = problem.movable.vertices
        apart = problem.movable.placed_vertices(1.0, T) - problem.movable.placed_vertices(1.0, self._pose(1.0))
        off = np.linalg.norm(apart, axis=1).max() if len(vertices) else float("nan")
        amount = float(np.sqrt(np.sum((problem.weights * self.q) ** 2)))
        slack = self.tolerances.requirement * amount + self.tolerances.line * problem.length
        low, high = problem.limits.T
        excess = (problem.weights * np.maximum(low - self.q, self.q - high)).max()
        return [
            _at_most("rigid transform", skew, self.tolerances.rigid),
            _at_most("transform of parameters", off, self.limit, "largest displacement of a vertex between the two"),
            _at_most("amount", abs(amount - solution.amount), slack),
            _at_most("lower bound", solution.lower_bound - amount, slack, "the bound must not exceed the amount"),
            _at_most("limits", max(0.0, excess), self.tolerances.requirement * problem.length),
        ]

    def requirement(self) -> list[Check]:
        """Check that the tracked pair is where the goal wants it."""
        goal, target, slack = self.problem.goal, self.problem.target, self.tolerances.requirement
        if goal == "beyond":
            missing = (self.problem.signs * (target - self.rho) / target).max()
            return [_at_most("requirement", missing, slack, "relative distance short of the target's quadrant")]
        off = np.abs(self.rho / target - 1).max()
        return [_at_most("requirement", off, slack, "relative distance from the target pair")]

    def contact(self) -> list[Check]:
        """Check that the tracked pair touches, by the claimed features, the nominal ones where those are tracked."""
        gap, claimed = self._gap(self.rho, self.transform), len(self.claims)
        distinct = len({_named(claim.feature) for claim in self.claims})
        if self.problem.goal == "clear" and not claimed and not abs(gap) <= self.limit:
            return []
        checks = [
            _at_most("touching", abs(gap), self.limit, "distance or overlap"),
            Check("features", 1 <= claimed == distinct, distinct, claimed, "each contact feature once, at least one"),
        ]
        if self.problem.goal in TRACKING:
            own = self.problem.tracked_features
            tracked, allowed = ({_named(feature) for feature in some} for some in (self.solution.features, own))
            most = len(own) if self.problem.goal == "seat" else min(2, len(own))
            known = tracked <= allowed and len(tracked) == most
            checks.append(Check("nominal features", known, claimed, most, ", ".join(map(str, own))))
        for k, claim in enumerate(self.claims, 1):
            error = claim.error(self.rho[None], self.transform[None])[0]
            checks.append(_at_most(f"contact {k}", error, self.limit, f"{claim.feature}: distance from being one"))
        return checks

    def sides(self) -> list[Check]:
        """Check for apart on one side of the contact lines, overlap on the other; a snug fit has two opposed lines."""
        if not self.claims:
            return []
        lines = np.array([claim.lines(self.transform[None])[0] for claim in self.claims])
        # a plane through both seeds is in contact at all scales
        gradients = lines[~(np.linalg.norm(lines[:, :2], axis=1) <= self.tolerances.determinant * self.size), :2]
        if not len(gradients):
            return [_at_most("sides", 0, 0, "no change of the scales opens or closes the contact")]
        units = gradients / np.linalg.norm(gradients, axis=1)[:, None]
        opposed = float(np.abs(units.sum(axis=0)).max())
        if len(units) == 2 and opposed <= self.tolerances.determinant:
            return [_at_most("snug", opposed, self.tolerances.determinant, "overlap on both sides of opposed lines")]
        upward = units.sum(axis=0)
        if (units @ upward).min() <= self.tolerances.determinant:
            return [_at_most("snug", opposed, np.inf, "no change of the scales leaves all contact lines on one side")]
        step = self._step(gradients, upward)
        before, after = (self._gap(self.rho + sign * step, self.transform) for sign in (-1, 1))
        least = min(self.limit, float((gradients @ step).min()) / 2.0)
        more = self.scaled.gradients(self.rho, self.transform, self.limit)
        more = more[np.linalg.norm(more, axis=1) > self.tolerances.determinant * self.size]
        if not after < -least and len(more):  # vertices and parallel edges meet along more lines than the one claimed
            upward = _across(more)
            if (more @ upward).min() <= self.tolerances.determinant * self.size:
                return [_at_most("snug", 0.0, np.inf, "no change of the scales leaves all contact lines on one side")]
            step = self._step(more, upward)
            before, after = (self._gap(self.rho + sign * step, self.transform) for sign in (-1, 1))
        below = least if len(gradients) == len(lines) else -self.limit
        return [
            Check("apart below", bool(before > below), before, below, f"with the scales changed by {-step}"),
            Check("overlapping above", bool(after < -least), after, -least, f"with the scales changed by {step}"),
        ]

    def _step(self, gradients: Array, upward: Array) -> Array:
        """Return a small change of the scales by which all contact lines are crossed."""
        step = self.tolerances.side * self.size * upward / (gradients @ upward).min()
        return np.asarray(step * min(1.0, float((self.rho / (2.0 * np.abs(step))).min())))  # scales stay positive

    def path(self) -> list[Check]:
        """Check that the tracked features stay the real contact along the straight ray of the parameters."""
        if self.problem.goal not in TRACKING or self.problem.path != "coherent" or not self.claims:
            return []
        s, poses, pairs = self._way()
        start = np.abs(pairs[0] / self.problem.nominal_pair - 1).max()
        errors = np.max([claim.error(pairs, poses) for claim in self.claims], axis=0)
        gaps = [abs(self._quick_gap(rho, T)) for rho, T in zip(pairs, poses, strict=True)]
        worst = [int(_or_inf(x).argmax()) for x in (errors, gaps)]
        return [
            _at_most("path starts at the nominal", start, self.tolerances.nominal, "relative distance of the scales"),
            _at_most("path features", errors[worst[0]], self.limit, f"worst at {s[worst[0]]:.6g} of the motion"),
            _at_most("path touching", gaps[worst[1]], self.limit, f"worst at {s[worst[1]]:.6g} of the motion"),
        ]

    def seats(self) -> list[Check]:
        """Check that flush contacts are aligned and share more than a point: at the end, and on the way if asked."""
        if self.problem.goal != "seat":
            return []
        seats = self.problem.nominal_seats
        kinds = {_named(name): seat.dimension for seat in seats for name in (seat.feature, seat.touching)}
        claims = {k: claim for k, claim in enumerate(self.claims, 1) if _named(claim.feature) in kinds}
        if not claims:
            return [_at_most("seat", float("nan"), 0, "no flush contact is claimed")]
        least = self.tolerances.shared * min(self.problem.movable.size, self.problem.static.size) / 2.0
        s, poses, pairs = self._way()
        checks = []
        for k, claim in claims.items():
            size = kinds[_named(claim.feature)]
            what = "length" if size == 1 else "width"
            off, *shared = claim.flush(self.rho[None], self.transform[None])[0]
            checks += [
                _at_most(f"seat {k} aligned", off, self.limit, f"{claim.feature}: vertices' distance from one plane"),
                _at_least(f"seat {k} shared", shared[size - 1], least, f"{claim.feature}: {what} of what they share"),
            ]
            if self.problem.path == "coherent":
                off, *shared = claim.flush(pairs, poses).T
                worst, narrowest = int(_or_inf(off).argmax()), int(shared[size - 1].argmin())
                at = [f"worst at {s[worst]:.6g} of the motion", f"{what}, least at {s[narrowest]:.6g} of the motion"]
                checks += [
                    _at_most(f"path seat {k} aligned", off[worst], self.limit, at[0]),
                    _at_least(f"path seat {k} shared", shared[size - 1][narrowest], least, at[1]),
                ]
        return checks

    def pair(self) -> list[Check]:
        """Check the state and gap of the parts actually made."""
        solution, problem = self.solution, self.problem
        off = np.abs(solution.pair / problem.target - 1).max()
        gap = self._gap(problem.target, self.transform)
        state = self._state(gap)
        claimed = solution.pair_gap
        if gap < 0:
            wrong = abs(claimed - gap)
        else:  # a separation over some directions: it has the sign of the distance and does not exceed it
            wrong = max(claimed - gap, -claimed, 0.0) if self._state(claimed) == state else abs(claimed - gap)
        checks = [
            _at_most("target pair", off, self.tolerances.requirement, "relative distance from the problem's target"),
            Check("pair state", solution.pair_state == state, gap, self.limit, f"is {state}"),
            _at_most("pair gap", wrong, self.limit, f"claimed {claimed:.6g}, distance or minus depth {gap:.6g}"),
            Check("status", self._agrees(state), gap, self.limit, f"{solution.status.name}, the pair is {state}"),
        ]
        if "touch" in (problem.pair, problem.goal):
            checks.append(_at_most("pair touches", abs(gap), self.limit))
        if "clear" in (problem.pair, problem.goal):
            checks.append(_at_least("clearance", gap, problem.clearance - self.limit))
        return checks

    def scene(self) -> list[Check]:
        """Check that the part made keeps clear of each keep-out, at every scale of its range."""
        return [self._kept_clear(keep_out) for keep_out in self.problem.keep_out]

    def _kept_clear(self, keep_out: KeepOut) -> Check:
        body, (low, high) = keep_out.body, keep_out.ends
        scales = np.unique(np.linspace(low, high, self.tolerances.scale_points))
        at_scale = ScaledPair(self.problem.movable, body)
        gaps = [self._gap(np.array([self.problem.target[0], r]), self.transform, at_scale) for r in scales]
        if low < high:  # what a convex part sweeps is the hull of both ends
            arms = [part.vertices - body.seed for part in body.parts]
            hulls = [Body.convex(body.seed + np.vstack([low * x, high * x]), seed=body.seed).parts[0] for x in arms]
            swept = ScaledPair(self.problem.movable, replace(body, parts=tuple(hulls)))
            gaps.append(self._gap(np.array([self.problem.target[0], 1.0]), self.transform, swept))
        limit = max(self.limit, self.tolerances.tie * body.size)
        note = f"least distance over the scales {low:g} to {high:g}" if low < high else f"at scale {low:g}"
        return _at_least(kept_clear(keep_out.name), float(np.min(gaps)), keep_out.clearance - limit, note)

    # ------------------------------------------------------------------------------------------------------- parts

    def _way(self) -> tuple[Array, Array, Array]:
        """Return positions on the straight ray of the parameters, and the pose and tracked scale pair at each."""
        turned = sum(
            abs(x) for (_, kind), x in zip(self.problem.motion.parameters, self.q, strict=True) if kind == "rotation"
        )
        count = max(self.tolerances.path_points - 1, int(np.ceil(min(turned, MOST_TURNED) / self.tolerances.path_turn)))
        # between the points at which the solver looks, and both ends
        s = np.concatenate([[0.0], (np.arange(count) + 0.5) / count, [1.0]])
        poses = np.array([self._pose(x) for x in s])
        return s, poses, self._tracked(s, poses)

    def _pose(self, s: float) -> Array:
        problem = self.problem
        try:
            return problem.motion.transform(s * self.q, problem.movable.seed, problem.static.seed)
        except InputError:  # a screw whose axis has vanished on the way
            return np.full((4, 4), np.nan)

    def _quick_gap(self, rho: Array, transform: Array, scaled: ScaledPair | None = None) -> float:
        """Signed distance by coal; where coal cannot tell, by explicit vertices; nan for scales that are none."""
        scaled = scaled or self.scaled
        if not (np.isfinite(transform).all() and np.isfinite(rho).all() and rho.min() > 0):
            return float("nan")
        gap = scaled.signed_distance(rho, transform)
        return scaled.separation(rho, transform) if np.isnan(gap) else gap

    def _gap(self, rho: Array, transform: Array, scaled: ScaledPair | None = None) -> float:
        """Signed distance by coal, confirmed by explicit vertices; where they disagree exact arithmetic decides.

        Of the problem's two bodies, or of another pair.
        """
        scaled = scaled or self.scaled
        gap = self._quick_gap(rho, transform, scaled)
        if np.isnan(gap):
            return gap
        separation = scaled.separation(rho, transform)
        agree = separation <= gap + self.limit and (separation > 0 or gap <= separation + self.limit)
        if agree or np.isnan(separation):
            return gap
        return scaled.exact_separation(rho, transform)

    def _state(self, gap: float) -> str:
        if np.isnan(gap):
            return "unknown"
        return "touching" if abs(gap) <= self.limit else "apart" if gap > 0 else "overlapping"

    def _agrees(self, state: str) -> bool:
        """Whether the status says what was found."""
        status = self.solution.status
        if status is Status.SOLVED:
            return state != "overlapping"
        if status is Status.PAIR_OVERLAPS:
            return state == "overlapping"
        if status is Status.ALREADY_SATISFIED:
            return not self.q.any()
        return True

    def _tracked(self, s: Array, poses: Array) -> Array:
        """Return the tracked scale pair at each pose, (k, 2): where two lines meet, or the point of one line.

        A single line leaves one degree of freedom: its point nearest to the straight way from nominal to target.
        """
        own = {_named(feature) for feature in self.problem.nominal_features}
        leading = [claim for claim in self.claims if _named(claim.feature) in own] or self.claims
        lines = np.array([claim.lines(poses) for claim in leading[:2]])
        if len(lines) == 2:
            (a, b, c), (d, e, f) = lines[0].T, lines[1].T
            determinant = a * e - b * d
            parallel = np.abs(determinant) <= np.hypot(a, b) * np.hypot(d, e) * self.tolerances.determinant
            return np.column_stack([c * e - b * f, a * f - c * d]) / np.where(parallel, np.nan, determinant)[:, None]
        ab, c = lines[0][:, :2], lines[0][:, 2]
        way = self.problem.nominal_pair + s[:, None] * (self.problem.target - self.problem.nominal_pair)
        return way + ((c - (ab * way).sum(axis=1)) / (ab * ab).sum(axis=1))[:, None] * ab
