"""When two scaled bodies touch along a ray of motions: the range of motion without collision, for any motion.

Where they are apart, the march of `march` finds the first contact. Where they overlap, no vertex moves faster than a
rate, so from a depth g they cannot part within g / rate: steps of that size, down to a floor, then a bracketed root.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, ClassVar, Literal, Self, cast

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.along import conditions as forms
from fcdm_opt.along.coherent_range import (
    checked_direction,
    facet_errors_of,
    motion_of,
    needed_question,
    of_bodies,
    range_end,
    ray_of,
)
from fcdm_opt.along.conditions import Conditions, RayStretch, TrackedPair
from fcdm_opt.along.expansions import ROUNDING, safe_steps
from fcdm_opt.along.march import March
from fcdm_opt.along.true_overlaps import STEPS, apart_beyond, nearer_than, true_overlaps
from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import touching_features
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError, known_arguments
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.solids import PlacedSolids, kept_as_surface
from fcdm_opt.geometry.units import number_text
from fcdm_opt.model.true_faces import exact_where
from fcdm_opt.plain import Plain, ShortRepr
from fcdm_opt.problem import arguments
from fcdm_opt.problem.active_parts import moving_at_most, with_parts_met_along
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

State = Literal["apart", "overlapping"]
FIRST = 1.0 / 64  # of the size: how far first contacts of large bodies are looked for at first
SLIDING = 1e-4  # of a step: parts that touch for so long lie on each other
WIDEN = 4.0  # of the stretch beyond a touch, until the gap there tells
LOOKED_AT = 1e-3, 0.25, 0.5, 0.75, 1.0 - 1e-3  # of a span, whether parts slide on each other there
TOUCHES = 1_000  # instants of touching on one side, at most


@dataclass(frozen=True)
class Touch(Plain):
    """An instant at which the pair touches."""

    plain_names: ClassVar[tuple[str, ...]] = ("x", "features", "grazing")

    x: float
    features: tuple[Feature, ...]  # what touches
    grazing: bool  # whether the state is the same on both sides
    problem: Problem | None = field(default=None, repr=False)  # whose elements these are, if not that of the times


@dataclass(frozen=True)
class StateSpan(Plain):
    """A stretch low <= x <= high over which the pair is "apart" or "overlapping"."""

    state: State
    low: float
    high: float


@dataclass(frozen=True, eq=False, repr=False)
class ContactTimes(ShortRepr, Plain):
    """States of a scale pair along motions q = x * direction, from low to high.

    Attributes
    ----------
    problem : Problem or Assembly
    direction : (k,) array
    pair : (2,) array
        nan of an assembly.
    spans : tuple of StateSpan
        Increasing in x, without gaps; a stretch of x on which the pair keeps touching counts as apart.
    touches : tuple of Touch
        Between spans, and where a span is only grazed.
        Of an assembly those of all two parts together: overlapping where any do.
    keep_outs : dict of str to tuple of StateSpan
        The same for each keep-out, by its name, "overlapping" where it is nearer than its clearance (of facets, where
        faces are round); of an assembly for every two parts, not both fixed, and for each part
        and keep-out, "PART - NAME".
    proved : bool
        Whether no touch can have been missed but grazes from within an overlap that are shallower than
        `Tolerances.march` times what moves. Not so where true faces, not facets, are looked at, place by place, but for
        convex bodies that shift.
    known_to : tuple of str
        Where round faces are looked at by their facets: how far gaps of the true parts may be off those, as drawn.
    """

    plain_names: ClassVar[tuple[str, ...]] = (
        "direction", "pair", "free", "spans", "touches", "keep_outs", "proved", "known_to"
    )  # fmt: skip

    problem: Problem | Assembly
    direction: Array
    pair: Array
    spans: tuple[StateSpan, ...]
    touches: tuple[Touch, ...]
    keep_outs: Mapping[str, tuple[StateSpan, ...]]
    proved: bool
    known_to: tuple[str, ...] = ()

    @property
    def free(self) -> tuple[float, float] | None:
        """The range about x = 0 of motion without collision, keep-outs included; None where bodies overlap there."""
        each = [
            next(((own.low, own.high) for own in spans if own.state == "apart" and own.low <= 0 <= own.high), None)
            for spans in (self.spans, *self.keep_outs.values())
        ]
        known = [own for own in each if own is not None]
        return (max(low for low, _ in known), min(high for _, high in known)) if len(known) == len(each) else None

    def __str__(self) -> str:
        """Return the states in words, a line for the parts and for each keep-out, and how far was looked."""
        along = ", ".join(f"{name} {x:.6g}" for name, x in self.to_dict()["direction"].items())
        lines = list[str]()
        for name, own in {f"x times {along}": self.spans, **self.keep_outs}.items():
            first, *states = (self.state_text(name, span) for span in own)
            later = (f"from x = {number_text(x.low)} {state}" for x, state in zip(own[1:], states, strict=True))
            lines.append(", ".join([f"{name}: {first}", *later]))
        low, high = map(number_text, self.searched)
        lines += [f"of facets: {line}" for line in self.known_to]
        if not (self.proved or self.known_to):
            lines.append("not proved: looked at place by place, between which a short overlap may be missed")
        return "\n".join([*lines, f"looked at from x = {low} to x = {high}, no further"])

    def state_text(self, name: str, span: StateSpan) -> str:
        """Return the state of a span in words, of the parts themselves with whether they slide on each other."""
        asked = None if isinstance(self.problem, Assembly) or name in self.keep_outs else self.problem
        if isinstance(self.problem, Assembly):
            asked = {" - ".join(pair): own for pair, own in self.problem.questions.items()}.get(name)
        if asked is None or span.state != "apart" or not math.isfinite(span.high - span.low):
            return span.state
        pair, bodies = asked.target if np.isnan(self.pair).any() else self.pair, (asked.movable, asked.static)
        places = (span.low + share * (span.high - span.low) for share in LOOKED_AT)
        poses = [asked.motion.transform(x * self.direction, *(own.seed for own in bodies)) for x in places]
        slides = [PlacedSolids(*bodies, pair, pose).distance <= asked.contact_slack for pose in poses]
        return "in contact" if all(slides) else "apart or in contact" if any(slides) else span.state

    @property
    def searched(self) -> tuple[float, float]:
        """From where to where: to limits of the parameters, to `limit`, or as far as anything can meet."""
        return self.spans[0].low, self.spans[-1].high

    def state(self, x: float) -> State | Literal["unknown"]:
        """Return "apart" or "overlapping" at x, "unknown" beyond what was looked at."""
        return next((span.state for span in self.spans if span.low <= x <= span.high), "unknown")

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, without the problem: `from_dict` needs that besides."""
        return {**super().to_dict(), "direction": motion_of(self.problem).by_name(self.direction)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], problem: Problem | Assembly | None = None) -> Self:
        """Rebuild from `to_dict` and the problem that it is of; raises `InputError`."""
        asked = needed_question(cls, problem)
        own = asked if isinstance(asked, Problem) else next(iter(asked.questions.values()))
        return super().from_dict({**data, "problem": asked, "direction": checked_direction(own, data.get("direction"))})


