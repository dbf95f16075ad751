"""The gap of two faces by name, while the contacts of their own parts stay closed: closed forms."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from scenes import box

import fcdm_opt as fo
from fcdm_opt.errors import InputError

NEAR = {"rel": 1e-9, "abs": 1e-9}
Z = fo.Translation("z")


def blocks(name: str, *ends: tuple[tuple[float, ...], tuple[float, ...]]) -> fo.Body:
    return fo.Body.from_parts([box(low, high, name).vertices for low, high in ends], name=name)


# a clip hangs with its hook on the rail's top, z = 10; its heel is at 4, the rail's foot at 3.7
RAIL = blocks("rail", ((0, 0, 0), (10, 20, 10)), ((10, 0, 0), (20, 20, 3.7)))
CLIP = blocks("clip", ((5, 5, 10), (15, 15, 12)), ((11, 5, 4), (15, 15, 10)))
HOOK, HEEL = {"through": (7, 10, 10)}, {"through": (13, 10, 4)}
TOP, FOOT = {"through": (3, 10, 10)}, {"through": (15, 10, 3.7)}


def sizes(clip: str, rail: str) -> list[fo.Size]:
    return [
        fo.Size("hook", clip, faces=HOOK, tolerance=(-0.02, 0.03)),
        fo.Size("heel", clip, faces=HEEL, tolerance=0.05),
        fo.Size("top", rail, faces=TOP, tolerance=(0.0, 0.04)),
        fo.Size("foot", rail, faces=FOOT, tolerance=0.1),
    ]


def of_two() -> fo.Problem:
    return fo.Problem(CLIP, RAIL, sizes=sizes("movable", "static"), motion=Z, unit="mm")


def of_parts() -> fo.Assembly:
    return fo.Assembly([RAIL, CLIP], [("clip", "rail")], sizes("clip", "rail"), {"clip": Z}, unit="mm")


LEAST, LARGEST = 0.3 - 0.02 - 0.05 - 0.1, 0.3 + 0.03 + 0.05 + 0.04 + 0.1
RATES = {"hook": 1.0, "heel": -1.0, "top": 1.0, "foot": -1.0}


def face(body: fo.Body, selector: dict) -> str:
    (row,) = fo.Size("s", "movable", faces=selector).offsets(body).nonzero()[0].tolist()
    return f"F{row + 1}"


@pytest.mark.sampled(2)
@pytest.mark.parametrize("scene", [of_two, of_parts])
@pytest.mark.parametrize("by_number", [False, True])
def test_a_clip_sits_by_its_hook_and_its_heel_is_clear(scene, by_number) -> None:
    of = (f"clip:{face(CLIP, HEEL)}", f"rail:{face(RAIL, FOOT)}") if by_number else (("clip", HEEL), ("rail", FOOT))
    stack = fo.stack_up(scene(), of=of)
    assert stack.rows[0].coefficients == pytest.approx(RATES, **NEAR)
    worst = stack.worst()
    assert (worst.least, worst.largest) == pytest.approx((LEAST, LARGEST), **NEAR)
    assert worst.at_least == pytest.approx({"hook": -0.02, "heel": 0.05, "top": 0.0, "foot": 0.1})
    assert stack.limits == (0.0, float("inf"))
    certificate = fo.verify(stack)
    assert certificate.passed
    assert any(check.name.startswith("closed: ") for check in certificate.checks)
    assert fo.verify(stack.yield_(2_000)).passed
    (pair,) = stack.touching.pairs
    wrong = pair._replace(values=pair.values * [1.0, 1.0, 0.5, 1.0, 1.0])
    forged = replace(stack, touching=replace(stack.touching, pairs=(wrong,)))
    assert {check.name for check in fo.verify(forged).failed} >= {"least gap", "gap at sampled sizes"}
    json.dumps(stack.to_dict(), default=str)


def test_the_same_of_two_parts_by_their_roles() -> None:
    heel, foot = face(CLIP, HEEL), face(RAIL, FOOT)
    for of in ((heel, foot), (f"static:{foot}", f"movable:{heel}"), (f"movable:{heel}", f"rail:{foot}")):
        assert fo.stack_up(of_two(), of=of).worst().least == pytest.approx(LEAST, **NEAR)


def test_a_bracket_on_one_face_is_clear_of_a_wall_beside_it() -> None:
    """Nothing moves it along x: .2 less what its side and the wall grow, whatever its foot does."""
    base = blocks("base", ((0, 0, -2), (10, 10, 0)), ((10.2, 0, -2), (12, 10, 8)))
    bracket = blocks("bracket", ((1, 1, 0), (10, 9, 2)), ((1, 1, 2), (3, 9, 8)))
    side, wall, foot = {"through": (10, 5, 1)}, {"through": (10.2, 5, 1)}, {"through": (5, 5, 0)}
    own = [fo.Size("side", "bracket", faces=side, tolerance=0.05), fo.Size("wall", "base", faces=wall, tolerance=0.02),
           fo.Size("foot", "bracket", faces=foot, tolerance=0.1)]  # fmt: skip
    scene = fo.Assembly([base, bracket], [("bracket", "base")], own, {"bracket": fo.Translation("x") >> Z})
    stack = fo.stack_up(scene, of=(("base", wall), ("bracket", side)))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.13, 0.27), **NEAR)
    assert fo.verify(stack).passed
    with pytest.raises(InputError, match="do not face each other"):
        fo.stack_up(scene, of=(("base", wall), ("bracket", foot)))
    with pytest.raises(InputError, match="not two faces of two parts"):
        fo.stack_up(scene, of=(("base", wall), ("base", wall)))
    with pytest.raises(InputError, match="no such face"):
        fo.stack_up(scene, of=("base:F99", "bracket:F1"))


def test_a_shouldered_peg_has_a_gap_at_its_nose() -> None:
    """Seated by its shoulder on a square hole's rim, 5 long in a hole 5.5 deep; scaled 1 % it is 5.05 long."""
    hole = blocks("hole", *(((x, y, 0.0), (x + 3, y + 3, 8.0)) for x in (-3, 0, 3) for y in (-3, 0, 3) if x or y),
                  ((0, 0, 0), (3, 3, 2.5)))  # fmt: skip
    peg = blocks("peg", ((0.2, 0.2, 3), (2.8, 2.8, 8)), ((-2, -2, 8), (5, 5, 10)))
    nose, floor = {"through": (1.5, 1.5, 3)}, {"through": (1.5, 1.5, 2.5)}
    own = [fo.Size("nose", "movable", faces=nose, tolerance=0.1),
           fo.Size("all", "movable", scale="xyz", tolerance=0.01),
           fo.Size("floor", "static", faces=floor, tolerance=(0.0, 0.2))]  # fmt: skip
    stack = fo.stack_up(fo.Problem(peg, hole, sizes=own, motion=Z), of=(("peg", nose), ("hole", floor)))
    assert stack.rows[0].coefficients == pytest.approx({"nose": -1.0, "all": -5.0, "floor": -1.0}, **NEAR)
    assert stack.worst().least == pytest.approx(0.5 - 0.1 - 0.05 - 0.2, **NEAR)
    assert fo.verify(stack).passed


def test_side_play_of_parts_with_no_contact_of_their_own() -> None:
    """A block on a floor between posts: its side and a post have no contact, nor do they have one declared."""
    floor, block = box((-5, -5, -1), (5, 5, 0), "floor"), box((-1, -1, 0), (1, 1, 2), "block")
    post = box((1.3, -1, 0), (2, 1, 3), "post")
    own = [fo.Size("width", "block", faces=["+x", "-x"], each=0.5, tolerance=0.1),
           fo.Size("post", "post", faces="-x", tolerance=0.05)]  # fmt: skip
    scene = fo.Assembly([floor, post, block], [("block", "floor")], own, {"block": fo.Translation("x") >> Z})
    stack = fo.stack_up(scene, of=("block:+x", "post:-x"))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.3 - 0.05 - 0.05, 0.3 + 0.1), **NEAR)
    assert fo.verify(stack).passed
    apart = fo.Problem(block, post, sizes=[replace(own[0], body="movable")], motion=Z, goal="clear")
    stack = fo.stack_up(apart, of=("+x", "-x"))  # of two bodies that touch nowhere, as drawn
    assert stack.worst().least == pytest.approx(0.25, **NEAR)
    assert fo.verify(stack).passed
