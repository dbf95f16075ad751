"""The whole decision curve beside one distance query, and beside rival ways to the same curve; signs at touch.

    python benchmarks/bench_curve.py [--out DIR] [--seed N] [--largest VERTICES] [--rounds 40]

Before every round of every contender, coal's distance is timed on the same pair and poses. Everything that can be
prepared is prepared before: objects, requests, models, compiled kernels. Ends with 1 where a method traces another
curve than the exact one, or the sign of `gap` is wrong; see `signs`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fcdm_opt as fo
from fcdm_opt.curve import kernels
from fcdm_opt.show import new_figure, save
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.coal_shapes import coal_hull, coal_pose, coal_requests
from fcdm_opt_benchmarks.curves import METHODS
from fcdm_opt_benchmarks.pairs import BOX, SIZES, DrawnPair
from fcdm_opt_benchmarks.record import Row, table
from fcdm_opt_benchmarks.references import curve_error, exact_curve_in_box
from fcdm_opt_benchmarks.scripts import Work, beside, describe, parser, written
from signs import signs_at_touch

POSES = 500
TIGHT = 1e-12
BOTH = ("round", "long")
BISECTION, CLARABEL = "coal bisection", "Clarabel (cvxpy)"
STYLES = {"coal": (":", "o"), "curve": ("-", "s"), "rival": ("--", "^")}
NUMBERS = ("median", "least", "coal_median", "coal_least", "ratio", "ratio_of_least")


def coal_queries(drawn: DrawnPair, what: str = "distance", tolerance: float | None = None, one: bool = False) -> Work:
    """Ask coal from Python about the bodies as drawn, in many poses, or in `one` again and again.

    Of one pose all branches are predicted. The result is not cleared between calls: the bodies are apart, and what is
    returned is right all the same.
    """
    import coal

    (movable, static), fixed = (coal_hull(body.vertices) for body in drawn.pair), coal.Transform3s()
    poses = [coal_pose(T) for T in drawn.transforms(1 if one else POSES)] * (POSES if one else 1)
    request, ask = coal_requests(tolerance)[what == "collide"], getattr(coal, what)
    result = coal.DistanceResult() if what == "distance" else coal.CollisionResult()

    def work() -> None:
        for pose in poses:
            ask(movable, pose, static, fixed, request, result)

    if what == "distance":
        fresh = [ask(movable, pose, static, fixed, request, coal.DistanceResult()) for pose in poses]
        assert fresh == [ask(movable, pose, static, fixed, request, result) for pose in poses]
        assert min(fresh) > 0
    return work


def batch(drawn: DrawnPair, threads: int = 1, poses: int = POSES, repeats: int = 1) -> Work:
    """Ask for all curves in one call of `decision_curves`; of one pose all branches are predicted."""
    transforms = np.tile(drawn.transforms(poses), (repeats, 1, 1))
    return partial(fo.decision_curves, *drawn.pair, transforms, box=BOX, threads=threads)


def kernel_of_all_poses(drawn: DrawnPair) -> Work:
    """Call the compiled walk of all poses once: whole curves, proved and clipped, next to no Python."""
    one, two = (body.parts[0] for body in drawn.pair)
    seeds, limits = np.array([one.seed, two.seed]), np.array(BOX, dtype=np.float64).ravel()
    bounds = DEFAULT.planarity, DEFAULT.point, DEFAULT.sign
    return partial(kernels.walk_many, *one.packed, *two.packed, drawn.transforms(POSES), seeds, limits, *bounds)


def kernel(drawn: DrawnPair) -> Work:
    """Call the compiled walk of one pose, again and again: the whole curve, unclipped, and the call from Python."""
    (one, two), (T,) = (body.parts[0] for body in drawn.pair), drawn.transforms(1)
    walk, arguments = kernels.walk, (*one.packed, *two.packed, T, one.seed, two.seed, DEFAULT.planarity)
    assert walk(*arguments)[0] == kernels.WALKED

    def work() -> None:
        for _ in range(POSES):
            walk(*arguments)

    return work


def curve_object(drawn: DrawnPair, wanted: str) -> Work:
    """Ask for `decision_curve` from Python, and what is `wanted` of it, so that the curve has been computed."""
    transforms = drawn.transforms(50)

    def work() -> None:
        for T in transforms:
            getattr(fo.decision_curve(*drawn.pair, box=BOX, transform=T), wanted)

    return work


def rival(drawn: DrawnPair, name: str, count: int, setting: str | None = None) -> Work:
    """Answer by a method of `curves`, prepared once for the pair, at its finest setting unless one is named."""
    (method,) = (method for method in METHODS if method.name == name)
    value = method.settings[setting] if setting else list(method.settings.values())[-1]
    return partial(method.prepare(drawn.pair, value), [drawn.curve(k) for k in range(count)])


def _none(vertices: int) -> float | None:
    return None


class Contender(NamedTuple):
    """One line of the results: what is timed, curves (or answers of coal) in it, hulls, and the ratio asked for."""

    name: str
    kind: str
    prepare: Callable[[DrawnPair], Work]
    count: int = POSES
    sizes: tuple[int, ...] = SIZES
    shapes: tuple[str, ...] = ("round",)
    one_pose: bool = False
    asked: Callable[[int], float | None] = _none
    rounds: int | None = None


CONTENDERS = (
    Contender("coal distance", "coal", coal_queries, shapes=BOTH),
    Contender("coal distance, 1e-12", "coal", partial(coal_queries, tolerance=TIGHT)),
    Contender("coal collide", "coal", partial(coal_queries, what="collide")),
    Contender("coal collide, 1e-12", "coal", partial(coal_queries, what="collide", tolerance=TIGHT)),
    Contender("kernel", "curve", kernel_of_all_poses, shapes=BOTH, asked=lambda n: 0.5 if n <= 100 else 1.0),
    Contender("decision_curves, 1 thread", "curve", batch, shapes=BOTH),
    Contender("decision_curves, 1 thread, 50,000 poses", "curve", partial(batch, repeats=100), 100 * POSES, (12,)),
    Contender("decision_curves, 2 threads", "curve", partial(batch, threads=2, repeats=10), 10 * POSES),
    Contender("decision_curves, one pose", "curve", partial(batch, poses=1, repeats=POSES), one_pose=True),
    Contender("kernel, one pose a call", "curve", kernel, shapes=BOTH, one_pose=True),
    Contender("decision_curve", "curve", partial(curve_object, wanted="status"), 50,
              asked=lambda n: 15.0 if n == 12 else None),
    Contender("decision_curve, all segments", "curve", partial(curve_object, wanted="segments"), 50),
    Contender(BISECTION, "rival", partial(rival, name=BISECTION, count=4, setting="33 rays, 1e-12"), 4, rounds=8),
    *(Contender(name, "rival", partial(rival, name=name, count=4), 4, rounds=8)
      for name in ("coal distance + Newton", "growth distances", "HiGHS, warm")),
    Contender(CLARABEL, "rival", partial(rival, name=CLARABEL, count=1), 1, (8, 12, 20, 100), rounds=5),
)  # fmt: skip


def times(drawn: DrawnPair, rounds: int) -> list[Row]:
    """Time all contenders for a pair, microseconds a curve (or an answer of coal), coal's distance beside each."""
    rows = []
    calm = {one: coal_queries(drawn, one=one) for one in (False, True)}
    for own in CONTENDERS:
        if drawn.vertices not in own.sizes or drawn.shape not in own.shapes:
            continue
        seconds = beside(own.prepare(drawn), calm[own.one_pose], own.rounds or rounds)
        mine, coal = 1e6 * seconds[0] / own.count, 1e6 * seconds[1] / POSES
        ratio, least = float(np.median(mine / coal)), mine.min() / coal.min()
        numbers = (np.median(mine), mine.min(), np.median(coal), coal.min(), ratio, least)
        row = {"name": own.name, "kind": own.kind, "hulls": drawn.shape, "vertices": drawn.vertices}
        rows.append(row | dict(zip(NUMBERS, map(float, numbers), strict=True)) | {"asked": own.asked(drawn.vertices)})
    return rows


