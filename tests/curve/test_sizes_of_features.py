"""Sizes of plates with several holes, pockets, steps and slots: each feature's own, as manifold3d makes them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold
from scipy.spatial import ConvexHull

import fcdm_opt as fo
from fcdm_opt.curve.touching_sizes import TouchingSizes
from fcdm_opt.geometry.resizing import Resizing, fit_for_sizes, resized

CASES = Path(__file__).parents[1] / "cases"
SIDES = 12
Solid = Callable[[Any], Manifold]


def box(low: Any, high: Any) -> Manifold:
    return Manifold.cube(np.subtract(high, low).tolist()).translate(list(low))


def round_one(x: float, y: float, z: tuple[float, float], radius: float, wide: float | None = None) -> Manifold:
    """A prism, or a part of a pyramid, whose facets touch a cylinder or cone of these radii."""
    angles = 2.0 * np.pi * (np.arange(SIDES) + 0.5) / SIDES
    ring = np.column_stack([np.cos(angles), np.sin(angles)]) / np.cos(np.pi / SIDES)
    ends = ((radius, z[0]), (radius if wide is None else wide, z[1]))
    return Manifold.hull_points(np.vstack([np.column_stack([(x, y) + r * ring, np.full(SIDES, h)]) for r, h in ends]))


def body(solid: Manifold) -> fo.Body:
    mesh = solid.to_mesh64()
    corners = np.asarray(mesh.vert_properties)[:, :3]
    return fo.Body.from_mesh(corners, np.asarray(mesh.tri_verts), seed="box", name="plate", decomposition="exact")


def filled(made: fo.Body) -> Manifold:
    whole = Manifold()
    for part in made.parts:
        whole += Manifold.hull_points(part.vertices)
    return whole


def bore(name: str, x: float, y: float, radius: float, **how: Any) -> fo.Size:
    around = {"around": (x, y, 0.0), "axis": "z", "radius": radius / np.cos(np.pi / SIDES)}
    return fo.Size(name, "static", faces=around, tolerance=0.05, **(how or {"each": -0.5}))


def plane(name: str, *points: Any, each: float) -> fo.Size:
    return fo.Size(name, "static", faces=[{"through": point} for point in points], each=each, tolerance=0.05)


PLATE = box((-10, -8, 0), (10, 8, 4))
THROUGH = (-1.0, 5.0)
SCENES: dict[str, tuple[Solid, list[fo.Size]]] = {
    "three bores": (
        lambda p: (
            PLATE
            - round_one(-5, 0, THROUGH, 2 + p[0] / 2)
            - round_one(3, 3, THROUGH, 1.5 + p[1] / 2)
            - round_one(4 + p[3], -4, THROUGH, 2 + p[2] / 2)
        ),
        [bore("a", -5, 0, 2), bore("b", 3, 3, 1.5), bore("c", 4, -4, 2), bore("at", 4, -4, 2, along="x")],
    ),
    "two bores in a pocket": (
        lambda p: (
            PLATE
            - box((-6 - p[0] / 2, -5, 2 - p[1]), (6 + p[0] / 2, 5, 5))
            - round_one(2, 1, THROUGH, 1.5 + p[2] / 2)
            - round_one(-3, 1, THROUGH, 1.5 + p[3] / 2)
        ),
        [
            plane("width", (-6, 0, 3), (6, 0, 3), each=-0.5),
            plane("depth", (0, -3, 2), each=-1.0),
            bore("a", 2, 1, 1.5),
            bore("b", -3, 1, 1.5),
        ],
    ),
    "a slot and bores on both sides": (
        lambda p: (
            PLATE
            - box((-4 - p[0], -9, 2), (-1, 9, 5))
            - round_one(4, 1, THROUGH, 1.5 + p[1] / 2)
            - round_one(-7, 1, THROUGH, 1 + p[2] / 2)
        ),
        [plane("wall", (-4, 0, 3), each=-1.0), bore("a", 4, 1, 1.5), bore("b", -7, 1, 1)],
    ),
    "stepped bores": (
        lambda p: (
            PLATE
            - round_one(-5, 0, (-1, 3), 1.5 + p[1] / 2)
            - round_one(-5, 0, (2 - p[0], 5), 3 + p[2] / 2)
            - round_one(5, 0, THROUGH, 1.5)
            - round_one(5, 0, (2, 5), 3 + p[3] / 2)
        ),
        [plane("depth", (-5, 2.2, 2), each=-1.0), bore("a", -5, 0, 1.5), bore("b", -5, 0, 3), bore("c", 5, 0, 3)],
    ),
    "countersunk bores": (
        lambda p: (
            PLATE
            - round_one(-5, 0, THROUGH, 1.5 + p[0] / 2)
            - round_one(-5, 0, (1, 5), 0.5, 4.5)
            - round_one(5, 0, THROUGH, 1.5 + p[1] / 2)
            - round_one(5, 0, (1, 5), 0.5, 4.5)
        ),
        [bore("a", -5, 0, 1.5), bore("b", 5, 0, 1.5)],
    ),
    "bosses and bores through them": (
        lambda p: (
            PLATE
            + round_one(0, 0, (4, 7), 3 + p[0] / 2)
            + round_one(6, 5, (4, 6), 1 + p[1] / 2)
            - round_one(0, 0, (-1, 8), 1.5 + p[2] / 2)
            - round_one(-6, -5, THROUGH, 1 + p[3] / 2)
        ),
        [bore("a", 0, 0, 3, each=0.5), bore("b", 6, 5, 1, each=0.5), bore("c", 0, 0, 1.5), bore("d", -6, -5, 1)],
    ),
}


@pytest.mark.sampled(1)
@pytest.mark.parametrize("scene", SCENES)
def test_plates_with_several_features_refused_the_sizes_of_each(scene: str) -> None:
    """Cuts ran from one bore to another, along no face's plane; the parts made are now those that manifold3d makes."""
    solid, sizes = SCENES[scene]
    drawn = body(solid([0.0] * 4))
    cut = fit_for_sizes(drawn, tuple(sizes))
    assert cut.faces == drawn.faces
    rng = np.random.default_rng(len(scene))
    p = rng.uniform(-0.05, 0.05, 4)
    made = resized(cut, dict(zip(sizes, p.tolist(), strict=False)))
    right, whole = solid(p), filled(made)
    assert made.faces == drawn.faces
    assert (right - whole).volume() == pytest.approx(0.0, abs=1e-9)
    assert (whole - right).volume() == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["three bores", "stepped bores"])
