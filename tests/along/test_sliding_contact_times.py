"""Contact times of parts that lie on each other and slide: the play between walls, by hand."""

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


def test_a_lid_that_lies_on_its_box_and_overlaps_at_its_lip() -> None:
    """Rounding of the faces that lie on each other hid where the lip comes free."""
    box = fo.cut(fo.Box((60, 40, 20)), fo.Box((50, 30, 20), centre=(0, 0, 4)))
    lid = fo.joined(fo.Box((60, 40, 3), centre=(0, 0, 11.5)), fo.Box((49.7, 29.6, 4), centre=(0.3, 0, 8.1)))
    asked = fo.Problem(lid, box, target=(1, 1), motion=fo.Translation("x"), goal="clear")
    spans = [own for own in fo.contact_times(asked, {"TX": 1}).spans if own.state == "apart"]
    free = next(own for own in spans if own.high - own.low < 1.0)
    assert (free.low, free.high) == pytest.approx((-0.45, -0.15), abs=1e-9)
