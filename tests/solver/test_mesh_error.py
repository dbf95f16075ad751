"""What facets of round faces leave open of an answer: amounts of closed forms lie in it, plane faces leave nothing."""

from __future__ import annotations

import json
import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from step_bodies import PLATE, SIDES, read, run

import fcdm_opt as fo
from fcdm_opt.geometry.facet_errors import bounding_bodies, facet_errors
from fcdm_opt.show.assemblies import assembly_verdict
from fcdm_opt.show.remarks import remarks
from fcdm_opt.show.verdict import verdict_text
from fcdm_opt_benchmarks.step_files import cylinder, polyhedron, revolved

TAPER, WIDE, LONG, LARGER = 1.0 / 20.0, 9.0, 40.0, 1.001
STICKS_OUT = WIDE * (LARGER - 1.0) / TAPER  # of cones with radii 9 s + z / 20 and 9 + z / 20
Z = fo.Translation("z")


def about_z(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def ring(radius: float, count: int, z: float, phase: float = 0.0) -> np.ndarray:
    angles = 2.0 * np.pi * (np.arange(count) + phase) / count
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(count, z)])


def frustum(count: int, phase: float = 0.0) -> fo.Body:
    ends = [ring(WIDE + TAPER * z, count, z, phase) for z in (0.0, LONG)]
    return fo.Body.convex(np.vstack(ends), seed=np.zeros(3), name="plug")


def bored(low: float, high: float, outer: float, count: int, length: float = LONG) -> fo.Body:
    rings = [ring(r, count, z) for z, r in ((0.0, low), (0.0, outer), (length, high), (length, outer))]
    sectors = [np.vstack([own[[k, (k + 1) % count]] for own in rings]) for k in range(count)]
    return fo.Body.from_parts(sectors, seed=np.zeros(3), name="socket")


def holds(solution: fo.Solution, truth: float) -> bool:
    return solution.amount_low <= truth * (1.0 + 1e-9) and truth * (1.0 - 1e-9) <= solution.amount_high


def taper_of_step_files(folder: Path) -> tuple[fo.Body, fo.Body]:
    """The socket turned by a third of a facet: their meshes are out of phase."""
    top = WIDE + TAPER * LONG
    shape = revolved([(0, 0), (WIDE, 0), (top, LONG), (0, LONG)], np.eye(3))
    plug = read(folder, shape, seed=[0, 0, 0], deviation=0.1, name="plug")
    profile = [(WIDE, 0), (16, 0), (16, LONG), (top, LONG)]
    kept = {"deviation": 0.1, "decomposition": "surface"}
    socket = read(folder, revolved(profile, about_z(0.07)), seed=[0, 0, 0], name="socket", **kept)
    return plug, socket


@pytest.mark.slow
def test_a_taper_from_step_files_is_proved_of_its_cones(tmp_path: Path) -> None:
    plug, socket = taper_of_step_files(tmp_path)
    solution = fo.solve(fo.Problem(plug, socket, target=(LARGER, 1.0), motion=Z, goal="clear", unit="mm"))
    assert solution.usable
    assert solution.amount == pytest.approx(STICKS_OUT, rel=1e-9)
    assert solution.amount_low == pytest.approx(solution.amount, rel=1e-4)
    assert solution.amount_high == solution.amount
    assert "smallest possible (proved)" in verdict_text(solution)


@pytest.mark.slow
@pytest.mark.parametrize(("count", "phase"), [(24, 0.5), (32, 0.0)])
def test_a_taper_of_facets_is_not_proved_of_them(count: int, phase: float) -> None:
    plug, socket = frustum(count, phase), bored(WIDE, WIDE + TAPER * LONG, 16.0, count)
    solution = fo.solve(fo.Problem(plug, socket, target=(LARGER, 1.0), motion=Z, goal="clear", unit="mm"))
    assert holds(solution, STICKS_OUT)
    if phase:  # else facets and corners are over one another, and scale as the cones do
        assert not holds(replace(solution, amount_low=solution.amount), STICKS_OUT)
    assert "smallest possible" not in verdict_text(solution)


def test_balls_apart_touch_between_what_larger_and_smaller_ones_do() -> None:
    ball = trimesh.creation.icosphere(2, 5.0)
    vertices = np.array(ball.vertices) @ about_z(0.1).T @ np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    body = fo.Body.convex(vertices + np.array([0.0, 0.0, 6.0]), seed=[0, 0, 6], name="ball")
    plate = fo.Body.convex(PLATE - [0.0, 0.0, 10.0], name="plate")
    solution = fo.solve(fo.Problem(body, plate, target=(1.0, 1.0), motion=Z, goal="touch"))
    assert holds(solution, 1.0)
    assert solution.amount > 1.0  # facets fall short of the ball
    assert solution.amount_low < solution.amount == pytest.approx(solution.amount_high)


@pytest.mark.slow
def test_round_faces_away_from_the_contact_leave_nothing_open(tmp_path: Path) -> None:
    """A pin 1 above a plate with a bore elsewhere: its plane end meets the plane top."""
    text = cylinder(3.0, 8.0, np.eye(3))
    pin = read(tmp_path, text, name="pin").moved(np.array([[1, 0, 0, 15], [0, 1, 0, 15], [0, 0, 1, 11], [0, 0, 0, 1]]))
    plate = read(tmp_path, polyhedron(PLATE, SIDES, "mm", bore=10.0), name="plate")
    solution = fo.solve(fo.Problem(pin, plate, target=(1.0, 1.0), motion=Z, goal="touch"))
    assert solution.amount == pytest.approx(1.0)
    assert solution.amount_low == solution.amount == solution.amount_high
    assert "smallest possible (proved)" in verdict_text(solution)


