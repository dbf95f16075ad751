"""Files whose digits are few: walls that are the same in two of them stay so, and what is loaded is what was drawn."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import manifold3d as m3
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import fcdm_opt as fo
from fcdm_opt.geometry.facet_errors import known_to
from fcdm_opt.geometry.matching import matched
from fcdm_opt.geometry.polygons import coplanar, normals_of

CASES = Path(__file__).parents[1] / "cases"
TILTED = (0.17101007166283433, -0.46984631039295416, 0.8660254037844387)


def frustum(sides, radii, heights, phase):
    angles = phase + 2.0 * np.pi * np.arange(sides) / sides
    circle = np.c_[np.cos(angles), np.sin(angles), np.zeros(sides)]
    rings = [r * circle + (0, 0, z) for r, z in zip(radii, heights, strict=True)]
    return m3.Manifold.hull_points(np.concatenate(rings))


def block(height):
    return m3.Manifold.cube([40, 40, height + 5.0]).translate([-20, -20, -5])


def stepped(sides, phase, deep):
    """A plug with a collar in a hole of its outline, `deep` within the plate: out by that along z."""
    plug = frustum(sides, (10, 10), (0, 20), phase) + frustum(sides, (13, 13), (8, 20), phase)
    return plug, block(8.0 + deep) - frustum(sides, (10, 10), (-6, 30), phase), deep


def chamfered(sides, phase, deep):
    """A plug that widens, in a hole with a sharp rim: four walls and slopes meet at each corner."""
    plug = frustum(sides, (10, 10), (0, 4), phase) + frustum(sides, (10, 13), (4, 7), phase)
    return plug, block(4.0 + deep) - frustum(sides, (10, 10), (-6, 30), phase), deep


def blind(sides, phase, deep):
    """A prism `deep` below the bottom of a pocket of its outline."""
    plug, plate = frustum(sides, (10, 10), (0, 20), phase), block(10.0)
    return plug, plate - frustum(sides, (10, 10), (deep, 30), phase), deep


def arrays(solid, turn, shift):
    mesh = solid.to_mesh64()
    points = np.asarray(mesh.vert_properties)[:, :3] @ turn.T + shift
    return points, np.asarray(mesh.tri_verts).astype(np.int64)


def binary_stl(points, triangles):
    table = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    table["corners"] = points[triangles].astype(np.float32)
    return b"\0" * 80 + struct.pack("<I", len(triangles)) + table.tobytes()


def text_stl(points, triangles):
    corners = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {:.6e} {:.6e} {:.6e}\n".format(*points[k].tolist()) for k in own)
        + "endloop\nendfacet\n"
        for own in triangles
    )
    return f"solid part\n{corners}endsolid part\n".encode()


def off(points, triangles):
    rows = [" ".join(map(repr, x)) for x in points.tolist()] + [f"3 {a} {b} {c}" for a, b, c in triangles.tolist()]
    return "\n".join(["OFF", f"{len(points)} {len(triangles)} 0", *rows]).encode()


def decimals(points, triangles):
    """An OFF file as a boolean operation in single precision leaves it, written with 10 decimals."""
    rows = ["{:.10f} {:.10f} {:.10f}".format(*own) for own in points.astype(np.float32).tolist()]
    faces = [f"3 {a} {b} {c}" for a, b, c in triangles.tolist()]
    return "\n".join(["OFF", f"{len(points)} {len(triangles)} 0", *rows, *faces]).encode()


FORMATS = {"stl": binary_stl, "text.stl": text_stl, "off": off, "decimals.off": decimals}


def read(tmp_path, name, kind, points, triangles):
    path = tmp_path / f"{name}.{kind}"
    path.write_bytes(FORMATS[kind](points, triangles))
    return fo.Body.from_file(path, unit="mm")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["off", "stl"])
@pytest.mark.parametrize(
    ("movable", "static", "axis", "amount"),
    [("chamfer_plug", "chamfer_socket", "z", 0.5), ("block_tilt", "pocket_tilt", TILTED, 0.1)],
)
def test_walls_equal_in_both_files_do_not_overlap_by_their_last_digits(kind, movable, static, axis, amount):
    """Each file's corners were moved on their own: .5 became 2.5, "proved", and .1 "20.00000000 in 19.99999972"."""
    bodies = [fo.Body.from_file(CASES / f"{name}.{kind}", unit="mm") for name in (movable, static)]
    solution = fo.solve(fo.Problem(*bodies, target=(1, 1), goal="clear", motion=fo.Translation(axis)))
    assert solution.status is fo.Status.SOLVED
    assert solution.amount == pytest.approx(amount, abs=3e-14 if kind == "off" else 1e-6)


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("make", "sides", "kinds"),
    [(stepped, 3, ("stl", "stl")), (stepped, 8, ("text.stl", "text.stl")), (chamfered, 5, ("stl", "off")),
     (chamfered, 8, ("off", "text.stl")), (chamfered, 8, ("stl", "stl")), (blind, 13, ("stl", "stl"))],
)  # fmt: skip
def test_tilted_fits_of_few_digits_answer_as_they_were_drawn(tmp_path, make, sides, kinds):
    """Line to line along a tilted axis: the amount is how deep the shoulder is, to the error of the digits."""
    rng = np.random.default_rng([sides, len(kinds[0])])
    movable, static, amount = make(sides, rng.uniform(0, 2), rng.uniform(0.1, 0.6))
    turn, shift = Rotation.random(rng=rng).as_matrix(), rng.uniform(-30, 30, 3)
    bodies = [
        read(tmp_path, name, kind, *arrays(solid, turn, shift))
        for name, kind, solid in zip(("plug", "plate"), kinds, (movable, static), strict=True)
    ]
    problem = fo.Problem(*bodies, target=(1, 1), goal="clear", motion=fo.Translation(tuple(turn[:, 2])))
    solution = fo.solve(problem)
    assert solution.usable
    assert solution.amount == pytest.approx(amount, abs=2e-5 if "text.stl" in kinds else 4e-6)
    for given, own in zip(bodies, (problem.movable, problem.static), strict=True):
        assert own.faces == given.faces
        assert np.abs(own.vertices[: len(given.corners)] - given.vertices[: len(given.corners)]).max() < 2e-5
        np.testing.assert_array_equal(own.seed, given.seed)


