"""Families of motion problems, each with its smallest motion in closed form, or known to have none.

A member is (name, problem as plain data, truth); a truth is an amount, None where no motion will do, or "refused"
where the question itself is bad. Lengths are those of the bodies, half a width or a whole one.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Any

from fcdm_opt_benchmarks.stability import scenes
from fcdm_opt_benchmarks.stability.dataset_families import OF_DATASET
from fcdm_opt_benchmarks.stability.motion_bodies import LITTLE, OF_BODIES, SIGNS, Family, Members
from fcdm_opt_benchmarks.stability.scenes import CUBE, FREE, LEVER, PLATE, RX, RY, RZ, SLANT, TIP, Plain, X, Y, Z

REFUSED = "refused"
ALONG_X, ALONG_Z = ((0, 0, 0), (1, 0, 0)), ((0, 0, 0), (0, 0, 1))
EVERY = {
    "translation": [scenes.translation([1, 2, -1])],
    "rotation": [RY],
    "screw": [scenes.screw(pitch=0.3)],
    "free screw": [scenes.screw()],
    "two translations": [X, Y],
    "translation, then rotation": [X, RZ],
    "three": [X, Y, RZ],
    "free": [FREE],
    "free, then screw": [FREE, scenes.screw()],
}


def already_met(rng: Any) -> Members:
    """Ask for what is so: the plate is 1/2 away; at scale 2 the cube's face lies on it."""
    for name, motion in EVERY.items():
        yield f"clear, {name}", scenes.problem(CUBE, PLATE, motion, goal="clear", clearance=0.5), 0.0
        yield f"touch, {name}", scenes.problem(CUBE, PLATE, motion, target=[2.0, 1.0]), 0.0


def only_a_turn(rng: Any) -> Members:
    """Bring a cube at 1.6 to a plate, which only a turn does; free a turned square in a slot."""
    t = scenes.swung(0.8)
    for name, motion in {"y": [Y], "z": [Z], "y, z": [Y, Z]}.items():
        yield f"plate, {name}", scenes.problem(CUBE, PLATE, motion, target=[1.6, 1.0]), None
    for name, motion in {"turn": [RZ], "y, turn": [Y, RZ], "z, turn": [Z, RY], "y, z, turn": [Y, Z, RZ]}.items():
        yield f"plate, {name}", scenes.problem(CUBE, PLATE, motion, target=[1.6, 1.0]), scenes.radius(CUBE) * t
    slot = scenes.union(scenes.box((-20, -9, -9), (20, -1, 9)), scenes.box((-20, 1, -9), (20, 9, 9)), seed=(0, 0, 0))
    asked: dict[str, Any]
    square, asked = scenes.turned(CUBE, math.pi / 4), {"target": [1.6, 1.0], "goal": "clear"}
    for motion, held in (([X], scenes.limits(TX=(-1, 1))), ([X, Z], scenes.limits(TX=(-1, 1), TZ=(-1, 1)))):
        yield f"slot, {len(motion)} shifts", scenes.problem(square, slot, motion, limits=held, **asked), None
    for name, motion in {"x, turn": [X, RZ], "three": [X, RZ, Z], "free": [FREE]}.items():
        held = scenes.limits(TX=(-1, 1))
        yield (
            f"slot, {name}",
            scenes.problem(square, slot, motion, limits=held, **asked),
            scenes.radius(square) * (math.pi / 4 - t),
        )


def beyond_coherence(rng: Any) -> Members:
    """Let a tip glide down a wall of slope 1/200 past a bump: the coherent range ends where the tip meets that."""
    for side, way in product((1, -1), ((0.02, "coherent"), (0.02, "free"), (0.002, "coherent"), (0.002, "free"))):
        tip = scenes.shifted(TIP, (0, side, 0))
        wall = scenes.union(
            scenes.box((1, -4, -4), (2, 4, 4)), scenes.box((0.9, -0.1, -0.1), (1.5, 0.1, 0.1)), seed=(1.5, 0, 0)
        )
        off, path = way
        asked = scenes.problem(tip, wall, [scenes.translation([-0.01, -2 * side, 0])], nominal=[2.0, 1.0],
                               target=[2 + off, 1.0],                        goal="at", path=path)  # fmt: skip
        truth = None if off > 0.01 and path == "coherent" else math.hypot(0.01, 2) * off / 0.02
        yield f"{path}, {off:g}, from y = {side}", asked, truth


