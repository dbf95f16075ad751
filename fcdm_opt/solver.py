"""The main path: from a problem, or an assembly, to a verified solution. Start reading here."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any, Literal, NamedTuple, TypedDict, Unpack, overload

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.assembling import assembled
from fcdm_opt.errors import InputError, UnsolvedError, expected, known_arguments, known_word
from fcdm_opt.judge.certificate import judged
from fcdm_opt.judge.engagement import outside_fit
from fcdm_opt.judge.multipliers import shows, smallest_by_multipliers
from fcdm_opt.model.mesh_error import cannot_be_restored, facets_known, too_wide, with_mesh_error
from fcdm_opt.model.reported import reported
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.model.templates import building
from fcdm_opt.model.true_faces import (
    Exchange,
    balanced_on_true_faces,
    has_round_faces,
    met_by_facets_only,
    points_of_true_faces,
)
from fcdm_opt.problem.active_parts import BATCH_SIZE, expand_active_parts, with_insides, with_parts
from fcdm_opt.problem.arguments import is_real, truth
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.contacts_restored import RESTORED, is_of_plane_faces, restores, restoring_motion, touching_again
from fcdm_opt.problem.evidence import Multipliers, ProofData
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import EFFORTS, IMPOSSIBLE, Bounded, Effort, Solution, Status
from fcdm_opt.stages.after_weighted import another_amount, in_steps, nearest_weighted
from fcdm_opt.stages.branching import GAP, MOST_CHECKED, SHOWN_GAP, SHOWN_SHARE, confirmed, proved
from fcdm_opt.stages.contact_system import check_uniqueness, least_restoring, proof_of
from fcdm_opt.stages.order import STAGES, StageName, best_so_far, settled
from fcdm_opt.tolerances import DEFAULT

MOST_PROVED = 3  # times that what a proof finds is looked at on true faces
MOST_OF_TIME = 0.6  # share of it in which true faces are looked for: else there is none for facets
MOST_INSIDES = 8  # bodies inside of solids, as often as an answer lies in one
SHOWN_SECONDS = 1.0  # that such a proof about large meshes may take


class How(TypedDict, total=False):
    """Arguments of `solve`."""

    model: Literal["auto"] | StageName
    certify: bool
    effort: Effort
    seconds: float | None
    time: float | None
    throw: bool


@overload
def solve(problem: Problem, **how: Unpack[How]) -> Solution: ...
@overload
def solve(problem: Assembly, **how: Unpack[How]) -> AssemblySolution: ...
@overload
def solve(problem: Scene, **how: Unpack[How]) -> Bounded: ...
@known_arguments
def solve(
    problem: Scene,
    *,
    model: Literal["auto"] | StageName = "auto",
    certify: bool = False,
    effort: Effort = "proved",
    seconds: float | None = None,
    time: float | None = None,
    throw: bool = False,
) -> Bounded:
    """Find the smallest motion that meets a problem's requirement, or an assembly's, and have it judged.

    Parameters
    ----------
    problem : Problem or Assembly
    model : "auto" or a key of `STAGES`
        "auto" takes the first stage that settles the case; a stage's name forces it. Of an assembly whose contacts
        share motions, which are one program, "auto".
    certify : bool
        Prove until `Solution.lower_bound` is within 1e-4 of the amount, or the time given is over, and keep what
        proves it as `Solution.evidence`. Of an assembly each contact of a part with the one that it follows.
    effort : "proved" or "quick"
        "proved": without `certify` too the least motion is looked for everywhere, and bounded: of one and two
        parameters within 1 % of the amount, of more and of large parts as near as some seconds of work bring it, see
        `Solution.gap`.
        "quick": the first motion that the stages find, for thousands of questions; its bound is what they know.
        A forced `model` is quick.
    seconds : float, optional
        Wall time of the proof, of an assembly of each contact's. Without, it ends after a number of looks that does not
        depend on the machine, with `certify` about a minute's.
    time : float, optional
        Wall time after which the whole search ends, with the best motion and bound so far, see `Solution.stopped`; what
        was found is judged in what is left and a tenth more, or NOT_VERIFIED. An enclosing `pacing.within` limits
        several calls together; it raises `TimeOverError`, unless there is a `time` here too, which may be infinite.
    throw : bool
        Raise `UnsolvedError` where the solution is not usable.

    Raises
    ------
    InputError
        For arguments that are not known, and a forced stage that does not settle the problem.
    UnsolvedError
        With `throw`, where no motion was found or the judge rejected it.
    """
    how = _How(model, certify, effort, seconds)
    _check(problem, how)
    solution = _in_time(problem, how, time)
    if throw and not solution.usable:
        raise UnsolvedError(solution)
    return solution


def any_motion(problem: Problem) -> Solution:
    """Return the first motion that the stages find, judged, where the least is not asked for."""
    return _in_time(problem, _How("auto", certify=False, effort="quick", seconds=None, confirm=False), None)


def has_motion(problem: Problem) -> bool:
    """Tell whether the stages find a motion that stays in the fit, which the judge is not asked about.

    Raises `TimeOverError` where the enclosing time limit is met before.
    """
    how = _How("auto", certify=False, effort="quick", seconds=None, judge=False, confirm=False)
    solution = _least(problem, how)
    if solution.stopped:
        raise pacing.TimeOverError
    return _may_be_used(solution, how)


def _may_be_used(solution: Solution, how: _How) -> bool:
    """Tell whether a motion was found that stays in the fit and, where it is asked, passed the judge."""
    return solution.usable if how.judge else solution.status.found and not outside_fit(solution)


def _in_time(problem: Scene, how: _How, time: float | None) -> Any:
    answered: Any = _several if isinstance(problem, Assembly) else _answered
    with pacing.within(time):
        solution: Bounded = answered(problem, how)
        if solution.stopped and time is None:  # whoever asked would take it for all that can be had
            raise pacing.TimeOverError
    return solution


def _several(assembly: Assembly, how: _How) -> AssemblySolution:
    """Return the solution of an assembly, of which contacts are problems of their own."""
    quick = how._replace(certify=False, effort="quick")
    as_asked, at_once = (partial(_answered, how=own) for own in (how, quick))
    return assembled(assembly, as_asked, at_once, model=how.model, certify=how.certify, prove=how.effort == "proved")


def _answered(problem: Problem, how: _How) -> Solution:
    """Return the least solution, with what facets of round faces leave open of it."""
    quick, watch = how.effort == "quick", _Watch()
    if not quick and pacing.limited():
        facets_known(problem)
    found = with_mesh_error(_least(problem, how), partial(_solved_again, how), certify=how.certify, quick=quick)
    watch.lap("solve")
    others = sum(watch.seconds.values()) - sum(found.seconds.values())  # questions that led to it, about true faces
    return replace(found, seconds={**found.seconds, "solve": found.seconds.get("solve", 0.0) + max(others, 0.0)})


def _least(problem: Problem, how: _How) -> Solution:
    """Return the least solution, of true faces where one is found in time."""
    wide, solution = has_round_faces(problem) and pacing.in_time(too_wide, problem, late=True), None
    if not wide:
        solution = _of_true_faces(problem, how)
    if solution is None and not (wide or problem.motion.shifts) and touching_again(problem) is not None:
        solution = _not_restored(problem, how)
    if solution is None and problem.touches_between_facets:
        status, bound = (Status.INFEASIBLE, math.inf) if cannot_be_restored(problem) else (Status.NOT_FOUND, 0.0)
        solution = Solution(problem=problem, status=status, lower_bound=bound, pair=problem.target, stage=RESTORED)
    if solution is None:
        solution = _solved_all(problem, how)
        if wide and _may_be_used(solution, how):  # as where one part is lifted off the other
            solution = _of_true_faces(problem, how) or solution
        elif not (wide or _may_be_used(solution, how)) and is_of_plane_faces(problem):
            touching = touching_again(problem)
            solution = (touching and _restored(problem, touching, how)) or solution
        elif met_by_facets_only(solution):  # as of a pin that turns about its own axis
            why = "the only motion found brings facets together, and no true round faces"
            rest = Solution(problem=solution.problem, status=Status.NOT_FOUND, pair=solution.pair)
            solution = replace(rest, active=(why,), stage=solution.stage, seconds=solution.seconds)
    return solution


def _of_true_faces(problem: Problem, how: _How) -> Solution | None:
    """Return the solution with parts that are exact where their round faces meet; None where none is known in time."""
    if not has_round_faces(problem):
        return None
    if (touching := touching_again(problem)) is not None:
        if is_of_plane_faces(problem):
            return None  # facets tell as much, unless they meet elsewhere
        turns = not problem.motion.shifts
        known = _restored(problem, touching, how) if turns or not how.certify else None  # which has no evidence
        if turns or (known is not None and known.lower_bound >= known.amount):
            return known
        found = _of_true_faces(touching, how)
        again = found is not None and found.transform is not None and restores(problem, found.transform)
        return found if again else _restored(problem, touching, how)
    asked, tried = problem, None
    for confirm in (False, *[True] * MOST_PROVED):  # a motion that is not the least may lead to points of no matter
        quick = how._replace(certify=False, effort="quick", judge=False, confirm=confirm)
        with pacing.sharing(MOST_OF_TIME):
            solve_parts = partial(_solved_all, how=quick)
            pacing.at("looking where true faces meet")
            points = pacing.in_time(points_of_true_faces, asked, solve_parts, outside_fit, late=None)
            cut_off = pacing.stopped()
        if points is None or points == tried:
            if cut_off and confirm:  # the rest of the time is for facets
                break
            continue
        asked, tried = problem.with_exact_points(points), points
        found = pacing.in_time(_solved_all, asked, how, late=None)
        if found is not None and (
            _may_be_used(found, how) or found.status in IMPOSSIBLE or (found.status.found and pacing.over())
        ):
            return found if found.usable else replace(found, stopped=found.stopped or cut_off)
        if found is not None and found.status.found and problem.goal == "clear" and outside_fit(found):
            return replace(found, status=Status.OUTSIDE_FIT)  # parts within the true ones leave the fit at least
        exchange = Exchange.of(asked)  # a proof may lead to smaller motions, after which true faces overlap elsewhere
        if exchange is not None and found is not None and found.transform is not None:
            asked = exchange.problem if exchange.refine(found.transform) else asked
    return None


def _not_restored(problem: Problem, how: _How) -> Solution:
    """Return why no motion that turns restores all contacts of true faces, as far as it is known."""
    found, answer = restoring_motion([problem]), Answer(Status.NOT_FOUND, None, RESTORED, 0.0)
    if found is None and how.effort == "proved":
        answer = pacing.in_time(check_uniqueness, problem, Task.of(problem), answer, late=answer)
    if found is None:
        why = answer.active or ("all contacts of true faces together were looked at",)
    elif found.nearest is None:
        why = ("the motion that restores all contacts makes parts overlap elsewhere, or leaves them apart",)
    else:
        q = np.where(np.abs(found.nearest) <= DEFAULT.nominal * problem.size / problem.weights, 0.0, found.nearest)
        off = (q < problem.limits[:, 0]) | (q > problem.limits[:, 1])
        names = " and ".join(name for name, beyond in zip(problem.motion.names, off, strict=True) if beyond)
        where = problem.motion.describe(q.tolist(), unit=problem.unit, digits=4)
        why = (f"the motion that restores all contacts ({where}) is beyond the limits of {names}",)
    rest: dict[str, Any] = {"problem": problem, "pair": problem.target, "stage": RESTORED, "active": why}
    return Solution(**rest, status=answer.status, lower_bound=answer.lower_bound)


def _restored(problem: Problem, touching: Problem, how: _How) -> Solution | None:
    """Return the least motion that restores contacts of true faces; None where none is found that can be used."""
    found = pacing.in_time(restoring_motion, [problem], late=None)
    if found is None or found.q is None or (exchange := Exchange.of(touching)) is None:
        return None
    exchange.add(found.points[0])
    asked = exchange.problem
    task = Task.of(asked)
    amount = task.amount(found.q)
    bound = (
        found.bound if problem.motion.shifts or how.effort == "quick" else least_restoring([problem], found.q, amount)
    )
    answer = Answer(Status.SOLVED, found.q, RESTORED, min(bound, amount))
    solution, certificate = judged(reported(asked, task, answer))
    solution = solution.with_certificate(certificate, solution.seconds)
    return solution if solution.usable else None  # as where a keep-out is in the way


def _solved_again(how: _How, problem: Problem, effort: Effort) -> Solution:
    return _solved_all(problem, how._replace(model="auto", certify=False, effort=effort))


def _solved_all(problem: Problem, how: _How) -> Solution:
    """Return the least solution over the pairs of features that the problem may track."""
    asked = problem.alternatives or (problem,)
    if how.seconds is not None:
        how = how._replace(seconds=how.seconds / len(asked))
    if len(asked) == 1:
        return _outside_of_solids(asked[0], how)
    known = [None if one.partial else _least_motion(Task.of(one), how.model) for one in asked]
    solutions, bounds = list[Solution](), list[float]()
    pairs = zip(known, asked, strict=True)
    for answer, one in sorted(pairs, key=lambda pair: 0.0 if pair[0] is None else pair[0].amount):
        least = min((solution.amount for solution in solutions if solution.usable), default=math.inf)
        if answer is not None and least < math.inf and answer.lower_bound >= least * (1.0 - DEFAULT.tie):
            bounds.append(answer.lower_bound)  # not to be proved and judged: another is no larger
        else:
            solutions.append(_outside_of_solids(one, how, answer))
    return _least_of(solutions, bounds)


def _outside_of_solids(problem: Problem, how: _How, answer: Answer | None = None) -> Solution:
    """Return the solution with what is inside of solids that are kept as surfaces, where it is needed."""
    asked, solution = problem, _with_all_that_matters(problem, how, answer)
    for _ in range(MOST_INSIDES):
        pose = np.eye(4) if solution.transform is None else solution.transform
        lies = pacing.in_time(with_insides, problem, pose, late=None)
        if lies is None or (solution.transform is None and problem is not asked):
            break
        problem = lies
        if problem.goal == "touch" and problem.partial:  # where it comes free it touches
            free = _outside_of_solids(problem.changed(goal="clear", clearance=0.0), how).problem
            problem = with_parts(problem, free.active_indices)
        solution = _with_all_that_matters(problem, how)
    if problem is asked:
        return solution
    found = with_parts(asked, solution.problem.active_indices).asked
    if not how.judge:
        return replace(solution, problem=found)
    solution, certificate = judged(replace(solution, problem=found, evidence=None))
    return solution.with_certificate(certificate, solution.seconds)


def _with_all_that_matters(problem: Problem, how: _How, answer: Answer | None = None) -> Solution:
    """Return the solution with as many of the bodies' parts as it and its bound need, see `problem.active_parts`."""
    problem, most = pacing.in_time(expand_active_parts, problem, None, 0.0, late=None) or problem, BATCH_SIZE
    if not problem.partial:
        return _solved(problem, how, answer)
    wanted = not problem.contacts and "touch" in (problem.goal, problem.pair)
    while True:
        answer = _least_motion(task := Task.of(problem), how.model)
        impossible = answer.status is Status.INFEASIBLE
        if impossible and not wanted:
            break  # further parts only take motions away; where any contact will do they offer some
        pose = None if answer.q is None else task.transform(answer.q)
        apart = task.gap(task.rest) >= 0.0  # else what parts those modelled does all that a contact needs
        least = answer.amount if apart and (impossible or pose is not None) else 0.0
        further = pacing.in_time(expand_active_parts, problem, pose, least, most, late=None)
        late = pacing.over()
        if further is None:
            break
        problem, most = further, 2 * most
    solution = _solved(problem, how, answer)
    if wanted and apart and (late or solution.status is Status.INFEASIBLE):  # of the parts modelled: others may touch
        status = Status.NOT_FOUND if solution.status is Status.INFEASIBLE else solution.status
        return replace(solution, status=status, lower_bound=0.0)
    return solution


