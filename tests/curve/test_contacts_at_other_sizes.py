"""Contacts as drawn, on parts whose sizes leave the touching faces what they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from manifold3d import Manifold

import fcdm_opt as fo

FACETS = 24


def in_single_precision(solid: Manifold, name: str) -> fo.Body:
    """A body as a file in single precision has it, with its round faces recognised."""
    mesh = solid.to_mesh()
    points = np.asarray(mesh.vert_properties)[:, :3].astype(np.float32).astype(float)
    return fo.Body.from_mesh(points, np.asarray(mesh.tri_verts), decomposition="exact", name=name, unit="mm").rounded()


@pytest.fixture(scope="module")
def shaft() -> fo.Body:
    collar = Manifold.cylinder(15.0, 15.0, 15.0, 48).translate([0, 0, -15])
    return in_single_precision(Manifold.cylinder(35.0, 10.0, 10.0, 48).translate([0, 0, -5]) + collar, "shaft")


@pytest.fixture(scope="module")
def bush() -> fo.Body:
    bore = Manifold.cylinder(22.0, 10.0, 10.0, 48).translate([0, 0, -1])
    return in_single_precision(Manifold.cylinder(20.0, 16.0, 16.0, 48) - bore, "bush")


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("role", "faces"),
    [("movable", ["cylinder radius 15"]), ("movable", {"through": (0, 0, 30)}), ("static", ["top"])],
    ids=["collar", "far end", "end of the bush"],
)
def test_a_shaft_whose_collar_or_end_changes_lost_all_contacts_in_its_bore(
    shaft: fo.Body, bush: fo.Body, role: str, faces: object
) -> None:
    """The bore and the collar's face stay where they are: so do all contacts, to rounding."""
    size = fo.Size("c", role, faces=faces, tolerance=0.05)
    problem = fo.Problem(
        shaft, bush, motion=fo.Translation("z"), sizes=[size], made={"c": 0.01}, goal="seat", contacts="all"
    )
    pose = np.r_[np.eye(3).ravel(), problem.static.seed - problem.movable.seed]
    gaps = [joint.gap(problem.movable, problem.static, pose, np.ones(2)) for joint in problem.nominal_joints]
    assert len(gaps) == 49
    assert np.abs(gaps).max() < 1e-12
    solution = fo.solve(problem)
    assert solution.usable, solution
    assert solution.amount == pytest.approx(0.0, abs=1e-12)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("goal", ["seat", "at"])
def test_the_collar_of_a_shaft_follows_its_bush_with_sizes_of_either(shaft: fo.Body, bush: fo.Body, goal: str) -> None:
    """A bore that gets wider leaves the collar's face on the bush's end."""
    size = fo.Size("bore", "static", faces=["bore radius 10"], each=-0.5, tolerance=0.05)
    drawn = fo.Problem(shaft, bush, motion=fo.Translation("z"), target=(1, 1), goal="seat", contacts="all")
    label = next(str(joint.feature) for joint in drawn.nominal_joints if abs(joint.normals[0] @ (0, 0, 1)) > 0.5)
    solution = fo.solve(drawn.changed(target=None, sizes=[size], made={"bore": 0.01}, goal=goal, contacts=[label]))
    assert solution.usable, solution
    assert solution.amount == pytest.approx(0.0, abs=1e-12)


def test_balls_of_a_kinematic_coupling_were_refused_at_another_diameter() -> None:
    """Three balls in V grooves of 90 deg, each d larger in radius: the plate rises by d sqrt(2)."""
    radius, far = 5.0, 30.0
    apex, turned = -radius * math.sqrt(2.0), np.eye(3)
    wedges, balls = [], []
    for k in range(3):
        angle = 2.0 * math.pi * k / 3.0
        turned[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
        for side in (-1, 1):
            outline = [(10, apex - 4), (0, apex - 4), (0, apex), (10, apex + 10)]
            points = [(x, side * y, z) for x in (far - 8, far + 8) for y, z in outline]
            wedges.append(np.array(points) @ turned.T)
        balls.append(fo.Sphere(radius, centre=tuple(np.round(turned @ (far, 0, 0), 12)), facets=FACETS))
    base = fo.Body.from_parts(wedges, name="base", seed=(0, 0, 0), unit="mm")
    top = fo.joined(fo.Cylinder(40, 6, base=(0, 0, 3), facets=FACETS), *balls, name="top")
    sizes = [fo.Size(f"b{k}", "movable", faces=[f"sphere radius 5 no. {k}"], tolerance=0.05) for k in (1, 2, 3)]
    problem = fo.Problem(
        top, base, motion=fo.Free(), sizes=sizes, made={own.name: 0.05 for own in sizes}, goal="at", contacts="all",
        unit="mm",
    )  # fmt: skip
    solution = fo.solve(problem)
    assert solution.usable, solution
    assert solution.parameters["TZ"] == pytest.approx(0.05 * math.sqrt(2.0), abs=1e-9)


def test_a_contact_that_is_gone_is_told_with_the_sizes_at_which_it_is_there() -> None:
    """Corner on corner: an edge of the one no longer crosses that of the other where both are parallel."""
    up = fo.Body.convex([(0, 0, 0), (2, 0, -2), (-1, 1.7, -2), (-1, -1.7, -2)], name="up", seed=(0, 0, -1.5))
    down = fo.Body.convex([(0, 0, 0), (-2, 0.3, 2), (1.2, 1.7, 2), (1, -1.7, 2)], name="down", seed=(0, 0, 1.5))
    width = fo.Size("w", "movable", scale="x", tolerance=0.9)

    def problem(made: float) -> fo.Problem:
        return fo.Problem(
            down, up, motion=fo.Translation("z"), sizes=[width], made={"w": made}, goal="at", contacts="all"
        )

    with pytest.raises(fo.InputError, match=r"edge between face \d and face \d, is not there any more") as refused:
        problem(0.5)
    assert refused.value.found == "w = 0.5"
    share = float(refused.value.allowed.split("deviations of ")[1].split(" %")[0]) / 100.0
    problem(0.5 * share * 0.999)
    with pytest.raises(fo.InputError, match="any more"):
        problem(0.5 * (share + 0.02))