def test_parts_with_plane_faces_leave_nothing_open() -> None:
    """An octagon and a shaft with a flat are no round faces; what is told of them is as ever."""
    nut = fo.Body.convex(np.vstack([ring(4.0, 8, z) for z in (1.0, 5.0)]), name="nut")
    plate = fo.Body.convex(PLATE - [0.0, 0.0, 10.0], name="plate")
    solution = fo.solve(fo.Problem(nut, plate, target=(1.0, 1.0), motion=Z, goal="touch"))
    assert solution.amount_low == solution.amount == solution.amount_high
    assert "smallest possible (proved)" in verdict_text(solution)
    assert not any(check.name == "amount the mesh allows" for check in solution.certificate.checks)


def test_a_flat_on_a_shaft_is_not_taken_for_a_piece_of_it() -> None:
    angles = np.linspace(0.35, 2 * math.pi - 0.35, 61)
    outline = 10.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    shaft = fo.Body.convex(np.vstack([np.column_stack([outline, np.full(61, z)]) for z in (0.0, 30.0)]))
    errors, (normals, _) = facet_errors(shaft), shaft.face_planes
    (flat,) = np.flatnonzero(normals[:, 0] > 0.999999)
    assert not errors[flat].any()
    sagitta = 10.0 * (1.0 - math.cos(math.radians((2 * math.pi - 0.7) / 60 * 90 / math.pi)))
    sides = np.flatnonzero((np.abs(normals[:, 2]) < 0.5) & (normals[:, 0] < 0.999999))
    np.testing.assert_allclose(errors[sides, 1], sagitta, rtol=1e-6)
    np.testing.assert_array_equal(errors[:, 0], 0.0)


def test_a_quarter_of_a_cylinder_is_round_on_a_body_of_few_faces() -> None:
    """Six facets of 15 degrees and four plane faces: fewer faces than a whole turn of facets has."""
    angles = np.linspace(0.0, math.pi / 2, 7)
    outline = np.vstack([[0.0, 0.0], 10.0 * np.column_stack([np.cos(angles), np.sin(angles)])])
    sector = fo.Body.convex(np.vstack([np.column_stack([outline, np.full(8, z)]) for z in (0.0, 5.0)]))
    errors, (normals, _) = facet_errors(sector), sector.face_planes
    round_ones = (normals > 0.05).sum(axis=1) == 2
    assert round_ones.sum() == 6
    np.testing.assert_allclose(errors[round_ones, 1], 10.0 * (1.0 - math.cos(math.radians(7.5))), rtol=1e-9)
    assert not errors[~round_ones].any()
    assert not errors[:, 0].any()


SOLIDS = {
    "cylinder": ([(0, 0), (6, 0), (6, 20), (0, 20)], 36 * math.pi * 20),
    "cone": ([(0, 0), (8, 0), (4, 12), (0, 12)], math.pi * 12 * (64 + 32 + 16) / 3),
    "tube": ([(4, 0), (9, 0), (9, 15), (4, 15)], math.pi * (81 - 16) * 15),
    "dome": ([(0, 0), (10, 0, 0, 0), (0, 10)], 2 * math.pi * 1000 / 3),
    "rounded": ([(0, 0), (10, 0), (10, 5, 7, 5), (7, 8), (0, 8)], None),
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("kind", "decomposition"),
    [("cylinder", "auto"), ("tube", "auto"), ("rounded", "auto"), ("cone", "surface"), ("dome", "surface"),
     ("tube", "surface")],
)  # fmt: skip
def test_the_true_body_lies_between_both(tmp_path: Path, kind: str, decomposition: str) -> None:
    profile, volume = SOLIDS[kind]
    body = read(tmp_path, revolved(profile, np.eye(3)), deviation=0.1, decomposition=decomposition)
    inner, outer = bounding_bodies(body)

    def held(own: fo.Body) -> float:
        corners, _ = own.face_triangles
        if own.triangles or len(own.parts) == 1:
            return float(np.linalg.det(corners).sum()) / 6.0
        volumes = [part.volume_and_centroid[0] for part in own.parts]
        return max(volumes) if "overlap" in body.notes[0] else sum(volumes)  # each nearly the whole

    low, mesh, high = map(held, (inner, body, outer))
    assert low <= mesh <= high
    if volume is not None:
        assert low <= volume <= high
        assert high - low < 0.08 * volume
    corners = body.vertices[: len(body.vertices)]
    assert (outer.vertices.max(axis=0) >= corners.max(axis=0) - 1e-9).all()


def arc(u: float, h: float, radius: float, start: float, end: float, count: int) -> list[tuple[float, float]]:
    return [(u + radius * math.cos(t), h + radius * math.sin(t)) for t in np.linspace(start, end, count)]


TORI = {
    "ring": (arc(10, 0, 3, 0, 2 * np.pi, 25), 2 * math.pi**2 * 10 * 9),
    # pi times (20^2 5 + 10^2 15) and what the fillet of 3 leaves of a square turned about its centre, by Pappus
    "collar": (
        [(0, 0), (20, 0), (20, 5), *arc(13, 8, 3, -np.pi / 2, -np.pi, 7), (10, 20), (0, 20)],
        math.pi * (2000 + 1500) + 2 * math.pi * (9 * 11.5 - 9 * math.pi / 4 * (13 - 4 * 3 / (3 * math.pi))),
    ),
    "rounded": (
        [(0, 0), (10, 0), *arc(8, 8, 2, 0, np.pi / 2, 6), (0, 10)],
        math.pi * 100 * 10 - 2 * math.pi * (4 * 9 - math.pi * (8 + 4 * 2 / (3 * math.pi))),
    ),
}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("kind", TORI)
def test_fillets_of_plain_meshes_count_as_tori(tmp_path: Path, kind: str, single: bool) -> None:
    """They counted as exact, so that what the mesh leaves open was told too narrow."""
    profile, volume = TORI[kind]
    mesh = trimesh.creation.revolve(np.array(profile), sections=24)
    mesh.apply_transform(trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.5, 0.8])))
    if single:
        mesh.export(tmp_path / "part.stl")
        body = fo.Body.from_file(tmp_path / "part.stl", unit="mm", decomposition="surface")
    else:
        body = fo.Body.from_mesh(mesh.vertices, mesh.faces, decomposition="surface")
    errors = facet_errors(body)
    fillet = 24 * (sum(math.isclose(math.hypot(u - 13, h - 8), 3.0) for u, h in profile) - 1)
    assert errors.any(axis=1).sum() == {"ring": 24 * 24, "collar": fillet + 48, "rounded": 24 * 6}[kind]
    inner, outer = (np.linalg.det(own.face_triangles[0]).sum() / 6.0 for own in bounding_bodies(body))
    assert inner < volume < outer
    assert inner < mesh.volume < outer


