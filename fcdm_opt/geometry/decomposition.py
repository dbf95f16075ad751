"""Decomposition of a solid into convex parts: exact where its size allows, else approximate with a measured error.

The approximate one is CoACD's (Wei et al. 2022).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.errors import InputError, known_word
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen, groups_of
from fcdm_opt.geometry.cells import Arrangement, Cell, Facet
from fcdm_opt.geometry.crossings import overlapping
from fcdm_opt.geometry.hull import Hull, convex_hull
from fcdm_opt.geometry.measures import cross, norms, volume_and_centroid
from fcdm_opt.geometry.partition import RULES, cover, is_star_shaped, merged, partition, partition_by_features
from fcdm_opt.geometry.polygons import Sides, area, components, coplanar, distances, fans, normals_of
from fcdm_opt.geometry.pyramids import Pyramids, pyramids
from fcdm_opt.geometry.surface import Surface
from fcdm_opt.lazy_import import extra
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.geometry.mesh import Mesh

Method = Literal["auto", "exact", "surface", "coacd"]
METHODS: tuple[str, ...] = ("auto", "exact", "surface", "coacd")
Rows = tuple[int, ...]
# Reflex edges times triangles, which the time of cutting grows with: "auto" cuts up to the first, 3 s or so, up to the
# second where few parts come of it, and up to the third all rules are tried, and parts of a cover grown around some
# pieces, of which the best is taken.
MOST_WORK, MOST_FOR_FEW, MOST_FOR_RULES = 400_000, 1_500_000, 40_000
FEW = 100  # parts
LARGE = RULES[2:]  # of larger bodies, the first that fills them: round ones are cut all round by planes of two edges
TARGETS = 6
MOST_COVERED = 24  # cells of a partition that a cover is looked for of: its time grows with their square
LARGER = 2  # times as many parts as the partition that a cover may have


@dataclass(frozen=True, eq=False)
class Decomposition:
    """Convex parts whose union is a solid."""

    method: Literal["convex", "exact", "surface", "coacd"]
    why: str  # what was chosen, and why
    points: Array  # the mesh's vertices first, then those that cuts made, (m, 3)
    parts: tuple[Ints, ...]  # rows of `points` whose hulls the parts are
    surface: Surface | None = None  # the solid's true faces and edges; None where they are those of the parts
    cover: bool = False  # whether the parts may overlap and all hold the seed; else they are a partition
    # lengths by which the parts stick out of the mesh, and fall short of it, at most; (0.0, 0.0) where exact
    deviation: tuple[float, float] = (0.0, 0.0)
    # of method "surface": the parts, which are all of the surface but not all of the solid
    made: Pyramids | None = None


def decompose(mesh: Mesh, seed: Array, *, method: Method = "auto") -> Decomposition:
    """Return convex parts whose union is the solid inside a mesh: one, whatever the method, where that is convex.

    - `seed` (3,): if the solid is star-shaped about it, parts that all hold it are preferred: each part pair's curve
      then falls.
    - `method`: "exact" cuts at reflex edges; the volumes of a partition add up to the mesh's. "surface": a pyramid
      under each face, which are all of the surface. "coacd": CoACD's approximate parts (extra `coacd`), with their
      measured deviation. "auto": "exact" up to `MOST_WORK` reflex edges times triangles, "surface" above.

    Raises `InputError` for an unknown method, for "coacd" where it is not installed, and where the surface bounds no
    solid.
    """
    key = f"body '{mesh.name}'"
    known_word(method, METHODS, "unknown decomposition", key=f"{key}: decomposition")
    used = np.unique(mesh.triangles)
    reflex = _reflex_edges(mesh, used)
    if not reflex and _is_whole(mesh, used):
        return Decomposition("convex", "one part: the mesh is convex", mesh.vertices, (used,))
    known = f"{reflex} reflex edge{'s' if reflex > 1 else ''}" if reflex else "several shells"
    pacing.at(f"cutting {mesh.name} into convex parts: {known}")
    if method == "coacd":
        points, parts, (out, short) = approximate(mesh)
        why = f"{len(parts)} parts by CoACD (asked for): at most {out:.3g} beyond the mesh, {short:.3g} short of it"
        return Decomposition("coacd", why, frozen(points), parts, deviation=(out, short))
    exact, solids = None, _solids(mesh) if method != "surface" else []
    works = [len(rows) * _reflex_edges(own, np.unique(own.triangles)) for own, rows in solids]
    large = method == "auto" and sum(works) > MOST_WORK
    if solids and (not large or sum(works) <= MOST_FOR_FEW):
        most = FEW if large else None
        if len(solids) > 1:
            exact = _each_exact(mesh, solids, works, known, most)
        else:
            exact = _exact(mesh, seed, known, thoroughly=works[0] <= MOST_FOR_RULES, most=most)
    asked = "asked for" if method == "surface" else f"{known} and {len(mesh.triangles)} triangles"
    if exact is not None:
        return exact
    made = pyramids(mesh.vertices, mesh.triangles, mesh.name)
    why = f"{len(made.hulls)} parts, one under each face ({asked}): all of the surface, and nothing beyond it"
    rows = tuple(frozen(np.sort(hull.used), np.int64) for hull in made.hulls)
    return Decomposition("surface", why, frozen(made.points), rows, made.surface, made=made)


def by_features(mesh: Mesh, rule: int) -> Decomposition:
    """Return the exact partition of a solid in which each of its features may change its size by itself."""
    # cuts lie along planes of the feature's own faces, or between features; it may have more parts than others
    solid = _Solid.of(mesh)
    cells = partition_by_features(solid.space, solid.hull, solid.inner, RULES[rule])
    if not _fills(mesh, solid.space, cells):
        raise InputError("no partition by features: the parts' volumes do not add up to the mesh's", key=mesh.name)
    points, parts = _numbered(solid.space, len(mesh.vertices), cells)
    why = f"{len(cells)} parts side by side, exactly the solid: cut between its features, which change their sizes"
    return Decomposition("exact", why, frozen(points), parts, solid.surface(mesh))


def _solids(mesh: Mesh) -> list[tuple[Mesh, Ints]]:
    """Return the solids of a mesh of which no box meets another's, each with the rows of its triangles."""
    shells = components(mesh.triangles[:, [0, 1, 0, 2]].reshape(-1, 2), len(mesh.vertices))[mesh.triangles[:, 0]]
    numbers, shells = np.unique(shells, return_inverse=True)
    ends = [np.full((len(numbers), 3), sign * np.inf) for sign in (1.0, -1.0)]
    for end, further in zip(ends, (np.minimum, np.maximum), strict=True):
        further.at(end, np.repeat(shells, 3), mesh.vertices[mesh.triangles.ravel()])
    near = DEFAULT.nominal * (ends[1].max(axis=0) - ends[0].min(axis=0)).max()
    pairs = overlapping(ends[0] - near, ends[1] + near, np.arange(len(numbers))) if len(numbers) > 1 else ()
    links = np.concatenate([np.empty((0, 2), np.int64), *map(np.column_stack, pairs)])
    solids = components(links, len(numbers))[shells]
    if not solids.any():
        return [(mesh, np.arange(len(solids)))]
    found = []
    for own in groups_of(solids):
        faces, place = np.unique(mesh.triangle_faces[own], return_inverse=True)
        polygons = tuple(mesh.faces[k] for k in faces.tolist())
        found.append((replace(mesh, faces=polygons, triangles=mesh.triangles[own], triangle_faces=place), own))
    return found


