"""The true faces and edges of a union of convex parts: what of the parts' own ones other parts do not hide."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints, distinct_rows, groups_of
from fcdm_opt.geometry.hull import Hull
from fcdm_opt.geometry.measures import cross, norms, unit_normals, units
from fcdm_opt.geometry.polygons import area, between, clipped, components, fans, hold, inside, normals_of, triangulated
from fcdm_opt.geometry.surface import Surface, label, straightened
from fcdm_opt.tolerances import DEFAULT

FRACTIONS = np.array([1e-3, 0.25, 0.5, 0.75, 1 - 1e-3])  # of the way along an edge: where one looks


def surface_of_parts(points: Array, hulls: list[Hull], given: list[list[int]] | None, name: str) -> Surface:
    """Return the faces and edges of a union of parts."""
    walls = _Walls(points, hulls)
    exposed = []
    for k in range(len(walls.loops)):  # without short sides: of a sliver fewer than three corners are left
        apart = (own[norms(own - np.roll(own, 1, axis=0)) > walls.slack] for own in walls.exposed(k))
        exposed.append([own for own in apart if len(own) > 2])
    shown = [k for k, pieces in enumerate(exposed) if pieces]
    groups = walls.grouped(shown) if given is None else walls.owned(shown, given, name)
    first, place = distinct_rows(points)
    same = first[place].tolist()  # parts may list a corner each for themselves: edges too are named by its first row
    faces = [sorted({same[v] for k in own for v in walls.loops[k]}) for own in groups] if given is None else given
    corners, triangles, owners, normals = list(points), list[Ints](), list[int](), list[Array]()
    sides = {pair for face in given or () for pair in zip(face, [*face[1:], face[0]], strict=True)}
    seen = [(k, piece[[0, j, j + 1]]) for k in shown if given for piece in exposed[k] for j in range(1, len(piece) - 1)]
    seen = [(k, own) for k, own in seen if norms(own - np.roll(own, 1, axis=0)).min() > walls.slack]
    visible, facing = np.array([own for _, own in seen]), walls.normals[[k for k, _ in seen]]
    # last those that no given face has: edges lie between them too
    for face, own in enumerate([*groups, *([k] for k in sorted(set(shown).difference(*groups)))]):
        filled = None if given is None or face >= len(given) else walls.outlined(given[face], sides, visible, facing)
        for k in own:
            pieces = [walls.loops[k]] if filled is None else []
            if pieces and sum(map(area, exposed[k])) < (1.0 - DEFAULT.nominal) * area(points[list(walls.loops[k])]):
                pieces = []
                for piece in exposed[k]:
                    pieces.append(tuple(range(len(corners), len(corners) + len(piece))))
                    corners += list(piece)
            made = [fans([piece]) for piece in pieces]
            triangles += made
            normals += [walls.normals[k]] * sum(map(len, made))
            owners += [face] * sum(map(len, made))
        if filled is not None:
            triangles.append(filled)
            normals += [unit_normals(points[filled[0]])] * len(filled)
            owners += [face] * len(filled)
    rows, places, owner = np.concatenate(triangles), np.array(corners), np.array(owners)
    if len(hulls) == 1:
        edges, hidden = np.sort(hulls[0].used[hulls[0].edges[:, :2]], axis=1), np.empty((0, 2), np.int64)
    else:
        known = np.unique(np.concatenate([*(hull.used for hull in hulls), *faces]).astype(np.int64))
        edges, hidden = _true_edges(points, hulls, known, places[rows], np.array(normals), owner, walls.slack)
    named, loops = owner < len(faces), tuple(map(tuple, faces))
    return Surface(places, rows[named], owner[named], loops, edges, hidden, loops)


class _Walls:
    """Faces of all parts, the `hulls`, one after another, over `points` (n, 3)."""

    def __init__(self, points: Array, hulls: list[Hull]) -> None:
        self.points, self.size = points, float(np.abs(points - points.mean(axis=0)).max())
        self.slack = DEFAULT.nominal * self.size
        self.loops: list[tuple[int, ...]] = [
            tuple(hull.used[list(own)].tolist()) for hull in hulls for own in hull.loops
        ]
        self.normals = normals_of(points, self.loops)
        self.levels = (self.normals * points[[loop[0] for loop in self.loops]]).sum(axis=1)
        self._part = np.repeat(np.arange(len(hulls)), [len(hull.loops) for hull in hulls])
        self._starts = np.searchsorted(self._part, np.arange(len(hulls) + 1))
        self._lows, self._highs = (np.array([f(points[hull.used], axis=0) for hull in hulls]) for f in (np.min, np.max))

    def exposed(self, k: int) -> list[Array]:
        """Return the convex polygons, (m, 3), that stay of a face where other parts are taken away one by one."""
        # a part with a face in its plane, turned the same way, covers nothing of it
        loop, slack = self.points[list(self.loops[k])], self.slack
        low, high = loop.min(axis=0) - slack, loop.max(axis=0) + slack
        near, pieces = ((self._lows <= high) & (self._highs >= low)).all(axis=1), [loop]
        for part in np.flatnonzero(near).tolist():
            if part == self._part[k]:
                continue
            own, remaining = slice(*self._starts[part : part + 2]), list[Array]()
            normals, levels = self.normals[own], self.levels[own]
            for whole in pieces:
                piece, heights = whole, whole @ normals.T - levels
                outside = heights.min(axis=0) > slack
                level = (np.abs(heights).max(axis=0) <= slack) & (normals @ self.normals[k] >= DEFAULT.nominal)
                if (outside | level).any():
                    remaining.append(whole)
                    continue
                for plane in np.flatnonzero(heights.max(axis=0) > slack).tolist():
                    above = piece @ normals[plane] - levels[plane]
                    if len(piece) and above.max() > slack:
                        remaining.append(clipped(piece, above))
                        piece = clipped(piece, -above)
            pieces = [piece for piece in remaining if len(piece) > 2]
        return pieces

    def grouped(self, shown: list[int]) -> list[list[int]]:
        """Group faces in one plane that touch along a line or share vertices."""
        from scipy.spatial import cKDTree

        keys = np.column_stack([self.normals, self.levels / self.size])[shown]
        pairs = cKDTree(keys).query_pairs(DEFAULT.nominal, p=np.inf, output_type="ndarray")
        links = [pair for pair in pairs.tolist() if self._touch(*(shown[k] for k in pair))]
        return [[shown[k] for k in own] for own in groups_of(components(np.array(links), len(shown)))]

    def _touch(self, one: int, two: int) -> bool:
        """Tell whether two faces of a plane have a vertex or more than a point in common."""
        if not set(self.loops[one]).isdisjoint(self.loops[two]):
            return True
        first, second = (self.points[list(self.loops[k])] for k in (one, two))
        common = inside(first, second, self.normals[one], self.slack)
        return len(common) > 0 and bool(np.ptp(common, axis=0).max() > 8 * self.slack)

    def owned(self, shown: list[int], given: list[list[int]], name: str) -> list[list[int]]:
        """Return the faces of each given face: in its plane, with most vertices of it, or in it."""
        self._check(shown, given, name)
        groups: list[list[int]] = [[] for _ in given]
        same = {frozenset(own): k for k, own in reversed(list(enumerate(given)))}
        for k in range(len(self.loops)):
            best = same.get(frozenset(self.loops[k]))
            if best is None:
                shared = {
                    face: len(set(own) & set(self.loops[k]))
                    for face, own in enumerate(given)
                    if np.abs(self.points[own] @ self.normals[k] - self.levels[k]).max() <= self.slack
                }
                best = max(shared, key=lambda face: shared[face], default=None)
                if best is None or not (shared[best] or self._surrounded(k, given[best])):
                    continue
            groups[best].append(k)
        return groups

    def _surrounded(self, k: int, loop: list[int]) -> bool:
        """Tell whether a polygon, corners in order, goes round the middle of a face: its winding number is not zero."""
        spokes = self.points[loop] - self.points[list(self.loops[k])].mean(axis=0)
        ahead = np.roll(spokes, -1, axis=0)
        return bool(abs(np.arctan2(cross(spokes, ahead) @ self.normals[k], (spokes * ahead).sum(axis=1)).sum()) > np.pi)

    def outlined(self, face: list[int], sides: set[tuple[int, int]], visible: Array, facing: Array) -> Ints | None:
        """Return triangles of a face given by its corners in order; None where that order goes round no face."""
        # they are turned as the parts' faces at its middle are; as given where these are turned to each other
        if not self._is_round(face, sides, visible, facing):
            return None
        try:
            triangles = triangulated(self.points, [tuple(face)], [0], self.slack, "face")[0]
        except InputError:
            return None
        a, b, c = self.points[triangles.T]
        across = cross(b - a, c - a)
        largest = int(norms(across).argmax())
        middle, normal = self.points[triangles[largest]].mean(axis=0), units(across[largest])
        level = np.abs(self.normals @ middle - self.levels) <= self.slack
        orientations = {
            bool(self.normals[k] @ normal > 0)
            for k in np.flatnonzero(level & (norms(cross(self.normals, normal)) <= DEFAULT.nominal)).tolist()
            if hold(self.points[[self.loops[k]]], self.normals[[k]], middle[None], self.slack).any()
        }
        return triangles[:, ::-1] if orientations == {False} else triangles

    def _is_round(self, face: list[int], sides: set[tuple[int, int]], visible: Array, facing: Array) -> bool:
        """Tell whether the order of a face's corners goes round it; with a hole it may go across."""
        # each side is then one of another given face too, or a wall of another plane is there: `visible`, those with
        # the normals `facing`
        inner = [(a, b) for a, b in zip(face, [*face[1:], face[0]], strict=True) if (b, a) not in sides]
        if not inner:
            return True
        plane = np.linalg.svd(self.points[face] - self.points[face].mean(axis=0))[2][2]
        bent = norms(cross(facing, plane)) > DEFAULT.snap
        lows, highs = visible.min(axis=1) - self.slack, visible.max(axis=1) + self.slack
        for a, b in inner:
            places = self.points[a] + FRACTIONS[:, None] * (self.points[b] - self.points[a])
            near = bent & ((lows <= places.max(axis=0)) & (highs >= places.min(axis=0))).all(axis=1)
            heights = ((places[:, None] - visible[near, 0]) * facing[near]).sum(axis=2)
            on = (np.abs(heights) <= self.slack) & hold(visible[near], facing[near], places, self.slack)
            if not on.any(axis=1).all():
                return False
        return True

    def _check(self, shown: list[int], given: list[list[int]], name: str) -> None:
        """Refuse given faces that are no face of the body."""
        points, slack, normals = self.points, self.slack, self.normals[shown]
        known, earlier = {frozenset(self.loops[k]) for k in shown}, dict[frozenset[int], int]()
        for k, face in enumerate(given):
            key, found, corners = f"body '{name}': face {k + 1}", tuple(v + 1 for v in face), points[face]
            if (first := earlier.setdefault(frozenset(face), k)) != k:
                raise InputError(f"the corners are those of face {first + 1}", key=key, found=found)
            if frozenset(face) in known:
                continue
            if np.linalg.svd(corners - corners.mean(axis=0))[1][1] <= slack:
                raise InputError("the corners lie on one line", key=key, found=found)
            off = np.abs(corners @ normals.T - self.levels[shown])
            here = np.flatnonzero(off.max(axis=0) <= slack)
            if not here.size:
                nearest = int(off.max(axis=0).argmin())
                worst = int(off[:, nearest].argmax())
                what = (
                    "the corners lie in no plane of a face of the body: the nearest misses vertex "
                    f"{face[worst] + 1} by {off[worst, nearest]:.3g}"
                )
                raise InputError(what, key=key, found=found, allowed=f"at most {slack:.3g}")
            loops = [self.loops[shown[c]] for c in here]
            for v in set(face).difference(*loops):
                held = (
                    hold(points[[own]], normals[[c]], points[[v]], slack) for c, own in zip(here, loops, strict=True)
                )
                if not any(each.any() for each in held):
                    what = f"vertex {v + 1} lies in the plane of the face, but not on it"
                    raise InputError(what, key=key, found=found)
            if (self._part == 0).all():
                own = max(loops, key=lambda loop: len(set(loop) & set(face)))
                if missing := set(own) - set(face):
                    what = f"only a piece of a face of the body, whose corner at vertex {min(missing) + 1} is missing"
                    raise InputError(what, key=key, found=found, allowed=str(label(own)))