class _How(NamedTuple):
    """How a problem is to be solved: `solve`'s arguments."""

    model: str
    certify: bool
    effort: Effort
    seconds: float | None
    judge: bool = True
    confirm: bool = True  # look whether a motion that was found quickly is the least


class _Watch:
    """Wall time of the steps, that of building templates apart."""

    def __init__(self) -> None:
        self.seconds = {"build": 0.0}
        self._last = perf_counter(), building()

    def lap(self, step: str) -> None:
        """Note the time since the last step."""
        now = perf_counter(), building()
        built = now[1] - self._last[1]
        self.seconds["build"] += built
        self.seconds[step] = now[0] - self._last[0] - built
        self._last = now


def _solved(problem: Problem, how: _How, answer: Answer | None = None) -> Solution:
    """Return the solution of a problem that tracks at most two features: the main path, step by step."""
    watch = _Watch()
    task = Task.of(problem)
    answer = answer or _least_motion(task, how.model)  # met already, linear, march, local, global: see `STAGES`
    watch.lap("solve")
    answer, evidence = _proved(problem, task, answer, how)
    with suppress(pacing.TimeOverError):
        answer, evidence = _staying_in_fit(problem, task, answer, evidence, how)
    answer = balanced_on_true_faces(problem, task, answer, last=how.judge)
    answer = in_steps(task, answer, partial(_least_motion, model=how.model))
    stopped = pacing.stopped()
    known = problem.amount != "displacement"  # of which the checker knows nothing
    with pacing.telling():
        solution = reported(problem, task, answer, evidence if known else None, stopped)
    watch.lap("prove")
    if not how.judge:
        return solution
    if isinstance(shown := solution.evidence, Multipliers) and not shows(solution, shown):
        solution = replace(solution, evidence=None)  # more is known by other means
    solution, certificate = judged(solution)
    watch.lap("verify")
    return solution.with_certificate(certificate, watch.seconds)


