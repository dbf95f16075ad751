"""Why there is no motion: the smallest sets of constraints that clash, and the least relaxation that cures it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, ClassVar

from fcdm_opt import pacing
from fcdm_opt.design.whatif.constraints import Constraint, scene_of
from fcdm_opt.design.whatif.fitting import mending_sizes
from fcdm_opt.design.whatif.search import Clash, ClashSearch, LeastRelaxation, Trial
from fcdm_opt.errors import InputError, known_arguments
from fcdm_opt.geometry.units import measured
from fcdm_opt.plain import Plain
from fcdm_opt.problem import arguments
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.fit import unlike_steps, verdict
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Bounded, Status

KEEPS, UNMET = "no motion keeps ", "the motion alone cannot meet the goal"
MANY = 3  # constraints of which the same is said in one line


@dataclass(frozen=True, eq=False, kw_only=True)
class Conflicts(Plain):
    """Why a problem has no motion."""

    plain_names: ClassVar[tuple[str, ...]] = (
        "constraints", "reason", "clashes", "complete", "relaxations", "deviation", "sizes", "trials", "solves",
        "seconds", "stopped",
    )  # fmt: skip
    plain_kinds: ClassVar[Mapping[str, Any]] = {"constraints": tuple[str, ...]}

    problem: Scene = field(repr=False)
    constraints: tuple[Constraint, ...]  # all that the problem has
    # the smallest sets that clash, by number of constraints; the problem may have larger ones besides. One that is
    # empty says that the motion alone cannot do it
    clashes: tuple[Clash, ...]
    complete: bool  # whether these are all of that size, and none is smaller
    relaxations: tuple[LeastRelaxation, ...] = ()  # of each constraint of the clashes, or what it includes
    # how much less the parts made may be off nominal: `value` is the largest share found of the deviation asked for
    # that can be made good, all constraints kept; 0 where that is only none of it, nan where not even that. Sampled: a
    # larger deviation can be easier
    deviation: LeastRelaxation | None = None
    sizes: Mapping[str, float] = field(default_factory=dict)  # that cure it alone, with the deviations that do
    reason: str = ""  # by how much what is asked is missed at the best pose found, or which widths do not go together
    trials: tuple[Trial, ...] = ()  # where the motion alone cannot do it: whether others, or another goal, can
    solves: int
    seconds: float
    stopped: str = ""  # at what the time given was over, where it was: what is missing was not looked for to the end

    def __str__(self) -> str:
        lines = [self.reason] if self.reason else []
        clashing, useless = dict[str, list[Clash]](), dict[str, list[str]]()  # what is said of many -> of which
        for clash in self.clashes:
            outside = clash.status is Status.OUTSIDE_FIT
            found = "none stays in the fit" if outside else clash.status.words
            some = len(clash.sizes) < sum(map(bool, (self.problem.made or {}).values()))
            of = f" of {', '.join(clash.sizes)}" * (not some)
            tail = " without parts that overlap" * (bool(clash.names) and isinstance(self.problem, Assembly))
            tail += f", at the sizes made{of}" * bool(clash.sizes)
            tail += f" ({'proved' if clash.proved else found})"
            tail += f"; with {' or '.join(clash.sizes)} as drawn one keeps these" * (some and bool(clash.sizes))
            clashing.setdefault(": ".join(filter(None, (tail, clash.reason))), []).append(clash)
        for tail, each in clashing.items():
            several, names = len(each) >= MANY, [own.names for own in each]
            short = [_listed([name.partition(", ")[0] for name in own]) for own in names]
            if several and all(len(own) == 1 for own in names):
                lines.append(f"{KEEPS}any one of {', '.join(short)}{tail}")
            elif several and all(len(own) > 1 for own in names):
                lines.append(f"{KEEPS}{short[0]} together, nor {', nor '.join(short[1:])}{tail}")
            else:
                whole = [f"{KEEPS}{_listed(own)}" if own else UNMET for own in names]
                lines += [f"{x}{' together' * (len(own) > 1)}{tail}" for x, own in zip(whole, names, strict=True)]
        if not self.complete:
            lines.append("there may be others that clash, as few or fewer")
        cures = sorted((one for one in self.relaxations if one.cures), key=lambda one: one.amount)
        lines += [f"to relax alone: {one}" for one in cures]
        lines += [f"to change alone: {own.name} to {own.deviation_text(self.sizes[own.name], self.problem.unit)}"
                  for own in self.problem.sizes if own.name in self.sizes]  # fmt: skip
        if self.deviation is not None:
            value, made = self.deviation.value, self.problem.made or {}
            share = f"{100.0 * value:.6g} % of the" if value > 0.0 else "no share, however small, of the"
            off = [f"{own.name} {own.deviation_text(value * made[own.name], self.problem.unit)}"
                   for own in self.problem.sizes if value > 0.0 and made.get(own.name)]  # fmt: skip
            named = f" ({', '.join(off)})" * bool(off)
            none = ", nor without any deviation" * math.isnan(value)
            lines.append(f"with {share} deviation from nominal{named} a motion is found (sampled){none}")
        lines += [f"try {trial}" for trial in self.trials]
        for own in (own for own in self.relaxations if not own.cures):
            useless.setdefault(own.note, []).append(str(own))
        for note, alike in useless.items():
            none = f"none of {len(alike)}{' other' * bool(cures)} constraints cures it" + f" ({note})" * bool(note)
            lines += [f"to relax alone: {own}" for own in ([none] if len(alike) >= MANY else alike)]
        return "\n".join([*lines, *[f"not looked at to the end: {self.stopped}"] * bool(self.stopped)])

    def to_dict(self) -> dict[str, Any]:
        """Return plain data; nan becomes None and infinity "inf"; constraints are told by their names."""
        return {**super().to_dict(), "constraints": [one.name for one in self.constraints]}


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


@known_arguments
def conflicts(
    problem: Scene | Bounded,
    *,
    certify: bool = False,
    relax: bool = True,
    deviation: bool = True,
    time: float | None = None,
) -> Conflicts:
    """Find out why a problem or an assembly has no motion, or none that stays in the fit in which the parts are drawn.

    Parameters
    ----------
    problem : Problem or Assembly, or a solution of one
        One that cannot be solved; a solution without a motion is asked for its problem.
    certify : bool
        Try to prove by branch and bound what was found by sampling; may take a minute a clash.
    relax : bool
        Look for the least relaxation of each constraint that clashes; takes seconds each where there is no closed
        form.
    deviation : bool
        Look for the largest share of the deviation from nominal that can be made good, too, and of two parts for the
        sizes which alone, made otherwise, cure it.
    time : float, optional
        Wall time in seconds after which all ends, with what is known so far, see `Conflicts.stopped`.

    Raises
    ------
    InputError
        For a problem that has a motion: `drop` tells what its constraints cost.
    TimeOverError
        Where not even the problem's own answer was known in time.
    """
    known, scene = problem if isinstance(problem, Bounded) else None, scene_of(problem)
    for key, value in {"certify": certify, "relax": relax, "deviation": deviation}.items():
        arguments.truth(value, key)
    start, search = perf_counter(), ClashSearch(scene)
    with pacing.within(time):
        whole = known or search.solved(scene, effort="proved")  # as `solve` answers it
        search.inside = whole.verified and not whole.usable
        if whole.usable:
            what = "the problem has a motion: nothing clashes"
            allowed = "a problem without a motion; `drop` tells what each constraint of a solvable one costs"
            amount = f"amount {measured(whole.amount, whole.amount_unit)}"
            raise InputError(what, key="problem", found=amount, allowed=allowed)
        clashes, complete = pacing.in_time(search.smallest, whole, late=None) or search.undivided()
        if certify:
            clashes = [pacing.in_time(search.certified, clash, late=clash) for clash in clashes]
        members = dict.fromkeys(name for clash in clashes for name in clash.names)
        by_name = {one.name: one for one in search.constraints}
        relaxations, asked = list[LeastRelaxation](), [*members] if relax else []
        for name in asked:
            least, weaker = pacing.in_time(search.least_relaxation, by_name[name], late=None), by_name[name].includes
            relaxations += filter(None, [least])
            if least and weaker and not least.cures and weaker not in asked:  # as a keep-out, not its clearance
                asked.append(weaker)
        share, trials = pacing.in_time(search.largest_deviation, late=None) if deviation else None, list[Trial]()
        change = deviation and isinstance(scene, Problem)
        sizes = pacing.in_time(mending_sizes, scene, late={}) if change else {}
        with suppress(pacing.TimeOverError):
            trials += () if members else search.trials()
        stopped = pacing.stopped()
    return Conflicts(
        problem=scene,
        constraints=search.constraints,
        reason=verdict(scene) or unlike_steps(scene) or whole.reason,
        clashes=tuple(clashes),
        complete=complete,
        relaxations=tuple(relaxations),
        deviation=share,
        sizes={name: value for name, value in sizes.items() if math.isfinite(value)},
        trials=tuple(trials),
        solves=search.solves,
        seconds=perf_counter() - start,
        stopped=stopped,
    )
