"""Gaps of contacts as drawn, row by row: affine in the sizes, and in the parameters of motions that only shift.

A row is the separation, at the scales made, of the two elements that touch as drawn, along their normal: of bodies cut
into parts or kept as surfaces, of two parts or all those of an assembly that are to meet.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from operator import itemgetter
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.coherence import Tracked
from fcdm_opt.curve.contact import Joint, true_faces_met
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.touching_sizes import PairRows, TouchingSizes, least_of
from fcdm_opt.curve.true_sizes import ROLES, SizedFaces, contacts_as_drawn, ends_of_line
from fcdm_opt.design.sizes import SCALES, Sizes
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import is_plane_there
from fcdm_opt.geometry.patches import TrueFaces, true_faces
from fcdm_opt.geometry.resizing import resizing_of, vertex_rates
from fcdm_opt.geometry.size import Size
from fcdm_opt.judge.sampled_sizes import GapClaims
from fcdm_opt.model.equations import E1E2, F1V2, V1F2, FeaturePoints, feature_points
from fcdm_opt.model.task import Task, lines_of
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.tolerances import DEFAULT

ENDS = {F1V2: (0, 3), E1E2: (0, 2)}  # a point of either body in `FeaturePoints.points`; else the first and the second
_STILL = np.empty((3, 0)), np.empty((3, 0))


class _Line(NamedTuple):
    """A row's contact: whose it is, and how its elements move a unit of each of the pair's sizes, (3, k) each."""

    relation: int
    feature: Feature
    line: FeaturePoints | _TruePoints
    moves: tuple[Array, Array]


class _TruePoints(NamedTuple):
    """Points with which true faces touch as drawn, (2, 3), and their normal from body 1 to body 2.

    The normal is `turned` with body 1 whose face is the plane one; `pairs` are the true faces that meet, by number in
    `true_faces`.
    """

    points: Array
    normal: Array
    turned: bool
    parts: tuple[int, int]
    pairs: frozenset[tuple[int, int]]

    def at(self, movable: Body, static: Body, transform: Array) -> tuple[Array, Array]:
        """Return the normal and the contact line, (a, b, c), at a pose of body 1, (4, 4)."""
        R, moved = transform[:3, :3], transform[:3, :3] @ movable.seed + transform[:3, 3]
        n, off = R @ self.normal if self.turned else self.normal, self.points - [movable.seed, static.seed]
        return n, np.array([n @ R @ off[0], -n @ off[1], n @ (static.seed - moved)])


class AffineGaps(NamedTuple):
    """Rows at a pose: gap with sizes of 0 and rate by each size, (m, 1 + k); normals from body 1 to body 2, (m, 3)."""

    values: Array
    normals: Array

    def heights(self, sizes: Array) -> Array:
        """Return the gap of each row at sizes, (m, n)."""
        return np.asarray(self.values[:, :1] + self.values[:, 1:] @ np.asarray(sizes, float).T)

    def gaps(self, sizes: Array) -> Array:
        """Return the least gap of all contacts at sizes, (n,)."""
        return np.asarray(self.heights(sizes).min(axis=0))


class Extreme(NamedTuple):
    """An extreme gap: its sizes, where it is taken, by which part pair, along which direction (from body 1 to 2)."""

    gap: float
    rho: Array
    parts: tuple[int, int]
    way: Array


class Extremes(NamedTuple):
    """The least and the largest gap over all sizes; `doubt`: no gap is larger than the largest by more."""

    least: Extreme
    most: Extreme
    doubt: float = 0.0


class ContactGaps:
    """The contacts of a question as drawn, with all sizes that its parts may have.

    `relations` are the two parts each contact is of, in the parameters of all motions, and `names` those of the sizes:
    scales of parts, or the question's own. Relative tolerances refer to the length `size`. Where none are `needed`
    parts may touch nowhere.
    """

    permanent: Mapping[tuple[int, int], Feature] = MappingProxyType({})  # all contacts count
    permanent_in_words = ()
    covers = True

    def __init__(self, scene: Scene, sizes: Sizes, names: Sequence[str], *, own: bool, needed: bool = True) -> None:
        self.sizes, self.names, self.size, self.own = sizes, tuple(names), scene.size, own
        asked = {pair: own for pair, own in relations_of(scene).items() if pair == SCALES or own.goal != "clear"}
        self.relations = tuple(asked.values())
        self.columns = [columns_of(pair, relation, names, own=own) for pair, relation in asked.items()]
        self.tasks, self.lines = list[Task](), list[_Line]()
        for k, relation in enumerate(self.relations):
            rounds = [*_round_lines(k, relation, own=own)]
            pairs, chosen = [_pairs_of(line.line) for line in rounds], set[int]()
            task = Task.of(_restoring(relation, own=own, touching=bool(rounds) or not needed))
            for joint in task.joints:
                met = true_faces_met(joint.feature, task.movable, task.static) if rounds else ((), ())
                mine = {n for n, own_pairs in enumerate(pairs) if own_pairs & {*product(*met)}}
                chosen |= mine
                self.lines += () if mine else [
                    _Line(k, joint.feature, line, _moves(relation, task, line) if own else _STILL)
                    for line in _lines(task, joint)
                ]  # fmt: skip
            every = not relation.contacts or len(relation.contacts) == len(relation.nominal_joints)
            self.lines += [line for n, line in enumerate(rounds) if n in chosen or every]
            self.tasks.append(task)
        if needed and not self.lines:
            why = by_contacts(scene) or "contacts as drawn are looked at"
            what = f"{why}, and here are none of flat faces, or of round ones of solids cut into parts"
            allowed = "such parts: coarser meshes are cut"
            if not asked:
                what, allowed = 'all parts are to be kept apart, goal "clear"', 'one contact of goal "at" or "seat"'
            raise InputError(what, key="contacts", allowed=allowed)

    def transforms(self, q: Array) -> list[Array]:
        """Return the pose of body 1 of each relation."""
        return [own.motion.transform(q, own.movable.seed, own.static.seed) for own in self.relations]

    def rows(self, transforms: Sequence[Array]) -> AffineGaps:
        """Return the rows at the pose of body 1 of each relation, (4, 4)."""
        values, normals = np.zeros((len(self.lines), 1 + len(self.names))), np.empty((len(self.lines), 3))
        poses = [relative_pose(own.movable, own.static, T) for own, T in zip(self.tasks, transforms, strict=True)]
        for row, (k, _, line, (one, two)) in enumerate(self.lines):
            task, R = self.tasks[k], transforms[k][:3, :3]
            if isinstance(line, _TruePoints):
                normal, (a, b, c) = line.at(task.movable, task.static, transforms[k])
            else:
                at = Tracked.at(task.movable, task.static, poses[k], line.parts, line.site, line.sign)
                normal, (a, b, c) = at.normal, at.line.tolist()
            rho = self.relations[k].target
            normals[row], values[row, 0] = normal, c - rho @ (a, b) if self.own else c
            rates = rho[1] * (normal @ two) - rho[0] * (normal @ R @ one) if self.own else np.array([-a, -b])
            values[row, 1 + np.array(self.columns[k], int)] = rates
        return AffineGaps(values, normals)

    def ends(self, rows: AffineGaps) -> tuple[Array, Array]:
        """Return the least and the largest gap of each row over all sizes, (m,) each."""
        if self.sizes.pairs is not None:
            heights = rows.heights(self.sizes.pairs)
            return heights.min(axis=1), heights.max(axis=1)
        middle, half = rows.heights(self.sizes.middle[None])[:, 0], np.abs(rows.values[:, 1:]) @ self.sizes.half
        return middle - half, middle + half

    def extremes(self, rows: AffineGaps) -> Extremes:
        """Return the least and the largest gap over all contacts and sizes."""
        lows, highs = self.ends(rows)

        def end(row: int, gap: float, sign: float) -> Extreme:
            rates = rows.values[row, 1:]
            if self.sizes.pairs is not None:
                place = self.sizes.pairs[np.abs(rows.heights(self.sizes.pairs)[row] - gap).argmin()]
            else:
                drawn = np.clip(0.0 if self.own else 1.0, *self.sizes.box.T)
                place = np.where(rates, self.sizes.middle + sign * np.sign(rates) * self.sizes.half, drawn)
            return Extreme(gap, frozen(place), self._parts(self.lines[row]), frozen(rows.normals[row]))

        low, high = int(lows.argmin()), int(highs.argmax())
        return Extremes(end(low, float(lows[low]), -1.0), end(high, float(highs[high]), 1.0))

    def feature(self, rows: AffineGaps, extreme: Extreme) -> Feature:
        """Return the contact that has an extreme."""
        off = np.abs(rows.heights(extreme.rho[None])[:, 0] - extreme.gap)
        return self.lines[int(off.argmin())].feature

    @property
    def contacts(self) -> dict[tuple[int, Feature], list[int]]:
        """The rows of each contact, by its relation and feature."""
        found = dict[tuple[int, Feature], list[int]]()
        for row, own in enumerate(self.lines):
            found.setdefault((own.relation, own.feature), []).append(row)
        return found

    def ranges(self, rows: AffineGaps) -> dict[str, tuple[float, float]]:
        """Return the range of the gap of each contact over all sizes, by its words."""
        ends = np.array(self.ends(rows))
        ends[np.abs(ends) <= DEFAULT.weld * self.size] = 0.0
        return {
            self.words(*of): (float(ends[0, own].min()), float(ends[1, own].max())) for of, own in self.contacts.items()
        }

    def met_along(self, rows: AffineGaps, slopes: Array, fits: Array) -> tuple[Array, dict[tuple[int, Feature], str]]:
        """Return what makes of all rows those that shifts close, (m, m), and why of a contact they may not close one.

        A round part in a round recess of its own radius, as drawn in contact in many directions: the gap along n is
        a + n (w + S q), by the play a of the radii. Shifts along one line, w along it, close it there, and nowhere
        else where a > 0. `slopes`, (m, q): of the rows, by the motions; those of `fits`, (m, f), stay as they are.
        """
        found, why, shape = np.eye(len(self.lines)), dict[tuple[int, Feature], str](), rows.values.shape[1]
        for (k, feature), every in self.contacts.items():
            lines = [line for row in every if isinstance(line := self.lines[row].line, _TruePoints)]
            own = np.array([row for row in every if not fits[row].any()], np.int64)
            form = np.column_stack([np.ones(len(every)), rows.normals[every]])
            ranks = [np.linalg.matrix_rank(part, tol=DEFAULT.snap) for part in (form, form[:, 1:])]
            turns = not all(relation.motion.shifts for relation in self.relations)
            if turns or len(lines) < len(every) or not len(own) or ranks[0] == ranks[1]:  # as of cones
                continue
            points = np.reshape([line.points for line in lines], (len(lines), 6))
            inverse, given = np.linalg.pinv(form), np.hstack([rows.values[every], slopes[every], points])
            known = inverse @ given
            if np.abs(form @ known - given).max() > DEFAULT.snap * self.size:
                continue
            play, moved, shifts = known[0, :shape], known[1:, :shape], known[1:, shape:-6]
            lines_of_shift, amounts, _ = np.linalg.svd(shifts)
            n, near, most = lines_of_shift[:, 0], DEFAULT.touch * self.size, np.abs(self.sizes.box).max(axis=1)
            across = np.abs(moved - np.outer(n, n @ moved)) @ np.append(1.0, most)
            faces = [true_faces(self.relations[k].request[role]) for role in ROLES]
            ends = [along for along in (np.append(1.0, n), np.append(1.0, -n))
                    if _meet_at(faces, lines[0].pairs, (along @ known[:, -6:]).reshape(2, 3))]  # fmt: skip
            if play[0] + play[1:] @ self.sizes.middle - np.abs(play[1:]) @ self.sizes.half < -near:
                why[k, feature] = "sizes may make the inner one wider than its recess, where it jams"
            elif np.count_nonzero(amounts > DEFAULT.nominal) != 1:
                why[k, feature] = "shifts in several directions close it at no one place"
            elif across.max() > near:
                why[k, feature] = "sizes move it across the motion"
            elif len(ends) != 1:
                why[k, feature] = "along the motion the faces do not meet"
            else:
                found[own] = 0.0
                found[own[:, None], every] = ends[0] @ inverse
        return found, why

    @property
    def of_facets(self) -> tuple[Body, ...]:
        """Bodies with a contact neither of plane faces nor of points at which round ones touch as drawn."""
        found = dict[Body, None]()
        for task, own in ((self.tasks[own.relation], own) for own in self.lines):
            both = (task.movable, own.feature.one), (task.static, own.feature.two)
            if not (isinstance(own.line, _TruePoints) or all(is_plane_there(*each) for each in both)):
                found |= dict.fromkeys(body for body, _ in both)
        return tuple(found)

    def words(self, relation: int, feature: Feature) -> str:
        """Return a contact in words."""
        return feature.in_words(self.tasks[relation].movable, self.tasks[relation].static)

    def in_words(self, feature: Feature) -> str:
        """Return the contact of a feature in words."""
        return self.words(next(own.relation for own in self.lines if own.feature is feature), feature)

    def claim(self, relation: Problem, columns: list[int], transform: Array) -> GapClaims:
        """Return the claims of two parts without what is told of their gap."""
        movable, static = (relation.at_scales if self.own else relation.bodies_made).values()
        listed = self.sizes.pairs
        return GapClaims(
            bodies=(movable, static),
            sizes=relation.sizes if self.own else (),
            transform=transform,
            box=self.sizes.box[columns],
            listed=None if listed is None else listed[:, columns],
            permanent_faces=None if self._pairs_met(relation) is None else frozenset(),
        )

    def _pairs_met(self, relation: Problem) -> dict[Feature, frozenset[tuple[int, int]]] | None:
        """Return which true faces meet in each contact of two parts; None where no round one does."""
        k = next((k for k, own in enumerate(self.relations) if own is relation), -1)
        mine = {own.feature: _pairs_of(own.line) for own in self.lines if own.relation == k}
        if not any(mine.values()):
            return None
        bodies = self.tasks[k].movable, self.tasks[k].static
        return {own: met or frozenset(product(*true_faces_met(own, *bodies))) for own, met in mine.items()}

    def claims(self, transforms: Sequence[Array]) -> list[GapClaims]:
        """Return what `verify` looks at: the gap of each contact over all sizes."""
        rows, found = self.rows(transforms), list[GapClaims]()
        for (k, feature), own in self.contacts.items():
            claim = self.claim(self.relations[k], self.columns[k], transforms[k])
            gaps = AffineGaps(rows.values[own][:, [0, *(1 + column for column in self.columns[k])]], rows.normals[own])
            least, largest = range_of(gaps, claim.box, claim.listed)
            contact = feature, self._parts(self.lines[own[0]]), rows.normals[own[0]]
            if (met := self._pairs_met(self.relations[k])) is not None:  # each contact without all other faces
                one, two = (range(len(true_faces(body).patches)) for body in claim.bodies)
                claim = replace(claim, permanent_faces=frozenset(product(one, two)) - met[feature])
            name = self.words(k, feature) if len(self.contacts) > 1 else ""
            found.append(replace(claim, least=least, largest=largest, told=gaps.gaps, contact=contact, name=name))
        return found

    def whole_parts(self) -> Iterator[tuple[int, Problem, list[int]]]:
        """Yield each relation of solids that touch at flat faces alone, whose convex parts tell overlap anywhere."""
        for k, (relation, columns) in enumerate(zip(self.relations, self.columns, strict=True)):
            flat = any(own.relation == k for own in self.lines) and self._pairs_met(relation) is None
            if flat and not any(body.is_surface for body in (relation.movable, relation.static)):
                yield k, relation, columns

    def _parts(self, own: _Line) -> tuple[int, int]:
        """Return the part pair of a row, by number in the whole bodies."""
        task, (i, j) = self.tasks[own.relation], own.line.parts
        return _whole(task.movable, i), _whole(task.static, j)

    def touching(self, rows: AffineGaps, transform: Array, relation: int = 0) -> TouchingSizes:
        """Return the rows of one relation's contacts, at the pose of its body 1, as those of a stack-up."""
        pairs, task = [], self.tasks[relation]
        for (k, feature), own in self.contacts.items():
            if k == relation:
                parts = self.lines[own[0]].line.parts
                pairs.append(PairRows(parts, rows.values[own], rows.normals[own], [], [feature] * len(own)))
        bodies, sizes = (task.movable, task.static), self.relations[relation].sizes
        return TouchingSizes(bodies, sizes, transform, tuple(pairs), (np.inf, ""), as_drawn=True)


