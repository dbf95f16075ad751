"""Least motions for "touch" and "clear", by means that share nothing with the package.

With the rotation fixed, two convex solids overlap for the shifts inside one convex polyhedron, whose faces are among
the separating axes. So pure translations are exact: branch over the faces by which to leave each polyhedron, nearest
point first. Turns are scanned, with the shift exact for each, and what is found is refined: such motions are valid,
and an upper bound of the least.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import nnls

from fcdm_opt_benchmarks.attack import motions
from fcdm_opt_benchmarks.attack.separation import ConvexSolid, axes, distance, reaches, separations
from fcdm_opt_benchmarks.shapes import Array

EPS = 1e-11  # of the size: rounding of a scene's own coordinates
SLACK = 1e-8  # of the size: what a valid motion may miss; far above rounding, far below every size in a scene
FLAT = 1e-10  # slope of a row below which no shift frees the pair along it
MOST_NODES = 4000


class SolidPair(NamedTuple):
    """Two convex solids at the sizes made, at rest; `own`: of the two bodies, not of a keep-out."""

    one: ConvexSolid
    two: ConvexSolid
    clearance: float
    own: bool


class FreeingShifts(NamedTuple):
    """Shifts q that free a pair along one of its axes: g.q >= h; with all g.q < h it overlaps (or is too near)."""

    g: Array
    h: Array
    touch: Array  # h without the clearance
    own: bool


@dataclass(frozen=True, eq=False)
class Setting:
    """What is asked of a motion.

    Attributes
    ----------
    steps : Steps
    movable, static : (3,) arrays
        Seeds.
    pairs : tuple of SolidPair
    touch : bool
        Whether the two bodies must touch, besides not overlapping.
    weights : (k,) array
    limits : (k, 2) array
    size : float
    displacement : bool
        Whether the amount is the largest displacement of a corner, not the weighted one.
    """

    steps: motions.Steps
    movable: Array
    static: Array
    pairs: tuple[SolidPair, ...]
    touch: bool
    weights: Array
    limits: Array
    size: float
    displacement: bool = False

    def poses(self, Q: Any) -> tuple[Array, Array]:
        """Return R, t for parameters (N, k)."""
        return motions.poses(self.steps, Q, self.movable, self.static)

    @cached_property
    def corners(self) -> Array:
        """Corners of body 1 at rest, each once."""
        return np.unique(np.vstack([pair.one.points for pair in self.pairs if pair.own]), axis=0)

    @cached_property
    def slack(self) -> float:
        """Length that a valid motion may miss."""
        return SLACK * self.size

    def amount(self, q: Any) -> float:
        """Return the amount of a motion."""
        if not self.displacement:
            return float(np.linalg.norm(self.weights * q))
        R, t = self.poses(q)
        return float(np.linalg.norm(self.corners @ R[0].T + t[0] - self.corners, axis=1).max())

    def gap(self, q: Any) -> float:
        """Return how far the bodies are apart, or minus the depth of their deepest parts."""
        return min(self._apart(pair, *self.poses(q)) for pair in self.pairs if pair.own)

    def _apart(self, pair: SolidPair, R: Array, t: Array) -> float:
        found = float(separations(pair.one, pair.two, R, t)[0])
        return distance(pair.one.moved(R[0], t[0]), pair.two) if found > 0 else found

    def faults(self, q: Any, slack: float | None = None) -> list[str]:
        """Return what a motion does not meet: nothing where it is valid."""
        allowed = self.slack if slack is None else slack
        R, t = self.poses(q)
        found = []
        own = [self._apart(pair, R, t) - pair.clearance for pair in self.pairs if pair.own]
        if min(own) < -allowed:
            found.append(f"gap: {min(own):.3g} below what is asked")
        if self.touch and min(own) > allowed:
            found.append(f"apart by {min(own):.3g}, should touch")
        other = [self._apart(pair, R, t) - pair.clearance for pair in self.pairs if not pair.own]
        if other and min(other) < -allowed:
            found.append(f"keep-out: {min(other):.3g} below what is asked")
        if (np.asarray(q) < self.limits[:, 0] - 1e-9).any() or (np.asarray(q) > self.limits[:, 1] + 1e-9).any():
            found.append("outside its limits")
        return found

    def margins(self, Q: Any) -> tuple[Array, Array]:
        """Return (separation of the bodies less the clearance, least of all pairs less theirs), (N,) each."""
        R, t = self.poses(Q)
        own, every = np.full(len(R), np.inf), np.full(len(R), np.inf)
        for pair in self.pairs:
            found = separations(pair.one, pair.two, R, t)
            if pair.clearance > 0:  # the distance is no less than the separation: only what is between matters
                for k in np.flatnonzero((found > 0) & (found < pair.clearance)):
                    found[k] = distance(pair.one.moved(R[k], t[k]), pair.two)
                found = found - pair.clearance
            every = np.minimum(every, found)
            own = np.minimum(own, found) if pair.own else own
        return own, every

    def valid(self, Q: Any) -> Any:
        """Tell which motions meet everything but the limits, to rounding."""
        own, every = self.margins(Q)
        fine = every >= -EPS * self.size
        return fine & (own <= EPS * self.size) if self.touch else fine

    @cached_property
    def turns(self) -> Any:
        """Which parameters are angles."""
        return motions.turns(self.steps)

    @cached_property
    def shifts_plainly(self) -> bool:
        """Whether the rotation does not depend on the parameters that are lengths, and the shift is linear in them."""
        q = np.random.default_rng(0).normal(size=(3, len(self.turns)))
        q[:, self.turns] = q[0, self.turns]
        q[2, ~self.turns] = 2 * q[1, ~self.turns] - q[0, ~self.turns]
        R, t = self.poses(q)
        return bool(np.abs(R - R[0]).max() < 1e-12 and np.abs(t[2] - 2 * t[1] + t[0]).max() < 1e-9)

    def affine(self, angles: Array) -> tuple[Array, Array, Array]:
        """Return R (N, 3, 3), t (N, 3) and B (N, 3, m) of x -> R x + t + B s, s the lengths, for angles (N, n)."""
        rows = np.zeros((len(angles), len(self.turns)))
        rows[:, self.turns] = angles
        R, t = self.poses(rows)
        columns = []
        for k in np.flatnonzero(~self.turns):
            more = rows.copy()
            more[:, k] = 1.0
            columns.append(self.poses(more)[1] - t)
        return R, t, np.stack(columns, axis=2)

    def rows(self, R: Array, t: Array, B: Array) -> Iterator[FreeingShifts]:
        """Yield, pair by pair, the rows g (N, m, k), h (N, m) for poses R, t and shifts B."""
        for pair in self.pairs:
            n = axes(pair.one, pair.two, R)
            if pair.clearance > 0:  # corners keep their distance along no axis of a face
                n = np.concatenate([n, _between(n)], axis=1)
            above, below = reaches(pair.one, pair.two, R, n)
            along, slope = np.einsum("nmi,ni->nm", n, t), n @ B
            g = np.concatenate([-slope, slope], axis=1)
            touch = np.concatenate([along - above, -along - below], axis=1)
            yield FreeingShifts(g, touch + pair.clearance, touch, pair.own)

    def bounds(self, inverse: Array) -> tuple[Array, Array]:
        """Return the limits of the lengths as rows G y >= h, y = inverse^-1 q."""
        low, high = self.limits[~self.turns].T
        below, above = np.isfinite(low), np.isfinite(high)
        return np.vstack([inverse[below], -inverse[above]]), np.concatenate([low[below], -high[above]])


def _between(n: Array) -> Array:
    """Return the directions half-way between any two of the first few."""
    few = n[:, :6]
    sums = [few[:, i] + sign * few[:, j] for i, j in itertools.combinations(range(few.shape[1]), 2) for sign in (1, -1)]
    found = np.stack(sums, axis=1)
    lengths = np.linalg.norm(found, axis=2, keepdims=True)
    return np.where(lengths > 1e-6, found / np.where(lengths > 1e-6, lengths, 1.0), n[:, :1])


class KnownMotion(NamedTuple):
    """A valid motion of the oracle's, and whether nothing is smaller."""

    q: Array
    amount: float
    exact: bool


