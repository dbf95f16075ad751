"""Short names of round and large faces, by prisms whose radii are known."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from fcdm_opt import Body, Problem, Size, Translation, decision_curve, solve, stack_up
from fcdm_opt.curve.features import Feature
from fcdm_opt.drafting.draft import widths
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.exact_points import exact_at
from fcdm_opt.geometry.facet_errors import all_recognised, round_surfaces
from fcdm_opt.geometry.naming import element_text, names_of_faces, names_of_rows
from fcdm_opt.geometry.patches import line_of_contact, true_faces
from fcdm_opt.geometry.primitives import Box, Cylinder, Sphere, Torus, cut, joined
from fcdm_opt.geometry.resizing import Resizing, _by_features, resized
from fcdm_opt.geometry.round_recognition import round_faces
from fcdm_opt.show.stacks import print_faces


def ring(radius: float, count: int, z: float) -> np.ndarray:
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(count, z)])


def prism(radius: float, count: int, z: tuple[float, float] = (0.0, 5.0)) -> np.ndarray:
    return np.vstack([ring(radius, count, end) for end in z])


def tube(inner: float, outer: float, count: int) -> Body:
    rings = [ring(radius, count, z) for z in (0.0, 5.0) for radius in (inner, outer)]
    sectors = [np.vstack([own[[k, (k + 1) % count]] for own in rings]) for k in range(count)]
    return Body.from_parts(sectors, seed=np.zeros(3))


def turned(body: Body, axis: np.ndarray) -> Body:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(axis).as_matrix()
    T[:3, 3] = 3.0, -1.0, 7.0
    return body.moved(T)


@pytest.mark.parametrize(
    ("count", "axis"), [(12, np.array([0.3, -0.7, 0.2])), (24, np.zeros(3)), (60, np.array([0.3, -0.7, 0.2]))]
)
def test_facets_around_an_axis_are_a_cylinder_outside_and_a_bore_inside(count: int, axis: np.ndarray) -> None:
    shaft = names_of_faces(turned(Body.convex(prism(9.9, count)), axis))
    assert Counter(shaft.values())["cylinder radius 9.9"] == count
    bored = Counter(names_of_faces(turned(tube(10.0, 30.0, count), axis)).values())
    assert (bored["cylinder radius 30"], bored["bore radius 10"]) == (count, count)


def test_a_face_of_many_corners_is_named_after_where_it_is() -> None:
    shaft = Body.convex(prism(9.9, 24))
    names = names_of_faces(shaft)
    large = {names[face]: {shaft.vertices[v - 1][2] for v in face} for face in shaft.faces if len(face) == 24}
    assert large == {"bottom": {0.0}, "top": {5.0}}


@pytest.mark.parametrize("count", [3, 4, 5])
def test_a_prism_of_few_sides_is_no_cylinder(count: int) -> None:
    assert names_of_faces(Body.convex(prism(1.0, count))) == {}


@pytest.mark.parametrize("axis", [np.zeros(3), np.array([0.3, -0.7, 0.2])], ids=["drawn", "turned"])
def test_facets_around_a_point_are_a_sphere(axis: np.ndarray) -> None:
    ball = turned(Body.convex(trimesh.creation.icosphere(2, radius=4.0).vertices), axis)
    assert set(names_of_faces(ball).values()) == {"sphere radius 4"}
    edge = tuple(sorted(ball.faces[0][:2]))
    for element in (Element("F", ball.faces[0]), Element("E", edge), Element("V", (7,))):
        assert element_text(ball, element) == "sphere of radius 4"


def test_a_cone_is_no_sphere() -> None:
    """Both rings of a frustum lie on one sphere."""
    frustum = Body.convex(np.vstack([ring(3.0, 32, 0.0), ring(2.0, 32, 2.0)]))
    assert set(names_of_faces(frustum).values()) == {"cone radius 2 to 3", "top", "bottom"}


def test_an_oval_is_no_cylinder() -> None:
    corners = prism(1.0, 24) * [2.0, 1.0, 1.0]
    assert set(names_of_faces(Body.convex(corners)).values()) == {"top", "bottom"}


def test_what_is_told_of_a_contact_is_short_and_its_label_is_as_before() -> None:
    lid, plate = Body.convex(prism(9.9, 24, (5.0, 9.0)), name="lid"), Body.convex(prism(30.0, 48), name="plate")
    curve = decision_curve(lid, plate, box=((0.9, 1.1), (0.9, 1.1)))
    features = {segment.feature for segment in curve.segments}
    assert "F1F2(P1 bottom; P2 top)" in {feature.described(lid, plate) for feature in features}
    assert all(Feature.from_label(feature.label) == feature for feature in features)
    side = next(face for face in lid.faces if len(face) == 4)
    corners = ",".join(f"V{v}" for v in side)
    told = Feature.from_label(f"F1V2(P1{corners}; P2V3)").described(lid, plate)
    assert told == f"F1V2(P1{corners} of cylinder radius 9.9; P2V3)"


def test_names_that_mean_one_feature_are_taken_as_labels_are() -> None:
    plate = Body.convex(prism(9.9, 24), name="plate")
    cube = 3.0 * (np.array(list(product([0.0, 1.0], repeat=3))) - 0.5)
    lid = Body.convex(np.array([8.0, 1.0, 7.2]) + Rotation.from_rotvec([0.3, 0.5, 0.1]).apply(cube), name="lid")
    box = ((0.3, 3.0), (0.3, 3.0))
    first = decision_curve(lid, plate, box=box).switching_points[0]
    labels = [feature.label for feature in first.features]
    names = [feature.described(lid, plate) for feature in first.features]
    assert names[0] == "V1F2(P1V5; P2 top)" != labels[0]

    def tracked(given: list[str]) -> tuple[Feature, ...]:
        shifts = Translation("x") >> Translation("z")
        asked = Problem(lid, plate, nominal=1, requirement="A", tolerance=0.01, features=given, motion=shifts, box=box)
        return asked.tracked_features

    assert tracked(names) == tracked(labels)
    with pytest.raises(InputError, match="not a feature label"):
        tracked(["V1F2(P1V5; P2 bottom)", labels[1]])


def lathe(*profile: tuple[float, float], count: int = 24) -> list[np.ndarray]:
    """Slices of a solid turned about z, a convex part between two rings each."""
    rings = [ring(radius, count, z) for radius, z in profile]
    return [np.vstack(two) for two in pairwise(rings)]


@pytest.mark.parametrize("axis", [np.zeros(3), np.array([0.3, -0.7, 0.2])], ids=["drawn", "turned"])
def test_facets_about_an_apex_are_a_cone_outside_and_a_countersink_inside(axis: np.ndarray) -> None:
    plug = Body.from_parts(lathe((4.0, 0.0), (4.0, 10.0), (8.0, 14.0), (8.0, 15.0)), seed=np.zeros(3))
    assert Counter(names_of_faces(turned(plug, axis)).values()) >= Counter(
        {"cone radius 4 to 8": 24, "cylinder radius 4": 24, "cylinder radius 8": 24}
    )
    lower, upper, count = (ring(4.0, 24, 0.0), ring(9.0, 24, 0.0)), (ring(6.0, 24, 3.0), ring(9.0, 24, 3.0)), 24
    sectors = [np.vstack([own[[k, (k + 1) % count]] for own in (*lower, *upper)]) for k in range(count)]
    assert Counter(names_of_faces(turned(Body.from_parts(sectors), axis)).values())["countersink radius 4 to 6"] == 24


def test_rings_of_a_rounding_are_no_cones() -> None:
    angles = np.linspace(0.0, np.pi / 2.0, 9)
    bullet = Body.from_parts(lathe(*((5.0 + np.cos(a), np.sin(a)) for a in angles)), seed=np.zeros(3))
    assert not any("cone" in name for name in names_of_faces(bullet).values())


def test_a_sphere_that_is_cut_off_is_one() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=6.0)
    ends = ball.vertices[ball.edges_unique]
    share = (1.7 - ends[:, 0, 2]) / (ends[:, 1, 2] - ends[:, 0, 2] + 1e-300)
    cut = ends[:, 0] + share[:, None] * (ends[:, 1] - ends[:, 0])
    kept = [ball.vertices[ball.vertices[:, 2] < 1.7], cut[(share > 0.0) & (share < 1.0)]]
    assert Counter(names_of_faces(Body.convex(np.vstack(kept))).values())["sphere radius 6"] >= 300


def test_of_several_faces_in_one_plane_one_was_named_for_all() -> None:
    """The tips of a comb's three teeth are its left end: numbered, and "left" as the faces of a size means all."""
    comb = Body.from_file(Path(__file__).parents[1] / "cases" / "comb.off", unit="mm")
    names = names_of_rows(comb)
    tips = [
        row
        for row, face in enumerate(comb.faces)
        if np.ptp(comb.vertices[np.array(face) - 1], axis=0)[0] == 0.0
        and comb.vertices[face[0] - 1][0] == comb.vertices[:, 0].min()
    ]
    assert [names[row] for row in tips] == ["left no. 1", "left no. 2", "left no. 3"]
    assert len(set(names)) == len(names)
    told = [element_text(comb, Element("F", tuple(sorted(comb.faces[row])))) for row in tips]
    assert told[1] == "left face no. 2 (facing -x)"
    for faces, meant in (("left", tips), ("left no. 2", tips[1:2]), (f"F{tips[2] + 1}", tips[2:])):
        assert np.flatnonzero(Size("tips", "movable", faces=faces).offsets(comb)).tolist() == meant