def test_gaps_over_the_sizes_of_several_features_are_those_of_the_parts_made(scene: str) -> None:
    solid, sizes = SCENES[scene]
    plate = fit_for_sizes(body(solid([0.0] * 4)), tuple(sizes))
    pin = fo.Body.convex(np.array(list(product((-5.9, -4.2), (-0.6, 0.8), (1.0, 6.0)))), name="pin")
    touching = TouchingSizes.of(pin, plate, sizes)
    rng = np.random.default_rng(1)
    for p in rng.uniform(-0.05, 0.05, (2, len(sizes))):
        made = resized(plate, dict(zip(sizes, p.tolist(), strict=True)))
        assert touching.gap(p) == pytest.approx(fo.decision_curve(pin, made).gap((1.0, 1.0)), abs=1e-12)
        assert touching.gap(p) > 0.0


def dowels(static: str) -> tuple[fo.Body, fo.Body]:
    pins, plate = (fo.Body.from_file(CASES / f"{name}.off", unit="mm") for name in ("dowels", static))
    return pins, plate


@pytest.mark.slow
def test_two_dowels_in_two_bores_have_the_play_that_is_left_of_each_and_the_pitch() -> None:
    """It was refused: the plate was "cut beside face F47 along no face's plane"."""
    pins, plate = dowels("dowels_holes")
    sizes = [
        fo.Size(f"{kind} {k}", role, faces=f"{face} radius 1.256 no. {k}", each=each, tolerance=tolerance)
        for kind, role, face, each, tolerance in (
            ("pin", "movable", "cylinder", 0.5, (0.002, 0.008)),
            ("bore", "static", "bore", -0.5, (0.010, 0.022)),
        )
        for k in (1, 2)
    ]
    pitch = fo.Size("pitch", "static", faces="bore radius 1.256 no. 2", along="x", tolerance=0.05)
    problem = fo.Problem(pins, plate, sizes=[*sizes, pitch], goal="clear", motion=fo.Translation("x"))
    stack = fo.stack_up(problem)
    # each facet of a pin looks at one of its bore: half the difference of the diameters, less what the pitch takes
    steepest = np.cos(np.pi / 32)
    worst = 0.5 * (0.010 - 0.008)
    assert stack.touching.least()[0] == pytest.approx(worst - 0.05 * steepest, abs=1e-9)
    assert stack.touching.largest()[0] == pytest.approx(0.5 * (0.022 - 0.002), abs=1e-9)
    rng = np.random.default_rng(2)
    low, high = np.array([size.tolerance for size in [*sizes, pitch]]).T
    for one, two, wide, wider, off in rng.uniform(low, high, (15, 5)):
        play = min(0.5 * (wide - one), 0.5 * (wider - two) - steepest * abs(off))
        assert stack.touching.gap((one, two, wide, wider, off)) == pytest.approx(play, abs=1e-9)
    made = {"pin 1": 0.005, "pin 2": 0.004, "bore 1": 0.016, "bore 2": 0.02, "pitch": 0.01}
    solved = fo.solve(problem.changed(made=made))
    need = (0.01 * steepest - 0.008) / steepest  # of the second pin; the first has 0.0055
    assert solved.usable
    assert solved.parameters["TX"] == pytest.approx(need, abs=1e-9)


