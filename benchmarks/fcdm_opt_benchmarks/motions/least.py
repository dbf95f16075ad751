"""Reference amounts of smallest motions: what holds our own motion, worked out again in arithmetic of another kind.

`solve`, where it must with a certificate, gives a motion and a bound below which no motion will do. The contacts that
hold the motion are read off it; everything else is done anew on the vertices and the motion's formulas alone, in balls
of FLINT with 57 digits: the equations of Karush, Kuhn and Tucker of the least weighted amount on exactly these
contacts, their solution by Newton steps, an enclosure of it by Krawczyk's test, which proves that there is one and one
only, signs of multipliers and curvature, and that the contacts are what touches there: each one's plane has all other
vertices strictly on their sides, and the common point lies strictly inside both elements. Flush contacts have no such
proof: refused, but of shifts of upright prisms, whose least amount is rational (`upright`).

Not proved is that the way there is coherent, where a goal asks it (the judge has looked), and that no second minimum
hides in the gap between bound and amount, which `Least.lower` tells.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Task
from fcdm_opt.problem.problem import Problem
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.method import Failure
from fcdm_opt_benchmarks.motions.held import SLACK, ExactParts, Held, crossing, holders
from fcdm_opt_benchmarks.motions.jets import BITS
from fcdm_opt_benchmarks.motions.upright import least_shift

NEWTON = 12  # steps: each doubles the digits, of which a solver leaves about eight
RADIUS, STILL = 2.0**-128, 2.0**-160  # of the ball of Krawczyk's test, and of a last step, times the largest unknown
GAP = 1e-4  # relative: a bound that is nearer to the amount is not improved


class UnknownError(Exception):
    """There is no reference, and why."""


@dataclass(frozen=True)
class Least:
    """The least amount of a problem.

    Attributes
    ----------
    amount : float
        The nearest float but for one place, length units.
    lower : float
        No motion has a smaller amount: the certificate's bound, where that is not above the amount by rounding.
    source : str
        What holds the motion, and how it was found.
    """

    amount: float
    lower: float
    source: str


def least_amount(problem: Problem) -> Least | Failure:
    """Return the least amount of a problem, or why it has no reference.

    Parameters
    ----------
    problem : Problem
        Convex bodies, the weighted amount, no keep-outs; limits may not hold the motion.
    """
    if len(problem.movable.parts) * len(problem.static.parts) > 1 or problem.keep_out:
        return Failure("one convex part a body, and no keep-outs")
    if problem.amount != "weighted" or problem.pair != "any" or problem.resolution is not None:
        return Failure("the weighted amount alone, and no other state of the pair than the goal's")
    if problem.goal == "seat":
        return Failure("flush contacts have no reference")
    if (shift := least_shift(problem)) is not None:
        return Least(shift, shift, "the border of the shifts at which upright prisms overlap, in rationals")
    solution = solve(problem)
    known = _bound_of_shifts(Task.of(problem)) if problem.motion.shifts and solution.usable else solution.lower_bound
    if solution.usable and known < solution.amount * (1.0 - GAP):
        solution = solve(problem, certify=True)
    if not solution.usable:
        return Failure(f"not solved: {solution.status.name}")
    if solution.amount == 0:
        return Least(0.0, 0.0, "met without motion")
    q = np.array(list(solution.parameters.values()))
    task = Task.of(solution.problem)
    reasons = []
    for held in holders(task, q):
        found = refined(task, held, q, solution.lower_bound)
        if isinstance(found, Least):
            return replace(found, lower=max(found.lower, min(known, found.amount)))
        reasons.append(found.reason)
    return Failure("; ".join(dict.fromkeys(reasons)) or "no contact holds the motion")


def _bound_of_shifts(task: Task) -> float:
    """Return a bound of what no shift undercuts, infinite where what is asked is convex: its one minimum is the least.

    All conditions are linear then but that of parts that must come apart, which is: beyond one of the facets.
    """
    if task.tracked or task.gap(task.rest) > task.need:
        return math.inf
    if task.need > 0:
        return 0.0  # corners leave a rounded way between the facets
    _, rows, separations = task.separations((0, 0), task.pose(task.rest))
    ways = np.column_stack([task.transform(step)[:3, 3] for step in np.eye(len(task.weights))]) / task.weights
    lengths = np.linalg.norm(rows[:, :3] @ ways, axis=1)
    with np.errstate(divide="ignore"):
        return float((-separations / lengths).min())


# ------------------------------------------------------------------------------------------------------- the solution


def refined(task: Task, held: Held, q: Array, lower: float) -> Least | Failure:
    """Return the least amount on the contacts that are said to hold a motion, or why they do not.

    Parameters
    ----------
    task : Task
    held : Held
    q : (k,) array
        The motion, right to some digits.
    lower : float
        Bound below which no motion will do.
    """
    from flint import ctx

    with ctx.workprec(BITS):
        try:
            return _refined(task, held, q, lower)
        except UnknownError as reason:
            return Failure(str(reason))


def _refined(task: Task, held: Held, q: Array, lower: float) -> Least:
    scene = ExactParts(task)
    held, multipliers = _chosen(scene, held, q)
    weights = [float(w) for w in task.weights]
    found = _enclosed(lambda x: _equations(scene, held, weights, x), [*map(float, q), *multipliers])
    if found is None:
        raise UnknownError("Newton's steps end nowhere, or the solution is not unique")
    motion, forces = found[: len(q)], found[len(q) :]
    if held.asks != "at" and not all(force > 0 for force in forces):
        raise UnknownError("a contact pulls")
    if not all(float(low) < x < float(high) for x, (low, high) in zip(motion, task.limits, strict=True)):
        raise UnknownError("a limit holds the motion")
    _check_curved(scene, held, weights, motion, forces)
    _check_touching(scene, held, motion)
    total = sum((x * w) * (x * w) for x, w in zip(motion, weights, strict=True)).sqrt()  # flint's powers of 0 are nan
    amount, own = float(total.mid()), task.amount(q)
    if not float(total.rad()) <= np.finfo(float).eps * amount:
        raise UnknownError("the enclosure is wide")
    if not lower <= amount * (1.0 + DEFAULT.nominal) or not abs(own - amount) <= SLACK * amount:
        raise UnknownError(f"{amount!r} is not what was found, {own!r}, above its bound {lower!r}")
    what = ", ".join(map(str, held.contacts))
    return Least(
        amount,
        min(lower, amount),
        f"{held.asks}: {what}; {len(forces)} equations, enclosed to {float(total.rad()):.1e}",
    )


def _chosen(scene: ExactParts, held: Held, q: Array) -> tuple[Held, list[float]]:
    """Return what of it holds the motion, and multipliers: conditions' slopes times these are the amount's slope."""
    from flint import arb
    from scipy.optimize import nnls

    conditions = scene.conditions(held, [arb(float(x)) for x in q])
    if not conditions:
        raise UnknownError("nothing that the goal asks is tight: the way holds the motion")
    weights = scene.task.weights
    slopes = np.column_stack([[float(x.mid()) for x in own.slope.entries()] for own in conditions]) / weights[:, None]
    lengths = np.linalg.norm(slopes, axis=0)
    wanted = weights * q
    if held.asks == "at":
        multipliers = np.linalg.lstsq(slopes / lengths, wanted, rcond=None)[0]
        kept = np.ones(len(conditions), dtype=bool)
    else:
        multipliers, _ = nnls(slopes / lengths, wanted)
        kept = multipliers > 0
    left = np.linalg.norm(slopes / lengths @ multipliers - wanted)
    if not left <= DEFAULT.stationary * np.linalg.norm(wanted):
        raise UnknownError("something else holds the motion: the way, a limit or another contact")
    multipliers = (multipliers / lengths)[kept].tolist()
    if held.asks == "beyond":
        return _pinned(held, kept), multipliers
    return held._replace(
        contacts=tuple(own for own, is_kept in zip(held.contacts, kept, strict=True) if is_kept)
    ), multipliers


def _pinned(held: Held, kept: Iterable[bool]) -> Held:
    """Return it with fewer scales pinned."""
    return held._replace(pinned=tuple(k for k, is_kept in zip(held.pinned, kept, strict=True) if is_kept))


def _equations(scene: ExactParts, held: Held, weights: list[float], x: list[Any]) -> tuple[Any, Any]:
    """Return the equations of Karush, Kuhn and Tucker and their derivatives, in balls, at motion and multipliers."""
    from flint import arb, arb_mat

    k = len(weights)
    conditions = scene.conditions(held, x[:k])
    size = k + len(conditions)
    squares = [arb(w) * arb(w) for w in weights]
    rest = [squares[i] * x[i] for i in range(k)]
    slopes = arb_mat(size, size)
    for i in range(k):
        slopes[i, i] = squares[i]
    for j, (own, force) in enumerate(zip(conditions, x[k:], strict=True)):
        for i in range(k):
            rest[i] -= force * own.slope[i, 0]
            slopes[i, k + j], slopes[k + j, i] = -own.slope[i, 0], own.slope[i, 0]
            for m in range(k):
                slopes[i, m] = slopes[i, m] - force * own.bend[i, m]
    return arb_mat(size, 1, [*rest, *(own.value for own in conditions)]), slopes


def _enclosed(equations: Callable[[list[Any]], tuple[Any, Any]], start: list[float]) -> list[Any] | None:
    """Return balls that hold one solution and one only, None where that is not proved."""
    from flint import arb, arb_mat

    size = len(start)
    x = arb_mat(size, 1, [arb(value) for value in start])
    try:
        for _ in range(NEWTON):
            rest, slopes = equations(x.entries())
            step = slopes.solve(rest)
            x = (x - step).mid()
            largest = max(abs(value).mid() for value in x.entries())
            if max(abs(value) for value in step.entries()) < largest * STILL:
                break
        wide = arb_mat(size, 1, [value + arb(0, (largest * RADIUS).mid()) for value in x.entries()])
        inverse = slopes.mid().inv().mid()
        around = equations(wide.entries())[1]
        identity = arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])
        image = x - inverse * equations(x.entries())[0] + (identity - inverse * around) * (wide - x)
    except ZeroDivisionError:
        return None
    inside = all(own.contains_interior(new) for own, new in zip(wide.entries(), image.entries(), strict=True))
    return list(image.entries()) if inside else None


def _check_curved(scene: ExactParts, held: Held, weights: list[float], motion: list[Any], forces: list[Any]) -> None:
    """Check that the amount grows along all motions that keep the contacts: by second derivatives, in floats."""
    _, slopes = _equations(scene, held, weights, [*motion, *forces])
    k, w = len(motion), np.array(weights)
    table = np.array([[float(slopes[i, j].mid()) for j in range(k)] for i in range(k + len(forces))])
    curved, rows = table[:k] / np.outer(w, w), table[k:] / w
    _, sizes, ways = np.linalg.svd(rows / np.linalg.norm(rows, axis=1)[:, None])
    free = ways[len(sizes) :]
    if len(free) and not np.linalg.eigvalsh(free @ curved @ free.T).min() > DEFAULT.stationary:
        raise UnknownError("the amount does not grow along all motions that keep the contacts: no least one")


def _check_touching(scene: ExactParts, held: Held, motion: list[Any]) -> None:
    posed = scene.posed(motion)
    rho = scene.target
    if held.asks == "beyond":
        rho = [x.value for x in crossing([posed.line(contact) for contact in held.contacts])]
        over = [
            (own - target) * float(sign) for own, target, sign in zip(rho, scene.target, scene.task.signs, strict=True)
        ]
        if not all(over[k] > 0 for k in range(2) if k not in held.pinned):
            raise UnknownError("the pair falls short of its target")
    groups = [held.contacts] if held.asks == "part" else [(contact,) for contact in held.contacts]
    if not all(posed.supports(group) for group in groups):
        raise UnknownError("a vertex is beyond the plane of a contact, or in it: flush")
    if held.asks == "part" and not scene.task.must_touch:
        return
    if not posed.share_a_point(held.contacts, rho):
        raise UnknownError("the elements of the contact share no point that is inside both")
