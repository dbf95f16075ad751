"""Budget: the largest tolerance such that it and all smaller ones can be made good within a limit on the motion.

The least amount as a function of the tolerance may have kinks, jumps and windows without a motion, so the last
crossing of the limit says nothing, and neither does bisection. Where the questions are nested (`order`), the first
crossing is the only one: that is proved, and bisection is enough. Elsewhere tolerances are sampled, denser where
contacts change, and where the amount comes near the limit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fcdm_opt.design.whatif.fitting import Order, narrowed, order
from fcdm_opt.errors import InputError, expected, known_arguments
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.plain import Plain, plain
from fcdm_opt.problem import arguments
from fcdm_opt.problem.keys import Requirement
from fcdm_opt.problem.problem import SIGNS, Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

LARGEST = 0.2  # tolerance up to which is looked, unless asked otherwise: sizes 20 % off are no longer a tolerance
CELLS = 64  # of equal width up to there
SMALLEST = 10.0 * DEFAULT.side  # tolerance below which the judge, who opens and closes by `side`, can tell nothing
SPLITS = 12  # of a cell in which something changes: what hides there is 4096 times narrower than the cell
FINEST = 1e-13  # relative width of a bracket that floats still resolve


class End(Enum):
    """What ends a budget; the value says it in words."""

    LIMIT = "the least amount exceeds the limit"
    NO_MOTION = "there is no motion"
    OUTSIDE_FIT = "the motion leaves the fit"
    NOT_VERIFIED = "the judge rejects the motion"
    LARGEST = "the largest tolerance looked at is still good"


@dataclass(frozen=True, eq=False, kw_only=True)
class Budget(Plain):
    """The largest tolerance of one requirement.

    Attributes
    ----------
    requirement : str
    tolerance : float
        All tolerances up to this one can be made good; 0 where none can.
    table : (2, 2) array
        What it means for each body, minus and plus: `tolerance` times the shape.
    end : End
        What is wrong just above it.
    solution : Solution or None
        At `tolerance`, None where that is 0 and the question does not hold there.
    above : Solution or None
        At the upper end of the bracket, None where the largest tolerance looked at is good.
    bracket : (float, float)
        The last tolerance found good and the first found bad.
    limit : float or None
    points : int
        Tolerances that were solved.
    proved : bool
        Whether all smaller tolerances are proved good; else they are sampled.
    reason : str
        Why it is proved, or how it was sampled.
    spacing : float
        Widest gap between tolerances that were looked at, 0 where `proved`.
    """

    plain_names: ClassVar[tuple[str, ...]] = (
        "requirement", "tolerance", "table", "end", "advice", "amount", "parameters", "bracket", "limit", "points",
        "proved", "end_proved", "reason", "spacing",
    )  # fmt: skip

    requirement: str
    tolerance: float
    table: Array
    end: End
    solution: Solution | None
    above: Solution | None
    bracket: tuple[float, float]
    limit: float | None
    points: int
    proved: bool
    reason: str
    spacing: float

    @property
    def amount(self) -> float:
        """Least amount at `tolerance`, length units; nan where there is no motion."""
        return float("nan") if self.solution is None else self.solution.amount

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the least motion at `tolerance`, empty where there is none."""
        return {} if self.solution is None else dict(self.solution.parameters)

    @property
    def advice(self) -> str:
        """What ends it, in words."""
        return self.end.value

    @property
    def end_proved(self) -> bool:
        """Whether the upper end of the bracket is proved bad, by a bound on its amount or its status."""
        if self.above is None:
            return False
        over = self.limit is not None and self.above.lower_bound > self.limit
        return over or self.above.status.name == "INFEASIBLE"

    def __str__(self) -> str:
        """Return one line: how far, what ends it, and whether that is proved."""
        word = "proved" if self.proved else "sampled"
        return f"{self.requirement}: up to {100 * self.tolerance:.6g} % ({word}); above, {self.end.value}"


