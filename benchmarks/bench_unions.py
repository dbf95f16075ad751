"""The whole diagram of two bodies of many parts, beside one distance query of coal on their undecomposed meshes.

    python benchmarks/bench_unions.py [--out DIR] [--seed 3] [--poses 12] [--rounds 7] [--largest PARTS]

Bodies are built and packed once; every pose is a diagram of its own. In every round coal's distance of a pose is timed
right before the diagram of that pose. A family ends where one diagram takes longer than `--patience` seconds. Ends
with 1 if a diagram is wrong or a target is missed.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import fcdm_opt as fo
from fcdm_opt.show import new_figure, save
from fcdm_opt_benchmarks.coal_shapes import coal_pose
from fcdm_opt_benchmarks.cost.growth import exponents
from fcdm_opt_benchmarks.record import Row, table
from fcdm_opt_benchmarks.scripts import Work, beside, describe, parser, written
from fcdm_opt_benchmarks.timing import timed
from fcdm_opt_benchmarks.union_pairs import FAMILIES, UnionPair

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from diagram_checks import BAND, HIGH, LOW, Drawing
from mesh_truth import ScaledMeshes, coal_surface, coal_triangles
from solids import Solid, solid_of

SIZES = (1, 2, 4, 8, 15, 30, 60, 120)
CALLS = 10  # of coal in a row: one is too short for the clock
TARGET_PARTS, TARGET_RATIO, TARGET_PRUNED = 60, 20.0, 0.95
CHECKED = 10  # scale pairs a pose at which the diagram is compared with the meshes


def solids_of(pair: UnionPair) -> tuple[Solid, Solid]:
    """Both bodies as undecomposed meshes, seeds at 0."""
    made = (solid_of(parts, [], body.name) for parts, body in zip(pair.parts, pair.bodies, strict=True))
    one, two = (Solid(s.name, s.vertices, s.triangles, s.parts, np.zeros(3)) for s in made if s is not None)
    return one, two


def coal_query(surfaces: Sequence[Any], transform: np.ndarray) -> Work:
    """Coal's distance of the two meshes at its defaults, from Python; a result left uncleared would prune the next."""
    import coal

    (one, two), pose, fixed, distance = surfaces, coal_pose(transform), coal.Transform3s(), coal.distance
    request, result = coal.DistanceRequest(), coal.DistanceResult()

    def work() -> float:
        value = 0.0
        for _ in range(CALLS):
            result.clear()
            value = distance(one, pose, two, fixed, request, result)
        return value

    return work


def diagram(pair: UnionPair, T: np.ndarray) -> fo.DecisionCurve:
    """Compute the whole diagram, as objects."""
    curve = fo.decision_curve(*pair.bodies, transform=T)
    _ = curve.segments
    return curve


def measured(pair: UnionPair, solids: Sequence[Solid], family: str, rounds: int) -> Row:
    """Time one pair of bodies in all its poses: medians over poses and rounds, seconds; means of what is counted."""
    surfaces = [coal_surface(s.vertices, coal_triangles(s.triangles)) for s in solids]
    curves = [diagram(pair, T) for T in pair.transforms]
    queries = [coal_query(surfaces, T) for T in pair.transforms]
    assert min(query() for query in queries) > 0
    own, coal = np.array(
        [beside(partial(diagram, pair, T), query, rounds) for query, T in zip(queries, pair.transforms, strict=True)]
    ).transpose(1, 2, 0)
    ratios = np.median(own * CALLS / coal, axis=0)
    modelled = [curve.modelled for curve in curves]
    pruned = 1 - float(np.mean([m["part_pairs_kept"] / m["part_pairs_total"] for m in modelled]))
    parts, ratio = len(pair.bodies[0].parts), float(np.median(ratios))
    met = "met" if ratio <= TARGET_RATIO and pruned >= TARGET_PRUNED else "NOT met"
    return {
        "axis": "parts",
        "method": family,
        "x": parts,
        "triangles": sum(len(solid.triangles) for solid in solids) // 2,
        "seconds": float(np.median(own)),
        "coal": float(np.median(coal)) / CALLS,
        "ratio": ratio,
        "worst_pose": float(ratios.max()),
        "segments": float(np.mean([len(curve.segments) for curve in curves])),
        "pruned": pruned,
        "features": float(np.mean([m["features_kept"] for m in modelled])),
        "met": met if parts == TARGET_PARTS else "",
    }


