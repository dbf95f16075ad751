"""How far triangles leave the planes, cylinders, cones, spheres and tori of a CAD file that they stand for.

Each of these surfaces is swept about an axis by a line, or by a circle in its plane: its distance follows from how far
a point is from the axis, and along it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from fcdm_opt.geometry.arrays import Array, Ints, distinct_rows
from fcdm_opt.geometry.measures import cross, norms, unit_normals, units, volume_and_centroid
from fcdm_opt.geometry.patch_kernels import TANGENT, gaps_of_each, onto_each
from fcdm_opt.geometry.polygons import components, offsets_from
from fcdm_opt.tolerances import DEFAULT

TESSELLATED = "triangles leave its curved faces"  # so begins the note of a body
CUTS = 8  # of a side of a triangle on a torus, at whose corners it is looked at
SPLITS = 1, 2, 4, 8  # of the sides of triangles, from which the true volume is extrapolated
ALONG = 0.7  # cosine: triangles of a surface are turned against it by less
NEWTON_STEPS = 4  # to a corner on true faces, from one that is off by a tolerance
SMOOTH = 0.002  # radians, about: faces that turn into each other by less say nothing of where along them a corner is
_TINY = float(np.finfo(float).tiny)


class Swept(NamedTuple):
    """A surface of revolution, as the zeros of its signed distance; length units of the file's reader."""

    origin: Array  # a point of the axis and its unit direction, (3,)
    axis: Array
    # swept by the line `line[0]` u - `line[1]` h = `radius`, where u is the distance from the axis and h that along it:
    # a cylinder (1, 0), a cone (cos, sin), a plane (0, -1). None: by a circle
    line: tuple[float, float] | None
    ring: float  # by the circle of this radius about (`ring`, 0): a torus, or a sphere with `ring` 0
    radius: float

    @property
    def flat(self) -> bool:
        """Whether it is a plane."""
        return self.line == (0.0, -1.0)

    @classmethod
    def plane(cls, point: Array, normal: Array) -> Self:
        """Return a plane through a point with a unit normal."""
        return cls(point, normal, (0.0, -1.0), 0.0, 0.0)

    @classmethod
    def of(cls, primitive: Any) -> Self:
        """Return a primitive of cascadio as such a surface."""
        given = vars(primitive)
        angle = given.get("semi_angle")
        line = (0.0, -1.0) if "normal" in given else (1.0, 0.0) if angle is None else (math.cos(angle), math.sin(angle))
        return cls(
            np.array(next(given[key] for key in ("origin", "apex", "center") if key in given)),
            np.array(given.get("normal", given.get("axis", (0.0, 0.0, 1.0)))),
            None if "center" in given else line,
            given.get("major_radius", 0.0),
            given.get("minor_radius", given.get("radius", 0.0)),
        )

    def misses(self, points: Array) -> tuple[Array, Array]:
        """Return how far points (n, 3) are off the surface, away from axis or tube positive, and unit normals there."""
        along, across, far = self.about(points)
        outward = across / np.maximum(far, _TINY)[:, None]
        if self.line is not None:
            c, s = self.line
            return c * far - s * along - self.radius, c * outward - s * self.axis
        tube = far - self.ring
        long = np.hypot(tube, along)
        radial = tube[:, None] * outward + along[:, None] * self.axis
        return long - self.radius, radial / np.maximum(long, _TINY)[:, None]

    def bends(self, points: Array) -> Array:
        """Return the second derivatives of that distance at points, (n, 3, 3)."""
        along, across, far = self.about(points)
        outward = across / np.maximum(far, _TINY)[:, None]
        around = cross(np.broadcast_to(self.axis, outward.shape), outward)
        rate, flat = 1.0 / np.maximum(far, _TINY), np.zeros((len(points), 3, 3))
        if self.line is not None:
            rate = self.line[0] * rate
        else:
            tube = far - self.ring
            long = np.maximum(np.hypot(tube, along), _TINY)
            turned = cross(self.misses(points)[1], around)
            flat = (turned[:, :, None] * turned[:, None, :]) / long[:, None, None]
            rate = rate * tube / long
        return np.asarray(flat + rate[:, None, None] * around[:, :, None] * around[:, None, :])

    def ruling(self, point: Array) -> Array:
        """Return the unit direction of the straight line on it through a point; 0 where there is none, or any is."""
        if self.line is None or self.line[0] == 0.0:
            return np.zeros(3)
        return self.axis if self.line[1] == 0.0 else units(point - self.origin + self.radius / self.line[1] * self.axis)

    def offset(self, length: float, shift: Array, wider: float = 0.0) -> Self:
        """Return it moved away from axis or tube by a length, shifted, and its ring wider."""
        return self._replace(origin=self.origin + shift, ring=self.ring + wider, radius=self.radius + length)

    def about(self, points: Array) -> tuple[Array, Array, Array]:
        """Return how far points are along the axis, where across it, and how far across."""
        local = points - self.origin
        along = (local * self.axis).sum(axis=-1)
        across = local - along[:, None] * self.axis
        return along, across, norms(across)

    def placed(self, transform: Array, scale: float) -> Self:
        """Return it moved by a rigid 4x4 transform, then scaled about the origin."""
        turn, shift = transform[:3, :3], transform[:3, 3]
        origin = scale * (turn @ self.origin + shift)
        return self._replace(origin=origin, axis=turn @ self.axis, ring=scale * self.ring, radius=scale * self.radius)

    def deviations(self, corners: Array) -> Array:
        """Return how far triangles (m, 3, 3), wound outwards, stick out of a solid of that face, and fall short of it.

        The most of each of them, (m, 2).
        """
        # exact for cylinders, cones and spheres: the distance is convex along a triangle, so that it is largest at a
        # corner, and smallest on a side (a straight line of the surface that is parallel to the triangle crosses its
        # sides), of a sphere at the point nearest to the centre. Tori are looked at in a grid of points: half the bend
        # of the distance along a side is four times what it reaches there, and between the points, by CUTS^2 less, a
        # third of it may hide
        one, two, three = corners.transpose(1, 0, 2)
        points, hidden = corners, 0.0
        if self.line is not None:
            steps = np.roll(corners, -1, axis=1) - corners
            _, start, _ = self.about(corners.reshape(-1, 3))
            rise, radial, long = self.about(steps.reshape(-1, 3) + self.origin)
            c, s = self.line
            square = np.maximum(long**2, _TINY)
            nearest = -(start * radial).sum(axis=1) / square
            aside, slope = norms(start + nearest[:, None] * radial), s * rise
            steep = np.sqrt(np.maximum(((c * long) ** 2 - slope**2) * square, _TINY))
            share = np.clip(nearest + slope * aside / steep, 0.0, 1.0).reshape(-1, 3, 1)
            points = np.concatenate([corners, corners + share * steps], axis=1)
        elif not self.ring:
            points = np.concatenate([corners, self.origin - offsets_from(self.origin[None], corners)], axis=1)
        else:
            shares = np.array([(i, j, CUTS - i - j) for i in range(CUTS + 1) for j in range(CUTS + 1 - i)]) / CUTS
            points, hidden = shares @ corners, 4.0 / (3.0 * CUTS**2)
        off = self.misses(points.reshape(-1, 3))[0].reshape(len(corners), points.shape[1])
        slack = hidden * np.abs(off).max(axis=1, initial=0.0)
        low, high = off.min(axis=1, initial=0.0) - slack, off.max(axis=1, initial=0.0) + slack
        middle = self.misses(corners.mean(axis=1))[1]
        turned = (cross(two - one, three - one) * middle).sum(axis=1) < 0.0  # the material is on the other side
        return np.stack([np.where(turned, -low, high), np.where(turned, high, -low)], axis=1)

    def offsets(self, corners: Array) -> Array:
        """Return by how much planes of such triangles are to be moved, inward and outward, to clear a face, (m, 2)."""
        # a facet of a cone is steeper than the cone, so that its plane moved by what it leaves the cone would cut off
        # the rim beside it: by the angle between both times what lies between a corner and its foot, no more than twice
        # what is left where the rim is cut off at more than 27 degrees
        off = self.deviations(corners)
        if self.line is None:
            return off
        one, two, three = corners.transpose(1, 0, 2)
        normals = cross(two - one, three - one)
        tilt = np.abs(normals @ self.axis) / np.maximum(norms(normals), _TINY) - abs(self.line[1])
        return np.asarray(off * (1.0 + 2.0 * np.abs(tilt))[:, None])


