"""What works with what: each scene is asked each command, and answers what a closed form says, or is listed.

A cell of the table is one test. It works; or an InputError says why not, and the cell stands in `REFUSED`; or it is
silent or wrong, and stands in `WRONG`, with what comes out. Cells leave these lists as they come to work; none joins.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, lru_cache, reduce
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenes import OFF, SCENES, STEP, WIDE

import fcdm_opt as fo
from fcdm_opt.errors import InputError
from fcdm_opt.show.report.gather import gather, head
from fcdm_opt.show.report.page import assembly_page, assembly_report, page

NEAR = {"rel": 1e-6, "abs": 1e-9}


class Asked:
    """A scene with what is worked out once for all commands."""

    def __init__(self, name: str) -> None:
        self.name, self.scene = name, SCENES[name]

    @cached_property
    def question(self) -> Any:
        return self.scene.ask(OFF)

    @cached_property
    def solution(self) -> Any:
        return solved(self.question)

    @cached_property
    def other(self) -> Any:
        """Of parts that are off by half as much."""
        return solved(self.scene.ask(OFF / 2), effort="quick")

    @cached_property
    def map(self) -> Any:
        """Of one square, far from where the amount has a tip; of a few scenes of more, with the tip among them."""
        dear = self.name not in ("touch", "several contacts", "three sizes", "chain")
        ends, grid = ((OFF, 2.0 * OFF), (0.0, 1.0)) if dear else ((0.1 * OFF, 2.0 * OFF), (0.0, 0.5091, 1.0))
        signs = [1] * len(self.scene.sizes) or self.scene.signs
        start = 0.0 if self.scene.sizes else 1.0
        sides = [tuple(sorted(start + sign * x for x in ends)) for sign in signs]
        over = [f"scales.{part}" for part in self.question.motions] if self.scene.of_moving else None
        question = self.question.changed(scales={}) if self.scene.of_moving else self.question
        error = 1e-3 if dear else 1e-4
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("fcdm_opt.design.compensation.refined_mesh.GRID", grid)
            return fo.compensation_map(question, over=over, box=sides, error=error, budget=60, seconds=300.0)

    @property
    def mapped(self) -> Callable[[Any, Any], Any]:
        """The least amount for what the sizes of the map are off."""
        return self.scene.of_moving or self.scene.amount

    @property
    def motion(self) -> np.ndarray:
        return np.array([*self.solution.coordinates.values()])

    @property
    def moving(self) -> list[str]:
        """The parameters of the motion that are not 0."""
        return [name for name, x in self.solution.coordinates.items() if abs(x) > 1e-9]

    def made(self, x: float) -> dict[str, Any]:
        """Arguments of the question for how much the parts made are off."""
        if self.scene.sizes:
            return {"made": {self.scene.sizes[0]: x}}
        several = isinstance(self.question, fo.Assembly)
        return {"scales": dict.fromkeys(self.question.parts, 1.0 + x)} if several else {"tolerance": x}


def solved(question: Any, **how: Any) -> Any:
    return (fo.solve_assembly if isinstance(question, fo.Assembly) else fo.solve)(question, **how)


# ------------------------------------------------------------------------------------------------------------- commands


def solve(asked: Asked) -> None:
    assert asked.solution.usable, asked.solution.status.name
    assert asked.solution.amount == pytest.approx(asked.scene.least(OFF), **NEAR)


def certify(asked: Asked) -> None:
    """The bound is proved, and what proves it is checked apart."""
    found = solved(asked.question, certify=True)
    assert found.amount == pytest.approx(asked.scene.least(OFF), **NEAR)
    assert found.lower_bound >= (1.0 - 1e-4) * found.amount - (STEP if asked.name == "resolution" else 0.0)
    proofs = [check for check in fo.verify(found, proof=True).checks if check.name.startswith("proof: lower bound")]
    assert proofs, "no proof"
    assert all(check.passed for check in proofs), proofs[0].note


def verify(asked: Asked) -> None:
    """A motion that does for parts which are off by half as much does not for these."""
    judge, key = (fo.verify, "problem")
    if isinstance(asked.question, fo.Assembly):
        judge, key = fo.verify_assembly, "assembly"
    assert judge(asked.solution).passed, asked.solution.status.name
    assert not judge(replace(asked.other, **{key: asked.question})).passed


def range_(asked: Asked) -> None:
    found = fo.coherent_range(asked.question, {asked.scene.direction: 1.0})
    assert (found.low, found.high) == pytest.approx(asked.scene.range, **NEAR)


def contact_times(asked: Asked) -> None:
    found, scene = fo.contact_times(asked.question, {asked.scene.direction: 1.0}), asked.scene
    assert [touch.x for touch in found.touches] == pytest.approx(scene.touches, **NEAR)
    assert found.free == (scene.free and pytest.approx(scene.free, **NEAR))
    spans = [span for spans in found.keep_outs.values() for span in spans if span.low < 0.0 < span.high]
    told = [(span.state, span.low, span.high) for span in spans]
    ends = (pytest.approx(end, **NEAR) for end in (-1.005, 1.005))
    known = [("overlapping", *ends)] if "keep-outs" in asked.name else []
    assert told == known or isinstance(asked.question, fo.Assembly)  # of every two parts
    if asked.name == "chain, keep-outs":  # the top of the upper one, which the lower one takes along
        (span,) = (span for span in found.keep_outs["upper - lamp"] if span.state == "overlapping")
        assert (span.low, span.high) == pytest.approx((0.045, 2.005), **NEAR)


def sensitivities(asked: Asked) -> None:
    """By what is off, and of the motion by where the movable part stands: what that is shifted is taken back."""
    found, scene = asked.solution.sensitivity, asked.scene
    assert found.exists, found.reasons
    if isinstance(asked.question, fo.Assembly):  # all parts have one scale
        told = [found.sizes[name] for name in scene.sizes] or [sum(found.scales.values()), 0.0]
        assert told == pytest.approx(scene.slopes(OFF), **NEAR)
        return
    told = [found.sizes[name] for name in scene.sizes] or found.target
    assert told == pytest.approx(scene.slopes(OFF), **NEAR)
    names = [*asked.solution.parameters]
    for name in asked.moving:
        shifts = scene.motion_by_pose * np.array([name == f"T{axis}" for axis in "XYZ"])
        assert found.motion_by_pose[names.index(name), :3] == pytest.approx(shifts, **NEAR)


def what_if(asked: Asked) -> None:
    scene = asked.scene
    found = fo.whatif(asked.solution, **asked.made(2.0 * OFF))
    assert found.after.amount == pytest.approx(scene.least(2.0 * OFF), **NEAR)
    expected = scene.least(OFF) + np.dot(scene.slopes(OFF), scene.off(OFF))
    assert found.predicted_amount == pytest.approx(expected, rel=1e-6, abs=STEP if asked.name == "resolution" else 1e-9)


def budget(asked: Asked) -> None:
    """The largest tolerance within the amount at twice the tolerance, without looking at each there is."""
    scene = asked.scene
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"CELLS": 8, "SPLITS": 4}.items():
            patch.setattr(import_module("fcdm_opt.design.whatif.budget"), name, value)
        scales = "made" if isinstance(asked.question, fo.Assembly) else {(1, 1): "A", (-1, 1): "C"}[scene.signs]
        corner = "high" if scene.sizes else scales
        least = (lambda x: scene.amount(*[x] * len(scene.sizes))) if scene.sizes else scene.least
        found = fo.budget(asked.question, least(2.0 * OFF), requirements=corner, accuracy=1e-4)[corner]
    most = least(2.0 * OFF) + 1e-12
    largest = next(x for x in np.linspace(3.0 * OFF, OFF, 15_001) if least(x) <= most)
    assert found.tolerance == pytest.approx(largest, rel=2e-4)
    assert found.points < 60


def drop(asked: Asked) -> None:
    """A limit that is far away costs nothing; a keep-out what it holds the part off by."""
    name = asked.moving[0]
    found = fo.drop(asked.question.with_limits(name, (-1.0, 1.0)))
    rows = {row.name: row.amount for row in found.rows}
    assert found.amount == pytest.approx(asked.scene.least(OFF), **NEAR)
    assert {f"lower limit of {name}", f"upper limit of {name}"} <= {*found.free}
    assert np.isfinite([*rows.values()]).all()
    assert rows.get("keep-out 'post'") == (pytest.approx(OFF, **NEAR) if asked.name.startswith("keep-outs") else None)
    assert ("keep-out 'lamp'" in found.free) == (asked.name == "chain, keep-outs")


def conflicts(asked: Asked) -> None:
    """Where no parameter may be more than half of what it is to be, the limits say so."""
    half = {name: x / 2.0 for name, x in asked.solution.coordinates.items() if name in asked.moving}
    limits = {name: tuple(sorted((0.0, x))) for name, x in half.items()}
    ends = {f"{'upper' if x > 0.0 else 'lower'} limit of {name}" for name, x in half.items()}
    if asked.name == "fit":  # which is met wherever there is room for the key
        limits, ends = {"TX": (0.02, 0.03)}, {"lower limit of TX"}
    if asked.name == "six parameters":  # a tilt lifts the tip, and beside the table it is free
        limits |= dict.fromkeys(("TX", "TY", "RX", "RY"), (0.0, 0.0))
    question = reduce(lambda question, own: question.with_limits(*own), limits.items(), asked.question)
    found = fo.conflicts(question, relax=False, deviation=False)
    assert found.clashes
    assert all(ends & {*clash.names} for clash in found.clashes)
    if asked.name == "several contacts":  # a limit and the contact with the wall across keep the cube in the other wall
        assert min(len(clash.names) for clash in found.clashes) == 2


def study(asked: Asked) -> None:
    scene, offs = asked.scene, (OFF, 2.0 * OFF)
    made = [asked.made(x) for x in offs]
    vary = {key: [own[key] for own in made] for key in made[0]}
    with TemporaryDirectory() as out:
        found = fo.run_study(fo.Study(asked.question, vary, effort="quick"), out, jobs=1)
    amounts = [row["amount"] for row in found.rows()]
    assert amounts == pytest.approx([scene.least(x) for x in offs], **NEAR), [row["message"] for row in found.rows()]


def map_(asked: Asked) -> None:
    found, start = asked.map, 0.0 if asked.scene.sizes else 1.0
    at = found.box @ (0.4, 0.6)
    assert found.at(*at).amount == pytest.approx(asked.mapped(*(at - start)), abs=1e-4)


def yield_(asked: Asked) -> None:
    """The share of the map's box, by its own closed form on a grid."""
    found, scene = asked.map, asked.scene
    sizes = tuple(fo.Uniform(*ends) for ends in found.box)
    most = scene.of_moving(2.0 * OFF, 2.0 * OFF) if scene.of_moving else scene.least(2.0 * OFF)
    share = fo.assembly_yield(found, sizes=sizes, budget=0.7 * most, count=20_000).share
    start, count = 0.0 if scene.sizes else 1.0, round(160_000 ** (1 / len(found.box)))
    grid = np.meshgrid(*(low + (high - low) * (np.arange(count) + 0.5) / count - start for low, high in found.box))
    assert share == pytest.approx(np.mean(asked.mapped(*grid) <= 0.7 * most), abs=0.015), share


