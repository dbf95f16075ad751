"""One contact by searches on rho_2: bisection, and Newton steps from below along contact lines.

Newton: where the parts are apart at some rho_2, a direction that separates them has a contact line, and its root bounds
rho_2 from below, better than before. With the directions of the curve's own lines it ends after few steps.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fcdm_opt.errors import FcdmError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt_benchmarks.coal_shapes import CoalHulls
from fcdm_opt_benchmarks.curves.rays import growth_distance
from fcdm_opt_benchmarks.method import Ask, ContactAnswer, ContactQuestion, Method, Pair, one_by_one, settings
from fcdm_opt_benchmarks.placed import Placed, answered

MOST = 100  # Newton steps: hulls of 10,000 vertices take less than ten
EQUAL = 4e-16  # relative: two roundings
VANISHED = 1e-12  # relative to where a bisection starts: no answer is expected below


class Bisection(NamedTuple):
    """Tolerance of coal, and width of the last interval, relative."""

    tolerance: float
    width: float


class Newton(NamedTuple):
    """Tolerance of coal, or None where no library is asked, and steps."""

    tolerance: float | None
    steps: int = MOST


def bisection(pair: Pair, setting: Bisection) -> Ask:
    """Halve the interval between a scale that is apart and one that overlaps, asking coal; its middle is the answer."""
    placed = Placed.of(pair)
    hulls, width = CoalHulls(placed.one.vertices, placed.two.vertices, setting.tolerance), setting.width

    def answer(question: ContactQuestion) -> ContactAnswer:
        _, d = _put(hulls, placed, question)
        outside, inside = placed.between(d, question.rho1)
        least = VANISHED * inside
        while inside - outside > width * inside:
            if inside < least:
                raise FcdmError("they overlap at every scale of body 2")
            middle = (outside + inside) / 2
            hulls.scale(1, middle)
            outside, inside = (outside, middle) if hulls.overlap() else (middle, inside)
        return answered((outside + inside) / 2)

    return one_by_one(answer)


def distance(pair: Pair, setting: Newton) -> Ask:
    """Ask coal for distance and normal, step to the root of the normal's contact line, until it no longer changes."""
    placed = Placed.of(pair)
    P, Q = placed.one.vertices, placed.two.vertices
    hulls = CoalHulls(P, Q, setting.tolerance)

    def answer(question: ContactQuestion) -> ContactAnswer:
        R, d = _put(hulls, placed, question)
        rho1 = question.rho1

        def root(rho2: float) -> float:
            hulls.scale(1, rho2)
            hulls.gap()
            n = hulls.result.normal
            return (n @ d - (P @ (n @ R)).max() * rho1) / -(Q @ n).min()

        outside, inside = placed.between(d, rho1)
        return answered(_climbed(root, max(outside, VANISHED * inside), setting.steps))

    return one_by_one(answer)


def _put(hulls: CoalHulls, placed: Placed, question: ContactQuestion) -> tuple[Array, Array]:
    """Turn and scale body 1, put body 2 where it is; return R and d."""
    R, d = placed.pose(question.transform)
    hulls.turn(R)
    hulls.shift(d)
    hulls.scale(0, question.rho1)
    return R, d


def growth(pair: Pair, setting: Newton) -> Ask:
    """Ask for the growth distance along a ray, cross its contact line with the vertical, take the ray through there."""
    placed = Placed.of(pair)
    one, two = placed.one, placed.two

    def answer(question: ContactQuestion) -> ContactAnswer:
        (R, d), rho1 = placed.pose(question.transform), question.rho1
        P, pairs = np.ascontiguousarray(one.vertices @ R.T), None

        def root(rho2: float) -> float:
            nonlocal pairs
            inner = (rho1 * one.inner + rho2 * two.inner) / 2
            touch = growth_distance(P, two.vertices, d, np.array([rho1, rho2]), inner, pairs)
            a, b, c = touch.line
            pairs = touch.pairs
            return float((c - a * rho1) / b)

        outside, inside = placed.between(d, rho1)
        return answered(_climbed(root, max(outside, VANISHED * inside), setting.steps))

    return one_by_one(answer)


def _climbed(root: Callable[[float], float], start: float, steps: int) -> float:
    """Return the limit of x -> root(x), which rises until it is there, or where it is after some steps."""
    x = start
    for _ in range(steps):
        found = root(x)
        if found != found:
            raise FcdmError("a contact line that is none")
        if not found > x * (1 + EQUAL):
            return found if x == start else max(x, found)  # at the start: overlapping already, or touching
        x = found
    if steps == MOST:
        raise FcdmError(f"no end after {MOST} steps")
    return x


HALVED = {
    f"{tolerance}, to {width}": Bisection(float(tolerance), float(width))
    for tolerance, width in (("1e-6", "1e-3"), ("1e-6", "1e-6"), ("1e-6", "1e-12"), ("1e-12", "1e-12"))
}
STEPPED = {
    "1e-6, 1 step": Newton(1e-6, 1),
    "1e-6, 2 steps": Newton(1e-6, 2),
    **{label: Newton(tolerance) for label, tolerance in settings("1e-6", "1e-9", "1e-12").items()},
}
GROWN = {"1 step": Newton(None, 1), "2 steps": Newton(None, 2), "until it ends": Newton(None)}
METHODS = (
    Method("coal bisection", "coal", HALVED, bisection),
    Method("coal distance + Newton", "coal", STEPPED, distance),
    Method("growth simplex + Newton", "growth distance", GROWN, growth),
)
