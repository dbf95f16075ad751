"""Stack-ups and best poses of contacts as drawn with round faces: of these, wherever the facets of a mesh lie."""

from dataclasses import replace

import numpy as np
import pytest

import fcdm_opt as fo

HALVES = 0.03, 0.02


def turned(body, axis, angle):
    """Return a body turned about an axis through the origin."""
    i, j = [(1, 2), (2, 0), (0, 1)]["xyz".index(axis)]
    T = np.eye(4)
    T[[i, j, i, j], [i, j, j, i]] = [np.cos(angle), np.cos(angle), -np.sin(angle), np.sin(angle)]
    return body.moved(T)


def drawn_as_stl(body, folder):
    """Return a body through a file with the digits of an STL file, taken as round."""
    import trimesh

    corners, _ = body.face_triangles
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=True)
    mesh.export(folder / f"{body.name}.stl")
    return fo.Body.from_file(folder / f"{body.name}.stl", unit="mm", name=body.name).rounded()


def held(one, two, faces, axis, each=(1.0, 1.0)):
    """Return an assembly of two parts that touch, the first moved along an axis, with a size of each."""
    sizes = [
        fo.Size(own.name, own.name, faces=face, each=share, tolerance=half / share)
        for own, face, share, half in zip((one, two), faces, each, HALVES, strict=True)
    ]
    contact = {"parts": (one.name, two.name), "goal": "touch"}
    return fo.Assembly({one.name: one, two.name: two}, [contact], sizes, {one.name: fo.Translation(axis)})


def agree(assembly, contact):
    """Check that both commands tell the one contact, from -.05 to .05, and are verified, as solve is."""
    assert fo.solve(assembly).amount == pytest.approx(0.0, abs=1e-7)
    stack, pose = fo.stack_up(assembly), fo.best_pose(assembly)
    slack = 1e-7  # of single precision
    assert [stack.worst().least, stack.worst().largest] == pytest.approx([-0.05, 0.05], abs=slack)
    assert [row.told for row in stack.rows] == [contact] == [*pose.contacts]
    assert pose.value == pytest.approx(0.05, abs=slack)
    assert pose.on_true_faces
    assert fo.clearances(assembly).on_true_faces
    assert fo.verify(stack)
    assert fo.verify(pose)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("file", "length", "aside"), [(True, 14.0, 3.0), (False, 60.0, 0.0)])
@pytest.mark.parametrize(("facets", "turn"), [(32, np.pi / 32), (64, 0.0)])
def test_a_plane_jaw_shorter_or_longer_than_the_round_bar_that_it_touches(tmp_path, file, length, aside, facets, turn):
    """Where facets touched it was an edge of either, -.05002 not verified; where they did not, there was no contact."""
    bar = turned(fo.Cylinder(5.0, 30.0, base=(-15.0, 0.0, 0.0), axis="x", facets=facets, name="bar"), "x", turn)
    jaw = fo.Box((length, 12.0, 4.0), centre=(aside, 0.0, -7.0), name="jaw")
    bar, jaw = (drawn_as_stl(own, tmp_path) for own in (bar, jaw)) if file else (bar, jaw)
    top, cylinder = "top face of jaw", "cylinder of radius 5 of bar"
    agree(held(jaw, bar, ["top", "cylinder radius 5"], "z"), f"{top}, {cylinder}")
    agree(held(bar, jaw, ["cylinder radius 5", "top"], "z"), f"{cylinder}, {top}")


@pytest.mark.sampled(1)
@pytest.mark.parametrize("crossed", [False, True])
def test_two_round_bars_whose_facets_do_not_meet(crossed):
    """The pins touch along a line, or where they cross: "here are none as drawn", the facets are .03 apart."""
    pin = turned(fo.Cylinder(4.0, 20.0, facets=24, name="pin"), "z", np.pi / 24)
    other = fo.Cylinder(3.0, 10.0, base=(7.0, 0.0, 2.0), facets=32, name="other")
    other = fo.Cylinder(3.0, 30.0, base=(7.0, -15.0, 10.0), axis="y", facets=32, name="other") if crossed else other
    asked = held(pin, other, ["cylinder radius 4", "cylinder radius 3"], "x", each=(1.0, 0.5))
    agree(asked, "cylinder of radius 4 of pin, cylinder of radius 3 of other")


