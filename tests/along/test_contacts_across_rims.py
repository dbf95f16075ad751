"""Straight edges that cross the circular rim of a bore, and round faces that pass each other, against closed forms."""

from math import cos, radians, sin, sqrt

import numpy as np
import pytest
from scipy.optimize import brentq

import fcdm_opt as fo
from fcdm_opt.geometry.patches import nearest_on_faces, true_faces

TILT = fo.Rotation("y", centre=(0, 0, 8))


def bore(facets=32, radius=5):
    through = fo.Cylinder(radius, 30, base=(0, 0, -5), facets=facets)
    return fo.cut(fo.Box((24, 24, 12), centre=(0, 0, 8)), through, name="hole")


def prism(x, y, pose=None):
    """A bar along z through the bore, from z = 0 to 20, with corner edges at (+-x, +-y)."""
    made = fo.Box((2 * x, 2 * y, 20), centre=(0, 0, 10), unit="mm", name="bar")
    return made if pose is None else made.moved(pose)


def margin(x, y, tilt, radius=5.0):
    """Play along x, in the plane z = 14 of the rim, of the edge at (x, y) of a bar tilted about (0, 0, 8)."""
    s = (6 + x * sin(tilt)) / cos(tilt)  # along the edge, from the height of the centre to the rim
    return sqrt(radius**2 - y**2) - (x * cos(tilt) + s * sin(tilt))


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("x", "y", "facets"), [(4.8, 1.0, 32), (4.8, 1.0, 20), (3.5, 3.5, 32)])
def test_a_bar_that_tilts_in_a_bore_touched_its_rim_by_facets(x, y, facets):
    asked = fo.Problem(prism(x, y), bore(facets), motion=TILT, goal="touch", target=(1, 1))
    times = fo.contact_times(asked, {"RY": 1.0}, limit=0.3)
    truth = brentq(lambda tilt: margin(x, y, tilt), 0.0, 0.3)
    assert times.free == pytest.approx((-truth, truth), rel=1e-8)
    assert [own.x for own in times.touches] == pytest.approx([-truth, truth], rel=1e-8)
    assert times.known_to == ()


@pytest.mark.sampled(2)
@pytest.mark.parametrize("tilt", [0.2, 0.6, 0.9, 0.938, 0.94, 1.0])
def test_the_gap_of_an_edge_across_a_rim_was_not_known(tilt):
    faces, pose = (
        [true_faces(prism(4.8, 1.0)), true_faces(bore())],
        TILT.transform(np.array([radians(tilt)]), *np.zeros((2, 3))),
    )
    found = nearest_on_faces(faces, (1.0, 1.0), pose, 0.3)[0]
    # the least distance of a line and a circle; of lines that overlap along their common normal
    edge, along = pose[:3, :3] @ (4.8, 1.0, 2.0) + pose[:3, 3], pose[:3, :3] @ (0.0, 0.0, 1.0)

    def off(angle):
        arm = np.array([5 * cos(angle), 5 * sin(angle), 14.0]) - edge
        return arm - arm @ along * along

    def slope(angle):
        return off(angle) @ (-sin(angle), cos(angle), 0.0)

    angle = brentq(slope, 0.1, 0.3, xtol=1e-15)
    sign = 1.0 if off(angle)[0] > 0.0 else -1.0
    assert found.gap == pytest.approx(sign * np.linalg.norm(off(angle)), abs=1e-10)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("goal", ["touch", "clear"])
@pytest.mark.parametrize("start", [0.03, 0.06])
def test_a_tilted_peg_was_not_brought_to_touch_the_rim_of_its_bore(goal, start):
    tilt = radians(0.3)
    pose = TILT.transform(np.array([tilt]), *np.zeros((2, 3)))
    pose[0, 3] += start
    asked = fo.Problem(
        prism(3.5, 3.5, pose), bore(), motion=fo.Translation("x"), goal=goal, target=(1, 1), limits={"TX": (-1, 1)}
    )
    found, truth = fo.solve(asked), margin(3.5, 3.5, tilt) - start
    assert found.usable
    assert found.parameters["TX"] == pytest.approx(0.0 if goal == "clear" and truth > 0.0 else truth, abs=1e-8)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("tilt", [0.6, 0.9, 0.92])
