"""Inputs of which some took minutes, and motions on them that were refused: each is solved, and right."""

from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pytest
import trimesh

from fcdm_opt import Body, Problem, Rotation, Status, Translation, solve
from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt.geometry.facets import surface_distance
from fcdm_opt.judge.certificate import _Judge
from fcdm_opt.proof.cells import best_site
from fcdm_opt.proof.exclusion import Exclusion
from fcdm_opt.stages.order import STAGES

CASES = Path(__file__).parents[1] / "cases"


def solid(vertices: np.ndarray, faces: np.ndarray) -> manifold3d.Manifold:
    return manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(vertices), faces.astype(np.uint64)))


def from_off(name: str) -> manifold3d.Manifold:
    """Read a mesh of triangles, apart from the package."""
    _, count, *rows = (CASES / name).read_text().splitlines()
    corners, triangles = map(int, count.split()[:2])
    vertices = np.array([row.split() for row in rows[:corners]], dtype=float)
    faces = np.array([row.split()[1:4] for row in rows[corners : corners + triangles]], dtype=int)
    return solid(vertices, faces)


@pytest.mark.slow
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


def test_surfaces_straight_across_from_each_other_have_a_distance() -> None:
    """A box about one was to be met by corners just as far from it: rounding left none, and the judge broke down."""
    triangle = np.arange(3)[None]
    for seed in range(200):
        rng = np.random.default_rng(seed)
        here = np.column_stack([np.full(3, rng.normal()), rng.normal(size=(3, 2))])
        there = here + np.array([rng.uniform(1.0, 9.0), 0.0, 0.0])
        assert surface_distance(here, triangle, there, triangle) == pytest.approx(there[0, 0] - here[0, 0], abs=1e-9)



@pytest.mark.parametrize("number", [34, 54, 71, 85, 113, 126, 127, 131, 142, 149])
def test_thin_parts_that_slip_past_each_other_touch_as_drawn(number: int) -> None:
    """A corner on a facet, seeds near its plane: what closes them by 1e-6 of the size moves them far past."""
    rng = np.random.default_rng(number)
    near, deep = 10.0 ** rng.uniform(-4, -1), rng.uniform(0.02, 0.5)
    facet = np.array([(0, 0, 0), (1, 0, 0), (0.3, 0.8, 0)])
    corner = rng.dirichlet([0.3] * 3) @ facet
    others = [corner + np.array([*rng.normal(size=2) * 0.5, rng.uniform(0.02, 0.3)]) for _ in range(2)]
    above = [corner, *others, corner + np.array([*rng.normal(size=2) * 0.3, rng.uniform(0.05, 0.4)])]
    static = Body.convex([*facet, (0.4, 0.3, -deep)], seed=rng.normal(size=3) * [5, 5, near])
    movable = Body.convex(above, seed=rng.normal(size=3) * [5, 5, near])
    solution = solve(Problem(movable, static, target=(1.0, 1.0), goal="touch", motion=Translation("z")))
    assert solution.status is Status.ALREADY_SATISFIED, solution.certificate.failed
    assert {"apart below", "overlapping above"} <= {check.name for check in solution.certificate.checks}


