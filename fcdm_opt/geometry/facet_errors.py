"""How far facets leave the round faces that they stand for, and bodies that the true one lies between.

STEP files say what their faces are. Of a mesh, facets side by side whose corners all lie on one cylinder, cone, sphere
(`naming.round_faces`) are taken for that surface; of others whose bends change evenly, as on the flanks of gears and
on free-form faces, what they leave is estimated from how they turn (`_bent`). With each facet moved by its own error,
inward where it sticks out and outward where it falls short, a body becomes one that the true body holds, and one that
holds it.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import SMALLEST, Array, Flags, Ints, distinct_rows, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart, cached_of_whole, cached_per_body
from fcdm_opt.geometry.elements import Element, Elements, own_elements
from fcdm_opt.geometry.hull import Hull, convex_hull
from fcdm_opt.geometry.measures import corners_within, cross, least_vector, norms, short_decimals, unit_normals, units
from fcdm_opt.geometry.naming import rows_at
from fcdm_opt.geometry.polygons import by_size, components
from fcdm_opt.geometry.pyramids import pyramids
from fcdm_opt.geometry.round_recognition import (
    FEWEST,
    GENTLE,
    MANY_CORNERS,
    ROUNDED,
    Label,
    Round,
    neighbours,
    normals_of_faces,
    round_faces,
    side_by_side,
)
from fcdm_opt.geometry.tessellation import TESSELLATED, RoundFaces, Swept
from fcdm_opt.geometry.units import measured
from fcdm_opt.tolerances import DEFAULT

STRIP = 4  # facets side by side that are taken for a smooth face
EVEN = 0.6  # of how they turn, at least so much is explained by how they are bent
CREASE = 0.35  # of the largest turn there, by which the turn between two facets differs from what their bends tell
MARGIN = 1.5  # on what bends tell: they change from facet to facet
NARROW = 1e-3  # of the extent of a facet: narrower, no bend across is told
USUAL = 0.6  # of the facets of a round face, at least so many are no flats
ALL_OUT = 1.5  # times what faces stand out: where one meets a plane face aslant, as much is not enough
ALIKE = 4.0  # a facet of more than this times the usual error of its neighbours is a flat on the round face


def facet_errors(body: Body) -> Array | None:
    """Return how far each face sticks out of the surface that it stands for, and falls short of it, (faces, 2)."""
    # 0 for plane faces. None where the parts only come near the solid: which of its faces are off is not known then
    body = body.full_body or body
    return _recognised(body) if body.facet_errors is None else body.facet_errors


def round_surfaces(body: Body) -> RoundFaces:
    """Return the round surfaces that faces are told to stand for, each with the rows of these; see `rounded`."""
    return (body.full_body or body).surfaces or ()


def rounded(body: Body) -> Body:
    """Return a body whose facets stand for the cylinders, cones and spheres that their corners lie on."""
    found = _of_round_faces(body) if body.surfaces is None else None
    return body if found is None else replace(body, surfaces=found.surfaces)


def errors_about(body: Body, surfaces: RoundFaces, others: Array) -> Array:
    """Return the errors of faces that stand for known surfaces, (faces, 2), with those of all others as given."""
    errors, (corners, owners) = np.array(others), body.face_triangles
    for surface, rows in surfaces:
        own = np.isin(owners, rows)
        errors[list(rows)] = 0.0
        np.maximum.at(errors, owners[own], surface.offsets(corners[own]))
    return frozen(errors)


def is_plane_there(body: Body, element: Element) -> bool:
    """Tell whether a body's faces at one of its elements are plane in truth, as far as is known."""
    errors, rows = facet_errors(body), rows_at(body, element)
    return errors is not None and bool(rows) and min(rows) >= 0 and not errors[rows].any()


def deviation_of(body: Body) -> tuple[float, float]:
    """Return how far a body sticks out of the true one, and falls short of it, at most: `Body.deviation`, or more."""
    errors = facet_errors(body)
    out, short = np.max([body.deviation, *([] if errors is None else errors.max(axis=0, initial=0.0)[None])], axis=0)
    return float(out), float(short)


