"""What is asked of two parts: the section of a problem file that all cases share, with all that could be asked."""

from __future__ import annotations

import math
import tomllib
from functools import reduce
from operator import rshift
from textwrap import wrap

import numpy as np

from fcdm_opt.drafting import remarks, writing
from fcdm_opt.drafting.choice import AXES, TOLERANCE, Choice, named
from fcdm_opt.drafting.situation import Near, Situation, rounded
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.keys import Defaults
from fcdm_opt.tolerances import DEFAULT

MOST_POINTS = 8  # switching points that are listed
WHY = {
    "touch": "the parts made touch, by whatever features meet first",
    "clear": "the parts made are apart or just touch; with a line clearance = 0.1 besides, apart by at least that",
    "seat": "a flush contact, face on face or along an edge, stays flush",
    "at": "the same feature touches, at exactly the sizes made",
    "beyond": "the paper's: the switching point moves into the quadrant beyond the sizes made",
}


def defaults(situation: Situation, choice: Choice, unit: str) -> str:
    """Return the section [defaults]; `unit` is that of all lengths."""
    tilted = (
        []
        if situation.tilt is None
        else wrap(f"Practically face on face: {remarks.tilt(situation.tilt)}", writing.WIDTH)
    )
    steps = _table(choice.motion, str(writing.about(situation.size / 10000.0)), "0.1")
    lines = [
        f"# As drawn, {remarks.state(situation, unit)}",
        *(f"# {line}" for line in tilted),
        "[defaults]  # of all cases; a case may give any of this anew",
        f"box = {writing.pairs(situation.box)}  # scales that are shown, and whose switching points are numbered",
        *_wider(situation),
        *_nominal(situation),
        f"tolerance = {TOLERANCE}  # a share: each part comes out up to {TOLERANCE:.0%} larger or smaller",
        "#tolerance = [0.02, 0.01]  # of the movable part, of the static one",
        "#tolerance = [[0.0, 0.02], [0.01, 0.01]]  # [smaller, larger] of each",
        *_goals(situation, choice),
        f'#pair = "{"clear" if choice.goal != "clear" else "touch"}"  # required of the parts made besides',
        *_motions(situation, choice, unit),
        f"#resolution = {steps}  # whole steps of the machine that sets the motion",
        '#amount = "displacement"  # make the farthest corner move least, in place of the weighted sum',
    ]
    return "\n".join(lines)


def _wider(situation: Situation) -> list[str]:
    """Return a box that has a switching point, where that shown has none."""
    point = situation.beyond
    if point is None:
        return []
    box = writing.pairs(situation.box_about(point.rho))
    return [f"#box = {box}  # so wide that the nearest switching point is in it, at ({writing.sizes(point.rho)})"]


def _nominal(situation: Situation) -> list[str]:
    """Return the nominal contact: as drawn, and what else it could be."""
    lines = [
        '# The nominal contact: which sizes, as shares of those drawn, are the intended ones. "drawn" is [1.0, 1.0].',
    ]
    if situation.state != "touching":
        lines += [
            '# The parts do not touch as drawn. Goals "touch" and "clear" need no more. To keep a certain contact,',
            '# take one of the sizes below in place of "drawn", with goal "at", "seat" or "beyond". They are other',
            "# nominal SIZES, which the tolerance then counts from; the parts stay where they are drawn. If it is",
            "# their place that is wrong, move the movable part in the drawing, and write this file anew.",
        ]
    lines += ['nominal = "drawn"']
    if situation.state != "touching":
        for near, why in ((situation.nearest, "the contact nearest to drawn"), (situation.grown, "both scaled alike")):
            if near is not None:
                lines += [f"#nominal = {_near(near)}  # {why}: {writing.short(near.features)}"]
    listed = situation.switching_points(MOST_POINTS)
    for point in listed:
        pair = writing.sizes(point.rho)
        features = " and ".join(feature.label for feature in point.features)
        lines += [f"#nominal = {point.index}  # switching point SW{point.index} at ({pair}): {writing.short(features)}"]
    more = len(situation.curve.switching_points) - len(listed)
    if more:
        lines += [f"# ... and {more} more switching points: see `fcdm-opt curve`"]
    if remarks.nearly(situation):
        moved = 0.0 if situation.nearest is None else float(np.abs(situation.nearest.pair - 1.0).max())
        least = float(f"{2.0 * max(abs(situation.gap) / situation.size, moved):.1e}")
        lines += [
            f"#snap = {least!r}  # the same for goals at, seat, beyond: closes the gap by nominal SIZE, not by place",
        ]
    return lines


