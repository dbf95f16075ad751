"""A problem file for two mesh files, with a comment on everything that can be changed, and on what is likely wrong."""

from __future__ import annotations

import json
import math
import os
import shlex
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, product
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from fcdm_opt import pacing, process_pool
from fcdm_opt.curve.features import Feature
from fcdm_opt.drafting.choice import ANY_SHIFT, NOISE, TOLERANCE, Choice, chosen, named
from fcdm_opt.drafting.situation import DRAWN, WIDE, Situation, rounded
from fcdm_opt.errors import InputError, counted, known_word
from fcdm_opt.geometry.arrays import Array, groups_of
from fcdm_opt.geometry.bodies import Body, solids_notes
from fcdm_opt.geometry.facet_errors import all_recognised, known_to, may_be_rounded, round_surfaces
from fcdm_opt.geometry.files import STEP, called, chosen_solid
from fcdm_opt.geometry.matching import matched
from fcdm_opt.geometry.moving_faces import between_planes
from fcdm_opt.geometry.naming import described_faces, names_of_rows
from fcdm_opt.geometry.polygons import components
from fcdm_opt.geometry.resizing import Resizing, fit_for_sizes
from fcdm_opt.geometry.round_recognition import ROUND, ROUND_KINDS, round_faces
from fcdm_opt.geometry.size import Size, direction, spans
from fcdm_opt.geometry.tessellation import TESSELLATED
from fcdm_opt.geometry.units import NANOMETRES, Unit, number_text, signed
from fcdm_opt.model.mesh_error import with_mesh_error
from fcdm_opt.motion.motions import XYZ, Free, Motion, Rotation, Translation
from fcdm_opt.problem.fit import FAR, MATING, verdict
from fcdm_opt.problem.problem import SIGNS, Problem
from fcdm_opt.problem.solution import Solution
from fcdm_opt.solver import solve
from fcdm_opt.tolerances import DEFAULT

UNIT: Unit = "mm"
CUT = ", exactly the solid"  # what a note on a body says of its parts, and nothing else
OWN_UNIT = (".glb", *STEP)  # files that say themselves what their lengths are
LARGE = 0.1  # share of the size from which a motion is no correction any more
TIE = "another motion is as small"
TILTED = (
    "the faces that meet are parallel within {:.0e} rad, not exactly (single precision, say); "
    "fcdm_opt takes the corners as the file has them"
)
MOST_CONTACTS = 4  # contacts that are listed
MOST_POINTS = 2  # switching points that are listed
MOST_SIZES = 3  # that are listed of a part
LONGEST, SHORT_LIST = 90, 60  # signs of a row of contacts, and of faces
UNLIKE, UNLIKELY = 8.0, 50.0  # ratios of sizes at which units may be mixed up: of parts that do not touch, of all
UNITS = {10.0: "cm beside mm", 25.4: "inches beside mm", 1000.0: "m beside mm"}
SIMILAR_PLAY = 3.0  # times the gap up to which that on the opposite side is one of the same play
SIMILAR = 1.5  # times as large, at most, that both are told to be made
DRAWN_TO = 1e-9  # of a part's size: what files of coordinates in single precision, or integrals over them, leave of 0
MEANT = 1e-3  # share of the size that a gap is below by accident of drawing
WHY = {
    "touch": "the parts made touch, by whatever features meet first",
    "clear": "the parts made are apart or just touch; with a line clearance = 0.1 besides, apart by at least that",
    "seat": "a flush contact, face on face or along an edge, stays flush",
    "at": "the same feature touches, at exactly the sizes made",
    "beyond": "the paper's: the switching point moves into the quadrant beyond the sizes made",
    "fit": "none of the contacts listed overlaps, and the largest of their gaps is least",
}
BECAUSE = {
    ("touching", "seat"): "flush as drawn, the parts are to stay so",
    ("touching", "touch"): "touching as drawn, the parts are to touch again",
    ("apart", "touch"): "apart as drawn, the parts are to meet",
    ("fitted", "clear"): "with play between walls as drawn, the parts made are to go together again",
    ("overlapping", "clear"): "overlapping as drawn, the parts are to come apart",
}
"""Why a goal is proposed, by how the parts lie."""
ALL_RESTORED = "as drawn the parts touch at {}, and shifts restore them all"
ONE_DIRECTION = "as drawn the parts touch at {}, no shift restores all of them in every case; {} kept"
SAME_DIRECTION = "as drawn the parts touch at {}, all of which face one way and are to touch again"
OTHERWISE = "what the drawing asks for first has no solution in any of the four cases"
WORDS = {
    "A": "both parts made larger",
    "B": "the movable part larger, the static one smaller",
    "C": "the movable part smaller, the static one larger",
    "D": "both parts made smaller",
}


