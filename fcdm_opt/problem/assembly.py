"""Several parts, some at rest and each other with a motion of its own, and contacts between any two; plain data.

A part's motion is relative to the part that it follows, and is taken along by it: the pose of a part is the product of
the motions from a fixed part to it. So a contact of a part with the one that it follows depends on that part's
motion alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from fcdm_opt.curve.touching_sizes import check_sizes
from fcdm_opt.curve.true_sizes import ROLES, extremes, made_at
from fcdm_opt.errors import InputError, known_arguments, known_word, name_list, placed
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.matching import matched
from fcdm_opt.geometry.resizing import each_resized, fit_for_sizes
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import UnitOrNone, signed, unit_of
from fcdm_opt.motion.motions import Motion, Parameter
from fcdm_opt.motion.relative import Carrying, Relative
from fcdm_opt.plain import plain
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.amounts import amount as checked_amount
from fcdm_opt.problem.arguments import by_parameter, interval, items, positive, real
from fcdm_opt.problem.entries import plain_body, plain_keep_out
from fcdm_opt.problem.keep_out import KeepOut, keep_outs
from fcdm_opt.problem.keys import Corner, Requirement
from fcdm_opt.problem.problem import FREE, SIGNS, Problem
from fcdm_opt.problem.scene import AnyScene, Coordinate, lengths_of
from fcdm_opt.problem.schema import Entry, Length, checked, declared, known_sizes
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from casadi import SX, Function

    from fcdm_opt.motion.kinematics import Kinematics

NO_PART = "no such part"
UNNAMED = "body"  # a body that was given no name
CLEAR = {"goal": "clear"}  # what is asked of two parts without a contact: that they do not overlap
CORNERS = ("worst", "loosest", "low", "high", "middle")


class JoinedEntry(Entry, title="Contacts of an assembly"):
    """Two parts of an assembly, and what is asked of them."""

    parts: tuple[str, str] = declared(
        ..., "names of two parts: in labels the first is body 1, the second body 2", ["slide", "frame"]
    )
    goal: Literal["at", "seat", "touch", "clear"] | None = declared(
        None,
        '"at" or "seat" (contacts are restored), "touch" (some contact) or "clear" (apart by clearance); without it '
        '"at"',
        "touch",
    )
    contacts: Literal["all"] | list[str] | None = declared(
        None,
        '"all", or labels of contacts as drawn; without it "all", with goal "touch" or "clear" none',
        "all",
        ["V1F2(P1V6; P2V2,V3,V5)"],
    )
    clearance: Length = declared(0.0, 'least gap >= 0, length units, for goal "clear"', 0.1)


class JoinedPair(NamedTuple):
    """Two parts, by name, and what is asked of them, as `Problem` has it."""

    one: str
    two: str
    asked: dict[str, Any]

    def __str__(self) -> str:
        return f"{self.one} - {self.two}"


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Assembly(AnyScene):
    """The question: which motions of several parts, as small as possible together, restore all their contacts.

    Parameters
    ----------
    parts : mapping of name to Body, or sequence of Body
        In one frame, as drawn; a sequence goes by the bodies' names. Fixed ones may overlap each other.
    contacts : sequence of (name, name) or mappings
        Which parts are to meet, each two once. A pair asks for all contacts that they have as drawn; a mapping has
        "parts" and "goal", "contacts" or "clearance" besides, with the meaning that these have for a `Problem` whose
        body 1 is the first part.
    sizes : sequence of Size, optional
        Whose `body` is the name of a part.
    motions : mapping of name to Motion
        Of every part but the fixed ones, of which there is one at least. World frame as drawn; relative to the part
        that it follows.
    follows : mapping of name to name, optional
        Which part takes another one along. By default the next one on the way of contacts to a fixed part; with a fixed
        part's name for all, motions are those in the world.
    scales : mapping of name to number > 0, optional
        Of the parts made, 1 where none is given.
    tolerance : number or mapping of name to number, optional
        Shares >= 0 and below 1 by which parts are off, with `requirement`; 0 for parts that a mapping leaves out.
    requirement : "A", "B", "C" or "D", optional
        Which way they are, in place of `scales`: the first sign of a letter is of all parts that move, the second of
        the fixed ones, "A" (+, +), "B" (+, -), "C" (-, +), "D" (-, -). Two parts that both move are off the same way:
        a letter has no signs for each of them, `scales` have.
    made : mapping of size name to deviation, or "worst", "loosest", "low", "high", "middle", optional
        Of the parts made, 0 where none is given. "worst" and "loosest": each contact's least or largest gap at rest
        within the tolerances; a size of several contacts is as that one says whose gap is the least, or largest.
    weights : mapping of name to number > 0, optional
        Of each part's amount in the total, 1 where none is given: the root of the sum of (weight times amount)^2.
    lengths : mapping of name to number > 0, optional
        Turn a part's radians into lengths, see `Problem`.
    limits : mapping of name to mapping of parameter name to (lower, upper), optional
        Length units or radians.
    keep_out : sequence of KeepOut or Body, optional
        Further bodies at rest that every part with a motion must keep clear of where it ends, see `Problem`.
    resolution : mapping of name to number or mapping of parameter name to number > 0, optional
        Steps of a part's motion, see `Problem`; of parts whose contacts share motions there can be none.
    amount : "weighted", casadi.SX or casadi.Function
        What is made least in place of the total: an expression >= 0 of symbols named like the parameters of all
        motions, "PART.PARAMETER", or a function of their vector. All contacts are then one question.
    name, unit : str
        As of a `Problem`.

    Attributes
    ----------
    parts : dict
        Bodies by name.
    contacts : tuple of JoinedPair
    fixed : tuple of str
        The parts without a motion.
    request : dict
        The arguments as given; `changed` asks with others.

    Raises
    ------
    InputError
        Names the argument, what was found and what is allowed.
    """

    parts: Mapping[str, Body] = field(repr=False)
    contacts: tuple[JoinedPair, ...]
    motions: Mapping[str, Motion]
    follows: Mapping[str, str]
    scales: Mapping[str, float]
    made: Mapping[str, float]
    weights: Mapping[str, float]
    lengths: Mapping[str, float]
    limits: Mapping[str, Mapping[str, tuple[float, float]]]
    resolution: Mapping[str, Any]
    fixed: tuple[str, ...]
    nominal_scales: Mapping[str, float]  # as drawn, by where cases have them, "scales.PART"
    _problems: dict[tuple[Any, ...], Problem]
    _alike: Assembly | None  # of other scales, whose problems are asked again for these

    @known_arguments
    def __init__(
        self,
        parts: Mapping[str, Body] | Sequence[Body],
        contacts: Sequence[Any],
        sizes: Sequence[Size] = (),
        motions: Mapping[str, Motion] | None = None,
        *,
        follows: Mapping[str, str] | None = None,
        scales: Mapping[str, float] | None = None,
        tolerance: float | Mapping[str, float] | None = None,
        requirement: Requirement | None = None,
        made: Mapping[str, float] | Corner | None = None,
        weights: Mapping[str, float] | None = None,
        lengths: Mapping[str, float] | None = None,
        limits: Mapping[str, Mapping[str, Sequence[float]]] | None = None,
        keep_out: Sequence[KeepOut | Body] = (),
        resolution: Mapping[str, float | Mapping[str, float]] | None = None,
        amount: Literal["weighted"] | OwnAmount | SX | Function = "weighted",
        name: str = "",
        unit: UnitOrNone = "",
    ) -> None:
        request = {key: value for key, value in locals().items() if key not in ("self", "__class__")}
        bodies = {
            part: fit_for_sizes(body, tuple(size for size in sizes if size.body == part))
            for part, body in _bodies(parts).items()
        }
        moved = by_parameter(motions, "motions", bodies, NO_PART)
        for part, motion in moved.items():
            if not isinstance(motion, Motion) or not motion.parameters:
                allowed = "a Motion with parameters"
                raise InputError("not a motion", key=f"motions.{part}", found=motion, allowed=allowed)
        directions = [direction for motion in moved.values() for direction in motion.directions]
        others = keep_outs(keep_out)
        both = matched((*bodies.values(), *(other.body for other in others)), directions)
        others = tuple(map(KeepOut.with_body, others, both[len(bodies) :]))
        bodies = dict(zip(bodies, both, strict=False))
        for k, other in enumerate(others, 1):
            if other.name in bodies:
                allowed = "a name that no part has: KeepOut(body, name=...)"
                raise InputError("the name is that of a part", key=f"keep_out[{k}]", found=other.name, allowed=allowed)
        resting = tuple(part for part in bodies if part not in moved)
        if not resting or not moved:
            what = "no part is fixed: each has a motion" if moved else "no part has a motion"
            allowed = "motions of at least one part, and not of all: parts without one are fixed"
            raise InputError(what, key="motions", found=name_list(moved) or "none", allowed=allowed)
        joined = _joined(contacts, bodies)
        for k, pair in enumerate(joined, 1):
            if not {*pair[:2]} & {*moved}:
                what = "neither of the two parts has a motion"
                raise InputError(what, key=f"contacts[{k}].parts", found=str(pair), allowed="a part that moves")
        leaders = _followed(follows, bodies, joined, resting)
        joined = tuple(_turned(pair, leaders) for pair in joined)
        deviations = _made(bodies, tuple(sizes), made, joined)
        if requirement is not None or tolerance is not None:
            scales = _off_by(requirement, tolerance, scales, bodies, moved)
            request |= {"scales": scales, "requirement": None, "tolerance": None}
        made_at_scales = dict.fromkeys(bodies, 1.0) | _numbers(scales, "scales", bodies)
        own = {
            "parts": bodies,
            "drawn": bodies,
            **lengths_of(*bodies.values()),
            "contacts": joined,
            "sizes": tuple(sizes),
            "motions": {part: moved[part] for part in bodies if part in moved},
            "follows": leaders,
            "scales": made_at_scales,
            "scales_made": made_at_scales,
            "nominal_scales": {f"scales.{part}": 1.0 for part in bodies},
            "made": deviations,
            "weights": dict.fromkeys(moved, 1.0) | _numbers(weights, "weights", moved),
            "lengths": {part: bodies[part].size / 2.0 for part in moved} | _numbers(lengths, "lengths", moved),
            "limits": _limits(limits, moved),
            "keep_out": others,
            "resolution": by_parameter(resolution, "resolution", moved, NO_PART),
            "name": name,
            "unit": unit_of(
                unit,
                {f"parts.{part}": body.unit for part, body in bodies.items()}
                | {f"keep_out[{k}]": other.body.unit for k, other in enumerate(others, 1)},
            ),
            "fixed": resting,
            "request": request,
            "_problems": {},
            "_alike": None,
        }
        vars(self).update(own, limit_slack=DEFAULT.requirement * max(body.size for body in bodies.values()))
        coordinates = list[Coordinate]()  # whose weights are those in the total
        for part, motion in self.motions.items():
            each = (self.weights[part] * motion.weights(self.lengths[part])).tolist()
            for (parameter, kind), weight in zip(motion.parameters, each, strict=True):
                ends = self.limits[part].get(parameter, FREE)
                coordinates.append(Coordinate(f"{part}.{parameter}", kind, weight, ends))
        object.__setattr__(self, "coordinates", tuple(coordinates))
        if amount == "displacement":
            what = "the largest displacement is of one part, and here several may move"
            allowed = '"weighted", or an expression of all parameters, "PART.PARAMETER"'
            raise InputError(what, key="amount", found=amount, allowed=allowed)
        object.__setattr__(self, "amount", checked_amount(amount, [own.name for own in self.coordinates]))
        self._check_contacts()

    def __repr__(self) -> str:
        """Return what is asked, on one line; everything else is an attribute."""
        texts = [f"fixed {', '.join(self.fixed)}"]
        texts += [f"{part} moves by {', '.join(motion.names)}" for part, motion in self.motions.items()]
        made = [f"{part} at {scale:.6g}" for part, scale in self.scales.items() if scale != 1.0]
        made += [f"{size} {signed(value, 6)}" for size, value in self.made.items() if value]
        texts += [f"contacts {', '.join(map(str, self.contacts))}", f"made {', '.join(made) or 'as drawn'}"]
        return f"Assembly({self.name!r}: {'; '.join(texts)}{f', {self.unit}' if self.unit else ''})"

    def _check_contacts(self) -> None:
        for k, pair in enumerate(self.contacts, 1):
            with placed(key=f"contacts[{k}] '{pair}'"):
                self.problem(pair)

    @cached_property
    def bodies_made(self) -> dict[str, Body]:
        """The parts at the sizes made, unscaled."""
        return each_resized(self.parts, {size: self.made[size.name] for size in self.sizes})

    @property
    def kept_clear(self) -> tuple[tuple[str, str], ...]:
        """The two parts of each contact of goal "clear", by name: what its clearances are for."""
        return tuple(own[:2] for own in self.contacts if own.asked.get("goal") == "clear")

    @cached_property
    def kinematics(self) -> dict[str, Kinematics]:
        """Of what carries each part."""
        around = {part: JoinedPair(part, self.fixed[0], {}) for part in self.motions}
        motions = {part: self._shared(pair, tuple(self.motions))["motion"] for part, pair in around.items()}
        return {part: motion.kinematics(np.zeros(3), np.zeros(3)) for part, motion in motions.items()}

    def changed(self, **arguments: Any) -> Assembly:
        """Return the same question with other arguments; raises as the constructor does.

        Of what does not depend on scales nothing is worked out again where these alone are others.
        """
        if arguments.keys() == {"scales"}:
            other, scales = object.__new__(Assembly), _numbers(arguments["scales"], "scales", self.parts)
            scales = dict.fromkeys(self.parts, 1.0) | scales
            own = {"scales": scales, "scales_made": scales, "request": {**self.request, **arguments}}
            vars(other).update(vars(self) | own | {"_alike": self._alike or self, "_problems": {}})
            other._check_contacts()
            return other
        return Assembly(**{**self.request, **arguments})

    def with_sizes(self, values: Mapping[str, float]) -> Assembly:
        """Return the same question with other sizes or scales made; raises as the constructor does."""
        made = {name: values.get(name, own) for name, own in self.made.items()}
        return self.changed(scales=self.scales_at(values), **({"made": made} if made != self.made else {}))

    def with_limits(self, name: str, limits: tuple[float, float]) -> Assembly:
        """Return the same question with other limits of a coordinate."""
        part, _, own = name.rpartition(".")
        return self.changed(limits={**self.limits, part: {**self.limits[part], own: limits}})

    def with_motion(self, motion: Motion) -> tuple[Assembly, tuple[str, ...]]:
        """Return the same question with another motion of each part that moves, and which limits it has no more."""
        names, owned = set(motion.names), [(part, k) for part, own in self.limits.items() for k in own]
        limits = {part: {k: ends for k, ends in own.items() if k in names} for part, own in self.limits.items()}
        dropped = tuple(f"limits.{part}.{k}" for part, k in owned if k not in names)
        return self.changed(motions=dict.fromkeys(self.motions, motion), limits=limits), dropped

    def deviating(self, share: float) -> Assembly:
        """Return the same question with a share of the deviations of all scales and sizes."""
        scales = {part: 1.0 + share * (scale - 1.0) for part, scale in self.scales.items()}
        return self.changed(scales=scales, made={name: share * value for name, value in self.made.items()})

    @property
    def deviates(self) -> bool:
        """Whether a scale or a size is off what is drawn."""
        return any(scale != 1.0 for scale in self.scales.values()) or any(self.made.values())

    @cached_property
    def parameters(self) -> tuple[tuple[str, Parameter], ...]:
        """The part and the parameter of each motion, in order."""
        return tuple((part, own) for part, motion in self.motions.items() for own in motion.parameters)

    def chain(self, part: str) -> tuple[str, ...]:
        """Return the parts that carry a part, from the first that moves on to itself; none for a fixed one."""
        found: list[str] = []
        while part in self.motions:
            found.append(part)
            part = self.follows[part]
        return tuple(reversed(found))

    def pairs(self) -> Iterator[tuple[str, str]]:
        """Yield every two parts that may come to overlap; fixed parts are where they are."""
        yield from (pair for pair in combinations(self.parts, 2) if not {*pair} <= {*self.fixed})

    def moving_pairs(self) -> Iterator[tuple[str, str]]:
        """Yield the same, of each a part that moves first."""
        yield from (pair[::-1] if pair[0] in self.fixed else pair for pair in self.pairs())

    def involved(self, one: str, two: str) -> tuple[str, ...]:
        """Return the parts on whose motions it depends how two parts meet."""
        chains = self.chain(one), self.chain(two)
        return tuple(part for own, other in (chains, chains[::-1]) for part in own if part not in other)

    def sharing(self, pairs: Iterable[JoinedPair]) -> list[str]:
        """Return the parts whose parameters one question about some pairs is in: all with an amount of one's own."""
        involved = {part for pair in pairs for part in self.involved(*pair[:2])}
        return [part for part in self.motions if part in involved or isinstance(self.amount, OwnAmount)]

    def keeps_out(self, one: str, two: str) -> bool:
        """Tell whether the question about two parts is that of keep-outs, too: of a part that moves, and what it is on.

        One fixed part for each: it stands still as keep-outs do.
        """
        chain = self.chain(one)
        return bool(self.keep_out and chain) and self.follows[chain[0]] == two

    def poses(self, q: Mapping[str, Sequence[float] | Array]) -> dict[str, Array]:
        """Return the pose change of each part in the world, (4, 4), of the parameters of each motion."""
        found = {part: np.eye(4) for part in self.fixed}
        for part in self.motions:
            T = np.eye(4)
            for own in self.chain(part):
                T = T @ self.motions[own].transform(q[own], self.parts[own].seed, self.parts[self.follows[own]].seed)
            found[part] = T
        return {part: frozen(found[part]) for part in self.parts}

    def to_dict(self) -> dict[str, Any]:
        """Return the question as plain data: the keys of a file of an assembly with one case, angles in radians."""
        unit = {"unit": self.unit} if self.unit else {}
        parts = list[dict[str, Any]]()
        for part, body in self.parts.items():
            entry = {**plain_body(replace(body, name=part)), **unit}
            if motion := self.motions.get(part):
                spelt = {name: f"{name}{'_rad' * (kind == 'rotation')}" for name, kind in motion.parameters}
                entry |= {
                    "motion": [step.own_plain() for step in motion.steps],
                    "follows": self.follows[part],
                    "weight": self.weights[part],
                    "length": self.lengths[part],
                    "limits": {spelt[name]: plain(ends) for name, ends in self.limits[part].items()},
                }
                if steps := self.resolution.get(part):
                    named = steps if isinstance(steps, Mapping) else dict.fromkeys(spelt, steps)
                    entry["resolution"] = {spelt[name]: step for name, step in named.items()}
            parts.append(entry)
        others = [{**plain_keep_out(other), **unit} for other in self.keep_out]
        sizes = [size.to_dict() for size in self.sizes]
        case = {"name": self.name, "scales": dict(self.scales), **({"made": dict(self.made)} if sizes else {})}
        if isinstance(self.amount, OwnAmount):
            case["amount"] = {"casadi": self.amount.text}
        contacts = [{"parts": list(pair[:2]), **plain(pair.asked)} for pair in self.contacts]
        more = {"keep_out": others, "size": sizes}
        return {"part": parts, "contact": contacts, **{key: own for key, own in more.items() if own}, "case": [case]}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Assembly:
        """Rebuild an assembly from `to_dict`, or from the contents of a file of an assembly with one case.

        Raises
        ------
        InputError
            Names the key, what was found and what is allowed.
        """
        from fcdm_opt.problem.assembly_file import AssemblyFile

        assemblies = checked(AssemblyFile, data).assemblies(Assembly)
        if len(assemblies) > 1:
            raise InputError("more than one case", key="case", found=len(assemblies), allowed="one")
        return assemblies[0]

    # ---------------------------------------------------------------------------------------------------- as problems

    def is_own(self, pair: JoinedPair) -> bool:
        """Tell whether a contact is of a part with the one that it follows: its motion alone restores it."""
        return self.follows.get(pair.one) == pair.two

    @property
    def relations(self) -> dict[tuple[str, str], Problem]:
        """What is asked of every two parts, not both fixed, in the parameters of all motions; by the names of the two.

        Its contacts in order, then of others that they do not overlap, and of what keeps out of keep-outs: each part
        that moves is asked about them once. Parameters are named "part.parameter".
        """
        asked, known = {frozenset(pair[:2]) for pair in self.contacts}, {pair[:2] for pair in self.contacts}
        others = (
            JoinedPair(*pair, CLEAR)
            for pair in self.moving_pairs()
            if frozenset(pair) not in asked or (self.keeps_out(*pair) and pair not in known)
        )
        return {pair[:2]: self.problem(pair, tuple(self.motions)) for pair in (*self.contacts, *others)}

    questions = relations

    def problem(self, pair: JoinedPair, parts: Sequence[str] | None = None) -> Problem:
        """Return the question about two parts: in the parameters of some parts' motions, which see each other move.

        Parameters
        ----------
        pair : JoinedPair
        parts : sequence of str, optional
            Whose parameters the problem has, in order, all that are `involved` among them. By default those alone.
        """
        key = *pair[:2], tuple(parts or ()), pair.asked.get("goal")
        if key not in self._problems:
            self._problems[key] = self._asked(pair, parts)
        return self._problems[key]

    def _asked(self, pair: JoinedPair, parts: Sequence[str] | None) -> Problem:
        target = (self.scales[pair.one], self.scales[pair.two])
        if self._alike is not None:
            return self._alike.problem(pair, parts).changed(target=target)
        shown = {"name": f"{self.name}: {pair}" if self.name else str(pair), "unit": self.unit}
        bodies = {role: self.parts[part] for role, part in zip(ROLES, pair[:2], strict=True)}
        named = {part: role for role, part in zip(ROLES, pair[:2], strict=True)}
        sizes = [size.of_body(named[size.body]) for size in self.sizes if size.body in named]
        made = dict[str, Any]()
        if sizes:
            made |= {"sizes": sizes, "made": {size.name: self.made[size.name] for size in sizes}}
        if self.keeps_out(*pair[:2]):
            made["keep_out"] = self.keep_out
        common: dict[str, Any] = {**bodies, **shown, **pair.asked, **made, "target": target}
        if parts is None and self.is_own(pair):
            part = pair.one
            own = {"motion": self.motions[part], "limits": self.limits[part], "length": self.lengths[part]}
            own["resolution"] = self.resolution.get(part)
            return Problem(**{**common, **own})
        if isinstance(self.amount, OwnAmount) and tuple(parts or ()) == tuple(self.motions):
            common["amount"] = self.amount
        return Problem(**{**common, **self._shared(pair, self.involved(*pair[:2]) if parts is None else parts)})

    def _shared(self, pair: JoinedPair, parts: Sequence[str]) -> dict[str, Any]:
        """Return motion, weights and limits of a problem in the parameters of several parts."""
        own = [each for part in parts for each in self.coordinates if each.name.rpartition(".")[0] == part]
        weights = {each.name: each.weight for each in own}
        limits = {each.name: each.limits for each in own if each.limits != FREE}
        seeds = {part: tuple(body.seed.tolist()) for part, body in self.parts.items()}
        starts = np.cumsum([0, *(len(self.motions[part].parameters) for part in parts)]).tolist()
        carried = {
            part: Carrying(self.motions[part], start, (seeds[part], seeds[self.follows[part]]))
            for part, start in zip(parts, starts, strict=False)
        }
        one, two = self.chain(pair.one), self.chain(pair.two)
        sides = (tuple(carried[part] for part in own if part not in other) for own, other in ((one, two), (two, one)))
        names = tuple(Parameter(each.name, each.kind) for each in own)
        return {"motion": Relative(names, *sides), "weights": weights, "limits": limits}


