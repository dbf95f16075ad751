"""Whether a motion leaves the fit: the parts were drawn engaged, and after the motion they are not.

A *fit* is more than a contact: a peg in its hole, a nut in its rail, a hook on its bar. As drawn no shift leads away
from all parts of the other body at once. A box that stands on a slab, or in a corner, is none: it may be moved away as
far as one likes, but not through the slab. A motion leaves the fit in one of two ways.

- It goes *through* the other body, one that holds it or, where no contact is tracked, meets it as drawn: on lines along
  the motion, material of the other body that lies ahead as drawn lies behind after it. The solids are looked at as
  wholes, so that it makes no difference how they are cut into convex parts, or whether they are; and only where as much
  of them passes as their sizes do not explain.
- It comes *off* the other body: the contact that was asked for is sought where nothing holds the part any more, or a
  slide on its way, which can be lifted, is moved along it past its end. As
  drawn it reaches into the other's hull, deeper than the sizes change; after the motion nothing of that hull is on its
  way out. Drawing a part out on an open way is no re-positioning either. Where two widths of the parts made do not go
  together, a collar and its seat, the faces between which they are are looked at by themselves too: the rest of a
  stepped pin may still be in the bore.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.facets import facets_of
from fcdm_opt.geometry.solids import PlacedSolids, contains, depth_as_drawn, kept_as_surface
from fcdm_opt.judge.passing import Sizes, passes, past_after, stay_divided
from fcdm_opt.problem.fit import (
    REST,
    Misfit,
    drawn_bodies,
    hair_of,
    holds,
    leads_away,
    misfit,
    overlap_as_drawn,
    part_corners_as_made,
)
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.tolerances import DEFAULT

GROWTH = 2.0  # times what the sizes change: parts that reach into each other by less may be taken apart by that alone
HELD_SHARE = 0.1  # parts that reach into each other by less than this share of what they do as drawn are held no more
TURN, MOST_STEPS = 0.2, 32  # in steps of at most so many radians a motion that turns is looked at, and in no more
ALIKE = 0.1  # displacements that differ by less than this share of one of them are looked along once


def inside_fit(solution: Solution) -> Solution:
    """Return a solution with status OUTSIDE_FIT where its motion leaves the fit; others as they are."""
    return replace(solution, status=Status.OUTSIDE_FIT) if outside_fit(solution) else solution


def outside_fit(solution: Solution) -> bool:
    """Tell whether a solution's motion leaves the fit; false without a motion."""
    known = solution.status.found and tuple(solution.parameters) == solution.problem.motion.names
    return known and leaves_fit(solution.problem.reformulated, tuple(solution.parameters.values()))


@lru_cache(maxsize=16)
def leaves_fit(problem: Problem, parameters: tuple[float, ...]) -> bool:
    """Tell whether a motion leaves the fit in which a problem's parts are drawn."""
    problem = problem.of_facets
    q, bodies = np.array(parameters), (problem.movable, problem.static)
    if not q.any():
        return False
    through, tracking = goes_through(problem, parameters), problem.goal in TRACKING or problem.contacts
    pose = _poses(problem, q[None])[0]
    shift = pose[:3, :3] @ problem.movable.seed + pose[:3, 3] - problem.movable.seed
    if through and not tracking:  # of a contact that is tracked `path` says what is asked
        overlap, far = overlap_as_drawn(problem), float(np.linalg.norm(shift)) / hair_of(problem)
        if abs(overlap) <= 1.0 or 0.0 < overlap <= HELD_SHARE * far:
            return True  # the parts meet as drawn, held or not, or a pose was sensed a little off
    if all(len(body.parts) == 1 for body in bodies):
        return False  # of two convex parts neither holds the other
    if not (through or _any_comes_off(problem, pose)):
        return False
    return holds(problem) or not (tracking or through or leads_away(problem, shift))