def _staying_in_fit(
    problem: Problem, task: Task, answer: Answer, evidence: ProofData | None, how: _How
) -> tuple[Answer, ProofData | None]:
    """Return an answer that stays in the fit where the one found leaves it, and what proves it; else that one.

    As where a bar is lifted out of its tray that a turn lets in: the parameter that changes most is held, one after the
    other.
    """
    found, held, shown = answer, task, None
    while task.spins.any() and not task.joints and how.model == "auto" and found.q is not None:
        if not outside_fit(reported(problem, task, found)):
            break
        most = int(np.abs(task.weights * found.q).argmax())
        limits = np.where(np.arange(len(task.weights))[:, None] == most, 0.0, held.limits)
        if not limits.any() or task.limits[most].prod() > 0.0:
            return answer, evidence
        held = replace(task, limits=limits)
        found = _proved(problem, held, _least_motion(held, how.model), how._replace(certify=False, effort="quick"))[0]
    if found is answer or found.q is None:
        return answer, evidence
    found = replace(found, lower_bound=min(answer.lower_bound, found.amount))
    for asked in (held, task) if how.effort == "proved" else ():  # a smaller one may leave the fit again
        again, proof = _proved(problem, asked, found, how._replace(certify=how.certify and asked is task))
        if again.q is not None and not outside_fit(reported(problem, task, again)):
            bound = min(again.lower_bound if asked is task else answer.lower_bound, again.amount)
            found, shown = replace(again, lower_bound=bound), proof
    return found, shown


