"""A decision diagram against the surfaces of its bodies, and against itself."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from mesh_truth import ScaledMeshes
from solids import FAMILIES, Solid, random_solid
from strategies import random_rotation

from fcdm_opt.curve.decision_curve import DEFAULT_BOX, DecisionCurve
from fcdm_opt.curve.exact import exact_curve

BAND = 1e-7  # gaps below this, relative to the bodies' scaled sizes, are not compared: coal's triangles are in floats
OFFSETS = (1e-3, 1e-6)  # relative distances from the curve at which half of the scale pairs are placed
SHORT = 1e-6  # stretches of a line or segment, relative, that are too short to ask for the state beside them
STEP = 1e-7  # from the middle of a segment, times its length, to either side
PLACES = 12  # of a nested pair that are tried
GRID = 4  # scale pairs along each side of the box by which they are judged
LOW, HIGH = np.array(DEFAULT_BOX).T


# -------------------------------------------------------------------------------------------------------------- pairs


@dataclass(frozen=True, eq=False)
class SolidPair:
    """Two solids and a pose of the first in which the diagram most often has something to tell."""

    name: str
    movable: Solid
    static: Solid
    transform: np.ndarray

    @cached_property
    def meshes(self) -> ScaledMeshes:
        return ScaledMeshes(self.movable, self.static, self.transform)


def random_solid_pair(rng: np.random.Generator, number: int) -> SolidPair:
    """Draw the pair of that number: families take turns, every third pair has parallel faces and edges all over.

    In every other round of families pairs are nested: body 1 is smaller, within reach of body 2.
    """
    families = list(FAMILIES)
    tied, nested = number % 3 == 0, number // len(families) % 2 == 1
    kinds = str(rng.choice(families)), families[number % len(families)]
    one, two = (random_solid(rng, kind, not tied and bool(rng.integers(2))) for kind in kinds)
    if nested:
        one = one.times(float(rng.choice([0.5, 0.25])))
    R = _quarter_turn(rng) if tied else random_rotation(rng)
    find = _nested_place if nested else _contact_place
    offset = find(rng, one, two, R, rng.uniform(LOW, HIGH - 0.5))
    if tied:
        offset = np.rint(8 * offset) / 8
    return SolidPair(f"pair {number}: {one.name} and {two.name}", one, two, _transform(one, two, R, offset))


def _quarter_turn(rng: np.random.Generator) -> np.ndarray:
    """One of the 24 turns of a cube."""
    turn = np.eye(3)[rng.permutation(3)] * rng.choice([-1.0, 1.0], 3)
    return np.rint(turn * np.linalg.det(turn))


def _contact_place(rng: np.random.Generator, one: Solid, two: Solid, R: np.ndarray, rho: np.ndarray) -> np.ndarray:
    """Offset of the seeds along a random way, near where the solids touch at a scale pair."""
    way = _direction(rng)
    low, high = 0.0, float(rho @ (one.reach, two.reach))
    for _ in range(10):
        middle = (low + high) / 2
        overlap = _meshes(one, two, R, middle * way).verdict(rho).overlap
        low, high = (middle, high) if overlap else (low, middle)
    return way * high * rng.uniform(0.9, 1.1)


def _nested_place(rng: np.random.Generator, one: Solid, two: Solid, R: np.ndarray, rho: np.ndarray) -> np.ndarray:
    """Offset of the seeds within the larger solid's reach; of some, where the verdict changes most often in the box."""
    offsets = [_direction(rng) * rng.uniform() * two.reach * rho[1] for _ in range(PLACES)]
    return max(offsets, key=lambda offset: _changes(_meshes(one, two, R, offset)))


def _changes(meshes: ScaledMeshes) -> int:
    """How often neighbouring scale pairs of a coarse grid differ in their verdict."""
    sides = [np.linspace(low, high, GRID) for low, high in zip(LOW, HIGH, strict=True)]
    overlap = np.array([[meshes.verdict(np.array([x, y])).overlap for y in sides[1]] for x in sides[0]])
    return int((overlap[1:] != overlap[:-1]).sum() + (overlap[:, 1:] != overlap[:, :-1]).sum())


def _direction(rng: np.random.Generator) -> np.ndarray:
    way = rng.normal(size=3)
    return way / np.linalg.norm(way)


