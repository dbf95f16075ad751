"""Along a ray of motions: how far the tracked features stay the real contact, and what ends that on both sides."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self, overload

import numpy as np

from fcdm_opt.along.conditions import Ray
from fcdm_opt.along.followed import KINDS, NO_CONTACT, Followed, followed, followed_joints
from fcdm_opt.along.march import March
from fcdm_opt.along.true_overlaps import true_overlaps
from fcdm_opt.curve.contact import touching_features
from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve, relative_pose
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError, expected, known_arguments, placed
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.facet_errors import is_plane_there, known_to, round_surfaces
from fcdm_opt.geometry.units import number_text
from fcdm_opt.lazy_import import NotebookRepr, imported
from fcdm_opt.model.true_faces import Exchange
from fcdm_opt.motion.motions import Motion
from fcdm_opt.plain import Plain
from fcdm_opt.problem.active_parts import with_parts_met_along
from fcdm_opt.problem.arguments import LARGEST, by_parameter
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

FAR = 1e6  # sizes of the scene that a mere translation is followed
EVENT_OFFSET = 1e-7  # of the natural step: how far beyond an event the contact is looked at
WINDOW, ABOUT = 30.0, 1e-4  # of the tracked pair's change there, and of the pair: what of the curve is looked at
LOCAL = ("border", "neighbour", "overlap", "parallel edges")  # events at a tracked pair that there is


@dataclass(frozen=True, eq=False)
class Event(Plain):
    """What ends a coherent range on one side."""

    x: float  # where, in multiples of the direction; infinite for "unbounded"
    kind: str  # a key of `KINDS`
    what: str = ""  # in words: which vertex or edge is reached, or which part pair
    # whether the condition only touches zero there: beyond, the features may be the contact again
    grazing: bool = False
    error: float = 0.0  # how far x may be off: rounding where features cross, more where they graze
    # the tracked features that are not the contact beyond; all of them where the tracked pair itself is lost
    features: tuple[Feature, ...] = ()
    merged: tuple[Feature, ...] = ()  # what touches just there
    successors: tuple[Feature, ...] = ()  # what the contact is just beyond, where that is not a tracked feature


class Ends:
    """Base of what lasts along motions x * direction, from `low` to `high`."""

    first: Event
    last: Event

    @property
    def low(self) -> float:
        """Lower end, at most 0."""
        return self.first.x

    @property
    def high(self) -> float:
        """Upper end, at least 0."""
        return self.last.x

    @property
    def events(self) -> tuple[Event, Event]:
        """The events at low and high."""
        return self.first, self.last

    def __repr__(self) -> str:
        """Return where it ends and what ends it there, on one line."""
        low, high = (f"{number_text(event.x)} ({event.what})" for event in self.events)
        return f"{type(self).__name__}({low} to {high})"


@dataclass(frozen=True, eq=False, repr=False)
class CoherentRange(Ends, Plain, NotebookRepr):
    """Interval low <= x <= high of motions q = x * direction over which the tracked features stay the real contact.

    At a switching point its two features are tracked; inside a segment its one, at the point of its line nearest to
    the nominal pair. Of contacts that are restored together all are, at the scale pair that they have in common: where
    two lines meet, or the point of the one line that all share nearest to the nominal pair. Along a ray on which they
    have none the range is 0 both ways.

    Attributes
    ----------
    problem : Problem
        About the parts that are followed.
    direction : (k,) array
    features : tuple of Feature
    first, last : Event
        The events at low and high.
    proved : bool
        Whether every step was covered by bounds, which it is unless something touches zero where the march starts, or
        true faces are looked at place by place.
    known_to : tuple of str
        Where round faces are followed as facets: how far gaps of the true parts may be off those, as drawn.
    """

    plain_names: ClassVar[tuple[str, ...]] = ("direction", "features", "low", "high", "events", "proved", "known_to")
    plain_kinds: ClassVar[Mapping[str, Any]] = {"direction": Mapping[str, float]}

    problem: Problem
    direction: Array
    features: tuple[Feature, ...]
    first: Event
    last: Event
    proved: bool
    known_to: tuple[str, ...] = ()
    _followed: tuple[Followed, ...] = field(repr=False, default=())

    def __str__(self) -> str:
        """Return in words what lasts from where to where, and what ends it on both sides."""
        return "\n- ".join(imported("show.verdict:range_texts")(self))

    def transform(self, x: float) -> Array:
        """Return the 4x4 transform of body 1 at x."""
        problem = self.problem
        return problem.motion.transform(x * self.direction, problem.movable.seed, problem.static.seed)

    def curve(self, x: float) -> DecisionCurve:
        """Return the decision curve of the moved bodies, in the problem's box."""
        return decision_curve(*self.problem.active, box=self.problem.box, transform=self.transform(x))

    def rho(self, x: float) -> Array:
        """Return the tracked scale pair at x, (2,), for x within the range."""
        return self._march.rho(x)

    @property
    def natural_step(self) -> float:
        """The x that turns or moves body 1 by about the size of the bodies."""
        return self._march.unit

    @cached_property
    def _march(self) -> March:
        return March(self.problem, self._followed, ray_of(self.problem, self.direction), self.problem.nominal_pair)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, without the problem: `from_dict` needs that besides."""
        return {**super().to_dict(), "direction": self.problem.motion.by_name(self.direction)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], problem: Problem | None = None) -> Self:
        """Rebuild from `to_dict` and the problem that it is of; raises `InputError`."""
        asked = with_contact_closed(needed_question(cls, problem))
        known = {"problem": asked, "direction": checked_direction(asked, data.get("direction")), "_followed": ()}
        ends = dict(zip(("first", "last"), data.get("events", ()), strict=False))
        return replace(super().from_dict({**data, **known, **ends}), _followed=followed(asked))


@dataclass(frozen=True, eq=False, repr=False)
class AssemblyRange(Ends, Plain):
    """Interval low <= x <= high of motions x * direction of an assembly's parts over which all of its contacts last.

    Attributes
    ----------
    assembly : Assembly
    direction : dict
        By the names of all motions' parameters, "part.parameter".
    contacts : dict of str to CoherentRange
        Of each contact, "A - B", whose parts move against each other, at sizes at which these two touch; others last.
    apart : tuple of str
        Those of these contacts whose parts do not touch as drawn, so that nothing is followed: see `contact_times`.
    """

    plain_names: ClassVar[tuple[str, ...]] = ("direction", "low", "high", "events", "proved", "contacts", "apart")

    assembly: Assembly
    direction: Mapping[str, float]
    contacts: Mapping[str, CoherentRange]
    apart: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return the same in words for each contact."""
        opened = (f"{name}: {NO_CONTACT}" for name in self.apart)
        return "\n".join([*(f"{name}: {own}" for name, own in self.contacts.items()), *opened])

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], assembly: Assembly | None = None) -> Self:
        """Rebuild from `to_dict` and the assembly that it is of; raises `InputError`."""
        asked = needed_question(cls, assembly)
        questions, known = {str(pair): asked.questions[pair[:2]] for pair in asked.contacts}, data.get("contacts", {})
        each = {name: CoherentRange.from_dict(own, questions.get(name)) for name, own in known.items()}
        return super().from_dict({**data, "assembly": asked, "contacts": each})

    @property
    def first(self) -> Event:  # type: ignore[override]
        """The event at low, which tells of which contact it is."""
        return max((own for own, _ in self._events), key=lambda event: event.x)

    @property
    def last(self) -> Event:  # type: ignore[override]
        """The event at high."""
        return min((own for _, own in self._events), key=lambda event: event.x)

    @property
    def proved(self) -> bool:
        """Whether those of all contacts are."""
        return all(own.proved for own in self.contacts.values())

    @property
    def _events(self) -> list[list[Event]]:
        return [
            [replace(event, what=f"{name}: {event.what}") for event in own.events]
            for name, own in self.contacts.items()
        ]


