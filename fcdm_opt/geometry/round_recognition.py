"""Which facets of a body stand for one round face: a cylinder, a cone, a sphere, a part of each, and its name."""

from __future__ import annotations

import math
from collections import Counter
from itertools import combinations
from typing import NamedTuple

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints, equal_pairs, groups_of
from fcdm_opt.geometry.bodies import Body, cached_of_whole
from fcdm_opt.geometry.measures import cross, dots, norms, units
from fcdm_opt.geometry.polygons import by_size, components
from fcdm_opt.geometry.tessellation import RoundFaces, Swept

MANY_CORNERS = 8  # corners from which a plane face goes by a name
FEWEST = 6  # facets side by side that are taken for a cylinder
BALL = 20  # those that are taken for a sphere
ROUNDED = 2 * FEWEST  # facets a turn from which on a polygon is taken for a circle, not for a prism
GENTLE = math.cos(2.0 * math.pi / (ROUNDED - 0.5))  # cosine: the most that two of them are turned against one another
EVENLY = 0.25  # of the bend at an edge between facets of a round face, by which that at the next edge may differ
ROUND = 1e-4  # of the radius: how far corners may be off it
WHOLLY = 0.1  # share of directions across a cone's: a sphere looks all ways
STEEP = 0.9  # cosine: two cones side by side that are turned less against one another are rings of a rounding
BLUNT = 0.98  # component of a cone's normals along its axis from which on it may be a corner of any round face
FEW, MOST = 4, 6  # digits of a radius that are told: at least, at most, as far as corners agree in them
TIP = 1e-9  # of the largest radius: one so small is where a cone ends in its tip
ROUND_KINDS = ("cylinder", "bore", "sphere", "hollow", "cone", "countersink")
"""Kinds of round faces: outside and inside ones in turn."""

Label = tuple[int, ...]


class Round(NamedTuple):
    """Facets side by side whose corners are all on one round surface: what they are called, that surface, they."""

    name: str
    surface: Swept
    faces: list[Label]


@cached_of_whole
def normals_and_rounds(body: Body) -> tuple[dict[Label, Array], list[Round]]:
    """Return a normal of each face, and what of the body is round."""
    normals = normals_of_faces(body)
    return normals, _round(body, normals) if body.surfaces is None else _named_surfaces(body, body.surfaces, normals)


def _named_surfaces(body: Body, surfaces: RoundFaces, normals: dict[Label, Array]) -> list[Round]:
    """Return the same where it is told which surfaces faces stand for; tori have no name."""
    found, (corners, owners) = list[Round](), body.face_triangles
    for surface, rows in surfaces:
        faces = [body.faces[row] for row in rows]
        points = corners[owners == rows[0]][0]
        inside = float(surface.misses(points.mean(axis=0)[None])[1][0] @ normals[faces[0]]) < 0.0
        if surface.line is not None and surface.line[1] != 0.0:
            ends = corners[np.isin(owners, rows)].reshape(-1, 3) - surface.origin
            away = norms(ends - (ends @ surface.axis)[:, None] * surface.axis)
            found.append(Round(f"{ROUND_KINDS[4 + inside]} radius {_ends(away)}", surface, faces))
        elif surface.line is not None or not surface.ring:
            kind = ROUND_KINDS[(0 if surface.line is not None else 2) + inside]
            found.append(Round(f"{kind} radius {radius_text(surface.radius)}", surface, faces))
    return found


def round_faces(body: Body) -> list[Round]:
    """Return the cylinders, cones and spheres that facets of a body stand for: their corners lie on these."""
    return normals_and_rounds(body)[1]


def radius_text(radius: float, off: float = 0.0) -> str:
    """Return a radius in words, to as many digits as points of its face agree in, which are `off` at most."""
    known = next((digits for digits in range(MOST, FEW, -1) if off <= 10.0**-digits * radius), FEW)
    return f"{radius:.{known}g}"


