"""What the command line prints: tables of curves, solutions and ranges, of what-ifs, yields and poses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from time import perf_counter
from typing import TYPE_CHECKING, Any

from fcdm_opt.design.sizes import beyond_tolerances
from fcdm_opt.design.whatif.fitting import barred_text
from fcdm_opt.geometry.units import measured
from fcdm_opt.plain import plain
from fcdm_opt.problem.problem import Problem
from fcdm_opt.show import texts
from fcdm_opt.show.glossary import WORDS
from fcdm_opt.show.printing import CELL_WIDTH, console, print_lines, print_rows, print_text, wrapped
from fcdm_opt.show.remarks import remarks
from fcdm_opt.show.verdict import (
    contact_text,
    fit_text,
    held_text,
    labels_in_words,
    no_contact_text,
    range_texts,
    shared_range_texts,
    verdict_text,
)

if TYPE_CHECKING:
    from fcdm_opt.along.coherent_range import AssemblyRange, CoherentRange
    from fcdm_opt.along.contact_times import ContactTimes
    from fcdm_opt.curve.decision_curve import DecisionCurve
    from fcdm_opt.design.compensation.assembly_yield import AssemblyYield
    from fcdm_opt.design.fixed_pose.clearances import Clearances
    from fcdm_opt.design.whatif.budget import Budgets
    from fcdm_opt.design.whatif.compare import Comparison
    from fcdm_opt.design.whatif.constraints import Costs, Dropped
    from fcdm_opt.design.whatif.whatif import WhatIf
    from fcdm_opt.problem.scene import Scene
    from fcdm_opt.problem.solution import Bounded, Certificate
    from fcdm_opt.show.solved import SolvedCase

OPTIONAL = ("published\namount", 'least\n"touch"')
NUMBERS = (*OPTIONAL, "found\namount", "proved\nat least", "new/old\nsizes")
SHARES = ("build", "solve", "prove", "verify", "check", "advise")  # of the time that a case takes
CUT = ", exactly the solid"  # what a note on a body says first
LONGEST_VALUE = 40  # letters of a value that was changed, which are shown
MOST_MET = 6  # contacts of a switching point that are listed: round faces meet in many
DOUBT_WIDTH = 14  # characters, of what is said below an amount
JUDGED_WIDTH = 9  # and of why a motion is none to use


def print_curves(curves: Mapping[DecisionCurve, Sequence[str]]) -> None:
    """Print the curve of each pair of bodies, with the cases that share it."""
    for curve, names in curves.items():
        (low_1, high_1), (low_2, high_2) = curve.box
        text = (
            f"{curve.movable.name}, movable, and {curve.static.name}, static; cases {', '.join(names)}: "
            f"{curve.status} in the box [{low_1:g}, {high_1:g}] x [{low_2:g}, {high_2:g}]"
        )
        print_text(text)
        proved, settled = curve.paths["float"], curve.paths["exact"]
        print_text(f"part pairs: {proved} proved in floats, {settled} settled in rational numbers")
        print_text()
        segments = [
            {
                "segment": f"S{s.index}" + (" (snug)" if s.snug else ""),
                "feature": _label(s.feature, curve),
                **{name: f"{x:.6f}" for name, x in zip("abc", s.line, strict=True)},
                "from": _point(s.start),
                "to": _point(s.end),
                "slope": f"{s.slope:.6f}" if s.line[1] else "vertical",
            }
            for s in curve.segments
        ]
        if segments:
            print_rows(segments, numbers=("a", "b", "c", "slope"))
        points = [
            {
                "switching point": f"SW{p.index}",
                "rho": _point(p.rho),
                "kind": " & ".join(texts.few(p.kind.split(" & "), MOST_MET)),
                "contact": "\n".join(texts.few([_label(feature, curve) for feature in p.contact_features], MOST_MET)),
                "at": "\n".join(texts.few([*map(_point, p.contacts)], MOST_MET)),
            }
            for p in curve.switching_points
        ]
        if points:
            print_rows(points)


def _label(feature: Any, bodies: Any) -> str:
    """Return a feature's label with names of round and large faces, on two lines where it is long."""
    label: str = feature.described(bodies.movable, bodies.static)
    return label if len(label) <= 2 * CELL_WIDTH else label.replace("; ", ";\n  ")


