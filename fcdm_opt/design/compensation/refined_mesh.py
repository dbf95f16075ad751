"""Refines a mesh until the motion is known to within an error everywhere.

An edge whose ends have no active set in common is split where the active set changes; one along a boundary is bent to
it; any is halved where quadratic interpolation along it is too coarse. What the time does not do for is undecided.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from fcdm_opt.design.compensation.changeover import NARROW, Changeover, changeover
from fcdm_opt.design.compensation.sampling import REJECTED, UNDECIDED, ActiveSet, Asking, Sample, Sampler
from fcdm_opt.design.compensation.size_mesh import STRIP, Ends, MeshEdge, MeshVertex, SizeMesh, Triangle, Values
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT

GRID = (0.0, 0.2573, 0.5091, 0.7537, 1.0)  # of the first vertices: off the middle, where boundaries like to be
SHARE = 1e-4  # of the largest amount: error that is asked for by default
SAFETY = 2.0  # times the errors at the four points that fix a cubic's part beyond the quadratic
SHORTEST = 2.0**-14  # of the box: edges are not split further
ACROSS, WIDER, FURTHEST = 2.0**-8, 6.0, 0.3  # of an edge: how far off it its boundary is looked for
STRAIGHT = 1e-6  # of the box: a boundary at which the motion jumps is followed this closely
LARGER = 0.25  # share of the allowed error that makes an edge be split
WAVES = 80
TOGETHER = 16  # searches side by side: those before are through when the time is over


class RefinedMesh(SizeMesh):
    """A mesh that is refined until amount and motion are off by no more than `error`.

    None stands for a share of the largest amount.
    """

    def __init__(self, sampler: Sampler, error: float | None) -> None:
        self.sampler = sampler
        scene = sampler.scene
        self._carried = [(part, scene.bodies_made[part], carrying) for part, carrying in scene.kinematics.items()]
        self._walls = np.array([own.limits for own in scene.coordinates])
        self._rounding = DEFAULT.touch * scene.size
        places = [np.array([x, y]) for y in GRID for x in GRID]
        samples = sampler.samples(places)
        vertices = [
            MeshVertex(place, {} if sample is None else dict([sample]))
            for place, sample in zip(places, samples, strict=True)
        ]
        super().__init__(vertices, len(GRID))
        known = [sample for sample in samples if sample is not None]
        held = [sample.held for sample in known]
        alone = {one for one in held if held.count(one) == 1}  # may hold on a boundary only
        self._run([self._fill(vertex) for vertex in vertices if not alone.isdisjoint(vertex.values)])
        largest = max((float(sample.values[0]) for sample in known if np.isfinite(sample.values[0])), default=0.0)
        self.error = max(SHARE * largest, self._rounding) if error is None else error

    def refine(self) -> None:
        """Refine until every triangle is within the error, or the budget or the time is spent."""
        for wave in range(WAVES):
            waiting = [triangle for triangle in self.triangles if not triangle.finished]
            if not waiting:
                return
            self._look(waiting)
            self._judge(waiting, last=wave == WAVES - 1)
            if self.sampler.late:
                break
            fresh = [one.split for one in self.triangles if one.split is not None and not one.finished]
            self._run([self._fill(vertex) for vertex in fresh])
            self.subdivide()
        self._judge([triangle for triangle in self.triangles if not triangle.finished], last=True)
        for triangle in self.triangles:
            if not triangle.finished:
                self._leave(triangle)

    def _run(self, searches: Sequence[Asking[None]], *, last: bool = False) -> list[bool]:
        """Run searches side by side: what they ask for is solved in one go; tell which came to their end.

        They are given up when refining has used its share of the time, with `last` when all the time is over.
        """
        ended = [False] * len(searches)
        for first in range(0, len(searches), TOGETHER):
            asked = {k: next(searches[k], None) for k in range(first, min(first + TOGETHER, len(searches)))}
            while asked and (last or not self.sampler.late):
                samples = iter(self.sampler.samples([place for places in asked.values() for place in places or ()],
                                                    last=last))  # fmt: skip
                for k, places in list(asked.items()):
                    found = [next(samples) for _ in places or ()]
                    del asked[k]
                    if any(sample is None for sample in found):
                        continue
                    try:
                        if places is not None:
                            asked[k] = searches[k].send([sample for sample in found if sample is not None])
                            continue
                    except StopIteration:
                        pass
                    ended[k] = True
        return ended

    def _look(self, waiting: Sequence[Triangle]) -> None:
        """Look at the edges that have not been looked at, as far as the time does."""
        new = [ends for ends in dict.fromkeys(e for one in waiting for e in one.edges) if ends not in self.edges]
        new = sorted([ends for ends in new if all(self.vertices[k].values for k in ends)], key=self._dear)
        self.edges.update({ends: MeshEdge() for ends in new})
        for ends, ended in zip(new, self._run([self._edge(ends) for ends in new]), strict=True):
            if not ended:
                self.edges.pop(ends, None)

    def _dear(self, ends: Ends) -> int:
        """Return how dear an edge is to look at: motions are found soon, that there is none later, changes last."""
        p, q = (self.vertices[k].values for k in ends)
        amounts = [p[one][0] for one in p if one in q]
        return 0 if np.isfinite(amounts).any() else 1 if amounts else 2

    def _edge(self, ends: Ends) -> Asking[None]:
        p, q = (self.vertices[k] for k in ends)
        edge, sets = self.edges[ends], [one for one in p.values if one in q.values]
        if not sets:
            yield from self._changing(ends, edge, p, q)
            return
        if len(sets) > 1 and (yield from self._along(edge, p, q, (sets[0], sets[1]))):
            return
        places = 0.5 * (p.place + q.place), 0.75 * p.place + 0.25 * q.place
        samples = yield list(places)
        both: list[Values] = []
        for place, sample in zip(places, samples, strict=True):
            beside = dict([sample])
            if sets != [sample.held]:
                beside = yield from self._beside(place, sample, [_normal(p.place, q.place)])
            if not any(one in beside for one in sets):
                edge.split, edge.must = MeshVertex(place, beside), True
                return
            both.append(beside)
        middle, quarter = both
        for one in sets:
            if one in middle and one in quarter:
                edge.middle[one] = middle[one]
                there = _at_quarter(p.values[one], middle[one], q.values[one])
                edge.off[one] = self._apart(there, quarter[one], places[1])
        edge.split = MeshVertex(places[0], middle)

    def _beside(self, place: Array, sample: Sample, directions: Sequence[Array]) -> Asking[Values]:
        """Return the active sets on either side of a place, continued to it; its own where none holds for a stretch.

        On a boundary two active sets hold at once, in a strip as narrow as rounding, which is no region.
        """
        steps = [sign * NARROW * direction for direction in directions for sign in (2.0, -2.0)]
        samples = yield [place + times * step for step in steps for times in (1.0, 2.0)]
        beside = {
            near.held: 2.0 * near.values - far.values
            for near, far in zip(samples[::2], samples[1::2], strict=True)
            if near.held == far.held
        }
        return beside or dict([sample])

    def _changing(self, ends: Ends, edge: MeshEdge, p: MeshVertex, q: MeshVertex) -> Asking[None]:
        """Split an edge where the active set changes; where that is at an end, the end gets the one beyond it, too."""
        if min(len(p.values), len(q.values)) > 1 and (yield from self._across_both(edge, p, q)):
            return
        samples = [Sample(*list(vertex.values.items())[-1]) for vertex in (p, q)]
        change = yield from changeover(p.place, q.place, samples, self._walls)
        length = float(np.linalg.norm(q.place - p.place))
        for off, vertex, side in ((change.at, p, 1), (1.0 - change.at, q, 0)):
            if off * length <= SHORTEST / 4 and change.sets[side] not in vertex.values:
                vertex.values[change.sets[side]] = change.values[side]
                del self.edges[ends]  # is looked at anew
                return
        place = p.place + change.at * (q.place - p.place)
        edge.split, edge.must = MeshVertex(place, dict(zip(change.sets, change.values, strict=True))), True

    def _across_both(self, edge: MeshEdge, p: MeshVertex, q: MeshVertex) -> Asking[bool]:
        """Split an edge along a boundary where others cross that: they are looked for on both sides of it."""
        places: list[Array] = []
        values: Values = {}
        for sign in (2.0, -2.0):
            shift = sign * NARROW * _normal(p.place, q.place)
            start, end = p.place + shift, q.place + shift
            samples = yield [start, end]
            if samples[0].held != samples[1].held:
                change = yield from changeover(start, end, samples, self._walls)
                places.append(start + change.at * (end - start) - shift)
                values.update(zip(change.sets, change.values, strict=True))
        if len(places) < 2 or np.linalg.norm(places[0] - places[1]) > SHORTEST:
            return False
        edge.split, edge.must = MeshVertex((places[0] + places[1]) / 2, values), True
        return True

    def _along(self, edge: MeshEdge, p: MeshVertex, q: MeshVertex, sets: tuple[ActiveSet, ActiveSet]) -> Asking[bool]:
        """Look at an edge along a boundary of two regions; tell whether it is one."""
        lines = []
        for share in (0.5, 0.25):
            place = (1.0 - share) * p.place + share * q.place
            across = yield from self._across(place, q.place - p.place, sets)
            if across is None:
                return False
            lines.append((place, *across))
        (middle, line, here), (quarter, _, there) = lines
        centre = here.continued(0.5)
        for one, value in zip(here.sets, centre, strict=True):
            beside = there.continued(0.5)[there.sets.index(one)]
            edge.middle[one] = value
            edge.off[one] = self._apart(_at_quarter(p.values[one], value, q.values[one]), beside, quarter)
        edge.step = self._apart(*centre, middle)
        shift = (here.at - 0.5) * line
        edge.bend = float(np.linalg.norm(shift))
        edge.jumps = bool(self._apart(*here.values, middle).max() > max(self.error / 2, self._rounding))
        edge.split = MeshVertex(middle + shift, dict(zip(here.sets, here.values, strict=True)))
        edge.straight = MeshVertex(middle, dict(edge.middle))
        return True

    def _across(
        self, place: Array, along: Array, sets: tuple[ActiveSet, ActiveSet]
    ) -> Asking[tuple[Array, Changeover] | None]:
        """Find the boundary on a line across an edge at a place; the line's middle is that place."""
        normal = np.array([-along[1], along[0]])  # as long as the edge
        reach = max(ACROSS, 3.0 * NARROW / float(np.linalg.norm(along)))
        while reach <= FURTHEST:
            start, end = place - reach * normal, place + reach * normal
            samples = yield [start, end]
            if {sample.held for sample in samples} == set(sets):
                change = yield from changeover(start, end, samples, self._walls)
                return (end - start, change) if set(change.sets) == set(sets) else None
            reach *= WIDER
        return None

    def _judge(self, waiting: Sequence[Triangle], *, last: bool) -> None:
        """Finish the triangles that are good enough, and mark what is to be split of the others."""
        last = last or self.sampler.spent
        if last:  # as they are, with the errors that they have
            for edge in self.edges.values():
                edge.must = False
        looked = [(one, [self.edges.get(ends) for ends in one.edges]) for one in waiting]
        ready = [one for one, edges in looked if all(edge and (last or not edge.must) for edge in edges)]
        ready.sort(key=lambda one: sum(map(self._dear, one.edges)))
        self._run([self._settle(one, last) for one in ready], last=last)

    def _leave(self, triangle: Triangle) -> None:
        """Finish a triangle that was not looked at: undecided, but for a motion that its corners have in common."""
        corners = [self.vertices[k].values for k in triangle.corners]
        sets = [one for one in corners[0] if all(one in values for values in corners[1:])]
        triangle.held = next((one for one in sets if np.isfinite(corners[0][one][0])), UNDECIDED)
        triangle.values = np.full((6, 1 + len(self._walls)), np.nan)
        if triangle.held != UNDECIDED:
            ends = np.array([values[triangle.held] for values in corners])
            triangle.values = np.vstack([ends, (ends + np.roll(ends, -1, axis=0)) / 2.0])
        triangle.errors, triangle.finished = np.full(2, np.nan), True

    def _settle(self, triangle: Triangle, last: bool) -> Asking[None]:
        corners = [self.vertices[k].values for k in triangle.corners]
        sets = [one for one in corners[0] if one in corners[1] and one in corners[2]]
        centre = self.places(triangle).mean(axis=0)
        (sample,) = yield [centre]
        if sample.held not in sets:
            beside = yield from self._beside(centre, sample, list(np.eye(2)))
            held = next((one for one in beside if one in sets), None) or next(iter(beside))
            sample = Sample(held, beside[held])
        edges = [self.edges[ends] for ends in triangle.edges]
        least = self.size(triangle) <= SHORTEST
        if sample.held not in sets:
            if not self._mixed(triangle, sample, last or least):
                triangle.split = MeshVertex(centre, {})
            return
        held = triangle.held = sample.held
        missing = [edge for edge in edges if held not in edge.middle]
        if missing:
            if last or least:
                self._mixed(triangle, sample, True)
            for edge in missing:
                edge.must = not last and edge.split is not None
            return
        triangle.values = np.array([*(values[held] for values in corners), *(edge.middle[held] for edge in edges)])
        inside = self._apart(np.array([-1, -1, -1, 4, 4, 4]) / 9 @ triangle.values, sample.values, centre)
        # jumps are in the strips of `finished`
        costs = np.array([SAFETY * edge.off[held] + STRIP * edge.step * float(not edge.jumps) for edge in edges])
        costs = np.nan_to_num(costs)
        triangle.errors = costs.sum(axis=0) + SAFETY * inside + self._rounding
        if not last:
            self._mark(triangle, edges, costs.max(axis=1))
        triangle.finished = not any(edge.must for edge in edges)

    def _mark(self, triangle: Triangle, edges: list[MeshEdge], costs: Array) -> None:
        """Mark the edges of a triangle that are to be split."""
        places = self.places(triangle)
        lengths = np.linalg.norm(places - np.roll(places, -1, axis=0), axis=1)
        coarse = triangle.errors.max() > self.error and self.sampler.effort < 0.5
        for edge, length, cost in zip(edges, lengths, costs, strict=True):
            bent = edge.jumps and edge.bend > STRAIGHT
            edge.must |= bool(length > SHORTEST and (bent or (coarse and cost > LARGER * self.error)))
        if coarse and not any(edge.must for edge in edges):
            k = int(np.argmax(lengths))
            edges[k].must = bool(lengths[k] > SHORTEST)

    def _mixed(self, triangle: Triangle, sample: Sample, must: bool) -> bool:
        """Finish a triangle in which regions meet if its values differ little, or if it must be.

        One that must, and has motions in some places and none in others, is undecided, unless it is but a speck.
        """
        around = [Sample(*one) for k in triangle.corners for one in self.vertices[k].values.items()]
        if must:  # what is known on its edges counts, too
            splits = [edge.split for ends in triangle.edges if (edge := self.edges.get(ends)) and edge.split]
            around += [Sample(*one) for split in splits for one in split.values.items()]
        moving = [one for one in (*around, sample) if np.isfinite(one.values[0])]
        if not must and (len(moving) <= len(around) or any(self.edges[ends].must for ends in triangle.edges)):
            return False
        centre = self.places(triangle).mean(axis=0)
        apart = [self._apart(one.values, two.values, centre) for one, two in combinations(moving, 2)]
        errors = SAFETY * np.max(apart or [np.zeros(2)], axis=0) + self._rounding
        if not must and errors.max() > self.error:
            return False
        if moving and len(moving) <= len(around) and self.size(triangle) > 2.0 * SHORTEST:
            self._leave(triangle)
            return True
        if moving and sample.held.kind == REJECTED.kind:  # by a corner's: a speck is no region
            sample = moving[0]
        triangle.held, triangle.errors, triangle.finished = sample.held, errors, True
        triangle.values = np.tile(sample.values, (6, 1))
        return True

    def _fill(self, vertex: MeshVertex) -> Asking[None]:
        """Give a vertex its values."""
        (sample,) = yield [vertex.place]
        vertex.values = dict((yield from self._beside(vertex.place, sample, list(np.eye(2)))))

    def _apart(self, one: Array, two: Array, place: Array) -> Array:
        """Return by what two motions differ: in amount, and in the largest displacement of a vertex that moves."""
        if np.isnan(one[0]) or np.isnan(two[0]):
            return np.zeros(2)
        scales, moved = self.sampler.scales(place), 0.0
        for part, body, carrying in self._carried:
            change = carrying.transform(one[1:]) - carrying.transform(two[1:])
            made = body.seed + scales[part] * (body.vertices - body.seed)
            moved = max(moved, float(np.linalg.norm(made @ change[:3, :3].T + change[:3, 3], axis=1).max()))
        return np.array([abs(one[0] - two[0]), moved])


def _normal(start: Array, end: Array) -> Array:
    """Return the unit vector to the left of an edge."""
    x, y = (end - start) / np.linalg.norm(end - start)
    return np.array([-y, x])


def _at_quarter(start: Array, middle: Array, end: Array) -> Array:
    """Return the parabola through three values at a quarter of the way."""
    return np.asarray(0.375 * start + 0.75 * middle - 0.125 * end)