def _each_exact(
    mesh: Mesh, solids: Sequence[tuple[Mesh, Ints]], works: Sequence[int], known: str, most: int | None
) -> Decomposition | None:
    """Return exact decompositions of several solids as one; None where they have more parts than `most`."""
    drawn, points, parts, surfaces = len(mesh.vertices), [mesh.vertices], list[Ints](), list[Surface]()
    for (own, _), work in zip(solids, works, strict=True):
        at_most = None if most is None else most - len(parts)
        made = _exact(own, None, known, thoroughly=work <= MOST_FOR_RULES, most=at_most)
        if made is None:
            return None
        further = sum(map(len, points)) - drawn
        parts += [frozen(np.where(rows < drawn, rows, rows + further), np.int64) for rows in made.parts]
        points.append(made.points[drawn:])
        assert made.surface is not None
        surfaces.append(made.surface)
    each = f"not all of it is seen from the seed, each of {len(solids)} solids cut by itself"
    why = f"{len(parts)} parts side by side, exactly the solid: {known}, {each}"
    owners, start = np.empty(len(mesh.triangles), np.int64), 0
    for surface, (_, rows) in zip(surfaces, solids, strict=True):
        owners[rows] = start + surface.owners
        start += len(surface.faces)
    return Decomposition(
        "exact", why, frozen(np.concatenate(points)), tuple(parts), Surface.of(mesh.vertices, mesh.triangles, owners)
    )