def _point(values: Iterable[float]) -> str:
    return ", ".join(f"{x:.6f}" for x in values)


UNPROVED = "the bound is proved by the solver alone, without evidence that the judge can check"


def print_solutions(rows: Sequence[SolvedCase]) -> None:
    """Print the verdicts and one table for the cases of a file, what else is to be said, and where the time went."""
    for row in rows:
        sentence, of_mesh = verdict_text(row.solution), row.solution.left_by_mesh
        sentence = sentence.replace(of_mesh, of_mesh.partition(": ")[0])
        print_text(f"{row.solution.problem.name}: {sentence}", indent="   ")
    lettered = any(row.solution.problem.requirement for row in rows)
    print_lines([f"Requirements: {WORDS['requirement'].partition(': ')[2]}."] * lettered)
    print_rows([_cells(row) for row in rows], numbers=NUMBERS, optional=OPTIONAL)
    noted: dict[str, list[str]] = {}  # notes, and the cases that they are of
    stages = {name: sum(row.solution.seconds.get(name, 0.0) for row in rows) for name in SHARES}
    for row in rows:
        solution = row.solution
        notes = [*filter(None, [fit_text(solution.problem)]), *remarks(solution)]
        if row.unproved:
            notes = [*notes, f"{UNPROVED}: {row.unproved}"]
        if solution.status.name not in ("SOLVED", "ALREADY_SATISFIED"):
            start = perf_counter()
            notes = [f"{texts.advised(row)}{failed_text(solution)}", *notes]
            stages["advise"] += perf_counter() - start  # by other questions, of what is impossible
        if cause := solution.left_by_mesh.partition(": ")[2]:  # the same of many cases
            notes.append(f"what true parts need is left open: {cause}")
        for text in notes:
            noted.setdefault(text, []).append(solution.problem.name)
    for text, names in noted.items():
        print_text(f"{', '.join(names)}: {text}", indent="   ")
    problems = [row.solution.problem for row in rows]
    bodies = [body for each in problems for body in (each.movable, each.static, *(some.body for some in each.keep_out))]
    for text in dict.fromkeys(f"{body.name}: {note}" for body in bodies for note in body.notes if note):
        if text in noted:
            continue
        head, exactly, _ = text.partition(CUT)  # how it was cut stands in the report
        print_text(f"{head}{exactly}", indent="   ")
    total = sum(stages.values())
    shares = ", ".join(f"{name} {1e3 * t:.0f} ms ({t / total:.0%})" for name, t in stages.items() if total and t)
    console().print(f"time of {len(rows)} case{'s' * (len(rows) > 1)}, parts read: {shares or 'not measured'}\n")


def _cells(row: SolvedCase) -> dict[str, str]:
    solution, problem = row.solution, row.solution.problem
    ratio = () if solution.rho is None else solution.rho / problem.nominal_pair
    gap = solution.pair_gap
    off = f"\n{gap:+.{texts.DIGITS}g}" if math.isfinite(gap) and solution.pair_state != "touching" else ""
    judged = solution.status.found and solution.certificate is not None
    motion = texts.motion_text(solution, unit=False)  # said once above the table
    return {
        "case": wrapped(problem.name, CELL_WIDTH),
        "asked": wrapped(texts.asked_text(problem), CELL_WIDTH),
        "goal": texts.goal_text(problem).replace(" by ", "\nby "),
        "motion found": motion.replace(" + ", " +\n").replace(", ", ",\n").replace("Screw ", "Screw\n"),
        "published\namount": "" if row.published_amount is None else texts.amount_text(row.published_amount),
        "found\namount": texts.amount_text(texts.seen_amount(solution))
        + (f"\n{wrapped(solution.doubt.partition(': ')[0], DOUBT_WIDTH)}" if solution.doubt else ""),
        "proved\nat least": texts.bound_text(solution),
        "new/old\nsizes": "\n".join(map(texts.scale_text, ratio)) or "-",
        "pair made": _pair_state(solution, off),
        'least\n"touch"': texts.amount_text(row.touch_amount) if problem.goal == "beyond" else "",
        "verified": verdict_cell(solution) if judged else "-",
    }