def test_corners_of_bodies_with_many_were_told_by_numbers_that_nothing_lists() -> None:
    block = cut(Box((4.0, 2.0, 2.0)), Cylinder(0.5, 3.0, base=(1.0, 0.0, -1.5), facets=12))
    corner = next(k for k, point in enumerate(block.vertices, 1) if np.allclose(point, (-2.0, -1.0, 1.0)))
    assert element_text(block, Element("V", (corner,))) == "corner at (-2, -1, 1)"
    exact = exact_at(block, [])
    assert exact is not None
    own = range(len(block.vertices) + 1, len(exact.vertices) + 1)
    words = {element_text(exact, Element("V", (v,))) for v in own}
    assert words
    assert all(word.startswith(("corner at (", "edge between ")) or word == "bore of radius 0.5" for word in words)


def test_the_plane_face_of_a_piece_at_the_rim_of_a_bore_was_told_as_the_bore() -> None:
    """The top about a bore: a third contact was told, and numbered, between a foot on it and the bore."""
    plate = cut(Box((30, 30, 6), centre=(0, 0, -3)), Cylinder(4.0, 8.0, base=(0, 0, -7)))
    exact = exact_at(plate, [(4.0, 0.0, 0.0)])
    assert exact is not None
    assert exact.exact is not None
    (piece,) = exact.exact.pieces
    own = [element for element in exact.parts[-1].elements["F"] if piece.first <= min(element.vertices)]
    level = [face for face in own if not exact.vertices[np.array(face.vertices) - 1, 2].any()]
    assert [element_text(exact, face) for face in level] == ["top face (facing +z)"]
    assert {element_text(exact, face) for face in own if face not in level} == {"bore of radius 4"}


