"""What an answer to a raw scene is worth: compared with its closed form, and with the raw solids after the motion."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from fcdm_opt_benchmarks.attack.raw_scenes import RawScene
from fcdm_opt_benchmarks.attack.raw_solids import depth_at_most, distance
from fcdm_opt_benchmarks.shapes import Array

RELATIVE = 1e-7


@dataclass(frozen=True)
class RawReply:
    """What the package answered, as plain data.

    `low` and `high` are between what its meshes leave the amount open; `poses` by part.
    """

    status: str
    usable: bool
    amount: float = np.nan
    bound: float = 0.0
    low: float = np.nan
    high: float = np.nan
    poses: Mapping[str, Array] = field(default_factory=dict)
    advice: str = ""
    seconds: float = 0.0


def raw_verdicts(scene: RawScene, answer: RawReply) -> list[tuple[str, str]]:
    """Return what is wrong with an answer: (one of `verdicts.FAILURES`, words); nothing where all is well."""
    if answer.status == "RAISED":
        return [("raised", answer.advice)]
    if not answer.usable:
        return _unusable(scene, answer)
    told = _placed(scene, answer)
    if scene.possible is False:
        told.append(("wrong motion", f"{answer.status}, and there is no motion to use"))
    if scene.least is not None:
        told += _compared(scene, answer, scene.least)
    return told


def _unusable(scene: RawScene, answer: RawReply) -> list[tuple[str, str]]:
    if not scene.possible:
        return [("right motion refused", answer.advice)] if answer.status == "NOT_VERIFIED" else []
    if scene.kept == "step" and answer.status != "NOT_VERIFIED" and answer.low != answer.high:
        return []  # its mesh leaves open whether the parts fit, and that is said
    words = f"{answer.status}, but {scene.least}: {answer.advice}"
    kinds = {"NOT_VERIFIED": "right motion refused", "INFEASIBLE": "impossibility refuted"}
    return [(kinds.get(answer.status, "not found"), words)]


def _compared(scene: RawScene, answer: RawReply, least: float) -> list[tuple[str, str]]:
    if scene.kept == "step" and np.isnan(answer.low):  # "what the mesh leaves open is not known", the answer says
        return [("left open by the mesh", f"{answer.amount:.9g}, is {least:.9g}")]
    slack, told = scene.slack + RELATIVE * least, []
    low, high = min(answer.low, answer.amount) - slack, max(answer.high, answer.amount) + slack
    if not low <= least <= high:
        kind = "not least" if low > least else "wrong amount"
        told.append((kind, f"{answer.amount:.9g} ({answer.low:.9g} to {answer.high:.9g}), is {least:.9g}"))
    claimed = answer.low if scene.kept == "step" else answer.bound  # a mesh's bound is of the mesh
    if claimed > least + slack:
        told.append(("bound refuted", f"bound {answer.bound:.9g}, is {least:.9g}"))
    return told


def _placed(scene: RawScene, answer: RawReply) -> list[tuple[str, str]]:
    """Return which solids overlap after the motion, and which are apart that are to touch."""
    poses = {part: answer.poses.get(part, np.eye(4)) for part in scene.made}
    placed = {part: own.moved(poses[part]) for part, own in scene.made.items()}
    placed |= {f"block {k}": own for k, own in enumerate(scene.keep_out)}
    still = {part for part in placed if part not in scene.steps}
    told, slack = [], 10.0 * scene.slack
    for one, two in itertools.combinations(placed, 2):
        if not {one, two} <= still and not depth_at_most(placed[one], placed[two], slack):
            told.append(("wrong motion", f"{one} and {two} overlap"))
    joined = list(itertools.pairwise(scene.made))[: len(scene.steps)] if scene.goal != "clear" else []
    for one, two in joined:
        apart = distance(placed[one], placed[two], 10.0)
        if apart > slack:
            told.append(("wrong motion", f"{one} and {two} are {apart:.3g} apart, should touch"))
    return told
