"""Motions that leave the fit: told from those of open contacts, with the widths that do not go together."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from itertools import pairwise, product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold
from scipy.optimize import brentq
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.design.whatif.fitting import fits_up_to
from fcdm_opt.judge import engagement, passing
from fcdm_opt.judge.engagement import passage
from fcdm_opt.problem import fit
from fcdm_opt.problem.fit import misfit, verdict
from fcdm_opt.problem.solution import Solution, Status
from fcdm_opt.show.remarks import remarks
from fcdm_opt.show.solved import SolvedCase, solved_case
from fcdm_opt.show.texts import advised
from fcdm_opt.show.verdict import held_text, verdict_text

UP, ACROSS = fo.Translation("z"), fo.Translation("x") >> fo.Translation("z")
NUT, RAIL = np.array([0.0, 0.0, 11.0]), np.array([0.0, 0.0, 10.0])  # seeds
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # orthogonal

WALLS = "between face 7 (facing +x) and face 11 (facing -x) of slot"


def block(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> np.ndarray:
    return np.array([*product(x, y, z)])


def t_nut(slices: int = 1) -> fo.Body:
    """A head 19.4 wide and 6 high at z = 6, a neck 9.6 wide up to z = 19; cut along y into slices."""
    cuts = np.linspace(-15.0, 15.0, slices + 1)
    parts = []
    for low, high in pairwise(cuts):
        parts.append(block((-9.7, 9.7), (low, high), (6.0, 12.0)))
        parts.append(block((-4.8, 4.8), (low, high), (12.0, 19.0)))
    return fo.Body.from_parts(parts, seed=NUT, name="nut")


def t_rail(roof: bool = False) -> fo.Body:
    """A slot 20 wide from z = 4 to 12, lips that leave 10 up to z = 20; far above it a roof, where asked for."""
    along = (-50.0, 50.0)
    parts = [block((-20.0, 20.0), along, (0.0, 4.0))]
    for sign in (-1.0, 1.0):
        parts.append(block(tuple(sorted((10.0 * sign, 20.0 * sign))), along, (4.0, 12.0)))
        parts.append(block(tuple(sorted((5.0 * sign, 20.0 * sign))), along, (12.0, 20.0)))
    if roof:
        parts.append(block((-20.0, 20.0), along, (80.0, 84.0)))
        parts.append(block((20.0, 24.0), along, (0.0, 84.0)))
    return fo.Body.from_parts(parts, seed=RAIL, name="slot")


def nut_in_rail(tolerance: float = 0.02, requirement: str = "B", **more: Any) -> fo.Problem:
    asked = {"motion": UP, "goal": "touch", "unit": "mm", **more}
    movable, static = asked.pop("movable", t_nut()), asked.pop("static", t_rail())
    return fo.Problem(movable, static, tolerance=tolerance, requirement=requirement, **asked)


def lifted(tau: float) -> float:
    """How far the nut goes up until its head, by tau larger, stands on the lips of a rail smaller by tau."""
    return float((RAIL[2] + (1 - tau) * (20.0 - RAIL[2])) - (NUT[2] + (1 + tau) * (6.0 - NUT[2])))


# ------------------------------------------------------------------------------------------------- what leaves its fit


@pytest.mark.parametrize(
    ("goal", "motion", "tau"),
    [("touch", UP, 0.016), ("clear", ACROSS, 0.016), ("touch", ACROSS, 0.02), ("clear", UP, 0.1)],
)
def test_a_nut_wider_than_its_slot_was_lifted_out_of_the_rail_as_a_success(goal: str, motion: Any, tau: float) -> None:
    solution = fo.solve(nut_in_rail(tau, motion=motion, goal=goal))
    assert solution.status is Status.OUTSIDE_FIT
    assert not solution.usable
    assert solution.parameters["TZ"] == pytest.approx(lifted(tau), abs=1e-9)  # it is reported all the same
    assert solution.certificate is not None
    assert solution.certificate.passed


def test_the_widths_that_do_not_go_together_are_named() -> None:
    solution = fo.solve(nut_in_rail())
    assert solution.advice.startswith(f"Does not fit: nut 19.79 mm in slot 19.60 mm, {WALLS}.")
    found = misfit(solution.problem)
    assert found is not None
    assert (found.inside, found.inner, found.outer) == (0, pytest.approx(1.02 * 19.4), pytest.approx(0.98 * 20.0))


def test_the_part_inside_may_be_the_one_that_stands_still() -> None:
    """A ring is moved over its key: growing the ring opens its hole."""
    problem = nut_in_rail(0.02, "C", movable=t_rail(), static=t_nut())
    found = misfit(problem)
    assert found is not None
    assert (found.inside, found.inner, found.outer) == (1, pytest.approx(1.02 * 19.4), pytest.approx(0.98 * 20.0))
    assert verdict(problem).startswith("does not fit: nut 19.79 mm in slot 19.60 mm, between face ")
    assert fo.solve(problem).status is Status.OUTSIDE_FIT


@pytest.mark.slow
@pytest.mark.parametrize("movable", [t_nut, t_rail])
def test_walls_further_apart_than_sizes_change_tell_nothing(movable, monkeypatch: pytest.MonkeyPatch) -> None:
    """Part pairs that bounds leave too far apart to close are left out: with all of them the same is found."""
    static = t_rail if movable is t_nut else t_nut
    asked = [nut_in_rail(tau, letter, movable=movable(), static=static()) for tau in (0.015, 0.02) for letter in "ABCD"]
    near = [len(fit._walls(problem, 2.0 * fit._change(problem))[0]) for problem in asked]
    assert max(near) < len(fit._walls(asked[0], np.inf)[0])
    found = [misfit(problem) for problem in asked]
    assert 0 < sum(each is not None for each in found) < len(asked)
    misfit.cache_clear()
    monkeypatch.setattr(fit, "_change", lambda problem: np.inf)
    assert [misfit(problem) for problem in asked] == found


def test_sizes_that_go_together_have_no_misfit() -> None:
    for requirement in "ACD":
        assert misfit(nut_in_rail(0.02, requirement)) is None
        assert fo.solve(nut_in_rail(0.02, requirement)).status is Status.SOLVED
    assert misfit(nut_in_rail(0.015)) is None


@pytest.mark.parametrize("goal", ["touch", "seat"])
def test_up_to_which_tolerance_the_nut_fits_is_told(goal: str) -> None:
    """Until 19.4 (1 + tau) = 20 (1 - tau)."""
    least = 0.6 / 39.4
    found = fits_up_to(nut_in_rail(goal=goal))
    assert found == pytest.approx(least, rel=1e-4)
    assert found < least
    assert fo.solve(nut_in_rail(found, goal=goal)).usable
    assert not fo.solve(nut_in_rail(least * 1.0001, goal=goal)).usable


def test_budget_ends_where_the_motion_leaves_the_fit() -> None:
    problem = nut_in_rail(motion=UP, goal="clear")
    found = fo.budget(problem, None, requirements="B", largest=0.05, accuracy=1e-6)["B"]
    assert found.tolerance == pytest.approx(0.6 / 39.4, rel=1e-5)
    assert (found.end.name, found.advice.partition(": ")[0]) == ("MISFIT", "does not fit")


def test_a_target_has_no_tolerance_up_to_which_it_fits() -> None:
    problem = fo.Problem(t_nut(), t_rail(), target=(1.02, 0.98), motion=UP, goal="touch")
    assert fo.solve(problem).status is Status.OUTSIDE_FIT
    assert fits_up_to(problem) is None


@pytest.mark.parametrize("slices", [2, 7])
def test_how_a_body_is_cut_makes_no_difference(slices: int) -> None:
    assert fo.solve(nut_in_rail(movable=t_nut(slices))).status is Status.OUTSIDE_FIT
    assert fo.solve(nut_in_rail(0.015, movable=t_nut(slices))).status is Status.SOLVED


def test_a_common_motion_of_both_parts_makes_no_difference() -> None:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = TURN, (70.0, -30.0, 11.0)
    along = fo.Translation(tuple(TURN[:, 2]))
    for tau, status in ((0.02, Status.OUTSIDE_FIT), (0.015, Status.SOLVED)):
        moved = nut_in_rail(tau, movable=t_nut().moved(pose), static=t_rail().moved(pose), motion=along)
        assert fo.solve(moved).status is status
        assert (misfit(moved) is None) == (status is Status.SOLVED)


def test_a_nut_lifted_under_a_roof_is_out_of_its_slot_too() -> None:
    """It cannot be pulled away to infinity there, and has gone through the lips all the same."""
    assert fo.solve(nut_in_rail(static=t_rail(roof=True), goal="clear")).status is Status.OUTSIDE_FIT


def peg_and_plate(half: float = 5.1) -> tuple[fo.Body, fo.Body]:
    """A peg 10 wide, z from 0 to 30, that stands on the bottom of a hole 10.2 wide and 20 deep."""
    parts, middle = [block((-half, half), (-half, half), (-10.0, 0.0))], (-half, half)
    for side in ((-20.0, -half), (half, 20.0)):
        parts += [block(side, (-20.0, 20.0), (-10.0, 20.0)), block(middle, side, (-10.0, 20.0))]
    plate = fo.Body.from_parts(parts, seed=(0.0, 0.0, 0.0), name="plate")
    peg = fo.Body.convex(block((-5.0, 5.0), (-5.0, 5.0), (0.0, 30.0)), seed=(0.0, 0.0, 0.0), name="peg")
    return peg, plate


def test_a_peg_too_large_for_its_hole_is_not_put_on_top_of_it() -> None:
    """Its way out is open, so that nothing is gone through; the contact sought is not that of a peg in a hole."""
    problem = fo.Problem(*peg_and_plate(), tolerance=0.05, requirement="B", motion=UP, goal="touch")
    solution = fo.solve(problem)
    assert solution.parameters["TZ"] == pytest.approx(0.95 * 20.0, abs=1e-9)
    assert solution.status is Status.OUTSIDE_FIT
    assert verdict(problem).startswith("does not fit: peg 10.50 in plate 9.69, between face ")
    assert fits_up_to(problem) == pytest.approx(0.2 / 20.2, rel=1e-4)


def dowels(tau: float = 0.02) -> fo.Problem:
    """A block with two pins of 6 in a plate with holes of 6.02 and 6.05, the block larger and the plate smaller."""
    pins = [fo.Cylinder(3.0, 8.5, base=(x, 0, -8)) for x in (-20, 20)]
    holes = [fo.Cylinder(radius, 14.0, base=(x, 0, -12)) for radius, x in ((3.01, -20), (3.025, 20))]
    block = fo.joined(fo.Box((60, 20, 10), centre=(0, 0, 5)), *pins, name="block")
    plate = fo.cut(fo.Box((70, 30, 10), centre=(0, 0, -5)), *holes, name="plate")
    return fo.Problem(block, plate, tolerance=tau, requirement="B", motion=UP, goal="touch")


@pytest.mark.slow
def test_the_width_across_two_pins_was_told_for_the_diameter_of_one() -> None:
    """The pins are further apart, too, so that facets across both lack more than those of one pin in its hole."""
    assert verdict(dowels()).startswith("does not fit: block 6.12 in plate 5.90, across the bore of radius 3.01")


@pytest.mark.parametrize(("room", "told"), [(0.0, False), (0.1, False), (0.38, True)])
def test_a_part_was_told_not_to_fit_between_walls_without_any_room(room: float, told: bool) -> None:
    """Of a shaft drawn through another part, cuts along its keyway met like the walls of a slit: "0.40 in -0.00"."""
    normals, reaches = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]), np.full((2, 2), 0.2)
    reaches[:, 0] = -room / 2.0
    walls = fit._ClosedWalls(nut_in_rail(), normals, np.zeros((2, 2), np.int64), reaches, -reaches.sum(axis=1))
    assert (walls.tightest(np.arange(2)) is not None) == told


def test_why_parts_fit_at_no_tolerance_is_told() -> None:
    """A cube of 2 drawn half a unit deep in another; and a key that is too wide however little it is off."""
    deep = fo.Body.convex(block((0.5, 2.5), (-1.0, 1.0), (-1.0, 1.0)), name="deep")
    cube = fo.Body.convex(block((-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0)), name="cube")
    problem = fo.Problem(deep, cube, tolerance=0.01, requirement="B", motion=UP, goal="clear", unit="mm")
    case: Any = SimpleNamespace(
        solution=SimpleNamespace(advice="No.", left_by_mesh="", problem=problem), fits_up_to=0.0
    )
    assert advised(case) == "No. The parts fit at no tolerance: as drawn, they overlap by 0.5 mm."
    peg, plate = peg_and_plate(half=5.0)
    case.solution.problem = fo.Problem(peg, plate, tolerance=0.01, requirement="B", motion=UP, goal="touch")
    told = "No. The parts fit at no tolerance: peg and plate are drawn line to line, 10: "  # the verdict has the walls
    assert advised(case) == f"{told}no tolerance in which peg may be wider fits."
    # 10 (1 + t) = 10.2 (1 - t) at t = 0.2 / 20.2, where both are 10.0990: 2e-7 more is where a search ended
    at_end = fo.Problem(*peg_and_plate(), tolerance=0.2 / 20.2 + 1e-8, requirement="B", motion=UP, goal="touch")
    assert verdict(at_end).startswith("does not fit: peg and plate are as wide as each other, 10.099, between ")
    beyond = fo.Problem(*peg_and_plate(), tolerance=0.2 / 20.2 + 1e-6, requirement="B", motion=UP, goal="touch")
    assert verdict(beyond).startswith("does not fit: peg is 2e-05 wider than plate, 10.099, between ")


def test_parts_whose_contacts_close_at_no_tolerance_were_said_to_fit_at_none() -> None:
    """Two slots, from 17 to 23.2, on blades from 17 to 23: 23 (1 + t) = 23.2 (1 - t) at t = 0.2 / 46.2."""
    slots = [fo.Box((6.2, 21, 8), centre=(x, 0, 3)) for x in (-20.1, 20.1)]
    plate = fo.cut(fo.cut(fo.Box((64, 32, 6), centre=(0, 0, 3)), slots[0]), slots[1], name="plate")
    blades = [fo.Box((6, 20, 10), centre=(x, 0, 5)) for x in (-20, 20)]
    base = fo.joined(fo.Box((70, 36, 8), centre=(0, 0, -4)), *blades, name="base")
    motion = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
    asked: dict[str, Any] = {"goal": "seat", "contacts": "all", "motion": motion}
    case = solved_case(fo.Problem(plate, base, tolerance=0.02, requirement="C", **asked), certify=False)
    assert case.solution.status is Status.INFEASIBLE
    assert case.fits_up_to == 0.0
    told = 'This motion closes all contacts again at no tolerance. With goal "clear" the parts fit up to ±0.432 %.'
    assert advised(case).endswith(told)


def test_a_peg_that_could_only_be_drawn_out_of_its_hole_was_called_a_success() -> None:
    problem = fo.Problem(*peg_and_plate(), tolerance=0.05, requirement="B", motion=UP, goal="clear", clearance=1.0)
    solution = fo.solve(problem)
    assert solution.parameters["TZ"] == pytest.approx(0.95 * 20.0 + 1.0, abs=1e-9)
    assert solution.status is Status.OUTSIDE_FIT
    assert not solution.usable
    assert "peg 10.50 in plate 9.69" in solution.advice


def test_a_stem_still_in_its_hole_hid_that_its_collar_does_not_fit() -> None:
    """A collar .1 too wide for its seat was lifted out of it, by 5, as a success: the stem is in the hole then too."""
    stem, collar = block((-5.0, 5.0), (-9.0, 9.0), (-18.0, 0.0)), block((-8.0, 8.0), (-9.0, 9.0), (0.0, 5.0))
    walls = [block(x, (-20.0, 20.0), (-15.0, 0.0)) for x in ((-20.0, -5.1), (5.1, 20.0))]
    walls += [block(x, (-20.0, 20.0), (0.0, 5.0)) for x in ((-20.0, -8.1), (8.1, 20.0))]
    pin = fo.Body.from_parts([stem, collar], seed=(0, 0, 0), name="pin")
    plate = fo.Body.from_parts(walls, seed=(0, 0, 0), name="plate")
    sides = [{"through": (x, 0.0, 2.0)} for x in (-8.0, 8.0)]
    size = fo.Size("collar", "movable", faces=sides, each=0.5, tolerance=0.1)
    problem = fo.Problem(pin, plate, sizes=[size], made={"collar": 0.3}, goal="clear", motion=UP)
    solution = fo.solve(problem)
    assert solution.parameters["TZ"] == pytest.approx(5.0)
    assert solution.status is Status.OUTSIDE_FIT
    assert verdict(problem).startswith("does not fit: pin 16.30 in plate 16.20, between face ")
    assert fo.solve(problem.changed(made={"collar": 0.1})).usable


def test_a_key_too_wide_for_its_keyway_was_put_into_the_bore_as_a_success() -> None:
    """The parts beside the keyway reach down along the bore, further than its walls do: the walls tell."""
    key = fo.Box((8.0, 7.0, 28.0), centre=(0.0, 14.5, 40.0), name="key")
    side = [(4.01, 14.45), (4.01, 18.3), (25.0, 18.3), (25.0, 0.0), (15.0, 0.0)]
    outlines = [side, [(-x, y) for x, y in side], [(-25.0, 18.3), (25.0, 18.3), (25.0, 25.0), (-25.0, 25.0)]]
    outlines.append([(-25.0, -25.0), (25.0, -25.0), (25.0, -15.0), (-25.0, -15.0)])
    parts = [np.array([(x, y, z) for x, y in own for z in (20.0, 60.0)]) for own in outlines]
    hub = fo.Body.from_parts(parts, seed=(0.0, 0.0, 40.0), name="hub")
    motion = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
    problem = fo.Problem(key, hub, tolerance=0.02, requirement="B", goal="touch", motion=motion, nominal=(1, 1))
    solution = fo.solve(problem)
    assert solution.parameters["TY"] < -3.0
    assert solution.status is Status.OUTSIDE_FIT
    assert verdict(problem).startswith("does not fit: key 8.16 in hub 7.86, between ")
    assert fits_up_to(problem) == pytest.approx(0.02 / 16.02, rel=1e-3)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("bore", "pin"), [(16, 24), (24, 16), (32, 32), (48, 16)])
def test_facets_out_of_phase_do_not_fit_sooner_than_round_faces_do(bore: int, pin: int) -> None:
    """Their widths were told, of a pin with play too: it "does not fit: 19.94 in 19.62"."""
    hole = fo.Cylinder(10, 20, base=(0, 0, -5), facets=bore)
    plate = fo.cut(fo.Box((60, 60, 10), centre=(0, 0, 5)), hole, name="plate")
    rod = fo.Cylinder(10, 30, base=(0, 0, -10), facets=pin, name="pin")
    size = fo.Size("pin", "movable", faces="cylinder radius 10", each=0.5, tolerance=1)
    problem = fo.Problem(rod, plate, sizes=[size], made={"pin": -0.02}, goal="touch", motion=fo.Translation("x"))
    assert verdict(problem) == ""
    tight = problem.changed(made={"pin": 0.02})
    assert verdict(tight) == "does not fit: pin 20.020 in plate 20.000, across the bore of radius 10 of plate"


def test_two_bores_too_far_apart_for_two_pins_are_told_by_the_faces_that_are_known() -> None:
    """Edges of facets are the walls of the pins: "across the cylinder" was said of one of them.

    (60 - 2 x 4.05) x 1.02 = 52.938 between the bores, on (60 - 2 x 4) x 0.98 = 50.96 between the pins; across facets
    that are turned by 15 and 11.25 degrees 51.9 and 50.0 were told.
    """
    pins = [fo.Cylinder(4, 12.5, base=(x, 0, -0.5), facets=12) for x in (30, -30)]
    base = fo.joined(fo.Box((80, 80, 10), centre=(0, 0, -5)), *pins, name="base")
    bores = [fo.Cylinder(4.05, 10, base=(x, 0, -1), facets=16) for x in (30, -30)]
    cover = fo.cut(fo.Box((80, 80, 8), centre=(0, 0, 4)), *bores, name="cover")
    problem = fo.Problem(cover, base, tolerance=0.02, requirement="B", goal="touch", motion=ACROSS, nominal=(1, 1))
    between = "between the cylinder of radius 4 no. 2 and the cylinder of radius 4 no. 1 of base"
    assert verdict(problem) == f"does not fit where it is drawn: cover 52.9 in base 51.0, {between}"


def cover_on_pins(tau: float, goal: str = "seat", *, lands: bool = False) -> fo.Problem:
    """A cover with bores of 8.1 on pins of 8, 60 apart, that lies on its base or on four lands; facets out of phase."""
    pins = [fo.Cylinder(4, 13, base=(x, 0, -3), facets=24) for x in (30, -30)]
    each = [(10, 10, 4), [(x, y, -2) for x in (-30, 30) for y in (-30, 30)]] if lands else [(80, 80, 4), [(0, 0, -2)]]
    raised = [fo.Box(each[0], centre=own) for own in each[1]]
    base = fo.joined(fo.Box((80, 80, 8), centre=(0, 0, -6)), *raised, *pins, name="base")
    bores = [fo.Cylinder(4.05, 10, base=(x, 0, -1), facets=32) for x in (30, -30)]
    cover = fo.cut(fo.Box((80, 80, 8), centre=(0, 0, 4)), *bores, name="cover")
    return fo.Problem(cover, base, tolerance=tau, requirement="B", goal=goal, motion=UP, nominal=(1, 1))


def test_what_plane_walls_say_was_left_open_by_a_bore_between_them() -> None:
    """A hexagon of 15 across its edges, 15.3 as made, in a chute of 15.4, 15.092 as made: its bore is no wall."""
    across = [(7.5 * math.cos(turn), 7.5 * math.sin(turn)) for turn in np.arange(6) * math.pi / 3]
    hexagon = fo.Body.convex([(x, y, z + across[1][1]) for x in (-15, 15) for y, z in across])
    standoff = fo.cut(hexagon, fo.Cylinder(2.5, 40, base=(-20, 0, 6.5), axis="x"), name="standoff")
    chute = fo.cut(fo.Box((50, 24, 19), centre=(0, 0, 4.5)), fo.Box((60, 15.4, 20), centre=(0, 0, 10)), name="chute")
    found = fo.solve(fo.Problem(standoff, chute, tolerance=0.02, requirement="B", goal="seat", motion=UP))
    assert found.status is Status.INFEASIBLE
    assert not found.left_by_mesh
    told = verdict_text(found)
    assert told.startswith("does not fit: standoff 15.30 in chute 15.09, between face ")
    assert told.endswith(" of chute; no such motion brings them together")


BETWEEN_BORES = 0.1 / 103.9  # 51.9 (1 + t) = 52 (1 - t); facets out of phase leave .00066


@pytest.mark.slow
@pytest.mark.parametrize(
    ("goal", "lands"),
    [
        ("seat", False),
        pytest.param("seat", True, marks=pytest.mark.slow),
        pytest.param("at", False, marks=pytest.mark.slow),
    ],
)
def test_facets_of_pins_kept_a_cover_from_lying_flat(goal: str, lands: bool) -> None:
    """It was impossible where goal "touch" found the motion: pins only keep clear, the contact is of plane faces."""
    problem = cover_on_pins(0.999 * BETWEEN_BORES, goal, lands=lands)
    solution, (grown, shrunk) = fo.solve(problem), problem.target - 1.0
    down = problem.movable.seed[2] * grown - problem.static.seed[2] * shrunk  # at z = 0 as drawn
    assert solution.parameters["TZ"] == pytest.approx(down, abs=1e-9)
    assert solution.status is Status.SOLVED
    assert solution.lower_bound == pytest.approx(-down)
    assert not solution.left_by_mesh
    again = Solution.from_dict(json.loads(json.dumps(solution.to_dict())))
    assert fo.verify(again).passed
    beyond = fo.solve(cover_on_pins(1.001 * BETWEEN_BORES, goal, lands=lands))
    assert beyond.status is Status.INFEASIBLE
    assert not beyond.left_by_mesh


@pytest.mark.slow
def test_up_to_which_tolerance_a_cover_lies_flat_was_told_of_facets() -> None:
    assert fits_up_to(cover_on_pins(0.02)) == pytest.approx(BETWEEN_BORES, rel=1e-4)


def lid_and_box(requirement: str) -> fo.Problem:
    """A lid with two pegs of 8, 50 apart, in holes of 8.1 of a box, which cuts of its parts touch."""
    pegs = [fo.Cylinder(4, 8, base=(x, 0, -8), facets=16) for x in (-25, 25)]
    bores = [fo.Cylinder(4.05, 12, base=(x, 0, -11), facets=16) for x in (-25, 25)]
    lid = fo.joined(fo.Box((70, 30, 5), centre=(0, 0, 2.5)), *pegs, name="lid")
    box = fo.cut(fo.Box((70, 30, 20), centre=(0, 0, -10)), *bores, name="box")
    return fo.Problem(lid, box, tolerance=0.02, requirement=requirement, goal="seat", motion=UP, nominal=(1, 1))


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("requirement", "words", "fits"),
    [
        # 8 x 1.02 in 8.1 x 0.98, 58 x 1.02 in 58.1 x 0.98; up to 58 (1 + t) = 58.1 (1 - t)
        ("B", "lid 8.16 in box 7.94, across the bore of radius 4.05 no. 1 of box; nor lid 59.2 in box 56.9, between "
         "the bore of radius 4.05 no. 2 and the bore of radius 4.05 no. 1 of box", 0.1 / 116.1),
        # 41.9 x 1.02 between the bores on 42 x 0.98 between the pegs; up to 41.9 (1 + t) = 42 (1 - t)
        ("C", "box 42.7 in lid 41.2, between the cylinder of radius 4 no. 2 and the cylinder of radius 4 no. 1 of lid",
         0.1 / 83.9),
    ],
)  # fmt: skip
def test_a_web_between_bores_was_told_by_facets_and_a_bore_at_a_cut_had_no_name(
    requirement: str, words: str, fits: float
) -> None:
    problem = lid_and_box(requirement)
    where = " where it is drawn" * ("no. 2" in words.partition(";")[0])  # between two round faces: another place may do
    assert verdict(problem) == f"does not fit{where}: {words}"
    assert fits_up_to(problem) == pytest.approx(fits, rel=2e-3)


@pytest.mark.slow
def test_a_journal_in_a_chamfered_hub_was_told_by_the_slant_of_its_chamfer(tmp_path: Path) -> None:
    """Edges of the shaft's parts, at the foot of a cone of 45 degrees, were a wall: "16.95 in 16.78" of 24 in 23.96."""

    def cylinder(low: float, high: float, tall: float, base: float = 0.0) -> Manifold:
        return Manifold.cylinder(tall, low, high, 48).translate((0, 0, base))

    def read(solid: Manifold, name: str) -> fo.Body:
        mesh, file = solid.to_mesh(), tmp_path / f"{name}.stl"
        trimesh.Trimesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts)).export(file)
        return fo.Body.from_file(file, unit="mm", name=name).rounded()

    shaft = read(cylinder(18, 18, 8, -8) + cylinder(12, 12, 20) + cylinder(13.5, 12, 1.5), "shaft")
    hub = read(cylinder(20, 20, 14) - cylinder(12.02, 12.02, 40, -10) - cylinder(13.02, 12.02, 1), "hub")
    size = fo.Size("bore", "movable", faces="bore radius 12.02", each=-0.5, tolerance=0.1)
    problem = fo.Problem(hub, shaft, sizes=[size], made={"bore": -0.08}, goal="clear", motion=UP)
    assert verdict(problem) == "does not fit: shaft 24.000 mm in hub 23.960 mm, across the bore of radius 12.02 of hub"


