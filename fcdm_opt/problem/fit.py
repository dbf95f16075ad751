"""How the parts as drawn fit into each other, and which widths of the parts made do not go together."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve import kernels
from fcdm_opt.curve.decision_curve import relative_pose
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Flags, Ints, groups_of
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.crossings import overlapping
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.facet_errors import facet_errors, is_plane_there, round_surfaces
from fcdm_opt.geometry.measures import norms
from fcdm_opt.geometry.naming import element_text, is_round, with_article
from fcdm_opt.geometry.resizing import resized_part_corners
from fcdm_opt.geometry.round_recognition import ROUND, Round, round_faces
from fcdm_opt.geometry.solids import PlacedSolids, contains, kept_as_surface
from fcdm_opt.geometry.units import measured
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.tolerances import DEFAULT

REST = np.eye(4)

FAR = 2.0  # sizes of the larger part between the parts, from which on they are likely to be drawn in different frames

DIGITS = (1 << 21) ** np.arange(2, -1, -1)  # of numbers below a million, in one
LINE_TO_LINE = "drawn line to line"
NEARLY = 1e-4  # of a width: what lacks is said, as both widths look alike
AS_WIDE = 1e-6  # of a width: what lacks is where a search ended, and no dimension
ROOM = 0.5  # of the width that is to be in it: parts that go together as drawn are not made with less
MATING = 0.1  # share by which a size of one part and an opposite one of the other differ, that go together, at most
FEWEST_ROUND = np.cos(np.pi / 12.0)  # between a facet of a round face, of which a turn has 12, and an edge of it
HAIR = 0.02
"""Bodies that overlap as drawn by less than this share of the smaller one's size are meant to fit all the same: press
fits, and meshes of round faces out of phase. Bodies that are apart by less are meant to touch."""


def drawn_bodies(problem: Problem) -> tuple[Body, Body]:
    """Return the bodies as drawn, where the problem's are those made at given sizes."""
    if not problem.made:
        return problem.movable, problem.static
    return problem.request["movable"], problem.request["static"]


def _walls(problem: Problem, most: float) -> tuple[Array, Ints]:
    """Return how part pairs keep apart as drawn: normals, (k, 3), and which they are, (k, 2).

    Of each pair the facet direction of its largest separation at the nominal sizes. None of pairs that overlap there by
    more than a hair, that bounds tell to be further apart than twice `most`, or where one of the facets is but a cut.
    """
    drawn = drawn_bodies(problem)
    alike = 2.0 ** np.ceil(np.log2(most)) if 0.0 < most < np.inf else most  # so that like questions share the answer
    return _walls_of(drawn, tuple(problem.nominal_pair.tolist()), float(alike), DEFAULT.snap * problem.size)


@lru_cache(maxsize=16)
def _walls_of(drawn: tuple[Body, Body], nominal: tuple[float, float], most: float, slack: float) -> tuple[Array, Ints]:
    movable, static = drawn
    kept = _near_parts(drawn, np.array(nominal), most + slack)
    if not all(map(len, kept)):
        return np.empty((0, 3)), np.empty((0, 2), np.int64)
    near = [body.subset(own.tolist()).packed for body, own in zip(drawn, kept, strict=True)]
    both, placed = (*near[0], *near[1]), (relative_pose(movable, static, REST), np.array(nominal))
    pairs = np.ascontiguousarray(np.argwhere(kernels.pair_bounds(*both, *placed) <= most + slack))
    rows = kernels.widest_rows(*both, *placed, pairs)
    pairs = np.column_stack([own[pairs[:, k]] for k, own in enumerate(kept)])
    gaps = rows[:, 5] - rows[:, 3:5] @ nominal
    walls = gaps >= -slack
    walls |= gaps >= -HAIR * min(movable.size, static.size)
    near_walls = np.flatnonzero(walls)  # where more of a body is behind, another of its parts, or nothing, is the wall
    for body, side, own in ((movable, 1.0, pairs[:, 0]), (static, -1.0, pairs[:, 1])):
        walls[near_walls] &= ~_cut([body.parts[k] for k in own[near_walls].tolist()], side * rows[near_walls, :3], body)
    return rows[walls, :3], pairs[walls]