@pytest.mark.slow
def test_a_ring_on_its_side_touches_where_its_torus_may() -> None:
    mesh = trimesh.creation.revolve(np.array(arc(10, 0, 3, 0, 2 * np.pi, 13)), sections=16)
    turned = np.array(mesh.vertices) @ about_z(math.pi / 16).T
    body = fo.Body.from_mesh(turned[:, [0, 2, 1]], np.array(mesh.faces)[:, ::-1], seed=[0, 0, 0], name="ring")
    plate = fo.Body.convex(PLATE - np.array([0.0, 0.0, 24.0]), name="plate")
    solution = fo.solve(fo.Problem(body, plate, target=(1.0, 1.0), motion=Z, goal="touch"))
    assert solution.amount == pytest.approx(14.0 - 13.0 * math.cos(math.pi / 16))
    assert holds(solution, 1.0)
    assert solution.amount_low < 1.0 + 1e-9
    assert "smallest possible" not in verdict_text(solution)


@pytest.mark.parametrize("count", [16, 32])
def test_an_elliptic_shaft_of_facets_counted_as_exact(count: int) -> None:
    """It is lowered onto a table, on its side: its half width across is sqrt((a sin t)^2 + (b cos t)^2)."""
    angles, turn = 2.0 * np.pi * np.arange(count) / count, 0.6
    x, y = 10.0 * np.cos(angles), 6.0 * np.sin(angles)
    across = np.column_stack([x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)])
    corners = [np.column_stack([across[:, 0], np.full(count, end), across[:, 1]]) for end in (0.0, 20.0)]
    shaft, table = fo.Body.convex(np.vstack(corners), seed=np.zeros(3)), fo.Body.convex(PLATE - [0.0, 0.0, 30.0])
    solution = fo.solve(fo.Problem(shaft, table, target=(1.0, 1.0), motion=Z, goal="touch"))
    top = float(table.vertices[:, 2].max())
    truth = -top - math.hypot(10.0 * math.sin(turn), 6.0 * math.cos(turn))
    assert holds(solution, truth)
    assert solution.amount > truth + 1e-3
    assert solution.amount_low > truth - 0.4 * (16.0 / count) ** 2  # twice its largest sagitta
    assert facet_errors(shaft).any(axis=1).sum() == count


def test_the_flanks_of_a_gear_counted_as_exact() -> None:
    """An involute of facets falls short of it by their sagitta; the land between two does not count."""
    base, angles = 10.0, np.linspace(0.3, 0.9, 7)
    flank = base * np.column_stack([np.cos(angles) + angles * np.sin(angles), np.sin(angles) - angles * np.cos(angles)])
    outline = np.vstack([flank, flank[::-1] * [1.0, -1.0] + [0.0, 10.0]])
    corners = np.vstack([np.column_stack([outline, np.full(14, z)]) for z in (0.0, 5.0)])
    sides = [[k, (k + 1) % 14, 14 + (k + 1) % 14, 14 + k] for k in range(14)]
    body = fo.Body.from_mesh(corners, [[*range(14)][::-1], [*range(14, 28)], *sides], seed=np.zeros(3))
    errors = facet_errors(body)
    assert errors.any(axis=1).sum() == 12
    middle = (angles[1:] + angles[:-1]) / 2.0
    curve = base * np.column_stack([np.cos(middle) + middle * np.sin(middle), np.sin(middle) - middle * np.cos(middle)])
    steps, off = np.diff(flank, axis=0), curve - (flank[1:] + flank[:-1]) / 2.0
    sagittae = np.abs(steps[:, 0] * off[:, 1] - steps[:, 1] * off[:, 0]) / np.linalg.norm(steps, axis=1)
    found = np.sort(errors[errors.any(axis=1), 1])[::2]
    assert (found > sagittae).all()
    assert (found < 2.0 * sagittae).all()


def profile_of(outline: Any, height: float = 6.0) -> fo.Body:
    """A prism over a polygon, (n, 2), counter-clockwise."""
    ends = [np.column_stack([outline, np.full(len(outline), z)]) for z in (0.0, height)]
    n = len(outline)
    sides = [[k, (k + 1) % n, n + (k + 1) % n, n + k] for k in range(n)]
    return fo.Body.from_mesh(
        np.vstack(ends), [[*range(n)][::-1], [*range(n, 2 * n)], *sides], seed=np.zeros(3), decomposition="surface"
    )


def sheet(steps: list[tuple[float, float]], count: int) -> np.ndarray:
    """A block below a line of slopes in degrees and lengths, again and again."""
    turns, lengths = np.array([steps[k % len(steps)] for k in range(count)]).T
    ways = lengths[:, None] * np.column_stack([np.cos(np.radians(turns)), np.sin(np.radians(turns))])
    top = np.vstack([[0.0, 0.0], np.cumsum(ways, axis=0)])
    return np.vstack([[0.0, -10.0], [top[-1, 0], -10.0], top[::-1]])


