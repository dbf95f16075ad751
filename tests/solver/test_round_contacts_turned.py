"""Contacts as drawn of round parts, restored by motions that turn: closed forms."""

import json
from dataclasses import replace
from math import acos, cos, degrees, pi, sin, sqrt

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import fcdm_opt as fo

CIRCLE, R = 20.0, 3.0
ANGLES = (pi / 2, 7 * pi / 6, 11 * pi / 6)
FREE = fo.Free()


def outward(angle: float) -> np.ndarray:
    return np.array([cos(angle), sin(angle), 0.0])


def on_three_balls(radius: float = R) -> fo.Body:
    """A plate on three balls, with their centres in the plane z = 0."""
    plate = fo.Cylinder(30, 3, base=(0, 0, 4))
    for angle in ANGLES:
        x, y, _ = CIRCLE * outward(angle)
        plate = fo.joined(plate, fo.Sphere(radius, centre=(x, y, 0)), fo.Cylinder(1, 3, base=(x, y, 2)))
    return plate


def grooved(angles=ANGLES) -> fo.Body:
    """A base with grooves of 90 degrees towards the middle."""
    base, apex = fo.Cylinder(30, 10, base=(0, 0, -12)), -R * sqrt(2)
    groove = fo.Prism([(0, apex), (6, 6 + apex), (-6, 6 + apex)], 20)
    for angle in angles:
        u, pose = outward(angle), np.eye(4)
        pose[:3, :3] = np.column_stack([np.cross(u, (0, 0, 1)), (0, 0, 1), -u])
        pose[:3, 3] = 30 * u
        base = fo.cut(base, groove.moved(pose))
    return base


def on_rods(aside: float = 4.0) -> fo.Body:
    """A base with two rods of the balls' radius under each of them."""
    base, depth = fo.Cylinder(34, 4, base=(0, 0, -12)), sqrt((2 * R) ** 2 - aside**2)
    for angle in ANGLES:
        u = outward(angle)
        across = np.cross((0, 0, 1), u)
        for side in (aside, -aside):
            pose = np.eye(4)
            pose[:3, :3] = np.column_stack([across, np.cross(u, across), u])
            pose[:3, 3] = 14 * u + side * across - (0, 0, depth)
            base = fo.joined(base, fo.Cylinder(R, 12).moved(pose))
        base = fo.joined(base, fo.Box((6, 6, 4.5), centre=tuple(20 * u + (0, 0, -5.4 - depth))))
    return base


def balls(plate: fo.Body) -> list[fo.Size]:
    return [fo.Size(f"b{k}", "movable", faces=f"sphere radius 3 no. {k}", tolerance=0.05) for k in (1, 2, 3)]


def radius_at(solution: fo.Solution, plate: fo.Body, angle: float) -> float:
    """The made radius of the ball drawn at an angle, measured on its corners."""
    corners = solution.problem.of_facets.movable.vertices - CIRCLE * outward(angle)
    far = np.linalg.norm(corners, axis=1)
    return float(far[far < 1.1 * R].max())


def centre_of_least_turn(radii: list[float], seed: np.ndarray) -> np.ndarray:
    """Where a plate on balls of these radii comes to rest in three grooves: by six equations in six unknowns."""

    def off(x: np.ndarray) -> list[float]:
        turn = Rotation.from_rotvec(x[3:]).as_matrix()
        found = []
        for angle, radius in zip(ANGLES, radii, strict=True):
            u = outward(angle)
            at = turn @ (CIRCLE * u - seed) + seed + x[:3]
            for side in (1, -1):
                n = (np.array([0, 0, 1]) + side * np.cross((0, 0, 1), u)) / sqrt(2)
                found.append(n @ at + n[2] * R * sqrt(2) - radius)
        return found

    return least_squares(off, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15).x