class Surfaces(NamedTuple):
    """The surfaces of a STEP file that its triangles stand for."""

    known: tuple[Swept, ...]  # planes among them
    other: float  # how far triangles of none of these may be off theirs, length
    within: float  # how far off a surface the corners on it may be: in single precision they are placed


RoundFaces = tuple[tuple[Swept, tuple[int, ...]], ...]  # round surfaces, and the rows of the faces that stand for each


def errors_of_faces(corners: Array, owners: Ints, count: int, surfaces: Surfaces) -> tuple[Array, RoundFaces]:
    """Return how far each face sticks out of the surface that it stands for, and falls short of it, (count, 2).

    And the round surfaces, with their faces.

    - `corners` (t, 3, 3): triangles of the faces, wound outwards.
    - `owners` (t,): the face that each is of.
    - `count`: how many faces there are.
    - `surfaces`: a triangle is of a plane that it lies in, else of each that its corners are on and that looks its way.
    """
    normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(norms(normals), _TINY)[:, None]
    errors, known = np.zeros((len(corners), 2)), np.zeros(len(corners), bool)
    nearest, chosen, rounds = np.full(count, np.inf), np.full(count, -1), list[Swept]()
    alike, several = dict[bytes, list[tuple[Array, int]]](), set[int]()
    slack = DEFAULT.touch * float(np.ptp(corners, axis=(0, 1)).max())
    for surface in sorted(surfaces.known, key=lambda own: not own.flat):
        misses = surface.misses(corners.reshape(-1, 3))[0].reshape(-1, 3)
        (on,) = np.nonzero((np.abs(misses).max(axis=1) <= surfaces.within) & ~(known & (errors == 0.0).all(axis=1)))
        off, turn = surface.misses(corners[on].mean(axis=1))
        turn = (turn * normals[on]).sum(axis=1)
        on, off, turn = (own[np.abs(turn) > ALONG] for own in (on, off, turn))
        known[on] = True
        if surface.flat:
            continue
        known_ones = alike.setdefault(on.tobytes(), [])
        same = {k for other, k in known_ones if np.abs(misses[on] - other).max(initial=0.0) <= slack}
        several |= same
        if same:
            continue  # another piece of one round face, as of a bore that is drawn in two halves
        known_ones.append((misses[on], len(rounds)))
        errors[on] = np.maximum(errors[on], np.maximum(surface.offsets(corners[on]), _TINY))
        off = np.abs(off) + (1.0 - np.abs(turn))  # of two that its corners are on
        better = off < nearest[owners[on]]
        faces = owners[on][better]
        nearest[faces], chosen[faces] = off[better], 2 * len(rounds) + (turn[better] < 0.0)  # a bore is no cylinder
        rounds.append(surface)
    errors[~known] = surfaces.other
    found = np.zeros((count, 2))
    np.maximum.at(found, owners, errors)
    sides = ((each, 2 * k + side) for k, each in enumerate(rounds) for side in range(2))
    piece = _pieces(corners, owners, chosen) if several else chosen
    own = list[tuple[Swept, tuple[int, ...]]]()
    for each, k in sides:
        faces = np.flatnonzero(chosen == k)
        of = piece[faces] if k // 2 in several else np.zeros(len(faces), np.int64)
        own += [(each, tuple(faces[of == number].tolist())) for number in np.unique(of)]
    return np.where(found > surfaces.within, found, 0.0), tuple(own)


