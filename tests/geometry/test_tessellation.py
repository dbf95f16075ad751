"""Curved faces of STEP files: how far triangles leave them is asked for, measured, and told with the answer."""

from __future__ import annotations

import math
import re
from itertools import count, product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from step_bodies import PLATE, SIDES, read, run
from strategies import random_rotation

import fcdm_opt as fo
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.tessellation import Swept
from fcdm_opt_benchmarks.step_files import cylinder, polyhedron, revolved

ARC = SimpleNamespace
SURFACES = {
    "cylinder": ARC(origin=(0, 0, 0), axis=(0, 0, 1), radius=1.0),
    "cone": ARC(apex=(0, 0, 0), axis=(0, 0, 1), semi_angle=0.7, ref_radius=1.0),
    "sphere": ARC(center=(0, 0, 0), radius=1.0),
    "torus": ARC(center=(0, 0, 0), axis=(0, 0, 1), major_radius=1.0, minor_radius=0.4),
}


def chord(radius: float, angles: np.ndarray) -> float:
    """Return how far the chords between corners at these angles fall short of a circle: by the longest of them."""
    around = np.unique(np.round(angles, 6))
    widest = np.diff(np.append(around, around[0] + 2 * math.pi)).max()
    return radius * (1 - math.cos(widest / 2))


@pytest.mark.sampled(3)
@pytest.mark.parametrize("radius", [0.5, 9.9, 400.0])
@pytest.mark.parametrize("share", [1e-2, 1e-3, 1e-4])
def test_a_cylinder_falls_short_by_the_height_of_its_chords(tmp_path: Path, radius: float, share: float) -> None:
    axes = random_rotation(np.random.default_rng(5))
    asked = share * radius
    body = read(tmp_path, cylinder(radius, 2 * radius, axes), deviation=asked)
    local = body.vertices @ axes
    out, short = body.deviation
    assert short == pytest.approx(chord(radius, np.arctan2(local[:, 1], local[:, 0])), rel=1e-3)
    assert 0 < short <= asked
    assert out < 1e-7 * radius
    np.testing.assert_allclose(np.hypot(*local.T[:2]), radius, rtol=2e-7)


@pytest.mark.slow
@pytest.mark.parametrize("asked", [0.05, 0.004])
def test_a_bore_sticks_out_by_the_height_of_its_chords(tmp_path: Path, asked: float) -> None:
    body = read(tmp_path, polyhedron(PLATE, SIDES, "mm", bore=10.0), deviation=asked)
    rim = body.vertices[np.hypot(*body.vertices.T[:2]) < 11.0]
    out, short = body.deviation
    assert out == pytest.approx(chord(10.0, np.arctan2(rim[:, 1], rim[:, 0])), rel=1e-3)
    assert 0 < out <= asked
    assert short < 1e-6
    assert any(
        "triangles leave its curved faces by up to" in note and f"at most {asked:g} asked" in note
        for note in body.notes
    )


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["mm", "in", "m"])
def test_the_deviation_asked_for_is_in_the_unit_of_the_body(tmp_path: Path, unit: str) -> None:
    """A ball, of which the tessellation library keeps only half of what is asked."""
    size = {"mm": 1.0, "in": 25.4, "m": 1000.0}[unit]
    text = revolved([(0, -10, 0, 0), (0, 10)], np.eye(3))
    body = read(tmp_path, text, unit=unit, deviation=0.1 / size, decomposition="surface")
    assert 0.02 < max(body.deviation) * size <= 0.1


def test_without_a_bound_the_error_is_measured_too(tmp_path: Path) -> None:
    body = read(tmp_path, cylinder(10.0, 20.0, np.eye(3)))
    angles = np.arctan2(body.vertices[:, 1], body.vertices[:, 0])
    assert body.deviation[1] == pytest.approx(chord(10.0, angles), rel=1e-3)


def test_plane_faces_have_no_error(tmp_path: Path) -> None:
    body = read(tmp_path, polyhedron(PLATE, SIDES, "mm"), deviation=0.01)
    assert body.deviation == (0.0, 0.0)
    assert not any("triangles" in note for note in body.notes)