def _least_motion(task: Task, model: str) -> Answer:
    """Return the least motion that the stages find: by the weighted amount, and from there by the task's own."""
    if task.weighted or model == "full":
        return settled(task, model)
    nearest = nearest_weighted(task)
    weighted = settled(nearest, model)
    try:
        return another_amount(task, confirmed(nearest, weighted) if model == "auto" else weighted)
    except pacing.TimeOverError:
        return best_so_far(task)


def _proved(problem: Problem, task: Task, answer: Answer, how: _How) -> tuple[Answer, ProofData | None]:
    """Return the answer, or a better one, with the bound that is asked for, and what proves it if that is asked for."""
    pacing.at("proving that nothing smaller does")
    with suppress(pacing.TimeOverError), pacing.within(how.seconds, share=1.0):
        return _bounded(problem, task, answer, how)
    return answer, None


def _bounded(problem: Problem, task: Task, answer: Answer, how: _How) -> tuple[Answer, ProofData | None]:
    """Return the same, where the time does for it."""
    if task.joints:
        answer = check_uniqueness(problem, task, answer) if how.effort == "proved" else answer
        return answer, proof_of(problem, task, answer) if how.certify else None
    if how.certify:
        cells, before = len(task.weights) <= MOST_CHECKED, answer.q
        if not cells and (shown := _by_multipliers(problem, answer)):
            return shown
        answer, evidence = proved(task, answer, gap=GAP, timed=how.seconds is not None)
        if cells or answer.q is before:
            return answer, evidence
        return _by_multipliers(problem, answer) or (answer, None)
    if how.model != "auto":
        return answer, None
    if how.effort == "quick":
        return confirmed(task, answer) if how.confirm else answer, None
    with pacing.within(SHOWN_SECONDS if problem.partial else None, share=1.0):
        return proved(task, answer, gap=SHOWN_GAP, timed=how.seconds is not None, share=SHOWN_SHARE)[0], None


