"""The true faces and edges of a union of convex parts: what of the parts' own ones other parts do not hide."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.hull import Hull, unit_normals
from fcdm_opt.geometry.polygons import triangulated
from fcdm_opt.geometry.surface import FRACTIONS, Surface, label
from fcdm_opt.tolerances import DEFAULT


def surface_of_parts(points: Array, hulls: list[Hull], given: list[list[int]] | None, name: str) -> Surface:
    """Return the faces and edges of a union of parts."""
    size = float(np.abs(points - points.mean(axis=0)).max())
    rows = [[tuple(hull.used[list(loop)].tolist()) for loop in hull.loops] for hull in hulls]
    planes = [[_plane(points, loop) for loop in loops] for loops in rows]
    drawn, slack = given is not None, DEFAULT.nominal * size
    if given is None:
        groups = _faces_from_parts(points, rows, planes, size)
        given = [sorted({v for part, face in group for v in rows[part][face]}) for group in groups]
        owner = {place: k for k, group in enumerate(groups) for place in group}
    else:
        _check_faces(points, rows, planes, given, size, name)
        owner = _owners(points, rows, planes, given, size)
    if len(hulls) == 1:
        edges, hidden = np.sort(hulls[0].used[hulls[0].edges[:, :2]], axis=1), np.empty((0, 2), np.int64)
    else:
        known = np.unique(np.concatenate([*(hull.used for hull in hulls), *given]).astype(np.int64))
        edges, hidden = _true_edges(points, hulls, rows, planes, owner, known, size)
    triangles, owners, corners = [], [], list(points)
    sides = {pair for face in given for pair in zip(face, face[1:] + face[:1], strict=True)}
    cover = _Cover(points, rows, planes, slack)
    for k, face in enumerate(given):
        fans = _fans_of_outline(points, face, edges, sides, slack) if drawn else None
        if fans is None:
            loops = [loop for place, one in owner.items() if one == k for loop in cover.loops(place, corners)]
            fans = [(loop[0], *pair) for loop in loops for pair in pairwise(loop[1:])]
        elif _is_clockwise(points, fans, rows, planes, slack):
            fans = [own[::-1] for own in fans]
        triangles += fans
        owners += [k] * len(fans)
    faces, rows_of_corners = tuple(map(tuple, given)), np.array(triangles, np.int64).reshape(-1, 3)
    return Surface(np.array(corners), rows_of_corners, np.array(owners, np.int64), faces, edges, hidden, faces)


def _is_clockwise(points: Array, fans: list[tuple[int, ...]], rows: Any, planes: Any, slack: float) -> bool:
    """Tell whether triangles of a face are turned to the solid: all part faces at the middle of one face the other way.

    Where faces of parts meet there that are turned to each other, the face is as it was given.
    """
    a, b, c = points[np.array(fans).T]
    normals = np.cross(b - a, c - a)
    largest = int((normals**2).sum(axis=1).argmax())
    middle, normal = points[list(fans[largest])].mean(axis=0), normals[largest]
    ways = {
        bool(own @ normal > 0)
        for loops, others in zip(rows, planes, strict=True)
        for loop, (own, level) in zip(loops, others, strict=True)
        if abs(own @ middle - level) <= slack
        and np.linalg.norm(np.cross(own, normal)) <= DEFAULT.nominal * np.linalg.norm(normal)
        and _covers(points[list(loop)], middle, own, slack)
    }
    return ways == {False}


def _fans_of_outline(
    points: Array, face: list[int], edges: Ints, sides: set[tuple[int, int]], slack: float
) -> list[tuple[int, ...]] | None:
    """Return triangles of a face given by its corners in order; None where that order does not follow edges.

    Reflex edges need not be edges of any part: `sides`, those of all faces, have them.
    """
    base, along = points[edges[:, 0]], np.diff(points[edges], axis=1)[:, 0]
    length = np.linalg.norm(along, axis=1)
    spokes = points[face][:, None] - base
    share = (spokes * along).sum(axis=2) / length
    off = np.linalg.norm(spokes - (share / length)[:, :, None] * along, axis=2)
    on = (off <= slack) & (share >= -slack) & (share <= length + slack)
    along_edges = (on & np.roll(on, -1, axis=0)).any(axis=1)
    if not all(ok or (b, a) in sides for ok, a, b in zip(along_edges, face, face[1:] + face[:1], strict=True)):
        return None
    try:
        return [tuple(own) for own in triangulated(points, [tuple(face)], [0], slack, "face")[0].tolist()]
    except InputError:
        return None


def _true_edges(
    points: Array, hulls: list[Hull], rows: Any, planes: Any, owner: Any, known: Ints, size: float
) -> tuple[Ints, Ints]:
    """Return the union's edges, by their ends, and the parts' edges that are hidden in other parts.

    The union's are the parts' edges with no flat surroundings, joined; hidden is what is so wherever it is looked at.
    """
    slack = DEFAULT.nominal * size
    normals = [np.array([normal for normal, _ in own]) for own in planes]
    levels = [np.array([level for _, level in own]) for own in planes]
    lows, highs = (np.array([f(points[hull.used], axis=0) for hull in hulls]) for f in (np.min, np.max))
    pieces: dict[frozenset[Any], list[tuple[int, int]]] = {}
    hidden: set[tuple[int, int]] = set()
    ends = np.unique(np.vstack([np.sort(hull.used[hull.edges[:, :2]], axis=1) for hull in hulls]), axis=0)
    cut = {(a, b): _cut_at(points, [a, b], known, slack) for a, b in ends.tolist()}
    for a, b in dict.fromkeys(piece for own in cut.values() for piece in own):
        along = points[b] - points[a]
        frame = np.linalg.svd((along / np.linalg.norm(along))[None])[2][1:]
        flat = False
        for place in points[a] + FRACTIONS[:, None] * along:
            wedges, tight = [], []
            for part in np.flatnonzero(((place >= lows - slack) & (place <= highs + slack)).all(axis=1)).tolist():
                heights = normals[part] @ place - levels[part]
                if heights.max() > slack:
                    continue
                on = np.flatnonzero(heights >= -slack)
                across = normals[part][on] @ frame.T
                wide = np.linalg.norm(across, axis=1)
                wedges.append(across[wide > DEFAULT.nominal])
                tight += [
                    (part, face, normal / length)
                    for face, normal, length in zip(on.tolist(), across, wide, strict=True)
                    if length > DEFAULT.nominal
                ]
            rims = _exposed(wedges)
            if rims:
                own = frozenset(
                    owner.get((part, face), rows[part][face])
                    for part, face, normal in tight
                    if any(np.abs(normal - rim).max() <= DEFAULT.snap for rim in rims)
                )
                pieces.setdefault(own, []).append((a, b))
                break
            flat |= rims is None
        else:
            if not flat:
                hidden.add((a, b))
    edges = [edge for own in pieces.values() for edge in _joined_edges(points, own, slack)]
    unseen = [edge for edge, own in cut.items() if hidden.issuperset(own)]
    return np.array(edges, np.int64).reshape(-1, 2), np.array(unseen, np.int64).reshape(-1, 2)


def _cut_at(points: Array, ends: list[int], used: Ints, slack: float) -> list[tuple[int, int]]:
    """Cut an edge at the points that lie on it."""
    origin, end = points[ends]
    length = float(np.linalg.norm(end - origin))
    spokes = points[used] - origin
    along = spokes @ (end - origin) / length
    inside = used[(along > slack) & (along < length - slack)]
    if not inside.size:
        return [(ends[0], ends[1])]
    spokes = points[inside] - origin
    share = spokes @ (end - origin) / length
    off = np.linalg.norm(spokes - share[:, None] * (end - origin) / length, axis=1)
    on = inside[off <= slack][np.argsort(share[off <= slack], kind="stable")].tolist()
    return [(min(pair), max(pair)) for pair in pairwise([ends[0], *on, ends[1]])]


def _exposed(wedges: list[Array]) -> list[Array] | None:
    """Return the outward normals at the rims of what plane wedges leave free: none of nothing, None of a half-plane.

    A wedge is where the products with its normals, (k, 2), are negative.
    """
    if any(not len(own) for own in wedges):
        return []
    angles = np.concatenate([np.arctan2(own[:, 1], own[:, 0]) for own in wedges])
    rays = np.sort(np.concatenate([angles - np.pi / 2, angles + np.pi / 2]) % (2 * np.pi))
    rays = rays[np.diff(rays, append=rays[0] + 2 * np.pi) > DEFAULT.snap]
    widths = np.diff(rays, append=rays[0] + 2 * np.pi)
    middles = rays + widths / 2
    ways = np.column_stack([np.cos(middles), np.sin(middles)])
    free = ~np.any([(ways @ own.T < 0).all(axis=1) for own in wedges], axis=0)
    if not free.any():
        return []
    starts, ends = free & ~np.roll(free, 1), free & ~np.roll(free, -1)
    if starts.sum() == 1 and abs(widths[free].sum() - np.pi) <= 4 * DEFAULT.snap:
        return None
    turned = [(rays[k], np.pi / 2) for k in np.flatnonzero(starts)]
    turned += [(rays[k] + widths[k], -np.pi / 2) for k in np.flatnonzero(ends)]
    return [np.array([np.cos(ray + turn), np.sin(ray + turn)]) for ray, turn in turned]


def _joined_edges(points: Array, pieces: list[tuple[int, int]], slack: float) -> list[tuple[int, int]]:
    """Join pieces of edges on one line that touch or overlap."""
    joined: list[tuple[int, int]] = []
    left = sorted(pieces, key=lambda piece: -float(np.linalg.norm(points[piece[1]] - points[piece[0]])))
    while left:
        a, b = left.pop(0)
        grown = True
        while grown:
            grown = False
            base, along = points[a], points[b] - points[a]
            length = float(np.linalg.norm(along))
            for piece in left:
                spokes = points[list(piece)] - base
                share = spokes @ along / length
                if (np.linalg.norm(spokes - share[:, None] * along / length, axis=1) > slack).any():
                    continue
                if share.max() < -slack or share.min() > length + slack:
                    continue
                places = {a: 0.0, b: length, piece[0]: float(share[0]), piece[1]: float(share[1])}
                a, b = min(places, key=places.__getitem__), max(places, key=places.__getitem__)
                left.remove(piece)
                grown = True
                break
        joined.append((min(a, b), max(a, b)))
    return joined


def _plane(points: Array, loop: tuple[int, ...]) -> tuple[Array, float]:
    normal = unit_normals(points[list(loop)])
    return normal, float(normal @ points[loop[0]])


def _seams(rows: Any, planes: Any) -> set[tuple[int, int]]:
    """Return the part faces that two parts turn to each other: the same outline, opposite normals."""
    outlines: dict[frozenset[int], list[tuple[int, int]]] = {}
    for part, loops in enumerate(rows):
        for face, loop in enumerate(loops):
            outlines.setdefault(frozenset(loop), []).append((part, face))
    return {
        (part, face)
        for same in outlines.values()
        if len(same) > 1
        for part, face in same
        if any(planes[part][face][0] @ planes[p][f][0] < 0 for p, f in same)
    }


def _faces_from_parts(points: Array, rows: Any, planes: Any, size: float) -> list[list[tuple[int, int]]]:
    """Group part faces in one plane that touch along a line or share vertices; drop those that other parts hide."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    slack = DEFAULT.nominal * size
    seams = _seams(rows, planes)
    places = [
        (part, face) for part, loops in enumerate(rows) for face in range(len(loops)) if (part, face) not in seams
    ]
    cover = _Cover(points, rows, planes, slack)
    places = [place for place in places if not cover.hides(place)]
    keys = np.array([(*planes[part][face][0], planes[part][face][1] / size) for part, face in places])
    pairs = cKDTree(keys).query_pairs(DEFAULT.nominal, p=np.inf, output_type="ndarray")
    loops = [rows[part][face] for part, face in places]
    corners = [points[list(loop)] for loop in loops]
    lows, highs = (np.array([f(own, axis=0) for own in corners]) for f in (np.min, np.max))
    one, two = pairs.T
    near = ((lows[one] <= highs[two] + slack) & (lows[two] <= highs[one] + slack)).all(axis=1)
    links = [
        (i, j)
        for i, j in pairs[near].tolist()
        if not set(loops[i]).isdisjoint(loops[j]) or _touch(corners[i], corners[j], keys[i, :3], slack)
    ]
    graph = coo_array((np.ones(len(links)), np.array(links, np.int64).reshape(-1, 2).T), shape=(len(places),) * 2)
    groups: dict[int, list[tuple[int, int]]] = {}
    for place, group in zip(places, connected_components(graph, directed=False)[1].tolist(), strict=True):
        groups.setdefault(group, []).append(place)
    return list(groups.values())


