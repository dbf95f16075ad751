"""Both seeds in the plane of the contact, as where a drawing's zero is the mating face: it holds at all sizes."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import fcdm_opt as fo

ORIGIN = (0.0, 0.0, 0.0)
BLOCK = (((-1, -1, 0), (1, 1, 2)),)
FOOT = (((0, 0, 0), (2, 2, 2)),)
TABLE = (((-5, -5, -1), (5, 5, 0)),)
WALL = (*TABLE, ((-5, -5, 0), (-1, 5, 3)))
WALL_AT_ZERO = (*TABLE, ((-5, -5, 0), (0, 5, 3)))
TURNS = (np.eye(3), Rotation.random(random_state=1).as_matrix())


def made(boxes: Any, turn: Any, name: str) -> fo.Body:
    corners = [np.array(list(product(*zip(low, high, strict=True))), float) @ turn.T for low, high in boxes]
    return fo.Body.from_parts(corners, seed=ORIGIN, name=name)


@pytest.mark.parametrize("turn", TURNS, ids=["upright", "turned"])
@pytest.mark.parametrize(
    ("block", "other", "contacts", "along_x"),
    [(BLOCK, TABLE, 1, 0.0), (BLOCK, WALL, 2, 1.02 - 0.99), (FOOT, WALL_AT_ZERO, 2, 0.0)],
)
def test_contacts_that_hold_at_all_sizes_were_not_on_the_curve_and_refused(
    turn: Any, block: Any, other: Any, contacts: int, along_x: float
) -> None:
    parts = made(block, turn, "block"), made(other, turn, "other")
    motion = fo.Translation(turn[:, 0]) >> fo.Translation(turn[:, 2])
    several = ({"goal": goal, "contacts": "all"} for goal in ("at", "fit"))
    for how in ({"goal": "seat"}, {"goal": "at"}, *several):
        problem = fo.Problem(*parts, target=(1.02, 0.99), motion=motion, **how)
        solution = fo.solve(problem)
        assert solution.usable
        assert list(solution.parameters.values()) == pytest.approx([along_x, 0.0], abs=1e-12)
        if "contacts" in how:
            assert len(problem.contacts) == contacts
    foot = fo.Size("foot", "movable", faces={"through": turn @ np.array((0.5, 0.5, 0.0))}, tolerance=0.1)
    raised = fo.Problem(*parts, sizes=[foot], made={"foot": 0.05}, goal="at", contacts="all", motion=motion)
    assert list(fo.solve(raised).parameters.values()) == pytest.approx([0.0, 0.05], abs=1e-12)


def test_the_goal_where_none_is_asked_for_is_to_stay_seated() -> None:
    problem = fo.Problem(made(BLOCK, TURNS[0], "block"), made(TABLE, TURNS[0], "table"), target=(1.02, 0.99),
                         motion=fo.Translation("z") >> fo.Rotation("x"))  # fmt: skip
    assert problem.goal == "seat"
    assert fo.solve(problem).status is fo.Status.ALREADY_SATISFIED


def test_an_assembly_whose_parts_have_their_zero_in_the_mating_plane() -> None:
    parts = {"table": made(TABLE, TURNS[0], "table"), "block": made(BLOCK, TURNS[0], "block")}
    seated, up = [{"parts": ["block", "table"], "goal": "at"}], {"block": fo.Translation("z")}
    asked = fo.Assembly(parts, seated, motions=up, scales={"block": 1.02})
    assert fo.solve_assembly(asked).status is fo.Status.ALREADY_SATISFIED


def test_parts_that_are_apart_keep_being_refused() -> None:
    lifted = [((-1, -1, 0.5), (1, 1, 2))]
    with pytest.raises(fo.InputError, match="not on the decision curve"):
        fo.Problem(made(lifted, TURNS[0], "block"), made(TABLE, TURNS[0], "table"), goal="at", target=(1.02, 0.99),
                   nominal=(1.0, 1.0), motion=fo.Translation("z"))  # fmt: skip
