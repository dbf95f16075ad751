"""Why no motion of a cell will do: a task in the terms of the compiled tests."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fcdm_opt.curve.tight import edge_and_corner
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.model.equations import FeaturePoints
from fcdm_opt.model.task import Task
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.evidence import WITNESS, Reason, least_lengths
from fcdm_opt.proof import cells as tests
from fcdm_opt.proof.enclosure import enclosed_pose
from fcdm_opt.proof.mean_value import AmountOfPieces, Pieces
from fcdm_opt.tolerances import DEFAULT

BETWEEN = (0.25, 0.5, 0.75)  # of two faces, the directions in which their edge is moved out
LEAST_SCALE = 1e-3  # of the target pair: tracked scales below are taken as these


Solid = tuple[Array, Array, Array, Ints]
"""Vertices, face normals, their levels and edges, as a compiled test takes them."""

Packed = tuple[Array, Array, Array, Ints, Ints, Array]
"""Many solids one after the other, where the vertices, faces and edges of each begin, and a ball around each."""


def _solid(part: ConvexPart, vertices: Array) -> Solid:
    """Return a part whose vertices have been scaled and shifted."""
    levels = np.array([(vertices[list(loop)] @ n).max() for loop, n in zip(part.loops, part.normals, strict=True)])
    return np.ascontiguousarray(vertices), np.array(part.normals), levels, np.array(part.edges)


def _pack(solids: Sequence[Solid]) -> Packed:
    """Return solids one after the other, where each begins, and a ball around each."""
    vertices, normals, levels, edges = zip(*solids, strict=True)
    starts = np.array([[0, 0, 0], *([len(v), len(n), len(e)] for v, n, _, e in solids)]).cumsum(axis=0)
    centres = np.array([(v.min(axis=0) + v.max(axis=0)) / 2.0 for v in vertices])
    radii = [np.linalg.norm(v - c, axis=1).max() for v, c in zip(vertices, centres, strict=True)]
    balls = np.column_stack([centres, np.array(radii) * (1.0 + DEFAULT.line)])
    joined = (np.concatenate(own) for own in (vertices, normals, levels, edges))
    return *joined, starts, balls  # type: ignore[return-value]


def _swollen(part: ConvexPart, placed: Array, by: float) -> ConvexPart:
    """Return a polytope within what is nearer to a part than a length: faces, edges and corners moved out by that."""
    # its vertices are where they are `placed`, (n, 3)
    middles = np.zeros_like(placed)
    for loop, normal in zip(part.loops, part.normals, strict=True):
        middles[list(loop)] += normal
    middles /= np.linalg.norm(middles, axis=1)[:, None]
    faces = [placed[list(loop)] + by * n for loop, n in zip(part.loops, part.normals, strict=True)]
    ends, sides = part.edges[:, :2], part.normals[part.edges[:, 2:]]
    turns = [share * sides[:, 0] + (1.0 - share) * sides[:, 1] for share in BETWEEN]
    edges = [placed[ends[:, k]] + by * n / np.linalg.norm(n, axis=1)[:, None] for n in turns for k in (0, 1)]
    return Body.convex(np.vstack([*faces, placed + by * middles, *edges]), seed=np.zeros(3), name="swollen").parts[0]


def tested_vertices(task: Task, *, swollen: bool) -> int:
    """Return how many vertices are looked at in a cell where all part pairs are; of swollen parts all their points."""
    one = sum(len(part.vertices) for part in task.movable.parts)
    others = [len(own.part.vertices) for own in task.obstacles]
    if swollen:
        others += [2 * (1 + len(BETWEEN)) * len(own.part.edges) for own in task.obstacles if own.need > 0.0]
    return one * len(task.obstacles) + len(task.movable.parts) * sum(others)


class Exclusion:
    """A task in the terms of the tests: everything about the seeds, body 1 moving.

    With `swollen`, obstacles that ask for a clearance are larger by as much, and nothing may overlap them: no witness
    that the checker of evidence knows, but parts that slide along each other need no small cells then.
    """

    def __init__(self, task: Task, upper: float = np.inf, *, swollen: bool = False) -> None:
        self.task, self.upper, self.swollen = task, upper, swollen
        self.motion = task.motion.seen_from(task.movable.seed)
        self.offset = task.static.seed - task.movable.seed
        self.margin = DEFAULT.line * task.size

    @cached_property
    def features(self) -> Array:
        """The tracked features and those besides, a row each."""
        return np.array([self._feature(line) for line in (*self.task.tracked, *self.task.untracked)])

    def _feature(self, line: FeaturePoints) -> Array:
        task, row = self.task, np.zeros(tests.FEATURE)
        p, q, r, s = line.points.T
        kind = line.kind
        one, two = task.movable.seed, task.static.seed
        row[tests.KIND], row[tests.SIGN] = kind, line.sign
        if kind == tests.E1E2:
            row[tests.FIRST : tests.SECOND] = (q - p) / np.linalg.norm(q - p)
            row[tests.SECOND : tests.ONE] = (s - r) / np.linalg.norm(s - r)
        else:
            n = np.cross(q - p, r - p) if kind == tests.F1V2 else np.cross(r - q, s - q)
            row[tests.FIRST : tests.SECOND] = line.sign * n / np.linalg.norm(n)
        row[tests.ONE : tests.TWO], row[tests.TWO : tests.PARTS] = p - one, s - two
        row[tests.PARTS :] = line.parts
        return row

    @cached_property
    def lines(self) -> Array:
        """Features whose contact lines meet where those of the tracked ones do."""
        # where a vertex of one part touches an edge of the other, the planes of both faces beside that edge will do.
        # They do not turn into one another, as a face and an edge pair do in passing when the contact turns flush
        task = self.task
        if len(task.tracked) != 2 or task.tracked[0].parts != task.tracked[1].parts:
            return self.features
        (one, two), parts = task.tracked, task.tracked[0].parts
        met = edge_and_corner(one.site, two.site, task.movable.parts[parts[0]], task.static.parts[parts[1]])
        if met is None:
            return self.features
        own, edge, corner = met
        return np.array([self._plane(parts, own, edge, side, corner) for side in (2, 3)])

    def _plane(self, parts: tuple[int, int], own: int, edge: int, side: int, corner: int) -> Array:
        """Return as a feature the plane of a face beside an edge, with a corner of the other part."""
        bodies = (self.task.movable, self.task.static)
        part, other = bodies[own].parts[parts[own]], bodies[1 - own].parts[parts[1 - own]]
        row = np.zeros(tests.FEATURE)
        row[tests.KIND], row[tests.SIGN] = (tests.F1V2, tests.V1F2)[own], 1.0
        row[tests.FIRST : tests.SECOND] = (1.0, -1.0)[own] * part.normals[part.edges[edge, side]]
        points = part.vertices[part.edges[edge, 0]] - part.seed, other.vertices[corner] - other.seed
        row[tests.ONE : tests.TWO], row[tests.TWO : tests.PARTS] = points if own == 0 else points[::-1]
        row[tests.PARTS :] = parts
        return row

    @cached_property
    def movable(self) -> list[Solid]:
        """The movable parts at the scale made."""
        task = self.task
        return [_solid(p, task.target[0] * (p.vertices - task.movable.seed)) for p in task.movable.parts]

    @cached_property
    def obstacles(self) -> list[Solid]:
        """The obstacles as placed, about s_2."""
        made = []
        for own in self.task.obstacles:
            part, placed = own.part, own.placed(self.task.static.seed)
            if self.swollen and own.need > 0.0:
                part = _swollen(part, placed, own.need)
                placed = part.vertices
            made.append(_solid(part, placed))
        return made

    @cached_property
    def drawn(self) -> tuple[Array, Array, Array, Array]:
        """Vertices of both bodies about their seeds, and where each part's begin."""
        found = []
        for body in (self.task.movable, self.task.static):
            found.append(np.concatenate([part.vertices - body.seed for part in body.parts]))
            found.append(np.cumsum([0, *(len(part.vertices) for part in body.parts)]))
        one, starts1, two, starts2 = found
        return one, starts1, two, starts2

    def poses(self, cells: Pieces) -> Array:
        """Return the enclosures of the relative pose over each cell, (n, 12, k + 2)."""
        q: list[Any] = [y * (1.0 / w) for y, w in zip(cells.enclosed, self.task.weights.tolist(), strict=True)]
        return enclosed_pose(self.motion, q, self.offset)

    @cached_property
    def closes(self) -> NDArray[np.bool_]:
        """Whether each reason, by its number, excludes all motions further out in the same direction."""
        own: list[int] = [Reason.BEYOND, *((Reason.LOOSE, Reason.LEFT) if self.task.coherent else ())]
        own += [Reason.OUTSIDE] if self.task.allows(self.task.rest) else []
        return np.isin(np.arange(len(Reason)), own)

    @cached_property
    def domain(self) -> Array:
        """Limits of the parameters, (k, 2), and where further motions repeat others or lead out of reach."""
        # for goals that ask for poses alone: a turn beyond half a revolution repeats a smaller one, where the limits
        # have that one, and the amount is no larger. Where the seed only shifts, by t, the target pair is apart once
        # |t| exceeds the way between the seeds and both reaches. Nor is anything wanted that displaces a vertex by more
        # than `upper`, where the amount is the displacement
        task = self.task
        limits = np.array(task.limits)
        if task.amount_kind == "displacement" and np.isfinite(self.upper):
            largest = self._displaced()
            limits = np.column_stack([np.maximum(limits[:, 0], -largest), np.minimum(limits[:, 1], largest)])
        touches = task.must_touch or (task.coherent and task.goal in ("at", "seat"))
        if task.tracked and not touches:
            return limits
        directions = task.motion.shift_directions
        for k, step in enumerate(() if task.tracked else task.motion.owners):
            if step.closed and not isinstance(task.amount_kind, OwnAmount):
                low, high = limits[k]
                limits[k] = max(low, min(-np.pi, high - 2.0 * np.pi)), min(high, max(np.pi, low + 2.0 * np.pi))
        shifts = np.array([own for own in directions if own is not None])
        if task.motion.about_seed and touches and len(shifts):
            least = np.linalg.svd(shifts, compute_uv=False)[-1] if len(shifts) <= 3 else 0.0
            partners = self.movable, self.obstacles[: len(task.static.parts)]
            away = sum(max(np.linalg.norm(solid[0], axis=1).max() for solid in own) for own in partners)
            if least > DEFAULT.nominal:
                largest = 2.0 * (np.linalg.norm(self.offset) + away) / least
                for k, direction in enumerate(directions):
                    if direction is not None:
                        limits[k] = max(limits[k, 0], -largest), min(limits[k, 1], largest)
        return limits

    @cached_property
    def _amount_bounds(self) -> AmountOfPieces:
        assert isinstance(self.task.amount_kind, OwnAmount)
        return AmountOfPieces(self.task.amount_kind.function, self.task.weights)

    def _displaced(self) -> Array:
        """Return how far each parameter may be from zero for no vertex to be displaced by more than `upper`, (k,)."""
        # a turn by q about a line displaces the one end of a vector against the other by 2 |sin(q / 2)| times what of
        # it is across the line, which is twice `upper` at most; turns beyond half a revolution repeat smaller ones
        # where that is all that is asked. What a step shifts is displacement besides, of the vertex nearest to the line
        task, upper = self.task, self.upper
        steps, count = task.motion.steps, len(task.weights)
        points, far = task.made_vertices, np.full(count, np.inf)
        shifts = [own for own in task.motion.shift_directions if own is not None]
        if len(shifts) == count:
            least = float(np.linalg.svd(np.array(shifts), compute_uv=False)[-1])
            return np.full(count, upper / least) if count <= 3 and least > DEFAULT.nominal else far
        if count == 1 and steps[0].own_pitch is not None:
            return np.array([upper / abs(steps[0].own_pitch) if steps[0].own_pitch else np.inf])
        line = self._turned_about()
        if line is None:
            return far
        centre, axis = line
        across = (points - centre) - np.outer((points - centre) @ axis, axis)
        sine = min(upper / max(np.linalg.norm(across[:, None] - across, axis=2).max(), upper), 1.0)
        kinds = [kind for _, kind in task.motion.parameters]
        angle = 2.0 * np.arcsin(sine) if sine < 1.0 else np.pi
        low, high = task.limits[kinds.index("rotation")]
        all_turns = not np.isfinite([low, high]).any() or max(-low, high) <= 2.0 * np.pi - angle
        if (task.coherent and count > 1) or not all_turns:
            angle = np.inf
        shift = upper + 2.0 * sine * np.linalg.norm(across, axis=1).min()
        return np.array([angle if kind == "rotation" else shift for kind in kinds])

    def _turned_about(self) -> tuple[Array, Array] | None:
        """Return a point and the direction of the line about which a motion of one turn and one shift turns."""
        motion, (one, two) = self.task.motion, (self.task.movable.seed, self.task.static.seed)
        turning = [step for step, turns in zip(motion.owners, motion.turning, strict=True) if turns]
        if len(turning) != 1 or len(motion.names) > 2 or (len(motion.steps) > 1 and turning[0].own_pitch is not None):
            return None
        others = zip(motion.owners, motion.shift_directions, strict=True)
        line = turning[0].own_line(tuple(one), tuple(two))
        if line is None or any(own is None and step is not turning[0] for step, own in others):
            return None
        return np.array(line[1]), np.array(line[0])

    def amounts(self, cells: Pieces, T: Array) -> Array:
        """Return a lower bound of the amount over each cell, (n,)."""
        task = self.task
        if task.weighted:
            return cells.low[:, 0] * least_lengths(cells.low[:, 1:], cells.high[:, 1:])
        if isinstance(task.amount_kind, OwnAmount):
            with np.errstate(all="ignore"):
                return np.nan_to_num(self._amount_bounds.least(cells), nan=-np.inf)
        # displacement of each vertex, (n, v, 3, k + 2): linear in the pose
        points = np.concatenate([solid[0] for solid in self.movable])
        turned = np.einsum("vj,nijm->nvim", points, T[:, :9].reshape(len(T), 3, 3, -1))
        turned[..., -1] = np.einsum("vj,nij->nvi", np.abs(points), T[:, :9, -1].reshape(len(T), 3, 3))
        turned[..., 0] += self.offset - points[:, :]
        turned[..., :-1] -= T[:, None, 9:12, :-1]
        turned[..., -1] += T[:, None, 9:12, -1]
        direction = turned[..., 0] / np.maximum(np.linalg.norm(turned[..., 0], axis=2, keepdims=True), 1e-300)
        along = np.einsum("nvi,nvim->nvm", direction, turned)
        off = np.einsum("nvi,nvi->nv", np.abs(direction), turned[..., -1])
        low = along[..., 0] - np.abs(along[..., 1:-1]).sum(axis=2) - off
        return np.asarray(np.maximum(low.max(axis=1), 0.0))

    def reasons(self, cells: Pieces, enough: float = np.inf, tries: int = 1) -> tuple[Ints, Array]:
        """Return why each cell is excluded, as far as one test tells, (n,), and its witness rows, (n, r, 16)."""
        # motions of an amount of at least `enough` are not wanted either, unless the amount is the weighted one. Of
        # each `tries` cells in a row the first that is excluded is enough, unless another closes its column
        count = len(cells.faces)
        codes, witness = np.zeros(count, dtype=np.int64), np.zeros((count, self.rows, WITNESS))
        self._outside(cells, codes, witness[:, 0])
        T = self.poses(cells)
        T[~np.isfinite(T).all(axis=(1, 2))] = np.nan
        if not self.task.weighted:
            codes[costly := (codes == Reason.OPEN) & (self.amounts(cells, T) >= enough)] = Reason.COSTLY
            if isinstance(self.task.amount_kind, OwnAmount):
                with np.errstate(all="ignore"):
                    codes[costly & (self._amount_bounds.least_beyond(cells) >= enough)] = Reason.BEYOND
        if self.task.tracked:
            self._tracked(T, codes, witness[:, 0])
        if np.isfinite(self.needs).any():
            self._pairs(T, codes, witness, tries)
        return codes, witness

    @cached_property
    def needs(self) -> Array:
        """Least gap of each obstacle: none may overlap where a tracked contact is to end at the target pair."""
        ends_there = self.task.goal in ("at", "seat")
        return np.maximum(self.task.needs, 0.0) if ends_there else np.asarray(self.task.needs)

    @property
    def rows(self) -> int:
        """Witness rows that a cell may need: one, or one for each part pair that has to be apart."""
        return len(self.movable) * len(self.task.static.parts) if self.task.must_touch else 1

    def _outside(self, cells: Pieces, codes: Ints, witness: Array) -> None:
        task = self.task
        room = DEFAULT.requirement * task.size
        for k, (own, weight, (low, high)) in enumerate(zip(cells.enclosed, task.weights, self.domain, strict=True)):
            if not (np.isfinite(low) or np.isfinite(high)):
                continue
            out = (own.low > high * weight + room) | (own.high < low * weight - room)
            codes[out], witness[out, 0] = Reason.OUTSIDE, k

    def _tracked(self, T: Array, codes: Ints, witness: Array) -> None:
        task = self.task
        own, margin = self.features[: len(task.tracked)], DEFAULT.cut * task.size
        one, starts1, two, starts2 = self.drawn
        tests.support_cells(T, own, one, starts1, two, starts2, LEAST_SCALE * task.target, margin, codes, witness)
        beyond = task.goal == "beyond"
        lines = self.features if task.goal == "seat" else self.lines
        tests.goal_cells(T, lines, task.target, task.signs if beyond else np.zeros(2), self.margin, codes, witness)
        if len(own) == 2 and len(task.movable.parts) == len(task.static.parts) == 1:
            tests.left_cells(T, self.lines, task.target, *self.pair, margin, codes, witness)

    @cached_property
    def pair(self) -> tuple[Solid, Solid]:
        """The two parts of convex bodies at scale 1, about their seeds."""
        bodies = (self.task.movable, self.task.static)
        one, two = (_solid(body.parts[0], body.parts[0].vertices - body.seed) for body in bodies)
        return one, two

    def _pairs(self, T: Array, codes: Ints, witness: Array, tries: int) -> None:
        task = self.task
        partners = len(task.static.parts) if task.must_touch else 0
        near = np.zeros(len(task.needs)) if self.swollen else np.maximum(task.needs, 0.0)
        tests.pair_cells(T, *self._packed, partners, np.isfinite(self.needs), near, self.margin, tries, codes, witness)

    @cached_property
    def _packed(self) -> tuple[Packed, Packed]:
        return _pack(self.movable), _pack(self.obstacles)
