"""Meshes: what is accepted, repaired and refused, with volumes exact; crossings against rational arithmetic."""

from __future__ import annotations

import itertools
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from solids import FAMILIES, random_solid
from strategies import generators, random_rotation, runs

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.crossings import first_crossing
from fcdm_opt.geometry.mesh import Mesh, checked_mesh

CUBE = np.array(list(itertools.product([0.0, 1.0], repeat=3)))
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = [(a, b, c) for p, q, r, s in QUADS for a, b, c in ((p, q, r), (p, r, s))]
Drawn = tuple[Any, list[tuple[int, ...]]]


def box(low: Any, high: Any, faces: Any = QUADS) -> Drawn:
    low, high = np.array(low, float), np.array(high, float)
    return low + CUBE * (high - low), list(faces)


def together(*meshes: Drawn) -> Drawn:
    """Several meshes as one, without welding."""
    points, faces = np.empty((0, 3)), []
    for vertices, own in meshes:
        faces += [tuple(v + len(points) for v in face) for face in own]
        points = np.vstack([points, vertices])
    return points, faces


def inverted(mesh: Drawn) -> Drawn:
    return mesh[0], [tuple(face[::-1]) for face in mesh[1]]


def prism(outline: Any, height: float) -> Drawn:
    """Prism over a simple polygon given counter-clockwise; its two ends are polygons."""
    n = len(outline)
    points = np.array([(x, y, z) for z in (0.0, height) for x, y in outline])
    ring = [(k, (k + 1) % n, (k + 1) % n + n, k + n) for k in range(n)]
    return points, [tuple(range(n))[::-1], tuple(range(n, 2 * n)), *ring]


def check_consistent(mesh: Mesh) -> None:
    """Triangles and faces close, use the same edges outside the faces, and enclose the same volume."""
    for rows in (mesh.faces, mesh.triangles.tolist()):
        sides = sorted((a, b) for row in rows for a, b in zip(row, [*row[1:], row[0]], strict=True))
        assert sides == sorted((b, a) for a, b in sides)
    assert len(mesh.triangles) == len(mesh.triangle_faces) == sum(len(face) - 2 for face in mesh.faces)
    for k, face in enumerate(mesh.faces):
        assert set(mesh.triangles[mesh.triangle_faces == k].ravel()) == set(face)
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    areas = np.cross(b - a, c - a) / 2
    assert (np.linalg.norm(areas, axis=1) > 0).all()
    for face, own in zip(mesh.faces, [areas[mesh.triangle_faces == k] for k in range(len(mesh.faces))], strict=True):
        spokes = mesh.vertices[list(face[1:])] - mesh.vertices[face[0]]
        outline = np.cross(spokes[:-1], spokes[1:]).sum(axis=0) / 2
        # the triangles of a face do not fold over: their areas add up as numbers as well as vectors
        np.testing.assert_allclose(own.sum(axis=0), outline, atol=1e-13 * np.abs(outline).max())
        np.testing.assert_allclose(np.linalg.norm(own, axis=1).sum(), np.linalg.norm(outline), rtol=1e-9)
    assert mesh.volume > 0
    np.testing.assert_allclose(mesh.volume, float(mesh.exact_volume), rtol=1e-12)
    for array in (mesh.vertices, mesh.triangles, mesh.triangle_faces):
        assert not array.flags.writeable


# ------------------------------------------------------------------------------------------------------------ accepted


