"""Round faces that overlap along a motion where facets, and parts within the true ones, do not: closed forms."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest

import fcdm_opt as fo


def short_of(radius, facets):
    """How far the middle of a facet is off its arc."""
    return radius * (1.0 - cos(pi / facets))


def at_middle_of_a_facet(radius, facets, share, short):
    """A point of the plane z = 0 that is a share of the error inside the circle, above the middle of a facet."""
    away = pi / facets  # corners of a cylinder's facets begin at angle 0
    return (radius - share * short) * np.array([cos(away), sin(away), 0.0]), np.array([cos(away), sin(away), 0.0])


def rod(place, away, z, wide=0.02, high=0.01):
    """A short flat bar whose lower face touches a circle about z from outside at a place."""
    along, up = np.array([-away[1], away[0], 0.0]), np.array([0.0, 0.0, 1.0])
    each = [(x, y, s) for x in (-wide, wide) for y in (0.0, 0.05) for s in (-high, high)]
    return fo.Body.convex([place + x * along + y * away + (z + s) * up for x, y, s in each], name="rod", unit="mm")


def asked(one, two, motion, **more):
    return fo.Problem(one, two, motion=motion, goal="touch", target=(1, 1), **more)


def ends(times):
    """The states in order, and where they change."""
    return [own.state for own in times.spans], [own.high for own in times.spans][:-1]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("facets", [16, 32, 64])
def test_a_rod_between_a_facet_and_its_arc_was_said_to_pass(facets, share):
    boss = fo.Cylinder(5, 5, base=(0, 0, 0), facets=facets, name="boss")
    place, away = at_middle_of_a_facet(5.0, facets, share, short_of(5.0, facets))
    times = fo.contact_times(asked(rod(place, away, -1.0), boss, fo.Translation("z")))
    states, at = ends(times)
    assert states == ["apart", "overlapping", "apart"]
    assert at == pytest.approx([0.99, 6.01], abs=1e-9)
    assert times.free[1] == pytest.approx(0.99, abs=1e-9)
    assert [own.x for own in times.touches] == pytest.approx([0.99, 6.01], abs=1e-9)
    assert all(own.features for own in times.touches)
    assert times.known_to == ()
    assert times.proved


@pytest.mark.sampled(2)
@pytest.mark.parametrize("share", [0.2, 0.9])
@pytest.mark.parametrize("facets", [12, 32])
def test_a_needle_that_turns_past_a_boss_between_facet_and_arc(facets, share):
    """Its tip goes round a circle of radius 10, which is deepest after .3 rad: 10 (1 - cos) below there."""
    deep = share * short_of(5.0, facets)
    boss = fo.Cylinder(5, 40, base=(0, 0, -20), facets=facets, name="boss")
    lowest, away = at_middle_of_a_facet(5.0, facets, share, short_of(5.0, facets))
    along, pivot = np.array([-away[1], away[0], 0.0]), lowest + 10.0 * away
    base = [lowest + 9.0 * away + x * along + z * np.array([0.0, 0.0, 1.0]) for x, z in ((1, -1), (-1, -1), (0, 1))]
    turn = fo.Rotation(along, centre=pivot)
    needle = fo.Body.convex([lowest, *base], name="needle", unit="mm")
    needle = needle.moved(turn.transform(np.array([-0.3]), *np.zeros((2, 3))))
    times = fo.contact_times(asked(needle, boss, turn), limit=0.6)
    half = np.arccos(1.0 - deep / 10.0)
    assert ends(times)[0] == ["apart", "overlapping", "apart"]
    assert ends(times)[1] == pytest.approx([0.3 - half, 0.3 + half], abs=1e-8)
    assert [own.x for own in times.touches] == ends(times)[1]


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("facets", "share"), [(16, 0.5), (32, 0.3), (32, 0.9)])
def test_a_ball_past_a_pin_between_their_facets(facets, share):
    ball = fo.Sphere(2, centre=(-12, 0, 2.5), facets=facets, name="ball")
    away = 7.0 - share * short_of(5.0, facets)
    boss = fo.Cylinder(5, 5, base=(0, away, 0), facets=facets, name="boss")
    times = fo.contact_times(asked(ball, boss, fo.Translation("x")))
    half = sqrt(49.0 - away**2)
    assert ends(times)[0] == ["apart", "overlapping", "apart"]
    assert ends(times)[1] == pytest.approx([12 - half, 12 + half], abs=1e-8)
    assert [own.x for own in times.touches] == ends(times)[1]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("share", [0.2, 0.8])
@pytest.mark.parametrize("facets", [16, 32, 64])
def test_a_peg_past_the_rim_of_a_bore_beyond_its_arc(facets, share):
    """An edge beyond the true bore, and within the bore of facets that are moved out to be within the plate."""
    through = fo.Cylinder(5, 30, base=(0, 0, -5), facets=facets)
    plate = fo.cut(fo.Box((24, 24, 12), centre=(0, 0, 8)), through, name="plate")
    reach = 5.0 + share * short_of(5.0, facets)
    each = [(reach, 0.0), (4.0, 0.5), (4.0, -0.5)]
    peg = fo.Body.convex([(x, y, z) for x, y in each for z in (16.0, 20.0)], name="peg", unit="mm")
    times = fo.contact_times(asked(peg, plate, fo.Translation("z"), limits={"TZ": (-3.0, 3.0)}))
    assert ends(times)[0] == ["overlapping", "apart"]
    assert ends(times)[1] == pytest.approx([-2.0], abs=1e-9)
    assert times.free == pytest.approx((-2.0, 3.0), abs=1e-9)


def test_a_rod_just_outside_the_arc_passes():
    for facets in (16, 64):
        boss = fo.Cylinder(5, 5, base=(0, 0, 0), facets=facets, name="boss")
        place, away = at_middle_of_a_facet(5.0, facets, -1e-3, short_of(5.0, facets))
        times = fo.contact_times(asked(rod(place, away, -1.0), boss, fo.Translation("z")))
        assert ends(times)[0] == ["apart"]


@pytest.mark.sampled(1)
@pytest.mark.parametrize("share", [0.2, 0.8])
def test_a_contact_lasted_beyond_a_boss_that_a_tab_meets_between_facet_and_arc(share):
    """A slider lies on a rail along z; its tab, at z = -2.01 to -1.99, meets the end of the boss, z = 0, after 1.99."""
    boss = fo.Cylinder(5, 5, base=(0, 0, 0), facets=24)
    place, away = at_middle_of_a_facet(5.0, 24, share, short_of(5.0, 24))
    along, up = np.array([-away[1], away[0], 0.0]), np.array([0.0, 0.0, 1.0])

    def bar(wide, low, high, bottom, top):
        each = [(x, y, z) for x in (-wide, wide) for y in (low, high) for z in (bottom, top)]
        return fo.Body.convex([place + x * along + y * away + z * up for x, y, z in each], unit="mm")

    base = fo.joined(boss, bar(1.0, 2.5, 4.0, -30.0, 30.0), bar(1.0, -20.0, -6.0, -30.0, 30.0), name="base")
    tab, slider = bar(0.02, 0.0, 2.0, -2.01, -1.99), bar(0.5, 1.0, 2.5, -3.0, -1.0)
    slider = fo.joined(tab, slider, name="slider")
    found = fo.coherent_range(asked(slider, base, fo.Translation("z")), limit=9.0)
    assert found.high == pytest.approx(1.99, abs=1e-9)
    assert (found.last.kind, found.last.what) == ("overlap", "true faces of slider and base come to overlap")
    assert found.low == -9.0


def test_plain_data_of_a_range_of_facets_were_without_how_far_they_are_off():
    pin, wall = fo.Cylinder(4.0, 20.0, facets=24, name="pin"), fo.Box((4.0, 20.0, 60.0), centre=(6.0, 0.0, 10.0))
    found = fo.coherent_range(asked(pin, wall, fo.Translation("z")))
    (line,) = found.known_to
    assert "the facets of pin" in line
    assert found.to_dict()["known_to"] == [line]
    assert f"round faces are followed as facets; {line}" in str(found)
    assert fo.CoherentRange.from_dict(found.to_dict(), found.problem).known_to == (line,)


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("radius", "bore", "off", "deep"),
    [(4.25, 5.776, 0.561, 0.00425), (4.97, 6.5, 0.85, 0.0009), (3.55, 4.31, -0.63, 0.0017)],
)
def test_a_peg_that_hardly_enters_its_bore_meets_the_rim_on_circles(radius, bore, off, deep):
    """What it lies over of the plate past the rim is a lens that facets know nothing of, where it is narrow."""
    plate = fo.cut(fo.Box((60, 60, 5), centre=(0, 0, -2.5)), fo.Cylinder(bore, 20, base=(0, 0, -10)))
    peg = fo.Cylinder(radius, 5, base=(0, off, -deep))
    times, far = (
        fo.contact_times(asked(peg, plate, fo.Translation("x")), limit=10.0),
        sqrt((bore - radius) ** 2 - off**2),
    )
    states, at = ends(times)
    assert states == ["overlapping", "apart", "overlapping"]
    assert at == pytest.approx([-far, far], abs=1e-9)
    assert ("not proved" in str(times)) == (not times.proved)
