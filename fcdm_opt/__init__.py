"""Smallest re-positioning of contacting polyhedral parts under size tolerances.

Everything is loaded when first used: `import fcdm_opt` alone imports no numerical library. The public names, and where
they are from, stand in the stub beside this file, which type checkers and editors read too.
"""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

_HOME = {
    alias.name: str(statement.module)
    for statement in ast.parse(Path(__file__).with_suffix(".pyi").read_text("utf-8")).body
    if isinstance(statement, ast.ImportFrom)
    for alias in statement.names
}
__all__ = sorted(_HOME)
SYNONYMS = {"union": "joined", "fuse": "joined", "difference": "cut", "subtract": "cut"}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        hint = f"; did you mean {SYNONYMS[name]!r}?" if name in SYNONYMS else ""
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