# --------------------------------------------------------------------------------------------------------------- checks


def _bodies(parts: Any) -> dict[str, Body]:
    named = list(parts.items()) if isinstance(parts, Mapping) else [(getattr(x, "name", None), x) for x in items(parts)]
    found: dict[str, Body] = {}
    for name, body in named:
        if not isinstance(body, Body):
            raise InputError("not a body", key="parts", found=type(body).__name__, allowed="bodies, by name")
        if not isinstance(name, str) or not name.strip() or not name.isprintable():
            raise InputError("a part needs a name", key="parts", found=name, allowed="a text")
        if name in found:
            allowed = "a name that no other part has"
            raise InputError("two parts have one name", key="parts", found=name, allowed=allowed)
        found[name] = replace(body, name=name) if body.name == UNNAMED else body
    if len(found) < 2:
        raise InputError("an assembly has several parts", key="parts", found=len(found), allowed="two or more")
    return found


def _numbers(values: Any, key: str, known: Mapping[str, Any]) -> dict[str, float]:
    return {part: positive(value, f"{key}.{part}") for part, value in by_parameter(values, key, known, NO_PART).items()}


def _limits(values: Any, moved: Mapping[str, Motion]) -> dict[str, dict[str, tuple[float, float]]]:
    found: dict[str, dict[str, tuple[float, float]]] = {part: {} for part in moved}
    for part, own in by_parameter(values, "limits", moved, NO_PART).items():
        listed = by_parameter(own, f"limits.{part}", moved[part].names)
        found[part] = {name: interval(ends, f"limits.{part}.{name}") for name, ends in listed.items()}
    return found