def _near_parts(bodies: tuple[Body, Body], rho: Array, most: float) -> list[Ints]:
    """Return the parts of either body whose boxes come as near as a length to one of the other's, at a scale pair."""
    if most == np.inf:
        return [np.arange(len(body.parts)) for body in bodies]
    boxes = []
    for body, scale in zip(bodies, rho.tolist(), strict=True):
        starts = np.cumsum([0, *(len(part.vertices) for part in body.parts[:-1])])
        points = body.seed + scale * (np.concatenate([part.vertices for part in body.parts]) - body.seed)
        boxes.append((np.minimum.reduceat(points, starts), np.maximum.reduceat(points, starts)))
    low, high = (np.concatenate(ends) for ends in zip(*boxes, strict=True))
    first = len(bodies[0].parts)
    sides = (np.arange(len(low)) >= first).astype(np.int64)
    met = np.zeros(len(low), np.bool_)
    for one, two in overlapping(low - most / 2.0, high + most / 2.0, sides):
        met[one] = met[two] = True
    return [np.flatnonzero(met[:first]), np.flatnonzero(met[first:])]


def _cut(parts: list[ConvexPart], normals: Array, body: Body) -> Flags:
    """Tell which parts have more of their body behind all that is foremost along a direction: what only a cut made."""
    found = np.full(len(parts), len(body.parts) > 1)
    for share in (0.0, 0.25, 0.5, 0.75):  # from the middle to the corners: more may be behind the middle alone
        places, rows = list[Array](), list[int]()
        for k in np.flatnonzero(found).tolist():
            corners = _foremost(parts[k], normals[k], body)
            off = share * (corners - corners.mean(axis=0)) if share else np.zeros((1, 3))
            places.append(corners.mean(axis=0) + off + DEFAULT.side * body.size * normals[k])
            rows += [k] * len(off)
        if rows:
            found[np.array(rows)[~contains(body, np.concatenate(places))]] = False
    return found


def _foremost(part: ConvexPart, normal: Array, body: Body) -> Array:
    """Return the corners of what a part of a body has foremost along a direction, (k, 3): a facet, an edge or one."""
    best, heights = int((part.normals @ normal).argmax()), part.vertices @ normal
    if part.normals[best] @ normal >= 1.0 - DEFAULT.side:
        return part.vertices[list(part.loops[best])]
    return part.vertices[heights >= heights.max() - DEFAULT.snap * body.size]


@lru_cache(maxsize=4)
def part_corners_as_made(problem: Problem) -> tuple[list[Array], list[Array]] | None:
    """Return the corners that parts of both bodies as drawn have at the sizes made; None where that is not known."""
    # bodies made may be cut anew, into other parts
    found = list[list[Array]]()
    for role, drawn, made in zip(problem.drawn, drawn_bodies(problem), problem.bodies[:2], strict=True):
        if drawn is not made and not made.is_surface:
            off = {size: problem.made[size.name] for size in problem.sizes if size.body == role}
            try:
                found.append(resized_part_corners(drawn, off))
            except InputError:
                return None
        elif [len(part.vertices) for part in drawn.parts] == [len(part.vertices) for part in made.parts]:
            found.append([part.vertices for part in made.parts])
        else:
            return None
    return found[0], found[1]


def _change(problem: Problem) -> float:
    """Return how much two parts may come nearer each other along any direction as they are made; length units."""
    corners, change = part_corners_as_made(problem), 0.0
    if corners is None:
        return np.inf
    for drawn, made, points, before, after in zip(
        drawn_bodies(problem), problem.bodies[:2], corners, problem.nominal_pair, problem.target, strict=True
    ):
        if drawn is made:
            change += abs(after - before) * max(part.circumradius for part in made.parts)
            continue
        was = [before * (part.vertices - part.seed) for part in drawn.parts]
        now = [after * (own - part.seed) for own, part in zip(points, drawn.parts, strict=True)]
        if [*map(len, was)] == [*map(len, now)]:
            change += float(norms(np.concatenate(now) - np.concatenate(was)).max())
        else:  # corners split: each is that far from one as drawn
            far = (norms(own[:, None] - before).min(axis=1).max() for own, before in zip(now, was, strict=True))
            change += float(max(far))
    return change


def holds(problem: Problem) -> bool:
    """Tell whether no shift of body 1 leads away from all parts of body 2 at once, as drawn: 0 is among the normals.

    Parts that overlap as drawn by more than a hair hold nothing; nor do solids kept as surfaces, whose parts are thin.
    """
    if kept_as_surface(*drawn_bodies(problem)) and overlap_as_drawn(problem) > 1.0:
        return False
    each = (_walls(problem, most)[0] for most in (2.0 * _change(problem), np.inf))  # the nearest may do
    return any(len(own) > 0 and _most_room(own, np.zeros(len(own)))[0] <= DEFAULT.partition for own in each)