def evidence_of(problem: Problem) -> ProofData | None:
    """Return what shows the least amount of a problem, found anew; None where there is none, or no time is left."""
    task = Task.of(problem)
    return _proved(problem, task, _least_motion(task, "auto"), _How("auto", True, "proved", None))[1]


def _by_multipliers(problem: Problem, answer: Answer) -> tuple[Answer, ProofData] | None:
    """Return an answer with its amount as bound, and what shows that, if multipliers of its contact do in time."""
    found = None if answer.q is None else pacing.in_time(smallest_by_multipliers, problem, answer.q, late=None)
    return found and (replace(answer, lower_bound=found[0]), found[1])


def _least_of(solutions: list[Solution], others: list[float]) -> Solution:
    """Return the least of the solutions that track two of several features each; its problem names them.

    `others`: lower bounds of those that were not proved and judged.
    """
    best = min(solutions, key=lambda solution: (not solution.usable, not solution.status.found, solution.amount))
    bound = min([*others, *(solution.lower_bound for solution in solutions)])
    return best if bound == best.lower_bound else replace(best, lower_bound=bound)


def _check(problem: Scene, how: _How) -> None:
    if isinstance(problem, list | tuple):
        allowed = "a Problem or an Assembly; `solve_all` takes several"
        raise InputError("this is for one question", key="problem", found=type(problem).__name__, allowed=allowed)
    expected(problem, (Problem, Assembly), "problem")
    for key, value, known in (("model", how.model, ("auto", *STAGES)), ("effort", how.effort, EFFORTS)):
        known_word(value, known, f"unknown {key}", key=key)
    truth(how.certify, "certify")
    if how.certify and how.effort == "quick":
        raise InputError("a quick search proves nothing", key="effort", found="quick", allowed='"proved" with certify')
    if how.seconds is not None and not (is_real(how.seconds) and 0.0 < how.seconds < math.inf):
        raise InputError("not a time", key="seconds", found=how.seconds, allowed="a number > 0, or None")


solve_assembly = solve
"""The same by the name that it once had for assemblies."""