def _joined(contacts: Any, parts: Mapping[str, Body]) -> tuple[JoinedPair, ...]:
    found: list[JoinedPair] = []
    for k, given in enumerate(items(contacts), 1):
        key = f"contacts[{k}]"
        with placed(key=key):
            table = dict(given) if isinstance(given, Mapping) else {"parts": given}
            if "parts" in table:
                table["parts"] = items(table["parts"])
            entry = checked(JoinedEntry, table)
        one, two = (known_word(name, parts, NO_PART, key=f"{key}.parts") for name in entry.parts)
        if one == two:
            raise InputError("a part does not meet itself", key=f"{key}.parts", found=one, allowed="two parts")
        if any({one, two} == {*other[:2]} for other in found):
            what = "two contacts are of the same parts"
            raise InputError(what, key=f"{key}.parts", found=f"{one}, {two}", allowed="one, which may list several")
        asked = {name: getattr(entry, name) for name in entry.model_fields_set - {"parts"}}
        if asked.get("goal") not in ("touch", "clear"):
            asked.setdefault("contacts", "all")
        found.append(JoinedPair(one, two, asked))
    if not found:
        raise InputError("there are no contacts", key="contacts", found=contacts, allowed="pairs of names of parts")
    return tuple(found)


def _followed(
    given: Any, parts: Mapping[str, Body], joined: Sequence[JoinedPair], fixed: Sequence[str]
) -> dict[str, str]:
    """Return which part each moving one follows: as given, or the next on the way of contacts to a fixed one.

    A part that is to be kept clear of another rests on it only where nothing else leads to a fixed one.
    """
    asked = by_parameter(given, "follows", parts, NO_PART)
    for part, leader in asked.items():
        known_word(leader, parts, NO_PART, key=f"follows.{part}")
        if part in fixed:
            allowed = "a part that moves"
            raise InputError("a fixed part follows none", key=f"follows.{part}", found=leader, allowed=allowed)
    found: dict[str, str] = {}
    reached = [*fixed]
    both = [(pair.asked.get("goal") == "clear", *own) for pair in joined for own in (pair[:2], pair[1::-1])]
    while further := [own for own in both if own[1] in reached and own[2] not in reached]:
        _, part, other = min(further, key=lambda own: (own[0], reached.index(own[1])))
        reached.append(other)
        found[other] = part
    lost = [part for part in parts if part not in reached and part not in asked]
    if lost:
        what = f"no contacts lead from a fixed part ({', '.join(fixed)}) to this one"
        raise InputError(what, key="contacts", found=name_list(lost), allowed="contacts that join all parts")
    found |= asked
    for part in found:
        seen = {part}
        while part := found.get(part, ""):
            if part in seen:
                what = "parts follow each other in a circle"
                raise InputError(what, key=f"follows.{part}", found=found[part], allowed="a tree")
            seen.add(part)
    return found