def leads_away(problem: Problem, shift: Array) -> bool:
    """Tell whether a shift of body 1 leads away from any part of body 2 that it is near as drawn, not only along it."""
    normals, length = _walls(problem, 2.0 * _change(problem))[0], float(norms(shift))
    return not len(normals) or bool((normals @ shift < -DEFAULT.side * length).any())


def overlap_as_drawn(problem: Problem) -> float:
    """Return how deep the parts overlap as drawn, in hairs, see `HAIR`; negative where they are apart, by that."""
    drawn = drawn_bodies(problem)
    solids = PlacedSolids(*drawn, problem.nominal_pair, REST)
    return (solids.depth or -solids.distance) / hair_of(problem)


def hair_of(problem: Problem) -> float:
    """Return the length by which parts that meet may overlap as drawn, or be apart, see `HAIR`."""
    return HAIR * min(body.size for body in drawn_bodies(problem))


def _most_room(normals: Array, gaps: Array) -> tuple[float, Array]:
    """Return the least of gaps, (k,), where a shift makes that largest, at most 1, and the weights that bound it, (k,).

    A shift moves along each axis by at most 1, towards walls whose unit normals, (k, 3), look from body 1 to body 2.
    """
    from scipy.optimize import linprog

    rows = np.hstack([normals, np.ones((len(normals), 1))])  # n.u + s <= gap for each
    chosen = list(
        dict.fromkeys([*normals.argmin(axis=0).tolist(), *normals.argmax(axis=0).tolist(), int(gaps.argmin())])
    )
    bounds = [(-1.0, 1.0)] * 3 + [(None, 1.0)]
    while True:  # with the rows alone that matter: there may be millions
        found = linprog([0.0, 0.0, 0.0, -1.0], A_ub=rows[chosen], b_ub=gaps[chosen], bounds=bounds)
        beyond = rows @ found.x - gaps
        worst = int(beyond.argmax())
        if beyond[worst] <= DEFAULT.partition or worst in chosen:
            weights = np.zeros(len(gaps))
            weights[chosen] = -found.ineqlin.marginals
            return float(found.x[3]), weights
        chosen.append(worst)


class Misfit(NamedTuple):
    """Two widths of the parts made that do not go together.

    `inner` and `outer` are the widths, length units, the first of body `inside` (0: movable, 1: static). `faces` are
    those between which they are, of the movable and of the static part as drawn; None where only a cut made one.
    `parts` are the numbers of the convex parts that have them, of both bodies. `normal` is that of the first wall, from
    body 1 to body 2. `wider`: what lacks more, between walls of several round faces. With an `outer` of 0 `inner`
    is by how much the parts overlap at least wherever they are shifted, between three walls or more.
    """

    inside: int
    inner: float
    outer: float
    faces: tuple[tuple[Element | None, ...], tuple[Element | None, ...]] = ((), ())
    parts: tuple[tuple[int, ...], tuple[int, ...]] = ((), ())
    normal: tuple[float, ...] = ()
    wider: Misfit | None = None


@lru_cache(maxsize=16)
def misfit(problem: Problem) -> Misfit | None:
    """Return by which widths the parts made do not go together as drawn; None where no two walls tell.

    Part pairs that keep apart as drawn along opposite normals: the sum of their gaps does not depend on any shift. Of
    all that are closed at the target sizes, and were not as drawn, those that lack most. A gap closes by no more than
    `_change`, so that none that is larger twice over makes up such a sum. Large
    bodies are looked at while there is time.
    """
    if problem.partial and pacing.over():
        return None
    corners, (normals, places) = part_corners_as_made(problem), _walls(problem, 2.0 * _change(problem))
    if corners is None or not len(normals):
        return None
    # how far the parts made reach, from the origin: body 1 along the normal, body 2 against it; apart by minus the sum
    reaches = np.empty((len(normals), 2))
    for k, (body, rho, side) in enumerate(
        zip((problem.movable, problem.static), problem.target, (1.0, -1.0), strict=True)
    ):
        for rows in filter(len, groups_of(places[:, k])):
            directions, points = side * normals[rows], corners[k][places[rows[0], k]] - body.seed
            reaches[rows, k] = directions @ body.seed + rho * (points @ directions.T).max(axis=0)
    gaps = -reaches.sum(axis=1)
    if gaps.min() >= 0.0:
        return None
    kept = gaps <= -gaps.min()  # of two whose sum is negative one is, and the other is no larger
    walls = _ClosedWalls(problem, normals[kept], places[kept], reaches[kept], gaps[kept])
    found = walls.tightest(np.arange(len(walls.gaps)))
    if found is None:
        return _ClosedWalls(problem, normals, places, reaches, gaps).wedged()
    if _of_one_feature(problem, found):
        return found
    each = map(walls.tightest, walls.by_feature())
    named = [one for one in each if one is not None and _of_one_feature(problem, one)]
    one = max(named, key=lambda own: own.inner - own.outer, default=None)
    return found if one is None else one._replace(wider=found)


