"""Contacts as drawn of round parts: the least motion that restores them.

For motions that turn these are balls on faces, with exact equations. A sphere touches a face where its centre is a
radius from it; a cylinder or cone touches a plane along a line where the balls that it holds at both ends of the line
do; the corners of plane faces are balls of no radius. A ball in a conical hole, or in a socket of its own radius, has
its centre in a given point: in three planes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import minimize, nnls

from fcdm_opt.curve.contact import Joint
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.true_sizes import TrueContact, ends_of_line
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import deviation_of, is_plane_there, round_surfaces
from fcdm_opt.geometry.measures import cross, norms
from fcdm_opt.geometry.naming import rows_at
from fcdm_opt.geometry.patches import NearestPoints, Patch, nearest_on_faces, patches_of_element, true_faces
from fcdm_opt.geometry.tessellation import Swept
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT


class BallOnFace(NamedTuple):
    """A ball of one body and a face of the other, which touch where the contact is closed."""

    holder: int  # 0 where the face is of the movable body, 1 where it is of the static one
    centre: Array  # of the ball, of its body as made, where it was drawn, (3,)
    radius: float
    face: Patch  # of its body as made, where it was drawn
    feature: Feature  # the elements of the bodies that meet there, faces of facets for round ones

    @property
    def plane(self) -> tuple[Array, Array] | None:
        """A point of the plane in which the centre is, and its unit normal towards the ball; None for round faces."""
        surface = self.face.surface
        normal = self.face.side * surface.axis
        return (surface.origin + self.radius * normal, normal) if surface.flat else None

    @property
    def about(self) -> tuple[Array, Array, float] | None:
        """A point and the unit direction of a cylinder's axis, how far from it the centre is; None for other faces.

        Of a sphere its centre, and no direction, (0, 0, 0).
        """
        surface = self.face.surface
        if surface.ring or (surface.line is not None and surface.line[1]):
            return None
        along = surface.axis if surface.line is not None else np.zeros(3)
        return surface.origin, along, float(surface.radius + self.face.side * self.radius)

    def gap(self, pose: Array, rates: Array) -> tuple[float, Array]:
        """Return its gap after a motion of the movable body, and the derivatives of that, (k,)."""
        # `pose`, (4, 4), and its derivatives, (k, 4, 4)
        turn, shift = pose[:3, :3], pose[:3, 3]
        there = turn @ self.centre + shift if self.holder else (self.centre - shift) @ turn
        (off,), (normal,) = self.face.gaps(there[None])
        if self.holder:
            slopes = (rates[:, :3, :3] @ self.centre + rates[:, :3, 3]) @ normal
        else:
            slopes = rates[:, :3, :3] @ normal @ (self.centre - shift) - rates[:, :3, 3] @ (turn @ normal)
        return float(off - self.radius), np.asarray(slopes)


def balls_of(
    contact: TrueContact, drawn: Sequence[Body], made: Sequence[Body], nominal: Array, scales: Array
) -> list[BallOnFace]:
    """Return the balls and faces of a contact of true faces as drawn, of two bodies as made; none where it has none.

    Scales of both bodies as drawn, at which they touch, and as made, (2,).
    """
    faces, normals = [true_faces(body) for body in drawn], (contact.normal, -contact.normal)
    numbers = [*map(patches_made, drawn, made)]
    for pair in sorted(contact.pairs):
        before = [own.patches[k] for own, k in zip(faces, pair, strict=True)]
        met = zip(before, contact.points, normals, strict=True)
        if min(own.gaps(x[None])[1][0] @ n for own, x, n in met) < 1.0 - DEFAULT.nominal:  # at an edge of one of them
            continue
        feature = Feature(*(own.face_of(k) for own, k in zip(faces, pair, strict=True)))
        of_made = zip(made, numbers, pair, scales.tolist(), strict=True)
        after = [_patch_made(body, own[k], scale) for body, own, k, scale in of_made]
        for k in (0, 1):
            ball, other = after[k], after[1 - k]
            if ball.surface.flat or ball.surface.ring or ball.side < 0.0:
                continue
            if other.surface.flat:
                ends = ends_of_line(contact, faces, nominal, np.eye(4))[:, k]
                along = scales[k] * ((ends - before[k].surface.origin) @ before[k].surface.axis)
                return [*_on_plane(1 - k, ball.surface, other, along, feature)]
            if ball.surface.line is None:
                fits = _alike(before[k].surface, before[1 - k])
                return [*_of_sphere(1 - k, ball.surface, other, fits, feature)]
    return []


def corners_on_plane(feature: Feature, made: Sequence[Body], scales: Array) -> list[BallOnFace]:
    """Return the same of plane faces that touch corners, edges or each other: three corners of a face are enough."""
    placed = [body.placed_vertices(x, np.eye(4)) for body, x in zip(made, scales.tolist(), strict=True)]
    holder = int(feature.two.kind == "F")
    face, other = ((feature.one, feature.two)[k] for k in (holder, 1 - holder))
    normal, place = made[holder].face_planes[0][rows_at(made[holder], face)[0]], placed[holder][face.vertices[0] - 1]
    points = placed[1 - holder][np.array(other.vertices) - 1]
    one = norms(points - points[0]).argmax()
    two = norms(cross(points - points[0], points[one] - points[0])).argmax()
    kept = points[sorted({0, int(one), int(two)})]
    plane = Patch(Swept.plane(place, normal), 1.0)
    return [BallOnFace(holder, point, 0.0, plane, feature) for point in kept]


def _patch_made(body: Body, k: int, scale: float) -> Patch:
    """Return a true face of a body as made where it was drawn."""
    patch = true_faces(body).patches[k]
    own = patch.surface
    origin = body.seed + scale * (own.origin - body.seed)
    return patch._replace(surface=own._replace(origin=origin, radius=scale * own.radius, ring=scale * own.ring))


def _on_plane(holder: int, ball: Swept, plane: Patch, along: Array, feature: Feature) -> Iterator[BallOnFace]:
    """Yield a sphere, or balls of a cylinder or cone that touch at both ends of a line, as far along its axis."""
    if ball.line is None:
        yield BallOnFace(holder, ball.origin, float(ball.radius), plane, feature)
    elif len(along) > 1:
        steep, slope = ball.line
        for z in along.tolist():
            radius = (slope * z + ball.radius) / steep**2
            yield BallOnFace(holder, ball.origin + (z + slope * radius) * ball.axis, float(radius), plane, feature)


def _alike(ball: Swept, other: Patch) -> bool:
    """Tell whether a ball touches a hollow face all over or along a circle: one of its radius, or a conical one."""
    surface, cone = other.surface, other.surface.line is not None and other.surface.line[1] != 0.0
    return other.concave and (cone or bool(abs(surface.radius - ball.radius) <= DEFAULT.tie * ball.radius))


def _of_sphere(holder: int, ball: Swept, other: Patch, fits: bool, feature: Feature) -> Iterator[BallOnFace]:
    """Yield a sphere on a round face, or where it `fits` that the three planes its centre is in, if it still does."""
    surface, place = other.surface, other.surface.origin
    if not fits:
        yield BallOnFace(holder, ball.origin, float(ball.radius), other, feature)
    elif _alike(ball, other) and not (surface.line and not surface.line[1]):  # no ball in a bore of its radius
        if surface.line is not None:
            place = place + (ball.radius - surface.radius) / surface.line[1] * surface.axis
        for normal in np.eye(3):
            yield BallOnFace(holder, ball.origin, 0.0, Patch(Swept.plane(place, normal), 1.0), feature)


RESTORED = "1: linear equations of the contacts of true faces"
ROUNDS = 10  # of Newton's method: one where a face of each pair that meets is plane
STARTS = 0.0, 0.05, -0.05  # of the size: where contacts change with the square of a turn none leaves the first
MORE_ROUNDS = 60  # of motions that turn: each leaves a share of what is left, as large as the motion is
APART = 0.1  # length of the mean of unit normals: they look all round where it is less
STEP = 0.1  # of a shift: by so much it is left where the least one is another
NEAR = DEFAULT.snap, 1e-3, 0.05  # of the size: how far apart faces are looked at, one after another

Pairs = set[tuple[int, int]]  # true faces of either body that meet in a point, by number


def touching_again(problem: Problem) -> Problem | None:
    """Return the question of goal "touch" about round parts whose contacts as drawn are restored; None for others.

    All motions that restore these contacts are answers to it: where the least one restores them, it is the least of
    these too, see `restores`. Of shifts, by which what touches along a line does so again, and of contacts of true
    faces, round ones or plane.
    """
    asked = problem.of_facets
    if is_of_plane_faces(asked):  # that round faces elsewhere keep clear is what goal "touch" asks
        return asked.to_touch() if any(map(round_surfaces, asked.bodies[:2])) else None
    if not (
        asked.goal in ("at", "seat")
        and len(asked.contacts) == len(asked.nominal_joints)
        and asked.resolution is None
        and asked.round_contacts
        and (asked.motion.shifts or contact_balls(asked))
    ):
        return None
    known, flat = Pairs().union(*_pairs_made(asked)), flat_contacts(asked)
    for feature in (joint.feature for joint in asked.chosen_joints if joint.feature not in flat):
        if not known & _patches_met(asked, feature):  # facets may touch where true faces overlap
            return None
    return asked.to_touch()


def is_of_plane_faces(problem: Problem) -> bool:
    """Tell whether all contacts as drawn that shifts are to restore are of plane faces, their edges and corners."""
    return problem.motion.shifts and has_plane_contacts(problem)


def has_plane_contacts(problem: Problem) -> bool:
    """Tell whether all contacts as drawn that a motion is to restore are of plane faces, their edges and corners."""
    asked = problem.of_facets
    if asked.goal not in ("at", "seat") or asked.resolution is not None:
        return False
    of_all = 0 < len(_followed(asked)) == len(asked.nominal_joints) == len(flat_contacts(asked))
    return of_all and not asked.round_contacts


def _followed(problem: Problem) -> Sequence[Joint]:
    """Return the contacts as drawn that a question is about: those restored together, or those that are tracked."""
    tracked = problem.tracked_features
    return problem.chosen_joints or [own for own in problem.nominal_joints if own.feature in tracked]


def unfollowed(problem: Problem) -> int:
    """Return how many contacts of true faces there are as drawn whose facets do not touch: none of them is followed."""
    # 0 where some of the contacts as drawn were chosen
    asked = problem.of_facets
    if len(asked.contacts) != len(asked.nominal_joints):
        return 0
    known = Pairs().union(*(_patches_met(asked, joint.feature) for joint in asked.chosen_joints))
    return sum(not pairs & known for pairs in _pairs_made(asked))


def contact_balls(problem: Problem) -> list[BallOnFace]:
    """Return the balls on faces that contacts as drawn of round parts are; none where one of them is not of such."""
    return _balls_of_each(problem.of_facets) if problem.of_facets.round_contacts else []


def _balls_of_each(asked: Problem) -> list[BallOnFace]:
    """Return the balls on faces that contacts as drawn are, plane ones too; none where one of them is not of such."""
    found = list[BallOnFace]()
    drawn, made = [*asked.drawn.values()], [*asked.bodies_made.values()]
    if not all(map(patches_made, drawn, made)):
        return found
    each = [balls_of(own, drawn, made, asked.nominal_pair, asked.target) for own in asked.round_contacts]
    each += [corners_on_plane(own, made, asked.target) for own in flat_contacts(asked)]
    return [ball for balls in each for ball in balls] if all(each) else found


def _patches_met(problem: Problem, feature: Feature) -> Pairs:
    """Return each two patches of the bodies as made that a contact's elements are of."""
    sides = zip(problem.bodies_made.values(), (feature.one, feature.two), strict=True)
    one, two = (patches_of_element(body, own) for body, own in sides)
    return {*product(one, two)}


