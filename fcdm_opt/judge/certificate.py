"""The judge: verifies a solution from the problem and the claimed numbers alone.

It shares no equation and no kernel with the solver. Distances come from a collision library, confirmed by explicit
vertices (`fcdm_opt.geometry.collision`); contacts and their lines from claimed vertices that are scaled and moved one
by one (`fcdm_opt.judge.claimed_contact`). Shared are what a problem means (nominal contact, target, motion
conventions) and the bodies' faces and labels; that the nominal contact is one is checked too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from math import hypot, inf, isfinite, isnan, nan, sqrt
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.features import Feature
from fcdm_opt.errors import InputError, expected, known_arguments
from fcdm_opt.geometry.arrays import Array, Flags
from fcdm_opt.geometry.bodies import Body, skewness
from fcdm_opt.geometry.collision import ScaledPair, scaled_pair
from fcdm_opt.geometry.facet_errors import deviation_of, facet_errors, round_surfaces
from fcdm_opt.geometry.naming import rows_at
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.geometry.solids import PlacedSolids, kept_as_surface
from fcdm_opt.geometry.units import number_text
from fcdm_opt.judge.claimed_contact import Claim, carriers, least_errors
from fcdm_opt.judge.engagement import inside_fit, outside_fit
from fcdm_opt.judge.true_faces import gap_of_true_faces
from fcdm_opt.judge.whole import Outside, WholeSurfaces
from fcdm_opt.lazy_import import imported
from fcdm_opt.plain import agree, plain
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.contacts_restored import flat_contacts, restores, restoring_motion, touching_again
from fcdm_opt.problem.evidence import Evidence, Multipliers
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.problem.nominal import FIT
from fcdm_opt.problem.problem import MOST_TURNED, TRACKING, Problem
from fcdm_opt.problem.solution import (
    IN_TIME,
    TRUE_FACES,
    UNCLAIMED,
    Bounded,
    Certificate,
    Check,
    Solution,
    Status,
    kept_clear,
)
from fcdm_opt.tolerances import DEFAULT, Tolerances

Judged = TypeVar("Judged", bound=Bounded)
PROOF = "proof: "
ONLY = "only motion"
RESTORED = "contacts restored: none smaller by their equations, or no other motion"
SHIFTED = "no shorter shift parts every two convex parts: by the directions along which they may be apart"
NOT_BY_EQUATIONS = "the contacts' equations alone show less than the bound, and what keeps parts apart is not kept"
FEW_PAIRS = 64  # part pairs up to which it is shown that they have no motion at all
FEW = slice(4, None, 8)  # of the positions on a shift: sizes change in proportion, so overlaps are of stretches
SWEPT = 64  # keep-outs of which what they sweep is kept
DERIVED = 1e-6  # relative: how well derivatives are known that are worked out once more
AS_FAR = 8.0  # times what facets leave of true faces: up to so far apart parts are looked at on these
ANEW = 1e-4  # of a bound: what may lack of it where evidence is found anew, as with `certify`
MOST_CHECKED = 3  # parameters up to which cells are kept
BY_MULTIPLIERS = f"cells are checked of {MOST_CHECKED} parameters at most, and multipliers in a few boxes show less"
HALVED = 30  # times, to find a box
BOXES = (64.0, 32.0, 16.0, 8.0, 4.0, 2.0, 1.01)  # half widths of those about a motion, in its largest parameter
FINER = 4  # smaller changes of the scales that are tried


@known_arguments
def verify(solution: Any, tolerances: Tolerances = DEFAULT, *, proof: bool = False) -> Certificate:
    """Judge a solution, a stack-up, a map, a yield, or the gaps of all sizes at a pose.

    Parameters
    ----------
    solution : Solution, AssemblySolution, StackUp, GapYield, CompensationMap, AssemblyYield, BestPose or Clearances
        Taken at its word in nothing: every claim of a solution is recomputed from the question and the parameters; what
        is said of many sizes is looked at where parts are made anew, see `judge.sampled_sizes`.
    tolerances : Tolerances
        Limits of the checks.
    proof : bool
        Check the lower bound too: that the evidence, cell by cell, shows that no motion does whose amount is smaller
        (see `proof.checker`). A bound without evidence passes where the distance of the parts at rest shows as much, or
        evidence that is found anew, as with `certify`, which takes as long.
        Of one pose for all sizes its evidence, where it carries some. Of a solution without a bound it is told that
        no smaller motion was excluded.

    Returns
    -------
    Certificate
        All checks with value and limit. Without a motion, or with numbers that are not finite, the one check that
        says so; with `proof`, of what is proved impossible, those of its proof alone.
    """
    if hasattr(solution, "claims"):
        return Certificate(solution.claims(proof=proof).checks())
    if isinstance(solution, AssemblySolution):
        from fcdm_opt.judge.placed_parts import placed_checks

        return Certificate(placed_checks(solution, tolerances, proof=proof))
    expected(solution, Solution, "solution")
    denied = proof and solution.status is Status.INFEASIBLE and solution.lower_bound == inf  # then that is the claim
    motion = () if denied and not solution.parameters else _of_motion(solution, tolerances)
    return Certificate((*motion, *(proof_checks(solution) if proof else ())))


verify_assembly = verify
"""The same by the name that it once had for assemblies."""


def judged(solution: Judged, fitting: Callable[[Any], Any] = inside_fit) -> tuple[Judged, Certificate]:
    """Return a solution, with status OUTSIDE_FIT where its motion leaves the fit, and the verdict."""
    # where the time given is over before, that is the one check, which fails
    pacing.at("judging the motion found")
    try:
        with pacing.judging():
            solution = fitting(solution)
            return solution, verify(solution)
    except pacing.TimeOverError as over:
        return replace(solution, stopped=solution.stopped or str(over)), _late(over)


def judged_in_time(answer: Any) -> Certificate:
    """Return the verdict on what is told of many sizes, late or not; see `judged`."""
    try:
        with pacing.judging():
            return verify(answer)
    except pacing.TimeOverError as over:
        return _late(over)


def _late(over: pacing.TimeOverError) -> Certificate:
    untold = Check(IN_TIME, False, float("nan"), over.limit, "not judged in the time given, seconds")
    return Certificate((untold,))


def _of_motion(solution: Solution, tolerances: Tolerances) -> tuple[Check, ...]:
    if not solution.status.found or solution.rho is None or solution.transform is None or not solution.parameters:
        return (Check("motion found", False, float("nan"), 0.0, solution.status.name),)
    finite = _well_formed(solution)
    if not finite.passed:
        return (finite,)
    with np.errstate(all="ignore"):  # what cannot be computed is nan or infinite, and passes no check
        judge = _Judge(solution.reformulated, tolerances)
        found = judge.motion, judge.requirement, judge.only_motion, judge.contact
        stages = (*found, judge.sides, judge.path, judge.seats)
        last = judge.pair, judge.true_faces, judge.scene
        checks = (finite, *(check for stage in (*stages, *last) for check in stage()))
    return (*checks, *same_as_read(solution, checks, solution.problem.contact_slack), *_same_derivatives(solution))


def same_as_read(solution: Bounded, checks: Sequence[Check], slack: float) -> tuple[Check, ...]:
    """Check that the certificate of a solution that was stored says what is found."""
    given, found = solution.certificate, {check.name: check for check in checks}
    if given is None or not given.read:
        return ()
    both = [(own, found[own.name]) for own in given.checks if own.name in found]
    wrong = [one.name for one, two in both if one.passed != two.passed or not _same(one, two, slack)]
    return (_at_most("certificate", len(wrong), 0, f"checks come out otherwise: {', '.join(wrong) or 'none'}"),)


def _same_derivatives(solution: Solution) -> tuple[Check, ...]:
    """Check the derivatives of its amount that a solution which was stored brings along."""
    if solution.derivatives is None:
        return ()
    anew = plain(replace(solution, derivatives=None).sensitivity)
    wrong = [key for key, own in plain(solution.derivatives).items() if not agree(own, anew[key], 1e-6, DERIVED)]
    return (_at_most("sensitivity", len(wrong), 0, f"worked out anew, otherwise: {', '.join(wrong) or 'none'}"),)


def _same(given: Check, found: Check, slack: float) -> bool:
    """Tell whether a check had the same value, but for rounding and what is within its limit; or nan both times."""
    room = slack + abs(found.limit) if isfinite(found.limit) else slack
    return given.value == found.value or not abs(given.value - found.value) > room + 1e-6 * abs(found.value)


def proof_checks(solution: Solution) -> tuple[Check, ...]:
    """Check that what is claimed to be proved is: by the evidence, or without any by the distance at rest."""
    # where that shows less, by evidence that is found anew, if some could be
    solution = solution.reformulated
    claimed, evidence = solution.lower_bound, solution.evidence
    asked, moved = solution.problem.restoring, np.array([*solution.parameters.values()])
    if evidence is None and asked is not None and restored_at_least([asked], claimed, moved):
        return (Check("proof: lower bound", True, claimed, claimed, RESTORED),)
    if evidence is None:
        shown, why = _by_distance(solution), f"no evidence is kept: {_unproved(solution)}; by the gap at rest"
        if solution.problem.contacts:
            q = np.array([*solution.parameters.values()]) if solution.parameters else None
            shown, why = claimed if restored_at_least((solution.problem,), claimed, q) else shown, RESTORED
        elif claimed > shown and _no_shorter_shift(solution.problem, claimed):
            shown, why = claimed, SHIFTED
        elif claimed > shown and not _without_cells(solution.problem):
            evidence = imported("solver:evidence_of")(solution.problem)
            claimed *= 1.0 - ANEW
        check = Check("proof: lower bound", claimed <= shown, shown, claimed, why)
        if evidence is None:
            unclaimed = claimed == 0.0 and solution.amount > solution.problem.contact_slack
            return (check._replace(note=UNCLAIMED),) if unclaimed else () if claimed == 0.0 else (check,)
    from fcdm_opt.judge.multipliers import check_multipliers
    from fcdm_opt.proof.checker import check_evidence

    try:
        if isinstance(evidence, Multipliers):
            return check_multipliers(solution, evidence)
        return check_evidence(solution.problem, cast("Evidence", evidence), claimed)
    except (AttributeError, IndexError, TypeError, ValueError) as reason:  # arrays that are none, or of other kinds
        return (Check("proof well-formed", False, 1.0, 0.0, f"{type(reason).__name__}: {reason}"),)


def restored_at_least(problems: Sequence[Problem], amount: float, q: Array | None = None) -> bool:
    """Tell whether what some problems with the same parameters ask is shown to need an amount."""
    # by the equations of contacts, with what keeps parts apart where nothing turns, or as a motion that restores them,
    # which is no smaller, is the only one that near. Of another amount than the weighted one as the only one that the
    # limits allow, or in a box outside of which all cost more
    from fcdm_opt.proof.checker import least_outside
    from fcdm_opt.proof.uniqueness import none_shorter, none_smaller, only_motion

    if not isfinite(amount):
        few = sum(len(own.movable.parts) * len(own.static.parts) for own in problems) <= FEW_PAIRS
        return few and any(none_shorter(problems, _out_of_touch(own)) for own in problems if own.contacts)
    if not problems:
        return False
    round_ones = [own for own in problems if q is not None and own.motion.shifts and touching_again(own) is not None]
    if round_ones and q is not None:
        shown = _least_restoring(round_ones, q) >= amount * (1.0 - DEFAULT.requirement)
        if shown or all(own.motion.shifts for own in problems):  # of which facets tell nothing
            return shown
    own, weights = problems[0].amount, problems[0].weights
    if own != "weighted":
        if q is None:
            return False
        far = hypot(*(weights * np.abs(problems[0].limits).max(axis=1)))
        near = np.abs(weights * q).max() * np.array(BOXES)
        near = near if isinstance(own, OwnAmount) else near[:0]
        held = [half for half in near if least_outside(own, weights, half) >= amount * (1.0 - DEFAULT.requirement)]
        if any(only_motion(problems, q, half) for half in (far, *held)):
            return True
        low, high = 0.0, min(held, default=0.0)  # the least box outside of which all cost as much
        for _ in range(HALVED if held else 0):
            half = 0.5 * (low + high)
            enough = least_outside(own, weights, half) >= amount * (1.0 - DEFAULT.requirement)
            low, high = (low, half) if enough else (half, high)
        return bool(held) and none_smaller(problems, high * sqrt(len(weights)))
    unique = q is not None and hypot(*(problems[0].weights * q)) >= amount and only_motion(problems, q, amount)
    slack = DEFAULT.requirement * amount + max(problem.contact_slack for problem in problems)
    shown = unique or amount <= slack or none_smaller(problems, amount - slack)
    return shown or none_shorter(problems, amount - slack)


def _no_shorter_shift(problem: Problem, amount: float) -> bool:
    """Tell whether no shift of a smaller amount does, by the directions along which convex parts may be apart."""
    from fcdm_opt.proof.uniqueness import none_shorter

    known = isfinite(amount) and problem.amount == "weighted" and problem.motion.shifts and not problem.partial
    slack = DEFAULT.requirement * amount + problem.contact_slack
    return known and (amount <= slack or none_shorter((problem,), amount - slack))


def _out_of_touch(problem: Problem) -> float:
    """Return the weighted amount from which on shifts leave no contact of the two bodies; infinite if none is known."""
    if not problem.motion.shifts or problem.goal == FIT:
        return inf
    seeds = problem.movable.seed, problem.static.seed
    both = zip((problem.movable, problem.static), problem.target.tolist(), seeds, strict=True)
    away = sum(scale * float(np.linalg.norm(body.vertices - seed, axis=1).max()) for body, scale, seed in both)
    shares = np.linalg.svd(problem.motion.shift_vectors(*seeds) / problem.weights[:, None], compute_uv=False)
    far = 2.0 * (away + float(np.linalg.norm(seeds[0] - seeds[1])))
    return far / float(shares[-1]) if len(shares) == len(problem.weights) and shares[-1] > DEFAULT.nominal else inf


def _least_restoring(asked: Sequence[Problem], q: Array) -> float:
    """Return what shifts come to at least that restore contacts of true faces as this one does."""
    # the gap of a plane face is linear in shifts: all that close those of the faces that touch as drawn differ from
    # each other along these faces alone
    weights, rows = asked[0].weights, list[Array]()
    for own in asked:
        faces = [true_faces(body) for body in own.of_facets.bodies_made.values()]
        shifts = own.motion.shift_vectors(own.movable.seed, own.static.seed) / weights[:, None]
        for met in own.round_contacts:
            for side, patches, point in zip(faces, met.patches, met.points, strict=True):
                normals = [side.patches[k].gaps(point[None])[1][0] for k in patches if not side.is_round[k]]
                rows += [shifts @ n for n in normals if abs(n @ met.normal) > 1.0 - DEFAULT.nominal]
        for flat in flat_contacts(own):
            both = zip((flat.one, flat.two), own.bodies_made.values(), strict=True)
            rows += [shifts @ body.face_planes[0][rows_at(body, x)[0]] for x, body in both if x.kind == "F"]
    held = np.array(rows).reshape(-1, len(q))
    least = float(np.linalg.norm(np.linalg.pinv(held, rcond=DEFAULT.nominal) @ (held @ (weights * q))))
    found = restoring_motion(asked)  # with what keeps axes of parallel cylinders apart
    return least if found is None else max(least, found.bound)


def without_evidence(solution: Solution | AssemblySolution) -> str:
    """Return why the bound of a solution that was to be certified carries no evidence, in words; "" where it does."""
    # what several contacts are bounded by is its own evidence, where it is proved anew
    if solution.amount == 0.0:
        return ""
    if isinstance(solution, AssemblySolution):
        from fcdm_opt.judge.placed_parts import shared_proofs

        short = [check.name.removeprefix(PROOF) for check in shared_proofs(solution) if not check.passed]
        texts = [f"of {name}: {NOT_BY_EQUATIONS}" for name in short]
        for pair, own in zip(solution.assembly.contacts, solution.contacts, strict=False):
            if own.problem.motion == solution.assembly.motions.get(pair.one) and (why := without_evidence(own)):
                texts.append(f"of {pair}: {why}")
        return "; ".join(texts)
    solution = solution.reformulated
    problem = solution.problem
    known = solution.evidence is not None or (problem.contacts and all(own.passed for own in proof_checks(solution)))
    return "" if known or _no_shorter_shift(problem, solution.lower_bound) else _unproved(solution)


def _unproved(solution: Solution) -> str:
    """Return why there is no evidence of a solution's bound, in words."""
    more = "a closed form, or the distance of the parts, shows more than a search over cells of motions"
    return _without_cells(solution.problem) or more


