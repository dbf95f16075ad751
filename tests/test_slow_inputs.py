"""Inputs of which some took minutes, and motions on them that were refused: each is solved, and right."""

from pathlib import Path

import manifold3d
import numpy as np
import pytest

from fcdm_opt import Body, Problem, Rotation, Status, solve
from fcdm_opt.proof.cells import best_site

CASES = Path(__file__).parent / "cases"


def solid(vertices: np.ndarray, faces: np.ndarray) -> manifold3d.Manifold:
    return manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(vertices), faces.astype(np.uint64)))


def from_off(name: str) -> manifold3d.Manifold:
    """Read a mesh of triangles, apart from the package."""
    _, count, *rows = (CASES / name).read_text().splitlines()
    corners, triangles = map(int, count.split()[:2])
    vertices = np.array([row.split() for row in rows[:corners]], dtype=float)
    faces = np.array([row.split()[1:4] for row in rows[corners : corners + triangles]], dtype=int)
    return solid(vertices, faces)


def test_a_thread_is_turned_to_its_first_contact() -> None:
    """One turn of nut and bolt, 576 x 129 parts: each step looked at all pairs of parts, for over 300 s."""
    nut, bolt = (Body.from_file(CASES / name, unit="mm") for name in ("thread_nut.off", "thread_bolt.off"))
    turn = Rotation("z", centre="origin")
    solution = solve(Problem(nut, bolt, target=(1.0, 1.0), goal="touch", motion=turn))
    assert solution.status is Status.SOLVED
    angle = np.degrees(solution.parameters["RZ"])
    raw, other = from_off("thread_nut.off"), from_off("thread_bolt.off")
    before, after = (raw.rotate([0.0, 0.0, share * angle]) for share in (1.0 - 1e-5, 1.0 + 1e-4))
    assert (before ^ other).volume() == 0.0 < before.min_gap(other, 1.0) < 1e-5
    assert (after ^ other).volume() > 0.0
    assert all((raw.rotate([0.0, 0.0, share * angle]) ^ other).volume() == 0.0 for share in np.linspace(0.0, 0.99, 12))
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-5)


def test_edges_parallel_to_rounding_keep_nothing_apart() -> None:
    """Two wedges of threads: the cross product of their parallel edges is rounding, along which no gap is one."""
    angles = np.arange(1, 6) * 0.7
    for seed in range(40):
        rng = np.random.default_rng(seed)
        u = rng.normal(size=3)
        u /= np.linalg.norm(u)
        across = np.linalg.qr(np.column_stack([u, rng.normal(size=(3, 2))]))[0][:, 1:]
        rims = [np.column_stack([np.cos(angles + turn), np.sin(angles + turn)]) @ across.T for turn in rng.random(2)]
        prisms = (np.vstack([rim, rim + length * u]) for rim, length in zip(rims, (1.0, 2.7), strict=True))
        one, two = (Body.convex(points).parts[0] for points in prisms)
        away = 3.0 * across[:, 0] + 0.1 * u
        tables = []
        for part in (one, two):
            points, normals = part.vertices - part.seed, part.normals
            tables.append((points, np.ascontiguousarray(normals), (normals @ points.T).max(axis=1), part.edges))
        gap = best_site(np.eye(3).ravel(), away, *tables, True, np.zeros(16))
        distance = solid_distance(one.vertices - one.seed, two.vertices - two.seed + away)
        assert gap <= distance + 1e-12


def solid_distance(x: np.ndarray, y: np.ndarray) -> float:
    hulls = [manifold3d.Manifold.hull_points(points) for points in (x, y)]
    return float(hulls[0].min_gap(hulls[1], 100.0))
