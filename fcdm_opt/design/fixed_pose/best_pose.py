"""The one pose that is best for all pairs of parts, where they are not measured one by one."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.true_sizes import ROUNDS, TrueSizes
from fcdm_opt.design.contact_gaps import ContactGaps, by_contacts
from fcdm_opt.design.fixed_pose.cells import Search
from fcdm_opt.design.fixed_pose.clearances import EndOfRange, gaps_text
from fcdm_opt.design.fixed_pose.local_search import Found, better, found_at, least_moved, smaller, stepped
from fcdm_opt.design.fixed_pose.proof import PoseEvidence, check_proof
from fcdm_opt.design.fixed_pose.scene import OwnSizes, true_extremes, true_sizes
from fcdm_opt.design.fixed_pose.worst import WIDE, Worst, WorstContacts, domain, obstacles
from fcdm_opt.design.sizes import SCALES, Sizes, all_sizes, by_name, not_counted, worst_sizes
from fcdm_opt.errors import InputError, expected, known_arguments
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.units import floored, measured
from fcdm_opt.judge.certificate import judged_in_time
from fcdm_opt.judge.engagement import leaves_fit
from fcdm_opt.judge.sampled_sizes import GapClaims
from fcdm_opt.lazy_import import NotebookRepr
from fcdm_opt.model.task import Task
from fcdm_opt.plain import Plain, ShortRepr
from fcdm_opt.problem import arguments
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Check
from fcdm_opt.tolerances import DEFAULT

Verdict = Literal["least worst gap", "inside the window", "no pose", "undecided"]
BEST, INSIDE, NONE, UNDECIDED = get_args(Verdict)
ONLY_CLEAR = "clearance=(0, math.inf)"  # how one without interference is asked for
MIDDLE = f"it makes the worst gap smallest, of either kind; {ONLY_CLEAR} asks for one without interference"
LEAST = "middle"  # in place of a window
EFFORT = 20_000  # cells: a second or two for two parameters


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class BestPose(ShortRepr, NotebookRepr, Plain):
    """One pose for all pairs of parts.

    Attributes
    ----------
    status : str
        "least worst gap" (no window was asked for), "inside the window", "no pose" (proved: none brings all gaps into
        the window; the parameters are those of the pose that misses it least), "undecided".
    parameters : dict
        Names and values, length units and radians.
    motion : str
        The same in words, with units and in degrees.
    transform : (4, 4) array or None
        None of an assembly.
    transforms : mapping of name to (4, 4) array
        The pose change of each part of an assembly.
    amount : float
        Of the motion, as the question measures it.
    worst_gap : float
        Largest |gap| over all sizes at this pose.
    contacts : mapping of name to (low, high)
        The range of the gap of each contact at this pose, where contacts are looked at.
    violation : float
        How far the worst gap is off the window, 0 inside; without a window `worst_gap`. Of "no pose" how far a
        keep-out is come too near to, where that is more.
    least, most : EndOfRange
        The ends of the range of the gap at this pose.
    value, lower_bound : float
        What is made small, the violation, of goal "fit" minus the least gap or, inside the window, the amount; and what
        it is proved to be no less than, to rounding, whatever the pose.
    certified : bool
        Whether they differ by no more than the accuracy asked for (or by `Problem.contact_slack`); where no pose is
        clear of keep-outs, whether that is proved.
    cells : int
        Cells of poses looked at for the proof.
    checks : tuple of Check
        What `fcdm_opt.verify` says of it: the collision library confirms the gaps at both extremes and at other sizes.
    sizes : Sizes
        The sizes spoken of.
    window : (low, high)
        (0, 0) without one.
    evidence : PoseEvidence or None
        The proof, see `check`.
    seconds : float
    unit : str
        Of lengths, "" where the problem names none.
    problem : Problem or Assembly
        That was asked about.
    standing : tuple of str
        Contacts that are closed at all sizes wherever the motion leads, a flange on its plate: not counted in gaps. A
        contact that the motion can open counts.
    permanent_parts : tuple of (int, int)
        Their part pairs.
    too_near_at_rest : tuple of str
        Parts and keep-outs that rest is not clear of as asked, so that it is no pose, in words with their least gap.
    permanent_faces : set of (int, int), or None
        Of bodies with round faces their faces, see `TouchingSizes.permanent_faces`.
    """

    plain_names: ClassVar[tuple[str, ...]] = (
        "status", "parameters", "motion", "transform", "transforms", "contacts", "amount", "worst_gap", "violation",
        "least", "most", "value",
        "lower_bound", "certified", "cells", "checks", "sizes", "window", "standing", "too_near_at_rest", "seconds",
    )  # fmt: skip
    status: Verdict
    parameters: dict[str, float]
    motion: str
    transform: Array | None
    amount: float
    worst_gap: float
    violation: float
    least: EndOfRange
    most: EndOfRange
    value: float
    lower_bound: float
    certified: bool
    cells: int
    checks: tuple[Check, ...]
    sizes: Sizes = field(repr=False)
    window: tuple[float, float]
    evidence: PoseEvidence | None = field(repr=False)
    seconds: float
    unit: str = ""
    problem: Problem | Assembly | None = field(default=None, repr=False)
    standing: tuple[str, ...] = ()
    too_near_at_rest: tuple[str, ...] = ()
    permanent_parts: tuple[tuple[int, int], ...] = ()
    permanent_faces: frozenset[tuple[int, int]] | None = None
    transforms: Mapping[str, Array] = field(default_factory=dict)
    contacts: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def claims(self, *, proof: bool = False) -> GapClaims:
        """Return what `verify` looks at: the range of the gap at the pose, and what is told of it."""
        if self.problem is None:
            raise InputError("a pose is judged with the problem it is of", key="BestPose.problem", found=None)
        problem, limits = self.problem, np.array([own.limits for own in self.problem.coordinates])
        q, (low, high) = np.array([*self.parameters.values()]), self.window
        slack = max(problem.contact_slack, DEFAULT.touch * problem.size)
        ends = self.least.gap, self.most.gap
        violation = max(low - ends[0], ends[1] - high, 0.0)
        inside, failed = violation <= slack, self.status in (NONE, UNDECIDED)
        if failed and (problem.keep_out or isinstance(problem, Assembly)):  # it may be off what is kept clear of
            violation, inside = max(violation, self.violation), False
        amount = amount_of(problem, q)
        best = -ends[0] if self.fitted else violation
        value = amount if self.status == INSIDE else best
        known = {BEST: self.window == (0.0, 0.0), INSIDE: inside, NONE: not inside, UNDECIDED: not inside}
        named, transforms = {**self.transforms}, transforms_of(problem, q)
        if self.transform is not None:
            named[""] = self.transform
        errors = {
            "transform of parameters": max(np.abs(named[part] - T).max() for part, T in transforms.items()),
            "amount": abs(self.amount - amount),
            "worst gap": abs(self.worst_gap - max(map(abs, ends))),
            "violation": abs(self.violation - violation),
            "value": abs(self.value - value),
            "lower bound": self.lower_bound - value,
            "limits": np.maximum(limits[:, 0] - q, q - limits[:, 1]).max(),
            "status": 0.0 if known.get(self.status) else np.inf,
        }
        others = [Check(name, bool(off <= slack), float(off), slack, "as told") for name, off in errors.items()]
        if by_contacts(problem):
            worst = WorstContacts.asked(problem, self.sizes, self.least.names, low, high)
            return replace(worst.claims(q, ends[0], failed=failed), others=others)
        assert isinstance(problem, Problem)
        assert self.transform is not None
        by_names = self.least.names != SCALES
        movable, static = (problem.at_scales if by_names else problem.bodies_made).values()
        return GapClaims(
            bodies=(movable, static),
            sizes=problem.sizes if by_names else (),
            transform=self.transform,
            least=(ends[0], self.least.rho),
            largest=(ends[1], self.most.rho),
            box=self.sizes.box,
            listed=self.sizes.pairs,
            permanent=self.permanent_parts,
            permanent_faces=self.permanent_faces,
            keep_out=() if failed else [own[:2] for own in obstacles(problem)],
            others=[*others, *(self.check(problem) if proof else ())],
        )

    @property
    def gap(self) -> float:
        """What the proof leaves open: value less lower bound."""
        return self.value - self.lower_bound

    @property
    def fitted(self) -> bool:
        """Whether the least gap is made largest, as goal "fit" asks for."""
        return getattr(self.problem, "goal", "") == FIT and self.window == (0.0, 0.0)

    @property
    def on_true_faces(self) -> bool:
        """Whether gaps are those of the faces that facets stand for."""
        return self.permanent_faces is not None

    @property
    def passed(self) -> bool:
        """Whether the collision library confirms the pose."""
        return bool(self.checks) and all(check.passed for check in self.checks)

    @property
    def leaves_fit(self) -> bool:
        """Whether the pose leaves the fit in which the parts are drawn, through the other part or out of it."""
        return isinstance(self.problem, Problem) and leaves_fit(self.problem, tuple(self.parameters.values()))

    def check(self, problem: Problem) -> tuple[Check, ...]:
        """Return the independent checks of the proof, see `proof.check_proof`; none without one."""
        if self.evidence is None:
            return ()
        inside = self.status == INSIDE
        return check_proof(problem, self.sizes, self.window, self.evidence, self.lower_bound, amounts=inside)

    def __str__(self) -> str:
        what, others = {
            INSIDE: ("amount", "no pose inside has"),
            BEST: ("off zero by at most", "no pose by"),
        }.get(self.status, ("off the window by", "no pose by"))
        bound = f"proved: {others} less than {measured(floored(self.lower_bound, 6), self.unit)}"
        limits = [own.limits for own in self.problem.coordinates] if self.problem is not None else []
        of_shifts = self.problem is not None and self.problem.shifts and not (self.contacts or self.on_true_faces)
        open_ended = (self.status == UNDECIDED or of_shifts) and not np.isfinite(limits).all()
        unproved = "no bound proved" + ": that takes limits" * open_ended
        least_known = self.certified or self.value == 0.0
        known = bound if self.lower_bound > 0.0 else "none can be better" if least_known else unproved
        slack = self.problem.contact_slack if self.problem is not None else 0.0
        least, most = (gap * (abs(gap) > slack) for gap in (self.least.gap, self.most.gap))
        ends = gaps_text(least, most, self.unit)
        text = f"{self.status}: {self.motion}; {ends}; {what} {measured(self.value, self.unit)} ({known})"
        if self.fitted:  # whose least gap is made largest
            sure = "none can be better" if self.certified else "no bound proved"
            text = f"{self.status}: {self.motion}; {ends}; the least as large as can be ({sure})"
        contacts = [f"\n  {name}: {gaps_text(*ends, self.unit)}" for name, ends in self.contacts.items()]
        judged = "verified" if self.passed else self.refusal or "not judged"
        middle = [MIDDLE] * (self.window == (0.0, 0.0) and not self.fitted and self.least.gap < 0.0)
        outside = ["outside the fit in which the parts are drawn: set limits that keep the part in"] * self.leaves_fit
        several = "".join(contacts if len(contacts) > 1 else [])
        near = [f"at rest {own}" for own in self.too_near_at_rest]
        return "; ".join([text, *near, judged, *outside, *not_counted(self.standing), *middle]) + several

    @property
    def refusal(self) -> str:
        """That the judge refused it, with the checks that failed; "" where none did."""
        failed = ", ".join(own.name for own in self.checks if not own.passed)
        return f"NOT VERIFIED, do not use it: failed {failed}" * bool(failed)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, without the evidence, see `PoseEvidence.to_dict`."""
        return {**super().to_dict(), "window": [None if np.isinf(end) else end for end in self.window]}


