"""The notebooks run as a reader runs them, and what they show last is what pencil and paper give."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")

FOLDER = Path(__file__).parents[2] / "problems" / "notebooks"
NAMES = ("first_steps", "design_study")


def listed() -> dict[str, int]:
    """Return every file of the problems' folder with the time of its last change; not what Python keeps of scripts."""
    files = (path for path in FOLDER.parent.rglob("*") if path.is_file() and path.parent.name != "__pycache__")
    return {str(path): path.stat().st_mtime_ns for path in files}


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Any]:
    """Execute one in its folder, once; what a kernel keeps on disk goes to a temporary folder."""

    @cache
    def executed(name: str) -> Any:
        own, before = tmp_path_factory.mktemp("kernel"), listed()
        with pytest.MonkeyPatch.context() as patch:
            for variable in ("IPYTHONDIR", "JUPYTER_RUNTIME_DIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR"):
                patch.setenv(variable, str(own))
            notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
            where = {"metadata": {"path": str(FOLDER)}}
            nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources=where).execute()
        assert listed() == before, "a notebook left files, or changed some"
        return notebook

    return executed


def last_shown(notebook: Any) -> dict[str, Any]:
    (output,) = notebook.cells[-1].outputs
    value: dict[str, Any] = ast.literal_eval(output["data"]["text/plain"])
    return value


def test_all_notebooks_are_known() -> None:
    assert sorted(path.stem for path in FOLDER.glob("*")) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_committed_without_output(name: str) -> None:
    text = (FOLDER / f"{name}.ipynb").read_text(encoding="utf-8")
    notebook = nbformat.reads(text, as_version=4)
    nbformat.validate(notebook)
    assert (notebook.nbformat, notebook.nbformat_minor) == (4, 5)
    assert notebook.metadata.kernelspec.name == "python3"
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(code) > 5
    assert all(cell.execution_count is None and not cell.outputs for cell in code)
    identities = [cell.id for cell in notebook.cells]
    assert len(set(identities)) == len(identities)
    assert str(FOLDER.parent.parent) not in text
    assert '"/' not in "".join(cell.source for cell in code), "a path from the root"


@pytest.mark.parametrize("name", [NAMES[0], pytest.param(NAMES[1], marks=pytest.mark.slow)])
def test_every_cell_shows_what_it_is_for(executed: Callable[[str], Any], name: str) -> None:
    """No cell fails or complains, and each shows something but the one that imports."""
    first, *code = [cell for cell in executed(name).cells if cell.cell_type == "code"]
    assert not first.outputs
    for cell in code:
        assert cell.outputs, cell.source
        for output in cell.outputs:
            assert output.output_type in ("display_data", "execute_result", "stream"), output
            assert output.get("name") != "stderr", output
    shown = [output.data for cell in code for output in cell.outputs if "data" in output]
    assert sum("image/png" in data for data in shown) == 1
    assert sum("text/html" in data for data in shown) >= 5


def test_first_steps_are_right(executed: Callable[[str], Any]) -> None:
    """The probe sinks by 0.02 and the table by 0.01; the peg keeps 10 - 9.75 * 1.01 - 0.05 to each side of the axis."""
    shown = last_shown(executed("first_steps"))
    room = 10.0 - 9.75 * 1.01 - 0.05
    shift = (room - 0.25, 0.125 - room)
    assert shown["lift"] == pytest.approx(0.01, abs=1e-12)
    assert shown["lift at 3 %"] == pytest.approx(0.015, abs=1e-12)
    assert shown["predicted"] == pytest.approx(0.015, abs=1e-9)
    assert shown["turn"] == pytest.approx([-math.atan(2.0), math.atan(2.0)], abs=1e-12)
    assert shown["shift"] == pytest.approx(shift, abs=1e-9)
    assert shown["shift from the file"] == pytest.approx(shift, abs=1e-9)
    least = math.hypot(*shift)
    assert least * (1.0 - 1e-4) <= shown["no shift below"] <= least * (1.0 + 1e-9)
    assert shown["verified"] == [True] * 4


def amounts(room: float) -> dict[str, float | None]:
    """Return the least shift of each family that brings |x|, |y| <= room, from x = 0.25 and y = -0.125."""
    x, y = 0.25 - room, max(0.125 - room, 0.0)
    inside = room >= 0.0
    return {
        "x": x if room >= 0.125 else None,
        "x, y": math.hypot(x, y) if inside else None,
        # along (-2, 1) / sqrt(5), until both are within
        "slide to the axis": math.sqrt(5.0) * max(x / 2.0, y) if inside else None,
    }


@pytest.mark.slow
def test_design_study_is_right(executed: Callable[[str], Any]) -> None:
    """The room to each side is S - 0.05 with S = 10 rho_2 - 9.75 rho_1, see peg_square.toml."""
    shown = last_shown(executed("design_study"))
    met = 0
    for tolerance in (0.002, 0.004, 0.006, 0.008, 0.010, 0.012):
        for family, amount in amounts(0.2 - 19.75 * tolerance).items():
            found = shown["amounts"][family].get(tolerance)
            assert (found is None) == (amount is None), (tolerance, family)
            assert amount is None or found == pytest.approx(amount, abs=1e-8)
            met += amount is not None
    assert met == 11
    assert sum(map(len, shown["amounts"].values())) == met
    assert shown["status along x"] == ["SOLVED", *["INFEASIBLE"] * 5]

    # (0.05 + u)^2 + (u - 0.075)^2 = 0.2^2 with u = 19.75 tolerance
    u = (0.05 + math.sqrt(0.05**2 - 8.0 * (0.05**2 + 0.075**2 - 0.2**2))) / 4.0
    assert shown["tolerance within 0.2"] == pytest.approx(u / 19.75, rel=2e-9)

    exact = amounts(10.0 * 0.996 - 9.75 * 1.004 - 0.05)["x, y"]
    assert exact is not None
    assert 0.0 < shown["error"] <= 1e-3
    assert abs(shown["looked up"] - exact) <= shown["error"]

    # pairs fail below the line S = 0.25 - u: a triangle at the corner (1.01, 0.99) of a square of sides 0.02
    off = 19.75 * 0.01 - u
    share = 1.0 - (off / 9.75) * (off / 10.0) / 2.0 / 0.02**2
    assert shown["share"] == pytest.approx(share, abs=4.0 * math.sqrt(share * (1.0 - share) / 1e6) + 1e-4)
    assert shown["interval"][0] < shown["share"] < shown["interval"][1]
