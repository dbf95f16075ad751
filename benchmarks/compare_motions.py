"""Compare the solver with rival methods on random problems over all motions, goals and requirements; all are judged.

    python benchmarks/compare_motions.py SEED COUNT [--nonconvex M] [--first K] [--processes 2] [--seconds 500]
                                         [--out out/motions] [--rivals NAME ...] [--without NAME ...]
                                         [--rounds 7 [--certify]]

Case k is drawn from (SEED, kind, k) alone. One JSON line a case goes to OUT/SEED.jsonl; cases that are there already
are not run again, so that a long comparison can be made in pieces: run the same command until it says that nothing is
left. A single case, with `--first K` and a count of 1, is run in any case. Ends with 1 if a rival found a verified
motion that is smaller by more than 1e-6, or one where the solver found none, or if the solver raised, hung or
contradicted itself.

With `--rounds` times are medians over so many rounds in which all methods run one after the other, warm, and only
cases with the weighted amount count; what takes longer than a second runs once. Ours includes the verification, a
rival's time does not. The best rival of a case is the fastest whose motion the judge accepts and that is as small as
ours.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fcdm_opt as fo
from fcdm_opt.show import new_figure, save
from fcdm_opt_benchmarks.method import Failure
from fcdm_opt_benchmarks.motions import METHODS, NONE, RIVALS, answered, judged
from fcdm_opt_benchmarks.motions.cases import KINDS, DrawnCase, draw
from fcdm_opt_benchmarks.record import table
from fcdm_opt_benchmarks.scripts import Work, describe, in_pieces, in_turns

SMALLER = 1e-6  # relative: a rival's motion that is smaller by more beats ours
ROUNDING = 1e-10  # of the size of the bodies: amounts that differ by less are one
BOUND = 1e-9  # relative: slack of the lower bound
PATIENCE = 90  # seconds of our own solve, and of each rival
WARM = 12  # cases of each kind solved by a process before its first
FAULTS = ("smaller", "missed", "wrongly infeasible", "bound too high", "not verified", "raised", "hung", "rival raised")


class Group(NamedTuple):
    """Convex cases of one kind, and what is asked of our median time, milliseconds; with proof where that is asked."""

    name: str
    takes: Callable[[dict[str, Any]], bool]
    asked: float
    certify: bool = False


ONCE = 1.0  # seconds beyond which a method is timed once
RATIO = 20.0  # at least this much faster than the best rival
GROUPS = (
    Group("1 parameter", lambda record: record["parameters"] == 1, 1.0),
    Group("2 parameters", lambda record: record["parameters"] == 2, 3.0),
    Group("Free()", lambda record: record["motion"] == "free", 15.0),
    Group("2 parameters, certified", lambda record: record["parameters"] == 2, 60.0, certify=True),
)


class OutOfPatienceError(BaseException):  # a method that catches whatever a library raises must not catch this
    """A method took longer than its patience."""


@contextmanager
def within(seconds: int) -> Iterator[None]:
    """Interrupt what takes longer."""

    def stop(*_: object) -> None:
        raise OutOfPatienceError

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def compare(case: DrawnCase, rivals: Sequence[str], rounds: int = 0, certify: bool = False) -> dict[str, Any]:
    """Solve a case by ourselves and by rivals; all that is found is judged, and timed again where rounds are given."""
    own = _ours(case.problem, certify)
    record = {**case.labels, "command": case.command, "size": case.problem.size, "ours": own, "certify": certify}
    record |= {"rivals": {name: _rival(case.problem, name) for name in rivals}}
    if rounds and own["usable"] and case.problem.amount == "weighted":
        works: dict[str, Work] = {"ours": lambda: fo.solve(case.problem, certify=certify)}
        works |= {name: partial(answered, name, case.problem) for name, x in record["rivals"].items() if x["usable"]}
        for name, seconds in in_turns(works, rounds, ONCE).items():
            (own if name == "ours" else record["rivals"][name])["seconds"] = float(np.median(seconds))
    return record | {"faults": faults(record)}


def _ours(problem: fo.Problem, certify: bool) -> dict[str, Any]:
    start = time.perf_counter()
    try:
        with within(PATIENCE):
            solution = fo.solve(problem, certify=certify)
    except OutOfPatienceError:
        return {"status": "hung", "usable": False, "seconds": time.perf_counter() - start}
    except Exception:  # whatever it is, it is recorded, and the run goes on
        return {"status": "raised", "usable": False, "error": traceback.format_exc(limit=-3)}
    more = {"bound": solution.lower_bound, "gap": solution.gap, "stage": solution.stage, **solution.seconds}
    return more | _told(solution, time.perf_counter() - start)


def _told(solution: fo.Solution, seconds: float) -> dict[str, Any]:
    checks = solution.certificate.failed if solution.certificate else ()
    return {
        "status": solution.status.name,
        "usable": solution.usable,
        "amount": None if math.isnan(solution.amount) else solution.amount,
        "q": list(solution.parameters.values()),
        "failed": [check.name for check in checks],
        "seconds": seconds,
    }


def _rival(problem: fo.Problem, name: str) -> dict[str, Any]:
    refused = next(method for method in METHODS if method.name == name).refuses(problem)
    if refused is not None:
        return {"status": "refused", "usable": False, "reason": refused}
    start = time.perf_counter()
    try:
        with within(PATIENCE):
            answer = answered(name, problem)
    except OutOfPatienceError:
        return {"status": "hung", "usable": False, "seconds": time.perf_counter() - start}
    seconds = time.perf_counter() - start
    if isinstance(answer, Failure):
        status = "none" if answer.reason == NONE else "raised"
        return {"status": status, "usable": False, "error": answer.reason, "seconds": seconds}
    return _told(judged(problem, answer.q), seconds)


def faults(record: dict[str, Any]) -> list[str]:
    """Return what is wrong with our own answer, in view of the rivals'."""
    own, rounding = record["ours"], ROUNDING * record["size"]
    verified = [r["amount"] for r in record["rivals"].values() if r["usable"]]
    least = min(verified, default=math.inf)
    found = []
    if own["status"] in ("raised", "hung"):
        found.append(own["status"])
    if own["status"] == "NOT_VERIFIED":
        found.append("not verified")
    if own["usable"] and least < own["amount"] * (1 - SMALLER) - rounding:
        found.append("smaller")
    if not own["usable"] and verified:
        found.append("wrongly infeasible" if own["status"] == "INFEASIBLE" else "missed")
    amounts = [least, *([own["amount"]] if own.get("amount") is not None else [])]
    if min(amounts) < own.get("bound", 0.0) * (1 - BOUND) - rounding:
        found.append("bound too high")
    if any(r["status"] == "raised" for r in record["rivals"].values()):
        found.append("rival raised")
    return found