def _pieces(corners: Array, owners: Ints, chosen: Ints) -> Ints:
    """Return the number of the piece of a surface that each face is of: journals on both sides of a collar are two."""
    same, face = distinct_rows(corners.reshape(-1, 3))[1], np.repeat(owners, 3)
    places, at = distinct_rows(np.column_stack([same, chosen[face]]))
    return components(np.column_stack([face[places][at], face]), len(chosen))


def surfaces_of_triangles(corners: Array, rows: Ints, rounds: RoundFaces) -> tuple[list[Swept], Ints]:
    """Return surfaces, round ones first, then planes of other faces, and which of them each triangle is of, (t,).

    `corners` (t, 3, 3): triangles of the faces, wound outwards. `rows` (t,): the face that each is of.
    """
    surfaces, owners = [surface for surface, _ in rounds], np.full(len(rows), -1)
    for k, (_, faces) in enumerate(rounds):
        owners[np.isin(rows, faces)] = k
    flat = np.flatnonzero(owners < 0)
    _, first, which = np.unique(rows[flat], return_index=True, return_inverse=True)
    owners[flat] = len(surfaces) + which.reshape(-1)
    surfaces += map(Swept.plane, corners[flat[first], 0], unit_normals(corners[flat[first]]))
    return surfaces, owners


