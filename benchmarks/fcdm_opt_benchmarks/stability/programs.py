"""Small optimisation problems at which general solvers fail, and the same problems as motions for ours.

A `HardProgram` states both: in formulas, which every solver gets, and as a scene in which the same number is the least
amount of a motion. The truth is a closed form.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.stability import scenes
from fcdm_opt_benchmarks.stability.case import WRONG_BEYOND, Grade, HardCase
from fcdm_opt_benchmarks.stability.program_families import FAMILIES
from fcdm_opt_benchmarks.stability.scenes import CUBE, FREE, LEVER, RZ, SLANT, TIP, X, Y, Z
from fcdm_opt_benchmarks.stability.solvers import NONLINEAR, QUADRATIC, Rows, Statement

Numbers = Mapping[str, Any]
Vector = list[float]
FLOOR = DEFAULT.touch / WRONG_BEYOND  # least |x| that errors are taken relative to: nearer than `touch` is the same

# ---------------------------------------------------------------------------------------------------- the programs


@dataclass(frozen=True)
class HardProgram:
    """Least f(x) with e(x) = 0 and g(x) >= 0, and x within bounds.

    Attributes
    ----------
    rows : callable
        (x, numbers, module with sin, cos ...) -> (f, e, g): a number and two lists.
    solved : callable
        (data of a case, keywords of `solve`) -> the solution of the same program as a motion, and its x.
    quadratic : bool
        Whether f is quadratic and e, g are linear.
    """

    rows: Rows
    solved: Callable[..., tuple[Any, Vector]]
    quadratic: bool = False


def _solved(plain: scenes.Plain, **keywords: Any) -> tuple[Any, Vector]:
    """Return the solution of a problem, and all its parameters."""
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.solver import solve

    solution = solve(Problem.from_dict(plain), **keywords)
    return solution, list(solution.parameters.values())


def _bounds(data: Mapping[str, Any], names: Sequence[str], scale: float = 1.0) -> scenes.Plain:
    """Return a case's bounds as limits of a motion's parameters, each `scale` times the variable."""
    ends = zip(names, data["low"], data["high"], strict=True)
    return scenes.limits(
        **{name: ["-inf" if low is None else scale * low, "inf" if high is None else scale * high]
           for name, low, high in ends}
    )  # fmt: skip


def _turn(q: Any) -> Any:
    """Return a turn about z through the origin, as a user writes it."""
    import casadi

    T, c, s = casadi.SX.eye(4), casadi.cos(q[0]), casadi.sin(q[0])
    T[0, 0], T[0, 1], T[1, 0], T[1, 1] = c, -s, s, c
    return T


def _lever(data: Mapping[str, Any], body: scenes.Plain, wall: scenes.Plain, **keywords: Any) -> tuple[Any, Vector]:
    """Return the turn of a body against a wall, by `Rotation` or as a motion of the user's own."""
    from fcdm_opt.motion.own_motion import OwnMotion
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.solver import solve

    asked = Problem.from_dict(scenes.problem(body, wall, [RZ], length=1.0, limits=_bounds(data, ["RZ"])))
    if data["numbers"].get("own"):
        asked = asked.changed(motion=OwnMotion(_turn, [("RZ", "rotation")]))
    solution = solve(asked, **keywords)
    return solution, list(solution.parameters.values())


def tangent_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least t^2 with tan(t/2) = c: one root a turn, and a pole between any two."""
    return x[0] * x[0], [m.tan(x[0] / 2) - n["c"]], []


def tangent_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Vector]:
    """Swing a lever to a wall of slope c."""
    return _lever(data, LEVER, scenes.ramp(data["numbers"]["c"]), **keywords)


def cosine_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least t^2 with cos t = c: from t = 0 there is no slope to go by."""
    return x[0] * x[0], [m.cos(x[0]) - n["c"]], []


def cosine_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Vector]:
    """Swing a tip that points at its pivot to a thin wall at c, nearer than the tip; or beyond its reach."""
    c = data["numbers"]["c"]
    return _lever(data, scenes.CLAW if c <= 1 else LEVER, scenes.about(_wall(c), 0.05, 2, 2), **keywords)


def _wall(c: float) -> Vector:
    return [c - 0.05 if c <= 1 else c + 0.05, 0.0, 0.0]


