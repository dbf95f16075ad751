"""The scenes: a fit, sizes made, a motion, a goal, and what else is asked; each drawn from its name alone."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from fcdm_opt_benchmarks.attack import motions
from fcdm_opt_benchmarks.attack.least import KnownMotion, Setting, SolidPair, least
from fcdm_opt_benchmarks.attack.lines import TrackedPoint, least_tracked, switching_points
from fcdm_opt_benchmarks.attack.motions import MotionStep, Steps
from fcdm_opt_benchmarks.attack.separation import ConvexSolid
from fcdm_opt_benchmarks.attack.solids import FITS, Fit, Pieces, no_play
from fcdm_opt_benchmarks.shapes import Array, box

SIGNS = {"A": (1, 1), "B": (1, -1), "C": (-1, 1), "D": (-1, -1)}
TOLERANCES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05)
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Block:
    """A keep-out: a box at its drawn size, with a clearance."""

    corners: Array
    clearance: float


@dataclass(frozen=True, eq=False)
class FitScene:
    """One question, as plain data.

    Attributes
    ----------
    name : str
        "kind:family/number", from which `drawn` makes it again.
    fit : Fit
    s1, s2 : (3,) arrays
        Seeds.
    steps : Steps
    label : str
        Kind of motion.
    length : float
        Turns radians into lengths.
    target : (2,) array
        Sizes asked for: nominal * (1 + tau * signs), or given so.
    """

    name: str
    fit: Fit
    s1: Array
    s2: Array
    steps: Steps
    label: str
    length: float
    target: Array
    goal: str | None = "touch"
    nominal: Any = "drawn"
    tolerance: float | None = None
    requirement: str | None = None
    pair: str = "any"
    clearance: float = 0.0
    path: str = "coherent"
    amount: str = "weighted"
    heavier: dict[int, float] = field(default_factory=dict)
    limits: dict[int, tuple[float, float]] = field(default_factory=dict)
    keep_out: tuple[Block, ...] = ()
    tracked: TrackedPoint | None = None
    closed: float | None = None  # the least amount, where a formula gives it

    @property
    def family(self) -> str:
        """Kind and family."""
        return self.name.split("/")[0]

    @property
    def count(self) -> int:
        """Number of parameters."""
        return len(motions.turns(self.steps))

    @cached_property
    def setting(self) -> Setting:
        """What a motion must do, in the oracles' terms."""
        one = [ConvexSolid.of(piece).scaled(self.s1, float(self.target[0])) for piece in self.fit.movable]
        two = [ConvexSolid.of(piece).scaled(self.s2, float(self.target[1])) for piece in self.fit.static]
        kept = [(ConvexSolid.of(block.corners), block.clearance) for block in self.keep_out]
        pairs = [SolidPair(p, q, self.clearance, True) for p in one for q in two]
        pairs += [SolidPair(p, q, clearance, False) for p in one for q, clearance in kept]
        weights = motions.weights(self.steps, self.length)
        for k, weight in self.heavier.items():
            weights[k] = weight
        limits = np.array([self.limits.get(k, (-np.inf, np.inf)) for k in range(self.count)])
        size = max(float(np.ptp(np.vstack(pieces), axis=0).max()) for pieces in (self.fit.movable, self.fit.static))
        touch = self.goal in ("touch", "at", "seat") or self.pair == "touch"
        displacement = self.amount == "displacement"
        return Setting(self.steps, self.s1, self.s2, tuple(pairs), touch, weights, limits, size, displacement)

    def least(self, effort: int = 1) -> KnownMotion | None:
        """Return the least motion that the oracles know, None where they know none."""
        if self.goal in ("touch", "clear"):
            return least(self.setting, np.random.default_rng(zlib.crc32(self.name.encode())), effort)
        if self.tracked is not None and self.goal in ("at", "beyond") and self.pair == "any":
            coherent = self.path == "coherent"
            return least_tracked(self.tracked, self.setting, self.goal, self.target, coherent)
        if self.closed is not None:
            return KnownMotion(np.zeros(self.count), self.closed, True)
        return None

    def describe(self) -> str:
        """Return the question in words."""
        words = [f"{self.name}: {self.label}, goal {self.goal}, sizes {self.target.round(6).tolist()}"]
        words += [f"pair {self.pair}"] * (self.pair != "any") + [f"clearance {self.clearance:g}"] * (self.clearance > 0)
        words += [f"limits {self.limits}"] * bool(self.limits) + ["keep-out"] * bool(self.keep_out)
        words += [self.amount] * (self.amount != "weighted") + [f"weights {self.heavier}"] * bool(self.heavier)
        return ", ".join(words)