def _of_one_feature(problem: Problem, found: Misfit) -> bool:
    """Tell whether the walls of either body are of one round face at most."""
    bodies = zip(map(_round_numbers, drawn_bodies(problem)), found.faces, strict=True)
    return all(len({_number(known, own) for own in faces} - {-1}) < 2 for known, faces in bodies)


class _ClosedWalls(NamedTuple):
    """Walls that are closed at the sizes made: normals, (k, 3), part pairs, (k, 2), how far both reach, gaps."""

    problem: Problem
    normals: Array
    places: Ints
    reaches: Array
    gaps: Array

    def tightest(self, rows: Ints) -> Misfit | None:
        """Return the two opposite ones that lack most, of some; None where no two lack anything."""
        problem, normals = self.problem, self.normals[rows]
        reaches, gaps = self.reaches[rows], self.gaps[rows]
        keys = np.round(normals / np.sqrt(DEFAULT.tie)).astype(np.int64) @ DIGITS  # opposite ones have opposite keys
        order = np.argsort(gaps, kind="stable")
        known, first = np.unique(keys[order], return_index=True)
        back = np.minimum(np.searchsorted(known, -known), len(known) - 1)
        pairs = np.column_stack([order[first], order[first[back]]])[known[back] == -known]
        found, least, tie, bow = None, -problem.contact_slack, DEFAULT.tie * problem.size, self.bow
        for k, j in pairs[np.argsort(pairs[:, 0])].tolist():  # of equals the first
            if not gaps[k] + gaps[j] < least - tie:
                continue
            width = reaches[k] + reaches[j]
            inside = 0 if width[0] > 0.0 else 1
            if not width[inside] > -width[1 - inside] > ROOM * width[inside]:
                continue  # walls that are a little aslant, seen from far away; and what nothing could be meant to be in
            own = self._between(rows[[k, j]])._replace(
                inside=inside, inner=float(width[inside]), outer=float(-width[1 - inside])
            )
            if not all(map(any, zip(*own.faces, strict=True))):
                continue  # two edges: no face of either ends there
            exact = true_widths(problem, own) is not None
            if problem.motion.turning.any() and not (exact or self._are_planes(own)):
                continue  # a turn changes the width between edges, and that of round faces aslant to each other
            if own.inner - own.outer > bow or exact or between_planes(problem, own):
                least, found = float(gaps[k] + gaps[j]), own
        return found

    def _are_planes(self, found: Misfit) -> bool:
        both = zip(map(_round_numbers, drawn_bodies(self.problem)), found.faces, strict=True)
        return all(own is not None and _number(known, own) < 0 for known, faces in both for own in faces)

    def wedged(self) -> Misfit | None:
        """Return what lacks wherever body 1 is shifted, of walls that need not be opposite; None where nothing does.

        Weights under which normals cancel make a sum of gaps that no shift changes: the tightest of these sums.
        """
        problem, drawn = self.problem, drawn_bodies(self.problem)
        _, weights = _most_room(self.normals, self.gaps / np.abs(self.gaps).max())
        lack, rows = -float(weights @ self.gaps), np.flatnonzero(weights > DEFAULT.side)
        if lack <= problem.contact_slack or norms(weights @ self.normals) > DEFAULT.side:
            return None
        found, groups = self._between(rows)._replace(inner=lack), dict[tuple[object, ...], list[int]]()
        for row, faces in zip(rows.tolist(), zip(*found.faces, strict=True), strict=True):
            pair = ((_number(_round_numbers(body), own), own) for body, own in zip(drawn, faces, strict=True))
            groups.setdefault(tuple(number if number >= 0 else own for number, own in pair), []).append(row)
        one, two = (sorted(groups.values(), key=len) * 2)[:2]  # a plane is one wall
        if len(groups) == 1 or (len(groups) == 2 and (self.normals[two] @ self.normals[one[0]]).max() < -FEWEST_ROUND):
            own = self._between(np.array([one[0], two[0]]))
            widths = true_widths(problem, own)
            outer, inner = sorted(map(abs, widths or (0.0, 0.0)))
            return own._replace(inside=int(widths[0] < 0.0), inner=inner, outer=outer) if widths else None
        # true round faces may have room, and a turn may make some; of two walls `tightest` knows
        known = len(groups) > 2 and all(map(any, zip(*found.faces, strict=True))) and 2.0 * lack > self.bow
        return found if known and not problem.motion.turning.any() else None

    def _between(self, rows: Ints) -> Misfit:
        """Return a misfit between walls, along the normal of the first, with no widths yet."""
        (faces, parts), sides = ([], []), (1.0, -1.0)
        for body, side in enumerate(sides):
            own, others = self.places[rows, body].tolist(), self.places[rows, 1 - body].tolist()
            each = zip(own, others, side * self.normals[rows], strict=True)
            faces.append(tuple(self._named_wall(part, other, normal, body) for part, other, normal in each))
            parts.append(tuple(dict.fromkeys(own)))
        return Misfit(0, 0.0, 0.0, (faces[0], faces[1]), (parts[0], parts[1]), tuple(self.normals[rows[0]].tolist()))

    def _named_wall(self, part: int, other: int, normal: Array, role: int) -> Element | None:
        """Return the face of a part that looks along a direction; of a cut that one of the round face that it is at."""
        # of several it is at that which is nearest to the part of the other body
        bodies = drawn_bodies(self.problem)
        own, body, theirs = bodies[role].parts[part], bodies[role], bodies[1 - role].parts[other].vertices.mean(axis=0)
        wall = _wall(own, normal, body)
        if wall is None or tuple(sorted(wall.vertices)) in body.face_rows or len(body.parts) < 2:
            return wall
        level, at = float((own.vertices @ normal).max()), list[tuple[float, Round]]()
        for each in filter(_is_cylinder, round_faces(body)):
            surface, side = each.surface, _side(each)
            off = side * (level - float(surface.origin @ normal)) - surface.radius
            room = surface.radius * (1.0 - FEWEST_ROUND)
            if abs(surface.axis @ normal) <= DEFAULT.side and -room <= off <= ROUND * surface.radius:
                at.append((float(norms(np.cross(theirs - surface.origin, surface.axis))), each))
        if not at:
            return wall
        faces = min(at, key=lambda one: one[0])[1].faces
        looks = body.face_planes[0][[body.face_rows[face] for face in faces]]
        return Element("F", faces[int((looks @ normal).argmax())])

    @property
    def bow(self) -> float:
        """How much more room true round faces of both bodies may have than their facets, which may be out of phase."""
        both = zip(drawn_bodies(self.problem), self.problem.target.tolist(), strict=True)
        errors = ((facet_errors(body), rho) for body, rho in both if round_surfaces(body))
        return sum(2.0 * rho * float(own.sum(axis=1).max()) for own, rho in errors if own is not None)

    def by_feature(self) -> Iterator[Ints]:
        """Yield the rows of each round face of either body, and of all others."""
        for body, side, own in zip(drawn_bodies(self.problem), (1.0, -1.0), self.places.T.tolist(), strict=True):
            known = _round_numbers(body)
            faces = (_wall(body.parts[k], side * normal, body) for k, normal in zip(own, self.normals, strict=True))
            yield from filter(len, groups_of(np.array([1 + _number(known, face) for face in faces])))


