"""The smallest motion by rival methods: general searches that know nothing of how the problem is built, and by ours.

All rivals ask the same of a motion q, as numbers e = 0 and g >= 0 in typical amounts (`Asked`), and differ in how they
look for the least amount. What they end with is brought onto the conditions by a few Newton steps, as any user would
do, and is not judged: `judged` tells what it is worth. Ours is the toolkit's own `solve`, of which the verification is
part: its time holds the judge's, a rival's does not.

A question is a problem that nobody has solved yet; methods prepare for no subject. What a method cannot express it
refuses, see `Method.refuses`: asked all the same, it says so in a `Failure`.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.judge.certificate import verify
from fcdm_opt.model.reported import reported
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.solver import solve
from fcdm_opt.stages.full import modelled_in_full
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.library import library, rounding_upward
from fcdm_opt_benchmarks.method import Ask, Failure, Method, MotionAnswer, anything, one_by_one
from fcdm_opt_benchmarks.motions import outside
from fcdm_opt_benchmarks.motions.asked import Asked, AskedOfCoal

# The paper prints one parameter of a pair as 0.25, 6 or 2 degrees, the other with four decimals: lengths and degrees.
COARSE = {"translation": 1e-2, "rotation": math.radians(1.0)}
FINE = {"translation": 1e-4, "rotation": math.radians(1e-4)}
NODES, HITS = 20_000, 8  # of a grid: looked at in all, and refined
PENALTIES = (1e1, 1e3, 1e5, 1e7)  # one search each, from where the last one ended
SIMPLEX = 200  # evaluations a parameter of one such search, scipy's own limit
MEMBERS, LEAST_MEMBERS = 12, 40  # of an evolution: a parameter, and in all
GENERATION_QUERIES = 200  # poses a generation, after which an evolution ends
WIDE = 20.0  # typical amounts: half the width in which differential evolution looks
SPREAD = (1.0, 4.0, 16.0)  # how far from rest the starts of a multistart are drawn, typical amounts
START_QUERIES = 1_000  # poses a start, after which a multistart begins no further one
ITERATIONS = 150
SCAN = 60  # steps of a typical amount's half along one parameter, each way
NEWTON = 50  # steps
COAL = 1e-6  # coal's own tolerance
NONE = "found no motion"


# --------------------------------------------------------------------------------------------------------------- grid


def grid(task: Task, factor: float) -> Array | None:
    """Look at motions on a grid as the paper does (Fig. 2), least amount first, at `factor` times the steps it prints.

    With several parameters all go in coarse steps; from the first nodes that will do each parameter in turn goes back
    in fine ones. A single parameter goes in fine steps.
    """
    asked = Asked(task)
    kinds = [kind for _, kind in task.motion.parameters]
    coarse, fine = (factor * np.array([steps[kind] for kind in kinds]) for steps in (COARSE, FINE))

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


# -------------------------------------------------------------------------------------------------- scipy's minimisers


def nelder_mead(task: Task, tolerance: float) -> Array | None:
    """Simplex search of Nelder and Mead with a penalty for what is missed, harder from round to round."""
    from scipy.optimize import minimize

    asked = Asked(task)
    z = task.start / asked.scales
    for penalty in PENALTIES:
        z = minimize(
            partial(_penalised, asked, penalty),
            z,
            method="Nelder-Mead",
            bounds=asked.bounds,
            options={"maxfev": SIMPLEX * len(z), "xatol": tolerance, "fatol": tolerance**2},
        ).x
    return asked.restored(z)


def _penalised(asked: Asked, penalty: float, z: Array) -> float:
    return asked.amount(z) + penalty * float(np.sum(asked.missed(z) ** 2))


class Sequential(NamedTuple):
    """Settings of SLSQP: relative change of the amount's square at which it stops, differences, and starts."""

    ftol: float
    central: bool = False
    starts: int = 1


def slsqp(task: Task, setting: Sequential) -> Array | None:
    """Sequential least squares programming from rest, and from some seeded starts; the least is kept."""
    asked = Asked(task)
    return _slsqp(asked, setting, partial(asked.slopes, central=setting.central))