@pytest.mark.slow
def test_a_dowel_in_a_slot_beside_one_in_a_bore_has_sizes() -> None:
    pins, plate = dowels("dowels_slot")
    sizes = [
        fo.Size("bore", "static", faces="bore radius 1.256", each=-0.5, tolerance=(0.010, 0.022)),
        fo.Size("pin", "movable", faces="cylinder radius 1.256 no. 1", each=0.5, tolerance=(0.002, 0.008)),
        fo.Size("pitch", "movable", faces="cylinder radius 1.256 no. 2", along="x", tolerance=0.05),
    ]
    problem = fo.Problem(pins, plate, sizes=sizes, goal="clear", clearance=0.004, motion=fo.Translation("x"))
    made = {"bore": 0.015, "pin": 0.004, "pitch": 0.05}
    gaps = TouchingSizes.of(problem.request["movable"], problem.request["static"], sizes)
    assert float(gaps.gap((0.015, 0.004, 0.05))) == pytest.approx(0.0, abs=1e-8)  # the slot has no play
    parts = problem.changed(made=made)
    common = filled(parts.movable) ^ filled(parts.static)
    assert common.volume() == pytest.approx(0.0, abs=1e-6)


@pytest.mark.slow
def test_facets_of_other_bores_at_the_same_distance_were_taken_for_a_cylinders() -> None:
    solid, sizes = SCENES["three bores"]
    drawn = body(solid([0.0] * 4))
    for size in sizes:
        assert np.count_nonzero(size.offsets(drawn)) in ((SIDES,) if size.along is None else (SIDES, SIDES - 2))


def test_a_shoulders_bore_left_corners_that_only_the_drawn_mesh_had() -> None:
    """Corners of triangles inside a face went to other ends of it: "own elements" failed."""
    frame = [
        ((-5, -5), (-1, 5)), ((1, -5), (5, 5)), ((-1, -5), (1, -1)), ((-1, 1), (1, 5)),
    ]  # fmt: skip
    wide = [((-5, -5), (-2, 5)), ((2, -5), (5, 5)), ((-2, -5), (2, -2)), ((-2, 2), (2, 5))]
    plate, shaft = Manifold(), box((-1, -1, -0.5), (1, 1, 2)) + box((-2, -2, 2), (2, 2, 5))
    for low, high in frame:
        plate += box((*low, 0), (*high, 2))
    for low, high in wide:
        plate += box((*low, 2), (*high, 4))
    walls = [{"through": point} for point in ((1, 0, 1), (-1, 0, 1), (0, 1, 1), (0, -1, 1))]
    size = fo.Size("bore", "static", faces=walls, each=-0.5, tolerance=0.2)
    parts = body(shaft), body(plate)
    for made in (0.0143, 0.1):
        for axis in "xyz":
            problem = fo.Problem(*parts, sizes=[size], made={"bore": made}, goal="touch", motion=fo.Translation(axis))
            solution = fo.solve(problem)
            assert solution.status is fo.Status.ALREADY_SATISFIED
            assert solution.certificate.passed


TEE = box((-1, -1, 0), (1, 1, 3)) + box((-2, -2, 3), (2, 2, 4))
SLOT = box((-5, -5, 0), (5, 5, 4)) - box((-0.5, -6, 2), (0.5, 6, 5))


