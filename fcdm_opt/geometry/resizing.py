"""Parts at given sizes: every facet of a convex part moves with the body's face that it lies on, a cut with its plane.

A convex part is { x : n_f . x <= b_f + delta_f }. A corner where three facets meet moves linearly with their offsets.
Where more meet it stays one corner if the offsets agree, else it splits: all triples of its facets are kept. This is
how the part stands as long as no corner crosses a facet that it is not on (`Resizing.valid_up_to`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen, groups_of
from fcdm_opt.geometry.bodies import Body, ConvexPart, ExactPoints, about
from fcdm_opt.geometry.elements import Element, Elements, Span
from fcdm_opt.geometry.facet_errors import errors_about, facet_errors, round_surfaces
from fcdm_opt.geometry.measures import corners_within, norms, volume_and_centroid
from fcdm_opt.geometry.moving_faces import (
    MovesOfFaces,
    moved_surfaces,
    offsets_of_faces,
    rows_moved,
    side_of,
    split_corner,
)
from fcdm_opt.geometry.naming import faces_text
from fcdm_opt.geometry.partition import RULES
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.geometry.polygons import area, components, inside
from fcdm_opt.geometry.pyramids import apexes, pyramids
from fcdm_opt.geometry.round_recognition import GENTLE, neighbours
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.surface import Surface
from fcdm_opt.geometry.true_resizing import (
    corners_on_true_faces,
    faces_around,
    on_true_faces,
    rates_on_true_faces,
    surface_with_corners,
)
from fcdm_opt.tolerances import DEFAULT

HARDLY = 1e-3  # of a body's size: a small change of a length
MOST_FOR_RULES = 2_000  # triangles of a solid that is cut in more ways than one
FEW = 4  # corners of a box of sizes that tell whether cuts follow
MOST_AT_A_CORNER = 24  # facets of a corner that splits: all their triples are kept


@dataclass(frozen=True, eq=False)
class MovingPart:
    """How a convex part answers to k sizes, in the body's frame as drawn; all is linear in the sizes p."""

    part: ConvexPart
    faces: Ints  # the body's face that each facet moves with, -1 for a cut along no face, (f,)
    # (f, k): how far each facet moves outward a unit of each size; where a scale turns it, along its normal as drawn
    offsets: Array
    triples: Ints  # facets that meet in each corner, (t, 3)
    vertices: Ints  # the part's vertex as drawn that each corner comes from, or is nearest to, (t,)
    points: Array  # where it is as drawn, (t, 3)
    moves: Array  # how each corner moves a unit of each size, (t, 3, k)
    split: Flags  # which vertices of the part split, (n,)

    @cached_property
    def slack(self) -> tuple[Array, Array]:
        """How deep each corner lies inside each facet as drawn, (t, f), and how that changes by size, (t, f, k)."""
        # infinite for the facets that the corner's vertex is on
        part = self.part
        depth = part.levels - self.points @ part.normals.T
        on = np.zeros((len(part.vertices), len(part.loops)), bool)
        for facet, loop in enumerate(part.loops):
            on[list(loop), facet] = True
        change = self.offsets - np.einsum("fx,txk->tfk", part.normals, self.moves)
        depth[on[self.vertices]] = np.inf
        return depth, change

    def at(self, values: Array) -> Array:
        """Return the corners at given sizes, (t, 3)."""
        return self.points + self.moves @ values

    def with_all_corners(self) -> MovingPart:
        """Return it with all points in which three facets' planes meet as corners, of a part that changes its shape."""
        normals, part = self.part.normals, self.part
        triples = np.array(list(combinations(range(len(normals)), 3)))
        triples = triples[np.abs(np.linalg.det(normals[triples])) > DEFAULT.nominal]
        centre = part.vertices.mean(axis=0)
        levels = (normals * (part.bases - centre)).sum(axis=1)
        solved = np.linalg.solve(
            normals[triples], np.concatenate([levels[triples][:, :, None], self.offsets[triples]], axis=2)
        )
        points = solved[:, :, 0] + centre
        nearest = np.linalg.norm(points[:, None] - part.vertices, axis=2).argmin(axis=1)
        split = np.ones(len(part.vertices), bool)
        return replace(self, triples=triples, vertices=nearest, points=points, moves=solved[:, :, 1:], split=split)


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
        """Return it; raises `InputError` where faces in one plane, or a cut between parts, would have to part."""
        # faces are chosen on the body as drawn, which the body was before it was scaled
        if body.is_surface:
            what = "rows of sizes are of a solid cut into convex parts, and of this one only the surface is kept"
            allowed = 'decomposition = "exact", or a question at given sizes (made)'
            raise InputError(what, key=f"body '{body.name}'", found=body.notes[0], allowed=allowed)
        facets_of = body.of_facets
        face_offsets = offsets_of_faces(drawn or facets_of, sizes)
        turns = np.array([size.directions() for size in sizes]).reshape(-1, 3, 3)
        shares = _shares(facets_of, face_offsets)
        lone = np.where(shares, 0.0, face_offsets)  # faces that move as a scale does: all corners with it
        turns = turns + shares[:, None, None] * np.eye(3)
        if body.exact is None:
            facets = _facets(body, sizes, lone)
        else:
            facets = _facets_within(body, body.exact, sizes, lone, turns)
        pieces = 0 if body.exact is None else len(body.exact.pieces)
        still = np.zeros_like(turns)  # pieces go with their points, and stay as large
        each = [*[turns] * (len(facets) - pieces), *[still] * pieces]
        parts = tuple(_moving(body, k, sizes, *own) for k, own in enumerate(zip(facets, each, strict=True)))
        return cls(body, tuple(sizes), face_offsets, parts, shares + [size.scale == "xyz" for size in sizes])

    def reaches(self, low: Array, high: Array) -> list[tuple[float, str]]:
        """Return for each part the factor by which a box of sizes about 0 may widen before facets vanish, and which."""
        # the part keeps its facets, and which of them meet, for sizes of less than the factor times the box. `low`,
        # `high` (k,): its ends; the factor is at least that for it and 0 together
        low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
        found = []
        for own in self.parts:
            depth, change = own.slack
            loss = -np.minimum(change * low, change * high).sum(axis=2)
            with np.errstate(divide="ignore"):
                factor = np.where(loss > 0.0, depth / np.where(loss > 0.0, loss, 1.0), np.inf)
            facet = int(np.unravel_index(factor.argmin(), factor.shape)[1])
            found.append((float(factor.min()), self.named(own, facet)))
        return found

    def valid_up_to(self, low: Array, high: Array) -> tuple[float, str]:
        """Return the least of all parts'."""
        return min(self.reaches(low, high), key=lambda own: own[0])

    def check(self, low: Array, high: Array, most: int = 64) -> None:
        """Refuse a box of sizes at corners of which the body has another shape; so many at most are looked at."""
        count = len(self.sizes)
        ends = (
            np.array(list(product((0, 1), repeat=count))) if 2**count <= most
            else np.random.default_rng(0).integers(0, 2, (most, count))
        )  # fmt: skip
        for values in low + (high - low) * ends:
            _corners_of_parts(self, values)

    def named(self, own: MovingPart, facet: int) -> str:
        """Return the face of the body that a facet of a part belongs to, in words."""
        face, body = int(own.faces[facet]), f"of body '{self.body.name}'"
        if face < 0:
            return f"a cut {body}"
        return f"{faces_text(self.body, (face,))} {body}"

    def parted(self) -> str:
        """Return which faces move and not those that go on from them, nearly in one plane; "" where none are."""
        body = self.body.of_facets
        pairs, normals = neighbours([*body.faces])[0], body.face_planes[0]
        moved = np.abs(self.faces).max(axis=1, initial=0.0) > 0.0
        turned = (normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1)
        pairs = pairs[(turned > GENTLE) & (moved[pairs[:, 0]] != moved[pairs[:, 1]])]
        move, stay = (faces_text(body, np.unique(pairs[moved[pairs] == own]).tolist()) for own in (True, False))
        return f"{move} move, and {stay}, which go on from there, do not" if len(pairs) else ""

    def inclined(self) -> str:
        """Return a face that a scale along an axis turns, "" where none is turned."""
        for own in (own for own in self.parts if own.faces.max() >= 0 or self.body.exact is None):
            for size in (size for size in self.sizes if not size.is_length):
                turned = own.part.normals @ size.directions()
                along = (turned * own.part.normals).sum(axis=1)[:, None] * own.part.normals
                bad = np.flatnonzero(np.abs(turned - along).max(axis=1) > DEFAULT.nominal)
                if bad.size:
                    return f"size '{size.name}' turns {self.named(own, int(bad[0]))}"
        return ""


