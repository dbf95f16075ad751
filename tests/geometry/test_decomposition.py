"""Decompositions: numbers of parts in closed form, volumes in rationals, points inside against the mesh."""

from __future__ import annotations

import itertools
import sys
from fractions import Fraction

import numpy as np
import pytest
from solids import FAMILIES, box, prism, random_solid, solid_of
from strategies import random_rotation
from voxels import CUBE3, VOXELS, Voxels, surface_of

from fcdm_opt.errors import InputError
from fcdm_opt.geometry import decomposition
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.cells import Arrangement, Cell
from fcdm_opt.geometry.decomposition import SHARE, decompose
from fcdm_opt.geometry.hull import convex_hull
from fcdm_opt.geometry.mesh import Mesh, checked_mesh
from fcdm_opt.geometry.partition import RULES, merged, partition
from fcdm_opt.geometry.primitives import Sphere, joined

CENTRES = {"L": (0.5, 0.5, 0.5), "T": (1.5, 0.5, 0.5), "two cubes sharing an edge": (1, 1, 0.5)}
CENTRES |= {"two cubes sharing a vertex": (1, 1, 1), "cube less an eighth": (0.75, 1, 1)}


def mesh_of(voxels: Voxels) -> Mesh:
    return checked_mesh(*surface_of(voxels))


def exact_volume(points: list[tuple[Fraction, ...]], rows: np.ndarray, loops: object) -> Fraction:
    total = Fraction(0)
    for loop in loops:
        a, *others = (points[rows[k]] for k in loop)
        for b, c in itertools.pairwise(others):
            total += a[0] * (b[1] * c[2] - b[2] * c[1])
            total += a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    return total / 6


def volumes(points: np.ndarray, parts: object) -> list[Fraction]:
    """Volumes of hulls of float points, in rationals."""
    exact = [tuple(Fraction(x) for x in row) for row in points.tolist()]
    hulls = [convex_hull(points[part], part, "part") for part in parts]
    return [exact_volume(exact, hull.used, hull.loops) for hull in hulls]


def volumes_before_rounding(space: Arrangement, cells: list[Cell]) -> list[Fraction]:
    rounded = space.coordinates(range(len(space.exact)))
    exact = [tuple(Fraction(int(x.p), int(x.q)) for x in point) for point in space.exact]
    hulls = [convex_hull(rounded[cell.points], cell.points, "cell") for cell in cells]
    return [exact_volume(exact, hull.used, hull.loops) for hull in hulls]


# ------------------------------------------------------------------------------------------------------- unit cubes


@pytest.mark.parametrize("name", VOXELS)
def test_partitions_of_unit_cubes_have_few_parts_and_their_volume_exactly(name):
    voxels, count, _ = VOXELS[name]
    mesh = mesh_of(voxels)
    made = decompose(mesh, np.array([50.0, 60.0, 70.0]))
    assert (made.method, made.cover, len(made.parts)) == ("exact", False, count)
    assert made.deviation == (0.0, 0.0)
    assert sum(volumes(made.points, made.parts)) == len(voxels)
    np.testing.assert_array_equal(made.points[: len(mesh.vertices)], mesh.vertices)
    assert "not all of it is seen from the seed" in made.why


@pytest.mark.parametrize("name", [name for name in VOXELS if VOXELS[name][2]])
def test_star_shaped_unit_cubes_are_covered_by_few_parts_that_all_hold_the_seed(name):
    voxels, _, count = VOXELS[name]
    mesh = mesh_of(voxels)
    seed = np.array(CENTRES.get(name, mesh.centroid), float)
    made = decompose(mesh, seed)
    assert (made.cover, len(made.parts)) == (True, count)
    middles = np.array(sorted(voxels)) + 0.5
    covered = np.zeros(len(middles), bool)
    for part, volume in zip(made.parts, volumes(made.points, made.parts), strict=True):
        low, high = made.points[part].min(axis=0), made.points[part].max(axis=0)
        held = ((middles > low) & (middles < high)).all(axis=1)
        assert volume == held.sum() == np.prod(high - low)  # a box, all of it in the solid
        assert ((seed >= low) & (seed <= high)).all()
        covered |= held
    assert covered.all()