@known_arguments
def contact_times(
    problem: Problem | Assembly,
    direction: Mapping[str, float] | Any = None,
    *,
    scale_pair: Any = None,
    limit: float | None = None,
) -> ContactTimes:
    """Return over which motions q = x * direction a scale pair is apart or overlaps, and when it touches.

    Parameters
    ----------
    problem : Problem or Assembly
        Bodies, motion, limits and keep-outs; goal and path do not matter. Of an assembly the parts made, and the
        parameters of all motions: "part.parameter".
    direction : mapping of parameter name to value, (k,) array or number, optional
        As for `coherent_range`.
    scale_pair : (rho_1, rho_2), optional
        Default: the target pair, the parts made.
    limit : float, optional
        Largest |x| to look at. Default: half a turn both ways where the motion repeats itself after one, a whole turn
        where it turns otherwise, and for a mere translation until the bodies are out of each other's way.

    Raises
    ------
    InputError
        For a direction, a pair or a limit that is none, and for keep-outs kept as a surface and with a range of scales,
        or with a clearance where it is not known how fast the motion moves corners.

    Notes
    -----
    Of large meshes no more is looked at than to the first contact both ways.
    """
    if isinstance(problem, Assembly):
        if scale_pair is not None:
            what, allowed = "an assembly has a scale for each part", "none: Assembly.scales"
            raise InputError(what, key="scale_pair", found=scale_pair, allowed=allowed)
        parts, pair = [" - ".join(own) for own in problem.questions], np.full(2, np.nan)
        along, each = _of_assembly(problem, direction, limit)
    else:
        parts, pair, along = [""], problem.target, checked_direction(problem, direction)
        if scale_pair is not None:
            pair = frozen(arguments.pair(scale_pair, "scale_pair", "two scales > 0", positive=True))
        each = _of_each(problem, along, pair, limit)
    low, high = _ends_of([*each.values()], limit)
    spans = {name: _between(own.spans, low, high) for name, own in each.items()}
    found = [each[name] for name in parts]
    touches = sorted((t for own in found for t in own.touches if low <= t.x <= high), key=lambda t: t.x)
    keep_outs = {name: spans[name] for name in dict.fromkeys([*parts, *spans]) if name}
    lines = tuple(dict.fromkeys(line for own in each.values() for line in own.known_to))
    asked = problem if isinstance(problem, Assembly) else found[0].problem
    joined = _overlapping_any(spans[name] for name in parts)
    return ContactTimes(asked, along, pair, joined, tuple(touches), keep_outs, all(own.proved for own in found), lines)