def pose(asked: Asked) -> None:
    """One pose for all sizes: the gap is between minus and plus what they take off it.

    Of six parameters the search is cut short, and of round faces that it is the best is not proved.
    """
    question, turning = asked.question, asked.name == "six parameters"
    if isinstance(question, fo.Problem) and (asked.name == "own motion" or asked.scene.touches[0] == -3.0):
        # a function's displacement is not known: what is looked at is; and that above the table nothing is better is
        # proved where the pose below it, at which its top does not matter, is no answer
        question = question.with_limits("TZ", (-1.0, 1.0))
    scales = {"box": (1.0 - OFF, 1.0 + OFF)} if isinstance(question, fo.Assembly) and not question.sizes else {}
    found = fo.best_pose(question, clearance="middle", effort=50 if turning else 1000, **scales)
    assert found.worst_gap == pytest.approx(asked.scene.worst, **NEAR)
    assert found.certified != (turning or asked.name.startswith("round"))
    assert fo.verify(found, proof=True).passed


def stack(asked: Asked) -> None:
    found, most = fo.stack_up(asked.question).worst(), asked.scene.amount(*[WIDE] * len(asked.scene.sizes))
    assert (found.least, found.largest) == pytest.approx((-most, most), **NEAR)


def contact_rows(asked: Asked) -> None:
    """At the motion found the contacts are closed, and nothing is overlapped."""
    rows, q = fo.contact_rows(asked.question, at=asked.motion), asked.motion
    need = getattr(asked.question, "clearance", 0.0)
    at = {} if isinstance(asked.question, fo.Assembly) else {"rho": asked.solution.rho}
    gaps = [float(row(q=q, **at)["gap"]) for row in rows.contacts]
    if asked.name == "fit":  # as far open on both sides
        need = asked.scene.open
        assert max(gaps) == pytest.approx(need, abs=1e-9)
    assert min(gaps) == pytest.approx(need, abs=STEP if asked.name == "resolution" else 1e-9)
    apart = [float(np.min(row(q=q, plane=row.start)["apart"].full())) for row in rows.clearances]
    assert min(apart) > -1e-9
    kept = {row.name.rsplit(": ", 1)[0] for row in rows.clearances if "keep-out" in row.name}
    moving = {"upper - floor", "lower - floor"} if asked.name == "chain, keep-outs" else {*kept}
    assert moving == kept if "keep-outs" in asked.name else not kept