# -------------------------------------------------------------------------------------------------------------- motions


def _axis(rng: np.random.Generator) -> Any:
    if rng.random() < 0.15:
        u = rng.normal(size=3)
        return tuple((u / np.linalg.norm(u)).tolist())
    return AXES[int(rng.choice(3, p=[0.3, 0.3, 0.4]))]


def _translation(rng: np.random.Generator) -> MotionStep:
    return MotionStep("T", _axis(rng))


def _turn(rng: np.random.Generator) -> MotionStep:
    centre: Any = "seed"
    which = rng.random()
    if which < 0.25:
        centre = (0.0, 0.0, 0.0)
    elif which < 0.5:
        centre = tuple((rng.integers(-8, 9, size=3) / 4).tolist())
    return MotionStep("R", _axis(rng), centre)


def _screw(rng: np.random.Generator, pitch: Any) -> MotionStep:
    if rng.random() < 0.35:
        return MotionStep("S", None, "seed", pitch)
    return MotionStep("S", _axis(rng), tuple((rng.integers(-8, 9, size=3) / 4).tolist()), pitch)


def _axes(rng: np.random.Generator, count: int) -> Steps:
    return tuple(MotionStep("T", AXES[k]) for k in rng.permutation(3)[:count])


MOTIONS: dict[str, Callable[[np.random.Generator], Steps]] = {
    "T": lambda rng: (_translation(rng),),
    "R": lambda rng: (_turn(rng),),
    "TT": lambda rng: _axes(rng, 2),
    "screw": lambda rng: (_screw(rng, float(rng.choice([-0.5, 0.1, 0.3, 1.0]))),),
    "T>>R": lambda rng: (_translation(rng), _turn(rng)),
    "TTT": lambda rng: _axes(rng, 3),
    "R>>T": lambda rng: (_turn(rng), _translation(rng)),
    "free screw": lambda rng: (_screw(rng, "free"),),
    "Free": lambda rng: (MotionStep("F"),),
    "R>>R": lambda rng: (_turn(rng), _turn(rng)),
    "T>>T>>R": lambda rng: (*_axes(rng, 2), _turn(rng)),
}
CHEAP = ("T", "R", "TT", "screw", "T>>R", "TTT", "R>>T", "free screw", "R>>R")
MOST_FREE, MOST_TURNS = 16, 6  # part pairs with which six parameters, and two turns, are asked


# -------------------------------------------------------------------------------------------------------------- drawing


def drawn(name: str) -> FitScene | None:
    """Return the scene of a name, None where the draw gives none."""
    kind, rest = name.split(":")
    family, number = rest.rsplit("/", 1)
    rng = np.random.default_rng([zlib.crc32(f"{kind}:{family}".encode()), int(number)])
    return KINDS[kind](name, family, int(number), rng)