def _of_each(
    problem: Problem, along: Array, pair: Array, limit: float | None, least: float = 0.0
) -> dict[str, ContactTimes]:
    """Return the times of two bodies, by "", and of the movable one and each keep-out, by its name.

    Of large bodies as far as to |x| = `least`, and to the first contacts; of large keep-outs as far as the two meet.
    """
    within = exact_where(of_bodies(problem, pair), 0.0 * along, apart=0.0)
    exact = within.exact_at is not None
    found = _times(within if exact else problem, along, pair, limit, least)
    each = {"": _of_true_faces(found, within) if exact else found}
    least = max((abs(own.low) for own in found.spans[1:]), default=0.0)
    for own in problem.keep_out:
        asked = _with_keep_out(problem, own, pair)
        near = _times_clear(asked, along, own.clearance, limit) if own.clearance else None
        each[own.name] = near or _of_each(asked, along, asked.target, limit, least)[""]
    return each


def _ends_of(each: Sequence[ContactTimes], limit: float | None) -> tuple[float, float]:
    """Return from where to where several times tell of: as far as all, but for bodies that a shift leaves apart."""
    ends = [0.0, 0.0]
    for k, side in enumerate((-1.0, 1.0)):
        looked, known = [abs(own.searched[k]) for own in each], list[float]()
        for x, own in zip(looked, each, strict=True):
            asked, along = cast("Problem", own.problem), side * own.direction
            if range_end(asked, along, limit).kind != "unbounded" or x < apart_beyond(asked, along, own.pair):
                known.append(x)
        ends[k] = side * min(known or [max(filter(math.isfinite, looked), default=0.0)])
    return ends[0], ends[1]


def _between(spans: Sequence[StateSpan], low: float, high: float) -> tuple[StateSpan, ...]:
    """Return spans from one x to another, the first and the last stretched to these."""
    ends = pairwise([-math.inf, *(own.low for own in spans[1:]), math.inf])
    known = ((own.state, max(start, low), min(end, high)) for own, (start, end) in zip(spans, ends, strict=True))
    return tuple(StateSpan(*own) for own in known if own[1] < own[2])