def test_a_part_cut_anew_for_its_sizes_lost_its_round_faces() -> None:
    plate = cut(Box((30, 30, 6)), *(Cylinder(r, 10, base=(x, 0, -5), facets=12) for x, r in ((-7, 3), (7, 4))))
    again = _by_features(plate, 0)
    assert again is not plate
    assert [[own.radius for own, _ in body.surfaces or ()] for body in (plate, again)] == [[3.0, 4.0]] * 2


def test_a_line_of_contact_was_as_long_as_the_piece_that_is_exact_there() -> None:
    """A roller of 30 on a table of 20; a ball touches in a point."""
    roller, table = Cylinder(5.0, 30.0, base=(0, -15, 5), axis=(0, 1, 0)), Box((40, 20, 10), centre=(0, 0, -5))
    faces = true_faces(roller), true_faces(table)
    line = line_of_contact(faces, (1.0, 1.0), np.eye(4), np.array([0.0, 3.0, 0.0]))
    assert line is not None
    np.testing.assert_allclose(line[np.argsort(line[:, 1])], [[0, -10, 0], [0, 10, 0]], atol=1e-9)
    ball = true_faces(Sphere(5.0, centre=(0, 0, 5), facets=12))
    assert line_of_contact((ball, faces[1]), (1.0, 1.0), np.eye(4), np.zeros(3)) is None