def failed_text(solution: Bounded) -> str:
    """Return which checks of a motion that was found failed, as a sentence after another one; "" for none."""
    used = solution.certificate and solution.status.found and solution.status.name != "OUTSIDE_FIT"
    failed = solution.certificate.failed if used and solution.certificate else ()
    return f" Failed: {', '.join(check.name for check in failed)}." if failed else ""


def verdict_cell(solution: Bounded) -> str:
    """Return whether a solution that was found is verified, for the cell of a table."""
    if solution.status.name == "OUTSIDE_FIT":
        return wrapped(texts.outcome_text(solution), JUDGED_WIDTH)
    return "yes" if solution.usable else "no"


def print_ranges(rows: Sequence[tuple[CoherentRange | AssemblyRange | None, ContactTimes | str]]) -> None:
    """Print how long the contact of each case lasts, what ends it both ways, and when the pair made touches.

    The latter may be a reason why that is not told. Of parts that do not touch as drawn it is all there is. What an
    assembly's contacts have in common, and how all of its parts lie, stands before each of them.
    """
    from fcdm_opt.along.coherent_range import AssemblyRange  # as isinstance takes it

    known = dict[tuple[str, ...], str]()  # range in words -> the case that it is told of
    for coherent, times in rows:
        if isinstance(coherent, AssemblyRange):
            _print_assembly_range(coherent, times)
            continue
        asked: Any = coherent if isinstance(times, str) else times
        problem, touches = asked.problem, () if coherent else asked.touches
        words = (*range_texts(coherent), *_doubts(coherent, problem)) if coherent else (no_contact_text(problem),)
        head, *ends = (f"range as of {known[words]}",) if coherent and words in known else words
        known.setdefault(words, problem.name)
        at_contact = [
            f"at {_steps_text(asked, own.x)}, {contact_text(own.problem or problem, own.features)}" for own in touches
        ]
        scales = " and ".join(map(texts.scale_text, problem.target.tolist()))
        resized = f" ({scales} times as large as drawn)" * bool((problem.target != 1.0).any())
        states = _state_texts(times, f"the parts made{resized}, moved along this: ")
        _print_range(f"{problem.name}: {head}", [*ends, *states, *at_contact])
    print_text()


def _print_range(head: str, ends: Iterable[str]) -> None:
    print_text(head, indent="   ")
    for text in ends:
        print_text(f"- {text}", indent="  ")


def _print_assembly_range(found: AssemblyRange, times: ContactTimes | str) -> None:
    """Print how long all contacts last, how the parts made lie, and what ends each contact, of like ones once."""
    from fcdm_opt.along.coherent_range import moved_contacts

    name, (head, *ends) = found.assembly.name, shared_range_texts(found)
    _print_range(f"{name}: {head}", [*ends, *_state_texts(times, "the parts made: ", found)])
    asked, alike = moved_contacts(found.assembly, found.direction), dict[tuple[str, ...], list[str]]()
    for pair, own in found.contacts.items():
        words = (*range_texts(own, ""), *_doubts(own, asked[pair]))
        alike.setdefault(words, []).append(f"{pair}: {contact_text(own.problem, own.features, named=True)}")
    for (until, *others), contacts in alike.items():
        _print_range(f"{name}: {'; '.join(contacts)}{until}", others)


def _doubts(coherent: CoherentRange, asked: Problem) -> list[str]:
    """Return what of a range is not proved, and which sizes of the parts made are left as drawn in it."""
    doubts = ["a condition touches zero at rest: what is near there is not proved"] * (not coherent.proved)
    kept = coherent.problem.made or {}
    if opening := [name for name, x in (asked.made or {}).items() if x != kept.get(name, 0.0)]:
        doubts.append(f"followed with {texts.listed(opening)} as drawn: as made there is no such contact at rest")
    return doubts


