"""Small optimisation problems at which general solvers fail, and the same problems as motions for ours.

A `Program` states both: in formulas, which every solver gets, and as a scene in which the same number is the smallest
motion. The truth is a closed form.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

from fcdm_opt.measure.stability import scenes
from fcdm_opt.measure.stability.case import WRONG_BEYOND, Case, Verdict
from fcdm_opt.measure.stability.scenes import CUBE, FREE, LEVER, RZ, SLANT, TIP, X, Y, Z
from fcdm_opt.measure.stability.solvers import NONLINEAR, QUADRATIC, Rows, Statement
from fcdm_opt.tolerances import DEFAULT

Numbers = Mapping[str, Any]
Row = list[float]
Members = Iterator[dict[str, Any]]  # keywords of `_case`
FLOOR = DEFAULT.touch / WRONG_BEYOND  # least |x| that errors are taken relative to: nearer than `touch` is the same

# ---------------------------------------------------------------------------------------------------- the programs


@dataclass(frozen=True)
class Program:
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
    solved: Callable[..., tuple[Any, Row]]
    quadratic: bool = False


def _solved(plain: scenes.Plain, **keywords: Any) -> tuple[Any, Row]:
    """Return the solution of a problem, and all its parameters."""
    from fcdm_opt.tolerance.problem import Problem
    from fcdm_opt.tolerance.solver import solve

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


def _lever(data: Mapping[str, Any], body: scenes.Plain, wall: scenes.Plain, **keywords: Any) -> tuple[Any, Row]:
    """Return the turn of a body against a wall, by `Rotation` or as a motion of the user's own."""
    from fcdm_opt.own_motion import OwnMotion
    from fcdm_opt.tolerance.problem import Problem
    from fcdm_opt.tolerance.solver import solve

    asked = Problem.from_dict(scenes.problem(body, wall, [RZ], length=1.0, limits=_bounds(data, ["RZ"])))
    if data["numbers"].get("own"):
        asked = asked.changed(motion=OwnMotion(_turn, [("RZ", "rotation")]))
    solution = solve(asked, **keywords)
    return solution, list(solution.parameters.values())


def tangent_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least t^2 with tan(t/2) = c: one root a turn, and a pole between any two."""
    return x[0] * x[0], [m.tan(x[0] / 2) - n["c"]], []


def tangent_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Row]:
    """Swing a lever to a wall of slope c."""
    return _lever(data, LEVER, scenes.ramp(data["numbers"]["c"]), **keywords)


def cosine_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least t^2 with cos t = c: from t = 0 there is no slope to go by."""
    return x[0] * x[0], [m.cos(x[0]) - n["c"]], []


def cosine_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Row]:
    """Swing a tip that points at its pivot to a thin wall at c, nearer than the tip; or beyond its reach."""
    c = data["numbers"]["c"]
    return _lever(data, scenes.claw() if c <= 1 else LEVER, scenes.about(_wall(c), 0.05, 2, 2), **keywords)


def _wall(c: float) -> Row:
    return [c - 0.05 if c <= 1 else c + 0.05, 0.0, 0.0]


def rodrigues_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least |w|^2 such that the turn by w takes (1, 0, 0) to y = s, by Rodrigues' formula as it is usually written."""
    angle = m.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    y = m.sin(angle) / angle * x[2] + (1 - m.cos(angle)) / angle**2 * x[0] * x[1]
    return x[0] * x[0] + x[1] * x[1] + x[2] * x[2], [y - n["s"]], []


def rodrigues_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Row]:
    """Turn a lever about its seed until its tip is at the wall y = s."""
    wall = scenes.box((-4, data["numbers"]["s"], -4), (4, 3, 4))
    held = scenes.limits(TX=(0, 0), TY=(0, 0), TZ=(0, 0))
    solution, q = _solved(scenes.problem(LEVER, wall, [FREE], length=1.0, limits=held), **keywords)
    return solution, q[3:]


