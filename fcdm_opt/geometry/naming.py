"""Short names of faces that labels of many corners, or of facets of a cylinder, tell little of."""

from __future__ import annotations

from collections import Counter, defaultdict
from functools import lru_cache
from itertools import combinations

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.polygons import components
from fcdm_opt.tolerances import DEFAULT

MANY = 8  # corners from which a plane face goes by a name
FEWEST = 6  # facets side by side that are taken for a cylinder
BALL = 20  # those that are taken for a sphere
TURN = 0.65  # cosine: the most that two of them are turned against one another
ROUND = 1e-4  # of the radius: how far corners may be off it
WHOLLY = 0.1  # share of directions across a cone's: a sphere looks all ways
STEEP = 0.9  # cosine: two cones side by side that are turned less against one another are rings of a rounding
BLUNT = 0.98  # component of a cone's normals along its axis from which on it may be a corner of any round face
ASLANT = 0.2  # component of a normal from which on a face looks along that axis too
ENDS = (("back", "front"), ("left", "right"), ("bottom", "top"))
"""Faces that a body ends with along x, y and z: below, above."""
SIDES = tuple(side for pair in ENDS for side in pair)

Label = tuple[int, ...]


def names_of_faces(body: Body) -> dict[Label, str]:
    """Return the names of those faces of a body that have one, by their labels.

    "cylinder radius 9.9" for each facet of a convex cylinder, "bore radius 9.9" for those of a concave one, "sphere
    radius 9.9" and "hollow radius 9.9", "cone radius 4 to 8" and "countersink radius 4 to 8" alike, the radius of
    their corners ("bore radius 2 no. 1" where several are alike); "top", "bottom" and so on for plane faces of many
    corners that the body ends with along an axis; "face 12", as they are counted, for others.
    """
    return _names_of_faces(body.whole or body)


@lru_cache(maxsize=16)
def _names_of_faces(body: Body) -> dict[Label, str]:
    normals = normals_of_faces(body)
    return {**_plane(body, normals, MANY), **_round(body, normals)}


def told_element(body: Body, element: Element) -> str:
    """Return an element in words: "top face (facing +z)", "bore of radius 10", "face 3 (facing -x)", "corner 5".

    An edge is told by the faces that meet in it; what lies within one round face is told as that.
    """
    label, names = tuple(sorted(element.vertices)), told_faces(body)
    if element.kind == "F":
        name, side = names.get(label, ("face", ""))
        told = f"{name} face" if name in SIDES else _rounded(name)
        return f"{told} (facing {side})" if side else told
    sides = list(
        dict.fromkeys(_rounded(names[face][0]) for face in body.faces if {*label} <= {*face} and face in names)
    )
    if len(sides) == 1 and is_round(sides[0]):
        return sides[0]
    if element.kind == "V" and not (len(sides) == 2 and any(map(is_round, sides))):  # else on the rim of a round face
        return f"corner {label[0]}"
    if len(sides) == 2:
        return f"edge between {sides[0]} and {sides[1]}"
    return f"edge from corner {label[0]} to {label[-1]}"


def is_round(told: str) -> bool:
    """Tell whether an element in words is a round face."""
    return " of radius " in told and not told.startswith("edge ")


def _rounded(name: str) -> str:
    return name.replace(" radius ", " of radius ")


@lru_cache(maxsize=16)
def told_faces(body: Body) -> dict[Label, tuple[str, str]]:
    """Return a name for every face of a body, and the axes that it looks along, "" where it is round."""
    normals = normals_of_faces(body)
    named = {}
    for face, name in {**_plane(body, normals, 0), **_round(body, normals)}.items():
        normal = normals[face]
        along = [k for k in np.argsort(-np.abs(normal), kind="stable").tolist() if abs(normal[k]) >= ASLANT]
        sides = [f"{'-+'[int(normal[k] > 0.0)]}{'xyz'[k]}" for k in along]
        named[face] = (name, "" if " radius " in name else " and ".join(sides))
    return named


def names_of_rows(body: Body) -> list[str]:
    """Return the names of a body's faces, in their order; "face 12" where there is nothing better."""
    told = told_faces(body)
    return [told.get(tuple(sorted(face)), (f"face {k}", ""))[0] for k, face in enumerate(body.faces, 1)]