def restores(problem: Problem, transform: Array) -> bool:
    """Tell whether true faces that touch as drawn touch after a motion of parts made; False where no round one does."""
    asked, slack = problem.of_facets, problem.contact_slack
    before, flat = _met_as_drawn(problem), flat_contacts(asked)
    after = [own for own, met in _met(asked, transform) if abs(met.gap) <= slack]
    closed = all(abs(_plane_gap(asked, own, transform)[0]) <= slack for own in flat)
    pose = relative_pose(asked.movable, asked.static, transform)
    closed &= all(own.holds(pose, asked.target, slack) for own in asked.nominal_seats if own.feature in flat)
    return closed and bool(before or flat) and all(own & Pairs().union(*after) for own in before)


class RestoringMotion(NamedTuple):
    """The least motion after which true faces that touch as drawn touch again."""

    # (k,): motion parameters; None where no shift does it, as the gaps, linear in them, are not closed together, and
    # where the motion is beyond limits
    q: Array | None
    points: list[list[NearestPoints]]  # of each question where they touch then
    # least amount of all that do: gaps of plane faces are linear in shifts, those of convex ones nowhere less, and no
    # smaller shift closes these; infinite where no shift does. 0 of motions that turn
    bound: float
    # without one, the motion parameters at which the squares of all gaps are least, or those beyond limits, (k,)
    nearest: Array | None = None
    # gaps there of each question: of its `points`, then of its `flat_contacts`; < 0 where these overlap
    remaining: tuple[Array, ...] = ()
    only: bool = False  # whether no other shift does it, whatever its amount is