def json_(asked: Asked) -> None:
    """What is read says the same, is judged again, and asks the same."""
    read = type(asked.solution).from_dict(json.loads(json.dumps(asked.solution.to_dict())))
    assert read.amount == asked.solution.amount
    assert fo.verify(read).passed
    again = solved(getattr(read, "problem", None) or read.assembly, effort="quick")
    assert again.amount == pytest.approx(asked.scene.least(OFF), **NEAR)


def report(asked: Asked) -> None:
    opened = SimpleNamespace(path=Path("scene.toml"), title="", note="", problems=(asked.question,), error=None)
    if isinstance(asked.question, fo.Assembly):
        text = assembly_page([{**head(opened), "cases": [0]}], [assembly_report(asked.solution)])
    else:
        text = page(gather([opened], certify=False, frames=-1.0))
    assert f"{asked.scene.least(OFF):.4g}" in text


def card(asked: Asked) -> None:
    assert f"{asked.scene.least(OFF):.4g}" in asked.solution._repr_html_()


COMMANDS = {
    "solve": solve,
    "certify": certify,
    "verify": verify,
    "range": range_,
    "contact times": contact_times,
    "sensitivities": sensitivities,
    "what-if": what_if,
    "budget": budget,
    "drop": drop,
    "conflicts": conflicts,
    "study": study,
    "map": map_,
    "yield": yield_,
    "pose": pose,
    "stack": stack,
    "rows": contact_rows,
    "JSON": json_,
    "report": report,
    "card": card,
}

