"""What is asked of two parts, and what else could be: goals, nominal contacts, motions and their limits."""

from __future__ import annotations

import math
from functools import reduce
from operator import rshift
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.drafting import remarks, writing
from fcdm_opt.drafting.choice import AXES, Choice, named
from fcdm_opt.drafting.situation import Situation, rounded
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.keys import Defaults
from fcdm_opt.problem.syntax import parsed
from fcdm_opt.tolerances import DEFAULT

MOST_POINTS = 8  # switching points that are listed
WHY = {
    "touch": "the parts made touch, by whatever features meet first",
    "clear": "the parts made are apart or just touch; with a line clearance = 0.1 besides, apart by at least that",
    "seat": "a flush contact, face on face or along an edge, stays flush",
    "at": "the same feature touches, at exactly the sizes made",
    "beyond": "the paper's: the switching point moves into the quadrant beyond the sizes made",
}


class GoalRow(NamedTuple):
    """A goal: what it means, what it needs, whether that is there, and whether the need is told where it is."""

    why: str
    need: str
    there: bool
    told: bool


def goals(situation: Situation) -> dict[str, GoalRow]:
    """Return all goals."""
    points = bool(situation.curve.switching_points)
    needs = {
        "seat": ("a flush nominal contact", situation.flush),
        "at": ("a nominal contact", situation.nearest is not None),
        "beyond": ("a nominal switching point", points),
    }
    rows = {}
    for goal, why in WHY.items():
        need, there = needs.get(goal, ("", True))
        told = bool(need) and not (situation.state == "touching" and goal != "beyond")
        rows[goal] = GoalRow(why, need, there, told)
    return rows


def nominal(situation: Situation) -> dict[str, Any]:
    """Return what the nominal contact could be besides "drawn": contacts near, switching points, a snap."""
    near = ((situation.nearest, "the contact nearest to drawn"), (situation.grown, "both scaled alike"))
    listed = situation.switching_points(MOST_POINTS)
    snap = 0.0
    if remarks.nearly(situation):
        moved = 0.0 if situation.nearest is None else float(np.abs(situation.nearest.pair - 1.0).max())
        snap = float(f"{2.0 * max(abs(situation.gap) / situation.size, moved):.1e}")
    return {
        "near": [row for row in near if row[0] is not None and situation.state != "touching"],
        "listed": listed,
        "more": len(situation.curve.switching_points) - len(listed),
        "snap": snap,
    }


def motions(situation: Situation, choice: Choice) -> list[tuple[str, Motion, str]]:
    """Return other motions than the one chosen: as written, themselves, and what they are."""
    k = int(np.abs(situation.normal).argmax())
    along, across = AXES[k], AXES[(k + 1) % 3]  # a turn about the normal itself would often change nothing
    turn = f'{{ rotation = "{across}", centre = "seed" }}'
    offset = situation.static.seed - situation.movable.seed
    distance = float(np.linalg.norm(offset))
    found = {
        f"[{{ translation = {writing.axis(named(situation.normal))} }}]": "along the contact normal",
        '[{ translation = "x" }, { translation = "y" }, { translation = "z" }]': "any shift",
        f'[{{ translation = "{along}" }}, {turn}]': "a shift, then a turn about the seed",
        f'[{{ rotation = "{across}", centre = [0.0, 0.0, 0.0] }}]': 'a turn about a point, "seed" or "origin"',
    }
    if distance > DEFAULT.seeds * situation.size:
        found[f"[{{ translation = {writing.axis(named(offset / distance))} }}]"] = "along the line of the seeds"
        found['[{ screw = "seeds", pitch_per_deg = 0.01 }]'] = "a screw along the line of the seeds"
    found["[{ free = true }]"] = "all six: any shift and any turn about the seed"
    found.pop(writing.motion(choice.motion), None)
    return [(text, _read(text), why) for text, why in found.items()]


def _read(text: str) -> Motion:
    entries = Defaults.model_validate(parsed(f"motion = {text}")).motion
    return reduce(rshift, (entry.step() for entry in entries))


def limits(situation: Situation, choice: Choice, motion: Motion) -> str:
    """Return limits of a motion that keep it short, but hold what was found to be needed."""
    shifts = [name for name, kind in choice.motion.parameters if kind == "translation"]
    found = [own.parameters for own in choice.solutions.values() if own is not None and own.usable]
    longest = max((abs(own[name]) for own in found for name in shifts), default=0.0)
    least = max(min(situation.movable.size, situation.static.size) / 2.0, longest)
    reach = rounded(least, math.ceil)
    return writing.table(motion, f"[{-reach!r}, {reach!r}]", "[-10, 10]")
