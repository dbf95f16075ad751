"""The contacts, clearances and motion of a problem as CasADi functions, for programs of one's own."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fcdm_opt.curve.contact import facing, feature_of_site, placed_elements, site_corners, supporting_contact
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.kernels import F1V2, V1F2
from fcdm_opt.errors import InputError, expected, known_arguments
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.lazy_import import imported
from fcdm_opt.model.equations import (
    FeaturePoints,
    alignment,
    contact_line,
    feature_points,
    pose,
    separating_plane,
    switching_point,
)
from fcdm_opt.model.seats import independent
from fcdm_opt.model.task import Parts, Task
from fcdm_opt.model.true_faces import exact_where
from fcdm_opt.problem.active_parts import with_insides, with_near_parts
from fcdm_opt.problem.arguments import is_real, motion_values
from fcdm_opt.problem.assembly import CLEAR, Assembly, JoinedPair
from fcdm_opt.problem.contacts_restored import BallOnFace, contact_balls, touching_again
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

SAMPLES = 16  # motions at which rows that are sums of others are told


@dataclass(frozen=True, eq=False)
class ContactRow:
    """A CasADi function of the motion parameters, and the numbers that it takes besides.

    Called with names, `row(q=q)` gives a dict of its outputs: of symbols expressions, of numbers numbers. What is
    not named is taken from `numbers`, so that any of them may be a variable too: `row(q=q, scales=scales)`.

    Attributes
    ----------
    name : str
        Which features touch, or which parts are kept apart.
    asked : str
        Of its outputs: "gap = 0", "apart >= 0, unit = 0".
    function : casadi.Function
        With named inputs and outputs. It is the same for all rows of its kind: vertices are inputs.
    numbers : dict
        Arrays by the name of an input.
    start : (n,) array
        Where to start further variables: of a clearance the plane that keeps the parts furthest apart; else empty.
    """

    name: str
    function: Any
    numbers: Mapping[str, Array]
    start: Array
    asked: str = ""

    def __call__(self, **given: Any) -> dict[str, Any]:
        """Return the outputs by name.

        Raises
        ------
        InputError
            For a name that is no input of the function, a value of another shape, and where one is missing.
        """
        names = self.function.name_in()
        for name, value in given.items():
            if name not in names:
                raise InputError("no such input", key=name, found=self.name, allowed=", ".join(names))
            (rows, columns), found = self.function.size_in(name), getattr(value, "shape", None) or np.shape(value)
            several = len(found) == 2 and found[0] == rows and found[1] % columns == 0  # values side by side
            if math.prod(found) not in (1, rows * columns) and not several:
                allowed = f"{rows} numbers" if columns == 1 else f"{rows} by {columns} numbers"
                raise InputError(f"another shape than {self.name} takes", key=name, found=found, allowed=allowed)
        missing = [name for name in names if name not in given and name not in self.numbers]
        if missing:
            raise InputError("an input is missing", key=missing[0], found=self.name, allowed=", ".join(names))
        return self.function(**{**self.numbers, **given})


@dataclass(frozen=True, eq=False)
class ContactRows:
    """What a problem asks, as CasADi functions; made by `contact_rows`.

    Lengths are in the unit of the bodies, angles in radians. Every function takes the motion parameters `q`, (k,), and
    the `seeds`, (6,), of both bodies as drawn.

    Attributes
    ----------
    parameters : tuple of str
        Names of the motion parameters.
    limits : (k, 2) array
    weights : (k,) array
        The weighted amount is the norm of weights * q.
    at : (k,) array
        The motion at which features and first planes were looked for.
    resolution : (k,) array or None
        Steps of the machine that q is a whole number of, 0 where it is any; no row asks for that.
    within : float
        Parts that have no rows are further apart than this at the motion looked at: as long as no vertex is displaced
        by more from there, none of them touches. Infinite where all have rows.
    motion : ContactRow
        (q, seeds) -> transform, (4, 4), of body 1; of an assembly of the first part that moves.
    motions : mapping of name to ContactRow
        That of each part that moves, in the world.
    contacts : tuple of ContactRow
        (q, seeds, feature, rho) -> line, normal, gap: of a pair of features the contact line (a, b, c) and its normal
        from body 1 to body 2, not normalised; and the gap at a scale pair `rho` along the unit normal, 0 where the
        features touch. `feature` is four vertices as drawn and a sign: three of the face and the vertex (F-V), the
        vertex and three of the face (V-F), or both ends of each edge (E-E); the sign points the normal to body 2.
        Of contacts that are restored together the rows of each one after the other: at corners and edges there are
        several. Goal "fit" asks 0 <= gap <= t of all of them, for the least t that there is.
    alignments : tuple of ContactRow
        (q, seeds, directions) -> aligned: 0 while elements that are to stay flush are parallel; one or two of each such
        contact, none for motions that turn nothing.
    switching_point : ContactRow or None
        (q, seeds, feature_1, feature_2) -> rho, sine: the scale pair at which two tracked features touch at once, and
        the sine of the angle between their lines, which is 0 where there is no such pair.
    clearances : tuple of ContactRow
        (q, plane, seeds, movable, static, scales, seed, need) -> apart, unit: one for each pair of convex parts of
        body 1 and of the static body or a keep-out. The parts of the sizes `scales` are apart by `need` where `apart`
        is not negative and `unit` is 0 for some `plane`, a normal and a level: four variables each.
    unit : str
        Of lengths, "" where the bodies name none.
    """

    parameters: tuple[str, ...]
    limits: Array
    weights: Array
    resolution: Array | None
    within: float
    motion: ContactRow
    motions: Mapping[str, ContactRow]
    contacts: tuple[ContactRow, ...]
    alignments: tuple[ContactRow, ...]
    switching_point: ContactRow | None
    clearances: tuple[ContactRow, ...]
    at: Array
    unit: str = ""

    def __str__(self) -> str:
        """Return a table of the first rows: what touches, what is asked of it, its value and slopes at `at`."""
        return imported("show.printing:printed")(imported("show.row_table:print_contact_rows"), self)

    def __repr__(self) -> str:
        """Return how many rows of each kind there are, on one line."""
        counts = {"contact": self.contacts, "alignment": self.alignments, "clearance": self.clearances}
        listed = ", ".join(f"{len(own)} {kind}{'s' * (len(own) != 1)}" for kind, own in counts.items())
        return f"ContactRows({listed} in {', '.join(self.parameters)})"


@known_arguments
def contact_rows(problem: Problem | Assembly, at: Any = None, *, within: float | None = None) -> ContactRows:
    """Return the contacts, clearances and motion of a problem as CasADi functions.

    They are the equations that `solve` itself uses, smooth in the motion parameters, with named inputs and outputs, and
    with vertices, sizes and seeds as inputs. The features are those that a goal tracks, or those of all contacts that
    are restored together; goals "touch" and "clear" track none: there, for each pair of parts, the features that are
    furthest apart, or overlap least.

    Parameters
    ----------
    problem : Problem or Assembly
        Of an assembly the rows of its contacts, and of all two parts that they stay apart, in the parameters of all
        motions: "part.parameter".
    at : mapping of parameter name to number, or (k,) floats, optional
        Motion at which features and first planes are looked for; default no motion.
    within : float, optional
        Only parts that are no further apart than this there have rows, length units. By default all have, and of
        bodies and keep-outs kept as surfaces those within a sixteenth of the size. Their parts bar the way into the
        solid; where a body lies in it at `at`, a part of what is inside has rows too.

    Raises
    ------
    InputError
        Where the problem leaves open which two of several features it tracks, and for other parameters.
    """
    if isinstance(problem, Assembly):
        return _of_assembly(problem, at, within)
    expected(problem, Problem, "problem")
    if within is not None and not (is_real(within) and within >= 0.0):
        raise InputError("not a distance", key="within", found=within, allowed="a number >= 0, or None")
    if pairs := problem.feature_pairs:
        found = "; ".join(" and ".join(pair) for pair in pairs)
        raise InputError("several features meet: name two", key="features", found=found)
    task = Task.of(problem)
    q = motion_values(task.motion.names, at, "at")
    exact = exact_where(problem, q, apart=task.gap(q))
    if exact is not problem:
        problem, task = exact, Task.of(exact)
    if problem.partial or any(own.body.is_surface for own in problem.keep_out):
        within = problem.size / 16.0 if within is None else within
        problem = with_insides(problem, task.transform(q)) or problem
        task = Task.of(with_near_parts(problem, task.transform(q), within))
    seeds = {"seeds": frozen(np.append(task.movable.seed, task.static.seed))}
    near = np.argwhere(task.pair_gaps(q) <= (np.inf if within is None else within)).tolist()
    nearest = {(i, j): _nearest(task, (i, j), q) for i, j in near}
    moved = ContactRow("motion", pose(task.motion), seeds, np.empty(0))
    return ContactRows(
        parameters=task.motion.names,
        limits=frozen(task.limits),
        weights=frozen(task.weights),
        resolution=problem.resolution,
        within=np.inf if within is None else within,
        motion=moved,
        motions={problem.movable.name: moved},
        contacts=_contacts(problem, task, q, nearest, seeds),
        alignments=_alignments(task, seeds),
        switching_point=_switching_point(task, seeds),
        clearances=tuple(_clearance(task, parts, q, normal, seeds) for parts, (_, normal) in nearest.items()),
        at=frozen(q),
        unit=problem.unit,
    )


def _of_assembly(assembly: Assembly, at: Any, within: float | None) -> ContactRows:
    """Return the rows of every two parts, in the parameters of all motions."""
    questions = assembly.questions.items()
    each = {" - ".join(pair): contact_rows(problem, at, within=within) for pair, problem in questions}
    asked = [*each.values()][: len(assembly.contacts)]

    def named(kind: str, some: Iterable[tuple[str, ContactRows]]) -> tuple[ContactRow, ...]:
        each = ((f"{pair}: " * ("keep-out" in row.name), row) for pair, own in some for row in getattr(own, kind))
        return tuple(replace(row, name=f"{pair}{row.name}") for pair, row in each)

    motions = {}
    for part in assembly.motions:  # as a fixed part sees it
        problem = assembly.problem(JoinedPair(part, assembly.fixed[0], CLEAR), tuple(assembly.motions))
        seeds = {"seeds": frozen(np.append(problem.movable.seed, problem.static.seed))}
        motions[part] = ContactRow(part, pose(problem.motion), seeds, np.empty(0))
    return replace(
        asked[0],
        within=min(own.within for own in each.values()),
        motion=next(iter(motions.values())),
        motions=motions,
        contacts=named("contacts", zip(each, asked, strict=False)),
        alignments=named("alignments", zip(each, asked, strict=False)),
        clearances=named("clearances", each.items()),
    )


Nearest = dict[Parts, tuple[tuple[int, int, int], Array]]


def _nearest(task: Task, parts: Parts, q: Array) -> tuple[tuple[int, int, int], Array]:
    """Return the features of a part pair that are furthest apart, as a site, and their normal."""
    # of several along one normal, as of faces in parallel, those that are least aside of one another
    sites, rows, separations = task.separations(parts, task.pose(q))
    tie, widest = DEFAULT.tie * task.size, int(np.argmax(separations))
    one, other, T = task.movable.parts[parts[0]], task.obstacles[parts[1]], task.transform(q)
    moved = (one.seed + task.target[0] * (one.vertices - one.seed)) @ T[:3, :3].T + T[:3, 3]
    near, found = other.placed(np.zeros(3)), list[tuple[float, tuple[int, int, int], Array]]()
    for row in [widest, *np.flatnonzero(separations >= separations[widest] - tie).tolist()]:
        (kind, i, j), normal = sites[row].tolist(), rows[row, :3]
        level = [(kind, i, j)]
        if kind == F1V2:
            level = [(kind, i, k) for k in np.flatnonzero(near @ normal <= near[j] @ normal + tie).tolist()]
        elif kind == V1F2:
            level = [(kind, k, j) for k in np.flatnonzero(moved @ normal >= moved[i] @ normal - tie).tolist()]
        for site in level:
            own, its = site_corners(one, other.part, site)
            aside = _aside(normal, moved[list(own)], near[list(its)])
            found.append((aside if aside > tie else 0.0, site, normal))
            if not found[-1][0]:
                return site, normal
    return min(found, key=lambda each: each[0])[1:]


def _aside(normal: Array, one: Array, two: Array) -> float:
    """Return how far the corners of one element are from those of another as seen along a normal; 0 where they meet."""
    sides = np.concatenate([own - np.roll(own, 1, axis=0) for own in (one, two)])
    lines = np.concatenate([sides - (sides @ normal)[:, None] * normal, np.cross(sides, normal)])
    lengths = np.linalg.norm(lines, axis=1)
    lines = lines[lengths > 0.0] / lengths[lengths > 0.0, None]
    a, b = one @ lines.T, two @ lines.T
    return float(np.maximum(a.min(axis=0) - b.max(axis=0), b.min(axis=0) - a.max(axis=0)).max(initial=0.0))


def _contacts(
    problem: Problem, task: Task, q: Array, nearest: Nearest, seeds: Mapping[str, Array]
) -> tuple[ContactRow, ...]:
    features, bodies = (*task.tracked, *task.untracked), (task.movable, task.static)
    asked = {"beyond": "see the switching point", FIT: "0 <= gap <= t"}.get(task.goal, "gap = 0")
    balls = contact_balls(problem) if touching_again(problem) is not None else []
    planes = [own for own in (ball.plane for ball in balls) if own is not None]
    if balls and len(planes) == len(balls):
        features = tuple(_as_points(problem, *each) for each in zip(balls, planes, strict=True))
    else:
        balls = []
    names = [ball.feature for ball in balls] or [_meeting(task, feature) for feature in features]
    if not features:
        asked = "least gap = 0" if task.must_touch else f"gap >= {task.need:g}"
        rotation, count = task.pose(q)[:9].reshape(3, 3), len(task.static.parts)
        features = tuple(
            feature_points(task.movable, task.static, site, parts, normal, rotation)
            for parts, (site, normal) in nearest.items()
            if parts[1] < count
        )
        pairs = [(task.movable.parts[own.parts[0]], task.static.parts[own.parts[1]]) for own in features]
        names = [feature_of_site(*pair, own.site) for pair, own in zip(pairs, features, strict=True)]
    return tuple(
        ContactRow(
            name.in_words(*bodies),
            contact_line(task.motion, feature.kind),
            {**seeds, "feature": frozen(feature.values), "rho": frozen(task.target)},
            np.empty(0),
            asked,
        )
        for name, feature in zip(names, features, strict=True)
    )


def _as_points(problem: Problem, ball: BallOnFace, at: tuple[Array, Array]) -> FeaturePoints:
    """Return a ball on a plane as its centre on a face that is a radius nearer, both as drawn."""
    place, normal = at
    across = np.linalg.svd(normal[None])[2][1:]
    across[1] = np.cross(normal, across[0])
    plane, centre = np.vstack([place, place + problem.size * across]), ball.centre[None]
    each = [plane, centre] if ball.holder == 0 else [centre, plane]
    seeds = problem.movable.seed, problem.static.seed
    drawn = [seed + (own - seed) / scale for own, seed, scale in zip(each, seeds, problem.target, strict=True)]
    kind, sign = (F1V2, 1.0) if ball.holder == 0 else (V1F2, -1.0)
    return FeaturePoints(kind, np.vstack(drawn).T, sign, (0, 0), (kind, 0, 0))


def _meeting(task: Task, points: FeaturePoints) -> Feature:
    """Return the bodies' own elements that meet in a row: those of a part may be cuts, or lie on several of them."""
    # what is tracked meets at rest, at the tracked pair; other contacts meet as drawn
    rho, pose, _ = task.tracked_contact(task.rest, 0.0) if task.tracked else (np.ones(2), task.pose(task.rest), ())
    one, two = task.movable.parts[points.parts[0]], task.static.parts[points.parts[1]]
    normal = points.normal(pose[:9].reshape(3, 3))
    normal = normal / np.linalg.norm(normal)
    contact = supporting_contact(one, two, normal, pose)
    X, Y = placed_elements(one, two, pose, contact, rho)
    return facing(one, two, pose, contact, rho, normal, float((Y[0] - X[0]) @ normal)).feature