def restoring_motion(asked: Sequence[Problem]) -> RestoringMotion | None:
    """Return the least motion that restores contacts as drawn: `touching_again` answers, or `has_plane_contacts` holds.

    By Newton's method on their gaps, the least step of all that close them; of motions that turn a motion next to
    which no smaller one does. None where it is not found.

    `asked`: of two parts each, about the same motions.
    """
    asked = [own.of_facets for own in asked]
    first, before = asked[0], [_met_as_drawn(own) for own in asked]
    known = (each or has_plane_contacts(own) for own, each in zip(asked, before, strict=True))
    if not all(known) or any(own.amount != "weighted" for own in asked):
        return None
    turns = not all(own.motion.shifts for own in asked)
    starts = first.size / np.sqrt(len(first.weights)) * np.array(STARTS if turns else STARTS[:1])
    balls = [_balls_of_each(own) for own in asked] if turns else []
    if turns and not all(balls):
        return None
    tried = (_from(np.full(len(first.weights), start), asked, before, balls) for start in starts)
    return next((found for found in tried if found is not None), None)


Rows = list[tuple[float, Array, bool]]
"""Gaps, their derivatives by the weighted parameters, and whether they are linear in shifts, as of a plane face."""


def _from(
    y: Array, asked: Sequence[Problem], before: Sequence[list[Pairs]], balls: Sequence[list[BallOnFace]]
) -> RestoringMotion | None:
    """Return what Newton's method comes to from weighted parameters; see `restoring_motion`."""
    # with the `balls` of each question for motions that turn, else without
    first, turns, found = asked[0], bool(balls), [*map(len, before)]
    for _ in range(MORE_ROUNDS if turns else ROUNDS):
        q, points = y / first.weights, list[list[NearestPoints]]()
        if turns:
            each = [_rows_of_balls(*own, q) for own in zip(asked, balls, strict=True)]
        else:
            points = [_points_at(*own, q) for own in zip(asked, before, strict=True)]
            if [*map(len, points)] != found:
                return None
            each = [_rows_of_points(*own, q) for own in zip(asked, points, strict=True)]
        gaps, slopes, plane = (np.array(column) for column in zip(*sum(each, Rows()), strict=True))
        further = np.linalg.pinv(slopes, rcond=DEFAULT.nominal) @ (slopes @ y - gaps)
        near = min(own.contact_slack for own in asked) * DEFAULT.tie / DEFAULT.touch
        if np.abs(gaps).max() <= near and (not turns or np.abs(further - y).max() <= DEFAULT.tie * first.size):
            inside = bool(((first.limits[:, 0] <= q) & (q <= first.limits[:, 1])).all())
            held = slopes[plane]
            met = [own for each in zip(asked, before, points, strict=False) for own in _closing(*each, q)]
            rows = np.array([*held, *-held, *met]).reshape(-1, len(y))  # all that restore go as far along each
            shares, off = nnls(rows.T, y) if len(rows) else (np.zeros(0), np.inf)
            short, w = off > DEFAULT.tie * np.linalg.norm(y), shares @ rows
            bound = float(w @ y / np.linalg.norm(w) if short and w.any() else not short and np.linalg.norm(y))
            apart = [*_kept_apart(asked, before, q)] if short and not turns else []
            if apart and (smaller := _smaller(y, held, apart)) is not None:
                if smaller is not y and (less := _from(smaller, asked, before, balls)) is not None:
                    return less
                bound = float(np.linalg.norm(y)) if smaller is y else bound
            points = points or [_points_at(*own, q) for own in zip(asked, before, strict=True)]
            points = [[*_in_the_middle(*own, q)] for own in zip(asked, points, strict=True)]
            if turns and not inside:
                return RestoringMotion(None, points, 0.0, q)
            only = int(np.linalg.matrix_rank(held, tol=DEFAULT.nominal)) == len(y)
            return RestoringMotion(q, points, bound, only=only) if inside and [*map(len, points)] == found else None
        remaining = gaps + slopes @ (further - y)
        if not turns and np.abs(remaining).max() > max(own.contact_slack for own in asked):
            rest = tuple(np.split(remaining, np.cumsum([len(rows) for rows in each])[:-1]))
            return RestoringMotion(None, points, np.inf, further / first.weights, rest) if plane.all() else None
        y = further
    return None


