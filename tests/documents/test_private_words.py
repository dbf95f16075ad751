"""Words that no engineer knows in the code's sense only become fewer: new names take standard terms."""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "fcdm_opt"
INSTEAD = {
    "way": "direction", "ways": "directions, choices", "together": "contact_system, stacked",
    "alone": "by itself: say what", "beside": "process_pool, next_to", "besides": "untracked",
    "doors": "lazy_import", "reach": "circumradius, bound", "left": "rest, remaining", "host": "carrier",
    "hosts": "carriers", "seat": "flush contact", "standing": "permanent", "hollow": "is_surface",
    "skin": "triangles", "outline": "loop", "outlines": "loops", "opponent": "obstacle",
    "opponents": "obstacles", "hand": "orientation", "hands": "orientations", "merit": "objective",
    "deed": "instruction", "deeds": "instructions", "told": "label, text", "said": "text",
    "heard": "has_listeners", "spare": "unused, exclude",
}  # fmt: skip
MOST = {
    "alone": 3, "hands": 1, "left": 33, "outlines": 3, "reach": 2, "standing": 3, "together": 1, "told": 10,
    "way": 2, "ways": 3,
}  # fmt: skip


def named(tree: ast.AST) -> list[str]:
    """Return the names that are given in a file: of functions, classes, arguments, variables and attributes."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.append(node.name)
        elif isinstance(node, ast.arg):
            found.append(node.arg)
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            found.append(node.id if isinstance(node, ast.Name) else node.attr)
    return found


def test_words_that_are_ours_alone_only_become_fewer() -> None:
    names = [name for path in sorted(PACKAGE.rglob("*.py")) for name in named(ast.parse(path.read_text("utf-8")))]
    counts = Counter(word for name in names for word in re.split("_+", name.lower()) if word in INSTEAD)
    more = {word: f"{count} times, {MOST.get(word, 0)} before: say {INSTEAD[word]}" for word, count in counts.items()
            if count > MOST.get(word, 0)}  # fmt: skip
    assert not more
    assert dict(counts) == MOST, "fewer than before: write the new numbers down"