@cached_per_body
def _recognised(body: Body) -> Array | None:
    """Return the errors of facets that are taken for round faces, or for smooth ones of no known kind."""
    found = _of_round_faces(body)
    if found is None or not found.looked:
        return None if found is None else found.errors
    errors = found.errors.copy()
    rows, off = _smooth(body, normals_of_faces(body), found.faces)
    errors[rows] = np.maximum(errors[rows], off)
    return frozen(np.where(errors > DEFAULT.drawn * body.size, errors, 0.0))


class _OfRound(NamedTuple):
    """Errors of facets taken for round faces, (faces, 2), these surfaces, all facets of such; whether looked for."""

    errors: Array
    surfaces: RoundFaces
    faces: Set[Label]
    looked: bool


def _of_plane_faces(body: Body) -> bool:
    """Tell whether a body has few faces, and fewer that turn gently into each other than a strip: a prism, mostly."""
    looks = body.face_planes[0] if len(body.faces) < ROUNDED else np.ones((STRIP, 1))
    return bool(np.count_nonzero(np.triu(looks @ looks.T > GENTLE, 1)) < STRIP - 1)


@cached_per_body
def _of_round_faces(body: Body) -> _OfRound | None:
    """Return what facets are taken for cylinders, cones and spheres; None where that cannot be told."""
    if max(body.deviation) > DEFAULT.drawn * body.size:
        return None
    errors = np.zeros((len(body.faces), 2))
    if _of_plane_faces(body):
        return _OfRound(frozen(errors), (), set(), looked=False)
    rounds = round_faces(body)
    if not all(face in body.face_rows for own in rounds for face in own.faces):
        return None  # of solids side by side: faces that another one covers in part are none of the whole
    normals = normals_of_faces(body) if rounds else {}
    corners, owners = body.face_triangles
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
        for group in side_by_side(pairs[gentle], FEWEST):
            most = found[group].max(axis=1)
            kept = group[(most > DEFAULT.drawn * body.size) & ~_flats(most)]
            errors[rows[kept]] = np.maximum(errors[rows[kept]], found[kept])
    each = (_even(body, own, errors, normals) for own in rounds)
    distinct = {tuple(sorted(own[1])): own for own in reversed([*each]) if own[1]}  # of pieces of one face the first
    surfaces = tuple(reversed(distinct.values()))
    return _OfRound(frozen(errors), surfaces, {face for own in rounds for face in own.faces}, looked=True)


def _even(body: Body, own: Round, errors: Array, normals: dict[Label, Array]) -> tuple[Swept, tuple[int, ...]]:
    """Return the surface and the rows of its facets; none where some turn too far: corners on a sphere make no ball."""
    kept = [face for face in own.faces if errors[body.face_rows[face]].any()]
    looks = np.array([normals[face] for face in kept]).reshape(-1, 3)
    pairs = neighbours(kept)[0]
    turned = (looks[pairs[:, 0]] * looks[pairs[:, 1]]).sum(axis=1)
    origin, radius = (short_decimals(x, body.rounding) for x in (own.surface.origin, np.asarray(own.surface.radius)))
    surface = own.surface._replace(origin=origin, radius=float(radius))
    return surface, tuple(body.face_rows[face] for face in kept if turned.min(initial=1.0) > GENTLE)


def _flats(errors: Array) -> Flags:
    """Tell which facets of a round face are flats on it: few, of an error far above those of the others."""
    levels = np.sort(errors)
    few = int(USUAL * len(levels))
    jumps = np.flatnonzero(levels[few:] > ALIKE * levels[few - 1 : -1])
    return errors > (levels[few - 1 + jumps[0]] if len(jumps) else np.inf)


