"""Make the data set: scenes drawn from a seed or by hand, each with its exact answer or a proved interval.

    python benchmarks/make_dataset.py [--seed 1] [--out benchmarks/dataset/scenes.json] [--only WORD]

Shifts and scales are exact: whole numbers, `fcdm_opt_benchmarks.references.shifts`, which knows nothing of `fcdm_opt`.
With turns the answer is a closed form, or the amount and the lower bound that `fcdm_opt` proves
(`solve(certify=True)`); of two hulls the amount is worked out again in balls of 57 digits (`motions.least`). A scene
whose gap stays above `WIDEST` is left out.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from fcdm_opt_benchmarks.attack.solids import ring, walls
from fcdm_opt_benchmarks.pairs import random_hull
from fcdm_opt_benchmarks.references import shifts
from fcdm_opt_benchmarks.shapes import box, polygon, prism, random_directions, random_rotation
from fcdm_opt_benchmarks.stability.drawn_parts import PARTS

VERSION = "1.1"
DATASET = Path(__file__).parent / "dataset"
MESHES = Path(__file__).parent / "meshes"
DIGITS = 4  # of coordinates that are drawn by lot, or are on a circle
WIDEST = 2e-3  # relative: gap of a proved interval
X, Y, Z = ([float(k == j) for j in range(3)] for k in range(3))
SLANTS = ([0.6, 0.8, 0.0], [0.36, 0.48, 0.8], [0.48, 0.64, 0.6], [0.28, -0.96, 0.0])
"""Directions whose length is exactly 1."""
Scene = dict[str, Any]


def loaded(path: Path) -> Any:
    """Return a script of the data set as a module."""
    sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


# --------------------------------------------------------------------------------------------------- bodies, questions


def body(parts: Sequence[Any], seed: Any) -> Scene:
    """Return a union of convex parts, coordinates to `DIGITS` places."""
    places = [[[round(float(x), DIGITS) + 0.0 for x in row] for row in np.asarray(part).tolist()] for part in parts]
    return {"seed": [round(float(x), DIGITS) + 0.0 for x in seed], "parts": places}


def along(*axes: Any) -> list[Scene]:
    """Return translations."""
    return [{"translation": list(axis)} for axis in axes]


def about(axis: Any, centre: Any = "seed") -> Scene:
    """Return a turn."""
    return {"rotation": list(axis), "centre": centre if centre == "seed" else [float(x) for x in centre]}


def asked(movable: Scene, motion: Sequence[Scene], goal: str, **more: Any) -> Scene:
    """Return a question; a radian counts as half the box diagonal of the movable body, a screw's as its helix."""
    corners = np.vstack([np.array(part) for part in movable["parts"]])
    length = round(0.5 * float(np.linalg.norm(np.ptp(corners, axis=0))), DIGITS)
    weights: list[float] = []
    for step in motion:
        own = [1.0] * 3 + [length] * 3 if "free" in step else [1.0] if "translation" in step else [length]
        weights += [math.hypot(step["pitch"], length)] if "screw" in step else own
    return {"goal": goal, "motion": list(motion), "weights": weights, "length": length, **more}


def scene(
    kind: str,
    family: str,
    name: str,
    tags: str,
    movable: Scene,
    static: Scene,
    scale: Any,
    question: Scene,
    **more: Any,
) -> Scene:
    """Return a scene without its answer."""
    return {
        "name": f"{family}: {name}",
        "class": kind,
        "family": family,
        "tags": tags.split(),
        "movable": movable,
        "static": static,
        "scale": list(map(float, scale)),
        "question": question,
        **more,
    }


# -------------------------------------------------------------------------------------------------------------- generic

FREE = [{"free": True}]
TURNED = ((8, "long", "touch"), (12, "round", "clear"), (20, "flat", "touch"), (8, "round", "clear"))
"""Hulls that turn: vertices, shape, goal."""


def hull(rng: np.random.Generator, vertices: int, shape: str = "round") -> Any:
    """Return corners of a hull, to `DIGITS` places, all of them still corners of the rounded points."""
    from scipy.spatial import ConvexHull

    stretch = {"round": (1, 1, 1), "long": (1, 0.75, 0.5), "flat": (1, 1, 0.2)}[shape]
    points = np.round(random_hull(rng, vertices) * stretch @ random_rotation(rng).T, DIGITS)
    return points[np.sort(ConvexHull(points).vertices)]


def away(rng: np.random.Generator, one: Any, two: Any, gap: float) -> tuple[Any, Any]:
    """Return body 2 moved along some direction until its gap to body 1 along that is as given; and the direction."""
    (way,) = random_directions(rng, 1)
    return np.round(two + ((one @ way).max() - (two @ way).min() + gap) * way, DIGITS), way


