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
from fcdm_opt_benchmarks.contacts.placed import Placed, answered
from fcdm_opt_benchmarks.curves.rays import growth_distance
from fcdm_opt_benchmarks.library import coal_hull, library
from fcdm_opt_benchmarks.method import Ask, ContactAnswer, ContactQuestion, Method, Pair, one_by_one

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
    shapes = _Shapes(Placed.of(pair))
    request, result = shapes.coal.CollisionRequest(), shapes.coal.CollisionResult()
    request.gjk_tolerance = request.epa_tolerance = setting.tolerance
    request.enable_contact = False
    collide, width = shapes.coal.collide, setting.width

    def answer(question: ContactQuestion) -> ContactAnswer:
        _, d = shapes.place(question)
        outside, inside = shapes.placed.between(d, question.rho1)
        least = VANISHED * inside
        while inside - outside > width * inside:
            if inside < least:
                raise FcdmError("they overlap at every scale of body 2")
            middle = (outside + inside) / 2
            shapes.scale(middle)
            result.clear()
            overlap = collide(*shapes.pair, request, result)
            outside, inside = (outside, middle) if overlap else (middle, inside)
        return answered((outside + inside) / 2)

    return one_by_one(answer)


def distance(pair: Pair, setting: Newton) -> Ask:
    """Ask coal for distance and normal, step to the root of the normal's contact line, until it no longer changes."""
    placed = Placed.of(pair)
    shapes, P, Q = _Shapes(placed), placed.one.vertices, placed.two.vertices
    request, result = shapes.coal.DistanceRequest(), shapes.coal.DistanceResult()
    request.gjk_tolerance = request.epa_tolerance = setting.tolerance
    measure = shapes.coal.distance

    def answer(question: ContactQuestion) -> ContactAnswer:
        R, d = shapes.place(question)
        rho1 = question.rho1

        def root(rho2: float) -> float:
            shapes.scale(rho2)
            result.clear()  # coal keeps the normal of the least distance so far
            measure(*shapes.pair, request, result)
            n = result.normal
            return (n @ d - (P @ (n @ R)).max() * rho1) / -(Q @ n).min()

        outside, inside = placed.between(d, rho1)
        return answered(_climbed(root, max(outside, VANISHED * inside), setting.steps))

    return one_by_one(answer)


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


class _Shapes:
    """Both parts for coal, built once: their points are rewritten."""

    def __init__(self, placed: Placed) -> None:
        self.coal = library("coal")
        self.placed = placed
        self._shapes = [coal_hull(solid.vertices) for solid in (placed.one, placed.two)]
        self._bases = [shape.points().copy() for shape in self._shapes]
        self._poses = self.coal.Transform3s(), self.coal.Transform3s()
        self.pair = self._shapes[0], self._poses[0], self._shapes[1], self._poses[1]

    def place(self, question: ContactQuestion) -> tuple[Array, Array]:
        """Turn and scale body 1, put body 2 where it is; return R and d."""
        R, d = self.placed.pose(question.transform)
        self._poses[0].setRotation(R)
        self._poses[1].setTranslation(d)
        np.multiply(self._bases[0], question.rho1, out=self._shapes[0].points())
        return R, d

    def scale(self, rho2: float) -> None:
        """Scale body 2."""
        np.multiply(self._bases[1], rho2, out=self._shapes[1].points())


METHODS = (
    Method(
        "coal bisection",
        "coal",
        {
            "1e-6, to 1e-3": Bisection(1e-6, 1e-3),
            "1e-6, to 1e-6": Bisection(1e-6, 1e-6),
            "1e-6, to 1e-12": Bisection(1e-6, 1e-12),
            "1e-12, to 1e-12": Bisection(1e-12, 1e-12),
        },
        bisection,
    ),
    Method(
        "coal distance + Newton",
        "coal",
        {
            "1e-6, 1 step": Newton(1e-6, 1),
            "1e-6, 2 steps": Newton(1e-6, 2),
            "1e-6": Newton(1e-6),
            "1e-9": Newton(1e-9),
            "1e-12": Newton(1e-12),
        },
        distance,
    ),
    Method(
        "growth simplex + Newton",
        "growth distance",
        {"1 step": Newton(None, 1), "2 steps": Newton(None, 2), "until it ends": Newton(None)},
        growth,
    ),
)