def normals_of_faces(body: Body) -> dict[Label, Array]:
    """Return a normal of each face that a part carries."""
    normals: dict[Label, Array] = {}
    for part in body.parts:
        for k, face in enumerate(part.elements["F"]):
            normals.setdefault(face.vertices, part.normals[k])
        for (kind, k), span in part.elements.spans.items():
            for face in span.elements if kind == "F" else ():
                normals.setdefault(face.vertices, part.normals[k])
    return normals


def _plane(body: Body, normals: dict[Label, Array], least: int) -> dict[Label, str]:
    """Return the names of plane faces with so many corners at least."""
    named, taken = dict[Label, str](), set[str]()
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    slack = DEFAULT.side * float((high - low).max())
    for number, face in enumerate(body.faces, 1):
        if len(face) < least or face not in normals:
            continue
        normal, corner = normals[face], body.vertices[face[0] - 1]
        k = int(np.abs(normal).argmax())
        up = bool(normal[k] > 0.0)
        ends = abs(normal[k]) >= 1.0 - DEFAULT.side and abs((high if up else low)[k] - corner[k]) <= slack
        named[face] = ENDS[k][up] if ends and ENDS[k][up] not in taken else f"face {number}"
        taken.add(named[face])
    return named


def _round(body: Body, normals: dict[Label, Array]) -> dict[Label, str]:
    """Return the names of facets that lie side by side around one axis."""
    around = defaultdict[int, set[Label]](set)
    facets = [face for face in normals if len(face) < MANY]
    for face in facets:
        for vertex in face:
            around[vertex].add(face)
    by_axis, smooth = defaultdict[Label, list[tuple[Label, Label]]](list), list[tuple[Label, Label]]()
    for face in facets:
        for other in set[Label]().union(*(around[vertex] for vertex in face)):
            shared = sorted(set(face) & set(other))
            if face >= other or len(shared) != 2 or not TURN <= normals[face] @ normals[other] < 1.0 - ROUND:
                continue
            way = body.vertices[shared[1] - 1] - body.vertices[shared[0] - 1]
            way = way / np.linalg.norm(way)
            way *= np.sign(way[np.abs(way).argmax()])
            by_axis[tuple(np.round(way / ROUND).astype(int).tolist())].append((face, other))
            smooth.append((face, other))
    rounds = [(_radius(body, own, normals, None), own) for own in _side_by_side(smooth, BALL)]
    for key, pairs in by_axis.items():
        axis = np.array(key, dtype=np.float64)
        rounds += [(_radius(body, own, normals, axis), own) for own in _side_by_side(pairs, FEWEST)]
    known = {face for name, own in rounds if name for face in own}
    rounds += _cones(body, normals, [pair for pair in smooth if not known & {*pair}])
    alike = Counter(name for name, _ in rounds)
    numbers, named = dict[int, int](), dict[Label, str]()
    counted = Counter[str]()
    for k in sorted(range(len(rounds)), key=lambda k: rounds[k][1]):
        counted[rounds[k][0]] += 1
        numbers[k] = counted[rounds[k][0]]
    for k, (name, own) in enumerate(rounds):
        numbered = f"{name} no. {numbers[k]}" if alike[name] > 1 else name
        named |= dict.fromkeys(own, numbered) if name else {}
    return named


def _cones(body: Body, normals: dict[Label, Array], smooth: list[tuple[Label, Label]]) -> list[tuple[str, list[Label]]]:
    """Return the names and facets of cones: the edges between facets side by side meet in one point."""
    edges = defaultdict[Label, list[tuple[Label, Array, Array]]](list)
    for pair in smooth:
        one, two = (body.vertices[vertex - 1] for vertex in sorted({*pair[0]} & {*pair[1]}))
        for face, other in (pair, pair[::-1]):
            edges[face].append((other, one, (two - one) / np.linalg.norm(two - one)))
    by_apex, apexes = defaultdict[Label, list[tuple[Label, Label]]](list), dict[Label, Array]()
    for face, beside in edges.items():
        for (first, p, u), (second, q, v) in combinations(beside, 2):
            if abs(u @ v) < 1.0 - ROUND**2:
                apex = p + np.linalg.lstsq(np.column_stack([u, -v]), q - p)[0][0] * u
                key = tuple(np.round(apex / (ROUND * body.size)).astype(int).tolist())
                apexes.setdefault(key, apex)
                by_apex[key] += [(face, first), (face, second)]
    found = list[tuple[str, list[Label]]]()
    for key, pairs in by_apex.items():
        for own in _side_by_side(pairs, FEWEST):
            if name := _cone(body, own, normals, apexes[key]):
                found.append((name, own))
    owner = {face: k for k, (_, own) in enumerate(found) for face in own}
    rings = {
        owner[face]
        for pair in smooth
        if len({owner.get(face, -1) for face in pair} - {-1}) == 2 and normals[pair[0]] @ normals[pair[1]] > STEEP
        for face in pair
    }
    return [cone for k, cone in enumerate(found) if k not in rings]


