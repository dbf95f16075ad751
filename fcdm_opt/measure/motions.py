"""The smallest motion by rival methods: general searches that know nothing of how the problem is built.

All of them ask the same of a motion q, as numbers e = 0 and g >= 0 in typical amounts (`Asked`): that the tracked pair
is where the goal wants it, that the tracked features are the contact at some points of the way, the state of the parts
made, keep-outs and limits. They differ in how they look for the least amount. What a method cannot express it refuses.
A motion that a method returns is worth what the judge says of it: `judged`.

A method is one function and one row of `RIVALS`.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from time import perf_counter
from typing import Any

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt.tolerance.certificate import verify
from fcdm_opt.tolerance.problem import Problem
from fcdm_opt.tolerance.solution import Solution, Status
from fcdm_opt.tolerance.solver import reported
from fcdm_opt.tolerance.stages.full import modelled_in_full
from fcdm_opt.tolerance.stages.seat import independent, tilts
from fcdm_opt.tolerance.task import Answer, Task
from fcdm_opt.tolerances import DEFAULT

# The paper prints one parameter of a pair as 0.25, 6 or 2 degrees, the other with four decimals: lengths and degrees.
COARSE = {"translation": 1e-2, "rotation": math.radians(1.0)}
FINE = {"translation": 1e-4, "rotation": math.radians(1e-4)}
NODES, HITS = 20_000, 8  # of a grid: looked at in all, and refined
WAY = (0.25, 0.5, 0.75, 1.0)  # positions on the way at which a rival looks at the tracked contact
PENALTIES = (1e1, 1e3, 1e5, 1e7)  # one search each, from where the last one ended
SIMPLEX, POPULATION, GENERATIONS = 150, 12, 60  # evaluations a parameter; members a parameter, and generations
MEMBERS = 40  # at least
WIDE = 20.0  # typical amounts: half the width in which differential evolution looks
STARTS, SPREAD = 12, (1.0, 4.0, 16.0)  # starts of a multistart, and how far from rest they are drawn, typical amounts
QUERIES = 12_000  # poses after which a multistart begins no further start, and an evolution no further generation
ITERATIONS, TRUST_ITERATIONS = 120, 150
DIFFERENCE = 1e-7  # of typical amounts, for derivatives: half the digits of the conditions
CORRECTIONS = 8  # Newton steps that bring a motion onto its conditions
ACCEPTED = 1e-7  # typical amounts by which conditions may be missed where a motion is handed to the judge
FAR = 1e3  # typical amounts: stands for conditions that cannot be computed
SCAN = 60  # steps of a typical amount's half along one parameter, each way


@dataclass(frozen=True, eq=False)
class Attempt:
    """What a rival method made of a problem.

    Attributes
    ----------
    q : (k,) array or None
        Motion parameters; None where none was found.
    queries : int
        Poses of the bodies that were looked at.
    evaluations : int
        Times that amount or conditions of a motion were asked for.
    seconds : float
    """

    q: Array | None
    queries: int
    evaluations: int
    seconds: float


class Asked:
    """What a problem asks of a motion, as numbers; counts how often it is asked.

    Parameters
    ----------
    task : Task
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self.queries = self.evaluations = 0
        self.scales = task.unit / task.weights  # a typical amount in each parameter
        self._last: tuple[bytes, tuple[Array, Array]] | None = None
        self._rows: list[int] | None = None

    @property
    def bounds(self) -> Array:
        """Limits in typical amounts, (k, 2)."""
        return self.task.limits / self.scales[:, None]

    def amount(self, z: Array) -> float:
        """Return half the square of the amount of a motion, given in typical amounts: it is smooth at rest."""
        self.evaluations += 1
        return 0.5 * (self.task.amount(z * self.scales) / self.task.unit) ** 2

    def conditions(self, z: Array) -> tuple[Array, Array]:
        """Return (e, g) of a motion: e = 0 and g >= 0 are asked."""
        self.evaluations += 1
        key = np.ascontiguousarray(z).tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, self._conditions(z * self.scales)
        return self._last[1]

    def missed(self, z: Array) -> Array:
        """Return by how much each condition is missed, none negative."""
        e, g = self.conditions(z)
        return np.concatenate([np.abs(e), np.maximum(-g, 0.0)])

    def stacked(self, z: Array) -> Array:
        """Return all conditions in one row."""
        return np.concatenate(self.conditions(z))

    def slopes(self, z: Array) -> Array:
        """Return derivatives of `stacked`, (rows, k), by central differences."""
        steps = DIFFERENCE * np.eye(len(z))
        return np.column_stack([(self.stacked(z + d) - self.stacked(z - d)) / (2.0 * DIFFERENCE) for d in steps])

    def restored(self, z: Array) -> Array | None:
        """Return a motion on the conditions near one that nearly meets them, None where it does not come near."""
        for _ in range(CORRECTIONS):
            missed = self.missed(z)
            if not missed.max(initial=0.0) > DEFAULT.solver:
                break
            e, _ = self.conditions(z)
            rows = np.append(np.ones(len(e), dtype=bool), missed[len(e) :] > 0)
            values, slopes = self.stacked(z)[rows], self.slopes(z)[rows]
            if not (np.isfinite(values).all() and np.isfinite(slopes).all()):
                return None
            z = np.clip(z - np.linalg.lstsq(slopes, values, rcond=None)[0], *self.bounds.T)
        return z * self.scales if self.missed(z).max(initial=0.0) <= ACCEPTED else None

    # ------------------------------------------------------------------------------------------------- conditions

    def _conditions(self, q: Array) -> tuple[Array, Array]:
        nothing: tuple[list[Array], list[Array]] = ([], [])
        tracked = self._tracked(q) if self.task.tracked else nothing
        made = self._parts_made(q) if np.isfinite(self.task.needs).any() else nothing
        e, g = (np.concatenate([np.empty(0), *one, *two]) for one, two in zip(tracked, made, strict=True))
        return np.nan_to_num(e, nan=FAR), np.nan_to_num(g, nan=-FAR)

    def reaches(self, q: Array) -> bool:
        """Tell whether the tracked pair, or else the gap of the parts made, is where it should be: a first sieve."""
        task = self.task
        self.evaluations, self.queries = self.evaluations + 1, self.queries + 1
        if not task.tracked:
            return min(task.misses(q)) >= 0
        return bool(((task.tracked_contact(q)[0] - task.target) * task.signs >= 0).all())

    def _tracked(self, q: Array) -> tuple[list[Array], list[Array]]:
        task = self.task
        if task.goal == "seat":
            return [self._seated(q)], self._real(q)
        if len(task.tracked) == 1:
            self.queries += 1
            return [task.line_gaps(q)[1] / task.unit], self._real(q)
        self.queries += 1
        off = (task.tracked_contact(q)[0] / task.target - 1.0) * (task.size / task.unit)
        return ([], [off * task.signs, *self._real(q)]) if task.goal == "beyond" else ([off], self._real(q))

    def _seated(self, q: Array) -> Array:
        """Return misalignments and gaps of flush contacts, without those that depend on others."""
        if self._rows is None:
            self._rows = []
            beside = np.linspace(0.5, 1.0, len(q)) * (self.task.limits != 0).any(axis=1) * self.scales * DIFFERENCE**0.5
            steps = np.diag(DIFFERENCE * self.scales)
            rates = [(self._seats(beside + d) - self._seats(beside - d)) / (2.0 * DIFFERENCE) for d in steps]
            self._rows = independent(np.column_stack(rates))
        return self._seats(q)[self._rows]

    def _seats(self, q: Array) -> Array:
        task = self.task
        self.queries += 1
        R = task.transform(q)[:3, :3]
        turns = [turn for seat in task.seats for turn in seat.turns]
        tilted = tilts(task.seats, task.spins) @ q if task.coherent else np.array([m @ R @ p for m, p in turns])
        return np.concatenate([tilted * task.size, task.line_gaps(q)[1]]) / task.unit

    def _real(self, q: Array) -> list[Array]:
        """Return what makes the tracked features the contact: nothing sticks out, touching, nothing else overlaps."""
        return [self._real_at(q, s) for s in (WAY if self.task.coherent else WAY[-1:])]

    def _real_at(self, q: Array, s: float) -> Array:
        task = self.task
        self.queries += 1
        rho, pose, tracked = task.tracked_contact(q, s)
        row = np.full(2 * len(tracked) + 2, -FAR)
        if not (np.isfinite(rho).all() and rho.min() > 0 and np.isfinite(pose).all()):
            return row
        R, separation = pose[:9].reshape(3, 3), -np.inf
        for k, (feature, inner) in enumerate(zip(tracked, self._inner, strict=True)):
            one, two = task.movable.parts[feature.parts[0]], task.static.parts[feature.parts[1]]
            first, second = (one.vertices - one.seed) @ (feature.normal @ R), (two.vertices - two.seed) @ feature.normal
            row[2 * k] = rho[0] * (feature.line[0] - first[inner[0]].max(initial=-np.inf))
            row[2 * k + 1] = rho[1] * (feature.line[1] + second[inner[1]].min(initial=np.inf))
        pairs = {feature.parts for feature in tracked}
        for i, j in pairs:
            sites, facets = kernels.facet_rows(*task.movable.parts[i].packed, *task.static.parts[j].packed, pose)
            own = np.logical_or.reduce([(sites == other.site).all(1) for other in tracked if other.parts == (i, j)])
            separations = facets[:, 5] - facets[:, 3:5] @ rho
            separation = max(separation, separations[~own].max(initial=-np.inf))
        gaps = np.full((len(task.movable.parts), len(task.static.parts)), np.inf)
        if len(pairs) < gaps.size:
            gaps = kernels.near_gaps(*task.movable.packed, *task.static.packed, pose, rho, 0.0)
            gaps[tuple(np.transpose(list(pairs)))] = np.inf
        row[-2:] = -separation, gaps.min()
        return np.minimum((row + self._slack) / task.unit, FAR)

    @cached_property
    def _slack(self) -> float:
        """Length by which a contact may be missed on the way, as in the solver."""
        return DEFAULT.cut * self.task.size

    @cached_property
    def _inner(self) -> list[tuple[Any, Any]]:
        """Of each tracked feature, which vertices of both parts are not in its plane at rest."""
        task = self.task
        found = []
        _, pose, tracked = task.tracked_contact(task.rest)
        R = pose[:9].reshape(3, 3)
        for feature in tracked:
            one, two = task.movable.parts[feature.parts[0]], task.static.parts[feature.parts[1]]
            first = feature.line[0] - (one.vertices - one.seed) @ (feature.normal @ R)
            second = feature.line[1] + (two.vertices - two.seed) @ feature.normal
            found.append((first > self._slack, second > self._slack))
        return found

    def _parts_made(self, q: Array) -> tuple[list[Array], list[Array]]:
        """Return what is asked of the pair made, and of keep-outs."""
        task = self.task
        self.queries += 1
        gaps = self.gaps(q)
        count = len(task.static.parts)
        others = (gaps - task.needs)[:, count:].min(axis=0, initial=FAR * task.unit) / task.unit
        own = np.array([gaps[:, :count].min()]) / task.unit
        if task.must_touch:
            return [own], [others]
        return [], [own - task.need / task.unit if task.must_clear else np.empty(0), others]

    def gaps(self, q: Array) -> Array:
        """Return signed gaps of all part pairs, (parts of 1, opponents)."""
        return self.task.pair_gaps(q)


