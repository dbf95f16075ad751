"""Stage 5 and certificates: the least motion by branch and bound, with the proof that nothing smaller will do."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.motion.motions import XYZ, Translation
from fcdm_opt.problem.evidence import Evidence
from fcdm_opt.problem.solution import Status
from fcdm_opt.proof.columns import farthest, prove
from fcdm_opt.proof.exclusion import tested_vertices
from fcdm_opt.stages import direction_search, separating_directions
from fcdm_opt.stages.contact_system import translations
from fcdm_opt.stages.descent import STAGE as DESCENT
from fcdm_opt.stages.descent import descent
from fcdm_opt.stages.rays import on_a_ray
from fcdm_opt.stages.relaxation import choices
from fcdm_opt.stages.turns import least_over_turns
from fcdm_opt.tolerances import DEFAULT

AXES = tuple(map(Translation, XYZ))  # what a free motion shifts along
STAGE_APART = "4: descent over separating directions"
STAGE, TURNED = "5: branch and bound over all motions", "5: branch and bound over rotations"
MOST_PARAMETERS = 2  # for which the search is complete in a moment
MOST_CHECKED = 3  # for which the checker of evidence follows
GAP, FINE_GAP = 8e-5, 1e-7  # of a certificate, which is 1e-4 with the digits of the parts; of the stage by itself
SHOWN_GAP, SHOWN_SHARE = 1e-2, 0.05  # of what is proved without being asked for; of a certificate's cells, see `proved`
EXACT_GAP = DEFAULT.nominal / 2.0  # of a closed form
CONFIRMED_GAP, COARSE_GAP = 1e-6, 1e-3  # of looking for something better; the latter over rotations
LARGE = 0.15  # of the size: amounts beyond this are large
CELLS = {1: 20_000, 2: 100_000, 3: 200_000}  # looked at, at most
CELLS_MORE = 60_000  # the same, for more parameters
FEWEST = 100  # cells that are looked at however large the scene
CONFIRMING, PROVING = 5e6, 5e7  # cells times vertices that a cell is tested against: some seconds, and a minute
SOON = 2e6  # the same: about a second; of three parameters within limits less than the program takes to give up
LARGEST = 2500  # vertex pairs up to which it confirms an answer: about ten milliseconds; of more, only a certificate
CLOSE = 1e-3  # relative: motions this near to the best known one are not searched from
AGAIN = 1e-2  # relative: nor those this near to one from where a search found nothing
NEAR = (1e-3, 3e-2, 0.3)  # relative: radius of the descent from a motion that is held back, until one finds a motion
MANY_PAIRS = 32  # part pairs from which on a program that holds them all takes minutes
MOST_PAIRS = 100_000  # part pairs with which cells are looked at: each cell keeps a row of every one in memory
FEW_PAIRS = 100  # part pairs up to which more motions are descended from
SPREAD = 0.3  # the same, from motions that are not the least for certain
GAINED = 1e-5  # relative: smaller gains may come from what counts as met, where a gap opens with the square of a turn


def branch_and_bound(task: Task) -> Answer | None:
    """Find the least motion with one or two parameters, or prove that there is none; of three only the latter."""
    if len(task.weights) > MOST_PARAMETERS:
        return _denied(task)
    if task.met_at_rest:
        return task.answer(task.rest, STAGE, modelled=task.modelled(), status=Status.ALREADY_SATISFIED)
    answer = bounded(task, Answer(Status.NOT_FOUND, None, STAGE), aims=[(FINE_GAP, PROVING)])[0]
    if answer.q is not None or answer.lower_bound < farthest(task):
        return answer
    beyond = descent(replace(task, coherent=False)) if task.coherent else None
    outside = beyond is not None and beyond.q is not None
    return replace(answer, status=Status.LEFT_COHERENT_RANGE if outside else answer.status, last=True)


def _denied(task: Task) -> Answer | None:
    """Return that limits leave no motion, where that is soon proved; None where it is not.

    It is asked where descent found nothing. Without limits there nearly always is a motion, and keep-outs and tracked
    contacts leave descent without one too often for the proof to be tried in vain.
    """
    limited = np.isfinite(task.limits).any()
    if len(task.weights) > MOST_CHECKED or task.tracked or task.keep_out or not (task.weighted and limited):
        return None
    try:
        proof = prove(task, np.inf, aims=[(GAP, _most(task, SOON))])
    except NotImplementedError:  # as in `bounded`
        return None
    return None if np.isfinite(proof.lower_bound) else Answer(Status.INFEASIBLE, None, STAGE, np.inf)


def confirmed(task: Task, answer: Answer) -> Answer:
    """Return an answer that local searches found, or a better one, where they may have missed the least: no proof.

    That is so among keep-outs and several part pairs, and where the motion is large; of one and two parameters all
    motions are looked at then, with translations in all directions all rotations.
    """
    if not task.weighted or answer.q is None or answer.lower_bound >= _gained(task, _amount(task, answer)):
        return answer
    if len(task.weights) > MOST_PARAMETERS:
        pairs = len(task.movable.vertices) * len(task.static.vertices)
        return _turned(task, answer, COARSE_GAP)[0] if task.part_pairs == 1 and pairs <= LARGEST else answer
    if not _doubtful(task, answer):
        return answer
    return bounded(task, answer, aims=[(CONFIRMED_GAP, CONFIRMING)])[0]


def proved(
    task: Task, answer: Answer, *, gap: float, timed: bool = False, share: float = 1.0
) -> tuple[Answer, Evidence | None]:
    """Return what stages found with a lower bound that is proved, and what proves it; a better motion if one comes up.

    The relative `gap` between amount and bound is enough. `timed`: the time given ends it, in place of a number of
    cells, which does not depend on the machine; `share` is of the cells that are looked at for three parameters and
    more, which seldom end by themselves.
    """
    if not np.isfinite(answer.lower_bound) and share < 1.0:
        return answer, None
    if answer.q is not None and not answer.q.any():
        return answer, None
    few = np.count_nonzero(task.limits.any(axis=1)) <= MOST_PARAMETERS  # that a flush contact does not hold
    if answer.q is not None and _closed(task, answer, FINE_GAP):
        soon = tested_vertices(task, swollen=False) * CELLS[MOST_CHECKED] <= CONFIRMING
        if share < 1.0 or not (few or soon):  # cells would show less than the stage has proved, at a high price
            return answer, None
    checked = share == 1.0
    if checked and task.needs.max() > 0.0:  # what the checker of evidence knows of clearances shows less
        answer = proved(task, answer, gap=gap, timed=timed, share=SHOWN_SHARE)[0]
    if few:
        fine = task.weighted and _doubtful(task, answer)  # what is looked at anew is looked at closely, if that is soon
        close, most = (CONFIRMING, PROVING) if gap < SHOWN_GAP else (SOON, CONFIRMING)
        aims = [*([(CONFIRMED_GAP, close)] if fine else []), (gap, most)]
        if checked and answer.q is not None and _closed(task, answer, EXACT_GAP):  # a closed form is to be told as one
            aims.insert(0, (EXACT_GAP, SOON))
        return bounded(task, answer, aims=aims, timed=timed, checked=checked)
    answer, closed = _turned(task, spread(task, answer, [*_unturned(task), task.start]), gap, share)
    if not closed and answer.q is not None and task.part_pairs <= FEW_PAIRS:
        # turned a little, both ways about each axis: parallel faces are no more so
        steps = np.diag(SPREAD * task.amount(answer.q) / task.weights)[task.spins.any(axis=1)]
        answer = spread(task, answer, [answer.q + sign * step for step in steps for sign in (1.0, -1.0)])
        closed = _closed(task, answer, gap)
    if closed or pacing.over():
        return answer, None
    return bounded(task, answer, aims=[(gap, PROVING)], share=share, timed=timed, checked=checked)


def least_apart(task: Task) -> Answer | None:
    """Stage 4, where rows of one choice at a time do not do: descent over all ways apart; None where it finds none.

    Of many part pairs from the first contact on a ray too: a program over all of them takes minutes.
    """
    answer = Answer(Status.NOT_FOUND, None, STAGE_APART, task.displacement_bound)
    answer = spread(task, answer, [*_unturned(task), task.start])
    many = task.part_pairs >= MANY_PAIRS and separating_directions.suits(task)
    if answer.q is None and many and task.allows(task.rest):
        contact = on_a_ray(task, None)
        answer = answer if contact is None else spread(task, answer, [contact.motion])
    return None if answer.q is None else answer


def spread(task: Task, answer: Answer, starts: Sequence[Array]) -> Answer:
    """Return an answer, or a better one that a descent over all ways apart finds from it, or from further motions."""
    if not separating_directions.suits(task):
        return answer
    best = _amount(task, answer)
    for start in starts if answer.q is None else (answer.q, *starts):
        if pacing.over():
            break
        found = separating_directions.descended(task, start, SPREAD * max(task.amount(start), task.unit))
        if found is not None and found.amount < _gained(task, best):
            best = found.amount
            answer = replace(found, stage=STAGE_APART, lower_bound=min(answer.lower_bound, best))
    return answer


def _unturned(task: Task) -> list[Array]:
    """Return the least motion found that turns nothing, if the motion both shifts and turns and one is found."""
    turning = np.asarray(task.spins.any(axis=1))
    if not separating_directions.suits(task) or not turning.any() or turning.all() or not task.allows(task.rest):
        return []
    still = replace(task, limits=frozen(np.where(turning[:, None], 0.0, task.limits)))
    if (least := translations(still)) is not None and least.q is not None:  # exact
        return [least.q]
    found = separating_directions.descended(still, task.start, LARGE * task.size)
    return [] if found is None else [found.motion]


def _closed(task: Task, answer: Answer, gap: float) -> bool:
    """Tell whether a motion's bound is its amount already, or as near as that."""
    return answer.lower_bound >= _amount(task, answer) * (1.0 - gap)