def chords(ratio: float, count: int) -> np.ndarray:
    return np.cumsum([0.0, *np.where(np.arange(count) % 2, 1.0, ratio)]) / (count // 2 * (1.0 + ratio))


SMOOTH = {  # a curve from right to left, and where facets meet on it
    "one wave": (lambda u: (10 - 20 * u, 1.5 * np.cos(2 * np.pi * u)), np.linspace(0, 1, 11)),
    "an S of 5 facets": (lambda u: (10 - 20 * u, 1.6 * (2 * u - 1) ** 3), np.linspace(0, 1, 6)),
    "uneven chords": (lambda u: (10 * np.cos(np.pi * u), 5 * np.sin(np.pi * u)), chords(3.0, 24)),
    "uneven chords on a circle": (lambda u: (10 * np.cos(np.pi * u), 10 * np.sin(np.pi * u)), chords(2.5, 24)),
    "a wave of uneven chords": (lambda u: (10 - 20 * u, 1.5 * np.cos(2 * np.pi * u)), chords(2.0, 12)),
}


@pytest.mark.parametrize("kind", SMOOTH)
def test_waves_and_uneven_chords_counted_as_exact(kind: str) -> None:
    curve, places = SMOOTH[kind]
    points = np.column_stack(curve(places))
    body = profile_of(np.vstack([[-10.0, -8.0], [10.0, -8.0], points]))
    errors, (normals, _) = facet_errors(body).max(axis=1), body.face_planes
    for a, b, u, v in zip(points[:-1], points[1:], places[:-1], places[1:], strict=True):
        way = (b - a) / np.linalg.norm(b - a)
        truth = np.abs((np.column_stack(curve(np.linspace(u, v, 33))) - a) @ [-way[1], way[0]]).max()
        face = int((normals[:, :2] @ [way[1], -way[0]]).argmax())
        assert errors[face] >= 0.99 * truth
    blocks = (np.abs(normals) > 1 - 1e-9).any(axis=1)
    assert not errors[blocks].any()


@pytest.mark.parametrize(("fineness", "share"), [(2, 0.5), (3, 0.8)])
def test_scans_with_noise_counted_as_exact(fineness: int, share: float) -> None:
    """A ball whose corners are off by a share of what its facets are."""
    mesh, random = trimesh.creation.icosphere(fineness, 10.0), np.random.default_rng(5)
    off = 10.0 - float(np.linalg.norm(mesh.triangles_center, axis=1).mean())
    corners = mesh.vertices * (1.0 + share * off / 10.0 * random.normal(size=(len(mesh.vertices), 1)))
    errors = facet_errors(fo.Body.from_mesh(corners, mesh.faces, decomposition="surface"))
    assert (errors.max(axis=1) > 0.5 * off).mean() > 0.9


def test_a_free_form_edge_between_large_planes_counted_as_exact() -> None:
    angles = np.linspace(0.0, np.pi / 2, 6)
    body = profile_of([(0, 0), (20, 0), *zip(16 + 4 * np.cos(angles), 10 + 2 * np.sin(angles), strict=True), (0, 12)])
    errors, (normals, _) = facet_errors(body), body.face_planes
    np.testing.assert_array_equal(errors.any(axis=1), (normals[:, :2] > 1e-9).all(axis=1))


FLAT = {
    "trapezoids": sheet([(0, 2), (20, 2), (0, 2), (-20, 2)], 12),
    "zigzag": sheet([(10, 2), (-10, 2)], 10),
    "ramps": sheet([(0, 4), (8, 5), (18, 6), (4, 3), (-10, 5), (-2, 6)], 6),
    "two chamfers": [(0, 0), (6, 0), (6, 3.634), (5.5, 4.5), (4.634, 5), (0, 5)],
}


@pytest.mark.parametrize("kind", FLAT)
def test_polygons_that_turn_gently_are_not_taken_for_smooth_ones(kind: str) -> None:
    """Trapezoids and ramps were: each of their turns is like one next to it."""
    assert not facet_errors(profile_of(FLAT[kind])).any()


@pytest.mark.parametrize("kind", ["ball", "cloud"])
def test_bodies_with_blunt_corners_are_not_taken_for_smooth_ones(kind: str) -> None:
    random = np.random.default_rng(3)
    for _ in range(4):
        points = random.normal(size=(40, 3)) if kind == "cloud" else random.uniform(-1.0, 1.0, (40, 3))
        assert not facet_errors(fo.Body.convex(points)).any()


def test_an_ellipsoid_of_triangles_counted_as_exact() -> None:
    """Its height along a direction n is |D n|, D the half axes."""
    mesh, axes = trimesh.creation.icosphere(subdivisions=2), np.array([10.0, 7.0, 5.0])
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.7, 0.4]))[:3, :3]
    body = fo.Body.convex(mesh.vertices * axes @ turn.T, seed=np.zeros(3))
    errors = facet_errors(body)
    assert (errors[:, 1] > 0.0).all()
    table = fo.Body.convex(PLATE - [0.0, 0.0, 30.0])
    solution = fo.solve(fo.Problem(body, table, target=(1.0, 1.0), motion=Z, goal="touch"))
    assert holds(solution, -float(table.vertices[:, 2].max()) - float(np.linalg.norm(axes * turn[2])))


def test_line_to_line_is_left_open() -> None:
    """A shaft in a bore of its diameter, out of phase: the facets overlap, the cylinders touch all round."""
    shaft = fo.Body.convex(np.vstack([ring(10.0, 32, z, 0.5) for z in (-5.0, 45.0)]), name="shaft")
    solution = fo.solve(fo.Problem(shaft, bored(10.0, 10.0, 20.0, 32), target=(1.0, 1.0), motion=fo.Translation("x")))
    words = verdict_text(solution)
    assert solution.amount_low == 0.0
    assert "their curved faces are facets here" in words