@pytest.mark.parametrize(
    ("solid", "size", "taken", "refused"),
    [
        (TEE, plane("stem", (1, 0, 1), (-1, 0, 1), each=0.5), (-1.9, 1.9), (2.0, 2.5, -2.0)),
        (SLOT, plane("slot", (-0.5, 0, 3), (0.5, 0, 3), each=-0.5), (-0.99, 2.0), (-1.0, -1.01)),
    ],
)
def test_a_slot_closed_exactly_by_its_sizes_was_taken(solid: Any, size: fo.Size, taken: Any, refused: Any) -> None:
    drawn = body(solid)
    for value in taken:
        assert resized(drawn, {size: value}).faces == drawn.faces
    for value in refused:
        with pytest.raises(fo.InputError, match="the body changes its shape at these sizes"):
            resized(drawn, {size: value})


@pytest.mark.slow
def test_cuts_that_end_elsewhere_do_not_end_the_sizes_of_a_stack_up() -> None:
    """A cut that passes a corner of the plate changes parts, not the solid; it was refused from there on."""
    solid, sizes = SCENES["two bores in a pocket"]
    wide = [fo.Size(size.name, "static", faces=size.faces, each=size.each, tolerance=0.6) for size in sizes]
    plate = fit_for_sizes(body(solid([0.0] * 4)), tuple(wide))
    pin = fo.Body.convex(np.array(list(product((1.0, 2.4), (0.6, 1.4), (1.0, 6.0)))), name="pin")
    assert Resizing.of(plate, wide).valid_up_to(np.full(4, -0.6), np.full(4, 0.6))[0] < 3.4
    touching = TouchingSizes.of(pin, plate, wide)
    for p in np.random.default_rng(3).uniform(-0.6, 0.6, (2, 4)):
        made = resized(plate, dict(zip(wide, p.tolist(), strict=True)))
        assert touching.gap(p) == pytest.approx(fo.decision_curve(pin, made).gap((1.0, 1.0)), abs=1e-12)
        assert (filled(made) - solid(p)).volume() + (solid(p) - filled(made)).volume() < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["stl"])  # its digits are fewer than those of the OFF
def test_a_cones_name_was_refused_and_its_label_moved_one_facet_of_it(suffix: str) -> None:
    plug, socket = (fo.Body.from_file(CASES / f"taper_{name}.{suffix}", unit="mm") for name in ("plug", "socket"))
    steep = max(abs(n[2]) for n in plug.face_planes[0] if abs(n[2]) < 0.5)
    cone = "cone radius 7.391 to 9.015"
    for role, faces, each, made in (
        ("movable", cone, 0.5, 0.01), ("static", "F7", -0.5, -0.01),
    ):  # fmt: skip
        size = fo.Size("diameter", role, faces=faces, each=each, tolerance=0.02)
        assert np.count_nonzero(size.offsets(plug if role == "movable" else socket)) == 32
        own = {"sizes": [size], "made": {"diameter": made}}
        asked = fo.Problem(plug, socket, goal="touch", motion=fo.Translation("z"), **own)
        solution = fo.solve(asked)
        assert solution.usable
        assert solution.parameters["TZ"] == pytest.approx(-0.005 / steep, rel=1e-4)  # -.20123: digits of the STL


def test_names_of_balls_and_hollows_are_sizes_too() -> None:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=3.0)
    solid = fo.Body.from_mesh(ball.vertices, ball.faces, name="ball")
    for faces in ("sphere radius 3", "F1"):
        assert np.count_nonzero(fo.Size("d", "movable", faces=faces, each=0.5).offsets(solid)) == len(solid.faces)
    with pytest.raises(fo.InputError, match="has this name"):
        fo.Size("d", "movable", faces="sphere radius 4").offsets(solid)


def test_a_notch_whose_cut_ran_into_a_corner_elsewhere() -> None:
    """A V-block, its notch off by .02: the flank's plane meets the block's far corner, and the part stuck out there."""
    outline = [(-30, -10), (20, -10), (20, 14), (3.75, 14), (0, 5), (-12, 14), (-30, 14)]  # -9 / 12 from (-12, 14) on
    mesh = Manifold.extrude(CrossSection([np.array(outline, float)]), 20.0).to_mesh64()
    block = fo.Body.from_mesh(mesh.vert_properties[:, :3], mesh.tri_verts, name="block")
    flanks = [k for k, n in enumerate(block.face_planes[0]) if n[1] > 0.1 and abs(n[0]) > 0.1]
    notch = fo.Size("notch", "static", faces=[f"F{k + 1}" for k in flanks], along="x", tolerance=0.1)
    made = resized(block, {notch: 0.02})
    assert made.faces == block.faces
    for label, (was, now) in enumerate(zip(block.vertices, made.vertices, strict=False), 1):
        moved = label in {corner for k in flanks for corner in block.faces[k]}
        assert now == pytest.approx(np.add(was, (0.02 * moved, 0.0, 0.0)), abs=1e-12)
    assert sum(ConvexHull(part.vertices).volume for part in made.parts) == pytest.approx(20.0 * (1200 - 9 * 15.75 / 2))