@pytest.mark.parametrize(("off", "fits"), [(0.09, True), (0.11, False), (0.3, False)])
def test_a_flat_too_high_for_the_bore_opposite_is_told_by_both(off: float, fits: bool) -> None:
    """6 + off + 8 of a D-shaft in 6.05 + 8.05: "the only motion found goes straight through" was all that was told."""
    rod, bore = fo.Cylinder(8, 40, base=(0, 0, -10)), fo.Cylinder(8.05, 40, base=(0, 0, -10))
    shaft = fo.cut(rod, fo.Box((40, 14, 80), centre=(0, 13, 10)), name="shaft")
    hub = fo.cut(fo.Cylinder(16, 20), fo.cut(bore, fo.Box((40, 14, 80), centre=(0, 13.05, 10))), name="hub")
    flat = fo.Size("flat", "movable", faces="+y", tolerance=0.5)
    motion = fo.Translation("x") >> fo.Translation("y")
    problem = fo.Problem(shaft, hub, sizes=[flat], made={"flat": off}, goal="clear", motion=motion)
    words = (
        r"does not fit: shaft (.*) in hub 14\.10+, between face \d+ \(facing -y\) and the bore of radius 8\.05 of hub"
    )
    found = re.fullmatch(words, verdict(problem))
    assert fits == (verdict(problem) == "")
    assert fits or (found and float(found[1]) == pytest.approx(14.0 + off, abs=1e-9))


