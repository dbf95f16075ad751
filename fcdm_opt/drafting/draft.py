"""A problem file for two mesh files, with a comment on everything that can be changed."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap

import numpy as np

from fcdm_opt.drafting import remarks, writing
from fcdm_opt.drafting.asking import defaults
from fcdm_opt.drafting.choice import NOISE, SECONDS, Choice, chosen
from fcdm_opt.drafting.situation import Situation
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.files import NANOMETRES
from fcdm_opt.problem.problem import SIGNS
from fcdm_opt.problem.schema import closest

UNIT = "mm"
OWN_UNIT = (".glb", ".step", ".stp")  # files that say themselves what their lengths are
LARGE = 0.1  # share of the size from which a motion is no correction any more
TIE = "another motion is as small"
WORDS = {
    "A": "both parts made larger",
    "B": "the movable part larger, the static one smaller",
    "C": "the movable part smaller, the static one larger",
    "D": "both parts made smaller",
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
        what = f"unknown unit{closest(unit, NANOMETRES)}"
        raise InputError(what, key="--unit", found=unit, allowed=", ".join(NANOMETRES))
    own = UNIT if unit is None else unit
    paths = Path(movable), Path(static)
    places = [_relative(path, Path(file)) for path in paths]
    bodies = []
    for path in paths:
        at(f"reading {writing.shown(str(path))} and cutting it into convex parts")
        bodies.append(Body.from_file(path, unit=own))
    at(f"looking where the parts are: {sum(len(body.vertices) for body in bodies)} corners")
    situation = Situation(*bodies)
    choice = chosen(situation, at=at)
    warned = remarks.remarks(situation, own)
    sections = [
        _head(paths, Path(file), warned),
        *(
            _body(role, body, place, own, asked=unit is not None)
            for role, body, place in zip(("movable", "static"), bodies, places, strict=True)
        ),
        _keep_out(own),
        defaults(situation, choice, own),
        *(_case(letter, choice, situation.gap, own) for letter in SIGNS),
    ]
    asked = f'goal "{choice.goal}", motion {writing.motion(choice)}'
    summary = (
        *(f"{role}: {_extent(body, own)}" for role, body in zip(("movable", "static"), bodies, strict=True)),
        f"as drawn: {remarks.state(situation, own)}",
        *([f"practically face on face: {remarks.tilt(situation.tilt)}"] if situation.tilt is not None else []),
        *(f"warning: {remark}" for remark in warned),
        f"{asked}: {choice.solved} of {len(SIGNS)} cases solved and verified",
        *(f"{letter}: {own.advice}" for letter, own in choice.solutions.items() if own is not None and not own.usable),
        *([f"{TIE} in {', '.join(choice.tied)}"] if choice.tied else []),
    )
    return Draft("\n\n".join(sections) + "\n", summary)


# ------------------------------------------------------------------------------------------------------------ sections


def _head(paths: tuple[Path, Path], file: Path, warned: list[str]) -> str:
    title = f"{paths[0].stem} and {paths[1].stem}"
    name = writing.shown(writing.quoted(file.name))
    lines = [
        f"# {writing.shown(title)}: a problem file of fcdm-opt, written by `fcdm-opt init`.",
        "#",
        f"#   fcdm-opt solve {name}            the smallest motion of each case",
        f"#   fcdm-opt solve {name} --certify  with a proof of how small it can be at all",
        f"#   fcdm-opt curve {name}            what touches at which sizes",
        "#",
        "# The first file is of the part that moves, the second of the part at rest. Both must be drawn in one frame,",
        "# with one origin, as they stand assembled. Each part comes out a little larger or smaller than drawn, as a",
        "# whole, about its seed: the one point of it that stays where it is. Asked is the smallest motion that makes",
        "# good for that. The four cases are the extreme sizes: A both parts larger, B the movable one larger and the",
        "# static one smaller, C the movable one smaller and the static one larger, D both smaller.",
        "#",
        '# "# " begins an explanation; "#" right before a key is an alternative: take it in place of the line above it',
        "# that has the same key. Editors complete keys and show what they mean after",
        "# `fcdm-opt schema > problem.schema.json`, with this as the first line of the file:",
        "# #:schema problem.schema.json",
        *(
            line
            for remark in warned
            for line in ("#", *(f"# {own}" for own in wrap(f"WARNING: {remark}", writing.WIDTH)))
        ),
        "",
        f"title = {writing.text(title)}",
        '#note = "what the reader should know"',
    ]
    return "\n".join(lines)


def _body(role: str, body: Body, place: str, unit: str, *, asked: bool) -> str:
    corners = body.vertices
    centre, mean = (corners.min(axis=0) + corners.max(axis=0)) / 2.0, corners.mean(axis=0)
    bottom = np.array([*centre[:2], corners[:, 2].min()])
    says = Path(place).suffix.lower() in OWN_UNIT
    notes = [f"# {line}" for note in body.notes for line in wrap(writing.shown(note), writing.WIDTH)]
    lines = [f"[bodies.{role}]", f"# {_extent(body, unit)}", *notes]
    lines += [f"name = {writing.text(body.name)}", f"file = {writing.text(place)}  # relative to this file"]
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
        f'seed = "centroid"  # of the volume, {writing.point(body.seed)}',
        f'#seed = "box"  # centre of the axis-aligned box, {writing.point(centre)}',
        f'#seed = "vertices"  # mean of all corners, {writing.point(mean)}',
        f"#seed = {writing.point(bottom)}  # any point; this is the middle of the box's bottom",
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


def _case(letter: str, choice: Choice, drawn: float, unit: str) -> str:
    lines = ["[[case]]", f'name = "{letter}"', f'requirement = "{letter}"  # {WORDS[letter]}']
    solution = choice.solutions[letter]
    if solution is not None and solution.usable:
        size = solution.problem.size
        units = [size if kind == "translation" else 1.0 for _, kind in solution.problem.motion.parameters]
        found = zip(solution.parameters.values(), units, strict=True)
        motion = solution.problem.motion.describe([0.0 if abs(x) <= NOISE * one else x for x, one in found])
        lines += [f"# found for the file as written: {motion} (amount {solution.amount:.5g} {unit}), verified"]
        if letter in choice.tied:
            lines += [f"# {TIE.capitalize()}, by symmetry, say: `limits` choose between them."]
        if solution.amount > LARGE * size and solution.amount > 2.0 * abs(drawn):
            lines += [
                "# A large motion: parts of these sizes do not fit where they are drawn, so they are taken apart."
            ]
    elif solution is not None:
        lines += [
            f"# NOT SOLVED as written. {writing.shown(solution.advice)}",
            f"# To change: the motion (see above), the goal, or the tolerance; no other was begun after {SECONDS:g} s.",
        ]
    else:
        lines += ["# NOT SOLVED as written: change the goal (see above)."]
    return "\n".join(lines)


def _extent(body: Body, unit: str) -> str:
    sides = " x ".join(f"{x:.5g}" for x in np.ptp(body.vertices, axis=0).tolist())
    return f"{writing.shown(body.name)}, {sides} {unit}, {len(body.parts)} convex part{'s' * (len(body.parts) > 1)}"


def _relative(mesh: Path, file: Path) -> str:
    """Return the path of a mesh as seen from the folder of a problem file, with slashes."""
    full = mesh.parent.resolve() / mesh.name
    place = Path(os.path.relpath(full, file.parent.resolve())).as_posix()
    try:
        place.encode()
    except UnicodeEncodeError as reason:
        raise InputError("a name that is no text", file=repr(str(mesh)), allowed="a name in UTF-8") from reason
    return full.as_posix() if place.startswith("~") else place  # "~" at the start means a home folder
