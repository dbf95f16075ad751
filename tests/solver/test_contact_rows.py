"""The public CasADi functions of a problem: against the curve, the solver and closed forms."""

from __future__ import annotations

import re

import casadi
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from voxels import VOXELS, surface_of

import fcdm_opt as fo

TIP = [(0, 0, 0), (1, 1, 2), (1, -1, 2), (-1, 1, 2), (-1, -1, 2)]
SLAB = [(x, y, z) for x in (-3, 3) for y in (-3, 3) for z in (-1, 0)]
PROBE = fo.Body.convex(TIP, seed="box", name="probe")
TABLE = fo.Body.convex(SLAB, seed="box", name="table")
CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
SILENT = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
SHIFT = fo.Translation("x") >> fo.Translation("y") >> fo.Translation("z")


def asked(**changes) -> fo.Problem:
    given = {"target": (1.02, 0.98), "goal": "touch", "motion": fo.Free(), **changes}
    return fo.Problem(PROBE, TABLE, **given)


def hulls(seed: int) -> tuple[fo.Body, fo.Body]:
    rng = np.random.default_rng([seed, 14])
    one, two = rng.normal(size=(9, 3)), rng.normal(size=(8, 3)) + 4.0 * np.eye(3)[0]
    return fo.Body.convex(one), fo.Body.convex(two)


def test_functions_have_names_and_take_everything_as_input():
    rows = fo.contact_rows(asked())
    (contact,), (clearance,) = rows.contacts, rows.clearances
    assert rows.parameters == ("TX", "TY", "TZ", "RX", "RY", "RZ")
    assert rows.motion.function.name_in() == ["q", "seeds"]
    assert contact.function.name_in() == ["q", "seeds", "feature", "rho"]
    assert contact.function.name_out() == ["line", "normal", "gap"]
    assert clearance.function.name_out() == ["apart", "unit"]
    for row in (rows.motion, contact, clearance):
        left = set(row.function.name_in()) - set(row.numbers)
        assert left == ({"q", "plane"} if row is clearance else {"q"})


def test_a_row_of_a_cut_part_names_the_faces_that_meet():
    """A roof in a V-block of two convex parts, one of which has the bottom of the groove as a corner of its own."""
    roof = fo.Prism([(0, 0), (6, 6), (-6, 6)], 8.0, name="roof")
    block = fo.Prism([(0, 0), (10, 10), (10, -8), (-10, -8), (-10, 10)], 8.0, name="block")
    for goal in ("seat", "at"):
        given = {"motion": SHIFT, "goal": goal, "contacts": "all", "tolerance": 0.02, "requirement": "A"}
        rows = fo.contact_rows(fo.Problem(roof, block, **given))
        names = [row.name.split(", ") for row in rows.contacts]
        assert len(names) == 2
        for one, two in names:
            assert re.fullmatch(r"face \d \(facing [+-]x and -y\) of roof", one)
            assert re.fullmatch(r"face \d \(facing [+-]x and \+y\) of block", two)


def test_the_feature_of_faces_in_parallel_was_a_corner_far_aside_and_parts_apart_had_no_clearance():
    """A small block 3 above a large slab, over its middle and over its edge: a corner of the block that is over it."""
    for x in (0.0, 3.0):
        block = fo.Body.convex(0.5 * CUBE + (x, 0.0, 3.5), name="block")
        rows = fo.contact_rows(fo.Problem(block, TABLE, target=(1.0, 1.0), goal="touch", motion=SHIFT))
        kind, number, *names = rows.contacts[0].name.split(" ", 2)
        assert (kind, names) == ("corner", ["of block, top face of table"])
        assert np.abs(block.vertices[int(number) - 1, :2]).max() <= 3.0
        lines = [line for line in str(rows).splitlines() if line.startswith(("contacts", "clearances"))]
        assert all(" +3 " in line for line in lines)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", ["ball", "bar", "mesh"])
