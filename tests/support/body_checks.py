"""What holds of every convex part, and of a body beside its exact hull."""

from __future__ import annotations

import numpy as np
from oracles import hull

from fcdm_opt.geometry.bodies import Body, ConvexPart


def check_consistent(part: ConvexPart) -> None:
    """Closed surface of convex faces: Euler's formula, half-edges, outward unit normals, packed tables."""
    n, m, f = len(part.vertices), len(part.edges), len(part.loops)
    assert n - m + f == 2
    half = part.half_edges
    origin, face, twin, following = half.T
    assert len(half) == 2 * m == sum(map(len, part.loops))
    np.testing.assert_array_equal(twin[twin], np.arange(2 * m))
    np.testing.assert_array_equal(face[following], face)
    np.testing.assert_array_equal(origin[following], origin[twin])
    assert sorted(following) == list(range(2 * m))
    for loop in range(f):
        start = int(np.flatnonzero(face == loop)[0])
        walked, at = [], start
        while not walked or at != start:
            walked.append(int(origin[at]))
            at = int(following[at])
        k = walked.index(part.loops[loop][0])
        assert tuple(walked[k:] + walked[:k]) == part.loops[loop]
    np.testing.assert_allclose(np.linalg.norm(part.normals, axis=1), 1, rtol=1e-14)
    centre = part.vertices.mean(axis=0)
    for loop, normal in zip(part.loops, part.normals, strict=True):
        assert normal @ (part.vertices[loop[0]] - centre) > 0
    np.testing.assert_array_equal(part.edges[:, :2], half[::2, 0][:, None] * [1, 0] + half[1::2, 0][:, None] * [0, 1])


def check_against_exact(body: Body, rows: list[tuple[int, ...]]) -> None:
    solid = hull(dict(enumerate(rows)))
    (part,) = body.parts
    label = {tuple(x): k + 1 for k, x in reversed(list(enumerate(body.vertices.tolist())))}
    name = [label[tuple(x)] for x in part.vertices.tolist()]
    assert sorted(name) == [row + 1 for row in sorted(solid.vertices)]
    expected = sorted(tuple(sorted(row + 1 for row in face)) for face in solid.facets.values())
    assert sorted(body.faces) == expected
    assert sorted(tuple(sorted(name[v] for v in loop)) for loop in part.loops) == expected
    edges = sorted(tuple(sorted((name[a], name[b]))) for a, b in part.edges[:, :2])
    assert edges == sorted((a + 1, b + 1) for a, b in solid.edges)
    assert [e.vertices for e in part.elements["V"]] == [(k,) for k in name]
    assert [e.vertices for e in part.elements["E"]] == [tuple(sorted((name[a], name[b]))) for a, b in part.edges[:, :2]]
    assert [e.vertices for e in part.elements["F"]] == [tuple(sorted(name[v] for v in loop)) for loop in part.loops]