@pytest.mark.parametrize("faces", [QUADS, TRIANGLES])
@pytest.mark.parametrize("size", [1.0, 1e-8, 1e8, 1e-40, 1e40])
@pytest.mark.parametrize("away", [0.0, 1e6])
def test_a_box_of_any_size_anywhere(faces, size, away):
    points = (CUBE * [1, 2, 3] + away) * size
    mesh = checked_mesh(points, faces)
    check_consistent(mesh)
    np.testing.assert_array_equal(mesh.vertices, points)
    assert mesh.faces == tuple(map(tuple, faces))
    assert mesh.repairs == ()
    edges = [Fraction(x) - Fraction(y) for x, y in zip(points[7].tolist(), points[0].tolist(), strict=True)]
    exact = edges[0] * edges[1] * edges[2]
    if away == 0:
        assert Fraction(int(mesh.exact_volume.p), int(mesh.exact_volume.q)) == exact
    np.testing.assert_allclose(mesh.volume, float(exact), rtol=1e-12)
    np.testing.assert_allclose(mesh.centroid, points.mean(axis=0), rtol=1e-15 if away else 1e-14)
    inside = mesh.contains([points.mean(axis=0), points[0] - size, 0.999 * points[0] + 0.001 * points[7]])
    assert inside.tolist() == [True, False, True]


def test_points_given_again_count_once_and_unused_points_keep_their_number():
    points = [(9, 9, 9), *CUBE[:3], CUBE[0], (0.5, 0.5, 7), *CUBE[3:]]
    row = [1, 2, 3, 6, 7, 8, 9, 10]
    faces = [tuple(row[v] if v or k % 2 else 4 for v in face) for k, face in enumerate(QUADS)]
    mesh = checked_mesh(points, faces)
    check_consistent(mesh)
    np.testing.assert_array_equal(mesh.vertices, [(9, 9, 9), *CUBE[:3], (0.5, 0.5, 7), *CUBE[3:]])
    again = [1, 2, 3, 5, 6, 7, 8, 9]
    assert mesh.faces == tuple(tuple(again[v] for v in face) for face in QUADS)
    assert mesh.volume == 1


def test_a_soup_of_triangles_is_welded_in_order_of_appearance():
    points = CUBE[np.array(TRIANGLES)].reshape(-1, 3)
    mesh = checked_mesh(points, np.arange(36).reshape(-1, 3))
    check_consistent(mesh)
    np.testing.assert_array_equal(mesh.vertices, CUBE[[0, 1, 3, 2, 4, 6, 7, 5]])
    assert mesh.repairs == ()


def test_points_that_rounding_parted_are_made_one():
    points = CUBE[np.array(TRIANGLES)].reshape(-1, 3) + 0.1
    points += np.random.default_rng(0).uniform(-4e-16, 4e-16, points.shape)
    mesh = checked_mesh(points, np.arange(36).reshape(-1, 3))
    check_consistent(mesh)
    assert len(mesh.vertices) == 8
    assert len(mesh.repairs) == 1
    assert "made one" in mesh.repairs[0]
    np.testing.assert_allclose(mesh.volume, 1, rtol=1e-14)


def test_detail_above_rounding_is_not_welded_away():
    """A step of 1e-9 in the outline of a prism of size 1."""
    step = 1e-9
    mesh = checked_mesh(*prism([(0, 0), (1, 0), (1, 1), (0.5, 1), (0.5, 1 + step), (0, 1 + step)], 1.0))
    check_consistent(mesh)
    assert len(mesh.vertices) == 12
    np.testing.assert_allclose(mesh.volume - 1, step / 2, rtol=1e-5)


OUTLINES = {
    "L": ([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], 3),
    "U": ([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], 7),
    "corners in line on every side": ([(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)], 4),
    "triangle with corners in line on one side": ([(0, 0), (1, 0), (2, 0), (3, 0), (0, 2)], 3),
    "triangle with corners in line on two sides": ([(0, 0), (1, 0), (2, 0), (1, 1), (0, 2)], 2),
    "plus": ([(1, 0), (2, 0), (2, 1), (3, 1), (3, 2), (2, 2), (2, 3), (1, 3), (1, 2), (0, 2), (0, 1), (1, 1)], 5),
    "arrow head": ([(0, 0), (2, -1), (1, 0), (2, 1)], 1),
    "comb": ([(0, 0), (9, 0), *((x, 1 + 2 * (k % 2)) for k, x in enumerate(range(9, -1, -1)))], 18),
}