# ------------------------------------------------------------------------------------------------ lengths, angles fixed


def nearest(G: Array, h: Array) -> Array | None:
    """Return the point nearest to 0 with G x >= h, None where there is none: Lawson and Hanson's problem LDP."""
    if not len(h) or (h <= 0).all():
        return np.zeros(G.shape[1])
    norms = np.linalg.norm(G, axis=1)
    steep = norms >= FLAT
    if (h[~steep] > FLAT).any():
        return None
    G, h = G[steep] / norms[steep, None], h[steep] / norms[steep]
    if G.shape[1] == 1:
        low, high = (max(h[side * G[:, 0] > 0], default=-np.inf) for side in (1, -1))
        x = np.clip(0.0, low, max(low, -high))
        return np.array([x]) if low <= -high + FLAT else None
    unit = float(np.abs(h).max())
    E, f = np.vstack([G.T, h / unit]), np.append(np.zeros(G.shape[1]), 1.0)
    u, residual = nnls(E, f)
    r = E @ u - f
    if residual < 1e-9:
        return None
    held = u > 0
    x = np.linalg.lstsq(G[held], h[held], rcond=1e-10)[0]  # the same point, to rounding
    if (G @ x >= h - 1e-12 * unit).all():
        return x
    x = -r[:-1] / r[-1] * unit
    return x if (G @ x >= h - 1e-9 * unit).all() else None


