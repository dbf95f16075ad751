"""Assemblies: the table of what moves how far, and the parts in space after their motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain, combinations, count
from types import MappingProxyType
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.design.sizes import beyond_tolerances
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import gaps_off
from fcdm_opt.geometry.solids import depth_as_drawn
from fcdm_opt.geometry.units import measured
from fcdm_opt.judge.placed_parts import gone_through
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.fit import verdict
from fcdm_opt.show import Figure, texts
from fcdm_opt.show.printing import CELL_WIDTH, print_lines, print_rows, print_text, wrapped
from fcdm_opt.show.remarks import least_at_rest
from fcdm_opt.show.scene import MOST_INSETS, VIEW, ShownBodies, contacts_of, numbered_contacts, scene_figure
from fcdm_opt.show.sections import Touching
from fcdm_opt.show.solved import SolvedCase
from fcdm_opt.show.tables import UNPROVED, failed_text, print_solutions, verdict_cell
from fcdm_opt.show.verdict import EXACT, barring, instruction_text, poses_shown, refusal_text, verdict_text
from fcdm_opt.tolerances import DEFAULT

NUMBERS = ("amount", "total", "proved\nat least")


def print_answers(rows: Sequence[SolvedCase]) -> None:
    """Print the verdicts and one table for the cases of a file, of assemblies a row a part, and what else is said."""
    if not isinstance(rows[0].solution, AssemblySolution):  # a file is of one kind
        return print_solutions(rows)
    for row in rows:
        print_text(f"{row.solution.question.name}: {assembly_verdict(row.solution)}", indent="   ")
    print_rows([cells for row in rows for cells in _cells(row.solution)], numbers=NUMBERS, optional=("weight",))
    lines = list[str]()
    for row in rows:
        solution, own = row.solution, [f"{UNPROVED}: {row.unproved}"] * bool(row.unproved)
        if solution.status.found and solution.status.name != "SOLVED":  # else the verdict says it
            own.append(f"{solution.advice}{failed_text(solution)}")
        own += [*beyond_tolerances(solution.assembly), *unsaid(solution)]
        lines += [f"{solution.assembly.name}: {text}" for text in own]
    print_lines([*lines, *_overlaps(rows[0].solution.assembly)])


def unsaid(solution: AssemblySolution) -> list[str]:
    """Return what holds motions that are not to be used, or excludes any, and what is doubted, without the verdict."""
    verdict = assembly_verdict(solution)
    known = solution.usable or solution.status.name == "OUTSIDE_FIT"
    lines = (*(() if known else solution.active), solution.doubt, *least_at_rest(solution.assembly))
    return [text for text in lines if text[1:] not in verdict]


def _overlaps(assembly: Assembly) -> list[str]:
    """Return which parts overlap as drawn by more than their facets can be off, and by how much."""
    found = []
    for (one, two), made in assembly.relations.items():
        problem = made.changed(made={}) if any((made.made or {}).values()) else made
        bodies = problem.movable, problem.static
        least = gaps_off(bodies)[0] + problem.contact_slack
        if problem.curve.gap((1.0, 1.0)) < -least and (depth := depth_as_drawn(*bodies, (1.0, 1.0))) > least:
            found.append(f"as drawn, {one} and {two} overlap by {measured(depth, assembly.unit, 4)}")
    return found


def part_texts(solution: AssemblySolution) -> list[tuple[str, str, str, str, str]]:
    """Return part, what its motion is relative to, how it is made, motion and amount; first of parts that move.

    Motions are told as parameters, "TX 0.0125 + TZ 0.055"; rounding is left out.
    """
    assembly, outside = solution.assembly, solution.status.name == "OUTSIDE_FIT"
    moved = [(part, [] if outside else kept) for part, kept in texts.values_by_part(solution).items()]
    motion_texts = {part: texts.described(assembly.motions[part], kept, "") if kept else "-" for part, kept in moved}
    return [
        (part, assembly.follows.get(part, "-"), texts.made_text(assembly, part), motion,
         texts.amount_text(None if amount is None or outside else amount * any(kept)))
        for part, motion, amount, kept in (
            *((part, motion_texts[part], solution.amounts.get(part), kept) for part, kept in moved),
            *((part, "fixed", None, ()) for part in assembly.fixed),
        )
    ]  # fmt: skip


def assembly_verdict(solution: AssemblySolution) -> str:
    """Return in a sentence what to move, and whether less would do."""
    from fcdm_opt.design.whatif.fitting import NOT_MET, advising

    assembly = solution.assembly
    outside = solution.status.name == "OUTSIDE_FIT"
    with advising(solution):
        barred = barring(assembly) if outside or not solution.status.found else ""
    if not solution.status.found:
        return f"{solution.explained} {barred[:1].upper()}{barred[1:]}." if barred else solution.explained
    if outside:
        place = "the place it is drawn in"
        what = f"does not fit: the only motions found take a part out of {place}"
        if texts.outcome_text(solution) == NOT_MET:
            what = f"fits, {NOT_MET}: no such motions leave it with each part in {place}"
        return "; ".join(filter(None, (verdict(assembly) or what, barred)))
    if not solution.usable:
        return "not to be used: motions were found, but the judge refused them"
    done, goals = assembly_instruction(solution), {pair.asked.get("goal") for pair in assembly.contacts}
    met = "kept apart as asked" if goals == {"clear"} else "met as asked" if "clear" in goals else "closed"
    if assembly.resolution:  # whole steps of the machine seldom close one
        named = {frozenset(pair[:2]) for pair in assembly.contacts if pair.asked.get("goal") != "clear"}
        most = max((abs(gap) for pair, gap in solution.gaps.items() if frozenset(pair) in named), default=0.0)
        slack = max(own.contact_slack for own in assembly.questions.values())
        met = f"open by no more than {measured(most, assembly.unit, 4)}" if most > slack else met
    if not any(map(any, texts.values_by_part(solution).values())):
        return f"{done}: every contact is {met}"
    sure = abs(solution.gap) < max(texts.CLOSED, EXACT)
    proved = "smallest possible together (proved)" if sure else f"proved at least {texts.bound_line(solution)}"
    gone = pacing.in_time(gone_through, solution, late=list[tuple[str, str]]())
    through = [f"straight there {one} goes through {other}, and no other way is looked for" for one, other in gone]
    return "; ".join([f"{done}: then every contact is {met}", solution.doubt or proved, *through])


def answer_text(solution: AssemblySolution) -> str:
    """Return the verdict, and below it the amount and its bound: all that `print` shows of an assembly's solution."""
    name, motion_texts = solution.assembly.name, [assembly_verdict(solution)]
    if solution.status.found and solution.status.name != "OUTSIDE_FIT":
        amount = texts.amount_text(texts.seen_amount(solution), solution.assembly.amount_unit)
        motion_texts.append(f"amount {amount}{texts.proved_text(solution)}; {texts.outcome_text(solution)}")
    return "\n".join([f"{name}: {motion_texts[0]}" if name else motion_texts[0], *motion_texts[1:]])