def _turned(pair: JoinedPair, follows: Mapping[str, str]) -> JoinedPair:
    """Return a contact with the part first that follows the other, unless labels tell which is which."""
    labelled = isinstance(pair.asked.get("contacts"), list)
    return JoinedPair(pair.two, pair.one, pair.asked) if follows.get(pair.two) == pair.one and not labelled else pair


def _off_by(
    letter: Any, tolerance: Any, scales: Any, parts: Mapping[str, Body], moved: Mapping[str, Motion]
) -> dict[str, float]:
    """Return the scales that a requirement letter means."""
    if scales or letter is None or tolerance is None:
        given = {"requirement": letter, "tolerance": tolerance, "scales": scales or None}
        what, found = "not what parts are off by", ", ".join(key for key, own in given.items() if own is not None)
        raise InputError(what, key="requirement", found=found, allowed="requirement and tolerance, or scales")
    known_word(letter, SIGNS, "unknown requirement", key="requirement")
    shares = dict.fromkeys(parts, tolerance)
    if isinstance(tolerance, Mapping):
        shares = dict.fromkeys(parts, 0.0) | by_parameter(tolerance, "tolerance", parts, NO_PART)
    known = {part: real(x, "tolerance", "shares, >= 0 and below 1", lambda x: 0 <= x < 1) for part, x in shares.items()}
    return {part: 1.0 + SIGNS[letter][part not in moved] * share for part, share in known.items()}


