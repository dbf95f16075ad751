"""The stages in their order, least effort first: the first that settles a task answers it."""

from __future__ import annotations

from collections.abc import Callable

from fcdm_opt.model.task import Answer, Task
from fcdm_opt.stages import models
from fcdm_opt.stages.branching import branch_and_bound, least_apart
from fcdm_opt.stages.descent import descent
from fcdm_opt.stages.direction_search import least_direction
from fcdm_opt.stages.full import full
from fcdm_opt.stages.shift import shift
from fcdm_opt.stages.translations import translations
from fcdm_opt.stages.turns import turns

STAGES: dict[str, Callable[[Task], Answer | None]] = {
    "satisfied": models.satisfied,
    "shift": shift,
    "straight": models.straight,
    "translations": translations,
    "one parameter": models.one_parameter,
    "rotations": turns,
    "descent": descent,
    "ways apart": least_apart,
    "directions": least_direction,
    "branch and bound": branch_and_bound,
    "nlp": models.nonlinear,
    "full": full,  # the yardstick: "auto" does not take it
}