def rodrigues_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least |w|^2 such that the turn by w takes (1, 0, 0) to y = s, by Rodrigues' formula as it is usually written."""
    angle = m.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    y = m.sin(angle) / angle * x[2] + (1 - m.cos(angle)) / angle**2 * x[0] * x[1]
    return x[0] * x[0] + x[1] * x[1] + x[2] * x[2], [y - n["s"]], []


def rodrigues_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Vector]:
    """Turn a lever about its seed until its tip is at the wall y = s."""
    wall = scenes.box((-4, data["numbers"]["s"], -4), (4, 3, 4))
    held = scenes.limits(TX=(0, 0), TY=(0, 0), TZ=(0, 0))
    solution, q = _solved(scenes.problem(LEVER, wall, [FREE], length=1.0, limits=held), **keywords)
    return solution, q[3:]


def slot_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least x^2 with x >= 1 + more and x <= 1: there is none where `more` is positive, however small."""
    return x[0] * x[0], [], [x[0] - (1 + n["more"]), 1 - x[0]]


def slot_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Vector]:
    """Get a cube, 1 wide, clear of a block and before a keep-out, between which there is too little."""
    block = scenes.box((-9, -2, -2), (0.5 + data["numbers"]["more"], 2, 2))
    beyond = {**scenes.box((1.5, -2, -2), (9, 2, 2)), "name": "beyond"}
    kept = scenes.problem(CUBE, block, [X], goal="clear", keep_out=[beyond], limits=_bounds(data, ["TX"]))
    return _solved(kept, **keywords)


def tips_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least |x|^2 on four planes that meet in the only point that will do: their gradients depend on each other."""
    over = [x[0] - n["off"] + i * x[1] + j * x[2] for i, j in product((1, -1), repeat=2)]
    return x[0] * x[0] + x[1] * x[1] + x[2] * x[2], [], over


def tips_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Vector]:
    """Bring a tip to a tip."""
    away = scenes.shifted(TIP, (1 + data["numbers"]["off"], 0, 0))
    return _solved(scenes.problem(TIP, away, [X, Y, Z], limits=_bounds(data, ["TX", "TY", "TZ"])), **keywords)


def repeated_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least x^2 with x + off = 0, eight times."""
    return x[0] * x[0], [x[0] + n["off"]] * 8, []


def repeated_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Vector]:
    """Keep tip on tip, eight contacts in one, while both bodies grow."""
    away = scenes.shifted(TIP, (1, 0, 0))
    grown = 1 + data["numbers"]["off"]
    return _solved(scenes.problem(TIP, away, [X], goal="at", nominal=[1.0, 1.0], target=[grown, grown]), **keywords)


def corners_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least |x|^2 with x_k >= off: three at once, almost met at 0."""
    return x[0] * x[0] + x[1] * x[1] + x[2] * x[2], [], [x[k] - n["off"] for k in range(3)]


def corners_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Vector]:
    """Bring a cube's corner to a cube's corner."""
    away = scenes.about([1 + data["numbers"]["off"]] * 3, 0.5)
    return _solved(scenes.problem(CUBE, away, [X, Y, Z], limits=_bounds(data, ["TX", "TY", "TZ"])), **keywords)


def tiny_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least x^2 with e x >= e / 2 for a small e."""
    return x[0] * x[0], [], [n["e"] * x[0] - n["e"] / 2]


def tiny_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Vector]:
    """Bring a cube of width e to a plate e / 2 away: the contact line's numbers are of that size."""
    e = data["numbers"]["e"]
    cube, plate = (scenes.mapped(body, lambda point: [e * x for x in point]) for body in (CUBE, scenes.PLATE))
    solution, q = _solved(scenes.problem(cube, plate, [X]), **keywords)
    return solution, [x / e for x in q]


