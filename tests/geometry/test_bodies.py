"""Bodies: topology against exact hulls, closed forms for seeds, invariances, and every bad input."""

from __future__ import annotations

import copy
import itertools
import pickle
from dataclasses import FrozenInstanceError
from itertools import product

import numpy as np
import pytest
from body_checks import check_against_exact, check_consistent
from cases import EXAMPLE_1, EXAMPLE_2, TETRAHEDRON, Shape, box_shape
from hypothesis import given
from oracles import hull
from strategies import generators, random_points, random_pose, reaches

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body, rigid_transform
from fcdm_opt.geometry.elements import Element

CUBE = np.array(list(itertools.product([0.0, 1.0], repeat=3)))
GRID = np.array(list(itertools.product([0.0, 0.5, 1.0], repeat=3)))  # mid-edge, mid-face and interior points too


# --------------------------------------------------------------------------------------------------------- topology


def test_cube_with_points_on_edges_faces_and_inside_has_six_faces_and_eight_corners():
    body = Body.convex(GRID)
    (part,) = body.parts
    check_consistent(part)
    assert (len(part.vertices), len(part.edges), len(part.loops)) == (8, 12, 6)
    corners = [k + 1 for k, x in enumerate(GRID) if set(x) <= {0.0, 1.0}]
    assert sorted({v for face in body.faces for v in face}) == corners
    np.testing.assert_allclose(body.seed, [0.5, 0.5, 0.5], atol=1e-15)


@given(generators, reaches)
def test_random_integer_hulls_equal_the_exact_hull(rng, reach):
    rows = random_points(rng, int(rng.integers(4, 13)), reach)
    rng.shuffle(rows)
    body = Body.convex(rows)
    check_consistent(body.parts[0])
    check_against_exact(body, rows)


@given(generators)
def test_points_that_are_no_corners_and_repeated_points_keep_their_number(rng):
    rows = [tuple(map(int, x)) for x in rng.integers(-2, 3, (14, 3))]
    try:
        solid = hull(dict(enumerate(rows)))
    except ValueError:
        with pytest.raises(InputError):
            Body.convex(rows)
        return
    body = Body.convex(rows)
    check_consistent(body.parts[0])
    used = {rows[v - 1] for face in body.faces for v in face}
    assert used == set(solid.vertices.values())
    np.testing.assert_array_equal(body.vertices, rows)
    named = {frozenset(rows[v - 1] for v in face) for face in body.faces}
    assert named == {frozenset(rows[row] for row in face) for face in solid.facets.values()}


@pytest.mark.parametrize("sides", [3, 4, 7, 64, 500])
def test_regular_prism_has_its_two_large_faces(sides):
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    body = Body.convex([(*xy, z) for z in (-1.0, 1.0) for xy in ring])
    check_consistent(body.parts[0])
    assert sorted(map(len, body.faces)) == sorted([4] * sides + [sides] * 2)


@pytest.mark.parametrize("example", [EXAMPLE_1, EXAMPLE_2])
def test_drawn_quads_of_the_examples_are_faces_although_not_planar_in_floats(example):
    for own in (example.one, example.two):
        if own.parts is None:
            check_against_decimal(own)


def check_against_decimal(own: Shape) -> None:
    unit = 100000
    rows = [tuple(int(x * unit) for x in row) for row in own.vertices]
    check_against_exact(own.body(), rows)


# ------------------------------------------------------------------------------------------------------------ labels


def example_2_union(faces: bool) -> Body:
    own = EXAMPLE_2.two
    return Body.from_parts(own.array, parts=own.parts, faces=own.faces if faces else None, seed="vertices")


