"""The one pose that is best for all pairs of parts, where they are not measured one by one."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from fcdm_opt.design.fixed_pose.cells import Search
from fcdm_opt.design.fixed_pose.clearances import EndOfRange, gaps_text
from fcdm_opt.design.fixed_pose.local_search import Found, better, found_at, least_moved, smaller
from fcdm_opt.design.fixed_pose.proof import PoseEvidence, check_proof
from fcdm_opt.design.fixed_pose.worst import Worst, domain, obstacles
from fcdm_opt.design.sizes import SCALES, Sizes, by_name, not_counted, worst_sizes
from fcdm_opt.doors import Shown
from fcdm_opt.errors import InputError, expected, known_arguments
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.units import floored, measured
from fcdm_opt.judge.sampled_sizes import GapClaims
from fcdm_opt.plain import Plain
from fcdm_opt.problem import arguments
from fcdm_opt.problem.active_parts import need_all_parts
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import Check
from fcdm_opt.tolerances import DEFAULT

Verdict = Literal["least worst gap", "inside the window", "no pose", "undecided"]
BEST, INSIDE, NONE, UNDECIDED = get_args(Verdict)
EFFORT = 20_000  # cells: a second or two for two parameters


@dataclass(frozen=True, kw_only=True, eq=False)
class BestPose(Shown, Plain):
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
    transform : (4, 4) array
    amount : float
        Weighted amount of the motion.
    worst_gap : float
        Largest |gap| over all sizes at this pose.
    violation : float
        How far the worst gap is off the window, 0 inside; without a window `worst_gap`. Of "no pose" how far a
        keep-out is come too near to, where that is more.
    least, most : EndOfRange
        The ends of the range of the gap at this pose.
    value, lower_bound : float
        What is made small, the violation or, inside the window, the amount; and what it is proved to be no less than,
        to rounding, whatever the pose.
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
    problem : Problem
        That was asked about.
    standing : tuple of str
        Contacts that are closed at all sizes wherever the motion leads, a flange on its plate: not counted in gaps. A
        contact that the motion can open counts.
    standing_parts : tuple of (int, int)
        Their part pairs.
    """

    plain_names: ClassVar[tuple[str, ...]] = (
        "status", "parameters", "motion", "transform", "amount", "worst_gap", "violation", "least", "most", "value",
        "lower_bound", "certified", "cells", "checks", "sizes", "window", "standing", "seconds",
    )  # fmt: skip
    status: Verdict
    parameters: dict[str, float]
    motion: str
    transform: Array
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
    problem: Problem | None = field(default=None, repr=False)
    standing: tuple[str, ...] = ()
    standing_parts: tuple[tuple[int, int], ...] = ()

    def claims(self, *, proof: bool = False) -> GapClaims:
        """Return what `verify` looks at: the range of the gap at the pose, and what is told of it."""
        if self.problem is None:
            raise InputError("a pose is judged with the problem it is of", key="BestPose.problem", found=None)
        problem = self.problem
        q, (low, high) = np.array([*self.parameters.values()]), self.window
        slack = max(problem.contact_slack, DEFAULT.touch * problem.size)
        end = problem.motion.transform(q, problem.movable.seed, problem.static.seed)
        ends = self.least.gap, self.most.gap
        violation = max(low - ends[0], ends[1] - high, 0.0)
        amount = float(np.linalg.norm(problem.weights * q))
        inside, failed = violation <= slack, self.status in (NONE, UNDECIDED)
        if failed and problem.keep_out:  # it may be off these
            violation, inside = max(violation, self.violation), False
        value = amount if self.status == INSIDE else violation
        known = {BEST: self.window == (0.0, 0.0), INSIDE: inside, NONE: not inside, UNDECIDED: not inside}
        errors = {
            "transform of parameters": np.abs(self.transform - end).max(),
            "amount": abs(self.amount - amount),
            "worst gap": abs(self.worst_gap - max(map(abs, ends))),
            "violation": abs(self.violation - violation),
            "value": abs(self.value - value),
            "lower bound": self.lower_bound - value,
            "limits": np.maximum(problem.limits[:, 0] - q, q - problem.limits[:, 1]).max(),
            "status": 0.0 if known.get(self.status) else np.inf,
        }
        by_names = self.least.names != SCALES
        drawn = problem.request if by_names else vars(problem)
        return GapClaims(
            bodies=(drawn["movable"], drawn["static"]),
            sizes=problem.sizes if by_names else (),
            transform=self.transform,
            least=(ends[0], self.least.rho),
            largest=(ends[1], self.most.rho),
            box=self.sizes.box,
            listed=self.sizes.pairs,
            standing=self.standing_parts,
            keep_out=() if failed else obstacles(problem),
            others=[
                *(Check(name, bool(off <= slack), float(off), slack, "as told") for name, off in errors.items()),
                *(self.check(problem) if proof else ()),
            ],
        )

    @property
    def gap(self) -> float:
        """What the proof leaves open: value less lower bound."""
        return self.value - self.lower_bound

    @property
    def passed(self) -> bool:
        """Whether the collision library confirms the pose."""
        return bool(self.checks) and all(check.passed for check in self.checks)

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
        known = bound if self.lower_bound > 0.0 else "none can be better" if self.certified else "no bound proved"
        ends = gaps_text(self.least.gap, self.most.gap, self.unit)
        told = f"{self.status}: {self.motion}; {ends}; {what} {measured(f'{self.value:.6g}', self.unit)} ({known})"
        return "; ".join([told, *not_counted(self.standing)])

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, without the evidence, see `PoseEvidence.to_dict`."""
        return {**super().to_dict(), "window": [None if np.isinf(end) else end for end in self.window]}


@known_arguments
def best_pose(
    problem: Problem,
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

    Asked are bodies, motion, limits, weights and keep-outs: the problem's goal, path and pair state play no part.

    Parameters
    ----------
    problem : Problem
        Its keep-outs are kept clear of at all sizes; a proof comes without evidence then.
    sizes : (n, 2) array, or a distribution for each body, optional
        The pairs that must all do: a list, or all that the distributions can give.
    box : ((low_1, high_1), (low_2, high_2)), optional
        All sizes of a box, in place of `sizes`; default the problem's tolerance, or without one its own sizes within
        their tolerances: proved then where the motion is made of translations, whose gap is that of `stack_up`.
    clearance : (low, high), optional
        The window of the gap, length units.
    certify : bool
        Whether to prove how good the pose is, and to look everywhere; else the best pose near rest is returned.
    accuracy : float
        Relative difference of value and lower bound at which the proof is complete.
    effort : int
        Cells at most. One and two parameters seldom need so many; with three and more the bound reached is told.

    Raises
    ------
    InputError
        For sizes that are none (see `clearances`), an empty window, a problem with several contacts, steps
        of a machine or another amount than the weighted one, and where limits are missing that keep the search finite.
    """
    start = time.perf_counter()
    expected(problem, Problem, "problem")
    arguments.truth(certify, "certify")
    arguments.whole(effort, "effort", "number of cells", 1)
    for key, asked_for, found, instead in (
        ("contacts", bool(problem.contacts), "several", None),
        ("resolution", problem.resolution is not None, problem.resolution, None),
        ("amount", problem.amount != "weighted", problem.amount, "weighted"),
    ):
        if asked_for:
            what = f"one pose for all pairs is about the gap of two bodies, and does not look at {key}"
            more = ', goal="touch"' if key == "contacts" else ""
            plain = f"no {key} in the file" + (' and goal = "touch"' if more else "")
            allowed = f"{plain}; in Python problem.changed({key}={instead!r}{more})"
            raise InputError(what, key=key, found=found, allowed=allowed)
    accuracy = arguments.real(accuracy, "accuracy", "a number from 1e-12 to 1", lambda x: 1e-12 <= x <= 1)
    low, high = (0.0, 0.0) if clearance is None else arguments.interval(clearance, "clearance")
    if low == -np.inf and high == np.inf:
        raise InputError("a window without ends asks for nothing", key="clearance", found=clearance)
    own = by_name(problem, sizes, box)
    asked = None if own else worst_sizes(problem, sizes, box)
    if not own:
        need_all_parts(problem, "a pose for all sizes")
    worst = Worst.of(problem, asked, low, high)
    worst.leave_out_standing()
    slack, effort = problem.contact_slack, effort if certify and worst.scene.covers else 0
    first = best = better(worst, np.zeros(len(worst.limits)))
    inside = clearance is not None and best.off.value <= slack
    if not inside:
        search = _searched(worst, best, slack, accuracy, effort, amounts=False, stop=clearance is not None)
        best = search.best
        inside = clearance is not None and best.off.value <= slack
    if inside:
        best = smaller(worst, best, slack)
        search = _searched(worst, best, slack, accuracy, effort, amounts=True)
        best, value, bound = search.best, search.value, _proved(search)
    else:
        best = least_moved(worst, best, first)
        value, lower = best.off.excess, _proved(search)
        bound = min(lower, value) if best.off.clear else min(2.0 * slack, value) if lower >= best.off.value else 0.0
    done = value - bound <= max(accuracy * abs(value), slack) or (bound > slack and not best.off.clear)
    status = NONE if bound > slack else UNDECIDED
    if inside or (clearance is None and best.off.clear):
        status = INSIDE if inside else BEST
    ends = (EndOfRange.of(worst.scene, best.off.rows, end) for end in best.off.extremes[:2])
    least, most = (end.without_rounding(problem.size) for end in ends)
    q = np.where(np.abs(problem.weights * best.q) <= DEFAULT.weld * problem.size, 0.0, best.q)
    pose = BestPose(
        status=status,
        parameters=problem.motion.by_name(q),
        motion=problem.motion.describe(q.tolist(), unit=problem.unit),
        transform=frozen(worst.transform(best.q)),
        amount=best.amount,
        worst_gap=max(abs(least.gap), abs(most.gap)),
        violation=max(best.off.excess, 0.0),
        least=least,
        most=most,
        value=value,
        lower_bound=bound,
        certified=bool(done),
        cells=len(search.nodes),
        checks=(),
        sizes=worst.scene.sizes,
        window=(low, high),
        evidence=PoseEvidence.of(search) if search.nodes and not (own or problem.keep_out) else None,
        seconds=0.0,
        unit=problem.unit,
        problem=problem,
        standing=worst.scene.standing_in_words,
        standing_parts=tuple(worst.scene.standing),
    )
    return replace(pose, checks=pose.claims().checks(), seconds=time.perf_counter() - start)


