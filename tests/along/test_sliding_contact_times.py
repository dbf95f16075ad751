"""Contact times of parts that lie on each other and slide: the play between walls, by hand."""

from typing import Any

import numpy as np
import pytest

import fcdm_opt as fo


@pytest.mark.parametrize("off", [0.0, 0.05, 0.15, 0.3, -0.15])
def test_a_block_that_lies_on_the_floor_of_its_slot(off: float) -> None:
    """Its floor closes at all positions: where the block comes free of one wall the other one was passed over."""
    slot = fo.cut(fo.Box((40, 40, 20)), fo.Box((20, 50, 30), centre=(0, 0, 10)))
    for lift in (0.0, 0.001):
        block = fo.Box((19.8, 30, 10), centre=(off, 0, lift))
        asked = fo.Problem(block, slot, target=(1, 1), motion=fo.Translation("x"), goal="touch")
        spans = [own for own in fo.contact_times(asked, {"TX": 1}).spans if own.state == "apart"]
        free = next(own for own in spans if own.high - own.low < 1.0)
        assert (free.low, free.high) == pytest.approx((-off - 0.1, -off + 0.1), abs=1e-9)


def test_parts_that_slide_on_each_other_were_told_to_be_apart() -> None:
    """A block on a floor slides from its wall at 0 to the floor's end at 40; another is a length above all that."""
    floor = fo.cut(fo.Box((60, 40, 20), centre=(10, 0, 0)), fo.Box((60, 60, 20), centre=(30, 0, 10)))
    for up, limit, words in (0.0, 30.0, "in contact"), (0.0, None, "apart or in contact"), (0.001, 30.0, "apart"):
        block = fo.Box((10, 10, 10), centre=(5, 0, 5 + up))
        asked = fo.Problem(block, floor, target=(1, 1), goal="clear", motion=fo.Translation("x"))
        found = fo.contact_times(asked, {"TX": 1}, limit=limit)
        assert str(found).splitlines()[0].endswith(f"from x = 0 {words}")
        assert {span.state for span in found.spans} == {"apart", "overlapping"}


def test_a_lid_that_lies_on_its_box_and_overlaps_at_its_lip() -> None:
    """Rounding of the faces that lie on each other hid where the lip comes free."""
    box = fo.cut(fo.Box((60, 40, 20)), fo.Box((50, 30, 20), centre=(0, 0, 4)))
    lid = fo.joined(fo.Box((60, 40, 3), centre=(0, 0, 11.5)), fo.Box((49.7, 29.6, 4), centre=(0.3, 0, 8.1)))
    asked = fo.Problem(lid, box, target=(1, 1), motion=fo.Translation("x"), goal="clear")
    spans = [own for own in fo.contact_times(asked, {"TX": 1}).spans if own.state == "apart"]
    free = next(own for own in spans if own.high - own.low < 1.0)
    assert (free.low, free.high) == pytest.approx((-0.45, -0.15), abs=1e-9)


@pytest.mark.parametrize("seed", [(0, 0, 0), "box"])
def test_seeds_in_the_plane_of_a_flange_hid_the_play_below_it(seed: Any) -> None:
    """Corners there were off by 4.7e-38, as of boolean operations, which was more than rounding of such numbers."""
    off = 4.7e-38

    def box(low: tuple[float, ...], high: tuple[float, ...]) -> list[list[float]]:
        return [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]

    plug = fo.Body.from_parts([box((-5, -5, -off), (5, 5, 6)), box((-1, -1, -5), (1, 1, off))], seed=seed)
    walls = [box((1.25, -9, -5), (9, 9, 0)), box((-9, -9, -5), (-1.25, 9, off / 2))]
    for sign in (1, -1):  # either way up
        one, two = plug.moved(_turned(sign)), fo.Body.from_parts(walls, seed=seed).moved(_turned(sign))
        found = fo.contact_times(fo.Problem(one, two, target=(1, 1), goal="clear", motion=fo.Translation("x")))
        assert found.free == pytest.approx((-0.25, 0.25), abs=1e-12)
        spans = [(own.state, own.low, own.high) for own in found.spans[1:-1]]
        states, lows, highs = zip(*spans, strict=True)
        assert states == ("overlapping", "apart", "overlapping")
        assert (*lows, *highs) == pytest.approx((-10, -0.25, 0.25, -0.25, 0.25, 10), abs=1e-12)


def _turned(sign: int) -> list[list[float]]:
    """Return half a turn about x for -1, none for 1."""
    return [[1, 0, 0, 0], [0, sign, 0, 0], [0, 0, sign, 0], [0, 0, 0, 1]]


def test_contacts_between_facets_are_of_bodies_that_are_exact_there() -> None:
    """A block on both sides of a rod: the labels of what it meets were looked up in bodies that are exact elsewhere."""
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(np.pi / 24), -np.sin(np.pi / 24)], [np.sin(np.pi / 24), np.cos(np.pi / 24)]]
    rod = fo.Cylinder(5.0, 20.0, facets=24, name="rod").moved(turn)
    asked = fo.Problem(fo.Box((4, 4, 4), centre=(20, 0, 5)), rod, motion=fo.Translation("x"), goal="touch",
                       target=(1.0, 1.0))  # fmt: skip
    found = fo.contact_times(asked, {"TX": 1.0})
    assert [touch.x for touch in found.touches] == pytest.approx([-27.0, -13.0])
    for touch, place in zip(found.touches, (-5.0, 5.0), strict=True):
        (label,) = touch.features[0].two.vertices
        assert (touch.problem or found.problem).static.vertices[label - 1, 0] == pytest.approx(place)
