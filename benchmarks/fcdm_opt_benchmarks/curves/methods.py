"""The whole decision curve of a convex pair in a box: our ways to it, and rivals'.

Subject `Pair`, question `CurveQuestion`, answer `CurveAnswer`. All methods need both seeds inside their parts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from fcdm_opt.curve.batch import decision_curves
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.curve.kernels import UNDECIDED
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.curves.rivals import bisection, clarabel, cold_highs, distances, growth, linprog, warm_highs
from fcdm_opt_benchmarks.method import Ask, CurveAnswer, CurveQuestion, Method, Pair, Touching, one_by_one, settings
from fcdm_opt_benchmarks.placed import elements, seeds_inside, up_to
from fcdm_opt_benchmarks.references import exact_curve_in_box

Batch = tuple[Ints, Array, Ints, Flags]  # segments a curve, their ends, features, and curves that these do not name


def batch(pair: Pair, setting: None) -> Ask:
    """Give all questions to `decision_curves` at once."""
    _packed(pair)

    def walk(transforms: Array, box: Array) -> Batch:
        curves = decision_curves(pair.movable, pair.static, transforms, box=box.tolist())
        return curves.counts, curves.vertices, curves.features, curves.settled | curves.tied

    def settled(question: CurveQuestion, points: Array) -> CurveAnswer:
        return CurveAnswer(points)  # the batch names one facet, not all that touches

    return _batched(pair, walk, settled)


def kernel(pair: Pair, setting: None) -> Ask:
    """Call the compiled walk for all questions at once; what it does not prove goes the exact path."""
    from fcdm_opt.curve import kernels

    packed, seeds = _packed(pair), np.array([pair.movable.seed, pair.static.seed])
    bounds = DEFAULT.planarity, DEFAULT.point, DEFAULT.sign

    def walk(transforms: Array, box: Array) -> Batch:
        states, ties, counts, sites, _, ends = kernels.walk_many(
            *packed, frozen(transforms), seeds, np.array(box).ravel(), *bounds
        )
        return counts, ends, sites, (states == UNDECIDED) | ((ties > 0) & (counts > 0))

    def settled(question: CurveQuestion, points: Array) -> CurveAnswer:
        return CurveAnswer(points) if len(points) else _exact(pair, question)

    return _batched(pair, walk, settled)


def _packed(pair: Pair) -> tuple[Array | Ints, ...]:
    """Return what the kernels take of both parts; each keeps its own from then on."""
    return (*pair.movable.parts[0].packed, *pair.static.parts[0].packed)


def _batched(
    pair: Pair,
    walk: Callable[[Array, Array], Batch],
    settled: Callable[[CurveQuestion, Array], CurveAnswer],
) -> Ask:
    """Return the function that answers by arrays; `settled` answers where a facet does not name what touches."""
    named = elements(pair)

    def ask(questions: Sequence[CurveQuestion]) -> list[CurveAnswer]:
        boxes = np.array([question.box for question in questions])
        if (boxes != boxes[:1]).any():
            return [answer for question in questions for answer in ask([question])]
        transforms = np.array([question.transform for question in questions])
        counts, ends, features, doubtful = walk(transforms, boxes[0])
        offsets = np.concatenate([[0], np.cumsum(counts)])
        # of each curve the starts of its segments, and the end of the last
        points = np.empty((len(ends) + len(counts), 2))
        points[np.arange(len(ends)) + np.repeat(np.arange(len(counts)), counts)] = ends[:, 0]
        some = np.flatnonzero(counts)
        points[offsets[1:][some] + some] = ends[offsets[1:][some] - 1, 1]
        names = [(named[kind][0][i], named[kind][1][j]) for kind, i, j in features.tolist()]
        answers: list[CurveAnswer] = []
        places = zip(questions, offsets.tolist(), offsets[1:].tolist(), doubtful.tolist(), strict=False)
        for k, (question, start, stop, unproved) in enumerate(places):
            own = points[start + k : stop + k + 1] if stop > start else points[:0]
            answers.append(settled(question, own) if unproved else CurveAnswer(own, tuple(names[start:stop])))
        return answers

    return ask


def single(pair: Pair, setting: None) -> Ask:
    """Call `decision_curve` for each question, and build its segments."""
    _packed(pair)

    def answer(question: CurveQuestion) -> CurveAnswer:
        curve = decision_curve(pair.movable, pair.static, box=question.box.tolist(), transform=question.transform)
        segments = curve.segments
        if not segments:
            return CurveAnswer(np.empty((0, 2)), ())
        contacts = [segment.run.whole.contact for segment in segments]
        names: list[Touching] = [(tuple(sorted(own.one)), tuple(sorted(own.two))) for own in contacts]
        return CurveAnswer(np.array([*(segment.start for segment in segments), segments[-1].end]), tuple(names))

    return one_by_one(answer)


def exact_path(pair: Pair, setting: None) -> Ask:
    """Work in rational arithmetic throughout and round at the end."""
    return one_by_one(partial(_exact, pair))


def _exact(pair: Pair, question: CurveQuestion) -> CurveAnswer:
    curve = exact_curve_in_box(pair, question, proofs=0)
    return CurveAnswer(curve.rounded, curve.touching)


# ------------------------------------------------------------------------------------------------------- who is asked

RAYS = {f"{rays} rays, {tolerance}": (rays, float(tolerance))
        for rays, tolerance in ((9, "1e-3"), (33, "1e-6"), (33, "1e-12"), (129, "1e-12"))}  # fmt: skip
DOUBLES, NEWTON, SIMPLEX = {"doubles": None}, settings("1e-6", "1e-12"), settings("1e-7", "1e-10")
SLOW = up_to(1000, "more than 1 s a curve", seeds_inside)
VERY_SLOW = up_to(1000, "up to 5 s a curve", seeds_inside)
METHODS: tuple[Method, ...] = (
    Method("decision_curves", "ours", DOUBLES, batch, seeds_inside),
    Method("kernel", "ours", DOUBLES, kernel, seeds_inside),
    Method("decision_curve", "ours", DOUBLES, single, seeds_inside),
    Method("exact path", "ours", {"rationals": None}, exact_path, seeds_inside),
    Method("coal bisection", "coal", RAYS, bisection, seeds_inside),
    Method("coal distance + Newton", "coal", NEWTON, distances, seeds_inside),
    Method("growth distances", "growth distance", NEWTON, growth, seeds_inside),
    Method("HiGHS, cold", "HiGHS", SIMPLEX, cold_highs, seeds_inside),
    Method("HiGHS, warm", "HiGHS", SIMPLEX, warm_highs, seeds_inside),
    Method("scipy linprog", "HiGHS", SIMPLEX, linprog, VERY_SLOW),
    Method("Clarabel (cvxpy)", "Clarabel", settings("1e-6", "1e-8", "1e-10"), clarabel, SLOW),
)