class _Cover:
    """What parts cover of each other's faces from outside.

    Parameters
    ----------
    points : (n, 3) array
    rows : per part, per face, the rows of its loop
    planes : per part, per face, (outward unit normal, level)
    slack : float
        Length.
    """

    def __init__(self, points: Array, rows: Any, planes: Any, slack: float) -> None:
        self._points, self._rows, self._slack = points, rows, slack
        self._normals = [np.array([normal for normal, _ in own]) for own in planes]
        self._levels = [np.array([level for _, level in own]) for own in planes]
        corners = [points[sorted({v for loop in loops for v in loop})] for loops in rows]
        self._lows, self._highs = (np.array([f(own, axis=0) for own in corners]) for f in (np.min, np.max))

    def hides(self, place: tuple[int, int]) -> bool:
        """Tell whether other parts cover a part's face, (part, face), wherever one looks."""
        part, face = place
        outline, normal = self._points[list(self._rows[part][face])], self._normals[part][face]
        middle = outline.mean(axis=0)
        samples = (middle + FRACTIONS[:, None, None] * (outline - middle)).reshape(-1, 3)
        for other in self._near(place).tolist():
            heights = samples @ self._normals[other].T - self._levels[other]
            inwards = self._normals[other] @ normal < DEFAULT.nominal
            samples = samples[((heights > self._slack) | ((heights > -self._slack) & ~inwards)).any(axis=1)]
            if not len(samples):
                break
        return not len(samples) and not self._left(place)

    def loops(self, place: tuple[int, int], corners: list[Array]) -> list[tuple[int, ...]]:
        """Return what is not covered of a part's face as convex polygons: rows of `corners`, which it may add to."""
        part, face = place
        whole: tuple[int, ...] = self._rows[part][face]
        pieces = self._left(place)
        if sum(map(_area, pieces)) >= (1.0 - DEFAULT.nominal) * _area(self._points[list(whole)]):
            return [whole]
        loops = []
        for piece in pieces:
            apart = np.linalg.norm(piece - np.roll(piece, 1, axis=0), axis=1) > self._slack
            if apart.sum() > 2:  # no sliver
                loops.append(tuple(range(len(corners), len(corners) + int(apart.sum()))))
                corners += list(piece[apart])
        return loops

    def _near(self, place: tuple[int, int]) -> Ints:
        part, face = place
        outline = self._points[list(self._rows[part][face])]
        low, high = outline.min(axis=0), outline.max(axis=0)
        near = ((self._lows <= high + self._slack) & (self._highs >= low - self._slack)).all(axis=1)
        near[part] = False
        return np.flatnonzero(near)

    def _left(self, place: tuple[int, int]) -> list[Array]:
        """Return the convex polygons, (m, 3), that stay of a part's face where others are taken away one by one.

        A part with a face in its plane, turned the same way, covers nothing of it.
        """
        part, face = place
        normal, slack = self._normals[part][face], self._slack
        pieces = [self._points[list(self._rows[part][face])]]
        for other in self._near(place).tolist():
            normals, levels, left = self._normals[other], self._levels[other], []
            for whole in pieces:
                piece, heights = whole, whole @ normals.T - levels
                beside = heights.min(axis=0) > slack
                level = (np.abs(heights).max(axis=0) <= slack) & (normals @ normal >= DEFAULT.nominal)
                if (beside | level).any():
                    left.append(whole)
                    continue
                for k in np.flatnonzero(heights.max(axis=0) > slack).tolist():
                    above = piece @ normals[k] - levels[k]
                    if above.max() > slack:
                        left.append(_clipped(piece, above))
                        piece = _clipped(piece, -above)
                    if len(piece) < 3:
                        break
            pieces = [piece for piece in left if len(piece) > 2]
            if not pieces:
                break
        return pieces