def _without_cells(problem: Problem) -> str:
    """Return why no cells of motions can be evidence of bounds, in words; "" where they can."""
    for holds, why in (
        (bool(problem.contacts), NOT_BY_EQUATIONS),
        (problem.amount == "displacement", "cells of motions are of the weighted amount, or one given"),
        (len(problem.motion.names) > MOST_CHECKED, BY_MULTIPLIERS),
        (problem.partial, "of large meshes only parts within reach are looked at"),
    ):
        if holds:
            return why
    return ""


def _by_distance(solution: Solution) -> float:
    """Return an amount below which nothing closes, or opens, the gap of the parts made at rest: signed, by coal."""
    # it changes by no more than the largest displacement. With rounding; 0 where nothing is known of the amount
    problem = solution.problem
    wanted = {"touch", "clear"} & {problem.goal, problem.pair}
    known = problem.amount == "displacement" or (problem.amount == "weighted" and problem.motion.shifts)
    surfaces = kept_as_surface(*problem.active)
    if not wanted or not known or surfaces:
        return 0.0
    rate = 1.0
    if problem.amount == "weighted":
        directions = problem.motion.shift_vectors(problem.movable.seed, problem.static.seed)
        rate = float(np.linalg.norm(directions.T / problem.weights, 2))
    scaled = scaled_pair(problem.movable, problem.static)
    gap = judged_gaps(scaled, problem.target[None], np.eye(4), problem.contact_slack)[0]
    need = max(problem.clearance - gap, 0.0) if "clear" in wanted else abs(gap)
    return (need + problem.contact_slack) / rate if need > 0.0 else 0.0