def slot_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least x^2 with x >= 1 + more and x <= 1: there is none where `more` is positive, however small."""
    return x[0] * x[0], [], [x[0] - (1 + n["more"]), 1 - x[0]]


def slot_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Row]:
    """Get a cube, 1 wide, clear of a block and before a keep-out, between which there is too little."""
    block = scenes.box((-9, -2, -2), (0.5 + data["numbers"]["more"], 2, 2))
    beyond = {**scenes.box((1.5, -2, -2), (9, 2, 2)), "name": "beyond"}
    kept = scenes.problem(CUBE, block, [X], goal="clear", keep_out=[beyond], limits=_bounds(data, ["TX"]))
    return _solved(kept, **keywords)


def tips_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least |x|^2 on four planes that meet in the only point that will do: their gradients depend on each other."""
    over = [x[0] - n["off"] + i * x[1] + j * x[2] for i, j in product((1, -1), repeat=2)]
    return x[0] * x[0] + x[1] * x[1] + x[2] * x[2], [], over


def tips_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Row]:
    """Bring a tip to a tip."""
    away = scenes.mapped(TIP, lambda point: [point[0] + (1 + data["numbers"]["off"]), *point[1:]])
    return _solved(scenes.problem(TIP, away, [X, Y, Z], limits=_bounds(data, ["TX", "TY", "TZ"])), **keywords)


def repeated_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least x^2 with x + off = 0, eight times."""
    return x[0] * x[0], [x[0] + n["off"]] * 8, []


def repeated_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Row]:
    """Keep tip on tip, eight contacts in one, while both bodies grow."""
    away = scenes.mapped(TIP, lambda point: [point[0] + 1, *point[1:]])
    off = data["numbers"]["off"]
    asked = scenes.problem(TIP, away, [X], goal="at", nominal=[1.0, 1.0], tolerance=off, requirement="A")
    return _solved(asked, **keywords)


def corners_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least |x|^2 with x_k >= off: three at once, almost met at 0."""
    return x[0] * x[0] + x[1] * x[1] + x[2] * x[2], [], [x[k] - n["off"] for k in range(3)]


def corners_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Row]:
    """Bring a cube's corner to a cube's corner."""
    away = scenes.about([1 + data["numbers"]["off"]] * 3, 0.5)
    return _solved(scenes.problem(CUBE, away, [X, Y, Z], limits=_bounds(data, ["TX", "TY", "TZ"])), **keywords)


def tiny_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least x^2 with e x >= e / 2 for a small e."""
    return x[0] * x[0], [], [n["e"] * x[0] - n["e"] / 2]


def tiny_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Row]:
    """Bring a cube of width e to a plate e / 2 away: the contact line's numbers are of that size."""
    e = data["numbers"]["e"]
    cube, plate = (scenes.mapped(body, lambda point: [e * x for x in point]) for body in (CUBE, scenes.PLATE))
    solution, q = _solved(scenes.problem(cube, plate, [X]), **keywords)
    return solution, [x / e for x in q]


def blend_rows(x: Any, n: Numbers, m: Any) -> Any:
    """Least p_1 x^2 / 2 + p_2 y^2 / 2 + l x with x + y = 1."""
    (p, r), linear = n["p"], n["l"]
    return p / 2 * x[0] * x[0] + r / 2 * x[1] * x[1] + linear * x[0], [x[0] + x[1] - 1], []


def blend_scene(data: Mapping[str, Any], **keywords: Any) -> tuple[Any, Row]:
    """Bring a cube's edge to the slant x + y = 1 beyond it, by weights or, with l, by an amount of one's own."""
    (p, r), linear = data["numbers"]["p"], data["numbers"]["l"]
    own = scenes.problem(CUBE, SLANT, [X, Y], limits=_bounds(data, ["TX", "TY"]),
                         weights=scenes.weights(TX=math.sqrt(p / 2), TY=math.sqrt(r / 2)))  # fmt: skip
    if linear == 0:
        return _solved(own, **keywords)
    import casadi

    from fcdm_opt.tolerance.problem import Problem
    from fcdm_opt.tolerance.solver import solve

    x, y = casadi.SX.sym("TX"), casadi.SX.sym("TY")
    amount = p / 2 * x * x + r / 2 * y * y + linear * x + linear * linear / p  # never negative
    solution = solve(Problem.from_dict(own).changed(amount=amount, weights=None), **keywords)
    return solution, list(solution.parameters.values())


