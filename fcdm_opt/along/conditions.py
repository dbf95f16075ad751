"""Conditions on a contact along a ray of motions, written once for expansions and for balls of any precision.

Each is a form in

    y(v, w) = det (s_2 + rho_2 w - s_1 - rho_1 R v),  rho = (num_1, num_2) / det,

the way from a point v of body 1 to a point w of body 2, both relative to their seeds as drawn, at the tracked scale
pair. Scaled by the determinant of its two lines nothing is divided by, and nothing is singular.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.along.expansions import Expansion, columns
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.motion.instructions import SCALARS, Instructions, relative_pose
from fcdm_opt.motion.motions import Free, Motion, Rotation, Sequenced, Step, Translation

TURNED, FIXED, CROSSED = 0.0, 1.0, 2.0  # normal of a tracked feature: of a face of body 1, of body 2, of two edges
# forms of a condition: y along a direction fixed, turned with body 1, or the cross product of either with normal k; y
# along normal k; a point of body 1 or 2 along normal k; the determinant; det rho_1, det rho_2; the normal's square
ALONG, ALONG_TURNED, BESIDE, BESIDE_TURNED, NORMAL, OWN, OTHER, DETERMINANT, SCALE_1, SCALE_2, STEEP = range(11)
BITS, VERIFIED = 192, 1e-14  # of extended precision; what a root is enclosed within, relative to it
LOOKS = (1e-6, 1e-4, 1e-2, 0.1, 0.3, 0.5, 0.7, 1.0)  # shares of a stretch, where a root may be hidden by rounding
ROW = 12  # numbers of a condition: v, w, direction, sign, and radii taken off
_NEXT, _AFTER = [1, 2, 0], [2, 0, 1]


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


class TrackedPair(NamedTuple):
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
    def fixed(cls, pair: Array) -> TrackedPair:
        """Return a scale pair that nothing changes."""
        return cls(np.empty((0, 13)), np.array(pair, dtype=float), 1.0)


class RayState:
    """Pose, tracked normals and scale pair somewhere on a ray, in numbers of one kind.

    Parameters
    ----------
    R, d : (3, 3) and (3,)
        Arrays of expansions, or of objects.
    tracked : TrackedPair
    number : callable, optional
        Makes numbers of arrays of floats; else they stay.
    """

    def __init__(self, R: Any, d: Any, tracked: TrackedPair, number: Any = np.asarray) -> None:
        self.R, self.d, self._number = R, d, number
        self._normals, lines = [], []
        for line in tracked.lines:
            u, w, p, q = number(line[1:]).reshape(4, 3)
            turned = self._turned(u)
            normal = turned if line[0] == TURNED else w if line[0] == FIXED else _cross(turned, w)
            self._normals.append(normal)
            level = u @ p if line[0] == TURNED else _dot(normal, self._turned(p))
            lines.append((level, -_dot(normal, q), _dot(normal, d)))
        r1, r2 = number(tracked.pair)
        if len(lines) == 2:
            (a, b, c), (e, f, g) = lines
            minors = a * f - b * e, c * f - b * g, a * g - c * e
            self.determinant, self.num1, self.num2 = (tracked.sign * minor for minor in minors)
        elif lines:
            ((a, b, c),) = lines
            self.determinant, off = a * a + b * b, c - a * r1 - b * r2
            self.num1, self.num2 = self.determinant * r1 + off * a, self.determinant * r2 + off * b
        else:
            self.determinant, self.num1, self.num2 = 1.0, r1, r2

    def _turned(self, u: Any) -> Any:
        return _dot(self.R, u[..., None, :])

    def values(self, conditions: Conditions) -> Iterator[tuple[Ints, Any]]:
        """Yield the values of conditions, form by form: which rows, and an array or one number for all."""
        rows = self._number(conditions.rows)
        v, w, m = rows[:, 0:3], rows[:, 3:6], rows[:, 6:9]
        first: Any = None
        y: Any = None
        if (conditions.forms[:, 0] <= OWN).any():
            first = self._turned(v)
        if (conditions.forms[:, 0] <= NORMAL).any():
            y = self.d * self.determinant + w * self.num2 - first * self.num1
        for form, k in dict.fromkeys(map(tuple, conditions.forms.tolist())):
            which = np.flatnonzero((conditions.forms == (form, k)).all(axis=1))
            if form <= NORMAL:
                way: Any = self._normals[k] if form == NORMAL else m[which]
                way = self._turned(way) if form in (ALONG_TURNED, BESIDE_TURNED) else way
                way = _cross(way, self._normals[k]) if form in (BESIDE, BESIDE_TURNED) else way
                value = _dot(y[which], way)
            elif form in (OWN, OTHER):
                value = _dot(self._normals[k], first[which] if form == OWN else w[which])
            elif form == STEEP:
                value = _dot(self._normals[k], self._normals[k])
            else:
                value = {DETERMINANT: self.determinant, SCALE_1: self.num1, SCALE_2: self.num2}[form]
            value = rows[which, 9] * value
            if conditions.rows[which, 10:].any():
                value = value - rows[which, 10] * self.num1 - rows[which, 11] * self.num2
            yield which, value


def _dot(u: Any, v: Any) -> Any:
    return (u * v).sum(axis=-1)


def _cross(u: Any, v: Any) -> Any:
    return u[..., _NEXT] * v[..., _AFTER] - u[..., _AFTER] * v[..., _NEXT]


class RayStretch(RayState):
    """Expansions over x to x + span of a ray."""

    def __init__(self, ray: Ray, x: float, span: float, tracked: TrackedPair) -> None:
        self.x, self.span, self.tracked = float(x), float(span), tracked
        with np.errstate(all="ignore"):
            pose = ray.pose(Expansion(self.x, 1.0, 0.0, abs(self.x), self.span))
            R, d = (Expansion.gathered(own, shape, self.span) for own, shape in ((pose[:9], (3, 3)), (pose[9:], (3,))))
            super().__init__(R, d, tracked)

    @property
    def bounded(self) -> bool:
        """Whether the pose has finite bounds."""
        return self.R.finite and self.d.finite

    @property
    def rho(self) -> Array:
        """The scale pair at x, (2,)."""
        with np.errstate(all="ignore"):
            det, *pair = (columns(own, 1)[0, 0] for own in (self.determinant, self.num1, self.num2))
            return np.array(pair) / det

    def expanded(self, conditions: Conditions) -> Array:
        """Return the expansions of conditions, (n, 4)."""
        made = np.empty((len(conditions.rows), 4))
        with np.errstate(all="ignore"):
            for which, value in self.values(conditions):
                made[which] = columns(value, len(which))
        return made


@dataclass(frozen=True, eq=False)
class Ray:
    """Motions q = x * direction, x >= 0.

    Attributes
    ----------
    instructions : Instructions
        What gives R, row by row, and d = s_2 - moved s_1, of x, the direction and both seeds.
    given : list of float
        Direction, in the own parameters of those, and seeds.
    """

    instructions: Instructions
    given: list[float]

    @classmethod
    def of(cls, motion: Motion, direction: Array, movable_seed: Array, static_seed: Array) -> Ray:
        """Return the ray of a motion.

        Raises
        ------
        InputError
            For a motion of the user's own that uses functions without known bounds.
        """
        straight, along = _straightened(motion, direction)
        return cls(_instructions(straight), [*along.tolist(), *movable_seed.tolist(), *static_seed.tolist()])

    @property
    def natural_step(self) -> tuple[float, float]:
        """How fast it turns (a unit of x, about) and moves the seed, at rest."""
        rest = self.stretch(0.0, 0.0, TrackedPair.fixed(np.ones(2)))
        return float(np.linalg.norm(rest.R.slope)), float(np.linalg.norm(rest.d.slope))

    def pose(self, x: Any, number: Any = float) -> list[Any]:
        """Return R, row by row, and d at x, twelve numbers of its kind."""
        arithmetic = {**SCALARS, "CONST": number}
        return self.instructions.carried_out(arithmetic, [x, *map(number, self.given)])[0]

    def stretch(self, x: float, span: float, tracked: TrackedPair) -> RayStretch:
        """Return the expansions over x to x + span."""
        return RayStretch(self, x, span, tracked)

    def exactly(self, x: Any, tracked: TrackedPair, condition: Conditions) -> Any:
        """Return the value of one condition at x, a ball of arb."""
        import flint

        balls = np.frompyfunc(flint.arb, 1, 1)
        pose = np.array(self.pose(x, flint.arb), dtype=object)
        ((_, values),) = RayState(pose[:9].reshape(3, 3), pose[9:], tracked, balls).values(condition)
        return np.ravel(values)[0]

    def refined(self, x: float, slope: float, tracked: TrackedPair, condition: Conditions) -> tuple[float, float]:
        """Return a root of one condition near x to the last digit, in extended precision, and a bound of its error.

        Two steps of Newton's method; then the condition's signs on both sides, as balls of arb, enclose it. The bound
        is infinite where they do not.
        """
        import flint

        with flint.ctx.workprec(BITS):
            root = flint.arb(x)
            for _ in range(2):
                root = (root - self.exactly(root, tracked, condition) / slope).mid()
            place = float(root)
            off = flint.arb(place if place else slope).__abs__() * VERIFIED
            below, above = (self.exactly(flint.arb(place) + side * off, tracked, condition) for side in (-1, 1))
            enclosed = bool((below > 0) and (above < 0)) or bool((below < 0) and (above > 0))
        return place, float(off.mid()) if enclosed and abs(place) > 0 else math.inf

    def crossing(self, x: float, further: float, tracked: TrackedPair, condition: Conditions) -> float | None:
        """Return where one condition becomes negative between x and x + further, None where it does not.

        In extended precision: it is looked at on a few points ever further on, and bisected before the first at which
        it is negative.
        """
        import flint

        with flint.ctx.workprec(BITS):

            def negative(at: float) -> bool:
                return bool(self.exactly(flint.arb(at), tracked, condition) < 0)

            low = x
            for share in LOOKS:
                high = x + share * further
                if negative(high):
                    while low < (middle := (low + high) / 2.0) < high and high - low > VERIFIED * high:
                        low, high = (low, middle) if negative(middle) else (middle, high)
                    return high
                low = high
        return None


@lru_cache(maxsize=64)
def _instructions(motion: Motion) -> Instructions:
    """Return what gives a motion's pose of x, the direction and both seeds, one after the other."""
    import casadi

    given = casadi.SX.sym("given", 1 + len(motion.parameters) + 6)
    pose = relative_pose(motion, given[0] * given[1:-6], given[-6:])
    instructions = Instructions.of(casadi.Function("ray", [given], [pose], {"cse": True}))
    for name in instructions.operations:
        if name not in {"INPUT", "OUTPUT", "CONST", *SCALARS}:
            raise InputError(
                "what the motion's function uses has no known bounds along a ray",
                key="motion",
                found=name.lower(),
                allowed=", ".join(known.lower() for known in SCALARS),
            )
    return instructions


def _straightened(motion: Motion, direction: Array) -> tuple[Motion, Array]:
    """Return the motion with each free step as what it is along a ray: a shift, and a turn about a fixed direction."""
    steps: list[Step] = []
    along: list[float] = []
    start = 0
    for step in motion.steps:
        part = direction[start : start + len(step.parameters)]
        start += len(part)
        if isinstance(step, Free):
            for kind, own in ((Translation, part[:3]), (Rotation, part[3:])):
                length = float(np.linalg.norm(own))
                if length > 0:
                    steps.append(kind(tuple((own / length).tolist())))
                    along.append(length)
        else:
            steps.append(step)
            along += part.tolist()
    return Sequenced(tuple(steps)), np.array(along)
