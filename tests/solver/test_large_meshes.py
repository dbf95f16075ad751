"""Bodies of which only the surface is made convex parts, and of which a problem models only the parts that matter."""

import math
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold
from voxels import VOXELS, surface_of

import fcdm_opt as fo
from fcdm_opt.drafting.choice import chosen
from fcdm_opt.drafting.situation import Situation
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.crossings import overlapping
from fcdm_opt.judge.whole import WholeSurfaces
from fcdm_opt.motion.motions import Free, Translation
from fcdm_opt.problem.problem import Problem

SOLIDS = [name for name, (cells, *_) in VOXELS.items() if len(cells) > 1]
SIDES = 320
GROWN = 9  # cubes of a solid that is grown
PEG, HOLE, DEEP = 9.0, 9.1, 4.0


def prism_ring(sides: int, inner: float, half: float, depth: float) -> tuple[np.ndarray, list[list[int]]]:
    """Return a square block with a regular prism bored through it, flats towards x."""
    angles = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    outer = half * ways / np.abs(ways).max(axis=1)[:, None]
    rings = [np.column_stack([own, np.full(sides, z)]) for own in (inner * ways, outer) for z in (0.0, depth)]
    low, high, below, above = (k * sides + np.arange(sides) for k in range(4))
    faces = []
    for k in range(sides):
        j = (k + 1) % sides
        faces += [[low[k], high[k], high[j]], [low[k], high[j], low[j]]]
        faces += [[below[k], below[j], above[j]], [below[k], above[j], above[k]]]
        faces += [[low[k], low[j], below[j]], [low[k], below[j], below[k]]]
        faces += [[high[k], above[k], above[j]], [high[k], above[j], high[j]]]
    return np.vstack(rings), [[int(v) for v in face] for face in faces]


def prism(sides: int, radius: float, low: float, high: float) -> fo.Body:
    angles = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    ring = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    both = [np.column_stack([ring, np.full(sides, z)]) for z in (low, high)]
    return fo.Body.convex(np.vstack(both), seed=(0, 0, 0), name="peg")


@pytest.fixture(scope="module")
def bored() -> fo.Body:
    return fo.Body.from_mesh(*prism_ring(SIDES, HOLE, 15.0, DEEP), seed=(0, 0, 0), name="plate")


def grown(number: int) -> set[tuple[int, ...]]:
    """Return cubes grown face by face from one, none of which meets another along an edge or at a corner alone."""
    rng, cubes = np.random.default_rng(number), {(0, 0, 0)}

    def joined(one: tuple[int, ...], two: tuple[int, ...]) -> bool:
        box = [sorted({a, b}) for a, b in zip(one, two, strict=True)]
        near, todo = {one}, [one]
        while todo:
            at = todo.pop()
            for cube in cubes - near:
                if (
                    all(x in span for x, span in zip(cube, box, strict=True))
                    and np.abs(np.subtract(at, cube)).sum() == 1
                ):
                    near.add(cube)
                    todo.append(cube)
        return two in near

    while len(cubes) < GROWN:
        start = sorted(cubes)[rng.integers(len(cubes))]
        new = tuple((np.array(start) + rng.permutation([rng.choice([-1, 1]), 0, 0])).tolist())
        cubes.add(new)
        if not all(joined(new, cube) for cube in cubes if np.abs(np.subtract(new, cube)).max() == 1):
            cubes.remove(new)
    return cubes


