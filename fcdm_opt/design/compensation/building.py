"""Refines a mesh until the motion is known to within an error everywhere.

An edge whose ends have no way in common is split where the way changes; one along a boundary is bent to it; any is
halved where quadratic interpolation along it is too coarse.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from itertools import combinations

import numpy as np

from fcdm_opt.design.compensation.answers import Node
from fcdm_opt.design.compensation.crossing import NARROW, Crossing, crossing
from fcdm_opt.design.compensation.mesh import STRIP, Edge, Ends, Mesh, Triangle, Values, Vertex, area
from fcdm_opt.design.compensation.nodes import Nodes
from fcdm_opt.design.compensation.ways import MOTIONLESS, REJECTED, Way
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.model.task import Task
from fcdm_opt.tolerances import DEFAULT

GRID = (0.0, 0.2573, 0.5091, 0.7537, 1.0)  # of the first vertices: off the middle, where boundaries like to be
SHARE = 1e-4  # of the largest amount: error that is asked for by default
SAFETY = 2.0  # times the errors at the four points that fix a cubic's part beyond the quadratic
SHORTEST = 2.0**-14  # of the box: edges are not split further
ACROSS, WIDER, FURTHEST = 2.0**-8, 6.0, 0.3  # of an edge: how far off it its boundary is looked for
STRAIGHT = 1e-6  # of the box: a boundary at which the motion jumps is followed this closely
INSIDE = 0.05  # least barycentric coordinate of a point that splits a triangle in three
LARGER = 0.25  # share of the allowed error that makes an edge be split
WAVES = 80
CHECKED = 24  # triangles in whose centres least motions are proved

Looking = Generator[list[Array], list[Node], None]


class Building(Mesh):
    """A mesh that is refined.

    Parameters
    ----------
    nodes : Nodes
    error : float or None
        Length that amount and motion may be off by; None: a share of the largest amount.

    Attributes
    ----------
    error : float
    """

    def __init__(self, nodes: Nodes, error: float | None) -> None:
        self.nodes = nodes
        problem = nodes.problem
        self._task = Task.of(problem)
        self._arms = problem.movable.vertices - problem.movable.seed
        self._seed = problem.movable.seed
        self._rounding = DEFAULT.touch * problem.size
        places = [np.array([x, y]) for y in GRID for x in GRID]
        found = nodes.solved(places, proved=True)
        super().__init__([Vertex(place, _own(node)) for place, node in zip(places, found, strict=True)], len(GRID))
        largest = max((float(node.values[0]) for node in found if np.isfinite(node.values[0])), default=0.0)
        self.error = max(SHARE * largest, self._rounding) if error is None else error

    def refine(self) -> None:
        """Refine until every triangle is within the error, or the budget is spent."""
        for wave in range(WAVES):
            waiting = [triangle for triangle in self.triangles if not triangle.finished]
            if not waiting:
                return
            self._look(waiting)
            self._judge(waiting, last=wave == WAVES - 1)
            fresh = [own.split for own in self.triangles if own.split is not None and not own.finished]
            self._run([self._filled(vertex) for vertex in fresh])
            self.subdivide()

    def checked(self) -> list[Array]:
        """Return centres of the largest triangles: places where to prove what is known from around."""
        order = sorted(self.triangles, key=lambda own: (-area(self.places(own)), own.corners))
        return [self.places(own).mean(axis=0) for own in order[:CHECKED]]

    # ----------------------------------------------------------------------------------------------------------- edges

    def _look(self, waiting: Sequence[Triangle]) -> None:
        """Look at the edges that have not been looked at."""
        new = [ends for ends in dict.fromkeys(e for own in waiting for e in own.edges) if ends not in self.edges]
        self.edges.update({ends: Edge() for ends in new})
        self._run([self._edge(ends) for ends in new])

    def _edge(self, ends: Ends) -> Looking:
        p, q = (self.vertices[k] for k in ends)
        edge, ways = self.edges[ends], [way for way in p.values if way in q.values]
        if not ways:
            yield from self._changing(ends, edge, p, q)
            return
        if len(ways) > 1 and (yield from self._along(edge, p, q, (ways[0], ways[1]))):
            return
        places = 0.5 * (p.place + q.place), 0.75 * p.place + 0.25 * q.place
        nodes = yield list(places)
        found: list[Values] = []
        for place, node in zip(places, nodes, strict=True):
            beside = _own(node)
            if ways != [node.way]:
                beside = yield from self._beside(place, node, [_normal(p.place, q.place)])
            if not any(way in beside for way in ways):
                edge.split, edge.must = Vertex(place, beside), True
                return
            found.append(beside)
        for way in ways:
            if way in found[0] and way in found[1]:
                edge.middle[way] = found[0][way]
                there = _at_quarter(p.values[way], found[0][way], q.values[way])
                edge.off[way] = self._apart(there, found[1][way], places[1])
        edge.split = Vertex(places[0], found[0])

    def _beside(
        self, place: Array, node: Node, directions: Sequence[Array]
    ) -> Generator[list[Array], list[Node], Values]:
        """Return the ways on either side of a place, continued to it; its own where they do not hold for a stretch.

        On a boundary two ways hold at once, in a strip as narrow as rounding, which is no region.
        """
        steps = [sign * NARROW * way for way in directions for sign in (2.0, -2.0)]
        nodes = yield [place + times * step for step in steps for times in (1.0, 2.0)]
        found = {
            one.way: 2.0 * one.values - two.values
            for one, two in zip(nodes[::2], nodes[1::2], strict=True)
            if one.way == two.way
        }
        return found or _own(node)

    def _changing(self, ends: Ends, edge: Edge, p: Vertex, q: Vertex) -> Looking:
        """Split an edge where the way changes; where that is at an end, the end gets the way beyond it as well."""
        if min(len(p.values), len(q.values)) > 1 and (yield from self._across_both(edge, p, q)):
            return
        known = [(float(k), Node(*list(own.values.items())[-1])) for k, own in enumerate((p, q))]
        found = yield from crossing(p.place, q.place, known, self.nodes.problem.limits)
        length = float(np.linalg.norm(q.place - p.place))
        place = p.place + found.at * (q.place - p.place)
        for off, own, side in ((found.at, p, 1), (1.0 - found.at, q, 0)):
            if off * length <= SHORTEST / 4 and found.ways[side] not in own.values:
                own.values[found.ways[side]] = found.values[side]
                del self.edges[ends]  # is looked at anew
                return
        edge.split, edge.must = Vertex(place, dict(zip(found.ways, found.values, strict=True))), True

    def _across_both(self, edge: Edge, p: Vertex, q: Vertex) -> Generator[list[Array], list[Node], bool]:
        """Split an edge along a boundary where others cross that: they are looked for on both sides of it."""
        places: list[Array] = []
        values: Values = {}
        for sign in (2.0, -2.0):
            shift = sign * NARROW * _normal(p.place, q.place)
            start, end = p.place + shift, q.place + shift
            nodes = yield [start, end]
            if nodes[0].way != nodes[1].way:
                known = [(0.0, nodes[0]), (1.0, nodes[1])]
                found = yield from crossing(start, end, known, self.nodes.problem.limits)
                places.append(start + found.at * (end - start) - shift)
                values.update(zip(found.ways, found.values, strict=True))
        if len(places) < 2 or np.linalg.norm(places[0] - places[1]) > SHORTEST:
            return False
        edge.split, edge.must = Vertex((places[0] + places[1]) / 2, values), True
        return True

    def _along(
        self, edge: Edge, p: Vertex, q: Vertex, ways: tuple[Way, Way]
    ) -> Generator[list[Array], list[Node], bool]:
        """Look at an edge along a boundary of two regions; tell whether it is one."""
        found = []
        for share in (0.5, 0.25):
            place = (1.0 - share) * p.place + share * q.place
            across = yield from self._across(place, q.place - p.place, ways)
            if across is None:
                return False
            found.append((place, *across))
        (middle, way, here), (quarter, _, there) = found
        centre = here.continued(0.5)
        for side, own in enumerate(here.ways):
            beside = there.continued(0.5)[there.ways.index(own)]
            edge.middle[own] = centre[side]
            edge.off[own] = self._apart(_at_quarter(p.values[own], centre[side], q.values[own]), beside, quarter)
        edge.step = self._apart(*centre, middle)
        shift = (here.at - 0.5) * way
        edge.bend = float(np.linalg.norm(shift))
        edge.jumps = bool(self._apart(*here.values, middle).max() > max(self.error / 2, self._rounding))
        edge.split = Vertex(middle + shift, dict(zip(here.ways, here.values, strict=True)))
        edge.straight = Vertex(middle, dict(edge.middle))
        return True

    def _across(
        self, place: Array, along: Array, ways: tuple[Way, Way]
    ) -> Generator[list[Array], list[Node], tuple[Array, Crossing] | None]:
        """Find the boundary on a line across an edge at a place; the line's middle is that place."""
        normal = np.array([-along[1], along[0]])  # as long as the edge
        reach = max(ACROSS, 3.0 * NARROW / float(np.linalg.norm(along)))
        while reach <= FURTHEST:
            start, end = place - reach * normal, place + reach * normal
            nodes = yield [start, end]
            if {node.way for node in nodes} == set(ways):
                found = yield from crossing(start, end, [(0.0, nodes[0]), (1.0, nodes[1])], self.nodes.problem.limits)
                return (end - start, found) if set(found.ways) == set(ways) else None
            reach *= WIDER
        return None

    # ------------------------------------------------------------------------------------------------------- triangles

    def _judge(self, waiting: Sequence[Triangle], *, last: bool) -> None:
        """Finish the triangles that are good enough, and mark what is to be split of the others."""
        last = last or self.nodes.spent
        if last:  # as they are, with the errors that they have
            for edge in self.edges.values():
                edge.must = False
        ready = [own for own in waiting if all(ends in self.edges for ends in own.edges)]
        ready = [own for own in ready if last or not any(self.edges[ends].must for ends in own.edges)]
        self._run([self._settle(own, last) for own in ready])

    def _run(self, searches: Sequence[Looking]) -> None:
        """Run searches side by side: what they ask for is solved in one go."""
        running = [(search, next(search, None)) for search in searches]
        while running := [(search, places) for search, places in running if places is not None]:
            found = iter(self.nodes.solved([place for _, places in running for place in places]))
            running = [(search, _sent(search, [next(found) for _ in places])) for search, places in running]

    def _settle(self, triangle: Triangle, last: bool) -> Looking:
        own = [self.vertices[k].values for k in triangle.corners]
        ways = [way for way in own[0] if way in own[1] and way in own[2]]
        centre = self.places(triangle).mean(axis=0)
        (node,) = yield [centre]
        if node.way not in ways:
            beside = yield from self._beside(centre, node, list(np.eye(2)))
            way = next((way for way in beside if way in ways), None) or next(iter(beside))
            node = Node(way, beside[way])
        edges = [self.edges[ends] for ends in triangle.edges]
        size = self.size(triangle)
        if node.way not in ways:
            if not self._mixed(triangle, node, last or size <= SHORTEST):
                triangle.split = Vertex(self._within(triangle, centre, node), {})
            return
        way = triangle.way = node.way
        missing = [edge for edge in edges if way not in edge.middle]
        if missing:
            if last or size <= SHORTEST:
                self._mixed(triangle, node, True)
            for edge in missing:
                edge.must = not last and edge.split is not None
            return
        triangle.values = np.array([*(values[way] for values in own), *(edge.middle[way] for edge in edges)])
        inside = self._apart(np.array([-1, -1, -1, 4, 4, 4]) / 9 @ triangle.values, node.values, centre)
        steps = [edge.step * float(not edge.jumps) for edge in edges]  # jumps are in the strips of `finished`
        costs = [SAFETY * edge.off[way] + STRIP * step for edge, step in zip(edges, steps, strict=True)]
        triangle.errors = np.nan_to_num(sum(costs)) + SAFETY * inside + self._rounding
        if not last:
            self._mark(triangle, edges, np.nan_to_num(np.array(costs)).max(axis=1))
        triangle.finished = not any(edge.must for edge in edges)

    def _mark(self, triangle: Triangle, edges: list[Edge], costs: Array) -> None:
        """Mark the edges of a triangle that are to be split."""
        places = self.places(triangle)
        lengths = np.linalg.norm(places - np.roll(places, -1, axis=0), axis=1)
        coarse = triangle.errors.max() > self.error and self.nodes.effort < 0.5
        for edge, length, cost in zip(edges, lengths, costs, strict=True):
            bent = edge.jumps and edge.bend > STRAIGHT
            edge.must |= bool(length > SHORTEST and (bent or (coarse and cost > LARGER * self.error)))
        if coarse and not any(edge.must for edge in edges):
            k = int(np.argmax(lengths))
            edges[k].must = bool(lengths[k] > SHORTEST)

    def _mixed(self, triangle: Triangle, node: Node, must: bool) -> bool:
        """Finish a triangle in which regions meet if its values differ little, or if it must be."""
        values = [own for k in triangle.corners for own in self.vertices[k].values.values()]
        found = [own for own in (*values, node.values) if np.isfinite(own[0])]
        if not must and (len(found) <= len(values) or any(self.edges[ends].must for ends in triangle.edges)):
            return False
        centre = self.places(triangle).mean(axis=0)
        apart = max((self._apart(node.values, own, centre) for own in found), key=max, default=np.zeros(2))
        apart = np.max([self._apart(one, two, centre) for one, two in combinations(found, 2)] or [apart], axis=0)
        errors = SAFETY * apart + self._rounding
        if not must and errors.max() > self.error:
            return False
        if found and node.way.kind == REJECTED.kind:  # by a corner's: a speck is no region
            corners = [own for k in triangle.corners for own in self.vertices[k].values.items()]
            node = next(Node(*own) for own in corners if np.isfinite(own[1][0]))
        triangle.way, triangle.errors, triangle.finished = node.way, errors, True
        triangle.values = np.tile(node.values, (6, 1))
        return True

    def _within(self, triangle: Triangle, centre: Array, node: Node) -> Array:
        """Return where a triangle in which regions meet is split: where they should, else in its centre."""
        places = self.places(triangle)
        size = float(np.ptp(places, axis=0).max())
        ways = list(dict.fromkeys(way for k in triangle.corners for way in self.vertices[k].values))
        fitted = {way: self._plane(way, centre, size) for way in ways if way.kind not in MOTIONLESS}
        planes = {way: plane for way, plane in fitted.items() if plane is not None}
        rows = []
        for one, two in combinations(planes, 2):
            for k in triangle.corners:
                own = self.vertices[k].values
                if one in own and two in own:
                    change = planes[one] - planes[two]
                    near = np.abs(own[one] - own[two]) <= 1e-2 * size * np.linalg.norm(change[1:], axis=0)
                    rows += list(change[:, near].T)
        if len(rows) < 2:
            return centre
        matrix = np.array(rows)
        place = centre + np.linalg.lstsq(matrix[:, 1:], -matrix[:, 0], rcond=1e-6)[0]
        shares = np.linalg.solve(np.vstack([places.T, np.ones(3)]), np.append(place, 1.0))
        return place if shares.min() > INSIDE else centre

    def _plane(self, way: Way, centre: Array, size: float) -> Array | None:
        """Return constant and slopes, (3, 1 + k), of a way's values about a place, from the vertices around."""
        near = [own for own in self.vertices if way in own.values and np.abs(own.place - centre).max() <= 3.0 * size]
        if len(near) < 3:
            return None
        off = np.array([own.place - centre for own in near])
        weight = 1.0 / (np.linalg.norm(off, axis=1) / size + 0.1) ** 2
        matrix = np.column_stack([np.ones(len(near)), off]) * weight[:, None]
        values = np.array([own.values[way] for own in near]) * weight[:, None]
        return np.asarray(np.linalg.lstsq(matrix, values)[0])

    def _filled(self, vertex: Vertex) -> Looking:
        (node,) = yield [vertex.place]
        vertex.values.update((yield from self._beside(vertex.place, node, list(np.eye(2)))))

    def _apart(self, one: Array, two: Array, place: Array) -> Array:
        """Return by what two motions differ: in amount, and in the largest displacement of a vertex of body 1."""
        if np.isnan(one[0]) or np.isnan(two[0]):
            return np.zeros(2)
        change = self._task.transform(one[1:]) - self._task.transform(two[1:])
        made = self._seed + self.nodes.pair(place)[0] * self._arms
        moved = np.linalg.norm(made @ change[:3, :3].T + change[:3, 3], axis=1)
        return np.array([abs(one[0] - two[0]), moved.max()])


def _own(node: Node) -> Values:
    return {node.way: node.values}


def _sent(search: Looking, nodes: list[Node]) -> list[Array] | None:
    try:
        return search.send(nodes)
    except StopIteration:
        return None


def _normal(start: Array, end: Array) -> Array:
    """Return the unit vector to the left of an edge."""
    x, y = (end - start) / np.linalg.norm(end - start)
    return np.array([-y, x])


def _at_quarter(start: Array, middle: Array, end: Array) -> Array:
    """Return the parabola through three values at a quarter of the way."""
    return np.asarray(0.375 * start + 0.75 * middle - 0.125 * end)