def test_a_pin_at_the_wall_of_its_bore():
    """Wherever the facets of either lie: a larger pin or a smaller bore overlaps by as much."""
    pin = turned(fo.Cylinder(4.0, 20.0, base=(0.0, 0.0, -10.0), facets=24, name="pin"), "z", np.pi / 24)
    bore = fo.Cylinder(4.5, 12.0, base=(-0.5, 0.0, -6.0), facets=32, name="bore")
    plate = fo.Body.from_mesh(*_bored(bore), name="plate", decomposition="exact").rounded()
    agree(
        held(pin, plate, ["cylinder radius 4", "bore radius 4.5"], "x"),
        "cylinder of radius 4 of pin, bore of radius 4.5 of plate",
    )


def _bored(bore):
    import trimesh

    plate = trimesh.creation.box((20.0, 20.0, 10.0))
    corners, _ = bore.face_triangles
    tool = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=True)
    cut = plate.difference(tool, engine="manifold")
    return np.array(cut.vertices), np.array(cut.faces)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("turn", [0.0, np.pi / 48, 0.03])
def test_a_roller_in_its_groove_goes_by_each_flank(turn):
    """Flanks of 45 degrees: the roller rises by its radius over sin 45; a stop above it opens by as much."""
    roller = turned(fo.Cylinder(5.0, 20.0, base=(-10.0, 0.0, 0.0), axis="x", facets=48, name="roller"), "x", turn)
    deep = 5.0 * np.sqrt(2.0)
    left, right = (
        [[x, y * side, z - deep] for x in (-20.0, 20.0) for y, z in ((0.0, 0.0), (9.0, 9.0), (9.0, -4.0), (0.0, -4.0))]
        for side in (1.0, -1.0)
    )
    groove = fo.Body.from_parts([left, right], name="groove")
    stop = fo.Box((6.0, 6.0, 4.0), centre=(0.0, 0.0, 7.0), name="stop")
    radius = fo.Size("radius", "roller", faces="cylinder radius 5", tolerance=0.05)
    contacts = [{"parts": ("roller", "groove"), "goal": "touch"}, {"parts": ("roller", "stop"), "goal": "clear"}]
    parts = {"roller": roller, "groove": groove, "stop": stop}
    asked = fo.Assembly(parts, contacts, [radius], {"roller": fo.Translation("z")})
    stack = fo.stack_up(asked, of=("roller", "stop"))
    worst, most = stack.worst(), 0.05 * (1.0 + np.sqrt(2.0))
    assert [worst.least, worst.largest] == pytest.approx([-most, most], abs=1e-8)
    assert fo.verify(stack)
    own = fo.best_pose(asked)
    assert len([name for name in own.contacts if "cylinder of radius 5 of roller" in name]) == 2


@pytest.mark.slow
def test_the_rims_of_round_flanges_were_told_as_contacts_and_failed_the_judge() -> None:
    """A cover that lies on its base, both round and as wide: one contact, plane on plane, whatever the bores are."""
    base = fo.joined(fo.Cylinder(50.0, 10.0, base=(0, 0, -10)), fo.Cylinder(20.0, 8.0, name="spigot"))
    cover = fo.cut(fo.Cylinder(50.0, 8.0), fo.Cylinder(20.05, 30.0, base=(0, 0, -10)))
    sizes = [
        fo.Size("bore", "movable", faces="bore radius 20.05", each=-0.5, tolerance=0.05),
        fo.Size("thickness", "static", faces=[{"through": (40, 5, 0)}], each=1.0, tolerance=0.02),
    ]
    asked = fo.Problem(cover, base, sizes=sizes, made={}, goal="seat", contacts="all", motion=fo.Translation("z"))
    found = fo.best_pose(asked)
    assert found.passed
    assert len(found.contacts) == 1
    assert (found.least.gap, found.most.gap) == pytest.approx((-0.02, 0.02), rel=1e-9)