def ball() -> Plain:
    """Return a regular icosahedron on the unit sphere about the seed: turned about it, no corner gets further than 1.

    Its inscribed ball has radius .79.
    """
    golden = (1 + math.sqrt(5)) / 2
    norm, corners = math.hypot(1, golden), []
    for a, b in product((1, -1), (golden, -golden)):
        corners += [(0, a / norm, b / norm), (a / norm, b / norm, 0), (b / norm, 0, a / norm)]
    return scenes.convex(corners, (0, 0, 0))


def never(rng: Any) -> Members:
    """Turn a ball about its centre: the plate is out of reach, or in the ball that is in it in any pose."""
    turns = {"z": [RZ], "slanted": [scenes.rotation([1, 2, 3])],
             "screw": [scenes.screw(((0, 0, 0), (1, 1, 0)), 0.0)], "two": [RX, RZ],
             "three": [RX, RY, RZ]}  # fmt: skip
    for (name, motion), (near, goal) in product(turns.items(), ((2.0, "touch"), (0.5, "clear"))):
        yield (
            f"{goal}, {name}",
            scenes.problem(ball(), scenes.about((near + 0.25, 0, 0), 0.25, 3, 3), motion, goal=goal),
            None,
        )
    yield "touch, short lever", scenes.problem(LEVER, scenes.about((1.5, 0, 0), 0.45, 4, 4), [RY, RZ]), None
    yield "touch, turn of a cube", scenes.problem(CUBE, PLATE, [RZ], target=[1.4, 1.0]), None
    held = scenes.limits(TX=(0, 0), TY=(0, 0), TZ=(0, 0))
    yield "touch, free", scenes.problem(ball(), scenes.about((2.25, 0, 0), 0.25, 3, 3), [FREE], limits=held), None


def at_an_event(rng: Any) -> Members:
    """Take a diamond out of a wall at 4/5, turns cheap: at 45 degrees it is flush, and another vertex takes over."""
    diamond, wall = scenes.turned(scenes.about((0, 0, 0), 1), math.pi / 4), scenes.about((1.8, 0, 0), 1, 5, 5)
    for weight, goal, (name, motion) in product(
        (0.1, 0.2, 0.3), ("touch", "clear"), {"x, turn": [X, RZ], "x, y, turn": [X, Y, RZ]}.items()
    ):
        asked = scenes.problem(diamond, wall, motion, goal=goal, weights=scenes.weights(RZ=weight))
        yield f"{goal}, {name}, turns at {weight:g}", asked, math.hypot(0.2, weight * math.pi / 4)


def two_optima(rng: Any) -> Members:
    """Swing the edge of the cube at 1.6 to x = 1, either way."""
    motions = {"z": [RZ], "y": [RY], "x, z": [X, RZ], "z, y": [RZ, Y], "y, shift": [RY, X]}
    for (name, motion), rho in product(motions.items(), (1.6, 1.9)):
        held = scenes.limits(**{"T" + step["translation"].upper(): (0, 0) for step in motion if "translation" in step})
        asked = scenes.problem(CUBE, PLATE, motion, target=[rho, 1.0], limits=held)
        yield f"{name} at {rho:g}", asked, scenes.radius(CUBE) * scenes.swung(rho / 2)


def half_turns(rng: Any) -> Members:
    """Swing a lever that points along -x, until its face comes down flush on the stop."""
    lever, stop = scenes.box((-3, -0.2, -0.5), (0, 0.2, 0.5), (0, 0, 0)), scenes.box((1, -4, -2), (3, -0.2, 2))
    motions = {"z": (RZ, "RZ", -1), "-z": (scenes.rotation("-z"), "R-Z", 1),
               "z, origin": (scenes.rotation("z", "origin"), "RZ", -1),
               "screw": (scenes.screw(ALONG_Z, 0.0), "screw_angle", -1),
               "screw, down": (scenes.screw(((0, 0, 7), (0, 0, -3)), 0.0), "screw_angle", 1)}  # fmt: skip
    for name, (step, parameter, sign) in motions.items():
        held = scenes.limits(**{parameter: sorted((0.0, 3.5 * sign))})
        yield name, scenes.problem(lever, stop, [step], limits=held), scenes.radius(lever) * math.pi