@pytest.mark.parametrize("assembled", [False, True])
def test_rows_of_round_parts_that_are_apart_were_those_of_their_facets(kind: str, assembled: bool) -> None:
    """A ball, and a bar, of radius 5 whose middle is 5.1 off a face that looks between the facets' corners."""
    part = fo.Sphere(5.0, name="part") if kind != "bar" else fo.Cylinder(5.0, 30.0, base=(0, 0, -15), name="part")
    if kind == "mesh":
        corners = part.face_triangles[0].reshape(-1, 3)
        points, rows = np.unique(corners, axis=0, return_inverse=True)
        part = fo.Body.from_mesh(points, rows.reshape(-1, 3), name="part").rounded()
    turn = Rotation.from_rotvec((0.0, 0.0, 0.21) if kind == "bar" else (0.3, 0.2, 0.0)).as_matrix()
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, turn @ ((7.1, 0.0, 0.0) if kind == "bar" else (0.0, 0.0, 7.1))
    size = (4, 20, 20) if kind == "bar" else (20, 20, 4)
    slab = fo.Box(size, name="slab").moved(pose)
    for goal, more in (("touch", {}), ("clear", {"clearance": 0.01})):
        if assembled:
            contact = {"parts": ("part", "slab"), "goal": goal, **more}
            asked = fo.Assembly({"part": part, "slab": slab}, [contact], motions={"part": SHIFT})
        else:
            asked = fo.Problem(part, slab, target=(1.0, 1.0), goal=goal, motion=SHIFT, **more)
        rows = fo.contact_rows(asked)
        assert min(float(row(q=rows.at)["gap"]) for row in rows.contacts) == pytest.approx(0.1, abs=1e-9)
        lifted = -0.03 * turn[:, 0 if kind == "bar" else 2]
        assert min(float(row(q=lifted)["gap"]) for row in rows.contacts) == pytest.approx(0.13, abs=1e-9)


def test_a_motion_given_by_names_of_parameters_was_a_bare_type_error():
    """The tip is at 0, the table's top too: lifted by .1 it is .1 above, whatever the shift along x."""
    named, given = (fo.contact_rows(asked(target=(1.0, 1.0), motion=SHIFT), at=at) for at in ({"TZ": 0.1}, [0, 0, 0.1]))
    assert named.at.tolist() == given.at.tolist() == [0.0, 0.0, 0.1]
    assert str(named) == str(given)
    for wrong, told in (
        ({"TQ": 0.1}, "at.TQ: no such parameter"),
        ({"TX": "a"}, "at.TX"),
        ([1.0], "at: not one value"),
    ):
        with pytest.raises(fo.InputError, match=told):
            fo.contact_rows(asked(motion=SHIFT), at=wrong)


def test_rows_of_one_kind_share_their_function():
    one, two = (fo.contact_rows(asked(target=(rho, 1.0))) for rho in (1.02, 1.03))
    assert one.contacts[0].function is two.contacts[0].function
    assert one.clearances[0].function is two.clearances[0].function


@pytest.mark.parametrize("seed", range(5))
def test_gap_and_pose_are_those_of_the_curve(seed):
    one, two = hulls(seed)
    problem = fo.Problem(one, two, target=(1.1, 0.9), goal="touch", motion=fo.Free())
    q = np.random.default_rng(seed).uniform(-0.3, 0.3, 6)
    rows = fo.contact_rows(problem, at=q)
    T = rows.motion(q=q)["transform"].full()
    np.testing.assert_allclose(T, problem.motion.transform(q, one.seed, two.seed), atol=1e-14)
    gap = float(rows.contacts[0](q=q)["gap"])
    assert gap == pytest.approx(fo.decision_curve(one, two, transform=T).gap((1.1, 0.9)), abs=1e-12)
    a, b, c = rows.contacts[0](q=q)["line"].full().ravel()
    normal = rows.contacts[0](q=q)["normal"].full()
    assert (c - 1.1 * a - 0.9 * b) / np.linalg.norm(normal) == pytest.approx(gap, abs=1e-12)
    assert gap == pytest.approx(
        float(rows.clearances[0](q=q, plane=rows.clearances[0].start)["apart"][9:].full().min())
    )


@pytest.mark.parametrize("case", ["A", "B"])
def test_the_tracked_switching_point_is_that_of_the_solution(case):
    problem = next(own for own in fo.load_problems("problems/example1.toml") if own.name == case)
    rows, solution = fo.contact_rows(problem), fo.solve(problem, effort="quick")
    found = rows.switching_point(q=list(solution.parameters.values()))
    np.testing.assert_allclose(found["rho"].full().ravel(), solution.rho, rtol=1e-12)
    for contact in rows.contacts:
        assert abs(float(contact(q=list(solution.parameters.values()), rho=solution.rho)["gap"])) < 1e-12