def generic(rng: np.random.Generator) -> Iterator[Scene]:
    """Yield hulls and unions of hulls in general position."""
    zero = np.zeros(3)

    def pair(vertices: int, shape: str, gap: float) -> tuple[Scene, Scene, Any]:
        one, two = hull(rng, vertices, shape), hull(rng, vertices, shape)
        placed, way = away(rng, one, two, gap)
        return body([one], zero), body([placed], placed.mean(axis=0)), way

    for vertices, shape in ((8, "round"), (20, "long"), (60, "round"), (100, "flat")):
        one, two, _ = pair(vertices, shape, 0.3)
        question = {"goal": "scale", "rho1": 1.0, "motion": [], "weights": []}
        yield scene("generic", "scale", f"two {shape} hulls of {vertices}", "", one, two, (1, 1), question)
    cases = (
        (8, "round", (0,), 0.2),
        (20, "long", (1,), 0.2),
        (60, "round", (0, 1), 0.1),
        (12, "flat", (0, 1), 0.1),
        (8, "long", (0, 1, 2), 0.2),
        (12, "round", (0, 1, 2), 0.2),
        (20, "flat", (0,), 0.3),
        (60, "long", (0, 1), 0.05),
        (8, "flat", (0, 1, 2), 0.05),
    )
    for (vertices, shape, axes, gap), goal in product(cases, ("touch", "clear")):
        one, two, way = pair(vertices, shape, gap if goal == "touch" else -gap - 0.4)
        ways = [X, Y, Z] if len(axes) == 3 else SLANTS
        order = np.argsort([-abs(np.dot(way, own)) for own in ways])
        motion = along(*(ways[k] for k in order[: len(axes)]))
        if len(axes) == 2 and goal == "clear":
            motion = along(X, Y)
        yield scene(
            "generic",
            "shifts",
            f"{goal}, {len(axes)} along, {shape} hulls of {vertices}",
            "",
            one,
            two,
            (1, 1),
            asked(one, motion, goal),
        )
    for k, goal in product(range(3), ("touch", "clear")):
        again = ", again" if k > 1 else ""
        parts = [[hull(rng, 8) * 0.7 + 0.6 * way for way in random_directions(rng, 2 + k % 2)] for _ in range(2)]
        whole = [np.vstack(own) for own in parts]
        placed, _ = away(rng, *whole, 0.25 if goal == "touch" else -1.0)
        shift = placed[0] - whole[1][0]
        one, two = body(parts[0], zero), body([own + shift for own in parts[1]], shift)
        motion = along(X, Y, Z)[: 2 if goal == "touch" or k % 2 else 3]
        yield scene(
            "generic",
            "unions",
            f"{goal}, {len(motion)} along, {2 + k % 2} hulls each{again}",
            "union",
            one,
            two,
            (1.02, 0.98),
            asked(one, motion, goal),
        )
        if goal == "touch":
            question = asked(one, [{"translation": X}, about(Y)], goal)
            yield scene(
                "generic",
                "unions",
                f"{goal}, x and a turn, {2 + k % 2} hulls each{again}",
                "union",
                one,
                two,
                (1.02, 0.98),
                question,
            )
    turns: dict[str, Callable[[Any], list[Scene]]] = {
        "a turn": lambda way: [about(np.round(np.cross(way, X) / np.linalg.norm(np.cross(way, X)), 3), "seed")],
        "a screw": lambda way: [
            {"screw": {"point": [0.0, 0.0, 0.0], "direction": np.round(way, 3).tolist()}, "pitch": 1.0}
        ],
        "x and a turn": lambda way: [{"translation": X}, about(Z)],
        "x, y and a turn": lambda way: [{"translation": X}, {"translation": Y}, about(Z)],
        "six": lambda way: FREE,
    }
    for (kind, steps), (vertices, shape, goal) in product(turns.items(), TURNED):
        one, two, way = pair(vertices, shape, 0.05 if goal == "touch" else -0.3)
        if kind == "a turn":
            one["seed"] = np.round(-0.8 * way + 0.5 * np.cross(way, Z), 3).tolist()  # off the middle: a lever
        scale = (1.02, 0.99) if goal == "touch" else (1.01, 1.0)
        if goal == "touch":
            scale = (0.98, 0.99)
        yield scene(
            "generic",
            "turns",
            f"{goal}, {kind}, {shape} hulls of {vertices}",
            "",
            one,
            two,
            scale,
            asked(one, steps(way), goal),
        )
    golden = (1 + math.sqrt(5)) / 2
    corners = [p for a, b in product((1, -1), (golden, -golden)) for p in ((0, a, b), (a, b, 0), (b, 0, a))]
    ball = body([np.array(corners)], zero)
    for name, motion in (("z", [about(Z)]), ("two", [about(X), about(Z)])):
        wall = body([box((2.5, -3, -3), (3, 3, 3))], (2.75, 0, 0))
        yield scene(
            "generic",
            "out of reach",
            f"touch, a ball turned about its centre, {name}",
            "",
            ball,
            wall,
            (1, 1),
            asked(ball, motion, "touch"),
            answer={"none": True, "source": "no corner is farther than 1.9022 from the centre, the wall is at 2.5"},
        )