PROGRAMS = {
    "tangent": Program(tangent_rows, tangent_scene),
    "cosine": Program(cosine_rows, cosine_scene),
    "rodrigues": Program(rodrigues_rows, rodrigues_scene),
    "slot": Program(slot_rows, slot_scene, quadratic=True),
    "tips": Program(tips_rows, tips_scene, quadratic=True),
    "repeated": Program(repeated_rows, repeated_scene, quadratic=True),
    "corners": Program(corners_rows, corners_scene, quadratic=True),
    "tiny": Program(tiny_rows, tiny_scene, quadratic=True),
    "blend": Program(blend_rows, blend_scene, quadratic=True),
}

# --------------------------------------------------------------------------------------------------------- the cases


def cases(quick: bool, seed: int) -> list[Case]:
    """Return the cases; nothing in them is drawn by lot.

    Parameters
    ----------
    quick : bool
        About a fifth of them, of every family.
    seed : int
        Unused.
    """
    made = []
    for family, members in FAMILIES.items():
        own = [_case(family, **member) for member in members()]
        made += own[:: 5 if quick else 1]
    return made


def _case(family: str, *, name: str, program: str, numbers: Numbers, source: str, best: Sequence[Row] = (),
          start: Row | None = None, low: Sequence[float | None] | None = None,
          high: Sequence[float | None] | None = None, size: int = 1) -> Case:  # fmt: skip
    """Return a case; `best` are all the least x, none where no x will do."""
    data = {
        "program": program,
        "numbers": dict(numbers),
        "start": start or [0.0] * size,
        "low": list(low or [None] * size),
        "high": list(high or [None] * size),
    }
    truth = {"x": [list(map(float, x)) for x in best]} if best else {"none": True}
    return Case(family, name, "program", data, {**truth, "source": source})


def wrong_roots() -> Members:
    """Of the many roots of tan(t/2) = c the one nearest to 0, from several starts and within several bounds."""
    source = "2 atan c, and whole turns more"
    for c, own in product((5.0, 0.5, 1.0, 20.0, 100.0), (False, True)):
        yield {"name": f"c = {c:g}{', own motion' * own}", "program": "tangent", "numbers": {"c": c, "own": own},
               "best": [[2 * math.atan(c)]], "source": source}  # fmt: skip
    for start in (-1.0, 1.0, 3.0, -20.0, 27.0):
        yield {"name": f"c = 5 from {start:g}", "program": "tangent", "numbers": {"c": 5.0}, "start": [start],
               "best": [[2 * math.atan(5)]], "source": source}  # fmt: skip
    for low, high, turns in ((3.2, 40.0, 1), (20.0, 40.0, 3), (27.0, 40.0, 4), (-40.0, -3.2, -1)):
        yield {"name": f"c = 5 within {low:g}, {high:g}", "program": "tangent", "numbers": {"c": 5.0}, "low": [low],
               "high": [high], "start": [low if low > 0 else high], "best": [[2 * math.atan(5) + 2 * math.pi * turns]],
               "source": source}  # fmt: skip


def stationary_starts() -> Members:
    """Of cos t = c, from where its slope is 0 or next to it."""
    for c, own in product((0.9, 0.5, 0.7, 0.99, 0.999), (False, True)):
        yield {"name": f"c = {c:g}{', own motion' * own}", "program": "cosine", "numbers": {"c": c, "own": own},
               "best": [[math.acos(c)], [-math.acos(c)]], "source": "acos c"}  # fmt: skip
    for start in (1e-9, 1e-3, -1e-3, math.pi):
        yield {"name": f"c = 0.9 from {start:g}", "program": "cosine", "numbers": {"c": 0.9}, "start": [start],
               "best": [[math.acos(0.9)], [-math.acos(0.9)]], "source": "acos c"}  # fmt: skip
    yield {"name": "c = 1: met at the start", "program": "cosine", "numbers": {"c": 1.0}, "best": [[0.0]],
           "source": "acos c"}  # fmt: skip