def test_exact_bodies_and_what_is_matched_already_stay(tmp_path):
    movable, static, _ = stepped(6, 0.3, 0.25)
    turn = Rotation.from_rotvec([0.3, 0.5, 0.7]).as_matrix()
    exact = read(tmp_path, "plug", "off", *arrays(movable, turn, 0.0))
    rough = read(tmp_path, "plate", "stl", *arrays(static, turn, 0.0))
    assert exact.rounding == 0.0 < rough.rounding < 3e-5
    one, two = matched((exact, rough), [turn[:, 2]])
    assert one is exact
    assert two is not rough
    again = matched((one, two), [turn[:, 2]])
    assert again[0] is one
    assert again[1] is two


def test_a_gap_that_the_digits_tell_stays(tmp_path):
    """A clearance of 1e-4 all round is no rounding of parts of 40: it is kept."""
    turn = Rotation.from_rotvec([0.2, 0.4, 0.1]).as_matrix()
    plug, hole = frustum(4, (10, 10), (0, 20), 0.1), frustum(4, (10 + 2e-4, 10 + 2e-4), (-6, 30), 0.1)
    bodies = [read(tmp_path, k, "stl", *arrays(own, turn, 0.0)) for k, own in (("a", plug), ("b", block(10.0) - hole))]
    problem = fo.Problem(*bodies, target=(1, 1), goal="clear", motion=fo.Translation(tuple(turn[:, 2])))
    gap = fo.decision_curve(problem.movable, problem.static).gap((1, 1))
    assert gap == pytest.approx(2e-4 * np.cos(np.pi / 4), abs=5e-6)