def _smooth(body: Body, normals: dict[Label, Array], known: Set[Label]) -> tuple[Ints, Array]:
    """Return faces that stand for smooth ones of no known kind, (k,), and their estimated errors, (k, 2)."""
    # of facets side by side that turn gently, where their bends explain most of how they turn. Those of blunt corners,
    # which turn anyhow, do not
    faces = sorted(
        face for face in normals if len(face) < MANY_CORNERS and face not in known and face in body.face_rows
    )
    if len(faces) < STRIP:
        return np.empty(0, np.int64), np.empty((0, 2))
    looks, (pairs, ends) = np.array([normals[face] for face in faces]), neighbours(faces)
    smooth = (looks[pairs[:, 0]] * looks[pairs[:, 1]]).sum(axis=1) > GENTLE
    for _ in range(2):  # once more without the creases
        pairs, ends = pairs[smooth], ends[smooth]
        group = components(pairs, len(faces))
        errors, turning, smooth = _bent(body.vertices, faces, looks, pairs, ends, group)
        its = group[pairs[:, 0]]
        whole, explained = (np.bincount(its, own) for own in (turning, turning & smooth))
        even = (explained >= EVEN * whole)[its]
        smooth &= even
    pairs = pairs[even]
    kept = [np.empty(0, np.int64)]
    (one, two), least, most = np.concatenate([pairs, pairs[:, ::-1]]).T, np.full_like(errors, np.inf), 0.0 * errors
    np.minimum.at(least, one, errors[two])  # at the ends of a face half of the turn is seen
    np.maximum.at(most, one, errors[two])  # where bends change their sign none is seen
    errors = np.max([errors, np.where(np.isinf(least), 0.0, least), most / ALIKE], axis=0)
    telling = np.array([1.0 if len(face) > 3 else 1.0 / 3.0 for face in faces])  # triangles turn as bends let them
    for own in side_by_side(pairs, STRIP):
        most = errors[own].max(axis=1)
        if telling[own].sum() >= STRIP:
            kept.append(own[~_flats(most)])
    rows = np.concatenate(kept)
    return np.array([body.face_rows[faces[k]] for k in rows.tolist()], np.int64), errors[rows]