@lru_cache(maxsize=128)
def at_scale(body: Body, scale: float) -> Body:
    """Return a body scaled about its seed, of which a size is what it is of the body itself, and grows with it.

    So the body at sizes, scaled, is this one at the same sizes.
    """
    return body if scale == 1.0 else replace(body.scaled(scale), at_scale=(body, scale))


@lru_cache(maxsize=16)
def fit_for_sizes(body: Body, sizes: tuple[Size, ...]) -> Body:
    """Return a body whose parts can follow sizes of its faces: itself, or the same solid cut between its features."""
    # all over their tolerances where one can, else near what is drawn; itself where none can, and `Resizing.of` says
    # why
    if body.at_scale is not None:
        return at_scale(fit_for_sizes(body.at_scale[0], sizes), body.at_scale[1])
    lengths = [size for size in sizes if size.is_length]
    if not lengths or body.is_surface or not body.triangles or len(body.parts) == 1:
        return body
    near = (-HARDLY * body.size, HARDLY * body.size)
    boxes = dict.fromkeys([tuple(size.tolerance or near for size in lengths), (near,) * len(lengths)])
    rules = range(len(RULES) if sum(map(len, body.triangles)) <= MOST_FOR_RULES else 1)
    for low, high in (np.array(box).T for box in boxes):
        for rule in (None, *rules):
            with suppress(InputError):
                cut = body if rule is None else _by_features(body, rule)
                Resizing.of(cut, lengths).check(low, high, FEW)
                return cut
    return body


@lru_cache(maxsize=16)
def _by_features(body: Body, rule: int) -> Body:
    """Return the same solid cut between its features, with what its facets stand for."""
    return _with_faces_moved(body, body.by_features(rule), np.zeros(len(body.faces)))


resizing_of = lru_cache(maxsize=32)(Resizing.of)


def resized(body: Body, made: Mapping[Size, float]) -> Body:
    """Return a body at given sizes: scaled first, then its faces moved outward along their normals.

    Vertices keep their labels where each stays one; else they are numbered anew.

    `made`: deviations from drawn; sizes that are not there are as drawn. Raises `InputError` where a face vanishes or a
    part does, with the face.
    """
    return _resized(body, tuple((size.of_body("movable"), value) for size, value in made.items()))


