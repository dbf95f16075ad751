"""What may hold a smallest motion: contacts, what they ask as numbers with derivatives, and whether they are real.

All is worked out on the vertices and the motion's formulas, in numbers of any kind; no hull's normals, no kernels.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.kernels import E1E2, F1V2
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import ConvexPart
from fcdm_opt.geometry.collision import face_corners
from fcdm_opt.model.task import Task
from fcdm_opt_benchmarks.motions.jets import Jet, certain, cross, dot, minus, value

SLACK = 1e-7  # relative: a contact whose separation is smaller may hold the motion


class HoldingContact(NamedTuple):
    """A face, edge or vertex of part 1 and one of part 2 in a plane, by vertices; faces counter-clockwise.

    `corners` of the face span its normal; `sign` orients the cross product of two edges from body 1 to body 2.
    """

    one: tuple[int, ...]
    two: tuple[int, ...]
    corners: tuple[int, ...] = ()
    sign: float = 1.0

    def __str__(self) -> str:
        names = {1: "V", 2: "E"}
        sides = (
            names.get(len(own), "F") + "".join(f"{v + 1}," for v in own).rstrip(",") for own in (self.one, self.two)
        )
        return " on ".join(sides)


class Held(NamedTuple):
    """Contacts that may hold a motion, and how.

    `asks`: "meet" where all contacts must not be apart at the target pair, "part" where they, which share one normal,
    must not overlap there, "at" where they go through the target pair, "beyond" where their common scale pair must not
    fall short of the target pair in the scales `pinned`.
    """

    contacts: tuple[HoldingContact, ...]
    asks: str
    pinned: tuple[int, ...] = ()


def holders(task: Task, q: Array) -> list[Held]:
    """Return what may hold a motion, by what is tight there to within rounding."""
    if task.goal in ("at", "beyond"):
        rho, _, tracked = task.tracked_contact(q)
        contacts = tuple(_contact(task, feature.site, feature.normal, q) for feature in tracked)
        if task.goal == "at":
            return [Held(contacts, "at")]
        short = np.abs(rho / task.target - 1.0)
        return [Held(contacts, "beyond", tuple(np.flatnonzero(short <= SLACK).tolist()))]
    sites, rows, separations = task.separations((0, 0), task.pose(q))
    asked = task.need if task.gap(task.rest) < task.need else 0.0
    tight = np.abs(separations - asked) <= SLACK * task.size
    contacts = tuple(_contact(task, site, row[:3], q) for site, row in zip(sites[tight], rows[tight], strict=True))
    if task.gap(task.rest) > task.need:
        return [Held(contacts, "meet")]
    planes: dict[tuple[int, ...], list[HoldingContact]] = {}
    for contact in contacts:
        key = (len(contact.one), *contact.corners) if contact.corners else (*contact.one, -1, *contact.two)
        planes.setdefault(key, []).append(contact)
    return [Held(tuple(own), "part") for own in planes.values()]


def _contact(task: Task, site: Iterable[int], normal: Array, q: Array) -> HoldingContact:
    kind, i, j = (int(x) for x in site)
    one, two = task.movable.parts[0], task.static.parts[0]
    if kind == F1V2:
        return HoldingContact(tuple(one.loops[i]), (j,), face_corners(one, i))
    if kind != E1E2:
        return HoldingContact((i,), tuple(two.loops[j]), face_corners(two, j))
    first, second = (tuple(int(v) for v in part.edges[k, :2]) for part, k in ((one, i), (two, j)))
    ways = (
        task.transform(q)[:3, :3] @ (one.vertices[first[1]] - one.vertices[first[0]]),
        np.subtract(*two.vertices[[second[1], second[0]]]),
    )
    return HoldingContact(first, second, sign=math.copysign(1.0, float(np.cross(*ways) @ normal)))


# ---------------------------------------------------------------------------------------------------- the conditions


class ExactParts:
    """The two parts under a motion: vertices as exact rationals, poses as jets."""

    def __init__(self, task: Task) -> None:
        from flint import arb

        self.task = task
        self.one, self.two = task.movable.parts[0], task.static.parts[0]
        self.seeds = [[arb(float(x)) for x in body.seed] for body in (task.movable, task.static)]
        self.spokes = [_spokes(part, seed) for part, seed in zip((self.one, self.two), self.seeds, strict=True)]
        self.target = [arb(float(x)) for x in task.target]

    def posed(self, q: Sequence[Any]) -> Posed:
        """Return the parts at a motion, parameters as balls."""
        return Posed(self, Jet.variables(q))

    def conditions(self, held: Held, q: Sequence[Any]) -> list[Jet]:
        """Return what must not be negative, or vanish for "at", of the contacts that hold a motion."""
        posed = self.posed(q)
        lines = [posed.line(contact) for contact in held.contacts]
        if held.asks == "beyond":
            rho = crossing(lines)
            return [(rho[k] - self.target[k]) * float(self.task.signs[k]) for k in held.pinned]
        gaps = [c - a * self.target[0] - b * self.target[1] for a, b, c, _ in lines]
        if held.asks == "meet":
            return [-gap for gap in gaps]
        need = self.task.need if held.asks == "part" else 0.0
        if need == 0:
            return gaps
        return [gap - need * posed.constant(dot(n, n)).sqrt() for gap, (_, _, _, n) in zip(gaps, lines, strict=True)]


class Posed:
    """The two parts at a motion."""

    def __init__(self, scene: ExactParts, q: list[Jet]) -> None:
        self.scene, self.q = scene, q
        self.T = scene.task.motion.composed(q, *scene.seeds)

    def constant(self, x: Any) -> Jet:
        """Return a number as a jet: where nothing turns, some are none."""
        return x if isinstance(x, Jet) else self.q[0] * 0 + x

    def turned(self, vector: Sequence[Any]) -> list[Any]:
        """Return a vector of body 1, as drawn, after the motion."""
        return [dot(row[:3], vector) for row in self.T[:3]]

    def normal(self, contact: HoldingContact) -> list[Any]:
        """Return the normal of the plane of a contact, from body 1 to body 2, of any length."""
        (one, two), own = self.scene.spokes, contact.corners
        if not own:
            ways = (
                self.turned(minus(one[contact.one[1]], one[contact.one[0]])),
                minus(*(two[v] for v in contact.two[::-1])),
            )
            return [x * contact.sign for x in cross(*ways)]
        spokes = one if len(contact.one) > 1 else two
        normal = cross(minus(spokes[own[1]], spokes[own[0]]), minus(spokes[own[2]], spokes[own[0]]))
        return self.turned(normal) if spokes is one else [-x for x in normal]

    def line(self, contact: HoldingContact) -> tuple[Jet, Jet, Jet, list[Any]]:
        """Return (a, b, c) of the contact line, and its normal; all times the normal's length."""
        n, (one, two), (first, second) = self.normal(contact), self.scene.spokes, self.scene.seeds
        moved = [dot(row[:3], first) + row[3] for row in self.T[:3]]
        a, b = dot(n, self.turned(one[contact.one[0]])), -dot(n, two[contact.two[0]])
        return self.constant(a), self.constant(b), self.constant(dot(n, minus(second, moved))), n

    # ----------------------------------------------------------------------------------------------- what touches

    def supports(self, contacts: Sequence[HoldingContact]) -> bool:
        """Tell whether the plane of the first has all vertices strictly on their sides but those of all contacts."""
        n = [value(x) for x in self.normal(contacts[0])]
        back = [dot([value(row[k]) for row in self.T[:3]], n) for k in range(3)]
        first = contacts[0]
        sides = (
            (self.scene.spokes[0], back, first.one[0], {v for contact in contacts for v in contact.one}),
            (self.scene.spokes[1], [-x for x in n], first.two[0], {v for contact in contacts for v in contact.two}),
        )
        for spokes, way, vertex, own in sides:
            level = dot(way, spokes[vertex])
            if not all(dot(way, x) < level for v, x in enumerate(spokes) if v not in own):
                return False
        return True

    def share_a_point(self, contacts: Sequence[HoldingContact], rho: Sequence[Any]) -> bool:
        """Tell whether the elements of all contacts have a common point, strictly inside, at a scale pair."""
        one, two = contacts[0].one, contacts[0].two
        for own in contacts[1:]:
            one, two = tuple(v for v in one if v in own.one), tuple(v for v in two if v in own.two)
        normals = [[value(x) for x in self.normal(own)] for own in contacts]
        loops = (one, two)
        X, Y = ([self.placed(k, v, rho) for v in loop] for k, loop in enumerate(loops))
        shape = tuple(sorted(min(len(own), 3) for own in loops))
        if len(contacts) == 1 and shape == (1, 3):
            return _inside(X, Y[0], normals[0]) if len(X) > 1 else _inside(Y, X[0], [-x for x in normals[0]])
        if len(contacts) == 1 and shape == (2, 2):
            return _cross_inside(X, Y)
        if len(contacts) == 2 and shape == (1, 2):
            edge, point = (X, Y[0]) if len(X) > 1 else (Y, X[0])
            way = minus(edge[1], edge[0])
            along = dot(minus(point, edge[0]), way) / dot(way, way)
            return bool(0 < along < 1) and certain(cross(*normals))
        return len(contacts) == 3 and shape == (1, 1) and certain([dot(normals[0], cross(*normals[1:]))])

    def placed(self, body: int, vertex: int, rho: Sequence[Any]) -> list[Any]:
        """Return a vertex of a part, moved and scaled, as balls."""
        spoke = self.scene.spokes[body][vertex]
        if body == 1:
            return [s + rho[1] * x for s, x in zip(self.scene.seeds[1], spoke, strict=True)]
        moved = [dot(row[:3], self.scene.seeds[0]) + row[3] for row in self.T[:3]]
        return [value(m) + rho[0] * value(x) for m, x in zip(moved, self.turned(spoke), strict=True)]


