"""Families of motion problems that differ in their bodies: unions, keep-outs, sizes, units, places; see `FAMILIES`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np

from fcdm_opt_benchmarks.shapes import random_rotation
from fcdm_opt_benchmarks.stability import scenes
from fcdm_opt_benchmarks.stability.drawn_parts import PARTS
from fcdm_opt_benchmarks.stability.scenes import CUBE, FREE, PLATE, RX, RY, RZ, SLANT, Plain, X, Y, Z

Truth = float | str | None
Members = Iterator[tuple[str, Plain, Truth]]
Family = tuple[Callable[[Any], Members], str]
NEAR = [[0.8, 1.2], [0.8, 1.2]]  # scales of ordinary parts
LITTLE = 5e-8  # what linear programming lets pass
SIGNS = {"A": (1, 1), "B": (1, -1), "C": (-1, 1), "D": (-1, -1)}


def unions(rng: Any) -> Members:
    """Put keys into slots, and part or join unions of boxes: the least shift is a corner of where they overlap."""
    key = scenes.box((-0.7, -1, -1), (0.7, 1, 1))
    motions = {"x": [X], "x, y": [X, Y], "x, y, turn": [X, Y, RZ]}
    for (name, motion), off, goal in product(motions.items(), (0.3, 1e-3, 1e-6), ("touch", "clear")):
        away = scenes.shifted(key, (off, 0, 0))
        yield f"snug, {goal}, {name}, off by {off:g}", scenes.problem(away, _slot(0.7), motion, goal=goal), off
    for name, motion in motions.items():
        away = scenes.shifted(key, (0.3, 0, 0))
        yield f"with play, {name}", scenes.problem(away, _slot(0.8), motion, goal="clear"), 0.2
    for name, motion, slot, amount in (
        ("short slot", [X, Y], _slot(0.7, 0.5), 1.7),
        ("x", [X], _slot(0.7), 9.84),
        ("long slot", [X, Y], _slot(0.7, 20.0), 9.84),
    ):
        yield f"too wide, {name}", scenes.problem(key, slot, motion, target=[1.2, 1.0]), amount
    yield from _boxes_by_lot(rng)


def _slot(half: float, deep: float = 3.0) -> Plain:
    """Return two walls, `half` either side of x = 0, reaching `deep` either side of y = 0."""
    left, right = scenes.box((-9, -deep, -9), (-half, deep, 9)), scenes.box((half, -deep, -9), (9, deep, 9))
    return scenes.union(left, right, seed=(0, 0, 0))


def _boxes_by_lot(rng: Any, count: int = 20) -> Members:
    """Yield unions of two boxes each, with sides on a grid and seeds off it: no two sides are flush."""
    for k in range(count):
        axes = ("x", "xy", "yz", "xyz")[k % 4]
        offset = rng.integers(-4, 5, 3)
        lows = [
            [rng.integers(-reach, reach + 1, 3) + shift for _ in range(2)]
            for reach, shift in ((2, 0.0), (3, offset + 0.25))
        ]
        sides = [[(low, low + rng.integers(1, 5, 3)) for low in own] for own in lows]
        seeds = np.array([0.31, 0.47, 0.59]), offset + np.array([0.13, 0.29, 0.41])
        rho = ((1.0, 1.0), (1.5, 0.75), (0.75, 1.25))[k % 3]
        one, two = (
            scenes.union(*(scenes.box(low.tolist(), high.tolist()) for low, high in own), seed=seed.tolist())
            for own, seed in zip(sides, seeds, strict=True)
        )
        made = [
            [tuple(seed + r * (side - seed) for side in ends) for ends in own]
            for own, seed, r in zip(sides, seeds, rho, strict=True)
        ]
        goal = ("touch", "clear")[k // 4 % 2]
        asked = scenes.problem(one, two, [scenes.translation(axis) for axis in axes], target=list(rho), goal=goal)
        least = _least_shift(made[0], made[1], ["xyz".index(axis) for axis in axes], goal)
        yield f"boxes {k}, {goal}, {axes}", asked, least


def _least_shift(ones: Any, twos: Any, axes: list[int], goal: str) -> float | None:
    """Return the least shift along some axes after which two unions of boxes touch (are clear); None: there is none.

    A pair overlaps for shifts in an open box. From outside all, the nearest point of the closed boxes is least; from
    inside, that of the complement, whose coordinates are 0 or a side's.
    """
    rest, places = [axis for axis in range(3) if axis not in axes], []
    for (low, high), (bottom, top) in product(ones, twos):
        start, stop = bottom - high, top - low
        if all(start[axis] < 0 < stop[axis] for axis in rest):
            places.append((start[axes], stop[axes]))

    def overlaps(shift: Any) -> bool:
        return any(bool(((low < shift) & (shift < high)).all()) for low, high in places)

    zero = np.zeros(len(axes))
    if not overlaps(zero):
        nearest = [float(np.linalg.norm(np.clip(zero, *ends))) for ends in places]
        return 0.0 if goal == "clear" else min(nearest, default=None)
    grid = product(*(sorted({0.0, *(side[k] for ends in places for side in ends)}) for k in range(len(axes))))
    return min(float(np.linalg.norm(shift)) for shift in grid if not overlaps(np.array(shift)))


def keep_outs(rng: Any) -> Members:
    """Get a cube off a block into a slot between keep-outs, just wide enough or just too narrow."""
    ways = {
        "y": ([Y], scenes.limits(TY=(-0.1, 4))),
        "x, y": ([X, Y], scenes.limits(TX=(-2, 2), TY=(-0.1, 4))),
        "y, z": ([Y, Z], scenes.limits(TY=(-0.1, 4), TZ=(-2, 2))),
        "y, turn": ([Y, RZ], scenes.limits(TY=(-0.1, 4), RZ=(-0.3, 0.3))),
    }
    block = scenes.about((0, 0, 0), 9, 2, 9)
    for (name, (motion, ends)), off in product(ways.items(), (LITTLE, -LITTLE, 1e-3, -1e-3, 0.2)):
        below = {**scenes.about((0, 2.2 - off / 2, 0), 9, 0.3, 9), "name": "below"}
        above = {**scenes.about((0, 4 + off / 2, 0), 9, 0.5, 9), "name": "above"}
        asked = scenes.problem(CUBE, block, motion, goal="clear", keep_out=[below, above], limits=ends)
        yield f"{name}, {off:g} to spare", asked, 3 - off / 2 if off > 0 else None
    cube, far = scenes.about((1.4, 0, 0), 0.25), scenes.about((9, 0, 0), 0.5)
    for most, amount in ((1.0, 0.35), (2.0, 0.85)):  # about x = 1, half its width 1/2
        rib = {**scenes.about((1.0, 0, 0), 0.5, 5, 5), "name": "rib", "scale": [1.0, most]}
        asked = scenes.problem(cube, far, [X], goal="clear", keep_out=[rib])
        yield f"off a rib at scales up to {most:g}", asked, amount


def extreme_weights(rng: Any) -> Members:
    """Minimise w^2 x^2 + t^2 with x + t / sqrt 2 = 1/2; the same onto a slant, x + y = 1; and a turn."""
    for w in (1e3, 1e-3, 1e6, 1e-6, 1e8, 1e-8):
        own = scenes.weights(TX=w)
        two_ways = scenes.problem(CUBE, PLATE, [X, scenes.translation([1, 1, 0])], weights=own)
        yield f"two ways, {w:g}", two_ways, 0.5 / math.sqrt(1 / w**2 + 0.5)
        yield f"slant, {w:g}", scenes.problem(CUBE, SLANT, [X, Y], weights=own), w / math.hypot(1, w)
        turn = scenes.problem(CUBE, PLATE, [RZ], target=[1.6, 1.0], weights=scenes.weights(RZ=w))
        yield f"turn, {w:g}", turn, w * scenes.swung(0.8)
    for w in (1e3, 1e6):
        own = scenes.weights(RZ=w)
        asked = scenes.problem(CUBE, PLATE, [X, RZ], weights=own, goal="clear", clearance=0.75)
        yield f"costly turns, {w:g}", asked, 0.25


def frames(factor: float, shift: Any) -> Iterator[tuple[str, Plain, float]]:
    """Yield a problem of each kind, all lengths times a factor, then shifted."""

    def place(body: Plain) -> Plain:
        return scenes.mapped(body, lambda p: [factor * x + s for x, s in zip(p, shift, strict=True)])

    cube, plate = place(CUBE), place(PLATE)
    swing = scenes.radius(CUBE) * factor * scenes.swung(0.8)
    yield "shift", scenes.problem(cube, plate, [X]), 0.5 * factor
    yield "turn", scenes.problem(cube, plate, [RZ], target=[1.6, 1.0]), swing
    yield "shift and turn", scenes.problem(cube, plate, [Y, RZ], target=[1.6, 1.0]), swing
    yield "clear", scenes.problem(cube, plate, [X, Y], goal="clear", clearance=0.75 * factor), 0.25 * factor
    one, two, far = (place(scenes.about(*own)) for own in (((0, 0, 0), 1), ((4, 5, 0), 1, 2, 1), ((5, 6, 0.5), 1)))
    yield "edges", scenes.problem(one, far, [X, Y, Z]), 5.0 * factor
    at = scenes.problem(one, two, [X, Y], nominal=[3.0, 1.0], target=[3.06, 0.98], goal="at")
    yield "at", at, math.hypot(0.04, 0.02) * factor


def units(rng: Any) -> Members:
    """Draw the same bodies in units from 1e-9 to 1e9."""
    for factor in (1e-6, 1e6, 1e-3, 1e3, 1e-9, 1e9):
        for name, asked, amount in frames(factor, (0.0, 0.0, 0.0)):
            yield f"{name}, times {factor:g}", asked, amount


def far_away(rng: Any) -> Members:
    """Draw the same bodies far from the origin: coordinates keep 16 digits in all."""
    for far in (1e3, 1e4, 1e5, 1e6):
        for name, asked, amount in frames(1.0, (far, -far / 2, far / 4)):
            yield f"{name}, {far:g} away", asked, amount


def turned_frames(rng: Any) -> Members:
    """Draw the same bodies and axes in a frame that is turned by lot: no face is along an axis."""
    for k in range(4):
        rows = random_rotation(rng)

        def seen(p: Any, rows: Any = rows) -> Any:
            return (rows @ np.asarray(p, dtype=float)).tolist()

        for name, asked, amount in frames(1.0, (0.0, 0.0, 0.0)):
            asked["case"][0]["length"] = scenes.radius(asked["bodies"]["movable"])
            yield f"{name}, frame {k}", scenes.placed(asked, seen, seen), amount


def seats(rng: Any) -> Members:
    """Keep a cube on a plate, face on face, while both are made to other scales."""
    flush = scenes.about((0.75, 0, 0), 0.25, 2, 2)
    motions = {"x": [X], "x, turn": [X, RZ], "turn, x": [RY, X], "x, y, turn": [X, Y, RZ], "free": [FREE]}
    for (name, motion), letter, tau in product(motions.items(), "AD", (0.02, 1e-6, 0.3)):
        one, two = SIGNS[letter]
        asked = scenes.problem(CUBE, flush, motion, goal="seat", nominal=[1.0, 1.0], tolerance=tau, requirement=letter)
        yield f"{name}, {letter}, {tau:g}", asked, abs(one * 0.5 + two * 0.25) * tau


def sizes(rng: Any) -> Members:
    """Bring a cube far smaller or larger than the plate to it, 1/2 its width away; or a needle."""
    for width in (1e-3, 1e3, 1e-5, 1e5, 1e-7, 1e7):
        cube = scenes.about((1 - width, 0, 0), width / 2)
        away = 1 - (1 - width) - width / 2  # half the width, as floats give it
        for name, motion in {"x": [X], "x, y": [X, Y], "x, y, z": [X, Y, Z]}.items():
            yield f"{name}, width {width:g}", scenes.problem(cube, PLATE, motion), away
        asked = scenes.problem(cube, PLATE, [X], goal="clear", clearance=width)
        yield f"clear, width {width:g}", asked, width - away
    for aspect in (1e4, 1e6, 1e8):
        thin = 0.5 / aspect
        across, ahead = scenes.about((0.5 - thin, 0, 0), thin, 0.5, thin), scenes.about((0, 0, 0), 0.5, thin, thin)
        yield f"needle across, 1 to {aspect:g}", scenes.problem(across, PLATE, [X]), 0.5
        yield f"needle ahead, 1 to {aspect:g}", scenes.problem(ahead, PLATE, [X, Y]), 0.5


def displacements(rng: Any) -> Members:
    """Make the largest displacement of a vertex least: it is the distance, by which a shift will do."""
    offsets = (3, 0, 1), (5, 6, 1), (5, -6, 0.5), (-5, 6, -7), (3, 3, 3), (0, -3, 0)
    ways = [*((own, "three", [X, Y, Z]) for own in offsets), *((own, "free", [FREE]) for own in offsets[:3])]
    for offset, name, motion in ways:
        away = math.hypot(*(max(abs(x) - 2.0, 0.0) for x in offset))
        asked = scenes.problem(scenes.about((0, 0, 0), 1), scenes.about(offset, 1), motion, amount="displacement")
        yield f"{name} to {offset}", asked, away


def as_drawn(rng: Any) -> Members:
    """Restore what ordinary parts rest on after both came out 1 % off; free them, and bring them to a wall."""
    tau, arms = 0.01, {"dovetail": (8, 4), "lid": (2, 10)}
    motions = {"z": [Z], "x, z": [X, Z], "x, y, z": [X, Y, Z], "z, tilts": [Z, RX, RY]}
    for letter, (one, two) in SIGNS.items():
        made: dict[str, Any] = {"nominal": [1.0, 1.0], "tolerance": tau, "requirement": letter, "box": NEAR}
        for (name, own), (kind, motion) in product(arms.items(), motions.items()):
            amount = abs(one * own[0] + two * own[1]) * tau
            yield f"{name} seated, {letter}, {kind}", _pair(name, motion, goal="seat", **made), amount
        yield f"key seated, {letter}", _pair("key", [X, Y], goal="seat", **made), abs(one * 6 + two * 12) * tau
        room = 10 * (1 + two * tau) - 9.75 * (1 + one * tau)
        at_wall = math.hypot(room - 0.25, max(0.0, 0.125 - room))
        yield f"peg at the wall, {letter}", _pair("peg", [X, Y], goal="at", **made), at_wall
    clear: tuple[tuple[str, str, Any, tuple[float, float], float | None], ...] = (
        ("rail made larger", "dovetail", [X, Z], (1.0, 1.02), 0.08),
        ("box made larger", "lid", [Z, RX, RY], (1.0, 1.01), 0.1),
        ("L made larger", "ell", [X, Z], (1.01, 1.0), math.hypot(0.02, 0.02)),
        ("step made larger", "ell", [X, Z], (1.0, 1.01), math.hypot(0.03, 0.06)),
        ("peg too wide", "peg", [X, Y], (1.03, 1.0), None),
    )
    for name, part, motion, target, least in clear:
        held = scenes.limits(TX=(-5, 5), TY=(-5, 5)) if least is None else None
        asked: dict[str, Any] = {"goal": "clear", "target": list(target), "box": NEAR}
        yield f"clear, {name}", _pair(part, motion, **asked, **({"limits": held} if held else {})), least
    yield "clear, dovetail with room", _pair("dovetail", [X, Z], goal="clear", clearance=0.25, box=NEAR), 0.25
    for name, part, motion, target, amount in (
        ("T down in its U", "tee", [X, Z], (0.99, 0.98), 0.18),
        ("T sideways in its U", "tee", [X], (0.99, 0.98), 0.96),
        ("L down on its step", "ell", [X, Z], (0.99, 0.99), 0.05),
    ):
        yield f"touch, {name}", _pair(part, motion, target=list(target), box=NEAR), amount


def _pair(name: str, motion: Any, **asked: Any) -> Plain:
    """Return the problem of two parts as drawn."""
    movable, static = (scenes.union(*map(scenes.convex, own.parts), seed=own.seed) for own in PARTS[name])
    return scenes.problem(movable, static, motion, **asked)


OF_BODIES: dict[str, Family] = {
    "parts as drawn": (as_drawn, "gaps of the faces, linear in scales and shifts"),
    "unions": (unions, "corners of the boxes of shifts that overlap"),
    "keep-outs": (keep_outs, "differences of coordinates"),
    "extreme weights": (extreme_weights, "a quadratic program in two variables"),
    "micrometres to kilometres": (units, "closed form times the factor"),
    "far from the origin": (far_away, "closed form, unchanged"),
    "turned frames": (turned_frames, "closed form, unchanged"),
    "flush contacts": (seats, "the line rho_1 / 2 + rho_2 / 4 = 3/4 - x, and no turn"),
    "bodies of unlike size": (sizes, "differences of coordinates"),
    "largest displacement": (displacements, "distance of boxes"),
}
