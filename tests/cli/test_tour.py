"""The tour: its first commands print what it shows, on files made as it says."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from documents import ROOT, Document, documents
from typer.testing import CliRunner

from fcdm_opt.cli import app

TOLD = ("init", "solve", "range", "whatif")
"""Commands that are run here; the others take long."""
MEASURED = re.compile(r"time of \d+ case|still ")  # what depends on the machine


def tour() -> Document:
    return next(page for page in documents("docs/tour.md"))


def shown(text: str) -> list[tuple[list[str], list[str]]]:
    """Return the commands of a console block, each with the lines that it prints."""
    found: list[tuple[str, list[str]]] = []
    for line in text.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        elif found[-1][0].endswith("\\"):
            found[-1] = (found[-1][0].removesuffix("\\") + line, [])
        else:
            found[-1][1].append(line)
    return [(shlex.split(command), lines) for command, lines in found]


def told(lines: list[str]) -> list[str]:
    return "\n".join(line.rstrip() for line in lines if not MEASURED.match(line)).strip().splitlines()


def test_the_tour_is_as_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "problems").symlink_to(ROOT / "problems")
    monkeypatch.chdir(tmp_path)
    page, ran = tour(), []
    for block in page.blocks:
        if block.language == "toml" and "[[vary]]" not in block.text:
            _edited(Path("out/tour/mine.toml"), block.text)
        if block.language != "console":
            continue
        for command, lines in shown(block.text):
            if command[0] == "mkdir":
                Path(command[-1]).mkdir(parents=True)
            elif command[0] == "cp":
                (Path(command[2]) / Path(command[1]).name).write_bytes(Path(command[1]).read_bytes())
            elif command[1] in TOLD and "--budget" not in command:
                printed = CliRunner().invoke(app, command[1:])
                assert printed.exit_code == 0
                assert told(printed.output.splitlines()) == told(lines)
                ran.append(command[1])
    assert tuple(ran) == TOLD


def _edited(path: Path, change: str) -> None:
    """Put the lines of a change in place of those with the same key; what has none goes after the line before it."""
    lines, at = path.read_text(encoding="utf-8").splitlines(), 0
    for line in change.splitlines():
        key = line.split(" = ")[0]
        own = [k for k, old in enumerate(lines) if old.startswith(f"{key} = ")]
        if own:
            at = own[0]
            lines[at] = line
        else:
            at += 1
            lines.insert(at, line)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
