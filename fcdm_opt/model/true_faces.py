"""Motions for the true faces of round parts: facets are made exact where the parts meet.

Both parts are taken within the true ones, which ask for no more than these, and the motion that they need is found.
Where the true faces overlap after it, the parts are made exact at those points, and it is found anew, until they
overlap nowhere: then it is right for the true ones too. This is the exchange method for infinitely many constraints
(Hettich and Kortanek, Semi-infinite programming, SIAM Review 35, 1993): each point of a round face is one, and few
matter. Where parts with play are to touch, larger ones touch sooner: the least motion is then also sought on the gap of
the true faces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize, nnls

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import all_recognised, bounding_bodies, deviation_of, gaps_off, round_surfaces
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.patches import NearestPoints, followed, nearest_on_faces, true_faces
from fcdm_opt.model.task import Answer, Task
from fcdm_opt.problem.contacts_restored import touching_again
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.tolerances import DEFAULT

ROUNDS = 30  # of making parts exact where they overlap
PATIENCE = 6  # rounds in which the deepest overlap becomes less than half of what it was, or it is given up
SEVERAL = 8  # points at a time
TIGHT = 0.003  # of what counts as touching: by so much true faces may overlap
JUMP = 1e4  # times what counts as touching: by more the next motion is another one, as line to line nothing else fits
FAR = 0.05  # of the size: nearer points of a time are one
DEEPER = 4.0  # times what facets leave: so deep sharp edges enter between parts of a body within the true one
STEPS = 30  # of a search for a smaller motion after which true faces touch
NEWTON_STEPS = 8  # to the least motion on true faces
SLOW = 0.9  # of an overlap that a round leaves: where it is more, where the next ones lead to is not foreseen

Points = dict[str, list[list[float]]]


class Exchange:
    """A question of two parts, which are made exact at more and more points of their round faces."""

    facets: Problem  # the question about the parts as they are drawn
    points: Points  # of "movable" and "static", see `Problem.exact_at`
    need: float  # least gap that is asked for

    def __init__(self, problem: Problem) -> None:
        self.facets, known = problem.of_facets, problem.exact_at or {}
        self.points = {role: [[*point] for point in known.get(role, ())] for role in ("movable", "static")}
        self.need = self.facets.clearance if "clear" in (self.facets.goal, self.facets.pair) else 0.0
        self._slack = self.facets.contact_slack
        self._last: tuple[Array, float, list[NearestPoints]] | None = None

    @classmethod
    def of(cls, problem: Problem) -> Exchange | None:
        """Return it; None where round faces play no part, or what they are is not known."""
        # a goal must be about the bodies, not about one contact; keep-outs must have plane faces
        facets = problem.of_facets
        if facets.goal not in ("touch", "clear") or facets.contacts:
            return None
        near, plane = (facets.movable, facets.static), DEFAULT.drawn * facets.size
        if any(max(deviation_of(own.body)) > plane for own in facets.keep_out):
            return None
        found = has_round_faces(problem) and all(bounding_bodies(own) is not None for own in near)
        return cls(problem) if found else None

    @property
    def problem(self) -> Problem:
        """The question about the parts that are exact at the points."""
        return self.facets.with_exact_points(self.points)

    def nearest(self, transform: Array, slack: float) -> list[NearestPoints]:
        """Return where the gap after a motion is less than asked and some slack, a few, the worst first; or least."""
        # gaps are less what is asked for. Of keep-outs, which are `other` 1 and more, the second point is not told
        chosen = list[NearestPoints]()
        for own in self._sorted(transform, max(slack, self._slack)):
            if (chosen and own.gap >= slack) or len(chosen) == SEVERAL:
                break
            if not any(_same(own, other, self.facets) for other in chosen):
                chosen.append(own)
        return chosen

    def _sorted(self, transform: Array, slack: float) -> list[NearestPoints]:
        """Return all of them, the worst first; those of the last motion are kept."""
        if self._last and (self._last[0] == transform).all() and self._last[1] == slack:
            return self._last[2]
        movable, scale = self.facets.movable, float(self.facets.target[0])
        found = list[NearestPoints]()
        for k, body, its_scale, need in self._others:
            for own in where_nearest(movable, body, (scale, its_scale), transform, max(need + slack, 0.0)):
                found.append(own._replace(gap=own.gap - need, points=own.points if not k else own.points[:1], other=k))
        self._last = transform, slack, sorted(found, key=lambda own: own.gap)
        return self._last[2]

    @property
    def _others(self) -> list[tuple[int, Body, float, float]]:
        """What body 1 is to touch or keep clear of: the number of each, bodies, scales, and the gaps asked for."""
        kept = [(k, *own, x.clearance) for k, x in enumerate(self.facets.keep_out, 1) for own in x.bodies]
        return [(0, self.facets.static, float(self.facets.target[1]), self.need), *kept]

    def _followed(self, known: Sequence[NearestPoints], transform: Array) -> list[NearestPoints]:
        """Return where faces that are nearest at known points are so after a motion next to the one of these."""
        found, faces = list[NearestPoints](), [true_faces(own) for own in (self.facets.movable, self.facets.static)]
        for own in known:
            there = None if own.other else followed(faces, self.facets.target, transform, own)
            if there is None:  # it is looked for among all
                near = self._sorted(transform, self._slack)
                found.append(min(near, key=lambda x: float(norms(x.points[0] - own.points[0])), default=own))
            else:
                found.append(there._replace(gap=there.gap - self.need))
        return found

    def add(self, found: Sequence[NearestPoints]) -> None:
        """Make the parts exact at these points."""
        self.points.update(self.with_points(found))

    def add_nearest(self, transform: Array, gap: float) -> None:
        """Make the parts exact where true faces are nearest after a motion that leaves facets a gap."""
        near = [own for own in self.nearest(transform, gap - self.need) if len(own.points) == len(self.points)]
        self.add([own for own in near[:1] if not self.has(own)])

    def with_points(self, found: Sequence[NearestPoints]) -> Points:
        """Return the points of each part with these."""
        new = ([own.points[k].tolist() for own in found if k < len(own.points)] for k in range(len(self.points)))
        return {role: [*known, *own] for (role, known), own in zip(self.points.items(), new, strict=True)}

    def met(self, transform: Array) -> list[NearestPoints]:
        """Return the points, of those where parts touch after a motion, that it moves together most, or none."""
        # each half as far within as they overlap, by rounding: line to line, parts fit. Points that only slide on each
        # other, as beside a pin that is moved in its bore, would be as near before and after
        facets, scale = self.facets, float(self.facets.target[0])
        seed = facets.movable.seed

        def moved(own: NearestPoints) -> float:
            point = seed + scale * (own.points[0] - seed)
            return abs(float((transform[:3, :3] @ point + transform[:3, 3] - point) @ own.normal))

        near = self._sorted(transform, self._slack)
        least = min((own.gap for own in near), default=0.0)
        found = [own for own in near if own.gap <= max(TIGHT * self._slack, -SEVERAL * least)]
        own = max((own for own in found if not self._is_flush(own, transform)), key=moved, default=None)
        if own is None or self.has(own):
            return []
        half, (one, two) = max(-own.gap, 0.0) / 2.0 * own.normal, self.facets.target.tolist()
        within = np.array([-half @ transform[:3, :3] / one, half / two])
        return [own._replace(points=own.points + within[: len(own.points)])]

    def _is_flush(self, own: NearestPoints, transform: Array) -> bool:
        """Tell whether plane faces meet there, as at the rim of a lid: parts within the true ones have these too."""
        bodies, normals = (self.facets.movable, self.facets.static), (own.normal @ transform[:3, :3], -own.normal)
        return len(own.points) == len(self.points) and all(
            any(not faces.is_round[k] and faces.patches[k].gaps(x[None])[1][0] @ n > 1.0 - DEFAULT.nominal
                for k in faces.at(x))
            for faces, x, n in zip(map(true_faces, bodies), own.points, normals, strict=True)
        )  # fmt: skip

    def nearer(self, found: Solution) -> list[NearestPoints]:
        """Return where true faces meet after the least motion near one after which the parts touch."""
        # parts that are exact at two points alone touch there whatever their normals are; true faces may do so after a
        # smaller motion, which is sought by sequential quadratic programming (SLSQP) on their gap and its slopes
        facets, start = self.facets, np.array([*found.parameters.values()])
        assert found.transform is not None
        seed, scale = facets.movable.seed, float(facets.target[0])
        kinematics = facets.motion.kinematics(seed, facets.static.seed)
        made = seed + scale * (facets.movable.vertices - seed)
        bound = float(norms(made @ found.transform[:3, :3].T + found.transform[:3, 3] - made).max())
        if bound <= self._slack:  # as where plane faces touch at rest: nothing is less
            return []
        unit = float(np.linalg.norm(facets.weights * start)) / facets.weights

        def gap(y: Array) -> float:
            near = self._sorted(kinematics.transform(unit * y), bound)
            return near[0].gap if near else bound

        def slopes(y: Array) -> Array:
            pose, rates = kinematics.rates(unit * y)
            near = self._sorted(pose, bound)
            return self._slopes(near[0], rates) * unit if near else np.zeros(len(y))

        least = minimize(
            lambda y: y @ y,
            start / unit,
            jac=lambda y: 2.0 * y,
            bounds=(facets.limits / unit[:, None]).tolist(),
            constraints={"type": "ineq", "fun": lambda y: -gap(y) / bound, "jac": lambda y: -slopes(y) / bound},
            method="SLSQP",
            options={"maxiter": STEPS, "ftol": DEFAULT.nominal},
        )
        q = unit * least.x
        balanced = self.balanced(q, -1.0)
        near = self.nearest(kinematics.transform(q if balanced is None else balanced), self._slack)[:1]
        return [own for own in near if not self.has(own)]

    def balanced(self, q: Array, sign: float) -> Array | None:
        """Return the least motion next to one, by Newton's method on its optimality conditions; None if it is that."""
        # there y = W q, of length 1, is a sum of multipliers times the slopes by y of gaps that are 0: of `sign` 1
        # where these keep parts apart, -1 of the one that they close. How slopes change is taken by differences. A
        # motion counts only where it leaves less of the conditions open
        facets, size = self.facets, float(np.linalg.norm(self.facets.weights * q))
        free = (q > facets.limits[:, 0]) & (q < facets.limits[:, 1])
        if facets.amount != "weighted" or not free.any() or not size > self._slack:
            return None
        kinematics, unit = facets.motion.kinematics(facets.movable.seed, facets.static.seed), size / facets.weights

        def met(y: Array, known: Sequence[NearestPoints] = ()) -> tuple[list[NearestPoints], Array, Array]:
            """Return contacts, those next to known ones, with their gaps and the slopes of these, by `size`."""
            pose, rates = kinematics.rates(unit * y)
            found = self._followed(known, pose)
            if not known:
                near = self.nearest(pose, self._slack)[: 1 if sign < 0.0 else None]
                found = [own for own in near if own.gap <= self._slack]
            slopes = [self._slopes(own, rates) * unit for own in found]
            return found, np.array([own.gap for own in found]) / size, np.array(slopes).reshape(-1, len(y)) / size

        y = start = q / unit
        known, gaps, slopes = met(y)
        shares = nnls(sign * slopes[:, free].T, y[free])[0] if known else np.zeros(0)
        holds = np.flatnonzero(shares > 0.0)
        known, gaps, slopes, shares = [known[k] for k in holds], gaps[holds], slopes[holds], sign * shares[holds]
        best, least, none = start, np.inf, np.zeros((len(known), len(known)))
        for turn in range(NEWTON_STEPS if known else 0):
            if turn:
                _, gaps, slopes = met(y, known)
            off = np.concatenate([(y - shares @ slopes)[free], gaps])
            if not float(np.linalg.norm(off)) < SLOW * least:
                break
            best, least = y, float(np.linalg.norm(off))
            if least <= DEFAULT.tie:
                break
            if not turn:  # near enough for all steps
                ahead = [met(y + DEFAULT.snap * own, known)[2] for own in np.eye(len(y))[free]]
                bend = np.array([(shares @ (own - slopes))[free] for own in ahead]).T / DEFAULT.snap
            system = np.block([[np.eye(len(bend)) - bend, -slopes[:, free].T], [slopes[:, free], none]])
            step = np.linalg.lstsq(system, off)[0]
            y, shares = y.copy(), shares - step[len(bend) :]
            y[free] -= step[: len(bend)]
        return None if best is start else unit * best

    def foresee(self, q: Array, sign: float) -> bool:
        """Make the parts exact where true faces meet after the least motion next to one, see `balanced`; tell whether.

        False where none is known, or they were exact there.
        """
        ahead = self.balanced(q, sign)
        if ahead is None:
            return False
        facets = self.facets
        pose = facets.motion.transform(ahead, facets.movable.seed, facets.static.seed)
        new = [own for own in self.nearest(pose, self._slack) if own.gap <= self._slack and not self.has(own)]
        self.add(new)
        return bool(new)

    def new(self, found: Sequence[NearestPoints]) -> list[NearestPoints]:
        """Return those at which the parts are not exact, or that overlap by more than rounding."""
        return [own for own in found if own.gap < -self._slack or not self.has(own)]

    def refine(self, transform: Array, apart: float | None = None) -> bool:
        """Make the parts exact where true faces overlap after a motion; tell whether they were not."""
        # with `apart` also where they are nearer than that, and where they are nearest
        limit = -TIGHT * self._slack if apart is None else max(self._slack, apart)
        near = self.nearest(transform, limit)
        if apart is not None and not near:  # directions of facets alone may say less than the distance
            near = self.nearest(transform, 2.0 * limit)[:1]
        new = [own for own in near if (own.gap < limit or apart is not None) and not self.has(own)]
        self.add(new)
        return bool(new)

    def gap_and_slope(self, q: Array, along: Array, most: float) -> tuple[float, float]:
        """Return the gap of true faces after a motion, `most` where they are farther, and its slope along a ray."""
        pose, rates = self.facets.motion.kinematics(self.facets.movable.seed, self.facets.static.seed).rates(q)
        near = self._sorted(pose, most)
        return (near[0].gap, float(along @ self._slopes(near[0], rates))) if near else (most, 0.0)

    def _slopes(self, own: NearestPoints, rates: Array) -> Array:
        """Return how a gap changes with each parameter, (k,), from the rates of the pose with these, (k, 4, 4)."""
        seed, scale = self.facets.movable.seed, float(self.facets.target[0])
        point = np.append(seed + scale * (own.points[0] - seed), 1.0)
        return np.asarray(-(rates[:, :3] @ point) @ own.normal)

    def has(self, own: NearestPoints) -> bool:
        """Tell whether parts are exact there."""
        near = DEFAULT.tie * self.facets.size
        return all(
            bool(len(there)) and float(norms(np.array(there) - point).min()) <= near
            for there, point in zip(self.points.values(), own.points, strict=False)
        )


