"""Labels refer to the body's own vertices, edges and faces, whatever its parts are."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from cases import EXAMPLE_2
from hypothesis import given
from solids import FAMILIES, random_solid
from strategies import generators, random_pose, runs
from voxels import VOXELS, surface_of

from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.mesh import Mesh, checked_mesh

CUBE = np.array(list(itertools.product([0.0, 1.0], repeat=3)))


def box(low: tuple[float, ...], high: tuple[float, ...]) -> np.ndarray:
    return np.array(low) + CUBE * (np.array(high) - np.array(low))


def labels(body: Body, part: ConvexPart) -> dict[str, dict[tuple[tuple[float, ...], ...], Element]]:
    """Elements of a part by the places of their corners."""
    at = [tuple(x) for x in part.vertices.tolist()]
    return {
        "V": {(at[k],): element for k, element in enumerate(part.elements["V"])},
        "E": {
            tuple(sorted((at[a], at[b]))): element
            for (a, b), element in zip(part.edges[:, :2].tolist(), part.elements["E"], strict=True)
        },
        "F": {
            tuple(sorted(at[k] for k in loop)): element
            for loop, element in zip(part.loops, part.elements["F"], strict=True)
        },
    }


# -------------------------------------------------------------------------------------------------------- example 2


@pytest.mark.parametrize("turned", [False, True])
def test_example_2_from_its_mesh_has_the_curve_and_the_labels_of_its_given_parts(turned):
    """The mesh knows 12 vertices and 8 faces, no parts; its parts may be others, curve and labels may not."""
    one, two = EXAMPLE_2.one.body(), EXAMPLE_2.two
    given = two.body()
    mesh = Body.from_mesh(two.array, two.faces, seed=given.seed)
    assert mesh.faces == given.faces
    assert len(mesh.parts) == 2
    T = random_pose(np.random.default_rng(1), 1.0) if turned else np.eye(4)
    first, second = (decision_curve(one.moved(T), body.moved(T)) for body in (given, mesh))
    ours, theirs = ([segment.feature.label for segment in curve.segments] for curve in (first, second))
    assert ours == theirs
    assert [segment.feature for segment in second.segments] == [Feature.from_label(text) for text in EXAMPLE_2.labels]
    for name in ("start", "end"):
        np.testing.assert_allclose(
            [getattr(segment, name) for segment in first.segments],
            [getattr(segment, name) for segment in second.segments], rtol=1e-11,
        )  # fmt: skip
    assert [point.label for point in first.switching_points] == [point.label for point in second.switching_points]
    for point, other in zip(first.switching_points, second.switching_points, strict=True):
        np.testing.assert_allclose(point.rho, other.rho, rtol=1e-11)
        np.testing.assert_allclose(point.contacts, other.contacts, atol=1e-10)


# ------------------------------------------------------------------------------------------------------------- cuts


def test_what_a_cut_makes_on_a_true_edge_carries_that_edge():
    vertices = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3))]
    faces = [(5, 4, 3, 2, 1, 0), (6, 7, 8, 9, 10, 11), *((k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6) for k in range(6))]
    for seed in ((0.5, 0.5, 0.5), (9, 9, 9)):  # a cover, a partition
        body = Body.from_mesh(vertices, faces, seed=seed)
        assert len(body.parts) == 2
        found: dict[object, Element] = {}
        for part in body.parts:
            for own in labels(body, part).values():
                found |= own
        front, left = Element("E", (1, 2)), Element("E", (1, 6))
        assert found.get(((1, 0, 0),), front) == front
        assert found.get(((0, 1, 0),), left) == left
        assert ((1, 0, 0),) in found or ((0, 1, 0),) in found
        assert found.get(((0, 0, 0), (1, 0, 0)), front) == front  # a piece of the edge is the edge
        assert found.get(((0, 0, 0), (0, 1, 0)), left) == left
        assert all(max(element.vertices) <= 12 for element in found.values() if element.kind == "V")


def true_planes(mesh: Mesh, point: np.ndarray) -> np.ndarray:
    """Distinct outward normals of the mesh's triangles that hold a point."""
    corners = mesh.vertices[mesh.triangles]
    size = np.ptp(mesh.vertices, axis=0).max()
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    held = np.abs(((point - corners[:, 0]) * normals).sum(axis=1)) < 1e-10 * size
    for k in range(3):
        along = corners[:, (k + 1) % 3] - corners[:, k]
        inward = np.cross(normals, along) / np.linalg.norm(along, axis=1)[:, None]
        held &= ((point - corners[:, k]) * inward).sum(axis=1) > -1e-10 * size
    distinct: list[np.ndarray] = []
    for normal in normals[held]:
        if all(np.abs(normal - other).max() > 1e-7 for other in distinct):
            distinct.append(normal)
    return np.array(distinct)