@pytest.mark.parametrize("target", [(1.02, 0.98), (1.02, 1.01)], ids=["apart", "overlapping"])
def test_an_opti_program_finds_the_amount_of_the_solver(target):
    problem = asked(target=target)
    rows, opti = fo.contact_rows(problem), casadi.Opti()
    q = opti.variable(6)
    opti.minimize(casadi.sumsqr(rows.weights * q))
    opti.subject_to(rows.contacts[0](q=q)["gap"] == 0)
    opti.solver("ipopt", SILENT)
    amount = float(np.linalg.norm(rows.weights * opti.solve().value(q)))
    assert amount == pytest.approx(fo.solve(problem, effort="quick").amount, rel=1e-6)


def test_a_plane_finds_the_distance_of_two_corners():
    """Cubes whose nearest corners are 1 apart each way: rows of facets alone would say 1."""
    one, two = fo.Body.convex(CUBE), fo.Body.convex(CUBE + 3.0)
    problem = fo.Problem(one, two, target=(1.0, 1.0), goal="clear", clearance=2.0, motion=SHIFT)
    rows, opti = fo.contact_rows(problem), casadi.Opti()
    q, plane = opti.variable(3), opti.variable(4)
    kept = rows.clearances[0](q=q, plane=plane)
    opti.minimize(casadi.sumsqr(q))
    opti.subject_to(kept["apart"] >= 0)
    opti.subject_to(kept["unit"] == 0)
    opti.set_initial(plane, rows.clearances[0].start)
    opti.solver("ipopt", SILENT)
    assert np.linalg.norm(opti.solve().value(q)) == pytest.approx(2.0 - np.sqrt(3.0), abs=1e-6)


def test_sizes_may_be_variables():
    """How large may the probe be made above a table that stays: its tip is 1 below its seed."""
    rows, opti = fo.contact_rows(asked(motion=fo.Translation("z"))), casadi.Opti()
    rho = opti.variable()
    opti.minimize(-rho)
    opti.subject_to(rows.contacts[0](q=0.25, rho=casadi.vertcat(rho, 1.0))["gap"] >= 0)
    opti.solver("ipopt", SILENT)
    assert opti.solve().value(rho) == pytest.approx(1.25, abs=1e-6)


def test_keep_outs_are_among_the_clearances():
    post = fo.KeepOut(fo.Body.convex(0.2 * CUBE + (0.0, 4.0, 1.0), name="post"), scale=1.5, clearance=0.1)
    rows = fo.contact_rows(asked(keep_out=(post,)))
    assert [row.name for row in rows.clearances] == ["probe and table", "keep-out 'post'"]
    own = rows.clearances[1]
    assert own.numbers["need"] == 0.1
    apart = own(q=np.zeros(6), plane=own.start)
    # a side of the probe, 2 y - z = 0.02 as made, and the post's nearest edge, y = 4 - 0.3 and z = 1 + 0.3
    assert float(apart["apart"][5:].full().min()) == pytest.approx((2 * 3.7 - 1.3 - 0.02) / 5**0.5 - 0.1, abs=1e-12)
    assert float(apart["unit"]) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(("up", "state"), [(0.0, "inside"), (6.51, "near"), (9.0, "far")])
def test_rows_keep_parts_out_of_the_solid_of_a_surface(up, state):
    """A cube of side 1 about the origin, raised; a block with a notch is from -6 to 6."""
    corners, faces = surface_of(VOXELS["L"][0])
    block = fo.Body.from_mesh(6.0 * (corners - (1, 1, 0.5)) * (1, 1, 2) - (3, 3, 0), faces, decomposition="surface")
    cube = fo.Body.convex(0.5 * CUBE - (4.0, 4.0, 0.0), name="cube")
    away = fo.Body.convex(CUBE + np.array((0.0, 0.0, 30.0)))
    problem = fo.Problem(
        cube, away, target=(1.0, 1.0), goal="clear", motion=SHIFT, keep_out=[fo.KeepOut(block, name="block")]
    )
    rows = fo.contact_rows(problem, at=(0.0, 0.0, up))
    own = [row for row in rows.clearances if "block" in row.name]
    apart = [float(np.min(row(q=(0.0, 0.0, up), plane=row.start)["apart"].full())) for row in own]
    assert {"inside": min(apart, default=1) < -0.5, "near": 0 <= min(apart, default=-1) < 0.02, "far": not own}[state]


