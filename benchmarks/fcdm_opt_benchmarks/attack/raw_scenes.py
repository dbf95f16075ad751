"""Scenes of raw solids: surfaces as files have them, sizes in mm, several contacts, assemblies, round parts.

The least amount of each is a closed form, of intervals of shifts; that nothing overlaps is looked at on the raw solids.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from fcdm_opt_benchmarks.attack.motions import MotionStep, Steps
from fcdm_opt_benchmarks.attack.raw_solids import RawSolid, ball, block, prism
from fcdm_opt_benchmarks.shapes import Array
from fcdm_opt_benchmarks.step_files import revolved

X, Y, Z = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
TOLERANCES = (0.001, 0.002, 0.005, 0.01, 0.02)
EXACT = 1e-7  # of the size: what an amount may miss where the file's corners are exact
ROUNDING = 1e-12  # lengths: what sums of a scene's own numbers may be off
SINGLE = 2e-6  # of the size, where they are in single precision


@dataclass(frozen=True, eq=False)
class RawSize:
    """One size in mm: faces, each named by a point on it, that move outward by `each` a unit."""

    name: str
    part: str
    through: tuple[Any, ...]
    each: float
    most: float
    made: float


@dataclass(frozen=True, eq=False)
class RawScene:
    """One question, as plain data.

    Attributes
    ----------
    name : str
        "raw:family/number", from which it is drawn again.
    parts : dict of RawSolid
        As drawn: "movable" and "static", or those of an assembly, in which the last one is fixed.
    made : dict of RawSolid
        The same at the sizes made.
    steps : dict of Steps
        Of each part that moves, relative to the next one.
    kept : "mesh", "surface", "single" or "step"
        How the package is given them: as meshes, kept as surfaces, from binary STL, or from STEP files.
    scales : dict of float
    goal : str
    sizes : tuple of RawSize
    keep_out : tuple of RawSolid
    contacts : "all" or None
    limit : float or None
        Of each parameter, either way.
    least : float or None
        The least amount, None where none is known.
    possible : bool or None
        Whether there is a motion to use; None where nothing is known.
    slack : float
        Length that an amount and a motion may miss.
    files : dict of str
        Texts of STEP files.
    """

    name: str
    parts: Mapping[str, RawSolid]
    made: Mapping[str, RawSolid]
    steps: Mapping[str, Steps]
    goal: str
    kept: str = "mesh"
    scales: Mapping[str, float] = field(default_factory=dict)
    sizes: tuple[RawSize, ...] = ()
    keep_out: tuple[RawSolid, ...] = ()
    contacts: str | None = None
    limit: float | None = None
    least: float | None = None
    possible: bool | None = True
    slack: float = 0.0
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def family(self) -> str:
        """Kind and family."""
        return self.name.split("/")[0]

    def describe(self) -> str:
        """Return the question in words."""
        known = "unknown" if self.least is None else f"{self.least:.9g}"
        told = f"{self.name}: {self.kept}, goal {self.goal}, scales {dict(self.scales)}, least {known}"
        return told + f", possible {self.possible}" + "".join(f", {own.name} {own.made:+.6g}" for own in self.sizes)


def _scene(name: str, parts: Mapping[str, RawSolid], scales: Mapping[str, float], **more: Any) -> RawScene:
    """Return a scene of parts that are scaled, with the slack of what their corners can tell."""
    made = {part: own.scaled(scales.get(part, 1.0)) for part, own in parts.items()}
    size = max(float(np.abs(own.vertices).max()) for own in parts.values())
    slack = size * (SINGLE if more.get("kept") == "single" else EXACT)
    return RawScene(name, parts, made, scales=scales, **{"slack": slack, **more})


def _placed(scene: RawScene, rng: np.random.Generator) -> RawScene:
    """Return the scene turned and shifted as a whole, which changes no amount."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(rng.normal(size=3) * float(rng.choice([0.0, 0.3]))).as_matrix()
    T[:3, 3] = rng.normal(size=3) * float(rng.choice([0.0, 10.0]))
    sizes = tuple(
        replace(own, through=tuple(tuple((T[:3, :3] @ x + T[:3, 3]).tolist()) for x in map(np.array, own.through)))
        for own in scene.sizes
    )
    return replace(
        scene,
        parts={part: own.moved(T) for part, own in scene.parts.items()},
        made={part: own.moved(T) for part, own in scene.made.items()},
        steps={part: tuple(s.placed(T[:3, :3], T[:3, 3]) for s in own) for part, own in scene.steps.items()},
        keep_out=tuple(own.moved(T) for own in scene.keep_out),
        sizes=sizes,
    )