def other_curves(drawn: DrawnPair) -> list[str]:
    """Return which methods but the bisection give other breakpoints than the exact ones: all are timed on the same."""
    questions = [drawn.curve(k) for k in range(5)]
    references = [exact_curve_in_box(drawn.pair, question) for question in questions]
    timed = {own.name for own in CONTENDERS if own.kind == "rival" and drawn.vertices in own.sizes} - {BISECTION}
    wrong = []
    for method in METHODS:
        if method.ours or method.name in timed:
            answers = method.prepare(drawn.pair, list(method.settings.values())[-1])(questions)
            errors = [curve_error(answer, exact) for answer, exact in zip(answers, references, strict=True)]
            if not max(errors) <= (DEFAULT.snap if method.name == CLARABEL else DEFAULT.nominal):
                wrong.append(f"{method.name}, {drawn.vertices} vertices, {drawn.shape}: off by {max(errors):.2g}")
    return wrong


def text(rows: list[Row], segments: dict[str, dict[int, float]], signs: list[Row], wrong: list[str]) -> str:
    """Tell the results in Markdown."""
    lines = []
    for row in sorted(rows, key=lambda row: (row["kind"] != "coal", row["kind"] != "curve", row["name"])):
        target = row["asked"]
        asked = "" if target is None else f"{target:g}: {'met' if row['ratio'] <= target else 'NOT met'}"
        lines.append([row["name"], row["hulls"], str(row["vertices"]), *(f"{row[key]:.4g}" for key in NUMBERS), asked])
    head = ["", "hulls", "vertices", "median us", "least us", "coal median us", "coal least us"]
    parts = [describe(), table([*head, "ratio", "ratio of least", "asked"], lines)]
    for shape, means in segments.items():
        counts = ", ".join(f"{vertices}: {count:.1f}" for vertices, count in sorted(means.items()))
        parts.append(f"Mean number of segments in the box, {shape} hulls, by vertices: {counts}.")
        own = sorted((r["vertices"], r["median"]) for r in rows if (r["name"], r["hulls"]) == ("kernel", shape))
        steps = [f"{n} to {m}: {np.log(t / s) / np.log(m / n):.2f}" for (n, s), (m, t) in pairwise(own)]
        what = "Exponent of growth of `kernel` with the vertices (1: linear)"
        parts.append(f"{what}, {shape} hulls: {', '.join(steps) or 'not measured'}.")
    names = list(signs[0]["right"])
    shares = [[f"{100 * row['right'][name] / row['cases']:.4g} %" for name in names] for row in signs]
    cells = [
        [row["pairs"], f"{row['opening']:g}", str(row["cases"]), *own] for row, own in zip(signs, shares, strict=True)
    ]
    parts += ["Right signs at touch", table(["pairs", "relative opening", "cases", *names], cells)]
    return "\n\n".join([*parts, *(f"Another curve than the exact one: {line}" for line in wrong)])