def test_printed_rows_were_thousands_of_letters():
    """The tip and the table's top by hand: 0.01 too deep, and as much higher as the probe is lifted."""
    text = str(fo.contact_rows(asked(motion=fo.Translation("z"))))
    row = next(line for line in text.splitlines() if line.startswith("contacts"))
    assert "corner 1 of probe" in row
    assert row.split("least gap = 0")[1].split() == ["-0.01", "TZ", "+1"]
    teeth = [0.4 * CUBE + (k, y, -0.4) for y in (0.0, 9.0) for k in range(8)]
    static = fo.Body.from_parts(teeth, name="comb")
    many = fo.contact_rows(fo.Problem(PROBE, static, target=(1, 1), goal="touch", motion=SHIFT))
    lines = str(many).splitlines()
    listed = sum(line.startswith(("contact", "clearance")) for line in lines)
    assert listed <= 20
    assert listed + int(lines[-1].partition(" clearances of parts that are")[0]) == 32
    assert max(map(len, lines)) <= 200


def test_several_features_are_to_be_named():
    with pytest.raises(fo.InputError, match="expected a Problem"):
        fo.contact_rows(PROBE)
    with pytest.raises(fo.InputError, match="not one value for each motion parameter"):
        fo.contact_rows(asked(), at=[0.0])
    rows = fo.contact_rows(asked())
    with pytest.raises(fo.InputError, match=r"another shape than motion takes; found \(2,\); allowed: 6 numbers"):
        rows.motion(q=[0, 0])
    assert rows.motion(q=np.zeros((6, 3)))["transform"].shape == (4, 12)  # several side by side
    with pytest.raises(fo.InputError, match="no such input"):
        rows.contacts[0](q=np.zeros(6), plane=np.zeros(4))
    with pytest.raises(fo.InputError, match="missing"):
        rows.clearances[0](q=np.zeros(6))


WALLS = ((-9, 0), (-9, 9)), ((0, 9), (-9, 0))
CORNER = fo.Body.from_parts([[(x, y, z) for x in xs for y in ys for z in (0, 1)] for xs, ys in WALLS], seed=(-1, -1, 0))


@pytest.mark.parametrize(
    ("more", "count", "aligned"),
    [
        ({}, 2, 0),
        ({"motion": fo.Translation("x") >> fo.Translation("y") >> fo.Rotation("z")}, 2, 1),
        ({"goal": "fit", "motion": fo.Translation((1.0, 2.0, 0.0))}, 2, 0),
    ],
)
def test_a_program_made_of_the_rows_of_several_contacts_finds_the_motion_of_the_solver(more, count, aligned):
    """They were refused. A cube in a corner: .015 along both walls, and sqrt(5) times that along (1, 2)."""
    shifts = {"motion": fo.Translation("x") >> fo.Translation("y"), "goal": "at"}
    given = {"tolerance": 0.01, "requirement": "A", "contacts": "all", **shifts, **more}
    problem = fo.Problem(fo.Body.convex([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]), CORNER, **given)
    rows = fo.contact_rows(problem)
    assert (len(rows.contacts), len(rows.alignments)) == (count, aligned)
    opti = casadi.Opti()
    q = opti.variable(len(rows.parameters))
    gaps = casadi.vertcat(*(row(q=q)["gap"] for row in rows.contacts))
    for row in rows.alignments:
        opti.subject_to(row(q=q)["aligned"] == 0)
    if problem.goal == "fit":
        t = opti.variable()
        opti.subject_to(opti.bounded(0, gaps, t))
        opti.minimize(t)
    else:
        opti.subject_to(gaps == 0)
        opti.minimize(casadi.sumsqr(casadi.DM(rows.weights) * q))
    opti.solver("ipopt", SILENT | {"ipopt.tol": 1e-12})
    found = np.ravel(opti.solve().value(q))
    expected = [0.015 * np.sqrt(5.0)] if problem.goal == "fit" else [0.015, 0.015, *[0.0] * aligned]
    np.testing.assert_allclose(found, expected, atol=1e-7)
    np.testing.assert_allclose(list(fo.solve(problem).parameters.values()), expected, atol=1e-9)


def test_clearances_of_parts_far_from_each_other_are_counted() -> None:
    """A block on a slab, with posts 2 or more beside it, and one 0.4 beside it."""
    block, slab = fo.Box((4, 4, 4), centre=(0, 0, 2), name="block"), fo.Box((40, 40, 2), centre=(0, 0, -1), name="slab")
    posts = [fo.Box((1, 1, 4), centre=(2.9 + 3 * k, 0, 2), name=f"post {k}") for k in range(30)]
    asked = {"target": (1.0, 1.0), "goal": "touch", "motion": fo.Translation("z")}
    text = str(fo.contact_rows(fo.Problem(block, slab, keep_out=posts, **asked)))
    assert "block and slab" in text
    assert "post 0" in text
    assert "post 1 " not in text
    assert "post 29" not in text
    assert "29 clearances of parts that are 3.4 or more apart" in text