class AskedOfCoal(Asked):
    """The same conditions, with gaps from a collision library: distances, and minus penetration depths."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        bodies = [task.static, *(keep_out.body for keep_out in task.keep_out)]
        self._pairs = [ScaledPair(task.movable, body) for body in bodies]
        self._rho = [np.array([task.target[0], s]) for s in (task.target[1], *(own.ends[1] for own in task.keep_out))]

    def gaps(self, q: Array) -> Array:
        """Return coal's signed distances."""
        T = self.task.transform(q)
        return np.hstack([pair.distances(rho, T) for pair, rho in zip(self._pairs, self._rho, strict=True)])


# --------------------------------------------------------------------------------------------------- the methods

Search = Callable[[Asked], "Array | None"]


def grid(asked: Asked) -> Array | None:
    """Look at motions on a grid as the paper does (Fig. 2), least amount first, at the resolution that it prints.

    With several parameters all go in coarse steps; from the first nodes that will do each parameter in turn goes back
    in fine ones. A single parameter goes in fine steps.
    """
    task = asked.task
    kinds = [kind for _, kind in task.motion.parameters]
    coarse, fine = (np.array([steps[kind] for kind in kinds]) for steps in (COARSE, FINE))

    def will_do(q: Array) -> bool:
        if not (task.allows(q) and asked.reaches(q)):
            return False
        e, g = asked.conditions(q / asked.scales)
        return len(e) == 0 and bool(g.min(initial=0.0) >= 0)

    best: list[Array] = []
    steps = coarse if len(kinds) > 1 else fine
    for node in _by_amount(task, steps):
        if asked.queries > NODES:
            break
        if will_do(node * steps):
            best.append(node * steps)
            if len(best) == (HITS if len(kinds) > 1 else 1):
                break
    if len(kinds) > 1:
        best += [_back(q, k, fine[k], will_do) for q in list(best) for k in range(len(kinds))]
    return min(best, key=task.amount, default=None)


