"""Compensation tables: located against exact arithmetic, interpolation against the functions it is exact for, files."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from size_tables import BOX, scattered, squares, table

from fcdm_opt.design.compensation.table import Table
from fcdm_opt.errors import InputError

QUADRATICS = (
    lambda x, y: 3.0 * (x - 1.0) ** 2 - (x - 1.0) * (y - 1.0) + 0.5 * y,
    lambda x, y: (y - 1.0) ** 2 - x,
    lambda x, y: 2.0 + 0.0 * x,
)


def random_pairs(count, seed, box=BOX):
    (a, b), (c, d) = box
    return np.random.default_rng(seed).uniform((a, c), (b, d), (count, 2)).T


def graded(levels):
    """Return triangles that halve towards the left side, neighbours of half the size meeting edges at their middle."""
    (a, b), (c, d) = BOX
    found = []
    for level in range(levels):
        left, right = a + (b - a) / 2 ** (level + 1), a + (b - a) / 2**level
        if level == levels - 1:
            left = a
        edges = np.linspace(c, d, 2 ** min(level, 5) + 1)
        for low, high in pairwise(edges):
            found += [[(left, low), (right, low), (right, high)], [(left, low), (right, high), (left, high)]]
    return np.array(found)


def first_that_holds(corners, x, y):
    """Return the first triangle that a point is in, its border included, in rational arithmetic."""
    p = (Fraction(x), Fraction(y))
    for t, triangle in enumerate(corners.tolist()):
        exact = [(Fraction(u), Fraction(v)) for u, v in triangle]
        turns = [
            (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
            for a, b in zip(exact, exact[1:] + exact[:1], strict=True)
        ]
        if min(turns) >= 0 or max(turns) <= 0:
            return t
    return -1


@pytest.mark.slow
@pytest.mark.parametrize(
    "corners",
    [squares(1), squares(7), scattered(0, 1), scattered(300, 2), graded(9)],
    ids=["two", "squares", "scattered two", "scattered", "graded"],
)
def test_quadratics_are_reproduced_and_points_located_as_in_exact_arithmetic(corners):
    own = table(corners, *QUADRATICS, errors=(0.25, 0.5))
    x, y = random_pairs(4000, 3)
    found = own.at(x, y)
    for k, function in enumerate(QUADRATICS):
        value = found.amount if k == 0 else found.parameters[:, k - 1]
        np.testing.assert_allclose(value, function(x, y), rtol=1e-14, atol=1e-14)
    assert (found.error == 0.25).all()
    assert (found.displacement_error == 0.5).all()
    exact = [first_that_holds(corners, *pair) for pair in zip(x[:60], y[:60], strict=True)]
    assert found.region[:60].tolist() == exact
    # all of them, in floats: the point is in the triangle that was found
    triangle = corners[found.region]
    edges = np.roll(triangle, -1, axis=1) - triangle
    way = np.stack([x, y], axis=-1)[:, None] - triangle
    turns = edges[..., 0] * way[..., 1] - edges[..., 1] * way[..., 0]
    assert ((turns >= -1e-16).all(axis=1) | (turns <= 1e-16).all(axis=1)).all()


def test_pairs_on_shared_edges_and_corners_belong_to_the_first_triangle():
    order = np.random.default_rng(4).permutation(32)
    corners = squares(4)[order]
    own = table(corners, QUADRATICS[0])
    x, y = (grid.ravel() for grid in np.meshgrid(*(np.linspace(low, high, 17) for low, high in BOX), indexing="ij"))
    truth = [first_that_holds(corners, *pair) for pair in zip(x, y, strict=True)]
    assert own.at(x, y).region.tolist() == truth
    shuffled = np.random.default_rng(5).permutation(len(x))
    assert own.at(x[shuffled], y[shuffled]).region.tolist() == np.array(truth)[shuffled].tolist()


def test_values_at_the_nodes_are_those_of_the_table():
    drawn = table(scattered(60, 6), *QUADRATICS)
    values = np.random.default_rng(6).random(drawn.values.shape)  # other ones in every triangle
    own = Table(corners=drawn.corners, values=values, errors=drawn.errors, regions=drawn.regions, names=drawn.names)
    inside = own.corners.mean(axis=1)
    for node in range(6):
        pairs = own.corners[:, node] if node < 3 else own.corners[:, [node - 3, (node - 2) % 3]].mean(axis=1)
        found = own.at(*(pairs + 1e-9 * (inside - pairs)).T)  # off the edges that others come first at
        assert found.region.tolist() == list(range(len(own)))
        np.testing.assert_allclose(found.amount, values[:, node, 0], atol=1e-7)
        np.testing.assert_allclose(found.parameters, values[:, node, 1:], atol=1e-7)


def test_outside_is_nan_and_within_rounding_of_the_rim_is_inside():
    own = table(squares(3), *QUADRATICS)
    (a, b), (c, d) = BOX
    assert own.box == BOX
    up, down = np.nextafter(b, 2.0), np.nextafter(a, 0.0)
    rim = own.at([a, b, down, up, b, b], [c, d, d, c, np.nextafter(d, 2.0), np.nextafter(c, 0.0)])
    assert (rim.region >= 0).all()
    np.testing.assert_allclose(
        rim.amount, [QUADRATICS[0](x, y) for x, y in [(a, c), (b, d), (a, d), (b, c), (b, d), (b, c)]]
    )
    beyond = own.at(
        [a - 1e-12, b + 1e-12, 1.0, 1.0, np.nan, 1.0, np.inf], [1.0, 1.0, c - 1e-12, d + 1e-12, 1.0, np.nan, 1.0]
    )
    assert (beyond.region == -1).all()
    for array in (beyond.amount, beyond.parameters, beyond.error, beyond.displacement_error):
        assert np.isnan(array).all()


def test_shapes_broadcast_and_one_point_answers_as_many():
    own = table(squares(3), *QUADRATICS)
    x, y = random_pairs(12, 7)
    whole = own.at(x[:4, None], y[None, :3])
    assert whole.parameters.shape == (4, 3, 2)
    assert whole.amount.shape == whole.error.shape == whole.displacement_error.shape == whole.region.shape == (4, 3)
    for i, j in np.ndindex(4, 3):
        one = own.at(float(x[i]), y[j])
        assert one.amount.shape == ()
        assert one.amount == whole.amount[i, j]
        np.testing.assert_array_equal(one.parameters, whole.parameters[i, j])
    assert own.at([], []).parameters.shape == (0, 2)
    assert own.at(x[::2], y[::2]).amount.tolist() == own.at(x, y).amount[::2].tolist()


@pytest.mark.parametrize(
    "sizes",
    [("a", 1.0), ("1.0", 1.0), (1.0, 1j), (10**400, 1.0), ([1.0, 1.0], [1.0, 1.0, 1.0]), ([[1.0], []], 1.0), (1.0, {})],
)
def test_what_is_no_size_pair_is_refused(sizes):
    with pytest.raises(InputError, match="not 2 arrays of sizes"):
        table(squares(1), *QUADRATICS).at(*sizes)


def test_where_a_node_has_no_motion_there_is_none_nearby():
    full = table(squares(2), *QUADRATICS)
    values = full.values.copy()
    values[3] = np.nan
    own = Table(corners=full.corners, values=values, errors=full.errors, regions=full.regions, names=full.names)
    x, y = random_pairs(500, 8)
    found = own.at(x, y)
    assert (np.isnan(found.amount) == (found.region == 3)).all()
    assert 10 < np.isnan(found.amount).sum() < 120
    np.testing.assert_array_equal(found.amount[found.region != 3], full.at(x, y).amount[found.region != 3])


def test_plain_data_and_csv_keep_every_bit(tmp_path):
    random = np.random.default_rng(9)
    corners = scattered(40, 9, ((0.98, 1.02), (0.3, 0.7)))
    count = len(corners)
    values = random.standard_normal((count, 6, 3)) * 10.0 ** random.integers(-300, 40, (count, 6, 3))
    values[2], values[3, 0, 0], values[4, 0, 0], values[5, 0, 0] = np.nan, 0.0, -0.0, 5e-324
    errors, regions = random.random((count, 2)), random.integers(0, 9, count)
    errors[2] = np.nan
    own = Table(corners=corners, values=values, errors=errors, regions=regions, names=("TX", 'a, "b"'))
    back = Table.from_dict(json.loads(json.dumps(own.to_dict(), allow_nan=False)))
    assert back.names == own.names
    for key in ("corners", "values", "errors", "regions"):
        assert getattr(own, key).tobytes() == getattr(back, key).tobytes()
    x, y = random_pairs(100, 10, own.box)
    assert own.at(x, y).amount.tobytes() == back.at(x, y).amount.tobytes()
    own.to_csv(tmp_path / "map.csv")
    with (tmp_path / "map.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header[15::6] == ["TX_1", 'a, "b"_1']
    written = np.array([list(map(float, row)) for row in rows])
    whole = np.column_stack([regions, errors, corners.reshape(count, -1), np.swapaxes(values, 1, 2).reshape(count, -1)])
    assert written.tobytes() == whole.tobytes()


def test_a_row_of_the_csv_file_is_enough_to_interpolate(tmp_path):
    own = table(squares(2), *QUADRATICS, errors=(0.1, 0.2))
    own.to_csv(tmp_path / "map.csv")
    header, *rows = (line.split(",") for line in (tmp_path / "map.csv").read_text().splitlines())
    assert len(rows) == len(own)
    cell = dict(zip(header, map(float, rows[5]), strict=True))
    r, s, t = 0.5, 0.2, 0.3
    x, y = (r * cell[f"{rho}_1"] + s * cell[f"{rho}_2"] + t * cell[f"{rho}_3"] for rho in ("rho1", "rho2"))
    shape = [r * (2 * r - 1), s * (2 * s - 1), t * (2 * t - 1), 4 * r * s, 4 * s * t, 4 * t * r]
    found = own.at(x, y)
    for name, value in {"amount": found.amount, "p1": found.parameters[0], "p2": found.parameters[1]}.items():
        assert sum(n * cell[f"{name}_{node}"] for node, n in enumerate(shape, 1)) == pytest.approx(
            float(value), rel=1e-14
        )
    assert (cell["region"], cell["error"], cell["displacement_error"]) == (5.0, 0.1, 0.2)


def test_with_weights_a_row_of_the_csv_file_tells_the_amount_where_it_has_a_kink(tmp_path):
    plain_one = table(squares(2), lambda x, y: np.hypot(x - 1, 2 * y - 2), lambda x, y: x - 1, lambda x, y: y - 1)
    own = replace(plain_one, weights=(1.0, 2.0))
    x, y = random_pairs(200, 4)
    np.testing.assert_allclose(own.at(x, y).amount, np.hypot(x - 1, 2 * y - 2), atol=1e-12)
    assert np.abs(plain_one.at(x, y).amount - np.hypot(x - 1, 2 * y - 2)).max() > 1e-4
    own.to_csv(tmp_path / "map.csv")
    header, first, *_ = (line.split(",") for line in (tmp_path / "map.csv").read_text().splitlines())
    assert dict(zip(header[-2:], map(float, first[-2:]), strict=True)) == {"weight_p1": 1.0, "weight_p2": 2.0}
    assert Table.from_dict(own.to_dict()).weights == (1.0, 2.0)
    older = {key: value for key, value in own.to_dict().items() if key != "weights"}
    assert Table.from_dict(older).at(x, y).amount.tolist() == plain_one.at(x, y).amount.tolist()
    with pytest.raises(InputError, match="weights"):
        replace(own, weights=(1.0,))


def plain(**changes):
    own = table(squares(2), *QUADRATICS)
    data = {key: getattr(own, key) for key in ("corners", "values", "errors", "regions", "names")}
    return {**data, **{key: change(np.array(data[key])) for key, change in changes.items()}}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"corners": lambda a: a[:, :2]}, "corners: wrong shape"),
        ({"values": lambda a: a[:, :5]}, "values: wrong shape"),
        ({"values": lambda a: a[..., :2]}, "values: wrong shape"),
        ({"errors": lambda a: a[:3]}, "errors: wrong shape"),
        ({"regions": lambda a: a[:3]}, "regions: wrong shape"),
        ({key: lambda a: a[:0] for key in ("corners", "values", "errors", "regions")}, "at least one"),
    ],
)
def test_what_is_no_table_is_refused(changes, words):
    with pytest.raises(InputError, match=words):
        Table(**plain(**changes))


def test_arrays_are_read_only_and_the_line_about_it_is_short():
    own = table(squares(2), *QUADRATICS)
    for key in ("corners", "values", "errors", "regions"):
        assert not getattr(own, key).flags.writeable
    assert repr(own) == "Table(8 triangles over [0.96875, 1.03125] x [0.984375, 1.01562])"