@pytest.mark.parametrize(("off", "overlap"), [(0.024, None), (0.08, 0.11 / 3.0)])
def test_a_dovetail_that_two_flanks_and_a_top_hold_says_by_how_much_it_overlaps_at_best(
    off: float, overlap: float | None
) -> None:
    """Flanks of 60 degrees: normals of three walls cancel, and the mean of their gaps is what any shift leaves."""
    slope, play, top = np.sqrt(3.0), 0.02, 8.01
    rail = fo.Prism([(-9, 0), (9, 0), (9 + 8 / slope, 8), (-9 - 8 / slope, 8)], 30.0, name="rail")
    foot = 9 + 2 * play / slope
    room = [(foot, 0), (40, 0), (40, 20), (-40, 20), (-40, 0), (-foot, 0)]
    room += [(-foot - top / slope, top), (foot + top / slope, top)]
    slide = fo.Prism(room, 20.0, base=(0, 0, 5), name="slide")
    flanks = [{"through": (side * (9 + 4 / slope), 4, 15)} for side in (-1, 1)]
    sizes = [fo.Size("flanks", "static", faces=flanks, each=(1.0, 1.0), tolerance=0.2)]
    asked: dict[str, Any] = {"sizes": sizes, "made": {"flanks": off}, "goal": "clear"}
    problem = fo.Problem(slide, rail, motion=fo.Translation("x") >> fo.Translation("y"), **asked)
    words = verdict(problem)
    if overlap is None:
        assert words == ""
        assert fo.solve(problem).usable
    else:
        least = f"slide and rail overlap by {overlap:.4g} or more, wherever shifted, between"
        assert words.startswith(f"does not fit: {least}")
        assert words.endswith(" of rail")
        assert words.count("face ") == 3  # two flanks and the top
    assert verdict(problem.changed(motion=fo.Translation("x") >> fo.Rotation("z"))) == ""  # what turns may make room


