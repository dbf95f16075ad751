"""Compare diagrams of random non-convex solids with coal on their undecomposed meshes, and with themselves.

    python benchmarks/compare_meshes.py SEED [COUNT] [--scale-pairs 50] [--processes 2] [--json FILE]

Pair k is drawn from (SEED, k) alone, so that a disagreement can be drawn again. Ends with 1 if anything disagrees, or
if more than 2 % of the scale pairs could not be compared.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from fcdm_opt_benchmarks.record import table
from fcdm_opt_benchmarks.scripts import chunks, describe, in_pieces

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from diagram_checks import BAND, Tally, check_drawing, compare_with_meshes, random_solid_pair

from fcdm_opt.curve.decision_curve import decision_curve

CHUNK = 5
SHOWN = 20  # disagreements that are printed
SKIPPED = 0.02  # largest share of scale pairs that are not compared, for any reason
NOT_COMPARED = ("in the band", "beside the curve's corners", "coal disagrees with itself")


def run(seed: int, numbers: range, scale_pairs: int) -> tuple[Tally, Counter[str]]:
    """Draw and compare some pairs; also the seconds that each step took."""
    tally, seconds = Tally(), Counter[str]()

    @contextmanager
    def timed(step: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            seconds[step] += time.perf_counter() - start

    for number in numbers:
        rng = np.random.default_rng([seed, number])
        with timed("drawing solids"):
            pair = random_solid_pair(rng, number)
        try:
            with timed("bodies from meshes"):
                one, two = pair.movable.body(), pair.static.body()
            with timed("curves"):
                curve = decision_curve(one, two, transform=pair.transform)
                tally.counts["switching points"] += len(curve.switching_points)
                tally.counts["part pairs"] += len(one.parts) * len(two.parts)
                tally.counts["parts as drawn"] += len(pair.movable.parts) + len(pair.static.parts)
                tally.counts["parts from meshes"] += len(one.parts) + len(two.parts)
            with timed("comparing"):
                given = decision_curve(pair.movable.union(), pair.static.union(), transform=pair.transform)
                tally.add(compare_with_meshes(pair, curve, rng, scale_pairs, [given]))
                tally.add(check_drawing(pair, curve, rng))
        except Exception:  # whatever it is, it is a disagreement, and the run goes on
            tally.wrong.append(f"{pair.name}: {traceback.format_exc(limit=-2)}")
    return tally, seconds


def report(tally: Tally, seed: int, seconds: Counter[str], whole: float) -> str:
    """Tell the results in Markdown."""
    count = max(1, tally.counts["scale pairs"])
    rows = [[name, f"{number:,}"] for name, number in sorted(tally.counts.items())]
    rows += [[f"{name}, share", f"{100 * tally.counts[name] / count:.3g} %"] for name in NOT_COMPARED]
    rows += [[f"worst: {name}", f"{value:.3g}"] for name, value in sorted(tally.worst.items())]
    pairs, scale_pairs = tally.counts["pairs"], tally.counts["scale pairs"]
    lines = [
        f"Seed {seed}: {pairs:,} pairs of non-convex solids, {scale_pairs:,} scale pairs, band {BAND:g} of the size, "
        f"in {whole:.0f} s. {describe()}",
        f"Disagreements: {len(tally.wrong)}",
        table(["", ""], rows),
        table(["", "seconds in all"], [[step, f"{value:.1f}"] for step, value in seconds.items()]),
        *[f"- {text}" for text in tally.wrong[:SHOWN]],
    ]
    return "\n\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the comparison from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("seed", type=int)
    parser.add_argument("count", type=int, nargs="?", default=200)
    parser.add_argument("--scale-pairs", type=int, default=50)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--json", type=Path, help="write all counts there")
    given = parser.parse_args(arguments)
    start = time.perf_counter()
    tally, seconds = Tally(), Counter[str]()
    pieces = [(given.seed, chunk, given.scale_pairs) for chunk in chunks(given.count, CHUNK)]
    for found, spent in in_pieces(run, pieces, given.processes):
        tally.add(found)
        seconds.update(spent)
    print(report(tally, given.seed, seconds, time.perf_counter() - start))
    if given.json is not None:
        given.json.write_text(json.dumps(vars(tally) | {"seconds": seconds}, indent=1) + "\n")
    compared = all(tally.share(name, "scale pairs") <= SKIPPED for name in NOT_COMPARED)
    return 0 if compared and not tally.wrong and tally.counts["pairs"] == given.count else 1


if __name__ == "__main__":
    sys.exit(main())
