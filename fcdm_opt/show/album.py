"""Pictures, written to one directory; every name is given once."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.lazy_import import extra
from fcdm_opt.problem.assembled import AssemblySolution
from fcdm_opt.problem.solution import Bounded, Solution
from fcdm_opt.show import Figure, save, scene
from fcdm_opt.show.assemblies import assembly_figure, barriers
from fcdm_opt.show.glossary import EXPLAINED
from fcdm_opt.show.plots import before_after_figure, decision_curve_figure
from fcdm_opt.show.sections import Touching
from fcdm_opt.show.sensitivities import bars, sensitivities_figure
from fcdm_opt.show.texts import asked_text, goal_text
from fcdm_opt.show.verdict import motion_text, poses_shown, refusal_text, straight_texts, verdict_text

LONGEST_NAME = 100  # characters of a picture's file name, before its number and ending


class Album:
    """A directory that pictures are written to, as PNG and SVG; made if it is not there.

    `say` gets a line for each file that was written, or could not be: then it has `failed`. With `dark` pictures are
    light on dark. Raises `InputError` where the directory cannot be made, or nothing can be drawn: before anything is
    solved.
    """

    def __init__(self, directory: Path, say: Callable[[str], None], *, dark: bool = False) -> None:
        extra("matplotlib", "pictures", key="--out")
        self._directory, self._say, self._dark = directory, say, dark
        self._given: set[str] = set()
        self._views: dict[str, tuple[float, float]] = {}  # of each file: all its cases are seen from one place
        self.failed = False
        try:
            directory.mkdir(parents=True, exist_ok=True)
        except OSError as reason:
            what = f"not a directory that can be written ({reason.strerror})"
            raise InputError(what, key="--out", found=str(directory)) from reason

    def add_curve(self, stem: str, title: str, curve: DecisionCurve, *, unit: str = "", made: bool = False) -> None:
        """Add a decision curve, and its bodies as drawn, or as they are made, in a unit of length."""
        name = self._once(stem)
        self._write(f"{name}-curve", decision_curve_figure(curve, title=title))
        drawn = scene.ShownBodies.of(curve.movable, curve.static)
        figure = scene.scene_figure(drawn, unit=unit, title=title, caption="as made" if made else "as drawn")
        self._write(f"{name}-scene", figure)

    def add_solution(self, stem: str, title: str, solution: Bounded) -> None:
        """Add the decision curve before and after a motion, the bodies after it, and what the amount depends on.

        Of an assembly the parts after their motions.
        """
        if isinstance(solution, AssemblySolution):
            name = solution.assembly.name
            self.add(f"{stem}-{name}", assembly_figure(solution, title=f"{title}: case {name}"), ending="-scene")
            return
        assert isinstance(solution, Solution)
        problem = solution.problem
        name = self._once(f"{stem}-{problem.name}")
        title = f"{title}: case {problem.name}"
        meant = EXPLAINED[problem.goal].removeprefix("goal: ")
        text = "; ".join([verdict_text(solution), *straight_texts(solution)])
        caption = f"{asked_text(problem)}, goal {goal_text(problem)} ({meant}): {text}"
        pacing.at("drawing")
        self._write(f"{name}-curve", before_after_figure(problem, solution, title=title, caption=caption))
        view = scene.view_of(problem.curve, tuple(problem.nominal_pair.tolist()), scene.shifts_of(problem))
        view = self._views.setdefault(stem, view)
        figure = solution_figure(solution, view=view, title=title, caption=f"{text}{{sizes}}")
        self._write(f"{name}-scene", figure)
        if solution.usable and sum(abs(bar.value) > 0.0 for bar in bars(solution.sensitivity, problem)) > 1:
            self._write(f"{name}-sensitivities", sensitivities_figure(solution, title=title, caption=caption))

    def add(self, stem: str, figure: Figure, *, ending: str = "") -> str:
        """Add a figure; return its name: the stem, which is given once, and what kind of picture it is."""
        name = f"{self._once(stem)}{ending}"
        self._write(name, figure)
        return name

    def _once(self, wanted: str) -> str:
        safe = re.sub(r"[^A-Za-z0-9._-]+", "_", wanted).lstrip(".")[:LONGEST_NAME]
        stem, count = safe, 1
        while stem in self._given:
            count += 1
            stem = f"{safe}-{count}"
        self._given.add(stem)
        return stem

    def _write(self, name: str, figure: Figure) -> None:
        try:
            picture, *others = save(figure, self._directory / name, dark=self._dark)
            self._say(f"wrote {picture}{''.join(f' and {other.suffix}' for other in others)}")
        except OSError as reason:
            self._say(f"error: --out: the picture {name!r} could not be written: {reason.strerror}")
            self.failed = True


def solution_figure(
    solution: Solution, *, view: tuple[float, float] | None = None, title: str = "", caption: str = ""
) -> Figure:
    """Draw what an answer does: the bodies after it, their old place, the motion, and each contact magnified.

    Seen from a `view` (elevation, azimuth; degrees), by default from where the nominal contact is seen best. In the
    caption "{sizes}" stands for the sizes at which the bodies are shown.
    """
    drawn, rho = drawn_scene(solution, view)
    moved, refused = drawn["shown"].moves, drawn["shown"].banner
    drawn["shown"] = replace(drawn["shown"], banner=motion_text(solution)) if moved else drawn["shown"]
    shown = "shown" if moved else f"shown {refused.rpartition(', ')[2] or 'unmoved'}"
    meant = "the sizes made" if solution.problem.made else "the sizes drawn"
    at = meant if (rho == 1.0).all() else f"{rho[0]:.6g} and {rho[1]:.6g} times {meant}"
    caption = caption.replace("{sizes}", f" ({shown} at {at})")
    if texts := scene.numbered_contacts(drawn["contacts"], drawn["shown"]):
        caption += f"\ncontacts: {'; '.join(texts)}"
    return scene.scene_figure(**drawn, title=title, caption=caption)


def solution_pieces(solution: Solution) -> scene.ScenePieces:
    """Draw the same in pieces, for a report, which has the motion in words."""
    return scene.scene_pieces(**drawn_scene(solution)[0])


def drawn_scene(solution: Solution, view: tuple[float, float] | None = None) -> tuple[dict[str, Any], Array]:
    """Return what is drawn of an answer, and at which sizes."""
    problem = solution.problem.reformulated
    transform, where = poses_shown(solution)
    refused, rho = refusal_text(solution, where), problem.nominal_pair if solution.rho is None else solution.rho
    rho = solution.pair if refused else rho
    moved = problem.curve_after(transform, rho)
    keep_out = [keep_out.body.scaled(keep_out.ends[1]) for keep_out in problem.keep_out]
    if view is None:  # with sizes by name there may be no nominal contact
        rest = transform is None or problem.curve.contact_sets(problem.nominal_pair)
        curve, at = (problem.curve, problem.nominal_pair) if rest else (moved, rho)
        view = scene.view_of(curve, tuple(at.tolist()), scene.shifts_of(problem))
    bodies = problem.movable, problem.static
    shown = scene.ShownBodies.of(*bodies, rho=rho, transform=transform, keep_out=keep_out, view=view, banner=refused)
    counted = problem.contacts or solution.features
    contacts, names = list[Touching](), [label.partition(": ")[2] for *_, label in shown.solids]
    if refused:  # why there is no motion to use
        part = problem.movable.scaled(rho[0])
        part = part if transform is None else part.moved(transform)
        placed = part, problem.static.scaled(rho[1]), *(solid for solid, *_ in shown.solids[2:])
        needs: dict[tuple[int, ...], float] = {(0, 1): problem.clearance}
        for own, body in zip(problem.keep_out, keep_out, strict=True):
            needs |= {(0, k): own.clearance for k, (solid, *_) in enumerate(shown.solids) if solid is body}
        shown, contacts = replace(shown, moves=()), barriers(placed, names, [0], needs)
    contacts = contacts or scene.contacts_of(moved, rho, shown, counted, problem)
    if not contacts and (gap := pacing.in_time(Touching.gap, moved, rho, *shown.bodies, late=None)) is not None:
        contacts = [gap]
    for k in range(2, 2 if refused else len(names)):  # keep-outs that the part stands at
        both = replace(shown, solids=[shown.solids[0], shown.solids[k]], named=None)
        if met := scene.contacts_of(decision_curve(*both.bodies), np.ones(2), both):
            if len(contacts) == 1:
                contacts = [contacts[0]._replace(number=1, text=f"{names[0]} - {names[1]}")]
            number, label = max((own.number for own in contacts), default=0) + 1, f"{names[0]} - {names[k]}"
            contacts += [own._replace(pair=(0, k), number=number, text=label) for own in met]
    return {"shown": shown, "contacts": contacts, "unit": problem.unit}, rho
