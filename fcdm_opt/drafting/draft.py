"""A problem file for two mesh files, with a comment on everything that can be changed."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from fcdm_opt.drafting import asking, remarks, writing
from fcdm_opt.drafting.choice import NOISE, SECONDS, TOLERANCE, chosen
from fcdm_opt.drafting.situation import Situation
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.files import NANOMETRES
from fcdm_opt.problem.problem import SIGNS
from fcdm_opt.problem.schema import closest
from fcdm_opt.problem.solution import Solution

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
    state = remarks.state(situation, own)
    tilted = "" if situation.tilt is None else remarks.tilt(situation.tilt)
    steps = str(writing.about(situation.size / 10000.0))
    filters: dict[str, Callable[..., str]] = {
        "extent": partial(_extent, unit=own),
        "limits": partial(asking.limits, situation, choice),
        "steps": partial(writing.table, length=steps, angle="0.1"),
        "moved": _moved,
    }
    text = _template(filters).render(
        title=f"{paths[0].stem} and {paths[1].stem}",
        name=writing.shown(writing.quoted(Path(file).name)),
        warned=warned,
        unit=own,
        asked=unit is not None,
        parts=list(zip(("movable", "static"), bodies, places, map(_points, bodies), strict=True)),
        situation=situation,
        state=state,
        tilt=tilted,
        nominal=asking.nominal(situation),
        tolerance=TOLERANCE,
        goals=asking.goals(situation),
        choice=choice,
        motions=asking.motions(situation, choice),
        words=WORDS,
        patience=SECONDS,
        tie=TIE,
    )
    asked = f'goal "{choice.goal}", motion {writing.motion(choice.motion)}'
    summary = (
        *(f"{role}: {_extent(body, own)}" for role, body in zip(("movable", "static"), bodies, strict=True)),
        f"as drawn: {state}",
        *([f"practically face on face: {tilted}"] if tilted else []),
        *(f"warning: {remark}" for remark in warned),
        f"{asked}: {choice.solved} of {len(SIGNS)} cases solved and verified",
        *(f"{letter}: {own.advice}" for letter, own in choice.solutions.items() if own is not None and not own.usable),
        *([f"{TIE} in {', '.join(choice.tied)}"] if choice.tied else []),
    )
    return Draft(text, summary)


def _template(filters: dict[str, Callable[..., str]]) -> Any:
    """Return the template of the file; `filters` are those about these parts."""
    loader = PackageLoader("fcdm_opt", "drafting")
    made = Environment(
        loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    made.filters |= filters | {name: getattr(writing, name) for name in writing.FILTERS}
    made.filters |= {"wrapped": partial(wrap, width=writing.WIDTH)}
    made.tests |= {"saying_its_unit": lambda place: Path(place).suffix.lower() in OWN_UNIT, "large": _is_large}
    return made.get_template("problem.toml.jinja")


def _points(body: Body) -> dict[str, Any]:
    """Return points of a body that its seed could be."""
    corners = body.vertices
    centre = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    return {
        "centre": centre,
        "mean": corners.mean(axis=0),
        "bottom": np.array([*centre[:2], corners[:, 2].min()]),
    }


def _moved(solution: Solution) -> str:
    """Return the motion found in words, rounding left out."""
    problem = solution.problem
    units = [problem.size if kind == "translation" else 1.0 for _, kind in problem.motion.parameters]
    found = zip(solution.parameters.values(), units, strict=True)
    return problem.motion.describe([0.0 if abs(x) <= NOISE * one else x for x, one in found])


def _is_large(solution: Solution, gap: float) -> bool:
    """Tell whether a motion is no correction any more; `gap` is that as drawn."""
    return solution.amount > LARGE * solution.problem.size and solution.amount > 2.0 * abs(gap)


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
