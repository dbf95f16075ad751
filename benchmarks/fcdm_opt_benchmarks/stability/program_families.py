"""Families of programs at which general solvers fail, with the x that are least: keywords of `programs` cases."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

Members = Iterator[dict[str, Any]]


def wrong_roots() -> Members:
    """Of the many roots of tan(t/2) = c the one nearest to 0, from several starts and within several bounds."""
    source = "2 atan c, and whole turns more"
    for c, own in product((5.0, 0.5, 1.0, 20.0, 100.0), (False, True)):
        yield {"name": f"c = {c:g}{', own motion' * own}", "program": "tangent", "numbers": {"c": c, "own": own},
               "best": [[2 * math.atan(c)]], "source": source}  # fmt: skip
    for start in (-1.0, 1.0, 3.0, -20.0, 27.0):
        yield {"name": f"c = 5 from {start:g}", "program": "tangent", "numbers": {"c": 5.0}, "start": [start],
               "best": [[2 * math.atan(5)]], "source": source}  # fmt: skip
    for low, high, turns in ((3.2, 40.0, 1), (20.0, 40.0, 3), (27.0, 40.0, 4), (-40.0, -3.2, -1)):
        yield {"name": f"c = 5 within {low:g}, {high:g}", "program": "tangent", "numbers": {"c": 5.0}, "low": [low],
               "high": [high], "start": [low if low > 0 else high], "best": [[2 * math.atan(5) + 2 * math.pi * turns]],
               "source": source}  # fmt: skip


def stationary_starts() -> Members:
    """Of cos t = c, from where its slope is 0 or next to it."""
    for c, own in product((0.9, 0.5, 0.7, 0.99, 0.999), (False, True)):
        yield {"name": f"c = {c:g}{', own motion' * own}", "program": "cosine", "numbers": {"c": c, "own": own},
               "best": [[math.acos(c)], [-math.acos(c)]], "source": "acos c"}  # fmt: skip
    for start in (1e-9, 1e-3, -1e-3, math.pi):
        yield {"name": f"c = 0.9 from {start:g}", "program": "cosine", "numbers": {"c": 0.9}, "start": [start],
               "best": [[math.acos(0.9)], [-math.acos(0.9)]], "source": "acos c"}  # fmt: skip
    yield {"name": "c = 1: met at the start", "program": "cosine", "numbers": {"c": 1.0}, "best": [[0.0]],
           "source": "acos c"}  # fmt: skip


def without_solution() -> Members:
    """No x will do, and not by little."""
    for c in (1.2, 1.01, 1.5, 3.0):
        yield {"name": f"cos t = {c:g}", "program": "cosine", "numbers": {"c": c}, "source": "|cos t| <= 1"}
    for low, high in ((-3.1, 2.7), (3.2, 9.0), (-3.0, 2.0)):
        yield {"name": f"tan(t/2) = 5 within {low:g}, {high:g}", "program": "tangent", "numbers": {"c": 5.0},
               "low": [low], "high": [high], "start": [min(max(0.0, low), high)],
               "source": "between roots 2 atan 5 + 2 pi k"}  # fmt: skip
    for most in ((0.3, 0.5), (0.3, 0.6999), (-1.0, 1.9)):
        yield {"name": f"x + y = 1 within {most[0]:g}, {most[1]:g}", "program": "blend", "size": 2,
               "numbers": {"p": [2.0, 4.0], "l": 0.0}, "high": most, "low": (-9.0, -9.0),
               "source": "the upper bounds' sum is less than 1"}  # fmt: skip
    for off in (1.0, 1e-3):
        yield {"name": f"a tip {off:g} away within half of that", "program": "tips", "numbers": {"off": off}, "size": 3,
               "low": (-off / 2,) * 3, "high": (off / 2,) * 3, "source": "x >= off in all that will do"}  # fmt: skip


def next_to_nothing() -> Members:
    """Two inequalities that miss each other, or overlap, by less than solvers let pass."""
    for more in (5e-8, -5e-8, 5e-7, -5e-7, 1e-6, -1e-6, 5e-6, -5e-6, 1e-4, -1e-4):
        yield {"name": f"x <= 1 and x >= 1 + {more:g}", "program": "slot", "numbers": {"more": more}, "low": [0.0],
               "high": [3.0], "best": [] if more > 0 else [[1 + more]],
               "source": "the sign of the difference"}  # fmt: skip
    for more in (5e-8, -5e-8, 1e-6, -1e-6):
        yield {"name": f"x + y = 1 within 0.3, 0.7 - {more:g}", "program": "blend", "size": 2,
               "numbers": {"p": [2.0, 2.0], "l": 0.0}, "low": (-9.0, -9.0), "high": (0.3, 0.7 - more),
               "best": [] if more > 0 else [[0.3, 0.7]], "source": "the sum of the bounds"}  # fmt: skip


def dependent_gradients() -> Members:
    """Vertex on vertex: more conditions in the only point that will do than variables, almost met at the start."""
    for off in (1.0, 1e-2, 1e-4, 1e-6, 1e-7):
        yield {"name": f"four planes, {off:g} away", "program": "tips", "numbers": {"off": off}, "size": 3,
               "best": [[off, 0, 0]], "source": "the planes' common point"}  # fmt: skip
        yield {"name": f"an equation eight times, {off:g} away", "program": "repeated", "numbers": {"off": off},
               "best": [[-off]], "source": "linear"}  # fmt: skip
        yield {"name": f"three planes, {off:g} away", "program": "corners", "numbers": {"off": off}, "size": 3,
               "best": [[off] * 3], "source": "the corner"}  # fmt: skip


def tiny_coefficients() -> Members:
    """State a row that solvers drop, or take as met by their absolute tolerance."""
    for e in (1e-9, 1e-10, 1e-6, 1e-7, 1e-8, 1e-12, 1e-3):
        yield {"name": f"e = {e:g}", "program": "tiny", "numbers": {"e": e}, "best": [[0.5]], "source": "linear"}


def quadratic_programs() -> Members:
    """Least p_1 x^2 / 2 + p_2 y^2 / 2 + l x with x + y = 1: the line's lowest point, or a bound."""
    source = "on the line x + y = 1 a parabola in x, clipped by the bounds"
    own = [([2.0, 4.0], -2.0, (0.0, None)), ([2.0, 4.0], 0.0, (None, None)), ([2.0, 4.0], 0.0, (None, 0.6)),
           ([2.0, 4.0], 0.0, (0.75, None)), ([2.0, 4.0], -2.0, (None, None)), ([2.0, 4.0], -2.0, (None, 0.9)),
           ([2.0, 2e6], 0.0, (None, None)), ([2.0, 2e-6], 0.0, (None, None)), ([2.0, 2e10], 0.0, (None, None)),
           ([2e-8, 2e-8], 0.0, (None, None)), ([2.0, 2.0], -1.0, (None, None))]  # fmt: skip
    for (p, r), linear, (low, high) in own:
        x = (r - linear) / (p + r)
        x = min(max(x, -math.inf if low is None else low), math.inf if high is None else high)
        yield {"name": f"P = {p:g}, {r:g}, l = {linear:g}, x within {low}, {high}", "program": "blend", "size": 2,
               "numbers": {"p": [p, r], "l": linear}, "low": (low, None), "high": (high, None), "best": [[x, 1 - x]],
               "source": source}  # fmt: skip
    both = {"name": "P = 2, 4, l = -2, x >= 0 and y >= 0", "program": "blend", "size": 2,
            "numbers": {"p": [2.0, 4.0], "l": -2.0}, "low": (0.0, 0.0), "best": [[1, 0]], "source": source}  # fmt: skip
    yield both


def at_the_identity() -> Members:
    """Rodrigues' formula as it is usually written has 0 / 0 where every search begins."""
    for s, start in product((0.5, 0.3, 0.9), (0.0, 1e-9, 1e-3)):
        yield {"name": f"y = {s:g} from {start:g}", "program": "rodrigues", "numbers": {"s": s}, "size": 3,
               "start": [0.0, 0.0, start], "best": [[0, 0, math.asin(s)]],
               "source": "the angle between (1, 0, 0) and the circle y = s on the sphere"}  # fmt: skip
    yield {"name": "y = 1.1", "program": "rodrigues", "numbers": {"s": 1.1}, "size": 3, "start": [0.0, 0.0, 1e-3],
           "source": "no point of the unit sphere is at y = 1.1"}  # fmt: skip


FAMILIES: dict[str, Callable[[], Members]] = {
    "the wrong one of many roots": wrong_roots,
    "stationary at the start": stationary_starts,
    "no solution": without_solution,
    "feasible or not by next to nothing": next_to_nothing,
    "dependent gradients": dependent_gradients,
    "tiny coefficients": tiny_coefficients,
    "quadratic programs": quadratic_programs,
    "Rodrigues at the identity": at_the_identity,
}
