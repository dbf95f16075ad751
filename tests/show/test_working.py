"""Working on the project: the fast tests, and what CONTRIBUTING.md and the hooks name."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest
from conftest import FAST

ROOT = Path(__file__).parents[2]
PACKAGES = sorted(path.parent.name for path in (ROOT / "fcdm_opt").glob("*/__init__.py"))


@cache
def imported(path: Path) -> set[str]:
    """Return the packages of fcdm_opt that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        found |= {module.split(".")[1] for module in modules if module.startswith("fcdm_opt.")}
    return found


def test_every_fast_file_is_there() -> None:
    assert {path.stem for path in (ROOT / "tests").rglob("test_*.py")} >= FAST


@pytest.mark.parametrize("package", PACKAGES)
def test_fast_tests_cover_every_package(package: str) -> None:
    files = [path for path in (ROOT / "tests").rglob("test_*.py") if path.stem in FAST]
    assert any(package in imported(file) for file in files)


def test_what_contributing_names_is_there() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = re.findall(r"[`(]([\w-]+/[\w./-]+\.(?:py|md|toml))[`)]", text)
    named += re.findall(r"`(fcdm_opt/[\w./]*|benchmarks/)`", text)
    assert len(named) > 8
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_hooks_call_what_the_tests_call() -> None:
    hooks = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    entries = re.findall(r"entry: \.venv/bin/([\w-]+)", hooks)
    assert entries == ["ruff", "ruff", "mypy", "lint-imports", "pytest"]
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    run = [line for line in lines if line.startswith(".venv/bin/ruff") or "pytest -n" in line]
    assert len(run) == 2
    assert all(any(f".venv/bin/{tool}" in line for line in run) for tool in entries)
