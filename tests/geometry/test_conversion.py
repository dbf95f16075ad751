"""`as_body`: the same solid from every form that other libraries give it."""

from __future__ import annotations

import itertools

import coal
import numpy as np
import pytest
import trimesh

import fcdm_opt as fo
from fcdm_opt.errors import InputError

CUBE = np.array(list(itertools.product([0.0, 1.0], repeat=3)))
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = np.array([(a, b, c) for p, q, r, s in QUADS for a, b, c in ((p, q, r), (p, r, s))])
BOX = CUBE * [1, 2, 3] + 5


def vectors(points):
    made = coal.StdVec_Vec3s()
    made.extend(list(np.array(points, float)))
    return made


def bvh(points, triangles, kind=coal.BVHModelOBBRSS):
    model, rows = kind(), coal.StdVec_Triangle()
    rows.extend([coal.Triangle(*map(int, row)) for row in triangles])
    model.beginModel(len(triangles), len(points))
    model.addSubModel(vectors(points), rows)
    model.endModel()
    return model


FORMS = {
    "trimesh": lambda: trimesh.Trimesh(BOX, TRIANGLES),
    "trimesh, as it is": lambda: trimesh.Trimesh(BOX, TRIANGLES, process=False),
    "a primitive of trimesh": lambda: trimesh.primitives.Box(bounds=[[5, 5, 5], [6, 7, 8]]),
    "vertices and faces": lambda: (BOX, QUADS),
    "a list of both": lambda: [BOX.tolist(), TRIANGLES],
    "coal.Convex": lambda: coal.Convex.convexHull(vectors(BOX), True, "Qt"),
    "coal.Convex of a box": lambda: coal.Convex.convexHull(vectors([*BOX, BOX.mean(axis=0)]), True, "Qt"),
    "coal.BVHModelOBBRSS": lambda: bvh(BOX, TRIANGLES),
    "coal.BVHModelOBB": lambda: bvh(BOX, TRIANGLES, coal.BVHModelOBB),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_is_the_same_body(form):
    body = fo.as_body(FORMS[form](), name="lid")
    assert body.name == "lid"
    assert len(body.parts) == 1
    used = sorted(map(tuple, body.parts[0].vertices.tolist()))
    assert used == sorted(map(tuple, BOX.tolist()))
    assert len(body.faces) == 6
    np.testing.assert_allclose(body.seed, [5.5, 6, 6.5], rtol=1e-14)
    np.testing.assert_array_equal(fo.as_body(FORMS[form](), seed=(1, 2, 3)).seed, [1, 2, 3])


def test_numbers_of_vertices_are_kept():
    order = np.random.default_rng(0).permutation(8)
    faces = [tuple(np.argsort(order)[list(face)]) for face in QUADS]
    for made in ((BOX[order], faces), bvh(BOX[order], np.argsort(order)[TRIANGLES])):
        np.testing.assert_array_equal(fo.as_body(made).vertices, BOX[order])


def test_a_body_comes_back_as_it_is():
    body = fo.Body.convex(BOX, name="lid")
    assert fo.as_body(body, name="other", seed="box") is body


def test_a_mesh_that_is_not_convex_is_decomposed():
    ends = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    points = np.array([(x, y, z) for z in (0.0, 1.0) for x, y in ends])
    faces = [tuple(range(6))[::-1], tuple(range(6, 12)), *((k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6) for k in range(6))]
    body = fo.as_body((points, faces), decomposition="exact")
    assert len(body.parts) == 2
    assert len(body.faces) == 8


def test_the_original_is_not_changed_or_frozen():
    mesh = trimesh.Trimesh(BOX, TRIANGLES, process=False)
    points = np.array(BOX)
    fo.as_body(mesh), fo.as_body((points, TRIANGLES))
    points[0] = 0
    mesh.vertices[0] = 0


@pytest.mark.parametrize(
    ("x", "message"),
    [
        (None, "cannot be made a body: builtins.NoneType; allowed: a Body, a trimesh.Trimesh"),
        ("lid.stl", r"builtins.str.*Body.from_file\(path, unit="),
        (BOX, "numpy.ndarray"),
        ((BOX,), "builtins.tuple"),
        (trimesh.Scene(), "Scene"),
        (coal.Box(1, 1, 1), "coal"),
        ((BOX, QUADS[:5]), "the surface is not closed"),
        (trimesh.Trimesh(BOX, TRIANGLES[:-1], process=False), "the surface is not closed"),
        ((QUADS, BOX), r"vertices must be an \(n, 3\) array"),
    ],
)
def test_anything_else_is_refused_by_name(x, message):
    with pytest.raises(InputError, match=message) as caught:
        fo.as_body(x, name="lid")
    assert "body 'lid'" in str(caught.value)
