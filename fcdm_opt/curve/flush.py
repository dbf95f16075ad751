"""Flush contacts: faces and edges that lie on one another, what keeps them aligned, and what they share."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import (
    Contact,
    contact_at,
    contact_set,
    covers,
    dimension,
    distinct,
    located,
    placed_elements,
    supporting_contact,
    touching_pairs,
)
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.tolerances import DEFAULT

Carrier = tuple[ConvexPart, ConvexPart, Contact]


class Overlap(NamedTuple):
    """How far elements reach over one another along a direction in their plane: what they share ends at zero."""

    depth: float
    direction: Array
    one: Array  # the foremost vertex of body 1, as drawn
    two: Array  # the hindmost of body 2, as scaled and relative to its seed


@dataclass(frozen=True, eq=False)
class Flush:
    """A face of one body that lies in one plane with a face or edge of the other, as drawn.

    Two parallel edges on one another lie so in two planes: they are two of these.
    """

    feature: Feature  # the bodies' elements in the plane
    touching: Feature  # the elements that touch: the same, or the parallel edges in which two such planes meet
    parts: tuple[int, int]  # a part pair that touches so, 0-based
    contact: Contact  # its own elements in the plane
    normal: Array  # (3,): unit direction from body 1 to body 2, world frame
    dimension: int  # of what the bodies share: 1 a segment, 2 a region of the plane
    least: float  # length that what they share must exceed to count as more than a point, or than a segment
    # wherever the bodies' parts have the elements that touch: a face may be spread over several
    carriers: tuple[Carrier, ...]
    _pair: tuple[ConvexPart, ConvexPart]

    @property
    def site(self) -> tuple[int, int, int]:
        """A facet of the Minkowski difference in the plane, of a face of body 2 where there is one."""
        one, two = self._pair
        if len(self.contact.two) > 2:
            return kernels.V1F2, self.contact.one[0], two.loops.index(self.contact.two)
        return kernels.F1V2, one.loops.index(self.contact.one), self.contact.two[0]

    @cached_property
    def turns(self) -> tuple[tuple[Array, Array], ...]:
        """Unit directions (m, p), p carried by body 1: turned by R the elements are parallel iff every m . R p = 0."""
        # an edge on a face: n . e = 0. Face on face: n_1 = -n_2, in two components
        one, two = self._pair
        if len(self.contact.one) == 2:
            return ((self.normal, _direction(one, self.contact.one)),)
        along = _direction(two, self.contact.two)
        if len(self.contact.two) == 2:
            return ((along, self.normal),)
        return ((along, self.normal), (frozen(np.cross(self.normal, along)), self.normal))

    @property
    def whole(self) -> bool:
        """Whether a face lies on a face: aligned, body 1 can only slide, and turn about the normal."""
        return len(self.turns) == 2

    def gap(self, rho: Array) -> float:
        """Return the distance of the two elements along the normal at a scale pair, as drawn: > 0 apart."""
        one, two = self._pair
        x = one.seed + rho[0] * (one.vertices[list(self.contact.one)] - one.seed)
        y = two.seed + rho[1] * (two.vertices[list(self.contact.two)] - two.seed)
        return float((y.mean(axis=0) - x.mean(axis=0)) @ self.normal)

    def carried_by(self, movable: Body, static: Body) -> Flush:
        """Return the contact with all part pairs of the bodies that have the elements which touch."""
        return replace(self, carriers=tuple(_carriers(movable, static, self.carriers[0][2])) or self.carriers)

    def misfit(self, pose: Array, rho: Array) -> float:
        """Return how far the elements' vertices are from one plane, a length: 0 where they are flush."""
        # at a pose, (12,), R, row by row, and d, of body 1 from where it is drawn, see `kernels`, and scales, (2,)
        one, two = self._pair
        return float(np.ptp(np.concatenate(placed_elements(one, two, pose, self.contact, rho)) @ self._normal_at(pose)))

    def shared(self, pose: Array, rho: Array) -> list[Array]:
        """Return the corners of what each host's elements share, (k, 3), relative to the seed of body 2."""
        return [contact_set(one, two, pose, contact, rho) for one, two, contact in self.carriers]

    def overlap(self, pose: Array, rho: Array) -> Overlap:
        """Return the direction in which the elements reach over one another least, in the host where they do most."""
        n, found = self._normal_at(pose), []
        for one, two, contact in self.carriers:
            X, Y = placed_elements(one, two, pose, contact, rho)
            axes = np.vstack([outward_directions(X, n, contact.parallel), -outward_directions(Y, n, contact.parallel)])
            i, j = (X @ axes.T).argmax(axis=0), (Y @ axes.T).argmin(axis=0)
            depths = ((X[i] - Y[j]) * axes).sum(axis=1)
            k = int(depths.argmin())
            found.append(Overlap(float(depths[k]), axes[k], one.vertices[contact.one[i[k]]], Y[j[k]]))
        return max(found, key=lambda overlap: overlap.depth)

    def holds(self, pose: Array, rho: Array, slack: float) -> bool:
        """Tell whether the elements are flush to within a length, and share a segment or region as when drawn."""
        return self.misfit(pose, rho) <= slack and any(
            dimension(points, self.least) >= self.dimension for points in self.shared(pose, rho)
        )

    def holds_between(self, start: tuple[Array, Array], end: tuple[Array, Array]) -> bool:
        """Tell whether one host shares at two (pose, scale pair) what the elements shared when drawn."""
        # if they differ by a shift, and in proportion on the way, it does between them
        both = zip(self.shared(*start), self.shared(*end), strict=True)
        return any(all(dimension(own, self.least) >= self.dimension for own in pair) for pair in both)

    def _normal_at(self, pose: Array) -> Array:
        """Return the plane's normal: that of body 2's face if it has one in the plane, else it turns with body 1."""
        turned: Array = pose[:9].reshape(3, 3) @ self.normal
        return self.normal if len(self.contact.two) > 2 else turned