@pytest.mark.sampled(5)
@pytest.mark.parametrize("name", [*SOLIDS, *range(4)])
def test_answers_on_small_solids_are_those_of_the_whole_exact_partition(name: str | int) -> None:
    vertices, faces = surface_of(grown(name) if isinstance(name, int) else VOXELS[name][0])
    vertices = np.asarray(vertices, dtype=float)
    if isinstance(name, int):
        vertices = vertices @ (np.eye(3) + np.random.default_rng(name).uniform(-0.2, 0.2, (3, 3)))
    exact, surface = (
        fo.Body.from_mesh(vertices, faces, decomposition=method, seed=vertices.mean(axis=0), name="solid")
        for method in ("exact", "surface")
    )
    assert surface.is_surface
    assert not exact.is_surface
    top = max((vertices[list(face)].mean(axis=0) for face in faces), key=lambda middle: middle[2])
    tip = np.array([(0.01, 0.02, 0.0), (-0.2, 0.0, 0.1), (0.0, -0.3, 0.2), (0.3, 0.2, 1.0)])
    other = fo.Body.convex(top + tip + [0.0, 0.0, 0.02], name="tip")
    for way, letter in (("z", "A"), ("z", "D"), ((0.6, 0.0, 0.8), "C")):
        asked = {"tolerance": 0.05, "requirement": letter, "motion": Translation(way), "goal": "touch"}
        one, two = (fo.solve(Problem(other, body, **asked)) for body in (exact, surface))
        assert one.usable
        assert two.usable
        assert two.amount == pytest.approx(one.amount, rel=1e-9, abs=1e-12)
        assert two.lower_bound == pytest.approx(one.lower_bound, rel=1e-9, abs=1e-12)


@pytest.mark.slow
def test_a_peg_in_a_hole_of_many_sides_touches_where_the_closed_form_says(bored: fo.Body) -> None:
    assert bored.is_surface
    assert f"{SIDES} reflex edges" in bored.notes[0]
    apothem = math.cos(math.pi / SIDES)
    peg = prism(SIDES, PEG, -1.0, 5.0)
    for letter, (one, two) in {"A": (1.01, 1.01), "D": (0.99, 0.99)}.items():  # C below
        problem = Problem(peg, bored, tolerance=0.01, requirement=letter, motion=Translation("x"), goal="touch")
        solution = fo.solve(problem)
        assert solution.usable, solution.certificate
        assert solution.amount == pytest.approx((two * HOLE - one * PEG) * apothem, rel=1e-9)
        assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-9)
        assert solution.problem.static is bored
        kept = solution.problem.active[1]
        assert len(kept.parts) < len(bored.parts) / 2
        assert {"whole surfaces", "inside"} <= {check.name for check in solution.certificate.checks}


@pytest.mark.slow
def test_a_body_deep_inside_a_surface_is_seen(bored: fo.Body) -> None:
    block = fo.Body.from_mesh(*surface_of(VOXELS["L"][0]), decomposition="surface", seed=(0, 0, 0), name="block")
    middle = np.mean(block.vertices[: len(block.vertices) - len(block.parts)], axis=0)
    inner = fo.Body.convex(1e-3 * np.vstack([np.zeros(3), np.eye(3)]) + [0.5, 0.5, 0.5], name="speck")
    whole = WholeSurfaces(inner, block, np.ones(2), np.eye(4)).looked_at()[2]
    assert np.isfinite(middle).all()
    assert whole.inside == 1
    away = np.eye(4)
    away[0, 3] = 50.0
    assert WholeSurfaces(inner, block, np.ones(2), away).looked_at()[2].inside == 0


def test_contacts_within_the_thickness_of_a_surface_were_listed() -> None:
    """A cube on top of an angle of 12 height: in its middle it meets what the surface is kept as from beneath."""
    outline = np.array([(-10, -10), (10, -10), (10, 10), (2, 10), (2, 2), (-10, 2)], float)
    corners = np.vstack([np.column_stack([outline, np.full(6, z)]) for z in (-6.0, 6.0)])
    sides = [[k, (k + 1) % 6, 6 + (k + 1) % 6, 6 + k] for k in range(6)]
    faces = [[*range(6)][::-1], [*range(6, 12)], *sides]
    angle = fo.Body.from_mesh(corners, faces, decomposition="surface", seed=(6, -4, 0))
    cube = fo.Body.convex(np.array(list(product((5.5, 6.5), (-4.5, -3.5), (3.5, 4.5)))), seed=(6, -4, 4))
    curve = fo.decision_curve(cube, angle, box=((0.3, 2.0), (0.3, 2.0)))
    assert angle.is_surface
    assert [(4.0 - rho[0] / 2.0) / 6.0 for own in curve.segments for rho in (own.start, own.end)] == pytest.approx(
        [rho[1] for own in curve.segments for rho in (own.start, own.end)]
    )
    assert len(curve.segments) == 1
    assert not curve.switching_points
    assert curve.crossings(0.35) == pytest.approx([(4.0 - 0.35 / 2.0) / 6.0])