@known_arguments
def best_pose(
    problem: Problem | Assembly,
    *,
    sizes: Any = None,
    box: Any = None,
    clearance: Any = None,
    certify: bool = True,
    accuracy: float = 1e-4,
    effort: int = EFFORT,
) -> BestPose:
    """Return the one pose of the problem's motion family that is best for all pairs of parts.

    The gap of the bodies is their signed distance: of a peg in a hole that of the nearest wall. Without a window the
    largest |gap| is made least: neither much play nor much interference; of poses as good as each other the one of the
    least amount, as far as a local search finds. With a window (low, high), the smallest motion such that every gap
    lies in it; either end may be infinite, (low, inf) asks for a clearance.

    Contacts as drawn, each along its normal, are looked at in place of the gap of the bodies where a question names
    several, of an assembly, of bodies kept as surfaces, and of sizes that turn faces; the largest |gap| is that over
    all of them, and goal "fit" asks for the largest least gap. Where the motion only shifts that is a linear program,
    and its pose proved.

    Asked are bodies, motion, limits, weights, steps and keep-outs: else the problem's goal, path and pair state play no
    part, and an amount other than the weighted one is told, not made least.

    Parameters
    ----------
    problem : Problem or Assembly
        Its keep-outs are kept clear of at all sizes; a proof comes without evidence then. So are parts of an assembly
        without contacts of each other.
    sizes : (n, 2) array, or a distribution for each body, optional
        The pairs that must all do: a list, or all that the distributions can give.
    box : ((low_1, high_1), (low_2, high_2)), optional
        All sizes of a box, in place of `sizes`; default the problem's tolerance, or without one its own sizes within
        their tolerances: proved then where the motion is made of translations, whose gap is that of `stack_up`. Of an
        assembly (low, high), the scales of all its parts, which have no tolerance.
    clearance : (low, high) or "middle", optional
        The window of the gap, length units; without one of goal "clear" its clearance and more, (clearance, inf).
        "middle": none, the largest |gap| is made least.
    certify : bool
        Whether to prove how good the pose is, and to look everywhere; else the best pose near rest is returned.
    accuracy : float
        Relative difference of value and lower bound at which the proof is complete.
    effort : int
        Cells at most. One and two parameters seldom need so many; with three and more the bound reached is told.

    Raises
    ------
    InputError
        For sizes that are none (see `clearances`), an empty window, and parts without contacts where these are looked
        at.
    """
    start = time.perf_counter()
    expected(problem, (Problem, Assembly), "problem")
    arguments.truth(certify, "certify")
    arguments.whole(effort, "effort", "number of cells", 1)
    accuracy = arguments.real(accuracy, "accuracy", "a number from 1e-12 to 1", lambda x: 1e-12 <= x <= 1)
    if clearance is None and getattr(problem, "goal", "") == "clear":
        clearance = getattr(problem, "clearance", 0.0), np.inf
    clearance = None if isinstance(clearance, str) and clearance == LEAST else clearance
    low, high = (0.0, 0.0) if clearance is None else arguments.interval(clearance, "clearance")
    if low == -np.inf and high == np.inf:
        raise InputError("a window without ends asks for nothing", key="clearance", found=clearance)
    own = by_name(problem, sizes, box)
    true, most = None, effort * certify
    if by_contacts(problem):
        asked, names = all_sizes(problem, sizes, box)
        fitted = getattr(problem, "goal", "") == FIT and clearance is None
        ends = (WIDE * problem.size, np.inf) if fitted else (low, high)
        how = {"fitted": fitted, "windowed": clearance is not None}
        worst = WorstContacts.asked(problem, asked, names, *ends)
        best = _best(worst, accuracy, most, **how)
        walls = worst.with_walls(best.found.q)
        if walls.nearest_wall(best.found.q, best.found.off.rows):  # looked at where they are nearer alone
            best = _best(walls, accuracy, most, **how)
    else:
        assert isinstance(problem, Problem)
        scales = None if own else worst_sizes(problem, sizes, box)
        asking = partial(_best, accuracy=accuracy, fitted=False, windowed=clearance is not None)
        best, true = _of_gap(problem, scales, (low, high), asking, most)
    pose = _reported(problem, best, (low, high), own=own)
    if true is not None:
        faces = true.faces_of(best.worst.scene.permanent.values())
        pose = replace(pose, evidence=None, permanent_faces=faces | true.permanent)
    return replace(pose, checks=judged_in_time(pose).checks, seconds=time.perf_counter() - start)


