"""The stages in their order, least effort first: the first that settles a task answers it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

from fcdm_opt import pacing
from fcdm_opt.errors import InputError
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.solution import Status
from fcdm_opt.stages.branching import branch_and_bound, least_apart
from fcdm_opt.stages.contact_system import contact_system, translations
from fcdm_opt.stages.descent import descent
from fcdm_opt.stages.direction_search import least_direction
from fcdm_opt.stages.full import full
from fcdm_opt.stages.linear import shift, straight
from fcdm_opt.stages.rays import one_parameter
from fcdm_opt.stages.relaxation import nonlinear
from fcdm_opt.stages.turns import turns
from fcdm_opt.tolerances import DEFAULT


def satisfied(task: Task) -> Answer | None:
    """Stage 0: nothing to do."""
    if not task.met_at_rest:
        return None
    return task.answer(task.rest, "0: met without motion", modelled=task.modelled(), status=Status.ALREADY_SATISFIED)


StageName = Literal[
    "satisfied", "together", "shift", "straight", "translations", "one parameter", "rotations", "descent", "ways apart",
    "directions", "branch and bound", "nlp", "full",
]  # fmt: skip
STAGES: dict[str, Callable[[Task], Answer | None]] = {
    "satisfied": satisfied,
    "together": contact_system,  # several contacts at once: nothing after it takes them
    # linear in the motion: closed forms and least distances
    "shift": shift,
    "straight": straight,
    "translations": translations,
    # marching to the first contact
    "one parameter": one_parameter,
    # translations exact, rotations searched
    "rotations": turns,
    # local searches
    "descent": descent,
    "ways apart": least_apart,
    "directions": least_direction,
    # everywhere
    "branch and bound": branch_and_bound,
    # whatever else there is
    "nlp": nonlinear,
    "full": full,  # the yardstick: "auto" does not take it
}
"""Each answers a `Task`, or returns None where the task is not its own."""


def settled(task: Task, model: str = "auto") -> Answer:
    """Return the answer of the first stage that settles a task, or of the one that is forced.

    Where none settles it, or the time given is over before, the last that answers at all, with the best bound. Raises
    `InputError` where the stage that is forced does not take the task.
    """
    last: Answer | None = None
    if task.joints and model not in ("auto", "satisfied", "together"):
        what = "this stage knows one contact, not several at once"
        raise InputError(what, key="model", found=model, allowed='"auto" or "together"')
    for name in [name for name in STAGES if name != "full"] if model == "auto" else [model]:
        pacing.at(f"searching: {name}" if name != "nlp" else "searching: nonlinear program")
        try:
            pacing.check()
            answer = STAGES[name](task)
        except pacing.TimeOverError:
            return best_so_far(task, last)
        if answer is None:
            continue
        last = answer if last is None else replace(answer, lower_bound=max(answer.lower_bound, last.lower_bound))
        if answer.settles:
            return answer
    if last is None:
        allowed = '"auto", or "nlp" for any problem'
        raise InputError("this stage does not settle the problem", key="model", found=model, allowed=allowed)
    return last


def best_so_far(task: Task, known: Answer | None = None) -> Answer:
    """Return the best that is known of a task whose search was left at the time limit: nothing is impossible."""
    bound = max(task.displacement_bound, 0.0 if known is None else known.lower_bound)
    stage = "left at the time limit"
    for answer in [*([known] if known is not None else []), *task.found]:
        if answer.q is not None and task.allows(answer.q) and task.meets(answer.q, DEFAULT.requirement):
            return replace(answer, status=Status.SOLVED, stage=stage, lower_bound=min(bound, answer.amount))
    return Answer(Status.NOT_FOUND, None, stage, bound)