def shaft_in_a_bush(radius: float, bore: float) -> fo.Problem:
    """Return how a shaft of facets is to be cleared across its axis of a bush of facets out of phase."""
    shaft = fo.Body.convex(np.vstack([ring(radius, 32, z, 0.5) for z in (-5.0, 45.0)]), name="shaft")
    bush, x = bored(bore, bore, 20.0, 32), fo.Translation("x")
    return fo.Problem(shaft, bush, target=(1.0, 1.0), motion=x, goal="clear", limits={"TX": (-1.0, 1.0)})


@pytest.mark.slow
def test_facets_that_do_not_fit_are_no_proof_for_round_parts() -> None:
    """The cylinders have .02 of play, their facets overlap by up to .048 - .02; it was "impossible (proved)"."""
    problem = shaft_in_a_bush(9.98, 10.0)
    for effort in ("proved", "quick"):
        solution = fo.solve(problem, effort=effort)
        assert solution.status in (fo.Status.INFEASIBLE, fo.Status.OUTSIDE_FIT)
        words = verdict_text(solution)
        assert "proved" not in words
        assert ("true parts may fit: their curved faces are facets here" in words) == (effort == "proved")
        assert ("what true parts need is not known" in words) == (effort == "quick")
        assert "Proved" not in solution.advice
        assert math.isnan(solution.amount_low) == (effort == "quick")
    tight = fo.solve(shaft_in_a_bush(10.2, 10.0))  # no cylinders either
    assert not tight.usable
    assert tight.amount_low == tight.amount_high == math.inf
    assert "mesh" not in verdict_text(tight)
    assert fo.Solution.from_dict(json.loads(json.dumps(tight.to_dict()))).amount_low == math.inf


def test_a_press_fit_that_no_smaller_parts_mend_passes_the_judge() -> None:
    """A motion out of the fit is no answer: that smaller cylinders do not fit either does not contradict it."""
    shaft = fo.Body.convex(np.vstack([ring(10.2, 32, z) for z in (-5.0, 45.0)]), name="shaft")
    bush = bored(10.0, 10.0, 20.0, 32)
    solution = fo.solve(fo.Problem(shaft, bush, target=(1.0, 1.0), motion=fo.Translation("x"), goal="clear"))
    assert solution.status is fo.Status.OUTSIDE_FIT
    assert solution.amount < solution.amount_low == math.inf
    assert fo.verify(solution).passed
    assert not fo.verify(replace(solution, amount_low=0.0, amount_high=1.0)).passed


@pytest.mark.slow
def test_what_the_mesh_leaves_open_is_stored_and_judged() -> None:
    plug, socket = frustum(24, 0.5), bored(WIDE, WIDE + TAPER * LONG, 16.0, 24)
    solution = fo.solve(fo.Problem(plug, socket, target=(LARGER, 1.0), motion=Z, goal="clear", unit="mm"))
    unread = pickle.loads(pickle.dumps(solution))
    assert callable(vars(solution)["amount_low"])  # it takes two solves more, and was worked out where nobody reads it
    again = fo.Solution.from_dict(json.loads(json.dumps(solution.to_dict())))
    assert (unread.amount_high, unread.amount_low) == (solution.amount_high, solution.amount_low)
    timed = fo.solve(solution.problem, time=1000.0)
    assert vars(timed)["amount_low"] == solution.amount_low
    assert (again.amount_low, again.amount_high) == (solution.amount_low, solution.amount_high)
    assert fo.verify(again).passed
    wrong: list[dict[str, Any]] = [
        {"amount_low": 1.01 * solution.amount},
        {"amount_high": 0.99 * solution.amount},
        {"amount_low": math.nan},
        {"amount_low": -1.0},
    ]
    for ends in wrong:
        assert [check.name for check in fo.verify(replace(again, **ends)).failed] == ["amount the mesh allows"]


def test_what_meshes_leave_open_of_an_assembly_is_told() -> None:
    """A peg stands out of its socket by the closed form, a block lies on the socket's rim; it was "(proved)"."""
    plug, socket = frustum(24, 0.5), bored(WIDE, WIDE + TAPER * LONG, 16.0, 24)
    block = fo.Body.convex(np.array([100.0, 0.0, 1.0]) + PLATE, name="block")
    slab = fo.Body.convex(np.array([100.0, 0.0, -10.0]) + PLATE * [1, 1, 0.5], name="slab")
    parts = {"socket": socket, "plug": plug, "slab": slab, "block": block}
    down = float(block.vertices[:, 2].min() - slab.vertices[:, 2].max())
    contacts = [{"parts": ("plug", "socket"), "goal": "clear"}, {"parts": ("block", "slab"), "goal": "touch"}]
    assembly = fo.Assembly(parts, contacts, motions={"plug": Z, "block": Z}, scales={"plug": LARGER}, unit="mm")
    solution = fo.solve_assembly(assembly)
    assert solution.usable
    assert solution.amount_low <= math.hypot(STICKS_OUT, down) <= solution.amount_high
    assert solution.amount_low < solution.amount_high
    told = json.loads(json.dumps(solution.to_dict()))
    assert (told["amount_low"], told["amount_high"]) == (solution.amount_low, solution.amount_high)
    assert "proved" not in assembly_verdict(solution)
    assert "their curved faces are facets here" in assembly_verdict(solution)
    wrong = replace(solution, amount_low=1.01 * solution.amount)
    assert "amount the mesh allows" in [check.name for check in fo.verify_assembly(wrong).failed]
    plain = fo.Assembly({"slab": slab, "block": block}, contacts[1:], motions={"block": Z})
    exact = fo.solve_assembly(plain)
    assert exact.amount_low == exact.amount == exact.amount_high == pytest.approx(down)
    assert "smallest possible together (proved)" in assembly_verdict(exact)


