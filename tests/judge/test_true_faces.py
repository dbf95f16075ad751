"""The judge's look at round faces."""

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.geometry.patches import true_faces
from fcdm_opt.judge.true_faces import _There


@pytest.mark.sampled(1)
@pytest.mark.parametrize("facets", [16, 24, 40])
def test_points_on_the_chords_of_a_bore_are_not_on_the_plane_that_it_opens_in(facets: int) -> None:
    """They are in the bore, by what a chord leaves its arc: a pin that touches the bore is there below the plane."""
    bore = fo.Cylinder(5.4, 14, base=(-21.1, 0.3, -7), facets=facets)
    plate = _There(true_faces(fo.cut(fo.Box((80, 40, 10)), bore)), 1.0, np.eye(4))
    top = next(k for k, own in enumerate(plate.surfaces.axis) if own[2] > 0.5 and not plate.is_round[k])
    _, start, end, *_ = plate._bent_edges(top)
    assert len(start) == facets
    chord = np.linspace(0.02, 0.98, 49)[:, None, None] * (end - start) + start
    for outside in (-1e-15, 0.0, 1e-15):  # rounding leaves them on either side
        feet = chord.reshape(-1, 3) + outside * (chord.reshape(-1, 3) - np.array([-21.1, 0.3, 5.0]))
        assert not plate.has(top, feet, 1e-10).any()
