"""Goal and motion for parts as drawn: what the drawn contact asks for, and the motion that answers it best."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.drafting.situation import Situation
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.motion.motions import XYZ, AxisWord, Free, Motion, Translation
from fcdm_opt.problem.fit import misfit
from fcdm_opt.problem.problem import SIGNS, Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

TOLERANCE = 0.02
MOST_SIDES = 6  # ways that contacts face which are tried
MOST_PAIRS = 12  # of parts, with which the search for a tie stays short
SECONDS = 20.0  # after which nothing further is begun: a file may be edited, waiting may not
SHORT = 2.5  # seconds for one case of large meshes, or of parts whose widths do not go together
GOALS = {"touching": ("seat", "touch", "clear"), "apart": ("touch", "clear")}
Contacts = str | tuple[str, ...] | None
ANY_SHIFT = Translation("x") >> Translation("y") >> Translation("z")
FEW, ENOUGH = 6, 12  # digits of a direction; these, where those leave more than rounding open
NOISE = 1e-12  # relative: what is smaller is rounding, and is written as 0


@dataclass(frozen=True, eq=False)
class Choice:
    """A goal and a motion, and what they lead to.

    `solutions` are by requirement, None where it could not be asked; `contacts` are those that are restored together:
    "all", labels, or None for the nominal contact.
    """

    goal: str
    motion: Motion
    solutions: dict[str, Solution | None]
    contacts: Contacts = None

    @property
    def usable(self) -> dict[str, Solution]:
        """The solutions that are solved and verified, by requirement."""
        return {letter: answer for letter, answer in self.solutions.items() if answer is not None and answer.usable}

    @property
    def unfit(self) -> tuple[str, ...]:
        """Requirements of which no motion is a solution: the parts made do not go together."""
        known = ((letter, answer) for letter, answer in self.solutions.items() if answer is not None)
        return tuple(letter for letter, answer in known if not answer.usable and misfit(answer.problem) is not None)

    @property
    def settled(self) -> bool:
        """Whether all cases in which the parts go together are solved, and there are any: no other motion helps."""
        return bool(self.usable) and len(self.usable) + len(self.unfit) == len(SIGNS)

    @cached_property
    def tied(self) -> tuple[str, ...]:
        """Requirements that another motion answers as well, some way off; of bodies with many parts it is not asked."""
        return tuple(
            letter
            for letter, answer in self.usable.items()
            if answer.modelled.get("part_pairs_total", 0) <= MOST_PAIRS
            and not pacing.over()
            and any("another motion" in reason for reason in answer.sensitivity.reasons)
        )

    @property
    def axis(self) -> Array | None:
        """The one direction in which all translations found go, (3,); None where there are several, or none."""
        poses = [answer.transform for answer in self.usable.values()]
        moves = [pose[:3, 3] for pose in poses if pose is not None]
        longest = max(moves, key=lambda move: float(np.linalg.norm(move)), default=np.zeros(3))
        length = float(np.linalg.norm(longest))
        if not length > 0:
            return None
        axis: Array = longest / length
        aside = max(float(np.linalg.norm(move - (move @ axis) * axis)) for move in moves)
        return axis if aside <= DEFAULT.stationary * length else None


def chosen(situation: Situation) -> Choice:
    """Return the goal that the parts as drawn ask for, and the simplest motion that answers most of the four cases.

    Parts that touch at several places are to do so again, if shifts can bring that about in all cases in which the
    parts go together at all; else those of them that face one way are, by a shift that way, as a flange on its plate.
    Parts that touch flush are to stay so, others that touch are to touch, and so on. Another goal is taken only where
    that cannot be asked, or no case of it is solved: a case in which the parts do not fit is an answer, one for which
    no time was left is none. Translations along one axis come before those along three wherever they are as small, and
    rotations after both.
    """
    several = len(situation.places) > 1 and not situation.large
    for goal in ("seat", "at") if several else ():
        pacing.at(f'trying goal "{goal}" of all contacts together')
        every = _tried(situation, goal, ANY_SHIFT, "all")
        if every is not None and every.settled and (len(situation.sides) > 1 or not every.unfit):
            return every
    if (side := _on_one_side(situation)) is not None:
        return side
    found: Choice | None = None
    start = perf_counter()
    for goal in GOALS.get(situation.fit, ("clear", "touch")):
        if goal == "seat" and situation.on_round_face:
            continue  # it is about contacts as drawn, of facets
        best: Choice | None = None
        along = Translation(named(situation.normal))
        if situation.large:  # a motion across many faces is soon told along an axis
            along = Translation(XYZ[int(np.abs(situation.normal).argmax())])
        # what is flush stays so by a shift along its normal, if by any; turning large meshes takes long
        flush = goal == "seat" or situation.on_round_face
        shifts = (along, ANY_SHIFT) if flush else (ANY_SHIFT, along)
        for motion in shifts if situation.large else (*shifts, Free()):
            if best is not None and (perf_counter() - start > SECONDS or pacing.over()):
                break
            if best is not None and best.settled:
                break
            pacing.at(f'trying goal "{goal}" with the motion {", ".join(motion.names)}')
            tried = _tried(situation, goal, motion)
            if tried is None:
                break
            if best is None or (len(tried.usable), tried.settled) > (len(best.usable), best.settled):
                best = tried
        if best is not None and best.usable:
            return _simpler(situation, best)
        found = found or best
        if found is not None and (perf_counter() - start > SECONDS or pacing.over()):
            break
    assert found is not None  # "touch" and "clear" can be asked of any parts
    return found


def _on_one_side(situation: Situation) -> Choice | None:
    """Return the choice to seat those contacts again that face one way, None where none is solved.

    By a shift that way, or by any where that solves more cases, as where a hole and its pin grow apart sideways. A
    single contact that is the nominal one needs no name, but of large bodies, whose faces are of many pieces.

    A way on which each case in which the parts go together is solved is taken at once.
    """
    start = perf_counter()
    best: Choice | None = None
    labels = {feature: feature.described(situation.movable, situation.static) for feature in situation.contacts}
    sides = situation.sides[:MOST_SIDES] if len(labels) > 1 or situation.large else ()
    along = [(Translation(named(normal)), normal, features) for normal, features in sides]
    for motion, normal, features in (*along, *((ANY_SHIFT, *side) for side in sides)):
        if (best is not None and (best.settled or perf_counter() - start > SECONDS)) or pacing.over():
            break
        pacing.at(f"trying to seat what faces {named(normal)}")
        names = (labels[own] if list(labels.values()).count(labels[own]) == 1 else own.label for own in features)
        tried = _tried(situation, "seat", motion, tuple(names))
        if tried is not None and tried.usable and (best is None or len(tried.usable) > len(best.usable)):
            best = tried
    return best


def named(axis: Array) -> AxisWord | tuple[float, float, float]:
    """Return "x", "y" or "z" for a direction along that axis, either way, else its components, in few digits.

    They are in proportion to the largest, 1: of a slope they are those of its drawing.
    """
    k = int(np.abs(axis).argmax())
    others = math.hypot(*np.delete(axis, k).tolist())
    shares = axis / np.abs(axis[k])
    few = np.round(shares, FEW)
    shares = few if np.abs(few - shares).max() <= NOISE else np.round(shares, ENOUGH)
    x, y, z = np.where(np.abs(shares) <= DEFAULT.side, 0.0, shares).tolist()  # what a solution is known to
    return XYZ[k] if others <= DEFAULT.side else (x + 0.0, y + 0.0, z + 0.0)


def _simpler(situation: Situation, choice: Choice) -> Choice:
    """Return the choice with one axis in place of three where that costs nothing."""
    axis = choice.axis
    moves = any(answer.amount > 0 for answer in choice.usable.values())
    if len(choice.motion.steps) == 1 or (axis is None and moves):
        return choice
    less = _tried(situation, choice.goal, Translation(named(situation.normal if axis is None else axis)))
    return less if less is not None and len(less.usable) == len(choice.usable) else choice


def _tried(situation: Situation, goal: str, motion: Motion, contacts: Contacts = None) -> Choice | None:
    """Return what a goal and a motion lead to; None where it cannot be asked."""
    solutions: dict[str, Solution | None] = {}
    answer: Solution | None = None
    bodies = situation.movable, situation.static
    asked = {"goal": goal, "motion": motion, "tolerance": TOLERANCE, "unit": situation.unit}
    asked |= {"contacts": contacts} if contacts else {}
    for letter in SIGNS:
        if answer is not None and answer.stopped and pacing.over():
            solutions[letter] = answer  # no more could be said of this case
            continue
        try:
            with pacing.telling():
                problem = Problem(*bodies, box=situation.box, requirement=letter, **asked)  # type: ignore[arg-type]
            with pacing.sharing(1.0 / (len(SIGNS) - len(solutions))):
                tight = len(motion.names) > 1 and misfit(problem) is not None
                # what does not fit is found far away, if at all
                limit = SHORT if tight or (situation.large and motion == ANY_SHIFT) else SECONDS
                answer = solutions[letter] = solve(problem, effort="quick", time=limit)
            if contacts == "all" and not answer.usable and misfit(problem) is None:
                break  # all cases in which the parts fit are to be solved
        except InputError:
            solutions[letter] = None
            if goal == "seat" or contacts:
                return None  # the contact is not flush, or not of a kind for it: the same for all requirements
    return Choice(goal, motion, solutions, contacts)