def figure(rows: list[Row]) -> Any:
    """Draw time by vertices."""
    made = new_figure(9, 6)
    axes = made.subplots()
    for name, kind, shape in dict.fromkeys((row["name"], row["kind"], row["hulls"]) for row in rows):
        mine = sorted((row["vertices"], row["median"]) for row in rows if (row["name"], row["hulls"]) == (name, shape))
        line, marker = STYLES[kind]
        label = name if shape == "round" else f"{name}, {shape} hulls"
        axes.loglog(*zip(*mine, strict=True), line, marker=marker, markersize=4, label=label)
    axes.set(xlabel="vertices of each hull", ylabel="median time per curve (coal: per call), microseconds")
    axes.grid(visible=True, which="major", alpha=0.4)
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
    made.subplots_adjust(right=0.62)
    return made


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark from the command line."""
    options = parser(__doc__, "out/benchmarks", rounds=40)
    options.add_argument("--largest", type=int, default=max(SIZES), help="leave out larger pairs (%(default)s)")
    given = options.parse_args(arguments)
    rows, wrong = list[Row](), list[str]()
    segments: dict[str, dict[int, float]] = {shape: {} for shape in BOTH}
    for shape, vertices in [(shape, n) for shape in BOTH for n in SIZES if n <= given.largest]:
        drawn = DrawnPair.of(given.seed, vertices, shape)
        rows += times(drawn, given.rounds)
        curves = fo.decision_curves(*drawn.pair, drawn.transforms(POSES), box=BOX)
        segments[shape][vertices] = float(curves.counts.mean())
        wrong += other_curves(drawn)
    signs = signs_at_touch(np.random.default_rng([given.seed, 77]), 500)
    told = text(rows, segments, signs, wrong)
    written(told, given.out, "results", seed=given.seed, timings=rows, segments=segments, signs=signs)
    save(figure(rows), Path(given.out) / "time_per_curve")
    return 1 if wrong or any(row["right"]["gap"] < row["cases"] for row in signs) else 0


if __name__ == "__main__":
    sys.exit(main())
