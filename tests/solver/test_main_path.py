"""The drawn main path, held against the imports: function-level ones counted, those for type checkers alone not."""

from __future__ import annotations

import ast
import inspect
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import fcdm_opt.solver
from fcdm_opt.stages.order import STAGES

ROOT = Path(fcdm_opt.solver.__file__).parents[1]
# files anything may use
GROUND = {
    "compiling", "errors", "lazy_import", "moved_files", "pacing", "plain", "process_pool", "threads", "tolerances",
    "version",
}  # fmt: skip

PACKAGES = {
    "geometry": set(),
    "curve": {"geometry"},
    "motion": {"geometry"},
    "problem": {"motion", "curve", "geometry"},
    "model": {"problem", "motion", "curve", "geometry"},
    "proof": {"model", "problem", "motion", "curve", "geometry"},
    "stages": {"proof", "model", "problem", "motion", "curve", "geometry"},
    "along": {"stages", "model", "problem", "motion", "curve", "geometry"},
    "judge": {"proof", "problem", "curve", "geometry"},
    "assembling": {"judge", "stages", "model", "problem", "geometry"},
    "solver": {"assembling", "judge", "stages", "model", "problem"},
    "drafting": {"solver", "model", "problem", "motion", "curve", "geometry"},
    "design": {"solver", "judge", "along", "stages", "proof", "model", "problem", "motion", "curve", "geometry"},
    "show": {"design", "solver", "judge", "along", "model", "problem", "curve", "geometry"},
    "cli": {"show", "design", "drafting", "solver", "judge", "along", "problem"},
    "__main__": {"cli"},
}
"""What each package may import, from the ground up: a package stands on those above it in this table."""

DOORS_UP: set[tuple[str, str]] = set()
"""Imports against that order."""

PATH = ("problem", "model", "stages", "judge")
"""The packages that a problem goes through in `solve`, each left for good."""

SAME_NAME: set[str] = set()
"""Class names in two modules that mean the same."""


def modules() -> dict[str, Path]:
    """Every module of the package, by its dotted name."""
    named = {}
    for path in (ROOT / "fcdm_opt").rglob("*.py"):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        named[name.removesuffix(".__init__")] = path
    return named


MODULES = modules()


def statements(tree: ast.AST) -> Iterator[ast.stmt]:
    """All statements but those under `if TYPE_CHECKING`."""
    for node in ast.iter_child_nodes(tree):
        checking = isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        if not isinstance(node, ast.expr) and not checking:
            if isinstance(node, ast.stmt):
                yield node
            yield from statements(node)


@cache
def imported(path: Path) -> set[str]:
    """Modules of the package that a file imports."""
    found = set()
    for node in statements(ast.parse(path.read_text())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
        if isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{name}" if f"{node.module}.{name}" in MODULES else node.module for name in names]
        found |= {name for name in names if name in MODULES}
    return found


def imports() -> dict[str, set[str]]:
    """What each module of the package imports of it."""
    return {name: imported(path) for name, path in MODULES.items()}


def package(module: str) -> str:
    """The package, or the single file, right under the root; "" for the root itself."""
    return module.partition(".")[2].partition(".")[0]


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Strongly connected parts of more than one module."""

    def reached(start: str) -> set[str]:
        seen, open_ends = set(), [start]
        while open_ends:
            for module in graph[open_ends.pop()] - seen:
                seen.add(module)
                open_ends.append(module)
        return seen

    beyond = {module: reached(module) for module in graph}
    parts = {frozenset(other for other in far if module in beyond[other]) for module, far in beyond.items()}
    return [set(part) for part in parts if len(part) > 1]


def test_packages_import_those_below_them_in_the_picture_and_no_others():
    wrong = set()
    for module, others in imports().items():
        own = package(module)
        if own in GROUND | {""}:
            continue
        for other in map(package, others):
            if other not in PACKAGES[own] | GROUND | {own} and (module, other) not in DOORS_UP:
                wrong.add((module, other))
    assert not wrong


def test_the_table_goes_one_way_and_knows_every_package():
    places = {name: k for k, name in enumerate(PACKAGES)}
    for name, others in PACKAGES.items():
        assert all(places[other] < places[name] for other in others), name
    assert {package(module) for module in MODULES} == {*PACKAGES, *GROUND, ""}


def test_what_anything_may_use_uses_nothing_but_its_like():
    for module, others in imports().items():
        if package(module) in GROUND:
            assert {package(other) for other in others} <= GROUND, module


def test_nothing_but_the_command_line_imports_the_root():
    assert {module for module, others in imports().items() if "fcdm_opt" in others} == set()


def test_no_circle_of_imports_is_larger_than_two_files():
    assert [part for part in circles(imports()) if len(part) > 2] == []


def test_a_problem_goes_from_file_to_judge_without_returning():
    """Of the packages on the path none imports a later one, and `solver` imports those, and what asks for several."""
    for k, name in enumerate(PATH):
        assert not PACKAGES[name] & {*PATH[k + 1 :], "solver"}, name
    assert {package(other) for other in imports()["fcdm_opt.solver"]} - GROUND == {*PATH, "assembling"}


def test_the_judge_takes_nothing_from_what_finds_motions():
    """But for the checkers of evidence and of the only motion, which stages ask what it shows, and their arithmetic."""
    taken = {other for module, others in imports().items() if package(module) == "judge" for other in others}
    assert {other for other in taken if package(other) in ("model", "stages", "solver", "along")} == set()
    assert {other for other in taken if package(other) == "proof"} == {
        "fcdm_opt.proof.checker",
        "fcdm_opt.proof.intervals",
        "fcdm_opt.proof.uniqueness",
    }


def test_solve_is_one_screen_and_its_steps_stand_in_order():
    source = inspect.getsource(fcdm_opt.solver._solved)
    assert len(source.splitlines()) <= 30
    steps = ["Task.of(", "_least_motion(", "_proved(", "in_steps(", "reported(", "judged("]
    places = [source.index(step) for step in steps]
    assert places == sorted(places)
    assert next(iter(STAGES)) == "satisfied"
    assert "solve(" not in source.replace("_solved(", "")


def test_no_class_name_stands_in_two_modules():
    homes = defaultdict(set)
    for module, path in MODULES.items():
        for name in re.findall(r"^ *class (\w+)[(:]", path.read_text(), re.MULTILINE):
            homes[name].add(module)
    assert {name: sorted(places) for name, places in homes.items() if len(places) > 1 and name not in SAME_NAME} == {}


def test_no_one_but_motions_asks_of_which_kind_a_step_is():
    kinds = re.compile(r"isinstance\([^)]*\b(Translation|Rotation|Screw|Free|OwnMotion|Relative|Straight)\b")
    asked = {module for module, path in MODULES.items() if kinds.search(path.read_text())}
    later = {"design.fixed_pose.worst"}
    assert {module for module in asked if "motion" not in module.split(".")} <= {f"fcdm_opt.{own}" for own in later}