def _points_at(problem: Problem, before: Sequence[Pairs], q: Array) -> list[NearestPoints]:
    """Return where faces that touch as drawn are nearest at motion parameters, see `_nearest`."""
    return _nearest(problem, before, problem.motion.transform(q, problem.movable.seed, problem.static.seed))


def _in_the_middle(problem: Problem, points: Sequence[NearestPoints], q: Array) -> Iterator[NearestPoints]:
    """Yield contacts with the middles of the straight lines along which faces touch in place of their ends."""
    faces = [true_faces(own) for own in problem.bodies_made.values()]
    pose = problem.motion.transform(q, problem.movable.seed, problem.static.seed)
    for own in points:
        yield own._replace(points=ends_of_line(own, faces, problem.target, pose).mean(axis=0))


def _rows_of_points(problem: Problem, points: Sequence[NearestPoints], q: Array) -> Rows:
    """Return the rows of true faces, by where they are nearest after a shift, then those of `flat_contacts`."""
    seeds = problem.movable.seed, problem.static.seed
    pose, shifts = problem.motion.transform(q, *seeds), -problem.motion.shift_vectors(*seeds) / problem.weights[:, None]
    flat = (_plane_gap(problem, own, pose) for own in flat_contacts(problem))
    round_ones: Rows = [(own.gap, shifts @ own.normal, _is_plane(problem, own)) for own in points]
    return round_ones + [(gap, shifts @ normal, True) for gap, normal in flat]