@dataclass(frozen=True, eq=False, kw_only=True)
class Budgets(Mapping[str, Budget]):
    """A budget for each requirement: a mapping from its letter.

    Attributes
    ----------
    problem : Problem
    limit : float or None
    shape : (2, 2) array
        Tolerances of the bodies, minus and plus, at tau = 1; the largest is 1.
    largest : float
        Tolerance up to which was looked.
    each : dict
        Letter -> `Budget`.
    """

    problem: Problem = field(repr=False)
    limit: float | None
    shape: Array
    largest: float
    each: Mapping[str, Budget]

    def __getitem__(self, letter: str) -> Budget:
        """Return the budget of a requirement."""
        return self.each[letter]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the letters."""
        return iter(self.each)

    def __len__(self) -> int:
        """Return how many requirements were looked at."""
        return len(self.each)

    @property
    def tolerance(self) -> float:
        """Largest tolerance that is good for every requirement."""
        return min(one.tolerance for one in self.each.values())

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        told = {"limit": self.limit, "shape": self.shape, "largest": self.largest, "tolerance": self.tolerance}
        return plain({**told, "requirements": self.each})

    def __str__(self) -> str:
        """Return a line for each requirement."""
        return "\n".join(str(one) for one in self.each.values())


@known_arguments
def budget(
    problem: Problem,
    limit: float | None,
    *,
    requirements: Sequence[Requirement] | None = None,
    largest: float = LARGEST,
    accuracy: float = DEFAULT.nominal,
    scale: bool = True,
) -> Budgets:
    """Find for each requirement the largest tolerance such that it and all smaller ones can be made good.

    A tolerance is good where the least amount is at most `limit`, and the solution usable.

    Parameters
    ----------
    problem : Problem
        Its goal, motion, limits and keep-outs hold for every requirement.
    limit : float or None
        Largest amount, length units; None: the problem's own limits and keep-outs decide alone.
    requirements : sequence of letters, optional
        Default all four.
    largest : float
        Tolerance up to which is looked, below 1.
    accuracy : float
        Relative width to which the first crossing is bracketed.
    scale : bool
        Whether to keep the shape of the problem's tolerance, where it has one for each body or side: tau is then the
        largest of its entries. Else, and without a tolerance, all are equal.

    Returns
    -------
    Budgets

    Raises
    ------
    InputError
        For arguments out of range, a question that does not hold with a requirement, and a problem whose tolerances are
        those of sizes of its own.
    """
    expected(problem, Problem, "problem")
    if problem.sizes and problem.tolerance is None:
        what = "a budget is the largest tolerance of the uniform scales, and the tolerances here are those of sizes"
        found = ", ".join(size.name for size in problem.sizes)
        allowed = "`stack` with --cost, which finds tolerances of sizes; or a tolerance of the scales besides"
        raise InputError(what, key="sizes", found=found, allowed=allowed)
    if limit is not None:
        limit = arguments.real(limit, "limit", "a length >= 0, or None", lambda x: x >= 0)
    largest = arguments.real(largest, "largest", "a tolerance > 0 and < 1", lambda x: 0 < x < 1)
    accuracy = arguments.real(accuracy, "accuracy", f"a number from {FINEST} to 1", lambda x: FINEST <= x < 1)
    arguments.truth(scale, "scale")
    given = requirements if isinstance(requirements, str) else arguments.items(requirements)
    letters = tuple(SIGNS) if requirements is None else tuple(given)
    for letter in letters:
        arguments.choice(letter, "requirements", tuple(SIGNS))
    if not letters:
        raise InputError("no requirement is asked for", key="requirements", found=requirements, allowed="A, B, C, D")
    shape = frozen(_shape(problem) if scale else np.ones((2, 2)))
    each = {letter: _Tolerances(problem, letter, shape, limit, largest, accuracy).budget() for letter in letters}
    return Budgets(problem=problem, limit=limit, shape=shape, largest=largest, each=each)


def _shape(problem: Problem) -> Array:
    table = problem.tolerance
    if table is None or not table.any():
        return np.ones((2, 2))
    return table / float(table.max())


class _Point(NamedTuple):
    """A tolerance that was solved."""

    tau: float
    good: bool
    solution: Solution

    @property
    def amount(self) -> float:
        return self.solution.amount

    def like(self, other: _Point) -> bool:
        """Tell whether the same contact is held by the same constraints in the same state."""
        one, two = self.solution, other.solution
        return (one.status, one.features, one.active) == (two.status, two.features, two.active)


@dataclass(eq=False)
class _Tolerances:
    """The search along the tolerances of one requirement."""

    problem: Problem
    letter: str
    shape: Array
    limit: float | None
    largest: float
    accuracy: float
    points: dict[float, _Point] = field(default_factory=dict)

    def at(self, tau: float) -> _Point:
        """Solve at a tolerance, once."""
        if tau not in self.points:
            solution = solve(self.asked(tau), effort="quick")
            good = solution.usable and (self.limit is None or solution.amount <= self.limit * (1.0 + DEFAULT.cut))
            self.points[tau] = _Point(tau, good, solution)
        return self.points[tau]

    def asked(self, tau: float) -> Problem:
        """Return the question at a tolerance."""
        table = tuple(map(tuple, (tau * self.shape).tolist()))
        goal = self.problem.goal
        return self.problem.changed(requirement=self.letter, tolerance=table, target=None, goal=goal)

    def budget(self) -> Budget:
        """Return the budget."""
        lie, why = order(self.asked(self.largest))
        if lie is Order.ANY:
            spacing = self.largest / CELLS
            low, high = self._scanned()
            why += f": sampled every {spacing:.3g} from {SMALLEST:.3g}, down to {spacing / 2**SPLITS:.3g} at changes"
        else:
            spacing = 0.0
            low, high = self._nested(lie)
        tolerance = 0.0 if low is None else low.tau
        return Budget(
            requirement=self.letter,
            tolerance=tolerance,
            table=frozen(tolerance * self.shape),
            end=self._end(high),
            solution=None if low is None else low.solution,
            above=None if high is None else high.solution,
            bracket=(tolerance, self.largest if high is None else high.tau),
            limit=self.limit,
            points=len(self.points),
            proved=lie is not Order.ANY,
            reason=why,
            spacing=spacing,
        )

    def _end(self, high: _Point | None) -> End:
        if high is None:
            return End.LARGEST
        if not high.solution.status.found:
            return End.NO_MOTION
        if high.solution.status.name == "OUTSIDE_FIT":
            return End.OUTSIDE_FIT
        return End.LIMIT if high.solution.usable else End.NOT_VERIFIED

    def _nested(self, lie: Order) -> tuple[_Point | None, _Point | None]:
        """Return the last good and the first bad tolerance where there is one stretch of good ones at most."""
        if lie is Order.ALL_OR_NONE:
            zero = self.at(0.0)
            return (self.at(self.largest), None) if zero.good else (None, zero)
        first, last = self.at(SMALLEST), self.at(self.largest)
        if last.good:
            return last, None
        return self._narrowed(first, last) if first.good else (None, first)

    def _scanned(self) -> tuple[_Point | None, _Point | None]:
        """Return the last good and the first bad tolerance of all that are looked at, from the smallest."""
        cell = self.largest / CELLS
        halvings = range(int(np.log2(cell / SMALLEST)), 0, -1) if cell > SMALLEST else ()
        taus = [*(cell / 2**k for k in halvings), *(cell * np.arange(1, CELLS)).tolist(), self.largest]
        low = self.at(SMALLEST)
        if not low.good:
            return None, low
        for tau in (tau for tau in taus if tau > SMALLEST):
            high = self.at(tau)
            if crossing := self._crossing(low, high, min(cell, tau) / 2**SPLITS):
                return self._narrowed(*crossing)
            low = high
        return low, None

    def _crossing(self, low: _Point, high: _Point, finest: float) -> tuple[_Point, _Point] | None:
        """Return a good tolerance and a bad one with one crossing between them, the first; None where all are good."""
        if high.tau - low.tau <= finest or self._is_calm(low, high):
            return None if high.good else (low, high)
        middle = self.at((low.tau + high.tau) / 2)
        if not middle.good:
            return self._crossing(low, middle, finest)
        return self._crossing(low, middle, finest) or self._crossing(middle, high, finest)

    def _is_calm(self, low: _Point, high: _Point) -> bool:
        """Tell whether nothing suggests another crossing between two tolerances, the first of which is good.

        The same contact at both ends; where both are good, an amount farther from the limit than it changes, too.
        """
        if not low.like(high):
            return False
        if self.limit is None or not high.good:
            return True
        return max(low.amount, high.amount) + abs(high.amount - low.amount) <= self.limit

    def _narrowed(self, low: _Point, high: _Point) -> tuple[_Point, _Point]:
        """Return a bracket of the asked width."""
        good, bad = narrowed(
            lambda tau: self.at(tau).good, low.tau, high.tau, lambda good, bad: bad - good <= self.accuracy * bad
        )
        return self.at(good), self.at(bad)
