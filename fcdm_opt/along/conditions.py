"""Conditions on a contact along a ray of motions, written once for expansions and for balls of any precision.

Each is a form in

    y(v, w) = det (s_2 + rho_2 w - s_1 - rho_1 R v),  rho = (num_1, num_2) / det,

the way from a point v of body 1 to a point w of body 2, both relative to their seeds as drawn, at the tracked scale
pair. Scaled by the determinant of its two lines nothing is divided by, and nothing is singular. Every form is linear in
the same few products of pose, normals and scale pair, the terms of a state (`_terms`): a condition is a row of
coefficients of these, so that a state is worked out once and all conditions there are a product of matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.along.expansions import Expansion
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.motion.instructions import SCALARS, Instructions, pose_symbols
from fcdm_opt.motion.kinematics import Compiled
from fcdm_opt.motion.motions import Motion, Sequenced

TURNED, FIXED, CROSSED = 0.0, 1.0, 2.0  # normal of a tracked feature: of a face of body 1, of body 2, of two edges
# forms of a condition: y along a direction fixed, turned with body 1, or the cross product of either with normal k, one
# of two edges; y along normal k; a point of body 1 or 2 along normal k; the determinant; det rho_1, det rho_2; the
# normal's square
ALONG, ALONG_TURNED, ACROSS, ACROSS_TURNED, NORMAL, OWN, OTHER, DETERMINANT, SCALE_1, SCALE_2, STEEP = range(11)
BITS, NEAR = 192, 1e-15  # of extended precision; how near a root is looked for, relative to it
VERIFIED = 1e-13  # relative: how far from a root its sign is told for certain
LOOKS = (1e-6, 1e-4, 1e-2, 0.1, 0.3, 0.5, 0.7, 1.0)  # shares of a stretch, where a root may be hidden by rounding
ROW = 12  # numbers of a condition: v, w, direction, sign, and radii taken off
POSE, SHARED, EACH = 12, 27, 38  # numbers of a pose; terms without a tracked normal, and with each of them
SUMMED = 4.0  # units of roundoff in a sum of products of coefficients and terms, relative to that of their sizes
_NEXT, _AFTER = [1, 2, 0], [2, 0, 1]


def _terms(R: Any, d: Any, kinds: Sequence[float], lines: Any, pair: Any, sign: Any) -> Any:
    """Return what all forms are linear in, (SHARED + EACH len(kinds),), of arrays of numbers of any kind.

    First det, num_1, num_2, and their products with d, R, R'd; then, for each normal n with h = R'n, products with
    these. `kinds` and `lines`, (k, 4, 3), are the columns of `TrackedPair.lines`; `pair` and `sign` as there.
    """
    e, normals, rows = R.T @ d, [], []
    for kind, (u, w, p, q) in zip(kinds, lines, strict=True):
        n = R @ u if kind == TURNED else w if kind == FIXED else _cross(R @ u, w)
        h = u if kind == TURNED else R.T @ w if kind == FIXED else _cross(u, R.T @ w)
        normals.append((n, h))
        rows.append((h @ p, -(n @ q), n @ d))
    if len(rows) == 2:
        (a, b, c), (f, g, i) = rows
        det, num1, num2 = (sign * minor for minor in (a * g - b * f, c * g - b * i, a * i - c * f))
    elif rows:
        ((a, b, c),) = rows
        det, off = a * a + b * b, c - a * pair[0] - b * pair[1]
        num1, num2 = det * pair[0] + off * a, det * pair[1] + off * b
    else:
        det, (num1, num2) = 0.0 * pair[0] + 1.0, pair
    made = [[det, num1, num2], d * det, R * num1, e * det, R * num2]
    for kind, (n, h) in zip(kinds, normals, strict=True):
        made += [n, h, n * num2, h * num1, [(n @ d) * det, n @ n]]
        crossed = _cross(n, d) * det, _cross(n, R.T).T * num1, _cross(h, e) * det, _cross(h, R).T * num2
        made += crossed if kind == CROSSED else [np.zeros(24) * det]
    return np.concatenate([np.ravel(part) for part in made])


_SIZES = {"DET": 1, "NUM1": 1, "NUM2": 1, "DET d": 3, "NUM1 R": 9, "DET e": 3, "NUM2 R": 9,
          "n": 3, "h": 3, "NUM2 n": 3, "NUM1 h": 3, "DET n.d": 1, "n.n": 1,
          "DET nxd": 3, "NUM1 nxR": 9, "DET hxe": 3, "NUM2 hxR'": 9}  # fmt: skip
_PLACES = dict(zip(_SIZES, accumulate(_SIZES.values(), initial=0), strict=False))  # with a normal: those of the first
_WIDTHS = [*_SIZES.values(), *[*_SIZES.values()][7:]]  # with two normals
_STARTS = [*accumulate(_WIDTHS[:-1], initial=0)]
_BLOCKS = {
    ALONG: lambda v, w, m: {"DET d": m, "NUM2": _dot(m, w), "NUM1 R": -_outer(m, v)},
    ALONG_TURNED: lambda v, w, m: {"DET e": m, "NUM2 R": _outer(w, m), "NUM1": -_dot(m, v)},
    ACROSS: lambda v, w, m: {"DET nxd": m, "NUM2 n": _cross(w, m), "NUM1 nxR": -_outer(m, v)},
    ACROSS_TURNED: lambda v, w, m: {"DET hxe": m, "NUM2 hxR'": _outer(m, w), "NUM1 h": -_cross(v, m)},
    NORMAL: lambda v, w, m: {"DET n.d": 1.0, "NUM2 n": w, "NUM1 h": -v},
    OWN: lambda v, w, m: {"h": v},
    OTHER: lambda v, w, m: {"n": w},
    DETERMINANT: lambda v, w, m: {"DET": 1.0},
    SCALE_1: lambda v, w, m: {"NUM1": 1.0},
    SCALE_2: lambda v, w, m: {"NUM2": 1.0},
    STEEP: lambda v, w, m: {"n.n": 1.0},
}  # fmt: skip


def _coefficients(form: int, k: int, rows: Any) -> Any:
    """Return the coefficients of the terms in conditions of one form, (n, SHARED + EACH (k + 1)), of any kind."""
    made = np.zeros((len(rows), SHARED + EACH * (k + 1)), dtype=rows.dtype)
    v, w, m, sign = rows[:, 0:3], rows[:, 3:6], rows[:, 6:9], rows[:, 9:10]
    for name, values in _BLOCKS[form](v, w, m).items():
        start = _PLACES[name] + (EACH * k if _PLACES[name] >= SHARED else 0)
        made[:, start : start + _SIZES[name]] = sign * values
    made[:, 1:3] = made[:, 1:3] - rows[:, 10:]
    return made


class Conditions(NamedTuple):
    """Conditions f(x) >= 0, one a row."""

    forms: Ints  # (n, 2): form, and k of the tracked normal it speaks of
    rows: Array  # (n, 12): v, w, direction, sign, and radii about v and w
    coefficients: Array  # (n, terms): of the terms of a state, as many as two tracked normals make
    sizes: Array  # (n, terms): what these are rounded relative to: all of a vector, in whichever frame it is given

    def chosen(self, which: Any) -> Conditions:
        """Return some of them."""
        return Conditions(*(own[which] for own in self))

    @classmethod
    def joined(cls, some: Sequence[Conditions]) -> Conditions:
        """Return several lists in one."""
        return cls(*map(np.vstack, zip(*some, strict=True)))

    @classmethod
    def of(
        cls, form: int, k: int = 0, *, v: Any = 0.0, w: Any = 0.0, m: Any = 0.0, sign: float = 1.0, radii: Any = 0.0
    ) -> Conditions:
        """Return conditions of one form; `v`, `w` and `m` are (n, 3) or (3,) arrays."""
        # with `radii`, (n, 2), of what spheres about v and w are apart
        count = max(len(x) if np.ndim(x) == 2 else 1 for x in (v, w, m))
        rows = np.zeros((count, ROW))
        rows[:, 0:3], rows[:, 3:6], rows[:, 6:9], rows[:, 9], rows[:, 10:] = v, w, m, sign, radii
        known = _coefficients(form, k, rows)
        coefficients = np.zeros((count, SHARED + 2 * EACH))
        coefficients[:, : known.shape[1]] = known
        sizes = np.abs(coefficients)
        if form not in (ACROSS, ACROSS_TURNED):  # with the cross product of parallel edges rounding vanishes, too
            sizes = np.repeat(np.sqrt(np.add.reduceat(coefficients**2, _STARTS, axis=1)), _WIDTHS, axis=1)
        return cls(np.tile(np.array([form, k], dtype=np.int64), (count, 1)), rows, coefficients, sizes)


class TrackedPair(NamedTuple):
    """What fixes the scale pair: two lines; or one, and the point of it nearest to the pair; or the pair itself."""

    lines: Array  # (k, 13), of each tracked feature: how its normal moves, two directions, a point of either body on it
    pair: Array
    sign: float  # of the lines' determinant, which must not change

    @classmethod
    def fixed(cls, pair: Array) -> TrackedPair:
        """Return a scale pair that nothing changes."""
        return cls(np.empty((0, 13)), np.array(pair, dtype=float), 1.0)


def _dot(u: Any, v: Any) -> Any:
    return (u * v).sum(axis=-1, keepdims=True)


def _outer(u: Any, v: Any) -> Any:
    return (u[:, :, None] * v[:, None, :]).reshape(-1, 9)


def _cross(u: Any, v: Any) -> Any:
    return u[..., _NEXT] * v[..., _AFTER] - u[..., _AFTER] * v[..., _NEXT]


class RayStretch:
    """Expansions over x to x + span of a ray: of the pose `R`, (4, 3, 3), and `d`, (4, 3), and of conditions."""

    def __init__(self, ray: Ray, x: float, span: float, tracked: TrackedPair) -> None:
        self.x, self.span, self.tracked = float(x), float(span), tracked
        table = _expanded(ray.motion, tuple(tracked.lines[:, 0].tolist()))(
            [ray.side * x, span], ray.given, tracked.lines[:, 1:].ravel(), [*tracked.pair, tracked.sign]
        )[0].reshape(-1, 4) * [1.0, ray.side, 1.0, 1.0]
        self.R, self.d = table[:9].T.reshape(4, 3, 3).copy(), table[9:POSE].T.copy()
        self._terms = table[POSE:].copy()
        self._rounded = self._terms[:, 3:] + SUMMED * np.abs(self._terms[:, :1])

    @property
    def bounded(self) -> bool:
        """Whether the pose has finite bounds."""
        return bool(np.isfinite(self.R).all() and np.isfinite(self.d).all())

    @property
    def rho(self) -> Array:
        """The scale pair at x, (2,)."""
        with np.errstate(all="ignore"):
            return np.asarray(self._terms[1:3, 0] / self._terms[0, 0])

    def changes(self, to: float, one: float, two: float) -> float:
        """Return how much (d + rho_2 w - rho_1 R v) / (rho_1 + rho_2) is off its value at x + `to` at most."""
        # of points |v| <= one and |w| <= two about the seeds; infinite where it has no bounds
        names = ["DET d", "NUM2", "NUM1 R"]
        rows = [self._terms[_PLACES[name] : _PLACES[name] + _SIZES[name]] for name in names]
        scales = self._terms[_PLACES["NUM1"]] + self._terms[_PLACES["NUM2"]]
        bend = 0.5 * self.span * self.span

        def at(x: float, own: Array) -> Array:
            return np.asarray(own[..., 0] + x * own[..., 1])

        with np.errstate(all="ignore"):
            least = min(at(0.0, scales), at(self.span, scales)) - bend * scales[2]
            total = 0.0
            for own, far in zip(rows, (1.0, two, one), strict=True):
                share = (at(to, own) / at(to, scales))[:, None]
                off = np.hstack([own[:, :2] - share * scales[:2], own[:, 2:3] + np.abs(share) * scales[2]])
                most = np.maximum(np.abs(at(0.0, off)), np.abs(at(self.span, off))) + bend * off[:, 2]
                total += far * float(np.linalg.norm(most))
            return float(total / least) if least > 0.0 and np.isfinite(total) else np.inf

    def expanded(self, conditions: Conditions) -> Array:
        """Return the expansions of conditions, (n, 4)."""
        factors, sizes = (own[:, : len(self._terms)] for own in conditions[2:])
        with np.errstate(all="ignore"):
            signed = factors @ self._terms[:, :2]
            return np.hstack([signed, np.abs(factors) @ self._terms[:, 2:3], sizes @ self._rounded])


@dataclass(frozen=True, eq=False)
class Ray:
    """Motions q = x * direction, x >= 0: of a pattern whose free steps are what they are along the ray."""

    motion: Motion
    given: list[float]  # direction in its parameters, both seeds, and its numbers
    side: float = 1.0  # -1 where x counts the other way

    @classmethod
    def of(cls, motion: Motion, direction: Array, movable_seed: Array, static_seed: Array) -> Ray:
        """Return the ray of a motion; `InputError` for one of the user's own with functions without known bounds."""
        each = zip(motion.steps, motion.by_step(direction.tolist()), strict=True)
        made = [step.own_along_ray(part) for step, part in each]  # a free one a shift, and a turn about a line
        straight = Sequenced(tuple(own for simpler, _ in made for own in simpler))
        _instructions(straight.pattern)
        return cls(
            straight.pattern, [*(x for _, along in made for x in along), *movable_seed, *static_seed, *straight.numbers]
        )

    @property
    def natural_step(self) -> tuple[float, float]:
        """How fast it turns (a unit of x, about) and moves the seed, at rest."""
        rest = self.stretch(0.0, 0.0, TrackedPair.fixed(np.ones(2)))
        return float(np.linalg.norm(rest.R[1])), float(np.linalg.norm(rest.d[1]))

    def stretch(self, x: float, span: float, tracked: TrackedPair) -> RayStretch:
        """Return the expansions over x to x + span."""
        return RayStretch(self, x, span, tracked)

    def exactly(self, x: Any, tracked: TrackedPair, condition: Conditions) -> Any:
        """Return the value of one condition at x, a ball of arb."""
        import flint

        balls: Any = np.frompyfunc(flint.arb, 1, 1)
        arithmetic = {**SCALARS, "CONST": flint.arb}
        given = [self.side * x, *balls(self.given)]
        pose = np.array(_instructions(self.motion).carried_out(arithmetic, given)[0], dtype=object)
        terms = _terms(
            pose[:9].reshape(3, 3), pose[9:], tracked.lines[:, 0].tolist(),
            balls(tracked.lines[:, 1:]).reshape(-1, 4, 3), balls(tracked.pair), flint.arb(tracked.sign),
        )  # fmt: skip
        ((form, k),) = condition.forms.tolist()
        factors = _coefficients(form, k, balls(condition.rows))[0]
        used = np.flatnonzero(factors[: len(terms)] != 0)
        return factors[used] @ terms[used]

    def crossing(
        self, x: float, further: float, tracked: TrackedPair, condition: Conditions, looks: Sequence[float] = LOOKS
    ) -> float | None:
        """Return where one condition becomes negative between x and x + further, None where that is not shown.

        In extended precision: it is looked at on a few points ever further on, to the first at which it is negative.
        Its sign is certain, by balls, on both sides of the place returned, `VERIFIED` from it.
        """
        import flint
        from scipy.optimize import brentq

        def value(at: float) -> float:
            return float(self.exactly(flint.arb(at), tracked, condition))

        with flint.ctx.workprec(BITS):
            low = x
            for share in looks:
                high = x + share * further
                if value(high) < 0:
                    if value(low) <= 0:
                        return low
                    place = float(brentq(value, low, high, xtol=NEAR * high))
                    before, after = (flint.arb(place * (1.0 + side * VERIFIED)) for side in (-1.0, 1.0))
                    certain = self.exactly(before, tracked, condition) > 0 > self.exactly(after, tracked, condition)
                    return place if certain else None
                low = high
        return None