@pytest.mark.parametrize("faces", [False, True])
def test_cut_edge_of_example_2_carries_the_true_face_and_the_seam_is_no_face_of_the_body(faces):
    body = example_2_union(faces)
    bottom, top = Element("F", (1, 2, 3, 4, 5, 6)), Element("F", (7, 8, 9, 10, 11, 12))
    assert bottom.vertices in body.faces
    assert top.vertices in body.faces
    assert len(body.faces) == 8
    assert (1, 4, 7, 10) not in body.faces
    for part in body.parts:
        rows = [tuple(np.flatnonzero((body.vertices == x).all(axis=1)) + 1) for x in part.vertices]
        named = {
            tuple(sorted(rows[a] + rows[b])): element
            for (a, b), element in zip(part.edges[:, :2].tolist(), part.elements["E"], strict=True)
        }
        assert named[1, 4] == bottom
        assert named[7, 10] == top
        assert named[4, 10] == Element("E", (4, 10))
        assert named[1, 7] == Element("E", (1, 7))
        assert Element("F", (1, 4, 7, 10)) in part.elements["F"]
        assert all(element.kind == "V" for element in part.elements["V"])


@pytest.mark.parametrize("given", [False, True])
def test_vertex_that_a_cut_makes_inside_a_true_face_carries_that_face(given):
    rows = [(x, y, z) for x in range(3) for y in range(3) for z in range(2)]  # a plate of four boxes
    parts = [[rows.index((x + i, y + j, k)) for i, j, k in np.ndindex(2, 2, 2)] for x, y in np.ndindex(2, 2)]
    ends = [[(x, y, z) for x in (0, 2) for y in (0, 2) for z in (0, 1)]] * 6
    true = [[rows.index(x) for x in ends[k] if x[k // 2] == (0, 2 if k < 4 else 1)[k % 2]] for k in range(6)]
    body = Body.from_parts(rows, parts=parts, faces=true if given else None, seed=(1, 1, 0))
    top = [row + 1 for row, x in enumerate(rows) if x[2] == 1 and (not given or x[0] != 1 != x[1])]
    for part in body.parts:
        at = {tuple(x): k for k, x in enumerate(part.vertices.tolist())}
        assert part.elements["V"][at[1, 1, 1]] == Element("F", tuple(top))
        cuts = [
            element
            for (a, b), element in zip(part.edges[:, :2].tolist(), part.elements["E"], strict=True)
            if at[1, 1, 1] in (a, b) and part.vertices[[a, b], 2].min() == 1
        ]
        assert cuts == [Element("F", tuple(top))] * 2


def test_parts_given_as_arrays_are_numbered_by_first_appearance_with_equal_points_once():
    left, right = CUBE, CUBE + np.array([1, 0, 0])
    body = Body.from_parts([left, right])
    assert len(body.vertices) == 12
    np.testing.assert_array_equal(body.vertices[:8], left)
    np.testing.assert_array_equal(body.vertices[8:], right[4:])
    assert sorted(map(len, body.faces)) == [4, 4, 6, 6, 6, 6]  # the seam is gone, coplanar halves are one face
    np.testing.assert_allclose(body.seed, [1, 0.5, 0.5], atol=1e-15)


# ------------------------------------------------------------------------------------------------------------- seeds


def test_seeds_in_closed_form():
    rows = [(0, 0, 0), (4, 0, 0), (0, 4, 0), (0, 0, 4), (1, 1, 1)]
    np.testing.assert_allclose(Body.convex(rows).seed, [1, 1, 1], atol=1e-15)
    np.testing.assert_allclose(Body.convex(rows, seed="vertices").seed, [1, 1, 1], atol=1e-15)
    np.testing.assert_array_equal(Body.convex(rows, seed="box").seed, [2, 2, 2])
    np.testing.assert_array_equal(Body.convex(rows, seed=(7, 8, 9)).seed, [7, 8, 9])
    np.testing.assert_allclose(Body.convex([*rows, (4, 4, 0)], seed="vertices").seed, [9 / 6, 9 / 6, 5 / 6], atol=1e-15)
    frustum = [(x, y, 0) for x in (-2, 2) for y in (-2, 2)] + [(x, y, 3) for x in (-1, 1) for y in (-1, 1)]
    A, B = 16, 4  # centroid height of a frustum of height h: h / 4 (A + 2 sqrt(AB) + 3 B) / (A + sqrt(AB) + B)
    height = 3 / 4 * (A + 2 * 8 + 3 * B) / (A + 8 + B)
    np.testing.assert_allclose(Body.convex(frustum).seed, [0, 0, height], atol=1e-15)


def test_centroid_of_the_l_prism_is_that_of_the_whole():
    arms = [((0, 0, 0), (2, 1, 1)), ((0, 1, 0), (1, 2, 1))]
    body = Body.from_parts([box_shape(*arm).array for arm in arms])
    volumes, centres = [2.0, 1.0], [[1, 0.5, 0.5], [0.5, 1.5, 0.5]]
    np.testing.assert_allclose(body.seed, np.average(centres, axis=0, weights=volumes), atol=1e-15)
    assert sum(part.volume_and_centroid[0] for part in body.parts) == pytest.approx(3, rel=1e-15)


@given(generators)
def test_seed_and_topology_follow_a_rigid_motion(rng):
    rows = random_points(rng, 9, 3)
    T = random_pose(rng, 5.0)
    body = Body.convex(rows)
    moved = body.moved(T)
    rebuilt = Body.convex(np.array(rows) @ T[:3, :3].T + T[:3, 3])
    assert sorted(rebuilt.faces) == sorted(body.faces)
    for other in (moved, rebuilt):
        np.testing.assert_allclose(other.seed, T[:3, :3] @ body.seed + T[:3, 3], atol=1e-13)
        np.testing.assert_allclose(other.vertices, np.array(rows) @ T[:3, :3].T + T[:3, 3], atol=1e-13)
    assert moved.faces == body.faces
    assert moved.parts[0].loops == body.parts[0].loops
    np.testing.assert_allclose(moved.parts[0].normals, body.parts[0].normals @ T[:3, :3].T, atol=1e-13)
    check_consistent(rebuilt.parts[0])


@given(generators)
def test_permuted_vertices_give_permuted_labels(rng):
    rows = random_points(rng, 9, 3)
    order = rng.permutation(len(rows))
    one, two = Body.convex(rows), Body.convex([rows[k] for k in order])
    back = {k + 1: int(order[k]) + 1 for k in range(len(rows))}
    assert {frozenset(back[v] for v in face) for face in two.faces} == {frozenset(face) for face in one.faces}
    np.testing.assert_allclose(two.seed, one.seed, atol=1e-14)


@pytest.mark.parametrize("factor", [1e-6, 1e-3, 1e3, 1e6])
@pytest.mark.parametrize("points", [GRID - 0.3, TETRAHEDRON.array, EXAMPLE_1.one.array, EXAMPLE_2.one.array])
def test_topology_does_not_depend_on_the_unit_of_length(points, factor):
    one, two = Body.convex(points), Body.convex(points * factor)
    check_consistent(two.parts[0])
    assert sorted(two.faces) == sorted(one.faces)
    np.testing.assert_allclose(two.seed / factor, one.seed, atol=1e-14)


def test_topology_survives_a_far_origin():
    body = Body.convex(GRID + np.array([1e6, -1e6, 1e6]))  # halves are exact there
    check_consistent(body.parts[0])
    assert sorted(body.faces) == sorted(Body.convex(GRID).faces)
    np.testing.assert_allclose(body.seed, [1e6 + 0.5, -1e6 + 0.5, 1e6 + 0.5], rtol=1e-15)


@pytest.mark.parametrize("thickness", [1e-4, 1e-6, 1e-8])
def test_thin_plate_keeps_its_faces_and_centroid(thickness):
    body = Body.convex(GRID * [1, 1, thickness])
    check_consistent(body.parts[0])
    assert sorted(body.faces) == sorted(Body.convex(GRID).faces)
    np.testing.assert_allclose(body.seed, [0.5, 0.5, thickness / 2], rtol=1e-12)
    normals = {tuple(x) for x in np.round(body.parts[0].normals).astype(int).tolist()}
    assert normals == {(s * (k == 0), s * (k == 1), s * (k == 2)) for s in (-1, 1) for k in range(3)}


def test_scaled_body_keeps_its_seed_and_size_scales():
    body = Body.convex(CUBE, seed=(0.25, 0, 0)).scaled(3.0)
    np.testing.assert_array_equal(body.seed, [0.25, 0, 0])
    np.testing.assert_array_equal(body.vertices, np.array([0.25, 0, 0]) + 3 * (CUBE - [0.25, 0, 0]))
    assert body.size == pytest.approx(3 * np.sqrt(3), rel=1e-15)


# ---------------------------------------------------------------------------------------------------------- immutable


def test_nothing_of_a_body_can_be_changed():
    points = CUBE.copy()
    body = Body.convex(points)
    points[:] = 0
    np.testing.assert_array_equal(body.vertices, CUBE)
    part = body.parts[0]
    arrays = [
        body.vertices,
        body.seed,
        part.vertices,
        part.seed,
        part.edges,
        part.normals,
        part.half_edges,
        *part.packed,
    ]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    with pytest.raises(FrozenInstanceError):
        body.seed = CUBE[0]
    with pytest.raises(FrozenInstanceError):
        part.vertices = CUBE
    with pytest.raises(TypeError):
        part.elements["V"] = ()
    with pytest.raises(TypeError):
        part.elements["V"][0] = part.elements["V"][1]


def arrays_of(body: Body) -> list[np.ndarray]:
    parts = [(p.vertices, p.seed, p.edges, p.normals, p.half_edges, *p.packed) for p in body.parts]
    return [body.vertices, body.seed, *(array for own in parts for array in own)]


@pytest.mark.parametrize("again", [lambda x: pickle.loads(pickle.dumps(x)), copy.copy, copy.deepcopy])
@pytest.mark.parametrize("warm", [False, True])
def test_copies_of_a_body_had_arrays_that_could_be_changed(again, warm):
    body = Body.from_parts([CUBE, CUBE + np.array([0, 0, 1])])
    if warm:
        arrays_of(body)  # fills what is worked out once
    other = again(body)
    for one, two in zip(arrays_of(body), arrays_of(other), strict=True):
        np.testing.assert_array_equal(one, two)
        assert not two.flags.writeable
    assert (other.name, other.faces, other.outlines) == (body.name, body.faces, body.outlines)
    for one, two in zip(body.parts, other.parts, strict=True):
        assert one.loops == two.loops
        assert one.elements == two.elements


def test_elements_of_one_convex_part_are_made_on_demand_and_equal_those_of_given_faces():
    """The lazy sequences of a single part against the tuples that any body with given faces has."""
    rows = np.random.default_rng(5).integers(-9, 10, (40, 3))
    lazy = Body.convex(rows)
    eager = Body.from_parts(rows, parts=[range(len(rows))], faces=[[v - 1 for v in face] for face in lazy.faces])
    one, two = lazy.parts[0].elements, eager.parts[0].elements
    assert list(one) == list(two) == ["V", "E", "F"]
    for kind in one:
        assert len(one[kind]) == len(two[kind]) > 5
        assert [one[kind][k] for k in range(len(two[kind]))] == list(two[kind])
        assert one[kind][-1] == two[kind][-1]
        assert one[kind][np.int64(2)] == two[kind][2]
        assert one[kind][1:4] == two[kind][1:4]
        assert one[kind].index(two[kind][3]) == 3
        assert list(one[kind]) == list(two[kind]) == list(pickle.loads(pickle.dumps(one[kind])))
        with pytest.raises(IndexError):
            one[kind][len(two[kind])]


# ----------------------------------------------------------------------------------------------------------- bad input


def with_entry(value: float) -> np.ndarray:
    rows = CUBE.copy()
    rows[4, 1] = value
    return rows


BAD_VERTICES = {
    "nan": (with_entry(np.nan), "vertex 5 is not finite"),
    "inf": (with_entry(np.inf), "vertex 5 is not finite"),
    "three points": (CUBE[:3], "at least 4"),
    "no points": (np.empty((0, 3)), "at least 4"),
    "flat": (CUBE[CUBE[:, 2] == 0].repeat(2, axis=0), "one plane, through vertices 1, 3 and 7"),
    "flat and slanted": (np.column_stack([CUBE[:, :2], CUBE[:, 0] / 3 + CUBE[:, 1] / 7]), "one plane"),
    "on a line": (np.outer(np.arange(5.0), [1, 2, 3]), "one line, through vertices 1 and 5"),
    "all the same": (np.ones((5, 3)), "coincide: vertex 2 repeats vertex 1"),
    "two distinct points": (CUBE[[0, 1, 0, 1, 0]], "only 2 distinct .* vertex 3 repeats vertex 1"),
    "three distinct points": (CUBE[[0, 1, 2, 1, 0]], "only 3 distinct .* vertex 4 repeats vertex 2"),
    "two columns": (CUBE[:, :2], "shape"),
    "one row": (CUBE[0], "shape"),
    "ragged": ([[0, 0, 0], [1, 0], [0, 1, 0], [0, 0, 1]], "vertex 2: a vertex is three numbers"),
    "words": ([["a", "b", "c"]] * 4, "vertex 1: .*rectangular"),
    "numbers as text": (CUBE.astype(str), "vertex 1: .*numbers"),
    "one text among objects": ([*CUBE.astype(object).tolist(), ["1", 2, 3]], "vertex 9: .*numbers"),
    "complex": (CUBE + 1j, "vertex 1: .*numbers"),
    "dates": (np.zeros((8, 3), "M8[s]"), "numbers"),
    "too large": (with_entry(1e60), "vertex 5: .*too large"),
    "an endless integer": ([*CUBE.tolist(), [0, 0, 10**400]], "vertex 9: .*numbers"),
    "a masked entry": (np.ma.array(CUBE, mask=CUBE == 0), "numbers"),
    "a masked row": ([*np.ma.array(CUBE, mask=CUBE == 0)], "vertex 1: .*numbers"),
    "beyond double precision": (CUBE * np.longdouble("1e4000"), "vertex [12]"),
    "a generator": ((x for x in CUBE), "numbers"),
    "a slab thinner than floats": (CUBE * [1, 1, 1e-13], "one plane"),
    "none": (None, "shape"),
}


@pytest.mark.parametrize("name", BAD_VERTICES)
def test_bad_vertices_are_refused_with_the_name_of_the_body(name):
    points, message = BAD_VERTICES[name]
    with pytest.raises(InputError, match=message) as caught:
        Body.convex(points, name="lid")
    assert "lid" in str(caught.value)


@pytest.mark.parametrize(
    ("seed", "message"),
    [
        ((0, 0, np.nan), "finite point"),
        ((0, 0, np.inf), "finite point"),
        ((0, 0), "finite point"),
        ([[0, 0, 0]], "finite point"),
        ("middle", "unknown seed rule"),
        ("", "unknown seed rule"),
        (None, "seed"),
    ],
)
def test_bad_seeds_are_refused(seed, message):
    with pytest.raises(InputError, match=message) as caught:
        Body.convex(CUBE, seed=seed, name="lid")
    assert "lid" in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"parts": [[0, 1, 2, 8]]}, r"part 1: entry 4 is not a row.*found 8"),
        ({"parts": [range(8), [0, 1, 2, -1]]}, r"part 2: entry 4 is not a row.*found -1"),
        ({"parts": 5}, "parts: expected lists of rows"),
        ({"parts": [5]}, "part 1: expected a list of rows"),
        ({"parts": "abc"}, "part 1: entry 1 is not a row"),
        ({"parts": [itertools.cycle(range(8))]}, "part 1: .*twice, as entries 1 and 9"),
        ({"parts": [[0, 1, 2, 4.0]]}, "not a row"),
        ({"parts": [[0, 1, 2, True]]}, "not a row"),
        ({"parts": [[0, 1, 2, 2, 4]]}, "twice"),
        ({"parts": [[0, 1, 2]]}, "at least 4"),
        ({"parts": [range(8), [0, 1, 2, 3]]}, r"part 2.*one plane, through vertices 1, 2 and 4"),
        ({"parts": []}, "at least one part"),
        ({"parts": [range(8)], "faces": 5}, "faces: expected lists of rows"),
        ({"parts": [range(8)], "faces": [[0, 1, 9]]}, r"face 1: entry 3"),
        ({"parts": [range(8)], "faces": [[0, 1]]}, r"face 1: .*at least 3"),
        ({"parts": [range(8)], "faces": [[0, 1, 3, 2], [0, 1, 2, 4]]}, r"face 2: .*in no plane .*misses vertex 3 by 1"),
        ({"parts": [range(8)], "faces": [[0, 1, 7, 6]]}, r"face 1: .*in no plane"),
        ({"parts": [range(8)], "faces": [[0, 1, 2]]}, r"face 1: only a piece .*vertex 4 is missing"),
        ({"parts": [range(8)], "faces": [[0, 1, 3, 2], [2, 3, 1, 0]]}, r"face 2: .*those of face 1"),
        ({"parts": [[0, 1, 2, 4, 5, 6], [1, 3, 2, 5, 7, 6], range(8)]}, "overlapping parts"),
    ],
)
def test_bad_parts_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        Body.from_parts(CUBE, **arguments)