def _transform(one: Solid, two: Solid, R: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Put the turned seed of body 1 at an offset from the seed of body 2."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, two.seed + offset - R @ one.seed
    return T


def _meshes(one: Solid, two: Solid, R: np.ndarray, offset: np.ndarray) -> ScaledMeshes:
    return ScaledMeshes(one, two, _transform(one, two, R, offset))


# --------------------------------------------------------------------------------------------------- drawn as segments


class Drawing:
    """A diagram as it is drawn: its segments in the box, which side of each overlaps, and nothing else."""

    def __init__(self, curve: DecisionCurve) -> None:
        segments = curve.segments
        self.status = curve.status
        self.starts = np.array([s.start for s in segments]).reshape(-1, 2)
        self.runs = np.array([s.end for s in segments]).reshape(-1, 2) - self.starts
        self.lines = np.array([s.line for s in segments]).reshape(-1, 3)
        self.snug = np.array([s.snug for s in segments], dtype=bool)

    def crossings(self, origin: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where a straight way leaves from an origin through segments: shares of the way, segments, shares of these."""
        to_start = self.starts - origin
        turn = _cross(way, self.runs)
        with np.errstate(divide="ignore", invalid="ignore"):
            along, own = _cross(to_start, self.runs) / turn, _cross(to_start, way) / turn
        met = np.flatnonzero((along > 0) & (along < 1) & (own >= 0) & (own <= 1))
        met = met[np.argsort(along[met])]
        return along[met], met, own[met]

    def side(self, rho: np.ndarray, rng: np.random.Generator) -> int:
        """Return -1 (overlap) or 1 (apart) by the first segment on a way to one of them; 0: only ways by corners."""
        if not len(self.starts):
            return {"apart": 1, "overlapping": -1, "contact": 0}[self.status]
        for k in rng.permutation(len(self.starts))[:8]:
            target = self.starts[k] + rng.uniform(0.2, 0.8) * self.runs[k]
            along, met, own = self.crossings(rho, 1.5 * (target - rho))
            if not len(met) or not SHORT < own[0] < 1 - SHORT or (len(met) > 1 and along[1] - along[0] < SHORT):
                continue
            first = met[0]
            return -1 if self.snug[first] or self.lines[first] @ (*rho, -1.0) > 0 else 1
        return 0


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


# ----------------------------------------------------------------------------------------------------- with surfaces


@dataclass
class Tally:
    """Counts over many diagrams. `wrong` are disagreements, each with what is needed to draw it again."""

    counts: Counter[str] = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        self.counts += other.counts
        self.wrong += other.wrong
        for name, value in other.worst.items():
            self.measured(name, value)

    def measured(self, name: str, value: float) -> None:
        self.worst[name] = max(value, self.worst.get(name, 0.0))

    def share(self, part: str, whole: str) -> float:
        return self.counts[part] / max(1, self.counts[whole])


def compare_with_meshes(
    pair: SolidPair,
    curve: DecisionCurve,
    rng: np.random.Generator,
    count: int = 50,
    others: Iterable[DecisionCurve] = (),
) -> Tally:
    """Compare verdicts at random scale pairs of the box, half of them next to the curve.

    The verdict of the surfaces, the sign of the gap, and the side that the drawn segments tell must be one; `others`
    are curves of the same solids from other parts, for the sign of their gaps.
    """
    tally, drawing = Tally(), Drawing(curve)
    tally.counts.update(
        {
            "pairs": 1,
            f"status {curve.status}": 1,
            "segments": len(curve.segments),
            "rising segments": int((drawing.lines[:, 0] * drawing.lines[:, 1] < 0).sum()),
            "snug segments": int(drawing.snug.sum()),
            "branches": len(curve.branches),
            "diagrams of several branches": len(curve.branches) > 1,
            "branches that are no function": sum(not branch.is_function for branch in curve.branches),
        }
    )
    for rho in scale_pairs(drawing, rng, count):
        tally.counts["scale pairs"] += 1
        size = float(rho @ (pair.movable.reach, pair.static.reach))
        gap, truth = float(curve.gap(rho)), pair.meshes.verdict(rho)
        if abs(gap) < BAND * size:
            tally.counts["in the band"] += 1
            continue
        sides = {"gap": int(np.sign(gap)), "drawing": drawing.side(rho, rng)}
        sides |= {f"gap of parts {k + 1}": int(np.sign(other.gap(rho))) for k, other in enumerate(others)}
        expected = -1 if truth.overlap else 1
        tally.counts[{-1: "overlapping", 1: "apart"}[expected]] += 1
        tally.counts["coal disagrees with itself"] += not truth.sure
        tally.counts["beside the curve's corners"] += sides["drawing"] == 0
        tally.counts["one inside the other"] += truth.overlap and truth.distance > 0
        for name, side in sides.items():
            if side not in (0, expected):
                tally.wrong.append(
                    f"{pair.name}: at {rho.tolist()} {name} says {side}, the surfaces {expected} (gap {gap:.3g}, "
                    f"distance {truth.distance:.3g}), exact {exact_side(pair, rho)}"
                )
        if gap > 0:
            tally.measured("gap over distance, less 1", gap / max(truth.distance, 1e-300) - 1)
    return tally


def scale_pairs(drawing: Drawing, rng: np.random.Generator, count: int) -> list[np.ndarray]:
    """Half at random in the box, half beside random segments; all at random where there is no segment."""
    pairs = list(rng.uniform(LOW, HIGH, (count, 2)))
    if len(drawing.starts):
        for k in range(count // 2):
            at = int(rng.integers(len(drawing.starts)))
            rho = drawing.starts[at] + rng.uniform() * drawing.runs[at]
            uphill = drawing.lines[at, :2] / np.linalg.norm(drawing.lines[at, :2])
            opening = OFFSETS[k % len(OFFSETS)] * rng.choice([-1, 1])
            pairs[k] = np.clip(rho + opening * np.linalg.norm(rho) * uphill, LOW, HIGH)
    return pairs


def exact_side(pair: SolidPair, rho: np.ndarray) -> int:
    """The least side over all pairs of parts as the solids were made, in rational arithmetic."""
    one, two = pair.movable.union(), pair.static.union()
    curves = [exact_curve(p, q, pair.transform) for p in one.parts for q in two.parts]
    return min(curve.side(rho.tolist()) for curve in curves)


# ------------------------------------------------------------------------------------------------------ with itself


def check_drawing(pair: SolidPair, curve: DecisionCurve, rng: np.random.Generator, lines: int = 4) -> Tally:
    """Compare segments, gaps and crossings of one diagram with each other."""
    size = pair.movable.size + pair.static.size
    tally, drawing = Tally(), Drawing(curve)
    _check_middles(curve, drawing, size, tally)
    for _ in range(lines):
        origin, end = rng.uniform(LOW, HIGH, (2, 2))
        _check_line(curve, drawing, origin, end, tally)
    for rho1 in rng.uniform(LOW[0], HIGH[0], lines):
        found = curve.crossings(float(rho1))
        along, met, _ = drawing.crossings(np.array([rho1, LOW[1]]), np.array([0.0, HIGH[1] - LOW[1]]))
        expected = LOW[1] + along * (HIGH[1] - LOW[1])
        upright = np.abs(drawing.runs[met, 0]) < SHORT * np.abs(drawing.runs[met, 1])
        tally.counts["verticals"] += 1
        if upright.any() or (len(expected) > 1 and np.diff(expected).min() < SHORT):
            tally.counts["verticals along the curve"] += 1
        elif len(found) != len(expected) or not np.allclose(found, expected, rtol=1e-9):
            tally.wrong.append(f"crossings at rho_1 = {rho1}: {found.tolist()}, segments {expected.tolist()}")
    tally.wrong = [f"{pair.name}: {text}" for text in tally.wrong]
    return tally


def _check_middles(curve: DecisionCurve, drawing: Drawing, size: float, tally: Tally) -> None:
    for start, run, line, snug in zip(drawing.starts, drawing.runs, drawing.lines, drawing.snug, strict=True):
        tally.counts["middles"] += 1
        middle, length = start + run / 2, float(np.linalg.norm(run))
        gap = float(curve.gap(middle))
        tally.measured("gap on a segment, relative", abs(gap) / size)
        if length < SHORT:
            tally.counts["short segments"] += 1
            continue
        uphill = STEP * length * line[:2] / np.linalg.norm(line[:2])
        above, below = (int(np.sign(curve.gap(middle + way * uphill))) for way in (1, -1))
        if (above, below) != (-1, -1 if snug else 1):
            where = f"beside {middle.tolist()}, line {line.tolist()}"
            tally.wrong.append(f"{where}: {above} above, {below} below, snug {snug}")


def _check_line(curve: DecisionCurve, drawing: Drawing, origin: np.ndarray, end: np.ndarray, tally: Tally) -> None:
    """Along a straight line the gap changes its sign at the segments that are not snug, and nowhere else."""
    along, met, _ = drawing.crossings(origin, end - origin)
    tally.counts["lines"] += 1
    stops = [0.0, *along.tolist(), 1.0]
    before = None
    for k, (low, high) in enumerate(pairwise(stops)):
        if high - low < SHORT:
            before = None
            tally.counts["short stretches"] += 1
            continue
        shares = low + np.array([1e-3, 0.3, 0.7, 1 - 1e-3]) * (high - low)
        sides = np.sign(curve.gap(origin + shares[:, None] * (end - origin)))
        tally.counts["stretches"] += 1
        where = f"on the way from {origin.tolist()} to {end.tolist()}, {low} to {high}"
        if (sides != sides[0]).any():
            tally.wrong.append(f"{where}: {sides.tolist()} and no segment")
        elif before is not None and (sides[0] == before) != bool(drawing.snug[met[k - 1]]):
            tally.wrong.append(f"{where}: {before} before a segment and {sides[0]} after it")
        before = sides[0]