def _by_amount(task: Task, steps: Array) -> Iterator[Array]:
    """Yield grid nodes, whole numbers a parameter, by increasing weighted amount."""
    lengths = task.weights * steps
    heap: list[tuple[float, tuple[int, ...]]] = [(0.0, (0,) * len(steps))]
    for _ in range(NODES):
        _, node = heapq.heappop(heap)
        yield np.array(node)
        last = max((k for k, x in enumerate(node) if x), default=0)
        for k in range(last, len(node)):  # every node once: only the last parameter in use grows, or a later one starts
            for x in (1, -1) if node[k] == 0 else (int(math.copysign(1, node[k])),):
                further = (*node[:k], node[k] + x, *node[k + 1 :])
                heapq.heappush(heap, (float(np.linalg.norm(lengths * further)), further))


def _back(q: Array, k: int, step: float, will_do: Callable[[Array], bool]) -> Array:
    """Take parameter k back towards zero in fine steps as far as a bisection among them finds that it will do."""
    good, bad = round(q[k] / step), 0
    while abs(good - bad) > 1:
        middle = (good + bad) // 2
        changed = q.copy()
        changed[k] = middle * step
        if will_do(changed):
            good = middle
        else:
            bad = middle
    changed = q.copy()
    changed[k] = good * step
    return changed


