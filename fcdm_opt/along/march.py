"""One way along a ray: steps that no event can hide in, until the tracked features are no longer the real contact.

Over a step each condition f stays above f(x0) + f'(x0) h - B h^2 / 2, B a bound of |f''| there, so it holds up to that
parabola's root. Steps close in on an event as Newton's do, never beyond it.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.along import conditions as forms
from fcdm_opt.along.conditions import VERIFIED, Conditions, Ray, RayStretch, TrackedPair
from fcdm_opt.along.expansions import ROUNDING, flat, is_tied, roots, safe_steps
from fcdm_opt.along.followed import KINDS, Cause, Followed, Rest
from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import meetings
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.naming import pair_in_words
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

STEPS = 1000  # of a march, at most
SHRINK = 64.0  # of a step on which nothing is proved
CLOSE = 1e-7  # of the natural step: events this near to each other are named together
GRAZE = 1e-2  # of the natural step: how far on a condition that seems to graze is looked at, at most
TIED = 6  # directions looked at where several separate a part pair alike
SAMPLES = (0.31, 0.73, 1.37)  # of the natural step, where what vanishes identically does too
FINE = 1e-13  # relative error of an event from which on it is refined


class Stop(NamedTuple):
    """Where a march can go no further."""

    x: float
    causes: tuple[Cause, ...]  # what fails there together, the most telling first
    expansion: Array | None = None  # of a condition that fails
    condition: Conditions | None = None  # that condition alone


class March:
    """Both ways along a ray, from no motion, in x >= 0; without tracked features the scale pair stays as given.

    `proved`: whether all steps so far were covered by bounds; `unit`, the natural step, turns or moves things by about
    their size.
    """

    def __init__(
        self, problem: Problem, followed: tuple[Followed, ...], ray: Ray, pair: Array, end: float = math.inf
    ) -> None:
        self.proved, self._end = True, end
        self._problem, self._followed, self._ray, self._pair = problem, followed, ray, pair
        turning, moving = ray.natural_step
        rate = max(turning, moving / problem.size)
        self.unit = 1.0 / rate if 0 < rate < math.inf else 1.0
        self._all = Others(*problem.active, ray, min(self.unit, end))
        self._known: dict[tuple[int, ...], tuple[Any, ...]] = {}
        self._rest_on(self._first)

    @property
    def _first(self) -> list[Rest]:
        return [feature.rests[0] for feature in self._followed]

    def rho(self, x: float) -> Array:
        """Return the tracked scale pair, (2,)."""
        return self._stretch(x).rho

    def stop(self, side: float, end: float) -> Stop | None:
        """Return what ends the way to one side, None where its end is reached."""
        self._ray, self._end, self.proved = replace(self._ray, side=side), end, True
        if self._rests != self._first:
            self._rest_on(self._first)
        for cause in (self._causes[group] for group in self._groups[self._tied].tolist()):
            flush = cause.feature >= 0 and self._followed[cause.feature].flush
            if cause.kind == "opens" or (flush and cause.kind != "border"):
                what = f"{self._followed[cause.feature].feature.label} does not stay {'flush' if flush else 'closed'}"
                return Stop(0.0, (Cause("opens", cause.feature, what),))
        stop = self.advanced(0.0)
        while stop is not None and self._taken_over(stop):
            stop = self.advanced(stop.x)
        return stop

    def near(self, low: float, high: float) -> tuple[Array, float]:
        """Return the scale pair in the middle of a stretch, and how near what touches on it is there, at most.

        With f = 1 / (rho_1 + rho_2) the way between two points, f (d + rho_2 w - rho_1 R v), changes by what its terms
        do: however far out, where all grows in proportion, that is little.
        """
        here = self._stretch(low, high - low)
        rho = self._stretch(0.5 * (low + high)).rho
        far = [float(np.linalg.norm(body.vertices - body.seed, axis=1).max()) for body in self._problem.bodies[:2]]
        return rho, float(rho.sum()) * here.changes(0.5 * (high - low), *far)

    def _rest_on(self, rests: list[Rest]) -> None:
        """Take the conditions of the part pairs on which the tracked features rest, without those that always hold."""
        key = tuple(map(id, rests))
        if key not in self._known:
            self._known[key] = self._worked_out(rests)
        self._rests = rests
        self._tracked, self._others, self._causes, self._conditions, self._groups, self._tied = self._known[key]

    def _worked_out(self, rests: list[Rest]) -> tuple[Any, ...]:
        lines = np.array([rest.line for rest in rests if rest.line is not None]).reshape(-1, 13)
        determinant = Conditions.of(forms.DETERMINANT)
        signless = TrackedPair(lines, np.array(self._pair), 1.0)
        value = self._ray.stretch(0.0, 0.0, signless).expanded(determinant)[0, 0]
        tracked = signless._replace(sign=1.0 if value > 0 else -1.0)
        others = self._all.without(tracked, {rest.parts for rest in rests})
        groups = [
            (determinant, Cause("parallel lines", -1, KINDS["parallel lines"])),
            (Conditions.of(forms.SCALE_1), Cause("scale", -1, "the scale of body 1 becomes zero")),
            (Conditions.of(forms.SCALE_2), Cause("scale", -1, "the scale of body 2 becomes zero")),
            *(group for rest in rests for group in rest.groups),
        ]
        made, causes = [own for own, _ in groups], [cause for _, cause in groups]
        joined, numbers = Conditions.joined(made), np.repeat(np.arange(len(made)), [len(c.rows) for c in made])
        tied = is_tied(self._ray.stretch(0.0, 0.0, tracked).expanded(joined))
        always = tied.copy()
        always[always] = others.vanishing(joined.chosen(always))
        kept = ~np.isin(numbers, numbers[always])  # one of a group is enough
        return tracked, others, causes, joined.chosen(kept), numbers[kept], tied[kept]

    def _stretch(self, x: float, span: float = 0.0) -> RayStretch:
        return self._ray.stretch(x, span, self._tracked)

    def _reaches(self, steps: Array) -> Array:
        """Return how far each group of conditions holds, (groups,); infinite for those that always do."""
        reaches = np.full(len(self._causes), np.inf)
        reaches[self._groups] = 0.0
        np.maximum.at(reaches, self._groups, steps)
        return reaches

    def advanced(self, x: float) -> Stop | None:
        """Return where the march from x stops, None where it reaches its end."""
        span, known = self.unit, ProvedSeparations(np.full(len(self._others.pairs), x), {})
        for _ in range(STEPS):
            pacing.check()
            span = min(span, self._end - x)
            if span <= 0:
                return None
            least = max(4 * np.finfo(float).eps * x, DEFAULT.point * self.unit)
            here = self._stretch(x, span)
            expanded = here.expanded(self._conditions)
            if not (np.isfinite(expanded).all() and here.bounded):  # no bounds on so long a way
                if span <= least:
                    return Stop(x, (Cause("undefined", -1, KINDS["undefined"]),))
                span /= SHRINK
                continue
            steps = safe_steps(expanded, span)
            reaches = self._reaches(steps)
            held = float(reaches.min(initial=span))
            other = self._others.bound(here, held, known)
            step = min(held, other.step)
            last = steps >= reaches[self._groups]  # of a group that which holds furthest: others of it say nothing
            grazes = flat(expanded[last & (steps <= step)])
            grazes = grazes or (other.expansion is not None and flat(other.expansion[None]))
            if step <= least < span / SHRINK and not grazes:  # bounds on so long a way may say nothing
                span /= SHRINK
                continue
            if step <= least or grazes:
                stop = self._stopped(float(x), expanded, steps, other)
                if x > 0 or stop.expansion is None or not flat(stop.expansion[None]) or not self._leaves(x):
                    return stop
                self.proved = False  # it touches zero where the march starts, and rises
                step = math.sqrt(DEFAULT.tie) * self.unit
            x, span = x + step, 2.0 * span if step >= span else max(4.0 * step, least)
        self.proved = False
        return Stop(x, (Cause("search", -1, "too many steps"),))

    def _leaves(self, x: float) -> bool:
        """Tell whether conditions that touch zero at x are met a little further on."""
        expanded = self._stretch(x + math.sqrt(DEFAULT.tie) * self.unit).expanded(self._conditions)
        return bool((self._reaches((expanded[:, 0] > ROUNDING * expanded[:, 3]).astype(float)) > 0).all())

    def _stopped(self, x: float, expanded: Array, steps: Array, other: PairBound) -> Stop:
        """Return the stop at x, with all that fails there."""
        if other.expansion is not None and other.parts is not None:
            cause = Cause("overlap", -1, f"{self._in_words(x, other.parts)} come to overlap")
            return Stop(x, (cause,), other.expansion, other.condition)
        best: dict[int, int] = {}
        for row, group in enumerate(self._groups.tolist()):
            if group not in best or steps[row] > steps[best[group]]:
                best[group] = row
        ahead = roots(expanded)
        rows = sorted(best.values(), key=lambda row: (float(steps[row]), float(ahead[row])))
        near = [row for row in rows if ahead[row] <= CLOSE * self.unit] or rows[:1]
        kinds = {self._causes[self._groups[row]].kind for row in near}
        if "parallel lines" in kinds:  # what is scaled by their determinant vanishes with it
            if parallel := self._parallel(x):
                return Stop(x, tuple(parallel), expanded[near[0]], self._conditions.chosen([near[0]]))
            neighbours = [row for row in near if self._causes[self._groups[row]].kind == "neighbour"]
            near = neighbours or [row for row in near if self._causes[self._groups[row]].kind == "parallel lines"]
        elif "scale" in kinds:
            near = [row for row in near if self._causes[self._groups[row]].kind == "scale"]
        first, *others = dict.fromkeys(self._causes[self._groups[row]] for row in near)
        causes = sorted((first, *others), key=lambda own: (own.kind != first.kind, own.feature, own.what))
        return Stop(x, tuple(causes), expanded[near[0]], self._conditions.chosen([near[0]]))

    def _in_words(self, x: float, parts: tuple[int, int]) -> str:
        """Return what of two parts touches at x, by its faces; the parts where that is not known."""
        here, bodies = self._stretch(x), self._problem.active
        pose = np.concatenate([here.R[0].ravel(), here.d[0]])
        met = meetings(*bodies, pose, here.rho, DEFAULT.snap * self._problem.size)
        feature = next((own.contact.feature for own in met if own.parts == parts), None)
        return feature.in_words(*bodies) if feature else pair_in_words(*bodies, parts)

    def _parallel(self, x: float) -> list[Cause]:
        """Return the tracked features whose edges are parallel at x: their lines vanish, and the pair with them."""
        causes = []
        for k in range(len(self._tracked.lines)):
            sine_squared = self._stretch(x).expanded(Conditions.of(forms.STEEP, k))[0, 0]
            if sine_squared <= CLOSE * CLOSE:
                causes.append(Cause("parallel edges", k, KINDS["parallel edges"]))
        return causes

    def _taken_over(self, stop: Stop) -> bool:
        """Go over to another part pair on which the same features rest, where there is one."""
        here = self._stretch(stop.x)
        for k in sorted({cause.feature for cause in stop.causes if cause.feature >= 0}):
            before = self._rests
            for rest in self._followed[k].rests:
                if rest is not before[k] and self._meets(rest, here):
                    self._rest_on([rest if place == k else other for place, other in enumerate(before)])
                    if self._goes_on(stop.x):
                        return True
            self._rest_on(before)
        return False

    def _meets(self, rest: Rest, here: RayStretch) -> bool:
        """Tell whether boxes about the elements of a part pair meet; what is not told is no reason to leave it out."""
        one, two = rest.corners
        X, Y = here.rho[0] * one @ here.R[0].T - here.d[0], here.rho[1] * two
        away = np.maximum(Y.min(axis=0) - X.max(axis=0), X.min(axis=0) - Y.max(axis=0)).max()
        return not away > DEFAULT.snap * (np.abs(X).max() + np.abs(Y).max())

    def _goes_on(self, x: float) -> bool:
        """Tell whether all conditions hold at x to within rounding, and for some way on."""
        expanded = self._stretch(x, self.unit).expanded(self._conditions)
        near = is_tied(expanded)
        expanded[near, 0] = np.maximum(expanded[near, 0], 0.0)
        return bool(self._reaches(safe_steps(expanded, self.unit)).min(initial=np.inf) > CLOSE * self.unit)

    def settled(self, stop: Stop) -> tuple[float, float, bool]:
        """Return where a condition that stops the march fails, how far off that may be, and whether it only grazes."""
        x = stop.x
        if x == 0.0 or stop.expansion is None or stop.condition is None:
            return x, 0.0, False
        _, slope, bend, terms = stop.expansion.tolist()
        rounding = ROUNDING * terms
        if flat(stop.expansion[None]):
            wide = min(8.0 * math.sqrt(rounding / bend) if bend > 0 else math.inf, GRAZE * self.unit)
            crossing = self._ray.crossing(x, wide, self._tracked, stop.condition)
            return (x, wide, True) if crossing is None else (crossing, VERIFIED * crossing, False)
        error = rounding / abs(slope) if slope else math.inf
        if error > FINE * x:
            wide = min(8.0 * error, CLOSE * self.unit)
            better = self._ray.crossing(x - wide, 2.0 * wide, self._tracked, stop.condition, (1.0,))
            if better is not None and better > x - wide:
                return better, VERIFIED * better, False
        return x, error, False


class PairBound(NamedTuple):
    """How far a part pair surely does not overlap, and what ends that: a condition and its expansion, if any does."""

    step: float
    parts: tuple[int, int] | None = None
    expansion: Array | None = None
    condition: Conditions | None = None


class ProvedSeparations(NamedTuple):
    """What earlier steps of a march found of part pairs.

    `apart_to`, (pairs,): up to where on the ray each does not overlap. `directions`: that pairs are apart along the
    direction that proved so last, which may do further on too.
    """

    apart_to: Array
    directions: dict[int, Conditions]


class Others:
    """All part pairs of two bodies along a ray; what vanishes identically is told over x up to `within`."""

    def __init__(self, movable: Body, static: Body, ray: Ray, within: float) -> None:
        self._bodies, self._ray, self._within = (movable, static), ray, within
        self._tie = DEFAULT.tie * max(movable.size, static.size)
        self.pairs = [(i, j) for i in range(len(movable.parts)) for j in range(len(static.parts))]
        self._tracked: set[tuple[int, int]] = set()
        self._samples: list[RayStretch] = []
        (c1, r1), (c2, r2) = _balls(movable), _balls(static)
        i, j = np.array(self.pairs).T
        self._spheres = c1[i], c2[j], np.column_stack([r1[i], r2[j]])
        self._points = [np.concatenate([part.vertices for part in body.parts]) - body.seed for body in self._bodies]
        self._planes: list[tuple[Conditions, Conditions]] = []

    def without(self, pair: TrackedPair, parts: set[tuple[int, int]]) -> Others:
        """Return those without the part pairs that are tracked, which give the scale pair."""
        made = copy(self)
        made._tracked = parts
        made._samples = [self._ray.stretch(share * self._within, 0.0, pair) for share in SAMPLES]
        v, w = self._points
        made._planes = [
            (Conditions.of(forms.OWN, k, v=v - line[7:10], sign=-1.0), Conditions.of(forms.OTHER, k, w=w - line[10:]))
            for k, line in enumerate(pair.lines)
        ]
        return made

    def vanishing(self, conditions: Conditions) -> Array:
        """Return which conditions are zero all along: those that the tracked pair keeps by itself, and alignments."""
        zero = np.ones(len(conditions.rows), dtype=bool)
        for sample in self._samples:
            zero &= is_tied(sample.expanded(conditions))
        return zero

    def bound(self, at: RayStretch, step: float, known: ProvedSeparations) -> PairBound:
        """Return how far none overlaps but those tracked, at most a given step.

        Spheres about the parts settle most pairs, and planes of tracked features between them; of the others the
        direction that separates them best at x does, as long as it still separates: where they come to touch, steps
        close in on that as fast as Newton's. What is found is added to what is `known` from earlier steps to this side.
        """
        best = PairBound(step)
        if len(self._tracked) == len(self.pairs) or step <= 0:
            return best
        rho, (v, w, radii) = at.rho, self._spheres
        directions = at.d[0] + rho[1] * w - rho[0] * v @ at.R[0].T
        directions /= np.maximum(np.linalg.norm(directions, axis=1), np.finfo(float).tiny)[:, None]
        steps = safe_steps(at.expanded(Conditions.of(forms.ALONG, v=v, w=w, m=directions, radii=radii)), at.span)
        if steps.min() >= best.step:
            return best
        steps = np.maximum(np.maximum(steps, self._in_planes(at)), known.apart_to - at.x)
        near = [k for k in np.flatnonzero(steps < best.step).tolist() if k in known.directions]
        if near:
            conditions = [known.directions[k] for k in near]
            held = np.minimum(safe_steps(at.expanded(Conditions.joined(conditions)), at.span), at.span)
            starts = np.cumsum([0, *(len(own.rows) for own in conditions[:-1])])
            steps[near] = np.maximum(steps[near], np.minimum.reduceat(held, starts))
            known.apart_to[near] = at.x + steps[near]
        for k in np.argsort(steps).tolist():
            if steps[k] >= best.step:
                break
            if self.pairs[k] not in self._tracked:
                bound, known.directions[k] = self._pair_bound(self.pairs[k], at)
                known.apart_to[k] = at.x + max(steps[k], bound.step)
                best = bound if bound.step < best.step else best
        return best

    def _in_planes(self, at: RayStretch) -> Array:
        """Return how far either part of each pair stays on its side of a tracked feature's plane, (pairs,)."""
        best, rows = np.full(len(self.pairs), -1.0), np.array(self.pairs).T
        for both in self._planes:
            held = []
            for own, body, row in zip(both, self._bodies, rows, strict=True):
                expanded = at.expanded(own)
                tied = is_tied(expanded)
                tied[tied] = self.vanishing(own.chosen(tied))
                steps = np.where(tied, np.inf, safe_steps(expanded, at.span))
                starts = np.cumsum([0, *(len(part.vertices) for part in body.parts[:-1])])
                held.append(np.minimum.reduceat(steps, starts)[row])
            best = np.maximum(best, np.minimum(*held))
        return best

    def _pair_bound(self, parts: tuple[int, int], at: RayStretch) -> tuple[PairBound, Conditions]:
        """Return the furthest that one of the directions proves which separate a part pair best at x, and that one."""
        options = self._separating_conditions(parts, at)
        conditions = Conditions.joined(options)
        expanded = at.expanded(conditions)
        tied = is_tied(expanded)
        if tied.any():
            tied[tied] = self.vanishing(conditions.chosen(tied))
        steps = np.where(tied, np.inf, safe_steps(expanded, at.span))
        best, furthest, start = PairBound(-1.0), options[0], 0
        for option in options:
            worst = start + int(np.argmin(steps[start : start + len(option.rows)]))
            start += len(option.rows)
            if min(steps[worst], at.span) > best.step:
                ends = (None, None) if tied[worst] else (expanded[worst], conditions.chosen([worst]))
                best, furthest = PairBound(float(min(steps[worst], at.span)), parts, *ends), option
        return best, furthest

    def _separating_conditions(self, parts: tuple[int, int], at: RayStretch) -> list[Conditions]:
        """Return the conditions that a part pair is apart along the directions that separate it best at x.

        A direction of a face turns with it; that of two edges is held, as it is the best one there to first order. A
        pair that touches in a tracked feature's plane goes on to do so: its normal counts too.
        """
        one, two = (body.parts[k] for body, k in zip(self._bodies, parts, strict=True))
        X, Y = one.vertices - one.seed, two.vertices - two.seed
        sites, rows = kernels.facet_rows(*one.packed, *two.packed, np.concatenate([at.R[0].ravel(), at.d[0]]))
        separations = rows[:, 5] - rows[:, 3:5] @ at.rho
        best, options = float(separations.max()), []
        for k in np.flatnonzero(separations >= best - self._tie)[:TIED]:
            (kind, i, j), n = sites[k].tolist(), rows[k, :3]
            if kind == kernels.F1V2:
                options.append(Conditions.of(forms.ALONG_TURNED, v=X[one.loops[i][0]], w=Y, m=one.normals[i]))
            elif kind == kernels.V1F2:
                options.append(Conditions.of(forms.ALONG, v=X, w=Y[two.loops[j][0]], m=-two.normals[j]))
            else:
                options.append(Conditions.of(forms.ALONG, v=X, w=Y[np.argmin(Y @ n)], m=n))
        if best <= self._tie:
            v, w = np.repeat(X, len(Y), axis=0), np.tile(Y, (len(X), 1))
            options += [Conditions.of(forms.NORMAL, k, v=v, w=w) for k in range(len(at.tracked.lines))]
        return options


def _balls(body: Body) -> tuple[Array, Array]:
    """Return centres, relative to the seed, and radii of balls about a body's parts."""
    local = [part.vertices - part.seed for part in body.parts]
    centres = np.array([(points.min(axis=0) + points.max(axis=0)) / 2 for points in local])
    radii = [np.linalg.norm(points - centre, axis=1).max() for points, centre in zip(local, centres, strict=True)]
    return centres, np.array(radii)