def _exact(mesh: Mesh, seed: Array | None, known: str, *, thoroughly: bool, most: int | None) -> Decomposition | None:
    """Return the best of exact decompositions; None where they have more parts than `most`."""
    solid = _Solid.of(mesh)
    space = solid.space
    best: list[Cell] | None = None
    for rule in RULES if thoroughly else LARGE:
        cells = partition(space, solid.hull, solid.inner, rule, most)
        if cells is None:
            return None
        joined = merged(space, cells)
        if (best is None or len(joined) < len(best)) and _fills(mesh, space, joined):
            best = joined
            if not thoroughly:
                break
    if best is None:
        raise InputError("no exact decomposition: the parts' volumes do not add up to the mesh's", key=mesh.name)
    covering, kind = None, "side by side"
    centre = None if seed is None else space.point(seed)
    if not thoroughly:
        reason = "so many that no cover is looked for"
    elif centre is None or not is_star_shaped(space, solid.facets, centre):
        reason = "not all of it is seen from the seed"
    elif len(best) > MOST_COVERED:
        reason = f"more than {MOST_COVERED} parts, no cover looked for"
    else:
        covering = cover(space, solid.hull, solid.inner, centre, best, LARGER * len(best), TARGETS)
        kind = "side by side" if covering is None else "that overlap"
        reason = "all hold the seed" if covering else f"a cover needs more than {LARGER * len(best)} parts"
    chosen = covering or best
    why = f"{len(chosen)} parts {kind}, exactly the solid: {known}, {reason}"
    points, parts = _numbered(space, len(mesh.vertices), chosen)
    return Decomposition("exact", why, frozen(points), parts, solid.surface(mesh), covering is not None)


def _numbered(space: Arrangement, drawn: int, cells: Sequence[Cell]) -> tuple[Array, tuple[Ints, ...]]:
    """Return the drawn points and those that the cells use, rounded once, each only once, and the cells' rows."""
    rows = [*range(drawn), *sorted({k for cell in cells for k in cell.points.tolist() if k >= drawn})]
    points = space.coordinates(rows) + 0.0
    number: dict[tuple[float, ...], int] = {}
    kept, place = list(range(drawn)), dict[int, int]()
    for k, (row, point) in enumerate(zip(rows, map(tuple, points.tolist()), strict=True)):
        place[row] = k if k < drawn else number.setdefault(point, len(kept))
        number.setdefault(point, place[row])
        kept += [k] * (place[row] == len(kept))
    return points[kept], tuple(frozen(sorted({place[k] for k in cell.points.tolist()}), np.int64) for cell in cells)


def _fills(mesh: Mesh, space: Arrangement, cells: Sequence[Cell]) -> bool:
    """Tell whether the cells' volumes add up to the mesh's, within what moving its surface by the slack changes."""
    a, b, c = space.local[mesh.triangles.T]
    triangles = norms(cross(b - a, c - a)).sum() / 2
    volume = mesh.volume / space.size**3
    error = abs(sum(space.volume(cell) for cell in cells) - volume)
    return bool(error <= 2 * space.slack * triangles + DEFAULT.nominal * volume)


class _Solid(NamedTuple):
    """A mesh's facets in an arrangement of its planes, its hull, and the facets inside that."""

    space: Arrangement
    facets: list[Facet]
    hull: Cell
    inner: list[Facet]

    @classmethod
    def of(cls, mesh: Mesh) -> _Solid:
        used = np.unique(mesh.triangles)
        space = Arrangement(mesh.vertices, used)
        loops = [space.local[list(face)] for face in mesh.faces]
        normals = normals_of(space.local, mesh.faces)
        largest = np.argsort([-area(loop) for loop in loops], kind="stable")
        levels = (normals * [loop.mean(axis=0) for loop in loops]).sum(axis=1)
        polygons = [mesh.faces[k] for k in largest.tolist()]
        plane = np.empty(len(mesh.faces), np.int64)
        for group in coplanar(space.local, polygons, normals[largest], levels[largest], space.slack):
            own = largest[group]
            corners = sorted({v for k in own for v in mesh.faces[k]})
            plane[own] = row = space.plane(corners)
            space.lie_on(corners, row)
        side = np.where((normals * space.normals[plane]).sum(axis=1) > 0, 1, -1)
        facets = [
            Facet(int(plane[k]), int(side[k]), tuple(loop))
            for loop, k in zip(mesh.triangles.tolist(), mesh.triangle_faces.tolist(), strict=True)
        ]
        hull = convex_hull(mesh.vertices[used], used, f"body '{mesh.name}'")
        walls: dict[int, int] = {}
        for loop in hull.loops:
            corners = hull.used[list(loop)].tolist()
            on = np.flatnonzero((space.signs[:, corners] == 0).all(axis=1)).tolist()
            outer = [p for p in on if space.signs[p, hull.used].min() * space.signs[p, hull.used].max() == 0]
            wall = outer[0] if outer else space.plane(corners)
            walls[wall] = -int(np.sign(space.heights(hull.used, wall).sum()))
        whole = Cell(np.sort(hull.used), np.array(list(walls)), np.array(list(walls.values())))
        border = space.signs[whole.planes] == 0
        inner = [facet for facet in facets if not border[:, facet.loop].all(axis=1).any()]
        return cls(space, facets, space.pruned(whole), inner)

    def surface(self, mesh: Mesh) -> Surface:
        """Return the true faces and edges of the mesh."""
        planes = np.array([2 * facet.plane + (facet.side > 0) for facet in self.facets])
        return Surface.of(mesh.vertices, mesh.triangles, planes)


