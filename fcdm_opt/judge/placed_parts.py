"""The judge of assemblies: every contact as that of two parts, every two parts for overlaps and fits, and the total."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import hypot, isfinite, nan
from operator import attrgetter

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.judge import certificate
from fcdm_opt.judge.engagement import collides_on_path, leaves_fit
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.assembled import IN_PLACE, AssemblySolution, kept_apart, kept_clear_by
from fcdm_opt.problem.assembly import CLEAR, JoinedPair
from fcdm_opt.problem.evidence import SharedBound
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.solution import UNCLAIMED, Bounded, Check, Solution, Status
from fcdm_opt.tolerances import DEFAULT, Tolerances


def placed_checks(solution: AssemblySolution, tolerances: Tolerances, *, proof: bool) -> tuple[Check, ...]:
    """Return the checks of the motions of an assembly, see `verify`; without motions the one that says so."""
    assembly = solution.assembly
    if not solution.status.found or not solution.parameters:
        return (Check("motions found", False, float("nan"), 0.0, solution.status.name),)
    asked = {part: motion.names for part, motion in assembly.motions.items()}
    known = {part: tuple(own) for part, own in solution.parameters.items()} == asked
    q = {part: list(own.values()) for part, own in solution.parameters.items()}
    numbers = [solution.amount, solution.lower_bound, *(x for own in q.values() for x in own)]
    if not known or not all(map(isfinite, numbers)) or set(solution.transforms) != set(assembly.parts):
        what = f"a finite number for each of {asked}, and a pose for each part"
        return (Check("parameters", False, float("nan"), 0.0, what),)
    try:
        poses = assembly.poses(q)
    except InputError as reason:  # a screw whose axis has vanished on the way
        return (Check("parameters", False, float("nan"), 0.0, str(reason)),)
    limit = max(tolerances.touch * min(body.size for body in assembly.parts.values()), tolerances.tie * assembly.size)
    checks = [*_motions(solution, q, poses, limit, tolerances), *_contacts(solution, poses, limit, tolerances)]
    made, scales = assembly.bodies_made, assembly.scales
    exact = dict[tuple[str, str], tuple[Body, Body]]()  # whose true faces are judged with their contact
    for pair, own in zip(assembly.contacts, solution.contacts, strict=False):
        if own.problem.exact_at is not None:
            movable, static = own.problem.movable, own.problem.static
            exact |= {(pair.one, pair.two): (movable, static), (pair.two, pair.one): (static, movable)}
    for one, two in assembly.pairs():
        rho, seen = np.array([scales[one], scales[two]]), _seen(poses, one, two)
        bodies = exact.get((one, two), (made[one], made[two]))
        gap = certificate.solids_gap(*bodies, rho, seen, limit)
        if (one, two) not in exact:
            gap = min(gap, certificate.true_gap(bodies, rho, seen, limit))
        checks.append(Check(kept_apart(one, two), gap >= -limit, gap, -limit, "signed distance as made"))
    for part in assembly.motions:
        for keep_out in assembly.keep_out:
            check = certificate.keep_out_check(keep_out, made[part], scales[part], poses[part], limit, tolerances)
            checks.append(check._replace(name=kept_clear_by(part, keep_out.name)))
    outside = out_of_place(solution, poses)
    text = ", ".join(f"{one} leaves the place in which it is drawn in {two}" for one, two in outside)
    moved = any(any(own) for own in q.values())
    agrees = solution.status is not Status.NOT_VERIFIED and not (solution.status is Status.ALREADY_SATISFIED and moved)
    agrees &= bool(outside) is (solution.status is Status.OUTSIDE_FIT)
    checks.append(Check(IN_PLACE, agrees, len(outside), 0.0, text or "no part leaves its fit in another one"))
    proofs = proofs_of(solution) if proof else ()
    return (*checks, *proofs, *certificate.same_as_read(solution, checks, DEFAULT.touch * assembly.size))


def shared_proofs(solution: AssemblySolution) -> list[Check]:
    """Check what is claimed of contacts that share motions, see `SharedBound`: by their equations, anew."""
    assembly, checks, seen = solution.assembly, list[Check](), set[str]()
    known = {pair[:2]: pair for pair in assembly.contacts}
    for claim in solution.evidence or ():
        pairs = [known[pair] for pair in claim.contacts if pair in known]
        involved = {part for pair in pairs for part in assembly.involved(*pair[:2])}
        apart = len(pairs) == len(claim.contacts) and not involved & seen  # what two claims share would count twice
        parts = assembly.sharing(pairs)
        asked = {pair[:2]: pair for pair in pairs}
        for pair in assembly.moving_pairs():  # which must not overlap, nor keep-outs
            if set(assembly.involved(*pair)) <= set(parts) and pair not in asked:
                asked[pair] = JoinedPair(*pair, CLEAR)
        problems = [assembly.problem(pair, parts) for pair in asked.values()]
        moved = [x for part in parts for x in solution.parameters.get(part, {}).values()]
        q = np.array(moved) if solution.status.found else None
        shown = claim.bound == 0.0 or (apart and certificate.restored_at_least(problems, claim.bound, q))
        name = f"{certificate.PROOF}{', '.join(map(str, pairs))}"
        checks.append(Check(name, bool(shown), claim.bound if shown else 0.0, claim.bound, certificate.RESTORED))
        seen |= involved
    return checks


def proofs_of(solution: AssemblySolution) -> tuple[Check, ...]:
    """Check the lower bound: of contacts that share motions, of each other one, and what they come to together."""
    assembly, checks = solution.assembly, shared_proofs(solution)
    shown = [check.value for check in checks]
    claimed = {pair for claim in solution.evidence or () for pair in claim.contacts}
    taken = {part for pair in claimed for part in assembly.involved(*pair)}
    for pair, own in zip(assembly.contacts, solution.contacts, strict=False):
        if not assembly.is_own(pair) or pair.one in taken or tuple(own.parameters) != assembly.motions[pair.one].names:
            continue  # its motion is counted, or it is not the only one that it depends on
        exact = own.problem.exact_at is not None  # the same question, see `_contacts`
        proofs = certificate.proof_checks(own if exact else replace(own, problem=assembly.problem(pair)))
        checks += [check._replace(name=f"{pair}: {check.name}") for check in proofs]
        if all(check.passed for check in proofs):
            shown.append(assembly.weights[pair.one] * own.lower_bound)
    least, bound = hypot(*shown), solution.lower_bound
    passed, why = bound <= least + DEFAULT.requirement * bound, "of all contacts that share no motion"
    why = UNCLAIMED if bound == 0.0 and solution.amount > DEFAULT.touch * assembly.size else why
    if not passed and solution.evidence is None:  # found anew, of all contacts at once
        return proofs_of(replace(solution, evidence=(SharedBound(tuple(own[:2] for own in assembly.contacts), bound),)))
    return (*checks, Check(f"{certificate.PROOF}lower bound", passed, least, bound, why))


def placed(solution: AssemblySolution) -> AssemblySolution:
    """Return a solution with status OUTSIDE_FIT where a part leaves its fit in another one; others as they are."""
    outside = solution.status.found and out_of_place(solution, solution.transforms)
    return replace(solution, status=Status.OUTSIDE_FIT, amount_low=nan, amount_high=nan) if outside else solution


def out_of_place(solution: AssemblySolution, poses: Mapping[str, Array]) -> list[tuple[str, str]]:
    """Return the two parts each of which one leaves the fit in which it is drawn in the other."""
    return [(one, two) for one, two, problem, q in _moved(solution, poses) if leaves_fit(problem, q)]


def gone_through(solution: Bounded) -> list[tuple[str, str]]:
    """Return parts and what each goes through on the straight way of its motion: other parts, and keep-outs."""
    moved, found = list[tuple[str, str, Problem, tuple[float, ...]]](), list[tuple[str, str]]()
    if isinstance(solution, AssemblySolution):
        moved += _moved(solution, solution.transforms)
    elif isinstance(solution, Solution) and any(solution.parameters.values()):
        names = (solution.problem.movable.name or "the movable part", solution.problem.static.name or "the static part")
        moved.append((*names, solution.problem, tuple(solution.parameters.values())))
    for one, two, problem, q in moved:
        found += [(one, two)] if collides_on_path(problem, q) else []
        found += [(one, own.name) for own in problem.keep_out if collides_on_path(problem, q, own)]
    return found


def _moved(
    solution: AssemblySolution, poses: Mapping[str, Array]
) -> Iterator[tuple[str, str, Problem, tuple[float, ...]]]:
    """Yield two parts each that may meet on their ways, with the question about them and its parameters."""
    assembly = solution.assembly
    for one, two in assembly.moving_pairs():
        bodies, T = (assembly.bodies_made[one], assembly.bodies_made[two]), _seen(poses, one, two)
        start, end = (bodies[0].placed_vertices(assembly.scales[one], pose) for pose in (np.eye(4), T))
        others = bodies[1].placed_vertices(assembly.scales[two], np.eye(4))
        swept = np.concatenate([start, end])
        near = ((swept.min(axis=0) <= others.max(axis=0)) & (swept.max(axis=0) >= others.min(axis=0))).all()
        rests = np.abs(end - start).max() <= DEFAULT.side * assembly.size
        if rests or not (near or assembly.keeps_out(one, two)):
            continue
        parts = assembly.involved(one, two)
        problem = assembly.problem(JoinedPair(one, two, CLEAR), parts)
        yield one, two, problem, tuple(x for part in parts for x in solution.parameters[part].values())


def _seen(poses: Mapping[str, Array], one: str, two: str) -> Array:
    """Return the pose change of one part as another sees it."""
    T = np.eye(4)
    R, shift = poses[two][:3, :3], poses[two][:3, 3]
    T[:3, :3], T[:3, 3] = R.T @ poses[one][:3, :3], R.T @ (poses[one][:3, 3] - shift)
    return T


def _motions(
    solution: AssemblySolution, q: dict[str, list[float]], poses: dict[str, Array], limit: float, tolerances: Tolerances
) -> list[Check]:
    """Check that poses, amounts, the total and limits agree with the parameters."""
    assembly, off, excess, amounts = solution.assembly, 0.0, 0.0, dict[str, float]()
    for part, body in assembly.parts.items():
        between = np.asarray(solution.transforms[part], dtype=np.float64) - poses[part]
        moved = body.vertices @ between[:3, :3].T + between[:3, 3]
        off = max(off, float(np.linalg.norm(moved, axis=1).max()))
        off = off if np.isfinite(moved).all() else float("nan")
    for part, motion in assembly.motions.items():
        weights = motion.weights(assembly.lengths[part]).tolist()
        amounts[part] = hypot(*(w * x for w, x in zip(weights, q[part], strict=True)))
        for w, x, own in zip(weights, q[part], motion.parameters, strict=True):
            low, high = assembly.limits[part].get(own.name, (-np.inf, np.inf))
            excess = max(excess, w * (low - x), w * (x - high))
    total = hypot(*(assembly.weights[part] * amount for part, amount in amounts.items()))
    if isinstance(assembly.amount, OwnAmount):
        total = float(assembly.amount.function([x for part in assembly.motions for x in q[part]]))
    amounts_off = max(abs(amount - solution.amounts.get(part, np.inf)) for part, amount in amounts.items())
    amounts_off = amounts_off if solution.amounts.keys() == amounts.keys() else float("nan")
    slack = tolerances.requirement * total + tolerances.line * assembly.size
    beyond = max(solution.lower_bound - total, -solution.lower_bound)
    return [
        certificate._at_most("poses of parameters", off, limit, "largest displacement of a vertex between the two"),
        certificate._at_most("amounts", amounts_off, slack, "of the parts"),
        certificate._at_most("amount", abs(total - solution.amount), slack, "of all parts, weighted"),
        certificate._at_most("lower bound", beyond, slack, "from 0 to the amount"),
        certificate._at_most("limits", excess, tolerances.requirement * assembly.size),
        *certificate.left_by_mesh(solution, [*assembly.bodies_made.values()], slack),
    ]


def _contacts(solution: AssemblySolution, poses: dict[str, Array], limit: float, tolerances: Tolerances) -> list[Check]:
    """Check each contact as that of two parts, that it is the one asked for, and that it is where the parts are."""
    assembly, checks = solution.assembly, list[Check]()
    count, wanted = len(solution.contacts), len(assembly.contacts)
    checks.append(Check("contacts", count == wanted, count, wanted, "all that are asked"))
    for pair, own in zip(assembly.contacts, solution.contacts, strict=False):
        asked, problem = assembly.problem(pair), own.problem.of_facets
        keys = "goal", "contacts", "target", "clearance", "movable.vertices", "static.vertices"
        same = all(map(np.array_equal, *(attrgetter(*keys)(own) for own in (asked, problem))))
        checks.append(Check(f"asked: {pair}", same, float(same), 1.0, "the question is the assembly's"))
        if own.transform is None:
            checks.append(Check(f"contact: {pair}", False, float("nan"), 0.0, own.status.name))
            continue
        between = np.asarray(own.transform) - _seen(poses, pair.one, pair.two)
        moved = assembly.parts[pair.one].vertices @ between[:3, :3].T + between[:3, 3]
        off = float(np.linalg.norm(moved, axis=1).max())
        checks.append(Check(f"where: {pair}", off <= limit, off, limit, "largest displacement of a vertex"))
        verdict = certificate.verify(own, tolerances)
        names = ", ".join(check.name for check in verdict.failed)
        checks.append(Check(f"contact: {pair}", verdict.passed, len(verdict.failed), 0.0, names or "all checks passed"))
    return checks
