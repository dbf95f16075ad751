"""One frame of a report: bodies at two scales and a pose, with the decision curve there and the numbers that go along.

A `Frames` makes all frames of one case, so that feature labels and shapes are listed once. Bodies and the elements in
contact are plain arrays, in the coordinates that they are drawn in.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt import pacing
from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.segments import Box, middle
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import IDENTITY, Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.naming import element_text
from fcdm_opt.plain import drawn
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.show.contact_faces import with_whole_faces
from fcdm_opt.show.plots import reaching
from fcdm_opt.show.scene import COLOURS, ScenePieces, face_polygons, own_polygons, sharp_edges
from fcdm_opt.show.sections import Touching, touching
from fcdm_opt.show.texts import NOTHING, motion_text, parameter_texts
from fcdm_opt.show.verdict import poses_shown
from fcdm_opt.tolerances import DEFAULT

LATE = "what touches, and at which sizes, is left out for time"
Rows = dict[tuple[float, ...], int]  # points, each listed once, in the order in which they were first asked for


class Frames:
    """Makes the frames of one case.

    `window`, (2, 2), are the scales that are shown enlarged, which may reach beyond the problem's box; curves are
    listed over `box`, the scales of both.
    """

    def __init__(self, problem: Problem, window: ArrayLike) -> None:
        self._problem = problem
        self._rest = reaching(problem.curve, window)
        self._labels: dict[Feature, int] = {}
        self._touching: dict[Feature, int] = {}
        self._moved: tuple[Array | None, DecisionCurve] = None, self._rest
        self.box: Box = self._rest.box

    @property
    def labels(self) -> list[str]:
        """Labels of the features of all segments of all frames."""
        return [feature.label for feature in self._labels]

    @property
    def shapes(self) -> list[dict[str, Any]]:
        """What to draw for each feature that is in contact in some frame, or was asked for."""
        return [contact_shapes(self._problem, feature) for feature in self._touching]

    def shapes_of(self, features: Iterable[Feature]) -> list[int]:
        """Return the places of features in `shapes`."""
        return [self._touching.setdefault(feature, len(self._touching)) for feature in features]

    def solved(self, solution: Solution, note: str = "") -> dict[str, Any]:
        """Return the frame of a solution: the parts made where it puts them, or at rest where there is no motion."""
        return self.frame(
            solution.pair,
            solution.transform,
            solution.rho,
            motion=motion_text(solution),
            amount=solution.amount,
            gap=solution.pair_gap,
            parameters=parameter_texts(self._problem, solution.parameters),
            status=solution.status.name,
            usable=solution.usable,
            note=note,
        )

    def frame(
        self,
        sizes: Array,
        transform: Array | None = None,
        rho: Array | None = None,
        *,
        amount: float = 0.0,
        gap: float | None = None,
        target: Array | None = None,
        note: str = "",
        **more: Any,
    ) -> dict[str, Any]:
        """Return a frame of bodies shown at some scales, (2,), with a pose change of body 1, (4, 4), None at rest.

        `rho`, (2,), are the tracked contact's scales, `target`, (2,), the scales made, by default `sizes`; `gap` is the
        signed gap of the bodies shown, by default the decision curve's; `note` what else is to be said of it. Told are
        the "motion" in words, its "parameters", with units, and of a solution "status" and whether it is "usable".
        """
        curve = self._curve(transform)
        if gap is None or not math.isfinite(gap):
            gap = float(curve.gap(sizes, settled=False))
        state = self._state(gap)
        nothing = dict[Feature, list[Array]]()
        contacts = pacing.in_time(self._contacts, curve, sizes, late=nothing) if state == "touching" else nothing
        return {
            "sizes": drawn(sizes),
            "transform": None if transform is None else drawn(np.asarray(transform).ravel()),
            "curve": pacing.in_time(self._segments, curve, late=[]),
            "switching": pacing.in_time(self._switching, curve, late=[]),
            "contacts": drawn(list(map(_place, contacts.values()))),
            "shares": [list(map(drawn, shares)) for shares in contacts.values()],
            "contact": self.shapes_of(contacts),
            "target": drawn(sizes if target is None else target),
            "rho": None if rho is None or not np.isfinite(rho).all() else drawn(rho),
            "amount": drawn(amount),
            "pair_gap": drawn(0.0 if abs(gap) <= NOTHING * self._problem.size else gap),
            "pair_state": state,
            **{"status": None, "usable": None, "motion": "none", "parameters": [], **more},
            "note": "; ".join(filter(None, (note, LATE * pacing.over(), self._lost(curve, rho)))),
        }

    def _curve(self, transform: Array | None) -> DecisionCurve:
        """Return the decision curve after a motion; the last one is kept: the case as asked is shown several times."""
        if transform is None or (transform == IDENTITY).all():
            return self._rest
        last, curve = self._moved
        if last is None or not (transform == last).all():
            curve = decision_curve(*self._problem.active, box=self.box, transform=transform)
            self._moved = transform, curve
        return curve

    def _segments(self, curve: DecisionCurve) -> list[list[float]]:
        """Return both ends of each segment, the place of its feature in `labels`, and whether it is snug."""
        return [
            [*drawn((*each.start, *each.end)), self._labels.setdefault(each.feature, len(self._labels)), int(each.snug)]
            for each in curve.segments
        ]

    def _switching(self, curve: DecisionCurve) -> list[list[Any]]:
        """Return the switching points, numbered as in the problem's box; those beyond it have no number.

        Of large bodies none has: their curve is one of a few parts, whose numbers say nothing of the whole.
        """
        large = self._problem.partial
        if large or curve.box == self._problem.box:
            names = ("" if large else f"SW{point.index}" for point in curve.switching_points)
            return [[*drawn(point.rho), name] for point, name in zip(curve.switching_points, names, strict=True)]
        numbered = replace(curve, box=self._problem.box).switching_points
        known = {tuple(drawn(point.rho)): f"SW{point.index}" for point in numbered}
        places = [tuple(drawn(point.rho)) for point in curve.switching_points]
        return [[*place, known.get(place, "")] for place in places]

    def _state(self, gap: float) -> str:
        if abs(gap) <= self._problem.contact_slack:
            return "touching"
        return "apart" if gap > 0 else "overlapping"

    def _contacts(self, curve: DecisionCurve, sizes: Array) -> dict[Feature, list[Array]]:
        """Return the features at which the bodies shown touch, each with what two parts share of it, or nothing."""
        place = np.asarray(sizes)
        met = touching(curve, place)
        if not met:  # touching within `contact_slack`, which is wider than a place on the curve
            place = curve.nearest(place)
            near = bool((np.abs(place - sizes) <= DEFAULT.snap * np.abs(sizes)).all())
            met = touching(curve, place) if near else []
        sets: dict[Feature, list[Array]] = {}
        for contact, corners in met:
            (feature,) = with_whole_faces(self._problem, [contact.feature], curve.transform)
            sets.setdefault(feature, []).append(corners)
        return sets

    def _lost(self, curve: DecisionCurve, rho: Array | None) -> str:
        """Tell where the tracked features are not the contact that there is."""
        if rho is None or self._problem.goal not in TRACKING:
            return ""
        if not (np.isfinite(rho).all() and min(rho) > 0):
            return "the tracked features meet at no pair of scales here"
        state = self._state(curve.near_gap(rho, self._problem.contact_slack))
        if state == "touching":
            return ""
        return f"the tracked features are not the contact here: at their scales the bodies are {state}"


def _place(shares: list[Array]) -> Array:
    """Return a point of a contact from what each two parts share of it.

    The middle of a contact that goes round a hole lies on neither body: the part of it nearest to the middle has one.
    """
    whole = middle(shares)
    return min((share.mean(axis=0) for share in shares), key=lambda point: float(np.linalg.norm(point - whole)))


def scene(problem: Problem, pieces: ScenePieces) -> dict[str, Any]:
    """Return all bodies of a problem as triangles and true edges; keep-outs at their largest scale.

    The first two are shown at scales about their `seed`, the others as they are; seen, and cut, as in `pieces`.
    """
    parts = [("movable", problem.movable), ("static", problem.static)]
    keep_outs = [("keep-out", keep_out.body.scaled(keep_out.ends[1])) for keep_out in problem.keep_out]
    objects = [{"name": own.name, **_solid(k, role, own)} for k, (role, own) in enumerate([*parts, *keep_outs])]
    return {"size": problem.size, "objects": objects, **_seen(pieces)}


def _seen(pieces: ScenePieces) -> dict[str, Any]:
    return {"view": list(pieces.view), "section": drawn(pieces.facing), "cut": pieces.cut}


def _solid(number: int, role: str, body: Body) -> dict[str, Any]:
    """Return a body as triangles and true edges."""
    rows, body = Rows(), body.of_facets
    triangles = _triangles(rows, own_polygons(body))
    edges = [_rows(rows, ends) for ends in sharp_edges(body)]
    shape = {"points": drawn(list(rows)), "triangles": triangles, "edges": edges, "seed": drawn(body.seed)}
    return {"body": number, "role": role, **shape}


def assembly_scene(solution: AssemblySolution, contacts: Sequence[Touching], pieces: ScenePieces) -> dict[str, Any]:
    """Return what scripts draw of an assembly: its parts in their colours, as made and after their motions."""
    assembly = solution.assembly
    roles = ("static" if part in assembly.fixed else "movable" for part in assembly.parts)
    shown = [*zip(assembly.parts, roles, assembly.bodies_made.values(), strict=True)]
    shown += [(keep_out.name, "keep-out", keep_out.body) for keep_out in assembly.keep_out]
    objects = [
        {"name": name, "colour": COLOURS[k % len(COLOURS)], **_solid(k, role, own)}
        for k, (name, role, own) in enumerate(shown)
    ]
    moved = poses_shown(solution)[0]
    poses = [moved.get(part) if part in assembly.motions else None for part in assembly.parts]
    transforms = [None if pose is None else drawn(np.ravel(pose)) for pose in poses]
    rest = [None] * len(poses) if solution.usable else transforms
    overlaps = [piece for each in contacts if each.is_overlap for piece in each.pieces]
    made = {
        "sizes": [assembly.scales[part] for part in assembly.parts], "transforms": rest,
        "overlap": drawn(np.concatenate(overlaps)) if overlaps else [],
    }  # fmt: skip
    after = {
        "transforms": transforms,
        "contacts": [drawn(each.middle) for each in contacts],
        "shares": [list(map(drawn, each.pieces)) for each in contacts],
    }
    return {
        "name": assembly.name,
        "scene": {"size": assembly.size, "objects": objects, **_seen(pieces)},
        "normal": drawn(contacts[0].normal if contacts else np.eye(3)[2]),
        "poses": {"rescaled": made, "corrected": {**made, **after} if solution.usable else None},
        "feature_shapes": [],
    }


def contact_shapes(problem: Problem, feature: Feature) -> dict[str, Any]:
    """Return label and shapes of a feature, vertices and edges as points, faces as triangles."""
    bodies = (problem.movable, feature.one), (problem.static, feature.two)
    return {"label": feature.label, "shapes": [{"body": k, **_shape(*each)} for k, each in enumerate(bodies)]}


def _shape(body: Body, element: Element) -> dict[str, Any]:
    rows, triangles = Rows(), list[list[int]]()
    if element.kind == "F":
        triangles = _triangles(rows, face_polygons(body, element))
    else:
        _rows(rows, body.vertices[np.array(element.vertices) - 1])
    name = f"{element_text(body, element).partition(' (facing')[0]} of {body.name or 'a part'}"
    return {"kind": element.kind, "points": drawn(list(rows)), "triangles": triangles, "name": name}


def _rows(known: Rows, corners: Array) -> list[int]:
    """Return the rows of points (k, 3); new ones are listed."""
    return [known.setdefault(tuple(corner), len(known)) for corner in (corners + 0.0).tolist()]  # -0.0 and 0.0 are one


def _triangles(known: Rows, polygons: Iterable[Array]) -> list[list[int]]:
    """Return the triangles of convex polygons, each about its first corner."""
    loops = [_rows(known, polygon) for polygon in polygons]
    return [[loop[0], loop[k], loop[k + 1]] for loop in loops for k in range(1, len(loop) - 1)]
