"""Bodies and problems as plain data, in the keys of a problem file, whose answers are known in closed form."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks import shapes

Plain = dict[str, Any]
Point = Sequence[float]
X, Y, Z = (Plain(translation=axis) for axis in "xyz")
RX, RY, RZ = (Plain(rotation=axis, centre="seed") for axis in "xyz")
FREE = Plain(free=True)
WIDE = [[0.1, 9.0], [0.1, 9.0]]  # scales in which a nominal contact is looked for
ROOM = DEFAULT.line  # of the bodies' size: by how much a closed form and coordinates in floats may differ


def convex(vertices: Iterable[Point], seed: Point | str = "centroid") -> Plain:
    """Return the hull of some points."""
    return {"vertices": [list(map(float, point)) for point in vertices], "seed": _seed(seed)}


def box(low: Point, high: Point, seed: Point | None = None) -> Plain:
    """Return an axis-aligned box; its seed is the centre unless given."""
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    return convex(shapes.box(low, high).tolist(), middle if seed is None else seed)


def about(centre: Point, *half: float) -> Plain:
    """Return the box about a centre, which is its seed, with one half-width or three."""
    reach = half * 3 if len(half) == 1 else half
    low, high = ([c + sign * h for c, h in zip(centre, reach, strict=True)] for sign in (-1, 1))
    return box(low, high, centre)


def union(*bodies: Plain, seed: Point) -> Plain:
    """Return several convex bodies as one."""
    vertices: list[list[float]] = []
    parts = []
    for body in bodies:
        parts.append([len(vertices) + k for k in range(1, len(body["vertices"]) + 1)])
        vertices += body["vertices"]
    return {"vertices": vertices, "parts": parts, "seed": _seed(seed)}


def _seed(seed: Point | str) -> list[float] | str:
    return seed if isinstance(seed, str) else list(map(float, seed))


def turned(body: Plain, angle: float) -> Plain:
    """Return a body turned about z through the origin."""
    c, s = math.cos(angle), math.sin(angle)
    return mapped(body, lambda x: [c * x[0] - s * x[1], s * x[0] + c * x[1], x[2]])


def mapped(body: Plain, place: Any) -> Plain:
    """Return a body with another place for each of its points; its seed must be given as a point."""
    return {**body, "vertices": [place(x) for x in body["vertices"]], "seed": place(body["seed"])}


def shifted(body: Plain, shift: Point) -> Plain:
    """Return a body moved."""
    return mapped(body, lambda point: [x + s for x, s in zip(point, shift, strict=True)])


def rotation(axis: str | Point, centre: str | Point = "seed") -> Plain:
    """Return the step of a turn."""
    return {"rotation": axis, "centre": centre}


def translation(axis: str | Point) -> Plain:
    """Return the step of a shift."""
    return {"translation": axis}


def screw(axis: Any = "seeds", pitch: float | str = "free") -> Plain:
    """Return the step of a screw: about "seeds" or (point, direction), with pitch per radian or in a word."""
    line = axis if isinstance(axis, str) else {"point": list(axis[0]), "direction": list(axis[1])}
    return {"screw": line, **({"pitch": pitch} if isinstance(pitch, str) else {"pitch_per_rad": float(pitch)})}


def problem(
    movable: Plain, static: Plain, motion: Sequence[Plain], *, keep_out: Sequence[Plain] = (), **asked: Any
) -> Plain:
    """Return a problem as `Problem.from_dict` takes it: by default the parts as drawn are brought to touch."""
    case: Plain = {"name": "case", "motion": list(motion), "goal": "touch", "box": WIDE}
    if not {"target", "tolerance"} & asked.keys():
        case["target"] = [1.0, 1.0]
    others = {"keep_out": list(keep_out)} if keep_out else {}
    return {"bodies": {"movable": movable, "static": static}, **others, "case": [{**case, **asked}]}


def limits(**own: Any) -> Plain:
    """Return limits, angles in radians; names that begin with R, or end in angle, are angles."""
    return {name + "_rad" * is_angle(name): list(ends) for name, ends in own.items()}


def weights(**own: float) -> Plain:
    """Return weights, per length unit and per radian."""
    return {name + "_per_rad" * is_angle(name): weight for name, weight in own.items()}


def is_angle(name: str) -> bool:
    """Tell whether a parameter, by its name, is an angle."""
    return name.startswith("R") or name.endswith("angle")


def radius(body: Plain) -> float:
    """Return half the diagonal of a body's box: the length that turns radians of its motion into lengths."""
    return 0.5 * math.hypot(*(max(x) - min(x) for x in zip(*body["vertices"], strict=True)))


def placed(data: Mapping[str, Any], place: Any, direction: Any) -> Plain:
    """Return the same problem in another frame: `place` takes points to it, `direction` the axes of motions."""
    bodies = {role: mapped(body, place) for role, body in data["bodies"].items()}
    names = {sign + name: direction([s * (name == other) for other in "xyz"]) for sign, s in (("", 1.0), ("-", -1.0))
             for name in "xyz"}  # fmt: skip
    steps = []
    for step in data["case"][0]["motion"]:
        kind = "translation" if "translation" in step else "rotation"
        axis = step[kind]
        steps.append({**step, kind: names[axis] if isinstance(axis, str) else direction(axis)})
    return {**data, "bodies": bodies, "case": [{**data["case"][0], "motion": steps}]}


# ------------------------------------------------------------------------------------------- bodies that meet again

CUBE = about((0, 0, 0), 0.5)
PLATE = about((1.25, 0, 0), 0.25, 2, 2)  # 1 <= x <= 3/2
TIP = convex([[side * (axis == k) for k in range(3)] for axis in range(3) for side in (0.5, -0.5)], (0, 0, 0))
LEVER = convex([(1, 0, 0), (-0.1, 0.1, -0.1), (-0.1, -0.1, -0.1), (-0.1, 0, 0.1)], (0, 0, 0))  # its tip is at 1
CLAW = convex([(1, 0, 0), (1.3, 0.1, 0.1), (1.3, -0.1, 0.1), (1.3, 0, -0.1)], (0, 0, 0))  # its tip, at 1, points to 0
TOOTH = convex([(x, y, z) for x, y in ((1, 0), (0.5, 0.1), (0.5, -0.1)) for z in (-0.2, 0.2)], (0, 0, 0))  # edge at 1
SLANT = convex([(1.5 + a + b, 0.5 - a + b, c) for a in (-4, 4) for b in (0, 2) for c in (-1, 1)])  # x + y >= 2


def ramp(slope: float) -> Plain:
    """Return a wall along the line through (-1, 0) of some slope > 0, on its upper left.

    The lever's tip, turned by t, is on that line where tan(t/2) is the slope, and at pi; in the wall between these.
    """
    norm = math.hypot(1, slope)
    along, across = (1 / norm, slope / norm), (-slope / norm, 1 / norm)
    return convex(
        [(-1 + a * along[0] + b * across[0], a * along[1] + b * across[1], c)
         for a in (-3, 3) for b in (0, 2) for c in (-1, 1)]
    )  # fmt: skip


def swung(half: float, wall: float = 1.0) -> float:
    """Return the angle at which a square of some half-width reaches a wall: half (cos t + sin t) = wall."""
    return 0.5 * math.asin((wall / half) ** 2 - 1)