@pytest.mark.slow
def test_a_plate_with_a_hole_and_a_slot_on_two_pins() -> None:
    """At the best pose the pins touched hole and slot at all sizes, and were left out as if they did at rest."""
    pins = (fo.Cylinder(4.95, 16, base=(x, 0, -10)) for x in (-20, 20))
    base = fo.joined(fo.Box((60, 40, 8), centre=(0, 0, -8)), *pins)
    holes = [fo.Cylinder(5, 30, base=(x, 0, -15)) for x in (-20, 20)]
    ends = [*(fo.Cylinder(5, 30, base=(x, 0, -15)) for x in (19, 21)), fo.Box((2, 10, 30), centre=(20, 0, 0))]
    spacing = fo.Size("spacing", "static", faces=["cylinder radius 4.95 no. 2"], along="x", tolerance=0.12)
    motion = fo.Translation("x") >> fo.Translation("y")
    for cut, clear, play in ((holes, 0.03, -0.07), ([holes[0], *ends], 0.0, 0.05)):
        plate = fo.cut(fo.Box((60, 40, 8)), *cut)
        asked = fo.Problem(plate, base, sizes=[spacing], made={"spacing": 0.08}, goal="clear", motion=motion)
        found = fo.solve(asked)
        assert found.amount == pytest.approx(clear, abs=1e-9)
        assert fo.verify(found).passed
        assert fo.stack_up(asked).worst().least == pytest.approx(play, abs=1e-9)
        best = fo.best_pose(asked, clearance="middle")
        assert best.worst_gap == pytest.approx(max(0.0, -play), abs=1e-9)
        assert best.passed


@pytest.mark.parametrize("angle", [pytest.param(25.0, marks=pytest.mark.slow), 40.0])
def test_a_ball_that_is_larger_than_its_cone(angle: float) -> None:
    """Pieces of both at points of the ring were told to leave each other aslant: -.02473 for -.025, not verified."""
    half, off = np.radians(angle), 0.05
    deep, tan = 5.0 / np.sin(half), np.tan(half)
    tall = 1.3 * deep - 1.0
    cone = fo.Cone(1.3 * deep * tan, tan, tall, base=(0, 0, 0.3 * deep), axis=(0, 0, -1))
    seat = fo.cut(fo.Box((20, 20, 1.1 * deep + 1.0), centre=(0, 0, -0.45 * deep - 0.5)), cone)
    size = fo.Size("diameter", "movable", faces="sphere radius 5", each=0.5, tolerance=off)
    asked = {"sizes": [size], "made": {"diameter": off}, "goal": "at", "motion": fo.Translation("z")}
    problem = fo.Problem(fo.Sphere(5.0), seat, **asked)
    stack = fo.stack_up(problem)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((-off / 2, off / 2), rel=1e-9)
    assert fo.verify(stack).passed
    found = fo.solve(problem)
    assert found.parameters["TZ"] == pytest.approx(off / 2 / np.sin(half), rel=1e-9)
    assert found.lower_bound == pytest.approx(found.amount, rel=1e-6)


def test_a_line_to_line_fit_whose_collar_lies_on_the_bush() -> None:
    """Rims met where the collar does not, along z: bore and shaft were not judged there, "off by inf"."""
    shaft = fo.joined(fo.Cylinder(10, 30), fo.Cylinder(15, 5, base=(0, 0, -5)))
    bush = fo.cut(fo.Cylinder(15, 10), fo.Cylinder(10, 20, base=(0, 0, -5)))
    sizes = [
        fo.Size("d", "movable", faces="cylinder radius 10", each=0.5, tolerance=(-0.02, -0.007)),
        fo.Size("D", "static", faces="bore radius 10", each=-0.5, tolerance=(0.0, 0.021)),
    ]
    stack = fo.stack_up(fo.Problem(shaft, bush, sizes=sizes, made="middle", goal="touch", motion=fo.Translation("x")))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.0035, 0.0205), abs=1e-9)
    assert len(stack.standing) == 1
    assert fo.verify(stack).passed


