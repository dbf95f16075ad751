"""How two scaled parts touch: the elements in contact, and the points that they share."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal, NamedTuple, cast

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.features import Feature, is_within
from fcdm_opt.curve.touching import clipped, touching_vertices
from fcdm_opt.geometry.arrays import Array, Ints, crossed
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.measures import nearest_points
from fcdm_opt.geometry.patches import patches_of_element
from fcdm_opt.tolerances import DEFAULT

Vertices = tuple[int, ...]
Configuration = Literal["F-V", "E-E crossing", "E-V", "V-V", "E-E parallel", "F-E", "F-F"]
SITE_KINDS = {kernels.F1V2: "FV", kernels.V1F2: "VF", kernels.E1E2: "EE"}  # of the elements of a site


@dataclass(frozen=True, eq=False)
class Contact:
    """The elements of two parts that touch."""

    feature: Feature  # the bodies' elements that they belong to
    one: Vertices  # one, two: vertices of the parts' own elements: one, two, or a face's, in order around it
    two: Vertices
    parallel: bool = False  # whether they are two parallel edges

    @property
    def configuration(self) -> Configuration:
        """One of the seven: "F-V", "E-E crossing", "E-V", "V-V", "E-E parallel", "F-E", "F-F"."""
        kinds = sorted(("VEF"[min(len(own), 3) - 1] for own in (self.one, self.two)), key="FEV".index)
        name = "-".join(kinds)
        return cast("Configuration", name + (" parallel" if self.parallel else " crossing") * (name == "E-E"))

    def labelled(self, feature: Feature) -> Contact:
        """Return the same contact under another feature."""
        return Contact(feature, self.one, self.two, self.parallel)


def contact_between(
    one: ConvexPart, two: ConvexPart, pose: Array, first: Iterable[int], second: Iterable[int]
) -> Contact:
    """Return the contact of the smallest elements that hold these vertices, each part's on one; pose (12,)."""
    (own, mine), (other, theirs) = _element(one, set(first)), _element(two, set(second))
    parallel = False
    if len(mine) == len(theirs) == 2:
        e = pose[:9].reshape(3, 3) @ (one.vertices[mine[1]] - one.vertices[mine[0]])
        g = two.vertices[theirs[1]] - two.vertices[theirs[0]]
        parallel = bool(np.linalg.norm(crossed(e, g)) <= DEFAULT.planarity * np.linalg.norm(e) * np.linalg.norm(g))
    return Contact(Feature(own, other), mine, theirs, parallel)