@lru_cache(maxsize=8)
def _round_numbers(body: Body) -> dict[tuple[int, ...], int]:
    """Return the number of the round face that each facet of one is on."""
    return {label: k for k, own in enumerate(round_faces(body)) for label in own.faces}


def _number(known: dict[tuple[int, ...], int], wall: Element | None) -> int:
    """Return the number of the round face that a wall is on, -1 for none."""
    return -1 if wall is None else known.get(tuple(sorted(wall.vertices)), -1)


def _wall(part: ConvexPart, normal: Array, body: Body) -> Element | None:
    """Return the face of a part that looks along a direction; None where it has none."""
    # where an edge between facets of a round face does, one of these
    towards = part.normals @ normal
    best = int(towards.argmax())
    face = part.elements["F"][best]
    on_round = towards[best] > FEWEST_ROUND and _number(_round_numbers(body), face) >= 0
    return face if on_round or towards[best] >= 1.0 - DEFAULT.side else None


def verdict(scene: Scene) -> str:
    """Return the misfit of two parts of a scene in words, the first there is; empty where no two walls tell."""
    tight = (problem for problem in scene.relations.values() if misfit(problem) is not None)
    named = (own for problem in tight for own in (problem.of_facets, problem))  # whose faces have the names in its file
    return next(filter(None, map(_verdict, named)), "")