# ---------------------------------------------------------------------------------------------------------------- drawn


def gear(teeth: int, root: float, tip: float, phase: float, low: float, high: float) -> list[Any]:
    """Return a gear's parts: a disc, and a trapezoid for each tooth that reaches into it."""
    angles = phase + 2 * math.pi * np.arange(teeth) / teeth
    disc = prism(root * polygon(2 * teeth, phase + math.pi / (2 * teeth)), low, high)
    half = 2 * math.pi / teeth / 4

    def at(radius: float, angle: float) -> tuple[float, float]:
        return radius * math.cos(angle), radius * math.sin(angle)

    outline = [
        [at(0.8 * root, a - half), at(tip, a - 0.55 * half), at(tip, a + 0.55 * half), at(0.8 * root, a + half)]
        for a in angles
    ]
    return [disc, *(prism(own, low, high) for own in outline)]


def geodesic() -> Any:
    """Return 42 points on the unit sphere: an icosahedron's corners, and the middles of its edges."""
    golden = (1 + math.sqrt(5)) / 2
    corners = np.array([p for a, b in product((1, -1), (golden, -golden)) for p in ((0, a, b), (a, b, 0), (b, 0, a))])
    near = [(i, j) for i, j in product(range(12), range(12)) if i < j and np.linalg.norm(corners[i] - corners[j]) < 2.1]
    points = np.vstack([corners, [corners[i] + corners[j] for i, j in near]])
    return points / np.linalg.norm(points, axis=1)[:, None]


def tube(count: int, bend: float, radius: float, thick: float, sides: int) -> list[Any]:
    """Return a bent tube as slices between neighbouring sections: curved, not convex."""
    section = thick * polygon(sides)
    slices = []
    for k in range(count):
        ends = []
        for angle in (bend * k / count, bend * (k + 1) / count):
            out = np.array([math.cos(angle), math.sin(angle), 0.0])
            ends.append((radius + section[:, :1]) * out + section[:, 1:] * np.array(Z))
        slices.append(np.vstack(ends))
    return slices


def drawn(rng: np.random.Generator) -> Iterator[Scene]:
    """Yield parts as engineers draw them."""
    yield from _boxes()
    yield from _fits()
    yield from _curved()
    yield from _located()
    yield from _of_sizes()
    yield from _turned()
    yield from _meshes()


def _boxes() -> Iterator[Scene]:
    one, two = body([box((0, 0, 0), (40, 30, 20))], (20, 15, 10)), body([box((40, 0, 0), (70, 30, 20))], (55, 15, 10))
    for name, scale, goal, motion in (
        ("both smaller", (0.98, 0.99), "touch", along(X)),
        ("both larger", (1.02, 1.01), "clear", along(X, Y, Z)),
        ("both larger", (1.02, 1.01), "clear", along(SLANTS[0], Z)),
        ("six parameters", (0.98, 0.99), "touch", FREE),
    ):
        yield scene(
            "drawn",
            "boxes face to face",
            f"{goal}, {name}, {_ways(motion)}",
            "aligned flush",
            one,
            two,
            scale,
            asked(one, motion, goal),
        )
    corner = body(
        [box((0, 0, -4), (60, 60, 0)), box((-4, 0, -4), (0, 60, 40)), box((0, -4, -4), (60, 0, 40))], (0, 0, 0)
    )
    block = body([box((0, 0, 0), (24, 18, 12))], (12, 9, 6))
    for scale, goal, motion in (((1.02, 1.0), "clear", along(X, Y, Z)), ((0.98, 1.01), "touch", along(X, Y, Z))):
        yield scene(
            "drawn",
            "block in a corner",
            f"{goal}, {scale[0]:g}, {_ways(motion)}",
            "aligned flush union",
            block,
            corner,
            scale,
            asked(block, motion, goal),
        )


def _ways(motion: Sequence[Scene]) -> str:
    return ", ".join(
        "six"
        if "free" in step
        else "turn"
        if "rotation" in step
        else "".join(name for name, axis in zip("xyz", (X, Y, Z), strict=True) if axis == step["translation"])
        or "slanted"
        for step in motion
    )


