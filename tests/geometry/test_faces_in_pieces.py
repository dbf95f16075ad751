"""Round faces that CAD systems write in several pieces: the halves of a bore, a cone, a ball or a fillet are one."""

from __future__ import annotations

import math
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from step_bodies import PLATE, SIDES, read, run
from strategies import random_rotation

import fcdm_opt as fo
from fcdm_opt.geometry.facet_errors import round_surfaces
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.show.stacks import listed_faces
from fcdm_opt_benchmarks.step_files import polyhedron, revolved

PI = math.pi
FLANK = PI * (6.0 + 3.0) * math.hypot(3.0, 3.0)  # of a frustum of radii 6 and 3, 3 high
QUARTER = 2.0 * PI * (PI / 2.0 * 6.0 - 1.0)  # of the ring of radius 1 about (6, 5), inner quarter: Pappus
PROFILES: dict[str, tuple[list[tuple[float, ...]], dict[str, float]]] = {
    "pin": ([(0, 0), (5, 0), (5, 20), (0, 20)], {"cylinder radius 5": 2 * PI * 5 * 20}),
    "bush": (
        [(6, 0), (10, 0), (10, 20), (6, 20)],
        {"bore radius 6": 2 * PI * 6 * 20, "cylinder radius 10": 2 * PI * 10 * 20},
    ),
    "cone": ([(0, 0), (8, 0), (4, 20), (0, 20)], {"cone radius 4 to 8": PI * 12 * math.hypot(4, 20)}),
    "countersink": (
        [(3, 0), (12, 0), (12, 10), (6, 10), (3, 7)],
        {"bore radius 3": 2 * PI * 3 * 7, "countersink radius 3 to 6": FLANK, "cylinder radius 12": 2 * PI * 12 * 10},
    ),
    "ball": ([(0, -5, 0, 0), (0, 5)], {"sphere radius 5": 4 * PI * 25}),
    "fillet": (
        [(0, 0), (10, 0), (10, 4), (6, 4, 6, 5), (5, 5), (5, 20), (0, 20)],
        {"cylinder radius 10": 2 * PI * 10 * 4, "cylinder radius 5": 2 * PI * 5 * 15, "": QUARTER},
    ),
    # two journals beside a collar may have two diameters
    "collar": (
        [(0, 0), (5, 0), (5, 4), (8, 4), (8, 10), (5, 10), (5, 15), (0, 15)],
        {
            "cylinder radius 5 no. 1": 2 * PI * 5 * 4,
            "cylinder radius 5 no. 2": 2 * PI * 5 * 5,
            "cylinder radius 8": 2 * PI * 8 * 6,
        },
    ),
    "spigot": (
        [(0, 6), (5, 6), (5, 0), (10, 0), (10, 10), (5, 10), (5, 16), (0, 16)],
        {"bore radius 5": 2 * PI * 5 * 6, "cylinder radius 5": 2 * PI * 5 * 6, "cylinder radius 10": 2 * PI * 10 * 10},
    ),
}


def areas_by_name(body: fo.Body) -> dict[str, float]:
    """Areas of round faces by their names; tori have none."""
    rows, found = {row for _, own in round_surfaces(body) for row in own}, defaultdict[str, float](float)
    for k, own in enumerate(listed_faces(body)):
        if k in rows:
            found["" if own.name.startswith("face ") else own.name] += own.area or math.nan
    return dict(found)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("split", [False, True])
@pytest.mark.parametrize("name", PROFILES)
def test_pieces_of_a_round_face_are_one_and_have_its_area(tmp_path: Path, name: str, split: bool) -> None:
    profile, areas = PROFILES[name]
    for axes in (np.eye(3), random_rotation(np.random.default_rng(3))):
        body = read(tmp_path, revolved(profile, axes, split=split))
        assert len(round_surfaces(body)) == len(areas)
        assert areas_by_name(body) == pytest.approx(areas, rel=2e-7 if name in ("ball", "fillet") else 1e-9)
        faces = true_faces(body)
        assert faces.is_round.sum() == len(areas)
        assert (faces.every_pair_of_patches[:, 0] != faces.every_pair_of_patches[:, 1]).all()


def test_plane_faces_end_at_true_rims(tmp_path: Path) -> None:
    body = read(tmp_path, polyhedron(PLATE, SIDES, "mm", bore=6.0, split=True))
    found = {own.name: own.area for own in listed_faces(body)}
    assert found["top"] == found["bottom"] == pytest.approx(1600.0 - 36.0 * PI, rel=1e-9)
    assert found["left"] == pytest.approx(400.0, rel=1e-12)


def plate_and_pin(folder: Path, split: bool, bore: float, radius: float) -> tuple[fo.Body, fo.Body]:
    plate = read(folder, polyhedron(PLATE, SIDES, "mm", bore=bore, split=split), name="plate")
    pin = [(0, -5), (radius, -5), (radius, 15), (0, 15)]
    return plate, read(folder, revolved(pin, np.eye(3), split=split), name="pin")


SIZES: list[Any] = [
    fo.Size("bore", "movable", faces=["bore radius 6"], each=-0.5, tolerance=0.02),
    fo.Size("pin", "static", faces=["cylinder radius 5.9"], each=0.5, tolerance=0.02),
]


@pytest.mark.sampled(1)
@pytest.mark.parametrize("goal", ["touch", "clear"])
def test_answers_are_those_of_the_part_in_one_piece(tmp_path: Path, goal: Any) -> None:
    """To touch, a plate moves by the play, (bore - pin) / 2; from .2 aside back to it."""
    x, y = fo.Translation("x"), fo.Translation("y")
    aside, play = np.eye(4), (12.02 - 11.79) / 2
    aside[0, 3] = 0.3 if goal == "clear" else 0.0
    found = []
    for split in (False, True):
        plate, pin = plate_and_pin(tmp_path, split, 6.0, 5.9)
        made = {"bore": 0.02, "pin": -0.01}
        asked = {"sizes": SIZES, "made": made, "goal": goal, "motion": x if goal == "touch" else x >> y}
        found.append(fo.solve(fo.Problem(plate.moved(aside), pin, **asked)))
    one, two = found
    assert one.verified
    assert two.verified
    assert one.amount == pytest.approx(play if goal == "touch" else 0.3 - play, rel=1e-6)
    assert two.amount == pytest.approx(one.amount, rel=1e-9)
    assert two.parameters == pytest.approx(one.parameters, rel=1e-9, abs=1e-9)


def test_init_proposes_one_diameter_of_a_bore_in_halves(tmp_path: Path) -> None:
    (tmp_path / "plate.step").write_text(polyhedron(PLATE, SIDES, "mm", bore=6.0, split=True))
    pin = [(0.0, -5.0), (5.9, -5.0), (5.9, 15.0), (0.0, 15.0)]
    (tmp_path / "pin.step").write_text(revolved(pin, np.eye(3), split=True))
    file = tmp_path / "plate-pin.toml"
    ended = run("init", tmp_path / "plate.step", tmp_path / "pin.step", "--unit", "mm", "--out", file)
    assert file.exists(), ended.output
    text = file.read_text()
    assert text.count('faces = ["bore radius 6"]') == text.count('faces = ["cylinder radius 5.9"]') == 1
    assert "no. 1" not in text