def passage(problem: Problem, shift: Array) -> tuple[float, float]:
    """Return how far body 1 may be shifted against and along a way, as drawn, before it leaves the fit; see above."""
    # infinite where the parts are no fit, or touch it no deeper than sizes may change
    problem = problem.of_facets
    if not holds(problem):
        return -np.inf, np.inf
    length, ends = float(np.linalg.norm(shift)), [-np.inf, np.inf]
    one, two = _corners(problem, 0.0, REST)
    points, others = problem.movable.vertices, problem.static.vertices
    units = [1.0 if own.is_length else problem.size for own in problem.sizes]
    change = sum(unit * max(map(abs, own.tolerance or (0.0,))) for unit, own in zip(units, problem.sizes, strict=True))
    for side, sign in enumerate((-1.0, 1.0)):
        past = past_after(one, two, sign * shift / length, DEFAULT.side * problem.size)
        ends[side] = min(ends[side], sign * past / length, key=abs)
        deep = _depth(points, others, sign * shift / length)
        if deep > GROWTH * change:
            ends[side] = min(ends[side], sign * (1.0 - HELD_SHARE) * deep / length, key=abs)
    return ends[0], ends[1]


@lru_cache(maxsize=16)
def goes_through(problem: Problem, parameters: tuple[float, ...], keep_out: KeepOut | None = None) -> bool:
    """Tell whether body 1 goes through body 2, or a keep-out, on the straight ray of parameters, turning in steps."""
    problem = problem.of_facets  # the pieces that are exact at points are no solids
    q = np.array(parameters)
    size, turned = problem.size, float(np.abs(q[problem.motion.turning]).sum())
    shares = np.linspace(0.0, 1.0, min(1 + int(turned / TURN), MOST_STEPS) + 1)
    poses = _poses(problem, shares[:, None] * q)
    if not np.isfinite(poses).all() or stay_divided(_sizes(problem, keep_out), shares, poses, DEFAULT.nominal * size):
        return False
    before = _corners(problem, 0.0, REST, keep_out)
    for share, pose in zip(shares[1:].tolist(), poses[1:], strict=True):
        pacing.check()
        after = _corners(problem, share, pose, keep_out)
        one, two = zip(before, after, strict=True)
        if any(passes(one, two, shift, DEFAULT.snap * size) for shift in _displacements(one, two, size, turned > 0.0)):
            return True
        before = after
    return False


def collides_on_path(problem: Problem, parameters: tuple[float, ...], keep_out: KeepOut | None = None) -> bool:
    """Tell whether body 1 goes through body 2, or a keep-out, on its straight way, or digs into it in a large turn."""
    return goes_through(problem, parameters, keep_out) or _digs_into(problem, parameters, keep_out)


@lru_cache(maxsize=16)
def _digs_into(problem: Problem, parameters: tuple[float, ...], keep_out: KeepOut | None) -> bool:
    """Tell whether on the way of a large turn body 1 as made overlaps the other far deeper than at both ends."""
    problem = problem.of_facets
    q = np.array(parameters)
    turned = float(np.abs(q[problem.motion.turning]).sum())
    _, (_, other, _, its) = _sizes(problem, keep_out)
    if not turned > TURN or kept_as_surface(problem.movable, other):  # of large meshes it would take long
        return False
    scales = np.array([problem.target[0], its])

    def depth(share: float) -> float:
        pacing.check()
        return PlacedSolids(problem.movable, other, scales, _poses(problem, share * q[None])[0]).depth

    most = GROWTH * (depth(0.0) + depth(1.0)) + DEFAULT.snap * problem.size
    steps = min(1 + int(turned / TURN), MOST_STEPS)
    return any(depth(k / steps) > most for k in range(1, steps))


def _poses(problem: Problem, parameters: Array) -> Array:
    """Return the poses of body 1, (s, 4, 4), at parameters, (s, k); nan where a screw's axis has vanished."""
    return problem.motion.kinematics(problem.movable.seed, problem.static.seed).transforms(parameters)


