"""The judge of what is said of many sizes at once: parts made anew at sizes of the judge's choice, asked by coal.

A stack-up, a yield, one pose for all sizes say what holds at every size. At some of these sizes bodies are made of
their own, moved, and measured by the collision library: what is told there must be so. `GapClaims` and `MotionClaims`
are what the results hand over: their numbers, and nothing that could be asked for the truth of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.true_sizes import ROLES, SizedFaces
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.collision import scaled_pair
from fcdm_opt.geometry.facet_errors import deviation_of, round_surfaces
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.geometry.polygons import clipped, uncovered
from fcdm_opt.geometry.resizing import each_resized
from fcdm_opt.geometry.size import Size
from fcdm_opt.judge.certificate import _at_most, solids_gap, true_gap
from fcdm_opt.judge.true_faces import gap_of_true_faces
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Check
from fcdm_opt.tolerances import DEFAULT

SAMPLED, CORNERS = 12, 12  # sizes within a box, and corners of it, at which parts are made anew at most
FEW = 6  # of both, where true faces are looked at
LATE = np.inf, np.inf, np.inf  # in place of the gaps of sizes that there is no time for
STEP, INWARDS = 4.0, 0.02  # times the slack off a surface, and share of the distance to the middle of a face
SURE = 1e-9  # chance that a share which is right is refused for the draws it was compared with


@dataclass(frozen=True, eq=False, kw_only=True)
class ShareClaim:
    """A share that is told, and draws of what it is a share of, independent of it."""

    share: float
    interval: tuple[float, float]
    passed: Flags  # of draws of the same distribution: which of them are counted, by what is told of each


@dataclass(frozen=True, eq=False, kw_only=True)
class GapClaims:
    """What is told of the gap of two bodies at a pose, over a box of sizes or a list of them."""

    bodies: tuple[Body, Body]  # as drawn, of own sizes at the scales made
    # what numbers of a place are, also of other bodies; without any they are the scales of both bodies
    sizes: tuple[Size, ...]
    transform: Array  # (4, 4): of the movable body
    moved: Callable[[Array], Array] | None = None  # optional: its pose, (4, 4), at a place, where that is not the same
    # least, largest: the ends of the range of the gap, and where they are, (k,); without them only keep-outs count
    least: tuple[float, Array] | None = None
    largest: tuple[float, Array] | None = None
    box: Array  # (k, 2)
    listed: Array | None = None  # (n, k), optional: all sizes that are spoken of, where it is not the whole box
    # the gaps, (n,), that are told there. Without one only the range is told
    told: Callable[[Array], Array] | None = None
    within: float = 0.0  # by how much these may be off, as is told
    second_order: float = 0.0  # by how much all gaps may be off, as is told
    permanent: Sequence[tuple[int, int]] = ()  # part pairs that are not counted
    # with them the gap is that of the true faces, without these patches of both, by number in `true_faces`
    permanent_faces: frozenset[tuple[int, int]] | None = None
    # bodies that the movable one keeps clear of at all sizes, by how much at least; the static one among them as made
    keep_out: Sequence[tuple[Body, float]] = ()
    share: ShareClaim | None = None
    others: Sequence[Check] = ()  # of what else is told
    # optional: the contact that the gap is of, its part pair, and its direction from body 1 to body 2; else all counted
    contact: tuple[Feature, tuple[int, int], Array] | None = None
    faces: tuple[int, int] | None = None  # plane faces of both bodies, by number from 0, whose gap alone it is
    name: str = ""  # before those of the checks
    further: Sequence[GapClaims] = ()  # of further contacts

    def checks(self) -> tuple[Check, ...]:
        """Return what the collision library says of it; raises `TimeOverError` before all ends of ranges are judged."""
        every, found = (self, *self.further), list[Check]()
        for k, own in enumerate(every):
            with pacing.sharing(1.0 / (len(every) - k)):
                found += own._checks()
        return tuple(found)

    def _checks(self) -> tuple[Check, ...]:
        """Return the same without what is `further`."""
        slack = DEFAULT.touch * max(body.size for body in self.bodies) + self.second_order
        if self.permanent_faces is not None:  # surfaces are taken from corners with the digits of files
            slack += max(body.rounding for body in self.bodies)
        others = _spread(self.box) if self.listed is None else self.listed
        most = SAMPLED + CORNERS if self.permanent_faces is None else FEW
        others = others[np.linspace(0, len(others) - 1, min(len(others), most)).astype(np.int64)]
        ends = np.array([own[1] for own in (self.least, self.largest) if own is not None], float)
        found = [] if self.least is None else self._of_gap(ends, others, slack)
        for body, clearance in self.keep_out:
            short = max(clearance - self._apart(place, body) for place in (*ends, *others))
            kept = "clear of" if body is self.bodies[1] else "keep-out"
            found.append(_at_most(f"{kept} '{body.name}'", short, slack, "how much too near, at the same sizes"))
        found += [] if self.share is None else [_share(self.share)]
        named = [check._replace(name=f"{self.name}: {check.name}") for check in found] if self.name else found
        return (*named, *self.others)

    def _of_gap(self, ends: Array, others: Array, slack: float) -> list[Check]:
        """Return the checks of the range of the gap, and of gaps told at sampled sizes."""
        assert self.least is not None
        assert self.largest is not None
        low, high = self.box.T
        outside = float(np.maximum(low - ends, ends - high).max(initial=0.0))
        places, gaps = np.vstack([ends, others]), list[tuple[float, float, float] | None]()
        for k, place in enumerate(places):
            pacing.at("judging the gap of parts made at other sizes", k, len(places))
            gaps.append(self._gaps(place) if k < len(ends) else pacing.in_time(self._gaps, place, late=LATE))
        gaps = gaps[: gaps.index(LATE)] if LATE in gaps else gaps
        made = [(gap, place) for gap, place in zip(gaps[2:], others, strict=False) if gap is not None]
        lost = f"at {len(made)} sizes; {len(gaps) - 2 - len(made)} of which no part can be made"
        least, largest = self.least[0], self.largest[0]
        apart = [(d, d if np.isnan(s) else min(d, s)) for (d, s, _), _ in made]
        checks = [
            _at_most("sizes of the range", outside, DEFAULT.nominal, "how far those named are beyond the tolerances"),
            *(
                _at_most(name, np.nan if gap is None else _off(own, *gap), slack, "at the sizes named")
                for name, own, gap in zip(("least gap", "largest gap"), (least, largest), gaps[:2], strict=True)
            ),
            _at_most("range", max((max(least - d, s - largest) for d, s in apart), default=0.0), slack, lost),
        ]
        if self.told is not None and made:
            claimed = self.told(np.array([place for _, place in made])).tolist()
            off = max(_off(own, *gap) for own, (gap, _) in zip(claimed, made, strict=True))
            checks.append(_at_most("gap at sampled sizes", off, slack + self.within, lost))
        if self.permanent:
            wide = max(gap[2] for gap in gaps if gap is not None)
            checks.append(_at_most("contacts not counted", wide, slack, "how far open, or overlapping, at most"))
        return checks

    def _apart(self, place: Array, body: Body) -> float:
        """Return the signed distance of the movable part, made, from a body that does not change."""
        try:
            (movable, static), scales = made_at(self.bodies, self.sizes, place)
        except InputError:  # a face has vanished
            return np.inf
        if body is self.bodies[1]:
            body = static
        else:
            scales = np.column_stack([scales[:, 0], np.ones(len(scales))])
        return float(scaled_pair(movable, body).signed_distances(scales, self._pose(place)[None])[0])

    def _pose(self, place: Array) -> Array:
        return self.transform if self.moved is None else self.moved(place)

    def _gaps(self, place: Array) -> tuple[float, float, float] | None:
        """Return the gap of the parts made: the distance, or minus depth, by coal, and the separation of vertices."""
        # of the pairs that are counted; the third is how far the others are from touching
        if self.permanent_faces is not None and self.faces is None:
            gap = self._of_true_faces(place)
            return gap, gap, 0.0
        try:
            bodies, scales = made_at(self.bodies, self.sizes, place)
        except InputError:  # a face has vanished
            return None
        if self.faces is not None:
            gap = self._between(bodies, scales[0], self._pose(place), self.faces)
            return gap, gap, 0.0
        pair, here = scaled_pair(*bodies), self._pose(place)[None]
        if self.contact is not None and any(body.is_surface for body in bodies):
            gap = self._along(bodies, scales[0], here[0])
            return gap, gap, 0.0
        if self.contact is not None:
            pair = pair.between(*self.contact[1])
        if not self.permanent:
            distance, separation = pair.distances_and_separations(scales, here)
            return float(distance[0]), float(separation[0]), 0.0
        each = {
            (i, j): [float(own[0]) for own in pair.between(i, j).distances_and_separations(scales, here)]
            for i, j in product(*(range(len(body.parts)) for body in bodies))
        }
        off = max(abs(each[own][0]) for own in self.permanent)
        solids = _Solids(bodies, scales[0], here[0], [*self.permanent])
        distance = separation = np.inf
        for i, j in sorted(each.keys() - {*self.permanent}, key=each.__getitem__):
            apart, along = each[i, j]
            if (apart < distance or not along >= separation) and solids.has_gap((i, j), apart):
                distance, separation = min(distance, apart), np.fmin(separation, along)
        return distance, float(separation), off

    @staticmethod
    def _between(bodies: tuple[Body, Body], scales: Array, pose: Array, rows: tuple[int, int]) -> float:
        """Return how far two plane faces of bodies made are apart along their normal; nan where they do not look so."""
        placed = bodies[0].scaled(scales[0]).moved(pose), bodies[1].scaled(scales[1])
        planes = zip(placed, rows, strict=True)
        (n, x), (other, y) = ((body.face_planes[0][row], body.face_planes[1][row]) for body, row in planes)
        return float((y - x) @ n) if n @ other <= DEFAULT.nominal - 1.0 else np.nan

    def _of_true_faces(self, place: Array) -> float:
        assert self.least is not None
        assert self.largest is not None
        band = max(abs(self.least[0]), abs(self.largest[0])) + 2.0 * sum(max(deviation_of(own)) for own in self.bodies)
        faces, scales = [true_faces(own) for own in self.bodies], np.asarray(place, float)
        if self.sizes:
            both = [self._rates[role].at(place) for role in (0, 1)]
            faces, scales = [own for own, _ in both], np.array([scale for _, scale in both])
        return gap_of_true_faces(faces, scales, self._pose(place), 2.0 * band, self.permanent_faces or ())

    @cached_property
    def _rates(self) -> list[SizedFaces]:
        return [SizedFaces.of(body, role, self.sizes) for body, role in zip(self.bodies, ROLES, strict=True)]

    def _along(self, bodies: tuple[Body, Body], scales: Array, pose: Array) -> float:
        """Return how far the elements of a contact are apart along their normal, of bodies kept as surfaces."""
        # whose parts are thin: how deep two of them overlap says nothing of the solids
        assert self.contact is not None
        feature, _, direction = self.contact
        points = []
        for body, scale, element in zip(bodies, scales.tolist(), (feature.one, feature.two), strict=True):
            own = body.vertices[np.array(element.vertices) - 1]
            points.append(body.seed + scale * (own - body.seed))
        points[0] = points[0] @ pose[:3, :3].T + pose[:3, 3]
        sides = [own - own.mean(axis=0) for own in points]
        flat = max(sides, key=lambda own: (len(own) > 2, -len(own)))
        if len(flat) > 2 or all(len(own) == 2 for own in points):
            n = np.linalg.svd(flat if len(flat) > 2 else np.vstack(sides))[2][2]
            direction = n * np.sign(n @ direction)
        return float((points[1] @ direction).min() - (points[0] @ direction).max())


class _Solids:
    """Two bodies made and moved, some of whose parts touch and are not counted: where solids have a gap besides."""

    def __init__(self, bodies: Sequence[Body], scales: Array, pose: Array, closed: Sequence[tuple[int, int]]) -> None:
        self._pair, self._scales, self._pose = scaled_pair(*bodies), scales, pose
        self._made = bodies[0].scaled(scales[0]).moved(pose), bodies[1].scaled(scales[1])
        self._slack = DEFAULT.touch * max(body.size for body in bodies)
        normals = {own: self._direction(own) for own in closed}
        self._planes = [(n, (self._made[0].parts[i].vertices @ n).max()) for (i, _), n in normals.items()]

    def _direction(self, parts: tuple[int, int]) -> Array:
        return self._pair.between(*parts).direction(self._scales, self._pose)

    def has_gap(self, parts: tuple[int, int], distance: float) -> bool:
        """Tell whether the gap of two parts is one of the solids, of surfaces that face each other there.

        Not where either solid goes on in another part that it is cut into, and not in the plane of a closed contact, in
        which the solids slide on each other.
        """
        one, two = (body.parts[k] for body, k in zip(self._made, parts, strict=True))
        for n, level in self._planes:
            ends = (one.vertices @ n).max(), (two.vertices @ n).min()
            if np.abs(np.subtract(ends, level)).max() <= self._slack:
                return False
        if distance <= 2.0 * STEP * self._slack:
            return True
        step = distance * self._direction(parts)
        return all(self._ends(*own) for own in ((self._made[0], one, two, step), (self._made[1], two, one, -step)))

    def _ends(self, solid: Body, own: ConvexPart, other: ConvexPart, step: Array) -> bool:
        """Tell whether a solid ends somewhere where a part of it is a step from another solid's."""
        direction, slack = step / np.linalg.norm(step), self._slack
        heights = own.vertices @ direction
        shapes = *map(list, own.loops), *own.edges[:, :2].tolist(), *([k] for k in range(len(heights)))
        face = own.vertices[next(rows for rows in shapes if heights[rows].min() >= heights.max() - slack)]
        patch = face
        for n, level in zip(other.normals, other.levels, strict=True):
            patch = clipped(patch, level + slack - (patch + step) @ n)
        if not len(patch):
            return True
        patch = patch + INWARDS * (face.mean(axis=0) - patch) + STEP * slack * direction  # whose rim others may share
        return bool(uncovered(patch, ((part.normals, part.levels) for part in solid.parts), slack))


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionClaims:
    """What is told of the motions at sizes, and of the share of them within a budget."""

    scene: Scene
    over: Sequence[str]  # what numbers of a place are: names of sizes, or of scales; all others are as made
    places: Array  # (n, k)
    parameters: Array  # parameters, amounts: (n, p) and (n,): the motions told there; nan where there is none
    amounts: Array
    errors: Array  # (n, 2): of the amount, and of the displacement of a vertex of a part that moves
    share: ShareClaim | None = field(default=None, repr=False)
    on_true_faces: bool = False  # whether motions are those of the faces that facets stand for

    def checks(self) -> tuple[Check, ...]:
        """Return what the collision library says of the parts made and moved so, every two that are to meet."""
        worst, count, weights = np.zeros(2), 0, np.array([own.weight for own in self.scene.coordinates])
        weighted = all(problem.amount == "weighted" for problem in self.scene.relations.values())
        rows = zip(self.places, self.parameters, self.amounts.tolist(), self.errors.tolist(), strict=True)
        for place, q, amount, (error, displaced) in rows:
            if not np.isfinite([*q, amount, error, displaced]).all():
                continue  # no motion, or nothing is told of its error
            off = self._missed(place, q, displaced)
            norm = float(np.linalg.norm(weights * q)) if weighted else amount
            worst, count = np.maximum(worst, [off, abs(norm - amount) - error]), count + 1
        slack, note = 10.0 * self.scene.contact_slack, f"beyond the error told, at {count} sizes with a motion"
        return (
            _at_most("gap after the motion", worst[0], slack, note),
            _at_most("amount of the motion", worst[1], slack + DEFAULT.nominal * self.scene.size, note),
            *([] if self.share is None else [_share(self.share)]),
        )

    def _missed(self, place: Array, q: Array, displaced: float) -> float:
        """Return how far gaps after a motion are from what is asked, by more than vertices may be displaced."""
        scene, most = self.scene, 0.0
        values = {**(scene.made or {}), **dict(zip(self.over, place.tolist(), strict=True))}
        scales = scene.scales_at(values)
        made = each_resized(scene.drawn, {size: values.get(size.name, 0.0) for size in scene.sizes})
        for pair, problem in scene.relations.items():
            one, two = (made[part] for part in pair)
            rho, T = np.array([scales[part] for part in pair]), problem.motion.transform(q, one.seed, two.seed)
            gap = self._gap(problem, (one, two), rho, T, displaced)
            state = problem.goal if problem.goal in ("touch", "clear") else problem.pair
            off = abs(gap) if state == "touch" else max(problem.clearance - gap, 0.0) if state == "clear" else 0.0
            most = max(most, off - displaced * sum(part in scene.moving for part in pair))
        return most

    def _gap(self, problem: Problem, bodies: tuple[Body, Body], rho: Array, T: Array, displaced: float) -> float:
        """Return the gap of two bodies made; infinite of true faces that are further apart than any answer has them."""
        if not (self.on_true_faces and any(map(round_surfaces, bodies))):
            return solids_gap(*bodies, rho, T, problem.contact_slack)
        return true_gap(bodies, rho, T, problem.clearance + problem.contact_slack + 2.0 * displaced)


