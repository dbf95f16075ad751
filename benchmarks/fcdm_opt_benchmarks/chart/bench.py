"""Speed against accuracy: every method at several of its own settings, on three tasks, against exact references.

Table "chart", one row for each scene, method and setting:

    task        "contact", "curve" or "motion"
    scene       name; with vertices, shape, separation, parameters and goal where they apply
    method, family, setting
    outcome     "answered"; "partly" where some answers failed, "failed" where all did; "not asked" with the reason
    asked, failed, misnamed
                answers compared with the reference; how many are none; how many name a feature that is not the one
    reason      of the first failure, or why it was not asked
    seconds, low, high, rounds
                median and quartiles of the seconds an answer over the timed calls, and their number
    setup, first, late_setup
                seconds of the set-up for the subject, of the first answer, and of set-up put off until then
    error, error_low, error_high, worst
                median, quartiles and largest relative error of the answers that are none of the failed
    judging, below
                of "motion": median seconds that the judge takes for an answer, which a rival's time does not hold; how
                many accepted answers are less than the least amount by more than rounding: the reference is wrong then

Table "faults": what differs between the batch of decision curves and the exact curves, pose by pose; empty is right.
Tables "growth" and "models": see there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from fcdm_opt.curve.batch import decision_curves
from fcdm_opt.errors import InputError
from fcdm_opt_benchmarks import contacts, curves, motions
from fcdm_opt_benchmarks.cost.growth import growth
from fcdm_opt_benchmarks.cost.models import costs
from fcdm_opt_benchmarks.method import Failure, Method, MotionAnswer, Pair
from fcdm_opt_benchmarks.motions import judged
from fcdm_opt_benchmarks.motions.cases import chart_cases
from fcdm_opt_benchmarks.pairs import SEPARATIONS, DrawnPair
from fcdm_opt_benchmarks.record import BenchRun, Row, Watch
from fcdm_opt_benchmarks.references import (
    contact_error,
    curve_error,
    exact_contact,
    exact_curve_in_box,
    feature_faults,
    touching_right,
)
from fcdm_opt_benchmarks.timing import TimedScene, Timing, TimingPlan, measured, timed, warmed

Say = Callable[[str], None]
TASKS = {"contact": "one contact", "curve": "the whole decision curve", "motion": "the smallest motion"}
PARTS = (*TASKS, "growth", "models")
SLACK = 10.0  # times what a contact may be off
CLAIMED = 1e-6  # relative, and length units: what a claimed amount may be off
ROUNDING = 1e-15
"""Errors that doubles cannot help."""


@dataclass(frozen=True)
class Worth:
    """What an answer is worth.

    Attributes
    ----------
    error : float or None
        Relative, against the exact reference.
    failure : str
        Why it is none.
    misnamed : bool
        Whether it names another feature.
    judging : float or None
        Seconds that the judge took for it, where there is one.
    below : bool
        Whether it is accepted by the judge and less than the least amount: then the reference is wrong.
    """

    error: float | None = None
    failure: str = ""
    misnamed: bool = False
    judging: float | None = None
    below: bool = False


@dataclass(frozen=True)
class ChartTask:
    """One of the three charts.

    Attributes
    ----------
    name : str
    methods : sequence of Method
    scenes : sequence of TimedScene
    worth : callable
        (scene, question, k, answer) -> Worth, against the exact reference.
    plan : TimingPlan
    compared : callable
        TimedScene -> how many answers of a method and setting are compared with the reference.
    warming : sequence of TimedScene
        That every method is asked about first, untimed.
    """

    name: str
    methods: Sequence[Method]
    scenes: Sequence[TimedScene]
    worth: Callable[[TimedScene, int, Any], Worth]
    plan: TimingPlan
    compared: Callable[[TimedScene], int]
    warming: Sequence[TimedScene] = ()


def bench(
    *,
    quick: bool = False,
    seed: int = 1,
    only: Collection[str] = PARTS,
    rivals: Mapping[str, Sequence[Method]] = {},
    ours: bool = False,
    say: Say = lambda text: None,
) -> BenchRun:
    """Measure all methods against the exact references.

    Parameters
    ----------
    quick : bool
        The short form: fewer scenes and rounds.
    seed : int
        Of all that is drawn at random.
    only : collection of str
        Which of `PARTS` to measure; the tables of the others stay empty.
    rivals : mapping
        Task -> further methods, see `read_methods`.
    ours : bool
        Ask our own methods alone: whether their answers are right, and no comparison.
    say : callable
        Is told what is measured next.

    Raises
    ------
    InputError
        For a part that there is none of.
    """
    for part in only:
        if part not in PARTS:
            raise InputError("no such part", key="only", found=part, allowed=", ".join(PARTS))
    started, start, watch = datetime.now(UTC), perf_counter(), Watch()
    rng, yardstick = np.random.default_rng(seed), list[float]()
    makers = {"contact": contact_task, "curve": curve_task, "motion": motion_task}
    tasks = [make(quick, seed) for name, make in makers.items() if name in only]
    methods = {task.name: (*task.methods, *rivals.get(task.name, ())) for task in tasks}
    tasks = [replace(task, methods=[own for own in methods[task.name] if own.ours or not ours]) for task in tasks]
    chart = [row for task in tasks for row in charted(task, rng, yardstick, say)]
    compared, faults = 0, list[Row]()
    if "curve" in only:
        say("decision curves against exact ones, feature by feature")
        compared, faults = curve_faults(200 if quick else 5000, seed)
    tables = {
        "chart": chart,
        "faults": faults,
        "growth": growth(quick, seed, say) if "growth" in only else [],
        "models": costs(quick, seed, say) if "models" in only else [],
    }
    settings = {"parts": [part for part in PARTS if part in only], "curves_compared": compared}
    settings |= {f"plan_{task.name}": asdict(task.plan) for task in tasks}
    seconds = perf_counter() - start
    return BenchRun("bench", quick, seed, settings, started.isoformat(), seconds, watch.load(yardstick), tables)


# ---------------------------------------------------------------------------------------------------------- the tasks

QUICK_PAIRS = (
    (8, "aligned", "near"),
    (20, "round", "middling"),
    (24, "aligned", "middling"),
    (100, "long", "middling"),
    (1000, "round", "far"),
)
GENERIC = (
    *((8, shape, separation) for shape in ("round", "flat", "prism") for separation in ("near", "middling")),
    *((20, shape, separation) for shape in ("round", "long", "flat", "prism") for separation in SEPARATIONS),
    *((100, shape, "middling") for shape in ("round", "long", "flat", "prism")),
    *((1000, shape, "middling") for shape in ("round", "long", "flat", "prism")),
    *((10_000, shape, "middling") for shape in ("round", "long")),
)
ALIGNED = tuple(
    (vertices, "aligned", separation)
    for vertices in (8, 12, 16, 20, 24, 48, 100, 400, 1000)
    for separation in SEPARATIONS
)
"""Parts whose faces stay parallel, the ordinary case: as many scenes as in general position, but one."""

PAIRS = (*GENERIC, *ALIGNED)


def contact_task(quick: bool, seed: int) -> ChartTask:
    """Return the chart of one contact: the scale at which body 2 touches."""
    plan = TimingPlan(rounds=4, call=2e-3, most=200, patience=0.08) if quick else TimingPlan(12, 4e-3, 500, 0.25)
    return _pair_task("contact", contacts.METHODS, DrawnPair.contact, exact_contact, contact_error, plan, quick, seed)


def curve_task(quick: bool, seed: int) -> ChartTask:
    """Return the chart of the whole decision curve in a box."""
    plan = TimingPlan(rounds=3, call=2e-3, most=200, patience=0.1) if quick else TimingPlan(10, 4e-3, 500, 0.3)
    return _pair_task("curve", curves.METHODS, DrawnPair.curve, exact_curve_in_box, curve_error, plan, quick, seed)


def _pair_task(
    name: str,
    methods: Sequence[Method],
    question: Callable[[DrawnPair, int], Any],
    exact: Callable[[Pair, Any], Any],
    error: Callable[[Any, Any], float],
    plan: TimingPlan,
    quick: bool,
    seed: int,
) -> ChartTask:
    """Return a task about pairs of hulls; exact references are worked out once for all methods."""
    scenes = []
    for labels in QUICK_PAIRS if quick else PAIRS:
        own = DrawnPair.of(seed, *labels)
        columns = {"vertices": own.vertices, "shape": own.shape, "separation": own.separation}
        label = f"{own.shape}, {own.vertices} vertices, {own.separation}"
        scenes.append(TimedScene(label, columns, own.pair, partial(question, own)))
        for body in own.pair:
            body.parts[0].packed  # noqa: B018 - bodies are whole before anyone is timed
    references: dict[tuple[str, int], Any] = {}

    def worth(scene: TimedScene, k: int, answer: Any) -> Worth:
        if (scene.name, k) not in references:
            references[scene.name, k] = exact(scene.subject, scene.question(k))
        reference = references[scene.name, k]
        found = error(answer, reference)
        if not math.isfinite(found):
            return Worth(failure="no number, or a curve with a part missing")
        return Worth(found, misnamed=touching_right(answer, reference) is False)

    warming = [
        TimedScene(label, {}, own.pair, partial(question, own))
        for label, own in (("loose", DrawnPair.of(seed, 12)), ("tied", DrawnPair.of(seed, 12, "aligned")))
    ]
    compared = {scene.name: _compared(scene.labels["vertices"], quick) for scene in scenes}
    return ChartTask(name, methods, scenes, worth, plan, lambda scene: compared[scene.name], warming)


def _compared(vertices: int, quick: bool) -> int:
    """Return how many answers of a method are compared: references take longer the more vertices there are."""
    return max(3, (8 if quick else 40) * 20 // max(vertices, 20))


def curve_faults(poses: int, seed: int) -> tuple[int, list[Row]]:
    """Compare curves of the batch with exact ones, of four pairs in so many poses; return their number and faults."""
    compared, faults = 0, list[Row]()
    for vertices, shape in ((8, "round"), (8, "aligned"), (12, "long"), (20, "prism")):
        drawn = DrawnPair.of(seed, vertices, shape)
        transforms = drawn.transforms(poses)
        found = decision_curves(*drawn.pair, transforms, box=drawn.box.tolist())
        wrongs = feature_faults(drawn.pair, transforms, found)
        faults += [{"vertices": vertices, "shape": shape, **wrong._asdict()} for wrong in wrongs]
        compared += len(transforms)
    return compared, faults


def motion_task(quick: bool, seed: int) -> ChartTask:
    """Return the chart of the smallest motion."""
    cases = {case.name: case for case in chart_cases(quick, seed)}
    scenes = [TimedScene(case.name, case.labels, case.problem, case.question) for case in cases.values()]

    def worth(scene: TimedScene, k: int, answer: MotionAnswer) -> Worth:
        seconds, judgement = timed(judged, scene.question(k), answer.q)
        if not judgement.usable:
            return Worth(failure=f"rejected by the judge: {judgement.status.value}")
        if not math.isclose(answer.amount, judgement.amount, rel_tol=CLAIMED, abs_tol=CLAIMED):
            return Worth(failure=f"claims the amount {answer.amount:.6g}, its motion costs {judgement.amount:.6g}")
        least, problem = cases[scene.name].least.amount, cases[scene.name].problem
        below = judgement.amount < least - SLACK * problem.contact_slack  # the judge lets a contact be so far off
        return Worth(abs(judgement.amount / least - 1.0), judging=seconds, below=below)

    plan = (
        TimingPlan(3, 1e-4, 1, patience=0.1, longest=0.15)
        if quick
        else TimingPlan(9, 1e-4, 1, patience=0.25, longest=1.0)
    )
    return ChartTask("motion", motions.METHODS, scenes, worth, plan, lambda scene: 2, scenes[:1])


# ---------------------------------------------------------------------------------------------------------- measuring


def charted(task: ChartTask, rng: np.random.Generator, yardstick: list[float], say: Say) -> list[Row]:
    """Measure a task; return its rows of the table "chart"."""
    rows: list[Row] = []
    warmed(task.warming, task.methods)
    slow: dict[tuple[str, str], str] = {}
    for scene in task.scenes:
        say(f"{task.name}: {scene.name}")
        for own in measured(scene, task.methods, task.plan, rng, yardstick, slow):
            rows.append(row(task, scene, own))
            if own.refused is None and own.first > task.plan.longest and not own.method.ours:
                slow[own.method.name, own.setting] = f"not again: took {own.first:.2g} s in {scene.name}"
    return rows


def row(task: ChartTask, scene: TimedScene, own: Timing) -> Row:
    """Return the row of one method and setting in a scene."""
    made: Row = {"task": task.name, "scene": scene.name, **scene.labels, "method": own.method.name,
                 "family": own.method.family, "setting": own.setting}  # fmt: skip
    if own.refused is not None:
        return {**made, "outcome": "not asked", "reason": own.refused}
    answers = own.answers[: task.compared(scene)]
    worths = [_worth(task, scene, k, answer) for k, answer in enumerate(answers)]
    errors = [worth.error for worth in worths if worth.error is not None and not worth.failure]
    failures = [worth.failure for worth in worths if worth.failure]
    outcome = "answered" if not failures else "failed" if not errors else "partly"
    made |= {"outcome": outcome, "asked": len(worths), "failed": len(failures)}
    said = failures[:1] + ([f"set-up at the first question, {own.late_setup:.2g} s"] if own.late_setup else [])
    made |= {"misnamed": sum(worth.misnamed for worth in worths), "reason": "; ".join(said)}
    made |= own.times | {"setup": own.setup, "first": own.first, "late_setup": own.late_setup}
    if errors:
        quartiles = [float(x) for x in np.percentile(errors, (50, 25, 75))]
        made |= dict(zip(("error", "error_low", "error_high"), quartiles, strict=True)) | {"worst": max(errors)}
    if judging := [worth.judging for worth in worths if worth.judging is not None]:
        made |= {"judging": float(np.median(judging)), "below": sum(worth.below for worth in worths)}
    return made


def _worth(task: ChartTask, scene: TimedScene, k: int, answer: Any) -> Worth:
    """Return what an answer is worth; one of a kind that was not asked for is none, and does not end the run."""
    if isinstance(answer, Failure):
        return Worth(failure=answer.reason)
    try:
        return task.worth(scene, k, answer)
    except (AttributeError, TypeError, ValueError) as reason:
        return Worth(failure=f"not an answer: {type(reason).__name__}: {reason}")


def wrong(run: BenchRun) -> bool:
    """Tell whether something of ours is wrong: a curve, an answer that failed, a least amount that is not the least."""
    below = any(row.get("below") for row in run.tables["chart"])
    mine = [row for row in run.tables["chart"] if row["family"] == "ours" and row["outcome"] != "not asked"]
    return below or bool(run.tables["faults"]) or any(row["failed"] or row["misnamed"] for row in mine)


def ahead(rows: Sequence[Row], task: str, slack: float = ROUNDING, *, judged: bool = False) -> list[Row]:
    """Return rivals' rows that lie beyond ours in their scene: left of and below, or beside one of ours.

    That is a rival as fast and as accurate as one of ours, while none of ours is as fast and as accurate as the rival.

    Parameters
    ----------
    rows : sequence of Row
        Table "chart".
    task : str
    slack : float
        Relative errors up to this count as none: rounding, or what "reaches our amount" means.
    judged : bool
        Add to a rival's time what the judge takes for its answer, which ours holds.
    """
    found = []
    answered = [row for row in rows if row["task"] == task and row["outcome"] == "answered"]
    if judged:
        answered = [
            row if row["family"] == "ours" else {**row, "seconds": row["seconds"] + row.get("judging", 0.0)}
            for row in answered
        ]

    def as_good(one: Row, other: Row) -> bool:
        return bool(one["seconds"] <= other["seconds"] and one["error"] <= max(other["error"], slack))

    for rival in answered:
        ours = [row for row in answered if row["family"] == "ours" and row["scene"] == rival["scene"]]
        beaten = [own for own in ours if as_good(rival, own)]
        if rival["family"] == "ours" or not beaten or any(as_good(own, rival) for own in ours):
            continue
        nearest = min(beaten, key=lambda own: own["seconds"])
        beside = {
            "beaten": f"{nearest['method']}, {nearest['setting']}",
            "ratio": nearest["seconds"] / rival["seconds"],
        }
        found.append({**rival, **beside})
    return found