def _reflex_edges(mesh: Mesh, used: Ints) -> int:
    """Return how many edges are reflex, by the section across them; an edge of more than two triangles is."""
    sides, local = Sides.around(mesh.triangles.ravel(), 3), mesh.vertices - mesh.vertices[used[0]]
    size = np.abs(local[used]).max()
    slack = max(DEFAULT.planarity, 4 * float(np.spacing(np.abs(mesh.vertices[used]).max())) / size)
    along, c, d = sides.sections(local / size, sides.pairs)
    fold = (cross(c, d) * along).sum(axis=1)  # the first triangle is to the left of the edge, inside below both
    return int((fold > slack * np.maximum(norms(c), norms(d))).sum() + (sides.counts > 2).sum())


def _is_whole(mesh: Mesh, used: Ints) -> bool:
    """Tell whether a mesh without reflex edges is its own hull, not several solids."""
    sides = Sides.around(mesh.triangles.ravel(), 3)
    if np.ptp(components(np.column_stack([sides.origin, sides.end]), len(mesh.vertices))[used]):
        return False
    hull = convex_hull(mesh.vertices[used], used, f"body '{mesh.name}'")
    volume = volume_and_centroid(mesh.vertices[hull.used[fans(hull.loops)]])[0]
    return abs(volume - mesh.volume) <= DEFAULT.nominal * volume


SEED = 0
FINEST = 5e-3  # of the size: bounds of the deviation are not made better than this, or than
SHARE = 0.1  # of themselves
SPACING, NEAREST = 1e-2, 4  # of samples of a surface, of the size; how many of their triangles are looked at
MOST_PIECES, MOST_LOOKS = 200_000, 3e8  # of triangles, and those times the surface's: then a coarser bound is taken
BLOCK = 1 << 22  # products of points and planes worked out at a time


def approximate(mesh: Mesh) -> tuple[Array, tuple[Ints, ...], tuple[float, float]]:
    """Return convex parts that are about the solid inside a mesh; raises `InputError` where CoACD is not installed.

    Points, (m, 3), the mesh's vertices first; their rows whose hulls the parts are; and two upper bounds: of the
    distance of any point on a part's surface from the solid, and of the distance of any point on the mesh from the
    parts. Where these are not the truth they are at most `FINEST` of the size, or larger by `SHARE` of themselves;
    larger still for meshes of very many triangles.
    """
    coacd = extra("coacd", "coacd", key=f"body '{mesh.name}': decomposition", found="coacd")
    used = np.unique(mesh.triangles)
    origin, size = mesh.vertices[used[0]], float(np.ptp(mesh.vertices[used], axis=0).max())
    local = (mesh.vertices - origin) / size
    place = np.zeros(len(local), np.int64)
    place[used] = np.arange(len(used))
    coacd.set_log_level("off")
    made = coacd.run_coacd(coacd.Mesh(local[used], place[mesh.triangles]), preprocess_mode="off", seed=SEED)
    points, rows = _rejoined(local, used, [np.asarray(corners, dtype=np.float64) for corners, _ in made])
    parts, hulls = list[Ints](), list[Hull]()
    for own in rows:
        try:
            hulls.append(convex_hull(points[own], own, mesh.name))
        except InputError:  # flat: what is missing then is measured
            continue
        parts.append(frozen(np.sort(hulls[-1].used), np.int64))
    if not parts:
        raise InputError("CoACD found no parts", key=f"body '{mesh.name}': decomposition", found="coacd")
    out, short = _deviation(local, mesh.triangles, mesh, (origin, size), points, hulls)
    return np.vstack([mesh.vertices, origin + size * points[len(local) :]]), tuple(parts), (size * out, size * short)


