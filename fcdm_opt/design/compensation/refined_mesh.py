"""Refines a mesh until the motion is known to within an error everywhere.

An edge whose ends have no active set in common is split where the active set changes, unless motions along it are
linear to within the error whatever holds them; one along a boundary where the motion jumps is bent to it; any is halved
where quadratic interpolation along it is too coarse. What the time does not do for is undecided.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from itertools import combinations, product

import numpy as np

from fcdm_opt.design.compensation.sampling import REJECTED, UNDECIDED, ActiveSet, Asking, Sample, Sampler
from fcdm_opt.design.compensation.size_mesh import (
    NARROW,
    STRIP,
    Changeover,
    Ends,
    MeshEdge,
    MeshVertex,
    Simplex,
    SizeMesh,
    Values,
    changeover,
)
from fcdm_opt.design.compensation.table import amounts_of, nodes_of, quadratic_basis
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.facet_errors import round_surfaces
from fcdm_opt.tolerances import DEFAULT

GRID = (0.0, 0.2573, 0.5091, 0.7537, 1.0)  # of the first vertices: off the middle, where boundaries like to be
COARSER = {1: 1, 2: 2, 3: 2}  # every which of them, for so many sizes; of more, and of round parts, every fourth
SHARE = 1e-4  # of the largest amount: error that is asked for by default
SAFETY = 2.0  # times the errors at points that fix a cubic's part beyond the quadratic: on edges, and the centre
SHORTEST = 2.0**-14  # of the box: edges are not split further
ACROSS = 2.0**-8, 0.0234, 0.14  # of an edge: how far off it its boundary is looked for
STRAIGHT = 1e-6  # of the box: a boundary at which the motion jumps is followed this closely
CONVEX = 4.0  # times what a convex or concave function of one size is off its chord at a quarter of it: anywhere
LONG = 0.3  # of the box: edges of which more than one place is looked at, where that says that motions are linear
LARGER = 0.25  # share of the allowed error that makes an edge be split
WAVES = 80
BATCH = 16  # searches side by side: those before are through when the time is over


class RefinedMesh(SizeMesh):
    """A mesh refined until amount and motion are off by at most `error`; None: by a share of the largest amount."""

    def __init__(self, sampler: Sampler, error: float | None) -> None:
        self.sampler = sampler
        scene = sampler.scene
        self._carried = [(part, scene.bodies_made[part], carrying) for part, carrying in scene.kinematics.items()]
        self._walls = np.array([own.limits for own in scene.coordinates])
        self._rounding = DEFAULT.touch * scene.size
        dear = any(map(round_surfaces, scene.drawn.values()))  # solves of round parts take a second each
        every = 4 if dear else COARSER.get(len(sampler.over), 4)
        grid = sorted({*GRID[::every], GRID[-1]})
        places = [np.array(place[::-1]) for place in product(grid, repeat=len(sampler.over))]
        samples = sampler.samples(places)
        vertices = [
            MeshVertex(place, {} if sample is None else dict([sample]))
            for place, sample in zip(places, samples, strict=True)
        ]
        super().__init__(vertices, len(grid))
        self._axes = list(np.eye(self.sizes))
        known = [sample for sample in samples if sample is not None]
        held = [sample.held for sample in known]
        # may hold on a boundary only: what holds nowhere else, or both sides together
        separate = {one for one in held if held.count(one) == 1 or any(other.is_part_of(one) for other in held)}
        self._run([self._fill(vertex) for vertex in vertices if not separate.isdisjoint(vertex.values)])
        largest = max((float(sample.values[0]) for sample in known if np.isfinite(sample.values[0])), default=0.0)
        self.error = max(SHARE * largest, self._rounding) if error is None else error

    def refine(self) -> None:
        """Refine until every simplex is within the error, or the budget or the time is spent."""
        for wave in range(WAVES):
            waiting = [simplex for simplex in self.simplices if not simplex.finished]
            if not waiting:
                return
            self._look(waiting)
            self._judge(waiting, last=wave == WAVES - 1)
            if self.sampler.late:
                break
            later, made = self._held_back(), self.made
            for edge in later:
                edge.must = False
            self.subdivide()
            for edge in later:
                edge.must = True
            if self.made == made and not any(ends not in self.edges for one in waiting for ends in one.edges):
                break
        self._judge([simplex for simplex in self.simplices if not simplex.finished], last=True)
        for simplex in self.simplices:
            if not simplex.finished:
                self._leave(simplex)

    def _held_back(self) -> list[MeshEdge]:
        """Return the shortest of the edges that are to be split, never all: what is new about these takes too long."""
        counts = Counter(ends for simplex in self.simplices for ends in simplex.edges)
        cut = [ends for ends in counts if (edge := self.edges.get(ends)) and edge.must]
        cut.sort(key=self.length, reverse=True)
        room = self.made * (1.0 / self.sampler.effort - 1.0)
        taken = np.cumsum([2 * counts[ends] for ends in cut])
        return [self.edges[ends] for ends, cost in zip(cut[1:], taken[1:], strict=True) if cost > room]

    def _run(self, searches: Sequence[Asking[None]], *, last: bool = False) -> list[bool]:
        """Run searches side by side: what they ask for is solved in one go; tell which came to their end."""
        # they are given up when refining has used its share of the time, with `last` when all the time is over
        ended = [False] * len(searches)
        for first in range(0, len(searches), BATCH):
            asked = {k: next(searches[k], None) for k in range(first, min(first + BATCH, len(searches)))}
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

    def _look(self, waiting: Sequence[Simplex]) -> None:
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
        places = [0.75 * p.place + 0.25 * q.place, 0.5 * (p.place + q.place)]
        chord = [0.75 * p.some + 0.25 * q.some, 0.5 * (p.some + q.some)]
        samples = yield places[:1]
        edge.kink = CONVEX * self._off(chord, [samples[0].values], places)
        same = all(self._alike(own.some, own.values[one], own.place) for own in (p, q) for one in sets or own.values)
        if same and samples[0].held in sets and self._within(edge.kink) and self.length(ends) <= LONG:
            samples = [*samples, Sample(samples[0].held, chord[1])]
        else:
            samples = [*samples, *(yield places[1:])]
            edge.kink = self._off(chord, [sample.values for sample in samples], places)
        quarter, middle = samples
        edge.split = MeshVertex(places[1], dict([middle]))
        if not sets:
            if not (same and self._within(edge.kink)):
                yield from self._changing(ends, edge, p, q, samples)
            return
        off = self._off([_at_quarter(p.some, middle.values, q.some)], [quarter.values], places)
        if same and self._within(SAFETY * off) and ({quarter.held, middle.held} <= {*sets} or self._within(edge.kink)):
            edge.middle, edge.off = dict.fromkeys(sets, middle.values), dict.fromkeys(sets, off)
            edge.split.values.update(edge.middle)
            return
        if len(sets) > 1 and (yield from self._along(edge, p, q, self._unlike(p, sets), samples)):
            return
        both: list[MeshVertex] = []
        for place, sample in zip(places, samples, strict=True):
            values = dict([sample])
            if sets != [sample.held]:
                values = yield from self._across(place, sample, _normals(q.place - p.place))
            both.append(MeshVertex(place, values))
            if values.keys().isdisjoint(sets):
                edge.split, edge.must = both[-1], True
                return
        before, edge.split = both
        edge.kink = self._off(chord, [own.some for own in both], places)
        for one in sets:
            if one in before.values and one in edge.split.values:
                edge.middle[one] = edge.split.values[one]
                there = _at_quarter(p.values[one], edge.middle[one], q.values[one])
                edge.off[one] = self._apart(there, before.values[one], places[0])

    def _unlike(self, vertex: MeshVertex, sets: Sequence[ActiveSet]) -> tuple[ActiveSet, ActiveSet]:
        """Return those two of some active sets that differ most at a vertex."""
        off = {
            (a, b): self._apart(vertex.values[a], vertex.values[b], vertex.place).max()
            for a, b in combinations(sets, 2)
        }
        return max(off, key=off.__getitem__)

    def _alike(self, one: Array, two: Array, place: Array) -> bool:
        """Tell whether two motions are the same, to a share of the error that is allowed."""
        return self._within(self._off([one], [two], [place]))

    def _within(self, off: Array) -> bool:
        """Tell whether motions that differ by so much are the same, to a share of the error that is allowed."""
        return bool(off.max() <= max(LARGER * self.error, self._rounding))

    def _off(self, values: Sequence[Array], found: Sequence[Array], places: Sequence[Array]) -> Array:
        """Return the most by which motions differ from those found; infinite where one of them is none."""
        triples = list(zip(values, found, places, strict=False))
        if not np.isfinite([[one[0], two[0]] for one, two, _ in triples]).all():
            return np.full(2, np.inf)
        return np.max([self._apart(*triple) for triple in triples], axis=0)

    def _across(self, place: Array, sample: Sample, directions: Sequence[Array]) -> Asking[Values]:
        """Return the active sets on either side of a place, continued to it; its own where none holds for a stretch.

        On a boundary two active sets hold at once, in a strip as narrow as rounding, which is no region.
        """
        steps = [sign * NARROW * direction for direction in directions for sign in (2.0, -2.0)]
        samples = yield [place + times * step for step in steps for times in (1.0, 2.0)]
        neighbours = {
            near.held: 2.0 * near.values - far.values
            for near, far in zip(samples[::2], samples[1::2], strict=True)
            if near.held == far.held
        }
        return neighbours or dict([sample])

    def _changing(
        self, ends: Ends, edge: MeshEdge, p: MeshVertex, q: MeshVertex, between: Sequence[Sample]
    ) -> Asking[None]:
        """Split an edge where the active set changes; where that is at an end, the end gets the one beyond it, too."""
        jump = any(
            not self._within(self._apart(own.some, value, own.place)) for own in (p, q) for value in own.values.values()
        )
        if jump and min(len(p.values), len(q.values)) > 1 and (yield from self._across_both(edge, p, q)):
            return
        sets = [
            near.held if near.held in own.values else next(reversed(own.values))
            for own, near in zip((p, q), between, strict=True)
        ]
        here, there = (Sample(one, own.values[one]) for one, own in zip(sets, (p, q), strict=True))
        known = [(0.0, here), (0.25, between[0]), (0.5, between[1]), (1.0, there)]
        change = yield from changeover(p.place, q.place, known, self._walls, self._alike)
        length = float(np.linalg.norm(q.place - p.place))
        for off, vertex, side in ((change.at, p, 1), (1.0 - change.at, q, 0)):
            if off * length <= SHORTEST / 4 and change.sets[side] not in vertex.values:
                self._between(vertex, change).values[change.sets[side]] = change.values[side]
                del self.edges[ends]  # is looked at anew
                return
        place = p.place + change.at * (q.place - p.place)
        values = dict(zip(change.sets, change.values, strict=True))
        edge.split, edge.must = self._between(MeshVertex(place, values), change), True

    def _between(self, vertex: MeshVertex, change: Changeover) -> MeshVertex:
        """Note how far the motion jumps at a vertex on a boundary; return the vertex."""
        vertex.step = self._apart(*change.values, vertex.place)
        vertex.jumps = bool(vertex.step.max() > max(self.error / 2, self._rounding))
        return vertex

    def _across_both(self, edge: MeshEdge, p: MeshVertex, q: MeshVertex) -> Asking[bool]:
        """Split an edge along a boundary where others cross that: they are looked for on both sides of it."""
        places: list[Array] = []
        values: Values = {}
        for normal, sign in product(_normals(q.place - p.place)[:1], (2.0, -2.0)):
            shift = sign * NARROW * normal
            change = yield from self._change(p.place + shift, q.place + shift)
            if change is not None:
                places.append(p.place + change.at * (q.place - p.place))
                values.update(zip(change.sets, change.values, strict=True))
        if len(places) < 2 or np.linalg.norm(places[0] - places[1]) > SHORTEST:
            return False
        place, shift = (places[0] + places[1]) / 2, 4.0 * NARROW * normal
        along = 4.0 * NARROW * (q.place - p.place) / float(np.linalg.norm(q.place - p.place))
        # the boundary has a corner there, off the edge: it is followed to that
        near = yield from self._change(place + along - shift, place + along + shift)
        far = yield from self._change(place + 2.0 * along - shift, place + 2.0 * along + shift)
        if near is not None and far is not None and {*near.sets} == {*far.sets}:
            place = place + (4.0 * near.at - 2.0 * far.at - 1.0) * shift
        edge.split, edge.must = MeshVertex(place, values), True
        return True

    def _change(self, start: Array, end: Array, sets: Collection[ActiveSet] = ()) -> Asking[Changeover | None]:
        """Find where the active set changes between two places; None where it is the same, or not one of `sets`."""
        samples = yield [start, end]
        held = {sample.held for sample in samples}
        if len(held) == 1 or (sets and held != {*sets}):
            return None
        known = list(zip((0.0, 1.0), samples, strict=True))
        return (yield from changeover(start, end, known, self._walls, self._alike))

    def _along(
        self, edge: MeshEdge, p: MeshVertex, q: MeshVertex, sets: tuple[ActiveSet, ActiveSet], samples: Sequence[Sample]
    ) -> Asking[bool]:
        """Look at an edge along a boundary of two regions; tell whether it is one."""
        normals, found = _normals(q.place - p.place), []
        if not normals:
            return False
        lines = [max(float(np.linalg.norm(q.place - p.place)), NARROW) * normal for normal in normals]
        for share, sample in zip((0.5, 0.25), samples[::-1], strict=True):
            place = (1.0 - share) * p.place + share * q.place
            across = yield from self._crossing(place, lines, sets, sample)
            if across is None:
                return False
            found.append((place, *across))
        (middle, line, here), (quarter, _, there) = found
        centre = here.continued(0.5)
        for one, value in zip(here.sets, centre, strict=True):
            nearest = there.continued(0.5)[there.sets.index(one)]
            edge.middle[one] = value
            edge.off[one] = self._apart(_at_quarter(p.values[one], value, q.values[one]), nearest, quarter)
        edge.step = self._apart(*centre, middle)
        shift = (here.at - 0.5) * line
        edge.bend = float(np.linalg.norm(shift))
        edge.split = self._between(MeshVertex(middle + shift, dict(zip(here.sets, here.values, strict=True))), here)
        edge.jumps = edge.split.jumps
        edge.straight = MeshVertex(middle, dict(edge.middle))
        return True

    def _crossing(
        self, place: Array, lines: Sequence[Array], sets: tuple[ActiveSet, ActiveSet], sample: Sample
    ) -> Asking[tuple[Array, Changeover] | None]:
        """Find the boundary on one of some lines through a place, which is the middle of what is looked at of it."""
        across = yield from self._across(place, sample, [line / np.linalg.norm(line) for line in lines])
        if {*across} == {*sets}:
            one, two = (across[own] for own in sets)
            return lines[0], Changeover(0.5, sets, (one, two), ([(0.5, one)], [(0.5, two)]))
        for line, off in product(lines, ACROSS):
            shift = max(off, 3.0 * NARROW / float(np.linalg.norm(line))) * line
            change = yield from self._change(place - shift, place + shift, sets)
            if change is not None and {*change.sets} == {*sets}:
                return 2.0 * shift, change
        return None

    def _judge(self, waiting: Sequence[Simplex], *, last: bool) -> None:
        """Finish the simplices that are good enough, and mark what is to be split of the others."""
        last = last or self.sampler.spent
        if last:  # as they are, with the errors that they have
            for edge in self.edges.values():
                edge.must = False
        looked = [(one, [self.edges.get(ends) for ends in one.edges]) for one in waiting]
        ready = [one for one, edges in looked if all(edge and (last or not edge.must) for edge in edges)]
        ready.sort(key=lambda one: sum(map(self._dear, one.edges)))
        self._run([self._settle(one, last) for one in ready], last=last)

    def _leave(self, simplex: Simplex) -> None:
        """Finish a simplex that was not looked at: undecided, but for a motion that its corners have in common."""
        corners = [self.vertices[k].values for k in simplex.corners]
        sets = [one for one in corners[0] if all(one in values for values in corners[1:])]
        simplex.held = next((one for one in sets if np.isfinite(corners[0][one][0])), UNDECIDED)
        nothing = np.full(1 + len(self._walls), np.nan)
        simplex.values = nodes_of(np.array([values.get(simplex.held, nothing) for values in corners]))
        simplex.errors, simplex.finished = np.full(2, np.nan), True

    def _settle(self, simplex: Simplex, last: bool) -> Asking[None]:
        corners = [self.vertices[k].values for k in simplex.corners]
        sets = [one for one in corners[0] if all(one in values for values in corners[1:])]
        centre = self.places(simplex).mean(axis=0)
        (sample,) = yield [centre]
        edges = [self.edges[ends] for ends in simplex.edges]
        exact = sample.held in sets and all(sample.held in edge.middle for edge in edges)
        if not exact and self._interpolated(simplex, edges, sample, centre):
            return
        if sample.held not in sets:
            across = yield from self._across(centre, sample, self._axes)
            held = next((one for one in across if one in sets), None) or next(iter(across))
            sample = Sample(held, across[held])
        held = simplex.held = sample.held
        for ends, edge in zip(simplex.edges, edges, strict=True):
            if held in sets and held not in edge.middle and self.length(ends) <= SHORTEST:  # not split
                p, q = (self.vertices[k] for k in ends)
                edge.middle[held], edge.off[held] = (p.values[held] + q.values[held]) / 2.0, np.zeros(2)
        missing = [held not in edge.middle for edge in edges]
        if held not in sets or any(missing):
            if not self._mixed(simplex, sample, last or self.size(simplex) <= SHORTEST):
                kinked = [not self._within(edge.kink) for edge in edges]
                self._halve(simplex, missing if held in sets else kinked)
            return
        simplex.values = np.array([*(values[held] for values in corners), *(edge.middle[held] for edge in edges)])
        middle = quadratic_basis(np.full((len(corners), 1), 1.0 / len(corners)))[:, 0]
        inside = self._apart(middle @ simplex.values, sample.values, centre)
        # jumps are in the strips of `finished`
        costs = np.array([SAFETY * edge.off[held] + STRIP * edge.step * float(not edge.jumps) for edge in edges])
        costs = np.nan_to_num(costs)
        steps = np.max([self.vertices[k].step * float(not self.vertices[k].jumps) for k in simplex.corners], axis=0)
        simplex.errors = costs.sum(axis=0) + SAFETY * (steps + inside) + self._rounding
        if not last:
            self._mark(simplex, edges, costs.max(axis=1))
        simplex.finished = not any(edge.must for edge in edges)

    def _mark(self, simplex: Simplex, edges: list[MeshEdge], costs: Array) -> None:
        """Mark the edges of a simplex that are to be split."""
        lengths = self.lengths(simplex)
        coarse = simplex.errors.max() > self.error and not self.sampler.rough
        for edge, length, cost in zip(edges, lengths.tolist(), costs.tolist(), strict=True):
            bent = edge.jumps and edge.bend > STRAIGHT
            edge.must |= bool(length > SHORTEST and (bent or (coarse and cost > LARGER * self.error)))
        if coarse and not any(edge.must for edge in edges):
            self._halve(simplex)

    def _halve(self, simplex: Simplex, which: Sequence[bool] = ()) -> None:
        """Mark the longest edge of a simplex to be split, of `which` where there are any."""
        lengths = self.lengths(simplex)
        longest = int(np.argmax(lengths * (np.array(which) if any(which) else 1.0)))
        self.edges[simplex.edges[longest]].must = bool(lengths[longest] > SHORTEST)

    def _interpolated(self, simplex: Simplex, edges: Sequence[MeshEdge], sample: Sample, centre: Array) -> bool:
        """Finish a simplex in which regions meet if what its corners say of motions in it is good enough."""
        # where motions are convex functions of the sizes, or concave ones, they are off by no more than their number of
        # corners times what they are off in the centre: a part of it is a copy of the whole about the centre
        ends = np.array([self.vertices[k].some for k in simplex.corners])
        kinks = [edge.kink for edge in edges]
        off = np.max([*kinks, self._off([ends.mean(axis=0)], [sample.values], [centre])], axis=0)
        errors = len(ends) * off + self._rounding
        if errors.max() > self.error:
            return False
        held = Counter([sample.held, *(one for k in simplex.corners for one in 2 * [*self.vertices[k].values])])
        simplex.held = max(held, key=held.__getitem__)
        simplex.values, simplex.errors, simplex.finished = nodes_of(ends), errors, True
        return True

    def _mixed(self, simplex: Simplex, sample: Sample, must: bool) -> bool:
        """Finish a simplex in which regions meet if no sizes have a motion, or if it must be: undecided, or a speck."""
        splits = [edge.split for ends in simplex.edges if (edge := self.edges.get(ends)) and edge.split]
        around = [*(self.vertices[k] for k in simplex.corners), *splits]
        moving = [one for own in around for one in own.values.items() if np.isfinite(one[1][0])]
        moving += [sample] * bool(np.isfinite(sample.values[0]))
        if moving and not must:
            return False
        if moving and self.size(simplex) > 2.0 * SHORTEST:
            self._leave(simplex)
            return True
        centre = self.places(simplex).mean(axis=0)
        apart = [self._apart(one[1], two[1], centre) for one, two in combinations(moving, 2)]
        if moving and sample.held.kind == REJECTED.kind:  # by a corner's: a speck is no region
            sample = Sample(*moving[0])
        simplex.held, simplex.finished = sample.held, True
        simplex.errors = SAFETY * np.max(apart or [np.zeros(2)], axis=0) + self._rounding
        simplex.values = nodes_of(np.tile(sample.values, (len(simplex.corners), 1)))
        return True

    def _fill(self, vertex: MeshVertex) -> Asking[None]:
        aside = 2.0 * NARROW * np.sqrt(np.arange(1.0, 1.0 + self.sizes))
        sample, near = yield [vertex.place, vertex.place + aside]
        vertex.values = dict([sample])
        if near.held != sample.held:
            vertex.values = dict((yield from self._across(vertex.place, sample, self._axes)))

    def _apart(self, one: Array, two: Array, place: Array) -> Array:
        """Return by what two motions differ: in amount, and in the largest displacement of a vertex that moves."""
        if np.isnan(one[0]) or np.isnan(two[0]):
            return np.zeros(2)
        scales, moved = self.sampler.scales(place), 0.0
        for part, body, carrying in self._carried:
            change = carrying.transform(one[1:]) - carrying.transform(two[1:])
            made = body.seed + scales[part] * (body.vertices - body.seed)
            moved = max(moved, float(np.linalg.norm(made @ change[:3, :3].T + change[:3, 3], axis=1).max()))
        here, there = (amounts_of(own[1:], own[0], self.sampler.weights) for own in (one, two))
        return np.array([abs(here - there), moved])


def _normals(along: Array) -> list[Array]:
    """Return unit vectors across an edge, normal to each other: none of one size."""
    return list(np.linalg.svd(along[None])[2][1:])


def _at_quarter(start: Array, middle: Array, end: Array) -> Array:
    """Return the parabola through three values at a quarter of the way."""
    return np.asarray(0.375 * start + 0.75 * middle - 0.125 * end)