@pytest.mark.parametrize(("number", "family"), [(k % 2, family) for k, family in enumerate(FAMILIES)])
def test_labels_name_what_the_mesh_has_at_a_place(family, number):
    """Faces of how many directions hold the middle of an element: one, a face; two, an edge; more, a vertex."""
    solid = random_solid(np.random.default_rng(40 + number), family, turned=number == 1)
    body, mesh = solid.body(), checked_mesh(solid.vertices, solid.triangles)
    count, looked = len(mesh.vertices), 0
    for part in body.parts:
        for k, element in enumerate(part.elements["V"]):
            planes = true_planes(mesh, part.vertices[k])
            if len(planes):
                kind = "FEV"[min(len(planes), 3) - 1]
                assert element.kind == kind
                assert max(element.vertices) <= count
                looked += 1
                corners = body.vertices[[v - 1 for v in element.vertices]]
                if kind == "E":
                    along = corners[1] - corners[0]
                    off = np.linalg.norm(np.cross(part.vertices[k] - corners[0], along)) / (along @ along)
                    assert off < 1e-9
                if kind == "V":
                    np.testing.assert_allclose(corners[0], part.vertices[k], atol=1e-12 * solid.size)
        for k, (a, b) in enumerate(part.edges[:, :2].tolist()):
            middle = part.vertices[a] + 0.51 * (part.vertices[b] - part.vertices[a])
            planes = true_planes(mesh, middle)
            if 1 <= len(planes) <= 2:
                element = part.element_at("E", k, middle)
                assert element.kind == "FE"[len(planes) - 1]
                assert max(element.vertices) <= count
        for k, loop in enumerate(part.loops):
            middle = part.vertices[list(loop)].mean(axis=0)
            planes = true_planes(mesh, middle)
            if len(planes) == 1 and (planes[0] @ part.normals[k]) > 0.999:
                element = part.element_at("F", k, middle)
                assert element.vertices in body.faces
                corners = body.vertices[[v - 1 for v in element.vertices]]
                assert np.abs((corners - middle) @ part.normals[k]).max() < 1e-9 * solid.size
    assert looked > 4


def test_faces_with_holes_are_named_by_all_their_corners():
    body = Body.from_mesh(*surface_of(VOXELS["square frame"][0]))
    assert sorted(map(len, body.faces)) == [4] * 8 + [8] * 2
    holed = {face for face in body.faces if len(face) == 8}
    assert {element.vertices for part in body.parts for element in part.elements["F"]} >= holed


# ------------------------------------------------------------------------------------------------- several at once


@pytest.mark.parametrize("seed", [None, (9.0, 9.0, 9.0)])
def test_a_bar_of_a_cross_is_named_by_the_face_at_the_place(seed):
    vertices, faces = surface_of(VOXELS["cross"][0])
    body = Body.from_mesh(vertices, faces, seed="centroid" if seed is None else seed)
    assert len(body.parts) == (2 if seed is None else 3)
    bar = next(part for part in body.parts if np.ptp(part.vertices, axis=0).max() == 3)
    axis = int(np.ptp(bar.vertices, axis=0).argmax())
    side = next(k for k, n in enumerate(bar.normals) if abs(n[axis]) < 0.5 and abs(n[2]) < 0.5 and n.sum() > 0)
    named = []
    for place in (0.4, 2.6):
        point = bar.vertices[list(bar.loops[side])].mean(axis=0)
        point[axis] = place
        named.append(bar.element_at("F", side, point))
        corners = body.vertices[[v - 1 for v in named[-1].vertices]]
        assert corners[:, axis].min() <= place <= corners[:, axis].max()
        assert len(corners) == 4
    assert named[0] != named[1]
    T = random_pose(np.random.default_rng(0), 4.0)
    moved = body.scaled(2.5).moved(T)
    other = moved.parts[body.parts.index(bar)]
    for place, element in zip((0.4, 2.6), named, strict=True):
        point = bar.vertices[list(bar.loops[side])].mean(axis=0)
        point[axis] = place
        there = T[:3, :3] @ (body.seed + 2.5 * (point - body.seed)) + T[:3, 3]
        assert other.element_at("F", side, there) == element


