"""Expansions along a ray of motions: how conditions on a contact change, with a bound of what two terms leave out.

An expansion of f about x0 is four numbers: f(x0), f'(x0), a bound of |f''| on x0 <= x <= x0 + span, and its error in
units of roundoff: how f(x0) changes with the relative changes of all that it is made of. They flow through the motion's
own CasADi expression, so every motion has them, and from there into conditions: each is a form in

    y(v, w) = det (s_2 + rho_2 w - s_1 - rho_1 R v),  rho = (num_1, num_2) / det,

the way from a point v of body 1 to a point w of body 2, both relative to their seeds as drawn, at the tracked scale
pair. Scaled by the determinant of its two lines nothing is divided by, and nothing is singular.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.along.expanding import (
    ALONG,
    ALONG_TURNED,
    BESIDE,
    BESIDE_TURNED,
    DETERMINANT,
    FIXED,
    NORMAL,
    OTHER,
    OWN,
    SCALE_1,
    SCALE_2,
    STEEP,
    TURNED,
    expand,
)  # fmt: skip
from fcdm_opt.along.operations import Operations
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.motion.motions import Free, Motion, Rotation, Sequenced, Step, Translation
from fcdm_opt.tolerances import DEFAULT

ROUNDING = 2 * np.finfo(float).eps  # of the fourth number
BITS, VERIFIED = 192, 1e-14  # of extended precision; what a root is enclosed within, relative to it
LOOKS = (1e-6, 1e-4, 1e-2, 0.1, 0.3, 0.5, 0.7, 1.0)  # shares of a stretch, where a root may be hidden by rounding
ROW = 12  # numbers of a condition: v, w, direction, sign, and radii taken off


class Conditions(NamedTuple):
    """Conditions f(x) >= 0, one a row.

    Attributes
    ----------
    forms : (n, 2) int array
        Form, and k of the tracked normal it speaks of.
    rows : (n, 12) array
        v, w, direction, sign, and radii about v and w.
    """

    forms: Ints
    rows: Array

    def chosen(self, which: Any) -> Conditions:
        """Return some of them."""
        return Conditions(self.forms[which], self.rows[which])

    @classmethod
    def joined(cls, some: Sequence[Conditions]) -> Conditions:
        """Return several lists in one."""
        return cls(np.vstack([own.forms for own in some]), np.vstack([own.rows for own in some]))

    @classmethod
    def of(cls, form: int, k: int = 0, *, v: Any = 0.0, w: Any = 0.0, m: Any = 0.0, sign: float = 1.0) -> Conditions:
        """Return conditions of one form; `v`, `w` and `m` are (n, 3) or (3,) arrays."""
        points = [np.asarray(x, dtype=float) for x in (v, w, m)]
        count = max((len(x) for x in points if x.ndim == 2), default=1)
        rows = np.zeros((count, ROW))
        for place, x in enumerate(points):
            rows[:, 3 * place : 3 * place + 3] = x
        rows[:, 9] = sign
        return cls(np.tile(np.array([form, k], dtype=np.int64), (count, 1)), rows)

    @classmethod
    def spheres(cls, v: Array, w: Array, m: Array, radii: Array) -> Conditions:
        """Return the conditions that spheres about v and w are apart along m."""
        made = cls.of(ALONG, v=v, w=w, m=m)
        made.rows[:, 10:] = radii
        return made


class Scales(NamedTuple):
    """What fixes the scale pair.

    Attributes
    ----------
    lines : (k, 13) array
        Of each tracked feature: how its normal moves, two directions, and a point of either body on it.
    pair : (2,) array
        With no line the pair itself, with one line the point of it nearest to the pair, with two lines unused.
    sign : float
        Sign of the lines' determinant, which must not change.
    """

    lines: Array
    pair: Array
    sign: float

    @classmethod
    def fixed(cls, pair: Array) -> Scales:
        """Return a scale pair that nothing changes."""
        return cls(np.empty((0, 13)), np.array(pair, dtype=float), 1.0)


@dataclass(frozen=True, eq=False)
class Ray:
    """Motions q = x * direction, x >= 0.

    Attributes
    ----------
    operations : Operations
    direction : (k,) array
        Of the own parameters of those.
    seeds : (6,) array
    """

    operations: Operations
    direction: Array
    seeds: Array

    @classmethod
    def of(cls, motion: Motion, direction: Array, movable_seed: Array, static_seed: Array) -> Ray:
        """Return the ray of a motion."""
        straight, along = _straightened(motion, direction)
        return cls(Operations.of(straight), along, np.concatenate([movable_seed, static_seed]))

    @property
    def reversed(self) -> Ray:
        """The ray the other way."""
        return replace(self, direction=-self.direction)

    @property
    def natural_step(self) -> tuple[float, float]:
        """How fast it turns (a unit of x, about) and moves the seed, at rest."""
        _, pose, _ = self.expanded(0.0, 0.0, Scales.fixed(np.ones(2)), Conditions.of(DETERMINANT))
        return float(np.linalg.norm(pose[:9, 1])), float(np.linalg.norm(pose[9:, 1]))

    def expanded(self, x: float, span: float, scales: Scales, conditions: Conditions) -> tuple[Array, Array, Array]:
        """Return expansions of conditions, (n, 4), of R and d, (12, 4), and the scale pair at x, (2,)."""
        inputs = np.zeros((1 + len(self.direction) + 6, 4))
        inputs[0, 0], inputs[0, 1] = x, 1.0
        inputs[1 : 1 + len(self.direction), 0] = self.direction
        inputs[1 + len(self.direction) :, 0] = self.seeds
        inputs[:, 3] = np.abs(inputs[:, 0])
        found: tuple[Array, Array, Array] = expand(
            self.operations.codes, self.operations.constants, self.operations.places, inputs, span, *scales, *conditions
        )
        return found

    def refined(self, x: float, slope: float, scales: Scales, condition: Conditions) -> tuple[float, float]:
        """Return a root of one condition near x to the last digit, in extended precision, and a bound of its error.

        Two steps of Newton's method; then the condition's signs on both sides, as balls of arb, enclose it. The bound
        is infinite where they do not.
        """
        import flint

        with flint.ctx.workprec(BITS):
            root = flint.arb(x)
            for _ in range(2):
                root = (root - self._value(root, scales, condition) / slope).mid()
            found = float(root)
            off = flint.arb(found if found else slope).__abs__() * VERIFIED
            below, above = (self._value(flint.arb(found) + side * off, scales, condition) for side in (-1, 1))
            enclosed = bool((below > 0) and (above < 0)) or bool((below < 0) and (above > 0))
        return found, float(off.mid()) if enclosed and abs(found) > 0 else math.inf

    def crossing(self, x: float, further: float, scales: Scales, condition: Conditions) -> float | None:
        """Return where one condition becomes negative between x and x + further, None where it does not.

        In extended precision: it is looked at on a few points ever further on, and bisected before the first at which
        it is negative.
        """
        import flint

        with flint.ctx.workprec(BITS):

            def negative(at: float) -> bool:
                return bool(self._value(flint.arb(at), scales, condition) < 0)

            low = x
            for share in LOOKS:
                high = x + share * further
                if negative(high):
                    while low < (middle := (low + high) / 2.0) < high and high - low > VERIFIED * high:
                        low, high = (low, middle) if negative(middle) else (middle, high)
                    return high
                low = high
        return None

    def _value(self, x: Any, scales: Scales, condition: Conditions) -> Any:
        """Return the value of one condition at x, a ball of arb."""
        import flint

        (form, k), row = condition.forms[0].tolist(), [flint.arb(value) for value in condition.rows[0].tolist()]
        given = [x, *(flint.arb(value) for value in (*self.direction.tolist(), *self.seeds.tolist()))]
        pose = self.operations.carried_out(given)
        R, d = [pose[0:3], pose[3:6], pose[6:9]], pose[9:]
        normals, lines = [], []
        for line in scales.lines.tolist():
            kind, u, w, p, q = line[0], *([flint.arb(value) for value in line[j : j + 3]] for j in (1, 4, 7, 10))
            turned = [_inner(own, u) for own in R]
            n = turned if kind == TURNED else w if kind == FIXED else _outer(turned, w)
            normals.append(n)
            lines.append((_inner(n, [_inner(own, p) for own in R]), -_inner(n, q), _inner(n, d)))
        r1, r2 = (flint.arb(value) for value in scales.pair.tolist())
        if len(lines) == 2:
            (a, b, c), (e, f, g) = lines
            det, num1, num2 = (scales.sign * value for value in (a * f - b * e, c * f - b * g, a * g - c * e))
        elif lines:
            ((a, b, c),) = lines
            det, off = a * a + b * b, c - a * r1 - b * r2
            num1, num2 = r1 * det + off * a, r2 * det + off * b
        else:
            det, num1, num2 = flint.arb(1), r1, r2
        first, m = [_inner(own, row[:3]) for own in R], row[6:9]
        y = [det * d[i] + num2 * row[3 + i] - num1 * first[i] for i in range(3)]
        if form in (ALONG_TURNED, BESIDE_TURNED):
            m = [_inner(own, m) for own in R]
        value = {
            ALONG: lambda: _inner(y, m),
            ALONG_TURNED: lambda: _inner(y, m),
            BESIDE: lambda: _inner(y, _outer(m, normals[k])),
            BESIDE_TURNED: lambda: _inner(y, _outer(m, normals[k])),
            NORMAL: lambda: _inner(y, normals[k]),
            OWN: lambda: _inner(normals[k], first),
            OTHER: lambda: _inner(normals[k], row[3:6]),
            DETERMINANT: lambda: det,
            SCALE_1: lambda: num1,
            SCALE_2: lambda: num2,
            STEEP: lambda: _inner(normals[k], normals[k]),
        }[form]()
        return row[9] * value - row[10] * num1 - row[11] * num2


def _inner(u: Any, v: Any) -> Any:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _outer(u: Any, v: Any) -> list[Any]:
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]


def _straightened(motion: Motion, direction: Array) -> tuple[Motion, Array]:
    """Return the motion with each free step as what it is along a ray: a shift, and a turn about a fixed direction."""
    steps: list[Step] = []
    along: list[float] = []
    start = 0
    for step in motion.steps:
        own = direction[start : start + len(step.parameters)]
        start += len(own)
        if isinstance(step, Free):
            for kind, part in ((Translation, own[:3]), (Rotation, own[3:])):
                length = float(np.linalg.norm(part))
                if length > 0:
                    steps.append(kind(tuple((part / length).tolist())))
                    along.append(length)
        else:
            steps.append(step)
            along += own.tolist()
    return Sequenced(tuple(steps)), np.array(along)


# ------------------------------------------------------------------------------------------- what expansions say


def flat(found: Array) -> bool:
    """Tell whether one of some expansions is zero to within rounding, and so is its slope."""
    value, slope, bend, terms = found.T
    rounding = ROUNDING * terms
    return bool(((value <= rounding) & (slope * slope <= 8.0 * bend * rounding)).any())


def roots(found: Array) -> Array:
    """Return where each condition becomes zero as its slope goes on, infinite where it grows."""
    value, slope, _, _ = found.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(slope < 0, np.abs(value / slope), np.where(np.abs(value) > 0, np.inf, 0.0))


def safe_steps(found: Array, span: float) -> Array:
    """Return how far each condition surely holds: the root of f + f' h - B h^2 / 2, at most the span; 0 if it fails."""
    value, slope, bend, terms = found.T
    held = value >= -DEFAULT.tie * terms
    value = np.maximum(value, 0.0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = np.sqrt(slope * slope + 2.0 * bend * value)
        steps = np.where(slope >= 0, (slope + root) / bend, 2.0 * value / (root - slope))
    steps = np.where((bend == 0) & (slope >= 0), span, steps)
    return np.where(held & ~np.isnan(steps), np.minimum(steps, span), 0.0)