ELL = surface_of(VOXELS["L"][0])
NOTCH = list(product((1, 2), (1, 2), (0, 1)))  # what an L has not of a block of 2 x 2 x 1


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("shapes", "direction", "low", "high"),
    [
        ("stacked", {"TX": 1.0}, -2.3, 1.7),  # one L lies on another, a little aside
        ("stacked", {"TZ": 1.0}, -23 / 12, math.inf),  # until they share nothing more: they shrink together
        ("stacked", {"TX": 1.0, "RY": 0.1}, 0.0, 0.0),
        ("nested", {"TX": 1.0, "TY": 1.0, "TZ": 0.2}, -5 / 6, math.inf),  # a cube in the notch, against both walls
        ("tip", {"TX": 1.0}, -1.5, 0.5),  # over three facets
        ("bored", {"TZ": 1.0}, -5.0, 5.0),  # a peg of eight sides along the wall of its hole
    ],
)
def test_ranges_over_the_facets_of_a_surface_are_those_of_solids_cut(shapes, direction, low, high) -> None:
    found, top = [], np.array([0.0, 0.0, 1.0])
    for kept in ("surface", "exact"):
        corners, faces = ELL
        more = {"goal": "touch"}
        two = fo.Body.from_mesh(corners - top, faces, decomposition=kept, seed=(1.1, 1.0, -1.0))
        if shapes == "bored":
            two = fo.Body.from_mesh(*prism_ring(8, HOLE, 20.0, DEEP), decomposition=kept)
            off = (HOLE - PEG) * np.cos(np.pi / 8)
            one = fo.Body.convex(prism(8, PEG, -1.0, 5.0).vertices + np.array([off, 0.0, 0.0]))
        elif shapes == "stacked":
            one = fo.Body.from_mesh(corners + np.array([0.3, 0.2, 0]), faces, decomposition=kept, seed=(1.0, 1.0, 1.0))
        elif shapes == "nested":
            one = fo.Body.convex(NOTCH - top, seed=(1.5, 1.5, -0.5))
            two = fo.Body.from_mesh(corners - top, faces, decomposition=kept, seed=(0.5, 0.5, -0.5))
            more = {"goal": "at", "contacts": "all"}
        else:
            one = fo.Body.convex([(1.5, 0.6, 0), (1, 0, 2), (2, 0, 2), (1, 1, 2), (2, 1, 2)], seed=(1.5, 0.6, 1.0))
        motion = Translation("x") >> Translation("y") >> Translation("z") >> fo.Rotation("y")
        problem = Problem(one, two, tolerance=0.01, requirement="A", motion=motion, **more)
        found.append(fo.coherent_range(problem, direction))
        assert (found[-1].low, found[-1].high) == pytest.approx((low, high), abs=1e-12)
        assert found[-1].proved
    assert found[0].features == found[1].features
    assert [event.kind for event in found[0].events] == [event.kind for event in found[1].events]


@pytest.mark.slow
def test_parts_of_large_meshes_that_are_apart_have_no_gap_at_all_sizes(bored: fo.Body) -> None:
    problem = Problem(
        prism(SIDES, PEG, -1.0, 5.0), bored, tolerance=0.01, requirement="C", motion=Translation("x"), goal="touch"
    )
    with pytest.raises(InputError, match="here are none as drawn"):
        fo.clearances(problem)


SLOT = [(0, 0), (30, 0), (30, 20), (20, 20), (20, 10), (10, 10), (10, 20), (0, 20)]