# ---------------------------------------------------------------------------------------------------- what is no fit


def test_a_box_on_a_slab_may_be_lifted_as_far_as_it_takes() -> None:
    box, slab = block((-1.0, 1.0), (-1.0, 1.0), (0.0, 2.0)), block((-5.0, 5.0), (-5.0, 5.0), (-1.0, 0.0))
    one, two = fo.Body.convex(box), fo.Body.convex(slab)
    for more in ({"goal": "clear", "clearance": 40.0}, {"goal": "touch"}, {"goal": "seat"}):
        for requirement in "ABCD":
            problem = fo.Problem(one, two, tolerance=0.05, requirement=requirement, motion=UP, **more)
            assert fo.solve(problem).usable, (requirement, more)


@pytest.mark.parametrize("requirement", "ABCD")
@pytest.mark.parametrize("goal", ["touch", "clear"])
def test_a_box_in_a_corner_is_not_held_by_it(requirement: str, goal: str) -> None:
    corner = [block((-6.0, 6.0), (-6.0, 6.0), (-1.0, 0.0)), block((-6.0, -1.0), (-6.0, 6.0), (0.0, 6.0))]
    static = fo.Body.from_parts(corner, seed=(0.0, 0.0, -0.5))
    box = fo.Body.convex(block((-1.0, 1.0), (-1.0, 1.0), (0.0, 2.0)))
    problem = fo.Problem(box, static, tolerance=0.05, requirement=requirement, motion=ACROSS, goal=goal)
    assert fo.solve(problem).usable


def test_a_block_was_sent_through_the_slab_it_stands_on() -> None:
    """No shift along z leads there but through the slab, which is said however little that holds the block."""
    box, slab = block((-1.0, 1.0), (-1.0, 1.0), (0.0, 2.0)), block((-5.0, 5.0), (-5.0, 5.0), (-0.5, 0.0))
    asked: dict[str, Any] = {"motion": UP, "limits": {"TZ": (-9.0, -0.2)}}
    bodies = fo.Body.convex(box, name="block"), fo.Body.convex(slab, name="slab")
    for goal in ("touch", "clear"):
        solution = fo.solve(fo.Problem(*bodies, target=(1.0, 1.0), goal=goal, **asked))
        assert solution.parameters["TZ"] == pytest.approx(-2.5, abs=1e-9)
        assert solution.status is Status.OUTSIDE_FIT
        assert "the only motion found goes straight through slab" in str(solution)
        assert not fo.verify(dataclasses.replace(solution, status=Status.SOLVED)).passed


def test_why_a_block_goes_through_its_slab_was_not_told() -> None:
    """Under a lid, and with no room for the clearance on its own side: its constraints are named, none below 0."""
    box, slab = block((-1.0, 1.0), (-1.0, 1.0), (0.0, 1.5)), block((-5.0, 5.0), (-5.0, 5.0), (-1.0, 0.0))
    lid = fo.KeepOut(fo.Body.convex(block((-4.0, 4.0), (-4.0, 4.0), (1.6, 2.5)), name="lid"))
    asked: dict[str, Any] = {"goal": "clear", "clearance": 0.3, "motion": UP, "target": (1.0, 1.0), "keep_out": [lid]}
    problem = fo.Problem(fo.Body.convex(box), fo.Body.convex(slab), **asked, limits={"TZ": (-5.0, 5.0)})
    solution = fo.solve(problem)
    assert solution.usable
    first = str(solution).splitlines()[0]
    assert first.endswith("straight there it goes through keep-out lid, and no other way is looked for")
    found = fo.conflicts(problem.changed(limits={"TZ": (-5.0, 1.0)}), deviation=False)
    cures = {own.name: own.value for own in found.relaxations if own.cures}
    assert cures["clearance"] == pytest.approx(0.1, rel=0.01)


def test_what_excludes_what_does_not_ask_for_a_fit() -> None:
    """Limits that keep the nut in its slot exclude its motion; without them there is one, out of it."""
    found = fo.conflicts(nut_in_rail(limits={"TZ": (-1.0, 1.0)}))
    assert found.clashes[0].proved
    assert [own.name for own in found.relaxations if own.name == "upper limit of TZ"]
    (least,) = (own for own in found.relaxations if own.name == "upper limit of TZ")
    assert least.by == pytest.approx(lifted(0.02) - 1.0, abs=1e-6)