@pytest.mark.parametrize(
    ("point", "face", "message"),
    [
        ((0, 0, 0.5), [0, 1, 8], "one line"),
        ((0, 3, 0.5), [0, 1, 3, 2, 8], "vertex 9 lies in the plane of the face, but not on it"),
    ],
)
def test_a_given_face_with_a_vertex_off_the_body_was_accepted(point, face, message):
    with pytest.raises(InputError, match=f"'lid': face 1: .*{message}"):
        Body.from_parts([*CUBE, point], parts=[range(8)], faces=[face], name="lid")


def test_a_seam_given_as_a_face_was_accepted():
    rows = [*CUBE, *CUBE[1::2] + np.array([0, 0, 1])]  # one cube on the other
    parts, seam = [range(8), [1, 3, 5, 7, 8, 9, 10, 11]], [1, 3, 7, 5]
    with pytest.raises(InputError, match="face 1"):
        Body.from_parts(rows, parts=parts, faces=[seam])


def test_a_given_face_may_name_points_on_it_that_are_no_corners():
    body = Body.from_parts([*CUBE, (0, 0, 0.5), (0, 0.5, 0.5)], parts=[range(8)], faces=[[0, 8, 1, 3, 2], [2, 3, 7, 6]])
    assert body.faces == ((1, 2, 3, 4, 9), (3, 4, 7, 8))
    assert set(body.parts[0].elements["F"]) >= {Element("F", face) for face in body.faces}