def test_the_tip_of_a_cone_had_a_radius_and_facets_stood_for_round_faces_where_these_meet_others() -> None:
    turns = np.arange(48) * np.pi / 24.0
    ring = np.column_stack([4.0 * np.cos(turns), 4.0 * np.sin(turns), np.zeros(48)])
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    cone = Body.convex(np.vstack([ring, [0.0, 0.0, 5.0]]) @ turn.T + [1.1, 2.2, -3.3])
    assert "cone radius 0 to 4" in names_of_faces(cone).values()
    plate = cut(Box((20, 20, 10), name="plate"), Cylinder(8, 20, base=(0, 0, -10)))
    bore = Size("bore", "static", faces="bore radius 8", each=-1.0, tolerance=0.1)
    asked = {"motion": Translation("x"), "goal": "touch", "sizes": [bore], "made": {"bore": 2.5}}
    with pytest.raises(InputError, match=r"faces meet otherwise than as drawn: face \w+, bore radius 8"):
        solve(Problem(Cylinder(7, 30, base=(0, 0, -15)), plate, **asked))


def test_facets_of_a_torus_were_listed_one_by_one(capsys: pytest.CaptureFixture[str]) -> None:
    ring = Torus(10, 3, name="ring", facets=24)
    print_faces(ring, "movable")
    (line,) = (own for own in capsys.readouterr().out.splitlines() if "torus" in own)
    assert line.split()[:-1] == ["F1", *f"torus radius 3 round its ring, {len(ring.faces)} facets".split()]
    print_faces(ring.faceted(), "movable")
    listed = capsys.readouterr().out.splitlines()
    assert listed[-1] == f"... and {len(ring.faces) - 200} more: --json lists all"


def slotted(ends: tuple[float, ...], length: float, facets: int, middle: float = 0.0, flattened: float = 1.0) -> Body:
    """A mesh of a block with a slot 8 wide along x, closed by half turns about these places, from an STL's floats."""
    block = Box((60, 40, 15), centre=(0, 0, -7.5))
    slot = Box((length, 8, 11), centre=(middle, 0, -4.5))
    circle = ring(4.0, facets, 0.0) * (flattened, 1.0, 1.0)
    turns = (Body.convex(np.vstack([np.add(circle, (x, 0.0, z)) for z in (-10.0, 1.0)])) for x in ends)
    solid = cut(block, slot, *turns)
    corners = solid.face_triangles[0].reshape(-1, 3).astype(np.float32).astype(float)
    points, rows = np.unique(corners, axis=0, return_inverse=True)
    return Body.from_mesh(points, rows.reshape(-1, 3), seed=(0, 0, 0), name="block")


