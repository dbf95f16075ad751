"""What a report says of one case: question, answer, proof, what was left out, and the frames to show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.design.question import canonical, digest
from fcdm_opt.design.sizes import beyond_tolerances
from fcdm_opt.design.whatif.fitting import usable_answer
from fcdm_opt.geometry.facet_errors import deviation_of
from fcdm_opt.geometry.units import floored, measured
from fcdm_opt.plain import drawn, finite
from fcdm_opt.problem.active_parts import with_parts
from fcdm_opt.problem.evidence import Evidence
from fcdm_opt.problem.fit import drawn_bodies
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.show import in_scheme, inline_svg, texts
from fcdm_opt.show.album import solution_pieces
from fcdm_opt.show.plots import tolerance_box, window
from fcdm_opt.show.remarks import GoodNews, left_out, remarks
from fcdm_opt.show.report.families import FACTORS, motion_family, target_at, tolerance_family
from fcdm_opt.show.report.frames import Frames, scene
from fcdm_opt.show.report.sizes import beyond_stack, size_rows, stack_report
from fcdm_opt.show.scene import ScenePieces
from fcdm_opt.show.sections import Touching
from fcdm_opt.show.sensitivities import BY_NAME, HALF, WHOLE, Bar, bars
from fcdm_opt.show.solved import SolvedCase
from fcdm_opt.show.verdict import barred_text, fit_text, name_of, refusal_text, verdict_text
from fcdm_opt.tolerances import DEFAULT

UNREMARKABLE = ("SOLVED", "ALREADY_SATISFIED")  # statuses whose advice says no more than the answer
MOST_TOLD = 4  # data without a derivative that are named
ANSWERED = (
    "status", "outside", "motion", "verdict", "outcome", "amount_unit", "least", "amount", "lower_bound",
    "doubt", "pair_state", "usable",
)  # fmt: skip
"""Keys of what a case, and a cell of the table of requirements, says of an answer."""


def case_report(problem: Problem, case: SolvedCase, *, name: str, frames: float) -> dict[str, Any]:
    """Return the data of one case, whose two families have this share of their `frames`; < 0 for one each.

    `problem` is as asked; that of the solution names the features that were chosen. `name` begins the identifiers of
    its pictures.
    """
    solution = case.solution
    grounds = {
        "bodies": _bodies(solution.problem),
        "left_out": left_out(solution),
        "certificate": finite(solution.certificate),
        "evidence": _evidence(solution),
        "sensitivities": _sensitivities(solution),
    }
    pieces = solution_pieces(solution)
    picture = picture_of(pieces, name)
    grounds |= {"sizes": size_rows(problem), "stack": stack_report(problem, name=f"{name}-stack")}
    return {**_answer(problem, case), "picture": picture, **grounds, **_pictures(problem, solution, frames, pieces)}


def picture_of(pieces: ScenePieces, name: str) -> dict[str, Any]:
    """Return what a page shows of a scene in pieces; `name` begins the identifiers in it."""
    scene_, *insets = (inline_svg(own, f"{name}-{k}") for k, own in enumerate((pieces.scene, *pieces.insets)))
    key = [[mark, in_scheme(colour), text] for mark, colour, text in pieces.key]
    return {"scene": scene_, "insets": insets, "key": key, "high": round(pieces.scene.get_figheight(), 2)}


def answered(solution: Solution) -> dict[str, Any]:
    """Return what a case, and a cell of the table of requirements, says of an answer; its bound, and how near it is."""
    text, _, near = texts.bound_text(solution).partition("\n")  # the page adds the unit
    verdict = verdict_text(solution)
    return {
        "status": solution.status.name,
        "outside": texts.outcome_text(solution) * (solution.status.name == "OUTSIDE_FIT"),
        "motion": texts.motion_text(solution) if texts.seen_amount(solution) != 0.0 else "none",
        "verdict": verdict,
        "outcome": barred_text(solution),
        "amount_unit": solution.problem.amount_unit,
        "least": {"text": texts.shown(solution.amount) if near == "exact" else text, "near": near},
        **{key: finite(getattr(solution, key)) for key in ("amount", "lower_bound", "doubt", "pair_state", "usable")},
    }


def _answer(problem: Problem, case: SolvedCase) -> dict[str, Any]:
    """Return question and answer."""
    solution = case.solution
    every = [text for text in remarks(solution) if text not in beyond_tolerances(problem)]
    said = [text for text in every if not isinstance(text, GoodNews)]
    published = {"motion": problem.published_text, "amount": finite(case.published_amount)}
    units = {"translation": problem.unit or "length", "rotation": "rad"}
    shown = texts.parameter_texts(problem, solution.parameters)
    values = texts.telling(problem, list(solution.parameters.values()), texts.NOTHING)
    told = zip(problem.motion.parameters, values, shown, strict=False)  # none without a motion
    return {
        **{key: getattr(problem, key) for key in ("name", "unit", "goal")},
        "asked": texts.asked_text(problem),
        "wanted": texts.goal_text(problem),
        "off_drawn": texts.sizes_text(problem),
        "extents": _extents(problem, solution),
        "fit": fit_text(problem),
        "beyond": beyond_stack(problem),
        "told": [*([] if solution.status.name in UNREMARKABLE else [texts.advised(case)]), *said],
        "settled": [text for text in every if text not in said],
        **answered(solution),
        **{
            key: finite(getattr(solution, key))
            for key in ("gap", "pair", "pair_gap", "rho", "active", "stage", "seconds")
        },
        "published": published if problem.published_text or problem.published is not None else None,
        "touch_amount": finite(case.touch_amount),
        "parameters": [
            {"name": name, "value": x, "unit": units[kind], "shown": text} for (name, kind), x, text in told
        ],
        "features": [feature.label for feature in solution.features],
        "sha256": digest(canonical(problem.to_dict())),
    }


def _extents(problem: Problem, solution: Solution) -> list[list[str]]:
    """Return of each part its name, its lengths along the axes as drawn and as made, and by which factors they grew."""
    told = []
    made = problem.movable, problem.static
    for k, (body, drawn_body) in enumerate(zip(made, drawn_bodies(problem), strict=True)):
        was, now = np.ptp(drawn_body.vertices, axis=0), np.ptp(body.vertices, axis=0) * solution.pair[k]
        *lengths, factors = (" x ".join(f"{x:.6g}" for x in own.tolist()) for own in (was, now, now / was))
        alike = set(factors.split(" x "))
        told.append([name_of(problem, k), *lengths, factors if len(alike) > 1 else alike.pop()])
    return told


def _bodies(problem: Problem) -> list[dict[str, Any]]:
    listed = [("movable", problem.movable, ""), ("static", problem.static, "")]
    for keep_out in problem.keep_out:
        scale = " to ".join(f"{end:g}" for end in dict.fromkeys(keep_out.ends))
        clear = measured(f"{keep_out.clearance:g}", problem.unit)
        listed.append(("keep-out", keep_out.body, f"scale {scale}, clearance {clear}"))
    return [
        {
            "name": body.name,
            "role": role,
            "vertices": len(body.corners),
            "parts": len(body.parts),
            "seed": finite(np.where(np.abs(body.seed) <= DEFAULT.weld * body.size, 0.0, body.seed)),
            "notes": [note for note in (first, *body.notes) if note],
            "deviation": finite(deviation_of(body)),
        }
        for role, body, first in listed
    ]


def _evidence(solution: Solution) -> dict[str, Any] | None:
    """Return what the proof is made of, whether the judge passed it, and what that covers."""
    if solution.evidence is None:
        return None
    evidence, certificate = solution.evidence, solution.certificate
    proof = [own.passed for own in (certificate.checks if certificate else ()) if own.name.startswith("proof")]
    bound = evidence.bound if isinstance(evidence, Evidence) else solution.lower_bound
    checked, covers = all(proof) if proof else None, "yes, by separate code"
    if checked and not solution.status.found:
        least = measured(floored(bound, texts.DIGITS), solution.problem.amount_unit) if np.isfinite(bound) else ""
        covers += f": no motion of up to {least} does" if least else ": no motion at all does"
        if least and solution.status.name == "INFEASIBLE":
            checked, covers = None, f"{covers}; that none at all does is shown by a closed form"
    return {"bound": finite(bound), "text": evidence.told, "checked": checked, "covers": covers if proof else "no"}


def _sensitivities(solution: Solution) -> dict[str, Any] | None:
    if not solution.usable:
        return None
    if solution.problem.partial:
        text = "left out: of parts with this many corners the derivatives take long, see `Solution.sensitivity`"
        return {"bars": [], "text": text, "most": None}
    derivatives = solution.sensitivity
    every = bars(derivatives, solution.problem)
    known, none = ([bar for bar in every if np.isfinite(bar.value) == good] for good in (True, False))
    sizes = [bar for bar in known if bar.note in BY_NAME] or [bar for bar in known if bar.note in WHOLE]
    most = _most([bar for bar in sizes if bar.value], solution)
    text = "what a small change of each datum does to the least amount (first derivatives)"
    if not derivatives.exists:
        text = "the values hold to one side only, or for one of several motions that are as small" * bool(known)
        text = f"{text or 'no derivatives'}: {'; '.join(derivatives.reasons)}"
    elif not known:
        text = "nothing nearby changes the amount"
    if none:
        names = texts.listed([bar.name for bar in none]) if len(none) <= MOST_TOLD else f"{len(none)} data"
        text += f"; no derivative by {names}"
    return {"bars": [finite(bar._asdict()) for bar in known], "text": text, "most": most}


def _most(sizes: Sequence[Bar], solution: Solution) -> dict[str, Any] | None:
    """Return the bar of the size that changes the amount most, with what its step does where that can be solved.

    Else to first order, "about", and no further than an amount of 0: another contact may take over before.
    """
    if not sizes:
        return None
    most, problem = max(sizes, key=lambda bar: abs(bar.value)), solution.problem
    named = {f"{own.name} of {name_of(problem, own.body == 'static')}": own for own in problem.sizes}
    size, made = named.get(most.name) if most.note == HALF else None, problem.made or {}
    stepped = size and usable_answer(problem, made={**made, size.name: made.get(size.name, 0.0) + size.half})
    value = stepped.amount - solution.amount if stepped else max(most.value, -solution.amount)
    return {**finite(most._asdict()), "value": finite(value), "about": not stepped}


def _pictures(problem: Problem, solution: Solution, share: float, pieces: ScenePieces) -> dict[str, Any]:
    """Return the bodies and all frames."""
    problem = problem if solution.problem.exact_at is None else solution.problem.reformulated
    far = [target for target in (target_at(problem, factor) for factor in (0.0, FACTORS[-1])) if target.min() > 0]
    seen = window(problem, solution, far)
    frames = Frames(problem, seen)
    poses = _poses(frames, problem, solution)
    motion = motion_family(frames, solution, share)
    taken = with_parts(problem, solution.problem.active_indices)  # other sizes take most of these too
    tolerance = tolerance_family(frames, taken, solution, share)
    low, high = tolerance_box(problem)
    return {
        "scene": scene(problem, pieces),
        "axes": {"box": drawn(problem.box), "window": drawn(seen)},
        "nominal": drawn(problem.nominal_pair),
        "tolerance_box": drawn(list(zip(low, high, strict=True))) if problem.tolerance is not None else None,
        "signs": finite(problem.signs) if problem.signs.any() else None,
        "quadrant": problem.goal == "beyond",
        "tracking": problem.goal in TRACKING,
        "poses": poses,
        "tracked_shapes": frames.shapes_of(solution.features),
        "families": {"tolerance": tolerance, "motion": motion},
        "feature_shapes": frames.shapes,
        "labels": frames.labels,
    }


def _poses(frames: Frames, problem: Problem, solution: Solution) -> dict[str, Any]:
    corrected = tracked = None
    if solution.transform is not None and not refusal_text(solution):
        corrected = frames.solved(solution, "the parts made, after the motion")
        if solution.rho is not None and (abs(solution.rho / solution.pair - 1.0) > DEFAULT.requirement).any():
            told = {key: corrected[key] for key in ("motion", "parameters")}
            note = "at the scales of the tracked contact, after the motion"
            at = solution.rho, solution.transform, solution.rho
            tracked = frames.frame(*at, target=solution.pair, amount=solution.amount, note=note, **told)
    made = problem.movable.scaled(problem.target[0]), problem.static.scaled(problem.target[1])
    overlap = pacing.in_time(Touching.overlap, *made, late=None)
    known = {} if corrected else {"amount": None, "status": texts.outcome_text(solution)}
    why = "" if corrected else f": {verdict_text(solution)}"
    return {
        "nominal": frames.frame(problem.nominal_pair, note="nominal sizes, no motion"),
        "rescaled": {
            **frames.frame(problem.target, note=f"the parts made, no motion{why}"),
            **known,
            "overlap": drawn([] if overlap is None else np.concatenate(overlap.pieces)),
        },
        "corrected": corrected,
        "tracked": tracked,
    }