def _fits() -> Iterator[Scene]:
    questions = (
        ("lid", (1.01, 1.01), "clear", along(Z), None),
        ("lid", (0.99, 1.01), "touch", along(X, Z), None),
        ("lid", (1.02, 1.0), "clear", along(X, Y, Z), None),
        ("dovetail", (1.0, 1.02), "clear", along(X, Z), None),
        ("dovetail", (0.99, 1.0), "touch", along(Z), None),
        ("peg", (1.01, 1.0), "clear", along(X, Y), None),
        ("peg", (0.98, 1.0), "touch", along(X, Y), None),
        ("peg", (1.04, 1.0), "clear", along(X, Y), [[-5.0, 5.0], [-5.0, 5.0]]),
        ("key", (1.01, 0.98), "touch", along(X, Y), [[-4.0, 4.0], None]),
        ("tee", (0.99, 0.98), "touch", along(X, Z), None),
        ("ell", (1.01, 1.0), "clear", along(X, Z), None),
        ("ell", (0.99, 0.98), "touch", along(X, Y, Z), None),
    )
    for name, scale, goal, motion, limits in questions:
        one, two = (body(own.parts, own.seed) for own in PARTS[name])
        more = {"limits": limits} if limits else {}
        yield scene(
            "drawn",
            name,
            f"{goal}, {scale[0]:g} and {scale[1]:g}, {_ways(motion)}",
            "aligned flush union",
            one,
            two,
            scale,
            asked(one, motion, goal, **more),
        )
    pins = body(
        [box((-40, -20, -10), (40, 20, 0)), box((-21, -1.5, 0), (-18, 1.5, 12)), box((18, -1.5, 0), (21, 1.5, 12))],
        (0, 0, 0),
    )
    bars = [
        ((-30, -8), (30, -1.6)),
        ((-30, 1.6), (30, 8)),
        ((-30, -1.6), (-21.1, 1.6)),
        ((-17.9, -1.6), (17.9, 1.6)),
        ((21.1, -1.6), (30, 1.6)),
    ]
    plate = body([box((*low, 0), (*high, 5)) for low, high in bars], (0, 0, 2.5))
    for scale, goal, motion in (((1.004, 1.0), "clear", along(X, Y, Z)), ((0.99, 1.0), "touch", along(Z))):
        yield scene(
            "drawn",
            "plate on two pins",
            f"{goal}, {_ways(motion)}",
            "aligned flush union",
            plate,
            pins,
            scale,
            asked(plate, motion, goal),
        )
    shim = body([box((0, 0, 0), (30, 20, 0.02))], (15, 10, 0))
    table = body([box((-10, -10, -20), (50, 40, 0))], (0, 0, -20))
    yield scene(
        "drawn",
        "shim",
        "clear, a millimetre sheet of 0.02",
        "aligned flush",
        shim,
        table,
        (1, 1.001),
        asked(shim, along(X, Z), "clear"),
    )


def _curved() -> Iterator[Scene]:
    peg = body([prism(9.9 * polygon(16) + np.array([0.2, 0.1]), -5, 25)], (0.2, 0.1, 10))
    hole = body(ring(16, 10.0, 16.0, 0.0, 20.0), (0, 0, 10))
    for scale, goal in (((0.995, 1.0), "touch"), ((1.005, 0.999), "clear"), ((1.0, 0.985), "clear")):
        yield scene(
            "drawn",
            "round peg in its hole",
            f"{goal}, {scale[0]:g} and {scale[1]:g}",
            "curved union",
            peg,
            hole,
            scale,
            asked(peg, along(X, Y), goal, limits=[[-5.0, 5.0], [-5.0, 5.0]]),
        )
    ball = body([10 * geodesic() + np.array([0.3, 0.2, 14.0])], (0.3, 0.2, 14))
    inner, outer = 4 * polygon(12), 14 * polygon(12)
    dish = [
        np.vstack(
            [
                np.column_stack([own, np.full(2, z)])
                for own, z in ((inner[[k, j]], -2), (outer[[k, j]], -2), (inner[[k, j]], 0), (outer[[k, j]], 8))
            ]
        )
        for k, j in ((k, (k + 1) % 12) for k in range(12))
    ]
    for scale, goal, motion in (((0.98, 1.0), "touch", along(Z)), ((1.01, 1.02), "touch", along(X, Z))):
        yield scene(
            "drawn",
            "ball in a dish",
            f"{goal}, {_ways(motion)}",
            "curved mesh union",
            ball,
            body(dish, (0, 0, 0)),
            scale,
            asked(ball, motion, goal),
        )
    hook = body(tube(8, 1.5 * math.pi, 12.0, 2.5, 8), (0, 0, 0))
    bar = body([prism(2.0 * polygon(12), -20, 20)[:, [0, 2, 1]] + np.array([7.0, 0.0, 0.5])], (7.0, 0, 0.5))
    for goal, scale, motion in (
        ("touch", (1.0, 1.0), along(X)),
        ("touch", (0.97, 1.03), along(X, Z)),
        ("clear", (1.15, 1.3), along(X, Z)),
    ):
        yield scene(
            "drawn",
            "hook and bar",
            f"{goal}, {_ways(motion)}",
            "curved mesh union",
            hook,
            bar,
            scale,
            asked(hook, motion, goal),
        )