def _pairs_of(line: FeaturePoints | _TruePoints) -> frozenset[tuple[int, int]]:
    """Return which true faces meet with a round one; none of a line of facets."""
    return line.pairs if isinstance(line, _TruePoints) else frozenset()


def _meet_at(faces: Sequence[TrueFaces], pairs: frozenset[tuple[int, int]], points: Array) -> bool:
    """Tell whether a point of each body, (2, 3), is on its patch, of one of some pairs of these."""
    each = (zip(faces, pair, points, strict=True) for pair in pairs)
    return any(all(own.has_points(patch, x[None])[0] for own, patch, x in met) for met in each)


def by_contacts(scene: Scene, *, named: bool = True) -> str:
    """Return why a question about all sizes looks at contacts as drawn, not at the gap of whole bodies; "" if not."""
    # with `named` because it names them, too
    if not isinstance(scene, Problem):
        return "an assembly is of contacts"
    if named and (scene.contacts or scene.goal == FIT):
        return "contacts are named"
    if scene.partial:
        return "not all parts of the bodies are looked at"
    turning = (own for own in scene.sizes if not own.is_length and own.scale != "xyz")
    return next((told for own in turning if (told := resizing_of(scene.request[own.body], (own,)).inclined())), "")


def relations_of(scene: Scene) -> dict[tuple[str, str], Problem]:
    """Return what is asked of every two parts, by their names; of two bodies by those of their scales."""
    return {SCALES: scene} if isinstance(scene, Problem) else dict(scene.relations)