def _doubtful(task: Task, answer: Answer) -> bool:
    """Tell whether local searches may have missed the least motion."""
    if answer.stage == direction_search.STAGE:
        return not task.coherent  # no local search, but one that ends where the contact is lost
    large = answer.q is not None and task.amount(answer.q) > LARGE * task.size
    return bool(task.keep_out) or task.part_pairs > 1 or large or answer.stage != DESCENT


def _turned(task: Task, answer: Answer, gap: float, share: float = 1.0) -> tuple[Answer, bool]:
    """Return an answer with a bound by a search over rotations, and whether that is as near as asked."""
    found = least_over_turns(task, upper=answer, gap=gap, share=share)
    if found is None:
        return answer, False
    amount = _amount(task, answer)
    if found.q is not None and found.upper < amount * (1.0 - DEFAULT.nominal):
        better = near(task, found.q)
        if better is not None and better.amount < amount:
            answer = replace(better, stage=TURNED, lower_bound=found.lower)
    answer = replace(answer, lower_bound=min(max(found.lower, answer.lower_bound), _amount(task, answer)))
    return answer, _closed(task, answer, gap)


def _amount(task: Task, answer: Answer) -> float:
    return np.inf if answer.q is None else task.amount(answer.q)


def _gained(task: Task, amount: float) -> float:
    """Return below which amount a motion is better than one known: what counts as met may gain the rest."""
    return amount * (1.0 - GAINED) - DEFAULT.cut * task.size / task.search_rate


