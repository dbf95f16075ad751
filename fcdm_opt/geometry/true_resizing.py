"""Parts with round faces at given sizes: their corners are where the true faces meet.

Their convex parts are those of the body drawn where these still fill it, else it is cut again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart, cached_per_body
from fcdm_opt.geometry.crossings import first_crossing
from fcdm_opt.geometry.facet_errors import errors_about, facet_errors, round_surfaces
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.moving_faces import MovesOfFaces, moved_surfaces
from fcdm_opt.geometry.naming import faces_text
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.surface import Surface, rims
from fcdm_opt.geometry.tessellation import RoundFaces, Swept, onto_crossings
from fcdm_opt.tolerances import DEFAULT

Cut = Callable[[Body, Array], Body | None]
"""Returns a solid with its corners elsewhere, (n, 3), cut into the same parts; None where it is not to be."""


def on_true_faces(body: Body, offsets: Array, cut_alike: Cut) -> Body | None:
    """Return a body with round faces whose faces moved outward, (faces,), with its corners on its true faces."""
    # it has the parts of the one drawn, where these still fill it, else it is cut into parts again. None where nothing
    # is round, what its faces are is not known, or it would change its shape
    moved = _moved(body, offsets)
    if moved is None or not (body.triangles or len(body.parts) == 1):
        return None
    rounds, true, places = moved
    try:
        made = None
        with suppress(InputError):  # of cuts that would part, or a point inside now
            made = cut_alike(body, places) or _of_same_part(body, places)
        if made is None:
            made, rounds = _cut_again(body, places, rounds, true)
    except InputError:
        return None
    errors = errors_about(made, rounds, np.zeros((len(made.faces), 2)))
    return replace(made, surfaces=rounds, facet_errors=errors, notes=body.notes, deviation=body.deviation)


def corners_on_true_faces(body: Body, offsets: Array) -> Array | None:
    """Return where the corners are of a body whose faces moved outward, (faces,), as of `on_true_faces`; (n, 3)."""
    moved = _moved(body, offsets)
    return None if moved is None else moved[2]


def rates_on_true_faces(body: Body, offsets: Array, size: Size) -> Array | None:
    """Return how the corners of faces moved outward, (faces,), go on with a size, (n, 3); None where none is round."""
    # nan of points of cuts
    moved = _moved(body, offsets)
    if moved is None:
        return None
    _, true, places = moved
    moves, rates = MovesOfFaces.of(body, (size,)), np.zeros_like(places)
    for row, around in enumerate(faces_around(body)):
        faces = sorted(around)
        if not faces:
            rates[row] = np.nan
        elif moves.turns.any() or any(own[faces].any() for own in (moves.lengths, moves.shifts, moves.rings)):
            looks = [true[face].misses(places[None, row])[1][0] for face in faces]
            out = np.sign([look @ body.face_planes[0][face] for look, face in zip(looks, faces, strict=True)])
            rates[row] = moves.at(places[row], faces, out[:, None] * np.array(looks))[:, 0]
    return rates


def surface_with_corners(
    body: Body, rows: Array, split: Mapping[tuple[int, int], Sequence[int]] | None = None
) -> Surface:
    """Return the surface of a solid whose corners are elsewhere; refuse it where faces meet others than as drawn.

    `split`: by face and corner, both as rows, the corners that a face has instead of one that parted.
    """
    from manifold3d import triangulate

    normals, triangles = body.face_planes[0], list[Ints]()
    for face, own in enumerate(body.triangles):
        own_corners, flat = {label - 1 for label in body.faces[face]}, np.linalg.svd(normals[[face]])[2][1:]
        flat = flat * [[1.0], [np.linalg.det(np.vstack([flat, normals[face]]))]]  # counter-clockwise stays so
        loops = [[v for v in loop if v in own_corners] for loop in rims(own)]
        if split:
            loops = [[new for v in loop for new in split.get((face, v), (v,))] for loop in loops]
        places = np.concatenate(loops)
        triangles.append(places[np.array(triangulate([rows[loop] @ flat.T for loop in loops]))])
    found, owners = np.concatenate(triangles), np.repeat(np.arange(len(triangles)), list(map(len, triangles)))
    corners = rows[found]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = (across * normals[owners]).sum(axis=1) / 2.0
    broad = np.flatnonzero(areas > DEFAULT.planarity * body.size**2)
    crossing = first_crossing(rows / body.size, found[broad], DEFAULT.planarity)
    if crossing is not None:
        one, two = sorted(owners[broad[[crossing.one, crossing.two]]].tolist())
        raise InputError(f"faces meet otherwise than as drawn: {faces_text(body, (one, two))}")
    if len(broad) < len(areas):
        face = int(owners[areas.argmin()])
        gone = np.bincount(owners, areas)[face] <= DEFAULT.planarity * body.size**2
        raise InputError(f"{faces_text(body, (face,))} {'vanishes' if gone else 'meets itself'}")
    return Surface.of(rows, found, owners)


def _moved(body: Body, offsets: Array) -> tuple[RoundFaces, list[Swept], Array] | None:
    """Return the round surfaces of a body whose faces moved outward, the surface of each face, and its corners on them.

    None where none is round, or what its faces are is not known, and where faces that meet as drawn no longer do.
    """
    rounds, errors = moved_surfaces(body, offsets), facet_errors(body)
    if not rounds or errors is None:
        return None
    true = _each_surface(body, rounds, offsets)
    known = all(error == 0.0 or not own.flat for own, error in zip(true, errors.max(axis=1), strict=True))
    places = _corners_on(true, body, offsets) if known else None
    return None if places is None else (rounds, true, places)


def _each_surface(body: Body, rounds: RoundFaces, offsets: Array) -> list[Swept]:
    """Return the surface of each face of a body whose faces moved outward, (faces,): of round ones as given."""
    normals, points = body.face_planes
    true = [Swept.plane(point, n) for point, n in zip(points + offsets[:, None] * normals, normals, strict=True)]
    for surface, rows in rounds:
        for row in rows:
            true[row] = surface
    return true


def _corners_on(true: Sequence[Swept], body: Body, offsets: Array) -> Array | None:
    """Return a body's corners where the true faces that meet in each are once faces have moved outward, (n, 3)."""
    # as far off them as drawn, by the digits of a file: facets stay in one plane with those of another part. None where
    # faces that meet as drawn no longer do, as a plane and a fillet of another radius
    drawn = _each_surface(body, round_surfaces(body), np.zeros(len(body.faces)))
    places, around = body.vertices.copy(), faces_around(body)
    middles = [body.vertices[np.array(own) - 1].mean(axis=0) for own in body.faces]
    shifted = {row: (own, true[row]) for own, rows in round_surfaces(body) for row in rows if own is not true[row]}
    rows = [row for row, own in enumerate(around) if offsets[list(own)].any() or not own.isdisjoint(shifted)]
    for row in rows:
        places[row] = _carried(places[row], *[shifted[face] for face in sorted(around[row]) if face in shifted][:1])
    meeting = [sorted(around[row]) for row in rows]
    near, both = DEFAULT.tie * body.size, (drawn, true)
    places[rows], off = onto_crossings(body.vertices[rows], places[rows], meeting, both, middles, near)
    return None if off.max(initial=0.0) > DEFAULT.snap * body.size else places


