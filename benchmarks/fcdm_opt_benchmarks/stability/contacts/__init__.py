"""One contact: whether two solids of given scales touch, how far they are apart, and at which scale they would touch.

The families of hard inputs are those of the project's list of hard cases: `libraries` for what libraries are known to
get wrong, `geometry` for degenerate shapes and places. The right answers come from rational arithmetic (`truth`). The
methods answer what they can (`methods`); see there for what an answer holds.

What is wrong: every answer that is given is judged; a method that gives none, or raises, is flagged. Numbers that stand
for "no answer" (nan, 1.8e308) without an error or a status are answers.

state
    A claim of the sign: wrong where it is not the exact one, however small the opening. (Only of bodies with corners
    nearer to each other than `Tolerances.planarity`, which count as one, it is not asked within that length.)
gap, meets, overlaps
    The sign of a number in floats, or a yes or no: as exact, except that bodies which are open, or deep in each other,
    by no more than `ROUNDING` of the larger one may be said to be either, where the number is no more than that. So the
    side of a millionth is asked of everybody, that of a rounding only of those who claim it.
    A gap must be right to `WRONG_BEYOND` too, relative to the smaller body or to itself, whichever is larger.
rho2
    Wrong beyond `WRONG_BEYOND` of it; none where there is one, and one where there is none, is wrong.
normal
    Asked where the bodies touch to `WRONG_BEYOND` of the smaller: along it they must not overlap by more than that.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fcdm_opt_benchmarks.stability.case import WRONG_BEYOND, Grade, HardCase
from fcdm_opt_benchmarks.stability.contacts import geometry, libraries
from fcdm_opt_benchmarks.stability.contacts.methods import LARGEST, METHODS, OURS, PROGRAMS
from fcdm_opt_benchmarks.stability.contacts.scenes import HardPair
from fcdm_opt_benchmarks.stability.contacts.truth import contact_scales, truth_of

__all__ = ["METHODS", "OURS", "applies", "cases", "geometry", "judged", "libraries"]

ROUNDING = 1e-12  # of the larger body: what a method that works in floats need not tell from touch
QUICK = 8  # one scene in so many
FAMILIES = {**libraries.FAMILIES, **geometry.FAMILIES}


def cases(quick: bool, seed: int) -> list[HardCase]:
    """Return the cases of all families; the quick ones are about an eighth of them, of every family some."""
    made = []
    for k, (family, scenes) in enumerate(FAMILIES.items()):
        found = scenes(np.random.default_rng([seed, k]))
        if quick:
            light = [scene for scene in found if not scene.heavy]
            # a fixed draw: every so many-th would always meet the same opening
            chosen = np.random.default_rng(k).permutation(len(light))[: -(-len(found) // QUICK)]
            found = [light[place] for place in sorted(chosen.tolist())]
        made += [_case(family, scene) for scene in found]
    return made


def _case(family: str, scene: HardPair) -> HardCase:
    data: dict[str, Any] = {
        "one": scene.one,
        "two": scene.two,
        "transform": np.asarray(scene.transform).tolist(),
        "rho": [float(x) for x in scene.rho],
        "box": [[float(x) for x in span] for span in scene.box],
    }
    if scene.opening is not None:
        touching = contact_scales(data, data["rho"][0])
        if touching:
            y = touching[0]
            data["rho"][1] = int(y.p) / int(y.q) * (1.0 - scene.opening)
    return HardCase(family, scene.name, "contact", data, {**truth_of(data), "blur": scene.blur})


def applies(name: str, case: HardCase) -> bool:
    """Whether a method takes such bodies at all."""
    bodies = case.data["one"], case.data["two"]
    if name in PROGRAMS:
        few = sum(len(body["vertices"]) for body in bodies) <= LARGEST
        return few and not any(body["parts"] for body in bodies)
    return True


def judged(case: HardCase, answer: dict[str, Any]) -> Grade:
    """Return what an answer is worth, by the rules above."""
    if "flag" in answer:
        return Grade("flagged", reason=str(answer["flag"]))
    truth = case.truth
    checks = [_state(truth, answer), _gap(truth, answer), _scale(truth, answer), _normal(case, answer)]
    errors = [error for error, _ in checks if error is not None]
    wrong = [reason for _, reason in checks if reason]
    return Grade("wrong" if wrong else "right", max(errors, default=None), "; ".join(wrong))


Check = tuple[float | None, str]  # a relative error, where there is a number, and what is wrong


def _state(truth: Any, answer: dict[str, Any]) -> Check:
    """Judge everything that says apart, touching or overlapping."""
    side, opening = truth["side"], truth["opening"]
    if "state" in answer and not 0 < abs(opening) <= truth["blur"]:
        state = answer["state"]
        right = state == side if side is not None else (state <= 0) == truth["meets"]
        if not right:
            return None, f"state {state}, true opening {opening:g}"
    tiny = max(ROUNDING * truth["sizes"][1], truth["blur"])
    if abs(opening) <= tiny and side is not None:
        if "gap" in answer and "state" not in answer and not abs(answer["gap"]) <= tiny:
            return None, f"gap {answer['gap']:g}, true opening {opening:g}"
        return None, ""
    if "meets" in answer and answer["meets"] != truth["meets"]:
        return None, f"meets: {answer['meets']}, true opening {opening:g}"
    if side is not None and "overlaps" in answer and answer["overlaps"] != (side < 0):
        return None, f"overlaps: {answer['overlaps']}, true opening {opening:g}"
    if "gap" in answer and "state" not in answer:
        gap = answer["gap"]
        right = np.sign(gap) == side if side is not None else (gap <= tiny) == truth["meets"]
        if not right:
            return None, f"gap {gap:g}, true opening {opening:g}"
    return None, ""


def _gap(truth: Any, answer: dict[str, Any]) -> Check:
    """Judge the value of the signed distance."""
    if "gap" not in answer:
        return None, ""
    gap = answer["gap"]
    if not abs(gap) < np.inf:
        return None, f"gap {gap}"
    if truth["distance"] is not None:
        true = float(truth["distance"])
    elif truth["depth"] is not None:
        true = -float(truth["depth"])
    elif truth["side"] == 0:
        true = 0.0
    else:
        return None, ""
    error = abs(gap - true) / max(truth["sizes"][0], abs(true))
    return error, f"gap {gap:.9g}, true {true:.9g}" if error > WRONG_BEYOND else ""


def _scale(truth: Any, answer: dict[str, Any]) -> Check:
    """Judge the contact scale."""
    if "rho2" not in answer or not truth["rho2_asked"]:
        return None, ""
    found, true = answer["rho2"], truth["rho2"]
    if found is None or true is None:
        return None, "" if found is true else f"contact scale {found}, true {true}"
    error = abs(found - float(true)) / float(true)
    return error, f"contact scale {found:.9g}, true {true:.12}" if not error <= WRONG_BEYOND else ""


def _normal(case: HardCase, answer: dict[str, Any]) -> Check:
    """Judge the direction of a contact: what is open or closed along it."""
    truth, data = case.truth, case.data
    small = truth["sizes"][0]
    unions = data["one"]["parts"] or data["two"]["parts"]
    if "normal" not in answer or unions or truth["side"] is None or abs(truth["opening"]) > WRONG_BEYOND * small:
        return None, ""
    n, T = np.array(answer["normal"], dtype=np.float64), np.array(data["transform"])
    length = float(np.linalg.norm(n))
    if not 0 < length < np.inf:
        return None, f"normal {answer['normal']}"
    (P, s), (Q, e) = ((np.array(data[key]["vertices"]), np.array(data[key]["seed"])) for key in ("one", "two"))
    n /= length
    own = T[:3, :3].T @ n
    across = n @ (e - (T[:3, :3] @ s + T[:3, 3]))
    open_by = across - data["rho"][0] * ((P - s) @ own).max() + data["rho"][1] * ((Q - e) @ n).min()
    error = max(0.0, min(truth["opening"], 0.0) - float(open_by)) / small
    return error, f"normal {np.round(n, 6).tolist()}: they overlap by {-open_by:g}" if error > WRONG_BEYOND else ""