def _located() -> Iterator[Scene]:
    block = body([box((0, 0, 0), (60, 40, 20))], (30, 20, 10))
    tips = [
        ((10, 10, 0), 2, 1),
        ((50, 10, 0), 2, 1),
        ((30, 35, 0), 2, 1),
        ((12, 0, 10), 1, 1),
        ((48, 0, 11), 1, 1),
        ((0, 20, 9), 0, 1),
    ]
    parts = []
    for tip, axis, _ in tips:
        base = []
        for a, b in ((2, 0), (-1, 2), (-1.5, -2)):
            corner = list(map(float, tip))
            corner[axis] -= 5
            others = [k for k in range(3) if k != axis]
            corner[others[0]] += a
            corner[others[1]] += b
            base.append(corner)
        parts.append(np.array([list(map(float, tip)), *base]))
    locators = body(parts, (-20, -20, -20))
    every = [[0, k] for k in range(6)]
    for scale, motion, tags in (
        ((1.02, 0.98), FREE, "six"),
        ((0.99, 1.01), along(X, Y, Z), "x, y, z"),
        ((1.01, 1.01), [*along(X, Y, Z), about(Z)], "x, y, z, turn"),
    ):
        rise = [
            Fraction(str(scale[0] - 1)).limit_denominator(1000) * half
            + Fraction(str(scale[1] - 1)).limit_denominator(1000) * 20
            for half in (30, 20, 10)
        ]
        square = sum((x * x for x in rise), Fraction(0))
        angles = [0.0] * (3 if tags == "six" else 1 if "turn" in tags else 0)
        answer = exact(
            [float(x) for x in rise] + angles,
            square,
            "all faces stay parallel and go where they went: half the block's length times its share, and 20"
            " times the locators'; six contacts take all freedoms",
        )
        yield scene(
            "drawn",
            "block on six locators",
            f"locate, {tags}",
            "aligned contacts",
            block,
            locators,
            scale,
            asked(block, motion, "locate", pairs=every),
            answer=answer,
        )
    walls_ = body(
        [box((-5, -5, -5), (0, 60, 30)), box((0, -5, -5), (80, 0, 30)), box((0, 0, -5), (80, 60, 0))], (-5, -5, -5)
    )
    for scale, motion, pairs in (
        ((0.99, 1.02), along(X, Y, Z), [[0, 0], [0, 1], [0, 2]]),
        ((1.02, 1.0), along(X, Y, Z), [[0, 0], [0, 1], [0, 2]]),
    ):
        yield scene(
            "drawn",
            "block against three walls",
            f"locate, {scale[0]:g} and {scale[1]:g}",
            "aligned flush contacts union",
            block,
            walls_,
            scale,
            asked(block, motion, "locate", pairs=pairs),
        )
    vee = body(
        [
            np.array([[x, y, z] for x, z in ((-20, 0), (0, -20), (-20, -20)) for y in (-20, 20)]),
            np.array([[x, y, z] for x, z in ((20, 0), (0, -20), (20, -20)) for y in (-20, 20)]),
        ],
        (0, 0, -20),
    )
    bar = body(
        [np.array([[x, y, z] for x, z in ((0, -20), (12, -8), (0, 4), (-12, -8)) for y in (-30, 30)])], (0, 0, -8)
    )
    for scale in ((0.98, 1.01), (1.02, 1.0)):
        yield scene(
            "drawn",
            "bar in a vee",
            f"locate, {scale[0]:g} and {scale[1]:g}",
            "flush contacts union",
            bar,
            vee,
            scale,
            asked(bar, along(X, Z), "locate", pairs=[[0, 0], [0, 1]]),
        )