def _closing(problem: Problem, before: Sequence[Pairs], points: Sequence[NearestPoints], q: Array) -> list[Array]:
    """Return directions of weighted parameters, (k,), along which a shift goes as far as this one, or stays open."""
    # that of a contact whose faces all are on their sides of the plane across its normal: both parts are convex there
    faces, found = [true_faces(own) for own in problem.bodies_made.values()], list[Array]()
    for pairs, met in zip(before, points, strict=True):
        sides = zip(faces, zip(*pairs, strict=True), met.points, (met.normal, -met.normal), strict=True)
        each = [(own.patches[k], point, n) for own, some, point, n in sides for k in some]
        convex = all((own.surface.flat or own.side > 0.0) and not own.surface.ring for own, *_ in each)
        if convex and all(own.gaps(point[None])[1][0] @ n > 1.0 - DEFAULT.nominal for own, point, n in each):
            found.append(-_rows_of_points(problem, [met], q)[0][1])
    return found


class KeptApart(NamedTuple):
    """Two parallel cylinders, or spheres and what they touch: their axes, or centres, are so far apart in contact."""

    offset: Array  # from that of body 2 to that of body 1 after a shift, across the axes, (3,)
    slopes: Array  # its derivatives by the weighted parameters, (3, k)
    # 1 where they are apart by no less wherever the faces touch, at an edge of one of them too, as in a bore; -1 where
    # by no more; 0 where both, as of bores and pins all round
    side: float