def verdict_of(solution: Any) -> str:
    """Return the verdict of an answer about two parts or several."""
    return (assembly_verdict if hasattr(solution, "assembly") else verdict_text)(solution)


def assembly_instruction(solution: AssemblySolution) -> str:
    """Return what to do with each part: "move wedge 0.01 mm along +x; move key 0.1 mm along -z relative to wedge".

    A motion is relative to what carries the part, which is said where that is no fixed part.
    """
    assembly, moved = solution.assembly, list[str]()
    for part, kept in texts.values_by_part(solution).items():
        motion = assembly.motions[part]
        words = motion.describe_steps(kept, unit=assembly.unit) if any(kept) else []
        steps = zip(motion.by_step(kept), words, strict=False)
        done, carrier = [step for own, step in steps if any(own)], assembly.follows[part]
        relative = f" relative to {carrier}, which carries it" * (carrier in assembly.motions)
        moved += [f"{instruction_text(part, done)}{relative}"] if done else []
    return "; ".join(moved) or "leave all parts where they are"


def _cells(solution: AssemblySolution) -> list[dict[str, str]]:
    assembly = solution.assembly
    verdict = "-" if not solution.status.found else verdict_cell(solution)
    first = {
        "case": wrapped(assembly.name, CELL_WIDTH),
        "total": texts.amount_text(texts.seen_amount(solution)),
        "proved\nat least": texts.bound_text(solution),
        "verified": verdict,
    }
    rows = list[dict[str, str]]()
    for part, carrier, made, motion, amount in part_texts(solution):
        weight = assembly.weights.get(part, 1.0)
        own = {
            "part": wrapped(part, CELL_WIDTH),
            "relative to": wrapped(carrier, CELL_WIDTH),
            "made": wrapped(made, CELL_WIDTH),
            "weight": f"{weight:g}" if weight != 1.0 else "",
            "motion found": motion.replace(" + ", " +\n").replace(", ", ",\n"),
            "amount": amount,
        }
        rows.append({"case": "", **own, **(first if not rows else dict.fromkeys(first, ""))})
    return rows


