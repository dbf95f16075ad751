"""How far apart bodies are at least on their true faces: a bound, to any accuracy.

Each triangle stands for a piece of its surface, which leaves it by a known length. Pairs of triangles between which
the bodies may be nearest are cut, at points of the surfaces, until what they leave is small beside their distance:
branch and bound over pieces of faces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial, reduce
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import SMALLEST, Array, Flags, Ints, distinct_rows
from fcdm_opt.geometry.crossings import overlapping_between
from fcdm_opt.geometry.measures import cross, dots, norms, unit_normals
from fcdm_opt.geometry.patch_kernels import gaps_of_each, onto_each
from fcdm_opt.geometry.patches import Patch, TrueFaces
from fcdm_opt.geometry.polygons import distances
from fcdm_opt.geometry.tessellation import Swept, numbers_of
from fcdm_opt.tolerances import DEFAULT

SHARE = 0.2  # of the distance: by so much the bound may fall short of it
LEVELS = 60  # of cuts
MOST = 400_000  # pairs of pieces that are looked at: some seconds
SOME = 200  # pairs whose corners tell what the distance is at most
HALVINGS = 60  # of a side, to where it crosses a rim
LITTLE = 0.1  # of what is open
IDENTITY = np.eye(4)
CHUNK = 16_384  # pairs of pieces whose motions are looked at together
SURELY = 1.0 + 1e-6  # what is rounded: a hundred times what second derivatives by differences are off
MUCH = 0.01  # of its length: a side is cut as it leaves its surface by more
FINE = 10.0  # times what another piece leaves its surface: a smaller one is not cut without that
ASLANT = 0.1  # radians: faces that meet at less and not on their edge, as sizes moved them, cross nowhere near
TURN = 2.0 * np.pi - 1e-6
TRIM = 1.5  # times what the middle of a side leaves an edge, any point of it does at most: edges are conics


class FacePieces(NamedTuple):
    """Pieces of the faces of a body, each known by a triangle with its corners on the surface."""

    corners: Array  # (n, 3, 3)
    patches: Ints  # (n,)
    others: Ints  # (n, 3): the patch beyond the side from each corner to the next; -1 within the patch
    errors: Array  # no point of the piece is further from the triangle, (n,)
    axial: Array  # nor along its surface's axis, at a right angle to a plane, (n,)

    @classmethod
    def of(cls, faces: TrueFaces) -> FacePieces:
        """Return the pieces that the triangles of a body stand for."""
        others = np.full((len(faces.corners), 3), -1)
        _, same = distinct_rows(np.concatenate([faces.corners.reshape(-1, 3), faces.every_edge.reshape(-1, 3)]))
        corners, ends = np.split(same, [3 * len(faces.corners)])
        known, surfaces = dict[tuple[int, int, int], int](), numbers_of([own.surface for own in faces.patches])
        pairs = faces.every_pair_of_patches  # of which some were tangent, and sizes moved them apart: each ends there
        off, normals = gaps_of_each(faces.every_edge.reshape(-1, 3), surfaces, np.repeat(pairs, 2, axis=0))
        apart = (np.abs(off) > faces.slack).any(axis=1) & (norms(cross(*normals.swapaxes(0, 1))) < ASLANT)
        on = np.all(np.reshape(~apart, (-1, 2)), axis=1).tolist()
        for (a, b), pair, meet in zip(ends.reshape(-1, 2).tolist(), pairs.tolist(), on, strict=True):
            for one, two in (pair, pair[::-1]) if meet else ():
                known[min(a, b), max(a, b), one] = two
        for k, (own, patch) in enumerate(zip(corners.reshape(-1, 3).tolist(), faces.owners.tolist(), strict=True)):
            for side in range(3):
                a, b = own[side], own[(side + 1) % 3]
                others[k, side] = known.get((min(a, b), max(a, b), patch), -1)
        places = faces.corners
        if not all(on):
            places = onto_each(places.reshape(-1, 3), surfaces, np.repeat(faces.owners, 3)[:, None])
        whole = cls(places.reshape(-1, 3, 3), faces.owners, others, *np.zeros((2, len(others))))
        return whole.outside_holes(faces)[0].measured(faces.patches)

    def only(self, rows: Flags) -> FacePieces:
        """Return some of them."""
        own = self.corners[rows], self.patches[rows], self.others[rows], self.errors[rows], self.axial[rows]
        return FacePieces(*own)

    def measured(self, patches: Sequence[Patch]) -> FacePieces:
        """Return them with their errors."""
        errors = np.zeros(len(self.corners))
        for k in np.unique(self.patches).tolist():
            own = self.patches == k
            errors[own] = patches[k].surface.deviations(self.corners[own]).max(axis=1)
        middles, on = self.middles(patches), (self.corners + np.roll(self.corners, -1, axis=1)) / 2.0
        of_each = np.repeat(self.patches, 3)[:, None]
        on = onto_each(on.reshape(-1, 3), numbers_of([own.surface for own in patches]), of_each).reshape(-1, 3, 3)
        trimmed = TRIM * np.where(self.others >= 0, norms(middles - on), 0.0)
        axes, flat = np.array([own.surface.axis for own in patches]), np.array([own.surface.flat for own in patches])
        straight = np.array([own.surface.line == (1.0, 0.0) for own in patches])  # cylinders
        turned = norms(cross(axes[self.patches][:, None], axes[self.others]))
        axial = np.where(flat[self.others] & (turned <= DEFAULT.tie), 0.0, trimmed).max(axis=1)  # not up to circles
        errors = errors + trimmed.max(axis=1)
        axial = np.where(flat[self.patches], 0.0, np.where(straight[self.patches], axial, errors))
        return self._replace(errors=errors, axial=axial)

    def outside_holes(self, faces: TrueFaces) -> tuple[FacePieces, Ints]:
        """Return the pieces of plane faces that end at the rims of their holes, and which piece each is of."""
        # a triangle beside a chord may reach across the rim: it is cut where its sides cross it, and what is within
        # goes
        there = np.ones(len(self.corners), bool)
        for plane, hole in faces.holes:  # between a chord of a rim and the rim nothing is
            rows = np.flatnonzero(self.patches == plane)
            there[rows] &= ~faces.in_hole(plane, hole, self.corners[rows], DEFAULT.tie * faces.body.size)
        found, of, near = self.only(there), np.flatnonzero(there), faces.slack
        for plane, hole in faces.holes:
            rim, beyond = faces.patches[hole].surface, partial(faces.in_hole, plane, hole, near=near)
            for _ in range(LEVELS):
                own = found.patches == plane
                out = np.where(own[:, None], _out(found.corners, rim) - rim.radius, np.inf)
                on = np.abs(out) <= near
                k, sides = np.nonzero(on & np.roll(on, -1, axis=1) & (found.others < 0))
                chords = beyond(np.stack([found.corners[k, sides], found.corners[k, (sides + 1) % 3]], axis=1))
                found.others[k[chords], sides[chords]] = hole
                side, points = _crossing(found.corners, out, rim, near, beyond)
                kept, cut = side < 0, side >= 0
                within = np.flatnonzero(kept & (out <= near).all(axis=1))
                kept[within[beyond(found.corners[within])]] = False
                if kept.all():
                    break
                halves = found.only(cut).halved(side[cut], points[cut])
                of = np.concatenate([of[kept], np.tile(of[cut], 2)])
                found = FacePieces(*(np.concatenate(own) for own in zip(found.only(kept), halves, strict=True)))
        return found, of

    def halved(self, side: Ints, points: Array) -> FacePieces:
        """Return each piece in two, first all first halves, cut from a point of one of its sides, (n,) and (n, 3)."""
        k, within = np.arange(len(side)), np.full(len(side), -1)
        a, b, c = (self.corners[k, (side + turn) % 3] for turn in range(3))
        ab, bc, ca = (self.others[k, (side + turn) % 3] for turn in range(3))
        corners = np.concatenate([np.stack([a, points, c], axis=1), np.stack([points, b, c], axis=1)])
        others = np.concatenate([np.column_stack([ab, within, ca]), np.column_stack([ab, bc, within])])
        return FacePieces(corners, np.tile(self.patches, 2), others, *np.zeros((2, len(corners))))

    def middles(self, patches: Sequence[Patch]) -> Array:
        """Return a point of the surface, or of the edge, at the middle of each side, (n, 3, 3)."""
        found = ((self.corners + np.roll(self.corners, -1, axis=1)) / 2.0).reshape(-1, 3)
        pairs = np.column_stack([np.repeat(self.patches, 3), self.others.ravel()])
        surfaces = numbers_of([own.surface for own in patches])
        edge = pairs[:, 1] >= 0
        found[edge] = onto_each(found[edge], surfaces, pairs[edge])
        found[~edge] = onto_each(found[~edge], surfaces, pairs[~edge, :1])
        return found.reshape(-1, 3, 3)

    def cut(self, rows: Flags, faces: TrueFaces, small: float) -> tuple[FacePieces, Ints]:
        """Return pieces of which some are cut in two at the side that leaves its surface most, and what each is of.

        At the longest one where none leaves it by more than `small`, or of a face without straight lines by much of it.
        """
        patches = faces.patches
        own = self.only(rows)
        middles = own.middles(patches)
        bulge = norms(middles - (own.corners + np.roll(own.corners, -1, axis=1)) / 2.0)
        long = norms(own.corners - np.roll(own.corners, -1, axis=1))
        ruled = np.array([patch.surface.line is not None and not patch.surface.flat for patch in patches])[own.patches]
        much = np.maximum(small, np.where(ruled, 0.0, MUCH * long.max(axis=1)))
        side = np.where(bulge.max(axis=1) > much, bulge.argmax(axis=1), long.argmax(axis=1))
        halves, half = own.halved(side, middles[np.arange(len(side)), side]).outside_holes(faces)
        halves, kept = halves.measured(patches), ~rows
        of = np.concatenate([np.flatnonzero(kept), np.tile(np.flatnonzero(rows), 2)[half]])
        return FacePieces(*(np.concatenate([mine[kept], new]) for mine, new in zip(self, halves, strict=True))), of


class PoseDerivatives(NamedTuple):
    """How a body moves as a motion begins, in coordinates whose Euclidean norm is the amount."""

    first: Array  # derivatives of its pose by each, (k, 3, 4)
    second: Array  # (k, k, 3, 4): by each two; zero where nothing turns
    limits: Array = np.array([[-np.inf, np.inf]])  # of each, (k, 2) or of all, (1, 2)

    @property
    def spin(self) -> float:
        """Radians at most that it turns by, per unit of the amount."""
        return float(np.linalg.norm(self.first[:, :, :3])) / np.sqrt(2.0)

    def at(self, points: Array) -> Array:
        """Return what points, (m, 3), do per unit of each coordinate, (m, k, 3)."""
        return np.einsum("kxy,my->mkx", self.first[:, :, :3], points) + self.first[:, :, 3]

    def farthest(self, points: Array, errors: float, amount: float) -> float:
        """Return how far points, or others within `errors` of them, go at most per unit of the amount, up to one."""
        if not self.spin:
            return float(np.linalg.norm(self.first[:, :, 3], 2))
        speed = float(np.linalg.norm(self.at(points), axis=(1, 2)).max(initial=0.0)) + self.spin * errors
        return speed * (1.0 + 2.0 * self.spin * amount)

    def within_limits(self, slopes: Array, amount: float) -> tuple[Array, Array, Array]:
        """Return what coordinates of that amount at most do along slopes, (..., k): all they do is no more than a sum.

        The slopes without those of coordinates that are then at their limits; what these do, (...), and the amount of
        all others. To the length of the former times the latter this is to be added.
        """
        steep, at = np.abs(slopes), np.zeros(slopes.shape, bool)
        ends, rest = np.where(slopes > 0.0, self.limits[:, 1], -self.limits[:, 0]), np.full(slopes.shape[:-1], amount)
        for _ in range(len(self.first) if (ends < amount).any() else 0):
            others = np.maximum(np.linalg.norm(np.where(at, 0.0, steep), axis=-1), SMALLEST)
            at |= (rest / others)[..., None] * steep > ends
            rest = np.sqrt(np.maximum(amount**2 - (np.where(at, ends, 0.0) ** 2).sum(axis=-1), 0.0))
        return np.where(at, 0.0, slopes), (steep * np.where(at, ends, 0.0)).sum(axis=-1), rest

    def along(self, directions: Array, corners: Array, amount: float) -> tuple[Array, Array]:
        """Return how far a triangle's corners, (m, 3, 3), go at most along directions, (m, d, 3), to first order.

        And how much less far at most, per unit by which the amount is less.
        """
        moves, found = [self.at(corners[:, c]) for c in range(3)] if self.spin else [self.first[None, :, :, 3]], []
        for own in moves:
            slopes, at_limits, rest = self.within_limits(directions @ np.moveaxis(own, 1, 2), amount)
            speed = np.linalg.norm(slopes, axis=-1)
            found.append((at_limits + speed * rest, speed * amount / np.maximum(rest, SMALLEST)))
        return reduce(np.maximum, (far for far, _ in found)), reduce(np.maximum, (speed for _, speed in found))

    def least(self, apart: Array, u: Array, corners: Array, errors: Array, goal: float) -> Array:
        """Return amounts, up to `goal`, below which triangles, within errors, go no farther along u, (m, 3), than that.

        To second order no q with |q| <= a does more than (m a^2 + g (m - H)^-1 g) / 2, g and H along u, for any m above
        the eigenvalues of H (Lagrange); m is that of the goal. As each step turns about an axis, a third derivative is
        at most 3 (spin a)^2 times the speed.
        """
        one, turned = np.eye(len(self.first)), self.spin * goal
        square, constant = np.zeros(len(u)), np.zeros(len(u))
        for own in np.moveaxis(corners, 1, 0):
            g, most, _ = self.within_limits(np.einsum("mkx,mx->mk", self.at(own), u), goal)
            H = np.einsum("klxy,mx,my->mkl", self.second[..., :3], u, own)
            H = H + np.einsum("klx,mx->mkl", self.second[..., 3], u)
            size = np.maximum(np.linalg.norm(g, axis=1), SMALLEST)
            bend = np.einsum("mk,mkl,ml->m", g, H, g) / size**2
            m = np.maximum(size / goal + bend, 2.0 * np.linalg.norm(H, axis=(1, 2)))
            inverse = np.linalg.solve(m[:, None, None] * one - H, g[..., None])[..., 0]
            square, constant = np.maximum(square, m / 2.0), np.maximum(constant, (g * inverse).sum(axis=1) / 2.0 + most)
        speed = self.farthest(corners.reshape(-1, 3), 0.0, goal)
        free = apart / SURELY - constant - turned**2 * speed * goal / 2.0 - turned * errors
        return np.minimum(np.sqrt(np.maximum(free, 0.0) / square), goal)


class FacesApart:
    """Two bodies at scale 1 that are apart, cut further with each question; at most `most` pairs of pieces over all."""

    remaining: int  # pairs of pieces that may still be looked at; below 0 nothing is shown any more

    def __init__(self, faces: Sequence[TrueFaces], most: int = MOST, axis: Array | None = None) -> None:
        self._faces, self._axis = faces, axis  # a point and the direction, (2, 3), where body 1 turns about one alone
        self._pieces = [FacePieces.of(own) for own in faces]
        self._nearest = np.zeros((0, 2), np.int64)
        self.remaining = most
        self._axes = [np.array([patch.surface.axis for patch in own.patches]) for own in faces]
        self._concave = [np.array([patch.concave for patch in own.patches]) for own in faces]
        if axis is not None:
            self._concave = [own & its.of_revolution(*axis) for own, its in zip(self._concave, faces, strict=True)]

    def least(self, transform: Array, *, small: float = 0.0, most: float = np.inf) -> float:
        """Return what their distance is at least after a pose change of body 1, (4, 4), up to `most`; 0: none is shown.

        It falls short of the distance by a fifth of it at most, or by `small`. Where body 1 turns about an axis, it is
        that of pieces that may ever meet.
        """
        upper = most
        for level in range(LEVELS):
            one = self._pieces[0].corners @ transform[:3, :3].T + transform[:3, 3]
            two, errors = self._pieces[1].corners, [own.errors for own in self._pieces]
            if not level:
                if self._axis is not None and not len(self._nearest):
                    self._nearest = _near(one, two, errors, upper)
                    self._nearest = self._nearest[self._may_meet(self._nearest)]
                if self._axis is None or len(self._nearest):
                    upper = min(upper, _no_farther(one, two, errors, self._nearest))
                self._nearest = _near(one, two, errors, upper)
            if self._axis is not None:
                self._nearest = self._nearest[self._may_meet(self._nearest)]
            if not len(self._nearest):
                return upper
            i, j = self._nearest.T
            self.remaining -= len(i)
            if self.remaining < 0:
                break
            lows = _separations(one[i], two[j], self._missed(self._nearest, transform))
            some = np.argsort(lows, kind="stable")[:SOME]  # the nearest are among them
            upper, low = min(upper, _no_more(one, two, errors, self._nearest[some])), float(lows.min())
            near = (lows < (1.0 - SHARE) * upper) & (lows < upper - small)
            if not near.any():
                return max(min(low, upper), 0.0)
            pairs = self._nearest[near]
            self._nearest = self._nearest[near | (lows <= upper)]
            self._cut(pairs, small, np.zeros((2, len(pairs)), bool))
        return 0.0

    def _may_meet(self, pairs: Ints) -> Flags:
        """Tell which pairs of pieces may meet in turns about the axis, (m,)."""
        # none where one is in a bore about the axis, or higher along it: turns leave both as they are
        assert self._axis is not None
        still, ends = PoseDerivatives(np.zeros((1, 3, 4)), np.zeros((1, 1, 3, 4))), list[Array]()
        for k, own in enumerate(self._pieces):
            parallel = norms(cross(self._axes[k], self._axis[1])) <= DEFAULT.tie
            off = np.where(parallel[own.patches], own.axial, own.errors)
            heights = own.corners @ self._axis[1]
            ends.append(np.array([heights.min(axis=1) - off, heights.max(axis=1) + off])[:, pairs[:, k]])
        level = (ends[0][0] <= ends[1][1]) & (ends[1][0] <= ends[0][1])
        return np.asarray(level & ~self._stay_within(pairs, still, 0.0)[0].any(axis=0))

    def _missed(self, pairs: Ints, transform: Array = IDENTITY) -> Array:
        """Return what pieces leave their triangles by: (2, m, 5), at most, along an axis, and that axis."""
        found = [
            np.column_stack([own.errors, own.axial, axes[own.patches]])[pairs[:, k]]
            for k, (own, axes) in enumerate(zip(self._pieces, self._axes, strict=True))
        ]
        found[0][:, 2:] = found[0][:, 2:] @ transform[:3, :3].T
        return np.array(found)

    def least_amount(self, rates: PoseDerivatives, most: float, goal: float) -> float:
        """Return an amount below which no motion makes them touch, `goal` where it is no less.

        Two convex sets are apart by some plane whose normal u shows how far motions must go: the gap along u over what
        a unit of the amount moves the first one along it at most; in shifts the largest such number is what they need
        (duality). Of pieces some planes are tried.

        Parameters
        ----------
        rates : PoseDerivatives
            Of body 1, as the motion begins.
        most : float
            Of a motion with which they touch.
        goal : float
            Below `most`: to show more is not asked for.
        """
        far = rates.farthest(self._pieces[0].corners.reshape(-1, 3), self._pieces[0].errors.max(), most)
        one, two = (own.corners for own in self._pieces)
        self._nearest, low = _near(one, two, [own.errors for own in self._pieces], most * far), 0.0
        for _ in range(LEVELS):
            (i, j), errors = self._nearest.T, [own.errors for own in self._pieces]
            one, two = self._pieces[0].corners[i], self._pieces[1].corners[j]
            self.remaining -= len(i)
            kept, may = self._stay_within(self._nearest, rates, goal)
            missed = errors[0][i] + errors[1][j]
            lows = np.full(len(i), goal)
            for rows in np.split(np.flatnonzero(~kept.any(axis=0)), range(CHUNK, len(i), CHUNK)):
                lows[rows] = _separations(one[rows], two[rows], self._missed(self._nearest[rows]), rates, goal)
            near, least = lows < goal, int(lows.argmin()) if len(lows) else 0
            if not near.any():
                return goal
            low = float(lows[least])
            coarse = missed[least] + rates.spin * goal * float(norms(np.ptp(one[least], axis=0)))
            if self.remaining < 0 or (rates.spin and coarse < LITTLE * (goal - low) * far):  # no more by smaller ones
                break
            self._nearest = self._nearest[near]
            self._cut(self._nearest, (most - goal) * far, may[:, near])
            pacing.check()
        return max(low, 0.0)

    def _stay_within(self, pairs: Ints, rates: PoseDerivatives, amount: float) -> tuple[Flags, Flags]:
        """Tell which piece of each pair stays in a bore, cone or ball of the other's face, (2, m), in such motions."""
        # and of which a smaller piece may, as its corners are in it now
        found, may = np.zeros((2, 2, len(pairs)), bool)
        for k, own in enumerate(self._pieces):
            moves = rates if not k else rates._replace(first=-rates.first)  # as seen from body 1
            for patch in np.flatnonzero(self._concave[1 - k]).tolist():
                surface = self._faces[1 - k].patches[patch].surface
                room = self._nearest_to(1 - k, patch)[pairs[:, 1 - k]]
                rows = np.flatnonzero(room > -np.inf)
                its, most = pairs[rows, k], self._farthest(k, surface)[:, pairs[rows, k]]
                far, near = _farthest_after(own.corners[its], own.errors[its], most, surface, moves, amount)
                found[k, rows] |= far < room[rows]
                may[k, rows] |= near < room[rows]
        return found, may

    def _nearest_to(self, k: int, number: int) -> Array:
        """Return how far out pieces are at least in the space within a bore, cone or socket of that body, (n,)."""
        # in what its radius bounds there, see `Swept.line`: the radius for pieces of its own; of plane ones, of a cone
        # those at a right angle to the axis, what their sides are; minus infinity of others
        own, surface = self._pieces[k], self._faces[k].patches[number].surface
        found = np.where(own.patches == number, surface.radius, -np.inf)
        (steep, slope), planes = surface.line or (1.0, 0.0), [patch.surface for patch in self._faces[k].patches]
        plane = np.array([its.flat for its in planes])
        level = [not slope or bool(norms(cross(its.axis, surface.axis)) <= DEFAULT.tie) for its in planes]
        rows = np.flatnonzero((plane & level)[own.patches])
        across = _across(own.corners[rows], surface)
        sides = np.roll(across, -1, axis=1) - across
        share = -(across * sides).sum(axis=2) / np.maximum((sides**2).sum(axis=2), SMALLEST)
        near, others = norms(across + np.clip(share, 0.0, 1.0)[..., None] * sides), own.others[rows]
        near = steep * (near - np.where((others < 0) | plane[others], 0.0, own.errors[rows, None]))
        near = near - slope * ((own.corners[rows] - surface.origin) @ surface.axis)
        near = np.where(others == number, surface.radius, near)
        up = cross(sides[:, 0], sides[:, 1]) if surface.line is None else np.broadcast_to(surface.axis, (len(rows), 3))
        turns = (cross(across, sides) * up[:, None]).sum(axis=2)  # of one sign: about the axis, or the centre's foot
        around = (turns > 0.0).all(axis=1) | (turns < 0.0).all(axis=1)
        found[rows] = np.where(around, -np.inf, near.min(axis=1))
        whole = np.isin(own.patches, _encircling(self._faces[k], number))
        found[whole] = np.maximum(found[whole], surface.radius)
        return found

    def _farthest(self, k: int, surface: Swept) -> Array:
        """Return how far out pieces are at most in the space within a bore, cone or socket, (2, n)."""
        # from its axis or centre, and in what its radius bounds there: as their face, and the faces whose edges they go
        # up to, are of a radius about an axis or a point; of one axis with it, as corners are; else infinite
        own, bore = self._pieces[k], surface.line is not None
        (steep, slope), of_face, alike = surface.line or (1.0, 0.0), list[float](), list[bool]()
        z, out = (own.corners - surface.origin) @ surface.axis, norms(_across(own.corners, surface))
        levels, circles = np.full(len(out), np.inf), out
        for number, patch in enumerate(self._faces[k].patches):
            its, off = patch.surface, patch.surface.origin - surface.origin
            off = off - (off @ surface.axis) * surface.axis if bore else off
            rows, turned = own.patches == number, float(norms(cross(its.axis, surface.axis)))
            alike.append(bore and its.line is not None and not its.flat and turned <= DEFAULT.tie)
            if alike[-1] and its.line:
                lean = abs(steep * its.line[1] / its.line[0] * np.sign(its.axis @ surface.axis) - slope)
                about = norms(_across(own.corners, its)) + float(norms(off))
                levels[rows] = (steep * about[rows] - slope * z[rows]).max(axis=1) + lean * own.errors[rows]
                circles = np.where(own.others == number, np.maximum(circles, about), circles)
            if its.line not in (None, (1.0, 0.0)) or its.ring or (its.line and not bore):
                of_face.append(0.0 if its.flat else np.inf)
                continue
            if its.line is None and not its.ring:  # a ball goes out as far as its centre and its radius
                centre = float(steep * norms(off) - slope * ((its.origin - surface.origin) @ surface.axis))
                levels[rows] = centre + its.radius
            along = np.abs((own.corners[rows] - its.origin) @ its.axis).max(initial=0.0)
            along += own.errors[rows].max(initial=0.0)
            of_face.append(float(norms(off)) + turned * along * (its.line is not None) + its.radius)
        radii, ends = np.array([*of_face, 0.0]), np.array([*alike, True])[own.others].all(axis=1)  # of no face the last
        plane = np.array([patch.surface.flat for patch in self._faces[k].patches])[own.patches]
        rows = np.flatnonzero(plane & ends & (np.ptp(z, axis=1) <= DEFAULT.tie))
        levels[rows] = (steep * circles[rows] - slope * z[rows]).max(axis=1)  # they go out as their corners do
        rim = np.maximum(out.max(axis=1), radii[own.others].max(axis=1))
        return np.stack([np.where(plane, rim, radii[own.patches]), levels])

    def _cut(self, pairs: Ints, small: float, rather: Flags) -> None:
        """Cut the piece of each of some pairs that leaves its surface more, or is larger where both do by little."""
        # or the one that is `rather` to be cut, (2, m), once it is `FINE` with the other one
        i, j = pairs.T
        errors, sizes = zip(*((own.errors, norms(np.ptp(own.corners, axis=1))) for own in self._pieces), strict=True)
        wide = errors[0][i] + errors[1][j] <= small  # what is left is how large they are
        first = np.where(wide, sizes[0][i] >= sizes[1][j], errors[0][i] >= errors[1][j])
        first = np.where(rather[0] == rather[1], first, rather[0])
        both = (rather[0] != rather[1]) & np.where(
            first, sizes[0][i] <= FINE * errors[1][j], sizes[1][j] <= FINE * errors[0][i]
        )
        for k, chosen in enumerate((i[first | both], j[~first | both])):
            rows = np.zeros(len(self._pieces[k].corners), bool)
            rows[chosen] = True
            if rows.any():
                self._pieces[k], of = self._pieces[k].cut(rows, self._faces[k], small)
                self._nearest = _followed(self._nearest, k, of)


