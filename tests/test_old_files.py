"""Problem files from before there were sizes in them, as they were answered then (the last tree without `[[size]]`).

All answers of `solve`, `curve` and `range` were the same bit for bit; these are kept.
"""

from __future__ import annotations

import pytest
from ordinary import problems

import fcdm_opt as fo

# case: status, amount, target pair
ANSWERS: dict[str, dict[str, tuple[str, float, tuple[float, float]]]] = {
    "boxes": {
        "close the gap": ("SOLVED", 0.5, (1.0, 1.0)),
        "undo an overlap": ("SOLVED", 0.25, (2.0, 2.0)),
        "undo an overlap with play": ("SOLVED", 0.375, (2.0, 2.0)),
        "already clear": ("ALREADY_SATISFIED", 0.0, (1.0, 1.0)),
        "both made larger": ("SOLVED", 0.03500000000000003, (1.53, 2.08)),
        "two directions": ("SOLVED", 0.5, (1.0, 1.0)),
        "slanted": ("SOLVED", 0.7071067811865476, (1.0, 1.0)),
        "turn an edge against the face": ("SOLVED", 0.25868456659935196, (1.6, 1.0)),
    },
    "dovetail": {
        "A on the shoulders": ("SOLVED", 0.120000000000001, (1.01, 1.01)),
        "B on the shoulders": ("SOLVED", 0.03999999999999915, (1.01, 0.99)),
        "C on the shoulders": ("SOLVED", 0.03999999999999915, (0.99, 1.01)),
        "D on the shoulders": ("SOLVED", 0.120000000000001, (0.99, 0.99)),
        "A shoulders and flank at once": ("SOLVED", 0.120000000000001, (0.9934426229508196, 1.0431147540983607)),
        "B shoulders and flank at once": ("SOLVED", 0.209911871552958, (0.9934426229508196, 1.0224590163934426)),
        "room to slide": ("SOLVED", 0.25, (1.0, 1.0)),
        "rail made larger": ("SOLVED", 0.08000000000000008, (1.0, 1.02)),
        "sideways to the flank": ("SOLVED", 0.5799999999999991, (1.0, 0.99)),
        "as drawn": ("ALREADY_SATISFIED", 0.0, (1.0, 1.0)),
    },
    "example1": {
        "A": ("SOLVED", 0.005060298801682323, (1.2989195379413685, 1.238826734948555)),
        "B": ("PAIR_OVERLAPS", 0.040348750434219864, (1.2989195379413685, 1.1902452943623374)),
        "C": ("SOLVED", 0.09814163482636912, (1.2479815168456283, 1.238826734948555)),
        "D": ("PAIR_OVERLAPS", 0.005059260116438074, (1.2479815168456283, 1.1902452943623374)),
    },
    "example1_touch": {
        "A": ("SOLVED", 0.005030400578703335, (1.2989195379413685, 1.238826734948555)),
        "B": ("SOLVED", 0.012378360328882405, (1.2989195379413685, 1.1902452943623374)),
        "C": ("SOLVED", 0.011372418378772215, (1.2479815168456283, 1.238826734948555)),
        "D": ("SOLVED", 0.005032314974431575, (1.2479815168456283, 1.1902452943623374)),
    },
    "example2_touch": {
        "A": ("SOLVED", 0.0450218879613255, (2.4255635346534654, 2.183714818811881)),
        "B": ("SOLVED", 0.0192100221742576, (2.4255635346534654, 2.098078943564356)),
        "C": ("SOLVED", 1.5802041790662935, (2.330443396039604, 2.183714818811881)),
        "D": ("SOLVED", 0.031677995254288015, (2.330443396039604, 2.098078943564356)),
    },
    "lid": {
        "A flush on the rim": ("SOLVED", 0.120000000000001, (1.01, 1.01)),
        "B flush on the rim": ("SOLVED", 0.08000000000000007, (1.01, 0.99)),
        "C flush on the rim": ("SOLVED", 0.08000000000000007, (0.99, 1.01)),
        "D flush on the rim": ("SOLVED", 0.120000000000001, (0.99, 0.99)),
        "room for a seal": ("SOLVED", 0.11999999999999958, (1.01, 1.0)),
        "plug against the wall": ("SOLVED", 0.6750000000000043, (0.99, 1.0)),
        "tilted onto the rim": ("SOLVED", 0.16991241281493738, (1.0, 0.99)),
    },
    "nut": {
        "turned until it holds": ("SOLVED", 1.1244897295795662, (1.0, 1.0)),
        "screwed until it holds": ("SOLVED", 0.6522113480429645, (0.99, 1.0)),
        "shifted against a flat": ("SOLVED", 0.25, (1.0, 1.0)),
        "nut made too small": ("OUTSIDE_FIT", 25.35, (0.97, 1.0)),
    },
    "peg_tapered": {
        "A": ("SOLVED", 0.050000000000006095, (1.01, 1.01)),
        "B": ("SOLVED", 2.2360104605522784, (1.01, 0.99)),
        "C": ("SOLVED", 2.2360104605522784, (0.99, 1.01)),
        "D": ("SOLVED", 0.050000000000006095, (0.99, 0.99)),
    },
}
ROUNDING = 1e-13  # of amounts, on machines that multiply matrices in another order


@pytest.mark.parametrize("name", ANSWERS)
def test_files_without_sizes_mean_what_they_meant(name: str) -> None:
    assert set(problems(name)) == set(ANSWERS[name])
    for case, (status, amount, pair) in ANSWERS[name].items():
        solution = fo.solve(problems(name)[case])
        assert (solution.status.name, *solution.pair) == (status, *pair), case
        assert solution.amount == pytest.approx(amount, rel=ROUNDING, abs=0.0), case