@lru_cache(maxsize=128)  # alike for sizes of the other body, and for each contact that is judged at the same sizes
def _resized(body: Body, deviations: tuple[tuple[Size, float], ...]) -> Body:
    made = dict(deviations)
    scaled = _scaled(body, made)
    lengths, values, offsets = _lengths(body, made)
    if not lengths:
        return scaled
    found = None
    if body.is_surface:
        with _at(body, lengths, values):
            found = _with_faces_moved(scaled, _surface_resized(scaled, offsets), offsets)
    else:
        found = on_true_faces(scaled, offsets, partial(_with_corners, lengths))
    if found is None:
        found = _with_faces_moved(scaled, _offset(resizing_of(scaled, lengths, drawn=body), values), offsets)
    return replace(found, drawn=body)


def _lengths(body: Body, made: Mapping[Size, float]) -> tuple[tuple[Size, ...], Array, Array]:
    """Return the sizes that are lengths off what is drawn, by how much, (k,), and how far faces move out, (faces,)."""
    lengths = {size: value for size, value in made.items() if size.is_length and value}
    values, every = np.array([*lengths.values()]), [size for size in made if size.is_length]
    return tuple(lengths), values, offsets_of_faces(body, every) @ np.array([made[size] for size in every])


def _with_faces_moved(body: Body, made: Body, offsets: Array) -> Body:
    """Return a body made with faces moved outward, (faces,), with what its facets stand for, where that is known."""
    errors, rows = facet_errors(body) if body.surfaces is not None else None, rows_moved(body, made, offsets)
    if rows is None:
        return made
    if errors is None:
        return made if body.facet_errors is None else replace(made, facet_errors=frozen(body.facet_errors[rows]))
    surfaces = moved_surfaces(body, offsets)
    if surfaces is None:
        return made
    surfaces = tuple((own, tuple(np.flatnonzero(np.isin(rows, of)).tolist())) for own, of in surfaces)
    return replace(made, surfaces=surfaces, facet_errors=errors_about(made, surfaces, errors[rows]))


def _facets_within(
    body: Body, exact: ExactPoints, sizes: Sequence[Size], offsets: Array, turns: Array
) -> list[tuple[Ints, Array]]:
    """Return the same as `_facets` of a body that is exact at points of its round faces."""
    # corners on a shaft stay on it, so that its facets, which are chords, move by less than it grows; those of a bore,
    # which are its tangents, as it does. A piece at a point goes with the true faces there, without turning
    facets, moved = exact.facets, offsets.copy()
    true = MovesOfFaces.of(facets, sizes, offsets, turns)
    corners, owners = facets.face_triangles
    for surface, rows in round_surfaces(facets):
        for row in rows if side_of(facets, surface, rows[0]) > 0.0 else ():
            n = facets.face_planes[0][row]
            bent = surface.misses(corners[owners == row].reshape(-1, 3))[1] @ n
            moved[row] = bent.mean() * true.lengths[row] + n @ true.shifts[row]
    within = _facets(facets, sizes, moved)
    found, k = list[tuple[Ints, Array]](), 0
    for part in body.parts[: len(body.parts) - len(exact.pieces)]:
        while (same := _same_facets(part, facets.parts[k])) is None:
            k += 1
        found.append((within[k][0][same], within[k][1][same]))
        k += 1
    for part, piece in zip(body.parts[len(found) :], exact.pieces, strict=True):
        move = true.at(body.vertices[piece.first - 1], piece.rows, piece.normals)
        found.append((np.full(len(part.loops), -1), part.normals @ move))
    return found


def _same_facets(part: ConvexPart, other: ConvexPart) -> Ints | None:
    """Return which facets of another part those of one within it are parallel to; None where it is not within."""
    cosines = part.normals @ other.normals.T
    out = (part.vertices @ other.normals.T - other.levels).max()
    if cosines.max(axis=1).min() < 1.0 - DEFAULT.nominal or out > DEFAULT.planarity * float(np.ptp(part.vertices)):
        return None
    return np.asarray(cosines.argmax(axis=1))


def each_resized(bodies: Mapping[str, Body], values: Mapping[Size, float]) -> dict[str, Body]:
    """Return bodies, by the names that sizes have for them, with each its own sizes off by as much."""
    return {
        name: resized(body, {size: x for size, x in values.items() if size.body == name})
        for name, body in bodies.items()
    }


def _surface_resized(body: Body, offsets: Array) -> Body:
    """Return a body kept as its surface with faces moved outward, (faces,): corners stay where the same faces meet."""
    # faces that meet in a corner must agree on where it goes, and no face may vanish or meet others than as drawn
    triangles = np.concatenate([np.array(own) for own in body.triangles])
    places = (body.vertices + _surface_moves(body, offsets))[: triangles.max() + 1]  # the parts' apexes come after
    surface = surface_with_corners(body, places)
    made = _same_pyramids(body, places, triangles)
    if made is None:
        anew = pyramids(places, surface.triangles, body.name)
        made = Body._of_surface(anew, body.seed, body.name, notes=body.notes, moved=0.0)
    return replace(made, deviation=body.deviation, unit=body.unit)


def _surface_moves(body: Body, offsets: Array) -> Array:
    """Return how the corners of a body kept as its surface move where its faces move outward, (n, 3); 0 of apexes."""
    triangles, owners = np.concatenate([np.array(own) for own in body.triangles]), body.face_triangles[1]
    around, normals, moves = faces_around(body), body.face_planes[0], np.zeros_like(body.vertices)
    for row in np.unique(triangles[offsets[owners] != 0.0]).tolist():
        own = sorted(around[row])
        move = _agree(normals[own], offsets[own])
        if move is None:
            listed = ", ".join(f"F{face + 1}" for face in own)
            raise InputError(f"a corner would split, as the faces {listed} that meet there move apart")
        moves[row] = move
    return moves