@pytest.mark.sampled(4)
@pytest.mark.parametrize("name", VOXELS)
def test_decompositions_do_not_depend_on_pose_or_unit(name):
    voxels, count, few = VOXELS[name]
    vertices, faces = surface_of(voxels)
    seed = np.array(CENTRES.get(name, vertices.mean(axis=0)), float)
    rng = np.random.default_rng(len(name))
    whole = Body.from_mesh(vertices, faces, seed=seed)
    assert len(whole.parts) in (count, few)
    turns = [random_rotation(rng) for _ in range(2)]
    far = np.array([1e6, -1e6, 1e6])
    for turn, unit, shift in [
        (turns[0], 1e-8, 0.0), (turns[1], 1e8, 0.0), (np.eye(3), 1.0, far)
    ]:  # fmt: skip
        body = Body.from_mesh(unit * vertices @ turn.T + shift, faces, seed=unit * seed @ turn.T + shift)
        assert len(body.parts) == len(whole.parts)
        assert sorted(body.faces) == sorted(whole.faces)
        if "partition" in body.notes[0]:
            total = sum(part.volume_and_centroid[0] for part in body.parts)
            assert total == pytest.approx(len(voxels) * unit**3, rel=1e-12)


def test_turned_and_far_away_a_body_is_cut_as_at_home():
    """Its drawn faces are flat to 1e-10 of its size only: the last digit of its coordinates."""
    vertices, faces = surface_of(VOXELS["edges of a cube"][0])
    turn = random_rotation(np.random.default_rng(3))
    body = Body.from_mesh(vertices @ turn.T + [1e6, -1e6, 1e6], faces)
    assert len(body.parts) == 12
    assert sum(part.volume_and_centroid[0] for part in body.parts) == pytest.approx(20, rel=1e-9)
    assert sorted(body.faces) == sorted(Body.from_mesh(vertices, faces).faces)


def test_defects_of_a_surface_are_repaired_or_refused():
    vertices, faces = surface_of(VOXELS["L"][0])
    inside_out = Body.from_mesh(vertices, [face[::-1] for face in faces])
    again = Body.from_mesh(vertices, faces)
    assert len(inside_out.notes) == 2
    assert [len(part.vertices) for part in inside_out.parts] == [len(part.vertices) for part in again.parts]
    doubled = Body.from_mesh(vertices, [*faces, faces[3]])
    assert len(doubled.parts) == 2
    assert len(doubled.notes) == 2
    with pytest.raises(InputError, match="lid"):
        Body.from_mesh(vertices, faces[1:], name="lid")


# --------------------------------------------------------------------------------------------------------- rationals


def check_exactly(mesh: Mesh) -> None:
    solid = decomposition._Solid.of(mesh)
    assert solid.space.planar
    truth = Fraction(int(mesh.exact_volume.p), int(mesh.exact_volume.q))
    for rule in RULES:
        cells = partition(solid.space, solid.hull, solid.inner, rule)
        assert sum(volumes_before_rounding(solid.space, cells)) == truth
        joined = merged(solid.space, cells)
        assert len(joined) <= len(cells)
        assert sum(volumes_before_rounding(solid.space, joined)) == truth


@pytest.mark.sampled(6)
@pytest.mark.parametrize("family", ["hulls", "boxes", "box less boxes", "extrusion", "hollow"])
@pytest.mark.parametrize("number", range(2))
def test_volumes_of_partitions_with_rational_cuts_add_up_exactly(family, number):
    """Integer corners, cut points with any denominators, before they are rounded."""
    rng = np.random.default_rng(number)
    while True:
        solid = random_solid(rng, family, turned=False)
        vertices = np.round(256 * solid.vertices)
        if np.abs(vertices - 256 * solid.vertices).max() == 0:  # manifold3d's own cuts are no integers
            break
    check_exactly(checked_mesh(vertices, solid.triangles))


def test_cut_points_at_thirds_are_exact_until_they_are_rounded():
    solid = solid_of([box((-7, -7, 0), (7, 7, 2))], [prism([(-3, -2), (3, -1), (1, 3)], -1, 3)])
    mesh = checked_mesh(solid.vertices, solid.triangles)
    check_exactly(mesh)
    made = decompose(mesh, np.zeros(3))
    new = made.points[len(mesh.vertices) :]
    assert any(Fraction(x).denominator > 2**20 for x in new.ravel())
    assert float(sum(volumes(made.points, made.parts))) == pytest.approx(mesh.volume, rel=1e-14)


# ------------------------------------------------------------------------------------------------------------ prisms