def splined(points: np.ndarray, faces: list[tuple[int, ...]], unit: str, bulge: float) -> str:
    """Return a STEP file of a solid whose quads are splines of 3 x 3 points, the middle of the first off by `bulge`."""
    ends, numbers, added, quads = [0.0, 0.5, 1.0], count(9001), list[str](), iter(faces)

    def spline(_: re.Match[str]) -> str:
        (a, b, c, d), net = points[[*next(quads)]], list[str]()
        normal = np.cross(b - a, d - a) / np.linalg.norm(np.cross(b - a, d - a))
        for u, v in product(ends, ends):
            x = (1 - u) * ((1 - v) * a + v * d) + u * ((1 - v) * b + v * c)
            x = x + bulge * normal if u == v == 0.5 and len(added) < 9 else x
            added.append(f"#{(number := next(numbers))} = CARTESIAN_POINT('',({','.join(f'{own:.9f}' for own in x)}));")
            net.append(f"#{number}")
        rows = ",".join(f"({','.join(net[k : k + 3])})" for k in (0, 3, 6))
        rest = ".UNSPECIFIED.,.F.,.F.,.F.,(3,3),(3,3),(0.,1.),(0.,1.),.UNSPECIFIED."
        return f"B_SPLINE_SURFACE_WITH_KNOTS('',2,2,({rows}),{rest})"

    text = re.sub(r"PLANE\(''[^)]*\)", spline, polyhedron(points, faces, unit))
    body, end, tail = text.rpartition("ENDSEC;")
    return "\n".join([body, *added, end]) + tail


@pytest.mark.parametrize("unit", ["mm", "in"])
def test_faces_of_a_loft_that_are_plane_were_taken_for_curved_ones(tmp_path: Path, unit: str) -> None:
    """A drafted ingot: what true parts need was "between 0 and 5.3" mm. A bulge is seen however small."""
    corners = [(sx * (10 + z / 8), sy * (6 + z / 8), z) for sx, sy, z in product((-1, 1), (-1, 1), (0.0, 16.0))]
    points = np.array(corners, dtype=float)
    body = read(tmp_path, splined(points, SIDES, unit, 0.0), unit=unit)
    assert body.deviation == (0.0, 0.0)
    assert len(body.faces) == 6
    near = np.abs(body.vertices[:, None] - points).max(axis=2)
    assert near.min(axis=0).max() < 1e-12
    assert read(tmp_path, splined(points, SIDES, unit, 0.01), unit=unit).deviation[1] >= 0.01 / 4


@pytest.mark.parametrize(("height", "unit"), [(0.0, "mm"), (0.05, "mm"), (0.09, "mm"), (0.09, "in")])
def test_a_bulge_between_corners_in_the_plane_of_a_flat_spline_was_taken_for_flat(tmp_path, height, unit) -> None:
    """The top of a cube in two triangles, over one of them 27 h u v (1 - u - v): h in its middle, 0 on its sides.

    Its meshes, true to a hundredth of the size, have its corners alone, which are in the plane of the other triangle.
    """
    corners = 10.0 * np.array([*product((0, 1), (0, 1), (0, 1))], float)
    quads = [(0, 2, 6, 4), (0, 4, 5, 1), (2, 3, 7, 6), (0, 1, 3, 2), (4, 6, 7, 5)]
    faces, numbers, added = iter([*quads, (1, 5, 3), (5, 7, 3)]), count(9001), list[str]()

    def surface(plane: re.Match[str]) -> str:
        a, b, c, *more = corners[[*next(faces)]]
        if more:
            return plane.group()
        net, linear, square = list[str](), (0.0, 0.5, 1.0), (0.0, 0.0, 1.0)
        for i, j in product(range(3), range(3)):
            rise = linear[i] * linear[j] - square[i] * linear[j] - linear[i] * square[j]
            x = a + linear[i] * (b - a) + linear[j] * (c - a) + (0, 0, 27 * height * rise * (len(added) < 9))
            added.append(f"#{(number := next(numbers))} = CARTESIAN_POINT('',({','.join(f'{own:.9f}' for own in x)}));")
            net.append(f"#{number}")
        rows = ",".join(f"({','.join(net[k : k + 3])})" for k in (0, 3, 6))
        rest = ".UNSPECIFIED.,.F.,.F.,.F.,(3,3),(3,3),(0.,1.),(0.,1.),.UNSPECIFIED."
        return f"B_SPLINE_SURFACE_WITH_KNOTS('',2,2,({rows}),{rest})"

    text = re.sub(r"PLANE\(''[^)]*\)", surface, polyhedron(corners, [*quads, (1, 5, 3), (5, 7, 3)], unit))
    body, end, tail = text.rpartition("ENDSEC;")
    found = read(tmp_path, "\n".join([body, *added, end]) + tail, unit=unit)
    assert len(found.vertices) == 8  # of the solid, not of a bulge
    assert found.deviation == (0.0, 0.0) if not height else found.deviation[1] >= height


