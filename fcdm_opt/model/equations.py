"""The contact equations of the FCDM paper's appendix, symbolic in the motion parameters.

Each is a CasADi function with the features' vertices as parameters, so that one compiled template serves every pair of
features of a kind: (i) face and vertex, (ii) two edges: a contact line a rho_1 + b rho_2 = c; (iii) to (v) a switching
point, the intersection of two such lines.

A feature's `points` are four vertices as drawn, one a column: F1V2 three of the face and the vertex, V1F2 the vertex
and three of the face, E1E2 both ends of each edge. Its `sign` makes the normal point from body 1 to body 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from fcdm_opt.curve.kernels import E1E2, F1V2, V1F2
from fcdm_opt.geometry.arrays import Array, crossed, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.measures import cross, norms
from fcdm_opt.model.templates import template
from fcdm_opt.motion.motions import Motion

KINDS = (F1V2, V1F2, E1E2)
OWNERS = {F1V2: (1, 1, 1, 2), V1F2: (1, 2, 2, 2), E1E2: (1, 1, 2, 2)}  # the body of each of the four points


@dataclass(frozen=True, eq=False)
class FeaturePoints:
    """What a template needs to know of a feature pair, of kind F1V2, V1F2 or E1E2."""

    kind: int
    points: Array  # vertices as drawn, see the module, (3, 4)
    sign: float  # the orientation of the normal
    parts: tuple[int, int]  # the part pair
    site: tuple[int, int, int]  # (kind, i, j) in the packed parts

    @property
    def values(self) -> Array:
        """Points (column by column) and sign, as one vector (13,)."""
        return np.append(self.points.ravel(order="F"), self.sign)

    def steepness(self, rotation: Array) -> float:
        """Return the length of the template's normal where `rotation`, (3, 3), turns body 1."""
        return float(np.linalg.norm(self.normal(rotation)))

    def normal(self, rotation: Array) -> Array:
        """Return the template's normal, (3,), from body 1 to body 2, where `rotation` turns body 1; not of length 1."""
        return self.sign * crossed(*_spans(self.kind, _turned(self.kind, self.points.T, rotation)))


def feature_points(
    movable: Body, static: Body, site: tuple[int, int, int], parts: tuple[int, int], normal: Array, rotation: Array
) -> FeaturePoints:
    """Return the template parameters of a site: a facet of the Minkowski difference of a part pair."""
    # its normal from body 1 to body 2, at the pose in which `rotation`, (3, 3), turns body 1, fixes the sign
    kind, i, j = site
    one, two = movable.parts[parts[0]], static.parts[parts[1]]
    if kind == F1V2:
        points = [*_widest(one.vertices[list(one.loops[i])]), two.vertices[j]]
    elif kind == V1F2:
        points = [one.vertices[i], *_widest(two.vertices[list(two.loops[j])])]
    else:
        points = [*one.vertices[one.edges[i, :2]], *two.vertices[two.edges[j, :2]]]
    raw = crossed(*_spans(kind, _turned(kind, points, rotation)))
    return FeaturePoints(kind, frozen(np.column_stack(points)), 1.0 if raw @ normal > 0 else -1.0, parts, site)


def _turned(kind: int, points: Any, rotation: Array) -> list[Array]:
    return [rotation @ p if owner == 1 else p for p, owner in zip(points, OWNERS[kind], strict=True)]