def _state_texts(times: ContactTimes | str, made: str, moved: AssemblyRange | None = None) -> list[str]:
    """Return how bodies lie along a motion, like ones of an assembly together, and how far was looked.

    Of an assembly those that overlap anywhere, or whose contact is followed.
    """
    if isinstance(times, str):
        return [f"{made}{times}"]
    alike = dict[str, list[str]]() if moved else {f"{made}{_spans_text(times, '')}": list[str]()}
    for name, spans in times.keep_outs.items():
        if not moved:
            alike[f"keep-out {name}: {_spans_text(times, name)}"] = []
        elif name in moved.contacts or (name not in moved.apart and any(own.state == "overlapping" for own in spans)):
            alike.setdefault(_spans_text(times, name), []).append(name)
    lines = [f"as made, {texts.listed(names)}: {text}" if names else text for text, names in alike.items()]
    low, high = (_steps_text(times, x) for x in times.searched)
    beyond = f"searched from {low} to {high}: what is beyond is not known"
    lines += [f"of facets: {line}" for line in times.known_to]
    return [*lines, *[beyond] * all(map(math.isfinite, times.searched))]


def _spans_text(times: ContactTimes, name: str) -> str:
    """Return how bodies lie along a range: "overlapping up to TX -0.6975 mm, apart beyond"."""
    spans = times.keep_outs.get(name, times.spans)
    ends = [f" up to {_steps_text(times, span.high)}" for span in spans[:-1]]
    ends.append(" beyond" if ends else " all along")
    return ", ".join(f"{times.state_text(name, span)}{end}" for span, end in zip(spans, ends, strict=True))


def _steps_text(times: ContactTimes, x: float) -> str:
    asked = times.problem if isinstance(times.problem, Problem) else next(iter(times.problem.questions.values()))
    values = texts.telling(asked, (x * times.direction).tolist())
    return texts.steps_text(asked, values) if any(values) else "where they are drawn"


def _question_text(scene: Scene) -> str:
    return texts.asked_text(scene) + (f", goal {texts.goal_text(scene)}" if isinstance(scene, Problem) else "")


def print_case(file: str, problem: Scene) -> None:
    """Print which case is asked about, and once what its numbers are in."""
    console().print(f"{file}: {problem.name} ({_question_text(problem)})", style="bold")
    if problem.unit:
        console().print(texts.units_text(problem.unit))
    for text in beyond_tolerances(problem):
        print_text(text)


def print_as_text(result: Any) -> None:
    """Print what a result itself says in words: regions of a map, clashes and their cures, the pose for all sizes."""
    print_lines(str(result).splitlines())


def _value_text(value: Any) -> str:
    each = (f"{name} {own}" for name, own in value.items()) if isinstance(value, dict) else [str(value)]
    return ", ".join(each) or "none"


def _changed_values(name: str, old: Any, new: Any) -> Iterator[tuple[str, str, str]]:
    """Yield in words what two plain values differ by, and where: "made.width", "contacts[8].clearance"."""
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new) and isinstance([*old, 0][0], dict):
        old, new = ({f"[{k}]": one for k, one in enumerate(own, 1)} for own in (old, new))
    elif not (isinstance(old, dict) and isinstance(new, dict) and old.keys() & new.keys()):
        yield name.replace(".[", "["), _value_text(old), _value_text(new)
        return
    for key in dict.fromkeys([*old, *new]):
        if old.get(key) != new.get(key):
            yield from _changed_values(f"{name}.{key}", old.get(key), new.get(key))