def _area(polygon: Array) -> float:
    """Return the area of a convex polygon, (m, 3)."""
    spokes = polygon[1:] - polygon[0]
    return float(np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0))) / 2.0


def _clipped(polygon: Array, heights: Array) -> Array:
    """Return the part of a convex polygon where heights over a plane are not negative."""
    kept = []
    for k, height in enumerate(heights.tolist()):
        before = float(heights[k - 1])
        if (height < 0.0) != (before < 0.0):
            kept.append(polygon[k] + height / (height - before) * (polygon[k - 1] - polygon[k]))
        if height >= 0.0:
            kept.append(polygon[k])
    return np.array(kept)


def _touch(one: Array, two: Array, normal: Array, slack: float) -> bool:
    """Tell whether two convex polygons of a plane have more than a point in common."""
    ways = np.roll(two, -1, axis=0) - two
    inward = np.cross(normal, ways)
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    for base, way in zip(two, inward, strict=True):
        heights = (one - base) @ way + slack
        kept: list[Array] = []
        for k, height in enumerate(heights):
            before = heights[k - 1]
            if (before < 0) != (height < 0):
                kept.append(one[k - 1] + before / (before - height) * (one[k] - one[k - 1]))
            if height >= 0:
                kept.append(one[k])
        if not kept:
            return False
        one = np.array(kept)
    return bool(np.ptp(one, axis=0).max() > 8 * slack)