def _scales(rng: np.random.Generator) -> dict[str, float]:
    signs, tau = rng.choice([-1.0, 1.0], size=2), float(rng.choice(TOLERANCES))
    return {"movable": 1.0 + float(signs[0]) * tau, "static": 1.0 + float(signs[1]) * tau}


def _kept(rng: np.random.Generator) -> str:
    return str(rng.choice(["mesh", "surface", "single"]))


def _refined(solid: Any, kept: str, rng: np.random.Generator) -> Any:
    """Return a solid with its triangles cut up, where only the surface is kept: the same solid in more facets."""
    return solid.refine(int(rng.integers(1, 5))) if kept == "surface" else solid


def _two(one: Any, two: Any, seeds: Any, kept: str, rng: np.random.Generator) -> dict[str, RawSolid]:
    """Return the two parts of a scene."""
    solids = (_refined(own, kept, rng) for own in (one, two))
    return {part: RawSolid.of(own, seed) for part, own, seed in zip(("movable", "static"), solids, seeds, strict=True)}


def _translations(*axes: Any) -> Steps:
    return tuple(MotionStep("T", axis) for axis in axes)


def _answer(goal: str, low: Array, high: Array) -> tuple[float | None, bool]:
    """Return the least shift into [low, high], an interval each axis, or for "touch" onto its border; if there is one.

    For several axes of "touch" the nearest side of the box counts, which is right from inside alone.
    """
    if (low > high + ROUNDING).any():
        return None, False
    middle = (low + high) / 2.0  # of what fits without play one side may come out before the other
    low, high = np.minimum(low, middle), np.maximum(high, middle)
    into = np.asarray(np.clip(0.0, low, high))
    into[np.abs(into) <= ROUNDING] = 0.0
    if goal == "clear" or (into != 0.0).any():
        return float(np.linalg.norm(into)), True
    return float(min(-low.max(), high.min())), True


# ------------------------------------------------------------------------------------------------------------- families


def _peg(name: str, rng: np.random.Generator) -> RawScene:
    """Return a prism of 4 to 24 sides in its hole: the play in x is exact, and a thick one fits nowhere."""
    sides, play, kept = int(rng.choice([4, 8, 16, 24])), float(rng.choice([0.0, 0.01, 0.05])), _kept(rng)
    if kept != "surface":
        sides = min(sides, 8)
    peg, hole = prism(sides, 2.0 - play, -1.0, 3.0), prism(sides, 2.0, -1.0, 4.0)
    parts = _two(peg, block((-5, -5, 0), (5, 5, 2)) - hole, ((0, 0, 1), (0, 0, 1)), kept, rng)
    scales, goal = _scales(rng), str(rng.choice(["touch", "clear"]))
    room = 2.0 * scales["static"] - (2.0 - play) * scales["movable"]
    least, possible = _answer(goal, np.array([-room]), np.array([room]))
    steps = {"movable": _translations(X)}
    return _scene(name, parts, scales, steps=steps, goal=goal, kept=kept, least=least, possible=possible)