MOST_FACES = 200  # of a body among which opposite ones are looked for


class Draft(NamedTuple):
    """A problem file as text, and what is to be said about it in a few lines."""

    text: str
    summary: tuple[str, ...]


def draft(
    movable: str | Path,
    static: str | Path,
    *,
    file: str | Path,
    unit: Unit | None = None,
    deviation: float | None = None,
) -> Draft:
    """Return a commented problem file about two meshes, drawn in one frame; it solves as it stands.

    Meshes are STL, OBJ, PLY, OFF, GLB or STEP files; paths start where the problem `file` will be. The `unit` of
    all lengths in it is "mm" by default; `deviation` is how far triangles may leave curved faces of STEP files at most,
    see `Body.from_file`. Raises `InputError` that names the mesh file that cannot be read or bounds no solid, or the
    argument.
    """
    lengths = UNIT if unit is None else known_word(unit, NANOMETRES, "unknown unit", key="--unit")
    paths = Path(movable), Path(static)
    files = [chosen_solid(path)[0] for path in paths]
    bounds = [deviation if file.suffix.lower() in STEP else None for file in files]
    if deviation is not None and not 0.0 < deviation < math.inf:
        raise InputError("not a chord error", key="--deviation", found=deviation, allowed="a finite length > 0")
    if deviation is not None and bounds == [None, None]:
        raise InputError("neither file is STEP", key="--deviation", found=deviation, allowed="none with mesh files")
    places = [_relative(path, Path(file)) for path in paths]

    def read(number: int) -> Body:
        pacing.at(f"reading {shown(str(paths[number]))} and cutting it into convex parts")
        return Body.from_file(paths[number], unit=lengths, deviation=bounds[number])

    bodies = process_pool.both(read, (0, 1), paths)
    if max(sides := [body.size for body in bodies]) <= UNLIKELY * min(sides):  # else they may be in two units
        one, two = (body.rounded() if may_be_rounded(body) else body for body in bodies)
        bodies = one if all_recognised(one) else bodies[0], two if all_recognised(two) else bodies[1]
    pacing.at(f"looking where the parts are: {sum(len(body.vertices) for body in bodies)} corners")
    pacing.check()
    one, two = matched(bodies)
    situation = Situation(one, two, lengths)
    warned, state = remarks(situation, lengths), state_text(situation, lengths)
    nominal, goals = _nominal(situation), _goals(situation)
    tilted = "" if situation.tilt is None else TILTED.format(situation.tilt)
    choice = chosen(situation)  # in the time that is left
    asked_of = {letter: own and with_mesh_error(own, None) for letter, own in choice.solutions.items()}
    choice = replace(choice, solutions=asked_of)
    of_faces = choice.goal in ("touch", "clear") and all(map(all_recognised, (one, two)))
    if not (of_faces or (choice.usable and all(own.exact_of_mesh for own in choice.usable.values()))):
        warned += known_to((one, two), lengths)
    filters: dict[str, Callable[..., str]] = {
        "extent": partial(_extent, unit=lengths),
        "limits": partial(_limits, situation, choice),
        "steps": partial(parameter_table, length=repr(float(f"{situation.size / 10000.0:.1g}")), angle="0.1"),
        "moved": partial(_moved, unit=lengths),
        "short": partial(short, bodies=(one, two)),
        "why_not": _why_not,
    }
    text = _template(filters).render(
        title=f"{called(paths[0])} and {called(paths[1])}",
        name=shown(quoted(Path(file).name)),
        warned=warned,
        unit=lengths,
        asked=unit is not None,
        deviation=deviation,
        parts=list(zip(("movable", "static"), bodies, places, map(_bottom, bodies), strict=True)),
        round_ones=[*map(_round_ones, bodies)],
        offered=_offered(bodies, named(situation.normal)),
        situation=situation,
        state=state,
        tilt=tilted,
        nominal=nominal,
        tolerance=TOLERANCE,
        goals=goals,
        choice=choice,
        because=_because(situation, choice),
        motions=_motions(situation, choice),
        words=WORDS,
        tie=TIE,
    )
    contacts = f", of {_contacts(choice.contacts)}" if choice.contacts else ""
    asked = f'goal "{choice.goal}"{contacts}, motion {motion_entry(choice.motion)}'
    summary = (
        *(f"{role}: {_extent(body, lengths)}" for role, body in zip(("movable", "static"), bodies, strict=True)),
        f"as drawn: {state}",
        *([f"practically face on face: {tilted}"] if tilted else []),
        *(f"warning: {remark}" for remark in warned),
        f"proposed: {asked}: {_because(situation, choice)}",
        f"{len(choice.usable)} of {len(SIGNS)} cases solved and verified",
        *(
            f"{letter}: {_why_not(answer)}"
            for letter, answer in choice.solutions.items()
            if answer is not None and not answer.usable
        ),
        *([f"{TIE} in {', '.join(choice.tied)}"] if choice.tied else []),
    )
    return Draft(text, summary)