def _cone(body: Body, faces: list[Label], normals: dict[Label, Array], apex: Array) -> str:
    """Return what facets about an apex are: nothing where their corners do not lie on one cone."""
    looks = np.array([normals[face] for face in faces])
    axis = np.linalg.svd(looks - looks.mean(axis=0), full_matrices=False)[2][-1]
    corners = body.vertices[np.unique([v - 1 for face in faces for v in face])] - apex
    along = corners @ axis
    away = np.linalg.norm(corners - along[:, None] * axis, axis=1)
    slope = float(away.max() / np.abs(along).max())
    off = float(np.abs(away - slope * np.abs(along)).max())
    flat = abs(float(looks[0] @ axis)) > BLUNT
    if flat or np.ptp(looks @ axis) > ROUND or off > ROUND * body.size or np.ptp(np.sign(np.round(along, 9))) == 2:
        return ""
    middle = body.vertices[np.array(faces[0]) - 1].mean(axis=0) - apex
    outward = bool(normals[faces[0]] @ (middle - (middle @ axis) * axis) > 0.0)
    return f"{'cone' if outward else 'countersink'} radius {away.min():.4g} to {away.max():.4g}"


def _side_by_side(pairs: list[tuple[Label, Label]], fewest: int) -> list[list[Label]]:
    """Return the groups of so many facets at least that pairs join."""
    faces = sorted({face for pair in pairs for face in pair})
    if len(faces) < fewest:
        return []
    place = {face: k for k, face in enumerate(faces)}
    owners = components(np.array([[place[one], place[two]] for one, two in pairs]), len(faces))
    groups = [np.flatnonzero(owners == owner) for owner in np.unique(owners).tolist()]
    return [[faces[k] for k in group] for group in groups if len(group) >= fewest]


def _radius(body: Body, faces: list[Label], normals: dict[Label, Array], axis: Array | None) -> str:
    """Return what facets around an axis, or a point, are: nothing where their corners are not as far from it."""
    own = {v for face in faces for v in face}
    if axis is None:  # where a sphere is cut off, corners lie on its facets' edges
        rim = {v for face in {*body.faces} - {*faces} for v in face}
        own = own - rim if len(own - rim) >= MANY else own
    corners = body.vertices[np.array(sorted(own)) - 1]
    looks = np.array([normals[face] for face in faces])
    if axis is None and np.linalg.svd(looks - looks.mean(axis=0), full_matrices=False)[1][-1] < WHOLLY * np.sqrt(
        len(faces)
    ):
        return ""  # a cylinder or a cone: two of its rings lie on a sphere too
    flat = np.eye(3) if axis is None else np.linalg.svd(axis[None] / np.linalg.norm(axis))[2][1:]
    points = corners @ flat.T
    # |x - c|^2 = r^2, linear in c and r^2 - c^2
    found = np.linalg.lstsq(np.column_stack([2.0 * points, np.ones(len(points))]), (points**2).sum(axis=1))[0]
    centre = found[:-1]
    off = np.linalg.norm(points - centre, axis=1)
    radius = float(off.mean())
    if np.abs(off - radius).max() > ROUND * radius:
        return ""
    if axis is None:
        arms = np.array([body.vertices[np.array(face) - 1].mean(axis=0) for face in faces]) - centre
        if (np.abs((arms * looks).sum(axis=1)) < STEEP * np.linalg.norm(arms, axis=1)).any():
            return ""
    outward = {normals[face] @ flat.T @ (body.vertices[face[0] - 1] @ flat.T - centre) > 0.0 for face in faces}
    kinds = ("sphere", "hollow") if axis is None else ("cylinder", "bore")
    return f"{kinds[0] if True in outward else kinds[1]} radius {radius:.4g}" if len(outward) == 1 else ""
