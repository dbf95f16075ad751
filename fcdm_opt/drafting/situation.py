"""How two parts lie as drawn: apart, touching or overlapping, and which contacts are near that."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import contains
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.contact import Joint, joints
from fcdm_opt.curve.decision_curve import DEFAULT_BOX, DecisionCurve, decision_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.segments import Box, Segment, SwitchingPoint
from fcdm_opt.curve.true_sizes import contacts_as_drawn
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.facet_errors import all_recognised, facet_errors, gaps_off, is_plane_there, round_surfaces
from fcdm_opt.geometry.measures import cross, norms
from fcdm_opt.geometry.naming import element_text, is_round
from fcdm_opt.geometry.patches import NearestPoints, patches_of_element, true_faces
from fcdm_opt.geometry.solids import depth_as_drawn
from fcdm_opt.model.true_faces import where_nearest
from fcdm_opt.motion.motions import Free
from fcdm_opt.problem.active_parts import active_bodies
from fcdm_opt.problem.fit import holds
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

DRAWN = (1.0, 1.0)
MARGIN = 0.1  # of the box about the sizes drawn, five times a draft's tolerance; half of it about contacts
UNMEANT = 1e-5  # radians: single precision tilts faces of 100 by 1e-7, and no one draws so small an angle
ONE_SIDE = 0.1  # length of the mean of unit normals, above which contacts are on one side
STRAIGHT = 1e-3  # of facets a mean of normals is off the axis of their face by less
WIDE: Box = ((0.02, 50.0), (0.02, 50.0))
"""Scales at which a contact is looked for where the usual box has none."""


class Near(NamedTuple):
    """A scale pair at which the parts touch, and what touches there."""

    pair: Array
    contact: Segment | SwitchingPoint

    @property
    def features(self) -> tuple[Feature, ...]:
        """What touches."""
        return (self.contact.feature,) if isinstance(self.contact, Segment) else self.contact.features


@dataclass(frozen=True, eq=False)
class Situation:
    """Where two parts are as drawn; `unit` is that of their lengths, as shown."""

    movable: Body
    static: Body
    unit: str = ""

    @cached_property
    def size(self) -> float:
        """Length that relative tolerances refer to."""
        return max(self.movable.size, self.static.size)

    @cached_property
    def gap(self) -> float:
        """Distance where the parts are apart; minus how deep they overlap: no shorter shift takes them apart.

        That of true faces, where round ones are known and meet.
        """
        if self.on_round_face and self._on_true_faces:
            return self._on_true_faces[0].gap
        gap = float(self._usual.gap(DRAWN))
        if gap < -DEFAULT.snap * self.size and (len(self.movable.parts) > 1 or len(self.static.parts) > 1):
            gap = min(gap, -depth_as_drawn(self.movable, self.static, DRAWN))
        return float(self._usual.distance(DRAWN)) if gap > 0 else gap

    @cached_property
    def state(self) -> str:
        """Return "touching" where a nominal contact as drawn would be taken for one, else "apart", "overlapping"."""
        if self._drawn.locate(DRAWN) is not None:
            return "touching"
        true = self.on_round_face and bool(self._on_true_faces)
        moved = 0.0 if true else np.abs(self._drawn.nearest(DRAWN) - DRAWN).max()
        if abs(self.gap) <= DEFAULT.snap * self.size and moved <= DEFAULT.snap:
            return "touching"
        return "apart" if self.gap > 0 else "overlapping"

    @cached_property
    def fit(self) -> str:
        """`state`, but "fitted" of parts that are apart and between walls of each other; not of large bodies."""
        both = self.movable, self.static
        apart = self.state == "apart" and not self.large
        return "fitted" if apart and holds(Problem(*both, target=DRAWN, goal="clear", motion=Free())) else self.state

    @cached_property
    def _on_true_faces(self) -> list[NearestPoints]:
        """Where true faces are nearest as drawn, the nearest first, if all are known.

        None of parts that are far, or that overlap by more than facets can be off: there faces cross.
        """
        both = self.movable, self.static
        surely = float(self._usual.gap(DRAWN)) + gaps_off((self.movable, self.static))[0]
        if not all(map(all_recognised, both)) or surely < -DEFAULT.snap * self.size:
            return []
        return where_nearest(*both, DRAWN, np.eye(4), DEFAULT.snap * self.size)

    @cached_property
    def contacts(self) -> tuple[Feature, ...]:
        """Everything that touches as drawn, each once; empty where nothing does."""
        return tuple(joint.feature for joint in self._joints)

    @cached_property
    def places(self) -> list[str]:
        """Where the parts touch as drawn, in words, each once: of two round faces facets and edges are one place."""
        one, two = self.movable, self.static
        met = [(each.one, each.two) for each in self.contacts] or self._true_faces_met
        pairs = dict.fromkeys((element_text(one, mine), element_text(two, its)) for mine, its in met)
        faces = [pair for pair in pairs if is_round(pair[0]) and not any(own.startswith("edge") for own in pair)]
        edges = {pair for pair in pairs for face in faces if face != pair and all(map(contains, pair, face))}
        return [f"{mine} of {one.name} at {its} of {two.name}" for mine, its in pairs if (mine, its) not in edges]

    @property
    def _true_faces_met(self) -> list[tuple[Element, Element]]:
        """Facets of round faces that touch as drawn, wherever those of the other body are, each two faces once."""
        bodies, found = (self.movable, self.static), dict[frozenset[tuple[int, int]], tuple[Element, Element]]()
        for each in contacts_as_drawn(*bodies, np.array(DRAWN), DEFAULT.snap * self.size):
            sides = zip(map(true_faces, bodies), each.patches, each.points, strict=True)
            one, two = (Element("F", own.body.faces[own.row_at(met[0], x)]) for own, met, x in sides)
            found.setdefault(each.pairs, (one, two))
        return [*found.values()]

    @cached_property
    def sides(self) -> tuple[tuple[Array, tuple[Feature, ...]], ...]:
        """Flush contacts that face one way, and that way, from the movable part to the static one.

        Those that meet the lowest part of the movable body first: what it stands on as drawn. Facets of round faces
        face every way.
        """
        found: list[tuple[Array, list[Feature]]] = []
        for joint in self._joints:
            feature = joint.feature
            if not feature.is_flush or len(joint.normals) != 1 or self._is_round(feature):
                continue
            for normal, own in found:
                if normal @ joint.normals[0] >= 1.0 - DEFAULT.side:
                    own.append(feature)
                    break
            else:
                found.append((joint.normals[0], [feature]))
        found.sort(key=lambda side: round(float(side[0][2]), 6))
        return tuple((normal, tuple(own)) for normal, own in found)

    @cached_property
    def on_round_face(self) -> bool:
        """Whether the facets that meet first are of a round face: their normal is one of many."""
        pair = self._drawn.nearest(DRAWN)
        contact = self._drawn.locate(pair) if np.isfinite(pair).all() else None
        pieces = () if contact is None else _pieces(contact)
        return any(self._is_round(piece.feature) for piece in pieces)

    def _is_round(self, feature: Feature) -> bool:
        """Tell whether faces of a contact are known to be facets of round ones."""
        sides = ((self.movable, feature.one), (self.static, feature.two))
        return any(facet_errors(body) is not None and not is_plane_there(body, own) for body, own in sides)

    @cached_property
    def _joints(self) -> tuple[Joint, ...]:
        """Every contact as drawn, none where nothing touches."""
        if self.state != "touching":
            return ()
        return joints(*self._bodies, np.array(DRAWN), DEFAULT.snap * self.size)

    @cached_property
    def growth(self) -> float:
        """Common scale of both parts, that nearest to 1, at which they touch (growth distance); nan without one."""
        if self.state == "touching":
            return 1.0
        for curve in (self._usual, self._wide):
            found = [scale for segment in curve.segments for scale in _on_diagonal(segment)]
            if found:
                return min(found, key=lambda scale: abs(scale - 1.0))
        return float("nan")

    @cached_property
    def box(self) -> Box:
        """Scales that a file about these parts should show: about those drawn, and where contacts are nearest."""
        return self.box_about(*(near.pair for near in (self.nearest, self.grown) if near is not None))

    def box_about(self, *pairs: Array) -> Box:
        """Return a box that holds the scales drawn, and these, with a margin."""
        low, high = np.ones(2) * (1.0 - MARGIN), np.ones(2) * (1.0 + MARGIN)
        for pair in pairs:
            low, high = np.minimum(low, pair * (1.0 - MARGIN / 2.0)), np.maximum(high, pair * (1.0 + MARGIN / 2.0))
        one, two = ((rounded(a, math.floor), rounded(b, math.ceil)) for a, b in zip(low, high, strict=True))
        return one, two

    @cached_property
    def curve(self) -> DecisionCurve:
        """The decision curve in `box`."""
        return self._drawn if self.large or self.box == self._drawn.box else replace(self._usual, box=self.box)

    @cached_property
    def nearest(self) -> Near | None:
        """The contact whose scale pair is nearest to the parts as drawn."""
        return self._near(self._seen.nearest(DRAWN))

    @cached_property
    def flush(self) -> bool:
        """Whether the nearest contact is flush."""
        return self.nearest is not None and bool(self._seen.flush(self.nearest.pair))

    @cached_property
    def grown(self) -> Near | None:
        """The contact that both parts meet in when they are made larger or smaller alike."""
        return self._near(np.array([self.growth, self.growth]))

    @cached_property
    def normal(self) -> Array:
        """Unit direction in which the parts meet, from the movable part to the static one.

        Where one lies in a round face of the other, as in a bore or on a taper, it is where that faces on the average:
        along its axis, or, where that is nowhere, across it, along x, y or z where these are.
        """
        for near in (self.nearest, self.grown):
            if near is not None:
                piece = _pieces(near.contact)[0]
                if self.on_round_face and (direction := self._of_concave_face(piece.feature)) is not None:
                    return direction
                true = self.state == "touching" and self.on_round_face and self._on_true_faces
                return self._on_true_faces[0].normal if true else np.array(piece.normal)
        offset = self.static.seed - self.movable.seed
        length = float(np.linalg.norm(offset))
        return offset / length if length > DEFAULT.seeds * self.size else np.array([0.0, 0.0, 1.0])

    def _of_concave_face(self, feature: Feature) -> Array | None:
        """Return where a concave round face of a contact faces on the average; None without such a face."""
        for drawn, element, sign in ((self.static, feature.two, -1.0), (self.movable, feature.one, 1.0)):
            body = drawn.rounded()  # the direction is that of the face, also where the facets are taken as they are
            if not round_surfaces(body):
                continue
            faces = true_faces(body)
            for k in patches_of_element(body, element):
                if not faces.patches[k].concave:
                    continue
                on = np.abs(faces.patches[k].gaps(faces.corners.reshape(-1, 3))[0]) <= DEFAULT.snap * body.size
                alike = np.unique(faces.owners[on.reshape(-1, 3).all(axis=1)])
                a, b, c = np.moveaxis(faces.corners[np.isin(faces.owners, alike)], 1, 0)
                areas = cross(b - a, c - a)
                axis = faces.patches[k].surface.axis
                axis = np.where(np.abs(axis) <= UNMEANT, 0.0, axis) / float(norms(axis))
                mean = sign * areas.sum(axis=0) / norms(areas).sum()
                along = float(mean @ axis)
                if float(norms(mean - along * axis)) > ONE_SIDE:
                    return mean / float(norms(mean))
                if abs(along) > STRAIGHT:
                    return axis * np.sign(along)
                free = np.eye(3)[np.abs(axis).argmin()]  # of x, y and z that first which is nearest to across
                return (free - (free @ axis) * axis) / float(norms(free - (free @ axis) * axis))
        return None

    def switching_points(self, most: int) -> list[SwitchingPoint]:
        """Return the switching points in `box` that are nearest to the parts as drawn, by number."""
        return sorted(_by_nearness(self.curve)[:most], key=lambda point: point.index)

    @property
    def beyond(self) -> SwitchingPoint | None:
        """The switching point nearest to the parts as drawn where `box` has none; None where it has one."""
        listed = self._usual if self._seen is self._drawn else self._wide
        return None if self.curve.switching_points else next(iter(_by_nearness(listed)), None)

    @cached_property
    def tilt(self) -> float | None:
        """Angle between two faces that nearly lie on one another where the parts meet, radians.

        None where there are no such faces, they are of round ones, or parallel as exactly as is told apart.
        """
        near = self.nearest
        if near is None or self.on_round_face:
            return None
        angles = [
            float(np.linalg.norm(one + two))  # of two unit vectors that are nearly opposite
            for n, (i, j) in ((piece.normal, piece.parts) for piece in _pieces(near.contact))
            for one in _facing(self._bodies[0].parts[i], n)
            for two in _facing(self._bodies[1].parts[j], -n)
        ]
        least = min(angles, default=0.0)
        return least if least > DEFAULT.tie else None

    def _near(self, pair: Array) -> Near | None:
        if not np.isfinite(pair).all() or pair.min() <= 0:
            return None
        contact = self._seen.locate(pair)
        return None if contact is None else Near(pair, contact)

    @cached_property
    def _seen(self) -> DecisionCurve:
        """The curve that contacts are looked for on: about the parts as drawn or in the usual box if it is there."""
        return self._drawn if self.state == "touching" or self._drawn.segments else self._wide

    @cached_property
    def _active(self) -> tuple[tuple[Body, Body], Box]:
        """The bodies with the parts that a problem about them looks at, and the box of their curve."""
        return active_bodies(self.movable, self.static, "drawn", WIDE)

    @property
    def large(self) -> bool:
        """Whether only some of the bodies' parts are looked at."""
        return self._bodies[0] is not self.movable

    @property
    def _bodies(self) -> tuple[Body, Body]:
        return self._active[0]

    @cached_property
    def _usual(self) -> DecisionCurve:
        return decision_curve(*self._bodies, box=self._active[1] if self.large else DEFAULT_BOX)

    @cached_property
    def _drawn(self) -> DecisionCurve:
        """The same about the parts as drawn, where it passes there: far fewer of their parts matter."""
        about = self._usual if self.large else replace(self._usual, box=self.box_about())
        return about if about.segments else self._usual

    @cached_property
    def _wide(self) -> DecisionCurve:
        """That of the parts that are nearest, of large bodies: where others do not take over."""
        return self._usual if self.large and self.state != "apart" else replace(self._usual, box=WIDE)