def normals_of_faces(body: Body) -> dict[Label, Array]:
    """Return a normal of each face that a part carries."""
    if body.triangles:
        corners, owners = body.face_triangles
        sums = np.zeros((len(body.triangles), 3))
        np.add.at(sums, owners, cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
        return dict(zip(body.faces, sums / norms(sums)[:, None], strict=True))
    normals: dict[Label, Array] = {}
    for part in body.parts:
        for k, face in enumerate(part.elements["F"]):
            normals.setdefault(face.vertices, part.normals[k])
        for (kind, k), span in part.elements.spans.items():
            for face in span.elements if kind == "F" else ():
                normals.setdefault(face.vertices, part.normals[k])
    return normals


def _round(body: Body, normals: dict[Label, Array]) -> list[Round]:
    """Return the facets that lie side by side on a sphere, around one axis, or about an apex: each on one of these."""
    facets = sorted(face for face in normals if len(face) < MANY_CORNERS)
    looks = np.array([normals[face] for face in facets])
    pairs, ends = neighbours(facets)
    if not len(pairs):
        return []
    turn = (looks[pairs[:, 0]] * looks[pairs[:, 1]]).sum(axis=1)
    smooth = (turn > GENTLE) & (turn < 1.0 - ROUND)
    pairs, ends, turn = pairs[smooth], ends[smooth], np.arccos(turn[smooth])
    tops, depths = _tops(body.vertices, facets, pairs, ends)
    rise = dots(looks[pairs[:, 0]], body.vertices[tops[1]] - body.vertices[ends[:, 0]])
    bends = np.sign(rise) * turn / depths.sum(axis=0)
    owner = np.full(len(facets), -1)
    found = _spheres(body, facets, looks, pairs, ends, tops, owner)
    free = np.flatnonzero((owner[pairs] < 0).all(axis=1))
    directions = units(body.vertices[ends[:, 1]] - body.vertices[ends[:, 0]])
    directions *= np.sign(np.take_along_axis(directions, np.abs(directions).argmax(axis=1)[:, None], axis=1))
    axes, own, counts = np.unique(np.round(directions[free] / ROUND), axis=0, return_inverse=True, return_counts=True)
    by_axis, cylinders = groups_of(own.reshape(-1)), list[Round | None]()
    for k in np.flatnonzero(counts >= FEWEST - 1).tolist():
        rows = free[by_axis[k]]
        for group in _evenly_bent(body.vertices, pairs[rows], ends[rows], tops[:, rows], axes[k]):
            cylinders.append(_cylinder(body, [facets[j] for j in group.tolist()], normals))
    places, middles = {face: k for k, face in enumerate(facets)}, np.empty((len(facets), 3))
    for rows, corners in by_size(facets):
        middles[rows] = body.vertices[corners - 1].mean(axis=1)
    known = {face for own in found for face in own.faces}
    for cones in (False, True):
        free = np.flatnonzero((owner[pairs] < 0).all(axis=1))
        rounds = _cones(body, facets, normals, pairs[free], ends[free]) if cones else filter(None, cylinders)
        for each in sorted(rounds, key=lambda own: -len(own.faces)):
            group = np.array([places[face] for face in each.faces])
            group = group[owner[group] < 0]
            if len(group) < FEWEST or _goes_on(body.vertices, each.surface, group, pairs, ends, bends):
                continue
            group = _whole(body, facets, each.surface, group, pairs[(owner[pairs] < 0).all(axis=1)], middles)
            whole = each._replace(faces=[facets[j] for j in group.tolist()])
            whole.faces.extend([face for face in _cut_off(body, whole, normals) if face not in known])
            owner[[places[face] for face in whole.faces if face in places]] = len(found)
            known.update(whole.faces)
            found.append(whole)
    return found


def _whole(body: Body, facets: list[Label], surface: Swept, group: Ints, pairs: Ints, middles: Array) -> Ints:
    """Return facets of a surface with those that go on from them: on it too, and in chords as long."""
    near = np.abs(surface.misses(body.vertices)[0]) <= ROUND * body.size
    short = np.abs(surface.misses(middles)[0])
    on = (short >= (1.0 - EVENLY) * short[group].min()) & (short <= (1.0 + EVENLY) * short[group].max())
    for rows, corners in by_size(facets):
        on[rows] &= near[corners - 1].all(axis=1)
    on[group] = True
    joined = components(pairs[on[pairs].all(axis=1)], len(facets))
    return np.flatnonzero(on & np.isin(joined, joined[group]))


def _cut_off(body: Body, own: Round, normals: dict[Label, Array]) -> list[Label]:
    """Return facets beside those of a cylinder that are as far from its axis, and cut off inside of it."""
    # as by a keyway that was cut into facets: the corners there are on a chord, not on the cylinder
    surface, known, found = own.surface, {*own.faces}, list[Label]()
    if surface.line != (1.0, 0.0):
        return []
    points, near = body.vertices, ROUND * surface.radius
    heights = {
        face: float(normal @ (points[face[0] - 1] - surface.origin))
        for face, normal in normals.items()
        if abs(normal @ surface.axis) < ROUND and (surface.misses(points[np.array(face) - 1])[0] <= near).all()
    }
    faces = [*heights]
    joined = [(faces[j], faces[k]) for pair in neighbours(faces)[0].tolist() for j, k in (pair, pair[::-1])]
    while more := {
        face: None
        for member, face in joined
        if member in known and face not in known and abs(heights[face] - heights[member]) <= near
    }:
        found += more
        known.update(more)
    return found


def _tops(points: Array, facets: list[Label], pairs: Ints, ends: Ints) -> tuple[Ints, Array]:
    """Return the rows of the corners of either of two facets farthest from their common edge, and how far: (2, m)."""
    start, along = points[ends[:, 0]], units(points[ends[:, 1]] - points[ends[:, 0]])
    tops, depths = np.empty(2 * len(pairs), np.int64), np.empty(2 * len(pairs))
    for places, corners in by_size([facets[k] for k in pairs.T.reshape(-1).tolist()]):
        pair, rows = places % len(pairs), np.arange(len(places))
        away = norms(cross(points[corners - 1] - start[pair, None], along[pair, None]))
        far = away.argmax(axis=1)
        tops[places], depths[places] = corners[rows, far] - 1, away[rows, far]
    return tops.reshape(2, -1), depths.reshape(2, -1)


def _spheres(
    body: Body, facets: list[Label], looks: Array, pairs: Ints, ends: Ints, tops: Ints, owner: Ints
) -> list[Round]:
    """Return the spheres that corners of facets side by side lie on, and number these in `owner`."""
    # each two facets tell one; of those that most tell alike, all facets there that are on it. Where it is cut off,
    # corners lie on edges of its facets: no farther out, and in planes no nearer to its centre than theirs
    points, found = body.vertices, list[Round]()
    corners = np.array([(face * MANY_CORNERS)[:MANY_CORNERS] for face in facets]) - 1
    start = points[ends[:, 0]]
    spokes = np.stack([points[rows] - start for rows in (ends[:, 1], *tops)], axis=1)
    arms = np.linalg.solve(spokes, (spokes**2).sum(axis=2, keepdims=True) / 2.0)[..., 0]
    keys = np.round(np.column_stack([start + arms, norms(arms)]) / (ROUND * body.size))
    own, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)[1:]
    groups = groups_of(own.reshape(-1))
    for k in sorted(np.flatnonzero(counts >= FEWEST).tolist(), key=lambda k: -counts[k]):
        some = np.unique(pairs[groups[k]])
        some = some[owner[some] < 0]
        if len(some) < FEWEST or not _spans_space(looks[some]):
            continue  # a cylinder or a cone: two of its rings lie on a sphere too
        centre, radius, spread = _about(points[np.unique(corners[some])])
        if spread > ROUND * radius:
            continue
        away, heights = norms(points - centre)[corners], dots(looks, points[corners[:, 0]] - centre)
        on = (np.abs(away - radius) <= ROUND * radius).all(axis=1) & (owner < 0)
        on &= np.abs(heights) >= STEEP * radius
        for core in side_by_side(pairs[on[pairs].all(axis=1)], BALL):
            if (owner[core] >= 0).any() or not _spans_space(looks[core]):
                continue
            outward, least = heights[core[0]] > 0.0, np.abs(heights[core]).min()
            within = (away <= (1.0 + ROUND) * radius).all(axis=1) & (np.abs(heights) >= least - ROUND * radius)
            within &= (owner < 0) & ((heights > 0.0) == outward)
            if not within[core].all():
                continue
            (group,) = (own for own in side_by_side(pairs[within[pairs].all(axis=1)], BALL) if core[0] in own)
            owner[group] = len(found)
            middle, size, off = _about(points[np.unique(corners[core])])
            surface = Swept(middle, np.array((0.0, 0.0, 1.0)), None, 0.0, size)
            name = f"{ROUND_KINDS[2 if outward else 3]} radius {radius_text(size, off)}"
            found.append(Round(name, surface, [facets[j] for j in group.tolist()]))
    return found


