"""What a motion meets farther off than the parts are long, in `contact_times` and in what is printed."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.show.tables import print_ranges

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


@pytest.mark.parametrize("stop", [30.0, 57.0, 700.0])
def test_what_is_printed_of_an_assembly_ended_at_the_size_of_its_last_contact(stop, capsys) -> None:
    """There was "cart - stop: apart all along"; the cart, 10 long, is off its rail, 40 long, from 25 on."""
    asked, along = station(stop), {"cart.TX": 1.0}
    print_ranges([(fo.coherent_range(asked, along), fo.contact_times(asked, along))])
    told = " ".join(capsys.readouterr().out.split())
    met = f"cart - stop: apart up to cart.TX {stop - 5:g}, overlapping up to cart.TX {stop + 9:g}, apart beyond"
    assert f"as made, {met}" in told
    assert "cart - pin: apart up to cart.TX -12, overlapping up to where they are drawn, apart beyond" in told
    assert told.count("searched from") == 1


def test_contacts_that_end_alike_are_told_at_once(capsys) -> None:
    """Three equal blocks, each 10 long in y, on a table 40 wide: all leave it at 25 along -y and +y."""
    table = fo.Box((100, 40, 10), centre=(0, 0, -5), name="table")
    blocks = [fo.Box((10, 10, 10), centre=(x, 0, 5), name=f"block {x + 40}") for x in (-30, 0, 30)]
    motions = {own.name: fo.Translation("y") for own in blocks}
    asked = fo.Assembly([table, *blocks], [(own.name, "table") for own in blocks], motions=motions, name="row")
    along = dict.fromkeys((f"{own.name}.TY" for own in blocks), 1.0)
    print_ranges([(fo.coherent_range(asked, along), fo.contact_times(asked, along))])
    told = capsys.readouterr().out
    assert [told.count(side) for side in ("- backwards: ", "- forwards: ")] == [2, 2]  # of all, and of each
    assert told.count("as made") == 1


def test_without_a_direction_a_range_followed_a_first_motion_not_the_one_that_solve_gives(tmp_path: Path) -> None:
    """A rod 3 % too long in the corner of two corridors 60 wide: it was turned by 24.9 deg, where 4.325 will do."""
    ends = [(1.310137, 107.376152), (6.966991, 113.033012), (113.033012, 6.966991), (107.376152, 1.310137)]
    walls = [((-10, 0), (-10, 200)), ((0, 200), (-10, 0)), ((60, 200), (60, 200))]
    corners = [list(own) for wall in walls for own in product(*wall, (0, 20))]
    path = tmp_path / "rod.toml"
    path.write_text(
        f"[bodies.movable]\nvertices = {[[*own, z] for own in ends for z in (0, 20)]}\n"
        f"[bodies.static]\nvertices = {corners}\nparts = {np.arange(1, 25).reshape(3, 8).tolist()}\n"
        '[[case]]\nname = "turn"\ntarget = [1.03, 1]\ngoal = "clear"\n'
        'motion = [{ translation = "x" }, { translation = "y" }, { rotation = "z", centre = "seed" }]\n'
    )
    result = CliRunner().invoke(app, ["range", str(path), "--json"], catch_exceptions=False)
    (case,) = json.loads(result.stdout)["files"][0]["cases"]
    (asked,) = fo.load_problems(path)
    assert case["contact_times"]["direction"] == pytest.approx(dict(fo.solve(asked).parameters), rel=1e-9)
    assert abs(np.degrees(case["contact_times"]["direction"]["RZ"])) == pytest.approx(4.325, abs=1e-3)
