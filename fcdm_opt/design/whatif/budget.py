"""Budget: the largest tolerance such that it and all smaller ones can be made good within a limit on the motion.

The least amount as a function of the tolerance may have kinks, jumps and windows without a motion, so the last
crossing of the limit says nothing, and neither does bisection. Where the questions are nested (`order`), the first
crossing is the only one: that is proved, and bisection is enough. Elsewhere tolerances are sampled, denser where
contacts change, and where the amount comes near the limit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property, lru_cache
from itertools import cycle, product
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.touching_sizes import TouchingSizes
from fcdm_opt.curve.true_sizes import ROLES, made_at, touching_true_faces
from fcdm_opt.design.sizes import by_name, not_counted, tolerance_boxes
from fcdm_opt.design.whatif.fitting import NOT_MET, Order, barred_text, narrowed, order
from fcdm_opt.errors import InputError, expected, known_arguments, known_word
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.resizing import Resizing, fit_for_sizes
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import measured
from fcdm_opt.model.mesh_error import too_wide
from fcdm_opt.model.true_faces import has_round_faces
from fcdm_opt.plain import Plain, plain
from fcdm_opt.problem import arguments
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.fit import verdict
from fcdm_opt.problem.keys import Requirement
from fcdm_opt.problem.problem import SIGNS, Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Bounded, Status
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

SizeCorner = Literal["worst", "loosest", "low", "high", "corners"]
LARGEST = 0.2  # tolerance up to which is looked, unless asked otherwise: sizes 20 % off are no longer a tolerance
WIDENED = 4.0  # times the tolerances of sizes up to which is looked, and as far as all faces stay: this share of it
STAYS = 0.999
CORNERS: tuple[SizeCorner, ...] = ("worst", "loosest", "low", "high", "corners")  # of a box of sizes
OF = {
    "worst": "the sizes with the least gap at rest",
    "loosest": "the sizes with the largest gap at rest",
    "low": "all sizes at their least",
    "high": "all sizes at their largest",
    "corners": "each size at either end, in every combination",
}
FEW, MANY = 4, 8  # sizes: the combinations that are looked at where none are asked for, and at most
OWN_CORNER = "good up to {} only where all sizes are off at once, as at each of these corners; "
NO_GUARANTEE = "{}sizes that are at no corner {}may need more, or have no motion (see map)"
ALL_SIZES = "worst holds for all sizes within: none has more material, so its motion clears them, too"
OF_SCALES = ("made", "larger", "smaller")  # which way the parts of an assembly are off
CELLS = 64  # of equal width up to there
SMALLEST = 10.0 * DEFAULT.side  # tolerance below which the judge, who opens and closes by `side`, can tell nothing
DEARER = 8  # times: what a tolerance of sizes, or of parts with round faces, costs to look at
STRAIGHT = 1e-4  # of an amount: so near to a straight line three of them are on one
LOOKS = 8  # tolerances a cell, on the average, after which changes are not looked into any more
SECANTS = 8  # guesses of a crossing by the amounts at both ends, each twice as near at least, before it is halved
SPLITS = 12  # of a cell in which something changes: what hides there is 4096 times narrower than the cell
FINEST = 1e-13  # relative width of a bracket that floats still resolve


Deviations = Literal["made", "larger", "smaller"]


class End(Enum):
    """What ends a budget; the value says it in words, those of `barred_text` where there is no motion to use."""

    LIMIT = "the least amount exceeds the limit"
    MISFIT = "does not fit"
    NOT_MET = NOT_MET
    NO_MOTION = Status.INFEASIBLE.words
    NOT_FOUND = Status.NOT_FOUND.words
    NOT_IN_STEPS = Status.NOT_IN_STEPS.words
    BEYOND_RANGE = Status.LEFT_COHERENT_RANGE.words
    NOT_VERIFIED = Status.NOT_VERIFIED.words
    LARGEST = "the largest tolerance looked at is still good"
    TIME = "the time limit was met"


@dataclass(frozen=True, eq=False, kw_only=True)
class Budget(Plain):
    """The largest tolerance of one requirement."""

    plain_names: ClassVar[tuple[str, ...]] = (
        "requirement", "corner", "tolerance", "table", "end", "advice", "amount", "parameters", "bracket", "limit",
        "points", "proved", "end_proved", "reason", "spacing", "permanent",
    )  # fmt: skip

    # a letter; of sizes by name the corner of their box: "worst", "loosest", "low", "high" or all "corners"; of the
    # scales of an assembly's parts "made" (which way they are off), "larger" or "smaller". `corner` tells which sizes:
    # "worst" is that of the gap at rest, and no guarantee for all sizes where a motion is to make good for two gaps
    requirement: str
    # all tolerances up to this one can be made good; 0 where none can, or none is known (`end` tells): parts as drawn
    # may be good all the same, see `bracket`. Of sizes the largest deviation of a length (of a scale, where there are
    # no lengths), those of the others in proportion
    tolerance: float
    # what it means for each body, minus and plus, (2, 2), or each size, least and largest deviation, (k, 2):
    # `tolerance` times the shape. Of an assembly's scales twice the deviation of each part
    table: Array
    end: End  # what is wrong just above it; or that the time limit was met, so that larger ones may be good
    # at `tolerance`, None where that is 0 and the parts as drawn are not good, or the question does not hold there
    solution: Bounded | None
    # at the upper end of the bracket, or past it where the judge can tell; None where the largest looked at is good
    above: Bounded | None
    # the last tolerance found good and the first found bad; both 0 where parts as drawn are not good
    bracket: tuple[float, float]
    limit: float | None
    points: int  # tolerances that were solved
    proved: bool  # whether all smaller tolerances are proved good; else they are sampled
    reason: str  # why it is proved, or how it was sampled
    spacing: float  # widest gap between tolerances that were looked at, 0 where `proved`
    # names of the rows of `table`, sizes or parts of an assembly; none where these are the scales of both bodies
    sizes: tuple[str, ...] = ()
    unit: str = ""  # of lengths, "" where the problem names none
    # contacts that are closed at all sizes looked at, a flange on its plate, where corners are of gaps
    permanent: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {**super().to_dict(), **({"sizes": list(self.sizes), "unit": self.unit} if self.sizes else {})}

    @property
    def corner(self) -> str:
        """Which sizes a corner of their box means, in words; "" of scales."""
        return OF.get(self.requirement, "")

    @property
    def of_scales(self) -> bool:
        """Whether tolerances are shares of scales, not deviations of sizes."""
        return not self.sizes or self.requirement in OF_SCALES

    def tolerance_text(self, digits: int = 6) -> str:
        """Return the tolerance in words: a share of the scales, or a deviation of sizes; whether that is none."""
        if self.solution is None:
            return "not known" if self.end is End.TIME else "not even as drawn"
        if self.end is not End.TIME and not self.tolerance:
            return "only as drawn"
        return _measured(self.tolerance, self.of_scales, self.unit, digits)

    def sizes_text(self, digits: int = 6) -> str:
        """Return how far each size may be off, in words, or each scale, where these are not alike."""
        rows = zip(self.sizes, self.table.tolist(), strict=True) if self.sizes else ()
        if not self.sizes:
            each = zip(("movable", "static"), (100.0 * self.table).tolist(), strict=True) if np.ptp(self.table) else ()
            return ", ".join(f"{part} -{minus:.{digits}g} to +{plus:.{digits}g} %" for part, (minus, plus) in each)
        if self.of_scales:
            return ", ".join(f"{part} {100.0 * share + 0.0:+.{digits}g} %" for part, (share, _) in rows)
        return ", ".join(f"{name} {low + 0.0:+.{digits}g} to {high + 0.0:+.{digits}g}" for name, (low, high) in rows)

    def share_text(self, sizes: Sequence[Size]) -> str:
        """Return how many times the tolerances of sizes those are of which `tolerance` is the largest; "" of scales."""
        given = {own.name: max(map(abs, own.tolerance)) for own in sizes if own.tolerance and any(own.tolerance)}
        rows = () if self.of_scales else zip(self.sizes, np.abs(self.table).max(axis=1).tolist(), strict=True)
        times = [most / given[name] for name, most in rows if name in given]
        alike = bool(times) and max(times) - min(times) <= DEFAULT.side * max(times)
        return f"{times[0]:.4g} times their tolerances: " if alike else ""

    @property
    def amount(self) -> float:
        """Least amount at `tolerance`, length units; nan where there is no motion."""
        return float("nan") if self.solution is None else self.solution.amount

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of the least motion at `tolerance`, empty where there is none."""
        return {} if self.solution is None else self.solution.coordinates

    @property
    def advice(self) -> str:
        """What ends it, in words: of all corners at which, with the widths where the parts do not go together."""
        if self.above is None:
            return self.end.value
        head, _, why = (verdict(self.above.question) * (self.end is End.MISFIT) or self.end.value).partition(": ")
        made = self.above.question.made.items() if self.requirement == "corners" else ()
        at = ", ".join(f"{name} {x + 0.0:+.6g}" for name, x in made)
        return f"{head}{f' at {at}' * bool(at)}{f': {why}' * bool(why)}"

    @property
    def closed_text(self) -> str:
        """Which contacts are closed at all sizes, in words, "" where none are: goal "touch" is met by them."""
        met = self.solution is not None and getattr(self.solution.question, "goal", "") == "touch"
        asked = 'so that goal "touch" asks for no motion' if met else "and not counted in the gap of the corner"
        return "".join(not_counted(self.permanent, asked))

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
        sizes = f": {self.sizes_text()}" if self.sizes_text() else ""
        head = f"{self.requirement} ({self.corner})" if self.corner else self.requirement
        if self.end is End.TIME and self.solution is None:
            return f"{head}: not known, {self.advice}"
        line = f"{head}: up to {self.tolerance_text()} ({word}{sizes}); above, {self.advice}"
        if self.bracket[1] == 0.0:
            line = f"{head}: {self.tolerance_text()}: {self.advice}{' (proved)' * self.end_proved}"
        elif not self.tolerance:
            line = f"{head}: {self.tolerance_text()}; above, {self.advice}"
        return "; ".join(filter(None, (line, self.closed_text)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Budgets(Mapping[str, Budget]):
    """A budget for each requirement: a mapping from its letter."""

    problem: Scene = field(repr=False)
    limit: float | None
    # tolerances of the bodies, minus and plus, at tau = 1, (2, 2); the largest is 1. Or deviations of sizes, (k, 2)
    shape: Array
    largest: float  # tolerance up to which was looked
    each: Mapping[str, Budget]  # letter -> `Budget`

    def __getitem__(self, letter: str) -> Budget:
        return self.each[letter]

    def __iter__(self) -> Iterator[str]:
        return iter(self.each)

    def __len__(self) -> int:
        return len(self.each)

    @property
    def tolerance(self) -> float:
        """Largest tolerance that is good for every requirement looked at; of sizes at corners, see `Budget.corner`."""
        return min(one.tolerance for one in self.each.values())

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        data = {"limit": self.limit, "shape": self.shape, "largest": self.largest, "tolerance": self.tolerance}
        return plain({**data, "requirements": self.each})

    @property
    def open_text(self) -> str:
        """What corners of several sizes leave open, in words; "" of others."""
        if not any(one.corner and len(one.sizes) > 1 for one in self.each.values()):
            return ""
        if "worst" in self.each and self.each["worst"].proved:
            return ALL_SIZES
        if "corners" in self.each:
            return NO_GUARANTEE.format("", "")
        least = min(self.each.values(), key=lambda one: one.tolerance)
        return NO_GUARANTEE.format(OWN_CORNER.format(least.tolerance_text()) * bool(least.tolerance), "looked at ")

    def __str__(self) -> str:
        """Return a line for each requirement, and what corners of several sizes leave open."""
        return "\n".join(filter(None, [*map(str, self.each.values()), self.open_text]))


def _measured(tolerance: float, of_scales: bool, unit: str, digits: int) -> str:
    """Return a tolerance in words: a share of scales in per cent, a deviation of sizes in their unit."""
    return measured(f"{100.0 * tolerance if of_scales else tolerance:.{digits}g}", "%" if of_scales else unit)


@known_arguments
def budget(
    problem: Scene,
    limit: float | None,
    *,
    requirements: Literal["all"]
    | Sequence[Requirement | SizeCorner | Deviations]
    | SizeCorner
    | Deviations
    | None = None,
    largest: float | None = None,
    accuracy: float = DEFAULT.nominal,
    scale: bool = True,
) -> Budgets:
    """Find for each requirement the largest tolerance such that it and all smaller ones can be made good.

    A tolerance is good where the least amount is at most `limit`, and the solution usable.

    Parameters
    ----------
    problem : Problem or Assembly
        Its goal, motion, limits and keep-outs hold for every requirement. One with sizes of its own and no tolerance of
        the scales is asked how far these may be off, an assembly without sizes how far the scales of its parts may.
    limit : float or None
        Largest amount, length units; None: the problem's own limits and keep-outs decide alone.
    requirements : "all", or sequence of letters, optional
        Default all four. Of sizes the corners of their box: "worst" (the least gap as drawn), "loosest" (the largest),
        "low" and "high" (all at their least, their largest), "corners" (each at either end, in every combination, of
        up to 8 sizes); default of two to four sizes "corners", of up to 8 of an assembly whose motions only shift (of
        more than four all at `tolerance`, one below it); else "worst" and "loosest", as where the motion of "worst"
        clears all, and of surfaces, of scales that turn faces and of other assemblies "low" and "high". Of the
        scales of an assembly's parts "made" (in proportion as they are off), and all "larger" or "smaller" alike;
        default "made", of parts as drawn the two others.
    largest : float, optional
        Tolerance up to which is looked; default 0.2, of sizes four times their own or as far as no face vanishes.
    accuracy : float
        Relative width to which the first crossing is bracketed.
    scale : bool
        Whether to keep the shape of the problem's tolerance, where it has one for each body or side: tau is then the
        largest of its entries. Else, and without a tolerance, all are equal. Of sizes in the same way.

    Raises
    ------
    InputError
        For arguments out of range, a question that does not hold with a requirement, and sizes without a tolerance.
    """
    expected(problem, (Problem, Assembly), "problem")
    own = by_name(problem)
    if limit is not None:
        limit = arguments.real(limit, "limit", "a length >= 0, or None", lambda x: x >= 0)
    accuracy = arguments.real(accuracy, "accuracy", f"a number from {FINEST} to 1", lambda x: FINEST <= x < 1)
    arguments.truth(scale, "scale")
    known: tuple[str, ...] = CORNERS if own else tuple(SIGNS)
    if own:
        shape, most, usual = _shape_of_sizes(problem, scale)
        known = CORNERS[2:] if isinstance(problem, Assembly) else known
        known = known if len(shape) <= MANY else tuple(name for name in known if name != "corners")
    elif isinstance(problem, Assembly):
        shape, most, known = _deviations(problem, scale), LARGEST, OF_SCALES
        usual = OF_SCALES[:1] if problem.deviates else OF_SCALES[1:]
    elif isinstance(problem, Problem):
        shape, most, usual = np.ones((2, 2)), LARGEST, known
        if scale and problem.tolerance is not None and problem.tolerance.any():
            shape = problem.tolerance / float(problem.tolerance.max())
    if largest is None:
        largest = most
    else:
        allowed = "a tolerance > 0" if own else "a tolerance > 0 and < 1"
        largest = arguments.real(largest, "largest", allowed, lambda x: x > 0 and (own or x < 1))
    shape = frozen(shape)
    if own and isinstance(problem, Assembly) and problem.shifts and 1 < len(shape) <= MANY:
        usual = CORNERS[-1:]
    elif own and requirements is None and 1 < len(shape) <= FEW:
        worst = _Tolerances(problem, "worst", shape, limit, largest, accuracy)
        with suppress(pacing.TimeOverError):
            usual = usual if usual == CORNERS[:2] and worst.has_most_material else CORNERS[-1:]
    every = known if requirements == "all" else usual if requirements is None else None
    given: Any = every if every is not None else (requirements,) if requirements in known else requirements
    letters = tuple(given if isinstance(given, str) else arguments.items(given))
    for letter in letters:
        known_word(letter, known, "unknown requirements", key="requirements")
    if not letters:
        allowed = ", ".join(known)
        raise InputError("no requirement is asked for", key="requirements", found=requirements, allowed=allowed)
    each = dict[str, Budget]()
    for k, letter in enumerate(letters):
        own_shape = {"larger": np.ones_like(shape), "smaller": -np.ones_like(shape)}.get(letter, shape)
        with pacing.sharing(1.0 / (len(letters) - k)):
            each[letter] = _Tolerances(problem, letter, own_shape, limit, largest, accuracy).budget()
    return Budgets(problem=problem, limit=limit, shape=shape, largest=largest, each=each)


def _deviations(assembly: Assembly, scale: bool) -> Array:
    """Return how the scales of all parts are off, twice each, (k, 2), the largest by 1; of parts as drawn all alike."""
    off = np.array([x - 1.0 for x in assembly.scales.values()])
    largest = float(np.abs(off).max())
    return np.repeat((off / largest if scale and largest else np.ones(len(off)))[:, None], 2, axis=1)


def _shape_of_sizes(problem: Scene, scale: bool) -> tuple[Array, float, tuple[str, ...]]:
    """Return deviations of sizes, (k, 2), of lengths up to 1, times what is looked at most, and at which corners."""
    box, lengths = tolerance_boxes(problem.sizes), np.array([size.is_length for size in problem.sizes])
    unit = float(np.abs(box[lengths] if lengths.any() else box).max())
    if not unit > 0.0:
        raise InputError("all sizes are as drawn", key="sizes.tolerance", found=box.tolist(), allowed="tolerances > 0")
    shape, most = box / unit if scale else np.tile([-1.0, 1.0], (len(box), 1)), WIDENED * unit
    usual: tuple[str, ...] = CORNERS[2:4] if isinstance(problem, Assembly) else CORNERS[:2]
    for role, body in problem.drawn.items():
        rows = [k for k, size in enumerate(problem.sizes) if size.body == role]
        if body.is_surface and rows:
            usual = CORNERS[2:4]
        elif rows:
            moving = Resizing.of(body, [problem.sizes[k] for k in rows])
            most = min(most, STAYS * moving.valid_up_to(*shape[rows].T)[0])
            usual = CORNERS[2:4] if moving.inclined() else usual
    return shape, most, usual


class _Point(NamedTuple):
    """A tolerance that was solved."""

    tau: float
    good: bool
    solution: Bounded

    @property
    def amount(self) -> float:
        return self.solution.amount

    def like(self, other: _Point) -> bool:
        """Tell whether the same contact is held by the same constraints in the same state; one is, where none moves."""
        one, two = self.solution, other.solution
        met = one.status is two.status is Status.ALREADY_SATISFIED
        shared = met and {*getattr(one, "features", ())} & {*getattr(two, "features", ())}
        return bool(shared) or one.is_held_like(two)

    def leads_straight(self, middle: _Point, last: _Point, limit: float | None) -> bool:
        """Tell whether amounts change evenly from here over another tolerance to a third, all of them good."""
        share = (middle.tau - self.tau) / (last.tau - self.tau)
        off = abs(middle.amount - self.amount - share * (last.amount - self.amount))
        room = STRAIGHT * max(self.amount, middle.amount, last.amount)
        below = limit is None or max(self.amount, middle.amount, last.amount) + room <= limit
        return middle.good and last.good and off <= room and below


@lru_cache(maxsize=2)
def _touching(one: Body, two: Body, sizes: tuple[Size, ...]) -> TouchingSizes:
    return touching_true_faces(one, two, sizes, least=False, permanent=False)


@dataclass(eq=False)
class _Tolerances:
    """The search along the tolerances of one requirement."""

    problem: Any
    letter: str
    shape: Array
    limit: float | None
    largest: float
    accuracy: float
    points: dict[float, _Point] = field(default_factory=dict)
    questions: dict[float, list[Scene]] = field(default_factory=dict)  # those of the last one
    hurried: float = np.inf  # from here on changes were not looked into

    def at(self, tau: float) -> _Point:
        """Solve at a tolerance, once."""
        if tau not in self.points:
            pacing.at(
                f"looking for the largest tolerance, {self.letter}", min(len(self.points), self.cells), self.cells
            )
            most = np.inf if self.limit is None else self.limit * (1.0 + DEFAULT.cut)
            for question in self.asked_at(tau):
                solution = solve(question, effort="quick")
                point = _Point(tau, solution.usable and solution.amount <= most, solution)
                known = self.points.setdefault(tau, point)
                if not point.good or point.amount > known.amount:
                    self.points[tau] = point
                if not point.good:
                    break
        return self.points[tau]

    @cached_property
    def widest(self) -> Scene:
        """The question at the largest tolerance: parts that can follow sizes there can follow smaller ones."""
        return self.asked(self.largest, self.made(self.largest)[0])

    @property
    def has_most_material(self) -> bool:
        """Whether no size of the box has more material than this corner: what clears here clears all."""
        return self.problem.goal == "clear" and order(self.widest, self.letter)[0] is Order.FROM_ZERO

    @cached_property
    def touching(self) -> TouchingSizes | None:
        """How the gap at rest depends on sizes up to the largest tolerance; None where no corner asks for that."""
        if self.letter not in CORNERS[:2] or isinstance(self.problem, Assembly):
            return None
        sizes = tuple(self.sizes(self.largest))
        own = (tuple(size for size in sizes if size.body == role) for role in ROLES)
        return _touching(*map(fit_for_sizes, self.problem.at_scales.values(), own), sizes)

    @cached_property
    def every(self) -> Array:
        """Each size at either end, in every combination, (n, k)."""
        return np.array([*product(*map(sorted, map(set, self.shape.tolist())))])

    @cached_property
    def one_by_one(self) -> bool:
        """Whether each corner is looked at by itself: of many, with an assembly or round parts to be solved at each."""
        if self.letter != "corners" or not self.problem.shifts:
            return False
        if any(map(has_round_faces, self.problem.relations.values())):
            return len(self.every) > FEW
        return isinstance(self.problem, Assembly) and len(self.every) > 2**FEW

    @cached_property
    def corners(self) -> Array:
        """Those that are asked at each tolerance, (n, k)."""
        return self.every[: 1 if self.one_by_one else None]

    def sizes(self, tau: float) -> list[Size]:
        """Return the sizes with this tolerance."""
        ends = map(tuple, (tau * self.shape).tolist())
        return [replace(size, tolerance=own) for size, own in zip(self.problem.sizes, ends, strict=True)]

    def made(self, tau: float) -> list[Any]:
        """Return what is made at a tolerance, at one corner or at all: deviations of sizes, or the corner's name."""
        if self.letter == "corners":
            return [dict(zip(self.names, made, strict=True)) for made in (tau * self.corners).tolist()]
        if not self.names or isinstance(self.problem, Assembly):
            return [self.letter]
        sizes, (one, two) = self.sizes(tau), self.problem.at_scales.values()
        return [made_at(one, two, sizes, self.letter, self.touching and replace(self.touching, sizes=tuple(sizes)))]

    @cached_property
    def crossing(self) -> tuple[float, ...]:
        """The tolerances between which the parts at rest come to touch, from apart to overlapping or back, if any."""
        known = self.touching
        if known is None:
            return ()
        slack, ends = 2.0 * self.problem.contact_slack, (self.smallest, self.largest)

        def above(tau: float) -> float:
            return float(known.gap([*self.made(tau)[0].values()])) - self.problem.clearance

        sign = 1.0 if above(ends[0]) > 0.0 else -1.0
        if not (sign * above(ends[0]) > slack and sign * above(ends[1]) < -slack):
            return ()
        close = lambda low, high: high - low <= self.accuracy * high  # noqa: E731
        first, _ = narrowed(lambda tau: sign * above(tau) > slack, *ends, close)
        _, last = narrowed(lambda tau: sign * above(tau) > -slack, *ends, close)
        return first, last

    @property
    def cells(self) -> int:
        """How many cells of equal width are looked at: fewer where parts are made anew, or exact, each time."""
        return CELLS // DEARER if self.is_dear else CELLS

    @cached_property
    def is_dear(self) -> bool:
        """Whether sizes are asked about, for which parts are made anew, or parts that are made exact on round faces."""
        return by_name(self.problem) or any(map(has_round_faces, self.problem.relations.values()))

    def is_narrow(self, good: float, bad: float) -> bool:
        """Tell whether a bracket is as narrow as asked; or as what counts as touching."""
        return bad - good <= self.accuracy * bad or (
            bool(self.crossing) and self.crossing[0] <= good and bad <= self.crossing[1]
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Of the sizes, or of an assembly's parts; none where the scales of both bodies are asked about."""
        if by_name(self.problem):
            return tuple(size.name for size in self.problem.sizes)
        return tuple(self.problem.parts) if isinstance(self.problem, Assembly) else ()

    def measured(self, tau: float, digits: int = 6) -> str:
        """Return a tolerance in words."""
        return _measured(tau, not self.names or self.letter in OF_SCALES, self.problem.unit, digits)

    @property
    def smallest(self) -> float:
        """The tolerance from which on the judge can tell."""
        lengths = any(size.is_length for size in self.problem.sizes) and by_name(self.problem)
        return SMALLEST * (self.problem.size if lengths else 1.0)

    def asked(self, tau: float, made: Any) -> Scene:
        """Return a question at a tolerance, of sizes with these tolerances."""
        table = tuple(map(tuple, (tau * self.shape).tolist()))
        if by_name(self.problem):
            return self.problem.changed(sizes=self.sizes(tau), made=made)
        if isinstance(self.problem, Assembly):
            scales = (1.0 + tau * self.shape[:, 0]).tolist()
            return self.problem.changed(scales=dict(zip(self.problem.parts, scales, strict=True)))
        return self.problem.changed(requirement=self.letter, tolerance=table, target=None, goal=self.problem.goal)

    def asked_at(self, tau: float) -> list[Scene]:
        """Return the questions at a tolerance; of sizes of two parts by what is made: none is cut anew."""
        if tau not in self.questions:
            named = by_name(self.problem) and isinstance(self.problem, Problem)
            every = [self.widest.changed(made=made) if named else self.asked(tau, made) for made in self.made(tau)]
            self.questions = {tau: every}
        return self.questions[tau]

    def budget(self) -> Budget:
        """Return the budget; where the time is over, how far all tolerances that were looked at are good."""
        try:
            return self._found()
        except pacing.TimeOverError as late:
            bad = min((tau for tau, point in self.points.items() if not point.good), default=np.inf)
            good = (point for tau, point in self.points.items() if tau < bad and not self.one_by_one)
            low = max(good, key=lambda own: own.tau, default=None)
            high = low and self.points.get(bad)
            why = late.why + (f", and {self.measured(bad)} is bad" if low is None and bad < np.inf else "")
            found = self._result(low, high, Order.ANY, why, self.largest / self.cells)
            return found if high is not None else replace(found, end=End.TIME)

    def _found(self) -> Budget:
        spacing, (lie, why) = 0.0, order(self.widest, self.letter)
        if lie is not Order.ANY:
            low, high = self._nested(lie)
            if low is not None:  # the corner of a box of sizes may be another one there
                lie, why = order(self.asked(low.tau, self.made(low.tau)[0]), self.letter)
        if lie is Order.ANY:
            spacing, first = self.largest / self.cells, self.smallest
            low, high = self._of_every_corner() if self.one_by_one else self._scanned()
            every, begin, finest = (self.measured(tau, 3) for tau in (spacing, first, spacing / 2**SPLITS))
            why += f": sampled every {every} from {begin}, down to {finest} at changes"
            if self.hurried < np.inf:
                why += f", but from {self.measured(self.hurried, 3)} on"
                why += f" not at these: {LOOKS * self.cells} were looked at by then"
            if self.one_by_one and low is not None:
                why += f": below {self.measured(low.tau)} at one corner, there at all {len(self.every)}"
        with suppress(InputError):  # of questions that do not hold of parts as drawn
            if low is None:
                drawn = self.at(0.0)
                low, high = (drawn, high) if drawn.good else (None, drawn)
        if high is not None and high.solution.status is Status.NOT_VERIFIED:  # rounding, it may be: look past that
            past = self.at(min(high.tau + self.smallest, self.largest))
            high = high if past.good else high._replace(solution=past.solution)
        return self._result(low, high, lie, why, spacing)

    def _result(self, low: _Point | None, high: _Point | None, lie: Order, why: str, spacing: float) -> Budget:
        tolerance, above = 0.0 if low is None else low.tau, None if high is None else high.solution
        touching: TouchingSizes | None = vars(self).get("touching")  # where it was asked for in time
        return Budget(
            requirement=self.letter,
            tolerance=tolerance,
            table=frozen(tolerance * self.shape),
            end=End.LARGEST if above is None else End.LIMIT if above.usable else End(barred_text(above)),
            solution=None if low is None else low.solution,
            above=above,
            bracket=(tolerance, self.largest if high is None else high.tau),
            limit=self.limit,
            points=len(self.points),
            proved=lie is not Order.ANY,
            reason=why,
            spacing=spacing,
            sizes=self.names,
            unit=self.problem.unit,
            permanent=touching.permanent_in_words if touching else (),
        )

    def _nested(self, lie: Order) -> tuple[_Point | None, _Point | None]:
        """Return the last good and the first bad tolerance where there is one stretch of good ones at most."""
        first = self.at(0.0 if lie is Order.ALL_OR_NONE else self.smallest)
        if not first.good:
            return None, first
        last = self.at(self.largest)
        return (last, None) if last.good else self._narrowed(first, last)

    def _scanned(self) -> tuple[_Point | None, _Point | None]:
        """Return the last good and the first bad tolerance of all that are looked at, from the smallest."""
        cell, smallest = self.largest / self.cells, self.smallest
        doublings = 2 if self.is_dear else 1  # from one tolerance that is looked at to the next, below the first cell
        halvings = range(int(np.log2(cell / smallest)), 0, -doublings) if cell > smallest else ()
        taus = [*(cell / 2**k for k in halvings), *(cell * np.arange(1, self.cells)).tolist(), self.largest]
        low = self.at(smallest)
        if not low.good:
            return None, low
        for tau in (tau for tau in taus if tau > smallest):
            high = self.at(tau)
            if crossing := self._crossing(low, high, min(cell, tau) / 2**SPLITS):
                return self._narrowed(*crossing)
            low = high
        return low, None

    def _of_every_corner(self) -> tuple[_Point | None, _Point | None]:
        """Return as `_scanned`, of the corner that ends first: each other one is good at the last good tolerance, too.

        In any order: one that is bad there ends earlier, and of n about log n do. Source: Seidel (1991).
        """
        (low, high), every, good = self._scanned(), cycle(np.random.default_rng(0).permutation(self.every)), 0
        while low is not None and good < len(self.every):
            other = replace(self, points={tau: own for tau, own in self.points.items() if not own.good}, questions={})
            other.corners = next(every)[None]
            point = other.at(low.tau)
            if point.good:
                low, good = max(low, point, key=lambda own: own.amount), good + 1
            else:
                vars(self).update(vars(other))
                (low, high), good = self._scanned(), 1
        return low, high

    def _crossing(self, low: _Point, high: _Point, finest: float) -> tuple[_Point, _Point] | None:
        """Return a good tolerance and a bad one with one crossing between them, the first; None where all are good."""
        if high.tau - low.tau <= finest or self._is_calm(low, high):
            return None if high.good else (low, high)
        if high.good and len(self.points) >= LOOKS * self.cells:
            self.hurried = min(self.hurried, low.tau)
            return None
        predicted = (tau for tau in self.crossing if low.tau < tau < high.tau)
        middle = self.at(next(predicted, (low.tau + high.tau) / 2))
        if not middle.good:
            return self._crossing(low, middle, finest)
        if low.leads_straight(middle, high, self.limit):  # of two motions as small, now one is found, now the other
            return None
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
        """Return a bracket of the asked width, about where amounts of both ends cross the limit, else by halving."""
        off = np.inf
        for _ in range(SECANTS):
            rise = high.amount - low.amount
            if self.limit is None or not rise > 0.0 or self.is_narrow(low.tau, high.tau):
                break
            guess = low.tau + (self.limit - low.amount) / rise * (high.tau - low.tau)
            for side in (-0.25, 0.25):
                tau = guess * (1.0 + side * self.accuracy)
                if low.tau < tau < high.tau:
                    point = self.at(tau)
                    low, high = (point, high) if point.good else (low, point)
            before, off = off, min(abs(own.amount - self.limit) for own in (low, high))
            if not off <= 0.5 * before:
                break
        good, bad = narrowed(self._may_be_good, low.tau, high.tau, self.is_narrow)
        if self.at(bad).good:  # widths that lack no more than parts may overlap
            good, bad = narrowed(lambda tau: self.at(tau).good, bad, high.tau, self.is_narrow)
        return self.at(good), self.at(bad)

    def _may_be_good(self, tau: float) -> bool:
        """Tell whether a tolerance is good: parts that do not go together need no search for a shift."""
        asked = tau not in self.points and self.problem.shifts
        if asked and any(map(too_wide, (each for asked in self.asked_at(tau) for each in asked.relations.values()))):
            return False
        return self.at(tau).good