def _of_true_faces(times: ContactTimes, within: Problem) -> ContactTimes:
    """Return the times of true faces from those of parts within them, which are overlapping for less long."""
    apart = [(own.low, own.high) for own in times.spans if own.state == "apart"]
    found = true_overlaps(within, times.direction, apart)
    joined = _overlapping_any([times.spans, [StateSpan("overlapping", *own) for own in found.stretches]])
    ends = {x for own in joined for x in (own.low, own.high)} - {*times.searched}
    inside = [(own.low, own.high) for own in joined if own.state == "overlapping"]
    touches = {own.x: own for own in times.touches if not any(low < own.x < high for low, high in inside)}
    for x in ends - touches.keys():  # between facets: of parts that are exact there
        q = x * times.direction
        exact = exact_where(within, q, apart=0.0)
        touches[x] = Touch(x, _features(exact, q, times.pair), grazing=False, problem=exact)
    known, proved = () if found.complete else facet_errors_of(within.of_facets), times.proved and found.proved
    ordered = tuple(touches[x] for x in sorted(touches))
    return replace(times, spans=joined, touches=ordered, proved=proved, known_to=known)


def _overlapping_any(each: Iterable[Sequence[StateSpan]]) -> tuple[StateSpan, ...]:
    """Return spans that are overlapping where any of several is, those of one state joined."""
    every, joined = [*each], list[StateSpan]()
    for start, end in pairwise(sorted({x for own in every for span in own for x in (span.low, span.high)})):
        over = any(s.state == "overlapping" and s.low < end and s.high > start for own in every for s in own)
        state: State = "overlapping" if over else "apart"
        if joined and joined[-1].state == state:
            start = joined.pop().low
        joined.append(StateSpan(state, start, end))
    return tuple(joined)


def _features(problem: Problem, q: Array, pair: Array) -> tuple[Feature, ...]:
    """Return what touches after a motion."""
    one, two = problem.active
    pose = relative_pose(one, two, problem.motion.transform(q, problem.movable.seed, problem.static.seed))
    return touching_features(one, two, pose, pair, DEFAULT.nominal * problem.size)


def _times(problem: Problem, along: Array, pair: Array, limit: float | None, least: float) -> ContactTimes:
    """Return when two bodies touch, without keep-outs."""
    problem, (back, ahead) = _to_first_contacts(problem, along, pair, limit, least)
    spans = [StateSpan(state, -high, -low) for state, low, high in reversed(back.spans)]
    spans += [StateSpan(*own) for own in ahead.spans]
    touches = [Touch(0.0 - t.x, t.features, t.grazing) for t in reversed(back.touches)]
    if touches and ahead.touches and touches[-1].x == ahead.touches[0].x == 0.0:
        touches.pop()
    spans, touches = _of_solids(problem, along, pair, spans, [*touches, *ahead.touches])
    proved = back.proved and ahead.proved
    return ContactTimes(problem, along, pair, tuple(spans), tuple(touches), {}, proved, facet_errors_of(problem))


def _times_clear(problem: Problem, along: Array, clearance: float, limit: float | None) -> ContactTimes:
    """Return when two bodies are nearer than a clearance: no sooner than corners move by what lacks or is left of it.

    Nearer by less than `Tolerances.march` times the size is not looked for where that lasts as short.
    """
    pair = problem.target
    back, ahead = (sign * _span_of(problem, sign * along, pair, limit, clearance) for sign in (-1.0, 1.0))
    found = nearer_than(problem, along, pair, clearance, (back, ahead), DEFAULT.march * problem.size)
    if found is None:
        what = "how fast this motion moves corners is not known, and this keep-out is to be kept clear of"
        raise InputError(what, key="keep_out", found=problem.static.name, allowed="a keep-out without clearance")
    spans = _of_solids(problem, along, pair, [StateSpan(*own) for own in found], [])[0]
    return ContactTimes(problem, along, pair, tuple(spans), (), {}, False, facet_errors_of(problem))