def where_nearest(
    movable: Body, static: Body, scales: Sequence[float], transform: Array, apart: float
) -> list[NearestPoints]:
    """Return where two bodies at scales are nearest on their true faces, up to a distance, where a round one is."""
    band = apart + DEFAULT.snap * max(movable.size, static.size)
    band += DEEPER * sum(x * sum(deviation_of(body)) for x, body in zip(scales, (movable, static), strict=True))
    return nearest_on_faces([true_faces(movable), true_faces(static)], scales, transform, band)


def has_round_faces(problem: Problem) -> bool:
    """Tell whether faces of either part are told to stand for round ones."""
    return any(map(round_surfaces, problem.of_facets.bodies[:2]))


def met_by_facets_only(found: Solution) -> bool:
    """Tell whether parts that are to touch do so by their facets, and their true faces are as far apart as before."""
    asked = None if found.transform is None or found.problem.goal != "touch" else Exchange.of(found.problem)
    if asked is None or found.transform is None:
        return False
    slack = asked.facets.contact_slack
    ends = [asked.nearest(pose, slack) for pose in (np.eye(4), found.transform)]
    before, after = (near[0].gap if near else np.inf for near in ends)
    return bool(after > slack and after >= before - slack)


def points_of_true_faces(
    problem: Problem, solve: Callable[[Problem], Solution], refused: Callable[[Solution], bool]
) -> Points | None:
    """Return the points at which a problem's parts are to be exact, see `Problem.exact_at`; those it has among them.

    None where all faces are plane, where what they are is not known, or no motion is found so.

    `solve`: solves the same question about other parts. `refused`: tells whether a motion found so is no answer, as it
    leaves the fit.
    """
    asked = Exchange.of(problem)
    if asked is None:
        return None
    slack, points = asked.facets.contact_slack, asked.points
    drawn = asked.nearest(np.eye(4), slack)
    apart = problem.goal == "touch" and len(problem.weights) > 1 and all(own.gap > slack for own in drawn)
    if problem.exact_at is None:  # of parts that are apart at the nearest too: else plane faces may be what facets meet
        asked.add([own for own in drawn if apart or abs(own.gap) <= slack])
    cleared = problem.goal == "clear" or any(own.gap < -slack for own in drawn)  # parts within need no more than these
    deepest, least = np.inf, np.inf
    touching: tuple[float, Points] | None = None  # the amount after which they first do, to within what counts as that
    for count in range(ROUNDS):
        try:
            current = solve(asked.problem)
        except pacing.TimeOverError:
            if not count:
                raise
            return points  # what they lead to is looked at in what is left
        if touching and not (current.transform is not None and current.amount <= touching[0] + JUMP * slack):
            return touching[1]
        if current.transform is None:  # what parts within the true ones cannot do, these cannot
            asked.add_nearest(np.eye(4), current.pair_gap)  # of the parts as drawn
            return points if current.status is Status.INFEASIBLE and problem.goal == "clear" else None
        new = asked.new(asked.nearest(current.transform, -TIGHT * slack))
        worst = [own for own in new if own.gap < -TIGHT * slack]
        if cleared and not worst and refused(current):
            return points
        if worst and all(map(asked.has, worst)):  # no piece of the true solid is known there
            break
        met = asked.met(current.transform)  # their gap is told there
        if worst and worst[0].gap >= -slack and touching is None:
            touching = current.amount, asked.with_points(met)
        if not worst:
            asked.add(met)
            less = current.amount < least * (1.0 - DEFAULT.nominal)
            if apart and less and (near := asked.nearer(current)):
                least = current.amount
                asked.add(near)
                continue
            if current.pair_gap > slack:  # of parts within the true ones, which are nearer
                asked.add_nearest(current.transform, current.pair_gap)
            return points
        if not asked.foresee(np.array([*current.parameters.values()]), 1.0 if cleared else -1.0):
            asked.add(worst)
        if count % PATIENCE == PATIENCE - 1:
            if not -worst[0].gap < 0.5 * deepest:
                break
            deepest = -worst[0].gap
    return points if not worst or worst[0].gap >= -slack else None


