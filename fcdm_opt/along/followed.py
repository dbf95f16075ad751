"""The contact that a coherent range follows: its features, what they rest on, and the conditions that make it real.

A feature of a part pair is the real contact as long as nothing of either part is beyond its plane (its neighbours are
not), and the contact point lies within its elements. A flush contact also needs its elements aligned, and to share more
than a point: no direction in the plane may part them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from fcdm_opt.along import conditions as forms
from fcdm_opt.along.conditions import CROSSED, FIXED, TURNED, Conditions
from fcdm_opt.curve.contact import Contact, Joint, kind_and_row
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.flush import Flush, outward_directions
from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.curve.region import Piece
from fcdm_opt.curve.segments import SwitchingPoint
from fcdm_opt.curve.true_sizes import contacts_as_drawn
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.model.seats import flush_of
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

Parts = tuple[int, int]
Site = tuple[int, int, int]
UNTRACKED = 1000  # added to the number of a contact that gives none of the lines of the scale pair
OPENS = "the flush contact opens"
REACHES, NOT_SHARED = "the contact point reaches the", "nothing more is shared beyond the edge"
NO_CONTACT = "at their nominal sizes the parts do not touch, so that there is no contact to follow"
TOUCH_BETWEEN = "the parts touch on their true faces, and a range follows facets, which are apart there"
KINDS = {
    "border": "the contact point reaches the end of its feature",
    "neighbour": "a neighbouring feature of the same bodies takes over",
    "overlap": "another pair of convex parts takes over",
    "opens": "a flush contact does not stay flush",
    "parallel edges": "the edges in contact become parallel",
    "parallel lines": "the two contact lines become parallel: their scale pair leaves for infinity",
    "scale": "a scale becomes zero",
    "undefined": "the motion is not defined beyond",
    "limit": "a limit of the motion, or the one asked for",
    "whole turn": "nothing: the motion repeats itself",
    "unbounded": "nothing, however far",
    "search": "nothing as far as was looked",
}
"""What ends a coherent range."""


class Cause(NamedTuple):
    """What a condition stands for: the kind of event where it fails, the tracked feature's number, and words."""

    kind: str
    feature: int
    what: str


LineAndConditions = tuple[Array | None, list[tuple[Conditions, Cause]]]


@dataclass(frozen=True, eq=False)
class Rest:
    """A part pair on which a tracked feature can rest, with the conditions that make it real there."""

    parts: Parts
    corners: tuple[Array, Array]  # (n, 3): of either part's elements in contact, relative to its seed
    # returns `line` and `groups`: of hundreds of part pairs on which a large face lies few are asked for them
    make: Callable[[], LineAndConditions]

    @cached_property
    def _line_and_conditions(self) -> LineAndConditions:
        return self.make()

    @property
    def line(self) -> Array | None:
        """(13,), see `TrackedPair`; None of a contact that gives none of the lines of the scale pair."""
        return self._line_and_conditions[0]

    @property
    def groups(self) -> list[tuple[Conditions, Cause]]:
        """Conditions of which in each group one must hold."""
        return self._line_and_conditions[1]


class Followed(NamedTuple):
    """One tracked feature, and all part pairs on which it can rest: faces and edges may be spread over several."""

    feature: Feature
    flush: bool  # whether more than a point is in contact, and must stay so
    rests: tuple[Rest, ...]  # the one at rest first


def followed(problem: Problem) -> tuple[Followed, ...]:
    """Return the features of a problem's nominal contact, two at a switching point, one in a segment; or its joints.

    Raises `InputError` where the parts do not touch at the nominal pair.
    """
    if joints := followed_joints(problem):
        return _jointly_followed(problem, joints)
    contact = problem.nominal_contact
    if contact is None:
        what = TOUCH_BETWEEN if touch_on_true_faces(problem) else NO_CONTACT
        what += ": the nominal pair is not on the decision curve"
        allowed = "a switching point, or a pair on the curve; contact_times tells when the parts made touch"
        raise InputError(what, key="nominal", found=problem.nominal_pair.tolist(), allowed=allowed)
    pieces: tuple[Piece, ...] = (
        contact.pieces if isinstance(contact, SwitchingPoint) else (contact.piece_at(problem.nominal_pair),)
    )
    seats = problem.nominal_seats if any(_is_flush(piece) for piece in pieces) else ()
    return tuple(_followed(problem, piece, seats, k) for k, piece in enumerate(pieces))


def followed_joints(problem: Problem) -> tuple[Joint, ...]:
    """Return the contacts that are followed together: those chosen, or all where no size changes what touches."""
    return problem.chosen_joints or (() if problem.nominal_contact else problem.nominal_joints)