def bounded(
    task: Task,
    answer: Answer,
    *,
    aims: Sequence[tuple[float, float]],
    share: float = 1.0,
    timed: bool = False,
    checked: bool = True,
) -> tuple[Answer, Evidence | None]:
    """Return an answer, of a motion or none yet, with a bound by `prove`: better or settled where that is so.

    `aims` are relative gaps between bound and amount that are enough, the finest first, and up to which effort, in
    cells times vertices of a cell's tests; after the last the bound is what it is. `share` is of the efforts, and of
    `CELLS`; where it is `timed` the time given is in place of the last effort; `checked` as of `prove`.
    """
    if task.part_pairs > MOST_PAIRS:
        return answer, None
    known, upper = answer.q, _amount(task, answer)
    better: Answer | None = None
    vain: list[Array] = []  # searched from without a gain: of many pairs, which take long, once
    many = known is not None and task.part_pairs > FEW_PAIRS

    def search(q: Array) -> Array | None:
        nonlocal better
        if known is not None and np.linalg.norm(task.weights * (q - known)) <= CLOSE * upper:
            return None  # the bound is held back by the motion known
        if any(many or np.linalg.norm(task.weights * (q - own)) <= AGAIN * upper for own in vain):
            return None
        found: Answer | None = None
        with suppress(pacing.TimeOverError):
            found = near(task, q)
        if found is None or not found.amount < upper * (1.0 - GAINED):
            vain.append(q)
            return None
        better = found if better is None or found.amount < better.amount else better
        return found.q

    try:
        cells = [(gap, _most(task, effort, share, not checked)) for gap, effort in aims]
        if timed:
            cells[-1] = aims[-1][0], sys.maxsize
        proof = prove(task, upper, aims=cells, search=search, checked=checked)
    except NotImplementedError:  # a motion or amount of the user's own that cannot be enclosed
        return answer, None
    bound = max(proof.lower_bound, answer.lower_bound)
    most = np.linalg.norm(task.weights * np.abs(task.limits).max(axis=1)) if task.weighted else np.inf
    if bound > most:
        bound = np.inf  # the limits allow no motion as large
    if proof.q is not None and better is not None:
        answer = replace(better, stage=STAGE, lower_bound=0.0)
    elif answer.q is None and not np.isfinite(bound) and answer.status is Status.NOT_FOUND:
        answer = replace(answer, status=Status.INFEASIBLE, stage=STAGE)
    bound, kept = min(bound, _amount(task, answer)), None
    if checked and len(task.weights) <= MOST_CHECKED:
        shown = proof.evidence.bound if proof.evidence.bound <= most else np.inf
        if not task.weighted:  # which may be less further out
            shown = proof.lower_bound if np.isinf(shown) else -np.inf
        if bound <= shown * (1.0 + 2.0 * GAP):  # what is claimed is what can be checked; else no evidence goes with it
            bound, kept = min(bound, shown), proof.evidence
    return replace(answer, lower_bound=bound), kept


def _most(task: Task, effort: float, share: float = 1.0, swollen: bool = False) -> int:
    """Return how many cells an effort allows, or a share of it; of parts that are swollen by their clearance fewer."""
    most = CELLS.get(len(task.weights), CELLS_MORE)
    return int(np.clip(share * effort / tested_vertices(task, swollen=swollen), FEWEST, share * most))


def near(task: Task, q: Array) -> Answer | None:
    """Return the least motion that a local search from a motion finds."""
    # it is to beat motions that meet the requirement exactly, so what it gains may not come from the slack
    if separating_directions.suits(task):
        for share in NEAR:
            radius = share * max(task.amount(q), DEFAULT.least_unit * task.unit)
            found = separating_directions.descended(task, q, radius)
            if found is not None:
                return found
        return None
    better = [relaxation.smallest([q]) for relaxation in choices(task, q, near=True)]
    done = [found for found in better if found is not None and task.meets(found.motion, DEFAULT.cut)]
    return min(done, key=lambda own: own.amount, default=None)