def _spans_space(looks: Array) -> bool:
    """Tell whether normals differ along every direction, as on a sphere."""
    spread = np.linalg.svd(looks - looks.mean(axis=0), full_matrices=False)[1]
    return bool(spread[-1] >= WHOLLY * np.sqrt(len(looks)))


def _about(points: Array) -> tuple[Array, float, float]:
    """Return centre and radius of the sphere, or circle, nearest to points, and how far these are off it at most."""
    # |x - c|^2 = r^2, linear in c and r^2 - c^2
    found = np.linalg.lstsq(np.column_stack([2.0 * points, np.ones(len(points))]), (points**2).sum(axis=1))[0]
    off = np.linalg.norm(points - found[:-1], axis=1)
    radius = float(off.mean())
    return found[:-1], radius, float(np.abs(off - radius).max())


def _evenly_bent(points: Array, pairs: Ints, ends: Ints, tops: Ints, axis: Array) -> list[Ints]:
    """Return the groups of facets along an axis that are side by side and bent alike."""
    # of those that meet, (m, 2), in rows of points. A plane that goes on where a round face ends, tangent to it, turns
    # against the last facet by half as much as that against the next
    flat = np.linalg.svd(axis[None])[2][1:].T
    u, v = (points[tops] - points[ends[:, 0]]) @ flat
    sides = np.prod([np.sqrt((own * own).sum(axis=1)) for own in (u, v, u - v)], axis=0)
    bends = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / sides  # half of that of the circle through all three
    one, two = np.hstack([np.empty((2, 0), np.int64), *equal_pairs(pairs.T.reshape(-1))]) % len(pairs)
    alike = np.abs(bends[one] - bends[two]) <= EVENLY * bends[one]
    groups = groups_of(components(np.column_stack([one, two])[alike], len(pairs)))
    return [own for own in (np.unique(pairs[group]) for group in groups) if len(own) >= FEWEST]


