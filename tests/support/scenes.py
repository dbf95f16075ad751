"""Scenes of a few boxes, one for each thing that can be asked, with what is right of them in closed form.

All say the same of sizes where they can: `x` is the one number by which the parts made are off (the tolerance of the
uniform scales, or the deviation of a size), and the least amount is a function of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from math import inf, sqrt
from typing import Any

import casadi
import numpy as np
from voxels import VOXELS, surface_of

import fcdm_opt as fo

Question = fo.Problem | fo.Assembly
X, Y, Z = (fo.Translation(axis) for axis in "xyz")
OFF = 0.01
"""By how much the parts made are off."""
WIDE = 0.05
"""Tolerance of sizes, to both sides."""
STEP = 0.004


def box(low: Any, high: Any, name: str, **more: Any) -> fo.Body:
    return fo.Body.convex(list(product(*zip(low, high, strict=True))), name=name, **more)


def as_drawn(body: fo.Body) -> fo.Body:
    return body


def hollow(body: fo.Body) -> fo.Body:
    """The box of a body but for one of its edges, kept as a surface, as meshes too large to be cut are."""
    corners, faces = surface_of(VOXELS["L"][0])
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    corners = low + np.sqrt(corners / corners.max(axis=0)) * (high - low)
    return fo.Body.from_mesh(corners, faces, decomposition="surface", name=body.name, seed=body.seed)


TIP = [(0, 0, 0), (1, 1, 2), (1, -1, 2), (-1, 1, 2), (-1, -1, 2)]
PROBE = fo.Body.convex(TIP, seed="box", name="probe")  # its tip is 1 below its seed
BALL = fo.Sphere(1.0, centre=(0, 0, 1), facets=12, name="ball")
TABLE = box((-3, -3, -1), (3, 3, 0), "table")  # its top is .5 above its seed
CUBE = box((0, 0, 0), (1, 1, 1), "cube")
POST = box((1, 0, 0), (2, 1, 1), "post")
EDGE = box((2, -0.5, 0), (3, 0.5, 1), "edge", seed=(2.5, 0, 0.25))  # meets an edge of the next
LEDGE = box((-2, -1, -1), (2, 1, 0), "ledge")
KEY = box((0, 0, 0), (1, 1, 1), "key", seed=(0.25, 0.5, 0.5))  # a quarter off its middle
SLOT = fo.Body.from_parts(
    [list(product((-1, 0), (0, 1), (0, 1))), list(product((1, 2), (0, 1), (0, 1)))], seed=(0.5, 0.5, 0.5), name="slot"
)
CORNER = fo.Body.from_parts(
    [list(product((-9, 0), (-9, 9), (0, 1))), list(product((0, 9), (-9, 0), (0, 1)))], seed=(-1, -1, 0), name="corner"
)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A question, and what is right of it.

    Attributes
    ----------
    ask : function
        The question, for how much the parts made are off.
    amount : function
        The least amount, for what each size is off: the scales of both bodies, or `sizes`.
    of_moving : function, optional
        Of an assembly without sizes the same for what the scales of its two parts that move are off, all others drawn.
    sizes : tuple of str
        Names of sizes of its own, of which the first is off; none where the scales are, both.
    signs : (int, int)
        Of what both scales are off.
    direction : str
        The parameter along which ranges are looked at.
    range : (float, float)
        Along that, where the contact as drawn lasts.
    touches : sequence of float
        Along that, where the parts made touch.
    free : (float, float) or None
        Along that, what is free of collision about rest.
    open : float
        How far the contacts are that are left open.
    worst : float
        The least that the largest |gap| can be of all sizes within the tolerances.
    motion_by_pose : float
        What the motion changes by a unit that the movable part is shifted along it.
    """

    ask: Callable[[float], Question]
    amount: Callable[..., float]
    of_moving: Callable[[Any, Any], Any] | None = None
    sizes: tuple[str, ...] = ()
    signs: tuple[int, int] = (1, 1)
    direction: str = "TZ"
    range: tuple[float, float] = (-1.25, inf)  # of the probe: until its scale, 1 + .8 x, is 0
    touches: tuple[float, ...] = (-3.015, 0.015)  # from below and from above
    free: tuple[float, float] | None = None
    open: float = 0.0
    worst: float = 0.015
    motion_by_pose: float = -1.0

    def off(self, x: float) -> tuple[float, ...]:
        """What the sizes are off."""
        return (x, *[0.0] * (len(self.sizes) - 1)) if self.sizes else (self.signs[0] * x, self.signs[1] * x)

    def slopes(self, x: float) -> tuple[float, ...]:
        """Derivatives of the least amount by the sizes."""
        off, steps = np.array(self.off(x)), 1e-6 * np.eye(len(self.off(x)))
        return tuple((self.amount(*(off + step)) - self.amount(*(off - step))) / 2e-6 for step in steps)

    def least(self, x: float) -> float:
        """The least amount where the parts made are off by x."""
        return float(self.amount(*self.off(x)))