def print_whatif(answer: WhatIf) -> None:
    """Print both answers, what the derivatives predicted, and what else changed."""
    rows = [_solved("before", answer.before), _solved("after", answer.after)]
    predicted = {"": "predicted", "amount": texts.amount_text(answer.predicted_amount)}
    rows += [{**dict.fromkeys(rows[0], ""), **predicted}] * math.isfinite(answer.predicted_amount)
    asked = [own.question.request for own in (answer.before, answer.after)]
    values = (own for name in answer.changed for own in _changed_values(name, *(plain(own.get(name)) for own in asked)))
    notes = [f"{name}: {old} -> {new}" for name, old, new in values if max(len(old), len(new)) <= LONGEST_VALUE]
    was = beyond_tolerances(answer.before.question)  # said above
    notes += filter(None, [answer.unchanged_text])
    notes += [own for own in beyond_tolerances(answer.after.question) if own not in was]
    notes += [f"predicted: {reason}" for reason in answer.prediction.reasons]
    for name, own in (("before", answer.before), ("after", answer.after)):
        why = verdict_text(own) if isinstance(own.question, Problem) else own.explained
        notes += [f"{name}: {why}"] * (not own.usable)
    for what in answer.differences:
        if what.name in ("features", "active"):
            ends = zip((what.before, what.after), (answer.before, answer.after), strict=True)
            old, new = (held_text(each or () if own.usable else (), own.question) for each, own in ends)
            notes += [f"{what.name}: {old} -> {new}"] * (old != new)
    print_rows(rows, numbers=("amount",), optional=("pair made",), notes=notes)


def print_budgets(budgets: Budgets) -> None:
    """Print the largest tolerance of each requirement, and what ends it."""
    unit = budgets.problem.amount_unit
    limit = "its own limits" if budgets.limit is None else f"an amount of {measured(f'{budgets.limit:g}', unit)}"
    console().print(f"Largest tolerance such that it and all smaller ones can be made good within {limit}:")
    rows = [
        {
            "requirement": one.requirement,
            "tolerance": one.tolerance_text(texts.DIGITS),
            "amount there": texts.amount_text(one.amount),
            "above it": one.end.value,
            "smaller ones": "-" if not one.tolerance else "proved" if one.proved else f"sampled, {one.points} points",
        }
        for one in budgets.values()
    ]
    reasons: dict[str, list[str]] = {}
    for budget in budgets.values():
        if budget.tolerance or budget.end.name == "TIME":
            reasons.setdefault(budget.reason, []).append(budget.requirement)
    notes = []
    for one in budgets.values():
        sizes = one.sizes_text(texts.DIGITS) if one.tolerance else ""
        within = f", within {one.share_text(budgets.problem.sizes)}"
        if text := within.join(filter(None, (one.corner, sizes))):
            notes.append(f"{one.requirement}: {text}")
    notes += [budgets.open_text] * bool(budgets.open_text)
    notes += [
        f"{each.requirement}, {'above' if each.bracket[1] else 'as drawn'}: {each.advice}"
        for each in budgets.values()
        if each.advice != each.end.value
    ]
    notes += dict.fromkeys(filter(None, (each.closed_text for each in budgets.values())))
    notes += [f"{', '.join(letters)}: {reason}" for reason, letters in reasons.items()]
    print_rows(rows, numbers=("tolerance", "amount there"), notes=notes)


def print_costs(costs: Costs) -> None:
    """Print what each constraint costs."""
    amount = texts.amount_text(costs.solution.amount, costs.solution.amount_unit)
    console().print(f"as asked: amount {amount}, {texts.motion_text(costs.solution)}")
    rows = [_dropped("drop", row) for row in costs.rows] + [_dropped("ask for", row) for row in costs.goals]
    if not rows:
        print_lines(["Nothing to drop: no constraint but the goal itself."])
        return
    predicted = any(row["predicted"] for row in rows)
    more = '; "predicted": what its multiplier (first derivative) says is saved' if predicted else ""
    note = f"One change at a time, all else as asked; below 0 saved: the motion gets larger{more}."
    print_rows(rows, numbers=("least amount then", "saved", "predicted"), optional=("predicted",), notes=[note])