def check(pair: UnionPair, solids: Sequence[Solid], rng: np.random.Generator) -> tuple[int, int]:
    """Compare what is timed with the meshes; return how many scale pairs were compared and how many disagree."""
    compared = wrong = 0
    for T in pair.transforms[:4]:
        curve, meshes = diagram(pair, T), ScaledMeshes(*solids, T)
        drawing = Drawing(curve)
        for rho in rng.uniform(LOW, HIGH, (CHECKED, 2)):
            if abs(gap := float(curve.gap(rho))) > BAND * rho.sum():
                compared += 1
                expected = -1 if meshes.verdict(rho).overlap else 1
                wrong += np.sign(gap) != expected or drawing.side(rho, rng) not in (0, expected)
    return compared, wrong


def text(rows: Sequence[Row]) -> str:
    """Tell the results in Markdown."""
    asked = f"{TARGET_PARTS}: ratio {TARGET_RATIO:g}, {100 * TARGET_PRUNED:g} % pruned"
    head = ["family", "parts of each", "triangles", "diagram us", "coal us", "ratio", "worst pose", "segments"]
    lines = [
        [r["method"], str(r["x"]), str(r["triangles"]), f"{1e6 * r['seconds']:.4g}", f"{1e6 * r['coal']:.4g}"]
        + [f"{r[key]:.4g}" for key in ("ratio", "worst_pose", "segments")]
        + [f"{100 * r['pruned']:.2f} %", f"{r['features']:.4g}", r["met"]]
        for r in rows
    ]
    told = [describe(), table([*head, "pairs pruned", "features kept", asked], lines)]
    for fit in exponents(rows):
        own = [row for row in rows if row["method"] == fit["method"]]
        steps = [f"{p['x']} to {q['x']}: {np.log(q['seconds'] / p['seconds']) / np.log(q['x'] / p['x']):.2f}"
                 for p, q in pairwise(own)]  # fmt: skip
        all_in = f"{fit['exponent']:.2f} in all; {', '.join(steps)}"
        told.append(f"Exponent of growth with the parts, {fit['method']}: {all_in}.")
    return "\n\n".join(told)


def figure(rows: Sequence[Row]) -> Any:
    """Draw time against parts, with a quadratic and coal's query for comparison."""
    made = new_figure(8, 5.5)
    axes = made.subplots()
    for k, family in enumerate(dict.fromkeys(row["method"] for row in rows)):
        own = [row for row in rows if row["method"] == family]
        parts, colour = np.array([row["x"] for row in own]), f"C{k}"
        for key, style, name in (("seconds", "s-", "whole diagram"), ("coal", "o:", "one coal distance")):
            times = [1e6 * row[key] for row in own]
            axes.loglog(parts, times, style, color=colour, markersize=4, label=f"{name}, {family}")
    parts = np.array(sorted({row["x"] for row in rows}))
    first = 1e6 * max(row["seconds"] for row in rows if row["x"] == parts[0])
    axes.loglog(parts, first * (parts / parts[0]) ** 2, "--", color="0.5", label="quadratic: all part pairs")
    axes.set(xlabel="convex parts of each body", ylabel="median time, microseconds")
    axes.set_xticks(parts, [str(n) for n in parts], minor=False)
    axes.minorticks_off()
    axes.grid(visible=True, alpha=0.4)
    axes.legend(fontsize=8)
    return made


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark from the command line."""
    options = parser(__doc__, "out/unions")
    options.add_argument("--poses", type=int, default=12)
    options.add_argument("--largest", type=int, default=max(SIZES), help="most parts of a body")
    options.add_argument("--patience", type=float, default=1.0, help="seconds a diagram; larger pairs are left out")
    options.add_argument("--families", nargs="+", choices=list(FAMILIES), default=list(FAMILIES))
    given = options.parse_args(arguments)
    rows, compared, wrong = list[Row](), 0, 0
    for family in given.families:
        for parts in (size for size in SIZES if size <= given.largest):
            pair = UnionPair.of(given.seed, family, parts, given.poses)
            diagram(pair, pair.transforms[0])  # packs the bodies
            if timed(diagram, pair, pair.transforms[0])[0] > given.patience:
                print(f"{family}, {parts} parts: a diagram takes too long", file=sys.stderr)
                break
            solids = solids_of(pair)
            rows.append(measured(pair, solids, family, given.rounds))
            some, bad = check(pair, solids, np.random.default_rng([given.seed, parts]))
            compared, wrong = compared + some, wrong + bad
    told = f"{text(rows)}\n\nCompared with the meshes at {compared} scale pairs: {wrong} disagree."
    written(told, given.out, "union-growth", seed=given.seed, rows=rows)
    save(figure(rows), Path(given.out) / "union-growth")
    return 1 if wrong or any(row["met"] == "NOT met" for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