def columns_of(pair: tuple[str, str], relation: Problem, names: Sequence[str], *, own: bool) -> list[int]:
    """Return which of all sizes two parts have: their own, by name, or their scales."""
    return [names.index(name) for name in ([size.name for size in relation.sizes] if own else pair)]


def _restoring(relation: Problem, *, own: bool, touching: bool = False) -> Problem:
    """Return the question of two parts as drawn that restores all contacts they have, if it names none."""
    # where none of their facets touch, itself as drawn where their true faces are `touching`
    asked: dict[str, Any] = {"made": {}} if own and relation.sizes else {}
    if not relation.contacts:
        pair = relation.nominal_pair.tolist()
        plain = dict.fromkeys(("path", "features", "requirement", "tolerance"))
        asked |= {"goal": "at", "contacts": "all", "pair": "any", "target": pair, **plain}
    try:
        return relation.changed(**asked) if asked else relation
    except InputError as reason:
        if touching:
            return relation.changed(made={}) if own and relation.sizes else relation
        what = f"{by_contacts(relation, named=False) or 'an assembly is of contacts'}, and here are none as drawn"
        raise InputError(what, key="contacts", found=reason.what, allowed="parts that touch as drawn") from reason


def _round_lines(k: int, relation: Problem, *, own: bool) -> Iterator[_Line]:
    """Yield the contacts of a relation as drawn with round faces; none of sizes that make something else of these."""
    # of a straight line of contact its middle, or where the motion turns its ends
    drawn = relation.request if own else vars(relation.of_facets)
    bodies, sizes = (drawn["movable"], drawn["static"]), relation.sizes if own else ()
    if any(body.is_surface for body in bodies) or any(size.scale not in (None, "xyz") for size in sizes):
        return
    try:
        moving = [SizedFaces.of(body, role, sizes) for body, role in zip(bodies, ROLES, strict=True)]
    except InputError:
        return
    scales, faces = np.ones(2) if own else relation.nominal_pair, [moved.faces for moved in moving]
    for met in contacts_as_drawn(*bodies, scales, DEFAULT.snap * relation.size):
        elements = [own.element_at(patches, x) for own, patches, x in zip(faces, met.patches, met.points, strict=True)]
        parts = [
            next((n for n, part in enumerate(body.parts) if part.carriers(element)), 0)
            for body, element in zip(bodies, elements, strict=True)
        ]
        turned = len(met.patches[0]) == 1 and faces[0].patches[met.patches[0][0]].surface.flat
        for points in [met.points] if relation.motion.shifts else ends_of_line(met, faces, scales, np.eye(4)):
            moves = [np.zeros((3, len(sizes))) for _ in ROLES]
            for role, patches in enumerate(met.patches):
                moves[role][:, moving[role].columns] = moving[role].move_at(points[role], patches)
            line = _TruePoints(points, met.normal, turned, (parts[0], parts[1]), met.pairs)
            yield _Line(k, Feature(*elements), line, (moves[0], moves[1]))


