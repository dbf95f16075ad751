"""Corners of a solid that become several when its faces move: where more than three meet that no longer share a point.

Which of the faces then meet along the edges between the new corners is a triangulation of the polygon that has a
vertex for each face around the corner, as in Aichholzer and Aurenhammer, Straight skeletons for general polygonal
figures in the plane (1996), for roofs.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby, pairwise, permutations
from operator import itemgetter

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.surface import rims
from fcdm_opt.tolerances import DEFAULT

MOST_FACES = 7  # around a corner: it may become 5 corners in 42 ways
Triples = tuple[tuple[int, int, int], ...]


def split_corner(body: Body, offsets: Array, row: int) -> tuple[Array, dict[int, list[int]]] | None:
    """Return the corners that one of a solid becomes, (k, 3), and which of them each face around has, in its order.

    Where edges around it are convex and concave in turn it may part in two ways that leave every face simple: taken is
    the one with more concave edges between its corners, the union of what each pair of faces bounds. None where there
    is none, or the faces around it are no one ring.

    - `offsets` (faces,): how far each face moves outward, along its normal.
    - `row`: of the vertex, from 0. Faces are numbered from 0.
    """
    around = _ring(body, row)
    if around is None or not 3 < len(around) <= MOST_FACES:
        return None
    faces, ends = np.array([face for face, _, _ in around]), np.array([pair for _, *pair in around])
    normals, place = body.face_planes[0][faces], body.vertices[row]
    along = body.vertices[ends] - place  # to the corner before and the one after it, of each face
    digits = int(-np.log10(DEFAULT.planarity * np.abs(offsets).max()))  # that tell corners apart
    found = list[tuple[int, Array, dict[int, list[int]]]]()
    for triples in _triangulations(0, len(faces) - 1):
        own = normals[np.array(triples)]
        if (np.abs(np.linalg.det(own)) < DEFAULT.planarity).any():
            continue
        moves = np.linalg.solve(own, offsets[faces][np.array(triples)][..., None])[..., 0]
        kept = {k: _in_order(triples, k, len(faces)) for k in range(len(faces))}
        if all(_is_simple(normals[k], -along[k, 0], along[k, 1], moves[kept[k]]) for k in kept):
            apart, which = np.unique(moves.round(digits), axis=0, return_inverse=True)
            in_turn = {int(faces[k]): which.reshape(-1)[own].tolist() for k, own in kept.items()}
            each = {face: [k for k, _ in groupby(own)] for face, own in in_turn.items()}
            found.append((_convex(triples, normals, moves), place + apart, each))
    return min(found, key=itemgetter(0))[1:] if found else None


def _ring(body: Body, row: int) -> list[tuple[int, int, int]] | None:
    """Return the faces around a vertex in turn, each with the vertex before and after it along its border."""
    after = dict[int, tuple[int, int]]()  # by the vertex before: the face, and the vertex after
    for face, triangles in enumerate(body.triangles):
        for loop in rims(own for own in triangles if row in own):
            for a, b, c in zip(loop[-1:] + loop, loop, loop[1:] + loop[:1], strict=False):
                if b == row and a in after:
                    return None
                if b == row:
                    after[a] = face, c
    ring, before = list[tuple[int, int, int]](), min(after)
    while before in after:
        face, following = after.pop(before)
        ring.append((face, before, following))
        before = following
    return None if after or len({face for face, _, _ in ring}) < len(ring) else ring


def _triangulations(first: int, last: int) -> Iterator[Triples]:
    """Go through the triangulations of a convex polygon with vertices numbered from first to last."""
    if last - first < 2:
        yield ()
    for between in range(first + 1, last):
        for one in _triangulations(first, between):
            for two in _triangulations(between, last):
                yield (*one, *two, (first, between, last))


def _in_order(triples: Triples, vertex: int, count: int) -> list[int]:
    """Return the triangles at a vertex of a polygon in turn, from the side before it to the one after it."""
    own, current, found = dict(enumerate(triples)), (vertex - 1) % count, list[int]()
    while current != (vertex + 1) % count:
        k = next(k for k, triple in own.items() if {vertex, current} <= set(triple))
        (current,) = set(own.pop(k)) - {vertex, current}
        found.append(k)
    return found


def _convex(triples: Triples, normals: Array, moves: Array) -> int:
    """Return at how many edges between new corners the solid is convex."""
    found = 0
    for one, two in permutations(range(len(triples)), 2):
        shared = sorted(set(triples[one]) & set(triples[two]))
        if len(shared) < 2:
            continue
        (a, b), (third,) = shared, set(triples[one]).difference(shared)
        if not a < third < b:  # face a's border goes from the first of these corners to the second
            found += float(np.cross(normals[a], normals[b]) @ (moves[two] - moves[one])) > 0.0
    return found


def _is_simple(normal: Array, arriving: Array, leaving: Array, moves: Array) -> bool:
    """Tell whether a face's border turns at the new corners, together, as it did at the one."""
    steps = [step for step in np.diff(moves, axis=0) if np.abs(step).max() > DEFAULT.tie * np.abs(moves).max()]

    def turn(one: Array, two: Array) -> float:
        return float(np.arctan2(np.cross(one, two) @ normal, one @ two))

    turns = sum(turn(one, two) for one, two in pairwise([arriving, *steps, leaving]))
    return abs(turns - turn(arriving, leaving)) < 1.0