def touch_on_true_faces(problem: Problem) -> bool:
    """Tell whether the parts touch at their nominal sizes where a round face takes part, wherever its facets are."""
    facets = problem.of_facets
    return bool(contacts_as_drawn(facets.movable, facets.static, facets.nominal_pair, facets.contact_slack))


def _jointly_followed(problem: Problem, joints: Sequence[Joint]) -> tuple[Followed, ...]:
    """Return all contacts that are followed together, those first whose lines give the scale pair: one, or two."""
    # of the others, and of further lines that corners and edges have, the gap must stay 0 at that pair; so must all,
    # at the pair as given, where both seeds lie in every plane of contact: no scale changes what touches there
    seats, found = problem.nominal_seats, list[tuple[Feature, bool, Parts, Flush | None, Site, Array]]()
    for joint in joints:
        own = [flush for flush in seats if joint.feature in (flush.feature, flush.touching)]
        if own:
            found += [(joint.feature, True, flush.parts, flush, flush.site, flush.normal) for flush in own]
        else:
            every = zip(joint.sites.tolist(), joint.normals, strict=True)
            found += [(joint.feature, False, joint.parts, None, tuple(there), normal) for there, normal in every]
    found.sort(key=lambda own: own[4][0] != E1E2)
    lines = np.array([_scales(problem, parts, normal) for _, _, parts, _, _, normal in found])
    tracked = np.flatnonzero(lines.any(axis=1))[:1].tolist()
    for first in tracked[:1]:
        across = np.abs(lines[first, 0] * lines[:, 1] - lines[first, 1] * lines[:, 0])
        tracked += [int(across.argmax())] if across.max() > DEFAULT.nominal else []
    made = []
    for k, n in enumerate([*tracked, *(n for n in range(len(found)) if n not in tracked)]):
        feature, is_flush, parts, flush, site, normal = found[n]
        if k >= len(tracked) and site[0] == E1E2:
            what = "a range follows edges that cross where they give the scale pair, and these do not"
            raise InputError(what, key="contacts", found=feature.label, allowed="two contacts of edges at most")
        place = k if k < len(tracked) else UNTRACKED + k
        if flush is not None:
            rests = _flush_rests(problem, flush, place)
        else:
            sites = [(parts, site), *(own for own in _sites(problem, feature, site[0]) if own != (parts, site))]
            rests = [_rest(problem, own, there, normal, place) for own, there in sites]
        made.append(Followed(feature, is_flush, tuple(rests)))
    return tuple(made)


def _scales(problem: Problem, parts: Parts, normal: Array) -> Array:
    """Return a and b of a contact line as drawn, of length 1; zeros where its plane goes through both seeds."""
    one, two = (body.parts[k] for body, k in zip(problem.active, parts, strict=True))
    a, b = ((one.vertices - one.seed) @ normal).max(), ((two.seed - two.vertices) @ normal).max()
    line = np.array([a, b])
    length = float(np.linalg.norm(line))
    return line / length if length > DEFAULT.nominal * problem.size else np.zeros(2)


def _is_flush(piece: Piece) -> bool:
    return piece.feature.is_flush or piece.contact.parallel


def _followed(problem: Problem, piece: Piece, seats: Sequence[Flush], k: int) -> Followed:
    pair, aligned = problem.nominal_pair, [each for each in seats if each.normal @ piece.normal > 1.0 - DEFAULT.nominal]
    here = [flush_of(piece, seats), *(each for each in aligned if abs(each.gap(pair)) <= DEFAULT.shared * each.least)]
    known = [each for each in here if each is not None] if _is_flush(piece) else []
    if known:
        flush = max(known, key=lambda each: each.dimension)  # the face, not an edge of one of its facets
        return Followed(flush.touching, True, tuple(_flush_rests(problem, flush, k)))
    feature = piece.feature
    sites = [(piece.parts, piece.site)]
    sites += [other for other in _sites(problem, feature, piece.site[0]) if other != sites[0]]
    rests = [_rest(problem, parts, site, piece.normal, k) for parts, site in sites]
    return Followed(feature, False, tuple(rests))


def _place(parts: Sequence[ConvexPart], part: ConvexPart) -> int:
    return next(k for k, own in enumerate(parts) if own is part)


def _sites(problem: Problem, feature: Feature, kind: int) -> Iterator[tuple[Parts, Site]]:
    """Yield where the bodies' parts have the elements of a feature."""
    if feature.kind != {F1V2: "F1V2", V1F2: "V1F2", E1E2: "E1E2"}[kind]:
        return
    for i, one in enumerate(problem.active[0].parts):
        for first in one.carriers(feature.one):
            for j, two in enumerate(problem.active[1].parts):
                for second in two.carriers(feature.two):
                    yield (i, j), (kind, kind_and_row(one, first)[1], kind_and_row(two, second)[1])