def slotted(decomposition: str) -> fo.Body:
    """A block with a slot from x = 10 to 20, down to y = 10."""
    count = len(SLOT)
    sides = [[k, (k + 1) % count, (k + 1) % count + count, k + count] for k in range(count)]
    faces = [[*range(count)][::-1], [*range(count, 2 * count)], *sides]
    points = [(x, y, z) for z in (0.0, 10.0) for x, y in SLOT]
    return fo.Body.from_mesh(points, faces, decomposition=decomposition, seed=(15, 0, 0), name="slot")


def key(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float] = (1, 9)) -> fo.Body:
    return fo.Body.convex([(a, b, c) for a in x for b in y for c in z], name="key")


WALLS = [
    fo.Size("left", "static", faces=[{"through": [10, 15, 5]}], tolerance=(-0.1, 0.1)),
    fo.Size("floor", "static", faces=[{"through": [15, 10, 5]}], tolerance=(-0.1, 0.1)),
]
XY = Translation("x") >> Translation("y")
DIAGONAL = np.arctan2(6.5, 3.5)


@pytest.mark.parametrize("floor", [0.05, -0.05])
def test_a_body_kept_as_a_surface_took_no_sizes_of_its_faces(floor: float) -> None:
    """The key follows the walls that it stands on, as far as they are moved."""
    problem = Problem(
        key((10, 19.8), (10, 25)), slotted("surface"), motion=XY, goal="at", contacts="all", sizes=WALLS,
        made={"left": 0.1, "floor": floor},
    )  # fmt: skip
    solution = fo.solve(problem)
    assert solution.certificate.passed
    assert list(solution.parameters.values()) == pytest.approx([0.1, floor], abs=1e-12)
    assert fo.verify(fo.Solution.from_dict(solution.to_dict())).passed


def test_a_body_kept_as_a_surface_is_sensitive_to_sizes() -> None:
    problem = Problem(
        key((10.2, 19.8), (10.5, 25)), slotted("surface"), motion=XY, goal="touch", sizes=WALLS, made={"left": 0.05}
    )
    solution = fo.solve(problem)
    assert solution.amount == pytest.approx(0.15, rel=1e-12)
    assert solution.sensitivity.sizes == pytest.approx({"left": -1.0, "floor": 0.0}, abs=1e-12)
    with pytest.raises(InputError, match="here are none as drawn"):
        fo.stack_up(problem)


@pytest.mark.parametrize(
    ("motion", "free"),
    [
        (Translation("x"), (-1.0, 2.0)),
        (Translation("y"), (-2.0, np.inf)),
        # the lower corners, 3.5 and 6.5 from the seed, come to the walls, 4.5 and 5.5 from it
        (fo.Rotation("z"), [s * (DIAGONAL - np.arccos(d / np.hypot(3.5, 6.5))) for s, d in ((-1, 4.5), (1, 5.5))]),
    ],
)  # fmt: skip
def test_a_range_of_a_large_mesh_was_refused(motion: fo.Motion, free: tuple[float, float]) -> None:
    problem = Problem(key((11, 18), (12, 25)), slotted("surface"), motion=motion, goal="clear", target=(1, 1))
    found = fo.contact_times(problem)
    assert found.free[0] == pytest.approx(free[0], rel=1e-9)
    assert found.free[1] == pytest.approx(free[1], rel=1e-9) or (np.isinf(free[1]) and found.free[1] > 30.0)
    assert found.proved


def test_a_part_in_the_middle_of_a_surface_body_is_no_free_range() -> None:
    small, far = key((-4, -3), (4, 5), (4, 5)), slotted("exact").moved(shifted(100.0))
    for problem in (
        Problem(small, slotted("surface"), motion=Translation("x"), goal="clear", target=(1, 1)),
        Problem(small, far, motion=Translation("x"), goal="clear", target=(1, 1), keep_out=[slotted("surface")]),
    ):
        found = fo.contact_times(problem, limit=20.0)
        assert found.free == pytest.approx((-20.0, 3.0), rel=1e-12)
    speck = key((4, 5), (4, 5), (4, 5))
    inside = fo.contact_times(Problem(speck, slotted("surface"), motion=Translation("x"), goal="clear", target=(1, 1)))
    assert inside.free is None
    assert {span.state for span in inside.spans if span.low <= 0 <= span.high} == {"overlapping"}