def _kept_apart(asked: Sequence[Problem], before: Sequence[list[Pairs]], q: Array) -> Iterator[KeptApart]:
    """Yield what contacts of true faces as drawn, that shifts restore, keep apart; see `KeptApart`."""
    for problem, contacts in zip(asked, before, strict=True):
        seeds = problem.movable.seed, problem.static.seed
        shift, rates = problem.motion.transform(q, *seeds)[:3, 3], problem.motion.shift_vectors(*seeds).T
        bodies = zip(problem.bodies_made.values(), problem.target.tolist(), strict=True)
        of_each = [(true_faces(body), body, scale) for body, scale in bodies]
        for pair in (pair for pairs in contacts for pair in pairs):
            made = [_patch_made(body, k, scale) for (_, body, scale), k in zip(of_each, pair, strict=True)]
            one, two = (own.surface for own in made)
            if any(own.flat or own.ring or (own.line is not None and own.line[1]) for own in (one, two)):
                continue
            axes = [own.axis for own in (one, two) if own.line is not None]
            if len(axes) > 1 and norms(cross(*axes)) > DEFAULT.nominal:
                continue
            across = np.eye(3) - (np.outer(axes[0], axes[0]) if axes else 0.0)
            whole = len(axes) > 1 and all(faces.goes_round(k) for (faces, *_), k in zip(of_each, pair, strict=True))
            side = 0.0 if whole else 1.0 if min(own.side for own in made) < 0.0 else -1.0
            yield KeptApart(across @ (one.origin + shift - two.origin), across @ rates / problem.weights, side)


