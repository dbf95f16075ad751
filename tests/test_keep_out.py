"""Keep-outs as the internal task carries them: further static bodies that the moved part must keep clear of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fcdm_opt.geometry.bodies import Body
from fcdm_opt.motion import Motion, Translation
from fcdm_opt.tolerance import models
from fcdm_opt.tolerance.problem import Problem
from fcdm_opt.tolerance.solution import Status
from fcdm_opt.tolerance.task import Answer, KeepOut, Task

X, Y = Translation("x"), Translation("y")


def box(low: tuple[float, float, float], high: tuple[float, float, float], name: str = "box") -> Body:
    corners = [[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)]
    return Body.convex(corners, seed="box", name=name)


CUBE = box((-1, -1, -1), (1, 1, 1))


def answered(motion: Motion, *keep_out: KeepOut, static: Body, goal: str = "clear") -> Answer:
    """The first stage that settles the task, as the solver goes through them."""
    task = replace(Task.of(Problem(CUBE, static, target=(1, 1), motion=motion, goal=goal)), keep_out=keep_out)
    stages = (models.satisfied, models.straight, models.one_parameter, models.nonlinear)
    return next(answer for stage in stages if (answer := stage(task)) is not None)


def test_a_body_in_the_way_of_the_shorter_way_out_sends_the_part_the_other_way():
    wall = box((0.5, -1, -1), (5, 1, 1))  # overlaps by 0.5 along x; free at x = -0.5
    post = box((-3, -1, -1), (-1.2, 1, 1), "post")  # but only 0.2 of room there
    free = answered(X >> Y, static=wall)
    assert free.q == pytest.approx([-0.5, 0], abs=1e-9)
    kept = answered(X >> Y, KeepOut(post, 1.0, 0.0), static=wall)
    # between wall and post there is no room for the cube: out along y by 2, either way
    assert kept.status is Status.SOLVED
    assert abs(kept.q[1]) == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("clearance", [0.0, 0.25])
def test_a_clearance_to_a_keep_out_is_kept(clearance):
    far = box((8, -1, -1), (10, 1, 1))
    near = box((1.1, -1, -1), (3, 1, 1), "near")
    answer = answered(X, KeepOut(near, 1.0, clearance), static=far)
    assert answer.status is (Status.ALREADY_SATISFIED if clearance == 0 else Status.SOLVED)
    assert answer.q == pytest.approx([-max(0.0, clearance - 0.1)], abs=1e-9)


def test_the_scale_of_a_keep_out_counts_about_its_own_seed():
    far = box((8, -1, -1), (10, 1, 1))
    near = box((1.5, -1, -1), (3.5, 1, 1), "near")  # seed at x = 2.5: its face is at 2.5 - scale
    for scale, shift in ((1.0, 0.0), (2.0, -0.5), (1.6, -0.1)):
        answer = answered(X, KeepOut(near, scale, 0.0), static=far)
        assert answer.q == pytest.approx([shift], abs=1e-9)


def test_touching_the_partner_beside_a_keep_out():
    partner = box((3, -1, -1), (5, 1, 1))
    bar = box((1.5, -4, -1), (2.0, 0.5, 1), "bar")  # in the way of the straight shift along x by 2
    straight = answered(X >> Y, static=partner, goal="touch")
    assert straight.q == pytest.approx([2, 0], abs=1e-9)
    around = answered(X >> Y, KeepOut(bar, 1.0, 0.0), static=partner, goal="touch")
    assert around.status is Status.SOLVED
    assert around.q == pytest.approx([2, 1.5], abs=1e-8)  # its lower side clears the bar's end at 0.5
    assert np.linalg.norm(around.q) == pytest.approx(2.5, abs=1e-8)