def _lines(task: Task, joint: Joint) -> list[FeaturePoints]:
    """Return the lines of a contact: on a face that along its normal, of each corner on it where the motion turns."""
    movable, static = task.movable, task.static
    lines = [*lines_of(movable, static, joint)]
    if "F" not in joint.feature.kind:
        return lines
    found, n = dict[tuple[int, ...], FeaturePoints](), joint.normals[0]
    for i, j in joint.carriers if not task.motion.shifts else ():
        parts = movable.parts[i], static.parts[j]
        for kind, face in ((F1V2, 0), (V1F2, 1)):
            held, other, out = parts[face], parts[1 - face], (-n, n)[1 - face]
            k = int((held.normals @ out).argmax())
            corners = held.vertices[list(held.loops[k])]
            inward = np.cross(out, np.roll(corners, -1, axis=0) - corners)
            apart = other.vertices[:, None] - corners
            inside = np.einsum("vkx,kx->vk", apart, inward).min(axis=1) >= -DEFAULT.snap * task.size**2
            for v in np.flatnonzero(inside & (np.abs(apart[:, 0] @ out) <= DEFAULT.snap * task.size)).tolist():
                site = (kind, k, v) if face == 0 else (kind, v, k)
                line = feature_points(movable, static, site, (i, j), n, np.eye(3))
                found.setdefault((kind, *other.elements["V"][v].vertices), line)
    return [*found.values()] or lines[:1]