def _bent(
    points: Array, faces: list[Label], looks: Array, pairs: Ints, ends: Ints, group: Ints
) -> tuple[Array, Flags, Flags]:
    """Return how far facets leave a smooth face, (f, 2), which pairs turn, and of which bends explain it, (m,) each.

    The bend of a facet is the second fundamental form that takes its sides into the changes of the normals at its
    corners, least squares (Rusinkiewicz, Estimating curvatures and their derivatives on triangle meshes, 2004); these
    are means over the group of facets there (with the weights of Max, Weights for computing vertex normals, 1999).
    Facets with corners on a face of that form leave it by what a parabola leaves its chords. Two of them turn by what
    is missing, at their common side, between the chord across it and the side: by the mean of both their bends, which
    changes evenly on a smooth face, with uneven chords and through an inflection too, and jumps from turn to turn of a
    polygon.

    - `points` (n, 3).
    - `faces`: numbers of the corners of each facet, from 1.
    - `looks` (f, 3): their unit normals.
    - `pairs`, `ends` (m, 2): which of them meet, and in which rows of points.
    - `group` (f,): which facets may be of one smooth face.
    """
    count, first = len(faces), units(cross(looks, np.eye(3)[np.abs(looks).argmin(axis=1)]))
    frames = np.stack([first, cross(looks, first)], axis=1)
    sets = list[tuple[Ints, Ints, Array]]()  # facets of as many corners: which, these in order around, and flat
    for places, corners in by_size(faces):
        flat = np.einsum("fji,fki->fkj", frames[places], points[corners - 1])
        x, y = np.moveaxis(flat - flat.mean(axis=1, keepdims=True), -1, 0)
        order = np.argsort(np.arctan2(y, x), axis=1)
        sets.append((places, np.take_along_axis(corners - 1, order, 1), np.take_along_axis(flat, order[..., None], 1)))
    spots = [group[places, None] * len(points) + rows for places, rows, _ in sets]
    spots = np.split(
        np.unique(np.concatenate([own.ravel() for own in spots]), return_inverse=True)[1],
        np.cumsum([own.size for own in spots])[:-1],
    )
    sums = np.zeros((1 + max(int(own.max()) for own in spots), 3))
    for spot, (places, _, flat) in zip(spots, sets, strict=True):
        back, on = np.roll(flat, 1, axis=1) - flat, np.roll(flat, -1, axis=1) - flat
        area = np.abs(back[..., 0] * on[..., 1] - back[..., 1] * on[..., 0])
        weights = area / np.maximum((back**2).sum(axis=2) * (on**2).sum(axis=2), SMALLEST)
        np.add.at(sums, spot.reshape(area.shape), weights[..., None] * looks[places, None])
    corner_normals, form, errors = units(sums), np.zeros((count, 3)), np.zeros((count, 2))
    for spot, (places, rows, flat) in zip(spots, sets, strict=True):
        i, j = np.triu_indices(rows.shape[1], 1)
        sides, own = flat[:, j] - flat[:, i], corner_normals[spot.reshape(rows.shape)]
        x, y = np.moveaxis(sides, -1, 0)
        system = np.stack([x, y, 0.0 * x, 0.0 * x, x, y], axis=-1).reshape(len(places), -1, 3)
        changes = np.einsum("fji,fki->fkj", frames[places], own[:, j] - own[:, i]).reshape(len(places), -1, 1)
        form[places] = (np.linalg.pinv(system, rcond=NARROW) @ changes)[..., 0]
        inner = _squared(form[places], flat - flat.mean(axis=1, keepdims=True)).mean(axis=1) / 2.0
        heights = np.column_stack([_squared(form[places], sides) / 8.0, inner])
        errors[places] = MARGIN * np.column_stack([-heights.min(axis=1), heights.max(axis=1)])
    padded = points[np.array([(face * MANY_CORNERS)[:MANY_CORNERS] for face in faces]) - 1]
    (one, two), start = np.concatenate([pairs, pairs[:, ::-1]]).T, np.tile(points[ends[:, 0]], (2, 1))
    side = np.tile(np.diff(points[ends], axis=1)[:, 0], (2, 1))
    along, length, k = units(side), norms(side), np.arange(len(one))
    tops = list[Array]()  # of either facet the corner farthest from the side: along it, and off it
    for facet in (one, two):
        local = padded[facet] - start[:, None]
        off = np.einsum("kci,ki->kc", local, cross(along, looks[facet]))
        far = np.abs(off).argmax(axis=1)
        tops += [np.einsum("ki,ki->k", local[k, far], along), off[k, far]]
    outward, depth, other = -np.sign(tops[1])[:, None] * cross(along, looks[one]), np.abs(tops[1]), np.abs(tops[3])
    share = depth / (depth + other)
    place = (tops[0] + share * (tops[2] - tops[0])) / length
    chord = (tops[2] - tops[0])[:, None] * along + (depth + other)[:, None] * outward
    bulges = [
        _squared(form[one], np.einsum("kji,ki->kj", frames[one], own)[:, None])[:, 0] * part * (1.0 - part) / 2.0
        for own, part in ((chord, share), (side, place))
    ]
    turns = ((looks[two] - looks[one]) * outward).sum(axis=1)
    bent = ((bulges[0] - bulges[1]) / (depth * (1.0 - share))).reshape(2, -1)
    halved = np.bincount(one, minlength=count) == 1  # at the ends of a face half of the turn is seen
    counted = ~halved[one].reshape(2, -1)
    off = np.abs((bent * counted).sum(axis=0) / np.maximum(counted.sum(axis=0), 1) - turns[: len(pairs)])
    largest = np.zeros(count)
    np.maximum.at(largest, one, np.abs(turns))
    usual = largest[pairs].max(axis=1)
    turning = np.abs(turns[: len(pairs)]) >= usual / ALIKE
    return np.maximum(errors, 0.0) * (1.0 + halved)[:, None], turning, off <= CREASE * usual


def _squared(form: Array, steps: Array) -> Array:
    """Return quadratic forms, (f, 3), of steps in the plane, (f, m, 2): (f, m)."""
    (a, b, c), (x, y) = form.T[..., None], np.moveaxis(steps, -1, 0)
    return a * x * x + 2.0 * b * x * y + c * y * y