def _rest(problem: Problem, parts: Parts, site: Site, normal: Array, k: int) -> Rest:
    """Return a part pair whose corner, or crossing edges, are the contact."""
    one, two = problem.active[0].parts[parts[0]], problem.active[1].parts[parts[1]]
    kind, i, j = site
    own = one.loops[i] if kind == F1V2 else one.edges[i, :2] if kind == E1E2 else [i]
    other = two.loops[j] if kind == V1F2 else two.edges[j, :2] if kind == E1E2 else [j]
    corners = one.vertices[list(own)] - one.seed, two.vertices[list(other)] - two.seed
    return Rest(parts, corners, partial(_point_conditions, one, two, site, normal, k))


def _point_conditions(one: ConvexPart, two: ConvexPart, site: Site, normal: Array, k: int) -> LineAndConditions:
    """Return the line of a corner or of crossing edges, and that they meet within their elements."""
    X, Y = one.vertices - one.seed, two.vertices - two.seed
    line, made = _supported(one, two, site, normal, k)
    kind, i, j = site
    if kind != E1E2:
        part, body, face, point = (two, 2, j, X[i]) if kind == V1F2 else (one, 1, i, Y[j])
        corners = list(part.loops[face])
        outward = outward_directions(part.vertices[corners], part.normals[face], along=False)
        return line, made + _within(part, body, corners, outward, point, k, f"{REACHES} edge")
    (a, b), (c, d) = one.edges[i, :2].tolist(), two.edges[j, :2].tolist()
    e, f = _unit(X[b] - X[a]), _unit(Y[d] - Y[c])
    sign = 1.0 if np.cross(e, f) @ normal > 0 else -1.0
    for v, ahead in ((a, sign), (b, -sign)):
        ends = Conditions.of(forms.ACROSS, k, v=X[v], w=Y[c], m=f, sign=ahead)
        made.append((ends, _border(one, 1, (v,), k, f"{REACHES} vertex")))
    for w, ahead in ((c, sign), (d, -sign)):
        ends = Conditions.of(forms.ACROSS_TURNED, k, v=X[a], w=Y[w], m=e, sign=ahead)
        made.append((ends, _border(two, 2, (w,), k, f"{REACHES} vertex")))
    return line, made


def _within(
    part: ConvexPart, body: int, corners: Sequence[int], outward: Array, points: Array, k: int, what: str
) -> list[tuple[Conditions, Cause]]:
    """Return that points of the other body, (3,) or one of (n, 3), stay within a face or an edge of a body's part."""
    local, made = part.vertices - part.seed, []
    normal = k if k < UNTRACKED else 0
    for place, (corner, out) in enumerate(zip(corners, outward, strict=True)):
        after = corners[(place + 1) % len(corners)]
        if body == 1:
            own = Conditions.of(forms.ALONG_TURNED, normal, v=local[after], w=points, m=out, sign=-1.0)
        else:
            own = Conditions.of(forms.ALONG, normal, v=points, w=local[after], m=out)
        made.append((own, _border(part, body, (corner, after), k, what)))
    return made


def _supported(
    one: ConvexPart, two: ConvexPart, site: Site, normal: Array, k: int
) -> tuple[Array | None, list[tuple[Conditions, Cause]]]:
    """Return the line of a site, and that no neighbour is beyond its plane; untracked that its gap stays 0, besides."""
    made: list[tuple[Conditions, Cause]] = []
    kind, i, j = site
    X, Y = one.vertices - one.seed, two.vertices - two.seed
    if k >= UNTRACKED:
        k -= UNTRACKED
        turned = kind == F1V2
        form, m = (forms.ALONG_TURNED, one.normals[i]) if turned else (forms.ALONG, -two.normals[j])
        v, w = X[one.loops[i][0] if turned else i], Y[j if turned else two.loops[j][0]]
        closed = [Conditions.of(form, v=v, w=w, m=m, sign=side) for side in (1.0, -1.0)]
        made += [(own, Cause("opens", k, "the contacts have no scale pair in common")) for own in closed]
        for vertex, _ in _neighbours(two, j) if turned else _neighbours(one, i):
            ends = {"w": Y[vertex]} if turned else {"v": X[vertex]}
            beyond = Conditions.of(form, **{"v": v, "w": w, **ends}, m=m)
            made.append((beyond, _neighbour(two if turned else one, 2 if turned else 1, vertex, k)))
        return None, made
    if kind == V1F2:
        line = np.concatenate([[FIXED, 0, 0, 0], -two.normals[j], X[i], Y[two.loops[j][0]]])
    elif kind == F1V2:
        line = np.concatenate([[TURNED], one.normals[i], [0, 0, 0], X[one.loops[i][0]], Y[j]])
    else:
        (a, b), (c, d) = one.edges[i, :2].tolist(), two.edges[j, :2].tolist()
        e, f = _unit(X[b] - X[a]), _unit(Y[d] - Y[c])
        sign = 1.0 if np.cross(e, f) @ normal > 0 else -1.0
        line = np.concatenate([[CROSSED], e, sign * f, X[a], Y[c]])
    own = _neighbours(one, i) if kind == V1F2 else _vertices_off_edge(one, i) if kind == E1E2 else []
    other = _neighbours(two, j) if kind == F1V2 else _vertices_off_edge(two, j) if kind == E1E2 else []
    for v, base in own:
        made.append((Conditions.of(forms.OWN, k, v=X[v] - X[base], sign=-1.0), _neighbour(one, 1, v, k)))
    for w, base in other:
        made.append((Conditions.of(forms.OTHER, k, w=Y[w] - Y[base]), _neighbour(two, 2, w, k)))
    return line, made


