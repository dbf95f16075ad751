"""Random problems over all motions, goals and requirements: convex pairs of 12 vertices, and small non-convex unions.

Case k of a seed is drawn from (seed, kind, k) alone, so that any one can be drawn again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pairs import random_hull, random_rotation

import fcdm_opt as fo
from fcdm_opt.errors import InputError
from fcdm_opt.motion import Motion, Rotation, Screw, Translation

BOX = ((0.5, 2.5), (0.5, 2.5))
VERTICES = 12
KINDS = ("convex", "nonconvex")
TRACKED = ("beyond", "at")
GOALS = ("beyond", "beyond", "at", "touch", "clear", "seat")
TOLERANCES = (0.02, 0.005, 0.05, (0.01, 0.03), ((0.01, 0.03), (0.02, 0.005)))
ATTEMPTS = 200  # draws of bodies for one case


@dataclass(frozen=True, eq=False)
class Case:
    """A problem and what was drawn for it."""

    seed: int
    kind: str
    number: int
    motion: str
    problem: fo.Problem

    @property
    def labels(self) -> dict[str, Any]:
        """What tells the case from others."""
        problem = self.problem
        return {
            "seed": self.seed,
            "kind": self.kind,
            "number": self.number,
            "motion": self.motion,
            "parameters": len(problem.motion.parameters),
            "goal": problem.goal,
            "pair": problem.pair,
            "path": problem.path,
            "requirement": problem.requirement or "target",
            "limits": bool(np.isfinite(problem.limits).any()),
            "keep_outs": len(problem.keep_out),
            "amount": problem.amount,
            "parts": [len(problem.movable.parts), len(problem.static.parts)],
        }

    @property
    def command(self) -> str:
        """What draws and compares this case again."""
        what = f"{self.seed} 1" if self.kind == "convex" else f"{self.seed} 0 --nonconvex 1"
        return f"python benchmarks/compare_motions.py {what} --first {self.number}"


# ------------------------------------------------------------------------------------------------------------- motions


def _axis(rng: np.random.Generator) -> Any:
    return str(rng.choice(["x", "y", "z", "-z"])) if rng.integers(2) else tuple(rng.normal(size=3))


def _line(rng: np.random.Generator) -> Any:
    return tuple(rng.uniform(-1, 1, 3)), tuple(rng.normal(size=3))


def _pitch(rng: np.random.Generator) -> float:
    return float(rng.choice([0.2, 1.0, 5.0, -0.5, 180.0 / math.pi]))


ELEMENTARY: dict[str, Callable[[np.random.Generator], Motion]] = {
    "translation": lambda rng: Translation(_axis(rng)),
    "rotation, seed": lambda rng: Rotation(_axis(rng)),
    "rotation, origin": lambda rng: Rotation(_axis(rng), "origin"),
    "rotation, point": lambda rng: Rotation(_axis(rng), tuple(rng.uniform(-2, 2, 3))),
    "screw, seeds": lambda rng: Screw("seeds", _pitch(rng)),
    "screw, line": lambda rng: Screw(_line(rng), _pitch(rng)),
    "free screw, seeds": lambda rng: Screw("seeds"),
    "free screw, line": lambda rng: Screw(_line(rng)),
}


def _sequence(rng: np.random.Generator, names: Sequence[str], count: int) -> Motion:
    first, *others = (ELEMENTARY[str(rng.choice(names))](rng) for _ in range(count))
    for other in others:
        first = first >> other
    return first


def _six(rng: np.random.Generator) -> Motion:
    motion: Motion = Translation("x") >> Translation("y") >> Translation("z")
    return motion >> Rotation("x") >> Rotation("y") >> Rotation("z")


SINGLE = list(ELEMENTARY)[:6]
MOTIONS: dict[str, Callable[[np.random.Generator], Motion]] = {
    **ELEMENTARY,
    "translation, rotation": lambda rng: Translation(_axis(rng)) >> Rotation(_axis(rng)),
    "two translations": lambda rng: Translation(_axis(rng)) >> Translation(tuple(rng.normal(size=3))),
    "two steps": lambda rng: _sequence(rng, SINGLE, 2),
    "three steps": lambda rng: _sequence(rng, SINGLE, 3),
    "plane": lambda rng: Translation("x") >> Translation("y") >> Rotation("z"),
    "six steps": _six,
    "free": lambda rng: fo.Free() if "Free" in dir(fo) else _six(rng),
}


# -------------------------------------------------------------------------------------------------------------- bodies


def _hull(rng: np.random.Generator) -> np.ndarray:
    return random_hull(rng, VERTICES) * rng.uniform(0.5, 1.3, 3) @ random_rotation(rng).T


def _block(low: Sequence[float], high: Sequence[float]) -> np.ndarray:
    return np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)], dtype=float)


def _shape(rng: np.random.Generator) -> list[np.ndarray]:
    """L, U, ring, or two to four overlapping hulls."""
    kind, thick = int(rng.integers(5)), float(rng.uniform(0.3, 0.5))
    sides = [
        _block((-1, -1, -0.5), (1, -1 + thick, 0.5)),
        _block((-1, -1, -0.5), (-1 + thick, 1, 0.5)),
        _block((1 - thick, -1, -0.5), (1, 1, 0.5)),
        _block((-1, 1 - thick, -0.5), (1, 1, 0.5)),
    ]
    if kind < 3:
        stretch = rng.uniform(0.7, 1.2, 3)
        return [part * stretch for part in sides[: 2 + kind]]
    sizes = rng.integers(5, 9, int(rng.integers(2, 5))).tolist()
    return [0.7 * rng.normal(size=(n, 3)) + 0.6 * (k > 0) * rng.normal(size=3) for k, n in enumerate(sizes)]


def _hexagon(rng: np.random.Generator, height: float) -> np.ndarray:
    """Prism of 12 vertices that stands on z = 0."""
    angle = np.arange(6) * np.pi / 3 + rng.uniform(0, 1)
    ring = np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(0.6, 1.4, 2)
    return np.vstack([np.column_stack([ring, np.full(6, z)]) for z in (0.0, height)])


def _bodies(rng: np.random.Generator, kind: str) -> tuple[fo.Body, fo.Body]:
    away = rng.normal(size=3)
    away *= rng.uniform(1.8, 3.5) / np.linalg.norm(away)
    if kind == "convex":
        parts = [[_hull(rng)], [_hull(rng)]]
    else:
        parts = [_shape(rng), _shape(rng)] if rng.integers(2) else [[_hull(rng)], _shape(rng)]
    made = []
    for own, shift, name in zip(parts, (np.zeros(3), away), ("one", "two"), strict=True):
        R = random_rotation(rng)
        points = [part @ R.T + shift for part in own]
        seed = points[0].mean(axis=0)
        if rng.random() < 0.2:  # often outside
            seed = seed + rng.normal(size=3) * 0.7
        made.append(fo.Body.from_parts(points, seed=seed, name=name))
    return made[0], made[1]


def _seated(rng: np.random.Generator, kind: str) -> tuple[fo.Body, fo.Body]:
    """Body 2 stands flush on body 1, as drawn."""
    h, shift = rng.uniform(0.5, 1.5, 2), np.append(rng.uniform(-0.5, 0.5, 2), 0.0)
    lower, upper = _hexagon(rng, float(h[0])) - [0, 0, h[0]], _hexagon(rng, float(h[1])) + shift
    parts = [[lower], [upper]]
    if kind == "nonconvex":
        parts[1].append(_block((-0.3, -0.3, 0.2), (2.0, 0.3, 0.6)) + shift)
    R = random_rotation(rng)
    one, two = (fo.Body.from_parts([p @ R.T for p in own], seed=own[0].mean(axis=0) @ R.T) for own in parts)
    return one, two


# ---------------------------------------------------------------------------------------------------------------- cases


def draw(seed: int, kind: str, number: int) -> Case:
    """Draw a case."""
    rng = np.random.default_rng([seed, KINDS.index(kind), number])
    name = list(MOTIONS)[number % len(MOTIONS)]
    goal = str(rng.choice(GOALS))
    if goal == "seat" and name.startswith(("rotation", "screw")):
        goal = "touch"  # hardly any flush contact survives a single turn
    for _ in range(ATTEMPTS):
        motion = MOTIONS[name](rng)
        try:
            return Case(seed, kind, number, name, _problem(rng, kind, motion, goal))
        except InputError:
            continue  # what cannot be asked is drawn again: no switching point, a goal that this contact excludes
    raise RuntimeError(f"nothing could be drawn for {seed}, {kind}, {number}")


def _problem(rng: np.random.Generator, kind: str, motion: Motion, goal: str) -> fo.Problem:
    one, two = _seated(rng, kind) if goal == "seat" else _bodies(rng, kind)
    nominal: Any = "drawn"
    if goal != "seat":
        curve = fo.decision_curve(one, two, box=BOX)
        points, segments = curve.switching_points, curve.segments
        if not segments or (goal == "beyond" and not points):
            raise InputError("no such nominal contact in the box", key="box")
        inside = goal != "beyond" and (not points or rng.integers(2))
        if inside:
            segment = segments[int(rng.integers(len(segments)))]
            nominal = tuple(segment.start + rng.uniform(0.1, 0.9) * (segment.end - segment.start))
        else:
            nominal = int(rng.integers(len(points))) + 1
        if goal in ("touch", "clear") and rng.random() < 0.25:
            nominal = "drawn"
    arguments: dict[str, Any] = {"nominal": nominal, "motion": motion, "goal": goal, "box": BOX}
    if rng.random() < 0.75:
        tolerance = TOLERANCES[int(rng.integers(len(TOLERANCES)))]
        arguments |= {"requirement": str(rng.choice(list("ABCD"))), "tolerance": tolerance}
    else:
        drawn = nominal == "drawn"
        rho = np.ones(2) if drawn else np.array(nominal) if isinstance(nominal, tuple) else points[nominal - 1].rho
        arguments |= {"target": tuple(rho * (1 + rng.uniform(-0.05, 0.05, 2)))}
    if goal in TRACKED or goal == "seat":
        arguments["path"] = str(rng.choice(["coherent", "coherent", "free"]))
    if goal == "beyond" and rng.random() < 0.4:
        arguments["pair"] = str(rng.choice(["clear", "touch"]))
    if goal == "clear" and rng.random() < 0.5:
        arguments["clearance"] = float(rng.uniform(0.005, 0.05))
    if rng.random() < 0.25:
        typical = float(rng.choice([0.02, 0.1, 0.5]))
        limited = [p.name for p in motion.parameters if rng.random() < 0.6]
        arguments["limits"] = {
            key: (0.0, typical) if rng.random() < 0.3 else (-typical, 2 * typical) for key in limited
        }
    if rng.random() < 0.2:
        arguments["keep_out"] = (_obstacle(rng, one),)
    if rng.random() < 0.15:
        arguments["amount"] = "displacement"
    return fo.Problem(one, two, **arguments)


def _obstacle(rng: np.random.Generator, one: fo.Body) -> fo.KeepOut:
    """Put a small block beside body 1."""
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)
    reach = float(np.abs((one.vertices - one.seed) @ way).max())
    centre = one.seed + way * (reach * rng.uniform(0.9, 1.3) + 0.25)
    corners = _block((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2)) @ random_rotation(rng).T + centre
    clearance = float(rng.choice([0.0, 0.0, 0.01]))
    return fo.KeepOut(fo.Body.convex(corners, name="obstacle"), clearance=clearance)
