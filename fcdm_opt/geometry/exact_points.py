"""Bodies within the true ones that are exact at chosen points of their round faces.

Facets of a round face leave it. A body within the true one (`facet_errors.bounding_bodies`) leaves it everywhere, but
by little: with a small convex piece of the true solid added at a point, its corner or flat there is on the true face
and has its normal. Where bodies meet at such points, amounts are those of the true faces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np

from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body, ConvexPart, ExactPoints, PointPiece
from fcdm_opt.geometry.elements import Element, Elements
from fcdm_opt.geometry.facet_errors import bounding_bodies, round_surfaces
from fcdm_opt.geometry.hull import Hull, convex_hull
from fcdm_opt.geometry.measures import cross, norms, units
from fcdm_opt.geometry.patches import Patch, true_faces
from fcdm_opt.tolerances import DEFAULT

BENT = 0.3  # radians: how far the face turns across such a piece
SHARE = 0.1  # of the body's size: it is no larger
DEEP = 0.5  # of its width, and of the material there: its depth
NARROWER = 4.0  # times how far the next such point is: there the face bends less across it
LOWER = 0.02  # of its width: so much lower the ends of a line on it are, so that it touches in one point
NEXT_TO_EDGE = 1e-2  # of the size: a point no further from an edge has a piece like one on it
SMALL = 1e-6  # of the size: where no larger piece has room there is none
PUSHES = 60  # by which a point is brought into the material


def exact_at(body: Body, points: Array) -> Body | None:
    """Return a body within the true one that reaches points of its faces; None where no such body is known.

    `points` (n, 3): as drawn; one near no round face or its edge changes nothing.
    """
    found = bounding_bodies(body)
    if found is None:
        return None
    if not round_surfaces(body):
        return found[0]
    inner, pieces = found[0], list[tuple[Array, tuple[int, ...], Array, Hull]]()
    drawn, known = np.concatenate([part.vertices for part in inner.parts]), np.zeros((0, 3))
    # in a bore wider ones lead to less than is right
    least = 0.0 if any(own.concave for own in true_faces(body).patches) else SMALL * body.size
    for point in np.asarray(points, float).reshape(-1, 3):
        next_to = float(norms(known - point).min(initial=np.inf))
        far = min(next_to, norms(drawn - point).min()) > DEFAULT.tie * body.size
        if far and (own := _pieces(body, NARROWER * max(next_to, least), *point.tolist())):
            pieces += own
            known = np.concatenate([known, point[None]])
    rows, parts = [inner.vertices], list[ConvexPart]()
    count = len(inner.vertices)
    made = list[PointPiece]()
    for corners, of, normals, hull in pieces:
        used, pair = hull.used + count + 1, np.sort(hull.used[hull.edges[:, :2]], axis=1) + count + 1
        named = Elements(
            [Element("V", (v,)) for v in used.tolist()],
            [Element("E", (v, w)) for v, w in pair.tolist()],
            [Element("F", tuple(sorted(used[list(loop)].tolist()))) for loop in hull.loops],
        )
        parts.append(ConvexPart(frozen(corners[hull.used]), body.seed, hull.loops, frozen(hull.edges, np.int64), named))
        made.append(PointPiece(count + 1, count + len(corners), of, frozen(normals)))
        count += len(corners)
        rows.append(corners)
    points, every = frozen(np.concatenate(rows)), (*inner.parts, *parts)
    return replace(inner, name=body.name, vertices=points, parts=every, exact=ExactPoints(body, tuple(made)))


@lru_cache(maxsize=256)  # each further point is asked for with those before it
def _pieces(body: Body, widest: float, *place: float) -> list[tuple[Array, tuple[int, ...], Array, Hull]]:
    """Return corners of a convex piece of the true solid at a point, those on the faces first; see `PointPiece`."""
    # of faces that go on in each other smoothly there, each has one of its own, as sizes may move either alone
    faces, point = true_faces(body), np.array(place)
    size = faces.body.size
    near = faces.at(point)
    # beside an edge as at it, else a piece would be too small to hold
    if near and (room := faces.room(near, point)) < NEXT_TO_EDGE * size:
        around = faces.at(point, (1.0 + DEFAULT.sharp) * room + SMALL * size)
        near = [k for k in around if not any((min(k, own), max(k, own)) in faces.reentrant for own in near)]
        beyond = max((float(faces.patches[k].gaps(point[None])[0][0]) for k in near), default=0.0)
        point = faces.onto(near, point) if beyond > DEFAULT.tie * size else point  # where facets end beyond the edge
    if not near or (not faces.is_round[near].any() and _is_within(body, point)):
        return []
    patches = [faces.patches[k] for k in near]
    every = np.array([own.gaps(point[None])[1][0] for own in patches])
    alike = norms(cross(every[:, None], every)) < DEFAULT.sharp
    smooth = [np.flatnonzero(own) for own in np.unique(alike, axis=0)[::-1]]
    normals = every[[own[0] for own in smooth]]
    middle = units(normals.sum(axis=0))
    # as places on the face are off those beside the point
    width = (1.0 - BENT**2 / 8.0) * faces.room(near, point)
    bend = max(float(np.abs(np.linalg.eigvalsh(own.bends(point[None])[0])).max()) for own in patches)
    full_width = min(width, SHARE * size, BENT / bend if bend > 0.0 else np.inf)
    width = min(full_width, widest)
    depth = DEEP * min(width, faces.depth(point, -middle))
    if not min(width, depth) > SMALL * size:
        return []
    if len(normals) == 1:
        bent = bend > 0.0
        frame = np.linalg.eigh(patches[0].bends(point[None])[0])[1] if bent else np.linalg.svd(middle[None])[2].T
        one, two = (frame[:, k] for k in np.argsort(np.abs(frame.T @ middle))[:2])
        directions = [one, -one, two, -two]
    elif len(normals) == 2:  # along the edge, and from it along either face
        along = units(cross(normals[0], normals[1]))
        on_faces = (cross(normal, along) for normal in normals)
        away = (own * -np.sign(own @ other) for own, other in zip(on_faces, normals[::-1], strict=True))
        directions = [along, -along, *away]
    else:
        first, second = np.triu_indices(len(normals), 1)  # edges of the cone below the planes with these normals
        along = cross(normals[first], normals[second])
        along = along[norms(along) > DEFAULT.sharp]
        both = units(np.concatenate([along, -along]))
        directions = [*both[(both @ normals.T <= DEFAULT.sharp).all(axis=1)]]
        if len(directions) < 3:
            return []
    # of a straight line, as along a cylinder, the first piece has lower ends; one beside another point is exact as far
    # as the face goes, so that further points need no more of them there
    bends = patches[0].bends(point[None])[0]
    straight = [len(normals) == 1 and abs(d @ bends @ d) < DEFAULT.tie * bend for d in directions]
    lower = LOWER * middle if bend > 0.0 and patches[0].side > 0.0 else np.zeros(3)
    ends = [
        (full_width, lower * (width == full_width)) if own else (width, lower * (len(normals) > 1)) for own in straight
    ]
    ring = [_within(patches, point + far * (d - low)) for d, (far, low) in zip(directions, ends, strict=True)]
    corners = np.array([point, *ring, point - depth * middle])
    hull = convex_hull(corners, np.arange(len(corners)), "a piece of a round face")
    chosen = [sorted(own) for own in product(*smooth)]
    return [(corners, tuple(faces.row_at(near[k], point) for k in own), every[own], hull) for own in chosen]


def _is_within(body: Body, point: Array) -> bool:
    """Tell whether a body within the true one has a point: beside a bore its plane faces may end before."""
    found, near = bounding_bodies(body), DEFAULT.tie * body.size
    parts = () if found is None else found[0].parts
    return any((part.normals @ point - part.levels).max() <= near for part in parts)


def _within(patches: Sequence[Patch], point: Array) -> Array:
    """Return a point brought into the material of all patches, the nearest way by each in turn."""
    for _ in range(PUSHES):
        gaps = [own.gaps(point[None]) for own in patches]
        gap, normal = max(((float(gap[0]), normal[0]) for gap, normal in gaps), key=lambda own: own[0])
        if gap <= 0.0:
            break
        point = point - gap * normal
    return point
