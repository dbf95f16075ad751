"""Where true faces touch after a motion: each contact once, with the normal and the bends that both have there.

Parts that are exact at points of round faces touch at many of these at once, along a line of contact or a little beside
each other, in as many directions. Of the true faces it is one contact, of which the gap changes as that of two surfaces
with their second fundamental forms does; see `curved`.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve.contact import site_corners
from fcdm_opt.curve.kernels import E1E2, F1V2
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.exact_points import BENT
from fcdm_opt.geometry.patches import Patch, TrueFaces, true_faces
from fcdm_opt.model.task import Task
from fcdm_opt.model.true_faces import where_nearest
from fcdm_opt.tolerances import DEFAULT

STEP = 0.01  # of the size: between two points of a line of contact
STRAIGHT = DEFAULT.nominal  # of the largest bend: less is none
BALANCED = DEFAULT.active**0.5  # as `Tolerances.stationary`: an amount is right to the square of what its direction is


class RoundContact(NamedTuple):
    """Two true faces that touch, not at an edge of either."""

    points: Array  # (2, 3): of either body, as drawn
    # (3, 3): two directions in the tangent plane where the motion ends, and the normal from body 1 to body 2
    frame: Array
    # (2, 2, 2): second derivatives of the gap to either face along these directions, positive where it is convex
    bends: Array
    patches: tuple[Patch, Patch]  # as drawn
    held: bool  # one of two points of a line all of which is to touch, where the motion tilts it

    def is_of(self, task: Task, parts: tuple[int, int], sites: Ints, normals: Array) -> bool:
        """Tell whether a pair of parts that meet at sites, in directions, does so in this contact, or beside it."""
        if not (normals @ self.frame[2]).max() > np.cos(BENT):
            return False
        pair = task.movable.parts[parts[0]], task.obstacles[parts[1]].part
        near = max(STRAIGHT * task.size, *(own.slack for own in _true_faces(task)))
        for site in sites.tolist():  # an edge of a plane face is beside all contacts of this face
            k = int(self.patches[0].surface.flat) if site[0] == E1E2 else int(site[0] == F1V2)
            corners = pair[k].vertices[list(site_corners(*pair, site)[k])]
            if np.abs(self.patches[k].gaps(corners)[0]).min() <= near:
                return True
        return False


def round_contacts(task: Task, q: Array, slack: float) -> list[RoundContact] | None:
    """Return where true faces, one round, touch after a motion; None at an edge, or of parts not exact at points."""
    if task.movable.exact is None and task.static.exact is None:
        return None
    transform, found = task.transform(q), dict[tuple[int, int, int], RoundContact]()
    faces = _true_faces(task)
    one, two = (own.body for own in faces)
    turn, rates = transform[:3, :3], task.motion.kinematics(task.movable.seed, task.static.seed).rates(q)[1]
    for near in where_nearest(one, two, task.target.tolist(), transform, slack):
        if near.gap > slack:
            break
        for pair in product(faces[0].at(near.points[0]), faces[1].at(near.points[1])):
            patches = faces[0].patches[pair[0]], faces[1].patches[pair[1]]
            first, second = (own.gaps(x[None])[1][0] for own, x in zip(patches, near.points, strict=True))
            if min((turn @ first) @ near.normal, -second @ near.normal) > 1.0 - STRAIGHT:
                break
        else:
            return None
        if all(own.surface.flat for own in patches):
            continue
        alike = [own for (i, j, _), own in found.items() if (i, j) == pair]
        if any(own.frame[2] @ near.normal > np.cos(BENT) for own in alike):
            continue
        across = np.linalg.svd(near.normal[None])[2][1:]
        across[1] = np.cross(near.normal, across[0])
        drawn, places = (across @ turn, across), [near.points]  # and another one of a line that is held
        for points in places:
            each = zip(drawn, patches, points, task.target, strict=True)
            bends = np.array([own @ patch.bends(x[None])[0] @ own.T / scale for own, patch, x, scale in each])
            straight, along = np.linalg.eigh(bends.sum(axis=0))
            step = STEP * task.size * along[:, 0] @ across
            tilts = np.abs(rates[:, :3, :3] @ (turn.T @ step) @ near.normal).max() > DEFAULT.tie * task.size
            tilts &= task.restored and straight[0] <= STRAIGHT * straight[1]
            if len(places) == 1 and tilts and any(own.surface.flat for own in patches):
                ends = near.points + np.array([[turn.T @ step, step], [-turn.T @ step, -step]]) / task.target[:, None]
                places += [x for x in ends if all(k in own.at(y) for k, own, y in zip(pair, faces, x, strict=True))][:1]
            frame = np.vstack([across, near.normal])
            found[*pair, len(found)] = RoundContact(points, frame, bends, patches, len(places) > 1)
    return [*found.values()]


def _true_faces(task: Task) -> tuple[TrueFaces, TrueFaces]:
    """Return the true faces of both bodies."""
    return true_faces(task.movable.of_facets), true_faces(task.static.of_facets)


def curved(contact: RoundContact, shifts: Array, turns: Array, twist: Array) -> tuple[Array, Array] | None:
    """Return the second derivatives of the gap beyond those of a point and a plane, and what must not change.

    Face 1 is at height -u B1 u / 2 over the tangent plane, face 2 at v B2 v / 2 with v = u + d where body 1 is shifted
    by d along the plane, `shifts`; where it also sinks by a u, as it turns, `turns`, the gap at u is u B1 u / 2 + a u +
    (u + d) B2 (u + d) / 2, and the least over u is that of the faces. Both are (2, n), by n data, as is `twist`, (n,):
    by how much body 1 turns about the normal.

    The derivatives are (n, n). Along a line of contact there is no such least gap where body 1 tilts, nor, of two faces
    bent across it, where it twists: either end comes first. The products of what must not change, (m, n), with the data
    must be 0. None where the faces overlap beside the contact.
    """
    one, two = contact.bends
    bends, along = np.linalg.eigh(one + two)
    least = STRAIGHT * np.abs(contact.bends).max()
    if bends.min() < -least:
        return None
    pulls = along.T @ (turns + two @ shifts)
    flat = bends <= least
    second = shifts.T @ two @ shifts - (pulls[~flat].T / bends[~flat]) @ pulls[~flat]
    across = np.einsum("ik,lij,jk->lk", along[:, ~flat], contact.bends, along[:, ~flat])
    twists = across.shape[1] == 1 and np.abs(across).min() > least
    return second, np.vstack([pulls[flat], twist[None]]) if twists else pulls[flat]
