"""Contacts as drawn of round parts are restored on their true faces: closed forms."""

import json
from dataclasses import replace
from html import unescape
from itertools import product
from math import cos, hypot, sin, sqrt

import numpy as np
import pytest
import trimesh
from scipy.optimize import minimize

import fcdm_opt as fo

X, Z = fo.Translation("x"), fo.Translation("z")
GRIPPER = """
title = "gripper"
[[part]]
name = "left"
file = "left.stl"
unit = "mm"
motion = [{ translation = "x" }]
[[part]]
name = "right"
file = "right.stl"
unit = "mm"
motion = [{ translation = "x" }]
[[part]]
name = "rod"
file = "rod.stl"
round = true
unit = "mm"
[[contact]]
parts = ["left", "rod"]
[[contact]]
parts = ["right", "rod"]
[[size]]
name = "rod diameter"
body = "rod"
faces = ["cylinder radius 5"]
each = 0.5
tolerance = 0.05
[[case]]
name = "thin"
made = { "rod diameter" = -0.05 }
[[case]]
name = "thick"
made = { "rod diameter" = 0.05 }
"""


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("facets", "off"), [*product((24, 64), (-0.05, 0.05))])
def test_a_jaw_follows_half_the_diameter_of_the_rod_that_it_touches(facets: int, off: float) -> None:
    jaw = fo.Box((10, 12, 14), centre=(-10, 0, 0))
    rod = fo.Cylinder(5.0, 30.0, base=(0, 0, -15), facets=facets)
    size = fo.Size("diameter", "static", faces="cylinder radius 5", each=0.5, tolerance=0.05)
    asked = fo.Problem(jaw, rod, sizes=[size], made={"diameter": off}, goal="at", motion=fo.Translation("x"))
    found = fo.solve(asked)
    assert found.parameters["TX"] == pytest.approx(-off / 2, abs=1e-9)
    assert found.lower_bound == pytest.approx(abs(off) / 2, rel=1e-6)
    assert found.amount_high == pytest.approx(abs(off) / 2, rel=1e-6)
    assert "goal at: TX" in str(found)
    assert found.certificate is not None
    assert "contacts restored" in [check.name for check in found.certificate.checks]
    opened = replace(found, transform=np.eye(4))  # where the rod is not touched, or overlaps
    assert "contacts restored" in [check.name for check in fo.verify(opened).failed]
    assert fo.verify(found).passed
    assert fo.verify(fo.Solution.from_dict(found.to_dict())).passed


def test_a_gripper_closes_on_a_round_rod_of_another_diameter(tmp_path) -> None:
    for name, x in (("left", -10.0), ("right", 10.0)):
        trimesh.creation.box((10, 12, 14), np.array(trimesh.transformations.translation_matrix((x, 0, 0)))).export(
            tmp_path / f"{name}.stl"
        )
    trimesh.creation.cylinder(5.0, 30.0, sections=64).export(tmp_path / "rod.stl")
    (tmp_path / "gripper.toml").write_text(GRIPPER)
    for asked, off in zip(fo.load_assemblies(tmp_path / "gripper.toml"), (-0.05, 0.05), strict=True):
        found = fo.solve(asked)
        moved = [found.parameters[name]["TX"] for name in ("left", "right")]
        assert moved == pytest.approx([-off / 2, off / 2], abs=1e-7)  # the files have single precision
        assert found.amount == pytest.approx(hypot(off / 2, off / 2), rel=1e-5)
        assert found.lower_bound == pytest.approx(found.amount, rel=1e-6)
        assert found.amount_high == pytest.approx(found.amount, rel=1e-6)
        assert "cylinder of radius" in str(found.contacts[0])
        assert fo.verify(found).passed
        assert fo.verify(fo.AssemblySolution.from_dict(found.to_dict())).passed


@pytest.mark.parametrize("half", [np.pi / 4, np.pi / 3])
def test_a_roller_rises_in_its_v_block(half: float) -> None:
    rise = 10.0 / np.tan(half)
    right = np.array([(x, y, z) for y in (-5, 5) for x, z in ((0, 0), (10, rise), (10, -5), (0, -5))], float)
    block = fo.joined(fo.Body.convex(right), fo.Body.convex(right * (-1.0, 1.0, 1.0)))
    roller = fo.Cylinder(2.0, 20.0, base=(0, -10, 2.0 / sin(half)), axis=(0, 1, 0), facets=48)
    size = fo.Size("diameter", "movable", faces="cylinder radius 2", each=0.5, tolerance=0.05)
    made = {"diameter": 0.02}
    asked = fo.Problem(roller, block, sizes=[size], made=made, goal="at", motion=fo.Translation("z"))
    found = fo.solve(asked)
    assert found.parameters["TZ"] == pytest.approx(0.01 / sin(half), rel=1e-8)
    assert found.lower_bound == pytest.approx(found.amount, rel=1e-6)
    assert fo.verify(found).passed
    assert sum(found.seconds.values()) > 0.0  # the time was "not measured"


