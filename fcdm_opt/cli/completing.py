"""What a shell offers at a press of the tab key, besides commands and options; read without any library."""

from __future__ import annotations

from pathlib import Path

import typer

from fcdm_opt.problem.syntax import parsed

MOST_READ = 2**20  # bytes of a problem file, so that no key is slow


def problem_files(incomplete: str) -> list[str]:
    """Return the TOML files that a path may go on to; none where folders may be meant, which the shell knows best."""
    try:
        start = Path(incomplete)
        folder, begun = (start, "") if incomplete.endswith("/") else (start.parent, start.name)
        found = [path for path in sorted(folder.iterdir()) if path.name.startswith(begun or "")]
        if any(path.is_dir() and not path.name.startswith(".") for path in found):
            return []
    except (OSError, ValueError):
        return []
    head = incomplete[: len(incomplete) - len(begun)]
    return [head + path.name for path in found if path.suffix == ".toml" and not path.name.startswith(".")]


def case_names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the cases of the files that are on the line already."""
    names: list[str] = []
    read = (
        *(ctx.params.get("files") or ctx.params.get("sources") or ()),
        *ctx.args,
    )  # args: before "--case" has a value
    for path in map(Path, map(str, read)):
        try:
            if path.stat().st_size > MOST_READ or not path.is_file():
                continue
            cases = parsed(path.read_text(encoding="utf-8-sig")).get("case", [])
            names += [case["name"] for case in cases if isinstance(case.get("name"), str)]
        except (OSError, ValueError, AttributeError, TypeError, RecursionError):
            continue
    return [name for name in dict.fromkeys(names) if name.startswith(incomplete)]