class _Best(NamedTuple):
    """The best pose found, and what is proved of it; see `BestPose`."""

    worst: Worst
    found: Found
    search: Search
    status: Verdict
    value: float
    bound: float
    done: bool
    fitted: bool


def _best(worst: Worst, accuracy: float, effort: int, *, fitted: bool, windowed: bool) -> _Best:
    """Return the best pose for a worst gap, inside its window where there is one."""
    problem, effort = worst.problem, effort if worst.scene.covers else 0
    slack = problem.contact_slack
    first = best = better(worst, np.zeros(len(worst.limits)))
    if fitted and best.off.value <= 0.0:
        what, limits = "no contact holds the part: nothing makes the least gap largest", worst.limits.tolist()
        raise InputError(what, key="limits", found=limits, allowed='limits, or goal "at"')
    inside = windowed and best.off.value <= slack
    if not inside:
        search = _searched(worst, best, slack, accuracy, effort, amounts=False, stop=windowed)
        best = search.best
        inside = windowed and best.off.value <= slack
    if inside:
        search = _searched(worst, smaller(worst, best, slack), slack, accuracy, effort, amounts=True)
        best, bound = search.best, _proved(search)
    else:
        best, bound = least_moved(worst, best, first), _proved(search)
    if _outside(problem, best) and not _outside(problem, first):
        inside = windowed and first.off.value <= slack
        near = smaller(worst, first, slack) if inside else least_moved(worst, first, first)
        best, bound = first if _outside(problem, near) else near, 0.0  # what is proved is of poses outside the fit too
    steps = steps_of(problem)
    if steps.any():
        best = stepped(worst, best, steps, slack, amounts=inside)
        bound = 0.0 if inside and best.off.value > slack else bound  # what is proved is of poses inside
        inside = inside and best.off.value <= slack
    least_gap = best.off.extremes.least.gap
    value = amount_of(problem, best.q) if inside else -least_gap if fitted else best.off.excess
    if problem.amount != "weighted" and inside:
        bound = 0.0  # of another amount
    elif fitted:
        bound = max(bound, 0.0) - worst.low
    elif not inside and not best.off.clear:
        bound = min(2.0 * slack, value) if bound >= best.off.value else 0.0
    bound = min(bound, value)
    done = value - bound <= max(accuracy * abs(value), slack) or (bound > slack and not best.off.clear)
    status: Verdict = NONE if bound > slack else UNDECIDED
    if inside or (not windowed and best.off.clear):
        status = INSIDE if inside else BEST
    return _Best(worst, best, search, status, value, bound, bool(done), fitted)