def _same_pyramids(body: Body, places: Array, triangles: Ints) -> Body | None:
    """Return a body kept as its surface with its corners elsewhere and the same parts; None where one is not convex."""
    rows = {tuple(point): k for k, point in enumerate(body.vertices[: len(places)].tolist())}
    bases = [np.array([rows[tuple(point)] for point in part.vertices[:-1].tolist()]) for part in body.parts]
    holders, near = [set[int]() for _ in places], DEFAULT.planarity * body.size**2
    for k, (part, base) in enumerate(zip(body.parts, bases, strict=True)):
        sides = np.roll(places[base], -1, axis=0) - places[base]
        if (np.cross(sides, np.roll(sides, -1, axis=0)) @ part.normals[0]).min() <= near:
            return None
        for row in base.tolist():
            holders[row].add(k)
    groups = [set.intersection(*(holders[row] for row in triangle)) for triangle in triangles.tolist()]
    if not all(groups):
        return None
    corners, sizes = np.concatenate(bases), np.array(list(map(len, bases)))
    tips = apexes(places, triangles, np.array([min(own) for own in groups]), corners, sizes, body.name)
    parts = zip(body.parts, bases, tips, strict=True)
    placed = tuple(part.placed(np.vstack([places[base], tip]), body.seed) for part, base, tip in parts)
    return replace(body, vertices=frozen(np.vstack([places, tips])), parts=placed)


def planes_made(body: Body, made: Mapping[Size, float]) -> list[tuple[Array, Array]]:
    """Return the normals of each part's facets at given sizes, and how far they are from the body's seed then."""
    # of round faces those between their corners on the true ones; cuts of such bodies, made anew, are as drawn
    if body.is_surface:
        made_body = resized(body.full_body or body, made)
        parts = made_body.subset(body.part_indices).parts if body.full_body is not None else made_body.parts
        return [(part.normals, part.levels - part.normals @ part.seed) for part in parts]
    scaled, (lengths, values, offsets) = _scaled(body, made), _lengths(body, made)
    planes = [(part.normals.copy(), part.levels - part.normals @ scaled.seed) for part in scaled.parts]
    if not lengths:
        return planes
    places = corners_on_true_faces(scaled, offsets)
    if places is None:
        moved = Resizing.of(scaled, lengths, drawn=body).parts
        return [(normals, levels + own.offsets @ values) for (normals, levels), own in zip(planes, moved, strict=True)]
    far = norms(places - scaled.vertices) > 0.0
    for owners, (normals, levels) in zip(scaled.facet_faces, planes, strict=True):
        for k, face in ((k, own[0]) for k, own in enumerate(owners) if own):
            rows = np.array(scaled.faces[face]) - 1
            if far[rows].any():
                middle = places[rows].mean(axis=0)
                normal = np.linalg.svd(places[rows] - middle)[2][2]
                normals[k] = normal * np.sign(normal @ normals[k])
                levels[k] = normals[k] @ (middle - scaled.seed)
    return planes


def vertex_rates(body: Body, made: Mapping[Size, float], size: Size) -> Array | None:
    """Return how the vertices of a body made move a unit of one of its sizes, (n, 3), to first order, by labels."""
    # None where the body made has other vertices than the one drawn, and where a scale turns faces that others move
    if not size.is_length:
        turns = any(own.is_length and x for own, x in made.items()) and Resizing.of(body, (size,)).inclined()
        return None if turns else (body.vertices - body.seed) @ size.directions()
    if body.is_surface:
        return _surface_moves(body, offsets_of_faces(body, (size,))[:, 0])
    scaled = _scaled(body, made)
    rates = rates_on_true_faces(scaled, _lengths(body, made)[2], size) if round_surfaces(scaled) else None
    if rates is not None:
        for row in np.flatnonzero(np.isnan(rates).any(axis=1)).tolist():
            rates[row] = _rate_of_parts(scaled, body, size, scaled.vertices[row])
        return rates
    moving = Resizing.of(scaled, (size,), drawn=body)
    kept = _kept_numbers(moving, np.ones(1), {})
    found = _corners_moved(moving, np.ones(1)) if kept is None else (kept[0][: len(moving.body.vertices)], {})
    return None if found is None or found[1] else found[0] - moving.body.vertices


def _rate_of_parts(body: Body, drawn: Body, size: Size, point: Array) -> Array:
    """Return how a corner of parts moves with the planes of their facets, of cuts too, (3,); nan where it is none."""
    with suppress(InputError):
        parts = resizing_of(body, (size,), drawn=drawn).parts
        moves = np.concatenate([own.moves[(own.points == point).all(axis=1), :, 0] for own in parts])
        if len(moves) and np.ptp(moves, axis=0).max() <= DEFAULT.nominal:
            return np.asarray(moves[0])
    return np.full(3, np.nan)


def exact_vertex_rates(body: Body, drawn: Body, made: Mapping[Size, float], size: Size) -> Array | None:
    """Return the same of a body that is exact at points: there it goes with the face, without turning."""
    # nan for vertices of facets that were moved. None where the body made has other faces than the one drawn
    assert body.exact is not None
    if body.exact.facets.faces != drawn.faces:
        return None
    rates, known = np.full((len(body.vertices), 3), np.nan), vertex_rates(drawn, made, size)
    if known is not None:
        rates[: len(known)] = known
    moves = MovesOfFaces.of(drawn, (size,))
    for piece in body.exact.pieces:
        rates[piece.first - 1 : piece.last] = moves.at(body.vertices[piece.first - 1], piece.rows, piece.normals)[:, 0]
    return rates