@pytest.mark.parametrize("name", OUTLINES)
@pytest.mark.parametrize("start", range(4))
def test_ends_of_prisms_are_cut_into_triangles_without_new_corners(name, start):
    outline, area = OUTLINES[name]
    mesh = checked_mesh(*prism(outline[start:] + outline[:start], 2.0))
    check_consistent(mesh)
    assert mesh.exact_volume == 2 * area
    assert mesh.repairs == ()
    turned = mesh.vertices @ random_rotation(np.random.default_rng(start)).T + [3, 1, 7]
    again = checked_mesh(turned, mesh.faces)
    check_consistent(again)
    np.testing.assert_allclose(again.volume, 2 * area, rtol=1e-13)


@runs(20)
@given(generators)
def test_random_star_shaped_outlines(rng):
    count = int(rng.integers(5, 40))
    angles = np.sort(rng.uniform(0, 2 * np.pi, count))
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    outline = rng.uniform(0.1, 1.0, count)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    x, y = outline.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    points, faces = prism(outline, 0.5)
    mesh = checked_mesh(points @ random_rotation(rng).T, faces)
    check_consistent(mesh)
    np.testing.assert_allclose(mesh.volume, area / 2, rtol=1e-11)


@pytest.mark.sampled(6)
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("turned", [False, True])
def test_random_solids_are_accepted_as_they_are(family, turned):
    """Their volume is manifold3d's, and points are inside where they are in one of the convex parts."""
    for seed in range(2):
        rng = np.random.default_rng([seed, turned])
        solid = random_solid(rng, family, turned)
        mesh = checked_mesh(solid.vertices, solid.triangles)
        check_consistent(mesh)
        assert mesh.repairs == ()
        np.testing.assert_allclose(mesh.volume, solid.volume, rtol=1e-10)
        low, high = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
        asked = rng.uniform(low - 0.1, high + 0.1, (200, 3))
        inside, clear = in_parts(asked, solid.parts, 1e-6 * solid.size)
        assert clear.mean() > 0.9
        assert 0 < inside.mean() < 1
        np.testing.assert_array_equal(mesh.contains(asked)[clear], inside[clear])


def in_parts(points: np.ndarray, parts: Any, slack: float) -> tuple[np.ndarray, np.ndarray]:
    """Which points are in one of the convex parts, and which are off the planes of all faces."""
    from scipy.spatial import ConvexHull

    inside, clear = np.zeros(len(points), bool), np.ones(len(points), bool)
    for part in parts:
        rows = ConvexHull(part).equations
        heights = points @ rows[:, :3].T + rows[:, 3]
        inside |= (heights < 0).all(axis=1)
        clear &= (np.abs(heights) > slack).all(axis=1)
    return inside, clear


@runs(50)
@given(generators)
def test_order_does_not_matter(rng):
    solid = random_solid(rng, "extrusion", bool(rng.integers(2)))
    order, rows = rng.permutation(len(solid.vertices)), rng.permutation(len(solid.triangles))
    faces = [np.roll(np.argsort(order)[solid.triangles[k]], rng.integers(3)) for k in rows]
    mesh, other = checked_mesh(solid.vertices, solid.triangles), checked_mesh(solid.vertices[order], faces)
    assert other.exact_volume == mesh.exact_volume
    assert other.repairs == mesh.repairs == ()


# ------------------------------------------------------------------------------------------- repaired, or fine as it is

RING = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
WITH_MIDDLE = (*CUBE, (0.5, 0.0, 0.0))  # a point on the edge from vertex 1 to vertex 5

