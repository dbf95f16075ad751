"""Parts at given sizes: every facet of a convex part moves with the body's face that it lies on, a cut with its plane.

A convex part is { x : n_f . x <= b_f + delta_f }. A corner where three facets meet moves linearly with their offsets.
Where more meet it stays one corner if the offsets agree, else it splits: all triples of its facets are kept. This is
how the part stands as long as no corner crosses a facet that it is not on (`Resizing.reach`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.size import Size, direction
from fcdm_opt.geometry.surface import Surface
from fcdm_opt.tolerances import DEFAULT

MOST_AT_A_CORNER = 24  # facets of a corner that splits: all their triples are kept


@dataclass(frozen=True, eq=False)
class MovingPart:
    """How a convex part answers to k sizes, in the body's frame as drawn; all is linear in the sizes p.

    Attributes
    ----------
    part : ConvexPart
    faces : (f,) int array
        The body's face that each facet moves with, -1 for a cut along no face.
    offsets : (f, k) array
        How far each facet moves outward a unit of each size; where a scale turns it, along its normal as drawn.
    triples : (t, 3) int array
        Facets that meet in each corner.
    vertices : (t,) int array
        The part's vertex as drawn that each corner comes from.
    moves : (t, 3, k) array
        How each corner moves a unit of each size.
    split : (n,) bool array
        Which vertices of the part split.
    """

    part: ConvexPart
    faces: Ints
    offsets: Array
    triples: Ints
    vertices: Ints
    moves: Array
    split: Flags

    @cached_property
    def slack(self) -> tuple[Array, Array]:
        """How deep each corner lies inside each facet as drawn, (t, f), and how that changes by size, (t, f, k).

        Infinite for the facets that the corner's vertex is on.
        """
        part = self.part
        depth = part.levels - part.vertices[self.vertices] @ part.normals.T
        on = np.zeros((len(part.vertices), len(part.loops)), bool)
        for facet, loop in enumerate(part.loops):
            on[list(loop), facet] = True
        change = self.offsets - np.einsum("fx,txk->tfk", part.normals, self.moves)
        depth[on[self.vertices]] = np.inf
        return depth, change

    def at(self, values: Array) -> Array:
        """Return the corners at given sizes, (t, 3)."""
        return self.part.vertices[self.vertices] + self.moves @ values


@dataclass(frozen=True, eq=False)
class Resizing:
    """How a body answers to its sizes: its parts, and for which sizes they stand as they do as drawn."""

    body: Body
    sizes: tuple[Size, ...]
    faces: Array  # how far each face of the body moves outward a unit of each size, (faces, k)
    parts: tuple[MovingPart, ...]
    shares: Array  # of the uniform scale about the seed that a unit of each size is, 0 where it is none, (k,)

    @classmethod
    def of(cls, body: Body, sizes: Sequence[Size], *, drawn: Body | None = None) -> Resizing:
        """Return it; raises `InputError` where faces in one plane, or a cut between parts, would have to part.

        Faces are chosen on the body as drawn, which the body was before it was scaled.
        """
        if body.hollow:
            what = (
                "sizes of faces move those of a solid cut into convex parts, and of this one only the surface is known"
            )
            raise InputError(what, key=f"body '{body.name}'", found=body.notes[0], allowed='decomposition = "exact"')
        chosen = drawn or body
        face_offsets = np.column_stack([*(size.offsets(chosen) for size in sizes), np.zeros(len(body.faces))])[:, :-1]
        turns = np.array([size.directions() for size in sizes]).reshape(-1, 3, 3)
        shares = _shares(body, face_offsets)
        lone = np.where(shares, 0.0, face_offsets)  # faces that move as a scale does: all corners with it
        turns = turns + shares[:, None, None] * np.eye(3)
        parts = tuple(_moving(body, k, sizes, lone, turns) for k in range(len(body.parts)))
        return cls(body, tuple(sizes), face_offsets, parts, shares + [size.scale == "xyz" for size in sizes])

    def reach(self, low: Array, high: Array) -> tuple[float, str]:
        """Return by what factor a box of sizes about 0 may be widened until a face vanishes, and where it does.

        Parameters
        ----------
        low, high : (k,) array
            The box; the factor is at least that for it and 0 together.

        Returns
        -------
        factor : float
            The parts keep their faces, and which of them meet, for sizes of less than this times the box.
        where : str
            The face that would be reached first.
        """
        low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
        least, where = np.inf, ""
        for own in self.parts:
            depth, change = own.slack
            loss = -np.minimum(change * low, change * high).sum(axis=2)
            with np.errstate(divide="ignore"):
                factor = np.where(loss > 0.0, depth / np.where(loss > 0.0, loss, 1.0), np.inf)
            if factor.size and factor.min() < least:
                facet = int(np.unravel_index(factor.argmin(), factor.shape)[1])
                least, where = float(factor.min()), self.named(own, facet)
        return least, where

    def named(self, own: MovingPart, facet: int) -> str:
        """Return the face of the body that a facet of a part belongs to, in words."""
        face, n = int(own.faces[facet]), direction(own.part.normals[facet])
        return (
            f"face F{face + 1} ({n}) of body '{self.body.name}'" if face >= 0 else f"a cut of body '{self.body.name}'"
        )

    def inclined(self) -> str:
        """Return a face that a scale along an axis turns, "" where none is turned."""
        for own in self.parts:
            for size in (size for size in self.sizes if not size.is_length):
                turned = own.part.normals @ size.directions()
                along = (turned * own.part.normals).sum(axis=1)[:, None] * own.part.normals
                bad = np.flatnonzero(np.abs(turned - along).max(axis=1) > DEFAULT.nominal)
                if bad.size:
                    return f"size '{size.name}' turns {self.named(own, int(bad[0]))}"
        return ""


def resized(body: Body, made: Mapping[Size, float]) -> Body:
    """Return a body at given sizes: scaled first, then its faces moved outward along their normals.

    Vertices keep their labels where each stays one; else they are numbered anew.

    Parameters
    ----------
    body : Body
    made : mapping of Size to number
        Deviations from drawn; sizes that are not there are as drawn.

    Raises
    ------
    InputError
        Where a face vanishes or a part does, with the face.
    """
    scaled = _scaled(body, made)
    lengths = {size: value for size, value in made.items() if size.is_length and value}
    if not lengths:
        return scaled
    moving = Resizing.of(scaled, tuple(lengths), drawn=body)
    values = np.array(list(lengths.values()))
    return _offset(moving, values)


def planes_made(body: Body, made: Mapping[Size, float]) -> list[tuple[Array, Array]]:
    """Return the normals of each part's facets at given sizes, and how far they are from the body's seed then."""
    scaled = _scaled(body, made)
    lengths = {size: value for size, value in made.items() if size.is_length and value}
    moved = Resizing.of(scaled, tuple(lengths), drawn=body).parts if lengths else ()
    planes = []
    for k, part in enumerate(scaled.parts):
        out = moved[k].offsets @ np.array(list(lengths.values())) if moved else 0.0
        planes.append((part.normals, part.levels - part.normals @ scaled.seed + out))
    return planes


def vertex_rates(body: Body, made: Mapping[Size, float], size: Size) -> Array | None:
    """Return how the vertices of a body made move a unit of one of its sizes, (n, 3), to first order, by their labels.

    None where the body made has other vertices than the one drawn, and where a scale turns faces that others move.
    """
    if not size.is_length:
        turns = Resizing.of(body, (size,)).inclined() and any(own.is_length and x for own, x in made.items())
        return None if turns else (body.vertices - body.seed) @ size.directions()
    moving = Resizing.of(_scaled(body, made), (size,), drawn=body)
    rows = _kept_numbers(moving, np.ones(1))
    return None if rows is None else rows - moving.body.vertices


def _scaled(body: Body, made: Mapping[Size, float]) -> Body:
    """Return a body of which all scales are made, and no face moves by itself."""
    stretch = np.zeros((3, 3)) + sum(value * size.directions() for size, value in made.items())
    scaled = body
    if stretch.any():
        factors = np.eye(3) + stretch
        diagonal = np.diag(factors)
        if not np.linalg.eigvalsh(factors).min() > 0.0:
            found = {size.name: value for size, value in made.items()}
            raise InputError("nothing would be left", key=f"body '{body.name}'", found=found, allowed="scales > -1")
        straight = not (factors - np.diag(diagonal)).any()
        scaled = body._mapped(lambda x: body.seed + (
            (x - body.seed) * diagonal if straight else (x - body.seed) @ factors
        ))  # fmt: skip
    return scaled


def _offset(moving: Resizing, values: Array) -> Body:
    body, near = moving.body, DEFAULT.planarity * moving.body.size
    found, whole = [], True
    for own in moving.parts:
        depth, change = own.slack
        inside = depth + change @ values
        low = np.where(np.isinf(depth), np.inf, inside).min(axis=0)
        points = own.at(values)
        kept: Flags = np.ones(len(points), bool)
        if own.split.any():  # of a corner that splits those triples that no other of its facets cuts off
            kept = np.asarray((np.where(np.isinf(depth), change @ values, 0.0) >= -near).all(axis=1))
        if low.min() <= near:
            facet, outer = int(low.argmin()), len(moving.parts) == 1
            points, kept = _intersected(moving, own, values, facet) if outer else (points, kept)
            if not outer:
                raise _vanished(moving, own, facet, values)
            whole = False
        whole &= not own.split.any()
        found.append(points[kept])
    rows = _kept_numbers(moving, values) if whole else None
    if rows is None:
        return replace(Body.from_parts(found, seed=body.seed, name=body.name), deviation=body.deviation)
    if len(body.parts) == 1:
        part = body.parts[0]
        moved = part.vertices + moving.parts[0].moves[_firsts(moving.parts[0])] @ values
        return replace(body, vertices=frozen(rows), parts=(part.placed(moved, body.seed),))
    index = {tuple(point): k for k, point in reversed(list(enumerate(body.vertices.tolist())))}
    parts = [[index[tuple(point)] for point in part.vertices.tolist()] for part in body.parts]
    names = ", ".join(f"{size.name} = {x:.6g}" for size, x in zip(moving.sizes, values, strict=True))
    try:
        if body.skin:
            counts, triangles = list(map(len, body.skin)), np.concatenate([np.array(own) for own in body.skin])
            surface = Surface.of(rows, triangles, np.repeat(np.arange(len(counts)), counts))
            made = Body._made(rows, [np.array(part) for part in parts], None, body.seed, body.name, surface=surface)
            _apart(body, made, near)
        else:
            faces = [[label - 1 for label in face] for face in body.outlines]
            made = Body.from_parts(rows, parts=parts, faces=faces, seed=body.seed, name=body.name)
    except InputError as reason:
        what = f"the body changes its shape at these sizes: {reason.what}"
        raise InputError(what, key=f"body '{body.name}'", found=names, allowed="smaller deviations") from reason
    errors = body.facet_errors if made.faces == body.faces else None
    return replace(made, notes=body.notes, skin=body.skin, deviation=body.deviation, facet_errors=errors)


def _apart(body: Body, made: Body, near: float) -> None:
    """Refuse parts that lie in one another and did not as drawn: faces on two sides of a room have met."""
    low, high = (np.array([end(part.vertices, axis=0) for part in made.parts]) for end in (np.min, np.max))
    for i, j in combinations(range(len(made.parts)), 2):
        if (np.minimum(high[i], high[j]) - np.maximum(low[i], low[j])).min() <= near:
            continue
        if _share_more(made.parts[i], made.parts[j], near) and not _share_more(body.parts[i], body.parts[j], near):
            raise InputError(f"material meets across a room, at {_facing(made, (i, j))}")


def _share_more(one: ConvexPart, two: ConvexPart, near: float) -> bool:
    """Tell whether two parts share a ball larger than `near`."""
    for own, other in ((one, two), (two, one)):
        if ((own.normals @ other.vertices.T).min(axis=1) - own.levels).max() >= -near:
            return False
    return largest_ball(np.vstack([one.normals, two.normals]), np.concatenate([one.levels, two.levels]))[1] > near


def _facing(made: Body, pair: tuple[int, int]) -> str:
    """Name the faces of two parts that look at each other and have crossed least."""
    one, two = (made.parts[k] for k in pair)
    crossed = -(one.levels[:, None] + two.levels[None])
    crossed[(one.normals @ two.normals.T > DEFAULT.nominal - 1.0) | (crossed > 0.0)] = -np.inf
    places = np.unravel_index(crossed.argmax(), crossed.shape)
    found = {face for part, k in zip(pair, places, strict=True) for face in made.facet_faces[part][k]}
    return "faces " + ", ".join(f"F{face + 1}" for face in sorted(found)) if np.isfinite(crossed.max()) else "no face"


def _vanished(moving: Resizing, own: MovingPart, facet: int, values: Array) -> InputError:
    names = ", ".join(f"{size.name} = {x:.6g}" for size, x in zip(moving.sizes, values, strict=True))
    what = f"the body changes its shape at these sizes: what it has beside {moving.named(own, facet)} vanishes"
    factor, _ = moving.reach(np.minimum(values, 0.0), np.maximum(values, 0.0))
    allowed = f"deviations of less than {100.0 * factor:.4g} % of these"
    return InputError(what, key=f"body '{moving.body.name}'", found=names, allowed=allowed)


def _intersected(moving: Resizing, own: MovingPart, values: Array, facet: int) -> tuple[Array, Flags]:
    """Return the corners of a convex body some of whose edges are others than as drawn; refuse it if a face is none."""
    from scipy.spatial import HalfspaceIntersection, QhullError

    part, centre = own.part, own.part.vertices.mean(axis=0)
    levels = (part.normals * (part.bases - centre)).sum(axis=1) + own.offsets @ values
    middle, radius = largest_ball(part.normals, levels)
    if not radius > DEFAULT.planarity * moving.body.size:
        raise _vanished(moving, own, facet, values)
    try:
        shape = HalfspaceIntersection(np.column_stack([part.normals, -levels]), middle)
    except QhullError as reason:
        raise _vanished(moving, own, facet, values) from reason
    points = shape.intersections
    on = (np.abs(points @ part.normals.T - levels) <= DEFAULT.nominal * moving.body.size).sum(axis=0)
    if on.min() < 3:
        raise _vanished(moving, own, int(on.argmin()), values)
    return points + centre, np.ones(len(points), bool)


def largest_ball(normals: Array, levels: Array) -> tuple[Array, float]:
    """Return middle and radius of the largest ball within half-spaces n . x <= level; -inf where there is none."""
    from scipy.optimize import linprog

    rows = np.column_stack([normals, np.ones(len(levels))])
    ball = linprog([0.0, 0.0, 0.0, -1.0], rows, levels, bounds=[(None, None)] * 4)
    return (ball.x[:3], float(ball.x[3])) if ball.status == 0 else (np.zeros(3), -np.inf)


def _firsts(own: MovingPart) -> Ints:
    """Return a corner of each vertex."""
    return np.unique(own.vertices, return_index=True)[1]


def _kept_numbers(moving: Resizing, values: Array) -> Array | None:
    """Return all vertices of the body at given sizes under their labels; None where parts do not agree on one."""
    body = moving.body
    near, rows = DEFAULT.planarity * body.size, {tuple(point): k for k, point in enumerate(body.vertices.tolist())}
    twice = len(rows) < len(body.vertices)
    new, known = body.vertices.copy(), np.zeros(len(body.vertices), bool)
    for own in moving.parts:
        moves = own.moves[_firsts(own)] @ values
        for point, move in zip(own.part.vertices.tolist(), moves, strict=True):
            same = np.flatnonzero((body.vertices == point).all(axis=1)).tolist() if twice else [rows[tuple(point)]]
            for row in same:
                if known[row] and np.abs(new[row] - point - move).max() > near:
                    return None
                new[row], known[row] = point + move, True
    normals, offsets = body.face_planes[0], moving.faces @ values
    for row in sorted({label - 1 for face in body.faces for label in face}):
        if not known[row]:  # where parts that overlap cross: by the faces that meet there
            around = [k for k, face in enumerate(body.faces) if row + 1 in face]
            move, _, rank, _ = np.linalg.lstsq(normals[around], offsets[around])
            if rank < 3 or np.abs(normals[around] @ move - offsets[around]).max() > near:
                return None
            new[row], known[row] = new[row] + move, True
    for row in np.flatnonzero(~known).tolist():  # no corner of any part: with the nearest one
        nearest = np.flatnonzero(known)[np.linalg.norm(body.vertices[known] - body.vertices[row], axis=1).argmin()]
        new[row] = new[nearest]
    return new


# ------------------------------------------------------------------------------------------------------- moving parts


def _shares(body: Body, offsets: Array) -> Array:
    """Return the scale about the seed that moves every face outward by its offset a unit of each size, 0 for none."""
    normals, points = body.face_planes
    heights = (normals * (points - body.seed)).sum(axis=1)
    shares = np.asarray(heights @ offsets / max(float(heights @ heights), np.finfo(float).tiny))
    off = np.abs(offsets - np.outer(heights, shares)).max(axis=0, initial=0.0)
    shares[off > DEFAULT.sign * np.abs(shares) * body.size] = 0.0
    for k in np.flatnonzero(shares).tolist():
        near = float(f"{shares[k]:.12g}")  # of which only the rounding of the heights made it differ
        shares[k] = near if abs(shares[k] - near) <= DEFAULT.sign * abs(near) else shares[k]
    return shares


def _moving(body: Body, place: int, sizes: Sequence[Size], face_offsets: Array, turns: Array) -> MovingPart:
    part = body.parts[place]
    faces, lengths = _facets(body, place, sizes, face_offsets)
    offsets = lengths + np.einsum("fx,kxy,fy->fk", part.normals, turns, part.bases - body.seed)
    vertex = np.concatenate([np.array(loop) for loop in part.loops])
    facet = np.repeat(np.arange(len(part.loops)), [len(loop) for loop in part.loops])
    order = np.argsort(vertex, kind="stable")
    counts = np.bincount(vertex, minlength=len(part.vertices))
    starts = np.cumsum(counts) - counts
    simple = np.flatnonzero(counts == 3)
    triples = facet[order][starts[simple][:, None] + np.arange(3)]
    moves = np.linalg.solve(part.normals[triples], lengths[triples]) if len(simple) else np.zeros((0, 3, len(sizes)))
    vertices, split, apart = simple, np.zeros(len(part.vertices), bool), []
    for v in np.flatnonzero(counts > 3).tolist():
        around = facet[order][starts[v] : starts[v] + counts[v]]
        n, g = part.normals[around], lengths[around]
        whole = np.linalg.lstsq(n, g)[0]
        if np.abs(n @ whole - g).max(initial=0.0) <= DEFAULT.planarity * max(1.0, np.abs(g).max(initial=0.0)):
            own = _fan(around, n)
            its = np.repeat(whole[None], len(own), axis=0)
        else:
            if len(around) > MOST_AT_A_CORNER:
                raise InputError(
                    f"a corner of {len(around)} faces would split", key=f"body '{body.name}'",
                    found=part.vertices[v].tolist(), allowed=f"at most {MOST_AT_A_CORNER} faces that part at a corner",
                )  # fmt: skip
            split[v] = True
            apart.append(np.array(list(combinations(around.tolist(), 3))))
            continue
        triples, moves = np.concatenate([triples, own]), np.concatenate([moves, its])
        vertices = np.concatenate([vertices, np.full(len(own), v)])
    if apart:
        own, origin = np.concatenate(apart), np.repeat(np.flatnonzero(split), list(map(len, apart)))
        kept = np.abs(np.linalg.det(part.normals[own])) > DEFAULT.nominal
        own, origin = own[kept], origin[kept]
        triples, vertices = np.concatenate([triples, own]), np.concatenate([vertices, origin])
        moves = np.concatenate([moves, np.linalg.solve(part.normals[own], lengths[own])])
    moves = moves + np.einsum("kxy,ty->txk", turns, part.vertices[vertices] - body.seed)
    return MovingPart(part, faces, offsets, triples, vertices, moves, split)


def _fan(around: Ints, normals: Array) -> Ints:
    """Return triples of the facets round a corner, whose cones of normals fill that of the corner."""
    middle = normals.sum(axis=0)
    first = normals[0] - normals[0] @ middle / (middle @ middle) * middle
    second = np.cross(middle, first) / np.linalg.norm(middle)
    ring = around[np.argsort(np.arctan2(normals @ second, normals @ first), kind="stable")]
    return np.array([[ring[0], ring[k], ring[k + 1]] for k in range(1, len(ring) - 1)])


def _facets(body: Body, place: int, sizes: Sequence[Size], face_offsets: Array) -> tuple[Ints, Array]:
    """Return the face that each facet of a part moves with, and how far outward by size, (f, k)."""
    part, (normals, points) = body.parts[place], body.face_planes
    faces, moved = np.full(len(part.loops), -1), np.zeros((len(part.loops), len(sizes)))
    loose = []
    for k, loop in enumerate(part.loops):
        own, side = list(body.facet_faces[place][k]), np.ones((1, 1))
        if not own:  # a cut: it moves with the faces in its plane, whichever side they look to
            n = part.normals[k]
            flat = np.abs((points - part.vertices[loop[0]]) @ n) <= DEFAULT.nominal * body.size
            own = np.flatnonzero(flat & (np.abs(np.abs(normals @ n) - 1.0) <= DEFAULT.nominal)).tolist()
            side = np.sign(normals[own] @ n)[:, None]
        if not own:
            loose.append(k)
            continue
        offsets = side * face_offsets[own]
        wrong = np.abs(offsets - offsets[0]).max(axis=0) > DEFAULT.nominal if len(own) > 1 else np.zeros(1, bool)
        if wrong.any():
            names = ", ".join(f"F{face + 1}" for face in own)
            raise InputError(
                f"body '{body.name}' is cut along the plane of faces {names}, which would no longer be one plane",
                key=f"size '{sizes[int(wrong.argmax())].name}'.faces", found=names,
                allowed="all of these faces, or none",
            )  # fmt: skip
        faces[k], moved[k] = own[0], offsets[0]
    if loose and moved.any():
        k = int(np.flatnonzero(moved.any(axis=0))[0])
        face = int(faces[np.flatnonzero(moved[:, k])[0]])
        raise InputError(
            f"body '{body.name}' is cut beside face F{face + 1} along no face's plane: the cut cannot move with it",
            key=f"size '{sizes[k].name}'.faces", found=f"F{face + 1}", allowed="a scale, or faces away from such a cut",
        )  # fmt: skip
    return faces, moved