def _rejoined(local: Array, used: Ints, groups: list[Array]) -> tuple[Array, list[Ints]]:
    """Return the mesh's points and the groups' new ones, and each group's rows; a point next to a vertex is that."""
    from scipy.spatial import cKDTree

    tree = cKDTree(local[used])
    number: dict[tuple[float, ...], int] = {}
    rows = []
    for group in groups:
        off, near = tree.query(group)
        own = [
            int(used[k]) if distance <= DEFAULT.nominal else number.setdefault(tuple(point), len(local) + len(number))
            for point, distance, k in zip(group.tolist(), off, near, strict=True)
        ]
        rows.append(np.unique(own))
    return np.vstack([local, np.array(list(number)).reshape(-1, 3)]), rows


def _deviation(
    local: Array, triangles: Ints, mesh: Mesh, frame: tuple[Array, float], points: Array, hulls: list[Hull]
) -> tuple[float, float]:
    origin, size = frame
    planes = []
    for hull in hulls:
        normals = normals_of(points[hull.used], hull.loops)
        bases = points[hull.used[[loop[0] for loop in hull.loops]]]
        planes.append((normals, (normals * bases).sum(axis=1)))

    def inside_a_part(asked: Array) -> Flags:
        found = np.zeros(len(asked), bool)
        for normals, levels in planes:
            step = max(1, BLOCK // len(levels))
            for k in range(0, len(asked), step):
                found[k : k + step] |= (asked[k : k + step] @ normals.T <= levels).all(axis=1)
        return found

    surface, others = local[triangles], np.vstack([points[hull.used[fans(hull.loops)]] for hull in hulls])
    out = _farthest(others, surface, lambda asked: mesh.contains(origin + size * asked))
    return out, _farthest(surface, others, inside_a_part)


def _farthest(triangles: Array, surface: Array, contains: Callable[[Array], Flags]) -> float:
    """Return an upper bound of the distance of points of triangles from what a surface encloses."""
    # the distance from one triangle is convex: no point of another triangle is further from it than a corner of that.
    # Nor is one further away than its centre and its radius together. Triangles whose bound is not yet good are cut
    # into four
    from scipy.spatial import cKDTree

    samples, owners = _samples(surface)
    tree = cKDTree(samples)
    known, closed, work = 0.0, 0.0, 0
    while len(triangles):
        work += len(triangles)
        centres = triangles.mean(axis=1)
        off, nearest = tree.query(centres, NEAREST)
        bounds = distances(triangles[:, None], surface[owners[nearest]]).max(axis=2).min(axis=1)
        if work > min(MOST_PIECES, MOST_LOOKS / len(surface)):  # what is known so far holds for them all
            return max(closed, float(bounds.max()))
        pending = np.flatnonzero(bounds > max(FINEST, (1 + SHARE) * known))
        within, radii = contains(centres[pending]), norms(triangles[pending] - centres[pending, None]).max(axis=1)
        # exactly: of all triangles that may be nearer than the nearest sample
        found = tree.query_ball_point(centres[pending], off[pending, 0] + SPACING)
        there = np.array(
            [
                distances(x[None, None], surface[np.unique(owners[own])]).min()
                for x, own in zip(centres[pending], found, strict=True)
            ]
        )
        bounds[pending] = np.minimum(bounds[pending], np.where(within, 0.0, there) + radii)
        bounds[pending[within & (there > radii)]] = 0.0  # inside as a whole
        known = max(known, float(there[~within].max(initial=0.0)))
        good = bounds <= max(FINEST, (1 + SHARE) * known)
        closed = max(closed, float(bounds[good].max(initial=0.0)))
        triangles = _quartered(triangles[~good])
    return closed


def _samples(triangles: Array) -> tuple[Array, Ints]:
    """Return points of triangles of which one is within `SPACING` of each of theirs, and the triangle each is of."""
    found, owners, own = [], [], np.arange(len(triangles))
    while len(triangles):
        centres = triangles.mean(axis=1)
        small = norms(triangles - centres[:, None]).max(axis=1) <= SPACING
        found.append(centres[small])
        owners.append(own[small])
        triangles, own = _quartered(triangles[~small]), np.tile(own[~small], 4)
    return np.vstack(found), np.concatenate(owners)


def _quartered(triangles: Array) -> Array:
    a, b, c = triangles.transpose(1, 0, 2)
    d, e, f = (b + c) / 2, (c + a) / 2, (a + b) / 2
    return np.vstack([np.stack(own, axis=1) for own in ((a, f, e), (f, b, d), (e, d, c), (d, e, f))])