def _extreme(
    parts: Mapping[str, Body], sizes: tuple[Size, ...], made: str, joined: Iterable[JoinedPair]
) -> dict[str, float]:
    """Return the deviations at which contacts have their least gap at rest, or their largest; see `Assembly`."""
    found, sign = list[tuple[float, dict[str, float]]](), 1.0 if made == "worst" else -1.0
    for pair in joined:
        roles = dict(zip(pair[:2], ROLES, strict=True))
        own = [size.of_body(roles[size.body]) for size in sizes if size.body in roles]
        if own:
            for gap, values in extremes(parts[pair.one], parts[pair.two], own, least=made == "worst"):
                at = {size.name: x for size, x in zip(own, values.tolist(), strict=True) if not math.isnan(x)}
                found.append((sign * gap, at))
    known = {size.name: float(np.clip(0.0, *size.tolerance)) for size in sizes}
    for _, at in sorted(found, key=lambda own: -own[0]):
        known |= at
    return known


def _made(
    parts: Mapping[str, Body], sizes: tuple[Size, ...], made: Any, joined: Iterable[JoinedPair]
) -> dict[str, float]:
    """Return all deviations by name."""
    names = [size.name for size in sizes if isinstance(size, Size)]
    if len(names) < len(sizes):
        raise InputError("not a size", key="sizes", found=sizes, allowed="Sizes")
    for size in sizes:
        known_word(size.body, parts, NO_PART, key=f"size '{size.name}'.body")
        if names.count(size.name) > 1:
            raise InputError("two sizes have one name", key="sizes", found=size.name, allowed="a name of its own")
    if isinstance(made, str) and made not in CORNERS:
        allowed = f"deviations by name, or {', '.join(CORNERS)}"
        raise InputError("no such corner of the sizes", key="made", found=made, allowed=allowed)
    if made is not None and not isinstance(made, str | Mapping):
        raise InputError("not deviations", key="made", found=made, allowed="deviations by name")
    for name, value in made.items() if isinstance(made, Mapping) else ():
        if not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError("unusable deviation", key=f"made.{name}", found=value, allowed="a finite number")
    known_sizes(made if isinstance(made, Mapping) else (), "made", [size.name for size in sizes])
    if made in CORNERS[:2]:
        check_sizes(sizes)
        return _extreme(parts, sizes, made, joined)
    one = next(iter(parts.values()))
    return made_at(one, one, sizes, {} if made is None else made)
