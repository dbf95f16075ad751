"""The main path for several parts: contacts in groups that share motions, each as that of two parts or all at once.

A contact of a part with the one that it follows depends on that part's motion alone: it is a problem of two parts, and
what is proved of it holds. Contacts that share motions, as those of a loop do, are one program in all their parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import hypot, nan
from time import perf_counter
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.errors import InputError, UnsolvedError, known_arguments
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.facet_errors import known_to
from fcdm_opt.judge.certificate import judged
from fcdm_opt.judge.placed_parts import placed, verify_assembly
from fcdm_opt.model.reported import reported
from fcdm_opt.model.task import Task
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.assembly import CLEAR, Assembly, JoinedPair
from fcdm_opt.problem.solution import EFFORTS, Effort, Solution, Status
from fcdm_opt.solver import solve
from fcdm_opt.stages.together import all_at_once
from fcdm_opt.tolerances import DEFAULT


@known_arguments
def solve_assembly(
    assembly: Assembly,
    *,
    certify: bool = False,
    effort: Effort = "proved",
    seconds: float | None = None,
    throw: bool = False,
) -> AssemblySolution:
    """Find the smallest motions together that restore all contacts of an assembly, and have them judged.

    Parameters
    ----------
    assembly : Assembly
    certify : bool
        Prove each contact of a part with the one that it follows to 1e-4 of its amount, as `solve` does.
    effort : "proved" or "quick"
        As of `solve`; "quick": without bounds.
    seconds : float, optional
        Wall time of the proof of each contact that is a problem of its own, as of `solve`.
    throw : bool
        Raise `UnsolvedError` where the solution is not usable.

    Raises
    ------
    InputError
        For arguments that are not known.
    UnsolvedError
        With `throw`, where no motions were found or the judge rejected them.
    """
    if not isinstance(assembly, Assembly):
        raise InputError("expected an Assembly", key="assembly", found=type(assembly).__name__)
    if effort not in EFFORTS:
        raise InputError("unknown effort", key="effort", found=effort, allowed=", ".join(EFFORTS))
    if not isinstance(certify, bool) or (certify and effort == "quick"):
        raise InputError("not to be had", key="certify", found=certify, allowed='True with effort "proved", or False')
    solution = _Solving(assembly, certify, effort, seconds).solution()
    if throw and not solution.usable:
        raise UnsolvedError(solution)
    return solution


class _Met(NamedTuple):
    """How a group of contacts that share motions is met: parameters by part, none without a motion.

    `bound` is of the weighted amount of the group's parts, `open_` what meshes leave open of it; `contacts` are the
    solutions by their pairs.
    """

    status: Status
    q: dict[str, Array]
    bound: float
    stage: str
    active: tuple[str, ...]
    contacts: dict[tuple[str, str], Solution]
    open_: tuple[float, float] = (nan, nan)


class _Solving:
    """One assembly under way."""

    def __init__(self, assembly: Assembly, certify: bool, effort: Effort, seconds: float | None) -> None:
        self._assembly, self._how = assembly, {"certify": certify, "effort": effort, "seconds": seconds}
        self._proving = effort == "proved"
        self._known: dict[tuple[str, str], Solution] = {}

    def solution(self) -> AssemblySolution:
        """Meet all contacts, then whatever overlaps besides, until nothing does."""
        start, pairs = perf_counter(), list(self._assembly.contacts)
        while True:
            groups = [self._met(group) for group in _groups(self._assembly, pairs)]
            q = {part: own for group in groups for part, own in group.q.items()}
            more = self._overlapping(q, pairs) if all(group.q for group in groups) else []
            if not more:
                break
            pairs += more
        took = {"solve": perf_counter() - start}
        start = perf_counter()
        pacing.at("judging the motions found")
        with pacing.judging():
            found = placed(self._reported(groups, q))
            found = found.with_certificate(verify_assembly(found))
        return replace(found, seconds={**took, "verify": perf_counter() - start})

    def _met(self, group: Sequence[JoinedPair]) -> _Met:
        """Meet some contacts that share motions."""
        if len(group) == 1 and self._assembly.is_own(group[0]):
            return self._alone(group[0])
        return self._together(group)

    def _alone(self, pair: JoinedPair) -> _Met:
        """Meet the one contact that a part's motion is for."""
        found, part = self._solved(pair), pair.one
        q = {part: np.array([*found.parameters.values()])} if found.status.found else {}
        weight = self._assembly.weights[part]
        active = tuple(f"{pair}: {told}" for told in found.active)
        ends, told = (weight * found.amount_low, weight * found.amount_high), f"{pair}: {found.stage}"
        return _Met(found.status, q, weight * found.lower_bound, told, active, {pair[:2]: found}, ends)

    def _solved(self, pair: JoinedPair) -> Solution:
        """Return the solution of a contact by one part's own motion, worked out once."""
        if pair[:2] not in self._known:
            self._known[pair[:2]] = solve(self._assembly.problem(pair), **self._how)  # type: ignore[arg-type]
        return self._known[pair[:2]]

    def _together(self, group: Sequence[JoinedPair]) -> _Met:
        """Meet all contacts of a group in one program."""
        assembly = self._assembly
        involved = {part for pair in group for part in assembly.involved(*pair[:2])}
        parts = [part for part in assembly.motions if part in involved]
        problems = [assembly.problem(pair, parts) for pair in group]
        tasks = [replace(Task.of(problem), size=assembly.size) for problem in problems]
        relaxed = self._relaxed(group) if self._proving else 0.0
        answer = all_at_once(problems, tasks, [*map(str, group)], known=relaxed, prove=self._proving)
        told = f"{', '.join(map(str, group))}: {answer.stage}"
        if answer.q is None:
            return _Met(answer.status, {}, answer.lower_bound, told, answer.active, {})
        ends = np.cumsum([len(assembly.motions[part].parameters) for part in parts])
        q = dict(zip(parts, np.split(answer.q, ends[:-1]), strict=True))
        contacts = {}
        for pair, problem in zip(group, problems, strict=True):
            if pair in assembly.contacts:
                own, certificate = judged(reported(problem, Task.of(problem), replace(answer, unique=0.0)))
                contacts[pair[:2]] = own.with_certificate(certificate, {})
        return _Met(answer.status, q, answer.lower_bound, told, answer.active, contacts)

    def _relaxed(self, group: Sequence[JoinedPair]) -> float:
        """Return a bound of the group's amount: each contact that one motion restores, as if there were no others."""
        own = [pair for pair in group if pair in self._assembly.contacts and self._assembly.is_own(pair)]
        bounds = (
            (self._solved(pair) if self._how["certify"] or pair[:2] in self._known else self._quick(pair)).lower_bound
            for pair in own
        )
        return hypot(*(self._assembly.weights[pair.one] * x for pair, x in zip(own, bounds, strict=True)))

    def _quick(self, pair: JoinedPair) -> Solution:
        return solve(self._assembly.problem(pair), effort="quick")

    def _overlapping(self, q: dict[str, Array], pairs: Sequence[JoinedPair]) -> list[JoinedPair]:
        """Return the two parts each that overlap and are not asked about yet."""
        assembly, asked = self._assembly, {frozenset(pair[:2]) for pair in pairs}
        poses = assembly.poses({part: q.get(part, self._rest(part)) for part in assembly.motions})
        boxes = {part: _box(assembly, part, poses[part]) for part in assembly.parts}
        found = []
        for one, two in assembly.pairs():
            (low, high), (least, most) = boxes[one], boxes[two]
            if frozenset((one, two)) in asked or (low > most).any() or (least > high).any():
                continue
            pair, parts = JoinedPair(one, two, CLEAR), assembly.involved(one, two)
            task = replace(Task.of(assembly.problem(pair, parts)), size=assembly.size)
            if not task.meets(np.concatenate([q.get(part, self._rest(part)) for part in parts]), DEFAULT.requirement):
                found.append(pair)
        return found

    def _rest(self, part: str) -> Array:
        return np.zeros(len(self._assembly.motions[part].parameters))

    def _reported(self, groups: Sequence[_Met], q: dict[str, Array]) -> AssemblySolution:
        """Return what was found of all groups; a motion that no contact depends on rests."""
        assembly = self._assembly
        stages, active = (group.stage for group in groups), (told for group in groups for told in group.active)
        bound = hypot(*(group.bound for group in groups))
        told = {"assembly": assembly, "stages": tuple(stages), "active": tuple(active)}
        failed = [group.status for group in groups if not group.q]
        if failed:
            status = Status.INFEASIBLE if Status.INFEASIBLE in failed else failed[0]
            return AssemblySolution(status=status, lower_bound=bound, **told)  # type: ignore[arg-type]
        every = {part: q.get(part, self._rest(part)) for part in assembly.motions}
        weights = {part: motion.weights(assembly.lengths[part]) for part, motion in assembly.motions.items()}
        amounts = {part: float(np.linalg.norm(weights[part] * own)) for part, own in every.items()}
        amount = hypot(*(assembly.weights[part] * own for part, own in amounts.items()))
        poses = assembly.poses(every)
        contacts = {pair: own for group in groups for pair, own in group.contacts.items()}
        low, high = np.linalg.norm([group.open_ for group in groups], axis=0).tolist() if groups else (amount, amount)
        bodies = [*assembly.bodies_made.values()]
        if not known_to(bodies[0], bodies[1:], assembly.unit):
            low = high = amount
        rest = not any(own.any() for own in every.values())
        return AssemblySolution(
            status=Status.ALREADY_SATISFIED if rest else Status.SOLVED,
            parameters={part: motion.by_name(every[part]) for part, motion in assembly.motions.items()},
            transforms=poses,
            amounts=amounts,
            amount=amount,
            lower_bound=min(bound, amount),
            amount_low=min(low, amount),
            amount_high=max(high, amount),
            contacts=tuple(contacts[pair[:2]] for pair in assembly.contacts),
            **told,  # type: ignore[arg-type]
        )


def _groups(assembly: Assembly, pairs: Sequence[JoinedPair]) -> Iterator[list[JoinedPair]]:
    """Yield the contacts in groups that share no motion."""
    left = [(pair, set(assembly.involved(*pair[:2]))) for pair in pairs]
    while left:
        pair, parts = left.pop(0)
        group, grown = [pair], True
        while grown:
            near = [own for own in left if own[1] & parts]
            grown, left = bool(near), [own for own in left if not own[1] & parts]
            group += [own for own, _ in near]
            parts = parts.union(*(own for _, own in near))
        yield group


def _box(assembly: Assembly, part: str, pose: Array) -> tuple[Array, Array]:
    """Return the lower and the upper corner of a box round a part as made."""
    body, scale = assembly.bodies_made[part], assembly.scales[part]
    drawn = np.concatenate([own.vertices for own in body.parts])
    points = (body.seed + scale * (drawn - body.seed)) @ pose[:3, :3].T + pose[:3, 3]
    return points.min(axis=0), points.max(axis=0)