def _alignments(task: Task, seeds: Mapping[str, Array]) -> tuple[ContactRow, ...]:
    """Return what keeps flush elements parallel, without rows that are sums of others whatever the motion."""
    turns = [(flush, turn) for flush in task.seats for turn in flush.turns]
    some = np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, len(task.weights)))
    turned = [task.transform(q)[:3, :3] for q in some]
    values = np.array([[m @ R @ p for R in turned] for _, (m, p) in turns]).reshape(len(turns), SAMPLES)
    kept = independent(np.where(np.abs(values) > DEFAULT.nominal, values, 0.0))
    return tuple(
        ContactRow(
            task.named(flush.parts),
            alignment(task.motion),
            {**seeds, "directions": frozen(np.concatenate(turn))},
            np.empty(0),
            "aligned = 0",
        )
        for flush, turn in (turns[k] for k in kept)
    )


def _switching_point(task: Task, seeds: Mapping[str, Array]) -> ContactRow | None:
    if len(task.tracked) != 2:
        return None
    one, two = task.tracked
    numbers = {**seeds, "feature_1": frozen(one.values), "feature_2": frozen(two.values)}
    name = "the tracked switching point"
    target = ", ".join(f"{rho:g}" for rho in task.target)
    asked = f"rho beyond ({target})"
    return ContactRow(name, switching_point(task.motion, (one.kind, two.kind)), numbers, np.empty(0), asked)


def _clearance(task: Task, parts: Parts, q: Array, normal: Array, seeds: Mapping[str, Array]) -> ContactRow:
    one, obstacle = task.movable.parts[parts[0]], task.obstacles[parts[1]]
    two, T = obstacle.part, task.transform(q)
    moved = T[:3, :3] @ task.movable.seed + T[:3, 3]
    support = task.target[0] * ((one.vertices - task.movable.seed) @ T[:3, :3].T @ normal).max() + normal @ moved
    numbers = {
        **seeds,
        "movable": frozen(one.vertices.T),
        "static": frozen(two.vertices.T),
        "scales": frozen([task.target[0], obstacle.scale]),
        "seed": frozen(two.seed),
        "need": frozen([max(obstacle.need, 0.0)]),
    }
    function = separating_plane(task.motion, (len(one.vertices), len(two.vertices)))
    return ContactRow(task.named(parts), function, numbers, frozen([*normal, support]), "apart >= 0, unit = 0")
