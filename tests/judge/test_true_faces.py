"""The judge's look at round faces."""

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.judge.face_kernels import is_on_face
from fcdm_opt.judge.true_faces import _There


@pytest.mark.sampled(1)
@pytest.mark.parametrize("facets", [16, 24, 40])
def test_points_on_the_chords_of_a_bore_are_not_on_the_plane_that_it_opens_in(facets: int) -> None:
    """They are in the bore, by what a chord leaves its arc: a pin that touches the bore is there below the plane."""
    bore = fo.Cylinder(5.4, 14, base=(-21.1, 0.3, -7), facets=facets)
    plate = _There(true_faces(fo.cut(fo.Box((80, 40, 10)), bore)), 1.0, np.eye(4))
    top = next(k for k, own in enumerate(plate.surfaces.axis) if own[2] > 0.5 and not plate.is_round[k])
    begin, end = plate.bent_begin[top : top + 2]
    start, end = plate.bent_chords[begin:end].transpose(1, 0, 2)
    assert len(start) == facets
    chord = np.linspace(0.02, 0.98, 49)[:, None, None] * (end - start) + start
    for outside in (-1e-15, 0.0, 1e-15):  # rounding leaves them on either side
        feet = chord.reshape(-1, 3) + outside * (chord.reshape(-1, 3) - np.array([-21.1, 0.3, 5.0]))
        assert not any(is_on_face(plate.packed, top, tuple(foot), False, 1e-10) for foot in feet.tolist())


def bosses(apart: float, **more) -> fo.Problem:
    """Two plates that lie on each other, each with a boss, whose rounds are so far apart beside them."""
    along = np.array([np.cos(np.pi / 12), np.sin(np.pi / 12), 0.0])  # to the middles of facets, .34 and .17 within
    low = fo.joined(fo.Box((40, 60, 10), centre=(-10, 0, -5)), fo.Cylinder(10.0, 10.0, facets=12), name="low")
    at = (15.0 + apart) * along
    boss = fo.Cylinder(5.0, 20.0, base=tuple(at), facets=12)
    high = fo.joined(fo.Box((40, 60, 5), centre=(0, 0, 17.5)), boss, name="high")
    high = fo.joined(high, fo.Box((4, 60, 18), centre=(-18, 0, 9)), name="high")  # stands on the plate
    return fo.Problem(high, low, **{"target": (1.0, 1.0), "motion": fo.Translation("z"), "goal": "seat", **more})


@pytest.mark.sampled(1)
@pytest.mark.parametrize("goal", ["seat", "at"])
def test_true_faces_that_overlap_passed_where_an_answer_was_of_the_mesh(goal: str) -> None:
    """What tracks one contact of plane faces is solved for facets: of the bosses beside it these fall short."""
    refused = fo.solve(bosses(-0.01, goal=goal))
    assert refused.problem.exact_at is None
    assert refused.status is fo.Status.NOT_VERIFIED
    failed = {check.name: check.value for check in refused.certificate.failed}
    assert failed == {"true faces": pytest.approx(-0.01, abs=1e-9)}
    assert "true faces, which facets stand for, overlap by 0.01" in str(refused)
    assert fo.solve(bosses(0.01, goal=goal)).usable


@pytest.mark.parametrize(("apart", "fits"), [(-0.01, False), (0.01, True)])
def test_parts_of_an_assembly_without_a_contact_overlapped_on_their_true_faces(apart: float, fits: bool) -> None:
    problem, cap = bosses(apart), fo.Box((60, 60, 4), centre=(0, 0, 23), name="cap")
    parts = {"low": problem.static, "cap": cap, "high": problem.movable}
    touch = [{"parts": ("high", "cap"), "goal": "touch"}]
    found = fo.solve(fo.Assembly(parts, touch, motions={"high": fo.Translation("z")}))
    assert found.amount == pytest.approx(1.0)
    assert found.usable is fits