def _outside(problem: Problem | Assembly, found: Found) -> bool:
    return isinstance(problem, Problem) and leaves_fit(problem, tuple(found.q.tolist()))


def _of_gap(
    problem: Problem, scales: Sizes | None, window: tuple[float, float], best: Callable[..., _Best], most: int
) -> tuple[_Best, TrueSizes | None]:
    """Return the best pose by the gap of two bodies, and their true faces where these are round.

    It is looked for anew while contacts that were left out are open at the pose found, and while bodies are not exact
    where gaps are extreme there; where that comes to no end, the pose found last is told, with its gaps on true faces.
    """
    true, opened = true_sizes(problem, scales), list[Array]()
    proves = true is None or window[1] == np.inf  # within round faces gaps are larger elsewhere
    exact, effort = False, most if true is None else 0
    for _ in range(2 * ROUNDS):
        pacing.at("searching for the best pose")
        worst = Worst.of(problem, scales, *window, true)
        worst.leave_out_permanent(opened)
        found = best(worst, effort=effort)
        q, extremes = found.found.q, found.found.off.extremes
        if scales is None and worst.opened(q):
            opened.append(q)
            continue
        if true is None:
            return found._replace(found=found.found._replace(off=worst.off(q, whole=True))), None
        at = transforms_of(problem, q)[""], extremes, found.found.off.rows
        exact = true_extremes(true, *at, own=scales is None, last=False)[1]
        if exact and effort == most * proves:
            break
        effort = most * proves * exact
    if true is None:
        return found._replace(bound=min(found.value, 0.0), done=False), None
    if exact and most and not proves and found.status == BEST:
        # bodies within the true ones overlap by no more than these do: by how much they do at least is a bound
        apart = Worst.of(problem, scales, window[0], np.inf, true)
        apart.leave_out_permanent(opened)
        other, proves = best(apart, effort=most), True
        done = other.done and found.value - other.bound <= problem.contact_slack
        found = found._replace(bound=max(other.bound, 0.0), done=done, search=other.search)
    worst_of = partial(Worst.of, problem, scales, *window, true)
    return _on_true_faces(worst_of, opened, found, true, proved=bool(exact and proves and most)), true


