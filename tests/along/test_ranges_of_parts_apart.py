"""Ranges of assemblies whose parts do not touch as drawn, and of round parts whose facets do not."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app

X = fo.Translation("x")


def jaws(left, right):
    """Return two jaws about a block from -1 to 1, each so far off it."""
    low, high = -1.0 - left, 1.0 + right
    parts = {
        "left": fo.Box((low + 4.0, 2.0, 2.0), centre=((low - 4.0) / 2.0, 0.0, 0.0), name="left"),
        "right": fo.Box((4.0 - high, 2.0, 2.0), centre=((high + 4.0) / 2.0, 0.0, 0.0), name="right"),
        "block": fo.Box((2.0, 4.0, 4.0), name="block"),
    }
    contacts = [{"parts": (jaw, "block"), "goal": "touch"} for jaw in ("left", "right")]
    return fo.Assembly(parts, contacts, motions={"left": X, "right": X}, name="jaws")


def test_the_contacts_of_an_assembly_that_are_open_as_drawn_were_an_error_of_all_of_them():
    found = fo.coherent_range(jaws(0.3, 0.0), {"left.TX": 1.0, "right.TX": -1.0})
    assert [*found.contacts] == ["right - block"]
    assert found.apart == ("left - block",)
    assert "left - block: at their nominal sizes the parts do not touch" in str(found)
    again = type(found).from_dict(json.loads(json.dumps(found.to_dict())), jaws(0.3, 0.0))
    assert again.apart == found.apart
    alone = fo.coherent_range(jaws(0.3, 0.0), {"right.TX": 1.0})
    assert alone.apart == ()
    with pytest.raises(fo.InputError, match=r"left - block.*do not touch"):
        fo.coherent_range(jaws(0.3, 0.2), {"left.TX": 1.0, "right.TX": 1.0})


@pytest.mark.parametrize("right", [0.0, 0.2])
def test_range_tells_along_which_motions_parts_of_an_assembly_touch(tmp_path, right):
    """The left jaw, drawn .3 off, touches at .3; and where it leaves on the far side of the block, 4.7 further on."""
    import trimesh

    assembly, text = jaws(0.3, right), 'title = "jaws"\n'
    for own in assembly.bodies:
        corners, _ = own.face_triangles
        mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=True)
        mesh.export(tmp_path / f"{own.name}.stl")
        text += f'[[part]]\nname = "{own.name}"\nfile = "{own.name}.stl"\nunit = "mm"\n'
        text += "" if own.name == "block" else 'motion = [{ translation = "x" }]\n'
    text += "".join(f'[[contact]]\nparts = ["{jaw}", "block"]\ngoal = "touch"\n' for jaw in ("left", "right"))
    file = tmp_path / "jaws.toml"
    file.write_text(text + '[[case]]\nname = "as drawn"\n')
    asked = ["range", str(file), "--case", "as drawn", "--direction", "left.TX=1,right.TX=-1"]
    result = CliRunner().invoke(app, asked, catch_exceptions=False)
    told = " ".join(result.stdout.split())
    assert result.exit_code == 0
    assert "left - block: as drawn the parts are 0.3 mm apart" in told
    assert "apart up to left.TX 0.3 mm, right.TX -0.3 mm, overlapping" in told
    assert "at left.TX 5 mm, right.TX -5 mm, its left face (facing -x) lies on the right face (facing +x)" in told
    assert ("right - block: as drawn the parts are 0.2 mm apart" in told) == (right > 0.0)
    assert CliRunner().invoke(app, [*asked, "--json"], catch_exceptions=False).exit_code == 0


def test_round_parts_that_touch_between_their_facets_were_said_to_be_apart():
    """A pin turned by half a facet touches the plane on its true face, as `solve` says."""
    pin, wall = fo.Cylinder(4.0, 20.0, facets=24, name="pin"), fo.Box((4.0, 20.0, 20.0), centre=(6.0, 0.0, 10.0))
    angle, turn = np.pi / 24, np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    asked = fo.Problem(pin.moved(turn), wall, motion=fo.Translation("y"), goal="touch", target=(1.0, 1.0))
    assert fo.solve(asked).amount == 0.0
    with pytest.raises(fo.InputError, match="the parts touch on their true faces"):
        fo.coherent_range(asked)


@pytest.mark.parametrize("round_one", [pytest.param(True, marks=pytest.mark.slow), False])
def test_where_facets_end_a_contact_was_told_as_where_round_faces_do(round_one: bool):
    """A peg with .03 of play on the floor of its pocket: facets meet elsewhere, of which nothing was said."""
    low, high = (5.0, 10.0, (0, 0, 0)), (5.03, 20.0, (0, 0, 0))
    peg, hole = (
        fo.Cylinder(radius, height, base=base, facets=20)
        if round_one
        else fo.Box((2 * radius, 2 * radius, height), centre=(0, 0, height / 2))
        for radius, height, base in (low, high)
    )
    pocket = fo.cut(fo.Box((30, 30, 20), centre=(0, 0, 0)), hole)
    along = fo.Translation((0.988, (1 - 0.988**2) ** 0.5, 0)) if round_one else X  # between two corners
    problem = fo.Problem(peg, pocket, motion=along, goal="touch", target=(1, 1))
    found, free = fo.coherent_range(problem), fo.contact_times(problem).free
    assert free == pytest.approx((-0.03, 0.03), rel=1e-6)
    assert found.high == pytest.approx(0.03, rel=1e-6)
    assert "followed as facets" not in str(found)


@pytest.mark.slow
def test_a_chosen_flush_contact_beside_a_bore_had_no_range() -> None:
    """Faces that come from points of round faces have no name, and were looked up by one."""
    ring = fo.cut(fo.Cylinder(17.0, 15.0, name="ring"), fo.Cylinder(12.5, 40.0, base=(0, 0, -10)))
    shaft = fo.Cylinder(12.5, 30.0, base=(0, 0, -10))
    seat = fo.joined(shaft, fo.Cylinder(16.0, 10.0, base=(0, 0, -10)), name="seat")
    asked = fo.Problem(ring, seat, motion=fo.Translation("z"), goal="seat", contacts=["F1F2(P1 bottom; P2 face 36)"],
                       nominal="drawn", requirement="A", tolerance=0.02)  # fmt: skip
    assert fo.coherent_range(asked, {"TZ": 1.0}).low == 0.0  # the bore as wide as the shaft touches it at once