def _smaller(y: Array, held: Array, apart: Sequence[KeptApart]) -> Array | None:
    """Return a smaller shift, (k,) weighted, that closes plane gaps with slopes `held` and keeps axes apart alike.

    The same one where there is none, by Lagrange's function, |y|^2 less multiples of what is to be 0: where it is
    convex as far as plane gaps stay closed, its stationary point is its least one. None where that is not known.
    """
    size, held = float(np.linalg.norm(y)), held.reshape(-1, len(y))
    rows = np.array([*held, *(own.offset @ own.slopes for own in apart)])
    shares = np.linalg.lstsq(rows.T, y)[0]
    multipliers = shares[len(held) :]
    if np.linalg.norm(shares @ rows - y) > DEFAULT.nominal * size:
        return None
    bend = np.eye(len(y)) - sum(x * own.slopes.T @ own.slopes for x, own in zip(multipliers, apart, strict=True))
    closed = null_space(held) if len(held) else np.eye(len(y))  # shifts that keep plane gaps closed
    convex = np.linalg.eigvalsh(closed.T @ bend @ closed).min(initial=0.0) >= -DEFAULT.nominal
    if convex:
        right = all(share * own.side >= 0.0 for share, own in zip(multipliers, apart, strict=True))
        return y if right else None
    free = null_space(rows)  # where it bends down along shifts that keep all closed, it is no least one
    rates, axes = np.linalg.eigh(free.T @ bend @ free)
    if not rates.min(initial=0.0) < -DEFAULT.nominal:
        return None

    offsets, turns = np.array([own.offset for own in apart]) / size, np.array([own.slopes for own in apart])

    def off(x: Array) -> Array:
        there = offsets + turns @ (x - y / size)
        return np.concatenate([held @ (x - y / size), (there**2 - offsets**2).sum(axis=1)])

    def rates_of(x: Array) -> Array:
        return np.vstack([held, 2.0 * np.einsum("ij,ijk->ik", offsets + turns @ (x - y / size), turns)])

    start = y / size + STEP * free @ axes[:, rates.argmin()]
    kept = {"type": "eq", "fun": off, "jac": rates_of}
    found = minimize(lambda x: x @ x, start, jac=lambda x: 2.0 * x, constraints=kept, method="SLSQP", tol=DEFAULT.tie)
    return size * found.x if found.success and found.fun < 1.0 - DEFAULT.tie else None


def _rows_of_balls(problem: Problem, balls: Sequence[BallOnFace], q: Array) -> Rows:
    """Return the rows of balls on faces after a motion that turns."""
    pose, rates = problem.motion.kinematics(problem.movable.seed, problem.static.seed).rates(q)
    return [(gap, slopes / problem.weights, False) for gap, slopes in (ball.gap(pose, rates) for ball in balls)]


def _nearest(problem: Problem, before: Sequence[Pairs], pose: Array) -> list[NearestPoints]:
    """Return where faces that touch as drawn are nearest after a motion of the parts made; none where one is not."""
    for share in NEAR:
        found = [*_met(problem, pose, share)]
        each = [[own for pairs, own in found if pairs & met] for met in before]
        if all(each):
            return [_soonest_closed(problem, own) for own in each]
    return []


def _soonest_closed(problem: Problem, near: Sequence[NearestPoints]) -> NearestPoints:
    """Return where a contact's faces are nearest: of places as near, as of a thinner pin amid its bore, one to close.

    That along whose normal the motion's shifts go farthest for their amount; of those alike the middle one, with the
    mean of their normals: along it the gaps on both sides of a pin that rests on two edges change alike.
    """
    least = min(near, key=lambda own: own.gap)
    alike = [own for own in near if own.gap <= least.gap + problem.contact_slack]
    if not problem.motion.shifts or len(alike) == 1:
        return least
    normals = np.array([own.normal for own in alike])
    shifts = problem.motion.shift_vectors(problem.movable.seed, problem.static.seed) / problem.weights[:, None]
    rates = np.linalg.norm(normals @ shifts.T, axis=1)
    far = rates >= (1.0 - DEFAULT.snap) * rates.max()
    middle = alike[int(np.where(far, normals @ normals.sum(axis=0), -np.inf).argmax())]
    mean = np.unique(normals[far].round(9), axis=0).mean(axis=0)
    return middle._replace(normal=mean) if norms(mean) > APART else middle


def flat_contacts(problem: Problem) -> list[Feature]:
    """Return the contacts as drawn in which only plane faces, and their edges and corners, take part."""
    one, two = problem.bodies_made.values()
    asked = (joint.feature for joint in _followed(problem))
    return [
        own
        for own in asked
        if "F" in (own.one.kind, own.two.kind) and is_plane_there(one, own.one) and is_plane_there(two, own.two)
    ]