def _element(part: ConvexPart, vertices: set[int]) -> tuple[Element, Vertices]:
    """Return the body's element and the vertices of the part's smallest element that holds all the given ones."""
    some = min(vertices)
    if len(vertices) == 1:
        return part.elements["V"][some], (some,)
    sides = part.half_edges[part.half_edges[:, 0] == some]
    if len(vertices) == 2:
        for origin, _, twin, _ in sides.tolist():
            if int(part.half_edges[twin, 0]) in vertices:
                return part.elements["E"][twin // 2], (origin, int(part.half_edges[twin, 0]))
    face = max(sides[:, 1].tolist(), key=lambda f: len(vertices.intersection(part.loops[f])))
    return part.elements["F"][face], part.loops[face]


def located(one: ConvexPart, two: ConvexPart, pose: Array, contact: Contact, rho: Array) -> Contact:
    """Return a contact named by where it is, for edges and faces of parts that lie on several of the body's own.

    At a pose, (12,), and `rho`, (2,): a scale pair at which they touch.
    """
    if not (one.elements.spans or two.elements.spans):
        return contact
    return contact.labelled(features_along(one, two, contact, [(pose, rho)])[0])


def facing(
    one: ConvexPart, two: ConvexPart, pose: Array, contact: Contact, rho: Array, normal: Array, gap: float
) -> Contact:
    """Return a contact of parts that are apart, or overlap, named by where they touch with the gap closed along it."""
    # arguments as `located` takes them; `normal` from 1 to 2, unit
    return located(one, two, np.append(pose[:9], pose[9:] - gap * normal), contact, rho)


def features_along(
    one: ConvexPart, two: ConvexPart, contact: Contact, places: Sequence[tuple[Array, Array]]
) -> list[Feature]:
    """Return the names of a contact at several (pose, scale pair), see `located`."""
    pairs = (one, contact.one, contact.feature.one), (two, contact.two, contact.feature.two)
    spanning = [len(own) > 1 and kind_and_row(part, own) in part.elements.spans for part, own, _ in pairs]
    if not any(spanning):
        return [contact.feature] * len(places)
    drawn = []
    for pose, rho in places:
        point = contact_set(one, two, pose, contact, rho).mean(axis=0)
        drawn.append((one.seed + (point + pose[9:]) @ pose[:9].reshape(3, 3) / rho[0], two.seed + point / rho[1]))
    names = [
        part.elements_at(*kind_and_row(part, own), np.array(where)) if len(own) > 1 else [name] * len(places)
        for (part, own, name), where in zip(pairs, zip(*drawn, strict=True), strict=True)
    ]
    return [Feature(*both) for both in zip(*names, strict=True)]


def kind_and_row(part: ConvexPart, own: Vertices) -> tuple[str, int]:
    """Return kind and row of a part's vertex, edge or face, by its vertices."""
    if len(own) == 1:
        return "V", own[0]
    if len(own) == 2:
        return "E", int(np.flatnonzero(np.isin(part.edges[:, :2], own).all(axis=1))[0])
    return "F", part.loops.index(own)


def supporting_contact(
    one: ConvexPart, two: ConvexPart, normal: Array, pose: Array, slack: float = DEFAULT.tie
) -> Contact:
    """Return the elements with which the parts support each other along a direction from 1 to 2."""
    # `slack`: heights this near, relative to the part's size, count as equal
    tops = _top(one, normal @ pose[:9].reshape(3, 3), slack), _top(two, -normal, slack)
    return contact_between(one, two, pose, *tops)


def contact_at(
    one: ConvexPart, two: ConvexPart, normal: Array, pose: Array, rho: Array, slack: float = DEFAULT.tie
) -> Contact:
    """Return how two touching parts touch at a scale pair: the smallest elements that hold all that they share.

    `normal`, (3,): a unit direction, from 1 to 2, that keeps them apart at a pose, (12,); `rho`, (2,): a scale pair at
    which they touch. Heights and places within `slack`, relative to the sizes, are the same.
    """
    own = touching_vertices(*one.packed, *two.packed, pose, rho, normal, slack)
    return contact_between(one, two, pose, *(vertices.tolist() for vertices in own))


class Meeting(NamedTuple):
    """Two parts that touch: their indices, and what touches."""

    parts: tuple[int, int]
    contact: Contact


def near_pairs(
    movable: Body, static: Body, pose: Array, rho: Array, slack: float, also: Set[tuple[int, int]] = frozenset()
) -> Iterator[tuple[tuple[int, int], Ints, Array, Array]]:
    """Yield the part pairs, and some others, that bounds do not tell to be further apart than `slack` at a scale pair.

    Each with its facet directions: sites and rows, see `kernels.facet_rows`, and the separation along each.
    """
    near = kernels.pair_bounds(*movable.packed, *static.packed, pose, rho) <= slack
    for i, j in sorted({*also, *map(tuple, np.argwhere(near).tolist())}):
        sites, rows = kernels.facet_rows(*movable.parts[i].packed, *static.parts[j].packed, pose)
        yield (i, j), sites, rows, rows[:, 5] - rows[:, 3:5] @ rho


def touching_pairs(
    movable: Body, static: Body, pose: Array, rho: Array, slack: float
) -> Iterator[tuple[tuple[int, int], Ints, Array, Array]]:
    """Yield the part pairs that touch at a scale pair to within `slack`, as `near_pairs` does."""
    return (own for own in near_pairs(movable, static, pose, rho, slack) if abs(own[3].max()) <= slack)


def meetings(movable: Body, static: Body, pose: Array, rho: Array, slack: float) -> list[Meeting]:
    """Return the part pairs that touch at a scale pair, (2,), to within `slack`, each with what touches.

    Where some touch to within a small share of it, those alone: what is merely near may be named as it never touches.

    `pose`, (12,): R, row by row, and d. `slack`, a length: parts this near touch, and directions this near to the
    widest are tight.
    """
    found, sure, tight = list[Meeting](), list[bool](), slack * DEFAULT.tight
    touching = list(touching_pairs(movable, static, pose, rho, slack))
    for (i, j), sites, rows, separations in touching:
        one, two, widest = movable.parts[i], static.parts[j], int(separations.argmax())
        contact = located(one, two, pose, contact_at(one, two, rows[widest, :3], pose, rho), rho)
        if _across(one, two, contact, separations) > tight:  # of a face so narrow that all of it is about as high
            contact = located(
                one, two, pose, contact_between(one, two, pose, *site_corners(one, two, sites[widest])), rho
            )
        found.append(Meeting((i, j), contact))
        near = len(touching) > 1 and abs(separations[widest]) <= tight
        near = near and _across(one, two, contact, separations) <= tight
        elements = placed_elements(one, two, pose, contact, rho)
        sure.append(near and float(np.linalg.norm(np.subtract(*nearest_points(*elements)))) <= tight)
    return [meeting for meeting, own in zip(found, sure, strict=True) if own or not any(sure)]


def touching_features(movable: Body, static: Body, pose: Array, rho: Array, slack: float) -> tuple[Feature, ...]:
    """Return the features that touch, each once; arguments as `meetings` takes them."""
    found = dict.fromkeys(met.contact.feature for met in meetings(movable, static, pose, rho, slack))
    return tuple(distinct_on_true_faces([*found], movable, static))


def distinct_on_true_faces(features: Sequence[Feature], movable: Body, static: Body) -> Sequence[Feature]:
    """Return features of which none is another one's on the true faces; all where no body is made exact on these."""
    # there an edge of a facet, and the piece that makes the facet exact, are one round face; and whether a face touches
    # it or an edge of that face is up to rounding. Of two edges there that are nearly parallel, no point is sure
    if movable.exact is None and static.exact is None:
        return features
    met, kept = {own: true_faces_met(own, movable, static) for own in features}, list[Feature]()
    for own in sorted(features, key=lambda own: (sum(map(len, met[own])), own.kind == "E1E2")):
        if not any(met[other][0] <= met[own][0] and met[other][1] <= met[own][1] for other in kept):
            kept.append(own)
    return [own for own in features if own in kept]


TrueFacesMet = tuple[frozenset[int], frozenset[int]]
"""The true faces, by number, that the elements of a feature are of: those of the movable and of the static body."""


def true_faces_met(feature: Feature, movable: Body, static: Body) -> TrueFacesMet:
    """Return which true faces of two bodies meet in a feature."""
    return patches_of_element(movable, feature.one), patches_of_element(static, feature.two)


@dataclass(frozen=True, eq=False)
class Joint:
    """A contact of two bodies, wherever their parts carry it."""

    feature: Feature
    parts: tuple[int, int]  # a part pair that touches so
    # sites, normals: (k, 3): a facet of that pair's Minkowski difference in each direction in which the pair may come
    # apart, and the direction, from body 1 to body 2: one where elements lie in a plane or edges cross, more at corners
    # and edges
    sites: Ints
    normals: Array
    carriers: tuple[tuple[int, int], ...]  # all part pairs that have the elements: a contact may slide over a seam

    def carried_by(self, movable: Body, static: Body) -> Joint:
        """Return the contact with all part pairs of the bodies that have its elements."""
        elements = (movable, self.feature.one), (static, self.feature.two)
        carried = ([k for k, part in enumerate(body.parts) if part.carriers(element)] for body, element in elements)
        return replace(self, carriers=tuple((i, j) for i, j in product(*carried)) or self.carriers)

    def gap(self, movable: Body, static: Body, pose: Array, rho: Array) -> float:
        """Return the signed gap of its parts at a pose and scale pair: the largest separation over facet directions."""
        found = []
        for i, j in self.carriers:
            rows = kernels.facet_rows(*movable.parts[i].packed, *static.parts[j].packed, pose)[1]
            found.append(float((rows[:, 5] - rows[:, 3:5] @ rho).max()))
        return min(found)


def joints(movable: Body, static: Body, rho: Array, slack: float) -> tuple[Joint, ...]:
    """Return every contact of two bodies as drawn at a scale pair, each feature once; see `meetings`."""
    # without those that another one holds: a corner or an edge of a face that lies flush, what touches within it
    pose = kernels.relative_pose(np.eye(4), movable.seed, static.seed)
    least = DEFAULT.shared * min(movable.size, static.size)
    met = list[tuple[int, Array, Joint, tuple[Array, Array]]]()
    for own in meetings(movable, static, pose, rho, slack):
        one, two = movable.parts[own.parts[0]], static.parts[own.parts[1]]
        shared = contact_set(one, two, pose, own.contact, rho)
        placed = (
            rho[0] * (one.vertices - one.seed) @ pose[:9].reshape(3, 3).T - pose[9:],
            rho[1] * (two.vertices - two.seed),
        )
        met.append((dimension(shared, least), shared, _joint(movable, static, pose, rho, own, slack), placed))
    met.sort(key=lambda own: (-own[0], len(own[2].normals)))  # the fewer directions, the less is due to the cuts
    found, known = dict[Feature, Joint](), [(size, shared, joint) for size, shared, joint, _ in met]
    for size, shared, joint, (X, Y) in met:
        if joint.feature in found:
            continue
        regions = list[Array]()
        for other_size, region, other in known:
            if other_size > size and other.feature in found:
                normals = found[other.feature].normals.T
                if ((Y @ normals).min(axis=0) - (X @ normals).max(axis=0)).min() >= -slack:
                    regions.append(region)
        if not (regions and covers(regions, [shared], slack)):  # within these, their planes are between the parts
            found[joint.feature] = joint
    wide = [own for own in found.values() if own.feature.kind == "F1F2"]
    kept = [own for own in found.values() if own in wide or not _is_held(own, wide, movable, static)]
    apart = distinct_on_true_faces([own.feature for own in kept], movable, static)
    return tuple(own.carried_by(movable, static) for own in kept if own.feature in apart)


def _joint(movable: Body, static: Body, pose: Array, rho: Array, met: Meeting, slack: float) -> Joint:
    """Return the contact of two parts that touch, with the directions in which they may come apart."""
    (i, j), contact = met
    one, two = movable.parts[i], static.parts[j]
    sites, rows = kernels.facet_rows(*one.packed, *two.packed, pose)
    tight = np.flatnonzero(np.abs(rows[:, 5] - rows[:, 3:5] @ rho) <= slack)
    own = np.array([_of_contact(one, two, contact, site) for site in sites[tight].tolist()], dtype=np.bool_)
    order = np.concatenate([tight[own], tight[~own]])  # as they turn other corners leave
    kept = order[distinct(rows[order, :3])]
    return Joint(contact.feature, (i, j), sites[kept], rows[kept, :3], ((i, j),))


def distinct(normals: Array, most: int | None = None) -> list[int]:
    """Return the place of the first of each bundle of unit directions, (n, 3), so many at most."""
    kept: list[int] = []
    for k, normal in enumerate(normals):
        if len(kept) != most and (normals[kept] @ normal < 1.0 - DEFAULT.nominal).all():
            kept.append(k)
    return kept


def _of_contact(one: ConvexPart, two: ConvexPart, contact: Contact, site: Sequence[int]) -> bool:
    """Tell whether the corner of a site, or both of its edges, are of what touches."""
    kind, i, j = site
    if kind == kernels.E1E2:
        ends = one.edges[i, :2], two.edges[j, :2]
        return bool(np.isin(contact.one, ends[0]).any() and np.isin(contact.two, ends[1]).any())
    return i in contact.one if kind == kernels.V1F2 else j in contact.two


def _is_held(joint: Joint, wide: Sequence[Joint], movable: Body, static: Body) -> bool:
    """Tell whether a contact is of corners or edges of faces that lie flush, and opens along their normals alone."""
    # directions that only cuts between the parts of a body leave to a pair of them are none of the solids'
    own = joint.feature
    around = [other.normals[0] for other in wide if is_within(own, other.feature)]
    one, two = (movable, movable.parts[joint.parts[0]]), (static, static.parts[joint.parts[1]])
    its = [normal for site, normal in zip(joint.sites, joint.normals, strict=True) if is_own(one, two, site)]
    return bool(around) and all(any(n @ other >= 1.0 - DEFAULT.side for other in around) for n in its)


def is_own(one: tuple[Body, ConvexPart], two: tuple[Body, ConvexPart], site: Ints) -> bool:
    """Tell whether a facet of two parts' Minkowski difference is one of their solids', not of a cut between parts."""
    # `one` and `two` are a part of each body; the site, (3,), is as of `kernels.facet_rows`
    kind, *rows = site.tolist()
    return all(
        (element := part.elements[letter][row]).kind == letter and body.owns(element)
        for (body, part), letter, row in zip((one, two), SITE_KINDS[kind], rows, strict=True)
        if letter != "V"
    )


def _across(one: ConvexPart, two: ConvexPart, contact: Contact, separations: Array) -> float:
    """Return how far the parts reach across the plane of a face that is said to touch; 0 where none is."""
    # `separations` along the parts' facet directions, see `kernels.facet_rows`: those of their faces come first
    deep, start = 0.0, 0
    for part, element in ((one, contact.feature.one), (two, contact.feature.two)):
        own = part.carriers(element) if element.kind == "F" else []
        deep = max(deep, -max((float(separations[start + part.loops.index(loop)]) for loop in own), default=0.0))
        start = len(part.loops)
    return deep


def site_corners(one: ConvexPart, two: ConvexPart, site: Ints | Sequence[int]) -> tuple[Vertices, Vertices]:
    """Return the vertices of the two elements of a facet of the parts' Minkowski difference."""
    kind, own, other = map(int, site)
    return one.vertices_of(SITE_KINDS[kind][0], own), two.vertices_of(SITE_KINDS[kind][1], other)


def feature_of_site(one: ConvexPart, two: ConvexPart, site: Sequence[int]) -> Feature:
    """Return the bodies' elements of a facet of two parts' Minkowski difference."""
    both = zip((one, two), SITE_KINDS[site[0]], site[1:], strict=True)
    return Feature(*(part.elements[letter][row] for part, letter, row in both))


def placed_elements(one: ConvexPart, two: ConvexPart, pose: Array, contact: Contact, rho: Array) -> tuple[Array, Array]:
    """Return the vertices of a contact's elements at a scale pair, relative to the seed of body 2."""
    X = rho[0] * (one.vertices[list(contact.one)] - one.seed) @ pose[:9].reshape(3, 3).T - pose[9:]
    return X, rho[1] * (two.vertices[list(contact.two)] - two.seed)


def _top(part: ConvexPart, n: Array, slack: float) -> list[int]:
    """Return the vertices on which n.x is largest."""
    local = part.vertices - part.seed
    heights = local @ n
    return np.flatnonzero(heights >= heights.max() - slack * np.abs(local).max()).tolist()


def contact_set(one: ConvexPart, two: ConvexPart, pose: Array, contact: Contact, rho: Array) -> Array:
    """Return the corners of what two touching parts share, (k, 3): a point, a segment's ends, or a polygon in order.

    Relative to the seed of body 2, world axes; at a pose, (12,), R, row by row, and d, and a scale pair, (2,), at which
    the elements of the contact touch.
    """
    X, Y = placed_elements(one, two, pose, contact, rho)
    if len(X) == 1 or len(Y) == 1:
        return X if len(X) == 1 else Y
    if len(Y) > 2:
        seen = np.ascontiguousarray(Y[::-1])  # from body 1 a face of body 2 runs clockwise
        shared = clipped(X, seen, DEFAULT.tie)
    elif len(X) > 2:
        shared = clipped(Y, X, DEFAULT.tie)
    elif contact.parallel:
        along = (X[1] - X[0]) / np.linalg.norm(X[1] - X[0])
        ends = np.sort(np.array([(X - X[0]) @ along, (Y - X[0]) @ along]), axis=1)
        span = np.array([ends[:, 0].max(), ends[:, 1].min()])
        shared = X[0] + span[:, None] * along if span[0] <= span[1] else X[:0]
    else:
        shared = X[:0]
    if not len(shared):  # a common point, or the middle between them
        shared = np.mean(nearest_points(X, Y), axis=0, keepdims=True)
    return _distinct(shared)


def covers(regions: list[Array], segments: list[Array], slack: float) -> bool:
    """Tell whether convex regions hold ends and middles of segments, or points: what touches there is their border."""
    # parts that are cut where a larger contact goes on have such contacts of their own
    low, high = (np.array([end(region, axis=0) for region in regions]) for end in (np.min, np.max))
    points = [point for ends in segments for point in (*ends, ends.mean(axis=0))]
    for point in points:
        near = np.flatnonzero(((low - slack <= point) & (point <= high + slack)).all(axis=1)).tolist()
        if not any(_holds(regions[k], point, slack) for k in near):
            return False
    return True


def _holds(region: Array, point: Array, slack: float) -> bool:
    """Tell whether a point lies in a convex polygon, corners in order, or on a segment."""
    sides, spokes = np.roll(region, -1, axis=0) - region, point - region
    lengths = np.linalg.norm(sides, axis=1)
    turns = np.cross(sides, spokes)
    normal = np.cross(sides, np.roll(sides, -1, axis=0)).sum(axis=0)
    size = np.linalg.norm(normal)
    if len(region) < 3 or not size > slack * lengths.max():
        return bool(np.linalg.norm(spokes, axis=1).sum() <= lengths.max() + slack)
    level = abs(float(spokes[0] @ normal)) <= slack * size
    return bool(level and (turns @ normal >= -slack * lengths * size).all())


NARROWEST = 0.5
"""Times the length `least`: no width of a region of `dimension` 2 is less.

It holds a triangle with a base of b, the farthest from its corner, a height above `least`, and no side above 2 b.
"""


def dimension(points: Array, least: float) -> int:
    """Return 0 for points no more than a length apart, 1 for a segment, 2 for what is wider than the length."""
    spokes = points - points[0]
    along = spokes[np.argmax((spokes**2).sum(axis=1))]
    length = float(np.linalg.norm(along))
    if not length > least:
        return 0
    return 2 if np.linalg.norm(np.cross(spokes, along / length), axis=1).max() > least else 1


def _distinct(points: Array) -> Array:
    """Drop points that repeat the one before them, the first after the last."""
    near = DEFAULT.nominal * np.abs(points).max()
    kept = (np.abs(points - points[np.arange(len(points)) - 1]) > near).any(axis=1)
    return points[kept] if kept.any() else points[:1]
