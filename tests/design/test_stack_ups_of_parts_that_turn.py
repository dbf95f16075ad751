"""Stack-ups of assemblies whose parts turn with sizes, to first order: tables on three feet, by barycentric shares."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scenes import Z

import fcdm_opt as fo

FEET = np.array([(1.0, 1.0), (5.0, 1.0), (3.0, 3.5)])
TILT = Z >> fo.Rotation("x") >> fo.Rotation("y")
FOOT, THICK, UNDER = 0.03, 0.01, 0.02


def box(low, high) -> list[tuple[float, ...]]:
    return list(product(*zip(low, high, strict=True)))


def shares(x: float, y: float) -> np.ndarray:
    """How much each foot lifts a place of the table."""
    return np.linalg.solve(np.vstack([FEET.T, np.ones(3)]), [x, y, 1.0])


def table(*ceilings, feet: str = "pointed", motion: fo.Motion = TILT) -> fo.Assembly:
    """A table of 6 x 4 x 1 on three feet of a base, below a ceiling."""
    wide = {"pointed": 0.0, "flat": 0.2}[feet]
    tops = [
        [(x + a * side, y + b * side, z) for side, z in ((wide, 0.0), (0.3, -1.0)) for a in (-1, 1) for b in (-1, 1)]
        for x, y in FEET
    ]
    tops = [[*dict.fromkeys(own)] for own in tops]
    base = fo.Body.from_parts([*tops, box((-1, -1, -2), (7, 5, -1))], seed=(0, 0, -1.5), name="base")
    parts = [base, fo.Body.convex(box((0, 0, 0), (6, 4, 1)), name="table")]
    parts.append(fo.Body.from_parts([box(*own) for own in ceilings], seed=(0, 0, 5), name="ceiling"))
    side = (wide + 0.3) / 2.0
    sizes = [
        fo.Size(
            f"foot {k}", "base", along="z", tolerance=FOOT,
            faces=[{"through": (x + a * side, y + b * side, -0.5)} for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))]
            + [{"through": (x, y, 0.0)}] * (wide > 0.0),
        )
        for k, (x, y) in enumerate(FEET, 1)
    ]  # fmt: skip
    sizes.append(fo.Size("thick", "table", faces="+z", tolerance=THICK))
    under = [{"through": ((own[0][0] + own[1][0]) / 2.0, (own[0][1] + own[1][1]) / 2.0, own[0][2])} for own in ceilings]
    sizes.append(fo.Size("under", "ceiling", faces=under, each=1.0, tolerance=UNDER))
    contacts = [("table", "base"), {"parts": ("table", "ceiling"), "goal": "clear"}]
    return fo.Assembly(parts, contacts, sizes, {"table": motion}, unit="mm")


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("ceilings", "corners"),
    [
        ([((-1, -1, 4), (7, 5, 5))], product((0, 6), (0, 4))),  # wider than the table
        ([((2, 1, 4), (5, 3, 5))], product((2, 5), (1, 3))),  # within it
        ([((5.5, -1, 4), (9, 6, 5))], product((5.5, 6), (0, 4))),  # over its edge
        # further than the gap at rest may be, but not than the tilt lifts a corner there
        ([((2, 1, 4), (5, 3, 5)), ((5.5, -1, 4.07), (9, 6, 5))], None),
    ],
)
def test_a_table_on_three_feet_that_turn_it_had_no_stack_up(ceilings, corners) -> None:
    """Its corner at (x, y) rises by the feet's shares there: the gap is the least over corners below the ceiling."""
    stack, rng = fo.stack_up(table(*ceilings)), np.random.default_rng(2)
    places = [(x, y, 3.0) for x, y in corners or product((2, 5), (1, 3))]
    places += [] if corners else [(x, y, 3.07) for x, y in product((5.5, 6), (0, 4))]
    ends = [gap - FOOT * np.abs(shares(x, y)).sum() - THICK - UNDER for x, y, gap in places]
    assert stack.worst().least == pytest.approx(min(ends), abs=1e-9)
    p = rng.uniform(*stack.touching.box.T, (200, 5))
    told = [gap - p[:, :3] @ shares(x, y) - p[:, 3] - p[:, 4] for x, y, gap in places]
    assert stack.gap(p) == pytest.approx(np.min(told, axis=0), abs=1e-9)
    second = stack.loop.second_order
    assert 0.0 < second < 3.0 * (FOOT / 2.0) ** 2 * 4.0  # the gap times half the square of the largest angle, and slips
    assert stack.worst().least_low == pytest.approx(stack.worst().least - second, abs=1e-12)
    assert "of first order in the sizes" in str(stack.known_to)
    assert fo.verify(stack).passed


def test_a_foot_s_own_gap_is_by_its_size_alone() -> None:
    stack = fo.stack_up(table(((-1, -1, 4), (7, 5, 5))), of=("table", "base"))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((-FOOT, FOOT), abs=1e-12)
    assert len(stack.contacts) == 3
    assert fo.verify(stack).passed


def test_what_cannot_stay_closed_where_parts_turn_says_why() -> None:
    """Flat feet of unlike lengths touch with an edge; along z alone three feet lift one table."""
    for how in ({"feet": "flat"}, {"motion": Z}):
        with pytest.raises(fo.InputError, match="feet with round or pointed ends"):
            fo.stack_up(table(((-1, -1, 4), (7, 5, 5)), **how))


def test_a_table_on_round_feet_tilts_by_their_radii() -> None:
    """Balls of 1 at a base's flat top, whose centres stay: each lifts the table by what its radius grows."""
    balls = [fo.Sphere(1.0, centre=(5.0 * x, 5.0 * y, 0.0), facets=16) for x, y in FEET]
    base = fo.joined(*balls, fo.Box((40, 30, 1), centre=(15, 10, -0.5)), name="base")
    top = fo.Box((30, 20, 2), centre=(15, 10, 2), name="table")
    ceiling = fo.Box((40, 30, 2), centre=(15, 10, 7), name="ceiling")
    sizes = [fo.Size(f"r{k}", "base", faces=f"sphere radius 1 no. {k}", tolerance=0.02) for k in (1, 2, 3)]
    contacts = [("table", "base"), {"parts": ("table", "ceiling"), "goal": "clear"}]
    stack = fo.stack_up(fo.Assembly([base, top, ceiling], contacts, sizes, {"table": TILT}))
    most = max(np.abs(shares(x / 5.0, y / 5.0)).sum() for x, y in product((0, 30), (0, 20)))
    assert stack.worst().least == pytest.approx(3.0 - 0.02 * most, abs=1e-8)
    assert fo.verify(stack).passed