def true_centroid(corners: Array, rows: Ints, surfaces: Surfaces) -> Array | None:
    """Return the centroid of the solid that triangles of a closed surface stand for, (3,); None where none is round.

    `corners` (t, 3, 3), `rows` (t,): the face that each is of. See `errors_of_faces`.
    """

    def moments(small: Array) -> Array:
        volume, middle, _ = volume_and_centroid(small.reshape(-1, 3, 3))
        return volume * np.append(middle, 1.0)

    rounds = errors_of_faces(corners, rows, int(rows.max()) + 1, surfaces)[1]
    if not rounds:
        return None
    moment, drawn = _extrapolated(corners, rows, rounds, moments), volume_and_centroid(corners)[1]
    found = moment[:3] / moment[3]
    return np.where(np.abs(found - drawn) > DEFAULT.nominal * np.abs(corners - drawn).max(), found, drawn)


def true_areas(corners: Array, rows: Ints, rounds: RoundFaces) -> Array:
    """Return the area of what each triangle of a closed surface stands for, (t,); see `surfaces_of_triangles`."""
    normals = unit_normals(corners)[:, None]

    def areas(small: Array) -> Array:
        doubled = cross(small[:, :, 1] - small[:, :, 0], small[:, :, 2] - small[:, :, 0])
        return np.copysign(norms(doubled), (doubled * normals).sum(axis=2)).sum(axis=1) / 2.0

    return _extrapolated(corners, rows, rounds, areas)


def _extrapolated(corners: Array, rows: Ints, rounds: RoundFaces, measure: Callable[[Array], Array]) -> Array:
    """Return what a measure of smaller triangles of each triangle, (t, m, 3, 3), comes to on the true faces.

    Triangles are split, with new corners on the surface, or at the sides of two on both; the measures of ever smaller
    ones are extrapolated in the square of their size (Romberg, Vereinfachte numerische Integration, 1955).
    """
    surfaces, owners = surfaces_of_triangles(corners, rows, rounds)
    _, same = distinct_rows(corners.reshape(-1, 3))
    ends = np.sort(np.stack([same.reshape(-1, 3), np.roll(same.reshape(-1, 3), -1, axis=1)], axis=2), axis=2)
    _, side = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    side = side.reshape(-1, 3)
    least, most = np.full(side.max() + 1, len(surfaces)), np.full(side.max() + 1, -1)
    for end, own in ((np.minimum, least), (np.maximum, most)):
        end.at(own, side, owners[:, None])
    on_sides = np.stack([least, most], axis=1)[side]  # the surfaces on both sides of each
    table, flat = list[Array](), np.array([own.flat for own in surfaces])
    axes = np.array([[own.origin for own in surfaces], [own.axis for own in surfaces]])
    turned = np.array([not own.flat and (own.line is not None or own.ring > 0.0) for own in surfaces])  # no balls
    for n in SPLITS:
        shares = np.array([(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)])
        points = np.einsum("pc,tcx->tpx", shares / n, corners)
        inside = np.flatnonzero((shares > 0).all(axis=1))
        where = [(inside, np.stack([owners, owners], axis=1))]
        for k in range(3):  # the side from corner k to the next
            on = np.flatnonzero((shares[:, (k + 2) % 3] == 0) & (shares[:, k] > 0) & (shares[:, (k + 1) % 3] > 0))
            where.append((on, on_sides[:, k]))
        for places, pairs in where:
            one, two = pairs.T
            found = np.flatnonzero(~(flat[one] & flat[two]) if len(places) else places)
            if len(found):
                about, moved = np.where(turned[one], one, two)[found], points[found[:, None], places]
                near = _about_axes(moved, corners[found], shares[places] / n, axes[:, about])
                near = np.where(turned[about, None, None], near, moved).reshape(-1, 3)
                there = onto_each(near, numbers_of(surfaces), np.repeat(pairs[found], len(places), axis=0))
                points[found[:, None], places] = there.reshape(moved.shape)
        number = {tuple(own): k for k, own in enumerate(shares.tolist())}
        small = [
            [number[i + a, j + b, n - i - j - a - b] for a, b in steps]
            for steps in (((0, 0), (1, 0), (0, 1)), ((1, 0), (1, 1), (0, 1)))
            for i, j in np.ndindex(n, n)
            if i + j + max(a + b for a, b in steps) <= n
        ]
        table.append(measure(points[:, small]))
        weight = 1.0
        for k in range(len(table) - 2, -1, -1):
            weight *= 4.0
            table[k] = table[k + 1] + (table[k + 1] - table[k]) / (weight - 1.0)
    return table[0]