def v_block(half: float, radius: float) -> fo.Body:
    """A groove along z whose flanks a roller of a radius about the z axis touches, each at an angle from the x axis."""
    apex, length = -radius / sin(half), 2.4 * radius
    x, y = apex + length * cos(half), length * sin(half)
    return fo.Prism([(apex - 5, -y), (x, -y), (apex, 0), (x, y), (apex - 5, y)], 20.0, name="block")


ROLLER_IN_V = """
bodies.movable = { file = "roller.stl", unit = "mm", round = true }
bodies.static = { file = "block.stl", unit = "mm" }
[[size]]
name = "diameter"
body = "movable"
faces = "cylinder radius 12"
each = 0.5
tolerance = 0.05
[[case]]
name = "thin"
goal = "at"
contacts = "all"
made = { diameter = -0.04 }
motion = [{ translation = "x" }, { translation = "y" }]
"""


@pytest.mark.parametrize("half", [np.pi / 4, np.pi * 3 / 16])
def test_a_roller_of_single_precision_had_no_derivative_by_its_diameter(tmp_path, half: float) -> None:
    """Corners of its rims are off its cylinder by the digits of the file, and were contacts besides its face's."""
    block = trimesh.Trimesh(**trimesh.triangles.to_kwargs(v_block(half, 12.0).face_triangles[0]))
    roller = trimesh.creation.cylinder(12.0, 60.0, sections=64)  # with corners where it touches
    for solid, name in ((roller, "roller"), (block, "block")):
        solid.apply_translation((0.3, -3.03, 0.0))
        solid.export(tmp_path / f"{name}.stl")
    (tmp_path / "v.toml").write_text(ROLLER_IN_V, encoding="utf-8")
    (problem,) = fo.load_problems(tmp_path / "v.toml")
    found = fo.solve(problem)
    assert found.amount == pytest.approx(0.02 / sin(half), abs=1e-5)
    assert found.sensitivity.sizes["diameter"] == pytest.approx(-0.5 / sin(half), abs=1e-6)
    assert found.sensitivity.motion_by_size["diameter"] == pytest.approx([0.5 / sin(half), 0.0], abs=1e-6)


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("half", "off"), [(np.pi / 4, -0.05), (np.pi * 3 / 16, 0.05), (np.pi * 3 / 8, -0.05)])
def test_a_roller_stays_on_both_flanks_where_one_is_nearer(half: float, off: float) -> None:
    """A thin one touches sooner by going to one flank: what both need was known of facets alone."""
    roller = fo.Cylinder(5.0, 30.0, base=(0, 0, -5), name="roller")
    size = fo.Size("diameter", "movable", faces="cylinder radius 5", each=0.5, tolerance=0.05)
    x, y, z = map(fo.Translation, "xyz")
    for motion in (x >> y, x >> y >> z):
        asked = {"sizes": [size], "made": {"diameter": off}, "goal": "at"}
        found = fo.solve(fo.Problem(roller, v_block(half, 5.0), **asked, motion=motion))
        assert found.parameters["TX"] == pytest.approx(off / 2 / sin(half), rel=1e-9)
        assert found.amount == pytest.approx(abs(off) / 2 / sin(half), rel=1e-9)
        assert (found.lower_bound, found.amount_low, found.amount_high) == pytest.approx([found.amount] * 3, rel=1e-9)
        assert fo.verify(found).passed
        assert not found.left_by_mesh
    none = fo.solve(fo.Problem(roller, v_block(half, 5.0), **asked, motion=y))
    assert none.status.name == "INFEASIBLE"
    assert "(proved)" in str(none)
    free = fo.solve(fo.Problem(roller, v_block(half, 5.0), **asked, motion=x >> y, limits={"TX": (-0.001, 0.001)}))
    assert not free.usable