def true_point_rate(body: Body, drawn: Body, made: Mapping[Size, float], size: Size, point: Array) -> Array:
    """Return how a point of a body's true faces moves, also of one exact at points, (3,)."""
    # nan where it is of none, where plane ones alone meet, and where the body made has other faces than the one drawn;
    # off round faces a corner of parts goes with the planes of their facets: they may go on beyond the face
    facets = body.of_facets
    faces = true_faces(facets)
    near = faces.at(point, faces.slack)
    is_round = faces.is_round[near].any()
    own = (
        _rate_of_parts(body, drawn, size, point) if not is_round and facets.faces == drawn.faces else np.full(3, np.nan)
    )
    if np.isfinite(own).all():
        return own
    alike = len(near) == 1 or is_round
    of_drawn = rows_moved(_scaled(drawn, made), facets, _lengths(drawn, made)[2]) if alike else None
    if of_drawn is None:
        return np.full(3, np.nan)
    rows = [int(of_drawn[faces.row_at(k, point)]) for k in near]
    normals = np.concatenate([faces.patches[k].gaps(point[None])[1] for k in near])
    return MovesOfFaces.of(drawn, (size,)).at(point, rows, normals)[:, 0]


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
        if straight and np.ptp(diagonal) == 0.0:
            scaled = scaled._on_surfaces(about(body.seed, float(diagonal[0])), float(diagonal[0]))
        else:  # round faces are recognised anew, where they are still round
            scaled = replace(scaled, surfaces=None, facet_errors=None)
    return scaled


def resized_part_corners(body: Body, made: Mapping[Size, float]) -> list[Array]:
    """Return the corners at given sizes of each part as drawn, however the body made is cut; raises as `resized`."""
    scaled, (lengths, values, _) = _scaled(body, made), _lengths(body, made)
    if not lengths:
        return [part.vertices for part in scaled.parts]
    return _moved_corners(resizing_of(scaled, lengths, drawn=body), values)[0]


def _moved_corners(moving: Resizing, values: Array) -> tuple[list[Array], dict[int, Array]]:
    """Return the corners of each part, (m, 3), and by number those of parts that have others than as drawn."""
    near, found, changed = DEFAULT.planarity * moving.body.size, [], dict[int, Array]()
    for k, own in enumerate(moving.parts):
        depth, change = own.slack
        low = np.where(np.isinf(depth), np.inf, depth + change @ values).min(axis=0)
        points = own.at(values)
        if own.split.any():  # of a corner that splits those triples that no other of its facets cuts off
            points = changed[k] = points[(np.where(np.isinf(depth), change @ values, 0.0) >= -near).all(axis=1)]
        if low.min() <= near:
            points = changed[k] = _intersected(moving, own, values, int(low.argmin()))
        found.append(points)
    return found, changed


def _corners_of_parts(
    moving: Resizing, values: Array
) -> tuple[list[Array], tuple[Array, list[list[int]]] | None, Surface | None, bool]:
    """Return the corners of each part at given sizes, see `_kept_numbers`, and of a solid its surface if known.

    And whether all parts have the corners and facets that they have as drawn. No numbers where a corner splits, or a
    convex body has other edges.
    """
    body, (found, changed) = moving.body, _moved_corners(moving, values)
    numbered = _kept_numbers(moving, values, changed) if not (changed and len(found) == 1) else None
    surface = None
    if numbered is None:
        return found, None, None, False
    if body.triangles and len(found) > 1:
        with _at(body, moving.sizes, values):
            surface = surface_with_corners(body, numbered[0])
            _check_filled(body, found, surface)
    return found, numbered, surface, not changed


def _with_corners(sizes: Sequence[Size], body: Body, places: Array) -> Body | None:
    """Return a solid with its corners elsewhere, its faces in parallel to those drawn, and the same parts."""
    # cuts go with the faces. None where faces turn, or parts would have other facets than as drawn
    if len(body.parts) == 1 or body.exact is not None:
        return None
    normals, near = body.face_planes[0], DEFAULT.nominal * body.size
    off = [(places - body.vertices)[np.array(face) - 1] @ n for face, n in zip(body.faces, normals, strict=True)]
    if max(map(np.ptp, off)) > near:
        return None
    offsets, still = np.array([own.mean() for own in off])[:, None], np.zeros((1, 3, 3))
    parts = (_moving(body, k, sizes[:1], own, still) for k, own in enumerate(_facets(body, sizes[:1], offsets)))
    moving, corners = Resizing(body, tuple(sizes[:1]), offsets, tuple(parts), np.zeros(1)), np.array(body.corners) - 1
    _, numbered, _, same = _corners_of_parts(moving, np.ones(1))
    if numbered is None or not same or np.abs(numbered[0][corners] - places[corners]).max() > near:
        return None
    rows, its = numbered
    rows[corners] = places[corners]
    return _as_drawn(body, rows, its, surface_with_corners(body, rows))


