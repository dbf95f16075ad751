"""The search behind `conflicts`: which sets of constraints clash, and how little relaxation cures them.

The motions that keep a set of constraints become fewer with every constraint that joins it and more with every limit
that is widened and every clearance that is reduced, as each constraint is a condition on the motion alone. So a set is
feasible as soon as one motion keeps all of it, which rules out all its subsets as clashes at once; a clash must have
something that each motion found so far passes (hitting sets: Reiter, Artificial Intelligence 32 (1987) 57-95; Liffiton
and Sakallah, J. Automated Reasoning 40 (2008) 1-33). And what a relaxation cures a larger one cures too, so that
bisection finds the least.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, product
from typing import Any, ClassVar

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.design.whatif.constraints import Constraint, PlainMotion, constraints, excesses, without
from fcdm_opt.design.whatif.fitting import ACCURACY, barred_text, largest_share
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.units import measured, shortest
from fcdm_opt.judge.placed_parts import gone_through
from fcdm_opt.motion.motions import Free
from fcdm_opt.plain import Plain
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Bounded, Effort, Status
from fcdm_opt.solver import any_motion, solve
from fcdm_opt.stages.contact_system import excluding_contacts, violated
from fcdm_opt.tolerances import DEFAULT

Names = frozenset[str]

MOST_ASKED = 400  # solves in search of the smallest clashes; some minutes where each takes as long as it can
MOST_CLASHES = 16  # that are listed
MOST_HALVINGS = 10  # of the machine's steps
LIGHT = 1e-3  # of their weights, for other parameters, while one of them is to pass its limit as little as possible
PROVABLE = 1e-3  # relative: how far below the least relaxation a proof is asked for where halving brought none
MOST_ROUNDS = 4  # of narrowing in, where the solver missed a motion
FINE = 1e-6  # relative, to which the largest share that can be made good is narrowed in: it is sampled anyhow
ENOUGH = 1.01  # times the width that a bracket is to have: a look that far below settles it in spite of rounding
COARSER = 100.0  # how fast the width of a bracket grows that is enough, where answers are neither motions nor proofs
LARGE = 0.5  # of the shortest side of a part: an amount of more nearly takes a part out of what it is in
SHARES = 8  # of the deviation from nominal that are tried before the largest that can be made good is narrowed in


@dataclass(frozen=True, kw_only=True)
class Clash(Plain):
    """Constraints with which alone the goal is impossible, while each can be dropped, or made its weaker one."""

    # as `constraints` names them; a keep-out's clearance includes the keep-out. Empty: the motion cannot do it at all
    names: tuple[str, ...]
    proved: bool  # whether it is proved that no motion keeps them; otherwise none was found
    status: Status  # how the solve with these alone ended
    # the sizes made that are off drawn, with which it is so: each that would undo it as drawn, or, where none would
    # without others, all
    sizes: tuple[str, ...] = ()
    # of several contacts that are restored together, what overlaps where these are closed, see `violated`
    reason: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class LeastRelaxation(PlainMotion):
    """The least relaxation of one constraint, all others kept, that makes the problem solvable."""

    plain_names: ClassVar[tuple[str, ...]] = (
        "name", "cures", "by", "value", "unit", "failing", "impossible", "note",
    )  # fmt: skip

    name: str
    cures: bool  # whether relaxing or dropping this constraint alone makes the problem solvable
    # least relaxation that does, in `unit`: how far a limit is widened or a clearance reduced; for "whole steps" how
    # often the steps are halved. Infinite where only dropping it does, nan where nothing does; where no more than a
    # motion out of the fit is found, that of this motion, which cures nothing
    by: float = math.nan
    value: float = math.nan  # the limit or clearance that is left; nan where it is no number
    unit: str = ""  # "length", "radian", "halvings" or ""
    # largest relaxation that is known not to do; `by` is above it by `Tolerances.requirement`, relative, or what the
    # judge lets pass; by more, which `note` tells, where answers in between are neither motions nor proofs
    failing: float = 0.0
    # largest relaxation that is proved not to do; infinite where it is proved that the constraint cures nothing, nan
    # where nothing is proved. Close to the least one, proofs take too long
    impossible: float = math.nan
    solution: Bounded | None = None  # the least motion of the problem so relaxed
    note: str = ""  # what else there is to say

    @property
    def amount(self) -> float:
        """Amount of the motion that it makes possible; nan without."""
        return math.nan if self.solution is None else self.solution.amount

    def __str__(self) -> str:
        if not self.cures:
            return f"{self.name}: cures nothing alone" + (f" ({self.note})" if self.note else "")
        question = None if self.solution is None else self.solution.question
        lengths, slack = (question.unit, question.contact_slack) if question else ("", 0.0)
        error = (self.unit == "length") * 2.0 * slack + DEFAULT.requirement * self.by  # as `_bracketed` narrows it in
        done = "drop it" if math.isinf(self.by) else f"by {_relaxed_text(self.by, self.unit, lengths, error, 5)}"
        done += "" if math.isnan(self.value) else f" to {_relaxed_text(self.value, self.unit, lengths, error)}"
        amount = measured(self.amount, question.amount_unit if question else "")
        return f"{self.name}: {done}, amount {amount}" + (f" ({self.note})" if self.note else "")


def _relaxed_text(value: float, kind: str, lengths: str, error: float = 0.0, digits: int = 6) -> str:
    """Return a value of a constraint in words, by the kind of its unit and what lengths are in, to within an error."""
    value = shortest(value, error)
    unit = {"radian": "deg", "halvings": "halvings", "length": lengths}.get(kind, "")
    return measured(f"{math.degrees(value) if kind == 'radian' else value:.{digits}g}", unit)


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial(PlainMotion):
    """Another question that was asked where the motion alone cannot do it."""

    plain_names: ClassVar[tuple[str, ...]] = ("change",)

    change: str  # what was changed, with all constraints dropped
    solution: Bounded

    def __str__(self) -> str:
        if not self.solution.usable:
            return f"{self.change}: no motion to use ({barred_text(self.solution)})"
        amount, question = measured(self.solution.amount, self.solution.amount_unit), self.solution.question
        moved = question.motion_texts(self.solution.coordinates.values()).items()
        motion = "; ".join(f"{part} {text}" if len(moved) > 1 else text for part, text in moved)
        large = self.solution.amount > LARGE * min(float(np.ptp(own.vertices, axis=0).min()) for own in question.bodies)
        return f"{self.change}: amount {amount} ({motion}{', nearly out of its place' * large})"


class ClashSearch:
    """Everything that is asked about one problem, and what is known from the answers.

    Sets of constraints are closed: with a constraint they have the weaker one that it includes. Where all of them leave
    motions out of the fit only, motions `inside` are asked for.
    """

    def meets(self, solution: Bounded) -> bool:
        """Whether a motion was found that will do."""
        return solution.usable if self.inside else solution.verified

    def __init__(self, problem: Any) -> None:
        self.problem, self.inside = problem, True  # a whole question that has only motions out of the fit keeps none
        self.constraints = constraints(problem)
        self.names: Names = frozenset(one.name for one in self.constraints)
        self.solves = 0
        self.kept: list[Names] = []  # of each motion found, what it keeps
        self._asked: dict[Names, Bounded] = {}
        weaker = {one.name: one.includes for one in self.constraints}
        self.chains: list[list[Names]] = []  # of each strongest constraint, closed sets from the weakest on
        self.chosen: dict[Names, str] = {}  # the strongest constraint of each such set
        for name in [name for name in weaker if name not in weaker.values()]:
            chain = [name]
            while weaker[chain[0]]:
                chain.insert(0, weaker[chain[0]])
            self.chains.append([frozenset(chain[: k + 1]) for k in range(len(chain))])
            self.chosen.update(zip(self.chains[-1], chain, strict=True))

    def solved(self, problem: Any, *, certify: bool = False, effort: Effort = "quick") -> Bounded:
        """Return the answer to a problem; what a motion keeps is remembered."""
        return self._noted(partial(solve, problem, certify=certify, effort="proved" if certify else effort))

    def _noted(self, solving: Callable[[], Bounded]) -> Bounded:
        with pacing.part_of(f"asking what clashes, {self.solves} answers"):
            solution = solving()
        self.solves += 1
        if self.meets(solution):
            passed = excesses(self.problem, solution)
            self.kept.append(frozenset(name for name, value in passed.items() if value == 0.0))
        return solution

    def answer(self, names: Names) -> Bounded:
        """Return the answer with these constraints alone."""
        if names not in self._asked:
            self._asked[names] = self.solved(without(self.problem, self.names - names))
        return self._asked[names]

    def feasible(self, names: Names) -> bool:
        """Tell whether a motion keeps these constraints; known as soon as one motion keeps them, the least or not."""
        if any(names <= kept for kept in self.kept):
            return True
        if names not in self._asked and isinstance(self.problem, Problem):
            found = self._noted(partial(any_motion, without(self.problem, self.names - names)))
            if self.meets(found):
                return True
            if not found.status.found:  # else a smaller one may do
                self._asked[names] = found
        return self.meets(self.answer(names))

    def smallest(self, whole: Bounded) -> tuple[list[Clash], bool]:
        """Return the smallest clashes, and whether these are all.

        Sets are tried by size, so that all smaller ones are feasible when a clash is found, and weaker constraints
        before those that include them. Where one constraint less leaves a motion, every clash has it: with many sets of
        a size others are not asked. Contacts that exclude each other are what a solve tells, and nothing else is asked.
        """
        self._asked[self.names] = whole
        contacts = [one.name for one in self.constraints if one.name.startswith("contact ")]
        if contacts and (excluding := excluding_contacts(self.problem)):
            return self._clashes([frozenset(contacts[k] for k in group) for group in excluding[:MOST_CLASHES]]), False
        shared: list[list[Names]] | None = None
        for size in range(len(self.chains) + 1):
            clashing: list[Names] = []
            if shared is None and math.comb(len(self.chains), size) > len(self.chains):
                shared = [chain for chain in self.chains if self.feasible(self.names - chain[-1])]
            for names in self._sets(size, shared or []):
                if any(clash <= names for clash in clashing):
                    continue
                if self.solves > MOST_ASKED:
                    clashing = clashing or [self._irreducible()]
                    return self._clashes(clashing), False
                if not self.feasible(names):
                    clashing.append(names)
                    if len(clashing) == MOST_CLASHES:
                        return self._clashes(clashing), False
            # a later motion may refute
            clashing = [names for names in clashing if not any(names <= kept for kept in self.kept)]
            if clashing:
                return self._clashes(clashing), True
        return self.undivided()

    def undivided(self) -> tuple[list[Clash], bool]:
        """Return all constraints as one clash, where there was no time to look for smaller ones, see `smallest`."""
        return self._clashes([self.names]), False

    def _sets(self, size: int, shared: Sequence[list[Names]]) -> Iterator[Names]:
        """Yield all closed sets with constraints of `size` chains, the `shared` among them, with weaker ones first."""
        for chains in combinations(self.chains, size):
            if not all(chain in chains for chain in shared):
                continue
            for levels in sorted(product(*(range(len(chain)) for chain in chains)), key=sum):
                yield frozenset().union(*(chain[level] for chain, level in zip(chains, levels, strict=True)))

    def _irreducible(self) -> Names:
        """Return a clash from which nothing can be dropped, by dropping one after the other."""
        names = self.names
        for chain in self.chains:
            for level in (frozenset[str](), *chain[:-1]):
                fewer = names - chain[-1] | level
                if not self.feasible(fewer):
                    names = fewer
                    break
        return names

    def _clashes(self, clashing: list[Names]) -> list[Clash]:
        made = []
        for names in clashing:
            found = self.answer(names)
            status, why = found.status, () if found.status.found else violated(found.question)
            listed = [self.chosen[max(parts, key=len)] for chain in self.chains
                      if (parts := [level for level in chain if level <= names])]  # fmt: skip
            proved, sizes = status is Status.INFEASIBLE, self._sizes(names)
            made.append(Clash(names=tuple(listed), proved=proved, status=status, sizes=sizes, reason="; ".join(why)))
        return made

    def _sizes(self, names: Names) -> tuple[str, ...]:
        """Return the sizes made with which some constraints clash, see `Clash`."""
        off = [size.name for size in self.problem.sizes if (self.problem.made or {}).get(size.name)]
        kept = without(self.problem, self.names - names)

        def undone() -> list[str]:
            return [name for name in off if self.meets(solve(kept.with_sizes({name: 0.0}), effort="quick"))]

        return tuple(pacing.in_time(undone, late=off) or off)

    def certified(self, clash: Clash) -> Clash:
        """Return a clash with a proof where branch and bound has one."""
        if clash.proved:
            return clash
        closed = frozenset().union(*(level for level, name in self.chosen.items() if name in clash.names))
        status = self.solved(without(self.problem, self.names - closed), certify=True).status
        return replace(clash, proved=status is Status.INFEASIBLE, status=status)

    def least_relaxation(self, constraint: Constraint) -> LeastRelaxation:
        """Return the least relaxation of a constraint, all others kept, with what the motion then goes through."""
        name, inside = constraint.name, self.inside
        dropped = self.answer(self.names - {name} - {own.name for own in self.constraints if own.includes == name})
        self.inside = inside or dropped.usable
        found = self._relaxation(constraint, dropped)
        self.inside = inside
        if found.solution is not None and not found.solution.usable:
            return replace(found, cures=False, note="any motion found then leaves the place it is drawn in")
        passed = gone_through(found.solution) if found.solution is not None else []
        through = {one: " and ".join(other for first, other in passed if first == one) for one, _ in passed}
        notes = (f"straight there {one} goes through {others}" for one, others in through.items())
        return replace(found, note="; ".join(filter(None, (found.note, *notes))))

    def _relaxation(self, constraint: Constraint, dropped: Bounded) -> LeastRelaxation:
        name = constraint.name
        common = LeastRelaxation(name=name, cures=self.meets(dropped), unit=constraint.unit, solution=dropped)
        if not self.meets(dropped):
            impossible = math.inf if dropped.status is Status.INFEASIBLE else math.nan
            note = f"{'at 0' if math.isfinite(constraint.most) else 'without it'}: {dropped.status.words}"
            return replace(common, failing=math.inf, impossible=impossible, note=note, solution=None)
        if not constraint.unit:
            missed = excesses(self.problem, dropped)[name]
            note = f"missed by {measured(missed, self.problem.unit)} then" * (0.0 < missed < math.inf)
            return replace(common, by=math.inf, failing=math.nan, note=note)
        if constraint.unit == "halvings":  # what coarser steps reach finer ones reach too; which are tried is sampled
            for count in range(1, MOST_HALVINGS + 1):
                finer, _ = self._relaxed(constraint, count)
                if self.meets(finer):
                    return replace(common, by=float(count), failing=count - 1.0, solution=finer)
            return replace(common, by=math.inf, failing=float(MOST_HALVINGS))
        return self._bracketed(constraint, common)

    def _relaxed(self, constraint: Constraint, by: float, **changes: Any) -> tuple[Bounded, float]:
        """Return the answer with a constraint relaxed, and by how much it is passed; infinite without a motion."""
        relaxed = constraint.changed(self.problem, by)
        solution = self.solved(relaxed.changed(**changes) if changes else relaxed)
        return solution, excesses(self.problem, solution)[constraint.name] if self.meets(solution) else math.inf

    def _bracketed(self, constraint: Constraint, common: LeastRelaxation) -> LeastRelaxation:
        """Narrow in the least relaxation between one that does and one that does not.

        Every motion that is found shows a relaxation that does: that by which it passes the constraint. Where that is
        less than it was allowed to, it may be the least, so that the next look is just below; else the bracket is
        halved.
        """
        assert common.solution is not None
        # twice what the judge lets pass, of the constraint itself and of the contact: a longer motion opens it
        longer = 1.0 + self.problem.size / self.problem.turning_length if constraint.parameter else 1.0
        fuzz, best, best_by = 2.0 * constraint.slack * longer, common.solution, math.inf
        low, high = 0.0, min(excesses(self.problem, best)[constraint.name], constraint.most)
        nearest = self._nearest(constraint, high)
        high = min(high, nearest)
        impossible = 0.0 if self._asked[self.names].status is Status.INFEASIBLE else math.nan
        first = near = max(fuzz if math.isfinite(nearest) else fuzz / 2.0, DEFAULT.requirement * high)
        step, unsure = near if high < constraint.most else math.inf, False
        for _ in range(MOST_ROUNDS):
            while high - low > ENOUGH * near:
                by = max(high - step, (low + high) / 2.0)
                solution, passed = self._relaxed(constraint, by)
                if self.meets(solution):
                    best, best_by = solution, by
                    high = max(min(by, passed), low)
                    step = near if high < by - near else math.inf
                else:
                    low, step = by, math.inf
                    if solution.status is Status.INFEASIBLE:
                        impossible = by
                    elif solution.status is not Status.OUTSIDE_FIT:  # nearer it cannot be told, and that takes seconds
                        near, unsure = max(near * COARSER if unsure else near, fuzz), True
            if impossible >= (1.0 - PROVABLE) * low:
                break
            by = (1.0 - PROVABLE) * high
            solution, passed = self._relaxed(constraint, by)
            if solution.status is Status.INFEASIBLE:
                impossible = by
            if not self.meets(solution):
                break
            best, best_by = solution, by  # so that what failed above it was missed by the solver
            high = min(by, passed)
            low = min(high, 0.0 if math.isnan(impossible) else impossible)
        for by in (high, min(high + fuzz, constraint.most)):  # at the very limit there may be no room for rounding
            if best_by > by:
                solution, _ = self._relaxed(constraint, by)
                if self.meets(solution):
                    best, high = solution, by
                    break
        coarse = near > max(first, fuzz) and high > low
        least = _relaxed_text(low, constraint.unit, self.problem.unit, digits=3)
        note = f"whether less does, down to {least}, is not known" if coarse else ""
        value = constraint.value + constraint.outward * high
        return replace(common, by=high, value=value, failing=low, impossible=impossible, solution=best, note=note)

    def _nearest(self, constraint: Constraint, most: float) -> float:
        """Return by how much the motion with the least size of a parameter passes its limit; infinite if not least."""
        # it passes the limit by least where rest keeps that: all motions are then beyond it
        if not constraint.kept_at_rest or isinstance(self.problem, Assembly):  # whose parts have one weight each
            return math.inf
        weights = {own.name: own.weight * LIGHT for own in self.problem.coordinates}
        weights[constraint.parameter] /= LIGHT
        return self._relaxed(constraint, most, amount="weighted", weights=weights)[1]

    def largest_deviation(self) -> LeastRelaxation | None:
        """Return the largest share found of the deviation from nominal that can be made good; None without deviation.

        Whether it can is not monotone: some shares are tried, and from the largest that can the next are narrowed in;
        where none of them can, from none at all, which must then be possible as all are.
        """
        if not self.problem.deviates:
            return None
        solutions: dict[float, Bounded] = {}

        def can(share: float) -> bool:
            try:
                solutions[share] = self.solved(self.problem.deviating(share))
            except InputError:  # the goal does not hold at these sizes
                return False
            return solutions[share].usable

        name, note = "deviation from nominal", "sampled"
        tried = next((k for k in range(SHARES - 1, -1, -1) if can(k / SHARES)), -1)
        if tried < 0:
            return LeastRelaxation(name=name, cures=False, note=note)
        low, high = tried / SHARES, (tried + 1) / SHARES
        if tried or can(ACCURACY):  # what less leaves is what the judge lets pass
            low, high = largest_share(can, max(low, ACCURACY), high, accuracy=FINE)
        return LeastRelaxation(
            name=name, cures=low > 0.0, by=1.0 - low, value=low, failing=1.0 - high, solution=solutions[low], note=note
        )

    def trials(self) -> Iterator[Trial]:
        """Ask, with all constraints dropped, whether any motion can do it, and whether another goal can be met."""
        bare, several = without(self.problem, self.names), isinstance(self.problem, Assembly)
        if any(motion.parameters != Free().parameters for motion in bare.motions.values()):
            every = {"motions": dict.fromkeys(bare.motions, Free())}
            free = every if several else {"motion": Free(), "weights": None, "published": None}
            change = f"{'all motions' if several else 'motion'} free = true"
            yield Trial(change=change, solution=self.solved(bare.changed(**free, amount="weighted")))
        for goal in () if several else ("touch", "clear"):
            if goal != self.problem.goal:
                yield Trial(change=f'goal "{goal}"', solution=self.solved(bare.changed(goal=goal, features=None)))
