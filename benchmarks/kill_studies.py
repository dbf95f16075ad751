"""Kills runs of a study at random moments, and checks that none of what they had stored is lost, or done again.

    python benchmarks/kill_studies.py --kills 100

Each run is a process with workers of its own, ended by SIGKILL: a third while it starts, a third at any moment, a third
near the end; every other time together with its workers, else alone, so that they must end by themselves. The folder
is then run again, and killed again, until a run comes through. Checked after each kill: the store can be read; no
worker is left. After the next run: every row is as it was, times included, and no point with a row was asked for. In
the end: the rows are those of a run that nobody disturbed, times apart.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import sqlite3
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import psutil

PROBLEMS = Path(__file__).parent.parent / "problems"
STORE, ASKED = "study.sqlite", "asked.txt"
PATIENCE = 10.0  # seconds after which a worker without a parent counts as left over


def run(folder: Path, points: int, jobs: int) -> None:
    """Run the study, and keep a list of the points that were asked for."""
    from fcdm_opt.design.study import running
    from fcdm_opt.design.study.point import Asked
    from fcdm_opt.design.study.study import Study

    class Noted(running.StudyRun):
        def asked(self) -> Iterator[Asked]:
            for point in super().asked():
                with (folder / ASKED).open("a") as file:
                    file.write(f"{point[0]}\n")
                yield point

    each = points // 4
    draws = [0.001 + 0.02 * k / each for k in range(each - 3)]
    values = {"tolerance": [*draws, 0.02, 0.02, 1.5], "goal": ["beyond", "touch"]}  # two alike, and one that is no size
    study = Study(PROBLEMS / "example1.toml", values, cases=["B", "D"])
    running.StudyRun = Noted  # type: ignore[misc]
    running.run_study(study, folder, jobs=jobs)


def rows(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the rows of a store, by key; none where there is no store yet."""
    if not (folder / STORE).exists():
        return {}
    base = sqlite3.connect(f"file:{folder / STORE}?mode=ro", uri=True)
    try:
        if not base.execute("SELECT 1 FROM sqlite_master WHERE name = 'results'").fetchone():
            return {}
        return {key: json.loads(row) for key, row in base.execute("SELECT key, row FROM results")}
    finally:
        base.close()


def points_of(folder: Path) -> list[Any]:
    """Return the table of points."""
    base = sqlite3.connect(folder / STORE)
    try:
        return base.execute('SELECT number, key, "values" FROM points ORDER BY number').fetchall()
    finally:
        base.close()


def timeless(found: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return rows without times."""
    return {key: {name: value for name, value in row.items() if name != "seconds"} for key, row in found.items()}


def start(folder: Path, points: int, jobs: int) -> subprocess.Popen[bytes]:
    """Start a run in a session of its own."""
    command = [sys.executable, __file__, "--run", str(folder), "--points", str(points), "--jobs", str(jobs)]
    with (folder / "errors.txt").open("ab") as errors:
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors, start_new_session=True)


def session(leader: int) -> list[int]:
    """Return the processes of a session that have not ended."""
    found = []
    for process in psutil.process_iter(["status"]):
        with suppress(OSError):
            if os.getsid(process.pid) == leader and process.info["status"] != psutil.STATUS_ZOMBIE:
                found.append(process.pid)
    return found


def kill(process: subprocess.Popen[bytes], *, together: bool) -> float:
    """Kill a run; gives the seconds until its workers are gone."""
    if together:
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()
    begun = monotonic()
    while left := session(process.pid):
        if monotonic() - begun > PATIENCE:
            raise AssertionError(f"workers are left after a kill: {left}")
        sleep(0.02)
    return monotonic() - begun


def wait_for(
    process: subprocess.Popen[bytes], folder: Path, kind: str, *, dice: random.Random, whole: float, count: int
) -> None:
    """Wait until it is time to kill, or the run is over."""
    if kind == "near the end":
        while process.poll() is None and len(rows(folder)) < 0.9 * count:
            sleep(0.02)
        span = 0.5
    else:
        span = 1.5 if kind == "while it starts" else 1.1 * whole
    end = monotonic() + dice.uniform(0.0, span)
    while process.poll() is None and monotonic() < end:
        sleep(0.002)


def main() -> None:
    """Run the check from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--points", type=int, default=1200, help="of the study (%(default)s)")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--run", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.run:
        run(given.run, given.points, given.jobs)
        return
    dice = random.Random(given.seed)
    told: Counter[str] = Counter()
    slowest, saved, finished = 0.0, 0, 0
    with tempfile.TemporaryDirectory() as place:
        calm = Path(place) / "calm"
        calm.mkdir()
        begun = monotonic()
        assert start(calm, given.points, given.jobs).wait() == 0, (calm / "errors.txt").read_text()
        whole = monotonic() - begun
        expected = timeless(rows(calm))
        assert len((calm / ASKED).read_text().split()) == len(expected), "a point was asked for twice"
        print(f"{len(expected)} rows in {whole:.1f} s: {dict(Counter(row['status'] for row in expected.values()))}")
        while told.total() < given.kills:
            folder = Path(place) / f"study{finished}"
            folder.mkdir()
            before: dict[str, dict[str, Any]] = {}
            while True:
                (folder / ASKED).unlink(missing_ok=True)
                process = start(folder, given.points, given.jobs)
                kind = dice.choice(["while it starts", "at any moment", "near the end"])
                if told.total() < given.kills:
                    wait_for(process, folder, kind, dice=dice, whole=whole, count=len(expected))
                killed = told.total() < given.kills and process.poll() is None
                if killed:
                    slowest = max(slowest, kill(process, together=dice.random() < 0.5))
                    told[kind] += 1
                else:
                    assert process.wait() == 0, (folder / "errors.txt").read_text()
                now = rows(folder)
                asked = (folder / ASKED).read_text().split() if (folder / ASKED).exists() else []
                assert all(now[key] == row for key, row in before.items()), "a stored row was lost or changed"
                assert not before.keys() & set(asked), "a stored point was asked for again"
                assert len(asked) == len(set(asked)), "a point was asked for twice"
                assert now.keys() <= before.keys() | set(asked), "a row from nowhere"
                before = now
                if not killed:
                    break
                saved += len(before)
            assert timeless(before) == expected, "the rows are not those of an undisturbed run"
            assert points_of(folder) == points_of(calm), "the points are not those of an undisturbed run"
            finished += 1
    kinds = ", ".join(f"{n} {kind}" for kind, n in told.items())
    print(f"{told.total()} kills ({kinds}), {finished} studies: all equal.")
    print(f"{saved / told.total():.0f} rows found after a kill on average; workers gone within {slowest:.2f} s.")


if __name__ == "__main__":
    main()