@cache
def warm() -> None:
    """Compile kernels and load what is compiled, once a process, so that no case waits for it."""
    for kind, number in [(kind, number) for kind in KINDS for number in range(WARM)]:
        with suppress(Exception):  # what fails here fails in its own case, and is recorded there
            fo.solve(draw(0, kind, number).problem)


def run(
    seed: int, kind: str, number: int, rivals: Sequence[str], rounds: int = 0, certify: bool = False
) -> dict[str, Any]:
    """Draw and compare one case."""
    warm()
    return compare(draw(seed, kind, number), rivals, rounds, certify)


# -------------------------------------------------------------------------------------------------------------- report


def report(records: Sequence[dict[str, Any]], seed: int) -> str:
    """Tell the results in Markdown."""
    kinds = Counter(r["kind"] for r in records)
    statuses = Counter(r["ours"]["status"] for r in records)
    told = [
        f"Seed {seed}: {', '.join(f'{n} {kind}' for kind, n in kinds.items())} cases. {describe()}",
        "Our statuses: " + ", ".join(f"{name} {n}" for name, n in statuses.most_common()) + ".",
        _methods(records),
        _by_motion(records),
        _timed(records),
    ]
    for fault in FAULTS:
        own = [r for r in records if fault in r["faults"]]
        told.append(f"{fault}: {len(own)}")
        told += ["\n".join(f"- {_line(r)}" for r in own)] if own else []
    return "\n\n".join(told)