def least_shift(pairs: list[FreeingShifts], touch: bool, bounds: tuple[Array, Array], most: float, eps: float) -> Any:
    """Return (the shift nearest to 0 that meets everything, whether that is certain); (None, ...) where none is.

    Parameters
    ----------
    pairs : list of FreeingShifts
        g (m, k) and h (m,) in coordinates whose norm is the amount.
    touch : bool
        Whether some own pair must touch.
    bounds : G (r, k), h (r,)
        Limits.
    most : float
        Amounts from here on do not matter.
    eps : float
        Length that counts as none.
    """
    kept = [_thinned(pair, eps) for pair in pairs]
    blocks = [pair for pair in kept if not (pair.h[_flat(pair)] <= eps).any()]  # the others overlap for no shift
    count = itertools.count()
    heap: list[Any] = []

    def push(G: Array, h: Array) -> None:
        x = nearest(G, h)
        if x is not None and (size := float(np.linalg.norm(x))) < most:
            heapq.heappush(heap, (size, next(count), x, G, h))

    if touch:
        for pair in kept:
            if pair.own and not (pair.touch[_flat(pair)] < -eps).any():
                push(np.vstack([bounds[0], -pair.g]), np.append(bounds[1], -pair.touch - _ease(pair, eps)))
    else:
        push(*bounds)
    for _ in range(MOST_NODES):
        if not heap:
            return None, True
        _, _, x, G, h = heapq.heappop(heap)
        depth, worst = max(((float((pair.h - pair.g @ x).min()), k) for k, pair in enumerate(blocks)), default=(0.0, 0))
        if depth <= 2 * eps:
            return x, True
        pair = blocks[worst]
        norms = np.linalg.norm(pair.g, axis=1)
        useful = ~_flat(pair) & (pair.h < (most if np.isfinite(most) else 1e30) * norms)
        for k in np.flatnonzero(useful):
            push(np.vstack([G, pair.g[k]]), np.append(h, pair.h[k]))
            G, h = np.vstack([G, -pair.g[k]]), np.append(h, -pair.h[k])  # what the next ways out need not look at again
    return None, False


def _flat(pair: FreeingShifts) -> Any:
    return np.linalg.norm(pair.g, axis=1) < FLAT


def _ease(pair: FreeingShifts, eps: float) -> Any:
    """Flat rows of a sliding contact are zero to rounding only."""
    return np.where(_flat(pair), eps, 0.0)


def _thinned(pair: FreeingShifts, eps: float) -> FreeingShifts:
    """Return a pair with rows that are repeated kept once."""
    table = np.round(np.column_stack([pair.g, pair.h]) / np.array([1e-10] * pair.g.shape[1] + [max(eps, 1e-300)]))
    _, first = np.unique(table, axis=0, return_index=True)
    return FreeingShifts(pair.g[first], pair.h[first], pair.touch[first], pair.own)


def intervals(rows: FreeingShifts, eps: float) -> tuple[Array, Array, Any, Any]:
    """Return, for one length, (low, high) of the blocked interval, whether it is blocked and may touch, each (N,)."""
    g, h = rows.g[:, :, 0], rows.h
    flat = np.abs(g) < FLAT
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = h / g
    high = np.where((g > 0) & ~flat, ends, np.inf).min(axis=1)
    low = np.where((g < 0) & ~flat, ends, -np.inf).max(axis=1)
    blocked = ~(flat & (h <= eps)).any(axis=1) & (low < high - eps)
    touching = ~(flat & (h < -eps)).any(axis=1) & (low <= high + eps)
    return low, high, blocked, touching