FINE = {
    "two cubes sharing an edge": (together(box(0, 1), box((1, 1, 0), (2, 2, 1))), 2, ""),
    "two cubes sharing a vertex": (together(box(0, 1), box(1, 2)), 2, ""),
    "a vertex touching a face": (
        together(
            box(0, 2), ([(2, 1, 1), (3, 0, 1), (3, 2, 0), (3, 2, 2)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
        ),
        Fraction(26, 3),
        "",
    ),
    "two cubes apart": (together(box(0, 1), box(3, 4)), 2, ""),
    "a cavity": (together(box(0, 3), inverted(box(1, 2))), 26, ""),
    "a solid in a cavity": (together(box(0, 5), inverted(box(1, 4)), box(2, 3)), 125 - 27 + 1, ""),
    "two cavities that share an edge": (
        together(box(0, 4), inverted(box(1, 2)), inverted(box((2, 2, 1), (3, 3, 2)))),
        62,
        "",
    ),
    "inverted": (inverted(box(0, 1)), 1, "turned, being wound inwards: 6 faces, the first 1, 2 and 3"),
    "inverted with its cavity": (inverted(together(box(0, 3), inverted(box(1, 2)))), 26, "12 faces"),
    "one of two solids inverted": (together(box(0, 1), inverted(box(3, 4))), 2, "6 faces, the first 7, 8 and 9"),
    "one face wound the other way": ((CUBE, [*QUADS[:5], QUADS[5][::-1]]), 1, "around them: face 6"),
    "all but one face inverted": ((CUBE, [QUADS[0], *(q[::-1] for q in QUADS[1:])]), 1, "wound inwards: "),
    "a face twice": ((CUBE, [*QUADS, QUADS[2][2:] + QUADS[2][:2]]), 1, "repeating others: face 7"),
    "a face twice, once the other way": ((CUBE, [*QUADS, QUADS[2][::-1]]), 1, "repeating others: face 7"),
    "all faces twice": ((CUBE, [*QUADS, *QUADS]), 1, "repeating others: 6 faces, the first 7, 8 and 9"),
    "a fin": (
        ([*CUBE, (0.5, 0.5, 2)], [*QUADS, (1, 7, 8), (8, 7, 1)]),
        1,
        "nothing between: faces 7 and 8",
    ),
    "glued face on face": (together(box(0, 1), box((1, 0, 0), (2, 1, 1))), 2, "nothing between: faces 2 and 7"),
    "a frame of eight cubes": (
        together(*(box((x, y, 0), (x + 1, y + 1, 1)) for x, y in RING)),
        8,
        "nothing between: 16 faces",
    ),
    "a triangle of no area": (
        (WITH_MIDDLE, [*QUADS[:2], (0, 4, 5), (0, 5, 1), *QUADS[3:4], (0, 2, 6, 4, 8), QUADS[5], (0, 8, 4)]),
        1,
        "no area: face 8",
    ),
    "a repeated row": ((CUBE, [*QUADS[:5], (1, 5, 5, 7, 3), (2, 2, 3)]), 1, "no area: face 7"),
    "a vertex on a neighbour's edge": (
        (WITH_MIDDLE, [*QUADS[:4], (0, 2, 6, 4, 8), QUADS[5]]),
        1,
        "lie on their edges as corners: face 3",
    ),
}


@pytest.mark.parametrize("name", FINE)
@pytest.mark.parametrize("size", [1.0, 2.0**-27, 2.0**27])
def test_what_is_certain_is_repaired_and_reported(name, size):
    (points, faces), volume, remark = FINE[name]
    mesh = checked_mesh(np.array(points) * size, faces)
    check_consistent(mesh)
    assert Fraction(int(mesh.exact_volume.p), int(mesh.exact_volume.q)) == volume * Fraction(size) ** 3
    if remark:
        assert any(remark in text for text in mesh.repairs), mesh.repairs
    else:
        assert mesh.repairs == ()
    turned = (np.array(points) @ random_rotation(np.random.default_rng(3)).T + [5, -7, 11]) * size
    again = checked_mesh(turned, faces)
    np.testing.assert_allclose(again.volume, float(volume) * size**3, rtol=1e-12)


@runs(50)
@given(generators)
def test_triangles_wound_the_other_way_are_turned_back(rng):
    solid = random_solid(rng, "extrusion", False)
    wrong = np.sort(rng.permutation(len(solid.triangles))[: int(rng.integers(1, 4))])
    faces = solid.triangles.copy()
    faces[wrong] = faces[wrong, ::-1]
    mesh = checked_mesh(solid.vertices, faces)
    check_consistent(mesh)
    assert mesh.exact_volume == checked_mesh(solid.vertices, solid.triangles).exact_volume
    names = ", ".join(str(k + 1) for k in wrong).rsplit(", ", 1)
    assert mesh.repairs[0].endswith(("faces " if len(wrong) > 1 else "face ") + " and ".join(names))


# ------------------------------------------------------------------------------------------------------------- refused


def klein_bottle() -> Drawn:
    """A 6 x 6 grid glued to a surface with one side; where it lies in space does not matter."""
    n = 6

    def row(i: int, j: int) -> int:
        return (i % n) * n + (j % n if i < n else -j % n)

    points = np.random.default_rng(1).uniform(size=(n * n, 3))
    cells = itertools.product(range(n), repeat=2)
    quads = [(row(i, j), row(i + 1, j), row(i + 1, j + 1), row(i, j + 1)) for i, j in cells]
    return points, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]


def pierced() -> Drawn:
    """A box and a tetrahedron whose corner comes through a face of it."""
    return together(
        box(0, 2), ([(1.5, 1, 1), (3, 0, 1), (3, 2, 0), (3, 2, 2)], [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    )


BAD = {
    "an open box": ((CUBE, QUADS[:5]), r"not closed: 4 edges .*vertex \d \(.*\) to vertex \d \(.*\) of face \d"),
    "a missing triangle": ((CUBE, TRIANGLES[1:]), "not closed: 3 edges with a face on one side only"),
    "a wall inside": (together(box((0, 0, 0), (1, 1, 1)), (CUBE + np.array([1, 0, 0]), QUADS[1:])), "three or more"),
    "a flap": (([*CUBE, (2, 2, 2)], [*QUADS, (1, 7, 8)]), "not closed: 3 edges .*vertex 9"),
    "a cube in a cube": (together(box(0, 3), box(1, 2)), "inside another.*7, 8 and 9, inside 6 faces, the first 1, 2"),
    "a cavity around a solid": (together(inverted(box(0, 3)), inverted(box(1, 2))), "wound the same way"),
    "folded flat": (
        ([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0.5, 0.5, 1)], [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]),
        "overlap|no volume",
    ),
    "a flat solid": ((CUBE * [1, 1, 0], QUADS), "not closed|no surface is left|corners|overlap|no volume"),
    "one side only": (klein_bottle(), "one side only"),
    "a quadrangle out of plane": (([*CUBE[:7], (1, 1, 1.25)], QUADS), r"face 6: .*no plane: vertex \d .*allowed"),
    "an outline that crosses itself": ((CUBE, [(0, 1, 2, 3), *QUADS[1:]]), "face 1: the outline crosses|not closed"),
    "an outline that returns": ((CUBE, [*QUADS, (0, 1, 3, 1)]), "face 7: the outline comes back to vertex 2"),
    "nan": (([*CUBE[:7], (1, 1, np.nan)], QUADS), "vertex 8 is not finite"),
    "infinite": (([*CUBE[:7], (1, 1, np.inf)], QUADS), "vertex 8 is not finite"),
    "too large": ((CUBE * 1e60, QUADS), "too large"),
    "three points": ((CUBE[:3], [(0, 1, 2)]), "at least 4"),
    "two columns": ((CUBE[:, :2], QUADS), "shape"),
    "no points": ((np.empty((0, 3)), []), "at least 4"),
    "no faces": ((CUBE, []), "needs faces"),
    "no such row": ((CUBE, [*QUADS, (0, 1, 8)]), "face 7: .*not a row .*found 8; allowed: 0 to 7"),
    "a negative row": ((CUBE, [*QUADS, (0, 1, -1)]), "face 7: .*not a row .*found -1"),
    "two corners": ((CUBE, [*QUADS, (0, 1)]), "face 7: .*at least 3 corners"),
    "rows that are no integers": ((CUBE, [*QUADS, (0, 1, 2.0)]), "face 7: .*not a row .*found 2.0"),
    "an array of floats": ((CUBE, np.array(TRIANGLES, float)), "face 1: .*not a row"),
    "truths": ((CUBE, [*QUADS, (0, 1, True)]), "face 7: .*not a row"),
    "text": ((CUBE, "faces"), "not a row"),
    "a number": ((CUBE, 5), "faces are lists"),
    "numbers": ((CUBE, [1, 2, 3]), "faces are lists"),
    "all points the same": ((np.ones((8, 3)), QUADS), "coincide"),
    "points on a line": ((CUBE * [1, 0, 0], QUADS), "no surface is left|comes back"),
    "nothing but fins": ((CUBE, [QUADS[0], QUADS[0][::-1]]), "no surface is left|not closed"),
}


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("turned", [False, True])
def test_what_is_not_certain_is_refused_with_the_place(name, turned):
    (points, faces), message = BAD[name]
    if turned and np.ndim(points) == 2 and np.shape(points)[1] == 3:
        with np.errstate(invalid="ignore"):
            points = np.array(points) @ random_rotation(np.random.default_rng(5)).T
        message = message.replace(r"at \(2, ", r"at \(")
    with pytest.raises(InputError, match=message) as caught:
        checked_mesh(points, faces, name="lid")
    assert "lid" in str(caught.value)


@runs(50)
@given(generators)
def test_a_missing_triangle_is_found_where_it_is(rng):
    solid = random_solid(rng, "extrusion", bool(rng.integers(2)))
    gone = int(rng.integers(len(solid.triangles)))
    with pytest.raises(InputError, match="not closed: 3 edges") as caught:
        checked_mesh(solid.vertices, np.delete(solid.triangles, gone, axis=0))
    for v in solid.triangles[gone]:
        assert f"vertex {v + 1} (" in str(caught.value)


TOGETHER = {
    "crossing cubes": (together(box(0, 2), box(1, 3)), 15.0, "2 closed surfaces made one solid, 0.0625 of"),
    "a corner through a face": (pierced(), 9 - 1 / 27, "2 closed surfaces made one solid"),
    "cubes glued by half a face": (together(box(0, 1), box((1, 0.5, 0), (2, 1.5, 1))), 2.0, "made one solid, 0 of"),
    "cubes that touch along part of an edge": (together(box(0, 1), box((1, 1, 0.25), (2, 2, 0.75))), 1.5, ""),
    "an edge on a face": (
        together(
            box(0, 2), ([(2, 1, 0.5), (2, 1, 1.5), (3, 0, 1), (3, 2, 1)], [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])
        ),
        8 + 1 / 3,
        "",
    ),
    "three in a row": (together(box(0, 2), box((1, 0, 0), (4, 1, 1)), box((3, 0, 0), (5, 3, 1))), 15.0, "3 closed"),
    "all wound inwards": (together(inverted(box(0, 2)), inverted(box(1, 3))), 15.0, "2 closed"),
}


@pytest.mark.parametrize("name", TOGETHER)
@pytest.mark.parametrize("size", [1.0, 1e-6, 3e7])
def test_closed_surfaces_that_overlap_or_touch_are_one_solid(name, size):
    (points, faces), volume, remark = TOGETHER[name]
    made = checked_mesh(np.array(points) * size, faces)
    assert made.volume == pytest.approx(volume * size**3, rel=1e-9)
    assert made.moved <= 1e-9 * size
    said = [own for own in made.repairs if "made one solid" in own]
    assert all(remark in own for own in said)
    assert len(said) == bool(remark)


def test_a_surface_that_crosses_itself_is_refused_with_the_place():
    points = CUBE.copy()
    points[np.argmax(points.sum(axis=1))] = (-1, 0.3, 0.4)  # a corner drawn out through the face at x = 0
    with pytest.raises(InputError, match=r"faces \d+ and \d+ cross.*at \("):
        checked_mesh(points, TRIANGLES)


def test_a_seam_of_a_millionth_is_closed_and_told():
    rng = np.random.default_rng(5)
    corners = CUBE[np.array(TRIANGLES)].reshape(-1, 3)
    drawn = corners + rng.uniform(-4e-7, 4e-7, corners.shape)
    made = checked_mesh(drawn, np.arange(len(drawn)).reshape(-1, 3))
    assert len(np.unique(made.triangles)) == 8
    assert made.volume == pytest.approx(1.0, abs=1e-5)
    assert 0 < made.moved < 2e-6
    assert any(own.startswith("made one with others nearer than 2e-06") for own in made.repairs)
    with pytest.raises(InputError, match="not closed"):
        checked_mesh(corners + rng.uniform(-1e-4, 1e-4, corners.shape), np.arange(len(drawn)).reshape(-1, 3))


@runs(25)
@given(generators)
def test_two_solids_are_one_surface_whether_they_overlap_or_not(rng):
    from manifold3d import Manifold, Mesh64

    one, two = (random_solid(rng, "extrusion", True) for _ in range(2))
    shift = rng.uniform(-0.6, 0.6, 3) * (one.size + two.size)
    moved = two.vertices + shift
    solids = [
        Manifold(Mesh64(np.array(points), np.array(own.triangles, np.uint64)))
        for points, own in ((one.vertices, one), (moved, two))
    ]
    common = (solids[0] ^ solids[1]).volume()
    mesh = together((one.vertices, one.triangles.tolist()), (moved, two.triangles.tolist()))
    if common > 1e-9 and min(one.volume, two.volume) - common < 1e-9:
        with pytest.raises(InputError, match="inside another"):
            checked_mesh(*mesh)
    elif common > 1e-9 or common == 0:
        made = checked_mesh(*mesh)
        np.testing.assert_allclose(made.volume, one.volume + two.volume - common, rtol=1e-9)
        places = rng.uniform(made.vertices.min(axis=0), made.vertices.max(axis=0), (50, 3))
        parts = (checked_mesh(own, other.triangles) for own, other in ((one.vertices, one), (moved, two)))
        inside = np.array([own.contains(places) for own in parts]).any(axis=0)
        assert (made.contains(places) == inside).all()


# --------------------------------------------------------------------------------------- crossings, in rational numbers


def minus(u: Any, v: Any) -> Any:
    return tuple(a - b for a, b in zip(u, v, strict=True))


def dot(u: Any, v: Any) -> Any:
    return sum(a * b for a, b in zip(u, v, strict=True))


def cross(u: Any, v: Any) -> Any:
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def stretch(p: Any, q: Any, triangle: Any) -> list[Any]:
    """Ends of what a segment and a triangle have in common, by its parameter."""
    a, b, c = triangle
    normal, along = cross(minus(b, a), minus(c, a)), minus(q, p)
    first, last = Fraction(0), Fraction(1)
    sides = [(cross(normal, minus(y, x)), x) for x, y in ((a, b), (b, c), (c, a))]
    for inward, origin in ((normal, a), (tuple(-x for x in normal), a), *sides):
        level, rise = dot(inward, minus(p, origin)), dot(inward, along)
        if rise > 0:
            first = max(first, -level / rise)
        elif rise < 0:
            last = min(last, -level / rise)
        elif level < 0:
            return []
    return [tuple(x + t * y for x, y in zip(p, along, strict=True)) for t in (first, last)] if first <= last else []


def meet_beyond(one: Any, two: Any) -> bool:
    """Whether triangles have more in common than a point, or than the corner or side that they share."""
    found = {x for t, u in ((one, two), (two, one)) for i in range(3) for x in stretch(t[i - 1], t[i], u)}
    shared = [x for x in one if x in two]
    others = found - set(shared)
    if len(shared) < 2:
        return len(others) > 1 - len(shared)
    return any(any(cross(minus(x, shared[0]), minus(shared[1], shared[0]))) for x in others)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("shared", [0, 1, 2])
@pytest.mark.parametrize(("reach", "unit", "away"), [(1, 1, 0), (2, 1, 0), (3, 1, 0), (9, 1, 0), (2, 0.1, 1e6)])
def test_crossings_are_those_of_rational_arithmetic(shared, reach, unit, away):
    """Triangles on a grid: most of them in special position; a grid of tenths far away rounds to none."""
    rng = np.random.default_rng([shared, reach])
    answers = []
    while len(answers) < (120 if reach == 9 else 60) or not any(answers):  # few meet on a wide grid
        points = rng.integers(0, reach, (6, 3), endpoint=True) * float(unit) + away
        rows = np.array([[0, 1, 2], [*range(shared), *range(3, 6 - shared)]])
        corners = [[tuple(map(Fraction, points[v].tolist())) for v in row] for row in rows]
        if len({tuple(points[v]) for v in np.unique(rows)}) < 6 - shared:
            continue
        if not all(any(cross(minus(b, a), minus(c, a))) for a, b, c in corners):
            continue
        rows[1] = np.roll(rows[1], rng.integers(3))
        crossing = first_crossing(points, rows[rng.permutation(2)], 0.0)
        assert (crossing is not None) == meet_beyond(*corners)
        answers.append(crossing is not None)
        if crossing is not None:
            assert np.ptp([*points, crossing.place], axis=0).max() == np.ptp(points, axis=0).max()
    assert 0 < np.mean(answers) < 0.8


@pytest.mark.parametrize("seed", range(6))
def test_the_same_pairs_are_found_among_many_triangles(seed):
    rng = np.random.default_rng(seed)
    points = np.unique(rng.integers(-4, 5, (30, 3)), axis=0).astype(float)
    rows = np.array([rng.permutation(len(points))[:3] for _ in range(12)])
    rows = rows[np.unique(np.sort(rows, axis=1), axis=0, return_index=True)[1]]
    a, b, c = np.moveaxis(points[rows], 1, 0)
    rows = rows[np.cross(b - a, c - a).any(axis=1)]
    exact = [[tuple(map(Fraction, points[v].tolist())) for v in row] for row in rows]
    wrong = {(i, j) for i, j in itertools.combinations(range(len(rows)), 2) if meet_beyond(exact[i], exact[j])}
    assert len(wrong) > 3
    left = np.arange(len(rows))
    while (crossing := first_crossing(points, rows[left], 0.0)) is not None:
        one, two = left[[crossing.one, crossing.two]]
        assert (min(one, two), max(one, two)) in wrong
        left = left[left != one]
    assert not wrong & set(itertools.combinations(left.tolist(), 2))


def folded(by: float) -> tuple[np.ndarray, list[list[int]]]:
    """Return a unit cube whose lid is four triangles about a point that lies so far out over an edge of it."""
    corners = np.array([*((x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))), (0.5, -by, 1.0)])
    sides = [[k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4] for k in range(4)]
    lid = [[4 + k, 4 + (k + 1) % 4, 8] for k in range(4)]
    return corners, [[3, 2, 1, 0], *sides, *lid]


@pytest.mark.parametrize("by", [1e-8, 1e-5])
def test_a_sliver_folded_over_an_edge_falls_away_and_it_is_said_how_far_the_surface_moved(by: float) -> None:
    mesh = checked_mesh(*folded(by), name="cube")
    assert any("folded" in repair for repair in mesh.repairs)
    assert by / 2.0 <= mesh.moved <= 1e-4
    assert mesh.volume == pytest.approx(1.0, abs=2.0 * by)
    assert first_crossing(mesh.vertices, mesh.triangles, 1e-12) is None


def test_a_wide_fold_is_refused_by_face_and_place() -> None:
    with pytest.raises(InputError, match=r"body 'cube': faces \d+ and \d+ cross, overlap"):
        checked_mesh(*folded(0.01), name="cube")