def _on_true_faces(
    worst_of: Callable[[], Worst], opened: list[Array], found: _Best, true: TrueSizes, *, proved: bool
) -> _Best:
    """Return what a pose is worth on true faces, of bodies made exact there; with a bound where that is `proved`."""
    q = found.found.q
    for _ in range(ROUNDS):
        worst = worst_of()
        worst.leave_out_permanent(opened)
        off, own = worst.off(q, whole=True), isinstance(worst.scene, OwnSizes)
        extremes, exact = true_extremes(true, worst.transform(q), off.extremes, off.rows, own=own)
        if exact:
            break
    missed, slack = worst.missed(extremes), worst.problem.contact_slack
    off = off._replace(extremes=extremes)
    off = off._replace(value=missed, excess=missed) if off.clear else off
    windowed = (worst.low, worst.high) != (0.0, 0.0)
    inside = windowed and off.value <= slack
    status: Verdict = INSIDE if inside else UNDECIDED if windowed or not off.clear else BEST
    value = amount_of(worst.problem, q) if inside else off.excess
    return found._replace(
        worst=worst,
        found=found.found._replace(off=off),
        status=found.status if proved else status,
        value=value,
        bound=min(found.bound * proved, value),
        done=proved and found.done and value - found.value <= slack,
    )