def _slsqp(asked: Asked, setting: Sequential, slopes: Callable[[Array], Array]) -> Array | None:
    from scipy.optimize import minimize

    e, g = asked.conditions(asked.task.start / asked.scales)
    rows = {"eq": slice(0, len(e)), "ineq": slice(len(e), len(e) + len(g))}
    constraints = [
        {"type": kind, "fun": lambda z, own=own: asked.stacked(z)[own], "jac": lambda z, own=own: slopes(z)[own]}
        for kind, own in rows.items()
        if own.stop > own.start
    ]
    found = []
    for z in _starts(asked, setting.starts):
        if asked.queries > START_QUERIES * setting.starts > START_QUERIES:
            break
        made = minimize(
            asked.amount,
            z,
            jac=(lambda z: z) if asked.task.weighted else None,
            method="SLSQP",
            bounds=asked.bounds if np.isfinite(asked.bounds).any() else None,
            constraints=constraints,
            options={"maxiter": ITERATIONS, "ftol": setting.ftol},
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


def trust_constr(task: Task, tolerance: float) -> Array | None:
    """Trust region interior point method of scipy, from rest."""
    from scipy.optimize import BFGS

    options = {
        "maxiter": ITERATIONS,
        "gtol": tolerance,
        "xtol": tolerance,
        "barrier_tol": tolerance,
        "factorization_method": "SVDFactorization",  # equations may outnumber parameters, or depend on others
    }
    return _minimised(task, "trust-constr", options, hess=BFGS)


def cobyqa(task: Task, radius: float) -> Array | None:
    """Derivative-free trust region method of Ragonneau and Zhang, from rest, until its region is this small."""
    return _minimised(task, "COBYQA", {"initial_tr_radius": 1.0, "final_tr_radius": radius})


def _minimised(
    task: Task, method: str, options: Mapping[str, Any], hess: Callable[[], Any] | None = None
) -> Array | None:
    """Return what a method of scipy finds that takes nonlinear constraints; with derivatives where `hess` is given."""
    import warnings

    from scipy.optimize import Bounds, NonlinearConstraint, minimize

    asked = Asked(task)
    z = task.start / asked.scales
    e, g = asked.conditions(z)
    rows = ((slice(0, len(e)), 0.0), (slice(len(e), len(e) + len(g)), np.inf))
    constraints = []
    for own, high in rows:
        n = own.stop - own.start
        more = {} if hess is None else {"jac": lambda z, own=own: asked.slopes(z)[own], "hess": hess()}
        if n:
            values = partial(lambda own, z: asked.stacked(z)[own], own)
            constraints.append(NonlinearConstraint(values, np.zeros(n), np.full(n, high), **more))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of quasi-Newton updates, where a condition's slope does not change
        made = minimize(
            asked.amount,
            z,
            jac=(lambda z: z) if hess and task.weighted else None,
            method=method,
            bounds=Bounds(*asked.bounds.T) if np.isfinite(asked.bounds).any() else None,
            constraints=constraints,
            options=dict(options),
        ).x
    return asked.restored(made)


def differential_evolution(task: Task, generations: int) -> Array | None:
    """Differential evolution of scipy with the penalty, seeded, within some typical amounts of rest."""
    from scipy.optimize import differential_evolution as evolve

    asked = Asked(task)
    turn = np.array([math.pi if kind == "rotation" else np.inf for _, kind in task.motion.parameters]) / asked.scales
    start = task.start / asked.scales
    half = np.minimum(WIDE, turn)
    low, high = np.maximum(asked.bounds[:, 0], start - half), np.minimum(asked.bounds[:, 1], start + half)
    if (high <= low).all():
        return asked.restored(start)
    made = evolve(
        partial(_penalised, asked, PENALTIES[1]),
        np.column_stack([low, np.maximum(high, low)]),
        popsize=max(MEMBERS, LEAST_MEMBERS // len(start)),
        maxiter=generations,
        tol=DEFAULT.nominal,
        rng=0,
        polish=False,
        callback=lambda *_: asked.queries > GENERATION_QUERIES * generations,
    )
    return asked.restored(made.x)


# ------------------------------------------------------------------------------------------------ a collision library


class Library(NamedTuple):
    """Settings of a search with coal: relative width to which it is bisected, or of the last step, and coal's own."""

    width: float
    tolerance: float


def coal_in_the_loop(task: Task, setting: Library) -> Array | None:
    """Bisect along one parameter, or use SLSQP, with a collision library's distances as conditions."""
    asked = AskedOfCoal(task, setting.tolerance)
    if len(task.weights) > 1:
        return _slsqp(asked, Sequential(setting.width**2), asked.slopes)
    found = [q for sign in (1.0, -1.0) if (q := _bisected(asked, sign, setting.width)) is not None]
    return min(found, key=task.amount, default=None)


def _bisected(asked: Asked, sign: float, width: float) -> Array | None:
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
            while abs(right - left) > width * abs(right):
                middle = (left + right) / 2.0
                if middle in (left, right):
                    break
                left, right = (middle, right) if miss(middle) * value > 0 else (left, middle)
            if (q := asked.restored(np.array([right]))) is not None:
                return q
        before, value = here, ahead
    return None


def coal_with_newton(task: Task, setting: Library) -> Array | None:
    """Newton steps on coal's signed distance, whose slope its nearest points and normal give.

    Each step goes to the least motion at which the distance, taken as linear, is what is asked: with one parameter
    Newton's own, with more the projection of Hasofer and Lind. It knows of no limits.
    """
    asked = AskedOfCoal(task, setting.tolerance)
    z, last = np.zeros(len(task.weights)), np.inf
    for k in range(NEWTON):
        gap, slope = asked.nearest(z * asked.scales)
        gap, slope = gap - task.need, slope * asked.scales
        if k == 0 and gap >= 0 and not task.must_touch:
            return task.rest
        square = float(slope @ slope)
        if not square > 0:
            return None
        ahead = (float(slope @ z) - gap) / square * slope
        last, z = float(np.abs(ahead - z).max()), ahead
        if last <= setting.width * float(np.abs(z).max()):
            return z * asked.scales
    return None


# ------------------------------------------------------------------------------------------------------ the full model


def ipopt_in_full(task: Task, tolerance: float) -> Array | None:
    """IPOPT on the full model, everything in one program, from one start."""
    answer = modelled_in_full(task, tolerance=tolerance)
    return None if answer is None else answer.q


# ---------------------------------------------------------------------------------------------- what each can take


def _without_equations(problem: Problem) -> str | None:
    if problem.goal in ("at", "seat") or "touch" in (problem.goal, problem.pair):
        return "the nodes of a grid meet no equation: goals beyond and clear only"
    return None


def _without_features(problem: Problem) -> str | None:
    if problem.goal not in ("touch", "clear"):
        return "a collision library does not tell features: goals touch and clear only"
    if any(own.ends[0] < own.ends[1] for own in problem.keep_out):
        return "a collision library is asked at one scale: no keep-out over a range of scales"
    return None


def _with_one_distance(problem: Problem) -> str | None:
    if len(problem.movable.parts) * len(problem.static.parts) > 1 or problem.keep_out:
        return "Newton steps follow one distance: one part a body and no keep-outs"
    if np.isfinite(problem.limits).any() or problem.amount != "weighted":
        return "the projection knows neither limits nor other amounts"
    return _without_features(problem)


def _without_seats(problem: Problem) -> str | None:
    return "the full model has no rows for flush contacts" if problem.goal == "seat" else None


def _refused(refuses: Callable[[Problem], str | None], problem: Problem | None) -> str | None:
    if problem is None:
        return None
    if len(problem.contacts) > 1 and problem.goal in ("at", "seat", "fit"):
        return f"a rival tracks one contact, and {len(problem.contacts)} are asked for at once"
    if problem.feature_pairs:
        return f"a rival tracks two named features, and {len(problem.feature_pairs)} pairs of them are to choose from"
    return refuses(problem)


# ---------------------------------------------------------------------------------------------------------- the table

Search = Callable[[Task, Any], "Array | None"]


def _searched(search: Search, refuses: Callable[[Problem], str | None], subject: Any, setting: Any) -> Ask:
    return _answering(lambda problem, task: search(task, setting), refuses)


def _answering(search: Callable[[Problem, Task], Array | None], refuses: Callable[[Problem], str | None]) -> Ask:
    def answer(problem: Problem) -> MotionAnswer | Failure:
        reason = _refused(refuses, problem)
        if reason is not None:
            return Failure(reason)
        task = Task.of(problem)
        q = search(problem, task)
        if q is None or not np.isfinite(q).all():
            return Failure(NONE)
        return MotionAnswer(q, task.amount(q))

    return one_by_one(answer)


def _solved(subject: Any, certify: bool) -> Ask:
    """Solve with the verification that `solve` always makes: what the judge does not pass is no answer."""

    def answer(problem: Problem) -> MotionAnswer | Failure:
        solution = solve(problem, certify=certify)
        if not solution.usable:
            return Failure(f"{solution.status.name}: {solution.status.value}")
        return MotionAnswer(np.array(list(solution.parameters.values())), solution.amount)

    return one_by_one(answer)


def _rival(
    name: str,
    family: str,
    search: Search,
    settings: Mapping[str, Any],
    refuses: Callable[[Problem], str | None] = anything,
) -> Method:
    return Method(name, family, settings, partial(_searched, search, refuses), partial(_refused, refuses))


def _outside(
    name: str,
    family: str,
    package: str,
    search: Callable[[Problem, Task, Any], Array | None],
    settings: Mapping[str, Any],
    refuses: Callable[[Problem], str | None],
) -> Method:
    """Return a solver of others, which gets the problem itself; asked where its library is installed."""

    def prepare(subject: Any, setting: Any) -> Ask:
        with rounding_upward():  # codac leaves it so
            library(package)

        def restored(problem: Problem, task: Task) -> Array | None:
            found, asked = search(problem, task, setting), Asked(task)
            return None if found is None else asked.restored(found / asked.scales)

        return _answering(restored, refuses)

    return Method(name, family, settings, prepare, partial(_refused, refuses))


def _numbers(words: str, *labels: str) -> dict[str, float]:
    """Return settings that are numbers, by a library's own word for them."""
    return {f"{words} {label}": float(label) for label in labels}


STEPS = {"steps x 100": 100.0, "steps x 10": 10.0, "steps as printed": 1.0}
FTOL = {label: Sequential(value) for label, value in _numbers("ftol", "1e-3", "1e-6", "1e-20").items()}
STARTS = {f"{count} starts": Sequential(1e-20, starts=count) for count in (3, 12, 40)}
GENERATIONS = {f"{count} generations": count for count in (15, 60, 240)}
LOOSE = {f"to {width}, coal 1e-6": Library(float(width), COAL) for width in ("1e-4", "1e-8")}
METHODS = (
    Method("fcdm_opt", "ours", {"auto": False, "certified": True}, _solved),
    _rival("grid", "the paper's", grid, STEPS, _without_equations),
    _rival("Nelder-Mead", "scipy", nelder_mead, _numbers("xatol", "1e-2", "1e-4", "1e-9")),
    _rival("SLSQP", "scipy", slsqp, {**FTOL, "ftol 1e-20, central differences": Sequential(1e-20, central=True)}),
    _rival("SLSQP, multistart", "scipy", slsqp, STARTS),
    _rival("trust-constr", "scipy", trust_constr, _numbers("gtol", "1e-4", "1e-8", "1e-12")),
    _rival("COBYQA", "scipy", cobyqa, _numbers("radius", "1e-4", "1e-6", "1e-10")),
    _rival("differential evolution", "scipy", differential_evolution, GENERATIONS),
    _rival("IPOPT, full model", "CasADi", ipopt_in_full, _numbers("tol", "1e-4", "1e-8", "1e-11"), _without_seats),
    _rival(
        "coal in the loop",
        "coal",
        coal_in_the_loop,
        {**LOOSE, "to 1e-12, coal 1e-12": Library(DEFAULT.line, DEFAULT.judge_gjk)},
        _without_features,
    ),
    _rival(
        "coal distance + Newton",
        "coal",
        coal_with_newton,
        {**LOOSE, "to 1e-8, coal 1e-12": Library(1e-8, DEFAULT.judge_gjk)},
        _with_one_distance,
    ),
    _outside("Drake, SNOPT", "Drake", "pydrake", outside.drake, {"1 start": 1, "20 starts": 20}, outside.no_joint),
    _outside("SCIP", "SCIP", "pyscipopt", outside.scip, _numbers("feasible to", "1e-6", "1e-9"), outside.no_program),
    _outside("codac, proved", "codac", "codac", outside.enclosed, _numbers("to", "1e-4", "1e-8"), outside.no_interval),
)
"""Settings that are the library's own: xatol 1e-4, ftol 1e-6, gtol 1e-8, radius 1e-6, tol 1e-8 and coal 1e-6."""
USUAL = {
    "fcdm_opt": "auto",
    "grid": "steps as printed",
    "Nelder-Mead": "xatol 1e-9",
    "SLSQP": "ftol 1e-20",
    "SLSQP, multistart": "12 starts",
    "trust-constr": "gtol 1e-12",
    "COBYQA": "radius 1e-10",
    "differential evolution": "60 generations",
    "IPOPT, full model": "tol 1e-11",
    "coal in the loop": "to 1e-12, coal 1e-12",
    "coal distance + Newton": "to 1e-8, coal 1e-12",
    "Drake, SNOPT": "20 starts",
    "SCIP": "feasible to 1e-6",
    "codac, proved": "to 1e-8",
}
"""The setting at which a method is compared with others where only one is taken: fine, and within its reason."""


def answered(name: str, problem: Problem) -> MotionAnswer | Failure:
    """Return the answer of a method, by name, at its usual setting."""
    method = next(method for method in METHODS if method.name == name)
    answer: MotionAnswer | Failure = method.prepare(None, method.settings[USUAL[name]])([problem])[0]
    return answer


RIVALS = tuple(method.name for method in METHODS if not method.ours)


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
