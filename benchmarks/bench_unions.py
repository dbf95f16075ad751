"""The whole diagram of two bodies of many parts, beside one distance query of coal on their undecomposed meshes.

    python benchmarks/bench_unions.py [--out DIR] [--seed 3] [--poses 12] [--rounds 7] [--largest PARTS]

Bodies are built and packed once; every pose is a diagram of its own. In every round coal's distance of a pose is timed
right before the diagram of that pose, each once untimed before: ratios compare what ran within the same milliseconds.
A family ends where one diagram takes longer than `--patience` seconds.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import fcdm_opt as fo
from fcdm_opt_benchmarks.union_pairs import FAMILIES, UnionPair
from report import describe, machine, table, versions

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from diagram_checks import BAND, HIGH, LOW, Drawing
from mesh_truth import ScaledMeshes, coal_surface, coal_triangles
from solids import Solid, solid_of

SIZES = (1, 2, 4, 8, 15, 30, 60, 120)
CALLS = 10  # of coal in a row: one is too short for the clock
TARGET_PARTS, TARGET_RATIO, TARGET_PRUNED = 60, 20.0, 0.95
CHECKED = 10  # scale pairs a pose at which the diagram is compared with the meshes


@dataclass(frozen=True)
class Row:
    """One pair of bodies: medians over poses and rounds, microseconds; means over the poses of what is counted."""

    family: str
    parts: int
    triangles: int
    curve: float
    coal: float
    ratio: float
    worst_pose: float
    segments: float
    pruned: float
    features_kept: float

    @property
    def met(self) -> str:
        """Whether what is asked of bodies of `TARGET_PARTS` parts is met."""
        if self.parts != TARGET_PARTS:
            return ""
        return "met" if self.ratio <= TARGET_RATIO and self.pruned >= TARGET_PRUNED else "NOT met"


def solids_of(pair: UnionPair) -> tuple[Solid, Solid]:
    """Both bodies as undecomposed meshes, seeds at 0."""
    made = (solid_of(parts, [], body.name) for parts, body in zip(pair.parts, pair.bodies, strict=True))
    one, two = (Solid(s.name, s.vertices, s.triangles, s.parts, np.zeros(3)) for s in made if s is not None)
    return one, two


def coal_query(surfaces: Sequence[Any], pose: Any) -> Callable[[], float]:
    """Coal's distance of the two meshes at its defaults, from Python; a result left uncleared would prune the next."""
    import coal

    (one, two), fixed, distance = surfaces, coal.Transform3s(), coal.distance
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


def timed(work: Callable[[], Any]) -> float:
    """Seconds of the second of two runs."""
    work()
    start = perf_counter()
    work()
    return perf_counter() - start


def measure(pair: UnionPair, solids: Sequence[Solid], family: str, rounds: int) -> Row:
    """Time one pair of bodies in all its poses."""
    count = len(pair.transforms)
    surfaces = [coal_surface(s.vertices, coal_triangles(s.triangles)) for s in solids]
    coal, own = np.empty((rounds, count)), np.empty((rounds, count))
    curves = [diagram(pair, T) for T in pair.transforms]
    queries = [coal_query(surfaces, pose) for pose in pair.poses]
    assert min(query() for query in queries) > 0
    for turn in range(rounds):
        for k, (query, T) in enumerate(zip(queries, pair.transforms, strict=True)):
            coal[turn, k] = timed(query) / CALLS
            own[turn, k] = timed(lambda T=T: diagram(pair, T))
    ratios = np.median(own / coal, axis=0)
    modelled = [curve.modelled for curve in curves]
    return Row(
        family,
        len(pair.bodies[0].parts),
        sum(len(solid.triangles) for solid in solids) // 2,
        float(1e6 * np.median(own)),
        float(1e6 * np.median(coal)),
        float(np.median(ratios)),
        float(ratios.max()),
        float(np.mean([len(curve.segments) for curve in curves])),
        1 - float(np.mean([m["part_pairs_kept"] / m["part_pairs_total"] for m in modelled])),
        float(np.mean([m["features_kept"] for m in modelled])),
    )


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