def balanced_on_true_faces(problem: Problem, task: Task, answer: Answer, *, last: bool) -> Answer:
    """Return an answer with the least motion on true faces next to its own, where parts are exact at some points."""
    # between these the motion of the least amount is known only to the root of what an amount is known to. Before the
    # `last` one of several questions only where parts are to touch: to one that parts them, others lead as fast
    asked = Exchange.of(problem) if problem.exact_at and answer.q is not None else None
    if asked is None:
        return answer
    closes = task.must_touch and task.gap(task.rest) > 0.0
    q = asked.balanced(answer.motion, -1.0 if closes else 1.0) if closes or last else None
    slack = problem.contact_slack + sum(body.rounding for body in problem.bodies[:2])
    near = q is not None and abs(task.amount(q) - answer.amount) <= slack
    if q is None or not near or not (task.allows(q) and task.meets(q, DEFAULT.requirement)):
        return answer
    return replace(answer, q=q, amount=task.amount(q), lower_bound=min(answer.lower_bound, task.amount(q)))


def on_true_faces(scene: Scene) -> bool:
    """Tell whether answers are of the faces that facets stand for: of every two parts whose facets are off these."""
    off = [own for own in scene.relations.values() if gaps_off((own.movable, own.static)) != (0.0, 0.0)]
    return all(
        Exchange.of(touching_again(own) or own) is not None and all(map(all_recognised, (own.movable, own.static)))
        for own in off
    )


def exact_where(problem: Problem, q: Array, apart: float) -> Problem:
    """Return the same question with parts that are exact where their round faces overlap after a motion, (k,).

    And where they are nearest then, up to so far `apart` as facets say. The question itself where all faces are plane,
    where what they are is not known, or it comes to no end.
    """
    if (asked := Exchange.of(problem)) is None:
        return problem
    pose = problem.motion.transform(q, problem.movable.seed, problem.static.seed)
    done = any(not asked.refine(pose, None if count else apart) for count in range(ROUNDS))
    return asked.problem if done else problem


def _same(one: NearestPoints, two: NearestPoints, problem: Problem) -> bool:
    """Tell whether two points show the same: near each other, or on one line of contact of parts that only shift."""
    if norms(one.points[0] - two.points[0]) <= FAR * problem.size:
        return True
    alike = abs(one.gap - two.gap) <= problem.contact_slack and one.normal @ two.normal > 1.0 - DEFAULT.nominal
    return problem.motion.shifts and bool(alike)
