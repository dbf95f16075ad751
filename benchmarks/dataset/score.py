"""Score a tool's answers to the data set: needs numpy and scipy, and knows of no tool.

    python score.py answers.json [answers.json ...] [--scenes scenes.json] [--each]

An answers file is one JSON object: `tool`, a text, and `answers`, an object from a scene's name to

    claim        "least": nothing smaller will do; "motion": this will do; "none": nothing will; "unknown"
    motion       list of parameters in the order of the scene's motion, lengths and radians (with "least" and "motion")
    scale        of a scene that asks for a scale, in place of `motion`
    lower_bound  optional: no motion has a smaller amount
    seconds      that the answer took
    said         optional: what the tool said of it

Each motion is carried out here and looked at by separating planes and nearest features of convex parts, see README.md
beside this file. A scene without an answer counts as "unknown".
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

MISS = 1e-6
"""Of the scene's size: by so much parts may overlap, or be apart, where they are to touch."""

REACHED, NEAR = 1e-6, 1e-3
"""Relative: a motion this much larger than the least has reached it; is near it."""

TIGHT = 1e-10
"""Of the size: only motions that miss by no more, and are less by more, can refute the data set's own bounds."""

PARALLEL = 1e-9
"""Sine of an angle below which edges, or faces, have one direction."""

Array = np.ndarray[Any, np.dtype[np.float64]]
Scene = Mapping[str, Any]


# ---------------------------------------------------------------------------------------------------------- motions