@pytest.mark.sampled(1)
@pytest.mark.parametrize("off", [-0.05, 0.05])
def test_a_ball_stays_on_all_three_faces_of_its_corner(off: float) -> None:
    corner = fo.cut(fo.Box((24, 24, 24), centre=(10, 10, 10)), fo.Box((24, 24, 24), centre=(12, 12, 12)))
    size = fo.Size("diameter", "movable", faces="sphere radius 5", each=0.5, tolerance=0.05)
    x, y, z = map(fo.Translation, "xyz")
    asked = {"sizes": [size], "made": {"diameter": off}, "goal": "at"}
    ball = fo.Sphere(5.0, centre=(5, 5, 5))
    found = fo.solve(fo.Problem(ball, corner, **asked, motion=x >> y >> z))
    assert [*found.parameters.values()] == pytest.approx([off / 2] * 3, rel=1e-9)
    assert found.lower_bound == pytest.approx(found.amount)
    assert fo.verify(found).passed
    assert fo.solve(fo.Problem(ball, corner, **asked, motion=x >> y)).status.name == "INFEASIBLE"


@pytest.mark.parametrize(("half", "off"), [(np.pi / 6, 0.05), pytest.param(np.pi / 3, -0.05, marks=pytest.mark.slow)])
def test_a_roller_whose_facets_do_not_touch_its_v_block(half: float, off: float) -> None:
    """Its true face does: goal "at" was refused, as the facets are apart as drawn."""
    roller = fo.Cylinder(5.0, 30.0, base=(0, 0, -5), name="roller")
    size = fo.Size("diameter", "movable", faces="cylinder radius 5", each=0.5, tolerance=0.05)
    x, y = map(fo.Translation, "xy")
    asked = {"sizes": [size], "goal": "at", "motion": x >> y}
    problem = fo.Problem(roller, v_block(half, 5.0), **asked, made={"diameter": off})
    for found in (fo.solve(problem), fo.solve(problem, certify=True)):
        assert found.parameters["TX"] == pytest.approx(off / 2 / sin(half), rel=1e-9)
        assert found.lower_bound == pytest.approx(found.amount, rel=1e-6)
        assert fo.verify(found, proof=True).passed
        read = fo.Solution.from_dict(found.to_dict())
        assert read.problem.goal == "at"
        assert fo.verify(read, proof=True).passed
    rates = found.sensitivity
    assert rates.sizes["diameter"] == pytest.approx(np.sign(off) / 2 / sin(half), rel=1e-6)
    assert rates.motion_by_size["diameter"] == pytest.approx([0.5 / sin(half), 0.0], abs=1e-6)
    changed = fo.whatif(problem, made={"diameter": 0.4 * off})
    assert changed.prediction.amount == pytest.approx(abs(0.2 * off) / sin(half), rel=1e-6)
    none = fo.solve(fo.Problem(roller, v_block(half, 5.0), **{**asked, "motion": y}, made={"diameter": off}))
    assert none.status.name == "INFEASIBLE"
    assert none.reason.count(f"{'overlap by' if off > 0 else 'are'} {abs(off) / 2:.4g}") == 2
    asked["motion"] = x >> fo.Rotation("z")
    turned = fo.solve(fo.Problem(roller, v_block(half, 5.0), **asked, made={"diameter": off}))
    assert turned.parameters["TX"] == pytest.approx(off / 2 / sin(half), rel=1e-9)
    assert turned.lower_bound == pytest.approx(turned.amount, rel=2e-6)
    for other in ({"resolution": 0.01}, {"amount": "displacement"}):
        with pytest.raises(fo.InputError, match="between their facets"):  # of these only facets are followed
            fo.Problem(roller, v_block(half, 5.0), **{**asked, **other}, made={"diameter": off})
    apart = fo.Cylinder(5.0, 30.0, base=(0.01, 0, -5), name="roller")
    with pytest.raises(fo.InputError, match="nominal"):
        fo.Problem(apart, v_block(half, 5.0), **asked, made={"diameter": off})
    stack = fo.stack_up(problem)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((-0.025, 0.025))