@pytest.mark.slow
@pytest.mark.parametrize("kind", SURFACES)
def test_triangles_leave_a_surface_by_what_a_fine_grid_of_points_finds(kind: str) -> None:
    """Never less; of tori up to 2.1 % more, as their bound allows."""
    rng, cuts, surface = np.random.default_rng(11), 100, Swept.of(SURFACES[kind])
    grid = np.array([(i, j, cuts - i - j) for i in range(cuts + 1) for j in range(cuts + 1 - i)]) / cuts
    for _ in range(100):
        u, v = rng.uniform(0, 6, (2, 1)) + rng.uniform(-0.2, 0.2, (2, 3))
        if kind == "cone":
            v = 2.0 + v / 6.0
        far, along = {
            "cylinder": (np.ones(3), 3 * v),
            "cone": (v * math.tan(0.7), v),
            "sphere": (np.cos(v), np.sin(v)),
            "torus": (1.0 + 0.4 * np.cos(v), 0.4 * np.sin(v)),
        }[kind]
        corners = np.column_stack([far * np.cos(u), far * np.sin(u), along])
        off, normals = surface.misses(corners)
        np.testing.assert_allclose(off, 0.0, atol=1e-14)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-13)
        (outward,) = surface.misses(corners.mean(axis=0)[None])[1]
        if np.cross(corners[1] - corners[0], corners[2] - corners[0]) @ outward < 0:
            corners = corners[::-1]
        off, _ = surface.misses(grid @ corners)
        sampled = np.array([max(off.max(), 0.0), max(-off.min(), 0.0)])
        found, back = surface.deviations(corners[None])[0], surface.deviations(corners[None, ::-1])[0]
        assert (np.array(found) >= sampled - 1e-13).all()
        more = 0.0209 if kind == "torus" else 2e-4
        assert (np.array(found) <= sampled + more * sampled.max() + 1e-13).all()
        assert back == pytest.approx(found[::-1], rel=1e-9, abs=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize(
    "profile",
    [
        [(0, 0), (10, 0), (4, 8), (0, 8)],  # a cone
        [(0, 0), (10, 0), (10, 5, 7, 5), (7, 8), (0, 8)],  # a rounded edge
        [(0, 0), (10, 0), (10, 5, 0, 5), (0, 15)],  # a dome
    ],
)
def test_convex_curved_solids_only_fall_short(tmp_path: Path, profile: list[tuple[float, ...]]) -> None:
    """Of a rounded edge, part of a torus, the bound leaves a fiftieth open on the other side."""
    body = read(tmp_path, revolved(profile, np.eye(3)), deviation=0.05, decomposition="surface")
    out, short = body.deviation
    assert 0.001 < short <= 0.05
    assert out < 0.0215 * short + 1e-5


@pytest.mark.parametrize("wrong", [0.0, -1.0, math.inf, math.nan])
def test_a_chord_error_is_a_finite_length(tmp_path: Path, wrong: float) -> None:
    with pytest.raises(InputError, match="deviation: not a length"):
        read(tmp_path, cylinder(1.0, 2.0, np.eye(3)), deviation=wrong)
    made = run("init", tmp_path / "part.step", tmp_path / "part.step", "--deviation", wrong)
    assert made.exit_code != 0
    assert "--deviation" in made.output
    assert "a finite length > 0" in made.output


def test_mesh_files_have_no_chord_error(tmp_path: Path) -> None:
    for name in ("a.stl", "b.off"):
        (tmp_path / name).write_text("solid\n")
    made = run("init", tmp_path / "a.stl", tmp_path / "b.off", "--deviation", 0.01)
    assert made.exit_code != 0
    assert "--deviation: neither file is STEP; found 0.01" in " ".join(made.output.split())


@pytest.mark.slow
def test_from_step_files_to_the_answer(tmp_path: Path) -> None:
    """A peg of radius 9.9 in a bore of 10, side by side: the gap drawn, 0.1, is what a shift needs for it to touch."""
    peg, plate, path = tmp_path / "peg.step", tmp_path / "plate.step", tmp_path / "fit.toml"
    peg.write_text(cylinder(9.9, 10.0, np.eye(3)))
    plate.write_text(polyhedron(PLATE, SIDES, "mm", bore=10.0))
    assert run("init", peg, plate, "--deviation", 0.1, "--out", path).exit_code == 0
    assert path.read_text().count("\ndeviation = 0.1  # chord error") == 2
    (problem, *_) = fo.load_problems(path)
    low, high = problem.curve.gap_bounds((1.0, 1.0))
    assert low <= 0.1 <= high < low + 0.2
    touching = fo.solve(problem.changed(goal="touch", motion=fo.Translation("x"), tolerance=0.0))
    assert touching.amount == pytest.approx(0.1, rel=1e-9)
    assert run("solve", path, "--case", problem.name).exit_code == 0
    again = fo.Problem.from_dict(problem.to_dict())
    assert again.static.deviation == problem.static.deviation
    assert again.static.notes == problem.static.notes


def test_a_body_kept_as_its_surface_keeps_its_error(tmp_path: Path) -> None:
    body = read(tmp_path, polyhedron(PLATE, SIDES, "mm", bore=10.0), deviation=0.05, decomposition="surface")
    assert body.is_surface
    problem = fo.Problem(
        fo.Body.convex(PLATE + np.array([0, 0, 20])), body, target=(1.0, 1.0), motion=fo.Translation("z")
    )
    again = fo.Problem.from_dict(problem.to_dict()).static
    assert (again.deviation, again.notes) == (body.deviation, body.notes)
    assert again.deviation[0] > 0


def test_what_triangles_leave_of_one_solid_of_a_step_file_was_said_of_all_its_others(tmp_path: Path) -> None:
    """A gap of two boxes was told to be known to what a rod in the same file leaves of its circle."""
    turn = 0.4 / 2.0  # radians, half of `Tolerances.tessellation_turn`
    rod = cylinder(10.0, 5.0, np.eye(3)).split("DATA;\n")[1].split("\nENDSEC;")[0]
    box = polyhedron(PLATE + np.array([60.0, 0.0, 0.0]), SIDES, "mm")
    others = re.sub(r"#(\d+)", lambda own: f"#{int(own[1]) + 5000}", rod)
    (tmp_path / "both.step").write_text(box.replace("DATA;\n", f"DATA;\n{others}\n"))
    read = [fo.Body.from_file(f"{tmp_path}/both.step#{name}", unit="mm") for name in ("part", "part_1")]
    flat, round_ = sorted(read, key=lambda own: len(own.faces))
    assert flat.deviation == (0.0, 0.0)
    assert not any("curved" in note for note in flat.notes)
    assert 0.0 < round_.deviation[1] <= 10.0 * (1.0 - np.cos(turn)) * (1.0 + 1e-6)
    assert fo.Body.from_file(tmp_path / "both.step", unit="mm").deviation[1] == round_.deviation[1]