def _widest(polygon: Array) -> Array:
    """Return the three corners that span the largest triangle: the best-conditioned normal."""
    if len(polygon) == 3:
        return polygon
    triples = (
        list(combinations(range(len(polygon)), 3))
        if len(polygon) <= 8
        else [
            (k, (k + len(polygon) // 3) % len(polygon), (k + 2 * len(polygon) // 3) % len(polygon))
            for k in range(len(polygon))
        ]
    )
    corners = polygon[np.array(triples)]
    areas = norms(cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return corners[int(np.argmax(areas))]


def _spans(kind: int, points: Any) -> tuple[Any, Any]:
    """Return the two difference vectors whose cross product is the contact normal."""
    p, q, r, s = points
    return {F1V2: (q - p, r - p), V1F2: (r - q, s - q), E1E2: (q - p, s - r)}[kind]


@dataclass(frozen=True, eq=False)
class SymbolicPose:
    """Symbols that all equations share: motion parameters, seeds as drawn, (6,), and the pose change of body 1."""

    q: Any
    seeds: Any
    transform: Any

    @classmethod
    def of(cls, motion: Motion, q: Any, seeds: Any) -> SymbolicPose:
        """Return the scene of a motion at parameters `q`."""
        return cls(q, seeds, motion.symbolic(q, seeds[:3], seeds[3:]))

    def moved(self, point: Any) -> Any:
        """Return a point of body 1, as drawn, after the motion."""
        return self.transform[:3, :3] @ point + self.transform[:3, 3]

    @property
    def moved_seed(self) -> Any:
        """s_1 after the motion."""
        return self.moved(self.seeds[:3])

    def line(self, kind: int, values: Any) -> tuple[Any, Any, Any, Any]:
        """Return (a, b, c, n), equations (i) and (ii); n is not normalised, so nothing is singular."""
        import casadi

        points = [values[3 * k : 3 * k + 3] for k in range(4)]
        points = [self.moved(p) if owner == 1 else p for p, owner in zip(points, OWNERS[kind], strict=True)]
        n = values[12] * casadi.cross(*_spans(kind, points))
        own, other = points[0], points[3]
        a = casadi.dot(n, own - self.moved_seed)
        b = -casadi.dot(n, other - self.seeds[3:])
        c = casadi.dot(n, self.seeds[3:] - self.moved_seed)
        return a, b, c, n

    def scaled(self, rho_1: Any, vertex: Any) -> Any:
        """Return a vertex of body 1, given as drawn, moved and scaled about the moved seed."""
        return self.moved_seed + rho_1 * (self.moved(vertex) - self.moved_seed)


def intersection(one: tuple[Any, ...], two: tuple[Any, ...]) -> tuple[Any, Any]:
    """Return (rho, determinant) of two contact lines, equations (iii) to (v)."""
    import casadi

    (a, b, c, *_), (d, e, f, *_) = one, two
    determinant = a * e - b * d
    return casadi.vertcat((c * e - b * f) / determinant, (a * f - c * d) / determinant), determinant


def _symbols(motion: Motion) -> tuple[SymbolicPose, list[Any], list[str]]:
    import casadi

    q, seeds = casadi.SX.sym("q", len(motion.parameters)), casadi.SX.sym("seeds", 6)
    return SymbolicPose.of(motion, q, seeds), [q, seeds], ["q", "seeds"]


@template
def contact_line(motion: Motion, kind: int) -> Any:
    """Return the compiled contact line of a kind of feature pair, equations (i) and (ii).

    A CasADi function (q, seeds, feature, rho) -> (line, normal, gap): `feature` is `FeaturePoints.values`, `line`
    (a, b, c) and `normal` belong together and are not normalised; `gap` is the separation at the scale pair `rho`
    along the unit normal, negative where the parts overlap.
    """
    import casadi

    scene, inputs, names = _symbols(motion)
    feature, rho = casadi.SX.sym("feature", 13), casadi.SX.sym("rho", 2)
    a, b, c, n = scene.line(kind, feature)
    gap = (c - a * rho[0] - b * rho[1]) / casadi.norm_2(n)
    return casadi.Function(
        "contact_line",
        [*inputs, feature, rho],
        [casadi.vertcat(a, b, c), n, gap],
        [*names, "feature", "rho"],
        ["line", "normal", "gap"],
    )


@template
def switching_point(motion: Motion, kinds: tuple[int, int]) -> Any:
    """Return the compiled switching point of two kinds of feature pairs, equations (iii) to (v).

    A CasADi function (q, seeds, feature_1, feature_2) -> (rho, sine): `sine` is the normalised determinant of the two
    lines; where it is small, rho is ill-conditioned and where it is 0, rho is not finite.
    """
    import casadi

    scene, inputs, names = _symbols(motion)
    features = [casadi.SX.sym(f"feature_{k}", 13) for k in (1, 2)]
    lines = [scene.line(kind, feature) for kind, feature in zip(kinds, features, strict=True)]
    rho, determinant = intersection(*lines)
    steep = [casadi.sqrt(a * a + b * b) for a, b, *_ in lines]
    return casadi.Function(
        "switching_point",
        [*inputs, *features],
        [rho, determinant / (steep[0] * steep[1])],
        [*names, "feature_1", "feature_2"],
        ["rho", "sine"],
    )


@template
def pose(motion: Motion) -> Any:
    """Return the compiled motion: a CasADi function (q, seeds) -> transform, (4, 4), of body 1."""
    import casadi

    scene, inputs, names = _symbols(motion)
    return casadi.Function("pose", inputs, [casadi.densify(scene.transform)], names, ["transform"])


@template
def alignment(motion: Motion) -> Any:
    """Return what keeps elements that lie flush parallel: a CasADi function (q, seeds, directions) -> aligned.

    `directions` are one of body 2 and one that body 1 carries, as drawn, (6,); `aligned` is their product after the
    motion, 0 where they are at right angles still.
    """
    import casadi

    scene, inputs, names = _symbols(motion)
    both = casadi.SX.sym("directions", 6)
    aligned = casadi.dot(both[:3], scene.transform[:3, :3] @ both[3:])
    return casadi.Function("alignment", [*inputs, both], [aligned], [*names, "directions"], ["aligned"])


@template
def separating_plane(motion: Motion, counts: tuple[int, int]) -> Any:
    """Return the compiled rows that keep two convex parts apart by a plane between them.

    A CasADi function (q, plane, seeds, movable, static, scales, seed, need) -> (apart, unit). `movable`, (3, n), and
    `static`, (3, m), with n and m as in `counts`, are the vertices of both parts as drawn, `scales` their sizes, about
    s_1 moved along and about `seed`. `plane` is a normal from part 1 to part 2 and a level. `apart`, (n + m,), is not
    negative where the plane keeps the parts apart by `need`, provided that the normal is of length one: `unit`, the
    square of its length less one, is zero.
    """
    import casadi

    scene, inputs, names = _symbols(motion)
    plane, need, seed = casadi.SX.sym("plane", 4), casadi.SX.sym("need"), casadi.SX.sym("seed", 3)
    movable, static = (casadi.SX.sym(name, 3, n) for name, n in zip(("movable", "static"), counts, strict=True))
    scales, n = casadi.SX.sym("scales", 2), plane[:3]
    below = [plane[3] - casadi.dot(n, scene.scaled(scales[0], movable[:, k])) for k in range(counts[0])]
    above = [casadi.dot(n, seed + scales[1] * (static[:, k] - seed)) - plane[3] - need for k in range(counts[1])]
    return casadi.Function(
        "separating_plane",
        [inputs[0], plane, inputs[1], movable, static, scales, seed, need],
        [casadi.vertcat(*below, *above), casadi.sumsqr(n) - 1.0],
        [names[0], "plane", names[1], "movable", "static", "scales", "seed", "need"],
        ["apart", "unit"],
        {"cse": True},
    )