@overload
def coherent_range(problem: Problem, direction: Any = None, *, limit: float | None = None) -> CoherentRange: ...
@overload
def coherent_range(problem: Assembly, direction: Any = None, *, limit: float | None = None) -> AssemblyRange: ...
@known_arguments
def coherent_range(
    problem: Problem | Assembly, direction: Mapping[str, float] | Any = None, *, limit: float | None = None
) -> CoherentRange | AssemblyRange:
    """Return how far the tracked features stay the real contact along motions q = x * direction, both ways.

    Parameters
    ----------
    problem : Problem or Assembly
        Goal, target and path do not matter: what the nominal pair touches with is followed, of the parts of the sizes
        made. A size that would open it, or let it overlap, is left as drawn: `CoherentRange.problem` has those made.
        Of an assembly each contact is followed, in the parameters of all motions: "part.parameter".
    direction : mapping of parameter name to value, (k,) array or number, optional
        Length units and radians a unit of x; parameters that a mapping leaves out stay. Default for a motion of one
        parameter: 1, so that x is the parameter.
    limit : float, optional
        Largest |x| to look at. The problem's limits of the motion hold besides. Default: a whole turn, or for a mere
        translation as far as it matters.

    Raises
    ------
    InputError
        For a direction that is none, limits that exclude no motion, and a nominal pair that is not on the curve; of an
        assembly where none of its contacts is.
    """
    expected(problem, (Problem, Assembly), "problem")
    if isinstance(problem, Assembly):
        return _of_assembly(problem, direction, limit)
    along = checked_direction(problem, direction)
    problem = with_contact_closed(problem)
    if (found := _on_true_faces(problem, along, limit)) is not None:
        return found
    return replace(_of_facets(problem, along, limit), known_to=facet_errors_of(problem))


