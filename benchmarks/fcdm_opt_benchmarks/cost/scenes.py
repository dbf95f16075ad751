"""Scenes in which it is counted what the models cost: by name, each a problem that a seed draws again."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion.motions import XYZ, Motion, Rotation, Translation
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem, load_problems
from fcdm_opt_benchmarks.pairs import SHAPES
from fcdm_opt_benchmarks.shapes import box, random_directions, random_rotation
from fcdm_opt_benchmarks.union_pairs import UnionPair

FILES = Path(__file__).parents[3] / "problems"
"""The repository's example problems: their scenes are left out where the package stands alone."""

LARGER = 1.02  # times the scales at which the bodies touch: the parts made
GAP = 1.2  # times the reach of both hulls: how far apart they are drawn
HALVINGS = 60
BOX = ((0.2, 6.0), (0.2, 6.0))
BLOCK, AROUND = 0.15, 1.3  # half a keep-out's width, and its least distance from the seed, in reaches of body 1
CLEARANCE = 0.02  # of a keep-out, in reaches of body 1
CASES = {
    **{f"example 1, {case}": ("example1", case) for case in "ABCD"},
    **{f"example 2, {case}": ("example2", case) for case in "ABCD"},
    "boxes, one direction": ("boxes", "both made larger"),
    "boxes, two directions": ("boxes", "two directions"),
    "boxes, already clear": ("boxes", "already clear"),
    "peg, at the wall": ("peg_square", "B at the wall"),
    "peg, running clearance": ("peg_square", "running clearance"),
    "gears, play": ("gears", "both made smaller"),
    "bracket past ribs": ("bracket", "past the ribs as made"),
    "lid, flush": ("lid", "A flush on the rim"),
    "lid, room for a seal": ("lid", "room for a seal"),
}


def _sized(kind: str, *sizes: tuple[int, int]) -> dict[str, tuple[int, int]]:
    """Return (vertices or parts, parameters) by the name of their scene."""
    return {f"{kind} {size}, {count} parameter{'s' * (count > 1)}": (size, count) for size, count in sizes}


SOLIDS = _sized("hull", (12, 1), (12, 2), (12, 3), (12, 6), (100, 1), (100, 2), (100, 6), (1000, 1), (1000, 3))
UNIONS = _sized("union", (10, 1), (10, 3), (30, 2), (60, 1), (60, 2))
AMONG = {f"hull among {count} keep-outs": count for count in (12, 40)}
QUICK = (
    "boxes, one direction",
    "example 2, A",
    "peg, running clearance",
    "hull 12, 6 parameters",
    "union 10, 1 parameter",
)


def names(quick: bool) -> tuple[str, ...]:
    """Return the scenes' names: five of them, or all."""
    there = [name for name in CASES if FILES.is_dir()]
    every = (*there, *SOLIDS, *UNIONS, *AMONG)
    return tuple(name for name in every if name in QUICK or not quick)


@lru_cache(maxsize=4)
def scene(name: str, seed: int) -> Problem:
    """Return the problem of a scene; raises `InputError` for a name that is none."""
    if name in CASES:
        file, case = CASES[name]
        return next(problem for problem in load_problems(FILES / f"{file}.toml") if problem.name == case)
    if name in SOLIDS:
        vertices, parameters = SOLIDS[name]
        return overlapping(*hull_pair(seed, vertices), parameters)
    if name in UNIONS:
        return _unions(seed, *UNIONS[name])
    if name in AMONG:
        return _among(seed, AMONG[name])
    raise InputError("no such scene", key="scene", found=name, allowed=", ".join(names(quick=False)))


def motion_of(parameters: int) -> Motion:
    """Return the motion of 1, 2, 3 or 6 parameters: shifts along x, then y and z, and turns about z, then x and y."""
    shifts: list[Motion] = [Translation(axis) for axis in XYZ]
    turns: list[Motion] = [Rotation(axis) for axis in XYZ[-1:] + XYZ[:2]]
    first, *others = {1: shifts[:1], 2: [shifts[0], turns[0]], 3: [*shifts[:2], turns[0]],
                      4: [*shifts, turns[0]], 5: [*shifts, *turns[:2]], 6: [*shifts, *turns]}[parameters]  # fmt: skip
    motion: Motion = first
    for other in others:
        motion = motion >> other
    return motion


def hull_pair(seed: int, vertices: int) -> tuple[Body, Body]:
    """Return two random long hulls that are apart, one beside the other along x."""
    rng = np.random.default_rng([seed, vertices])
    one, two = (SHAPES["long"].corners(rng, vertices) @ random_rotation(rng).T for _ in range(2))
    reach = one[:, 0].max() - two[:, 0].min()
    return Body.convex(one, name="one"), Body.convex(two + GAP * reach * np.eye(3)[0], name="two")


def overlapping(movable: Body, static: Body, parameters: int, keep_out: tuple[KeepOut, ...] = ()) -> Problem:
    """Return the problem of two bodies whose parts were made `LARGER` than fits: they shall touch again."""
    curve = decision_curve(movable, static, box=BOX)
    low, high = BOX[0]
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if curve.gap((middle, middle)) > 0 else (low, middle)
    made = LARGER * high
    return Problem(
        movable,
        static,
        nominal="drawn",
        target=(made, made),
        goal="touch",
        motion=motion_of(parameters),
        box=BOX,
        keep_out=keep_out,
    )


def _unions(seed: int, parts: int, parameters: int) -> Problem:
    pair = UnionPair.of(seed, "spiky", parts, 1)
    return overlapping(_moved(pair.parts[0], pair.transforms[0]), pair.bodies[1], parameters)


def _moved(parts: list[Array], T: Array) -> Body:
    return Body.from_parts([part @ T[:3, :3].T + T[:3, 3] for part in parts], seed=T[:3, 3], name="one")


def _among(seed: int, count: int) -> Problem:
    """Put blocks all around body 1, some of them in its way."""
    one, two = hull_pair(seed, 12)
    rng, reach = np.random.default_rng([seed, count]), float(np.linalg.norm(one.vertices - one.seed, axis=1).max())
    corners = BLOCK * reach * box((-1, -1, -1), (1, 1, 1))
    places = one.seed + reach * random_directions(rng, count) * rng.uniform(AROUND, 2.0 * AROUND, (count, 1))
    blocks = [
        KeepOut(
            Body.convex(corners @ random_rotation(rng).T + place, name=f"block {k + 1}"), clearance=CLEARANCE * reach
        )
        for k, place in enumerate(places)
    ]
    return overlapping(one, two, 3, keep_out=tuple(blocks))