def test_a_keyway_that_was_cut_into_facets() -> None:
    """Its corners are on chords: facets beside it and before its ends stayed flat where the shaft became smaller."""
    angles = np.arange(64) * 2 * np.pi / 64
    circle = 15.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    facets = fo.Prism([tuple(p) for p in circle], 60.0, name="shaft")
    shaft = replace(fo.cut(facets, fo.Box((8.0, 8.0, 25.0), centre=(0, 15, 30))), surfaces=None).rounded()  # a mesh
    ring = fo.cut(fo.Cylinder(28, 40, base=(0, 0, 10)), fo.Cylinder(15, 60))
    sizes = [
        fo.Size("bore", "movable", faces="bore radius 15", each=-0.5, tolerance=(0.0, 0.021)),
        fo.Size("shaft", "static", faces="cylinder radius 15", each=0.5, tolerance=(-0.02, 0.0)),
    ]
    made = {"bore": 0.01, "shaft": -0.01}
    asked = fo.Problem(ring, shaft, sizes=sizes, made=made, goal="touch", motion=fo.Translation("x"))
    found = fo.solve(asked)
    assert found.amount == pytest.approx(0.01, abs=1e-9)
    assert fo.verify(found).passed
    stack = fo.stack_up(asked)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((0.0, 0.0205), abs=1e-9)
    assert fo.verify(stack).passed


@pytest.mark.slow
def test_an_overlap_deeper_than_the_pieces_at_its_points_was_told_by_facets(tmp_path):
    """A rim of 13.02 in a cone of 45 degrees that is 13.5 there: -.3193 was told of -.48 / sqrt 2, and not verified."""
    collar, journal = fo.Cylinder(18, 8, base=(0, 0, -8), facets=48), fo.Cylinder(12, 20, facets=48)
    shaft = fo.joined(collar, fo.Cone(13.5, 12, 1.5, facets=48), journal, name="shaft")
    bore = fo.Cylinder(12.02, 40, base=(0, 0, -10), facets=48)
    hub = fo.cut(fo.Cylinder(20, 14, facets=48), bore, fo.Cone(13.02, 12.02, 1.0, facets=48), name="hub")
    drawn = [drawn_as_stl(own, tmp_path) for own in (hub, shaft)]
    sizes = [
        fo.Size("bore", "movable", faces="bore radius 12.02", each=-0.5, tolerance=(0, 0.033)),
        fo.Size("journal", "static", faces="cylinder radius 12", each=0.5, tolerance=(-0.013, 0)),
    ]
    problem = fo.Problem(*drawn, motion=fo.Translation("z"), goal="clear", sizes=sizes, made={})
    stack = fo.stack_up(problem)
    assert (stack.worst().least, stack.worst().largest) == pytest.approx([-0.48 / np.sqrt(2.0)] * 2, abs=1e-4)
    assert fo.verify(stack).passed


@pytest.mark.slow
def test_a_pin_that_goes_either_way_in_a_long_plate():
    """Two bores of radius 3, pins of radius 2.98, one of them off by s: the gap is .02 - |s|, however long the plate.

    The deeper of the two was out of the band in which nearest points were looked for.
    """
    from manifold3d import Manifold

    def block(low, high):
        return Manifold.cube([70.0 * 2, 20.0, high - low]).translate([-70.0, -10.0, low])

    def round_parts(radius, low, height):
        rod = Manifold.cylinder(height, radius, radius, 48)
        return [rod.translate([x, 0.0, low]) for x in (-41.0, 41.0)]

    def drawn(solid, name):
        mesh = solid.to_mesh64()
        return fo.Body.from_mesh(mesh.vert_properties[:, :3], mesh.tri_verts, unit="mm", name=name).rounded()

    bores, pins = round_parts(3.0, 28.0, 10.0), round_parts(2.98, 20.0, 14.0)
    lid = drawn(block(30.0, 36.0) - bores[0] - bores[1], "lid")
    case = drawn(block(20.0, 30.0) + pins[0] + pins[1], "case")
    spacing = fo.Size("spacing", "static", faces=["cylinder radius 2.98 no. 2"], along="x", tolerance=0.06)
    stack = fo.stack_up(fo.Problem(lid, case, goal="clear", motion=fo.Translation("x"), sizes=[spacing]))
    assert (stack.worst().least, stack.worst().largest) == pytest.approx((-0.04, 0.02), abs=1e-6)
    for s in (-0.06, -0.01, 0.0, 0.03, 0.06):
        assert stack.gap({"spacing": s}) == pytest.approx(0.02 - abs(s), abs=1e-6)
    assert fo.verify(stack).passed