def least_lengths(setting: Setting, angles: Array, most: float = np.inf) -> Array:
    """Return, for angles (N, n), the least length of a motion with one parameter besides them; nan where none is."""
    eps = EPS * setting.size
    R, t, B = setting.affine(angles)
    spans = [(*intervals(rows, eps), rows.own) for rows in setting.rows(R, t, B)]
    own_limits = setting.limits[~setting.turns][0]
    ends = [np.clip(np.zeros(len(angles)), *own_limits)]
    for low, high, *_ in spans:
        ends += [low, high]
    candidates = np.stack(ends, axis=1)
    fine = np.isfinite(candidates) & (candidates >= own_limits[0] - eps) & (candidates <= own_limits[1] + eps)
    touched = np.zeros_like(fine)
    for low, high, blocked, touching, own in spans:
        inside = (candidates > low[:, None] + 2 * eps) & (candidates < high[:, None] - 2 * eps)
        fine &= ~(inside & blocked[:, None])
        if own:
            near = (candidates >= low[:, None] - eps) & (candidates <= high[:, None] + eps)
            touched |= near & touching[:, None]
    if setting.touch:
        fine &= touched
    sizes = np.where(fine, np.abs(np.where(fine, candidates, 0.0)), np.inf)
    best = sizes.argmin(axis=1)
    rows_ = np.arange(len(angles))
    return np.where(np.isfinite(sizes[rows_, best]), candidates[rows_, best], np.nan)


# ----------------------------------------------------------------------------------------------------------- the search


def least(setting: Setting, rng: np.random.Generator, effort: int = 1) -> KnownMotion | None:
    """Return the least motion known, None where none is: exact for translations, refined from a scan elsewhere."""
    rest = np.zeros(len(setting.turns))
    if not setting.faults(rest, EPS * setting.size):
        return KnownMotion(rest, 0.0, True)
    count = int(setting.turns.sum())
    plain = not setting.displacement and setting.shifts_plainly and not setting.turns.all()
    if count == 0:
        found = _translated(setting)
    elif plain:
        found = _turned_and_shifted(setting, rng, effort)
    elif len(setting.turns) == 1:
        found = _scanned(setting)
    else:
        found = _along_rays(setting, rng, effort)
    if found is None or setting.faults(found.q):
        return None
    return found


def _translated(setting: Setting) -> KnownMotion | None:
    """Return the least pure translation."""
    R, t, B = setting.affine(np.zeros((1, 0)))
    # coordinates y = S q have the amount for their norm: for the displacement |B q|, with B = O S
    S = np.linalg.qr(B[0])[1] if setting.displacement else np.diag(setting.weights)
    clearances = any(pair.clearance for pair in setting.pairs)
    if clearances and len(setting.turns) == 1:
        return _on_line(setting)
    inverse = np.linalg.inv(S)
    pairs = [FreeingShifts(r.g[0] @ inverse, r.h[0], r.touch[0], r.own) for r in setting.rows(R, t, B)]
    y, certain = least_shift(pairs, setting.touch, setting.bounds(inverse), np.inf, EPS * setting.size)
    if y is None:
        return None
    q = inverse @ y
    return KnownMotion(q, setting.amount(q), certain and not clearances)


