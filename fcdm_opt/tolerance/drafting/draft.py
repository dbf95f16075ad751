"""A problem file for two mesh files, with a comment on everything that can be changed."""

from __future__ import annotations

import json
import math
import os
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.files import NANOMETRES
from fcdm_opt.tolerance.drafting.choice import AXES, SECONDS, TOLERANCE, Choice, chosen, named
from fcdm_opt.tolerance.drafting.situation import WIDE, Near, Situation
from fcdm_opt.tolerance.problem import SIGNS
from fcdm_opt.tolerance.schema import STEPS
from fcdm_opt.tolerances import DEFAULT

UNIT, WIDTH = "mm", 110
OWN_UNIT = (".glb", ".step", ".stp")  # files that say themselves what their lengths are
MOST_POINTS = 8  # switching points that are listed
LONGEST = 100  # signs of a contact's label: that of a round face names hundreds of vertices
UNLIKE = 50.0  # ratio of two sizes at which units are likely to be mixed up
FAR = 5.0  # sizes between the parts at which they are likely to be drawn in different frames
LARGE = 0.1  # share of the size from which a motion is no correction any more
MEANT = 1e-3  # share of the size that a gap is below by accident of drawing
WORDS = {
    "A": "both parts made larger",
    "B": "the movable part larger, the static one smaller",
    "C": "the movable part smaller, the static one larger",
    "D": "both parts made smaller",
}
WHY = {
    "seat": "the parts touch flush, face on face or along an edge; the contact shall stay flush.",
    "touch": "the parts made touch, by whatever features meet first.",
    "clear": "the parts made are apart by at least `clearance`, here 0.",
}


@dataclass(frozen=True)
class Draft:
    """A problem file as text, and what is to be said about it in a few lines."""

    text: str
    summary: tuple[str, ...]


def draft(
    movable: str | Path,
    static: str | Path,
    *,
    file: str | Path,
    unit: str | None = None,
    at: Callable[[str], None] = lambda _: None,
) -> Draft:
    """Return a commented problem file about two meshes, drawn in one frame; it solves as it stands.

    Parameters
    ----------
    movable, static : path
        STL, OBJ, PLY, OFF, GLB or STEP files.
    file : path
        Where the problem file will be: paths in it start there.
    unit : str, optional
        Unit of all lengths in it; default "mm".
    at : callable, optional
        Is told what is done next, in words: meshes of very many faces take minutes.

    Raises
    ------
    InputError
        Names the mesh file that cannot be read or bounds no solid, or the argument.
    """
    if unit is not None and unit not in NANOMETRES:
        raise InputError("unknown unit", key="--unit", found=unit, allowed=", ".join(NANOMETRES))
    own = UNIT if unit is None else unit
    paths = Path(movable), Path(static)
    places = [_relative(path, Path(file)) for path in paths]
    bodies = []
    for path in paths:
        at(f"reading {_shown(str(path))} and cutting it into convex parts")
        bodies.append(Body.from_file(path, unit=own))
    at(f"looking where the parts are: {sum(len(body.vertices) for body in bodies)} corners")
    situation = Situation(*bodies)
    choice = chosen(situation, at=at)
    remarks = _remarks(situation, own)
    sections = [
        _head(paths, Path(file), remarks),
        *(
            _body(role, body, place, own, asked=unit is not None)
            for role, body, place in zip(("movable", "static"), bodies, places, strict=True)
        ),
        _keep_out(own),
        _defaults(situation, choice, own),
        *(_case(letter, choice, situation.gap, own) for letter in SIGNS),
    ]
    summary = (
        *(f"{role}: {_extent(body, own)}" for role, body in zip(("movable", "static"), bodies, strict=True)),
        f"as drawn: {_state(situation, own)}",
        *(f"warning: {remark}" for remark in remarks),
        f'goal "{choice.goal}", motion {_motion(choice)}: {choice.solved} of {len(SIGNS)} cases solved and verified',
    )
    return Draft("\n\n".join(sections) + "\n", summary)


# ------------------------------------------------------------------------------------------------------------ sections