def lack(problem: Problem) -> float:
    """Return by how much more the widths that do not go together lack, length units; 0 where no widths tell."""
    found = misfit(problem)
    own = found and (found.wider or found)
    if own is None:
        return 0.0
    inner, outer = true_widths(problem, own) or (own.inner, own.outer)
    return inner - outer


def mending_turn(problem: Problem) -> Array | None:
    """Return the direction about which a turn of the part brings two distances of round faces together, else None.

    The lines between their axes then lie along each other, and are as long but for the play. None of motions that turn.
    """
    found, made = misfit(problem), (problem.movable, problem.static)
    each = [_round_widths(problem, own, made, problem.target) for own in (found, found and found.wider) if own]
    mended = each and all(own is not None and own.turned <= 0.0 for own in each) and not problem.motion.turning.any()
    return each[0].axis if mended and each[0] else None


def unlike_steps(scene: Scene) -> str:
    """Return in words two contacts that look one way, and how far apart their faces are in either part as made."""
    # those that differ most, so that no shift closes both; empty where none do
    most, found = 0.0, ""
    relations = scene.relations.values()
    for problem, one, two in ((own, *pair) for own in relations for pair in combinations(own.chosen_joints, 2)):
        if one.normals[0] @ two.normals[0] < 1.0 - DEFAULT.side:
            continue
        made = (problem.movable, problem.static), problem.target.tolist(), drawn_bodies(problem)
        steps, texts = list[float](), list[str]()
        for k, (body, rho, named) in enumerate(zip(*made, strict=True)):
            both = [(own.feature.one, own.feature.two)[k] for own in (one, two)]
            first, last = (body.vertices[element.vertices[0] - 1] for element in both)
            steps.append(rho * float((last - first) @ one.normals[0]))
            faces, step = " and ".join(element_text(named, own) for own in both), f"{abs(steps[k]):.6g}"
            texts.append(f"{measured(step, problem.unit)} of {named.name or 'a part'} between its {faces}")
        if (apart := abs(steps[0] - steps[1])) > max(most, problem.contact_slack):
            most, found = apart, f"do not go together: {', and '.join(texts)}"
    return found


def _verdict(problem: Problem) -> str:
    found = misfit(problem)
    if found is None:
        return ""
    all_round = found.wider is not None and true_widths(problem, found.wider) is not None
    words = [_in_words(problem, own) for own in (found, found.wider if all_round else None) if own is not None]
    where = "" if _of_one_feature(problem, found) else " where it is drawn"  # along round walls a long shift may help
    return f"does not fit{where}: {'; nor '.join(words)}"


def _in_words(problem: Problem, found: Misfit) -> str:
    """Return two widths in words, and between which walls they are."""
    exact = true_widths(problem, found)
    names = (problem.movable.name or "the movable part", problem.static.name or "the static part")
    widths = exact or (found.inner, found.outer)
    lack = widths[0] - widths[1]
    places = int(max(0, 1 - np.floor(np.log10(lack))))
    inner, outer = names[found.inside], names[1 - found.inside]
    digits = (f"{float(f'{width:.12g}'):.{places}f}" for width in widths)  # not by rounding
    wide, room = (measured(width, problem.unit) for width in digits)
    fit, end = f"{inner} {wide} in {outer} {room}", ""
    if not found.outer:
        fit = f"{names[0]} and {names[1]} overlap by {measured(lack, problem.unit, 4)} or more, wherever shifted"
    elif lack < NEARLY * widths[1]:  # digits that differ where nobody reads them
        room = measured(widths[1], problem.unit)
        fit = f"{inner} is {measured(lack, problem.unit, 2)} wider than {outer}, {room}"
        if (drawn_width := _drawn_width(problem, found)) is not None:
            room = measured(drawn_width, problem.unit)
            fit = f"{inner} and {outer} are {LINE_TO_LINE}, {room}"
            end = f": no tolerance in which {inner} may be wider fits"
        elif lack < AS_WIDE * widths[1]:
            fit, end = f"{inner} and {outer} are as wide as each other, {room}", f": {inner} may not be wider"
    sides = 1 - found.inside, found.inside  # the walls of the room; where a cut made one, those of the part in it
    side = next((k for k in sides if None not in found.faces[k]), sides[0])
    drawn = drawn_bodies(problem)[side]
    faces = dict.fromkeys(element_text(drawn, own) for own in found.faces[side] if own is not None)
    *others, last = map(with_article, faces or [""])
    walls = " and ".join(filter(None, (", ".join(others), last)))
    between = f", {'between' if len(faces) > 1 else 'across'} {walls} of {names[side]}" if faces else ""
    between += " (of its facets)" * (exact is None and any(map(is_round, faces)))
    return f"{fit}{between}{end}"