def flush_contacts(movable: Body, static: Body, rho: Array) -> tuple[Flush, ...]:
    """Return the flush contacts of two bodies as drawn at a scale pair on their curve, once per pair of elements."""
    # seams between parts count for nothing: they are no faces of the bodies. Edges on the border of a larger contact
    # are no contact of their own
    pose = kernels.relative_pose(np.eye(4), movable.seed, static.seed)
    least = DEFAULT.shared * min(movable.size, static.size)
    radii = [np.linalg.norm(body.vertices - body.seed, axis=1).max() for body in (movable, static)]
    slack = DEFAULT.nominal * float(np.linalg.norm(pose[9:]) + rho @ radii)
    found: dict[Feature, Flush] = {}
    for (i, j), _, rows, separations in touching_pairs(movable, static, pose, rho, slack):
        one, two, tight = movable.parts[i], static.parts[j], rows[separations >= -slack, :3]
        touching = contact_at(one, two, rows[separations.argmax(), :3], pose, rho)
        touching = located(one, two, pose, touching, rho)
        size = dimension(contact_set(one, two, pose, touching, rho), least)
        carriers: tuple[Carrier, ...] = ()
        for normal in tight[distinct(tight)] if size else ():
            contact = supporting_contact(one, two, normal, pose)
            contact = located(one, two, pose, contact, rho)
            feature = contact.feature
            known = found.get(feature)
            if not _is_plane(movable, static, feature, touching.feature) or (known and known.dimension >= size):
                continue
            carriers = carriers or tuple(_carriers(movable, static, touching))
            found[feature] = Flush(
                feature, touching.feature, (i, j), contact, frozen(normal), size, least, carriers, (one, two)
            )
    shared = {flush.feature: flush.shared(pose, rho) for flush in found.values()}
    return tuple(
        flush
        for flush in found.values()
        if not any(
            other.touching.kind.count("F") > flush.touching.kind.count("F")
            and covers(shared[other.feature], shared[flush.feature], slack)
            for other in found.values()
        )
    )


def outward_directions(element: Array, normal: Array, along: bool) -> Array:
    """Return unit directions in a plane: out of a face across its sides, off an edge to either side, or along it."""
    sides = np.roll(element, -1, axis=0) - element
    directions = sides if along else np.cross(sides, normal)
    if len(element) > 2:
        directions = directions * np.sign(((element - element.mean(axis=0)) * directions).sum(axis=1, keepdims=True))
    return np.asarray(directions / np.linalg.norm(directions, axis=1)[:, None])


def _is_plane(movable: Body, static: Body, feature: Feature, touching: Feature) -> bool:
    """Tell whether true faces lie in a plane of a contact: its own, or one of those that meet in parallel edges."""
    if not feature.is_flush or (feature != touching and touching.kind != "E1E2"):
        return False
    sides = ((movable, feature.one), (static, feature.two))
    return all(element.kind != "F" or tuple(sorted(element.vertices)) in body.faces for body, element in sides)


def _carriers(movable: Body, static: Body, touching: Contact) -> Iterator[Carrier]:
    """Yield the part pairs that have the elements of a contact, with their own vertices of them."""
    feature = touching.feature
    places = [
        [(part, own) for part in body.parts for own in part.carriers(element)]
        for body, element in ((movable, feature.one), (static, feature.two))
    ]
    for one, first in places[0]:
        for two, second in places[1]:
            yield one, two, Contact(feature, first, second, touching.parallel)


def _direction(part: ConvexPart, vertices: tuple[int, ...]) -> Array:
    """Return the unit direction of an edge, or of the longest side of a face."""
    corners = part.vertices[list(vertices)]
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(sides, axis=1)
    return frozen(sides[lengths.argmax()] / lengths.max())