# ---------------------------------------------------------------------------------------------------------------- lists

Cells = dict[tuple[str, str], str]


def cells(*groups: tuple[Any, Any, str]) -> Cells:
    """Return the reason of each cell, from scenes and commands that have one in common."""
    return {
        (scene, command): reason
        for scenes, commands, reason in groups
        for scene in ([scenes] if isinstance(scenes, str) else scenes)
        for command in ([commands] if isinstance(commands, str) else commands)
    }


NOT_ASKED = cells(
    ([name for name in SCENES if "size" not in name], "stack", "a stack-up is of sizes: here are none"),
    (("beyond", "resolution"), ("map", "yield"),
     "the amount jumps from one pair of sizes to the next, so that nothing is between them: a study asks each"),
)  # fmt: skip
REFUSED: Cells = {}
WRONG: Cells = {}
LISTED = NOT_ASKED | REFUSED | WRONG
MOST = {"REFUSED": 0, "WRONG": 0}
"""How long the lists may be: they only become shorter."""


SLOW = {
    "chain, large meshes": ("budget", "conflicts", "contact times", "drop", "JSON", "map", "verify", "yield"),
    "loop, large meshes": ("card", "conflicts", "drop", "map", "pose", "report", "study", "yield"),
    "chain, keep-outs": ("budget", "map", "pose", "yield"),
    "chain, own amount": ("conflicts", "map", "pose", "yield"),
    "chain, sizes": ("budget", "card", "conflicts"),
    "keep-outs, large mesh": ("budget", "conflicts", "map", "pose", "yield"),
    "large mesh, sizes": ("drop", "map", "report", "verify", "yield"),
    "own amount": ("budget", "report"),
    "round, sizes": ("budget", "conflicts", "map", "pose", "yield"),
    "size: axis": ("card", "conflicts", "drop", "map", "yield"),
    "size: slanted axis": ("budget", "pose", "report"),
    "size: uniform": ("card", "conflicts", "drop", "map", "yield"),
}
"""What takes long is asked of one of two scenes that are alike, or of the scenes that one is put together from."""
asked_of = lru_cache(maxsize=1)(Asked)
CELLS = [
    pytest.param(scene, command, marks=[pytest.mark.slow] * (command in SLOW.get(scene, ())), id=f"{scene}-{command}")
    for scene in SCENES
    for command in COMMANDS
]


