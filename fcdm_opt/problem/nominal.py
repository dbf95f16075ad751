"""Which contact of the decision curve a nominal pair means, and what of it a goal tracks."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from fcdm_opt.curve.contact import Joint
from fcdm_opt.curve.decision_curve import DecisionCurve, drawn_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.flush import Flush
from fcdm_opt.curve.region import Piece
from fcdm_opt.curve.segments import Box, Segment, SwitchingPoint
from fcdm_opt.curve.tight import TightLine, choices, parallel, tight_lines
from fcdm_opt.errors import InputError, placed
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.units import UnitOrNone, gap_text
from fcdm_opt.problem.active_parts import Indices
from fcdm_opt.problem.scene import lengths_of
from fcdm_opt.tolerances import DEFAULT

TRACKING = ("beyond", "at", "seat")  # goals that follow the nominal contact
FIT = "fit"  # the goal that asks of several contacts only how far they are open


class Snapped(NamedTuple):
    """How a nominal pair was closed to the decision curve: the pair asked for, that on the curve, the gap closed."""

    asked: Array
    pair: Array
    gap: float


class NominalContact:
    """The part of a `Problem` that speaks of the nominal contact; see there for its attributes."""

    movable: Body
    static: Body
    active: tuple[Body, Body]
    partial: bool  # whether these are only some of the parts of large bodies
    nominal: int | Literal["drawn"] | tuple[float, float]
    box: Box
    snap: float
    goal: str | None
    unit: UnitOrNone
    features: Any
    contacts: Any
    size: float
    contact_slack: float

    def __init__(self, **values: Any) -> None:
        bodies = values["movable"], values["static"]
        self.__dict__.update(values, **lengths_of(*bodies), partial=values["active"][0] is not bodies[0])

    @property
    def active_indices(self) -> Indices | None:
        """The numbers, from 0, of the parts of either body that are looked at; None where all are."""
        return (np.array(self.active[0].part_indices), np.array(self.active[1].part_indices)) if self.partial else None

    @cached_property
    def curve(self) -> DecisionCurve:
        """Decision curve of the bodies as drawn, in the box; problems about the same bodies share it."""
        return drawn_curve(*self.active, self.box)

    @cached_property
    def nominal_contact(self) -> Segment | SwitchingPoint | None:
        """The switching point or segment that the nominal pair lies on, None where it lies on neither."""
        return self._located if self._closed is None else self._closed[0]

    @cached_property
    def _located(self) -> Segment | SwitchingPoint | None:
        """What the nominal pair lies on as asked for."""
        if isinstance(self.nominal, int):
            return self.curve.switching_points[self.nominal - 1]
        return self.curve.locate(self._asked_pair, DEFAULT.nominal)

    @cached_property
    def _closed(self) -> tuple[Segment | SwitchingPoint, Snapped] | None:
        """What a nominal pair slightly off the curve is closed to, None where it is left as it is."""
        # a switching point within `snap` comes first; goal "beyond" speaks of nothing else
        if self.goal not in (None, *TRACKING, FIT) or isinstance(self.nominal, int) or self._nominal_pair_touches:
            return None
        located = self._located
        if isinstance(located, SwitchingPoint) or (isinstance(located, Segment) and self.goal != "beyond"):
            return None
        asked = np.array(self._asked_pair)
        gap = float(self.curve.gap(asked))
        if abs(gap) > self.snap * self.size:
            return None
        for point in self.curve.switching_points:
            if self._within_snap(point.rho, asked):
                return point, Snapped(asked, point.rho, gap)
        nearest = self.curve.nearest(asked)
        if located is not None or not self._within_snap(nearest, asked):
            return None
        contact = self.curve.locate(nearest, DEFAULT.nominal)
        return None if contact is None else (contact, Snapped(asked, nearest, gap))

    @cached_property
    def _nominal_pair_touches(self) -> bool:
        """Whether contacts are named, and the bodies touch at the pair asked for: the curve need not be listed."""
        if not self.contacts or isinstance(self.nominal, int):
            return False
        near = DEFAULT.nominal * self.size
        return bool(abs(self.curve.near_gap(np.array(self._asked_pair), near)) <= near)

    def _within_snap(self, pair: Array, asked: Array) -> bool:
        """Tell whether neither scale differs from the one asked for by more than `snap`; never for nan."""
        return bool(np.abs(pair / asked - 1.0).max() <= self.snap)

    @property
    def snapped(self) -> Snapped | None:
        """How the nominal pair was closed to the curve, None where it was not."""
        return None if self._closed is None else self._closed[1]

    @cached_property
    def nominal_pair(self) -> Array:
        """Nominal scales, (2,): those of the switching point where it is one, and on the curve where closed to it."""
        asked = self._asked_pair
        follows_none = self.goal in ("touch", "clear") and not isinstance(self.nominal, int)
        if follows_none or self._nominal_pair_touches:  # what touches there is looked up when it is asked for
            return frozen(asked)
        contact = self.nominal_contact
        if isinstance(contact, SwitchingPoint):
            return frozen(contact.rho)
        return frozen(asked if self.snapped is None else self.snapped.pair)

    @cached_property
    def _touches(self) -> bool:
        """Whether there is a contact: on the curve, or one that all sizes have, with both seeds in its plane."""
        slack = self.contact_slack
        if self.goal != "beyond" and abs(self.curve.near_gap(self.nominal_pair, slack)) <= slack:
            return True
        return self.nominal_contact is not None

    @cached_property
    def nominal_seats(self) -> tuple[Flush, ...]:
        """The flush contacts at the nominal pair, tracked or besides; none where the bodies do not touch there."""
        return self.curve.flush(self.nominal_pair) if self._touches else ()

    @cached_property
    def nominal_joints(self) -> tuple[Joint, ...]:
        """Every contact of the nominal position, each feature once; none where the bodies do not touch there."""
        return self.curve.joints(self.nominal_pair, DEFAULT.snap * self.size) if self._touches else ()

    def chosen_contacts(self, asked: Any) -> tuple[Feature, ...]:
        """Return the nominal contacts of these labels, in their order; all for "all", none for None.

        Raises `InputError` for a label that is not one of them, and one that is given twice.
        """
        known = tuple(joint.feature for joint in self.nominal_joints) if asked is not None else ()
        if asked is None or asked == "all":
            return known
        listed = "; ".join(map(str, known)) or "the nominal pair has no contact"
        chosen: list[Feature] = []
        for k, label in enumerate(asked, 1):
            key = f"contacts[{k}]"
            with placed(key=key):
                feature = self._read(label, known)
            if feature not in known:
                raise InputError("no such contact at the nominal position", key=key, found=label, allowed=listed)
            if feature in chosen:
                raise InputError("named twice", key=key, found=label, allowed="each contact once")
            chosen.append(feature)
        if not chosen:
            raise InputError("no contact is named", key="contacts", found=[], allowed=f'"all", or some of {listed}')
        return tuple(chosen)

    @property
    def flush_contacts(self) -> tuple[Feature, ...]:
        """The nominal contacts of whole faces: on bodies of many parts those of the pieces that meet come and go."""
        return tuple(joint.feature for joint in self.nominal_joints if joint.feature.is_flush)

    @property
    def chosen_joints(self) -> tuple[Joint, ...]:
        """The contacts that are restored together, see `Problem.contacts`."""
        known = {joint.feature: joint for joint in self.nominal_joints} if self.contacts else {}
        return tuple(known[feature] for feature in self.contacts or ())

    @property
    def nominal_features(self) -> tuple[Feature, ...]:
        """The features of the nominal contact: two at a switching point, one inside a segment, none off the curve."""
        contact = self.nominal_contact
        if contact is None:
            return ()
        if self.features is not None:
            return tuple(self.features)
        return (contact.feature,) if isinstance(contact, Segment) else contact.features

    @property
    def tracked_features(self) -> tuple[Feature, ...]:
        """The features that the goal follows: the nominal ones, for "seat" all flush contacts there besides."""
        if self.goal not in TRACKING:
            return ()
        if self.contacts:
            return tuple(self.contacts)
        own = self.nominal_features
        others = self.nominal_seats if self.goal == "seat" else ()
        return (*own, *dict.fromkeys(each.touching for each in others if not {each.feature, each.touching} & set(own)))

    @property
    def _asked_pair(self) -> Any:
        return (1.0, 1.0) if self.nominal == "drawn" else self.nominal

    @cached_property
    def _tight_lines(self) -> tuple[TightLine, ...]:
        """The lines that meet at the nominal switching point; none elsewhere, and where the goal tracks nothing."""
        contact = self.nominal_contact
        return tight_lines(contact) if self.goal in TRACKING and isinstance(contact, SwitchingPoint) else ()

    @property
    def feature_pairs(self) -> tuple[tuple[str, str], ...]:
        """Two features each, by label, that the nominal point may keep, where three or more lines meet in it.

        See `fcdm_opt.curve.tight.choices`. Empty where two were named, or there is no choice.
        """
        if self.features is not None or self.contacts or self.goal not in TRACKING:
            return ()
        contact = self.nominal_contact
        pairs = choices(contact) if isinstance(contact, SwitchingPoint) else ()
        return tuple((one.label, two.label) for one, two in pairs)

    @property
    def tracked_lines(self) -> tuple[TightLine | Piece, ...]:
        """What is tracked of the nominal contact: two lines at a switching point, one inside a segment."""
        contact = self.nominal_contact
        if self.goal not in TRACKING or contact is None:
            return ()
        if isinstance(contact, Segment):
            return (contact.piece_at(self.nominal_pair),)
        if self.features is None:
            return contact.pieces
        named = {line.feature: line for line in self._tight_lines}
        return tuple(named[feature] for feature in self.features)

    def check_number(self) -> None:
        """Refuse the number of a switching point that is not there."""
        if not isinstance(self.nominal, int) or self.nominal <= len(self.curve.switching_points):
            return
        points = self.curve.switching_points
        listed = ", ".join(f"{k} at ({point.rho[0]:.6g}, {point.rho[1]:.6g})" for k, point in enumerate(points, 1))
        what = f"no such switching point in the box {self.box}"
        allowed = f"one of {len(points)}: {listed}" if points else "a scale pair; the curve has no switching point"
        raise InputError(what, key="nominal", found=self.nominal, allowed=allowed)

    def default_goal(self, required: bool) -> Literal["beyond", "seat", "touch"]:
        """Return the goal where none is asked for; `required` tells whether there is a requirement."""
        contact = self.nominal_contact
        at_point = required and isinstance(contact, SwitchingPoint) and not contact.alone
        normals = np.array([flush.normal for flush in self.nominal_seats]).reshape(-1, 3)
        no_play = (normals @ normals.T <= DEFAULT.nominal - 1.0).any()  # held from two sides
        if at_point and not no_play:
            return "beyond"
        return "seat" if self.nominal_seats else "touch"

    def check_goal(self, target: Array, signs: Array) -> None:
        """Refuse a goal that tracks this contact but cannot; `signs` of the target pair as `Problem.signs`."""
        goal = self.goal
        if not self.contacts and self.nominal_contact is None:
            asked = self.nominal_pair
            nearest, gap = self.curve.nearest(asked), float(self.curve.gap(asked))
            pair = [float(f"{x:.9g}") for x in nearest.tolist()]
            near = f"the pair nearest to it there, {pair}," if np.isfinite(nearest).all() else "any there"
            one, two = self.curve.movable.name or "the movable part", self.curve.static.name or "the static part"
            do = 'write goal = "clear", in a file of an assembly under this [[contact]]: `stack` then adds up the gap'
            do = do if gap > 0.0 else 'goal "touch" or "clear" moves them apart'
            what = (
                f"{one} and {two} {gap_text(gap, 0.0, self.unit)} {'as drawn' if (asked == 1.0).all() else 'there'}: "
                f'{do}; goal "{goal}" tracks a contact, but the nominal pair is not on the decision curve, {near} is '
                f"further off than snap, {self.snap:.3g}"
            )
            allowed = (
                'goal "clear" or "touch", a switching point, a pair on the curve, a larger snap; from a pose '
                "sensed: ask about the parts as drawn, and correct by transform @ inv(sensed)"
            )
            raise InputError(what, key="nominal", found=asked.tolist(), allowed=allowed)
        if goal == "beyond" and not isinstance(self.nominal_contact, SwitchingPoint):
            what = (
                "the nominal pair lies inside a segment, and a long segment reaches the quadrant beyond the target "
                "pair with no motion at all, so the goal would say nothing"
            )
            allowed = '"at" or "touch" there; "beyond" at a switching point'
            raise InputError(what, key="goal", found=goal, allowed=allowed)
        if goal == "beyond" and not signs.all():
            what = 'goal "beyond" needs a direction for both scales, but the target equals the nominal pair in one'
            allowed = f"both scales off {self.nominal_pair.tolist()}"
            raise InputError(what, key="target", found=target.tolist(), allowed=allowed)
        if goal == "seat" and not self.nominal_seats:
            contact = self.nominal_contact
            found = getattr(contact, "configurations", None) or (getattr(contact, "configuration", ""),)
            what = 'goal "seat" keeps flush contacts flush, but the nominal contact shares no more than a point'
            found = f'"seat" at a nominal contact {" and ".join(filter(None, found)) or "of round faces"}'
            allowed = 'a nominal contact F-F, F-E or E-E parallel; "at" or "touch" at this one'
            raise InputError(what, key="goal", found=found, allowed=allowed)

    def _read(self, label: str, known: Iterable[Feature]) -> Feature:
        """Return the feature of a label, or of a text that stands for only one of these, see `Feature.spellings`."""
        meant = [own for own in known if label in own.spellings(self.movable, self.static)]
        return meant[0] if len(meant) == 1 else Feature.from_label(label)

    def named(self, labels: tuple[str, str] | None) -> tuple[Feature, Feature] | None:
        """Return the features that were named, which must touch at the nominal switching point."""
        if labels is None:
            return None
        lines = {line.feature: line for line in self._tight_lines}
        if not lines:
            found = f'goal "{self.goal}"' if self.goal not in TRACKING else "a nominal pair off the switching points"
            allowed = 'a switching point and goal "beyond", "at" or "seat"'
            raise InputError("there are no two features to choose from", key="features", found=found, allowed=allowed)
        chosen = []
        for k, label in enumerate(labels, 1):
            with placed(key=f"features[{k}]"):
                feature = self._read(label, lines)
            if feature not in lines:
                listed = "; ".join(str(name) for name in lines)
                what = "no such feature touches at the nominal point"
                raise InputError(what, key=f"features[{k}]", found=label, allowed=listed)
            chosen.append(lines[feature])
        if parallel(chosen[0].line, chosen[1].line):
            others = "; ".join(str(name) for name in lines)
            what = "the lines of these two features are parallel: they fix no point"
            allowed = f"two of different direction: {others}"
            raise InputError(what, key="features", found=" and ".join(labels), allowed=allowed)
        return chosen[0].feature, chosen[1].feature
