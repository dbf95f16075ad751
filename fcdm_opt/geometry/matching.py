"""Walls that two files have in common, made the same: each has them as its digits tell, a last digit apart.

A peg and its hole are drawn with the same wall. Written with 7 digits, each with corners of its own, the two walls are
two planes, which cross or overlap by 1e-7 of the size: a fit that is line to line would count as one that does not fit.
What the digits cannot tell apart is taken as one: corners of all bodies are moved onto common planes together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.crossings import overlapping
from fcdm_opt.geometry.decomposition import Method
from fcdm_opt.geometry.flattening import Incidences, sections, settled
from fcdm_opt.geometry.measures import norms, units
from fcdm_opt.geometry.polygons import components, coplanar
from fcdm_opt.tolerances import DEFAULT

APART = 2.0  # times the rounding of both: planes through rounded corners, looked at where the other's corners are
REMEMBERED = 4  # questions: the cases of a file are about the same bodies, and so is one with more parts modelled


def matched(bodies: Sequence[Body], directions: Sequence[Array] = ()) -> tuple[Body, ...]:
    """Return bodies as drawn in one frame, with planes that their files' digits cannot tell apart made the same.

    So are those made parallel to one another and to directions of motions, or square to these, that may have been drawn
    so: a wall which a part slides along must not cross its way. Bodies whose coordinates are exact (`Body.rounding` 0)
    stay as they are, and others are moved to them. The seeds stay; so do all bodies where no planes are that near each
    other, or they are the same already.
    """
    return _matched(tuple(bodies), tuple(tuple(direction.tolist()) for direction in directions))


@lru_cache(maxsize=REMEMBERED)
def _matched(bodies: tuple[Body, ...], directions: tuple[tuple[float, ...], ...]) -> tuple[Body, ...]:
    loose = [body.rounding > 0.0 and (len(body.parts) == 1 or bool(body.triangles)) for body in bodies]
    if len(bodies) < 2 or not any(loose):
        return bodies
    counts = [len(body.vertices) for body in bodies]
    points, starts = np.concatenate([body.vertices for body in bodies]), np.cumsum([0, *counts])
    kept = [_walls(body) for body in bodies]
    faces = [
        [start + own for own, k in zip(_faces(body), its.tolist(), strict=True) if k]
        for body, start, its in zip(bodies, starts.tolist(), kept, strict=False)
    ]
    lies = _incidences(bodies, points, faces, kept, np.repeat(loose, counts), np.array(directions).reshape(-1, 3))
    if lies is None:
        return bodies
    most = np.repeat([APART * body.rounding for body in bodies], counts)
    held = np.asarray(lies.held)
    while True:
        place = settled(points, replace(lies, held=held), max(body.rounding for body in bodies))
        far = (norms(place - points) > most) & ~held
        if not far.any():
            break
        held = held | far  # where planes hardly cross: their digits do not tell that it is elsewhere
    places = np.split(place, starts[1:-1])
    try:
        return tuple(_moved(body, own) for body, own in zip(bodies, places, strict=True))
    except InputError:  # of slivers finer than the digits none may be left
        return bodies


def _faces(body: Body) -> list[Ints]:
    """Return the rows of the vertices of each face, those within it too."""
    if body.triangles:
        return [np.unique(own) for own in body.triangles]
    return [np.array(face, np.int64) - 1 for face in body.faces]


def _walls(body: Body) -> Flags:
    """Tell which faces are not known to be facets of round ones: those are as they are told to be, to all digits."""
    count, errors = len(body.faces), body.facet_errors
    return np.ones(count, bool) if errors is None or body.surfaces is None else np.asarray(errors.max(axis=1) == 0.0)


def _incidences(
    bodies: Sequence[Body], points: Array, faces: list[list[Ints]], kept: list[Flags], free: Flags, directions: Array
) -> Incidences | None:
    """Return which vertices lie on which planes as far as digits tell; None where those of two bodies do so exactly."""
    every = [own for some in faces for own in some]
    owner = np.repeat(np.arange(len(bodies)), list(map(len, faces)))
    rounding = np.array([body.rounding for body in bodies])[owner]
    planes = ([own[its] for own in body.face_planes] for body, its in zip(bodies, kept, strict=True))
    normals, bases = (np.concatenate(own) for own in zip(*planes, strict=True))
    levels = (normals * bases).sum(axis=1)
    first, margin = np.cumsum([0, *map(len, every)]), APART * 2.0 * float(rounding.max())
    rows = np.concatenate(every)
    low, high = (end.reduceat(points[rows], first[:-1]) for end in (np.minimum, np.maximum))
    found = np.concatenate([np.column_stack(pair) for pair in overlapping(low - margin, high + margin, owner)])
    plane, other = np.concatenate([found, found[:, ::-1]]).T
    size = np.diff(first)[other]
    pair, start = np.repeat(np.arange(len(other)), size), np.cumsum(size) - size
    corner, at = rows[np.arange(len(pair)) + (first[other] - start)[pair]], plane[pair]
    heights = np.abs((normals[at] * points[corner]).sum(axis=1) - levels[at])
    on = heights <= APART * (rounding[plane] + rounding[other])[pair]
    same = [np.column_stack([plane, other])[np.bincount(pair, ~on, len(other)) == 0]]
    least, most = (end.reduceat(np.where(on[:, None], points[corner], np.nan), start) for end in (np.fmin, np.fmax))
    # where corners on a plane, or the edges between them, meet its face
    met = on & ((most >= low[plane] - margin) & (least <= high[plane] + margin)).all(axis=1)[pair]
    touched, end = np.column_stack([at, corner])[met], 0
    for some, body in zip(faces, bodies, strict=True):
        begin, end = end, end + len(some)
        slack = DEFAULT.planarity * body.size
        groups = [begin + group for group in coplanar(points, some, normals[begin:end], levels[begin:end], slack)]
        same += [np.column_stack([np.repeat(group[:1], len(group) - 1), group[1:]]) for group in groups]
    plane = components(np.concatenate(same), len(every))
    exact = np.bincount(plane, ~free[[own[0] for own in every]])[plane] > 0  # one that is with exact corners is theirs
    face = np.repeat(np.arange(len(every)), np.diff(first))
    meet = np.bincount(np.unique(np.column_stack([plane[face], rows]), axis=0)[:, 1])  # planes, in each corner
    loose = np.maximum.reduceat(meet[rows], first[:-1]) <= 3  # others, of curved meshes, cannot be turned
    loose[touched[:, 0]] = True
    spans, off = _directions(points, every, normals, 2.0 * APART * rounding, owner, loose, directions)
    if max(off, heights[met].max(initial=0.0)) <= DEFAULT.tie * float(np.abs(points).max()):
        return None
    fixing = ~exact[face] | ~free[rows]
    pairs = np.concatenate([np.column_stack([plane[face], rows, fixing]), np.insert(touched, 2, 0, axis=1)])
    pairs[len(rows) :, 0] = plane[touched[:, 0]]
    pairs = pairs[np.lexsort((-pairs[:, 2], pairs[:, 1], pairs[:, 0]))]
    pairs = pairs[np.r_[True, (pairs[1:, :2] != pairs[:-1, :2]).any(axis=1)]]
    cuts, begin = list[Ints](), 0  # along which the solids are cut into parts
    for body in bodies:
        if body.triangles and not body.is_surface:
            triangles = np.concatenate([np.array(own) for own in body.triangles])
            cuts += [begin + own for own in sections(body.vertices, triangles, DEFAULT.planarity * body.size)]
        begin += len(body.vertices)
    cuts = [own for own in cuts if free[own[0]]]
    corner = np.concatenate([pairs[:, 1], *cuts])
    number = np.concatenate([pairs[:, 0], np.repeat(plane.max() + 1 + np.arange(len(cuts)), list(map(len, cuts)))])
    fixing = np.concatenate([pairs[:, 2] > 0, np.ones(len(corner) - len(pairs), bool)])
    return Incidences(corner, number, fixing, ~free, {int(plane[k]): own for k, own in spans.items() if not exact[k]})


def _directions(
    points: Array, faces: list[Ints], normals: Array, slack: Array, owner: Ints, free: Flags, motions: Array
) -> tuple[dict[int, Array], float]:
    """Return what spans the normals of faces parallel to others or motions, (3, 1 or 2), and how far it tilts them."""
    from scipy.spatial import KDTree

    extents = norms(np.array([np.ptp(points[own], axis=0) for own in faces]))
    in_turn = np.lexsort((-extents, slack > 0.0)).tolist()  # exact ones first
    tree, free, spans, off = KDTree(normals), free.copy(), dict[int, Array](), 0.0
    for normal, first in [(own, -1) for own in motions] + [(normals[k], k) for k in in_turn]:
        group = {first} - {-1}
        if group and not free[first]:
            continue
        along = motions[np.abs(motions @ normal) * extents[first] <= slack[first]][: len(motions) * len(group)]
        _, sizes, axes = np.linalg.svd(along)
        span = axes[int((sizes > DEFAULT.sharp).sum()) :].T
        normal = units(span @ span.T @ normal)
        near = [k for side in (normal, -normal) for k in tree.query_ball_point(side, DEFAULT.sharp) if free[k]]
        tilts = {k: float(np.ptp(points[faces[k]] @ normal)) for k in {*near, *group}}
        group |= {k for k in near if tilts[k] <= slack[k]}
        free[list(group)] = False
        ahead, back = ({int(owner[k]) for k in group if side * (normals[k] @ normal) > 0.0} for side in (1.0, -1.0))
        if (ahead and back and len(ahead | back) > 1) or len(along) or first < 0:  # that may meet, or slide
            off = max(off, *(tilts[k] for k in group), 0.0)
        if len(along) or len(group) > 1 or first < 0:
            spans |= dict.fromkeys(group, span if group == {first} else normal[:, None])
    return spans, off


def _moved(body: Body, points: Array) -> Body:
    """Return a body made anew of moved vertices; its seed stays where it is."""
    moved = float(norms(points - body.vertices).max())
    if moved == 0.0:
        return body
    if len(body.parts) == 1:
        part = body.parts[0].placed(points[body._part_rows[0]], body.seed)
        made = replace(body, vertices=frozen(points), parts=(part,))
    else:
        triangles = [own for face in body.triangles for own in face]
        drawn = points[: 1 + max(map(max, triangles))]
        method: Method = "surface" if body.is_surface else "exact"
        made = Body.from_mesh(drawn, triangles, decomposition=method, seed=body.seed, name=body.name)
    out, short = body.deviation
    if made.faces == body.faces:
        made = replace(made, facet_errors=body.facet_errors, surfaces=body.surfaces)
    made = replace(made, notes=body.notes, rounding=body.rounding, unit=body.unit)
    return replace(made, deviation=(out + moved, short + moved))