@cached_of_whole
def bounding_bodies(body: Body) -> tuple[Body, Body] | None:
    """Return a body that the true one holds, and one that holds it; the body itself where its faces are true."""
    # None where none are known; all faces of a prism whose coordinates are rounded are off by no more than these are
    errors = facet_errors(body)
    if errors is None and body.rounding > DEFAULT.drawn * body.size and _of_plane_faces(body):
        errors = np.tile(body.deviation, (len(body.faces), 1))
    ends = [None] * 2 if errors is None else [_moved(body, off, errors) for off in (-errors[:, 0], errors[:, 1])]
    return None if ends[0] is None or ends[1] is None else (ends[0], ends[1])


def _moved(body: Body, off: Array, errors: Array) -> Body | None:
    """Return a body whose faces are moved outward by lengths, all >= 0 or all <= 0; None where that cannot be."""
    if not off.any():
        return body
    if not body.is_surface:
        return _parts_moved(body, off)
    flat = np.asarray(errors.max(axis=1) == 0.0)
    made = _surface_moved(body, off, flat)
    # where a fillet goes on in a plane, corners that stay in it may have to go too far
    return _surface_moved(body, off, np.zeros_like(flat)) if made is None else made


# ------------------------------------------------------------------------------------------ of bodies cut into parts


def _parts_moved(body: Body, off: Array) -> Body | None:
    """Return it of a body cut into convex parts: the half-spaces of each are moved, cuts outward stay."""
    # what is left of no part after an inward move is left out
    points, hulls, parts, count = [body.vertices], list[Hull](), list[ConvexPart | None](), len(body.vertices)
    moved = list[tuple[ConvexPart, Array]]()
    if off.min() < 0.0:
        shifts = _inward(body, off)
    else:
        shifts = [np.array([max(off[list(own)], default=0.0) for own in owners]) for owners in body.facet_faces]
    for part, shift in zip(body.parts, shifts, strict=True):
        if not shift.any():
            parts.append(part)
            continue
        made = _shifted(part, shift, DEFAULT.planarity * body.size)
        if made is not None:
            corners, hull = made
            hulls.append(hull._replace(used=hull.used + count))
            moved.append((part, shift))
            points.append(corners)
            parts.append(None)
            count += len(corners)
    if not parts:
        return None
    rows = frozen(np.concatenate(points))
    faces, elements = own_elements(rows, hulls, None, body.name, apart=True)
    made_parts = (
        _named_as_drawn(
            ConvexPart(frozen(rows[hull.used]), body.seed, hull.loops, frozen(hull.edges, np.int64), named), *drawn
        )
        for hull, named, drawn in zip(hulls, elements, moved, strict=True)
    )
    every = tuple(next(made_parts) if part is None else part for part in parts)
    shown = {face.vertices for part in every for face in part.elements["F"]}
    faces = tuple(dict.fromkeys((*body.faces, *(face for face in faces if face in shown))))
    return Body(body.name, rows, body.seed, every, faces, faces, facet_errors=np.zeros((len(faces), 2)))