# ---------------------------------------------------------------------------------------------- unions without a mesh


def test_coplanar_faces_of_parts_that_touch_without_a_common_vertex_were_two_faces():
    low, high = box((0, 0, 0), (4, 2, 1)), box((1, 2, 0), (3, 3, 1))
    body = Body.from_parts([low, high])
    top = [face for face in body.faces if (body.vertices[[v - 1 for v in face], 2] == 1).all()]
    assert [len(face) for face in top] == [8]


def test_a_true_edge_divided_by_a_cut_was_two_edges():
    body = Body.from_parts([box((0, 0, 0), (1, 1, 1)), box((1, 0, 0), (3, 1, 1))])
    ends = {tuple(x): k + 1 for k, x in enumerate(body.vertices.tolist())}
    whole = Element("E", tuple(sorted((ends[0, 0, 0], ends[3, 0, 0]))))
    one, two = (labels(body, part) for part in body.parts)
    assert one["E"][(0, 0, 0), (1, 0, 0)] == two["E"][(1, 0, 0), (3, 0, 0)] == whole
    assert one["V"][((1, 0, 0),)] == two["V"][((1, 0, 0),)] == whole
    assert one["E"][(1, 0, 0), (1, 0, 1)].kind == "F"


def test_corners_that_parts_list_for_themselves_gave_faces_and_edges_two_names():
    """Slices of a bent tube, rounded and so not quite flat, with shared corners and with a list of corners for each."""
    around = np.arange(8) * np.pi / 4
    radii, heights = 3 + np.cos(around), np.sin(around)
    rings = [np.column_stack([radii * np.cos(t), radii * np.sin(t), heights]).round(2) for t in (0, 0.6, 1.2, 1.8)]
    slices = [np.vstack(pair) for pair in itertools.pairwise(rings)]
    once = Body.from_parts(slices, seed=(0, 0, 0))
    rows = np.arange(48).reshape(3, 16)
    twice = Body.from_parts(np.vstack(slices), parts=rows.tolist(), seed=(0, 0, 0))
    places = [{tuple(body.vertices[v - 1]) for v in face} for body in (once, twice) for face in body.faces]
    assert places[: len(once.faces)] == places[len(once.faces) :]
    for part, other in zip(once.parts, twice.parts, strict=True):
        for kind in "VEF":
            owned = [[body.owns(own) for own in each.elements[kind]] for body, each in ((once, part), (twice, other))]
            assert owned[0] == owned[1]


def test_an_edge_that_goes_on_beyond_its_neighbour_is_named_by_what_is_true_of_it():
    body = Body.from_parts([box((0, 0, 0), (3, 1, 1)), box((0, 1, 0), (1, 3, 1))])  # an L, the seam a third of a side
    ends = {tuple(x): k + 1 for k, x in enumerate(body.vertices.tolist())}
    long, short = (labels(body, part) for part in body.parts)
    assert long["E"][(0, 1, 0), (3, 1, 0)] == Element("E", tuple(sorted((ends[1, 1, 0], ends[3, 1, 0]))))
    assert short["V"][((0, 1, 0),)] == Element("E", tuple(sorted((ends[0, 0, 0], ends[0, 3, 0]))))
    assert short["E"][(0, 1, 0), (1, 1, 0)].kind == "F"


def test_overlapping_parts_name_their_hidden_faces_by_themselves():
    body = Body.from_parts([box((0, 0, 0), (3, 1, 1)), box((1, 0.25, 0.25), (2, 0.75, 0.75))], seed=(1, 0, 0))
    assert len(body.faces) == 6
    assert all(element.vertices not in body.faces for element in body.parts[1].elements["F"])


def test_a_face_that_crosses_an_edge_where_one_looks_makes_it_no_edge_of_the_union():
    """The middle of the third box's edge in the plane z = 1 lies on the side of the first box, which goes through."""
    body = Body.from_parts(
        [box((2, 0, 0), (3, 3, 2)), box((1, 1, 1), (4, 3, 3)), box((1, 0, 1), (3, 2, 2))], seed=(0, 0, 0)
    )
    named = labels(body, body.parts[2])
    assert named["E"][(1, 2, 1), (3, 2, 1)].kind == "F"
    assert named["V"][((1, 2, 1),)].kind == "E"