def _head(paths: tuple[Path, Path], file: Path, remarks: list[str]) -> str:
    title = f"{paths[0].stem} and {paths[1].stem}"
    name = _shown(quoted(file.name))
    lines = [
        f"# {_shown(title)}: a problem file of fcdm-opt, written by `fcdm-opt init`.",
        "#",
        f"#   fcdm-opt solve {name}            the smallest motion of each case",
        f"#   fcdm-opt solve {name} --certify  with a proof of how small it can be at all",
        f"#   fcdm-opt curve {name}            what touches at which sizes",
        "#",
        '# "# " begins an explanation; "#" right before a key is an alternative: take it in place of the line above it',
        "# that has the same key. Editors complete keys and show what they mean after",
        "# `fcdm-opt schema > problem.schema.json`, with this as the first line of the file:",
        "# #:schema problem.schema.json",
        *(line for remark in remarks for line in ("#", f"# WARNING: {remark}")),
        "",
        f"title = {_text(title)}",
        '#note = "what the reader should know"',
    ]
    return "\n".join(lines)


def _body(role: str, body: Body, place: str, unit: str, *, asked: bool) -> str:
    corners = body.vertices
    centre, mean = (corners.min(axis=0) + corners.max(axis=0)) / 2.0, corners.mean(axis=0)
    bottom = np.array([*centre[:2], corners[:, 2].min()])
    says = Path(place).suffix.lower() in OWN_UNIT
    notes = [f"# {line}" for note in body.notes for line in wrap(_shown(note), WIDTH)]
    lines = [f"[bodies.{role}]", f"# {_extent(body, unit)}", *notes]
    lines += [f"name = {_text(body.name)}", f"file = {_text(place)}  # relative to this file"]
    guess = "" if asked or says else " (a guess: the mesh file does not say)"
    lines += [f'unit = "{unit}"  # of all lengths in this file{guess}']
    if not says:
        lines += [
            f'#file_unit = "{"in" if unit != "in" else "mm"}"  # where the numbers in the mesh are in another unit'
        ]
    if role == "movable":
        lines += [
            "# The seed is the datum: the point that stays where it is when the part comes out larger or smaller.",
            "# Put it where the part is located when it is made or held: a stop, the middle of a hole.",
        ]
    lines += [
        f'seed = "centroid"  # of the volume, {_point(body.seed)}',
        f'#seed = "box"  # centre of the axis-aligned box, {_point(centre)}',
        f'#seed = "vertices"  # mean of all corners, {_point(mean)}',
        f"#seed = {_point(bottom)}  # any point; this is the middle of the box's bottom",
    ]
    return "\n".join(lines)


def _keep_out(unit: str) -> str:
    return "\n".join(
        [
            "# Further static parts that the movable one must keep clear of:",
            "#[[keep_out]]",
            '#file = "rib.stl"',
            f'#unit = "{unit}"',
            f"#clearance = 0.5  # least gap, {unit}",
        ]
    )


def _defaults(situation: Situation, choice: Choice, unit: str) -> str:
    reach = _about(situation.size / 10.0)
    turns = {name: kind == "rotation" for name, kind in choice.motion.parameters}
    limits = ", ".join(
        f"{own}_deg = [-10, 10]" if turned else f"{own} = [{-reach!r}, {reach!r}]" for own, turned in turns.items()
    )
    steps = ", ".join(f"{own}_deg = 0.1" if turned else f"{own} = {reach / 1000.0!r}" for own, turned in turns.items())
    lines = [
        f"# As drawn, {_state(situation, unit)}",
        "[defaults]  # of all cases; a case may give any of this anew",
        f"box = {_pairs(situation.box)}  # scales that are shown, and whose switching points are numbered",
        *_nominal(situation),
        f"tolerance = {TOLERANCE}  # a share: each part comes out up to {TOLERANCE:.0%} larger or smaller",
        "#tolerance = [0.02, 0.01]  # of the movable part, of the static one",
        "#tolerance = [[0.0, 0.02], [0.01, 0.01]]  # [smaller, larger] of each",
        f'goal = "{choice.goal}"  # {WHY[choice.goal]}',
        *_goals(situation, choice),
        f'#pair = "{"clear" if choice.goal != "clear" else "touch"}"  # required of the parts made besides',
        "# Steps one after the other, each with parameters of its own; the smallest motion of this kind is found.",
        f"motion = {_motion(choice)}",
        *_motions(situation, choice),
        f"#limits = {{ {limits} }}  # lengths in {unit}",
        f"#resolution = {{ {steps} }}  # whole steps of the machine that sets the motion",
        '#amount = "displacement"  # make the farthest corner move least, in place of the weighted sum',
    ]
    return "\n".join(lines)