def _goes_on(points: Array, surface: Swept, group: Ints, pairs: Ints, ends: Ints, bends: Array) -> bool:
    """Tell whether facets of a cylinder or a cone are bent along it too, as the next ones are: gores of others."""
    members, others = np.zeros((2, int(pairs.max()) + 1), bool)
    members[group] = True
    inside = members[pairs]
    rows = np.flatnonzero(inside[:, 0] != inside[:, 1])
    start, end = points[ends[rows, 0]], points[ends[rows, 1]]
    rows = rows[np.abs(dots(units(end - start), surface.ruling(start))) < STEEP]
    own, beyond = pairs[rows][inside[rows]], pairs[rows][~inside[rows]]
    others[beyond] = True
    further = np.flatnonzero(others[pairs].any(axis=1) & ~inside.any(axis=1))
    one, two = np.hstack(
        [np.empty((2, 0), np.int64), *equal_pairs(np.concatenate([beyond, pairs[further].T.reshape(-1)]))]
    )
    one, two = (each[(one < len(rows)) & (two >= len(rows))] for each in (one, two))
    this, that = rows[one], np.tile(further, 2)[two - len(rows)]
    alike = np.abs(bends[this] - bends[that]) <= EVENLY * np.abs(bends[this])
    alike &= (ends[this][:, :, None] != ends[that][:, None]).all(axis=(1, 2))  # at the opposite side of the next one
    both = np.count_nonzero(np.bincount(own[np.unique(one[alike])]) > 1)  # ends of a facet
    return bool(both > max(np.count_nonzero(np.bincount(own) > 1) / 2.0, len(group) / 4.0))


def _cones(body: Body, facets: list[Label], normals: dict[Label, Array], pairs: Ints, ends: Ints) -> list[Round]:
    """Return cones: the edges between facets side by side meet in one point."""
    places = body.vertices[ends[:, 0]]
    ways = body.vertices[ends[:, 1]] - places
    ways /= norms(ways)[:, None]
    faces, others, edges = pairs.T.reshape(-1), pairs[:, ::-1].T.reshape(-1), np.tile(np.arange(len(pairs)), 2)
    one, two = np.hstack([np.empty((2, 0), np.int64), *equal_pairs(faces)])  # two edges each of one face
    (u, v), between = (ways[edges[k]] for k in (one, two)), places[edges[two]] - places[edges[one]]
    cosine = (u * v).sum(axis=1)
    open_ = np.abs(cosine) < 1.0 - ROUND**2
    one, two, u, v, between, cosine = (own[open_] for own in (one, two, u, v, between, cosine))
    far = ((between * u).sum(axis=1) - (between * v).sum(axis=1) * cosine) / (1.0 - cosine**2)
    apexes = places[edges[one]] + far[:, None] * u
    keys = np.round(apexes / (ROUND * body.size))
    first, own, counts = np.unique(keys, axis=0, return_index=True, return_inverse=True, return_counts=True)[1:]
    groups = groups_of(own.reshape(-1))
    found, owner = list[Round](), np.full(len(facets), -1)
    for k in np.flatnonzero(counts >= FEWEST - 2).tolist():
        around = np.concatenate([np.column_stack([faces[e[groups[k]]], others[e[groups[k]]]]) for e in (one, two)])
        for group in side_by_side(around, FEWEST):
            labels = [facets[j] for j in group.tolist()]
            if (cone := _cone(body, labels, normals, apexes[first[k]])) is not None:
                owner[group] = len(found)
                found.append(cone)
    of = owner[pairs]
    looks = np.array([normals[face] for face in facets])
    turned = (looks[pairs[:, 0]] * looks[pairs[:, 1]]).sum(axis=1)
    rings = of[(of >= 0).all(axis=1) & (of[:, 0] != of[:, 1]) & (turned > STEEP)]
    return [cone for k, cone in enumerate(found) if k not in rings]


