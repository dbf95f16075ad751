"""Attack the package on ordinary parts, with oracles that share nothing with it.

    python benchmarks/attack_fits.py [--quick] [--rounds 60] [--jobs 2] [--json FILE]
    python benchmarks/attack_fits.py --replay "fit:lid/17"

Each scene is drawn from its name alone: `--replay NAME` asks it again and tells everything. Ends with 3 if an answer is
wrong, not least within what is proved, refuted, or missing. Notes are counted and are no failures.
"""

from __future__ import annotations

import argparse
import json
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

from fcdm_opt_benchmarks.attack.raw_scenes import RawScene, raw_names, raw_scene
from fcdm_opt_benchmarks.attack.raw_verdicts import raw_verdicts
from fcdm_opt_benchmarks.attack.scenes import CHEAP, FitScene
from fcdm_opt_benchmarks.attack.scenes import drawn as fit_scene
from fcdm_opt_benchmarks.attack.scenes import names as fit_names
from fcdm_opt_benchmarks.attack.verdicts import FAILURES, NOTES, failed, verdicts
from fcdm_opt_benchmarks.record import table
from fcdm_opt_benchmarks.scripts import chunks, in_pieces

CHUNK = 6
ROUNDS, QUICK = 60, 3
RAW = 3  # raw scenes of each family a round of a full run
QUICK_RAW = 2  # of each family in a quick one


class SceneOutcome(NamedTuple):
    """One scene's outcome."""

    name: str
    family: str
    words: str
    status: str
    told: list[tuple[str, str]]
    seconds: tuple[float, float]  # of the package, of the oracles
    known: bool


def drawn(name: str) -> FitScene | RawScene | None:
    """Return the scene of a name, None where the draw gives none."""
    return raw_scene(name) if name.startswith("raw:") else fit_scene(name)


def names(quick: bool, rounds: int) -> list[str]:
    """Return the names of a run."""
    return [*fit_names(quick, rounds), *raw_names(QUICK_RAW if quick else RAW * rounds)]


def _cheap(name: str) -> bool:
    """Tell whether a scene is one of the quick run: raw scenes are, and motions that cost little."""
    scene = drawn(name)
    return isinstance(scene, RawScene) or (scene is not None and scene.label in CHEAP)


def _asked(scene: FitScene | RawScene) -> Any:
    from fcdm_opt_benchmarks.attack import asking

    return asking.asked_raw(scene) if isinstance(scene, RawScene) else asking.asked(scene)


def _judged(scene: FitScene | RawScene, answer: Any, effort: int) -> tuple[list[tuple[str, str]], Any]:
    """Return what is wrong with an answer, and what the oracles know."""
    if isinstance(scene, RawScene):
        return raw_verdicts(scene, answer), scene.least
    found = scene.least(effort)
    return verdicts(scene, answer, found), found


def run(chosen: list[str], effort: int = 1) -> list[SceneOutcome]:
    """Ask some scenes."""
    lines = []
    for name in chosen:
        scene = drawn(name)
        if scene is None:
            continue
        answer = _asked(scene)
        start = time.perf_counter()
        found: Any = None
        told: list[tuple[str, str]] = []
        try:
            told, found = _judged(scene, answer, effort)
        except Exception:  # the run goes on, and ends with an error
            told = [("oracle failed", traceback.format_exc(limit=-3))]
        seconds = answer.seconds, time.perf_counter() - start
        lines.append(
            SceneOutcome(name, scene.family, scene.describe(), answer.status, told, seconds, found is not None)
        )
    return lines


def replayed(name: str, effort: int) -> int:
    """Ask one scene and tell everything."""
    scene = drawn(name)
    if scene is None:
        print("this name draws no scene")
        return 2
    answer = _asked(scene)
    told, found = _judged(scene, answer, effort)
    print(scene.describe())
    if isinstance(scene, FitScene):
        _print_parts(scene)
    print("answer", answer)
    print("oracle", found)
    print("verdicts", told or "all is well")
    return 3 if failed(told) else 0


def _print_parts(scene: FitScene) -> None:
    for step in scene.steps:
        print(" ", step)
    for what, pieces, seed in (("movable", scene.fit.movable, scene.s1), ("static", scene.fit.static, scene.s2)):
        print(f"  {what}, seed {seed.tolist()}:")
        for piece in pieces:
            print(f"    {piece.tolist()}")
    for block in scene.keep_out:
        print(f"  keep-out, clearance {block.clearance}: {block.corners.tolist()}")


def report(lines: list[SceneOutcome], seconds: float) -> str:
    """Return the table of families and verdicts, and every failure."""
    kinds = [kind for kind in (*FAILURES, *NOTES) if any(kind == own for line in lines for own, _ in line.told)]
    counts: dict[str, Counter[str]] = {}
    for line in lines:
        own = counts.setdefault(line.family, Counter())
        own["scenes"] += 1
        own["known"] += line.known
        own["right"] += not failed(line.told)
        own.update({kind for kind, _ in line.told})
    heads = ["scenes", "known", "right", *kinds]
    total = sum(counts.values(), Counter())
    rows = [[family, *(str(own[head]) for head in heads)] for family, own in sorted(counts.items())]
    rows.append(["all", *(str(total[head]) for head in heads)])
    package, oracles = (sum(own) for own in zip((0.0, 0.0), *(line.seconds for line in lines), strict=True))
    spent = f"{len(lines)} scenes in {seconds:.0f} s; package {package:.0f} s, oracles {oracles:.0f} s"
    text = [spent, table(["family", *heads], rows)]
    for line in lines:
        text += [f"{line.words}\n    {kind}: {words}" for kind, words in line.told if kind in FAILURES]
    return "\n".join(text)


def main(arguments: list[str] | None = None) -> int:
    """Run the attack from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} rounds, motions that cost little")
    parser.add_argument("--rounds", type=int, default=None, help=f"scenes of each family ({ROUNDS})")
    parser.add_argument("--only", default="", help="names that hold this text")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--effort", type=int, default=1, help="how hard the oracles search")
    parser.add_argument(
        "--proved", action="store_true", help="a bound 1 % off, one or two parameters, is a failure too"
    )
    parser.add_argument("--replay", metavar="NAME", help="one scene, told in full")
    parser.add_argument("--json", type=Path, help="write every outcome there")
    given = parser.parse_args(arguments)
    if given.replay:
        return replayed(given.replay, given.effort)
    start = time.perf_counter()
    rounds = given.rounds or (QUICK if given.quick else ROUNDS)
    chosen = [name for name in names(given.quick, rounds) if given.only in name]
    if given.quick:
        chosen = [name for name in chosen if _cheap(name)]
    pieces = [(chosen[part.start : part.stop], given.effort) for part in chunks(len(chosen), CHUNK)]
    lines: list[SceneOutcome] = []
    for found in in_pieces(run, pieces, given.jobs):
        lines += found
        if given.json is not None:
            given.json.write_text(json.dumps([line._asdict() for line in lines], indent=1) + "\n")
    print(report(lines, time.perf_counter() - start))
    weak = given.proved and any(kind == "weak bound" for line in lines for kind, _ in line.told)
    return 3 if weak or any(failed(line.told) for line in lines) else 0