def _comb(name: str, rng: np.random.Generator) -> RawScene:
    """Return teeth in slots along x, seeds anywhere: each tooth leaves an interval, and their intersection is exact."""
    teeth, play, kept = int(rng.integers(2, 5)), float(rng.choice([0.0, 0.005, 0.02, 0.1])), _kept(rng)
    comb, rack = block((-1, -1, 2), (4 * teeth, 1, 4)), block((-3, -3, -2), (4 * teeth + 2, 3, 1.5))
    for k in range(teeth):
        comb += block((4 * k, -1, 0.2), (4 * k + 2, 1, 2))
        rack -= block((4 * k - play, -4, 0), (4 * k + 2 + play, 4, 2))
    seeds = [float(x) for x in rng.integers(-2, 4 * teeth, size=2)]
    parts = _two(comb, rack, [(x, 0.0, 2.0) for x in seeds], kept, rng)
    scales, goal = _scales(rng), str(rng.choice(["touch", "clear"]))
    starts = 4.0 * np.arange(teeth)
    sides = [seeds[0] + scales["movable"] * (edges - seeds[0]) for edges in (starts, starts + 2)]
    walls = [seeds[1] + scales["static"] * (edges - seeds[1]) for edges in (starts - play, starts + 2 + play)]
    low, high = np.max(walls[0] - sides[0]), np.min(walls[1] - sides[1])
    least, possible = _answer(goal, np.array([low]), np.array([high]))
    steps = {"movable": _translations(X)}
    return _scene(name, parts, scales, steps=steps, goal=goal, kept=kept, least=least, possible=possible)


def _grid(rng: np.random.Generator, halves: Any, holes: Any, places: Array) -> tuple[Any, Any]:
    """Return a plate with square pins under it, and one with square holes."""
    low, high = places.min(axis=0) - 3, places.max(axis=0) + 3
    pins, plate = block((*low, 1), (*high, 2)), block((*low, -2), (*high, 0.5))
    for (x, y), pin, hole in zip(places.tolist(), halves, holes, strict=True):
        pins += block((x - pin, y - pin, -1), (x + pin, y + pin, 1))
        plate -= block((x - hole, y - hole, -3), (x + hole, y + hole, 1))
    return pins, plate


def _places(rng: np.random.Generator) -> Array:
    rows, columns = int(rng.integers(1, 3)), int(rng.integers(1, 4))
    return np.array([(5.0 * i, 5.0 * j) for i in range(columns) for j in range(rows)])


def _pattern(name: str, rng: np.random.Generator) -> RawScene:
    """Return square pins in square holes, moved in x and y: a box of shifts."""
    kept, play, places = _kept(rng), float(rng.choice([0.0, 0.01, 0.05])), _places(rng)
    count = len(places)
    seeds = rng.integers(-3, 9, size=(2, 2)).astype(float)
    both = _grid(rng, [1.0 - play] * count, [1.0] * count, places)
    parts = _two(*both, [(*seed, 0.0) for seed in seeds.tolist()], kept, rng)
    scales = _scales(rng)
    one, two = (seed + rho * (places - seed) for seed, rho in zip(seeds, scales.values(), strict=True))
    room = scales["static"] - (1.0 - play) * scales["movable"]
    low, high = (two - one).max(axis=0) - room, (two - one).min(axis=0) + room
    above = 0.0 + scales["movable"] * 1.0 - scales["static"] * 0.5  # the plates do not meet
    least, possible = _answer("clear", low, high) if above > 0 else (None, None)
    steps = {"movable": _translations(X, Y)}
    return _scene(name, parts, scales, steps=steps, goal="clear", kept=kept, least=least, possible=possible)