def nelder_mead(asked: Asked) -> Array | None:
    """Simplex search of Nelder and Mead with a penalty for what is missed, harder from round to round."""
    from scipy.optimize import minimize

    z = asked.task.start / asked.scales
    for penalty in PENALTIES:
        z = minimize(
            partial(_penalised, asked, penalty),
            z,
            method="Nelder-Mead",
            bounds=asked.bounds,
            options={"maxfev": SIMPLEX * len(z), "xatol": DEFAULT.requirement, "fatol": DEFAULT.requirement**2},
        ).x
    return asked.restored(z)


def _penalised(asked: Asked, penalty: float, z: Array) -> float:
    return asked.amount(z) + penalty * float(np.sum(asked.missed(z) ** 2))


def slsqp(asked: Asked, starts: int = 1) -> Array | None:
    """Sequential least squares programming from rest, and from some seeded starts; the least is kept."""
    from scipy.optimize import minimize

    e, g = asked.conditions(asked.task.start / asked.scales)
    constraints = [{"type": kind, "fun": lambda z, k=k: asked.conditions(z)[k]}
                   for k, (kind, rows) in enumerate((("eq", e), ("ineq", g))) if len(rows)]  # fmt: skip
    found = []
    for z in _starts(asked, starts):
        if asked.queries > QUERIES:
            break
        made = minimize(
            asked.amount,
            z,
            method="SLSQP",
            bounds=asked.bounds,
            constraints=constraints,
            options={"maxiter": ITERATIONS, "ftol": DEFAULT.cut**2},
        ).x
        q = asked.restored(made) if np.isfinite(made).all() else None
        if q is not None:
            found.append(q)
    return min(found, key=asked.task.amount, default=None)


