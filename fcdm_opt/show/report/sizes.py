"""What a report says of sizes by name: what each measures as drawn and as made, and how the gap depends on all."""

from __future__ import annotations

from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.design.sizes import beyond_tolerances
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import measured, signed
from fcdm_opt.plain import finite
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.scene import Scene
from fcdm_opt.show import inline_svg
from fcdm_opt.show.stacks import (
    BEYOND,
    another_decides,
    contributions_of,
    gap_figure,
    gap_per_unit,
    noise_of,
    stack_notes,
)
from fcdm_opt.show.texts import NONE, listed, number, shown

STACKED = 4000  # part pairs, and rows of these, that a stack-up may look at: beside an answer
FEW = 4  # stack-ups of an assembly that are told one by one
SQUARED, SHARED = "Root sum square, ± 3 sigma", "99.73 % of pairs drawn"
PLACES = 6


def size_rows(scene: Scene) -> list[dict[str, Any]]:
    """Return the sizes of a scene: what each measures as drawn and as made, its tolerance, and what it moves.

    Of an axis where it is along the size's direction; what cannot be measured, a slot's place, has a deviation alone.
    """
    rows = []
    for size in scene.sizes:
        body, off, ends = scene.drawn[size.body], (scene.made or {}).get(size.name, 0.0), size.tolerance
        drawn, place = size.drawn(body), size.position(body)
        at, drawn = ("", drawn) if np.isnan(place) else ("at ", place)
        noise = noise_of([body])
        made = drawn + off * (1.0 if size.is_length else drawn)
        low, high = (NONE, NONE) if ends is None else (size.deviation_text(end, "") for end in ends)
        rows.append({
            "name": size.name, "body": body.name or size.body, "what": _moved(size), "low": low, "high": high,
            "drawn": NONE if np.isnan(drawn) else f"{at}{number(drawn, PLACES, noise)}",
            "made": NONE if np.isnan(made) else f"{at}{number(made, PLACES, noise)}",
            "off": size.deviation_text(off, "") if off else "", "beyond": size.is_beyond(off),
        })  # fmt: skip
    return rows


def _moved(size: Size) -> str:
    """Return what a size moves, in words: "+x by 0.5, -x by 0.5", "F3 along +z", "scale along x"."""
    if size.scale is not None:
        return f"scale along {size.scale if isinstance(size.scale, str) else shown(size.scale)}"
    alike = size.along is not None or len(set(size.each)) == 1
    points = [f"({shown(each['through'])})" for each in size.faces if not isinstance(each, str) and "through" in each]
    faces = [each if isinstance(each, str) else f"the face through ({shown(each['through'])})" if "through" in each
             else f"around ({shown(each['around'])})" for each in size.faces]  # fmt: skip
    if alike and len(points) == len(faces) > 1:
        faces = [f"the faces through {points[0]}", *points[1:]]
    if size.along is not None:
        way = size.along if isinstance(size.along, str) else f"({shown(size.along)})"
        return f"{listed(faces)} along {way}"
    if alike:
        return f"{listed(faces)} by {size.each[0]:g}{' each' * (len(faces) > 1)}"
    return ", ".join(f"{face} by {share:g}" for face, share in zip(faces, size.each, strict=True))


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
    from fcdm_opt.judge.certificate import verify

    if not scene.sizes:
        return None
    try:
        with pacing.looking(STACKED):
            found = stack_up(scene, of=of)  # type: ignore[arg-type]
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
        "is_closed": bool(found.standing) and gaps[0] > 0.0,  # at all sizes; all that they move stays apart
        "failed": f"NOT VERIFIED, do not use it: failed {failed}" * bool(failed),
        "worst": [
            {"what": what, "gap": gap, "at": [[name, x] for name, x in at.items() if x]}
            for what, gap, at in zip(("least", "largest"), gaps, (worst.at_least, worst.at_largest), strict=True)
        ],
        "spread": {"what": what, "ends": ends},
        "yield": {"what": f"fit without a {'further ' * isinstance(scene, Assembly)}motion",
                  "limits": drawn.limits_text, "share": f"{drawn.share:.4%}", "of": f"of {drawn.count:,} pairs drawn"}
                 if np.isfinite(found.limits).any() else None,
        "chart": inline_svg(gap_figure(found, drawn), name),
        "beyond": beyond,
        "shares": [finite({"size": own.size, "half": own.half, "coefficient": gap_per_unit(found, own),
                           "worst": own.worst, "variance": own.variance}) for own in shares],
        "notes": notes,
    }  # fmt: skip
