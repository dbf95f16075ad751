"""What facets of round faces leave open of an answer: amounts of closed forms lie in it, plane faces leave nothing."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from test_tessellation import PLATE, SIDES, read, run

import fcdm_opt as fo
from fcdm_opt.geometry.facet_errors import bounding_bodies, facet_errors
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
    return solution.amount_low <= truth <= solution.amount_high


def taper_of_step_files(folder: Path) -> tuple[fo.Body, fo.Body]:
    """The socket turned by a third of a facet: their meshes are out of phase."""
    top = WIDE + TAPER * LONG
    plug = read(folder, revolved([(0, 0), (WIDE, 0), (top, LONG), (0, LONG)], np.eye(3)), seed=[0, 0, 0], name="plug")
    profile = [(WIDE, 0), (16, 0), (16, LONG), (top, LONG)]
    socket = read(folder, revolved(profile, about_z(0.07)), seed=[0, 0, 0], deviation=0.02, name="socket")
    return plug, socket


def test_a_taper_from_step_files_is_not_proved_of_its_mesh(tmp_path: Path) -> None:
    plug, socket = taper_of_step_files(tmp_path)
    solution = fo.solve(fo.Problem(plug, socket, target=(LARGER, 1.0), motion=Z, goal="clear", unit="mm"))
    assert solution.usable
    assert holds(solution, STICKS_OUT)
    assert solution.amount_high - solution.amount_low > 0.01 * solution.amount
    words = verdict_text(solution)
    assert "smallest possible" not in words
    assert f"between {solution.amount_low:.4g} and" in words or f"{solution.amount_low:.4g} mm or more" in words
    assert "the mesh leaves that open" in words
    assert "the mesh leaves that open" in repr(solution)


@pytest.mark.parametrize("count", [24, 48])
@pytest.mark.parametrize("phase", [0.0, 0.5])
def test_a_taper_of_facets_is_not_proved_of_them(count: int, phase: float) -> None:
    plug, socket = frustum(count, phase), bored(WIDE, WIDE + TAPER * LONG, 16.0, count)
    solution = fo.solve(fo.Problem(plug, socket, target=(LARGER, 1.0), motion=Z, goal="clear", unit="mm"))
    assert holds(solution, STICKS_OUT)
    if phase:  # else facets and corners are over one another, and scale as the cones do
        assert not holds(replace(solution, amount_low=solution.amount), STICKS_OUT)
    assert "smallest possible" not in verdict_text(solution)


@pytest.mark.parametrize("turn", [0.0, 0.1])
def test_balls_apart_touch_between_what_larger_and_smaller_ones_do(turn: float) -> None:
    ball = trimesh.creation.icosphere(3, 5.0)
    vertices = np.array(ball.vertices) @ about_z(turn).T @ np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    body = fo.Body.convex(vertices + np.array([0.0, 0.0, 6.0]), seed=[0, 0, 6], name="ball")
    plate = fo.Body.convex(PLATE - [0.0, 0.0, 10.0], name="plate")
    solution = fo.solve(fo.Problem(body, plate, target=(1.0, 1.0), motion=Z, goal="touch"))
    assert holds(solution, 1.0)
    assert solution.amount > 1.0  # facets fall short of the ball
    assert solution.amount_low < solution.amount == pytest.approx(solution.amount_high)


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


SOLIDS = {
    "cylinder": ([(0, 0), (6, 0), (6, 20), (0, 20)], 36 * math.pi * 20),
    "cone": ([(0, 0), (8, 0), (4, 12), (0, 12)], math.pi * 12 * (64 + 32 + 16) / 3),
    "tube": ([(4, 0), (9, 0), (9, 15), (4, 15)], math.pi * (81 - 16) * 15),
    "dome": ([(0, 0), (10, 0, 0, 0), (0, 10)], 2 * math.pi * 1000 / 3),
    "rounded": ([(0, 0), (10, 0), (10, 5, 7, 5), (7, 8), (0, 8)], None),
}


@pytest.mark.parametrize("decomposition", ["auto", "surface"])
@pytest.mark.parametrize("kind", SOLIDS)
def test_the_true_body_lies_between_both(tmp_path: Path, kind: str, decomposition: str) -> None:
    profile, volume = SOLIDS[kind]
    body = read(tmp_path, revolved(profile, np.eye(3)), deviation=0.05, decomposition=decomposition)
    inner, outer = bounding_bodies(body)

    def held(own: fo.Body) -> float:
        corners, _ = own.face_triangles
        if own.skin or len(own.parts) == 1:
            return float(np.linalg.det(corners).sum()) / 6.0
        volumes = [part.volume_and_centroid[0] for part in own.parts]
        return max(volumes) if "overlap" in body.notes[0] else sum(volumes)  # each nearly the whole

    low, mesh, high = map(held, (inner, body, outer))
    assert low <= mesh <= high
    if volume is not None:
        assert low <= volume <= high
        assert high - low < 0.04 * volume
    corners = body.vertices[: len(body.vertices)]
    assert (outer.vertices.max(axis=0) >= corners.max(axis=0) - 1e-9).all()


def test_line_to_line_is_left_open() -> None:
    """A shaft in a bore of its diameter, out of phase: the facets overlap, the cylinders touch all round."""
    shaft = fo.Body.convex(np.vstack([ring(10.0, 32, z, 0.5) for z in (-5.0, 45.0)]), name="shaft")
    solution = fo.solve(fo.Problem(shaft, bored(10.0, 10.0, 20.0, 32), target=(1.0, 1.0), motion=fo.Translation("x")))
    words = verdict_text(solution)
    assert solution.amount_low == 0.0
    assert "leaves open" in words or "leaves that open" in words


def test_what_the_mesh_leaves_open_is_stored_and_judged() -> None:
    plug, socket = frustum(24, 0.5), bored(WIDE, WIDE + TAPER * LONG, 16.0, 24)
    solution = fo.solve(fo.Problem(plug, socket, target=(LARGER, 1.0), motion=Z, goal="clear", unit="mm"))
    again = fo.Solution.from_dict(json.loads(json.dumps(solution.to_dict())))
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


def test_stack_and_map_repeat_how_well_gaps_are_known(tmp_path: Path) -> None:
    for name, body in (("peg", np.vstack([ring(9.9, 24, z) for z in (0.0, 10.0)])), ("plate", PLATE - [0, 0, 12])):
        trimesh.convex.convex_hull(body).export(tmp_path / f"{name}.stl")
    path = tmp_path / "fit.toml"
    path.write_text(
        '[bodies.movable]\nfile = "peg.stl"\nunit = "mm"\n[bodies.static]\nfile = "plate.stl"\nunit = "mm"\n'
        '[[size]]\nname = "height"\nbody = "movable"\nfaces = "bottom"\ntolerance = 0.1\n'
        '[[case]]\nname = "A"\ngoal = "touch"\nmotion = [{ translation = "z" }]\n'
    )
    known = f"gaps are known to +0 / -{9.9 * (1 - math.cos(math.pi / 24)):.2g} mm: by tessellation of peg"
    printed = run("stack", path)
    assert printed.exit_code == 0, printed.output
    assert known in " ".join(printed.output.split())
    (entry,) = json.loads(run("stack", path, "--json").stdout)[0]["cases"]
    assert any(known in text for text in entry["known_to"])