def test_corners_of_planes_that_hardly_cross_were_moved_by_a_thousand_times_what_digits_leave_open():
    """A roof of two slopes, .004 rad apart, and its counterpart, whose corner digits tell apart, though no slope."""
    outlines = ([(0, 0), (8, 0), (8, 4), (x, 4.008), (0, 4)] for x in (4.0, 4.0 + 2.5e-5))
    one, two = (m3.CrossSection([own]).extrude(5.0) for own in outlines)
    solids = one, m3.Manifold.cube([8.0, 8.0, 5.0]) - two
    bodies = [replace(fo.Body.from_mesh(*arrays(own, np.eye(3), 0.0)), rounding=1e-7) for own in solids]
    for before, after in zip(bodies, matched(bodies), strict=True):
        off = np.linalg.norm(after.vertices[:, None] - before.vertices, axis=2).min(axis=1)
        assert off.max() <= 2e-7


def test_keep_outs_and_assemblies_match_too(tmp_path):
    turn = Rotation.from_rotvec([0.3, -0.2, 0.7]).as_matrix()
    movable, static, amount = stepped(4, 0.3, 0.25)
    plug, plate = (
        read(tmp_path, name, "stl", *arrays(solid, turn, 0.0)) for name, solid in (("plug", movable), ("plate", static))
    )
    table = fo.Body.convex(turn @ np.array([30.0, 0, 0]) + np.eye(4, 3), name="table")
    problem = fo.Problem(
        plug, table, target=(1, 1), goal="clear", motion=fo.Translation(tuple(turn[:, 2])), keep_out=(plate,)
    )
    assert fo.solve(problem).amount == pytest.approx(amount, abs=4e-6)
    assembly = fo.Assembly(
        {"plug": plug, "plate": plate},
        [{"parts": ["plug", "plate"], "goal": "clear"}],
        motions={"plug": fo.Translation(tuple(turn[:, 2]))},
    )
    assert fo.solve_assembly(assembly).amount == pytest.approx(amount, abs=4e-6)


def dovetail():
    """A base, a slide on it that leaves room for a gib of 5 at one flank of 60 degrees, and the gib: all touch."""
    slope, wide = 1.0 / np.sqrt(3.0), 10.0 / np.sqrt(3.0)

    def prism(outline, length):
        turned = m3.CrossSection([outline]).extrude(length).rotate([90.0, 0.0, 0.0])
        return turned.translate([0.0, length / 2.0, 0.0])

    foot = 30.0 - 15.0 * slope
    base = [(-30, 0), (-foot, -15), (-60, -15), (-60, -35), (60, -35), (60, -15), (foot, -15), (30, 0)]
    end = 30.0 - 14.0 * slope
    room = 35.0 + wide - 5.0  # the gib's back, and .1 of air
    left = [(-58, 20), (-58, -14), (-end, -14), (-30, 0)]
    right = [(room + 0.1, 0), (room + 0.1 - 14.0 * slope, -14), (58, -14), (58, 20)]
    upper, lower = (30.0 - z * slope for z in (0.5, 13.5))
    gib = [(upper, -0.5), (lower, -13.5), (lower + wide, -13.5), (upper + wide, -0.5)]
    outlines = (base, 100.0), (left + right, 80.0), (gib, 80.0)
    return [prism(sorted_round(own), length) for own, length in outlines]


def sorted_round(outline):
    """Corners of an outline counterclockwise."""
    x, y = np.array(outline, float).T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
    return [tuple(map(float, own)) for own in (outline if area > 0 else outline[::-1])]