def test_the_least_shift_of_a_blade_to_the_rim_of_its_bore_was_said_to_be_of_the_mesh(tilt):
    """It was "between .0016 and .0041": pieces of the plane about the bore were never cut, but those of the blade."""
    pose, truth = TILT.transform(np.array([radians(tilt)]), *np.zeros((2, 3))), margin(4.8, 1.0, radians(tilt))
    asked = fo.Problem(prism(4.8, 1.0, pose), bore(), motion=fo.Translation("x"), goal="touch", target=(1, 1))
    found = fo.solve(asked)
    assert found.amount == pytest.approx(truth, rel=1e-6)
    assert found.left_by_mesh == ""
    assert (1.0 - 1e-4) * truth <= found.amount_low <= (1.0 + 1e-9) * truth


@pytest.mark.parametrize(("y", "facets"), [(4.97, 32), pytest.param(4.995, 24, marks=pytest.mark.slow)])
def test_pins_that_pass_each_other_by_less_than_a_facet_overlapped_too_late(y, facets):
    pin, boss = (fo.Cylinder(r, 5, base=at, facets=facets) for r, at in ((2, (-10, y, 0)), (3, (0, 0, 0))))
    times = fo.contact_times(fo.Problem(pin, boss, motion=fo.Translation("x"), goal="touch", target=(1, 1)))
    half = sqrt(25 - y**2)
    assert [own.x for own in times.touches] == pytest.approx([10 - half, 10 + half], abs=1e-8)
    assert [own.state for own in times.spans] == ["apart", "overlapping", "apart"]
    assert times.known_to == ()


def test_times_of_facets_tell_how_far_they_may_be_off():
    pin, boss, post = (
        fo.Cylinder(r, 5, base=(x, 1, 0), facets=24, name=n)
        for r, x, n in ((2, -10, "pin"), (3, 0, "boss"), (1, -20, "post"))
    )
    asked = fo.Problem(
        pin, boss, motion=fo.Translation("x"), goal="touch", target=(1, 1), keep_out=[fo.KeepOut(post, clearance=0.1)]
    )
    times = fo.contact_times(asked, limit=3.0)
    (line,) = times.known_to
    assert "the facets of pin and post" in line
    assert f"of facets: {line}" in str(times)
    assert times.to_dict()["known_to"] == [line]


@pytest.mark.parametrize("facets", [16, pytest.param(32, marks=pytest.mark.slow)])
def test_a_flush_pad_was_told_to_turn_until_its_coaxial_shank_met_the_bore(facets):
    """It lies on its base and turns in it until a corner meets a wall: 10 cos t + 4 sin t = 10.1."""
    slab = fo.Box((20, 8, 4), centre=(0, 0, 2))
    pad = fo.joined(slab, fo.Cylinder(2.995, 5, base=(0, 0, -4), facets=facets), name="pad")
    plate = fo.Box((40, 40, 6), centre=(0, 0, -3))
    hole = fo.Cylinder(3.005, 10, base=(0, 0, -8), facets=facets)
    base = fo.joined(fo.cut(plate, hole), fo.Box((5, 40, 10), centre=(12.6, 0, 0)), name="base")
    asked = fo.Problem(pad, base, motion=fo.Rotation("z", centre=(0, 0, 0)), goal="touch", target=(1, 1))
    found = fo.coherent_range(asked)
    truth = brentq(lambda t: 10 * cos(t) + 4 * sin(t) - 10.1, 0.0, 0.1)
    assert (found.low, found.high) == pytest.approx((-truth, truth), abs=1e-10)
    assert all("bore" not in event.what for event in found.events)
    assert fo.contact_times(asked).state(0.999 * truth) == "apart"