def _on_diagonal(segment: Segment) -> list[float]:
    """Return the scale at which a segment meets rho_1 = rho_2, if it does."""
    a, b, c = segment.line.tolist()
    if abs(a + b) <= DEFAULT.tie * (abs(a) + abs(b)):
        return []
    scale = c / (a + b)
    pair = np.array([scale, scale])
    off = float(np.abs(segment.nearest(pair) - pair).max())
    return [scale] if scale > 0 and off <= DEFAULT.nominal * scale else []


def _by_nearness(curve: DecisionCurve) -> list[SwitchingPoint]:
    """Return the switching points listed, the nearest to the parts as drawn first."""
    return sorted(curve.switching_points, key=lambda point: float(np.abs(np.log(point.rho)).max()))


def _pieces(contact: Segment | SwitchingPoint) -> Sequence[Any]:
    """Return the pieces of the curve that meet at a contact, each of its normal and part pair."""
    return (contact,) if isinstance(contact, Segment) else contact.pieces


def _facing(part: ConvexPart, direction: Array) -> list[Array]:
    """Return the normals of a part's faces that point in a direction, but for a tilt no one means."""
    return [normal for normal in part.normals if float(np.linalg.norm(normal - direction)) <= UNMEANT]


def rounded(scale: float, rounding: Callable[[float], int]) -> float:
    """Return a scale with two digits, rounded up or down: a border of what is shown need not be finer."""
    unit = 10.0 ** (math.floor(math.log10(scale)) - 1)
    return float(f"{rounding(round(scale / unit, 6)) * unit:.3g}")  # 1.1 / 0.1 is above 11 in floats