def _of_assembly(assembly: Assembly, direction: Any, limit: float | None) -> tuple[Array, dict[str, ContactTimes]]:
    """Return a direction, and the times of every two parts, not both fixed, and of each part and keep-out."""
    each = dict[str, ContactTimes]()
    along, moved = np.zeros(0), [part for part, _ in assembly.parameters]
    for pair, problem in assembly.questions.items():
        along, involved = checked_direction(problem, direction), assembly.involved(*pair)
        names = {"": " - ".join(pair), **{own.name: f"{pair[0]} - {own.name}" for own in problem.keep_out}}
        if any(x for part, x in zip(moved, along.tolist(), strict=True) if part in involved):
            times = _of_each(problem, along, frozen(problem.target), limit)
        else:
            kept = {own.name: (_with_keep_out(problem, own, problem.target), own.clearance) for own in problem.keep_out}
            times = {own: _at_rest(*asked, along) for own, asked in {"": (problem, 0.0), **kept}.items()}
        each |= {names[own]: found for own, found in times.items()}
    return along, each


def _at_rest(problem: Problem, clearance: float, along: Array) -> ContactTimes:
    """Return the times of two bodies that a motion does not move against each other."""
    gap = problem.curve.distance(problem.target) if clearance else problem.curve.gap(problem.target)
    state: State = "overlapping" if gap < clearance - problem.contact_slack else "apart"
    return ContactTimes(problem, along, problem.target, (StateSpan(state, -math.inf, math.inf),), (), {}, proved=True)


def _to_first_contacts(
    problem: Problem, along: Array, pair: Array, limit: float | None, least: float
) -> tuple[Problem, list[_OneWay]]:
    """Return what two bodies meet both ways along a ray, of large ones with the parts active that meet first."""
    if not problem.partial:
        return problem, [_OneWay(problem, sign * along, pair, limit) for sign in (-1.0, 1.0)]
    ends = [_span_of(problem, sign * along, pair, limit) for sign in (-1.0, 1.0)]
    moving = moving_at_most(problem, along, pair)
    x, unit = 0.0, FIRST / max(ray_of(problem, along).natural_step[1] / problem.size, 1.0 / max(ends))
    while True:
        before, x = x, min(max(WIDEN * x, unit), max(ends))
        for sign in (-1.0, 1.0):
            clear = before if math.isfinite(moving(0.0, x)[1]) else x
            while clear < x:
                problem, clear = with_parts_met_along(problem, sign * along, moving, clear, x)
        is_last = x >= max(ends)
        both = [_OneWay(problem, sign * along, pair, limit if is_last else x) for sign in (-1.0, 1.0)]
        met = (len(own.spans) > 1 or x >= end for own, end in zip(both, ends, strict=True))
        if is_last or (x >= least and all(met)):
            return problem, both


def _of_solids(
    problem: Problem, along: Array, pair: Array, spans: list[StateSpan], touches: list[Touch]
) -> tuple[list[StateSpan], list[Touch]]:
    """Return spans, those of one state joined, and touches of the solids of which the parts may be the surface alone.

    Where surfaces are apart one solid may be inside the other; nothing touches where parts inside come together.
    """
    found = list[StateSpan]()
    for span in spans:
        state = span.state
        if state == "apart" and kept_as_surface(*problem.active):
            middle = 0.5 * (span.low + span.high)
            pose = problem.motion.transform(middle * along, problem.movable.seed, problem.static.seed)
            if PlacedSolids(problem.movable, problem.static, pair, pose).nested:
                state = "overlapping"
        found.append(replace(span, state=state))
    found = [*_overlapping_any([found])]
    inside = [(span.low, span.high) for span in found if span.state == "overlapping"]
    real = [t for t in touches if t.features or not kept_as_surface(*problem.active)]
    return found, [t for t in real if t.grazing or not any(low < t.x < high for low, high in inside)]


def _with_keep_out(problem: Problem, keep_out: KeepOut, pair: Array) -> Problem:
    """Return the question about the movable body and a keep-out, at all of its scales."""
    low, high = keep_out.ends
    if keep_out.body.is_surface and low < high:
        what = "of this keep-out only the surface is kept, and it has a range of scales"
        raise InputError(what, key="keep_out", found=keep_out.name, allowed="one scale, or a solid cut into parts")
    if low == high:
        body = keep_out.body.scaled(low).with_seed(problem.static.seed)  # the seed is the motion's datum
    else:
        parts = [part.seed + scale * (part.vertices - part.seed) for part, scale in keep_out.obstacles]
        body = Body.from_parts(parts, seed=problem.static.seed, name=keep_out.name)
    limits = dict(zip(problem.motion.names, problem.limits.tolist(), strict=True))
    return Problem(problem.movable, body, motion=problem.motion, limits=limits, goal="clear", target=(pair[0], 1.0))