def gear(teeth: int, root: float, tip: float) -> np.ndarray:
    angle = 2 * np.pi * (np.arange(teeth)[:, None] + [0.3, 0.4, 0.6, 0.7]).ravel() / teeth
    radius = np.tile([root, tip, tip, root], teeth)
    return radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def extruded(outline: np.ndarray, holes: tuple[np.ndarray, ...] = ()) -> tuple[np.ndarray, np.ndarray]:
    from manifold3d import CrossSection, FillRule, Manifold

    flat = CrossSection([np.asarray(outline, float), *(hole[::-1] for hole in holes)], FillRule.EvenOdd)
    mesh = Manifold.extrude(flat, 1.0).to_mesh64()
    return np.array(mesh.vert_properties[:, :3]), np.array(mesh.tri_verts, np.int64)


def ring(sides: int, radius: float, phase: float = 0.0) -> np.ndarray:
    angle = 2 * np.pi * np.arange(sides) / sides + phase
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("outline", "holes", "count"),
    [
        (gear(12, 4, 5), (), 13),  # a hub and its teeth
        (gear(12, 4, 5), (ring(8, 2),), 20),
        (ring(4, 6, np.pi / 4), (ring(6, 2),), 6),  # the plate around a hexagonal hole
        (ring(6, 4), (ring(24, 2),), 24),
        (ring(48, 4), (ring(48, 3),), 48),
        ([(0, 0), (10, 0), (10, 4), (7, 4), (8, 2), (2, 2), (3, 4), (0, 4)], (), 3),  # dovetail
    ],
)
def test_prisms_are_cut_into_few_parts(outline, holes, count):
    vertices, triangles = extruded(np.asarray(outline, float), holes)
    for turn in (np.eye(3), random_rotation(np.random.default_rng(count))):
        mesh = checked_mesh(vertices @ turn.T, triangles)
        made = decompose(mesh, np.array([50.0, 0, 0]))
        assert len(made.parts) == count
        assert float(sum(volumes(made.points, made.parts))) == pytest.approx(mesh.volume, rel=1e-12)


# ------------------------------------------------------------------------------------------------------ random solids


def held_by_parts(body: Body, points: np.ndarray) -> np.ndarray:
    """How many parts hold each point."""
    counts = np.zeros(len(points), np.int64)
    for part in body.parts:
        levels = (part.normals * part.vertices[[loop[0] for loop in part.loops]]).sum(axis=1)
        counts += (points @ part.normals.T < levels).all(axis=1)
    return counts


@pytest.mark.sampled(8)
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("number", range(2))
def test_parts_of_random_solids_hold_the_points_that_their_meshes_hold(family, number):
    rng = np.random.default_rng(100 + number)
    solid = random_solid(rng, family, turned=bool(number % 2))
    body, mesh = solid.body(), checked_mesh(solid.vertices, solid.triangles)
    low, high = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
    points = rng.uniform(low, high, (500, 3))
    counts, inside = held_by_parts(body, points), mesh.contains(points)
    assert 0.02 < inside.mean() < 0.999
    np.testing.assert_array_equal(counts > 0, inside)
    if "partition" in body.notes[0]:
        assert counts.max() == 1
        total = sum(part.volume_and_centroid[0] for part in body.parts)
        assert total == pytest.approx(solid.volume, rel=1e-11)


@pytest.mark.parametrize(("sides", "inner"), [(3, 1.2), (5, 2.0), (12, 2.6)])
def test_stars_are_covered_by_parts_that_all_hold_the_seed(sides, inner):
    radius = np.tile([inner, 3.0], sides)[:, None]
    vertices, triangles = extruded(radius * ring(2 * sides, 1.0))
    seed = np.array([0.1, -0.05, 0.4])
    body, mesh = Body.from_mesh(vertices, triangles, seed=seed), checked_mesh(vertices, triangles)
    assert "parts that overlap" in body.notes[0]
    assert (held_by_parts(body, seed[None]) == len(body.parts)).all()
    assert len(body.parts) <= sides
    points = np.random.default_rng(sides).uniform([-3, -3, 0], [3, 3, 1], (2000, 3))
    np.testing.assert_array_equal(held_by_parts(body, points) > 0, mesh.contains(points))