@cached_per_body
def faces_around(body: Body) -> list[set[int]]:
    """Return the rows of the faces at each vertex; none of cuts alone."""
    around = [set[int]() for _ in body.vertices]
    for face, labels in enumerate(body.faces):
        for label in labels:
            around[label - 1].add(face)
    for face, triangles in enumerate(body.triangles):  # points on edges that go on straight, too
        for row in chain.from_iterable(triangles):
            around[row].add(face)
    return around


def _carried(point: Array, *surfaces: tuple[Swept, Swept]) -> Array:
    """Return a point shifted as a surface was, and as its ring got wider."""
    for drawn, moved in surfaces:
        _, across, far = drawn.about(point[None])
        wider = (moved.ring - drawn.ring) * across[0] / far[0] if moved.ring != drawn.ring else 0.0
        point = point + moved.origin - drawn.origin + wider
    return point


def _of_same_part(body: Body, places: Array) -> Body | None:
    """Return a convex body with its corners elsewhere; None where it has other faces then, or cut into parts."""
    if len(body.parts) > 1:
        return None
    made = Body._made(places, body._part_rows, None, body.seed, body.name)
    if {*map(frozenset, made.faces)} != {*map(frozenset, body.faces)}:
        return None
    return replace(body, vertices=frozen(places), parts=(body.parts[0].placed(places[body._part_rows[0]], body.seed),))


def _cut_again(body: Body, places: Array, rounds: RoundFaces, true: Sequence[Swept]) -> tuple[Body, RoundFaces]:
    """Return a body with its corners elsewhere, cut into convex parts again, and its round faces.

    Raises `InputError` where it is one convex part, or where a face is none of its own.
    """
    if not body.triangles:
        raise InputError("the convex part has other faces")
    used, inverse = np.unique(np.concatenate([np.array(own) for own in body.triangles]), return_inverse=True)
    triangles = np.array(inverse, np.int64).reshape(-1, 3)
    made = Body.from_mesh(
        places[used], triangles, decomposition="exact", seed=body.seed, name=body.name, unit=body.unit
    )
    found = _faces_on([*(surface for surface, _ in rounds), *(own for own in true if own.flat)], made)
    if found is None or not all(found[: len(rounds)]):
        raise InputError("a face is on none of those drawn")
    made_rounds = tuple((surface, tuple(rows)) for (surface, _), rows in zip(rounds, found, strict=False))
    return replace(made, parts=_in_order(made, body)), made_rounds


def _in_order(made: Body, body: Body) -> tuple[ConvexPart, ...]:
    """Return the parts of a body that was cut again in the order of those drawn, where there are as many."""
    from scipy.optimize import linear_sum_assignment

    if len(made.parts) != len(body.parts):
        return made.parts
    new, old = ([part.vertices.mean(axis=0) for part in own.parts] for own in (made, body))
    order = linear_sum_assignment([[norms(x - y) for y in new] for x in old])[1]
    return tuple(made.parts[k] for k in order.tolist())


def _faces_on(surfaces: Sequence[Swept], made: Body) -> list[list[int]] | None:
    """Return which faces of a body are of each surface: their corners are on it. None where one is of none."""
    # of several surfaces, as of a cone at a plane's rim, that which looks most as the face does; of a bore and a flat
    # in it, whose corners are on both, the plane
    looks, found = made.face_planes[0], [list[int]() for _ in surfaces]
    on = np.array([np.abs(own.misses(made.vertices)[0]) <= DEFAULT.snap * made.size for own in surfaces])
    for face, labels in enumerate(made.faces):
        rows = np.array(labels) - 1
        middle, there = made.vertices[rows].mean(axis=0)[None], np.flatnonzero(on[:, rows].all(axis=1)).tolist()
        if not there:
            return None
        alike = [abs(surfaces[k].misses(middle)[1][0] @ looks[face]) + DEFAULT.snap * surfaces[k].flat for k in there]
        found[there[int(np.argmax(alike))]].append(face)
    return found