@pytest.mark.slow
def test_a_clearance_nobody_had_proved_took_a_quarter_of_a_minute(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts swollen by their clearance have many times the vertices, and as many cells were looked at as without."""
    rng = np.random.default_rng(0)
    balls = rng.normal(size=(2, 100, 3))
    balls *= 5.0 / np.linalg.norm(balls, axis=2)[..., None]
    movable, static = Body.convex(balls[0]), Body.convex(balls[1] + np.array([9.99, 0.2, 0.1]))
    vertices, reasons = [0], Exclusion.reasons

    def counted(scene: Exclusion, cells: Any, *rest: Any) -> Any:
        each = sum(len(solid[0]) for solid in (*scene.movable, *scene.obstacles))
        vertices[0] += len(cells.faces) * each
        return reasons(scene, cells, *rest)

    monkeypatch.setattr(Exclusion, "reasons", counted)
    motion = Translation("x") >> Rotation("z")
    solution = solve(Problem(movable, static, target=(1.01, 1.01), goal="clear", clearance=6.0, motion=motion))
    assert solution.usable
    assert solution.gap <= 1e-2
    assert vertices[0] < 1e7


@pytest.mark.slow
def test_a_ball_in_its_cup_was_asked_at_every_step_of_every_facet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of hundreds of pairs that touch was looked at where each of as many contacts opens, all pairs of edges."""
    sphere = trimesh.creation.icosphere(subdivisions=2, radius=10.0)
    ball = solid(np.array(sphere.vertices), np.array(sphere.faces))
    cup = manifold3d.Manifold.cube([30.0, 30.0, 13.0]).translate([-15.0, -15.0, -13.0]) - ball
    movable, static = (Body.from_mesh(*revolved(mesh)) for mesh in (ball, cup))
    asked, gaps = [0], _Judge._gaps

    def counted(judge: _Judge, pairs: np.ndarray, *rest: Any) -> list[float]:
        asked[0] += len(pairs)
        return gaps(judge, pairs, *rest)

    monkeypatch.setattr(_Judge, "_gaps", counted)
    motion = Translation("z")
    solution = solve(Problem(movable, static, tolerance=0.005, requirement="A", goal="clear", motion=motion))
    assert solution.status is Status.SOLVED, solution.certificate.failed
    assert len(solution.features) > 10
    assert asked[0] < 8 * len(solution.features)
    rise = solution.parameters["TZ"]
    drawn = (ball, movable.seed), (cup, static.seed)
    made = [mesh.translate(-seed).scale([1.005] * 3).translate(seed) for mesh, seed in drawn]
    assert (made[0].translate([0.0, 0.0, rise]) ^ made[1]).volume() <= 1e-9
    assert (made[0].translate([0.0, 0.0, rise - 1e-4]) ^ made[1]).volume() > 1e-6


@pytest.mark.slow
def test_a_shaft_in_a_bore_of_other_sides_went_to_the_nonlinear_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 48 part pairs it tried dozens of starts and choices, for minutes; a descent from a contact ends at once."""

    def program(task: Any) -> Any:
        raise AssertionError

    monkeypatch.setitem(STAGES, "nlp", program)
    shaft = manifold3d.Manifold.cylinder(30.0, 10.0, 10.0, 64).translate([0.0, 0.0, -5.0])
    bore = manifold3d.Manifold.cylinder(27.0, 10.0, 10.0, 48).translate([0.0, 0.0, -1.0])
    plate = manifold3d.Manifold.cube([50.0, 50.0, 25.0]).translate([-25.0, -25.0, 0.0]) - bore
    movable, static = (Body.from_mesh(*revolved(mesh)) for mesh in (shaft, plate))
    assert len(static.parts) == 48
    motion = Translation("x") >> Translation("y") >> Translation("z")
    solution = solve(Problem(movable, static, target=(1.02, 1.02), goal="clear", motion=motion))
    assert solution.status is Status.OUTSIDE_FIT
    top = movable.seed[2] + 1.02 * (25.0 - movable.seed[2])
    bottom = static.seed[2] - 1.02 * static.seed[2]
    assert solution.parameters["TZ"] == pytest.approx(bottom - top, abs=1e-6)


def revolved(mesh: manifold3d.Manifold) -> tuple[np.ndarray, np.ndarray]:
    made = mesh.to_mesh64()
    return np.asarray(made.vert_properties)[:, :3], np.asarray(made.tri_verts).astype(np.int64)


def test_a_vertex_of_a_fine_ball_on_an_edge_is_a_contact() -> None:
    """Only normals of faces were tried for large parts: none of them keeps these apart, a pair of edges does."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=4.0)
    movable = Body.from_mesh(np.array(ball.vertices) + np.array([0.0, -11.3, 0.0]), np.array(ball.faces))
    static = Body.from_mesh(*revolved(manifold3d.Manifold.cylinder(20.0, 7.0, 7.0, 48).translate([0.0, 0.0, -10.0])))
    motion = Translation("y")
    solution = solve(Problem(movable, static, tolerance=0.005, requirement="B", goal="touch", motion=motion))
    assert solution.status is Status.SOLVED, solution.certificate.failed
    assert solution.parameters["TY"] == pytest.approx(11.3 - 1.005 * 4.0 - 0.995 * 7.0, abs=1e-12)


def test_the_distance_of_a_cone_of_many_sides_from_a_large_ball_is_known() -> None:
    """coal takes no such cone, and pairs of edges are too many: nothing was said even of what is far apart."""
    angles = np.arange(300) * (2 * np.pi / 300)
    cone = Body.convex([*np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles]), (0, 0, 1)], seed=[0, 0, 0])
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=1.0)
    ball = Body.convex(np.array(sphere.vertices) + np.array([0.0, 0.0, 4.0]), seed=[0, 0, 4])
    lowest = ball.vertices[:, 2].min()
    assert ScaledPair(cone, ball).signed_distance((1.0, 1.0), np.eye(4)) == pytest.approx(lowest - 1.0, abs=1e-12)


@pytest.mark.slow
def test_a_screw_in_its_nut_touches_where_dozens_of_facets_are_near() -> None:
    """Facets nearly as near as those that touch open at other changes of the sizes, and need not open at these."""
    turns, made = np.arange(24) * np.pi / 12, []
    for radius in (6.0, 6.05):
        rim = np.column_stack([np.cos(turns), np.sin(turns)]) * (radius + 0.5 * np.cos(turns))[:, None]
        made.append(manifold3d.CrossSection([rim]).extrude(10.0, 60, 1800.0))
    screw, hole = made
    nut = manifold3d.Manifold.cube([20.0, 20.0, 6.0]).translate([-10.0, -10.0, 2.0]) - hole
    (points, faces), (others, sides) = revolved(screw), revolved(nut)
    movable, static = Body.from_mesh(points, faces), Body.from_mesh(others, sides)
    motion = Translation("z")
    solution = solve(Problem(movable, static, tolerance=0.001, requirement="D", goal="touch", motion=motion))
    assert solution.status is Status.SOLVED, solution.certificate.failed
    rho = solution.pair
    one = solid(movable.seed + rho[0] * (points - movable.seed) + solution.transform[:3, 3], faces)
    other = solid(static.seed + rho[1] * (others - static.seed), sides)
    assert one.min_gap(other, 1.0) <= 1e-9
    assert (one ^ other).volume() <= 1e-9