def _drawn_width(problem: Problem, found: Misfit) -> float | None:
    """Return the width of two parts as drawn, where both have the same but for the digits of files."""
    drawn, scales = drawn_bodies(problem), problem.nominal_pair
    of_round, inside = _round_widths(problem, found, drawn, scales), found.inside
    widths = of_round and of_round[:2]
    if widths is None:
        both, normal = list[float](), np.array(found.normal)
        for body, rho, side, own in zip(drawn, scales.tolist(), (1.0, -1.0), found.parts, strict=True):
            ends = (side * (body.parts[k].vertices @ normal) * sign for k, sign in ((own[0], 1.0), (own[-1], -1.0)))
            both.append(rho * sum(float(end.max()) for end in ends))
        widths = both[inside], -both[1 - inside]
    slack = problem.contact_slack + 2.0 * sum(body.rounding for body in drawn)
    return widths[1] if abs(widths[0] - widths[1]) <= slack else None


def true_widths(problem: Problem, found: Misfit) -> tuple[float, float] | None:
    """Return the widths made of the true faces, where walls are of cylinders and bores: of one, of two, or one plane.

    None of other walls, and where the true faces would go together.
    """
    widths = _round_widths(problem, found, (problem.movable, problem.static), problem.target)
    return widths[:2] if widths is not None and widths[0] > widths[1] else None


def between_planes(problem: Problem, found: Misfit) -> bool:
    """Tell whether walls are plane faces in truth, or sharp edges between such, as far as is known."""
    for body, side, faces, parts in zip(drawn_bodies(problem), (1.0, -1.0), found.faces, found.parts, strict=True):
        ends = ((parts[0], side), (parts[-1], -side)) if len(faces) == 2 else ()
        edges = [_edge(body.parts[k], sign * np.array(found.normal), body) for k, sign in ends]
        walls = [own or edge for own, edge in zip(faces, edges or [None] * len(faces), strict=True)]
        if not all(own is not None and is_plane_there(body, own) for own in walls):
            return False
    return True


class _RoundWidths(NamedTuple):
    inner: float
    outer: float
    turned: float  # by how much the inner one is wider once the lines between the axes lie along each other
    axis: Array  # of the round walls, a unit vector