@pytest.mark.parametrize(
    ("facets", "off"),
    [(32, -0.05), *(pytest.param(count, 0.05, marks=pytest.mark.slow) for count in (30, 33))],
)
def test_a_pin_that_stands_on_the_floor_in_a_corner(facets: int, off: float) -> None:
    """One contact is of plane faces: walls that facets do not touch were left out, others known of facets alone."""
    walls = fo.Box((4, 40, 20), centre=(-7, 0, 10)), fo.Box((30, 4, 20), centre=(5, -7, 10))
    fixture = fo.joined(fo.Box((60, 40, 4), centre=(0, 0, -2)), *walls)
    size = fo.Size("diameter", "movable", faces="cylinder radius 5", each=0.5, tolerance=0.05)
    x, y, z = map(fo.Translation, "xyz")
    asked = {"sizes": [size], "made": {"diameter": off}, "goal": "at"}
    pin = fo.Cylinder(5.0, 20.0, facets=facets)
    for motion in (x >> y, x >> y >> z):
        found = fo.solve(problem := fo.Problem(pin, fixture, **asked, motion=motion))
        assert [*found.parameters.values()][:2] == pytest.approx([off / 2] * 2, abs=1e-9)
        assert found.amount == pytest.approx(hypot(off, off) / 2, rel=1e-9)
        assert (found.lower_bound, found.amount_high) == pytest.approx([found.amount] * 2, rel=1e-9)
        assert fo.verify(found, proof=True).passed
    pose = fo.best_pose(problem)
    assert pose.worst_gap == pytest.approx(0.025)
    assert pose.passed
    assert fo.solve(fo.Problem(pin, fixture, **asked, motion=x)).status.name == "INFEASIBLE"


@pytest.mark.sampled(1)
@pytest.mark.parametrize("off", [-0.05, 0.05])
def test_contacts_of_a_round_part_that_share_its_motion(off: float) -> None:
    """A roller between a floor and a wall, and a plate on it that moves with it: what true parts need was not known."""
    floor = fo.Prism([(-8, -8), (8, -8), (8, -5), (-8, -5)], 20.0)
    wall, plate = fo.Box((4, 10, 20), centre=(7, 0, 10)), fo.Box((9.8, 4, 20), centre=(0, 7, 10))
    size = fo.Size("diameter", "roller", faces="cylinder radius 5", each=0.5, tolerance=0.05)
    x, y = map(fo.Translation, "xy")
    asked = fo.Assembly(
        {"floor": floor, "wall": wall, "plate": plate, "roller": fo.Cylinder(5.0, 30.0, base=(0, 0, -5))},
        motions={"roller": x >> y, "plate": y},
        contacts=[("roller", "floor"), ("roller", "wall"), ("plate", "roller")],
        sizes=[size],
        made={"diameter": off},
    )
    found = fo.solve(asked)
    assert [*found.parameters["roller"].values()] == pytest.approx([-off / 2, off / 2], rel=1e-9)
    assert found.parameters["plate"]["TY"] == pytest.approx(off / 2, rel=1e-9)
    assert found.amount_low == pytest.approx(found.amount) == found.lower_bound
    assert not found.left_by_mesh
    assert fo.verify(found).passed
    assert fo.verify(fo.AssemblySolution.from_dict(found.to_dict())).passed
    assert fo.verify(fo.solve(asked, certify=True), proof=True).passed
    rates = found.sensitivity
    assert rates.parameters == ("plate.TY", "roller.TX", "roller.TY")
    assert rates.motion_by_size["diameter"] == pytest.approx([0.5, -0.5, 0.5], abs=1e-6)
    stack = fo.stack_up(asked, of=("plate", "roller"))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((-0.025, 0.025))
    assert not stack.known_to


def test_a_keep_out_that_the_restored_roller_would_meet() -> None:
    """Its contacts are restored by one motion alone, which the keep-out forbids."""
    roller = fo.Cylinder(5.0, 30.0, base=(0, 0, -5), name="roller")
    size = fo.Size("diameter", "movable", faces="cylinder radius 5", each=0.5, tolerance=0.05)
    stop = fo.KeepOut(fo.Box((2, 2, 20), centre=(6.01, 0, 10)), name="stop")
    x, y = map(fo.Translation, "xy")
    asked = {"sizes": [size], "goal": "at", "motion": x >> y, "keep_out": [stop]}
    thick = fo.solve(fo.Problem(roller, v_block(np.pi / 4, 5.0), **asked, made={"diameter": 0.05}))
    assert not thick.usable
    thin = fo.solve(fo.Problem(roller, v_block(np.pi / 4, 5.0), **asked, made={"diameter": -0.05}))
    assert thin.usable
    assert thin.amount == pytest.approx(0.025 / sin(np.pi / 4), rel=1e-6)