def _plane_gap(problem: Problem, feature: Feature, pose: Array) -> tuple[float, Array]:
    """Return the gap of parts made along a plane face after a shift, and its normal from body 1 to body 2."""
    bodies = [*problem.bodies_made.values()]
    placed = [own.placed_vertices(x, at) for own, x, at in zip(bodies, problem.target, (pose, np.eye(4)), strict=True)]
    k = int(feature.two.kind == "F")
    face, other = ((feature.one, feature.two)[side] for side in (k, 1 - k))
    normal = bodies[k].face_planes[0][rows_at(bodies[k], face)[0]]
    gaps = (placed[1 - k][np.array(other.vertices) - 1] - placed[k][face.vertices[0] - 1]) @ normal
    return float(gaps.min()), -normal if k else normal


def _is_plane(problem: Problem, met: NearestPoints) -> bool:
    """Tell whether a plane face touches there, along its normal, whatever the other one is."""
    faces = [true_faces(own) for own in problem.bodies_made.values()]
    return any(
        not own.is_round[k] and abs(own.patches[k].gaps(point[None])[1][0] @ met.normal) > 1.0 - DEFAULT.nominal
        for own, point in zip(faces, met.points, strict=True)
        for k in own.at(point)
    )


def _met_as_drawn(problem: Problem) -> list[Pairs]:
    """Return which true faces touch as drawn, a round one among each two; none where sizes change which there are."""
    # each once, as those of a shaft that touches its bore all round
    found = list[Pairs]()
    for pairs in _pairs_made(problem.of_facets):
        found += [pairs] * (pairs not in found)
    return found


def _pairs_made(asked: Problem) -> list[Pairs]:
    """Return the true faces of each contact as drawn, by number among those made; see `patches_made`."""
    one, two = map(patches_made, asked.drawn.values(), asked.bodies_made.values())
    return [{(one[j], two[k]) for j, k in own.pairs} for own in asked.round_contacts if one and two]


def patches_made(drawn: Body, made: Body) -> list[int]:
    """Return the number, among the true faces of a body as made, of each as drawn; none where round ones came or went.

    A plane face that was in two pieces, as sizes met in it, may be one of those made: the nearest that looks its way.
    """
    before, after = true_faces(drawn), true_faces(made)
    if len(before.patches) == len(after.patches):
        return [*range(len(before.patches))]
    if before.is_round.sum() != after.is_round.sum():
        return []
    found, flat = list[int](), np.flatnonzero(~after.is_round)
    planes = np.array([[*after.patches[k].surface.axis, *after.patches[k].surface.origin] for k in flat])
    for k, patch in enumerate(before.patches):
        if before.is_round[k]:
            found.append(k)
            continue
        turned = norms(planes[:, :3] - patch.surface.axis)
        off = np.abs((planes[:, 3:] - patch.surface.origin) @ patch.surface.axis)
        found.append(int(flat[np.where(turned <= DEFAULT.sharp, off, np.inf).argmin()]))
    return found


def _met(problem: Problem, pose: Array, share: float = DEFAULT.snap) -> Iterator[tuple[Pairs, NearestPoints]]:
    """Yield which true faces of parts made come near, to a share of the size, where, a round one among each two."""
    bodies, scales = problem.bodies_made.values(), problem.target
    faces = [true_faces(body) for body in bodies]
    off = sum(scale * sum(deviation_of(own)) for scale, own in zip(scales.tolist(), bodies, strict=True))
    found = nearest_on_faces(faces, scales, pose, problem.contact_slack + off + share * problem.size)
    points = np.array([own.points for own in found]).reshape(-1, 2, 3)
    for own, *patches in zip(found, *(faces[k].at_each(points[:, k]) for k in (0, 1)), strict=True):
        yield {*product(*patches)}, own
