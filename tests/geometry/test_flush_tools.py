"""Tools that end as far as a face of what they cut, or hardly short of it or past it, leave no sheet there.

Faces as near to each other as solids that touch are one: volumes and the number of faces are those of the drawing.
"""

from __future__ import annotations

import numpy as np
import pytest

import fcdm_opt as fo

TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TURN *= np.sign(np.linalg.det(TURN))
HALF = 16 * 0.5**2 * np.sin(np.pi / 16)  # area of a circle's 32 facets


def shapes(turn, e):
    """Yield bodies of a plate, (-3, 0, 0) to (3, 4, 1), their volumes, and how many faces they have."""

    def block(low, high):
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        return fo.Body.convex(corners @ turn.T)

    plate, pose = block((-3, 0, 0), (3, 4, 1)), np.eye(4)
    pose[:3, :3] = turn
    yield "slot", fo.cut(plate, block((-2, -2, -1.3), (-1, 6, 1 + e))), 20.0, 12
    yield "slot as wide", fo.cut(plate, block((-2, -e, -1.3), (-1, 4 + e, 1 + e))), 20.0, 12
    yield "window", fo.cut(plate, block((-2, 1, -1), (-1, 2, 1 + e))), 23.0, 10
    yield "notch", fo.cut(plate, block((-5, 1, -1), (-1, 2, 1 + e))), 22.0, 10
    yield "corner", fo.cut(plate, block((-3 - e, -e, 0.5), (-1, 2, 1 + e))), 22.0, 9
    yield "two", fo.cut(plate, block((-2, 1, -1), (0, 2, 1 + e)), block((-e, 1 - e, -1), (1, 2 + e, 1 + e))), 21.0, 10
    yield "bore", fo.cut(plate, fo.Cylinder(0.5, 2 + e, base=(0, 2, -1)).moved(pose)), 24.0 - HALF, 38
    yield "under a face", fo.cut(plate, block((-2, 1, 1 + e), (-1, 2, 3))), 24.0, 6
    step = fo.joined(plate, block((-3 - e, -e, 1 - e), (-1, 4 + e, 2)))
    yield "step", step, 32.0, 8
    yield "boss", fo.joined(plate, block((-2, 1, 1 - e), (-1, 2, 2))), 25.0, 11
    yield "as high as the step", fo.cut(step, block((-2, -1, -1), (2, 5, 1 + e))), 16.0, 14


def volume(body):
    corners = body.face_triangles[0]
    return float((corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum()) / 6.0


@pytest.mark.sampled(3)
@pytest.mark.parametrize("e", [0.0, -1.2e-16, 2.3e-15, -2.3e-15, 1e-12, -1e-12, -1e-11, 1e-9, -1e-9])
@pytest.mark.parametrize("turn", [np.eye(3), TURN], ids=["square", "slanted"])
def test_a_tool_hardly_off_a_face_left_a_sheet_without_thickness(turn, e) -> None:
    for name, body, drawn, faces in shapes(turn, e):
        assert len(body.faces) == faces, name
        assert np.linalg.norm(body.face_planes[0], axis=1) == pytest.approx(1.0), name
        assert volume(body) == pytest.approx(drawn, rel=1e-7), name
        thickness = [np.linalg.svd(part.vertices - part.vertices.mean(axis=0))[1][2] for part in body.parts]
        assert min(thickness) > 1e-3, name


def test_a_point_inside_a_solid_was_on_a_sheet_of_no_thickness() -> None:
    """A slot ends 1.1e-16 below the top: the wall at x = -1, w within .05 and .1 off a peg; inside there is no face."""
    block = fo.cut(fo.Box((6, 4, 1), centre=(0, 2, 0.5)), fo.Box((1, 8, 2.3), centre=(-1.5, 2, -0.15)))
    peg = fo.Box((0.8, 4, 1), centre=(-1.5, 2, 0.5))

    def stack(place):
        size = fo.Size("w", "static", faces={"through": place}, tolerance=0.05)
        asked = {"goal": "touch", "motion": fo.Translation("x"), "made": {}}
        return fo.stack_up(fo.Problem(peg, block, sizes=[size], **asked))

    found = stack((-1, 2, 0.5))
    assert (found.worst().least, found.worst().largest) == pytest.approx((0.05, 0.1))
    assert fo.verify(found).passed
    with pytest.raises(fo.InputError):
        stack((2.345, 1.1, 0.177))


def test_a_tool_flush_with_a_face_of_a_file_in_single_precision(tmp_path) -> None:
    """A plate 12.7 high, written as 12.69999981: a tool that ends at 12.7 goes through, one 1e-3 short does not."""
    path = tmp_path / "plate.stl"
    drawn = fo.joined(fo.Box((60, 40, 12.7), centre=(0, 20, 6.35)), fo.Box((20, 40, 5), centre=(0, 20, -2.5)))
    rows = np.zeros(len(drawn.face_triangles[0]), [("n", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    rows["corners"] = drawn.face_triangles[0]
    path.write_bytes(bytes(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())
    plate = fo.Body.from_file(path, unit="mm")
    through, short = (fo.cut(plate, fo.Box((8, 8, 40), centre=(0, 20, z - 20))) for z in (12.7, 12.699))
    assert volume(through) == pytest.approx(60 * 40 * 12.7 + 20 * 40 * 5 - 64 * 17.7, rel=1e-6)
    assert (len(through.faces), len(short.faces)) == (len(plate.faces) + 4, len(plate.faces) + 5)