def _starts(asked: Asked, count: int) -> Iterator[Array]:
    """Yield the start nearest to rest, then seeded ones around it, farther and farther."""
    start, rng = asked.task.start / asked.scales, np.random.default_rng(0)
    yield start
    most = np.array([math.pi if kind == "rotation" else np.inf for _, kind in asked.task.motion.parameters])
    for k in range(1, count):
        away = rng.normal(size=len(start)) * SPREAD[k % len(SPREAD)] / math.sqrt(len(start))
        yield np.clip(start + np.clip(away, -most / asked.scales, most / asked.scales), *asked.bounds.T)


def trust_constr(asked: Asked) -> Array | None:
    """Trust region interior point method of scipy, from rest."""
    import warnings

    from scipy.optimize import BFGS, Bounds, NonlinearConstraint, minimize

    z = asked.task.start / asked.scales
    e, g = asked.conditions(z)
    kinds = ((0, len(e), 0.0), (1, len(g), np.inf))
    constraints = [
        NonlinearConstraint(lambda z, k=k: asked.conditions(z)[k], np.zeros(n), np.full(n, high), hess=BFGS())
        for k, n, high in kinds
        if n
    ]
    free = not np.isfinite(asked.bounds).any()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its quasi-Newton updates, where a condition's slope does not change
        made = minimize(
            asked.amount,
            z,
            method="trust-constr",
            bounds=None if free else Bounds(*asked.bounds.T),
            constraints=constraints,
            options={
                "maxiter": TRUST_ITERATIONS,
                "gtol": DEFAULT.line,
                "xtol": DEFAULT.line,
                "barrier_tol": DEFAULT.line,
                "factorization_method": "SVDFactorization",  # equations may outnumber parameters, or depend on others
            },
        ).x
    return asked.restored(made)