def test_vertices_without_parts_must_be_one_array_a_part():
    with pytest.raises(InputError, match=r"one \(n, 3\) array a part"):
        Body.from_parts(CUBE)


def test_overlapping_parts_need_a_given_seed_and_touching_ones_do_not():
    with pytest.raises(InputError, match="overlapping parts"):
        Body.from_parts([CUBE, CUBE + 0.5])
    assert len(Body.from_parts([CUBE, CUBE + 0.5], seed=(0, 0, 0)).parts) == 2
    np.testing.assert_allclose(Body.from_parts([CUBE, CUBE + np.array([0, 0, 1])]).seed, [0.5, 0.5, 1], atol=1e-15)


@pytest.mark.parametrize("rho", [0.0, -1.0, np.nan, np.inf, 1e-300, [1, 2]])
def test_scales_must_be_positive(rho):
    with pytest.raises(InputError, match="positive"):
        Body.convex(CUBE).scaled(rho)


@pytest.mark.parametrize("rho", [1e300, 10**400, "2", 1 + 0j, np.complex128(1), None])
def test_scales_must_be_numbers_of_a_usual_size(rho):
    with pytest.raises(InputError, match="scale"):
        Body.convex(CUBE).scaled(rho)


@pytest.mark.parametrize(
    "transform",
    [np.eye(3), np.diag([1, 1, -1, 1]), np.diag([2, 2, 2, 1]), np.full((4, 4), np.nan), np.ones((4, 4)), "turn"],
)
def test_transforms_must_be_rigid(transform):
    with pytest.raises(InputError):
        rigid_transform(transform)
    with pytest.raises(InputError):
        Body.convex(CUBE).moved(transform)


def test_another_seed_is_what_seeds_are_given_as() -> None:
    """A tuple was taken and failed later, without a word on what it was."""
    box = Body.convex([*product((-1, 1), repeat=3)])
    each = {(0, 0, 1): [0, 0, 1], "box": [0, 0, 0]}
    assert {own: box.with_seed(own).seed.tolist() for own in each} == each
    for wrong in ((0, 0), "nowhere"):
        with pytest.raises(InputError, match="seed"):
            box.with_seed(wrong)