def _of_sizes() -> Iterator[Scene]:
    """Yield a key in a slot, and a stepped block, whose faces came out by hundredths: drawn, sizes, and as made."""
    key, slot = [box((-5, 12.125, 0), (5, 20, 30))], _slot(5.0625, 5.0625, 12.0)
    for name, made, motion, goal in (
        ("low foot, deep slot", {"width": -0.02, "foot": -0.01, "slot": 0.01, "depth": 0.04}, along(Y), "touch"),
        ("narrow slot", {"width": 0.08, "foot": 0.0, "slot": -0.04, "depth": 0.0}, along(X, Y), "touch"),
        ("wide key", {"width": 0.02, "foot": 0.15, "slot": -0.01, "depth": 0.0}, along(X, Y), "clear"),
    ):
        half = 5 + made["width"] / 2
        one = [box((-half, 12.125 - made["foot"], 0), (half, 20, 30))]
        wall = 5.0625 + made["slot"] / 2
        sizes = {
            "movable": body(key, (0, 0, 0))["parts"],
            "static": body(slot, (0, 0, 0))["parts"],
            "list": [
                _size("width", "movable", ["+x", "-x"], 0.5, made["width"], 0.1),
                _size("foot", "movable", ["-y"], 1.0, made["foot"], 0.2),
                _size(
                    "slot",
                    "static",
                    [{"through": [-5.0625, 16.0, 15.0]}, {"through": [5.0625, 16.0, 15.0]}],
                    -0.5,
                    made["slot"],
                    0.1,
                ),
                _size("depth", "static", [{"through": [0.0, 12.0, 15.0]}], -1.0, made["depth"], 0.1),
            ],
        }
        movable, static = body(one, (0, 16, 15)), body(_slot(wall, wall, 12.0 - made["depth"]), (0, 0, 15))
        yield scene(
            "drawn",
            "key in a slot, sizes per face",
            f"{goal}, {name}, {_ways(motion)}",
            "aligned sizes union",
            movable,
            static,
            (1, 1),
            asked(movable, motion, goal),
            sizes=sizes,
        )


def _slot(left: float, right: float, bottom: float) -> list[Any]:
    return [
        box((-20, 0, 0), (20, bottom, 30)),
        box((-20, bottom, 0), (-left, 18, 30)),
        box((right, bottom, 0), (20, 18, 30)),
    ]


def _size(name: str, role: str, faces: Any, each: float, value: float, tolerance: float) -> Scene:
    return {"name": name, "body": role, "faces": faces, "each": each, "made": value, "tolerance": tolerance}


def _turned() -> Iterator[Scene]:
    """Yield parts that turn: closed forms, and proved intervals."""
    cube, plate = body([box((-5, -5, -5), (5, 5, 5))], (0, 0, 0)), body([box((10, -20, -20), (15, 20, 20))], (15, 0, 0))
    swing = 0.5 * math.asin((10 / 8) ** 2 - 1)
    question = asked(cube, [about(Z)], "touch")
    yield scene(
        "drawn",
        "a block swings to a wall",
        "touch, turn",
        "aligned",
        cube,
        plate,
        (1.6, 1),
        question,
        answer=closed(question, [swing], "8 (cos t + sin t) = 10"),
    )
    question = asked(cube, [about(Z), *along(Y)], "touch")
    yield scene(
        "drawn",
        "a block swings to a wall",
        "touch, turn, y",
        "aligned",
        cube,
        plate,
        (1.6, 1),
        question,
        answer=closed(question, [swing, 0.0], "8 (cos t + sin t) = 10; y changes nothing"),
    )
    lever = body([box((-30, -2, -5), (0, 2, 5))], (0, 0, 0))
    stop = body([box((10, -40, -20), (30, -2, 20))], (10, -2, 0))
    question = asked(lever, [about(Z)], "touch", limits=[[-3.5, 0.0]])
    # half a turn about z maps the lever onto 0 <= x <= 30, its lower face y = -2 flush on the stop
    yield scene(
        "drawn",
        "a lever and its stop",
        "touch, half a turn",
        "aligned flush",
        lever,
        stop,
        (1, 1),
        {**question, "limits": [[0.0, 3.5]]},
    )
    one, two = gear(12, 18.0, 24.0, 0.0, 0.0, 6.0), gear(12, 18.0, 24.0, math.pi / 12, 0.0, 6.0)
    middle = np.array([43.0, 0.0, 0.0])
    wheels = body(one, (0, 0, 0)), body([own + middle for own in two], middle)
    for scale, motion in (((0.995, 0.995), [about(Z)]), ((0.99, 1.0), [about(Z)]), ((1.0, 0.995), along(X))):
        yield scene(
            "drawn",
            "gears",
            f"touch, {scale[0]:g}, {_ways(motion)}",
            "curved mesh union",
            *wheels,
            scale,
            asked(wheels[0], motion, "touch"),
        )
    cam = body([prism(polygon(36) * 10 + np.array([4.0, 0.0]), -3, 3)], (0, 0, 0))
    flat = body([box((-20, 11.5, -10), (20, 15, 10))], (0, 15, 0))
    for scale, motion in (((1.0, 1.0), [about(Z)]), ((1.02, 0.99), [about(Z), *along(Y)])):
        yield scene(
            "drawn",
            "cam and follower",
            f"touch, {_ways(motion)}",
            "curved mesh",
            cam,
            flat,
            scale,
            asked(cam, motion, "touch"),
        )
    arm, foot = box((0, -4, 0), (50, 4, 6)), box((0, -4, 6), (6, 4, 40))
    bracket = body([arm, foot], (3, 0, 3))
    step = body([box((-30, -20, -10), (80, 20, 0)), box((-30, -20, 0), (-0.2, 20, 30))], (-30, 0, -10))
    for scale, goal, motion in (
        ((1.01, 1.0), "clear", [*along(Z), about(Y)]),
        ((1.0, 0.995), "touch", [about(Y)]),
        ((1.005, 1.002), "clear", [*along(X, Z), about(Y)]),
    ):
        yield scene(
            "drawn",
            "bracket on a step",
            f"{goal}, {_ways(motion)}",
            "aligned flush union",
            bracket,
            step,
            scale,
            asked(bracket, motion, goal),
        )
    peg = body([box((-9.8, -9.8, -10), (9.8, 9.8, 20))], (0, 0, 5))
    plate4 = body(walls(10.0, 25.0, 0.0, 10.0), (0, 0, 5))
    yield scene(
        "drawn",
        "square peg, turned",
        "touch, turn",
        "aligned union",
        peg,
        plate4,
        (1, 1),
        asked(peg, [about(Z)], "touch"),
    )
    yield scene(
        "drawn",
        "square peg, turned",
        "touch, x, turn",
        "aligned union",
        peg,
        plate4,
        (1, 1),
        asked(peg, [*along(X), about(Z)], "touch"),
    )
    table = body([box((-30, -30, -10), (30, 30, 0))], (0, 0, -10))
    slab = body([box((-10, -8, 0.5), (10, 8, 6))], (0, 0, 3.25))
    yield scene("drawn", "slab above a table", "touch, six", "aligned", slab, table, (1, 1), asked(slab, FREE, "touch"))
    yield scene(
        "drawn",
        "slab above a table",
        "clear by 0.75, six",
        "aligned",
        slab,
        table,
        (1, 1),
        asked(slab, FREE, "clear", clearance=0.75),
    )