def _well_formed(solution: Solution) -> Check:
    """Check that every claim is of finite numbers in its shape, and every feature a feature."""
    claims: tuple[tuple[Any, tuple[int, ...]], ...] = (
        (solution.rho, (2,)),
        (solution.transform, (4, 4)),
        (solution.pair, (2,)),
        *((x, ()) for x in (solution.pair_gap, solution.amount, solution.lower_bound, *solution.parameters.values())),
    )
    wrong = sum(not isinstance(feature, Feature) for feature in solution.features)
    wrong += sum(not _finite(claim, shape) for claim, shape in claims)
    wrong += sum(not bound >= 0.0 for bound in (solution.lower_bound, solution.unique_within))
    return _at_most("finite numbers", wrong, 0, "claims that are not finite numbers of their shape, or bounds below 0")


def _finite(claim: Any, shape: tuple[int, ...]) -> bool:
    if type(claim) is float:
        return not shape and isfinite(claim)
    try:
        numbers = np.asarray(claim, dtype=np.float64)
    except (TypeError, ValueError):
        return False
    return numbers.shape == shape and bool(np.isfinite(numbers).all())


def left_by_mesh(solution: Bounded, bodies: Sequence[Body], slack: float) -> list[Check]:
    """Check that the amounts that a mesh leaves open have the one found among them; nothing where that is all."""
    # bodies whose faces are as drawn leave nothing open, and of those that only come near the solid it is not known. A
    # motion that leaves the fit is no answer: what smaller bodies need may be more, or infinitely much
    low, amount, high = solution.amount_low, solution.amount, solution.amount_high
    if isnan(low) and isnan(high):
        return []
    errors = [facet_errors(body) for body in bodies]
    known = all(own is not None for own in errors)
    if known and low == amount == high:
        return []
    if solution.status is Status.OUTSIDE_FIT:
        amount = inf
    off = 0.0 if 0.0 <= low <= amount <= high else float(np.max([low - amount, amount - high, -low]))
    note = f"left open by the mesh: {low:.6g} to {high:.6g}"
    if not any(own is None or own.any() for own in errors):
        off, note = float(np.max([abs(low - amount), abs(high - amount)])), f"{note}, of plane faces"
    elif not known:
        off, note = nan, f"{note}, of parts that come near the solid, by how much is not known"
    return [_at_most("amount the mesh allows", off, slack, note)]