def _named_as_drawn(made: ConvexPart, drawn: ConvexPart, shift: Array) -> ConvexPart:
    """Return a part with facets moved, with the drawn part's names where facets stay: a plane remains one face."""
    # edges keep theirs where both their facets stay, and corners where all do, unless the part is of other facets now
    alike = np.eye(len(shift), dtype=bool)
    if made.loops is not drawn.loops:
        alike = made.normals @ drawn.normals.T >= 1.0 - DEFAULT.nominal
        alike &= np.abs(made.levels[:, None] - drawn.levels) <= DEFAULT.nominal * np.abs(drawn.levels).max()
    alike &= shift == 0.0
    of = np.where(alike.any(axis=1), alike.argmax(axis=1), -1)
    kept = [("F", k, row) for k, row in enumerate(of.tolist()) if row >= 0]
    if made.loops is drawn.loops:
        changed = {v for k, loop in enumerate(made.loops) if of[k] < 0 for v in loop}
        kept += [("V", v, v) for v in range(len(made.vertices)) if v not in changed]
    sides_drawn = {frozenset(sides): row for row, sides in enumerate(drawn.edges[:, 2:].tolist())}
    sides_made = enumerate(map(frozenset[int], of[made.edges[:, 2:]].tolist()))
    kept += [("E", k, sides_drawn[sides]) for k, sides in sides_made if sides in sides_drawn]
    named, spans = {kind: [*made.elements[kind]] for kind in made.elements}, dict(made.elements.spans)
    for kind, k, row in kept:
        named[kind][k] = drawn.elements[kind][row]
        if (span := drawn.elements.spans.get((kind, row))) is not None:
            spans[kind, k] = span._replace(corners=frozen(made.vertices[list(made.vertices_of(kind, k))]))
    return replace(made, elements=Elements(named["V"], named["E"], named["F"], spans))


def _inward(body: Body, off: Array) -> list[Array]:
    """Return how far each facet of each part moves inward, (facets,): cuts too that end at a face which stands out."""
    # a part may reach such a face in an edge or a corner alone, and its corners be between those of the face. With its
    # faces moved by what any face that it reaches stands out, and its cuts there by more, nothing of it does
    (normals, places), (rows,) = body.face_planes, np.nonzero(off)
    corners, owners = body.face_triangles
    slack = DEFAULT.cut * body.size
    points = np.concatenate([part.vertices for part in body.parts])
    reached = np.zeros(len(points))
    for row in rows.tolist():
        own = corners[owners == row].reshape(-1, 3)
        on = np.abs((points - places[row]) @ normals[row]) <= slack
        on &= ((points >= own.min(axis=0) - slack) & (points <= own.max(axis=0) + slack)).all(axis=1)
        reached[on] = np.minimum(reached[on], off[row])
    found, start = list[Array](), 0
    for part, faces in zip(body.parts, body.facet_faces, strict=True):
        its = reached[start : start + len(part.vertices)]
        start += len(part.vertices)
        far = min(its.min(), min((off[list(own)].min() for own in faces if own), default=0.0))
        both = zip(faces, part.loops, strict=True)
        shares = [off[list(own)].any() if own else ALL_OUT * its[list(loop)].any() for own, loop in both]
        found.append(far * np.array(shares, float))
    return found


def _shifted(part: ConvexPart, shift: Array, near: float) -> tuple[Array, Hull] | None:
    """Return corners and hull of a convex part whose facets are moved outward; None where nothing is left of it."""
    # as a rule the same facets meet in the same corners. Where they do not, half-spaces are intersected anew
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
    origin = part.vertices.mean(axis=0)
    there = corners_within(normals, levels - normals @ origin, near)
    if there is None:
        return None
    corners = origin + there[distinct_rows(np.round(there / near))[0]]
    return corners, convex_hull(corners, np.arange(len(corners)), "a part with its facets moved")


# --------------------------------------------------------------------------------------- of bodies kept as a surface


def _surface_moved(body: Body, off: Array, flat: Flags) -> Body | None:
    """Return it of a body kept as its surface: corners move such that each facet ends beyond its own plane moved."""
    # those of faces that are `flat`, (faces,), stay in their planes
    triangles = np.concatenate([np.array(own) for own in body.triangles])
    owners = body.face_triangles[1]
    first, same = distinct_rows(body.vertices)
    normals = unit_normals(body.vertices[triangles])
    moves = _moves(same[triangles], owners, normals, off, flat, len(first))
    if moves is None:
        return None
    points = body.vertices + moves[same]
    if (unit_normals(points[triangles]) * normals).sum(axis=1).min() <= 0.0:  # a facet would turn over
        return None
    try:
        made = pyramids(points[: triangles.max() + 1], triangles, body.name, owners)  # apexes come after
    except InputError:
        return None
    return replace(
        Body._of_surface(made, body.seed, body.name, notes=body.notes[:1], moved=0.0),
        facet_errors=np.zeros((len(made.surface.faces), 2)),
    )