def pitches(rng: Any) -> Members:
    """Screw a tip on the axis to the plate, 1/2 away: it advances by the pitch."""
    length = scenes.radius(TIP)
    for pitch in (0.1, -0.1, 1.0, -3.0, 50.0, 1e-2, 1e3):
        asked = scenes.problem(TIP, PLATE, [scenes.screw(ALONG_X, pitch)])
        yield f"pitch {pitch:g}", asked, math.hypot(pitch, length) * 0.5 / abs(pitch)
    for word, line in product(("infinite", "-infinite", "free"), ("seeds", ALONG_X, ((7, -3, 2), (1, 0, 0)))):
        if word != "free" or line != ((7, -3, 2), (1, 0, 0)):  # a turn about a line beside it helps
            asked = scenes.problem(TIP, PLATE, [scenes.screw(line, word)])
            yield f"{word} pitch, axis {line if line == 'seeds' else line[0]}", asked, 0.5
    yield "pitch 0", scenes.problem(TIP, PLATE, [scenes.screw(ALONG_X, 0.0)]), None
    yield "pitch 0, seeds", scenes.problem(TIP, PLATE, [scenes.screw("seeds", 0.0)]), None


def coincident_seeds(rng: Any) -> Members:
    """Take the seeds for a screw's axis where they are at one place, or are brought there by an earlier step."""
    same = scenes.box((1.5, -0.5, -0.5), (2.5, 0.5, 0.5), (0, 0, 0))
    for name, motion in {"free": [scenes.screw()], "pitch": [scenes.screw(pitch=0.5)], "after x": [X, scenes.screw()],
                         "after free": [FREE, scenes.screw(pitch=0.0)]}.items():  # fmt: skip
        yield f"as drawn, {name}", scenes.problem(CUBE, same, motion), REFUSED
    yield "another axis", scenes.problem(CUBE, same, [scenes.screw(ALONG_X)]), 1.0
    yield (
        "another axis, pitch",
        scenes.problem(CUBE, same, [scenes.screw(ALONG_X, 2.0)]),
        math.hypot(2.0, scenes.radius(CUBE)) * 0.5,
    )
    wall = scenes.box((2, -2.5, -0.7), (3, 0.6, 0.5), (1, 0, 0))
    for low, high, amount in ((-9, 9, 0.75 * math.sqrt(2)), (0.9, 0.99, math.hypot(0.9, 0.6)),
                              (0.95, 1.05, math.hypot(0.95, 0.55)), (1.01, 1.2, math.hypot(1.01, 0.49)),
                              (0.999, 1.5, math.hypot(0.999, 0.501))):  # fmt: skip
        asked = scenes.problem(CUBE, wall, [X, scenes.screw()], limits=scenes.limits(TX=(low, high)))
        yield f"after x, within {low:g}, {high:g}", asked, amount


def crossing(**asked: Any) -> Plain:
    """Return two boxes whose lines, after a shift (x, y), are rho_1 + rho_2 = 4 - x and rho_1 + 2 rho_2 = 5 - y."""
    motion = asked.pop("motion", [X, Y])
    return scenes.problem(
        scenes.about((0, 0, 0), 1), scenes.about((4, 5, 0), 1, 2, 1), motion, nominal=[3.0, 1.0], **asked
    )


def tolerances(rng: Any) -> Members:
    """Go from no tolerance, where nothing is to be done, to all of a body, where there is none."""
    for letter, tau in product("ABCD", (0.02, 0.0, 1e-12, 0.5, 1.0, 1e-6)):
        off = [tau * nominal * sign for nominal, sign in zip((3, 1), SIGNS[letter], strict=True)]
        amount = math.hypot(off[0] + off[1], off[0] + 2 * off[1])
        asked = crossing(tolerance=tau, requirement=letter, goal="at")
        yield f"at, {letter}, {tau:g}", asked, REFUSED if tau == 1.0 else amount
    shifts = {"A": (0.08, 0.1), "B": (0.024, 0.012), "C": (0.024, 0.012), "D": (0.08, 0.1)}
    for letter, shift in shifts.items():
        asked = crossing(tolerance=0.02, requirement=letter, goal="beyond")
        yield f"beyond, {letter}, 0.02", asked, math.hypot(*shift)
    for state in ("clear", "touch"):
        asked = crossing(tolerance=0.02, requirement="B", goal="beyond", pair=state)
        yield f"beyond, B, 0.02, pair {state}", asked, 0.04


def both_signs(rng: Any) -> Members:
    """Shift a cube by its gap, or by its overlap, along every axis both ways; or turn it."""
    cube = scenes.about((0, 0, 0), 1)
    for axis, sign, side, goal in product("xyz", ("", "-"), (1, -1), ("touch", "clear")):
        away = scenes.about([4.0 * side * (axis == name) for name in "xyz"], 1)
        asked = scenes.problem(cube, away, [scenes.translation(sign + axis)], target=[1.5, 3.0], goal=goal)
        yield f"{goal}, {sign}{axis} at {side}", asked, 0.5
    for axis, sign, side in product("yz", ("", "-"), (1, -1)):
        asked = scenes.problem(
            CUBE, scenes.about((1.25 * side, 0, 0), 0.25, 2, 2), [scenes.rotation(sign + axis)], target=[1.6, 1.0]
        )
        yield f"turn about {sign}{axis} at {side}", asked, scenes.radius(CUBE) * scenes.swung(0.8)