def _corners(problem: Problem, share: float, pose: Array, keep_out: KeepOut | None = None) -> tuple[Array, Array]:
    """Return the corners of both bodies' facets, (t, 3, 3), at sizes between those drawn and those made, and posed."""
    found = list[Array]()
    for drawn, own, *scales in _sizes(problem, keep_out):
        before, after = (
            own.seed + rho * (corners - own.seed) for rho, corners in zip(scales, _facets(drawn, own), strict=True)
        )
        found.append((1.0 - share) * before + share * after)
    return found[0] @ pose[:3, :3].T + pose[:3, 3], found[1]


def _sizes(problem: Problem, keep_out: KeepOut | None = None) -> Sizes:
    """Return both bodies as drawn and as made, with their scales before and after."""
    # a keep-out, at its largest scale, in place of the static body where one is given
    made, ends = (problem.movable, problem.static), (problem.nominal_pair.tolist(), problem.target.tolist())
    asked = list(zip(drawn_bodies(problem), made, *ends, strict=True))
    if keep_out is not None:
        asked[1] = keep_out.body, keep_out.body, keep_out.ends[1], keep_out.ends[1]
    return asked


def _facets(drawn: Body, made: Body) -> tuple[Array, Array]:
    """Return corners of the same facets of a body as drawn and as made; as made alone where these are others."""
    if drawn is not made and made.triangles:  # triangulated anew, on vertices that keep their labels
        triangles = np.array([own for face in made.triangles for own in face])
        points = made.vertices
        if triangles.max() < len(drawn.vertices):
            return drawn.vertices[triangles], points[triangles]
        return points[triangles], points[triangles]
    one, two = facets_of(drawn), facets_of(made)
    after = two.points[two.triangles] + made.seed
    same = np.array_equal(one.triangles, two.triangles) and one.points.shape == two.points.shape
    return (one.points[one.triangles] + drawn.seed if same else after), after


def _displacements(one: tuple[Array, Array], two: tuple[Array, Array], size: float, turns: bool) -> list[Array]:
    """Return how body 1 is displaced against what of body 2 is near its way, (3,) each: its middle, turned its ends."""
    # one of those that are nearly alike, and none that is no more than rounding
    (start, end), (others, moved) = one, two
    both = np.concatenate([start, end]).reshape(-1, 3)
    low, high = both.min(axis=0), both.max(axis=0)
    passed = np.concatenate([others, moved], axis=1)  # sizes move them too
    near = ((passed.min(axis=1) <= high) & (passed.max(axis=1) >= low)).all(axis=1)
    if not near.any():
        return []
    places, own = start.reshape(-1, 3), (end - start).reshape(-1, 3)
    outer = np.concatenate([places.argmin(axis=0), places.argmax(axis=0)])[: 6 * turns]
    found = list[Array]()
    for shift in np.vstack([own.mean(axis=0), own[outer]]) - (moved - others)[near].mean(axis=(0, 1)):
        length = float(np.linalg.norm(shift))
        if length > DEFAULT.side * size and not any(np.linalg.norm(shift - same) <= ALIKE * length for same in found):
            found.append(shift)
    return found


def _any_comes_off(problem: Problem, T: Array) -> bool:
    """Tell whether body 1 comes off body 2, or its walls do from between walls that they do not go together with."""
    bodies, drawn = (problem.movable, problem.static), drawn_bodies(problem)
    if _comes_off(problem, T, [_alike(*own) for own in zip(drawn, bodies, strict=True)]):
        return True
    found, corners = misfit(problem), part_corners_as_made(problem)
    if found is None or corners is None:
        return False
    sides = zip(drawn, bodies, found.faces, found.parts, corners, strict=True)
    off = _comes_off(problem, T, [_walls(*own) for own in sides], past=problem.motion.shifts)
    return off and not _stays_between(problem, T, found)


