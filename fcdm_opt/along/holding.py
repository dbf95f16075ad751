"""What holds a motion where it is: the constraints that are active there, found from geometry, whatever stage found it.

Each is a group of alternatives, any one of which may be what holds: of two directions in which a part pair is just
apart the pair may leave either, of two pairs that touch either may be the one that must.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.along.round_contacts import RoundContact, round_contacts
from fcdm_opt.along.variation import KEPT_OUT, MOVABLE, STATIC, Layout, MovedScene, Rate, Term
from fcdm_opt.curve import kernels
from fcdm_opt.curve.coherence import Tracked, heights_beyond
from fcdm_opt.curve.contact import (
    SITE_KINDS,
    Contact,
    contact_at,
    contact_set,
    distinct,
    feature_of_site,
    is_own,
    located,
    near_pairs,
    site_corners,
    supporting_contact,
)
from fcdm_opt.curve.features import Feature, is_within
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.exact_points import BENT
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.model.equations import FeaturePoints
from fcdm_opt.model.seats import tilts
from fcdm_opt.model.task import Parts, Task
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.tolerances import DEFAULT

MOST_CORNERS = 12  # of what two bodies share, looked at one by one
DECIMALS = 6  # of directions that are the same
Constraints = tuple[Rate, ...]
Alternatives = list[Constraints]
Site = tuple[int, int, int]


class Facing(NamedTuple):
    """A direction in which a part pair is as far apart as it must be, and what meets in it."""

    normal: Array
    contact: Contact
    corners: Array
    gap: float


@dataclass(eq=False)
class Holding:
    """What holds a motion."""

    task: Task
    q: Array
    limits: Array  # as the user has them; the task's own are zero for parameters that "seat" holds
    reasons: list[str] = field(default_factory=list)  # what could not be looked at

    @cached_property
    def layout(self) -> Layout:
        """Places of the data."""
        return Layout.of(self.task)

    @property
    def slack(self) -> float:
        """Length below which a constraint counts as active."""
        return DEFAULT.active * self.task.size

    @cached_property
    def round(self) -> list[RoundContact] | None:
        """Where true faces touch, see `round_contacts`."""
        return round_contacts(self.task, self.q, self.slack)

    @cached_property
    def end(self) -> MovedScene:
        """Body 1 where the motion ends."""
        return MovedScene.at(self.task, self.layout, self.q)

    def groups(self) -> list[Alternatives]:
        """Return all that may hold the motion: of each group one of the alternatives does."""
        task = self.task
        groups: list[Alternatives] = [[(rate,)] for rate in (*self._limits(), *self._aligned(), *self._goal())]
        if np.isfinite(task.needs).any():
            groups += self._pair_states()
        places = task.path_positions(self.q) if task.coherent else [1.0]  # where a tracked contact must be real
        for s in places if task.tracked else ():
            rho, pose, tracked = task.tracked_contact(self.q, s)
            if np.isfinite(rho).all() and rho.min() > 0:
                groups += self._real(s, rho, pose, tracked)
        return groups

    # ------------------------------------------------------------------------------------------------- limits, goals

    def _limits(self) -> Iterator[Rate]:
        """Yield the limits that are reached; parameters that cannot move push both ways."""
        names, limits = self.task.motion.names, self.task.limits
        for k, side, held in self.limits_reached():
            sign = (1.0, -1.0)[side]
            rate = self.layout.rate(f"limit of {names[k]}", sign * np.eye(len(names))[k], free=held)
            rate.data[self.layout.limits.start + 2 * k + side] = -sign * float(limits[k, side] == self.limits[k, side])
            yield rate

    def limits_reached(self) -> Iterator[tuple[int, int, bool]]:
        """Yield the limits that are reached: of which parameter, 0 for the lower one, and whether both are equal."""
        for k, (low, high) in enumerate(self.task.limits.tolist()):
            for side, limit in enumerate((low, high)):
                if abs(self.q[k] - limit) * self.task.weights[k] <= self.slack and not (side and low == high):
                    yield k, side, low == high

    def _aligned(self) -> Iterator[Rate]:
        """Yield what keeps flush contacts aligned: on the whole way no tilt to first order, else at its end."""
        task = self.task
        turns = [turn for flush in task.seats for turn in flush.turns]
        rows = tilts(task.seats, task.spins)
        if not task.coherent:
            rows = np.array([[m @ rate[:3, :3] @ p for rate in self.end.by_motion] for m, p in turns])
        for row in rows:
            if np.abs(row).max() > DEFAULT.nominal:
                yield self.layout.rate("flush contacts stay aligned", row, free=True)

    def _goal(self) -> Iterator[Rate]:
        """Yield what the goal asks of the tracked contact, or of those that are restored together."""
        task = self.task
        if task.goal != "beyond":
            asked = (*task.tracked, *task.untracked)
            normals, gaps = task.line_gaps(self.q) if asked else (np.empty((0, 3)), np.empty(0))
            rates = [
                self._at_target(self._line(self.end, feature, normal, task.target))
                for feature, normal in zip(asked, normals, strict=True)
            ]
            yield from rates if task.goal != FIT else self._fitted(rates, gaps)
            return
        rho, _, tracked = task.tracked_contact(self.q)
        lines, pair = self._lines(self.end, tracked, rho)
        for k, sign in self.scales_reached(rho):
            rate = replace(self.layout.rate(f"rho_{k + 1} reaches its target"), scales=sign * np.eye(2)[k])
            rate = rate.along(pair, lines)
            rate.data[self.layout.target.start + k] -= sign
            yield rate

    def scales_reached(self, rho: Array) -> list[tuple[int, int]]:
        """Return which scales of a tracked contact have just come beyond the target, and to which side."""
        near = np.abs(rho - self.task.target) <= DEFAULT.active * self.task.target
        return [(k, sign) for k, sign in enumerate(self.task.signs) if near[k]]

    def _fitted(self, rates: Sequence[Rate], gaps: Array) -> Iterator[Rate]:
        """Yield what holds a motion of which the largest gap is least: which contacts are closed, or as far open."""
        rows = fit_rows(gaps, np.array([rate.slope for rate in rates]) / self.task.weights, self.slack)
        for k, other, held in rows:
            rate = rates[k] if other < 0 else rates[other].plus([rates[k]], np.array([-1.0]))
            yield replace(rate, free=held, name=rates[k].name)

    def at_rest(self) -> tuple[Rate, Rate]:
        """Return the rates of both scales of the tracked switching point at rest."""
        scene = MovedScene.at(self.task, self.layout, self.task.rest)
        rho, pose, tracked = self.task.tracked_contact(self.task.rest)
        lines, pair = self._lines(scene, tracked, rho)
        if self._real(0.0, rho, pose, tracked):
            self.reasons.append("three or more contact lines meet at the nominal pair")
        one, two = (replace(self.layout.rate(), scales=unit).along(pair, lines) for unit in np.eye(2))
        return one, two

    def _lines(self, scene: MovedScene, tracked: Iterable[Tracked], rho: Array) -> tuple[list[Rate], Array]:
        """Return the rates of the tracked lines, and how the scale pair on both follows them."""
        lines = [self._line(scene, own, here.normal, rho) for own, here in zip(self.task.tracked, tracked, strict=True)]
        if len(lines) < 2:
            return lines, np.empty((0, 0))
        return lines, -np.asarray(np.linalg.inv([line.scales for line in lines]))

    def _line(self, scene: MovedScene, feature: FeaturePoints, normal: Array, rho: Array) -> Rate:
        """Return the rate of a tracked feature's separation; a flush one is carried by the whole of its elements."""
        task, place = self.task, (feature.site, feature.parts)
        whole = next((flush.feature for flush in task.seats if (flush.site, flush.parts) == place), None)
        if feature in task.tracked and task.flush:
            whole = task.flush[task.tracked.index(feature)]
        joint = next((own for own in task.joints if own.parts == feature.parts), None)
        if joint and joint.feature.is_flush:
            whole = joint.feature
        name = f"contact {joint.feature.label}" if joint else "the tracked contact"
        return self._site(scene, name, feature.parts, feature.site, normal, rho, whole)

    def _at_target(self, rate: Rate) -> Rate:
        """Return the rate where its scale pair is the target pair."""
        rate.data[self.layout.target] += rate.scales
        return replace(rate, free=True)

    # -------------------------------------------------------------------------------------------- terms of a contact

    def _site(
        self, scene: MovedScene, name: str, parts: Parts, site: Site, normal: Array, rho: Array, whole: Any = None
    ) -> Rate:
        """Return the rate of the separation along a site of the contact partner, where it is closed."""
        kind, *places = site
        pair = self.task.movable.parts[parts[0]], self.task.static.parts[parts[1]]
        if kind == kernels.E1E2:
            point = _crossing(*_edges(scene, pair, places, rho))
        else:
            vertex = MOVABLE if kind == kernels.V1F2 else STATIC
            point = scene.placed(vertex, pair[vertex], places[vertex], rho[vertex])
        terms = []
        for body, (part, k, weight) in enumerate(zip(pair, places, (-normal, normal), strict=True)):
            drawn = scene.drawn(body, point, rho[body])
            element = (whole.one, whole.two)[body] if whole else part.element_at(SITE_KINDS[kind][body], k, drawn)
            terms.append(Term(body, drawn, element, weight, float(rho[body]), whole is not None))
        return scene.rate(name, terms)

    def _terms(self, parts: Parts, facing: Facing, corner: Array) -> list[Term]:
        """Return what meets in a corner of a contact of the target pair, or with a keep-out."""
        task, obstacle = self.task, self.task.obstacles[parts[1]]
        place = corner + obstacle.part.seed - task.static.seed - facing.gap * facing.normal  # of body 1's point
        flush = len(facing.corners) > 1
        feature, scale = facing.contact.feature, float(task.target[0])
        first = Term(MOVABLE, self.end.drawn(MOVABLE, place, scale), feature.one, -facing.normal, scale, flush)
        body = KEPT_OUT + obstacle.keep_out if obstacle.keep_out >= 0 else STATIC
        point = obstacle.part.seed + corner / obstacle.scale
        second = Term(body, point, feature.two, facing.normal, obstacle.scale, flush)
        return [first, *(self._swept(second, parts[1]) if body >= KEPT_OUT else [second])]

    def _swept(self, term: Term, place: int) -> list[Term]:
        """Return what carries a point of a keep-out: of one over a range of scales, vertices at both its ends."""
        keep_out, (body, k) = self.task.keep_out[term.body - KEPT_OUT], self.body_of(place)
        own = body.parts[k]
        if own is self.task.obstacles[place].part:
            return [term]
        count = len(own.vertices)
        arms = own.vertices - own.seed
        ends = np.vstack([scale * arms for scale in keep_out.ends]) + own.seed
        rows = np.array(term.element.vertices) - 1
        shares = np.linalg.lstsq((ends[rows[1:]] - ends[rows[0]]).T, term.point - ends[rows[0]])[0]
        flush = term.flush or len(rows) > 3
        return [
            Term(term.body, own.vertices[row % count], own.elements["V"][row % count], share * term.weight,
                 keep_out.ends[row // count], flush)
            for row, share in zip(rows.tolist(), np.append(1.0 - shares.sum(), shares), strict=True)
        ]  # fmt: skip

    def _pose_to(self, parts: Parts) -> Array:
        """Return the pose at the end relative to an obstacle's own seed."""
        offset = self.task.obstacles[parts[1]].part.seed - self.task.static.seed
        return np.append(self.end.pose[:9], self.end.pose[9:] + offset)

    def _placed(self, parts: Parts) -> tuple[ConvexPart, ConvexPart, Array]:
        """Return a part of body 1 and an obstacle's, and their scales, (2,)."""
        obstacle = self.task.obstacles[parts[1]]
        return self.task.movable.parts[parts[0]], obstacle.part, np.array([self.task.target[0], obstacle.scale])

    # ---------------------------------------------------------------------------------------------------- part pairs

    def _pair_states(self) -> list[Alternatives]:
        """Return what keeps pairs apart, and the pair that must touch."""
        task, facings = self.task, self._near_pairs()
        apart = {parts: [self._apart(parts, facing) for facing in found] for parts, found in facings.items()}
        touching = [parts for parts in facings if task.obstacles[parts[1]].keep_out < 0] if self.closes else []
        groups = [own for parts, own in apart.items() if parts not in touching]
        closings: Alternatives = []
        for parts in touching:
            others = [apart[other] for other in touching if other != parts]
            for chosen in product(self._closing(parts, facings[parts]), *others):
                closings.append(tuple(rate for rates in chosen for rate in rates))
        return [*groups, closings] if closings else groups

    @property
    def closes(self) -> bool:
        """Whether a part pair must touch, and it is not said which."""
        return self.task.must_touch and not (self.task.joints or self.task.restored)

    def near_features(self) -> list[tuple[Parts, Feature]]:
        """Return the part pairs that are just as far apart as they must be, each with what of them meets there."""
        # but for those that contacts say all of which are closed
        near = self._near_pairs(every=not self.task.joints or self.task.goal == FIT)
        return [
            (parts, self._of_true_faces(parts, facing) or self._met(parts, facing, DEFAULT.touch).feature)
            for parts, (facing, *_) in near.items()
        ]

    def _of_true_faces(self, parts: Parts, facing: Facing) -> Feature | None:
        """Return the first facets of the true faces that meet, for parts exact at points: a point has no name."""
        # None where it is not told which faces these are
        task, obstacle = self.task, self.task.obstacles[parts[1]]
        if obstacle.keep_out >= 0 or not (task.movable.exact or task.static.exact):
            return None
        found, turn = list[Element](), self.end.pose[:9].reshape(3, 3)
        terms, normals = self._terms(parts, facing, facing.corners[0]), (facing.normal @ turn, -facing.normal)
        for body, term, normal in zip((task.movable, task.static), terms, normals, strict=True):
            faces = true_faces(body.of_facets)
            own = {k: float(faces.patches[k].gaps(term.point[None])[1][0] @ normal) for k in faces.at(term.point)}
            if not own or max(own.values()) <= np.cos(BENT):
                return None
            found.append(faces.face_of(max(own, key=lambda k: own[k])))
        return Feature(*found)

    def _near_pairs(self, *, every: bool = False) -> dict[Parts, list[Facing]]:
        """Return the directions in which part pairs are just as far apart as they must be; `every`: of joints too."""
        facings = {parts: self._facings(parts, every=every) for parts in self.pairs_reached(every=every)}
        known = dict[Any, tuple[Parts, list[Facing]]]()  # on a seam of a face pairs meet by the same elements
        for parts, found in self._on_round_faces({parts: found for parts, found in facings.items() if found}).items():
            own = frozenset((each.contact.feature, *(np.round(each.normal, DECIMALS) + 0.0).tolist()) for each in found)
            known.setdefault((self.task.obstacles[parts[1]].keep_out, own), (parts, found))
        return dict(known.values())

    def pairs_reached(self, *, every: bool = False) -> list[Parts]:
        """Return the part pairs that are no farther apart than they must be; `every`: of joints too."""
        near = self.task.pair_gaps(self.q) - self.task.needs <= self.slack
        return [(i, j) for i, j in np.argwhere(near if every else self.task.without_joints(near)).tolist()]

    def facets_reached(self, parts: Parts, *, every: bool = False) -> tuple[Ints, Array, float]:
        """Return the sites and normals, (m, 3), of the facets along which a pair is farthest apart, and how far.

        No facets where only cuts of the solids meet, which touch elsewhere or not at all; nor, but for `every`, where a
        contact is closed in any case.
        """
        task, obstacle, (body, _) = self.task, self.task.obstacles[parts[1]], self.body_of(parts[1])
        sites, rows, separations = task.separations(parts, self.end.pose)
        widest = float(separations.max())
        # the widest first: along another one faces that are parallel but for their digits meet far aside of themselves
        tight = np.argsort(-separations, kind="stable")[: int((separations >= widest - self.slack).sum())].tolist()
        pair = (task.movable, task.movable.parts[parts[0]]), (body, obstacle.part)
        own = [k for k in tight if is_own(*pair, sites[k])]
        cut = not own and (widest <= self.slack or obstacle.need <= 0.0)
        closed = not every and obstacle.keep_out < 0 and any(is_closed(task, parts, sites[k]) for k in own)
        found = [] if cut or closed else own or tight
        return sites[found], rows[found, :3], widest

    def body_of(self, place: int) -> tuple[Body, int]:
        """Return the body that an obstacle is a part of, the static one or a keep-out, and its number there."""
        keep_out = self.task.obstacles[place].keep_out
        if keep_out < 0:
            return self.task.static, place
        first = next(k for k, own in enumerate(self.task.obstacles) if own.keep_out == keep_out)
        return self.task.keep_out[keep_out].body, place - first

    def is_round(self, contact: RoundContact, parts: Parts, normals: Array) -> bool:
        """Tell whether a part pair that meets in directions, (n, 3), does so in a contact of true faces."""
        sites, _, separations = self.task.separations(parts, self.end.pose)
        sites = sites[separations >= separations.max() - self.slack]
        return self.task.obstacles[parts[1]].keep_out < 0 and contact.is_of(self.task, parts, sites, normals)

    def _on_round_faces(self, pairs: dict[Parts, list[Facing]]) -> dict[Parts, list[Facing]]:
        """Return the part pairs, of those that meet in one contact of true faces only the one that does so best."""
        for contact in self.round or ():
            own = {
                parts: max(found, key=lambda facing: float(facing.normal @ contact.frame[2]))
                for parts, found in pairs.items()
                if self.is_round(contact, parts, np.array([facing.normal for facing in found]))
            }
            if own:
                best = min(own, key=lambda parts: (abs(own[parts].gap), -float(own[parts].normal @ contact.frame[2])))
                ends = np.array([end.points[1] for end in self.round or () if end.patches is contact.patches])
                corners = self.task.target[1] * (ends - self.task.static.seed)
                facing = own[best]._replace(normal=contact.frame[2], corners=corners)
                pairs = {parts: found for parts, found in pairs.items() if parts not in own} | {best: [facing]}
        return pairs

    def _met(self, parts: Parts, facing: Facing, slack: float) -> Contact:
        """Return what of a part pair meets where it is just as far apart as it must be, to within `slack`."""
        obstacle, pose = self.task.obstacles[parts[1]], self._pose_to(parts)
        one, two, rho = self._placed(parts)
        if obstacle.need > self.slack:  # nothing touches: what is nearest would, moved along the normal
            pose = np.append(pose[:9], pose[9:] - facing.gap * facing.normal)
            return located(one, two, pose, supporting_contact(one, two, facing.normal, pose, slack), rho)
        return located(one, two, pose, contact_at(one, two, facing.normal, pose, rho, slack), rho)

    def _facings(self, parts: Parts, *, every: bool) -> list[Facing]:
        """Return the directions in which a part pair is just as far apart as it must be."""
        task, obstacle = self.task, self.task.obstacles[parts[1]]
        (one, two, rho), pose = self._placed(parts), self._pose_to(parts)
        sites, directions, widest = self.facets_reached(parts, every=every)
        if not len(sites):
            return []
        if obstacle.need > 0 and widest > 0:
            normals = [task.direction_between(parts, self.q)]
            normals[0] /= np.linalg.norm(normals[0])
            gap = kernels.separation(*one.packed, *two.packed, pose, rho, normals[0])
        else:
            normals, gap = [*directions[distinct(directions)]], widest
        if abs(gap - max(obstacle.need, 0.0)) > self.slack:
            return []
        facings = []
        for normal in normals:
            shifted = np.append(pose[:9], pose[9:] - gap * normal)
            contact = located(one, two, shifted, supporting_contact(one, two, normal, shifted, DEFAULT.active), rho)
            facings.append(Facing(normal, contact, contact_set(one, two, shifted, contact, rho)[:MOST_CORNERS], gap))
        return facings

    def _apart(self, parts: Parts, facing: Facing) -> Constraints:
        """Return what keeps a pair apart in a direction: in every corner of what it shares there."""
        task, keep_out = self.task, self.task.obstacles[parts[1]].keep_out
        rates = [
            self.end.rate(f"{task.named(parts)} stays apart", self._terms(parts, facing, corner))
            for corner in facing.corners
        ]
        for rate in rates:
            rate.data[self.layout.target] += rate.scales * [1.0, keep_out < 0]
            rate.data[self.layout.clearances][keep_out + 1] -= float(keep_out >= 0 or not task.must_touch)
        return tuple(replace(rate, scales=np.zeros(2), free=task.restored and keep_out < 0) for rate in rates)

    def _closing(self, parts: Parts, facings: list[Facing]) -> Alternatives:
        """Return what brings a pair together: in one corner of what it shares, in no direction apart."""
        name = f"{self.task.named(parts)} closes"
        if len(facings) == 1:
            apart = self._apart(parts, facings[0])
            if len(apart) == 1:
                return [(replace(apart[0], name=name, free=True),)]
            return [apart, *((replace(rate.times(-1.0), name=name),) for rate in apart)]
        (one, two, rho), pose = self._placed(parts), self._pose_to(parts)
        contact = self._met(parts, facings[0], DEFAULT.active)
        corners = contact_set(one, two, pose, contact, rho)[:MOST_CORNERS]
        spread = np.zeros(self.layout.size, dtype=bool)
        if len(corners) > 1:  # elements share more than a point: moving a vertex would part them
            for body, element in ((MOVABLE, contact.feature.one), (STATIC, contact.feature.two)):
                spread[self.layout.vertices(body)].reshape(-1, 3)[np.array(element.vertices) - 1] = True
        closings: Alternatives = []
        for corner in corners:
            single = [self._apart(parts, Facing(each.normal, contact, corner[None], each.gap))[0] for each in facings]
            rates = (rate.times(-1.0) for rate in single)
            closings.append(tuple(replace(rate, name=name, broken=rate.broken | spread) for rate in rates))
        return [*closings, *(self._apart(parts, facing) for facing in facings)]

    # ----------------------------------------------------------------------------------------------------- coherence

    def _real(self, s: float, rho: Array, pose: Array, tracked: tuple[Tracked, ...]) -> list[Alternatives]:
        """Return what keeps the tracked contact real at one point of the way and may be active there."""
        task, slack = self.task, self.slack
        found: list[tuple[Parts, list[tuple[Site, Array]], float]] = []
        own = {feature.parts for feature in tracked}
        for parts, sites, rows, separations in near_pairs(task.movable, task.static, pose, rho, slack, own):
            normals = [feature.normal for feature in tracked if feature.parts == parts]
            tight = [
                (tuple(sites[k].tolist()), rows[k, :3])
                for k in np.flatnonzero(np.abs(separations) <= slack)
                if not any(rows[k, :3] @ n > 1.0 - DEFAULT.nominal for n in normals)
            ]
            if parts in own:
                found += [(parts, [one], -1.0) for one in tight]
            elif abs(separations.max()) <= slack and tight:
                found.append((parts, tight, 1.0))
        level = [
            (own_feature, here, body, vertex)
            for k, (own_feature, here) in enumerate(zip(task.tracked, tracked, strict=True))
            if not (task.flush and task.flush[k]) and not task.seats
            for body, vertex in self._level(here, pose, rho)
        ]
        if not found and not level:
            return []
        if len(tracked) == 1 and s < 1.0:
            self.reasons.append("the way of the tracked contact inside its segment may hold the motion")
            return []
        scene = self.end if s == 1.0 else MovedScene.at(task, self.layout, self.q, s)
        lines, pair = self._lines(scene, tracked, rho)

        def along_motion(rate: Rate) -> Rate:
            return rate.along(pair, lines) if len(lines) == 2 else replace(self._at_target(rate), free=False)

        groups: list[Alternatives] = []
        for parts, tight, side in found:
            name = f"{task.named(parts)} stays {'apart' if side > 0 else 'in contact'} on the way"
            rates = (self._site(scene, name, parts, site, normal, rho).times(side) for site, normal in tight)
            groups.append([(along_motion(rate),) for rate in rates])
        for feature, here, body, vertex in level:
            groups.append([(along_motion(self._behind(scene, feature, here, body, vertex, rho)),)])
        return groups

    def _level(self, here: Tracked, pose: Array, rho: Array) -> Iterator[tuple[int, int]]:
        """Yield (body, vertex) for vertices that are level with a tracked feature and no corners of its elements."""
        bodies = self.task.movable, self.task.static
        known = site_corners(bodies[0].parts[here.parts[0]], bodies[1].parts[here.parts[1]], here.site)
        for body, heights in enumerate(heights_beyond(*bodies, pose, rho, here)):
            for vertex in np.flatnonzero(np.abs(heights) <= self.slack).tolist():
                if vertex not in known[body]:
                    yield body, vertex

    def _behind(
        self, scene: MovedScene, feature: FeaturePoints, here: Tracked, body: int, vertex: int, rho: Array
    ) -> Rate:
        """Return how far a vertex that is level with a tracked feature lies behind its plane.

        Of a face as the separation of that vertex from it. In the plane of two edges p + alpha u + beta w is the
        vertex, u and w along the edges; so its height over what they carry is that over p + alpha u, and beta w.
        """
        name = f"a vertex of body {body + 1} stays behind the tracked feature"
        kind, i, j = feature.site
        if kind != kernels.E1E2:
            site = (kind, i, vertex) if body == STATIC else (kind, vertex, j)
            return self._site(scene, name, feature.parts, site, here.normal, rho)
        pair = self.task.movable.parts[feature.parts[0]], self.task.static.parts[feature.parts[1]]
        edges = _edges(scene, pair, (i, j), rho)
        point, directions = _crossing(*edges), [edge[1] - edge[0] for edge in edges]
        place, other = scene.placed(body, pair[body], vertex, rho[body]), 1 - body
        shares = np.linalg.lstsq(np.column_stack(directions), place - point)[0]
        elements = [part.element_at("E", (i, j)[k], scene.drawn(k, point, rho[k])) for k, part in enumerate(pair)]
        side = 1.0 if body == MOVABLE else -1.0  # the plane's points less the vertex, or the other way about
        terms = [
            Term(k, scene.drawn(k, where, rho[k]), element, factor * here.normal, float(rho[k]))
            for k, where, factor, element in (
                (body, place, -side, pair[body].elements["V"][vertex]),
                (body, point + shares[body] * directions[body], side, elements[body]),
                (other, edges[other][1], side * shares[other], elements[other]),
                (other, edges[other][0], -side * shares[other], elements[other]),
            )
        ]
        return scene.rate(name, terms)


def is_closed(task: Task, parts: tuple[int, int], site: Ints) -> bool:
    """Tell whether a facet of a pair's Minkowski difference is on a face of a contact that is restored."""
    own = feature_of_site(task.movable.parts[parts[0]], task.static.parts[parts[1]], site.tolist())
    return any(is_within(own, joint.feature) for joint in task.joints)


def fit_rows(gaps: Array, slopes: Array, slack: float) -> list[tuple[int, int, bool]]:
    """Return what holds a motion of which the largest of some gaps >= 0, (n,), with derivatives, (n, k), is least.

    As (gap, other, held). `held`: that the gap stays 0 (other -1), or as large as another one, whatever the motion:
    some multipliers of the least largest gap need it. Else it may grow, or fall below the other. `slack` is the length
    to which gaps are closed, or the largest.
    """
    from scipy.optimize import linprog

    most, closed = float(gaps.max()), np.flatnonzero(gaps <= slack)
    if most <= slack:
        return [(k, -1, True) for k in closed.tolist()]
    widest = np.flatnonzero(gaps >= most - slack)
    columns = np.vstack([slopes[widest], -slopes[closed]]).T
    count = columns.shape[1]
    each = np.eye(count)
    found = linprog(  # multipliers, and how much of each up to 1: as many as can be are not 0 together
        np.append(np.zeros(count), -np.ones(count)),
        A_ub=np.hstack([-each, each]), b_ub=np.zeros(count), A_eq=np.hstack([columns, 0.0 * columns]),
        b_eq=np.zeros(len(columns)), bounds=[*[(0.0, None)] * count, *[(0.0, 1.0)] * count],
    )  # fmt: skip
    held = found.x[count:] > 0.5 if found.status == 0 else np.zeros(count, np.bool_)
    first = widest[int(held[: len(widest)].argmax())]
    rows = [(k, int(first), bool(own)) for k, own in zip(widest.tolist(), held, strict=False) if k != first]
    return rows + [(k, -1, bool(own)) for k, own in zip(closed.tolist(), held[len(widest) :], strict=True)]


def _edges(scene: MovedScene, pair: Sequence[ConvexPart], edges: Sequence[int], rho: Array) -> list[Array]:
    """Return the ends of two edges as scaled, relative to s_2, (2, 3) each."""
    ends = (part.edges[k, :2] for part, k in zip(pair, edges, strict=True))
    return [scene.placed(body, pair[body], end, rho[body]) for body, end in enumerate(ends)]


def _crossing(first: Array, second: Array) -> Array:
    """Return where the lines of two edges meet."""
    u, w = first[1] - first[0], second[1] - second[0]
    shares = np.linalg.lstsq(np.column_stack([u, -w]), second[0] - first[0])[0]
    return np.asarray(first[0] + shares[0] * u)
