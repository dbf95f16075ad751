"""Bodies as plain data, and back."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.problem.entries import BodyEntry, plain_body

PARTS = Path(__file__).parents[2] / "problems" / "round"


def area(body: fo.Body) -> float:
    one, two, three = np.moveaxis(body.face_triangles[0], 1, 0)
    return float(np.linalg.norm(np.cross(two - one, three - one), axis=1).sum() / 2.0)


def test_faces_were_drawn_with_facets_of_parts_that_go_on_where_these_are_cut() -> None:
    """Read back, a bore reached into the solid: `whatif` and studies moved a bush beside its housing."""
    body = fo.Body.from_file(PARTS / "housing.step", unit="mm")
    assert len(body.parts) > 1
    back = BodyEntry.model_validate(json.loads(json.dumps(plain_body(body)))).body("static", None)
    assert area(back) == pytest.approx(area(body), rel=1e-12)
    np.testing.assert_array_equal(back.face_triangles[1], body.face_triangles[1])


def test_separate_solids_were_joined_in_silence() -> None:
    box, beside, far = (fo.Box((1, 1, 1), centre=(x, 0, 0), name="box") for x in (0, 1, 3))
    for body, count in (
        (fo.joined(box, beside), 1), (fo.joined(box, far), 2), (fo.joined(box, far, beside), 2),
        (fo.cut(box, fo.Box((0.2, 2, 2))), 2), (fo.cut(box, fo.Box((0.2, 0.2, 0.2))), 1),
    ):  # fmt: skip
        told = [note for note in body.notes if "separate solids" in note]
        assert told == ([f"{count} separate solids, taken as one body"] if count > 1 else [])


def test_triangles_are_those_of_all_faces() -> None:
    entry = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "triangles": [[[1, 3, 2]]]}
    with pytest.raises(fo.InputError, match="triangles of each of 4 faces"):
        BodyEntry.model_validate(entry).body("movable", None)
