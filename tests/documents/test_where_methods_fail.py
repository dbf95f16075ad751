"""The page on where methods fail says what its script finds, where that is the same on every machine."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from scripts import loaded

ROOT = Path(__file__).parents[2]
SCRIPT = loaded(ROOT / "benchmarks" / "where_methods_fail.py")
PAGE = (ROOT / "docs" / "where-methods-fail.md").read_text(encoding="utf-8")


def item(number: int) -> str:
    found = re.search(rf"\*\*{number}\. .*?(?=\n\n)", PAGE, re.DOTALL)
    assert found is not None
    return " ".join(found.group().split())


def test_the_page_has_an_item_for_each_input() -> None:
    assert len(SCRIPT.INPUTS) == 10
    for number in range(1, 11):
        assert "*Why:*" in item(number) or number == 5
        assert "*What to do:*" in item(number)


@pytest.mark.parametrize(
    ("name", "said", "words"),
    [
        ("hollow", ("collide: False", "distance 1.5"), ("says no", "says 1.5")),
        ("kept", ("returned 0.5, result.min_distance 0.1",), ("returns 0.5", "is 0.1")),
        ("stationary", ("SLSQP: t = 0,", "Infeasible_Problem_Detected"), ("ends at 0", "Infeasible_Problem_Detected")),
        ("hardly_infeasible", ("Optimal at its own", "Infeasible at 1e-10"), ('"Optimal"', '"Infeasible"')),
    ],
)
def test_what_comes_back_is_what_the_page_says(name: str, said: tuple[str, ...], words: tuple[str, ...]) -> None:
    function = getattr(SCRIPT, name)
    found = function()
    assert all(word in found for word in said), found
    assert all(word in item(1 + SCRIPT.INPUTS.index(function)) for word in words)