def test_contacts_were_blamed_together_where_each_alone_cannot_be_closed() -> None:
    """Lifted through the lips until its head stands on them, the nut touches it, but not by the contacts meant."""
    contacts = [f"F1F2(P1V2,V4,V6,V8; P2{face})" for face in ("V9,V10,V17,V19", "V25,V26,V27,V29")]
    asked = nut_in_rail(goal="seat", contacts=contacts, path="free")
    found = fo.conflicts(asked, deviation=False)
    names = [
        f"contact {k}, face 2 (facing +z) of nut, face {face} (facing -z) of slot" for k, face in ((1, 8), (2, 12))
    ]
    assert [(clash.names, clash.proved) for clash in found.clashes] == [((name,), True) for name in names]
    assert found.complete
    assert str(found).startswith(verdict(asked))


def test_facets_of_a_boss_raised_doubt_about_flat_walls() -> None:
    """A round boss above the rail has nothing to do with head and slot, whose walls are plane."""
    turns = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    boss = [[3.0 * np.cos(turn), 3.0 * np.sin(turn), z] for z in (19.0, 30.0) for turn in turns]
    nut = fo.Body.from_parts([*(part.vertices for part in t_nut().parts), np.array(boss)], seed=NUT, name="nut")
    for tau in (0.02, 0.01):
        solution = fo.solve(nut_in_rail(tau, movable=nut, goal="seat"))
        assert solution.usable == (tau == 0.01)
        assert "mesh" not in f"{solution}{solution.advice}{remarks(solution)}"
        assert "tessellation" not in str(remarks(solution))


def test_boxes_drawn_into_each_other_may_be_taken_apart() -> None:
    """What overlaps as drawn is no fit; the shorter way out does not go through."""
    one, two = (block((x, x + 4.0), (-1.0, 1.0), (-1.0, 1.0)) for x in (0.0, 3.0))
    problem = fo.Problem(
        fo.Body.convex(one), fo.Body.convex(two), target=(1.0, 1.0), motion=fo.Translation("x"), goal="touch"
    )
    solution = fo.solve(problem)
    assert solution.parameters["TX"] == pytest.approx(-1.0, abs=1e-9)
    assert solution.status is Status.SOLVED


def test_a_box_behind_a_low_sill_may_be_lifted_over_it_by_what_its_size_changes() -> None:
    """A sill of .05 holds it no more than its own growth of .1 does: a shallow hold is none."""
    sills = [block((x, x + 1.0), (-2.0, 2.0), (0.0, 0.05)) for x in (-2.001, 1.001)]
    floor = fo.Body.from_parts([block((-5.0, 5.0), (-5.0, 5.0), (-1.0, 0.0)), *sills], seed=(0.0, 0.0, -0.5))
    box = fo.Body.convex(block((-1.0, 1.0), (-1.0, 1.0), (0.0, 2.0)))
    problem = fo.Problem(box, floor, tolerance=((0.0, 0.1), (0.0, 0.0)), requirement="A", motion=UP, goal="touch")
    solution = fo.solve(problem)
    assert solution.parameters["TZ"] == pytest.approx(0.05 + 0.1, abs=1e-9)
    assert solution.usable


def test_a_ring_that_is_turned_on_its_key_stays_on_it() -> None:
    """Its parts move along chords; none of them goes past the key."""
    problem = {one.name: one for one in fo.load_problems(Path(__file__).parents[2] / "problems" / "nut.toml")}
    assert fo.solve(problem["turned until it holds"]).status is Status.SOLVED


# ------------------------------------------------------------------------------------------------------ what is shown


def test_no_limits_are_to_be_widened_where_none_are_set() -> None:
    free, held = (fo.solve(nut_in_rail(goal="seat", limits=limits)) for limits in (None, {"TZ": (-1.0, 1.0)}))
    assert [own.status for own in (free, held)] == [Status.INFEASIBLE] * 2
    assert "limits" not in free.advice
    assert "widen the limits" in held.advice
    assert all(own.advice.startswith(f"Does not fit: nut 19.79 mm in slot 19.60 mm, {WALLS}.") for own in (free, held))


def test_a_solution_outside_the_fit_survives_its_plain_data() -> None:
    solution = fo.solve(nut_in_rail())
    data = json.loads(json.dumps(solution.to_dict()))
    assert (data["status"], data["usable"], data["advice"]) == ("OUTSIDE_FIT", False, solution.advice)
    again = Solution.from_dict(data)
    assert (again.status, again.usable) == (Status.OUTSIDE_FIT, False)
    judged = again.with_certificate(fo.verify(again), {})
    assert (judged.status, judged.usable) == (Status.OUTSIDE_FIT, False)
    with pytest.raises(fo.errors.UnsolvedError, match="Does not fit: nut 19"):
        fo.solve(nut_in_rail(), throw=True)


@pytest.fixture(scope="module")
def problem_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cases = [{"name": letter, "requirement": letter, "goal": "touch"} for letter in "AB"]
    cases.append({"name": "flush", "requirement": "B", "goal": "seat"})
    path = tmp_path_factory.mktemp("nut") / "nut.toml"

    def written(body: fo.Body) -> str:
        listed = [list(range(8 * k + 1, 8 * k + 9)) for k in range(len(body.parts))]  # all parts are boxes
        corners = np.concatenate([part.vertices for part in body.parts]).tolist()
        return f"name = {json.dumps(body.name)}\nvertices = {corners}\nparts = {listed}\nseed = {body.seed.tolist()}\n"

    text = 'title = "T-nut in its rail"\n'
    for role, body in (("movable", t_nut()), ("static", t_rail())):
        text += f"[bodies.{role}]\n{written(body)}\n"
    text += '[defaults]\nnominal = "drawn"\ntolerance = 0.02\nmotion = [{ translation = "z" }]\n'
    for case in cases:
        text += "[[case]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in case.items())
    path.write_text(text)
    return path


def test_the_command_line_tells_and_ends_with_an_error(problem_file: Path) -> None:
    found = CliRunner().invoke(app, ["solve", str(problem_file), "--case", "B"])
    assert found.exit_code == 1
    words = re.sub(r"\s+", " ", found.stdout)
    assert "does not fit: nut 19.79 in slot 19.60" in words
    assert "With this motion the parts fit up to ±1.52 %." in words
    assert "outside" in found.stdout
    assert " yes" not in found.stdout
    data = json.loads(CliRunner().invoke(app, ["solve", str(problem_file), "--json"]).stdout)
    cases = {case["name"]: case for file in data["files"] for case in file["cases"]}
    assert {name: case["usable"] for name, case in cases.items()} == {"A": True, "B": False, "flush": False}
    assert [cases[name]["fits_up_to"] for name in ("B", "flush")] == [pytest.approx(0.6 / 39.4, rel=1e-4)] * 2
    assert cases["A"]["fits_up_to"] is None


def test_whatif_called_a_motion_outside_the_fit_bad_input(problem_file: Path) -> None:
    found = CliRunner().invoke(app, ["whatif", str(problem_file), "--case", "B"])
    assert found.exit_code == 1
    assert f"does not fit: nut 19.79 in slot 19.60, {WALLS}" in re.sub(r"\s+", " ", found.stdout)
    data = json.loads(CliRunner().invoke(app, ["whatif", str(problem_file), "--case", "B", "--json"]).stdout)
    assert data["files"][0]["cases"][0]["solution"]["status"] == "OUTSIDE_FIT"


def test_a_motion_outside_the_fit_is_told_as_none_and_by_how_much_the_parts_do_not_fit(problem_file: Path) -> None:
    """The nut, out of its rail by some motion, had its parameter and amount in the tables, and its bound as a share."""
    solved = next(fo.solve(own) for own in fo.load_problems(problem_file) if own.name == "B")
    number = f"{abs(solved.amount):.4g}"
    found = CliRunner().invoke(app, ["solve", str(problem_file), "--case", "B"]).stdout
    assert number not in found
    assert "% of it" not in found
    assert f"amount {number}" not in str(solved)
    asked = ["whatif", str(problem_file), "--case", "A", "--set", "requirement=B"]
    words = re.sub(r"\s+", " ", CliRunner().invoke(app, asked).stdout)
    assert f"after: does not fit: nut 19.79 in slot 19.60, {WALLS}" in words
    assert number not in words
    assert "outside the fit" not in words


def test_what_holds_a_motion_is_told_by_whole_bodies_once() -> None:
    problem = nut_in_rail(0.01)
    names = [f"convex part {k} of nut and convex part {k + 1} of slot stays apart" for k in range(30)]
    assert held_text(names, problem) == "nut and slot kept apart"
    assert held_text([f"limit {k}" for k in range(30)], problem) == "limit 0; limit 1; limit 2; and 27 more"
    assert held_text([], problem) == "none"