def _reported(problem: Problem | Assembly, found: _Best, window: tuple[float, float], *, own: bool) -> BestPose:
    worst, best, search = found.worst, found.found, found.search
    least, most = (EndOfRange.of(worst.scene, best.off.rows, end) for end in best.off.extremes[:2])
    if isinstance(worst, WorstContacts) and (nearest := worst.nearest_wall(best.q, best.off.rows)):
        wall, off = nearest
        end = EndOfRange.of(wall.scene, off.rows, off.extremes.least)
        least = replace(end, rho=least.rho, names=least.names)
    least, most = (end.without_rounding(DEFAULT.weld * problem.size) for end in (least, most))
    q = np.where(np.abs(worst.weights * best.q) <= DEFAULT.weld * problem.size, 0.0, best.q)
    transforms, gaps = transforms_of(problem, best.q), worst.scene
    value = found.value if abs(found.value) > DEFAULT.weld * problem.size else 0.0
    return BestPose(
        status=found.status,
        parameters=dict(zip([own.name for own in problem.coordinates], q.tolist(), strict=True)),
        motion=motion_in_words(problem, np.where(np.abs(worst.weights * q) > problem.contact_slack, q, 0.0)),
        transform=frozen(transforms.pop("")) if "" in transforms else None,
        transforms=transforms,
        contacts=gaps.ranges(best.off.rows) if isinstance(gaps, ContactGaps) else {},
        amount=amount_of(problem, best.q),
        worst_gap=max(abs(least.gap), abs(most.gap)),
        violation=max(-least.gap, most.gap) if found.fitted else max(best.off.excess, 0.0),
        least=least,
        most=most,
        value=value,
        lower_bound=min(found.bound, value),
        certified=found.done,
        cells=len(search.nodes),
        checks=(),
        sizes=worst.scene.sizes,
        window=window,
        evidence=PoseEvidence.of(search) if search.nodes and not (own or problem.keep_out) else None,
        seconds=0.0,
        unit=problem.unit,
        problem=problem,
        standing=worst.scene.permanent_in_words,
        too_near_at_rest=tuple(worst.too_near(np.zeros(len(q)))),
        permanent_parts=tuple(worst.scene.permanent),
        permanent_faces=frozenset() if isinstance(gaps, ContactGaps) and not gaps.of_facets else None,
    )