@pytest.mark.slow
@pytest.mark.parametrize(
    "made",
    [
        {"b1": 0.05, "b2": 0.05, "b3": 0.05},
        {"b1": 0.05},
        {"b2": -0.03, "b3": 0.02},
    ],
)
def test_a_kinematic_coupling_goes_where_six_equations_have_it(made: dict[str, float]) -> None:
    """Facets showed two of its six contacts, and what true parts need was not known."""
    plate = on_three_balls()
    problem = fo.Problem(plate, grooved(), goal="at", contacts="all", motion=FREE, sizes=balls(plate), made=made)
    found = fo.solve(problem)
    assert found.usable
    truth = centre_of_least_turn([radius_at(found, plate, angle) for angle in ANGLES], plate.seed)
    turn = Rotation.from_rotvec(truth[3:]).as_matrix()
    assert found.transform[:3, :3] == pytest.approx(turn, abs=1e-9)
    assert found.transform[:3, 3] == pytest.approx(plate.seed + truth[:3] - turn @ plate.seed, abs=1e-8)
    assert found.lower_bound == pytest.approx(found.amount, rel=1e-6)
    assert "smallest possible (proved)" in str(found)
    assert fo.verify(found, proof=True).passed
    read = fo.Solution.from_dict(json.loads(json.dumps(found.to_dict())))
    assert fo.verify(read, proof=True).passed
    rows, q = fo.contact_rows(problem), [*found.parameters.values()]
    assert len(rows.contacts) == 6
    assert [float(row(q=q)["gap"]) for row in rows.contacts] == pytest.approx([0.0] * 6, abs=1e-10)