def _proved(search: Search) -> float:
    """Return what no pose has less of; without a proof what is known anyhow."""
    if search.nodes:
        return search.lower
    return 0.0 if search.amounts else search.worst.floor


def _searched(
    worst: Worst, best: Found, slack: float, accuracy: float, effort: int, *, amounts: bool, stop: bool = False
) -> Search:
    """Look for the smallest motion into the window, or the pose whose worst gap is off least.

    With `stop` until one is in the window.
    """
    limits = worst.limits
    if effort:
        most, amount = (worst.high + slack, best.amount) if amounts else (best.off.value + worst.high, np.inf)
        limits = _bounded(worst, domain(worst, most, amount))

    def improve(q: Array) -> Found:
        return smaller(worst, found_at(worst, q), slack) if amounts else better(worst, q)

    search = Search(worst, limits, best, slack, amounts, improve)
    if effort and (best.amount > slack if amounts else best.off.value > max(worst.floor, 0.0) + slack):
        search.run(accuracy=accuracy, near=slack, most=effort, settled=lambda: stop and search.best.off.value <= slack)
    if not amounts and search.best is not best:  # the centre of a cell that may beat others by a little only
        search.best = min(search.best, improve(search.best.q), key=lambda own: own.off.value)
    return search


def _bounded(worst: Worst, limits: Array) -> Array:
    """Return limits that are all finite; raise `InputError` for others."""
    for name, ends in zip(worst.problem.motion.names, limits.tolist(), strict=True):
        if not np.isfinite(ends).all():
            what = "nothing bounds this parameter: a proof needs limits"
            allowed = "finite limits, a window with a finite upper end, or certify=False"
            raise InputError(what, key=f"limits.{name}", found=ends, allowed=allowed)
    return limits