def _pair(movable: fo.Body, static: fo.Body, **given: Any) -> Callable[[float], fo.Problem]:
    def ask(x: float) -> fo.Problem:
        return fo.Problem(movable, static, **{"tolerance": x, "requirement": "A", "motion": Z, **given})

    return ask


def _sized(*sizes: fo.Size, static: fo.Body = TABLE, movable: fo.Body = PROBE) -> Callable[[float], fo.Problem]:
    def ask(x: float) -> fo.Problem:
        return fo.Problem(movable, static, sizes=sizes, made={sizes[0].name: x}, motion=Z, goal="touch")

    return ask


def _lift(q: Any) -> Any:
    pose = casadi.SX.eye(4)
    pose[2, 3] = q[0]
    return pose


def _assembly(parts: dict[str, fo.Body], contacts: Any, motions: Any, **given: Any) -> Callable[[float], fo.Assembly]:
    def ask(x: float) -> fo.Assembly:
        scales = dict.fromkeys(parts, 1.0 + x) if "sizes" not in given else None
        made = {given["sizes"][0].name: x} if "sizes" in given else None
        return fo.Assembly(parts, contacts, motions=motions, scales=scales, made=made, **given)

    return ask


FLOOR = box((-5, -5, -1), (5, 5, 0), "floor", seed=(0, 0, -0.5))
LOWER, UPPER = (box((-1, -1, k), (1, 1, k + 1), name) for k, name in enumerate(("lower", "upper")))
LAMP = box((-1, -1, 2.05), (1, 1, 3), "lamp")
LEFT, RIGHT = (box((k - 1, 0, 0), (k, 1, 1), name) for k, name in enumerate(("left", "right")))


def _chain_off(d: Any, e: Any) -> Any:
    """By how much the lower part goes up, and the upper one on it."""
    return np.hypot(0.5 * d, 0.5 * (d + e))


def _loop_off(d: Any, e: Any) -> Any:
    """By how much each goes up, and both apart: each by a half."""
    return np.sqrt((0.5 * d) ** 2 + (0.5 * e) ** 2 + 2.0 * (0.25 * (d + e)) ** 2)


def _chain(look: Callable[[fo.Body], fo.Body], **given: Any) -> Callable[[float], fo.Assembly]:
    parts = {body.name: look(body) for body in (FLOOR, LOWER, UPPER)}
    return _assembly(parts, [("lower", "floor"), ("upper", "lower")], {"lower": Z, "upper": Z}, **given)


def _loop(look: Callable[[fo.Body], fo.Body]) -> Callable[[float], fo.Assembly]:
    parts = {body.name: look(body) for body in (FLOOR, LEFT, RIGHT)}
    contacts = [("left", "floor"), ("right", "floor"), ("right", "left")]
    motions = dict.fromkeys(("left", "right"), X >> Z)
    return _assembly(parts, contacts, motions, follows=dict.fromkeys(("left", "right"), "floor"))


def _size(name: str, body: str, **how: Any) -> fo.Size:
    return fo.Size(name, body, tolerance=WIDE, **how)


def _tip(d: float, e: float) -> float:
    """By how much the probe's tip is below the table's top."""
    return d + 0.5 * e