def _on_line(setting: Setting) -> KnownMotion | None:
    """Return the least single translation with clearances: the distance of two convex solids is convex along it."""
    eps, reach = EPS * setting.size, 8.0 * setting.size
    R, t, B = setting.affine(np.zeros((1, 0)))
    direction, spans = B[0][:, 0], []
    for pair, rows in zip(setting.pairs, setting.rows(R, t, B), strict=True):
        if ((np.abs(rows.g[0, :, 0]) < FLAT) & (rows.h[0] < -eps)).any():
            continue  # it passes by

        def away(s: float, pair: SolidPair = pair) -> float:
            return setting._apart(pair, np.eye(3)[None], s * direction[None]) - pair.clearance

        low, high = -reach, reach
        for _ in range(80):
            one, two = low + (high - low) / 3, high - (high - low) / 3
            low, high = (low, two) if away(one) < away(two) else (one, high)
            if away(0.5 * (low + high)) < -0.5 * pair.clearance - eps:
                break
        middle = 0.5 * (low + high)
        if away(middle) > eps:
            continue
        ends = []
        for far in (-reach, reach):
            near = middle
            for _ in range(50):
                half = 0.5 * (near + far)
                near, far = (half, far) if away(half) < 0 else (near, half)
            ends.append(far)
        spans.append((*ends, pair.own))
    candidates = [float(np.clip(0.0, *setting.limits[0])), *(end for span in spans for end in span[:2])]
    fine = [
        s
        for s in candidates
        if setting.limits[0, 0] <= s <= setting.limits[0, 1]
        and not any(low + 2 * eps < s < high - 2 * eps for low, high, _ in spans)
        and (not setting.touch or any(own and low - eps <= s <= high + eps for low, high, own in spans))
    ]
    if not fine:
        return None
    best = min(fine, key=abs)
    return KnownMotion(np.array([best]), setting.amount([best]), True)


def _turned_and_shifted(setting: Setting, rng: np.random.Generator, effort: int) -> KnownMotion | None:
    """Search over the angles, with the lengths exact for each."""
    turns = setting.turns
    heavy, limits = setting.weights[turns], setting.limits[turns]
    low, high = np.maximum(limits[:, 0], -np.pi), np.minimum(limits[:, 1], np.pi)

    def motion(angles: Array, best: float) -> Array | None:
        """Return the least whole motion with these angles."""
        turned = float(np.linalg.norm(heavy * angles))
        if turned >= best or (angles < low).any() or (angles > high).any():
            return None
        q = np.zeros(len(turns))
        q[turns] = angles
        if len(turns) - len(angles) == 1:
            length = least_lengths(setting, angles[None])[0]
            if np.isnan(length):
                return None
            q[~turns] = length
            return q
        R, t, B = setting.affine(angles[None])
        inverse = np.diag(1.0 / setting.weights[~turns])
        pairs = [FreeingShifts(r.g[0] @ inverse, r.h[0], r.touch[0], r.own) for r in setting.rows(R, t, B)]
        rest = np.sqrt(best * best - turned * turned) if np.isfinite(best) else np.inf
        y, _ = least_shift(pairs, setting.touch, setting.bounds(inverse), rest, EPS * setting.size)
        if y is None:
            return None
        q[~turns] = inverse @ y
        return q

    if len(heavy) == 1:
        return _one_angle(setting, motion, (low[0], high[0]), effort)
    return _several_angles(setting, motion, rng, effort)


Inner = Callable[[Array, float], Array | None]


def _one_angle(setting: Setting, motion: Inner, span: tuple[float, float], effort: int) -> KnownMotion | None:
    """Scan one angle, then halve round the best of the scan again and again."""
    fine = np.concatenate([-np.geomspace(1e-7, np.pi, 120)[::-1], [0.0], np.geomspace(1e-7, np.pi, 120)])
    grid = np.unique(np.concatenate([np.linspace(-np.pi, np.pi, 361 * effort), fine, np.pi / 4 * np.arange(-4, 5)]))
    grid = np.unique(np.clip(grid, *span))
    single = len(setting.turns) == 2
    weight = setting.weights[setting.turns][0]
    own = setting.weights[~setting.turns][0]

    def values(angles: Array, best: float) -> list[tuple[float, Array]]:
        found = []
        if single:
            lengths = least_lengths(setting, angles[:, None])
            for angle, length in zip(angles, lengths, strict=True):
                q = np.zeros(2)
                q[setting.turns], q[~setting.turns] = angle, length
                found.append((float(np.hypot(weight * angle, own * length)), q))
        else:
            for angle in angles[np.argsort(np.abs(angles))]:
                least = motion(np.array([angle]), best)
                if least is not None:
                    best = min(best, setting.amount(least))
                    found.append((setting.amount(least), least))
        return [(amount, q) for amount, q in found if not np.isnan(amount)]

    found = values(grid, np.inf)
    if not found:
        return None
    found.sort(key=lambda item: item[0])
    best = found[0]
    for _, start in found[: 6 * effort]:
        centre = float(start[setting.turns][0])
        at = int(np.searchsorted(grid, centre))
        step = float(max(grid[min(at + 1, len(grid) - 1)] - centre, centre - grid[max(at - 1, 0)]))
        local: tuple[float, Array] = (np.inf, start)
        for _ in range(16):
            near = values(np.clip(centre + step * np.linspace(-1, 1, 17), *span), np.inf if single else best[0] * 1.5)
            local = min([local, *near], key=lambda item: item[0])
            centre, step = float(local[1][setting.turns][0]), step / 5
        best = min(best, local, key=lambda item: item[0])
    return KnownMotion(best[1], best[0], False)