def _moves(corners: Ints, owners: Ints, normals: Array, off: Array, flat: Flags, count: int) -> Array | None:
    """Return the least move of each corner, (count, 3), that takes it beyond all its facets' planes moved."""
    # it stays in the planes of flat faces. None where there is no such move
    moves, side = np.zeros((count, 3)), 1.0 if off.max() > 0.0 else -1.0
    faces, their = np.repeat(owners, 3), corners.ravel()
    order = np.argsort(their, kind="stable")
    ends = np.searchsorted(their[order], np.arange(count + 1))
    for v in np.unique(corners[off[owners] != 0.0]).tolist():
        rows = order[ends[v] : ends[v + 1]]
        own, k = np.unique(faces[rows], return_index=True)
        n, h = side * normals[rows[k] // 3], np.abs(off[own])
        move = least_vector(np.vstack([n, -n[flat[own]]]), np.concatenate([h, np.zeros(int(flat[own].sum()))]))
        if move is None:
            return None
        moves[v] = move
    return moves


# ------------------------------------------------------------------------------------------------------- in words


def gaps_off(bodies: Sequence[Body]) -> tuple[float, float]:
    """Return how far gaps of the solids that bodies stand for may be above those of the bodies, and below, at most."""
    # gaps of the first one to the others; (0.0, 0.0) where they are off by no more than the digits of files, or bodies
    # are exact at the points that tell their gaps
    exact = any(own.exact is not None for own in bodies)
    if exact or not any(max(deviation_of(body)) > DEFAULT.drawn * body.size for body in bodies):
        return 0.0, 0.0
    own, *further = map(deviation_of, bodies)
    return own[0] + max(other[0] for other in further), own[1] + max(other[1] for other in further)


def known_to(bodies: Sequence[Body], unit: str) -> list[str]:
    """Return a sentence on how far gaps may be off those of the solids that bodies stand for, and why."""
    # None where they are not, see `gaps_off`
    out, short = gaps_off(bodies)
    if not max(out, short) > 0.0:
        return []
    reasons: dict[str, list[str]] = {}
    for body in bodies:
        if max(deviation_of(body)) > DEFAULT.drawn * body.size:
            approximated = facet_errors(body) is None and not any(note.startswith(TESSELLATED) for note in body.notes)
            coarse = body.rounding > DEFAULT.drawn * body.size
            reason = "rounded coordinates" if coarse else "convex parts" if approximated else "facets"
            reasons.setdefault(reason, []).append(body.name)
    text = " and ".join(f"the {reason} of {' and '.join(dict.fromkeys(names))}" for reason, names in reasons.items())
    ends = (f"{measured(off, unit, 2)} {end}" for off, end in ((out, "larger"), (short, "smaller")) if off > 0.0)
    off = f"as drawn, gaps of the true parts may be up to {' or '.join(ends)}: {text} only come near them"
    return ["; ".join(filter(None, (off, rounding_line(bodies))))]


def rounding_line(bodies: Sequence[Body]) -> str:
    """Return which line of a file takes facets for round faces, as `Body.rounded` does; "" where nothing does."""
    names = " and of ".join(dict.fromkeys(body.name or "the part" for body in bodies if may_be_rounded(body)))
    line = f'a line "round = true" below the "file" of {names} takes facets as round walls'
    return line if names else ""


def may_be_rounded(body: Body) -> bool:
    """Tell whether facets are taken as they are, and `rounded` would take them for round faces."""
    as_they_are = body.surfaces is None and body.full_body is None and body.exact is None
    found = _of_round_faces(body) if as_they_are else None
    return found is not None and bool(found.surfaces)


def all_recognised(body: Body) -> bool:
    """Tell whether all faces that are off the solid stand for round faces that are told, see `round_surfaces`."""
    errors, known = facet_errors(body), {row for _, rows in round_surfaces(body) for row in rows}
    return errors is not None and {*np.flatnonzero(errors.any(axis=1)).tolist()} <= known