PANDA = {"from": "https://github.com/frankaemika/franka_ros", "licence": "Apache-2.0"}
TRIMESH = {"from": "https://github.com/mikedh/trimesh", "licence": "MIT"}


def _mesh(name: str, unit: float = 1.0) -> tuple[Any, Any]:
    """Return corners, to `DIGITS` places, and triangles of a mesh that others have made."""
    import trimesh

    found = trimesh.load_mesh(MESHES / name)
    return np.round(np.asarray(found.vertices, dtype=np.float64) * unit, DIGITS), np.asarray(found.faces)


def _cut(name: str) -> list[Any]:
    """Return the convex parts of a mesh of others: cut at its own corners, so that no coordinate is new."""
    import fcdm_opt as fo

    return [own.vertices for own in fo.Body.from_mesh(*_mesh(name), decomposition="exact").parts]


def _meshes() -> Iterator[Scene]:
    """Yield parts of `meshes`, of open licence: a robot's hand and the flange that bears it, a tube, a notched cube."""
    hand, flange = (np.unique(_mesh(name, 1000.0)[0], axis=0) for name in ("panda_hand.stl", "panda_flange.stl"))
    half, low = math.sqrt(0.5), body([flange], (0, 0, 0))
    placed = hand @ np.array([[half, half, 0], [-half, half, 0], [0, 0, 1]]).T  # as the robot carries it
    made: list[tuple[str, str, Scene, Scene, Any, Scene, Scene]] = []
    for lift, scale, goal, motion in (
        (107.0, (1.01, 1.0), "clear", along(Z)),
        (140.0, (0.99, 1.01), "touch", along(X, Z)),
        (140.0, (1.0, 1.0), "touch", [*along(Z), about(X)]),
    ):
        high = body([placed + np.array([0.0, 0.0, lift])], (0, 0, lift))
        tags = "curved mesh real"
        made.append(("robot hand on its flange", tags, high, low, scale, asked(high, motion, goal), PANDA))
    tube = body(_cut("tube.stl"), (0, 0, 30))
    pin = body([prism(2.1 * polygon(12) + np.array([0.05, 0.02]), -10, 70)], (0.05, 0.02, 30))
    question = asked(pin, along(X, Y), "touch", limits=[[-2.0, 2.0], [-2.0, 2.0]])
    made.append(("pin in a tube", "curved mesh real union", pin, tube, (0.99, 1.01), question, TRIMESH))
    notched, block = body(_cut("notched_cube.stl"), (-20, -20, -20)), body([box((0, 0, 0), (20, 20, 20))], (10, 10, 10))
    question = asked(block, along(X, Y, Z), "locate", pairs=[[0, 0], [0, 1], [0, 2]])
    tags = "aligned flush contacts mesh real union"
    made.append(("block in a notch", tags, block, notched, (0.99, 1.01), question, TRIMESH))
    for family, tags, one, two, scale, question, source in made:
        name = f"{question['goal']}, {_ways(question['motion'])}"
        yield scene("drawn", family, name, tags, one, two, scale, question, mesh=source)