@pytest.mark.slow
def test_errors_of_facets_come_back_with_a_stored_body(tmp_path: Path) -> None:
    cap = [(0, 0), (10, 0, 0, 0), (0, 10)]
    for text, decomposition in ((cylinder(6.0, 9.0, np.eye(3)), "auto"), (revolved(cap, np.eye(3)), "surface")):
        body = read(tmp_path, text, deviation=0.2, decomposition=decomposition)
        plate = fo.Body.convex(PLATE - [0.0, 0.0, 30.0])
        problem = fo.Problem(body, plate, target=(1.0, 1.0), motion=Z, goal="touch")
        again = fo.Problem.from_dict(json.loads(json.dumps(problem.to_dict()))).movable
        assert body.facet_errors.any()
        np.testing.assert_array_equal(again.facet_errors, body.facet_errors)


def test_quick_does_not_look() -> None:
    solution = fo.solve(
        fo.Problem(frustum(24), bored(9.0, 11.0, 16.0, 24), target=(LARGER, 1.0), motion=Z, goal="clear"),
        effort="quick",
    )
    assert math.isnan(solution.amount_low)
    assert math.isnan(solution.amount_high)
    assert "smallest possible" not in verdict_text(solution)
    assert 'what true parts need is not known: it is not worked out with effort "quick"' in verdict_text(solution)


def test_blocks_whose_corners_scatter_have_bounds_and_the_scatter_is_named(tmp_path: Path) -> None:
    """Off by up to 2e-6 at 7 decimals: "its digits are too few", and "what true parts need is not known"."""
    box = trimesh.creation.box((12.0, 10.0, 12.0))
    box.apply_translation((18.35, 15.6, 6.0))
    points = box.vertices + np.random.default_rng(1).uniform(-2e-6, 2e-6, (8, 3))
    lines = ["solid box"]
    for face in box.faces:
        corners = [f"vertex {x:.7f} {y:.7f} {z:.7f}" for x, y, z in points[face].tolist()]
        lines += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
    path = tmp_path / "box.stl"
    path.write_text("\n".join([*lines, "endsolid box", ""]), "utf-8")
    rough = fo.Body.from_file(path, unit="mm")
    assert any("more than its digits tell: vertices are known to 2.1e-05 mm" in note for note in rough.notes)
    wall = fo.Box((10.0, 30.0, 30.0), centre=(7.0, 15.6, 6.0), name="wall", unit="mm")  # .35 off the block
    solution = fo.solve(fo.Problem(rough, wall, target=(1.0, 1.0), motion=fo.Translation("x"), goal="touch"))
    assert solution.amount_low < 0.35 - 1e-5 < solution.amount < 0.35 + 1e-5 < solution.amount_high < 0.35 + 1e-4
    assert "smallest possible (proved)" in verdict_text(solution)


def test_why_it_is_not_known_what_a_mesh_leaves_open_was_not_told() -> None:
    """A shaft on its side over a table, with a wall beside it."""
    shaft = fo.Body.convex(np.vstack([ring(9.9, 24, z) for z in (0.0, 10.0)])[:, [0, 2, 1]], name="shaft")
    table, wall = fo.Body.convex(PLATE - [0.0, 0.0, 30.0]), fo.Body.convex(PLATE + np.array([60.0, 0.0, 0.0]))
    known = {"target": (1.0, 1.0), "motion": Z, "goal": "touch"}
    beside = fo.solve(fo.Problem(shaft, table, keep_out=[fo.KeepOut(wall)], **known))
    assert beside.usable
    assert math.isnan(beside.amount_low)
    assert "is not known: larger parts touch sooner, and keep less clear" in verdict_text(beside)
    on_it = tuple(beside.problem.curve.nearest((1.0, 1.0)).tolist())
    followed = replace(beside, problem=beside.problem.changed(keep_out=(), goal="at", nominal=on_it))
    assert 'is not known: goal "at" is about contacts as drawn' in followed.left_by_mesh


def test_stack_and_map_repeat_how_well_gaps_are_known(tmp_path: Path) -> None:
    for name, body in (("peg", np.vstack([ring(9.9, 24, z) for z in (0.0, 10.0)])), ("plate", PLATE - [0, 0, 12])):
        trimesh.convex.convex_hull(body).export(tmp_path / f"{name}.stl")
    path = tmp_path / "fit.toml"
    path.write_text(
        '[bodies.movable]\nfile = "peg.stl"\nunit = "mm"\n[bodies.static]\nfile = "plate.stl"\nunit = "mm"\n'
        '[[size]]\nname = "height"\nbody = "movable"\nfaces = "bottom"\ntolerance = 0.1\n'
        '[[case]]\nname = "A"\ngoal = "touch"\nmotion = [{ translation = "z" }]\n'
    )
    known = f"may be up to {9.9 * (1 - math.cos(math.pi / 24)):.2g} mm smaller: the facets of peg only come near them"
    printed = run("stack", path)
    assert printed.exit_code == 0, printed.output
    assert known in " ".join(printed.output.split())
    (entry,) = json.loads(run("stack", path, "--json").stdout)["files"][0]["cases"]
    assert any(known in text for text in entry["known_to"])