def test_no_part_of_a_cover_is_needless():
    rng = np.random.default_rng(8)
    radius = np.tile([2.0, 3.0], 7)[:, None] * rng.uniform(0.9, 1.1, (14, 1))
    vertices, triangles = extruded(radius * ring(14, 1.0))
    body = Body.from_mesh(vertices, triangles, seed=(0, 0, 0.5))
    assert "parts that overlap" in body.notes[0]
    points = rng.uniform([-3.3, -3.3, 0], [3.3, 3.3, 1], (20000, 3))
    for k in range(len(body.parts)):
        one = Body.from_parts([body.parts[k].vertices], seed=body.seed)
        rest = Body.from_parts([own.vertices for j, own in enumerate(body.parts) if j != k], seed=body.seed)
        assert ((held_by_parts(one, points) > 0) & (held_by_parts(rest, points) == 0)).any()


def test_the_cuts_of_a_solid_are_the_same_every_time():
    solid = random_solid(np.random.default_rng(5), "box less prisms", turned=True)
    one, two = solid.body(), solid.body()
    assert one.vertices.tobytes() == two.vertices.tobytes()
    assert [part.vertices.tobytes() for part in one.parts] == [part.vertices.tobytes() for part in two.parts]


# ------------------------------------------------------------------------------------------------- which method, why


def test_a_convex_mesh_is_one_part_whatever_the_method():
    vertices, faces = surface_of(CUBE3)
    for method in ("auto", "exact", "surface", "coacd"):
        body = Body.from_mesh(vertices, faces, decomposition=method)
        assert len(body.parts) == 1
        assert sorted(map(len, body.faces)) == [4] * 6
        assert "convex" in body.notes[0]
        np.testing.assert_array_equal(body.vertices, vertices)


def test_of_many_reflex_edges_the_surface_is_taken_and_said_so(monkeypatch):
    vertices, faces = surface_of(VOXELS["comb"][0])
    assert "exact" in Body.from_mesh(vertices, faces).notes[0]
    monkeypatch.setattr(decomposition, "MOST_WORK", 3)
    monkeypatch.setattr(decomposition, "MOST_FOR_FEW", 3)
    assert "one under each face (10 reflex edges and" in Body.from_mesh(vertices, faces).notes[0]
    assert "exact" in Body.from_mesh(vertices, faces, decomposition="exact").notes[0]


def test_coacd_that_is_not_installed_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "coacd", None)
    with pytest.raises(InputError, match=r"'lid': decomposition: .*pip install -c constraints.txt -e '\.\[coacd\]'"):
        Body.from_mesh(*surface_of(VOXELS["L"][0]), decomposition="coacd", name="lid")


def test_an_unknown_decomposition_is_refused():
    with pytest.raises(InputError, match=r"'lid': decomposition: unknown .*found 'vhacd'.*auto, exact, surface, coacd"):
        Body.from_mesh(*surface_of(VOXELS["L"][0]), decomposition="vhacd", name="lid")


# ------------------------------------------------------------------------------------------------------------- CoACD