def _stays_between(problem: Problem, T: Array, found: Misfit) -> bool:
    """Tell whether both walls of a part that is too wide have the other right next to them after a motion.

    A key that is raised off the fillets of its keyway is in it still, unlike a collar off its seat.
    """
    inside, scales, made = found.inside, problem.target.tolist(), (problem.movable, problem.static)
    own, other, faces = made[inside], made[1 - inside], found.faces[inside]
    if len(own.vertices) != len(drawn_bodies(problem)[inside].vertices):
        return False
    pose, lack = np.linalg.inv(T) if inside else T, found.inner - found.outer
    outward = (0.5 - inside) * lack * np.array(found.normal)  # of the first wall
    for face, side in zip(faces, (1.0, -1.0), strict=True):
        if face is None:
            return False
        corners = own.vertices[np.array(face.vertices) - 1]
        points = corners + HELD_SHARE * (corners.mean(axis=0) - corners)
        there = own.seed + scales[inside] * (points - own.seed) + side * outward
        there = there @ pose[:3, :3].T + pose[:3, 3]
        next_to = contains(other, other.seed + (there - other.seed) / scales[1 - inside])
        if not (next_to & contains(own, points - side * outward)).any():  # a face need not be convex
            return False
    return True


def _alike(drawn: Body, made: Body) -> tuple[Array, Array]:
    """Return the corners of a body as drawn and as made; those as made twice where these are others."""
    return drawn.vertices if drawn.vertices.shape == made.vertices.shape else made.vertices, made.vertices


def _walls(
    drawn: Body, made: Body, faces: Sequence[Element | None], parts: Sequence[int], corners: Sequence[Array]
) -> tuple[Array, Array]:
    """Return the corners, as drawn and as made, of faces; of convex parts where only a cut made one."""
    if len(made.vertices) != len(drawn.vertices) or None in faces:
        return (np.concatenate([corners[k] for k in parts]),) * 2
    rows = [vertex - 1 for own in faces if own is not None for vertex in own.vertices]
    return drawn.vertices[rows], made.vertices[rows]


def _comes_off(problem: Problem, T: Array, points: Sequence[tuple[Array, Array]], *, past: bool = False) -> bool:
    """Tell whether points of body 1 reach into the hull of others as drawn, deeper than sizes change, then no more."""
    # `points` are those of both bodies, (n, 3) and (m, 3), as drawn and as made. With `past` they are known to face
    # each other no more, as walls that do not go together and are shifted to where no part is in another
    seeds = problem.movable.seed, problem.static.seed
    drawn, (start, others) = (
        [seed + rho * (own - seed) for seed, rho, own in zip(seeds, scales, each, strict=True)]
        for scales, each in zip((problem.nominal_pair, problem.target), zip(*points, strict=True), strict=True)
    )
    end = start @ T[:3, :3].T + T[:3, 3]
    shift = (end - start).mean(axis=0)
    length = float(np.linalg.norm(shift))
    if not length > DEFAULT.side * problem.size:
        return False
    ahead = shift / length
    change = sum(float(np.abs((now - was) @ ahead).max()) for now, was in zip((start, others), drawn, strict=True))
    if not length > GROWTH * change:
        return False
    deep = _depth(drawn[0], drawn[1], ahead)
    if not deep > GROWTH * change or (not past and _depth(end, others, ahead) > HELD_SHARE * deep):
        return False
    overlap = depth_as_drawn(*drawn_bodies(problem), problem.nominal_pair)  # to be taken apart by the motion
    return deep > GROWTH * (change + overlap)


def _depth(points: Array, others: Array, ahead: Array) -> float:
    """Return how far points must be shifted along a unit vector to leave the hull of others; 0 where it is not met."""
    # the largest t >= 0 such that the hulls of points + t ahead and others meet: a linear program in their weights
    from scipy.optimize import linprog

    n, m = len(points), len(others)
    meet = np.hstack([points.T, -others.T, ahead[:, None]])
    sums = np.zeros((2, n + m + 1))
    sums[0, :n] = sums[1, n:-1] = 1.0
    furthest, equal = np.append(np.zeros(n + m), -1.0), np.vstack([meet, sums])
    result = linprog(furthest, A_eq=equal, b_eq=[0.0, 0.0, 0.0, 1.0, 1.0], method="highs")
    return float(result.x[-1]) if result.status == 0 else 0.0
