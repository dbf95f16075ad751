"""Contacts as drawn of round parts, as balls on faces: exact equations for motions that turn.

A sphere touches a face where its centre is a radius from it; a cylinder or cone touches a plane along a line where the
balls that it holds at both ends of the line do; the corners of plane faces are balls of no radius. A ball in a conical
hole, or in a socket of its own radius, has its centre in a given point: in three planes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.true_sizes import TrueContact, ends_of_line
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.measures import cross, norms
from fcdm_opt.geometry.naming import rows_at
from fcdm_opt.geometry.patches import Patch, true_faces
from fcdm_opt.geometry.tessellation import Swept
from fcdm_opt.tolerances import DEFAULT


class BallOnFace(NamedTuple):
    """A ball of one body and a face of the other, which touch where the contact is closed."""

    holder: int  # 0 where the face is of the movable body, 1 where it is of the static one
    centre: Array  # of the ball, of its body as made, where it was drawn, (3,)
    radius: float
    face: Patch  # of its body as made, where it was drawn
    feature: Feature  # the elements of the bodies that meet there, faces of facets for round ones

    @property
    def plane(self) -> tuple[Array, Array] | None:
        """A point of the plane in which the centre is, and its unit normal towards the ball; None for round faces."""
        surface = self.face.surface
        normal = self.face.side * surface.axis
        return (surface.origin + self.radius * normal, normal) if surface.flat else None

    @property
    def about(self) -> tuple[Array, Array, float] | None:
        """A point and the unit direction of a cylinder's axis, how far from it the centre is; None for other faces.

        Of a sphere its centre, and no direction, (0, 0, 0).
        """
        surface = self.face.surface
        if surface.ring or (surface.line is not None and surface.line[1]):
            return None
        along = surface.axis if surface.line is not None else np.zeros(3)
        return surface.origin, along, float(surface.radius + self.face.side * self.radius)

    def gap(self, pose: Array, rates: Array) -> tuple[float, Array]:
        """Return its gap after a motion of the movable body, and the derivatives of that, (k,)."""
        # `pose`, (4, 4), and its derivatives, (k, 4, 4)
        turn, shift = pose[:3, :3], pose[:3, 3]
        there = turn @ self.centre + shift if self.holder else (self.centre - shift) @ turn
        (off,), (normal,) = self.face.gaps(there[None])
        if self.holder:
            slopes = (rates[:, :3, :3] @ self.centre + rates[:, :3, 3]) @ normal
        else:
            slopes = rates[:, :3, :3] @ normal @ (self.centre - shift) - rates[:, :3, 3] @ (turn @ normal)
        return float(off - self.radius), np.asarray(slopes)


def balls_of(
    contact: TrueContact, drawn: Sequence[Body], made: Sequence[Body], nominal: Array, scales: Array
) -> list[BallOnFace]:
    """Return the balls and faces of a contact of true faces as drawn, of two bodies as made; none where it has none.

    Scales of both bodies as drawn, at which they touch, and as made, (2,).
    """
    faces, normals = [true_faces(body) for body in drawn], (contact.normal, -contact.normal)
    for pair in sorted(contact.pairs):
        before = [own.patches[k] for own, k in zip(faces, pair, strict=True)]
        met = zip(before, contact.points, normals, strict=True)
        if min(own.gaps(x[None])[1][0] @ n for own, x, n in met) < 1.0 - DEFAULT.nominal:  # at an edge of one of them
            continue
        feature = Feature(*(own.face_of(k) for own, k in zip(faces, pair, strict=True)))
        after = [_patch_made(body, k, scale) for body, k, scale in zip(made, pair, scales.tolist(), strict=True)]
        for k in (0, 1):
            ball, other = after[k], after[1 - k]
            if ball.surface.flat or ball.surface.ring or ball.side < 0.0:
                continue
            if other.surface.flat:
                ends = ends_of_line(contact, faces, nominal, np.eye(4))[:, k]
                along = scales[k] * ((ends - before[k].surface.origin) @ before[k].surface.axis)
                return [*_on_plane(1 - k, ball.surface, other, along, feature)]
            if ball.surface.line is None:
                fits = _alike(before[k].surface, before[1 - k])
                return [*_of_sphere(1 - k, ball.surface, other, fits, feature)]
    return []


def corners_on_plane(feature: Feature, made: Sequence[Body], scales: Array) -> list[BallOnFace]:
    """Return the same of plane faces that touch corners, edges or each other: three corners of a face are enough."""
    placed = [body.placed_vertices(x, np.eye(4)) for body, x in zip(made, scales.tolist(), strict=True)]
    holder = int(feature.two.kind == "F")
    face, other = ((feature.one, feature.two)[k] for k in (holder, 1 - holder))
    normal, place = made[holder].face_planes[0][rows_at(made[holder], face)[0]], placed[holder][face.vertices[0] - 1]
    points = placed[1 - holder][np.array(other.vertices) - 1]
    one = norms(points - points[0]).argmax()
    two = norms(cross(points - points[0], points[one] - points[0])).argmax()
    kept = points[sorted({0, int(one), int(two)})]
    plane = Patch(Swept.plane(place, normal), 1.0)
    return [BallOnFace(holder, point, 0.0, plane, feature) for point in kept]


def _patch_made(body: Body, k: int, scale: float) -> Patch:
    """Return a true face of a body as made where it was drawn."""
    patch = true_faces(body).patches[k]
    own = patch.surface
    origin = body.seed + scale * (own.origin - body.seed)
    return patch._replace(surface=own._replace(origin=origin, radius=scale * own.radius, ring=scale * own.ring))


def _on_plane(holder: int, ball: Swept, plane: Patch, along: Array, feature: Feature) -> Iterator[BallOnFace]:
    """Yield a sphere, or balls of a cylinder or cone that touch at both ends of a line, as far along its axis."""
    if ball.line is None:
        yield BallOnFace(holder, ball.origin, float(ball.radius), plane, feature)
    elif len(along) > 1:
        steep, slope = ball.line
        for z in along.tolist():
            radius = (slope * z + ball.radius) / steep**2
            yield BallOnFace(holder, ball.origin + (z + slope * radius) * ball.axis, float(radius), plane, feature)


def _alike(ball: Swept, other: Patch) -> bool:
    """Tell whether a ball touches a hollow face all over or along a circle: one of its radius, or a conical one."""
    surface, cone = other.surface, other.surface.line is not None and other.surface.line[1] != 0.0
    return other.concave and (cone or bool(abs(surface.radius - ball.radius) <= DEFAULT.tie * ball.radius))


def _of_sphere(holder: int, ball: Swept, other: Patch, fits: bool, feature: Feature) -> Iterator[BallOnFace]:
    """Yield a sphere on a round face, or where it `fits` that the three planes its centre is in, if it still does."""
    surface, place = other.surface, other.surface.origin
    if not fits:
        yield BallOnFace(holder, ball.origin, float(ball.radius), other, feature)
    elif _alike(ball, other) and not (surface.line and not surface.line[1]):  # no ball in a bore of its radius
        if surface.line is not None:
            place = place + (ball.radius - surface.radius) / surface.line[1] * surface.axis
        for normal in np.eye(3):
            yield BallOnFace(holder, ball.origin, 0.0, Patch(Swept.plane(place, normal), 1.0), feature)