class _OneWay:
    """One way along a ray, from contact to contact."""

    def __init__(self, problem: Problem, along: Array, pair: Array, limit: float | None) -> None:
        self._problem, self._along, self._pair = problem, along, pair
        self._end: float = _span_of(problem, along, pair, limit)
        self._ray = ray_of(problem, along)
        self._march = March(problem, (), self._ray, pair, self._end)
        self._floor = DEFAULT.march * self._march.unit
        body = problem.movable
        self._local = pair[0] * (np.concatenate([part.vertices for part in body.parts]) - body.seed)
        self._slack = DEFAULT.tie * problem.size
        far = max(float(np.abs(own.vertices).max()) for own in (problem.movable, problem.static))
        self._rounding = ROUNDING * (problem.size + far)  # of what slides along a face
        self.spans: list[tuple[State, float, float]] = []
        self.touches: list[Touch] = []
        self.proved = True
        self._run()

    def _run(self) -> None:
        x = start = 0.0
        state: State = "overlapping" if self._gap(0.0) < -self._slack else "apart"
        if abs(self._gap(0.0)) <= self._slack:
            self._touch(0.0, False)
            state = "apart" if self._gap(min(self._floor, self._end)) >= -self._rounding else "overlapping"
        for _ in range(TOUCHES):
            found = self._parts_at(x) if state == "overlapping" else self._meets_at(x)
            if found is None:
                break
            at, grazing = found
            self._touch(at, grazing)
            if not grazing:
                self.spans.append((state, start, at))
                start, state = at, "apart" if state == "overlapping" else "overlapping"
            x = self._cleared(at) if state == "apart" and not grazing else self._beyond(at)
            if x >= self._end:
                break
        else:
            self.proved = False
        self.spans.append((state, start, self._end))
        self.proved = self.proved and self._march.proved

    def _beyond(self, x: float) -> float:
        """Return a little more than x, where it is clear which way a touch at x went, or the end."""
        # where parts lie on each other besides, and slide, it is clear at once: this contact does not tell
        beyond, most = x + self._floor, min(x + SLIDING * self._march.unit, self._end)
        while beyond < most and abs(self._gap(beyond)) <= self._slack:
            beyond = x + WIDEN * (beyond - x)
        beyond = min(beyond, self._end)
        return beyond if abs(self._gap(beyond)) > self._slack else min(x + self._floor, self._end)

    def _cleared(self, x: float) -> float:
        """Return a little more than x, where the two parts that overlapped until then are clear of each other."""
        places = self._deepest(x - self._floor)[1]
        one, two = (body.subset((k,)) for body, k in zip(self._problem.active, places, strict=True))
        beyond = x + self._floor
        while beyond < self._end:
            pose = self._transform(beyond), one.seed, two.seed
            if kernels.least_gaps(*one.packed, *two.packed, *pose, self._pair[None])[0][0] > self._slack:
                break
            beyond = x + WIDEN * (beyond - x)
        return min(beyond, self._end)

    def _touch(self, x: float, grazing: bool) -> None:
        self.touches.append(Touch(float(x), _features(self._problem, x * self._along, self._pair), grazing))

    def _transform(self, x: float) -> Array:
        problem = self._problem
        return problem.motion.transform(x * self._along, problem.movable.seed, problem.static.seed)

    def _gap(self, x: float) -> float:
        """Return the signed gap of the pair, see `kernels.least_gaps`."""
        return self._deepest(x)[0]

    def _deepest(self, x: float) -> tuple[float, tuple[int, int]]:
        """Return the least gap of a part pair, and which that is."""
        one, two = self._problem.active
        pose = self._transform(x), one.seed, two.seed
        (gap,), ((i, j),) = kernels.least_gaps(*one.packed, *two.packed, *pose, self._pair[None])
        return float(gap), (int(i), int(j))

    def _meets_at(self, x: float) -> tuple[float, bool] | None:
        """Return where a pair that is apart at x first touches, and whether it stays apart."""
        stop = self._march.advanced(x)
        if stop is None or stop.condition is None:
            self._end = self._end if stop is None else stop.x
            return None
        at, _, _ = self._march.settled(stop)
        return at, bool(self._gap(self._beyond(at)) >= -self._rounding)

    def _parts_at(self, x: float) -> tuple[float, bool] | None:
        """Return where a pair that overlaps from x on first touches."""
        from scipy.optimize import brentq

        def clear(at: float) -> float:  # but for the rounding of what slides besides
            return self._gap(at) + self._rounding

        span = self._march.unit
        here, depth = x, -min(self._gap(x), 0.0)
        for _ in range(STEPS):
            pacing.check()
            if here >= self._end:
                return None
            span = min(span, self._end - here)
            step = self._safe(here, span, depth)
            span = 2.0 * span if step >= span else max(4.0 * step, self._floor)
            ahead = min(here + max(step, self._floor), self._end)
            gap = clear(ahead)
            if gap >= 0:
                off = self._gap if self._gap(ahead) >= 0 else clear
                if off(ahead) == 0 or off(here) >= 0:
                    return ahead, False
                at = brentq(off, here, ahead, xtol=DEFAULT.point * ahead, rtol=4 * np.finfo(float).eps)
                return float(at), False
            here, depth = ahead, -gap
        self.proved, self._end = False, here  # what comes after is not known
        return None

    def _safe(self, x: float, span: float, depth: float) -> float:
        """Return a step within which no vertex moves further than a depth, at most the span."""
        here = self._ray.stretch(x, span, TrackedPair.fixed(self._pair))
        rates = np.linalg.norm(self._local @ here.R[1].T - here.d[1], axis=1).max()
        bend = np.linalg.norm(self._local, axis=1).max() * np.linalg.norm(here.R[2]) + np.linalg.norm(here.d[2])
        if not np.isfinite(bend):
            return 0.0
        root = math.sqrt(rates * rates + 2.0 * bend * depth)
        slow = min(2.0 * depth / (rates + root), span) if root > 0 else span
        return max(slow, self._inside(here))

    def _inside(self, here: RayStretch) -> float:
        """Return how far a vertex of either part surely stays inside the other, of the pair that overlaps deepest."""
        # however shallow: bodies that slide along each other stay so
        i, j = self._deepest(here.x)[1]
        (one, two), rho = (body.parts[k] for body, k in zip(self._problem.active, (i, j), strict=True)), self._pair
        X, Y = one.vertices - one.seed, two.vertices - two.seed
        tops = one.bases - one.seed, two.bases - two.seed
        R, d = here.R[0], here.d[0]
        own = (rho[1] * (tops[1] * two.normals).sum(axis=1))[None] - (rho[0] * X @ R.T - d) @ two.normals.T
        other = (rho[0] * (tops[0] * one.normals).sum(axis=1))[None] - (rho[1] * Y + d) @ R @ one.normals.T
        furthest = 0.0
        if own.min(axis=1).max() > 0:
            within = Conditions.of(forms.ALONG, v=X[int(own.min(axis=1).argmax())], w=tops[1], m=two.normals)
            furthest = float(safe_steps(here.expanded(within), here.span).min())
        if other.min(axis=1).max() > 0:
            w = Y[int(other.min(axis=1).argmax())]
            within = Conditions.of(forms.ALONG_TURNED, v=tops[0], w=w, m=one.normals, sign=-1.0)
            furthest = max(furthest, float(safe_steps(here.expanded(within), here.span).min()))
        return furthest


def _span_of(problem: Problem, along: Array, pair: Array, limit: float | None, clearance: float = 0.0) -> float:
    """Return how far to look: half of what repeats itself, no further than bodies can be nearer than a clearance."""
    end = range_end(problem, along, limit)
    if end.kind != "unbounded":
        return end.x / 2.0 if end.kind == "whole turn" else end.x
    return apart_beyond(problem, along, pair, clearance)