HIGH = 100.0


def profile(low: Any, high: Any, axis: int) -> Manifold:
    """A prism along an axis, x or y, of given corners (across, z)."""
    other, points = 1 - axis, []
    for end in (-HIGH, HIGH):
        for across, z in (*low, *high):
            point = [0.0, 0.0, z]
            point[axis], point[other] = end, across
            points.append(point)
    return Manifold.hull_points(np.array(points))


def flared(axis: int, low: float, high: float, flare: float) -> Manifold:
    """The space between two walls that turn outwards by 45 degrees: below z = flare, of walls 5 or 2 off the middle."""
    wide = (5.0, 2.0)[axis]
    between = profile([(low, -8.0), (high, -8.0)], [(low, 0.0), (high, 0.0)], 1 - axis)
    mouth = [(-wide + 3.0, flare - 3.0), (wide - 3.0, flare - 3.0)] if axis == 0 else [(0.0, flare - 2.0)]
    return between + profile(mouth, [(-wide + flare, 0.0), (wide - flare, 0.0)], 1 - axis)


@pytest.mark.parametrize("moved", [0.1, -0.1, 0.25])
def test_the_foot_of_a_chamfer_stayed_where_the_wall_below_had_moved(moved: float) -> None:
    # four faces that no longer share a point, convex and concave in turn: each wall with its chamfer, as in a sketch
    def pocket(x: float) -> Manifold:
        return box((-8, -5, -12), (8, 5, 0)) - (flared(0, -5.0 + x, 5.0 + x, -1.0) ^ flared(1, -2.0, 2.0, -1.0))

    walls = fo.Size("x", "static", faces=[{"through": (k, 0, -5)} for k in (-5, 5)], along="x", tolerance=0.3)
    drawn = fit_for_sizes(body(pocket(0.0)), (walls,))
    made, wanted = filled(resized(drawn, {walls: moved})), pocket(moved)
    assert abs(wanted.volume() - pocket(0.0).volume()) > 1e-15
    assert (made - wanted).volume() + (wanted - made).volume() <= 1e-9


@pytest.mark.parametrize("moved", [0.1, -0.1, 0.25])
def test_the_top_of_a_flare_stayed_where_the_wall_above_had_moved(moved: float) -> None:
    ridge = [(-3.0, 0.0, 3.0), (3.0, 0.0, 3.0)]
    flare = Manifold.hull_points(np.array([*product((-6.0, 6.0), (-3.0, 3.0), (0.0,)), *ridge]))

    def boss(x: float) -> Manifold:
        return box((-9, -6, -3), (9, 6, 0)) + flare + box((-5.0 + x, -2, -1), (5.0 + x, 2, 6))

    walls = fo.Size("x", "static", faces=[{"through": (k, 0, 4)} for k in (-5, 5)], along="x", tolerance=0.3)
    made, wanted = filled(resized(fit_for_sizes(body(boss(0.0)), (walls,)), {walls: moved})), boss(moved)
    assert (made - wanted).volume() + (wanted - made).volume() <= 1e-9


def test_a_plug_was_held_by_a_lip_that_a_wider_pocket_does_not_have() -> None:
    pocket = box((-8, -5, -12), (8, 5, 0)) - (flared(0, -5.0, 5.0, -1.0) ^ flared(1, -2.0, 2.0, -1.0))
    plug = fo.Box((9.8, 3.8, 10.0), centre=(0.0, 0.0, -2.5), name="plug")
    walls = fo.Size("x", "static", faces=[{"through": (k, 0, -5)} for k in (-5, 5)], along="x", tolerance=0.3)
    problem = fo.Problem(plug, body(pocket), sizes=[walls], made={"x": 0.25}, goal="touch", motion=fo.Translation("x"))
    solution = fo.solve(problem, certify=True)
    assert solution.amount == pytest.approx(0.15, abs=1e-9)
    assert solution.lower_bound == pytest.approx(0.15, abs=1e-9)