@pytest.mark.slow
def test_the_amount_of_a_coupling_changes_with_its_sizes_as_differences_do() -> None:
    plate, base, made, step = on_three_balls(), grooved(), {"b1": 0.05, "b2": 0.01}, 1e-4

    def amount(more: float) -> float:
        sizes = {**made, "b1": made["b1"] + more}
        asked = {"goal": "at", "contacts": "all", "motion": FREE, "sizes": balls(plate), "made": sizes}
        return fo.solve(fo.Problem(plate, base, **asked), effort="quick").amount

    asked = fo.Problem(plate, base, goal="at", contacts="all", motion=FREE, sizes=balls(plate), made=made)
    rate = fo.solve(asked, effort="quick").sensitivity.sizes["b1"]
    assert rate == pytest.approx((amount(step) - amount(-step)) / (2 * step), rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("turned", [0.0, 0.3])
def test_a_stack_up_counts_each_ball_of_a_coupling(turned: float) -> None:
    """Corners of facets that are on their sphere were taken for such within it: one ball of three had no row."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([0, 0, turned]).as_matrix()
    plate, base = (body.moved(pose) for body in (on_three_balls(), grooved()))
    stack = fo.stack_up(fo.Problem(plate, base, sizes=balls(plate), goal="clear", motion=fo.Translation("z")))
    for name in ("b1", "b2", "b3"):
        assert stack.gap({name: 0.02}) == pytest.approx(-0.02, abs=1e-9)
    assert stack.gap({"b1": -0.02, "b2": -0.03, "b3": -0.01}) == pytest.approx(0.01, abs=1e-9)


@pytest.mark.slow
def test_what_if_asks_of_a_solution_what_it_asks_of_its_problem() -> None:
    plate = on_three_balls()
    asked = {"goal": "at", "contacts": "all", "motion": FREE, "sizes": balls(plate)}
    problem = fo.Problem(plate, grooved(), **asked, made={"b1": 0.01, "b2": 0.02})
    found = fo.whatif(fo.solve(problem), made={"b1": 0.02, "b2": 0.02, "b3": 0.02})
    assert found.after.amount == pytest.approx(0.02 * sqrt(2), rel=1e-8)
    assert found.changed == ("made",)


@pytest.mark.slow
def test_a_coupling_is_an_assembly_too() -> None:
    plate, base = on_three_balls(), grooved()
    sizes = [fo.Size("all", "plate", faces=[f"sphere radius 3 no. {k}" for k in (1, 2, 3)], each=1, tolerance=0.05)]
    contact = {"parts": ("plate", "base"), "contacts": "all"}
    scene = fo.Assembly(
        parts={"base": base, "plate": plate},
        motions={"plate": FREE},
        contacts=[contact],
        sizes=sizes,
        made={"all": 0.05},
    )
    found = fo.solve(scene)
    assert found.amount == pytest.approx(0.05 * sqrt(2), rel=1e-8)
    assert found.lower_bound == pytest.approx(found.amount, rel=1e-6)
    assert fo.verify(found, proof=True).passed


@pytest.mark.slow
def test_balls_on_rods_rise_as_circles_about_the_rods_do() -> None:
    plate, aside = on_three_balls(), 4.0
    made = {"b1": 0.05, "b2": 0.05, "b3": 0.05}
    asked = {"goal": "at", "contacts": "all", "motion": FREE, "sizes": balls(plate)}
    found = fo.solve(fo.Problem(plate, on_rods(aside), **asked, made=made))
    rise = sqrt((2 * R + 0.05) ** 2 - aside**2) - sqrt((2 * R) ** 2 - aside**2)
    assert found.usable
    assert found.amount == pytest.approx(rise, rel=1e-9)
    assert found.lower_bound == pytest.approx(rise, rel=1e-6)
    one = fo.solve(fo.Problem(plate, on_rods(aside), **asked, made={"b1": 0.05}))
    assert one.usable
    assert one.lower_bound == pytest.approx(one.amount, rel=2e-6)
    assert fo.verify(one, proof=True).passed


@pytest.mark.slow
def test_cup_groove_and_flat_hold_a_plate_as_lord_kelvin_had_it() -> None:
    """A larger ball in the groove, the others as they were: it turns about the line through their centres."""
    plate = on_three_balls()
    (x, y, _), depth = CIRCLE * outward(ANGLES[2]), R * sqrt(2)
    base = fo.cut(grooved(ANGLES[1:2]), fo.Box((10, 10, 3), centre=(0, CIRCLE, -1.5)))
    base = fo.cut(base, fo.Cone(0.5, depth + 0.5, depth, base=(x, y, 0.5 - depth)))
    asked = {"goal": "at", "contacts": "all", "motion": FREE, "sizes": balls(plate)}
    for name in ("b1", "b2", "b3"):
        found = fo.solve(fo.Problem(plate, base, **asked, made={name: 0.05}))
        assert found.usable
        assert found.lower_bound == pytest.approx(found.amount, rel=2e-6)
        grown = [angle for angle in ANGLES if radius_at(found, plate, angle) > R + 0.01]
        rise = {ANGLES[0]: 0.05, ANGLES[1]: 0.05 * sqrt(2), ANGLES[2]: 0.05 * sqrt(2)}
        for angle in ANGLES:  # heights of the centres: the flat's by the radius, groove's and cup's by root 2 of it
            centre = CIRCLE * outward(angle)
            height = (found.transform[:3, :3] @ centre + found.transform[:3, 3])[2]
            assert height == pytest.approx(rise[angle] if angle in grown else 0.0, abs=2e-6)
        assert len(grown) == 1


@pytest.mark.slow
def test_why_contacts_are_not_restored_by_a_motion_that_turns() -> None:
    """Limits, a lid in the way, and four feet of which one is longer: at once, where it took minutes."""
    plate, made = on_three_balls(), {"b1": 0.05, "b2": 0.05, "b3": 0.05}
    asked = {"goal": "at", "contacts": "all", "motion": FREE, "sizes": balls(plate), "made": made}
    low = fo.solve(fo.Problem(plate, grooved(), **asked, limits={"TZ": (-0.01, 0.01)}))
    assert not low.usable
    assert "RZ 0 deg) is beyond the limits of TZ" in str(low)
    lid = fo.KeepOut(fo.Box((10, 10, 2), centre=(0, 0, 8.03)), name="lid")
    under = fo.solve(fo.Problem(plate, grooved(), **asked, keep_out=[lid]))
    assert not under.usable
    assert "makes parts overlap elsewhere" in str(under)
    table, floor = fo.Box((50, 50, 3), centre=(0, 0, 5.5)), fo.Box((80, 80, 5), centre=(0, 0, -R - 2.5))
    for x, y in ((20, 20), (-20, 20), (20, -20), (-20, -20)):
        table = fo.joined(table, fo.Sphere(R, centre=(x, y, 0)), fo.Cylinder(1, 3, base=(x, y, 2)))
    asked |= {"sizes": [fo.Size("b", "movable", faces="sphere radius 3 no. 1", tolerance=0.05)], "made": {"b": 0.05}}
    rocks = fo.solve(fo.Problem(table, floor, **asked))
    assert not rocks.usable
    assert rocks.lower_bound > 1.0


def test_rollers_and_plane_faces_are_restored_by_motions_that_turn() -> None:
    radius, apex = 5.0, 5 * sqrt(2)
    groove, pose = fo.Prism([(0, -apex), (12, 12 - apex), (-12, 12 - apex)], 30), np.eye(4)
    pose[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    pose[:3, 3] = (-15, 0, 0)
    block = fo.cut(fo.Box((30, 30, 14), centre=(0, 0, -7)), groove.moved(pose))
    pose[:3, 3] = (-10, 0, 0)
    roller = fo.Cylinder(radius, 20).moved(pose)
    size = fo.Size("d", "movable", faces="cylinder radius 5", tolerance=0.05)
    found = fo.solve(fo.Problem(roller, block, goal="at", contacts="all", motion=FREE, sizes=[size], made={"d": 0.04}))
    assert found.amount == pytest.approx(0.04 * sqrt(2), rel=1e-9)
    assert found.lower_bound == pytest.approx(found.amount, rel=2e-6)
    base = fo.joined(fo.Box((40, 40, 5), centre=(0, 0, -2.5)), fo.Box((5, 40, 20), centre=(-17.5, 0, 10)))
    slide = fo.joined(fo.Box((14, 20, 10), centre=(0, 0, 5)), fo.Cylinder(radius, 10, base=(-10, 0, 0)))
    size = fo.Size("r", "movable", faces="cylinder radius 5", tolerance=0.1)
    about = fo.Translation("z") >> fo.Rotation("z", centre="origin")
    found = fo.solve(fo.Problem(slide, base, goal="at", contacts="all", motion=about, sizes=[size], made={"r": 0.1}))
    turned = acos((10 - 0.1) / 10)  # its axis, on a circle of 10 about the origin, comes to 9.9 from the wall's foot
    assert abs(degrees(turned) - abs(degrees(found.parameters["RZ"]))) < 1e-7
    assert found.parameters["TZ"] == pytest.approx(0.0, abs=1e-9)
    assert found.lower_bound == pytest.approx(found.amount, rel=2e-6)


def test_contacts_of_other_round_faces_are_counted_where_a_motion_turns() -> None:
    """Crossed rods, one on a side of its facets and one not: it is said what is not followed."""
    below = fo.Cylinder(R, 60, facets=24)
    pose, other = np.eye(4), np.eye(4)
    pose[:3, :3] = other[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    other[:3, :3] = other[:3, :3] @ Rotation.from_rotvec([0, 0, 0.05]).as_matrix()
    pose[:3, 3], other[:3, 3] = (-20, 2 * R, 20), (-20, 2 * R, 40)
    top = fo.joined(fo.Cylinder(R, 40, facets=24).moved(pose), fo.Cylinder(R, 40, facets=24).moved(other))
    top = fo.joined(top, fo.Box((4, 4, 30), centre=(15, 2 * R, 30)))
    asked = fo.Problem(top, below, motion=FREE, goal="at", contacts="all", target=(1, 1))
    assert "as drawn on round faces" in str(fo.solve(asked, effort="quick"))


PLANAR = fo.Translation("x") >> fo.Translation("y")


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("motion", "seed"),
    [
        (PLANAR >> fo.Rotation("z", "origin"), (0, 0, 0)),
        (PLANAR >> fo.Rotation("z"), (30, 20, 4)),
        (FREE, (30, 20, 4)),
    ],
)
def test_a_plate_on_three_pins_changes_with_each_pin_as_its_closed_form_does(motion: fo.Motion, seed: tuple) -> None:
    """About the origin one of two pins below was not seen; of free motions nothing told what a line of contact does."""
    plate = fo.Box((60, 40, 8), centre=(30, 20, 4), unit="mm")
    base = fo.Box((100, 80, 4), centre=(25, 15, -6), unit="mm")
    base = fo.joined(base, *[fo.Cylinder(5, 16, base=(x, y, -6)) for x, y in ((12, -5), (48, -5), (-5, 15))])
    sizes = [fo.Size(f"pin{k}", "static", faces=f"cylinder radius 5 no. {k}", tolerance=0.1) for k in (1, 2, 3)]
    made = {"pin1": 0.03, "pin2": -0.02, "pin3": 0.04}  # to the left, and both below
    asked = {"goal": "at", "contacts": "all", "motion": motion, "sizes": sizes, "made": made}
    found = fo.solve(fo.Problem(plate, base, **asked), effort="quick")
    length = found.problem.length

    def closed(left: complex, one: complex, two: complex) -> np.ndarray:
        a = np.arcsin((two - one) / 36)
        turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        within = np.array([5 + left - 5 * np.cos(a) + 15 * np.sin(a), 5 + one - 5 * np.cos(a) - 12 * np.sin(a)])
        shift = within if seed == (0, 0, 0) else turn @ within - np.array(seed[:2]) + turn @ seed[:2]
        return np.array([*shift, a, np.sqrt(shift @ shift + (length * a) ** 2)])

    truth = closed(*made.values())
    assert found.amount == pytest.approx(truth[3], rel=1e-8)
    given = found.sensitivity
    assert given.exists
    for k, name in enumerate(made):
        step = np.array([*made.values()]) + 1e-30j * np.eye(3)[k]
        rates = closed(*step).imag / 1e-30
        assert given.sizes[name] == pytest.approx(rates[3], abs=1e-5)
        assert given.motion_by_size[name][[0, 1, -1]] == pytest.approx(rates[:3], abs=1e-5)


def rocker(at: float, spin: float, facets: int = 24) -> fo.Body:
    """A segment of a cylinder of 25 along y, from 0 to 6: its foot is in the plane z = 0, its crown at z = 8."""
    turn, pose = np.eye(4), np.eye(4)
    turn[:2, :2] = [[cos(spin), -sin(spin)], [sin(spin), cos(spin)]]
    pose[:3, :3], pose[:3, 3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]], (at, 0, -17)
    name = "left" if at < 0 else "right"
    whole = fo.Cylinder(25, 6, facets=facets, unit="mm", name=name).moved(pose @ turn)
    return fo.cut(whole, fo.Box((60, 60, 60), centre=(at, 3, -30)), name=name)


PANE = fo.Box((600, 6, 100), centre=(0, 3, 58), unit="mm", name="pane")


@pytest.mark.parametrize("spin", [0.0, pi / 24, 0.05])
def test_a_segment_flush_with_a_plate_touched_it_sideways_in_the_middle_of_a_facet(spin: float) -> None:
    """The rim of its end, in the plane of the plate's side, was taken for a contact with that; turns were refused."""
    found = fo.Problem(
        PANE,
        rocker(-200, spin),
        motion=fo.Translation("z") >> fo.Rotation("y"),
        goal="at",
        contacts="all",
        sizes=[fo.Size("r", "static", faces="cylinder radius 25", tolerance=0.2)],
        made={"r": 0.1},
    )
    assert [own.normal.tolist() for own in found.round_contacts] == [pytest.approx([0, 0, -1])]
    solved = fo.solve(found)
    seed, theta = 58 - 8, solved.parameters["RY"]
    # the plate's bottom, `seed` below its middle, is as far from the axis at (-200, -17) as the radius made
    height = solved.parameters["TZ"] + 58 + 17
    assert 200 * sin(theta) + height * cos(theta) - seed == pytest.approx(25.1, abs=1e-9)
    assert solved.usable
    assert solved.lower_bound == pytest.approx(solved.amount, rel=2e-6)


def test_a_goal_that_does_not_follow_a_contact_between_facets_says_so() -> None:
    """It spoke of a scale pair that is nearest to a curve, and of poses sensed."""
    asked = {"target": (1, 1), "motion": fo.Translation("z") >> fo.Rotation("y"), "resolution": 0.01}
    with pytest.raises(fo.InputError, match="round faces touch, between their facets") as refused:
        fo.Problem(PANE, rocker(-200, pi / 24), goal="at", **asked)
    assert "snap" not in str(refused.value)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("spin", [pi / 24, 0.05])
@pytest.mark.parametrize("size", ["foot", "crown"])
def test_a_pane_on_two_unequal_rockers_lies_on_their_common_tangent(spin: float, size: str) -> None:
    """Contacts of plane faces that a motion turns made the whole group one of facets, which the judge refused."""
    frame = fo.joined(fo.Box((640, 30, 5), centre=(0, 5, -2.5)), fo.Box((640, 10, 80), centre=(0, -5, 40)))
    bodies = [replace(frame, name="frame"), rocker(-200, spin), rocker(200, spin), PANE]
    faces = {"foot": "-z", "crown": "cylinder radius 25"}[size]
    shift, up = fo.Translation("y") >> fo.Translation("z") >> fo.Rotation("y"), fo.Translation("z")
    found = fo.solve(
        fo.Assembly(
            bodies,
            [("left", "frame"), ("right", "frame"), ("pane", "left"), ("pane", "right"), ("pane", "frame")],
            [fo.Size(name, name, faces=[faces], tolerance=0.1) for name in ("left", "right")],
            {"left": up, "right": up, "pane": shift},
            follows={"pane": "frame"},
            made={"left": 0.1, "right": -0.05},
        )
    )
    # a foot lifts the circle, a crown widens it: the bottom, 50 below the seed, is 25 or that from both axes
    turned = np.arctan(0.15 / 400) if size == "foot" else np.arcsin(0.15 / 400)
    rise = 0.025 + 75 * (1 / cos(turned) - 1) if size == "foot" else (75 + 0.025) / cos(turned) - 75
    assert found.usable
    assert found.parameters["pane"]["RY"] == pytest.approx(turned, abs=1e-10)
    assert found.parameters["pane"]["TZ"] == pytest.approx(rise, abs=1e-9)
    assert found.parameters["pane"]["TY"] == pytest.approx(0.0, abs=1e-10)
    assert found.lower_bound == pytest.approx(found.amount, rel=1e-6)
    assert fo.verify(found, proof=True).passed


@pytest.mark.parametrize("asked", [{"goal": "fit", "contacts": "all"}, {"goal": "beyond"}])
def test_round_faces_that_touch_between_facets_were_said_to_be_apart(asked) -> None:
    """A roller on a block with half a facet down: its facets are .0086 off, R (1 - cos(pi / 24)), and it is not."""
    turn = np.eye(4)
    turn[:3, :3], turn[2, 3] = Rotation.from_euler("y", pi / 24).as_matrix(), 1.0
    roller = fo.Cylinder(1.0, 4.0, base=(0, -2, 0), axis="y", facets=24).moved(turn)
    block = fo.Box((10, 10, 2), centre=(0, 0, -1))
    how = {"motion": fo.Translation("z"), "tolerance": 0.01, "requirement": "A"}
    with pytest.raises(fo.errors.InputError, match="as drawn round faces touch, between their facets"):
        fo.Problem(roller, block, **asked, **how)
    found = fo.solve(fo.Problem(roller, block, goal="at", **how))
    assert found.amount == pytest.approx(0.02, rel=1e-9)  # the roller by .01, and the block's top by .01 of its 1


def test_a_stack_up_of_a_bead_in_front_of_a_pane_that_rests_flush_on_a_rocker() -> None:
    """The rocker's rim was a contact with the wall behind it: "cannot all be closed", and .05 for a gap of .5."""
    frame = fo.joined(fo.Box((640, 42, 5), centre=(0, 9, -2.5)), fo.Box((640, 12, 80), centre=(0, -6, 40)))
    frame = replace(fo.joined(frame, fo.Box((640, 13.5, 10), centre=(0, 23.25, 5))), name="frame")
    bead = fo.Box((600, 10, 14), centre=(0, 11, 7), unit="mm", name="bead")
    sizes = [
        fo.Size("pane", "pane", faces=["+y", "-y"], each=0.5, tolerance=0.2),
        fo.Size("depth", "bead", faces=["+y", "-y"], each=0.5, tolerance=0.15),
        fo.Size("lip", "frame", faces={"through": (0, 16.5, 5)}, tolerance=0.1),
    ]
    shift, up = fo.Translation("y") >> fo.Translation("z"), fo.Translation("z")
    pairs = [("left", "frame"), ("pane", "left"), ("pane", "frame"), ("bead", "frame"), ("bead", "pane")]
    bodies = [frame, rocker(-200, pi / 24), replace(PANE, name="pane"), bead]
    scene = fo.Assembly(bodies, pairs, sizes, {"left": up, "pane": shift, "bead": shift}, follows={"pane": "frame"})
    worst = fo.stack_up(scene, of=("bead", "frame")).worst()
    assert [worst.least, worst.largest] == pytest.approx([0.05, 0.95], abs=1e-9)