def _as_drawn(body: Body, rows: Array, parts: list[list[int]], surface: Surface) -> Body | None:
    """Return a solid with vertices elsewhere, elements of its parts as drawn; None where faces are others."""
    # so where elements lie is looked for once a body, and not at each of its sizes
    if tuple(tuple(sorted(row + 1 for row in face)) for face in surface.faces) != body.faces:
        return None
    row_of = {point: row for row, point in enumerate(map(tuple, body.vertices.tolist()))}

    def moved(points: Array, places: Mapping[tuple[float, ...], int]) -> Array:
        there = [places[tuple(point)] for point in points.reshape(-1, 3).tolist()]
        return frozen(rows[there].reshape(points.shape))

    def named(element: Element, labels: Mapping[int, int]) -> Element:
        return Element(element.kind, tuple(sorted(labels.get(label, label) for label in element.vertices)))

    each = zip(body.parts, parts, strict=True)
    there = [dict(zip(map(tuple, part.vertices.tolist()), own, strict=True)) for part, own in each]
    parted = [{point: row for point, row in own.items() if row_of[point] != row} for own in there]
    whole = {point: row for point, row in row_of.items() if not any(point in own for own in parted)}
    placed = list[ConvexPart]()
    with suppress(KeyError):  # of a face with points that are no vertices, or of parts that do not meet there now
        for part, own, its, new in zip(body.parts, parts, there, parted, strict=True):
            spans = {
                key: Span(moved(span.corners, its), span.elements, tuple(moved(each, whole) for each in span.regions))
                for key, span in part.elements.spans.items()
            }
            labels = {row_of[point] + 1: row + 1 for point, row in new.items()}
            v, e, f = ([named(element, labels) for element in own] if labels else own for own in part.elements.values())
            placed.append(replace(part.placed(rows[own], body.seed), elements=Elements(v, e, f, spans)))
        return replace(body, vertices=frozen(rows), parts=tuple(placed), triangles=surface.triangles_of_faces())
    return None


def _offset(moving: Resizing, values: Array) -> Body:
    body, (points, numbered, surface, same) = moving.body, _corners_of_parts(moving, values)
    if numbered is None:
        with suppress(InputError):
            if (anew := _cut_anew(moving, values)) is not None:
                return anew
        made = Body.from_parts(points, seed=body.seed, name=body.name, unit=body.unit)
        if body.triangles and rows_moved(body, made, moving.faces @ values) is None:
            with _at(body, moving.sizes, values):
                raise InputError("cuts between its parts do not go with its faces, and corners part")
        return replace(made, deviation=body.deviation)
    rows, parts = numbered
    if len(body.parts) == 1:
        part = body.parts[0]
        return replace(body, vertices=frozen(rows), parts=(part.placed(rows[parts[0]], body.seed),))
    with _at(body, moving.sizes, values):
        if surface is not None:
            if same and (made_alike := _as_drawn(body, rows, parts, surface)) is not None:
                return made_alike
            made = Body._made(rows, [np.array(part) for part in parts], None, body.seed, body.name, surface=surface)
        else:
            faces = [[label - 1 for label in face] for face in body.outlines]
            made = Body.from_parts(rows, parts=parts, faces=faces, seed=body.seed, name=body.name)
    return replace(made, notes=body.notes, deviation=body.deviation, unit=body.unit)


def _cut_anew(moving: Resizing, values: Array) -> Body | None:
    """Return a solid of several parts by where its faces meet now; None where that is not known."""
    # its cuts do not go with the faces: what they bound besides would stick out, or be missing
    body = moving.body
    found = _corners_moved(moving, values) if len(body.parts) > 1 and body.triangles else None
    if found is None:
        return None
    triangles = surface_with_corners(body, *found).triangles_of_faces()
    return replace(body, vertices=frozen(found[0]), triangles=triangles).by_features(0)


def _corners_moved(moving: Resizing, values: Array) -> tuple[Array, dict[tuple[int, int], list[int]]] | None:
    """Return the vertices of the body, its corners where their faces meet now, (n, 3); None where that is not known.

    And by face and corner which rows are corners of the face in place of one that splits, of which one has its label.
    """
    body, rows, split = moving.body, list(moving.body.vertices), dict[tuple[int, int], list[int]]()
    for label in body.corners:
        move = _move_of_corner(moving, values, label)
        parted = split_corner(body, moving.faces @ values, label - 1) if move is None and body.triangles else None
        if parted is not None:
            numbers = [label - 1, *range(len(rows), len(rows) + len(parted[0]) - 1)]
            split |= {(face, label - 1): [numbers[k] for k in own] for face, own in parted[1].items()}
            rows[label - 1] = parted[0][0]
            rows += list(parted[0][1:])
        elif move is None:
            return None
        else:
            rows[label - 1] = rows[label - 1] + move
    return np.array(rows), split


def _move_of_corner(moving: Resizing, values: Array, label: int) -> Array | None:
    """Return where the faces that meet in a corner move it, (3,); None where they part or are no three."""
    body, normals = moving.body, moving.body.face_planes[0]
    around = [body.face_rows[face] for face in body.faces_with((label,))]
    own = normals[around]
    return None if np.linalg.matrix_rank(own) < 3 else _agree(own, moving.faces[around] @ values)


@contextmanager
def _at(body: Body, sizes: Sequence[Size], values: Array) -> Iterator[None]:
    """Say of a body that is refused meanwhile at which sizes it was made."""
    try:
        yield
    except InputError as reason:
        names = ", ".join(f"{size.name} = {x:.6g}" for size, x in zip(sizes, values, strict=True))
        what = f"the body changes its shape at these sizes: {reason.what}"
        allowed = reason.allowed or "smaller deviations"
        raise InputError(what, key=f"body '{body.name}'", found=names, allowed=allowed) from reason