def shifted(x: float) -> np.ndarray:
    T = np.eye(4)
    T[0, 3] = x
    return T


@pytest.mark.parametrize("decomposition", ["exact", "surface"])
def test_a_fit_between_the_walls_of_a_surface_body_was_no_number(decomposition: str) -> None:
    """2 % smaller, a key that fills the slot is open by .1 on both sides, and off the floor."""
    body = fo.Body.convex([(a, b, c) for a in (10, 20) for b in (10, 25) for c in (1, 9)], seed=(15, 15, 5), name="key")
    given = {"motion": XY, "goal": "fit", "contacts": "all", "target": (0.98, 1.0)}
    solution = fo.solve(Problem(body, slotted(decomposition), **given), effort="quick")
    assert solution.usable, solution.certificate
    assert sorted(solution.contact_gaps.values()) == pytest.approx([0.1, 0.1, 0.1], abs=1e-9)
    assert solution.amount == pytest.approx(0.0, abs=1e-9)


def test_contact_rows_of_a_large_mesh_were_refused() -> None:
    """Rows of the parts near by: the clearances of planes that the parts keep, at rest and where they are restored."""
    problem = Problem(key((9.9, 19), (9.8, 25)), slotted("surface"), motion=XY, goal="clear", target=(1, 1))
    rows = fo.contact_rows(problem)
    assert rows.within == pytest.approx(problem.size / 16)
    assert 0 < len(rows.clearances) < len(problem.static.parts)
    gaps = [float(row(q=[0.1, 0.2])["gap"]) for row in rows.contacts]
    assert min(gaps) == pytest.approx(0.0, abs=1e-12)
    assert min(float(row(q=[0.0, 0.0])["gap"]) for row in rows.contacts) == pytest.approx(-0.2, abs=1e-12)


@pytest.mark.slow
def test_plain_data_makes_the_same_surface_again(bored: fo.Body) -> None:
    problem = Problem(
        prism(SIDES, PEG, -1.0, 5.0), bored, tolerance=0.01, requirement="C", motion=Translation("x"), goal="touch"
    )
    again = Problem.from_dict(problem.to_dict())
    assert again.static.is_surface
    assert len(again.request["static"].parts) == len(bored.parts)
    assert fo.solve(again).amount == pytest.approx((1.01 * HOLE - 0.99 * PEG) * math.cos(math.pi / SIDES), rel=1e-9)


@pytest.mark.slow
def test_a_free_motion_of_a_part_with_thousands_of_faces_is_bounded(bored: fo.Body) -> None:
    corners = np.array([(x, y, z) for x in (7.5, 8.5) for y in (-0.4, 0.4) for z in (1.0, 3.0)])
    block = fo.Body.convex(corners, name="block")
    problem = Problem(block, bored, target=(1.0, 1.0), motion=Free(), goal="touch")
    solution = fo.solve(problem, effort="quick")
    assert solution.usable
    assert solution.amount <= HOLE - 8.5
    assert solution.lower_bound <= solution.amount


def test_the_distance_of_large_meshes_as_drawn_is_that_of_their_nearest_corners(bored: fo.Body) -> None:
    # facets of the hole are nearer to the tip by their boxes than the one it stands over, across their planes
    tip = np.array([(0.0, 0.0, 0.0), (-0.4, 0.3, 3.0), (0.4, 0.3, 3.0), (0.0, -0.5, 3.0)])
    for x, y, gap in ((12.0, 0.0, 0.05), (10.5, 3.0, 0.2), (9.2, 0.0, 0.01)):
        situation = Situation(fo.Body.convex(tip + np.array([x, y, DEEP + gap]), name="tip"), bored)
        assert situation.large
        assert situation.state == "apart"
        assert situation.gap == pytest.approx(gap, rel=1e-9)
        assert abs(situation.normal[2]) > 0.9