def _at_most(name: str, value: float, limit: float, note: str = "") -> Check:
    """Return a check that passes where value <= limit; nan never does."""
    return Check(name, bool(value <= limit), float(value), float(limit), note)


def _at_least(name: str, value: float, limit: float, note: str = "") -> Check:
    return Check(name, bool(value >= limit), float(value), float(limit), note)


def _named(feature: Feature | None) -> Any:
    """Return a name of the feature that does not depend on the order in which its vertices are listed."""
    return feature and tuple((element.kind, frozenset(element.vertices)) for element in (feature.one, feature.two))


def _pair(scales: Array) -> str:
    return "({:.6g}, {:.6g})".format(*scales.tolist())


def _across(gradients: Array) -> Array:
    """Return the direction that rises most along the gradient it rises least along: in the middle of all of them."""
    angles = np.sort(np.arctan2(gradients[:, 1], gradients[:, 0]))
    free = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    widest = int(free.argmax())  # they lie in what is left of the circle
    middle = angles[widest] + free[widest] / 2.0 + np.pi
    return np.array([np.cos(middle), np.sin(middle)])


def _or_inf(values: Any) -> Array:
    """Return values with infinity for nan, which no check passes."""
    return np.where(np.isnan(values), np.inf, values)


@lru_cache(maxsize=SWEPT)
def _swept(keep_out: KeepOut) -> Body:
    """Return what the parts of a keep-out sweep over its range: of a convex part the hull of both ends."""
    body, (low, high) = keep_out.body, keep_out.ends
    arms = [part.vertices - body.seed for part in body.parts]
    hulls = [Body.convex(body.seed + np.vstack([low * x, high * x]), seed=body.seed).parts[0] for x in arms]
    return replace(body, parts=tuple(hulls))


def judged_gaps(scaled: ScaledPair, pairs: Array, transform: Array, limit: float) -> list[float]:
    """Return signed distances by coal, confirmed by explicit vertices; exact arithmetic where they disagree."""
    # at several scale pairs, (k, 2), after one motion
    poses = np.repeat(transform[None], len(pairs), axis=0)
    found, separations = (own.tolist() for own in scaled.distances_and_separations(pairs, poses))
    for k, (gap, separation) in enumerate(zip(found, separations, strict=True)):
        if isnan(gap):
            found[k] = separation
        elif separation > gap + limit or (gap > separation + limit and not separation > 0.0):
            found[k] = scaled.exact_separation(pairs[k], transform)
    return list(found)


def solids_gap(movable: Body, static: Body, rho: Array, transform: Array, limit: float) -> float:
    """Return the signed distance of two solids: minus their depth where they overlap."""
    # whether surfaces do is told by the parts near each other, and by what winds round what
    if not kept_as_surface(movable, static):
        return judged_gaps(scaled_pair(movable, static), rho[None], transform, limit)[0]
    one, two, outside = WholeSurfaces(movable, static, rho, transform).looked_at()
    gap = judged_gaps(scaled_pair(one, two), rho[None], transform, limit)[0]
    if outside.inside or gap < -limit:
        return min(gap, -PlacedSolids(movable, static, rho, transform).depth)
    return min(gap, outside.distance) if outside.distance > limit else gap


def true_gap(bodies: Sequence[Body], scales: Sequence[float] | Array, transform: Array, near: float) -> float:
    """Return the gap of two bodies on their true faces; infinite where it is more than `near`, or all are plane."""
    if not any(map(round_surfaces, bodies)):
        return inf
    band = near + 2.0 * sum(max(deviation_of(body)) * scale for body, scale in zip(bodies, scales, strict=True))
    return gap_of_true_faces([*map(true_faces, bodies)], scales, transform, band)


def keep_out_check(
    keep_out: KeepOut, movable: Body, own: float, transform: Array, limit: float, tolerances: Tolerances
) -> Check:
    """Check that a part made, at its scale and after its motion, keeps clear of a body at every scale of its range."""
    body, (low, high) = keep_out.body, keep_out.ends
    filled = _swept(keep_out) if low < high else body  # what the body fills at all its scales
    whole, pairs = scaled_pair(movable, filled), np.array([[own, 1.0 if low < high else low]])
    here = transform[None]
    bound, gaps = whole.lower_bounds(pairs, here), _asked_gaps(whole, pairs, here).tolist()
    if not (bound[0] >= keep_out.clearance and gaps[0] >= bound[0] - limit):  # explicit vertices do not agree
        gaps = judged_gaps(whole, pairs, transform, limit)
        if low < high:
            scales = np.linspace(low, high, tolerances.scale_points)
            each = np.column_stack([np.full(len(scales), own), scales])
            gaps += judged_gaps(scaled_pair(movable, body), each, transform, limit)
    if kept_as_surface(movable, body):
        scales = np.linspace(low, high, tolerances.scale_points if low < high else 1)
        gaps += [solids_gap(movable, body, np.array([own, scale]), transform, limit) for scale in scales]
    most = max(limit, tolerances.tie * body.size)
    note = f"least distance over the scales {low:g} to {high:g}" if low < high else f"at scale {low:g}"
    return _at_least(kept_clear(keep_out.name), min(gaps), keep_out.clearance - most, note)


def _asked_gaps(scaled: ScaledPair, pairs: Array, poses: Array, settled: Flags | None = None) -> Array:
    """Return signed distances by coal; where it cannot tell, by explicit vertices; nan for scales that are none."""
    gaps = scaled.signed_distances(pairs, poses, settled=settled)
    lost = np.isnan(gaps)
    if lost.any():
        gaps[lost] = scaled.least_separations(pairs[lost], poses[lost])
    return gaps


class _Side(NamedTuple):
    """How a part pair opens and closes across a contact line."""

    step: Array  # the change of the scales
    before: float  # the pair's gap before and after it
    after: float
    least: float  # what these must exceed
    snug: bool = False  # no change of the scales makes the parts overlap