# -------------------------------------------------------------------------------------------------------------- answers


def exact(motion: Sequence[float], square: Fraction, source: str) -> Scene:
    """Return an answer whose amount is the root of a rational."""
    root = _root(square)
    return {"amount": root, "lower": root, "amount_squared": str(square), "motion": list(motion), "source": source}


def closed(question: Scene, motion: Sequence[float], source: str) -> Scene:
    """Return an answer in closed form."""
    found = math.hypot(*(w * x for w, x in zip(question["weights"], motion, strict=True)))
    return {"amount": found, "lower": found, "motion": list(motion), "source": f"closed form: {source}"}


def _root(square: Fraction) -> float:
    """Return the square root of a rational, the nearest float but for one place."""
    shift = 2**200
    return float(Fraction(math.isqrt(int(square * shift * shift)), shift)) if square else 0.0


def answer(own: Scene) -> Scene | str:
    """Return the answer of a scene, or why it has none."""
    question = own["question"]
    if question["goal"] == "scale":
        (one,), (two,) = own["movable"]["parts"], own["static"]["parts"]
        found = shifts.contact_scale(one, two, (own["movable"]["seed"], own["static"]["seed"]), question["rho1"])
        return {"scale": float(found), "source": "rational: the largest root of all contact lines"}
    if all("translation" in step for step in question["motion"]) and not question.get("clearance"):
        ones, twos = (
            [shifts.made(part, own[role]["seed"], rho) for part in own[role]["parts"]]
            for role, rho in zip(("movable", "static"), own["scale"], strict=True)
        )
        axes = [step["translation"] for step in question["motion"]]
        least = shifts.least_shift(
            shifts.asked_of(ones, twos, axes, question["goal"], question.get("limits"), question.get("pairs"))
        )
        source = "rational: of all points where planes of overlapping shifts meet, the nearest that does what is asked"
        if least is None:
            return {"none": True, "source": source}
        return exact([float(x) for x in least.q], least.square, source)
    return _proved(own)


def _proved(own: Scene) -> Scene | str:
    import tempfile

    import fcdm_opt as fo
    from fcdm_opt_benchmarks.motions.least import Least, least_amount

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "scene.toml")
        path.write_text(loaded(DATASET / "answer_fcdm_opt.py").problem(own), "utf-8")
        (problem,) = fo.load_problems(path)
    solution = fo.solve(problem, certify=True)
    if not solution.usable:
        return f"{solution.status.name}: {solution.advice}"
    if solution.lower_bound < solution.amount * (1 - WIDEST):
        return f"gap {1 - solution.lower_bound / solution.amount:.2g}"
    found = {
        "amount": solution.amount,
        "lower": solution.lower_bound,
        "motion": list(solution.parameters.values()),
        "source": "proved by fcdm_opt: no motion is smaller than `lower`",
    }
    least = least_amount(problem)
    if isinstance(least, Least) and least.amount:
        found |= {
            "amount": least.amount,
            "lower": max(least.lower, solution.lower_bound),
            "source": f"enclosed in balls of 57 digits ({least.source}); no motion is smaller than `lower`",
        }
        found["lower"] = min(found["lower"], found["amount"])
    return found


def main() -> int:
    """Make the scenes with their answers, and write them."""
    given = argparse.ArgumentParser(description="Make the data set.")
    given.add_argument("--seed", type=int, default=1)
    given.add_argument("--out", type=Path, default=DATASET / "scenes.json")
    given.add_argument("--only", default="", help="scenes whose name holds this")
    options = given.parse_args()
    score, made = loaded(DATASET / "score.py"), []
    rng = np.random.default_rng(options.seed)
    for own in (*generic(rng), *drawn(rng)):
        if options.only not in own["name"]:
            continue
        found: Mapping[str, Any] | str = own["answer"] if "answer" in own else answer(own)
        if isinstance(found, str):
            print(f"left out: {own['name']}: {found}", file=sys.stderr)
            continue
        own["answer"] = dict(found)
        if "motion" in found:  # the answer does what is asked, by the scorer's own code
            missed = score.miss(own, found["motion"]) / score.size(own)
            assert missed <= 1e-9, (own["name"], missed)
        print(f"{own['name']}: {found.get('amount', found.get('scale', 'none'))}", file=sys.stderr)
        made.append(own)
    names = [own["name"] for own in made]
    assert len(set(names)) == len(names), [name for name in names if names.count(name) > 1]
    head = {"format": "fcdm-opt data set", "version": VERSION, "seed": options.seed}
    rows = ",\n".join(json.dumps(own) for own in made)
    options.out.write_text(f'{json.dumps(head)[:-1]}, "scenes": [\n{rows}\n]}}\n', "utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