def tray() -> fo.Body:
    """Return a block of 3 x 3 x 2 with a pocket of 1 x 1 x 1 in the middle of its top, by its surface alone."""
    vertices, faces = surface_of({(x, y, z) for x in range(3) for y in range(3) for z in range(2)} - {(1, 1, 1)})
    return fo.Body.from_mesh(vertices, faces, decomposition="surface", seed=(1.5, 1.5, 0.0), name="tray")


def test_where_the_nearest_facets_never_touch_others_farther_off_do() -> None:
    """A peg whose sides are .005 from the pocket's walls moves down .5 to its floor: that is not impossible."""
    corners = [[1.5 + 0.495 * x, 1.5 + 0.495 * y, z] for x in (-1, 1) for y in (-1, 1) for z in (1.5, 3.0)]
    peg = fo.Body.convex(corners, seed=(1.5, 1.5, 0.0), name="peg")
    problem = Problem(peg, tray(), tolerance=0.01, requirement="C", motion=Translation("z"), goal="touch")
    solution = fo.solve(problem)
    assert solution.usable, solution.certificate
    assert solution.amount == pytest.approx(0.99 * 1.5 - 1.01, rel=1e-12)
    assert solution.lower_bound == pytest.approx(solution.amount, rel=1e-9)


def test_corners_on_the_floor_do_not_make_a_part_lie_inside_it() -> None:
    """A spike on a star, nearly all corners of which lie on the floor of the pocket, and are neither in nor out."""
    angles = np.pi * np.arange(32) / 16.0
    radii = np.where(np.arange(32) % 2, 0.2, 0.4)
    star = np.column_stack([1.5 + radii * np.cos(angles), 1.5 + radii * np.sin(angles), np.ones(32)])
    vertices = np.vstack([star, [[1.5, 1.5, 1.0], [1.5, 1.5, 2.5]]])
    faces = [[k, (k + 1) % 32, 33] for k in range(32)] + [[(k + 1) % 32, k, 32] for k in range(32)]
    spike = fo.Body.from_mesh(vertices, faces, decomposition="surface", seed=(1.5, 1.5, 0.0), name="spike")
    asked = {"tolerance": 0.01, "motion": Translation("z"), "goal": "seat", "contacts": "all"}
    for letter, shift in {"A": 0.0, "B": -0.02, "C": 0.02, "D": 0.0}.items():
        solution = fo.solve(Problem(spike, tray(), requirement=letter, **asked))
        assert solution.usable, solution.certificate
        assert solution.parameters["TZ"] == pytest.approx(shift, abs=1e-12)


def test_boxes_that_overlap_are_found_as_by_comparing_all() -> None:
    rng = np.random.default_rng(20261125)
    for count, axes in ((1, 3), (2, 3), (3, 6), (70, 3), (300, 6), (2000, 3)):
        low = rng.random((count, axes))
        high, groups = low + rng.random((count, axes)) * count**-0.4, rng.integers(0, 3, count)
        meet = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2) & (groups[:, None] != groups)
        wanted = {(i, j) for i, j in np.argwhere(meet).tolist() if i < j}
        found = [np.sort(np.stack(pairs), axis=0).T.tolist() for pairs in overlapping(low, high, groups)]
        listed = [tuple(pair) for block in found for pair in block]
        assert len(listed) == len(set(listed))
        assert set(listed) == wanted


