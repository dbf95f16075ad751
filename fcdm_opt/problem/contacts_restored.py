"""Contacts as drawn of round parts: whether the least motion after which parts touch restores them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import deviation_of, round_surfaces
from fcdm_opt.geometry.patches import nearest_on_faces, patches_of_element, true_faces
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT


def touching_again(problem: Problem) -> Problem | None:
    """Return the question of goal "touch" about parts whose round faces touch as drawn; None for other questions.

    All motions that restore these contacts are answers to it: where the least one restores them, it is the least of
    these too, see `restores`. Of shifts, by which what touches along a line does so again, and of contacts which a
    round face takes part in.
    """
    drawn = [problem.drawn[role] for role in ("movable", "static")]
    asked = problem.of_facets
    restored = asked.goal in ("at", "seat") and len(asked.contacts) == len(asked.nominal_joints) > 0
    if not (
        restored and asked.motion.shifts and asked.resolution is None and any(map(round_surfaces, asked.bodies[:2]))
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
    asked, slack = problem.of_facets, problem.contact_slack
    drawn, made = ([own[role] for role in ("movable", "static")] for own in (asked.drawn, asked.bodies_made))

    def pairs(bodies: Sequence[Body], scales: Array, pose: Array) -> list[set[tuple[int, int]]]:
        faces = [true_faces(body) for body in bodies]
        band = slack + sum(scale * sum(deviation_of(own)) for scale, own in zip(scales.tolist(), bodies, strict=True))
        near = nearest_on_faces(faces, scales, pose, band + DEFAULT.snap * asked.size)
        touching = [own.points for own in near if abs(own.gap) <= slack]
        return [{*product(faces[0].at(one), faces[1].at(two))} for one, two in touching]

    before, after = pairs(drawn, asked.nominal_pair, np.eye(4)), pairs(made, asked.target, transform)
    known, again = (set[tuple[int, int]]().union(*own) for own in (before, after))
    labels = [[patches_of_element(*own) for own in zip(drawn, (x.one, x.two), strict=True)] for x in asked.contacts]
    alike = all(len(true_faces(x).patches) == len(true_faces(y).patches) for x, y in zip(drawn, made, strict=True))
    found = all(known.intersection(product(*own)) for own in labels)  # facets may touch where true faces overlap
    return alike and bool(before) and found and all(own & again for own in before)
