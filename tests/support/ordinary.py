"""What many tests ask about: axis-aligned boxes, a scene of them drawn by lot, and the shipped problem files."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion.motions import Translation
from fcdm_opt.problem.problem import Problem, load_problems
from fcdm_opt.problem.solution import Solution
from fcdm_opt.solver import solve

PROBLEMS = Path(__file__).parents[2] / "problems"


@cache
def problems(file: str) -> dict[str, Problem]:
    """The problems of a shipped file, by name."""
    return {problem.name: problem for problem in load_problems(PROBLEMS / f"{file}.toml")}


@cache
def solved(file: str, name: str) -> Solution:
    """The solution of one of them."""
    return solve(problems(file)[name])


def corners(low: Any, high: Any) -> np.ndarray:
    return np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)], dtype=float)


def box(low: Any, high: Any, name: str = "box", seed: Any = None) -> Body:
    """A box between two corners; seed: its centre unless given."""
    return Body.convex(corners(low, high), seed=np.add(low, high) / 2.0 if seed is None else seed, name=name)


CUBE = box((-1, -1, -1), (1, 1, 1))
FAR = box((80, -1, -1), (90, 1, 1))


def random_scene(rng: np.random.Generator, room: tuple[float, float], count: int | None = None) -> Problem:
    """A cube in a static block, between keep-outs, one to three unless given, and limits of a plane."""

    def block(name: str, reach: float) -> Body:
        middle, half = rng.uniform(-reach, reach, 2), rng.uniform(0.5, 2.5, 2)
        low, high = middle - half, middle + half
        return box((low[0], low[1], -1), (high[0], high[1], 1), name)

    limits = {name: (-rng.uniform(*room), rng.uniform(*room)) for name in ("TX", "TY")}
    count = int(rng.integers(1, 4)) if count is None else count
    keep_out = [block(f"K{k}", 3.0) for k in range(count)]
    motion = Translation("x") >> Translation("y")
    return Problem(CUBE, block("static", 1.0), target=(1, 1), goal="clear", motion=motion, limits=limits,
                   keep_out=keep_out)  # fmt: skip