def own_name(movable: Path, static: Path, suffix: str) -> str:
    """Return the name of the problem file of two parts, where none is given."""
    return f"{called(movable)}-{called(static)}{suffix}"


def _template(filters: dict[str, Callable[..., str]]) -> Any:
    """Return the template of the file; `filters` are those about these parts."""
    loader = PackageLoader("fcdm_opt", "drafting")
    made = Environment(
        loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    made.filters |= filters | {"motion": motion_entry, "point": point, "shown": shown}
    made.tests["rounded"] = round_surfaces
    made.tests["about_parts"] = lambda note: note.startswith("one part: ") or CUT in note
    made.filters |= {"sizes": sizes, "toml": toml, "wrapped": partial(wrap, width=110)}
    made.tests |= {
        "saying_its_unit": lambda place: chosen_solid(place)[0].suffix.lower() in OWN_UNIT,
        "step": lambda place: chosen_solid(place)[0].suffix.lower() in STEP,
        "large": lambda own, gap: own.amount > max(LARGE * own.problem.size, 2.0 * abs(gap)),  # no correction any more
    }
    return made.get_template("problem.toml.jinja")


# ------------------------------------------------------------------------------------------------ what is to be said


def remarks(situation: Situation, unit: str) -> list[str]:
    """Return what is likely to be wrong with the drawing."""
    one, two = situation.movable, situation.static
    found = []
    ratio = max(one.size, two.size) / min(one.size, two.size)
    if ratio > (UNLIKE if situation.state != "touching" and not nearly(situation) else UNLIKELY):
        units = "; ".join(f"{words} are {factor:g}" for factor, words in UNITS.items())
        question = f"is one mesh in another unit ({units})? (file_unit)"
        found.append(f"one part is {ratio:.3g} times as large as the other: {question}")
    if situation.gap > FAR * situation.size:
        found.append(f"the parts are {situation.gap:.4g} {unit} apart: are both drawn in one frame?")
    if nearly(situation) and not _amid_play(situation):
        found.append(f"the parts nearly touch ({signed(situation.gap, 3)} {unit}). {_remedy(situation, unit)}")
    return [*found, *solids_notes((one, two))]


def nearly(situation: Situation) -> bool:
    """Tell whether the parts are likely to have been meant to touch."""
    return situation.state != "touching" and abs(situation.gap) <= MEANT * situation.size


def _amid_play(situation: Situation) -> bool:
    """Tell whether parts that are apart are about as near on the opposite side, as those of a running fit."""
    if situation.fit != "fitted":
        return False
    far, motion = SIMILAR_PLAY * situation.gap, Translation(tuple(situation.normal.tolist()))
    asked = partial(Problem, situation.movable, situation.static, target=DRAWN, goal="touch", motion=motion)
    limits = ({motion.names[0]: ends} for ends in ((0.0, far), (-far, 0.0)))
    return all(solve(asked(limits=own), effort="quick", time=math.inf).usable for own in limits)


def state_text(situation: Situation, unit: str) -> str:
    """Return how the parts lie, in a sentence."""
    words = {
        "touching": "the parts touch",
        "apart": f"the parts are {situation.gap:.4g} {unit} apart",
        "overlapping": f"the parts overlap by {-situation.gap:.4g} {unit}: no shorter shift takes them apart",
    }
    text = words[situation.state]
    if situation.state == "touching":
        places = situation.places
        more = [f"{len(places) - MOST_CONTACTS} more"] if len(places) > MOST_CONTACTS else []
        listed = "; ".join([*places[:MOST_CONTACTS], *more])
        at = f", at {counted(len(places), 'place')}" if len(places) > 1 else ""
        return f"{text}{at}: {listed}" if places else text
    if situation.large:
        return text  # what else would touch before is not looked at
    if math.isfinite(situation.growth):
        if not 1.0 / SIMILAR <= situation.growth <= SIMILAR:
            return text  # as from a hole that opens: true, and of no use
        share = 100.0 * (situation.growth - 1.0)
        return f"{text}; both made {abs(share):.3g} % {'larger' if share > 0.0 else 'smaller'}, they would touch"
    low, high = WIDE[0]
    return f"{text}; both made {low:g} to {high:g} times as large, they never just touch"


def _contacts(asked: str | tuple[str, ...]) -> str:
    """Return how many contacts are asked for: "all contacts", "1 contact"."""
    return "all contacts" if isinstance(asked, str) else counted(len(asked), "contact")


def _because(situation: Situation, choice: Choice) -> str:
    if choice.contacts == "all":
        fitting = (
            f" in every case but {' and '.join(choice.unfit)}, in which the parts do not fit" if choice.unfit else ""
        )
        return ALL_RESTORED.format(counted(len(situation.places), "place")) + fitting
    why = BECAUSE.get((situation.fit, choice.goal), OTHERWISE)
    if choice.contacts and len(situation.places) > 1:
        count = len(choice.contacts)
        kept = "the one that the motion goes along is" if count == 1 else f"the {count} that face one way are"
        text = ONE_DIRECTION if count < len(situation.places) else SAME_DIRECTION
        why = text.format(counted(len(situation.places), "place"), kept)
    if choice.motion.steps == (Translation(named(situation.normal)),) and not situation.on_round_face:
        why += ", and along the contact's normal is the shortest way"
    touched = " ".join(situation.places).replace(" of radius ", " radius ")
    for wall in (own for body in (situation.movable, situation.static) for own in round_faces(body)):
        cosine, sine = wall.surface.line or (1.0, 0.0)
        if sine and wall.name in touched and choice.motion.steps == (Translation(named(wall.surface.axis)),):
            times = f"{abs(cosine / sine) / 2.0:.3g}"
            return f"{why}; a diameter of this cone larger or smaller by x moves it {times} x, x / (2 tan(half angle))"
    return why


def _why_not(solution: Solution) -> str:
    """Return why a case has no motion to use: by which widths the parts do not fit, else what to do.

    And which of the contacts exclude each other.
    """
    if widths := verdict(solution.problem):
        return f"{widths[:1].upper()}{widths[1:]}."
    return f"{solution.advice} {solution.reason[:1].upper()}{solution.reason[1:]}".strip()


def _remedy(situation: Situation, unit: Any) -> str:
    """Return what to do where a contact is meant that is not drawn: move the drawing, the shortest way, where one does.

    Of large meshes that are apart how far alone: which way takes long to tell.
    """
    bodies, small = (situation.movable, situation.static), MEANT * situation.size
    limits = dict.fromkeys(ANY_SHIFT.names, (-small, small))  # to find, or rule out, a longer one takes long
    problem = Problem(*bodies, target=DRAWN, goal="touch", motion=ANY_SHIFT, unit=unit, limits=limits)
    tight = verdict(problem)
    solution = None if situation.large or tight else solve(problem, effort="quick", time=math.inf)
    if situation.large and situation.gap > 0.0:
        return f"If they are meant to touch, move the movable part by {situation.gap:.6g} {unit} in the drawing"
    shift = np.full(3, np.inf)
    if solution is not None and solution.usable and solution.transform is not None:
        shift = solution.transform[:3, 3]
    if not float(np.linalg.norm(shift)) <= small:  # as of a pin that is tight all round
        why = tight or "no small shift is known to do"
        return f"If they are meant to touch as drawn, mend the sizes in the drawing (CAD): {why}"
    by = point(np.where(np.abs(shift) <= NOISE * situation.size, 0.0, shift), 6)
    return (
        f"If they are meant to touch as drawn, move the movable part in the drawing (CAD) by {by} {unit}: "
        f"the shortest way, {float(np.linalg.norm(shift)):.6g} {unit} along the contact normal"
    )


# --------------------------------------------------------------------------------------------------- what else could be


def _goals(situation: Situation) -> dict[str, tuple[str, str, bool, bool]]:
    """Return of each goal what it means and needs, whether that is there, and whether the need is told where it is."""
    needs = {
        "seat": ("a flush nominal contact", situation.flush),
        "at": ("a nominal contact", situation.nearest is not None),
        "beyond": ("a nominal switching point", bool(situation.curve.switching_points)),
        "fit": ('contacts = "all", and several', len(situation.contacts) > 1),
    }
    rows = {}
    for goal, why in WHY.items():
        need, there = needs.get(goal, ("", True))
        rows[goal] = why, need, there, bool(need) and not (situation.state == "touching" and goal in ("seat", "at"))
    return rows


def _nominal(situation: Situation) -> dict[str, Any]:
    """Return what the nominal contact could be besides "drawn": contacts near, switching points, a snap."""
    near = ((situation.nearest, "the contact nearest to drawn"), (situation.grown, "both scaled alike"))
    listed = situation.switching_points(MOST_POINTS)
    snap = 0.0
    if nearly(situation):
        moved = 0.0 if situation.nearest is None else float(np.abs(situation.nearest.pair - 1.0).max())
        snap = float(f"{2.0 * max(abs(situation.gap) / situation.size, moved):.1e}")
    return {
        "near": [row for row in near if row[0] is not None and situation.state != "touching"],
        "listed": listed,
        "more": len(situation.curve.switching_points) - len(listed),
        "snap": snap,
    }


def _motions(situation: Situation, choice: Choice) -> list[tuple[Motion, str]]:
    """Return other motions than the one chosen, and what they are."""
    k = int(np.abs(situation.normal).argmax())
    along, across = XYZ[k], XYZ[(k + 1) % 3]  # a turn about the normal itself would often change nothing
    others: list[tuple[Motion, str]] = [
        (Translation(named(situation.normal)), "along the contact normal"),
        (ANY_SHIFT, "any shift"),
        (Translation(along) >> Rotation(across, centre="seed"), "a shift, then a turn about the seed"),
        (Free(), "any shift and any turn about the seed"),
    ]
    written = {motion_entry(motion): (motion, why) for motion, why in others}
    written.pop(motion_entry(choice.motion), None)
    return list(written.values())


def _limits(situation: Situation, choice: Choice, motion: Motion) -> str:
    """Return limits of a motion that keep it short, but hold what was found to be needed."""
    shifts = [name for name, kind in choice.motion.parameters if kind == "translation"]
    longest = max((abs(answer.parameters[name]) for answer in choice.usable.values() for name in shifts), default=0.0)
    bound = rounded(max(min(situation.movable.size, situation.static.size) / 2.0, longest), math.ceil)
    return parameter_table(motion, f"[{-bound!r}, {bound!r}]", "[-10, 10]")


# --------------------------------------------------------------------------------------------------- parts of the text


def _bottom(body: Body) -> Array:
    low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
    return np.array([*(low + high)[:2] / 2.0, low[2]])


def _offered(bodies: Sequence[Body], along: Any) -> list[tuple[str, tuple[str, ...], str, str, float]]:
    """Return the first sizes of both parts with these: those first that the other part has nearly, then those along.

    As the diameters of a pin and its bore, and not those of what stands free; else what the contact moves by.
    """
    found = [widths(body) for body in bodies]
    values = [[(own[3], float(own[2].rsplit(" of ", 1)[0].split()[-1])) for own in sizes] for sizes in found]

    def off(side: int, k: int) -> tuple[float, bool]:
        each, value = values[side][k]
        near = (abs(value - other) / max(value, other) for sign, other in values[1 - side] if sign * each < 0.0)
        share = min(near, default=math.inf)
        return share if share < MATING else math.inf, not found[side][k][2].startswith((f"+{along} ", f"-{along} "))

    first = [sorted(range(len(sizes)), key=partial(off, side))[:MOST_SIZES] for side, sizes in enumerate(found)]
    return [(role, *found[side][k]) for side, role in enumerate(("movable", "static")) for k in first[side]]


def _moved(solution: Solution, unit: str) -> str:
    """Return the motion found in words, and its amount, rounding left out."""
    problem = solution.problem
    if solution.amount <= DRAWN_TO * problem.size:
        return "no motion needed"
    units = [problem.size if kind == "translation" else 1.0 for _, kind in problem.motion.parameters]
    found = zip(solution.parameters.values(), units, strict=True)
    motion = problem.motion.describe([0.0 if abs(x) <= DRAWN_TO * one else x for x, one in found])
    return f"found as written: {motion} (amount {number_text(solution.amount, 5)} {unit})"


def widths(body: Body, most: int = 8) -> list[tuple[tuple[str, ...], str, str, float]]:
    """Return faces whose distance is a size, and can be one: their labels or name, its name, what it is, `each`.

    The diameters of cylinders and bores but for fillets and round ends, which follow faces, then `most` distances of
    material or room between plane faces that look opposite ways and lie over one another: first those of faces that
    are the nearest so to each other on their side, of material or of room, then the others, the largest first.
    """
    normals, points = body.face_planes
    names = names_of_rows(body)
    following = {names[row] for row in between_planes(body)}
    round_ones = [name for name in dict.fromkeys(names) if " radius " in name and " to " not in name]
    found, known = list[tuple[tuple[str, ...], str, str, float]](), set[tuple[int, ...]]()

    def offered(faces: tuple[str, ...], width: float, name: str, what: str, each: float = 0.5) -> bool:
        each = math.copysign(each, width)
        asked = Size("width", "movable", faces=faces, each=each)
        try:
            Resizing.of(body, [asked])
        except InputError:  # faces along whose plane the body is cut cannot move by themselves
            if fit_for_sizes(body, (asked,)) is body:
                return False
        found.append((faces, name, f"{what}{' of material' if width > 0.0 else ' of room'},", each))
        return True

    for name in [own for own in round_ones if own not in following][:most]:
        kind, _, radius, *number = name.split()
        width = 2.0 * float(radius)
        called = " ".join((kind, (diameter := f"diameter {width:.6g}"), *number))
        offered((name,), width if kind in ROUND_KINDS[::2] else -width, called, diameter)
    plain = np.array([k for k, name in enumerate(names) if " radius " not in name], np.int64)
    plain = plain if len(plain) <= MOST_FACES else plain[:0]
    turned = np.abs(normals[plain] - normals[plain, None]).max(axis=2)
    heights = np.abs(((points[plain] - points[plain, None]) * normals[plain]).sum(axis=2))
    alike = (turned <= DEFAULT.nominal) & (heights <= DEFAULT.snap * body.size)
    planes = [plain[own].tolist() for own in groups_of(components(np.argwhere(alike), len(plain)))]
    made = {own[0]: own for own in planes if own}  # faces in one plane that look one way are made in one go
    over = [
        (float((points[j] - points[i]) @ normals[j]), i, j)
        for i, j in combinations(made, 2)
        if np.abs(normals[i] + normals[j]).max() <= DEFAULT.nominal
        and any(_lie_over(body, *pair) for pair in product(made[i], made[j]))
    ]
    for wall in (own for own in round_faces(body) if own.surface.line == (1.0, 0.0)):
        edges, inside = {pair for face in wall.faces for pair in combinations(face, 2)}, wall.name.startswith("bore")
        for k in made:
            off = float(normals[k] @ (points[k] - wall.surface.origin)) * (-1.0 if inside else 1.0)
            flat = abs(normals[k] @ wall.surface.axis) <= DEFAULT.nominal
            flat &= 0.0 < off < (1.0 - ROUND) * wall.surface.radius
            opposite = any(k in ends and (width < 0.0) == inside for width, *ends in over)
            if flat and not opposite and any(pair in edges for pair in combinations(body.faces[k], 2)):
                text = f"from the axis of its {wall.name.split()[0]} to its flat F{k + 1}, {off:.6g}"
                offered((f"F{k + 1}",), -off if inside else off, f"flat F{k + 1}", text, each=1.0)
    nearest = dict[tuple[int, bool], float]()
    for width, *ends in sorted(over, key=lambda own: -abs(own[0])):
        nearest.update({(end, width > 0.0): abs(width) for end in ends})
    limit = len(found) + most

    def rank(own: tuple[float, int, int]) -> tuple[bool, float]:
        return abs(own[0]) > max(nearest[end, own[0] > 0.0] for end in own[1:]), -abs(own[0])

    for width, i, j in sorted(over, key=rank):
        key = (*np.rint(np.abs(normals[i]) * 1e6).astype(int).tolist(), round(width / body.size * 1e6))
        if width and key not in known and len(found) < limit:
            axis = f"{one[1]} " if len(one := direction(normals[i])) == 2 else ""
            labels = [[f"F{k + 1}" for k in made[end]] for end in (i, j)]
            name = f"{axis}{'width' if width > 0.0 else 'gap'} {' to '.join(map(_listed, labels))}"
            if offered((*labels[0], *labels[1]), width, name, f"{_across(body, i, j)}, {abs(width):.6g}"):
                known.add(key)
    return found


def _across(body: Body, i: int, j: int) -> str:
    """Return across which faces a distance is: "-x and +x"; of slanted ones which, and along which direction."""
    one, two = map(direction, body.face_planes[0][[i, j]])
    if len(two) == 2:
        return f"{one} and {two}"
    faces = (f"F{k + 1} (facing {described_faces(body)[body.faces[k]][1]})" for k in (i, j))
    normal: Array = body.face_planes[0][j]
    normal = normal * np.sign(normal[np.abs(normal).argmax()])
    along = ", ".join(f"{x if abs(x) > DEFAULT.side else 0.0:.3g}" for x in normal.tolist())
    return f"across the slanted faces {' and '.join(faces)}, along ({along})"


def _lie_over(body: Body, i: int, j: int) -> bool:
    """Tell whether two parallel faces lie over one another, by the boxes round them in their plane."""
    lows, highs = spans(body, (i, j))
    return bool((highs.min(axis=0) - lows.max(axis=0)).min() > DEFAULT.snap * body.size)


def _extent(body: Body, unit: str) -> str:
    sides = " x ".join(f"{x:.5g}" for x in np.ptp(body.vertices, axis=0).tolist())
    return f"{shown(body.name)}, {sides} {unit}, {counted(len(body.parts), 'convex part')}"


def _round_ones(body: Body) -> str:
    """Return which round faces a body has or may be told to have, see `rounded`, each with how many facets it has."""
    known = round_surfaces(body) or may_be_rounded(body)
    counts = Counter(own for own in names_of_rows(body) if " radius " in own and known)
    of_step = any(note.startswith(TESSELLATED) for note in body.notes)
    return _listed([name if of_step else f"{name} ({count} facets)" for name, count in counts.items()], longest=LONGEST)


def _relative(mesh: Path, file: Path) -> str:
    """Return the path of a mesh as seen from the folder of a problem file, with slashes."""
    full = mesh.parent.resolve() / mesh.name
    place = Path(os.path.relpath(full, file.parent.resolve())).as_posix()
    try:
        place.encode()
    except UnicodeEncodeError as reason:
        raise InputError("a name that is no text", file=repr(str(mesh)), allowed="a name in UTF-8") from reason
    return full.as_posix() if place.startswith("~") else place  # "~" at the start means a home folder


def motion_entry(motion: Motion) -> str:
    """Return a motion as a problem file has it."""
    names = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
    words = []
    for step in motion.steps:
        entry = step.own_plain()
        for key in ("translation", "rotation"):
            if isinstance(entry.get(key), list):
                entry[key] = names.get(tuple(entry[key]), entry[key])
        if "pitch_per_rad" in entry:
            entry["pitch_per_deg"] = float(f"{math.radians(entry.pop('pitch_per_rad')):.12g}")
        words.append("{ " + ", ".join(f"{key} = {toml(value)}" for key, value in entry.items()) + " }")
    return f"[{', '.join(words)}]"


def toml(value: Any) -> str:
    """Return a value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return f"[{', '.join(map(toml, value))}]" if isinstance(value, list | tuple) else repr(value)


def point(point: Array, digits: int = 9, size: float = 0.0) -> str:
    """Return a point of a part of this size, or a scale pair, as TOML has it, in so many digits; rounding is 0."""
    noise = max(NOISE * float(np.abs(point).max()), DRAWN_TO * size)
    return toml([0.0 if abs(x) <= noise else float(f"{x:.{digits}g}") for x in point.tolist()])


def parameter_table(motion: Motion, length: str, angle: str) -> str:
    """Return a table with an entry for each parameter of a motion."""
    entries = [(f"{name}_deg", angle) if kind == "rotation" else (name, length) for name, kind in motion.parameters]
    return "{ " + ", ".join(f"{name} = {value}" for name, value in entries) + " }"


def sizes(pair: Array) -> str:
    """Return a scale pair to be read."""
    return ", ".join(f"{x:.6g}" for x in pair.tolist())


def quoted(path: str | Path) -> str:
    """Return a path as a shell takes it: in quotes where needed, and never for an option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


def short(features: Sequence[Feature], bodies: tuple[Body, Body]) -> str:
    """Return the labels of contacts of two bodies, the first ones where all are very long: "... and 3 more"."""
    return _listed([own.described(*bodies) for own in features], " and ", LONGEST)


def _listed(names: Sequence[str], between: str = ", ", longest: int = SHORT_LIST) -> str:
    """Return names in a row, as many as are no longer than this together, the first at least: "F1, F2 and 3 more"."""
    most = next((k for k in range(1, len(names)) if len(between.join(names[: k + 1])) > longest), len(names))
    return between.join(names[:most]) + (f" and {len(names) - most} more" if most < len(names) else "")


def shown(text: str) -> str:
    """Return a text for a comment: in one line, without control characters."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)