def _several_angles(setting: Setting, motion: Inner, rng: np.random.Generator, effort: int) -> KnownMotion | None:
    """Search two or three angles from several starts, by steps along random directions that shrink."""
    turns = setting.turns
    n = int(turns.sum())
    best: Array | None = motion(np.zeros(n), np.inf)
    amount = np.inf if best is None else setting.amount(best)
    starts = [np.zeros(n)]
    scales = np.geomspace(1e-3, 1.5, 4)
    for scale in scales:
        starts += [sign * scale * axis for axis in np.eye(n) for sign in (1.0, -1.0)]
        starts += list(scale * rng.normal(size=(2 * effort, n)))
    tried = []
    for start in starts:
        q = motion(start, amount * 1.2 if np.isfinite(amount) else np.inf)
        if q is not None:
            tried.append((setting.amount(q), start, q))
            if tried[-1][0] < amount:
                amount, best = tried[-1][0], q
    tried.sort(key=lambda item: item[0])
    for own, start, found in tried[: 2 + 2 * effort]:
        at, value, q = start, own, found
        step = max(0.3 * float(np.linalg.norm(start)), 0.02)
        for _ in range(60 * effort):
            u = rng.normal(size=n)
            u *= step / np.linalg.norm(u)
            for other in (at + u, at - u, at * (1 - step)):
                tested = motion(other, value)
                if tested is not None and setting.amount(tested) < value * (1 - 1e-12):
                    at, value, q = other, setting.amount(tested), tested
                    step *= 1.5
                    break
            else:
                step *= 0.75
            if step < 1e-9:
                break
        if value < amount:
            amount, best = value, q
    return None if best is None else KnownMotion(best, amount, False)


def _scanned(setting: Setting) -> KnownMotion | None:
    """Return the least of one parameter: a dense scan of the separation, roots by bisection."""
    low, high = setting.limits[0]
    turning = bool(setting.turns[0])
    reach = np.pi if turning else 4.0 * setting.size
    low, high = max(low, -reach), min(high, reach)
    slow = any(pair.clearance for pair in setting.pairs)
    fine = np.geomspace(1e-9, 1.0, 60 if slow else 200) * reach
    even = np.linspace(-reach, reach, 361 if slow else 3001)
    grid = np.unique(np.clip(np.concatenate([-fine, [0.0], fine, even]), low, high))
    own, every = setting.margins(grid[:, None])
    eps = EPS * setting.size
    at_once = grid[setting.valid(grid[:, None])].tolist()
    events: list[tuple[float, Callable[[], list[float]]]] = [(abs(s), partial(list, [s])) for s in at_once]
    radius = 2.0 * setting.size + float(np.linalg.norm(setting.corners - setting.movable, axis=1).max())
    for sign, values in ((1.0, every), (-1.0, own)):
        for k in np.flatnonzero((values[1:] >= 0) != (values[:-1] >= 0)):
            ends = grid[k], grid[k + 1]
            events.append((min(map(abs, ends)), partial(_root, setting, *ends, sign > 0)))
        middle, high = sign * values[1:-1], np.maximum(sign * values[:-2], sign * values[2:])
        near = -middle <= (grid[2:] - grid[:-2]) * radius  # a window, or a graze, between the points of the scan
        for k in 1 + np.flatnonzero((middle < 0) & (middle >= high) & near):
            ends = grid[k - 1], grid[k + 1]
            events.append((min(map(abs, ends)), partial(_window, setting, *ends, sign)))
    best: KnownMotion | None = None
    for nearest_, candidates in sorted(events, key=lambda event: event[0]):
        if best is not None and nearest_ > abs(best.q[0]):
            break  # what follows is further from rest
        for s in candidates():
            found, others = setting.margins([[s]])
            meets = others[0] >= -10 * eps and (not setting.touch or found[0] <= 10 * eps)
            if meets and (best is None or abs(s) < abs(best.q[0])):
                best = KnownMotion(np.array([s]), setting.amount([s]), False)
    return best