def facet_errors_of(problem: Problem) -> tuple[str, ...]:
    """Return how far gaps of facets may be off those of true faces; nothing where the bodies are exact on these."""
    return tuple(known_to((problem.movable, problem.static), problem.unit))


def _on_true_faces(problem: Problem, along: Array, limit: float | None) -> CoherentRange | None:
    """Return the range of a contact of plane faces at unchanged sizes, where other faces are round; None of others."""
    bodies, features = (problem.movable, problem.static), [own.feature for own in followed(problem)]
    if not all(is_plane_there(*own) for each in features for own in zip(bodies, (each.one, each.two), strict=True)):
        return None
    exact = Exchange.of(of_bodies(problem, problem.nominal_pair))
    if exact is None:
        return None
    found = _of_facets(problem.with_exact_points(exact.points), along, limit)
    (first, end), overlaps = found.events, true_overlaps(exact.problem, along, [(found.low, found.high)])
    for start, stop in overlaps.stretches:
        what = f"true faces of {problem.movable.name} and {problem.static.name} come to overlap"
        if stop <= 0.0:
            first = Event(stop, "overlap", what, features=found.features)
        elif start >= 0.0 and start < end.x:
            end = Event(start, "overlap", what, features=found.features)
    found = replace(found, first=first, last=end, proved=found.proved and overlaps.proved)
    found = found if overlaps.complete else replace(found, known_to=facet_errors_of(problem))
    sizes = [found.rho(x) for x in (found.low, found.high) if math.isfinite(x)]
    return found if np.abs(np.array(sizes) - found.rho(0.0)).max(initial=0.0) <= DEFAULT.nominal else None


def of_bodies(problem: Problem, pair: Array) -> Problem:
    """Return the question whether two bodies with round faces are clear of each other; of others the same."""
    if not (round_surfaces(problem.movable) or round_surfaces(problem.static)):
        return problem
    plain = dict.fromkeys(("path", "features", "requirement", "tolerance", "contacts"))
    asked = {"goal": "clear", "pair": "any", "clearance": 0.0, "keep_out": (), "target": pair.tolist()}
    return problem.changed(**asked, **plain)


def _of_facets(problem: Problem, along: Array, limit: float | None) -> CoherentRange:
    """Return the range of the bodies as they are."""
    ends = {side: range_end(problem, side * along, limit) for side in (-1.0, 1.0)}
    nearest, clear = min(end.x for end in ends.values()), dict.fromkeys(ends, 0.0)
    while True:
        tracked, asked = followed(problem), problem
        march = March(problem, tracked, ray_of(problem, along), problem.nominal_pair, nearest)
        found = []
        for side, end in ends.items():
            found.append(_ended(asked, march, tracked, along, side, end))
            until = min(abs(found[-1][0].x), end.x)
            problem, clear[side] = with_parts_met_along(problem, side * along, march.near, clear[side], until)
        if problem is asked:
            break
    (first, before), (last, after) = found
    return CoherentRange(
        problem, along, tuple(own.feature for own in tracked), first, last, before and after, _followed=tracked
    )