@pytest.mark.slow
def test_tolerances_of_balls_that_solve_takes_were_refused_by_the_stack_up() -> None:
    """Three balls of 3 on a floor, their radii +-.05 each: the gap goes from -.05, one larger, to .05, all smaller."""
    balls = [fo.Sphere(3, centre=(x, y, 3)) for x, y in ((-20, -10), (20, -10), (0, 20))]
    tripod = fo.joined(fo.Box((60, 50, 3), centre=(0, 0, 7)), *balls, name="tripod")
    floor = fo.Box((80, 80, 4), centre=(0, 0, -2), name="floor")
    faces = [f"sphere radius 3 no. {k}" for k in (1, 2, 3)]
    sizes = [fo.Size(face[-1], "movable", faces=[face], each=1.0, tolerance=0.05) for face in faces]
    motion = fo.Translation("z")
    stack = fo.stack_up(fo.Problem(tripod, floor, sizes=sizes, made={"1": 0.03}, goal="touch", motion=motion))
    assert [stack.worst().least, stack.worst().largest] == pytest.approx([-0.05, 0.05], abs=1e-9)
    assert fo.verify(stack).passed


def test_a_hole_that_is_off_in_two_directions():
    """A pin of 3.99 in a bore of 4.01 that is off by (x, y): the gap is .02 - hypot(x, y), of sigma .01 each 86.47 %.

    It is no plane: rows touch it in all directions, so near each other that it is less than 3e-4 of a place off.
    """
    pin = fo.Cylinder(3.99, 10, base=(0, 0, -7), name="pin")
    plate = fo.cut(fo.Box((40, 40, 12), centre=(0, 0, -6), name="plate"), fo.Cylinder(4.01, 30, base=(0, 0, -20)))
    sizes = [fo.Size(own, "static", faces="bore radius 4.01", along=own, tolerance=0.03) for own in ("x", "y")]
    motion = fo.Translation("x") >> fo.Translation("y")
    stack = fo.stack_up(fo.Problem(pin, plate, sizes=sizes, made={}, goal="clear", motion=motion), limits=(0, 1))
    places = np.random.default_rng(0).uniform(-0.03, 0.03, (1000, 2))
    gaps = 0.02 - np.hypot(*places.T)
    off = stack.gap(places) - gaps
    assert off.min() >= -1e-9
    assert off.max() <= 1.3e-5
    assert stack.yield_().share == pytest.approx(1.0 - np.exp(-2.0), abs=0.001)
    assert stack.worst().least == pytest.approx(0.02 - 0.03 * np.sqrt(2.0), abs=1e-9)
    assert fo.verify(stack).passed


def test_a_ball_whose_socket_is_off_in_three_directions():
    """Of .02 play the place takes its distance, whatever its direction; at most so much more is told as rows leave."""
    ball, socket = (fo.Sphere(radius, facets=12, name="ball") for radius in (4.98, 5.0))
    block = fo.cut(fo.Box((20, 20, 20), name="block"), socket)
    sizes = [fo.Size(own, "static", faces="hollow radius 5", along=own, tolerance=0.02) for own in "xyz"]
    stack = fo.stack_up(fo.Problem(ball, block, sizes=sizes, made={}, goal="clear", motion=fo.Translation("x")))
    places = np.random.default_rng(0).uniform(-0.02, 0.02, (1000, 3))
    off = stack.gap(places) - (0.02 - np.linalg.norm(places, axis=1))
    assert off.min() >= -1e-9
    assert off.max() <= 5e-3 * 0.02 * np.sqrt(3.0)
    assert any("smaller" in told for told in stack.known_to)
    assert fo.verify(stack).passed