@pytest.mark.parametrize("asked", [{"goal": "at"}, pytest.param({"contacts": "all"}, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_the_question_of_an_answer_was_the_one_that_was_solved_inside(asked: dict[str, str]) -> None:
    """Goal "touch" without contacts: of other sizes it asks for less, and its plain data asked for something else."""
    corner = fo.cut(fo.Box((24, 24, 24), centre=(10, 10, 10)), fo.Box((24, 24, 24), centre=(12, 12, 12)))
    size = fo.Size("diameter", "movable", faces="sphere radius 5", each=0.5, tolerance=0.05)
    motion = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")
    ball = fo.Sphere(5.0, centre=(5, 5, 5))
    problem = fo.Problem(ball, corner, sizes=[size], made={"diameter": -0.05}, motion=motion, **asked)
    found = fo.solve(problem)
    read = fo.Solution.from_dict(json.loads(json.dumps(found.to_dict())))
    for own in (found, read, fo.Solution.from_dict({**found.to_dict(problem=False), "problem": found.problem})):
        assert fo.verify(own, proof=True).passed
        kept = own.problem
        assert (kept.goal, kept.path, kept.pair) == (problem.goal, problem.path, problem.pair)
        assert [str(each) for each in kept.contacts] == [str(each) for each in problem.contacts]
        plain = kept.to_dict()
        del plain["case"][0]["exact_at"]
        assert plain == problem.to_dict()
        assert f"goal {problem.goal}" in str(own)
        assert f'"{problem.goal}"' in unescape(kept._repr_html_())
        other = fo.solve(kept.changed(made={"diameter": 0.04}))
        assert [*other.parameters.values()] == pytest.approx([0.02] * 3, rel=1e-9)
        assert fo.whatif(own.problem, made={"diameter": 0.04}).after.amount == pytest.approx(0.02 * 3**0.5)
        assert own.sensitivity.sizes["diameter"] == pytest.approx(-(3**0.5) / 2, rel=1e-6)


def test_the_question_of_a_contact_of_an_assembly_was_the_one_that_was_solved_inside(tmp_path) -> None:
    for name, side in (("left", -10), ("right", 10)):
        fo.Box((10, 12, 14), centre=(side, 0, 0)).to_file(tmp_path / f"{name}.stl")
    fo.Cylinder(5.0, 30.0, base=(0, 0, -15), facets=24).to_file(tmp_path / "rod.stl")
    (tmp_path / "gripper.toml").write_text(GRIPPER)
    for assembly in fo.load_assemblies(tmp_path / "gripper.toml"):
        found = fo.solve(assembly)
        read = fo.AssemblySolution.from_dict(json.loads(json.dumps(found.to_dict())))
        for own in (found, read):
            assert fo.verify(own, proof=True).passed
            for pair, contact in zip(assembly.contacts, own.contacts, strict=True):
                assert contact.problem.goal == assembly.problem(pair).goal != "touch"
                assert [*map(str, contact.problem.contacts)] == [*map(str, assembly.problem(pair).contacts)]


def hinge(**made: float) -> fo.Assembly:
    """Return a pin in the bores of two lugs and of a leaf, that both shift in the world: the leaf .05 below the pin."""
    y = {"axis": "y"}
    lugs = fo.cut(fo.Box((10, 20, 10)), fo.Cylinder(3, 40, base=(0, -20, 0), **y), name="lugs")
    pin = fo.Cylinder(2.95, 60, base=(0, -30, -0.05), name="pin", **y)
    leaf = fo.Box((10, 9.9, 10), centre=(0, 15.05, -0.1))
    leaf = fo.cut(leaf, fo.Cylinder(3, 40, base=(0, 0, -0.1), **y), name="leaf")
    sizes = [
        fo.Size("pin", "pin", faces="cylinder radius 2.95", each=0.5, tolerance=0.05),
        fo.Size("bore", "leaf", faces="bore radius 3", each=-0.5, tolerance=0.05),
    ]
    motions, follows = {"pin": X >> Z, "leaf": X >> Z}, {"leaf": "lugs"}
    return fo.Assembly(
        [lugs, pin, leaf], [("pin", "lugs"), ("leaf", "pin")], sizes, motions, follows=follows, made=made
    )


@pytest.mark.parametrize(
    ("made", "shifts"),
    [({"pin": -0.02}, (-0.01, -0.02)), ({"pin": 0.03}, (0.015, 0.03)), ({"pin": 0.02, "bore": 0.04}, (0.01, 0.0))],
)
def test_a_pin_in_two_bores_that_share_it_is_proved_least(made: dict[str, float], shifts: tuple[float, float]) -> None:
    """As far down as the play grows, the leaf by both plays; "proved at least 0" was said."""
    found = fo.solve(hinge(**made))
    down = [found.parameters[part]["TZ"] for part in ("pin", "leaf")]
    assert down == pytest.approx(shifts, abs=1e-9)
    assert found.lower_bound == pytest.approx(np.hypot(*shifts), rel=1e-9)


def test_a_shared_bound_of_round_contacts_was_checked_on_facets() -> None:
    """By which one a hundredth larger passed."""
    found = fo.solve(hinge(pin=-0.04, bore=0.02), certify=True)
    assert fo.verify(found, proof=True).passed
    claimed = [replace(own, bound=1.01 * own.bound) for own in found.evidence]
    assert "pin - lugs" in str(fo.verify(replace(found, evidence=tuple(claimed)), proof=True).failed)


def test_a_pin_aside_in_two_bores_moves_less_than_one_that_goes_straight_down() -> None:
    """With plays of .07 and .08, of which .05 each are used up as drawn: the least of all directions of both plays."""

    def shifts(angles: np.ndarray) -> np.ndarray:
        """Return x + i z of the pin and of the leaf, where each is at the end of its play at an angle."""
        pin, leaf = np.array([0.07, 0.08])[:, None] * np.exp(1j * angles) + 0.05j
        return np.array([pin, pin + leaf])

    def amount(angles: np.ndarray) -> np.ndarray:
        return np.linalg.norm(shifts(angles.reshape(2, -1)), axis=0)

    every = np.array([*product(np.linspace(-np.pi, np.pi, 361), repeat=2)]).T
    start = every[:, amount(every).argmin()]
    least = minimize(lambda x: amount(x)[0], start, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-14}).fun
    found = fo.solve(hinge(pin=-0.04, bore=0.02))
    assert found.amount == pytest.approx(least, rel=1e-8)
    assert found.lower_bound == pytest.approx(least, rel=1e-8)
    assert found.amount < 0.85 * hypot(0.02, 0.05)


def test_a_strap_over_a_pipe_of_another_size_in_bores_of_less_than_a_half() -> None:
    """A larger pipe rests on the edges of both, 1 beside the middle; of a smaller one less than straight down does."""
    bore, rise = fo.Cylinder(3, 40, base=(0, -20, 0), axis="y", facets=16), sqrt(3.01**2 - 8.0) - 1.0
    base = fo.cut(fo.Box((20, 10, 10), centre=(0, 0, -6)), bore, name="base")
    strap = fo.cut(fo.Box((20, 10, 10), centre=(0, 0, 6)), bore, name="strap")
    pipe = fo.Cylinder(3, 30, base=(0, -15, 0), axis="y", facets=16, name="pipe")
    size = fo.Size("pipe", "pipe", faces="cylinder radius 3", each=0.5, tolerance=0.05)
    motions, follows = {"pipe": X >> Z, "strap": X >> Z}, {"strap": "base"}
    contacts, parts = [("pipe", "base"), ("strap", "pipe")], [base, pipe, strap]
    found = fo.solve(fo.Assembly(parts, contacts, [size], motions, follows=follows, made={"pipe": 0.02}))
    assert [found.parameters[part]["TZ"] for part in ("pipe", "strap")] == pytest.approx([rise, 2 * rise], abs=1e-7)
    assert found.lower_bound >= 0.999 * rise
    thinner = fo.solve(fo.Assembly(parts, contacts, [size], motions, follows=follows, made={"pipe": -0.02}))
    assert thinner.usable
    assert thinner.amount < hypot(0.01, 0.02)


def test_an_end_face_flush_with_a_rod_turned_its_exact_contact_off() -> None:
    """The plane of the end is tangent to the rod as drawn, in two pieces, and one face where the rod is thinner."""
    plate = fo.Box((140, 140, 10), centre=(0, 0, 10), name="plate")
    rod = fo.Cylinder(5, 200, base=(-100, 0, 0), axis="x", facets=24)
    held = fo.joined(rod, fo.Box((20, 20, 10), centre=(-110, 0, 0)), name="rod")
    size = fo.Size("rod", "static", faces="cylinder radius 5", each=0.5, tolerance=(-0.009, 0))
    asked = {"sizes": [size], "made": {"rod": -0.009}, "goal": "at", "contacts": "all", "motion": Z}
    found = fo.solve(fo.Problem(plate, held, **asked))
    assert found.parameters["TZ"] == pytest.approx(-0.0045, rel=1e-9)
    assert found.usable
    assert found.lower_bound == pytest.approx(0.0045, rel=1e-9)