def without_solution() -> Members:
    """No x will do, and not by little."""
    for c in (1.2, 1.01, 1.5, 3.0):
        yield {"name": f"cos t = {c:g}", "program": "cosine", "numbers": {"c": c}, "source": "|cos t| <= 1"}
    for low, high in ((-3.1, 2.7), (3.2, 9.0), (-3.0, 2.0)):
        yield {"name": f"tan(t/2) = 5 within {low:g}, {high:g}", "program": "tangent", "numbers": {"c": 5.0},
               "low": [low], "high": [high], "start": [min(max(0.0, low), high)],
               "source": "between roots 2 atan 5 + 2 pi k"}  # fmt: skip
    for most in ((0.3, 0.5), (0.3, 0.6999), (-1.0, 1.9)):
        yield {"name": f"x + y = 1 within {most[0]:g}, {most[1]:g}", "program": "blend", "size": 2,
               "numbers": {"p": [2.0, 4.0], "l": 0.0}, "high": most, "low": (-9.0, -9.0),
               "source": "the upper bounds' sum is less than 1"}  # fmt: skip
    for off in (1.0, 1e-3):
        yield {"name": f"a tip {off:g} away within half of that", "program": "tips", "numbers": {"off": off}, "size": 3,
               "low": (-off / 2,) * 3, "high": (off / 2,) * 3, "source": "x >= off in all that will do"}  # fmt: skip


def next_to_nothing() -> Members:
    """Two inequalities that miss each other, or overlap, by less than solvers let pass."""
    for more in (5e-8, -5e-8, 5e-7, -5e-7, 1e-6, -1e-6, 5e-6, -5e-6, 1e-4, -1e-4):
        yield {"name": f"x <= 1 and x >= 1 + {more:g}", "program": "slot", "numbers": {"more": more}, "low": [0.0],
               "high": [3.0], "best": [] if more > 0 else [[1 + more]],
               "source": "the sign of the difference"}  # fmt: skip
    for more in (5e-8, -5e-8, 1e-6, -1e-6):
        yield {"name": f"x + y = 1 within 0.3, 0.7 - {more:g}", "program": "blend", "size": 2,
               "numbers": {"p": [2.0, 2.0], "l": 0.0}, "low": (-9.0, -9.0), "high": (0.3, 0.7 - more),
               "best": [] if more > 0 else [[0.3, 0.7]], "source": "the sum of the bounds"}  # fmt: skip


def dependent_gradients() -> Members:
    """Vertex on vertex: more conditions in the only point that will do than variables, almost met at the start."""
    for off in (1.0, 1e-2, 1e-4, 1e-6, 1e-7):
        yield {"name": f"four planes, {off:g} away", "program": "tips", "numbers": {"off": off}, "size": 3,
               "best": [[off, 0, 0]], "source": "the planes' common point"}  # fmt: skip
        yield {"name": f"an equation eight times, {off:g} away", "program": "repeated", "numbers": {"off": off},
               "best": [[-off]], "source": "linear"}  # fmt: skip
        yield {"name": f"three planes, {off:g} away", "program": "corners", "numbers": {"off": off}, "size": 3,
               "best": [[off] * 3], "source": "the corner"}  # fmt: skip


def tiny_coefficients() -> Members:
    """State a row that solvers drop, or take as met by their absolute tolerance."""
    for e in (1e-9, 1e-10, 1e-6, 1e-7, 1e-8, 1e-12, 1e-3):
        yield {"name": f"e = {e:g}", "program": "tiny", "numbers": {"e": e}, "best": [[0.5]], "source": "linear"}


