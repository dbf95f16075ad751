"""How faces of bodies move with sizes: plane ones outward, round ones with their surface, and fillets with these.

A fillet keeps its radius and stays tangent: where the faces that it joins move, its axis or ring goes with them.

A corner becomes several where more than three faces meet that no longer share a point. Which of the faces then meet
along the edges between the new corners is a triangulation of the polygon that has a vertex for each face around the
corner, as in Aichholzer and Aurenhammer, Straight skeletons for general polygonal figures in the plane (1996), for
roofs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import groupby, pairwise, permutations
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import round_surfaces
from fcdm_opt.geometry.measures import units
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.surface import rims
from fcdm_opt.geometry.tessellation import TANGENT, RoundFaces, Swept
from fcdm_opt.tolerances import DEFAULT

CHAIN = 4  # fillets that follow one another, at most
FACETS = 3  # of a fillet, at least so many tell a change of its radius from a shift


class Tangency(NamedTuple):
    """A corner at which a round face is tangent to another face."""

    other: int  # row of `Body.faces` of the other
    normal: Array  # outward normal there, and the direction away from the axis of the round face, (3,)
    across: Array
    other_across: Array  # that from the axis of the other, where it is round, (3,)


class MovesOfFaces(NamedTuple):
    """How the true faces of a body answer to k sizes."""

    seed: Array  # (3,)
    # how far the true face that each row of `Body.faces` stands for moves outward a unit of each size, (faces, k)
    lengths: Array
    shifts: Array  # how it is shifted besides, (faces, 3, k)
    rings: Array  # how much wider its ring gets, of a torus, (faces, k)
    axes: Array  # a point of the axis, and the axis, of a round face, (faces, 2, 3)
    turns: Array  # scales: a point X moves by U (X - s) a unit of each, (k, 3, 3)

    @classmethod
    def of(
        cls, facets: Body, sizes: Sequence[Size], offsets: Array | None = None, turns: Array | None = None
    ) -> MovesOfFaces:
        """Return them; raises `InputError` for a size that makes something else of a round face."""
        # by default faces move by all of what sizes say; `offsets` (faces, k) and `turns` where some of them count as
        # scales
        offsets = offsets_of_faces(facets, sizes) if offsets is None else offsets
        turns = np.array([size.directions() for size in sizes]).reshape(-1, 3, 3) if turns is None else turns
        lengths, shifts, rings = offsets.copy(), np.zeros((len(offsets), 3, len(sizes))), np.zeros_like(offsets)
        axes = np.zeros((len(offsets), 2, 3))
        for own, rows in round_surfaces(facets):
            axes[list(rows)] = own.origin, own.axis
        for k, size in enumerate(sizes):
            for (_, rows), moved in zip(round_surfaces(facets), _moves(facets, offsets[:, k]), strict=True):
                if moved is None:
                    raise InputError(
                        f"a round face of body '{facets.name}' would no longer be one",
                        key=f"size '{size.name}'.faces", found=size.faces, allowed="all of it",
                    )  # fmt: skip
                own_rows = list(rows)
                lengths[own_rows, k], shifts[own_rows, :, k], rings[own_rows, k] = moved[0], moved[1:4], moved[4]
        return cls(facets.seed, lengths, shifts, rings, axes, turns)

    def at(self, point: Array, rows: Sequence[int], normals: Array) -> Array:
        """Return how a point moves a unit of each size with the faces of some rows that meet there, (3, k)."""
        own = list(rows)
        across = np.array([_across(self.axes[row], point) for row in own]).reshape(-1, 3)
        moved = self.shifts[own] + across[:, :, None] * self.rings[own][:, None]
        off = self.lengths[own] + np.einsum("fx,fxk->fk", normals, moved)
        along = moved[int(self.axes[own].any(axis=(1, 2)).argmax())]  # where normals leave it free, with a round face
        move = along + np.linalg.lstsq(normals, off - normals @ along, rcond=DEFAULT.sharp)[0]  # tangent: the mean
        return np.asarray(move + np.einsum("kyx,x->yk", self.turns, point - self.seed), float)


def _across(axis: Array, point: Array) -> Array:
    """Return the unit direction from an axis, (2, 3), to a point; 0 where there is none."""
    local = point - axis[0]
    return units(local - (local @ axis[1]) * axis[1]) if axis[1].any() else np.zeros(3)


def offsets_of_faces(body: Body, sizes: Sequence[Size]) -> Array:
    """Return how far each face of the body moves outward a unit of each size, (faces, k)."""
    # those of fillets too that are shifted; none of one whose ring gets wider, the facets of which would be turned
    offsets = np.column_stack([*(size.offsets(body) for size in sizes), np.zeros(len(body.faces))])[:, :-1]
    no_own: Flags = np.logical_not(offsets.any(axis=1))
    for k in range(len(sizes)):
        for surface, move in _followed(body, offsets[:, k], no_own).items():
            rows = list(round_surfaces(body)[surface][1])
            if not move[4]:
                offsets[rows, k] = move[0] + body.face_planes[0][rows] @ move[1:4]
    return offsets


def rows_moved(body: Body, made: Body, offsets: Array) -> Ints | None:
    """Return which face of a body each of a body made of it is, (faces,): where labels changed, by its plane moved."""
    if made.faces == body.faces:
        return np.arange(len(body.faces))
    (normals, points), (own, places) = body.face_planes, made.face_planes
    levels = (normals * points).sum(axis=1) + offsets
    off = 1.0 - own @ normals.T + np.abs((own * places).sum(axis=1)[:, None] - levels) / body.size
    rows = off.argmin(axis=1)
    return None if off[np.arange(len(rows)), rows].max(initial=0.0) > DEFAULT.nominal else rows


def moved_surfaces(body: Body, offsets: Array) -> RoundFaces | None:
    """Return the round surfaces of a body with faces moved outward, (faces,): each has the radius that goes with it."""
    # faces of one surface may be moved by one length, or shifted besides; None where they are moved otherwise
    found = list[tuple[Swept, tuple[int, ...]]]()
    for (surface, rows), moved in zip(round_surfaces(body), _moves(body, offsets), strict=True):
        if moved is None:
            return None
        if moved.any():  # else its corners stay where their file has them
            surface = surface.offset(side_of(body, surface, rows[0]) * float(moved[0]), moved[1:4], float(moved[4]))
        found.append((surface, rows))
    return tuple(found)


def _moves(body: Body, offsets: Array) -> list[Array | None]:
    """Return how each round face moves: outward, shifted, and its ring wider, (5,); None where it is no longer one."""
    moves = [_moved_surface(body, rows, offsets) for _, rows in round_surfaces(body)]
    for k, move in _followed(body, offsets).items():
        moves[k] = move
    return moves


def _followed(body: Body, offsets: Array, no_own: Flags | None = None) -> dict[int, Array]:
    """Return how round faces follow those that they are tangent to, as for `_moves`."""
    # those that can, tangent in several directions, with their radius kept where that does. With another radius those
    # that have no size of their own (`no_own`): the round end between two flats, the nose of a pin. At most so many in
    # a row. Of those that move themselves fillets between planes alone, whose radius it is that changes
    found, rounds = dict[int, Array](), round_surfaces(body)
    if not rounds or not offsets.any():
        return found
    surface_of = {row: k for k, (_, rows) in enumerate(rounds) for row in rows}
    moves = {k: _moved_surface(body, rows, offsets) for k, (_, rows) in enumerate(rounds)}
    known = _tangencies(body)
    for _ in range(CHAIN):
        before = dict(found)
        for k, tangencies in known.items():
            follows = no_own is not None and bool(no_own[list(rounds[k][1])].all())
            grows = 0.0
            if offsets[list(rounds[k][1])].any():
                own_move, curved = moves[k], any(each.other in surface_of for each in tangencies)
                if own_move is None or own_move[1:].any() or curved or len(rounds[k][1]) < FACETS:
                    continue
                grows = float(own_move[0])
            wanted, unknowns = list[float](), list[Array]()
            for own in tangencies:
                other = surface_of.get(own.other, -1)
                move = found.get(other, moves.get(other))
                if other < 0 or move is None:
                    wanted.append(float(offsets[own.other]))
                else:
                    wanted.append(float(move[0] + own.normal @ (move[1:4] + move[4] * own.other_across)))
                ring = own.normal @ own.across if rounds[k][0].ring else 0.0
                unknowns.append(np.array([1.0, *own.normal, ring]))
            columns, speeds = np.array(unknowns), np.array(wanted) - grows
            if not speeds.any():
                continue
            least = DEFAULT.snap * np.abs(speeds).max()
            for free in (np.append(0.0, np.ones(4)), np.ones(5))[: 2 if follows and not grows else 1]:
                answer = np.asarray(np.linalg.lstsq(columns * free, speeds, rcond=DEFAULT.sharp)[0], float)
                if np.abs(columns * free @ answer - speeds).max() <= least:
                    found[k] = np.where(np.abs(answer) <= least, 0.0, answer) + grows * np.eye(5)[0]
                    break
        if before.keys() == found.keys() and all(np.array_equal(before[k], found[k]) for k in found):
            break
    return found


@lru_cache(maxsize=16)
def _tangencies(body: Body) -> dict[int, list[Tangency]]:
    """Return where each round face of a body is tangent to others, of those that are so in several directions."""
    rounds, (corners, owners) = round_surfaces(body), body.face_triangles
    surface_of = {row: k for k, (_, rows) in enumerate(rounds) for row in rows}
    around = dict[tuple[float, ...], dict[int, Array]]()  # by corner, the faces there: rows and outward normals
    for triangle, row in zip(corners.tolist(), owners.tolist(), strict=True):
        for point in map(tuple, triangle):
            around.setdefault(point, {})[row] = body.face_planes[0][row]
    found = dict[int, list[Tangency]]()
    for point, faces in around.items():
        place, each = np.array(point), dict[int, tuple[int, Array]]()
        for row, normal in faces.items():
            k = surface_of.get(row, -1 - row)
            if k >= 0:
                looks = rounds[k][0].misses(place[None])[1][0]
                normal = looks * math.copysign(1.0, looks @ normal)
            each[k] = row, normal
        for k in (own for own in each if own >= 0 and len(each) > 1):
            for other, (row, normal) in each.items():
                if other != k and 2.0 * (1.0 - normal @ each[k][1]) <= TANGENT:
                    ends = [
                        _across(np.array(rounds[own][0][:2]), place) if own >= 0 else np.zeros(3) for own in (k, other)
                    ]
                    found.setdefault(k, []).append(Tangency(row, each[k][1], *ends))
    return {k: own for k, own in found.items() if np.ptp([each.normal for each in own], axis=0).max() > DEFAULT.sharp}


def between_planes(body: Body) -> set[int]:
    """Return the rows of the faces of fillets and round ends: of round faces that are tangent to two plane ones."""
    planes = set(range(len(body.faces))) - {row for _, rows in round_surfaces(body) for row in rows}
    found = (k for k, own in _tangencies(body).items() if len({each.other for each in own} & planes) > 1)
    return {row for k in found for row in round_surfaces(body)[k][1]}


def _moved_surface(body: Body, rows: Sequence[int], offsets: Array) -> Array | None:
    """Return by what length a round face is moved outward, how it is shifted besides, and 0, (5,); None else."""
    own, normals = offsets[list(rows)], body.face_planes[0][list(rows)]
    if np.ptp(own) <= DEFAULT.nominal * body.size:
        return np.array([own[0], 0.0, 0.0, 0.0, 0.0])
    columns = np.column_stack([np.ones(len(rows)), normals])
    answer = np.asarray(np.linalg.lstsq(columns, own)[0], float)
    return np.append(answer, 0.0) if np.abs(columns @ answer - own).max() <= DEFAULT.nominal * body.size else None


def side_of(body: Body, surface: Swept, row: int) -> float:
    """Return 1 where a round face has its material inside, as a shaft, and -1 of a bore."""
    corners, owners = body.face_triangles
    looks = surface.misses(corners[owners == row][:1].mean(axis=1))[1][0]
    return math.copysign(1.0, looks @ body.face_planes[0][row])


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