def test_numbers_of_single_precision_with_all_decimals_are_no_exact_ones(tmp_path):
    """A dovetail with a gib, from files of 10 decimals, two of which were of single precision before: "lose each other
    by 6.4e-07 mm. Proved impossible". All contacts are met as drawn; a flank .03 thicker moves the slide by .03 / sin
    60 degrees."""
    base, slide, gib = (arrays(own, np.eye(3), 0.0) for own in dovetail())
    bodies = {name: read(tmp_path, name, "decimals.off", *own) for name, own in (("base", base), ("slide", slide))}
    bodies["gib"] = read(tmp_path, "gib", "off", gib[0].round(10), gib[1])
    assert bodies["gib"].rounding == 0.0
    assert all(0.0 < bodies[name].rounding < 1e-5 for name in ("base", "slide"))
    flank = next(k for k, n in enumerate(bodies["slide"].face_planes[0]) if np.allclose(n, (np.sqrt(0.75), 0, 0.5)))
    assembly = fo.Assembly(
        bodies,
        [("slide", "base"), ("gib", "base"), {"parts": ["gib", "slide"], "goal": "clear"}],
        motions={"slide": fo.Translation("x") >> fo.Translation("z"), "gib": fo.Translation("x")},
        sizes=[fo.Size("flank", "slide", faces=[f"F{flank + 1}"], tolerance=0.03)],
    )
    assert fo.solve(assembly).amount <= 1e-9
    made = fo.solve(assembly.changed(made={"flank": 0.03}))
    assert made.usable
    assert made.amount == pytest.approx(0.03 / np.sqrt(0.75), abs=1e-6)


@pytest.mark.parametrize(("decimals", "single"), [(8, True), (10, True), (5, False)])
def test_digits_that_may_be_of_either_precision_are_taken_as_they_are(tmp_path, decimals, single):
    """Rounded to 5 decimals, both are alike: nothing tells that one was of single precision."""
    points = trimesh.creation.box((20, 30, 40)).vertices + np.array([12.3456789, 1 / 3, 77.7777777])
    triangles = np.array(trimesh.creation.box((20, 30, 40)).faces)
    found = []
    for own in (points, points.astype(np.float32).astype(float)):
        rows = [" ".join(f"{x:.{decimals}f}" for x in point) for point in own.tolist()]
        faces = [f"3 {a} {b} {c}" for a, b, c in triangles.tolist()]
        path = tmp_path / "box.off"
        path.write_text("\n".join(["OFF", f"{len(rows)} {len(faces)} 0", *rows, *faces]))
        found.append(fo.Body.from_file(path, unit="mm").rounding > 0.0)
    assert found == [False, single]


def test_single_precision_far_from_the_origin_is_not_called_exact(tmp_path):
    """At 8e6 the spacing of single precision is .5: a box of 20 is known to that, and it is said."""
    points = trimesh.creation.box((20, 30, 40)).vertices + 8e6 + 0.3
    triangles = np.array(trimesh.creation.box((20, 30, 40)).faces)
    body = read(tmp_path, "box", "stl", points, triangles)
    assert max(body.deviation) >= 0.25
    assert any("vertices are known to" in note for note in body.notes)
    assert "larger or 1.7 mm smaller: the rounded coordinates of box only" in known_to((body, body), "mm")[0]


@pytest.mark.slow
def test_a_ring_of_reflex_edges_that_is_no_face_is_plane(tmp_path):
    """Of 45 sides, the single precision copy came in 46 parts, and took 36 s, where the exact file has two."""
    plug, _, _ = chamfered(31, 0.7, 0.1)
    turn = Rotation.from_rotvec([0.3, 0.5, 0.7]).as_matrix()
    mesh = arrays(plug, turn, np.array([3.0, -2.0, 1.0]))
    assert len(read(tmp_path, "a", "stl", *mesh).parts) == len(read(tmp_path, "a", "off", *mesh).parts) == 2


