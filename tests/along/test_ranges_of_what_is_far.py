"""What a motion meets farther off than the size of the parts, in `contact_times` and in what the command line prints."""

import pytest

import fcdm_opt as fo

X = fo.Translation("x")


@pytest.mark.parametrize("clearance", [0.0, 2.0])
@pytest.mark.parametrize("x", [20.0, 60.0, 900.0])
def test_a_keep_out_farther_off_than_the_parts_are_long_ended_no_range(x, clearance) -> None:
    """A cube of 10 and a post of 4 at x: nearer than asked from x - 7 - clearance to x + 7 + clearance.

    The cube and its floor were looked at up to 39.87, which was the end of the free range though the post is at 60.
    """
    cube, floor = fo.Box((10, 10, 10), name="cube"), fo.Box((40, 10, 10), centre=(0, -10, 0), name="floor")
    post = fo.KeepOut(fo.Box((4, 10, 10), centre=(x, 0, 0), name="post"), clearance=clearance)
    asked = fo.Problem(cube, floor, motion=X, target=(1, 1), goal="touch", keep_out=[post])
    times = fo.contact_times(asked, {"TX": 1.0})
    (near,) = (span for span in times.keep_outs["post"] if span.state == "overlapping")
    assert (near.low, near.high) == pytest.approx((x - 7.0 - clearance, x + 7.0 + clearance), abs=1e-9)
    assert times.free == (times.searched[0], near.low)
    assert times.state(near.high + 1e-6) == "apart"
    assert {(own[0].low, own[-1].high) for own in (times.spans, *times.keep_outs.values())} == {times.searched}
    assert fo.contact_times(asked, {"TX": 1.0}, limit=30.0).searched == (-30.0, 30.0)
    assert fo.contact_times(asked.changed(limits={"TX": (-5.0, 1000.0)}), {"TX": 1.0}).searched == (-5.0, 1000.0)


def station(stop: float) -> fo.Assembly:
    """Return a cart of 10 on a rail of 40, a pin of 2 on the cart's left, and a stop whose near face is at x = stop."""
    cart, rail = (
        fo.Box((10, 10, 10), centre=(0, 0, 5), name="cart"),
        fo.Box((40, 10, 10), centre=(0, 0, -5), name="rail"),
    )
    pin = fo.Box((2, 2, 2), centre=(-6, 0, 5), name="pin")
    post = fo.Box((4, 10, 30), centre=(stop + 2, 0, 0), name="stop")
    return fo.Assembly(
        [rail, post, pin, cart], [("cart", "rail"), ("cart", "pin")], motions={"cart": X}, name="station"
    )


@pytest.mark.parametrize("stop", [30.0, 57.0, 700.0])
def test_a_stop_of_an_assembly_farther_off_than_two_of_its_parts_was_not_met(stop) -> None:
    """The cart, whose right face is at 5, meets the stop at stop - 5 and is past it at stop + 4 + 5."""
    times = fo.contact_times(station(stop), {"cart.TX": 1.0})
    (met,) = (span for span in times.keep_outs["cart - stop"] if span.state == "overlapping")
    assert (met.low, met.high) == pytest.approx((stop - 5.0, stop + 9.0), abs=1e-9)
    assert times.free == pytest.approx((0.0, stop - 5.0), abs=1e-9)