@lru_cache(maxsize=64)
def _encircling(faces: TrueFaces, number: int) -> list[int]:
    """Return which plane faces of a body lie all about a bore, cone or socket: it opens in them, a whole circle."""
    # triangles of these may reach across what a chord leaves of the circle, where nothing is
    surface, found = faces.patches[number].surface, list[int]()
    for other in (plane for plane, hole in faces.rims if hole == number):
        ends = _across(faces.rims[other, number].ends, surface)
        turns = np.arctan2(
            cross(ends[:, 0], ends[:, 1]) @ faces.patches[other].surface.axis, dots(*np.moveaxis(ends, 1, 0))
        )
        least = _out(faces.corners[faces.owners == other].reshape(-1, 3), surface).min()
        if np.abs(turns).sum() > TURN and least >= surface.radius - faces.slack:
            found.append(other)
    return found


def _boxes(pieces: Array, errors: Array) -> tuple[Array, Array]:
    return pieces.min(axis=1) - errors[:, None], pieces.max(axis=1) + errors[:, None]


def _no_farther(one: Array, two: Array, errors: Sequence[Array], last: Ints) -> float:
    """Return what the distance is at most, by the nearest pairs before; by boxes where there are none."""
    if len(last):
        return _no_more(one, two, errors, last[:: max(1, len(last) // SOME)])
    (low, high), (under, over) = _boxes(one, errors[0]), _boxes(two, errors[1])
    return float(norms(np.maximum(over - low[:, None], high[:, None] - under)).min())


def _across(corners: Array, surface: Swept) -> Array:
    """Return where corners are from the axis of a bore, across it, or from the centre of a socket."""
    off = corners - surface.origin
    return off if surface.line is None else off - (off @ surface.axis)[..., None] * surface.axis


def _out(corners: Array, surface: Swept) -> Array:
    """Return how far out corners are in the space within a bore, cone or socket, in what its radius bounds there."""
    steep, slope = surface.line or (1.0, 0.0)
    return np.asarray(steep * norms(_across(corners, surface)) - slope * ((corners - surface.origin) @ surface.axis))


def _crossing(
    corners: Array, out: Array, rim: Swept, near: float, beyond: Callable[[Array], Flags]
) -> tuple[Ints, Array]:
    """Return a side of each piece that enters a hole, -1 where none does, and where it crosses the rim, (n, 3)."""
    # the hole is convex. `out`: how far outside it the corners are, (n, 3), infinite for pieces of other faces.
    # `beyond`: tells of points, (m, 1, 3), which are between a chord of the rim and the rim: a face that is not all
    # about the hole, as of a D-shaped bore, goes on in the rest of its circle
    ends = np.roll(corners, -1, axis=1)
    there, far = np.roll(out, -1, axis=1), np.maximum(out, np.roll(out, -1, axis=1))
    may = np.isfinite(out) & (far > near) & (out + there - norms(ends - corners) < -2.0 * near)
    rows, sides = np.nonzero(may)
    a, b = corners[rows, sides], ends[rows, sides]

    def at(share: Array) -> Array:
        return np.asarray(_out(a + share[:, None] * (b - a), rim) - rim.radius)

    low, high = np.zeros(len(rows)), np.ones(len(rows))
    for _ in range(HALVINGS):  # the least is between
        one, two = low + (high - low) / 3.0, high - (high - low) / 3.0
        falls = at(one) > at(two)
        low, high = np.where(falls, one, low), np.where(falls, high, two)
    inside, outside = (low + high) / 2.0, np.where(out[rows, sides] > there[rows, sides], 0.0, 1.0)
    enters = at(inside) < -near
    enters[enters] = beyond((a + inside[:, None] * (b - a))[enters, None])
    for _ in range(HALVINGS):
        middle = (inside + outside) / 2.0
        within = at(middle) < 0.0
        inside, outside = np.where(within, middle, inside), np.where(within, outside, middle)
    found, points = np.full(len(corners), -1), np.zeros((len(corners), 3))
    rows, sides, crossed = rows[enters], sides[enters], (a + inside[:, None] * (b - a))[enters]
    found[rows], points[rows] = sides, crossed
    return found, points


def _farthest_after(
    corners: Array, errors: Array, farthest: Array, surface: Swept, rates: PoseDerivatives, amount: float
) -> tuple[Array, Array]:
    """Return how far out pieces, and a corner of each, are within a surface after any such motion at most, (m,)."""
    # where it is less than the radius they stay in it. The largest distance from the axis, or centre, is that of a
    # corner, as it is convex: |a + s| with |s| <= l along D y is no more than sqrt(|a|^2 + 2 |D' a| l + |D|^2 l^2). See
    # `FacesApart._farthest` for what else bounds |a|, and how far out they are before: along no normal does a piece go
    # farther than |D| l, nor than the normal's parts across the axis and along it
    moves = rates.at(corners.reshape(-1, 3)).reshape(*corners.shape[:2], -1, 3) if rates.spin else rates.first[:, :, 3]
    off, across = corners - surface.origin, np.eye(3)
    steep, slope = surface.line or (1.0, 0.0)
    if surface.line is not None:
        across = across - np.outer(surface.axis, surface.axis)
    aside, far, speed = off @ across, *(np.linalg.norm(own, 2, axis=(-2, -1)) for own in (moves @ across, moves))
    bend = rates.spin * amount * (errors[:, None] + rates.farthest(corners.reshape(-1, 3), 0.0, amount) * amount)
    room = errors[:, None] + bend
    a = np.minimum(norms(aside) + room, farthest[0][:, None] + bend)
    slopes, at_limits, rest = rates.within_limits((moves * aside[..., None, :]).sum(axis=-1), amount)
    b = np.minimum(np.linalg.norm(slopes, axis=-1) * rest + at_limits + amount * room * far, amount * a * far)
    most = np.sqrt(a * a + 2.0 * b + (amount * far) ** 2)
    lift = np.linalg.norm(moves @ surface.axis, axis=-1)
    along = off @ surface.axis - np.sign(slope) * (room + amount * lift)
    push = bend + amount * np.minimum(speed, steep * far + abs(slope) * lift)
    out = steep * most - slope * along
    return np.minimum(out.max(axis=1), farthest[1] + push.max(axis=1)), out.min(axis=1)


def _near(one: Array, two: Array, errors: Sequence[Array], most: float) -> Ints:
    """Return pairs of pieces that may be no farther apart, by their boxes and planes, (m, 2)."""
    (low, high), (under, over) = _boxes(one, errors[0]), _boxes(two, errors[1])
    pairs = overlapping_between(low - most, high + most, under, over)
    i, j = pairs.T
    pairs = pairs[norms(np.maximum(np.maximum(under[j] - high[i], low[i] - over[j]), 0.0)) <= most]
    for own, other, k in ((one, two, 0), (two, one, 1)):
        normals = unit_normals(own)
        levels = (normals * own[:, 0]).sum(axis=1)
        i, j = pairs[:, k], pairs[:, 1 - k]
        heights = np.einsum("mcx,mx->mc", other[j], normals[i]) - levels[i, None]
        apart = np.maximum(heights.min(axis=1), -heights.max(axis=1)) - errors[k][i] - errors[1 - k][j]
        pairs = pairs[apart <= most]
    return pairs


def _no_more(one: Array, two: Array, errors: Sequence[Array], pairs: Ints) -> float:
    """Return what the distance is at most, by some pairs: of corners, which are on their face, from the other piece."""
    found = np.inf
    for points, triangles, errors_there, k in ((one, two, errors[1], 0), (two, one, errors[0], 1)):
        there = pairs[:, 1 - k]
        off = distances(points[pairs[:, k]], triangles[there]).min(axis=1)
        found = min(found, float((off + errors_there[there]).min()))
    return found


def _followed(pairs: Ints, k: int, of: Ints) -> Ints:
    """Return the pairs of pieces that were cut, from those before."""
    order = np.argsort(of, kind="stable")
    first, last = np.searchsorted(of[order], pairs[:, k]), np.searchsorted(of[order], pairs[:, k], side="right")
    count = last - first
    rows = np.repeat(np.arange(len(pairs)), count)
    place = np.arange(len(rows)) - np.repeat(np.cumsum(count) - count, count)
    new = pairs[rows].copy()
    new[:, k] = order[first[rows] + place]
    return new


def _separations(
    one: Array, two: Array, missed: Array, rates: PoseDerivatives | None = None, goal: float = 0.0
) -> Array:
    """Return what pieces are apart at least, (m,), by their triangles, (m, 3, 3), and what both leave these."""
    # the largest separation along some directions; with `rates`, of such pieces the amount below which they do not
    # meet, known up to `goal`, see `FacesApart.least_amount`. `missed`: see `FacesApart._missed`
    sides = [own - np.roll(own, -1, axis=1) for own in (one, two)]
    normals, between = [unit_normals(own) for own in (one, two)], two.mean(axis=1) - one.mean(axis=1)
    directions = [normals[0][:, None], normals[1][:, None], between[:, None]]
    directions += [cross(sides[0][:, [k] * 3], sides[1]) for k in range(3)]
    directions += [cross(own, n[:, None]) for own, n in zip(sides, normals, strict=True)]
    if rates is not None:  # of points these are the best: what no motion does at all, else what the shortest one is
        moves = rates.at(one.mean(axis=1)) if rates.spin else rates.first[None, :, :, 3]
        inverse = np.linalg.pinv(moves)  # (m, 3, k)
        least = np.einsum("mxk,mx->mk", inverse, between)
        allowed = np.clip(least, *rates.limits.T)
        directions += [(between - np.einsum("mkx,mk->mx", moves, allowed))[:, None]]
        directions += [np.einsum("mxk,mk->mx", inverse, least)[:, None]]
    every = np.concatenate(directions, axis=1)
    length = norms(every)
    every = every / np.maximum(length, SMALLEST)[..., None]
    heights = ([dots(every, own[:, None, k]) for k in range(3)] for own in (one, two))
    (low, high), (under, over) = ((reduce(np.minimum, own), reduce(np.maximum, own)) for own in heights)
    every = every * np.where(under - high >= low - over, 1.0, -1.0)[..., None]
    apart = np.maximum(under - high, low - over)
    for own in missed:
        square, less = own[:, :1] ** 2, own[:, :1] ** 2 - own[:, 1:2] ** 2
        apart = apart - np.sqrt(np.maximum(square - less * dots(every, own[:, None, 2:]) ** 2, 0.0))
    if rates is None:
        return np.asarray(np.where(length > SMALLEST, apart, -np.inf).max(axis=1))
    far, speed = rates.along(every, one, goal)
    bend = rates.spin * goal * rates.farthest(one.reshape(-1, 3), 0.0, goal) if rates.spin else 0.0
    free, speed = apart - far - bend * goal, speed + bend  # what is not of first order is small beside this
    found = goal + np.divide(free, speed, out=np.where(free > 0.0, np.inf, -np.inf), where=speed > SMALLEST)
    found = np.where(length > SMALLEST, found, -np.inf)
    best = np.arange(len(one)), found.argmax(axis=1)
    if not rates.spin:
        return np.asarray(found[best])
    return rates.least(apart[best], every[best], one, missed[..., 0].sum(axis=0), goal)