def differential_evolution(asked: Asked) -> Array | None:
    """Differential evolution of scipy with the penalty, seeded, within some typical amounts of rest."""
    from scipy.optimize import differential_evolution as evolve

    task = asked.task
    turn = np.array([math.pi if kind == "rotation" else np.inf for _, kind in task.motion.parameters]) / asked.scales
    start = task.start / asked.scales
    half = np.minimum(WIDE, turn)
    low, high = np.maximum(asked.bounds[:, 0], start - half), np.minimum(asked.bounds[:, 1], start + half)
    if (high <= low).all():
        return asked.restored(start)
    made = evolve(
        partial(_penalised, asked, PENALTIES[1]),
        np.column_stack([low, np.maximum(high, low)]),
        popsize=max(POPULATION, MEMBERS // len(start)),
        maxiter=GENERATIONS,
        tol=DEFAULT.nominal,
        rng=0,
        polish=False,
        callback=lambda *_: asked.queries > QUERIES,
    )
    return asked.restored(made.x)


def coal_in_the_loop(asked: Asked) -> Array | None:
    """Bisect along one parameter, or use SLSQP, with a collision library's distances as conditions."""
    task = asked.task
    if len(task.weights) > 1:
        return slsqp(asked)
    found = [q for sign in (1.0, -1.0) if (q := _bisected(asked, sign)) is not None]
    return min(found, key=task.amount, default=None)


def _bisected(asked: Asked, sign: float) -> Array | None:
    """Step away from rest until the conditions are met, or the gap changes its sign, then bisect."""
    low, high = asked.bounds[0]
    start = float(np.clip(0.0, low, high))

    def miss(x: float) -> float:
        e, g = asked.conditions(np.array([x]))
        return float(e[0] if len(e) else g.min())

    before, value = start, miss(start)
    for k in range(1, SCAN + 1):
        here = float(np.clip(start + sign * k / 2.0, low, high))
        if here == before:
            break
        ahead = miss(here)
        if ahead * value <= 0:
            left, right = before, here
            while abs(right - left) > DEFAULT.line * abs(right):
                middle = (left + right) / 2.0
                if middle in (left, right):
                    break
                left, right = (middle, right) if miss(middle) * value > 0 else (left, middle)
            if (q := asked.restored(np.array([right]))) is not None:
                return q
        before, value = here, ahead
    return None


def ipopt_in_full(asked: Asked) -> Array | None:
    """IPOPT on the full model, everything in one program, from one start."""
    outcome = modelled_in_full(asked.task)
    asked.evaluations += outcome.evaluations
    asked.queries += outcome.evaluations
    return outcome.q


# ---------------------------------------------------------------------------------------------- what each can take


def _anything(task: Task) -> str | None:
    return None


def _without_equations(task: Task) -> str | None:
    if task.goal in ("at", "seat") or task.must_touch:
        return "the nodes of a grid meet no equation: goals beyond and clear only"
    return None


def _without_features(task: Task) -> str | None:
    if task.tracked:
        return "a collision library does not tell features: goals touch and clear only"
    if any(own.ends[0] < own.ends[1] for own in task.keep_out):
        return "a collision library is asked at one scale: no keep-out over a range of scales"
    return None


def _without_seats(task: Task) -> str | None:
    return "the full model has no rows for flush contacts" if task.goal == "seat" else None


@dataclass(frozen=True)
class Rival:
    """A rival method; call it with a problem.

    Attributes
    ----------
    name : str
    search : callable
        What a problem asks -> motion parameters, or None.
    refuses : callable
        Task -> why the method cannot express it, or None.
    asks : type
        `Asked`, or a kind of it.
    """

    name: str
    search: Search
    refuses: Callable[[Task], str | None] = _anything
    asks: Callable[[Task], Asked] = field(default=Asked)

    def __call__(self, problem: Problem) -> Attempt:
        """Search for the smallest motion.

        Parameters
        ----------
        problem : Problem

        Raises
        ------
        InputError
            For what the method cannot express, and where more than two features meet and none are named.
        """
        if problem.feature_pairs:
            raise InputError(
                "a rival tracks two features",
                key="features",
                found=f"{len(problem.feature_pairs)} pairs of them at this switching point",
                allowed="the names of two",
            )
        start = perf_counter()
        task = Task.of(problem)
        reason = self.refuses(task)
        if reason is not None:
            raise InputError(reason, key=f"rival '{self.name}'", found=f"goal {task.goal!r}, pair {task.pair!r}")
        asked = self.asks(task)
        with np.errstate(all="ignore"):  # searches wander where nothing can be computed
            q = self.search(asked)
        if q is not None and not np.isfinite(q).all():
            q = None
        return Attempt(q, asked.queries, asked.evaluations, perf_counter() - start)


def judged(problem: Problem, q: Any) -> Solution:
    """Return a motion as a solution like the solver's own, with the judge's verdict.

    Parameters
    ----------
    problem : Problem
    q : (k,) floats
        Motion parameters, in order.
    """
    parameters = np.asarray(q, dtype=np.float64)
    status = Status.SOLVED if parameters.any() else Status.ALREADY_SATISFIED
    solution = reported(problem, Task.of(problem), Answer(status, parameters, "a rival's motion"))
    return solution.with_certificate(verify(solution), {})


RIVALS = {
    rival.name: rival
    for rival in (
        Rival("grid", grid, _without_equations),
        Rival("Nelder-Mead", nelder_mead),
        Rival("SLSQP", slsqp),
        Rival("SLSQP, multistart", partial(slsqp, starts=STARTS)),
        Rival("trust-constr", trust_constr),
        Rival("differential evolution", differential_evolution),
        Rival("IPOPT, full model", ipopt_in_full, _without_seats),
        Rival("coal in the loop", coal_in_the_loop, _without_features, AskedOfCoal),
    )
}
