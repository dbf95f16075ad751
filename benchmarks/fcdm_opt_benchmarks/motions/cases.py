"""Random problems over all motions, goals and requirements, to compare methods on.

`draw`: convex pairs of 12 vertices, and small non-convex unions, with whatever a problem may ask. `chart_cases`: convex
pairs of 8 to 1000 vertices whose least amount is known. A case is drawn from its seed and place alone, so that any one
can be drawn again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np

import fcdm_opt as fo
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.motion.motions import Motion, Rotation, Screw, Translation
from fcdm_opt.solver import solve
from fcdm_opt_benchmarks import dataset
from fcdm_opt_benchmarks.motions.least import Least, least_amount
from fcdm_opt_benchmarks.pairs import DrawnPair, random_hull
from fcdm_opt_benchmarks.shapes import box, polygon, prism, random_directions, random_rotation

BOX = ((0.5, 2.5), (0.5, 2.5))
VERTICES = 12
KINDS = ("convex", "nonconvex")
TRACKED = ("beyond", "at")
GOALS = ("beyond", "beyond", "at", "touch", "clear", "seat")
TOLERANCES = (0.02, 0.005, 0.05, (0.01, 0.03), ((0.01, 0.03), (0.02, 0.005)))
ATTEMPTS = 200  # draws of bodies for one case


@dataclass(frozen=True, eq=False)
class DrawnCase:
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
    "free": lambda rng: fo.Free(),
}


# -------------------------------------------------------------------------------------------------------------- bodies


def _hull(rng: np.random.Generator) -> np.ndarray:
    return random_hull(rng, VERTICES) * rng.uniform(0.5, 1.3, 3) @ random_rotation(rng).T


def _shape(rng: np.random.Generator) -> list[np.ndarray]:
    """L, U, ring, or two to four overlapping hulls."""
    kind, thick = int(rng.integers(5)), float(rng.uniform(0.3, 0.5))
    sides = [
        box((-1, -1, -0.5), (1, -1 + thick, 0.5)),
        box((-1, -1, -0.5), (-1 + thick, 1, 0.5)),
        box((1 - thick, -1, -0.5), (1, 1, 0.5)),
        box((-1, 1 - thick, -0.5), (1, 1, 0.5)),
    ]
    if kind < 3:
        stretch = rng.uniform(0.7, 1.2, 3)
        return [part * stretch for part in sides[: 2 + kind]]
    sizes = rng.integers(5, 9, int(rng.integers(2, 5))).tolist()
    return [0.7 * rng.normal(size=(n, 3)) + 0.6 * (k > 0) * rng.normal(size=3) for k, n in enumerate(sizes)]


def _hexagon(rng: np.random.Generator, height: float) -> np.ndarray:
    """Prism of 12 vertices that stands on z = 0."""
    return prism(polygon(6, rng.uniform(0, 1)) * rng.uniform(0.6, 1.4, 2), 0.0, height)


def _bodies(rng: np.random.Generator, kind: str) -> tuple[fo.Body, fo.Body]:
    (away,) = random_directions(rng, 1) * rng.uniform(1.8, 3.5)
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
        parts[1].append(box((-0.3, -0.3, 0.2), (2.0, 0.3, 0.6)) + shift)
    R = random_rotation(rng)
    one, two = (fo.Body.from_parts([p @ R.T for p in own], seed=own[0].mean(axis=0) @ R.T) for own in parts)
    return one, two


# ---------------------------------------------------------------------------------------------------------------- cases


def draw(seed: int, kind: str, number: int) -> DrawnCase:
    """Draw a case."""
    rng = np.random.default_rng([seed, KINDS.index(kind), number])
    name = list(MOTIONS)[number % len(MOTIONS)]
    goal = str(rng.choice(GOALS))
    if goal == "seat" and name.startswith(("rotation", "screw")):
        goal = "touch"  # hardly any flush contact survives a single turn
    for _ in range(ATTEMPTS):
        motion = MOTIONS[name](rng)
        try:
            return DrawnCase(seed, kind, number, name, _problem(rng, kind, motion, goal))
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
    (way,) = random_directions(rng, 1)
    reach = float(np.abs((one.vertices - one.seed) @ way).max())
    centre = one.seed + way * (reach * rng.uniform(0.9, 1.3) + 0.25)
    corners = box((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2)) @ random_rotation(rng).T + centre
    clearance = float(rng.choice([0.0, 0.0, 0.01]))
    return fo.KeepOut(fo.Body.convex(corners, name="obstacle"), clearance=clearance)


# -------------------------------------------------------------------------------------------------------- for the chart


class Drawn(NamedTuple):
    """What is drawn for the chart: motion, goal, vertices of either body, shape, and separation of the parts made.

    "close": scales off a nominal contact by `CLOSE`; "apart": as drawn, by a tenth to the whole of the bodies.
    """

    motion: str
    goal: str
    vertices: int
    shape: str
    separation: str = "close"


CLOSE = 0.02
LETTERS = {"touch": "AD", "clear": "A", "beyond": "ABCD"}
# A single translation or screw leads more or less to the other body: others hardly ever reach it.
CHART_MOTIONS: dict[str, Callable[[np.random.Generator, Array], Motion]] = {
    "translation": lambda rng, way: Translation(_about(rng, way)),
    "rotation": lambda rng, way: Rotation(_about(rng, way)),
    "screw": lambda rng, way: Screw("seeds", 1.0),
    "translation, rotation": lambda rng, way: Translation(_about(rng, way)) >> Rotation(_about(rng, way)),
    "free screw": lambda rng, way: Screw("seeds"),
    "three translations": lambda rng, way: Translation("x") >> Translation("y") >> Translation("z"),
    "plane": lambda rng, way: MOTIONS["plane"](rng),
    "free": lambda rng, way: fo.Free(),
}
QUICK = (
    Drawn("translation", "touch", 12, "round", "apart"),
    Drawn("rotation", "touch", 8, "long"),
    Drawn("screw", "beyond", 12, "round"),
    Drawn("translation, rotation", "touch", 100, "long"),
    Drawn("three translations", "clear", 100, "round"),
    Drawn("free", "clear", 8, "long"),
    Drawn("three translations", "touch", 8, "aligned", "apart"),
)


@dataclass(frozen=True, eq=False)
class ChartCase:
    """A problem whose least amount is known.

    Attributes
    ----------
    name : str
    labels : mapping
        "motion", "parameters", "goal", "vertices", "shape", "separation", and "gap": how near the proved bound is to
        the amount, relative.
    problem : Problem
    least : Least
    """

    name: str
    labels: Mapping[str, Any]
    problem: fo.Problem
    least: Least

    def question(self, k: int) -> fo.Problem:
        """Return the problem made anew: only what belongs to the bodies is left, and their decision curve as drawn."""
        return self.problem.changed()


def chart_cases(quick: bool, seed: int) -> list[ChartCase]:
    """Return the problems of the chart, each solvable and with a reference."""
    hulls = [_charted(seed, drawn) for drawn in (QUICK if quick else dict.fromkeys((*QUICK, *_all())))]
    return [*hulls, *_of_dataset(quick)]


def _of_dataset(quick: bool) -> Iterator[ChartCase]:
    """Yield unions, curved meshes, sizes of faces and several contacts, from the data set; quick, one of a kind."""
    seen = set()
    for scene in dataset.scenes():
        kind, answer = dataset.kind(scene), scene["answer"]
        if kind == "general position" or not answer.get("amount") or (quick and kind in seen):
            continue
        problem = fo.Problem.from_dict(dataset.plain_problem(scene))
        if not solve(problem).usable:  # a motion that leaves the fit is none, however small
            continue
        seen.add(kind)
        parts = (*problem.movable.parts, *problem.static.parts)
        labels = {
            "motion": "of the data set",
            "parameters": len(problem.motion.parameters),
            "goal": scene["question"]["goal"],
            "vertices": sum(len(part.vertices) for part in parts) // 2,
            "shape": kind,
            "separation": "as made",
            "gap": max(1.0 - answer["lower"] / answer["amount"], 0.0),
        }
        least = Least(answer["amount"], answer["lower"], answer["source"])
        yield ChartCase(scene["name"], labels, problem, least)


def _all() -> Iterator[Drawn]:
    for motion in CHART_MOTIONS:
        for goal in LETTERS:
            if (motion, goal) == ("three translations", "beyond"):
                continue  # a linear program as "clear" is
            slow = motion in ("plane", "free") and goal == "beyond"
            for vertices, shape in ((12, "round"),) if motion == "plane" or slow else ((8, "long"), (100, "round")):
                yield Drawn(motion, goal, vertices, shape)
        if motion not in ("rotation", "plane"):
            yield Drawn(motion, "touch", 12, "long", "apart")
    for motion in ("translation", "three translations", "free"):
        for shape in ("round", "long"):
            yield Drawn(motion, "touch", 1000, shape)
        yield Drawn(motion, "clear", 1000, "long")
    yield Drawn("translation", "beyond", 1000, "long")
    yield from _aligned()


def _aligned() -> Iterator[Drawn]:
    """Yield what is asked of parts whose faces stay parallel: as many as of the others."""
    for motion, vertices in product(("translation", "three translations"), (8, 20, 48, 100, 200, 400, 1000)):
        for goal, separation in (("touch", "close"), ("clear", "close"), ("touch", "apart")):
            yield Drawn(motion, goal, vertices, "aligned", separation)
    for motion, goal in product(("rotation", "screw", "free screw"), ("touch", "clear")):
        yield Drawn(motion, goal, 8, "aligned")


def _charted(seed: int, drawn: Drawn) -> ChartCase:
    row = (list(CHART_MOTIONS).index(drawn.motion), list(LETTERS).index(drawn.goal), drawn.vertices, len(drawn.shape))
    rng = np.random.default_rng([seed, *row, len(drawn.separation)])
    for _ in range(ATTEMPTS):
        try:
            problem = _chart_problem(rng, drawn)
        except InputError:
            continue
        least = least_amount(problem)
        if not isinstance(least, Least) or least.amount == 0:
            continue  # no motion of this kind gets there, or none is needed, or what holds it has no proof
        labels = {"motion": drawn.motion, "parameters": len(problem.motion.parameters), **drawn._asdict()}
        name = f"{drawn.motion}, {drawn.goal}, {drawn.vertices} vertices, {drawn.shape}, {drawn.separation}"
        return ChartCase(name, labels | {"gap": max(1.0 - least.lower / least.amount, 0.0)}, problem.changed(), least)
    raise RuntimeError(f"nothing could be drawn for {seed}, {drawn}")


def _chart_problem(rng: np.random.Generator, drawn: Drawn) -> fo.Problem:
    pair = DrawnPair.of(int(rng.integers(2**31)), drawn.vertices, drawn.shape)
    bodies = (pair.pair.movable.moved(pair.contact(0).transform), pair.pair.static)
    one, two = (fo.Body.convex(body.vertices, seed=body.seed, name=body.name) for body in bodies)
    motion = CHART_MOTIONS[drawn.motion](rng, two.seed - one.seed)
    nominal: Any = "drawn"
    if drawn.separation == "close":
        curve = fo.decision_curve(one, two, box=pair.box.tolist())
        choices = curve.switching_points if drawn.goal == "beyond" else curve.segments
        if not choices:
            raise InputError("no such nominal contact in the box", key="box")
        nominal = k = int(rng.integers(len(choices)))
        if drawn.goal == "beyond":
            nominal = k + 1
        else:
            segment = curve.segments[k]
            nominal = tuple(segment.start + rng.uniform(0.1, 0.9) * (segment.end - segment.start))
    words: dict[str, Any] = {"goal": drawn.goal, "requirement": str(rng.choice(list(LETTERS[drawn.goal])))}
    return fo.Problem(one, two, nominal=nominal, motion=motion, box=pair.box, tolerance=CLOSE, **words)


def _about(rng: np.random.Generator, way: Array) -> tuple[float, float, float]:
    """Return a direction near a given one."""
    x, y, z = (way / np.linalg.norm(way) + 0.3 * rng.normal(size=3)).tolist()
    return x, y, z