def test_sizes_that_mend_what_does_not_fit_are_named_where_a_motion_leaves_the_fit() -> None:
    """Walls between which a nut does not go: its width and the slot's are what to change, and no limit."""
    bodies = {"movable": (t_nut(), 9.7), "static": (t_rail(), 10.0)}
    sizes = list[fo.Size]()
    for role, (body, half) in bodies.items():
        normals, points = body.face_planes
        rows = np.flatnonzero((np.abs(normals[:, 0]) > 0.9) & (np.abs(np.abs(points[:, 0]) - half) < 1e-9))
        faces = [f"F{row + 1}" for row in rows.tolist()]
        sizes.append(fo.Size(f"{body.name} wide", role, faces=faces, each=0.5, tolerance=1.0))
    asked = {"made": {"nut wide": 0.7}, "motion": UP, "goal": "clear", "unit": "mm"}
    problem = fo.Problem(t_nut(), t_rail(), sizes=sizes, **asked)
    solution = fo.solve(problem)
    assert solution.status is Status.OUTSIDE_FIT
    assert verdict_text(solution).startswith("does not fit: nut 20.100 mm in slot 20.000 mm")
    assert advised(SolvedCase(solution)) == "Change nut wide (to +0.6 mm) or slot wide (to -0.1 mm)."


def test_sizes_were_advised_beyond_their_tolerances_where_they_mend_together_within_them() -> None:
    """A block of 10.26 in a slot of 10.2: 1.026 x + y = .06, of tolerances of .05 each; at equal shares x = y = .0297.

    It has a bore, whose facets leave open more than that: a block so little too wide was lifted out as a success.
    """
    block = fo.cut(fo.Box((20, 10, 10), centre=(0, 0, 5)), fo.Cylinder(3, 30, base=(-15, 0, 5), axis="x", facets=16))
    slot = fo.cut(fo.Box((40, 30, 20), centre=(0, 0, 5)), fo.Box((50, 10.2, 20), centre=(0, 0, 10)))
    sizes = [
        fo.Size("block", "movable", faces=["+y", "-y"], each=0.5, tolerance=(-0.05, 0.0)),
        fo.Size(
            "slot", "static", faces=[{"through": (0, y, 10)} for y in (-5.1, 5.1)], each=-0.5, tolerance=(0.0, 0.05)
        ),
    ]
    asked = {"sizes": sizes, "target": (1.026, 1.0), "goal": "clear", "unit": "mm"}
    problem = fo.Problem(block, slot, motion=fo.Translation("y") >> UP, **asked)
    each = "block (to -0.0585 mm, beyond its tolerance) or slot (to +0.06 mm, beyond its tolerance)"
    together = "block (to -0.0297 mm) and slot (to +0.0297 mm) together"
    assert advised(SolvedCase(fo.solve(problem))) == f"Change {each}, or, within their tolerances, {together}."
    assert fo.solve(problem.with_sizes({"block": -0.0297, "slot": 0.0295})).status is Status.OUTSIDE_FIT
    assert fo.solve(problem.with_sizes({"block": -0.0297, "slot": 0.0297})).usable


