"""The commands, a row each: what else is told of them, in help and in refusals, is read off here.

What a row's command does is the function NAME_command of one of the modules of this package.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module

from fcdm_opt.cli.guarding import BAD_INPUT, NO_MOTION, NOT_VERIFIED, SOLVED

BEGIN, LEAST = "How do I begin?", "How do the parts touch, and what is the smallest motion?"
OTHERWISE = "What if sizes, tolerances, motions or shapes were different?"
FAST = "How fast and how right is it?"
WELL, BAD = {SOLVED: "all well"}, {BAD_INPUT: "bad input"}
NO_TIME, WRONG = {NO_MOTION: "the time given was over"}, {NOT_VERIFIED: "a motion that was not verified"}
ANSWERED = {SOLVED: "all solved and verified", NO_MOTION: "a case without a motion to use"}


@dataclass(frozen=True, kw_only=True)
class CommandRow:
    """A command.

    Attributes
    ----------
    question : str
        What it answers: commands stand below it in the overview.
    ends : dict
        The exit codes with which it ends, besides those of defects and interrupts, and what they mean there.
    examples : str
        What its help ends with, a line each without "fcdm-opt NAME"; all of them run as they stand.
    assemblies : bool
        Whether it takes files of assemblies.
    surplus : str
        What is said where it is given more than it takes.
    answers : dict
        By key of a case in its JSON document, "" for the case itself: the classes, as module:class of this package.
    about : "case", "file" or "document"
        What these keys are of.
    lent : str
        Its help in a sentence where the package `fcdm_opt_benchmarks` brings it, see `LentCommand`.
    """

    question: str
    ends: dict[int, str]
    examples: str
    assemblies: bool = False
    surplus: str = ""
    answers: dict[str, tuple[str, ...]] = field(default_factory=dict)
    about: str = "case"
    lent: str = ""

    def lines(self, name: str) -> str:
        """Return its examples as whole lines."""
        return "\n".join(f"fcdm-opt {name} {line}".rstrip() for line in self.examples.split("\n"))

    def kinds(self) -> dict[str, list[type]]:
        """Return the classes of its answers, by key."""
        named = {key: [own.split(":") for own in classes] for key, classes in self.answers.items()}
        return {key: [getattr(import_module(f"fcdm_opt.{module}"), name) for module, name in pairs]
                for key, pairs in named.items()}  # fmt: skip


ROWS = {
    "init": CommandRow(
        question=BEGIN, ends={SOLVED: "the file is written", **NO_TIME, **BAD},
        examples="""problems/meshes/keyway_key.off problems/meshes/keyway_shaft.ply
peg.stl plate.stl --unit mm --out peg.toml --force""",
        surplus="allowed: the meshes of two parts; how a file of more parts is written: docs/assemblies.md",
    ),
    "schema": CommandRow(
        question=BEGIN, ends={**WELL, **BAD},
        examples="""> problem.schema.json
--what study > study.schema.json""",
    ),
    "warmup": CommandRow(question=BEGIN, ends={SOLVED: "all kernels are kept"}, examples=""),
    "curve": CommandRow(
        question=LEAST, ends={**WELL, **BAD},
        examples="""problems/example1.toml
problems/example1.toml --out out""",
        answers={"curves": ("curve.decision_curve:DecisionCurveList",)}, about="file",
    ),
    "solve": CommandRow(
        question=LEAST, assemblies=True, ends={**ANSWERED, **BAD, **WRONG},
        examples="""problems/example1.toml problems/example2.toml
problems/example1.toml --case B --certify --out out
problems/peg_square.toml --case "A at the wall" --json
problems/assemblies/loop_of_four.toml --out out""",
        answers={"": ("problem.solution:Solution", "problem.assembled:AssemblySolution")},
    ),
    "range": CommandRow(
        question=LEAST, assemblies=True, ends={**WELL, **BAD},
        examples="""problems/example1.toml --case A