def made_at(bodies: tuple[Body, Body], sizes: Sequence[Size], place: Array) -> tuple[tuple[Body, Body], Array]:
    """Return both bodies as made at sizes, and the scales, (1, 2), that are left to ask for."""
    if not sizes:
        return bodies, np.asarray(place, float)[None] if len(place) else np.ones((1, 2))
    values = dict(zip(sizes, np.asarray(place, float).tolist(), strict=True))
    made = each_resized({"movable": bodies[0], "static": bodies[1]}, values)
    return (made["movable"], made["static"]), np.ones((1, 2))


def _spread(box: Array) -> Array:
    """Return corners of a box, places on its sides, and places within it, (n, k)."""
    rng, (low, high) = np.random.default_rng(11), box.T
    corners = rng.random((CORNERS, len(box))) < 0.5
    return low + np.vstack([corners, rng.random((SAMPLED, len(box)))]) * (high - low)


def _off(claimed: float, distance: float, separation: float, _: float = 0.0) -> float:
    """Return how far a told gap is off: a separation, no more than the distance, where parts are apart; minus depth."""
    if not distance > 0.0:
        return abs(claimed - distance)
    return max(claimed - distance, min(distance, distance if np.isnan(separation) else separation) - claimed, 0.0)


def _share(claim: ShareClaim) -> Check:
    """Check a share by draws of the judge's own: none that are as likely as `SURE` are off it as far."""
    from scipy.stats import binomtest

    count, passed = len(claim.passed), int(np.count_nonzero(claim.passed))
    low, high = binomtest(passed, count).proportion_ci(1.0 - SURE, method="exact") if count else (0.0, 1.0)
    ends = claim.interval
    beyond = max(low - ends[1], ends[0] - high, claim.share - ends[1], ends[0] - claim.share) if count else 0.0
    note = f"told {ends[0]:.4%} to {ends[1]:.4%}; of {count} others {passed} pass"
    return _at_most("share", beyond, 0.0, note)