def barely(rng: Any) -> Members:
    """End limits just before, or just behind, where the bodies meet."""
    for off in (LITTLE, -LITTLE, 1e-6, -1e-6):
        one = scenes.problem(CUBE, PLATE, [X], limits=scenes.limits(TX=(-1, 0.5 + off)))
        two = scenes.problem(CUBE, PLATE, [X, scenes.translation([1, 1, 0])],
                      limits=scenes.limits(TX=(-1, 0.3), T=(-1, (0.2 + off) * math.sqrt(2))))  # fmt: skip
        turn = scenes.problem(CUBE, PLATE, [X, RZ], limits=scenes.limits(TX=(-1, 0.5 + off), RZ=(0, 0)))
        swing = scenes.problem(
            CUBE, PLATE, [RZ], target=[1.6, 1.0], limits=scenes.limits(RZ=(0, scenes.swung(0.8) + off))
        )
        amounts = 0.5, math.hypot(0.3, 0.2 * math.sqrt(2)), 0.5, scenes.radius(CUBE) * scenes.swung(0.8)
        for name, asked, amount in zip(("x", "two", "x, turn", "turn"), (one, two, turn, swing), amounts, strict=True):
            yield f"{name}, {off:g} to spare", asked, amount if off > 0 else None


def many_roots(rng: Any) -> Members:
    """Bring a lever's tip to a wall of slope 5: at 2 atan 5, a turn on, and behind the wall at pi."""
    root, roots = 2 * math.atan(5), {"z": RZ, "-z": scenes.rotation("-z"), "screw": scenes.screw(ALONG_Z, 0.0)}
    for name, step in roots.items():
        yield name, scenes.problem(LEVER, scenes.ramp(5.0), [step], length=1.0), root
    for ends, amount in (((-40, 40), root), ((0, 40), root), ((3.2, 40), root + 2 * math.pi),
                         ((20, 40), root + 6 * math.pi), ((27, 40), root + 8 * math.pi),
                         ((-40, -3.2), 2 * math.pi - root),
                         ((-40, -20), 7 * math.pi), ((-3.1, 2.7), None), ((3.2, 9.0), None)):  # fmt: skip
        asked = scenes.problem(LEVER, scenes.ramp(5.0), [RZ], length=1.0, limits=scenes.limits(RZ=ends))
        yield f"z within {ends[0]:g}, {ends[1]:g}", asked, amount
    held = scenes.limits(TX=(0, 0), TY=(0, 0), TZ=(0, 0), RX=(0, 0), RY=(0, 0), RZ=(-40, 40))
    yield "free, held", scenes.problem(LEVER, scenes.ramp(5.0), [FREE], length=1.0, limits=held), root


def stationary(rng: Any) -> Members:
    """Close a gap that no turn changes at rest, by acos .9; or bring the tooth out."""
    amount = math.acos(0.9)
    pairs = {
        "claw": (scenes.CLAW, scenes.about((0.85, 0, 0), 0.05, 2, 2)),
        "tooth": (scenes.TOOTH, scenes.about((1.4, 0, 0), 0.5, 2, 2)),
    }
    motions = {"z": [RZ], "-z": [scenes.rotation("-z")], "x, z": [RX, RZ], "z, y": [RZ, Y]}
    for (name, motion), (pair, goal) in product(motions.items(), (("claw", "touch"), ("claw", "at"), ("tooth", "touch"),
                                                                  ("tooth", "clear"))):  # fmt: skip
        asked: dict[str, Any] = {"limits": scenes.limits(TY=(0, 0))} if Y in motion else {}
        if goal == "at":
            asked |= {"nominal": [0.9, 1.0]}
        yield f"{pair}, {goal}, {name}", scenes.problem(*pairs[pair], motion, goal=goal, length=1.0, **asked), amount