def _methods(records: Sequence[dict[str, Any]]) -> str:
    rows = []
    own = [r["ours"]["seconds"] for r in records if "seconds" in r["ours"]]
    rows.append(["ours", str(len(own)), str(sum(r["ours"]["usable"] for r in records)), "", "", "", _ms(own)])
    for name in RIVALS:
        mine = [(r, r["rivals"][name]) for r in records if name in r["rivals"]]
        asked = [(r, x) for r, x in mine if x["status"] != "refused"]
        usable = [(r, x) for r, x in asked if x["usable"]]
        same = [_same(r, x) for r, x in usable]
        smaller = sum("smaller" in r["faults"] and _beats(r, x) for r, x in usable)
        alone = sum(not r["ours"]["usable"] for r, x in usable)
        times = [x["seconds"] for _, x in asked if "seconds" in x]
        rows.append([name, str(len(asked)), str(len(usable)), str(sum(same)), str(smaller), str(alone), _ms(times)])
    head = ["", "asked", "verified", "as small as ours", "smaller", "ours has none", "median ms"]
    return table(head, rows)


def _best(record: dict[str, Any]) -> str | None:
    """Return the fastest rival whose motion is as small as ours."""
    same = {name: x["seconds"] for name, x in record["rivals"].items() if x["usable"] and _same(record, x)}
    return min(same, key=same.__getitem__, default=None)


def _timed(records: Sequence[dict[str, Any]]) -> str:
    """Tell our times by kind of case and goal, and those of the best rivals over ours."""
    rows = []
    for group in GROUPS:
        mine = [r for r in records if r["kind"] == "convex" and r["amount"] == "weighted" and group.takes(r)]
        mine = [r for r in mine if r["certify"] == group.certify and r["ours"]["usable"] and r["ours"]["amount"] > 0]
        for goal in ["", *sorted({r["goal"] for r in mine})] if mine else []:
            own = [r for r in mine if goal in ("", r["goal"])]
            ratios = [
                r["rivals"][best]["seconds"] / r["ours"]["seconds"] for r in own if (best := _best(r)) is not None
            ]
            ours, verify = ([r["ours"][key] for r in own] for key in ("seconds", "verify"))
            told = "" if goal else "met" if 1e3 * np.median(ours) <= group.asked else "NOT met"
            ratio = f"{np.median(ratios):.3g}" if ratios else ""
            enough = "" if goal or not ratios else "met" if np.median(ratios) >= RATIO else "NOT met"
            cells = [_ms(ours), _ms(verify), f"{1e3 * max(ours):.3g}", f"{group.asked:g}", told, ratio, enough]
            rows.append([group.name, goal, str(len(own)), *cells])
    times = ["median ms", "of it verify ms", "most ms", "asked ms", "", "best rival's time / ours, median"]
    return table(["", "goal", "cases", *times, f"at least {RATIO:g}"], rows)


def figure(records: Sequence[dict[str, Any]]) -> Any:
    """Draw our time and every rival's of each case by parameters; hollow where a rival's motion is larger than ours."""
    made = new_figure(9, 5)
    axes = made.subplots()
    shown = [r for r in records if r["ours"]["usable"]]
    for k, name in enumerate(["", *RIVALS]):
        mine = [r for r in shown if not name or r["rivals"].get(name, {}).get("usable")]
        x = [r["parameters"] + 0.8 * (k / len(RIVALS) - 0.5) for r in mine]
        y = [1e3 * (r["rivals"][name] if name else r["ours"])["seconds"] for r in mine]
        fill = [f"C{k % 10}" if not name or _same(r, r["rivals"][name]) else "none" for r in mine]
        axes.scatter(x, y, s=14, facecolors=fill, edgecolors=f"C{k % 10}", label=name or "ours, verified")
    axes.set(yscale="log", xlabel="parameters", ylabel="time, ms")
    axes.set_title("Smallest motion: time of each case; hollow a larger motion", fontsize=10)
    axes.legend(fontsize=8, ncols=2)
    return made


def _beats(record: dict[str, Any], rival: dict[str, Any]) -> bool:
    own = record["ours"]
    return own["usable"] and rival["amount"] < own["amount"] * (1 - SMALLER) - ROUNDING * record["size"]