def _cone(body: Body, faces: list[Label], normals: dict[Label, Array], apex: Array) -> Round | None:
    """Return what facets about an apex are: None where their corners do not lie on one cone."""
    looks = np.array([normals[face] for face in faces])
    axis = np.linalg.svd(looks - looks.mean(axis=0), full_matrices=False)[2][-1]
    corners = body.vertices[np.unique([v - 1 for face in faces for v in face])] - apex
    along = corners @ axis
    away = np.linalg.norm(corners - along[:, None] * axis, axis=1)
    slope = float(away.max() / np.abs(along).max())
    off = float(np.abs(away - slope * np.abs(along)).max())
    flat = abs(float(looks[0] @ axis)) > BLUNT
    if flat or np.ptp(looks @ axis) > ROUND or off > ROUND * body.size or np.ptp(np.sign(np.round(along, 9))) == 2:
        return None
    middle = body.vertices[np.array(faces[0]) - 1].mean(axis=0) - apex
    outward = bool(normals[faces[0]] @ (middle - (middle @ axis) * axis) > 0.0)
    axis *= np.sign(along.sum())
    steep, start = np.polyfit(np.abs(along), away, 1)
    line = np.array([1.0, steep]) / np.hypot(1.0, steep)
    surface = Swept(apex - start / steep * axis, axis, (float(line[0]), float(line[1])), 0.0, 0.0)
    name = f"{'cone' if outward else 'countersink'} radius {_ends(away)}"
    return Round(name, surface, faces)


def _ends(radii: Array) -> str:
    """Return the least and the largest radius in words; one that is rounding is 0."""
    least, most = float(radii.min()), float(radii.max())
    return f"{radius_text(least) if least > TIP * most else '0'} to {radius_text(most)}"


def neighbours(faces: list[Label]) -> tuple[Ints, Ints]:
    """Return the places of faces with just two corners in common, (m, 2), and the rows of those corners, (m, 2)."""
    ends, owners = [np.empty((0, 2), np.int64)], [np.empty(0, np.int64)]
    for places, corners in by_size(faces):
        for i, j in combinations(range(corners.shape[1]), 2):
            ends.append(corners[:, (i, j)] - 1)
            owners.append(np.asarray(places))
    rows, own = np.concatenate(ends), np.concatenate(owners)
    order = np.argsort(own, kind="stable")
    rows, own = rows[order], own[order]
    one, two = np.hstack([np.empty((2, 0), np.int64), *equal_pairs(rows)])  # faces with the same two corners
    pairs = np.column_stack([own[one], own[two]])
    both, first, counts = np.unique(pairs, axis=0, return_index=True, return_counts=True)
    return both[counts == 1], rows[one[first[counts == 1]]]


def side_by_side(pairs: Ints, fewest: int) -> list[Ints]:
    """Return the groups of so many at least that pairs join."""
    some, places = np.unique(pairs, return_inverse=True)
    if len(some) < fewest:
        return []
    return [some[group] for group in groups_of(components(places.reshape(-1, 2), len(some))) if len(group) >= fewest]


def _cylinder(body: Body, faces: list[Label], normals: dict[Label, Array]) -> Round | None:
    """Return what facets around an axis are: None where corners between them are not as far from it."""
    shared = Counter(v for face in faces for v in face)
    own = {v for v in shared if shared[v] > 1}  # a flat may cut a cylinder off within its last facets
    flat = np.linalg.svd(np.array([normals[face] for face in faces]), full_matrices=False)[2][:2]
    points = body.vertices @ flat.T
    centre, radius, spread = _about(points[np.array(sorted(own)) - 1])
    if spread > ROUND * radius:
        return None
    near = np.abs(np.linalg.norm(points - centre, axis=1) - radius) <= ROUND * radius
    faces = [face for face in faces if near[np.array(face) - 1].all()]
    outward = {normals[face] @ flat.T @ (points[face[0] - 1] - centre) > 0.0 for face in faces}
    if len(outward) != 1:
        return None
    surface = Swept(centre @ flat, np.cross(*flat), (1.0, 0.0), 0.0, radius)
    return Round(f"{ROUND_KINDS[True not in outward]} radius {radius_text(radius, spread)}", surface, faces)