@lru_cache(maxsize=64)
def _instructions(pattern: Motion) -> Instructions:
    """Return what gives a motion's pose of x, the direction, both seeds and its numbers, one after the other."""
    import casadi

    q, others, pose = pose_symbols(pattern)
    given = casadi.SX.sym("given", 1 + q.numel() + others.numel())
    along = casadi.Function("pose", [q, others], [pose])(given[0] * given[1 : 1 + q.numel()], given[1 + q.numel() :])
    instructions = Instructions.of(casadi.Function("ray", [given], [casadi.densify(along)], {"cse": True}))
    for name in instructions.operations:
        if name not in {"INPUT", "OUTPUT", "CONST", *SCALARS}:
            what = "what the motion's function uses has no known bounds along a ray"
            allowed = ", ".join(known.lower() for known in SCALARS)
            raise InputError(what, key="motion", found=name.lower(), allowed=allowed)
    return instructions


@lru_cache(maxsize=64)
def _expanded(pattern: Motion, kinds: tuple[float, ...]) -> Compiled:
    """Return the compiled expansions of pose and terms, row by row, of (x, span), what a ray is given, lines, pair."""
    import casadi

    at, given = casadi.SX.sym("at", 2), casadi.SX.sym("given", len(pattern.parameters) + 6 + len(pattern.numbers))
    lines, tracked = casadi.SX.sym("lines", 12 * len(kinds)), casadi.SX.sym("tracked", 3)

    def constants(symbols: Any) -> Any:
        return np.array([Expansion.constant(symbols[k], at[1]) for k in range(symbols.numel())], dtype=object)

    x = Expansion.variable(at[0], at[1])
    pose = np.array([x * 0.0 + own for own in _instructions(pattern).carried_out(SCALARS, [x, *constants(given)])[0]])
    *pair, sign = constants(tracked)
    terms = _terms(pose[:9].reshape(3, 3), pose[9:], kinds, constants(lines).reshape(-1, 4, 3), pair, sign)
    rows = casadi.vertcat(*(number for own in (*pose, *terms) for number in own.fields))
    return Compiled(casadi.Function("expanded", [at, given, lines, tracked], [casadi.densify(rows)], {"cse": True}))