def print_comparison(comparison: Comparison) -> None:
    """Print the families of motions, the cheapest first."""
    console().print(str(comparison))
    rows = [
        {
            "family": row.name,
            "amount": texts.amount_text(None if row.solution is None else texts.seen_amount(row.solution)),
            "proved at least": "" if row.solution is None else texts.bound_line(row.solution),
            "motion": "-" if row.solution is None else texts.motion_text(row.solution, unit=False),
            "pair made": _pair_state(row.solution) if row.solution and row.solution.status.found else "",
            "outcome": "the question does not hold" if row.solution is None else texts.outcome_text(row.solution),
        }
        for row in comparison.table
    ]
    notes = [f"{row.name}: {row.note}" for row in comparison.table if row.note]
    print_rows(rows, numbers=("amount", "proved at least"), notes=notes)


def print_yield(result: AssemblyYield) -> None:
    """Print the share of pairs that pass, and which size's tolerance contributes how much, where that is known."""
    print_text(str(result), indent="   ")
    if not any(math.isfinite(own.first_order) or 0.0 < own.share_without < 1.0 for own in result.contributions):
        return
    others = "with the others" if len(result.contributions) > 2 else "with the other"
    rows = [
        {
            "size": share.body,
            "of the amount's variance alone": "-" if math.isnan(share.first_order) else f"{share.first_order:.2%}",
            others: "-" if math.isnan(share.total) else f"{share.total:.2%}",
            "yield without its scatter": texts.share_text(share.share_without, 3),
        }
        for share in result.contributions
    ]
    note = "the variance is of amounts; which pairs have no motion, and so no amount, shows in the yields alone"
    print_rows(rows, numbers=tuple(rows[0])[1:], notes=[note] * bool(result.impossible))


def print_judged(certificate: Certificate) -> None:
    """Print what the judge says of many sizes."""
    each = (f"{own.name} (off by {own.value:.3g}, at most {own.limit:.1g}, {own.note})" for own in certificate.failed)
    count, failed = len(certificate.checks), "; ".join(each)
    passed = f"judged with parts made anew at other sizes: all {count} checks passed"
    print_text(f"NOT VERIFIED, do not use it: failed {failed}" if failed else passed, indent="   ")


def print_clearances(clearances: Clearances, problem: Scene, *, where: str = "") -> None:
    """Print the range of the gap over all sizes at a pose, and how it is spread."""
    print_text(f"{where}: {clearances}" if where else str(clearances), indent="   ")
    if not isinstance(problem, Problem):
        return  # the pose tells each contact
    ends = (("least", clearances.least), ("largest", clearances.most))
    rows = [
        {
            "end": name,
            "gap": f"{end.gap:+.{texts.DIGITS}g}",
            "at sizes": wrapped(end.sizes_text, 3 * CELL_WIDTH),
            "between": wrapped(end.between or labels_in_words(end.feature, problem), 3 * CELL_WIDTH),
        }
        for name, end in ends
    ]
    print_rows(rows, numbers=("gap",))


def _pair_state(solution: Bounded, off: str = "") -> str:
    """Return the state of the pair made, with how far it is off; "-" after a motion that leaves the fit."""
    return "-" if solution.status.name == "OUTSIDE_FIT" else getattr(solution, "pair_state", "") + off


def _solved(name: str, solution: Bounded) -> dict[str, str]:
    return {
        "": name,
        "asked": wrapped(_question_text(solution.question), 3 * CELL_WIDTH),
        "amount": texts.amount_text(texts.seen_amount(solution)),
        "motion": texts.motion_text(solution, unit=False),
        "pair made": _pair_state(solution),
        "outcome": barred_text(solution),
    }


def _dropped(word: str, row: Dropped) -> dict[str, str]:
    nothing = row.saving == 0.0
    return {
        "change": wrapped(f"{word} {row.name}", 3 * CELL_WIDTH),
        "least amount then": texts.amount_text(row.amount),
        "saved": "nothing" if nothing else f"{row.saving:.{texts.DIGITS}g}" if math.isfinite(row.saving) else "",
        "predicted": f"{row.estimate:.{texts.DIGITS}g}" if math.isfinite(row.estimate) and not nothing else "",
        "outcome": "verified" if math.isfinite(row.amount) else texts.outcome_text(row.solution),
    }