def corners(rng: Any) -> Members:
    """Bring a corner to a corner, or out of one; keep tips together, eight lines in one."""
    motions = {"three": [X, Y, Z], "free": [FREE], "six": [X, Y, Z, RX, RY, RZ]}
    for (name, motion), off in product(motions.items(), (1.0, 1e-3, 1e-6, 1e-7, 1e-8)):
        yield (
            f"to a corner, {name}, {off:g}",
            scenes.problem(CUBE, scenes.about([1 + off] * 3, 0.5), motion),
            math.sqrt(3) * off,
        )
    for (name, motion), off in product({"two": [X, Y], "three": [X, Y, Z]}.items(), (1e-3, 1e-6, 1e-7)):
        yield (
            f"out of a corner, {name}, {off:g}",
            scenes.problem(CUBE, scenes.about([1 - off] * 3, 0.5), motion, goal="clear"),
            off,
        )
    away = scenes.shifted(TIP, (1, 0, 0))
    for goal, letter, tau in product(("at", "touch", "clear"), "AD", (0.02, 1e-7)):
        asked = scenes.problem(TIP, away, [X], goal=goal, nominal=[1.0, 1.0], tolerance=tau, requirement=letter)
        yield f"tips, {goal}, {letter}, {tau:g}", asked, 0.0 if (goal, letter) == ("clear", "D") else tau


def slants(rng: Any) -> Members:
    """Minimise 2 x^2 + 4 y^2 with x + y = 1: y = x / 2 unless a limit binds."""
    for ends, x in (
        ({}, 2 / 3),
        ({"TX": (0, 9)}, 2 / 3),
        ({"TX": (-9, 2 / 3)}, 2 / 3),
        ({"TX": (2 / 3, 9)}, 2 / 3),
        ({"TX": (-9, 0.6)}, 0.6),
        ({"TX": (0.75, 9)}, 0.75),
        ({"TY": (-9, 0)}, 1.0),
        ({"TX": (1, 9)}, 1.0),
    ):
        asked = scenes.problem(
            CUBE, SLANT, [X, Y], weights=scenes.weights(TX=math.sqrt(2), TY=2.0), limits=scenes.limits(**ends)
        )
        yield f"{ends or 'no limits'}", asked, math.sqrt(2 * x * x + 4 * (1 - x) ** 2)


def rest_excluded(rng: Any) -> Members:
    """Exclude rest by limits: the least motion within them is from behind where that is all they leave."""
    for low, high, goal, clearance, amount in (
        (0.1, 9, "touch", 0, 0.5), (0.5, 0.5, "touch", 0, 0.5), (0.6, 9, "touch", 0, 2.0), (0.1, 9, "clear", 0, 0.1),
        (0.1, 9, "clear", 0.1, 0.1), (0.7, 9, "clear", 0, 2.0), (-9, -0.2, "clear", 0.6, 0.2),
        (0.6, 1.9, "touch", 0, None)
    ):  # fmt: skip
        asked = scenes.problem(
            CUBE, PLATE, [X], goal=goal, clearance=float(clearance), limits=scenes.limits(TX=(low, high))
        )
        yield f"{goal} {clearance:g}, x within {low:g}, {high:g}", asked, amount
    asked = scenes.problem(CUBE, PLATE, [X, Y], limits=scenes.limits(TX=(0.6, 9), TY=(-0.1, 0.1)))
    yield "touch, x within 0.6, 9, and y", asked, 2.0


FAMILIES: dict[str, Family] = {
    "requirement already met": (already_met, "nothing is to be done"),
    "only a rotation can": (
        only_a_turn,
        "rho (cos t + sin t) / 2 = 1 of a square; shifts along the face change no gap",
    ),
    "beyond the coherent range": (beyond_coherence, "the tip's line is rho_1 / 2 + rho_2 / 2 = 3/2 - x"),
    "infeasible at any motion": (never, "distances from the centre do not change"),
    "optimum at an event": (at_an_event, "at the kink, where turns cost less than they gain"),
    "two optima of equal amount": (two_optima, "rho (cos t + sin t) / 2 = 1"),
    "rotation by pi": (half_turns, "face on face after half a turn"),
    "screw pitch from zero to infinite": (pitches, "half a length is pitch times angle"),
    "coincident seeds": (coincident_seeds, "shifts along x that add up, clipped by limits"),
    "tolerance 0 to 100 %": (tolerances, "two lines linear in the shift"),
    "both signs of every axis": (both_signs, "gap along an axis; rho (cos t + sin t) / 2 = 1"),
    "feasible or not by next to nothing": (barely, "limits against the closed form"),
    "the nearest of many roots": (many_roots, "2 atan 5, pi, and whole turns more"),
    "stationary at rest": (stationary, "acos .9"),
    "vertex on vertex": (corners, "distance of the corners"),
    "quadratic programs": (slants, "a parabola along x + y = 1, clipped by the limits"),
    "limits without rest": (rest_excluded, "clipped by the limits, else past the plate"),
    **OF_BODIES,
    **OF_DATASET,
}