def _proved(search: Search) -> float:
    """Return what no pose has less of; without a proof what is known anyhow."""
    if search.known is not None:
        return search.known
    if search.nodes:
        return search.lower
    return 0.0 if search.amounts else search.worst.floor


def _searched(
    worst: Worst, best: Found, slack: float, accuracy: float, effort: int, *, amounts: bool, stop: bool = False
) -> Search:
    """Look for the smallest motion into the window, with `stop` any, or the pose whose worst gap is off least."""
    limits = worst.limits
    if isinstance(worst, WorstContacts):
        known = worst.bound(slack, amounts=amounts) if effort else None
        return Search(worst, limits, best, slack, amounts, lambda q: found_at(worst, q), known=known)
    if effort:
        most, amount = (worst.high + slack, best.amount) if amounts else (best.off.value + worst.high, np.inf)
        bounded = domain(worst, most, amount)
        effort *= bool(np.isfinite(bounded).all())  # without limits poses go on for ever: nothing is proved of them
        limits = bounded if effort else limits

    def improve(q: Array) -> Found:
        return smaller(worst, found_at(worst, q), slack) if amounts else better(worst, q)

    search = Search(worst, limits, best, slack, amounts, improve)
    if effort and (best.amount > slack if amounts else best.off.value > max(worst.floor, 0.0) + slack):
        search.run(accuracy=accuracy, near=slack, most=effort, settled=lambda: stop and search.best.off.value <= slack)
    if not amounts and search.best is not best:  # the centre of a cell that may beat others by a little only
        search.best = min(search.best, improve(search.best.q), key=lambda own: own.off.value)
    return search


def amount_of(question: Scene, q: Array) -> float:
    """Return the amount of a motion, as the question measures it."""
    if isinstance(question, Problem) and question.amount != "weighted":
        return Task.of(question).amount(q)
    return float(np.linalg.norm([own.weight * x for own, x in zip(question.coordinates, q, strict=True)]))


def steps_of(question: Scene) -> Array:
    """Return the steps of each parameter, 0 where it is any."""
    if isinstance(question, Assembly):
        each = ((question.resolution.get(part, 0.0), motion.names) for part, motion in question.motions.items())
        return np.array([own.get(x, 0.0) if isinstance(own, Mapping) else own for own, names in each for x in names])
    return np.zeros(len(question.coordinates)) if question.resolution is None else np.array(question.resolution)


def transforms_of(question: Scene, q: Array) -> dict[str, Array]:
    """Return the pose of each part of an assembly, or that of the movable part of two, under the name ""."""
    if isinstance(question, Assembly):
        return dict(question.poses(question.by_part(q.tolist())))
    return {"": question.motion.transform(q, question.movable.seed, question.static.seed)}


def motion_in_words(question: Scene, q: Array) -> str:
    """Return a motion in words, of an assembly part by part."""
    each = question.motion_texts(q.tolist()).items()
    return ", ".join(f"{part} {text}" if isinstance(question, Assembly) else text for part, text in each)