def _nominal(situation: Situation) -> list[str]:
    """Return the nominal contact: as drawn, and what else it could be."""
    lines = [
        '# The nominal contact: which sizes, as shares of those drawn, are the intended ones. "drawn" is [1.0, 1.0].',
    ]
    if situation.state != "touching":
        lines += [
            "# The parts do not touch as drawn, so no contact is nominal yet. To keep a certain contact, pick one",
            '# below, with goal = "at" (or "beyond", at a switching point).',
        ]
    lines += ['nominal = "drawn"']
    if situation.state != "touching":
        for near, why in ((situation.nearest, "the contact nearest to drawn"), (situation.grown, "both scaled alike")):
            if near is not None:
                lines += [f"#nominal = {_near(near)}  # {why}: {_short(near.features)}"]
    listed = situation.switching_points(MOST_POINTS)
    for point in listed:
        pair = ", ".join(f"{x:.6g}" for x in point.rho.tolist())
        features = " and ".join(feature.label for feature in point.features)
        lines += [f"#nominal = {point.index}  # switching point SW{point.index} at ({pair}): {_short(features)}"]
    more = len(situation.curve.switching_points) - len(listed)
    if more:
        lines += [f"# ... and {more} more switching points: see `fcdm-opt curve`"]
    return lines


def _goals(situation: Situation, choice: Choice) -> list[str]:
    """Return the other goals that can be asked."""
    others = {
        "touch": "the parts made touch, by whatever features meet first",
        "clear": "the parts made are apart; with clearance = 0.1, by at least that",
        "at": "the same feature touches, at exactly the sizes made",
        "beyond": "the paper's: the switching point moves into the quadrant beyond the sizes made",
    }
    touching = situation.state == "touching"
    if not situation.curve.switching_points:
        del others["beyond"]
    if not touching and situation.nearest is None:
        del others["at"]
    return [
        f'#goal = "{goal}"  # {why}{"" if touching or goal in ("touch", "clear") else "; needs a nominal contact"}'
        for goal, why in others.items()
        if goal != choice.goal
    ]


def _motions(situation: Situation, choice: Choice) -> list[str]:
    """Return other motions."""
    axis = named(situation.normal)
    k = int(np.abs(situation.normal).argmax())
    along, across = AXES[k], AXES[(k + 1) % 3]  # a turn about the normal itself would often change nothing
    free = '[{ translation = "x" }, { translation = "y" }, { translation = "z" }]'
    turn = f'{{ rotation = "{across}", centre = "seed" }}'
    offset = situation.static.seed - situation.movable.seed
    distance = float(np.linalg.norm(offset))
    found = {
        f"[{{ translation = {_axis(axis)} }}]": "along the contact normal",
        free: "any shift",
        f'[{{ translation = "{along}" }}, {turn}]': "a shift, then a turn about the seed",
        f'[{{ rotation = "{across}", centre = [0.0, 0.0, 0.0] }}]': 'a turn about a point, "seed" or "origin"',
    }
    if distance > DEFAULT.seeds * situation.size:
        found[f"[{{ translation = {_axis(named(offset / distance))} }}]"] = "along the line of the seeds"
        found['[{ screw = "seeds", pitch_per_deg = 0.01 }]'] = "a screw along the line of the seeds"
    found["[{ free = true }]"] = "all six: any shift and any turn about the seed"
    return [f"#motion = {text}  # {why}" for text, why in found.items() if text != _motion(choice)]


def _case(letter: str, choice: Choice, drawn: float, unit: str) -> str:
    lines = ["[[case]]", f'name = "{letter}"', f'requirement = "{letter}"  # {WORDS[letter]}']
    solution = choice.solutions[letter]
    if solution is not None and solution.usable:
        motion = solution.problem.motion.describe(list(solution.parameters.values()))
        size = solution.problem.size
        lines += [f"# found for the file as written: {motion} (amount {solution.amount:.5g} {unit}), verified"]
        if solution.amount > LARGE * size and solution.amount > 2.0 * abs(drawn):
            lines += [
                "# A large motion: parts of these sizes do not fit where they are drawn, so they are taken apart."
            ]
    elif solution is not None:
        lines += [
            f"# NOT SOLVED as written. {_shown(solution.status.value)}",
            f"# To change: the motion (see above), the goal, or the tolerance; no other was begun after {SECONDS:g} s.",
        ]
    else:
        lines += ["# NOT SOLVED as written: change the goal (see above)."]
    return "\n".join(lines)


# --------------------------------------------------------------------------------------------------------------- words


