"""How time grows with the number of vertices, parts and parameters, and the exponents of that growth.

Table "growth", one row for each axis, number and method:

    axis        "vertices" of either hull, "parts" of either body, or "parameters" of the motion
    method, family, setting
    x           the number
    asked, failed
                answers, and how many of them are none
    seconds, low, high, rounds
                median and quartiles of the seconds an answer over the timed calls, and their number; null where the
                method was not asked
    reason      why it was not asked, or of the first failure

What an answer is: on "vertices" and "parts" a whole decision curve, in a pose of its own each; coal's, drawn beside it,
is a single distance, or whether the bodies collide. On "parameters" the smallest motion of hulls that overlap, ours
with its verification.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.geometry.arrays import frozen
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks import curves, motions
from fcdm_opt_benchmarks.coal_shapes import coal_hull, coal_pose, coal_requests, coal_surface
from fcdm_opt_benchmarks.cost.scenes import hull_pair, overlapping
from fcdm_opt_benchmarks.method import Ask, CurveQuestion, Failure, Method, Pair, one_by_one
from fcdm_opt_benchmarks.pairs import DrawnPair
from fcdm_opt_benchmarks.record import Row
from fcdm_opt_benchmarks.timing import TimedScene, Timing, TimingPlan, measured, warmed
from fcdm_opt_benchmarks.union_pairs import FAMILIES, UnionPair

Say = Callable[[str], None]
SHAPE = "long"  # of hulls: their curves have more segments the more vertices they have
PROBLEM_VERTICES = 12  # of the hulls that are moved
LEAST = 3  # numbers for a fit


@dataclass(frozen=True)
class _GrowthAxis:
    """One panel: its name, the scenes by number, who is asked, and how long."""

    name: str
    scenes: Mapping[int, Sequence[Callable[[], TimedScene]]]
    methods: Sequence[Method]
    plan: TimingPlan
    most: float  # seconds an answer beyond which a method is not asked about larger scenes


def growth(quick: bool, seed: int, progress: Say) -> list[Row]:
    """Return the table "growth".

    Parameters
    ----------
    quick : bool
        Few numbers and rounds, some seconds; else some minutes.
    seed : int
        Of bodies, poses and the order of methods.
    progress : callable
        Gets a line before each number.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for axis in (_vertices(quick, seed), _parts(quick, seed), _parameters(quick, seed)):
        slow: dict[str, str] = {}
        for turn, (x, makers) in enumerate(axis.scenes.items()):
            progress(f"growth: {x} {axis.name}")
            for scene in (maker() for maker in makers):
                asked = [method for method in axis.methods if method.refuses(scene.subject) is None]
                if turn < 2:  # single parts, and several
                    warmed([scene], asked)
                there = [method for method in asked if _key(scene, method) not in slow]
                found = measured(scene, there, axis.plan, rng, [])
                late = [Timing(method, "", slow[_key(scene, method)]) for method in asked if method not in there]
                rows += [_row(axis, x, scene, own) for own in (*found, *late)]
                for own in found:
                    if own.quartiles[1] > axis.most:
                        slow[_key(scene, own.method)] = f"took {own.quartiles[1]:.2g} s at {x} {axis.name}"
    return rows


def exponents(rows: Sequence[Row]) -> list[Row]:
    """Return the exponent of growth of each method on each axis.

    The slope of a least-squares line through log(seconds) over log(x), with its standard error; of three numbers and
    more, without those at which an answer failed.

    Returns
    -------
    list of dict
        With "axis", "method", "exponent", "error", "from", "to", "points" and "factor": the line is factor x^exponent.
    """
    from scipy.stats import linregress

    found = []
    for axis, method in dict.fromkeys((row["axis"], row["method"]) for row in rows):
        own = [row for row in rows if (row["axis"], row["method"]) == (axis, method) and row.get("seconds") is not None]
        own = [row for row in own if not row.get("failed")]
        if len({row["x"] for row in own}) < LEAST:
            continue
        x, y = np.log([row["x"] for row in own]), np.log([row["seconds"] for row in own])
        line = linregress(x, y)
        ends = min(row["x"] for row in own), max(row["x"] for row in own)
        found.append({"axis": axis, "method": method, "exponent": line.slope, "error": line.stderr, "from": ends[0],
                      "to": ends[1], "points": len(own), "factor": math.exp(line.intercept)})  # fmt: skip
    return found


def _row(axis: _GrowthAxis, x: int, scene: TimedScene, own: Timing) -> Row:
    row: Row = {"axis": axis.name, "method": _key(scene, own.method), "family": own.method.family, "x": x}
    if own.refused is not None:
        return {**row, "seconds": None, "reason": own.refused}
    failures = [answer.reason for answer in own.answers if isinstance(answer, Failure)]
    row |= {"setting": own.setting, "asked": len(own.answers), "failed": len(failures)}
    return {**row, "reason": failures[0] if failures else None, **own.times}


def _key(scene: TimedScene, method: Method) -> str:
    """Return a method's name, with the scene's family where there are several."""
    family = scene.labels.get("family")
    return f"{method.name}, {family}" if family else method.name


def _at(method: Method, setting: str) -> Method:
    """Return a method at one of its settings."""
    return replace(method, settings={setting: method.settings[setting]})


# ----------------------------------------------------------------------------------------------------------- vertices