def _owners(points: Array, rows: Any, planes: Any, given: list[list[int]], size: float) -> dict[tuple[int, int], int]:
    """Map each part face to the given face in its plane with which it shares most vertices, or in which it lies."""
    owner = {}
    same = {frozenset(own): k for k, own in reversed(list(enumerate(given)))}
    for part, loops in enumerate(rows):
        for face, loop in enumerate(loops):
            if (exactly := same.get(frozenset(loop))) is not None:
                owner[part, face] = exactly
                continue
            normal, level = planes[part][face]
            shared = {
                k: len(set(own) & set(loop))
                for k, own in enumerate(given)
                if np.abs(points[own] @ normal - level).max() <= DEFAULT.nominal * size
            }
            middle = points[list(loop)].mean(axis=0)
            best = max(shared, key=lambda k: shared[k], default=None)
            if best is not None and (shared[best] or _surrounds(points[given[best]], middle, normal)):
                owner[part, face] = best
    return owner


def _surrounds(outline: Array, point: Array, normal: Array) -> bool:
    """Tell whether a polygon, corners in order, goes round a point of its plane: its winding number is not zero."""
    spokes = outline - point
    ahead = np.roll(spokes, -1, axis=0)
    turns = np.arctan2(np.cross(spokes, ahead) @ normal, (spokes * ahead).sum(axis=1))
    return bool(abs(turns.sum()) > np.pi)


