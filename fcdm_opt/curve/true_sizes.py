"""The sizes at which two bodies touch on their true faces, where some of these are round.

The rows are those of bodies that are exact at points (`exact_points`) and elsewhere within the true ones. Where the
true faces, made anew at the sizes of the least and of the largest gap, are nearer than the rows say, bodies are made
exact there, until they are not: the exchange method, as for motions (`fcdm_opt.model.true_faces`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.touching_sizes import PairRows, TouchingSizes, check_sizes
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.exact_points import exact_at
from fcdm_opt.geometry.facet_errors import bounding_bodies, deviation_of, round_surfaces
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.patches import nearest_on_faces, onto, true_faces
from fcdm_opt.geometry.resizing import MovesOfFaces, each_resized
from fcdm_opt.geometry.size import Size
from fcdm_opt.tolerances import DEFAULT

ROUNDS = 12  # of making bodies exact where they are nearer than the rows say
SEVERAL = 8  # points at a time
APART = 0.05  # of the size: nearer points of a time are one
ROLES = "movable", "static"


def touching_true_faces(
    movable: Body, static: Body, sizes: Sequence[Size], *, transform: Any = None, **how: Any
) -> TouchingSizes:
    """Return the sizes at which two bodies touch at a pose, see `TouchingSizes.of`: of true faces where they are known.

    Bodies that are exact at points are taken for those that they stand for, and made exact anew.
    """
    facets = [own if own.exact is None else own.exact.facets for own in (movable, static)]
    at_all = TrueSizes.of(*facets, sizes)
    pose = np.eye(4) if transform is None else np.asarray(transform, float)
    for _ in range(ROUNDS if at_all is not None else 0):
        assert at_all is not None
        every = TouchingSizes.of(*at_all.bodies, sizes, transform=transform, without=at_all.apart, **how)
        found = at_all.counted(every)
        if not at_all.refined(pose, [own[::-1] for own in (found.least(), found.largest())]):
            return replace(found, standing_faces=frozenset(at_all.standing))
    return TouchingSizes.of(*facets, sizes, transform=transform, **how)


def widened(touching: TouchingSizes, sizes: Sequence[Size], **how: Any) -> TouchingSizes:
    """Return the same with other tolerances, see `TouchingSizes.of`."""
    if touching.as_drawn:
        return replace(touching, sizes=tuple(sizes))
    return touching_true_faces(*touching.bodies, sizes, transform=touching.transform, **how)


def made_at(movable: Body, static: Body, sizes: Sequence[Size], made: Any) -> dict[str, float]:
    """Return the deviations that are meant by name: all of them, or those at a named corner.

    Parameters
    ----------
    movable, static : Body
    sizes : sequence of Size
    made : mapping, or "worst", "loosest", "low", "high", "middle"
        Deviations by name, 0 where none is given; or the corner of the box of tolerances with the least gap or the
        largest one at rest (of what is not closed at all sizes, if there is any), all sizes at their least, largest, or
        in the middle.
    """
    names = [size.name for size in sizes]
    if isinstance(made, Mapping):
        return {name: float(made.get(name, 0.0)) for name in names}
    check_sizes(sizes)
    if made in ("low", "high", "middle"):
        place = {"low": 0.0, "high": 1.0, "middle": 0.5}[made]
        values = [(1.0 - place) * size.tolerance[0] + place * size.tolerance[1] for size in sizes]
    else:
        touching = touching_true_faces(movable, static, sizes, least=False, standing=False)
        values = (touching.least() if made == "worst" else touching.largest())[1].tolist()
    return dict(zip(names, values, strict=True))


class _Contact(NamedTuple):
    """Points of the true faces that come nearest, where both are at some sizes, and the faces that meet there."""

    gap: float
    points: Array
    normal: Array
    patches: tuple[tuple[int, ...], tuple[int, ...]]


class TrueSizes:
    """Two bodies with round faces that follow sizes, exact at a list of points that grows.

    Attributes
    ----------
    facets : (Body, Body)
        As drawn, movable and static.
    bodies : (Body, Body)
        The same, exact at the points.
    standing : set of (int, int)
        Patches, by number in `true_faces`, that meet whatever the sizes are, as a flange on its plate: not counted.
    """

    def __init__(self, movable: Body, static: Body, sizes: Sequence[Size]) -> None:
        self.facets, self.sizes = (movable, static), tuple(sizes)
        self.size = max(movable.size, static.size)
        self.points = [np.empty((0, 3)), np.empty((0, 3))]
        self.columns = [[k for k, own in enumerate(self.sizes) if own.body == role] for role in ROLES]
        of_each = zip(self.facets, self.columns, strict=True)
        self.moves = [MovesOfFaces.of(body, [self.sizes[k] for k in own]) for body, own in of_each]
        self.standing = set[tuple[int, int]]()
        self.bodies = self._exact()

    @classmethod
    def of(cls, movable: Body, static: Body, sizes: Sequence[Size]) -> TrueSizes | None:
        """Return it; None where no face is known to be round, for bodies that cannot be exact, and for other sizes."""
        bodies = movable, static
        if not any(map(round_surfaces, bodies)) or any(own.is_surface for own in bodies):
            return None
        if any(bounding_bodies(own) is None for own in bodies):
            return None
        try:
            return cls(movable, static, sizes)
        except InputError:
            return None

    def _exact(self) -> tuple[Body, Body]:
        one, two = (exact_at(body, own) for body, own in zip(self.facets, self.points, strict=True))
        assert one is not None
        assert two is not None
        return one, two

    @property
    def apart(self) -> list[tuple[int, int]]:
        """Part pairs in which a piece does not meet what it is there for."""
        counts, pieces = list[int](), list[list[int | None]]()
        for body, points in zip(self.bodies, self.points, strict=True):
            own = () if body.exact is None else body.exact.pieces
            first, at = len(body.parts) - len(own), [body.vertices[piece.first - 1] for piece in own]
            near = DEFAULT.tie * self.size
            numbers = [[k for k, x in enumerate(at) if norms(x - point) <= near] for point in points]
            pieces.append([first + found[0] if found else None for found in numbers])
            counts += [first, len(body.parts)]
        meeting = {*zip(*pieces, strict=True)}
        return [
            (i, j) for i, j in np.ndindex(counts[1], counts[3])
            if (i >= counts[0] or j >= counts[2])
            and (i if i >= counts[0] else None, j if j >= counts[2] else None) not in meeting
        ]  # fmt: skip

    def counted(self, found: TouchingSizes) -> TouchingSizes:
        """Return rows without those of facets that are within round faces, if there are others."""
        for pair in found.standing:
            for row in range(len(pair.values)):
                feature = found.feature(pair, row)
                sides = zip(self.facets, (feature.one, feature.two), strict=True)
                rows = [[body.face_rows[face] for face in body.faces_with(own.vertices)] for body, own in sides]
                both = zip(map(true_faces, self.facets), rows, strict=True)
                patches = [{faces.patch_of(row) for row in own} for faces, own in both]
                self.standing |= {(i, j) for i in patches[0] for j in patches[1]}
        kept = tuple(own for own in found.pairs if not self._within_round(own))
        return replace(found, pairs=kept or found.pairs)

    def _within_round(self, own: PairRows) -> bool:
        """Tell whether a row of a part pair is of a facet that is within a round face, or beside one."""
        for role, (body, drawn, place) in enumerate(zip(self.bodies, self.facets, own.parts, strict=True)):
            assert body.exact is not None
            if place >= len(body.parts) - len(body.exact.pieces):
                continue
            flat = {*range(len(drawn.faces))} - {row for _, rows in round_surfaces(drawn) for row in rows}
            part, facets = body.parts[place], body.facet_faces[place]
            bent = [bool(facet) and not flat.issuperset(facet) for facet in facets]
            for elements in own.elements:
                kind, k = elements[role]
                if kind == "F":
                    corners = part.loops[k]
                else:
                    corners = (k if k >= 0 else -k - 1,) if kind == "V" else part.edges[k, :2].tolist()
                around = [k] if kind == "F" else [f for f, loop in enumerate(part.loops) if {*corners} <= {*loop}]
                if any(bent[f] for f in around):
                    return True
        return False

    def refined(self, pose: Array, told: Sequence[tuple[Array, float]]) -> bool:
        """Make the bodies exact where they are nearer than is told of sizes, (k,); tell whether any were."""
        slack, new = DEFAULT.planarity * self.size, list[tuple[Array, Array]]()
        for place, gap in told:
            try:
                near = self._nearest(pose, place, gap)
            except InputError:  # a face has vanished
                continue
            for own in near:
                if own.gap >= gap - slack or len(new) >= SEVERAL:
                    break
                both = tuple(self._drawn(role, own, place) for role in (0, 1))
                if all(norms(both[0] - other[0]) > APART * self.size for other in new):
                    new.append(both)
        if not new:
            return False
        before = self.bodies
        self.points = [np.vstack([own, *each]) for own, each in zip(self.points, zip(*new, strict=True), strict=True)]
        self.bodies = self._exact()
        return any(len(a.parts) < len(b.parts) for a, b in zip(before, self.bodies, strict=True))

    def _nearest(self, pose: Array, place: Array, gap: float) -> list[_Contact]:
        """Return contacts of true faces at sizes, the nearest first, without those that stand."""
        values = dict(zip(self.sizes, place.tolist(), strict=True))
        made = each_resized(dict(zip(ROLES, self.facets, strict=True)), values)
        bodies = made["movable"], made["static"]
        band = abs(gap) + sum(sum(deviation_of(own)) for own in bodies) + DEFAULT.snap * self.size
        found = list[_Contact]()
        for own in nearest_on_faces(*bodies, np.ones(2), pose, band):
            if own.gap >= gap:
                break
            patches = tuple(tuple(true_faces(body).at(x)) for body, x in zip(bodies, own.points, strict=True))
            contact = _Contact(own.gap, own.points, own.normal, patches)
            pairs = {(i, j) for i in patches[0] for j in patches[1]}
            if pairs <= self.standing:
                continue
            if self._stands(bodies, contact, pose, place):
                self.standing |= pairs
            else:
                found.append(contact)
        return found

    def _stands(self, bodies: tuple[Body, Body], own: _Contact, pose: Array, place: Array) -> bool:
        """Tell whether a contact is closed at all sizes within their tolerances."""
        rates = np.zeros(len(self.sizes))
        for role, side in ((0, -1.0), (1, 1.0)):
            faces, point = true_faces(bodies[role]), own.points[role]
            rows = [faces.row_at(k, point) for k in own.patches[role]]
            normals = np.array([faces.patches[k].gaps(point[None])[1][0] for k in own.patches[role]])
            normal = own.normal @ (pose[:3, :3] if role == 0 else np.eye(3))
            rates[self.columns[role]] += side * normal @ self.moves[role].at(point, rows, normals)
        box = np.array([size.tolerance for size in self.sizes], float)
        start = own.gap - float(rates @ place)
        ends = np.sort(rates[:, None] * box, axis=1).sum(axis=0)
        return bool(np.abs(start + ends).max() <= DEFAULT.tie * self.size)

    def _drawn(self, role: int, own: _Contact, place: Array) -> Array:
        """Return the point as drawn that a contact's point at sizes is of."""
        body = self.facets[role]
        scale = np.eye(3) + np.einsum("k,kxy->xy", place[self.columns[role]], self.moves[role].turns)
        point = body.seed + np.linalg.solve(scale, own.points[role] - body.seed)
        return onto(point[None], [true_faces(body).patches[k] for k in own.patches[role]])[0]