def test_planes_are_grouped_as_by_comparing_all_pairs():
    """A torus of 81,000 triangles took 44 s: each plane was compared with each polygon."""
    rng = np.random.default_rng(3)
    points = np.round(rng.uniform(-2, 2, (60, 3)))
    triangles = [tuple(own) for own in (rng.permutation(60)[:3] for _ in range(900)) if _has_area(points[own])]
    normals = normals_of(points, triangles)
    levels = (normals * points[[own[0] for own in triangles]]).sum(axis=1)
    free, wanted = np.ones(len(triangles), bool), []
    for k in range(len(triangles)):
        if free[k]:
            off = np.abs(points[np.array(triangles)] @ normals[k] - levels[k]).max(axis=1)
            own = np.flatnonzero(free & ((off <= 1e-9) | (np.arange(len(free)) == k)))
            free[own] = False
            wanted.append(own.tolist())
    assert [own.tolist() for own in coplanar(points, triangles, normals, levels, 1e-9)] == wanted
    assert len(wanted) < 0.6 * len(triangles)


def _has_area(corners):
    return bool(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) > 1e-9)


def prism(tmp_path, name, outline, low, high):
    solid = m3.CrossSection([outline]).extrude(high - low).translate([0.0, 0.0, low])
    return read(tmp_path, name, "stl", *arrays(solid, np.eye(3), np.zeros(3)))


def test_slanted_walls_apart_from_each_other_are_parallel(tmp_path):
    """A flat of 45 degrees, .12 off its counterpart, had two contacts, each of an edge, moved by a size across it."""
    flat = 27.0 + 0.12 * 2**0.5
    spigot = prism(tmp_path, "spigot", [(-20, -15), (20, -15), (20, 7), (12, 15), (-20, 15)], 2.0, 14.0)
    room = [(-20.1, -15.1), (20.1, -15.1), (20.1, flat - 20.1), (flat - 15.1, 15.1), (-20.1, 15.1)]
    hole = m3.CrossSection([room]).extrude(20.0).translate([0, 0, -1])
    ring = m3.Manifold.cube([70, 60, 12]).translate([-35, -30, 0]) - hole
    recess = read(tmp_path, "recess", "stl", *arrays(ring, np.eye(3), np.zeros(3)))
    sizes = [
        fo.Size("length", "movable", faces=["+x", "-x"], each=0.5, tolerance=0.03),
        fo.Size("flat", "movable", faces={"through": (16, 11, 8)}, tolerance=0.04),
    ]
    problem = fo.Problem(spigot, recess, sizes=sizes, made={}, goal="clear", motion=fo.Translation("x"))
    rows = [row for pair in fo.stack_up(problem).touching.pairs for row in pair.values.tolist()]
    assert len(rows) == 5
    slanted = [row for row in rows if row[0] == pytest.approx(0.12, abs=1e-5)]
    assert [row[1:] for row in slanted] == [pytest.approx((0.0, -1.0), abs=1e-12)]


def test_a_wall_on_an_edge_that_overhangs_it_is_no_overlap_of_the_digits(tmp_path):
    """A rod of 45 degrees at the edge of a corner that is higher and deeper: a gap of -2.7e-06, no contact as drawn."""
    c, s = 60.0 - 4.0 / 2**0.5, 0.5**0.5
    rod = [(c + s * (u + w), c + s * (w - u)) for u, w in ((-75, -4), (75, -4), (75, 4), (-75, 4))]
    movable = prism(tmp_path, "rod", rod, 1.0, 21.0)
    static = prism(tmp_path, "corner", [(60, 60), (200, 60), (200, 200), (60, 200)], 0.0, 30.0)
    problem = fo.Problem(movable, static, target=(1, 1), goal="touch", motion=fo.Translation("x"))
    assert fo.decision_curve(problem.movable, problem.static).gap((1, 1)) == pytest.approx(0.0, abs=1e-12)
    assert fo.solve(problem).amount == 0.0