def _inside(polygon: list[Any], point: Any, normal: Any) -> bool:
    """Tell whether a point of a polygon's plane is strictly inside; `normal`: sees it counter-clockwise."""
    ends = [*polygon[1:], polygon[0]]
    sides = zip(polygon, ends, strict=True)
    return all(dot(normal, cross(minus(end, start), minus(point, start))) > 0 for start, end in sides)


def _cross_inside(first: list[Any], second: list[Any]) -> bool:
    """Tell whether two edges of one plane cross strictly inside both."""
    e, g, w = minus(first[1], first[0]), minus(second[1], second[0]), minus(second[0], first[0])
    raw = cross(e, g)
    square = dot(raw, raw)
    return all(0 < dot(cross(w, own), raw) / square < 1 for own in (g, e))


def _spokes(part: ConvexPart, seed: list[Any]) -> list[list[Any]]:
    """Return the vertices of a part relative to the seed: exactly, in balls of this many digits."""
    from flint import arb

    return [[arb(x) - s for x, s in zip(vertex, seed, strict=True)] for vertex in part.vertices.tolist()]


def crossing(lines: Sequence[tuple[Jet, Jet, Jet, Any]]) -> list[Jet]:
    """Return the scale pair in which two contact lines meet."""
    (a, b, c, _), (d, e, f, _) = lines
    determinant = a * e - b * d
    return [(c * e - b * f) / determinant, (a * f - c * d) / determinant]