def exponents(rows: Sequence[Row]) -> tuple[list[str], float]:
    """Exponents of growth of the time with the parts of each body (2: as their pairs), step by step and in all."""
    powers = [np.log(q.curve / p.curve) / np.log(q.parts / p.parts) for p, q in pairwise(rows)]
    steps = [f"{p.parts} to {q.parts}: {power:.2f}" for (p, q), power in zip(pairwise(rows), powers, strict=True)]
    if len(rows) < 2:
        return steps, float("nan")
    slope = np.polyfit(np.log([row.parts for row in rows]), np.log([row.curve for row in rows]), 1)[0]
    return steps, float(slope)


def text(rows: Sequence[Row]) -> str:
    """Tell the results in Markdown."""
    asked = f"{TARGET_PARTS}: ratio {TARGET_RATIO:g}, {100 * TARGET_PRUNED:g} % pruned"
    head = ["family", "parts of each", "triangles", "diagram us", "coal us", "ratio", "worst pose", "segments"]
    lines = [
        [r.family, str(r.parts), str(r.triangles)]
        + [f"{x:.4g}" for x in (r.curve, r.coal, r.ratio, r.worst_pose, r.segments)]
        + [f"{100 * r.pruned:.2f} %", f"{r.features_kept:.4g}", r.met]
        for r in rows
    ]
    found = [describe(), table([*head, "pairs pruned", "features kept", asked], lines)]
    for family in dict.fromkeys(row.family for row in rows):
        steps, slope = exponents([row for row in rows if row.family == family])
        found.append(f"Exponent of growth with the parts, {family}: {slope:.2f} in all; {', '.join(steps)}.")
    return "\n\n".join(found)


def plot(rows: Sequence[Row], path: Path) -> None:
    """Draw time against parts, with a quadratic and coal's query for comparison."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 5.5), layout="constrained")
    for k, family in enumerate(dict.fromkeys(row.family for row in rows)):
        own = [row for row in rows if row.family == family]
        parts = np.array([row.parts for row in own])
        axes.loglog(parts, [row.curve for row in own], "s-", color=f"C{k}", ms=4, label=f"whole diagram, {family}")
        axes.loglog(parts, [row.coal for row in own], "o:", color=f"C{k}", ms=3, label=f"one coal distance, {family}")
    parts = np.array(sorted({row.parts for row in rows}))
    first = max(row.curve for row in rows if row.parts == parts[0])
    axes.loglog(parts, first * (parts / parts[0]) ** 2, "--", color="0.5", label="quadratic: all part pairs")
    axes.set(xlabel="convex parts of each body", ylabel="median time, microseconds")
    axes.set_xticks(parts, [str(n) for n in parts], minor=False)
    axes.minorticks_off()
    axes.grid(visible=True, alpha=0.4)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark from the command line; ends with 1 if a diagram is wrong or a target is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("out/unions"))
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--poses", type=int, default=12)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--largest", type=int, default=max(SIZES), help="most parts of a body")
    parser.add_argument("--patience", type=float, default=1.0, help="seconds a diagram; larger pairs are left out")
    parser.add_argument("--families", nargs="+", choices=list(FAMILIES), default=list(FAMILIES))
    given = parser.parse_args(arguments)
    rows: list[Row] = []
    compared = wrong = 0
    for family in given.families:
        for parts in (size for size in SIZES if size <= given.largest):
            pair = UnionPair.of(given.seed, family, parts, given.poses)
            diagram(pair, pair.transforms[0])  # packs the bodies
            if timed(lambda pair=pair: diagram(pair, pair.transforms[0])) > given.patience:
                print(f"{family}, {parts} parts: a diagram takes too long", file=sys.stderr)
                break
            solids = solids_of(pair)
            rows.append(measure(pair, solids, family, given.rounds))
            some, bad = check(pair, solids, np.random.default_rng([given.seed, parts]))
            compared, wrong = compared + some, wrong + bad
    told = f"{text(rows)}\n\nCompared with the meshes at {compared} scale pairs: {wrong} disagree."
    print(told)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "union-growth.md").write_text(told + "\n")
    data = {"seed": given.seed, "machine": machine(), "versions": versions(), "rows": [asdict(row) for row in rows]}
    (given.out / "union-growth.json").write_text(json.dumps(data, indent=1) + "\n")
    plot(rows, given.out / "union-growth.png")
    return 1 if wrong or any(row.met == "NOT met" for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