class _Judge:
    """One solution under examination; each stage returns its checks."""

    def __init__(self, solution: Solution, tolerances: Tolerances) -> None:
        assert solution.rho is not None
        assert solution.transform is not None
        self.solution, self.problem, self.tolerances = solution, solution.problem, tolerances
        self.rho, self.transform = (np.array(own, dtype=np.float64) for own in (solution.rho, solution.transform))
        self.q = np.array(list(solution.parameters.values()), dtype=np.float64)
        self.size = self.problem.size
        self.limit = self.problem.contact_slack
        bodies, drawn = self.problem.active, (self.problem.movable, self.problem.static)
        self.outside: Outside | None = None
        if kept_as_surface(*bodies):
            *near, self.outside = WholeSurfaces(*drawn, self.problem.target, self.transform).looked_at()
            if not (self.problem.goal in TRACKING or self.problem.contacts):  # else others may be near, or open
                bodies = near[0], near[1]
        self.bodies = bodies
        self.scaled = scaled_pair(*bodies)
        carried = carriers(*bodies)
        self.claims = [Claim(feature, carried, self.scaled, self.rho, self.transform) for feature in solution.features]
        pairs = [self.rho] if (self.rho == self.problem.target).all() else [self.rho, self.problem.target]
        gaps = self._gaps(np.array(pairs))
        self.gap, self.pair_gap = gaps[0], gaps[-1]
        if self.outside is not None and (self.outside.inside or self.pair_gap < -self.limit):
            self.pair_gap = min(-PlacedSolids(*drawn, self.problem.target, self.transform).depth, self.pair_gap)

    # ------------------------------------------------------------------------------------------------------ stages

    def motion(self) -> list[Check]:
        """Check that transform, parameters, limits and amount agree with each other."""
        T, problem, solution = self.transform, self.problem, self.solution
        if not self._known:
            names = ", ".join(problem.motion.names)
            return [_at_most("parameters", float("nan"), 0, f"the motion has {names}")]
        try:
            between = T - problem.motion.transform(self.q, problem.movable.seed, problem.static.seed)
        except InputError:  # a screw whose axis has vanished on the way
            between = np.full((4, 4), np.nan)
        apart = problem.movable.vertices @ between[:3, :3].T + between[:3, 3]
        off = np.sqrt((apart * apart).sum(axis=1).max())
        amount, (skew, determinant) = self._amount(), skewness(T)
        slack = self.tolerances.requirement * amount + self.tolerances.line * problem.length
        ranges = zip(problem.weights.tolist(), self.q.tolist(), problem.limits.tolist(), strict=True)
        excess = max(weight * max(low - x, x - high) for weight, x, (low, high) in ranges)
        return [
            _at_most("rigid transform", max(skew, 1.0 - determinant), self.tolerances.rigid),
            _at_most("transform of parameters", off, self.limit, "largest displacement of a vertex between the two"),
            _at_most("amount", abs(amount - solution.amount), slack),
            _at_most("lower bound", solution.lower_bound - amount, slack, "the bound must not exceed the amount"),
            _at_most("limits", max(0.0, excess), self.tolerances.requirement * problem.length),
            *left_by_mesh(solution, problem.of_facets.bodies, slack),
            *self._whole_steps(),
        ]

    def _amount(self) -> float:
        """Return the amount of the claimed motion, by the problem's own measure."""
        problem = self.problem
        if isinstance(problem.amount, OwnAmount):
            return float(problem.amount.function(self.q))
        if problem.amount == "displacement":
            drawn = np.concatenate([part.vertices for part in problem.movable.parts])
            made = problem.movable.seed + problem.target[0] * (drawn - problem.movable.seed)
            apart = made @ self.transform[:3, :3].T + self.transform[:3, 3] - made
            return float(np.sqrt((apart * apart).sum(axis=1).max()))
        return hypot(*(problem.weights * self.q).tolist())

    def _whole_steps(self) -> list[Check]:
        steps = self.problem.resolution
        if steps is None:
            return []
        counts = self.q[steps > 0] / steps[steps > 0]
        off = np.abs(counts - np.round(counts)) / np.maximum(np.abs(counts), 1.0)
        return [_at_most("whole steps", off.max(), self.tolerances.requirement, "of the resolution, relative")]

    @cached_property
    def _play(self) -> float:
        """The length by which a motion in whole steps may miss what is an equation; the slack without steps."""
        return max(self.limit, self.problem.play(self.q)) if self._known else self.limit

    def requirement(self) -> list[Check]:
        """Check that the tracked pair is where the goal wants it."""
        goal, target, slack = self.problem.goal, self.problem.target, self.tolerances.requirement
        if goal == "beyond":
            missing = (self.problem.signs * (target - self.rho) / target).max()
            return [_at_most("requirement", missing, slack, "relative distance short of the target's quadrant")]
        if goal in ("at", "seat") and self._play > self.limit:
            claims = self._listed if self._several else self.claims
            lines = np.array([claim.lines(self.transform[None])[0] for claim in claims])
            missing = np.abs(lines[:, 2] - lines[:, :2] @ target).max() if len(lines) else np.nan
            return [_at_most("requirement", missing, self._play, "of the contact lines, to within the steps' play")]
        off = np.abs(self.rho / target - 1).max()
        fits = self._fits() if goal == FIT else []
        return [_at_most("requirement", off, slack, "relative distance from the target pair"), *fits]

    @cached_property
    def _listed(self) -> list[Claim]:
        carried = carriers(*self.bodies)
        return [Claim(feature, carried, self.scaled, self.rho, self.transform) for feature in self.problem.contacts]

    def _fits(self) -> list[Check]:
        """Check that none of the listed contacts overlaps and, of motions that only shift, that none are less open."""
        # gaps along the contacts' own normals; the least of all largest ones by a linear program of the judge's own. It
        # knows nothing of keep-outs: where one holds the motion off, it tells nothing
        from scipy.optimize import linprog

        problem = self.problem
        rows = np.array([claim.rows(self.transform[None])[0] for claim in self._listed])
        gaps = rows[:, 5] - rows[:, 3:5] @ self.rho
        checks = [_at_least("contacts not overlapping", gaps.min(), -self.limit, "least gap of those listed")]
        nearest = [check.value - own.clearance for own, check in zip(problem.keep_out, self.scene(), strict=True)]
        if problem.motion.shifts and self._known and min(nearest, default=np.inf) > DEFAULT.active * problem.size:
            directions = problem.motion.shift_vectors(problem.movable.seed, problem.static.seed)
            slopes, one = rows[:, :3] @ directions.T, np.ones((len(rows), 1))  # gaps fall along their normals
            program = linprog(
                [*np.zeros(len(self.q)), 1.0],
                A_ub=np.vstack([np.hstack([slopes, 0.0 * one]), np.hstack([-slopes, -one])]),
                b_ub=np.concatenate([gaps + slopes @ self.q, -gaps - slopes @ self.q]),
                bounds=[*problem.limits.tolist(), (0.0, None)],
            )
            least = float(program.fun) if program.status == 0 else float("nan")
            note = "no shift makes it less, other parts aside"
            checks.append(_at_most("largest gap least", gaps.max(), least + self._play, note))
        return checks

    def only_motion(self) -> list[Check]:
        """Check that no other motion restores several contacts in the box that is claimed: anew, in intervals."""
        claimed = self.solution.unique_within
        if claimed == 0.0:
            return []
        from fcdm_opt.proof.uniqueness import only_motion

        proved = only_motion((self.problem,), self.q, claimed)
        return [Check(ONLY, proved, claimed, claimed, "half width of the box of weighted parameters")]

    def contact(self) -> list[Check]:
        """Check that the tracked pair touches, by the claimed features, the nominal ones where those are tracked."""
        gap, claimed = self.gap, len(self.claims)
        distinct = len({_named(claim.feature) for claim in self.claims})
        stepped = self._play > self.limit
        apart = self.problem.goal in ("clear", FIT) or (stepped and (self.problem.goal == "touch" or self._several))
        if apart and not claimed and not abs(gap) <= self.limit:
            return []
        both = (self.problem.movable, "one"), (self.problem.static, "two")
        foreign = sum(not body.owns(getattr(own, name)) for own in self.solution.features for body, name in both)
        checks = [
            _at_most("touching", abs(gap), self.limit, "distance or overlap"),
            Check("features", 1 <= claimed == distinct, distinct, claimed, "each contact feature once, at least one"),
            _at_most("own elements", foreign, 0, "claimed elements that only cuts between the parts have"),
        ]
        if self.problem.goal in TRACKING:
            own = self.problem.tracked_features
            tracked, allowed = ({_named(feature) for feature in some} for some in (self.solution.features, own))
            most = len(own) if self.problem.goal == "seat" or self.problem.contacts else min(2, len(own))
            known = tracked <= allowed and (len(tracked) == most or (stepped and self._several))
            checks.append(Check("nominal features", known, claimed, most, ", ".join(map(str, own))))
        for k, claim in enumerate(self.claims, 1):
            error = claim.errors(self.rho[None], self.transform[None])[0]
            checks.append(_at_most(f"contact {k}", error, self.limit, f"{claim.feature}: distance from being one"))
        return checks

    @property
    def _several(self) -> bool:
        """Whether several contacts are restored together: in whole steps each to within their play, and open."""
        return bool(self.problem.contacts)

    def sides(self) -> list[Check]:
        """Check that each contact opens on one side of its line and overlaps on the other, by parts that carry it."""
        # other parts may close where these open: that they do not overlap where they are is checked there. But a goal
        # that tracks no contact has all of them claimed: what touches besides must open with one of the claimed
        if not self.claims:
            return []
        sides = [side for claim in self.claims if (side := self._side(claim)) is not None]
        if not sides:
            return [_at_most("sides", 0, 0, "no change of the scales opens or closes the contact")]
        below = [(side.before, side.least, side.step) for side in sides]
        below += [(gap, -self.limit, step) for gap, step in self._unclaimed([side.step for side in sides])]
        above = [(side.after, -side.least, side.step) for side in sides if not side.snug]
        return [
            self._worst("apart below", [(gap, least, -step, gap > least) for gap, least, step in below]),
            self._worst("overlapping above", [(gap, most, step, gap < most) for gap, most, step in above])
            if above
            else _at_most("snug", 0.0, np.inf, "no change of the scales leaves all contact lines on one side"),
        ]

    @staticmethod
    def _worst(name: str, found: list[tuple[float, float, Array, bool]]) -> Check:
        """Return a check of gaps against their limits: of the first that fails, or else of the first."""
        gap, limit, step, _ = next((own for own in found if not own[-1]), found[0])
        return Check(name, all(own[-1] for own in found), gap, limit, f"with the scales changed by {_pair(step)}")

    def _side(self, claim: Claim) -> _Side | None:
        """Return how a claim's part pair opens and closes across its line; None where no scales change it."""
        # a plane through both seeds is in contact at all scales
        line = claim.lines(self.transform[None])[0]
        flat = self.tolerances.determinant * self.size
        if np.hypot(line[0], line[1]) <= flat:
            return None
        own = self.scaled if claim.parts is None else self.scaled.between(*claim.parts)
        step = self._step(line[None, :2], line[:2])
        least = min(self.limit, float(line[:2] @ step) / 2.0)
        before, after = self._gaps(np.array([self.rho - step, self.rho + step]), own)
        if self.outside is not None and not after < -least:  # one facet's pyramid slips past what the next one meets
            after = min(after, *self._gaps((self.rho + step)[None]))
        if after < -least:
            return _Side(step, before, after, least)
        for share in np.geomspace(0.1, self.tolerances.finer, FINER):
            nearer, small = share * step, min(self.limit, share * float(line[:2] @ step) / 2.0)
            gaps = self._gaps(np.array([self.rho - nearer, self.rho + nearer]), own)
            if gaps[1] < -small:
                return _Side(nearer, gaps[0], gaps[1], small)
        # vertices and parallel edges meet along more lines than the one claimed; others are nearer than the step
        for slack in (float(np.abs(step) @ own.reaches), self.limit):
            more = own.gradients(self.rho, self.transform, slack)
            steep = np.hypot(more[:, 0], more[:, 1]) > flat
            if not steep.all():
                return _Side(step, before, after, least, snug=True)  # beside a plane that no change of the scales moves
            upward = _across(more) if len(more) else np.zeros(2)
            if len(more) and (more @ upward).min() > flat:
                step = self._step(more, upward)
                before, after = self._gaps(np.array([self.rho - step, self.rho + step]), own)
                return _Side(step, before, after, least)
        return _Side(step, before, after, least, snug=bool(len(more)))

    def _step(self, gradients: Array, upward: Array) -> Array:
        """Return a small change of the scales by which all contact lines are crossed."""
        step = self.tolerances.side * self.size * upward / (gradients @ upward).min()
        return np.asarray(step * min(1.0, float((self.rho / (2.0 * np.abs(step))).min())))  # scales stay positive

    def _unclaimed(self, steps: list[Array]) -> list[tuple[float, Array]]:
        """Return how far each part pair that touches and carries no claim opens at most, with the claimed ones."""
        # where a claimed one touches beyond doubt, so must these: on a thread dozens are near, each at another step of
        # the scales. None where a goal tracks some of the contacts that there are
        if self.problem.goal in TRACKING or self.scaled.count == 1:
            return []
        here = self.rho[None], self.transform[None]
        errors = {parts: error[0] for claim in self.claims for parts, error in claim.proofs(*here)}
        proved = {parts for parts, error in errors.items() if error <= self.limit}
        tight = min(errors.values(), default=np.inf) <= self.limit * self.tolerances.tight
        near = self.limit / 2.0 * (self.tolerances.tight if tight else 1.0)
        touching = self.scaled.touching(self.rho, self.transform, near)
        return [self._opened(self.scaled.between(*parts), steps) for parts in touching if parts not in proved]

    def _opened(self, own: ScaledPair, steps: list[Array]) -> tuple[float, Array]:
        """Return how far a part pair opens at the first step that does, or else at best, and that step."""
        here = self.transform[None]
        for step in steps:
            gap = own.lower_bounds((self.rho - step)[None], here)[0]
            if gap > -self.limit:  # a face's normal shows it: nearly always the first
                return float(gap), step
        gaps = np.nan_to_num(self._gaps(self.rho - np.array(steps), own), nan=-np.inf)
        return float(gaps.max()), steps[int(gaps.argmax())]

    def path(self) -> list[Check]:
        """Check that the tracked features stay the real contact along the straight ray of the parameters."""
        if self.problem.goal not in TRACKING or self.problem.path != "coherent" or not self.claims:
            return []
        s, poses, pairs = self._path_samples
        start = np.abs(pairs[0] / self.problem.nominal_pair - 1).max()
        proofs = [claim.proofs(pairs, poses) for claim in self.claims]
        errors = np.maximum.reduce([least_errors(own, len(s)) for own in proofs])
        # by coal; between the points at which coal is asked about all part pairs, those whose claims prove that they
        # touch are left out
        counts = (len(body.parts) for body in self.bodies)
        settled, least = np.zeros((len(poses), *counts), dtype=np.bool_), np.full(len(poses), np.inf)
        for (i, j), off in (proof for own in proofs for proof in own):
            settled[:, i, j] |= off <= self.limit
            least = np.minimum(least, off)
        settled[np.linspace(0, len(poses) - 1, self.tolerances.path_asked).round().astype(int)] = False
        gaps = _asked_gaps(self.scaled, pairs, poses, settled)
        gaps = np.where(settled.any(axis=(1, 2)), np.maximum(-gaps, least), np.abs(gaps))
        worst = [int(_or_inf(x).argmax()) for x in (errors, gaps)]
        return [
            _at_most("path starts at the nominal", start, self.tolerances.nominal, "relative distance of the scales"),
            _at_most("path features", errors[worst[0]], self.limit, f"worst at {s[worst[0]]:.6g} of the motion"),
            _at_most("path touching", gaps[worst[1]], self.limit, f"worst at {s[worst[1]]:.6g} of the motion"),
        ]

    def seats(self) -> list[Check]:
        """Check that flush contacts are aligned and share more than a point: at the end, and on the way if asked."""
        if self.problem.goal != "seat":
            return []
        seats = self.problem.nominal_seats
        kinds = {_named(name): flush.dimension for flush in seats for name in (flush.feature, flush.touching)}
        claims = {k: claim for k, claim in enumerate(self.claims, 1) if _named(claim.feature) in kinds}
        if not claims:
            return [_at_most("seat", float("nan"), 0, "no flush contact is claimed")]
        least = self.tolerances.shared * min(self.problem.movable.size, self.problem.static.size) / 2.0
        s, poses, pairs = self._path_samples
        checks = []
        for k, claim in claims.items():
            size = kinds[_named(claim.feature)]
            what = "length" if size == 1 else "width"
            off, *shared = claim.flush(self.rho[None], self.transform[None])[0]
            checks += [
                _at_most(f"seat {k} aligned", off, self.limit, f"{claim.feature}: vertices' distance from one plane"),
                _at_least(f"seat {k} shared", shared[size - 1], least, f"{claim.feature}: {what} of what they share"),
            ]
            if self.problem.path == "coherent":
                off, *shared = claim.flush(pairs, poses).T
                worst, narrowest = int(_or_inf(off).argmax()), int(shared[size - 1].argmin())
                at = [f"worst at {s[worst]:.6g} of the motion", f"{what}, least at {s[narrowest]:.6g} of the motion"]
                checks += [
                    _at_most(f"path seat {k} aligned", off[worst], self.limit, at[0]),
                    _at_least(f"path seat {k} shared", shared[size - 1][narrowest], least, at[1]),
                ]
        return checks

    def true_faces(self) -> list[Check]:
        """Check that the faces that facets stand for are no nearer than is asked, nor than is claimed."""
        # overlaps that are claimed are those of the target pair, see `pair`; what leaves the fit is no answer
        problem, claimed = self.problem.of_facets, self.solution.pair_gap
        bodies, others = (problem.movable, problem.static), [own.body for own in problem.keep_out]
        known = self.solution.pair_state == "overlapping" or self.solution.status is Status.OUTSIDE_FIT
        if known or not any(map(round_surfaces, (*bodies, *others))):
            return []
        need = problem.clearance if "clear" in (problem.goal, problem.pair) else 0.0
        off = sum(max(deviation_of(own)) * scale for own, scale in zip(bodies, problem.target.tolist(), strict=True))
        room = off if self.problem.exact_at is None else 0.0  # of distances that facets tell
        near = max(need, min(claimed, AS_FAR * off)) + self.limit
        gap = true_gap(bodies, problem.target, self.transform, near)
        note = "least gap of the faces that facets stand for, on points of these"
        found = [_at_least(TRUE_FACES, gap, need - self.limit, note)]
        if claimed > self.limit:
            found.append(_at_least("true pair gap", gap, min(claimed, near) - room - self.limit, note))
        if "touch" in (problem.goal, problem.pair):
            found.append(_at_most("true faces touching", gap, room + self._play, note))
        if (asked := problem.restoring) is not None:
            again = "round faces that touch as drawn touch again"
            found.append(_at_least("contacts restored", float(restores(asked, self.transform)), 1.0, again))
            if asked.tracked_features and asked.path == "coherent":
                (s, poses), start = (own[FEW] for own in self._ray), problem.nominal_pair
                scales = start + s[:, None] * (problem.target - start)
                gap = min(true_gap(bodies, *own, self.limit) for own in zip(scales, poses, strict=True))
                found.append(_at_least("path true faces", gap, -self.limit, note))
        for keep_out in problem.keep_out:
            bodies, need = (problem.movable, keep_out.body), keep_out.clearance
            scales = np.unique(np.linspace(*keep_out.ends, self.tolerances.scale_points)).tolist()
            pairs = [(float(problem.target[0]), scale) for scale in scales]
            gap = min(true_gap(bodies, own, self.transform, need + self.limit) for own in pairs)
            found.append(_at_least(f"true faces, keep-out '{keep_out.name}'", gap, need - self.limit, note))
        return found

    def pair(self) -> list[Check]:
        """Check the state and gap of the parts actually made."""
        solution, problem = self.solution, self.problem
        off = np.abs(solution.pair / problem.target - 1).max()
        gap = self.pair_gap
        state = self._state(gap)
        claimed = solution.pair_gap
        wrong = abs(claimed - gap)
        note = f"claimed {number_text(claimed)}, distance or minus depth {number_text(gap)}"
        if gap > 0 and claimed < gap and self._state(claimed) == state:  # a separation, no more than the distance
            wrong = max(0.0, self.scaled.separation_by_faces(problem.target, self.transform, claimed) - claimed)
        checks = [
            self._sizes_asked(),
            _at_most("target pair", off, self.tolerances.requirement, "relative distance from the problem's target"),
            Check("pair state", solution.pair_state == state, gap, self.limit, f"is {state}"),
            _at_most("pair gap", wrong, self.limit, note),
            self._status(state),
        ]
        if self.outside is not None:
            least, inside = max(gap, 0.0) - self.limit, self.outside.inside * (solution.pair_state != "overlapping")
            note = "closed surfaces that lie inside the other body, not claimed to overlap it"
            checks += [
                _at_least("whole surfaces", self.outside.distance, least, "distance of those that are not looked at"),
                _at_most("inside", inside, 0, note),
            ]
        if "touch" in (problem.pair, problem.goal):
            near = _at_most("pair touches", abs(gap), self.limit)
            if gap > 0 and self._play > self.limit:  # in whole steps
                near = _at_most("pair touches", gap, self._play, "to within the steps' play, not overlapping")
            checks.append(near)
        if "clear" in (problem.pair, problem.goal):
            checks.append(_at_least("clearance", gap, problem.clearance - self.limit))
        return checks

    def _sizes_asked(self) -> Check:
        """Check that the problem's target is that of the question as it was put."""
        # a nominal pair may be moved to a switching point that it is within rounding of, and where a goal tracks its
        # contact by `snap` of each scale
        problem, request = self.problem, self.problem.request
        asked, limit = request["target"], self.tolerances.requirement
        if asked is None:
            nominal, limit = request["nominal"], self.tolerances.nominal
            if isinstance(nominal, int):
                nominal = problem.curve.switching_points[nominal - 1].rho
            elif problem.goal in TRACKING:
                limit = max(limit, problem.snap)
            nominal = (1.0, 1.0) if isinstance(nominal, str) else nominal
            shares, letter = np.array(request["tolerance"], dtype=np.float64), request["requirement"]
            (less, more), (fewer, greater) = np.broadcast_to(shares[:, None] if shares.ndim == 1 else shares, (2, 2))
            off = more if letter in "AB" else -less, greater if letter in "AC" else -fewer
            asked = np.array(nominal) * (1.0 + np.array(off))
        most = np.abs(problem.target / asked - 1.0).max()
        note = f"relative, from {_pair(np.array(asked))}"
        return _at_most("sizes asked", most, limit + self.tolerances.requirement, note)

    def scene(self) -> list[Check]:
        """Check that the part made keeps clear of each keep-out, at every scale of its range."""
        own, scale = self.problem.active[0], float(self.problem.target[0])
        return [
            keep_out_check(keep_out, own, scale, self.transform, self.limit, self.tolerances)
            for keep_out in self.problem.keep_out
        ]

    # ------------------------------------------------------------------------------------------------------- parts

    @cached_property
    def _known(self) -> bool:
        """Whether the parameters are those of the motion."""
        return tuple(self.solution.parameters) == self.problem.motion.names

    @cached_property
    def _path_samples(self) -> tuple[Array, Array, Array]:
        """Positions on the straight ray of the parameters, and the pose and tracked scale pair at each."""
        return *self._ray, self._tracked(*self._ray)

    @cached_property
    def _ray(self) -> tuple[Array, Array]:
        """Positions on the straight ray of the parameters, and the pose at each."""
        problem = self.problem
        turned = sum(abs(x) for x, turns in zip(self.q.tolist(), problem.motion.turning, strict=False) if turns)
        count = max(self.tolerances.path_points - 1, int(np.ceil(min(turned, MOST_TURNED) / self.tolerances.path_turn)))
        s = np.concatenate([[0.0], (np.arange(count) + 0.5) / count, [1.0]])  # between those that the solver looks at
        poses = np.full((len(s), 4, 4), np.nan)
        if self._known:  # a screw whose axis has vanished on the way has no pose there: nan too
            poses = problem.motion.kinematics(problem.movable.seed, problem.static.seed).transforms(s[:, None] * self.q)
        return s, poses

    def _gaps(self, pairs: Array, scaled: ScaledPair | None = None) -> list[float]:
        """Return `judged_gaps` after the motion, of the problem's two bodies or of another pair."""
        return judged_gaps(scaled or self.scaled, pairs, self.transform, self.limit)

    def _state(self, gap: float) -> str:
        if np.isnan(gap):
            return "unknown"
        return "touching" if abs(gap) <= self.limit else "apart" if gap > 0 else "overlapping"

    def _status(self, state: str) -> Check:
        """Check that the status says what was found: how the pair is, and whether the motion leaves the fit."""
        status, outside = self.solution.status, outside_fit(self.solution)
        expected = {
            Status.SOLVED: state != "overlapping",
            Status.PAIR_OVERLAPS: state == "overlapping",
            Status.ALREADY_SATISFIED: not self.q.any(),
            Status.NOT_VERIFIED: False,  # which is said of what fails
        }
        agrees = expected.get(status, True) and outside is (status is Status.OUTSIDE_FIT)
        where = "leaves" if outside else "stays in"
        note = f"{status.name}, the pair is {state}, the motion {where} the fit"
        return Check("status", agrees, self.pair_gap, self.limit, note)

    def _tracked(self, s: Array, poses: Array) -> Array:
        """Return the tracked scale pair at each pose, (k, 2): where two lines meet, or the point of one line."""
        # a single line leaves one degree of freedom: its point nearest to the straight way from nominal to target
        leading = self.claims
        if len(leading) > (1 if self.problem.goal == "seat" else 2):
            own = {_named(feature) for feature in self.problem.nominal_features}
            leading = [claim for claim in self.claims if _named(claim.feature) in own] or self.claims
        lines = [claim.lines(poses) for claim in leading[:2]]
        if len(lines) == 2:
            (a, b, c), (d, e, f) = lines[0].T, lines[1].T
            determinant = a * e - b * d
            least = np.hypot(a, b) * np.hypot(d, e) * self.tolerances.determinant
            determinant[np.abs(determinant) <= least] = np.nan  # parallel
            return np.column_stack([(c * e - b * f) / determinant, (a * f - c * d) / determinant])
        ab, c = lines[0][:, :2], lines[0][:, 2]
        straight = self.problem.nominal_pair + s[:, None] * (self.problem.target - self.problem.nominal_pair)
        return straight + ((c - (ab * straight).sum(axis=1)) / (ab * ab).sum(axis=1))[:, None] * ab