def _round_widths(problem: Problem, found: Misfit, bodies: tuple[Body, Body], scales: Array) -> _RoundWidths | None:
    """Return the widths inside and outside of bodies at scales, None where neither wall is round, or one a cut.

    A wall reaches as far along a direction n as centre . n + radius, or - radius of a bore: round ones lack most along
    the line between centres, which facets on either side are turned against; a plane has its own direction.
    """
    apart, thick, axes, flat, rounded = list[Array](), list[float](), list[Array](), False, False
    corners = part_corners_as_made(problem) or ([], [])
    asked = zip(drawn_bodies(problem), bodies, scales.tolist(), found.faces, found.parts, (1.0, -1.0), strict=True)
    for role, (drawn, body, rho, walls, parts, side) in enumerate(asked):
        pairs = list(zip(round_faces(drawn), round_faces(body), strict=False))
        numbers = [_number(_round_numbers(drawn), wall) for wall in walls]
        if len(walls) != 2:
            return None
        centres, sums = list[Array](), 0.0
        for k, wall, part, sign in zip(numbers, walls, (parts[0], parts[-1]), (side, -side), strict=True):
            edge = _edge(drawn.parts[part], sign * np.array(found.normal), drawn) if wall is None else wall
            if k < 0 and edge is not None and is_plane_there(drawn, edge):
                points, flat = body.parts[part].vertices if body is drawn else corners[role][part], flat or edge is wall
                centres.append(points[(sign * (points @ np.array(found.normal))).argmax()])
                ends = drawn.vertices[np.array(edge.vertices[:2]) - 1]
                axes += [(ends[1] - ends[0]) / norms(ends[1] - ends[0])] * (edge is not wall)
                continue
            if not 0 <= k < len(pairs) or not _is_cylinder(pairs[k][1]):
                return None
            was, now = pairs[k]
            radius = now.surface.radius
            if body.surfaces is None:  # it goes out as its facets do, whose corners go further
                radius = was.surface.radius + _inner_radius(body, now) - _inner_radius(drawn, was)
            centres.append(now.surface.origin)
            axes.insert(0, now.surface.axis)
            rounded = True
            sums += _side(was) * radius
        apart.append(rho * (centres[0] - centres[-1]))
        thick.append(rho * sums)
    if not rounded or any(norms(np.cross(axes[0], axis)) > DEFAULT.side for axis in axes):
        return None
    if flat and abs(axes[0] @ found.normal) > DEFAULT.side:
        return None
    across = (own - (own @ axes[0]) * axes[0] for own in (np.array(found.normal), apart[0] - apart[1], apart[0]))
    (normal, line, middles), least = across, DEFAULT.weld * problem.size
    normal, long = normal / norms(normal), float(norms(line))
    if not flat and long <= least and norms(middles) > least:  # of one pitch: none lacks more along another direction
        normal = middles * np.sign(normal @ middles) / norms(middles)
    elif not flat and normal @ line > FEWEST_ROUND * long > least:
        normal = line / long
    widths = float(normal @ apart[0]) + thick[0], thick[1] - float(normal @ apart[1])
    long, other = (float(norms(own - (own @ axes[0]) * axes[0])) for own in apart)
    turned = np.inf if flat else abs(long - other) + sum(thick)
    return _RoundWidths(widths[found.inside], -widths[1 - found.inside], turned, axes[0])


def _edge(part: ConvexPart, normal: Array, body: Body) -> Element | None:
    """Return the edge of a part of a body as drawn that is foremost along a direction; None where none is."""
    heights, level = body.vertices @ normal, (part.vertices @ normal).max() - DEFAULT.snap * body.size
    known = ((heights[np.array(own.vertices) - 1].min(), own) for own in part.elements["E"])
    height, edge = max(known, key=lambda own: own[0], default=(-np.inf, None))
    return edge if height >= level else None


def mating_cylinders(bodies: tuple[Body, Body]) -> list[tuple[Round, Round]]:
    """Return the round walls of two bodies, a bore and a cylinder, of which one is around the other as drawn.

    Their axes are parallel and no farther apart than their radii, which are nearly alike; the first is of body 1.
    """
    found, walls = list[tuple[Round, Round]](), [[*filter(_is_cylinder, round_faces(body))] for body in bodies]
    for pair in product(walls[0], walls[1]):
        (one, two), axis = (own.surface for own in pair), pair[0].surface.axis
        off, room = one.origin - two.origin, abs(one.radius - two.radius)
        rows = (np.unique(np.concatenate(own.faces)) - 1 for own in pair)
        heights = (body.vertices[own] @ axis for body, own in zip(bodies, rows, strict=True))
        (low, high), (least, most) = ((own.min(), own.max()) for own in heights)
        coaxial = norms(np.cross(axis, two.axis)) <= DEFAULT.side and low < most and least < high
        near = norms(off - (off @ axis) * axis) <= room + DEFAULT.snap * bodies[0].size
        if coaxial and near and room <= MATING * max(one.radius, two.radius) and _side(pair[0]) != _side(pair[1]):
            found.append(pair)
    return found


def _is_cylinder(own: Round) -> bool:
    """Tell whether a round face is a cylinder or a bore."""
    return own.surface.line is not None and own.surface.line[1] == 0.0


def _side(own: Round) -> float:
    """Return 1 of a cylinder, whose material is within, and -1 of a bore."""
    return -1.0 if own.name.startswith("bore") else 1.0


def _inner_radius(body: Body, own: Round) -> float:
    """Return how far the facets of a cylinder are from its axis."""
    (normals, points), rows = body.face_planes, [body.face_rows[face] for face in own.faces]
    return float(np.abs((normals[rows] * (points[rows] - own.surface.origin)).sum(axis=1)).mean())
