"""All contact lines that meet at a point of the curve: more than the two of its segments where vertices touch."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import located, near_pairs, supporting_contact
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.segments import SwitchingPoint
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.tolerances import DEFAULT

POINTS = 64  # switching points of which what was found is kept: many problems share one


class TightLine(NamedTuple):
    """A contact line through a point of the curve."""

    feature: Feature
    parts: tuple[int, int]  # parts, site: part pair, and facet of the Minkowski difference (see `kernels`)
    site: tuple[int, int, int]
    normal: Array  # normal, line: (3,): unit direction from body 1 to body 2; (a, b, c)
    line: Array


@lru_cache(maxsize=POINTS)
def tight_lines(point: SwitchingPoint) -> tuple[TightLine, ...]:
    """Return the contact lines that meet at a switching point, one a feature: those of its segments, then others."""
    # those of the facets of Minkowski differences that touch there, to `Tolerances.nominal` of the size: a motion may
    # bring any of them to the curve
    movable, static = point.bodies
    sides = zip(point.features, point.pieces, strict=True)
    found = {name: TightLine(name, own.parts, own.site, own.normal, own.line) for name, own in sides}
    slack = DEFAULT.nominal * max(movable.size, static.size)
    for (i, j), sites, rows, separations in near_pairs(movable, static, point.pose, point.rho, slack):
        if separations.max() > slack:
            continue
        one, two = movable.parts[i], static.parts[j]
        for k in np.flatnonzero(separations >= -slack).tolist():
            contact = supporting_contact(one, two, rows[k, :3], point.pose)
            name = located(one, two, point.pose, contact, point.rho).feature
            kind, first, second = (int(x) for x in sites[k])
            found.setdefault(name, TightLine(name, (i, j), (kind, first, second), rows[k, :3], rows[k, 3:]))
    return tuple(found.values())


def parallel(one: Array, two: Array) -> bool:
    """Tell whether two contact lines fix no point."""
    (a, b, _), (d, e, _) = one, two
    return bool(abs(a * e - b * d) <= DEFAULT.determinant * math.hypot(a, b) * math.hypot(d, e))


@lru_cache(maxsize=POINTS)
def choices(point: SwitchingPoint) -> tuple[tuple[Feature, Feature], ...]:
    """Return the pairs of features that a switching point may keep under a motion, where three or more lines meet."""
    # which two of them stay consecutive on the curve depends on the motion: those of its segments, neighbours on a part
    # pair's Minkowski difference, or two part pairs'. Empty where there is no choice
    movable, static = point.bodies
    lines, found = tight_lines(point), []
    if len(lines) < 3:
        return ()
    for k, (one, two) in enumerate(combinations(lines, 2)):
        (i, j), others = one.parts, two.parts
        common = edge_and_corner(one.site, two.site, movable.parts[i], static.parts[j])
        if (k == 0 or (i, j) != others or common is not None) and not parallel(one.line, two.line):
            found.append((one.feature, two.feature))
    return tuple(found)


def edge_and_corner(
    one: tuple[int, int, int], two: tuple[int, int, int], first: ConvexPart, second: ConvexPart
) -> tuple[int, int, int] | None:
    """Return the edge of one part and the corner of the other that two sites of a part pair have in common.

    As (0 or 1: the part of the edge, edge, corner). Such sites are neighbours on the Minkowski difference, and stay so
    on a moved curve; other sites that meet in a point, vertex on vertex, part at the first motion. None for them.
    """
    parts = (first, second)
    for own in (0, 1):
        edge, corner = _common_edge(one, two, own, parts[own]), _common_corner(one, two, 1 - own, parts[1 - own])
        if edge is not None and corner is not None:
            return own, edge, corner
    return None


def _common_edge(one: tuple[int, int, int], two: tuple[int, int, int], own: int, part: ConvexPart) -> int | None:
    face = (kernels.F1V2, kernels.V1F2)[own]
    edges = {site[1 + own] for site in (one, two) if site[0] == kernels.E1E2}
    faces = {site[1 + own] for site in (one, two) if site[0] == face}
    if len(edges) == 1 and len(faces) <= 1:
        (edge,) = edges
        return edge if faces <= set(part.edges[edge, 2:].tolist()) else None
    if len(faces) == 2:
        common = np.flatnonzero((np.sort(part.edges[:, 2:], axis=1) == sorted(faces)).all(axis=1))
        return int(common[0]) if len(common) else None
    return None


def _common_corner(one: tuple[int, int, int], two: tuple[int, int, int], own: int, part: ConvexPart) -> int | None:
    facing = (kernels.V1F2, kernels.F1V2)[own]
    corners = [
        {site[1 + own]} if site[0] == facing else set(part.edges[site[1 + own], :2].tolist())
        for site in (one, two)
        if site[0] in (facing, kernels.E1E2)
    ]
    common = set.intersection(*corners) if len(corners) == 2 else set()
    return int(common.pop()) if len(common) == 1 else None