def blend_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least p_1 x^2 / 2 + p_2 y^2 / 2 + l x with x + y = 1."""
    (p, r), linear = n["p"], n["l"]
    return p / 2 * x[0] * x[0] + r / 2 * x[1] * x[1] + linear * x[0], [x[0] + x[1] - 1], []


def blend_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Vector]:
    """Bring a cube's edge to the slant x + y = 1 beyond it, by weights or, with l, by an amount of one's own."""
    (p, r), linear = data["numbers"]["p"], data["numbers"]["l"]
    own = scenes.problem(CUBE, SLANT, [X, Y], limits=_bounds(data, ["TX", "TY"]),
                         weights=scenes.weights(TX=math.sqrt(p / 2), TY=math.sqrt(r / 2)))  # fmt: skip
    if linear == 0:
        return _solved(own, **keywords)
    import casadi

    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.solver import solve

    x, y = casadi.SX.sym("TX"), casadi.SX.sym("TY")
    amount = p / 2 * x * x + r / 2 * y * y + linear * x + linear * linear / p  # never negative
    solution = solve(Problem.from_dict(own).changed(amount=amount, weights=None), **keywords)
    return solution, list(solution.parameters.values())


PROGRAMS = {
    "tangent": HardProgram(tangent_rows, tangent_scene),
    "cosine": HardProgram(cosine_rows, cosine_scene),
    "rodrigues": HardProgram(rodrigues_rows, rodrigues_scene),
    "slot": HardProgram(slot_rows, slot_scene, quadratic=True),
    "tips": HardProgram(tips_rows, tips_scene, quadratic=True),
    "repeated": HardProgram(repeated_rows, repeated_scene, quadratic=True),
    "corners": HardProgram(corners_rows, corners_scene, quadratic=True),
    "tiny": HardProgram(tiny_rows, tiny_scene, quadratic=True),
    "blend": HardProgram(blend_rows, blend_scene, quadratic=True),
}

# --------------------------------------------------------------------------------------------------------- the cases


def cases(quick: bool, seed: int) -> list[HardCase]:
    """Return the cases; nothing in them is drawn by lot.

    Parameters
    ----------
    quick : bool
        About an eighth of them, of every family.
    seed : int
        Unused.
    """
    made = []
    for family, members in FAMILIES.items():
        own = [_case(family, **member) for member in members()]
        made += own[:: 8 if quick else 1]
    return made


def _case(family: str, *, name: str, program: str, numbers: Numbers, source: str, best: Sequence[Vector] = (),
          start: Vector | None = None, low: Sequence[float | None] | None = None,
          high: Sequence[float | None] | None = None, size: int = 1) -> HardCase:  # fmt: skip
    """Return a case; `best` are all the least x, none where no x will do."""
    data = {
        "program": program,
        "numbers": dict(numbers),
        "start": start or [0.0] * size,
        "low": list(low or [None] * size),
        "high": list(high or [None] * size),
    }
    truth = {"x": [list(map(float, x)) for x in best]} if best else {"none": True}
    return HardCase(family, name, "program", data, {**truth, "source": source})


# ------------------------------------------------------------------------------------------------------- the methods


def _ours(data: Mapping[str, Any], **keywords: Any) -> dict[str, Any]:
    """Solve the program as a motion."""
    from fcdm_opt.problem.solution import Status

    solution, x = PROGRAMS[data["program"]].solved(data, **keywords)
    if solution.usable:
        return {"x": x}
    said = f"{solution.status.name}: {solution.status.value}"
    return {"none": said} if solution.status is Status.INFEASIBLE else {"flag": said}


def _general(solver: Callable[[Statement], dict[str, Any]], data: Mapping[str, Any]) -> dict[str, Any]:
    """Hand the formulas to a solver."""
    given = {key: data[key] for key in ("numbers", "start", "low", "high")}
    return solver(Statement(PROGRAMS[data["program"]].rows, **given))


METHODS: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
    "solve": _ours,
    "solve, certified": partial(_ours, certify=True),
    **{name: partial(_general, solver) for name, solver in (NONLINEAR | QUADRATIC).items()},
}
OURS = ("solve", "solve, certified")


def applies(name: str, case: HardCase) -> bool:
    """Tell whether a method takes the case: solvers of quadratic programs no other, and only ours motions."""
    if case.data["numbers"].get("own"):
        return name in OURS
    return name not in QUADRATIC or PROGRAMS[case.data["program"]].quadratic


def judged(case: HardCase, answer: Mapping[str, Any]) -> Grade:
    """Return what an answer is worth: an x off every least one by more than `WRONG_BEYOND` is wrong."""
    best = case.truth.get("x", [])
    if "flag" in answer:
        return Grade("flagged", reason=str(answer["flag"]))
    if "none" in answer:
        wrong = f"called impossible ({answer['none']}), but {best} will do"
        return Grade("wrong", reason=wrong) if best else Grade("right", reason=str(answer["none"]))
    x = answer["x"]
    if not best:
        return Grade("wrong", reason=f"{x} for a program that has no solution")
    error = min(math.dist(x, own) / max(math.hypot(*own), FLOOR) for own in best)
    if error <= WRONG_BEYOND:
        return Grade("right", error)
    return Grade("wrong", error if math.isfinite(error) else None, f"{x} is off {best}")