problems/example1.toml --case B --direction TZ=1,RZ_deg=2""",
        answers={"": ("along.coherent_range:CoherentRange", "along.coherent_range:AssemblyRange")},
    ),
    "report": CommandRow(
        question=LEAST, assemblies=True,
        ends={
            **ANSWERED,
            NO_MOTION: "a case without a motion to use, or left out as the time given was over",
            **BAD, **WRONG,
        },
        examples="problems/example1.toml --out report.html",
    ),
    "whatif": CommandRow(
        question=OTHERWISE, assemblies=True,
        ends={
            SOLVED: "answered: that nothing can be done is an answer, too",
            NO_MOTION: "with --set the changed question has no motion; without options the motion leaves the fit; or "
            "the time given was over",
            **BAD, **WRONG,
        },
        examples="""problems/peg_tapered.toml --case A
problems/peg_tapered.toml --case B --set tolerance=0.02
problems/peg_tapered.toml --case A --budget 0.1 --compare
problems/peg_square_tight.toml --conflicts""",
        answers={
            "whatif": ("design.whatif.whatif:WhatIf",), "budget": ("design.whatif.budget:Budgets",),
            "solution": ("problem.solution:Solution", "problem.assembled:AssemblySolution"),
            "conflicts": ("design.whatif.conflicts:Conflicts",), "drop": ("design.whatif.constraints:Costs",),
            "compare": ("design.whatif.compare:Comparison",),
        },
    ),
    "map": CommandRow(
        question=OTHERWISE, assemblies=True,
        ends={
            **WELL,
            NO_MOTION: "a map without any motion, or the time given was over",
            **BAD,
            NOT_VERIFIED: "a yield that was not confirmed",
        },
        examples="""problems/peg_tapered.toml --case A --out out
problems/peg_tapered.toml --case A --budget 1 --out out""",
        answers={
            "map": ("design.compensation.compensation_map:CompensationMap",),
            "yield": ("design.compensation.assembly_yield:AssemblyYield",),
        },
    ),
    "pose": CommandRow(
        question=OTHERWISE, assemblies=True,
        ends={
            SOLVED: "a pose that is confirmed",
            NO_MOTION: "no pose in the window, or none was found in time",
            **BAD,
            NOT_VERIFIED: "a pose that was not confirmed",
        },
        examples="""problems/peg_tapered.toml --case A
problems/peg_tapered.toml --case A --clearance=-inf,0.5""",
        answers={
            "best_pose": ("design.fixed_pose.best_pose:BestPose",),
            **dict.fromkeys(("as_drawn", "at_the_best_pose"), ("design.fixed_pose.clearances:Clearances",)),
        },
    ),
    "faces": CommandRow(
        question=OTHERWISE, assemblies=True, ends={**WELL, **BAD}, examples="problems/slot_and_key.toml",
        answers={"faces": ("show.stacks:FacesByRole",)}, about="file",
    ),
    "stack": CommandRow(
        question=OTHERWISE, assemblies=True,
        ends={**WELL, **BAD, NOT_VERIFIED: "a share of pairs that was not confirmed"},
        examples="""problems/slot_and_key.toml
problems/slot_and_key.toml --gap 0.04,0.12 --out out
problems/slot_and_key.toml --gap 0.04,0.12 --cost key_width=1""",
        answers={
            "stack": ("design.stack.stack_up:StackUp",), "yield": ("design.stack.spread:GapYield",),
            "allocation": ("design.stack.allocation:Allocation",),
        },
    ),
    "study": CommandRow(
        question=OTHERWISE, assemblies=True,
        ends={
            SOLVED: "all points are worked out; that some have no motion is a result",
            BAD_INPUT: "bad input, of a point too",
            NOT_VERIFIED: "a point that failed, is left, or was not verified",
        },
        examples="problems/studies/tolerance_example1.toml --out out/tolerance",
        answers={"": ("design.study.results:StudyResult",)}, about="document",
    ),
    "bench": CommandRow(
        question=FAST, ends={**WELL, **BAD, NOT_VERIFIED: "an answer of ours is wrong"},
        examples="--quick --only contact --out out/bench",
        lent="Chart speed against accuracy.",
    ),
    "stability": CommandRow(
        question=FAST, ends={**WELL, **BAD, NOT_VERIFIED: "an answer of ours is wrong, hung or crashed"},
        examples="--quick --out out/stability",
        lent="Map where each method fails.",
    ),
}  # fmt: skip