def _about_axes(points: Array, corners: Array, shares: Array, axes: Array) -> Array:
    """Return points of triangles, (m, p, 3), as far from axes as lies between their corners, (m, 3, 3).

    So points between two on a rim are on it, also where two faces are tangent there. `shares` (p, 3) of the corners;
    `axes` (2, m, 3): a point of each, and its direction.
    """
    origin, axis = axes[:, :, None]
    own, ends = (x - origin - ((x - origin) * axis).sum(axis=2, keepdims=True) * axis for x in (points, corners))
    far = norms(own)
    grown = norms(ends) @ shares.T / np.maximum(far, _TINY)
    return points + np.where(far > 0.0, grown - 1.0, 0.0)[:, :, None] * own


def on_rings(points: Array, surfaces: Sequence[tuple[Swept, Ints]], slack: float) -> Array:
    """Return points (n, 3) with equal angles, radii and heights about an axis that they share, where digits tell alike.

    So facets between two such rings are plane, where the digits of a file bent them.

    `points` (n, 3). `slack`: length by which rounding moved each at most.
    """
    axes = list[tuple[Swept, list[Ints]]]()
    for surface, rows in surfaces:
        if surface.flat:
            continue
        for first, own in axes:
            across = first.about(surface.origin[None])[2]
            if across[0] <= slack and norms(cross(first.axis, surface.axis)) <= DEFAULT.normal:
                own.append(rows)
                break
        else:
            axes.append((surface, [rows]))
    every = [(surface, np.unique(np.concatenate(own))) for surface, own in axes]
    often = np.bincount(np.concatenate([rows for _, rows in every]), minlength=len(points)) if every else ()
    place = points.copy()
    for surface, rows in every:
        along, across, far = surface.about(points[rows])
        free = (np.asarray(often)[rows] == 1) & (far > slack / DEFAULT.sharp)
        rows, along, across, far = rows[free], along[free], across[free], far[free]
        if not len(rows):
            continue
        one = units(across[0])
        two = cross(surface.axis, one)
        angles = np.arctan2(across @ two, across @ one)
        angles = np.where(angles < -2.0 * slack / far.min(), angles + 2.0 * math.pi, angles)
        along, far, angles = _alike(along, slack), _alike(far, slack), _alike(angles, slack / float(far.min()))
        turned = np.cos(angles)[:, None] * one + np.sin(angles)[:, None] * two
        place[rows] = surface.origin + along[:, None] * surface.axis + far[:, None] * turned
    return place


def _alike(values: Array, slack: float) -> Array:
    """Return values with the mean of all that are as near to one another as a slack on both sides explains."""
    order = np.argsort(values, kind="stable")
    group = np.cumsum(np.diff(values[order], prepend=-np.inf) > 2.0 * slack) - 1
    count = np.bincount(group)
    middle = np.bincount(group, values[order]) / count
    ends = np.cumsum(count)
    narrow = values[order][ends - 1] - values[order][ends - count] <= 2.0 * slack
    found = values.copy()
    found[order] = np.where(narrow[group], middle[group], values[order])
    return found


def onto(points: Array, surfaces: Sequence[Swept]) -> Array:
    """Return points (n, 3) moved onto one or two surfaces, the nearest way."""
    for _ in range(8 if surfaces and len(points) else 0):
        off, normals = zip(*(each.misses(points) for each in surfaces), strict=True)
        rows, gap = np.stack(normals, axis=1), np.stack(off, axis=1)
        step = rows.transpose(0, 2, 1) @ inverse_of(rows @ rows.transpose(0, 2, 1)) @ gap[:, :, None]
        points = points - step[..., 0]
        if np.abs(gap).max(initial=0.0) < 1e-14 * np.abs(points).max(initial=0.0):
            break
    return points