@pytest.mark.slow
def test_the_report_shows_nothing_green_of_a_motion_outside_the_fit(problem_file: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    made = CliRunner().invoke(app, ["report", str(problem_file), "--out", str(page)], catch_exceptions=False)
    assert made.exit_code == 1
    text = page.read_text() if page.is_file() else next(tmp_path.rglob("*.html")).read_text()
    answers = dict(re.findall(r'<article class="answer" data-case="(\d)">(.*?)</article>', text, re.DOTALL))
    assert "mark good" in answers["0"]
    for number in "12":
        assert number == "2" or "mark good" not in answers[number]  # that nothing does is proved, and checked
        words = re.sub(r"\s+", " ", re.sub("<.*?>", "", answers[number]))
        assert f"Does not fit: nut 19.79 in slot 19.60, {WALLS}" in words
        assert "fit up to \u00b11.52 %" in answers[number]
    assert "mark bad" not in answers["2"]  # nothing was judged: it is no answer that was refused
    cells = re.findall(r'<td><a href="#case-1".*?</td>', text, re.DOTALL)
    assert cells
    assert all("mark good" not in cell and "outside the fit" in cell for cell in cells)


def test_the_cards_show_nothing_green_of_a_motion_outside_the_fit() -> None:
    card = fo.solve(nut_in_rail())._repr_html_()
    good = fo.solve(nut_in_rail(0.01))._repr_html_()
    assert "no: outside the fit" in card
    assert "\u2717 outside the fit" in card
    assert "Does not fit: nut 19.79 mm in slot 19.60 mm" in card
    assert "outside" not in good


def test_how_far_a_peg_may_be_shifted_hung_on_how_its_walls_were_cut() -> None:
    """A peg 9 wide between walls 10 apart and 6 thick, until its middle is at a wall's: 8, however thin its slices."""
    peg = fo.Body.convex(block((-4.5, 4.5), (-4.5, 4.5), (0.0, 8.0)))
    for slices in (1, 3):
        cuts = np.linspace(5.0, 11.0, slices + 1)
        walls = [block(tuple(sorted((sign * a, sign * b))), (-20.0, 20.0), (0.0, 9.0)) for sign in (1.0, -1.0)
                 for a, b in pairwise(cuts)]  # fmt: skip
        plate = fo.Body.from_parts([*walls, block((-20.0, 20.0), (-20.0, 20.0), (-3.0, 0.0))], seed=[0.0, 0.0, 1.0])
        problem = fo.Problem(peg, plate, tolerance=0.01, requirement="A", motion=ACROSS, goal="clear")
        assert passage(problem, np.array([1.0, 0.0, 0.0])) == pytest.approx((-8.0, 8.0), abs=1e-3)


def test_a_key_stays_in_its_slot_until_a_wall_s_middle_or_a_tenth_of_its_depth() -> None:
    problem = fo.load_problems(Path(__file__).parents[2] / "problems" / "slot_and_key.toml")[0]
    across, along = (passage(problem, np.array(way)) for way in ((2.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    middle = (0.0625 + 20.0) / 2.0
    assert across == pytest.approx((-middle / 2.0, middle / 2.0), abs=1e-3)  # in steps of 2
    assert along == pytest.approx((-(0.125 + 20.125) / 2.0, 0.9 * 7.875), abs=1e-3)
    beside = problem.changed(movable=problem.movable.moved(np.eye(4) + 90.0 * np.eye(4, k=3)))
    assert passage(beside, np.array([1.0, 0.0, 0.0])) == (-np.inf, np.inf)


@pytest.mark.parametrize("finer", [0, 1])
def test_a_bar_had_a_tie_with_a_motion_into_a_post_and_was_refused_where_finely_meshed(finer: int) -> None:
    """It turns off a post that it lies across, by the same either way; a second one, out of its reach, bars one."""
    posts = [((2.5, -0.3, -2), (4.5, 0.3, 1)), ((2.5, -2.2, -2), (4.5, -1.35, 1)), ((-6, -4, -2), (6, 4, -1))]
    mesh = trimesh.boolean.union([trimesh.creation.box(bounds=ends) for ends in posts])
    for _ in range(finer):
        mesh = mesh.subdivide()
    static = fo.Body.from_mesh(mesh, decomposition="surface", seed=(0, 0, 0))
    bar = fo.Body.convex([4.0, 0.5, 0.5] * (2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1.0))
    asked = {"target": (1, 1), "goal": "clear", "motion": fo.Rotation("z"), "limits": {"RZ": (-1, 1)}, "length": 1.0}
    found = fo.solve(fo.Problem(bar, static, **asked))
    # the post's corner (2.5, .3) comes to lie on the bar's lower side: 2.5 sin t - .3 cos t = .5
    assert found.usable
    assert found.parameters["RZ"] == pytest.approx(np.arcsin(0.5 / np.hypot(2.5, 0.3)) + np.arctan2(0.3, 2.5))
    assert found.sensitivity.reasons == ()


@pytest.mark.parametrize("turn", [0.0, 0.02])
@pytest.mark.parametrize("way", [(0.0, 1.0), (0.3, 1.0), (1.0, 0.1)])
def test_planes_between_parts_tell_of_no_passage_what_lines_do(
    way: tuple[float, float], turn: float, monkeypatch: Any
) -> None:
    """A nut cut into slices goes through the lips of its rail, or not, turning or not; from either path."""
    problem = nut_in_rail().changed(motion=ACROSS >> fo.Rotation("x"))
    asked = [(far * way[0], far * way[1], far * turn) for far in (-40.0, -9.0, -1.0, 0.2, 3.0, 9.0, 40.0)]
    found = []
    for pairs in (passing.MOST_PAIRS, 0):
        monkeypatch.setattr(passing, "MOST_PAIRS", pairs)
        engagement.goes_through.cache_clear()
        found.append([engagement.goes_through(problem, q) for q in asked])
    assert found[0] == found[1]
    assert 0 < sum(found[0]) < len(asked)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("made", "clearance", "words"),
    [
        # a play of 0.02 at the radius, and what stops a clearance is the top
        ({"place": 0.03}, 0.004, "fits, clearance not met: no such motion leaves 0.004 in the place it is drawn in; "),
        ({"place": 0.001}, 0.004, "fits, clearance not met: no such motion leaves 0.004 in the place it is drawn in; "),
        ({"place": 0.001, "bore": -0.06}, 0.0, "does not fit: cover 7.960 in base 7.940, across the bore of radius 4 "),
        (
            {"place": 0.03, "bore": -0.05},
            0.0,
            "does not fit: cover 7.9600 in base 7.9500, across the bore of radius 4 ",
        ),
    ],
)
def test_widths_are_of_the_true_faces_where_the_body_made_is_cut_anew(
    made: dict[str, float], clearance: float, words: str
):
    plate, pin = fo.Box((60, 40, 5), centre=(0, 0, 2.5)), fo.Cylinder(3.98, 9, base=(0, 0, -8))
    cover = fo.joined(plate, pin, name="cover")
    base = fo.cut(fo.Box((60, 40, 15), centre=(0, 0, -7.5)), fo.Cylinder(4.0, 11, base=(0, 0, -10)), name="base")
    sizes = [
        fo.Size("place", "static", faces=["bore radius 4"], along="y", tolerance=0.03),
        fo.Size("bore", "static", faces=["bore radius 4"], each=-0.5, tolerance=0.1),
    ]
    motion = fo.Translation("x") >> fo.Translation("y")
    solution = fo.solve(
        fo.Problem(cover, base, motion=motion, goal="clear", clearance=clearance, sizes=sizes, made=made)
    )
    assert solution.status.name == "OUTSIDE_FIT"
    assert str(solution).startswith(words)


@pytest.mark.parametrize(("motion", "status"), [("y", "OUTSIDE_FIT"), ("z", "SOLVED")])
def test_a_saddle_was_moved_off_the_end_of_its_way(motion: str, status: str) -> None:
    """A saddle on a rail 60 long, whose top is .02 higher: .02 up, or 60 along it, off its end ("proved")."""
    rail = fo.joined(fo.Box((60, 60, 10), centre=(0, 0, -5)), fo.Box((20, 60, 10), centre=(0, 0, 5)), name="rail")
    saddle = fo.cut(fo.Box((40, 60, 20), centre=(0, 0, 11)), fo.Box((20, 80, 20), centre=(0, 0, 0)), name="saddle")
    top = fo.Size("top", "static", faces=[{"through": [0, 0, 10]}], tolerance=0.02)
    asked = {"sizes": [top], "made": {"top": 0.02}, "goal": "clear", "motion": fo.Translation(motion)}
    solution = fo.solve(fo.Problem(saddle, rail, **asked))
    assert solution.status.name == status
    assert solution.amount == pytest.approx({"y": 60.0, "z": 0.02}[motion])


def test_widths_were_said_to_prove_that_no_motion_does() -> None:
    """They are along two walls: a shift that is slanted may part others. A claim of it is the solver's to make."""
    peg, plate = fo.Box((2.0, 2.0, 3.0), name="peg"), fo.cut(fo.Box((6, 6, 2)), fo.Box((2.02, 2.02, 4)), name="plate")
    narrow: dict[str, Any] = {"motion": fo.Translation("x"), "limits": {"TX": (-1.0, 1.0)}}
    problem = fo.Problem(peg, plate, tolerance=0.02, requirement="B", goal="touch", **narrow)
    none = fo.solve(problem)
    assert none.status is Status.INFEASIBLE
    assert "no such motion brings them together" in verdict_text(none)
    told = verdict_text(dataclasses.replace(none, status=Status.NOT_FOUND))
    assert told.startswith("does not fit: peg")
    assert told.endswith("; no motion found, and none proved impossible")
    assert "no such motion" not in told


def test_a_pin_wider_than_its_bore_was_said_to_fit_perhaps_and_overlapped_by_two_lengths() -> None:
    """A pin and a bore of radius 6, 2 % larger and smaller, below a flange on a face: 12.24 in 11.76."""
    pin = fo.joined(fo.Box((30, 20, 10), centre=(0, 0, 5)), fo.Cylinder(6, 15, base=(0, 0, -14)), name="pin")
    base = fo.cut(fo.Box((80, 60, 20), centre=(0, 0, -10), name="base"), fo.Cylinder(6, 30, base=(0, 0, -25)))
    flange = next(own.feature.label for own in fo.Problem(pin, base, target=(1, 1), motion=UP).nominal_joints
                  if abs(own.normals[0][2]) > 0.9)  # fmt: skip
    shifts = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
    asked = {"tolerance": 0.02, "requirement": "B", "goal": "seat", "contacts": [flange], "unit": "mm"}
    out = fo.solve(fo.Problem(pin, base, motion=shifts, **asked), effort="quick")
    assert out.status is Status.OUTSIDE_FIT
    assert out.amount == pytest.approx(math.hypot(0.98 * 30 + 1.02 * 6, 0.15), rel=1e-5)  # off the side of the base
    near = dict.fromkeys(("TX", "TY", "TZ"), (-5.0, 5.0))
    solution = fo.solve(fo.Problem(pin, base, motion=shifts, limits=near, **asked), effort="quick")
    assert verdict_text(solution).startswith("does not fit: pin 12.24 mm in base 11.76 mm, across the bore of radius 6")
    assert advised(SolvedCase(solution)) == "Choose a smaller tolerance, or other sizes."
    assert all("(of their facets) overlap by" in line for line in solution.active if "overlap" in line)
    assert any("is of the facets" in line for line in remarks(solution))


@pytest.mark.parametrize("goal", ["seat", "at", "touch", "clear"])
def test_faces_that_block_a_block_were_not_named(goal: Any) -> None:
    """A block 10 wide in a slot of 10.4, .1 off its right wall, is made 3 % wider about its seed on the left."""
    slot = fo.cut(fo.Box((30, 30, 10), centre=(0, 0, -2)), fo.Box((10.4, 40, 10), centre=(0, 0, 5)), name="slot")
    wide = fo.Body.convex(block((-4.9, 5.1), (-5, 5), (0, 10)), seed=(-4.9, 0, 0), name="block")
    asked = fo.Problem(wide, slot, target=(1.03, 1), nominal=(1, 1), goal=goal, motion=UP)
    solution = fo.solve(asked)
    assert "right face of block, face " in str(solution)
    assert "(facing -x) of slot overlap by 0.2" in str(solution)
    assert fo.solve(asked.changed(motion=ACROSS)).usable


@pytest.mark.parametrize(
    ("more", "most"),
    [
        ({"clearance": 0.25}, "0.2 mm"),  # half of the play of .4
        ({"clearance": 0.25, "limits": {"TX": (-1, 0.1)}}, "0.15 mm"),  # .05 + .1
        ({"clearance": 0.15, "keep_out": [fo.KeepOut(fo.Box((4, 4, 4), centre=(6.9, 0, 8)))]}, "0.1 mm"),
    ],
)
def test_the_largest_clearance_that_can_be_met_was_not_told(more: dict[str, Any], most: str) -> None:
    """A peg 10 wide in a hole of 10.4, .05 off one wall; a keep-out at 4.9 leaves it .05 on the other side."""
    plate = fo.cut(fo.Box((30, 30, 6), centre=(0, 0, 3)), fo.Box((10.4, 12, 8), centre=(0, 0, 3)), name="plate")
    peg = fo.Box((10, 10, 10), centre=(-0.15, 0, 5), name="peg")
    asked = fo.Problem(peg, plate, target=(1, 1), goal="clear", motion=fo.Translation("x"), unit="mm", **more)
    assert advised(SolvedCase(fo.solve(asked))) == f"Choose a smaller clearance, at most {most}."


@pytest.mark.parametrize("goal", ["clear", "seat", "touch"])
def test_a_hollow_part_that_came_out_thicker_was_said_to_leave_the_fit(goal: str) -> None:
    """A frame on a frame, as a spacer on a bearing ring: half of what it is thicker lifts it, whatever holds it."""

    def frame(outer: float, inner: float, low: float, high: float) -> fo.Body:
        middle = (0.0, 0.0, (low + high) / 2)
        hole = fo.Box((inner, inner, high - low + 2.0), centre=middle)
        return fo.cut(fo.Box((outer, outer, high - low), centre=middle), hole)

    height = fo.Size("height", "movable", faces=["+z", "-z"], each=0.5, tolerance=0.02)
    asked = {"sizes": [height], "made": {"height": 0.02}, "goal": goal, "motion": fo.Translation("z")}
    found = fo.solve(fo.Problem(frame(39, 30, 12, 27), frame(40, 20, 0, 12), **asked))
    assert found.usable
    assert found.amount == pytest.approx(0.01, rel=1e-9)


def test_collars_that_do_not_go_over_a_saddle_are_out_of_the_fit_though_one_hangs_into_its_channel() -> None:
    # a channel is within the hull of its walls: what is above them by half may be in that hull yet. The lift is that
    # of a chamfer, 1.2 up for 1 across, over the edge of the channel
    walls = [block(x, (-15.0, 15.0), (-25.0, 15.0)) for x in ((-25.0, -12.05), (12.05, 25.0))]
    saddle = fo.Body.from_parts([*walls, block((-12.05, 12.05), (-15.0, 15.0), (-25.0, -12.05))], seed=(0, 0, 0))
    profile = [(16.0, 16.0), (16.0, -4.0), (6.0, -16.0), (-6.0, -16.0), (-16.0, -4.0), (-16.0, 16.0)]
    collars = [np.array([(x, y, z) for y in own for x, z in profile]) for own in ((-20.2, -15.2), (15.2, 20.2))]
    bar = fo.Body.from_parts([block((-12.0, 12.0), (-40.0, 40.0), (-12.0, 12.0)), *collars], seed=(0, 0, 0))
    problem = fo.Problem(bar, saddle, target=(0.98, 1.02), goal="clear", motion=UP)
    found = fo.solve(problem)
    assert found.status is Status.OUTSIDE_FIT
    assert verdict_text(found).startswith("does not fit: body 30.60 in body 29.79")
    lift = 1.02 * 15.0 + 0.98 * 4.0 + 1.2 * (0.98 * 16.0 - 1.02 * 12.05)
    assert found.amount == pytest.approx(lift, rel=1e-9)


def test_what_overlaps_at_one_face_was_told_once_a_part() -> None:
    """A lid in two halves on a block, which is .1 too high: its bottom is one face, and overlaps the top by .1."""
    block = fo.Box((10, 10, 4), centre=(0, 0, -2), name="block")
    halves = [fo.Box((20, 10, 2), centre=(0, y, 1)) for y in (-5, 5)]
    lid = fo.Body.from_parts([own.vertices for own in halves], name="lid")
    high = fo.Size("high", "static", faces="+z", tolerance=0.2)
    asked = {"sizes": [high], "made": {"high": 0.1}, "goal": "clear", "motion": fo.Translation("x")}
    told = fo.solve(fo.Problem(lid, block, limits={"TX": (-0.1, 0.1)}, **asked)).reason
    assert told.count("overlap by 0.1") == 1


# ----------------------------------------------------------------------- where a motion that stays in the fit is larger


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "motion",
    [
        ACROSS >> fo.Rotation("z"),
        fo.Translation("x") >> fo.Translation("y") >> fo.Rotation("z"),
        fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z") >> fo.Rotation("z"),
        fo.Free(),
    ],
    ids=["x z RZ", "x y RZ", "x y z RZ", "free"],
)
@pytest.mark.parametrize("effort", ["proved", "quick"])
def test_a_bar_turns_in_its_tray_where_what_is_found_first_lifts_it_out(motion, effort):
    """Length L, width w, tray W wide: L cos t + w sin t = W; shifts alone leave the fit."""
    length, width, deep = 100.0, 20.0, 99.5
    bar = fo.Box((length, width, 8.0), centre=(0, 0, 4.0), name="bar")
    floor = fo.Box((deep + 20.0, 60.0, 2.0), centre=(0, 0, -1.0))
    walls = [fo.Box((10.0, 60.0, 20.0), centre=(s * (deep + 10.0) / 2.0, 0, 10.0)) for s in (-1, 1)]
    walls += [fo.Box((deep, 10.0, 20.0), centre=(0, s * 35.0, 10.0)) for s in (-1, 1)]
    tray = fo.joined(floor, *walls)
    found = fo.solve(fo.Problem(bar, tray, target=(1, 1), goal="clear", motion=motion), effort=effort)
    turn = brentq(lambda t: length * math.cos(t) + width * math.sin(t) - deep, 0.1, 0.5)
    assert found.usable
    assert abs(found.parameters["RZ"]) == pytest.approx(turn, abs=1e-6)
    assert found.lower_bound <= found.amount


@pytest.mark.parametrize("goal", ["clear", "touch"])
@pytest.mark.parametrize("motion", [fo.Rotation("z"), fo.Translation("x") >> fo.Rotation("z")])
def test_a_nut_too_wide_for_its_rail_was_turned_in_it_by_its_square_neck(goal: str, motion: fo.Motion) -> None:
    """A neck of 4 by 4 in a slot of 5: half-way its corners are .33 deep in either lip, where nothing was as drawn."""
    head, neck = fo.Box((8.1, 6, 3), centre=(0, 0, -3)), fo.Box((4, 4, 8), centre=(0, 0, 1))
    nut = fo.joined(head, neck, name="nut")
    space, slot = fo.Box((8, 41, 3.2), centre=(0, 0, -3)), fo.Box((5, 41, 12), centre=(0, 0, 4))
    rail = fo.cut(fo.Box((14, 40, 10), centre=(0, 0, -1)), space, slot, name="rail")
    found = fo.solve(fo.Problem(nut, rail, target=(1.0, 1.0), goal=goal, motion=motion))
    assert "straight there it goes through rail" in str(found).splitlines()[0]


def test_a_wide_turn_in_free_space_stays_in_the_fit() -> None:
    """A shaft in its bore, whose arm is turned against a stop: nothing overlaps on the way."""
    turned = fo.Rotation("z")
    shaft = fo.Cylinder(3.0, 8.0, base=(0, 0, -4), name="shaft")
    arm = fo.joined(shaft, fo.Box((8, 1, 1), centre=(4, 0, 4.5)), name="arm")
    plate = fo.cut(fo.Box((20, 20, 6)), fo.Cylinder(3.2, 8.0, base=(0, 0, -4)))
    stop = fo.joined(plate, fo.Box((1, 6, 3), centre=(-6, 3.5, 4.5)), name="plate")
    found = fo.solve(fo.Problem(arm, stop, target=(1.0, 1.0), goal="touch", motion=turned))
    assert found.usable
    assert abs(found.parameters["RZ"]) > 1.5
    assert "goes through" not in str(found)


def test_a_block_sensed_too_deep_in_its_corner_was_sent_through_the_floor() -> None:
    """By .45 out of each wall, where TX is limited to .3: it went down through the floor, and that was usable."""
    walls = fo.Box((5, 60, 40), centre=(-2.5, 25, 15)), fo.Box((60, 5, 40), centre=(25, -2.5, 15))
    corner = fo.joined(*walls, fo.Box((65, 65, 5), centre=(25, 25, -2.5)), name="corner")
    sensed = fo.Box((30, 20, 10), centre=(14.6, 9.6, 5.02), name="block")
    motion = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
    asked = {"target": (1, 1), "goal": "clear", "clearance": 0.05, "limits": {"TX": (-0.3, 0.3)}}
    for block in (sensed, sensed.moved(fo.Rotation("z").transform([0.03], sensed.seed, corner.seed))):
        assert fo.solve(fo.Problem(block, corner, motion=motion, **asked)).status is Status.OUTSIDE_FIT


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("chamfer", "radius"), [(0.4, 0.6), (0.3, 0.5), (0.2, 0.6)])
def test_a_key_raised_off_the_fillets_of_its_keyway_was_said_to_leave_it(chamfer: float, radius: float) -> None:
    """Its chamfer is smaller than the fillets: the lower corner of its side goes up to where a fillet begins."""
    a = 4.0
    outline = [(-a + chamfer, 0), (a - chamfer, 0), (a, chamfer), (a, 7), (-a, 7), (-a, chamfer)]
    upright = np.array([[1, 0, 0, 0], [0, 0, -1, 15], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    key = fo.Prism(outline, 30, name="key").moved(upright)
    tools = [fo.Box((8 - 2 * radius, 70, 20), centre=(0, 0, 10)), fo.Box((8, 70, 20), centre=(0, 0, 10 + radius))]
    tools += [fo.Cylinder(radius, 70, base=(side * (a - radius), -35, radius), axis="y", facets=24) for side in (-1, 1)]
    shaft = fo.cut(fo.Box((24, 60, 18), centre=(0, 0, -5)), *tools, name="shaft")
    found = fo.solve(fo.Problem(key, shaft, target=(1.0, 1.0), goal="clear", motion=UP))
    assert found.usable
    # where a fillet begins it leaves the wall by less than parts may overlap
    assert found.amount == pytest.approx(radius - chamfer, abs=math.sqrt(2.0 * radius * found.problem.contact_slack))


def test_a_key_wider_than_its_keyway_leaves_it() -> None:
    """Its sides have nothing beside them when it is clear."""
    shaft = fo.cut(fo.Box((24, 60, 18), centre=(0, 0, -5)), fo.Box((8, 70, 20), centre=(0, 0, 10)), name="shaft")
    key = fo.Box((8.1, 30, 7), centre=(0, 0, 3.5), name="key")
    assert fo.solve(fo.Problem(key, shaft, target=(1.0, 1.0), goal="clear", motion=UP)).status is Status.OUTSIDE_FIT