@pytest.mark.slow
def test_a_ring_over_a_pin_far_from_the_seed_is_seated_by_any_shift(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plate grows about its middle and takes its pin along: the ring must follow aside, or it does not seat."""
    from manifold3d import Manifold

    def meshed(solid: Manifold, name: str) -> fo.Body:
        mesh = solid.to_mesh64()
        return fo.Body.from_mesh(
            np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts), decomposition="surface", name=name
        )

    pin = Manifold.cylinder(12.0, 4.0, 4.0, 12).translate((50.0, 0.0, 0.0))
    plate = meshed(Manifold.cube((140.0, 60.0, 5.0)).translate((-70.0, -30.0, -5.0)) + pin, "plate")
    ring = Manifold.cylinder(6.0, 9.0, 9.0, 12) - Manifold.cylinder(20.0, 4.2, 4.2, 12).translate((0, 0, -5.0))
    situation = Situation(meshed(ring.translate((50.0, 0.0, 0.0)), "ring"), plate)
    monkeypatch.setattr("fcdm_opt.drafting.choice.SHORT", math.inf)  # no answer is to depend on how busy a machine is
    choice = chosen(situation)
    assert choice.goal == "seat"
    assert len(choice.motion.steps) == 3
    assert sorted(choice.usable) == ["A", "B", "C", "D"]
    middle = plate.seed[2]
    for letter, (one, two) in {"A": (1.02, 1.02), "D": (0.98, 0.98)}.items():
        answer = choice.usable[letter]
        up = (
            -(two - 1.0) * middle + (one - 1.0) * 3.0
        )  # the plate's top about its seed, the ring's bottom about its own
        assert answer.parameters["TZ"] == pytest.approx(up, abs=1e-9)
        least = abs((two - 1.0) * (50.0 - plate.seed[0])) - (4.2 * one - 4.0 * two)
        assert abs(answer.parameters["TX"]) >= least - 1e-9
        assert answer.lower_bound == pytest.approx(answer.amount, rel=1e-9)
        unasked = fo.solve(answer.problem.changed(contacts=None))  # whole faces, where no contact is named
        assert unasked.amount == pytest.approx(answer.amount, rel=1e-9)


def turned_diagonals(corners: np.ndarray, faces: list[list[int]], number: int) -> list[list[int]]:
    """Return the triangles of squares, with diagonals of triangles that lie in one plane turned at random."""
    rng = np.random.default_rng(number)
    triangles = [own for a, b, c, d in faces for own in ([a, b, c], [a, c, d])]

    def normal(a: int, b: int, c: int) -> np.ndarray:
        return np.cross(corners[b] - corners[a], corners[c] - corners[a])

    for _ in range(4 * len(faces)):
        sides = {(t[k], t[k - 2]): (n, t[k - 1]) for n, t in enumerate(triangles) for k in range(3)}
        (a, b), (one, c) = list(sides.items())[rng.integers(len(sides))]
        two, d = sides[b, a]
        made = normal(a, d, c), normal(d, b, c)
        flat = all(n @ normal(*triangles[one]) > 0.99 * np.linalg.norm(n) ** 2 > 0 for n in made)
        if flat and abs(normal(*triangles[one]) @ normal(*triangles[two])) > 0 and (c, d) not in sides:
            triangles[one], triangles[two] = [a, d, c], [d, b, c]
    return triangles


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("above", "below", "shift", "ranged"),
    [("L", "L", (0.0, 0.0), True), ("T", "cross", (-0.25, 0.0), True), ("L", "T", (0.5, 0.25), False)],
)
def test_how_faces_are_cut_into_triangles_changes_nothing(above, below, shift, ranged):
    """Corners of triangles within a flush contact are no contacts, and a face goes on where triangles were not near.

    Of a large mesh the corners in the middle of two faces were a contact of its own: derivatives were nan, maps empty;
    and a range ended where a face went on in triangles that are not near each other as drawn.
    """
    told = []
    for number in (None, 1, 2):
        bodies = []
        for name, at in ((above, np.append(shift, 0.5)), (below, np.zeros(3))):
            corners, faces = surface_of(VOXELS[name][0])
            corners = corners / corners.max(axis=0) * (1.0, 1.0, 0.5) + at
            faces, kept = (faces, "exact") if number is None else (turned_diagonals(corners, faces, number), "surface")
            bodies.append(fo.Body.from_mesh(corners, faces, decomposition=kept, seed=at + np.array((0.45, 0.45, 0.25))))
        asked = Problem(
            *bodies, motion=Translation("x") >> Translation("z"), goal="at", contacts="all", requirement="A",
            tolerance=0.01,
        )  # fmt: skip
        found = fo.solve(asked)
        assert [joint.feature.kind for joint in asked.nominal_joints] == ["F1F2"]
        assert found.coordinates["TZ"] == pytest.approx(0.005, rel=1e-9)
        assert found.sensitivity.target == pytest.approx([0.25, 0.25], rel=1e-9)
        told.append((asked.nominal_joints[0].feature, found.amount))
        if ranged:
            kept = fo.coherent_range(asked, {"TZ": 1.0})
            told[-1] += (kept.low, kept.high)
    for number in (1, 2):
        assert told[number][0] == told[0][0]
        assert told[number][1:] == pytest.approx(told[0][1:], rel=1e-9)


@pytest.mark.slow
def test_the_proof_of_a_part_of_which_the_first_piece_is_far_away_was_refused() -> None:
    """A square tip in a round hollow, and a knob above it: the checker took edges of the knob for those of the tip."""
    knob = np.add(fo.Sphere(3.0, facets=16).parts[0].vertices, (0.0, 0.0, 20.0))
    tip = np.array([(x, y, z) for x in (-3.0, 3.0) for y in (-3.0, 3.0) for z in (-9.0, 18.0)])
    probe = fo.Body.from_parts([knob, tip], seed=(0.0, 0.0, 0.0), name="probe")
    socket = fo.cut(fo.Box((32, 32, 16), centre=(0, 0, -8)), fo.Sphere(10.0, facets=48), name="socket")
    motion = fo.Translation("z")
    problem = fo.Problem(probe, socket, tolerance=0.02, requirement="A", goal="touch", motion=motion)
    solution = fo.solve(problem, certify=True)
    assert problem.partial
    assert fo.verify(solution, proof=True).passed


@pytest.mark.slow
def test_a_best_pose_of_a_ball_in_a_socket_of_many_faces_was_an_internal_error(tmp_path: Path) -> None:
    """No flat faces touch, and round ones of a body that is looked at in part were taken to have rows all the same."""
    ball, hollow = fo.Sphere(10.0, facets=44, name="ball"), fo.Sphere(10.0, facets=48)
    fo.cut(fo.Box((32, 32, 16), centre=(0, 0, -8)), hollow).to_file(tmp_path / "socket.obj")
    socket = fo.Body.from_file(tmp_path / "socket.obj", unit="mm", decomposition="surface")
    problem = fo.Problem(ball, socket, tolerance=0.02, requirement="A", goal="touch", motion=fo.Translation("z"))
    assert problem.partial
    with pytest.raises(fo.InputError, match="none of flat faces"):
        fo.best_pose(problem)


@pytest.mark.parametrize("away", [0.5, 1.9, 7.0])
def test_surfaces_far_apart_were_not_found_to_touch_along_one_direction(away: float) -> None:
    """Parts that are nearest as drawn pass each other; those that meet are further off than a quarter of the size."""
    box = Manifold.cube((2.5, 1.0, 1.25)).translate((0.5, -0.25, 0.5))
    stairs = Manifold.cube((1.75, 2.0, 1.75)).translate((-1.5, 0.75 + away, 2.0))
    stairs += Manifold.cube((2.25, 2.0, 1.0)).translate((-0.25, 1.0 + away, 1.25))
    meshes = (own.to_mesh() for own in (box, stairs))
    parts = [fo.Body.from_mesh(own.vert_properties, own.tri_verts, decomposition="surface") for own in meshes]
    found = fo.solve(fo.Problem(*parts, target=(1, 1), goal="touch", motion=fo.Translation("y")))
    assert found.usable
    assert found.amount == pytest.approx(away + 0.25, rel=1e-6)