def _true_edges(
    points: Array, hulls: list[Hull], known: Ints, triangles: Array, normals: Array, owners: Ints, slack: float
) -> tuple[Ints, Ints]:
    """Return the union's edges, by their ends, and the parts' edges that are hidden in other parts."""
    # the union's are the parts' edges on two of its faces that are not in one plane, joined; hidden is what is on none
    # wherever one looks
    first, back = distinct_rows(points)
    same = first[back]  # the first of equal points
    ends = np.unique(np.vstack([np.sort(same[hull.used[hull.edges[:, :2]]], axis=1) for hull in hulls]), axis=0)
    known, cut = np.unique(same[known]), dict[tuple[int, int], list[tuple[int, int]]]()
    for a, b in ends.tolist():
        cut[a, b] = [(min(piece), max(piece)) for piece in pairwise([a, *between(points, (a, b), known, slack), b])]
    lows, highs = triangles.min(axis=1) - slack, triangles.max(axis=1) + slack
    edges, hidden = dict[tuple[int, int], frozenset[int]](), set[tuple[int, int]]()
    for a, b in dict.fromkeys(piece for own in cut.values() for piece in own):
        places = points[a] + FRACTIONS[:, None] * (points[b] - points[a])
        near = ((lows <= places.max(axis=0)) & (highs >= places.min(axis=0))).all(axis=1)
        near = np.flatnonzero(near & (np.abs(normals @ units(points[b] - points[a])) <= DEFAULT.snap))
        heights = ((places[:, None] - triangles[near, 0]) * normals[near]).sum(axis=2)
        on = (np.abs(heights) <= slack) & hold(triangles[near], normals[near], places, slack)
        faces = [frozenset(owners[near[row]].tolist()) for row in on]
        bent = (row.any() and np.ptp(normals[near[row]], axis=0).max() > DEFAULT.snap for row in on)
        if several := [own for own, is_bent in zip(faces, bent, strict=True) if is_bent]:
            edges[a, b] = several[0]
        elif not any(faces):
            hidden.add((a, b))
    unseen = [edge for edge, own in cut.items() if hidden.issuperset(own)]
    joined = list(straightened(points, edges))
    return np.array(joined, np.int64).reshape(-1, 2), np.array(unseen, np.int64).reshape(-1, 2)