def with_contact_closed(problem: Problem) -> Problem:
    """Return the question about the parts made; where they lose the contact, with the sizes as drawn that open it."""
    if not problem.made or _is_closed(problem):
        return problem
    each = ((name, problem.changed(made={name: x})) for name, x in problem.made.items() if x)
    kept = {name: own.made[name] for name, own in each if _is_closed(own)}
    return problem.changed(made=kept or None)


def _is_closed(problem: Problem) -> bool:
    """Tell whether the contacts that are followed are closed at the nominal pair."""
    pose, rho = relative_pose(*problem.active, np.eye(4)), problem.nominal_pair
    gaps = [joint.gap(*problem.active, pose, rho) for joint in followed_joints(problem)]
    return max(map(abs, gaps)) <= problem.contact_slack if gaps else problem.nominal_contact is not None


def _of_assembly(assembly: Assembly, direction: Any, limit: float | None) -> AssemblyRange:
    """Return how far each contact lasts whose parts move against each other, and which of these do not touch."""
    asked = moved_contacts(assembly, direction)
    along = checked_direction(next(iter(assembly.questions.values())), direction)
    apart = tuple(name for name, problem in asked.items() if not has_contact(problem))
    if apart and len(apart) == len(asked):
        with placed(key=f"contacts '{apart[0]}'"):
            followed(with_contact_closed(asked[apart[0]]))
    each = {name: coherent_range(own, along, limit=limit) for name, own in asked.items() if name not in apart}
    return AssemblyRange(assembly, motion_of(assembly).by_name(along), each, apart)


def moved_contacts(assembly: Assembly, direction: Any) -> dict[str, Problem]:
    """Return the questions of the contacts whose parts move against each other along a direction, by their names."""
    along = checked_direction(next(iter(assembly.questions.values())), direction)
    moving = {part for (part, _), x in zip(assembly.parameters, along.tolist(), strict=True) if x}
    moved = [pair for pair in assembly.contacts if moving & {*assembly.involved(*pair[:2])}]
    return {str(pair): assembly.questions[pair[:2]] for pair in moved}


def has_contact(problem: Problem) -> bool:
    """Tell whether parts touch so that a range can follow what touches, with sizes as drawn that would open it."""
    closed = with_contact_closed(problem)
    return bool(followed_joints(closed)) or closed.nominal_contact is not None


def _ended(
    problem: Problem, march: March, followed: tuple[Followed, ...], along: Array, side: float, end: RangeEnd
) -> tuple[Event, bool]:
    """Return what ends the range on one side, and whether all of the way there is proved."""
    stop = march.stop(side, end.x)
    if stop is None:
        x = math.inf if end.kind == "unbounded" else end.x
        return Event(side * x, end.kind, end.what or KINDS[end.kind]), march.proved
    x, error, grazing = march.settled(stop)
    lost = {cause.feature for cause in stop.causes}
    tracked = tuple(own.feature for own in followed)
    features = tracked if -1 in lost else tuple(feature for k, feature in enumerate(tracked) if k in lost)
    kind, what = stop.causes[0].kind, "; ".join(dict.fromkeys(cause.what for cause in stop.causes))
    merged, beyond = _around(problem, march, side * along, x) if kind in LOCAL else ((), ())
    successors = tuple(feature for feature in beyond if feature not in tracked)
    return Event(side * x + 0.0, kind, what, grazing, error, features, merged, successors), march.proved


