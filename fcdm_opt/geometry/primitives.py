"""Bodies without a file: boxes, prisms, cylinders, cones, spheres and tori, and what is cut out of them or joined.

The round ones are drawn with facets whose corners lie on the surface, and know what that surface is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.errors import InputError, known_arguments, known_word
from fcdm_opt.geometry.arrays import AXES, Array, Ints, distinct_rows, groups_of, numbers
from fcdm_opt.geometry.bodies import Body, Seed
from fcdm_opt.geometry.facet_errors import round_surfaces
from fcdm_opt.geometry.measures import cross, norms, unit_normals, units
from fcdm_opt.geometry.mesh import SEVERAL, checked_mesh, solids
from fcdm_opt.geometry.patch_kernels import gaps_of_each
from fcdm_opt.geometry.tessellation import Surfaces, Swept, errors_of_faces, numbers_of, padded, true_centroid
from fcdm_opt.geometry.units import UnitOrNone
from fcdm_opt.tolerances import DEFAULT

FACETS = 32
"""Facets of a turn where nothing else is asked: as many as in STEP files, see `Tolerances.tessellation_turn`."""
STEPS = 12  # of Newton's method, onto a curve or a corner


@known_arguments
def Box(  # noqa: N802
    size: ArrayLike, *, centre: ArrayLike = (0.0, 0.0, 0.0), name: str = "box", unit: UnitOrNone = ""
) -> Body:
    """Return a box with faces along the axes.

    Parameters
    ----------
    size : (3,) array
        Lengths along x, y and z, > 0.
    centre : (3,) array
        Its middle.
    name : str
        Used in messages and pictures.
    unit : "m", "cm", "mm", "um", "in", "ft" or ""
        Of all lengths.

    Raises
    ------
    InputError
        For what is no size or no place.
    """
    lengths = np.array([_length(x, name, "size") for x in _vector(size, name, "size")])
    corners = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return Body.convex(_vector(centre, name, "centre") + corners * lengths, name=name, unit=unit)


@known_arguments
def Prism(  # noqa: N802
    polygon: ArrayLike,
    height: float,
    *,
    base: ArrayLike = (0.0, 0.0, 0.0),
    axis: ArrayLike | str = "z",
    name: str = "prism",
    unit: UnitOrNone = "",
) -> Body:
    """Return a polygon drawn out along an axis.

    Parameters
    ----------
    polygon : (n, 2) array
        Corners of the polygon in order; it need not be convex. Square to the axis z they are x and y, to x they are
        -z and y, to y x and -z, to any other what the shortest turn from z makes of x and y.
    height : float
        How far it is drawn out, > 0.
    base : (3,) array
        Where the origin of the polygon is.
    axis : (3,) array or axis word
        The direction in which it is drawn out: "x", "-z" or a vector.
    name, unit
        As in `Box`.

    Raises
    ------
    InputError
        For what is no polygon that bounds a piece of the plane, and no height.
    """
    flat, tall = numbers(polygon, f"body '{name}': polygon"), _length(height, name, "height")
    if flat.ndim != 2 or flat.shape[1:] != (2,) or len(flat) < 3 or not np.isfinite(flat).all():
        raise InputError("no polygon", key=f"body '{name}': polygon", found=flat.shape, allowed="(n, 2), n >= 3")
    on = np.roll(flat, -1, axis=0)
    flat = flat if (flat[:, 0] * on[:, 1] - flat[:, 1] * on[:, 0]).sum() > 0.0 else flat[::-1]
    frame = _frame(axis, name)
    start, count = _vector(base, name, "base"), len(flat)
    points = np.concatenate([np.column_stack([flat, np.full(count, z)]) for z in (0.0, tall)])
    sides = [(k, (k + 1) % count, count + (k + 1) % count, count + k) for k in range(count)]
    faces = [tuple(range(count))[::-1], tuple(range(count, 2 * count)), *sides]
    return Body.from_mesh(start + points @ frame, faces, name=name, unit=unit)


@known_arguments
def Cylinder(  # noqa: N802
    radius: float,
    height: float,
    *,
    base: ArrayLike = (0.0, 0.0, 0.0),
    axis: ArrayLike | str = "z",
    facets: int = FACETS,
    name: str = "cylinder",
    unit: UnitOrNone = "",
) -> Body:
    """Return a cylinder.

    Parameters
    ----------
    radius, height : float
        > 0.
    base : (3,) array
        The middle of the disc that it starts with.
    axis : (3,) array or axis word
        The direction from there to the other one: "x", "-z" or a vector.
    facets : int
        How many a turn has as drawn, >= 12; contacts are those of the true face whatever it is.
    name, unit
        As in `Box`.

    Raises
    ------
    InputError
        For what is no radius, height, place or direction.
    """
    return Cone(radius, radius, height, base=base, axis=axis, facets=facets, name=name, unit=unit)


@known_arguments
def Cone(  # noqa: N802
    radius: float,
    top: float,
    height: float,
    *,
    base: ArrayLike = (0.0, 0.0, 0.0),
    axis: ArrayLike | str = "z",
    facets: int = FACETS,
    name: str = "cone",
    unit: UnitOrNone = "",
) -> Body:
    """Return a cone, cut off by two discs.

    Parameters
    ----------
    radius, top : float
        Of the discs that it starts and ends with, > 0.
    height : float
        Between them, > 0.
    base, axis, facets, name, unit
        As in `Cylinder`.

    Raises
    ------
    InputError
        For what is no radius, height, place or direction.
    """
    low, high, tall = (_length(x, name, key) for x, key in ((radius, "radius"), (top, "top"), (height, "height")))
    frame, start = _frame(axis, name), _vector(base, name, "base")
    x, y = _turn(facets, name)
    rings = [np.column_stack([r * x, r * y, np.full(len(x), z)]) for r, z in ((low, 0.0), (high, tall))]
    body = Body.convex(start + np.concatenate(rings) @ frame, name=name, unit=unit)
    slope = math.hypot(tall, high - low)
    line = (tall / slope, (high - low) / slope)
    apex = 0.0 if low == high else -low * tall / (high - low)
    surface = Swept(start + apex * frame[2], frame[2], line, 0.0, low if low == high else 0.0)
    ends = Swept.plane(start, -frame[2]), Swept.plane(start + tall * frame[2], frame[2])
    return _with_surfaces(body, [*ends, surface])


@known_arguments
def Sphere(  # noqa: N802
    radius: float,
    *,
    centre: ArrayLike = (0.0, 0.0, 0.0),
    facets: int = FACETS,
    name: str = "sphere",
    unit: UnitOrNone = "",
) -> Body:
    """Return a sphere.

    Parameters
    ----------
    radius : float
        > 0.
    centre : (3,) array
    facets, name, unit
        As in `Cylinder`.

    Raises
    ------
    InputError
        For what is no radius or place.
    """
    r, middle = _length(radius, name, "radius"), _vector(centre, name, "centre")
    x, y = _turn(facets, name)
    heights = np.pi * (np.arange(1, len(x) // 2) / (len(x) // 2) - 0.5)
    rings = [np.column_stack([math.cos(t) * x, math.cos(t) * y, np.full(len(x), math.sin(t))]) for t in heights]
    points = np.concatenate([[[0.0, 0.0, -1.0]], *rings, [[0.0, 0.0, 1.0]]])
    body = Body.convex(middle + r * points, seed=middle, name=name, unit=unit)
    return _with_surfaces(body, [Swept(middle, np.array(AXES["z"]), None, 0.0, r)])


@known_arguments
def Torus(  # noqa: N802
    ring: float,
    radius: float,
    *,
    centre: ArrayLike = (0.0, 0.0, 0.0),
    axis: ArrayLike | str = "z",
    facets: int = FACETS,
    name: str = "torus",
    unit: UnitOrNone = "",
) -> Body:
    """Return a torus: a tube about a circle.

    Parameters
    ----------
    ring : float
        Radius of the circle, larger than that of the tube.
    radius : float
        Of the tube, > 0.
    centre : (3,) array
    axis : (3,) array or axis word
        Of the circle: "x", "-z" or a vector.
    facets, name, unit
        As in `Cylinder`; around the circle, and half as many around the tube.

    Raises
    ------
    InputError
        For what is no radius, place or direction, and a tube that meets itself.
    """
    large, small = _length(ring, name, "ring"), _length(radius, name, "radius")
    if not small < large:
        allowed = f"less than {ring}"
        raise InputError("the tube meets itself", key=f"body '{name}': radius", found=radius, allowed=allowed)
    frame, middle = _frame(axis, name), _vector(centre, name, "centre")
    x, y = _turn(facets, name)
    u, v = x[::2], y[::2]
    rings = ([(large + small * u) * a, (large + small * u) * b, small * v] for a, b in zip(x, y, strict=True))
    points = np.concatenate([np.column_stack(ring) for ring in rings])
    n, m = len(x), len(u)
    faces = [
        (i * m + j, (i + 1) % n * m + j, (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m)
        for i in range(n)
        for j in range(m)
    ]
    body = Body.from_mesh(middle + points @ frame, faces, seed=middle, name=name, unit=unit)
    return _with_surfaces(body, [Swept(middle, frame[2], None, large, small)])


@known_arguments
def cut(body: Body, *tools: Body, name: str | None = None) -> Body:
    """Return a body without what other bodies fill: a plate with a hole.

    Parameters
    ----------
    body, *tools : Body
    name : str, optional
        Used in messages and pictures; default that of the body.

    Raises
    ------
    InputError
        Where nothing is left.
    """
    return _combined("cut", body, tools, name, lambda one, two: one - two)


@known_arguments
def joined(body: Body, *others: Body, name: str | None = None) -> Body:
    """Return what bodies fill together: a shaft with its collar.

    Parameters
    ----------
    body, *others : Body
    name : str, optional
        Used in messages and pictures; default that of the first.

    Raises
    ------
    InputError
        For what is no body.
    """
    return _combined("joined", body, others, name, lambda one, two: one + two)


def _combined(
    what: str, body: Body, others: Sequence[Body], name: str | None, combine: Callable[[Any, Any], Any]
) -> Body:
    from manifold3d import Manifold, Mesh64

    for own in (body, *others):
        if not isinstance(own, Body):
            raise InputError("wrong kind of argument", key=what, found=type(own).__name__, allowed="a Body")
    corners, planes = _apart((body, *others))

    def solid(own: Array) -> Any:
        first, same = distinct_rows(own)
        rows = np.ascontiguousarray(same.reshape(-1, 3), np.uint64)
        return Manifold(Mesh64(np.ascontiguousarray(own[first]), rows))

    found = reduce(combine, map(solid, corners)).to_mesh64()
    points, triangles = np.array(found.vert_properties)[:, :3], np.array(found.tri_verts, np.int64)
    if not len(triangles):
        raise InputError("nothing is left of it", key=what, found=body.name)
    points, surfaces = _onto_surfaces(points, triangles, (body, *others), planes)
    mesh = checked_mesh(points, triangles, name=body.name if name is None else name)
    within = DEFAULT.cut * float(norms(np.ptp(points, axis=0)))
    middle = true_centroid(mesh.vertices[mesh.triangles], mesh.triangle_faces, Surfaces(tuple(surfaces), 0.0, within))
    seed: Seed = "centroid" if middle is None else middle
    made = _with_surfaces(Body.from_mesh(points, triangles, name=mesh.name, seed=seed, unit=body.unit), surfaces)
    count = len(solids(points, [*map(tuple, triangles.tolist())]))
    return made if count < 2 else replace(made, notes=(*made.notes, f"{count} separate solids{SEVERAL}"))


def _apart(bodies: Sequence[Body]) -> tuple[list[Array], Array]:
    """Return the corners of the triangles of bodies, no plane faces of two of them hardly apart, and all their planes.

    Between faces that only rounding keeps apart there would be sheets without thickness. The later body's is moved
    outwards. Of each plane, (k, 5), its normal, how far along it it is, and where it belongs; none if all are there.
    """
    from scipy.spatial import cKDTree

    size = float(norms(np.ptp(np.concatenate([own.vertices for own in bodies]), axis=0)))
    slack = DEFAULT.touch * size + 2.0 * max(own.rounding for own in bodies)
    planes, corners = np.empty((0, 5)), list[Array]()
    for j, own in enumerate(bodies):
        triangles, owners = own.face_triangles
        normals, bases = own.face_planes
        levels, points, faces = (normals * bases).sum(axis=1), triangles.reshape(-1, 3).copy(), np.repeat(owners, 3)
        plane = np.ones(len(levels), bool) if own.facet_errors is None else own.facet_errors.max(axis=1) == 0.0
        shifts, both = np.zeros(len(levels)), np.concatenate([planes, -planes])[:, [0, 1, 2, 4]]
        asked, scale = np.column_stack([normals, levels]), np.array([1.0, 1.0, 1.0, size])
        near = cKDTree(both / scale).query(asked / scale, distance_upper_bound=DEFAULT.snap)[1]
        for k in np.flatnonzero(plane & (near < len(both))).tolist():
            n, level = both[near[k], :3], both[near[k], 3]
            off = np.abs(points[faces == k] @ n - level).max()
            if off <= slack and (off > 0.0 or np.abs(normals[k]).max() < 1.0):
                shifts[k], levels[k] = level + 4.0 * j * slack - levels[k], level
        placed = levels + np.where(shifts != 0.0, 4.0 * j * slack, 0.0)
        planes = np.concatenate([planes, np.column_stack([normals, placed, levels])[plane]])
        for rows in groups_of(distinct_rows(points)[1]) if shifts.any() else ():
            its = np.unique(faces[rows])
            points[rows] += np.linalg.lstsq(normals[its], shifts[its], rcond=DEFAULT.sharp)[0]
        corners.append(points)
    return corners, planes if (planes[:, 3] != planes[:, 4]).any() else planes[:0]


def _onto_surfaces(points: Array, triangles: Ints, sources: Sequence[Body], planes: Array) -> tuple[Array, list[Swept]]:
    """Return corners of triangles moved onto the surfaces that these stand for, and all of these."""
    # `planes` as of `_apart`: what lies on those moved goes back. A triangle stands for what a face of a source in its
    # plane does. Where facets cut each other, corners come to lie on these alone, beside the curve in which the true
    # faces meet
    with np.errstate(invalid="ignore"):  # triangles without area stand for nothing
        normals = unit_normals(points[triangles])
    levels = (normals * points[triangles[:, 0]]).sum(axis=1)
    near = DEFAULT.nominal * float(norms(np.ptp(points, axis=0)))
    middles = points[triangles].mean(axis=1)
    surfaces, of, nearest = list[Swept](), np.full(len(triangles), -1), np.full(len(triangles), np.inf)
    for own in sources:
        turns, places = own.face_planes
        facets, owners = own.face_triangles
        for surface, faces in round_surfaces(own):
            rows = list(faces)
            cosines = normals @ turns[rows].T
            off = np.abs(levels[:, None] - np.sign(cosines) * (turns[rows] * places[rows]).sum(axis=1))
            alike = np.flatnonzero(((np.abs(cosines) >= 1.0 - DEFAULT.nominal) & (off <= near)).any(axis=1))
            # facets of two pins side by side may be in one plane
            bow = np.abs(surface.misses(facets[np.isin(owners, rows)].mean(axis=1))[0]).max()
            away = np.abs(surface.misses(middles[alike])[0])
            closer = away < np.minimum(nearest[alike], 2.0 * bow + near)
            of[alike[closer]], nearest[alike[closer]] = len(surfaces), away[closer]
            surfaces.append(surface)
    bases, back = points[triangles[:, 0]], np.zeros(len(triangles), bool)
    if len(planes):
        away = planes[planes[:, 3] != planes[:, 4]]
        off = np.abs(points[triangles] @ away[:, :3].T - away[:, 3]).max(axis=1)
        back = (off < np.abs(away[:, 3] - away[:, 4]) / 8.0).any(axis=1)
        some = np.flatnonzero(np.isin(triangles, triangles[back]).any(axis=1) & (of < 0))
        off = np.abs(points[triangles[some]] @ planes[:, :3].T - planes[:, 3]).max(axis=1)
        exact = planes[off.argmin(axis=1)]  # which triangles that are slivers tell badly
        normals[some], bases[some] = exact[:, :3], exact[:, :3] * exact[:, 4:]
    (flat,) = np.nonzero(of < 0)
    flats = [Swept.plane(bases[k], normals[k]) for k in flat.tolist()]
    of[flat] = len(surfaces) + np.arange(len(flat))
    corners, owners = triangles.ravel(), np.repeat(of, 3)
    moved, every, at = points.copy(), [*surfaces, *flats], groups_of(corners)
    asked = np.unique(corners[(owners < len(surfaces)) | np.repeat(back, 3)])
    meeting = [np.unique(owners[at[v]]).tolist() for v in asked.tolist()]
    which = padded(meeting)
    for _ in range(STEPS if len(asked) else 0):
        misses, slopes = gaps_of_each(moved[asked], numbers_of(every), which)
        moved[asked] -= (np.linalg.pinv(slopes, rcond=DEFAULT.sharp) @ misses[..., None])[..., 0]
    return moved, every


def _with_surfaces(body: Body, surfaces: Sequence[Swept]) -> Body:
    """Return a body that knows which surfaces its faces stand for."""
    known = Surfaces(tuple(surfaces), 0.0, DEFAULT.cut * body.size)
    errors, rounds = errors_of_faces(*body.face_triangles, len(body.faces), known)
    off = tuple(np.maximum(errors.max(axis=0), body.deviation).tolist())
    return replace(body, facet_errors=errors, surfaces=rounds, deviation=off)


def _turn(facets: int, name: str) -> tuple[Array, Array]:
    """Return cosines and sines around a circle; a multiple of four, so that axes are met exactly."""
    if isinstance(facets, bool) or not isinstance(facets, int) or not 12 <= facets <= 1_000:
        raise InputError("not a number of facets", key=f"body '{name}': facets", found=facets, allowed="12 to 1000")
    count = 4 * math.ceil(facets / 4)
    quarter = np.arange(count // 4) * (2.0 * np.pi / count)
    x, y = np.cos(quarter), np.sin(quarter)
    return np.concatenate([x, -y, -x, y]), np.concatenate([y, x, -y, -x])


def _frame(axis: ArrayLike | str, name: str) -> Array:
    """Return rows x, y, z of a frame whose z is an axis; that of the world for the world's."""
    key = f"body '{name}': axis"
    if isinstance(axis, str):
        axis = AXES[known_word(axis, AXES, "unknown axis", key=key, more=" or a vector")]
    z = _vector(axis, name, "axis")
    if not np.linalg.norm(z) > 0.0:
        raise InputError("no direction", key=key, found=z.tolist(), allowed="not (0, 0, 0)")
    z = units(z)
    x = units(cross(np.array((0.0, 1.0, 0.0)), z)) if abs(z[1]) < 0.9 else np.array(AXES["x"])
    x = units(x - (x @ z) * z)
    return np.array([x, cross(z, x), z])


def _vector(value: ArrayLike, name: str, key: str) -> Array:
    found = numbers(value, f"body '{name}': {key}")
    if found.shape != (3,) or not np.isfinite(found).all():
        raise InputError("not a vector", key=f"body '{name}': {key}", found=value, allowed="three finite numbers")
    return found


def _length(value: float, name: str, key: str) -> float:
    found = numbers(value, f"body '{name}': {key}")
    if found.shape != () or not 0.0 < float(found) < math.inf:
        raise InputError("not a length", key=f"body '{name}': {key}", found=value, allowed="a finite number > 0")
    return float(found)