def _sizes(name: str, rng: np.random.Generator) -> RawScene:
    """Return the same with sizes in mm: each pin's and each hole's width."""
    places, play = _places(rng), float(rng.choice([0.02, 0.05]))
    count = len(places)
    halves, holes = [1.0 - play] * count, [1.0] * count
    sizes: list[RawSize] = []
    pins, bores = list(halves), list(holes)
    for k, (x, y) in enumerate(places.tolist()):
        for part, half, each, own in (("movable", halves[k], 0.5, pins), ("static", holes[k], -0.5, bores)):
            through = tuple((x + a * half, y + b * half, -0.5) for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1)))
            made = round(float(rng.uniform(-0.06, 0.06)), 4)
            sizes.append(RawSize(f"{part} {k + 1}", part, through, each, 0.1, made))
            own[k] += abs(each) * made
    seeds = [(0.0, 0.0, 0.0)] * 2
    parts = {
        part: RawSolid.of(own, seed)
        for part, own, seed in zip(("movable", "static"), _grid(rng, halves, holes, places), seeds, strict=True)
    }
    resized = {
        part: RawSolid.of(own, seed)
        for part, own, seed in zip(("movable", "static"), _grid(rng, pins, bores, places), seeds, strict=True)
    }
    room = np.array(bores) - np.array(pins)
    goal, axes = (("clear", (X, Y)), ("touch", (X,)), ("clear", (X,)))[int(rng.integers(3))]
    low, high = np.full(2, (-room).max()), np.full(2, room.min())
    least, possible = _answer(goal, low[: len(axes)], high[: len(axes)])
    if (room < 0).any():
        least, possible = None, False
    scene = _scene(name, parts, {}, steps={"movable": _translations(*axes)}, goal=goal)
    return replace(scene, made=resized, sizes=tuple(sizes), least=least, possible=possible)


def _corner(name: str, rng: np.random.Generator) -> RawScene:
    """Return a block on one to three walls of a corner: all contacts are restored, each by its own shift."""
    walls = int(rng.integers(1, 4))
    corner = block((-4, -4, -1), (4, 4, 0))
    corner += block((-4, -4, -1), (-1, 4, 3)) if walls > 1 else block((-4, -4, -1), (-3, 4, 0))
    corner += block((-4, -4, -1), (4, -1, 3)) if walls > 2 else block((-4, -4, -1), (4, -3, 0))
    seeds = np.array([[*rng.choice([-1.0, 0.0, 1.0], size=2).tolist(), float(rng.choice([0, 1]))] for _ in range(2)])
    parts = {
        "movable": RawSolid.of(block((-1, -1, 0), (1, 1, 2)), seeds[0]),
        "static": RawSolid.of(corner, seeds[1]),
    }
    scales = _scales(rng)
    wall = np.array([-1.0, -1.0, 0.0])
    one, two = (seed + rho * (wall - seed) for seed, rho in zip(seeds, scales.values(), strict=True))
    shift = (two - one)[[2, 0, 1][:walls]]
    steps = {"movable": _translations(*(Z, X, Y)[:walls])}
    least = float(np.linalg.norm(shift))
    return _scene(name, parts, scales, steps=steps, goal="at", contacts="all", least=least)


def _tower(name: str, rng: np.random.Generator) -> RawScene:
    """Return blocks on one another, each on its own shift along z: an assembly of contacts that share nothing."""
    count = int(rng.integers(2, 5))
    parts, scales, low = {}, {}, 0.0
    for k in range(count):
        height = float(rng.integers(1, 4))
        last = k == 0
        seed = (0.0, 0.0, low + height * float(rng.choice([0.0, 0.5, 1.0])))
        parts[f"part {k}"] = RawSolid.of(block((-2, -2, low), (2, 2, low + height)), seed)
        scales[f"part {k}"] = 1.0 if last else 1.0 + float(rng.choice([-1, 1])) * float(rng.choice(TOLERANCES))
        low += height
    made = {part: own.scaled(scales[part]) for part, own in parts.items()}
    ends = {part: (float(own.vertices[:, 2].min()), float(own.vertices[:, 2].max())) for part, own in made.items()}
    order = list(parts)
    shifts = [ends[below][1] - ends[above][0] for below, above in pairwise(order)]
    steps = {part: _translations(Z) for part in reversed(order[1:])}
    parts = {part: parts[part] for part in reversed(order)}
    # relative to the part below, which carries it along
    return _scene(name, parts, scales, steps=steps, goal="at", least=float(np.linalg.norm(shifts)))


