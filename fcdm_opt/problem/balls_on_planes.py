"""Contacts as drawn of round parts, as balls on planes: exact equations for motions that turn.

A sphere touches a plane face where its centre is a radius from it, a cylinder or cone along a line where the balls that
it holds at both ends of the line do, and the corners of plane faces are balls of no radius. A ball in a conical hole,
or in a socket of its own radius, has its centre in a given point: in three planes.
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


class BallOnPlane(NamedTuple):
    """A ball of one body and a plane of the other, which touch where the contact is closed.

    Attributes
    ----------
    holder : int
        0 where the plane is of the movable body, 1 where it is of the static one.
    centre : (3,) array
        Of the ball, of its body as made, where it was drawn.
    radius : float
    place, normal : (3,) array
        A point of the plane, of its body as made, and its unit normal towards the ball.
    """

    holder: int
    centre: Array
    radius: float
    place: Array
    normal: Array

    def gap(self, pose: Array, rates: Array) -> tuple[float, Array]:
        """Return its gap after a motion of the movable body, and the derivatives of that, (k,).

        `pose`, (4, 4), and its derivatives, (k, 4, 4).
        """
        turn, shift = pose[:3, :3], pose[:3, 3]
        moving = np.append(self.place if self.holder == 0 else self.centre, 1.0)
        if self.holder:
            gap = self.normal @ (turn @ self.centre + shift - self.place) - self.radius
            return float(gap), np.asarray(rates[:, :3] @ moving @ self.normal)
        off = self.centre - (turn @ self.place + shift)
        slopes = rates[:, :3, :3] @ self.normal @ off - rates[:, :3] @ moving @ (turn @ self.normal)
        return float(turn @ self.normal @ off - self.radius), np.asarray(slopes)


def balls_of(
    contact: TrueContact, drawn: Sequence[Body], made: Sequence[Body], nominal: Array, scales: Array
) -> list[BallOnPlane]:
    """Return the balls and planes of a contact of true faces as drawn, of two bodies as made; none where it has none.

    Scales of both bodies as drawn, at which they touch, and as made, (2,).
    """
    faces, normals = [true_faces(body) for body in drawn], (contact.normal, -contact.normal)
    for pair in sorted(contact.pairs):
        before = [own.patches[k] for own, k in zip(faces, pair, strict=True)]
        met = zip(before, contact.points, normals, strict=True)
        if min(own.gaps(x[None])[1][0] @ n for own, x, n in met) < 1.0 - DEFAULT.nominal:  # at an edge of one of them
            continue
        after = [_as_made(body, k, scale) for body, k, scale in zip(made, pair, scales.tolist(), strict=True)]
        for k in (0, 1):
            ball, other = after[k], after[1 - k]
            if ball.surface.flat or ball.surface.ring or ball.side < 0.0:
                continue
            if other.surface.flat:
                ends = ends_of_line(contact, faces, nominal, np.eye(4))[:, k]
                along = scales[k] * ((ends - before[k].surface.origin) @ before[k].surface.axis)
                return [*_on_plane(1 - k, ball.surface, other, along)]
            if ball.surface.line is None and other.concave:
                return [*_in_hollow(1 - k, ball.surface, other.surface)]
    return []


def corners_on_plane(feature: Feature, made: Sequence[Body], scales: Array) -> list[BallOnPlane]:
    """Return the same of plane faces that touch corners, edges or each other: three corners of a face are enough."""
    placed = [body.placed_vertices(x, np.eye(4)) for body, x in zip(made, scales.tolist(), strict=True)]
    holder = int(feature.two.kind == "F")
    face, other = ((feature.one, feature.two)[k] for k in (holder, 1 - holder))
    normal, place = made[holder].face_planes[0][rows_at(made[holder], face)[0]], placed[holder][face.vertices[0] - 1]
    points = placed[1 - holder][np.array(other.vertices) - 1]
    one = norms(points - points[0]).argmax()
    two = norms(cross(points - points[0], points[one] - points[0])).argmax()
    kept = points[sorted({0, int(one), int(two)})]
    return [BallOnPlane(holder, point, 0.0, place, normal) for point in kept]


def _as_made(body: Body, k: int, scale: float) -> Patch:
    """Return a true face of a body as made where it was drawn."""
    patch = true_faces(body).patches[k]
    own = patch.surface
    origin = body.seed + scale * (own.origin - body.seed)
    return patch._replace(surface=own._replace(origin=origin, radius=scale * own.radius, ring=scale * own.ring))


def _on_plane(holder: int, ball: Swept, plane: Patch, along: Array) -> Iterator[BallOnPlane]:
    """Yield a sphere, or balls of a cylinder or cone that touch at both ends of a line, as far along its axis."""
    steep, slope = ball.line or (1.0, 0.0)
    if ball.line is not None and len(along) < 2:
        return
    for z in along.tolist() if ball.line else [0.0]:
        radius = (slope * z + ball.radius) / steep**2
        centre = ball.origin + (z + slope * radius) * ball.axis if ball.line else ball.origin
        yield BallOnPlane(holder, centre, radius, plane.surface.origin, plane.side * plane.surface.axis)


def _in_hollow(holder: int, ball: Swept, hollow: Swept) -> Iterator[BallOnPlane]:
    """Yield three planes through the centre of a ball in a conical hole, or in a socket of its radius."""
    place = hollow.origin
    if hollow.line is None:
        if abs(hollow.radius - ball.radius) > DEFAULT.tie * ball.radius:
            return
    elif hollow.line[1]:
        place = place + (ball.radius - hollow.radius) / hollow.line[1] * hollow.axis
    else:
        return
    for normal in np.eye(3):
        yield BallOnPlane(holder, ball.origin, 0.0, place, normal)
