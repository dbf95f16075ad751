"""One contact by ours: the walk's lines, or rational ones, at a scale of body 1."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fcdm_opt.compiling import kernel
from fcdm_opt.curve import kernels
from fcdm_opt.curve.batch import decision_curves
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.method import Ask, ContactAnswer, ContactQuestion, Failure, Method, Pair, one_by_one
from fcdm_opt_benchmarks.placed import Placed, answered, elements

NONE = Failure("no scale of body 2 above 0 touches")


@kernel
def crossing(rows: Array, rho1: float) -> tuple[float, int]:
    """Return (rho_2, k): the highest of a walk's lines at a scale of body 1, and which it is."""
    best, found = -np.inf, -1
    for k in range(len(rows)):
        height = (rows[k, 5] - rows[k, 3] * rho1) / rows[k, 4]
        if height > best:
            best, found = height, k
    return best, found


def walked(pair: Pair, setting: None) -> Ask:
    """Call the compiled walk of one pose, and cross its lines; what floats cannot prove is left to the exact path."""
    Placed.of(pair)
    one, two = _parts(pair)
    walk, named, exactly = kernels.walk, elements(pair), _exactly(pair)
    packed, seeds, planarity = (*one.packed, *two.packed), (one.seed, two.seed), DEFAULT.planarity

    def ask(questions: Sequence[ContactQuestion]) -> list[Any]:
        answers: list[Any] = []
        for transform, rho1 in questions:
            state, sites, rows, _, _ = walk(*packed, transform, *seeds, planarity)
            if state != kernels.WALKED:
                answers += exactly([ContactQuestion(transform, rho1)])
                continue
            rho2, k = crossing(rows, rho1)
            kind, i, j = sites[k, :3].tolist()
            answers.append(ContactAnswer(rho2, (named[kind][0][i], named[kind][1][j])) if rho2 > 0 else NONE)
        return answers

    return ask


def batch(pair: Pair, setting: None) -> Ask:
    """Ask for the curves of all poses at once, in a box about the questions, and cross them in arrays."""
    placed, named = Placed.of(pair), elements(pair)

    def ask(questions: Sequence[ContactQuestion]) -> list[Any]:
        if not questions:
            return []
        transforms, rho1 = np.array([q.transform for q in questions]), np.array([q.rho1 for q in questions])
        box = ((rho1.min() * (1 - DEFAULT.rim), rho1.max() * (1 + DEFAULT.rim)), (0.0, _above(placed, transforms)))
        curves = decision_curves(*pair, transforms, box=box)
        a, b, c = curves.lines.T
        heights = (c - a * rho1.repeat(curves.counts)) / b
        some = np.flatnonzero(curves.counts)
        firsts = curves.offsets[some]
        rho2 = np.maximum.reduceat(heights, firsts) if some.size else np.empty(0)
        highest = np.flatnonzero(heights == rho2.repeat(curves.counts[some]))
        sites = curves.features[highest[np.searchsorted(highest, firsts)]].tolist()
        # of a contact in more than a point they are one facet, and name not all that touches
        sure = ~(curves.settled | curves.tied)[some]
        answers: list[Any] = [NONE] * len(questions)
        for k, height, (kind, i, j), proved in zip(some.tolist(), rho2.tolist(), sites, sure.tolist(), strict=True):
            if height > 0:
                answers[k] = ContactAnswer(height, (named[kind][0][i], named[kind][1][j]) if proved else None)
        return answers

    return ask


def curve(pair: Pair, setting: None) -> Ask:
    """Ask the public interface for each curve, and it for rho_2; to name what touches would cost many times as much."""
    placed = Placed.of(pair)

    def answer(question: ContactQuestion) -> ContactAnswer:
        transform, rho1 = question
        box = ((0.0, 2.0 * rho1), (0.0, _above(placed, transform[None])))
        return answered(float(decision_curve(*pair, box=box, transform=transform).rho2(rho1)))

    return one_by_one(answer)


def exact(pair: Pair, setting: None) -> Ask:
    """Work out the curve in rational numbers; rho_2 is rounded once."""
    Placed.of(pair)
    return _exactly(pair)


def _exactly(pair: Pair) -> Ask:
    from fcdm_opt.curve.exact import exact_curve
    from fcdm_opt.curve.exact.rationals import quotient, rational

    one, two = _parts(pair)

    def answer(question: ContactQuestion) -> ContactAnswer:
        (chain,), x = exact_curve(one, two, question.transform).chains, rational(question.rho1)
        pieces = chain.pieces
        heights = [(piece.exact_line[2] - piece.exact_line[0] * x) / piece.exact_line[1] for piece in pieces]
        highest = max(heights)
        k = heights.index(highest)
        mine, its = (chain.corners[k] if heights.count(highest) > 1 else pieces[k]).touching
        return answered(quotient(highest.p, highest.q), (tuple(sorted(mine)), tuple(sorted(its))))

    return one_by_one(answer)


def _parts(pair: Pair) -> tuple[ConvexPart, ConvexPart]:
    return pair.movable.parts[0], pair.static.parts[0]


def _above(placed: Placed, transforms: Array) -> float:
    """Return a scale of body 2 above all answers: there its inner ball holds the seed of body 1."""
    moved = transforms[:, :3, :3] @ placed.seeds[0] + transforms[:, :3, 3]
    ways = np.linalg.norm(placed.seeds[1] - moved, axis=1) / placed.unit
    return float(ways.max() / placed.two.inner * (1 + DEFAULT.rim))


DOUBLES = {"doubles": None}
METHODS = (
    Method("kernel", "ours", DOUBLES, walked),
    Method("decision_curves", "ours", DOUBLES, batch),
    Method("decision_curve", "ours", DOUBLES, curve),
    Method("exact path", "ours", {"rationals": None}, exact),
)