def _window(setting: Setting, low: float, high: float, sign: float) -> list[float]:
    """Return the ends of a short interval round the peak where the sign changes, none where it does not."""
    peak = _peak(setting, low, high, sign)
    if sign * _value(setting, peak, sign > 0) < -EPS * setting.size:
        return []
    return [peak, *_root(setting, low, peak, sign > 0), *_root(setting, peak, high, sign > 0)]


def _value(setting: Setting, s: float, every: bool) -> float:
    return float(setting.margins([[s]])[1 if every else 0][0])


def _root(setting: Setting, low: float, high: float, every: bool) -> list[float]:
    """Return both ends of the last bracket of a change of sign."""
    first = _value(setting, low, every) >= 0
    for _ in range(70):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if (_value(setting, middle, every) >= 0) == first:
            low = middle
        else:
            high = middle
    return [low, high]


def _peak(setting: Setting, low: float, high: float, sign: float) -> float:
    """Return where the separation is largest (or, sign -1, least) in an interval, by golden section."""
    ratio = (5**0.5 - 1) / 2
    for _ in range(60):
        one, two = high - ratio * (high - low), low + ratio * (high - low)
        if sign * _value(setting, one, sign > 0) < sign * _value(setting, two, sign > 0):
            low = one
        else:
            high = two
    return 0.5 * (low + high)


def _along_rays(setting: Setting, rng: np.random.Generator, effort: int) -> KnownMotion | None:
    """Return the shortest valid motion on many rays from rest, the best of them turned little by little."""
    k = len(setting.turns)
    scale = 1.0 / setting.weights
    reach = 2.0 * setting.size
    radii = np.concatenate([[0.0], np.geomspace(1e-4, 1.0, 60) * reach])

    def shortest(rays: Array, most: float) -> list[tuple[float, Array]]:
        """Return the first valid motion on each ray, as far as it is shorter than `most`."""
        rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        own = radii[: max(int((radii < 1.2 * most).sum()), 2)]
        Q = rays[:, None, :] * own[:, None] * scale
        separated, every = (found.reshape(Q.shape[:2]) for found in setting.margins(Q.reshape(-1, k)))
        signs = (separated if setting.touch else every) >= 0
        crossings = signs[:, 1:] != signs[:, :-1]
        found: list[tuple[float, Array]] = []
        for _ in range(4):  # the first place where the sign changes, then the next
            left = np.flatnonzero(crossings.any(axis=1))
            at = crossings[left].argmax(axis=1)
            crossings[left, at] = False
            low, high, before = own[at], own[at + 1], signs[left, at]
            for _ in range(45 if len(left) else 0):
                middle = 0.5 * (low + high)
                value = setting.margins(middle[:, None] * rays[left] * scale)[0 if setting.touch else 1] >= 0
                low, high = np.where(value == before, middle, low), np.where(value == before, high, middle)
            for j, *ends in zip(left, low, high, strict=True):
                motions_ = [radius * rays[j] * scale for radius in ends if radius < most]
                valid = [q for q in motions_ if not setting.faults(q, 0.1 * setting.slack)]
                if valid:
                    found.append((setting.amount(valid[0]), valid[0]))
                    crossings[j] = False
        return found

    if k == 2:
        angles = np.linspace(0, 2 * np.pi, 48 * effort, endpoint=False)
        rays = np.column_stack([np.cos(angles), np.sin(angles)])
    else:
        rays = np.vstack([np.eye(k), -np.eye(k), rng.normal(size=(40 * effort, k))])
    tried = sorted(shortest(rays, np.inf), key=lambda item: item[0])
    if not tried:
        return None
    best = tried[0]
    for start in tried[:3]:
        near, step = start, 0.1
        for _ in range(12 * effort):
            u = near[1] * setting.weights
            found = shortest(u + step * np.linalg.norm(u) * rng.normal(size=(6, k)), near[0])
            better = min(found, key=lambda item: item[0], default=near)
            if better[0] < near[0]:
                near = better
            else:
                step *= 0.5
        best = min(best, near, key=lambda item: item[0])
    return KnownMotion(best[1], best[0], False)