def test_stack_yield_and_map_state_what_the_mesh_leaves_open() -> None:
    """A peg of radius 9.9 .1 above a plane, on its side: its cylinder reaches .085 further down than its facets."""
    peg = fo.Body.convex(np.vstack([ring(9.9, 24, z, 0.5) for z in (0.0, 10.0)])[:, [0, 2, 1]], name="peg")
    low = float(peg.vertices[:, 2].min())
    plate = fo.Body.convex(PLATE + np.array([0.0, 0.0, low - 10.1]), name="plate")
    size = fo.Size("plate", body="static", faces="top", tolerance=0.05)
    sagitta = 9.9 * (1 - math.cos(math.pi / 24))
    problem = fo.Problem(peg, plate, target=(1.0, 1.0), motion=Z, goal="clear", unit="mm", sizes=[size])
    stack = fo.stack_up(problem, limits=(0.03, 1.0))
    worst = stack.worst()
    assert 9.9 + low == pytest.approx(sagitta)
    assert worst.least_low == pytest.approx(0.05 - sagitta)
    assert worst.largest_high == pytest.approx(worst.largest) == pytest.approx(0.15)
    drawn = stack.yield_(100_000)
    assert drawn.share == drawn.share_high > 0.9999
    true = stack.gap(np.linspace(-0.05, 0.05, 9)[:, None]) - sagitta  # of the cylinder
    assert (true < 0.03).any()
    exact = fo.stack_up(problem, limits=(0.03 + sagitta, 1.0)).yield_(100_000)
    assert drawn.share_low == pytest.approx(exact.share, abs=1e-9)
    assert drawn.share_low < drawn.share
    told = json.loads(json.dumps(stack.to_dict()))
    assert "gaps of the true parts may be" in told["known_to"][0]
    scales = fo.compensation_map(problem.changed(sizes=()), box=((1.0, 1.02), (1.0, 1.01)), budget=60)
    assert "gaps of the true parts may be" in str(scales)
    assert fo.CompensationMap.from_dict(json.loads(json.dumps(scales.to_dict()))).known_to == scales.known_to
    spread = (fo.Uniform(1.0, 1.02), fo.Uniform(1.0, 1.01))
    assert scales.known_to[0] in str(fo.assembly_yield(scales, sizes=spread, budget=0.1, count=1000))


def test_solids_side_by_side_that_cover_faces_of_each_other_have_errors_that_are_not_known() -> None:
    """A part with facets that are no faces of the whole: to tell how far these are off ended in a KeyError."""
    turns = 2.0 * np.pi * np.arange(48) / 48
    body = fo.Body.convex([(np.cos(x), np.sin(x), z) for x in turns for z in (0.0, 1.0)])
    assert facet_errors(body) is not None
    assert facet_errors(replace(body, faces=body.faces[:-10])) is None


def test_the_plane_around_a_bore_was_as_many_faces_as_the_body_has_parts() -> None:
    """A motion put a collar on "top face no. 1, top face no. 2 and 30 more" of a plate with one top."""
    plate = fo.cut(fo.Box((8, 8, 4), centre=(0, 0, 0)), fo.Cylinder(2, 6, base=(0, 0, -3), facets=16))
    ends = {tuple(sorted(face)) for face in plate.faces if np.ptp(plate.vertices[np.array(face) - 1, 2]) == 0.0}
    inner, _ = bounding_bodies(plate) or pytest.fail("no such body")
    facets = [(part, k) for part in inner.parts for k, n in enumerate(part.normals) if abs(n[2]) == 1.0]
    assert len(facets) >= 32
    assert {part.elements["F"][k].vertices for part, k in facets} == ends
    assert len(ends) == 2


@pytest.mark.slow
def test_a_collar_whose_shank_is_far_too_thick_was_left_open_by_the_mesh() -> None:
    """19.8 x 1.02 = 20.196 in 20 x .98 = 19.6: no facets are off by .3 on a side. Known once, by its diameters."""
    rings = [np.vstack([ring(r, 24, z) for z in ends]) for r, ends in ((9.9, (0.0, 41.0)), (14.0, (LONG, 44.0)))]
    pin = fo.Body.from_parts(rings, seed=(0, 0, LONG), name="pin")
    asked = {"target": (1.02, 0.98), "motion": Z, "goal": "seat", "unit": "mm"}
    problem = fo.Problem(pin, bored(10.0, 10.0, 20.0, 24), **asked)
    for solution in (fo.solve(problem, effort="quick"), fo.solve(problem)):
        words = verdict_text(solution)
        assert "does not fit: pin 20.20 mm in socket 19.60 mm, across the bore of radius 10 of socket" in words
        assert "mesh" not in words + solution.advice + " ".join(remarks(solution))


@pytest.mark.sampled(1)
@pytest.mark.parametrize("goal", ["at", "seat"])
def test_a_keep_out_that_is_clear_left_what_true_parts_need_unknown(goal: str) -> None:
    """A block with a bore, made 0.02 too small beside a wall, moves 0.02; stops are clear of it, or not known to be."""
    room, space = fo.Box((60, 40, 20), centre=(10, 0, 0)), fo.Box((60, 60, 20), centre=(30, 0, 10))
    block = fo.cut(fo.Box((10, 10, 10), centre=(5, 0, 5)), fo.Cylinder(2, 20, base=(5, 0, -5), facets=24), name="block")
    size = fo.Size("left", "movable", faces=["-x"], tolerance=0.05)
    asked = {"sizes": [size], "made": {"left": 0.02}, "goal": goal, "contacts": "all", "motion": fo.Translation("x")}
    problem = fo.Problem(block, fo.cut(room, space, name="nest"), **asked)
    for stop in (fo.Box((2, 2, 2), centre=(11.5, 0, 5)), fo.Cylinder(1, 4, base=(12, 0, 3))):
        found = fo.solve(problem.changed(keep_out=[stop]))
        assert found.amount_low == found.amount_high == found.amount == pytest.approx(0.02, abs=1e-9)
        assert "smallest possible (proved)" in str(found)
    drum = np.vstack([ring(1.0, 24, z, 0.5) + np.array([11.017, 0.0, 0.0]) for z in (3.0, 7.0)])
    near = fo.solve(problem.changed(keep_out=[fo.Body.convex(drum, name="drum")]))
    assert near.usable
    assert math.isnan(near.amount_low)  # the facets are clear of the block by 0.006, the drum overlaps it by 0.003