def parameters(motion: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return for each parameter of a motion whether it is a "length" or an "angle"."""
    found = []
    for step in motion:
        found += ["length"] * 3 + ["angle"] * 3 if "free" in step else ["length" if "translation" in step else "angle"]
    return found


def pose(motion: Sequence[Mapping[str, Any]], q: Sequence[float], seed: Sequence[float]) -> tuple[Array, Array]:
    """Return R (3, 3) and t (3,) of x -> R x + t: the steps one after the other, in the world's axes."""
    R, t, left = np.eye(3), np.zeros(3), [float(x) for x in q]
    for step in motion:
        here = R @ np.asarray(seed, float) + t
        turn, centre, slide = np.eye(3), here, np.zeros(3)
        if "translation" in step:
            slide = left.pop(0) * _unit(step["translation"])
        elif "rotation" in step:
            centre = here if step["centre"] == "seed" else np.asarray(step["centre"], float)
            turn = Rotation.from_rotvec(left.pop(0) * _unit(step["rotation"])).as_matrix()
        elif "screw" in step:
            angle, axis = left.pop(0), _unit(step["screw"]["direction"])
            centre, slide = np.asarray(step["screw"]["point"], float), step["pitch"] * angle * axis
            turn = Rotation.from_rotvec(angle * axis).as_matrix()
        else:
            slide, vector, left = np.array(left[:3]), left[3:6], left[6:]
            turn = Rotation.from_rotvec(vector).as_matrix()
        R, t = turn @ R, turn @ (t - centre) + centre + slide
    return R, t


def _unit(way: Sequence[float]) -> Array:
    return np.asarray(way, float) / np.linalg.norm(way)


def amount(scene: Scene, q: Sequence[float]) -> float:
    """Return the amount of a motion: the root of the sum of the squares of weight times parameter."""
    return math.hypot(*(w * x for w, x in zip(scene["question"]["weights"], q, strict=True)))


def made(scene: Scene, role: str) -> list[Array]:
    """Return the corners of the convex parts of a body as made: seed + scale (x - seed)."""
    seed = np.asarray(scene[role]["seed"], float)
    scale = scene["scale"][0 if role == "movable" else 1]
    return [seed + scale * (np.asarray(part, float) - seed) for part in scene[role]["parts"]]


def size(scene: Scene) -> float:
    """Return the larger box diagonal of the two bodies as drawn."""
    every = [np.vstack([np.asarray(part, float) for part in scene[role]["parts"]]) for role in ("movable", "static")]
    return max(float(np.linalg.norm(np.ptp(points, axis=0))) for points in every)


# ---------------------------------------------------------------------------------------------------- convex parts


class Part(NamedTuple):
    """Corners, outward normals of faces, edges as pairs of corners, and triangles of the surface."""

    corners: Array
    normals: Array
    edges: Any
    triangles: Any


def part(corners: Array) -> Part:
    """Return the hull of some points."""
    hull = ConvexHull(corners)
    sides: dict[tuple[int, int], list[int]] = {}
    for k, (i, j, m) in enumerate(hull.simplices.tolist()):
        for edge in ((i, j), (j, m), (i, m)):
            sides.setdefault((min(edge), max(edge)), []).append(k)
    normals = hull.equations[:, :3]
    edges = [edge for edge, (a, b) in sides.items() if np.linalg.norm(np.cross(normals[a], normals[b])) > PARALLEL]
    return Part(corners, normals, np.array(edges), hull.simplices)


def moved(own: Part, R: Array, t: Array) -> Part:
    """Return a part after x -> R x + t."""
    return own._replace(corners=own.corners @ R.T + t, normals=own.normals @ R.T)


def separation(one: Part, two: Part) -> float:
    """Return the widest gap between parallel planes that part them, negative where they overlap.

    Its sign is right; where it is negative its size is how far they must be shifted to part.
    """
    e, f = (own.corners[own.edges[:, 1]] - own.corners[own.edges[:, 0]] for own in (one, two))
    crosses = np.cross(e[:, None], f[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crosses, axis=1)
    long = np.outer(np.linalg.norm(e, axis=1), np.linalg.norm(f, axis=1)).ravel()
    crosses = crosses[lengths > PARALLEL * long] / lengths[lengths > PARALLEL * long, None]
    ways = np.vstack([one.normals, -two.normals, crosses, -crosses])  # from one to two
    middle = one.corners.mean(axis=0)  # distances from here keep their digits far from the origin
    gaps = ((two.corners - middle) @ ways.T).min(axis=0) - ((one.corners - middle) @ ways.T).max(axis=0)
    return float(gaps.max())


def distance(one: Part, two: Part) -> float:
    """Return the distance of two parts that do not overlap: least over corners and triangles, and over edges."""
    return min(_to_triangles(one, two), _to_triangles(two, one), _between_edges(one, two))


def _to_triangles(one: Part, two: Part) -> float:
    a, b, c = (two.corners[two.triangles[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    n /= np.linalg.norm(n, axis=1)[:, None]
    rows = one.corners[:, None] - a[None]
    height = np.einsum("ptk,tk->pt", rows, n)
    foot = one.corners[:, None] - height[..., None] * n[None]
    sides = [np.einsum("ptk,tk->pt", foot - p[None], np.cross(n, q - p)) for p, q in ((a, b), (b, c), (c, a))]
    inside = np.all(np.array(sides) >= 0, axis=0)
    return float(np.abs(height[inside]).min(initial=np.inf))


def _between_edges(one: Part, two: Part) -> float:
    p, d = (one.corners[one.edges[:, 0]], one.corners[one.edges[:, 1]] - one.corners[one.edges[:, 0]])
    r, e = (two.corners[two.edges[:, 0]], two.corners[two.edges[:, 1]] - two.corners[two.edges[:, 0]])
    w = p[:, None] - r[None]
    dd, ee, de = (d * d).sum(axis=1)[:, None], (e * e).sum(axis=1)[None], d @ e.T
    dw, ew = np.einsum("ik,ijk->ij", d, w), np.einsum("jk,ijk->ij", e, w)
    square = dd * ee - de * de
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.where(square > PARALLEL**2 * dd * ee, np.clip((de * ew - ee * dw) / square, 0, 1), 0.0)
    u = np.clip((de * s + ew) / ee, 0, 1)
    s = np.clip((de * u - dw) / dd, 0, 1)
    return float(np.linalg.norm(w + s[..., None] * d[:, None] - u[..., None] * e[None], axis=2).min(initial=np.inf))


# --------------------------------------------------------------------------------------------------------- verdicts


def miss(scene: Scene, q: Sequence[float]) -> float:
    """Return by what length a motion misses what the scene asks: limits, overlap, clearance, touching."""
    question = scene["question"]
    R, t = pose(question["motion"], q, scene["movable"]["seed"])
    ones, twos = (
        [moved(part(own), R, t) for own in made(scene, "movable")],
        [part(own) for own in made(scene, "static")],
    )
    clearance, worst = question.get("clearance", 0.0), 0.0
    for (low, high), x, weight in zip(_limits(question), q, question["weights"], strict=True):
        worst = max(worst, weight * (low - x), weight * (x - high))
    gaps = {}
    for (i, one), (j, two) in product(enumerate(ones), enumerate(twos)):
        gap = separation(one, two)
        gaps[i, j] = distance(one, two) if gap > 0 else gap
        worst = max(worst, clearance - gaps[i, j])
    if question["goal"] == "touch":
        worst = max(worst, min(gaps.values()))
    return max([worst, *(gaps[i, j] for i, j in question.get("pairs", ()))])


def _limits(question: Mapping[str, Any]) -> list[tuple[float, float]]:
    given = question.get("limits") or [None] * len(question["weights"])
    return [(-math.inf, math.inf) if own is None else (own[0], own[1]) for own in given]


class Verdict(NamedTuple):
    """What an answer is worth: outcome, relative error of its amount, seconds, and why."""

    outcome: str
    error: float | None = None
    seconds: float | None = None
    why: str = ""


OUTCOMES = ("least", "near", "larger", "unknown", "wrong")
"""Reached to 1e-6; to 1e-3; valid but larger; no answer, and said so; silently wrong."""


def verdict(scene: Scene, answer: Mapping[str, Any] | None) -> Verdict:
    """Return what an answer to a scene is worth."""
    if answer is None:
        return Verdict("unknown", why="no answer")
    seconds, truth, claim = answer.get("seconds"), scene["answer"], answer.get("claim", "unknown")
    least = truth.get("amount", math.inf)
    bound = answer.get("lower_bound")
    if (
        bound is not None
        and scene["question"]["goal"] != "scale"
        and bound > least * (1 + REACHED) + TIGHT * size(scene)
    ):
        return Verdict("wrong", None, seconds, f"lower bound {bound:.9g}, where {least:.9g} will do")
    if claim == "unknown":
        return Verdict("unknown", None, seconds, str(answer.get("said", "")))
    if claim == "none":
        right = "none" in truth
        return Verdict("least" if right else "wrong", 0.0 if right else None, seconds, "" if right else "there is one")
    if scene["question"]["goal"] == "scale":
        error = abs(answer["scale"] / truth["scale"] - 1.0)
        return _graded(error, error, seconds, "another scale")
    q = answer["motion"]
    if len(q) != len(scene["question"]["weights"]) or not np.isfinite(q).all():
        return Verdict("wrong", None, seconds, f"a motion of {q}")
    off, own = miss(scene, q), amount(scene, q)
    if not off <= MISS * size(scene):
        return Verdict("wrong", None, seconds, f"misses what is asked by {off:.3g}")
    if "none" in truth:
        return Verdict("wrong", None, seconds, "a motion where there is none")
    if off <= TIGHT * size(scene) and own < truth["lower"] * (1 - REACHED) - TIGHT * size(scene):
        return Verdict("wrong", None, seconds, f"DATA SET REFUTED: {own:.9g}, below {truth['lower']:.9g}")
    error = abs(own - least) / least if least else own / size(scene)
    if claim == "least" and own > least * (1 + NEAR) + MISS * size(scene):
        return Verdict("wrong", error, seconds, f"called least: {own:.9g}, where {least:.9g} will do")
    return _graded(error, own - least, seconds, f"{own:.9g}, where {least:.9g} will do")


def _graded(error: float, more: float, seconds: float | None, why: str) -> Verdict:
    for outcome, most in (("least", REACHED), ("near", NEAR)):
        if error <= most:
            return Verdict(outcome, error, seconds)
    return Verdict("larger" if more > 0 else "near", error, seconds, why)


# ----------------------------------------------------------------------------------------------------------- scores


def table(scenes: Sequence[Scene], verdicts: Mapping[str, Verdict]) -> list[list[str]]:
    """Return one row a class of scenes, and one of all: how many of each outcome, errors and times."""
    rows = []
    for kind in [*dict.fromkeys(scene["class"] for scene in scenes), "all"]:
        own = [verdicts[scene["name"]] for scene in scenes if kind in (scene["class"], "all")]
        errors = sorted(v.error for v in own if v.error is not None and v.outcome in OUTCOMES[:3])
        times = sorted(v.seconds for v in own if v.seconds is not None)
        counts = [str(sum(v.outcome == outcome for v in own)) for outcome in OUTCOMES]
        middle = f"{errors[len(errors) // 2]:.1e}" if errors else ""
        rows.append(
            [
                kind,
                str(len(own)),
                *counts,
                middle,
                f"{errors[-1]:.1e}" if errors else "",
                f"{times[len(times) // 2]:.2g}" if times else "",
                f"{sum(times):.3g}" if times else "",
            ]
        )
    return rows


HEAD = ("tool", "scenes", "of", *OUTCOMES, "median error", "largest error", "median s", "sum s")


def main(arguments: Sequence[str] | None = None) -> int:
    """Score the answers files; return 1 where one of them is silently wrong somewhere."""
    asked = argparse.ArgumentParser(description="Score answers to the data set.")
    asked.add_argument("answers", nargs="+", type=Path)
    asked.add_argument("--scenes", type=Path, default=Path(__file__).with_name("scenes.json"))
    asked.add_argument("--each", action="store_true", help="tell every scene that was not answered to 1e-6")
    given = asked.parse_args(arguments)
    scenes = json.loads(given.scenes.read_text(encoding="utf-8"))["scenes"]
    print(f"| {' | '.join(HEAD)} |", f"|{' --- |' * 2}{' ---: |' * (len(HEAD) - 2)}", sep="\n")
    wrong, told = 0, []
    for path in given.answers:
        try:
            said = json.loads(path.read_text(encoding="utf-8"))
            said = {"tool": str(said["tool"]), "answers": dict(said["answers"])}
        except (OSError, ValueError, KeyError, TypeError) as reason:
            asked.error(f"{path}: no answers as README.md describes them: {type(reason).__name__}: {reason}")
        verdicts = {scene["name"]: verdict(scene, said["answers"].get(scene["name"])) for scene in scenes}
        for row in table(scenes, verdicts):
            print(f"| {' | '.join([said['tool'], *row])} |")
        wrong += sum(own.outcome == "wrong" for own in verdicts.values())
        told += [
            f"- {said['tool']}, {name}: {own.outcome}; {own.why}"
            for name, own in verdicts.items()
            if own.outcome == "wrong" or (given.each and own.why)
        ]
    print(*["", *told][: len(told) + bool(told)], sep="\n")
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