def quadratic_programs() -> Members:
    """Least p_1 x^2 / 2 + p_2 y^2 / 2 + l x with x + y = 1: the line's lowest point, or a bound."""
    source = "on the line x + y = 1 a parabola in x, clipped by the bounds"
    own = [([2.0, 4.0], -2.0, (0.0, None)), ([2.0, 4.0], 0.0, (None, None)), ([2.0, 4.0], 0.0, (None, 0.6)),
           ([2.0, 4.0], 0.0, (0.75, None)), ([2.0, 4.0], -2.0, (None, None)), ([2.0, 4.0], -2.0, (None, 0.9)),
           ([2.0, 2e6], 0.0, (None, None)), ([2.0, 2e-6], 0.0, (None, None)), ([2.0, 2e10], 0.0, (None, None)),
           ([2e-8, 2e-8], 0.0, (None, None)), ([2.0, 2.0], -1.0, (None, None))]  # fmt: skip
    for (p, r), linear, (low, high) in own:
        x = (r - linear) / (p + r)
        x = min(max(x, -math.inf if low is None else low), math.inf if high is None else high)
        yield {"name": f"P = {p:g}, {r:g}, l = {linear:g}, x within {low}, {high}", "program": "blend", "size": 2,
               "numbers": {"p": [p, r], "l": linear}, "low": (low, None), "high": (high, None), "best": [[x, 1 - x]],
               "source": source}  # fmt: skip
    both = {"name": "P = 2, 4, l = -2, x >= 0 and y >= 0", "program": "blend", "size": 2,
            "numbers": {"p": [2.0, 4.0], "l": -2.0}, "low": (0.0, 0.0), "best": [[1, 0]], "source": source}  # fmt: skip
    yield both


def at_the_identity() -> Members:
    """Rodrigues' formula as it is usually written has 0 / 0 where every search begins."""
    for s, start in product((0.5, 0.3, 0.9), (0.0, 1e-9, 1e-3)):
        yield {"name": f"y = {s:g} from {start:g}", "program": "rodrigues", "numbers": {"s": s}, "size": 3,
               "start": [0.0, 0.0, start], "best": [[0, 0, math.asin(s)]],
               "source": "the angle between (1, 0, 0) and the circle y = s on the sphere"}  # fmt: skip
    yield {"name": "y = 1.1", "program": "rodrigues", "numbers": {"s": 1.1}, "size": 3, "start": [0.0, 0.0, 1e-3],
           "source": "no point of the unit sphere is at y = 1.1"}  # fmt: skip


FAMILIES: dict[str, Callable[[], Members]] = {
    "the wrong one of many roots": wrong_roots,
    "stationary at the start": stationary_starts,
    "no solution": without_solution,
    "feasible or not by next to nothing": next_to_nothing,
    "dependent gradients": dependent_gradients,
    "tiny coefficients": tiny_coefficients,
    "quadratic programs": quadratic_programs,
    "Rodrigues at the identity": at_the_identity,
}

# ------------------------------------------------------------------------------------------------------- the methods


def _ours(data: Mapping[str, Any], **keywords: Any) -> dict[str, Any]:
    """Solve the program as a motion."""
    from fcdm_opt.tolerance.solution import Status

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


def applies(name: str, case: Case) -> bool:
    """Tell whether a method takes the case: solvers of quadratic programs no other, and only ours motions."""
    if case.data["numbers"].get("own"):
        return name in OURS
    return name not in QUADRATIC or PROGRAMS[case.data["program"]].quadratic


def judged(case: Case, answer: Mapping[str, Any]) -> Verdict:
    """Return what an answer is worth: an x off every least one by more than `WRONG_BEYOND` is wrong."""
    best = case.truth.get("x", [])
    if "flag" in answer:
        return Verdict("flagged", reason=str(answer["flag"]))
    if "none" in answer:
        wrong = f"called impossible ({answer['none']}), but {best} will do"
        return Verdict("wrong", reason=wrong) if best else Verdict("right", reason=str(answer["none"]))
    x = answer["x"]
    if not best:
        return Verdict("wrong", reason=f"{x} for a program that has no solution")
    error = min(math.dist(x, own) / max(math.hypot(*own), FLOOR) for own in best)
    if error <= WRONG_BEYOND:
        return Verdict("right", error)
    return Verdict("wrong", error if math.isfinite(error) else None, f"{x} is off {best}")