def touching(solution: AssemblySolution) -> list[Touching]:
    """Return what touches after the motions, and gaps, in the world, with numbers of contacts; none without motions.

    A contact has the file's number; of two parts that touch at several places, a few, others have numbers after these.
    """
    found, asked, rows = list[Touching](), solution.assembly.contacts, [*solution.assembly.parts]
    further = count(len(asked) + 1)
    for first, (pair, own) in enumerate(zip(asked, solution.contacts, strict=False), 1):
        if own.transform is None:
            continue
        problem, pose = own.problem, np.asarray(solution.transforms.get(pair.two, np.eye(4)))
        rho = own.pair if own.rho is None else own.rho
        shown = ShownBodies.of(problem.movable, problem.static, rho=rho, transform=own.transform, view=VIEW)
        curve = problem.curve_after(own.transform, rho)
        met = contacts_of(curve, rho, shown, own.features, problem)
        met = met or [*filter(None, [Touching.gap(curve, rho, *shown.bodies)])]
        several, both = [*dict.fromkeys(one.number for one in met)], (rows.index(pair.one), rows.index(pair.two))
        few = 1 < len(several) <= MOST_INSETS
        numbers = dict(zip(several, chain([first], further), strict=False)) if few else {}
        for one in met:
            number, label = (numbers[one.number], one.text) if few else (first, str(pair))
            found.append(one.moved(pose)._replace(number=number, text=label, pair=both))
    return sorted(found, key=lambda one: one.number)


def barriers(
    bodies: Sequence[Body],
    names: Sequence[str],
    moving: Sequence[int],
    needs: Mapping[tuple[int, ...], float] = MappingProxyType({}),
) -> list[Touching]:
    """Return where bodies overlap, or are nearer than is needed by their rows, of which one moves at least.

    Numbered by pairs where several do.
    """
    found = list[Touching]()
    for pair in combinations(range(len(bodies)), 2):
        both, need = [bodies[k] for k in pair], needs.get(pair, 0.0)
        one = None if set(pair).isdisjoint(moving) else pacing.in_time(Touching.overlap, *both, late=None)
        if one is None and need > 0.0:
            one = pacing.in_time(Touching.gap, decision_curve(*both), np.ones(2), *both, late=None)
            one = one if one is not None and one.long < need - DEFAULT.touch * both[0].size else None
        found += [] if one is None else [one._replace(pair=pair)]
    several = len(found) > 1
    return [
        one._replace(number=number * several, text=" - ".join(names[k] for k in one.pair) * several)
        for number, one in enumerate(found, 1)
    ]


ARROWS = "where each part goes, with what carries it (not to scale)"  # what arrows of its picture tell


def parts_of(solution: AssemblySolution) -> tuple[ShownBodies, list[Touching]]:
    """Return the parts as made, after their motions, and what touches then.

    Where none are to be used as `poses_shown`, with what overlaps, or is nearer than is asked.
    """
    assembly, bodies, (moved, where) = solution.assembly, list[Body](), poses_shown(solution)
    refused, poses = refusal_text(solution, where), [moved.get(part) for part in assembly.parts]
    for pose, (part, body) in zip(poses, assembly.bodies_made.items(), strict=True):
        made = body.scaled(assembly.scales[part])
        bodies.append(made if pose is None else made.moved(pose))
    bodies += [keep_out.body for keep_out in assembly.keep_out]
    names = [f"{part}, fixed" if part in assembly.fixed else part for part in assembly.parts]
    names += [f"{keep_out.name}, keep-out" for keep_out in assembly.keep_out]
    if not refused:
        return ShownBodies.of_parts(bodies, names, poses), touching(solution)
    moving = [k for k, part in enumerate(assembly.parts) if part in assembly.motions]
    named = [*assembly.parts, *(keep_out.name for keep_out in assembly.keep_out)]
    rows = {part: k for k, part in enumerate(assembly.parts)}
    needs = {
        tuple(sorted((rows[pair.one], rows[pair.two]))): pair.asked.get("clearance", 0.0) for pair in assembly.contacts
    }
    needs |= {(k, len(rows) + j): keep_out.clearance for k in moving for j, keep_out in enumerate(assembly.keep_out)}
    return replace(ShownBodies.of_parts(bodies, names), banner=refused), barriers(bodies, named, moving, needs)


def assembly_figure(solution: AssemblySolution, *, title: str = "") -> Figure:
    """Draw the parts as made, after their motions, or where `parts_of` shows them."""
    shown, contacts = parts_of(solution)
    state = f"as made, {shown.banner.rpartition(', ')[2]}" if shown.banner else f"after these motions; arrows: {ARROWS}"
    caption = f"{assembly_verdict(solution)} (shown {state})" if title else f"shown {state}"  # else said beside it
    if numbered := numbered_contacts(contacts, shown):
        caption += f"\n{'in the way' if shown.banner else 'contacts'}: {'; '.join(numbered)}"
    return scene_figure(shown, contacts=contacts, unit=solution.assembly.unit, title=title, caption=caption)