TOP, ALL = _size("top", "static", faces="+z"), _size("all", "movable", scale="xyz")
SCENES = {
    "at": Scene(ask=_pair(PROBE, TABLE, goal="at"), amount=_tip),
    "seat": Scene(
        ask=_pair(CUBE, TABLE, goal="seat"), amount=lambda d, e: 0.5 * (d + e),
        range=(-6 / 7, inf),  # until the cube, at a seventh of its size, is beside the table
        touches=(-2.01, 0.01),
        worst=0.01,
    ),
    "touch": Scene(ask=_pair(PROBE, TABLE, goal="touch"), amount=_tip),
    "clear": Scene(ask=_pair(PROBE, TABLE, goal="clear", clearance=0.1), amount=lambda d, e: 0.1 + _tip(d, e)),
    "beyond": Scene(
        ask=_pair(EDGE, LEDGE, goal="beyond", motion=X >> Z),
        amount=lambda d, e: np.hypot(0.5 * d + 2.0 * e, 0.25 * d + 0.5 * e),
        range=(-0.125, 0.5),  # until a scale, 1 + 8 x or 1 - 2 x, is 0
        touches=(-2.0125, 0.0075),
        worst=0.0075,
        motion_by_pose=OFF,  # the point that is tracked moves with the parts,
    ),
    "several contacts": Scene(
        ask=_pair(CUBE, CORNER, goal="at", contacts="all", motion=X >> Y >> Z),
        amount=lambda d, e: sqrt(2) * (0.5 * d + e),
        direction="TX",
        range=(0.0, 0.0),  # along one wall the other opens, whatever the sizes
        touches=(-10.085, 9.105),
    ),
    "fit": Scene(  # the key stays in the middle of the slot, whose middle is where the slot's seed is
        ask=_pair(KEY, SLOT, goal="fit", contacts="all", motion=X, requirement="C"),
        amount=lambda d, e: -0.25 * d,
        signs=(-1, 1),
        direction="TX",
        range=(-inf, 0.25),  # line to line in the slot, of the size 1 - 4 x
        open=0.01,
        touches=(-2.0075, -0.0075, 0.0125, 2.0125),
        free=(-0.0075, 0.0125),
    ),
    "keep-outs": Scene(
        ask=_pair(CUBE, TABLE, goal="touch", motion=X >> Z, keep_out=(POST,)),
        amount=lambda d, e: np.hypot(0.5 * d, 0.5 * (d + e)),
        range=(-6 / 7, inf),
        touches=(-2.01, 0.01),
        worst=0.01,
    ),
    "keep-outs, large mesh": Scene(
        ask=_pair(CUBE, TABLE, goal="touch", motion=X >> Z, keep_out=(hollow(POST),)),
        amount=lambda d, e: np.hypot(0.5 * d, 0.5 * (d + e)),
        range=(-6 / 7, inf),
        touches=(-2.01, 0.01),
        worst=0.01,
    ),
    "displacement": Scene(ask=_pair(PROBE, TABLE, goal="touch", amount="displacement"), amount=_tip),
    "own amount": Scene(
        ask=_pair(PROBE, TABLE, goal="touch", amount=100 * casadi.SX.sym("TZ") ** 2),
        amount=lambda d, e: 100 * _tip(d, e) ** 2,
    ),
    "resolution": Scene(
        ask=_pair(PROBE, TABLE, goal="clear", clearance=0.1, resolution=STEP),
        amount=lambda d, e: STEP * np.ceil((0.1 + _tip(d, e)) / STEP - 1e-9),
        motion_by_pose=0.0,
    ),
    "own motion": Scene(
        ask=_pair(PROBE, TABLE, goal="touch", motion=fo.OwnMotion(_lift, [("TZ", "translation")])), amount=_tip
    ),
    "six parameters": Scene(ask=_pair(PROBE, TABLE, goal="touch", motion=fo.Free()), amount=_tip),
    "size: uniform": Scene(
        ask=_sized(ALL, _size("base", "static", scale="xyz")), amount=_tip, sizes=("all", "base"),
        touches=(-3.01, 0.01),
        worst=1.5 * WIDE,
    ),
    "size: faces": Scene(
        ask=_sized(TOP, ALL), amount=lambda d, e: d + e, sizes=("top", "all"),
        touches=(-3.0, 0.01),
        worst=2.0 * WIDE,
    ),
    "one size": Scene(
        ask=_sized(TOP), amount=lambda d: d, sizes=("top",),
        touches=(-3.0, 0.01),
        worst=WIDE,
    ),
    "three sizes": Scene(  # of which the last one matters to nothing
        ask=_sized(TOP, ALL, _size("wide", "static", scale="x")), amount=lambda d, e, _: d + e,
        sizes=("top", "all", "wide"),
        touches=(-3.0, 0.01),
        worst=2.0 * WIDE,
    ),
    "size: axis": Scene(
        ask=_sized(_size("height", "static", scale="z"), ALL), amount=lambda d, e: 0.5 * d + e, sizes=("height", "all"),
        touches=(-3.005, 0.005),
        worst=1.5 * WIDE,
    ),
    "size: slanted axis": Scene(  # the tip goes along the axis, by the share of the way to the seed that is along it
        ask=_sized(_size("skew", "movable", scale=(0, 0.6, 0.8)), TOP),
        amount=lambda d, e: 0.64 * d + e,
        sizes=("skew", "top"),
        touches=(-3.0112, 0.0064),
        worst=1.64 * WIDE,
    ),
    "large mesh": Scene(ask=_pair(PROBE, hollow(TABLE), goal="touch"), amount=_tip),
    "large mesh, sizes": Scene(
        ask=_sized(TOP, ALL, static=hollow(TABLE)), amount=lambda d, e: d + e, sizes=("top", "all"),
        touches=(-3.0, 0.01),
        worst=2.0 * WIDE,  # of the contact as drawn: it stays above the table
    ),
    # the lower part takes the upper one along: its top and the floor's bottom, the upper one's bottom and its top
    "round": Scene(ask=_pair(BALL, TABLE, goal="touch"), amount=_tip),
    "round, sizes": Scene(
        ask=_sized(_size("radius", "movable", faces="sphere radius 1"), TOP, movable=BALL), amount=lambda d, e: d + e,
        sizes=("radius", "top"),
        touches=(-3.01, 0.01),
        worst=2.0 * WIDE,
    ),
    "chain": Scene(
        ask=_chain(as_drawn), amount=lambda d, _: d * sqrt(2), of_moving=_chain_off, direction="lower.TZ",
        range=(-1.0, inf),  # until the lower part has no size
        touches=(-3.01, -2.01, -0.99, 0.01),
        worst=0.01,
    ),
    "loop": Scene(
        ask=_loop(as_drawn), amount=lambda d, _: d * sqrt(2.5), of_moving=_loop_off, direction="left.TZ",
        range=(-10 / 11, 1.0),  # until the left one, an eleventh of its size, is beside the floor; over the other
        touches=(-2.01, -1.01, 0.01, 1.01),
        worst=0.01,
    ),
    "chain, keep-outs": Scene(  # above, where the upper part is not to come
        ask=_chain(as_drawn, keep_out=(LAMP,)), amount=lambda d, _: d * sqrt(2), of_moving=_chain_off,
        direction="lower.TZ",
        range=(-1.0, inf),
        touches=(-3.01, -2.01, -0.99, 0.01),
        worst=0.01,
    ),
    "chain, own amount": Scene(
        ask=_chain(as_drawn, amount=100 * (casadi.SX.sym("lower.TZ") ** 2 + casadi.SX.sym("upper.TZ") ** 2)),
        amount=lambda d, _: 200 * d**2, of_moving=lambda d, e: 100 * _chain_off(d, e) ** 2,
        direction="lower.TZ",
        range=(-1.0, inf),
        touches=(-3.01, -2.01, -0.99, 0.01),
        worst=0.01,
    ),
    # to the first contacts of each pair
    "chain, large meshes": Scene(
        ask=_chain(hollow), amount=lambda d, _: d * sqrt(2), of_moving=_chain_off, direction="lower.TZ",
        range=(-1.0, inf),
        touches=(-2.01, -0.99, 0.01),
        worst=0.01,
    ),
    "loop, large meshes": Scene(
        ask=_loop(hollow), amount=lambda d, _: d * sqrt(2.5), of_moving=_loop_off, direction="left.TZ",
        range=(-10 / 11, 1.0),
        touches=(-1.01, 0.01, 1.01),
        worst=0.01,
    ),
    "chain, sizes": Scene(
        ask=_chain(as_drawn, sizes=[_size("thick", "lower", faces="+z"), _size("deep", "upper", faces="-z")]),
        amount=lambda d, e: d + e,
        sizes=("thick", "deep"),
        direction="lower.TZ",
        range=(-1.0, inf),
        touches=(-3.0, -2.01, -1.0, 0.0),
        worst=2.0 * WIDE,
    ),
}