def _same(record: dict[str, Any], rival: dict[str, Any]) -> bool:
    own = record["ours"]
    return own["usable"] and rival["amount"] <= own["amount"] * (1 + SMALLER) + ROUNDING * record["size"]


def _by_motion(records: Sequence[dict[str, Any]]) -> str:
    groups = defaultdict(list)
    for record in records:
        groups[record["motion"]].append(record)
    rows = []
    for name, some in groups.items():
        times = [r["ours"]["seconds"] for r in some if "seconds" in r["ours"]]
        usable, wrong = sum(r["ours"]["usable"] for r in some), sum(bool(r["faults"]) for r in some)
        rows.append([name, str(len(some)), str(usable), str(wrong), _ms(times), f"{1e3 * max(times, default=0):.0f}"])
    return table(["motion", "cases", "verified", "faults", "median ms", "most ms"], rows)


def _ms(times: Sequence[float]) -> str:
    return f"{1e3 * np.median(times):.3g}" if times else ""


def _line(record: dict[str, Any]) -> str:
    own = record["ours"]
    usable = {name: r["amount"] for name, r in record["rivals"].items() if r["usable"]}
    best = min(usable, key=usable.__getitem__, default=None)
    labels = f"{record['motion']}, {record['goal']}, pair {record['pair']}, {record['path']}"
    extra = [word for word in ("limits", "keep_outs") if record[word]]
    extra += [] if record["amount"] == "weighted" else [record["amount"]]
    rival = "" if best is None else f"; {best} {usable[best]:.9g}"
    ours = f"{own['status']} {own.get('amount')} [{own.get('stage', own.get('error', ''))}]"
    return f"`{record['command']}`: {', '.join([labels, *extra])}: ours {ours}{rival}"


def main(arguments: list[str] | None = None) -> int:
    """Run the comparison from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("seed", type=int)
    parser.add_argument("count", type=int, help="convex cases")
    parser.add_argument("--nonconvex", type=int, default=0, help="non-convex cases (%(default)s)")
    parser.add_argument("--first", type=int, default=0, help="number of the first case (%(default)s)")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=500.0, help="begin no further case after (%(default)s)")
    parser.add_argument("--out", type=Path, default=Path("out/motions"))
    parser.add_argument("--rivals", nargs="+", choices=RIVALS, default=RIVALS)
    parser.add_argument("--without", nargs="+", choices=RIVALS, default=[])
    parser.add_argument("--rounds", type=int, default=0, help="of timing, for cases with the weighted amount")
    parser.add_argument("--certify", action="store_true", help="solve with proof")
    given = parser.parse_args(arguments)
    rivals = [name for name in given.rivals if name not in given.without]
    counts = zip(KINDS, (given.count, given.nonconvex), strict=True)
    wanted = [(kind, number) for kind, n in counts for number in range(given.first, given.first + n)]
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / f"{given.seed}.jsonl"
    known = {} if not path.exists() else {_key(r): r for r in map(json.loads, path.read_text().splitlines())}
    left = wanted if len(wanted) == 1 else [key for key in wanted if key not in known]
    start, records = time.perf_counter(), [known[key] for key in wanted if key in known and key not in left]
    with path.open("a", encoding="utf-8") as lines:
        for first in range(0, len(left), 2 * given.processes):
            if time.perf_counter() - start > given.seconds:
                break
            pieces = [
                (given.seed, *key, rivals, given.rounds, given.certify)
                for key in left[first : first + 2 * given.processes]
            ]
            for record in in_pieces(run, pieces, given.processes):
                records.append(record)
                lines.write(json.dumps(record) + "\n")
                lines.flush()
    print(report(records, given.seed))
    save(figure(records), given.out / "motions")
    if len(records) < len(wanted):
        print(f"\n{len(wanted) - len(records)} cases are left: run the same command again.")
    if len(wanted) == 1:
        print(json.dumps(records[0], indent=1))
    return 1 if any(record["faults"] for record in records) else 0


def _key(record: dict[str, Any]) -> tuple[str, int]:
    return record["kind"], record["number"]


if __name__ == "__main__":
    sys.exit(main())