def numbers_of(surfaces: Sequence[Swept]) -> Array:
    """Return surfaces as compiled code takes them, away from axis or tube positive, (n, 11): see `patch_kernels`."""
    each = [[*own.origin, *own.axis, *(own.line or (np.nan, np.nan)), own.ring, own.radius, 1.0] for own in surfaces]
    return np.array(each, float).reshape(-1, 11)


def padded(numbers: Sequence[Sequence[int]]) -> Ints:
    """Return lists of numbers as the rows of an array, those that are shorter filled up with -1."""
    most = max(map(len, numbers), default=0)
    return np.array([[*own, *[-1] * (most - len(own))] for own in numbers], np.int64).reshape(len(numbers), most)


def onto_crossings(
    drawn: Array,
    places: Array,
    meeting: Sequence[Sequence[int]],
    sides: tuple[Sequence[Swept], Sequence[Swept]],
    middles: Sequence[Array],
    near: float,
) -> tuple[Array, Array]:
    """Return points (n, 3) where surfaces cross that met there before they moved, and how far off that they are, (n,).

    By Newton's method; as far off the surfaces as before, by the digits of a file. Those that were tangent cross aside
    of that: there the curved one ends, and the straighter one goes on.

    - `drawn` (n, 3): the points before; `places` (n, 3): about where they are now.
    - `meeting`: the surfaces of each, by number in both `sides`: before they moved, and now.
    - `middles`: a point of the face of each surface, (3,). `near`: length by which surfaces count as one.
    """
    (before, surfaces), found, which = sides, places.copy(), padded(meeting)
    kept, numbers = gaps_of_each(drawn, numbers_of(before), which)[0], numbers_of(surfaces)
    gaps, normals = gaps_of_each(places, numbers, which)
    cosines = normals @ normals.transpose(0, 2, 1)
    signs = np.sign(cosines)
    apart = (gaps - kept)[:, :, None] - signs * (gaps - kept)[:, None]
    smooth = (norms(cross(normals[:, :, None], normals[:, None])) < DEFAULT.sharp) & (signs != 0.0)
    parted = np.argwhere(smooth & (np.abs(apart) > near) & np.tri(which.shape[1], k=-1, dtype=bool))
    for row, i, j in parted[np.unique(parted[:, 0], return_index=True)[1]].tolist():
        one, two = (surfaces[which[row, k]].bends(places[None, row])[0] for k in (i, j))
        rates, axes = np.linalg.eigh(one - signs[row, i, j] * two)
        rate, along = max(zip(rates.tolist(), axes.T, strict=True), key=lambda own: abs(own[0]))
        if rate * apart[row, i, j] < 0.0:
            curved = i if abs(along @ one @ along) > abs(along @ two @ along) else j
            side = math.copysign(1.0, (middles[which[row, curved]] - places[row]) @ along)
            found[row] += side * math.sqrt(-2.0 * apart[row, i, j] / rate) * along
    for _ in range(NEWTON_STEPS):
        gaps, normals = gaps_of_each(found, numbers, which)
        found -= (np.linalg.pinv(normals, rcond=SMOOTH) @ (gaps - kept)[..., None])[..., 0]
    return found, np.abs(gaps_of_each(found, numbers, which)[0] - kept).max(axis=1, initial=0.0)


def inverse_of(products: Array) -> Array:
    """Return the inverses of the products of a few normals; of surfaces that touch along an edge as if of one."""
    if products.shape[-1] == 1:
        return 1.0 / products
    if products.shape[-1] > 2:
        return np.asarray(np.linalg.pinv(products, rcond=TANGENT, hermitian=True))
    (a, b), (_, c) = np.moveaxis(products, 0, -1)
    free, whole = a * c - b * b, (a + c)[:, None, None]
    adjoint = np.moveaxis(np.array([[c, -b], [-b, a]]), -1, 0)
    smooth = free[:, None, None] <= TANGENT * whole**2
    return np.asarray(np.where(smooth, products / whole**2, adjoint / np.where(smooth, 1.0, free[:, None, None])))
