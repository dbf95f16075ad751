"""Contacts as drawn of round parts: the least shift that restores them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve.true_sizes import contacts_as_drawn
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import deviation_of, round_surfaces
from fcdm_opt.geometry.patches import NearestPoints, nearest_on_faces, patches_of_element, true_faces
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

RESTORED = "1: linear equations of the contacts of true faces"
ROUNDS = 10  # of Newton's method: one where a face of each pair that meets is plane
NEAR = DEFAULT.snap, 1e-3, 0.05  # of the size: how far apart faces are looked at, one after another

Pairs = set[tuple[int, int]]
"""True faces of either body that meet in a point, by number."""


def touching_again(problem: Problem) -> Problem | None:
    """Return the question of goal "touch" about parts whose round faces touch as drawn; None for other questions.

    All motions that restore these contacts are answers to it: where the least one restores them, it is the least of
    these too, see `restores`. Of shifts, by which what touches along a line does so again, and of contacts which a
    round face takes part in.
    """
    drawn = [problem.drawn[role] for role in ("movable", "static")]
    asked = problem.of_facets
    whole = len(asked.contacts) == len(asked.nominal_joints) > 0 or asked.touches_between_facets
    if not (
        asked.goal in ("at", "seat")
        and whole
        and asked.motion.shifts
        and asked.resolution is None
        and any(map(round_surfaces, asked.bodies[:2]))
    ):
        return None
    for feature in (joint.feature for joint in asked.chosen_joints):
        both = zip(drawn, (feature.one, feature.two), strict=True)
        if not any(true_faces(body).is_round[[*patches_of_element(body, own)]].any() for body, own in both):
            return None
    return asked.to_touch()


def restores(problem: Problem, transform: Array) -> bool:
    """Tell whether the true faces that touch as drawn, a round one among each two, touch after a motion of parts made.

    False where none touch as drawn.
    """
    before, made = _met_as_drawn(problem), problem.of_facets.bodies_made
    slack, target = problem.contact_slack, problem.of_facets.target
    after = [own for own, met in _met([*made.values()], target, transform, problem) if abs(met.gap) <= slack]
    return bool(before) and all(own & Pairs().union(*after) for own in before)


class RestoringShift(NamedTuple):
    """The least shift after which true faces that touch as drawn touch again.

    Attributes
    ----------
    q : (k,) array or None
        Motion parameters; None where no shift does it, as the gaps, linear in them, are not closed together.
    points : list of list of NearestPoints
        Of each question where they touch then.
    bound : float
        Least amount of all that do: gaps of plane faces are linear in shifts, and no smaller shift closes these.
    """

    q: Array | None
    points: list[list[NearestPoints]]
    bound: float


def restoring_shift(asked: Sequence[Problem]) -> RestoringShift | None:
    """Return the least shift that restores the contacts as drawn of questions that `touching_again` answers.

    By Newton's method on their gaps, the least step of all that close them. None where it is not found.

    Parameters
    ----------
    asked : sequence of Problem
        Of two parts each, about the same motions.
    """
    asked = [own.of_facets for own in asked]
    first, before = asked[0], [_met_as_drawn(own) for own in asked]
    if not all(before) or any(own.amount != "weighted" for own in asked):
        return None
    y = np.zeros(len(first.weights))
    for _ in range(ROUNDS):
        q, points, rates = y / first.weights, list[list[NearestPoints]](), list[Array]()
        for own, met in zip(asked, before, strict=True):
            points.append(_nearest(own, met, q))
            shifts = own.motion.ways(own.movable.seed, own.static.seed) / first.weights[:, None]
            rates += [-shifts @ one.normal for one in points[-1]]
        gaps, slopes = np.array([one.gap for own in points for one in own]), np.array(rates)
        if not all(points):
            return None
        plane = np.array([_is_plane(own, one) for own, its in zip(asked, points, strict=True) for one in its])
        if np.abs(gaps).max() <= min(own.contact_slack for own in asked) * DEFAULT.tie / DEFAULT.touch:
            inside = (first.limits[:, 0] <= q) & (q <= first.limits[:, 1])
            held = slopes[plane]
            bound = float(np.linalg.norm(np.linalg.pinv(held, rcond=DEFAULT.nominal) @ (held @ y)))
            return RestoringShift(q, points, bound) if inside.all() else None
        further = np.linalg.pinv(slopes, rcond=DEFAULT.nominal) @ (slopes @ y - gaps)
        if np.abs(gaps + slopes @ (further - y)).max() > max(own.contact_slack for own in asked):
            return RestoringShift(None, points, np.inf) if plane.all() else None
        y = further
    return None


def _nearest(problem: Problem, before: Sequence[Pairs], q: Array) -> list[NearestPoints]:
    """Return where faces that touch as drawn are nearest after a motion of the parts made; none where one is not."""
    pose = problem.motion.transform(q, problem.movable.seed, problem.static.seed)
    made = [*problem.bodies_made.values()]
    for share in NEAR:
        found = [*_met(made, problem.target, pose, problem, share)]
        each = [[own for pairs, own in found if pairs & met] for met in before]
        if all(each):
            return [min(own, key=lambda one: one.gap) for own in each]
    return []


def _is_plane(problem: Problem, met: NearestPoints) -> bool:
    """Tell whether a plane face touches there, along its normal, whatever the other one is."""
    faces = [true_faces(own) for own in problem.bodies_made.values()]
    return any(
        not own.is_round[k] and abs(own.patches[k].gaps(point[None])[1][0] @ met.normal) > 1.0 - DEFAULT.nominal
        for own, point in zip(faces, met.points, strict=True)
        for k in own.at(point)
    )


def _met_as_drawn(problem: Problem) -> list[Pairs]:
    """Return which true faces touch as drawn, a round one among each two; none where sizes change what faces there are.

    Each contact of the question is to be among them: facets may touch where true faces overlap.
    """
    asked = problem.of_facets
    drawn, made = ([own[role] for role in ("movable", "static")] for own in (asked.drawn, asked.bodies_made))
    met = [{*own.pairs} for own in contacts_as_drawn(drawn[0], drawn[1], asked.nominal_pair, DEFAULT.snap * asked.size)]
    known = Pairs().union(*met)
    labels = [[patches_of_element(*own) for own in zip(drawn, (x.one, x.two), strict=True)] for x in asked.contacts]
    alike = all(len(true_faces(x).patches) == len(true_faces(y).patches) for x, y in zip(drawn, made, strict=True))
    return met if alike and all(known.intersection(product(*own)) for own in labels) else []


def _met(
    bodies: Sequence[Body], scales: Array, pose: Array, problem: Problem, share: float = DEFAULT.snap
) -> Iterator[tuple[Pairs, NearestPoints]]:
    """Yield which true faces come near each other where, a round one among each two, up to a share of the size."""
    faces = [true_faces(body) for body in bodies]
    off = sum(scale * sum(deviation_of(own)) for scale, own in zip(scales.tolist(), bodies, strict=True))
    for own in nearest_on_faces(faces, scales, pose, problem.contact_slack + off + share * problem.size):
        yield {*product(faces[0].at(own.points[0]), faces[1].at(own.points[1]))}, own