def _check_filled(body: Body, parts: list[Array], surface: Surface) -> None:
    """Refuse corners of parts side by side that no longer fill the solid's surface, as they do as drawn."""
    from scipy.spatial import ConvexHull

    drawn, made = (
        (sum(float(ConvexHull(points - points[0]).volume) for points in own), volume_and_centroid(corners)[0])
        for own, corners in (
            (
                [part.vertices for part in body.parts],
                body.vertices[np.concatenate(list(map(np.array, body.triangles)))],
            ),
            (parts, surface.points[surface.triangles]),
        )
    )
    if abs(drawn[0] - drawn[1]) <= DEFAULT.nominal * drawn[1] < abs(made[0] - made[1]):
        raise InputError("the parts that it is cut into no longer fill it")


def _intersected(moving: Resizing, own: MovingPart, values: Array, facet: int) -> Array:
    """Return the corners of a part some of whose edges are others than as drawn; refuse it if nothing is left."""
    # of a convex body no face may be gone. A part of a solid may lose some, which `_surface` judges
    part, centre, near = own.part, own.part.vertices.mean(axis=0), DEFAULT.nominal * moving.body.size
    levels = (part.normals * (part.bases - centre)).sum(axis=1) + own.offsets @ values
    corners = corners_within(part.normals, levels, DEFAULT.planarity * moving.body.size)
    on = np.zeros((0, len(levels)), bool) if corners is None else np.abs(corners @ part.normals.T - levels) <= near
    if corners is None or (len(moving.parts) == 1 and on.sum(axis=0).min() < 3):
        gone = facet if corners is None else int(on.sum(axis=0).argmin())
        share = moving.valid_up_to(np.minimum(values, 0.0), np.maximum(values, 0.0))[0]
        with _at(moving.body, moving.sizes, values):
            allowed = f"deviations of less than {100.0 * share:.4g} % of these"
            raise InputError(f"what it has beside {moving.named(own, gone)} vanishes", allowed=allowed)
    return centre + np.array([np.linalg.lstsq(part.normals[row], levels[row])[0] for row in np.unique(on, axis=0)])


def _kept_numbers(
    moving: Resizing, values: Array, changed: Mapping[int, Array]
) -> tuple[Array, list[list[int]]] | None:
    """Return the vertices of the body at given sizes, and the rows of each part's; None where a corner splits."""
    # all keep their labels; points of cuts where parts as made no longer meet, or meet others, are added: the corners
    # of parts that changed are given
    body, corners = moving.body, {label - 1 for label in moving.body.corners}
    drawn = dict[tuple[float, ...], list[int]]()
    for row, point in enumerate(map(tuple, body.vertices.tolist())):
        drawn.setdefault(point, []).append(row)
    new, known = list(body.vertices), set[int]()

    def numbered(place: Array, rows: list[int], near: float) -> int:
        for row in rows:
            if np.abs(new[row] - place).max() <= near:
                return row
        new.append(place)
        rows.append(len(new) - 1)
        return rows[-1]

    parts, near = list[list[int]](), DEFAULT.planarity * body.size
    for k, own in enumerate(moving.parts):
        parts.append([])
        if k in changed:
            continue
        moves = own.moves[np.unique(own.vertices, return_index=True)[1]] @ values  # of a corner of each vertex
        for point, move in zip(map(tuple, own.part.vertices.tolist()), moves, strict=True):
            place, rows = np.array(point) + move, drawn[point]
            for row in rows:
                if row not in known and row < len(body.vertices):
                    new[row] = place
                    known.add(row)
                elif row in corners and np.abs(new[row] - place).max() > near:
                    return None
            parts[k].append(numbered(place, rows, near))
    for row in sorted(corners - known):  # where parts that overlap cross, or changed: by the faces that meet there
        move = _move_of_corner(moving, values, row + 1)
        if move is None:
            return None
        new[row] = new[row] + move
        known.add(row)
    some = np.array(sorted(known))
    for row in sorted(set(range(len(body.vertices))) - known):  # no corner of any part: with the nearest one
        new[row] = new[some[norms(body.vertices[some] - body.vertices[row]).argmin()]]
    every = [*known, *range(len(body.vertices), len(new))]
    for k, points in changed.items():
        parts[k] = [numbered(place, every, DEFAULT.nominal * body.size) for place in points]
    return np.array(new), parts


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


def _moving(body: Body, place: int, sizes: Sequence[Size], facets: tuple[Ints, Array], turns: Array) -> MovingPart:
    part, (faces, lengths) = body.parts[place], facets
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
        n = part.normals[around]
        whole = _agree(n, lengths[around])
        if whole is not None:
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
    points = part.vertices[vertices]
    moves = moves + np.einsum("kxy,ty->txk", turns, points - body.seed)
    return MovingPart(part, faces, offsets, triples, vertices, points, moves, split)


def _fan(around: Ints, normals: Array) -> Ints:
    """Return triples of the facets round a corner, whose cones of normals fill that of the corner."""
    middle = normals.sum(axis=0)
    first = normals[0] - normals[0] @ middle / (middle @ middle) * middle
    second = np.cross(middle, first) / np.linalg.norm(middle)
    ring = around[np.argsort(np.arctan2(normals @ second, normals @ first), kind="stable")]
    return np.array([[ring[0], ring[k], ring[k + 1]] for k in range(1, len(ring) - 1)])


class _Cut(NamedTuple):
    """Facets of parts that lie on one another in the solid's interior: one piece of a plane that it is cut along."""

    normal: Array  # (3,)
    facets: list[tuple[int, int, float]]  # part, facet of it, and 1 or -1: whether it looks along the normal
    # labels of the solid's corners and edges that the piece's corners lie on, rows of the faces there, and the factors
    # of their normals that add up to its own: those carry the cut along
    elements: list[tuple[tuple[int, ...], list[int], Array | None]]