def _near(near: Near) -> str:
    return f"[{', '.join(f'{x:.12g}' if x != int(x) else f'{x:.1f}' for x in near.pair.tolist())}]"


def _goals(situation: Situation, choice: Choice) -> list[str]:
    """Return the goal, and all others."""
    touching = situation.state == "touching"
    points = bool(situation.curve.switching_points)
    needs = {
        "seat": ("a flush nominal contact", situation.flush),
        "at": ("a nominal contact", situation.nearest is not None),
        "beyond": ("a nominal switching point", points),
    }
    lines = [f'goal = "{choice.goal}"  # {WHY[choice.goal]}']
    for goal in (goal for goal in WHY if goal != choice.goal):
        need, there = needs.get(goal, ("", True))
        if not there:
            text = f'goal "{goal}" ({WHY[goal]}) cannot be asked here: it needs {need}'
            lines += [f"# {line}" for line in wrap(text, writing.WIDTH)]
        else:
            told = f"; needs {need}" if need and not (touching and goal != "beyond") else ""
            lines += [f'#goal = "{goal}"  # {WHY[goal]}{told}']
    return lines


def _motions(situation: Situation, choice: Choice, unit: str) -> list[str]:
    """Return the motion and other ones, each with limits."""
    axis = named(situation.normal)
    k = int(np.abs(situation.normal).argmax())
    along, across = AXES[k], AXES[(k + 1) % 3]  # a turn about the normal itself would often change nothing
    free = '[{ translation = "x" }, { translation = "y" }, { translation = "z" }]'
    turn = f'{{ rotation = "{across}", centre = "seed" }}'
    offset = situation.static.seed - situation.movable.seed
    distance = float(np.linalg.norm(offset))
    found = {
        f"[{{ translation = {writing.axis(axis)} }}]": "along the contact normal",
        free: "any shift",
        f'[{{ translation = "{along}" }}, {turn}]': "a shift, then a turn about the seed",
        f'[{{ rotation = "{across}", centre = [0.0, 0.0, 0.0] }}]': 'a turn about a point, "seed" or "origin"',
    }
    if distance > DEFAULT.seeds * situation.size:
        found[f"[{{ translation = {writing.axis(named(offset / distance))} }}]"] = "along the line of the seeds"
        found['[{ screw = "seeds", pitch_per_deg = 0.01 }]'] = "a screw along the line of the seeds"
    found["[{ free = true }]"] = "all six: any shift and any turn about the seed"
    lines = [
        "# Steps one after the other, each with parameters of its own; the smallest motion of this kind is found. It",
        "# is judged where it ends, not on the way there: without limits, a motion of an unfit kind may be a long one,",
        f"# through the other part. The limits offered, in {unit} and degrees, are half the smaller part's size, or",
        "# the way found to be needed, where that is more, and 10 degrees.",
        f"motion = {writing.motion(choice)}",
        f"#limits = {_limits(situation, choice, choice.motion)}",
    ]
    for text, why in found.items():
        if text != writing.motion(choice):
            motion = reduce(
                rshift, (step.step() for step in Defaults.model_validate(tomllib.loads(f"motion={text}")).motion)
            )
            lines += [f"#motion = {text}  # {why}", f"#limits = {_limits(situation, choice, motion)}  # with that"]
    return lines


def _limits(situation: Situation, choice: Choice, motion: Motion) -> str:
    """Return limits of a motion that keep it short, but hold what was found to be needed."""
    shifts = [name for name, kind in choice.motion.parameters if kind == "translation"]
    found = [own.parameters for own in choice.solutions.values() if own is not None and own.usable]
    longest = max((abs(own[name]) for own in found for name in shifts), default=0.0)
    least = max(min(situation.movable.size, situation.static.size) / 2.0, longest)
    reach = rounded(least, math.ceil)
    return _table(motion, f"[{-reach!r}, {reach!r}]", "[-10, 10]")


def _table(motion: Motion, length: str, angle: str) -> str:
    """Return a table with an entry for each parameter of a motion."""
    entries = (f"{own}_deg = {angle}" if kind == "rotation" else f"{own} = {length}" for own, kind in motion.parameters)
    return f"{{ {', '.join(entries)} }}"