def _check_faces(points: Array, rows: Any, planes: Any, given: list[list[int]], size: float, name: str) -> None:
    """Refuse given faces that are no face of the body."""
    slack = DEFAULT.nominal * size
    seams = _seams(rows, planes)
    table = [
        (loop, *planes[part][face])
        for part, loops in enumerate(rows)
        for face, loop in enumerate(loops)
        if (part, face) not in seams
    ]
    known, earlier = {frozenset(loop) for loop, _, _ in table}, dict[frozenset[int], int]()
    normals, levels = np.array([normal for _, normal, _ in table]), np.array([level for _, _, level in table])
    for k, face in enumerate(given):
        key, found, corners = f"body '{name}': face {k + 1}", tuple(v + 1 for v in face), points[face]
        if (first := earlier.setdefault(frozenset(face), k)) != k:
            raise InputError(f"the corners are those of face {first + 1}", key=key, found=found)
        if frozenset(face) in known:
            continue
        if np.linalg.svd(corners - corners.mean(axis=0))[1][1] <= slack:
            raise InputError("the corners lie on one line", key=key, found=found)
        off = np.abs(corners @ normals.T - levels)
        here = np.flatnonzero(off.max(axis=0) <= slack)
        if not here.size:
            nearest = int(off.max(axis=0).argmin())
            worst = int(off[:, nearest].argmax())
            what = (
                "the corners lie in no plane of a face of the body: the nearest misses vertex "
                f"{face[worst] + 1} by {off[worst, nearest]:.3g}"
            )
            raise InputError(what, key=key, found=found, allowed=f"at most {slack:.3g}")
        loops = [table[c][0] for c in here]
        for v in set(face).difference(*loops):
            if not any(_covers(points[list(table[c][0])], points[v], normals[c], slack) for c in here):
                raise InputError(f"vertex {v + 1} lies in the plane of the face, but not on it", key=key, found=found)
        if len(rows) == 1:
            own = max(loops, key=lambda loop: len(set(loop) & set(face)))
            if missing := set(own) - set(face):
                what = f"only a piece of a face of the body, whose corner at vertex {min(missing) + 1} is missing"
                raise InputError(what, key=key, found=found, allowed=str(label(own)))


def _covers(loop: Array, point: Array, normal: Array, slack: float) -> bool:
    """Tell whether a convex polygon, counter-clockwise about its normal, has a point of its plane on it."""
    along = np.roll(loop, -1, axis=0) - loop
    inward = np.cross(normal, along)
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    return bool(((point - loop) * inward).sum(axis=1).min() >= -slack)