@lru_cache(maxsize=16)
def _cuts(body: Body) -> list[_Cut]:
    """Return the cuts between a body's parts."""
    near, where, rows = DEFAULT.nominal, list[tuple[int, int]](), list[Array]()
    for place, (part, owners) in enumerate(zip(body.parts, body.facet_faces, strict=True)):
        where += [(place, k) for k, own in enumerate(owners) if not own]
        rows += [np.append(part.normals[k], part.levels[k] / body.size) for k, own in enumerate(owners) if not own]
    if not rows:
        return []
    planes = np.array(rows)
    polygons = [body.parts[place].vertices[list(body.parts[place].loops[k])] for place, k in where]
    links = []
    for i, plane in enumerate(planes[:-1]):
        for j in i + 1 + np.flatnonzero(np.abs(planes[i + 1 :] + plane).max(axis=1) <= near):
            one, two = (polygons[k] / body.size for k in (i, j))
            if area(inside(one, two, -plane[:3])) > near:
                links.append((i, j))
    groups = groups_of(components(np.array(links, np.int64).reshape(-1, 2), len(where)))
    found = []
    for group in map(np.ndarray.tolist, groups):
        sides = np.sign(planes[group, :3] @ planes[group[0], :3]).tolist()
        its = {
            body.parts[place].elements["V"][v].vertices: None
            for place, k in (where[row] for row in group) for v in body.parts[place].loops[k]
        }  # fmt: skip
        facets = [(*where[row], side) for row, side in zip(group, sides, strict=True)]
        normal, around = planes[group[0], :3], [[body.face_rows[face] for face in body.faces_with(own)] for own in its]
        factors = (_combined(body.face_planes[0][faces], normal) for faces in around)
        found.append(_Cut(normal, facets, list(zip(its, around, factors, strict=True))))
    return found


def _facets(body: Body, sizes: Sequence[Size], face_offsets: Array) -> list[tuple[Ints, Array]]:
    """Return of each part the face that each facet moves with, -1 for a cut, and how far outward by size, (f, k)."""
    # a cut moves with the solid's corners and edges on it, else with the faces in its plane, else not at all
    normals, points = body.face_planes
    found = []
    for part, owners in zip(body.parts, body.facet_faces, strict=True):
        faces, moved = np.full(len(part.loops), -1), np.zeros((len(part.loops), len(sizes)))
        for k, own in enumerate(map(list, owners)):
            if own:
                _check_one_plane(body, sizes, own, face_offsets[own])
                faces[k], moved[k] = own[0], face_offsets[own[0]]
        found.append((faces, moved))
    for cut in _cuts(body):
        shifts = []
        for _, rows, across in cut.elements:
            off = face_offsets[rows]
            if across is not None and _agree(normals[rows], off) is not None:
                shifts.append(across @ off)
        if shifts and np.ptp(shifts, axis=0).max(initial=0.0) <= DEFAULT.nominal:
            offset = shifts[0]
        else:
            place, k, _ = cut.facets[0]
            level = points @ cut.normal - body.parts[place].vertices[body.parts[place].loops[k][0]] @ cut.normal
            along = normals @ cut.normal
            own = np.flatnonzero(
                (np.abs(level) <= DEFAULT.nominal * body.size) & (np.abs(np.abs(along) - 1.0) <= DEFAULT.nominal)
            ).tolist()
            if shifts and not own:
                size = sizes[int(np.ptp(shifts, axis=0).argmax())]
                labels = dict.fromkeys(label for own, *_ in cut.elements for label in own)
                plane = f"a plane through {', '.join(f'V{label}' for label in labels)}"
                what = f"body '{body.name}' is cut along {plane}, which this size would take out of it"
                allowed = "a scale, or faces away from such a cut"
                raise InputError(what, key=f"size '{size.name}'.faces", found=size.faces, allowed=allowed)
            offsets = np.sign(along[own])[:, None] * face_offsets[own]
            _check_one_plane(body, sizes, own, offsets)
            offset = offsets[0] if own else np.zeros(len(sizes))
        for place, k, side in cut.facets:
            found[place][1][k] = side * offset
    return found


def _combined(normals: Array, normal: Array) -> Array | None:
    """Return factors of normals, (m, 3), that add up to a normal; None where it is not among their sums."""
    if not len(normals):
        return None
    factors = np.asarray(np.linalg.lstsq(normals.T, normal)[0], dtype=np.float64)
    return factors if np.abs(factors @ normals - normal).max() <= DEFAULT.nominal else None


def _agree(normals: Array, offsets: Array) -> Array | None:
    """Return how a point on faces moves as they do, (3, k); None where it does not stay one point."""
    if not offsets.any():
        return np.zeros((3, *offsets.shape[1:]))  # as most faces are still, and this is asked of every corner
    move = np.asarray(np.linalg.lstsq(normals, offsets)[0], dtype=np.float64)
    off = np.abs(normals @ move - offsets).max(initial=0.0)
    return move if off <= DEFAULT.planarity * max(1.0, float(np.abs(offsets).max(initial=0.0))) else None


def _check_one_plane(body: Body, sizes: Sequence[Size], faces: Sequence[int], offsets: Array) -> None:
    wrong = np.ptp(offsets, axis=0) > DEFAULT.nominal if len(faces) > 1 else np.zeros(1, bool)
    if wrong.any():
        names = ", ".join(f"F{face + 1}" for face in faces)
        raise InputError(
            f"body '{body.name}' is cut along the plane of faces {names}, which would no longer be one plane",
            key=f"size '{sizes[int(wrong.argmax())].name}'.faces", found=names,
            allowed="all of these faces, or none",
        )  # fmt: skip