def _moves(relation: Problem, task: Task, line: FeaturePoints) -> tuple[Array, Array]:
    """Return how the points with which both bodies touch move by each size, (3, k); refuse what turns normals."""
    found, starts = [], ENDS.get(line.kind, (0, 1))
    for k, (role, body) in enumerate(zip(("movable", "static"), (task.movable, task.static), strict=True)):
        points = line.points.T[starts[k] : 4 if k else starts[1]]
        sides = points[1:] - points[0]
        moves = np.zeros((3, len(relation.sizes)))
        facet = line.site[1 + k] if len(points) == 3 else None
        for column, size in enumerate(relation.sizes):
            if size.body != role:
                continue
            move = move_of(relation.request[role], _whole(body, line.parts[k]), size, points[0], facet)
            turned = np.linalg.matrix_rank(np.vstack([sides, sides @ size.directions()]), tol=DEFAULT.tie * body.size)
            if move is None or turned > len(sides):
                what = "turns the faces of" if move is not None else "parts a corner of"
                raise InputError(
                    f"size '{size.name}' {what} this contact, whose gap does not change in proportion", key="sizes",
                    found=task.named(line.parts), allowed="a scale that the contact's faces are along or across",
                )  # fmt: skip
            moves[:, column] = move
        found.append(moves)
    return found[0], found[1]