@pytest.mark.parametrize(("scene", "command"), CELLS)
def test_a_cell_works_or_stands_in_a_list(scene: str, command: str) -> None:
    asked, cell, run = asked_of(scene), (scene, command), COMMANDS[command]
    if cell not in LISTED:
        run(asked)
        return
    found = failure(run, asked)
    assert found is not None, "works: take it off the list"
    assert cell in WRONG or isinstance(found, InputError), f"not refused but wrong: {found!r}"


def failure(run: Callable[[Asked], None], asked: Asked) -> Exception | None:
    try:
        run(asked)
    except Exception as reason:
        return reason
    return None


def test_the_lists_only_become_shorter() -> None:
    assert {"REFUSED": len(REFUSED), "WRONG": len(WRONG)} == MOST
    assert len(LISTED) == len(NOT_ASKED) + len(REFUSED) + len(WRONG), "a cell is in two lists"
    assert {*LISTED} <= {(scene, command) for scene in SCENES for command in COMMANDS}


# ------------------------------------------------------------------------------------------------------------- the page

PAGE = Path(__file__).parents[1] / "docs" / "composition.md"
BEGIN, END = "<!-- made by tests/test_composition.py -->", "<!-- up to here -->"


def table() -> str:
    """Return the table of what works with what, and the reasons of its cells."""
    marks = {**dict.fromkeys(NOT_ASKED, "n"), **dict.fromkeys(REFUSED, "r"), **dict.fromkeys(WRONG, "w")}
    numbers: dict[tuple[str, str], str] = {}  # by mark and reason
    rows = []
    for scene in SCENES:
        row = [scene]
        for command in COMMANDS:
            key = (marks.get((scene, command), ""), LISTED.get((scene, command), ""))
            if key[0] and key not in numbers:
                numbers[key] = f"{key[0]}{1 + sum(mark == key[0] for mark, _ in numbers)}"
            row.append(numbers.get(key, "+"))
        rows.append(row)
    lines = [["", *COMMANDS], ["---"] * (len(COMMANDS) + 1), *rows]
    listed = [f"- {number}: {reason}" for own in "nrw" for (mark, reason), number in numbers.items() if mark == own]
    return "\n".join([*(f"| {' | '.join(line)} |" for line in lines), "", *listed])


def written(page: str) -> str:
    """Return the page with the table as it is now."""
    before, rest = page.split(BEGIN)
    return f"{before}{BEGIN}\n\n{table()}\n\n{END}{rest.split(END)[1]}"


def test_the_page_shows_the_table_as_it_is() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == written(page), "PYTHONPATH=tests/support python tests/test_composition.py writes it"


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