def _vertices(quick: bool, seed: int) -> _GrowthAxis:
    sizes = (8, 32, 128) if quick else (8, 16, 32, 64, 128, 256, 512, 1000, 2000, 4000)
    plan = TimingPlan(3, 2e-3, 96, 0.4) if quick else TimingPlan(9, 5e-3, 256, 2.0)

    def scene(n: int) -> TimedScene:
        drawn = DrawnPair.of(seed, n, SHAPE)
        return TimedScene(f"{n} vertices", {}, drawn.pair, drawn.curve)

    by_name = {method.name: method for method in curves.METHODS}
    methods = (
        Method("compiled walk", "ours", {"doubles": None}, _walked),
        _at(by_name["decision_curves"], "doubles"),
        _at(by_name["decision_curve"], "doubles"),
        _at(by_name["exact path"], "rationals"),
        _at(by_name["HiGHS, warm"], "1e-10"),
        _at(by_name["coal bisection"], "33 rays, 1e-12"),
        Method("coal, one distance", "coal", {"default": None}, partial(_hulls_apart, "distance")),
        Method("coal, one collide", "coal", {"default": None}, partial(_hulls_apart, "collide")),
    )
    return _GrowthAxis("vertices", {n: [partial(scene, n)] for n in sizes}, methods, plan, 0.1 if quick else 0.5)


def _walked(pair: Pair, setting: None) -> Ask:
    """Call the compiled walk of all poses once: whole curves, proved and clipped, next to no Python."""
    one, two = (body.parts[0] for body in pair)
    packed, seeds = (*one.packed, *two.packed), np.array([one.seed, two.seed])
    bounds = DEFAULT.planarity, DEFAULT.point, DEFAULT.sign

    def ask(questions: Sequence[CurveQuestion]) -> list[int]:
        transforms = frozen([question.transform for question in questions])
        found = kernels.walk_many(*packed, transforms, seeds, np.array(questions[0].box).ravel(), *bounds)
        return list(found[1].tolist())

    return ask


def _hulls_apart(what: str, pair: Pair, setting: None) -> Ask:
    """Ask coal for the distance of two hulls in each pose, or whether they collide."""
    return _asked_of_coal(what, *(coal_hull(body.vertices) for body in pair))


def _asked_of_coal(what: str, one: Any, two: Any) -> Ask:
    import coal

    ask, fixed, request = getattr(coal, what), coal.Transform3s(), coal_requests()[what == "collide"]
    result = coal.DistanceResult() if what == "distance" else coal.CollisionResult()

    def answer(question: CurveQuestion) -> float:
        result.clear()  # or it prunes the next
        return float(ask(one, coal_pose(question.transform), two, fixed, request, result))

    return one_by_one(answer)


# -------------------------------------------------------------------------------------------------------------- parts


def _parts(quick: bool, seed: int) -> _GrowthAxis:
    counts = (2, 6, 18) if quick else (1, 2, 4, 8, 15, 30, 60, 120)
    families = ("spiky",) if quick else tuple(FAMILIES)
    plan = TimingPlan(3, 1e-3, 3, 0.3) if quick else TimingPlan(7, 4e-3, 4, 2.0)
    box = np.array(((0.8, 3.0), (0.8, 3.0)))

    def scene(count: int, family: str) -> TimedScene:
        pair = UnionPair.of(seed, family, count, plan.questions)

        def question(k: int) -> CurveQuestion:
            return CurveQuestion(pair.transforms[k].copy(), box)

        labels = {} if quick else {"family": family}
        return TimedScene(f"{count} parts, {family}", labels, Pair(*pair.bodies), question)

    scenes = {n: [partial(scene, n, own) for own in families] for n in counts}
    methods = (
        Method("decision curve", "ours", {"default": None}, _diagram),
        Method("coal, one distance", "coal", {"default": None}, _unions_apart),
    )
    return _GrowthAxis("parts", scenes, methods, plan, 0.5)


def _diagram(pair: Pair, setting: None) -> Ask:
    """Compute the whole diagram, as objects."""
    for body in pair:
        _ = body.packed

    def answer(question: CurveQuestion) -> int:
        return len(decision_curve(*pair, box=question.box.tolist(), transform=question.transform).segments)

    return one_by_one(answer)


def _unions_apart(pair: Pair, setting: None) -> Ask:
    """Ask coal for the distance of the bodies' surfaces in each pose."""
    return _asked_of_coal("distance", *(coal_surface(body) for body in pair))


# --------------------------------------------------------------------------------------------------------- parameters


def _parameters(quick: bool, seed: int) -> _GrowthAxis:
    counts = (1, 2, 3, 6) if quick else (1, 2, 3, 4, 5, 6)
    plan = TimingPlan(3, 1e-3, 1, 0.6) if quick else TimingPlan(15, 1e-2, 2, 4.0)
    by_name = {method.name: method for method in motions.METHODS}
    methods = [_at(by_name[name], motions.USUAL[name]) for name in ("fcdm_opt", "SLSQP", "IPOPT, full model")]

    def scene(count: int) -> TimedScene:
        def question(k: int) -> Any:
            return overlapping(*hull_pair(seed + k, PROBLEM_VERTICES), count)  # the same hulls for every count

        return TimedScene(f"{count} parameters", {}, None, question)

    return _GrowthAxis("parameters", {n: [partial(scene, n)] for n in counts}, methods, plan, 2.0)
