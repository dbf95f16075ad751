"""What a report says of one case: question, answer, proof, what was left out, and the frames to show.

And of sizes by name: what each measures as drawn and as made, and how the gap depends on all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.design.question import canonical, digest
from fcdm_opt.design.sizes import beyond_tolerances
from fcdm_opt.design.whatif.fitting import barred_text, quick_answer
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import deviation_of
from fcdm_opt.geometry.naming import faces_text
from fcdm_opt.geometry.size import Size, direction
from fcdm_opt.geometry.units import floored, measured, signed
from fcdm_opt.judge.certificate import verify
from fcdm_opt.plain import drawn, finite
from fcdm_opt.problem.active_parts import with_parts
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.evidence import Evidence
from fcdm_opt.problem.fit import drawn_bodies
from fcdm_opt.problem.problem import TRACKING, Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.problem.solution import Solution
from fcdm_opt.show import in_scheme, inline_svg, texts
from fcdm_opt.show.album import solution_pieces
from fcdm_opt.show.plots import tolerance_box, window
from fcdm_opt.show.remarks import GoodNews, not_considered, remarks
from fcdm_opt.show.report.families import FACTORS, motion_family, target_at, tolerance_family
from fcdm_opt.show.report.frames import Frames, scene
from fcdm_opt.show.scene import ScenePieces
from fcdm_opt.show.sections import Touching
from fcdm_opt.show.sensitivities import BY_NAME, HALF, WHOLE, Bar, bars
from fcdm_opt.show.solved import SolvedCase
from fcdm_opt.show.stacks import (
    BEYOND,
    another_decides,
    contributions_of,
    gap_figure,
    gap_per_unit,
    noise_of,
    stack_notes,
)
from fcdm_opt.show.texts import NONE, dimensions_text, number, shown
from fcdm_opt.show.verdict import fit_text, name_of, verdict_text
from fcdm_opt.tolerances import DEFAULT

STACKED = 4000  # part pairs, and rows of these, that a stack-up may look at: beside an answer
FEW = 4  # stack-ups of an assembly that are told one by one
SQUARED, SHARED = "Root sum square, ± 3 sigma", "99.73 % of pairs drawn"
PLACES = 6


def size_rows(scene: Scene) -> list[dict[str, Any]]:
    """Return the sizes of a scene: what each measures as drawn and as made, its tolerance, and what it moves.

    Of an axis where it is along the size's direction; what cannot be measured, a slot's place, has a deviation alone.
    """
    rows, made = [], {size: (scene.made or {}).get(size.name, 0.0) for size in scene.sizes}
    for size, off in made.items():
        body, ends = scene.drawn[size.body], size.tolerance
        noise = noise_of([body])
        if np.isnan(size.position(body)):
            drawn, now = (dimensions_text(x, noise) for x in (size.dimensions(body), scene.dimensions_at(size, {})))
        else:
            datum, scale = float(body.seed @ size.along), scene.scales_made[size.body]
            place, moved = (size.position(body, x) for x in ({}, made))
            drawn, now = (f"at {number(x, PLACES, noise)}" for x in (place, datum + scale * (moved - datum)))
        low, high = (NONE, NONE) if ends is None else (size.deviation_text(end, "") for end in ends)
        rows.append({
            "name": size.name, "body": body.name or size.body, "what": _moved(size, body), "low": low, "high": high,
            "drawn": drawn, "made": now, "off": size.deviation_text(off, "") * (off != 0.0),
            "beyond": size.is_beyond(off),
        })  # fmt: skip
    return rows


def _moved(size: Size, body: Body) -> str:
    """Return what a size moves, in words: "faces left, right by 0.5 each", "face F3 along +z", "scale along x"."""
    if size.scale is not None:
        return f"scale along {size.scale if isinstance(size.scale, str) else shown(size.scale)}"
    moved = size.offsets(body)
    if size.along is not None:
        return f"{faces_text(body, np.flatnonzero(moved).tolist())} along {direction(np.array(size.along))}"
    each = {
        share: faces_text(body, np.flatnonzero(moved == share).tolist()) for share in dict.fromkeys(size.each) if share
    }
    return ", ".join(f"{faces} by {share:g}{' each' * (', ' in faces)}" for share, faces in each.items())


def beyond_stack(scene: Scene) -> str:
    """Return which sizes made are outside of the tolerances that the stack-up is computed of; "" where none is."""
    return "".join(f"{text}; the stack-up holds within the tolerances" for text in beyond_tolerances(scene))


def stack_reports(assembly: Assembly, name: str = "stack") -> list[dict[str, Any]]:
    """Return the stack-up of each contact of goal "clear", of few; else the one that `stack_up` takes."""
    pairs = assembly.kept_clear if len(assembly.kept_clear) <= FEW else ()
    each = [stack_report(assembly, of=own, name=f"{name}-{k}") or {} for k, own in enumerate(pairs, 1)]
    opened = [own for own in each if any(share["worst"] for share in own.get("shares", ())) and not own["is_closed"]]
    return opened or [*filter(None, [stack_report(assembly, name=name)])]


def stack_report(scene: Scene, *, of: tuple[str, str] | None = None, name: str = "stack") -> dict[str, Any] | None:
    """Return what the gap at rest depends on, or why that is not told; None of a scene without sizes.

    Of an assembly it is the gap of two parts, see `stack_up`. Where root sum square goes beyond the worst case its
    limits are those of pairs drawn. `name` begins the identifiers of its chart.
    """
    from fcdm_opt.design.stack.stack_up import stack_up

    if not scene.sizes:
        return None
    try:
        with pacing.looking(STACKED):
            found = stack_up(scene, of=of)
            worst, spread = found.worst(), found.root_sum_square()
            noise, ends = noise_of(found.touching.bodies), [spread.low, spread.high]
            gaps = [0.0 if abs(x) <= noise else x for x in (worst.least, worst.largest)]
            shares, notes, what = contributions_of(found), [*stack_notes(found), *found.known_to], SQUARED
            drawn = found.yield_()
            if any(beyond := [not gaps[0] - noise <= x <= gaps[1] + noise for x in ends]):
                what = SHARED
                ends = [0.0 if abs(x) <= noise else x for x in (drawn.low, drawn.high)]
                beyond = [not gaps[0] - noise <= x <= gaps[1] + noise for x in ends]
            notes += filter(None, [another_decides(spread) * (what == SQUARED), BEYOND * any(beyond)])
            failed = ", ".join(own.name for own in verify(found).failed)
    except (InputError, pacing.TimeOverError) as reason:
        late = isinstance(reason, pacing.TimeOverError)
        why = "left out, it takes long: `fcdm-opt stack` has it" if late else getattr(reason, "what", "")
        if getattr(reason, "key", None) == "of":
            why += f"; `fcdm-opt stack` takes {getattr(reason, 'allowed', '')}"
        return {"unit": scene.unit, "notes": [f"no stack-up: {why}"]}
    if found.known_to:
        low, high = signed(worst.least_low), measured(signed(worst.largest_high), scene.unit)
        notes.append(f"worst cases of the true parts are from {low} to {high}")
    return {
        "unit": scene.unit,
        "of": " and ".join(found.parts),
        "between": "" if found.parts else found.deciding_contact,
        "is_closed": bool(found.standing) and gaps[0] > 0.0,  # at all sizes; all that they move stays apart
        "failed": f"NOT VERIFIED, do not use it: failed {failed}" * bool(failed),
        "worst": [
            {"what": what, "gap": gap, "at": [[name, x] for name, x in at.items() if x]}
            for what, gap, at in zip(("least", "largest"), gaps, (worst.at_least, worst.at_largest), strict=True)
        ],
        "spread": {"what": what, "ends": ends},
        "yield": {"what": "all but closed contacts" if found.is_outside_limits_when_closed
                  else "fit without a further motion" if found.parts else "clear without a motion",
                  "limits": drawn.limits_text, "share": f"{drawn.share:.4%}", "of": f"of {drawn.count:,} pairs drawn"}
                 if np.isfinite(found.limits).any() else None,
        "chart": inline_svg(gap_figure(found, drawn), name),
        "beyond": beyond,
        "shares": [finite({"size": own.size, "half": own.half, "coefficient": gap_per_unit(found, own),
                           "worst": own.worst, "variance": own.variance}) for own in shares],
        "notes": notes,
    }  # fmt: skip


UNREMARKABLE = ("SOLVED", "ALREADY_SATISFIED")  # statuses whose advice says no more than the answer
MOST_NAMED = 4  # data without a derivative that are named
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
        "left_out": not_considered(solution),
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
    solution = case.solution
    every = [text for text in remarks(solution) if text not in beyond_tolerances(problem)]
    noted = [text for text in every if not isinstance(text, GoodNews)]
    published = {"motion": problem.published_text, "amount": finite(case.published_amount)}
    units = {"translation": problem.unit or "length", "rotation": "rad"}
    shown = texts.parameter_texts(problem, solution.parameters)
    values = texts.telling(problem, list(solution.parameters.values()), texts.NOTHING)
    parameters = zip(problem.motion.parameters, values, shown, strict=False)  # none without a motion
    return {
        **{key: getattr(problem, key) for key in ("name", "unit", "goal")},
        "asked": texts.asked_text(problem),
        "wanted": texts.goal_text(problem),
        "limits": texts.limits_text(problem),
        "off_drawn": texts.sizes_text(problem),
        "extents": _extents(problem, solution),
        "fit": fit_text(problem),
        "beyond": beyond_stack(problem),
        "told": [*([] if solution.status.name in UNREMARKABLE else [texts.advised(case)]), *noted],
        "settled": [text for text in every if text not in noted],
        **answered(solution),
        **{
            key: finite(getattr(solution, key))
            for key in ("gap", "pair", "pair_gap", "rho", "active", "stage", "seconds")
        },
        "published": published if problem.published_text or problem.published is not None else None,
        "touch_amount": finite(case.touch_amount),
        "parameters": [
            {"name": name, "value": x, "unit": units[kind], "shown": text} for (name, kind), x, text in parameters
        ],
        "features": [feature.label for feature in solution.features],
        "sha256": digest(canonical(problem.to_dict())),
    }


def _extents(problem: Problem, solution: Solution) -> list[list[str]]:
    """Return of each part its name, its lengths along the axes as drawn and as made, and by which factors they grew."""
    rows = []
    made = problem.movable, problem.static
    for k, (body, drawn_body) in enumerate(zip(made, drawn_bodies(problem), strict=True)):
        was, now = np.ptp(drawn_body.vertices, axis=0), np.ptp(body.vertices, axis=0) * solution.pair[k]
        *lengths, factors = (" x ".join(f"{x:.6g}" for x in own.tolist()) for own in (was, now, now / was))
        alike = set(factors.split(" x "))
        rows.append([name_of(problem, k), *lengths, factors if len(alike) > 1 else alike.pop()])
    return rows


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
    return {"bound": finite(bound), "text": evidence.text, "checked": checked, "covers": covers if proof else "no"}


def _sensitivities(solution: Solution) -> dict[str, Any] | None:
    if not solution.usable:
        return None
    if solution.problem.partial:
        text = "left out: of parts with this many corners the derivatives take long, see `Solution.sensitivity`"
        return {"bars": [], "text": text, "most": None}
    derivatives = solution.sensitivity
    every = bars(derivatives, solution.problem)
    known, none = ([bar for bar in every if np.isfinite(bar.value) == good] for good in (True, False))
    sizes = [bar for bar in known if bar.note in (BY_NAME if solution.problem.sizes else WHOLE)]
    most = _most([bar for bar in sizes if bar.value], solution)
    text = "what a small change of each datum does to the least amount (first derivatives)"
    if not derivatives.exists:
        text = "the values hold to one side only, or for one of several motions that are as small" * bool(known)
        text = f"{text or 'no derivatives'}: {'; '.join(derivatives.reasons)}"
    elif not known:
        text = "nothing nearby changes the amount"
    if none:
        names = texts.listed([bar.name for bar in none]) if len(none) <= MOST_NAMED else f"{len(none)} data"
        text += f"; no derivative by {names}"
    return {"bars": [finite(bar._asdict()) for bar in known], "text": text, "most": most}


def _most(sizes: Sequence[Bar], solution: Solution) -> dict[str, Any] | None:
    """Return the bar of the size that changes the amount most, with what its step does where that can be solved.

    One with a tolerance goes as far as half of it, within it, and is told by its deviation then. Where there is no
    motion to use then, how that ends. Else to first order, "about", and no further than an amount of 0: another contact
    may take over before.
    """
    if not sizes:
        return None
    most, problem = max(sizes, key=lambda bar: abs(bar.value)), solution.problem
    named = {f"{own.name} of {name_of(problem, own.body == 'static')}": own for own in problem.sizes}
    size, made, stepped = named.get(most.name) if most.note == HALF else None, problem.made or {}, None
    if size is not None and size.tolerance is not None:
        off = made.get(size.name, 0.0)
        ends = np.clip([off + size.half, off - size.half], *size.tolerance).tolist()
        there = max(ends, key=lambda end: round(abs(end - off) / size.half, texts.DIGITS))
        stepped = quick_answer(problem, made={**made, size.name: there})
        label, as_made = (size.deviation_text(x, problem.unit) for x in (there, off))
        label = f"at {label}" + f" in place of {as_made}" * bool(off)
        most = most._replace(unit=label, value=most.value * (there - off) / size.half)
    if stepped and not (stepped.usable or stepped.stopped):
        return {**finite(most._asdict()), "value": None, "about": False, "outcome": barred_text(stepped)}
    known = bool(stepped and stepped.usable)
    value = stepped.amount - solution.amount if stepped and known else max(most.value, -solution.amount)
    return {**finite(most._asdict()), "value": finite(value), "about": not known, "outcome": ""}


def _pictures(problem: Problem, solution: Solution, share: float, pieces: ScenePieces) -> dict[str, Any]:
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
    if solution.usable:
        corrected = frames.solved(solution, "the parts made, after the motion")
        if solution.rho is not None and (abs(solution.rho / solution.pair - 1.0) > DEFAULT.requirement).any():
            more = {key: corrected[key] for key in ("motion", "parameters")}
            note = "at the scales of the tracked contact, after the motion"
            at = solution.rho, solution.transform, solution.rho
            tracked = frames.frame(*at, target=solution.pair, amount=solution.amount, note=note, **more)
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
