"""What an answer is worth: compared with the oracles' motions and with what the scene asks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fcdm_opt_benchmarks.attack.least import KnownMotion
from fcdm_opt_benchmarks.attack.lines import reached
from fcdm_opt_benchmarks.attack.scenes import FitScene
from fcdm_opt_benchmarks.shapes import Array

SNAP = 1e-6  # how far sizes may be from those asked, relative
PROVED = 0.01  # what is proved for one and two parameters
DONE = ("SOLVED", "ALREADY_SATISFIED", "PAIR_OVERLAPS")
REFUSED = "NOT_VERIFIED"
NONE = ("INFEASIBLE", "NOT_FOUND", "LEFT_COHERENT_RANGE", "NOT_IN_STEPS")

FAILURES = (
    "raised",
    "wrong sizes",
    "wrong pose",
    "wrong amount",
    "wrong motion",
    "wrong state",
    "not least",
    "bound refuted",
    "right motion refused",
    "wrong motion refused",
    "impossibility refuted",
    "not found",
    "oracle failed",
)
NOTES = (
    "refused, not judged",
    "weak bound",
    "smaller known",
    "not found by search",
    "outside the fit",
    "nothing to compare",
    "left open by the mesh",
)


@dataclass(frozen=True)
class Reply:
    """What the package answered, as plain data.

    Attributes
    ----------
    status : str
    q : (k,) array or None
    amount, bound : float
    transform : (4, 4) array or None
    target, pair : (2,) arrays
        Sizes that the question, and that the answer speaks of.
    gap : float
        Of the pair made after the motion, as told.
    advice : str
        Words of the status, or of what was raised.
    seconds : float
    """

    status: str
    q: Array | None
    amount: float
    bound: float
    transform: Array | None
    target: Array | None
    pair: Array | None
    gap: float
    advice: str = ""
    seconds: float = 0.0


def verdicts(scene: FitScene, answer: Reply, found: KnownMotion | None) -> list[tuple[str, str]]:
    """Return what is wrong with an answer, and notes: (one of FAILURES or NOTES, words); nothing where all is well."""
    if answer.status == "RAISED":
        return [("raised", answer.advice)]
    told = _sizes(scene, answer)
    if answer.q is None or answer.status in NONE:
        told += _nothing(scene, answer, found)
    else:
        faults = _motion(scene, answer)
        told += faults
        if answer.status == REFUSED:
            wrong = any(kind == "wrong motion" for kind, _ in faults)
            told = [item for item in told if item[0] != "wrong motion"]
            kind = "wrong motion refused" if wrong else "right motion refused"
            told.append(("refused, not judged" if scene.goal is None else kind, answer.advice))
        elif answer.status not in DONE:
            told.append(("outside the fit", answer.status))
        told += _amount(scene, answer, found)
    return told + _bound(scene, answer, found)


def _sizes(scene: FitScene, answer: Reply) -> list[tuple[str, str]]:
    told = []
    for what, pair in (("problem.target", answer.target), ("solution.pair", answer.pair)):
        if pair is None or not np.allclose(pair, scene.target, rtol=1.01 * SNAP, atol=0):
            told.append(("wrong sizes", f"{what} {pair}, asked {scene.target.tolist()}"))
    return told


def _motion(scene: FitScene, answer: Reply) -> list[tuple[str, str]]:
    """Return what the motion itself does not meet."""
    assert answer.q is not None
    setting, told = scene.setting, []
    R, t = setting.poses(answer.q)
    far = 1.0 + float(np.abs(setting.corners).max())
    T = np.full((4, 4), np.nan) if answer.transform is None else answer.transform
    if not (np.allclose(T[:3, :3], R[0], atol=1e-9) and np.allclose(T[:3, 3], t[0], atol=1e-9 * far)):
        told.append(("wrong pose", "the transform is not that of the parameters"))
    own = setting.amount(answer.q)
    if not abs(own - answer.amount) <= 1e-8 * (own + 1e-3 * setting.size):
        told.append(("wrong amount", f"{answer.amount!r}, of the parameters {own!r}"))
    gap = setting.gap(answer.q)
    if abs(gap) > 1e-6 * setting.size and np.sign(gap) != np.sign(answer.gap):
        told.append(("wrong state", f"told gap {answer.gap:.6g}, is {gap:.6g}"))
    if scene.goal in ("touch", "clear") or (scene.goal in ("at", "seat") and answer.status != "PAIR_OVERLAPS"):
        told += [("wrong motion", fault) for fault in setting.faults(answer.q)]
    elif scene.pair == "clear" and gap < -setting.slack:
        told.append(("wrong motion", f"the pair overlaps by {-gap:.3g}"))
    elif answer.status == "SOLVED" and gap < -1e-6 * setting.size:
        told.append(("wrong state", f"SOLVED, and the pair made overlaps by {-gap:.3g}"))
    if scene.tracked is not None and scene.goal in ("at", "beyond"):
        x, real = scene.tracked.real(R, t)
        signs = np.sign(scene.target - scene.tracked.rho)
        close = reached(scene.goal, np.where(np.abs(x - scene.target) < 1e-7, scene.target, x), scene.target, signs)
        if not (close[0] and real[0]):
            told.append(("wrong motion", f"the tracked point ends at {x[0].tolist()}, real {bool(real[0])}"))
    return told


def _exactness(scene: FitScene, found: KnownMotion) -> float:
    return 1e-6 if found.exact or scene.count == 1 else PROVED * 1.01


def _amount(scene: FitScene, answer: Reply, found: KnownMotion | None) -> list[tuple[str, str]]:
    """Return whether the amount is larger than it may be."""
    if found is None:
        return [("nothing to compare", "no motion known to the oracle")]
    told, tolerance = [], 1e-7 * scene.setting.size
    words = f"{answer.amount:.8g}, bound {answer.bound:.8g}, but {found.amount:.8g} at {found.q.round(9).tolist()}"
    if answer.amount > found.amount * (1 + _exactness(scene, found)) + tolerance:
        told.append(("not least" if scene.count <= 2 or found.exact else "smaller known", words))
    if scene.count <= 2 and answer.bound < answer.amount * (1 - 1.01 * PROVED) - tolerance:
        told.append(("weak bound", f"{answer.bound:.8g} of {answer.amount:.8g}"))
    return told


def _bound(scene: FitScene, answer: Reply, found: KnownMotion | None) -> list[tuple[str, str]]:
    if found is None or not answer.bound > found.amount * (1 + 1e-8) + 1e-8 * scene.setting.size:
        return []
    if answer.status == "INFEASIBLE":
        return []  # told already
    return [("bound refuted", f"bound {answer.bound:.8g}, but {found.amount:.8g} at {found.q.round(9).tolist()}")]


def _nothing(scene: FitScene, answer: Reply, found: KnownMotion | None) -> list[tuple[str, str]]:
    if found is None:
        return []
    words = f"{answer.status}, but {found.amount:.8g} at {found.q.round(9).tolist()}"
    if answer.status == "INFEASIBLE":
        return [("impossibility refuted", words)]
    if answer.status in NONE:
        return [("not found" if scene.count <= 2 else "not found by search", words)]
    return [("outside the fit", words)]


def failed(told: list[tuple[str, Any]]) -> bool:
    """Tell whether anything is wrong."""
    return any(kind in FAILURES for kind, _ in told)