def move_of(body: Body, part: int, size: Size, point: Array, facet: int | None) -> Array | None:
    """Return how a vertex of a part moves a unit of a size, or its facet; None where the vertex becomes several."""
    if not size.is_length:
        return np.asarray((point - body.seed) @ size.directions())
    if body.is_surface:
        rates = vertex_rates(body, {}, size)
        return None if rates is None else rates[int(np.abs(body.vertices - point).sum(axis=1).argmin())]
    own = resizing_of(body, (size,)).parts[part]
    if facet is not None:
        return np.asarray(own.part.normals[facet] * own.offsets[facet, 0])
    moves = own.moves[own.vertices == int(np.abs(own.part.vertices - point).sum(axis=1).argmin()), :, 0]
    return None if np.ptp(moves, axis=0).max() > DEFAULT.nominal else moves[0]


def _whole(body: Body, part: int) -> int:
    return part if body.full_body is None else body.part_indices[part]


def range_of(rows: AffineGaps, box: Array, listed: Array | None) -> tuple[tuple[float, Array], tuple[float, Array]]:
    """Return the least and the largest separation of a contact over all sizes, and where."""
    if listed is not None:
        gaps = rows.gaps(listed)
        return (float(gaps.min()), listed[gaps.argmin()]), (float(gaps.max()), listed[gaps.argmax()])
    most, high = least_of(-rows.values, box)
    return min((least_of(row[None], box) for row in rows.values), key=itemgetter(0)), (-most, high)