@pytest.mark.slow
def test_holes_off_in_two_directions_of_two_dowels_add_up():
    """Of two dowels in two holes the second is off by (x, y), the first by (u, v): the gap is that of the worse one."""
    places = {1: -20.0, 2: 20.0}
    pins = [fo.Cylinder(3.98, 10, base=(x, 0, -7), name="pins") for x in places.values()]
    pins = fo.joined(*pins, fo.Box((60, 12, 4), centre=(0, 0, 5)), name="pins")
    bores = [fo.Cylinder(4.0, 30, base=(x, 0, -20)) for x in places.values()]
    plate = fo.cut(fo.Box((80, 40, 12), centre=(0, 0, -6)), *bores, name="plate")
    sizes = [
        fo.Size(
            f"{k} {own}", "static", faces={"around": (x, 0, -5), "axis": "z", "radius": 4.0}, along=own, tolerance=0.02
        )
        for k, x in places.items()
        for own in "xy"
    ]
    motion = fo.Translation("x") >> fo.Translation("y")
    stack = fo.stack_up(fo.Problem(pins, plate, sizes=sizes, made={}, goal="clear", motion=motion))
    drawn = np.random.default_rng(0).uniform(-0.02, 0.02, (1000, 4))
    off = stack.gap(drawn) - (0.02 - np.maximum(np.hypot(*drawn[:, :2].T), np.hypot(*drawn[:, 2:].T)))
    assert off.min() >= -1e-9
    assert off.max() <= 1e-5
    assert fo.verify(stack).passed


def test_corners_of_a_lid_near_those_of_its_box_hid_the_spigot_in_its_hole():
    """They lie .14 apart, on faces that stay closed and do not count; the spigot has a play of .5 all around."""
    lid = fo.joined(
        fo.Box((20.2, 20.2, 2), centre=(0, 0, 1)), fo.Cylinder(5, 4, base=(0, 0, -3), facets=24), name="lid"
    )
    hole = fo.Cylinder(5.5, 20, base=(0, 0, -10), facets=24)
    box = fo.cut(fo.Box((20, 20, 8), centre=(0, 0, -4)), hole, name="box")
    sizes = [
        fo.Size("diameter", "movable", faces="cylinder radius 5", each=0.5, tolerance=0.02),
        fo.Size("x", "static", faces="bore radius 5.5", along="x", tolerance=0.03),
    ]
    motion = fo.Translation("x") >> fo.Translation("y")
    stack = fo.stack_up(fo.Problem(lid, box, sizes=sizes, made={}, goal="clear", motion=motion))
    assert [stack.worst().least, stack.worst().largest] == pytest.approx([0.46, 0.51], abs=1e-9)
    assert fo.verify(stack).passed


def test_the_end_face_of_a_disc_was_told_as_its_cylinder() -> None:
    """A cover .1 above a disc in a pocket: the corner at which the disc is exact is on both of its faces."""
    pocket = fo.cut(fo.Box((60, 60, 15), centre=(0, 0, -2.5)), fo.Cylinder(20.0, 6.0), name="base")
    disc, cover = fo.Cylinder(19.9, 4.9, name="disc"), fo.Box((60, 60, 8), centre=(0, 0, 9), name="cover")
    thickness = fo.Size("thickness", "disc", faces=["+z", "-z"], each=0.5, tolerance=0.03)
    contacts = [("disc", "base"), ("cover", "base"), {"parts": ("cover", "disc"), "goal": "clear"}]
    lift = fo.Translation("z")
    asked = fo.Assembly([pocket, disc, cover], contacts, [thickness], {"disc": lift, "cover": lift})
    stack = fo.stack_up(asked, of=("cover", "disc"))
    assert {row.told for row in stack.rows} == {"bottom face of cover, top face of disc"}
    assert stack.worst().least == pytest.approx(0.07, abs=1e-9)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("movable", ["blade", "collet"])
