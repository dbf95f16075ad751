"""The flat arrays of a part: what they hold, and that their error bounds hold, in exact numbers."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from cases import CUBE, EXAMPLE_1, TETRAHEDRON, box_shape, shape
from hypothesis import given
from oracles import cross, dot, minus, rational
from strategies import generators, random_pose, random_shape, runs

from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.measures import cross as crosses
from fcdm_opt.geometry.packing import HEADER

GRID = box_shape((0, 0, 0), (1, 1, 1), ("0.25", "0.5", "0.5"))
SLIM = shape([(0, 0, 0), (1, 0, 0), ("0.5", "1e-7", 0), ("0.5", 0, 1)], ("0.5", "3e-8", "0.25"))


def tables(part: ConvexPart) -> dict[str, np.ndarray]:
    reals, ints = part.packed
    n, f, m, half, vertex, face, support, leaving, cells = ints[:9].tolist()
    assert half == HEADER
    return {
        "vertices": reals[:n, :3],
        "normals": reals[n : n + f, :3],
        "errors": reals[n : n + f, 3],
        "summary": reals[n + f, :3],
        "lost": reals[n + f + 1 :, :3],
        "half": ints[half : half + 8 * m].reshape(2 * m, 4),
        "vertex": ints[vertex : vertex + n],
        "face": ints[face : face + f],
        "support": ints[support : support + 6 * cells**2].reshape(3, 2, cells, cells),
        "leaving": ints[leaving : leaving + 6 * cells**2].reshape(3, 2, cells, cells),
    }


@pytest.mark.parametrize("own", [GRID, TETRAHEDRON, EXAMPLE_1.one, EXAMPLE_1.two, SLIM], ids=range(5))
def test_half_edges_go_round_every_face_and_every_vertex(own):
    (part,) = own.body().parts
    table = tables(part)
    for face, loop in enumerate(part.loops):
        walked, h = [], int(table["face"][face])
        for _ in loop:
            origin, end, left, following = table["half"][h].tolist()
            assert left == face
            assert table["half"][following, 0] == end
            walked.append(origin)
            h = following
        assert h == table["face"][face]
        assert walked[walked.index(loop[0]) :] + walked[: walked.index(loop[0])] == list(loop)
    for h, (origin, end, _, _) in enumerate(table["half"].tolist()):
        assert table["half"][h ^ 1, :2].tolist() == [end, origin]
        assert set(part.edges[h // 2, :2].tolist()) == {origin, end}
    assert [table["half"][h, 0] for h in table["vertex"]] == list(range(len(part.vertices)))


@runs(40)
@given(generators)
def test_rounded_vertices_and_what_they_lost_are_the_exact_ones(rng):
    body = random_shape(rng, 1000).body().moved(random_pose(rng, 1e6))
    (part,) = body.parts
    table = tables(part)
    (seed,) = rational([part.seed])
    rounded, lost = rational(table["vertices"]), rational(table["lost"])
    for vertex, x, rest in zip(rational(part.vertices), rounded, lost, strict=True):
        assert tuple(a + b for a, b in zip(x, rest, strict=True)) == minus(vertex, seed)


def true_normals(part: ConvexPart, loop: tuple[int, ...]) -> list[tuple[Fraction, ...]]:
    """Outward normals of all exact facets on three corners of a face: those with no other corner of it above."""
    corners = rational(part.vertices[list(loop)])
    found = []
    for i in range(len(corners)):
        for j in range(i + 1, len(corners)):
            for k in range(j + 1, len(corners)):
                n = cross(minus(corners[j], corners[i]), minus(corners[k], corners[i]))
                if max(dot(n, minus(x, corners[i])) for x in corners) <= 0:
                    found.append(n)
    return found


def distance_from_unit(n: tuple[Fraction, ...], unit: np.ndarray) -> float:
    """Distance between a float vector and the unit vector of an exact direction, to rounding in the last step."""
    scale = max(abs(x) for x in n)
    whole = [x / scale for x in n]
    length = Fraction(math.isqrt(int(dot(whole, whole) * 10**60))) / 10**30
    return math.sqrt(float(sum((x / length - Fraction(float(y))) ** 2 for x, y in zip(whole, unit, strict=True))))


@runs(40)
@given(generators)
def test_error_bounds_of_normals_hold_for_every_exact_facet(rng):
    body = random_shape(rng, 3).body().moved(random_pose(rng))  # drawn faces of more corners are no longer planar
    (part,) = body.parts
    table = tables(part)
    for loop, unit, error in zip(part.loops, table["normals"], table["errors"], strict=True):
        assert error < 1e-12
        for n in true_normals(part, loop):
            assert distance_from_unit(n, unit) <= error


def test_a_slim_face_is_known_to_rounding():
    """Plain arithmetic on its corners gives its direction to 1e-9 only."""
    (part,) = SLIM.body().parts
    table = tables(part)
    assert table["errors"].max() < 1e-15
    for loop, unit in zip(part.loops, table["normals"], strict=True):
        (n,) = true_normals(part, loop)
        assert distance_from_unit(n, unit) <= table["errors"].max()


@pytest.mark.parametrize(("seed", "inside"), [((0, 0, 0), 1), ((1, 0, 0), 0), ((1, 1, 1), 0), ((2, 0, 0), 0)])
def test_summary_tells_reach_and_whether_the_seed_is_inside(seed, inside):
    (part,) = shape(CUBE.vertices, seed).body().parts
    reach, convex, within = tables(part)["summary"]
    assert reach == pytest.approx(np.linalg.norm(CUBE.array - seed, axis=1).max(), rel=1e-14)
    assert (convex, within) == (1, inside)


@pytest.mark.parametrize("count", [8, 300])
def test_grids_hold_the_extreme_vertex_and_the_face_that_a_ray_leaves_through(count):
    points = np.random.default_rng(count).normal(size=(count, 3))
    (part,) = Body.convex(points / np.linalg.norm(points, axis=1)[:, None]).parts
    table = tables(part)
    cells = table["support"].shape[-1]
    middles = (2 * np.arange(cells) + 1) / cells - 1
    levels = (part.vertices - part.seed) @ part.normals.T
    for axis in range(3):
        for sign in range(2):
            for i, u in enumerate(middles):
                for j, v in enumerate(middles):
                    n = np.empty(3)
                    n[axis], n[(axis + 1) % 3], n[(axis + 2) % 3] = 1 - 2 * sign, u, v
                    heights = (part.vertices - part.seed) @ n
                    assert heights[table["support"][axis, sign, i, j]] == pytest.approx(heights.max(), rel=1e-14)
                    rates = part.normals @ n / levels.max(axis=0)
                    assert rates[table["leaving"][axis, sign, i, j]] == pytest.approx(rates.max(), rel=1e-13)


def test_packed_arrays_are_read_only():
    for array in GRID.body().parts[0].packed:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_cross_products_of_whole_numbers_are_exact_however_large():
    u, v = (np.array(own, dtype=object) for own in ((2**32 + 1, 3, 5), (7, 2**31 + 3, 2**33)))
    n = crosses(u, v)
    assert n.tolist() == [3 * 2**33 - 5 * (2**31 + 3), 35 - (2**32 + 1) * 2**33, (2**32 + 1) * (2**31 + 3) - 21]
    assert u @ n == v @ n == 0
