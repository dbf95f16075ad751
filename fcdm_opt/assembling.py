"""How an assembly is answered: contacts in groups that share motions, each as that of two parts or all at once.

A contact of a part with the one that it follows depends on that part's motion alone: it is a problem of two parts, and
what is proved of it holds. Contacts that share motions, as those of a loop do, are one program in all their parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import zip_longest
from math import hypot, nan
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.facet_errors import known_to
from fcdm_opt.geometry.units import gap_text
from fcdm_opt.judge.certificate import judged
from fcdm_opt.judge.placed_parts import placed
from fcdm_opt.model.mesh_error import open_amounts
from fcdm_opt.model.reported import reported
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.model.true_faces import ROUNDS, Exchange
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.assembly import CLEAR, Assembly, JoinedPair
from fcdm_opt.problem.contacts_restored import (
    RESTORED,
    has_plane_contacts,
    is_of_plane_faces,
    restores,
    restoring_motion,
    touching_again,
)
from fcdm_opt.problem.evidence import SharedBound
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import UNMET, Solution, Status
from fcdm_opt.stages.contact_system import all_at_once, least_restoring
from fcdm_opt.tolerances import DEFAULT

EXCLUDED = "true faces that touch as drawn cannot all touch again"
Solve = Callable[[Problem], Solution]  # answers one problem of two parts


def assembled(
    assembly: Assembly, solve: Solve, quick: Solve, *, model: str, certify: bool, prove: bool
) -> AssemblySolution:
    """Find the smallest motions together that restore all contacts of an assembly, and have them judged.

    `solve` and `quick` answer the contacts that are problems of their own, as is asked and with no more than a bound.
    `model` is "auto", or what is forced: of contacts that share motions, which are one program, nothing can be, which
    raises `InputError`. With `certify` what proves the bounds of these is kept; `prove` is to look for bounds where
    motions turn.
    """
    return _Solving(assembly, solve, quick, model, certify, prove).solution()


class _Met(NamedTuple):
    """How a group of contacts that share motions is met: parameters by part, none without a motion.

    `bound` is of the weighted amount of the group's parts, `open_` what meshes leave open of it; `contacts` are the
    solutions by their pairs, `shared` the pairs where they share motions, `names` those of all.
    """

    status: Status
    q: dict[str, Array]
    bound: float
    stage: str
    active: tuple[str, ...]
    contacts: dict[tuple[str, str], Solution]
    open_: tuple[float, float] = (nan, nan)
    shared: tuple[tuple[str, str], ...] = ()
    names: tuple[str, ...] = ()

    @property
    def why_not(self) -> str:
        """Which contacts are not met, in words."""
        more = " together" * (len(self.names) > 1)
        unmet = f"{UNMET}{more}" if self.status is Status.INFEASIBLE else f"not met{more}: {self.status.words}"
        return f"contact{'s' * bool(more)} {', '.join(self.names)} {unmet}"


class _Solving:
    """One assembly under way."""

    def __init__(self, assembly: Assembly, solve: Solve, quick: Solve, model: str, certify: bool, prove: bool) -> None:
        self._assembly, self._solve, self._quick = assembly, solve, quick
        self._model, self._certify, self._prove = model, certify, prove
        self._known: dict[tuple[str, str], Solution] = {}

    def solution(self) -> AssemblySolution:
        """Meet all contacts, then whatever overlaps besides, until nothing does."""
        start, pairs = perf_counter(), list(self._assembly.contacts)
        while True:
            asked, groups = list(_groups(self._assembly, pairs)), list[_Met]()
            for group in asked:  # each may take an equal share of the time left
                with pacing.sharing(1.0 / (len(asked) - len(groups))):
                    groups.append(self._met(group)._replace(names=tuple(map(str, group))))
            q = {part: own for group in groups for part, own in group.q.items()}
            more = list[JoinedPair]()
            with suppress(pacing.TimeOverError):  # the judge looks at it, too
                more += self._overlapping(q, pairs) if all(group.q for group in groups) else []
            if not more:
                break
            pairs += more
        stopped = next(filter(None, (own.stopped for group in groups for own in group.contacts.values())), "")
        found = replace(self._reported(groups, q), stopped=stopped or pacing.stopped())
        took = {"solve": perf_counter() - start}
        start = perf_counter()
        found, certificate = judged(found, placed)
        return found.with_certificate(certificate, {**took, "verify": perf_counter() - start})

    def _met(self, group: Sequence[JoinedPair]) -> _Met:
        """Meet some contacts that share motions."""
        try:
            single = len(group) == 1 and self._assembly.is_own(group[0]) and self._assembly.amount == "weighted"
            return self._single(group[0]) if single else self._system(group)
        except pacing.TimeOverError as over:
            return _Met(Status.NOT_FOUND, {}, 0.0, f"{', '.join(map(str, group))}: {over}", (), {})

    def _single(self, pair: JoinedPair) -> _Met:
        """Meet the one contact that a part's motion is for."""
        found, part = self._solved(pair), pair.one
        q = {part: np.array([*found.parameters.values()])} if found.status.found else {}
        weight = self._assembly.weights[part]
        active = tuple(f"{pair}: {text}" for text in found.active)
        ends, stage = (weight * found.amount_low, weight * found.amount_high), f"{pair} (stage {found.stage})"
        return _Met(found.status, q, weight * found.lower_bound, stage, active, {pair[:2]: found}, ends)

    def _solved(self, pair: JoinedPair) -> Solution:
        """Return the solution of a contact by one part's own motion, worked out once."""
        if pair[:2] not in self._known:
            self._known[pair[:2]] = self._solve(self._assembly.problem(pair))
        return self._known[pair[:2]]

    def _system(self, group: Sequence[JoinedPair]) -> _Met:
        """Meet all contacts of a group in one program."""
        assembly, names = self._assembly, [*map(str, group)]
        parts = assembly.sharing(group)
        if stepped := next((part for part in assembly.resolution if part in parts), ""):
            what = f"motions that contacts share are not rounded to steps: {', '.join(names)}"
            key = f"resolution.{stepped}"
            raise InputError(what, key=key, found=assembly.resolution[stepped], allowed="none for this part")
        if self._model != "auto":
            what = f"contacts that share motions are one program: {', '.join(names)}"
            raise InputError(what, key="model", found=self._model, allowed='"auto"')
        asked = [assembly.problem(pair, parts) for pair in group]
        restored, impossible = self._restored(group, asked, parts)
        if restored is not None:
            return restored
        relaxed = self._relaxed(group) if self._prove else 0.0
        weighted = assembly.amount == "weighted"
        touching = [own if is_of_plane_faces(own) else touching_again(own) or own for own in asked]
        closing = [own for own, other in zip(asked, touching, strict=True) if other is not own]
        if closing and weighted:
            answer, rounds = self._all_at_once(touching, names, relaxed)
            if answer.q is not None and all(restores(own, Task.of(own).transform(answer.q)) for own in closing):
                amount = float(np.linalg.norm(asked[0].weights * answer.q))
                answer = replace(answer, lower_bound=min(relaxed, amount))  # of true faces, as contacts' own are
                return self._moved(group, parts, asked, answer, rounds)._replace(open_=(answer.lower_bound, amount))
        answer, rounds = self._all_at_once(asked, names, relaxed)
        met = self._moved(group, parts, asked, answer, rounds)
        if impossible and answer.q is None:
            return met._replace(status=Status.INFEASIBLE, bound=np.inf, open_=(np.inf, np.inf))
        return met._replace(open_=open_amounts(asked, answer.q)) if weighted else met

    def _all_at_once(
        self, asked: Sequence[Problem], names: Sequence[str], known: float
    ) -> tuple[Answer, list[Exchange | None]]:
        """Return the answer to questions that share motions, and the points at which their parts are exact for it."""
        rounds = [Exchange.of(problem) for problem in asked]
        for _ in range(ROUNDS):
            problems = [own if each is None else each.problem for own, each in zip(asked, rounds, strict=True)]
            tasks = [replace(Task.of(problem), size=self._assembly.size) for problem in problems]
            answer = all_at_once(problems, tasks, names, known=known, prove=self._prove)
            both, here = zip(rounds, tasks, strict=True), answer.q
            refined = [own.refine(task.transform(here)) for own, task in both if here is not None and own is not None]
            if not any(refined):
                break
        return answer, rounds

    def _moved(
        self,
        group: Sequence[JoinedPair],
        parts: Sequence[str],
        asked: Sequence[Problem],
        answer: Answer,
        rounds: Sequence[Exchange | None] = (),
    ) -> _Met:
        """Return how a group is met by an answer in the parameters of some parts, with the true gaps of round faces."""
        assembly = self._assembly
        shared = tuple(pair[:2] for pair in group if pair in assembly.contacts)
        stage = f"{', '.join(map(str, group))} (stage {answer.stage})"
        met = _Met(answer.status, {}, answer.lower_bound, stage, answer.active, {}, shared=shared)
        if answer.q is None:
            return met
        rounding = np.abs(Task.of(asked[0]).weights * answer.q) <= DEFAULT.tie * assembly.size
        moved = np.where(rounding, 0.0, answer.q)
        answer = replace(answer, q=moved)
        ends = np.cumsum([len(assembly.motions[part].parameters) for part in parts])
        q = dict(zip(parts, np.split(moved, ends[:-1]), strict=True))
        contacts = {}
        for pair, problem, each in zip_longest(group, asked, rounds):
            if pair in assembly.contacts:
                if each is not None:
                    task = Task.of(each.problem)
                    if (gap := task.contact_gap(task.distances(moved))) > each.facets.contact_slack:
                        each.add_nearest(task.transform(moved), gap)
                    problem = each.problem
                own, certificate = judged(reported(problem, Task.of(problem), replace(answer, unique=0.0)))
                contacts[pair[:2]] = own.with_certificate(certificate, {})
        return met._replace(q=q, contacts=contacts)

    def _restored(
        self, group: Sequence[JoinedPair], asked: Sequence[Problem], parts: Sequence[str]
    ) -> tuple[_Met | None, bool]:
        """Return how shifts meet a group of contacts of true faces that touch as drawn, some round; None for others.

        And whether true parts cannot meet it: after the only shift that closes contacts others overlap.
        """
        closing = [k for k, own in enumerate(asked) if own.goal != "clear"]
        met = [asked[k] for k in closing]
        touching = [own if own.goal == "clear" else touching_again(own) for own in asked]
        rounds = [None if own is None else Exchange.of(own) for own in touching]
        plane = all(rounds[k] or has_plane_contacts(asked[k]) for k in closing)
        if not (met and plane and any(rounds)) or (assembly := self._assembly).amount != "weighted":
            return None, False
        found = restoring_motion(met)
        if found is None or (found.q is None and found.bound < np.inf):
            return None, False
        if found.q is None:
            names, slack = ", ".join(map(str, group)), DEFAULT.touch * assembly.size
            rest = zip((group[k] for k in closing), found.remaining, strict=True)
            gaps = "; ".join(f"{pair} {gap_text(max(own, key=abs), slack, assembly.unit)}" for pair, own in rest)
            why = f"{names}: {EXCLUDED}; at the shifts nearest to that {gaps}"
            answer = Answer(Status.INFEASIBLE, None, RESTORED, np.inf, (why,))
            return self._moved(group, parts, asked, answer)._replace(open_=(np.inf, np.inf)), True
        for k, points in zip(closing, found.points, strict=True):
            if (each := rounds[k]) is not None:
                each.add(points)
        for own, each in zip(asked, rounds, strict=True):
            if own.goal != "clear":
                continue
            overlap = each is not None and each.refine(Task.of(own).transform(found.q))
            if overlap or not Task.of(each.problem if each else own).meets(found.q, DEFAULT.requirement):
                return None, found.only  # else the least motion of all is another one
        amount = float(np.linalg.norm(Task.of(asked[0]).weights * found.q))
        known = not self._prove or all(own.motion.shifts for own in asked)
        bound = found.bound if known else least_restoring(met, found.q, amount)
        if self._prove and bound < amount:
            bound = max(bound, self._relaxed(group))
        bound = min(bound, amount)
        answer = Answer(Status.SOLVED, found.q, RESTORED, bound)
        moved = self._moved(group, parts, asked, answer, rounds)
        return moved._replace(open_=(bound, amount)), False

    def _relaxed(self, group: Sequence[JoinedPair]) -> float:
        """Return a bound of the group's amount: each contact that one motion restores, as if there were no others."""
        assembly = self._assembly
        own = [pair for pair in group if pair in assembly.contacts and assembly.is_own(pair)]
        own = own if assembly.amount == "weighted" else []
        bounds = (
            (
                self._solved(pair) if self._certify or pair[:2] in self._known else self._quick(assembly.problem(pair))
            ).lower_bound
            for pair in own
        )
        return hypot(*(assembly.weights[pair.one] * x for pair, x in zip(own, bounds, strict=True)))

    def _overlapping(self, q: dict[str, Array], pairs: Sequence[JoinedPair]) -> list[JoinedPair]:
        """Return the two parts each that overlap, or a keep-out, and are not asked about yet."""
        assembly, known = self._assembly, {pair[:2] for pair in pairs}
        asked = {frozenset(pair) for pair in known}
        poses = assembly.poses({part: q.get(part, self._rest(part)) for part in assembly.motions})
        made = assembly.bodies_made.items()
        points = {part: body.placed_vertices(assembly.scales[part], poses[part]) for part, body in made}
        boxes = {part: (own.min(axis=0), own.max(axis=0)) for part, own in points.items()}
        found = []
        for one, two in assembly.moving_pairs():
            (low, high), (least, most) = boxes[one], boxes[two]
            away = frozenset((one, two)) in asked or (low > most).any() or (least > high).any()
            if away and not (assembly.keeps_out(one, two) and (one, two) not in known):
                continue
            clear, parts = JoinedPair(one, two, CLEAR), assembly.involved(one, two)
            task = replace(Task.of(assembly.problem(clear, parts)), size=assembly.size)
            if not task.meets(np.concatenate([q.get(part, self._rest(part)) for part in parts]), DEFAULT.requirement):
                found.append(clear)
        return found

    def _rest(self, part: str) -> Array:
        return np.zeros(len(self._assembly.motions[part].parameters))

    def _reported(self, groups: Sequence[_Met], q: dict[str, Array]) -> AssemblySolution:
        """Return what was found of all groups; a motion that no contact depends on rests."""
        assembly = self._assembly
        stages, active = (group.stage for group in groups), (text for group in groups for text in group.active)
        bound = hypot(*(group.bound for group in groups))
        fields: dict[str, Any] = {"assembly": assembly, "stages": tuple(stages), "active": tuple(active)}
        if self._certify:
            fields["evidence"] = tuple(SharedBound(group.shared, group.bound) for group in groups if group.shared)
        failed = [group for group in groups if not group.q]
        if failed:
            worst = next((group.status for group in failed if group.status is Status.INFEASIBLE), failed[0].status)
            fields["active"] = tuple(why for group in failed for why in group.active or (group.why_not,))
            if any(own.open_[0] == np.inf for own in failed):  # of true parts, too
                fields |= dict.fromkeys(("amount_low", "amount_high"), np.inf)
            return AssemblySolution(status=worst, lower_bound=bound, **fields)
        every = {part: q.get(part, self._rest(part)) for part in assembly.motions}
        weights = {part: motion.weights(assembly.lengths[part]) for part, motion in assembly.motions.items()}
        amounts = {part: float(np.linalg.norm(weights[part] * own)) for part, own in every.items()}
        amount = hypot(*(assembly.weights[part] * own for part, own in amounts.items()))
        if isinstance(assembly.amount, OwnAmount):
            amount = assembly.amount(np.concatenate([*every.values()]))
        poses = assembly.poses(every)
        contacts = {pair: own for group in groups for pair, own in group.contacts.items()}
        low, high = np.linalg.norm([group.open_ for group in groups], axis=0).tolist() if groups else (amount, amount)
        if not known_to(assembly.bodies, assembly.unit):
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
            **fields,
        )


def _groups(assembly: Assembly, pairs: Sequence[JoinedPair]) -> Iterator[list[JoinedPair]]:
    """Yield the contacts in groups that share no motion."""
    remaining = [(pair, set(assembly.sharing([pair]))) for pair in pairs]
    while remaining:
        pair, parts = remaining.pop(0)
        group, grown = [pair], True
        while grown:
            near = [own for own in remaining if own[1] & parts]
            grown, remaining = bool(near), [own for own in remaining if not own[1] & parts]
            group += [own for own, _ in near]
            parts = parts.union(*(own for _, own in near))
        yield group