@pytest.mark.parametrize("facets", [12, 24, 48, pytest.param(96, marks=pytest.mark.slow)])
def test_half_turns_that_planes_go_on_from_are_round(facets: int) -> None:
    """The walls of a slot turn against the last facet of its end by less than the next one does, and were taken in."""
    slots = {
        "two ends": slotted((-2.0, 2.0), 4.0, facets),
        "one end": slotted((0.0,), 31.0, facets, 15.5),
        "in the wall": slotted((30.0,), 0.1, facets, 30.05),
    }
    for name, body in slots.items():
        round_one = body.rounded()
        found = {float(own.origin[0].round(5)): (own.radius, len(rows)) for own, rows in round_surfaces(round_one)}
        places = {"two ends": (-2.0, 2.0), "one end": (0.0,), "in the wall": (30.0,)}[name]
        assert sorted(found) == pytest.approx(places, abs=1e-4), name
        assert [*found.values()] == [(pytest.approx(4.0, rel=1e-6), facets // 2)] * len(places)
        assert all_recognised(round_one)
        assert Counter(names_of_rows(body))[f"bore radius 4{' no. 1' * (len(places) > 1)}"] == facets // 2


@pytest.mark.slow
def test_a_pin_slides_to_the_true_end_of_a_slot() -> None:
    """As far as 2 + 4 - 3.9; to facets of an end that was taken for a polygon it was 4 (1 - cos 7.5 deg) less."""
    pin = Cylinder(3.9, 12, base=(0, 0, -9), name="pin")
    for end in (-2.1, 2.1):
        limits = {"TX": (min(end, 0.0) * 2.0, max(end, 0.0) * 2.0)}
        block = slotted((-2.0, 2.0), 4.0, 24).rounded()
        asked = Problem(pin, block, motion=Translation("x"), goal="touch", limits=limits, target=(1, 1))
        assert solve(asked).parameters["TX"] == pytest.approx(end, abs=2e-6)


def across_slot(flattened: float) -> Problem:
    """A pin with 0.02 of play in a slot, of which a size shifts the walls."""
    pin = Cylinder(3.98, 12, base=(0, 0, -9), name="pin")
    walls = [{"through": (0, y, -5)} for y in (-4, 4)]
    place = Size("place", "static", faces=walls, along="y", tolerance=0.03)
    block = slotted((-2.0, 2.0), 4.0, 48, flattened=flattened).rounded()
    return Problem(pin, block, motion=Translation("y"), goal="clear", sizes=[place], made={"place": 0.03})


def test_the_ends_of_a_slot_go_with_its_walls() -> None:
    """Refused, as "nothing may be left of body 'base'"."""
    asked = across_slot(1.0)
    found = round_surfaces(asked.static)
    assert sorted(own.origin[:2].tolist() for own, _ in found) == [
        pytest.approx([x, 0.03], abs=1e-6) for x in (-2.0, 2.0)
    ]
    assert [own.radius for own, _ in found] == pytest.approx([4.0, 4.0], rel=1e-6)
    assert solve(asked).parameters["TY"] == pytest.approx(0.01, abs=1e-6)
    assert stack_up(asked).worst().least == pytest.approx(0.02 - 0.03, abs=1e-6)


@pytest.mark.slow
def test_what_goes_on_from_a_wall_that_moves_is_named() -> None:
    """An end that is half of an oval is no round face, and its first facets would be gone."""
    asked = across_slot(0.8)
    (place,) = asked.sizes
    told = Resizing.of(asked.request["static"], [place]).parted()
    assert re.fullmatch(r"faces (F\d+,? ){2}move, and faces (F\d+, ){4}which go on from there, do not", told)
    with pytest.raises(InputError, match="nothing may be left of a piece that is cut off body 'block'"):
        stack_up(asked.changed(sizes=[replace(place, tolerance=0.1)]))


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("radius", "flat", "count"), [(8.05, 6.05, 48), (10.0, 8.0, 128), (9.9, 7.9, 128)])
@pytest.mark.parametrize("inside", [False, True], ids=["shaft", "hub"])
def test_a_flat_that_cuts_through_facets_left_a_round_wall_without_its_cylinder(
    tmp_path: Path, radius: float, flat: float, count: int, inside: bool
) -> None:
    """Whole facets have both corners below the flat; the two that it cuts have one, and stand for the wall too."""
    cylinder = trimesh.creation.cylinder(radius=radius, height=40.0, sections=count)
    above = trimesh.creation.box(bounds=((-20.0, flat, -30.0), (20.0, 20.0, 30.0)))
    shaft = trimesh.boolean.difference([cylinder, above])
    block = trimesh.creation.box(bounds=((-20.0, -20.0, 0.0), (20.0, 20.0, 15.0)))
    (trimesh.boolean.difference([block, shaft]) if inside else shaft).export(tmp_path / "part.stl")
    body = Body.from_file(tmp_path / "part.stl", unit="mm")
    angles = 2.0 * np.pi * np.arange(count) / count
    whole = sum(np.sin(a) * radius < flat and np.sin(a + angles[1]) * radius < flat for a in angles)
    names = Counter(names_of_faces(body).values())
    assert names[f"{'bore' if inside else 'cylinder'} radius {radius:g}"] == whole + 2
    assert all_recognised(body.rounded())
    offered = {name: (faces, each) for faces, name, _, each in widths(body)}
    normals, points = body.face_planes
    (k,) = np.flatnonzero((np.abs(normals[:, 1]) > 1.0 - 1e-9) & (np.abs(points[:, 1] - flat) < 1e-5))
    assert offered[f"flat F{k + 1}"] == ((f"F{k + 1}",), -1.0 if inside else 1.0)
    assert offered[f"{'bore' if inside else 'cylinder'} diameter {2.0 * radius:g}"][1] == (-0.5 if inside else 0.5)
    assert not any("slanted" in what for _, _, what, _ in widths(body))


def test_a_pin_that_came_out_larger_took_its_number_from_the_others():
    places = (0.0, 10.0, 20.0)
    pins = [Cylinder(2.0, 6.0, base=(x, 0.0, -1.0)) for x in places]
    plate = joined(Box((40.0, 10.0, 2.0), centre=(10.0, 0.0, -1.0)), *pins, name="plate")
    sizes = [Size(f"pin {k}", "static", faces=f"cylinder radius 2 no. {k}", tolerance=0.1) for k in (1, 2, 3)]

    def names(*made: float) -> list[str]:
        one = resized(plate, dict(zip(sizes, made, strict=True)))
        found = dict.fromkeys(names_of_faces(one)[own.faces[0]] for own in sorted(round_faces(one), key=x_of(one)))
        return list(found)

    def x_of(one: Body):
        return lambda own: one.vertices[np.unique(own.faces) - 1, 0].mean()

    drawn = [name.rsplit(" ", 1)[1] for name in names(0.0, 0.0, 0.0)]  # of the pins from left to right
    which = [int(number) - 1 for number in drawn]
    for made in ((0.0, 0.05, 0.0), (0.01, 0.05, 0.02)):
        assert names(*made) == [f"cylinder radius {2.0 + made[k]:g} no. {k + 1}" for k in which]


def test_a_bore_that_a_pin_touches_was_told_as_a_chord_across_it() -> None:
    """An edge of the convex parts within a pair of lugs, from one end of their bore's rim to far off it."""
    boxes = [Box((8, 20, 20), centre=(x, 0, 2)) for x in (-18, 18)]
    solid = joined(*boxes, Box((44, 20, 6), centre=(0, 0, -11)))
    lugs = cut(solid, Cylinder(6.005, 60.0, base=(-30, 0, 0), axis="x"), name="lugs")
    pin = Cylinder(5.995, 50.0, base=(-25, 0, 0), axis="x", name="pin")
    motion = Translation("y") >> Translation("z")
    found = solve(Problem(pin, lugs, goal="touch", target=(1, 1), motion=motion))
    assert found.amount == pytest.approx(0.01, abs=1e-9)
    problem, (feature,) = found.problem, found.features
    told = feature.in_words(problem.movable, problem.static)
    assert told.endswith("bore of radius 6.005 of lugs")  # or where its rim is, as the pin touches all along it


@pytest.mark.slow
def test_balls_whose_rims_cut_walls_anew_kept_no_numbers():
    """Other labels than as drawn: of three balls the others were "no. 1" and "no. 2" when one was larger."""
    centres = (-20.0, -29.0, 8.0), (30.0, -29.0, 8.0), (-34.0, 0.0, 8.0)
    walls = Box((90.0, 8.0, 30.0), centre=(5.0, -35.0, 0.0)), Box((8.0, 40.0, 30.0), centre=(-40.0, 0.0, 0.0))
    fixture = joined(*walls, *(Sphere(4.0, centre=own, facets=12) for own in centres))
    sizes = [Size(f"ball {k}", "static", faces=f"sphere radius 4 no. {k}", tolerance=0.1) for k in (1, 2, 3)]

    def names(*made: float) -> dict[tuple[float, ...], str]:
        one = resized(fixture, dict(zip(sizes, made, strict=True)))
        return {tuple(np.round(own.surface.origin, 6)): names_of_faces(one)[own.faces[0]] for own in round_faces(one)}

    drawn = names(0.0, 0.0, 0.0)
    assert {*drawn} == {*centres}
    for made in ((0.03, 0.0, 0.0), (0.05, -0.03, 0.01)):
        each = {place: int(name.rsplit(" ", 1)[1]) for place, name in drawn.items()}
        assert names(*made) == {place: f"sphere radius {4.0 + made[k - 1]:g} no. {k}" for place, k in each.items()}


def round_mesh(mesh: trimesh.Trimesh, path: Path, *, turned: bool) -> Body:
    """A body from an STL of a mesh, as it is or turned."""
    if turned:
        mesh = mesh.copy()
        mesh.apply_transform(trimesh.transformations.euler_matrix(0.3, -0.7, 0.2))
    mesh.export(path / "part.stl")
    return Body.from_file(path / "part.stl", unit="mm", seed=(0, 0, 0))


def kinds_of(body: Body) -> Counter[str]:
    """How many facets stand for each kind of surface; each for one alone."""
    rounds = round_faces(body)
    every = [face for own in rounds for face in own.faces]
    assert len(set(every)) == len(every)
    return Counter({own.name: sum(len(o.faces) for o in rounds if o.name == own.name) for own in rounds})


@pytest.mark.sampled(3)
@pytest.mark.parametrize("turned", [False, True], ids=["drawn", "turned"])
@pytest.mark.parametrize("count", [(8, 12), (13, 25), (16, 40), (20, 60), (24, 48), (9, 96), (33, 17)])
def test_gores_and_belts_of_a_ball_were_cylinders_over_its_sphere(
    tmp_path: Path, count: tuple[int, int], turned: bool
) -> None:
    body = round_mesh(trimesh.creation.uv_sphere(radius=5.0, count=count), tmp_path, turned=turned)
    assert kinds_of(body) == {"sphere radius 5": len(body.faces)}
    ((surface, rows),) = round_surfaces(body.rounded())
    assert (surface.radius, len(rows)) == (pytest.approx(5.0, rel=1e-6), len(body.faces))


@pytest.mark.parametrize("turned", [False, True], ids=["drawn", "turned"])
@pytest.mark.parametrize("count", [(12, 12), (16, 32), (24, 48)])
def test_the_ends_of_a_capsule_are_spheres(tmp_path: Path, count: tuple[int, int], turned: bool) -> None:
    """They turn smoothly into its cylinder, and were many cylinders, or nothing."""
    body = round_mesh(trimesh.creation.capsule(height=10.0, radius=5.0, count=count), tmp_path, turned=turned)
    sides = count[1]
    assert kinds_of(body) == {"sphere radius 5": len(body.faces) - sides, "cylinder radius 5": sides}
    assert len(round_faces(body)) == 3


def revolved(*profile: tuple[float, float], count: int = 48) -> trimesh.Trimesh:
    return trimesh.creation.revolve(np.array(profile), sections=count)


def test_a_tapered_pin_with_a_dome_is_a_cylinder_a_cone_and_a_sphere(tmp_path: Path) -> None:
    angles = np.linspace(0.1, np.pi / 2.0, 14)
    dome = [(5.0 * np.cos(a), 5.0 * np.sin(a)) for a in angles]
    body = round_mesh(revolved((0, -9), (5.5, -9), (5.5, -8), *dome, count=24), tmp_path, turned=False)
    kinds = {name.split()[0]: count for name, count in kinds_of(body).items()}
    assert kinds == {"sphere": len(body.faces) - 49, "cone": 24, "cylinder": 24}


def test_cones_at_both_ends_of_a_pin_are_no_rounding(tmp_path: Path) -> None:
    pin = revolved((0, 0), (4.5, 0), (5, 2), (5, 10), (4.5, 12), (0, 12), count=24)
    kinds = kinds_of(round_mesh(pin, tmp_path, turned=False))
    assert sorted(kinds.values()) == [24, 48]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("count", [13, 25])
@pytest.mark.parametrize("sections", [24, 64])
def test_gores_and_belts_of_a_torus_are_no_cylinders_or_cones(tmp_path: Path, count: int, sections: int) -> None:
    """With an odd count, or from half a step on, a ring of facets is a cylinder."""
    turns = np.linspace(0.0, 2.0 * np.pi, count + 1) + np.pi / count
    ring = revolved(*((10.0 + 3.0 * np.cos(a), 3.0 * np.sin(a)) for a in turns), count=sections)
    assert not kinds_of(round_mesh(ring, tmp_path, turned=False))


def test_a_cylinder_was_two_in_part_over_the_same_facets(tmp_path: Path) -> None:
    """Directions of short edges in single precision are on both sides of a step by which they are sorted."""
    body = round_mesh(revolved((0, 0), (5, 0), (5, 0.1), (0, 0.1), count=64), tmp_path, turned=True)
    assert kinds_of(body) == {"cylinder radius 5": 64}


@pytest.mark.sampled(1)
@pytest.mark.parametrize("count", [(24, 48), (20, 60)])
def test_a_ball_of_gores_touches_a_plane_where_its_sphere_does(tmp_path: Path, count: tuple[int, int]) -> None:
    """An internal error, or "proved" for gores: each part grows by .02 about its middle, the plane by .02 * 2."""
    ball = round_mesh(trimesh.creation.uv_sphere(radius=5.0, count=count), tmp_path, turned=True).rounded()
    plane = Box((40, 40, 4), centre=(0, 0, -11.1), name="plane")
    found = solve(Problem(ball, plane, motion=Translation("z"), target=(1.02, 1.02), goal="touch"))
    assert found.amount == pytest.approx(4.1 - 0.02 * 5.0 - 0.02 * 2.0, abs=1e-6)