def _drawn_out(name: str, rng: np.random.Generator) -> RawScene:
    """Return a peg too thick for its hole, moved along z alone: drawing it out is no motion to use."""
    kept, goal, clear = _kept(rng), str(rng.choice(["touch", "clear"])), float(rng.choice([0.01, 0.05]))
    peg, hole = block((-1, -1, 0.5), (1, 1, 4)), block((-1 - clear, -1 - clear, -1), (1 + clear, 1 + clear, 3))
    plate = block((-5, -5, 0), (5, 5, 2)) - hole
    parts = _two(peg, plate, ((0, 0, 2.25), (0, 0, 1)), kept, rng)
    scales = {"movable": 1.0 + clear + float(rng.choice([0.01, 0.05])), "static": 1.0}
    if rng.random() < 0.5:
        parts = {"peg": parts["movable"], "plate": parts["static"]}
        scales = {"peg": scales["movable"], "plate": 1.0}
    one = next(iter(parts))
    return _scene(name, parts, scales, steps={one: _translations(Z)}, goal=goal, kept=kept, possible=False)


def _swallowed(name: str, rng: np.random.Generator) -> RawScene:
    """Return a cube in the middle of a solid that is kept as a surface, in any role: nothing near it frees it."""
    solid = ball(8.0, (0, 0, 0), int(rng.integers(2, 4))) if rng.random() < 0.5 else block((-6, -6, -6), (6, 6, 6))
    solid = solid.refine(int(rng.integers(2, 6))).translate((rng.uniform(-1, 1, 3) * 2).tolist())
    half = float(rng.choice([0.1, 0.5, 1.0]))
    cube = block((-half,) * 3, (half,) * 3)
    role = ("static", "movable", "keep-out", "third")[int(rng.integers(4))]
    scales = {"movable": 1.0, "static": 1.0}
    slab = block((-1, -1, -2.02), (1, 1, -half - 0.02))
    more: dict[str, Any] = {"steps": {"movable": _translations(Z)}, "goal": "clear", "kept": "surface"}
    more |= {"possible": False, "limit": 0.5}
    origin = (0.0, 0.0, 0.0)
    if role in ("static", "movable"):
        pair = (cube, solid) if role == "static" else (solid, cube)
        parts = {p: RawSolid.of(own, origin) for p, own in zip(("movable", "static"), pair, strict=True)}
        return _scene(name, parts, scales, **more)
    if role == "keep-out":
        parts = {"movable": RawSolid.of(cube, origin), "static": RawSolid.of(slab, (0, 0, -1.5))}
        return _scene(name, parts, scales, keep_out=(RawSolid.of(solid, origin),), **more)
    seeds = {"cube": (cube, origin), "slab": (slab, (0, 0, -1.5)), "solid": (solid, origin)}
    third = {part: RawSolid.of(*own) for part, own in seeds.items()}
    return _scene(name, third, {}, **{**more, "steps": {"cube": _translations(Z)}})


def _deep(name: str, rng: np.random.Generator) -> RawScene:
    """Return two blocks that overlap, kept as refined surfaces: what parts them is their depth, however refined."""
    depth = float(rng.choice([0.05, 0.5, 1.5]))
    lower, upper = block((-6, -6, -6), (6, 6, 0)), block((-2, -2, -depth), (2, 2, 5))
    parts = _two(upper, lower, ((0, 0, 2), (0, 0, -3)), "surface", rng)
    scales = _scales(rng)
    one, two = (2 + scales["movable"] * (-depth - 2)), (-3 + scales["static"] * 3)
    least = max(0.0, two - one)
    return _scene(name, parts, scales, steps={"movable": _translations(Z)}, goal="clear", kept="surface", least=least)