@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_rows_of_an_edge_in_a_bore_were_exact_at_the_worst_cases_alone(movable: str, angle: float) -> None:
    """R + b/2 - |((9.6 + w) / 2, (2 + t) / 2)|, whose normal turns with w and t: 4.6e-5 too much, "NOT VERIFIED"."""
    blade = turned(fo.Box((9.6, 2, 30), name="blade").with_seed((0, 0, 0)), "z", angle)
    collet = fo.cut(fo.Cylinder(9, 20, base=(0, 0, -10)), fo.Cylinder(5, 30, base=(0, 0, -15)), name="collet")
    parts = sorted([blade, collet.with_seed((0, 0, 0))], key=lambda own: own.name != movable)
    roles = dict(zip((own.name for own in parts), ("movable", "static"), strict=True))
    across = {"w": (np.cos(angle), np.sin(angle), 0.0), "t": (-np.sin(angle), np.cos(angle), 0.0)}
    half = {"w": 4.8, "t": 1.0}
    sizes = [
        fo.Size(name, roles["blade"], tolerance=0.1, each=0.5,
                faces=[{"through": [*(side * half[name] * np.array(n))]} for side in (1, -1)])
        for name, n in across.items()
    ]  # fmt: skip
    sizes.append(fo.Size("b", roles["collet"], faces=["bore radius 5"], each=-0.5, tolerance=0.04))
    stack = fo.stack_up(fo.Problem(*parts, motion=fo.Translation("x"), goal="touch", sizes=sizes, made={}))
    places = np.random.default_rng(2).uniform(-1.0, 1.0, (200, 3)) * (0.1, 0.1, 0.04)
    w, t, b = places.T
    truth = 5.0 + b / 2.0 - np.hypot(4.8 + w / 2.0, 1.0 + t / 2.0)
    assert np.abs(stack.gap(places) - truth).max() <= stack.touching.between < 2e-6
    ends = (5.0 - x - np.hypot(4.8 + y, 1.0 + y) for x, y in ((0.02, 0.05), (-0.02, -0.05)))
    assert [stack.worst().least, stack.worst().largest] == pytest.approx([*ends], abs=1e-9)
    if movable == "blade" and not angle:
        assert fo.verify(stack).passed


@pytest.mark.sampled(1)
@pytest.mark.parametrize("kind", ["edge", "peg"])
def test_rows_beside_a_rod_were_the_least_of_those_along_slanted_edges(kind: str) -> None:
    """|(3.8 + x, 3.5 + y)| less radii, x and y to .05: 8e-4 too little in the worst cases, "NOT VERIFIED"."""
    rod = fo.Cylinder(4, 20, base=(0, 0, -10), name="rod").with_seed((0, 0, 0))
    if kind == "edge":
        other, radius = fo.Box((9.6, 8, 30), centre=(8.6, 7.5, 0), name="block"), 0.0
        faces = {"x": ["+x", "-x"], "y": ["+y", "-y"]}
        sizes = [fo.Size(own, "movable", faces=faces[own], each=-0.5, tolerance=0.1) for own in "xy"]
        middle, half = (3.8, 3.5), 0.5
    else:
        middle, half, radius = (6.0, 5.6), 1.0, 3.0
        peg = fo.Cylinder(radius, 20, base=(*middle, -10))
        other = fo.joined(peg, fo.Box((30, 30, 4), centre=(10, 10, 14)), name="pegs")
        sizes = [fo.Size(own, "movable", faces=["cylinder radius 3"], along=own, tolerance=0.05) for own in "xy"]
    sizes.append(fo.Size("d", "static", faces=["cylinder radius 4"], each=0.5, tolerance=0.04))
    stack = fo.stack_up(fo.Problem(other, rod, motion=fo.Translation("x"), goal="touch", sizes=sizes, made={}))
    low, high = np.array([own.tolerance for own in sizes]).T
    places = np.random.default_rng(4).uniform(low, high, (200, 3))

    def truth(x: np.ndarray, y: np.ndarray, d: np.ndarray) -> np.ndarray:
        return np.hypot(middle[0] + half * x, middle[1] + half * y) - radius - 4.0 - d / 2.0

    assert np.abs(stack.gap(places) - truth(*places.T)).max() <= stack.touching.between < 4e-6
    ends = [truth(*low[:2], 0.04), truth(*high[:2], -0.04)]
    assert [stack.worst().least, stack.worst().largest] == pytest.approx(ends, abs=1e-9)
    assert fo.verify(stack).passed


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("y", "angle", "movable"),
    [(0.06, 0.0, "block"), (0.05, 0.0, "block"), (0.03, 0.3, "block"), (0.0, 0.0, "rod"), (0.03, -0.2, "rod"),
     (-0.02, 0.5, "block"), (-0.06, 0.0, "block")],
)  # fmt: skip
def test_an_edge_next_to_a_rod_at_the_end_of_its_normals_was_told_by_its_face(y, angle, movable) -> None:
    """X - R where Y < 0, else |(X, Y)| - R of the edge: up to 4.5e-4 too much, unsaid, and "NOT VERIFIED"."""
    rod = fo.Cylinder(4, 20, base=(0, 0, -10), name="rod").with_seed((0, 0, 0))
    block = fo.Box((9.6, 8, 30), centre=(9.0, y + 4.0, 0), name="block")
    block = turned(block, "z", angle)
    parts = sorted([block, rod], key=lambda own: own.name != movable)
    roles = dict(zip((own.name for own in parts), ("movable", "static"), strict=True))
    across = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0])}
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    middle, half = np.array([9.0, y + 4.0, 0.0]), {"x": 4.8, "y": 4.0}
    sizes = [
        fo.Size(name, roles["block"], tolerance=0.1, each=-0.5,
                faces=[{"through": [*(turn @ (middle + side * half[name] * n))]} for side in (1, -1)])
        for name, n in across.items()
    ]  # fmt: skip
    sizes.append(fo.Size("d", roles["rod"], faces=["cylinder radius 4"], each=0.5, tolerance=0.04))
    stack = fo.stack_up(fo.Problem(*parts, motion=fo.Translation("x"), goal="touch", sizes=sizes, made={}))

    def truth(x, t, d):
        x, t = 4.2 + x / 2.0, y + t / 2.0
        return np.where(t <= 0.0, x, np.hypot(x, t)) - 4.0 - d / 2.0

    low, high = np.array([own.tolerance for own in sizes]).T
    places = np.random.default_rng(4).uniform(low, high, (200, 3))
    assert np.abs(stack.gap(places) - truth(*places.T)).max() <= stack.touching.between + 1e-12 < 2e-6
    ends = [truth(*low[:2], 0.04), truth(*high[:2], -0.04)]
    assert [stack.worst().least, stack.worst().largest] == pytest.approx(ends, abs=1e-9)
    assert fo.verify(stack).passed