def names(quick: bool, rounds: int) -> Iterator[str]:
    """Yield the names of a run; the families take turns, so that any beginning holds each."""
    for number in range(rounds):
        for family in FITS:
            yield f"fit:{family}/{number}"
        for family in SEATS:
            if number < (2 if quick else rounds // 2):
                yield f"seat:{family}/{number}"
        for _ in range(2):
            yield f"tracked:hulls/{2 * number + _}"
        for _ in range(1 if quick else 4):
            yield f"no play:peg/{4 * number + _}"


def _seeds(fit: Fit, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return middles of boxes, means of corners, or a corner."""
    found = []
    for pieces in (fit.movable, fit.static):
        corners = np.vstack(pieces)
        ways = ((corners.min(axis=0) + corners.max(axis=0)) / 2, corners.mean(axis=0), corners[0])
        found.append(ways[int(rng.choice(3, p=[0.5, 0.35, 0.15]))])
    return found[0], found[1]


def _length(pieces: Pieces) -> float:
    return 0.5 * float(np.linalg.norm(np.ptp(np.vstack(pieces), axis=0)))


def _sizes(rng: np.random.Generator, nominal: Array | None = None) -> dict[str, Any]:
    """Return requirement, tolerance and target."""
    rho = np.ones(2) if nominal is None else nominal
    if nominal is None and rng.random() < 0.15:
        return {"target": rho * (1 + rng.uniform(-0.08, 0.08, size=2).round(4))}
    requirement, tau = str(rng.choice(list(SIGNS))), float(rng.choice(TOLERANCES))
    return {"requirement": requirement, "tolerance": tau, "target": rho * (1 + tau * np.array(SIGNS[requirement]))}


def _placed(scene: FitScene, rng: np.random.Generator) -> FitScene:
    """Return the scene moved as a whole, which changes no amount."""
    if scene.label == "Free" and scene.amount == "weighted":
        R = Rotation.from_rotvec(rng.normal(size=3) * 0.3).as_matrix()
    else:
        R = Rotation.from_rotvec(rng.normal(size=3) * float(rng.choice([1e-6, 1e-3, 0.3]))).as_matrix()
    t = rng.normal(size=3) * float(rng.choice([0.0, 10.0, 100.0]))
    fit = Fit([p @ R.T + t for p in scene.fit.movable], [p @ R.T + t for p in scene.fit.static], None, scene.fit.round)
    return replace(
        scene,
        fit=fit,
        s1=R @ scene.s1 + t,
        s2=R @ scene.s2 + t,
        steps=tuple(step.placed(R, t) for step in scene.steps),
        keep_out=tuple(Block(block.corners @ R.T + t, block.clearance) for block in scene.keep_out),
    )


def _fit(name: str, family: str, number: int, rng: np.random.Generator) -> FitScene:
    """Return "touch" and "clear", with or without clearance, keep-outs, limits, weights."""
    fit = FITS[family](rng)
    allowed = list(MOTIONS)
    label = allowed[(number + zlib.crc32(family.encode())) % len(allowed)]
    many = len(fit.movable) * len(fit.static)
    if (label in ("Free", "T>>T>>R") and many > MOST_FREE) or (label == "R>>R" and many > MOST_TURNS):
        label = "TTT" if label == "Free" else "R>>T"
    s1, s2 = _seeds(fit, rng)
    steps = MOTIONS[label](rng)
    if any(step.kind == "S" and step.axis is None for step in steps) and np.linalg.norm(s1 - s2) < 0.1:
        steps = (MotionStep("S", AXES[2], tuple(s1.tolist()), steps[0].pitch),)
    scene = FitScene(name, fit, s1, s2, steps, label, _length(fit.movable), **_sizes(rng))
    which = rng.random()
    goal, clearance = ("touch", 0.0) if which < 0.45 else ("clear", 0.0)
    if which > 0.8 and label != "Free":
        clearance = float(rng.choice([0.005, 0.02, 0.1]))
    pair = "any"
    if clearance == 0 and rng.random() < 0.2:
        pair = str(rng.choice(["clear", "touch"]))
    scene = replace(scene, goal=goal, clearance=clearance, pair=pair)
    if rng.random() < 0.2:
        scene = replace(scene, keep_out=(_block(scene, rng),))
    for _ in range(8):  # few scenes where there is nothing to do
        if number % 8 == 0 or scene.setting.faults(np.zeros(scene.count)):
            break
        goal = goal if clearance else str(rng.choice(["touch", "clear"]))
        scene = replace(scene, **{"requirement": None, "tolerance": None, **_sizes(rng)}, goal=goal)
    turns = motions.turns(steps)
    if rng.random() < 0.2:
        k = int(rng.integers(len(turns)))
        reach = float(rng.choice([0.1, 0.4, 1.5] if turns[k] else [0.1, 1.0, 5.0]))
        low = -reach if rng.random() < 0.6 else 0.0
        scene = replace(scene, limits={k: (low, reach)})
    if rng.random() < 0.1 and label != "Free":
        scene = replace(scene, heavier={int(rng.integers(len(turns))): float(rng.choice([0.5, 2.0, 5.0]))})
    elif rng.random() < 0.1 and label in ("T", "TT", "R", "screw", "TTT"):
        scene = replace(scene, amount="displacement")
    return _placed(scene, rng) if rng.random() < 0.25 else scene


def _block(scene: FitScene, rng: np.random.Generator) -> Block:
    """Return a box beside the movable part, near enough to be in the way."""
    corners = scene.s1 + scene.target[0] * (np.vstack(scene.fit.movable) - scene.s1)
    low, high = corners.min(axis=0), corners.max(axis=0)
    k, gap = int(rng.integers(3)), float(rng.choice([0.03, 0.1, 0.4]))
    near, far = low - 0.5, high + 0.5
    if rng.random() < 0.5:
        near[k], far[k] = high[k] + gap, high[k] + gap + 0.5
    else:
        near[k], far[k] = low[k] - gap - 0.5, low[k] - gap
    return Block(box(near, far), float(rng.choice([0.0, 0.0, 0.02])))


SEATS = ("slab", "U", "headed peg", "lid", "comb", "plate", "foot", "shaft")
"""Fits with faces on each other in one plane, where the least "seat" is the change of the two heights."""


def _seat(name: str, family: str, number: int, rng: np.random.Generator) -> FitScene | None:
    fit = FITS[family](rng)
    s1, s2 = _seeds(fit, rng)
    up = AXES[2]
    label = ("T", "T>>R", "TT", "R>>T", "slanted", "TTT", "Free")[number % 7]
    round_about = MotionStep("R", up, "seed")
    slant = tuple((np.array([0.2, 0.0, 1.0]) / np.hypot(1, 0.2)).tolist())
    steps = {
        "T": (MotionStep("T", up),),
        "T>>R": (MotionStep("T", up), round_about),
        "TT": (MotionStep("T", AXES[0]), MotionStep("T", up)),
        "R>>T": (MotionStep("R", AXES[0], "seed"), MotionStep("T", up)),
        "slanted": (MotionStep("T", slant),),
        "TTT": tuple(MotionStep("T", axis) for axis in AXES),
        "Free": (MotionStep("F"),),
    }[label]
    scene = FitScene(name, fit, s1, s2, steps, label, _length(fit.movable), **_sizes(rng), path="free")
    rise = (1 - scene.target[1]) * s2[2] - (1 - scene.target[0]) * s1[2]
    along = slant[2] if label == "slanted" else 1.0
    scene = replace(
        scene, goal=str(rng.choice(["seat", "at"])) if len(steps) == 1 else "seat", closed=abs(rise / along)
    )
    q = np.zeros(scene.count)
    q[{"T": 0, "T>>R": 0, "TT": 1, "R>>T": 1, "slanted": 0, "TTT": 2, "Free": 2}[label]] = rise / along
    if scene.setting.faults(q):  # the sizes made do not go into each other: what is flush is not free
        scene = replace(scene, closed=None)
    return _placed(scene, rng) if rng.random() < 0.25 else scene


def _tracked(name: str, family: str, number: int, rng: np.random.Generator) -> FitScene | None:
    """Return "at" and "beyond" of two hulls at a switching point where two lines meet."""
    for _ in range(20):
        fit = FITS[family](rng)
        s1, s2 = (np.vstack(pieces).mean(axis=0) for pieces in (fit.movable, fit.static))
        one, two = ConvexSolid.of(fit.movable[0]), ConvexSolid.of(fit.static[0])
        points = switching_points(one, two, s1, s2, (0.8, 3.0))
        if not points:
            continue
        tracked = points[int(rng.integers(len(points)))]
        label = ("T", "TT", "R", "TTT", "screw")[number % 5]
        goal = "at" if label in ("TT", "TTT") and rng.random() < 0.5 else "beyond"
        steps, length, sizes = MOTIONS[label](rng), _length(fit.movable), _sizes(rng, tracked.rho)
        more = {**sizes, "goal": goal, "nominal": tuple(tracked.rho.tolist()), "tracked": tracked}
        return FitScene(name, fit, s1, s2, steps, label, length, path=str(rng.choice(["coherent", "free"])), **more)
    return None


def _no_play(name: str, family: str, number: int, rng: np.random.Generator) -> FitScene:
    """Return a peg that exactly fills its hole, at sizes that are asked for as drawn."""
    fit = no_play(rng)
    s1 = np.array(((0, 0, 2), (0, 0, 0), (1, 1, 0), (2, 0, 0), (0, 0, 1.5))[int(rng.integers(5))], dtype=np.float64)
    s2 = np.array(((0, 0, 1.5), (1, 1, 1), (2, 0, 0), (0, 0, 0))[int(rng.integers(4))], dtype=np.float64)
    label = ("T", "TT", "TTT", "T>>R")[number % 4]
    goal = ("at", "seat", None, "touch", "clear")[int(rng.integers(5))]
    steps, length = MOTIONS[label](rng), _length(fit.movable)
    sizes = _sizes(rng) if goal in ("touch", "clear") else _required(rng)
    path = str(rng.choice(["coherent", "free"]))
    return FitScene(name, fit, s1, s2, steps, label, length, **sizes, goal=goal, path=path)


def _required(rng: np.random.Generator) -> dict[str, Any]:
    """Return sizes that a requirement gives."""
    while True:
        sizes = _sizes(rng)
        if "requirement" in sizes:
            return sizes


KINDS: dict[str, Callable[..., FitScene | None]] = {
    "fit": _fit,
    "seat": _seat,
    "tracked": _tracked,
    "no play": _no_play,
}
