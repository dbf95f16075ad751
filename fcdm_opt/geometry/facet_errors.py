"""How far facets leave the round faces that they stand for, and bodies that the true one lies between.

STEP files say what their faces are. Of a mesh, facets side by side whose corners all lie on one cylinder, cone, sphere
(`naming.round_faces`) or torus are taken for that surface. With each facet moved by its own error, inward where it
sticks out and outward where it falls short, a body becomes one that the true body holds, and one that holds it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints, distinct_rows, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.elements import own_elements
from fcdm_opt.geometry.hull import Hull, convex_hull
from fcdm_opt.geometry.measures import least_vector, norms, unit_normals
from fcdm_opt.geometry.naming import FEWEST, MANY, ROUND, Label, Round, neighbours, normals_of_faces, round_faces
from fcdm_opt.geometry.polygons import components
from fcdm_opt.geometry.pyramids import Pyramids, pyramid_shape
from fcdm_opt.geometry.resizing import largest_ball
from fcdm_opt.geometry.surface import Surface
from fcdm_opt.geometry.tessellation import TESSELLATED, Swept
from fcdm_opt.geometry.units import measured
from fcdm_opt.tolerances import DEFAULT

ROUNDED = 2 * FEWEST  # facets a turn from which on a polygon is taken for a circle, not for a prism
GENTLE = math.cos(2.0 * math.pi / (ROUNDED - 0.5))  # of the angle between facets of a round face, at most
SOME, MOST_STEPS = 300, 20  # corners that a torus is fitted to, and steps of it
TOO_LARGE = 100.0  # times what is seen of a torus: its radii are not told by that
ALIKE = 4.0  # a facet of more than this times the usual error of its neighbours is a flat on the round face

_KNOWN: WeakKeyDictionary[Body, Array | None] = WeakKeyDictionary()
_BOUNDS: WeakKeyDictionary[Body, tuple[Body, Body] | None] = WeakKeyDictionary()


def facet_errors(body: Body) -> Array | None:
    """Return how far each face sticks out of the surface that it stands for, and falls short of it, (faces, 2).

    0 for plane faces. None where the parts only come near the solid: which of its faces are off is not known then.
    """
    body = body.whole or body
    if body.facet_errors is not None:
        return body.facet_errors
    if body not in _KNOWN:
        _KNOWN[body] = _recognised(body)
    return _KNOWN[body]


def deviation_of(body: Body) -> tuple[float, float]:
    """Return how far a body sticks out of the true one, and falls short of it, at most: `Body.deviation`, or more."""
    errors = facet_errors(body)
    out, short = np.max([body.deviation, *([] if errors is None else errors.max(axis=0, initial=0.0)[None])], axis=0)
    return float(out), float(short)


def _recognised(body: Body) -> Array | None:
    """Return the errors of facets that are taken for round faces."""
    if max(body.deviation) > DEFAULT.drawn * body.size:
        return None
    errors = np.zeros((len(body.faces), 2))
    if len(body.faces) < ROUNDED:
        return frozen(errors)
    normals, (corners, owners) = normals_of_faces(body), body.face_triangles
    rounds = round_faces(body)
    rounds = [*rounds, *_tori(body, normals, {face for each in rounds for face in each.faces})]
    if not all(face in body.face_rows for own in rounds for face in own.faces):
        return None  # of solids side by side: faces that another one covers in part are none of the whole
    for own in rounds:
        rows = np.array([body.face_rows[face] for face in own.faces])
        looks = np.array([normals[face] for face in own.faces])
        pairs = neighbours(own.faces)[0]
        gentle = (looks[pairs[:, 0]] * looks[pairs[:, 1]]).sum(axis=1) > GENTLE
        place = np.full(len(errors), -1)
        place[rows] = np.arange(len(rows))
        its = place[owners]
        found = np.zeros((len(rows), 2))
        np.maximum.at(found, its[its >= 0], own.surface.offsets(corners[its >= 0]))
        for group in _groups(pairs[gentle], len(rows)):
            most = found[group].max(axis=1)
            kept = group[(most > DEFAULT.drawn * body.size) & (most <= ALIKE * np.median(most))]
            errors[rows[kept]] = np.maximum(errors[rows[kept]], found[kept])
    return frozen(np.where(errors > DEFAULT.drawn * body.size, errors, 0.0))


def _groups(pairs: Ints, count: int) -> list[Ints]:
    """Return the groups of `FEWEST` facets at least that pairs join."""
    group = components(pairs, count)
    return [own for k in np.unique(group) if len(own := np.flatnonzero(group == k)) >= FEWEST]


def _tori(body: Body, normals: dict[Label, Array], known: Set[Label]) -> list[Round]:
    """Return the tori that facets side by side stand for which no other round face has: fillets round a shaft, say."""
    facets = sorted(face for face in normals if len(face) < MANY and face not in known)
    looks, pairs = np.array([normals[face] for face in facets]).reshape(-1, 3), neighbours(facets)[0]
    turn = (looks[pairs[:, 0]] * looks[pairs[:, 1]]).sum(axis=1)
    found = []
    for group in _groups(pairs[(turn > GENTLE) & (turn < 1.0 - ROUND)], len(facets)):
        faces = [facets[k] for k in group.tolist()]
        corners = body.vertices[np.unique([v - 1 for face in faces for v in face])]
        middles = np.array([body.vertices[np.array(face) - 1].mean(axis=0) for face in faces])
        surface = _torus(corners, middles, looks[group]) if len(corners) >= 2 * MANY else None
        if surface is not None:
            found.append(Round(f"torus radius {surface.radius:.4g}", surface, faces))
    return found


def _torus(corners: Array, middles: Array, normals: Array) -> Swept | None:
    """Return the torus that corners lie on, None where they lie on none.

    Its axis is the line that all normals meet, whose Pluecker coordinates are linear least squares. Normals of facets
    do so where these are alike on both sides of a meridian; else they tell where Newton's method begins.
    """
    from scipy.optimize import least_squares

    origin, size = corners.mean(axis=0), float(np.ptp(corners, axis=0).max())
    points, places = (corners - origin) / size, (middles - origin) / size
    lines = np.column_stack([np.cross(places, normals), normals])
    axis, moment = np.split(np.linalg.svd(lines, full_matrices=False)[2][-1], 2)
    if not np.linalg.norm(axis) > ROUND:
        return None
    base = np.cross(axis, moment) / (axis @ axis)

    def circle(line: Array, points: Array) -> tuple[Array, Array]:
        way = line[3:] / np.linalg.norm(line[3:])
        along = (points - line[:3]) @ way
        far = norms(points - line[:3] - along[:, None] * way)
        a, b, c = np.linalg.lstsq(np.column_stack([2.0 * far, 2.0 * along, np.ones(len(far))]), far**2 + along**2)[0]
        radius = np.sqrt(max(c + a * a + b * b, 0.0))
        return np.array([a, b, radius]), np.hypot(far - a, along - b) - radius

    line = np.concatenate([base, axis / np.linalg.norm(axis)])
    if np.abs(circle(line, points)[1]).max() > ROUND**2:
        some = points[:: max(1, len(points) // SOME)]
        line = least_squares(lambda own: circle(own, some)[1], line, xtol=DEFAULT.nominal, max_nfev=MOST_STEPS).x
    (ring, height, radius), off = circle(line, points)
    way = line[3:] / np.linalg.norm(line[3:])
    if np.abs(off).max() > ROUND * radius or not 0.0 <= ring <= TOO_LARGE or radius > TOO_LARGE:
        return None
    return Swept(origin + size * (line[:3] + height * way), way, None, float(size * ring), float(size * radius))


def bounding_bodies(body: Body) -> tuple[Body, Body] | None:
    """Return a body that the true one holds, and one that holds it; the body itself where its faces are true.

    None where none are known.
    """
    body = body.whole or body
    if body not in _BOUNDS:
        errors = facet_errors(body)
        ends = [None] * 2 if errors is None else [_moved(body, off, errors) for off in (-errors[:, 0], errors[:, 1])]
        _BOUNDS[body] = None if ends[0] is None or ends[1] is None else (ends[0], ends[1])
    return _BOUNDS[body]


def _moved(body: Body, off: Array, errors: Array) -> Body | None:
    """Return a body whose faces are moved outward by lengths, all >= 0 or all <= 0; None where that cannot be."""
    if not off.any():
        return body
    return _surface_moved(body, off, errors) if body.hollow else _parts_moved(body, off)


# ------------------------------------------------------------------------------------------ of bodies cut into parts


def _parts_moved(body: Body, off: Array) -> Body | None:
    """Return it of a body cut into convex parts: the half-spaces of each are moved, cuts stay.

    What is left of no part after an inward move is left out.
    """
    points, hulls, parts, count = [body.vertices], list[Hull](), list[ConvexPart | None](), len(body.vertices)
    for part, owners in zip(body.parts, body.facet_faces, strict=True):
        shift = np.array([max(off[list(own)], key=abs, default=0.0) for own in owners])
        if not shift.any():
            parts.append(part)
            continue
        made = _shifted(part, shift, DEFAULT.planarity * body.size)
        if made is not None:
            corners, hull = made
            hulls.append(hull._replace(used=hull.used + count))
            points.append(corners)
            parts.append(None)
            count += len(corners)
    if not parts:
        return None
    rows = frozen(np.concatenate(points))
    faces, elements = own_elements(rows, hulls, None, body.name, apart=True)
    made_parts = (
        ConvexPart(frozen(rows[hull.used]), body.seed, hull.loops, frozen(hull.edges, np.int64), named)
        for hull, named in zip(hulls, elements, strict=True)
    )
    every = tuple(next(made_parts) if part is None else part for part in parts)
    faces = tuple(dict.fromkeys((*body.faces, *faces)))
    return Body(body.name, rows, body.seed, every, faces, faces, facet_errors=np.zeros((len(faces), 2)))


def _shifted(part: ConvexPart, shift: Array, near: float) -> tuple[Array, Hull] | None:
    """Return corners and hull of a convex part whose facets are moved outward; None where nothing is left of it.

    As a rule the same facets meet in the same corners. Where they do not, half-spaces are intersected anew.
    """
    normals, levels = part.normals, part.levels + shift
    on = np.zeros((len(part.vertices), len(part.loops)))
    for k, loop in enumerate(part.loops):
        on[list(loop), k] = 1.0
    squares = np.einsum("vf,fx,fy->vxy", on, normals, normals)
    if np.linalg.cond(squares).max() < 1.0 / DEFAULT.nominal:
        corners = part.vertices + np.linalg.solve(squares, ((on * shift) @ normals)[..., None])[..., 0]
        depth = levels - corners @ normals.T
        if np.abs(depth[on > 0]).max() <= near and depth[on == 0].min(initial=np.inf) > near:
            return corners, Hull(np.arange(len(corners)), part.loops, part.edges)
    from scipy.spatial import HalfspaceIntersection

    origin = part.vertices.mean(axis=0)
    levels = levels - normals @ origin
    middle, radius = largest_ball(normals, levels)
    if not radius > near:
        return None
    corners = HalfspaceIntersection(np.column_stack([normals, -levels]), middle).intersections
    corners = origin + corners[distinct_rows(np.round(corners / near))[0]]
    return corners, convex_hull(corners, np.arange(len(corners)), "a part with its facets moved")


# --------------------------------------------------------------------------------------- of bodies kept as a surface


def _surface_moved(body: Body, off: Array, errors: Array) -> Body | None:
    """Return it of a body kept as its surface: corners move such that each facet ends beyond its own plane moved."""
    triangles = np.concatenate([np.array(own) for own in body.skin])
    owners = body.face_triangles[1]
    first, same = distinct_rows(body.vertices)
    normals = unit_normals(body.vertices[triangles])
    moves = _moves(same[triangles], owners, normals, off, errors, len(first))
    if moves is None:
        return None
    points = body.vertices + moves[same]
    if (unit_normals(points[triangles]) * normals).sum(axis=1).min() <= 0.0:  # a facet would turn over
        return None
    places = {tuple(point): k for k, point in enumerate(body.vertices.tolist())}
    hulls, faces = list[Hull](), list[int]()
    for part, own in zip(body.parts, body.facet_faces, strict=True):
        *base, apex = [places[tuple(corner)] for corner in part.vertices.tolist()]
        for piece in _bases(points, [base[k] for k in part.loops[0]], DEFAULT.planarity * body.size):
            a, b, c = points[piece[:3]]
            if (points[apex] - a) @ np.cross(b - a, c - a) < 0.0:
                hulls.append(Hull(np.array([*piece, apex]), *pyramid_shape(len(piece))))
                faces += own[0][:1]
    surface = Surface.of(points, triangles, owners)
    number = np.zeros(len(body.faces), np.int64)
    number[owners] = surface.owners
    made = Pyramids(points, hulls, surface, number[faces])
    return replace(
        Body._of_surface(made, body.seed, body.name, notes=body.notes[:1], moved=0.0),
        facet_errors=np.zeros((len(surface.faces), 2)),
    )


def _bases(points: Array, base: list[int], near: float) -> list[list[int]]:
    """Return a polygon where it is plane and convex, else its triangles."""
    corners = points[base]
    normal = unit_normals(corners[None])[0]
    turns = np.cross(corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners) @ normal
    if np.abs((corners - corners[0]) @ normal).max() <= near and turns.min() > 0.0:
        return [base]
    return [[base[0], *base[k : k + 2]] for k in range(1, len(base) - 1)]


def _moves(
    corners: Ints, owners: Ints, normals: Array, off: Array, errors: Array, count: int
) -> Array | None:
    """Return the least move of each corner, (count, 3), that takes it beyond all its facets' planes moved.

    It stays in the planes of faces that have no error. None where there is no such move.
    """
    moves, side = np.zeros((count, 3)), 1.0 if off.max() > 0.0 else -1.0
    flat = np.asarray(errors.max(axis=1) == 0.0)
    faces, their = np.repeat(owners, 3), corners.ravel()
    order = np.argsort(their, kind="stable")
    ends = np.searchsorted(their[order], np.arange(count + 1))
    touched = np.unique(corners[off[owners] != 0.0])
    for v in touched.tolist():
        rows = order[ends[v] : ends[v + 1]]
        own, k = np.unique(faces[rows], return_index=True)
        n, h = side * normals[rows[k] // 3], np.abs(off[own])
        move = least_vector(np.vstack([n, -n[flat[own]]]), np.concatenate([h, np.zeros(int(flat[own].sum()))]))
        if move is None:
            return None
        moves[v] = move
    return moves


# ------------------------------------------------------------------------------------------------------- in words


def gaps_off(movable: Body, others: Sequence[Body]) -> tuple[float, float]:
    """Return how far gaps of the solids that bodies stand for may be above those of the bodies, and below, at most.

    (0.0, 0.0) where they are off by no more than the digits of files, `Tolerances.drawn`.
    """
    if not any(max(deviation_of(body)) > DEFAULT.drawn * body.size for body in (movable, *others)):
        return 0.0, 0.0
    own, *further = [deviation_of(body) for body in (movable, *others)]
    return own[0] + max(other[0] for other in further), own[1] + max(other[1] for other in further)


def known_to(movable: Body, others: Sequence[Body], unit: str) -> list[str]:
    """Return a sentence on how far gaps may be off those of the solids that bodies stand for, and why.

    None where they are not, see `gaps_off`.
    """
    out, short = gaps_off(movable, others)
    if not max(out, short) > 0.0:
        return []
    reasons: dict[str, list[str]] = {}
    for body in (movable, *others):
        if max(deviation_of(body)) > DEFAULT.drawn * body.size:
            approximated = facet_errors(body) is None and not any(note.startswith(TESSELLATED) for note in body.notes)
            reasons.setdefault("approximation" if approximated else "tessellation", []).append(body.name)
    told = " and ".join(f"{reason} of {' and '.join(names)}" for reason, names in reasons.items())
    return [f"as drawn, gaps are known to {measured(f'+{out:.2g} / -{short:.2g}', unit)}: by {told}"]