def _around(problem: Problem, march: March, along: Array, x: float) -> tuple[tuple[Feature, ...], tuple[Feature, ...]]:
    """Return the features that touch at x, and those of the curve about the tracked pair just beyond."""
    before, after = x - EVENT_OFFSET * march.unit, x + EVENT_OFFSET * march.unit
    was, moved = march.rho(before), march.rho(after)
    rho = (was + moved) / 2.0  # also where edges are parallel just at x
    if not (np.isfinite(rho).all() and rho.min() > 0):
        return (), ()
    movable, static = problem.active
    here, beyond = (problem.motion.transform(at * along, movable.seed, static.seed) for at in (x, after))
    pose = relative_pose(movable, static, here)
    merged = touching_features(movable, static, pose, rho, DEFAULT.nominal * problem.size)
    wide = max(WINDOW * float(np.abs(moved - rho).max()), ABOUT * float(rho.max()))
    (a, b), (c, d) = np.column_stack([np.maximum(moved - wide, 0.0), moved + wide]).tolist()
    curve = decision_curve(movable, static, box=((a, b), (c, d)), transform=beyond)
    return merged, tuple(dict.fromkeys(segment.feature for segment in curve.segments))


def needed_question(kind: type, asked: Any) -> Any:
    """Return the question that plain data without one are of; raises `InputError` where it is not given."""
    if not isinstance(asked, Problem | Assembly):
        what = f"the plain data of a {kind.__name__} are without what was asked: give that too"
        found = "nothing" if asked is None else type(asked).__name__
        raise InputError(what, key="problem", found=found, allowed=f"{kind.__name__}.from_dict(data, problem)")
    return asked


def motion_of(asked: Problem | Assembly) -> Motion:
    """Return the motion with all parameters of a question."""
    return asked.motion if isinstance(asked, Problem) else next(iter(asked.questions.values())).motion


def checked_direction(problem: Problem, direction: Any) -> Array:
    """Return a direction in the parameters, (k,); raises `InputError` where it is none."""
    names = problem.motion.names
    allowed = f"values for {', '.join(names)}, not all zero"
    if direction is None and len(names) == 1:
        return frozen([1.0])
    if direction is None:
        raise InputError("missing: which way, of several parameters", key="direction", allowed=allowed)
    if isinstance(direction, Mapping):
        given = by_parameter(direction, "direction", names)
        direction = [given.get(name, 0.0) for name in names]
    try:
        values = np.atleast_1d(np.asarray(direction, dtype=np.float64))
    except (TypeError, ValueError) as reason:
        raise InputError("not a direction", key="direction", found=direction, allowed=allowed) from reason
    largest = float(np.abs(values).max(initial=0.0))
    if values.shape != (len(names),) or not 1.0 / LARGEST <= largest <= LARGEST:
        raise InputError("not a direction", key="direction", found=direction, allowed=allowed)
    return frozen(values)


def ray_of(problem: Problem, direction: Array) -> Ray:
    """Return the ray of a problem's motion along a direction."""
    return Ray.of(problem.motion, direction, problem.movable.seed, problem.static.seed)


class RangeEnd(NamedTuple):
    """How far to look along a ray, and what ends it there."""

    x: float
    kind: str
    what: str


def range_end(problem: Problem, direction: Array, limit: float | None) -> RangeEnd:
    """Return how far to look along a ray from no motion."""
    if limit is not None and not (isinstance(limit, int | float) and limit > 0):
        raise InputError("not a limit", key="limit", found=limit, allowed="a number > 0")
    ends = [RangeEnd(float(limit), "limit", "as far as asked")] if limit is not None else []
    for name, slope, (low, high) in zip(problem.motion.names, direction, problem.limits, strict=True):
        if not low <= 0 <= high:
            what = "ranges are about no motion, which the limits exclude"
            allowed = "limits that 0 lies within"
            raise InputError(what, key=f"limits.{name}", found=(float(low), float(high)), allowed=allowed)
        if slope != 0:
            ends.append(RangeEnd(float((high if slope > 0 else low) / slope), "limit", f"the limit of {name}"))
    turns = np.abs(direction[problem.motion.turning])
    if turns.any():
        moving = [step for step, x in zip(problem.motion.owners, direction, strict=True) if x != 0]
        closed = len(moving) == 1 and moving[0].closed
        kind = "whole turn" if closed else "search"
        ends.append(RangeEnd(2.0 * math.pi / float(turns.max()), kind, "after a whole turn"))
    elif limit is None:
        extent = problem.size + float(np.linalg.norm(problem.static.seed - problem.movable.seed))
        ends.append(RangeEnd(FAR * extent / float(np.abs(direction).max()), "unbounded", ""))
    return min(ends, key=lambda end: end.x)