def _matched(name: str, rng: np.random.Generator) -> RawScene:
    """Return a plug line to line with its recess, too deep in it, in single precision: the walls are no overlap."""
    sides, depth = int(rng.choice([4, 8, 12])), float(rng.choice([0.1, 0.5, 1.0]))
    wall = float(rng.choice([3.0, 10.0, 17.3]))
    plug = prism(sides, wall, 4.0 - depth, 4.0 + wall)
    recess = block((-2 * wall, -2 * wall, 0), (2 * wall, 2 * wall, 8)) - prism(sides, wall, 4.0, 9.0)
    parts = _two(plug, recess, ((0, 0, 0), (0, 0, 0)), "single", rng)
    scales = {"movable": 1.0, "static": 1.0}
    return _scene(name, parts, scales, steps={"movable": _translations(Z)}, goal="clear", kept="single", least=depth)


def _round(name: str, rng: np.random.Generator) -> RawScene:
    """Return a shaft in its bore or a taper plug in its socket, from STEP: the amount is of the round faces."""
    frame, scales = np.eye(3), _scales(rng)
    one, two = scales["movable"], scales["static"]
    if rng.random() < 0.5:
        r, play = float(rng.choice([2.0, 5.0])), float(rng.choice([0.0, 0.02, 0.2]))
        profiles = [(0, 0), (r - play, 0), (r - play, 4), (0, 4)], [(r, -1), (9, -1), (9, 5), (r, 5)]
        angle = float(rng.choice([0.0, rng.uniform(0.0, 6.0)]))
        axis, goal = (float(np.cos(angle)), float(np.sin(angle)), 0.0), str(rng.choice(["touch", "clear"]))
        room = r * two - (r - play) * one
        least, possible = _answer(goal, np.array([-room]), np.array([room]))
    else:
        r, slope = float(rng.choice([3.0, 6.0])), float(rng.choice([0.05, 0.2, 0.5]))
        ends = [(0.0, 4.0), (-2.0, 6.0)]
        (a, b), (c, d) = ([r + slope * z for z in own] for own in ends)
        profiles = [(0, 0), (a, 0), (b, 4), (0, 4)], [(c, -2), (15, -2), (15, 6), (d, 6)]
        axis, goal, possible = Z, "touch", True
        least = abs(one - two) * r / slope
    files = {part: revolved(own, frame) for part, own in zip(("movable", "static"), profiles, strict=True)}
    nothing = RawSolid(np.zeros((0, 3)), np.zeros((0, 3), np.int64), np.zeros(3))
    told: dict[str, Any] = {"files": files, "least": least, "possible": possible, "slack": 1e-6}
    steps = {"movable": _translations(axis)}
    return RawScene(name, dict.fromkeys(files, nothing), {}, steps, goal, "step", scales, **told)


FAMILIES: dict[str, Callable[[str, np.random.Generator], RawScene]] = {
    "peg": _peg, "comb": _comb, "pattern": _pattern, "sizes": _sizes, "corner": _corner, "tower": _tower,
    "drawn out": _drawn_out, "swallowed": _swallowed, "deep": _deep, "matched": _matched,
    "round": _round,
}  # fmt: skip
"""By name: a function that draws a scene of this kind."""
TURNED = ("peg", "comb", "pattern", "corner", "drawn out", "deep", "matched", "tower", "sizes")


def raw_names(rounds: int) -> list[str]:
    """Return the names of a run; the families take turns."""
    return [f"raw:{family}/{number}" for number in range(rounds) for family in FAMILIES]


def raw_scene(name: str) -> RawScene:
    """Return the scene of a name."""
    family, number = name.removeprefix("raw:").rsplit("/", 1)
    rng = np.random.default_rng([zlib.crc32(f"raw:{family}".encode()), int(number)])
    scene = FAMILIES[family](name, rng)
    scene = _placed(scene, rng) if family in TURNED and rng.random() < 0.5 else scene
    if scene.kept != "single":
        return scene
    parts = {part: own.rounded() for part, own in scene.parts.items()}
    made = {part: own.scaled(scene.scales.get(part, 1.0)) for part, own in parts.items()}
    return replace(scene, parts=parts, made=made)