def _remarks(situation: Situation, unit: str) -> list[str]:
    """Return what is likely to be wrong with the drawing."""
    one, two = situation.movable, situation.static
    found = []
    ratio = max(one.size, two.size) / min(one.size, two.size)
    if ratio > UNLIKE:
        found.append(f"one part is {ratio:.3g} times as large as the other: is one mesh in another unit? (file_unit)")
    if situation.gap > FAR * situation.size:
        found.append(f"the parts are {situation.gap / situation.size:.3g} sizes apart: are both drawn in one frame?")
    if situation.state != "touching" and abs(situation.gap) <= MEANT * situation.size:
        least = float(f"{2.0 * abs(situation.gap) / situation.size:.1e}")
        found.append(
            f"the parts nearly touch ({situation.gap:+.3g} {unit}): if they are meant to, snap = {least:g} does it"
        )
    if any(any(body.deviation) for body in (one, two)):
        out, short = (max(ends) for ends in zip(one.deviation, two.deviation, strict=True))
        found.append(f"the parts were approximated: up to {out:.3g} {unit} too large, {short:.3g} {unit} too small")
    return found


def _state(situation: Situation, unit: str) -> str:
    union = len(situation.movable.parts) > 1 or len(situation.static.parts) > 1
    deepest = ", at the deepest pair of convex parts" if union else ""
    words = {
        "touching": "the parts touch",
        "apart": f"the parts are {situation.gap:.6g} {unit} apart",
        "overlapping": f"the parts overlap by {-situation.gap:.6g} {unit}{deepest}",
    }
    text = words[situation.state]
    if situation.state == "touching":
        near = situation.nearest
        return text + (f": {_short(near.features)}" if near is not None else "")
    if math.isfinite(situation.growth):
        return f"{text}; both made {situation.growth:.6g} times as large, they would touch"
    low, high = WIDE[0]
    return f"{text}; both made {low:g} to {high:g} times as large, they never just touch"


def _motion(choice: Choice) -> str:
    """Return a motion as a problem file has it."""
    steps = [STEPS[type(step)].plain(step) for step in choice.motion.steps]
    names = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
    words = []
    for step in steps:
        for key in ("translation", "rotation"):
            if isinstance(step.get(key), list):
                step[key] = names.get(tuple(step[key]), step[key])
        words.append("{ " + ", ".join(f"{key} = {_value(value)}" for key, value in step.items()) + " }")
    return f"[{', '.join(words)}]"


def _value(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return _text(value) if isinstance(value, str) else f"[{', '.join(map(repr, value))}]"  # type: ignore[call-overload]


def _axis(axis: str | tuple[float, ...]) -> str:
    return _text(axis) if isinstance(axis, str) else f"[{', '.join(map(repr, axis))}]"


def _near(near: Near) -> str:
    return f"[{', '.join(f'{x:.12g}' if x != int(x) else f'{x:.1f}' for x in near.pair.tolist())}]"


def _pairs(box: tuple[tuple[float, float], tuple[float, float]]) -> str:
    return f"[{', '.join(f'[{low!r}, {high!r}]' for low, high in box)}]"


def _point(point: Array) -> str:
    return f"[{', '.join(repr(float(f'{x:.9g}') + 0.0) for x in point.tolist())}]"


def _about(length: float) -> float:
    return float(f"{length:.1g}")


def _extent(body: Body, unit: str) -> str:
    sides = " x ".join(f"{x:.5g}" for x in np.ptp(body.vertices, axis=0).tolist())
    return f"{_shown(body.name)}, {sides} {unit}, {len(body.parts)} convex part{'s' * (len(body.parts) > 1)}"


def _relative(mesh: Path, file: Path) -> str:
    """Return the path of a mesh as seen from the folder of a problem file, with slashes."""
    full = mesh.parent.resolve() / mesh.name
    place = Path(os.path.relpath(full, file.parent.resolve())).as_posix()
    try:
        place.encode()
    except UnicodeEncodeError as reason:
        raise InputError("a name that is no text", file=repr(str(mesh)), allowed="a name in UTF-8") from reason
    return full.as_posix() if place.startswith("~") else place  # "~" at the start means a home folder


def _text(text: str) -> str:
    """Return a text as TOML has it."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def quoted(path: str | Path) -> str:
    """Return a path as a shell takes it: in quotes where needed, and never for an option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


def _short(label: str) -> str:
    """Return a contact's label, its middle left out where it is very long."""
    half = LONGEST // 2
    return label if len(label) <= LONGEST else f"{label[:half]} ... {label[-half:]}"


def _shown(text: str) -> str:
    """Return a text for a comment: in one line, without control characters."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)