def test_a_plate_under_a_gripped_rod_left_what_true_parts_need_unknown() -> None:
    """Flanks of a V at 45 degrees and a flat grip a rod that stands on a plate: rows -v + r and r - f, by hand."""
    apex = -4.0 * math.sqrt(2.0)
    groove = fo.Body.convex([(apex + x, y, z) for z in (-6, 6) for x, y in ((0, 0), (8, 8), (8, -8))])
    parts = {
        "plate": fo.Box((60, 30, 4), centre=(0, 0, -17)),
        "vee": fo.cut(fo.Box((12, 20, 10), centre=(apex - 2, 0, 0)), groove),
        "flat": fo.Box((6, 20, 10), centre=(7, 0, 0)),
        "rod": fo.Cylinder(4, 30, base=(0, 0, -15)),
    }
    x = fo.Translation("x")
    asked = {"motions": {"vee": x, "flat": x, "rod": x >> fo.Translation("y") >> Z}, "made": {"d": 0.06}}
    asked |= {"follows": dict.fromkeys(("vee", "flat", "rod"), "plate")}
    size = fo.Size("d", "rod", faces=["cylinder radius 4"], each=0.5, tolerance=0.1)
    contacts = [("rod", "plate"), ("rod", "vee"), ("flat", "rod")]
    found = fo.solve(fo.Assembly(parts, contacts, sizes=[size], **asked))
    by_hand = np.linalg.pinv([[-1.0, 0.0, 1.0], [0.0, 1.0, -1.0]]) @ [0.03 * math.sqrt(2.0), 0.03]
    assert [found.parameters[part]["TX"] for part in ("vee", "flat", "rod")] == pytest.approx(by_hand, abs=1e-9)
    assert [found.amount_low, found.amount_high] == pytest.approx([np.linalg.norm(by_hand)] * 2, abs=1e-9)
    assert "smallest possible together (proved)" in str(found)
    assert fo.verify(found, proof=True).passed


@pytest.mark.slow
def test_plane_contacts_of_round_parts_that_share_motions_were_told_of_meshes() -> None:
    """A disc in a pocket under a cover that is to stay clear of it: each rises by what its plane faces are off."""
    pocket = fo.cut(fo.Box((60, 60, 15), centre=(0, 0, -2.5)), fo.Cylinder(20.0, 6.0), name="base")
    disc, cover = fo.Cylinder(19.9, 4.9, name="disc"), fo.Box((60, 60, 8), centre=(0, 0, 9), name="cover")
    sizes = [
        fo.Size("depth", "base", faces=[{"through": (0, 0, 0)}], each=-1.0, tolerance=0.2),
        fo.Size("thickness", "disc", faces=["+z", "-z"], each=0.5, tolerance=0.2),
        fo.Size("bulge", "cover", faces=["-z"], tolerance=0.2),
    ]
    contacts = [("disc", "base"), ("cover", "base"), {"parts": ("cover", "disc"), "goal": "clear"}]
    asked = fo.Assembly([pocket, disc, cover], contacts, sizes, {"disc": Z, "cover": Z})
    thick = fo.solve(asked.changed(made={"thickness": 0.03, "depth": -0.02, "bulge": 0.01}))
    least = math.hypot(0.035, 0.01)
    assert (thick.amount_low, thick.amount_high) == pytest.approx((least, least), abs=1e-9)
    assert not thick.left_by_mesh
    over = fo.solve(asked.changed(made={"thickness": 0.15, "depth": -0.02}))  # .07 more than there is room for
    assert over.advice.endswith("Proved impossible with this motion: choose another motion, a smaller tolerance or "
                                "other sizes.")  # fmt: skip
    assert not over.left_by_mesh
    dished = fo.cut(cover, fo.Sphere(40.0, centre=(0, 0, 44.0)), name="cover")  # its facets decide nothing
    assert not fo.solve(fo.Assembly([pocket, disc, dished], contacts, sizes, {"disc": Z, "cover": Z})).left_by_mesh


@pytest.mark.parametrize("above", ["post", "rim"])
def test_a_rim_of_twelve_facets_leaves_open_the_gaps_beside_it_alone(above: str) -> None:
    """A gap between plane faces was told to be as much as the rim, far from it, may be off its circle."""
    plate = np.vstack([ring(40.0, 12, z) for z in (0.0, 5.0)])
    post = fo.Box((10, 10, 10), centre=(0, 0, 10)).vertices
    part = fo.Body.from_parts([plate, post], name="part", unit="mm")
    flat = 40.0 * math.cos(math.pi / 12.0)  # the rim is as near along the middle of a facet
    other, along = (fo.Box((10, 10, 10), centre=(0, 0, 20.3)), "z") if above == "post" else (
        fo.Box((10, 10, 10), centre=(flat + 5.3, 0, 2.5)), "x"
    )  # fmt: skip
    turned = part.moved(np.block([[about_z(math.pi / 12.0), np.zeros((3, 1))], [np.zeros((1, 3)), 1.0]]))
    asked = fo.Problem(turned, other, target=(1, 1), goal="clear", clearance=0.15, motion=fo.Translation(along))
    found = fo.solve(asked)
    assert found.pair_gap == pytest.approx(0.3, abs=1e-9)
    told = [line for line in remarks(found) if "gaps of the true parts" in line]
    assert bool(told) is (above == "rim")