def test_a_stack_up_lists_each_contact_in_one_row() -> None:
    """An edge in a bore had one a direction, up to 33, as w and t turn its normal; at scales nothing is as drawn."""
    blade = fo.Box((9.6, 2, 30), name="blade").with_seed((0, 0, 0))
    collet = fo.cut(fo.Cylinder(9, 20, base=(0, 0, -10)), fo.Cylinder(5, 30, base=(0, 0, -15)), name="collet")
    sizes = [
        fo.Size(name, "movable", faces=[f"{side}{axis}" for side in "+-"], tolerance=0.1, each=0.5)
        for name, axis in zip("wt", "xy", strict=True)
    ]
    sizes.append(fo.Size("b", "static", faces="bore radius 5", each=-0.5, tolerance=0.02))
    for scale, head in ((1.0, "as drawn"), (1.001, "as scaled")):
        asked = fo.Problem(
            blade,
            collet.with_seed((0, 0, 0)),
            sizes=sizes,
            target=(scale, 1.0),
            goal="clear",
            motion=fo.Translation("x"),
        )
        stack = fo.stack_up(asked)
        lines = str(stack).splitlines()
        at = next(k for k, line in enumerate(lines) if "gap per unit of each size" in line)
        assert head in lines[at]
        rows = [line for line in lines[at + 2 :] if line.strip()]
        assert len(rows) == len(stack.contacts) <= len(stack.rows)
        assert all(f"{5.0 - scale * np.hypot(4.8, 1.0):+.4g}" in row and "b +0.5" in row for row in rows)


def test_a_contact_at_a_rim_is_named_by_the_rim() -> None:
    """A ball of 5 over a hole of 4, .2 higher than where it touches its rim: it was told as the bore."""
    ball = fo.Sphere(5.0, centre=(0, 0, 3.2), name="ball")
    plate = fo.cut(fo.Box((30, 30, 8), centre=(0, 0, -4)), fo.Cylinder(4.0, 20, base=(0, 0, -15)), name="plate")
    size = fo.Size("r", "movable", faces="sphere radius 5", tolerance=0.01)
    stack = fo.stack_up(fo.Problem(ball, plate, sizes=[size], made={}, goal="clear", motion=fo.Translation("z")))
    assert stack.gap({}) == pytest.approx(np.hypot(4.0, 3.2) - 5.0, abs=1e-9)
    (contact,) = stack.contacts
    assert contact.startswith("sphere of radius 5 of ball, edge between ")
    assert "bore of radius 4" in contact
    assert "top" in contact