@runs(15)
@given(generators)
def test_the_order_of_parts_changes_no_label(rng):
    boxes = []
    for _ in range(3):
        low = rng.integers(0, 4, 3)
        boxes.append(box(low, low + rng.integers(1, 4, 3)))
    rows = sorted({tuple(x) for part in boxes for x in part.tolist()})
    parts = [[rows.index(tuple(x)) for x in part.tolist()] for part in boxes]
    one = Body.from_parts(rows, parts=parts, seed=(0, 0, 0))
    two = Body.from_parts(rows, parts=parts[::-1], seed=(0, 0, 0))
    assert set(one.faces) == set(two.faces)
    for first, second in zip(one.parts, two.parts[::-1], strict=True):
        for kind in "VEF":
            assert list(first.elements[kind]) == list(second.elements[kind])


def test_a_body_from_a_mesh_comes_back_from_its_parts_and_faces():
    for name in ("L", "U", "cross", "comb", "stairs"):
        body = Body.from_mesh(*surface_of(VOXELS[name][0]))
        number = {tuple(x): k for k, x in enumerate(body.vertices.tolist())}
        parts = [[number[tuple(x)] for x in part.vertices.tolist()] for part in body.parts]
        faces = [[v - 1 for v in face] for face in body.outlines]
        again = Body.from_parts(body.vertices, parts=parts, faces=faces, seed=body.seed)
        assert again.faces == body.faces
        for one, two in zip(body.parts, again.parts, strict=True):
            named, other = labels(body, one), labels(again, two)
            for kind in "VEF":
                seen = {place for place, element in named[kind].items() if max(element.vertices) <= len(number)}
                assert {place: named[kind][place] for place in seen} == {place: other[kind][place] for place in seen}


def test_a_face_that_a_ring_of_blocks_leaves_free_in_the_middle_is_a_face() -> None:
    """Samples on the ways to its corners were all covered: the step of a stepped hole was taken for a seam."""
    low = [[x, y, z] for x in (1, 4) for y in (-4, 4) for z in (-2, 0)]
    ring = [
        [[x, y, z] for x in xs for y in ys for z in (0, 1)]
        for xs, ys in (((2, 4), (-4, 4)), ((-2, 2), (2, 4)), ((-2, 2), (-4, -2)))
    ]
    body = Body.from_parts([low, *ring], seed=[0, 0, 0])
    top = {k + 1 for k, (x, _, z) in enumerate(body.vertices.tolist()) if z == 0 and x in (1, 4)}
    assert any(top.issubset(face) for face in body.faces)
    covered = Body.from_parts([low, [[x, y, z] for x in (0, 5) for y in (-5, 5) for z in (0, 1)]], seed=[0, 0, 0])
    corners = {tuple(point) for point in low if point[2] == 0}
    named = [{tuple(covered.vertices[v - 1].astype(int).tolist()) for v in face} for face in covered.faces]
    assert not any(corners.issubset(own) for own in named)


@pytest.mark.parametrize(("name", "corners"), [("square_plate.stl", 4), ("hexagon_plate.off", 6)])
def test_a_plate_that_comes_back_from_its_faces_lost_the_rims_of_its_hole(name, corners):
    body = Body.from_file(Path(__file__).parents[2] / "problems" / "meshes" / name, unit="mm")
    number = {tuple(x): k for k, x in enumerate(body.vertices.tolist())}
    parts = [[number[tuple(x)] for x in part.vertices.tolist()] for part in body.parts]
    faces = [[v - 1 for v in face] for face in body.outlines]
    again = Body.from_parts(body.vertices, parts=parts, faces=faces, seed=body.seed)
    assert again.faces == body.faces
    edges = {element.vertices for part in again.parts for element in part.elements["E"] if element.kind == "E"}
    ends = again.vertices[np.array(sorted(edges)) - 1]
    level = np.ptp(ends[..., 2], axis=1) == 0
    inner = (np.linalg.norm(ends[..., :2], axis=2) < 15).all(axis=1)  # the corners of the hole, not of the plate
    assert (level & inner).sum() == 2 * corners