def distances(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Least distances of points from triangles, by projection and by the nearest points of the sides."""
    least = np.full(len(points), np.inf)
    for a, b, c in triangles:
        n = np.cross(b - a, c - a)
        inside = np.ones(len(points), bool)
        for p, q in ((a, b), (b, c), (c, a)):
            inside &= np.cross(q - p, points - p) @ n >= 0
            share = np.clip((points - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
            least = np.minimum(least, np.linalg.norm(points - p - share[:, None] * (q - p), axis=1))
        heights = np.abs((points - a) @ n) / np.linalg.norm(n)
        least = np.where(inside, np.minimum(least, heights), least)
    return least


def surface_samples(triangles: np.ndarray, rng: np.random.Generator, count: int) -> np.ndarray:
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    which = rng.choice(len(triangles), count, p=areas / areas.sum())
    return (rng.dirichlet(np.ones(3), count)[:, :, None] * triangles[which]).sum(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("bulge", [0.0, 0.35])
def test_the_deviation_of_coacd_bounds_what_samples_show(bulge, monkeypatch):
    finest = 0.02  # of the size: coarser than for users, and soon told
    monkeypatch.setattr("fcdm_opt.geometry.decomposition.FINEST", finest)
    rng = np.random.default_rng(2)
    if bulge:  # a ring: hulls stick out into its hole
        vertices, triangles = extruded(ring(24, 1.0), (ring(24, 1.0 - bulge),))
    else:
        vertices, triangles = extruded([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)])
    body, mesh = Body.from_mesh(vertices, triangles, decomposition="coacd"), checked_mesh(vertices, triangles)
    out, short = body.deviation
    assert "CoACD" in body.notes[0]
    np.testing.assert_array_equal(body.vertices[: len(vertices)], vertices)
    fans = [
        part.vertices[[loop[0], *loop[k : k + 2]]] for part in body.parts for loop in part.loops
        for k in range(1, len(loop) - 1)
    ]  # fmt: skip
    on_parts = surface_samples(np.array(fans), rng, 4000)
    beyond = on_parts[~mesh.contains(on_parts)]
    seen_out = distances(beyond, mesh.vertices[mesh.triangles]).max(initial=0.0)
    on_mesh = surface_samples(mesh.vertices[mesh.triangles], rng, 4000)
    seen_short = distances(on_mesh[held_by_parts(body, on_mesh) == 0], np.array(fans)).max(initial=0.0)
    size = float(np.ptp(vertices, axis=0).max())
    for bound, seen in ((out, seen_out), (short, seen_short)):
        assert seen <= bound <= max(1.01 * finest * size, (1 + SHARE) * 1.2 * seen)
    assert (out > finest * size) == bool(bulge)


def test_a_deviation_is_two_lengths():
    cube = np.array(list(itertools.product([0.0, 1.0], repeat=3)))
    assert Body.from_parts([cube], deviation=(0.5, 0)).deviation == (0.5, 0.0)
    for wrong in ((-1.0, 0.0), (0.0, np.inf), 0.1, (1.0, 2.0, 3.0), "thin"):
        with pytest.raises(InputError, match="'lid': deviation"):
            Body.from_parts([cube], deviation=wrong, name="lid")


def test_points_that_no_three_drawn_planes_meet_in_do_not_multiply_their_digits():
    """Points within rounding of a plane count as on it; edges between such points are cut in ever more digits."""
    # 40 cuts, each of the edge from the last one to a drawn point: a STEP of joined balls had millions of bits
    rng, count = np.random.default_rng(1), 40
    drawn = np.vstack([np.zeros(3), rng.normal(size=(count, 3))])
    ends, walls = [drawn[0]], list[np.ndarray]()
    for end in drawn[1:]:
        along, share = end - ends[-1], rng.uniform(0.4, 0.6)
        ends.append(ends[-1] + share * along)
        walls.append(ends[-1] + np.cross(along, np.vstack([np.zeros(3), rng.normal(size=(2, 3))])))
    space, last = Arrangement(np.concatenate([drawn, *walls]), np.arange(count + 1)), 0
    for k in range(count):
        first = count + 1 + 3 * k
        last = space.cut(last, k + 1, space.plane(range(first, first + 3)))
        assert max(int(x.q).bit_length() for x in space.exact[last]) < 4096
        assert space.coordinates([last])[0] == pytest.approx(ends[k + 1], abs=1e-9)


def test_solids_apart_were_cut_by_the_planes_of_each_others_facets(monkeypatch):
    """Six spheres took minutes; of two that are not convex, with room between them, cuts go through their own alone."""
    monkeypatch.setattr(Arrangement, "split", None)
    spheres = [Sphere(4.0, centre=(10.0 * k, 0.0, 0.0), facets=12) for k in range(6)]
    body = joined(*spheres)
    assert len(body.parts) == 6
    assert sum(len(part.vertices) for part in body.parts) == len(body.vertices) == 6 * len(spheres[0].vertices)
    assert body.seed == pytest.approx([25.0, 0.0, 0.0], abs=1e-9)
    monkeypatch.undo()
    vertices, faces = surface_of(VOXELS["comb"][0])
    corners = np.array(vertices, float)
    away = 3.0 * np.ptp(corners, axis=0).max()
    both = np.concatenate([corners, corners + np.array([away, 0.3, 0.0])])
    one = Body.from_mesh(corners, faces)
    two = Body.from_mesh(both, [*faces, *([k + len(corners) for k in own] for own in faces)])
    assert len(two.parts) == 2 * len(one.parts)
    assert len(two.faces) == 2 * len(one.faces)
    shapes = [{tuple(np.round(part.vertices, 9).ravel().tolist()) for part in body.parts} for body in (one, two)]
    assert shapes[0] < shapes[1]