def _flush_rests(problem: Problem, flush: Flush, k: int) -> list[Rest]:
    """Return the part pairs whose elements lie in the plane of a flush contact, its own first."""
    rests = []
    for one, two, contact in flush.carriers:
        parts = _place(problem.active[0].parts, one), _place(problem.active[1].parts, two)
        corners = one.vertices[list(contact.one)] - one.seed, two.vertices[list(contact.two)] - two.seed
        rests.append(Rest(parts, corners, partial(_flush_conditions, one, two, flush, contact, k)))
    return sorted(rests, key=lambda rest: rest.parts != flush.parts)


def _flush_conditions(one: ConvexPart, two: ConvexPart, flush: Flush, contact: Contact, k: int) -> LineAndConditions:
    """Return the conditions of elements that lie in one plane: aligned, and no direction in the plane parts them."""
    X, Y = one.vertices - one.seed, two.vertices - two.seed
    n, own, other, parallel = flush.normal, contact.one, contact.two, contact.parallel
    faces = [int(np.argmax(part.normals @ direction)) for part, direction in ((one, n), (two, -n))]
    has = [
        bool(part.normals[face] @ direction > 1.0 - DEFAULT.nominal)
        for part, face, direction in zip((one, two), faces, (n, -n), strict=True)
    ]
    site = (V1F2, own[0], faces[1]) if has[1] else (F1V2, faces[0], other[0])
    line, made = _supported(one, two, site, n, k)
    if has[0] and has[1]:  # the other face must stay aligned too
        for v in one.loops[faces[0]][1:]:
            tracked = k < UNTRACKED
            aligned = (
                Conditions.of(forms.OWN, k, v=X[v] - X[own[0]], sign=-1.0)
                if tracked
                else Conditions.of(forms.ALONG, v=X[v], w=Y[other[0]], m=n)
            )
            made.append((aligned, Cause("opens", k % UNTRACKED, OPENS)))
    if parallel:  # each edge stays on the other
        across = _unit(np.cross(n, Y[other[1]] - Y[other[0]]))
        on_edge = Conditions.of(forms.ALONG, k if k < UNTRACKED else 0, v=X[own[0]], w=Y[other[0]], m=across)
        made.append((on_edge, Cause("opens", k % UNTRACKED, OPENS)))
    mine, theirs = X[list(own)], Y[list(other)]
    made += _within(one, 1, own, outward_directions(mine, n, parallel), theirs, k, NOT_SHARED)
    made += _within(two, 2, other, outward_directions(theirs, n, parallel), mine, k, NOT_SHARED)
    return line, made


def _neighbours(part: ConvexPart, vertex: int) -> list[tuple[int, int]]:
    """Return the vertices joined to a vertex by an edge, each with the vertex itself."""
    half = part.half_edges
    return [(int(v), vertex) for v in half[half[half[:, 0] == vertex, 2], 0]]


def _vertices_off_edge(part: ConvexPart, edge: int) -> list[tuple[int, int]]:
    """Return a vertex of either face of an edge that is off it, each with a vertex of the edge."""
    half, found = part.half_edges, []
    for h in (2 * edge, 2 * edge + 1):
        after = half[half[h, 3], 3]  # from the end of the side after it
        found.append((int(half[after, 0]), int(half[h, 0])))
    return found


def _unit(x: Array) -> Array:
    return np.asarray(x / np.linalg.norm(x))


def _names(part: ConvexPart, vertices: Sequence[int]) -> str:
    return ",".join("V" + "/".join(map(str, part.elements["V"][v].vertices)) for v in vertices)


def _border(part: ConvexPart, body: int, ends: Sequence[int], k: int, what: str) -> Cause:
    return Cause("border", k % UNTRACKED, f"{what} {_names(part, ends)} of body {body}")


def _neighbour(part: ConvexPart, body: int, vertex: int, k: int) -> Cause:
    return Cause("neighbour", k, f"the neighbouring vertex {_names(part, (vertex,))} of body {body} reaches the plane")
