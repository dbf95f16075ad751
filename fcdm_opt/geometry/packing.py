"""A convex part as two flat arrays for the compiled kernels, with error bounds of what was rounded.

Reals, (2 n + f + 1, 4), relative to the seed in the body's axes:

    row k             vertex k rounded, 0
    row n + i         unit normal of face i, and a bound of its distance from the unit normal of every exact facet in it
    row n + f         largest distance of a vertex from the seed, 1 where the half-edges are those of the exact hull,
                      1 where the seed is inside for certain, 0
    row n + f + 1 + k what rounding took from vertex k, 0

Ints, 1-D, behind a header of nine: n, f, m, the offsets of the five tables below, and the cells along an edge of the
cube that its last two speak of

    half-edges        (2 m, 4): origin, end, face on the left, next of that face; 2 k and 2 k + 1 run along edge k
    vertex starts     (n): a half-edge that leaves each vertex
    face starts       (f): a half-edge of each face
    support grid      (6 cells^2): the vertex extreme in the direction of each cell of a cube about the seed
    exit grid         (6 cells^2): the face that a ray from the seed in that direction leaves through, if it is inside
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fcdm_opt.geometry.arrays import Array, Ints, frozen
from fcdm_opt.geometry.measures import cross, norms
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.geometry.bodies import ConvexPart

HEADER = 9
_UNIT = 2.0**-53
_MOST_CELLS = 16  # along an edge of the cube: a start within a few steps of the answer is all that is wanted
_MANY = (
    2_000  # points that every direction is compared with: the grid is where kernels start to climb, not where they end
)


def packed(part: ConvexPart) -> tuple[Array, Ints]:
    """Return the arrays (reals, ints) of a part."""
    n, f, m = len(part.vertices), len(part.loops), len(part.edges)
    local = part.vertices - part.seed
    # the exact difference less its rounded value (Knuth's two-sum): exact itself
    back = local - part.vertices
    lost = (part.vertices - (local - back)) + (-part.seed - back)
    normals, errors = _face_normals(part)
    radius = float(np.sqrt((local**2).sum(axis=1)).max()) * (1 + 4 * _UNIT)
    half = np.array(part.half_edges)
    table = np.column_stack([half[:, 0], half[half[:, 2], 0], half[:, 1], half[:, 3]])
    faces, vertices = np.empty(f, np.int64), np.empty(n, np.int64)
    faces[half[:, 1]], vertices[half[:, 0]] = np.arange(2 * m), np.arange(2 * m)
    levels = (normals * local[table[faces, 0]]).sum(axis=1)
    inside = bool((levels > radius * (2 * errors + 16 * _UNIT)).all())
    cells = int(np.clip(np.ceil(2 * np.sqrt(n / 6)), 4, _MOST_CELLS))
    towards = _directions(cells)
    supports = _extreme(towards, local)
    # the ray's exit is the extreme vertex of the polar dual
    dual = normals / levels[:, None] if inside else normals
    exits = _extreme(towards, dual)
    tables = (table.ravel(), vertices, faces, supports, exits)
    offsets = HEADER + np.concatenate([[0], np.cumsum([len(entries) for entries in tables])])
    reals = np.zeros((2 * n + f + 1, 4))
    reals[:n, :3], reals[n : n + f, :3], reals[n : n + f, 3] = local, normals, errors
    reals[n + f, :3] = radius, _is_convex(part, normals, errors), inside
    reals[n + f + 1 :, :3] = lost
    header = [n, f, m, *offsets[:5].tolist(), cells]
    return frozen(reals), frozen(np.concatenate([header, *tables]), np.int64)


def packed_in_one(parts: Sequence[ConvexPart]) -> tuple[Array, Ints, Ints]:
    """Return the arrays of several parts one after the other, and the first row and entry of each, (parts + 1, 2)."""
    reals, ints = zip(*(part.packed for part in parts), strict=True)
    sizes = [(len(own), len(table)) for own, table in zip(reals, ints, strict=True)]
    places = np.concatenate([np.zeros((1, 2), np.int64), np.cumsum(sizes, axis=0)])
    return frozen(np.concatenate(reals)), frozen(np.concatenate(ints), np.int64), frozen(places, np.int64)


@lru_cache
def _directions(cells: int) -> Array:
    """Return the middles of the cells of a cube, in the order of `kernels._cell`."""
    middles = (2 * np.arange(cells) + 1) / cells - 1
    u, v = (x.ravel() for x in np.meshgrid(middles, middles, indexing="ij"))
    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            side = np.empty((cells * cells, 3))
            side[:, axis], side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = sign, u, v
            sides.append(side)
    return np.vstack(sides)


def _extreme(directions: Array, points: Array) -> Ints:
    """Return the point with the largest product with each direction, of many points one not far from it."""
    some = np.linspace(0, len(points) - 1, min(len(points), _MANY)).astype(np.int64)
    return some[(directions @ points[some].T).argmax(axis=1)]


def _exact(points: Array) -> NDArray[np.object_]:
    """Return points times one power of two that makes them integers, relative to the first."""
    ratios = [[x.as_integer_ratio() for x in point] for point in points.tolist()]
    unit = max(down for row in ratios for _, down in row)
    whole = np.array([[up * (unit // down) for up, down in row] for row in ratios], dtype=object)
    return whole - whole[0]


def _face_normals(part: ConvexPart) -> tuple[Array, Array]:
    """Return unit normals of the faces and a bound of their distance from the normals of all exact facets in them."""
    loops = part.loops
    normals, errors = np.empty((len(loops), 3)), np.empty(len(loops))
    sizes = np.array([len(loop) for loop in loops])
    triangles = np.flatnonzero(sizes == 3)
    if triangles.size:
        corners = part.vertices[np.array([loops[k] for k in triangles])]
        one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        across = cross(one, two)
        area = np.sqrt((across**2).sum(axis=1))
        with np.errstate(divide="ignore", invalid="ignore"):
            normals[triangles] = across / area[:, None]
            errors[triangles] = 8 * _UNIT * np.sqrt((one**2).sum(axis=1) * (two**2).sum(axis=1)) / area
        slim = triangles[~(errors[triangles] <= DEFAULT.normal)]
    else:
        slim = triangles
    for k in slim.tolist():
        _, one, two = _exact(part.vertices[list(loops[k])])
        normals[k], errors[k] = _rounded_unit(cross(one, two)), 5 * _UNIT
    for k in np.flatnonzero(sizes > 3).tolist():
        normals[k], errors[k] = _polygon_normal(part.vertices[list(loops[k])], part.normals[k])
    return normals, errors


def _rounded_unit(n: NDArray[Any]) -> Array:
    """Return the unit vector of an integer direction, to 5 roundings: entries, norm, quotient."""
    rounded = np.array([x / max(map(abs, n)) for x in n])
    return np.asarray(rounded / np.sqrt((rounded**2).sum()))


def _polygon_normal(polygon: Array, drawn: Array) -> tuple[Array, float]:
    """Return a polygon's unit normal with its error bound: rounding where it is planar, else its spread too."""
    exact = _exact(polygon)
    corner = int(np.argmax(norms(cross(polygon[1:-1] - polygon[0], polygon[2:] - polygon[0])))) + 1
    n = cross(exact[corner], exact[corner + 1])
    if not (exact @ n).any():
        return _rounded_unit(n), 5 * _UNIT
    spokes = polygon - polygon[0]
    radius = float(np.sqrt((spokes**2).sum(axis=1)).max())
    ratios = [float(x).as_integer_ratio() for x in drawn]
    unit = max(down for _, down in ratios)
    whole = np.array([up * (unit // down) for up, down in ratios], dtype=object)
    height = max(abs(exact @ whole)) / (unit * abs(exact).max()) * float(np.abs(spokes).max())
    # A facet on three of the corners tilts by at most the spread, 2 height, over that triangle's least height, which is
    # least / reach; the smallest triangle of a convex polygon has consecutive corners. Doubled.
    before, after = np.roll(polygon, 1, axis=0) - polygon, np.roll(polygon, -1, axis=0) - polygon
    least = float(norms(cross(before, after)).min())
    return drawn, 8 * height * radius / least + 8 * _UNIT if least > 0 else np.inf


def _is_convex(part: ConvexPart, normals: Array, errors: Array) -> bool:
    """Tell whether the exact facets of any two neighbouring faces certainly meet at a convex edge."""
    along = part.vertices[part.edges[:, 1]] - part.vertices[part.edges[:, 0]]
    left, right = part.edges[:, 2], part.edges[:, 3]
    folds = (cross(normals[left], normals[right]) * along).sum(axis=1) / np.sqrt((along**2).sum(axis=1))
    doubtful = np.flatnonzero(~(folds > 2 * (errors[left] + errors[right]) + 16 * _UNIT))
    return all(_folds(part, *part.edges[k].tolist()) for k in doubtful)


def _folds(part: ConvexPart, origin: int, end: int, left: int, right: int) -> bool:
    """Tell, exactly, whether every corner of the face on the right lies below the plane of the one on the left."""
    first = next(v for v in part.loops[left] if v not in (origin, end))
    others = [v for v in part.loops[right] if v not in (origin, end)]
    if len(part.loops[left]) > 3 or len(others) > 1:  # not known to be one plane each
        return False
    _, one, two, *rest = _exact(part.vertices[[origin, end, first, *others]])
    return all(point @ cross(one, two) < 0 for point in rest)
