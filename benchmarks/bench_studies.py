"""Throughput of a study: points a second and core, and how much of the time is spent inside solve and verify.

    python benchmarks/bench_studies.py --points 10000 --rounds 3

Two-parameter points of an example of the paper, solved and verified, with one process and with two, in turns. Gives a
table in Markdown. "inside" is the time in `solve`, which verifies too, over wall time times processes: what is left is
questions, rows, store, sending and starting. CPU times are those of run and workers together; wall times tell only on
a machine that nobody else uses, which the last column says.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import sqlite3
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from fcdm_opt_benchmarks.record import Watch, machine, table

PROBLEMS = Path(__file__).parent.parent / "problems"
INSIDE = ("build", "solve", "prove", "verify")
CASES = {"example1": ("B", "C"), "example1_touch": ("B", "C")}
"""Cases with two parameters: file to names."""

LOW, HIGH = 0.001, 0.02  # tolerances


def run(name: str, points: int, jobs: int, seed: int) -> dict[str, Any]:
    """Run one study into a folder of its own, and return what it took; in a process of its own, see `apart`."""
    from fcdm_opt.design.study.running import run_study
    from fcdm_opt.design.study.study import Study

    cases = CASES[name]
    draws = np.random.default_rng(seed).uniform(LOW, HIGH, points // len(cases)).tolist()
    with tempfile.TemporaryDirectory() as folder:
        start = perf_counter()
        study = Study(PROBLEMS / f"{name}.toml", {"tolerance": draws}, cases=cases)
        run_study(study, folder, jobs=jobs)
        wall = perf_counter() - start
        with sqlite3.connect(Path(folder) / "study.sqlite") as base:
            rows = [json.loads(text) for (text,) in base.execute("SELECT row FROM results")]
        base.close()
    assert len(rows) == len(study)
    inside = sum(row["seconds"].get(key, 0.0) for row in rows for key in INSIDE)
    return {
        "points": len(rows),
        "usable": sum(row["usable"] for row in rows),
        "wall": wall,
        "inside": inside / (wall * jobs),
        "points_inside": inside / sum(row["seconds"]["point"] for row in rows),
    }


def apart(name: str, points: int, jobs: int, seed: int) -> dict[str, Any]:
    """Return what a study takes in a new process, with the CPU time of that and all that it started."""
    before, watch = resource.getrusage(resource.RUSAGE_CHILDREN), Watch()
    command = [sys.executable, __file__, "--one", name, str(points), str(jobs), str(seed)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    found: dict[str, Any] = json.loads(done.stdout)
    return {**found, "cpu": cpu, "others": watch.load().others}


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--points", type=int, default=10000, help="of each study (%(default)s)")
    parser.add_argument("--rounds", type=int, default=3, help="turns; the best of them counts (%(default)s)")
    parser.add_argument("--jobs", type=int, nargs="+", default=[1, 2], help="numbers of processes (%(default)s)")
    parser.add_argument("--study", nargs="+", default=list(CASES), choices=list(CASES))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        name, points, jobs, seed = given.one
        print(json.dumps(run(name, int(points), int(jobs), int(seed))))
        return
    lines = []
    for name in given.study:
        found: dict[int, list[dict[str, Any]]] = {jobs: [] for jobs in given.jobs}
        for _ in range(given.rounds):
            for jobs, rounds in found.items():
                rounds.append(apart(name, given.points, jobs, given.seed))
        one = min(own["wall"] for own in found[given.jobs[0]])
        for jobs, rounds in found.items():
            best = min(rounds, key=lambda own: own["wall"])
            others = statistics.median(own["others"] or 0.0 for own in rounds)
            lines.append(
                [
                    name,
                    str(jobs),
                    f"{best['points']}",
                    f"{best['usable']}",
                    f"{best['wall']:.2f}",
                    f"{best['points'] / best['wall'] / jobs:.0f}",
                    f"{best['points'] / min(own['cpu'] for own in rounds):.0f}",
                    f"{100 * best['inside']:.1f} %",
                    f"{100 * max(own['points_inside'] for own in rounds):.1f} %",
                    f"{one / best['wall']:.2f}",
                    f"{100 * others:.0f} %",
                ]
            )
    head = ["study", "processes", "points", "usable", "wall, s", "points a second and core", "points a CPU second"]
    head += ["inside solve and verify", "of the workers' time", "times one process", "other programs"]
    told = machine()
    print(f"{told['processor']}, {os.cpu_count()} cores; best of {given.rounds} turns, seed {given.seed}.\n")
    print(table(head, lines))


if __name__ == "__main__":
    main()
